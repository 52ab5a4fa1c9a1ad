//! Contacts in the event-driven engine, against solutions nobody computed with this code.

#[path = "common/scenes.rs"]
mod scenes;

use scenes::*;
use switchback::event::{Engine, Method, Options, Outcome, Sensitivity};
use switchback::expr::Graph;
use switchback::scene::{Contact, Scene};
use switchback::system::System;

/// Largest difference, relative to one and to the numbers.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
    a.iter().zip(b).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs() / (1.0 + b.abs())))
}

fn run(s: &System, rtol: f64, x0: &[f64], p: &[f64], t: f64) -> Engine {
    let mut o = Options::with_tolerance(rtol, rtol);
    (o.sensitivity, o.adjoint) = (true.into(), true);
    let mut e = Engine::new(s, &o).unwrap();
    e.reinit(0.0, x0).unwrap();
    e.set_params(p).unwrap();
    e.advance(t).unwrap();
    assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
    e
}

#[test]
fn every_reference_over_tolerances() {
    let (mut bad, all) = (Vec::new(), cases());
    for Case { name, system, x0, p, t, x, derivatives, events, coarsest } in &all {
        for rtol in [4, 6, 8, 10, 12].map(|k| 10f64.powi(-k)).into_iter().filter(|r| r <= coarsest) {
            let mut e = run(system, rtol, x0, p, *t);
            let n_c = x0.len() + p.len();
            let s = e.sensitivity().unwrap().to_vec();
            let own: Vec<f64> = (0..x0.len()).flat_map(|i| s[i * n_c..i * n_c + x0.len()].to_vec()).collect();
            let state = off(e.state(), x);
            let derivative = if derivatives.is_empty() { 0.0 } else { off(&own, derivatives) };
            let times = event_times(e.impacts().iter().map(|i| i.t), e.switches().iter().map(|s| s.t));
            let time = if events.is_empty() { 0.0 } else { off(&times, events) };
            // rounding of what grazes by a depth d grows like its root
            let graze = if name.starts_with("grazing") { 1e4 } else { 1.0 };
            let close = state <= 100.0 * rtol && time <= 100.0 * rtol.max(1e-14);
            if !close || derivative > 1e3 * rtol.max(1e-14) * graze {
                bad.push((name, rtol, state, derivative, time));
            }
            // the adjoint is the transpose, to rounding
            let v: Vec<f64> = (0..x0.len()).map(|i| 1.0 + 0.3 * i as f64).collect();
            let gradient = e.adjoint(&v, &[]).unwrap();
            let forward: Vec<f64> = (0..n_c).map(|c| (0..x0.len()).map(|i| v[i] * s[i * n_c + c]).sum()).collect();
            let adjoint: Vec<f64> = gradient.x0.iter().chain(&gradient.p).copied().collect();
            assert!(off(&adjoint, &forward) < 1e-9, "{name} {rtol}: {adjoint:?} {forward:?}");
        }
    }
    assert!(bad.is_empty(), "{bad:?}");
}

/// A block that is pushed along a rough floor to a wall, which then holds it back; the next run begins away from it, sliding.
#[test]
fn a_new_run_knows_nothing_of_what_was_held_back_in_the_last_one() {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let mut scene = Scene::new("block", 2, 2, 1, 0).unwrap();
    scene.set_force(0, g.u(0).id()).unwrap();
    scene.set_force(1, g.constant(-9.81).id()).unwrap();
    let friction = g.constant(0.4).id();
    scene.add_contact(Contact { friction, tangents: vec![x.id()], ..Contact::new(&g, "floor", y) }).unwrap();
    scene.add_contact(Contact::new(&g, "wall", -x + 0.6)).unwrap();
    let system = scene.build(&g).unwrap().system;
    let mut e = Engine::new(&system, &Options::with_tolerance(1e-10, 1e-10)).unwrap();
    e.reinit(0.0, &[0.0; 4]).unwrap();
    e.set_controls(&[9.0]).unwrap();
    e.advance(2.0).unwrap();
    assert!(off(e.state(), &[0.6, 0.0, 0.0, 0.0]) < 1e-9, "{:?}", e.state());
    let (x0, v0, t) = (0.38, 1.0, 0.1);
    e.reinit(0.0, &[x0, 0.0, v0, 0.0]).unwrap();
    e.set_controls(&[-1.0]).unwrap();
    e.advance(t).unwrap();
    let a = -1.0 - 0.4 * 9.81;
    assert!(off(e.state(), &[x0 + v0 * t + 0.5 * a * t * t, 0.0, v0 + a * t, 0.0]) < 1e-9, "{:?}", e.state());
}

