//! From guesses to modes, from modes to exact answers, from these to better ones.

mod starts;

use std::time::Instant;

use super::blame::{blame, Blame};
use super::exact::{solve_sequence, without_overlap, Limits, Solved};
use super::guards::{Condition, Touched};
use super::modal::{self, Held};
use super::modes::{ContactMode, Event, Key, Sequence, LEAST};
use super::neighbours::{in_turn, neighbours, with_impact, Move, Neighbour};
use super::problem::{Problem, CONTRADICTION};
use super::shots::{beside, cheaper, missed, simulation, Missed};
use super::simulate::met;
use super::track::Track;
use super::transcribe::Broken;
use crate::error::{Error, Result};
use crate::freezing::Report;
use crate::func::Point;
use crate::mpcc::{Certificate, MpccSettings};
use crate::nlp::{Control, Outcome, Residuals, Statistics};
use crate::stop::{self, Why};
use starts::{starts, Start};

/// How contact modes are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
pub enum Method {
    /// From the simulated guess and the sequences next to it, and from time stepping; where none of them has a solution, from simulated
    /// shots, and then from FESD with jumps.
    #[default]
    Auto = 0,
    /// From the simulated guess and the sequences next to it.
    Modes = 1,
    /// From FESD with jumps.
    FesdJ = 2,
    /// From time stepping.
    Steps = 3,
    /// From simulations of controls drawn at random and aimed at the constraints.
    Shots = 4,
    /// From time-freezing: finite elements in a numerical time in which nothing jumps.
    Freezing = 5,
}

/// What a search is given besides the problem.
#[derive(Debug, Clone)]
pub struct Options {
    /// How modes are found.
    pub method: Method,
    /// Parameters of the solver.
    pub solver: MpccSettings,
    /// Elements of a control stage in FESD with jumps.
    pub n_fe: usize,
    /// Weight of the soft step equilibration.
    pub rho_h: f64,
    /// Sequences next to an answer that may be tried.
    pub search: usize,
    /// Controls to start from `[n_stages · wide.u]`.
    pub controls: Vec<f64>,
    /// Initial state to start from.
    pub x0: Vec<f64>,
    /// Times and states to start from, where they are given.
    pub states: Option<(Vec<f64>, Vec<f64>)>,
    /// A state at which the conditions at the end hold, where there is one.
    pub target: Option<Vec<f64>>,
    /// A mode sequence to start from.
    pub sequence: Option<Sequence>,
    /// An answer to a problem nearby, whose modes are tried first.
    pub warm: Option<Answer>,
}

/// A contact whose friction and normal force contradict each other in a simulation (Painlevé).
#[derive(Debug, Clone, Copy)]
pub struct Paradox {
    /// The contact.
    pub contact: usize,
    /// The time.
    pub t: f64,
    /// Is it met under the guessed controls, or under those of the closest try?
    pub of_guess: bool,
}

