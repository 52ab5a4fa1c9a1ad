//! Problems of optimal control with contacts.

use std::sync::Arc;
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::ocp::{Jumps, Ocp};
use switchback::scene::{Contact, Scene};
use switchback::settings::Settings;

pub const G: f64 = 9.81;

/// A point mass above a floor with friction, pushed along it: Example 8.19.
pub fn puck(mu: f64) -> (Graph, switchback::system::System) {
    puck_between(0, mu)
}

/// The same with walls in a row at x = 5, 6 and so on, which it does not come near: it is said to stay between -1 and 4.
pub fn puck_between(walls: usize, mu: f64) -> (Graph, switchback::system::System) {
    let g = Graph::new();
    let (x, y, u) = (g.x(0), g.x(1), g.u(0));
    let mut scene = Scene::new("puck", 2, 2, 1, 0).unwrap();
    scene.set_force(0, u.id()).unwrap();
    scene.set_force(1, g.constant(-G).id()).unwrap();
    let (mu, tangents) = (g.constant(mu).id(), vec![x.id()]);
    scene.add_contact(Contact { friction: mu, tangents, ..Contact::new(&g, "floor", y) }).unwrap();
    for i in 0..walls {
        scene.add_contact(Contact::new(&g, &format!("wall {i}"), -x + (5.0 + i as f64))).unwrap();
    }
    scene.set_bounds(0, -1.0, 4.0).unwrap();
    let system = scene.build(&g).unwrap().system;
    (g, system)
}

/// Example 8.19: from (0, 1) at rest to (3, 0) at rest in 2 s, force at most 10, cost u².
pub fn example_819(method: Jumps) -> Ocp {
    example_819_between(0, method)
}

/// The same with so many walls out of reach.
pub fn example_819_between(walls: usize, method: Jumps) -> Ocp {
    let (g, system) = puck_between(walls, 0.6);
    let mut settings = Settings::default();
    settings.set_by_name("n_s", 2i64).unwrap();
    settings.set_by_name("n_fe", 1i64).unwrap();
    let mut ocp = Ocp::new(&system, 2.0, 20, &settings).unwrap();
    ocp.set_x0(&[0.0, 1.0, 0.0, 0.0]).unwrap();
    ocp.set_u_bounds(&[-10.0], &[10.0]).unwrap();
    let d = Dims { x: 4, u: 1, p: 0 };
    ocp.set_lagrange(Arc::new(g.function("cost", d, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    let end = g.function("end", d, &[g.x(0), g.x(1), g.x(2), g.x(3)]).unwrap();
    ocp.add_terminal(Arc::new(end), &[3.0, 0.0, 0.0, 0.0], &[3.0, 0.0, 0.0, 0.0]).unwrap();
    ocp.set_jumps(method);
    ocp
}

/// Three carts in a row, of which the first is driven: it is to be back at 0 after three seconds, and the third at 3.
pub fn three_carts() -> Ocp {
    let g = Graph::new();
    let (a, b, c) = (g.x(0), g.x(1), g.x(2));
    let mut scene = Scene::new("three carts", 3, 3, 1, 0).unwrap();
    for (i, (drag, push)) in [(0.1, g.u(0)), (0.3, g.constant(0.0)), (0.3, g.constant(0.0))].into_iter().enumerate() {
        scene.set_force(i, (push - g.x(3 + i) * drag).id()).unwrap();
    }
    for (name, gap, e) in [("1-2", b - a - 0.2, 0.9), ("2-3", c - b - 0.2, 0.3)] {
        scene.add_contact(Contact { restitution: g.constant(e).id(), ..Contact::new(&g, name, gap) }).unwrap();
    }
    let built = scene.build(&g).unwrap();
    let settings = Settings { n_s: 2, n_fe: 2, ..Settings::default() };
    let mut ocp = Ocp::new(&built.system, 3.0, 15, &settings).unwrap();
    ocp.set_x0(&[0.0, 1.0, 2.0, 0.0, 0.0, 0.0]).unwrap();
    ocp.set_u_bounds(&[-20.0], &[20.0]).unwrap();
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    ocp.add_terminal(Arc::new(g.function("end", built.dims, &[a, c]).unwrap()), &[0.0, 3.0], &[0.0, 3.0]).unwrap();
    ocp
}

/// A ball on a string that can only pull, below a cup that is driven: it is to be 0.1 above the cup after 1.5 seconds.
pub fn ball_in_cup() -> Ocp {
    let g = Graph::new();
    let (cx, cy, x, y) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let mut scene = Scene::new("ball in cup", 4, 4, 2, 0).unwrap();
    let (zero, mass) = (g.constant(0.0).id(), [1.0, 1.0, 0.1, 0.1]);
    let inertia: Vec<_> = (0..16).map(|k| if k % 5 == 0 { g.constant(mass[k / 5]).id() } else { zero }).collect();
    scene.set_inertia(&inertia).unwrap();
    for (i, f) in [g.u(0), g.u(1), g.constant(0.0), g.constant(-0.1 * G)].into_iter().enumerate() {
        scene.set_force(i, f.id()).unwrap();
    }
    let slack = -(x - cx).powi(2) - (y - cy).powi(2) + 0.25;
    scene.add_contact(Contact::new(&g, "string", slack)).unwrap();
    let built = scene.build(&g).unwrap();
    let settings = Settings { n_s: 2, n_fe: 2, ..Settings::default() };
    let mut ocp = Ocp::new(&built.system, 1.5, 15, &settings).unwrap();
    ocp.set_x0(&[0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 0.0]).unwrap();
    ocp.set_u_bounds(&[-15.0; 2], &[15.0; 2]).unwrap();
    let effort = g.u(0) * g.u(0) + g.u(1) * g.u(1);
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[effort]).unwrap())).unwrap();
    let end = g.function("end", built.dims, &[x - cx, y - cy]).unwrap();
    ocp.add_terminal(Arc::new(end), &[0.0, 0.1], &[0.0, 0.1]).unwrap();
    ocp
}

