//! Optimal control of scenes: gallery problems by every search, and the order of contact mode programs on a curved floor.

use super::short;
use crate::json::{Object, Table};
use crate::Context;
use std::sync::Arc;
use std::time::Instant;
use switchback::error::Error;
use switchback::event::{simulate, Options};
use switchback::expr::Graph;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Jumps, Ocp};
use switchback::scene::{Contact, Scene};
use switchback::settings::Settings;

const G: f64 = 9.81;
/// Seconds a problem gets.
const MOST_TIME: f64 = 20.0;
/// Guesses of the controls each search starts from: none, and controls at random within this share of their bounds.
const STARTS: usize = 5;
const SHARE: f64 = 0.3;

fn settings(n_s: i64, n_fe: i64) -> Settings {
    Settings { n_s, n_fe, max_time: MOST_TIME, ..Settings::default() }
}

/// Example 8.19; its optimum is known exactly.
fn puck() -> Ocp {
    let g = Graph::new();
    let (x, y, u) = (g.x(0), g.x(1), g.u(0));
    let mut scene = Scene::new("puck", 2, 2, 1, 0).expect("sizes");
    scene.set_force(0, u.id()).expect("force");
    scene.set_force(1, g.constant(-G).id()).expect("force");
    let (friction, tangents) = (g.constant(0.6).id(), vec![x.id()]);
    scene.add_contact(Contact { friction, tangents, ..Contact::new(&g, "floor", y) }).expect("contact");
    let built = scene.build(&g).expect("scene");
    let mut ocp = Ocp::new(&built.system, 2.0, 20, &settings(2, 1)).expect("problem");
    ocp.set_x0(&[0.0, 1.0, 0.0, 0.0]).expect("start");
    ocp.set_u_bounds(&[-10.0], &[10.0]).expect("bounds");
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[u * u]).expect("cost"))).expect("cost");
    let end = g.function("end", built.dims, &[x, y, g.x(2), g.x(3)]).expect("end");
    ocp.add_terminal(Arc::new(end), &[3.0, 0.0, 0.0, 0.0], &[3.0, 0.0, 0.0, 0.0]).expect("end");
    ocp
}

/// Section 8.6.1: a ball in a box tracks a circle, `turns` half turns a second.
fn ball_in_box(turns: f64) -> Ocp {
    use std::f64::consts::{FRAC_PI_4, PI};
    let g = Graph::new();
    let (x, y, t) = (g.x(0), g.x(1), g.t());
    let mut scene = Scene::new("ball in a box", 2, 2, 2, 0).expect("sizes");
    scene.set_force(0, g.u(0).id()).expect("force");
    scene.set_force(1, g.u(1).id()).expect("force");
    let restitution = g.constant(1.0).id();
    let walls = [("bottom", y + 1.05), ("right", -x + 1.1), ("top", -y + 1.15), ("left", x + 1.2)];
    for (name, gap) in walls {
        scene.add_contact(Contact { restitution, ..Contact::new(&g, name, gap) }).expect("contact");
    }
    let built = scene.build(&g).expect("scene");
    let w = -turns * PI;
    let mut ocp = Ocp::new(&built.system, 4.0 * PI / w.abs(), 40, &settings(2, 1)).expect("problem");
    let (s, c) = FRAC_PI_4.sin_cos();
    ocp.set_x0(&[s, c, w * c, -w * s]).expect("start");
    ocp.set_u_bounds(&[-50.0; 2], &[50.0; 2]).expect("bounds");
    let angle = t * w + FRAC_PI_4;
    let off = (x - angle.sin()).powi(2) + (y - angle.cos()).powi(2);
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[off]).expect("cost"))).expect("cost");
    let thrust = g.function("thrust", built.dims, &[g.u(0) * g.u(0) + g.u(1) * g.u(1)]).expect("thrust");
    let at = switchback::fesd::PathAt::ControlGrid;
    ocp.add_path(Arc::new(thrust), &[f64::NEG_INFINITY], &[2500.0], at).expect("thrust");
    ocp
}

/// The first of two carts is driven and hits the second.
fn two_carts() -> Ocp {
    let g = Graph::new();
    let (a, b, u) = (g.x(0), g.x(1), g.u(0));
    let mut scene = Scene::new("two carts", 2, 2, 1, 0).expect("sizes");
    let (one, two, zero) = (g.constant(1.0).id(), g.constant(2.0).id(), g.constant(0.0).id());
    scene.set_inertia(&[one, zero, zero, two]).expect("inertia");
    scene.set_force(0, (u - g.x(2) * 0.1).id()).expect("force");
    scene.set_force(1, (g.x(3) * -0.5).id()).expect("force");
    let restitution = g.constant(0.5).id();
    scene.add_contact(Contact { restitution, ..Contact::new(&g, "carts", b - a - 0.2) }).expect("contact");
    let built = scene.build(&g).expect("scene");
    let mut ocp = Ocp::new(&built.system, 3.0, 15, &settings(2, 2)).expect("problem");
    ocp.set_x0(&[0.0, 1.0, 0.0, 0.0]).expect("start");
    ocp.set_u_bounds(&[-20.0], &[20.0]).expect("bounds");
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[u * u]).expect("cost"))).expect("cost");
    let end = g.function("end", built.dims, &[a, b]).expect("end");
    ocp.add_terminal(Arc::new(end), &[0.0, 2.0], &[0.0, 2.0]).expect("end");
    ocp
}

