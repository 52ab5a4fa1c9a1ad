//! The search for the first switch in a step: what is watched is screened at the ends and the stages, and sampled on the
//! dense output where that does not exclude a zero.

use super::{fatal, Engine, EPS};
use crate::contact;
use crate::error::Result;
use crate::event::bernstein::{self, Coefficients, First, NODES};
use crate::event::explicit::{self, Pair};
use crate::event::watch::{ContactWatch, Watch};
use crate::event::Contact;
use crate::func::EvalError;
use crate::stop;

/// Weights, which are between 0 and 1, that are zero to the rounding of the linear system they solve.
const WEIGHT_ROUNDING: f64 = 4096.0 * EPS;

/// What interpolations of watched functions may be off by, relative to their size in the step.
const FRACTION: f64 = 0.1;
/// A relative time in the longest gap between the stages of an implicit step, and by how much longer a step has to be than one that
/// was looked at there.
const BETWEEN: f64 = 0.4;
const LONGER: f64 = 1.3;

/// So many local tolerances from zero a function may still touch it: its least value is known to the errors of some steps.
pub(super) const GRAZES: f64 = 10.0;

/// How the search for a switch in a step ended.
pub(super) enum Found {
    Nothing,
    /// The watch, the relative time, the slope there with respect to time.
    Zero(usize, f64, f64),
    /// The step is too long for what is watched: the error of its interpolation relative to what it may be.
    Coarse(f64),
}

impl Engine {
    /// Looks for the first switch in the step; `None` where a function is not defined.
    pub(super) fn search(&mut self, t1: f64) -> Result<Option<Found>> {
        if self.functions.watches.is_empty() {
            return Ok(Some(Found::Nothing));
        }
        let r = self.search_inner(t1);
        match r {
            Ok(f) => Ok(Some(f)),
            Err(EvalError::Recoverable) => Ok(None),
            Err(EvalError::Fatal(code)) => Err(fatal(code)),
            Err(EvalError::Stopped) => Err(stop::error()),
        }
    }

