//! Hard cases of event-driven simulation.

#[path = "common/counting.rs"]
mod counting;
use counting::count;

mod common;
use common::models::*;
use std::sync::Arc;
use switchback::event::{simulate, simulate_batch, Engine, Kind, Method, Options, Outcome, Progress, Run, Zeno};
use switchback::func::{Callback, Dims, EvalError, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::system::{Regions, SharedFunction, Subsystem, System};

fn tol(t: f64) -> Options {
    Options::with_tolerance(t, t)
}

fn dims(x: usize) -> Dims {
    Dims { x, u: 0, p: 0 }
}

/// A function of state and time by values; derivatives are differences.
fn fun(n: usize, m: usize, f: impl Fn(f64, &[f64], &mut [f64]) + Send + Sync + 'static) -> SharedFunction {
    let all: Vec<(usize, usize)> = (0..=n).flat_map(|j| (0..m).map(move |i| (i, j))).collect();
    let c = Callback::new("f", dims(n), m, move |at, o| {
        f(at.t, at.x, o);
        0
    });
    Arc::new(c.with_jacobian_pattern(pattern(m, n + 1, &all)).unwrap())
}

/// `n` states, two modes on the two sides of `ψ = 0`, the first where `ψ > 0`.
fn two_sides(
    n: usize,
    f: impl Fn(f64, &[f64], &mut [f64]) + Send + Sync + 'static,
    psi: impl Fn(f64, &[f64], &mut [f64]) + Send + Sync + 'static,
) -> System {
    let mut s = System::new(n, 0, 0).unwrap();
    add_sides(&mut s, &(0..n).collect::<Vec<_>>(), fun(n, 2 * n, f), fun(n, 1, psi));
    s
}

fn reached(r: &Run, what: &str) {
    assert_eq!(r.outcome, Outcome::Reached, "{what}: {}", r.reason);
}

/// A parabola that touches the surface, misses it, or cuts it by little.
#[test]
fn grazing_from_both_sides() {
    // above: y'' = 2; below: y'' = −3
    let sys = || {
        two_sides(
            2,
            |_, x, o| {
                (o[0], o[1]) = (x[1], 2.0);
                (o[2], o[3]) = (x[1], -3.0);
            },
            |_, x, o| o[0] = x[0],
        )
    };
    for gap in [1e-3, 1e-6, 1e-9] {
        let r = simulate(&sys(), &tol(1e-10), 0.0, &[1.0 + gap, -2.0], 3.0).unwrap();
        reached(&r, "above");
        assert!(r.switches.is_empty(), "{gap}: {:?}", r.switches);
        assert!((r.x[0] - (4.0 + gap)).abs() < 1e-8, "{gap}: {:?}", r.x);
        // (1 − t)² = gap, then down for ever
        let r = simulate(&sys(), &tol(1e-10), 0.0, &[1.0 - gap, -2.0], 3.0).unwrap();
        reached(&r, "below");
        let hit = 1.0 - gap.sqrt();
        assert_eq!(r.switches.len(), 1, "{gap}: {:?}", r.switches);
        assert!((r.switches[0].t - hit).abs() < 1e-9 / gap.sqrt(), "{gap}: {:?}", r.switches);
        let left = 3.0 - hit;
        let exact = -2.0 * gap.sqrt() * left - 1.5 * left * left;
        assert!((r.x[0] - exact).abs() < 1e-8 / gap.sqrt(), "{gap}: {:?}, {exact}", r.x);
        // near grazing is said
        let size = 2.0 * gap.sqrt() / (4.0 * gap + 4.0).sqrt();
        assert!((r.switches[0].transversality + size).abs() < 1e-3 * size + 1e-9 / gap.sqrt(), "{:?}", r.switches);
    }
    let r = simulate(&sys(), &tol(1e-10), 0.0, &[1.0, -2.0], 3.0).unwrap();
    assert!(r.outcome == Outcome::Reached && r.stats.steps < 1000, "{:?}", r.stats);
}

/// A dip of the switching function far shorter than a step.
#[test]
fn two_crossings_in_one_step() {
    for width in [1e-2, 1e-4, 1e-6] {
        // x = t; ψ = (x − ⅓)² − width², no change of the field: both crossings are found
        let sys = two_sides(1, |_, _, o| o.fill(1.0), move |_, x, o| o[0] = (x[0] - 1.0 / 3.0).powi(2) - width * width);
        let r = simulate(&sys, &tol(1e-6), 0.0, &[0.0], 1.0).unwrap();
        reached(&r, "dip");
        let t: Vec<f64> = r.switches.iter().map(|s| s.t).collect();
        assert_eq!(t.len(), 2, "{width}: {:?}", r.switches);
        let exact = [1.0 / 3.0 - width, 1.0 / 3.0 + width];
        assert!(t.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-9), "{width}: {t:?}");
    }
}