/// Derivatives with respect to parameters, controls and times of impacts, by differences.
#[test]
fn derivatives_are_those_of_differences() {
    let g = Graph::new();
    let (x, y, th, v) = (g.x(0), g.x(1), g.x(2), g.x(3));
    // a disc with a spring and air on a curved floor: friction p0, restitution p1, force u0
    let mut s = Scene::new("disc", 3, 3, 1, 2).unwrap();
    let zero = g.constant(0.0);
    let r = 0.3;
    let inertia = [g.constant(1.0), zero, zero, zero, 1.0 + 0.1 * x * x, zero, zero, zero, g.constant(0.5 * r * r)];
    s.set_inertia(&inertia.map(|e| e.id())).unwrap();
    for (i, f) in [g.u(0) - 0.3 * v, -GRAVITY + zero, -0.01 * g.x(5)].into_iter().enumerate() {
        s.set_force(i, f.id()).unwrap();
    }
    let c = Contact {
        tangents: vec![(x + r * th).id()],
        friction: g.p(0).id(),
        restitution: g.p(1).id(),
        ..Contact::new(&g, "floor", y - r - 0.05 * (2.0 * x).sin())
    };
    s.add_contact(c).unwrap();
    let system = s.build(&g).unwrap().system;
    let solve_by = |by: Sensitivity, z: &[f64]| {
        let mut o = Options::with_tolerance(1e-13, 1e-13);
        o.sensitivity = by;
        let mut e = Engine::new(&system, &o).unwrap();
        e.reinit(0.0, &z[..6]).unwrap();
        e.set_params(&z[6..8]).unwrap();
        e.set_controls(&z[8..]).unwrap();
        e.advance(2.0).unwrap();
        assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
        e
    };
    let solve = |z: &[f64]| solve_by(Sensitivity::On, z);
    let z = [0.0, 0.8, 0.2, 1.0, 0.0, -2.0, 0.25, 0.3, 0.4];
    let e = solve(&z);
    // by parameters and controls only: the same columns
    let by_inputs = solve_by(Sensitivity::Inputs, &z);
    let own: Vec<f64> = e.sensitivity().unwrap().chunks_exact(9).flat_map(|row| row[6..].to_vec()).collect();
    assert_eq!(by_inputs.sensitivity().unwrap(), own);
    assert!(by_inputs.impacts().iter().zip(e.impacts()).all(|(a, b)| a.dt == b.dt[6..]));
    assert!(e.impacts().len() > 3 && !e.switches().is_empty(), "{} {}", e.impacts().len(), e.switches().len());
    let h = 1e-5;
    for c in 0..z.len() {
        let at = |k: f64| {
            let mut moved = z;
            moved[c] += k * h;
            solve(&moved)
        };
        let (a, b, a2, b2) = (at(-1.0), at(1.0), at(-2.0), at(2.0));
        let fourth = |a2: f64, a: f64, b: f64, b2: f64| (8.0 * (b - a) - (b2 - a2)) / (12.0 * h);
        for i in 0..6 {
            let d = fourth(a2.state()[i], a.state()[i], b.state()[i], b2.state()[i]);
            let own = e.sensitivity().unwrap()[i * 9 + c];
            assert!((d - own).abs() < 2e-7 * (1.0 + d.abs()), "state {i}, column {c}: {own} {d}");
        }
        for k in 0..3 {
            let t = |e: &Engine| e.impacts()[k].t;
            let (d, own) = (fourth(t(&a2), t(&a), t(&b), t(&b2)), e.impacts()[k].dt[c]);
            assert!((d - own).abs() < 2e-7 * (1.0 + d.abs()), "impact {k}, column {c}: {own} {d}");
        }
    }
}

