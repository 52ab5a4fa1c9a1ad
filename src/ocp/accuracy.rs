//! How far an answer is from the system it is meant for: the controls found are simulated by the event-driven engine,
//! which shares neither equations nor grid with the discretisation, and the cost is integrated along.

use super::extend::rebuild;
use super::terms::{combination, Places, Stack};
use crate::error::{Error, Result};
use crate::event::{Engine, Options, Outcome};
use crate::func::{Dims, Point};
use crate::system::{SharedFunction, System};

/// Steps the simulation may take: an answer that needs more is not worth the wait.
const MAX_STEPS: usize = 200_000;

/// Comparison of an answer with the simulation of its controls.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// How the simulation ended; what follows is NaN from where it did not get.
    pub outcome: Outcome,
    /// Why, where the end of the horizon is not reached.
    pub reason: String,
    /// Largest difference of a state at the end of every control stage `[n_stages]`.
    pub stages: Vec<f64>,
    /// The last of them: that at the end of the horizon.
    pub terminal: f64,
    /// Largest violation of a terminal constraint by the end of the simulation.
    pub terminal_violation: f64,
    /// Cost of the simulation.
    pub cost: f64,
    /// Cost of the answer less that of the simulation.
    pub cost_error: f64,
    /// Simulated state at the end `[nx]`.
    pub x_end: Vec<f64>,
    /// Switches of the simulation.
    pub n_switches: usize,
}

/// What is simulated: piecewise constant inputs, and what they are compared with.
pub(super) struct Answer<'a> {
    pub t0: f64,
    pub x0: &'a [f64],
    /// Lengths of the control stages.
    pub durations: &'a [f64],
    /// Controls `[n_stages · nu]` and parameters `[n_stages · np]`.
    pub controls: &'a [f64],
    /// Controls at the ends of the stages, and which are linear in between.
    pub control_ends: &'a [f64],
    pub linear: &'a [bool],
    pub params: &'a [f64],
    /// States at the ends of the stages `[n_stages · nx]`.
    pub states: &'a [f64],
    pub cost: f64,
    pub mayer: Option<&'a SharedFunction>,
    /// Cost at the end of every stage.
    pub grid_cost: Option<&'a SharedFunction>,
    /// Terminal constraints with their bounds.
    pub terminal: Vec<(&'a SharedFunction, &'a [f64], &'a [f64])>,
}

/// An engine for the system with its cost as one more state. Linear controls are states too; their place among the
/// controls is that of their slope.
pub(super) fn engine(system: &System, lagrange: Option<&SharedFunction>, linear: &[bool], rtol: f64) -> Result<Engine> {
    if system.n_algebraic() > 0 || !system.inclusions().is_empty() {
        return Err(Error::Unsupported("event-driven simulation knows neither algebraic states nor inclusions".into()));
    }
    let extended = with_cost(system, lagrange, linear)?;
    Engine::new(&extended, &Options { max_steps: MAX_STEPS, ..Options::with_tolerance(rtol, rtol) })
}

