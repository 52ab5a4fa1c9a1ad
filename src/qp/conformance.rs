//! One suite for all methods: conditions of optimality of the program with its states, evaluated here and not by the methods.

use super::*;

pub(super) fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed;
    move || {
        s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (s >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }
}

/// What the suite varies.
#[derive(Clone, Copy, Default)]
pub(super) struct Kind {
    pub rows: usize,
    pub price: Option<Price>,
    pub tight: f64,
    pub duplicates: bool,
}

/// A random program: stable-ish dynamics, definite Hessians, bounds that bind more the smaller `tight` is.
pub(super) fn random(seed: u64, [n, nx, nu]: [usize; 3], kind: Kind) -> (StageQp, Vec<f64>) {
    let mut r = numbers(seed);
    let mut rows = Vec::new();
    for node in 1..=n {
        rows.extend((0..kind.rows).map(|_| Row { node, price: kind.price }));
    }
    let mut qp = StageQp::new(n, nx, nu, rows).unwrap();
    for k in 0..n {
        let m = nx + nu;
        let g: Vec<f64> = (0..m * m).map(|_| r()).collect();
        let h = |i: usize, j: usize| {
            (0..m).map(|l| g[i * m + l] * g[j * m + l]).sum::<f64>() + if i == j { 0.2 } else { 0.0 }
        };
        for j in 0..nx {
            (0..nx).for_each(|i| qp.hess_x[k * nx * nx + i + j * nx] = h(i, j));
            (0..nu).for_each(|i| qp.hess_xu[k * nu * nx + i + j * nu] = h(nx + i, j));
        }
        for j in 0..nu {
            (0..nu).for_each(|i| qp.hess_u[k * nu * nu + i + j * nu] = h(nx + i, nx + j));
        }
    }
    (0..nx).for_each(|i| qp.hess_x[n * nx * nx + i + i * nx] = 2.0);
    for v in [&mut qp.grad_x, &mut qp.grad_u, &mut qp.c, &mut qp.b] {
        v.iter_mut().for_each(|v| *v = r());
    }
    for k in 0..n {
        for j in 0..nx {
            for i in 0..nx {
                qp.a[k * nx * nx + i + j * nx] = 0.4 * r() + if i == j { 0.8 } else { 0.0 };
            }
        }
    }
    for (l, u) in qp.u_lower.iter_mut().zip(&mut qp.u_upper) {
        (*l, *u) = (-kind.tight * (1.0 + r().abs()), kind.tight * (1.0 + r().abs()));
    }
    for i in 0..qp.rows.len() {
        (0..nx).for_each(|j| qp.row_x[i * nx + j] = r());
        if qp.rows[i].node < n {
            (0..nu).for_each(|j| qp.row_u[i * nu + j] = r());
        }
        // hard rows that some of the programs cannot meet
        let width = if kind.price.is_none() { 1.0 } else { 2.0 };
        (qp.row_lower[i], qp.row_upper[i]) = (-width - r().abs(), width + r().abs());
        if kind.duplicates && i % 2 == 1 && qp.rows[i].node == qp.rows[i - 1].node {
            qp.row_x.copy_within((i - 1) * nx..i * nx, i * nx);
            qp.row_u.copy_within((i - 1) * nu..i * nu, i * nu);
            (qp.row_lower[i], qp.row_upper[i]) = (qp.row_lower[i - 1], qp.row_upper[i - 1]);
        }
    }
    let x0 = (0..nx).map(|_| 2.0 * r()).collect();
    (qp, x0)
}

