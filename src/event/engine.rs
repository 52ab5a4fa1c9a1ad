//! The loop: steps under error control, switches at their ends.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;

use super::bernstein::{self, Coefficients, First, Sampler, NODES};
use super::explicit::{self, Pair};
use super::field::Field;
use super::next;
use super::path::{self, Path};
use super::radau::{Attempt, Radau};
use super::sens::Sens;
use super::step::Step;
use super::watch::{self, Watch};
use super::{Ambiguity, Kind, Method, Options, Outcome, Run, Statistics, Switch, Zeno};
use crate::dcs::Dcs;
use crate::error::{finite, Error, Result};
use crate::func::EvalError;
use crate::system::System;

/// Rounding.
const EPS: f64 = f64::EPSILON;
/// Intervals between switches that are remembered.
const MEMORY: usize = 8;
/// Steps in a row that look stiff before Radau IIA takes over.
const STIFF_STEPS: usize = 15;

/// What a call of [`Engine::step`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// A step inside of a mode.
    Stepped,
    /// A step that ends at a switch.
    Switched,
    /// Nothing: the time asked for is reached, or the simulation has ended before; see [`Engine::outcome`].
    Done,
}

/// How the search for a switch in a step ended.
enum Found {
    Nothing,
    /// The watch, the relative time, the slope there with respect to time.
    Zero(usize, f64, f64),
    /// The step is too long for what is watched: the error of its interpolation relative to what it may be.
    Coarse(f64),
}

/// Where switches were lately.
struct Recent {
    gaps: [f64; MEMORY],
    n: usize,
    last: f64,
    /// Indicators that vanished, `MEMORY × n_q`.
    zero: Vec<bool>,
}

/// An event-driven simulation, step by step. Memory is allocated when it is made; switches and dense output are
/// appended to lists.
///
/// The vocabulary is that of SUNDIALS: [`Engine::reinit`], [`Engine::step`], [`Engine::advance`],
/// [`Engine::get_dky`].
pub struct Engine {
    options: Options,
    nx: usize,
    rtol: Vec<f64>,
    atol: Vec<f64>,
    field: Field,
    step: Step,
    /// Active sets of the last step.
    step_sets: Vec<Vec<usize>>,
    step_implicit: bool,
    dense_ready: bool,
    radau: Radau,
    pair: Pair,
    implicit: bool,
    /// Modes that turned out to be stiff, by cell; the last entry is for a system without cells.
    stiff: Vec<bool>,
    stiff_steps: usize,
    mild_steps: usize,
    sampler: Sampler,
    samples: Vec<Coefficients>,
    watches: Vec<Watch>,
    /// Order of the zero that a watched function has at the start of the step.
    depart: Vec<u8>,
    w0: Vec<f64>,
    w1: Vec<f64>,
    suspect: Vec<bool>,
    q0: Vec<f64>,
    q1: Vec<f64>,
    dq0: Vec<f64>,
    dq1: Vec<f64>,
    zero: Vec<bool>,
    set: Vec<usize>,
    weights: Vec<f64>,
    node: Vec<f64>,
    t: f64,
    x: Vec<f64>,
    f: Vec<f64>,
    h: f64,
    err_before: f64,
    /// How coarse the last step was, see [`Engine::resolution`].
    coarse: f64,
    /// Algebraic variables at the start and at the end of a step.
    alpha_start: Vec<f64>,
    alpha_end: Vec<f64>,
    /// The step is the first one under its active set.
    fresh: bool,
    /// The active set has to be found before the next step.
    restart: bool,
    recent: Recent,
    crowd: usize,
    outcome: Outcome,
    reason: String,
    switches: Vec<Switch>,
    stats: Statistics,
    path: Option<Path>,
    sens: Option<Sens>,
    interrupt: Option<Arc<AtomicBool>>,
}

impl Engine {
    /// Prepares the simulation of a system. State, controls and parameters are zero until they are set.
    pub fn new(system: &System, options: &Options) -> Result<Engine> {
        let dcs = Dcs::stewart(system)?;
        let nx = dcs.dims().x;
        options.validate(nx)?;
        let field = Field::new(&dcs);
        let spread = |v: &[f64]| (0..nx).map(|i| v[i % v.len()]).collect::<Vec<f64>>();
        let (n_q, n_z, n_cells) = (field.q.len(), field.n_z, field.n_cells);
        let most = n_cells.saturating_sub(field.subs.len());
        let (rtol, atol) = (spread(&options.rtol), spread(&options.atol));
        let finest = rtol.iter().fold(f64::INFINITY, |m, v| m.min(*v));
        let pair = match options.method {
            Method::Dp5 => Pair::Dp5,
            Method::Auto if finest > 1e-5 => Pair::Dp5,
            _ => Pair::Dop853,
        };
        let n_w = n_q + n_cells;
        Ok(Engine {
            options: options.clone(),
            nx,
            rtol,
            atol,
            step: Step::new(nx),
            step_sets: field.subs.iter().map(|s| Vec::with_capacity(s.cells.len())).collect(),
            step_implicit: false,
            dense_ready: false,
            radau: Radau::new(nx, n_z, most)?,
            pair,
            implicit: false,
            stiff: vec![false; n_cells + 1],
            stiff_steps: 0,
            mild_steps: 0,
            sampler: Sampler::new(),
            samples: vec![[0.0; NODES]; n_w],
            watches: Vec::with_capacity(n_w),
            depart: vec![0; n_w],
            w0: vec![0.0; n_w],
            w1: vec![0.0; n_w],
            suspect: vec![false; n_w],
            q0: vec![0.0; n_q],
            q1: vec![0.0; n_q],
            dq0: vec![0.0; n_q * n_z],
            dq1: vec![0.0; n_q * n_z],
            zero: vec![false; n_q],
            set: Vec::with_capacity(2),
            weights: vec![0.0; nx],
            node: vec![0.0; nx],
            t: 0.0,
            x: vec![0.0; nx],
            f: vec![0.0; nx],
            h: 0.0,
            err_before: 1e-4,
            coarse: 0.0,
            alpha_start: Vec::with_capacity(most),
            alpha_end: Vec::with_capacity(most),
            fresh: true,
            restart: true,
            recent: Recent { gaps: [0.0; MEMORY], n: 0, last: 0.0, zero: vec![false; MEMORY * n_q] },
            crowd: 0,
            outcome: Outcome::Reached,
            reason: String::new(),
            switches: Vec::new(),
            stats: Statistics::default(),
            path: options.dense.then(|| Path::new(nx)),
            sens: options.sensitivity.then(|| Sens::new(nx, n_z, most)),
            interrupt: None,
            field,
        })
    }

