//! Expressions beside hand-written callbacks: time of one evaluation, of batches, and of a whole solve.

use super::{settings, short, simulate};
use crate::expression_models as written;
use crate::json::{Object, Table};
use crate::models as by_hand;
use crate::Context;
use std::hint::black_box;
use std::time::Instant;
use switchback::expr::{ExprFunction, Tape, LANES};
use switchback::func::{Function, Point};
use switchback::model::Built;
use switchback::nlp::Control;
use switchback::ocp::Ocp;
use switchback::settings::{Discretisation, RkFamily, Settings};
use switchback::system::System;

/// Solves of either kind, by turns.
const REPEAT: usize = 31;
/// Points of a batch.
const N: usize = 64;

struct Problem {
    name: &'static str,
    by_hand: System,
    written: Built,
    x0: Vec<f64>,
    t_end: f64,
    n_sim: usize,
}

fn problems() -> Vec<Problem> {
    vec![
        Problem {
            name: "oscillator",
            by_hand: by_hand::oscillator(),
            written: written::oscillator(),
            x0: by_hand::OSCILLATOR_X0.to_vec(),
            t_end: by_hand::PI / 2.0,
            n_sim: 30,
        },
        Problem {
            name: "sliding mode",
            by_hand: by_hand::sliding_mode(),
            written: written::sliding_mode(),
            x0: vec![1.0, 0.4, 0.0, 0.0],
            t_end: 1.0,
            n_sim: 40,
        },
        Problem {
            name: "blocks",
            by_hand: by_hand::blocks(),
            written: written::blocks(),
            x0: vec![-1.0, 1.0, -1.0, 1.0, 1.0, 0.5],
            t_end: 3.0,
            n_sim: 40,
        },
        Problem {
            name: "coulomb",
            by_hand: by_hand::coulomb(),
            written: written::coulomb(),
            x0: vec![1.0, 0.0],
            t_end: 4.0,
            n_sim: 60,
        },
        Problem {
            name: "stick-slip",
            by_hand: by_hand::stick_slip(),
            written: written::stick_slip(),
            x0: vec![0.5, 0.0],
            t_end: 4.0,
            n_sim: 60,
        },
    ]
}

/// Nanoseconds of one run, the best of several.
fn time(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..15 {
        let clock = Instant::now();
        for _ in 0..400 {
            run();
        }
        best = best.min(clock.elapsed().as_secs_f64() / 400.0);
    }
    1e9 * best
}

/// Nanoseconds of value, Jacobian and Hessian of all functions of a system.
fn single(s: &System, x: &[f64]) -> f64 {
    let mut functions: Vec<&dyn Function> = s.f0().into_iter().map(|f| f.as_ref()).collect();
    for sub in s.subsystems() {
        functions.push(sub.modes.as_ref());
        if let switchback::system::Regions::Signs { psi, .. } = &sub.regions {
            functions.push(psi.as_ref());
        }
    }
    let u = vec![0.3; s.dims().u];
    let at = Point { t: 0.4, x, u: &u, p: &[] };
    let evaluate = |f: &dyn Function| {
        let mut work = vec![0.0; f.work_len()];
        let mut out = vec![0.0; f.n_out().max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz())];
        let weights = vec![0.7; f.n_out()];
        time(|| {
            let at = black_box(&at);
            let ok = f.value(at, &mut out, &mut work).is_ok()
                && (f.jac_pattern().nnz() == 0 || f.jacobian(at, &mut out, &mut work).is_ok())
                && (f.hess_pattern().nnz() == 0 || f.hessian(at, &weights, &mut out, &mut work).is_ok());
            black_box((ok, &mut out));
        })
    };
    functions.into_iter().map(evaluate).sum()
}

/// Nanoseconds per point of all programs of a model: one point at a time, and in batches.
fn batch(functions: &[std::sync::Arc<ExprFunction>], x: &[f64]) -> (f64, f64) {
    let (mut scalar, mut lanes) = (0.0, 0.0);
    for f in functions {
        let d = f.dims();
        let u = vec![0.3; d.u];
        let at = Point { t: 0.4, x, u: &u, p: &[] };
        let tapes: [(&Tape, usize); 3] = [(f.value_tape(), 0), (f.jacobian_tape(), 0), (f.hessian_tape(), f.n_out())];
        for (tape, n_weights) in tapes {
            let weights = vec![0.7; n_weights];
            let mut out = vec![0.0; tape.n_out() * N];
            let mut work = vec![[0.0; LANES]; tape.work_len()];
            let z: Vec<f64> = x.iter().chain(&u).chain(&[0.4]).chain(&weights).copied().collect();
            let inputs: Vec<f64> = z.iter().flat_map(|&v| [v; N]).collect();
            scalar += time(|| {
                black_box(tape.run(black_box(&at), &weights, &mut out, work.as_flattened_mut()).is_ok());
            });
            lanes += time(|| {
                black_box(tape.run_batch(N, black_box(&inputs), &mut out, &mut work).is_ok());
            }) / N as f64;
        }
    }
    (scalar, lanes)
}

