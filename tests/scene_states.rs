//! Scenes with states beside coordinates and velocities, against closed forms.

use switchback::error::Result;
use switchback::event::{Engine, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::ocp::Ocp;
use switchback::scene::{Constraint, Contact, Friction, Scene};
use switchback::settings::Settings;
use switchback::stepping::{self, Stepper};
use switchback::system::System;

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
    let mut st = Stepper::new(s, &stepping::Options { h, ..Default::default() }).unwrap();
    st.set_params(p).unwrap();
    st.reset(0.0, x0).unwrap();
    st.advance(t).unwrap();
    st.state().to_vec()
}

/// Forward, adjoint and differences of the final state agree.
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
            let (difference, own) = ((a[i] - b[i]) / (2.0 * d), forward[i * n_c + c]);
            assert!((difference - own).abs() < 1e-6 * (1.0 + own.abs()), "state {i}, column {c}: {own} {difference}");
        }
    }
}

/// `exp(A t) x + ∫ exp(A s) b` by the series of the augmented matrix, in short steps.
fn linear(a: [[f64; 3]; 3], b: [f64; 3], x: [f64; 3], t: f64) -> [f64; 3] {
    let n = 64;
    let h = t / f64::from(n);
    let mut x = x;
    for _ in 0..n {
        let mut term: [f64; 3] = [0, 1, 2].map(|i| b[i] + (0..3).map(|j| a[i][j] * x[j]).sum::<f64>());
        let mut k = 1.0;
        for _ in 0..20 {
            (0..3).for_each(|i| x[i] += h / k * term[i]);
            term = [0, 1, 2].map(|i| h / k * (0..3).map(|j| a[i][j] * term[j]).sum::<f64>());
            k += 1.0;
        }
    }
    x
}

/// A motor: `L i̇ = U − R i − k ω`, `J ω̇ = k i` against the dry friction of its bearing, which holds it until the current is there.
#[test]
fn a_motor_breaks_away_when_its_current_suffices() {
    let (u, r, l, k, j, f) = (2.0, 0.5, 0.2, 0.7, 0.3, 1.1);
    let g = Graph::new();
    let mut s = Scene::with_states("motor", 1, 1, 1, 0, 2).unwrap();
    s.set_inertia(&[g.constant(j).id()]).unwrap();
    let (omega, current) = (g.x(1), g.x(2));
    s.set_force(0, (k * current).id()).unwrap();
    s.set_state_rate(0, ((g.p(0) - r * current - k * omega) / l).id()).unwrap();
    s.add_friction(Friction::new("bearing", g.x(0), g.p(1))).unwrap();
    let system = s.build(&g).unwrap().system;
    let away = -l / r * f64::ln(1.0 - f * r / (k * u));
    let t = 1.5;
    let a = [[0.0, 1.0, 0.0], [0.0, 0.0, k / j], [0.0, -k / l, -r / l]];
    let exact = linear(a, [0.0, -f / j, u / l], [0.0, 0.0, f / k], t - away);
    for rtol in [1e-5, 1e-8, 1e-11] {
        let e = run(&system, rtol, &[0.0; 3], &[u, f], t);
        assert!((e.switches()[0].t - away).abs() < 100.0 * rtol, "{} {away}", e.switches()[0].t);
        assert!(off(e.state(), &exact) < 100.0 * rtol, "{:?} {exact:?}", e.state());
    }
    check_derivatives(&system, &[0.0, 0.0, 0.1], &[u, f], t, &[0, 2, 3, 4]);
    let errors = [1e-2, 1e-3].map(|h| off(&steps(&system, h, &[0.0; 3], &[u, f], t), &exact));
    assert!(errors[1] < 5e-3 && errors[1] < 0.3 * errors[0], "{errors:?}");
}

/// A brake that its own heat weakens: `v̇ = −F (1 − a z)`, `ż = F (1 − a z) v`, so `z = (v₀² − v²)/2` and `v` is a tangent of the time.
#[test]
fn a_brake_that_its_heat_weakens() {
    let (f, a, v0) = (2.0, 0.3, 2.0f64);
    let g = Graph::new();
    let mut s = Scene::with_states("brake", 1, 1, 1, 0, 2).unwrap();
    s.set_force(0, g.constant(0.0).id()).unwrap();
    let bound = g.p(0) * (1.0 - g.p(1) * g.x(2));
    s.set_state_rate(0, (bound * g.x(1)).id()).unwrap();
    s.add_friction(Friction::new("disc", g.x(0), bound)).unwrap();
    let system = s.build(&g).unwrap().system;
    let b = 1.0 - a * v0 * v0 / 2.0;
    let stop = (v0 * f64::sqrt(a / (2.0 * b))).atan() / (f * f64::sqrt(a * b / 2.0));
    let e = run(&system, 1e-11, &[0.0, v0, 0.0], &[f, a], stop + 1.0);
    assert!((e.switches()[0].t - stop).abs() < 1e-9, "{} {stop}", e.switches()[0].t);
    assert!(off(&e.state()[1..], &[0.0, v0 * v0 / 2.0]) < 1e-9, "{:?}", e.state());
    check_derivatives(&system, &[0.0, v0, 0.1], &[f, a], 0.5, &[0, 1, 2, 3, 4]);
    check_derivatives(&system, &[0.0, v0, 0.1], &[f, a], 4.0, &[0, 1, 2, 3, 4]);
}

