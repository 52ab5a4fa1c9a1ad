//! The best of several solves, and what it costs in a simulation. Where a solution is not unique, on a surface that both sides lead away from, a
//! program picks the continuation that costs least, and nothing else does.

use super::accuracy::Accuracy;
use super::request::{Comparison, Request};
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::nlp::Statistics;
use crate::stop::Why;

/// Difference, relative, up to which a simulation costs the same.
const SAME: f64 = 1e-3;

/// The best of several solves.
#[derive(Default)]
pub(super) struct Candidates {
    /// The cheapest solution.
    pub best: Option<Box<Ocp>>,
    /// Why a search was cut, where it was.
    pub cut: Option<Why>,
    /// Sizes of the quantities of the problem.
    pub known: Sizes,
    /// What all took, and the seconds to build their problems.
    pub spent: Statistics,
    pub time_build: f64,
}

impl Candidates {
    /// Counts what a solve took.
    pub fn add(&mut self, r: &OcpResult) {
        self.spent.add(&r.stats);
        self.time_build += r.time_build;
    }

    /// Cost of the best, infinite where there is none.
    pub fn cost(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |b| b.priced())
    }
}

/// Is an answer of this cost what its simulation is? One that does not get to the end agrees with none.
pub(super) fn agree(simulated: f64, cost: f64) -> bool {
    simulated.is_finite() && (simulated - cost).abs() <= SAME * simulated.abs().max(cost.abs())
}

impl Ocp {
    /// What the last answer costs by itself, infinite where there is none.
    pub(super) fn priced(&self) -> f64 {
        self.result.as_ref().map_or(f64::INFINITY, |r| r.priced)
    }

    /// Can costs of answers and of simulations be compared?
    pub(super) fn costs_compare(&self) -> bool {
        self.terminal.is_empty() && self.boundary.is_empty()
    }

    /// Cost of the last answer in a simulation of its controls, infinite where that does not get to the end.
    pub(super) fn cost_in(&self, simulated: &Accuracy) -> f64 {
        let price = self.result.as_ref().map_or(0.0, |r| r.priced - r.cost_reached);
        if simulated.reached() {
            simulated.cost + price
        } else {
            f64::INFINITY
        }
    }

    /// The simulation of the controls of the last answer from the start to the end; `None` without an answer, or without the time.
    pub(super) fn simulated(&mut self, request: &Request) -> Result<Option<Accuracy>> {
        let (Some(b), Some(mut r)) = (self.built.take(), self.result.take()) else { return Ok(None) };
        let comparison = Comparison { tol: self.settings.accuracy_tol, by_stage: false };
        let w = b.solver.solution().x.clone();
        let params = b.extended.params.clone();
        let found = self.compare(&r, &b.problem, &w, &b.extended, &params, comparison, &request.options);
        r.accuracy = found.as_ref().ok().cloned();
        (self.built, self.result) = (Some(b), Some(r));
        match found {
            Ok(a) => Ok(Some(a)),
            Err(Error::Interrupted | Error::OutOfTime) => Ok(None),
            Err(e) => Err(e),
        }
    }
}