/// Three carts in a row: the first is driven and to be back, the last is to be one further.
fn three_carts() -> Ocp {
    let g = Graph::new();
    let (a, b, c) = (g.x(0), g.x(1), g.x(2));
    let mut scene = Scene::new("three carts", 3, 3, 1, 0).expect("sizes");
    scene.set_force(0, (g.u(0) - g.x(3) * 0.1).id()).expect("force");
    scene.set_force(1, (g.x(4) * -0.3).id()).expect("force");
    scene.set_force(2, (g.x(5) * -0.3).id()).expect("force");
    for (name, gap, e) in [("1-2", b - a - 0.2, 0.9), ("2-3", c - b - 0.2, 0.3)] {
        let restitution = g.constant(e).id();
        scene.add_contact(Contact { restitution, ..Contact::new(&g, name, gap) }).expect("contact");
    }
    let built = scene.build(&g).expect("scene");
    let mut ocp = Ocp::new(&built.system, 3.0, 15, &settings(2, 2)).expect("problem");
    ocp.set_x0(&[0.0, 1.0, 2.0, 0.0, 0.0, 0.0]).expect("start");
    ocp.set_u_bounds(&[-20.0], &[20.0]).expect("bounds");
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[g.u(0) * g.u(0)]).expect("cost"))).expect("cost");
    let end = g.function("end", built.dims, &[a, c]).expect("end");
    ocp.add_terminal(Arc::new(end), &[0.0, 3.0], &[0.0, 3.0]).expect("end");
    ocp
}

/// A pusher gives a box on a rough table a push; friction alone stops it after one meter.
fn push_box() -> Ocp {
    let g = Graph::new();
    let (pusher, x, y) = (g.x(0), g.x(1), g.x(2));
    let mut scene = Scene::new("push box", 3, 3, 1, 0).expect("sizes");
    scene.set_force(0, g.u(0).id()).expect("force");
    scene.set_force(1, g.constant(0.0).id()).expect("force");
    scene.set_force(2, g.constant(-G).id()).expect("force");
    scene.add_contact(Contact::new(&g, "pusher", x - pusher - 0.1)).expect("contact");
    let (friction, tangents) = (g.constant(0.3).id(), vec![x.id()]);
    scene.add_contact(Contact { friction, tangents, ..Contact::new(&g, "table", y) }).expect("contact");
    let built = scene.build(&g).expect("scene");
    let mut ocp = Ocp::new(&built.system, 2.0, 16, &settings(2, 2)).expect("problem");
    ocp.set_x0(&[-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("start");
    ocp.set_u_bounds(&[-20.0], &[20.0]).expect("bounds");
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[g.u(0) * g.u(0)]).expect("cost"))).expect("cost");
    let end = g.function("end", built.dims, &[x, g.x(4)]).expect("end");
    ocp.add_terminal(Arc::new(end), &[1.0, 0.0], &[1.0, 0.0]).expect("end");
    ocp
}

/// A ball on a string that only pulls, below a cup that is driven: it is to be above the cup at the end.
fn ball_in_cup() -> Ocp {
    let g = Graph::new();
    let (cx, cy, x, y) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let mut scene = Scene::new("ball in cup", 4, 4, 2, 0).expect("sizes");
    let mass = [1.0, 1.0, 0.1, 0.1];
    let entry = |k: usize| g.constant(if k % 5 == 0 { mass[k / 5] } else { 0.0 }).id();
    scene.set_inertia(&(0..16).map(entry).collect::<Vec<_>>()).expect("inertia");
    scene.set_force(0, g.u(0).id()).expect("force");
    scene.set_force(1, g.u(1).id()).expect("force");
    scene.set_force(2, g.constant(0.0).id()).expect("force");
    scene.set_force(3, g.constant(-0.1 * G).id()).expect("force");
    let slack = -(x - cx).powi(2) - (y - cy).powi(2) + 0.25;
    scene.add_contact(Contact::new(&g, "string", slack)).expect("contact");
    let built = scene.build(&g).expect("scene");
    let mut ocp = Ocp::new(&built.system, 1.5, 15, &settings(2, 2)).expect("problem");
    ocp.set_x0(&[0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0]).expect("start");
    ocp.set_u_bounds(&[-15.0; 2], &[15.0; 2]).expect("bounds");
    let effort = g.u(0) * g.u(0) + g.u(1) * g.u(1);
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[effort]).expect("cost"))).expect("cost");
    let end = g.function("end", built.dims, &[x - cx, y - cy]).expect("end");
    ocp.add_terminal(Arc::new(end), &[0.0, 0.1], &[0.0, 0.1]).expect("end");
    ocp
}

