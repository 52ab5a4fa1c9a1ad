//! Programs given as functions without derivatives. Most problems of the literature are in `textbook.rs`.

use std::sync::Arc;

use switchback_mpcc::func::{Callback, Dims, Function};
use switchback_mpcc::mpcc::{
    BStationarity, Boxed, Certificate, Change, Distance, Lifted, Member, MpccSettings, MpccSolver, NoProposals, Polish,
    Sides, Stationarity, Warm,
};
use switchback_mpcc::nlp::{
    Bounds, CallbackNlp, Control, Ipm, IpmSettings, Monotone, Nlp, Outcome, SecondOrder, Start,
};
use switchback_mpcc::settings::Portfolio;

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

/// Solves and compares point and objective.
fn expect(mut p: CallbackNlp, b: &Bounds, x0: &[f64], x: &[f64], f: f64) {
    let mut ipm = Ipm::new(&p, IpmSettings::default()).unwrap();
    // derivatives by differences twice over: the error cannot fall below their accuracy
    let mut rule = Monotone { mu_init: 0.1, tol: 1e-7, primal_tol: 1e-8 };
    let outcome = ipm.solve(&mut p, b, Start::Cold(x0), &mut rule, &mut Control::default());
    assert_eq!(outcome, Outcome::Solved);
    let found = &ipm.iterate().x;
    assert!(near(found, x), "{found:?}, expected {x:?}");
    assert!((ipm.objective() - f).abs() < 1e-6 * (1.0 + f.abs()), "f = {}, expected {f}", ipm.objective());
}

fn near(x: &[f64], y: &[f64]) -> bool {
    x.iter().zip(y).all(|(a, b)| (a - b).abs() < 1e-5)
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
    expect(p, &b, &[1.0, 5.0, 5.0, 1.0], &x, 17.0140172892);
}

#[test]
fn as_many_equations_as_variables_and_more() {
    let rows: Vector = |x, o| {
        o[0] = x[0] * x[0] + x[1] * x[1] - 5.0;
        o[1] = x[0] * x[1] - 2.0;
    };
    let b = bounds(&[(-INF, INF); 2], &[(0.0, 0.0); 2]);
    expect(problem(2, |_, o| o[0] = 0.0, 2, rows), &b, &[3.0, 0.5], &[2.0, 1.0], 0.0);
    let rows: Vector = |x, o| {
        o[0] = x[0] * x[0] + x[1] * x[1] - 5.0;
        o[1] = x[0] * x[1] - 2.0;
        o[2] = x[0] - 2.0 * x[1];
    };
    let b = bounds(&[(-INF, INF); 2], &[(0.0, 0.0); 3]);
    expect(problem(2, |_, o| o[0] = 0.0, 3, rows), &b, &[3.0, 0.5], &[2.0, 1.0], 0.0);
}

/// Solves a program without pairs, or certifies the point `x0` with the multipliers `y`, `z` where these are given.
fn certified(p: CallbackNlp, b: &Bounds, x0: &[f64], multipliers: Option<(&[f64], &[f64])>) -> Certificate {
    let mut lifted = Lifted::new(p, &[]).unwrap();
    let b = lifted.bounds(b).unwrap();
    let w0 = lifted.start(x0);
    let mut solver = MpccSolver::new(&mut lifted, MpccSettings { tol: 1e-7, ..MpccSettings::default() }).unwrap();
    let s = match multipliers {
        None => solver.solve(&mut lifted, &b, &w0, &mut Control::default()),
        Some((y, z)) => {
            let warm = Warm { x: &w0, y, z };
            solver.solve_warm(&mut lifted, &b, &warm, &mut Control::default(), &mut NoProposals)
        }
    };
    assert_eq!(s.outcome, Outcome::Solved);
    s.certificate
}

