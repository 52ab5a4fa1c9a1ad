//! Optimal control of scenes: contacts, impacts, friction.

use std::sync::Arc;
use switchback::event::{simulate, Options};
use switchback::expr::Graph;
use switchback::fesd::Durations;
use switchback::func::Dims;
use switchback::jumps::ContactMode;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Jumps, Ocp, OcpResult, Verdict};
use switchback::scene::{Contact, Scene};
use switchback::settings::Settings;

#[path = "common/contacts.rs"]
mod contacts;
use contacts::{ball_in_cup, example_819, example_819_between, puck, three_carts, thrown_crate, thrown_crate_in, G};

/// Exact optimum over controls that are constant on 20 equal intervals: the block stops in interval 16 and sticks.
/// Multiprecision, from the equations of sliding alone.
const J_819: f64 = 72.639_278_346_280_52;
const STOP_819: f64 = 1.610_106_786_589_409;

#[test]
fn example_819_from_the_default_start() {
    for method in [Jumps::Auto, Jumps::FesdJ, Jumps::Modes, Jumps::Freezing] {
        let mut ocp = example_819(method);
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{method:?}: {}", r.message);
        assert!((r.cost - J_819).abs() < 1e-9, "{method:?}: {:.12}", r.cost);
        let contacts = r.contacts.as_ref().unwrap();
        // it lands after sqrt(2/g), slides, and sticks
        assert_eq!(contacts.impacts.len(), 1);
        let hit = &contacts.impacts[0];
        assert!((hit.t - (2.0 / G).sqrt()).abs() < 1e-12, "{}", hit.t);
        assert!((hit.impulse[0] - (2.0 * G).sqrt()).abs() < 1e-10);
        assert!((hit.impulse[1] + 0.6 * hit.impulse[0]).abs() < 1e-10, "friction opposes sliding");
        assert!((hit.rates[0] + (2.0 * G).sqrt()).abs() < 1e-10 && hit.rates[1].abs() < 1e-10);
        let stop = contacts.phases().iter().find(|p| p.2[0] == ContactMode::Closed).unwrap().0;
        assert!((stop - STOP_819).abs() < 1e-7, "{stop}");
        assert!((contacts.forces(1.0).unwrap()[0][0] - G).abs() < 1e-9);
        // the event engine, which shares nothing with the program, agrees
        let a = r.accuracy.as_ref().unwrap();
        assert!(a.reached() && a.terminal < 1e-9 && a.cost_error.abs() < 1e-9, "{a:?}");
        // both limits at the impact
        let k = r.trajectory.elements.iter().position(|e| (e.t - hit.t).abs() < 1e-12).unwrap();
        let (before, after) = (&r.trajectory.elements[k - 1].x1, &r.trajectory.elements[k].x0);
        assert!(before[3] < -4.4 && after[3].abs() < 1e-10 && before[2] > after[2]);
    }
}

#[test]
fn a_warm_start_tries_the_modes_there_were() {
    let mut ocp = example_819(Jumps::Auto);
    let cold = ocp.solve(&mut Control::default()).unwrap().clone();
    ocp.set_x0(&[0.01, 1.0, 0.0, 0.0]).unwrap();
    let warm = ocp.solve_warm(&mut Control::default()).unwrap().clone();
    assert_eq!(warm.outcome, Outcome::Solved);
    assert!(warm.cost < cold.cost, "{} after {}", warm.cost, cold.cost);
    let n = [cold.stats.iterations, warm.stats.iterations];
    assert!(n[1] < n[0] / 2, "{n:?}");
}

#[test]
fn the_same_problem_gives_the_same_bits() {
    let cost = || example_819(Jumps::Auto).solve(&mut Control::default()).unwrap().cost.to_bits();
    assert_eq!(cost(), cost());
}

