//! Nonlinear programs and programs with complementarity constraints from the literature, with known answers.

use std::sync::Arc;

use switchback::func::{Callback, Dims, Function};
use switchback::mpcc::{Lifted, Member, Mpcc, MpccSettings, MpccSolver, Polish};
use switchback::nlp::{Bounds, CallbackNlp, Control, Ipm, IpmSettings, Monotone, Nlp, Outcome, Start};

const INF: f64 = f64::INFINITY;

type Vector = fn(&[f64], &mut [f64]);

fn function(name: &str, n: usize, m: usize, f: Vector) -> Arc<dyn Function> {
    Arc::new(Callback::new(name, Dims { x: n, u: 0, p: 0 }, m, move |at, out| {
        f(at.x, out);
        0
    }))
}

/// Objective and rows without derivatives; rows given with their bounds.
fn problem(n: usize, f: Vector, m: usize, c: Vector) -> CallbackNlp {
    let c = (m > 0).then(|| function("c", n, m, c));
    CallbackNlp::new(n, 0, function("f", n, 1, f), c).unwrap()
}

fn bounds(x: &[(f64, f64)], c: &[(f64, f64)]) -> Bounds {
    let split = |v: &[(f64, f64)]| -> (Vec<f64>, Vec<f64>) { v.iter().copied().unzip() };
    let ((xl, xu), (cl, cu)) = (split(x), split(c));
    Bounds { xl, xu, cl, cu }
}

/// Solves and returns outcome, point, objective, restoration iterations.
fn solve(mut p: CallbackNlp, b: &Bounds, x0: &[f64]) -> (Outcome, Vec<f64>, f64, usize) {
    let mut ipm = Ipm::new(&p, IpmSettings::default()).unwrap();
    // derivatives by differences twice over: the error cannot fall below their accuracy
    let mut rule = Monotone { mu_init: 0.1, tol: 1e-7, primal_tol: 1e-8 };
    let outcome = ipm.solve(&mut p, b, Start::Cold(x0), &mut rule, &mut Control::default());
    (outcome, ipm.iterate().x.clone(), ipm.objective(), ipm.statistics().restoration_iterations)
}

fn expect(found: (Outcome, Vec<f64>, f64, usize), x: &[f64], f: f64) -> usize {
    assert_eq!(found.0, Outcome::Solved);
    for (a, b) in found.1.iter().zip(x) {
        assert!((a - b).abs() < 1e-5, "{:?}, expected {x:?}", found.1);
    }
    assert!((found.2 - f).abs() < 1e-6 * (1.0 + f.abs()), "f = {}, expected {f}", found.2);
    found.3
}

#[test]
fn hock_schittkowski_71() {
    let p = problem(
        4,
        |x, o| o[0] = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        2,
        |x, o| {
            o[0] = x.iter().product();
            o[1] = x.iter().map(|v| v * v).sum();
        },
    );
    let b = bounds(&[(1.0, 5.0); 4], &[(25.0, INF), (40.0, 40.0)]);
    let x = [1.0, 4.742999643, 3.821149979, 1.379408294];
    expect(solve(p, &b, &[1.0, 5.0, 5.0, 1.0]), &x, 17.0140172892);
}

#[test]
fn rosenbrock_needs_no_constraints() {
    let p = problem(2, |x, o| o[0] = 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2), 0, |_, _| {});
    expect(solve(p, &bounds(&[(-INF, INF); 2], &[]), &[-1.2, 1.0]), &[1.0, 1.0], 0.0);
}

#[test]
fn the_maratos_effect_costs_nothing() {
    let p = problem(
        2,
        |x, o| o[0] = 2.0 * (x[0] * x[0] + x[1] * x[1] - 1.0) - x[0],
        1,
        |x, o| o[0] = x[0] * x[0] + x[1] * x[1],
    );
    let b = bounds(&[(-INF, INF); 2], &[(1.0, 1.0)]);
    expect(solve(p, &b, &[0.8f64.cos(), 0.8f64.sin()]), &[1.0, 0.0], -1.0);
}

/// Wächter and Biegler, Math. Program. 88 (2000): interior-point methods without restoration fail from here.
#[test]
fn the_counterexample_of_waechter_and_biegler_is_solved() {
    let p = problem(
        3,
        |x, o| o[0] = x[0],
        2,
        |x, o| {
            o[0] = x[0] * x[0] - x[1] - 1.0;
            o[1] = x[0] - x[2] - 0.5;
        },
    );
    let b = bounds(&[(-INF, INF), (0.0, INF), (0.0, INF)], &[(0.0, 0.0); 2]);
    expect(solve(p, &b, &[-2.0, 3.0, 1.0]), &[1.0, 0.0, 0.5], 1.0);
}