    /// Sets time and state and clears log, statistics and dense output.
    pub fn reinit(&mut self, t: f64, x: &[f64]) -> Result<()> {
        finite("time", &[t], 1)?;
        finite("state", x, self.nx)?;
        self.t = t;
        self.x.copy_from_slice(x);
        for a in &mut self.field.active {
            a.clear();
        }
        self.restart = true;
        self.h = 0.0;
        self.stiff.fill(false);
        self.recent.n = 0;
        self.recent.last = t;
        self.crowd = 0;
        self.outcome = Outcome::Reached;
        self.reason.clear();
        self.switches.clear();
        self.stats = Statistics::default();
        self.field.counts = Default::default();
        self.radau.newton = 0;
        self.radau.factorisations = 0;
        self.dense_ready = false;
        self.step.h = 0.0;
        if let Some(p) = &mut self.path {
            p.clear();
        }
        if let Some(s) = &mut self.sens {
            s.reset();
        }
        Ok(())
    }

    /// Sets the controls, constant from now on. The active set is found anew.
    pub fn set_controls(&mut self, u: &[f64]) -> Result<()> {
        finite("control", u, self.field.u.len())?;
        self.save_dense()?;
        self.field.u.copy_from_slice(u);
        self.field.forget();
        self.restart = true;
        Ok(())
    }

