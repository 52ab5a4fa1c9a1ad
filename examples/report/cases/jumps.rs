//! Optimal control of scenes: gallery problems by every search, and the order of contact mode programs on a curved floor.

use super::short;
use crate::json::{Object, Table};
use crate::Context;
use std::sync::Arc;
use std::time::Instant;
use switchback::event::{simulate, Options};
use switchback::expr::Graph;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Jumps, Ocp};
use switchback::scene::{Contact, Scene};
use switchback::settings::Settings;

const G: f64 = 9.81;
/// Seconds a problem gets.
const MOST_TIME: f64 = 60.0;

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

/// A problem by name, and its exact cost where that is known.
type Entry = (&'static str, fn() -> Ocp, f64);

pub fn run(c: &Context) {
    let problems: [Entry; 4] = [
        ("example 8.19", puck, 72.639_278_346_280_52),
        ("ball in a box, 2", || ball_in_box(2.0), f64::NAN),
        ("ball in a box, 3", || ball_in_box(3.0), f64::NAN),
        ("two carts", two_carts, f64::NAN),
    ];
    let mut table =
        Table::new(&["problem", "search", "outcome", "cost", "error", "impacts", "replay", "tried", "iterations", "s"]);
    for (name, problem, exact) in problems {
        for (search, jumps) in [("auto", Jumps::Auto), ("modes", Jumps::Modes), ("fesd_j", Jumps::FesdJ)] {
            let mut ocp = problem();
            ocp.set_jumps(jumps);
            let clock = Instant::now();
            let r = ocp.solve(&mut Control::default()).expect("solve");
            let seconds = clock.elapsed().as_secs_f64();
            let (impacts, tried) = r.contacts.as_ref().map_or((0, 0), |c| (c.impacts.len(), c.tried));
            let replay = r.accuracy.as_ref().map_or(f64::NAN, |a| a.terminal);
            let o = Object::new().text("case", "jumps").text("problem", name).text("search", search);
            c.record(
                &o.text("outcome", r.outcome.name())
                    .num("cost", r.cost)
                    .num("cost_error", r.cost - exact)
                    .int("impacts", impacts)
                    .num("replay", replay)
                    .int("tried", tried)
                    .int("iterations", r.stats.iterations)
                    .int("variables", r.dimensions.0)
                    .int("pairs", r.dimensions.2)
                    .num("wall_s", seconds),
            );
            table.row(vec![
                name.into(),
                search.into(),
                r.outcome.name().into(),
                format!("{:.10}", r.cost),
                short(r.cost - exact),
                impacts.to_string(),
                short(replay),
                tried.to_string(),
                r.stats.iterations.to_string(),
                format!("{seconds:.2}"),
            ]);
        }
    }
    c.say(&table.text());
    orders(c);
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