    pub(super) fn search_inner(&mut self, t1: f64) -> std::result::Result<Found, EvalError> {
        if self.field.has_contacts() {
            self.look_near()?;
        }
        self.field.watched(t1, &self.stepper.step.x1)?;
        // what the field keeps is written again before it is read
        std::mem::swap(&mut self.functions.q1, &mut self.field.q);
        if !self.field.constant_gradients() {
            self.field.watched_gradients(t1, &self.stepper.step.x1)?;
            std::mem::swap(&mut self.functions.dq1, &mut self.field.dq);
        }
        self.stepper.coarse = 0.0;
        self.functions.zeros.clear();
        let e = self.screen()?;
        if e > 1.0 {
            return Ok(Found::Coarse(e));
        }
        // the growth of the step is chosen by an error of order four
        self.stepper.coarse = match self.stepper.pair {
            _ if self.stepper.implicit => e,
            // and of order three
            Pair::Bs3 => e,
            Pair::Dp5 => e * e.sqrt().sqrt(),
            Pair::Dop853 => e * e,
        };
        self.functions.suspects.clear();
        self.functions.suspects.extend(self.functions.looked.iter().filter(|l| self.functions.suspect[**l]));
        let any = !self.functions.suspects.is_empty();
        let leaves = self.functions.suspects.iter().any(|l| self.functions.watches[*l].is_leave());
        self.stepper.clears = self.stepper.implicit && (any || self.stepper.step.h > LONGER * self.stepper.clear);
        if self.stepper.clears {
            let e = self.error_between()?;
            if e > 1.0 {
                return Ok(Found::Coarse(e));
            }
        }
        if !any {
            return Ok(Found::Nothing);
        }
        self.write_dense()?;
        let forces = self.wanted_contacts();
        let lines = forces.is_none();
        // weights have functions of their own
        let bent = |l: &usize| {
            let w = &self.functions.watches[*l];
            !w.is_leave() && !w.is_affine(&self.field)
        };
        let by_lines = lines && !self.functions.suspects.iter().any(bent);
        // what is a polynomial on the dense output needs no samples, unless it has a zero at the start
        let exact =
            |e: &Engine, l: usize| lines && e.functions.depart[l] == 0 && e.functions.watches[l].is_affine(&e.field);
        let sampled = self.functions.suspects.iter().any(|l| !exact(self, *l));
        for i in if sampled { 1..NODES } else { 0..0 } {
            let s = self.functions.sampler.nodes[i];
            if i < NODES - 1 {
                let t = self.stepper.step.t + s * self.stepper.step.h;
                if !by_lines {
                    self.stepper.step.at(s, &mut self.stepper.node);
                }
                match forces {
                    _ if by_lines => {}
                    Some(forces) => {
                        self.field.scene_values((t, &self.stepper.node), forces, |c| self.contact_events.wanted[c])?
                    }
                    None => self.field.watched(t, &self.stepper.node)?,
                }
                if leaves {
                    self.sample_weights(i, s, !by_lines)?;
                }
            }
            for &l in &self.functions.suspects {
                let end = i == NODES - 1;
                let w = self.functions.watches[l];
                if exact(self, l) {
                    continue;
                }
                let value = match end {
                    true => self.functions.w1[l],
                    false if lines && w.is_affine(&self.field) => {
                        self.functions.w0[l] + w.change(&self.functions.dq0, &self.field, &self.stepper.step, s)
                    }
                    false if w.is_leave() => self.functions.samples[l][i],
                    false => w.value(&self.field.q, &self.field),
                };
                // a guard that has just been left is zero at the start, up to the rounding of its location, and so is
                // what begins a little below zero
                let below = self.functions.watches[l].may_begin_below()
                    && self.functions.depart[l] > 1
                    && self.functions.w0[l] < 0.0;
                let left = below || self.functions.watches[l].is_left_by_jumps() && self.functions.depart[l] == 1;
                self.functions.samples[l][i] = if left { value - self.functions.w0[l] } else { value };
            }
        }
        self.functions.touched = None;
        self.functions.grazed = f64::INFINITY;
        let mut best = Found::Nothing;
        let mut first = f64::INFINITY;
        // what is beyond zero by less than the tolerances see, and comes back
        let mut shallow = false;
        for k in 0..self.functions.suspects.len() {
            let l = self.functions.suspects[k];
            self.functions.samples[l][0] = self.functions.w0[l];
            if self.rests(l)? {
                self.functions.resting[l] = true;
                continue;
            }
            if let Some(found) = self.first_behind_flat(l) {
                if let Found::Zero(_, s, slope) = found {
                    self.functions.zeros.push((l, s, slope));
                }
                match found {
                    Found::Zero(_, s, _) if s < first => (first, best, shallow) = (s, found, false),
                    Found::Coarse(_) => return Ok(found),
                    _ => {}
                }
                continue;
            }
            let power = usize::from(self.functions.depart[l]);
            let (c, d) = match exact(self, l) {
                true => self.on_dense_output(l),
                false => self.functions.sampler.coefficients(&self.functions.samples[l], power),
            };
            let c = &c[..=d];
            // what is zero to rounding, or below, and does not fall, stays
            let falls = self.functions.w1[l]
                < if self.functions.watches[l].may_begin_below() { self.functions.w0[l].min(0.0) } else { 0.0 };
            let passed = self.functions.watches[l].is_left_by_jumps() && power > 0 && falls;
            let s = match bernstein::first(c) {
                // at rest at zero when the step began, and beyond it at the end
                First::None if passed => 0.0,
                First::None => {
                    let gap = matches!(self.functions.watches[l], Watch::Contact { what: ContactWatch::Gap, .. });
                    let rounding = match exact(self, l) {
                        true => Some(bernstein::ROUNDING),
                        false => Some(bernstein::ROUNDING_OF_SAMPLES).filter(|_| gap && power == 0),
                    };
                    if let Some(s) = rounding.and_then(|rounding| bernstein::nearly_touches(c, rounding)) {
                        self.notice(l, s, bernstein::slope(c, s));
                    } else if let Some(s) = self.grazes(l, power).and_then(|unseen| bernstein::turns_below(c, unseen)) {
                        self.functions.grazed = self.functions.grazed.min(s);
                    }
                    continue;
                }
                First::Touch(s) => {
                    self.notice(l, s, bernstein::slope(c, s));
                    continue;
                }
                First::Zero(s) => s,
            };
            let (v, dv) = (bernstein::value(c, s), bernstein::slope(c, s));
            let slope = match power {
                0 => dv,
                _ => power as f64 * s.powi(power as i32 - 1) * v + s.powi(power as i32) * dv,
            };
            self.functions.zeros.push((l, s, slope / self.stepper.step.h));
            if s >= first {
                continue;
            }
            first = s;
            let crosses = matches!(self.functions.watches[l], Watch::Enter { .. } | Watch::Guard { back: false, .. });
            let unseen = if crosses { self.grazes(l, power) } else { None };
            shallow = unseen.is_some_and(|unseen| bernstein::dips(c, unseen));
            best = Found::Zero(l, s, slope / self.stepper.step.h);
        }
        if let (Found::Zero(l, ..), true) = (&best, self.stepper.clears) {
            // a layer that the step has passed over may have zeros on its dense output that it has not
            let e = if self.functions.watches[*l].is_affine(&self.field) { self.off_between(*l, true) } else { 0.0 };
            if e > 1.0 {
                return Ok(Found::Coarse(e));
            }
        }
        self.log.one_sided |= self.functions.grazed < first || shallow;
        if let (Some(c), true) = (&self.functions.touched, first < f64::INFINITY) {
            // what comes behind a switch does not happen
            if c.t >= self.stepper.step.t + first * self.stepper.step.h {
                self.functions.touched = None;
            }
        }
        Ok(best)
    }

