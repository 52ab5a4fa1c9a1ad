//! Automata and hysteresis: errors against closed forms over all tolerances, and what a switch costs beside an ordinary step of
//! the same system.

use super::short;
use crate::automata_models::{gear_box, relay, rooms, thermostat, two_tanks, AUTOMATA};
use crate::json::{Object, Table};
use crate::Context;
use serde_json::Value;
use std::time::Instant;
use switchback::event::{Engine, Options, Outcome, Run};
use switchback::model::Built;

/// Numbers of any depth, which references write as text where they have more digits than a double.
fn numbers(v: &Value) -> Vec<f64> {
    let one = |v: &Value| v.as_f64().or_else(|| v.as_str().and_then(|s| s.parse().ok())).unwrap_or(f64::NAN);
    v.as_array().map_or_else(|| vec![one(v)], |a| a.iter().flat_map(numbers).collect())
}

/// The reference of this name; panics where the file is missing or is no JSON.
fn reference(name: &str) -> Value {
    let path = format!("{}/tests/data/reference/scenes/{name}.json", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Largest difference relative to the largest value, at least 1.
fn off(found: &[f64], exact: &[f64]) -> f64 {
    if found.len() != exact.len() {
        return f64::INFINITY;
    }
    let size = exact.iter().fold(1.0f64, |m, v| m.max(v.abs()));
    found.iter().zip(exact).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
}

fn engine(b: &Built, opt: &Options, x0: &[f64], p: &[f64], t: f64) -> (Engine, Vec<f64>) {
    let mut e = Engine::new(&b.system, opt).expect("the options fit");
    let start = [x0, b.discrete()].concat();
    go(&mut e, &start, p, t);
    (e, start)
}

fn go(e: &mut Engine, start: &[f64], p: &[f64], t: f64) {
    e.reinit(0.0, start).expect("the state fits");
    e.set_params(p).expect("the parameters fit");
    e.advance(t).expect("no function asks to stop");
}

fn accuracy(c: &Context) {
    let head =
        ["problem", "rtol", "error/rtol", "switch/rtol", "found", "dx error", "dt error", "steps", "outcome", ""];
    let mut table = Table::new(&head);
    for (problem, build) in AUTOMATA {
        let (b, r) = (build(), reference(problem));
        let (x0, p, t) = (numbers(&r["x0"]), numbers(&r["p"]), numbers(&r["T"])[0]);
        let exact = numbers(&r["switches"]);
        for e in 4..=12 {
            let rtol = 10f64.powi(-e);
            let opt = Options { sensitivity: true.into(), ..Options::with_tolerance(rtol, rtol) };
            let s = engine(&b, &opt, &x0, &p, t).0.into_run();
            let error = off(&s.x[..x0.len()], &numbers(&r["x_T"]));
            let times: Vec<f64> = s.jumps.iter().map(|j| j.t).collect();
            let switch = off(&times, &exact);
            let (dx, dt) = derivatives(&s, &r, x0.len(), p.len());
            let ok = s.outcome == Outcome::Reached && error.max(switch) <= 100.0 * rtol;
            table.row(vec![
                problem.into(),
                format!("{rtol:e}"),
                short(error / rtol),
                short(switch / rtol),
                format!("{}/{}", s.jumps.len(), exact.len()),
                short(dx),
                short(dt),
                s.stats.steps.to_string(),
                s.outcome.name().into(),
                if ok { "ok" } else { "MISSED" }.into(),
            ]);
            let o = Object::new().text("case", "automata").text("record", "accuracy").text("problem", problem);
            let o = o.num("rtol", rtol).num("error", error).num("switch_error", switch).int("switches", s.jumps.len());
            let o = o.num("sensitivity_error", dx).num("switch_sensitivity_error", dt).int("steps", s.stats.steps);
            c.record(&o.flag("ok", ok).text("outcome", s.outcome.name()));
        }
    }
    c.say("automata with solutions in closed form, errors relative to the tolerance (asked: at most 100)");
    c.say(&table.text());
}

/// Errors of the derivatives of the final state and of the switching times with respect to initial states and parameters.
fn derivatives(s: &Run, r: &Value, n: usize, np: usize) -> (f64, f64) {
    let nx = s.x.len();
    let columns = |row: &[f64]| [&row[..n], &row[nx..nx + np]].concat();
    let exact = |x: &str, p: &str| -> Vec<f64> {
        let rows = |name: &str| r[name].as_array().map_or_else(Vec::new, |a| a.iter().map(numbers).collect::<Vec<_>>());
        rows(x).iter().zip(rows(p)).flat_map(|(x, p)| [&x[..], &p].concat()).collect()
    };
    let d = s.sensitivity.as_deref().unwrap_or_default();
    let found: Vec<f64> = d.chunks_exact(nx + np).take(n).flat_map(columns).collect();
    let times: Vec<f64> = s.jumps.iter().flat_map(|j| columns(&j.dt)).collect();
    (off(&found, &exact("dxT_dx0", "dxT_dp")), off(&times, &exact("dt_dx0", "dt_dp")))
}

/// A system, where it starts, parameters with which it switches and with which it never does, and how long.
type Costs = (&'static str, Built, Vec<f64>, Vec<f64>, Vec<f64>, f64);

fn seconds(mut run: impl FnMut()) -> f64 {
    let clock = Instant::now();
    run();
    clock.elapsed().as_secs_f64()
}

fn cost(c: &Context) {
    // thresholds that are out of reach: the guards are watched as before
    let quiet_tanks = vec![1.5, 0.4, 0.25, 0.3, -1e3, 1e3, 1e3, 0.9];
    let cases: Vec<Costs> = vec![
        ("thermostat", thermostat(), vec![19.0], vec![0.2, 5.0, 18.0, 20.0], vec![0.2, 5.0, 18.0, 1e3], 200.0),
        ("relay", relay(), vec![0.1], vec![0.5], vec![1e3], 200.0),
        ("two tanks", two_tanks(), vec![1.1, 0.2], vec![1.5, 0.4, 0.25, 0.3, 1.0, 2.0, 1.4, 0.9], quiet_tanks, 200.0),
        ("gear box", gear_box(), vec![1.0, 0.0, 0.0], vec![4.0, 0.1, 0.03, 0.01], vec![0.5, 0.2, 0.03, 0.01], 600.0),
        ("10 rooms", rooms(10), vec![19.0; 10], vec![18.0, 20.0], vec![-1e3, 1e3], 50.0),
    ];
    let head = [
        "system",
        "rtol",
        "switches",
        "steps/switch",
        "evaluations/switch",
        "us/step",
        "us/switch",
        "in steps",
        "by evaluations",
        "",
    ];
    let mut table = Table::new(&head);
    for (name, b, x0, p, quiet, t) in cases {
        for rtol in [1e-6, 1e-9] {
            let opt = Options::with_tolerance(rtol, rtol);
            let (mut e, start) = engine(&b, &opt, &x0, &p, t);
            let n = e.jumps().len() as f64;
            let stats = e.stats();
            // ordinary steps: the same system without switches, with steps as long as those between the switches
            let even = Options { h_max: t / stats.steps as f64, ..opt };
            let (mut plain, _) = engine(&b, &even, &x0, &quiet, t);
            assert!(plain.jumps().is_empty(), "{name} switches where it should not");
            // the shortest of many single runs, by turns: other work on the machine disturbs both alike, and not all of them
            let (mut whole, mut alone) = (f64::INFINITY, f64::INFINITY);
            for _ in 0..300 {
                whole = whole.min(seconds(|| go(&mut e, &start, &p, t)));
                alone = alone.min(seconds(|| go(&mut plain, &start, &quiet, t)));
            }
            let (ordinary, made) = ((plain.stats().steps as f64, plain.stats().evaluations as f64), stats.steps as f64);
            let step = alone / ordinary.0;
            let switch = (whole - made * step) / n;
            let in_steps = switch / step;
            let each = ordinary.1 / ordinary.0;
            let in_evaluations = (stats.evaluations as f64 - made * each) / n / each;
            let ok = in_steps <= 5.0;
            table.row(vec![
                name.into(),
                format!("{rtol:e}"),
                format!("{n}"),
                format!("{:.1}", stats.steps as f64 / n),
                format!("{:.1}", stats.evaluations as f64 / n),
                format!("{:.3}", step * 1e6),
                format!("{:.3}", switch * 1e6),
                format!("{in_steps:.1}"),
                format!("{in_evaluations:.1}"),
                if ok { "ok" } else { "MISSED" }.into(),
            ]);
            let o =
                Object::new().text("case", "automata").text("record", "cost").text("problem", name).num("rtol", rtol);
            let o = o.int("switches", e.jumps().len()).int("steps", stats.steps).int("evaluations", stats.evaluations);
            let o = o.num("seconds_per_step", step).num("seconds_per_switch", switch);
            let o = o.num("switch_in_steps", in_steps).num("switch_in_steps_by_evaluations", in_evaluations);
            c.record(&o.flag("ok", ok));
        }
    }
    c.say("what a switch costs beyond the steps that are made anyway, in ordinary steps of the same system (asked: at most 5)");
    c.say(&table.text());
}

pub fn run(c: &Context) {
    accuracy(c);
    cost(c);
}
