//! Derivatives of optima with respect to initial state and parameters, against differences of optima.

mod common;
use std::sync::Arc;

use common::models::*;
use common::*;
use switchback::error::Error;
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::mpcc::Polish;
use switchback::nlp::Control;
use switchback::ocp::{Ocp, OcpSensitivity};
use switchback::settings::Settings;
use switchback::system::{Regions, Subsystem, System};

/// Differences of optima; solutions are good to 1e-12.
const STEP: f64 = 1e-4;

fn solve(o: &mut Ocp) -> (f64, Vec<f64>) {
    let r = o.solve(&mut Control::default()).unwrap();
    assert_eq!(r.polish, Polish::Done);
    (r.cost, r.controls.clone())
}

/// The optimum near by, on the same elements: another search may leave idle elements elsewhere, and with them another error of the
/// discretisation.
fn solve_near(o: &mut Ocp) -> (f64, Vec<f64>) {
    let r = o.solve_warm(&mut Control::default()).unwrap();
    assert_eq!(r.polish, Polish::Done);
    (r.cost, r.controls.clone())
}

/// Compares the derivatives with respect to datum `k` with differences of two more solves.
fn compare(o: &mut Ocp, s: &OcpSensitivity, k: usize, mut set: impl FnMut(&mut Ocp, f64)) {
    let mut at = |v: f64| {
        set(o, v);
        solve_near(o)
    };
    let (right, left) = (at(STEP), at(-STEP));
    at(0.0);
    let cost = (right.0 - left.0) / (2.0 * STEP);
    assert!((s.cost[k] - cost).abs() < 1e-6 * (1.0 + cost.abs()), "cost, datum {k}: {} {cost}", s.cost[k]);
    let n = right.1.len();
    for (i, d) in s.controls[k * n..(k + 1) * n].iter().enumerate() {
        let u = (right.1[i] - left.1[i]) / (2.0 * STEP);
        assert!((d - u).abs() < 1e-5 * (1.0 + u.abs()), "control {i}, datum {k}: {d} {u}");
    }
}

#[test]
fn the_sliding_mode_problem_follows_its_initial_state() {
    let mut o = sliding_ocp(&from_all_starts(settings(RadauIia, 2, 6, FESD)));
    solve(&mut o);
    let s = o.sensitivity().unwrap();
    assert!(!s.one_sided);
    for k in 0..4 {
        compare(&mut o, &s, k, |o, h| {
            let mut x = SLIDING_X0;
            x[k] += h;
            o.set_x0(&x).unwrap();
        });
    }
}

/// `ẋ = 2 − p_0 sign(x) + u`, from −1 in time 2 close to `p_1`, at the cost of `∫ u²`.
fn braked() -> Ocp {
    let d = Dims { x: 1, u: 1, p: 2 };
    let g = Graph::new();
    let (x, u, p) = (g.x(0), g.u(0), [g.p(0), g.p(1)]);
    let modes = Arc::new(g.function("modes", d, &[2.0 - p[0] + u, 2.0 + p[0] + u]).unwrap());
    let psi = Arc::new(g.function("psi", d, &[x]).unwrap());
    let mut system = System::new(1, 1, 2).unwrap();
    let regions = Regions::Signs { psi, signs: vec![1, -1] };
    system.add_subsystem(Subsystem { rows: vec![0], modes, n_modes: 2, regions }).unwrap();
    let mut o = Ocp::new(&system, 2.0, 4, &Settings { n_fe: 3, ..Settings::default() }).unwrap();
    o.set_lagrange(Arc::new(g.function("L", d, &[u * u + 0.1 * p[0] * p[0]]).unwrap())).unwrap();
    o.set_mayer(Arc::new(g.function("M", d, &[(x - p[1]).powi(2) * 10.0]).unwrap())).unwrap();
    o.set_x0(&[-1.0]).unwrap();
    o.set_params(&[1.0, 1.3]).unwrap();
    o
}

#[test]
fn parameters_move_the_optimum_through_a_crossing() {
    let mut o = braked();
    solve(&mut o);
    let s = o.sensitivity().unwrap();
    compare(&mut o, &s, 0, |o, h| o.set_x0(&[-1.0 + h]).unwrap());
    compare(&mut o, &s, 1, |o, h| o.set_params(&[1.0 + h, 1.3]).unwrap());
    compare(&mut o, &s, 2, |o, h| o.set_params(&[1.0, 1.3 + h]).unwrap());
}

#[test]
fn without_a_solution_there_is_nothing_to_differentiate() {
    assert!(matches!(braked().sensitivity(), Err(Error::State(_))));
    let mut o = sliding_ocp(&settings(RadauIia, 2, 3, STANDARD));
    o.set_x0(&[50.0; 4]).unwrap();
    o.solve(&mut Control::default()).unwrap();
    assert!(matches!(o.sensitivity(), Err(Error::State(_))));
}

/// `q̇ = v`, `v̇ = u − p sign(v)`, from rest: the initial state lies on the switching surface.
fn from_rest() -> Ocp {
    let d = Dims { x: 2, u: 1, p: 1 };
    let g = Graph::new();
    let (q, v, u, p) = (g.x(0), g.x(1), g.u(0), g.p(0));
    let modes = Arc::new(g.function("modes", d, &[v, u - p, v, u + p]).unwrap());
    let psi = Arc::new(g.function("psi", d, &[v]).unwrap());
    let mut system = System::new(2, 1, 1).unwrap();
    let regions = Regions::Signs { psi, signs: vec![1, -1] };
    system.add_subsystem(Subsystem { rows: vec![0, 1], modes, n_modes: 2, regions }).unwrap();
    let mut o = Ocp::new(&system, 2.0, 6, &Settings { n_fe: 2, ..Settings::default() }).unwrap();
    o.set_lagrange(Arc::new(g.function("L", d, &[u * u + 0.1 * v * v]).unwrap())).unwrap();
    o.set_mayer(Arc::new(g.function("M", d, &[(q - 1.0).powi(2) * 10.0]).unwrap())).unwrap();
    o.set_x0(&[0.0, 0.0]).unwrap();
    o.set_u_bounds(&[-3.0], &[3.0]).unwrap();
    o.set_params(&[0.2]).unwrap();
    o
}

/// What starts on a surface has derivatives in the directions that leave it there; the others are not invented.
#[test]
fn an_optimum_that_starts_at_rest_follows_what_leaves_it_at_rest() {
    let mut o = from_rest();
    solve(&mut o);
    let s = o.sensitivity().unwrap();
    assert!(s.one_sided, "one side of the surface only");
    compare(&mut o, &s, 0, |o, h| o.set_x0(&[h, 0.0]).unwrap());
    compare(&mut o, &s, 2, |o, h| o.set_params(&[0.2 + h]).unwrap());
    // the velocity goes off the surface: with the derivative to the right, or none
    let (left, _) = solve(&mut o);
    o.set_x0(&[0.0, STEP]).unwrap();
    let right = (solve(&mut o).0 - left) / STEP;
    assert!(s.cost[1].is_nan() || (s.cost[1] - right).abs() < 1e-2, "{} {right}", s.cost[1]);
}
