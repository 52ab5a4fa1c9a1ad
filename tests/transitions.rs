//! Transitions: guards, resets and discrete states, against solutions in closed form and derivatives three ways.

use std::path::Path;
use std::sync::Arc;
use switchback::event::{Engine, Jump, Kind, Method, Options, Outcome, Sensitivity, Term};
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::{Clock, Model, Pwm, Strikes};
use switchback::settings::Settings;
use switchback::system::{Direction, Effect, Rule, SharedFunction, System, Transition};

use Direction::{Falling, Rising};

fn function(g: &Graph, d: Dims, out: &[Expr]) -> SharedFunction {
    Arc::new(g.function("f", d, out).unwrap())
}

fn reference(name: &str) -> serde_json::Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/reference").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(v: &serde_json::Value) -> Vec<f64> {
    let one = |v: &serde_json::Value| v.as_f64().or_else(|| v.as_str().and_then(|s| s.parse().ok())).unwrap();
    v.as_array().map_or_else(|| vec![one(v)], |a| a.iter().flat_map(numbers).collect())
}

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

fn times(jumps: &[Jump]) -> Vec<f64> {
    jumps.iter().map(|j| j.t).collect()
}

const METHODS: [Method; 4] = [Method::Auto, Method::Dp5, Method::Dop853, Method::Radau5];

/// A ball under gravity `p1` over the floor, with the coefficient of restitution `p0`.
fn ball() -> System {
    let (g, d) = (Graph::new(), Dims { x: 2, u: 0, p: 2 });
    let mut s = System::new(2, 0, 2).unwrap();
    s.set_f0(function(&g, d, &[g.x(1), -g.p(1)])).unwrap();
    s.add_transition(Transition {
        guard: function(&g, d, &[g.x(0)]),
        direction: Falling,
        from: vec![],
        reset: Some(function(&g, d, &[g.x(0), -g.p(0) * g.x(1)]).into()),
        to: vec![],
        rule: Rule::default(),
        clauses: vec![],
    })
    .unwrap();
    s
}

fn run(s: &System, opt: &Options, x0: &[f64], p: &[f64], t: f64) -> Engine {
    let mut e = Engine::new(s, opt).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e.advance(t).unwrap();
    e
}

#[test]
fn a_ball_that_bounces() {
    for name in ["bounce_elastic", "bounce_elastic_e1"] {
        let r = reference(&format!("{name}.json"));
        let e = if name.ends_with("e1") { 1.0 } else { 0.9 };
        for method in METHODS {
            let opt = Options { method, sensitivity: true.into(), ..Options::with_tolerance(1e-11, 1e-11) };
            let run = run(&ball(), &opt, &[1.0, 0.0], &[e, 9.81], 3.0);
            let what = format!("{name} {method:?}: {}", run.reason());
            assert_eq!(run.outcome(), Outcome::Reached, "{what}");
            assert!(off(&times(run.jumps()), &numbers(&r["switch_times"])) < 1e-12, "{what}: {:?}", run.jumps());
            assert!(off(run.state(), &numbers(&r["x_T"])) < 1e-10, "{what}: {:?}", run.state());
            let after: Vec<f64> = run.jumps().iter().map(|j| j.after[1]).collect();
            assert!(off(&after, &numbers(&r["post_impact_velocity"])) < 1e-11, "{what}");
            assert!(run.jumps().iter().all(|j| j.rate > 0.0 && !j.simultaneous), "{what}");
            // columns: both states, e, g
            let s = run.sensitivity().unwrap();
            assert!(off(&[s[0], s[1], s[4], s[5]], &numbers(&r["sens_xT_x0"])) < 1e-9, "{what}: {s:?}");
            let dt: Vec<f64> = run.jumps().iter().flat_map(|j| j.dt[..2].to_vec()).collect();
            assert!(off(&dt, &numbers(&r["sens_switch_times"])) < 1e-10, "{what}");
            assert!(!run.one_sided(), "{what}");
            // by parameters only: the same columns
            let opt = Options { sensitivity: Sensitivity::Inputs, ..opt };
            let inputs = self::run(&ball(), &opt, &[1.0, 0.0], &[e, 9.81], 3.0);
            assert_eq!(inputs.sensitivity().unwrap(), [&s[2..4], &s[6..8]].concat(), "{what}");
            assert!(inputs.jumps().iter().zip(run.jumps()).all(|(a, b)| a.dt == b.dt[2..]), "{what}");
        }
    }
}