/// A cart with a pole between two walls that the tip may lean against: from off upright back to it, with little force.
fn cart_pole() -> Ocp {
    let (cart, tip, l) = (1.0, 0.2, 0.5);
    let g = Graph::new();
    let (x, angle, rate) = (g.x(0), g.x(1), g.x(3));
    let mut scene = Scene::new("cart-pole with walls", 2, 2, 1, 0).expect("sizes");
    let coupling = (angle.cos() * (tip * l)).id();
    let diagonal = [g.constant(cart + tip).id(), g.constant(tip * l * l).id()];
    scene.set_inertia(&[diagonal[0], coupling, coupling, diagonal[1]]).expect("inertia");
    scene.set_force(0, (g.u(0) + angle.sin() * rate * rate * (tip * l)).id()).expect("force");
    scene.set_force(1, (angle.sin() * (tip * l * G)).id()).expect("force");
    let reach = x + angle.sin() * l;
    scene.add_contact(Contact::new(&g, "left", reach + 0.3)).expect("contact");
    scene.add_contact(Contact::new(&g, "right", -reach + 0.3)).expect("contact");
    let built = scene.build(&g).expect("scene");
    let mut ocp = Ocp::new(&built.system, 2.0, 20, &settings(2, 2)).expect("problem");
    ocp.set_x0(&[0.0, 0.3, 0.0, 0.5]).expect("start");
    ocp.set_u_bounds(&[-3.0], &[3.0]).expect("bounds");
    let cost = g.u(0) * g.u(0) + angle * angle * 10.0 + x * x;
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[cost]).expect("cost"))).expect("cost");
    let end = g.function("end", built.dims, &[x, angle, g.x(2), rate]).expect("end");
    ocp.add_terminal(Arc::new(end), &[0.0; 4], &[0.0; 4]).expect("end");
    ocp
}

/// A point that falls into a parabola, with friction or restitution, without controls: the difference from the event engine.
fn on_a_curve(mu: f64, e: f64, n_s: i64, n: usize) -> f64 {
    let g = Graph::new();
    let (x, y, vx, vy) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let length = (x * x * 0.36 + 1.0).sqrt();
    let mut scene = Scene::new("bowl", 2, 2, 0, 0).expect("sizes");
    scene.set_force(0, (vx * -0.1).id()).expect("force");
    scene.set_force(1, (vy * -0.1 - G).id()).expect("force");
    let contact = Contact {
        friction: g.constant(mu).id(),
        restitution: g.constant(e).id(),
        tangents: vec![((vx + x * vy * 0.6) / length).id()],
        ..Contact::new(&g, "bowl", (y - x * x * 0.3) / length)
    };
    scene.add_contact(contact).expect("contact");
    let system = scene.build(&g).expect("scene").system;
    let (x0, t_end) = ([-0.8, 0.5, 0.3, 0.0], 0.6);
    let mut ocp = Ocp::new(&system, t_end, n, &settings(n_s, 1)).expect("problem");
    ocp.set_x0(&x0).expect("start");
    ocp.set_jumps(Jumps::Modes);
    let r = ocp.solve(&mut Control::default()).expect("solve");
    let exact = simulate(&system, &Options::with_tolerance(1e-12, 1e-13), 0.0, &x0, t_end).expect("simulation");
    match r.trajectory.elements.last() {
        Some(last) if r.outcome == Outcome::Solved => {
            exact.x.iter().zip(&last.x1).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
        }
        _ => f64::NAN,
    }
}

/// A problem by name, with its control stages, the bounds of its controls, and its exact cost where that is known.
struct Entry {
    name: &'static str,
    build: fn() -> Ocp,
    stages: usize,
    most: &'static [f64],
    exact: f64,
}

const PROBLEMS: [Entry; 8] = [
    Entry { name: "push box", build: push_box, stages: 16, most: &[20.0], exact: f64::NAN },
    Entry { name: "ball in cup", build: ball_in_cup, stages: 15, most: &[15.0; 2], exact: f64::NAN },
    Entry { name: "cart-pole, walls", build: cart_pole, stages: 20, most: &[3.0], exact: f64::NAN },
    Entry { name: "example 8.19", build: puck, stages: 20, most: &[10.0], exact: 72.639_278_346_280_52 },
    Entry { name: "two carts", build: two_carts, stages: 15, most: &[20.0], exact: f64::NAN },
    Entry { name: "three carts", build: three_carts, stages: 15, most: &[20.0], exact: f64::NAN },
    Entry { name: "ball in a box, 2", build: || ball_in_box(2.0), stages: 40, most: &[50.0; 2], exact: f64::NAN },
    Entry { name: "ball in a box, 3", build: || ball_in_box(3.0), stages: 40, most: &[50.0; 2], exact: f64::NAN },
];