/// Simulates an answer and compares. `engine` is that of [`engine`].
pub(super) fn measure(engine: &mut Engine, answer: &Answer) -> Result<Accuracy> {
    let (nx, n) = (answer.x0.len(), answer.durations.len());
    let (nu, np) = (answer.controls.len() / n, answer.params.len() / n);
    let ramps: Vec<usize> = (0..answer.linear.len()).filter(|&j| answer.linear[j]).collect();
    let mut start = answer.x0.to_vec();
    start.extend(ramps.iter().map(|&j| answer.controls[j]));
    start.push(0.0);
    let mut found = Accuracy {
        outcome: Outcome::Reached,
        reason: String::new(),
        stages: vec![f64::NAN; n],
        terminal: f64::NAN,
        terminal_violation: f64::NAN,
        cost: f64::NAN,
        cost_error: f64::NAN,
        x_end: vec![f64::NAN; nx],
        n_switches: 0,
    };
    engine.reinit(answer.t0, &start)?;
    let mut t = answer.t0;
    let (mut u, mut at_grid) = (vec![0.0; nu], 0.0);
    for k in 0..n {
        engine.set_params(&answer.params[k * np..(k + 1) * np])?;
        u.copy_from_slice(&answer.controls[k * nu..(k + 1) * nu]);
        for &j in &ramps {
            u[j] = (answer.control_ends[k * nu + j] - u[j]) / answer.durations[k].max(f64::MIN_POSITIVE);
        }
        engine.set_controls(&u)?;
        t += answer.durations[k];
        found.outcome = engine.advance(t.max(engine.time()))?;
        found.n_switches = engine.stats().switches;
        if found.outcome != Outcome::Reached {
            found.reason = engine.reason().to_owned();
            return Ok(found);
        }
        let pairs = engine.state()[..nx].iter().zip(&answer.states[k * nx..(k + 1) * nx]);
        found.stages[k] = pairs.fold(0.0, |m, (a, b)| m.max((a - b).abs()));
        if let Some(f) = answer.grid_cost {
            u.copy_from_slice(&answer.control_ends[k * nu..(k + 1) * nu]);
            let at = Point { t, x: &engine.state()[..nx], u: &u, p: &answer.params[k * np..(k + 1) * np] };
            at_grid += values(f, &at)[0];
        }
    }
    found.terminal = found.stages[n - 1];
    found.x_end.copy_from_slice(&engine.state()[..nx]);
    u.copy_from_slice(&answer.control_ends[(n - 1) * nu..]);
    let at = Point { t, x: &found.x_end, u: &u, p: &answer.params[(n - 1) * np..] };
    found.cost = at_grid + engine.state()[nx + ramps.len()];
    if let Some(m) = answer.mayer {
        found.cost += values(m, &at)[0];
    }
    found.cost_error = answer.cost - found.cost;
    let mut worst = 0f64;
    for (f, lower, upper) in &answer.terminal {
        for (v, (l, u)) in values(f, &at).iter().zip(lower.iter().zip(*upper)) {
            // a value that does not exist violates
            worst = if v.is_nan() { f64::NAN } else { worst.max(l - v).max(v - u) };
        }
    }
    found.terminal_violation = worst;
    Ok(found)
}

fn values(f: &SharedFunction, at: &Point) -> Vec<f64> {
    let mut out = vec![f64::NAN; f.n_out()];
    if f.value(at, &mut out, &mut vec![0.0; f.work_len()]).is_err() {
        out.fill(f64::NAN);
    }
    out
}

/// The system with its linear controls, then the integral of `lagrange` as its last states.
fn with_cost(system: &System, lagrange: Option<&SharedFunction>, linear: &[bool]) -> Result<System> {
    let d = system.dims();
    let ramps: Vec<usize> = (0..linear.len()).filter(|&j| linear[j]).collect();
    let wide = Dims { x: d.x + ramps.len() + 1, ..d };
    let mut columns = Places::leading(wide).columns(d, wide);
    for (k, &j) in ramps.iter().enumerate() {
        columns[d.x + j] = d.x + k;
    }
    let all = || (0..wide.n_in()).collect::<Vec<usize>>();
    let own = |f: &SharedFunction| (f.clone(), columns.clone());
    let zeros = |n: usize| (combination("0", wide, vec![Vec::new(); n]), all());
    let slopes = combination("slopes", wide, ramps.iter().map(|&j| vec![(wide.x + j, 1.0)]).collect());
    let f0 = system.f0().map_or_else(|| zeros(d.x), own);
    let rate = lagrange.map_or_else(|| zeros(1), own);
    let f0 = Stack::of("f0", wide, vec![f0, (slopes, all()), rate]);
    rebuild(system, wide, Some(f0), |f| Stack::gather(f, wide, columns.clone()))
}