/// The largest violation of the optimality conditions, relative to the sizes of what is compared. States are those of
/// the dynamics by themselves; `λ` must make the derivatives by the states zero, `μ` those by the controls.
pub(super) fn residual(qp: &StageQp, x0: &[f64], s: &QpSolution) -> f64 {
    let (n, nx, nu) = (qp.n, qp.nx, qp.nu);
    let mut worst = 0.0f64;
    let mut see = |v: f64, size: f64| worst = worst.max(v.abs() / (1.0 + size));
    match &qp.initial {
        Initial::Given => (0..nx).for_each(|i| see(s.x[i] - x0[i], x0[i].abs())),
        // W (x_0 − x̄) + λ_0 = 0
        Initial::Free(weight) => (0..nx).for_each(|i| {
            let pull: f64 = (0..nx).map(|j| weight[i + j * nx] * (s.x[j] - x0[j])).sum();
            see(pull + s.lambda[i], pull.abs());
        }),
    }
    for k in 0..n {
        for i in 0..nx {
            let mut next = qp.c[k * nx + i] - s.x[(k + 1) * nx + i];
            next += (0..nx).map(|j| qp.a[k * nx * nx + i + j * nx] * s.x[k * nx + j]).sum::<f64>();
            next += (0..nu).map(|j| qp.b[k * nx * nu + i + j * nx] * s.u[k * nu + j]).sum::<f64>();
            see(next, s.x[(k + 1) * nx + i].abs());
        }
    }
    for k in 0..=n {
        for i in 0..nx {
            let mut d = qp.grad_x[k * nx + i] - s.lambda[k * nx + i];
            let size = d.abs() + s.lambda[k * nx + i].abs();
            d += (0..nx).map(|j| qp.hess_x[k * nx * nx + i + j * nx] * s.x[k * nx + j]).sum::<f64>();
            if k < n {
                d += (0..nu).map(|j| qp.hess_xu[k * nu * nx + j + i * nu] * s.u[k * nu + j]).sum::<f64>();
                d += (0..nx).map(|j| qp.a[k * nx * nx + j + i * nx] * s.lambda[(k + 1) * nx + j]).sum::<f64>();
            }
            d += (0..qp.rows.len())
                .filter(|r| qp.rows[*r].node == k)
                .map(|r| qp.row_x[r * nx + i] * s.row_mu[r])
                .sum::<f64>();
            see(d, size);
        }
    }
    for k in 0..n {
        for i in 0..nu {
            let mut d = qp.grad_u[k * nu + i] + s.u_mu[k * nu + i];
            let size = d.abs() + s.u_mu[k * nu + i].abs();
            d += (0..nx).map(|j| qp.hess_xu[k * nu * nx + i + j * nu] * s.x[k * nx + j]).sum::<f64>();
            d += (0..nu).map(|j| qp.hess_u[k * nu * nu + i + j * nu] * s.u[k * nu + j]).sum::<f64>();
            d += (0..nx).map(|j| qp.b[k * nx * nu + j + i * nx] * s.lambda[(k + 1) * nx + j]).sum::<f64>();
            d += (0..qp.rows.len())
                .filter(|r| qp.rows[*r].node == k)
                .map(|r| qp.row_u[r * nu + i] * s.row_mu[r])
                .sum::<f64>();
            see(d, size);
            bound(&mut see, s.u[k * nu + i], qp.u_lower[k * nu + i], qp.u_upper[k * nu + i], s.u_mu[k * nu + i], None);
        }
    }
    for (r, row) in qp.rows.iter().enumerate() {
        let k = row.node;
        let mut v: f64 = (0..nx).map(|j| qp.row_x[r * nx + j] * s.x[k * nx + j]).sum();
        if k < n {
            v += (0..nu).map(|j| qp.row_u[r * nu + j] * s.u[k * nu + j]).sum::<f64>();
        }
        bound(&mut see, v, qp.row_lower[r], qp.row_upper[r], s.row_mu[r], row.price);
    }
    worst
}