#[test]
fn a_scene_without_contacts_is_a_smooth_problem() {
    // minimal effort from rest to rest over a distance of 1: u = 6 - 12 t, cost 12
    let g = Graph::new();
    let mut scene = Scene::new("cart", 1, 1, 1, 0).unwrap();
    scene.set_force(0, g.u(0).id()).unwrap();
    let system = scene.build(&g).unwrap().system;
    let mut ocp = Ocp::new(&system, 1.0, 40, &Settings::default()).unwrap();
    let d = Dims { x: 2, u: 1, p: 0 };
    ocp.set_x0(&[0.0, 0.0]).unwrap();
    ocp.set_lagrange(Arc::new(g.function("cost", d, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    let end = Arc::new(g.function("end", d, &[g.x(0), g.x(1)]).unwrap());
    ocp.add_terminal(end, &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    let r = ocp.solve(&mut Control::default()).unwrap();
    // piecewise constant controls lose 1/N² of it
    let n2 = 1600.0;
    assert!((r.cost - 12.0 / (1.0 - 1.0 / n2)).abs() < 1e-8, "{}", r.cost);
    assert_eq!(r.dimensions.2, 0);
}

#[test]
fn a_negative_gap_at_the_start_is_named() {
    let mut ocp = example_819(Jumps::Auto);
    ocp.set_x0(&[0.0, -0.25, 0.0, 0.0]).unwrap();
    let text = ocp.solve(&mut Control::default()).unwrap_err().to_string();
    assert!(text.contains("contact floor is -0.25"), "{text}");
}

#[test]
fn what_cannot_be_reached_says_so() {
    // with forces of 5 it does not get to x = 9 in two seconds
    let mut ocp = example_819(Jumps::Auto);
    ocp.set_u_bounds(&[-5.0], &[5.0]).unwrap();
    let (g, _) = puck(0.6);
    let d = Dims { x: 4, u: 1, p: 0 };
    ocp.add_terminal(Arc::new(g.function("far", d, &[g.x(0)]).unwrap()), &[9.0], &[9.0]).unwrap();
    let r = ocp.solve(&mut Control::default()).unwrap();
    // more iterations would not help
    assert_eq!(r.outcome, Outcome::Stalled);
    assert!(
        r.cost.is_nan() && r.message.contains("no motion was found") && r.message.contains("floor"),
        "{}",
        r.message
    );
    // and whether that is the least there is depends on where the search began
    assert!(r.message.contains(" starts of the search "), "{}", r.message);
    // it moves a = 5 while it falls, then friction is stronger: at most 3 of the 9, whatever the controls are
    let miss = r.message.split("output 0 of far by ").nth(1).and_then(|m| m.split(':').next()?.parse::<f64>().ok());
    assert!(miss.is_some_and(|m| (6.0..20.0).contains(&m)), "{}", r.message);
}

#[test]
fn a_wall_in_the_way_is_named() {
    // the goal is one behind a wall: nothing but the gap of the wall keeps the cart from it
    let g = Graph::new();
    let mut scene = Scene::new("cart", 1, 1, 1, 0).unwrap();
    scene.set_force(0, g.u(0).id()).unwrap();
    scene.add_contact(Contact::new(&g, "wall", -g.x(0) + 1.0)).unwrap();
    let built = scene.build(&g).unwrap();
    let mut ocp = Ocp::new(&built.system, 1.0, 8, &Settings { n_s: 2, n_fe: 1, ..Settings::default() }).unwrap();
    ocp.set_x0(&[0.0, 0.0]).unwrap();
    ocp.set_u_bounds(&[-20.0], &[20.0]).unwrap();
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    ocp.add_terminal(Arc::new(g.function("goal", built.dims, &[g.x(0)]).unwrap()), &[2.0], &[2.0]).unwrap();
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_ne!(r.outcome, Outcome::Solved);
    assert!(r.message.contains("most in control stage"), "{}", r.message);
    assert!(r.message.starts_with("contact wall is in the way"), "{}", r.message);
}

#[test]
fn too_little_friction_is_named() {
    // a block that nothing but the friction of a tray moves is to be at rest one further after a second: that takes an acceleration of 4
    let g = Graph::new();
    let mut scene = Scene::new("tray", 3, 3, 1, 0).unwrap();
    scene.set_force(0, g.u(0).id()).unwrap();
    scene.set_force(1, g.constant(0.0).id()).unwrap();
    scene.set_force(2, g.constant(-0.3 * G).id()).unwrap();
    let mass = |i: usize, j: usize| g.constant(if i != j { 0.0 } else { [1.0, 0.3, 0.3][i] }).id();
    let inertia: Vec<_> = (0..9).map(|k| mass(k / 3, k % 3)).collect();
    scene.set_inertia(&inertia).unwrap();
    let (friction, tangents) = (g.constant(0.02).id(), vec![(g.x(1) - g.x(0)).id()]);
    scene.add_contact(Contact { friction, tangents, ..Contact::new(&g, "tray", g.x(2)) }).unwrap();
    let built = scene.build(&g).unwrap();
    let mut ocp = Ocp::new(&built.system, 1.0, 10, &Settings { n_s: 2, n_fe: 1, ..Settings::default() }).unwrap();
    ocp.set_x0(&[0.0; 6]).unwrap();
    ocp.set_u_bounds(&[-20.0], &[20.0]).unwrap();
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
    let goal = Arc::new(g.function("goal", built.dims, &[g.x(1), g.x(4)]).unwrap());
    ocp.add_terminal(goal, &[1.0, 0.0], &[1.0, 0.0]).unwrap();
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_ne!(r.outcome, Outcome::Solved);
    assert!(r.message.starts_with("the friction of contact tray is too small"), "{}", r.message);
}

#[test]
fn bodies_do_not_pass_between_the_points() {
    // a point goes around a disc in four elements, with room to cut the corner between their stage points
    let g = Graph::new();
    let mut scene = Scene::new("point", 2, 2, 2, 0).unwrap();
    (0..2).for_each(|i| scene.set_force(i, g.u(i).id()).unwrap());
    let (dx, dy) = (g.x(0) - 0.5, g.x(1) + 0.02);
    let gap = dx * dx + dy * dy - 0.01;
    scene.add_contact(Contact::new(&g, "disc", gap)).unwrap();
    let built = scene.build(&g).unwrap();
    let mut ocp = Ocp::new(&built.system, 1.0, 4, &Settings { n_s: 2, n_fe: 1, ..Settings::default() }).unwrap();
    ocp.set_x0(&[0.0; 4]).unwrap();
    let cost = g.u(0) * g.u(0) + g.u(1) * g.u(1);
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[cost]).unwrap())).unwrap();
    let goal = g.function("goal", built.dims, &[g.x(0), g.x(1), g.x(2), g.x(3)]).unwrap();
    ocp.add_terminal(Arc::new(goal), &[1.0, 0.0, 0.0, 0.0], &[1.0, 0.0, 0.0, 0.0]).unwrap();
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved, "{}", r.message);
    let mut least = f64::INFINITY;
    let mut x = [0.0; 4];
    for k in 0..=1000 {
        r.trajectory.state(k as f64 / 1000.0, &mut x).unwrap();
        least = least.min((x[0] - 0.5).powi(2) + (x[1] + 0.02).powi(2) - 0.01);
    }
    assert!(least > -1e-5, "{least}");
}

