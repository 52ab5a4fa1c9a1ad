//! Families of problems whose solutions are planted: any size, any number of biactive pairs, deterministic data.

use super::{affine, problem, sum, Ex, Numbers, Problem, Stat, INF};

/// A matrix with positive definite symmetric part: diagonally dominant, with a skew part.
fn monotone(r: &mut Numbers, n: usize) -> Vec<Vec<f64>> {
    let mut a = vec![vec![0.0; n]; n];
    for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let (symmetric, skew) = (0.5 * r.next() / n as f64, 0.5 * r.next());
        a[i][j] = symmetric + skew;
        a[j][i] = symmetric - skew;
    }
    for (i, row) in a.iter_mut().enumerate() {
        row[i] = 1.0 + r.positive();
    }
    a
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The LCP `0 ≤ y ⊥ N x + M y + q ≥ 0` with a planted solution, the first `biactive` pairs zero on both sides.
struct Planted {
    x: Vec<f64>,
    y: Vec<f64>,
    n_x: Vec<Vec<f64>>,
    m_y: Vec<Vec<f64>>,
    q: Vec<f64>,
    slack: Vec<f64>,
}

impl Planted {
    fn new(r: &mut Numbers, nx: usize, ny: usize, biactive: usize) -> Planted {
        let x = r.vector(nx);
        let (mut y, mut slack) = (vec![0.0; ny], vec![0.0; ny]);
        for i in biactive..ny {
            if i % 2 == 0 {
                y[i] = r.positive();
            } else {
                slack[i] = r.positive();
            }
        }
        let n_x: Vec<Vec<f64>> = (0..ny).map(|_| r.vector(nx)).collect();
        let m_y = monotone(r, ny);
        let q = (0..ny).map(|i| slack[i] - dot(&n_x[i], &x) - dot(&m_y[i], &y)).collect();
        Planted { x, y, n_x, m_y, q, slack }
    }
    fn member(&self, i: usize, x: &[Ex], y: &[Ex]) -> Ex {
        affine(&self.n_x[i], x, self.q[i]) + affine(&self.m_y[i], y, 0.0)
    }
    fn solution(&self) -> Vec<f64> {
        self.x.iter().chain(&self.y).copied().collect()
    }
}

/// A convex quadratic objective whose gradient at the planted point is a non-negative combination of the active
/// members: the point is optimal even without the products, so it is the global minimiser.
fn qpec(nx: usize, ny: usize, biactive: usize, seed: u64) -> Problem {
    let mut r = Numbers::new(seed);
    let lcp = Planted::new(&mut r, nx, ny, biactive);
    let (mut gx, mut gy) = (vec![0.0; nx], vec![0.0; ny]);
    for i in 0..ny {
        if lcp.y[i] == 0.0 {
            gy[i] += r.positive();
        }
        if lcp.slack[i] == 0.0 {
            let nu = r.positive();
            gx.iter_mut().zip(&lcp.n_x[i]).for_each(|(g, a)| *g += nu * a);
            gy.iter_mut().zip(&lcp.m_y[i]).for_each(|(g, a)| *g += nu * a);
        }
    }
    let name = format!("planted quadratic program, {nx} + {ny} variables, {biactive} biactive");
    problem(&name, "Jiang, Ralph: QPECgen, Comput. Optim. Appl. 13 (1999), in spirit", |m| {
        let x = m.free(&vec![0.0; nx]);
        let y = m.positive(&vec![1.0; ny]);
        let squares = |v: &[Ex], at: &[f64]| sum(v.iter().zip(at).map(|(v, a)| 0.5 * (*v - *a).sq()));
        let linear = affine(&gx, &x, -dot(&gx, &lcp.x)) + affine(&gy, &y, -dot(&gy, &lcp.y));
        m.minimise(squares(&x, &lcp.x) + squares(&y, &lcp.y) + linear + 3.0);
        for i in 0..ny {
            m.pair(y[i], lcp.member(i, &x, &y));
        }
        m.optimal(3.0).at(&lcp.solution(), Stat::S);
    })
}

/// Find the parameters that make the solution of an LCP the observed one; all multipliers vanish.
fn inverse(nx: usize, ny: usize, biactive: usize, seed: u64) -> Problem {
    let mut r = Numbers::new(seed);
    let lcp = Planted::new(&mut r, nx, ny, biactive);
    let name = format!("inverse LCP, {nx} + {ny} variables, {biactive} biactive");
    problem(&name, "Luo, Pang, Ralph: Mathematical programs with equilibrium constraints (1996), 1.2", |m| {
        let (x, y) = (m.vars(-3.0, 3.0, &vec![1.0; nx]), m.positive(&vec![1.0; ny]));
        let squares = |v: &[Ex], at: &[f64]| sum(v.iter().zip(at).map(|(v, a)| 0.5 * (*v - *a).sq()));
        m.minimise(squares(&x, &lcp.x) + squares(&y, &lcp.y));
        for i in 0..ny {
            m.pair(y[i], lcp.member(i, &x, &y));
        }
        m.optimal(0.0).at(&lcp.solution(), Stat::S);
    })
}

