//! Hard cases of contacts: many impacts, rest for ever, large ratios, several at once, no or many solutions, other units.

#[path = "common/scenes.rs"]
#[allow(dead_code)]
mod scenes;

use scenes::*;
use switchback::event::{Engine, ImpactKind, Method, Options, Outcome, Zeno};
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
    let period = 2.0 * (2.0 / GRAVITY).sqrt();
    // all flights are alike, and so is their rounding: the weights of the pair of order 8 are as large as six, with both
    // signs, and it loses 2.4e-14 in each of them
    for (method, most) in [(Method::Dp5, 1e-10), (Method::Dop853, 1e-9)] {
        let o = Options { method, ..Options::with_tolerance(1e-10, 1e-10) };
        let mut e = start(&ball(1.0), &o, &[1.0, 0.0]);
        assert_eq!(e.advance(1e4 * period).unwrap(), Outcome::Reached, "{}", e.reason());
        assert!((9_999..=10_001).contains(&e.impacts().len()), "{}", e.impacts().len());
        let energy = 0.5 * e.state()[1].powi(2) + GRAVITY * e.state()[0];
        println!("{method:?}: {:.1e}", energy / GRAVITY - 1.0);
        assert!((energy / GRAVITY - 1.0).abs() < most, "{method:?}: {energy}");
    }
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
    assert!(
        e.switches().is_empty() && e.phases()[0].redundant && e.stats().steps < 1000,
        "{:?} {:?}",
        e.phases(),
        e.stats()
    );
    let run = e.into_run();
    let f = run.contact_forces(1e4).unwrap();
    assert!((f[0][0] - 0.5 * GRAVITY).abs() < 1e-9 && (f[1][0] - 0.5 * GRAVITY).abs() < 1e-9, "{f:?}");
    assert!(f[0][1].abs() < 1e-9 && run.x.iter().skip(3).all(|v| v.abs() < 1e-12), "{f:?} {:?}", run.x);
}

/// Newton's law for chains of balls that touch, rational numbers of the reference; one after the other.
#[test]
fn cradles() {
    let r = reference("cradle.json");
    let fraction = |v: &serde_json::Value| match v.as_str() {
        Some(text) => text
            .split_once('/')
            .map_or_else(|| text.parse().unwrap(), |(a, b)| a.parse::<f64>().unwrap() / b.parse::<f64>().unwrap()),
        None => v.as_f64().unwrap(),
    };
    let list = |v: &serde_json::Value| -> Vec<f64> { v.as_array().unwrap().iter().map(fraction).collect() };
    let mut compared = 0;
    for (name, e, masses) in [
        ("3 equal e=1", 1.0, vec![1.0; 3]),
        ("3 equal e=1/2", 0.5, vec![1.0; 3]),
        ("3 equal e=0", 0.0, vec![1.0; 3]),
        ("masses 1,2,3 e=1", 1.0, vec![1.0, 2.0, 3.0]),
        ("masses 1,2,3 e=4/5", 0.8, vec![1.0, 2.0, 3.0]),
        ("5 equal e=1", 1.0, vec![1.0; 5]),
    ] {
        let n = masses.len();
        for (law, key) in [(ImpactLaw::Newton, "newton_moreau"), (ImpactLaw::Sequential, "pairwise_left_first")] {
            let g = Graph::new();
            let force: Vec<Expr> = vec![g.constant(0.0); n];
            let mut s = scene(&g, "cradle", &masses, &force, 0, 0);
            for i in 1..n {
                s.add_contact(contact(&g, &format!("c{i}"), g.x(i) - g.x(i - 1) - 1.0, &[], 0.0, e)).unwrap();
            }
            s.set_law(law);
            let mut x0: Vec<f64> = (0..n).map(|i| i as f64).collect();
            x0[0] = -0.5;
            x0.push(1.0);
            x0.resize(2 * n, 0.0);
            let mut run = start(&s.build(&g).unwrap().system, &Options::default(), &x0);
            // the first collision, and nothing after it
            assert_eq!(run.advance(0.5 + 1e-9).unwrap(), Outcome::Reached, "{name}: {}", run.reason());
            let (v, after) = (&run.state()[n..], list(&r["cases"][name][key]));
            assert!(v.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-11), "{name} {law:?}: {v:?} {after:?}");
            compared += 1;
            if law == ImpactLaw::Sequential && e > 0.0 {
                assert!(run.one_sided(), "the order of impacts matters");
            }
            // rounding of velocities that cancel is no impact; one after the other has a limit
            run.advance(3.0).unwrap();
            let least = run.impacts().iter().map(|i| i.impulse[0]).fold(f64::INFINITY, f64::min);
            assert!(least > 1e-12 || law == ImpactLaw::Sequential, "{name}: {:?}", run.impacts());
        }
    }
    assert_eq!(compared, 12);
}

