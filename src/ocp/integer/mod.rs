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
mod phases;
mod space;

use std::time::Instant;

pub(crate) use self::levels::{Levels, PastChoice, Sequence};

use self::enumerate::Simulated;
use self::space::{Choices, Ended, Motion};
use super::optimality::{Optimality, Verdict};
use super::portfolio::{HALF, SEARCH};
use super::programs::plan;
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::nlp::{Control, Outcome, Statistics};
use crate::search::{explore, Budget, Source};
use crate::stop::{self, Why};

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

/// What is said of the best sequence.
struct Claim {
    /// Were all sequences next to it tried?
    settled: bool,
    is_proven: bool,
    gap: f64,
    /// Why the search was cut, where it was.
    cut: Option<Why>,
}

impl Claim {
    fn nothing() -> Claim {
        Claim { settled: false, is_proven: false, gap: f64::INFINITY, cut: None }
    }
}

/// What a search over choices ended with.
struct SearchOver {
    /// The best sequence, with the bounds of all controls where its choices are made.
    best: Option<(Ended, [Vec<f64>; 2])>,
    /// The problem with choices between their values, where that shows that there is no answer.
    relaxed: Option<OcpResult>,
    tried: usize,
    claim: Claim,
}

/// An exact search that time has cut proves nothing; what was found before it stays.
fn in_time(proof: Result<Proof>) -> Result<Proof> {
    match proof {
        Err(Error::Interrupted | Error::OutOfTime) => Ok(Proof::none()),
        other => other,
    }
}

/// What is said of a problem without an answer.
const NONE_POSSIBLE: &str =
    "no sequence of choices meets the constraints: even with choices between their values they cannot be met";

impl Ocp {
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
        // what is left behind the search is for its best sequence
        let found = control.sooner(SEARCH, |control| self.search_choices(last, request, &mut budget, control))?;
        match (found.best, found.relaxed) {
            (Some((best, bounds)), _) => {
                self.adopt_choices(&best, bounds, request, control)?;
                self.tell_of_choices(best.is_solution(), found.tried, &found.claim)?;
            }
            (None, Some(relaxed)) => self.result = Some(relaxed),
            (None, None) => {
                let none = || Error::Internal("no sequence of choices was tried".into());
                return Err(stop::requested().or(found.claim.cut).map_or_else(none, |why| why.error()));
            }
        }
        let r = self.result.as_mut().ok_or_else(|| Error::Internal("a solve without a result".into()))?;
        let own = std::mem::take(&mut r.stats);
        budget.stats.add(&own);
        r.stats = Statistics { time_total: clock.elapsed().as_secs_f64(), ..budget.stats };
        Ok(())
    }

    /// The best sequence of a search, and what may be said of it.
    fn search_choices(
        &self,
        last: Option<Vec<f64>>,
        request: &Request,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<SearchOver> {
        let is_cold = last.is_none();
        let all = [Source::Guess, Source::Relaxation, Source::Simulation, Source::Samples];
        let (sources, effort) = if is_cold { (&all[..], self.settings.search_effort) } else { (&all[..1], 0.0) };
        let plan = plan(&self.settings, sources, effort, request.search, !self.has_costs());
        let mut space = Choices::new(self, last, request)?;
        let convex = is_cold && self.relaxes_to_convex();
        if convex {
            let r = space.relax(budget, control)?;
            if matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
                // of a convex problem the one is the other, and where choices between their values do not help no sequence does
                let why = if r.message.is_empty() { String::new() } else { format!(": {}", r.message) };
                let relaxed = OcpResult {
                    outcome: Outcome::Infeasible,
                    message: format!("{NONE_POSSIBLE}{why}"),
                    stats: Statistics::default(),
                    ..r.clone()
                };
                return Ok(SearchOver { best: None, relaxed: Some(relaxed), tried: 0, claim: Claim::nothing() });
            }
        }
        let mut proof = Proof::none();
        if is_cold && self.has_costs() {
            let all = control.sooner(HALF, |control| self.simulate_all(&mut space, request, (budget, control)));
            proof = in_time(all)?;
        }
        let (mut tried, mut settled, mut first) = (0, true, None);
        if !(proof.is_complete && proof.better.is_some()) {
            let found = explore(&mut space, &plan, Vec::new(), budget, control)?;
            let best = found.all.first().map(|f| &f.0).filter(|e| e.is_solution());
            if is_cold && !proof.is_complete && stop::requested().is_none() {
                proof = in_time(self.prove(&mut space, best, convex, request, (budget, control)))?;
            }
            settled = found.settled && proof.better.is_none();
            tried = found.tried;
            first = found.all.into_iter().next().map(|f| f.0);
        }
        let claim = Claim { settled, is_proven: proof.is_complete, gap: proof.gap, cut: stop::requested() };
        let with_bounds = |e: Ended| {
            let bounds = space.levels.bounds(self, &e.sequence, &e.sequence);
            (e, bounds)
        };
        Ok(SearchOver { best: proof.better.or(first).map(with_bounds), relaxed: None, tried, claim })
    }

    /// Writes into the result what is known of its choices among all.
    fn tell_of_choices(&mut self, solved: bool, tried: usize, claim: &Claim) -> Result<()> {
        let r = self.result.as_mut().ok_or_else(|| Error::Internal("a solve without a result".into()))?;
        if !solved {
            if matches!(r.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) {
                // that of one sequence says nothing of the others
                r.outcome = if claim.is_proven { Outcome::Infeasible } else { Outcome::LocallyInfeasible };
            }
            r.message = match claim.is_proven {
                true => "no sequence of choices meets the constraints".into(),
                false => {
                    format!("none of the {tried} sequences of choices that were tried has a solution: {}", r.message)
                }
            };
            return Ok(());
        }
        if let Some(why) = claim.cut.or(stop::requested()) {
            r.tell_cut(why);
        }
        if let Some(o) = r.optimality.as_mut() {
            o.judge_choices(claim);
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
        let mut simulated = Simulated::new(self, space.levels.clone(), None, request)?;
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
            let simulated = Simulated::new(self, space.levels.clone(), best, request)?;
            return self.enumerate(space, simulated, best, (most, budget), control);
        }
        Ok(Proof::none())
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
        if stop::requested().is_some() {
            // there is no time to solve for it again
            (self.built, self.result) = (None, Some(best.result.clone()));
            return Ok(());
        }
        let guesses = (self.x_guess.take(), self.u_guess.take());
        Motion::of(&best.result).begin(self);
        let solved = self.solve_chosen(Start::Cold, request, control);
        (self.x_guess, self.u_guess) = guesses;
        solved
    }
}

impl Optimality {
    /// What an answer is among all choices: a verdict so far was one among answers with the same choices.
    fn judge_choices(&mut self, claim: &Claim) {
        if !matches!(self.verdict, Verdict::LocalOptimum | Verdict::Kink) {
            return;
        }
        if claim.gap.is_finite() {
            self.gap = claim.gap;
        }
        if claim.is_proven {
            (self.verdict, self.reason) = (Verdict::Global, "no other choices are better");
        } else if claim.settled {
            self.reason = "choices next to these were tried, and none is better";
        } else {
            self.withdraw("not all choices next to these were tried");
        }
    }
}
