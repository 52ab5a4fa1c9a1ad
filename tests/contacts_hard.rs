//! Hard cases of contacts: many impacts, rest for ever, large ratios, several at once, no or many solutions, other units.

#[path = "common/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use scenes::*;
use switchback::event::{Engine, ImpactKind, Options, Outcome, Zeno};
use switchback::expr::{Expr, Graph};
use switchback::scene::{Contact, Scene};
use switchback::system::{ImpactLaw, System};

fn start(s: &System, o: &Options, x0: &[f64]) -> Engine {
    let mut e = Engine::new(s, o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e
}

fn ball(e: f64) -> System {
    let g = Graph::new();
    let mut s = scene(&g, "ball", &[1.0], &[g.constant(-GRAVITY)], 0, 0);
    s.add_contact(contact(&g, "floor", g.x(0), &[], 0.0, e)).unwrap();
    s.build(&g).unwrap().system
}

#[test]
fn energy_stays_over_ten_thousand_elastic_impacts() {
    let mut e = start(&ball(1.0), &Options::with_tolerance(1e-10, 1e-10), &[1.0, 0.0]);
    let period = 2.0 * (2.0 / GRAVITY).sqrt();
    assert_eq!(e.advance(1e4 * period).unwrap(), Outcome::Reached, "{}", e.reason());
    assert!((9_999..=10_001).contains(&e.impacts().len()), "{}", e.impacts().len());
    let energy = 0.5 * e.state()[1].powi(2) + GRAVITY * e.state()[0];
    assert!((energy / GRAVITY - 1.0).abs() < 1e-10, "{energy}");
}

#[test]
fn ten_thousand_seconds_at_rest_are_no_event() {
    let mut e = start(&slope(0.3, 0.5, 0.0, 1.0), &Options::default(), &[0.0; 4]);
    assert_eq!(e.advance(1e4).unwrap(), Outcome::Reached, "{}", e.reason());
    assert!(e.switches().is_empty() && e.impacts().is_empty() && e.stats().steps < 100, "{:?}", e.stats());
    assert_eq!(e.state(), [0.0; 4]);
    // a block on its two corners: more forces than the motion determines
    let mut e = start(&block(0.1, 0.4, 0.5), &Options::default(), &[0.0, 0.4, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(e.advance(1e4).unwrap(), Outcome::Reached, "{}", e.reason());
    assert!(e.switches().is_empty() && e.phases()[0].redundant && e.stats().steps < 200, "{:?} {:?}", e.phases(), e.stats());
    let run = e.into_run();
    let f = run.contact_forces(1e4).unwrap();
    assert!((f[0][0] - 0.5 * GRAVITY).abs() < 1e-9 && (f[1][0] - 0.5 * GRAVITY).abs() < 1e-9, "{f:?}");
    assert!(f[0][1].abs() < 1e-9 && run.x.iter().skip(3).all(|v| v.abs() < 1e-12), "{f:?} {:?}", run.x);
}

/// Newton's law for chains of balls that touch, rational numbers of the reference; one after the other.
#[test]
fn cradles() {
    let r = reference("cradle.json");
    let mut n_cases = 0;
    for (name, case) in r["cases"].as_object().unwrap() {
        let Some(after) = case.get("newton_moreau") else { continue };
        let fraction = |v: &serde_json::Value| {
            let text = v.as_str().unwrap();
            match text.split_once('/') {
                Some((a, b)) => a.parse::<f64>().unwrap() / b.parse::<f64>().unwrap(),
                None => text.parse().unwrap(),
            }
        };
        let after: Vec<f64> = after.as_array().unwrap().iter().map(fraction).collect();
        let n = after.len();
        let masses: Vec<f64> = case.get("masses").map_or(vec![1.0; n], |m| m.as_array().unwrap().iter().map(fraction).collect());
        let e = case.get("e").map(fraction).unwrap_or_else(|| name.split("e=").nth(1).and_then(|t| {
            let t = t.split([' ', ',']).next().unwrap();
            t.split_once('/').map_or_else(|| t.parse().ok(), |(a, b)| Some(a.parse::<f64>().unwrap() / b.parse::<f64>().unwrap()))
        }).unwrap());
        for law in [ImpactLaw::Newton, ImpactLaw::Sequential] {
            let g = Graph::new();
            let force: Vec<Expr> = vec![g.constant(0.0); n];
            let mut s = scene(&g, "cradle", &masses, &force, 0, 0);
            for i in 1..n {
                s.add_contact(contact(&g, &format!("c{i}"), g.x(i) - g.x(i - 1) - 1.0, &[], 0.0, e)).unwrap();
            }
            s.set_law(law);
            let system = s.build(&g).unwrap().system;
            let mut x0: Vec<f64> = (0..n).map(|i| i as f64).collect();
            x0[0] = -0.5;
            x0.push(1.0);
            x0.resize(2 * n, 0.0);
            let mut run = start(&system, &Options::default(), &x0);
            // the first collision, and nothing after it
            assert_eq!(run.advance(0.5 + 1e-9).unwrap(), Outcome::Reached, "{}", run.reason());
            let v = &run.state()[n..];
            let momentum: f64 = v.iter().zip(&masses).map(|(v, m)| m * v).sum();
            assert!((momentum - masses[0]).abs() < 1e-12);
            if law == ImpactLaw::Newton {
                assert!(v.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-12), "{name}: {v:?} {after:?}");
                n_cases += 1;
            } else if e == 1.0 && masses.iter().all(|m| *m == 1.0) {
                // the velocity goes through to the last ball
                assert!((v[n - 1] - 1.0).abs() < 1e-12, "{name}: {v:?}");
                assert!(n < 3 || run.impacts().iter().any(|i| !i.unique) || run.one_sided(), "{:?}", run.impacts());
            }
        }
    }
    assert!(n_cases >= 3, "{n_cases}");
}

/// A rod that slides into the region where no forces exist, and where two sets of forces do.
#[test]
fn painleve_stops_by_an_impact() {
    let r = &reference("rod.json")["painleve"];
    let th = number(&r["theta"]);
    let (l, j) = (number(&r["l"]), number(&r["J"]));
    // lower end on the floor, moving so that its gap stays closed: v_y + l/2 sin(th) w = 0, and sliding in the direction for which friction presses
    for side in [-1.0, 1.0] {
        let system = rod(l, j, 1.5);
        let x0 = [0.0, 0.5 * l * th.cos(), th, side * 2.0, 0.0, 0.0];
        let mut e = start(&system, &Options::default(), &x0);
        let outcome = e.advance(0.01).unwrap();
        println!("{side}: {outcome:?} {} {:?} {:?} {:?}", e.reason(), e.impacts(), e.phases(), e.branchings());
        assert_eq!(outcome, Outcome::Reached, "{}", e.reason());
        if e.impacts().iter().any(|i| i.kind == ImpactKind::Painleve) {
            assert!(e.one_sided());
        }
    }
}

/// A ball into the corner of a box: both walls at once, and nearly at once.
#[test]
fn corners() {
    for shift in [0.0, 1e-15, 1e-12, 1e-6] {
        let mut e = start(&box_elastic(), &Options::with_tolerance(1e-12, 1e-12), &[0.1, 0.15 + shift, 1.0, 1.0]);
        assert_eq!(e.advance(2.0).unwrap(), Outcome::Reached, "{}", e.reason());
        assert_eq!(e.impacts().len(), 2, "{:?}", e.impacts());
        let want = [0.1, 0.15 - shift, -1.0, -1.0];
        assert!(e.state().iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-13), "{shift}: {:?}", e.state());
    }
}

#[test]
fn large_ratios_of_masses_and_stiff_springs() {
    // a heavy ball on a light one on the floor
    for ratio in [1.0, 1e3, 1e6] {
        let g = Graph::new();
        let force = [g.constant(-GRAVITY), g.constant(-GRAVITY * ratio)];
        let mut s = scene(&g, "heavy", &[1.0, ratio], &force, 0, 0);
        s.add_contact(contact(&g, "floor", g.x(0), &[], 0.0, 0.0)).unwrap();
        s.add_contact(contact(&g, "between", g.x(1) - g.x(0) - 1.0, &[], 0.0, 0.0)).unwrap();
        let mut e = start(&s.build(&g).unwrap().system, &Options::default(), &[0.3, 1.7, 0.0, 0.0]);
        assert_eq!(e.advance(5.0).unwrap(), Outcome::Reached, "{ratio}: {}", e.reason());
        assert!(e.state().iter().zip([0.0, 1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{ratio}: {:?}", e.state());
        let run = e.into_run();
        let f = run.contact_forces(5.0).unwrap();
        assert!((f[0][0] / (GRAVITY * (1.0 + ratio)) - 1.0).abs() < 1e-9, "{f:?}");
    }
}

/// The answer does not depend on units: lengths, times, masses.
#[test]
fn units() {
    let solve = |length: f64, time: f64, mass: f64| {
        let g = Graph::new();
        let (x, y, zero) = (g.x(0), g.x(1), g.constant(0.0));
        let a = length / (time * time);
        let mut s = Scene::new("units", 2, 2, 0, 0).unwrap();
        let m = g.constant(mass);
        s.set_inertia(&[m.id(), zero.id(), zero.id(), m.id()]).unwrap();
        s.set_force(0, (mass * a * 2.0 * (5.0 / time * g.t()).sin()).id()).unwrap();
        s.set_force(1, g.constant(-GRAVITY * mass * a).id()).unwrap();
        let c = contact(&g, "floor", y - 0.1 * length * (x / length).sin(), &[x], 0.4, 0.3);
        s.add_contact(c).unwrap();
        let v = length / time;
        let mut o = Options::default();
        o.rtol = vec![1e-9];
        o.atol = [length, length, v, v].iter().map(|s| 1e-9 * s).collect();
        let mut e = start(&s.build(&g).unwrap().system, &o, &[0.0, length, v, 0.0]);
        assert_eq!(e.advance(2.0 * time).unwrap(), Outcome::Reached, "{}", e.reason());
        let scaled: Vec<f64> = e.state().iter().zip([length, length, v, v]).map(|(x, s)| x / s).collect();
        (scaled, e.switches().len(), e.impacts().len())
    };
    let (x, n, k) = solve(1.0, 1.0, 1.0);
    assert!(n > 0 && k > 3);
    for (l, t, m) in [(1e6, 1.0, 1.0), (1e-6, 1.0, 1.0), (1.0, 1e7, 1.0), (1.0, 1e-7, 1.0), (1.0, 1.0, 1e9), (1e-9, 1e-5, 1e-12)] {
        let (own, n_own, k_own) = solve(l, t, m);
        println!("{l} {t} {m}: {own:?} {n_own} {k_own}");
        assert_eq!((n, k), (n_own, k_own), "{l} {t} {m}");
        assert!(own.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-8), "{own:?} {x:?}");
    }
}

#[test]
fn what_accumulates_may_stop_the_run() {
    let o = Options { zeno: Zeno::Stop, ..Options::default() };
    let mut e = start(&ball(0.5), &o, &[1.0, 0.0]);
    assert_eq!(e.advance(5.0).unwrap(), Outcome::Zeno, "{}", e.reason());
    assert!((e.time() - 3.0 * (2.0 / GRAVITY).sqrt()).abs() < 1e-6, "{}", e.time());
}

/// An inertia that is not a multiple of the unit matrix, on a curve; a pendulum with a varying inertia and a wall.
#[test]
fn curved_floors_and_inertias_that_vary() {
    // a point that slides on a circle without friction, held by gravity: energy and the circle stay
    let g = Graph::new();
    let (x, y, zero) = (g.x(0), g.x(1), g.constant(0.0));
    let mut s = Scene::new("bowl", 2, 2, 0, 0).unwrap();
    let entries = [g.constant(2.0), g.constant(0.5), g.constant(0.5), g.constant(1.0)];
    s.set_inertia(&entries.map(|e| e.id())).unwrap();
    s.set_force(0, zero.id()).unwrap();
    s.set_force(1, g.constant(-GRAVITY).id()).unwrap();
    s.add_contact(Contact::new(&g, "bowl", 1.0 - (x * x + y * y).sqrt())).unwrap();
    let system = s.build(&g).unwrap().system;
    let mut e = start(&system, &Options::with_tolerance(1e-11, 1e-11), &[0.8, -0.6, 0.0, 0.0]);
    assert_eq!(e.advance(20.0).unwrap(), Outcome::Reached, "{}", e.reason());
    let [x, y, u, v] = [e.state()[0], e.state()[1], e.state()[2], e.state()[3]];
    let energy = u * u + 0.5 * u * v + 0.5 * v * v + GRAVITY * y;
    assert!((energy + 0.6 * GRAVITY).abs() < 1e-8, "{energy}");
    assert!((x.hypot(y) - 1.0).abs() < 1e-14 && (x * u + y * v).abs() < 1e-13, "{:?}", e.state());
    assert!(e.switches().is_empty() && e.impacts().is_empty());
}
