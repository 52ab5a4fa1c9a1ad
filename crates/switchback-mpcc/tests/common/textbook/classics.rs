//! Problems with complementarity constraints that every paper on the subject solves.

use super::{problem, sum, Ex, Problem, Stat, INF};

const JIANG_RALPH: &str = "Jiang, Ralph: Smooth SQP methods for MPECs, SIAM J. Optim. 10 (2000)";
const SCHOLTES: &str = "Scholtes: Convergence properties of a regularization scheme, SIAM J. Optim. 11 (2001)";
const LEYFFER: &str = "Leyffer: MacMPEC, a collection of MPECs (2000)";
const OUTRATA: &str =
    "Outrata: On optimization problems with variational inequality constraints, SIAM J. Optim. 4 (1994)";

/// `(x − a)² + (y − b)²`, weighted.
fn distance(x: &[Ex], a: [f64; 2], weight: [f64; 2]) -> Ex {
    weight[0] * (x[0] - a[0]).sq() + weight[1] * (x[1] - a[1]).sq()
}

pub fn all() -> Vec<Problem> {
    vec![
        problem("ralph1", "Ralph, Wright, Optim. Methods Softw. 19 (2004); Ralph in MacMPEC", |m| {
            let x = m.positive(&[0.0, 0.0]);
            m.minimise(2.0 * x[0] - x[1]);
            m.pair(x[1], x[1] - x[0]);
            m.optimal(0.0).at(&[0.0, 0.0], Stat::M);
        }),
        problem("ralph2", "Ralph, Wright, Optim. Methods Softw. 19 (2004); Ralph in MacMPEC", |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(x[0].sq() + x[1].sq() - 4.0 * x[0] * x[1]);
            m.pair(x[0], x[1]);
            m.start(&[0.0, 3.0]);
            m.optimal(0.0).at(&[0.0, 0.0], Stat::S);
        }),
        problem("jr1", JIANG_RALPH, |m| {
            let (x, y) = (m.var(-INF, INF, 0.0), m.var(0.0, INF, 0.0));
            m.minimise((x - 1.0).sq() + y.sq());
            m.pair(y, y - x);
            m.start(&[-3.0, 2.0]);
            m.optimal(0.5).at(&[0.5, 0.5], Stat::S);
        }),
        problem("jr2", JIANG_RALPH, |m| {
            let (x, y) = (m.var(-INF, INF, 0.0), m.var(0.0, INF, 0.0));
            m.minimise(x.sq() + (y - 1.0).sq());
            m.pair(y, y - x);
            m.start(&[-3.0, 2.0]);
            m.optimal(0.5).at(&[0.5, 0.5], Stat::S).trap(&[0.0, 0.0], Stat::M);
        }),
        problem("kth1", LEYFFER, |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(x[0] + x[1]);
            m.pair(x[0], x[1]);
            m.optimal(0.0).at(&[0.0, 0.0], Stat::S);
        }),
        problem("kth2", LEYFFER, |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(x[0] + (x[1] - 1.0).sq());
            m.pair(x[0], x[1]);
            m.start(&[4.0, 0.0]);
            m.optimal(0.0).at(&[0.0, 1.0], Stat::S).trap(&[0.0, 0.0], Stat::A);
        }),
        problem("kth3", LEYFFER, |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(distance(&x, [1.0, 1.0], [0.5, 1.0]));
            m.pair(x[0], x[1]);
            m.start(&[0.0, 0.0]);
            m.optimal(0.5).at(&[0.0, 1.0], Stat::S).local(&[1.0]).trap(&[0.0, 0.0], Stat::C);
        }),
        scaled("scale1", [100.0, 1.0], 1.0, 1.0, 1.0),
        scaled("scale2", [1.0, 100.0], 1.0, 1.0, 1.0),
        scaled("scale3", [1.0, 1.0], 100.0, 1.0, 1.0),
        scaled("scale4", [1.0, 1.0], 1.0, 100.0, 1.0),
        scaled("scale5", [1.0, 1.0], 1.0, 1.0, 100.0),
        problem("scholtes1", SCHOLTES, |m| {
            let (x, y, z) = (m.var(0.0, INF, 1.0), m.var(-INF, INF, 1.0), m.var(0.0, INF, 1.0));
            m.minimise((x + 1.0).sq() + (y - 2.5).sq() + (z + 1.0).sq());
            m.pair(y - x.exp() - z.exp(), x);
            m.optimal(2.0).at(&[0.0, 2.5, 0.0], Stat::S);
        }),
        problem("scholtes3", SCHOLTES, |m| {
            let x = m.positive(&[1e-4, 1e-4]);
            m.minimise(distance(&x, [1.0, 1.0], [0.5, 0.5]));
            m.pair(x[0], x[1]);
            m.start(&[0.0, 0.0]);
            m.start(&[3.0, 3.0]);
            m.optimal(0.5).at(&[1.0, 0.0], Stat::S).trap(&[0.0, 0.0], Stat::C);
        }),
        problem("scholtes5", SCHOLTES, |m| {
            let x = m.positive(&[1.0, 1.0, 1.0]);
            m.minimise((x[0] - 1.0).sq() + (x[1] - 2.0).sq() + (x[2] + 1.0).sq());
            m.pair(x[0], x[2]);
            m.pair(x[1], x[2]);
            m.optimal(1.0).at(&[1.0, 2.0, 0.0], Stat::S);
        }),
        scheel_scholtes("scheel-scholtes", &[1.0, 1.0, 1.0]),
        scheel_scholtes("scheel-scholtes from afar", &[0.0, 10.0, -5.0]),
        problem("outrata31", OUTRATA, |m| {
            let (y, x) = (m.positive(&[0.0; 4]), m.var(0.0, 10.0, 0.0));
            m.minimise(0.5 * distance(&y, [3.0, 4.0], [1.0, 1.0]));
            m.pair((1.0 + 0.2 * x) * y[0] - (3.0 + 1.333 * x) - 0.333 * y[2] + 2.0 * y[0] * y[3], y[0]);
            m.pair((1.0 + 0.1 * x) * y[1] - x + y[2] + 2.0 * y[1] * y[3], y[1]);
            m.pair(0.333 * y[0] - y[1] + 1.0 - 0.1 * x, y[2]);
            m.pair(9.0 + 0.1 * x - y[0].sq() - y[1].sq(), y[3]);
            m.optimal(3.207_700_023_7);
        }),
        problem("qpec1, ten of each", LEYFFER, |m| {
            qpec(m, [-1.0, 2.0], 80.0, &[80.5, 81.0, 81.5, 82.0, 82.5, 83.0, 83.5, 84.0, 84.5, 85.0])
        }),
        problem("qpec2, ten of each", LEYFFER, |m| qpec(m, [1.0, 2.0], 45.0, &[])),
        problem("stackelberg1", "von Stackelberg's duopoly with linear demand, in MacMPEC", |m| {
            let (x, y) = (m.var(0.0, 200.0, 100.0), m.var(0.0, INF, 50.0));
            m.minimise(0.5 * x.sq() + 0.5 * x * y - 95.0 * x);
            m.pair(y, 2.0 * y + 0.5 * x - 100.0);
            // y = 50 − x/4, then 3/8 x² − 70 x
            m.optimal(-9800.0 / 3.0).at(&[280.0 / 3.0, 80.0 / 3.0], Stat::S);
        }),
        problem("df1", "Facchinei in MacMPEC", |m| {
            let (x, y) = (m.var(-1.0, 2.0, 0.0), m.var(0.0, INF, 0.0));
            m.minimise((x - 1.0 - y).sq());
            m.at_most(x.sq(), 2.0);
            m.at_most((x - 1.0).sq() + (y - 1.0).sq(), 3.0);
            m.pair(y - x.sq() + 1.0, y);
            m.optimal(0.0).at(&[1.0, 0.0], Stat::S);
        }),
        problem("nash1", "Harker: Generalized Nash games, Eur. J. Oper. Res. 54 (1991), in MacMPEC", |m| {
            let x = m.vars(0.0, 10.0, &[0.0, 0.0]);
            let (y, l) = (m.vars(0.0, 10.0, &[5.0, 5.0]), m.positive(&[0.0, 0.0]));
            m.minimise(0.5 * ((x[0] - y[0]).sq() + (x[1] - y[1]).sq()));
            m.zero(2.0 * x[0] + 8.0 / 3.0 * y[1] - 34.0 + l[0]);
            m.zero(1.25 * y[0] + 2.0 * x[1] - 24.25 + l[1]);
            m.pair(15.0 - x[0] - y[1], l[0]);
            m.pair(15.0 - x[1] - y[0], l[1]);
            m.optimal(0.0);
        }),
        gnash(1.0, 150.0, -343.345_259_994),
        gnash(1.1, 150.0, -203.155_072_186),
        gnash(1.3, 150.0, -68.135_650_159),
        gnash(1.5, 150.0, -19.154_065_422),
        gnash(1.7, 150.0, -3.161_180_883),
    ]
}

