//! Multipliers and costates of solutions with switches, against differences of optima and against the problem of what is left of
//! the horizon (Bellman's principle).

use std::sync::Arc;
use switchback::error::Error;
use switchback::expr::{Expr, Graph};
use switchback::fesd::PathAt;
use switchback::func::Dims;
use switchback::model::Model;
use switchback::mpcc::Polish;
use switchback::nlp::Control;
use switchback::ocp::{MultipliersOf, Norm, Ocp, OcpResult};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};

const INTERVAL: f64 = 0.25;
const STAGES: usize = 8;
const HORIZON: f64 = INTERVAL * STAGES as f64;
const STEP: f64 = 1e-4;
/// Price of the squared distance from the goal.
const GOAL: f64 = 200.0;
const D: Dims = Dims { x: 2, u: 1, p: 0 };

/// A boat of mass 1 that comes into mud at `q = 0`: drag `v / 2` before, `2 v` behind.
fn boat(g: &Graph) -> System {
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    let drag = g.constant(1.25) + 0.75 * q.sign();
    Model::from_rhs("boat", 1, 0, &[v, u - drag * v]).and_then(|m| m.build(g)).unwrap().system
}

fn function(g: &Graph, e: &[Expr]) -> SharedFunction {
    Arc::new(g.function("f", D, e).unwrap())
}

/// What is varied: the goal, the greatest speed, the greatest force.
#[derive(Clone, Copy)]
struct Data {
    goal: f64,
    speed: f64,
    force: f64,
}

const DATA: Data = Data { goal: 0.3, speed: 0.8, force: 1.2 };

/// From `x0` to `goal` in what is left of the horizon behind `gone` stages, with little effort.
fn problem(x0: &[f64], gone: usize, d: Data, relaxed: bool) -> Ocp {
    let g = Graph::new();
    let n = STAGES - gone;
    let mut o = Ocp::new(&boat(&g), INTERVAL * n as f64, n, &Settings::default()).unwrap();
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    o.set_lagrange(function(&g, &[u * u + 0.1 * q * q])).unwrap();
    o.set_mayer(function(&g, &[v * v])).unwrap();
    o.set_x0(x0).unwrap();
    o.set_u_bounds(&[-d.force], &[d.force]).unwrap();
    let (free, speed) = ([f64::NEG_INFINITY], [d.speed]);
    if relaxed {
        o.add_relaxed(function(&g, &[v]), &free, &speed, Some(PathAt::ControlGrid), Norm::L2, 3.0).unwrap();
        o.add_relaxed(function(&g, &[q]), &[d.goal], &[f64::INFINITY], None, Norm::L2, GOAL).unwrap();
    } else {
        o.add_path(function(&g, &[q]), &[-9.0], &[9.0], PathAt::ControlGrid).unwrap();
        o.add_path(function(&g, &[v]), &free, &speed, PathAt::ControlGrid).unwrap();
        o.add_terminal(function(&g, &[q]), &[d.goal], &[d.goal]).unwrap();
    }
    o
}

const X0: [f64; 2] = [-1.0, 0.2];

fn optimum(o: &mut Ocp) -> f64 {
    let r = o.solve(&mut Control::default()).unwrap();
    assert_eq!(r.polish, Polish::Done, "{}", r.message);
    r.cost
}

/// Derivative of the optimal cost by differences, penalties included.
fn slope(of: impl Fn(f64) -> Ocp, penalised: bool) -> f64 {
    let cost = |h: f64| {
        let mut o = of(h);
        let cost = optimum(&mut o);
        if !penalised {
            return cost;
        }
        let r = o.result().unwrap();
        cost + penalties(r)
    };
    (cost(STEP) - cost(-STEP)) / (2.0 * STEP)
}

fn state(r: &OcpResult, t: f64) -> [f64; 2] {
    let mut x = [0.0; 2];
    r.trajectory.state(t, &mut x).unwrap();
    x
}

/// What the violations of the two relaxed constraints cost: the largest at the ends of each stage, squared, over its time.
fn penalties(r: &OcpResult) -> f64 {
    let speed = |k: usize| (state(r, INTERVAL * k as f64)[1] - DATA.speed).max(0.0);
    let along: f64 = (0..STAGES).map(|k| 3.0 * INTERVAL * speed(k).max(speed(k + 1)).powi(2)).sum();
    along + GOAL * (DATA.goal - state(r, HORIZON)[0]).max(0.0).powi(2)
}

fn near(a: f64, b: f64, tol: f64, what: &str) {
    assert!((a - b).abs() < tol * (1.0 + b.abs()), "{what}: {a} and {b}");
}

fn sum(o: &mut Ocp, of: MultipliersOf) -> f64 {
    o.multipliers(of).unwrap().values.iter().sum()
}

