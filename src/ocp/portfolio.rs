//! Which search a problem has, and what becomes of its best solution.

use std::time::Instant;

use super::candidates::Candidates;
use super::moves::NOTHING;
use super::optimality::{Optimality, Verdict};
use super::request::Request;
use super::solve::{Before, Start};
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::mpcc::Polish;
use crate::nlp::{allowance, Control, Outcome, Statistics};
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

    /// Where all iterations of the call are spent, a solution says so; what is none has ended there.
    pub(super) fn tell_spent(&mut self, request: &Request) {
        if !allowance::is_over() {
            return;
        }
        let most = request.options.solver.max_iter;
        if self.is_solution() {
            self.add_remark(&format!(
                "all max_iter = {most} iterations are spent: the search for better answers was cut short"
            ));
        } else if self.outcome == Outcome::Stalled {
            self.outcome = Outcome::MaxIter;
            self.message = format!("max_iter = {most} iterations are not enough; {}", self.message);
        }
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

    /// Is it known to be none?
    pub(super) fn is_not_optimal(&self) -> bool {
        self.optimality.as_ref().is_some_and(|o| o.verdict == Verdict::NotOptimal)
    }

    /// Is it known to be a local optimum?
    pub(super) fn is_optimum(&self) -> bool {
        self.optimality.as_ref().is_some_and(Optimality::is_optimum)
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

    /// Takes over the best answer with what was built for it, and reports it.
    pub(super) fn adopt(&mut self, found: &mut Candidates, request: &Request, control: &mut Control) -> Result<()> {
        let cost = found.cost();
        let taken = found.best.take().and_then(|mut f| f.built.take().map(|b| (b, f.builds, f.result)));
        let Some((mut b, builds, before)) = taken else {
            return Err(Error::Internal("no answer was found".into()));
        };
        let stage_params = b.extended.params.clone();
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
        if let Some(why) = found.cut {
            r.tell_cut(why);
        }
        self.result = Some(r);
        self.tell_cheaper_guess()
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
