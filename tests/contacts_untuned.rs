//! Scenes that the engine was not written with in mind, against event-driven solutions with the contact modes by hand.

#[path = "common/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use scenes::*;
use switchback::event::{Engine, Options, Outcome};
use switchback::expr::{Expr, Graph};
use switchback::scene::{Contact, Scene};
use switchback::system::System;

const G: f64 = GRAVITY;

/// A scene with an inertia matrix of expressions.
fn with_inertia(inertia: &[Vec<Expr>], force: &[Expr]) -> Scene {
    let n = force.len();
    let mut s = Scene::new("scene", n, n, 0, 0).unwrap();
    s.set_inertia(&inertia.iter().flatten().map(|e| e.id()).collect::<Vec<_>>()).unwrap();
    force.iter().enumerate().for_each(|(i, f)| s.set_force(i, f.id()).unwrap());
    s
}

fn built(s: &Scene, g: &Graph) -> System {
    s.build(g).unwrap().system
}

/// A ball above a floor at `a sin w t`.
fn moving_floor(mass: f64, air: f64, (a, w, e): (f64, f64, f64)) -> System {
    let g = Graph::new();
    let mut s = scene(&g, "ball", &[mass], &[-mass * G - air * g.x(1)], 0, 0);
    s.add_contact(contact(&g, "floor", g.x(0) - a * (w * g.t()).sin(), &[], 0.0, e)).unwrap();
    built(&s, &g)
}

fn curved_floor() -> System {
    let g = Graph::new();
    let (x, y, vx, vy, t) = (g.x(0), g.x(1), g.x(2), g.x(3), g.t());
    let force = [1.9 * (2.3 * t).cos() - 0.1 * vx, g.constant(-0.6 * G)];
    let mut s = scene(&g, "particle", &[1.7, 0.6], &force, 0, 0);
    let (h, slope) = (0.21 * (1.3 * x).sin() + 0.05 * x * x, 0.21 * 1.3 * (1.3 * x).cos() + 0.1 * x);
    let length = (1.0 + slope * slope).sqrt();
    s.add_contact(contact(&g, "floor", (y - h) / length, &[(vx + slope * vy) / length], 0.37, 0.35)).unwrap();
    built(&s, &g)
}

fn mixed_restitution() -> System {
    let g = Graph::new();
    let (a, b, va, vb) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let pull = 37.0 * (b - a - 1.0) + 0.2 * (vb - va);
    let mut s = scene(&g, "masses", &[1.1, 0.45], &[pull + 2.0 * (3.1 * g.t()).sin(), -pull], 0, 0);
    s.add_contact(contact(&g, "left", a + 0.2, &[], 0.0, 0.9)).unwrap();
    s.add_contact(contact(&g, "right", 1.3 - b, &[], 0.0, 0.15)).unwrap();
    s.add_contact(contact(&g, "between", b - a - 0.7, &[], 0.0, 0.5)).unwrap();
    built(&s, &g)
}

fn shaken_table() -> System {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let mut s = scene(&g, "block", &[3.1; 2], &[g.constant(0.8), g.constant(-3.1 * G)], 0, 0);
    let surface = 0.09 * (6.3 * g.t()).sin() + 0.02 * g.t();
    s.add_contact(contact(&g, "table", y, &[x - surface], 0.23, 0.0)).unwrap();
    built(&s, &g)
}

fn ladder() -> System {
    let g = Graph::new();
    let (x, y, th, zero) = (g.x(0), g.x(1), g.x(2), g.constant(0.0));
    let (m, l) = (4.2, 1.3);
    let mut s = scene(&g, "rod", &[m, m, m * l * l / 12.0], &[zero, g.constant(-m * G), zero], 0, 0);
    let (cx, cy) = (0.5 * l * th.cos(), 0.5 * l * th.sin());
    s.add_contact(contact(&g, "floor", y - cy, &[x + cx], 0.21, 0.0)).unwrap();
    s.add_contact(contact(&g, "wall", x - cx, &[y + cy], 0.33, 0.0)).unwrap();
    s.add_contact(contact(&g, "tip", y + cy, &[x - cx], 0.33, 0.0)).unwrap();
    built(&s, &g)
}

