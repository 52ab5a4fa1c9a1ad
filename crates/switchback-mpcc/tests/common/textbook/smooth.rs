//! Nonlinear programs without pairs, most of them from Hock and Schittkowski, Lect. Notes Econ. Math. Syst. 187 (1981).

use super::{problem, Problem, INF};

const HS: &str = "Hock, Schittkowski: Test examples for nonlinear programming codes (1981)";

#[allow(clippy::excessive_precision)]
pub fn all() -> Vec<Problem> {
    vec![
        problem("hs1 without bounds", "Rosenbrock, Comput. J. 3 (1960)", |m| {
            let x = m.free(&[-1.2, 1.0]);
            m.minimise(100.0 * (x[1] - x[0].sq()).sq() + (1.0 - x[0]).sq());
            m.optimal(0.0);
        }),
        problem("hs6", HS, |m| {
            let x = m.free(&[-1.2, 1.0]);
            m.minimise((1.0 - x[0]).sq());
            m.zero(10.0 * (x[1] - x[0].sq()));
            m.optimal(0.0);
        }),
        problem("hs7", HS, |m| {
            let x = m.free(&[2.0, 2.0]);
            m.minimise((1.0 + x[0].sq()).ln() - x[1]);
            m.zero((1.0 + x[0].sq()).sq() + x[1].sq() - 4.0);
            m.optimal(-(3f64.sqrt()));
        }),
        problem("hs12", HS, |m| {
            let x = m.free(&[0.0, 0.0]);
            m.minimise(0.5 * x[0].sq() + x[1].sq() - x[0] * x[1] - 7.0 * x[0] - 7.0 * x[1]);
            m.at_least(25.0 - 4.0 * x[0].sq() - x[1].sq(), 0.0);
            m.optimal(-30.0);
        }),
        problem("hs14", HS, |m| {
            let x = m.free(&[2.0, 2.0]);
            m.minimise((x[0] - 2.0).sq() + (x[1] - 1.0).sq());
            m.at_least(-0.25 * x[0].sq() - x[1].sq() + 1.0, 0.0);
            m.zero(x[0] - 2.0 * x[1] + 1.0);
            m.optimal(9.0 - 2.875 * 7f64.sqrt());
        }),
        problem("hs21", HS, |m| {
            let x = [m.var(2.0, 50.0, -1.0), m.var(-50.0, 50.0, -1.0)];
            m.minimise(0.01 * x[0].sq() + x[1].sq() - 100.0);
            m.at_least(10.0 * x[0] - x[1] - 10.0, 0.0);
            m.optimal(-99.96);
        }),
        problem("hs22", HS, |m| {
            let x = m.free(&[2.0, 2.0]);
            m.minimise((x[0] - 2.0).sq() + (x[1] - 1.0).sq());
            m.at_most(x[0] + x[1] - 2.0, 0.0);
            m.at_most(x[0].sq() - x[1], 0.0);
            m.optimal(1.0);
        }),
        problem("hs24", HS, |m| {
            let x = m.positive(&[1.0, 0.5]);
            m.minimise(((x[0] - 3.0).sq() - 9.0) * x[1].powi(3) / (27.0 * 3f64.sqrt()));
            m.at_least(x[0] / 3f64.sqrt() - x[1], 0.0);
            m.row(0.0, x[0] + 3f64.sqrt() * x[1], 6.0);
            m.optimal(-1.0);
        }),
        problem("hs26", HS, |m| {
            let x = m.free(&[-2.6, 2.0, 2.0]);
            m.minimise((x[0] - x[1]).sq() + (x[1] - x[2]).powi(4));
            m.zero((1.0 + x[1].sq()) * x[0] + x[2].powi(4) - 3.0);
            m.optimal(0.0);
        }),
        problem("hs28", HS, |m| {
            let x = m.free(&[-4.0, 1.0, 1.0]);
            m.minimise((x[0] + x[1]).sq() + (x[1] + x[2]).sq());
            m.zero(x[0] + 2.0 * x[1] + 3.0 * x[2] - 1.0);
            m.optimal(0.0);
        }),
        problem("hs35", HS, |m| {
            let x = m.positive(&[0.5; 3]);
            m.minimise(
                9.0 - 8.0 * x[0] - 6.0 * x[1] - 4.0 * x[2]
                    + 2.0 * x[0].sq()
                    + 2.0 * x[1].sq()
                    + x[2].sq()
                    + 2.0 * x[0] * x[1]
                    + 2.0 * x[0] * x[2],
            );
            m.at_most(x[0] + x[1] + 2.0 * x[2], 3.0);
            m.optimal(1.0 / 9.0);
        }),
        problem("hs39", HS, |m| {
            let x = m.free(&[2.0; 4]);
            m.minimise(-x[0]);
            m.zero(x[1] - x[0].powi(3) - x[2].sq());
            m.zero(x[0].sq() - x[1] - x[3].sq());
            m.optimal(-1.0);
        }),
        problem("hs40", HS, |m| {
            let x = m.free(&[0.8; 4]);
            m.minimise(-x[0] * x[1] * x[2] * x[3]);
            m.zero(x[0].powi(3) + x[1].sq() - 1.0);
            m.zero(x[0].sq() * x[3] - x[2]);
            m.zero(x[3].sq() - x[1]);
            m.optimal(-0.25);
        }),
        problem("hs43", HS, |m| {
            let x = m.free(&[0.0; 4]);
            m.minimise(
                x[0].sq() + x[1].sq() + 2.0 * x[2].sq() + x[3].sq() - 5.0 * x[0] - 5.0 * x[1] - 21.0 * x[2]
                    + 7.0 * x[3],
            );
            m.at_least(8.0 - x[0].sq() - x[1].sq() - x[2].sq() - x[3].sq() - x[0] + x[1] - x[2] + x[3], 0.0);
            m.at_least(10.0 - x[0].sq() - 2.0 * x[1].sq() - x[2].sq() - 2.0 * x[3].sq() + x[0] + x[3], 0.0);
            m.at_least(5.0 - 2.0 * x[0].sq() - x[1].sq() - x[2].sq() - 2.0 * x[0] + x[1] + x[3], 0.0);
            m.optimal(-44.0);
        }),
        problem("hs44", HS, |m| {
            let x = m.positive(&[0.0; 4]);
            m.minimise(x[0] - x[1] - x[2] - x[0] * x[2] + x[0] * x[3] + x[1] * x[2] - x[1] * x[3]);
            m.at_most(x[0] + 2.0 * x[1], 8.0);
            m.at_most(4.0 * x[0] + x[1], 12.0);
            m.at_most(3.0 * x[0] + 4.0 * x[1], 12.0);
            m.at_most(2.0 * x[2] + x[3], 8.0);
            m.at_most(x[2] + 2.0 * x[3], 8.0);
            m.at_most(x[2] + x[3], 5.0);
            m.optimal(-15.0).local(&[-13.0]);
        }),
        problem("hs48", HS, |m| {
            let x = m.free(&[3.0, 5.0, -3.0, 2.0, -2.0]);
            m.minimise((x[0] - 1.0).sq() + (x[1] - x[2]).sq() + (x[3] - x[4]).sq());
            m.zero(x[0] + x[1] + x[2] + x[3] + x[4] - 5.0);
            m.zero(x[2] - 2.0 * (x[3] + x[4]) + 3.0);
            m.optimal(0.0);
        }),
        problem("hs65", HS, |m| {
            let x = [m.var(-4.5, 4.5, -5.0), m.var(-4.5, 4.5, 5.0), m.var(-5.0, 5.0, 0.0)];
            m.minimise((x[0] - x[1]).sq() + (x[0] + x[1] - 10.0).sq() / 9.0 + (x[2] - 5.0).sq());
            m.at_most(x[0].sq() + x[1].sq() + x[2].sq(), 48.0);
            m.optimal(0.953_528_856_7);
        }),
        problem("hs71", HS, |m| {
            let x = m.vars(1.0, 5.0, &[1.0, 5.0, 5.0, 1.0]);
            m.minimise(x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]);
            m.at_least(x[0] * x[1] * x[2] * x[3], 25.0);
            m.zero(x[0].sq() + x[1].sq() + x[2].sq() + x[3].sq() - 40.0);
            m.optimal(17.014_017_289_2);
        }),
        problem("hs76", HS, |m| {
            let x = m.positive(&[0.5; 4]);
            m.minimise(
                x[0].sq() + 0.5 * x[1].sq() + x[2].sq() + 0.5 * x[3].sq() - x[0] * x[2] + x[2] * x[3]
                    - x[0]
                    - 3.0 * x[1]
                    + x[2]
                    - x[3],
            );
            m.at_most(x[0] + 2.0 * x[1] + x[2] + x[3], 5.0);
            m.at_most(3.0 * x[0] + x[1] + 2.0 * x[2] - x[3], 4.0);
            m.at_least(x[1] + 4.0 * x[2], 1.5);
            m.optimal(-4.681_818_181_818_18);
        }),
        problem("maratos", "Maratos: PhD thesis, Imperial College (1978)", |m| {
            let x = m.free(&[0.8f64.cos(), 0.8f64.sin()]);
            m.minimise(2.0 * (x[0].sq() + x[1].sq() - 1.0) - x[0]);
            m.zero(x[0].sq() + x[1].sq() - 1.0);
            m.optimal(-1.0);
        }),
        problem(
            "waechter-biegler",
            "Wächter, Biegler: Failure of global convergence, Math. Program. 88 (2000)",
            |m| {
                let x = [m.var(-INF, INF, -2.0), m.var(0.0, INF, 3.0), m.var(0.0, INF, 1.0)];
                m.minimise(1.0 * x[0]);
                m.zero(x[0].sq() - x[1] - 1.0);
                m.zero(x[0] - x[2] - 0.5);
                m.optimal(1.0);
            },
        ),
        problem("dependent rows", "Rows stated twice, a variable fixed", |m| {
            let x = [m.var(-INF, INF, 0.0), m.var(-INF, INF, 0.0), m.var(0.5, 0.5, 0.0)];
            m.minimise(x[0].sq() + x[1].sq() + x[2].sq());
            m.row(3.0, x[0] + x[1] + x[2], 3.0);
            m.row(6.0, 2.0 * (x[0] + x[1] + x[2]), 6.0);
            m.optimal(3.375);
        }),
        problem("more equations than unknowns", "Two curves and a line through one point", |m| {
            let x = m.free(&[3.0, 0.5]);
            m.minimise(0.0 * x[0]);
            m.zero(x[0].sq() + x[1].sq() - 5.0);
            m.zero(x[0] * x[1] - 2.0);
            m.zero(x[0] - 2.0 * x[1]);
            m.optimal(0.0);
        }),
        problem("an empty disc", "No point has a negative square", |m| {
            let x = m.free(&[1.0, 2.0]);
            m.minimise(1.0 * x[0]);
            m.at_most(x[0].sq() + x[1].sq(), -1.0);
            m.infeasible();
        }),
        problem("no real root", "No point has a negative square", |m| {
            let x = m.var(-INF, INF, 3.0);
            m.minimise(1.0 * x);
            m.zero(x.sq() + 1.0);
            m.infeasible();
        }),
        problem("a line", "The objective falls for ever", |m| {
            let x = m.free(&[0.0, 0.0]);
            m.minimise(x[0] + x[1]);
            m.zero(x[0] - 2.0 * x[1]);
            m.unbounded();
        }),
    ]
}
