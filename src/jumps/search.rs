//! From guesses to modes, from modes to exact answers, from these to better ones.

mod again;
mod looks;
mod starts;

use std::time::Instant;

use super::answer::{is_better, Answer, Findings, Found, Paradox, GAIN, NEARLY};
use super::blame::blame;
use super::exact::{solve_sequence, without_overlap, Limits};
use super::guards::Condition;
use super::modal::{self, Held};
use super::modes::{ContactMode, Event, Key, Sequence, LEAST};
use super::neighbours::{in_turn, neighbours, with_impact, Move, Neighbour};
use super::options::{Method, Options};
use super::problem::{Problem, CONTRADICTION};
use super::shots::{missed, simulation};
use super::simulate::met;
use super::track::Track;
use crate::error::{Error, Result};
use crate::freezing::Report;
use crate::func::Point;
use crate::mpcc::MpccSettings;
use crate::nlp::{allowance, Control, Outcome, Statistics};
use crate::stop::{self, Why};
pub(super) use again::{solve_again, solve_beside, Sought};
use looks::LOOKED_GAIN;
use starts::{starts, Start};

/// Solutions that are kept beside the best, and share of their costs by which these differ at least.
const OTHERS: usize = 3;
const APART: f64 = 0.01;

/// Iterations of the program of a sequence, which take a dozen where it has a solution, and of one that gets close to one.
const ITERATIONS: usize = 150;
const NEAR_ITERATIONS: usize = 80;
/// Iterations from where the program of a sequence got stuck where another one has a solution: those that go on from there do so in a few.
const AGAIN_ITERATIONS: usize = 30;
/// Iterations without half the violation after which the program of a sequence next to a solution is given up.
const NEAR_PATIENCE: usize = 10;
/// Sequences that are tried again where nothing has a solution, and their iterations.
const INSISTED: usize = 3;
const MOST_ITERATIONS: usize = 400;
/// First barrier parameter of the program of a sequence: its guess is a motion.
const NEAR_BARRIER: f64 = 1e-2;
/// Violation up to which the program of a sequence gets all iterations, where its cost exceeds the best one by no more than this share. Such a
/// sequence is tried again next to the next best solution.
const PROMISING: f64 = 1e-2;
/// Places in which an impact of a contact is put in.
const PUT_IN: usize = 3;

/// Sequences that are tried next to one without a solution before the next start.
const NEAR_UNSOLVED: usize = 8;

/// Sequences in a row that are no better after which a start is left that has led to less than another one. It is left, too, when it has taken
/// as much as all starts before it: events that walk from stage to stage gain a little each.
const BEHIND: usize = 10;

/// Sequences in a row that are tried where phases without length lead, and ways that are tried at each of them.
const LEADS: usize = 6;
const WAYS: usize = 3;

/// Sequences in a row, away from the motion of an answer that all next to it were compared with, after which the search ends; and where two
/// starts have led there.
const FEW: usize = 8;
const FEW_AGREED: usize = 4;

/// Share by which the least violations of two starts may differ that agree: neither is a stationary point but for that.
const AGREES: f64 = 0.1;

