//! Many surfaces that slide at once: closed forms, the implicit method as the second opinion, work that grows with what
//! slides.

use std::sync::Arc;
use switchback::event::{simulate, Engine, Method, Options, Outcome, Run, Sensitivity};
use switchback::expr::{Expr, ExprFunction, Graph};
use switchback::func::{Dims, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::model::Model;
use switchback::system::{Regions, Subsystem, System};

/// Adds `f_±` in the rows of a subsystem with the surface `psi`, every mode with a program of its own.
fn add_relay(s: &mut System, g: &Graph, rows: &[usize], plus: &[Expr], minus: &[Expr], psi: Expr) {
    let d = s.dims();
    let psi = Arc::new(g.function("psi", d, &[psi]).unwrap());
    let ids = g.ids(&[plus, minus].concat());
    let modes = Arc::new(ExprFunction::with_parts("modes", &mut g.dag(), d, &ids, rows.len()).unwrap());
    let regions = Regions::Signs { psi, signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: rows.to_vec(), modes, n_modes: 2, regions }).unwrap();
}

/// `y_k' = cos(t + 0.3 k) − 2 σ_k + γ σ_{k−1}`, `z_k' = σ_k` with `σ_k = sign y_k`. From zero all relays slide, with
/// `2 σ_k = cos(t + 0.3 k) + γ σ_{k−1}`.
fn relays(n: usize, gamma: f64) -> System {
    let d = Dims { x: 2 * n, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(2 * n, 0, 0).unwrap());
    let smooth: Vec<Expr> = (0..n).flat_map(|k| [(g.t() + 0.3 * k as f64).cos(), g.constant(0.0)]).collect();
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    for k in 0..n {
        let next = k + 1 < n && gamma != 0.0;
        let rows = [2 * k, 2 * k + 1, 2 * k + 2];
        let side = |sign: f64| [-2.0, 1.0, gamma].map(|v| g.constant(sign * v));
        let m = if next { 3 } else { 2 };
        add_relay(&mut s, &g, &rows[..m], &side(1.0)[..m], &side(-1.0)[..m], g.x(2 * k));
    }
    s
}

/// The integrals of the weights of [`relays`] at time `t`.
fn integrals(n: usize, gamma: f64, t: f64) -> Vec<f64> {
    let mut z = Vec::new();
    for k in 0..n {
        let before = z.last().copied().unwrap_or(0.0);
        let phase = 0.3 * k as f64;
        z.push(0.5 * ((t + phase).sin() - phase.sin() + gamma * before));
    }
    z
}

fn tolerance(rtol: f64, method: Method) -> Options {
    Options { method, ..Options::with_tolerance(rtol, 1e-2 * rtol) }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m, v| m.max(v.abs()))
}

#[test]
fn relays_that_slide_together_have_their_weights_at_all_tolerances() {
    for (n, gamma) in [(3, 0.0), (12, 0.0), (12, 0.5), (40, 0.5)] {
        let exact = integrals(n, gamma, 3.0);
        for e in [4, 6, 8, 10] {
            for method in [Method::Auto, Method::Dp5, Method::Dop853] {
                let rtol = 10f64.powi(-e);
                let r = simulate(&relays(n, gamma), &tolerance(rtol, method), 0.0, &vec![0.0; 2 * n], 3.0).unwrap();
                assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
                assert_eq!((r.stats.factorisations, r.switches.len()), (0, 0));
                assert!(largest(r.x.iter().step_by(2).copied()) <= 1e-15);
                let error = largest(r.x.iter().skip(1).step_by(2).zip(&exact).map(|(a, b)| a - b));
                assert!(error <= 10.0 * rtol, "{n} relays, {method:?}, rtol {rtol:e}: {error:e}");
            }
        }
    }
}

/// Blocks on a belt, coupled by springs, with friction that falls with the speed.
fn friction_chain(n: usize) -> (System, Vec<f64>) {
    let d = Dims { x: 2 * n, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(2 * n, 0, 0).unwrap());
    let mut smooth = Vec::new();
    for i in 0..n {
        let mut pull = -g.x(2 * i);
        if i > 0 {
            pull += 2.0 * (g.x(2 * i - 2) - g.x(2 * i));
        }
        if i + 1 < n {
            pull += 2.0 * (g.x(2 * i + 2) - g.x(2 * i));
        }
        smooth.extend([g.x(2 * i + 1), pull]);
    }
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    for i in 0..n {
        let slip = 0.1 - g.x(2 * i + 1);
        let size = 1.0 + 0.02 * (i % 7) as f64;
        let (plus, minus) = (size / (1.0 + 2.5 * slip), -size / (1.0 - 2.5 * slip));
        add_relay(&mut s, &g, &[2 * i + 1], &[plus], &[minus], slip);
    }
    let x0 = (0..n).flat_map(|i| [0.3 * (1.7 * i as f64 + 0.3).sin(), 0.0]).collect();
    (s, x0)
}

#[test]
fn a_chain_with_friction_moves_as_the_implicit_method_says() {
    let (s, x0) = friction_chain(12);
    let run = |rtol: f64, method| simulate(&s, &tolerance(rtol, method), 0.0, &x0, 8.0).unwrap();
    let reference: Run = run(1e-11, Method::Radau5);
    assert!(reference.switches.len() > 12 && reference.stats.factorisations > 0);
    for rtol in [1e-5, 1e-7, 1e-9] {
        let r = run(rtol, Method::Auto);
        assert_eq!(r.stats.factorisations, 0);
        let log = |r: &Run| r.switches.iter().map(|s| (s.subsystem, s.after.clone())).collect::<Vec<_>>();
        assert_eq!(log(&r), log(&reference));
        let times = largest(r.switches.iter().zip(&reference.switches).map(|(a, b)| a.t - b.t));
        let states = largest(r.x.iter().zip(&reference.x).map(|(a, b)| a - b));
        assert!(times.max(states) <= 200.0 * rtol, "rtol {rtol:e}: {times:e} {states:e}");
    }
}

