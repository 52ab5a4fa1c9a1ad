//! What the program of a sequence ended at, as a search takes it.

use super::OcpResult;
use crate::nlp::Outcome;
use crate::search::{EarlyTermination, Rank};

impl OcpResult {
    /// A program that was given up has ended at a limit, and was not asked to stop.
    pub(super) fn given_up(mut self, watch: &EarlyTermination) -> OcpResult {
        if watch.is_over() && self.outcome == Outcome::Stopped {
            self.outcome = Outcome::MaxIter;
        }
        self
    }

    /// Its rank by this cost, where costs on the way to it were as large as `largest`.
    pub(super) fn rank(&self, cost: f64, largest: f64) -> Rank {
        Rank {
            feasible: self.is_exact(),
            contradicted: false,
            cost,
            violation: self.residuals.primal,
            idle: 0,
            rounding: f64::EPSILON * largest,
        }
    }
}
