//! What is hit comes closer before it.

use std::sync::Arc;

use super::exact::{solve_sequence, Limits};
use super::modal::{self, Held};
use super::modes::{ContactMode, Phase, Sequence};
use super::problem::{Problem, Statement};
use super::track::{Piece, Track};
use crate::expr::Graph;
use crate::func::Dims;
use crate::mpcc::MpccSettings;
use crate::nlp::Control;
use crate::scene::{Contact, Scene};

const START: [f64; 4] = [1.0, 0.3, 0.0, 0.0];
const OPEN: [ContactMode; 2] = [ContactMode::Open; 2];
const CLOSED: [ContactMode; 2] = [ContactMode::Closed; 2];

/// A driven point in a corner of 30 degrees between a floor and a roof. It is to leave the floor as fast as it can when it gets to the corner, which no
/// motion above the floor can: both impulses push all the same.
fn corner(e: f64, x0: [f64; 4]) -> Problem {
    let g = Graph::new();
    let (x, y, ux, uy) = (g.x(0), g.x(1), g.u(0), g.u(1));
    let mut scene = Scene::new("corner", 2, 2, 2, 0).unwrap();
    scene.set_force(0, ux.id()).unwrap();
    scene.set_force(1, uy.id()).unwrap();
    let restitution = g.constant(e).id();
    scene.add_contact(Contact { restitution, ..Contact::new(&g, "floor", y) }).unwrap();
    scene.add_contact(Contact { restitution, ..Contact::new(&g, "roof", x * 0.5 - y * 0.75f64.sqrt()) }).unwrap();
    let system = scene.build(&g).unwrap().system;
    let dims = Dims { x: 4, u: 2, p: 0 };
    let effort = g.function("effort", dims, &[(ux * ux + uy * uy) * 1e-3]).unwrap();
    let speed = g.function("speed", dims, &[g.x(3) * -1.0]).unwrap();
    Problem::new(Statement {
        lagrange: Some(Arc::new(effort)),
        grid_cost: Some(Arc::new(speed)),
        x0_bounds: [x0.to_vec(), x0.to_vec()],
        ..Statement::bare(system, dims, vec![0.5; 3])
    })
    .unwrap()
}

/// It flies for two stages, is hit by both contacts, and stays in the corner, or flies back.
fn sequence(behind: [ContactMode; 2]) -> Sequence {
    let phase = |modes: [ContactMode; 2], jump: bool| Phase {
        modes: modes.to_vec(),
        jump: jump.then(|| CLOSED.to_vec()),
        share: 1.0,
    };
    Sequence { stages: vec![vec![phase(OPEN, false)], vec![phase(OPEN, false)], vec![phase(behind, true)]] }
}

fn guess(p: &Problem) -> Track {
    let piece = |k: usize| Piece {
        t: 0.5 * k as f64,
        h: 0.5,
        stage: k,
        modes: OPEN.to_vec(),
        x0: START.to_vec(),
        xs: START.repeat(2),
        forces: vec![0.0; 8],
        ..Piece::default()
    };
    let pieces = (0..3).map(piece).collect();
    Track { tableau: p.given().tableau.clone(), nx: 4, pieces, controls: vec![0.0; 6], free: Vec::new() }
}

#[test]
fn contacts_that_are_hit_close_before_it() {
    for (e, behind) in [(0.0, CLOSED), (0.5, OPEN)] {
        let p = corner(e, START);
        let limits = Limits::of_patience(200);
        let (held, settings) = (Held::default(), MpccSettings::default());
        let s = sequence(behind);
        let (a, _) =
            solve_sequence(&p, &s, &guess(&p), &held, None, settings, limits, &mut Control::default()).unwrap();
        assert!(a.is_solved(), "e = {e}: {}", a.violation);
        let piece = &a.track.pieces[1];
        let before = &piece.xs[4..];
        let rates = [before[3], 0.5 * before[2] - 0.75f64.sqrt() * before[3]];
        assert!(before[0].abs() < 1e-9 && before[1].abs() < 1e-9, "e = {e}: {before:?}");
        assert!(rates.iter().all(|r| *r <= 1e-9), "e = {e}: {rates:?}");
        let impulses = &a.track.pieces[2].impulses;
        assert!(impulses[0] >= 0.0 && impulses[2] > 0.0, "e = {e}: {impulses:?}");
    }
}

#[test]
fn what_moves_away_at_the_start_is_not_hit_there() {
    // at the corner, away from the floor and towards the roof
    let mut s = sequence(CLOSED);
    s.stages[0][0].jump = Some(CLOSED.to_vec());
    assert!(!modal::can_begin(&corner(0.0, [0.0, 0.0, 0.0, 1.0]), &s));
    assert!(modal::can_begin(&corner(0.0, [0.0, 0.0, -1.0, -0.1]), &s));
}