/// `l ≤ v ≤ u` with the multiplier `μ`, whose size is the derivative of the price where the bound is violated.
fn bound(see: &mut dyn FnMut(f64, f64), v: f64, l: f64, u: f64, mu: f64, price: Option<Price>) {
    let beyond = (v - u).max(l - v);
    match price {
        None => see(beyond.max(0.0), v.abs()),
        Some(p) => {
            let slack = beyond.max(0.0);
            let most = p.linear + 2.0 * p.quadratic * slack;
            see((mu.abs() - most).max(0.0), most);
            if slack > 1e-9 * (1.0 + v.abs()) {
                see(mu.abs() - most, most);
            }
        }
    }
    // the multiplier belongs to the side that is met
    if mu > 0.0 {
        see((u - v).max(0.0).min(mu), 0.0);
    } else if mu < 0.0 {
        see((v - l).max(0.0).min(-mu), 0.0);
    }
}

const SIZES: [[usize; 3]; 6] = [[1, 1, 1], [3, 2, 1], [8, 4, 1], [10, 5, 3], [25, 6, 2], [12, 21, 3]];

fn kinds() -> Vec<Kind> {
    let price = |linear, quadratic| Some(Price { linear, quadratic });
    let mut all = vec![Kind { tight: 0.3, ..Kind::default() }, Kind { tight: 5.0, ..Kind::default() }];
    for p in [price(1.0, 0.0), price(0.0, 3.0), price(0.5, 2.0), price(50.0, 1.0)] {
        for duplicates in [false, true] {
            all.push(Kind { rows: 3, price: p, tight: 1.0, duplicates });
            all.push(Kind { rows: 3, price: p, tight: 0.2, duplicates });
        }
    }
    all
}

/// The suite.
pub(super) fn conforms(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>, tol: f64) {
    let terms = Terms::default();
    for (i, size) in SIZES.into_iter().enumerate() {
        for (j, kind) in kinds().into_iter().enumerate() {
            let seed = (100 * i + j) as u64;
            let (mut qp, x0) = random(seed, size, kind);
            let mut solver = make(&qp);
            assert!(solver.prepare(&qp));
            let mut s = QpSolution::new(&qp);
            let mut r = numbers(seed + 7);
            let mut x = x0.clone();
            for round in 0..4 {
                assert_eq!(solver.solve(&qp, &x, &terms), QpStatus::Solved, "{} {size:?} {j} {round}", solver.name());
                solver.expand(&qp, &mut s);
                let e = residual(&qp, &x, &s);
                assert!(e < tol, "{} {size:?} {j} {round}: {e:e}", solver.name());
                assert_eq!(s.u, solver.controls());
                // other initial states, then other vectors, then other matrices, all warm
                x.iter_mut().for_each(|v| *v += 0.5 * r());
                match round {
                    1 => {
                        qp.grad_u.iter_mut().for_each(|v| *v += 0.1 * r());
                        qp.c.iter_mut().for_each(|v| *v += 0.1 * r());
                        qp.u_upper.iter_mut().for_each(|v| *v *= 0.9);
                        solver.refresh(&qp);
                    }
                    2 => {
                        qp.a.iter_mut().for_each(|v| *v += 0.05 * r());
                        solver.shift(&qp);
                        assert!(solver.prepare(&qp));
                    }
                    _ => {}
                }
            }
        }
    }
}

/// Hard rows: met where they can be, called infeasible where they cannot, met as well as a price says on demand.
pub(super) fn hard_rows(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>, tol: f64) {
    let kind = Kind { rows: 2, price: None, tight: 0.35, duplicates: true };
    let (mut solved, mut infeasible) = (0, 0);
    for seed in 0..60 {
        let (mut qp, x0) = random(seed, [10, 3, 2], kind);
        let mut solver = make(&qp);
        assert!(solver.prepare(&qp));
        let mut s = QpSolution::new(&qp);
        match solver.solve(&qp, &x0, &Terms::default()) {
            QpStatus::Solved => {
                solver.expand(&qp, &mut s);
                let e = residual(&qp, &x0, &s);
                assert!(e < tol, "{} {seed}: {e:e}", solver.name());
                solved += 1;
            }
            QpStatus::Infeasible => {
                infeasible += 1;
                // a price that is large enough meets the rows where that is possible: here it leaves some violated
                let price = 1e5;
                let terms = Terms { elastic: Some(price), ..Terms::default() };
                assert_eq!(solver.solve(&qp, &x0, &terms), QpStatus::Solved);
                solver.expand(&qp, &mut s);
                qp.rows.iter_mut().for_each(|r| r.price = Some(Price { linear: price, quadratic: 0.0 }));
                let e = residual(&qp, &x0, &s);
                assert!(e < tol, "{} {seed} elastic: {e:e}", solver.name());
                let violated = (0..qp.rows.len()).any(|i| s.row_mu[i].abs() >= price * (1.0 - 1e-12));
                assert!(violated, "{seed}: called infeasible, but the rows can be met");
            }
            other => panic!("{} {seed}: {other:?}", solver.name()),
        }
    }
    assert!(solved >= 10 && infeasible >= 5, "{solved} {infeasible}: the suite has lost its point");
}

