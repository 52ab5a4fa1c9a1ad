//! Event-driven simulation where the continuation is not unique, not regular, or a surface is only touched.

mod common;
use common::models::*;
use std::sync::{Arc, Mutex};
use switchback::event::{simulate, Ambiguity, Doubt, Engine, Kind, Method, Options, Outcome, Zeno};
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::model::Model;
use switchback::settings::Settings;
use switchback::sim::arbiter;
use switchback::system::System;

fn tol(t: f64) -> Options {
    Options::with_tolerance(t, t)
}

/// `ẋ = sign x` at 0: up, down, or rest.
#[test]
fn all_continuations_are_found_and_somebody_decides() {
    let prefer = |modes: Vec<usize>| {
        let o = Options { ambiguity: Ambiguity::Prefer, preferred: vec![modes], ..tol(1e-8) };
        simulate(&switching('d'), &o, 0.0, &[0.0], 1.0).unwrap()
    };
    for (first, end) in [(0, 1.0), (1, -1.0)] {
        let r = prefer(vec![first]);
        assert_eq!(r.outcome, Outcome::Reached);
        assert!((r.x[0] - end).abs() < 1e-14, "{:?}", r.x);
        let b = &r.branchings[0];
        assert_eq!((b.t, &b.x[..], b.continuations.len()), (0.0, &[0.0][..], 3));
        let mut all: Vec<(Vec<usize>, f64)> =
            b.continuations.iter().map(|c| (c.modes[0].clone(), c.velocity[0])).collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        assert_eq!(all, [(vec![1], -1.0), (vec![0, 1], 0.0), (vec![0], 1.0)]);
        assert_eq!(b.continuations[b.taken.unwrap()].modes, [[first]]);
    }
    // a callback comes before the rule; it sees what the log will say
    let mut e = Engine::new(&switching('d'), &tol(1e-8)).unwrap();
    let seen = Arc::new(Mutex::new(Vec::new()));
    let notes = seen.clone();
    e.set_decider(Some(Box::new(move |b| {
        notes.lock().unwrap().push(b.clone());
        b.continuations.iter().position(|c| c.modes[0] == [0, 1])
    })));
    e.reinit(0.0, &[0.0]).unwrap();
    e.advance(1.0).unwrap();
    assert_eq!((e.state(), e.outcome()), (&[0.0][..], Outcome::Reached));
    assert_eq!(seen.lock().unwrap().len(), e.branchings().len());
    assert!(seen.lock().unwrap()[0].taken.is_none());
    // it may refuse, or name what is not there
    for answer in [None, Some(7)] {
        e.set_decider(Some(Box::new(move |_| answer)));
        e.reinit(0.0, &[0.0]).unwrap();
        assert_eq!(e.advance(1.0).unwrap(), Outcome::Ambiguous);
        assert!(e.reason().contains("not unique") && e.branchings()[0].taken.is_none());
    }
}

/// A motion along a moving surface, at which the field has a kink only, crosses it so slowly that its rate is 1e-9 of the velocity, and
/// is back after a while: both crossings are at the roots of its parabola, and cost what crossings cost.
#[test]
fn slow_crossings_happen_once() {
    const SPEED: f64 = 0.6;
    let (q0, rate, bend) = (2.7e-11, -8.8e-10, 8e-9);
    let g = Graph::new();
    let rates = [g.x(1), g.constant(bend), (g.x(0) - SPEED * g.t()).abs()];
    let system = Model::from_rhs("slow", 0, 0, &rates).and_then(|m| m.build(&g)).unwrap().system;
    let root = |sign: f64| (-rate + sign * (rate * rate - 2.0 * bend * q0).sqrt()) / bend;
    for t0 in [0.0, 3.6] {
        let start = [SPEED * t0 + q0, SPEED + rate, 0.0];
        let r = simulate(&system, &tol(1e-8), t0, &start, t0 + 0.2).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
        let times: Vec<f64> = r.switches.iter().map(|s| s.t - t0).collect();
        assert_eq!(times.len(), 2, "from {t0}: {times:?}");
        // the position is known to 4e-16, and changes by 5.8e-10 in a unit of time
        for (found, exact) in times.iter().zip([root(-1.0), root(1.0)]) {
            assert!((found - exact).abs() < 1e-5, "from {t0}: {found} instead of {exact}");
        }
        assert!(r.stats.steps < 10, "from {t0}: {} steps", r.stats.steps);
    }
}