#[test]
fn a_problem_without_feasible_points_is_called_infeasible() {
    let p = problem(2, |x, o| o[0] = x[0], 1, |x, o| o[0] = x[0] * x[0] + x[1] * x[1]);
    let found = solve(p, &bounds(&[(-INF, INF); 2], &[(-INF, -1.0)]), &[1.0, 2.0]);
    assert_eq!(found.0, Outcome::Infeasible, "{found:?}");
    let p = problem(1, |x, o| o[0] = x[0], 1, |x, o| o[0] = x[0] * x[0] + 1.0);
    assert_eq!(solve(p, &bounds(&[(-INF, INF)], &[(0.0, 0.0)]), &[3.0]).0, Outcome::Infeasible);
}

#[test]
fn as_many_equations_as_variables_and_more() {
    let rows: Vector = |x, o| {
        o[0] = x[0] * x[0] + x[1] * x[1] - 5.0;
        o[1] = x[0] * x[1] - 2.0;
    };
    let b = bounds(&[(-INF, INF); 2], &[(0.0, 0.0); 2]);
    expect(solve(problem(2, |_, o| o[0] = 0.0, 2, rows), &b, &[3.0, 0.5]), &[2.0, 1.0], 0.0);
    let rows: Vector = |x, o| {
        o[0] = x[0] * x[0] + x[1] * x[1] - 5.0;
        o[1] = x[0] * x[1] - 2.0;
        o[2] = x[0] - 2.0 * x[1];
    };
    let b = bounds(&[(-INF, INF); 2], &[(0.0, 0.0); 3]);
    expect(solve(problem(2, |_, o| o[0] = 0.0, 3, rows), &b, &[3.0, 0.5]), &[2.0, 1.0], 0.0);
}

#[test]
fn dependent_rows_and_fixed_variables() {
    let rows: Vector = |x, o| {
        o[0] = x[0] + x[1] + x[2];
        o[1] = 2.0 * (x[0] + x[1] + x[2]);
    };
    let p = problem(3, |x, o| o[0] = x.iter().map(|v| v * v).sum(), 2, rows);
    let b = bounds(&[(-INF, INF), (-INF, INF), (0.5, 0.5)], &[(3.0, 3.0), (6.0, 6.0)]);
    expect(solve(p, &b, &[0.0; 3]), &[1.25, 1.25, 0.5], 3.375);
}

/// Solves a problem whose pairs are members; returns outcome, polish, point, objective, multipliers of the pairs.
fn solve_mpcc(
    p: CallbackNlp,
    b: &Bounds,
    pairs: &[(Member, Member)],
    x0: &[f64],
) -> (Outcome, Polish, Vec<f64>, f64, Vec<(f64, f64)>) {
    let n = p.n();
    let mut lifted = Lifted::new(p, pairs).unwrap();
    let b = lifted.bounds(b).unwrap();
    let w0 = lifted.start(x0);
    let settings = MpccSettings { tol: 1e-8, polish_tol: 1e-10, ..MpccSettings::default() };
    let mut solver = MpccSolver::new(&mut lifted, settings).unwrap();
    let s = solver.solve(&mut lifted, &b, &w0, &mut Control::default()).clone();
    let multipliers = lifted.pairs().iter().map(|&(i, j)| (s.z[i], s.z[j])).collect();
    (s.outcome, s.polish, s.x[..n].to_vec(), s.objective, multipliers)
}

const PAIR: [(Member, Member); 1] = [(Member::Variable(0), Member::Variable(1))];

