//! The event-driven engine against solutions known to twenty digits, over all tolerances.

mod common;
#[path = "../examples/report/reference.rs"]
mod reference;

use common::models::*;
use switchback::event::{simulate, Engine, Kind, Method, Options, Outcome, Run};
use switchback::func::Dims;
use switchback::system::System;
use switchback::system::{Regions, Subsystem};

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

/// Largest difference relative to the largest value, at least 1.
fn off(found: &[f64], exact: &[f64]) -> f64 {
    assert_eq!(found.len(), exact.len());
    let size = exact.iter().fold(1.0f64, |m, v| m.max(v.abs()));
    found.iter().zip(exact).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / size
}

#[test]
fn sensitivities_of_the_references() {
    for (name, sys, u) in problems() {
        let Some(r) = reference::load(name) else {
            eprintln!("no reference for {name}: skipped");
            continue;
        };
        for method in [Method::Dop853, Method::Radau5] {
            let rtol = if method == Method::Radau5 { 1e-9 } else { 1e-11 };
            let opt = Options { method, sensitivity: true, ..tolerance(rtol) };
            let s = run(&sys, &opt, &r.x0, &u, r.t_end);
            let e = off(s.sensitivity.as_ref().unwrap(), &r.sensitivity.concat());
            assert!(e <= 1e3 * rtol, "{name}, {method:?}: {e:e}");
            assert!(!s.one_sided, "{name}");
            for (s, r) in s.switches.iter().zip(&r.switches) {
                // differences of the weights stand behind the end of a sliding mode
                let allowed = if s.kind == Kind::Leave { 1e3 * rtol + 1e-8 } else { 1e3 * rtol };
                let e = off(&s.dt, &r.2);
                assert!(e <= allowed, "{name}, {method:?}: {e:e} {s:?}");
            }
        }
    }
}

/// `ẋ = 2 − sign x`, `x(1; x0)`: slope 1 for x0 ≤ −3, 1/3 while the switch is inside, 1 for x0 > 0.
#[test]
fn slopes_on_both_sides_of_a_kink() {
    let slope = |x0: f64| {
        let s = simulate(&switching('a'), &Options { sensitivity: true, ..tolerance(1e-9) }, 0.0, &[x0], 1.0).unwrap();
        assert!(!s.one_sided);
        s.sensitivity.unwrap()[0]
    };
    for (x0, exact) in [(-3.001, 1.0), (-2.999, 1.0 / 3.0), (-1.0, 1.0 / 3.0), (-0.001, 1.0 / 3.0), (0.001, 1.0)] {
        assert!((slope(x0) - exact).abs() < 1e-12, "{x0}: {}", slope(x0));
    }
}

/// A friction oscillator whose stiffness, friction and belt speed are parameters.
fn with_parameters() -> System {
    let d = Dims { x: 2, u: 0, p: 3 };
    let mut s = System::new(2, 0, 3).unwrap();
    let f0 = smooth(
        "f0",
        d,
        2,
        |at, o| {
            o[0] = at.x[1];
            o[1] = -at.p[0] * at.x[0] + (0.7 * at.t).sin();
        },
        &[(1, 0), (0, 1), (1, 2), (1, 5)],
        |at, o| o.copy_from_slice(&[-at.p[0], 1.0, -at.x[0], 0.7 * (0.7 * at.t).cos()]),
        &[(0, 2), (5, 5)],
        |at, w, o| o.copy_from_slice(&[-w[1], -0.49 * w[1] * (0.7 * at.t).sin()]),
    );
    s.set_f0(f0).unwrap();
    let modes = affine("F", d, &[0.0; 2], &[(0, 3, -1.0), (1, 3, 1.0)]);
    let psi = affine("psi", d, &[0.0], &[(0, 1, 1.0), (0, 4, -1.0)]);
    let regions = Regions::Signs { psi, signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: vec![1], modes, n_modes: 2, regions }).unwrap();
    s
}

#[test]
fn sensitivities_against_differences_of_the_solver() {
    let sys = with_parameters();
    let (p, x0, t) = ([1.3, 0.45, 0.1], [1.0, 0.3], 15.0);
    let solve = |x0: &[f64], p: &[f64], sensitivity: bool, method: Method| {
        let mut e = Engine::new(&sys, &Options { sensitivity, method, ..tolerance(1e-11) }).unwrap();
        e.reinit(0.0, x0).unwrap();
        e.set_params(p).unwrap();
        e.advance(t).unwrap();
        e.into_run()
    };
    for method in [Method::Dop853, Method::Radau5] {
        let base = solve(&x0, &p, true, method);
        let kinds = |r: &Run| r.switches.iter().map(|s| s.kind).collect::<Vec<_>>();
        let k = kinds(&base);
        assert!(k.contains(&Kind::Cross) && k.contains(&Kind::Enter) && k.contains(&Kind::Leave), "{k:?}");
        let s = base.sensitivity.as_ref().unwrap();
        for c in 0..5 {
            let h = 1e-5;
            let moved = |h: f64| {
                let (mut x0, mut p) = (x0, p);
                if c < 2 {
                    x0[c] += h;
                } else {
                    p[c - 2] += h;
                }
                solve(&x0, &p, false, method)
            };
            let (a, b) = (moved(h), moved(-h));
            assert!(kinds(&a) == k && kinds(&b) == k);
            for i in 0..2 {
                let d = (a.x[i] - b.x[i]) / (2.0 * h);
                assert!(
                    (d - s[i * 5 + c]).abs() < 1e-6 * (1.0 + d.abs()),
                    "{method:?} x{i}, input {c}: {d}, {}",
                    s[i * 5 + c]
                );
            }
            for ((a, b), s) in a.switches.iter().zip(&b.switches).zip(&base.switches) {
                let d = (a.t - b.t) / (2.0 * h);
                assert!((d - s.dt[c]).abs() < 2e-6 * (1.0 + d.abs()), "{method:?}, input {c}: {d}, {s:?}");
            }
        }
    }
}
