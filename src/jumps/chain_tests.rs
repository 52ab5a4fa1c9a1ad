//! Chains of bounces.

use std::sync::Arc;

use super::exact::{solve_sequence, Limits};
use super::modal::Held;
use super::modes::{ContactMode, Phase, Sequence, LEAST, SHORTEST};
use super::problem::{Problem, Statement};
use super::simulate::{simulate, simulate_with, Effort, Inputs, Simulated};
use super::track::{Piece, Track};
use crate::expr::{Expr, Graph};
use crate::func::Dims;
use crate::mpcc::MpccSettings;
use crate::nlp::Control;
use crate::scene::{Contact, Scene};

const GRAVITY: f64 = 9.81;
const RESTITUTION: f64 = 0.35;
const BOUNCES: usize = 7;

/// A ball that falls from 1 m in 2 s, with a push sideways that costs its square.
fn ball(elements: usize) -> Problem {
    Problem::new(Statement { n_fe: vec![elements], ..ball_from(1.0) }).unwrap()
}

/// The same from a height, on one element.
pub(super) fn ball_from(height: f64) -> Statement {
    ball_with(height, |y| y)
}

/// The same with a gap that is a function of the height with the slope one at zero: the motion is the same.
fn ball_with(height: f64, gap: impl for<'g> Fn(Expr<'g>) -> Expr<'g>) -> Statement {
    let g = Graph::new();
    let (y, u) = (gap(g.x(1)), g.u(0));
    let mut scene = Scene::new("ball", 2, 2, 1, 0).unwrap();
    scene.set_force(0, u.id()).unwrap();
    scene.set_force(1, g.constant(-GRAVITY).id()).unwrap();
    let restitution = g.constant(RESTITUTION).id();
    scene.add_contact(Contact { restitution, ..Contact::new(&g, "floor", y) }).unwrap();
    let system = scene.build(&g).unwrap().system;
    let dims = Dims { x: 4, u: 1, p: 0 };
    let effort = g.function("effort", dims, &[u * u]).unwrap();
    let x0 = vec![0.0, height, 0.0, 0.0];
    Statement {
        lagrange: Some(Arc::new(effort)),
        x0_bounds: [x0.clone(), x0],
        ..Statement::bare(system, dims, vec![2.0])
    }
}

fn phase(mode: ContactMode, jump: bool, share: f64) -> Phase {
    Phase { modes: vec![mode], jump: jump.then(|| vec![ContactMode::Closed]), share }
}

/// Every bounce takes as long as the one before times the restitution, the last one 1/550 of the first, and none of them vanishes, whatever their
/// lengths are in the guess.
#[test]
fn bounces_of_a_chain_have_their_lengths() {
    for share in [0.02, 1e-3, 2e-4] {
        bounces_that_begin_with(&ball(1), share);
    }
}

/// The same of a gap that is not linear in the coordinates.
#[test]
fn bounces_on_a_curved_gap_have_their_lengths() {
    let p = Problem::new(ball_with(1.0, |y| y.exp() - 1.0)).unwrap();
    for share in [0.02, 1e-3, 2e-4] {
        bounces_that_begin_with(&p, share);
    }
}

/// A guess that stays at its start.
fn at_rest(p: &Problem, h: f64, start: &[f64; 4], controls: Vec<f64>) -> Track {
    let rest = Piece {
        h,
        modes: vec![ContactMode::Open],
        x0: start.to_vec(),
        xs: start.repeat(2),
        forces: vec![0.0; 4],
        ..Piece::default()
    };
    Track { tableau: p.given().tableau.clone(), nx: 4, pieces: vec![rest], controls, free: Vec::new() }
}

fn bounces_that_begin_with(p: &Problem, share: f64) {
    let mut s = Sequence { stages: vec![vec![phase(ContactMode::Open, false, 0.2)]] };
    (0..BOUNCES).for_each(|_| s.stages[0].push(phase(ContactMode::Open, true, share)));
    s.stages[0].push(phase(ContactMode::Closed, true, 0.5));
    let start = [0.0, 1.0, 0.0, 0.0];
    let guess = at_rest(p, 2.0, &start, vec![0.0]);
    let limits = Limits::of_patience(200);
    let (held, settings) = (Held::default(), MpccSettings::default());
    let (a, _) = solve_sequence(p, &s, &guess, &held, None, settings, limits, &mut Control::default()).unwrap();
    assert!(
        a.is_solved() && a.stats.iterations < 20,
        "{share}: {:?}, {}, {}",
        a.outcome,
        a.violation,
        a.stats.iterations
    );
    let fall = (2.0 / GRAVITY).sqrt();
    assert!((a.track.pieces[0].h - fall).abs() < 1e-9 * fall);
    for k in 1..=BOUNCES {
        let exact = 2.0 * fall * RESTITUTION.powi(k as i32);
        let h = a.track.pieces[k].h;
        assert!((h - exact).abs() < 1e-7 * exact, "bounce {k}: {h} instead of {exact}");
    }
    // sequences next to it begin with its lengths as shares of the stage, which takes two seconds, and with no less than the least
    let shares = |k: usize| a.sequence.stages[0][k].share / a.sequence.stages[0][0].share;
    let last = RESTITUTION.powi(BOUNCES as i32);
    assert!(last * fall < LEAST && (shares(BOUNCES) - LEAST * 2.0 / fall).abs() < 1e-9, "{}", shares(BOUNCES));
    assert!((shares(1) - 2.0 * RESTITUTION).abs() < 1e-7, "{}", shares(1));
}

