//! Answers that simulations of their controls leave, solved for again on finer grids.
//!
//! Controls that are constant on a stage let small errors grow where the motion is unstable: a leg that stands straight up falls by a factor of
//! thirty in an eighth of a second, and with it the error of the method. An answer whose stages end elsewhere than simulations of them is none of
//! the control problem. On a finer grid its order of contacts is solved for from its motion, and those next to it, all grids together for no more
//! than [`SHARE`] of the effort of the search, and never less than one program each. What is found replaces the answer where
//! simulations of its stages are closer to it; of two that they are as far from the cheaper one is kept.

use super::exact::Solved;
use super::problem::Problem;
use super::search::{solve_again, Answer, Options};
use super::simulate::replay_stages;
use crate::error::Result;
use crate::nlp::Control;
use crate::stop;

/// How often a grid is refined.
const ROUNDS: usize = 3;
/// Effort of all grids, as a share of that of the search before, after which no more orders of contacts are tried.
const SHARE: f64 = 0.5;
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
}

/// Refines the grid of an answer until simulations of its stages are within `within` of it, or as far as that has solutions.
///
/// # Errors
/// Those of building programs.
pub fn refine(
    problem: Problem,
    (answer, solved): (Answer, Solved),
    options: &Options,
    (within, tol): (f64, f64),
    control: &mut Control,
) -> Result<Refined> {
    let off = |p: &Problem, a: &Answer| {
        let stages = replay_stages(p, a, &a.durations(p.n_stages()), tol);
        stages.map_or(f64::INFINITY, |d| d.into_iter().fold(0.0, f64::max))
    };
    let most = (SHARE * answer.effort as f64) as usize;
    let mut best = Refined { off: off(&problem, &answer), problem, answer, solved };
    let freezing = best.answer.freezing.clone();
    let (mut spent, mut stats, mut tried) = (0, best.answer.stats, best.answer.tried);
    for _ in 0..ROUNDS {
        if best.off <= within || stop::requested().is_some() {
            break;
        }
        let finer = best.problem.finer()?;
        let Some((answer, solved)) = solve_again(&finer, &best.answer, options, most.saturating_sub(spent), control)?
        else {
            break;
        };
        spent += answer.effort;
        stats.add(&answer.stats);
        tried += answer.tried;
        let off = off(&finer, &answer);
        let closer = off <= within || off * AS_FAR < best.off;
        let as_far = off <= best.off * AS_FAR;
        if !(closer || as_far && answer.cost < best.answer.cost) {
            break;
        }
        best = Refined { problem: finer, answer, solved, off };
    }
    (best.answer.stats, best.answer.tried, best.answer.freezing) = (stats, tried, freezing);
    Ok(best)
}
