//! Optimal control problems from the literature, each from its default start: how it ended, what is left of the residuals,
//! how far a simulation of the controls ends from the solution, and where the time went.

use super::{settings, short};
use crate::json::{Object, Table};
use crate::models::{sliding_ocp, INF, PI};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::sync::Arc;
use std::time::Instant;
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::Model;
use switchback::nlp::Control;
use switchback::ocp::{CostAt, Durations, Ocp, OcpResult};
use switchback::settings::{Discretisation, RkFamily, Settings};
use switchback::system::SharedFunction;

struct Problem {
    name: &'static str,
    /// What to see in the plot.
    see: &'static str,
    ocp: Ocp,
}

fn set(n_s: usize, n_fe: usize) -> Settings {
    settings(RkFamily::RadauIia, n_s, n_fe, Discretisation::Fesd)
}

fn function(g: &Graph, d: Dims, name: &str, outputs: &[Expr]) -> SharedFunction {
    Arc::new(g.function(name, d, outputs).expect("the function is well formed"))
}

/// A problem of a model given by its right-hand side.
fn problem(g: &Graph, d: Dims, rhs: &[Expr], horizon: f64, n_stages: usize, set: &Settings) -> Ocp {
    let built = Model::from_rhs("model", d.u, d.p, rhs).and_then(|m| m.build(g)).expect("the model is well formed");
    Ocp::new(&built.system, horizon, n_stages, set).expect("the problem is well posed")
}

fn sliding() -> Problem {
    let see = "two curves catch the state one after the other, and let it go again";
    Problem { name: "sliding-mode", see, ocp: sliding_ocp(&set(3, 4)) }
}

/// Full throttle, three times the acceleration above 15, no faster than 25.
fn turbo_car() -> switchback::error::Result<Problem> {
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
    Ok(Problem { name: "turbo-car", see, ocp: o })
}

fn cart_pole() -> switchback::error::Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 4, u: 1, p: 0 };
    let (a, v, w, u) = (g.x(1), g.x(2), g.x(3), g.u(0));
    let push = u - 2.0 * v.sign();
    let reach = 1.0 + 0.1 * a.sin().powi(2);
    let cart = (push + 0.1 * a.sin() * (w * w + 9.81 * a.cos())) / reach;
    let pole = -(a.cos() * (push + 0.1 * w * w * a.sin()) + 1.1 * 9.81 * a.sin()) / reach;
    let mut o = problem(&g, d, &[v, w, cart, pole], 4.0, 20, &set(3, 2));
    o.set_x0(&[1.0, 0.0, 0.0, 0.0])?;
    o.set_u_bounds(&[-30.0], &[30.0])?;
    let goal = [0.0, PI, 0.0, 0.0];
    let states = function(&g, d, "x", &[g.x(0), a, v, w]);
    o.add_least_squares(states.clone(), &[1.0, 100.0, 1.0, 1.0], &goal, CostAt::Running)?;
    o.add_least_squares(function(&g, d, "u", &[u]), &[1.0], &[0.0], CostAt::Running)?;
    o.add_least_squares(states, &[100.0, 100.0, 10.0, 10.0], &goal, CostAt::Terminal)?;
    Ok(Problem { name: "cart-pole", see: "the cart swings the pole up against its dry friction", ocp: o })
}

fn motor() -> switchback::error::Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 5, u: 1, p: 0 };
    let [a, b, va, vb, i] = [g.x(0), g.x(1), g.x(2), g.x(3), g.x(4)];
    let u = g.u(0);
    let spring = 8.0 * (a - b) + 0.2 * (va - vb);
    let rhs = [va, vb, 5.0 * i - spring, spring - 0.8 * vb.sign(), 10.0 * (u - va - 0.5 * i)];
    let mut o = problem(&g, d, &rhs, 3.0, 12, &set(3, 3));
    o.set_x0(&[0.0; 5])?;
    o.set_u_bounds(&[-4.0], &[4.0])?;
    o.set_lagrange(function(&g, d, "loss", &[u * u + 0.1 * i * i]))?;
    let goal = [1.0, 1.0, 0.0, 0.0, 0.0];
    o.add_terminal(function(&g, d, "goal", &[a, b, va, vb, i]), &goal, &goal)?;
    Ok(Problem { name: "motor", see: "friction holds the load until the spring is wound up", ocp: o })
}

fn blocks() -> switchback::error::Result<Problem> {
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
    })
}

