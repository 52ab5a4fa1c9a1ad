//! Optimal control with controls that choose.
//!
//! With all choices made a problem is one like any other: the controls that choose are fixed in every stage. [`space`] says to the
//! [search](crate::search) which sequences of choices there are, where they come from, and what lies next to one. A search finds good
//! sequences soon, and knows of no better one next to its answer. Two exact searches go on from there within a limit of work:
//!
//! - [`enumerate`] simulates all sequences, stage by stage, where nothing but choices is free;
//! - [`bound`] bounds whole sets of sequences by problems whose choices are anywhere between their values, where these are convex.
//!
//! One that comes to its end proves that no sequence is better.

mod bound;
mod convex;
mod enumerate;
mod levels;
mod space;
#[cfg(test)]
mod tests;

use std::time::Instant;

use self::enumerate::Simulated;
use self::space::{Choices, Ended};
use super::optimality::{Optimality, Verdict};
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::nlp::{Control, Outcome, Statistics};
use crate::search::{explore, Budget, Plan, Source};
use crate::stop;

/// What an exact search says.
struct Proof {
    /// The best sequence, where it is another one than that of the search.
    better: Option<Ended>,
    /// Largest share of the cost by which a sequence may be cheaper than the best; infinite where nothing is known.
    gap: f64,
    /// Did it come to its end?
    is_complete: bool,
}

impl Proof {
    /// Nothing is known.
    fn none() -> Proof {
        Proof { better: None, gap: f64::INFINITY, is_complete: false }
    }
}

/// What is said of a problem without an answer.
const NONE_POSSIBLE: &str =
    "no sequence of choices meets the constraints: even with choices between their values they cannot be met";

impl Ocp {
    /// Solves with the choices as they are fixed or narrowed.
    pub(super) fn solve_chosen(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        if self.has_transitions() {
            return self.solve_transitions(start, request, control).map(|_| ());
        }
        self.search(start, request, control).map(|_| ())
    }

