//! Examples made to break methods: traps, missing multipliers, no solution at all.

use super::{problem, sum, Model, Problem, Stat, INF};

pub fn all() -> Vec<Problem> {
    vec![
        problem("leyffer1", "Leyffer, Munson: A globally convergent filter method for MPECs (2007)", |m| {
            let x = m.free(&[0.5, 1.5]);
            m.minimise(x[0].sq() + x[1].sq() - 2.0 * (x[0] + x[1]) + 2.0);
            m.pair(x[0], x[1]);
            m.start(&[0.0, 0.0]);
            m.optimal(1.0).at(&[1.0, 0.0], Stat::S).trap(&[0.0, 0.0], Stat::C);
        }),
        problem("leyffer-munson", "Leyffer, Munson: A globally convergent filter method for MPECs (2007)", |m| {
            let x = m.positive(&[0.0, 0.0]);
            m.minimise((x[0] - 1.0).sq() + x[1].sq() * (x[1] + 1.0));
            m.pair(x[0], x[1]);
            for s in [[1.0, 1.0], [0.0, 3.0], [2.0, 0.0]] {
                m.start(&s);
            }
            m.optimal(0.0).at(&[1.0, 0.0], Stat::S).trap(&[0.0, 0.0], Stat::M);
        }),
        problem("kirches1", "Kirches, Larson, Leyffer, Manns, SIAM J. Optim. 32 (2022)", |m| {
            let x = m.free(&[3.0, 0.0]);
            m.minimise(x[0].powi(3) - x[1] + 0.5 * x[1].sq());
            m.pair(x[0], x[1]);
            m.start(&[0.0, 0.0]);
            m.optimal(-0.5).at(&[0.0, 1.0], Stat::S).trap(&[0.0, 0.0], Stat::M);
        }),
        problem("biactive chain", "All pairs biactive, strongly stationary, with coupling", |m| {
            let (x, y) = (m.free(&[1.0; 8]), m.free(&[1.0; 8]));
            let linear = sum((0..8).map(|i| f64::from(i as u32 + 1) * (x[i] + y[i])));
            let squares = sum(x.iter().chain(&y).map(|v| v.sq()));
            m.minimise(linear + 0.5 * squares + sum((0..8).map(|i| x[i] * y[(i + 1) % 8])));
            for i in 0..8 {
                m.pair(x[i], y[i]);
            }
            m.optimal(0.0).at(&[0.0; 16], Stat::S);
        }),
        problem("sign flip", "The distance to a kink from the wrong side; after Scheel, Scholtes (2000)", |m| {
            let (t, p) = (m.var(-INF, INF, 1.0), m.positive(&[1.0, 0.0]));
            m.minimise((p[0] + p[1] - 2.0).sq() + (t + 1.0).sq());
            m.zero(p[0] - p[1] - t);
            m.pair(p[0], p[1]);
            m.start(&[3.0, 3.0, 0.0]);
            m.optimal(0.5).at(&[-1.5, 0.0, 1.5], Stat::S).local(&[4.5]).trap(&[0.0, 0.0, 0.0], Stat::C);
        }),
        problem("biactive, zero multipliers", "Strongly stationary without strict complementarity", |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(x[0].sq() + x[1].sq());
            m.pair(x[0], x[1]);
            m.start(&[5.0, 0.1]);
            m.optimal(0.0).at(&[0.0, 0.0], Stat::S);
        }),
        problem("one point", "Ye, J. Math. Anal. Appl. 307 (2005): no constraint qualification for MPECs holds", |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(-x[1]);
            m.zero(x[0] - x[1]);
            m.pair(x[0], x[1]);
            m.optimal(0.0).at(&[0.0, 0.0], Stat::M);
        }),
        problem("redundant rows", "Linear pairs stated three times: multipliers are not unique", |m| {
            let x = m.positive(&[1.0, 1.0, 1.0]);
            m.minimise((x[0] - 2.0).sq() + (x[1] - 1.0).sq() + x[2]);
            for scale in [1.0, 2.0, -3.0] {
                m.zero(scale * (x[0] + x[1] - x[2] - 1.0));
            }
            m.pair(x[0], x[1]);
            // x1 = 0: x3 = x0 − 1, x0 = 3/2, f = 1/4 + 1 + 1/2
            m.optimal(1.75).at(&[1.5, 0.0, 0.5], Stat::S).local(&[4.0]);
        }),
        problem("a variable in three pairs", "After Scholtes (2001): 0 ≤ z ⊥ x_i ≥ 0", |m| {
            let (x, z) = (m.positive(&[1.0; 3]), m.var(0.0, INF, 1.0));
            m.minimise(sum((0..3).map(|i| (x[i] - f64::from(i as u32 + 1)).sq())) + (z - 5.0).sq());
            for &x in &x {
                m.pair(x, z);
            }
            m.start(&[0.0, 0.0, 0.0, 7.0]);
            m.optimal(14.0).at(&[0.0, 0.0, 0.0, 5.0], Stat::S).local(&[25.0]);
        }),
        problem("fixed member", "A pair one of whose members is fixed at zero", |m| {
            let (x, y) = (m.var(0.0, INF, 1.0), m.var(-INF, INF, 1.0));
            m.minimise((x - 2.0).sq() + (y + 1.0).sq());
            m.pair(x, 0.0 * y);
            m.optimal(0.0).at(&[2.0, -1.0], Stat::S);
        }),
        problem("curved pair", "0 ≤ x² + y² − 1 ⊥ y ≥ 0: the members meet on a circle", |m| {
            let x = m.free(&[2.0, 2.0]);
            m.minimise((x[0] - 0.25).sq() + (x[1] - 0.25).sq());
            m.pair(x[0].sq() + x[1].sq() - 1.0, x[1]);
            m.start(&[-1.0, 0.5]);
            // on the circle towards the diagonal
            m.optimal((1.0 - 0.125f64.sqrt()).powi(2)).at(&[0.5f64.sqrt(), 0.5f64.sqrt()], Stat::S);
        }),
        infeasible("infeasible: members above one", &[2.0, 2.0], |m| {
            let x = m.vars(1.0, INF, &[2.0, 2.0]);
            m.minimise(x[0] + x[1]);
            m.pair(x[0], x[1]);
        }),
        infeasible("infeasible: rows keep members away from zero", &[1.0, 1.0], |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise(x[0] + x[1]);
            m.at_least(1.0 * x[0], 1.0);
            m.at_least(1.0 * x[1], 1.0);
            m.pair(x[0], x[1]);
        }),
        infeasible("infeasible: hyperbola", &[2.0, 2.0], |m| {
            let x = m.positive(&[2.0, 2.0]);
            m.minimise(x[0].sq() + x[1].sq());
            m.at_least(x[0] * x[1], 1.0);
            m.pair(x[0], x[1]);
        }),
        infeasible("infeasible: linear rows alone", &[1.0, 1.0, 0.0], |m| {
            let x = m.positive(&[1.0, 1.0, 0.0]);
            m.minimise(x[0] - x[2]);
            m.at_least(x[0] + x[1], 3.0);
            m.at_most(x[0] + x[1] + x[2], 2.0);
            m.pair(x[0], x[2]);
        }),
        infeasible("infeasible in the limit: a disc and an axis", &[1.0, 0.5], |m| {
            let x = m.free(&[1.0, 0.5]);
            m.minimise(x[0]);
            m.at_most(x[0].sq() + x[1].sq(), 0.25);
            m.pair(x[0], x[1]);
            m.at_least(x[0] + x[1], 0.6);
        }),
        unbounded("unbounded: both branches", |m| {
            let x = m.free(&[1.0, 1.0]);
            m.minimise(-(x[0] + x[1]));
            m.pair(x[0], x[1]);
        }),
        unbounded("unbounded: concave along a branch", |m| {
            let x = m.positive(&[1.0, 1.0]);
            m.minimise((x[0] - 1.0).sq() - x[1].sq());
            m.pair(x[0], x[1]);
        }),
        unbounded("unbounded: free variable", |m| {
            let (x, t) = (m.positive(&[1.0, 1.0]), m.var(-INF, INF, 0.0));
            m.minimise(x[0] + (x[1] - 1.0).sq() + t);
            m.pair(x[0], x[1] - 0.5 * t);
        }),
    ]
}

fn infeasible(name: &str, start: &[f64], write: impl FnOnce(&mut Model)) -> Problem {
    problem(name, "No point is complementary and feasible", |m| {
        write(m);
        m.start(&start.iter().map(|v| 5.0 * v - 1.0).collect::<Vec<f64>>());
        m.infeasible();
    })
}

fn unbounded(name: &str, write: impl FnOnce(&mut Model)) -> Problem {
    problem(name, "The objective falls for ever", |m| {
        write(m);
        m.unbounded();
    })
}