/// The first state is free: programs of estimation, with bounds and rows as all others.
pub(super) fn estimates(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>, tol: f64) {
    for (i, size) in SIZES.into_iter().enumerate() {
        for (j, kind) in kinds().into_iter().enumerate() {
            let seed = (300 * i + j) as u64;
            let (mut qp, mean) = random(seed, size, kind);
            let (nx, mut r) = (qp.nx, numbers(seed + 5));
            let root: Vec<f64> = (0..nx * nx).map(|_| r()).collect();
            let entry = |a: usize, b: usize| (0..nx).map(|l| root[a + l * nx] * root[b + l * nx]).sum::<f64>();
            let weight = (0..nx * nx).map(|e| entry(e % nx, e / nx) + if e % nx == e / nx { 0.1 } else { 0.0 });
            qp.initial = Initial::Free(weight.collect());
            let mut solver = make(&qp);
            let mut s = QpSolution::new(&qp);
            for round in 0..3 {
                assert!(solver.prepare(&qp));
                let status = solver.solve(&qp, &mean, &Terms::default());
                assert_eq!(status, QpStatus::Solved, "{} {size:?} {j} {round}", solver.name());
                solver.expand(&qp, &mut s);
                let e = residual(&qp, &mean, &s);
                assert!(e < tol, "{} {size:?} {j} {round}: {e:e}", solver.name());
                let moved = (0..nx).map(|i| (s.x[i] - mean[i]).abs()).fold(0.0, f64::max);
                assert!(moved > 1e-6, "the first state stays at its mean");
                qp.c.iter_mut().for_each(|v| *v += 0.1 * r());
            }
        }
    }
}

/// Equal bounds of rows are equations.
pub(super) fn equations(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>, tol: f64) {
    for seed in 0..10 {
        let (mut qp, x0) = random(seed, [8, 3, 2], Kind { tight: 50.0, ..Kind::default() });
        qp = {
            let rows = (0..3).map(|_| Row { node: 8, price: None }).collect();
            let mut with = StageQp::new(8, 3, 2, rows).unwrap();
            let StageQp { rows: _, row_x: _, row_u: _, row_lower: _, row_upper: _, row_base: _, .. } = with;
            (0..3).for_each(|i| with.row_x[i * 3 + i] = 1.0);
            with.row_lower = vec![0.3, -0.2, 0.1];
            with.row_upper = with.row_lower.clone();
            StageQp {
                rows: with.rows,
                row_x: with.row_x,
                row_u: with.row_u,
                row_lower: with.row_lower,
                row_upper: with.row_upper,
                row_base: with.row_base,
                ..qp
            }
        };
        let mut solver = make(&qp);
        assert!(solver.prepare(&qp));
        let mut s = QpSolution::new(&qp);
        assert_eq!(solver.solve(&qp, &x0, &Terms::default()), QpStatus::Solved, "{seed}");
        solver.expand(&qp, &mut s);
        assert!(residual(&qp, &x0, &s) < tol, "{seed}: {:e}", residual(&qp, &x0, &s));
    }
}