/// The state rests or moves on a straight line, the switching function does not.
#[test]
fn steps_resolve_what_is_watched() {
    let sys = two_sides(1, |_, _, o| o.fill(1.0), |_, x, o| o[0] = (40.0 * x[0] + 0.3).sin());
    let r = simulate(&sys, &tol(1e-4), 0.0, &[0.0], 5.0).unwrap();
    reached(&r, "sin");
    let exact: Vec<f64> = (1..).map(|k| (f64::from(k) * PI - 0.3) / 40.0).take_while(|t| *t < 5.0).collect();
    assert_eq!(r.switches.len(), exact.len());
    assert!(r.switches.iter().zip(&exact).all(|(s, t)| (s.t - t).abs() < 1e-12));
    // v sticks under a force that grows in bursts: |F| > 1 first at sin 30t = 1/(0.05 t)
    let sys = two_sides(
        1,
        |t, _, o| {
            let f = 0.05 * t * (30.0 * t).sin();
            (o[0], o[1]) = (-1.0 + f, 1.0 + f);
        },
        |_, x, o| o[0] = x[0],
    );
    let r = simulate(&sys, &tol(1e-4), 0.0, &[0.0], 21.0).unwrap();
    reached(&r, "burst");
    let s = r.switches.first().expect("it slips");
    assert!(s.kind == Kind::Leave && (s.t - 20.0).abs() < 0.2, "{s:?}");
    assert!((0.05 * s.t * (30.0 * s.t).sin().abs() - 1.0).abs() < 1e-10, "{s:?}");
}

/// A first step of a number of periods, at whose ends and in the middle of which the switching function is the same: a switched
/// circuit that starts at rest is simulated over a number of periods, and a guess is a part of that.
#[test]
fn a_first_step_of_a_number_of_periods_shows_them() {
    const PERIODS: f64 = 16.0;
    let level: f64 = 0.2;
    let on = move |t: f64| (std::f64::consts::TAU * t).sin() - level;
    let system = two_sides(1, |_, _, o| (o[0], o[1]) = (1.0, 0.0), move |t, _, o| o[0] = on(t));
    let share = 0.5 - level.asin() / std::f64::consts::PI;
    for h0 in [1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 13.0, 16.0, 1.0 / 3.0] {
        let s = simulate(&system, &Options { h0, ..tol(1e-6) }, 0.0, &[0.0], PERIODS).unwrap();
        assert_eq!(s.switches.len(), 32, "a first step of {h0}");
        assert!((s.x[0] - share * PERIODS).abs() < 1e-5, "a first step of {h0}: {:?}", s.x);
    }
}

#[test]
fn two_surfaces_hit_at_once_at_any_angle() {
    for angle in [0.1, 0.7, 1.3, PI / 2.0, 2.0, 3.0] {
        let (c, s) = (f64::cos(angle), f64::sin(angle));
        // both surfaces go through the origin, which is hit at t = 1 along (1, 1/2); they act on states of their own
        let mut sys = System::new(4, 0, 0).unwrap();
        sys.set_f0(affine("f0", dims(4), &[1.0, 0.5, 0.0, 0.0], &[])).unwrap();
        add_sides(
            &mut sys,
            &[2],
            affine("F", dims(4), &[1.0, -1.0], &[]),
            affine("a", dims(4), &[0.0], &[(0, 0, 1.0)]),
        );
        let b = affine("b", dims(4), &[0.0], &[(0, 0, c), (0, 1, s)]);
        add_sides(&mut sys, &[3], affine("F", dims(4), &[1.0, -1.0], &[]), b);
        let r = simulate(&sys, &tol(1e-8), 0.0, &[-1.0, -0.5, 0.0, 0.0], 3.0).unwrap();
        reached(&r, "angle");
        assert_eq!(r.switches.len(), 2, "{angle}: {:?}", r.switches);
        assert!(r.switches.iter().all(|w| (w.t - 1.0).abs() < 1e-14), "{angle}: {:?}", r.switches);
        let down = if c + 0.5 * s > 0.0 { 1.0 } else { -1.0 };
        assert!((r.x[2] - 1.0).abs() < 1e-12 && (r.x[3] - down).abs() < 1e-12, "{angle}: {:?}", r.x);
    }
}