/// A rod that slides into the region where no forces exist, and where two sets of forces do.
#[test]
fn painleve_stops_by_an_impact() {
    let r = &reference("rod.json")["painleve"];
    let stop = &r["impact_without_collision"];
    let (l, j, mu) = (number(&r["l"]), number(&r["J"]), number(&stop["mu"]));
    let solve = |th: f64, v: &[f64]| {
        let system = rod(l, j, mu);
        let mut e = start(&system, &Options::default(), &[0.0, 0.5 * l * th.cos(), th, v[0], v[1], v[2]]);
        assert_eq!(e.advance(1e-6).unwrap(), Outcome::Reached, "{}", e.reason());
        e
    };
    // none: sliding stops by an impact
    let e = solve(number(&stop["theta"]), &numbers(&stop["v"]));
    let [i] = e.impacts() else { panic!("{:?}", e.impacts()) };
    assert!(i.kind == ImpactKind::Painleve && e.one_sided());
    assert!(i.impulse.iter().zip(numbers(&stop["stick_impulse"])).all(|(a, b)| (a - b).abs() < 1e-12), "{i:?}");
    assert!(e.state()[3..].iter().zip(numbers(&stop["v_plus"])).all(|(a, b)| (a - b).abs() < 1e-4), "{:?}", e.state());
    // one: sliding the other way
    let e = solve(number(&r["theta"]), &[2.0, 0.0, 0.0]);
    assert!(e.impacts().is_empty() && e.phases()[0].modes == [2, 0] && e.branchings().is_empty());
    // two: the gap stays closed for v_y = −l/2 sin θ ω, and either it goes on so or the rod lifts off
    let (th, w) = (number(&r["theta"]), 6.0);
    let e = solve(th, &[-2.0 - 0.5 * l * th.cos() * -w, -0.5 * l * th.sin() * w, w]);
    assert!(e.branchings().len() == 1 && e.branchings()[0].continuations.len() == 2, "{:?}", e.branchings());
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
        assert!(
            e.state().iter().zip([0.0, 1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-9),
            "{ratio}: {:?}",
            e.state()
        );
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
        let atol = [length, length, v, v].iter().map(|s| 1e-9 * s).collect();
        let o = Options { rtol: vec![1e-9], atol, ..Options::default() };
        let mut e = start(&s.build(&g).unwrap().system, &o, &[0.0, length, v, 0.0]);
        assert_eq!(e.advance(2.0 * time).unwrap(), Outcome::Reached, "{}", e.reason());
        let scaled: Vec<f64> = e.state().iter().zip([length, length, v, v]).map(|(x, s)| x / s).collect();
        (scaled, e.switches().len(), e.impacts().len())
    };
    let (x, n, k) = solve(1.0, 1.0, 1.0);
    assert!(n > 0 && k > 3);
    for (l, t, m) in
        [(1e6, 1.0, 1.0), (1e-6, 1.0, 1.0), (1.0, 1e7, 1.0), (1.0, 1e-7, 1.0), (1.0, 1.0, 1e9), (1e-9, 1e-5, 1e-12)]
    {
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

/// Contacts that cannot close cost nothing; those that might stay.
#[test]
fn bounds_leave_contacts_out() {
    let build = |walls: usize, bounded: bool| {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let mut s = scene(&g, "hall", &[1.0; 2], &[0.3 * (3.0 * g.t()).sin(), g.constant(-GRAVITY)], 0, 0);
        s.add_contact(contact(&g, "floor", y - 0.1 * x.sin(), &[x], 0.3, 0.5)).unwrap();
        for k in 0..walls {
            let gap = (x - 50.0 - k as f64).powi(2) + y * y - 100.0;
            s.add_contact(contact(&g, &format!("pillar {k}"), gap, &[], 0.0, 1.0)).unwrap();
        }
        if bounded {
            s.set_bounds(0, -5.0, 5.0).unwrap();
            s.set_bounds(1, -5.0, 5.0).unwrap();
        }
        s.build(&g).unwrap()
    };
    let (alone, reduced, full) = (build(0, true), build(30, true), build(30, false));
    assert_eq!((reduced.report.contacts.len(), reduced.report.dropped.len()), (1, 30));
    assert!(reduced.report.to_string().contains("left out: contact pillar 3"), "{}", reduced.report);
    assert!(full.report.dropped.is_empty());
    let run = |s: &System| {
        let mut e = start(s, &Options::default(), &[0.0, 1.0, 1.0, 0.0]);
        assert_eq!(e.advance(2.0).unwrap(), Outcome::Reached, "{}", e.reason());
        (e.state().to_vec(), e.stats())
    };
    let (a, b, c) = (run(&alone.system), run(&reduced.system), run(&full.system));
    assert_eq!(a, b);
    assert_eq!(a.0, c.0);
    // bounds in which the proof fails: the contact stays
    let g = Graph::new();
    let mut s = scene(&g, "hall", &[1.0; 2], &[g.constant(0.0), g.constant(0.0)], 0, 0);
    s.add_contact(contact(&g, "pillar", (g.x(0) - 5.0).powi(2) + g.x(1).powi(2) - 1.0, &[], 0.0, 1.0)).unwrap();
    s.set_bounds(0, -5.0, 5.0).unwrap();
    assert_eq!(s.build(&g).unwrap().report.dropped.len(), 0);
    // an infinite bound says nothing of its side, two take back what was said
    s.set_bounds(0, f64::NEG_INFINITY, 3.0).unwrap();
    assert_eq!(s.build(&g).unwrap().report.dropped.len(), 1);
    s.set_bounds(0, 3.0, f64::INFINITY).unwrap();
    assert_eq!(s.build(&g).unwrap().report.dropped.len(), 0);
    s.set_bounds(0, f64::NEG_INFINITY, 3.0).unwrap();
    s.set_bounds(0, f64::NEG_INFINITY, f64::INFINITY).unwrap();
    assert_eq!(s.build(&g).unwrap().report.dropped.len(), 0);
    for (low, high) in [(f64::NAN, 1.0), (1.0, 0.0), (f64::INFINITY, f64::INFINITY)] {
        assert!(s.set_bounds(0, low, high).unwrap_err().to_string().contains("bounds of coordinate 0"));
    }
    // leaving the bounds is an error, not a surprise
    let mut e = start(&reduced.system, &Options::default(), &[0.0, 1.0, 20.0, 0.0]);
    let why = e.advance(2.0).unwrap_err().to_string();
    assert!(why.contains("bounds"), "{why}");
}

#[test]
fn mixed_restitution_and_several_at_once() {
    // a ball between a floor with e = 0.9 and a ceiling with e = 0.2
    let g = Graph::new();
    let y = g.x(0);
    let mut s = scene(&g, "between", &[1.0], &[g.constant(0.0)], 0, 0);
    s.add_contact(contact(&g, "floor", y, &[], 0.0, 0.9)).unwrap();
    s.add_contact(contact(&g, "ceiling", 1.0 - y, &[], 0.0, 0.2)).unwrap();
    let mut e = start(&s.build(&g).unwrap().system, &Options::default(), &[0.5, 1.0]);
    e.advance(0.5 + 1.0 / 0.2 + 1.0 / (0.2 * 0.9) + 0.1).unwrap();
    let speeds: Vec<f64> = e.impacts().iter().map(|i| i.rates[1]).collect();
    assert!(speeds.iter().zip([0.2, 0.18, 0.036]).all(|(a, b)| (a - b).abs() < 1e-14), "{speeds:?}");
}

/// In space a body that sticks begins to slide where its friction is used up, in the direction of the force.
#[test]
fn sticking_ends_in_space() {
    let g = Graph::new();
    let [x, y, z] = [g.x(0), g.x(1), g.x(2)];
    let mu = 0.3;
    let force = [2.0 * g.t(), 1.0 * g.t(), g.constant(-GRAVITY)];
    let mut s = scene(&g, "puck", &[1.0; 3], &force, 0, 0);
    s.add_contact(contact(&g, "floor", z, &[x, y], mu, 0.0)).unwrap();
    let mut e = start(&s.build(&g).unwrap().system, &Options::with_tolerance(1e-11, 1e-11), &[0.0; 6]);
    assert_eq!(e.advance(3.0).unwrap(), Outcome::Reached, "{}", e.reason());
    // along (2, 1)/√5: s'' = √5 t − μ g from the time when that is zero on
    let (a, b) = (5.0f64.sqrt(), mu * GRAVITY);
    let t0 = b / a;
    let way = |t: f64| a * t.powi(3) / 6.0 - b * t * t / 2.0;
    let s_end = way(3.0) - way(t0) - (a * t0 * t0 / 2.0 - b * t0) * (3.0 - t0);
    assert!((e.switches()[0].t - t0).abs() < 1e-10, "{:?}", e.switches());
    let start = &e.phases().last().unwrap().starting;
    assert!(start.len() == 1 && (start[0].direction[0] - 2.0 / a).abs() < 1e-8, "{start:?}");
    assert!(
        (e.state()[0] - 2.0 / a * s_end).abs() < 1e-9 && (e.state()[1] - s_end / a).abs() < 1e-9,
        "{:?}",
        e.state()
    );
}

/// Discs that touch without a force between them, and heaps that fall.
#[test]
fn heaps_come_to_rest() {
    let small: Vec<f64> = [(-0.2, 0.2), (0.2, 0.2), (-0.1, 0.7), (0.3, 0.7)].iter().flat_map(|p| [p.0, p.1]).collect();
    let mut seed = 3u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut heaps = vec![(4, small)];
    for n in [6, 8, 10] {
        heaps.push((
            n,
            (0..n).flat_map(|i| [0.05 * random() + 0.45 * (i % 3) as f64, 0.3 + 0.45 * (i / 3) as f64]).collect(),
        ));
    }
    for (n, at) in heaps {
        let mut x0 = at;
        x0.resize(4 * n, 0.0);
        let mut e = start(&discs(n, 0.2), &Options::with_tolerance(1e-8, 1e-8), &x0);
        let outcome = e.advance(1.0).unwrap();
        println!("{n}: {outcome:?} {} {:?}", e.reason(), e.stats());
        assert_eq!(outcome, Outcome::Reached, "{n}: {}", e.reason());
        let y = |i: usize| e.state()[2 * i + 1];
        assert!((0..n).all(|i| y(i) > 0.2 - 1e-7), "{:?}", e.state());
    }
}

/// Discs in a box: floor, two walls; with friction they turn.
fn boxed(n: usize, r: f64, width: f64, mu: f64) -> System {
    let g = Graph::new();
    let k = if mu > 0.0 { 3 } else { 2 };
    let inertia: Vec<f64> = (0..k * n).map(|i| if i % k == 2 { 0.5 * r * r } else { 1.0 }).collect();
    let force: Vec<Expr> = (0..k * n).map(|i| g.constant(if i % k == 1 { -GRAVITY } else { 0.0 })).collect();
    let mut s = scene(&g, "box", &inertia, &force, 0, 0);
    let (q, v) = (|i: usize, c: usize| g.x(k * i + c), |i: usize, c: usize| g.x(k * n + k * i + c));
    for i in 0..n {
        let along = |c: usize, sign: f64| if k == 3 { vec![q(i, c) + sign * r * q(i, 2)] } else { vec![] };
        s.add_contact(contact(&g, &format!("floor {i}"), q(i, 1) - r, &along(0, 1.0), mu, 0.0)).unwrap();
        s.add_contact(contact(&g, &format!("left {i}"), q(i, 0) - r, &along(1, -1.0), mu, 0.0)).unwrap();
        s.add_contact(contact(&g, &format!("right {i}"), width - r - q(i, 0), &along(1, 1.0), mu, 0.0)).unwrap();
        for j in 0..i {
            let (dx, dy) = (q(i, 0) - q(j, 0), q(i, 1) - q(j, 1));
            let d = (dx * dx + dy * dy).sqrt();
            let slide = || {
                let turn = |i: usize| if k == 3 { r * v(i, 2) } else { g.constant(0.0) };
                (dx * (v(i, 1) - v(j, 1)) - dy * (v(i, 0) - v(j, 0))) / d - turn(i) - turn(j)
            };
            let tangents = if k == 3 { vec![slide()] } else { vec![] };
            s.add_contact(contact(&g, &format!("{i} {j}"), d - 2.0 * r, &tangents, mu, 0.0)).unwrap();
        }
    }
    s.build(&g).unwrap().system
}

/// Discs that fall into a box come to rest there, with friction and without, and nothing happens any more.
#[test]
fn heaps_in_a_box_come_to_rest() {
    let r = 0.2;
    let mut ends = Vec::new();
    for (n, row, mu, skip) in [(6, 3, 0.3, 0), (6, 3, 0.3, 2), (10, 4, 0.3, 1), (10, 4, 0.0, 1), (10, 4, 0.0, 2)] {
        let mut seed = 3u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..skip * n).for_each(|_| _ = random());
        let k = if mu > 0.0 { 3 } else { 2 };
        let mut x0 = vec![0.0; 2 * k * n];
        for i in 0..n {
            x0[k * i] = r + 0.05 * random() + 0.45 * (i % row) as f64;
            x0[k * i + 1] = 0.3 + 0.45 * (i / row) as f64;
        }
        let width = 0.45 * row as f64 + 0.1;
        let mut e = start(&boxed(n, r, width, mu), &Options::with_tolerance(1e-8, 1e-8), &x0);
        let outcome = e.advance(5.0).unwrap();
        let x = e.state();
        let overlap = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).fold(0.0f64, |m, (i, j)| {
            let d = (x[k * i] - x[k * j]).hypot(x[k * i + 1] - x[k * j + 1]);
            m.max(2.0 * r - d)
        });
        let speed = x[k * n..].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let late = e.switches().iter().filter(|s| s.t > 3.0).count();
        println!("{n} {mu}: {outcome:?} {} speed {speed:.1e} overlap {overlap:.1e} late {late}", e.reason());
        ends.push(outcome == Outcome::Reached && speed < 1e-7 && overlap < 1e-7 && late == 0);
    }
    assert!(ends.iter().all(|e| *e), "{ends:?}");
}

