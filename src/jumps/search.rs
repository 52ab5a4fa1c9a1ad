//! From guesses to orders of contacts, from orders to exact answers, from these to better ones.

use std::rc::Rc;
use std::time::Instant;

use super::answer::{Answer, Findings, Found, Paradox};
use super::blame::blame;
use super::missed::{missed, simulation};
use super::modal;
use super::modes::{ContactMode, Sequence, LEAST};
use super::neighbours::neighbours;
use super::options::{Lead, Method, Options};
use super::problem::Problem;
use super::simulate::{met, Met};
use super::space::{Contacts, Ended, Reach};
use super::track::Track;
use crate::error::{Error, Result};
use crate::nlp::{allowance, Control, Outcome, Statistics};
use crate::search::{explore, Budget, Plan, Source};
use crate::stop::{self, Why};

/// Solutions that are kept beside the best, and share of their costs by which these differ at least.
const OTHERS: usize = 3;
const APART: f64 = 0.01;
/// Share by which the least violations of two starts may differ that agree: neither is a stationary point but for that.
const AGREES: f64 = 0.1;

/// Solves: the best answer and its program, and dearer ones. They are answers of [`Problem::of`].
///
/// # Errors
/// Those of simulations of the guess and of building programs. That there is no solution is no error: it is the outcome of the
/// answer.
pub fn solve(p: &Problem, options: &Options, control: &mut Control) -> Result<Findings> {
    let clock = Instant::now();
    let mut budget = Budget::new(f64::INFINITY);
    let (sought, met) = search(p, options, &mut budget, control)?;
    let own_iterations = sought.best.as_ref().map_or(0, |b| b.0.stats.iterations);
    let mut found = sought.findings(&budget, clock)?;
    let best = &mut found.best.0;
    if !best.is_solved() {
        best.outcome = match (stop::requested(), best.outcome) {
            (Some(Why::OutOfTime), _) => Outcome::MaxTime,
            (Some(Why::Interrupted), _) => Outcome::Stopped,
            (_, Outcome::Stalled) if allowance::is_over() => Outcome::MaxIter,
            // the search is at its end, and no limit of the caller's has ended the program
            (_, Outcome::MaxIter) if own_iterations < options.solver.max_iter && !allowance::is_over() => {
                Outcome::Stalled
            }
            (_, outcome) => outcome,
        };
        explain(p, options, best, met, control)?;
    }
    Ok(found)
}

/// Goes where phases that vanish lead from the modes of an answer to a problem nearby, and no further; nothing where there is no solution.
///
/// # Errors
/// Those of building programs.
pub fn go_on_from(last: &Answer, p: &Problem, options: &Options, control: &mut Control) -> Result<Option<Findings>> {
    let clock = Instant::now();
    let mut budget = Budget::new(f64::INFINITY);
    let mut space = Contacts::new(p, options, Reach::Wanted, false);
    space.sources.given.clear();
    space.sources.give(last.planned.clone(), Rc::new(last.track.clone()), Some(Rc::new(last.point.clone())));
    let found = Sought::of(&mut space, &[Source::Guess], (options, 0.0), &mut budget, control)?;
    found.is_solved().then(|| found.findings(&budget, clock)).transpose()
}

/// The whole search of a problem, and what the simulation of the guess met, where that was asked for.
fn search(p: &Problem, options: &Options, budget: &mut Budget, control: &mut Control) -> Result<(Sought, Option<Met>)> {
    let given = options.sequence.is_some();
    let sources: &[Source] = match (options.method, options.lead) {
        (Method::Auto | Method::Modes, _) if given => &[Source::Guess],
        (Method::FesdJ, _) if given => &[Source::Guess, Source::Relaxation],
        (Method::Auto, Lead::Guess) => &[Source::Simulation, Source::Stepping, Source::Relaxation],
        (Method::Auto, Lead::Descents { .. }) => &[Source::Simulation, Source::Stepping],
        (Method::Modes | Method::Shots, _) => &[Source::Simulation],
        (Method::Steps, _) => &[Source::Stepping],
        (Method::FesdJ | Method::Freezing, _) => &[Source::Relaxation],
    };
    let reach = match options.lead {
        // descents have left what is cheaper on the way
        Lead::Descents { optimum: true, .. } => Reach::Local,
        _ => Reach::All,
    };
    let mut space = Contacts::new(p, options, reach, false);
    let mut found = Sought::of(&mut space, sources, (options, options.effort), budget, control)?;
    if found.best.is_none() && stop::requested().is_none() {
        // nothing that was proposed can begin at the initial state
        let open = Sequence::constant(p.n_stages(), vec![ContactMode::Open; p.n_contacts()]);
        let guess = Rc::new(space.sources.plain_track(options.states.as_ref()));
        space.sources.give(open, guess, None);
        found = Sought::of(&mut space, &[Source::Guess], (options, 0.0), budget, control)?;
    }
    Ok((found, space.sources.met))
}

/// Says of the point that is closest to a solution what keeps it from one, and what a simulation of its controls has.
fn explain(
    p: &Problem,
    options: &Options,
    best: &mut Answer,
    of_guess: Option<Met>,
    control: &mut Control,
) -> Result<()> {
    let mut closest = None;
    if stop::requested().is_none() {
        best.blame = blame(p, best, options.solver, control)?;
        closest = simulation(p, options, best);
    }
    best.missed = closest.as_ref().and_then(|s| missed(p, options, best, s));
    best.changes = closest.as_ref().map_or_else(Vec::new, |s| s.met().changes);
    let of_guess = of_guess.or_else(|| met(p, &options.x0, &options.controls, &p.given.durations).ok());
    let guessed = of_guess.and_then(|m| m.paradox).map(|(contact, t)| Paradox { contact, t, of_guess: true });
    let of_closest = |(contact, t)| Paradox { contact, t, of_guess: false };
    best.paradox = guessed.or_else(|| closest.and_then(|s| s.paradox()).map(of_closest));
    Ok(())
}

