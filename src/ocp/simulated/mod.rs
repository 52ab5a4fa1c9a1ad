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
mod compare;
mod derivatives;
mod landed;
mod path;
mod space;
mod thresholds;

pub use self::answer::JumpMade;
use self::answer::{End, Own};
pub(super) use self::landed::Landed;
use self::space::{descend, Simulations, MET};
use super::accuracy::Accuracy;
use super::between::{Along, Between};
use super::descent::{look_around, restore, Chain, Given, Lowest, ModeOrder, Preceding, Shooting, SAME_POINT};
use super::extend::Extended;
use super::joint::Link;
use super::optimality::{Optimality, Verdict};
use super::portfolio::SEARCH;
use super::programs::plan;
use super::request::Request;
use super::solve::Start;
use super::{stage_times, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::{PathAt, Sizes};
use crate::nlp::{allowance, Control, Outcome};
use crate::search::{self, explore, Budget, Source};
use crate::settings::{OcpStart, Settings};
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
    /// What descents are given that keep the modes of `ocp` where it has some.
    fn given(&self, ocp: &Ocp, cuts: &[Vec<f64>]) -> Given<'_> {
        let Base { usual, durations, x0, cost, .. } = self;
        let (cuts, before, order) = (cuts.to_vec(), Preceding::default(), ocp.modes.as_ref().map(ModeOrder::given));
        // modes are those of the state, where nothing has a memory that it does not tell
        let goes_on = ocp.is_simulated() || ocp.is_scene();
        Given { durations, x0, cost: *cost, usual, cuts, goes_on, order, before }
    }

    /// The problem in the variables of descents.
    fn shooting<'a>(&'a self, ocp: &'a Ocp, cuts: &[Vec<f64>]) -> Result<Shooting<'a>> {
        Shooting::new(ocp, &self.extended, self.given(ocp, cuts))
    }

    /// The same among all orders of modes, for what is to be judged.
    pub(super) fn judging<'a>(&'a self, ocp: &'a Ocp) -> Result<Shooting<'a>> {
        Shooting::new(ocp, &self.extended, Given { order: None, ..self.given(ocp, &self.first_cuts(ocp)) })
    }

    /// Where constraints are looked at that hold along the horizon, before one was found to act.
    fn first_cuts(&self, ocp: &Ocp) -> Vec<Vec<f64>> {
        Shooting::cuts(ocp, &self.extended, vec![Vec::new(); ocp.n_stages])
    }
}

/// Problems one behind the other, the links between them, and how they are solved.
pub(super) struct Task<'a> {
    pub ocps: Vec<&'a mut Ocp>,
    pub links: &'a [Vec<Link>],
    pub settings: &'a Settings,
    /// Multiple of the effort of a search; with zero descents begin at answers of before alone.
    pub effort: f64,
}

/// What stands for all that is not varied in a problem, and where constraints are looked at.
type Parts = (Vec<Base>, Vec<Vec<Vec<f64>>>);

/// The end of a search.
pub(super) struct Found {
    /// Answers of the problems.
    pub results: Vec<OcpResult>,
    /// What constraint is missed by how much, where one is.
    pub missed: String,
    /// The largest violation of a link.
    pub link_violation: f64,
    parts: Parts,
    lowest: Lowest,
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
    /// Is the last answer one of descents, and not of a program?
    pub leads: bool,
}

/// Do finite elements and programs of modes not follow a system that is simulated?
pub(super) fn only_simulates(s: &System) -> bool {
    let plain = s.transitions().is_empty();
    let Some(m) = s.mechanics() else { return !plain };
    let choices = m.order == Order::Second && !s.choices().is_empty();
    let in_space = m.contacts.iter().any(|c| c.kind == Kind::Unilateral && c.n_tangents > 1);
    !plain || choices || in_space || !s.is_of_modes_alone() || m.check_contacts("optimal control").is_err()
}

