//! Constraints in scenes, against closed forms and minimal coordinates.

use switchback::error::{Error, Result};
use switchback::event::{Engine, Method, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::scene::{Constraint, Contact, Friction, Scene};
use switchback::stepping::{self, Stepper};
use switchback::system::System;

const PI: f64 = std::f64::consts::PI;
const GRAVITY: f64 = 9.81;

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

fn run(s: &System, rtol: f64, x0: &[f64], p: &[f64], t: f64) -> Engine {
    let mut o = Options::with_tolerance(rtol, rtol);
    (o.sensitivity, o.adjoint, o.dense) = (true.into(), true, true);
    let mut e = Engine::new(s, &o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e.advance(t).unwrap();
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

fn steps(s: &System, h: f64, x0: &[f64], p: &[f64], t: f64) -> Vec<f64> {
    let mut st = Stepper::new(s, &stepping::Options { h, tolerance: 1e-12, ..Default::default() }).unwrap();
    st.set_params(p).unwrap();
    st.reset(0.0, x0).unwrap();
    st.advance(t).unwrap();
    st.state().to_vec()
}

/// The derivative of the final state along a curve of starts and parameters: forward, adjoint, differences.
fn check_derivatives(s: &System, at: &dyn Fn(f64) -> (Vec<f64>, Vec<f64>), t: f64) {
    let d = 1e-5;
    let (x0, p) = at(0.0);
    let (nx, n_c) = (x0.len(), x0.len() + p.len());
    let join = |(x, p): (Vec<f64>, Vec<f64>)| x.into_iter().chain(p).collect::<Vec<f64>>();
    // a difference of fourth order: the curve is exact to rounding
    let slope = |f: &dyn Fn(f64) -> Vec<f64>| -> Vec<f64> {
        let [a, b, c, e] = [-2.0, -1.0, 1.0, 2.0].map(|k| f(k * d));
        (0..a.len()).map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - e[i]) / (12.0 * d)).collect()
    };
    let dz = slope(&|s| join(at(s)));
    let dx = slope(&|by| {
        let (x, p) = at(by);
        run(s, 1e-12, &x, &p, t).state().to_vec()
    });
    let mut e = run(s, 1e-12, &x0, &p, t);
    let forward = e.sensitivity().unwrap().to_vec();
    for i in 0..nx {
        let along: f64 = (0..n_c).map(|c| forward[i * n_c + c] * dz[c]).sum();
        assert!((along - dx[i]).abs() < 1e-5 * (1.0 + dx[i].abs()), "state {i}: {along} {}", dx[i]);
        let v: Vec<f64> = (0..nx).map(|k| f64::from(u8::from(k == i))).collect();
        let g = e.adjoint(&v, &[]).unwrap();
        let adjoint: Vec<f64> = g.x0.iter().chain(&g.p).copied().collect();
        assert!(off(&adjoint, &forward[i * n_c..(i + 1) * n_c]) < 1e-8, "{adjoint:?} {forward:?}");
    }
}

/// A point mass on a rod of length `p1` under the gravity `p0`.
fn pendulum(g: &Graph, rods: usize) -> System {
    let (x, y) = (g.x(0), g.x(1));
    let mut s = Scene::new("pendulum", 2, 2, 0, 2).unwrap();
    s.set_force(0, g.constant(0.0).id()).unwrap();
    s.set_force(1, (-g.p(0)).id()).unwrap();
    let square = x * x + y * y;
    s.add_constraint(Constraint::new("rod", square.sqrt() - g.p(1))).unwrap();
    if rods > 1 {
        s.add_constraint(Constraint::new("again", square - g.p(1) * g.p(1))).unwrap();
    }
    s.build(g).unwrap().system
}

fn at_angle(a: f64, l: f64) -> Vec<f64> {
    vec![l * a.sin(), -l * a.cos(), 0.0, 0.0]
}

/// A quarter of the period of a pendulum of length one: `K(sin a/2)/√g` by the arithmetic-geometric mean.
fn quarter(a: f64, gravity: f64) -> f64 {
    let (mut x, mut y) = (1.0, (a / 2.0).cos());
    for _ in 0..10 {
        (x, y) = ((x + y) / 2.0, f64::sqrt(x * y));
    }
    PI / (2.0 * x) / gravity.sqrt()
}

#[test]
fn a_point_on_a_rod_is_a_pendulum() {
    let g = Graph::new();
    let (a, p) = (2.0, [GRAVITY, 1.0]);
    let t = quarter(a, GRAVITY);
    let speed = (2.0 * GRAVITY * (1.0 - a.cos())).sqrt();
    for rods in [1, 2] {
        let system = pendulum(&g, rods);
        for rtol in [1e-5, 1e-8, 1e-11] {
            let mut e = run(&system, rtol, &at_angle(a, 1.0), &p, t);
            assert!(off(e.state(), &[0.0, -1.0, -speed, 0.0]) < 300.0 * rtol, "{rtol}: {:?}", e.state());
            // the rod pulls with m (g + v²), of which the square has its share
            let made = e.take_run();
            let forces = made.contact_forces(t).unwrap();
            let pull = forces[0][0] - if rods > 1 { 2.0 * -forces[1][0] } else { 0.0 };
            assert!((pull + GRAVITY + speed * speed).abs() < 1e4 * rtol, "{forces:?}");
        }
        // no drift in a hundred periods, and the energy of the method alone
        let e = run(&system, 1e-9, &at_angle(a, 1.0), &p, 400.0 * t);
        let x = e.state();
        assert!((x[0].hypot(x[1]) - 1.0).abs() < 1e-14 && (x[0] * x[2] + x[1] * x[3]).abs() < 1e-13, "{x:?}");
        assert!(off(x, &at_angle(a, 1.0)) < 1e-4, "{x:?}");
    }
    let system = pendulum(&g, 1);
    check_derivatives(&system, &|s| (at_angle(a + s, 1.0), p.to_vec()), 2.0);
    check_derivatives(&system, &|s| (at_angle(a, 1.0), vec![GRAVITY + s, 1.0]), 2.0);
    check_derivatives(&system, &|s| (at_angle(a, 1.0 + s), vec![GRAVITY, 1.0 + s]), 2.0);
    // steps of equal length
    let exact = [0.0, -1.0, -speed, 0.0];
    let (coarse, fine) = (off(&steps(&system, 1e-3, &at_angle(a, 1.0), &p, t), &exact), {
        let x = steps(&system, 1e-4, &at_angle(a, 1.0), &p, t);
        assert!((x[0].hypot(x[1]) - 1.0).abs() < 1e-6, "{x:?}");
        off(&x, &exact)
    });
    assert!(fine < 4e-3 && fine < 0.3 * coarse, "{coarse} {fine}");
}

/// Implicit methods differentiate the same equations.
#[test]
fn a_pendulum_by_an_implicit_method() {
    let g = Graph::new();
    let (a, p) = (2.0, [GRAVITY, 1.0]);
    let t = quarter(a, GRAVITY);
    let speed = (2.0 * GRAVITY * (1.0 - a.cos())).sqrt();
    let mut o = Options::with_tolerance(1e-10, 1e-10);
    o.method = Method::Radau5;
    let mut e = Engine::new(&pendulum(&g, 1), &o).unwrap();
    e.reinit(0.0, &at_angle(a, 1.0)).unwrap();
    e.set_params(&p).unwrap();
    e.advance(t).unwrap();
    assert!(off(e.state(), &[0.0, -1.0, -speed, 0.0]) < 1e-7, "{:?}", e.state());
}

/// A skate on a slope turns with `ω` and goes nowhere down: `x = g/(2ω²) sin² ωt`, `y = g/(2ω²) (ωt − ½ sin 2ωt)`.
#[test]
fn a_skate_on_a_slope_does_not_come_down() {
    let g = Graph::new();
    let (w, pull) = (1.3f64, 2.0);
    let mut s = Scene::new("skate", 3, 3, 0, 1).unwrap();
    for (i, f) in [g.p(0), g.constant(0.0), g.constant(0.0)].into_iter().enumerate() {
        s.set_force(i, f.id()).unwrap();
    }
    let phi = g.x(2);
    s.add_constraint(Constraint::new("edge", phi.sin() * g.x(3) - phi.cos() * g.x(4))).unwrap();
    let system = s.build(&g).unwrap().system;
    let (t, c) = (9.0, pull / (2.0 * w * w));
    let exact = [c * (w * t).sin().powi(2), c * (w * t - 0.5 * (2.0 * w * t).sin()), w * t];
    let start = [0.0, 0.0, 0.0, 0.0, 0.0, w];
    for rtol in [1e-6, 1e-9, 1e-11] {
        let e = run(&system, rtol, &start, &[pull], t);
        assert!(off(&e.state()[..3], &exact) < 1e3 * rtol, "{rtol} {:?} {exact:?}", e.state());
    }
    check_derivatives(&system, &|s| (vec![0.1, s, 0.2 + s, 0.0, 0.0, w - s], vec![pull + s]), 3.0);
    assert!(off(&steps(&system, 1e-3, &start, &[pull], t)[..3], &exact) < 1e-2);
}

/// Two masses on a rod fall on a floor, one first: with the rod at the angle `a`, `Λ (1 − sin² a/2) = m v` and `T = sin a Λ/2`.
#[test]
fn constraints_have_impulses_where_contacts_close() {
    let g = Graph::new();
    let (a, v, m) = (0.7f64, 3.0, 1.5);
    for law in [switchback::system::ImpactLaw::Newton, switchback::system::ImpactLaw::Sequential] {
        let mut s = Scene::new("dumbbell", 4, 4, 0, 0).unwrap();
        s.set_law(law);
        let entries: Vec<_> = (0..16).map(|k| g.constant(if k / 4 == k % 4 { m } else { 0.0 }).id()).collect();
        s.set_inertia(&entries).unwrap();
        (0..4).for_each(|i| s.set_force(i, g.constant(0.0).id()).unwrap());
        let (dx, dy) = (g.x(2) - g.x(0), g.x(3) - g.x(1));
        s.add_constraint(Constraint::new("rod", (dx * dx + dy * dy).sqrt() - 1.0)).unwrap();
        s.add_contact(Contact::new(&g, "floor", g.x(1))).unwrap();
        let system = s.build(&g).unwrap().system;
        let (c, sn) = (a.cos(), a.sin());
        let start = [0.0, 0.3, c, 0.3 + sn, 0.0, -v, 0.0, -v];
        let mut e = run(&system, 1e-10, &start, &[], 0.1 + 1e-9);
        let push = m * v / (1.0 - sn * sn / 2.0);
        // the rod pushes the second mass by T along itself, and the first back
        let rod = sn * push / 2.0;
        let expected = [-rod * c / m, 0.0, rod * c / m, rod * sn / m - v];
        assert!(off(&e.state()[4..], &expected) < 1e-7, "{:?} {expected:?}", e.state());
        let impulses: Vec<f64> = e.impacts().iter().map(|i| i.impulse[0]).collect();
        assert!(impulses.iter().any(|i| (i - push).abs() < 1e-8), "{impulses:?}");
        assert!(impulses.iter().any(|i| (i - rod).abs() < 1e-8), "{impulses:?}");
        let made = e.take_run();
        assert!(made.impacts.len() == 2 && made.contact_modes(0.05).unwrap() == [1, 0]);
        // one contact has closed: both sides have the same derivatives
        assert!(!made.one_sided && made.impacts.iter().all(|i| !i.simultaneous && i.unique), "{:?}", made.impacts);
    }
}

/// A crank that turns at a given rate drives a slider: `x = cos ωt + √(l² − sin² ωt)`, by a constraint that depends on time.
#[test]
fn a_crank_drives_a_slider_and_a_joint_rubs() {
    let g = Graph::new();
    let (w, l, f) = (2.0f64, 1.5f64, 0.4);
    let mut s = Scene::new("crank", 2, 2, 0, 1).unwrap();
    (0..2).for_each(|i| s.set_force(i, g.constant(0.0).id()).unwrap());
    let (angle, x) = (g.x(0), g.x(1));
    let rod = (x - angle.cos()) * (x - angle.cos()) + angle.sin() * angle.sin();
    s.add_constraint(Constraint::new("drive", angle - w * g.t())).unwrap();
    s.add_constraint(Constraint::new("rod", rod.sqrt() - l)).unwrap();
    s.add_friction(Friction::new("guide", x, g.p(0))).unwrap();
    let system = s.build(&g).unwrap().system;
    let at = |t: f64| {
        let (s, c) = (w * t).sin_cos();
        let r = (l * l - s * s).sqrt();
        [w * t, c + r, w, -w * s - w * s * c / r]
    };
    for t in [0.3, 1.7, 4.0] {
        let e = run(&system, 1e-10, &at(0.0), &[f], t);
        assert!(off(e.state(), &at(t)) < 1e-8, "{t}: {:?} {:?}", e.state(), at(t));
    }
    let mut e = run(&system, 1e-10, &at(0.0), &[f], 1.0);
    let made = e.take_run();
    assert!((made.contact_forces(0.5).unwrap()[2][1] - f).abs() < 1e-12);
}

/// A ball falls on a bead that a wire guides and friction holds: a constraint, a joint and a contact at once.
#[test]
fn a_constraint_a_joint_and_a_contact_meet() {
    let g = Graph::new();
    // the wire goes along the unit vector (c, s), the ball falls along y
    let (c, sn) = (0.8, 0.6);
    let mut s = Scene::new("wire", 3, 3, 0, 0).unwrap();
    let gravity = 10.0;
    for (i, f) in [0.0, -gravity, -gravity].into_iter().enumerate() {
        s.set_force(i, g.constant(f).id()).unwrap();
    }
    let (x, y, ball) = (g.x(0), g.x(1), g.x(2));
    s.add_constraint(Constraint::new("wire", sn * x - c * y)).unwrap();
    s.add_friction(Friction::new("bead", c * x + sn * y, g.constant(7.0))).unwrap();
    s.add_contact(Contact::new(&g, "hit", ball - y)).unwrap();
    let system = s.build(&g).unwrap().system;
    // held before: 10 · 0.6 = 6 < 7. The ball comes with 4, and gives Λ: bead along the wire −0.6 Λ, ball −4 + Λ = −0.36 Λ
    let push = 4.0 / 1.36;
    let v = -sn * push;
    // behind it the ball stays on the bead: (1 + s²) ü = −2 s g + 7
    let a = (-2.0 * sn * gravity + 7.0) / (1.0 + sn * sn);
    let t = 0.2;
    let (u, du) = (v * t + 0.5 * a * t * t, v + a * t);
    let e = run(&system, 1e-10, &[0.0, 0.0, 0.8, 0.0, 0.0, 0.0], &[], 0.4 + t);
    let expected = [c * u, sn * u, sn * u, c * du, sn * du, sn * du];
    assert!(off(e.state(), &expected) < 1e-8, "{:?} {expected:?}", e.state());
    assert!((e.impacts().iter().find(|i| i.contact == 2).unwrap().impulse[0] - push).abs() < 1e-8);
}

fn wrong(r: Result<impl Sized>, words: &str) {
    let e = r.err().expect(words).to_string();
    assert!(e.contains(words), "{e} / {words}");
}

#[test]
fn what_is_wrong_is_said() {
    let g = Graph::new();
    let made = |zero: &[Expr]| {
        let mut s = Scene::new("point", 2, 2, 0, 1)?;
        (0..2).for_each(|i| s.set_force(i, g.constant(0.0).id()).unwrap());
        for (k, z) in zero.iter().enumerate() {
            s.add_constraint(Constraint::new(&format!("c{k}"), *z))?;
        }
        s.build(&g)
    };
    let (x, y, v) = (g.x(0), g.x(1), g.x(2));
    wrong(made(&[v * v]), "must be linear");
    wrong(made(&[g.t() - 1.0]), "does not depend on anything that moves");
    wrong(made(&[x.abs()]), "switches where");
    let go = |zero: &[Expr], x0: [f64; 4]| {
        let system = made(zero).unwrap().system;
        let mut e = Engine::new(&system, &Options::with_tolerance(1e-8, 1e-8)).unwrap();
        e.reinit(0.0, &x0).unwrap();
        e.advance(1.0)?;
        if e.outcome() == Outcome::Reached {
            Ok(e.state().to_vec())
        } else {
            Err(Error::State(e.reason().to_owned()))
        }
    };
    wrong(go(&[x - 1.0], [0.5, 0.0, 0.0, 0.0]), "not satisfied at the start");
    wrong(go(&[x - 1.0], [1.0, 0.0, 0.1, 0.0]), "not satisfied at the start");
    wrong(go(&[v], [1.0, 0.0, 0.1, 0.0]), "not satisfied at the start");
    // two that contradict each other from the start on, and a gradient that vanishes
    wrong(go(&[x - 1.0, x - g.t() * g.t() - 1.0], [1.0, 0.0, 0.0, 0.0]), "constraints contradict");
    wrong(go(&[x * x], [0.0, 0.0, 0.0, 0.0]), "gradient");
    assert!(go(&[x - 1.0, y], [1.0, 0.0, 0.0, 0.0]).is_ok());
    let system = made(&[x - 1.0]).unwrap().system;
    let mut stepper = Stepper::new(&system, &stepping::Options::default()).unwrap();
    wrong(stepper.reset(0.0, &[0.5, 0.0, 0.0, 0.0]), "not satisfied at the start");
    wrong(stepper.reset(0.0, &[1.0, 0.0, 0.5, 0.0]), "not satisfied at the start");
}
