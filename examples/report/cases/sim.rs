//! The event-driven engine: every reference problem over all tolerances, and work against precision on the
//! oscillator (4.4) beside a special case written by hand.

use super::short;
use crate::fast_oscillator;
use crate::json::{Object, Table};
use crate::models::*;
use crate::reference::{self, Reference};
use crate::Context;
use std::time::Instant;
use switchback::event::{Engine, Kind, Method, Options, Outcome, Run};
use switchback::settings::{Discretisation, RkFamily};
use switchback::system::System;

/// The models of the references, with their controls.
pub fn problems() -> Vec<(&'static str, System, Vec<f64>)> {
    vec![
        ("crossing", switching('a'), vec![]),
        ("sliding", switching('b'), vec![]),
        ("leaving", switching('c'), vec![]),
        ("oscillator", oscillator(), vec![]),
        ("codim2", sliding_mode(), vec![-0.5, -0.4]),
        ("blocks", blocks(), vec![]),
        ("coulomb", coulomb(), vec![]),
        ("stickslip1", stick_slip(), vec![]),
        ("zeno_T0999", zeno(), vec![]),
        ("zeno_post", zeno(), vec![]),
    ]
}

/// Name of a switch in the references.
fn name(k: Kind, subsystem: usize) -> String {
    let name = match k {
        Kind::Cross => "cross",
        Kind::Enter => "enter_sliding",
        Kind::Leave => "leave_sliding",
        Kind::Spontaneous => "spontaneous",
        _ => "another",
    };
    format!("{name}[{subsystem}]")
}

/// Largest difference relative to the largest value, at least 1.
fn off(found: &[f64], exact: &[f64]) -> f64 {
    if found.len() != exact.len() {
        return f64::INFINITY;
    }
    let size = exact.iter().fold(1.0f64, |m, v| m.max(v.abs()));
    found.iter().zip(exact).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
}

fn simulate(sys: &System, u: &[f64], x0: &[f64], t: f64, opt: &Options) -> (Run, f64) {
    let mut best = f64::INFINITY;
    let mut e = Engine::new(sys, opt).expect("the options fit");
    for _ in 0..5 {
        let clock = Instant::now();
        e.reinit(0.0, x0).expect("the state fits");
        e.set_controls(u).expect("the controls fit");
        e.advance(t).expect("no function asks to stop");
        best = best.min(clock.elapsed().as_secs_f64());
    }
    (e.into_run(), best)
}

fn accuracy(c: &Context) {
    let head =
        ["problem", "rtol", "error/rtol", "switch/rtol", "found", "dx error", "dt error", "us", "steps", "rejected"];
    let mut table = Table::new(&[&head[..], &["relocated", "evaluations", "outcome", ""]].concat());
    for (problem, sys, u) in problems() {
        let r = reference::load(problem);
        for e in 4..=12 {
            let rtol = 10f64.powi(-e);
            let opt = Options::with_tolerance(rtol, rtol);
            let (s, seconds) = simulate(&sys, &u, &r.x0, r.t_end, &opt);
            let with = Options { sensitivity: true.into(), ..opt };
            let (d, _) = simulate(&sys, &u, &r.x0, r.t_end, &with);
            let error = off(&s.x, &r.x_end);
            let times: Vec<f64> = s.switches.iter().map(|s| s.t).collect();
            let exact: Vec<f64> = r.switches.iter().map(|s| s.0).collect();
            // beyond an accumulation the switches are not numbered
            let listed = !exact.is_empty();
            let switch = if listed { off(&times, &exact) } else { 0.0 };
            let kinds = s.switches.iter().map(|s| name(s.kind, s.subsystem));
            let found = !listed || kinds.eq(r.switches.iter().map(|s| s.1.clone()));
            let (dx, dt) = derivatives(&d, &r);
            let ok = s.outcome == Outcome::Reached && found && error.max(switch) <= 100.0 * rtol;
            table.row(vec![
                problem.into(),
                format!("{rtol:e}"),
                short(error / rtol),
                short(switch / rtol),
                format!("{}/{}", s.switches.len(), r.switches.len()),
                short(dx),
                short(dt),
                format!("{:.1}", seconds * 1e6),
                s.stats.steps.to_string(),
                s.stats.rejections.to_string(),
                s.stats.relocations.to_string(),
                s.stats.evaluations.to_string(),
                s.outcome.name().into(),
                if ok { "ok" } else { "MISSED" }.into(),
            ]);
            let o = Object::new().text("case", "sim").text("record", "accuracy").text("problem", problem);
            let o = o.num("rtol", rtol).num("error", error).num("switch_error", switch).flag("all_switches", found);
            let o = o.num("sensitivity_error", dx).num("switch_sensitivity_error", dt).num("seconds", seconds);
            let o = o.int("switches", s.switches.len()).int("steps", s.stats.steps).int("rejected", s.stats.rejections);
            let o = o.int("evaluations", s.stats.evaluations).int("newton", s.stats.newton).flag("ok", ok);
            c.record(&o.text("outcome", s.outcome.name()));
        }
    }
    c.say("reference problems, errors relative to the tolerance");
    c.say(&table.text());
}

