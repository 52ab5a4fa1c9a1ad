//! What the controls of an answer that is no solution miss in a simulation.

use super::answer::Answer;
use super::options::Options;
use super::problem::Problem;
use super::scales;
use super::simulate::{simulate_with, Effort, Inputs, Simulated, MAX_EVENTS};
use crate::func::Point;
use crate::system::SharedFunction;

/// Tolerance, relative to the sizes of the states, and steps of a simulation.
const EFFORT: Effort =
    Effort { tolerance: 1e-7, sizes: &[], max_steps: 4000, max_events: MAX_EVENTS, dense: false, bounded: false };
/// Share of its size by which a constraint is missed that counts as met.
const MET: f64 = 1e-6;

/// Everything a simulation needs.
struct Filled {
    x0: Vec<f64>,
    controls: Vec<f64>,
    durations: Vec<f64>,
    params: Vec<f64>,
}

impl Filled {
    /// What an answer has, with its controls within their bounds: the point of a program that failed need not be.
    fn of_answer(p: &Problem, a: &Answer) -> Filled {
        let (g, wide) = (&p.given, p.given.wide.u.max(1));
        let bounded = |(k, u): (usize, &f64)| u.max(g.u_bounds[0][k % wide]).min(g.u_bounds[1][k % wide]);
        let mut params = g.params.clone();
        for &(j, value) in &a.params {
            (0..p.n_stages()).for_each(|k| params[k * g.wide.p + j] = value);
        }
        let controls = a.controls().iter().enumerate().map(bounded).collect();
        Filled { x0: a.x0.clone(), controls, durations: a.durations(p.n_stages()), params }
    }

    fn inputs(&self) -> Inputs<'_> {
        Inputs { x0: &self.x0, controls: &self.controls, durations: &self.durations, params: &self.params }
    }
}

/// A constraint with its bounds.
enum Constraint<'a> {
    Function { f: &'a SharedFunction, at: Point<'a>, bounds: [&'a [f64]; 2] },
    State { i: usize, value: f64, bounds: [f64; 2] },
}

/// Path constraints at the ends of stages, the conditions at the end, and bounded states at the ends of stages, given the times and states there.
fn for_every_constraint(
    p: &Problem,
    f: &Filled,
    (times, states): (&[f64], &[f64]),
    mut each: impl FnMut(Constraint) -> Option<()>,
) -> Option<()> {
    let (g, n) = (&p.given, p.n_stages());
    let nx = g.dims.x;
    let state = |end: usize| &states[end * nx..(end + 1) * nx];
    let at = |k: usize, x| {
        let (u, q) = (&f.controls[k * g.wide.u..(k + 1) * g.wide.u], &f.params[k * g.wide.p..(k + 1) * g.wide.p]);
        Point { t: times[k + 1], x, u, p: q }
    };
    for k in 0..n {
        for c in &g.path {
            each(Constraint::Function { f: &c.f, at: at(k, state(k + 1)), bounds: [&c.lower, &c.upper] })?;
        }
    }
    for c in &g.terminal {
        each(Constraint::Function { f: &c.f, at: at(n - 1, state(n)), bounds: [&c.lower, &c.upper] })?;
    }
    let both = [state(0), state(n)].concat();
    for c in &g.boundary {
        each(Constraint::Function { f: &c.f, at: at(n - 1, &both), bounds: [&c.lower, &c.upper] })?;
    }
    for k in 0..n {
        for i in 0..nx {
            let bounds = [g.x_bounds[0][i], g.x_bounds[1][i]];
            if bounds.iter().any(|b| b.is_finite()) {
                each(Constraint::State { i, value: state(k + 1)[i], bounds })?;
            }
        }
    }
    Some(())
}

/// What a motion misses, in the unit of the problem.
#[derive(Debug, Clone)]
pub struct Missed {
    /// The constraint.
    pub of: Of,
    /// How far its value is outside of its bounds.
    pub by: f64,
    /// The value.
    pub value: f64,
}

/// A constraint in words of the problem.
#[derive(Debug, Clone)]
pub enum Of {
    /// An output of a function.
    Function(String, usize),
    /// A state.
    State(usize),
}

/// A simulation of the controls of an answer that is no solution.
pub(super) fn simulation(p: &Problem, o: &Options, a: &Answer) -> Option<Simulated> {
    let sizes = scales::of_states(p, &o.x0);
    simulate_with(p, Filled::of_answer(p, a).inputs(), Effort { sizes: &sizes, ..EFFORT }).ok()
}

/// What the controls of an answer miss most in a simulation, as a share of the size that states of their sizes give a constraint; nothing
/// where a simulation meets all constraints or does not reach the end.
pub(super) fn missed(p: &Problem, o: &Options, a: &Answer, s: &Simulated) -> Option<Missed> {
    let f = Filled::of_answer(p, a);
    let sizes = scales::of_states(p, &o.x0);
    (s.times.len() == p.n_stages() + 1).then_some(())?;
    let mut worst: Option<(f64, Missed)> = None;
    let mut note = |of: Of, value: f64, [l, u]: [f64; 2], size: f64| {
        let by = (l - value).max(value - u);
        let share = by / if size > 0.0 { size } else { 1.0 };
        if share > MET && worst.as_ref().is_none_or(|w| share > w.0) {
            worst = Some((share, Missed { of, by, value }));
        }
    };
    for_every_constraint(p, &f, (&s.times, &s.states), |c| {
        match c {
            Constraint::Function { f, at, bounds: [lower, upper] } => {
                let mut values = vec![0.0; f.n_out()];
                f.value(&at, &mut values, &mut vec![0.0; f.work_len()]).ok()?;
                for (i, (v, size)) in values.iter().zip(scales::of_values(f, &at, &sizes)).enumerate() {
                    note(Of::Function(f.name().to_owned(), i), *v, [lower[i], upper[i]], size);
                }
            }
            Constraint::State { i, value, bounds } => note(Of::State(i), value, bounds, sizes[i]),
        }
        Some(())
    })?;
    worst.map(|w| w.1)
}