/// The rod falls on its lower end, sticks, slips, and lands on its other end: times, impulses, state before the landing.
#[test]
fn a_rod_falls() {
    let r = &reference("rod.json")["sticks"];
    let (x0, events) = (numbers(&r["x0"]), numbers(&r["events"]));
    let mut e = run(&rod(1.0, 1.0 / 12.0, 0.9), 1e-11, &x0, &[], events[2] - 1e-9);
    assert!((e.impacts()[0].t - events[0]).abs() < 1e-11);
    let logged = r["log"][0].as_array().unwrap();
    assert!((e.impacts()[0].impulse[0] - number(&logged[2])).abs() < 1e-10, "{:?}", e.impacts());
    assert!((e.impacts()[0].impulse[1] - number(&logged[3])).abs() < 1e-10, "{:?}", e.impacts());
    assert!((e.switches()[1].t - events[1]).abs() < 1e-10, "{:?}", e.switches());
    assert_eq!(e.switches().iter().map(|s| s.after[0]).collect::<Vec<_>>(), [1, 2]);
    // to the landing, along the velocity for a nanosecond
    let landing: Vec<f64> = e.state().iter().zip(e.derivative()).map(|(x, f)| x + 1e-9 * f).collect();
    assert!(off(&landing, &numbers(&r["x_T"])) < 1e-10, "{landing:?}");
    e.advance(0.45).unwrap();
    println!("{:?} {:?} {:?} {}", e.impacts(), e.switches(), e.state(), e.reason());
    let dt: Vec<f64> = e.switches()[..2].iter().flat_map(|s| s.dt.clone()).collect();
    assert!(off(&dt, &numbers(&r["dtimes_dx0"])[..12]) < 1e-8, "{dt:?}");
}

/// A block rocks from corner to corner.
#[test]
fn a_block_rocks() {
    let r = &reference("rocking_block.json")["slender"];
    let (b, h) = (number(&r["b"]), number(&r["h"]));
    let (th, t) = (numbers(&r["x0"])[0], number(&r["T"]));
    // the file counts angles clockwise
    let th0 = -th;
    let y0 = -(b * th0.sin() - h * th0.cos());
    let e = run(&block(b, h, 10.0), 1e-11, &[0.0, y0, th0, 0.0, 0.0, 0.0], &[], t);
    println!("{:?} {:?}", e.impacts(), e.state());
    let want = numbers(&r["th_w_T"]);
    let own = [-e.state()[2], -e.state()[5]];
    assert!(off(&own, &want) < 1e-9, "{own:?} {want:?}");
    let times: Vec<f64> = r["impacts"].as_array().unwrap().iter().map(|i| number(&i["t"])).collect();
    let mut own: Vec<f64> = e.impacts().iter().map(|i| i.t).collect();
    own.dedup();
    assert!(off(&own, &times) < 1e-10, "{own:?} {times:?}");
}

/// Impacts on a table accumulate, the ball rests, and leaves with the table.
#[test]
fn chattering_ends_and_the_ball_leaves() {
    let r = reference("table_chatter.json");
    let s = table(number(&r["A"]), number(&r["w"]), number(&r["e"]));
    for k in [6, 8, 10, 12] {
        let rtol = 10f64.powi(-k);
        let e = run(&s, rtol, &numbers(&r["x0"]), &[], number(&r["T"]));
        let error = off(e.state(), &numbers(&r["x_T"]));
        let first = numbers(&r["first_impacts"]);
        let worst = first.iter().zip(e.impacts()).fold(0.0f64, |m, (a, b)| m.max((a - b.t).abs()));
        let log = r["log"].as_array().unwrap();
        let limit = (e.accumulations().last().unwrap().t - number(&log[0][0])).abs();
        let leaves = (e.switches().last().unwrap().t - number(&log[1][0])).abs();
        println!(
            "{rtol:.0e}: {error:.1e} impacts {worst:.1e} limit {limit:.1e} leaves {leaves:.1e} n {}",
            e.impacts().len()
        );
        assert!(error <= 100.0 * rtol && limit <= 100.0 * rtol && leaves <= 100.0 * rtol, "{:?}", e.accumulations());
    }
}