#[test]
fn transitions_that_accumulate() {
    let r = reference("bounce_zeno.json");
    let known = numbers(&r["switch_times"]);
    let run = run(&ball(), &Options::with_tolerance(1e-10, 1e-10), &[1.0, 0.0], &[0.5, 9.81], 2.0);
    assert_eq!(run.outcome(), Outcome::Zeno, "{}", run.reason());
    assert!(run.reason().contains("accumulate"), "{}", run.reason());
    let n = run.jumps().len();
    assert!(n > 12 && n < 60, "{n}");
    let n = n.min(known.len());
    assert!(off(&times(&run.jumps()[..n]), &known[..n]) < 1e-11);
    assert!((run.accumulations()[0].t - 1.354_570_922_957_192_7).abs() < 1e-9, "{:?}", run.accumulations());
}

/// A ball on a table that goes up and down, `q_t = a sin ω t` with the parameters `a`, `ω`, and `e`.
fn table() -> System {
    let (g, d) = (Graph::new(), Dims { x: 2, u: 0, p: 3 });
    let (a, w, e) = (g.p(0), g.p(1), g.p(2));
    let (at, speed) = (a * (w * g.t()).sin(), a * w * (w * g.t()).cos());
    let mut s = System::new(2, 0, 3).unwrap();
    s.set_f0(function(&g, d, &[g.x(1), g.constant(-9.81)])).unwrap();
    s.add_transition(Transition {
        guard: function(&g, d, &[g.x(0) - at]),
        direction: Falling,
        from: vec![],
        reset: Some(function(&g, d, &[g.x(0), -e * g.x(1) + (1.0 + e) * speed]).into()),
        to: vec![],
        rule: Rule::default(),
        clauses: vec![],
    })
    .unwrap();
    s
}

#[test]
fn a_ball_never_falls_through_a_moving_table() {
    for (a, w, e, tol) in [
        (0.1, 7.0, 0.7, 1e-8),
        (0.1, 7.0, 0.7, 1e-10),
        (0.1, 7.0, 0.7, 1e-12),
        (0.02, 40.0, 0.5, 1e-8),
        (0.02, 40.0, 0.9, 1e-10),
        (0.3, 3.0, 0.8, 1e-9),
    ] {
        for method in METHODS {
            let opt = Options { method, ..Options::with_tolerance(tol, tol) };
            let r = run(&table(), &opt, &[1.0, 0.0], &[a, w, e], 8.0);
            let what = format!("{a} {w} {e} {tol:e} {method:?}: {:?} {}", r.outcome(), r.reason());
            // it jumps for ever, or comes to rest on the table
            assert!(matches!(r.outcome(), Outcome::Reached | Outcome::Zeno), "{what}");
            for j in r.jumps() {
                let (at, speed) = (a * (w * j.t).sin(), a * w * (w * j.t).cos());
                let (gap, before, after) = (j.before[0] - at, j.before[1] - speed, j.after[1] - speed);
                assert!(gap.abs() < 1e-14 && before < 0.0 && after > 0.0, "{what}: {gap:e} {before:e} {after:e} {j:?}");
            }
            assert!(r.state()[0] > a * (w * r.time()).sin() - 1e-13, "{what}: {:?}", r.state());
        }
    }
}

