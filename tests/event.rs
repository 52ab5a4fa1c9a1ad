//! The event-driven engine against solutions known to twenty digits, over all tolerances.

mod common;
#[path = "../examples/report/reference.rs"]
mod reference;

use common::models::*;
use switchback::event::{simulate, Engine, Kind, Method, Options, Outcome, Run};
use switchback::system::System;

/// The models of the references.
fn problems() -> Vec<(&'static str, System, Vec<f64>)> {
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
    ]
}

fn run(sys: &System, opt: &Options, x0: &[f64], u: &[f64], t: f64) -> Run {
    let mut e = Engine::new(sys, opt).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_controls(u).unwrap();
    e.advance(t).unwrap();
    e.into_run()
}

fn kind(k: Kind, subsystem: usize) -> String {
    let name = match k {
        Kind::Cross => "cross",
        Kind::Enter => "enter_sliding",
        Kind::Leave => "leave_sliding",
        Kind::Spontaneous => "spontaneous",
    };
    format!("{name}[{subsystem}]")
}

fn tolerance(rtol: f64) -> Options {
    Options::with_tolerance(rtol, rtol)
}

#[test]
fn references_over_all_tolerances() {
    for (name, sys, u) in problems() {
        let Some(r) = reference::load(name) else {
            eprintln!("no reference for {name}: skipped");
            continue;
        };
        for e in 4..=12 {
            let rtol = 10f64.powi(-e);
            for method in [Method::Auto, Method::Dp5, Method::Dop853, Method::Radau5] {
                let opt = Options { method, ..tolerance(rtol) };
                let s = run(&sys, &opt, &r.x0, &u, r.t_end);
                let what = format!("{name}, {method:?}, rtol {rtol:e}");
                assert_eq!(s.outcome, Outcome::Reached, "{what}: {}", s.reason);
                let found: Vec<String> = s.switches.iter().map(|s| kind(s.kind, s.subsystem)).collect();
                let exact: Vec<String> = r.switches.iter().map(|s| s.1.clone()).collect();
                assert_eq!(found, exact, "{what}: {:?}", s.switches);
                let size = r.x_end.iter().fold(1.0f64, |m, v| m.max(v.abs()));
                let error = s.x.iter().zip(&r.x_end).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size;
                assert!(error <= 100.0 * rtol, "{what}: error {error:e}");
                for (f, e) in s.switches.iter().zip(&r.switches) {
                    let off = (f.t - e.0).abs() / e.0.abs().max(1.0);
                    assert!(off <= 100.0 * rtol, "{what}: {f:?} off by {off:e}");
                }
            }
        }
    }
}
