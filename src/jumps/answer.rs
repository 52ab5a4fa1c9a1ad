//! What a search for contact modes finds, and which of two answers is better.

use super::blame::Blame;
use super::exact::Solved;
use super::guards::Touched;
use super::modes::Sequence;
use super::problem::Problem;
use super::shots::Missed;
use super::track::Track;
use super::transcribe::Broken;
use crate::freezing::Report;
use crate::mpcc::Certificate;
use crate::nlp::{Outcome, Residuals, Statistics};

/// Violation below which two answers that are no solutions are compared by their costs.
pub(super) const NEARLY: f64 = 1e-4;
/// Share of the cost by which a sequence must be better to count.
pub(super) const GAIN: f64 = 1e-9;

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
    /// The problem that was searched: as stated, or with room for constraints that contradict each other by next to nothing.
    pub problem: Problem,
    /// The best answer.
    pub best: Found,
    /// Dearer ones that were found on the way, the cheapest first, for whom the best is none of the control problem.
    pub others: Vec<Found>,
}

/// Solutions before others; of two the cheaper, where costs as large as `largest` have the rounding of that, and at the same cost the one without
/// phases that want to vanish; of others the one with the smaller violation, or
/// the cheaper where neither has one that is worth mentioning.
pub(super) fn is_better(a: &Answer, b: &Answer, largest: f64) -> bool {
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
pub(super) fn is_cheaper(a: f64, b: f64, largest: f64) -> bool {
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