#[test]
fn multipliers_are_what_bounds_cost() {
    let mut o = problem(&X0, 0, DATA, false);
    optimum(&mut o);
    let by = |f: fn(&mut Data, f64)| {
        slope(
            |h| {
                let mut d = DATA;
                f(&mut d, h);
                problem(&X0, 0, d, false)
            },
            false,
        )
    };
    let goal = by(|d, h| d.goal += h);
    let speed = by(|d, h| d.speed += h);
    let force = by(|d, h| d.force += h);
    assert!(goal > 0.1 && speed < -0.01 && force < -0.01, "{goal} {speed} {force}: every bound acts");
    near(-sum(&mut o, MultipliersOf::Terminal(0)), goal, 1e-6, "goal");
    near(-sum(&mut o, MultipliersOf::Path(1)), speed, 1e-6, "speed");
    near(sum(&mut o, MultipliersOf::Path(0)), 0.0, 1e-9, "what is not reached");
    let controls = o.multipliers(MultipliersOf::Controls).unwrap();
    assert_eq!((controls.times.len(), controls.width()), (STAGES, 1));
    near(-controls.values.iter().map(|v| v.abs()).sum::<f64>(), force, 1e-6, "force");
    // of the controls at the upper bound those are positive, at the lower negative
    let r = o.result().unwrap().controls.clone();
    for (u, m) in r.iter().zip(&controls.values) {
        assert!(m.abs() < 1e-9 || m * u > 0.0, "{u} {m}");
    }
    let path = o.multipliers(MultipliersOf::Path(1)).unwrap();
    // those inside of elements come to those at their ends
    assert!(path.times.len() >= 2 * STAGES);
    assert!(
        path.times.windows(2).all(|t| t[1] > t[0] - 1e-12) && (path.times[path.times.len() - 1] - 2.0).abs() < 1e-12
    );
    for i in 0..2 {
        let moved = |h: f64| {
            let mut x = X0;
            x[i] += h;
            problem(&x, 0, DATA, false)
        };
        let slope = (optimum(&mut moved(STEP)) - optimum(&mut moved(-STEP))) / (2.0 * STEP);
        near(-o.multipliers(MultipliersOf::InitialState).unwrap().values[i], slope, 1e-6, "initial state");
    }
}

#[test]
fn costates_are_the_derivatives_of_what_is_still_to_come() {
    let mut whole = problem(&X0, 0, DATA, false);
    optimum(&mut whole);
    let found = whole.multipliers(MultipliersOf::Costates).unwrap();
    assert_eq!((found.times.len(), found.width()), (STAGES + 1, 2));
    let r = whole.result().unwrap().clone();
    assert!(r.trajectory.switches.len() == 1, "it comes into the mud once");
    for k in 0..STAGES {
        let mut rest = problem(&state(&r, found.times[k]), k, DATA, false);
        optimum(&mut rest);
        let own = rest.multipliers(MultipliersOf::Costates).unwrap();
        let derivative = rest.sensitivity().unwrap();
        for i in 0..2 {
            near(own.values[i], found.values[2 * k + i], 1e-6, "the rest alone");
            // where the speed begins at its bound the optimum has no derivative
            let free = state(&r, found.times[k])[1] < DATA.speed - 1e-6;
            assert_eq!(derivative.cost[i].is_nan(), i == 1 && !free);
            if !derivative.cost[i].is_nan() {
                near(own.values[i], derivative.cost[i], 1e-6, "derivative of the optimum");
            }
        }
    }
    // at the end: the gradient of the terminal cost, and the multiplier of the goal
    let goal = sum(&mut whole, MultipliersOf::Terminal(0));
    near(found.values[2 * STAGES], goal, 1e-12, "transversality");
    near(found.values[2 * STAGES + 1], 2.0 * state(&r, HORIZON)[1], 1e-9, "transversality");
}

#[test]
fn multipliers_of_what_may_be_violated() {
    let mut o = problem(&X0, 0, DATA, true);
    optimum(&mut o);
    let speed = sum(&mut o, MultipliersOf::Relaxed(0));
    let goal = sum(&mut o, MultipliersOf::Relaxed(1));
    // of a squared violation the multiplier is twice its weight times the violation
    let r = o.result().unwrap().clone();
    let q = state(&r, HORIZON)[0];
    assert!(q < DATA.goal);
    near(goal, -2.0 * GOAL * (DATA.goal - q), 1e-6, "goal");
    assert!(speed > 0.0, "{speed}");
    let by = slope(
        |h| {
            let mut x = X0;
            x[1] += h;
            problem(&x, 0, DATA, true)
        },
        true,
    );
    near(o.multipliers(MultipliersOf::Costates).unwrap().values[1], by, 1e-5, "initial speed");
}

#[test]
fn multipliers_of_nothing() {
    let mut o = problem(&X0, 0, DATA, false);
    assert!(matches!(o.multipliers(MultipliersOf::Costates), Err(Error::State(_))));
    optimum(&mut o);
    assert!(matches!(o.multipliers(MultipliersOf::Path(2)), Err(Error::Range(_))));
    assert!(matches!(o.multipliers(MultipliersOf::Relaxed(0)), Err(Error::Range(_))));
    assert_eq!(o.count_multipliers(MultipliersOf::Path(0)), 2);
}