/// Pyramids of discs that friction can hold: they stand for a thousand seconds without an event, and do not creep.
#[test]
fn pyramids_stand() {
    for (rows, mu) in [(2, 0.3), (2, 0.9), (3, 0.5), (4, 0.6)] {
        let (g, r) = (Graph::new(), 0.2);
        let at: Vec<(f64, f64)> = (0..rows)
            .flat_map(|i| (0..rows - i).map(move |j| (i as f64, j as f64)))
            .map(|(i, j)| (r * (2.0 * j + i), r * (1.0 + i * 3f64.sqrt())))
            .collect();
        let n = at.len();
        let inertia: Vec<f64> = (0..3 * n).map(|k| if k % 3 == 2 { 0.5 * r * r } else { 1.0 }).collect();
        let force: Vec<Expr> = (0..3 * n).map(|k| g.constant(if k % 3 == 1 { -GRAVITY } else { 0.0 })).collect();
        let mut s = scene(&g, "pyramid", &inertia, &force, 0, 0);
        let (q, v) = (|i: usize, k: usize| g.x(3 * i + k), |i: usize, k: usize| g.x(3 * n + 3 * i + k));
        for i in 0..n {
            s.add_contact(contact(&g, &format!("floor {i}"), q(i, 1) - r, &[q(i, 0) + r * q(i, 2)], mu, 0.0)).unwrap();
            for j in 0..i {
                let (dx, dy) = (q(i, 0) - q(j, 0), q(i, 1) - q(j, 1));
                let d = (dx * dx + dy * dy).sqrt();
                let across = (dx * (v(i, 1) - v(j, 1)) - dy * (v(i, 0) - v(j, 0))) / d - r * (v(i, 2) + v(j, 2));
                s.add_contact(contact(&g, &format!("{i} {j}"), d - 2.0 * r, &[across], mu, 0.0)).unwrap();
            }
        }
        let mut x0: Vec<f64> = at.iter().flat_map(|p| [p.0, p.1, 0.0]).collect();
        x0.resize(6 * n, 0.0);
        let mut e = start(&s.build(&g).unwrap().system, &Options::with_tolerance(1e-8, 1e-8), &x0);
        assert_eq!(e.advance(1000.0).unwrap(), Outcome::Reached, "{rows}: {}", e.reason());
        assert!(
            e.switches().is_empty() && e.impacts().is_empty(),
            "{rows}: {} {}",
            e.switches().len(),
            e.impacts().len()
        );
        let moved = e.state().iter().zip(&x0).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        // sliding velocities of contacts that stick are held by accelerations: what rounding leaves of them adds up, here for
        // a thousand seconds, and stays near the tolerance
        assert!(moved < 1e-7, "{rows}: {moved}");
    }
}

