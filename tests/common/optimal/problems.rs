//! Optimal control problems with a given start.

use super::{function, set, system, Problem};
use crate::models::{sliding_ocp, INF, PI};
use switchback::error::Result;
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::ocp::{CostAt, Durations, Ocp};
use switchback::settings::Settings;

pub fn all() -> Vec<Result<Problem>> {
    vec![Ok(sliding()), turbo_car(), cart_pole(), motor(), blocks(), tanks(), friction()]
}

/// A problem of a model given by its right-hand side.
fn problem(g: &Graph, d: Dims, rhs: &[Expr], horizon: f64, n_stages: usize, set: &Settings) -> Ocp {
    Ocp::new(&system(g, d, rhs), horizon, n_stages, set).expect("the problem is well posed")
}

fn sliding() -> Problem {
    let see = "two curves catch the state one after the other, and let it go again";
    Problem {
        name: "sliding-mode",
        see,
        ocp: sliding_ocp(&set(3, 4)),
        time: "time",
        states: &["q1", "q2", "v1", "v2"],
        controls: &["u1", "u2"],
        horizon: None,
    }
}

/// Full throttle, three times the acceleration above 15, no faster than 25.
fn turbo_car() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 2, u: 1, p: 0 };
    let (q, v, u) = (g.x(0), g.x(1), g.u(0));
    let mut o = problem(&g, d, &[v, v.gt(15.0).select(3.0 * u, u)], 10.0, 10, &set(2, 3));
    o.set_x0(&[0.0; 2])?;
    o.set_u_bounds(&[-5.0], &[5.0])?;
    o.set_x_bounds(&[-INF, -25.0], &[INF, 25.0])?;
    o.set_lagrange(function(&g, d, "time", &[g.constant(1.0)]))?;
    o.add_terminal(function(&g, d, "goal", &[q, v]), &[200.0, 0.0], &[200.0, 0.0])?;
    o.set_free_time(Durations::Horizon, 1.0, 40.0)?;
    let see = "the car gets over 15 as soon as it can, where the turbo helps, and brakes late";
    Ok(Problem {
        name: "turbo-car",
        see,
        ocp: o,
        time: "time / s",
        states: &["", "speed / (m/s)"],
        controls: &["acceleration / (m/s²)"],
        horizon: None,
    })
}

fn cart_pole() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 4, u: 1, p: 0 };
    let (a, v, w, u) = (g.x(1), g.x(2), g.x(3), g.u(0));
    let push = u - 2.0 * v.sign();
    let reach = 1.0 + 0.1 * a.sin().powi(2);
    let cart = (push + 0.1 * a.sin() * (w * w + 9.81 * a.cos())) / reach;
    let pole = -(a.cos() * (push + 0.1 * w * w * a.sin()) + 1.1 * 9.81 * a.sin()) / reach;
    let mut o = problem(&g, d, &[v, w, cart, pole], 4.0, 40, &set(5, 2));
    o.set_x0(&[1.0, 0.0, 0.0, 0.0])?;
    o.set_u_bounds(&[-30.0], &[30.0])?;
    let goal = [0.0, PI, 0.0, 0.0];
    // the pole is up soon
    o.set_x_guess(&[0.0, 1.0, 4.0], &[&[1.0, 0.0, 0.0, 0.0], &goal[..], &goal].concat())?;
    let states = function(&g, d, "x", &[g.x(0), a, v, w]);
    o.add_least_squares(states.clone(), &[1.0, 100.0, 1.0, 1.0], &goal, CostAt::Running)?;
    o.add_least_squares(function(&g, d, "u", &[u]), &[1.0], &[0.0], CostAt::Running)?;
    o.add_least_squares(states, &[100.0, 100.0, 10.0, 10.0], &goal, CostAt::Terminal)?;
    Ok(Problem {
        name: "cart-pole",
        see: "the cart swings the pole up against its dry friction",
        ocp: o,
        time: "time / s",
        states: &["position / m", "angle / rad", "speed / (m/s)", "angular speed / (rad/s)"],
        controls: &["force / N"],
        horizon: None,
    })
}