    /// Solves a problem whose controls choose. A warm start begins with the sequence of the last answer and looks next to it.
    pub(super) fn solve_choices(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        let clock = Instant::now();
        let last = if start == Start::Warm { self.result.take() } else { None };
        let mut last = last.filter(|r| r.is_solution()).map(|r| r.controls);
        if self.shifted.take().is_some() {
            // the last solution one stage later, which stands where guesses do
            (last, self.x_guess) = (self.u_guess.take(), None);
        }
        self.chosen = None;
        let mut budget = Budget::new(f64::INFINITY);
        let mut space = Choices::new(self, last.clone(), request)?;
        let plan = Plan {
            sources: match last {
                Some(_) => vec![Source::Guess],
                None => vec![Source::Guess, Source::Relaxation, Source::Simulation, Source::Samples],
            },
            effort: if last.is_some() { 0.0 } else { self.settings.search_effort },
            gain: self.settings.search_gain,
            least_tried: request.search,
            any: !self.has_costs(),
        };
        let convex = last.is_none() && self.relaxes_to_convex();
        if convex {
            let r = space.relax(&mut budget, control)?.clone();
            if matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
                // of a convex problem the one is the other
                return self.adopt_infeasible(space.levels.widest_bounds(self), r, budget.stats, clock);
            }
        }
        let mut proof = Proof::none();
        if last.is_none() && self.has_costs() {
            proof = self.simulate_all(&mut space, request, (&mut budget, control))?;
        }
        let (mut tried, mut settled, mut first) = (0, true, None);
        if !(proof.is_complete && proof.better.is_some()) {
            let found = explore(&mut space, &plan, &mut budget, control)?;
            let best = found.all.first().map(|f| &f.0).filter(|e| e.is_solution());
            if last.is_none() && !proof.is_complete && stop::requested().is_none() {
                proof = self.prove(&mut space, best, convex, request, (&mut budget, control))?;
            }
            settled = found.settled && proof.better.is_none();
            tried = found.tried;
            first = found.all.into_iter().next().map(|f| f.0);
        }
        let Some(best) = proof.better.or(first) else {
            return Err(stop::requested()
                .map_or_else(|| Error::Internal("no sequence of choices was tried".into()), |why| why.error()));
        };
        let bounds = space.levels.bounds(self, &best.sequence, &best.sequence);
        drop(space);
        self.adopt_choices(&best, bounds, request, control)?;
        let r = self.result.as_mut().ok_or_else(|| Error::Internal("a solve without a result".into()))?;
        let own = std::mem::take(&mut r.stats);
        let mut stats = budget.stats;
        stats.add(&own);
        r.stats = Statistics { time_total: clock.elapsed().as_secs_f64(), ..stats };
        if !best.is_solution() {
            if matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
                // that of one sequence says nothing of the others
                r.outcome = if proof.is_complete { Outcome::Infeasible } else { Outcome::LocallyInfeasible };
            }
            r.message = match proof.is_complete {
                true => "no sequence of choices meets the constraints".into(),
                false => {
                    format!("none of the {tried} sequences of choices that were tried has a solution: {}", r.message)
                }
            };
            return Ok(());
        }
        if let Some(why) = stop::requested() {
            r.tell_cut(why);
        }
        if let Some(o) = r.optimality.as_mut() {
            o.judge_choices(settled, proof.is_complete, proof.gap);
        }
        Ok(())
    }

    /// Simulates all sequences where there is work for that: no search is needed then.
    fn simulate_all(
        &self,
        space: &mut Choices,
        request: &Request,
        (budget, control): (&mut Budget, &mut Control),
    ) -> Result<Proof> {
        let limit = self.settings.search_exact;
        if !self.is_of_choices_alone() {
            return Ok(Proof::none());
        }
        let mut simulated = Simulated::new(self, None, request)?;
        if simulated.work_of_all(budget)? > limit {
            return Ok(Proof::none());
        }
        let most = budget.spent() + limit;
        self.enumerate(space, simulated, None, (most, budget), control)
    }

    /// What an exact search adds to the best sequence that is known, where there is one for the problem.
    fn prove(
        &self,
        space: &mut Choices,
        best: Option<&Ended>,
        convex: bool,
        request: &Request,
        (budget, control): (&mut Budget, &mut Control),
    ) -> Result<Proof> {
        let most = budget.spent() + self.settings.search_exact;
        if convex {
            return self.bound_choices(space, best, (most, budget), control);
        }
        if self.is_of_choices_alone() {
            let simulated = Simulated::new(self, best, request)?;
            return self.enumerate(space, simulated, best, (most, budget), control);
        }
        Ok(Proof::none())
    }

    /// Where choices between their values cannot meet the constraints, no sequence can.
    fn adopt_infeasible(
        &mut self,
        bounds: [Vec<f64>; 2],
        mut r: OcpResult,
        stats: Statistics,
        clock: Instant,
    ) -> Result<()> {
        self.chosen = Some(bounds);
        r.outcome = Outcome::Infeasible;
        r.message = match r.message.as_str() {
            "" => NONE_POSSIBLE.into(),
            why => format!("{NONE_POSSIBLE}: {why}"),
        };
        r.stats = Statistics { time_total: clock.elapsed().as_secs_f64(), ..stats };
        self.result = Some(r);
        Ok(())
    }

    /// One solve with fixed choices and all that surrounds it.
    fn solve_adopted(&mut self, request: &Request, control: &mut Control) -> Result<()> {
        if self.settings.adapt_tol > 0.0 && !self.has_transitions() {
            self.adapt(Start::Cold, request, control)?;
        } else {
            self.solve_chosen(Start::Cold, request, control)?;
        }
        self.follow_contacts(Start::Cold, request, control)?;
        self.impose_between(request, control)
    }

    /// Solves with the choices of the best sequence, from where its program ended, and reports that.
    fn adopt_choices(
        &mut self,
        best: &Ended,
        bounds: [Vec<f64>; 2],
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        self.chosen = Some(bounds);
        let guesses = (self.x_guess.take(), self.u_guess.take());
        let elements = &best.result.trajectory.elements;
        let rises = elements.iter().all(|e| e.h > 0.0);
        if let (Some(first), true) = (elements.first(), rises) {
            let times = std::iter::once(0.0).chain(elements.iter().map(|e| e.t + e.h - first.t)).collect();
            let states = first.x0.iter().chain(elements.iter().flat_map(|e| &e.x1)).copied().collect();
            self.x_guess = Some((times, states));
        }
        self.u_guess = Some(best.result.controls.clone());
        let solved = self.solve_adopted(request, control);
        (self.x_guess, self.u_guess) = guesses;
        solved
    }
}

impl Optimality {
    /// What an answer is among all choices: a verdict so far was one among answers with the same choices.
    fn judge_choices(&mut self, settled: bool, proven: bool, gap: f64) {
        if !matches!(self.verdict, Verdict::LocalOptimum | Verdict::Kink) {
            return;
        }
        if gap.is_finite() {
            self.gap = gap;
        }
        if proven {
            (self.verdict, self.reason) = (Verdict::Global, "no other choices are better");
        } else if settled {
            self.reason = "choices next to these were tried, and none is better";
        } else {
            self.withdraw("not all choices next to these were tried");
        }
    }
}
