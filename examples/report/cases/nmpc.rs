//! Model predictive control: costs of closed loops beside those another implementation reaches, times of preparation and
//! feedback.

use crate::json::{Object, Table};
use crate::Context;
use switchback::nmpc::{Level, Options, Scheme};

// the tests use more of it
#[allow(dead_code)]
#[path = "../../../tests/common/nmpc.rs"]
mod problems;

// the tests use more of it
#[allow(dead_code)]
#[path = "../../../tests/common/stick_slip.rs"]
mod stick_slip;

use problems::{chain, pendulum, scheme, Case};

/// Loops whose shortest times are kept.
const REPETITIONS: usize = 5;

/// Scheme, level, inner iterations, the cost that is known; NaN where none is.
type Row = (&'static str, Scheme, Level, usize, f64);

fn rows(name: &str) -> Vec<Row> {
    let rti = |j| ("RTI", Scheme::Rti, Level::D0, 0, j);
    let inner = |what, level, n, j| (what, Scheme::AsRti, level, n, j);
    let ideal = |j| ("ideal", Scheme::Asc, Level::D0, 100, j);
    match name {
        "pendulum" => vec![
            rti(50.527637),
            inner("AS-RTI-D-1", Level::D0, 1, 42.949317),
            inner("AS-RTI-D-2", Level::D0, 2, 42.9678),
            inner("AS-RTI-A", Level::A, 1, 43.0446),
            inner("AS-RTI-B-1", Level::B, 1, 43.0461),
            inner("AS-RTI-B-3", Level::B, 3, 42.9431),
            inner("AS-RTI-C-1", Level::C, 1, 42.9791),
            inner("AS-RTI-C-3", Level::C, 3, 42.9606),
            ideal(42.968375),
        ],
        "chain3" => vec![
            rti(28.066576),
            inner("AS-RTI-D-1", Level::D0, 1, 28.056979),
            inner("AS-RTI-D-2", Level::D0, 2, 28.0570),
            ideal(28.057042),
        ],
        _ => vec![
            rti(53.058806),
            inner("AS-RTI-D-1", Level::D0, 1, 52.870885),
            inner("AS-RTI-A", Level::A, 1, 52.8708),
            inner("AS-RTI-B-3", Level::B, 3, 52.8680),
            inner("AS-RTI-C-3", Level::C, 3, 52.8673),
            ideal(52.867116),
        ],
    }
}

/// The cost, and of every sample the shortest preparation and feedback of several loops.
fn measure(case: &Case, options: &Options, repetitions: usize) -> (f64, Vec<[f64; 2]>) {
    let mut best: Vec<[f64; 2]> = Vec::new();
    let mut cost = f64::NAN;
    for _ in 0..repetitions {
        let done = case.run(options);
        cost = done.cost;
        if best.is_empty() {
            best = done.times;
            continue;
        }
        for (best, new) in best.iter_mut().zip(&done.times) {
            *best = [best[0].min(new[0]), best[1].min(new[1])];
        }
    }
    (cost, best)
}

pub fn run(context: &Context) {
    let head = ["problem", "scheme", "cost", "known", "prepare us", "feedback us", "worst us"];
    let mut table = Table::new(&head);
    let chosen: &[&str] = if context.all { &["pendulum"] } else { &["pendulum", "chain3", "chain6"] };
    for &name in chosen {
        let case = match name {
            "pendulum" => pendulum(),
            "chain3" => chain(3),
            _ => chain(6),
        };
        for (what, kind, level, inner, known) in rows(name) {
            let options = scheme(kind, level, inner);
            let repetitions = if kind == Scheme::Asc || context.all { 1 } else { REPETITIONS };
            let (cost, times) = measure(&case, &options, repetitions);
            let mean = |k: usize| 1e6 * times.iter().map(|t| t[k]).sum::<f64>() / times.len() as f64;
            let worst = 1e6 * times.iter().fold(0.0f64, |m, t| m.max(t[1]));
            table.row(vec![
                name.into(),
                what.into(),
                format!("{cost:.7}"),
                format!("{known}"),
                format!("{:.1}", mean(0)),
                format!("{:.2}", mean(1)),
                format!("{worst:.2}"),
            ]);
            let o = Object::new().text("case", "nmpc").text("problem", name).text("scheme", what);
            let o = o.num("cost", cost).num("known", known).num("relative_error", (cost - known).abs() / known);
            context.record(&o.num("prepare_us", mean(0)).num("feedback_us", mean(1)).num("worst_feedback_us", worst));
        }
    }
    context.say(&table.text());
    run_switching(context);
}

/// Problems with dry friction, with the costs prototypes reach: fixed modes with two break-away branches.
fn run_switching(context: &Context) {
    let head = [
        "problem",
        "scheme",
        "cost",
        "known",
        "prepare us",
        "with 4 alternatives us",
        "feedback us",
        "worst us",
        "taken",
    ];
    let mut table = Table::new(&head);
    let schemes = [("RTI", Scheme::Rti, 0), ("AS-RTI-D-1", Scheme::AsRti, 1), ("AS-RTI-D-3", Scheme::AsRti, 3)];
    for (name, known) in [("cart_pole", 357.23), ("two_masses", 81.18)] {
        let case = if name == "cart_pole" { stick_slip::cart_pole(3.0) } else { stick_slip::two_masses(1.0) };
        for (what, kind, inner) in schemes {
            let options = stick_slip::options(kind, inner);
            let done = case.run(&options, &stick_slip::Disturbance::default());
            let mut times = done.times;
            for _ in 1..if context.all { 1 } else { REPETITIONS } {
                let again = case.run(&options, &stick_slip::Disturbance::default()).times;
                times.iter_mut().zip(&again).for_each(|(t, new)| *t = [t[0].min(new[0]), t[1].min(new[1])]);
            }
            let mean = |v: &mut dyn Iterator<Item = f64>| -> f64 {
                let (sum, n) = v.fold((0.0, 0), |(s, n), t| (s + 1e6 * t, n + 1));
                sum / f64::from(n)
            };
            let (prepare, feedback) = (mean(&mut times.iter().map(|t| t[0])), mean(&mut times.iter().map(|t| t[1])));
            let full = times.iter().zip(&done.alternatives).filter(|e| *e.1 == 4);
            let four = mean(&mut full.map(|e| e.0[0]));
            let worst = 1e6 * times.iter().fold(0.0f64, |m, t| m.max(t[1]));
            let m = done.controller.monitor();
            let numbers = [format!("{:.4}", done.cost), format!("{known}")];
            let rest = [prepare, four, feedback, worst].map(|t| format!("{t:.2}"));
            let row = [name.to_string(), what.to_string()].into_iter().chain(numbers).chain(rest);
            table.row(row.chain([m.flips.to_string()]).collect());
            let o = Object::new().text("case", "nmpc").text("problem", name).text("scheme", what);
            let o = o.num("cost", done.cost).num("known", known).num("prepare_us", prepare).num("prepare_4_us", four);
            let o = o
                .num("feedback_us", feedback)
                .num("worst_feedback_us", worst)
                .num("alternatives_taken", m.flips as f64);
            context.record(&o.num("unsolved", (m.sources.iter().sum::<u64>() - m.sources[0]) as f64));
        }
    }
    context.say(&table.text());
}