/// What became of a search.
pub(super) struct Sought {
    /// The best that programs ended at, a solution or not.
    best: Option<Found>,
    /// Solutions that are dearer, the cheapest first.
    others: Vec<Found>,
    /// Starts that came nearly as close to a solution as the best, and all of them.
    agreeing: [usize; 2],
    /// Orders that were solved for.
    pub(super) tried: usize,
    /// Work.
    pub(super) effort: usize,
    /// What all solves took.
    pub(super) stats: Statistics,
}

impl Sought {
    fn of(
        space: &mut Contacts,
        sources: &[Source],
        (options, effort): (&Options, f64),
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Sought> {
        let plan = Plan {
            sources: sources.to_vec(),
            effort,
            gain: options.gain,
            least_tried: options.least_tried,
            any: !options.has_costs,
        };
        let before = (budget.spent(), budget.stats);
        let found = explore(space, &plan, Vec::new(), budget, control)?;
        let mut all = found.all.into_iter().map(|(Ended { answer, solved, .. }, _)| (answer, solved));
        let best = all.next().map(|(a, solved)| {
            let settled = found.settled && a.is_solved() && a.vanishing.is_empty();
            let (dimensions, freezing) = (space.dimensions, space.sources.freezing.clone());
            (Answer { settled, dimensions, freezing, ..a }, solved)
        });
        let violation = best.as_ref().map_or(f64::INFINITY, |b: &Found| b.0.violation);
        let reached = || space.least.iter().filter(|v| v.is_finite());
        let agreeing = [reached().filter(|v| **v <= (1.0 + AGREES) * violation).count(), reached().count()];
        let mut last = best.as_ref().map_or(f64::INFINITY, |b: &Found| b.0.cost);
        let mut others: Vec<Found> = Vec::new();
        for other in all.filter(|f| f.0.is_solved()) {
            if others.len() < OTHERS && other.0.cost - last > APART * last.abs() {
                last = other.0.cost;
                others.push(other);
            }
        }
        Ok(Sought {
            best,
            others,
            agreeing,
            tried: found.tried,
            effort: (budget.spent() - before.0) as usize,
            stats: budget.stats,
        })
    }

    /// The answers, the best with what the search has spent.
    fn findings(self, budget: &Budget, clock: Instant) -> Result<Findings> {
        let Sought { best, others, agreeing, tried, .. } = self;
        let Some((mut best, solved)) = best else {
            stop::check()?;
            return Err(Error::Internal("a search without an answer".into()));
        };
        best.stats = Statistics { time_total: clock.elapsed().as_secs_f64(), ..budget.stats };
        (best.effort, best.tried) = (budget.spent() as usize, tried);
        if !best.is_solved() {
            best.agreeing = agreeing;
        }
        let effort = best.effort;
        let others = others.into_iter().map(|(a, s)| (Answer { effort, ..a }, s)).collect();
        Ok(Findings { best: (best, solved), others })
    }

    fn is_solved(&self) -> bool {
        self.best.as_ref().is_some_and(|b| b.0.is_solved())
    }

    /// The best, where it is a solution.
    pub(super) fn solution(self) -> Option<Found> {
        self.best.filter(|b| b.0.is_solved())
    }
}

/// Solves for an order of contacts on another grid of the same control stages, from a motion that has it, and for those next to it within
/// reach as long as the work is less than `most`; no solution where the order has none there.
///
/// # Errors
/// Those of building programs.
pub(super) fn solve_again(
    p: &Problem,
    (sequence, motion): (&Sequence, &Track),
    (options, reach): (&Options, Reach),
    most: usize,
    control: &mut Control,
) -> Result<Sought> {
    let mut space = Contacts::new(p, options, reach, true);
    let motion = Rc::new(motion.clone());
    space.sources.given.clear();
    space.sources.give(sequence.without_idle_impacts(), motion, None);
    space.sources.given.iter_mut().for_each(|g| g.1.close = true);
    let mut budget = Budget::new(most as f64);
    let mut found = Sought::of(&mut space, &[Source::Guess], (options, 0.0), &mut budget, control)?;
    if let Some((closest, _)) = found.best.as_ref().filter(|b| !b.0.is_solved()) {
        for (sequence, track) in without_short_phases(p, closest) {
            space.sources.give(sequence, track, None);
        }
        let next = Sought::of(&mut space, &[Source::Guess], (options, 0.0), &mut budget, control)?;
        found = Sought { tried: found.tried + next.tried, effort: found.effort + next.effort, ..next };
    }
    Ok(found)
}

/// Orders that are tried without the short phases of a motion.
const WAYS: usize = 3;

/// Orders without the short phases of a motion that is no solution: a contact that opens where its force is nearly zero and lands at once has a cost
/// that next to nothing says when, and on a fine grid its program has no end.
fn without_short_phases(p: &Problem, closest: &Answer) -> Vec<(Sequence, Rc<Track>)> {
    let frictional: Vec<bool> = p.functions.contacts.iter().map(|c| c.n_tangents > 0).collect();
    let track = Rc::new(closest.track.clone());
    let short = modal::shorter(&modal::phase_lengths(p, &closest.planned, &track), LEAST);
    let near = neighbours(&closest.planned, &short, &[], &frictional, false);
    let ways = near.into_iter().filter(|n| n.wanted).take(WAYS);
    ways.map(|n| (n.sequence.without_idle_impacts(), Rc::clone(&track))).collect()
}
