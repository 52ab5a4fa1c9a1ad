//! Optimal control of what only simulations follow: direct single shooting through the event engine.
//!
//! Finite elements and programs of modes follow most systems. What they do not, dry joints beside contacts, constraints and switches of
//! scenes, transitions next to algebraic equations, is simulated all the same, with derivatives through every event (6.25). The problem is
//! then one in controls, free lengths, parameters and initial states alone, and a [descent](super::descent) goes through orders of events as
//! it meets them: a change of the order is a kink, which its model knows. [`space`] says to the [search](crate::search) where descents begin.
//!
//! States, and with them constraints, are what a simulation says they are, so an answer is a motion of the system. What is lost
//! is the knowledge of states in between: motions that are unstable over the horizon are found from controls next to them only.

mod answer;
mod derivatives;
mod space;

use std::time::Instant;

use self::space::{descend, Simulations, MET};
use super::accuracy::Accuracy;
use super::between::Between;
use super::descent::{look_around, restore, Given, Lowest, Shooting, SAME_POINT};
use super::extend::Extended;
use super::optimality::{Optimality, Verdict};
use super::portfolio::SEARCH;
use super::request::Request;
use super::solve::Start;
use super::{stage_times, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::nlp::{Control, Outcome, Statistics};
use crate::search::{self, explore, Budget, Source};
use crate::settings::OcpStart;
use crate::stop::{self, Why};
use crate::system::{Kind, Order, System};

/// Simulations of the horizon of the last descent, and how often it is begun anew where that still gains.
const LAST: usize = 400;
const AGAIN: usize = 5;
/// Share of the cost that counts as a gain then.
const GAIN: f64 = 1e-9;
/// Rounds in which points are added where a constraint is violated between others: each divides the violation by four at least.
const ROUNDS: usize = 7;

/// What is varied, and what stands for all that is not.
pub(super) struct Base {
    extended: Extended,
    usual: Sizes,
    durations: Vec<f64>,
    x0: Vec<f64>,
    /// About the cost: tolerances are made of it, and next to a kink rounding decides on the side, so that it stays as it is.
    cost: f64,
}

impl Base {
    /// The problem in the variables of descents.
    fn shooting<'a>(&'a self, ocp: &'a Ocp, cuts: &[Vec<f64>]) -> Result<Shooting<'a>> {
        let Base { extended, usual, durations, x0, cost } = self;
        Shooting::new(ocp, extended, Given { durations, x0, cost: *cost, usual, cuts: cuts.to_vec() })
    }
}

/// The end of a solve with what it is made of, for derivatives.
pub(super) struct Last {
    base: Base,
    cuts: Vec<Vec<f64>>,
    lowest: Lowest,
}

/// What a problem knows of simulations.
#[derive(Default)]
pub(super) struct State {
    /// Does nothing else follow its system?
    pub only: bool,
    /// The end of the last solve.
    pub last: Option<Box<Last>>,
}

/// Do finite elements and programs of modes not follow a system that is simulated?
pub(super) fn only_simulates(s: &System) -> bool {
    let plain = s.has_programs_of_transitions();
    let Some(m) = s.mechanics() else { return !plain };
    let choices = m.order == Order::Second && !s.choices().is_empty();
    let in_space = m.contacts.iter().any(|c| c.kind == Kind::Unilateral && c.n_tangents > 1);
    let beside = s.n_algebraic() > 0 || !s.inclusions().is_empty();
    !plain || choices || in_space || beside || m.check_contacts("optimal control").is_err()
}

impl Ocp {
    /// Is it solved by shooting?
    pub(super) fn is_simulated(&self) -> bool {
        let scene = self.system.mechanics().is_some_and(|m| m.order == Order::Second);
        self.simulated.only || scene && self.linear.contains(&true)
    }

    fn check_simulated(&self) -> Result<()> {
        let refused = |what: &str| {
            Err(Error::Unsupported(format!(
                "this system is followed by simulations alone, in optimal control by shooting, which takes no {what}"
            )))
        };
        if self.modes.is_some() {
            return refused("modes that are given: guess controls that lead to them, and take the modes back");
        }
        if !self.complementarity.is_empty() {
            return refused("complementarity conditions of your own: make them part of the system");
        }
        Ok(())
    }

    /// Solves by shooting; a warm start begins with the last answer.
    pub(super) fn solve_simulated(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        let clock = Instant::now();
        self.check_simulated()?;
        self.simulated.last = None;
        let shifted = self.shifted.take().filter(|_| start == Start::Warm).map(|r| *r);
        let known = if start == Start::Warm { self.result.take() } else { None };
        let mut last = shifted.or(known).filter(|r| r.is_solution());
        if let Some(r) = last.as_mut() {
            self.restate_start(r);
        }
        let base = self.base(last.as_ref())?;
        let mut budget = Budget::new(f64::INFINITY);
        let mut cuts = Shooting::cuts(self, &base.extended, vec![Vec::new(); self.n_stages]);
        let found = control.sooner(SEARCH, |control| {
            self.search_simulated(base.shooting(self, &cuts)?, last.as_ref(), request, &mut budget, control)
        })?;
        let Some(mut lowest) = found.all.into_iter().next().map(|f| f.0) else {
            let none = "no controls that were tried could be simulated to the end of the horizon: give a guess of the controls that can";
            return Err(stop::requested().map_or_else(|| Error::Numeric(none.into()), |why| why.error()));
        };
        let mut cut = (found.ended == search::Ended::Limit).then(|| stop::requested().unwrap_or(Why::Interrupted));
        let mut result = None;
        for round in 0..=ROUNDS {
            let mut shooting = base.shooting(self, &cuts)?;
            let before = shooting.steps;
            if cut.is_none() {
                match finish(&mut shooting, lowest.clone(), control, &mut budget) {
                    Ok(better) => lowest = better,
                    Err(Error::Interrupted | Error::OutOfTime) => {
                        cut = Some(stop::requested().unwrap_or(Why::Interrupted))
                    }
                    Err(e) => return Err(e),
                }
            }
            budget.simulated(self.system.dims().x, shooting.steps - before);
            let mut r = self.simulated_result(&mut shooting, &lowest, request)?;
            drop(shooting);
            let counts = |b: &&Between| Accuracy::counts(b);
            let more: Vec<Between> = r.accuracy.iter().flat_map(|a| a.along.iter().filter(counts)).copied().collect();
            let last_round = round == ROUNDS || cut.is_some() || r.outcome != Outcome::Solved;
            if last_round || !self.add_cuts(&mut cuts, &more, &r) {
                if let Some(text) = self.violated_between(&r) {
                    r.add_remark(&text);
                }
                result = Some(r);
                break;
            }
            // a row for every new point: multipliers are those of the next descent
            cuts = Shooting::cuts(self, &base.extended, cuts);
        }
        let mut result = result.ok_or_else(|| Error::Internal("a search without an answer".into()))?;
        result.stats = Statistics { time_total: clock.elapsed().as_secs_f64(), ..budget.stats };
        if let Some(why) = cut {
            result.tell_cut(why);
        }
        self.result = Some(result);
        self.simulated.last = Some(Box::new(Last { base, cuts, lowest }));
        Ok(())
    }

    /// What descents begin with: an answer of before, or what is given.
    fn base(&self, last: Option<&OcpResult>) -> Result<Base> {
        let mut extended = self.extended()?;
        extended.params = self.extended_params(&extended);
        let wide = extended.system.dims().p.max(1);
        if let Some(r) = last.filter(|_| self.stage_params.is_none()) {
            extended.params.chunks_mut(wide).for_each(|p| p[..r.params.len()].copy_from_slice(&r.params));
        }
        let known = last.and_then(|r| r.trajectory.elements.first());
        Ok(Base {
            extended,
            usual: self.known_or_own_sizes()?,
            durations: last.map_or(&self.durations, |r| &r.durations).clone(),
            x0: known.map_or_else(|| self.initial_guess_state(), |e| e.x0.clone()),
            cost: last.map_or(0.0, |r| r.cost_reached),
        })
    }

    fn search_simulated(
        &self,
        shooting: Shooting,
        last: Option<&OcpResult>,
        request: &Request,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<search::Found<Lowest, Vec<u64>>> {
        let mut space = Simulations::new(self, shooting, last);
        let plan = |sources: &[Source], effort: f64| self.plan(sources, effort, request.search, !self.has_costs());
        if last.is_some() {
            let found = explore(&mut space, &plan(&[Source::Guess], 0.0), Vec::new(), budget, control)?;
            if found.all.first().is_some_and(|f| f.0.violation <= MET) || stop::requested().is_some() {
                return Ok(found);
            }
        }
        let samples = self.has_costs() && request.start != OcpStart::Homotopy;
        let sources = [Source::Simulation, Source::Samples];
        let plan = plan(if samples { &sources } else { &sources[..1] }, self.settings.search_effort);
        explore(&mut space, &plan, Vec::new(), budget, control)
    }

    /// Points at which constraints are violated, between those at which they are looked at. Are there new ones?
    fn add_cuts(&self, cuts: &mut [Vec<f64>], violated: &[Between], r: &OcpResult) -> bool {
        let starts = stage_times(self.t0, &r.durations);
        let mut added = false;
        for b in violated {
            let share = (b.t - starts[b.stage]) / r.durations[b.stage];
            if (SAME_POINT..1.0 - SAME_POINT).contains(&share)
                && cuts[b.stage].iter().all(|c| (c - share).abs() > SAME_POINT)
            {
                cuts[b.stage].push(share);
                added = true;
            }
        }
        added
    }
}

/// Descends from the end of a descent until that gains nothing, with the constraints met as well as they can be.
fn finish(shooting: &mut Shooting, mut lowest: Lowest, control: &mut Control, budget: &mut Budget) -> Result<Lowest> {
    for _ in 0..AGAIN {
        if lowest.stationary && lowest.violation <= MET {
            break;
        }
        let start = restore(shooting, &lowest.z)?.unwrap_or_else(|| lowest.z.clone());
        let Some(next) = descend(shooting, &start, LAST, control)? else { break };
        budget.stats.iterations += next.evaluations;
        budget.stats.evaluations += next.evaluations;
        let gained = lowest.cost - next.cost > GAIN * lowest.cost.abs() || next.violation < 0.5 * lowest.violation;
        // what meets the constraints is not given up for what is cheaper and does not
        if next.violation <= MET.max(lowest.violation) {
            lowest = next;
        }
        if !gained {
            break;
        }
    }
    look_around(shooting, &mut lowest)?;
    Ok(lowest)
}

/// What a descent says of its end, and whether another simulation contradicts it.
fn judged(s: &Lowest, contradicted: bool, gradient: Vec<f64>) -> Optimality {
    let doubt = match (s.stationary, contradicted) {
        (_, true) => Some(super::optimality::CONTRADICTED),
        (false, _) => Some("the last descent did not end at a point from which no direction leads down"),
        _ => None,
    };
    let mut out = Optimality::of_one_order(doubt, "", s.left, gradient, Vec::new());
    if doubt.is_none() {
        out.certify_by_descent(if s.kink { Verdict::Kink } else { Verdict::LocalOptimum });
    }
    out
}