/// Share of a stage within which events are one in an order of modes: simulations of the same motion tell their times that well.
const SAME_TIME: f64 = 1e-6;

impl Ocp {
    /// Time within which events are one in an order of modes.
    pub(super) fn same_time(&self) -> f64 {
        SAME_TIME * self.horizon / self.n_stages as f64
    }

    /// Is it solved by shooting?
    pub(super) fn is_simulated(&self) -> bool {
        let scene = self.system.mechanics().is_some_and(|m| m.order == Order::Second);
        // orders of contacts are searched with constant controls on a grid that stays
        let searched = !self.linear.contains(&true) && self.modes.is_none() && self.settings.adapt_tol <= 0.0;
        // orders that elements have say which cells are active
        let of_motion = !self.has_search() && self.modes.as_ref().is_some_and(|m| m.cells.is_empty());
        self.simulated.only || scene && !searched || of_motion
    }

    /// Does a search over modes go on from its answers?
    pub(super) fn has_search(&self) -> bool {
        self.projected.is_some() || self.system.is_of_modes_alone()
    }

    /// Is the last answer the end of a descent on simulations, or known as one?
    pub(super) fn is_answered_by_simulation(&self) -> bool {
        self.is_simulated() || self.simulated.last.is_some()
    }

    /// Makes the answer of another program known as the end of a descent that gains nothing, for its multipliers.
    pub(super) fn simulate_answer(&mut self) -> Result<()> {
        if self.simulated.last.is_some() {
            return Ok(());
        }
        let Some(r) = self.result.as_ref().filter(|r| r.is_exact()) else {
            return Err(Error::State("there is no exact solution to have multipliers: solve the problem first".into()));
        };
        let base = self.base(Some(r))?;
        let Some(lowest) = self.lowest_of_simulated(&base, r)?.map(|f| f.0).filter(|f| f.stays_at(r.priced)) else {
            return Err(Error::State(
                "multipliers are not known of this answer: no descent on simulations that begins there stays there"
                    .into(),
            ));
        };
        let cuts = base.first_cuts(self);
        self.simulated.last = Some(Box::new(Last { base, cuts, lowest }));
        Ok(())
    }

    pub(super) fn check_simulated(&self) -> Result<()> {
        let refused = |what: &str| {
            Err(Error::Unsupported(format!(
                "this system is followed by simulations alone, in optimal control by shooting, which takes no {what}"
            )))
        };
        let n: usize = self.system.mode_counts().iter().sum();
        if let Some(given) = self.modes.as_ref().map(|m| m.modes.len() / m.times.len()).filter(|g| *g > 0 && *g != n) {
            return Err(Error::Dimension(format!(
                "the mode sequence has {given} modes in a phase, the system {n}: those of every contact, joint and constraint are four"
            )));
        }
        if !self.complementarity.is_empty() {
            return refused("complementarity conditions of your own: make them part of the system");
        }
        Ok(())
    }

    /// Solves by shooting; a warm start begins with the last answer.
    pub(super) fn solve_simulated(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        self.check_simulated()?;
        self.simulated.last = None;
        let shifted = self.shifted.take().filter(|_| start == Start::Warm).map(|r| *r);
        let known = if start == Start::Warm { self.result.take() } else { None };
        let mut last = shifted.or(known).filter(|r| r.is_solution());
        if let Some(r) = last.as_mut() {
            self.restate_start(r);
        }
        let landed = self.land(last.as_ref(), 1.0, request, control)?;
        self.adopt_landed(landed);
        Ok(())
    }

    /// Are the initial values of discrete states given? They jump, and no search varies them.
    pub(in crate::ocp) fn check_discrete_start(&self) -> Result<()> {
        for s in self.system.discrete_states() {
            let (l, u) = (self.x0_bounds[0][s], self.x0_bounds[1][s]);
            if l != u {
                return Err(Error::State(format!(
                    "state {s} is discrete: its initial value must be given, its bounds are {l} and {u}"
                )));
            }
        }
        Ok(())
    }