/// `x' = −k x + P w` with `w` switched on at `lo` and off at `hi`; parameters k, P, lo, hi.
fn thermostat() -> System {
    let (g, d) = (Graph::new(), Dims { x: 2, u: 0, p: 4 });
    let (x, w) = (g.x(0), g.x(1));
    let mut s = System::new(2, 0, 4).unwrap();
    s.set_f0(function(&g, d, &[-g.p(0) * x + g.p(1) * w, g.constant(0.0)])).unwrap();
    for (direction, at, from, to) in [(Falling, g.p(2), 0.0, 1.0), (Rising, g.p(3), 1.0, 0.0)] {
        let guard = function(&g, d, &[x - at]);
        s.add_transition(Transition {
            guard,
            direction,
            from: vec![(1, from)],
            reset: None,
            to: vec![(1, to)],
            rule: Rule::default(),
            clauses: vec![],
        })
        .unwrap();
    }
    s
}

#[test]
fn a_thermostat_that_begins_beyond_its_threshold() {
    let r = reference("scenes/thermostat.json");
    let p = [0.2, 5.0, 18.0, 20.0];
    for method in METHODS {
        let opt = Options { method, sensitivity: true.into(), ..Options::with_tolerance(1e-11, 1e-11) };
        let run = run(&thermostat(), &opt, &[15.0, 0.0], &p, 12.0);
        let what = format!("{method:?}: {}", run.reason());
        assert_eq!(run.outcome(), Outcome::Reached, "{what}");
        assert_eq!((run.jumps()[0].t, run.jumps()[0].transition), (0.0, 0), "{what}");
        assert!(run.jumps()[0].rate.is_nan() && run.jumps()[0].dt.iter().all(|d| *d == 0.0), "{what}");
        assert!(off(&times(&run.jumps()[1..]), &numbers(&r["switches"])) < 1e-11, "{what}: {:?}", times(run.jumps()));
        assert!(off(run.state(), &[numbers(&r["x_T"])[0], 1.0]) < 1e-10, "{what}: {:?}", run.state());
        assert!((run.sensitivity().unwrap()[0] - numbers(&r["dxT_dx0"])[0]).abs() < 1e-9, "{what}");
    }
}

/// A model with everything: friction (a subsystem that slides), a discrete state, resets that depend on time, parameters and
/// controls, and a guard that depends on all of them.
fn everything() -> System {
    use switchback::system::{Regions, Subsystem};
    let (g, d) = (Graph::new(), Dims { x: 3, u: 1, p: 2 });
    let (q, v, w) = (g.x(0), g.x(1), g.x(2));
    let mut s = System::new(3, 1, 2).unwrap();
    let push = g.u(0) * (g.t() * 2.0).sin() - 0.8 * w;
    s.set_f0(function(&g, d, &[v, push - q, g.constant(0.0)])).unwrap();
    s.add_subsystem(Subsystem {
        rows: vec![1],
        modes: function(&g, d, &[-g.p(0), g.p(0)]),
        n_modes: 2,
        regions: Regions::Signs { psi: function(&g, d, &[v]), signs: vec![1, -1] },
    })
    .unwrap();
    let kick = function(&g, d, &[q + 0.1 * g.p(1), v * (1.0 - g.p(0)) + 0.3 * g.u(0) + 0.05 * g.t(), w]);
    s.add_transition(Transition {
        guard: function(&g, d, &[q - 0.4 * g.p(1) - 0.1 * (3.0 * g.t()).sin() * g.u(0)]),
        direction: Rising,
        from: vec![(2, 0.0)],
        reset: Some(kick.into()),
        to: vec![(2, 1.0)],
        rule: Rule::default(),
        clauses: vec![],
    })
    .unwrap();
    s.add_transition(Transition {
        guard: function(&g, d, &[q + 0.2 * g.p(1) * q * q + 0.05 * v]),
        direction: Falling,
        from: vec![(2, 1.0)],
        reset: None,
        to: vec![(2, 0.0)],
        rule: Rule::default(),
        clauses: vec![],
    })
    .unwrap();
    s
}