#[test]
fn answers_are_strict_minima_saddles_or_neither() {
    let free = [(-INF, INF); 2];
    let second = |f: Vector, x: &[(f64, f64)], x0: &[f64]| {
        let c = certified(problem(2, f, 0, |_, _| {}), &bounds(x, &[]), x0, None);
        assert_eq!((c.stationarity, c.b, c.sharp, c.dependent), (Stationarity::S, BStationarity::Yes, true, 0));
        c.second
    };
    assert_eq!(
        second(|x, o| o[0] = x[0] * x[0] + (x[1] - 1.0).powi(2), &free, &[3.0, 2.0]),
        SecondOrder::StrictMinimum
    );
    // a line of minima
    assert_eq!(second(|x, o| o[0] = x[0] * x[0], &free, &[3.0, 2.0]), SecondOrder::Undecided);
    // negative curvature where a bound with a multiplier holds the variable: a strict minimum
    let cut = [(-INF, INF), (-1.0, 1.0)];
    assert_eq!(second(|x, o| o[0] = x[0] * x[0] - x[1] * x[1] - x[1], &cut, &[0.5, 0.5]), SecondOrder::StrictMinimum);
    // a bound without a multiplier is no help: the curvature is that of the whole line
    let half = [(-INF, INF), (0.0, INF)];
    assert_eq!(second(|x, o| o[0] = x[0] * x[0] + x[1] * x[1], &half, &[0.5, 0.5]), SecondOrder::StrictMinimum);

    let at = |p: CallbackNlp, b: &Bounds, x: &[f64], y: &[f64]| certified(p, b, x, Some((y, &[0.0; 2])));
    let hill: Vector = |x, o| o[0] = x[0] * x[0] - 0.5 * x[1] * x[1];
    let c = at(problem(2, hill, 0, |_, _| {}), &bounds(&free, &[]), &[0.0, 0.0], &[]);
    assert_eq!(c.second, SecondOrder::Saddle);
    // on a circle the same function has its minima at (0, ±1), and maxima at (±1, 0)
    let circle: Vector = |x, o| o[0] = x[0] * x[0] + x[1] * x[1];
    let one = bounds(&free, &[(1.0, 1.0)]);
    let c = at(problem(2, hill, 1, circle), &one, &[0.0, 1.0], &[0.5]);
    assert_eq!((c.second, c.dependent), (SecondOrder::StrictMinimum, 0));
    let c = at(problem(2, hill, 1, circle), &one, &[1.0, 0.0], &[-1.0]);
    assert_eq!((c.second, c.dependent), (SecondOrder::Saddle, 0));
    // the same row twice: a minimum is one all the same, but no saddle is claimed without independent gradients
    let twice: Vector = |x, o| (o[0], o[1]) = (x[0] * x[0] + x[1] * x[1], 2.0 * (x[0] * x[0] + x[1] * x[1]));
    let both = bounds(&free, &[(1.0, 1.0), (2.0, 2.0)]);
    let c = at(problem(2, hill, 2, twice), &both, &[0.0, 1.0], &[0.5, 0.0]);
    assert_eq!((c.second, c.dependent), (SecondOrder::StrictMinimum, 1));
    let c = at(problem(2, hill, 2, twice), &both, &[1.0, 0.0], &[-1.0, 0.0]);
    assert_eq!((c.second, c.dependent), (SecondOrder::Undecided, 1));
}

/// `x² = 0` has the one feasible point 0, where `x + y²` has no multipliers. Next to it they exist, the larger the closer, and so small a
/// violation times them is what a step could gain: nothing is claimed.
#[test]
fn multipliers_that_dwarf_the_gradient_show_nothing() {
    let line: Vector = |x, o| o[0] = x[0] + x[1] * x[1];
    let square: Vector = |x, o| o[0] = x[0] * x[0];
    let free = [(-INF, INF); 2];
    for x in [1e-4, 1e-5, 1e-6] {
        let y = -0.5 / x;
        let p = problem(2, line, 1, square);
        let c = certified(p, &bounds(&free, &[(0.0, 0.0)]), &[x, 0.0], Some((&[y], &[0.0; 2])));
        assert_eq!(c.stationarity, Stationarity::Unknown, "{x}: {c:?}");
    }
}