#[test]
fn work_grows_with_the_number_of_switches_only() {
    let per_switch = |n: usize| {
        let (s, x0) = friction_chain(n);
        let r = simulate(&s, &tolerance(1e-6, Method::Auto), 0.0, &x0, 8.0).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
        assert!(r.switches.len() > n, "{}", r.switches.len());
        r.stats.evaluations as f64 / r.switches.len() as f64
    };
    assert!(per_switch(60) <= 25.0);
}

/// On the unit circle, which the fields of both sides push to: the angle is `t`.
#[test]
fn explicit_steps_stay_on_a_curved_surface() {
    let d = Dims { x: 3, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(3, 0, 0).unwrap());
    let (x, y) = (g.x(0), g.x(1));
    let push = 0.5 * g.t().cos();
    let smooth = [-y + push * x, x + push * y, g.constant(0.0)];
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    add_relay(&mut s, &g, &[0, 1, 2], &[-x, -y, g.constant(1.0)], &[x, y, g.constant(-1.0)], x * x + y * y - 1.0);
    let t = 5.0f64;
    for e in [4, 7, 10] {
        for method in [Method::Dp5, Method::Dop853] {
            let rtol = 10f64.powi(-e);
            let r = simulate(&s, &tolerance(rtol, method), 0.0, &[1.0, 0.0, 0.0], t).unwrap();
            assert_eq!(r.stats.factorisations, 0);
            assert!((r.x[0].hypot(r.x[1]) - 1.0).abs() <= 4.0 * f64::EPSILON, "{:?}", r.x);
            let error = largest([r.x[0] - t.cos(), r.x[1] - t.sin(), r.x[2] - 0.5 * t.sin()].into_iter());
            assert!(error <= 20.0 * rtol, "{method:?}, rtol {rtol:e}: {error:e}");
        }
    }
}

/// Derivatives along a sliding mode on two curved surfaces that time, a parameter and a control move, by explicit steps: those of
/// finite differences of the run.
#[test]
fn derivatives_along_curved_surfaces_are_those_of_explicit_steps() {
    let (d, nx) = (Dims { x: 4, u: 1, p: 1 }, 4);
    let (g, mut s) = (Graph::new(), System::new(4, 1, 1).unwrap());
    let (x, u, p) = ([0, 1, 2, 3].map(|i| g.x(i)), g.u(0), g.p(0));
    let smooth =
        [-x[0] + 0.4 * x[2] * p, 0.5 * x[3] - x[1], 0.3 * x[0] - x[2] + 0.5 * u, 0.2 * x[1] * x[2] - x[3] + 0.4];
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    let first = x[0] + 0.3 * x[1] * x[1] + 0.2 * (p * x[2]).sin() - 0.1 * g.t().sin() - 0.1 * u;
    let push = 3.0 * (1.0 + 0.1 * p * x[3]);
    add_relay(&mut s, &g, &[0, 1], &[-push, g.constant(0.3)], &[push, g.constant(-0.3)], first);
    let second = x[1] - 0.4 * x[3] * x[0] + 0.2 * p;
    add_relay(&mut s, &g, &[1], &[g.constant(-2.5)], &[g.constant(2.5)], second);
    let run = |z: &[f64], sensitivity: bool| {
        let options = Options { sensitivity: sensitivity.into(), ..tolerance(1e-10, Method::Auto) };
        let mut engine = Engine::new(&s, &options).unwrap();
        engine.reinit(0.0, &z[..nx]).unwrap();
        engine.set_params(&z[nx..=nx]).unwrap();
        engine.set_controls(&z[nx + 1..]).unwrap();
        assert_eq!(engine.advance(3.0).unwrap(), Outcome::Reached);
        assert_eq!(engine.stats().factorisations, 0);
        let (x, p, u) = (engine.state(), z[nx], z[nx + 1]);
        let first = x[0] + 0.3 * x[1] * x[1] + 0.2 * (p * x[2]).sin() - 0.1 * 3f64.sin() - 0.1 * u;
        assert!(largest([first, x[1] - 0.4 * x[3] * x[0] + 0.2 * p].into_iter()) < 1e-14, "it slides on both surfaces");
        (engine.state().to_vec(), engine.sensitivity().map(<[f64]>::to_vec))
    };
    let z = [0.9, -0.7, 0.4, 0.3, 0.8, 0.4];
    let own = run(&z, true).1.unwrap();
    for c in 0..z.len() {
        let at = |h: f64| {
            let mut z = z;
            z[c] += h;
            run(&z, false).0
        };
        let (up, down, h) = (at(1e-5), at(-1e-5), 1e-5);
        let error = largest((0..nx).map(|i| own[i * z.len() + c] - (up[i] - down[i]) / (2.0 * h)));
        assert!(error < 1e-8, "{c}: {error:e}");
    }
}

