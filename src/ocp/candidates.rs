//! Exact answers of a search. The cheapest one counts, unless its own controls lead elsewhere: where a solution is not unique, on a
//! surface that both sides lead away from, a program picks the continuation that costs least, and nothing else does.

use super::accuracy::Accuracy;
use super::optimality::Verdict;
use super::request::{Comparison, Request};
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::nlp::{allowance, Outcome, Statistics};
use crate::stop::Why;

/// Tolerance of the simulation that answers are compared with.
const TOLERANCE: f64 = 1e-7;
/// Difference, relative, up to which a simulation costs the same.
const SAME: f64 = 1e-3;

/// What starts of a search found.
#[derive(Default)]
pub(super) struct Candidates {
    /// The cheapest exact answer.
    pub best: Option<Box<Ocp>>,
    /// The cheapest of the others that simulations agree with.
    pub spare: Option<Box<Ocp>>,
    /// What a descent on simulations says of the best one, where its derivatives alone do not.
    pub still: Option<Verdict>,
    /// What a best answer costs that no distance from surfaces leads away from: it is not tried again.
    pub astray: Option<f64>,
    /// Why a part of the search was cut, where one was.
    pub cut: Option<Why>,
    /// Several ways led to the best one, and it costs what the smoothed problem promised.
    pub agreed: bool,
    /// Answers of smoothed problems whose mode programs have none.
    pub missed: Vec<OcpResult>,
    /// What came closest of what is no answer, where iterations are counted.
    pub closest: Option<Box<OcpResult>>,
    /// Sizes of the quantities of the problem.
    pub known: Sizes,
    /// What all took, and the seconds to build their problems.
    pub spent: Statistics,
    pub time_build: f64,
    /// Iterations times variables.
    pub work: usize,
}

/// Cost of an answer, infinite where there is none.
pub(super) fn cost_of(one: &Option<Box<Ocp>>) -> f64 {
    one.as_ref().map_or(f64::INFINITY, |b| b.priced())
}

impl Candidates {
    /// Counts what a solve took.
    pub fn add(&mut self, r: &OcpResult) {
        self.spent.add(&r.stats);
        self.work += r.stats.iterations * r.dimensions.0;
        self.time_build += r.time_build;
        let closer = |c: &OcpResult| r.residuals.primal < c.residuals.primal;
        if allowance::left() < usize::MAX && r.outcome == Outcome::MaxIter && self.closest.as_deref().is_none_or(closer)
        {
            self.closest = Some(Box::new(r.clone()));
        }
    }

    /// Cost of the best.
    pub fn cost(&self) -> f64 {
        cost_of(&self.best)
    }

    /// Is the best one certified, by its derivatives or by a descent on simulations?
    pub fn is_certified(&mut self) -> Result<bool> {
        let Some(best) = self.best.as_mut() else { return Ok(false) };
        let own = best.judged()?.map(|o| o.verdict);
        let certified = |v: Option<Verdict>| matches!(v, Some(Verdict::LocalOptimum | Verdict::Kink));
        Ok(certified(own) || certified(self.still))
    }

    /// A new best; the one before may become the spare one.
    pub fn replace(&mut self, one: Box<Ocp>, request: &Request) -> Result<()> {
        self.still = None;
        match self.best.replace(one) {
            Some(old) => self.keep(old, request),
            None => Ok(()),
        }
    }

    /// Keeps an exact answer as the spare one, where it is cheaper than that and its simulation agrees.
    pub fn keep(&mut self, mut one: Box<Ocp>, request: &Request) -> Result<()> {
        let cost = one.priced();
        if cost < cost_of(&self.spare) && one.simulated_cost(request)?.is_some_and(|s| agree(s, cost)) {
            self.spare = Some(one);
        }
        Ok(())
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

    /// Cost of the last answer in a simulation of its controls; infinite where that does not get to the end, `None` where it
    /// cannot be compared: constraints at the end may then be missed by a little, and nobody knows what that is worth.
    pub(super) fn simulated_cost(&mut self, request: &Request) -> Result<Option<f64>> {
        if !self.costs_compare() {
            return Ok(None);
        }
        Ok(self.simulated(request)?.map(|a| self.cost_in(&a)))
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
        let (Some(b), Some(r)) = (self.built.take(), self.result.take()) else { return Ok(None) };
        let comparison = Comparison { tol: TOLERANCE, by_stage: false };
        let w = b.solver.solution().x.clone();
        let params = b.extended.params.clone();
        let found = self.compare(&r, &b.problem, &w, &b.extended, &params, comparison, &request.options);
        (self.built, self.result) = (Some(b), Some(r));
        match found {
            Ok(a) => Ok(Some(a)),
            Err(Error::Interrupted | Error::OutOfTime) => Ok(None),
            Err(e) => Err(e),
        }
    }
}