/// `min (x0 − a)² + (x1 − b)²`, `0 ≤ x0 ⊥ x1 ≥ 0`: with `a, b < 0` both multipliers are positive, at `a = b = 0` none is.
#[test]
fn strongly_stationary_points_have_conditions_of_second_order() {
    let second = |f: Vector| {
        let mut lifted =
            Lifted::new(problem(2, f, 0, |_, _| {}), &[(Member::Variable(0), Member::Variable(1))]).unwrap();
        let b = lifted.bounds(&bounds(&[(0.0, INF); 2], &[])).unwrap();
        let w0 = lifted.start(&[1.0, 0.5]);
        let mut solver = MpccSolver::new(&mut lifted, MpccSettings { tol: 1e-8, ..MpccSettings::default() }).unwrap();
        let s = solver.solve(&mut lifted, &b, &w0, &mut Control::default());
        assert_eq!((s.outcome, s.certificate.stationarity), (Outcome::Solved, Stationarity::S));
        s.certificate.second
    };
    assert_eq!(second(|x, o| o[0] = (x[0] + 1.0).powi(2) + (x[1] + 2.0).powi(2)), SecondOrder::StrictMinimum);
    assert_eq!(second(|x, o| o[0] = (x[0] - 1.0).powi(2) + (x[1] + 2.0).powi(2)), SecondOrder::StrictMinimum);
    // flat along the member that may be positive
    assert_eq!(second(|x, o| o[0] = 1.0 + x[1] + 0.0 * x[0]), SecondOrder::Undecided);
}

/// A bilevel problem after Bard with a complementarity of functions: the lower level is `min (y − x)²`, `0 ≤ y ≤ 1`.
/// The whole solver on a program without pairs.
fn solved(p: CallbackNlp, b: &Bounds, x0: &[f64]) -> switchback_mpcc::mpcc::Solution {
    let mut p = Lifted::new(p, &[]).unwrap();
    let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
    solver.solve(&mut p, b, x0, &mut Control::default()).clone()
}

/// Where the barrier method has no answer the linear rows are asked.
#[test]
fn linear_rows_show_that_there_is_no_optimum() {
    // nothing is free: there is no step that could lower a violation
    let fixed = problem(1, |x, o| o[0] = x[0], 1, |x, o| o[0] = x[0] - 3.0);
    assert_eq!(solved(fixed, &bounds(&[(2.0, 2.0)], &[(0.0, INF)]), &[2.0]).outcome, Outcome::Infeasible);
    // x + y >= 3, x + y <= 1, x - 2 y = z
    let rows: Vector = |x, o| o.copy_from_slice(&[x[0] + x[1], x[0] + x[1], x[0] - 2.0 * x[1] - x[2]]);
    let b = bounds(&[(-INF, INF), (0.0, INF), (-INF, INF)], &[(3.0, INF), (-INF, 1.0), (0.0, 0.0)]);
    let s = solved(problem(3, |x, o| o[0] = x[0].powi(2), 3, rows), &b, &[0.0, 1.0, 0.0]);
    assert_eq!(s.outcome, Outcome::Infeasible);
    let total = s.x[0] + s.x[1];
    assert!((1.0 - 1e-6..=3.0 + 1e-6).contains(&total), "{:?}", s.x);

    // x falls along the edge of a cone; a bound stops it
    let cone: Vector = |x, o| o.copy_from_slice(&[x[0] - x[1], x[0] + 2.0 * x[1]]);
    let fall = |low: f64| {
        let b = bounds(&[(low, INF), (-INF, 9.0)], &[(-INF, 1.0), (-INF, 0.0)]);
        solved(problem(2, |x, o| o[0] = x[0] + 0.1 * x[1], 2, cone), &b, &[-1.0, 0.0])
    };
    assert_eq!(fall(-INF).outcome, Outcome::Diverging);
    let s = fall(-5.0);
    assert!(s.outcome == Outcome::Solved && near(&s.x, &[-5.0, -6.0]), "{:?} {:?}", s.outcome, s.x);
}

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
    let mut lifted = Lifted::new(p, &pairs).unwrap();
    let b = lifted.bounds(&b).unwrap();
    let w0 = lifted.start(&[0.5, 0.5, 0.1, 0.1]);
    let settings = MpccSettings { tol: 1e-8, polish_tol: 1e-10, ..MpccSettings::default() };
    let mut solver = MpccSolver::new(&mut lifted, settings).unwrap();
    let s = solver.solve(&mut lifted, &b, &w0, &mut Control::default());
    // with y = 1: x = 2, f = 0.25; with y = x ≤ 1: the best is x = y = 1, f = 1.25
    assert_eq!((s.outcome, s.polish), (Outcome::Solved, Polish::Done));
    assert!(near(&s.x[..4], &[2.0, 1.0, 0.0, 2.0]) && (s.objective - 0.25).abs() < 1e-8, "{:?} {}", s.x, s.objective);
}

