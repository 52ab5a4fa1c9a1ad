//! What programs keep between calls: objects with a model, settings, a state and results, and who listens to them.
//!
//! Interfaces for other languages convert arguments and results and do nothing else; what happens at a call is here.
//! - [`Integrator`]: an event-driven simulation step by step, with stop times, progress, log lines, settings that change.
//! - [`Batch`]: many simulations of one system on several threads.
//! - [`Record`]: what is left of a simulation, in the hands of the caller.

mod batch;
mod integrator;

pub use batch::{Around, Batch};
pub use integrator::{Decide, Integrator, Lines, StepKind, Watch};

use crate::error::{Error, Result};
use crate::event::{Outcome, Run, MODES_ON_DEMAND};
use crate::func::trouble;
use crate::memory;
use crate::system::System;

/// How a simulation stands: as the engine says, or stopped from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ending {
    /// What the engine says.
    pub outcome: Outcome,
    /// Somebody who listens, or an interrupt, asked to stop.
    pub stopped: bool,
}

impl Ending {
    /// Was the time asked for reached?
    pub fn is_reached(self) -> bool {
        !self.stopped && self.outcome == Outcome::Reached
    }

    /// In a word.
    pub fn name(self) -> &'static str {
        if self.stopped {
            "stopped"
        } else {
            self.outcome.name()
        }
    }
}

/// Result of an event-driven simulation, independent of the object it comes from.
#[derive(Clone)]
pub struct Record {
    /// What the engine found.
    pub run: Run,
    /// How it ended.
    pub ending: Ending,
    /// Where it began.
    pub t_start: f64,
    /// Wall time.
    pub seconds: f64,
    /// Modes of the subsystems that can switch.
    pub n_modes: Vec<i64>,
}

impl Record {
    /// A copy, if there is room for one.
    ///
    /// # Errors
    /// [`Error::Dimension`] or [`Error::Library`] where there is not enough memory.
    pub fn copy(&self) -> Result<Record> {
        memory::need(self.run.bytes() as u128, || "a copy of the run".into())?;
        Ok(self.clone())
    }
}

/// [`System::mode_counts`], and those that are made on demand.
fn modes_of(system: &System) -> Vec<i64> {
    let on_demand = system.on_demand().map(|_| MODES_ON_DEMAND);
    system.mode_counts().into_iter().chain(on_demand).map(|n| n as i64).collect()
}

/// Runs `body`, which may call user functions, and says which one it was that ended it.
///
/// # Errors
/// What the user function that ended it complains about, else those of `body`.
pub fn listening<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    let (result, troubles) = trouble::collect(true, body);
    match &troubles.fatal {
        Some(complaint) => Err(complaint.error()),
        None => result,
    }
}

/// The place of a subsystem that switches.
fn subsystem(index: i64, n: usize) -> Result<usize> {
    usize::try_from(index)
        .ok()
        .filter(|&k| k < n)
        .ok_or_else(|| Error::Dimension(format!("there is no subsystem {index} that switches, their number is {n}")))
}