#[test]
fn an_answer_says_what_it_is_for_the_order_of_contacts() {
    // Example 8.19: it lands and stops inside of control stages, and nothing else is reached
    let mut ocp = example_819(Jumps::Auto);
    let r = ocp.solve(&mut Control::default()).unwrap();
    let o = r.optimality.as_ref().unwrap();
    assert_eq!((o.verdict, o.kinks.len()), (Verdict::LocalOptimum, 0), "{}", o.reason);
    assert_eq!(o.gradient.len(), 20);
    // it is found before a hundred iterations; the rest is the other start and what is next to the answer
    assert!(r.stats.iterations < 750, "{}", r.stats.iterations);
    // controls inside of their bounds have no derivative left
    let cost = |k: usize| o.gradient[k].abs();
    assert!((0..20).all(|k| r.controls[k].abs() > 9.99 || cost(k) < 1e-6), "{:?}", o.gradient);
}

/// Two carts with restitution by time-freezing: a horizon that is a variable, and a parameter in the inertia, have their places in numerical
/// time too.
#[test]
fn time_freezing_knows_free_horizons_and_parameters() {
    let cost = |jumps: Jumps| {
        let g = Graph::new();
        let (a, b, u) = (g.x(0), g.x(1), g.u(0));
        let mut scene = Scene::new("two carts", 2, 2, 1, 1).unwrap();
        let zero = g.constant(0.0).id();
        scene.set_inertia(&[g.constant(1.0).id(), zero, zero, g.p(0).id()]).unwrap();
        scene.set_force(0, (u - g.x(2) * 0.1).id()).unwrap();
        scene.set_force(1, (g.x(3) * -0.5).id()).unwrap();
        let restitution = g.constant(0.5).id();
        scene.add_contact(Contact { restitution, ..Contact::new(&g, "carts", b - a - 0.2) }).unwrap();
        let built = scene.build(&g).unwrap();
        let settings = Settings { n_s: 2, n_fe: 2, ..Settings::default() };
        let mut ocp = Ocp::new(&built.system, 2.0, 10, &settings).unwrap();
        ocp.set_params(&[2.0]).unwrap();
        ocp.set_x0(&[0.0, 1.0, 0.0, 0.0]).unwrap();
        ocp.set_u_bounds(&[-20.0], &[20.0]).unwrap();
        ocp.set_free_time(Durations::Horizon, 1.0, 4.0).unwrap();
        ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[u * u + 1.0]).unwrap())).unwrap();
        let end = g.function("end", built.dims, &[a, b]).unwrap();
        ocp.add_terminal(Arc::new(end), &[0.0, 2.0], &[0.0, 2.0]).unwrap();
        ocp.set_jumps(jumps);
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{jumps:?}: {}", r.message);
        r.cost
    };
    let (frozen, auto) = (cost(Jumps::Freezing), cost(Jumps::Auto));
    assert!((frozen - auto).abs() < 1e-8 * auto, "{frozen} {auto}");
}

#[test]
fn time_freezing_refuses_friction_beside_restitution() {
    let g = Graph::new();
    let mut scene = Scene::new("ball", 2, 2, 1, 0).unwrap();
    scene.set_force(0, g.u(0).id()).unwrap();
    scene.set_force(1, g.constant(-G).id()).unwrap();
    let (friction, restitution) = (g.constant(0.3).id(), g.constant(0.5).id());
    let rough = Contact { friction, restitution, tangents: vec![g.x(0).id()], ..Contact::new(&g, "court", g.x(1)) };
    scene.add_contact(rough).unwrap();
    let mut ocp = Ocp::new(&scene.build(&g).unwrap().system, 1.0, 5, &Settings::default()).unwrap();
    ocp.set_x0(&[0.0, 1.0, 0.0, 0.0]).unwrap();
    ocp.set_jumps(Jumps::Freezing);
    let e = ocp.solve(&mut Control::default()).err().unwrap().to_string();
    assert!(e.contains("contact court has friction and restitution"), "{e}");
}