/// A multiplier that appears in nothing but its own pair, whose function is zero at the minimum: far out on its ray the rounding of the
/// function makes the product of the two larger than any tolerance.
#[test]
fn what_nothing_holds_is_drawn_back() {
    let slack: Vector = |x, o| o[0] = 0.1 * x[0] - 0.3;
    let free: Vector = |x, o| o[0] = (x[0] - 1.0).powi(2) + 0.0 * x[1];
    let held: Vector = |x, o| o[0] = (x[0] - 1.0).powi(2) + (1e-12 * x[1] - 1.0).powi(2);
    for (objective, least, most) in [(free, 0.0, 1e6), (held, 0.99e12, 1.01e12)] {
        let pair = [(Member::Variable(1), Member::Row(0))];
        let mut p = Lifted::new(problem(2, objective, 1, slack), &pair).unwrap();
        let b = p.bounds(&bounds(&[(-INF, INF), (0.0, INF)], &[(0.0, INF)])).unwrap();
        let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
        let warm = Warm { x: &[3.0, 1e12, 0.0], y: &[0.0], z: &[0.0; 3] };
        let s = solver.solve_warm(&mut p, &b, &warm, &mut Control::default(), &mut NoProposals);
        assert_eq!((s.outcome, s.polish), (Outcome::Solved, Polish::Done));
        assert!((s.x[0] - 3.0).abs() < 1e-9 && (least..most).contains(&s.x[1]), "{:?}", s.x);
    }
}

#[test]
fn pairs_that_make_no_sense_are_refused() {
    let pair = [(Member::Variable(0), Member::Variable(1))];
    let p = || problem(2, |x, o| o[0] = x[0], 0, |_, _| {});
    assert!(Lifted::new(p(), &[(Member::Variable(0), Member::Variable(0))]).is_err());
    assert!(Lifted::new(p(), &[(Member::Variable(0), Member::Variable(5))]).is_err());
    assert!(Lifted::new(p(), &[(Member::Row(0), Member::Variable(1))]).is_err());
    let mut l = Lifted::new(p(), &pair).unwrap();
    assert!(l.bounds(&bounds(&[(0.0, -1.0), (0.0, INF)], &[])).is_err());
    assert!(l.bounds(&bounds(&[(1.0, 2.0), (0.0, INF)], &[])).is_err());
}