/// A loop that follows a reference and integrates the size of its error: the error swings through zero until it is rounding, where each
/// zero is as good as its neighbours. The position is in closed form, and the integral hardly changes any more.
#[test]
fn an_error_that_dies_out_is_followed_to_the_end() {
    const END: f64 = 20.0;
    let g = Graph::new();
    let t = g.t();
    let (r, speed) = (0.5 * t + 0.1 * t.sin(), 0.5 + 0.1 * t.cos());
    let off = g.x(0) - r;
    let rates = [g.x(1), -4.0 * off - 3.0 * (g.x(1) - speed) - 0.1 * t.sin(), off.abs()];
    let system = Model::from_rhs("loop", 0, 0, &rates).and_then(|m| m.build(&g)).unwrap().system;
    // e'' + 3 e' + 4 e = 0 from e = 1, e' = -0.6
    let w = 1.75f64.sqrt();
    let off = (-1.5 * END).exp() * ((w * END).cos() + 0.9 / w * (w * END).sin());
    let exact = 0.5 * END + 0.1 * END.sin() + off;
    let fine = simulate(&system, &tol(1e-12), 0.0, &[1.0, 0.0, 0.0], END).unwrap().x[2];
    for e in 3..=12 {
        let rtol = 10f64.powi(-e);
        let r = simulate(&system, &tol(rtol), 0.0, &[1.0, 0.0, 0.0], END).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
        assert!((r.x[0] - exact).abs() <= rtol, "rtol {rtol:e}: off by {:e}", r.x[0] - exact);
        assert!((r.x[2] - fine).abs() <= 20.0 * rtol, "rtol {rtol:e}: the integral is off by {:e}", r.x[2] - fine);
        assert!(r.stats.steps < 2000, "rtol {rtol:e}: {} steps", r.stats.steps);
        assert!(r.accumulations.is_empty(), "rtol {rtol:e}: {:?}", r.accumulations);
    }
}

#[test]
fn preferences_must_fit() {
    let o = |preferred| Options { ambiguity: Ambiguity::Prefer, preferred, ..tol(1e-8) };
    let why = |o: &Options| Engine::new(&switching('d'), o).err().unwrap().to_string();
    assert!(why(&o(vec![])).contains("each of the 1 subsystems"));
    assert!(why(&o(vec![vec![0], vec![]])).contains("2 lists"));
    assert!(why(&o(vec![vec![0, 2]])).contains("no such mode"));
}

/// The unstable ridge of a two-fold: the sliding mode is kept although both sides may be entered.
#[test]
fn a_ridge_may_be_left_by_preference() {
    // ẋ = sign x + 0 · y from a point on the ridge reached by a state that rests there
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut s = System::new(1, 1, 0).unwrap();
    add_sides(&mut s, &[0], affine("F", d, &[1.0, -1.0], &[]), affine("psi", d, &[0.0], &[(0, 0, 1.0)]));
    let mut e = Engine::new(&s, &tol(1e-8)).unwrap();
    e.set_decider(Some(Box::new(|b| b.continuations.iter().position(|c| c.modes[0].len() == 2))));
    e.reinit(0.0, &[0.0]).unwrap();
    e.advance(1.0).unwrap();
    e.set_decider(Some(Box::new(|b| b.continuations.iter().position(|c| c.modes[0] == [1]))));
    // the active set is found anew
    e.set_controls(&[0.0]).unwrap();
    e.advance(2.0).unwrap();
    assert!((e.state()[0] + 1.0).abs() < 1e-14, "{:?}", e.state());
    let s = e.switches().last().unwrap();
    assert_eq!((s.kind, s.t, s.unique), (Kind::Spontaneous, 1.0, false), "{s:?}");
}