#[test]
fn derivatives_three_ways() {
    // jumps and crossings; and a nearly grazing jump, where differences are worth less, with a phase of rest behind it
    differentiate([0.6, 0.9], 14.0, 1.0, |e| e.jumps().len() >= 4);
    differentiate([0.7, 0.9], 9.0, 20.0, |e| e.switches().iter().any(|s| s.kind == Kind::Enter));
}

fn differentiate(p: [f64; 2], t_end: f64, worse: f64, is_meant: impl Fn(&Engine) -> bool) {
    let (x0, u) = ([0.1, 0.4, 0.0], [1.3]);
    for (method, agree) in [(Method::Dp5, 2e-8), (Method::Dop853, 2e-8), (Method::Radau5, 2e-6)] {
        let agree = agree * worse;
        let opt = Options { method, sensitivity: true.into(), adjoint: true, ..Options::with_tolerance(1e-11, 1e-11) };
        let run = |x0: &[f64], p: &[f64], u: &[f64]| {
            let mut e = Engine::new(&everything(), &opt).unwrap();
            e.reinit(0.0, x0).unwrap();
            e.set_params(p).unwrap();
            e.set_controls(u).unwrap();
            e.advance(t_end).unwrap();
            assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
            e
        };
        let mut e = run(&x0, &p, &u);
        assert!(is_meant(&e), "{:?} {:?}", e.jumps(), e.switches());
        assert!(!e.one_sided());
        // columns: states, parameters, controls
        let s = e.sensitivity().unwrap().to_vec();
        let last = e.jumps().len() - 1;
        let dt = e.jumps()[last].dt.clone();
        for i in 0..2 {
            let mut v = [0.0; 3];
            v[i] = 1.0;
            let gradient = e.adjoint(&v, &[]).unwrap();
            let adjoint = [&gradient.x0[..], &gradient.p, &gradient.u].concat();
            assert!(off(&adjoint, &s[i * 6..(i + 1) * 6]) < 1e-10, "{method:?}: {adjoint:?} {:?}", &s[i * 6..]);
        }
        let gradient = e.adjoint(&[0.0; 3], &[Term::Jump { index: last, weight: 1.0 }]).unwrap();
        let adjoint = [&gradient.x0[..], &gradient.p, &gradient.u].concat();
        assert!(off(&adjoint, &dt) < 1e-10, "{method:?}: {adjoint:?} {dt:?}");
        for c in [0, 1, 3, 4, 5] {
            let moved = |h: f64| {
                let (mut x, mut p, mut u) = (x0, p, u);
                match c {
                    0..=2 => x[c] += h,
                    3 | 4 => p[c - 3] += h,
                    _ => u[0] += h,
                }
                let e = run(&x, &p, &u);
                [e.state(), &[e.jumps()[last].t]].concat()
            };
            let h = 1e-5;
            // of fourth order
            let at = [-2.0, -1.0, 1.0, 2.0].map(|k| moved(k * h));
            let difference = |i: usize| (at[0][i] - 8.0 * at[1][i] + 8.0 * at[2][i] - at[3][i]) / (12.0 * h);
            let exact = [s[c], s[6 + c], dt[c]];
            let found = [difference(0), difference(1), difference(3)];
            assert!(off(&found, &exact) < agree, "{method:?}, column {c}: {found:?} {exact:?}");
        }
    }
}

#[test]
fn each_method_keeps_its_order_through_jumps() {
    let start = |opt: &Options| run(&everything(), opt, &[0.1, 0.4, 0.0], &[0.0, 0.9], 6.0);
    let exact = start(&Options::with_tolerance(1e-13, 1e-13));
    for (method, order) in [(Method::Dp5, 5.0), (Method::Dop853, 8.0)] {
        let mut points = Vec::new();
        for k in 8..26 {
            let tol = 10f64.powf(-0.4 * f64::from(k));
            let r = start(&Options { method, ..Options::with_tolerance(tol, tol) });
            assert_eq!(r.jumps().len(), exact.jumps().len(), "{method:?} {tol:e}");
            let error = off(r.state(), exact.state());
            if error > 1e-12 {
                points.push(((r.stats().evaluations as f64).log10(), error.log10()));
            }
        }
        let n = points.len() as f64;
        let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
            / points.iter().map(|p| (p.0 - mx) * (p.0 - mx)).sum::<f64>();
        assert!(slope < 0.5 - order, "{method:?}: order {}: {points:?}", -slope);
    }
}