/// Differences of what a problem says of itself: of values against gradient and Jacobian, of those against the Hessian.
fn deviation(p: &mut dyn Nlp, x: &[f64], y: &[f64]) -> f64 {
    const STEP: f64 = 1e-5;
    let (n, m) = (p.n(), p.m());
    let (jac, hess) = (p.jac_pattern().clone(), p.hess_pattern().clone());
    let (mut grad, mut values, mut second) = (vec![0.0; n], vec![0.0; jac.nnz()], vec![0.0; hess.nnz()]);
    p.derivatives(x, &mut grad, &mut values).unwrap();
    p.hessian(x, 1.0, y, &mut second).unwrap();
    let at = |p: &mut dyn Nlp, j: usize, step: f64| {
        let mut z = x.to_vec();
        z[j] += step;
        let (mut c, mut g, mut v) = (vec![0.0; m], vec![0.0; n], vec![0.0; jac.nnz()]);
        let f = p.eval(&z, &mut c).unwrap();
        p.derivatives(&z, &mut g, &mut v).unwrap();
        // the gradient of the Lagrangian
        for (k, g) in g.iter_mut().enumerate() {
            *g += jac.range(k).map(|e| v[e] * y[jac.row_idx()[e]]).sum::<f64>();
        }
        (f, c, g)
    };
    let slope = |a: f64, b: f64, given: f64| ((a - b) / (2.0 * STEP) - given).abs();
    let mut worst: f64 = 0.0;
    for (j, given) in grad.iter().enumerate() {
        let (plus, minus) = (at(p, j, STEP), at(p, j, -STEP));
        worst = worst.max(slope(plus.0, minus.0, *given));
        let mut column = vec![0.0; m];
        jac.range(j).for_each(|e| column[jac.row_idx()[e]] = values[e]);
        for (i, given) in column.iter().enumerate() {
            worst = worst.max(slope(plus.1[i], minus.1[i], *given));
        }
        let mut of_hess = vec![0.0; n];
        hess.range(j).for_each(|e| of_hess[hess.row_idx()[e]] = second[e]);
        for (i, given) in of_hess.iter().enumerate().take(j + 1) {
            worst = worst.max(slope(plus.2[i], minus.2[i], *given));
        }
    }
    worst
}

/// `x0` between two bounds, `x1` below one, `x2` above one and in a second box, `x3` free: members and derivatives of what boxes
/// become, and the way back.
#[test]
fn boxes_become_pairs_of_distances() {
    let rows: Vector = |x, o| {
        o[0] = x[0] * x[1] - 1.0;
        o[1] = x[1] * x[1] + x[2];
        o[2] = x[0] - x[2] * x[3];
        o[3] = x[3] + x[0];
        o[4] = x[2].sin();
    };
    let p = problem(4, |x, o| o[0] = x[0] * x[0] * x[1] + x[3] * x[2], 5, rows);
    let mut b = bounds(&[(1.0, 3.0), (-INF, 2.0), (-1.0, INF), (-INF, INF)], &[(-7.0, -6.0); 5]);
    let mut members = Vec::new();
    for (j, i) in [(0, 0), (1, 1), (2, 2), (3, 3), (2, 4)] {
        Boxed::new(j, i).write(&mut b, &mut members).unwrap();
    }
    assert!(Boxed::new(4, 0).write(&mut b, &mut Vec::new()).is_err());
    assert!(Boxed::new(0, 5).write(&mut b, &mut Vec::new()).is_err());
    let mut lifted = Lifted::new(p, &members).unwrap();
    let lifted_bounds = lifted.bounds(&b).unwrap();
    let x = [1.5, -0.5, 0.25, 0.75];
    let w = lifted.start(&x);
    assert_eq!(lifted.point(&w), x);
    // distances and parts of the rows: (x0 - 1, p0), (3 - x0, q0), (2 - x1, -c1), (x2 + 1, c2), (x2 + 1, c4)
    let expected = [(0.5, 0.0), (1.5, 1.75), (2.5, 0.0), (1.25, 1.3125), (1.25, 0.25f64.sin())];
    for (k, (a, b)) in expected.into_iter().enumerate() {
        let (g, h) = lifted.pair(k);
        assert!((w[g] - a).abs() < 1e-14 && (w[h] - b).abs() < 1e-14, "{k}: {} {}", w[g], w[h]);
    }
    let mut c = vec![0.0; lifted.m()];
    lifted.eval(&w, &mut c).unwrap();
    // rows of members hold at the start where their part is right; the free variable has its equation
    for (i, residual) in [0.0, 0.5, 0.0, 2.25, 0.0, 0.0, 0.0, 0.0].into_iter().enumerate() {
        assert_eq!(lifted_bounds.cl[i], lifted_bounds.cu[i]);
        assert!((c[i] - lifted_bounds.cl[i] - residual).abs() < 1e-14, "{i}: {}", c[i]);
    }
    let y: Vec<f64> = (0..lifted.m()).map(|i| 0.7 - 0.3 * i as f64).collect();
    assert!(deviation(&mut lifted, &w, &y) < 1e-5);
    // multipliers there and back
    let (own_y, own_z) = ([0.3, -0.2, 0.1, 0.5, -0.4], [0.6, -0.7, 0.8, 0.0]);
    let (at, to_y, to_z) = lifted.warm(&x, &own_y, &own_z);
    assert_eq!((at, &to_y[..5]), (w, &own_y[..]));
    assert_eq!(lifted.bound_multipliers(&to_z), own_z);
}