#[test]
fn friction_in_space_is_simulated_and_other_methods_are_refused() {
    let g = Graph::new();
    let mut scene = Scene::new("puck", 3, 3, 0, 0).unwrap();
    (0..3).for_each(|i| scene.set_force(i, g.constant(-1.0).id()).unwrap());
    let (friction, tangents) = (g.constant(0.5).id(), vec![g.x(0).id(), g.x(1).id()]);
    scene.add_contact(Contact { friction, tangents, ..Contact::new(&g, "table", g.x(2)) }).unwrap();
    let system = scene.build(&g).unwrap().system;
    let mut ocp = Ocp::new(&system, 1.0, 2, &Settings::default()).unwrap();
    ocp.set_x0(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved, "{}", r.message);
    // it falls, and does not reach the table
    let end = &r.trajectory.elements.last().unwrap().x1;
    [-0.5, -0.5, 0.5, -1.0, -1.0, -1.0].iter().zip(end).for_each(|(a, b)| assert!((a - b).abs() < 1e-7, "{end:?}"));
    let mut ocp = example_819(Jumps::Auto);
    let mut settings = *ocp.settings();
    settings.set_by_name("rk_family", "gauss_legendre").unwrap();
    ocp.set_settings(&settings).unwrap();
    let text = ocp.solve(&mut Control::default()).unwrap_err().to_string();
    assert!(text.contains("Radau IIA"), "{text}");
}

/// A point mass above the curve y = 0.3 x² with friction: gap and sliding velocity are lengths.
fn bowl(mu: f64, e: f64) -> (Graph, switchback::system::System) {
    let g = Graph::new();
    let (x, y, vx, vy) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let length = (x * x * 0.36 + 1.0).sqrt();
    let mut scene = Scene::new("bowl", 2, 2, 0, 0).unwrap();
    scene.set_force(0, (vx * -0.1).id()).unwrap();
    scene.set_force(1, (vy * -0.1 - G).id()).unwrap();
    let slide = (vx + x * vy * 0.6) / length;
    let contact = Contact {
        friction: g.constant(mu).id(),
        restitution: g.constant(e).id(),
        tangents: vec![slide.id()],
        ..Contact::new(&g, "bowl", (y - x * x * 0.3) / length)
    };
    scene.add_contact(contact).unwrap();
    let system = scene.build(&g).unwrap().system;
    (g, system)
}

/// Largest difference of the final state from the event engine with `n` stages of a method with `n_s` stage points.
fn error_on_a_curve(system: &switchback::system::System, x0: &[f64], t_end: f64, n_s: usize, n: usize) -> f64 {
    let mut settings = Settings::default();
    settings.set_by_name("n_s", n_s as i64).unwrap();
    settings.set_by_name("n_fe", 1i64).unwrap();
    // grids are refined only where simulations are compared with answers
    settings.accuracy = 0;
    let mut ocp = Ocp::new(system, t_end, n, &settings).unwrap();
    ocp.set_x0(x0).unwrap();
    ocp.set_jumps(Jumps::Modes);
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved, "{n_s} stage points, {n} stages: {}", r.message);
    let exact = simulate(system, &Options::with_tolerance(1e-12, 1e-13), 0.0, x0, t_end).unwrap();
    let last = r.trajectory.elements.last().unwrap();
    exact.x.iter().zip(&last.x1).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

fn slope(steps: &[usize], errors: &[f64]) -> f64 {
    let (a, b) = (errors[0] / errors[errors.len() - 1], steps[steps.len() - 1] as f64 / steps[0] as f64);
    a.ln() / b.ln()
}

/// Horizon of Example 8.17, the time from which it is lifted, and drag and friction of the test: without a drag its motions are polynomials, which two
/// stage points have without error.
const END_817: f64 = 2.25;
const LIFTED: f64 = 1.0;
const DRAG: f64 = 0.3;
const PUSH: f64 = 7.0;
const MU_817: f64 = 0.6;

/// Position and velocity along the floor after a time `s` under the force `a + b s` and the drag, from (x, v).
fn dragged([x, v]: [f64; 2], (a, b): (f64, f64), s: f64) -> [f64; 2] {
    let slope = b / DRAG;
    let level = (a - slope) / DRAG;
    let fades = (-DRAG * s).exp();
    let moved = level * s + slope * s * s / 2.0 + (v - level) * (1.0 - fades) / DRAG;
    [x + moved, level + slope * s + (v - level) * fades]
}

/// The state of Example 8.17 at the end, in closed form: it falls by one, slides from there on, is lifted more and more, and leaves the floor where
/// that is its weight.
fn end_of_example_817() -> [f64; 4] {
    let landing = (2.0 / G).sqrt();
    let mut at = dragged([0.0, 0.0], (PUSH, 0.0), landing);
    at[1] -= MU_817 * G * landing;
    at = dragged(at, (PUSH - MU_817 * G, 0.0), LIFTED - landing);
    at = dragged(at, (PUSH - MU_817 * G, 2.0 * MU_817 * G), 0.5);
    let flight = END_817 - LIFTED - 0.5;
    let [x, vx] = dragged(at, (PUSH, 0.0), flight);
    [x, G * flight.powi(3) / 3.0, vx, G * flight * flight]
}