/// A gap whose gradient vanishes where it closes has no normal: an error that names the contact.
#[test]
fn gaps_without_a_gradient_are_named() {
    type Gap = for<'a> fn(Expr<'a>) -> Expr<'a>;
    let gaps: [(&str, Gap); 2] = [("cube", |y| y.powi(3)), ("fifth", |y| 7.0 * y.powi(5))];
    for (name, gap) in gaps {
        let g = Graph::new();
        let mut s = scene(&g, "falls", &[1.0; 2], &[g.constant(0.0), g.constant(-GRAVITY)], 0, 0);
        s.add_contact(contact(&g, "side", 3.0 + g.x(0), &[], 0.0, 0.0)).unwrap();
        s.add_contact(contact(&g, name, gap(g.x(1)), &[], 0.0, 0.0)).unwrap();
        let mut e = start(&s.build(&g).unwrap().system, &Options::default(), &[0.0, 1.0, 0.5, 0.0]);
        let error = e.advance(2.0).expect_err(name).to_string();
        assert!(error.contains(&format!("contact {name} vanishes")) && error.contains("as a distance"), "{error}");
        assert!((e.time() - (2.0 / GRAVITY).sqrt()).abs() < 0.05, "{name}: {}", e.time());
    }
    // a distance that is hardly left, and one that grows by its square, have one
    let distances: [Gap; 2] = [|y| 1e-4 * y, |y| (y + 1.0).powi(2) - 1.0];
    for gap in distances {
        let g = Graph::new();
        let mut s = scene(&g, "falls", &[1.0], &[g.constant(-GRAVITY)], 0, 0);
        s.add_contact(contact(&g, "floor", gap(g.x(0)), &[], 0.0, 0.5)).unwrap();
        let mut e = start(&s.build(&g).unwrap().system, &Options::default(), &[1000.0, 0.0]);
        assert_eq!(e.advance(20.0).unwrap(), Outcome::Reached, "{}", e.reason());
        assert!(!e.impacts().is_empty());
    }
}

