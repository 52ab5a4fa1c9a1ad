//! Equilibria, friction, sparsity: complementarity as it comes up in applications, small enough to be solved by hand.

use super::{affine, problem, sum, Ex, Problem, Stat, INF};

pub fn all() -> Vec<Problem> {
    let mut out = vec![
        problem("pigou", "Pigou: The economics of welfare (1920); a toll on the road that fills", |m| {
            let (x, t) = (m.positive(&[0.2, 0.8]), m.var(0.0, 5.0, 0.0));
            let u = m.var(-INF, INF, 1.0);
            m.minimise(x[0] + x[1].sq());
            m.zero(x[0] + x[1] - 1.0);
            m.pair(x[0], 1.0 - u);
            m.pair(x[1], x[1] + t - u);
            m.optimal(0.75).at(&[0.5, 0.5, 0.5, 1.0], Stat::S);
        }),
        problem("braess", "Braess: Über ein Paradoxon aus der Verkehrsplanung (1968); a toll on the bridge", |m| {
            let (x, t) = (m.positive(&[2.0; 3]), m.var(0.0, 100.0, 0.0));
            let u = m.var(-INF, INF, 92.0);
            // two outer paths and the one over the bridge
            let (first, second) = (x[0] + x[2], x[1] + x[2]);
            let outer = [10.0 * first + 50.0 + x[0], 10.0 * second + 50.0 + x[1]];
            let bridge = 10.0 * first + 10.0 * second + 10.0 + x[2];
            m.minimise(x[0] * outer[0] + x[1] * outer[1] + x[2] * bridge);
            m.zero(x[0] + x[1] + x[2] - 6.0);
            m.pair(x[0], outer[0] - u);
            m.pair(x[1], outer[1] - u);
            m.pair(x[2], bridge + t - u);
            m.optimal(498.0);
        }),
        problem(
            "kojima-shindo",
            "Kojima, Shindo, J. Oper. Res. Soc. Japan 29 (1986): a degenerate and a regular solution",
            |m| {
                let x = m.positive(&[1.0; 4]);
                m.minimise(0.0 * x[0]);
                let (a, b, c, d) = (x[0], x[1], x[2], x[3]);
                m.pair(a, 3.0 * a.sq() + 2.0 * a * b + 2.0 * b.sq() + c + 3.0 * d - 6.0);
                m.pair(b, 2.0 * a.sq() + a + b.sq() + 10.0 * c + 2.0 * d - 2.0);
                m.pair(c, 3.0 * a.sq() + a * b + 2.0 * b.sq() + 2.0 * c + 9.0 * d - 9.0);
                m.pair(d, a.sq() + 3.0 * b.sq() + 2.0 * c + 3.0 * d - 3.0);
                m.start(&[0.0; 4]);
                m.start(&[1.25, 0.0, 0.0, 0.5]);
                m.optimal(0.0).at(&[6f64.sqrt() / 2.0, 0.0, 0.0, 0.5], Stat::S);
            },
        ),
        problem("billups", "Billups: Algorithms for complementarity problems, PhD thesis, Wisconsin (1995)", |m| {
            // the violation has a local minimum at 0, from where no local method gets away
            let x = m.var(0.0, INF, 1.5);
            m.minimise(0.0 * x);
            m.pair(x, (x - 1.0).sq() - 1.01);
            m.start(&[10.0]);
            m.optimal(0.0).at(&[1.0 + 1.01f64.sqrt()], Stat::S);
        }),
        problem("median", "The sum of distances as positive and negative parts", |m| {
            let b = [3.0, -1.0, 7.0, 2.0, 10.0];
            let (x, p, q) = (m.var(-INF, INF, 0.0), m.positive(&[1.0; 5]), m.positive(&[1.0; 5]));
            m.minimise(sum(p.iter().chain(&q).map(|v| 1.0 * *v)));
            for k in 0..5 {
                m.zero(x - b[k] - p[k] + q[k]);
                m.pair(p[k], q[k]);
            }
            m.optimal(16.0).at(&[3.0, 0.0, 4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0, 0.0, 7.0], Stat::S);
        }),
        problem("obstacle", "Find the load of a membrane over an obstacle from its shape", |m| {
            let n = 12;
            let shape = |i: usize| if (4..8).contains(&i) { 0.0 } else { 0.3 + 0.1 * (i % 4) as f64 };
            let force = |i: usize| if (4..8).contains(&i) { 0.5 } else { 0.0 };
            let (y, f) = (m.positive(&vec![1.0; n]), m.positive(&vec![1.0; n]));
            let u = m.free(&vec![0.0; n]);
            let side = |v: &dyn Fn(usize) -> f64, i: usize| if i == 0 { 0.0 } else { v(i - 1) };
            for i in 0..n {
                let left = if i > 0 { -1.0 * y[i - 1] } else { Ex::constant(0.0) };
                let right = if i + 1 < n { -1.0 * y[i + 1] } else { Ex::constant(0.0) };
                m.zero(2.0 * y[i] + left + right - u[i] - f[i]);
                m.pair(y[i], f[i]);
            }
            let load = |i: usize| {
                let right = if i + 1 < n { shape(i + 1) } else { 0.0 };
                2.0 * shape(i) - side(&shape, i) - right - force(i)
            };
            m.minimise(sum((0..n).map(|i| (y[i] - shape(i)).sq() + 0.1 * (u[i] - load(i)).sq())));
            let x: Vec<f64> = (0..n).map(shape).chain((0..n).map(force)).chain((0..n).map(load)).collect();
            m.optimal(0.0).at(&x, Stat::S);
        }),
        problem("feasible, never complementary", "A linear complementarity problem without solution", |m| {
            let x = m.positive(&[1.0, 2.0]);
            m.minimise(x[0] + x[1]);
            m.pair(x[0], x[1] - 1.0);
            m.pair(x[1], 0.0 * x[0] + 1.0);
            m.infeasible();
        }),
        sparse_point(&[3.0, 1.0, 2.0, 0.5, 4.0, 1.5], 2),
        friction(8, 0.25, 1.0),
        friction(20, 0.125, 1.0),
    ];
    out.extend([1e-3, 1e3, 1e5].map(stretched));
    out
}