/// What cannot be solved says so and does no harm.
pub(super) fn refuses(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>) {
    let (mut qp, x0) = random(3, [5, 3, 2], Kind { tight: 1.0, ..Kind::default() });
    let mut solver = make(&qp);
    assert!(solver.prepare(&qp));
    assert_eq!(solver.solve(&qp, &[f64::NAN, 0.0, 0.0], &Terms::default()), QpStatus::Failed);
    let late = Terms { deadline: Some(Instant::now()), ..Terms::default() };
    assert!(matches!(solver.solve(&qp, &x0, &late), QpStatus::OutOfTime | QpStatus::Solved));
    let inside = |u: &[f64]| u.iter().enumerate().all(|(i, v)| *v >= qp.u_lower[i] && *v <= qp.u_upper[i]);
    assert!(inside(solver.controls()));
    let good = qp.clone();
    qp.hess_u.iter_mut().for_each(|v| *v = -*v - 100.0);
    assert!(!solver.prepare(&qp));
    assert_eq!(solver.solve(&qp, &x0, &Terms::default()), QpStatus::Failed);
    qp.hess_u.fill(f64::NAN);
    assert!(!solver.prepare(&qp));
    assert!(solver.prepare(&good));
    assert_eq!(solver.solve(&good, &x0, &Terms::default()), QpStatus::Solved);
    assert!(StageQp::new(0, 1, 1, vec![]).is_err());
    assert!(StageQp::new(2, 1, 1, vec![Row { node: 3, price: None }]).is_err());
    assert!(StageQp::new(2, 1, 1, vec![Row { node: 1, price: Some(Price { linear: 0.0, quadratic: 0.0 }) }]).is_err());
}

/// Sums of controls at zero, each stated four times: what seems left of them is the rounding of terms that cancel, and there is no bound that it could
/// be measured by.
pub(super) fn sums_at_zero(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>, tol: f64) {
    const N: usize = 12;
    for seed in 0..100 {
        let mut r = numbers(seed);
        let price = (seed % 2 == 0).then_some(Price { linear: 160.0, quadratic: 0.0 });
        let mut qp = StageQp::new(1, 1, N, vec![Row { node: 0, price }; N]).unwrap();
        for j in 0..N {
            qp.hess_u[j * (N + 1)] = 0.1 + 0.05 * r().abs();
            qp.grad_u[j] = r();
            (qp.u_lower[j], qp.u_upper[j]) = (-0.3 - r().abs(), 0.3 + r().abs());
            // the sum of the controls 3 (j / 4), and the two behind it
            (0..3).for_each(|k| qp.row_u[j * N + 3 * (j / 4) + k] = 0.7);
        }
        qp.row_lower.fill(f64::NEG_INFINITY);
        qp.row_upper.fill(0.0);
        let mut solver = make(&qp);
        assert!(solver.prepare(&qp));
        assert_eq!(solver.solve(&qp, &[0.0], &Terms::default()), QpStatus::Solved, "seed {seed}");
        let mut s = QpSolution::new(&qp);
        solver.expand(&qp, &mut s);
        let off = residual(&qp, &[0.0], &s);
        assert!(off < tol, "seed {seed}: {off:e}");
    }
}

