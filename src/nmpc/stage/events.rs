//! Stages of a system that switches, simulated by events.

use super::memory::Memory;
use super::{Evaluations, Stage, Starts};
use crate::error::{Error, Result};
use crate::event::{Engine, Options, Outcome};
use crate::func::{EvalError, EvalResult};
use crate::linalg::dense::{gemv_transposed, Left};
use crate::system::System;

/// Share of what a control would do in one stage if nothing stuck, below which it does nothing.
const INERT: f64 = 1e-6;

/// The motion of a system over every stage with its exact derivatives, through switches (6.25), sliding modes, impacts and transitions.
/// Stages are independent of each other, and there may be any number of them in a call. One that begins where the last one ended goes on with its
/// step.
///
/// Stages that begin as one that is remembered are not simulated: their results are the same. Contacts and transitions allocate.
pub(in super::super) struct EventStage {
    /// With derivatives, and without.
    full: Motion,
    plain: Motion,
    nx: usize,
    /// Algebraic states, behind the others: the last that were found are the next guess.
    z: Vec<f64>,
    state: Vec<f64>,
    nu: usize,
    np: usize,
    break_away: Vec<Option<[f64; 2]>>,
    /// Room for what the result of a stage depends on, and whether the time is part of that.
    key: Vec<u64>,
    timed: bool,
    /// Room for thresholds, and for the size of what the controls do.
    reach: Vec<[f64; 3]>,
    a: Vec<f64>,
    b: Vec<f64>,
    evaluations: Evaluations,
    failure: Option<String>,
}

/// Stages by one engine.
struct Motion {
    engine: Engine,
    /// Results, behind them the length of the next step; none where results depend on more than data.
    memory: Memory,
    /// Where the last stage ended, and how long the next step of it would have been; zero where that is not known.
    end: Vec<f64>,
    step: f64,
}

impl Motion {
    fn new(system: &System, options: &Options, [nx, kept, width, n_out]: [usize; 4]) -> Result<Motion> {
        let mut engine = Engine::stopping_for_all(system, options)?;
        engine.reserve();
        Ok(Motion { engine, memory: Memory::new(kept, width, n_out + 1), end: vec![f64::NAN; nx], step: 0.0 })
    }

    /// Length of the first step of a stage of the length `h` from a state; zero where nothing says it.
    fn first_step(&self, x: &[f64], h: f64) -> f64 {
        if self.end == x {
            self.step.min(h)
        } else {
            0.0
        }
    }

    /// A stage has ended.
    fn leave(&mut self, next: &[f64], step: f64) {
        self.end.copy_from_slice(next);
        self.step = step;
    }
}

/// An error of a simulation as that of a function: what cannot be simulated has no value.
fn outcome(done: Result<Outcome>) -> EvalResult {
    match done {
        Ok(Outcome::Reached) => Ok(()),
        Err(Error::Interrupted) => Err(EvalError::Stopped),
        Err(Error::User { code, .. }) => Err(EvalError::Fatal(code)),
        Ok(_) | Err(_) => Err(EvalError::Recoverable),
    }
}

fn stopped(k: usize) -> String {
    format!("the simulation of stage {k} stops before its end")
}

fn simulate(
    engine: &mut Engine,
    at: &Starts,
    k: usize,
    [nx, nu, np]: [usize; 3],
    (z, state): (&mut [f64], &mut [f64]),
    first: f64,
    next: &mut [f64],
) -> EvalResult {
    state[..nx].copy_from_slice(&at.x[k * nx..(k + 1) * nx]);
    state[nx..].copy_from_slice(z);
    let mut run = || -> Result<Outcome> {
        engine.reinit(at.t[k], state)?;
        engine.begin_with_step(first);
        engine.set_params(&at.p[k * np..(k + 1) * np])?;
        engine.set_controls(&at.u[k * nu..(k + 1) * nu])?;
        engine.advance(at.t[k] + at.h[k])
    };
    outcome(run())?;
    let (own, algebraic) = engine.state().split_at(nx);
    next.copy_from_slice(own);
    if engine.state().iter().all(|v| v.is_finite()) {
        z.copy_from_slice(algebraic);
        Ok(())
    } else {
        Err(EvalError::Recoverable)
    }
}

