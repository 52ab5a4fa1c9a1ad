//! Answers that simulations of their controls leave, solved for again on finer grids.
//!
//! Controls that are constant on a stage let small errors grow where the motion is unstable: a leg that stands straight up falls by a factor of
//! thirty in an eighth of a second, and with it the error of the method. An answer whose stages end elsewhere than simulations of them is none of
//! the control problem. Either the simulations meet contacts that the order of the answer does not have, between two points of its grid: then the
//! order they have is solved for, from their motion. Or the grid is too coarse: on a finer one, in the stages that are off, the order of the answer
//! is solved for from its motion. Those next to it are compared on the first finer grid: what they cost changes there, and next to nothing on the
//! grids behind. All grids together take no more than [`SHARE`] of the effort of the search, and never less than one program
//! each. What is found replaces the answer where simulations of its stages are closer to it; of two that they are as far from the cheaper one is kept.

use super::answer::{Answer, Found};
use super::exact::Solved;
use super::modes::{ContactMode, Key};
use super::options::Options;
use super::problem::Problem;
use super::search::{solve_again, Sought};
use super::simulate::replay_stages;
use super::space::Reach;
use super::track::{Piece, Track};
use crate::error::Result;
use crate::nlp::{Control, Statistics};
use crate::stop;

/// How often an order or a grid is replaced.
const ROUNDS: usize = 6;
/// Effort of all grids, as a share of that of the search before, after which no more orders of contacts are tried.
const SHARE: f64 = 0.5;
/// Multiple of what is aimed at above which a stage gets four times the elements instead of twice as many: where a motion is faster than its
/// elements an error falls with a low power of their length, whatever the order of the method.
const FAR_OFF: f64 = 10.0;
/// Differences of which one is at most this multiple of the other count as the same: both are of another motion.
const AS_FAR: f64 = 2.0;

/// An answer with its program, how far simulations of single stages are off its states there, and the grid it belongs to.
pub struct Refined {
    /// The problem on the last grid.
    pub problem: Problem,
    /// The answer on it.
    pub answer: Answer,
    /// Its program.
    pub solved: Solved,
    /// Largest difference of a state at the end of a stage that is simulated from the state of the answer at its start.
    pub off: f64,
    /// The same of every stage.
    stages: Vec<f64>,
    /// The motion of these simulations.
    motion: Track,
}

impl Refined {
    fn new(problem: Problem, (answer, solved): Found, tol: f64) -> Refined {
        let (stages, motion) = match replay_stages(&problem, &answer, &answer.durations(problem.n_stages()), tol) {
            Ok(s) => (s.off, s.track),
            Err(_) => (vec![f64::INFINITY; problem.n_stages()], answer.track.clone()),
        };
        let off = stages.iter().fold(0.0, |m: f64, d| m.max(*d));
        Refined { problem, answer, solved, off, stages, motion }
    }

    /// The motion of the simulations of single stages where that has the contacts of the answer, and of the answer elsewhere: on a finer grid it
    /// is next to the solution, where the answer has the errors of its own.
    fn nearest_motion(&self) -> Track {
        let own = &self.answer.track;
        let of =
            |track: &Track, k: usize| track.pieces.iter().filter(|q| q.stage == k).cloned().collect::<Vec<Piece>>();
        let mut pieces = Vec::new();
        for k in 0..self.problem.n_stages() {
            let (ours, simulated) = (of(own, k), of(&self.motion, k));
            pieces.extend(if changes(&ours) == changes(&simulated) { simulated } else { ours });
        }
        Track { pieces, ..own.clone() }
    }

    /// The problem on a grid that is finer in the stages that are further off than `within`.
    fn finer(&self, within: f64) -> Result<Problem> {
        let more = |off: f64| if off > FAR_OFF * within { 4 } else { 2 };
        self.problem.finer(|k| if self.stages[k] > within { more(self.stages[k]) } else { 1 })
    }