/// The work of a solution has a bound: what is left of it is done later, from where it was, and the solution is the same one. The controls that are there are
/// within their bounds at any time.
pub(super) fn bounded(make: &dyn Fn(&StageQp) -> Box<dyn QpSolver>, tol: f64) {
    let (mut cut, mut contradictions) = (0, 0);
    for seed in 0..40 {
        let size = [[20, 3, 2], [30, 2, 1], [8, 5, 3]][seed as usize % 3];
        let kind = Kind { rows: 2, tight: [0.3, 0.1][seed as usize % 2], ..Kind::default() };
        let (mut qp, x0) = random(seed + 400, size, kind);
        let elastic = Some(1e3);
        let mut solver = make(&qp);
        assert!(solver.prepare(&qp));
        contradictions += usize::from(solver.solve(&qp, &x0, &Terms::default()) == QpStatus::Infeasible);
        let mut s = QpSolution::new(&qp);
        for most in [1, 2, 5, 20] {
            solver.reset();
            assert!(solver.prepare(&qp));
            let status = solver.solve(&qp, &x0, &Terms { elastic, most: Some(most), ..Terms::default() });
            assert!(matches!(status, QpStatus::OutOfTime | QpStatus::Solved), "{seed} {most}: {status:?}");
            assert!(solver.iterations() <= most, "{seed} {most}: {}", solver.iterations());
            let all = solver.controls().iter().zip(qp.u_lower.iter().zip(&qp.u_upper));
            assert!(status == QpStatus::Solved || all.clone().all(|(u, (l, h))| l <= u && u <= h), "{seed} {most}");
            cut += usize::from(status == QpStatus::OutOfTime);
            assert_eq!(
                solver.solve(&qp, &x0, &Terms { elastic, ..Terms::default() }),
                QpStatus::Solved,
                "{seed} {most}"
            );
            solver.expand(&qp, &mut s);
            let prices: Vec<_> = qp.rows.iter().map(|r| r.price).collect();
            qp.rows.iter_mut().for_each(|r| r.price = Some(Price { linear: 1e3, quadratic: 0.0 }));
            let off = residual(&qp, &x0, &s);
            qp.rows.iter_mut().zip(prices).for_each(|(r, p)| r.price = p);
            assert!(off < tol, "{seed} {most}: {off:e}");
            // the state that it was solved for is no news
            assert_eq!(solver.solve(&qp, &x0, &Terms { elastic, ..Terms::default() }), QpStatus::Solved);
            let again = solver.iterations();
            assert!(!solver.violates(&qp) || again <= 4, "{seed} {most}: {again} iterations again");
        }
    }
    assert!(cut > 60 && contradictions > 10, "{cut} {contradictions}: the programs have lost their point");
}

#[test]
fn condensing_conforms() {
    let make = |qp: &StageQp| Box::new(Condensing::new(qp).unwrap()) as Box<dyn QpSolver>;
    conforms(&make, 1e-9);
    sums_at_zero(&make, 1e-9);
    hard_rows(&make, 1e-9);
    equations(&make, 1e-9);
    bounded(&make, 1e-8);
    refuses(&make);
}

#[test]
fn stagewise_conforms() {
    let make = |qp: &StageQp| Box::new(Stagewise::new(qp).unwrap()) as Box<dyn QpSolver>;
    conforms(&make, 1e-9);
    sums_at_zero(&make, 1e-9);
    hard_rows(&make, 1e-9);
    equations(&make, 1e-9);
    bounded(&make, 1e-8);
    refuses(&make);
    estimates(&make, 1e-9);
}

#[test]
fn condensing_refuses_a_free_first_state() {
    let (mut qp, _) = random(1, [5, 3, 2], Kind { tight: 1.0, ..Kind::default() });
    qp.initial = Initial::Free(vec![1.0; 9]);
    assert!(matches!(Condensing::new(&qp), Err(crate::error::Error::Unsupported(_))));
}