/// `x' = 1` and a state that counts.
fn counter(guard: impl Fn(&Graph) -> Expr, direction: Direction) -> System {
    let (g, d) = (Graph::new(), Dims { x: 2, u: 1, p: 0 });
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(function(&g, d, &[g.constant(1.0), g.constant(0.0)])).unwrap();
    let reset = Some(function(&g, d, &[g.x(0), g.x(1) + 1.0]).into());
    s.add_transition(Transition {
        guard: function(&g, d, &[guard(&g)]),
        direction,
        from: vec![],
        reset,
        to: vec![],
        rule: Rule::default(),
        clauses: vec![],
    })
    .unwrap();
    s
}

#[test]
fn a_guard_that_has_passed_is_watched_again_when_it_is_back() {
    let pi = std::f64::consts::PI;
    for (direction, first) in [(Rising, 2.0 * pi), (Falling, pi)] {
        let s = counter(|g| g.x(0).sin(), direction);
        let mut e = Engine::new(&s, &Options::with_tolerance(1e-9, 1e-9)).unwrap();
        let start = if direction == Rising { pi + 0.1 } else { 0.1 };
        e.reinit(0.0, &[start, 0.0]).unwrap();
        e.advance(40.0).unwrap();
        assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
        let expected: Vec<f64> =
            (0..7).map(|k| first + 2.0 * pi * f64::from(k) - start).filter(|t| *t < 40.0).collect();
        assert!(off(&times(e.jumps()), &expected) < 1e-10, "{direction:?}: {:?}", times(e.jumps()));
        assert_eq!(e.state()[1], expected.len() as f64);
        // a change of the controls while it is beyond zero is no reason to count again
        e.reinit(0.0, &[start, 0.0]).unwrap();
        for k in 1..80 {
            e.advance(0.5 * f64::from(k)).unwrap();
            e.set_controls(&[f64::from(k)]).unwrap();
        }
        assert!(off(&times(e.jumps()), &expected) < 1e-10, "{direction:?}: {:?}", times(e.jumps()));
    }
}

#[test]
fn controls_may_make_a_guard_hold() {
    let s = counter(|g| g.u(0) - g.x(0), Rising);
    let mut e = Engine::new(&s, &Options::default()).unwrap();
    e.reinit(0.0, &[0.0, 0.0]).unwrap();
    e.advance(1.0).unwrap();
    assert!(e.jumps().is_empty());
    e.set_controls(&[2.0]).unwrap();
    e.advance(1.5).unwrap();
    assert_eq!(times(e.jumps()), [1.0]);
    e.advance(3.0).unwrap();
    e.set_controls(&[4.0]).unwrap();
    e.advance(5.0).unwrap();
    assert_eq!(times(e.jumps()), [1.0, 3.0]);
}

