//! Many surfaces that slide at once: closed forms, the implicit method as the second opinion, work that grows with what
//! slides.

use std::sync::Arc;
use switchback::event::{simulate, Method, Options, Outcome, Run};
use switchback::expr::{Expr, ExprFunction, Graph};
use switchback::func::Dims;
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
