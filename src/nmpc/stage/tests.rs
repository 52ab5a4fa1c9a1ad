//! Steps and their derivatives against differences, and against each other.

use super::*;
use crate::expr::Graph;
use crate::func::Dims;
use crate::system::{Regions, SharedFunction, Subsystem, System};
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
    // of two solutions of implicit steps each is off by half of this at most: every stage ends when it is there
    assert!(gap < 2e-12, "{gap:e}");
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

/// A mass on a dry track with a spring and a force; `friction` acts against the velocity.
fn dry(friction: f64) -> System {
    let g = Graph::new();
    let dims = Dims { x: 2, u: 2, p: 1 };
    let mut system = System::new(2, 2, 1).unwrap();
    let smooth = [g.x(1), g.u(0) - g.x(0) * g.p(0) + g.u(1) * g.u(1)];
    system.set_f0(Arc::new(g.function("f", dims, &smooth).unwrap())).unwrap();
    let modes = [g.constant(-friction), g.constant(friction)];
    let regions = Regions::Signs { psi: Arc::new(g.function("psi", dims, &[g.x(1)]).unwrap()), signs: vec![1, -1] };
    let modes = Arc::new(g.function("modes", dims, &modes).unwrap());
    system.add_subsystem(Subsystem { rows: vec![1], modes, n_modes: 2, regions }).unwrap();
    system
}

/// Stages that cross the surface, that begin to slide, that slide.
#[test]
fn derivatives_of_stages_with_switches() {
    let options = crate::event::Options::with_tolerance(1e-12, 1e-12);
    let mut stage = EventStage::new(&dry(0.3), &options, Vec::new(), 0).unwrap();
    let starts = [
        [0.2, 0.05, 1.0, 0.1],
        [0.1, 0.2, -1.5, 0.3],
        [0.1, 0.04, -0.1, 0.2],
        [0.3, -0.3, 0.4, 0.0],
        [0.2, 0.0, 0.1, 0.1],
    ];
    let mut kinds = std::collections::BTreeSet::new();
    for [x, v, u0, u1] in starts {
        let at = |x: [f64; 2], u: [f64; 2], stage: &mut EventStage, a: &mut [f64], b: &mut [f64]| {
            let starts = Starts { x: &x, u: &u, p: &[0.8], t: &[0.5], h: &[0.25] };
            let mut next = [0.0; 2];
            stage.linearise(&starts, &mut next, a, b, None).unwrap();
            let mut again = [0.0; 2];
            stage.values(&starts, &mut again).unwrap();
            assert!(next.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-11));
            let (mut gx, mut gu) = ([0.0; 2], [0.0; 2]);
            stage.adjoint(&starts, &[0.7, -0.4], &mut again, &mut gx, &mut gu).unwrap();
            for (j, (x, u)) in gx.iter().zip(&gu).enumerate() {
                assert!((x - (0.7 * a[2 * j] - 0.4 * a[2 * j + 1])).abs() < 1e-14);
                assert!((u - (0.7 * b[2 * j] - 0.4 * b[2 * j + 1])).abs() < 1e-14);
            }
            next
        };
        let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
        at([x, v], [u0, u1], &mut stage, &mut a, &mut b);
        let (a, b) = (a, b);
        kinds.insert(stage.break_away(0).is_some());
        for c in 0..4 {
            let h = 1e-6;
            let mut moved = |by: f64| {
                let mut z = [x, v, u0, u1];
                z[c] += by;
                at([z[0], z[1]], [z[2], z[3]], &mut stage, &mut [0.0; 4], &mut [0.0; 4])
            };
            // a start on the surface is left by a change of the velocity to one side only
            let (up, down) = (moved(h), moved(if v == 0.0 && c == 1 { 0.0 } else { -h }));
            for i in 0..2 {
                let e = (up[i] - down[i]) / if v == 0.0 && c == 1 { h } else { 2.0 * h };
                let exact = if c < 2 { a[2 * c + i] } else { b[2 * (c - 2) + i] };
                assert!((e - exact).abs() < 1e-5, "{x} {v} {u0}, row {i}, column {c}: {e} {exact}");
            }
        }
    }
    assert_eq!(kinds.len(), 2, "some stages stick, others do not");
}

