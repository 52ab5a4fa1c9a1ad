//! Steps and their derivatives against differences, and against each other.

use super::*;
use crate::expr::Graph;
use crate::func::Dims;
use crate::system::SharedFunction;
use crate::tableau::{Family, Tableau};
use std::sync::Arc;

const N: usize = 11;

/// A nonlinear system of `nx` states with two controls and a parameter.
fn system(nx: usize) -> SharedFunction {
    let g = Graph::new();
    let rates: Vec<_> = (0..nx)
        .map(|i| {
            let (x, y) = (g.x(i), g.x((i + 1) % nx));
            (x * y).sin() - x * g.p(0) + g.u(i % 2) * y.cos() + g.t() * 0.1
        })
        .collect();
    Arc::new(g.function("f", Dims { x: nx, u: 2, p: 1 }, &rates).unwrap())
}

struct Data {
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    t: Vec<f64>,
    h: Vec<f64>,
}

fn data(nx: usize) -> Data {
    let wave = |n: usize, f: f64| (0..n).map(|i| (f * i as f64 + 0.3).sin()).collect::<Vec<_>>();
    let h: Vec<f64> = (0..N).map(|k| 0.1 + 0.01 * k as f64).collect();
    Data { x: wave(N * nx, 0.7), u: wave(N * 2, 1.3), p: vec![0.8; N], t: (0..N).map(|k| 0.2 * k as f64).collect(), h }
}

impl Data {
    fn at(&self) -> Starts<'_> {
        Starts { x: &self.x, u: &self.u, p: &self.p, t: &self.t, h: &self.h }
    }
}

/// Derivatives forward and backward against central differences, for all stages.
fn check(stage: &mut dyn Stage, nx: usize, tol: f64) {
    let mut d = data(nx);
    let (mut next, mut a, mut b) = (vec![0.0; N * nx], vec![0.0; N * nx * nx], vec![0.0; N * nx * 2]);
    stage.linearise(&d.at(), &mut next, &mut a, &mut b, None).unwrap();
    let mut again = vec![0.0; N * nx];
    stage.values(&d.at(), &mut again).unwrap();
    let gap = next.iter().zip(&again).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    // implicit steps are solved to this share
    assert!(gap < 1e-12, "{gap:e}");
    let lambda: Vec<f64> = (0..N * nx).map(|i| (0.37 * i as f64).cos()).collect();
    let (mut gx, mut gu) = (vec![0.0; N * nx], vec![0.0; N * 2]);
    stage.adjoint(&d.at(), &lambda, &mut again, &mut gx, &mut gu).unwrap();
    let eps = 1e-5;
    for c in 0..nx + 2 {
        let mut moved = |by: f64| {
            for k in 0..N {
                let v = if c < nx { &mut d.x[k * nx + c] } else { &mut d.u[k * 2 + c - nx] };
                *v += by;
            }
            let mut out = vec![0.0; N * nx];
            stage.values(&d.at(), &mut out).unwrap();
            for k in 0..N {
                let v = if c < nx { &mut d.x[k * nx + c] } else { &mut d.u[k * 2 + c - nx] };
                *v -= by;
            }
            out
        };
        let (up, down) = (moved(eps), moved(-eps));
        for k in 0..N {
            let mut product = 0.0;
            for i in 0..nx {
                let e = (up[k * nx + i] - down[k * nx + i]) / (2.0 * eps);
                let v = if c < nx { a[(k * nx + c) * nx + i] } else { b[(k * 2 + c - nx) * nx + i] };
                assert!((v - e).abs() < tol, "stage {k}, row {i}, column {c}: {v} {e}");
                product += v * lambda[k * nx + i];
            }
            let g = if c < nx { gx[k * nx + c] } else { gu[k * 2 + c - nx] };
            assert!((g - product).abs() < 1e-11, "stage {k}, adjoint of column {c}: {g} {product}");
        }
    }
}

#[test]
fn derivatives_of_explicit_steps() {
    for (nx, n_s, m) in [(3, 4, 1), (3, 3, 2), (2, 1, 3), (20, 4, 2), (5, 2, 1)] {
        let tableau = Tableau::new(Family::Explicit, n_s).unwrap();
        check(&mut ExplicitRk::new(&system(nx), N, m, tableau, false), nx, 1e-8);
    }
}