impl EventStage {
    /// `options` are those of the simulations; derivatives are added where they are needed. `z` are first values of the algebraic states. About
    /// `kept` stages are remembered.
    pub fn new(system: &System, options: &Options, z: Vec<f64>, kept: usize) -> Result<EventStage> {
        let with = |sensitivity: bool| Options {
            sensitivity: sensitivity.into(),
            dense: false,
            adjoint: false,
            // nothing reads what switched when
            max_log: 0,
            ..options.clone()
        };
        let d = system.dims();
        let nx = d.x - z.len();
        // algebraic states begin at the last ones that were found
        let kept = if z.is_empty() { kept } else { 0 };
        let timed = system.depends_on_time();
        let width = nx + d.u + d.p + 2 + usize::from(timed);
        Ok(EventStage {
            full: Motion::new(system, &with(true), [nx, kept, width, nx + nx * nx + nx * d.u + 2 * d.u])?,
            plain: Motion::new(system, &with(false), [nx, kept, width, nx])?,
            key: Vec::with_capacity(width),
            timed,
            nx,
            z,
            state: vec![0.0; d.x],
            nu: d.u,
            np: d.p,
            break_away: vec![None; d.u],
            reach: vec![[0.0; 3]; d.u],
            a: vec![0.0; nx * nx],
            b: vec![0.0; nx * d.u],
            evaluations: Evaluations::default(),
            failure: None,
        })
    }

    #[cfg(test)]
    pub(super) fn remembered(&self) -> u64 {
        self.full.memory.found
    }

    fn sizes(&self) -> [usize; 3] {
        [self.nx, self.nu, self.np]
    }

    /// Notes what the result of stage `k` depends on.
    fn write_key(&mut self, at: &Starts, k: usize, first: f64) {
        let [nx, nu, np] = self.sizes();
        let data = at.x[k * nx..(k + 1) * nx].iter().chain(&at.u[k * nu..(k + 1) * nu]);
        let data = data.chain(&at.p[k * np..(k + 1) * np]).chain(&at.h[k..=k]).chain(std::iter::once(&first));
        self.key.clear();
        self.key.extend(data.chain(&at.t[k..k + usize::from(self.timed)]).map(|v| v.to_bits()));
    }

    /// One stage with derivatives, column-major, and where controls begin to move something.
    fn stage(&mut self, at: &Starts, k: usize, next: &mut [f64], a: &mut [f64], b: &mut [f64]) -> EvalResult {
        let first = self.full.first_step(&at.x[k * self.nx..(k + 1) * self.nx], at.h[k]);
        self.write_key(at, k, first);
        let mut parts = [next, a, b];
        if let Some(mut found) = self.full.memory.find(&self.key) {
            for part in &mut parts {
                let (own, rest) = found.split_at(part.len());
                part.copy_from_slice(own);
                found = rest;
            }
            let limits = found.chunks_exact(2).map(|l| (!l[0].is_nan()).then_some([l[0], l[1]]));
            self.break_away.iter_mut().zip(limits).for_each(|(b, l)| *b = l);
            let step = found[2 * self.nu];
            self.full.leave(parts[0], step);
            return Ok(());
        }
        let [next, a, b] = &mut parts;
        self.derivatives(at, k, first, [&mut **next, &mut **a, &mut **b])?;
        self.look_for_sticking(at, k, b)?;
        let step = self.full.engine.next_step();
        self.full.leave(next, step);
        if let Some(mut to) = self.full.memory.keep(&self.key) {
            for part in &parts {
                let (own, rest) = to.split_at_mut(part.len());
                own.copy_from_slice(part);
                to = rest;
            }
            let limits = to.chunks_exact_mut(2).zip(&self.break_away);
            limits.for_each(|(l, b)| l.copy_from_slice(&b.unwrap_or([f64::NAN; 2])));
            to[2 * self.nu] = step;
        }
        Ok(())
    }

    /// One stage with derivatives, column-major, whose first step has a length.
    fn derivatives(&mut self, at: &Starts, k: usize, first: f64, [next, a, b]: [&mut [f64]; 3]) -> EvalResult {
        let [nx, nu, np] = self.sizes();
        self.failure = None;
        let algebraic = (&mut self.z[..], &mut self.state[..]);
        simulate(&mut self.full.engine, at, k, [nx, nu, np], algebraic, first, next)
            .inspect_err(|_| self.failure = Some(stopped(k)))?;
        let Some(s) = self.full.engine.sensitivity() else { return Err(EvalError::Recoverable) };
        let all = self.state.len();
        for (i, row) in s.chunks_exact(all + np + nu).take(nx).enumerate() {
            (0..nx).for_each(|j| a[i + j * nx] = row[j]);
            (0..nu).for_each(|j| b[i + j * nx] = row[all + np + j]);
        }
        if a.iter().chain(b.iter()).all(|v| v.is_finite()) {
            Ok(())
        } else {
            self.failure =
                Some(format!("stage {k} can be simulated, but derivatives of its end are not finite numbers"));
            Err(EvalError::Recoverable)
        }
    }

