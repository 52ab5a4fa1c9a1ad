//! What the controls of an answer that is no solution miss in a simulation.

use super::answer::Answer;
use super::options::Options;
use super::problem::Problem;
use super::scales;
use super::simulate::{simulate_with, Effort, Inputs, Simulated, MAX_EVENTS};
use crate::func::Point;

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

/// What the controls of an answer miss most in a simulation, as a share of the size that states of their sizes give a constraint: path constraints at the
/// ends of stages, the conditions at the end, and bounded states at the ends of stages. Nothing where a simulation meets them all or does not reach the end.
pub(super) fn missed(p: &Problem, o: &Options, a: &Answer, s: &Simulated) -> Option<Missed> {
    let (g, n, nx) = (&p.given, p.n_stages(), p.given.dims.x);
    (s.times.len() == n + 1).then_some(())?;
    let f = Filled::of_answer(p, a);
    let sizes = scales::of_states(p, &o.x0);
    let mut worst: Option<(f64, Missed)> = None;
    let mut note = |of: Of, value: f64, [l, u]: [f64; 2], size: f64| {
        let by = (l - value).max(value - u);
        let share = by / if size > 0.0 { size } else { 1.0 };
        if share > MET && worst.as_ref().is_none_or(|w| share > w.0) {
            worst = Some((share, Missed { of, by, value }));
        }
    };
    let state = |end: usize| &s.states[end * nx..(end + 1) * nx];
    let both = [state(0), state(n)].concat();
    let along = (0..n).flat_map(|k| g.path.iter().map(move |c| (&c.f, [&c.lower, &c.upper], k, state(k + 1))));
    let at_the_end = g.terminal.iter().map(|c| (&c.f, [&c.lower, &c.upper], n - 1, state(n)));
    let at_both = g.boundary.iter().map(|c| (&c.f, [&c.lower, &c.upper], n - 1, &both[..]));
    for (function, [lower, upper], k, x) in along.chain(at_the_end).chain(at_both) {
        let (u, q) = (&f.controls[k * g.wide.u..(k + 1) * g.wide.u], &f.params[k * g.wide.p..(k + 1) * g.wide.p]);
        let at = Point { t: s.times[k + 1], x, u, p: q };
        let mut values = vec![0.0; function.n_out()];
        function.value(&at, &mut values, &mut vec![0.0; function.work_len()]).ok()?;
        for (i, (v, size)) in values.iter().zip(scales::of_values(function, &at, &sizes)).enumerate() {
            note(Of::Function(function.name().to_owned(), i), *v, [lower[i], upper[i]], size);
        }
    }
    for (k, i) in (0..n).flat_map(|k| (0..nx).map(move |i| (k, i))) {
        note(Of::State(i), state(k + 1)[i], [g.x_bounds[0][i], g.x_bounds[1][i]], sizes[i]);
    }
    worst.map(|w| w.1)
}