/// `y' = w − 3 sign y`, `w' = −L (w − cos t)`, `z' = sign y`: on `y = 0` the weight is as stiff as `w`.
#[test]
fn a_stiff_sliding_mode_is_left_to_the_implicit_method() {
    let d = Dims { x: 3, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(3, 0, 0).unwrap());
    let l = 1e6;
    let smooth = [g.x(1), -l * (g.x(1) - g.t().cos()), g.constant(0.0)];
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    let side = |v: f64| [g.constant(-3.0 * v), g.constant(v)];
    add_relay(&mut s, &g, &[0, 2], &side(1.0), &side(-1.0), g.x(0));
    let w0 = l * l / (l * l + 1.0);
    let r = simulate(&s, &tolerance(1e-6, Method::Auto), 0.0, &[0.0, w0, 0.0], 3.0).unwrap();
    let exact = (l * l * 3f64.sin() + l * (1.0 - 3f64.cos())) / (3.0 * (l * l + 1.0));
    assert!((r.x[2] - exact).abs() <= 1e-5, "{} {exact}", r.x[2]);
    assert!(r.stats.factorisations > 0 && r.stats.steps < 1000, "{:?}", r.stats);
}

/// Twisting algorithm (A. Levant 1993): `x' = y`, `y' = −3 sign x − 1.2 sign y + d`, and the integral `z` of what the relays
/// give. With `y + z − ∫ d` constant `z` is known for all times.
fn twisting(amplitude: f64) -> System {
    let d = Dims { x: 3, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(3, 0, 0).unwrap());
    let smooth = [g.x(1), amplitude * (2.0 * g.t()).sin(), g.constant(0.0)];
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    for (gain, surface) in [(3.0, 0), (1.2, 1)] {
        let side = |sign: f64| [g.constant(-gain * sign), g.constant(gain * sign)];
        add_relay(&mut s, &g, &[1, 2], &side(1.0), &side(-1.0), g.x(surface));
    }
    s
}

#[test]
fn twisting_ends_in_sliding_of_order_two() {
    for e in 4..=11 {
        let rtol = 10f64.powi(-e);
        // a factor of the amplitude in every half turn: two times in geometric series
        let (slow, fast) = (1.8f64, 4.2f64);
        let end = ((2.0 / slow).sqrt() + (2.0 * slow).sqrt() / fast) / (1.0 - (slow / fast).sqrt());
        let r = simulate(&twisting(0.0), &tolerance(rtol, Method::Auto), 0.0, &[1.0, 0.0, 0.0], 8.0).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "rtol {rtol:e}: {}", r.reason);
        assert!((r.accumulations[0].t - end).abs() <= 100.0 * rtol, "rtol {rtol:e}: {:?} {end}", r.accumulations);
        for k in 0..5 {
            let (x, y) = ((1.3 * f64::from(k)).cos(), (2.1 * f64::from(k)).sin());
            let r = simulate(&twisting(0.5), &tolerance(rtol, Method::Auto), 0.0, &[x, y, 0.0], 8.0).unwrap();
            assert_eq!(r.outcome, Outcome::Reached, "rtol {rtol:e}, start {x} {y}: {}", r.reason);
            assert_eq!(r.accumulations.len(), 1);
            assert!(largest(r.x[..2].iter().copied()) <= 1e-2 * rtol, "{:?}", r.x);
            let z = 0.25 * (1.0 - 16f64.cos()) + y;
            assert!((r.x[2] - z).abs() <= 100.0 * rtol, "rtol {rtol:e}, start {x} {y}: {} {z}", r.x[2]);
            assert!(r.switches.len() < 200 && r.stats.steps < 20_000, "{:?}", r.stats);
        }
    }
}

/// What the relays hold is lost where the disturbance is larger than they are: the motion leaves the set again.
#[test]
fn sliding_of_order_two_is_left_where_the_weights_reach_their_bounds() {
    let d = Dims { x: 2, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(2, 0, 0).unwrap());
    s.set_f0(Arc::new(g.function("f0", d, &[g.x(1), g.t()]).unwrap())).unwrap();
    for (gain, surface) in [(3.0, 0), (1.2, 1)] {
        add_relay(&mut s, &g, &[1], &[g.constant(-gain)], &[g.constant(gain)], g.x(surface));
    }
    let r = simulate(&s, &tolerance(1e-8, Method::Auto), 0.0, &[0.0, 0.0], 6.0).unwrap();
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    // the relays hold 3 + 1.2
    assert!((r.switches.last().unwrap().t - 4.2).abs() < 1e-6, "{:?}", r.switches);
    assert!((r.x[1] - 0.5 * 1.8 * 1.8).abs() < 1e-6, "{:?}", r.x);
}

/// Super-twisting algorithm with a disturbance; the time of convergence is that of an integration with 20 digits.
#[test]
fn super_twisting_ends_in_sliding_of_order_two() {
    let d = Dims { x: 2, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(2, 0, 0).unwrap());
    let smooth = [g.x(1), 0.5 * (2.0 * g.t()).cos()];
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    let (x, gain) = (g.x(0), g.constant(1.1));
    add_relay(&mut s, &g, &[0, 1], &[-1.5 * x.sqrt(), -gain], &[1.5 * (-x).sqrt(), gain], x);
    for e in 4..=11 {
        let rtol = 10f64.powi(-e);
        let r = simulate(&s, &tolerance(rtol, Method::Auto), 0.0, &[1.0, 0.0], 4.0).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "rtol {rtol:e}: {}", r.reason);
        assert!(largest(r.x.iter().copied()) <= 1e-2 * rtol, "{:?}", r.x);
        let (t, exact) = (r.accumulations[0].t, 1.767_184_862_50);
        // amplitudes of x go with the square of those of x': the time is as sure as the square root of the tolerance of x
        assert!((t - exact).abs() <= (1e-2 * rtol).sqrt(), "rtol {rtol:e}: {t}");
    }
}