fn disc_on_disc() -> System {
    let g = Graph::new();
    let (x, y, vx, vy, spin, zero) = (g.x(0), g.x(1), g.x(3), g.x(4), g.x(5), g.constant(0.0));
    let (m, r) = (2.0, 0.35);
    let mut s = scene(&g, "disc", &[m, m, 0.6 * m * r * r], &[zero, g.constant(-m * G), zero], 0, 0);
    let d = (x * x + y * y).sqrt();
    s.add_contact(contact(&g, "cylinder", d - 1.4 - r, &[(y * vx - x * vy) / d - r * spin], 0.3, 0.0)).unwrap();
    built(&s, &g)
}

fn hopper() -> System {
    let g = Graph::new();
    let [x, y, a, b] = [0, 1, 2, 3].map(|i| g.x(i));
    let (wa, wb, t, zero) = (g.x(6), g.x(7), g.t(), g.constant(0.0));
    let (m0, m1, m2, l1, l2) = (3.0, 0.8, 0.3, 0.5, 0.45);
    let (m, below) = (m0 + m1 + m2, m1 + m2);
    let inertia = [
        vec![zero + m, zero, below * l1 * a.cos(), m2 * l2 * b.cos()],
        vec![zero, zero + m, below * l1 * a.sin(), m2 * l2 * b.sin()],
        vec![below * l1 * a.cos(), below * l1 * a.sin(), zero + (below * l1 * l1 + 0.05), m2 * l1 * l2 * (a - b).cos()],
        vec![m2 * l2 * b.cos(), m2 * l2 * b.sin(), m2 * l1 * l2 * (a - b).cos(), zero + (m2 * l2 * l2 + 0.01)],
    ];
    let hip = 6.0 * (4.0 * t).sin() - 9.0 * (a - 0.5) - 1.2 * wa;
    let knee = 5.0 * (4.0 * t + 1.0).sin() - 14.0 * (b - a + 1.1) - 0.9 * (wb - wa);
    let force = [
        below * l1 * a.sin() * wa * wa + m2 * l2 * b.sin() * wb * wb,
        -below * l1 * a.cos() * wa * wa - m2 * l2 * b.cos() * wb * wb - m * G,
        -m2 * l1 * l2 * (a - b).sin() * wb * wb - below * G * l1 * a.sin() + hip - knee,
        m2 * l1 * l2 * (a - b).sin() * wa * wa - m2 * G * l2 * b.sin() + knee,
    ];
    let mut s = with_inertia(&inertia, &force);
    let (kx, ky) = (x + l1 * a.sin(), y - l1 * a.cos());
    s.add_contact(contact(&g, "foot", ky - l2 * b.cos(), &[kx + l2 * b.sin()], 0.55, 0.0)).unwrap();
    s.add_contact(contact(&g, "knee", ky, &[kx], 0.3, 0.2)).unwrap();
    s.add_contact(contact(&g, "hip", y - 0.05, &[x], 0.3, 0.1)).unwrap();
    built(&s, &g)
}

fn belt() -> System {
    let g = Graph::new();
    let [a, b, ya, yb] = [0, 1, 2, 3].map(|i| g.x(i));
    let force = [25.0 * (b - a) - 60.0 * a, -25.0 * (b - a), g.constant(-1.3 * G), g.constant(-0.5 * G)];
    let mut s = scene(&g, "blocks", &[1.3, 0.5, 1.3, 0.5], &force, 0, 0);
    s.add_contact(contact(&g, "first", ya, &[a - 0.35 * g.t()], 0.45, 0.0)).unwrap();
    s.add_contact(contact(&g, "second", yb, &[b - 0.35 * g.t()], 0.28, 0.0)).unwrap();
    built(&s, &g)
}