/// The Zeno example with a force that tears the state off the origin at t = 2, where it rests from t = 1 on.
fn zeno_and_off() -> System {
    let d = Dims { x: 3, u: 0, p: 0 };
    let mut s = System::new(3, 0, 0).unwrap();
    // x3 is the time; the force is as strong as the fields from t = 2 on
    s.set_f0(affine("f0", d, &[0.0, 0.0, 1.0], &[(0, 2, 1.5)])).unwrap();
    for (k, f) in [[-1.0, -2.0, 1.0, 2.0], [2.0, -1.0, -2.0, 1.0]].iter().enumerate() {
        add_sides(&mut s, &[0, 1], affine("F", d, f, &[]), affine("psi", d, &[0.0], &[(0, k, 1.0)]));
    }
    s
}

#[test]
fn time_stepping_through_accumulating_switches() {
    for rtol in [1e-4, 1e-7, 1e-10] {
        let o = Options { zeno: Zeno::TimeStepping, dense: true, sensitivity: true.into(), adjoint: true, ..tol(rtol) };
        let r = simulate(&zeno(), &o, 0.0, &[1.0, 1.0], 2.0).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
        assert!(r.x.iter().all(|v| v.abs() <= rtol), "{rtol}: {:?}", r.x);
        let a = r.accumulations[0];
        assert!((a.t - 1.0).abs() <= rtol && a.until > a.t && a.steps > 0, "{a:?}");
        assert!(r.accumulations.iter().all(|a| a.error <= 1.0), "{:?}", r.accumulations);
        assert!(r.accumulations.len() < 30 && r.switches.len() < 400 && r.stats.steps < 100_000, "{:?}", r.stats);
        // what led there has no derivatives, and that is said; that of a state which both surfaces hold at zero is none of these
        assert!(r.one_sided && r.sensitivity.unwrap().iter().all(|s| *s == 0.0));
        let mut x = [0.0; 2];
        let p = r.path.unwrap();
        p.eval(0.5 * (a.t + a.until), 0, &mut x).unwrap();
        assert!(x.iter().all(|v| v.abs() < 1e3 * rtol), "{x:?}");
        // the limit set and the steps agree, also on when it is left
        let goes_on = simulate(&zeno_and_off(), &tol(rtol), 0.0, &[1.0, 1.0, -1.0], 6.0).unwrap();
        let steps = simulate(&zeno_and_off(), &o, 0.0, &[1.0, 1.0, -1.0], 6.0).unwrap();
        assert_eq!((goes_on.outcome, steps.outcome), (Outcome::Reached, Outcome::Reached), "{}", steps.reason);
        assert_eq!(goes_on.accumulations.len(), 1);
        // behind that the derivatives are those of the time at which it is left, which nothing is known of
        assert!(steps.one_sided && steps.sensitivity.unwrap().iter().all(|s| s.is_nan()));
        for (a, b) in goes_on.x.iter().zip(&steps.x) {
            assert!((a - b).abs() <= 100.0 * rtol * (1.0 + a.abs()), "{rtol}: {:?} {:?}", goes_on.x, steps.x);
        }
    }
    let o = Options { zeno: Zeno::TimeStepping, adjoint: true, ..tol(1e-8) };
    let mut e = Engine::new(&zeno(), &o).unwrap();
    e.reinit(0.0, &[1.0, 1.0]).unwrap();
    e.advance(2.0).unwrap();
    assert!(e.adjoint(&[1.0, 0.0], &[]).unwrap_err().to_string().contains("no derivatives"));
}

