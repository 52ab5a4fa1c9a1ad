//! Event-driven simulation where the continuation is not unique, not regular, or a surface is only touched.

mod common;
use common::models::*;
use std::sync::{Arc, Mutex};
use switchback::event::{simulate, Ambiguity, Engine, Kind, Options, Outcome};
use switchback::func::Dims;
use switchback::system::System;

fn tol(t: f64) -> Options {
    Options::with_tolerance(t, t)
}

/// `ẋ = sign x` at 0: up, down, or rest.
#[test]
fn all_continuations_are_found_and_somebody_decides() {
    let prefer = |modes: Vec<usize>| {
        let o = Options { ambiguity: Ambiguity::Prefer, preferred: vec![modes], ..tol(1e-8) };
        simulate(&switching('d'), &o, 0.0, &[0.0], 1.0).unwrap()
    };
    for (first, end) in [(0, 1.0), (1, -1.0)] {
        let r = prefer(vec![first]);
        assert_eq!(r.outcome, Outcome::Reached);
        assert!((r.x[0] - end).abs() < 1e-14, "{:?}", r.x);
        let b = &r.branchings[0];
        assert_eq!((b.t, &b.x[..], b.continuations.len()), (0.0, &[0.0][..], 3));
        let mut all: Vec<(Vec<usize>, f64)> =
            b.continuations.iter().map(|c| (c.modes[0].clone(), c.velocity[0])).collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        assert_eq!(all, [(vec![1], -1.0), (vec![0, 1], 0.0), (vec![0], 1.0)]);
        assert_eq!(b.continuations[b.taken.unwrap()].modes, [[first]]);
    }
    // a callback comes before the rule; it sees what the log will say
    let mut e = Engine::new(&switching('d'), &tol(1e-8)).unwrap();
    let seen = Arc::new(Mutex::new(Vec::new()));
    let notes = seen.clone();
    e.set_decider(Some(Box::new(move |b| {
        notes.lock().unwrap().push(b.clone());
        b.continuations.iter().position(|c| c.modes[0] == [0, 1])
    })));
    e.reinit(0.0, &[0.0]).unwrap();
    e.advance(1.0).unwrap();
    assert_eq!((e.state(), e.outcome()), (&[0.0][..], Outcome::Reached));
    assert_eq!(seen.lock().unwrap().len(), e.branchings().len());
    assert!(seen.lock().unwrap()[0].taken.is_none());
    // it may refuse, or name what is not there
    for answer in [None, Some(7)] {
        e.set_decider(Some(Box::new(move |_| answer)));
        e.reinit(0.0, &[0.0]).unwrap();
        assert_eq!(e.advance(1.0).unwrap(), Outcome::Ambiguous);
        assert!(e.reason().contains("not unique") && e.branchings()[0].taken.is_none());
    }
}

#[test]
fn preferences_must_fit() {
    let o = |preferred| Options { ambiguity: Ambiguity::Prefer, preferred, ..tol(1e-8) };
    let why = |o: &Options| Engine::new(&switching('d'), o).err().unwrap().to_string();
    assert!(why(&o(vec![])).contains("each of the 1 subsystems"));
    assert!(why(&o(vec![vec![0], vec![]])).contains("2 lists"));
    assert!(why(&o(vec![vec![0, 2]])).contains("no such mode"));
}

/// The unstable ridge of a two-fold: the sliding mode is kept although both sides may be entered.
#[test]
fn a_ridge_may_be_left_by_preference() {
    // ẋ = sign x + 0 · y from a point on the ridge reached by a state that rests there
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut s = System::new(1, 1, 0).unwrap();
    add_sides(&mut s, &[0], affine("F", d, &[1.0, -1.0], &[]), affine("psi", d, &[0.0], &[(0, 0, 1.0)]));
    let mut e = Engine::new(&s, &tol(1e-8)).unwrap();
    e.set_decider(Some(Box::new(|b| b.continuations.iter().position(|c| c.modes[0].len() == 2))));
    e.reinit(0.0, &[0.0]).unwrap();
    e.advance(1.0).unwrap();
    e.set_decider(Some(Box::new(|b| b.continuations.iter().position(|c| c.modes[0] == [1]))));
    // the active set is found anew
    e.set_controls(&[0.0]).unwrap();
    e.advance(2.0).unwrap();
    assert!((e.state()[0] + 1.0).abs() < 1e-14, "{:?}", e.state());
    let s = e.switches().last().unwrap();
    assert_eq!((s.kind, s.t, s.unique), (Kind::Spontaneous, 1.0, false), "{s:?}");
}