fn pendulum_stop() -> System {
    let g = Graph::new();
    let (a, b, wa, wb) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let (m2, m, l1, l2, zero) = (0.7, 1.7, 0.9, 0.6, g.constant(0.0));
    let across = m2 * l1 * l2 * (a - b).cos();
    let inertia = [vec![zero + m * l1 * l1, across], vec![across, zero + m2 * l2 * l2]];
    let turn = m2 * l1 * l2 * (a - b).sin();
    let force = [-turn * wb * wb - m * G * l1 * a.sin(), turn * wa * wa - m2 * G * l2 * b.sin()];
    let mut s = with_inertia(&inertia, &force);
    let (x, height) = (l1 * a.sin() + l2 * b.sin(), l1 * a.cos() + l2 * b.cos());
    s.add_contact(contact(&g, "wall", 0.25 + x, &[height], 0.4, 0.6)).unwrap();
    built(&s, &g)
}

fn table_with_two_feet() -> System {
    let g = Graph::new();
    let (x, y, th, t) = (g.x(0), g.x(1), g.x(2), g.t());
    let force = [6.5 * (2.2 * t).sin(), g.constant(-2.0 * G), g.constant(0.0)];
    let mut s = scene(&g, "table", &[2.0, 2.0, 0.15], &force, 0, 0);
    for (name, side, mu) in [("left", -0.4, 0.5), ("right", 0.4, 0.2)] {
        let foot_x = x + side * th.cos() + 0.25 * th.sin();
        let foot_y = y + side * th.sin() - 0.25 * th.cos();
        s.add_contact(contact(&g, name, foot_y - 0.004 * (5.0 * t).sin(), &[foot_x], mu, 0.0)).unwrap();
    }
    built(&s, &g)
}

fn run(s: &System, rtol: f64, x0: &[f64], t: f64) -> Engine {
    let options = Options { sensitivity: true.into(), adjoint: true, ..Options::with_tolerance(rtol, rtol) };
    let mut e = Engine::new(s, &options).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.advance(t).unwrap();
    e
}

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