    /// Finds the controls that move nothing, and where they begin to. While a mode slides its weights are affine in the controls
    /// to first order, and it ends where one of them is zero.
    fn look_for_sticking(&mut self, at: &Starts, k: usize, b: &[f64]) -> EvalResult {
        let EventStage { full: Motion { engine, .. }, reach, break_away, nx, nu, .. } = self;
        reach.fill([f64::NEG_INFINITY, f64::INFINITY, 0.0]);
        let u = &at.u[k * *nu..(k + 1) * *nu];
        let mut see = |weight: f64, slope: &[f64], apart: f64| {
            for ((r, u), slope) in reach.iter_mut().zip(u).zip(slope).filter(|e| *e.1 != 0.0) {
                let at = u - weight / slope;
                if at < *u {
                    r[0] = r[0].max(at);
                } else {
                    r[1] = r[1].min(at);
                }
                r[2] = r[2].max(slope.abs() * apart);
            }
        };
        outcome(engine.sliding_weights(&mut see).map(|()| Outcome::Reached))?;
        for (j, found) in break_away.iter_mut().enumerate() {
            let [lower, upper, size] = reach[j];
            let acts = b[j * *nx..(j + 1) * *nx].iter().fold(0.0f64, |m, v| m.max(v.abs()));
            *found = (size > 0.0 && acts <= INERT * at.h[k] * size).then_some([lower, upper]);
        }
        Ok(())
    }
}

impl Stage for EventStage {
    fn values(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult {
        let sizes = self.sizes();
        self.evaluations.values += 1;
        self.failure = None;
        for (k, x) in next.chunks_exact_mut(self.nx).enumerate() {
            let first = self.plain.first_step(&at.x[k * self.nx..(k + 1) * self.nx], at.h[k]);
            self.write_key(at, k, first);
            let Motion { engine, memory, .. } = &mut self.plain;
            let step = if let Some(found) = memory.find(&self.key) {
                let (own, step) = found.split_at(x.len());
                x.copy_from_slice(own);
                step[0]
            } else {
                let algebraic = (&mut self.z[..], &mut self.state[..]);
                simulate(engine, at, k, sizes, algebraic, first, x).inspect_err(|_| self.failure = Some(stopped(k)))?;
                let step = engine.next_step();
                if let Some(to) = memory.keep(&self.key) {
                    let (own, last) = to.split_at_mut(x.len());
                    own.copy_from_slice(x);
                    last[0] = step;
                }
                step
            };
            self.plain.leave(x, step);
        }
        Ok(())
    }

    fn linearise(
        &mut self,
        at: &Starts,
        next: &mut [f64],
        a: &mut [f64],
        b: &mut [f64],
        second: Option<(&[f64], &mut [f64])>,
    ) -> EvalResult {
        debug_assert!(second.is_none(), "problems that switch are made without second derivatives");
        let (nx, nu) = (self.nx, self.nu);
        self.evaluations.values += 1;
        self.evaluations.jacobians += 1;
        for (k, x) in next.chunks_exact_mut(nx).enumerate() {
            let b = &mut b[k * nx * nu..(k + 1) * nx * nu];
            self.stage(at, k, x, &mut a[k * nx * nx..(k + 1) * nx * nx], b)?;
        }
        Ok(())
    }

    fn adjoint(&mut self, at: &Starts, lambda: &[f64], next: &mut [f64], gx: &mut [f64], gu: &mut [f64]) -> EvalResult {
        let (nx, nu) = (self.nx, self.nu);
        let (mut a, mut b) = (std::mem::take(&mut self.a), std::mem::take(&mut self.b));
        self.evaluations.adjoints += 1;
        let done = next.chunks_exact_mut(nx).enumerate().try_for_each(|(k, x)| {
            self.derivatives(at, k, 0.0, [x, &mut a, &mut b])?;
            let (gx, gu) = (&mut gx[k * nx..(k + 1) * nx], &mut gu[k * nu..(k + 1) * nu]);
            gx.fill(0.0);
            gu.fill(0.0);
            let lambda = &lambda[k * nx..(k + 1) * nx];
            gemv_transposed(nx, nx, Left { v: &a, ld: nx }, lambda, gx);
            gemv_transposed(nx, nu, Left { v: &b, ld: nx }, lambda, gu);
            Ok(())
        });
        (self.a, self.b) = (a, b);
        done
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }

    fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    fn break_away(&self, j: usize) -> Option<[f64; 2]> {
        self.break_away[j]
    }
}