/// Errors of the derivatives of the final state and of the switching times.
fn derivatives(s: &Run, r: &Reference) -> (f64, f64) {
    let exact: Vec<f64> = r.sensitivity.concat();
    // the references know no controls
    let nx = r.x0.len();
    let by_start =
        |d: &Vec<f64>| d.chunks_exact(d.len() / nx).flat_map(|row| &row[..nx]).copied().collect::<Vec<f64>>();
    let dx = s.sensitivity.as_ref().map_or(f64::NAN, |d| off(&by_start(d), &exact));
    let each = s.switches.iter().zip(&r.switches).map(|(s, r)| off(s.dt.get(..nx).unwrap_or(&[]), &r.2));
    (dx, each.fold(0.0, f64::max))
}

fn work_precision(c: &Context) {
    let sys = fast_oscillator::compiled();
    let t_end = PI / 2.0;
    // error of state and switching time, seconds, method
    let mut points: Vec<(&str, f64, f64, f64)> = Vec::new();
    for e in 8..=56 {
        let rtol = 10f64.powf(-0.25 * f64::from(e));
        for (name, method) in [("dp5", Method::Dp5), ("dop853", Method::Dop853), ("radau5", Method::Radau5)] {
            if (method != Method::Dop853 && rtol < 1e-11) || (method == Method::Radau5 && e % 4 > 0) {
                continue;
            }
            let opt = Options { method, ..Options::with_tolerance(rtol, rtol) };
            let mut engine = Engine::new(&sys, &opt).expect("the options fit");
            let mut run = || {
                engine.reinit(0.0, &OSCILLATOR_X0).expect("the state fits");
                engine.advance(t_end).expect("no function asks to stop");
            };
            run();
            let seconds = fast_oscillator::best_of(&mut run);
            let error = super::distance(engine.state(), &OSCILLATOR_XT);
            let switch = engine.switches().first().map_or(f64::INFINITY, |s| (s.t - 1.0).abs());
            points.push((name, error.max(switch), seconds, rtol));
        }
        let seconds = fast_oscillator::best_of(|| {
            std::hint::black_box(fast_oscillator::by_hand(rtol, std::hint::black_box(OSCILLATOR_X0), t_end));
        });
        let (x, t) = fast_oscillator::by_hand(rtol, OSCILLATOR_X0, t_end);
        let error = super::distance(&x, &OSCILLATOR_XT).max((t - 1.0).abs());
        points.push(("by hand", error, seconds, rtol));
    }
    for (method, error, seconds, rtol) in &points {
        let o = Object::new().text("case", "sim").text("record", "work").text("method", method);
        c.record(&o.num("rtol", *rtol).num("error", *error).num("seconds", *seconds));
    }
    let mut table = Table::new(&["method", "us to 1e-7", "1e-9", "1e-11"]);
    for method in ["dop853", "dp5", "radau5", "by hand"] {
        let cheapest = |target: f64| {
            let good = points.iter().filter(|p| p.0 == method && p.1 <= target);
            good.map(|p| p.2).fold(f64::INFINITY, f64::min) * 1e6
        };
        let us = [1e-7, 1e-9, 1e-11].map(cheapest);
        table.row(vec![method.into(), format!("{:.1}", us[0]), format!("{:.1}", us[1]), format!("{:.1}", us[2])]);
        let o = Object::new().text("case", "sim").text("record", "to-reach").text("method", method);
        c.record(&o.num("us_1e-7", us[0]).num("us_1e-9", us[1]).num("us_1e-11", us[2]));
    }
    c.say("oscillator (4.4), compiled functions: microseconds to reach an error in the state at T and in the switch");
    c.say(&table.text());
}

/// The same problems by finite elements with switch detection, with as many steps as they need for 1e-9 or so.
fn against_fesd(c: &Context) {
    let mut table = Table::new(&["problem", "FESD error", "ms", "event error", "ms", "ratio", "switches apart"]);
    let cases: [(&str, System, Vec<f64>, f64, usize); 3] = [
        ("coulomb", coulomb(), vec![1.0, 0.2], 40.0, 200),
        ("blocks", blocks(), vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], 12.0, 60),
        ("stickslip1", stick_slip(), vec![-0.8, -1.0], 40.0, 250),
    ];
    for (problem, sys, x0, t_end, n) in cases {
        let r = reference::load(problem);
        let set = super::settings(RkFamily::RadauIia, 4, 3, Discretisation::Fesd);
        let (fesd, x, fesd_s) = super::simulate(&sys, &set, &x0, t_end, n);
        let (s, event_s) = simulate(&sys, &[], &x0, t_end, &Options::with_tolerance(1e-11, 1e-11));
        let (a, b) = (off(&x, &r.x_end), off(&s.x, &r.x_end));
        let times: Vec<f64> = s.switches.iter().map(|s| s.t).collect();
        let others: Vec<f64> = fesd.trajectory.switches.iter().map(|s| s.t).collect();
        let apart = off(&times, &others);
        table.row(vec![
            problem.into(),
            short(a),
            format!("{:.2}", fesd_s * 1e3),
            short(b),
            format!("{:.3}", event_s * 1e3),
            format!("{:.0}", fesd_s / event_s),
            short(apart),
        ]);
        let o = Object::new().text("case", "sim").text("record", "against-fesd").text("problem", problem);
        let o = o.num("fesd_error", a).num("fesd_seconds", fesd_s).num("error", b).num("seconds", event_s);
        c.record(&o.num("switches_apart", apart));
    }
    c.say("beside finite elements with switch detection (Radau IIA with four stages)");
    c.say(&table.text());
}

pub fn run(c: &Context) {
    accuracy(c);
    against_fesd(c);
    work_precision(c);
}