/// Without a disturbance `z = sqrt |x|` and the other state follow a linear system in the time `∫ dt / z`: turns are similar, `v` is
/// `-ρ v` after each of them, which takes `(1 + ρ) |v| / k2`. Switches end where `x` is below its tolerance, and what is left of the time goes
/// with the root of that; their series knows it.
#[test]
fn the_time_of_super_twisting_is_that_of_the_series_of_its_turns() {
    let d = Dims { x: 2, u: 0, p: 0 };
    // with the gains of the last cases a turn is 35 and 1500 times shorter than the one before: few of them are seen at all
    let starts = (0..8).map(|k| [2.4 * (1.3 * f64::from(k) + 0.4).cos(), 1.4 * (2.1 * f64::from(k)).sin()]);
    let known = [[-0.327, -0.553], [0.157, -0.28], [-2.129, 1.27], [1.257, -0.231], [1.654, -1.007], [-1.28, 0.22]];
    let starts: Vec<[f64; 2]> = starts.chain(known).collect();
    let gains = [(1.5, 1.1), (1.5, 4.0), (3.0, 2.0), (2.6, 1.0)];
    for ((k1, k2), start) in gains.into_iter().flat_map(|gains| starts.iter().map(move |start| (gains, *start))) {
        let (g, mut s) = (Graph::new(), System::new(2, 0, 0).unwrap());
        s.set_f0(Arc::new(g.function("f0", d, &[g.x(1), g.constant(0.0)]).unwrap())).unwrap();
        let (x, gain) = (g.x(0), g.constant(k2));
        add_relay(&mut s, &g, &[0, 1], &[-k1 * x.sqrt(), -gain], &[k1 * (-x).sqrt(), gain], x);
        let side = start[0].signum();
        let (z, v) = ((side * start[0]).sqrt(), side * start[1]);
        let (damping, w) = (0.25 * k1, (0.5 * k2 - 0.0625 * k1 * k1).sqrt());
        let c = (0.5 * (v - k1 * z) + damping * z) / w;
        let first = (c.atan2(z) + 0.5 * std::f64::consts::PI) / w;
        let at_zero = -2.0 * z.hypot(c) * w * (-damping * first).exp();
        let rho = (-damping * std::f64::consts::PI / w).exp();
        let exact = (v - at_zero - at_zero * (1.0 + rho) / (1.0 - rho)) / k2;
        for e in [4, 6, 8, 10, 11] {
            let rtol = 10f64.powi(-e);
            let r = simulate(&s, &tolerance(rtol, Method::Auto), 0.0, &start, 1.5 * exact).unwrap();
            assert_eq!(r.outcome, Outcome::Reached, "rtol {rtol:e}: {}", r.reason);
            let off = (r.accumulations[0].t - exact).abs();
            assert!(off <= 100.0 * rtol, "{k1} {k2} {start:?} rtol {rtol:e}: {}", off / rtol);
            assert!(r.x.iter().all(|x| x.abs() <= rtol), "{k1} {k2} {start:?} rtol {rtol:e}: ends at {:?}", r.x);
            // what is followed is resolved: neither switches nor attempts at them are noise
            let tries = r.stats.relocations;
            assert!(r.switches.len() < 60 && tries < 1000, "{k1} {k2} {start:?} rtol {rtol:e}: {tries} attempts");
        }
    }
}

/// Super-twisting in the coordinates `p = x + v`, `q = x - v`, with a disturbance: the surface is no state, so rounding leaves the
/// state beside it, and the weights that keep it there come from differences of what is no larger than rounding.
#[test]
fn sliding_of_order_two_on_an_oblique_surface_has_no_noise() {
    for (k1, k2, start) in [(2.4, 1.0, [0.4, 0.9]), (1.5, 1.1, [-0.6, 0.5])] {
        let d = Dims { x: 2, u: 0, p: 0 };
        let (g, mut s) = (Graph::new(), System::new(2, 0, 0).unwrap());
        let (x, v) = (0.5 * (g.x(0) + g.x(1)), 0.5 * (g.x(0) - g.x(1)));
        let push = 0.4 * (2.0 * g.t()).sin();
        s.set_f0(Arc::new(g.function("f0", d, &[v + push, v - push]).unwrap())).unwrap();
        let root = (x * x).sqrt().sqrt();
        let (above, below) = (-k1 * root, k1 * root);
        add_relay(&mut s, &g, &[0, 1], &[above - k2, above + k2], &[below + k2, below - k2], x);
        for rtol in [1e-8, 1e-10] {
            let r = simulate(&s, &tolerance(rtol, Method::Auto), 0.0, &start, 6.0).unwrap();
            assert_eq!(r.outcome, Outcome::Reached, "{k1} {k2} rtol {rtol:e}: {}", r.reason);
            assert!(
                r.x.iter().all(|x| x.abs() <= rtol),
                "{k1} {k2} rtol {rtol:e}: ends at {:?} {:?}",
                r.x,
                r.accumulations
            );
            assert!(r.stats.steps < 10_000, "{k1} {k2} rtol {rtol:e}: {} steps", r.stats.steps);
        }
    }
}