/// Copies of Scheel and Scholtes's example with variables stretched, shuffled and weighted.
fn disguised_scheel(copies: usize, seed: u64) -> Problem {
    let mut r = Numbers::new(seed);
    let name = format!("{copies} disguised Scheel-Scholtes problems");
    problem(&name, "Scheel, Scholtes, Math. Oper. Res. 25 (2000), Example 3", |m| {
        let n = 3 * copies;
        let start: Vec<f64> = (0..n).map(|_| 1.0 + r.next()).collect();
        let v = m.free(&start);
        let mut f = Ex::constant(0.0);
        for k in 0..copies {
            // a stride prime to the number of variables shuffles them
            let at = |i: usize| v[(7 * (3 * k + i) + 2) % n];
            let z: Vec<Ex> = (0..3).map(|i| (0.3 + 2.0 * r.positive()) * at(i)).collect();
            f = f + r.positive() * (z[0] + z[1] - z[2]);
            m.at_least(4.0 * z[0] - z[2], 0.0);
            m.at_least(4.0 * z[1] - z[2], 0.0);
            m.pair(z[0], z[1]);
        }
        m.minimise(f);
        m.optimal(0.0).at(&vec![0.0; n], Stat::M);
    })
}

/// Least squares with a price on every nonzero; the minimum is found by trying all supports.
fn sparse_regression(n: usize, rows: usize, price: f64, seed: u64) -> Problem {
    let mut r = Numbers::new(seed);
    let a: Vec<Vec<f64>> = (0..rows).map(|_| r.vector(n)).collect();
    let truth: Vec<f64> = (0..n).map(|j| if j % 3 == 0 { 1.5 + r.next() } else { 0.0 }).collect();
    let b: Vec<f64> = a.iter().map(|row| dot(row, &truth) + 0.05 * r.next()).collect();
    let best = (0..1usize << n).map(|s| fit(&a, &b, s) + price * f64::from(s.count_ones())).fold(INF, f64::min);
    let name = format!("sparse regression, {n} coefficients");
    problem(&name, "Burdakov, Kanzow, Schwartz: Cardinality constraints, SIAM J. Optim. 26 (2016)", |m| {
        let (p, q) = (m.vars(0.0, 100.0, &vec![0.5; n]), m.vars(0.0, 100.0, &vec![0.5; n]));
        let z = m.vars(0.0, 1.0, &vec![0.5; n]);
        let residual = |i: usize| affine(&a[i], &p, -b[i]) - affine(&a[i], &q, 0.0);
        m.minimise(0.5 * sum((0..rows).map(|i| residual(i).sq())) + price * sum(z.iter().map(|z| 1.0 - *z)));
        for j in 0..n {
            m.pair(z[j], p[j] + q[j]);
            m.pair(p[j], q[j]);
        }
        m.optimal(best);
    })
}

/// `min ½‖Ax − b‖²` over the coefficients in `support`, by elimination on the normal equations.
fn fit(a: &[Vec<f64>], b: &[f64], support: usize) -> f64 {
    let s: Vec<usize> = (0..a[0].len()).filter(|j| support >> j & 1 == 1).collect();
    let k = s.len();
    let mut t = vec![vec![0.0; k + 1]; k];
    for (i, &p) in s.iter().enumerate() {
        for (j, &q) in s.iter().enumerate() {
            t[i][j] = a.iter().map(|r| r[p] * r[q]).sum();
        }
        t[i][k] = a.iter().zip(b).map(|(r, b)| r[p] * b).sum();
    }
    for i in 0..k {
        let pivot = t[i].clone();
        for row in t.iter_mut().skip(i + 1) {
            let c = row[i] / pivot[i];
            row.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= c * p);
        }
    }
    let mut x = vec![0.0; k];
    for i in (0..k).rev() {
        x[i] = (t[i][k] - (i + 1..k).map(|j| t[i][j] * x[j]).sum::<f64>()) / t[i][i];
    }
    let residual = |(r, b): (&Vec<f64>, &f64)| s.iter().zip(&x).map(|(&j, x)| r[j] * x).sum::<f64>() - b;
    0.5 * a.iter().zip(b).map(|row| residual(row).powi(2)).sum::<f64>()
}

