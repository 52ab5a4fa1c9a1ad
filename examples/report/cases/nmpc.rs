//! Model predictive control: costs of closed loops beside those another implementation reaches, times of preparation and
//! feedback.

use crate::json::{Object, Table};
use crate::Context;
use switchback::nmpc::{Level, Options, Scheme};

// the tests use more of it
#[allow(dead_code)]
#[path = "../../../tests/common/nmpc.rs"]
mod problems;

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
}
