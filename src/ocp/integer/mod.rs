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

use self::levels::Sequence;
use self::space::{Choices, Ended};
use super::optimality::{Optimality, Verdict};
use super::request::Request;
use super::solve::Start;
use super::Ocp;
use crate::error::Result;
use crate::nlp::{Control, Outcome, Statistics};
use crate::search::{explore, Budget, Found, Plan, Source};
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
const NONE_POSSIBLE: &str = "no sequence of choices meets the constraints: even with choices between their values they cannot be met";

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
        let last = last.filter(|r| r.is_solution()).map(|r| r.controls);
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
        let found = explore(&mut space, &plan, &mut budget, control)?;
        let proof = match stop::requested() {
            None if last.is_none() && self.has_costs() => self.prove(&mut space, &found, request, &mut budget, control)?,
            _ => Proof::none(),
        };
        let settled = found.settled;
        let (tried, improved) = (found.tried, proof.better.is_some());
        let first = found.all.into_iter().next().map(|f| f.0);
        let Some(best) = proof.better.or(first) else {
            return Err(stop::requested().map_or_else(
                || crate::error::Error::Internal("no sequence of choices was tried".into()),
                |why| why.error(),
            ));
        };
        let bounds = space.levels.bounds(self, &best.sequence, &best.sequence);
        drop(space);
        self.adopt_choices(&best, bounds, request, control)?;
        let r = self.result.as_mut().ok_or_else(|| crate::error::Error::Internal("a solve without a result".into()))?;
        let own = std::mem::replace(&mut r.stats, Statistics::default());
        let mut stats = budget.stats;
        stats.add(&own);
        r.stats = Statistics { time_total: clock.elapsed().as_secs_f64(), ..stats };
        if !best.is_solution() {
            if matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
                // that of one sequence says nothing of the others
                r.outcome = if proof.is_complete { Outcome::Infeasible } else { Outcome::LocallyInfeasible };
            }
            r.message = match proof.is_complete {
                true => NONE_POSSIBLE.into(),
                false => format!("none of the {tried} sequences of choices that were tried has a solution: {}", r.message),
            };
            return Ok(());
        }
        if let Some(why) = stop::requested() {
            r.tell_cut(why);
        }
        if let Some(o) = r.optimality.as_mut() {
            o.judge_choices(settled && !improved, proof.is_complete, proof.gap);
        }
        Ok(())
    }

    /// What an exact search adds, where there is one for the problem.
    fn prove(
        &self,
        space: &mut Choices,
        found: &Found<Ended, Sequence>,
        request: &Request,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Proof> {
        let best = found.all.first().map(|f| &f.0).filter(|e| e.is_solution());
        let most = budget.spent() + self.settings.search_exact;
        if self.is_of_choices_alone() {
            let proof = self.enumerate(space, best, request, (most, budget), control)?;
            if proof.is_complete {
                return Ok(proof);
            }
            if proof.better.is_some() || !self.relaxes_to_convex() {
                return Ok(Proof { gap: f64::INFINITY, ..proof });
            }
        }
        if self.relaxes_to_convex() {
            let most = budget.spent() + self.settings.search_exact;
            return self.bound_choices(space, best, (most, budget), control);
        }
        Ok(Proof::none())
    }

    /// Solves with the choices of the best sequence, from where its program ended, and reports that.
    fn adopt_choices(&mut self, best: &Ended, bounds: [Vec<f64>; 2], request: &Request, control: &mut Control) -> Result<()> {
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
        let solved = self.solve_chosen(Start::Cold, request, control);
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
