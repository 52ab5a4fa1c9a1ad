//! The event-driven engine against solutions known to twenty digits, over all tolerances.

mod common;
#[path = "../examples/report/reference.rs"]
mod reference;

use common::models::*;
use std::sync::Arc;
use switchback::event::{simulate, Engine, Kind, Method, Options, Outcome, Run, Term};
use switchback::func::{Callback, Dims};
use switchback::system::System;
use switchback::system::{Regions, SharedFunction, Subsystem};

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
        _ => "another",
    };
    format!("{name}[{subsystem}]")
}

fn tolerance(rtol: f64) -> Options {
    Options::with_tolerance(rtol, rtol)
}

#[test]
fn references_over_all_tolerances() {
    for (name, sys, u) in problems() {
        let r = reference::load(name);
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
        let r = reference::load(name);
        for method in [Method::Dop853, Method::Radau5] {
            let rtol = if method == Method::Radau5 { 1e-9 } else { 1e-11 };
            let opt = Options { method, sensitivity: true.into(), ..tolerance(rtol) };
            let s = run(&sys, &opt, &r.x0, &u, r.t_end);
            // the references know no controls
            let (nx, n_c) = (r.x0.len(), r.x0.len() + u.len());
            let rows = s.sensitivity.as_ref().unwrap().chunks_exact(n_c);
            let by_start: Vec<f64> = rows.flat_map(|row| &row[..nx]).copied().collect();
            let e = off(&by_start, &r.sensitivity.concat());
            assert!(e <= 100.0 * rtol, "{name}, {method:?}: {e:e}");
            assert!(!s.one_sided, "{name}");
            for (s, r) in s.switches.iter().zip(&r.switches) {
                let e = off(&s.dt[..nx], &r.2);
                assert!(e <= 1e3 * rtol, "{name}, {method:?}: {e:e} {s:?}");
            }
        }
    }
}

