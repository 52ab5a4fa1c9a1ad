//! Derivatives of all programs against differences.

use std::sync::Arc;

use super::assembly::Program;
use super::modal::Held;
use super::modes::{ContactMode, Phase, Sequence};
use super::overlap::Witness;
use super::problem::{Problem, Statement};
use super::track::{Piece, Track};
use super::transcribe::Transcription;
use super::{complementary, modal};
use crate::expr::Graph;
use crate::fesd::Durations;
use crate::func::Dims;
use crate::nlp::Nlp;
use crate::scene::{Contact, Scene};

/// A driven point above a moving curve with friction and restitution, whose mass depends on where it is; cost and time couple. There may be a current that
/// pushes it, too.
fn problem(n_z: usize) -> Problem {
    let g = Graph::new();
    let (x, y, vx, vy, u, p, t) = (g.x(0), g.x(1), g.x(2), g.x(3), g.u(0), g.p(0), g.t());
    let mut scene = Scene::with_states("test", 2, 2, n_z, 1, 1).unwrap();
    let current = if n_z > 0 { g.x(4) } else { g.constant(0.0) };
    let mass = x * x * 0.2 + 1.0;
    let zero = g.constant(0.0);
    scene.set_inertia(&[mass.id(), zero.id(), zero.id(), mass.id()]).unwrap();
    scene.set_force(0, (u - vx * vx * x * 0.2 + current * (x + 3.0)).id()).unwrap();
    if n_z > 0 {
        scene.set_state_rate(0, (u - current * current - vx * current + t).id()).unwrap();
    }
    scene.set_force(1, (p * -9.81 * mass + t.sin()).id()).unwrap();
    let contact = Contact {
        friction: (x * x * 0.1 + 0.4).id(),
        restitution: (g.constant(0.3) + x * x * 0.01).id(),
        tangents: vec![(vx + x * vy * 0.4).id()],
        ..Contact::new(&g, "floor", y - x * x * 0.2 + t.cos() * 0.1)
    };
    scene.add_contact(contact).unwrap();
    let system = scene.build(&g).unwrap().system;
    let dims = Dims { x: 4 + n_z, u: 1, p: 1 };
    let cost = g.function("cost", dims, &[u * u * x + vy * t + x * vx]).unwrap();
    Problem::new(Statement {
        n_fe: vec![1, 2],
        time: Durations::Horizon,
        time_bounds: [0.5, 2.0],
        t0: 0.3,
        lagrange: Some(Arc::new(cost)),
        mayer: Some(Arc::new(g.function("end", dims, &[x * y * p]).unwrap())),
        params: vec![1.0, 1.1],
        free: vec![None],
        ..Statement::bare(system, dims, vec![0.5, 0.7])
    })
    .unwrap()
}

fn track(p: &Problem) -> Track {
    let nx = p.given().dims.x;
    let with = |x: [f64; 4]| [&x[..], &[0.7][..nx - 4]].concat();
    let piece = |k: usize| Piece {
        t: 0.3 + 0.6 * k as f64,
        h: 0.6,
        stage: k,
        modes: vec![ContactMode::Open],
        x0: with([0.1, 1.0, 0.2, -0.3]),
        xs: [with([0.2, 0.9, 0.3, -0.4]), with([0.3, 0.8, 0.1, -0.5])].concat(),
        forces: vec![1.0, 0.2, 1.5, -0.1],
        ..Piece::default()
    };
    let pieces = vec![piece(0), piece(1)];
    Track { tableau: p.given().tableau.clone(), nx, pieces, controls: vec![0.5, -0.4], free: Vec::new() }
}

/// Central differences of values against the Jacobian, and of the gradient of the Lagrangian against the Hessian.
fn check(t: &mut Transcription) {
    let p: &mut Program = &mut t.program;
    let (n, m) = (p.n(), p.m());
    // a point at which nothing is zero
    let w: Vec<f64> = (0..n).map(|j| 0.5 + 0.3 * (1.7 * j as f64).sin()).collect();
    let y: Vec<f64> = (0..m).map(|i| 0.2 + (0.9 * i as f64).cos()).collect();
    let lagrangian = |p: &mut Program, w: &[f64]| {
        let (mut grad, mut jac) = (vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
        p.derivatives(w, &mut grad, &mut jac).unwrap();
        for (j, v) in grad.iter_mut().enumerate() {
            let pattern = p.jac_pattern();
            *v = 1.3 * *v + pattern.range(j).map(|k| jac[k] * y[pattern.row_idx()[k]]).sum::<f64>();
        }
        grad
    };
    let gradient = lagrangian(p, &w);
    let mut hess = vec![0.0; p.hess_pattern().nnz()];
    p.hessian(&w, 1.3, &y, &mut hess).unwrap();
    let value = |p: &mut Program, w: &[f64]| {
        let mut c = vec![0.0; m];
        1.3 * p.eval(w, &mut c).unwrap() + c.iter().zip(&y).map(|(c, y)| c * y).sum::<f64>()
    };
    let h = 1e-5;
    for j in 0..n {
        let moved = |by: f64| {
            let mut w = w.clone();
            w[j] += by;
            w
        };
        let d = (value(p, &moved(h)) - value(p, &moved(-h))) / (2.0 * h);
        assert!((d - gradient[j]).abs() < 1e-6 * d.abs().max(1.0), "gradient {j}: {} against {d}", gradient[j]);
        let (right, left) = (lagrangian(p, &moved(h)), lagrangian(p, &moved(-h)));
        for i in 0..n {
            let d = (right[i] - left[i]) / (2.0 * h);
            let found = p.hess_pattern().get(i.min(j), i.max(j)).map_or(0.0, |k| hess[k]);
            assert!((d - found).abs() < 1e-5 * d.abs().max(1.0), "second derivative {i}, {j}: {found} against {d}");
        }
    }
}

#[test]
fn mode_programs_have_the_derivatives_of_their_values() {
    for p in [problem(0), problem(1)] {
        check_modes(&p);
    }
}

fn check_modes(p: &Problem) {
    use ContactMode::{Closed, Open, Slides, SlidesBack};
    let phase = |mode, jump: Option<ContactMode>| Phase { modes: vec![mode], jump: jump.map(|j| vec![j]), share: 0.5 };
    let s = Sequence {
        stages: vec![
            vec![phase(Open, None), phase(Open, Some(Slides)), phase(Closed, Some(Closed))],
            vec![phase(Slides, None), phase(SlidesBack, None), phase(Open, None)],
        ],
    };
    // and a gap between stage points
    let held = Held { witnesses: vec![Witness { element: 0, contact: 0, share: 0.4 }], ..Held::default() };
    check(&mut modal::transcribe(p, &s, &track(p), &held));
}

#[test]
fn finite_elements_with_jumps_have_the_derivatives_of_their_values() {
    for p in [problem(0), problem(1)] {
        check(&mut complementary::transcribe(&p, 2, 0.7, &track(&p)));
    }
}