#[test]
fn derivatives_of_implicit_steps() {
    for (family, n_s) in [(Family::GaussLegendre, 2), (Family::RadauIia, 3), (Family::GaussLegendre, 1)] {
        let tableau = Tableau::new(family, n_s).unwrap();
        check(&mut ImplicitRk::new(&system(3), None, 0, N, tableau.clone()).unwrap(), 3, 1e-8);
        let links = (0..3).map(|_| ImplicitRk::new(&system(3), None, 0, N, tableau.clone()).unwrap()).collect();
        check(&mut Chain::new(links, [N, 3, 2]), 3, 1e-8);
    }
}

/// The same system with algebraic states and with them eliminated by hand: `z² + z = x_0 + 2`, `w = z x_1`.
#[test]
fn algebraic_states_are_eliminated() {
    let g = Graph::new();
    let dims = Dims { x: 5, u: 2, p: 1 };
    let [x, y, v, z, w] = [g.x(0), g.x(1), g.x(2), g.x(3), g.x(4)];
    macro_rules! rates {
        ($z:expr, $w:expr) => {
            [$w - x * g.u(0), $z * v.sin() + g.u(1), -v * g.p(0) + $z]
        };
    }
    let [a, b, c] = rates!(z, w);
    let equations = [a, b, c, z * z + z - x - 2.0, w - z * y];
    let full: SharedFunction = Arc::new(g.function("f", dims, &equations).unwrap());
    let root = ((x + 2.0) * 4.0 + 1.0).sqrt() * 0.5 - 0.5;
    let by_hand: SharedFunction = Arc::new(g.function("f", Dims { x: 3, ..dims }, &rates!(root, root * y)).unwrap());
    let tableau = Tableau::new(Family::GaussLegendre, 2).unwrap();
    let mut dae = ImplicitRk::new(&full, None, 2, N, tableau.clone()).unwrap();
    dae.guess_algebraic(&[1.0, 0.0]);
    check(&mut dae, 3, 1e-8);
    let mut ode = ImplicitRk::new(&by_hand, None, 0, N, tableau).unwrap();
    let d = data(3);
    let mut out = [vec![0.0; N * 3], vec![0.0; N * 3]];
    dae.values(&d.at(), &mut out[0]).unwrap();
    ode.values(&d.at(), &mut out[1]).unwrap();
    let gap = out[0].iter().zip(&out[1]).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    assert!(gap < 1e-12, "{gap:e}");
}

/// Second derivatives against differences of the adjoint sweep.
#[test]
fn hessians_of_explicit_steps() {
    for (nx, m) in [(3, 2), (16, 1)] {
        let mut stage = ExplicitRk::new(&system(nx), N, m, Tableau::new(Family::Explicit, 4).unwrap(), true);
        let mut d = data(nx);
        let w = nx + 2;
        let lambda: Vec<f64> = (0..N * nx).map(|i| (0.37 * i as f64).cos()).collect();
        let (mut next, mut a, mut b) = (vec![0.0; N * nx], vec![0.0; N * nx * nx], vec![0.0; N * nx * 2]);
        let mut hess = vec![0.0; N * w * w];
        stage.linearise(&d.at(), &mut next, &mut a, &mut b, Some((&lambda, &mut hess))).unwrap();
        let eps = 1e-5;
        for c in 0..w {
            let mut moved = |by: f64| {
                let change = |d: &mut Data, by: f64| {
                    (0..N).for_each(|k| *(if c < nx { &mut d.x[k * nx + c] } else { &mut d.u[k * 2 + c - nx] }) += by);
                };
                change(&mut d, by);
                let (mut gx, mut gu) = (vec![0.0; N * nx], vec![0.0; N * 2]);
                stage.adjoint(&d.at(), &lambda, &mut next, &mut gx, &mut gu).unwrap();
                change(&mut d, -by);
                (gx, gu)
            };
            let (up, down) = (moved(eps), moved(-eps));
            for k in 0..N {
                for r in c..w {
                    let e = if r < nx {
                        (up.0[k * nx + r] - down.0[k * nx + r]) / (2.0 * eps)
                    } else {
                        (up.1[k * 2 + r - nx] - down.1[k * 2 + r - nx]) / (2.0 * eps)
                    };
                    let v = hess[k * w * w + r + c * w];
                    assert!((v - e).abs() < 1e-8, "stage {k}, entry {r} {c}: {v} {e}");
                }
            }
        }
    }
}