/// Random numbers in `[-1, 1)`, always the same ones of a seed.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

const N: usize = 6;

/// A program of random coefficients with pairs of functions, its objective and rows multiplied by `2^k[i]`, its variables by `sizes`.
fn in_units(seed: u64, k: &[i32; 11], sizes: [f64; N]) -> (Lifted<CallbackNlp>, Bounds) {
    let mut random = numbers(seed);
    let a: Vec<f64> = (0..11 * N).map(|_| random()).collect();
    let b: Vec<f64> = (0..11).map(|_| random()).collect();
    let unit = k.map(|k| f64::from(k).exp2());
    let (a, b) = (Arc::new(a), Arc::new(b));
    let d = Dims { x: N, u: 0, p: 0 };
    let row = move |i: usize, x: &[f64]| {
        let a = &a[i * N..(i + 1) * N];
        let x: Vec<f64> = x.iter().zip(&sizes).map(|(x, s)| x / s).collect();
        let along: f64 = a.iter().zip(&x).map(|(a, x)| a * x).sum();
        let square: f64 = x.iter().enumerate().map(|(j, x)| (1.5 + a[j] + (j == i) as i32 as f64) * x * x).sum();
        (along, square, b[i])
    };
    let of = row.clone();
    let f = Callback::new("f", d, 1, move |at, o| {
        let (along, square, _) = of(0, at.x);
        o[0] = unit[0] * (3.0 * along + square);
        0
    });
    let c = Callback::new("c", d, 10, move |at, o| {
        for (i, o) in o.iter_mut().enumerate() {
            let (along, square, b) = row(i + 1, at.x);
            *o = unit[i + 1] * (2.0 * along + 0.1 * square + b);
        }
        0
    });
    let inner = CallbackNlp::new(N, 0, Arc::new(f), Some(Arc::new(c))).unwrap();
    let members: Vec<_> = (0..4).map(|i| (Member::Row(i), Member::Row(4 + i))).collect();
    let mut lifted = Lifted::new(inner, &members).unwrap();
    // rows 8 and 9 are ordinary ones
    let mut bounds = Bounds::free(N, 10);
    (bounds.cu[8], bounds.cl[9]) = (2.0 * unit[9], -3.0 * unit[10]);
    let bounds = lifted.bounds(&bounds).unwrap();
    (lifted, bounds)
}