/// What a search found.
#[derive(Debug, Clone)]
pub struct Answer {
    /// How it ended.
    pub outcome: Outcome,
    /// Initial state.
    pub x0: Vec<f64>,
    /// Modes and jumps.
    pub sequence: Sequence,
    pub(super) track: Track,
    /// The cost, whether the point is a solution or not.
    pub cost: f64,
    /// Largest modulus of the cost on the way to it.
    pub(super) largest: f64,
    /// Phases that are as short as they may be: another sequence would be better.
    pub vanishing: Vec<(usize, usize)>,
    /// Conditions of the modes that are reached: other sequences have the same motion.
    pub touched: Vec<Touched>,
    /// Were all sequences next to it tried, and is none better?
    pub settled: bool,
    /// Has a sequence that costs less no solution only for constraints that contradict each other by next to nothing?
    pub contradicts: bool,
    /// Do bodies overlap between the points at which their gaps are held?
    pub overlap: bool,
    /// Events between control stages, and conditions of modes that are reached: the control stage, the time, and whether it is the latter.
    pub kinks: Vec<(usize, f64, bool)>,
    /// Derivatives of the cost by the controls of the scene `[n_stages · nu]`, with the multipliers of the constraints.
    pub gradient: Vec<f64>,
    /// What is left of every residual.
    pub residuals: Residuals,
    /// Type of the solution.
    pub certificate: Certificate,
    /// What all solves took.
    pub stats: Statistics,
    /// Variables, rows and pairs of the program with the most.
    pub dimensions: (usize, usize, usize),
    /// Sequences that were solved for.
    pub tried: usize,
    /// Variables and multipliers, for warm starts, and the sequence of the program they belong to.
    pub(super) point: [Vec<f64>; 3],
    pub(super) planned: Sequence,
    /// Parameters that are variables, by their number among all.
    pub params: Vec<(usize, f64)>,
    /// A function without a value, if that is what kept it from a solution.
    pub trouble: Option<String>,
    /// Largest violation of a row or a bound.
    pub violation: f64,
    /// The row with it, of a point that is no solution.
    pub broken: Option<Broken>,
    /// What its controls miss in a simulation, of a point that is no solution.
    pub missed: Option<Missed>,
    /// What of a contact keeps it from a solution, where that is known.
    pub blame: Option<Blame>,
    /// Where no forces continue a simulation; looked for where there is no solution.
    pub paradox: Option<Paradox>,
    /// Impacts and changes of modes that a simulation of its controls has in every control stage, of a point that is no solution.
    pub changes: Vec<usize>,
    /// Of a point that is no solution: starts of the search that came nearly as close to one, and starts that came to any point.
    pub agreeing: [usize; 2],
    /// Iterations times variables of all programs.
    pub(super) effort: usize,
    /// What stood for the contacts in numerical time, if time-freezing was asked.
    pub freezing: Option<Report>,
}

impl Answer {
    /// Is it a solution?
    pub fn is_solved(&self) -> bool {
        self.outcome == Outcome::Solved
    }

    /// Controls of all stages, those behind the scene's included.
    pub fn controls(&self) -> &[f64] {
        &self.track.controls
    }

    /// Lengths of the control stages.
    pub fn durations(&self, n_stages: usize) -> Vec<f64> {
        let mut lengths = vec![0.0; n_stages];
        self.track.pieces.iter().for_each(|p| lengths[p.stage] += p.h);
        lengths
    }
}

/// An answer with its program.
pub type Found = (Answer, Solved);

/// What a search has found.
pub struct Findings {
    /// The best answer.
    pub best: Found,
    /// Dearer ones that were found on the way, the cheapest first, for whom the best is none of the control problem.
    pub others: Vec<Found>,
}

/// What became of a search on a finer grid.
pub(super) struct Sought {
    /// The answer, if there is one.
    pub(super) found: Option<Found>,
    /// Iterations times variables of all programs.
    pub(super) effort: usize,
    /// What all solves took.
    pub(super) stats: Statistics,
    /// Sequences that were solved for.
    pub(super) tried: usize,
}

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
/// Violation up to which a sequence gets the iterations of one that is right, where it costs less than the best so far or more by no
/// more than this share; next to the next best answer it is tried again.
const PROMISING: f64 = 1e-2;
/// Violation below which two answers that are no solutions are compared by their costs.
const NEARLY: f64 = 1e-4;
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

/// What a search spends to find an answer that has nothing to do with the one it has: on simulations, whose steps times states count like
/// iterations times variables, and on programs.
struct Second {
    simulations: Share,
    programs: Share,
}

/// A share of the effort so far, and what so many programs of the search have taken on average, whichever is more: a search that was over soon has
/// seen little of what else there is, and shares of it would be a handful of simulations.
#[derive(Clone, Copy)]
struct Share {
    of_effort: f64,
    programs: f64,
}

const SECOND: Second = Second {
    simulations: Share { of_effort: 0.36, programs: 44.0 },
    programs: Share { of_effort: 0.5, programs: 30.0 },
};

/// How often it looks: again where the last look has bettered the answer by more than this share, each time for this part of the first and from so
/// many shots. A better answer has other controls, from which others are drawn: a valve costs 192 before, and 38.5 and 33.9 after two looks.
const LOOKS: usize = 4;
const LOOKED_GAIN: f64 = 0.01;
const LATER_LOOK: f64 = 0.25;
const LATER_SHOTS: usize = 2;

/// Share by which the least violations of two starts may differ that agree: neither is a stationary point but for that.
const AGREES: f64 = 0.1;

/// Share of the cost by which a sequence must be better to count.
const GAIN: f64 = 1e-9;

