//! Projected systems by finite elements: order of the method through events, and optimal control.

use switchback::event;
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::mpcc::Polish;
use switchback::nlp::{Control, Outcome};
use switchback::ocp::{Ocp, Verdict};
use switchback::scene::{Contact, Scene};
use switchback::settings::Settings;
use switchback::sim::Simulator;
use switchback::system::System;

fn projected(g: &Graph, nu: usize, f: &[Expr], constraints: &[Expr]) -> System {
    let mut s = Scene::projected("projected", f.len(), nu, 0).unwrap();
    f.iter().enumerate().for_each(|(i, f)| s.set_force(i, f.id()).unwrap());
    for (k, c) in constraints.iter().enumerate() {
        s.add_contact(Contact::new(g, &format!("c{k}"), *c)).unwrap();
    }
    s.build(g).unwrap().system
}

/// A point that drifts to the right and goes around a disc.
fn around_a_disc() -> System {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    projected(&g, 0, &[g.constant(1.0), g.constant(0.0)], &[x * x + y * y - 1.0])
}

/// Where it is at t = 4 from (-2, 0.3): on the circle φ' = -sin φ, so it leaves at the top at a time in closed form.
fn exact() -> [f64; 2] {
    let (y, t_end) = (0.3f64, 4.0);
    let hits = 2.0 - (1.0 - y * y).sqrt();
    let phi = std::f64::consts::PI - y.asin();
    [t_end - hits - (0.5 * phi).tan().ln(), 1.0]
}

#[test]
fn elements_keep_the_order_of_the_method_through_contact() {
    let system = around_a_disc();
    let exact = exact();
    for (n_s, order, stages) in [(1, 1.0, [10, 20, 40]), (2, 3.0, [5, 10, 20]), (3, 5.0, [3, 6, 12])] {
        let settings = Settings { n_s, n_fe: 3, accuracy: 0, ..Settings::default() };
        let mut errors = Vec::new();
        for n in stages {
            let mut o = Ocp::new(&system, 4.0, n, &settings).unwrap();
            o.set_x0(&[-2.0, 0.3]).unwrap();
            let r = o.solve(&mut Control::default()).unwrap();
            assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "n_s = {n_s}, {n} stages");
            assert_eq!(r.trajectory.switches.len(), 2);
            let end = &r.trajectory.elements[r.trajectory.elements.len() - 1].x1;
            errors.push((end[0] - exact[0]).hypot(end[1] - exact[1]));
        }
        let slope = (errors[0] / errors[2]).log2() / 2.0;
        assert!(slope > order - 0.2, "n_s = {n_s}: slope {slope}, {errors:?}");
    }
}

#[test]
fn moving_sets_and_several_constraints_agree_with_the_event_engine() {
    // a point between two walls that move, and a disc: it is caught by one after the other
    let g = Graph::new();
    let (x, y, t) = (g.x(0), g.x(1), g.t());
    let walls = [x - 0.8 * t.sin() + 1.0, 1.0 + 0.8 * t.sin() - x, x * x + (y - 1.5) * (y - 1.5) - 0.49];
    let system = projected(&g, 0, &[0.1 - 0.3 * x, g.constant(0.4)], &walls);
    let o = event::Options::with_tolerance(1e-11, 1e-11);
    let run = event::simulate(&system, &o, 0.0, &[0.1, 0.0], 5.0).unwrap();
    let settings = Settings { n_s: 3, n_fe: 3, ..Settings::default() };
    let mut sim = Simulator::new(&system, &settings).unwrap();
    sim.set_state(0.0, &[0.1, 0.0]).unwrap();
    let r = sim.run(5.0, 50, &mut Control::default()).unwrap();
    assert_eq!((r.outcome, r.inexact), (Outcome::Solved, 0));
    for (a, b) in sim.state().iter().zip(&run.x) {
        assert!((a - b).abs() < 1e-7, "{:?} {:?}", sim.state(), run.x);
    }
}