/// Solves: the best answer and its program, and dearer ones.
///
/// Where the constraints of an order of contacts contradict each other by next to nothing, and that order would be better than the answer or nothing
/// else has a solution, the search is made again with conditions that leave room for that ([`Problem::with_room`]).
///
/// # Errors
/// Those of simulations of the guess and of building programs. That there is no solution is no error: it is the outcome of the
/// answer.
pub fn solve(p: &Problem, options: &Options, control: &mut Control) -> Result<Findings> {
    let clock = Instant::now();
    let wider;
    let mut s = Search::new(p, options);
    s.explore_starts(control)?;
    let waits = !s.is_solved() && s.is_contradicted();
    if !waits {
        s.finish(control)?;
    }
    if s.is_contradicted() && stop::requested().is_none() {
        wider = p.with_room();
        let mut loose = Search::new(&wider, options);
        // what ends this search leaves what the first one found
        let ended = loose.explore_starts(control).and_then(|()| loose.finish(control)).is_err();
        if !ended && loose.cost() < s.cost() {
            std::mem::swap(&mut s, &mut loose);
        }
        s.count(&loose);
        if waits && !s.is_solved() {
            s.finish(control)?;
        }
    }
    if s.best.is_none() {
        stop::check()?;
        // nothing that was found can begin at the initial state
        let open = Sequence::constant(p.n_stages(), vec![ContactMode::Open; p.n_contacts()]);
        let guess = s.plain_track(options.states.as_ref());
        s.attempt(&open, &guess, ITERATIONS, control)?;
    }
    if s.best.is_none() {
        stop::check()?;
    }
    let (problem, seen, others) = (s.p, s.seen, s.other_answers());
    let (mut best, solved) =
        s.into_answer(clock).ok_or_else(|| Error::Internal("a search without an answer".into()))?;
    if !best.is_solved() {
        explain(p, options, &mut best, seen, control)?;
    }
    Ok(Findings { problem: problem.clone(), best: (best, solved), others })
}

/// Says of the point that is closest to a solution what keeps it from one, and what a simulation of its controls has.
fn explain(p: &Problem, options: &Options, best: &mut Answer, seen: Seen, control: &mut Control) -> Result<()> {
    let mut closest = None;
    if stop::requested().is_none() {
        best.blame = blame(p, best, options.solver, control)?;
        closest = simulation(p, options, best);
    }
    best.missed = closest.as_ref().and_then(|s| missed(p, options, best, s));
    best.changes = closest.as_ref().map_or_else(Vec::new, |s| s.met().changes);
    let guess = match seen {
        Seen::Simulated(paradox) => paradox,
        Seen::Nothing => met(p, &options.x0, &options.controls, &p.given.durations).ok().and_then(|m| m.paradox),
    };
    let guessed = guess.map(|(contact, t)| Paradox { contact, t, of_guess: true });
    let of_closest = |(contact, t)| Paradox { contact, t, of_guess: false };
    best.paradox = guessed.or_else(|| closest.and_then(|s| s.paradox()).map(of_closest));
    Ok(())
}

/// Which sequences next to the best are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reach {
    /// Those that phases without length lead to.
    Wanted,
    /// Those whose motions are next to the present one.
    Local,
    All,
}

/// What became of a sequence.
#[derive(Debug, Clone, Copy)]
enum Tried {
    /// It has a solution of this cost; the number of the answer that was the best then.
    Solved { cost: f64, best: usize },
    /// It has no solution near a guess of this round; the number of the answer whose motion that guess was, if it was one's.
    Failed { round: usize, of: Option<usize> },
    /// It nearly has one; the number of the answer that was the best then.
    Close { best: usize },
}

