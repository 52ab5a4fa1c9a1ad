//! From guesses to orders of contacts, from orders to exact answers, from these to better ones.

use std::rc::Rc;
use std::time::Instant;

use super::answer::{Answer, Findings, Found, Paradox};
use super::blame::blame;
use super::modal;
use super::modes::{ContactMode, Sequence, LEAST};
use super::neighbours::neighbours;
use super::options::{Method, Options};
use super::problem::Problem;
use super::shots::{beside, missed, simulation, Beside};
use super::simulate::{met, Met};
use super::space::{Contacts, Ended, Order, Reach};
use super::track::Track;
use crate::error::{Error, Result};
use crate::nlp::{Control, Outcome, Statistics};
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
    let Sought { best, others, agreeing, tried, .. } = sought;
    let (mut best, solved) = match best {
        Some(found) => found,
        None => {
            stop::check()?;
            return Err(Error::Internal("a search without an answer".into()));
        }
    };
    let own_iterations = std::mem::replace(&mut best.stats, budget.stats).iterations;
    best.stats.time_total = clock.elapsed().as_secs_f64();
    (best.effort, best.tried) = (budget.spent() as usize, tried);
    if !best.is_solved() {
        best.agreeing = agreeing;
        best.outcome = match (stop::requested(), best.outcome) {
            (Some(Why::OutOfTime), _) => Outcome::MaxTime,
            (Some(Why::Interrupted), _) => Outcome::Stopped,
            // the search is at its end, and no limit of the caller's has ended the program
            (_, Outcome::MaxIter) if own_iterations < options.solver.max_iter => Outcome::Stalled,
            (_, outcome) => outcome,
        };
        explain(p, options, &mut best, met, control)?;
    }
    let effort = best.effort;
    let others = others.into_iter().map(|(a, s)| (Answer { effort, ..a }, s)).collect();
    Ok(Findings { best: (best, solved), others })
}

/// The whole search of a problem, and what the simulation of the guess met, where that was asked for.
fn search(p: &Problem, options: &Options, budget: &mut Budget, control: &mut Control) -> Result<(Sought, Option<Met>)> {
    if let Some(last) = &options.warm {
        // an answer of before goes where phases that vanish lead, and no further
        let mut space = Contacts::new(p, options, Reach::Wanted, false);
        space.sources.given.clear();
        space.sources.give(last.planned.clone(), Rc::new(last.track.clone()), Some(Rc::new(last.point.clone())));
        let found = Sought::of(&mut space, &[Source::Guess], (options, 0.0), budget, control)?;
        if found.is_solved() {
            return Ok((found, None));
        }
    }
    let mut space = Contacts::new(p, options, Reach::All, false);
    let given = options.sequence.is_some();
    let sources: &[Source] = match options.method {
        Method::Auto if given => &[Source::Guess],
        Method::Auto => &[Source::Simulation, Source::Stepping, Source::Samples, Source::Relaxation],
        Method::Modes if given => &[Source::Guess],
        Method::Modes => &[Source::Simulation],
        Method::Steps => &[Source::Stepping],
        Method::Shots => &[Source::Samples],
        Method::FesdJ if given => &[Source::Guess, Source::Relaxation],
        Method::FesdJ | Method::Freezing => &[Source::Relaxation],
    };
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

/// Searches on a finer grid of the same control stages for an answer beside one that its simulation leaves, whose order of contacts has no solution there: from
/// the simulation of its controls, aimed at the constraints and as it is, and, if asked, from shots; as long as the work is less than `most`. No solution where
/// nothing of that leads to one, or where that simulation ends nowhere near.
///
/// # Errors
/// Those of simulations and of building programs.
pub(super) fn solve_beside(
    p: &Problem,
    (answer, options): (&Answer, &Options),
    (shoots, most): (bool, usize),
    control: &mut Control,
) -> Result<Sought> {
    let p = &p.restated_at(answer.durations(p.n_stages()), &answer.params);
    let given = (answer.controls().to_vec(), answer.x0.clone());
    let options =
        &Options { controls: given.0, x0: given.1, states: None, sequence: None, warm: None, ..options.clone() };
    let mut space = Contacts::new(p, options, Reach::Local, true);
    let mut budget = Budget::new(most as f64);
    let all = [Source::Guess, Source::Simulation, Source::Samples];
    let mut sources = &all[..if shoots { 3 } else { 2 }];
    match beside(p, options, answer)? {
        Beside::Elsewhere => sources = &[],
        Beside::Near(Some(shot)) => {
            let order = Order::new(shot.track.sequence(p.n_stages()));
            space.sources.give(order.sequence, Rc::new(shot.track), None);
        }
        Beside::Near(None) => {}
    }
    Sought::of(&mut space, sources, (options, 0.0), &mut budget, control)
}