/// Plans of a few stages, some of which begin as others did, or rest: what is remembered is what would be simulated.
#[test]
fn stages_that_are_remembered_are_the_same() {
    let options = crate::event::Options::with_tolerance(1e-6, 1e-8);
    let [mut new, mut again] = [0, 64].map(|kept| EventStage::new(&dry(0.3), &options, Vec::new(), kept).unwrap());
    let mut seed = 1u64;
    let mut draw = |n: usize| {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as usize % n
    };
    for _ in 0..60 {
        let mut x = [[0.2, 0.0], [0.3, -0.4], [0.0, 0.0]][draw(3)];
        let u = [[0.0, 0.1], [0.9, 0.2]][draw(2)];
        for k in 0..3 {
            let (t, h) = ([0.1 * k as f64], [[0.1], [0.2]][draw(2)]);
            let at = Starts { x: &x, u: &u, p: &[0.8], t: &t, h: &h };
            let found = [&mut new, &mut again].map(|stage| {
                let (mut next, mut a, mut b, mut value) = ([0.0; 2], [0.0; 4], [0.0; 4], [0.0; 2]);
                stage.linearise(&at, &mut next, &mut a, &mut b, None).unwrap();
                stage.values(&at, &mut value).unwrap();
                (next, a, b, value, [0, 1].map(|j| stage.break_away(j)))
            });
            // the length of a stage is a difference of times
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-14 * (1.0 + a.abs()));
            let [one, other] = &found;
            assert!(near(&one.0, &other.0) && near(&one.1, &other.1) && near(&one.2, &other.2), "{found:?}");
            assert!(near(&one.3, &other.3), "{found:?}");
            let limits = |f: &[Option<[f64; 2]>; 2]| f.map(|l| l.unwrap_or([9.0; 2])).concat();
            assert!(near(&limits(&one.4), &limits(&other.4)), "{found:?}");
            x = found[0].0;
        }
    }
    assert!(again.remembered() > 60, "{}", again.remembered());
}

/// A mass that sticks breaks away where the force on it exceeds the friction: `u_0 + u_1² − p x = ± friction`.
#[test]
fn controls_that_stick_know_where_they_break_away() {
    let mut stage = EventStage::new(&dry(0.3), &crate::event::Options::default(), Vec::new(), 0).unwrap();
    let (x, u, p) = ([0.5, 0.0], [0.3, 0.1], [0.8]);
    let at = Starts { x: &x, u: &u, p: &p, t: &[0.0], h: &[0.1] };
    stage.linearise(&at, &mut [0.0; 2], &mut [0.0; 4], &mut [0.0; 4], None).unwrap();
    let [lower, upper] = stage.break_away(0).unwrap();
    assert!(
        (lower - (0.4 - 0.01 - 0.3)).abs() < 1e-12 && (upper - (0.4 - 0.01 + 0.3)).abs() < 1e-12,
        "{lower} {upper}"
    );
    // to first order in the other control, whose force is its square: slope 0.2
    let [lower, upper] = stage.break_away(1).unwrap();
    let weight = 0.5 - (0.3 + 0.01 - 0.4) / 0.6;
    assert!(
        (upper - (0.1 + weight * 0.6 / 0.2)).abs() < 1e-12
            || (upper - (0.1 + (1.0 - weight) * 0.6 / 0.2)).abs() < 1e-12
    );
    assert!(lower < 0.1 && (upper - lower - 0.6 / 0.2).abs() < 1e-12, "{lower} {upper}");
    // it moves: nothing sticks
    let at = Starts { x: &[0.5, 0.4], ..at };
    stage.linearise(&at, &mut [0.0; 2], &mut [0.0; 4], &mut [0.0; 4], None).unwrap();
    assert_eq!((stage.break_away(0), stage.break_away(1)), (None, None));
}