#[test]
fn chains_end_or_are_refused() {
    // two guards that vanish at one time, and a third that the second makes hold
    let (g, d) = (Graph::new(), Dims { x: 4, u: 0, p: 0 });
    let zero = g.constant(0.0);
    let mut s = System::new(4, 0, 0).unwrap();
    s.set_f0(function(&g, d, &[g.constant(1.0), zero, zero, zero])).unwrap();
    for (guard, from, to) in [
        (g.x(0) - 1.0, vec![(1, 0.0)], (1, 1.0)),
        (2.0 * g.x(0) - 2.0, vec![(2, 0.0)], (2, 1.0)),
        (g.x(0) + g.x(2) - 1.5, vec![(3, 0.0)], (3, 1.0)),
    ] {
        s.add_transition(Transition {
            guard: function(&g, d, &[guard]),
            direction: Rising,
            from,
            reset: None,
            to: vec![to],
            rule: Rule::default(),
            clauses: vec![],
        })
        .unwrap();
    }
    let opt = Options { sensitivity: true.into(), ..Options::default() };
    let e = run(&s, &opt, &[0.0; 4], &[], 3.0);
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    let made: Vec<usize> = e.jumps().iter().map(|j| j.transition).collect();
    assert_eq!(made, [0, 1, 2]);
    assert!(off(e.state(), &[3.0, 1.0, 1.0, 1.0]) < 1e-14, "{:?}", e.state());
    assert!(e.jumps().iter().all(|j| (j.t - 1.0).abs() < 1e-14 && j.simultaneous) && e.one_sided());

    // two that trigger each other for ever
    let mut s = System::new(4, 0, 0).unwrap();
    s.set_f0(function(&g, d, &[g.constant(1.0), zero, zero, zero])).unwrap();
    for (from, to) in [(0.0, 1.0), (1.0, 0.0)] {
        s.add_transition(Transition {
            guard: function(&g, d, &[g.x(0) - 1.0]),
            direction: Rising,
            from: vec![(1, from)],
            reset: None,
            to: vec![(1, to)],
            rule: Rule::default(),
            clauses: vec![],
        })
        .unwrap();
    }
    let e = run(&s, &Options::default(), &[0.0; 4], &[], 3.0);
    assert_eq!(e.outcome(), Outcome::NoContinuation);
    assert!(e.reason().contains("for ever"), "{}", e.reason());
}

#[test]
fn what_makes_no_sense_is_refused() {
    let (g, d) = (Graph::new(), Dims { x: 2, u: 0, p: 0 });
    let mut s = System::new(2, 0, 0).unwrap();
    s.set_f0(function(&g, d, &[g.constant(1.0), g.constant(1.0)])).unwrap();
    let guard = || function(&g, d, &[g.x(0)]);
    let make = |from, to| Transition {
        guard: guard(),
        direction: Rising,
        from,
        reset: None,
        to,
        rule: Rule::default(),
        clauses: vec![],
    };
    for (t, word) in [
        (make(vec![], vec![]), "changes nothing"),
        (make(vec![(2, 0.0)], vec![(0, 1.0)]), "names the state 2"),
        (make(vec![(1, f64::NAN)], vec![(1, 1.0)]), "NaN"),
        (make(vec![], vec![(1, 1.0), (1, 2.0)]), "twice"),
        (Transition { reset: Some(guard().into()), ..make(vec![], vec![]) }, "outputs"),
        (Transition { guard: function(&g, d, &[g.x(0), g.x(1)]), ..make(vec![], vec![(1, 1.0)]) }, "outputs"),
    ] {
        let e = s.add_transition(t).unwrap_err().to_string();
        assert!(e.contains(word), "{e}");
    }
    // a discrete state that moves
    s.add_transition(make(vec![(1, 0.0)], vec![(1, 1.0)])).unwrap();
    let mut e = Engine::new(&s, &Options::default()).unwrap();
    e.reinit(0.0, &[-1.0, 0.0]).unwrap();
    let said = e.advance(1.0).unwrap_err().to_string();
    assert!(said.contains("state 1 is discrete"), "{said}");
    // what finite elements do not follow they say
    let mut s = System::new(2, 0, 0).unwrap();
    s.set_f0(function(&g, d, &[g.constant(1.0), g.constant(1.0)])).unwrap();
    s.add_transition(Transition { rule: Rule::event("seen", Effect::Note), ..make(vec![], vec![]) }).unwrap();
    let said = switchback::sim::Simulator::new(&s, &Settings::default()).err().unwrap().to_string();
    assert!(said.contains("event-driven"), "{said}");
}