fn motor() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 5, u: 1, p: 0 };
    let [a, b, va, vb, i] = [g.x(0), g.x(1), g.x(2), g.x(3), g.x(4)];
    let u = g.u(0);
    let spring = 8.0 * (a - b) + 0.2 * (va - vb);
    let rhs = [va, vb, 5.0 * i - spring, spring - 0.8 * vb.sign(), 10.0 * (u - va - 0.5 * i)];
    let mut o = problem(&g, d, &rhs, 3.0, 12, &set(4, 3));
    o.set_x0(&[0.0; 5])?;
    o.set_u_bounds(&[-4.0], &[4.0])?;
    o.set_lagrange(function(&g, d, "loss", &[u * u + 0.1 * i * i]))?;
    let goal = [1.0, 1.0, 0.0, 0.0, 0.0];
    o.add_terminal(function(&g, d, "goal", &[a, b, va, vb, i]), &goal, &goal)?;
    Ok(Problem {
        name: "motor",
        see: "friction holds the load until the spring is wound up",
        ocp: o,
        time: "time / s",
        states: &[
            "angle of motor / rad",
            "angle of load / rad",
            "speed of motor / (rad/s)",
            "speed of load / (rad/s)",
            "current / A",
        ],
        controls: &["voltage / V"],
        horizon: None,
    })
}

fn blocks() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 6, u: 1, p: 0 };
    let x: Vec<Expr> = (0..6).map(|i| g.x(i)).collect();
    let (q, v) = x.split_at(3);
    let springs = [q[1] - 2.0 * q[0], q[0] - 2.0 * q[1] + q[2], q[1] - q[2] + g.u(0)];
    let mut rhs = v.to_vec();
    rhs.extend(v.iter().zip(springs).map(|(&v, s)| s - v - 0.3 * v.sign()));
    let mut o = problem(&g, d, &rhs, 5.0, 10, &set(3, 4));
    o.set_x0(&[-1.0, 1.0, -1.0, -1.0, 1.0, 1.0])?;
    o.set_u_bounds(&[-10.0], &[10.0])?;
    let goal = [-1.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let states = function(&g, d, "x", &x);
    o.add_least_squares(function(&g, d, "u", &[g.u(0)]), &[1.0], &[0.0], CostAt::Running)?;
    o.add_least_squares(states.clone(), &[1.0; 6], &goal, CostAt::Running)?;
    o.add_least_squares(states, &[100.0; 6], &goal, CostAt::Terminal)?;
    Ok(Problem {
        name: "blocks",
        see: "the force on the last block drags the others along, one after the other",
        ocp: o,
        time: "time",
        states: &["position 1", "position 2", "position 3", "speed 1", "speed 2", "speed 3"],
        controls: &["force on 3"],
        horizon: None,
    })
}

fn tanks() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 2, u: 1, p: 0 };
    let (upper, lower, u) = (g.x(0), g.x(1), g.u(0));
    let over = upper.gt(1.0).select(4.0 * (upper - 1.0), g.constant(0.0));
    let mut o = problem(&g, d, &[u - over - 0.1 * upper, over - 0.3 * lower], 10.0, 10, &set(4, 3));
    o.set_x0(&[0.2, 0.0])?;
    o.set_u_bounds(&[0.0], &[1.0])?;
    o.add_least_squares(function(&g, d, "level", &[lower]), &[10.0], &[0.8], CostAt::Running)?;
    o.add_least_squares(function(&g, d, "u", &[u]), &[0.1], &[0.0], CostAt::Running)?;
    Ok(Problem {
        name: "tanks",
        see: "the upper tank is filled past its brim: the only way to the lower one",
        ocp: o,
        time: "time",
        states: &["level of upper tank", "level of lower tank"],
        controls: &["inflow"],
        horizon: None,
    })
}

fn friction() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 2, u: 0, p: 1 };
    let (mu, n) = (0.37, 8);
    let rest = 1.0 / mu;
    let position = |t: f64| if t < rest { t - 0.5 * mu * t * t } else { 0.5 * rest };
    let data: Vec<f64> = (1..=n).map(|k| position(4.0 * k as f64 / n as f64)).collect();
    let mut o = problem(&g, d, &[g.x(1), -g.p(0) * g.x(1).sign()], 4.0, n, &set(2, 2));
    o.set_x0(&[0.0, 1.0])?;
    o.set_params(&[0.6])?;
    o.set_param_bounds(&[0.05], &[2.0])?;
    o.add_least_squares(function(&g, d, "q", &[g.x(0)]), &[1.0], &data, CostAt::ControlGrid)?;
    Ok(Problem {
        name: "friction",
        see: "the friction coefficient is found from eight measurements",
        ocp: o,
        time: "time",
        states: &["position", "speed"],
        controls: &[],
        horizon: None,
    })
}
