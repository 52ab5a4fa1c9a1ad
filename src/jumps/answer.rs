//! What a search for contact modes finds, and which of two answers is better.

use super::blame::Blame;
use super::exact::Solved;
use super::guards::Touched;
use super::missed::Missed;
use super::modes::Sequence;
use super::track::Track;
use super::transcribe::Broken;
use crate::freezing::Report;
use crate::mpcc::Certificate;
use crate::nlp::{Outcome, Residuals, Statistics};

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
    /// Do the constraints of its program leave room for contradictions of next to nothing?
    pub(super) has_room: bool,
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