#[test]
fn simultaneous_switches_of_equal_parts() {
    // two oscillators with stick-slip that do not know of each other
    let mut sys = System::new(4, 0, 0).unwrap();
    for k in [0, 2] {
        let f = fun(4, 4, move |_, x, o| {
            let (a, v) = (x[k], x[k + 1]);
            (o[0], o[1]) = (v, -a - 1.0 / (0.8 + v).max(1e-3));
            (o[2], o[3]) = (v, -a + 1.0 / (1.2 - v));
        });
        add_sides(&mut sys, &[k, k + 1], f, affine("psi", dims(4), &[-0.2], &[(0, k + 1, 1.0)]));
    }
    let r = simulate(&sys, &tol(1e-9), 0.0, &[-0.8, -1.0, -0.8, -1.0], 40.0).unwrap();
    reached(&r, "pair");
    assert_eq!(r.switches.len(), 18, "{:?}", r.switches);
    assert!(r.switches.iter().all(|s| s.simultaneous), "{:?}", r.switches);
    assert_eq!(r.x[..2], r.x[2..]);
    assert!((r.x[0] - 1.1678521419331505).abs() < 1e-6, "{:?}", r.x);
}

#[test]
fn entering_and_leaving_within_one_step() {
    // ẋ = −sign x + t − c: the mode is entered just before it ends
    for short in [1e-2, 1e-4, 1e-6] {
        let sys = two_sides(1, |t, _, o| (o[0], o[1]) = (-1.0 + t, 1.0 + t), |_, x, o| o[0] = x[0]);
        // from below at t = 1 − short: x0 = −∫(1 + t)
        let t0 = 1.0 - short;
        let x0 = -(t0 + 0.5 * t0 * t0);
        let r = simulate(&sys, &tol(1e-8), 0.0, &[x0], 2.0).unwrap();
        reached(&r, "short");
        let kinds: Vec<Kind> = r.switches.iter().map(|s| s.kind).collect();
        assert_eq!(kinds, [Kind::Enter, Kind::Leave], "{short}: {:?}", r.switches);
        assert!((r.switches[0].t - t0).abs() < 1e-12 && (r.switches[1].t - 1.0).abs() < 1e-12, "{:?}", r.switches);
        assert!((r.x[0] - 0.5).abs() < 1e-12, "{:?}", r.x);
    }
}

/// Three friction contacts that all stick, then let go one after the other.
#[test]
fn sliding_on_an_intersection_of_three_surfaces() {
    let mut sys = System::new(3, 0, 0).unwrap();
    sys.set_f0(affine("f0", dims(3), &[0.0; 3], &[(0, 3, 1.0), (1, 3, 0.5), (2, 3, 0.25)])).unwrap();
    for k in 0..3 {
        let psi = affine("psi", dims(3), &[0.0], &[(0, k, 1.0)]);
        add_sides(&mut sys, &[k], affine("F", dims(3), &[-1.0, 1.0], &[]), psi);
    }
    let r = simulate(&sys, &tol(1e-9), 0.0, &[0.0; 3], 5.0).unwrap();
    reached(&r, "three");
    let found: Vec<(usize, f64)> = r.switches.iter().map(|s| (s.subsystem, s.t)).collect();
    assert!(found.len() == 3 && r.switches.iter().all(|s| s.kind == Kind::Leave), "{found:?}");
    for (k, (sub, t)) in found.iter().enumerate() {
        assert!(*sub == k && (t - f64::from(1 << k)).abs() < 1e-11, "{found:?}");
    }
    let exact = [8.0, 0.25 * 9.0, 0.125];
    assert!(r.x.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-10), "{:?}", r.x);
}