/// Gains and disturbances with few switches before the end, or none: the state comes to rest in the set by itself.
#[test]
fn super_twisting_ends_in_sliding_of_order_two_without_switches_too() {
    let cases =
        [(3.5, 1.3, 0.0, 1.0), (4.9, 2.8, 1.3, -0.7), (2.6, 1.0, 0.8, 0.4), (3.0, 1.5, 0.2, 1.2), (3.9, 3.4, 0.4, 0.3)];
    let mut failed = Vec::new();
    for (k, (a, b, disturbance, x0)) in cases.into_iter().enumerate() {
        let d = Dims { x: 2, u: 0, p: 0 };
        let (g, mut s) = (Graph::new(), System::new(2, 0, 0).unwrap());
        s.set_f0(Arc::new(g.function("f0", d, &[g.x(1), disturbance * g.t().cos()]).unwrap())).unwrap();
        let (x, gain) = (g.x(0), g.constant(b));
        add_relay(&mut s, &g, &[0, 1], &[-a * x.sqrt(), -gain], &[a * (-x).sqrt(), gain], x);
        for e in 4..=11 {
            let rtol = 10f64.powi(-e);
            let start = [x0, 0.2 * k as f64 - 0.5];
            let r = simulate(&s, &tolerance(rtol, Method::Auto), 0.0, &start, 6.0).unwrap();
            if r.outcome != Outcome::Reached || largest(r.x.iter().copied()) > 1e-2 * rtol {
                failed.push((k, e, r.t, r.x, r.reason));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

/// Wheel slip held by a relay behind an actuator of first order: switches come closer without an end.
#[test]
fn a_relay_behind_an_actuator_is_followed_into_sliding_of_order_two() {
    let d = Dims { x: 3, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(3, 0, 0).unwrap());
    let slip = (g.x(0) - 0.3 * g.x(1)) / g.x(0);
    let force = 300.0 * 9.81 * (1.28 * (1.0 - (-23.99 * slip).exp()) - 0.52 * slip);
    let smooth = [-force / 300.0, 0.3 * force - g.x(2), -50.0 * g.x(2)];
    s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
    add_relay(&mut s, &g, &[2], &[g.constant(0.0)], &[g.constant(1800.0 / 0.02)], slip - 0.2);
    let run = |t: f64| simulate(&s, &tolerance(1e-6, Method::Auto), 0.0, &[30.0, 100.0, 0.0], t).unwrap();
    let (one, two) = (run(1.0), run(2.0));
    assert_eq!(two.outcome, Outcome::Reached, "{}", two.reason);
    assert!(two.switches.len() < 10_000, "{}", two.switches.len());
    assert!((1.0 - 0.3 * two.x[1] / two.x[0] - 0.2).abs() <= 1e-9, "{:?}", two.x);
    let slowing = 9.81 * (1.28 * (1.0 - (-23.99f64 * 0.2).exp()) - 0.52 * 0.2);
    assert!((one.x[0] - two.x[0] - slowing).abs() <= 1e-6 * 30.0, "{:?} {:?}", one.x, two.x);
}

/// Spirals into the intersection of two surfaces, at tolerances down to rounding.
#[test]
fn a_spiral_into_two_surfaces_goes_on_at_every_tolerance() {
    let d = Dims { x: 3, u: 0, p: 0 };
    let (g, mut s) = (Graph::new(), System::new(3, 0, 0).unwrap());
    s.set_f0(Arc::new(g.function("f0", d, &[g.constant(0.0), g.constant(0.0), g.constant(1.0)]).unwrap())).unwrap();
    for (surface, own) in [(0, [-0.7, 2.0, 0.3]), (1, [-2.0, -0.7, -0.5])] {
        let side = |sign: f64| own.map(|v| g.constant(sign * v));
        add_relay(&mut s, &g, &[0, 1, 2], &side(1.0), &side(-1.0), g.x(surface));
    }
    for e in 4..=12 {
        let rtol = 10f64.powi(-e);
        let r = simulate(&s, &tolerance(rtol, Method::Auto), 0.0, &[1.0, 0.2, 0.0], 3.0).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "rtol {rtol:e}: {}", r.reason);
        assert!(largest(r.x[..2].iter().copied()) <= 1e-2 * rtol, "rtol {rtol:e}: {:?}", r.x);
    }
}

/// Rooms with ideal thermostats that cool down or warm up to their temperatures, in closed form. What the heaters add are constants. With
/// many of them steps are so short that order three is enough, which has three evaluations in a step and one or two at a switch.
#[test]
fn rooms_reach_their_temperatures() {
    const OUTSIDE: f64 = 8.0;
    let (loss, level, heat) = (
        |i: usize| 1.0 + 0.05 * (i % 5) as f64,
        |i: usize| 20.0 + 0.1 * (i % 25) as f64,
        |i: usize| 18.0 + 0.3 * (i % 3) as f64,
    );
    for (n, rtol) in [(25, 1e-4), (25, 1e-6), (25, 1e-9), (400, 1e-3), (400, 1e-6)] {
        let g = Graph::new();
        let rates: Vec<_> =
            (0..n).map(|i| loss(i) * (OUTSIDE - g.x(i)) + 0.5 * heat(i) * (1.0 - (g.x(i) - level(i)).sign())).collect();
        let system = Model::from_rhs("rooms", 0, 0, &rates).and_then(|m| m.build(&g)).unwrap().system;
        let start: Vec<f64> = (0..n).map(|i| level(i) + 5.0 * (2.1 * i as f64 + 0.4).sin()).collect();
        let s = simulate(&system, &Options::with_tolerance(rtol, rtol), 0.0, &start, 3.0).unwrap();
        let mut times: Vec<f64> = (0..n)
            .map(|i| {
                let limit = OUTSIDE + if start[i] < level(i) { heat(i) / loss(i) } else { 0.0 };
                ((start[i] - limit) / (level(i) - limit)).ln() / loss(i)
            })
            .collect();
        times.sort_by(f64::total_cmp);
        assert_eq!(s.switches.len(), n, "{rtol}");
        for (s, t) in s.switches.iter().zip(times) {
            assert!((s.t - t).abs() < 10.0 * rtol, "{rtol}: {} and not {t}", s.t);
        }
        for (i, x) in s.x.iter().enumerate() {
            assert!((x - level(i)).abs() < 1e-12 * level(i), "{rtol}, room {i}: {x}");
        }
        assert!(n < 400 || 2 * s.stats.evaluations < 13 * n, "{n} rooms, {rtol}: {:?}", s.stats);
    }
}

/// Rooms that warm up through a temperature at which a heater is switched off, in closed form: where one switch follows the other steps end
/// at them on their dense output, and derivatives follow that, forward and as the transpose.
#[test]
fn derivatives_follow_steps_that_end_inside() {
    const N: usize = 40;
    const OUTSIDE: f64 = 25.0;
    const END: f64 = 1.2;
    let (loss, level) = (|i: usize| 1.0 + 0.05 * (i % 5) as f64, |i: usize| 20.0 + 0.1 * (i % 25) as f64);
    let g = Graph::new();
    let rates: Vec<_> =
        (0..N).map(|i| loss(i) * (OUTSIDE - g.x(i)) + 4.0 * (1.0 - (g.x(i) - level(i)).sign())).collect();
    let system = Model::from_rhs("rooms", 0, 0, &rates).and_then(|m| m.build(&g)).unwrap().system;
    let start: Vec<f64> = (0..N).map(|i| level(i) - 4.0 - 3.0 * (2.1 * i as f64 + 0.4).sin()).collect();
    for rtol in [1e-4, 1e-6] {
        let run = |by: Sensitivity| {
            let options = Options { sensitivity: by, adjoint: true, ..Options::with_tolerance(rtol, rtol) };
            let mut e = Engine::new(&system, &options).unwrap();
            e.reinit(0.0, &start).unwrap();
            assert_eq!(e.advance(END).unwrap(), Outcome::Reached);
            assert_eq!(e.switches().len(), N);
            e
        };
        let (mut swept, mut both) = (run(Sensitivity::Off), run(Sensitivity::On));
        let own = swept.stats().evaluations;
        assert!(own <= 13 * N, "{rtol:e}: {own} evaluations");
        let s = both.sensitivity().unwrap().to_vec();
        let v: Vec<f64> = (0..N).map(|i| 1.0 + 0.3 * i as f64).collect();
        // without derivatives on the way the last digits of what is not evaluated again are others
        let (gradient, alone) = (both.adjoint(&v, &[]).unwrap().x0, swept.adjoint(&v, &[]).unwrap().x0);
        for i in 0..N {
            let warm = OUTSIDE + 8.0 / loss(i);
            let time = ((start[i] - warm) / (level(i) - warm)).ln() / loss(i);
            let exact = (level(i) - OUTSIDE) / (start[i] - warm) * (-loss(i) * (END - time)).exp();
            let row = &s[i * N..(i + 1) * N];
            assert!((row[i] - exact).abs() <= 10.0 * rtol, "{rtol:e}, room {i}: {} and not {exact}", row[i]);
            assert!((0..N).all(|c| c == i || row[c] == 0.0), "room {i}: {row:?}");
            assert!((alone[i] / v[i] - exact).abs() <= 10.0 * rtol, "{rtol:e}, room {i}: {} and not {exact}", alone[i]);
            assert!((gradient[i] - v[i] * row[i]).abs() < 1e-12 * v[i], "{rtol:e}, room {i}: {}", gradient[i]);
        }
    }
}

/// Blocks on a belt that do not touch, each with a spring and friction of its own: the derivatives of each are those of the block by itself, all others
/// are zero, and the adjoint, along the same explicit steps, is the transpose.
#[test]
fn derivatives_of_blocks_are_those_of_each() {
    const N: usize = 6;
    let system = |first: usize, n: usize| {
        let (d, g, mut s) = (Dims { x: 2 * n, u: 0, p: n }, Graph::new(), System::new(2 * n, 0, n).unwrap());
        let smooth: Vec<Expr> = (0..n).flat_map(|i| [g.x(2 * i + 1), -g.p(i) * g.x(2 * i)]).collect();
        s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
        for i in 0..n {
            let slip = 0.1 - g.x(2 * i + 1);
            let size = 1.0 + 0.02 * (first + i) as f64;
            let (plus, minus) = (size / (1.0 + 2.5 * slip), -size / (1.0 - 2.5 * slip));
            add_relay(&mut s, &g, &[2 * i + 1], &[plus], &[minus], slip);
        }
        s
    };
    let run_by = |by: Sensitivity, first: usize, n: usize| {
        let options = Options { sensitivity: by, adjoint: true, ..tolerance(1e-9, Method::Auto) };
        let mut e = Engine::new(&system(first, n), &options).unwrap();
        let x0: Vec<f64> = (first..first + n).flat_map(|i| [0.3 * (1.7 * i as f64 + 0.3).sin(), 0.0]).collect();
        e.reinit(0.0, &x0).unwrap();
        e.set_params(&(first..first + n).map(|i| 1.0 + 0.01 * i as f64).collect::<Vec<f64>>()).unwrap();
        assert_eq!(e.advance(14.0).unwrap(), Outcome::Reached);
        assert!(e.stats().switches > n && e.stats().factorisations == 0, "{:?}", e.stats());
        e
    };
    let run = |first: usize, n: usize| run_by(Sensitivity::On, first, n);
    let mut all = run(0, N);
    let s = all.sensitivity().unwrap().to_vec();
    let width = 3 * N;
    // by parameters only: the same columns
    let by_inputs = run_by(Sensitivity::Inputs, 0, N);
    let own: Vec<f64> = s.chunks_exact(width).flat_map(|row| row[2 * N..].to_vec()).collect();
    assert_eq!(by_inputs.sensitivity().unwrap(), own);
    assert!(by_inputs.switches().iter().zip(all.switches()).all(|(a, b)| a.dt == b.dt[2 * N..]));
    for k in 0..N {
        let one = run(k, 1).sensitivity().unwrap().to_vec();
        for (i, row) in s.chunks_exact(width).enumerate().skip(2 * k).take(2) {
            for (c, v) in row.iter().enumerate() {
                let own = [2 * k, 2 * k + 1, 2 * N + k].iter().position(|o| *o == c);
                let expected = own.map_or(0.0, |o| one[3 * (i - 2 * k) + o]);
                assert!((v - expected).abs() < 1e-7, "block {k}, row {i}, column {c}: {v} and not {expected}");
            }
        }
    }
    let v: Vec<f64> = (0..2 * N).map(|i| 1.0 + 0.3 * i as f64).collect();
    let gradient = all.adjoint(&v, &[]).unwrap();
    // forward and in the sweep: a block has a velocity, and a force that depends on its own states and parameter
    let stats = all.stats();
    assert!(stats.entries > 0 && stats.entries <= stats.jacobians * 4 * N, "{stats:?}");
    for (c, g) in gradient.x0.iter().chain(&gradient.p).enumerate() {
        let forward: f64 = v.iter().enumerate().map(|(i, v)| v * s[i * width + c]).sum();
        assert!((g - forward).abs() < 1e-9 * (1.0 + forward.abs()), "column {c}: {g} and {forward}");
    }
}

/// Blocks on a belt with the speed `p0`, the first two of which rub on each other. Where one slides with the belt its speed is `p0`
/// whatever else happens: the derivative of that is one, and nothing is differentiated for it. The surface between two blocks
/// depends on two states and has all its derivatives. Beside Radau IIA, whose derivatives know nothing of this.
#[test]
fn what_a_surface_holds_still_is_not_differentiated() {
    const N: usize = 4;
    let system = |rub: bool| {
        let (d, g, mut s) = (Dims { x: 2 * N, u: 0, p: 2 }, Graph::new(), System::new(2 * N, 0, 2).unwrap());
        let pull =
            |i: usize| -g.p(1) * (1.0 + 0.1 * i as f64) * g.x(2 * i) + 0.3 * (g.x((2 * i + 2) % (2 * N)) - g.x(2 * i));
        let smooth: Vec<Expr> = (0..N).flat_map(|i| [g.x(2 * i + 1), pull(i)]).collect();
        s.set_f0(Arc::new(g.function("f0", d, &smooth).unwrap())).unwrap();
        for i in 0..N {
            let slip = g.p(0) - g.x(2 * i + 1);
            let (plus, minus) = (1.0 / (1.0 + 2.5 * slip), -1.0 / (1.0 - 2.5 * slip));
            add_relay(&mut s, &g, &[2 * i + 1], &[plus], &[minus], slip);
        }
        if rub {
            let c = g.constant(0.05);
            add_relay(&mut s, &g, &[1, 3], &[-c, c], &[c, -c], g.x(1) - g.x(3));
        }
        s
    };
    let run = |rub: bool, method: Method, end: f64| {
        let options = Options { sensitivity: Sensitivity::On, adjoint: true, ..tolerance(1e-9, method) };
        let mut e = Engine::new(&system(rub), &options).unwrap();
        let x0: Vec<f64> = (0..N).flat_map(|i| [0.1 * (1.7 * i as f64 + 0.3).sin(), 0.2]).collect();
        e.reinit(0.0, &x0).unwrap();
        e.set_params(&[0.2, 1.1]).unwrap();
        assert_eq!(e.advance(end).unwrap(), Outcome::Reached);
        e
    };
    let width = 2 * N + 2;
    // all of them slide, and the place is the start and the way of the belt
    let e = run(false, Method::Auto, 0.5);
    for (i, row) in e.sensitivity().unwrap().chunks_exact(2 * width).enumerate() {
        for c in 0..width {
            let (place, speed) = (f64::from(c == 2 * i) + 0.5 * f64::from(c == 2 * N), f64::from(c == 2 * N));
            assert!((row[c] - place).abs() < 1e-14, "{i}, {c}: {} and not {place}", row[c]);
            assert_eq!(row[width + c], speed, "{i}, {c}");
        }
    }
    let stats = e.stats();
    assert!(stats.jacobians > 0 && stats.entries == stats.jacobians * N, "more than the rows of the places: {stats:?}");
    for rub in [false, true] {
        let mut e = run(rub, Method::Auto, 9.0);
        assert!(e.stats().switches > N && e.stats().factorisations == 0, "{:?}", e.stats());
        let s = e.sensitivity().unwrap().to_vec();
        let implicit = run(rub, Method::Radau5, 9.0);
        let size = largest(s.iter().copied());
        let apart = largest(s.iter().zip(implicit.sensitivity().unwrap()).map(|(a, b)| a - b));
        assert!(size > 0.5 && apart < 1e-6 * size, "{apart} of {size}");
        let v: Vec<f64> = (0..2 * N).map(|i| 1.0 + 0.3 * i as f64).collect();
        let gradient = e.adjoint(&v, &[]).unwrap();
        for (c, g) in gradient.x0.iter().chain(&gradient.p).enumerate() {
            let forward: f64 = v.iter().enumerate().map(|(i, v)| v * s[i * width + c]).sum();
            assert!((g - forward).abs() < 1e-10 * (1.0 + size), "column {c}: {g} and {forward}");
        }
    }
}

/// A function that can do nothing but what every function can.
struct Plain(Arc<dyn Function>);

impl Function for Plain {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn dims(&self) -> Dims {
        self.0.dims()
    }
    fn n_out(&self) -> usize {
        self.0.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        self.0.jac_pattern()
    }
    fn hess_pattern(&self) -> &Pattern {
        self.0.hess_pattern()
    }
    fn work_len(&self) -> usize {
        self.0.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.0.value(at, out, work)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.0.jacobian(at, out, work)
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.0.hessian(at, weights, out, work)
    }
}

/// `y_k' = cos(t + 0.3 k) + 0.1 z_{k−1} − (2 + p + 0.3 sin z_k) σ_k + (0.5 + 0.1 z_{k−1}²) σ_{k−1}`, `z_k' = σ_k`: relays that slide
/// together, with weights that depend on everything, as expressions and as functions of which only values at one point are known.
fn bent_relays(n: usize, plain: bool) -> System {
    let d = Dims { x: 2 * n, u: 0, p: 1 };
    let (g, mut s) = (Graph::new(), System::new(2 * n, 0, 1).unwrap());
    let known = |f: Arc<dyn Function>| -> Arc<dyn Function> {
        if plain {
            Arc::new(Plain(f))
        } else {
            f
        }
    };
    let z = |k: usize| g.x(2 * k + 1);
    let push = |k: usize| (g.t() + 0.3 * k as f64).cos() + if k > 0 { 0.1 * z(k - 1) } else { g.constant(0.0) };
    let smooth: Vec<Expr> = (0..n).flat_map(|k| [push(k), g.constant(0.0)]).collect();
    s.set_f0(known(Arc::new(g.function("f0", d, &smooth).unwrap()))).unwrap();
    for k in 0..n {
        let plus = [-(2.0 + g.p(0) + 0.3 * z(k).sin()), g.constant(1.0), 0.5 + 0.1 * z(k) * z(k)];
        let minus = [2.0 + g.p(0) + 0.3 * z(k).sin(), g.constant(-1.0), -(0.5 + 0.1 * z(k) * z(k))];
        let (rows, m) = ([2 * k, 2 * k + 1, 2 * k + 2], if k + 1 < n { 3 } else { 2 });
        let ids = g.ids(&[&plus[..m], &minus[..m]].concat());
        let modes = Arc::new(ExprFunction::with_parts("modes", &mut g.dag(), d, &ids, m).unwrap());
        let psi = known(Arc::new(g.function("psi", d, &[g.x(2 * k)]).unwrap()));
        let regions = Regions::Signs { psi, signs: vec![1, -1] };
        s.add_subsystem(Subsystem { rows: rows[..m].to_vec(), modes: known(modes), n_modes: 2, regions }).unwrap();
    }
    s
}

/// A run of [`bent_relays`] from where one relay has to reach its surface first.
fn bent_run(plain: bool, sensitivity: Sensitivity, adjoint: bool, method: Method) -> Engine {
    let n = 4;
    let mut engine =
        Engine::new(&bent_relays(n, plain), &Options { sensitivity, adjoint, h_max: 0.1, ..tolerance(1e-7, method) })
            .unwrap();
    let mut start = vec![0.0; 2 * n];
    start[2] = 0.4;
    engine.set_params(&[0.2]).unwrap();
    engine.reinit(0.0, &start).unwrap();
    assert_eq!(engine.advance(2.0).unwrap(), Outcome::Reached);
    engine
}

#[test]
fn stages_side_by_side_have_the_derivatives_of_one_after_the_other() {
    for method in [Method::Dp5, Method::Dop853] {
        let mut runs = [false, true].map(|plain| bent_run(plain, Sensitivity::On, true, method));
        let s = [0, 1].map(|i| runs[i].sensitivity().unwrap().to_vec());
        let size = largest(s[1].iter().copied());
        assert!(largest(s[0].iter().zip(&s[1]).map(|(a, b)| a - b)) < 1e-11 * size, "{method:?}");
        // they are no trivial ones
        assert!(s[1]
            .chunks(9)
            .skip(1)
            .step_by(2)
            .all(|row| row.iter().any(|v| v.abs() > 1e-3 && (v - 1.0).abs() > 1e-3)));
        let v: Vec<f64> = (0..8).map(|i| (1.0 + f64::from(i)).cos()).collect();
        let expected: Vec<f64> = (0..9).map(|c| (0..8).map(|i| v[i] * s[1][9 * i + c]).sum()).collect();
        for engine in &mut runs {
            let g = engine.adjoint(&v, &[]).unwrap();
            let off = g.x0.iter().chain(&g.p).zip(&expected).map(|(a, b)| a - b);
            assert!(largest(off) < 1e-10 * size, "{method:?}");
        }
    }
}

/// Velocities, weights and modes at the stages are those the step was made with: what derivatives evaluate beside are the ends of steps.
#[test]
fn derivatives_evaluate_no_stage_a_second_time() {
    for method in [Method::Dp5, Method::Dop853] {
        let plain = bent_run(false, Sensitivity::Off, false, method).stats();
        for (sensitivity, adjoint) in [(Sensitivity::On, false), (Sensitivity::Off, true)] {
            let mut engine = bent_run(false, sensitivity, adjoint, method);
            if adjoint {
                engine.adjoint(&[1.0; 8], &[]).unwrap();
            }
            let stats = engine.stats();
            assert_eq!(stats.steps, plain.steps);
            let more = stats.evaluations - plain.evaluations;
            assert!(more <= 4 * stats.steps, "{method:?}, {sensitivity:?}: {more} more in {} steps", stats.steps);
        }
    }
}