    /// Bernstein coefficients of a watched function with constant gradient on the dense output, and its degree.
    fn on_dense_output(&self, l: usize) -> (Coefficients, usize) {
        let mut powers =
            self.functions.watches[l].change_in_powers(&self.functions.dq0, &self.field, &self.stepper.step);
        powers[0] = self.functions.w0[l];
        let degree = self.stepper.step.degree;
        let mut c = bernstein::of_powers(&powers, degree);
        // the end is known exactly
        c[degree] = self.functions.w1[l];
        (c, degree)
    }

    /// How well does the dense output of an implicit step resolve what is watched, where its gradient is constant? In a stiff component
    /// the error of a step says nothing about that: whatever its forcing does between the stages, the end is right, and it follows
    /// through events that nothing shows. At a point between the stages the distance to the solution is that which one Newton step of
    /// the implicit Euler method takes away, `(γ I / h − J)⁻¹ (f − ẋ)`. Returns the largest one of a watched function relative to a
    /// tenth of its size in the step; for the functions that may vanish only, unless the step is long.
    fn error_between(&mut self) -> std::result::Result<f64, EvalError> {
        let all = self.stepper.step.h > LONGER * self.stepper.clear;
        let concerned =
            |e: &Engine, l: usize| (all || e.functions.suspect[l]) && e.functions.watches[l].is_affine(&e.field);
        if !self.functions.looked.iter().any(|l| concerned(self, *l)) {
            return Ok(0.0);
        }
        self.write_dense()?;
        self.stepper.radau.defect(&mut self.field, &mut self.stepper.step, BETWEEN)?;
        // what has been evaluated is not what stands at the end of the step any more
        let n_alg = self.stepper.alpha_end.len();
        self.field.alpha[..n_alg].copy_from_slice(&self.stepper.alpha_end);
        let each = self.functions.looked.iter().filter(|l| concerned(self, **l)).map(|l| self.off_between(*l, false));
        let worst = each.fold(0.0f64, f64::max);
        Ok(if worst.is_finite() { worst } else { 2.0 })
    }