struct Search<'a> {
    p: &'a Problem,
    options: &'a Options,
    spent: Statistics,
    /// Sequences that were tried.
    tried: Vec<(Key, Tried)>,
    /// Number of the best answer, or of there being none yet in a start, and the last number that was given.
    best_number: usize,
    numbers: usize,
    /// Is the next sequence solved for from the motion of the best?
    from_best: bool,
    /// Programs solved.
    attempts: usize,
    /// Largest cost on the way to one of them: costs have the rounding of that, also where they end at zero.
    largest: f64,
    /// Starts so far: what failed from another start is tried again.
    round: usize,
    best: Option<Found>,
    /// Solutions that are dearer, the cheapest first.
    others: Vec<Found>,
    /// Cost of the best answer of other starts, and the effort with which a start is left that has led to a dearer one.
    rival: Option<f64>,
    most_behind: usize,
    dimensions: (usize, usize, usize),
    /// Violation of the last sequence that was tried; 0 where it has a solution.
    failure: f64,
    /// Sequences without a solution while nothing has one: violation, sequence, guess.
    failed: Vec<(f64, Sequence, Track)>,
    /// Least violation of every start that has come to no solution.
    least: Vec<f64>,
    /// The last sequence with phases that want to vanish whose program came close to a better answer, with its motion and those phases.
    lead: Option<Lead>,
    /// Two starts have led to the same answer.
    agreed: bool,
    /// This start has come to a better sequence that another one has been at.
    met: bool,
    /// The motion that time stepping has found last, and the steps of a stage it had.
    coarse: Option<(Track, usize)>,
    /// Sequences that were solved for from other motions than the best are solved for again: they may have other solutions.
    again: bool,
    /// Iterations times variables so far, and with how many of them no more sequences are tried.
    effort: usize,
    most_effort: usize,
    /// Is an answer that is known solved for on another grid?
    refines: bool,
    /// Are guesses next to solutions?
    close: bool,
    /// Has it begun at the solution for the modes of an answer nearby?
    is_warm: bool,
    /// Least cost of a sequence that has no solution only for constraints that contradict each other by next to nothing.
    contradicted: f64,
    /// What is known of the simulation of the guess.
    seen: Seen,
    /// What stood for the contacts when time-freezing was asked last.
    freezing: Option<Report>,
}

/// The simulation of the guess.
#[derive(Debug, Clone, Copy)]
enum Seen {
    /// There was none.
    Nothing,
    /// Where its friction contradicts the normal force, if it does.
    Simulated(Option<(usize, f64)>),
}

/// A sequence, its motion, and phases that want to vanish.
type Lead = (Sequence, Track, Vec<(usize, usize)>);