/// Friction and restitution that are expressions are checked where they count.
#[test]
fn laws_that_become_none_are_named() {
    let falls = |e: f64, mu: f64| {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let mut s = scene(&g, "falls", &[1.0; 2], &[g.constant(0.0), g.constant(-GRAVITY)], 0, 0);
        let c = Contact {
            tangents: vec![x.id()],
            friction: (0.1 + mu * g.t()).id(),
            restitution: (0.2 + e * g.t()).id(),
            ..Contact::new(&g, "floor", y)
        };
        s.add_contact(c).unwrap();
        let mut e = start(&s.build(&g).unwrap().system, &Options::default(), &[0.0, 1.0, 1.0, 0.0]);
        (e.advance(1.0).unwrap(), e.reason().to_owned())
    };
    assert_eq!(falls(0.0, 0.0).0, Outcome::Reached);
    for (e, mu, said) in [(10.0, 0.0, "restitution 4."), (0.0, -1.0, "friction -0.3")] {
        let (outcome, why) = falls(e, mu);
        assert!(outcome == Outcome::NoContinuation && why.contains("contact floor") && why.contains(said), "{why}");
    }
}

/// An inertia that becomes singular is the cause that is named.
#[test]
fn an_inertia_that_becomes_singular_is_named() {
    for power in [1, 2] {
        let g = Graph::new();
        let x = g.x(0);
        let mut s = Scene::new("cart", 1, 1, 0, 0).unwrap();
        s.set_inertia(&[(1.0 - x).powi(power).id()]).unwrap();
        s.set_force(0, g.constant(1.0).id()).unwrap();
        s.add_contact(contact(&g, "stop", 5.0 - x, &[], 0.0, 0.0)).unwrap();
        let mut e = start(&s.build(&g).unwrap().system, &Options::default(), &[0.0, 1.0]);
        let outcome = e.advance(3.0).unwrap();
        assert_ne!(outcome, Outcome::Reached);
        assert!(e.reason().contains("the inertia matrix becomes singular"), "{power}: {}", e.reason());
    }
}

