//! Which search a problem has, and what becomes of its best solution.

use std::time::Instant;

use super::candidates::Candidates;
use super::moves::NOTHING;
use super::optimality::Verdict;
use super::request::Request;
use super::solve::{Before, Start};
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::mpcc::Polish;
use crate::nlp::{Control, Outcome, Statistics};
use crate::settings::OcpStart;
use crate::stop::{self, Why};

/// Share of the time that is left that an exact search may take before others.
pub(super) const HALF: f64 = 0.5;
/// Share of the time that is left that a search may take.
pub(super) const SEARCH: f64 = 0.9;
/// Share of the cost by which one must be lower to count as better.
pub(super) const GAIN: f64 = 1e-7;

impl OcpResult {
    /// A solution of a search that was cut says so.
    pub(super) fn tell_cut(&mut self, why: Why) {
        if self.outcome != Outcome::Solved {
            return;
        }
        self.add_remark(&format!("{} before the search had ended: other answers may be cheaper", why.words()));
        self.ended = self.ended.or(Some(why.into()));
    }

    /// Are there elements without length?
    pub(super) fn has_idle(&self) -> bool {
        self.trajectory.elements.iter().any(|e| e.h <= NOTHING * self.durations[e.stage])
    }

    /// Does it solve the discretised problem, whatever else there is to say of it?
    pub(super) fn is_solution(&self) -> bool {
        self.outcome == Outcome::Solved || self.ended.is_some()
    }

    /// Is it a solution whose active set is exact, or of a problem without pairs? Its multipliers are those of the problem then.
    pub(super) fn has_exact_modes(&self) -> bool {
        self.is_solution() && (self.polish == Polish::Done || self.dimensions.2 == 0)
    }

    /// Is the active set exact, or nothing switches?
    pub(super) fn is_exact(&self) -> bool {
        self.is_solution() && self.polish != Polish::Rejected
    }
}

impl Ocp {
    /// Solves as the request says where to start from; from elsewhere than cold, and where modes are given, as
    /// [`Ocp::run`].
    pub(super) fn search(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<&OcpResult> {
        let last = self.shifted.take().filter(|_| start == Start::Warm);
        let asked = start == Start::Cold && request.start != OcpStart::Homotopy;
        if (asked || last.is_some()) && self.may_smooth(request) {
            return self.search_filippov(last, request, control);
        }
        self.run_from_several(start, request, control)
    }

    /// Controls moved along a direction within their bounds.
    pub(super) fn moved(&self, controls: &[f64], direction: &[f64], step: f64) -> Vec<f64> {
        let bounds = (0..self.n_stages).flat_map(|k| {
            let [lower, upper] = self.control_bounds(k);
            lower.iter().zip(upper)
        });
        let moved = controls.iter().zip(direction).zip(bounds);
        moved.map(|((u, d), (l, h))| (u + step * d).clamp(*l, *h)).collect()
    }

    /// Takes over the best answer with what was built for it, and reports it.
    pub(super) fn adopt(
        &mut self,
        found: Candidates,
        request: &Request,
        control: &mut Control,
        clock: Instant,
    ) -> Result<&OcpResult> {
        let mut found = found;
        let cost = found.cost();
        let taken = found.best.take().and_then(|mut f| f.built.take().map(|b| (b, f.builds, f.result)));
        let Some((mut b, builds, before)) = taken else {
            return Err(Error::Internal("no answer was found".into()));
        };
        let stage_params = b.extended.params.clone();
        let still = found.still;
        self.measured = Some(found.known.clone());
        self.largest = self.largest.max(cost.abs());
        self.builds += builds;
        let accuracy = before.as_ref().and_then(|r| r.accuracy.clone());
        let known = Before { stats: Statistics::default(), cut: None, accuracy };
        let reported = self.report(&mut b, &stage_params, known, request, control);
        self.built = Some(b);
        let mut r = reported?;
        // where there is no time to judge it again
        if let Some(known) = before.and_then(|b| b.optimality).filter(|_| stop::requested().is_some()) {
            if r.optimality.as_ref().is_some_and(|o| o.verdict == Verdict::Unknown) {
                r.optimality = Some(known);
                self.withhold_verdict(&mut r);
            }
        }
        if let (Some(o), Some(verdict)) = (r.optimality.as_mut().filter(|o| o.is_open()), still) {
            o.certify_by_descent(verdict);
            self.withhold_verdict(&mut r);
        }
        if let Some(why) = found.cut {
            r.tell_cut(why);
        }
        self.result = Some(r);
        self.tell_cheaper_guess()?;
        self.spent_in_all(&found, clock)
    }

    /// The result is what all of this took.
    pub(super) fn spent_in_all(&mut self, found: &Candidates, clock: Instant) -> Result<&OcpResult> {
        let r = self.result.as_mut().ok_or_else(|| Error::Internal("a solve without a result".into()))?;
        r.time_build = found.time_build;
        r.stats = Statistics { time_total: clock.elapsed().as_secs_f64() - found.time_build, ..found.spent };
        Ok(r)
    }

    /// Is one answer better than another?
    pub(super) fn has_costs(&self) -> bool {
        self.lagrange.is_some() || self.mayer.is_some() || !self.squares.is_empty() || !self.soft.is_empty()
    }

    /// Is there a smoothed problem, and are its answers of use: is there a cost to compare, is the exact active set wanted, and
    /// simulated?
    fn may_smooth(&self, request: &Request) -> bool {
        let s = &self.system;
        self.has_costs()
            && self.modes.is_none()
            && self.complementarity.is_empty()
            && s.is_of_modes_alone()
            && self.switches()
            && request.options.solver.polish
            && request.options.discretisation.discretisation == crate::settings::Discretisation::Fesd
    }
}