/// `ẋ = 2 − sign x`, `x(1; x0)`: slope 1 for x0 ≤ −3, 1/3 while the switch is inside, 1 for x0 > 0.
#[test]
fn slopes_on_both_sides_of_a_kink() {
    let slope = |x0: f64| {
        let s = simulate(&switching('a'), &Options { sensitivity: true.into(), ..tolerance(1e-9) }, 0.0, &[x0], 1.0)
            .unwrap();
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
        let mut e =
            Engine::new(&sys, &Options { sensitivity: sensitivity.into(), method, ..tolerance(1e-11) }).unwrap();
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

/// Gradients of a function of final state, of the state half way and of all switching times, forward and adjoint.
fn both_ways(what: &str, sys: &System, opt: &Options, x0: &[f64], u: &[f64], p: &[f64], t: f64) -> usize {
    let opt = Options { sensitivity: true.into(), adjoint: true, ..opt.clone() };
    let mut e = Engine::new(sys, &opt).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_controls(u).unwrap();
    e.set_params(p).unwrap();
    let nx = x0.len();
    let n_c = nx + p.len() + u.len();
    let weight = |i: usize| 1.0 + (1.7 * i as f64).sin();
    let v: Vec<f64> = (0..nx).map(weight).collect();
    let mut forward = vec![0.0; n_c];
    let mut add = |s: &[f64], v: &[f64]| {
        for (row, v) in s.chunks_exact(n_c).zip(v) {
            forward.iter_mut().zip(row).for_each(|(f, s)| *f += v * s);
        }
    };
    let half = 0.437 * t;
    e.advance(half).unwrap();
    add(e.sensitivity().unwrap(), &v);
    assert_eq!(e.advance(t).unwrap(), Outcome::Reached, "{what}: {}", e.reason());
    add(e.sensitivity().unwrap(), &v);
    let mut terms = vec![Term::State { t: half, v: v.clone() }];
    for (index, s) in e.switches().iter().enumerate() {
        add(&s.dt, &[weight(index)]);
        terms.push(Term::Switch { index, weight: weight(index) });
    }
    let g = e.adjoint(&v, &terms).unwrap();
    let d = off(&[g.x0, g.p, g.u].concat(), &forward);
    assert!(d <= 1e-11, "{what}: {d:e}");
    // a run goes on after a sweep as if nothing had happened
    let end = e.state().to_vec();
    let mut other = Engine::new(sys, &opt).unwrap();
    other.reinit(0.0, x0).unwrap();
    other.set_controls(u).unwrap();
    other.set_params(p).unwrap();
    other.advance(half).unwrap();
    other.advance(t).unwrap();
    assert_eq!(end, other.state(), "{what}");
    e.advance(1.1 * t).unwrap();
    other.advance(1.1 * t).unwrap();
    assert_eq!(e.state(), other.state(), "{what}");
    e.switches().len()
}

#[test]
fn adjoint_gradients_are_the_transpose_of_forward_ones() {
    for (name, sys, u) in problems() {
        let r = reference::load(name);
        for e in [4, 8, 11] {
            for method in [Method::Auto, Method::Dp5, Method::Dop853, Method::Radau5] {
                let opt = Options { method, ..tolerance(10f64.powi(-e)) };
                let n = both_ways(&format!("{name}, {method:?}, 1e-{e}"), &sys, &opt, &r.x0, &u, &[], r.t_end);
                assert!(n > 0, "{name}");
            }
        }
    }
    for method in [Method::Dp5, Method::Dop853, Method::Radau5] {
        let opt = Options { method, ..tolerance(1e-9) };
        let p = [1.3, 0.45, 0.1];
        assert!(both_ways("friction", &with_parameters(), &opt, &[1.0, 0.3], &[], &p, 15.0) > 5);
        assert!(both_ways("curved", &curved(), &opt, &[0.2, 1.0], &[0.2], &[1.0, 0.4], 8.0) > 3);
    }
}

/// A point that is drawn onto an ellipse, whose size is a parameter, slides along it under a force that changes with
/// time and the control, and is torn off.
fn curved() -> System {
    let d = Dims { x: 2, u: 1, p: 2 };
    let of_all = |c: Callback, m: usize| -> SharedFunction {
        let all: Vec<(usize, usize)> = (0..6).flat_map(|j| (0..m).map(move |i| (i, j))).collect();
        Arc::new(c.with_jacobian_pattern(pattern(m, 6, &all)).unwrap())
    };
    let mut s = System::new(2, 1, 2).unwrap();
    let f0 = Callback::new("f0", d, 2, |at, o| {
        o[0] = at.x[1] + at.u[0] * (1.3 * at.t).sin();
        o[1] = -at.x[0] + 2.0 * at.p[1] * (2.0 * at.t).cos() * at.x[0];
        0
    });
    s.set_f0(of_all(f0, 2)).unwrap();
    let modes = Callback::new("F", d, 4, |at, o| {
        o[..2].copy_from_slice(&[-0.4 * at.x[0], -0.8 * at.x[1]]);
        o[2..].copy_from_slice(&[0.5 * at.x[0], 0.9 * at.x[1] + 0.1 * at.u[0]]);
        0
    });
    let psi = smooth(
        "psi",
        d,
        1,
        |at, o| o[0] = at.x[0] * at.x[0] + 1.5 * at.x[1] * at.x[1] - at.p[0] * (1.0 + 0.1 * at.t.sin()),
        &[(0, 0), (0, 1), (0, 3), (0, 5)],
        |at, o| {
            o.copy_from_slice(&[2.0 * at.x[0], 3.0 * at.x[1], -1.0 - 0.1 * at.t.sin(), -0.1 * at.p[0] * at.t.cos()])
        },
        &[(0, 0), (1, 1), (3, 5), (5, 5)],
        |at, w, o| {
            let (sin, cos) = at.t.sin_cos();
            o.copy_from_slice(&[2.0 * w[0], 3.0 * w[0], -0.1 * cos * w[0], 0.1 * at.p[0] * sin * w[0]]);
        },
    );
    let regions = Regions::Signs { psi, signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: vec![0, 1], modes: of_all(modes, 4), n_modes: 2, regions }).unwrap();
    s
}

#[test]
fn gradients_with_respect_to_controls_and_curved_surfaces() {
    let sys = curved();
    let solve = |z: [f64; 5], sensitivity: bool| {
        let mut e = Engine::new(&sys, &Options { sensitivity: sensitivity.into(), ..tolerance(1e-11) }).unwrap();
        e.reinit(0.0, &z[..2]).unwrap();
        e.set_params(&z[2..4]).unwrap();
        e.set_controls(&z[4..]).unwrap();
        e.advance(8.0).unwrap();
        e.into_run()
    };
    let z = [0.2, 1.0, 1.0, 0.4, 0.2];
    let base = solve(z, true);
    assert_eq!(base.outcome, Outcome::Reached, "{}", base.reason);
    let kinds: Vec<Kind> = base.switches.iter().map(|s| s.kind).collect();
    assert!(kinds.contains(&Kind::Enter) && kinds.contains(&Kind::Leave), "{kinds:?}");
    for c in 0..5 {
        let moved = |h: f64| {
            let mut z = z;
            z[c] += h;
            solve(z, false)
        };
        let (a, b) = (moved(1e-5), moved(-1e-5));
        for i in 0..2 {
            let (d, s) = ((a.x[i] - b.x[i]) / 2e-5, base.sensitivity.as_ref().unwrap()[i * 5 + c]);
            assert!((d - s).abs() < 1e-6 * (1.0 + d.abs()), "x{i}, input {c}: {d}, {s}");
        }
        for ((a, b), s) in a.switches.iter().zip(&b.switches).zip(&base.switches) {
            let d = (a.t - b.t) / 2e-5;
            assert!((d - s.dt[c]).abs() < 1e-6 * (1.0 + d.abs()), "input {c}: {d}, {s:?}");
        }
    }
}

#[test]
fn gradients_that_cannot_be_had_are_refused_in_words() {
    let mut e = Engine::new(&switching('a'), &tolerance(1e-8)).unwrap();
    e.reinit(0.0, &[-1.0]).unwrap();
    e.advance(1.0).unwrap();
    assert!(e.adjoint(&[1.0], &[]).unwrap_err().to_string().contains("not recorded"));
    let mut e = Engine::new(&switching('a'), &Options { adjoint: true, ..tolerance(1e-8) }).unwrap();
    e.reinit(0.0, &[-1.0]).unwrap();
    e.advance(1.0).unwrap();
    let at = |t| Term::State { t, v: vec![1.0] };
    assert!(e.adjoint(&[1.0], &[at(0.7)]).unwrap_err().to_string().contains("no stop at t = 0.7"));
    assert!(e.adjoint(&[1.0], &[Term::Switch { index: 1, weight: 1.0 }]).unwrap_err().to_string().contains("the log"));
    assert!(e.adjoint(&[f64::NAN], &[]).is_err() && e.adjoint(&[1.0, 1.0], &[]).is_err());
    // at the start, the end and before the switch: 1 + 1/3 + 1/3
    let g = e.adjoint(&[1.0], &[at(0.0), at(1.0)]).unwrap();
    assert!((g.x0[0] - 5.0 / 3.0).abs() < 1e-13, "{g:?}");
    // behind an accumulation the time of the switch that ends it has no derivative
    let mut e = Engine::new(&zeno(), &Options { adjoint: true, sensitivity: true.into(), ..tolerance(1e-8) }).unwrap();
    let r = reference::load("zeno_post");
    e.reinit(0.0, &r.x0).unwrap();
    e.advance(r.t_end).unwrap();
    assert!(e.one_sided());
    let index = e.switches().len() - 1;
    let v = vec![1.0; r.x0.len()];
    let refused = e.adjoint(&v, &[Term::Switch { index, weight: 1.0 }]).unwrap_err().to_string();
    assert!(refused.contains("accumulate"), "{refused}");
    e.adjoint(&v, &[]).unwrap();
}

/// Constant fields on both sides of `x2 = 0`: the jumps of the derivatives in closed form, `I + (f⁺ − f⁻) nᵀ / nᵀf⁻`.
#[test]
fn jumps_of_the_derivatives_in_closed_form() {
    let d = Dims { x: 2, u: 0, p: 0 };
    // velocities above and below, the one along the surface
    for (above, below, then) in [
        ([1.0, -2.0], [3.0, -0.5], [3.0, -0.5]),
        ([1.0, -2.0], [3.0, 1.0], [7.0 / 3.0, 0.0]),
        ([-0.7, -1e-3], [2.0, -4.0], [2.0, -4.0]),
    ] {
        let mut s = System::new(2, 0, 0).unwrap();
        let f = affine("F", d, &[above[0], above[1], below[0], below[1]], &[]);
        add_sides(&mut s, &[0, 1], f, affine("psi", d, &[0.0], &[(0, 1, 1.0)]));
        let x0 = [0.3, -above[1]];
        let opt = Options { sensitivity: true.into(), adjoint: true, ..tolerance(1e-8) };
        let mut e = Engine::new(&s, &opt).unwrap();
        e.reinit(0.0, &x0).unwrap();
        e.advance(2.0).unwrap();
        let jump = |i: usize| (then[i] - above[i]) / above[1];
        let exact = [1.0, jump(0), 0.0, 1.0 + jump(1)];
        let forward = e.sensitivity().unwrap();
        assert!(off(forward, &exact) < 1e-12, "{forward:?} {exact:?}");
        assert!(off(&e.switches()[0].dt, &[0.0, -1.0 / above[1]]) < 1e-12, "{:?}", e.switches());
        for i in 0..2 {
            let mut v = [0.0; 2];
            v[i] = 1.0;
            let g = e.adjoint(&v, &[]).unwrap();
            assert!(off(&g.x0, &exact[2 * i..2 * i + 2]) < 1e-12, "{g:?} {exact:?}");
        }
    }
}