/// Contacts that cannot close soon change nothing, to the last step and the last evaluation; those that come near are seen.
#[test]
fn far_contacts_are_not_looked_at() {
    let solve = |far: usize, wall: f64| {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let mut s = scene(&g, "ball", &[1.0; 2], &[g.constant(0.0), g.constant(-GRAVITY)], 0, 0);
        s.add_contact(contact(&g, "floor", y, &[x], 0.1, 0.6)).unwrap();
        for k in 0..far {
            let (a, b) = (-4000.0 + 300.0 * k as f64, 5000.0 + 700.0 * k as f64);
            let distance = ((x - a).powi(2) + (y - b).powi(2)).sqrt() - 1.0;
            s.add_contact(contact(&g, &format!("far {k}"), distance, &[], 0.0, 0.0)).unwrap();
        }
        s.add_contact(contact(&g, "wall", wall - x, &[], 0.0, 0.5)).unwrap();
        let mut e = start(&s.build(&g).unwrap().system, &Options::with_tolerance(1e-9, 1e-9), &[0.0, 1.0, 2.0, 0.0]);
        assert_eq!(e.advance(6.0).unwrap(), Outcome::Reached, "{}", e.reason());
        e
    };
    let (alone, among) = (solve(6, 1e3), solve(40, 1e3));
    assert_eq!(alone.stats(), among.stats());
    assert!(alone.state().iter().zip(among.state()).all(|(a, b)| (a - b).abs() < 1e-14));
    assert!(alone.impacts().len() > 3);
    // the wall is far for a while, and is hit at the same time
    let (alone, among) = (solve(0, 2.0), solve(30, 2.0));
    let hits = |e: &Engine, wall: usize| -> Vec<f64> {
        e.impacts().iter().filter(|i| i.contact == wall).map(|i| i.t).collect()
    };
    let (a, b) = (hits(&alone, 1), hits(&among, 31));
    assert!(a.len() == 1 && b.len() == 1 && (a[0] - b[0]).abs() < 1e-9, "{a:?} {b:?}");
    assert!(alone.state().iter().zip(among.state()).all(|(a, b)| (a - b).abs() < 1e-7));
}