/// How far an answer for Example 8.17 on `n` stages of a method with `n_s` stage points is off at the end.
fn error_of_example_817(method: Jumps, n_s: usize, n: usize) -> f64 {
    let g = Graph::new();
    let mut scene = Scene::new("example 8.17", 2, 2, 0, 1).unwrap();
    scene.set_force(0, (g.x(2) * -DRAG + PUSH).id()).unwrap();
    scene.set_force(1, (g.p(0) * (g.t() - LIFTED) * (2.0 * G) - G).id()).unwrap();
    let (mu, tangents) = (g.constant(MU_817).id(), vec![g.x(0).id()]);
    scene.add_contact(Contact { friction: mu, tangents, ..Contact::new(&g, "floor", g.x(1)) }).unwrap();
    let system = scene.build(&g).unwrap().system;
    let mut settings = Settings::default();
    settings.set_by_name("n_s", n_s as i64).unwrap();
    settings.set_by_name("n_fe", 1i64).unwrap();
    settings.accuracy = 0;
    let mut ocp = Ocp::new(&system, END_817, n, &settings).unwrap();
    ocp.set_x0(&[0.0, 1.0, 0.0, 0.0]).unwrap();
    let lifted = |k: usize| f64::from(u8::from(9 * k >= 4 * n));
    ocp.set_stage_params(&(0..n).map(lifted).collect::<Vec<f64>>()).unwrap();
    ocp.set_jumps(method);
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved, "{method:?}, {n_s} stage points, {n} stages: {}", r.message);
    let last = r.trajectory.elements.last().unwrap();
    end_of_example_817().iter().zip(&last.x1).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}

/// It lands, slides and leaves the floor; the stages, of which the lift begins with one, are multiples of a quarter.
#[test]
fn programs_keep_the_order_of_the_method_on_example_817() {
    for method in [Jumps::FesdJ, Jumps::Freezing] {
        for n_s in [1, 2, 3] {
            // time-freezing ends at the same programs, and takes long
            let n: &[usize] = if method == Jumps::Freezing { &[9, 18] } else { &[9, 18, 36] };
            let errors: Vec<f64> = n.iter().map(|&n| error_of_example_817(method, n_s, n)).collect();
            let order = slope(n, &errors);
            let expected = 2.0 * n_s as f64 - 1.0;
            assert!(order > expected - 0.3, "{method:?}, {n_s} stage points: {errors:?}, slope {order:.2}");
        }
    }
}

#[test]
fn programs_keep_the_order_of_the_method_on_a_curved_floor() {
    // it lands and slides; it bounces
    for (mu, e, t_end) in [(0.2, 0.0, 0.6), (0.0, 0.8, 0.6)] {
        let (_, system) = bowl(mu, e);
        for (n_s, n) in [(1, [32, 64, 128]), (2, [8, 16, 32]), (3, [4, 8, 16])] {
            let errors = n.map(|n| error_on_a_curve(&system, &[-0.8, 0.5, 0.3, 0.0], t_end, n_s, n));
            let order = slope(&n, &errors);
            let expected = 2.0 * n_s as f64 - 1.0;
            assert!(order > expected - 0.4, "e = {e}, {n_s} stage points: {errors:?}, slope {order:.2}");
        }
    }
}

#[test]
fn derivatives_of_the_optimum_agree_with_differences() {
    let mut ocp = example_819(Jumps::Modes);
    let cost_at = |ocp: &mut Ocp, x: f64, y: f64| {
        ocp.set_x0(&[x, y, 0.0, 0.0]).unwrap();
        let r = ocp.solve_warm(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved);
        r.cost
    };
    cost_at(&mut ocp, 0.0, 1.0);
    let s = ocp.sensitivity().unwrap();
    let h = 1e-4;
    let dx = (cost_at(&mut ocp, h, 1.0) - cost_at(&mut ocp, -h, 1.0)) / (2.0 * h);
    let dy = (cost_at(&mut ocp, 0.0, 1.0 + h) - cost_at(&mut ocp, 0.0, 1.0 - h)) / (2.0 * h);
    assert!((s.cost[0] - dx).abs() < 1e-6 * dx.abs().max(1.0), "{} against {dx}", s.cost[0]);
    assert!((s.cost[1] - dy).abs() < 1e-6 * dy.abs().max(1.0), "{} against {dy}", s.cost[1]);
}

#[test]
fn time_stepping_finds_impacts_that_the_guess_does_not_have() {
    let mut ocp = three_carts();
    ocp.set_jumps(Jumps::Steps);
    let r = ocp.solve(&mut Control::default()).unwrap();
    assert_eq!(r.outcome, Outcome::Solved, "{}", r.message);
    // other local optima cost 3.95, 9.69, 14.1 and 47.7
    assert!(r.cost < 3.352, "{}", r.cost);
    let hits: Vec<usize> = r.contacts.as_ref().unwrap().impacts.iter().map(|i| i.contact).collect();
    assert_eq!(hits, [0, 1]);
    assert!(r.accuracy.as_ref().unwrap().terminal < 1e-5);
}

#[test]
fn what_only_a_bounce_brings_there_is_found() {
    let r = thrown_crate().solve(&mut Control::default()).unwrap().clone();
    assert_eq!(r.outcome, Outcome::Solved, "{}", r.message);
    let contacts = r.contacts.as_ref().unwrap();
    let hits: Vec<_> = contacts.impacts.iter().filter(|i| i.contact == 1).collect();
    assert_eq!(hits.len(), 1, "{:?}", contacts.impacts);
    // Newton's law at the wall, in the direction of the gap
    assert!((hits[0].rates[1] + 0.6 * hits[0].rates[0]).abs() < 1e-9, "{:?}", hits[0]);
    let a = r.accuracy.as_ref().unwrap();
    assert!(a.reached() && a.terminal < 1e-6, "{a:?}");
    // independent of the optimiser: the crate cannot come back with less than the speed that friction and the control take on the way,
    // and what it gets to the wall with costs at least the work against friction and the kinetic energy before the impact
    let least = 2.0 * (0.2 * G - 1.5) * 1.5;
    assert!(hits[0].rates[1].powi(2) >= least - 1e-9, "{:?}", hits[0]);
}

