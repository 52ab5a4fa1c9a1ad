//! Scenes with contacts in the event-driven engine: every reference over all tolerances, with errors of states, events and
//! derivatives, and what a run costs.

#[path = "../../../tests/common/scenes.rs"]
#[allow(dead_code)]
mod references;

use self::references::{cases, event_times, Case};
use super::short;
use crate::json::{Object, Table};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::event::{Engine, Options, Outcome};

const RTOL: [f64; 5] = [1e-4, 1e-6, 1e-8, 1e-10, 1e-12];
/// Runs of which the fastest counts.
const RUNS: usize = 20;

/// Largest difference, relative to one and to the numbers; infinite where their number differs.
fn off(found: &[f64], exact: &[f64]) -> f64 {
    if found.len() != exact.len() {
        return f64::INFINITY;
    }
    found.iter().zip(exact).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

pub fn run(c: &Context) {
    let mut table = Table::new(&[
        "scene",
        "rtol",
        "state",
        "events",
        "derivatives",
        "impacts",
        "switches",
        "steps",
        "evaluations",
        "us",
    ]);
    let mut plot = Plot::new("Scenes with contacts", "microseconds", "error of the state").log_log();
    let mut worst = 0.0f64;
    for case in cases() {
        let mut points = Vec::new();
        for rtol in RTOL.into_iter().filter(|r| *r <= case.coarsest) {
            let o = one(&case, rtol);
            worst = worst.max(o.state / rtol);
            points.push((o.micros, o.state.max(1e-17)));
            c.record(
                &Object::new()
                    .text("case", "scenes")
                    .text("scene", case.name)
                    .num("rtol", rtol)
                    .num("error_state", o.state)
                    .num("error_events", o.events)
                    .num("error_derivatives", o.derivatives)
                    .int("impacts", o.engine.impacts().len())
                    .int("switches", o.engine.switches().len())
                    .int("steps", o.engine.stats().steps)
                    .int("evaluations", o.engine.stats().evaluations)
                    .num("wall_s", 1e-6 * o.micros)
                    .flag("reached", o.engine.outcome() == Outcome::Reached),
            );
            table.row(vec![
                case.name.into(),
                short(rtol),
                short(o.state),
                if case.events.is_empty() { "-".into() } else { short(o.events) },
                if case.derivatives.is_empty() { "-".into() } else { short(o.derivatives) },
                o.engine.impacts().len().to_string(),
                o.engine.switches().len().to_string(),
                o.engine.stats().steps.to_string(),
                o.engine.stats().evaluations.to_string(),
                format!("{:.1}", o.micros),
            ]);
        }
        plot.add(case.name, Mark::LineDots, points);
    }
    c.say("errors relative to 1 + the value; us: the fastest of 20 runs without derivatives");
    c.say(&table.text());
    c.say(&format!("largest error of a state in units of rtol: {}", short(worst)));
    c.plot(&plot, "scenes.svg");
}

/// One run with all that is compared.
struct Run {
    engine: Engine,
    state: f64,
    events: f64,
    derivatives: f64,
    micros: f64,
}

fn one(case: &Case, rtol: f64) -> Run {
    let go = |sensitivity: bool| {
        let options = Options { sensitivity: sensitivity.into(), ..Options::with_tolerance(rtol, rtol) };
        let mut e = Engine::new(&case.system, &options).expect("the options fit");
        let mut best = f64::INFINITY;
        for _ in 0..if sensitivity { 1 } else { RUNS } {
            let clock = Instant::now();
            e.reinit(0.0, &case.x0).expect("the state fits");
            e.set_params(&case.p).expect("the parameters fit");
            e.advance(case.t).expect("no function asks to stop");
            best = best.min(clock.elapsed().as_secs_f64());
        }
        (e, 1e6 * best)
    };
    let (with, _) = go(true);
    let (engine, micros) = go(false);
    let n_c = case.x0.len() + case.p.len();
    let s = with.sensitivity().unwrap_or(&[]);
    let own: Vec<f64> = s.chunks_exact(n_c).flat_map(|row| row[..case.x0.len()].to_vec()).collect();
    let times = event_times(engine.impacts().iter().map(|i| i.t), engine.switches().iter().map(|s| s.t));
    Run {
        state: off(engine.state(), &case.x),
        events: if case.events.is_empty() { 0.0 } else { off(&times, &case.events) },
        derivatives: if case.derivatives.is_empty() { 0.0 } else { off(&own, &case.derivatives) },
        engine,
        micros,
    }
}
