//! Scenes with discrete states, transitions and clocks, beside contacts, joints and switches, against closed forms.

use switchback::error::Result;
use switchback::event::{Engine, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::model::{Clock, Transition};
use switchback::ocp::Ocp;
use switchback::scene::{Constraint, Contact, Friction, Scene};
use switchback::settings::Settings;
use switchback::stepping::{self, Stepper};
use switchback::system::{Direction, Effect, Rule, System};

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

fn try_run(s: &System, rtol: f64, x0: &[f64], p: &[f64], t: f64) -> Engine {
    let mut o = Options::with_tolerance(rtol, rtol);
    (o.sensitivity, o.adjoint, o.dense) = (true.into(), true, true);
    let mut e = Engine::new(s, &o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e.advance(t).unwrap();
    e
}

fn run(s: &System, rtol: f64, x0: &[f64], p: &[f64], t: f64) -> Engine {
    let e = try_run(s, rtol, x0, p, t);
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

/// The final state by start and parameters.
type Exact<'a> = &'a dyn Fn(&[f64], &[f64]) -> Vec<f64>;

/// Forward and adjoint derivatives of the final state with respect to `columns` of start and parameters, against differences of a closed form.
fn check_derivatives(s: &System, (x0, p): (&[f64], &[f64]), columns: &[usize], t: f64, exact: Exact) {
    let d = 1e-4;
    let (nx, n_c) = (x0.len(), x0.len() + p.len());
    let mut e = run(s, 1e-12, x0, p, t);
    assert!(off(e.state(), &exact(x0, p)) < 1e-9, "{:?} {:?}", e.state(), exact(x0, p));
    let forward = e.sensitivity().unwrap().to_vec();
    for &c in columns {
        let at = |by: f64| {
            let (mut x, mut p) = (x0.to_vec(), p.to_vec());
            if c < nx {
                x[c] += by;
            } else {
                p[c - nx] += by;
            }
            exact(&x, &p)
        };
        let [a, b, g, h] = [-2.0, -1.0, 1.0, 2.0].map(|k| at(k * d));
        for i in 0..nx {
            let slope = (a[i] - 8.0 * b[i] + 8.0 * g[i] - h[i]) / (12.0 * d);
            let f = forward[i * n_c + c];
            assert!((f - slope).abs() < 1e-6 * (1.0 + slope.abs()), "d x{i} / d {c}: {f} {slope}");
        }
    }
    for i in 0..nx {
        let v: Vec<f64> = (0..nx).map(|k| f64::from(u8::from(k == i))).collect();
        let g = e.adjoint(&v, &[]).unwrap();
        let adjoint: Vec<f64> = g.x0.iter().chain(&g.p).copied().collect();
        assert!(off(&adjoint, &forward[i * n_c..(i + 1) * n_c]) < 1e-8, "{adjoint:?} {forward:?}");
    }
}

fn scene(name: &str, sizes: [usize; 3], np: usize, force: &[Expr], rates: &[Expr]) -> Scene {
    let mut s = Scene::with_states(name, sizes[0], sizes[1], sizes[2], 0, np).unwrap();
    force.iter().enumerate().for_each(|(i, f)| s.set_force(i, f.id()).unwrap());
    rates.iter().enumerate().for_each(|(i, f)| s.set_state_rate(i, f.id()).unwrap());
    s
}

fn jump(guard: Expr, from: &[(usize, f64)], reset: &[(usize, Expr)], to: &[(usize, f64)]) -> Transition {
    Transition {
        guard: guard.id(),
        direction: Direction::Rising,
        from: from.to_vec(),
        reset: reset.iter().map(|r| (r.0, r.1.id())).collect(),
        to: to.to_vec(),
        rule: Rule::default(),
    }
}

#[test]
fn a_gripper_lets_a_ball_go_which_bounces() {
    let g = Graph::new();
    let (y, held) = (g.x(0), g.x(2));
    let mut s = scene("gripper", [1, 1, 0], 2, &[-10.0 * (1.0 - held)], &[]);
    assert_eq!(s.add_discrete("held", 1.0).unwrap(), 2);
    s.add_contact(Contact { restitution: g.p(1).id(), ..Contact::new(&g, "floor", y) }).unwrap();
    s.add_transition(jump(y - g.p(0), &[(2, 1.0)], &[], &[(2, 0.0)])).unwrap();
    let built = s.build(&g).unwrap();
    assert_eq!(built.report.transitions.len(), 1);
    // where it is let go it has the velocity v0
    let t = 2.0;
    check_derivatives(&built.system, (&[0.5, 1.0, 1.0], &[1.2, 0.8]), &[0, 1, 3, 4], t, &|x, p| {
        let go = (p[0] - x[0]) / x[1];
        let hit = go + (x[1] + (x[1] * x[1] + 20.0 * p[0]).sqrt()) / 10.0;
        let w = p[1] * (x[1] * x[1] + 20.0 * p[0]).sqrt();
        let left = t - hit;
        vec![w * left - 5.0 * left * left, w - 10.0 * left, 0.0]
    });
    let e = run(&built.system, 1e-9, &[0.5, 1.0, 1.0], &[1.2, 0.8], t);
    assert_eq!((e.jumps().len(), e.impacts().len()), (1, 1));
}

#[test]
fn a_thermostat_a_joint_and_a_relay() {
    // the heat w ∈ {0, 1} switches at the temperatures p0 and p1; the temperature drives a cart against a dry joint, and a relay brakes it
    // where it is faster than 0.2
    let g = Graph::new();
    let (v, z, w) = (g.x(1), g.x(2), g.x(3));
    let brake = 2.0 * (v - 0.2).gt(0.0).select(g.constant(1.0), g.constant(0.0));
    let mut s = scene("heat", [1, 1, 1], 2, &[z - brake], &[2.0 * w - z]);
    s.add_discrete("w", 1.0).unwrap();
    s.add_friction(Friction::new("rail", g.x(0), g.constant(0.3))).unwrap();
    s.add_transition(jump(z - g.p(0), &[(3, 1.0)], &[], &[(3, 0.0)])).unwrap();
    s.add_transition(jump(g.p(1) - z, &[(3, 0.0)], &[], &[(3, 1.0)])).unwrap();
    let system = s.build(&g).unwrap().system;
    let t = 3.0;
    check_derivatives(&system, (&[0.0, 0.0, 0.0, 1.0], &[1.2, 0.8]), &[2, 4, 5], t, &|x, p| {
        // z rises to p0, falls to p1, and so on; the cart begins where z = 0.3, and slides at 0.2 from some time on
        let (t0, c) = (((2.0 - x[2]) / (2.0 - 0.3)).ln(), 2.0 - x[2]);
        let up = |from: f64, to: f64| ((2.0 - from) / (2.0 - to)).ln();
        let mut at = up(x[2], p[0]);
        // the cart reaches 0.2 before: 1.7 (s − t0) + c (e^{−s} − e^{−t0}) = 0.2
        let speed = |s: f64| 1.7 * (s - t0) + c * ((-s).exp() - (-t0).exp());
        let mut s = 0.7;
        for _ in 0..50 {
            s -= (speed(s) - 0.2) / (1.7 - c * (-s).exp());
        }
        let way = 0.85 * (s - t0).powi(2) - c * ((-s).exp() - (-t0).exp()) - c * (-t0).exp() * (s - t0);
        let mut heats = true;
        let z = loop {
            heats = !heats;
            let next = if heats { up(p[1], p[0]) } else { (p[0] / p[1]).ln() };
            let begin = if heats { p[1] } else { p[0] };
            if at + next > t {
                let left = t - at;
                break if heats { 2.0 - (2.0 - begin) * (-left).exp() } else { begin * (-left).exp() };
            }
            at += next;
        };
        vec![x[0] + way + 0.2 * (t - s), 0.2, z, f64::from(u8::from(heats))]
    });
}

#[test]
fn resets_throw_bodies_and_clocks_strike() {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    // beyond p0 the body is thrown back twice as fast, and friction brakes it
    let mut s = scene("wall", [1, 1, 0], 1, &[g.constant(0.0)], &[]);
    s.add_friction(Friction::new("rail", x, g.constant(0.5))).unwrap();
    s.add_transition(jump(x - g.p(0), &[], &[(1, -2.0 * v)], &[])).unwrap();
    let system = s.build(&g).unwrap().system;
    let t = 2.0;
    check_derivatives(&system, (&[0.0, 2.0], &[1.0]), &[0, 1, 2], t, &|x, p| {
        let (d, v) = (p[0] - x[0], x[1]);
        let hit = (v - (v * v - d).sqrt()) / 0.5;
        let w = -2.0 * (v - 0.5 * hit);
        vec![p[0] + w * (t - hit) + 0.25 * (t - hit).powi(2), w + 0.5 * (t - hit)]
    });
    // a clock gives a push every half second, and counts
    let mut s = scene("pushed", [1, 1, 0], 0, &[g.constant(0.0)], &[]);
    let count = s.add_discrete("n", 0.0).unwrap();
    s.add_contact(Contact { restitution: g.constant(1.0).id(), ..Contact::new(&g, "wall", 1.1 - x) }).unwrap();
    let clock = Clock { reset: vec![(1, (v + 1.0).id())], ..Clock::every(0.5, 0.25, count) };
    for t in clock.transitions(&mut g.dag()).unwrap() {
        s.add_transition(t).unwrap();
    }
    let e = run(&s.build(&g).unwrap().system, 1e-10, &[0.0, 0.0, 0.0], &[], 1.5);
    // pushes at 0.25, 0.75, 1.25; at 1.05 the wall is hit with 2, and the third push leaves -1
    assert!(off(e.state(), &[1.1 - 2.0 * 0.2 - 0.25, -1.0, 3.0]) < 1e-9, "{:?}", e.state());
}

#[test]
fn a_reset_onto_a_floor_collides_and_one_into_it_is_refused() {
    let g = Graph::new();
    let y = g.x(0);
    let made = |to: Expr| {
        let mut s = scene("thrown", [1, 1, 0], 1, &[g.constant(-10.0)], &[]);
        s.add_contact(Contact { restitution: g.constant(0.5).id(), ..Contact::new(&g, "floor", y) }).unwrap();
        s.add_transition(jump(g.p(0) - y, &[], &[(0, to)], &[])).unwrap();
        s.build(&g).unwrap().system
    };
    let t = 0.6;
    let system = made(g.constant(0.0));
    check_derivatives(&system, (&[1.0, 0.0], &[0.2]), &[0, 1, 2], t, &|x, p| {
        let fall = (x[1] * x[1] + 20.0 * (x[0] - p[0])).sqrt();
        let hit = (x[1] + fall) / 10.0;
        vec![0.5 * fall * (t - hit) - 5.0 * (t - hit).powi(2), 0.5 * fall - 10.0 * (t - hit)]
    });
    let e = try_run(&made(g.constant(-0.3)), 1e-9, &[1.0, 0.0], &[0.2], t);
    assert_eq!(e.outcome(), Outcome::NoContinuation);
    assert!(e.reason().contains("overlap") && e.reason().contains("floor"), "{}", e.reason());
    // what rests on the floor is lifted off it
    let mut s = scene("lift", [1, 1, 0], 0, &[g.constant(-10.0)], &[]);
    s.add_contact(Contact::new(&g, "floor", y)).unwrap();
    s.add_transition(jump(g.t() - 1.0, &[], &[(0, g.constant(0.45)), (1, g.constant(0.0))], &[])).unwrap();
    let e = run(&s.build(&g).unwrap().system, 1e-10, &[0.0, 0.0], &[], 1.2);
    assert!(off(e.state(), &[0.25, -2.0]) < 1e-9, "{:?}", e.state());
    // and a constraint is kept
    let mut s = scene("rail", [2, 2, 0], 0, &[g.constant(0.0), g.constant(0.0)], &[]);
    s.add_constraint(Constraint::new("rail", g.x(1))).unwrap();
    s.add_transition(jump(g.t() - 1.0, &[], &[(3, g.constant(1.0))], &[])).unwrap();
    let e = try_run(&s.build(&g).unwrap().system, 1e-9, &[0.0, 0.0, 1.0, 0.0], &[], 2.0);
    assert_eq!(e.outcome(), Outcome::NoContinuation);
    assert!(e.reason().contains("constraint rail"), "{}", e.reason());
}

#[test]
fn impacts_make_conditions_true_and_events_stop_and_note() {
    let g = Graph::new();
    let (y, v) = (g.x(0), g.x(1));
    let ball = || {
        let mut s = scene("ball", [1, 1, 0], 0, &[g.constant(-10.0)], &[]);
        s.add_contact(Contact { restitution: g.constant(0.5).id(), ..Contact::new(&g, "floor", y) }).unwrap();
        s
    };
    let mut s = ball();
    let n = s.add_discrete("n", 0.0).unwrap();
    s.add_transition(jump(v, &[], &[(n, g.x(n) + 1.0)], &[])).unwrap();
    // from 5 it falls for a second and bounces with 5, then with 2.5: at 1, 2, 2.5
    let system = s.build(&g).unwrap().system;
    for (t, n) in [(0.9, 0.0), (1.5, 1.0), (2.4, 2.0), (2.6, 3.0)] {
        assert_eq!(run(&system, 1e-9, &[5.0, 0.0, 0.0], &[], t).state()[2], n, "{t}");
    }
    let mut s = ball();
    s.add_transition(Transition::event("high", Effect::Note, (y - 1.0).id())).unwrap();
    s.add_transition(Transition::event("down", Effect::Stop, (-2.5 - v).id())).unwrap();
    let system = s.build(&g).unwrap().system;
    let mut e = try_run(&system, 1e-10, &[0.0, 10.0], &[], 9.0);
    assert_eq!(e.outcome(), Outcome::Event, "{}", e.reason());
    assert!((e.time() - 1.25).abs() < 1e-10 && (e.state()[1] + 2.5).abs() < 1e-9, "{}", e.time());
    let made = e.take_run();
    let up = 1.0 - 0.8f64.sqrt();
    assert!(made.notes.len() == 1 && (made.notes[0].t - up).abs() < 1e-9, "{:?}", made.notes);
}

fn wrong<T>(r: Result<T>, words: &str) {
    let e = r.err().expect(words).to_string();
    assert!(e.contains(words), "{e} / {words}");
}

#[test]
fn what_cannot_be_followed_is_said() {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let made = |t: Transition| {
        let mut s = scene("body", [1, 1, 0], 0, &[g.constant(0.0)], &[]);
        s.add_discrete("w", 0.0)?;
        s.add_transition(t)?;
        s.build(&g)
    };
    wrong(made(jump(x.abs() - 1.0, &[], &[(1, -v)], &[])), "switches itself");
    wrong(made(jump(x, &[], &[(7, -v)], &[])), "names the state 7");
    wrong(made(jump(x, &[], &[], &[])), "changes nothing");
    let mut s = Scene::projected("set", 1, 0, 0).unwrap();
    assert!(s.add_discrete("w", 0.0).is_ok());
    let mut s = Scene::new("one", 1, 1, 0, 0).unwrap();
    wrong(s.add_discrete("w", f64::NAN), "initial value");
    wrong(s.set_state_rate(0, x.id()), "does not exist");
    let system = made(jump(x - 1.0, &[], &[(1, -v)], &[])).unwrap().system;
    wrong(Stepper::new(&system, &stepping::Options::default()), "time stepping cannot follow transitions");
    assert!(Ocp::new(&system, 1.0, 4, &Settings::default()).is_ok());
    // a state that moves is no discrete one
    let system = made(jump(x - 1.0, &[(0, 0.0)], &[], &[(2, 1.0)])).unwrap().system;
    let mut e = Engine::new(&system, &Options::default()).unwrap();
    e.reinit(0.0, &[0.0, 1.0, 0.0]).unwrap();
    wrong(e.advance(1.0), "state 0 is discrete");
}