const SEARCHES: [(&str, Jumps); 6] = [
    ("auto", Jumps::Auto),
    ("modes", Jumps::Modes),
    ("steps", Jumps::Steps),
    ("shots", Jumps::Shots),
    ("fesd_j", Jumps::FesdJ),
    ("freezing", Jumps::Freezing),
];

/// Controls at random, the same for the same number.
fn guess(e: &Entry, number: usize) -> Vec<f64> {
    // the generator of Knuth's MMIX; the upper bits are the better ones
    let mut state = number as u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..e.stages).flat_map(|_| e.most.iter()).map(|most| SHARE * most * next()).collect()
}

pub fn run(c: &Context) {
    let columns = ["problem", "search", "solved", "least cost", "most", "replay", "iterations", "s", "first s"];
    let mut table = Table::new(&columns);
    for e in &PROBLEMS {
        for (search, jumps) in SEARCHES {
            table.row(starts(c, e, search, jumps));
        }
    }
    c.say(&table.text());
    orders(c);
}

/// One search from all starts: a row of the table, medians where one number stands for several.
fn starts(c: &Context, e: &Entry, search: &str, jumps: Jumps) -> Vec<String> {
    let (mut costs, mut iterations, mut seconds, mut worst) = (Vec::new(), Vec::new(), Vec::new(), 0f64);
    for start in 0..STARTS {
        let mut ocp = (e.build)();
        ocp.set_jumps(jumps);
        if start > 0 {
            ocp.set_u_guess(&guess(e, start)).expect("guess");
        }
        let clock = Instant::now();
        let solved = ocp.solve(&mut Control::default());
        seconds.push(clock.elapsed().as_secs_f64());
        let o = Object::new().text("case", "jumps").text("problem", e.name).text("search", search).int("start", start);
        // a start whose time is over without anything found counts as unsolved
        let r = match solved {
            Err(Error::OutOfTime) => {
                c.record(&o.text("outcome", "out_of_time").num("wall_s", seconds[start]));
                continue;
            }
            r => r.expect("solve"),
        };
        iterations.push(r.stats.iterations as f64);
        let (impacts, tried) = r.contacts.as_ref().map_or((0, 0), |c| (c.impacts.len(), c.tried));
        let replay = r.accuracy.as_ref().map_or(f64::NAN, |a| a.terminal);
        if r.outcome == Outcome::Solved {
            costs.push(r.cost);
            worst = worst.max(replay);
        }
        c.record(
            &o.text("outcome", r.outcome.name())
                .num("cost", r.cost)
                .num("cost_error", r.cost - e.exact)
                .int("impacts", impacts)
                .num("replay", replay)
                .int("tried", tried)
                .int("iterations", r.stats.iterations)
                .int("variables", r.dimensions.0)
                .int("pairs", r.dimensions.2)
                .num("wall_s", seconds[start]),
        );
    }
    let first = seconds[0];
    let median = |v: &mut Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let least = costs.iter().copied().fold(f64::NAN, f64::min);
    let most = costs.iter().copied().fold(f64::NAN, f64::max);
    vec![
        e.name.into(),
        search.into(),
        format!("{} of {STARTS}", costs.len()),
        format!("{least:.9}"),
        format!("{most:.9}"),
        short(worst),
        format!("{:.0}", median(&mut iterations)),
        format!("{:.2}", median(&mut seconds)),
        format!("{first:.2}"),
    ]
}

/// Errors of contact mode programs on a curved floor, and their slopes.
fn orders(c: &Context) {
    let mut table = Table::new(&["curved floor", "stage points", "stages", "error", "slope"]);
    for (what, mu, e) in [("lands and slides", 0.2, 0.0), ("bounces", 0.0, 0.8)] {
        for (n_s, grid) in [(1, [32, 64, 128]), (2, [8, 16, 32]), (3, [4, 8, 16])] {
            let mut last = f64::NAN;
            for n in grid {
                let error = on_a_curve(mu, e, n_s, n);
                let slope = (last / error).log2();
                last = error;
                let o = Object::new().text("case", "jumps").text("problem", what).int("stage_points", n_s as usize);
                c.record(&o.int("stages", n).num("error", error).num("slope", slope));
                table.row(vec![what.into(), n_s.to_string(), n.to_string(), short(error), format!("{slope:.2}")]);
            }
        }
    }
    c.say(&table.text());
}