/// One body pushes another over a line: until contact the first moves with its control, then both with half of it. The cost `∫ u²` is
/// least with one speed all the time, `(gap + 2 way)²/T`, in any units.
#[test]
fn a_body_that_pushes_another_has_the_exact_cost() {
    for unit in [1.0, 1e3] {
        let g = Graph::new();
        let (a, b, u) = (g.x(0), g.x(1), g.u(0));
        let system = projected(&g, 1, &[u, g.constant(0.0)], &[b - a - 0.5 * unit]);
        let d = Dims { x: 2, u: 1, p: 0 };
        let mut o = Ocp::new(&system, 3.0, 7, &Settings { n_s: 2, ..Settings::default() }).unwrap();
        o.set_x0(&[0.0, 1.0 * unit]).unwrap();
        o.set_u_bounds(&[-10.0 * unit], &[10.0 * unit]).unwrap();
        o.set_lagrange(std::sync::Arc::new(g.function("cost", d, &[u * u]).unwrap())).unwrap();
        let goal = std::sync::Arc::new(g.function("goal", d, &[b]).unwrap());
        o.add_terminal(goal, &[2.0 * unit], &[2.0 * unit]).unwrap();
        let r = o.solve(&mut Control::default()).unwrap();
        assert_eq!((r.outcome, r.polish), (Outcome::Solved, Polish::Done), "{}", r.message);
        let exact = (0.5f64 + 2.0).powi(2) / 3.0 * unit * unit;
        assert!((r.cost - exact).abs() < 1e-9 * exact, "{} {exact}", r.cost);
        println!("unit {unit}: {} iterations", r.stats.iterations);
        let judged = r.optimality.as_ref().unwrap();
        assert_eq!(judged.verdict, Verdict::LocalOptimum, "{}", judged.reason);
        let found = r.accuracy.as_ref().unwrap();
        assert!(found.terminal < 1e-8 * unit, "{}", found.terminal);
        // by events: as many changes as the block is met, and the cost by quadrature along the simulation
        assert!(found.reached() && (found.cost - exact).abs() < 1e-7 * exact, "{found:?}");
    }
}

/// The same with a control that is linear on every stage: its optimum is the constant, its simulation has the control as a state, and a
/// descent judges it.
#[test]
fn linear_controls_of_projected_systems_are_simulated_and_judged() {
    let g = Graph::new();
    let (a, b, u) = (g.x(0), g.x(1), g.u(0));
    let system = projected(&g, 1, &[u, g.constant(0.0)], &[b - a - 0.5]);
    let d = Dims { x: 2, u: 1, p: 0 };
    let mut o = Ocp::new(&system, 3.0, 5, &Settings { n_s: 2, ..Settings::default() }).unwrap();
    o.set_x0(&[0.0, 1.0]).unwrap();
    o.set_u_bounds(&[-10.0], &[10.0]).unwrap();
    o.set_linear_controls(&[true]).unwrap();
    o.set_lagrange(std::sync::Arc::new(g.function("cost", d, &[u * u]).unwrap())).unwrap();
    let goal = std::sync::Arc::new(g.function("goal", d, &[b]).unwrap());
    o.add_terminal(goal, &[2.0], &[2.0]).unwrap();
    let r = o.solve(&mut Control::default()).unwrap();
    let exact = 2.5f64.powi(2) / 3.0;
    assert!(r.outcome == Outcome::Solved && (r.cost - exact).abs() < 1e-8 * exact, "{} {exact}", r.cost);
    let judged = r.optimality.as_ref().unwrap();
    assert_eq!(judged.verdict, Verdict::LocalOptimum, "{}", judged.reason);
    let found = r.accuracy.as_ref().unwrap();
    assert!(found.reached() && found.terminal < 1e-8, "{found:?}");
    assert!((found.cost - exact).abs() < 1e-7 * exact, "{found:?}");
}

#[test]
fn what_is_not_there_is_said() {
    let system = around_a_disc();
    let with = system.with_multipliers().unwrap();
    assert_eq!((with.inclusions().len(), with.inclusions()[0].psi.n_out()), (1, 1));
    // a mechanical scene stays what it is
    let g = Graph::new();
    let mut s = Scene::new("ball", 1, 1, 0, 0).unwrap();
    s.set_force(0, g.constant(-9.81).id()).unwrap();
    s.add_contact(Contact::new(&g, "floor", g.x(0))).unwrap();
    let ball = s.build(&g).unwrap().system;
    assert!(ball.with_multipliers().unwrap().mechanics().is_some());
}