/// Shots are drawn and aimed alike in other units: their tolerances and ranges are relative to the sizes of the states.
#[test]
fn shots_do_not_depend_on_the_unit_of_length() {
    let cost = |unit: f64| {
        let mut ocp = thrown_crate_in(unit);
        ocp.set_jumps(Jumps::Shots);
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{unit}: {}", r.message);
        r.cost / unit.powi(2)
    };
    let metres = cost(1.0);
    for unit in [1e-3, 1e3] {
        assert!((cost(unit) - metres).abs() < 1e-8 * metres, "{unit}");
    }
}

#[test]
fn a_string_goes_slack_without_a_jump_of_its_force() {
    // the gap opens like t³, which inner stage points of the method have negative
    let mut ocp = ball_in_cup();
    ocp.set_jumps(Jumps::Steps);
    let r = ocp.solve(&mut Control::default()).unwrap().clone();
    assert_eq!(r.outcome, Outcome::Solved, "{}", r.message);
    let contacts = r.contacts.as_ref().unwrap();
    assert!(contacts.phases().iter().any(|p| p.2[0] == ContactMode::Open), "{:?}", contacts.phases());
    // a closed string keeps its length, on the curve it holds the ball on
    for e in &r.trajectory.elements {
        let x = &e.x1;
        let slack = 0.25 - (x[2] - x[0]).powi(2) - (x[3] - x[1]).powi(2);
        assert!(slack > -1e-9, "{slack} at {}", e.t);
    }
}

/// Example of (5.17): a ball between a wall and a floor, thrown from (−0.5, 1) with the horizontal velocity −2.5, is to be at (−2, 1.5) after
/// 0.6; the vertical velocity is free in [−8, 8], or given.
fn thrown_ball(given: Option<f64>) -> Ocp {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let mut scene = Scene::new("ball", 2, 2, 0, 0).unwrap();
    scene.set_force(0, g.constant(0.0).id()).unwrap();
    scene.set_force(1, g.constant(-G).id()).unwrap();
    for (name, gap) in [("wall", -x + 1.6), ("floor", y)] {
        scene.add_contact(Contact { restitution: g.constant(0.92).id(), ..Contact::new(&g, name, gap) }).unwrap();
    }
    let built = scene.build(&g).unwrap();
    let mut ocp = Ocp::new(&built.system, 0.6, 3, &Settings { n_s: 3, n_fe: 1, ..Settings::default() }).unwrap();
    let [lower, upper] = given.map_or([-8.0, 8.0], |v| [v, v]);
    ocp.set_x0_bounds(&[-0.5, 1.0, -2.5, lower], &[-0.5, 1.0, -2.5, upper]).unwrap();
    let miss = (x + 2.0).powi(2) + (y - 1.5).powi(2);
    ocp.set_mayer(Arc::new(g.function("miss", built.dims, &[miss]).unwrap())).unwrap();
    ocp
}

#[test]
fn a_throw_that_hits_is_found_from_any_start() {
    // with one impact, and without one, from the equations of the parabola
    let roots = [-4.292_179_045_747_564, 3.776_333_333_333_333];
    let mut reached = [false; 2];
    for start in [-8.0, -4.0, -1.0, 0.0, 1.0, 2.0, 4.0, 8.0] {
        let mut ocp = thrown_ball(None);
        ocp.set_x_guess(&[0.0], &[-0.5, 1.0, -2.5, start]).unwrap();
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{start}: {}", r.message);
        assert!(r.cost.abs() < 1e-18, "{start}: {}", r.cost);
        let found = r.trajectory.elements[0].x0[3];
        let hits = r.contacts.as_ref().unwrap().impacts.len();
        assert!((found - roots[1 - hits]).abs() < 1e-9, "{start}: {found} with {hits} impacts");
        reached[hits] = true;
    }
    // both are optima, and neither is better than the other
    assert_eq!(reached, [true; 2]);
    // the slope of the cost through the impact
    let mut ocp = thrown_ball(Some(-2.0));
    assert_eq!(ocp.solve(&mut Control::default()).unwrap().outcome, Outcome::Solved);
    let slope = ocp.sensitivity().unwrap().cost[3];
    assert!((slope - 0.239_091_476).abs() < 1e-9, "{slope}");
}

