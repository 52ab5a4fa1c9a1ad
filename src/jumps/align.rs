//! Times of a guess at which a plan finds its elements: events of both that are the same are brought together.
//!
//! A sequence next to an answer has most of its events, at other times. Where its elements took the states of the answer at their own times,
//! an impact that moves by a tenth of a stage would start with velocities of the wrong side of the impact, a violation as large as the
//! velocities jump. Read at times that are stretched between events, states fit the modes, and what is violated is small with the move.

use super::modes::ContactMode;
use super::track::Track;
use super::transcribe::{Jump, Planned};

/// A change of modes or an impact: modes before and behind, and what the contacts do in the impact.
type Change<'a> = (&'a [ContactMode], &'a [ContactMode], Option<&'a [ContactMode]>);

/// Gives every element of a plan its part of the guess.
pub(super) fn align(plan: &mut [Planned], guess: &Track) {
    let (Some(first), Some(last)) = (guess.pieces.first(), guess.pieces.last()) else { return };
    let (Some(start), Some(end)) = (plan.first().map(|e| e.span[0]), plan.last().map(|e| e.span[1])) else { return };
    let own = changes_of_plan(plan);
    let known = changes_of(guess);
    // what both begin with, and what both end with
    let most = own.len().min(known.len());
    let same = |i: usize, j: usize| own[i].1 == known[j].1;
    let head = (0..most).take_while(|&i| same(i, i)).count();
    let tail = (0..most - head).take_while(|&i| same(own.len() - 1 - i, known.len() - 1 - i)).count();
    let mut knots = vec![(start, first.t)];
    knots.extend((0..head).map(|i| (own[i].0, known[i].0)));
    knots.extend((0..tail).rev().map(|i| (own[own.len() - 1 - i].0, known[known.len() - 1 - i].0)));
    knots.push((end, last.t + last.h));
    for e in plan {
        // a time that is that of two knots is the later one at the start of an element, and the earlier one at its end
        let after = knots.iter().rposition(|k| k.0 <= e.span[0]).unwrap_or(0);
        let before = knots.iter().position(|k| k.0 >= e.span[1]).unwrap_or(knots.len() - 1);
        let at = |t: f64| {
            let ((a, from), (b, to)) = (knots[after], knots[before]);
            if t <= a {
                from
            } else if t >= b {
                to
            } else {
                from + (t - a) / (b - a) * (to - from)
            }
        };
        e.from = [at(e.span[0]), at(e.span[1])];
    }
}

fn changes_of_plan(plan: &[Planned]) -> Vec<(f64, Change<'_>)> {
    let mut out = Vec::new();
    for pair in plan.windows(2) {
        let (Some(before), Some(behind)) = (pair[0].modes.as_deref(), pair[1].modes.as_deref()) else { continue };
        let jump = match &pair[1].jump {
            Some(Jump::Given(parts)) => Some(&parts[..]),
            _ => None,
        };
        if jump.is_some() || before != behind {
            out.push((pair[1].span[0], (before, behind, jump)));
        }
    }
    out
}

fn changes_of(track: &Track) -> Vec<(f64, Change<'_>)> {
    let mut out = Vec::new();
    for pair in track.pieces.windows(2) {
        let (before, behind, jump) = (&pair[0].modes[..], &pair[1].modes[..], pair[1].jump.as_deref());
        if jump.is_some() || before != behind {
            out.push((pair[1].t, (before, behind, jump)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::track::Piece;
    use super::*;
    use crate::tableau::{Family, Tableau};

    const OPEN: ContactMode = ContactMode::Open;
    const CLOSED: ContactMode = ContactMode::Closed;

    fn piece(t: f64, h: f64, mode: ContactMode, jump: bool) -> Piece {
        Piece { t, h, modes: vec![mode], jump: jump.then(|| vec![CLOSED]), ..Piece::default() }
    }

    fn element(span: [f64; 2], mode: ContactMode, jump: bool) -> Planned {
        let jump = jump.then(|| Jump::Given(vec![CLOSED]));
        Planned { stage: 0, modes: Some(vec![mode]), jump, span, from: span, length: [0.0, 1.0], tied: false }
    }

    fn guess(pieces: Vec<Piece>) -> Track {
        let tableau = Tableau::new(Family::RadauIia, 2).unwrap();
        Track { tableau, nx: 0, pieces, controls: Vec::new(), free: Vec::new() }
    }

    #[test]
    fn an_impact_that_moves_keeps_its_sides() {
        let g = guess(vec![piece(0.0, 1.0, OPEN, false), piece(1.0, 1.0, CLOSED, true)]);
        let mut plan =
            [element([0.0, 1.0], OPEN, false), element([1.0, 1.5], OPEN, false), element([1.5, 2.0], CLOSED, true)];
        align(&mut plan, &g);
        assert!((plan[0].from[1] - 2.0 / 3.0).abs() < 1e-15);
        assert_eq!([plan[1].from[1], plan[2].from[0], plan[2].from[1]], [1.0, 1.0, 2.0]);
    }

    #[test]
    fn events_around_one_that_is_new_stay_together() {
        let g = guess(vec![piece(0.0, 1.0, OPEN, false), piece(1.0, 1.0, OPEN, true), piece(2.0, 1.0, CLOSED, true)]);
        let mut plan = [
            element([0.0, 0.8], OPEN, false),
            element([0.8, 2.5], OPEN, true),
            element([2.5, 2.75], CLOSED, true),
            element([2.75, 3.0], OPEN, false),
        ];
        align(&mut plan, &g);
        assert_eq!(plan[1].from, [1.0, 2.0]);
        assert_eq!(plan[3].from[1], 3.0);
        // nothing in common: the times as they are
        let mut other = [element([0.0, 1.5], CLOSED, false), element([1.5, 3.0], OPEN, false)];
        align(&mut other, &g);
        assert_eq!(other[1].from, [1.5, 3.0]);
    }
}