/// Leyffer's test of scaling: the pair `s x ⊥ y`, the objective `c` times a distance with a scaled variable.
fn scaled(name: &str, w: [f64; 2], s: f64, t: f64, c: f64) -> Problem {
    problem(name, LEYFFER, |m| {
        let x = m.free(&[0.0, 0.0]);
        m.minimise(c * ((w[0] * x[0] - 1.0).sq() + (w[1] * x[1] - 1.0).sq()));
        let pair = (if s == 1.0 { x[0] } else { s * x[0] }, if t == 1.0 { x[1] } else { t * x[1] });
        m.pair(pair.0, pair.1);
        m.start(&[1.0, 1.0]);
        m.optimal(c).at(&[1.0 / w[0], 0.0], Stat::S).trap(&[0.0, 0.0], Stat::C);
    })
}

/// B-stationary, and not strongly stationary: the relaxation meets it with multipliers that grow.
fn scheel_scholtes(name: &str, start: &[f64]) -> Problem {
    problem(name, "Scheel, Scholtes, Math. Oper. Res. 25 (2000), Example 3", |m| {
        let x = m.free(start);
        m.minimise(x[0] + x[1] - x[2]);
        m.at_least(4.0 * x[0] - x[2], 0.0);
        m.at_least(4.0 * x[1] - x[2], 0.0);
        m.pair(x[0], x[1]);
        m.optimal(0.0).at(&[0.0, 0.0, 0.0], Stat::M);
    })
}

