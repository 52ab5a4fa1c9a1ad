//! Answers that simulations of their controls leave, solved for again on finer grids.
//!
//! Controls that are constant on a stage let small errors grow where the motion is unstable: a leg that stands straight up falls by a factor of
//! thirty in an eighth of a second, and with it the error of the method. An answer whose stages end elsewhere than simulations of them is none of
//! the control problem. Its order of contacts and its motion are where one on a finer grid begins.

use super::exact::Solved;
use super::problem::Problem;
use super::search::{solve_again, Answer, Options};
use super::simulate::replay_stages;
use crate::error::Result;
use crate::nlp::Control;
use crate::stop;

/// How often a grid is refined.
const ROUNDS: usize = 3;

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
    let mut best = Refined { off: off(&problem, &answer), problem, answer, solved };
    for _ in 0..ROUNDS {
        if best.off <= within || stop::requested().is_some() {
            break;
        }
        let finer = best.problem.finer()?;
        let Some((mut answer, solved)) = solve_again(&finer, &best.answer, options, control)? else { break };
        answer.stats.add(&best.answer.stats);
        answer.tried += best.answer.tried;
        let off = off(&finer, &answer);
        best = Refined { problem: finer, answer, solved, off };
    }
    Ok(best)
}
