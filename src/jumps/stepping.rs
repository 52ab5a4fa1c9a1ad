//! Time stepping: a coarse program on a fixed grid that finds out which contacts are worth it.
//!
//! Implicit Euler with equal steps, and complementarity at their ends alone,
//!
//! ```text
//! 0 ≤ λ_k ⊥ g_k + e g_{k−2} ≥ 0,    0 ≤ β₁ ⊥ γ + s ≥ 0,    0 ≤ β₂ ⊥ γ − s ≥ 0,    0 ≤ μλ − β₁ − β₂ ⊥ γ ≥ 0
//! ```
//!
//! (D. E. Stewart, J. C. Trinkle, *An implicit time-stepping scheme for rigid body dynamics with inelastic collisions and Coulomb
//! friction*, 1996; M. Posa, C. Cantu, R. Tedrake, *A direct method for trajectory optimization of rigid bodies through contact*,
//! 2014; restitution as in L. Paoli, M. Schatzman, *A numerical scheme for impact problems*, 2002: the law holds for the gap two steps
//! ago, so that a ball that comes with speed `w` leaves with `e w` two steps later). An impact is a large force during a step or two,
//! so no step length is free and impulses need no variables of their own. Forces at a distance, which relaxed complementarity has, pull
//! contacts together that a motion without them would never try.

use super::complementary::{assemble, direction, plan, read, Sizes, SHARE};
use super::modes::ContactMode;
use super::problem::Problem;
use super::track::{Piece, Track};
use super::transcribe::Transcription;
use crate::func::Point;

/// The program of `n` steps in every control stage; `p` has the method of one stage point.
pub(super) fn transcribe(p: &Problem, n: usize, guess: &Track) -> Transcription {
    let mut plan = plan(p, n);
    for e in &mut plan {
        let h = e.span[1] - e.span[0];
        (e.jump, e.length) = (None, [h, h]);
    }
    assemble(p, &plan, 0.0, guess, true)
}

/// Shares of the largest gap and speed below which a time apart between two contacts, or sliding, counts for nothing.
/// Each of them gives a motion with fewer events than the last; the first is the motion as it is.
pub(super) const LEVELS: [f64; 3] = [SHARE, 0.05, 0.25];

/// The motion at a point of the program, with contacts as they are at one of the [`LEVELS`].
pub(super) fn motion(p: &Problem, t: &Transcription, w: &[f64], level: f64) -> Track {
    let mut track = read(p, t, w);
    let restitutions = p.restitutions(&t.state(p, t.x0, w));
    let sizes = Sizes::new(p, t, w);
    let speed = t.largest_speed(p, w);
    for i in 0..p.n_contacts() {
        let gaps: Vec<f64> = t.elements.iter().map(|e| t.gap(p, i, e.end(), w, e)).collect();
        let modes: Vec<ContactMode> = t
            .elements
            .iter()
            .zip(&track.pieces)
            .map(|(e, piece)| match piece.modes[i] {
                ContactMode::Open => ContactMode::Open,
                _ => direction(&[t.slide(p, i, &t.state(p, e.end(), w), w, e)], level * speed),
            })
            .collect();
        let modes = without_trifles(&modes, &gaps, level * sizes.gaps[i]);
        for (piece, mode) in track.pieces.iter_mut().zip(modes) {
            piece.modes[i] = mode;
        }
    }
    between_stages(with_impacts(p, track, &restitutions))
}

/// Contacts that open or begin to slide without an impact do so where their stage begins, or where it ends if they have landed in it. What a
/// grid of steps says about the time of such an event is no better than a stage; and between stages, where controls jump, forces may
/// jump to zero, while an event inside of a stage needs a force that falls to zero just there, which few motions have.
fn between_stages(mut track: Track) -> Track {
    let pieces = &mut track.pieces;
    let n_c = pieces.first().map_or(0, |q| q.modes.len());
    let decided_by_force =
        |a: ContactMode, b: ContactMode| a != b && (a == ContactMode::Closed || a.is_closed() && !b.is_closed());
    for i in 0..n_c {
        for k in 1..pieces.len() {
            let (was, is) = (pieces[k - 1].modes[i], pieces[k].modes[i]);
            if pieces[k - 1].stage != pieces[k].stage || pieces[k].jump.is_some() || !decided_by_force(was, is) {
                continue;
            }
            let stage = pieces[k].stage;
            let first = pieces[..k].iter().rposition(|q| q.stage != stage).map_or(0, |j| j + 1);
            let as_long = (first..k).all(|j| pieces[j].modes[i] == was && pieces[j].jump.is_none());
            if as_long {
                pieces[first..k].iter_mut().for_each(|q| q.modes[i] = is);
            } else {
                let rest =
                    pieces[k..].iter_mut().take_while(|q| q.stage == stage && q.modes[i] == is && q.jump.is_none());
                rest.for_each(|q| q.modes[i] = was);
            }
        }
    }
    track
}