/// Runs both ways by turns: the best seconds of each, and the median of the ratios, which a busy machine spoils least.
fn by_turns(mut run: impl FnMut() -> [f64; 2]) -> ([f64; 2], f64) {
    let all: Vec<[f64; 2]> = (0..REPEAT).map(|_| run()).collect();
    let best = |k: usize| all.iter().map(|w| w[k]).fold(f64::INFINITY, f64::min);
    let mut ratios: Vec<f64> = all.iter().map(|w| w[1] / w[0]).collect();
    ratios.sort_by(f64::total_cmp);
    ([best(0), best(1)], ratios[REPEAT / 2])
}

/// Seconds of the sliding-mode problem, building excluded, its cost, and the iterations.
fn optimal_control(set: &Settings, expressions: bool) -> (f64, f64, usize) {
    let mut o = if expressions {
        let built = written::sliding_mode();
        let mut o = Ocp::new(&built.system, 4.0, 6, set).expect("the settings fit");
        o.set_lagrange(written::sliding_cost()).expect("L fits");
        o.set_x0(&by_hand::SLIDING_X0).expect("four states");
        let inf = by_hand::INF;
        o.set_x_bounds(&[-inf, -inf, -2.0, -2.0], &[inf, inf, 2.0, 2.0]).expect("four states");
        o.set_u_bounds(&[-10.0; 2], &[10.0; 2]).expect("two controls");
        let e = by_hand::affine("e", built.system.dims(), &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
        o.add_terminal(e, &by_hand::SLIDING_QT, &by_hand::SLIDING_QT).expect("e fits");
        o
    } else {
        by_hand::sliding_ocp(set)
    };
    let clock = Instant::now();
    let r = o.solve(&mut Control::default()).expect("the problem is well posed");
    (clock.elapsed().as_secs_f64(), r.cost, r.stats.iterations)
}

pub fn run(c: &Context) {
    let mut table = Table::new(&[
        "model",
        "callbacks ns",
        "expressions ns",
        "ratio",
        "batch ns/point",
        "batch speed-up",
        "solve callbacks s",
        "solve expressions s",
        "ratio",
        "distance",
    ]);
    let set = settings(RkFamily::RadauIia, 2, 3, Discretisation::Fesd);
    for p in problems() {
        let (hand, expr) = (single(&p.by_hand, &p.x0), single(&p.written.system, &p.x0));
        let (scalar, lanes) = batch(&p.written.functions, &p.x0);
        let mut ends = [Vec::new(), Vec::new()];
        let pair = || {
            [&p.by_hand, &p.written.system].map(|s| {
                let (_, x, wall) = simulate(s, &set, &p.x0, p.t_end, p.n_sim);
                (wall, x)
            })
        };
        let (walls, ratio) = by_turns(|| {
            let [a, b] = pair();
            ends = [a.1, b.1];
            [a.0, b.0]
        });
        let distance = super::distance(&ends[0], &ends[1]);
        c.record(
            &Object::new()
                .text("case", "model-eval")
                .text("model", p.name)
                .num("callbacks_ns", hand)
                .num("expressions_ns", expr)
                .num("evaluation_ratio", expr / hand)
                .num("tape_ns", scalar)
                .num("batch_ns", lanes)
                .num("solve_callbacks_s", walls[0])
                .num("solve_expressions_s", walls[1])
                .num("solve_ratio", ratio)
                .num("distance", distance),
        );
        table.row(vec![
            p.name.into(),
            format!("{hand:.0}"),
            format!("{expr:.0}"),
            format!("{:.2}", expr / hand),
            format!("{lanes:.1}"),
            format!("{:.1}", scalar / lanes),
            format!("{:.4}", walls[0]),
            format!("{:.4}", walls[1]),
            format!("{ratio:.3}"),
            short(distance),
        ]);
    }
    let set = settings(RkFamily::RadauIia, 2, 2, Discretisation::Fesd);
    let mut costs = [0.0; 2];
    let mut iterations = 0;
    let (walls, ratio) = by_turns(|| {
        let (hand, expr) = (optimal_control(&set, false), optimal_control(&set, true));
        costs = [hand.1, expr.1];
        iterations = expr.2;
        [hand.0, expr.0]
    });
    let distance = (costs[0] - costs[1]).abs();
    c.record(
        &Object::new()
            .text("case", "model-eval")
            .text("model", "sliding ocp")
            .num("solve_callbacks_s", walls[0])
            .num("solve_expressions_s", walls[1])
            .num("solve_ratio", ratio)
            .num("distance", distance)
            .int("iterations", iterations),
    );
    let mut row = vec!["sliding ocp".to_string()];
    row.extend(vec![String::new(); 5]);
    row.extend([format!("{:.4}", walls[0]), format!("{:.4}", walls[1]), format!("{ratio:.3}"), short(distance)]);
    table.row(row);
    c.say("Expressions beside hand-written callbacks with exact derivatives; all functions of a model, values to Hessians");
    c.say(&table.text());
}