/// One subsystem with four modes that slides on both surfaces, where weights are not unique.
#[test]
fn sliding_on_an_intersection_within_one_subsystem() {
    let mut sys = System::new(2, 0, 0).unwrap();
    let modes = affine("F", dims(2), &[-1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0], &[]);
    let psi = affine("psi", dims(2), &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    let regions = Regions::Signs { psi, signs: vec![1, 1, 1, -1, -1, 1, -1, -1] };
    sys.add_subsystem(Subsystem { rows: vec![0, 1], modes, n_modes: 4, regions }).unwrap();
    let r = simulate(&sys, &tol(1e-9), 0.0, &[1.0, 0.25], 3.0).unwrap();
    reached(&r, "four");
    assert!(r.x.iter().all(|v| v.abs() < 1e-14), "{:?}", r.x);
    let t: Vec<f64> = r.switches.iter().map(|s| s.t).collect();
    assert!(t.len() == 2 && (t[0] - 0.25).abs() < 1e-14 && (t[1] - 1.0).abs() < 1e-14, "{:?}", r.switches);
}

#[test]
fn stiff_modes() {
    // x follows cos t at rate 1e6, the mode of y switches with it
    let stiff = |_: f64, x: &[f64], o: &mut [f64]| {
        let pull = -1e6 * (x[0] - x[1].cos());
        (o[0], o[1], o[2]) = (pull, 1.0, 1.0);
        (o[3], o[4], o[5]) = (pull, 1.0, -2.0);
    };
    let sys = two_sides(3, stiff, |_, x, o| o[0] = x[0]);
    for method in [Method::Auto, Method::Radau5] {
        let r = simulate(&sys, &Options { method, ..tol(1e-7) }, 0.0, &[1.0, 0.0, 0.0], 6.0).unwrap();
        reached(&r, "stiff");
        assert!(r.stats.steps < 2500, "{method:?}: {:?}", r.stats);
        assert_eq!(r.switches.len(), 2, "{:?}", r.switches);
        // sin-like lag of 1e-6
        let exact = [PI / 2.0 + 1e-6, 1.5 * PI + 1e-6];
        assert!(r.switches.iter().zip(&exact).all(|(s, t)| (s.t - t).abs() < 1e-6), "{:?}", r.switches);
        assert!((r.x[2] - (6.0 - 3.0 * PI)).abs() < 1e-5, "{:?}", r.x);
    }
}

#[test]
fn scaled_switching_functions_change_nothing() {
    let run = |scale: f64| {
        let sys = two_sides(
            2,
            |t, x, o| {
                let drive = -x[0] + (0.5 * t).cos();
                (o[0], o[1]) = (x[1], drive - 0.4);
                (o[2], o[3]) = (x[1], drive + 0.4);
            },
            move |_, x, o| o[0] = scale * x[1],
        );
        simulate(&sys, &tol(1e-8), 0.0, &[1.0, 0.2], 40.0).unwrap()
    };
    let plain = run(1.0);
    reached(&plain, "plain");
    assert_eq!(plain.switches.len(), 13);
    for scale in [1e8, 1e-8] {
        let r = run(scale);
        reached(&r, "scaled");
        assert_eq!(r.switches.len(), 13, "{scale}: {:?}", r.switches);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        assert!(r.switches.iter().zip(&plain.switches).all(|(a, b)| near(a.t, b.t) && a.kind == b.kind), "{scale}");
        assert!(near(r.x[0], plain.x[0]) && near(r.x[1], plain.x[1]), "{scale}: {:?}", r.x);
    }
}

#[test]
fn a_hundred_thousand_switches() {
    // a triangle wave between two walls: hysteresis by two surfaces is not needed, x'' = −sign x
    let sys = two_sides(2, |_, x, o| o.copy_from_slice(&[x[1], -1.0, x[1], 1.0]), |_, x, o| o[0] = x[0]);
    let period = 2.0; // half a period with v0 = 1
    let n = 100_000;
    let r = simulate(&sys, &tol(1e-10), 0.0, &[0.5, 0.0], f64::from(n) * period).unwrap();
    reached(&r, "many");
    assert_eq!(r.switches.len(), n as usize, "{:?}", r.stats);
    let last = &r.switches[n as usize - 1];
    assert!((last.t - (f64::from(n) * period - 1.0)).abs() < 1e-3, "{last:?}");
    assert!(r.stats.steps < 12 * n as usize, "{:?}", r.stats);
}

#[test]
fn the_log_is_bounded_and_a_run_can_be_interrupted() {
    let sys = || two_sides(2, |_, x, o| o.copy_from_slice(&[x[1], -1.0, x[1], 1.0]), |_, x, o| o[0] = x[0]);
    let r = simulate(&sys(), &Options { max_log: 10, ..tol(1e-8) }, 0.0, &[0.5, 0.0], 200.0).unwrap();
    assert_eq!((r.switches.len(), r.stats.switches), (10, 100));
    let mut e = Engine::new(&sys(), &tol(1e-8)).unwrap();
    let flag = Arc::new(std::sync::atomic::AtomicBool::new(false));
    e.set_interrupt(flag.clone());
    e.reinit(0.0, &[0.5, 0.0]).unwrap();
    e.advance(1.5).unwrap();
    flag.store(true, std::sync::atomic::Ordering::Relaxed);
    assert_eq!(e.advance(200.0), Err(switchback::error::Error::Interrupted));
    flag.store(false, std::sync::atomic::Ordering::Relaxed);
    assert_eq!(e.advance(200.0).unwrap(), Outcome::Reached);
    assert_eq!(e.switches().len(), 100);
}

/// Controls and parameters may change on the way: the active set is found anew.
#[test]
fn controls_that_change_on_the_way() {
    // ẋ = −sign x + u: sticks for |u| < 1
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut sys = System::new(1, 1, 0).unwrap();
    sys.set_f0(affine("f0", d, &[0.0], &[(0, 1, 1.0)])).unwrap();
    add_sides(&mut sys, &[0], affine("F", d, &[-1.0, 1.0], &[]), affine("psi", d, &[0.0], &[(0, 0, 1.0)]));
    let mut e = Engine::new(&sys, &tol(1e-9)).unwrap();
    e.reinit(0.0, &[0.5]).unwrap();
    for (t, u, x) in [(1.0, 0.5, 0.0), (2.0, 3.0, 2.0), (3.0, -1.0, 0.0), (4.0, 0.9, 0.0), (5.0, -2.0, -1.0)] {
        e.set_controls(&[u]).unwrap();
        assert_eq!(e.advance(t).unwrap(), Outcome::Reached, "{}", e.reason());
        assert!((e.state()[0] - x).abs() < 1e-12, "t = {t}: {:?}", e.state());
    }
    let kinds: Vec<Kind> = e.switches().iter().map(|s| s.kind).collect();
    assert_eq!(kinds[..2], [Kind::Enter, Kind::Leave], "{:?}", e.switches());
    assert!((e.switches()[1].t - 1.0).abs() < 1e-15, "{:?}", e.switches());
}

#[test]
fn denormal_and_huge_states() {
    for scale in [1e-300, 1e-150, 1e150, 1e280] {
        let sys = two_sides(2, |_, x, o| o.copy_from_slice(&[x[1], -x[0], x[1], -4.0 * x[0]]), |_, x, o| o[0] = x[0]);
        let opt = Options { rtol: vec![1e-9], atol: vec![0.0], ..Options::default() };
        let r = simulate(&sys, &opt, 0.0, &[scale, 0.0], 10.0).unwrap();
        reached(&r, &format!("{scale}"));
        // quarter periods of π/2 and half periods of π/2 and π
        let exact = [0.5, 1.0, 2.0, 2.5].map(|t| t * PI);
        assert!(r.switches.len() >= 4, "{scale}: {:?}", r.switches);
        assert!(r.switches.iter().zip(&exact).all(|(s, t)| (s.t - t).abs() < 1e-7), "{scale}: {:?}", r.switches);
    }
}

/// Two modes, each defined on its own side only.
struct Halves {
    jac: Pattern,
    hess: Pattern,
}

impl Function for Halves {
    fn name(&self) -> &str {
        "F"
    }
    fn dims(&self) -> Dims {
        dims(1)
    }
    fn n_out(&self) -> usize {
        2
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.value_rows(at, 0..1, out, work)?;
        self.value_rows(at, 1..2, out, work)
    }
    fn value_rows(&self, at: &Point, rows: std::ops::Range<usize>, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let v = if rows.start == 0 { 1.0 + at.x[0].sqrt() } else { 1.0 + (-at.x[0]).sqrt() };
        out[rows.start] = v;
        v.is_finite().then_some(()).ok_or(EvalError::Recoverable)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out[0] = 0.5 / at.x[0].sqrt();
        out[1] = -0.5 / (-at.x[0]).sqrt();
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

#[test]
fn modes_that_are_not_defined_beyond_their_surface() {
    let mut sys = System::new(1, 0, 0).unwrap();
    let modes = Arc::new(Halves { jac: pattern(2, 2, &[(0, 0), (1, 0)]), hess: Pattern::empty(2, 2) });
    let regions = Regions::Signs { psi: affine("psi", dims(1), &[0.0], &[(0, 0, 1.0)]), signs: vec![1, -1] };
    sys.add_subsystem(Subsystem { rows: vec![0], modes, n_modes: 2, regions }).unwrap();
    let r = simulate(&sys, &tol(1e-9), 0.0, &[-1.0], 2.0).unwrap();
    reached(&r, "roots");
    // y = √|x|: 2 (y − ln(1 + y)) is the time from or to the surface
    let hit = 2.0 * (1.0 - 2f64.ln());
    assert_eq!(r.switches.len(), 1, "{:?}", r.switches);
    assert!((r.switches[0].t - hit).abs() < 1e-7, "{:?}, {hit}", r.switches);
    let y = r.x[0].sqrt();
    assert!((2.0 * (y - (1.0 + y).ln()) - (2.0 - hit)).abs() < 1e-7, "{:?}", r.x);
}

#[test]
fn where_the_continuation_is_not_unique() {
    // ẋ = sign x from 0: one side is taken, and said; or the simulation stops
    let r = simulate(&switching('d'), &tol(1e-8), 0.0, &[0.0], 1.0).unwrap();
    reached(&r, "first");
    assert!((r.x[0].abs() - 1.0).abs() < 1e-12 || r.x[0] == 0.0, "{:?}", r.x);
    let stop = Options { ambiguity: switchback::event::Ambiguity::Stop, ..tol(1e-8) };
    let r = simulate(&switching('d'), &stop, 0.0, &[0.0], 1.0).unwrap();
    assert_eq!((r.outcome, r.t), (Outcome::Ambiguous, 0.0), "{}", r.reason);
    assert!(r.reason.contains("not unique"), "{}", r.reason);
}

/// The two-fold: both fields touch the surface there, solutions are not unique beyond it.
#[test]
fn a_two_fold_is_no_trap() {
    for (a, b) in [(1.0, 1.0), (-0.5, 1.5), (0.3, -0.8)] {
        // ẋ3 = −x2 + … above, x1 + … below
        let sys = two_sides(3, move |_, x, o| o.copy_from_slice(&[1.0, a, -x[1], b, 1.0, x[0]]), |_, x, o| o[0] = x[2]);
        for x0 in [[-1.0, 1.0, 0.0], [-0.7, -0.9, 0.2], [0.4, 0.5, 0.0], [-1.0, -1.0, -0.3]] {
            let r = simulate(&sys, &tol(1e-8), 0.0, &x0, 5.0).unwrap();
            assert!(r.x.iter().all(|v| v.is_finite()) && r.stats.steps < 20_000, "{a} {b} {x0:?}: {:?}", r.stats);
            assert!(r.outcome == Outcome::Reached || !r.reason.is_empty(), "{a} {b} {x0:?}");
        }
    }
}

#[test]
fn accumulating_switches() {
    for rtol in [1e-4, 1e-8, 1e-12] {
        let r = simulate(&zeno(), &tol(rtol), 0.0, &[1.0, 1.0], 2.0).unwrap();
        reached(&r, "continue");
        assert_eq!(r.stats.accumulations, 1);
        assert!(r.x.iter().all(|v| v.abs() <= 1e-15) && r.switches.len() < 60, "{:?}", r.x);
        let last = r.switches.last().unwrap();
        assert!(last.kind == Kind::Enter && (last.t - 1.0).abs() < 0.1 * rtol, "{last:?}");
        let stop = Options { zeno: Zeno::Stop, ..tol(rtol) };
        let r = simulate(&zeno(), &stop, 0.0, &[1.0, 1.0], 2.0).unwrap();
        assert!(r.outcome == Outcome::Zeno && (r.t - 1.0).abs() < 0.1 * rtol, "{} {}", r.t, r.reason);
    }
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let run = || simulate(&stick_slip(), &tol(1e-7), 0.0, &[-0.8, -1.0], 40.0).unwrap();
    let (a, b) = (run(), run());
    assert_eq!(
        a.x.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
        b.x.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
    );
    assert_eq!(a.switches.len(), b.switches.len());
    assert_eq!(a.stats, b.stats);
}

#[test]
fn steps_do_not_allocate() {
    for (sys, x0, method) in [
        (coulomb(), vec![1.0, 0.2], Method::Auto),
        (stick_slip(), vec![-0.8, -1.0], Method::Auto),
        (blocks(), vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0], Method::Radau5),
    ] {
        let mut e = Engine::new(&sys, &Options { method, h_max: 0.05, ..tol(1e-8) }).unwrap();
        e.reinit(0.0, &x0).unwrap();
        let (mut stepped, mut sliding) = (0, 0);
        loop {
            let before = count();
            let p = e.step(12.0).unwrap();
            let n = count() - before;
            if p == Progress::Done {
                break;
            }
            // the first step of a mode may have followed a search for the active set
            if p == Progress::Stepped && e.time() > 0.1 {
                assert_eq!(n, 0, "t = {}", e.time());
                stepped += 1;
                sliding += usize::from(e.active(0).len() > 1);
            }
        }
        assert!(stepped > 100 && sliding > 10, "{stepped} {sliding}");
    }
}

#[test]
fn step_by_step_and_in_one_go() {
    let opt = tol(1e-10);
    let whole = simulate(&coulomb(), &Options { dense: true, ..opt.clone() }, 0.0, &[1.0, 0.2], 10.0).unwrap();
    let path = whole.path.as_ref().unwrap();
    let mut e = Engine::new(&coulomb(), &opt).unwrap();
    e.reinit(0.0, &[1.0, 0.2]).unwrap();
    let (mut x, mut y, mut v) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    for k in 1..=40 {
        let t = 0.25 * f64::from(k);
        assert_eq!(e.advance(t).unwrap(), Outcome::Reached);
        assert_eq!(e.time(), t);
        path.eval(t, 0, &mut x).unwrap();
        assert!((0..2).all(|i| (x[i] - e.state()[i]).abs() < 1e-8), "t = {t}: {x:?} {:?}", e.state());
        e.get_dky(t, 0, &mut y).unwrap();
        assert!((0..2).all(|i| (y[i] - e.state()[i]).abs() < 1e-12), "t = {t}: {y:?} {:?}", e.state());
        e.get_dky(t, 1, &mut v).unwrap();
        assert!((0..2).all(|i| (v[i] - e.derivative()[i]).abs() < 1e-6), "t = {t}: {v:?} {:?}", e.derivative());
    }
    assert_eq!(e.switches().len(), whole.switches.len());
    assert!(e.advance(9.0).is_err() && e.get_dky(1.0, 0, &mut y).is_err());
    assert!(path.eval(11.0, 0, &mut x).is_err());
    // a new start forgets
    e.reinit(0.0, &[1.0, 0.2]).unwrap();
    assert!(e.switches().is_empty() && e.stats().steps == 0);
    e.advance(10.0).unwrap();
    assert_eq!(e.state(), &whole.x[..]);
}

#[test]
fn orders_are_not_affected_by_switches() {
    // fixed steps: the error control never interferes
    let cases =
        [(Method::Dp5, 5.0, 1e-3, 60, 240), (Method::Dop853, 8.0, 1e-6, 20, 40), (Method::Radau5, 5.0, 1e-9, 250, 750)];
    for (method, order, rtol, n, m) in cases {
        let error = |n: usize| {
            let h = PI / 2.0 / n as f64;
            let opt = Options { method, h0: h, h_max: h, ..tol(rtol) };
            let r = simulate(&oscillator(), &opt, 0.0, &OSCILLATOR_X0, PI / 2.0).unwrap();
            reached(&r, "order");
            common::distance(&r.x, &OSCILLATOR_XT)
        };
        let slope = (error(n) / error(m)).ln() / (m as f64 / n as f64).ln();
        assert!((slope - order).abs() < 0.7, "{method:?}: {slope}");
    }
}

#[test]
fn batches_are_single_runs() {
    let starts: Vec<Vec<f64>> = (0..13).map(|i| vec![-0.8 + 0.05 * f64::from(i), -1.0]).collect();
    let single: Vec<Run> = starts.iter().map(|x| simulate(&stick_slip(), &tol(1e-8), 0.0, x, 20.0).unwrap()).collect();
    for threads in [1, 2, 5, 40] {
        let batch = simulate_batch(&stick_slip(), &tol(1e-8), 0.0, &starts, &[], 20.0, threads).unwrap();
        assert_eq!(batch.len(), 13);
        assert!(batch.iter().zip(&single).all(|(a, b)| a.x == b.x && a.stats == b.stats), "{threads}");
    }
    assert!(simulate_batch(&stick_slip(), &tol(1e-8), 0.0, &starts, &[vec![]], 20.0, 2).is_err());
}

#[test]
fn bad_options_are_refused() {
    let bad = |o: Options| Engine::new(&oscillator(), &o).is_err();
    assert!(bad(Options { rtol: vec![-1.0], ..Options::default() }));
    assert!(bad(Options { rtol: vec![0.0], atol: vec![0.0], ..Options::default() }));
    assert!(bad(Options { atol: vec![1e-6; 3], ..Options::default() }));
    assert!(bad(Options { h_max: 0.0, ..Options::default() }));
    assert!(bad(Options { h0: f64::NAN, ..Options::default() }));
    let mut e = Engine::new(&oscillator(), &Options::default()).unwrap();
    assert!(e.reinit(0.0, &[1.0]).is_err() && e.reinit(f64::NAN, &[1.0, 0.0]).is_err());
}

#[test]
fn too_few_steps_and_blow_up_end_with_a_reason() {
    let few = Options { max_steps: 5, ..tol(1e-10) };
    let r = simulate(&oscillator(), &few, 0.0, &OSCILLATOR_X0, 2.0).unwrap();
    assert_eq!(r.outcome, Outcome::MaxSteps);
    let sys = two_sides(1, |_, x, o| o.fill(x[0] * x[0]), |_, x, o| o[0] = x[0] - 2.0);
    let r = simulate(&sys, &tol(1e-8), 0.0, &[1.0], 2.0).unwrap();
    assert_eq!(r.outcome, Outcome::StepTooSmall, "{}", r.reason);
    assert!((r.t - 1.0).abs() < 1e-6 && r.reason.contains("shorter than rounding"), "{}", r.reason);
}

/// A block comes to rest under friction a few rounding errors before the run is to stop, and the run then goes on.
#[test]
fn a_sliding_mode_that_begins_at_the_end() {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).unwrap();
    s.set_f0(affine("f0", d, &[0.0; 2], &[(0, 1, 1.0), (1, 0, 0.25)])).unwrap();
    let modes = affine("friction", d, &[-0.7, 0.7], &[]);
    let regions = Regions::Signs { psi: affine("v", d, &[0.0], &[(0, 1, 1.0)]), signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: vec![1], modes, n_modes: 2, regions }).unwrap();
    let options = Options { adjoint: true, sensitivity: true.into(), ..Options::with_tolerance(1e-11, 1e-11) };
    // (q − 2.8)'' = (q − 2.8)/4 while v > 0
    let (q, v) = (1.0, 0.4f64);
    let rest = (v / (0.5 * (2.8 - q))).atanh() * 2.0;
    for k in -40i32..400 {
        let stop = rest + f64::from(k) * 1e-15;
        let mut e = Engine::new(&s, &options).unwrap();
        e.reinit(0.0, &[q, v]).unwrap();
        assert_eq!(e.advance(stop).unwrap(), Outcome::Reached, "{k}: {}", e.reason());
        assert!((e.time() - stop).abs() == 0.0 && e.state()[1].abs() < 1e-10);
        assert_eq!(e.advance(rest + 1.0).unwrap(), Outcome::Reached, "{k}: {}", e.reason());
        assert!(e.state()[1].abs() < 1e-10 && e.stats().switches == 1, "{k}: {:?}", e.stats());
    }
}

/// A clutch that slips while the torque of its engine has a ripple, in closed form: the slip, and what the car gains. At loose
/// tolerances a step covers a large part of a period, or several.
#[test]
fn a_ripple_is_not_taken_for_nothing() {
    const END: f64 = 0.8;
    for rtol in [1e-4, 3e-5] {
        for k in 2..40 {
            let omega = 15.0 * f64::from(k);
            let rates = move |t: f64, _: &[f64], o: &mut [f64]| {
                let torque = 60.0 + 30.0 * (omega * t).sin();
                o.copy_from_slice(&[(torque - 80.0) / 0.2, 120.0, (torque + 80.0) / 0.2, -200.0]);
            };
            let s = two_sides(2, rates, |_, x, o| o[0] = x[0] - x[1]);
            let r = simulate(&s, &Options::with_tolerance(rtol, 1e-2 * rtol), 0.0, &[200.0, 0.0], END);
            let exact = 200.0 - 100.0 * END + 150.0 / omega * (1.0 - (omega * END).cos());
            let error = (r.unwrap().x[0] - exact).abs() / (rtol * exact);
            assert!(error < 10.0, "{omega} at {rtol}: {error} tolerances");
        }
    }
}