    /// Sets the parameters. The active set is found anew.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.field.p.len())?;
        self.save_dense()?;
        self.field.p.copy_from_slice(p);
        self.field.forget();
        self.restart = true;
        Ok(())
    }

    /// A flag another thread may raise: the call that runs ends with [`Error::Interrupted`] after the step.
    pub fn set_interrupt(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// State reached.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Derivative of the state under the present active set.
    pub fn derivative(&self) -> &[f64] {
        &self.f
    }

    /// How the simulation stands.
    pub fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Why it ended early, in words.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// The switches so far.
    pub fn switches(&self) -> &[Switch] {
        &self.switches
    }

    /// Dense output so far, if the options ask for it.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_ref()
    }

    /// `∂x/∂(x0, p)` at the time reached, row-major with one row per state, if the options ask for it. After
    /// [`Engine::set_params`] the derivatives are those with respect to changes of the parameters over the whole run.
    pub fn sensitivity(&self) -> Option<&[f64]> {
        self.sens.as_ref().map(|s| &s.s[..])
    }

    /// True where the derivatives hold for one side only, see [`Run::one_sided`].
    pub fn one_sided(&self) -> bool {
        self.sens.as_ref().is_some_and(|s| s.one_sided)
    }

    /// Active modes of a subsystem; empty before the first step.
    pub fn active(&self, subsystem: usize) -> Vec<usize> {
        if self.field.active.get(subsystem).is_none_or(|a| a.is_empty()) {
            return Vec::new();
        }
        self.field.modes(subsystem)
    }

    /// Work so far.
    pub fn stats(&self) -> Statistics {
        Statistics {
            evaluations: self.field.counts.values,
            jacobians: self.field.counts.jacobians,
            newton: self.radau.newton,
            factorisations: self.radau.factorisations,
            ..self.stats
        }
    }

    /// The result so far.
    pub fn into_run(self) -> Run {
        Run {
            outcome: self.outcome,
            stats: self.stats(),
            one_sided: self.one_sided(),
            sensitivity: self.sens.map(|s| s.s),
            reason: self.reason,
            t: self.t,
            x: self.x,
            switches: self.switches,
            path: self.path,
        }
    }

    /// Integrates to time `t`. Time and state are those at the end, or where the simulation ended before.
    pub fn advance(&mut self, t: f64) -> Result<Outcome> {
        while self.step(t)? != Progress::Done {}
        Ok(self.outcome)
    }

    /// Does one step, not beyond `t_stop`.
    pub fn step(&mut self, t_stop: f64) -> Result<Progress> {
        finite("time", &[t_stop], 1)?;
        if t_stop < self.t {
            return Err(Error::Range(format!("time {t_stop} lies behind: {} is reached", self.t)));
        }
        if self.interrupt.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) {
            return Err(Error::Interrupted);
        }
        if self.outcome != Outcome::Reached || self.t == t_stop {
            return Ok(Progress::Done);
        }
        if self.restart {
            self.begin(t_stop)?;
            if self.outcome != Outcome::Reached {
                return Ok(Progress::Done);
            }
        }
        if t_stop - self.t <= 8.0 * EPS * t_stop.abs() {
            // no step fits between
            self.t = t_stop;
            return Ok(Progress::Done);
        }
        self.prepare_step();
        let mut rejected = false;
        loop {
            if self.stats.steps + self.stats.rejections >= self.options.max_steps {
                let text = format!("{} steps were not enough to reach {t_stop}", self.options.max_steps);
                return Ok(self.fail(Outcome::MaxSteps, text));
            }
            let left = t_stop - self.t;
            let wanted = self.h.min(self.options.h_max);
            let last = wanted >= 0.99 * left;
            self.step.h = if last { left } else { wanted };
            if self.step.h <= 4.0 * EPS * self.t.abs() && !last {
                if let Some(p) = self.reach_surface()? {
                    return Ok(p);
                }
                let text = "the step became shorter than rounding: the solution grows without bound, a function is \
                            not defined ahead, or the tolerances are too small";
                return Ok(self.fail(Outcome::StepTooSmall, text.into()));
            }
            let t1 = if last { t_stop } else { self.t + self.step.h };
            match self.attempt()? {
                Tried::Error(err) if err <= 1.0 => {
                    if !self.finish()? {
                        self.reject(&mut rejected, 0.25);
                        continue;
                    }
                    let found = self.search(t1)?;
                    let grown = self.grown(err.max(self.coarse), rejected);
                    match found {
                        Some(Found::Nothing) => {
                            self.err_before = err.max(1e-4);
                            self.accept(t1)?;
                            self.h = grown;
                            return Ok(Progress::Stepped);
                        }
                        Some(Found::Zero(l, s, slope)) => {
                            if let Some(p) = self.land(l, s, slope, grown)? {
                                return Ok(p);
                            }
                            self.reject(&mut rejected, 0.5);
                        }
                        Some(Found::Coarse(e)) => self.reject(&mut rejected, (0.9 * e.powf(-0.25)).clamp(0.1, 0.9)),
                        None => self.reject(&mut rejected, 0.5),
                    }
                }
                Tried::Error(err) => {
                    let factor = self.shrunk(err);
                    self.reject(&mut rejected, factor);
                }
                Tried::Undefined => self.reject(&mut rejected, 0.25),
                Tried::Diverged => self.reject(&mut rejected, 0.35),
            }
        }
    }

    /// `k`-th derivative of the dense output at a time in the last step.
    pub fn get_dky(&mut self, t: f64, k: usize, out: &mut [f64]) -> Result<()> {
        if out.len() != self.nx {
            return Err(Error::Dimension(format!("room for {} values, a state has {}", out.len(), self.nx)));
        }
        if self.step.h == 0.0 {
            return Err(Error::State("there is no dense output before the first step".into()));
        }
        let slack = 8.0 * EPS * self.t.abs();
        if !(t >= self.step.t - slack && t <= self.t + slack) {
            let (a, b) = (self.step.t, self.t);
            return Err(Error::Range(format!("time {t} is outside of the last step, {a} to {b}")));
        }
        self.save_dense()?;
        path::eval(&self.step.poly, (t - self.step.t) / self.step.h, self.step.h, k, out);
        Ok(())
    }

    fn fail(&mut self, outcome: Outcome, reason: String) -> Progress {
        self.outcome = outcome;
        self.reason = format!("t = {}: {reason}", self.t);
        Progress::Done
    }

    fn reject(&mut self, rejected: &mut bool, factor: f64) {
        *rejected = true;
        self.stats.rejections += 1;
        self.h = self.step.h * factor;
    }

    /// The step begins at the present state.
    fn prepare_step(&mut self) {
        self.step.t = self.t;
        let s = &mut self.step;
        for i in 0..self.nx {
            (s.x0[i], s.f0[i]) = (self.x[i], self.f[i]);
        }
        self.dense_ready = false;
        self.radau.invalidate();
        self.step_implicit = self.implicit;
        for (to, from) in self.step_sets.iter_mut().zip(&self.field.active) {
            to.clone_from(from);
        }
    }

    fn set_weights(&mut self, with_end: bool) {
        for (i, w) in self.weights.iter_mut().enumerate() {
            let other = if with_end { self.step.x1[i] } else { self.step.h * self.step.f0[i] };
            let size = self.step.x0[i].abs().max(other.abs());
            *w = 1.0 / (self.atol[i] + self.rtol[i] * size).max(f64::MIN_POSITIVE);
        }
    }

    /// Radau IIA estimates an error of order 3 for a result of order 5: its tolerance is looser.
    fn shrink(&self) -> (f64, f64) {
        let r = self.rtol.iter().fold(f64::INFINITY, |m, v| m.min(*v)).clamp(1e-14, 0.1);
        let inner = 0.06 * r.powf(0.69);
        let shrink = (r / inner).min(1.0);
        // what the iteration may leave is a tenth of the tolerance itself
        (shrink, (0.1 * shrink).max(10.0 * EPS / inner))
    }

    fn attempt(&mut self) -> Result<Tried> {
        let r = if self.implicit {
            self.set_weights(false);
            let (shrink, tol) = self.shrink();
            self.radau.attempt(&mut self.field, &mut self.step, &self.weights, shrink, tol).map(|a| match a {
                Attempt::Error(e) => Tried::Error(e),
                Attempt::Diverged => Tried::Diverged,
            })
        } else {
            explicit::attempt(self.pair, &mut self.field, &mut self.step).map(|()| {
                self.set_weights(true);
                let e = explicit::error(self.pair, &self.step, &self.weights);
                if e.is_finite() {
                    Tried::Error(e)
                } else {
                    Tried::Undefined
                }
            })
        };
        recover(r, Tried::Undefined)
    }

    /// Derivative at the end; false where it is not defined.
    fn finish(&mut self) -> Result<bool> {
        let r = if self.implicit {
            self.radau.finish(&mut self.field, &mut self.step)
        } else if self.pair == Pair::Dop853 {
            explicit::finish(self.pair, &mut self.field, &mut self.step)
        } else {
            Ok(())
        };
        recover(r.map(|()| true), false)
    }

    /// Step length after a success.
    fn grown(&self, err: f64, rejected: bool) -> f64 {
        let factor = if self.implicit {
            let n = super::radau::MAX_NEWTON as f64;
            let safe = 0.9 * (2.0 * n + 1.0) / (2.0 * n + self.radau.last_newton as f64);
            (safe * err.max(1e-8).powf(-0.25)).clamp(0.2, 8.0)
        } else {
            // proportional-integral control, which the pair of order 8 does without
            let (factor, most) = match self.pair {
                Pair::Dp5 => (err.max(1e-10).powf(-0.17) * self.err_before.powf(0.04), 10.0),
                Pair::Dop853 => (1.0 / err.max(1e-10).sqrt().sqrt().sqrt(), 6.0),
            };
            (0.9 * factor).clamp(0.333, most)
        };
        let h = self.step.h * if rejected { factor.min(1.0) } else { factor };
        // the last step before a stop is short for that reason alone
        let wanted = self.h.min(self.options.h_max);
        if !rejected && self.step.h < 0.999 * wanted {
            h.max(wanted)
        } else {
            h
        }
    }

    /// Factor of the step length after a failure.
    fn shrunk(&self, err: f64) -> f64 {
        let order = if self.implicit { 4.0 } else { self.pair.order() };
        (0.9 * err.powf(-1.0 / order)).clamp(0.1, 0.9)
    }

    /// Looks for the first switch in the step; `None` where a function is not defined.
    fn search(&mut self, t1: f64) -> Result<Option<Found>> {
        if self.watches.is_empty() {
            return Ok(Some(Found::Nothing));
        }
        let r = self.search_inner(t1);
        match r {
            Ok(f) => Ok(Some(f)),
            Err(EvalError::Recoverable) => Ok(None),
            Err(EvalError::Fatal(code)) => Err(fatal(code)),
        }
    }

    fn search_inner(&mut self, t1: f64) -> std::result::Result<Found, EvalError> {
        self.field.indicators(t1, &self.step.x1)?;
        self.q1.copy_from_slice(&self.field.q);
        if !self.field.constant_gradients() {
            self.field.gradients(t1, &self.step.x1)?;
            self.dq1.copy_from_slice(&self.field.dq);
        }
        self.coarse = 0.0;
        let e = self.screen()?;
        if e > 1.0 {
            return Ok(Found::Coarse(e));
        }
        // the growth of the step is chosen by an error of order four
        self.coarse = match self.pair {
            _ if self.implicit => e,
            Pair::Dp5 => e * e.sqrt().sqrt(),
            Pair::Dop853 => e * e,
        };
        let n = self.watches.len();
        let any = self.suspect[..n].contains(&true);
        let leaves = self.watches.iter().zip(&self.suspect).any(|(w, s)| *s && w.is_leave());
        if !any {
            return Ok(Found::Nothing);
        }
        self.write_dense()?;
        for i in 1..NODES {
            let s = self.sampler.nodes[i];
            if i < NODES - 1 {
                self.step.at(s, &mut self.node);
                let t = self.step.t + s * self.step.h;
                self.field.indicators(t, &self.node)?;
                if leaves {
                    self.field.hidden(t, &self.node)?;
                }
            }
            for l in 0..self.watches.len() {
                if self.suspect[l] {
                    let end = i == NODES - 1;
                    self.samples[l][i] =
                        if end { self.w1[l] } else { self.watches[l].value(&self.field.q, &self.field) };
                }
            }
        }
        let mut best = Found::Nothing;
        let mut first = f64::INFINITY;
        for l in 0..self.watches.len() {
            if !self.suspect[l] {
                continue;
            }
            self.samples[l][0] = self.w0[l];
            let power = usize::from(self.depart[l]);
            let (c, d) = self.sampler.coefficients(&self.samples[l], power);
            let c = &c[..=d];
            let First::Zero(s) = bernstein::first(c) else { continue };
            if s >= first {
                continue;
            }
            first = s;
            let (v, dv) = (bernstein::value(c, s), bernstein::slope(c, s));
            let slope = match power {
                0 => dv,
                _ => power as f64 * s.powi(power as i32 - 1) * v + s.powi(power as i32) * dv,
            };
            best = Found::Zero(l, s, slope / self.step.h);
        }
        Ok(best)
    }

    /// Looks at every watched function from the ends of the step and its stages: might it vanish in between? And how
    /// well does the step resolve it, which the error of the state says nothing about: `sin 20 x` may go round while
    /// `x` is a straight line, and the weights of a sliding mode may oscillate while the state rests. Returns the
    /// error of a cubic interpolation in the middle of the step, relative to a tenth of the size.
    fn screen(&mut self) -> std::result::Result<f64, EvalError> {
        const FRACTION: f64 = 0.1;
        let (h, t, n_z, nx) = (self.step.h, self.step.t, self.field.n_z, self.nx);
        let mut worst = 0.0f64;
        let n_alg = self.field.n_alg();
        self.alpha_end.clear();
        self.alpha_end.extend_from_slice(&self.field.alpha[..n_alg]);
        if !self.field.constant_gradients() {
            let s = &self.step;
            for (i, m) in self.node.iter_mut().enumerate() {
                *m = 0.5 * (s.x0[i] + s.x1[i]) + 0.125 * h * (s.f0[i] - s.f1[i]);
            }
            self.field.indicators(t + 0.5 * h, &self.node)?;
        }
        for l in 0..self.watches.len() {
            let w = self.watches[l];
            let (w0, depart) = (self.w0[l], self.depart[l]);
            let w1 = w.value(&self.q1, &self.field);
            self.w1[l] = w1;
            let certain = w1.is_nan() || w1 <= 0.0 || depart == 2;
            self.suspect[l] = match w {
                Watch::Leave { cell, .. } => certain || depart > 0 || self.weight_falls(cell, w0, w1),
                Watch::Enter { sub, .. } if self.field.subs[sub].affine => certain || self.nears(&w, w0, w1, depart),
                Watch::Enter { .. } => {
                    let v = w.value(&self.field.q, &self.field);
                    let r0 = w.rate(&self.dq0, n_z, &self.step.f0);
                    let r1 = w.rate(&self.dq1, n_z, &self.step.f1);
                    let error = (v - 0.5 * (w0 + w1) - 0.125 * h * (r0 - r1)).abs();
                    let size = FRACTION * w0.abs().max(w1.abs()).max(v.abs());
                    if error > size {
                        let near = 1e3 * EPS * w.scale(&self.dq1, n_z, t, &self.step.x1).0;
                        worst = worst.max(error / (size + near));
                    } else if size > 0.0 {
                        worst = worst.max(error / size);
                    }
                    // Bernstein coefficients of the cubic, its zero at the start divided out
                    let (b1, b2) = (w0 + h * r0 / 3.0, w1 - h * r1 / 3.0);
                    let (lo, hi) = if depart > 0 {
                        let (c0, c1) = (3.0 * b1, 1.5 * b2);
                        (c0.min(c1).min(w1), c0.max(c1).max(w1))
                    } else {
                        (w0.min(b1).min(b2).min(w1), w0.max(b1).max(b2).max(w1))
                    };
                    certain || lo <= 8.0 * error + 0.1 * (hi - lo)
                }
            };
        }
        if n_alg > 0 {
            self.write_dense()?;
            self.step.at(0.5, &mut self.node);
            self.field.hidden(t + 0.5 * h, &self.node)?;
            for i in 0..n_alg {
                let cubic = self.radau.middle(self.alpha_start[i], nx + i, self.alpha_end[i]);
                worst = worst.max((self.field.alpha[i] - cubic).abs() / FRACTION);
            }
            self.field.alpha[..n_alg].copy_from_slice(&self.alpha_end);
        }
        Ok(if worst.is_finite() { worst } else { 2.0 })
    }

    /// Might the weight of a cell vanish in the step, to judge by its values at the stages?
    fn weight_falls(&self, cell: usize, w0: f64, w1: f64) -> bool {
        let (mut lo, mut hi) = (w0.min(w1), w0.max(w1));
        for z in &self.radau.z {
            let th = self.field.theta_in(&z[self.nx..], cell);
            lo = lo.min(th);
            hi = hi.max(th);
        }
        lo <= 0.5 * (hi - lo) + 1e-3 * hi
    }

    /// Might a function with a constant gradient vanish in the step, to judge by its rates at the stages, with a
    /// margin for what lies between them?
    fn nears(&self, w: &Watch, w0: f64, w1: f64, depart: u8) -> bool {
        let rates = w.rates(&self.dq0, self.field.n_z, &self.step.k);
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for r in &rates[..self.step.n_k] {
            lo = lo.min(*r);
            hi = hi.max(*r);
        }
        let spread = 0.25 * (hi - lo);
        if lo > spread {
            // it grows throughout
            return false;
        }
        if depart > 0 || w0 <= 0.0 {
            return true;
        }
        // it falls throughout and does not reach zero, or is far from it
        hi >= -spread && w0.min(w1) <= self.step.h * hi.abs().max(lo.abs())
    }

    /// Repeats the step with the length that makes the watched function vanish at its end, and switches there. `None`
    /// if that does not succeed.
    fn land(&mut self, l: usize, s: f64, slope: f64, grown: f64) -> Result<Option<Progress>> {
        let full = self.step.h;
        let mut h = s * full;
        let floor = 4.0 * EPS * self.t.abs().max(full);
        if h <= floor {
            // at the start itself: the active set was not the right one
            self.stats.relocations += 1;
            return self.switch(l, slope, 0.25 * full).map(Some);
        }
        let (mut slope, mut before) = (slope, None);
        for _ in 0..12 {
            self.step.h = h;
            self.dense_ready = false;
            self.stats.relocations += 1;
            match self.attempt()? {
                Tried::Error(e) if e <= 10.0 => {}
                _ => return Ok(None),
            }
            if !self.finish()? {
                return Ok(None);
            }
            let Some((value, rate)) = recover(self.watched(l, self.t + h).map(Some), None)? else { return Ok(None) };
            if let Some((v, at)) = before {
                let secant: f64 = (value - v) / (h - at);
                if secant < 0.0 {
                    slope = secant;
                }
            }
            before = Some((value, h));
            let rate = if rate < 0.0 { rate } else { slope };
            let delta = -value / rate;
            if !delta.is_finite() {
                return Ok(None);
            }
            if delta.abs() <= 1e-8 * h || delta.abs() <= floor || self.is_short(delta) {
                if self.overlooked(l) {
                    return Ok(None);
                }
                return self.touch_down(l, slope, grown).map(Some);
            }
            h = (h + delta).clamp(0.2 * h, (5.0 * h).min(1.1 * full));
        }
        // grazing: the length hardly matters for the value any more
        self.touch_down(l, slope, grown).map(Some)
    }

    /// Does another watched function say that a switch before this one was missed? Then a shorter step shows it.
    fn overlooked(&self, l: usize) -> bool {
        (0..self.watches.len()).any(|m| {
            let w = &self.watches[m];
            let near = 1e4 * EPS * w.scale(&self.field.dq, self.field.n_z, self.t, &self.step.x1).0;
            m != l && self.depart[m] == 0 && w.value(&self.field.q, &self.field) < -near.max(1e-2 * self.w0[m])
        })
    }

    /// Is a straight line over this time as good as the step, with a margin?
    fn is_short(&self, delta: f64) -> bool {
        let s = &self.step;
        let bend = 1e3 * delta * delta / s.h;
        let straight = (0..self.nx).all(|i| bend * (s.f1[i] - s.f0[i]).abs() * self.weights[i] <= 1.0);
        !self.step_implicit && delta.abs() <= 0.01 * s.h && straight
    }

    /// Value and rate of a watched function at the end of the step; the rate of a weight is NaN.
    fn watched(&mut self, l: usize, t: f64) -> std::result::Result<(f64, f64), EvalError> {
        let w = self.watches[l];
        self.field.indicators(t, &self.step.x1)?;
        self.field.gradients(t, &self.step.x1)?;
        let value = w.value(&self.field.q, &self.field);
        let rate = if w.is_leave() { f64::NAN } else { w.rate(&self.field.dq, self.field.n_z, &self.step.f1) };
        Ok((value, rate))
    }

    /// The last digits of the switching time: along the velocity, which is exact to rounding over so short a time.
    fn touch_down(&mut self, l: usize, slope: f64, grown: f64) -> Result<Progress> {
        let mut t = self.t + self.step.h;
        for _ in 0..4 {
            let found = self.watched(l, t).map(Some);
            let Some((value, rate)) = recover(found, None)? else { break };
            let rate = if rate < 0.0 { rate } else { slope };
            let scale = self.watches[l].scale(&self.field.dq, self.field.n_z, t, &self.step.x1).0;
            let most = if self.step_implicit { 1e-6 } else { 0.01 } * self.step.h;
            let delta = (-value / rate).clamp(-most, most);
            if value.abs() <= 0.5 * EPS * scale || !delta.is_finite() {
                break;
            }
            for (x, f) in self.step.x1.iter_mut().zip(&self.step.f1) {
                *x += delta * f;
            }
            t += delta;
            if self.field.n_alg() > 0 {
                // the weights at the new point
                let r = self.field.rhs(t, &self.step.x1, &mut self.node).map(|()| true);
                if !recover(r, false)? {
                    break;
                }
            }
        }
        self.w1[..self.watches.len()].fill(f64::NAN);
        self.accept(t)?;
        self.switch(l, slope, grown)
    }

    /// Takes the step over.
    fn accept(&mut self, t1: f64) -> Result<()> {
        if let Some(mut p) = self.path.take() {
            let r = self.save_dense();
            if r.is_ok() {
                p.push(self.step.t, t1, self.step.h, &self.step.poly);
            }
            self.path = Some(p);
            r?;
        }
        if let Some(mut s) = self.sens.take() {
            let r = if self.step_implicit {
                s.implicit(&self.radau, &mut self.field, &self.step)
            } else {
                s.explicit(self.pair, &mut self.field, &self.step, t1 - (self.step.t + self.step.h))
            };
            s.one_sided |= !recover(r.map(|()| true), false)?;
            self.sens = Some(s);
        }
        self.stats.steps += 1;
        self.crowd = 0;
        self.watch_stiffness();
        self.t = t1;
        for i in 0..self.nx {
            (self.x[i], self.f[i]) = (self.step.x1[i], self.step.f1[i]);
        }
        let n = self.watches.len();
        self.w0[..n].copy_from_slice(&self.w1[..n]);
        self.depart[..n].fill(0);
        self.fresh = false;
        std::mem::swap(&mut self.alpha_start, &mut self.alpha_end);
        std::mem::swap(&mut self.q0, &mut self.q1);
        if !self.field.constant_gradients() {
            std::mem::swap(&mut self.dq0, &mut self.dq1);
        }
        Ok(())
    }

    fn watch_stiffness(&mut self) {
        if self.implicit || self.options.method != Method::Auto {
            return;
        }
        if explicit::stiffness(self.pair, &self.step) > self.pair.stability() {
            self.mild_steps = 0;
            self.stiff_steps += 1;
            if self.stiff_steps >= STIFF_STEPS {
                self.implicit = true;
                let none = self.stiff.len() - 1;
                self.stiff[none] |= self.field.active.is_empty();
                for set in &self.field.active {
                    set.iter().for_each(|&c| self.stiff[c] = true);
                }
            }
        } else {
            self.mild_steps += 1;
            if self.mild_steps >= 6 {
                self.stiff_steps = 0;
            }
        }
    }

    fn save_dense(&mut self) -> Result<()> {
        if self.step.h == 0.0 {
            return Ok(());
        }
        let r = self.write_dense();
        recover(r.map(|()| true), false)?;
        Ok(())
    }

    /// Dense output of the last step, evaluated under the active set it had.
    fn write_dense(&mut self) -> std::result::Result<(), EvalError> {
        if self.dense_ready {
            return Ok(());
        }
        if self.step_implicit {
            self.radau.dense(&mut self.step, self.fresh);
        } else {
            let foreign = self.step_sets != self.field.active;
            let present = foreign.then(|| self.field.active.clone());
            if foreign {
                self.field.set_active(&self.step_sets);
            }
            let r = explicit::dense(self.pair, &mut self.field, &mut self.step);
            if let Some(p) = present {
                self.field.set_active(&p);
            }
            r?;
        }
        self.dense_ready = true;
        Ok(())
    }

    /// Finds the active set of the present point and prepares the first step.
    fn begin(&mut self, t_stop: f64) -> Result<()> {
        let before: Vec<Vec<usize>> = self.field.active.clone();
        let first = before.iter().any(Vec::is_empty) || before.is_empty();
        let found = self.begin_inner(first);
        if !recover(found.map(|()| true), false)? {
            self.fail(Outcome::NoContinuation, "the system is not defined at this point".into());
        }
        if self.outcome != Outcome::Reached {
            return Ok(());
        }
        if let Some(s) = &mut self.sens {
            s.dt.fill(0.0);
        }
        if !first {
            self.log(&before, f64::NAN, None, true);
        }
        self.restart = false;
        self.err_before = 1e-4;
        self.h = self.initial_step(t_stop - self.t)?;
        Ok(())
    }

    fn begin_inner(&mut self, first: bool) -> std::result::Result<(), EvalError> {
        let (t, n_z) = (self.t, self.field.n_z);
        self.field.indicators(t, &self.x)?;
        self.field.gradients(t, &self.x)?;
        self.zero.fill(false);
        if !first {
            self.keep_surfaces();
            for l in 0..self.watches.len() {
                if let (Watch::Enter { a, .. }, true) = (self.watches[l], self.depart[l] > 0) {
                    self.zero[a] = true;
                }
            }
        }
        for k in 0..self.field.subs.len() {
            let s = &self.field.subs[k];
            let least = (0..s.n_q).map(|j| self.field.q[s.q0 + j]).fold(f64::INFINITY, f64::min);
            let mut active = usize::MAX;
            for j in 0..s.n_q {
                let a = s.q0 + j;
                let w = Watch::Enter { sub: k, a, b: None, sign: 1.0 };
                let tol = 1e-13 * w.scale(&self.field.dq, n_z, t, &self.x).0;
                let v = self.field.q[a] - if s.signs { 0.0 } else { least };
                self.zero[a] |= v.abs() <= tol;
                if v == 0.0 {
                    active = active.min(j);
                }
            }
            if first {
                // any valid cell: what follows is decided below
                let cell = if s.signs { self.region(k) } else { active.min(s.n_q - 1) };
                let cell = s.first + cell;
                let set = &mut self.field.active[k];
                set.clear();
                set.push(cell);
            }
        }
        let sets = self.field.active.clone();
        self.field.set_active(&sets);
        let candidates = self.candidates();
        self.choose(&candidates, 1.0)?;
        if self.outcome == Outcome::Reached {
            self.enter()?;
            self.project_sensitivity()?;
        }
        Ok(())
    }

    /// The cell of the signs at the present point.
    fn region(&self, k: usize) -> usize {
        let s = &self.field.subs[k];
        let g = |c: usize| -> f64 {
            s.cells[c].weights.iter().enumerate().map(|(j, w)| w * self.field.q[s.q0 + j].signum()).sum()
        };
        (0..s.cells.len()).min_by(|a, b| g(*a).total_cmp(&g(*b))).unwrap_or(0)
    }

    /// Marks the indicators that are tied by the present sliding modes as zero.
    fn keep_surfaces(&mut self) {
        for (s, set) in self.field.subs.iter().zip(&self.field.active) {
            if set.len() < 2 {
                continue;
            }
            for j in 0..s.n_q {
                let w = |c: usize| s.cells[c - s.first].weights[j];
                let tied = if s.signs { set.iter().any(|c| w(*c) != w(set[0])) } else { set.contains(&(s.first + j)) };
                self.zero[s.q0 + j] |= tied;
            }
        }
    }

    /// Cells that may be active next to the present point, by the signs of the indicators that are not zero.
    fn candidates(&self) -> Vec<Vec<usize>> {
        let each = self.field.subs.iter().zip(&self.field.active).map(|(s, set)| {
            let mut c: Vec<usize> = if s.signs {
                let fits = |cell: &usize| {
                    let w = &s.cells[*cell].weights;
                    (0..s.n_q).all(|j| self.zero[s.q0 + j] || w[j] * self.field.q[s.q0 + j] <= 0.0)
                };
                (0..s.cells.len()).filter(fits).map(|c| s.first + c).collect()
            } else {
                (0..s.cells.len()).filter(|j| self.zero[s.q0 + j]).map(|j| s.first + j).collect()
            };
            for &a in set {
                if !c.contains(&a) && (c.is_empty() || !s.signs) {
                    c.push(a);
                }
            }
            c.sort_unstable();
            let mode = |c: usize| s.cells[c - s.first].mode;
            if c.iter().all(|&a| mode(a) == mode(c[0])) {
                c.truncate(1);
            }
            c
        });
        each.collect()
    }

    /// Makes the best continuation the active set.
    fn choose(&mut self, candidates: &[Vec<usize>], length: f64) -> std::result::Result<bool, EvalError> {
        if candidates.iter().all(|c| c.len() == 1) {
            self.field.set_active(candidates);
            return Ok(true);
        }
        let room = (&mut self.node[..], &mut self.step.f[..]);
        if let Some(k) = next::quick(&mut self.field, self.t, &self.x, candidates, room, &mut self.set)? {
            let mut sets = candidates.to_vec();
            sets[k].clone_from(&self.set);
            self.field.set_active(&sets);
            return Ok(true);
        }
        let found = next::next(&mut self.field, self.t, &self.x, candidates, length)?;
        let Some(best) = found.solutions.first() else {
            self.fail(Outcome::NoContinuation, "no active set satisfies the conditions (6.19)".into());
            return Ok(true);
        };
        if found.ambiguous && self.options.ambiguity == Ambiguity::Stop {
            let text = format!("the continuation is not unique: {} active sets are possible", found.solutions.len());
            self.fail(Outcome::Ambiguous, text);
            return Ok(false);
        }
        self.field.set_active(&best.sets);
        Ok(!found.ambiguous)
    }

    /// Prepares the first step under a new active set.
    fn enter(&mut self) -> std::result::Result<(), EvalError> {
        let (t, n_z) = (self.t, self.field.n_z);
        self.field.scale_constraints(t, &self.x)?;
        match self.field.rhs(t, &self.x, &mut self.f) {
            Err(EvalError::Recoverable) => {
                // a mode that begins here may need the last digit
                for k in 0..self.field.subs.len() {
                    let cell = self.field.active[k][0];
                    self.field.nudge(cell, &mut self.x);
                }
                self.field.rhs(t, &self.x, &mut self.f)?;
            }
            r => r?,
        }
        if self.field.project(t, &mut self.x)? {
            self.field.rhs(t, &self.x, &mut self.f)?;
        }
        self.field.indicators(t, &self.x)?;
        self.field.gradients(t, &self.x)?;
        self.q0.copy_from_slice(&self.field.q);
        self.dq0.copy_from_slice(&self.field.dq);
        self.fresh = true;
        self.alpha_start.clear();
        self.alpha_start.extend_from_slice(&self.field.alpha[..self.field.n_alg()]);
        watch::list(&self.field, &mut self.watches);
        let size = self.f.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for l in 0..self.watches.len() {
            let w = self.watches[l];
            let value = w.value(&self.q0, &self.field);
            self.w0[l] = value;
            self.depart[l] = 0;
            let (scale, gradient) = w.scale(&self.dq0, n_z, t, &self.x);
            if w.is_leave() {
                self.depart[l] = u8::from(value <= 1e-9);
                continue;
            }
            let rate = w.rate(&self.dq0, n_z, &self.f);
            if value <= 64.0 * EPS * scale || value <= 8.0 * EPS * rate.abs() * t.abs() {
                self.depart[l] = if rate > 1e-9 * gradient * size { 1 } else { 2 };
            }
        }
        let none = self.stiff.len() - 1;
        let known = self.field.active.iter().flatten().any(|&c| self.stiff[c]) || self.stiff[none];
        self.implicit = self.field.n_alg() > 0
            || self.options.method == Method::Radau5
            || self.options.method == Method::Auto && known;
        self.stiff_steps = 0;
        Ok(())
    }

    /// Switches at the present point, where watch `l` vanishes.
    fn switch(&mut self, l: usize, slope: f64, grown: f64) -> Result<Progress> {
        let before = self.field.active.clone();
        let r = self.switch_inner(l, slope, &before);
        let known = recover(r.map(|()| true), false)?;
        if !known {
            return Ok(self.fail(Outcome::NoContinuation, "the modes around the switch are not defined there".into()));
        }
        self.h = grown;
        self.err_before = 1e-4;
        if self.outcome != Outcome::Reached {
            return Ok(Progress::Done);
        }
        if self.step_implicit && !self.implicit {
            // a sliding mode says nothing about how fast the mode behind it is
            self.h = self.initial_step(grown)?;
        }
        if let Some(p) = self.accumulate()? {
            return Ok(p);
        }
        Ok(Progress::Switched)
    }

    fn switch_inner(&mut self, l: usize, slope: f64, before: &[Vec<usize>]) -> std::result::Result<(), EvalError> {
        let (t, n_z) = (self.t, self.field.n_z);
        // a mode that ends here may have no value any more: its velocity just before serves as well
        match self.field.rhs(t, &self.x, &mut self.node) {
            Ok(()) => self.f.copy_from_slice(&self.node),
            Err(EvalError::Recoverable) => {}
            Err(e) => return Err(e),
        }
        self.field.indicators(t, &self.x)?;
        self.field.gradients(t, &self.x)?;
        self.zero.fill(false);
        let (mut rate, mut cosine) = (slope, f64::NAN);
        for m in 0..self.watches.len() {
            let w = self.watches[m];
            let v = w.value(&self.field.q, &self.field);
            match w {
                Watch::Enter { a, b, .. } => {
                    let r = w.rate(&self.field.dq, n_z, &self.f);
                    let (scale, gradient) = w.scale(&self.field.dq, n_z, t, &self.x);
                    if m == l {
                        let size = self.f.iter().map(|v| v * v).sum::<f64>().sqrt();
                        rate = r;
                        cosine = r / (gradient * size);
                    }
                    let near = 64.0 * EPS * scale + 8.0 * EPS * r.abs() * t.abs().max(self.step.h);
                    if m == l || v.abs() <= near {
                        self.zero[a] = true;
                        if let Some(b) = b {
                            self.zero[b] = true;
                        }
                    }
                }
                Watch::Leave { .. } => {}
            }
        }
        self.keep_surfaces();
        let before_f = self.sens.as_ref().map(|_| self.f.clone());
        if let Some(mut s) = self.sens.take() {
            let w = self.watches[l];
            let r = s.time(&w, &mut self.field, t, &self.x, &self.f);
            self.sens = Some(s);
            r?;
        }
        let candidates = self.candidates();
        let length = self.step.h.abs().max(1e3 * EPS * t.abs());
        let unique = self.choose(&candidates, length)?;
        if self.outcome != Outcome::Reached {
            return Ok(());
        }
        if self.field.active == before {
            // nothing changes: a grazing contact, or a first step too long for its signs
            self.crowd += 1;
        } else {
            self.remember();
        }
        self.enter()?;
        if let (Some(s), Some(f)) = (&mut self.sens, &before_f) {
            if self.field.active == before {
                s.one_sided |= cosine.abs() < 1e-6;
            } else {
                s.jump(f, &self.f);
                s.one_sided |= !unique || cosine.abs() < 1e-6;
            }
        }
        self.project_sensitivity()?;
        if self.crowd > 0 && self.field.active == before {
            self.depart[l] = self.depart[l].max(2);
        }
        if self.crowd > 20 {
            self.fail(Outcome::NoContinuation, "the signs of the active set contradict each other".into());
        }
        self.log(before, rate, Some(cosine), unique);
        Ok(())
    }

    /// A sliding mode that begins ties the derivatives to its surfaces.
    fn project_sensitivity(&mut self) -> std::result::Result<(), EvalError> {
        if let (Some(s), true) = (&mut self.sens, self.field.n_alg() > 0) {
            self.field.hidden(self.t, &self.x)?;
            s.project(&mut self.field);
        }
        Ok(())
    }

    /// Notes the time of a switch and what vanished there.
    fn remember(&mut self) {
        let i = self.recent.n % MEMORY;
        self.recent.gaps[i] = self.t - self.recent.last;
        self.recent.last = self.t;
        let n = self.zero.len();
        self.recent.zero[i * n..(i + 1) * n].copy_from_slice(&self.zero);
        self.recent.n += 1;
    }

    /// Do switches accumulate here? Then the policy decides.
    fn accumulate(&mut self) -> Result<Option<Progress>> {
        if self.recent.n <= MEMORY {
            return Ok(None);
        }
        let half = MEMORY / 2;
        let gap = |i: usize| self.recent.gaps[(self.recent.n + i) % MEMORY];
        let (old, new) = ((0..half).map(gap).sum::<f64>(), (half..MEMORY).map(gap).sum::<f64>());
        let ratio = new / old;
        let stuck = old + new <= 64.0 * EPS * self.t.abs();
        if !(ratio < 0.95 || stuck) {
            return Ok(None);
        }
        let left = if stuck { 0.0 } else { new * ratio / (1.0 - ratio) };
        for i in 0..self.nx {
            let tol = self.atol[i] + self.rtol[i] * self.x[i].abs();
            if self.f[i].abs() * left > 1e-2 * tol.max(4.0 * EPS * self.x[i].abs()) && !stuck {
                return Ok(None);
            }
        }
        let loosest = self.rtol.iter().fold(1e-14f64, |m, v| m.max(*v));
        if left > 1e-2 * loosest * self.t.abs() && !stuck {
            return Ok(None);
        }
        self.stats.accumulations += 1;
        self.recent.n = 0;
        let text = format!("switches accumulate at t = {}", self.t + left);
        if self.options.zeno == Zeno::Stop {
            return Ok(Some(self.fail(Outcome::Zeno, text)));
        }
        let before = self.field.active.clone();
        let n = self.zero.len();
        for m in 0..MEMORY {
            for j in 0..n {
                self.zero[j] |= self.recent.zero[m * n + j];
            }
        }
        self.keep_surfaces();
        let candidates = self.candidates();
        let r = self.choose(&candidates, self.h.max(1e3 * EPS * self.t.abs()));
        let unique = recover(r, false)?;
        if self.outcome != Outcome::Reached {
            return Ok(Some(Progress::Done));
        }
        let tied: usize = self.field.active.iter().map(Vec::len).sum();
        if tied <= before.iter().map(Vec::len).sum() {
            return Ok(Some(self.fail(Outcome::Zeno, text + ", and no sliding mode begins there")));
        }
        let r = self.enter().and_then(|()| self.project_sensitivity());
        if let Some(s) = &mut self.sens {
            s.one_sided = true;
            s.dt.fill(f64::NAN);
        }
        if !recover(r.map(|()| true), false)? {
            return Ok(Some(self.fail(Outcome::Zeno, text + ", where the sliding mode is not defined")));
        }
        self.log(&before, f64::NAN, None, unique);
        Ok(Some(Progress::Switched))
    }

    /// Where a function is not defined beyond a surface, steps only come near it: the rest, no longer than rounding,
    /// goes along the velocity.
    fn reach_surface(&mut self) -> Result<Option<Progress>> {
        let (n_z, nx) = (self.field.n_z, self.nx);
        let mut nearest = (f64::INFINITY, 0, 0.0);
        for l in 0..self.watches.len() {
            let rate = self.watches[l].rate(&self.dq0, n_z, &self.f);
            let left = -self.w0[l] / rate;
            if rate < 0.0 && left >= 0.0 && left < nearest.0 {
                nearest = (left, l, rate);
            }
        }
        let (left, l, rate) = nearest;
        if left > 1e-11 * self.t.abs().max(1.0) || self.field.n_alg() > 0 {
            return Ok(None);
        }
        let s = &mut self.step;
        s.h = left.max(f64::MIN_POSITIVE);
        for i in 0..nx {
            s.x1[i] = s.x0[i] + left * s.f0[i];
            s.poly[i] = [0.0; 8];
            s.poly[i][0] = s.x0[i];
            s.poly[i][1] = left * s.f0[i];
        }
        s.f1.copy_from_slice(&s.f0);
        self.dense_ready = true;
        self.w1[..self.watches.len()].fill(f64::NAN);
        // shorter than rounding: no step that counts for the next length
        let t1 = self.t + left;
        self.accept(t1)?;
        let h = self.step.h.max(1e-6 * t1.abs().max(1e-6));
        self.switch(l, rate, h).map(Some)
    }

    /// Writes what changed to the log.
    fn log(&mut self, before: &[Vec<usize>], rate: f64, cosine: Option<f64>, unique: bool) {
        let modes = |field: &Field, k: usize, set: &[usize]| {
            let s = &field.subs[k];
            let mut m: Vec<usize> = set.iter().map(|c| s.cells[c - s.first].mode).collect();
            m.sort_unstable();
            m.dedup();
            m
        };
        let start = self.switches.len();
        let mut n = 0;
        for (k, set) in before.iter().enumerate() {
            if *set == self.field.active[k] {
                continue;
            }
            let (a, b) = (modes(&self.field, k, set), modes(&self.field, k, &self.field.active[k]));
            if a == b {
                continue;
            }
            n += 1;
            if self.switches.len() >= self.options.max_log {
                continue;
            }
            let kind = if a.iter().all(|m| b.contains(m)) {
                Kind::Enter
            } else if b.iter().all(|m| a.contains(m)) {
                if unique {
                    Kind::Leave
                } else {
                    Kind::Spontaneous
                }
            } else {
                Kind::Cross
            };
            self.switches.push(Switch {
                t: self.t,
                kind,
                simultaneous: false,
                subsystem: k,
                before: a,
                after: b,
                rate,
                transversality: cosine.unwrap_or(f64::NAN),
                unique,
                dt: self.sens.as_ref().map_or_else(Vec::new, |s| s.dt.clone()),
            });
        }
        self.stats.switches += n;
        if let (Some(s), true) = (&mut self.sens, n > 1) {
            s.one_sided = true;
        }
        for s in &mut self.switches[start..] {
            s.simultaneous = n > 1;
        }
    }

    /// Length of the first step, from the size of the first two derivatives.
    fn initial_step(&mut self, longest: f64) -> Result<f64> {
        let most = longest.min(self.options.h_max);
        if self.options.h0 > 0.0 {
            return Ok(self.options.h0.min(most));
        }
        let size = self.x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for i in 0..self.nx {
            // a component that happens to be zero says nothing about its size
            let tol = self.atol[i] + self.rtol[i] * self.x[i].abs().max(1e-6 * size);
            self.weights[i] = 1.0 / tol.max(f64::MIN_POSITIVE);
        }
        let norm = |v: &[f64]| super::step::norm(v, &self.weights);
        let (d0, d1) = (norm(&self.x), norm(&self.f));
        let h = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 }.min(most);
        for ((y, x), f) in self.node.iter_mut().zip(&self.x).zip(&self.f) {
            *y = x + h * f;
        }
        let r = self.field.rhs(self.t + h, &self.node, &mut self.step.f);
        if !recover(r.map(|()| true), false)? {
            return Ok(h);
        }
        for (a, b) in self.step.f.iter_mut().zip(&self.f) {
            *a -= b;
        }
        let d2 = super::step::norm(&self.step.f, &self.weights) / h;
        let order = if self.implicit { 4.0 } else { self.pair.order() };
        let steep = d1.max(d2);
        let h1 = if steep <= 1e-15 { (1e-3 * h).max(1e-6) } else { (0.01 / steep).powf(1.0 / order) };
        Ok((100.0 * h).min(h1).min(most))
    }
}

/// How an attempt at a step ended.
enum Tried {
    Error(f64),
    Undefined,
    Diverged,
}

fn fatal(code: i32) -> Error {
    Error::User { code, what: "a function of the model".into() }
}

/// What is not defined becomes `otherwise`, a fatal code an error.
fn recover<T>(r: std::result::Result<T, EvalError>, otherwise: T) -> Result<T> {
    match r {
        Ok(v) => Ok(v),
        Err(EvalError::Recoverable) => Ok(otherwise),
        Err(EvalError::Fatal(code)) => Err(fatal(code)),
    }
}