/// Ten pairs `y ⊥ y − x`, ten degenerate ones `y ⊥ y`; targets of `x` and `y`.
fn qpec(m: &mut super::Model, target: [f64; 2], f: f64, local: &[f64]) {
    let (x, y) = (m.free(&[1.0; 10]), m.positive(&[1.0; 20]));
    m.minimise(sum(x.iter().map(|&x| (x - target[0]).sq()).chain(y.iter().map(|&y| (y - target[1]).sq()))));
    for k in 0..20 {
        let other = if k < 10 { y[k] - x[k] } else { 1.0 * y[k] };
        m.pair(y[k], other);
    }
    m.optimal(f).local(local);
}

/// A leader and four followers in the oligopoly of Murphy, Sherali and Soyster.
fn gnash(gamma: f64, capacity: f64, f: f64) -> Problem {
    const SOURCE: &str = "Murphy, Sherali, Soyster, Math. Program. 24 (1982); Outrata, Zowe, Math. Program. 68 (1995)";
    const C: [f64; 5] = [10.0, 8.0, 6.0, 4.0, 2.0];
    const BETA: [f64; 5] = [1.2, 1.1, 1.0, 0.9, 0.8];
    problem(&format!("oligopoly, elasticity {gamma}, capacity {capacity}"), SOURCE, |m| {
        let q = m.vars(0.0, capacity, &[0.5 * capacity; 5]);
        let total = sum(q.iter().copied());
        let price = (5000.0 / total).powf(1.0 / gamma);
        let cost = |i: usize| {
            C[i] * q[i] + BETA[i] / (1.0 + BETA[i]) * 5f64.powf(-1.0 / BETA[i]) * q[i].powf((1.0 + BETA[i]) / BETA[i])
        };
        m.minimise(cost(0) - q[0] * price);
        for i in 1..5 {
            let u = m.var(0.0, INF, 0.0);
            let marginal = C[i] + 5f64.powf(-1.0 / BETA[i]) * q[i].powf(1.0 / BETA[i]);
            let slope = marginal - price + q[i] * price / (gamma * total);
            m.pair(q[i], slope + u);
            m.pair(u, capacity - q[i]);
        }
        m.optimal(f);
    })
}