/// Kinks `|u_j|` by variables `s_j` that are no less than `u_j` and `−u_j`, every row twice, about a point where both are zero: the steps of such
/// pairs are sums that cancel, and so are the rows of them, whose violation then is the rounding of zero.
#[test]
fn rows_twice_about_a_kink_are_no_circle() {
    const N: usize = 12;
    for seed in 0..60 {
        let mut r = numbers(seed);
        let rows = vec![Row { node: 0, price: Some(Price { linear: 40.0, quadratic: 0.0 }) }; 4 * N];
        let mut qp = StageQp::new(1, 1, 2 * N, rows).unwrap();
        let n = 2 * N;
        let g: Vec<f64> = (0..n * n).map(|_| r()).collect();
        for j in 0..n {
            for i in 0..n {
                let own = if i == j { 0.1 } else { 0.0 };
                qp.hess_u[i + j * n] = (0..n).map(|l| g[i * n + l] * g[j * n + l]).sum::<f64>() / n as f64 + own;
            }
        }
        for j in 0..N {
            (qp.grad_u[j], qp.grad_u[N + j]) = (0.3 * r(), 1.0);
            for k in 0..4 {
                let i = 4 * j + k;
                qp.row_u[i * n + j] = if k % 2 == 0 { 1.0 } else { -1.0 };
                qp.row_u[i * n + N + j] = -1.0;
                (qp.row_lower[i], qp.row_upper[i]) = (f64::NEG_INFINITY, 0.0);
            }
        }
        qp.u_lower.fill(-0.2);
        qp.u_upper.fill(0.2);
        let both: [Box<dyn QpSolver>; 2] =
            [Box::new(Condensing::new(&qp).unwrap()), Box::new(Stagewise::new(&qp).unwrap())];
        for mut solver in both {
            let name = solver.name();
            assert!(solver.prepare(&qp));
            assert_eq!(solver.solve(&qp, &[0.0], &Terms::default()), QpStatus::Solved, "{name} {seed}");
            // before the method takes it for a circle, and takes larger violations for rounding
            assert!(solver.iterations() < 2 * (n + 4 * N), "{name} {seed}: {} iterations", solver.iterations());
            let mut s = QpSolution::new(&qp);
            solver.expand(&qp, &mut s);
            let off = residual(&qp, &[0.0], &s);
            assert!(off < 1e-8, "{name} {seed}: {off:e}");
        }
    }
}

/// A cart that is too fast for its wall, from sample to sample: the guess that is moved by a stage knows which rows are violated, so that the next sample has
/// few changes, and its solution is that of a solver that knows nothing.
#[test]
fn violated_rows_move_with_the_guess() {
    const N: usize = 30;
    const H: f64 = 0.1;
    let rows = (1..=N).map(|node| Row { node, price: None }).collect();
    let mut qp = StageQp::new(N, 2, 1, rows).unwrap();
    for k in 0..N {
        qp.a[4 * k..4 * (k + 1)].copy_from_slice(&[1.0, 0.0, H, 1.0]);
        qp.b[2 * k..2 * (k + 1)].copy_from_slice(&[0.5 * H * H, H]);
        qp.hess_u[k] = 0.1 * H;
    }
    for k in 0..=N {
        qp.hess_x[4 * k..4 * (k + 1)].copy_from_slice(&[H, 0.0, 0.0, 0.1 * H]);
    }
    qp.row_x.chunks_exact_mut(2).for_each(|r| r[0] = 1.0);
    qp.row_lower.fill(-1.0);
    qp.row_upper.fill(1.0);
    qp.u_lower.fill(-1.0);
    qp.u_upper.fill(1.0);
    let priced = Terms { elastic: Some(1e4), ..Terms::default() };
    let mut solver = Condensing::new(&qp).unwrap();
    assert!(solver.prepare(&qp));
    let (mut x, mut first) = (vec![0.8, 1.5], 0);
    for sample in 0..6 {
        assert_eq!(solver.solve(&qp, &x, &priced), QpStatus::Solved);
        assert!(solver.violates(&qp));
        if sample == 0 {
            first = solver.iterations();
        } else {
            assert!(8 * solver.iterations() < first, "{sample}: {} of {first}", solver.iterations());
        }
        let mut anew = Condensing::new(&qp).unwrap();
        assert!(anew.prepare(&qp));
        assert_eq!(anew.solve(&qp, &x, &priced), QpStatus::Solved);
        let off = solver.controls().iter().zip(anew.controls()).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off < 1e-9, "{sample}: {off:e}");
        let u = [solver.controls()[0]];
        let mut next = [0.0; 2];
        qp.step(0, &x, &u, &mut next);
        x.copy_from_slice(&next);
        solver.shift(&qp);
        assert!(solver.prepare(&qp));
    }
}