/// The chained function of Rosenbrock over the solutions of an LCP with observed solution `1, 1, ...` of its parameters; the
/// minimum is for the enumeration of branches to tell.
fn chained_rosenbrock(nx: usize, ny: usize, seed: u64) -> Problem {
    let mut r = Numbers::new(seed);
    let lcp = Planted::new(&mut r, nx, ny, 1);
    let name = format!("Rosenbrock's function over an LCP, {nx} + {ny} variables");
    problem(&name, "Rosenbrock, Comput. J. 3 (1960), in the upper level", |m| {
        let (x, y) = (m.vars(-2.0, 2.0, &vec![0.5; nx]), m.vars(0.0, 8.0, &vec![1.0; ny]));
        let valleys = sum((1..nx).map(|i| 10.0 * (x[i] - x[i - 1].sq()).sq() + (1.0 - x[i - 1]).sq()));
        m.minimise(valleys + 0.5 * sum(y.iter().zip(&lcp.y).map(|(y, a)| (*y - *a).sq())));
        for i in 0..ny {
            m.pair(y[i], lcp.member(i, &x, &y));
        }
        m.optimal(f64::NAN);
    })
}

/// Implicit Euler steps of `x' = u − sign x` towards 0 and along it, as a discretised sliding mode has them: `x = p − q`,
/// `0 ≤ α ⊥ q ≥ 0`, `0 ≤ 1 − α ⊥ p ≥ 0`, `sign x = 2 α − 1`. The control follows a target that rests on the surface and then
/// leaves it.
fn sliding_chain(steps: usize) -> Problem {
    let h = 2.0 / steps as f64;
    problem(&format!("sliding chain, {steps} steps"), "Implicit Euler of a relay with a control", |m| {
        let one = vec![0.5; steps];
        let (u, alpha) = (m.vars(-3.0, 3.0, &vec![0.0; steps]), m.vars(0.0, 1.0, &one));
        let (p, q) = (m.vars(0.0, 10.0, &one), m.vars(0.0, 10.0, &one));
        let mut before = Ex::constant(0.6);
        let mut cost = Ex::constant(0.0);
        for k in 0..steps {
            let (x, t) = (p[k] - q[k], h * (k + 1) as f64);
            m.zero(x - before - h * (u[k] - 2.0 * alpha[k] + 1.0));
            m.pair(alpha[k], q[k]);
            m.pair(1.0 - alpha[k], p[k]);
            cost = cost + h * ((x - (t - 1.4f64).max(0.0)).sq() + 0.05 * u[k].sq());
            before = x;
        }
        m.minimise(cost);
        m.optimal(f64::NAN);
    })
}

/// An indefinite quadratic objective over a box and the solutions of an LCP; the minimum is for the enumeration of
/// branches to tell.
pub fn random(seed: u64) -> Problem {
    const N: usize = 3;
    let mut r = Numbers::new(seed);
    let biactive = (seed % 3) as usize;
    let lcp = Planted::new(&mut r, N, 5, biactive);
    problem(&format!("random {seed}"), "Data at random", |m| {
        let x = m.vars(-2.0, 2.0, &r.vector(N));
        let y = m.vars(0.0, 8.0, &[1.0; 5]);
        let all: Vec<Ex> = x.iter().chain(&y).copied().collect();
        let mut f = affine(&r.vector(N + 5), &all, 0.0);
        for (i, a) in all.iter().enumerate() {
            f = f + r.next() * a.sq() + r.next() * *a * all[(i + 3) % all.len()];
        }
        m.minimise(f);
        let row = r.vector(N + 5);
        m.at_most(affine(&row, &all, 0.0), dot(&row, &lcp.solution()) + 0.2);
        for i in 0..5 {
            m.pair(y[i], lcp.member(i, &x, &y));
        }
        m.optimal(f64::NAN);
    })
}

/// Problems whose minimum the enumeration of branches tells, and nobody listed.
pub fn enumerated() -> Vec<Problem> {
    let rosenbrock = [(4, 6, 1), (6, 8, 2), (10, 8, 3)].map(|(nx, ny, seed)| chained_rosenbrock(nx, ny, seed));
    rosenbrock.into_iter().chain([2, 3, 4].map(sliding_chain)).chain((0..30).map(random)).collect()
}

/// Sizes beyond enumeration: what can be asked is a stationary point of a certified type.
pub fn long() -> Vec<Problem> {
    vec![chained_rosenbrock(20, 40, 4), sliding_chain(20), sliding_chain(100)]
}

pub fn all() -> Vec<Problem> {
    vec![
        qpec(3, 6, 2, 1),
        qpec(10, 30, 5, 2),
        qpec(20, 80, 0, 3),
        qpec(20, 80, 20, 4),
        inverse(4, 8, 2, 5),
        inverse(15, 40, 6, 6),
        disguised_scheel(4, 7),
        sparse_regression(6, 10, 0.1, 8),
        sparse_regression(8, 12, 0.1, 9),
    ]
}