/// A stone and what pushes it slide on and come to rest together; what is left of the push draws away, from rounding to what can be seen.
#[test]
fn forces_that_are_next_to_nothing_where_bodies_come_to_rest() {
    let g = Graph::new();
    let (p, x, y) = (g.x(0), g.x(1), g.x(2));
    let (mu, m, v0, gap) = (0.08, [0.5, 1.0], 0.3, 0.1);
    let mut s = scene(&g, "stone", &[m[0], m[1], 1.0], &[g.u(0), 0.0 * x, g.constant(-GRAVITY)], 1, 0);
    s.add_contact(contact(&g, "push", x - p - gap, &[], 0.0, 0.0)).unwrap();
    s.add_contact(contact(&g, "ice", y, &[x], mu, 0.0)).unwrap();
    let system = s.build(&g).unwrap().system;
    let end = 2.0;
    for exponent in [3, 6, 9, 12, 15, 16, 17, 18, 19, 20, 21, 30, 300] {
        let force = -(10f64.powi(-exponent));
        let mut e = Engine::new(&system, &Options::with_tolerance(1e-9, 1e-9)).unwrap();
        e.set_controls(&[force]).unwrap();
        e.reinit(0.0, &[-gap, 0.0, 0.0, v0, v0, 0.0]).unwrap();
        assert_eq!(e.advance(end).unwrap(), Outcome::Reached, "{force}: {}", e.reason());
        // they slow down together until they rest
        let time = v0 * (m[0] + m[1]) / (mu * GRAVITY * m[1] - force);
        let way = 0.5 * v0 * time - gap + 0.5 * force / m[0] * (end - time).powi(2);
        assert!((e.state()[0] - way).abs() < 1e-8, "{force}: {} {way}", e.state()[0]);
    }
}