/// A block falls on a rough floor and is to be at rest further on; its states have bounds that it comes nowhere near.
#[test]
fn generous_bounds_of_states_change_no_answer() {
    let cost = |bound: Option<f64>| {
        let g = Graph::new();
        let mut scene = Scene::new("block", 2, 2, 2, 0).unwrap();
        scene.set_force(0, g.u(0).id()).unwrap();
        scene.set_force(1, (g.u(1) - G).id()).unwrap();
        let (friction, tangents) = (g.constant(0.3).id(), vec![g.x(0).id()]);
        scene.add_contact(Contact { friction, tangents, ..Contact::new(&g, "floor", g.x(1)) }).unwrap();
        let built = scene.build(&g).unwrap();
        let mut ocp = Ocp::new(&built.system, 1.0, 4, &Settings { n_s: 2, n_fe: 1, ..Settings::default() }).unwrap();
        ocp.set_x0(&[0.0, 0.3, 0.0, 0.0]).unwrap();
        ocp.set_u_bounds(&[-20.0; 2], &[20.0; 2]).unwrap();
        if let Some(most) = bound {
            ocp.set_x_bounds(&[-most; 4], &[most; 4]).unwrap();
        }
        let effort = g.u(0) * g.u(0) + g.u(1) * g.u(1);
        ocp.set_lagrange(Arc::new(g.function("effort", built.dims, &[effort]).unwrap())).unwrap();
        let end = [g.x(0), g.x(2), g.x(3)];
        ocp.add_terminal(Arc::new(g.function("end", built.dims, &end).unwrap()), &[0.5, 0.0, 0.0], &[0.5, 0.0, 0.0])
            .unwrap();
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{bound:?}: {}", r.message);
        r.cost
    };
    let free = cost(None);
    for bound in [1e2, 1e3, 1e6] {
        assert!((cost(Some(bound)) - free).abs() < 1e-6 * free, "{bound}");
    }
}