/// Solves: the best answer and its program, and dearer ones.
///
/// # Errors
/// Those of simulations of the guess and of building programs. That there is no solution is no error: it is the outcome of the
/// answer.
pub fn solve(p: &Problem, options: &Options, control: &mut Control) -> Result<Findings> {
    let clock = Instant::now();
    let mut s = Search::new(p, options);
    if let Some(last) = &options.warm {
        s.start_at_answer(last, control)?;
    }
    if s.is_solved() {
        // a warm start goes where phases that vanish lead, and no further
        s.improve(Reach::Wanted, options.search, control)?;
    } else {
        for start in starts(options) {
            if stop::requested().is_none() && !(start.is_for_want() && s.is_solved()) {
                s.explore(start, control)?;
            }
            if start == Start::Shots && !s.is_solved() && s.is_contradicted() {
                break;
            }
        }
        if !s.is_solved() && !s.is_contradicted() && stop::requested().is_none() {
            s.insist(control)?;
        }
        if options.method == Method::Auto && options.sequence.is_none() && stop::requested().is_none() {
            s.look_elsewhere(control)?;
        }
        if stop::requested().is_none() {
            s.again = s.is_solved();
            s.improve(Reach::All, options.search, control)?;
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
    let blame = match &s.best {
        Some((best, _)) if !best.is_solved() && !s.is_contradicted() && stop::requested().is_none() => {
            blame(p, best, options.solver, control)?
        }
        _ => None,
    };
    let seen = s.seen;
    let others = s.other_answers();
    let (mut best, solved) =
        s.into_answer(clock).ok_or_else(|| Error::Internal("a search without an answer".into()))?;
    best.blame = blame;
    if !best.is_solved() {
        let closest = if stop::requested().is_none() { simulation(p, options, &best) } else { None };
        best.missed = closest.as_ref().and_then(|s| missed(p, options, &best, s));
        best.changes = closest.as_ref().map_or_else(Vec::new, |s| s.met().changes);
        let guess = match seen {
            Seen::Simulated(paradox) => paradox,
            Seen::Nothing => met(p, &options.x0, &options.controls, &p.given.durations).ok().and_then(|m| m.paradox),
        };
        let guessed = guess.map(|(contact, t)| Paradox { contact, t, of_guess: true });
        let of_closest = |(contact, t)| Paradox { contact, t, of_guess: false };
        best.paradox = guessed.or_else(|| closest.and_then(|s| s.paradox()).map(of_closest));
    }
    Ok(Findings { best: (best, solved), others })
}

/// Solves for an order of contacts on another grid of the same control stages, from a motion that has it, and for those next to it within
/// reach as long as the effort (iterations times variables) is less than `most`; no answer where the order has no solution there.
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
    let clock = Instant::now();
    let mut s = Search { most_effort: most, refines: true, close: true, ..Search::new(p, options) };
    let sequence = &sequence.without_idle_impacts();
    s.attempt(sequence, motion, NEAR_ITERATIONS, control)?;
    s.close = false;
    if !s.is_solved() {
        s.attempt_without_short_phases(control)?;
    }
    if !s.is_solved() {
        s.round += 1;
        s.attempt(sequence, motion, NEAR_ITERATIONS, control)?;
    }
    if s.is_solved() {
        s.improve(reach, options.search, control)?;
    }
    Ok(s.into_sought(clock))
}

/// Searches on a finer grid of the same control stages for an answer beside one that its simulation leaves, whose order of contacts has no solution there: from
/// the simulation of its controls, aimed at the constraints and as it is, and, if asked, from shots; as long as the effort is less than `most`. No answer where
/// nothing of that leads to a solution.
///
/// # Errors
/// Those of simulations and of building programs.
pub(super) fn solve_beside(
    p: &Problem,
    (answer, options): (&Answer, &Options),
    (shoots, most): (bool, usize),
    control: &mut Control,
) -> Result<Sought> {
    let clock = Instant::now();
    let p = &p.restated_at(answer.durations(p.n_stages()), &answer.params);
    let given = (answer.controls().to_vec(), answer.x0.clone());
    let options =
        &Options { controls: given.0, x0: given.1, states: None, sequence: None, warm: None, ..options.clone() };
    let mut s = Search { most_effort: most, refines: true, ..Search::new(p, options) };
    if let Some(shot) = beside(p, options, answer)? {
        s.compete(control, |s, control| {
            s.attempt(&shot.track.sequence(p.n_stages()), &shot.track, ITERATIONS, control)?;
            Ok(true)
        })?;
    }
    for start in [Start::Guess, Start::Shots] {
        if !s.is_solved() && !s.is_over() && (shoots || start != Start::Shots) {
            s.explore(start, control)?;
        }
    }
    if !s.is_solved() && !s.is_over() {
        s.insist(control)?;
    }
    if s.is_solved() {
        s.improve(Reach::Local, options.search, control)?;
    }
    Ok(s.into_sought(clock))
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
    /// It has a solution of this cost, near the answer that was the best then.
    Solved { cost: f64, bests: usize },
    /// It has no solution near a guess of this round.
    Failed { round: usize },
    /// It nearly has one near the answer that was the best then.
    Close { bests: usize },
}

struct Search<'a> {
    p: &'a Problem,
    options: &'a Options,
    spent: Statistics,
    /// Sequences that were tried.
    tried: Vec<(Key, Tried)>,
    /// Answers that were the best at their time.
    bests: usize,
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
            bests: 0,
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
            contradicted: f64::INFINITY,
            seen: Seen::Nothing,
            freezing: None,
        }
    }

    /// Is no more to be spent?
    fn is_over(&self) -> bool {
        self.effort >= self.most_effort || stop::requested().is_some()
    }

    /// The best answer with what the search has spent; nothing without one.
    fn into_answer(self, clock: Instant) -> Option<Found> {
        let (settled, contradicts) = (self.is_settled(), self.is_contradicted());
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
        best.contradicts = contradicts;
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

    fn is_solved(&self) -> bool {
        self.best.as_ref().is_some_and(|b| b.0.is_solved())
    }

    /// Asks whether another start would have bettered the best answer, and again from what is better as long as that pays.
    fn look_elsewhere(&mut self, control: &mut Control) -> Result<()> {
        for look in 0..LOOKS {
            let Some(before) = self.best.as_ref().filter(|b| b.0.is_solved()).map(|b| b.0.cost) else { break };
            self.look_once(look > 0, control)?;
            let after = self.best.as_ref().map_or(before, |b| b.0.cost);
            if stop::requested().is_some() || !is_cheaper(after + LOOKED_GAIN * before.abs(), before, self.largest) {
                break;
            }
        }
        Ok(())
    }

    /// Shots that may cost less, each a start of its own, for what [`SECOND`] says, or, `again`, for a part of it. Nothing else notices that an
    /// answer is dear: all sequences next to it may cost more where the motion that costs a tenth of it has its impacts elsewhere, all of them.
    fn look_once(&mut self, again: bool, control: &mut Control) -> Result<()> {
        let Some((best, _)) = self.best.as_ref().filter(|b| b.0.is_solved()) else { return Ok(()) };
        if !self.has_costs() {
            return Ok(());
        }
        let known = best.cost;
        let program = self.effort as f64 / self.attempts.max(1) as f64;
        let part = if again { LATER_LOOK } else { 1.0 };
        let share = |s: Share| part * (s.of_effort * self.effort as f64).max(s.programs * program);
        let steps = share(SECOND.simulations) / self.p.given.dims.x as f64;
        let shots = cheaper(self.p, self.options, best, steps as usize)?;
        self.most_effort = self.effort + share(SECOND.programs) as usize;
        let mut asked: Vec<Key> = Vec::new();
        for shot in shots.into_iter().take(if again { LATER_SHOTS } else { usize::MAX }) {
            let sequence = shot.track.sequence(self.p.n_stages());
            let key = sequence.key();
            if self.is_over() {
                break;
            }
            if asked.contains(&key) || !self.is_new(&sequence) {
                continue;
            }
            asked.push(key);
            self.compete(control, |s, control| {
                s.attempt(&sequence, &shot.track, NEAR_ITERATIONS, control)?;
                let promises = |a: &Answer| a.is_solved() || a.violation < NEARLY && a.cost < known;
                Ok(s.best.as_ref().is_some_and(|b| promises(&b.0)))
            })?;
        }
        self.most_effort = usize::MAX;
        Ok(())
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
        let before = self.best.take();
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
            Some(Tried::Solved { bests, .. }) => self.again && bests != self.bests,
            Some(Tried::Failed { round }) => round != self.round,
            Some(Tried::Close { bests }) => bests != self.bests,
        }
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
            let own = self.best.as_ref().filter(|b| b.0.is_solved()).map_or(f64::INFINITY, |b| b.0.cost);
            self.met |= cost < own - GAIN * own.abs() || own.is_infinite();
        }
        if !self.is_new(sequence) || !modal::can_begin(self.p, sequence) || stop::requested().is_some() {
            return Ok(false);
        }
        self.tried.retain(|t| t.0 != key);
        self.tried.push((key, Tried::Failed { round: self.round }));
        let place = self.tried.len() - 1;
        let patience = if most <= NEAR_ITERATIONS { NEAR_PATIENCE } else { most / 4 };
        let settings = MpccSettings {
            max_iter: self.options.solver.max_iter.min(most),
            mu_init: NEAR_BARRIER,
            ..self.options.solver
        };
        let best = self.best.as_ref().filter(|b| b.0.is_solved());
        let cost = best.map_or(f64::INFINITY, |b| b.0.cost);
        let limits = Limits { patience, cost, exact_rows: self.refines, close: self.close };
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
            self.tried[place].1 = Tried::Solved { cost: answer.cost, bests: self.bests };
        } else if answer.violation < PROMISING {
            self.tried[place].1 = Tried::Close { bests: self.bests };
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
            self.bests += 1;
            let dearer = self.best.replace((answer, solved));
            self.keep(dearer);
        }
        Ok(better)
    }

    /// Would a sequence be better, by more than what contradictions of next to nothing may gain, if its constraints did not contradict each other?
    fn is_contradicted(&self) -> bool {
        let best = self.best.as_ref().filter(|b| b.0.is_solved());
        best.map_or(self.contradicted.is_finite(), |b| self.contradicted + LOOKED_GAIN * b.0.cost.abs() < b.0.cost)
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
        let Some((best, _)) = self.best.as_ref().filter(|b| b.0.is_solved() && b.0.vanishing.is_empty()) else {
            return false;
        };
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

/// Solutions before others; of two the cheaper, where costs as large as `largest` have the rounding of that, and at the same cost the one without
/// phases that want to vanish; of others the one with the smaller violation, or
/// the cheaper where neither has one that is worth mentioning.
fn is_better(a: &Answer, b: &Answer, largest: f64) -> bool {
    match (a.is_solved(), b.is_solved()) {
        (true, true) => {
            let simpler = a.vanishing.is_empty() && !b.vanishing.is_empty();
            is_cheaper(a.cost, b.cost, largest) || (simpler && !is_cheaper(b.cost, a.cost, largest))
        }
        (false, false) if a.violation.max(b.violation) < NEARLY && (a.cost - b.cost).abs() > GAIN * b.cost.abs() => {
            a.cost < b.cost
        }
        (false, false) => a.violation < b.violation,
        (now, _) => now,
    }
}

/// Is a cost lower than another one by more than counts? Costs have the rounding of the largest on the way to them: those of motions that end at
/// zero are differences of that.
fn is_cheaper(a: f64, b: f64, largest: f64) -> bool {
    a < b - (GAIN * b.abs()).max(f64::EPSILON * largest)
}

#[cfg(test)]
mod tests {
    use super::is_cheaper;

    #[test]
    fn costs_at_zero_have_the_rounding_of_those_on_the_way() {
        // 1e-17 is none the worse than 1e-20 where costs of 3 were seen, and is where none above 1e-12 was
        assert!(!is_cheaper(1e-20, 1e-17, 3.0) && !is_cheaper(-1e-17, 1e-17, 3.0));
        assert!(is_cheaper(1e-20, 1e-17, 1e-12) && !is_cheaper(1e-17, 1e-20, 1e-12));
        // costs away from zero by a share of their own
        assert!(is_cheaper(1.0 - 1e-8, 1.0, 3.0) && !is_cheaper(1.0 - 1e-10, 1.0, 3.0));
        assert!(is_cheaper(-1.0 - 1e-8, -1.0, 3.0) && !is_cheaper(f64::NAN, 1.0, 3.0));
    }
}