/// Whatever units objective, rows and functions in pairs are in: the same iterates to the last bit, and multipliers in those units.
#[test]
fn programs_in_other_units_have_the_same_iterates() {
    let mut solved = 0;
    for seed in 1..=12 {
        let mut random = numbers(100 + seed);
        let solve_by = |k: &[i32; 11], portfolio: Portfolio| {
            let (mut p, b) = in_units(seed, k, [1.0; N]);
            let settings = MpccSettings { portfolio, ..MpccSettings::default() };
            let mut solver = MpccSolver::new(&mut p, settings).unwrap();
            let x0 = p.start(&[0.3; 6]);
            solver.solve(&mut p, &b, &x0, &mut Control::default()).clone()
        };
        let solve = |k: &[i32; 11]| solve_by(k, MpccSettings::default().portfolio);
        let own = solve(&[0; 11]);
        let by_path = solve_by(&[0; 11], Portfolio::Off).outcome == Outcome::Solved;
        solved += (own.outcome == Outcome::Solved) as usize;
        for _ in 0..2 {
            let k = [(); 11].map(|()| (20.0 * random()) as i32);
            let other = solve(&k);
            let unit = k.map(|k| f64::from(k).exp2());
            assert_eq!(other.outcome, own.outcome, "{seed} {k:?}");
            // whether a point is a solution is judged in the units given, and so how long one is looked for where the path has none
            if by_path {
                assert_eq!(other.stats.iterations, own.stats.iterations, "{seed} {k:?}");
            }
            assert_eq!(other.found_by, own.found_by, "{seed} {k:?}");
            assert_eq!(other.x[..6], own.x[..6], "{seed} {k:?}");
            for (i, v) in (6..14).map(|j| (j, other.x[j] / own.x[j])).filter(|v| own.x[v.0] != 0.0) {
                // pairs take turns in the lifted variables: first member, second member
                let row = 4 * ((i - 6) % 2) + (i - 6) / 2;
                assert_eq!(v, unit[1 + row], "{seed} {k:?}");
            }
            // those of the least violation know nothing of the objective
            let of =
                if matches!(own.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible) { 1.0 } else { unit[0] };
            let y = other.y.iter().zip(&unit[1..]).map(|(y, u)| y * u / of);
            assert!(y.eq(own.y.iter().copied()), "{seed} {k:?}: {:?} {:?}", other.y, own.y);
            assert_eq!(other.certificate.b, own.certificate.b, "{seed} {k:?}");
        }
    }
    assert!(solved >= 10, "{solved}");
}

/// Whatever units variables are in, up to a factor of a million between them: the same answers, in about as many iterations.
#[test]
fn variables_in_other_units_lead_to_the_same_answers() {
    let mut iterations = [0; 2];
    // the sixth has no answer that is found
    for seed in (1..=12).filter(|s| *s != 6) {
        let mut random = numbers(200 + seed);
        let [own, other] = [0.0, 3.5].map(|largest| {
            let sizes = [(); N].map(|()| 10f64.powf((largest * random()).trunc()));
            let (mut p, b) = in_units(seed, &[0; 11], sizes);
            let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
            let x0 = p.start(&sizes.map(|s| 0.3 * s));
            solver.solve(&mut p, &b, &x0, &mut Control::default()).clone()
        });
        iterations[0] += own.stats.iterations;
        iterations[1] += other.stats.iterations;
        assert_eq!((own.outcome, other.outcome), (Outcome::Solved, Outcome::Solved), "{seed}");
        assert!((own.objective - other.objective).abs() < 1e-5, "{seed}: {} {}", own.objective, other.objective);
    }
    assert!(2 * iterations[1] < 3 * iterations[0], "{iterations:?}");
}

/// Two minima, at 1e-3 next to the bound and at 1, with a hill at 5e-3 between them. From the first one a solve that is told so stays;
/// one that is not begins beyond the hill, well inside of the bounds.
#[test]
fn a_branch_solved_from_its_solution_stays_there() {
    let f: Vector = |x, o| {
        let x = x[0];
        o[0] = 1e4 * (x.powi(4) / 4.0 - 1.006 * x.powi(3) / 3.0 + 6.005e-3 * x * x / 2.0 - 5e-6 * x);
    };
    for (distance, at) in [(Distance::Close, 1e-3), (Distance::Far, 1.0)] {
        let mut p = Lifted::new(problem(1, f, 0, |_, _| {}), &[]).unwrap();
        let b = p.bounds(&bounds(&[(0.0, INF)], &[])).unwrap();
        let settings = MpccSettings { tol: 1e-7, polish_tol: 1e-8, ..MpccSettings::default() };
        let mut solver = MpccSolver::new(&mut p, settings).unwrap();
        let control = &mut Control::default();
        assert!(solver.solve_sides(&mut p, &b, &[], (&[1e-3], distance), control, &mut NoProposals), "{distance:?}");
        let x = solver.solution().x[0];
        assert!((x - at).abs() < 1e-4 * at, "{distance:?}: {x}");
    }
    // the same of a program of which no branch is given
    let mut p = Lifted::new(problem(1, f, 0, |_, _| {}), &[]).unwrap();
    let b = p.bounds(&bounds(&[(0.0, INF)], &[])).unwrap();
    let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
    let control = &mut Control::default();
    let close = solver.solve_close(&mut p, &b, &[1e-3], control).x[0];
    let usual = solver.solve(&mut p, &b, &[1e-3], control).x[0];
    assert!((close - 1e-3).abs() < 1e-7 && (usual - 1.0).abs() < 1e-4, "{close}, {usual}");
}