/// A point is pushed through a hollow of its floor, from places on it that are zero but for rounding, or nearly: what they differ by is no size of anything,
/// and no overlap.
#[test]
fn starts_next_to_zero_are_starts_at_zero() {
    let solve = |height: f64| {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let mut scene = Scene::new("hollow", 2, 2, 1, 0).unwrap();
        scene.set_force(0, g.u(0).id()).unwrap();
        scene.set_force(1, g.constant(-G).id()).unwrap();
        let floor = ((x * std::f64::consts::TAU / 0.2).cos() - 1.0) * 0.04;
        scene.add_contact(Contact::new(&g, "floor", y - floor)).unwrap();
        let built = scene.build(&g).unwrap();
        let mut ocp = Ocp::new(&built.system, 0.5, 8, &Settings { n_s: 2, n_fe: 1, ..Settings::default() }).unwrap();
        ocp.set_x0(&[0.0, height, 0.0, 0.0]).unwrap();
        ocp.set_u_bounds(&[-9.0], &[9.0]).unwrap();
        ocp.set_lagrange(Arc::new(g.function("effort", built.dims, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
        ocp.add_terminal(Arc::new(g.function("end", built.dims, &[x]).unwrap()), &[0.1], &[0.1]).unwrap();
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{height}: {}", r.message);
        r.cost
    };
    let at_zero = solve(0.0);
    for height in [-1.5e-15, 1e-12, 1e-9] {
        let cost = solve(height);
        assert!((cost - at_zero).abs() < 1e-6 * at_zero, "{height}: {cost} instead of {at_zero}");
    }
}

/// A point is to stop at the height of a step that it lies on, which is that high but for the tail of the function that rounds its edge: conditions at the end
/// contradict the contact by 1e-9. There is a motion all the same, and it costs about as much as one to anywhere near that height.
#[test]
fn conditions_that_nearly_contradict_a_contact_are_met() {
    let solve = |either_way: f64, guess: Option<&OcpResult>| {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let mut scene = Scene::new("step", 2, 2, 1, 0).unwrap();
        scene.set_force(0, g.u(0).id()).unwrap();
        scene.set_force(1, g.constant(-G).id()).unwrap();
        let floor = (((x - 0.5) * 20.0).tanh() - (-10f64).tanh()) * 0.15;
        scene.add_contact(Contact::new(&g, "step", y - floor)).unwrap();
        let built = scene.build(&g).unwrap();
        let mut ocp = Ocp::new(&built.system, 1.0, 8, &Settings { n_s: 2, n_fe: 1, ..Settings::default() }).unwrap();
        ocp.set_x0(&[0.0; 4]).unwrap();
        ocp.set_u_bounds(&[-20.0], &[20.0]).unwrap();
        ocp.set_lagrange(Arc::new(g.function("effort", built.dims, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
        let end = Arc::new(g.function("end", built.dims, &[x, y, g.x(2)]).unwrap());
        ocp.add_terminal(end, &[1.0, 0.3 - either_way, 0.0], &[1.0, 0.3 + either_way, 0.0]).unwrap();
        if let Some(r) = guess {
            let (times, states): (Vec<f64>, Vec<Vec<f64>>) =
                r.trajectory.elements.iter().map(|e| (e.t, e.x0.clone())).unzip();
            ocp.set_x_guess(&times, &states.concat()).unwrap();
            ocp.set_u_guess(&r.controls).unwrap();
        }
        let r = ocp.solve(&mut Control::default()).unwrap().clone();
        assert_eq!(r.outcome, Outcome::Solved, "{either_way}: {}", r.message);
        let end = &r.trajectory.elements.last().unwrap().x1;
        assert!((end[1] - 0.3).abs() <= either_way.max(1e-8), "{end:?}");
        r
    };
    let near = solve(1e-6, None);
    let there = [None, Some(&near)].map(|guess| solve(0.0, guess).cost).into_iter().fold(f64::INFINITY, f64::min);
    // the searches end at local optima of grids that are not the same: the step is a tenth of the way wide, and simulations ask for finer grids there
    assert!(there < 1.5 * near.cost, "{there} instead of {}", near.cost);
}

/// A mass on a spring that bounces off a stop, in a unit of length: everything scales with that. Only the simulation of the guess says when it bounces.
#[test]
fn guesses_do_not_depend_on_the_unit_of_length() {
    let tried = |unit: f64| {
        let g = Graph::new();
        let mut scene = Scene::new("spring and stop", 1, 1, 1, 0).unwrap();
        scene.set_force(0, (g.u(0) * unit - g.x(0) * 25.0).id()).unwrap();
        let restitution = g.constant(0.8).id();
        scene.add_contact(Contact { restitution, ..Contact::new(&g, "stop", g.x(0) + 0.5 * unit) }).unwrap();
        let built = scene.build(&g).unwrap();
        let mut ocp = Ocp::new(&built.system, 3.0, 12, &Settings { n_s: 3, n_fe: 2, ..Settings::default() }).unwrap();
        ocp.set_x0(&[unit, 0.0]).unwrap();
        ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[g.u(0) * g.u(0)]).unwrap())).unwrap();
        ocp.set_jumps(Jumps::Modes);
        let r = ocp.solve(&mut Control::default()).unwrap();
        assert_eq!(r.outcome, Outcome::Solved, "{unit}: {}", r.message);
        // doing nothing costs nothing
        assert!(r.cost.abs() < 1e-6, "{unit}: {}", r.cost);
        let contacts = r.contacts.as_ref().unwrap();
        (contacts.tried, contacts.impacts.len())
    };
    let usual = tried(1.0);
    assert!(usual.1 > 1, "{usual:?}");
    assert_eq!([1e-6, 1e-3].map(tried), [usual; 2]);
}

/// Two carts, of which only the first is driven, in units of length, mass and time.
fn carts_in(length: f64, mass: f64, time: f64, bounded: bool) -> Ocp {
    let g = Graph::new();
    let mut scene = Scene::new("carts", 2, 2, 1, 0).unwrap();
    let damping = mass / time;
    scene.set_force(0, (g.u(0) - g.x(2) * (0.1 * damping)).id()).unwrap();
    scene.set_force(1, (g.x(3) * (-0.5 * damping)).id()).unwrap();
    let inertia: Vec<_> = [mass, 0.0, 0.0, 2.0 * mass].map(|m| g.constant(m).id()).to_vec();
    scene.set_inertia(&inertia).unwrap();
    let gap = g.x(1) - g.x(0) - 0.2 * length;
    scene.add_contact(Contact { restitution: g.constant(0.5).id(), ..Contact::new(&g, "carts", gap) }).unwrap();
    let built = scene.build(&g).unwrap();
    let settings = Settings { n_s: 2, n_fe: 2, ..Settings::default() };
    let mut ocp = Ocp::new(&built.system, 3.0 * time, 15, &settings).unwrap();
    ocp.set_x0(&[0.0, length, 0.0, 0.0]).unwrap();
    let force = mass * length / (time * time);
    if bounded {
        ocp.set_u_bounds(&[-20.0 * force], &[20.0 * force]).unwrap();
    }
    let cost = g.u(0) * g.u(0) * (1.0 / (force * force * time));
    ocp.set_lagrange(Arc::new(g.function("cost", built.dims, &[cost]).unwrap())).unwrap();
    let end = g.function("end", built.dims, &[g.x(0), g.x(1)]).unwrap();
    ocp.add_terminal(Arc::new(end), &[0.0, 2.0 * length], &[0.0, 2.0 * length]).unwrap();
    ocp
}

#[test]
fn answers_do_not_depend_on_units() {
    let units = [
        (1.0, 1.0, 1.0),
        (1e-6, 1.0, 1.0),
        (1e6, 1.0, 1.0),
        (1.0, 1e-6, 1.0),
        (1.0, 1e6, 1.0),
        (1.0, 1.0, 1e-3),
        (1.0, 1.0, 1e3),
    ];
    for bounded in [true, false] {
        let costs = units.map(|(length, mass, time)| {
            let mut ocp = carts_in(length, mass, time, bounded);
            let r = ocp.solve(&mut Control::default()).unwrap();
            assert_eq!(r.outcome, Outcome::Solved, "{length} {mass} {time} {bounded}: {}", r.message);
            r.cost
        });
        assert!(costs.iter().all(|c| (c - costs[0]).abs() < 1e-9 * costs[0]), "{bounded}: {costs:?}");
    }
}

#[test]
fn contacts_that_are_out_of_reach_cost_nothing() {
    // shots with the largest push go to x = 15, far beyond the bounds that the walls are left out for
    let solve = |walls: usize, method: Jumps| {
        let mut ocp = example_819_between(walls, method);
        let r = ocp.solve(&mut Control::default()).unwrap().clone();
        assert_eq!(r.outcome, Outcome::Solved, "{method:?}: {}", r.message);
        (r.stats.iterations, r.stats.factorisations, r.stats.evaluations, r.cost.to_bits())
    };
    for method in [Jumps::Auto, Jumps::Shots] {
        assert_eq!(solve(0, method), solve(3, method), "{method:?}");
    }
}