/// A crate on a floor with friction is to be half a unit behind its start, at rest. It is held by more than what may push it back, so that
/// only a wall in front, from which it bounces off, brings it there.
pub fn thrown_crate() -> Ocp {
    thrown_crate_in(1.0)
}

/// The same where one metre is `unit` units of length.
pub fn thrown_crate_in(unit: f64) -> Ocp {
    let g = Graph::new();
    let (x, y, u) = (g.x(0), g.x(1), g.u(0));
    let mut scene = Scene::new("crate", 2, 2, 1, 0).unwrap();
    scene.set_force(0, u.id()).unwrap();
    scene.set_force(1, g.constant(-G * unit).id()).unwrap();
    let (friction, tangents) = (g.constant(0.2).id(), vec![x.id()]);
    scene.add_contact(Contact { friction, tangents, ..Contact::new(&g, "floor", y) }).unwrap();
    scene.add_contact(Contact { restitution: g.constant(0.6).id(), ..Contact::new(&g, "wall", -x + unit) }).unwrap();
    let built = scene.build(&g).unwrap();
    let mut ocp = Ocp::new(&built.system, 2.0, 20, &Settings { n_s: 2, n_fe: 2, ..Settings::default() }).unwrap();
    ocp.set_x0(&[0.0; 4]).unwrap();
    ocp.set_u_bounds(&[-1.5 * unit], &[8.0 * unit]).unwrap();
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[u * u]).unwrap())).unwrap();
    let end = g.function("end", built.dims, &[x, g.x(2)]).unwrap();
    ocp.add_terminal(Arc::new(end), &[-0.5 * unit, 0.0], &[-0.5 * unit, 0.0]).unwrap();
    ocp
}