/// The adjoint of the map from data to solution, against that map: with a value that is fixed, changes of gradient and rows, and a
/// pair. Where a bound is active without a multiplier there is none.
#[test]
fn adjoints_are_the_transposes_of_tangents() {
    let objective: Vector =
        |x, o| o[0] = (x[0] - 3.0).powi(2) + x[0] * x[1] + (x[2] - 1.0).powi(2) + x[3] * x[0] + x[1] * x[1];
    let rows: Vector = |x, o| o[0] = x[0] + x[2] * x[2] + 0.5 * x[3] - 4.0;
    let pair = [(Member::Variable(0), Member::Variable(1))];
    let mut p = Lifted::new(problem(4, objective, 1, rows), &pair).unwrap();
    let free = (-INF, INF);
    let b = p.bounds(&bounds(&[(0.0, INF), (0.0, INF), free, (0.3, 0.3)], &[(0.0, 0.0)])).unwrap();
    let w0 = p.start(&[1.0, 0.1, 1.0, 0.3]);
    let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
    let s = solver.solve(&mut p, &b, &w0, &mut Control::default());
    assert_eq!((s.outcome, s.polish), (Outcome::Solved, Polish::Done));
    let changes = [
        Change { fixed: vec![(3, 1.0)], ..Change::default() },
        Change { gradient: vec![(0, 0.7), (2, -0.2), (1, 5.0)], ..Change::default() },
        Change { fixed: vec![(3, -0.5)], gradient: vec![(2, 1.0)], rows: vec![(0, 0.4)] },
    ];
    let weights = vec![vec![0.3, -0.8, 1.1, 0.6], vec![1.0, 0.0, 0.0, 0.0]];
    let tangents = solver.tangents(&mut p, &b, &changes).unwrap();
    let adjoints = solver.adjoints(&mut p, &b, &weights).unwrap().unwrap();
    for (w, a) in weights.iter().zip(&adjoints) {
        for (c, t) in changes.iter().zip(&tangents) {
            assert_eq!((t.sides, t.one_sided), (Sides::Both, false));
            let forwards: f64 = w.iter().zip(&t.x).map(|(w, x)| w * x).sum();
            let sum = |list: &[(usize, f64)], with: &[f64]| list.iter().map(|(i, v)| v * with[*i]).sum::<f64>();
            let backwards = sum(&c.fixed, &a.fixed) + sum(&c.gradient, &a.gradient) + sum(&c.rows, &a.rows);
            assert!((forwards - backwards).abs() < 1e-9, "{forwards} {backwards}");
        }
    }
    assert!(solver.adjoints(&mut p, &b, &[vec![0.0; 3]]).is_err());
    assert!(solver.adjoints(&mut p, &b, &[vec![f64::NAN; 4]]).is_err());

    // the minimiser is at the bound by itself
    let mut p = Lifted::new(problem(1, |x, o| o[0] = x[0] * x[0], 0, |_, _| {}), &[]).unwrap();
    let b = p.bounds(&bounds(&[(0.0, INF)], &[])).unwrap();
    let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
    assert_eq!(solver.solve(&mut p, &b, &[1.0], &mut Control::default()).outcome, Outcome::Solved);
    assert!(solver.adjoints(&mut p, &b, &[vec![1.0]]).unwrap().is_none());
    let push = [Change { gradient: vec![(0, -2.0)], ..Change::default() }];
    let t = solver.tangents(&mut p, &b, &push).unwrap().remove(0);
    match t.sides {
        Sides::Rising => assert!((t.x[0] - 1.0).abs() < 1e-6),
        Sides::Falling => assert!(t.x[0].abs() < 1e-9),
        other => panic!("{other:?}"),
    }
}
