//! Where a simulation used to end without need, or without saying why: states that rest on a surface, ends that are not
//! passed, right-hand sides that jump, points where a function is not defined, derivatives nobody declared.

mod common;

use common::models::*;
use std::sync::Arc;
use switchback::event::{simulate, Ambiguity, Engine, Method, Options, Outcome, Progress, Run};
use switchback::expr::Graph;
use switchback::func::{Callback, Dims};
use switchback::system::{SharedFunction, System};

fn dims(x: usize) -> Dims {
    Dims { x, u: 0, p: 0 }
}

/// A function of the state by values, declared as smooth.
fn smooth_by_name(name: &str, n: usize, f: impl Fn(&[f64], &mut [f64]) + Send + Sync + 'static) -> SharedFunction {
    Arc::new(Callback::new(name, dims(n), n, move |at, o| {
        f(at.x, o);
        0
    }))
}

fn without_modes(n: usize, f: impl Fn(&[f64], &mut [f64]) + Send + Sync + 'static) -> System {
    let mut s = System::new(n, 0, 0).unwrap();
    s.set_f0(smooth_by_name("f", n, f)).unwrap();
    s
}

/// A boat whose wind is behind it while `cos(course)` is less than at the surface: `course' = rudder`.
fn boat(at: f64) -> System {
    let d = Dims { x: 2, u: 1, p: 0 };
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(affine("f0", d, &[0.0, 0.0], &[(0, 2, 1.0)])).unwrap();
    let psi = smooth(
        "psi",
        d,
        1,
        move |x, o| o[0] = x.x[0].cos() - at.cos(),
        &[(0, 0)],
        |x, o| o[0] = -x.x[0].sin(),
        &[(0, 0)],
        |x, w, o| o[0] = -w[0] * x.x[0].cos(),
    );
    // −v/2 where ψ > 0, else 1 − v
    add_sides(&mut s, &[1], affine("F", d, &[0.0, 1.0], &[(0, 1, -0.5), (1, 1, -1.0)]), psi);
    s
}

#[test]
fn a_state_that_rests_on_a_surface_goes_on() {
    let at = 40f64.to_radians();
    for rudder in [0.0, 1.4e-16, -3.4e-17, -1e-16, 1e-15, -1e-14, -1e-12, 3e-10] {
        for start in [at, at.next_up(), at.next_down(), at.next_up().next_up()] {
            for method in [Method::Auto, Method::Dp5, Method::Radau5] {
                let opt = Options { method, ..Options::with_tolerance(1e-8, 1e-10) };
                let mut e = Engine::new(&boat(at), &opt).unwrap();
                e.reinit(0.0, &[start, 1.0]).unwrap();
                e.set_controls(&[rudder]).unwrap();
                let outcome = e.advance(0.5).unwrap();
                let what = format!("{rudder} {start} {method:?}: {}", e.reason());
                assert_eq!(outcome, Outcome::Reached, "{what}");
                assert!(e.stats().steps < 200 && e.switches().len() < 3, "{what}: {:?}", e.stats());
                // under one of the modes, or first the one and then the other
                let v = e.state()[1];
                assert!(v > (-0.25f64).exp() - 1e-8 && v < 1.0 + 1e-8, "{what}: {v}");
            }
        }
    }
    // both modes may go on, and the policy hears of it
    let opt = Options { ambiguity: Ambiguity::Stop, ..Options::default() };
    let mut e = Engine::new(&boat(at), &opt).unwrap();
    e.reinit(0.0, &[at, 1.0]).unwrap();
    assert_eq!(e.advance(0.5).unwrap(), Outcome::Ambiguous);
    assert_eq!(e.branchings()[0].continuations.len(), 2);
}