fn all() -> [(&'static str, System); 11] {
    [
        ("moving_floor", moving_floor(2.3, 0.4, (0.06, 11.0, 0.63))),
        ("chatter_again", moving_floor(0.7, 0.0, (0.035, 18.0, 0.28))),
        ("curved_floor", curved_floor()),
        ("mixed_restitution", mixed_restitution()),
        ("shaken_table", shaken_table()),
        ("ladder", ladder()),
        ("disc_on_disc", disc_on_disc()),
        ("hopper", hopper()),
        ("belt", belt()),
        ("pendulum_stop", pendulum_stop()),
        ("bar_of_two_feet", table_with_two_feet()),
    ]
}

#[test]
fn states_and_adjoints_over_tolerances() {
    let (reference, mut bad) = (reference("untuned.json"), Vec::new());
    for (name, system) in all() {
        let r = &reference[name];
        let (x0, x, t) = (numbers(&r["x0"]), numbers(&r["x"]), number(&r["t"]));
        for rtol in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
            let mut e = run(&system, rtol, &x0, t);
            // the reference is good to 1e-10
            let error = off(e.state(), &x);
            if e.outcome() != Outcome::Reached || error > 100.0 * f64::max(rtol, 1e-12) {
                bad.push(format!("{name} {rtol}: {error} {:?} {}", e.outcome(), e.reason()));
                continue;
            }
            let (s, n) = (e.sensitivity().unwrap().to_vec(), x0.len());
            let v: Vec<f64> = (0..n).map(|i| 1.0 - 0.4 * i as f64).collect();
            let forward: Vec<f64> = (0..n).map(|c| (0..n).map(|i| v[i] * s[i * n + c]).sum()).collect();
            let adjoint = e.adjoint(&v, &[]).unwrap().x0;
            if off(&adjoint, &forward) > 1e-9 {
                bad.push(format!("{name} {rtol}: adjoint {adjoint:?} forward {forward:?}"));
            }
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}

/// Forward derivatives are those of differences of fourth order, where nothing is at a kink.
#[test]
fn derivatives_are_those_of_differences() {
    let reference = reference("untuned.json");
    let smooth = ["curved_floor", "mixed_restitution", "shaken_table", "pendulum_stop"];
    for (name, system) in all().into_iter().filter(|(name, _)| smooth.contains(name)) {
        let r = &reference[name];
        let (x0, t) = (numbers(&r["x0"]), number(&r["t"]));
        let (e, n) = (run(&system, 1e-13, &x0, t), x0.len());
        let s = e.sensitivity().unwrap();
        for c in 0..n {
            let best = [1e-4, 3e-5].into_iter().fold(f64::INFINITY, |best, h| {
                let at = |k: f64| {
                    let mut moved = x0.clone();
                    moved[c] += k * h;
                    run(&system, 1e-13, &moved, t).state().to_vec()
                };
                let (a2, a, b, b2) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
                let d: Vec<f64> = (0..n).map(|i| (8.0 * (b[i] - a[i]) - (b2[i] - a2[i])) / (12.0 * h)).collect();
                let own: Vec<f64> = (0..n).map(|i| s[i * n + c]).collect();
                f64::min(best, off(&own, &d))
            });
            assert!(best < 1e-9, "{name}, column {c}: {best}");
        }
    }
}

/// Two feet share a push at will: one is at its limit, the other holds the table. No event comes of sliding velocities that
/// are zero, and what is reported says that forces are not unique.
#[test]
fn a_table_slides_only_where_both_feet_do() {
    let r = &reference("untuned.json")["bar_of_two_feet"];
    let (system, x0) = (table_with_two_feet(), numbers(&r["x0"]));
    for rtol in [1e-4, 1e-7, 1e-10, 1e-12] {
        let e = run(&system, rtol, &x0, 3.0);
        assert_eq!(e.outcome(), Outcome::Reached, "{rtol}: {}", e.reason());
        assert!(e.switches().len() < 30, "{rtol}: {} switches", e.switches().len());
        assert!(e.phases().iter().any(|p| p.redundant));
        // it stands still until the push is as large as both can hold
        let e = run(&system, rtol, &x0, 0.59);
        assert!(e.state()[3].abs() < 1e-12, "{rtol}: {:?}", e.state());
    }
}

/// A gap that is never negative is refused where it is built; one that cannot be zero costs nothing.
#[test]
fn gaps_that_are_never_negative_are_refused() {
    type Gap = for<'a> fn(Expr<'a>, Expr<'a>) -> Expr<'a>;
    let bad: [(&str, Gap); 6] = [
        ("square", |_, y| y * y),
        ("fourth", |_, y| (y - 0.3).powi(4)),
        ("sum", |x, y| x.powi(2) + 3.0 * y.powi(2)),
        ("cosine", |_, y| 1.0 - y.cos()),
        ("size", |x, y| (x * x + y * y).sqrt()),
        ("product", |x, y| y.powi(2) * (2.0 + x.sin())),
    ];
    let with = |gap: Gap| {
        let g = Graph::new();
        let mut s = scene(&g, "falls", &[1.0; 2], &[g.constant(0.0), g.constant(-G)], 0, 0);
        s.add_contact(contact(&g, "floor", gap(g.x(0), g.x(1)), &[], 0.0, 0.5)).unwrap();
        s.build(&g)
    };
    for (name, gap) in bad {
        let error = with(gap).err().map_or_else(String::new, |e| e.to_string());
        assert!(error.contains("contact floor") && error.contains("never negative"), "{name}: {error}");
    }
    let built = with(|_, y| y * y + 0.5).unwrap();
    assert!(built.report.dropped.len() == 1 && built.report.dropped[0].proof.contains("everywhere"));
    // one that cannot be proved, where the body is stopped at: it is named when it is reached
    let g = Graph::new();
    let y = g.x(0);
    let mut s = scene(&g, "falls", &[1.0], &[g.constant(-G)], 0, 0);
    s.add_contact(Contact::new(&g, "hidden", y * y - 0.2 * y + 0.01)).unwrap();
    let system = s.build(&g).unwrap().system;
    for rtol in [1e-4, 1e-6, 1e-8, 1e-10] {
        let mut e = Engine::new(&system, &Options::with_tolerance(rtol, rtol)).unwrap();
        e.reinit(0.0, &[1.0, 0.0]).unwrap();
        let error = e.advance(1.0).map_or_else(|e| e.to_string(), |_| String::new());
        assert!(error.contains("contact hidden vanishes"), "{rtol}: {error}");
    }
}