/// A surface that is touched without being crossed is noted, with the size of the derivative there.
#[test]
fn touching_a_surface_is_noted() {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).unwrap();
    // ẍ = 2 above; x = (1 − t)²
    let f = affine("F", d, &[0.0, 2.0, 0.0, 2.0], &[(0, 1, 1.0), (2, 1, 1.0)]);
    add_sides(&mut s, &[0, 1], f, affine("psi", d, &[0.0], &[(0, 0, 1.0)]));
    let o = Options { sensitivity: true.into(), ..tol(1e-10) };
    let r = simulate(&s, &o, 0.0, &[1.0, -2.0], 3.0).unwrap();
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    let noted = r.contacts.first().map(|c| (c.t, c.rate, c.transversality));
    let noted = noted.or(r.switches.first().map(|s| (s.t, s.rate, s.transversality)));
    let (t, rate, cosine) = noted.expect("it touches");
    assert!((t - 1.0).abs() < 1e-6 && rate.abs() < 1e-6 && cosine.abs() < 1e-6, "{t} {rate} {cosine}");
    assert!(r.one_sided && (r.x[0] - 4.0).abs() < 1e-8, "{:?}", r.x);
    for gap in [1e-3, 1e-6] {
        let r = simulate(&s, &o, 0.0, &[1.0 + gap, -2.0], 3.0).unwrap();
        assert!(r.contacts.is_empty() && !r.one_sided, "{gap}: {:?}", r.contacts);
    }
}

/// Stiff at first, then not: Radau IIA gives the mode back to the explicit pair.
#[test]
fn a_mode_that_is_no_longer_stiff() {
    let d = Dims { x: 3, u: 0, p: 0 };
    let mut s = System::new(3, 0, 0).unwrap();
    // λ(t) from 3000 down to nothing, x → cos 3t; a third state switches far away
    let rate = |t: f64| 3000.0 / (1.0 + (3.0 * (t - 3.0)).exp());
    let f = smooth(
        "f0",
        d,
        3,
        move |at, o| {
            o[0] = -rate(at.t) * (at.x[0] - (3.0 * at.t).cos());
            (o[1], o[2]) = (at.x[2], -9.0 * at.x[1]);
        },
        &[(0, 0), (2, 1), (1, 2)],
        move |at, o| o.copy_from_slice(&[-rate(at.t), -9.0, 1.0]),
        &[],
        |_, _, _| {},
    );
    s.set_f0(f).unwrap();
    let run = |t: f64, method: Method| {
        let r = simulate(&s, &Options { method, ..tol(1e-6) }, 0.0, &[1.0, 1.0, 0.0], t).unwrap();
        assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
        r
    };
    let (short, long) = (run(4.0, Method::Auto), run(30.0, Method::Auto));
    assert!(short.stats.newton > 50, "it is stiff: {:?}", short.stats);
    let more = long.stats.newton - short.stats.newton;
    let radau = run(30.0, Method::Radau5).stats.newton - run(4.0, Method::Radau5).stats.newton;
    assert!(more < radau / 3, "{more} Newton iterations behind the stiff part, {radau} with Radau IIA alone");
    assert!((long.x[1] - f64::cos(90.0)).abs() < 1e-3, "{:?}", long.x);
}

/// The MPCC of a FESD step as the arbiter; regular points need none.
#[test]
fn an_arbiter_is_asked_where_the_conditions_do_not_decide() {
    let d = Dims { x: 1, u: 0, p: 0 };
    let mut s = System::new(1, 0, 0).unwrap();
    let modes = affine("F", d, &[1.0, 3.0], &[]);
    add_sides(&mut s, &[0], modes, affine("psi", d, &[0.0], &[(0, 0, 1.0)]));
    let asked = Arc::new(Mutex::new(0));
    let count = asked.clone();
    let mut decide = arbiter(&s, &Settings { n_fe: 2, ..Settings::default() }, 1e-2).unwrap();
    let mut e = Engine::new(&s, &tol(1e-8)).unwrap();
    e.set_arbiter(Some(Box::new(move |at| {
        *count.lock().unwrap() += 1;
        decide(at)
    })));
    e.reinit(0.0, &[-1.0]).unwrap();
    e.advance(1.0).unwrap();
    assert_eq!(*asked.lock().unwrap(), 0, "regular switches need no arbiter");
    // what it says of a sliding mode, and of a crossing
    let mut crossing = arbiter(&s, &Settings { n_fe: 2, ..Settings::default() }, 1e-2).unwrap();
    let at = |x: &'static [f64]| Doubt { t: 0.0, x, u: &[], p: &[] };
    assert_eq!(crossing(at(&[0.0])), Some(vec![vec![0]]));
    let mut sliding = arbiter(&switching('b'), &Settings { n_fe: 2, ..Settings::default() }, 1e-2).unwrap();
    assert_eq!(sliding(at(&[0.0])), Some(vec![vec![0, 1]]));
}