#[test]
fn no_step_goes_beyond_the_time_asked_for() {
    let systems: [(System, &[f64]); 6] = [
        (switching('b'), &[-0.3]),
        (switching('c'), &[-0.3]),
        (coulomb(), &[1.0, 0.0]),
        (stick_slip(), &[1.2, 0.1]),
        (blocks(), &[1.0, -0.5, 0.3, 0.2, 0.0, -1.0]),
        (zeno(), &[1.0, 1.0]),
    ];
    for (sys, x0) in &systems {
        for method in [Method::Auto, Method::Dp5, Method::Radau5] {
            let opt = Options { method, ..Options::with_tolerance(1e-7, 1e-9) };
            let whole = simulate(sys, &opt, 0.0, x0, 3.0).unwrap();
            // ends at, just before and just behind the switches, and elsewhere
            let mut ends: Vec<f64> = (1..40).map(|k| f64::from(k) * 0.0757).collect();
            for s in whole.switches.iter().filter(|s| s.t > 0.0).take(12) {
                ends.extend([s.t, s.t * (1.0 - 1e-9), s.t * (1.0 + 1e-9)]);
            }
            ends.retain(|t| *t <= 3.0);
            ends.sort_by(f64::total_cmp);
            let mut e = Engine::new(sys, &opt).unwrap();
            e.reinit(0.0, x0).unwrap();
            for &t in &ends {
                loop {
                    let done = e.step(t).unwrap_or_else(|err| panic!("{method:?} {t}: {err}"));
                    assert!(e.time() <= t, "{method:?}: {} is beyond {t}", e.time());
                    if done == Progress::Done {
                        break;
                    }
                }
                assert_eq!((e.outcome(), e.time()), (Outcome::Reached, t), "{method:?}: {}", e.reason());
            }
            let end = simulate(sys, &opt, 0.0, x0, e.time()).unwrap();
            let off = e.state().iter().zip(&end.x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(off < 1e-5, "{method:?}: {off:e}");
        }
    }
}

fn ends_by_a_jump(r: &Run) {
    assert_eq!(r.outcome, Outcome::StepTooSmall, "{} {:?}", r.reason, r.stats);
    assert!(r.reason.contains("looks discontinuous near t = ") && r.reason.contains("modes"), "{}", r.reason);
    assert!(r.stats.steps + r.stats.rejections < 10_000, "{:?}", r.stats);
}

#[test]
fn a_right_hand_side_that_jumps_is_named() {
    for method in [Method::Auto, Method::Dp5, Method::Dop853, Method::Radau5] {
        for tol in [1e-5, 1e-8, 1e-11] {
            let opt = Options { method, max_steps: 100_000, ..Options::with_tolerance(tol, tol) };
            let sys = without_modes(1, |x, o| o[0] = if x[0] > 0.0 { -1.0 } else { 1.0 });
            ends_by_a_jump(&simulate(&sys, &opt, 0.0, &[0.5], 2e4).unwrap());
            // an oblique surface, with motion along it
            let sys = without_modes(2, |x, o| {
                let s = if x[0] + 0.5 * x[1] > 0.3 { -1.0 } else { 1.0 };
                o.copy_from_slice(&[s + 0.1, 0.3 - 0.2 * s]);
            });
            ends_by_a_jump(&simulate(&sys, &opt, 0.0, &[1.0, 0.0], 2e4).unwrap());
        }
    }
}

#[test]
fn steep_is_not_discontinuous() {
    let reached = |sys: &System, opt: &Options, x0: &[f64], t: f64| {
        let r = simulate(sys, opt, 0.0, x0, t).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{opt:?}: {}", r.reason);
        r
    };
    for method in [Method::Dp5, Method::Radau5] {
        let opt = Options { method, ..Options::with_tolerance(1e-7, 1e-7) };
        // a layer of 1e-6, an equilibrium in it, of which an explicit method makes some ten thousand short steps
        reached(&without_modes(1, |x, o| o[0] = -(1e6 * x[0]).tanh()), &opt, &[0.01], 0.02);
        // a jump that is passed
        let r = reached(&without_modes(1, |x, o| o[0] = if x[0] > 0.0 { 2.0 } else { 1.0 }), &opt, &[-0.5], 1.0);
        assert!((r.x[0] - 1.0).abs() < 1e-4, "{:?}", r.x);
    }
    // all but an equilibrium, where the right-hand side is made of rounding; steps are short because they are asked to be
    let opt = Options { h_max: 1e-4, max_steps: 10_000, ..Options::with_tolerance(1e-6, 1e-9) };
    let sys = without_modes(2, |x, o| o.copy_from_slice(&[x[1], 0.2 - x[0]]));
    for x0 in [[0.2, 1e-40], [0.2f64.next_up(), 1e-17], [0.2 + 1e-12, -1e-16]] {
        let r = simulate(&sys, &opt, 0.0, &x0, 1e9).unwrap();
        assert_eq!(r.outcome, Outcome::MaxSteps, "{x0:?}: {}", r.reason);
    }
    // relaxation oscillations
    let opt = Options::with_tolerance(1e-6, 1e-6);
    let sys = without_modes(2, |x, o| o.copy_from_slice(&[x[1], 1e3 * ((1.0 - x[0] * x[0]) * x[1]) - x[0]]));
    reached(&sys, &opt, &[2.0, 0.0], 2000.0);
}

#[test]
fn where_a_function_is_not_defined_is_said_in_the_same_words() {
    let mut expressions = System::new(2, 0, 0).unwrap();
    let g = Graph::new();
    let f = g.function("tank", dims(2), &[g.x(1), -g.x(0).sqrt()]).unwrap();
    expressions.set_f0(Arc::new(f)).unwrap();
    let mut callbacks = System::new(2, 0, 0).unwrap();
    callbacks.set_f0(smooth_by_name("tank", 2, |x, o| o.copy_from_slice(&[x[1], -x[0].sqrt()]))).unwrap();
    let mut reasons = Vec::new();
    for sys in [&expressions, &callbacks] {
        let r = simulate(sys, &Options::default(), 0.0, &[0.1, -1.0], 1.0).unwrap();
        assert_eq!(r.outcome, Outcome::StepTooSmall);
        for part in ["the value of function 'tank' is not finite", "output 1 is NaN", "at t = 0.09", "x = [-"] {
            assert!(r.reason.contains(part), "{part}: {}", r.reason);
        }
        reasons.push(r.reason.chars().filter(|c| c.is_ascii_alphabetic()).collect::<String>());
        // at the start already
        let r = simulate(sys, &Options::default(), 0.0, &[-0.1, -1.0], 1.0).unwrap();
        assert_eq!(r.outcome, Outcome::NoContinuation);
        assert!(r.reason.contains("(output 1 is NaN) at t = 0.0, x = [-0.1, -1.0]"), "{}", r.reason);
    }
    assert_eq!(reasons[0], reasons[1]);
}

#[test]
fn derivatives_by_parameters_need_no_declaration() {
    // x' = −p0 x² ± p1: a switch where x = p2
    let d = Dims { x: 1, u: 1, p: 3 };
    type Values = fn(&[f64], &[f64], &[f64], &mut [f64]);
    let by_values = |name: &str, n: usize, f: Values| -> SharedFunction {
        Arc::new(Callback::new(name, d, n, move |at, o| {
            f(at.x, at.u, at.p, o);
            0
        }))
    };
    let mut s = System::new(1, 1, 3).unwrap();
    s.set_f0(by_values("f0", 1, |x, u, p, o| o[0] = -p[0] * x[0] * x[0] + u[0])).unwrap();
    let modes = by_values("F", 2, |_, _, p, o| o.copy_from_slice(&[-p[1], p[1]]));
    add_sides(&mut s, &[0], modes, by_values("psi", 1, |x, _, p, o| o[0] = p[2] - x[0]));
    let opt = Options { sensitivity: true.into(), adjoint: true, ..Options::with_tolerance(1e-10, 1e-12) };
    let run = |x: f64, p: &[f64], u: f64| {
        let mut e = Engine::new(&s, &opt).unwrap();
        e.reinit(0.0, &[x]).unwrap();
        e.set_params(p).unwrap();
        e.set_controls(&[u]).unwrap();
        assert_eq!(e.advance(1.5).unwrap(), Outcome::Reached, "{}", e.reason());
        assert_eq!(e.switches().len(), 1);
        let g = e.adjoint(&[1.0], &[]).unwrap();
        (e.state()[0], e.sensitivity().unwrap().to_vec(), [g.x0, g.p, g.u].concat())
    };
    let (x, p, u) = (0.2, [0.4, 0.1, 0.8], 1.1);
    let (_, forward, adjoint) = run(x, &p, u);
    for k in 0..5 {
        let moved = |h: f64| {
            let (mut x, mut p, mut u) = (x, p, u);
            match k {
                0 => x += h,
                4 => u += h,
                k => p[k - 1] += h,
            }
            run(x, &p, u).0
        };
        let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
        assert!(slope.abs() > 1e-2, "{k}: {slope}");
        assert!((forward[k] - slope).abs() < 1e-6, "{k}: {} {slope}", forward[k]);
        assert!((adjoint[k] - slope).abs() < 1e-6, "{k}: {} {slope}", adjoint[k]);
    }
}
