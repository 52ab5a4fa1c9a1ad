//! What the program of a sequence ended at, as a search takes it.

use super::OcpResult;
use crate::nlp::Outcome;
use crate::search::{EarlyTermination, Plan, Rank, Source};
use crate::settings::Settings;

/// A search over these sources, see [`Plan`].
pub(super) fn plan(settings: &Settings, sources: &[Source], effort: f64, least_tried: usize, any: bool) -> Plan {
    Plan { sources: sources.to_vec(), effort, gain: settings.search_gain, least_tried, any }
}

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
