//! Whole simulations by steps.

use super::{Options, Statistics, Stepper};
use crate::error::Result;
use crate::memory;
use crate::system::System;

/// An impulse of a step that is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepImpulse {
    /// The place of its step in [`Steps::times`]; the step ends at that time.
    pub record: usize,
    /// The contact.
    pub contact: usize,
    /// Normal impulse, then along the tangents there are.
    pub impulse: [f64; 3],
}

/// States after steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Steps {
    /// Times, the first is the start.
    pub times: Vec<f64>,
    /// States, row-major `times × states`: coordinates, then velocities.
    pub states: Vec<f64>,
    /// Impulses that are not zero of the steps that end at these times, if asked for.
    pub impulses: Vec<StepImpulse>,
    /// Counts of the work, and how the steps went.
    pub statistics: Statistics,
}

/// Simulates a scene by steps from `x0` at `t0` to `t1`, controls and parameters zero; for others make a [`Stepper`].
///
/// # Errors
/// Those of [`Stepper::new`], [`Stepper::reset`] and [`Stepper::step`].
pub fn simulate_steps(system: &System, options: &Options, t0: f64, x0: &[f64], t1: f64) -> Result<Steps> {
    let mut s = Stepper::new(system, options)?;
    s.reset(t0, x0)?;
    s.run(t1)
}

impl Stepper {
    /// Makes equal steps, not longer than that of the options, that end at time `t1`, and keeps states of them.
    ///
    /// # Errors
    /// Those of [`Stepper::step`], and [`crate::error::Error::Library`] if there is no memory for what is to be kept.
    pub fn run(&mut self, t1: f64) -> Result<Steps> {
        self.run_recording(t1, self.options.record_every as u64, self.options.record_impulses)
    }

    /// How many states [`Stepper::run_recording`] keeps, the present one included.
    pub fn count_records(&self, t1: f64, every: u64) -> Result<usize> {
        Ok(1 + self.count_steps(t1)?.div_ceil(every.max(1)) as usize)
    }

    /// [`Stepper::run`] with other choices of what is kept than those of the options.
    pub fn run_recording(&mut self, t1: f64, every: u64, impulses: bool) -> Result<Steps> {
        let (n, every) = (self.count_steps(t1)?, every.max(1));
        let kept = n / every + 2;
        let size = self.x.len();
        memory::need(u128::from(kept) * (size as u128 + 1) * 8, || format!("{kept} states of {size} numbers"))?;
        let mut out = Steps {
            times: Vec::with_capacity(kept as usize),
            states: Vec::with_capacity(kept as usize * size),
            impulses: Vec::new(),
            statistics: Statistics::default(),
        };
        out.times.push(self.t);
        out.states.extend_from_slice(&self.x);
        let (from, h) = (self.t, (t1 - self.t) / n as f64);
        for k in 1..=n {
            let end = if k == n { t1 } else { from + h * k as f64 };
            self.step_to(end, h)?;
            if k % every != 0 && k != n {
                continue;
            }
            if impulses {
                let record = out.times.len();
                let of = |&contact: &usize| StepImpulse { record, contact, impulse: self.impulses[contact] };
                out.impulses.extend(self.held.iter().map(of).filter(|i| i.impulse != [0.0; 3]));
            }
            out.times.push(self.t);
            out.states.extend_from_slice(&self.x);
        }
        out.statistics = self.statistics();
        Ok(out)
    }
}