/// Many subsystems that switch at once: those that do not act on each other are decided apart.
#[test]
fn twenty_subsystems_at_once() {
    let n = 20;
    let d = Dims { x: n, u: 0, p: 0 };
    let mut s = System::new(n, 0, 0).unwrap();
    for k in 0..n {
        // every third one slides, the others cross
        let f = if k % 3 == 0 { [-1.0, 2.0] } else { [1.0, 2.0] };
        add_sides(&mut s, &[k], affine("F", d, &f, &[]), affine("psi", d, &[0.0], &[(0, k, 1.0)]));
    }
    let r = simulate(&s, &tol(1e-8), 0.0, &vec![-2.0; n], 2.0).unwrap();
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    assert_eq!(r.switches.len(), n);
    assert!(r.switches.iter().all(|s| s.simultaneous && (s.t - 1.0).abs() < 1e-14));
    assert!(r.x.iter().enumerate().all(|(k, x)| (x - if k % 3 == 0 { 0.0 } else { 1.0 }).abs() < 1e-12), "{:?}", r.x);
    // and from the start
    let r = simulate(&s, &tol(1e-8), 0.0, &vec![0.0; n], 1.0).unwrap();
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    assert!(r.x.iter().enumerate().all(|(k, x)| (x - if k % 3 == 0 { 0.0 } else { 1.0 }).abs() < 1e-12), "{:?}", r.x);
}

