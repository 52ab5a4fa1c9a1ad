//! Dry friction at joints, and contacts that stick by more than they slide with, against closed forms.

use switchback::error::{Error, Result};
use switchback::event::{Engine, Method, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::ocp::Ocp;
use switchback::scene::{Constraint, Contact, Friction, Scene};
use switchback::settings::Settings;
use switchback::stepping::{self, Stepper};
use switchback::system::System;

const PI: f64 = std::f64::consts::PI;
const STICKS: usize = 1;
const SLIDES: usize = 2;
const SLIDES_BACK: usize = 3;

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

fn engine(s: &System, rtol: f64, x0: &[f64], p: &[f64]) -> Engine {
    let mut o = Options::with_tolerance(rtol, rtol);
    (o.sensitivity, o.adjoint, o.dense) = (true.into(), true, true);
    let mut e = Engine::new(s, &o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e
}

fn run(s: &System, rtol: f64, x0: &[f64], p: &[f64], t: f64) -> Engine {
    let mut e = engine(s, rtol, x0, p);
    e.advance(t).unwrap();
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

/// Forward, adjoint and differences of the final state with respect to states and parameters agree.
fn check_derivatives(s: &System, x0: &[f64], p: &[f64], t: f64, columns: &[usize]) {
    let mut e = run(s, 1e-12, x0, p, t);
    let (nx, n_c) = (x0.len(), x0.len() + p.len());
    let forward = e.sensitivity().unwrap().to_vec();
    for i in 0..nx {
        let v: Vec<f64> = (0..nx).map(|k| f64::from(u8::from(k == i))).collect();
        let g = e.adjoint(&v, &[]).unwrap();
        let adjoint: Vec<f64> = g.x0.iter().chain(&g.p).copied().collect();
        assert!(off(&adjoint, &forward[i * n_c..(i + 1) * n_c]) < 1e-9, "{adjoint:?} {forward:?}");
    }
    for &c in columns {
        let d = 1e-5;
        let there = |by: f64| {
            let (mut x, mut p) = (x0.to_vec(), p.to_vec());
            if c < nx {
                x[c] += by;
            } else {
                p[c - nx] += by;
            }
            run(s, 1e-12, &x, &p, t).state().to_vec()
        };
        let (a, b) = (there(d), there(-d));
        for i in 0..nx {
            let difference = (a[i] - b[i]) / (2.0 * d);
            let own = forward[i * n_c + c];
            assert!((difference - own).abs() < 1e-6 * (1.0 + own.abs()), "state {i}, column {c}: {own} {difference}");
        }
    }
}

/// One coordinate with a force and dry friction.
fn slider(g: &Graph, np: usize, force: Expr, friction: Friction) -> System {
    let mut s = Scene::new("slider", 1, 1, 0, np).unwrap();
    s.set_force(0, force.id()).unwrap();
    s.add_friction(friction).unwrap();
    s.build(g).unwrap().system
}

/// `ẍ = −x ∓ F`: every half turn takes `2F` from the amplitude, until the spring is weaker than the friction.
#[test]
fn a_mass_on_a_spring_loses_the_same_amplitude_in_every_half_turn_and_stops() {
    let g = Graph::new();
    let system = slider(&g, 1, -g.x(0), Friction::new("guide", g.x(0), g.p(0)));
    let f = 0.15;
    for rtol in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
        let mut e = run(&system, rtol, &[1.0, 0.0], &[f], 20.0);
        assert!(off(e.state(), &[-0.1, 0.0]) < 100.0 * rtol, "{rtol}: {:?}", e.state());
        let times: Vec<f64> = e.switches().iter().map(|s| s.t).collect();
        assert!(off(&times, &[PI, 2.0 * PI, 3.0 * PI]) < 100.0 * rtol, "{times:?}");
        // in the second half turn it moves with the tangent, and friction against it
        let run = e.take_run();
        assert_eq!(run.contact_modes(1.0).unwrap(), [SLIDES_BACK]);
        assert_eq!(run.contact_modes(4.0).unwrap(), [SLIDES]);
        assert_eq!(run.contact_modes(15.0).unwrap(), [STICKS]);
        assert!((run.contact_forces(4.0).unwrap()[0][1] + f).abs() < 1e-14);
        let held = run.contact_forces(15.0).unwrap()[0];
        assert!(held[0] == 0.0 && (held[1] + 0.1).abs() < 100.0 * rtol, "{held:?}");
    }
    // d x/d F = 6 behind three half turns, and x0 changes the sign three times: x = −(1 − 6 F)
    let mut e = run(&system, 1e-10, &[1.0, 0.0], &[f], 20.0);
    assert!(off(&e.sensitivity().unwrap()[..3], &[-1.0, 0.0, 6.0]) < 1e-7, "{:?}", e.sensitivity());
    let gradient = e.adjoint(&[1.0, 0.0], &[]).unwrap();
    assert!(off(&[gradient.x0[0], gradient.p[0]], &[-1.0, 6.0]) < 1e-7);
    check_derivatives(&system, &[1.0, 0.2], &[f], 5.0, &[0, 1, 2]);
}

/// A pendulum with dry friction in its hinge: from one turning angle to the next `cos θ₁ = cos θ₀ + F (θ₀ + θ₁)`.
#[test]
fn a_pendulum_turns_where_energy_says() {
    let g = Graph::new();
    let system = slider(&g, 1, -g.x(0).sin(), Friction::new("hinge", g.x(0), g.p(0)));
    let f = 0.05;
    let mut angles = vec![2.0f64];
    while angles.last().unwrap().sin() > f {
        let from = *angles.last().unwrap();
        let miss = |to: f64| to.cos() - from.cos() - f * (from + to);
        let (mut low, mut high) = (0.0, from);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if miss(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        angles.push(low);
    }
    let mut e = run(&system, 1e-11, &[2.0, 0.0], &[f], 300.0);
    let dense = e.take_run();
    let turns: Vec<f64> = dense.switches.iter().map(|s| s.t).collect();
    assert_eq!(turns.len(), angles.len() - 1);
    for (k, t) in turns.iter().enumerate() {
        let mut x = [0.0; 2];
        dense.path.as_ref().unwrap().eval(*t, 0, &mut x).unwrap();
        let sign = if k % 2 == 0 { -1.0 } else { 1.0 };
        assert!(off(&x, &[sign * angles[k + 1], 0.0]) < 1e-8, "{k}: {x:?} {angles:?}");
    }
    // at the start a velocity of either sign makes another motion
    check_derivatives(&system, &[2.0, 0.0], &[f], 20.0, &[0, 2]);
}

/// The times at which a mass starts and stops that a spring pulls whose end moves with `V`, friction `F` when it slides and `F_s` when
/// it sticks: with the length `y` of the spring, `y = F + (F_s − F) cos τ + V sin τ` while it slides.
fn stick_slip(f: f64, f_s: f64, v: f64, n: usize) -> Vec<f64> {
    let slide = 2.0 * PI - 2.0 * ((f_s - f) / v).atan();
    let mut out = vec![f_s / v];
    for k in 1..2 * n {
        let last = out[k - 1];
        out.push(last + if k % 2 == 1 { slide } else { 2.0 * (f_s - f) / v });
    }
    out
}

#[test]
fn stick_slip_has_its_period() {
    let g = Graph::new();
    let (f, f_s, v) = (0.6, 1.0, 0.5);
    let friction = Friction { stiction: Some(g.p(1).id()), ..Friction::new("belt", g.x(0), g.p(0)) };
    let system = slider(&g, 3, g.p(2) * g.t() - g.x(0), friction);
    for rtol in [1e-5, 1e-8, 1e-11] {
        let e = run(&system, rtol, &[0.0, 0.0], &[f, f_s, v], 20.0);
        let times: Vec<f64> = e.switches().iter().map(|s| s.t).collect();
        let expected = stick_slip(f, f_s, v, 5);
        let n = expected.iter().filter(|t| **t < 20.0).count();
        assert!(n >= 4 && off(&times, &expected[..n]) < 300.0 * rtol, "{times:?} {expected:?}");
        assert!(e.switches().iter().all(|s| s.unique));
    }
    check_derivatives(&system, &[0.0, 0.0], &[f, f_s, v], 9.0, &[0, 2, 3, 4]);
    check_derivatives(&system, &[0.0, 0.0], &[f, f_s, v], 5.0, &[0, 2, 3, 4]);
}

/// The same by the friction of a contact, whose coefficients differ.
#[test]
fn a_block_on_a_floor_sticks_by_more_than_it_slides_with() {
    let g = Graph::new();
    let (mu, mu_s, v) = (0.6, 1.0, 0.5);
    let mut s = Scene::new("block", 2, 2, 0, 2).unwrap();
    s.set_force(0, (v * g.t() - g.x(0)).id()).unwrap();
    s.set_force(1, g.constant(-1.0).id()).unwrap();
    let floor = Contact { tangents: vec![g.x(0).id()], friction: g.p(0).id(), ..Contact::new(&g, "floor", g.x(1)) };
    let k = s.add_contact(floor).unwrap();
    s.set_stiction(k, g.p(1).id()).unwrap();
    let system = s.build(&g).unwrap().system;
    let e = run(&system, 1e-10, &[0.0; 4], &[mu, mu_s], 20.0);
    let times: Vec<f64> = e.switches().iter().map(|s| s.t).collect();
    let expected = stick_slip(mu, mu_s, v, 5);
    let n = expected.iter().filter(|t| **t < 20.0).count();
    assert!(off(&times, &expected[..n]) < 1e-7, "{times:?} {expected:?}");
    check_derivatives(&system, &[0.0; 4], &[mu, mu_s], 9.0, &[0, 4, 5]);
    // steps of equal length: the same motion to their length
    let steps = |h: f64| {
        let mut s = Stepper::new(&system, &stepping::Options { h, ..Default::default() }).unwrap();
        s.set_params(&[mu, mu_s]).unwrap();
        s.reset(0.0, &[0.0; 4]).unwrap();
        s.advance(9.0).unwrap();
        off(s.state(), run(&system, 1e-10, &[0.0; 4], &[mu, mu_s], 9.0).state())
    };
    let (coarse, fine) = (steps(1e-2), steps(1e-3));
    assert!(fine < 5e-3 && fine < 0.3 * coarse, "{coarse} {fine}");
}

/// In space, too: a block on a floor is pulled along a diagonal until it gives way.
#[test]
fn a_block_in_space_gives_way_at_the_larger_friction() {
    let g = Graph::new();
    let (mu, mu_s, v) = (0.6, 1.0, 0.5);
    let d = [0.6, 0.8];
    let mut s = Scene::new("block", 3, 3, 0, 0).unwrap();
    for (i, d) in d.iter().enumerate() {
        s.set_force(i, (v * *d * g.t() - g.x(i)).id()).unwrap();
    }
    s.set_force(2, g.constant(-1.0).id()).unwrap();
    let tangents = vec![g.x(0).id(), g.x(1).id()];
    let k = s.add_contact(Contact { tangents, friction: g.constant(mu).id(), ..Contact::new(&g, "floor", g.x(2)) });
    s.set_stiction(k.unwrap(), g.constant(mu_s).id()).unwrap();
    let system = s.build(&g).unwrap().system;
    let e = run(&system, 1e-9, &[0.0; 6], &[], 8.0);
    let times: Vec<f64> = e.switches().iter().map(|s| s.t).collect();
    let expected = stick_slip(mu, mu_s, v, 5);
    let n = expected.iter().filter(|t| **t < 8.0).count();
    assert!(off(&times, &expected[..n]) < 1e-5, "{times:?} {expected:?}");
}

/// `v̇ = −(F + c v²)`: `v = √(F/c) tan(…)`, at rest after `atan(v₀ √(c/F))/√(F c)`.
#[test]
fn a_bound_may_depend_on_the_velocity() {
    let g = Graph::new();
    let v = g.x(1);
    let zero = g.constant(0.0);
    let system = slider(&g, 2, zero, Friction::new("guide", g.x(0), g.p(0) + g.p(1) * v * v));
    let (f, c, v0) = (0.7, 0.9, 2.0);
    let stop = (v0 * f64::sqrt(c / f)).atan() / f64::sqrt(f * c);
    let way = (1.0 + c * v0 * v0 / f).ln() / (2.0 * c);
    for sign in [1.0, -1.0] {
        let e = run(&system, 1e-10, &[0.0, sign * v0], &[f, c], 4.0);
        assert!(off(e.state(), &[sign * way, 0.0]) < 1e-8, "{:?} {way}", e.state());
        assert!((e.switches()[0].t - stop).abs() < 1e-8);
    }
    check_derivatives(&system, &[0.0, v0], &[f, c], 1.0, &[0, 1, 2, 3]);
    check_derivatives(&system, &[0.0, v0], &[f, c], 4.0, &[0, 1, 2, 3]);
}

/// A weight falls on a platform that friction holds in its guide. Friction has no impulse: both go down together, and stop when the friction
/// has taken the energy.
fn platform(g: &Graph) -> System {
    let mut s = Scene::new("platform", 2, 2, 0, 3).unwrap();
    let (m, gravity) = ([2.0, 3.0], 10.0);
    let entries = [m[0], 0.0, 0.0, m[1]].map(|e| g.constant(e).id());
    s.set_inertia(&entries).unwrap();
    for (i, m) in m.iter().enumerate() {
        s.set_force(i, g.constant(-gravity * m).id()).unwrap();
    }
    let falls = Contact { restitution: g.p(2).id(), ..Contact::new(g, "top", g.x(0) - g.x(1)) };
    s.add_friction(Friction { stiction: Some(g.p(1).id()), ..Friction::new("guide", g.x(1), g.p(0)) }).unwrap();
    s.add_contact(falls).unwrap();
    s.build(g).unwrap().system
}

#[test]
fn a_joint_sticks_while_a_contact_closes_and_slides_behind_the_impact() {
    let g = Graph::new();
    let system = platform(&g);
    let (f, f_s) = (80.0, 90.0);
    // falls 0.8: 0.4 s, 4 m/s; both go on with 1.6 m/s, slowed down by (80 − 50)/5 = 6 m/s²
    let x0 = [0.8, 0.0, 0.0, 0.0];
    let mut e = run(&system, 1e-10, &x0, &[f, f_s, 0.0], 2.0);
    let way = 1.6 * 1.6 / (2.0 * 6.0);
    assert!(off(e.state(), &[-way, -way, 0.0, 0.0]) < 1e-8, "{:?}", e.state());
    assert_eq!(e.impacts().len(), 1);
    assert!((e.impacts()[0].t - 0.4).abs() < 1e-8 && (e.impacts()[0].impulse[0] - 2.0 * (4.0 - 1.6)).abs() < 1e-7);
    let made = e.take_run();
    assert_eq!(made.contact_modes(0.2).unwrap(), [STICKS, 0]);
    assert_eq!(made.contact_modes(0.5).unwrap(), [SLIDES_BACK, 1]);
    assert_eq!(made.contact_modes(1.5).unwrap(), [STICKS, 1]);
    // while it slides the top carries 2 (10 + 6), at rest the weights alone
    let [guide, top] = made.contact_forces(0.5).unwrap()[..] else { panic!() };
    assert!((guide[1] - f).abs() < 1e-10 && (top[0] - 32.0).abs() < 1e-8, "{guide:?} {top:?}");
    let [guide, top] = made.contact_forces(1.5).unwrap()[..] else { panic!() };
    assert!((guide[1] - 50.0).abs() < 1e-8 && (top[0] - 20.0).abs() < 1e-8, "{guide:?} {top:?}");
    check_derivatives(&system, &x0, &[f, f_s, 0.0], 0.5, &[0, 1, 2, 4]);
    check_derivatives(&system, &x0, &[f, f_s, 0.0], 2.0, &[0, 1, 2, 4]);
    // with a rebound
    check_derivatives(&system, &x0, &[f, f_s, 0.4], 0.55, &[0, 1, 2, 4, 6]);
    // steps of equal length
    let mut errors = Vec::new();
    for h in [1e-2, 1e-3] {
        let mut s = Stepper::new(&system, &stepping::Options { h, ..Default::default() }).unwrap();
        s.set_params(&[f, f_s, 0.0]).unwrap();
        s.reset(0.0, &x0).unwrap();
        s.advance(2.0).unwrap();
        errors.push(off(s.state(), &[-way, -way, 0.0, 0.0]));
        assert!((s.impulses()[0][1] / h - 50.0).abs() < 1e-6 && s.impulses()[0][0] == 0.0, "{:?}", s.impulses());
    }
    assert!(errors[1] < 5e-3 && errors[1] < 0.3 * errors[0], "{errors:?}");
}

/// The platform gives way under the weight that has come to it, and a stronger one holds: one problem decides both.
#[test]
fn a_load_that_is_put_on_makes_a_joint_give_way() {
    let g = Graph::new();
    let system = platform(&g);
    // the guide holds 30 alone, but not 50: both accelerate by (50 − 45)/5 = 1
    let e = run(&system, 1e-10, &[0.0; 4], &[45.0, 45.0, 0.0], 1.0);
    assert!(off(e.state(), &[-0.5, -0.5, -1.0, -1.0]) < 1e-9, "{:?}", e.state());
    let e = run(&system, 1e-10, &[0.0; 4], &[45.0, 50.5, 0.0], 1.0);
    assert!(off(e.state(), &[0.0; 4]) < 1e-12, "{:?}", e.state());
}

/// A pile of plates, each held to the one below it by friction of its own: more of them than all states are tried for.
#[test]
fn a_pile_slides_where_it_is_weakest() {
    let n = 9;
    let g = Graph::new();
    let mut s = Scene::new("pile", n, n, 0, 0).unwrap();
    let mass = |i: usize| 1.0 + 0.1 * i as f64;
    let entries: Vec<_> = (0..n * n).map(|k| g.constant(if k / n == k % n { mass(k % n) } else { 0.0 }).id()).collect();
    s.set_inertia(&entries).unwrap();
    let (weak, bound, pull, ground) = (5, 2.0, 40.0, 3.0);
    for i in 0..n {
        s.set_force(i, g.constant(if i == 0 { pull } else { 0.0 }).id()).unwrap();
        let (way, bound) = match i {
            0 => (g.x(0), ground),
            _ => (g.x(i) - g.x(i - 1), if i == weak { bound } else { 50.0 }),
        };
        s.add_friction(Friction::new(&format!("layer {i}"), way, g.constant(bound))).unwrap();
    }
    let system = s.build(&g).unwrap().system;
    let of = |range: std::ops::Range<usize>| range.map(mass).sum::<f64>();
    let upper = bound / of(weak..n);
    let lower = (pull - ground - bound) / of(0..weak);
    let t = 0.7;
    let expected: Vec<f64> = (0..2 * n)
        .map(|k| {
            let a = if k % n < weak { lower } else { upper };
            if k < n {
                0.5 * a * t * t
            } else {
                a * t
            }
        })
        .collect();
    let e = run(&system, 1e-9, &vec![0.0; 2 * n], &[], t);
    assert!(off(e.state(), &expected) < 1e-9, "{:?} {expected:?}", e.state());
    let h = 0.01;
    let mut steps = Stepper::new(&system, &stepping::Options { h, tolerance: 1e-12, ..Default::default() }).unwrap();
    steps.reset(0.0, &vec![0.0; 2 * n]).unwrap();
    steps.advance(t).unwrap();
    assert!(off(steps.state(), &expected) < 1e-6, "{:?} {expected:?}", steps.state());
}

/// Two joints on one axis share what they hold at will; the motion is the same.
#[test]
fn two_joints_on_one_axis() {
    let g = Graph::new();
    let mut s = Scene::new("axis", 1, 1, 0, 0).unwrap();
    s.set_force(0, (-g.x(0)).id()).unwrap();
    s.add_friction(Friction::new("left", g.x(0), g.constant(0.1))).unwrap();
    s.add_friction(Friction::new("right", 2.0 * g.x(0), g.constant(0.025))).unwrap();
    let system = s.build(&g).unwrap().system;
    let e = run(&system, 1e-10, &[1.0, 0.0], &[], 20.0);
    assert!(off(e.state(), &[-0.1, 0.0]) < 1e-8, "{:?}", e.state());
}

/// A joint that has no friction is none, however often it comes to rest; and one that holds everything holds.
#[test]
fn no_friction_at_all_and_very_much() {
    let g = Graph::new();
    let none = slider(&g, 0, -g.x(0), Friction::new("guide", g.x(0), g.constant(0.0)));
    let e = run(&none, 1e-10, &[1.0, 0.0], &[], 30.0);
    assert!(off(e.state(), &[30f64.cos(), -30f64.sin()]) < 1e-7, "{:?}", e.state());
    let much = slider(&g, 0, -g.x(0), Friction::new("guide", g.x(0), g.constant(1e9)));
    let e = run(&much, 1e-10, &[1.0, 1.0], &[], 30.0);
    assert!(off(e.state(), &[1.0, 0.0]) < 1e-8, "{:?}", e.state());
}

/// Stiff damping needs an implicit method: a fast dashpot in series is a friction with a soft start.
#[test]
fn stick_slip_by_an_implicit_method() {
    let g = Graph::new();
    let (f, f_s, v) = (0.6, 1.0, 0.5);
    let friction = Friction { stiction: Some(g.p(1).id()), ..Friction::new("belt", g.x(0), g.p(0)) };
    let system = slider(&g, 3, g.p(2) * g.t() - g.x(0), friction);
    let mut o = Options::with_tolerance(1e-9, 1e-9);
    o.method = Method::Radau5;
    let mut e = Engine::new(&system, &o).unwrap();
    e.reinit(0.0, &[0.0, 0.0]).unwrap();
    e.set_params(&[f, f_s, v]).unwrap();
    e.advance(20.0).unwrap();
    let times: Vec<f64> = e.switches().iter().map(|s| s.t).collect();
    let expected = stick_slip(f, f_s, v, 5);
    let n = expected.iter().filter(|t| **t < 20.0).count();
    assert!(off(&times, &expected[..n]) < 1e-6, "{times:?} {expected:?}");
}

/// Carts on a line, with springs, buffers that close, and friction in wheels and between carts: events against steps.
#[test]
fn events_and_steps_agree_on_random_carts() {
    let mut seed = 7u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let (mut switched, mut struck) = (0, 0);
    for case in 0..120 {
        let n = 2 + case % 3;
        let g = Graph::new();
        let mut s = Scene::new("carts", n, n, 0, 0).unwrap();
        let masses: Vec<f64> = (0..n).map(|_| 0.5 + random()).collect();
        let entries: Vec<_> =
            (0..n * n).map(|k| g.constant(if k / n == k % n { masses[k % n] } else { 0.0 }).id()).collect();
        s.set_inertia(&entries).unwrap();
        for i in 0..n {
            let (k, at, w) = (0.5 + 3.0 * random(), i as f64 + 0.6 * (random() - 0.5), 1.0 + 2.0 * random());
            let drive = 1.5 * random() * (w * g.t()).sin();
            s.set_force(i, (-k * (g.x(i) - at) + drive).id()).unwrap();
            let bound = 0.1 + 0.5 * random();
            // joints that share a load at will stick by one bound here: with a larger one the share would matter
            s.add_friction(Friction::new(&format!("wheel {i}"), g.x(i), g.constant(bound))).unwrap();
        }
        for i in 1..n {
            let gap = g.x(i) - g.x(i - 1) - (0.6 + 0.3 * random());
            s.add_contact(Contact::new(&g, &format!("buffer {i}"), gap)).unwrap();
            if random() < 0.4 {
                let belt = g.constant(0.3 * random());
                s.add_friction(Friction::new(&format!("belt {i}"), g.x(i) - g.x(i - 1), belt)).unwrap();
            }
        }
        let system = s.build(&g).unwrap().system;
        let mut x0: Vec<f64> = (0..n).map(|i| 1.1 * i as f64).collect();
        x0.extend((0..n).map(|_| 2.0 * (random() - 0.5)));
        let t = 3.0;
        let e = run(&system, 1e-9, &x0, &[], t);
        switched += e.switches().len();
        struck += e.impacts().len();
        let steps = |h: f64| {
            let mut st =
                Stepper::new(&system, &stepping::Options { h, tolerance: 1e-10, ..Default::default() }).unwrap();
            st.reset(0.0, &x0).unwrap();
            st.advance(t).unwrap();
            off(st.state(), e.state())
        };
        let (coarse, fine) = (steps(2e-3), steps(1e-4));
        assert!(fine < 2e-2 && fine < 0.5 * coarse.max(1e-3), "{case}: {coarse} {fine}");
    }
    assert!(switched > 200 && struck > 20, "{switched} {struck}");
}

/// Bounds that depend on controls and time; a control that changes frees what stuck.
#[test]
fn a_brake_that_is_released() {
    let g = Graph::new();
    let mut s = Scene::new("brake", 1, 1, 1, 0).unwrap();
    s.set_force(0, g.constant(2.0).id()).unwrap();
    s.add_friction(Friction::new("brake", g.x(0), g.u(0) * (1.0 + g.t()))).unwrap();
    let system = s.build(&g).unwrap().system;
    let mut e = Engine::new(&system, &Options::with_tolerance(1e-10, 1e-10)).unwrap();
    e.reinit(0.0, &[0.0, 0.0]).unwrap();
    e.set_controls(&[3.0]).unwrap();
    e.advance(1.0).unwrap();
    assert!(off(e.state(), &[0.0, 0.0]) < 1e-14);
    e.set_controls(&[0.5]).unwrap();
    // v̇ = 2 − (1 + t)/2 from 1 on
    e.advance(2.0).unwrap();
    assert!(off(e.state(), &[0.5 - 0.5 / 6.0, 1.0 - 0.25]) < 1e-9, "{:?}", e.state());
}

/// Optimal control follows by simulations what its programs do not know; time-freezing refuses it in words.
#[test]
fn optimal_control_follows_what_time_freezing_refuses() {
    let g = Graph::new();
    let slides = Friction::new("hinge", g.x(0), g.constant(0.1));
    let system = slider(&g, 0, -g.x(0), slides.clone());
    let follows = |s: &switchback::system::System| assert!(Ocp::new(s, 1.0, 2, &Settings::default()).is_ok());
    follows(&system);
    let mut s = Scene::new("block", 2, 2, 0, 0).unwrap();
    (0..2).for_each(|i| s.set_force(i, g.constant(0.0).id()).unwrap());
    let floor = Contact { tangents: vec![g.x(0).id()], ..Contact::new(&g, "floor", g.x(1)) };
    let k = s.add_contact(floor).unwrap();
    s.set_stiction(k, g.constant(0.4).id()).unwrap();
    follows(&s.build(&g).unwrap().system);
    wrong(s.equations(&mut g.dag()), "time-freezing cannot follow floor");
    let mut s = Scene::new("rod", 2, 2, 0, 0).unwrap();
    (0..2).for_each(|i| s.set_force(i, g.constant(0.0).id()).unwrap());
    s.add_constraint(Constraint::new("rod", g.x(0))).unwrap();
    follows(&s.build(&g).unwrap().system);
    wrong(s.equations(&mut g.dag()), "time-freezing cannot follow rod");
}

fn wrong(r: Result<impl Sized>, words: &str) {
    let e = r.err().expect(words).to_string();
    assert!(e.contains(words), "{e} / {words}");
}

#[test]
fn nonsense_is_refused_in_words() {
    let g = Graph::new();
    let build = |f: Friction| {
        let mut s = Scene::new("slider", 1, 1, 0, 1).unwrap();
        s.set_force(0, g.constant(0.0).id()).unwrap();
        s.add_friction(f).unwrap();
        s.build(&g)
    };
    let (x, v) = (g.x(0), g.x(1));
    let c = |v: f64| g.constant(v);
    let friction = |bound: Expr| Friction::new("guide", x, bound);
    wrong(build(friction(c(-0.1))), "must not be negative");
    wrong(build(friction(c(f64::NAN))), "must not be negative");
    wrong(build(friction(c(f64::INFINITY))), "must not be negative");
    wrong(build(Friction { stiction: Some(c(0.1).id()), ..friction(c(0.2)) }), "what holds must not be less");
    wrong(build(friction(v.abs())), "switches where");
    wrong(build(Friction::new("guide", v * v, c(0.1))), "linear in the velocities");
    wrong(build(Friction::new("guide", g.p(0), c(0.1))), "does not depend on anything that moves");
    let mut s = Scene::new("slider", 1, 1, 0, 0).unwrap();
    s.add_friction(friction(c(0.1))).unwrap();
    wrong(s.add_friction(friction(c(0.1))), "give each a name of its own");
    wrong(s.set_stiction(0, c(0.1).id()), "no contact with tangents");
    wrong(s.set_stiction(3, c(0.1).id()), "does not exist");
    let mut projected = Scene::projected("play", 1, 0, 0).unwrap();
    assert!(matches!(projected.add_friction(friction(c(0.1))), Err(Error::Unsupported(_))));
    // at the start, and later
    let start = |f: Friction, p: f64| {
        let system = build(f).unwrap().system;
        let mut e = Engine::new(&system, &Options::with_tolerance(1e-8, 1e-8)).unwrap();
        e.reinit(0.0, &[0.0, 1.0]).unwrap();
        e.set_params(&[p]).unwrap();
        e.advance(1.0)?;
        if e.outcome() == Outcome::Reached {
            Ok(())
        } else {
            Err(Error::State(e.reason().to_owned()))
        }
    };
    wrong(start(friction(g.p(0)), -1.0), "must not be negative");
    wrong(start(Friction { stiction: Some(g.p(0).id()), ..friction(c(0.2)) }, 0.1), "what holds must not be less");
    wrong(start(friction(0.1 - g.t()), 0.0), "must not be negative");
    wrong(start(friction((g.p(0) - 2.0).sqrt()), 0.0), "not defined");
    let system = build(friction(g.p(0))).unwrap().system;
    let mut stepper = Stepper::new(&system, &stepping::Options::default()).unwrap();
    stepper.set_params(&[-1.0]).unwrap();
    wrong(stepper.reset(0.0, &[0.0, 1.0]), "must not be negative");
}