/// A state goes through impacts as it is: the integral of the height of a ball.
#[test]
fn states_go_through_impacts() {
    let g = Graph::new();
    let mut s = Scene::with_states("ball", 1, 1, 2, 0, 1).unwrap();
    s.set_force(0, (-10.0 - 0.1 * g.x(3)).id()).unwrap();
    s.set_state_rate(0, g.x(0).id()).unwrap();
    s.set_state_rate(1, g.constant(0.0).id()).unwrap();
    s.add_contact(Contact { restitution: g.p(0).id(), ..Contact::new(&g, "floor", g.x(0)) }).unwrap();
    let system = s.build(&g).unwrap().system;
    // falls 0.8 in 0.4 s, and comes back with 2 m/s
    let e = run(&system, 1e-10, &[0.8, 0.0, 0.0, 0.0], &[0.5], 0.5);
    let expected = [0.15, 1.0, 0.32 - 10.0 * 0.064 / 6.0 + 0.01 - 10.0 * 0.001 / 6.0, 0.0];
    assert!(off(e.state(), &expected) < 1e-9, "{:?} {expected:?}", e.state());
    check_derivatives(&system, &[0.8, 0.0, 0.0, 1.0], &[0.5], 0.5, &[0, 1, 2, 3, 4]);
    check_derivatives(&system, &[0.8, 0.0, 0.0, 1.0], &[0.5], 0.75, &[0, 1, 2, 3, 4]);
}

/// With so many states that contacts are functions of a few of them: sliders whose bounds fade with `z = e^{−t}`, one on a rail.
#[test]
fn many_sliders_whose_friction_fades() {
    let n = 9;
    let g = Graph::new();
    let mut s = Scene::with_states("sliders", n, n, 2, 0, 0).unwrap();
    let z = g.x(2 * n + 1);
    for i in 0..n {
        s.set_force(i, g.constant(0.0).id()).unwrap();
        let bound = (0.1 + 0.05 * i as f64) * z;
        s.add_friction(Friction::new(&format!("guide {i}"), g.x(i), bound)).unwrap();
    }
    s.set_state_rate(0, (-z).id()).unwrap();
    s.set_state_rate(1, (-z).id()).unwrap();
    s.add_constraint(Constraint::new("rail", g.x(0) - g.x(1))).unwrap();
    let system = s.build(&g).unwrap().system;
    let mut x0 = vec![0.0; 2 * n + 2];
    x0[n..2 * n].fill(1.0);
    (x0[2 * n], x0[2 * n + 1]) = (1.0, 1.0);
    let t = 1.2f64;
    let fade = 1.0 - (-t).exp();
    let bound = |i: usize| if i < 2 { 0.125 } else { 0.1 + 0.05 * i as f64 };
    let mut expected: Vec<f64> = (0..n).map(|i| t - bound(i) * (t - fade)).collect();
    expected.extend((0..n).map(|i| 1.0 - bound(i) * fade));
    expected.extend([1.0 - fade; 2]);
    let e = run(&system, 1e-10, &x0, &[], t);
    assert!(off(e.state(), &expected) < 1e-8, "{:?} {expected:?}", e.state());
    assert!(off(&steps(&system, 1e-3, &x0, &[], t), &expected) < 1e-3);
}

fn wrong(r: Result<impl Sized>, words: &str) {
    let e = r.err().expect(words).to_string();
    assert!(e.contains(words), "{e} / {words}");
}

#[test]
fn what_may_not_depend_on_states_is_said() {
    let g = Graph::new();
    let (x, z) = (g.x(0), g.x(2));
    let fresh = || {
        let mut s = Scene::with_states("scene", 1, 1, 1, 0, 0).unwrap();
        s.set_force(0, z.id()).unwrap();
        s.set_state_rate(0, (-z).id()).unwrap();
        s
    };
    let with = |change: &dyn Fn(&mut Scene)| {
        let mut s = fresh();
        change(&mut s);
        s.build(&g)
    };
    let words = "depends on states beside";
    wrong(with(&|s| _ = s.add_constraint(Constraint::new("rail", x - z))), words);
    wrong(with(&|s| _ = s.add_friction(Friction::new("guide", x + z, g.constant(0.1)))), words);
    wrong(with(&|s| s.set_rates(&[(g.x(1) + z).id()]).unwrap()), words);
    wrong(with(&|s| _ = s.add_contact(Contact::new(&g, "floor", x - z))), "depends on velocities");
    wrong(with(&|s| s.set_inertia(&[(1.0 + z).id()]).unwrap()), "depends on velocities");
    let tangent =
        |t: Expr| Contact { tangents: vec![t.id()], friction: g.constant(0.1).id(), ..Contact::new(&g, "f", x) };
    wrong(with(&|s| _ = s.add_contact(tangent(2.0 * x + z))), words);
    let mut s = Scene::with_states("scene", 1, 1, 1, 0, 0).unwrap();
    s.set_force(0, z.id()).unwrap();
    wrong(s.build(&g), "no rate of");
    wrong(s.set_state_rate(1, z.id()), "does not exist");
    let system = fresh().build(&g).unwrap().system;
    assert!(Ocp::new(&system, 1.0, 2, &Settings::default()).is_ok());
    wrong(fresh().equations(&mut g.dag()), "states that a scene has beside");
}