    /// The distance that [`Engine::error_between`] has found, of watched function `l`.
    fn off_between(&self, l: usize, with_start: bool) -> f64 {
        let w = self.functions.watches[l];
        let off =
            |scale: f64| w.rate_at(&self.functions.dq0, &self.field, |i| scale * self.stepper.radau.off(i, with_start));
        let off = (off(1.0) - off(0.0)).abs();
        let between = self.functions.w0[l] + w.change(&self.functions.dq0, &self.field, &self.stepper.step, BETWEEN);
        let near =
            1e3 * EPS * w.scale(&self.functions.dq0, &self.field, self.stepper.step.t, &self.stepper.step.x1).value;
        off / (FRACTION * self.functions.w0[l].abs().max(self.functions.w1[l].abs()).max(between.abs()) + near)
    }

    /// Weights that are sampled at relative time `s`, the `i`-th node; the state there is known, or is written. Those of an
    /// implicit step are on the cubic through its stages: as functions of a state between the stages they would show the error
    /// of the interpolation, enlarged by what is stiff.
    fn sample_weights(&mut self, i: usize, s: f64, known: bool) -> std::result::Result<(), EvalError> {
        let t = self.stepper.step.t + s * self.stepper.step.h;
        if self.stepper.implicit {
            let (weights, nx) = (self.stepper.radau.cubic(s), self.nx);
            for j in 0..self.stepper.alpha_start.len() {
                self.field.alpha[j] = self.stepper.radau.between(
                    &weights,
                    self.stepper.alpha_start[j],
                    nx + j,
                    self.stepper.alpha_end[j],
                );
            }
            for &l in &self.functions.suspects {
                if let Watch::Leave { cell, .. } = self.functions.watches[l] {
                    self.functions.samples[l][i] = self.field.theta(cell);
                }
            }
            self.field.alpha[..self.stepper.alpha_end.len()].copy_from_slice(&self.stepper.alpha_end);
            return Ok(());
        }
        if !known {
            self.stepper.step.at(s, &mut self.stepper.node);
        }
        let mut evaluated = false;
        for k in 0..self.functions.suspects.len() {
            let l = self.functions.suspects[k];
            let Watch::Leave { cell, .. } = self.functions.watches[l] else { continue };
            let alone = if evaluated { None } else { self.field.weight_alone(cell, t, &self.stepper.node) };
            self.functions.samples[l][i] = match alone {
                Some(v) => v,
                None => {
                    if !std::mem::replace(&mut evaluated, true) {
                        self.field.hidden(t, &self.stepper.node)?;
                    }
                    self.field.theta(cell)
                }
            };
        }
        Ok(())
    }

    /// Is a watched function zero to rounding at all samples of the step? The state rests on a surface that its velocity
    /// is tangent to, or moves off it by less than it can hold: nothing happens. Where it leaves the surface, signs that
    /// are rounding are not taken for signs.
    fn rests(&mut self, l: usize) -> std::result::Result<bool, EvalError> {
        let w = self.functions.watches[l];
        if self.functions.depart[l] == 0 {
            return Ok(false);
        }
        if w.is_leave() {
            // a field at the limit of what the others hold
            return Ok(self.functions.samples[l].iter().all(|v| v.abs() <= WEIGHT_ROUNDING));
        }
        let dq = if self.field.constant_gradients() { &self.functions.dq0 } else { &self.functions.dq1 };
        let noise = match w {
            Watch::Guard { .. } => 128.0 * w.rounding(dq, &self.field, self.stepper.step.t, &self.stepper.step.x1),
            // a force that has vanished without another mode that follows: what the choice of modes takes for zero is zero here, too
            Watch::Contact { what, .. } if what.is_force() && self.functions.depart[l] > 1 => {
                contact::ZERO * w.scale(dq, &self.field, self.stepper.step.t, &self.stepper.step.x1).value
            }
            _ => 64.0 * EPS * w.scale(dq, &self.field, self.stepper.step.t, &self.stepper.step.x1).value,
        };
        let noise = noise.max(self.level_at_start(l));
        if self.functions.samples[l].iter().all(|v| v.abs() <= noise) {
            return Ok(true);
        }
        if matches!(w, Watch::Guard { .. }) && self.field.n_alg() > 0 {
            // what a sliding mode leaves of a velocity moves it by as little in every step, however many there are
            let drift = noise + self.stepper.step.h * self.rate_noise(&w)?;
            let base = if self.functions.depart[l] == 1 { 0.0 } else { self.functions.w0[l] };
            if self.functions.samples[l].iter().skip(1).all(|v| (v - base).abs() <= drift) {
                return Ok(true);
            }
        }
        let samples = &mut self.functions.samples[l];
        for (v, s) in samples.iter_mut().zip(&self.functions.sampler.nodes).skip(1) {
            if *v <= 0.0 && *v >= -noise {
                *v = noise * s.powi(i32::from(self.functions.depart[l]));
            }
        }
        Ok(false)
    }