/// Derivatives grow like the square root of the depth of grazing.
#[test]
fn grazing() {
    let r = reference("grazing.json");
    let (s, a) = (impact_oscillator(0.1, 1.0, 1.2, 0.7), number(&r["steady_amplitude"]));
    for row in r["rows"].as_array().unwrap() {
        let depth = number(&row["stop_below_amplitude"]);
        let e = run(&s, 1e-13, &numbers(&r["x0_on_steady_state"]), &[a - depth], 6.0);
        let own: Vec<f64> = (0..2).flat_map(|i| e.sensitivity().unwrap()[i * 3..i * 3 + 2].to_vec()).collect();
        assert!(off(e.state(), &numbers(&row["x_T6"])) < 1e-11, "{depth}: {:?}", e.state());
        // the derivatives magnify rounding of the impact speed, which is the root of the depth
        assert!(off(&own, &numbers(&row["dxT_dx0"])) < 1e-13 / depth.sqrt() * 100.0, "{depth}: {own:?}");
        assert!((e.impacts()[0].depth / depth - 1.0).abs() < 0.2, "{:?}", e.impacts());
    }
}

/// A disc hits a stack of nineteen: the first three impacts with all impulses.
#[test]
fn pile_of_twenty() {
    let r = reference("pile_of_20.json");
    let mut x0: Vec<f64> = (0..19).flat_map(|i| [0.0, 0.2 + 0.4 * f64::from(i)]).collect();
    x0.extend([-2.2, 7.4]);
    x0.extend((0..40).map(|k| if k == 38 { 10.0 } else { 0.0 }));
    let mut e = Engine::new(&discs(20, 0.2), &Options::with_tolerance(1e-11, 1e-12)).unwrap();
    e.reinit(0.0, &x0).unwrap();
    assert_eq!(e.advance(0.31).unwrap(), Outcome::Reached, "{}", e.reason());
    let mut impacts = e.impacts().iter();
    for event in r["events"].as_array().unwrap() {
        let mut expected: Vec<f64> = event["impulses"].as_object().unwrap().values().map(number).collect();
        let mut own: Vec<f64> = impacts
            .by_ref()
            .take(expected.len())
            .map(|i| {
                assert!((i.t - number(&event["t"])).abs() < 1e-10, "{i:?}");
                i.impulse[0]
            })
            .collect();
        expected.sort_by(f64::total_cmp);
        own.sort_by(f64::total_cmp);
        assert!(off(&own, &expected) < 1e-10, "{own:?} {expected:?}");
    }
    assert!(e.stats().evaluations < 2000, "{:?}", e.stats());
}