impl<'a> Search<'a> {
    fn new(p: &'a Problem, options: &'a Options) -> Search<'a> {
        Search {
            p,
            options,
            spent: Statistics::default(),
            tried: Vec::new(),
            best_number: 0,
            numbers: 0,
            from_best: false,
            round: 1,
            attempts: 0,
            largest: 0.0,
            best: None,
            others: Vec::new(),
            rival: None,
            most_behind: usize::MAX,
            dimensions: (0, 0, 0),
            failure: 0.0,
            failed: Vec::new(),
            least: Vec::new(),
            lead: None,
            agreed: false,
            met: false,
            coarse: None,
            again: false,
            effort: 0,
            most_effort: usize::MAX,
            refines: false,
            close: false,
            is_warm: false,
            contradicted: f64::INFINITY,
            seen: Seen::Nothing,
            freezing: None,
        }
    }

    /// From an answer nearby, or else from every start until one leads to a solution; what is contradicted is not searched for as a last resort.
    fn explore_starts(&mut self, control: &mut Control) -> Result<()> {
        if let Some(last) = &self.options.warm {
            self.start_at_answer(last, control)?;
            self.is_warm = self.is_solved();
        }
        if self.is_warm {
            return Ok(());
        }
        for start in starts(self.options) {
            if stop::requested().is_none() && !(start.is_for_want() && self.is_solved()) {
                self.explore(start, control)?;
            }
            if start == Start::Shots && !self.is_solved() && self.is_contradicted() {
                break;
            }
        }
        Ok(())
    }

    /// From what the starts have led to: to what comes closest where none has a solution, to other motions, and to the sequences next to the best.
    fn finish(&mut self, control: &mut Control) -> Result<()> {
        if self.is_warm {
            // a warm start goes where phases that vanish lead, and no further
            return self.improve(Reach::Wanted, self.options.search, control);
        }
        if !self.is_solved() && stop::requested().is_none() {
            self.insist(control)?;
        }
        if self.options.method == Method::Auto && self.options.sequence.is_none() && stop::requested().is_none() {
            self.look_elsewhere(control)?;
        }
        if stop::requested().is_none() {
            self.again = self.is_solved();
            self.improve(Reach::All, self.options.search, control)?;
        }
        Ok(())
    }

    /// Is no more to be spent?
    fn is_over(&self) -> bool {
        self.effort >= self.most_effort || stop::requested().is_some() || allowance::is_over()
    }

    /// The best answer with what the search has spent; nothing without one.
    fn into_answer(self, clock: Instant) -> Option<Found> {
        let settled = self.is_settled();
        let (mut best, solved) = self.best?;
        if !best.is_solved() {
            best.outcome = match (stop::requested(), best.outcome) {
                (Some(Why::OutOfTime), _) => Outcome::MaxTime,
                (Some(Why::Interrupted), _) => Outcome::Stopped,
                // the search is at its end, and no limit of the caller's has ended it
                (_, Outcome::MaxIter) if best.stats.iterations < self.options.solver.max_iter => Outcome::Stalled,
                (_, outcome) => outcome,
            };
        }
        best.stats = self.spent;
        best.stats.time_total = clock.elapsed().as_secs_f64();
        best.dimensions = self.dimensions;
        best.tried = self.attempts;
        best.settled = settled;
        best.effort = self.effort;
        if !best.is_solved() {
            let agrees = |v: &&f64| **v <= (1.0 + AGREES) * best.violation;
            best.agreeing = [self.least.iter().filter(agrees).count(), self.least.len()];
        }
        best.freezing = self.freezing;
        Some((best, solved))
    }

    /// What it has led to and spent, where only a solution is an answer.
    fn into_sought(self, clock: Instant) -> Sought {
        let (effort, stats, tried) = (self.effort, self.spent, self.attempts);
        Sought { found: if self.is_solved() { self.into_answer(clock) } else { None }, effort, stats, tried }
    }

    /// The best answer, where it is a solution.
    fn solution(&self) -> Option<&Answer> {
        self.best.as_ref().map(|b| &b.0).filter(|a| a.is_solved())
    }

    fn is_solved(&self) -> bool {
        self.solution().is_some()
    }

    /// Cost of the best answer, infinite where it is no solution.
    fn cost(&self) -> f64 {
        self.solution().map_or(f64::INFINITY, |a| a.cost)
    }

    fn has_costs(&self) -> bool {
        let g = &self.p.given;
        g.lagrange.is_some() || g.mayer.is_some() || g.grid_cost.is_some()
    }

    /// What a start leads to, with the sequences next to it where it says so, if it is better than the best before.
    fn compete(
        &mut self,
        control: &mut Control,
        begin: impl FnOnce(&mut Self, &mut Control) -> Result<bool>,
    ) -> Result<()> {
        let (before, number) = (self.best.take(), self.best_number);
        self.number_anew();
        self.rival = before.as_ref().filter(|b| b.0.is_solved()).map(|b| b.0.cost);
        self.round += 1;
        self.met = false;
        self.most_behind = 2 * self.effort;
        let goes_on = begin(self, control)?;
        if goes_on {
            let most = if self.is_solved() { self.options.search } else { NEAR_UNSOLVED };
            self.improve(Reach::Local, most, control)?;
        }
        self.rival = None;
        self.least.extend(self.best.as_ref().filter(|b| !b.0.is_solved()).map(|b| b.0.violation));
        if let Some(old) = before {
            let same = |new: &Answer| (new.cost - old.0.cost).abs() <= GAIN * old.0.cost.abs();
            let as_good = self.best.as_ref().is_some_and(|new| new.0.is_solved() && same(&new.0));
            self.agreed |= old.0.is_solved() && (self.met || as_good);
            let keeps = self.best.as_ref().is_none_or(|new| !is_better(&new.0, &old.0, self.largest));
            if keeps {
                self.best_number = number;
            }
            let dearer = if keeps { self.best.replace(old) } else { Some(old) };
            self.keep(dearer);
        }
        Ok(())
    }

    /// Keeps a solution that is not the best, or is not any more; of those with about the same cost the cheapest.
    fn keep(&mut self, dearer: Option<Found>) {
        let Some(new) = dearer.filter(|d| d.0.is_solved()) else { return };
        let at = self.others.partition_point(|o| o.0.cost <= new.0.cost);
        let apart = |a: f64, b: f64| b - a > APART * a.abs();
        if at > 0 && !apart(self.others[at - 1].0.cost, new.0.cost) {
            return;
        }
        let cost = new.0.cost;
        self.others.insert(at, new);
        while self.others.get(at + 1).is_some_and(|o| !apart(cost, o.0.cost)) {
            self.others.remove(at + 1);
        }
        self.others.truncate(OTHERS);
    }

    /// Takes the solutions that are dearer than the best, with the effort of the search.
    fn other_answers(&mut self) -> Vec<Found> {
        let mut others = std::mem::take(&mut self.others);
        let best = self.best.as_ref().map_or(f64::INFINITY, |b| b.0.cost);
        others.retain(|o| o.0.cost - best > APART * best.abs());
        others.iter_mut().for_each(|o| o.0.effort = self.effort);
        others
    }

    /// May the sequence have a solution that is not known yet?
    fn is_new(&self, sequence: &Sequence) -> bool {
        let key = sequence.key();
        match self.tried.iter().find(|t| t.0 == key).map(|t| t.1) {
            None => true,
            Some(Tried::Solved { best, .. }) => self.again && best != self.best_number,
            Some(Tried::Failed { round, of }) => {
                round != self.round && !(self.from_best && of == Some(self.best_number))
            }
            Some(Tried::Close { best }) => best != self.best_number,
        }
    }

    /// Counts what another search has taken.
    fn count(&mut self, other: &Search) {
        self.spent.add(&other.spent);
        self.attempts += other.attempts;
    }

    /// Another answer is the best, or none is.
    fn number_anew(&mut self) {
        self.numbers += 1;
        self.best_number = self.numbers;
    }

    /// What a solve took, and how large its program was.
    fn note(&mut self, dimensions: (usize, usize, usize), stats: &Statistics) {
        self.spent.add(stats);
        self.effort += stats.iterations * dimensions.0;
        if dimensions.0 > self.dimensions.0 {
            self.dimensions = dimensions;
        }
    }

    /// Solves for a sequence unless that was done, and for those that its phases without length lead to as long as their programs come close to a better
    /// answer; true where the best answer now is one of them.
    fn attempt(&mut self, sequence: &Sequence, guess: &Track, most: usize, control: &mut Control) -> Result<bool> {
        self.lead = None;
        let mut better = self.attempt_from(sequence, guess, None, most, control)?;
        let failure = self.failure;
        for _ in 0..LEADS {
            if self.is_over() {
                break;
            }
            let Some((sequence, track, vanishing)) = self.lead.take() else { break };
            let frictional = self.frictional();
            let near = neighbours(&sequence, &vanishing, &[], &frictional, false);
            let ways = near.into_iter().filter(|n| n.wanted && self.is_new(&n.sequence)).take(WAYS);
            for way in ways.collect::<Vec<_>>() {
                better |= self.attempt_from(&way.sequence, &track, None, NEAR_ITERATIONS, control)?;
                if self.lead.is_some() || self.failure == 0.0 {
                    break;
                }
            }
        }
        self.failure = failure;
        Ok(better)
    }

    /// Solves for the sequences without the short phases of the best motion, which is none of a solution: a contact that opens where its force is
    /// nearly zero and lands at once has a cost that next to nothing says when, and on a fine grid its program has no end.
    fn attempt_without_short_phases(&mut self, control: &mut Control) -> Result<()> {
        let Some((best, _)) = &self.best else { return Ok(()) };
        let (planned, track) = (best.planned.clone(), best.track.clone());
        let short = modal::shorter(&modal::phase_lengths(self.p, &planned, &track), LEAST);
        let near = neighbours(&planned, &short, &[], &self.frictional(), false);
        for way in near.into_iter().filter(|n| n.wanted).take(WAYS) {
            if self.is_solved() || self.is_over() {
                break;
            }
            self.attempt_from(&way.sequence.without_idle_impacts(), &track, None, NEAR_ITERATIONS, control)?;
        }
        Ok(())
    }

    fn frictional(&self) -> Vec<bool> {
        self.p.functions.contacts.iter().map(|c| c.n_tangents > 0).collect()
    }

    /// The same from variables and multipliers, where the program has as many.
    fn attempt_from(
        &mut self,
        sequence: &Sequence,
        guess: &Track,
        point: Option<&[Vec<f64>; 3]>,
        most: usize,
        control: &mut Control,
    ) -> Result<bool> {
        let key = sequence.key();
        let known = self.tried.iter().find(|t| t.0 == key).map(|t| t.1);
        if let Some(Tried::Solved { cost, .. }) = known.filter(|_| !self.again) {
            let own = self.cost();
            self.met |= cost < own - GAIN * own.abs() || own.is_infinite();
        }
        let is_new = self.is_new(sequence);
        let of = std::mem::take(&mut self.from_best).then_some(self.best_number);
        if !is_new || !modal::can_begin(self.p, sequence) || stop::requested().is_some() {
            return Ok(false);
        }
        self.tried.retain(|t| t.0 != key);
        self.tried.push((key, Tried::Failed { round: self.round, of }));
        let place = self.tried.len() - 1;
        let patience = if most <= NEAR_ITERATIONS { NEAR_PATIENCE } else { most / 4 };
        let settings = MpccSettings {
            max_iter: self.options.solver.max_iter.min(most),
            mu_init: NEAR_BARRIER,
            ..self.options.solver
        };
        let limits = Limits { patience, cost: self.cost(), exact_rows: self.refines, close: self.close };
        let (mut answer, mut solved) =
            solve_sequence(self.p, sequence, guess, &Held::default(), point, settings, limits, control)?;
        self.note(answer.dimensions, &answer.stats);
        let cheaper =
            self.best.as_ref().is_none_or(|b| !b.0.is_solved() || answer.cost < b.0.cost + PROMISING * b.0.cost.abs());
        let stuck = matches!(answer.outcome, Outcome::MaxIter | Outcome::Stalled);
        if stuck && cheaper && answer.violation < PROMISING && answer.vanishing.is_empty() {
            // again from where it got to: steps that the filter of the last solve refuses are often the right ones
            let most = if self.is_solved() { AGAIN_ITERATIONS } else { ITERATIONS };
            let settings = MpccSettings {
                max_iter: self.options.solver.max_iter.min(most),
                mu_init: NEAR_BARRIER,
                ..self.options.solver
            };
            let last = answer.point.clone();
            let limits = Limits { patience: most, close: false, ..limits };
            let again =
                solve_sequence(self.p, sequence, guess, &Held::default(), Some(&last), settings, limits, control)?;
            self.note(again.0.dimensions, &again.0.stats);
            if is_better(&again.0, &answer, self.largest) {
                (answer, solved) = again;
            }
        }
        if answer.overlap && self.best.as_ref().is_none_or(|b| is_better(&answer, &b.0, self.largest)) {
            // the cost of a motion that cannot be is none to compare with
            if let Some(apart) = without_overlap(self.p, &answer, settings, limits, control)? {
                self.note(apart.0.dimensions, &apart.0.stats);
                if apart.0.is_solved() || self.is_solved() {
                    (answer, solved) = apart;
                }
            }
        }
        self.attempts += 1;
        self.largest = self.largest.max(answer.largest);
        if answer.is_solved() {
            self.tried[place].1 = Tried::Solved { cost: answer.cost, best: self.best_number };
        } else if answer.violation < PROMISING {
            self.tried[place].1 = Tried::Close { best: self.best_number };
        }
        self.failure = if answer.is_solved() { 0.0 } else { answer.violation };
        if stuck && answer.violation <= CONTRADICTION {
            self.contradicted = self.contradicted.min(answer.cost);
        }
        if stuck && cheaper && answer.violation < NEARLY && !answer.vanishing.is_empty() {
            self.lead = Some((answer.sequence.clone(), answer.track.clone(), answer.vanishing.clone()));
        }
        if self.failure > 0.0 && most < MOST_ITERATIONS && !self.is_solved() {
            self.failed.push((self.failure, sequence.clone(), guess.clone()));
        }
        let better = self.best.as_ref().is_none_or(|b| is_better(&answer, &b.0, self.largest));
        if better {
            self.number_anew();
            let dearer = self.best.replace((answer, solved));
            self.keep(dearer);
        }
        Ok(better)
    }

    /// Would a sequence be better, by more than what contradictions of next to nothing may gain, if its constraints did not contradict each other?
    fn is_contradicted(&self) -> bool {
        match self.solution() {
            Some(best) => self.contradicted + LOOKED_GAIN * best.cost.abs() < best.cost,
            None => self.contradicted.is_finite(),
        }
    }

    /// Where nothing has a solution: the sequences that came closest get the iterations of a problem of its own.
    fn insist(&mut self, control: &mut Control) -> Result<()> {
        let mut failed = std::mem::take(&mut self.failed);
        failed.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, sequence, guess) in failed.into_iter().take(INSISTED) {
            let key = sequence.key();
            self.tried.retain(|t| t.0 != key);
            self.attempt(&sequence, &guess, MOST_ITERATIONS, control)?;
        }
        Ok(())
    }

    /// Sequences with one impact more, where an open contact comes closest to closing.
    fn with_impacts(&self, best: &Answer) -> Vec<Neighbour> {
        let g = &self.p.given;
        let mut out = Vec::new();
        let planned = &best.sequence;
        let places: Vec<(usize, usize)> =
            planned.stages.iter().enumerate().flat_map(|(k, s)| (0..s.len()).map(move |j| (k, j))).collect();
        // gaps at the ends of stages, where every stage has an end
        let ends: Vec<Vec<f64>> = (0..self.p.n_stages())
            .filter_map(|k| {
                let piece = best.track.pieces.iter().rev().find(|p| p.stage == k)?;
                let x = &piece.xs[piece.xs.len() - g.dims.x..];
                let at = Point {
                    t: piece.t + piece.h,
                    x,
                    u: &best.track.controls[k * g.wide.u..k * g.wide.u + g.dims.u],
                    p: &g.params[k * g.wide.p..k * g.wide.p + g.dims.p],
                };
                Some(self.p.gaps(&at).iter().map(|gap| gap.1).collect())
            })
            .collect();
        for c in 0..self.p.n_contacts() {
            let gap = |k: usize| ends.get(k).map_or(f64::INFINITY, |e| e[c]);
            let mut low: Vec<usize> =
                (1..ends.len()).filter(|&k| gap(k) <= gap(k - 1) && gap(k) <= gap(k + 1)).collect();
            low.sort_by(|a, b| gap(*a).total_cmp(&gap(*b)));
            for k in low.into_iter().take(PUT_IN) {
                let open = places.iter().rev().find(|(i, j)| *i == k && !planned.stages[k][*j].modes[c].is_closed());
                let sequence = open.and_then(|&(k, j)| with_impact(planned, k, j, c));
                let local = best.touched.iter().any(|t| (t.contact, t.condition, t.phase.0) == (c, Condition::Gap, k));
                let with =
                    |sequence| Neighbour { sequence, moved: Move::Impact(c), wanted: false, local, class: u8::MAX };
                out.extend(sequence.map(with));
            }
        }
        out
    }

    /// Sequences next to an answer.
    fn next_to(&self, best: &Answer) -> Vec<Neighbour> {
        let friction_first = !best.is_solved();
        let mut near = neighbours(&best.sequence, &best.vanishing, &best.touched, &self.frictional(), friction_first);
        near.extend(self.with_impacts(best));
        near
    }

    /// Is the best a solution that all sequences next to it were compared with?
    fn is_settled(&self) -> bool {
        let Some(best) = self.solution().filter(|a| a.vanishing.is_empty()) else { return false };
        let was_tried = |s: &Sequence| !modal::can_begin(self.p, s) || self.tried.iter().any(|t| t.0 == s.key());
        self.next_to(best).iter().all(|n| !n.local || was_tried(&n.sequence))
    }

    /// Goes to sequences next to the best as long as the cost falls, to `most` of them, and from the first solution on to as many as the options
    /// say. What has helped is tried on; of the rest of the same prospects those come
    /// first whose last attempt is longest ago, so that every event has its turn before one has its second.
    fn improve(&mut self, reach: Reach, most: usize, control: &mut Control) -> Result<()> {
        let mut left = most;
        let few = if self.agreed { FEW_AGREED } else { FEW };
        let mut apart_in_vain = 0;
        // events that were where no solution is, and when moves did not help last
        let mut impossible: Vec<Event> = Vec::new();
        let mut failed: Vec<(Move, usize)> = Vec::new();
        let (mut turn, mut helped, mut in_vain) = (0, None, 0);
        let mut solved = self.is_solved();
        let costs = self.has_costs();
        while let Some(best) = self.best.as_ref().map(|b| b.0.clone()) {
            if best.is_solved() && !costs {
                // all solutions are as good
                return Ok(());
            }
            if best.is_solved() && !std::mem::replace(&mut solved, true) {
                left = self.options.search;
            }
            let own = best.sequence.events();
            let mut near = self.next_to(&best);
            let last = |m: &Move| failed.iter().find(|f| f.0 == *m).map_or(0, |f| f.1);
            near.sort_by_key(|n| (!n.wanted, helped != Some(n.moved), n.class, last(&n.moved)));
            if best.is_solved() && reach == Reach::All {
                in_turn(&mut near, helped);
            }
            let mut better = false;
            for Neighbour { sequence: s, moved, wanted, local, .. } in near {
                let apart = match reach {
                    Reach::Wanted => !wanted,
                    Reach::Local => !local && best.is_solved(),
                    Reach::All => false,
                };
                if apart {
                    continue;
                }
                let behind = best.is_solved() && self.rival.is_some_and(|r| r < best.cost);
                let behind = behind && (in_vain >= BEHIND || self.effort >= self.most_behind);
                let enough = !local && best.is_solved() && apart_in_vain >= few;
                if left == 0 || behind || enough || self.met || self.is_over() {
                    return Ok(());
                }
                // an event that was clearly impossible in another sequence will be again
                let new: Vec<Event> = s.events().into_iter().filter(|e| !own.contains(e)).collect();
                if !local && best.is_solved() && new.iter().any(|e| impossible.contains(e)) {
                    continue;
                }
                let known = self.attempts;
                self.failure = 0.0;
                self.from_best = true;
                better = self.attempt(&s, &best.track, NEAR_ITERATIONS, control)?;
                left -= (self.attempts - known).min(left);
                if best.is_solved() && self.failure > PROMISING {
                    impossible.extend(new);
                }
                if better {
                    (helped, in_vain, apart_in_vain) = (Some(moved), 0, 0);
                    break;
                }
                in_vain += 1;
                apart_in_vain += usize::from(!local);
                turn += 1;
                failed.retain(|f| f.0 != moved);
                failed.push((moved, turn));
            }
            if !better {
                return Ok(());
            }
        }
        Ok(())
    }
}
