//! Bilevel programs: the lower level is replaced by its optimality conditions.

use super::{problem, Problem, Stat, INF};

const BARD: &str = "Bard: Convex two-level optimization, Math. Program. 40 (1988)";

pub fn all() -> Vec<Problem> {
    vec![
        problem("gauvin", "Shimizu, Aiyoshi (1981); Gauvin, Savard in MacMPEC", |m| {
            let (x, y, u) = (m.var(0.0, 15.0, 7.5), m.var(0.0, INF, 0.0), m.var(0.0, INF, 1.0));
            m.minimise(x.sq() + (y - 10.0).sq());
            m.pair(4.0 * (x + 2.0 * y - 30.0) + u, y);
            m.pair(20.0 - x - y, u);
            m.optimal(20.0).at(&[2.0, 14.0, 0.0], Stat::S);
        }),
        problem("shimizu-aiyoshi", "Shimizu, Aiyoshi, IEEE Trans. Autom. Control 26 (1981)", |m| {
            let (x, y) = (m.var(0.0, 15.0, 7.5), m.var(0.0, 20.0, 5.0));
            let u = m.positive(&[1.0, 1.0]);
            m.minimise(x.sq() + (y - 10.0).sq());
            m.at_least(x - y, 0.0);
            m.pair(y, 4.0 * (x + 2.0 * y - 30.0) + u[0] + u[1]);
            m.pair(20.0 - x - y, u[0]);
            m.pair(20.0 - y, u[1]);
            // the multipliers of the biactive pair are (6 η − 10, −η)
            m.optimal(100.0).at(&[10.0, 10.0, 0.0, 0.0], Stat::M);
        }),
        problem("bard1", BARD, |m| {
            let (x, y, u) = (m.var(0.0, INF, 0.0), m.var(0.0, INF, 0.0), m.free(&[0.0; 3]));
            m.minimise((x - 5.0).sq() + (2.0 * y + 1.0).sq());
            m.zero(2.0 * (y - 1.0) - 1.5 * x + u[0] - 0.5 * u[1] + u[2]);
            m.pair(3.0 * x - y - 3.0, u[0]);
            m.pair(0.5 * y - x + 4.0, u[1]);
            m.pair(7.0 - x - y, u[2]);
            m.optimal(17.0).at(&[1.0, 0.0, 3.5, 0.0, 0.0], Stat::S).local(&[25.0]);
        }),
        problem("bard2", BARD, |m| {
            let (x, y) = (m.vars(0.0, 20.0, &[5.0; 4]), m.positive(&[5.0; 4]));
            let u = m.positive(&[1.0; 4]);
            for (x, cap) in x.iter().zip([10.0, 5.0, 15.0, 20.0]) {
                m.at_most(*x, cap);
            }
            m.at_most(x[0] + x[1] + x[2] + x[3], 40.0);
            m.minimise(-(200.0 - y[0] - y[2]) * (y[0] + y[2]) - (160.0 - y[1] - y[3]) * (y[1] + y[3]));
            // two followers, each with two resources
            for (k, target) in [(0, [4.0, 13.0]), (2, [35.0, 2.0])] {
                m.pair(y[k], 2.0 * (y[k] - target[0]) + 0.4 * u[k] + 0.6 * u[k + 1]);
                m.pair(y[k + 1], 2.0 * (y[k + 1] - target[1]) + 0.7 * u[k] + 0.3 * u[k + 1]);
                m.pair(u[k], x[k] - 0.4 * y[k] - 0.7 * y[k + 1]);
                m.pair(u[k + 1], x[k + 1] - 0.6 * y[k] - 0.3 * y[k + 1]);
            }
            m.optimal(-6600.0).local(&[-253_871.0 / 45.0, -50_000.0 / 9.0]);
        }),
        problem("bard3", BARD, |m| {
            let (x, y, u) = (m.positive(&[1.0, 1.0]), m.positive(&[1.0, 1.0]), m.positive(&[1.0, 1.0]));
            m.minimise(-x[0].sq() - 3.0 * x[1] - 4.0 * y[0] + y[1].sq());
            m.at_most(x[0].sq() + 2.0 * x[1], 4.0);
            m.pair(y[0], 2.0 * y[0] + 2.0 * u[0] - 3.0 * u[1]);
            m.pair(y[1], -5.0 - u[0] + 4.0 * u[1]);
            m.pair(u[0], x[0].sq() - 2.0 * x[0] + x[1].sq() - 2.0 * y[0] + y[1] + 3.0);
            m.pair(u[1], x[1] + 3.0 * y[0] - 4.0 * y[1] - 4.0);
            // x = (0, 2), y = (15/8, 29/32)
            m.optimal(-6.0 - 7.5 + (29.0f64 / 32.0).powi(2)).local(&[-10.36]);
        }),
        problem("desilva", "de Silva: PhD thesis, George Washington University (1978)", |m| {
            let (x, y, u) = (m.vars(0.0, 2.0, &[0.0, 0.0]), m.free(&[0.0, 0.0]), m.positive(&[0.0, 0.0]));
            m.minimise(x[0].sq() - 2.0 * x[0] + x[1].sq() - 2.0 * x[1] + y[0].sq() + y[1].sq());
            for k in 0..2 {
                m.zero(2.0 * (y[k] - x[k]) + 2.0 * (y[k] - 1.0) * u[k]);
                m.pair(0.25 - (y[k] - 1.0).sq(), u[k]);
            }
            m.optimal(-1.0).at(&[0.5, 0.5, 0.5, 0.5, 0.0, 0.0], Stat::S);
        }),
        problem("falk-liu", "Falk, Liu: On bilevel programming, Math. Program. 70 (1995)", |m| {
            let (x, y) = (m.vars(0.0, 2.0, &[0.0, 0.0]), m.free(&[1.0, 1.0]));
            let (l, u) = (m.positive(&[0.0, 0.0]), m.positive(&[0.0, 0.0]));
            m.minimise(x[0].sq() - 2.0 * x[0] + x[1].sq() - 2.0 * x[1] + y[0].sq() + y[1].sq());
            for k in 0..2 {
                m.zero(2.0 * (y[k] - x[k]) - l[k] + u[k]);
                m.pair(y[k] - 0.5, l[k]);
                m.pair(1.5 - y[k], u[k]);
            }
            m.optimal(-1.0).at(&[0.5, 0.5, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0], Stat::S);
        }),
        problem("bilevel1", "Aiyoshi, Shimizu, IEEE Trans. Autom. Control 29 (1984)", |m| aiyoshi(m, 0.0)),
        problem("bilevel1, inner start", "Aiyoshi, Shimizu, IEEE Trans. Autom. Control 29 (1984)", |m| aiyoshi(m, 5.0)),
        problem("clark-westerberg", "Clark, Westerberg, Comput. Chem. Eng. 14 (1990)", |m| {
            let (x, y) = (m.var(0.0, 8.0, 4.0), m.var(-INF, INF, 3.0));
            let u = m.positive(&[0.0; 3]);
            m.minimise((x - 3.0).sq() + (y - 2.0).sq());
            m.zero(2.0 * (y - 5.0) + u[0] - 2.0 * u[1] + 2.0 * u[2]);
            m.pair(1.0 + 2.0 * x - y, u[0]);
            m.pair(2.0 - x + 2.0 * y, u[1]);
            m.pair(14.0 - x - 2.0 * y, u[2]);
            // y = 1 + 2x, y = 5, y = 7 − x/2
            m.optimal(5.0).at(&[1.0, 3.0, 4.0, 0.0, 0.0], Stat::S).local(&[9.0, 9.8, 26.0]);
        }),
        problem("candler-townsley", "Candler, Townsley, Comput. Oper. Res. 9 (1982)", |m| {
            let (x, y, u) = (m.positive(&[0.0, 0.0]), m.positive(&[0.0; 3]), m.positive(&[0.0; 3]));
            m.minimise(-8.0 * x[0] - 4.0 * x[1] + 4.0 * y[0] - 40.0 * y[1] - 4.0 * y[2]);
            m.pair(u[0], 1.0 + y[0] - y[1] - y[2]);
            m.pair(u[1], 1.0 - 2.0 * x[0] + y[0] - 2.0 * y[1] + 0.5 * y[2]);
            m.pair(u[2], 1.0 - 2.0 * x[1] - 2.0 * y[0] + y[1] + 0.5 * y[2]);
            m.pair(y[0], 1.0 - u[0] - u[1] + 2.0 * u[2]);
            m.pair(y[1], 1.0 + u[0] + 2.0 * u[1] - u[2]);
            m.pair(y[2], 2.0 + u[0] - 0.5 * u[1] - 0.5 * u[2]);
            m.optimal(-29.2).local(&[-23.0, -16.0, -13.0, -6.0]);
        }),
        problem(
            "liu-hart",
            "Liu, Hart: Characterizing an optimal solution to the linear bilevel problem (1994)",
            |m| {
                let (x, y, u) = (m.var(0.0, INF, 1.0), m.var(0.0, INF, 1.0), m.positive(&[0.0; 3]));
                m.minimise(-x - 3.0 * y);
                m.pair(y, 1.0 + u[0] + 2.0 * u[1] - u[2]);
                m.pair(u[0], 3.0 + x - y);
                m.pair(u[1], 12.0 - x - 2.0 * y);
                m.pair(u[2], 12.0 - 4.0 * x + y);
                m.optimal(-16.0).local(&[-3.0]);
            },
        ),
        problem("anandalingam-white", "Anandalingam, White, IEEE Trans. Autom. Control 35 (1990)", |m| {
            let (x, y, u) = (m.var(0.0, INF, 1.0), m.var(0.0, INF, 1.0), m.positive(&[0.0; 3]));
            m.minimise(x - 4.0 * y);
            m.pair(y, 1.0 + u[0] + 5.0 * u[1] - 3.0 * u[2]);
            m.pair(u[0], 2.0 * x - y);
            m.pair(u[1], 108.0 - 2.0 * x - 5.0 * y);
            m.pair(u[2], -4.0 - 2.0 * x + 3.0 * y);
            m.optimal(-37.0).local(&[-7.0]);
        }),
        problem(
            "bard linear",
            "Bard: Some properties of the bilevel programming problem, J. Optim. Theory Appl. 68 (1991)",
            |m| {
                let (x, y, u) = (m.var(0.0, INF, 1.0), m.var(0.0, INF, 1.0), m.positive(&[0.0; 4]));
                m.minimise(x + y);
                m.pair(y, -1.0 - 0.5 * u[0] + u[1] + 0.5 * u[2] - 2.0 * u[3]);
                m.pair(u[0], x + 0.5 * y - 2.0);
                m.pair(u[1], 2.0 + 0.25 * x - y);
                m.pair(u[2], 8.0 - x - 0.5 * y);
                m.pair(u[3], 2.0 - x + 2.0 * y);
                m.optimal(28.0 / 9.0).local(&[9.2, 88.0 / 9.0]);
            },
        ),
        problem(
            "yezza",
            "Yezza: First-order conditions for general two-level programs, J. Optim. Theory Appl. 89 (1996)",
            |m| {
                let (x, y, u) = (m.var(0.0, 1.0, 0.5), m.var(0.0, INF, 0.5), m.positive(&[0.0, 0.0]));
                m.minimise(-(4.0 * x - 3.0) * y + 2.0 * x + 1.0);
                m.zero(4.0 * x - 1.0 - u[0] + u[1]);
                m.pair(y, u[0]);
                m.pair(1.0 - y, u[1]);
                m.optimal(1.5);
            },
        ),
        problem(
            "dempe-franke",
            "Dempe, Dutta: Is bilevel programming a special case of an MPEC?, Math. Program. 131 (2012)",
            |m| {
                let (x, y, u) = (m.var(-INF, INF, 0.0), m.var(-INF, INF, 0.0), m.positive(&[0.5, 0.5]));
                m.minimise((x - 1.0).sq() + (y - 1.0).sq());
                m.zero(u[0] + u[1] - 1.0);
                m.pair(1.0 - x - y, u[0]);
                m.pair(1.0 + x - y, u[1]);
                // every multiplier but (1, 0) makes (0, 1) a local minimiser
                m.optimal(0.5).at(&[0.5, 0.5, 1.0, 0.0], Stat::S).local(&[1.0]);
            },
        ),
        problem("signed projection", "The lower level is the projection onto [0, 1]; after Bard (1988)", |m| {
            let (x, y, l) = (m.var(-INF, INF, 0.5), m.var(0.0, INF, 0.5), m.positive(&[0.1, 0.1]));
            m.minimise((x - 2.0).sq() + (y - 0.5).sq());
            m.zero(2.0 * (y - x) - l[0] + l[1]);
            m.pair(l[0], y);
            m.pair(l[1], 1.0 - y);
            m.optimal(0.25).at(&[2.0, 1.0, 0.0, 2.0], Stat::S);
        }),
    ]
}

fn aiyoshi(m: &mut super::Model, start: f64) {
    let (x, y, u) = (m.vars(0.0, 50.0, &[start; 2]), m.free(&[start; 2]), m.positive(&[start; 6]));
    m.minimise(2.0 * x[0] + 2.0 * x[1] - 3.0 * y[0] - 3.0 * y[1] - 60.0);
    m.at_most(x[0] + x[1] + y[0] - 2.0 * y[1], 40.0);
    for k in 0..2 {
        m.zero(2.0 * (y[k] - x[k]) + 40.0 - (u[2 * k] - u[2 * k + 1] - 2.0 * u[4 + k]));
        m.pair(y[k] + 10.0, u[2 * k]);
        m.pair(20.0 - y[k], u[2 * k + 1]);
        m.pair(x[k] - 2.0 * y[k] - 10.0, u[4 + k]);
    }
    m.optimal(0.0).local(&[5.0, 10.0, 15.0]);
}