/// The play operator as a sweeping process: the output follows the input with slack.
#[test]
fn play_follows_its_input() {
    let r = reference("play.json");
    let g = Graph::new();
    let (y, input) = (g.x(0), 2.0 * g.t().sin());
    let mut s = Scene::projected("play", 1, 0, 0).unwrap();
    s.set_force(0, g.constant(0.0).id()).unwrap();
    s.add_contact(Contact::new(&g, "upper", input - y + 0.5)).unwrap();
    s.add_contact(Contact::new(&g, "lower", y - input + 0.5)).unwrap();
    let system = s.build(&g).unwrap().system;
    for k in [4, 8, 12] {
        let rtol = 10f64.powi(-k);
        let mut o = Options::with_tolerance(rtol, rtol);
        (o.dense, o.sensitivity) = (true, true.into());
        let mut e = Engine::new(&system, &o).unwrap();
        e.reinit(0.0, &[0.0]).unwrap();
        e.advance(6.0).unwrap();
        assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
        let times: Vec<f64> = e.switches().iter().map(|s| s.t).collect();
        println!("{times:?} {:?}", e.stats());
        assert!(off(&times, &numbers(&r["switches"])) <= 100.0 * rtol);
        for at in r["y_at"].as_array().unwrap() {
            let mut x = [0.0];
            e.path().unwrap().eval(number(&at[0]), 0, &mut x).unwrap();
            assert!((x[0] - number(&at[1])).abs() <= 100.0 * rtol, "{} {x:?} {at}", rtol);
        }
        // where the input drags the output along, the start is forgotten
        assert!(e.sensitivity().unwrap()[0].abs() < 1e-12);
    }
    // the loop in the plane of input and output, once the start is forgotten: the integral of y over x
    let mut e = Engine::new(&system, &Options { dense: true, ..Options::with_tolerance(1e-10, 1e-10) }).unwrap();
    e.reinit(0.0, &[0.0]).unwrap();
    e.advance(4.0 * std::f64::consts::PI).unwrap();
    let n = 20_000;
    let period = 2.0 * std::f64::consts::PI;
    let area: f64 = (0..n)
        .map(|k| {
            let t = period * (1.0 + (f64::from(k) + 0.5) / f64::from(n));
            let mut y = [0.0];
            e.path().unwrap().eval(t, 0, &mut y).unwrap();
            y[0] * 2.0 * t.cos() * period / f64::from(n)
        })
        .sum();
    assert!((area.abs() - number(&r["loop_area"])).abs() < 1e-6, "{area}");
}

/// Error against work through impacts, phases of contact and changes between sliding and sticking: the slopes are the orders
/// of the methods.
#[test]
fn methods_keep_their_order_through_contacts() {
    let cases = [
        ("oscillator", impact_oscillator(0.1, 1.0, 1.2, 0.7), vec![-1.75, 1.15], vec![1.2], 60.0),
        ("slope", slope(0.35, 0.5, 3.0, 5.0), vec![0.0, 0.4, 0.5, 0.0], vec![], 20.0),
    ];
    for (name, system, x0, p, t) in &cases {
        let solve = |method: Method, rtol: f64| {
            let o = Options { method, ..Options::with_tolerance(rtol, rtol) };
            let mut e = Engine::new(system, &o).unwrap();
            e.reinit(0.0, x0).unwrap();
            e.set_params(p).unwrap();
            assert_eq!(e.advance(*t).unwrap(), Outcome::Reached, "{}", e.reason());
            (e.state().to_vec(), e.stats().steps, e.impacts().len() + e.switches().len())
        };
        let exact = solve(Method::Dop853, 1e-14);
        assert!(exact.2 > 8, "{name}: {} events", exact.2);
        for (method, order, from, to) in
            [(Method::Dp5, 5.0, 4, 9), (Method::Dop853, 8.0, 5, 12), (Method::Radau5, 5.0, 5, 10)]
        {
            let points: Vec<(f64, f64)> = (from..=to)
                .map(|k| {
                    let (x, steps, events) = solve(method, 10f64.powi(-k));
                    assert_eq!(events, exact.2, "{name} {method:?} 1e-{k}");
                    ((steps as f64).ln(), off(&x, &exact.0).max(1e-16).ln())
                })
                .collect();
            let n = points.len() as f64;
            let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), p| (a + p.0 / n, b + p.1 / n));
            let (sxy, sxx) =
                points.iter().fold((0.0, 0.0), |(a, b), p| (a + (p.0 - mx) * (p.1 - my), b + (p.0 - mx) * (p.0 - mx)));
            println!("{name} {method:?}: {:.2} {points:?}", -sxy / sxx);
            assert!(-sxy / sxx > order - 0.6, "{name} {method:?}: slope {:.2} {points:?}", -sxy / sxx);
        }
    }
}