    /// The solution, on the same grid, for the order of contacts that simulations of its stages have, if that was not asked for yet and is closer to its
    /// simulations.
    fn with_simulated_order(
        &self,
        (options, within, tol): (&Options, f64, f64),
        (asked, spent): (&mut Vec<Key>, &mut Spent),
        control: &mut Control,
    ) -> Result<Option<Refined>> {
        let simulated = self.motion.sequence(self.problem.n_stages());
        // where most stages are off it is the method that is, and simulations are of another motion
        let is_close = 2 * self.stages.iter().filter(|off| **off > within).count() <= self.stages.len();
        if !is_close || asked.contains(&simulated.key()) {
            return Ok(None);
        }
        asked.push(simulated.key());
        let from = (&simulated, &self.motion);
        let sought = solve_again(&self.problem, from, (options, Reach::Wanted), spent.left(), control)?;
        Ok(spent.refined(&self.problem, sought, tol).filter(|n| n.replaces(self, within)))
    }

    /// Is it to be had rather than another one?
    fn replaces(&self, other: &Refined, within: f64) -> bool {
        let closer = self.off <= within || self.off * AS_FAR < other.off;
        let as_far = self.off <= other.off * AS_FAR;
        closer || as_far && self.answer.cost < other.answer.cost
    }
}

/// Modes and jumps in the order of time, each of them once.
fn changes(pieces: &[Piece]) -> Vec<(&[ContactMode], Option<&[ContactMode]>)> {
    let mut all: Vec<_> = pieces.iter().map(|q| (&q.modes[..], q.jump.as_deref())).collect();
    all.dedup_by(|next, last| next.1.is_none() && next.0 == last.0);
    all
}

/// What all grids have taken.
struct Spent {
    most: usize,
    effort: usize,
    stats: Statistics,
    tried: usize,
}

impl Spent {
    /// Effort that is left.
    fn left(&self) -> usize {
        self.most.saturating_sub(self.effort)
    }

    /// What was found on a grid, with what it has taken counted.
    fn refined(&mut self, grid: &Problem, sought: Sought, tol: f64) -> Option<Refined> {
        self.effort += sought.effort;
        self.stats.add(&sought.stats);
        self.tried += sought.tried;
        sought.solution().map(|found| Refined::new(grid.of(&found.0), found, tol))
    }
}

/// What refining aims at.
#[derive(Debug, Clone, Copy)]
pub struct Aim {
    /// How far simulations of single stages may be off.
    pub within: f64,
    /// Tolerance of the simulations, relative to the sizes of the states.
    pub tol: f64,
}

/// Refines an answer until simulations of its stages are near enough, or as far as that has solutions, or until it comes to an order of contacts that another
/// answer has been refined through; orders that it comes to join those.
///
/// # Errors
/// Those of building programs.
pub fn refine(
    problem: Problem,
    found: Found,
    options: &Options,
    Aim { within, tol }: Aim,
    visited: &mut Vec<Key>,
    control: &mut Control,
) -> Result<Refined> {
    let mut best = Refined::new(problem, found, tol);
    let freezing = best.answer.freezing.clone();
    let most = (SHARE * best.answer.effort as f64) as usize;
    let mut spent = Spent { most, effort: 0, stats: best.answer.stats, tried: best.answer.tried };
    let mut asked: Vec<Key> = vec![best.answer.sequence.key()];
    let mut compared = false;
    for _ in 0..ROUNDS {
        if best.off <= within || stop::requested().is_some() {
            break;
        }
        let mut next = best.with_simulated_order((options, within, tol), (&mut asked, &mut spent), control)?;
        if next.is_none() {
            let finer = best.finer(within)?;
            let motion = best.nearest_motion();
            let from = (&best.answer.sequence, &motion);
            let reach = if std::mem::replace(&mut compared, true) { Reach::Wanted } else { Reach::Local };
            let sought = solve_again(&finer, from, (options, reach), spent.left(), control)?;
            next = spent.refined(&finer, sought, tol);
            // a finer grid may show a contact that the coarser one has between two points, and have it between two points itself
            if let Some(further) = next.take_if(|n| !n.replaces(&best, within)) {
                next = further.with_simulated_order((options, within, tol), (&mut asked, &mut spent), control)?;
            }
            next = next.filter(|n| n.replaces(&best, within));
        }
        let Some(next) = next else { break };
        let key = next.answer.sequence.key();
        let is_known = visited.contains(&key);
        asked.push(key);
        best = next;
        if is_known {
            break;
        }
    }
    visited.extend(asked);
    (best.answer.stats, best.answer.tried, best.answer.freezing) = (spent.stats, spent.tried, freezing);
    Ok(best)
}