    /// Least value of a watched function that is not told from one that touches zero: the local tolerances of the states, projected on it, a few
    /// times. None where its zero means something else, or has been divided out, and where no derivatives are recorded: only they have sides.
    fn grazes(&mut self, l: usize, power: usize) -> Option<f64> {
        let recorded = self.derivatives.sens.is_some() || self.derivatives.tape.is_some();
        if power > 0 || !recorded {
            return None;
        }
        let (w, s) = (self.functions.watches[l], &self.stepper.step);
        let reach = match w {
            Watch::Contact { contact, what: ContactWatch::Gap, .. } => {
                // sizes that are kept are those of where the contact was looked at first
                let row = &mut self.contact_events.scene.row;
                row.clear();
                row.resize(self.field.n_z, 0.0);
                let known =
                    self.field.with_contacts(s.t + s.h, &s.x1, |c, at, _| c.dynamics.gap_gradient(at, contact, row));
                if !matches!(known, Some(Ok(()))) {
                    return None;
                }
                self.field.sum_of_sizes(row[..self.nx].iter().copied().enumerate(), &s.x1)
            }
            Watch::Enter { .. } | Watch::Guard { back: false, .. } => {
                let dq = if self.field.constant_gradients() { &self.functions.dq0 } else { &self.functions.dq1 };
                w.scale(dq, &self.field, s.t, &s.x1).reach
            }
            Watch::Contact { .. } | Watch::Guard { .. } | Watch::Leave { .. } => return None,
        };
        // sizes of states are not below `atol / rtol`
        Some(GRAZES * self.rtol.iter().fold(0.0f64, |m, v| m.max(*v)) * reach)
    }

    /// A watched function touches zero at relative time `s`.
    fn notice(&mut self, l: usize, s: f64, slope: f64) {
        let sub = match self.functions.watches[l] {
            Watch::Enter { sub, .. } => sub,
            // it does not happen, but would under any disturbance
            Watch::Guard { back, .. } => {
                self.functions.grazed = if back { self.functions.grazed } else { self.functions.grazed.min(s) };
                return;
            }
            Watch::Contact { contact, what, .. } => {
                self.functions.grazed = self.functions.grazed.min(s);
                if what != ContactWatch::Gap {
                    return;
                }
                contact
            }
            Watch::Leave { .. } => return,
        };
        let rate = slope / self.stepper.step.h;
        let dq = if self.field.constant_gradients() { &self.functions.dq0 } else { &self.functions.dq1 };
        let gradient = self.functions.watches[l].steepness(dq, &self.field);
        let speed = self.stepper.step.f1.iter().map(|v| v * v).sum::<f64>().sqrt();
        let t = self.stepper.step.t + s * self.stepper.step.h;
        if self.functions.touched.is_none_or(|c| t < c.t) {
            self.functions.touched =
                Some(Contact { t, subsystem: sub, rate, transversality: rate / (gradient * speed) });
        }
    }