    /// What descents begin with: an answer of before, or what is given.
    pub(super) fn base(&self, last: Option<&OcpResult>) -> Result<Base> {
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

    /// Points at which constraints are violated, between those at which they are looked at. Are there new ones?
    fn add_cuts(&self, cuts: &mut [Vec<f64>], violated: &[Between], r: &OcpResult) -> bool {
        let starts = stage_times(self.t0, &r.durations);
        let mut added = false;
        let between = |b: &&Between| !matches!(b.of, Along::Path(k) if self.path[k].at == PathAt::ControlGrid);
        for b in violated.iter().filter(between) {
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

impl Task<'_> {
    /// Solves by shooting, from answers of before where there are some.
    pub fn solve(
        &mut self,
        bases: Vec<Base>,
        last: Option<&[OcpResult]>,
        request: &Request,
        control: &mut Control,
    ) -> Result<Found> {
        for (k, o) in self.ocps.iter().enumerate() {
            o.check_given_transitions()?;
            // a start that follows from the end before it has the values of that
            if k == 0 || self.links[k - 1].iter().all(|l| l.start.is_none()) {
                o.check_discrete_start()?;
            }
        }
        let mut budget = Budget::new(f64::INFINITY);
        let cuts = self.ocps.iter().zip(&bases).map(|(o, b)| b.first_cuts(o)).collect();
        let mut parts: Parts = (bases, cuts);
        let (found, stopped) = control.sooner(SEARCH, |control| {
            let found = self.search(&parts, last, request, &mut budget, control)?;
            Ok::<_, Error>((found, stop::requested()))
        })?;
        let Some(mut lowest) = found.all.into_iter().next().map(|f| f.0) else {
            let given = self.ocps.iter().any(|o| o.modes.is_some());
            let none = match given {
                _ if allowance::is_over() => "all max_iter iterations were spent before a simulation: allow more",
                true => "no controls that were tried lead to the modes that are given: guess controls that do, or take the modes back",
                false => "no controls that were tried could be simulated to the end of the horizon: give a guess of the controls that can",
            };
            return Err(stop::requested().map_or_else(|| Error::Numeric(none.into()), |why| why.error()));
        };
        // iterations that are spent are no reason to stop
        let limited = found.ended == search::Ended::Limit && (stopped.is_some() || !allowance::is_over());
        let mut cut = limited.then(|| stopped.unwrap_or(Why::Interrupted));
        for round in 0..=ROUNDS {
            let mut chain = self.chain(&parts)?;
            let before: Vec<usize> = chain.steps().map(|s| s.1).collect();
            if cut.is_none() && !allowance::is_over() {
                match finish(&mut chain, lowest.clone(), control, &mut budget) {
                    Ok(better) => lowest = better,
                    Err(Error::Interrupted | Error::OutOfTime) => {
                        cut = Some(stop::requested().unwrap_or(Why::Interrupted))
                    }
                    Err(e) => return Err(e),
                }
            }
            space::count(&chain, &before, &mut budget);
            let end = End::new(&mut chain, &lowest)?;
            drop(chain);
            let (missed, link_violation) = (end.missed.clone(), end.link_violation);
            let mut results = self.read(&parts, end, &lowest, request)?;
            let solved = results.iter().all(|r| r.outcome == Outcome::Solved);
            let goes_on = round < ROUNDS && cut.is_none() && solved;
            let mut added = false;
            for ((o, cuts), r) in self.ocps.iter().zip(&mut parts.1).zip(&results).filter(|_| goes_on) {
                let counts = |b: &&Between| Accuracy::counts(b);
                let more: Vec<Between> =
                    r.accuracy.iter().flat_map(|a| a.along.iter().filter(counts)).copied().collect();
                added |= o.add_cuts(cuts, &more, r);
            }
            if added {
                // a row for every new point: multipliers are those of the next descent
                for ((o, base), cuts) in self.ocps.iter().zip(&parts.0).zip(&mut parts.1) {
                    *cuts = Shooting::cuts(o, &base.extended, std::mem::take(cuts));
                }
                continue;
            }
            for (o, r) in self.ocps.iter().zip(&mut results) {
                if let Some(text) = o.violated_between(r) {
                    r.add_remark(&text);
                }
                r.stats = budget.stats;
                cut.into_iter().for_each(|why| r.tell_cut(why));
                r.tell_spent(request);
            }
            return Ok(Found { results, missed, link_violation, parts, lowest });
        }
        Err(Error::Internal("a search without an end".into()))
    }

    /// All problems as one, in the variables of descents.
    fn chain<'a>(&'a self, (bases, cuts): &'a Parts) -> Result<Chain<'a>> {
        let all = self.ocps.iter().zip(bases.iter().zip(cuts));
        let given = all.map(|(ocp, (base, cuts))| {
            let ocp: &Ocp = ocp;
            (ocp, &base.extended, base.given(ocp, cuts))
        });
        Chain::new(given.collect(), self.links)
    }

    fn search(
        &self,
        parts: &Parts,
        last: Option<&[OcpResult]>,
        request: &Request,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<search::Found<Lowest, Vec<u64>>> {
        let mut space = Simulations::new(self.chain(parts)?, self.settings, last);
        let has_costs = self.ocps.iter().any(|o| o.has_costs());
        let plan = |sources: &[Source], effort: f64| plan(self.settings, sources, effort, request.search, !has_costs);
        if last.is_some() {
            let found = explore(&mut space, &plan(&[Source::Guess], 0.0), Vec::new(), budget, control)?;
            let met = found.all.first().is_some_and(|f| f.0.violation <= MET);
            if met || self.effort == 0.0 || stop::requested().is_some() {
                return Ok(found);
            }
        }
        let samples = has_costs && request.start != OcpStart::Homotopy;
        let sources = [Source::Simulation, Source::Samples];
        let effort = self.effort * self.settings.search_effort;
        let plan = plan(if samples { &sources } else { &sources[..1] }, effort);
        explore(&mut space, &plan, Vec::new(), budget, control)
    }

    /// The end of a descent in the terms of every problem.
    fn read(&mut self, parts: &Parts, end: End, lowest: &Lowest, request: &Request) -> Result<Vec<OcpResult>> {
        // lengths before a problem may be free
        let starts = end.motions.iter().map(|m| m.run.t);
        self.ocps.iter_mut().skip(1).zip(starts).for_each(|(o, t)| o.t0 = t);
        let chain = self.chain(parts)?;
        let (gradient, solved, dimensions) = (&end.gradient[..], end.missed.is_empty(), end.dimensions);
        let alone = self.ocps.len() == 1;
        let each = self.ocps.iter().zip(chain.parts()).zip(end.motions);
        each.map(|((ocp, shooting), motion)| {
            let mut r = ocp.simulated_result(&Own { shooting, gradient, solved }, lowest, motion, request)?;
            if alone {
                // of several problems it is told once
                r.message.clone_from(&end.missed);
            }
            Ok(OcpResult { dimensions, ..r })
        })
        .collect()
    }
}

/// Descends from the end of a descent until that gains nothing, with the constraints met as well as they can be.
fn finish(chain: &mut Chain, mut lowest: Lowest, control: &mut Control, budget: &mut Budget) -> Result<Lowest> {
    for _ in 0..AGAIN {
        if lowest.ended && lowest.stationary && lowest.violation <= MET {
            break;
        }
        let start = restore(chain, &lowest.z)?.unwrap_or_else(|| lowest.z.clone());
        let Some(next) = descend(chain, &start, LAST, &mut |_| false, control)? else { break };
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
    look_around(chain, &mut lowest)?;
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