#[test]
fn units_do_not_matter() {
    let base = run(&thermostat(), &Options::with_tolerance(1e-9, 1e-9), &[15.0, 0.0], &[0.2, 5.0, 18.0, 20.0], 12.0);
    for (a, b) in [(1e12, 1.0), (1e-12, 1.0), (1.0, 1e9), (1.0, 1e-9), (1e9, 1e-9)] {
        // temperature in units of 1/a, time in units of 1/b
        let opt = Options { atol: vec![1e-9 * a, 1e-9], rtol: vec![1e-9], ..Options::default() };
        let p = [0.2 / b, 5.0 * a / b, 18.0 * a, 20.0 * a];
        let r = run(&thermostat(), &opt, &[15.0 * a, 0.0], &p, 12.0 * b);
        assert_eq!(r.outcome(), Outcome::Reached, "{a:e} {b:e}: {}", r.reason());
        let found: Vec<f64> = times(r.jumps()).iter().map(|t| t / b).collect();
        assert!(off(&found, &times(base.jumps())) < 1e-9, "{a:e} {b:e}: {found:?}");
        assert!((r.state()[0] / a - base.state()[0]).abs() < 1e-7, "{a:e} {b:e}");
    }
}

fn clocked(
    nx: usize,
    discrete: usize,
    rhs: &[switchback::expr::Expr],
    add: impl Fn(&mut Model),
    graph: &Graph,
    end: f64,
) -> Vec<f64> {
    let mut m = Model::from_rhs("clocked", 0, 0, rhs).unwrap();
    m.set_discrete(&vec![0.0; discrete]).unwrap();
    add(&mut m);
    let built = m.build(graph).unwrap();
    let mut e = Engine::new(&built.system, &Options::with_tolerance(1e-9, 1e-10)).unwrap();
    e.reinit(0.0, &vec![0.0; nx]).unwrap();
    assert_eq!(e.advance(end).unwrap(), Outcome::Reached, "{}", e.reason());
    e.state().to_vec()
}

/// The time is sampled at 0.25, 0.55, ..., 0.85, and is 0.85 at the last time before 1.
#[test]
fn a_clock_samples_and_counts() {
    let g = Graph::new();
    let rhs = [g.constant(1.0), g.constant(0.0), g.constant(0.0)];
    let clock = Clock { reset: vec![(1, g.x(0).id())], ..Clock::every(0.3, 0.25, 2) };
    let x = clocked(3, 2, &rhs, |m| assert_eq!(m.add_clock(&mut g.dag(), &clock).unwrap(), 0), &g, 1.0);
    assert!((x[0] - 1.0).abs() < 1e-9 && (x[1] - 0.85).abs() < 1e-9, "{x:?}");
    assert_eq!(x[2], 3.0);
}

#[test]
fn a_list_of_times_resets_at_each() {
    let g = Graph::new();
    let rhs = [g.constant(0.0), g.constant(0.0)];
    // 3 (3 (0 + 1) + 1) + 1
    let reset = vec![(0, (3.0 * g.x(0) + 1.0).id())];
    let clock = Clock { strikes: Strikes::At(vec![0.1, 0.2, 0.9]), count: 1, reset, to: Vec::new() };
    let x = clocked(2, 1, &rhs, |m| assert_eq!(m.add_clock(&mut g.dag(), &clock).unwrap(), 0), &g, 1.0);
    assert_eq!(x, [13.0, 3.0]);
}

/// The integral of the pulse is the duty, here a ramp: in period `k` the pulse ends where `t = k + (t + 1) / 8`.
#[test]
fn pulses_are_as_wide_as_the_duty_says() {
    let g = Graph::new();
    let rhs = [g.x(1), g.constant(0.0), g.constant(0.0)];
    let duty = ((g.t() + 1.0) / 8.0).id();
    let pwm = Pwm { duty, period: 1.0, offset: 0.0, pulse: 1, count: 2 };
    let x = clocked(3, 2, &rhs, |m| assert_eq!(m.add_pwm(&mut g.dag(), &pwm).unwrap(), 0), &g, 3.5);
    // of the last one half a period is over
    let widths = (1.0 + 2.0 + 3.0) / 7.0 + 0.5;
    assert!((x[0] - widths).abs() < 1e-8, "{} {widths}", x[0]);
    assert_eq!(x[2], 4.0);
}