    /// Looks at every watched function from the ends of the step and its stages: might it vanish in between? And how
    /// well does the step resolve it, which the error of the state says nothing about: `sin 20 x` may go round while
    /// `x` is a straight line, and the weights of a sliding mode may oscillate while the state rests. Returns the
    /// error of a cubic interpolation in the middle of the step, relative to a tenth of the size.
    pub(super) fn screen(&mut self) -> std::result::Result<f64, EvalError> {
        let (h, t, nx) = (self.stepper.step.h, self.stepper.step.t, self.nx);
        self.functions.resting[..self.functions.watches.len()].fill(false);
        self.functions.suspect[..self.functions.watches.len()].fill(false);
        let mut worst = 0.0f64;
        let n_alg = self.field.n_alg();
        self.stepper.alpha_end.clear();
        self.stepper.alpha_end.extend_from_slice(&self.field.alpha[..n_alg]);
        let contacts = self.field.has_contacts();
        if !self.field.constant_gradients() {
            if self.stepper.fresh && !contacts {
                worst = self.look_aside()?;
            }
            let s = &self.stepper.step;
            for (i, m) in self.stepper.node.iter_mut().enumerate() {
                *m = 0.5 * (s.x0[i] + s.x1[i]) + 0.125 * h * (s.f0[i] - s.f1[i]);
            }
            self.field.watched(t + 0.5 * h, &self.stepper.node)?;
        }
        if contacts {
            self.look_inside()?;
        }
        for k in 0..self.functions.looked.len() {
            let l = self.functions.looked[k];
            let w = self.functions.watches[l];
            let (w0, depart) = (self.functions.w0[l], self.functions.depart[l]);
            let w1 = w.value(&self.functions.q1, &self.field);
            self.functions.w1[l] = w1;
            let certain = w1.is_nan() || w1 <= 0.0 || depart >= 2;
            self.functions.suspect[l] = match w {
                Watch::Leave { cell, .. } => certain || depart > 0 || self.weight_falls(cell, w0, w1),
                _ if w.is_affine(&self.field) => certain || self.nears(&w, w0, w1, depart),
                Watch::Contact { contact, what, .. } if what.is_force() => {
                    let (low, e) = self.screen_force(l, contact, what);
                    worst = worst.max(e);
                    certain || depart > 0 || low
                }
                _ => {
                    let v = if contacts { self.functions.samples[l][1] } else { w.value(&self.field.q, &self.field) };
                    let r0 = w.rate_in(&self.functions.q0, &self.functions.dq0, &self.field, &self.stepper.step.f0);
                    let r1 = w.rate_in(&self.functions.q1, &self.functions.dq1, &self.field, &self.stepper.step.f1);
                    let error = (v - 0.5 * (w0 + w1) - 0.125 * h * (r0 - r1)).abs();
                    worst = worst.max(self.off_cubic(&w, error, [w0, v, w1]));
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
        if n_alg > 0 && !self.stepper.implicit {
            let error = explicit::weights_error(self.stepper.pair, &self.field, &self.stepper.alpha_start);
            worst = worst.max(error / FRACTION);
        } else if n_alg > 0 {
            self.write_dense()?;
            self.stepper.step.at(0.5, &mut self.stepper.node);
            self.field.hidden(t + 0.5 * h, &self.stepper.node)?;
            let weights = self.stepper.radau.cubic(0.5);
            for i in 0..n_alg {
                let cubic = self.stepper.radau.between(
                    &weights,
                    self.stepper.alpha_start[i],
                    nx + i,
                    self.stepper.alpha_end[i],
                );
                worst = worst.max((self.field.alpha[i] - cubic).abs() / FRACTION);
            }
            self.field.alpha[..n_alg].copy_from_slice(&self.stepper.alpha_end);
        }
        Ok(if worst.is_finite() { worst } else { 2.0 })
    }

    /// An error of the interpolation of a watched function, relative to a tenth of its size in the step.
    fn off_cubic(&self, w: &Watch, error: f64, values: [f64; 3]) -> f64 {
        let size = FRACTION * values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if error > size {
            let near =
                1e3 * EPS * w.scale(&self.functions.dq1, &self.field, self.stepper.step.t, &self.stepper.step.x1).value;
            error / (size + near)
        } else if size > 0.0 {
            error / size
        } else {
            0.0
        }
    }

    /// The same at a point away from the middle, for the first step under an active set: its length is a guess, and as a part of the time that the
    /// run is for it is a number of periods as likely as not, of which ends and middle show nothing. Periods that the golden section of
    /// the step does not show either are many.
    fn look_aside(&mut self) -> std::result::Result<f64, EvalError> {
        const ASIDE: f64 = 0.381_966_011_250_105_15;
        let (h, t) = (self.stepper.step.h, self.stepper.step.t);
        let back = 1.0 - ASIDE;
        let (c0, c1) = ((1.0 + 2.0 * ASIDE) * back * back, ASIDE * ASIDE * (3.0 - 2.0 * ASIDE));
        let (d0, d1) = (h * ASIDE * back * back, -h * ASIDE * ASIDE * back);
        let s = &self.stepper.step;
        for (i, m) in self.stepper.node.iter_mut().enumerate() {
            *m = c0 * s.x0[i] + c1 * s.x1[i] + d0 * s.f0[i] + d1 * s.f1[i];
        }
        self.field.watched(t + ASIDE * h, &self.stepper.node)?;
        let bent = self.functions.looked.iter().map(|l| (self.functions.w0[*l], self.functions.watches[*l]));
        let bent = bent.filter(|(_, w)| !w.is_leave() && !w.is_affine(&self.field));
        Ok(bent.fold(0.0, |worst, (w0, w)| {
            let (v, w1) = (w.value(&self.field.q, &self.field), w.value(&self.functions.q1, &self.field));
            let r0 = w.rate_in(&self.functions.q0, &self.functions.dq0, &self.field, &self.stepper.step.f0);
            let r1 = w.rate_in(&self.functions.q1, &self.functions.dq1, &self.field, &self.stepper.step.f1);
            let error = (v - c0 * w0 - c1 * w1 - d0 * r0 - d1 * r1).abs();
            f64::max(worst, self.off_cubic(&w, error, [w0, v, w1]))
        }))
    }

    /// Might the weight of a cell vanish in the step, to judge by its values at the stages?
    pub(super) fn weight_falls(&self, cell: usize, w0: f64, w1: f64) -> bool {
        let (mut lo, mut hi) = (w0.min(w1), w0.max(w1));
        let mut note = |th: f64| (lo, hi) = (lo.min(th), hi.max(th));
        if self.stepper.implicit {
            self.stepper.radau.z.iter().for_each(|z| note(self.field.theta_in(&z[self.nx..], cell)));
        } else {
            let (least, largest) = self.field.theta_at_stages(cell, 1..self.stepper.step.n_k - 1);
            note(least);
            note(largest);
        }
        lo <= 0.5 * (hi - lo) + 1e-3 * hi
    }

    /// Might a function with a constant gradient vanish in the step, to judge by its rates at the stages, with a
    /// margin for what lies between them?
    pub(super) fn nears(&self, w: &Watch, w0: f64, w1: f64, depart: u8) -> bool {
        let (lo, hi) = w.rates(&self.functions.dq0, &self.field, &self.stepper.step.k, self.stepper.step.n_k);
        let spread = 0.25 * (hi - lo);
        if lo > spread {
            // it grows throughout
            return false;
        }
        if depart > 0 || w0 <= 0.0 {
            return true;
        }
        // it falls throughout and does not reach zero, or is far from it
        hi >= -spread && w0.min(w1) <= self.stepper.step.h * hi.abs().max(lo.abs())
    }
}