/// Modes of a contact without times apart between two of contact in which its gap stays below `least`.
fn without_trifles(modes: &[ContactMode], gaps: &[f64], least: f64) -> Vec<ContactMode> {
    let mut out = modes.to_vec();
    let n = out.len();
    let mut k = 0;
    while k < n {
        let end = (k..n).find(|&j| out[j].is_closed() != out[k].is_closed()).unwrap_or(n);
        let between = k > 0 && end < n && !out[k].is_closed();
        if between && gaps[k..end].iter().all(|g| *g < least) {
            let held = out[k - 1];
            out[k..end].fill(held);
        }
        k = end;
    }
    out
}

/// Shares of a step within which impacts are put.
const INSIDE: [f64; 2] = [0.1, 0.9];

/// Share of a step after which the first contact that closes in it does so with the velocities before, by a secant of its gap.
fn landing(p: &Problem, piece: &Piece, hit: &[bool]) -> f64 {
    let (g, n_q) = (p.given(), p.functions.n_q);
    if n_q != p.functions.n_own() {
        return 0.5;
    }
    let u = vec![0.0; g.dims.u];
    let gaps = |x: &[f64]| -> Vec<f64> {
        let params = &g.params[piece.stage * g.wide.p..piece.stage * g.wide.p + g.dims.p];
        p.gaps(&Point { t: piece.t, x, u: &u, p: params }).iter().map(|gap| gap.1).collect()
    };
    let mut ahead = piece.x0.clone();
    (0..n_q).for_each(|k| ahead[k] += piece.h * piece.x0[n_q + k]);
    let both = gaps(&piece.x0).into_iter().zip(gaps(&ahead)).zip(hit);
    let shares = both.filter(|(_, hit)| **hit).map(|((a, b), _)| if b < 0.0 && a > 0.0 { a / (a - b) } else { 0.5 });
    shares.fold(1.0, f64::min).clamp(INSIDE[0], INSIDE[1])
}

/// A contact that closes does so inside of its first step with a force; with restitution it opens at once.
fn with_impacts(p: &Problem, track: Track, restitutions: &[f64]) -> Track {
    let (n_c, n_q) = (p.n_contacts(), p.functions.n_q);
    let mut pieces: Vec<Piece> = Vec::with_capacity(track.pieces.len());
    // modes as they were read, and behind impacts
    let read: Vec<Vec<ContactMode>> = track.pieces.iter().map(|q| q.modes.clone()).collect();
    let bounces = |i: usize| restitutions[i] > 0.0;
    for (k, piece) in track.pieces.iter().enumerate() {
        let before = k.checked_sub(1).map(|k| &read[k]);
        let mut piece = piece.clone();
        let lands = |i: usize| before.is_some_and(|b| !b[i].is_closed()) && piece.modes[i].is_closed();
        let hit: Vec<bool> = (0..n_c).map(lands).collect();
        let behind: Vec<ContactMode> =
            (0..n_c).map(|i| if bounces(i) { ContactMode::Open } else { piece.modes[i] }).collect();
        if !hit.contains(&true) {
            piece.modes = behind;
            pieces.push(piece);
            continue;
        }
        let share = landing(p, &piece, &hit);
        let flight = share * piece.h;
        let middle: Vec<f64> = piece.x0.iter().zip(&piece.xs).map(|(a, b)| (1.0 - share) * a + share * b).collect();
        let held = |i: usize| !hit[i] && behind[i].is_closed();
        let mut first = piece.clone();
        first.h = flight;
        first.modes = (0..n_c).map(|i| if held(i) { behind[i] } else { ContactMode::Open }).collect();
        first.xs.clone_from(&middle);
        first.xs[n_q..].copy_from_slice(&piece.x0[n_q..]);
        let mut second = piece.clone();
        (second.t, second.h) = (piece.t + flight, piece.h - flight);
        second.x0[..n_q].copy_from_slice(&middle[..n_q]);
        // a bounce takes two steps
        let last = track.pieces.get(k + 1).filter(|_| (0..n_c).any(|i| hit[i] && bounces(i))).unwrap_or(&piece);
        second.x0[n_q..].copy_from_slice(&last.xs[n_q..]);
        second.impulses = vec![0.0; 2 * n_c];
        for i in (0..n_c).filter(|&i| hit[i] || held(i)) {
            for j in 2 * i..2 * i + 2 {
                second.impulses[j] = piece.forces[j] * piece.h;
                if bounces(i) && hit[i] {
                    second.impulses[j] += last.forces[j] * last.h;
                }
            }
        }
        // the force behind the impact is that of the next step
        if let Some(next) = track.pieces.get(k + 1) {
            second.forces.clone_from(&next.forces);
        }
        second.jump =
            Some((0..n_c).map(|i| if hit[i] || held(i) { piece.modes[i] } else { ContactMode::Open }).collect());
        second.modes = behind;
        pieces.push(first);
        pieces.push(second);
    }
    Track { pieces, ..track }
}
