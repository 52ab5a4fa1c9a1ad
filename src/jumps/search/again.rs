//! Searches on finer grids, from an answer on a coarser one.

use std::time::Instant;

use super::super::answer::{Answer, Found};
use super::super::modes::Sequence;
use super::super::options::Options;
use super::super::problem::Problem;
use super::super::shots::{beside, Beside};
use super::super::track::Track;
use super::starts::Start;
use super::{Reach, Search, ITERATIONS, NEAR_ITERATIONS};
use crate::error::Result;
use crate::nlp::{Control, Statistics};

/// What became of a search on a finer grid.
pub(in crate::jumps) struct Sought {
    /// The answer, if there is one.
    pub(in crate::jumps) found: Option<Found>,
    /// Iterations times variables of all programs.
    pub(in crate::jumps) effort: usize,
    /// What all solves took.
    pub(in crate::jumps) stats: Statistics,
    /// Sequences that were solved for.
    pub(in crate::jumps) tried: usize,
}

/// Solves for an order of contacts on another grid of the same control stages, from a motion that has it, and for those next to it within
/// reach as long as the effort (iterations times variables) is less than `most`; no answer where the order has no solution there.
///
/// # Errors
/// Those of building programs.
pub(in crate::jumps) fn solve_again(
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
/// nothing of that leads to a solution, or where that simulation ends nowhere near.
///
/// # Errors
/// Those of simulations and of building programs.
pub(in crate::jumps) fn solve_beside(
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
    let beside = match beside(p, options, answer)? {
        Beside::Elsewhere => return Ok(s.into_sought(clock)),
        Beside::Near(shot) => shot,
    };
    if let Some(shot) = beside {
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