/// A force at the limit of dry friction, or off it by a part of rounding to 1e-9: the block stays where it is, or leaves as slowly as
/// what is left of the force says. Both sets of modes meet the conditions (6.19) up to rounding there, and only one of them is not
/// left again at once.
#[test]
fn a_force_at_the_limit_of_friction() {
    use switchback::expr::Graph;
    use switchback::model::Model;
    let g = Graph::new();
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    let rhs = [v, u - 0.5 * q - 0.5 * v.sign()];
    let system = Model::from_rhs("block", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    let start = [0.984160291134757, 0.0];
    for atol in [1e-9, 1e-12] {
        for more in [0.0, 1e-16, -1e-16, 1e-14, -1e-14, 1e-12, -1e-12, 1e-10, -1e-10, 1e-9, -1e-9] {
            let o = Options { max_steps: 200, ..Options::with_tolerance(1e-9, atol) };
            let mut e = Engine::new(&system, &o).unwrap();
            e.set_controls(&[-0.007919854432576789 + more]).unwrap();
            e.reinit(0.0, &start).unwrap();
            assert_eq!(e.advance(0.2).unwrap(), Outcome::Reached, "{atol} {more}: {}", e.reason());
            let (x, leaves) = (e.state(), f64::min(more, 0.0));
            assert!((x[1] - 0.2 * leaves).abs() < 1e-3 * leaves.abs() + 1e-14, "{atol} {more}: {x:?}");
        }
    }
}

/// Two surfaces hold the state where they meet, with a control that is at the limit of what one of them holds, to the last bits: its
/// weight is zero up to rounding, and nothing happens. Four of these 162 runs ended with `no_continuation`.
#[test]
fn a_weight_that_is_rounding_holds() {
    use switchback::expr::Graph;
    use switchback::model::Model;
    let g = Graph::new();
    let (x, y, u) = (g.x(0), g.x(1), g.u(0));
    let side = 0.5916128269913684 * x + 1.3588714889876492 * y - 0.30262237899711;
    let push = 1.5610627639967216 * x - 0.1683226138852345 * y + 0.644990329795311;
    let a = [
        -0.06367189136046378 * x + 0.9982420075859381 * y - 2.027816652985781 - 0.27090883242138886 * u,
        -0.1677320172706603 * x - 0.4344735304330577 * y - 0.3406806095305583 - 2.875692151216953 * u,
    ];
    let b = [
        0.19072553406910134 * x + 0.3844619076527175 * y - 1.5455085805556636 - 0.5515102348793733 * u,
        0.5702843282174072 * x + 1.4239208071462508 * y + 0.3549814342471218 - 0.8796240081306815 * u,
    ];
    let strengths = [2.4268035568479016, 3.250024952038811];
    let rhs = [0, 1].map(|i| 0.5 * (a[i] + b[i]) + 0.5 * (a[i] - b[i]) * side.sign() - strengths[i] * push.sign());
    let system = Model::from_rhs("corner", 1, 0, &rhs).and_then(|m| m.build(&g)).unwrap().system;
    // where both surfaces vanish
    let det = 0.5916128269913684 * -0.1683226138852345 - 1.3588714889876492 * 1.5610627639967216;
    let start = [
        (0.30262237899711 * -0.1683226138852345 + 1.3588714889876492 * 0.644990329795311) / det,
        (0.5916128269913684 * -0.644990329795311 - 1.5610627639967216 * 0.30262237899711) / det,
    ];
    let o = Options { max_steps: 200, ..Options::with_tolerance(1e-9, 1e-11) };
    let mut e = Engine::new(&system, &o).unwrap();
    for k in -40..=40 {
        e.set_controls(&[0.6862729613297054 * (1.0 + f64::from(k) * f64::EPSILON)]).unwrap();
        for end in [0.46, 1.0] {
            e.reinit(0.0, &start).unwrap();
            assert_eq!(e.advance(end).unwrap(), Outcome::Reached, "{k}: {}", e.reason());
            assert!(e.state().iter().zip(&start).all(|(a, b)| (a - b).abs() < 1e-12), "{k}: {:?}", e.state());
        }
    }
}

/// A control at the edge of a dead band leaves a switching function at zero as long as it lasts; with the next control it is not zero any
/// more. This ended with `no_continuation`.
#[test]
fn other_controls_put_surfaces_elsewhere() {
    use switchback::expr::Graph;
    use switchback::model::Model;
    let g = Graph::new();
    let (x, u) = (g.x(0), g.u(0));
    let band = u.dead_zone(0.05);
    let system = Model::from_rhs("valve", 1, 0, &[band - x]).and_then(|m| m.build(&g)).unwrap().system;
    let o = Options::with_tolerance(1e-10, 1e-12);
    for controls in [[0.05, 0.0, 0.1], [0.1, 0.05, 0.0], [0.0, 0.05, 0.1], [0.05, -0.05, 0.05], [-0.05, 0.0, -0.1]] {
        let mut e = Engine::new(&system, &o).unwrap();
        e.reinit(0.0, &[1.0]).unwrap();
        let mut exact = 1.0;
        for (k, u) in controls.iter().enumerate() {
            e.set_controls(&[*u]).unwrap();
            assert_eq!(e.advance(0.1 * (k + 1) as f64).unwrap(), Outcome::Reached, "{controls:?}: {}", e.reason());
            // x' = r - x over a tenth
            let r = (u - 0.05f64).max(0.0) + (u + 0.05).min(0.0);
            exact = r + (exact - r) * (-0.1f64).exp();
        }
        assert!((e.state()[0] - exact).abs() < 1e-9, "{controls:?}: {} instead of {exact}", e.state()[0]);
    }
}