fn near(x: &[f64], y: &[f64]) -> bool {
    x.iter().zip(y).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn both_members_of_a_pair_may_be_zero() {
    let p = problem(2, |x, o| o[0] = x[0] * x[0] + x[1] * x[1], 0, |_, _| {});
    let (outcome, _, x, f, _) = solve_mpcc(p, &bounds(&[(0.0, INF); 2], &[]), &PAIR, &[1.0, 1.0]);
    assert_eq!(outcome, Outcome::Solved);
    // the bound has no multiplier: a barrier of 1e-10 leaves its square root between it and the point
    assert!(x.iter().all(|v| v.abs() < 3e-5) && f < 1e-9, "{x:?}");
}

/// Scheel and Scholtes, Math. Oper. Res. 25 (2000): B-stationary, not strongly stationary.
#[test]
fn the_example_of_scheel_and_scholtes() {
    let p = problem(
        3,
        |x, o| o[0] = x[0] + x[1] - x[2],
        2,
        |x, o| {
            o[0] = 4.0 * x[0] - x[2];
            o[1] = 4.0 * x[1] - x[2];
        },
    );
    let b = bounds(&[(0.0, INF), (0.0, INF), (-INF, INF)], &[(0.0, INF); 2]);
    let (outcome, _, x, f, _) = solve_mpcc(p, &b, &PAIR, &[1.0, 1.0, 1.0]);
    assert_eq!(outcome, Outcome::Solved);
    assert!(x.iter().all(|v| v.abs() < 1e-3) && f.abs() < 1e-3, "{x:?} {f}");
}

/// Leyffer and Munson: the origin is M-stationary with a direction of descent.
#[test]
fn the_trap_of_leyffer_and_munson_is_left() {
    for start in [[0.0, 0.0], [1.0, 1.0], [0.0, 3.0], [2.0, 0.0]] {
        let p = problem(2, |x, o| o[0] = (x[0] - 1.0).powi(2) + x[1] * x[1] * (x[1] + 1.0), 0, |_, _| {});
        let (outcome, polish, x, f, nu) = solve_mpcc(p, &bounds(&[(0.0, INF); 2], &[]), &PAIR, &start);
        assert_eq!((outcome, polish), (Outcome::Solved, Polish::Done), "from {start:?}");
        assert!(near(&x, &[1.0, 0.0]) && f.abs() < 1e-9, "from {start:?}: {x:?}");
        assert!(nu[0].0.abs() < 1e-5, "x1 is free: {nu:?}");
    }
}

/// A bilevel problem after Bard with a complementarity of functions: the lower level is `min (y − x)²`, `0 ≤ y ≤ 1`.
#[test]
fn members_may_be_functions() {
    // x, y, m1, m2;   2 (y − x) − m1 + m2 = 0,  0 ≤ m1 ⊥ y ≥ 0,  0 ≤ m2 ⊥ 1 − y ≥ 0
    let p = problem(
        4,
        |x, o| o[0] = (x[0] - 2.0).powi(2) + (x[1] - 0.5).powi(2),
        2,
        |x, o| {
            o[0] = 2.0 * (x[1] - x[0]) - x[2] + x[3];
            o[1] = 1.0 - x[1];
        },
    );
    let b = bounds(&[(-INF, INF), (-INF, INF), (0.0, INF), (0.0, INF)], &[(0.0, 0.0), (0.0, INF)]);
    let pairs = [(Member::Variable(2), Member::Variable(1)), (Member::Variable(3), Member::Row(1))];
    let (outcome, polish, x, f, _) = solve_mpcc(p, &b, &pairs, &[0.5, 0.5, 0.1, 0.1]);
    // with y = 1: x = 2, f = 0.25; with y = x ≤ 1: the best is x = y = 1, f = 1.25
    assert_eq!((outcome, polish), (Outcome::Solved, Polish::Done));
    assert!(near(&x, &[2.0, 1.0, 0.0, 2.0]) && (f - 0.25).abs() < 1e-8, "{x:?} {f}");
}

#[test]
fn complementarity_without_a_feasible_point_is_not_called_solved() {
    let p = problem(
        2,
        |x, o| o[0] = x[0] + x[1],
        2,
        |x, o| {
            o[0] = x[0];
            o[1] = x[1];
        },
    );
    let b = bounds(&[(0.0, INF); 2], &[(1.0, INF); 2]);
    let (outcome, ..) = solve_mpcc(p, &b, &PAIR, &[1.0, 1.0]);
    assert!(matches!(outcome, Outcome::Infeasible | Outcome::Stalled), "{outcome:?}");
}

#[test]
fn pairs_that_make_no_sense_are_refused() {
    let p = || problem(2, |x, o| o[0] = x[0], 0, |_, _| {});
    assert!(Lifted::new(p(), &[(Member::Variable(0), Member::Variable(0))]).is_err());
    assert!(Lifted::new(p(), &[(Member::Variable(0), Member::Variable(5))]).is_err());
    assert!(Lifted::new(p(), &[(Member::Row(0), Member::Variable(1))]).is_err());
    let l = Lifted::new(p(), &PAIR).unwrap();
    assert!(l.bounds(&bounds(&[(0.0, -1.0), (0.0, INF)], &[])).is_err());
    assert!(l.bounds(&bounds(&[(1.0, 2.0), (0.0, INF)], &[])).is_err());
}