/// Two blocks slide on together, since the one in front has more friction, and come to rest: the push between them and their frictions are one force too many
/// then, nothing pushes them, and the push between them is no rounding of the weights, which would open and close it without end.
#[test]
fn blocks_that_rest_beside_each_other_have_no_events() {
    let g = Graph::new();
    let (x1, y1, x2, y2) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let (m, mu, v0) = ([1.0, 0.7], [0.2, 0.3], 1.0);
    for drag in [0.0, 0.4] {
        let forces = [
            g.x(4) * (-drag * m[0]),
            g.constant(-m[0] * GRAVITY),
            g.x(6) * (-drag * m[1]),
            g.constant(-m[1] * GRAVITY),
        ];
        let mut s = scene(&g, "blocks", &[m[0], m[0], m[1], m[1]], &forces, 0, 0);
        s.add_contact(contact(&g, "pair", x2 - x1 - 0.2, &[], 0.0, 0.0)).unwrap();
        s.add_contact(contact(&g, "floor of the first", y1, &[x1], mu[0], 0.0)).unwrap();
        s.add_contact(contact(&g, "floor of the second", y2, &[x2], mu[1], 0.0)).unwrap();
        let system = s.build(&g).unwrap().system;
        for tol in [1e-6, 1e-9, 1e-11] {
            let mut e =
                start(&system, &Options::with_tolerance(tol, 1e-2 * tol), &[0.0, 0.0, 0.2, 0.0, v0, 0.0, v0, 0.0]);
            assert_eq!(e.advance(3.0).unwrap(), Outcome::Reached, "{drag}, {tol}: {}", e.reason());
            let braked = GRAVITY * (mu[0] * m[0] + mu[1] * m[1]) / (m[0] + m[1]);
            // v' = −braked − drag v until it rests
            let way = match drag {
                0.0 => 0.5 * v0 * v0 / braked,
                d => v0 / d - braked / (d * d) * (1.0 + d * v0 / braked).ln(),
            };
            assert!((e.state()[0] - way).abs() < 10.0 * tol, "{drag}, {tol}: {} instead of {way}", e.state()[0]);
            assert!(e.stats().switches < 5, "{drag}, {tol}: {} switches", e.stats().switches);
        }
    }
}
