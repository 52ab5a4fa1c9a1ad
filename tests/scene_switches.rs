//! Scenes whose forces and further states switch, beside contacts, joints and constraints, against closed forms.

use switchback::error::Result;
use switchback::event::{Ambiguity, Engine, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::scene::{Constraint, Contact, Friction, Scene};
use switchback::stepping::{self, Stepper};
use switchback::system::System;

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

/// Forward and adjoint derivatives of the final state against differences of a closed form of starts and parameters.
/// `held` are states of the start that contacts or joints hold: the closed form says nothing of others there.
fn check_derivatives(s: &System, (x0, p): (&[f64], &[f64]), held: &[usize], t: f64, exact: Exact) {
    let d = 1e-4;
    let (nx, n_c) = (x0.len(), x0.len() + p.len());
    let mut e = run(s, 1e-12, x0, p, t);
    assert!(off(e.state(), &exact(x0, p)) < 1e-9, "{:?} {:?}", e.state(), exact(x0, p));
    let forward = e.sensitivity().unwrap().to_vec();
    for c in (0..n_c).filter(|c| !held.contains(c)) {
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

#[test]
fn a_relay_holds_a_velocity() {
    let g = Graph::new();
    let force = g.p(0) - g.p(1) * (g.x(1) - g.p(2)).sign();
    let system = scene("relay", [1, 1, 0], 3, &[force], &[]).build(&g).unwrap().system;
    let (x0, p, t) = ([0.3, 2.0], [0.5, 2.0, 0.8], 2.0);
    check_derivatives(&system, (&x0, &p), &[], t, &|x, p| {
        let a = p[0] - p[1];
        let stop = (x[1] - p[2]) / -a;
        vec![x[0] + x[1] * stop + 0.5 * a * stop * stop + p[2] * (t - stop), p[2]]
    });
    let mut e = run(&system, 1e-9, &x0, &p, t);
    assert_eq!(e.switches().len(), 1);
    let made = e.take_run();
    let weight = |t: f64| made.contact_forces(t).unwrap()[0][1];
    assert!((weight(0.1) - 1.0).abs() < 1e-15 && (weight(1.5) - 0.25).abs() < 1e-12, "{} {}", weight(0.1), weight(1.5));
}

#[test]
fn a_switch_of_position_is_crossed() {
    let g = Graph::new();
    let system = scene("bang", [1, 1, 0], 0, &[-g.x(0).sign()], &[]).build(&g).unwrap().system;
    // a quarter of the way takes √2
    let e = run(&system, 1e-11, &[1.0, 0.0], &[], 8.0 * 2.0f64.sqrt() + 0.1);
    assert!(off(e.state(), &[1.0 - 0.005, -0.1]) < 1e-8, "{:?}", e.state());
    assert_eq!(e.switches().len(), 4);
}

#[test]
fn a_weight_is_found_with_the_force_of_a_floor() {
    // a block on a floor with friction, whose motor is switched by its velocity: it slides at the velocity p0, and there the weight
    // carries the friction. Behind t = 2 the block is pressed so much that the motor cannot hold it
    let g = Graph::new();
    let (y, v) = (g.x(1), g.x(2));
    let press = 10.0 + 20.0 * (g.t() - 2.0).sign() + 20.0;
    let mut s = scene("block", [2, 2, 0], 2, &[g.p(1) * (g.p(0) - v).sign(), -press], &[]);
    let mut c = Contact::new(&g, "floor", y);
    (c.tangents, c.friction) = (vec![g.x(0).id()], g.constant(0.2).id());
    s.add_contact(c).unwrap();
    let system = s.build(&g).unwrap().system;
    let (x0, p, t) = ([0.0, 0.0, 0.0, 0.0], [1.5, 5.0], 2.2);
    check_derivatives(&system, (&x0, &p), &[1, 2, 3], t, &|x, p| {
        let a = p[1] - 2.0;
        let up = (p[0] - x[2]) / a;
        let there = x[0] + x[2] * up + 0.5 * a * up * up + p[0] * (2.0 - up);
        let b = p[1] - 10.0;
        vec![there + p[0] * 0.2 + 0.02 * b, 0.0, p[0] + 0.2 * b, 0.0]
    });
    let mut e = run(&system, 1e-9, &x0, &p, t);
    let forces = e.take_run().contact_forces(1.5).unwrap();
    assert!((forces[0][0] - 10.0).abs() < 1e-10 && (forces[0][1] + 2.0).abs() < 1e-10, "{forces:?}");
    let names: Vec<f64> = forces[1..].iter().map(|f| f[1]).collect();
    assert!(names.iter().any(|w| (w.abs() - 0.4).abs() < 1e-10), "{names:?}");
}

#[test]
fn switches_inside_of_switches_and_squares_of_them() {
    let g = Graph::new();
    let (q, v) = (g.x(0), g.x(1));
    let c = |v: f64| g.constant(v);
    let force = q.gt(0.0).select(v.gt(0.0).select(c(-2.0), c(-1.0)), c(1.0));
    let system = scene("nested", [1, 1, 0], 0, &[force], &[]).build(&g).unwrap().system;
    let fall = 2.5f64.sqrt();
    let e = run(&system, 1e-11, &[1.0, 1.0], &[], 0.5 + fall + 0.5);
    assert!(off(e.state(), &[-0.5 * fall + 0.125, -fall + 0.5]) < 1e-8, "{:?}", e.state());
    // sign(v) |v| is v, also where v is decided with other things
    let system = scene("drag", [1, 1, 0], 0, &[-v.sign() * v.abs()], &[]).build(&g).unwrap().system;
    let e = run(&system, 1e-11, &[0.0, 1.0], &[], 1.0);
    assert!((e.state()[1] - (-1.0f64).exp()).abs() < 1e-9, "{:?}", e.state());
    let system = scene("wave", [1, 1, 0], 0, &[(g.t() * std::f64::consts::PI).sin().sign()], &[]);
    let e = run(&system.build(&g).unwrap().system, 1e-10, &[0.0, 0.0], &[], 2.5);
    assert!((e.state()[1] - 0.5).abs() < 1e-8, "{:?}", e.state());
}

#[test]
fn a_current_that_a_relay_holds_drives_a_joint() {
    let g = Graph::new();
    let z = g.x(2);
    let rate = -z + 2.0 * (g.p(0) - z).sign();
    let mut s = scene("motor", [1, 1, 1], 2, &[z + 0.0], &[rate]);
    s.add_friction(Friction::new("gear", g.x(0), g.p(1))).unwrap();
    let built = s.build(&g).unwrap();
    assert_eq!(built.report.n_states, 1);
    let t = 2.0;
    check_derivatives(&built.system, (&[0.1, 0.0, 0.0], &[1.0, 0.3]), &[1], t, &|x, p| {
        // z = 2 − (2 − z0) e^{−t} until it is p0; the joint starts where z = p1
        let at = |z: f64| ((2.0 - x[2]) / (2.0 - z)).ln();
        let (t1, t2) = (at(p[1]), at(p[0]));
        let c = 2.0 - x[2];
        let (a, e1, e2) = (2.0 - p[1], (-t1).exp(), (-t2).exp());
        let v2 = a * (t2 - t1) + c * (e2 - e1);
        let q2 = x[0] + 0.5 * a * (t2 - t1).powi(2) - c * (e2 - e1) - c * e1 * (t2 - t1);
        let (left, b) = (t - t2, p[0] - p[1]);
        vec![q2 + v2 * left + 0.5 * b * left * left, v2 + b * left, p[0]]
    });
}

#[test]
fn contact_joint_switch_and_constraint_change_at_one_time() {
    // a ball falls on a floor; the force on two carts, which a rod joins, is switched by the velocity of the ball, and is more than what
    // the joint holds only while it flies up
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(2));
    let zero = g.constant(0.0);
    let drive = g.x(5).gt(0.0).select(g.constant(3.0), g.constant(0.5));
    let mut s = scene("all", [3, 3, 0], 2, &[drive, zero, g.constant(-10.0)], &[]);
    s.add_constraint(Constraint::new("rod", x - g.x(1))).unwrap();
    s.add_friction(Friction::new("rail", x, g.p(0))).unwrap();
    s.add_contact(Contact { restitution: g.p(1).id(), ..Contact::new(&g, "floor", y) }).unwrap();
    let system = s.build(&g).unwrap().system;
    let (x0, p, t) = ([0.0, 0.0, 5.0, 0.0, 0.0, 0.0], [2.0, 0.5], 1.9);
    let mut e = run(&system, 1e-12, &x0, &p, t);
    let exact = |y0: f64, f: f64, r: f64| {
        let hit = (y0 / 5.0).sqrt();
        let up = r * hit;
        let (a, b) = ((3.0 - f) / 2.0, (f - 0.5) / 2.0);
        let v = a * up;
        let left = t - hit;
        [0.5 * a * up * up + v * v / (2.0 * b), 10.0 * r * hit * left - 5.0 * left * left]
    };
    let [cart, ball] = exact(5.0, 2.0, 0.5);
    assert!(off(e.state(), &[cart, cart, ball, 0.0, 0.0, 5.0 - 9.0]) < 1e-9, "{:?} {cart} {ball}", e.state());
    let forward = e.sensitivity().unwrap().to_vec();
    let d = 1e-5;
    for (c, at) in [(2, [5.0, 2.0, 0.5]), (6, [5.0, 2.0, 0.5]), (7, [5.0, 2.0, 0.5])] {
        let by = |k: f64| {
            let mut a = at;
            a[[2, 6, 7].iter().position(|i| *i == c).unwrap()] += k * d;
            exact(a[0], a[1], a[2])
        };
        let (plus, minus) = (by(1.0), by(-1.0));
        for (row, k) in [(0, 0), (1, 0), (2, 1)] {
            let slope = (plus[k] - minus[k]) / (2.0 * d);
            let f = forward[row * 8 + c];
            assert!((f - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{row} {c}: {f} {slope}");
        }
    }
    for i in 0..6 {
        let v: Vec<f64> = (0..6).map(|k| f64::from(u8::from(k == i))).collect();
        let gradient = e.adjoint(&v, &[]).unwrap();
        let adjoint: Vec<f64> = gradient.x0.iter().chain(&gradient.p).copied().collect();
        assert!(off(&adjoint, &forward[i * 8..(i + 1) * 8]) < 1e-8, "{adjoint:?}");
    }
}

#[test]
fn a_switch_shares_a_load_with_a_joint_and_with_a_contact_in_space() {
    let g = Graph::new();
    let v = g.x(1);
    // both hold at rest, 1 and 0.5, and what pushes is the time
    let mut s = scene("both", [1, 1, 0], 0, &[g.t() - 0.5 * v.sign()], &[]);
    s.add_friction(Friction::new("joint", g.x(0), g.constant(1.0))).unwrap();
    let e = run(&s.build(&g).unwrap().system, 1e-10, &[0.0, 0.0], &[], 2.5);
    assert!(off(e.state(), &[1.0 / 6.0, 0.5]) < 1e-8, "{:?}", e.state());
    for (push, moved) in [(2.5, 0.0), (4.0, 1.0)] {
        let vx = g.x(3);
        let force = [push - vx.sign(), g.constant(0.0), g.constant(-10.0)];
        let mut s = scene("space", [3, 3, 0], 0, &force, &[]);
        let mut c = Contact::new(&g, "floor", g.x(2));
        (c.tangents, c.friction) = (vec![g.x(0).id(), g.x(1).id()], g.constant(0.2).id());
        s.add_contact(c).unwrap();
        let e = run(&s.build(&g).unwrap().system, 1e-9, &[0.0; 6], &[], 1.0);
        assert!(off(e.state(), &[0.5 * moved, 0.0, 0.0, moved, 0.0, 0.0]) < 1e-7, "{push} {:?}", e.state());
    }
}

#[test]
fn a_switch_at_a_gap_that_is_held_does_nothing() {
    let g = Graph::new();
    let mut s = scene("floor", [1, 1, 0], 0, &[g.x(0).sign() - 10.0], &[]);
    s.add_contact(Contact::new(&g, "floor", g.x(0))).unwrap();
    let system = s.build(&g).unwrap().system;
    for x0 in [[0.0, 0.0], [0.45, 0.0]] {
        let e = run(&system, 1e-9, &x0, &[], 1.0);
        assert!(off(e.state(), &[0.0, 0.0]) < 1e-9, "{:?}", e.state());
    }
}

/// Twisting: a switch of the position and a weaker one of the velocity bring a body to rest by infinitely many switches, whose times are a
/// geometric series.
#[test]
fn switches_that_accumulate_end_the_run() {
    let g = Graph::new();
    let force = -2.0 * g.x(0).sign() - 0.9 * g.x(1).sign();
    let system = scene("twisting", [1, 1, 0], 0, &[force], &[]).build(&g).unwrap().system;
    let e = try_run(&system, 1e-9, &[1.0, 0.0], &[], 9.0);
    let (fast, slow) = (2.9f64, 1.1f64);
    let (v, r) = ((2.0 * slow).sqrt(), (slow / fast).sqrt());
    let end = (2.0 / slow).sqrt() + v * (1.0 / fast + r / slow) / (1.0 - r);
    assert_eq!(e.outcome(), Outcome::Zeno, "{}", e.reason());
    assert!(e.reason().contains("switch at x[") && e.reason().contains("ever faster"), "{}", e.reason());
    // it ends where nothing moves any more, a little before the limit
    assert!((e.time() - end).abs() < 1e-5 && off(e.state(), &[0.0, 0.0]) < 1e-6, "{} {end} {:?}", e.time(), e.state());
}

/// Many bodies, of which one is driven by a relay: far contacts are not looked at, and none is missed.
#[test]
fn a_relay_among_many_contacts() {
    let g = Graph::new();
    let n = 12;
    let v = |i: usize| g.x(n + i);
    let mut force: Vec<Expr> = (0..n).map(|_| g.constant(-10.0)).collect();
    force[0] = 3.0 * (0.5 - v(0)).sign();
    let mut s = scene("many", [n, n, 0], 0, &force, &[]);
    for i in 1..n {
        let c = Contact { restitution: g.constant(0.5).id(), ..Contact::new(&g, &format!("floor {i}"), g.x(i)) };
        s.add_contact(c).unwrap();
    }
    let system = s.build(&g).unwrap().system;
    let heights: Vec<f64> = (0..n).map(|i| if i == 0 { 0.0 } else { 1.0 + i as f64 }).collect();
    let x0: Vec<f64> = heights.iter().copied().chain((0..n).map(|_| 0.0)).collect();
    let t = 1.5;
    let e = run(&system, 1e-10, &x0, &[], t);
    let mut expected = vec![0.0; 2 * n];
    let up = 0.5 / 3.0;
    (expected[0], expected[n]) = (0.25 * up + 0.5 * (t - up), 0.5);
    for i in 1..n {
        let (mut at, mut w, mut y) = (0.0, 0.0, heights[i]);
        loop {
            // the next time on the floor
            let lands = at + (w + (w * w + 20.0 * y).sqrt()) / 10.0;
            if lands >= t {
                break;
            }
            w = -0.5 * (w - 10.0 * (lands - at));
            (at, y) = (lands, 0.0);
        }
        let left = t - at;
        (expected[i], expected[n + i]) = (y + w * left - 5.0 * left * left, w - 10.0 * left);
    }
    assert!(off(e.state(), &expected) < 1e-8, "{:?} {expected:?}", e.state());
}

fn wrong<T>(r: Result<T>, words: &str) {
    let e = r.err().expect(words).to_string();
    assert!(e.contains(words), "{e} / {words}");
}

#[test]
fn what_cannot_be_followed_is_said() {
    let g = Graph::new();
    let (q, v) = (g.x(0), g.x(1));
    let made = |force: Expr| scene("body", [1, 1, 0], 0, &[force], &[]).build(&g);
    let mut s = Scene::new("condition", 1, 1, 0, 0).unwrap();
    s.set_force(0, v.gt(0.0).id()).unwrap();
    wrong(s.build(&g), "is a condition");
    wrong(made(v.floor()), "has floor");
    let mut s = scene("gap", [1, 1, 0], 0, &[g.constant(0.0)], &[]);
    s.add_contact(Contact::new(&g, "floor", q.sign() + q)).unwrap();
    wrong(s.build(&g), "only forces and the rates of further states");
    let mut s = Scene::projected("set", 1, 0, 0).unwrap();
    s.set_force(0, q.sign().id()).unwrap();
    let system = s.build(&g).unwrap().system;
    wrong(system.with_multipliers().map(|_| ()), "finite elements cannot follow the switch at");
    let system = made(-v.sign()).unwrap().system;
    wrong(Stepper::new(&system, &stepping::Options::default()), "time stepping does not follow switches");
    // two that multiply each other and vanish together, where no signs go on
    let nested = q.gt(0.0).select(v.gt(0.0).select(g.constant(-2.0), g.constant(-1.0)), g.constant(1.0));
    let system = made(nested).unwrap().system;
    let e = try_run(&system, 1e-8, &[0.0, 0.0], &[], 1.0);
    assert_eq!(e.outcome(), Outcome::NoContinuation);
    assert!(e.reason().contains("multiply each other"), "{}", e.reason());
    // where signs do go on they are found
    for (f, end) in [(-q.sign() * v.sign(), -0.5), (1.0 + 0.5 * q.sign() * v.sign(), 0.75)] {
        let e = run(&made(f).unwrap().system, 1e-9, &[0.0, 0.0], &[], 1.0);
        assert!(off(e.state(), &[end, 2.0 * end]) < 1e-8, "{:?}", e.state());
    }
    // held at zero by a weight that no rate determines: neither sign goes on, and nothing is guessed
    let system = made(0.5 - q.sign()).unwrap().system;
    let e = try_run(&system, 1e-8, &[0.0, 0.0], &[], 1.0);
    assert_eq!(e.outcome(), Outcome::NoContinuation);
    assert!(e.reason().contains("undecided"), "{}", e.reason());
    let system = made(1.5 - q.sign()).unwrap().system;
    let e = run(&system, 1e-9, &[0.0, 0.0], &[], 1.0);
    assert!(off(e.state(), &[0.25, 0.5]) < 1e-8, "{:?}", e.state());
    // at rest where nothing decides: it could go either way, or stay
    let system = made(v.sign()).unwrap().system;
    let o = Options { ambiguity: Ambiguity::Stop, ..Options::with_tolerance(1e-8, 1e-8) };
    let mut e = Engine::new(&system, &o).unwrap();
    e.reinit(0.0, &[0.0, 0.0]).unwrap();
    e.advance(1.0).unwrap();
    assert_eq!(e.outcome(), Outcome::Ambiguous, "{}", e.reason());
}