/// What has no rebound and a force that grows from zero at the impact leaves like t³, of which the inner point of a method of two stages is negative:
/// it is no overlap.
#[test]
fn what_leaves_behind_an_impact_opens_from_rest() {
    let (height, hit, pull) = (0.3, 0.4_f64, 5.0);
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let mut scene = Scene::new("crane", 2, 2, 0, 0).unwrap();
    scene.set_force(0, g.constant(0.0).id()).unwrap();
    scene.set_force(1, (x * pull).id()).unwrap();
    scene.add_contact(Contact::new(&g, "floor", y)).unwrap();
    let system = scene.build(&g).unwrap().system;
    // y'' = pull (t - hit) with y(hit) = 0
    let start = [-hit, height, 1.0, -(height - pull * hit.powi(3) / 3.0) / hit];
    let x0 = start.to_vec();
    let dims = Dims { x: 4, u: 0, p: 0 };
    let p =
        Problem::new(Statement { x0_bounds: [x0.clone(), x0], ..Statement::bare(system, dims, vec![1.0]) }).unwrap();
    let s = Sequence { stages: vec![vec![phase(ContactMode::Open, false, 0.5), phase(ContactMode::Open, true, 0.5)]] };
    let guess = at_rest(&p, 1.0, &start, Vec::new());
    let (held, settings) = (Held::default(), MpccSettings::default());
    let limits = Limits::of_patience(200);
    let (a, _) = solve_sequence(&p, &s, &guess, &held, None, settings, limits, &mut Control::default()).unwrap();
    assert!(a.is_solved() && !a.overlap, "{:?}, {}", a.outcome, a.violation);
    let pieces = &a.track.pieces;
    assert!((pieces[0].h - hit).abs() < 1e-9);
    let end = pieces[1].xs[5];
    assert!((end - pull * (1.0 - hit).powi(3) / 6.0).abs() < 1e-9 && pieces[1].xs[1] < 0.0, "{end}");
}

/// A simulation that may have few events ends at the one that is too many.
#[test]
fn events_of_a_simulation_are_limited() {
    let p = ball(1);
    let given = p.given();
    let inputs =
        Inputs { x0: &given.x0_bounds[0], controls: &[0.0], durations: &given.durations, params: &given.params };
    let effort =
        Effort { tolerance: 1e-8, sizes: &[], max_steps: 10_000, max_events: usize::MAX, dense: false, bounded: true };
    let whole = simulate_with(&p, inputs, effort).unwrap();
    let events = |s: &Simulated| s.run.stats.switches + s.run.stats.impacts;
    assert!(whole.times.len() == 2 && events(&whole) > 3);
    let cut = simulate_with(&p, inputs, Effort { max_events: 2, ..effort }).unwrap();
    assert!(cut.times.len() == 1 && events(&cut) == 3, "{} events", events(&cut));
}

/// The motion of a simulation has a piece for every element of its phases: one for a whole stage would be a parabola.
#[test]
fn simulated_motions_are_as_fine_as_their_elements() {
    let p = ball(8);
    let given = p.given();
    let run = simulate(&p, &given.x0_bounds[0], &[0.0], &given.durations).unwrap();
    let track = run.track(&p, &[0.0], &given.durations).unwrap();
    // the fall takes 0.226 of the stage, or two of eight elements
    let fall = (2.0 / GRAVITY).sqrt();
    let falling: Vec<f64> = track.pieces.iter().filter(|q| q.t < 0.999 * fall).map(|q| q.h).collect();
    assert!(falling.len() == 2 && falling.iter().all(|h| (h - 0.5 * fall).abs() < 1e-6), "{falling:?}");
    assert!(track.pieces[0].jump.is_none() && track.pieces[1].jump.is_none() && track.pieces[2].jump.is_some());
    // and is one of the same modes
    assert_eq!(track.sequence(1).stages[0][0].modes, [ContactMode::Open]);
    assert!(track.sequence(1).stages[0][1].jump.is_some());
}

/// What a simulation has of a chain ends where its bounces are shorter than phases may be.
#[test]
fn chains_end_where_bounces_are_short() {
    let mut stage = vec![phase(ContactMode::Open, false, 0.4)];
    let share = |k: i32| 0.3 * RESTITUTION.powi(k);
    (0..12).for_each(|k| stage.push(phase(ContactMode::Open, true, share(k))));
    stage.push(phase(ContactMode::Closed, true, 0.1));
    let mut s = Sequence { stages: vec![stage] };
    let whole: f64 = s.stages[0].iter().map(|p| p.share).sum();
    s.end_chains();
    let stage = &s.stages[0];
    let counted = (0..12).filter(|&k| share(k) >= SHORTEST).count();
    assert_eq!(stage.len(), counted + 2);
    assert!(stage[counted + 1].modes[0].is_closed() && stage[counted + 1].jump.is_some());
    assert!((stage.iter().map(|p| p.share).sum::<f64>() - whole).abs() < 1e-15);
    // what closes without an impact is no end of a chain, and of two impacts after which bodies part each counts
    for (last, jump) in [(ContactMode::Closed, false), (ContactMode::Open, true)] {
        let mut s =
            Sequence { stages: vec![vec![phase(ContactMode::Open, true, 0.5 * SHORTEST), phase(last, jump, 1.0)]] };
        s.end_chains();
        assert_eq!(s.stages[0].len(), 2);
    }
}