fn tanks() -> switchback::error::Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 2, u: 1, p: 0 };
    let (upper, lower, u) = (g.x(0), g.x(1), g.u(0));
    let over = upper.gt(1.0).select(4.0 * (upper - 1.0), g.constant(0.0));
    let mut o = problem(&g, d, &[u - over - 0.1 * upper, over - 0.3 * lower], 10.0, 10, &set(3, 2));
    o.set_x0(&[0.2, 0.0])?;
    o.set_u_bounds(&[0.0], &[1.0])?;
    o.add_least_squares(function(&g, d, "level", &[lower]), &[10.0], &[0.8], CostAt::Running)?;
    o.add_least_squares(function(&g, d, "u", &[u]), &[0.1], &[0.0], CostAt::Running)?;
    Ok(Problem { name: "tanks", see: "the upper tank is filled past its brim: the only way to the lower one", ocp: o })
}

fn friction() -> switchback::error::Result<Problem> {
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
    Ok(Problem { name: "friction", see: "the friction coefficient is found from eight measurements", ocp: o })
}

pub fn run(c: &Context) {
    let made = [turbo_car(), cart_pole(), motor(), blocks(), tanks(), friction()];
    let problems = std::iter::once(sliding()).chain(made.into_iter().map(|p| p.expect("the data fit")));
    let columns = ["problem", "cost", "outcome", "polish", "primal", "dual", "pairs", "E(T)", "cost error"];
    let times = ["ms", "build ms", "eval ms", "la ms", "it", "switches"];
    let mut table = Table::new(&[&columns[..], &times].concat());
    let mut seen = String::new();
    for mut p in problems {
        let clock = Instant::now();
        let r = p.ocp.solve(&mut Control::default()).expect("the problem is well posed").clone();
        let seconds = clock.elapsed().as_secs_f64();
        let nan = (f64::NAN, f64::NAN);
        let (error, cost_error) = r.accuracy.as_ref().map_or(nan, |a| (a.terminal, a.cost_error));
        let polish = format!("{:?}", r.polish).to_lowercase();
        let residuals = [r.residuals.primal, r.residuals.dual, r.residuals.pair_min];
        let o = Object::new().text("case", "gallery").text("problem", p.name).num("cost", r.cost);
        let o = o.text("outcome", r.outcome.name()).text("polish", &polish).list("residuals", &residuals);
        let o = o.num("error", error).num("cost_error", cost_error).num("wall_s", seconds);
        let o = o.num("build_s", r.time_build).num("eval_s", r.stats.time_eval).num("linalg_s", r.stats.time_linalg);
        c.record(&o.int("iterations", r.stats.iterations).int("switches", r.trajectory.switches.len()));
        let mut row = vec![p.name.into(), format!("{:.8}", r.cost), r.outcome.name().into(), polish];
        row.extend(residuals.iter().chain(&[error, cost_error]).map(|v| short(*v)));
        let spent = [seconds, r.time_build, r.stats.time_eval, r.stats.time_linalg];
        row.extend(spent.iter().map(|s| format!("{:.1}", 1e3 * s)));
        row.extend([r.stats.iterations.to_string(), r.trajectory.switches.len().to_string()]);
        table.row(row);
        seen.push_str(&format!("{}: {}\n", p.name, p.see));
        plot(c, p.name, &r);
    }
    c.say(&table.text());
    c.say(&seen);
}

fn plot(c: &Context, name: &str, r: &OcpResult) {
    let times = r.trajectory.times();
    let (from, to) = (times[0], times[times.len() - 1]);
    let mut plot = Plot::new(name, "t", "states, controls");
    let mut x = vec![0.0; r.trajectory.nx()];
    for i in 0..r.trajectory.nx() {
        let at = |k: i32| from + (to - from) * f64::from(k) / 400.0;
        let line = (0..=400).filter_map(|k| r.trajectory.state(at(k), &mut x).ok().map(|()| (at(k), x[i]))).collect();
        plot.add(&format!("x{}", i + 1), Mark::Line, line);
    }
    let nu = r.controls.len() / r.durations.len();
    for j in 0..nu {
        let mut t = from;
        let mut steps = Vec::new();
        for (k, h) in r.durations.iter().enumerate() {
            steps.push((t, r.controls[k * nu + j]));
            t += h;
        }
        steps.push((t, r.controls[(r.durations.len() - 1) * nu + j]));
        plot.add(&format!("u{}", j + 1), Mark::Steps, steps);
    }
    c.plot(&plot, &format!("gallery-{name}.svg"));
}