/// The nearest point with at most `k` nonzeros: keep the largest. Every other choice of `k` is a local minimiser.
fn sparse_point(a: &[f64], k: usize) -> Problem {
    let n = a.len();
    let cost = |s: usize| 0.5 * (0..n).filter(|i| s >> i & 1 == 0).map(|i| a[i] * a[i]).sum::<f64>();
    let mut costs: Vec<f64> = (0..1usize << n).filter(|s| s.count_ones() == k as u32).map(cost).collect();
    costs.sort_by(f64::total_cmp);
    let name = format!("the nearest point with {k} of {n} nonzeros");
    problem(&name, "Burdakov, Kanzow, Schwartz: Cardinality constraints, SIAM J. Optim. 26 (2016)", |m| {
        let (x, y) = (m.positive(&vec![1.0; n]), m.vars(0.0, 1.0, &vec![0.5; n]));
        m.minimise(0.5 * sum(x.iter().zip(a).map(|(x, a)| (*x - *a).sq())));
        m.at_least(affine(&vec![1.0; n], &y, 0.0), (n - k) as f64);
        for i in 0..n {
            m.pair(x[i], y[i]);
        }
        m.optimal(costs[0]).local(&costs[1..]);
    })
}

/// A block on a dry table, implicit Euler: `v' = u − s`, `s ∈ Sgn v`, from rest to the speed `goal`. Moving during the
/// last `n` steps costs `T + 2 goal + goal²/T` with `T = n h`; every `n` is a local minimum.
fn friction(steps: usize, h: f64, goal: f64) -> Problem {
    let cost = |n: usize| {
        let t = n as f64 * h;
        t + 2.0 * goal + goal * goal / t
    };
    let mut costs: Vec<f64> = (1..=steps).map(cost).collect();
    costs.sort_by(f64::total_cmp);
    problem(&format!("dry friction, {steps} steps"), "Stewart, Anitescu, Numer. Math. 114 (2010), in spirit", |m| {
        let (p, q) = (m.positive(&vec![0.5; steps]), m.positive(&vec![0.5; steps]));
        let (s, u) = (m.free(&vec![0.0; steps]), m.free(&vec![0.0; steps]));
        for k in 0..steps {
            let before = if k == 0 { Ex::constant(0.0) } else { p[k - 1] - q[k - 1] };
            m.zero(p[k] - q[k] - before - h * (u[k] - s[k]));
            m.pair(p[k], 1.0 - s[k]);
            m.pair(q[k], 1.0 + s[k]);
        }
        m.zero(p[steps - 1] - q[steps - 1] - goal);
        m.minimise(h * sum(u.iter().map(|u| u.sq())));
        m.optimal(costs[0]).local(&costs[1..]);
    })
}

/// A point in the quadrant seen through units `1/scale` and `scale` apart.
fn stretched(scale: f64) -> Problem {
    problem(&format!("stretched by {scale:e}"), "Leyffer's scale problems in MacMPEC, further apart", |m| {
        let x = m.positive(&[scale, 1.0 / scale]);
        m.minimise((x[0] / scale - 1.0).sq() + 2.0 * (scale * x[1] - 1.0).sq());
        m.pair(x[0], x[1]);
        m.optimal(1.0).at(&[0.0, 1.0 / scale], Stat::S).local(&[2.0]);
    })
}
