//! An optimal control problem in its controls, free lengths, parameters and initial states alone: states, cost, constraints and
//! all derivatives come from an event-driven simulation (direct single shooting; derivatives through switches by (6.25)).

mod track;

use super::blocks::Block;
use super::order::{Layout, ModeOrder};
use super::sqp::{Program, Values};
use crate::error::Result;
use crate::event::{self, Engine};
use crate::fesd::{PathAt, Sizes};
use crate::func::Point;
use crate::ocp::accuracy::tolerances;
use crate::ocp::extend::Extended;
use crate::ocp::solve::Built;
use crate::ocp::{Durations, Ocp, OcpResult, SLACK};
use crate::random::SplitMix64;
use crate::stop;
use crate::system::{SharedFunction, System};
use nalgebra::{DMatrix, DVector};

/// Tolerance of the simulations, relative to the sizes of the states, and their steps.
const TOLERANCE: f64 = 1e-8;
const MAX_STEPS: usize = 50_000;
/// Pieces of a stage at whose ends constraints are looked at that hold along it.
const PIECES: usize = 3;
/// Share of the largest multiplier above which a constraint acts at a point.
const ACTS: f64 = 1e-6;
/// Share of a stage below which two points are one, and from a point where a constraint acts to an end of those pieces that is none.
pub(in crate::ocp) const SAME_POINT: f64 = 1e-6;
const NEXT: f64 = 0.05;

/// Where the variables are.
struct Places {
    /// The first one, their number, and that of the variables of all problems that are solved together.
    first: usize,
    n: usize,
    all: usize,
    /// Of the first stage; then those of the others.
    controls: usize,
    /// Of linear controls at the end of the horizon, for each of them.
    ends: Vec<Option<usize>>,
    lengths: usize,
    n_lengths: usize,
    /// Behind parameters and initial states; none where they are given.
    params: Vec<Option<usize>>,
    initial: Vec<Option<usize>>,
}

/// What stands for all that is not varied.
pub(in crate::ocp) struct Given<'a> {
    /// Lengths of the stages.
    pub durations: &'a [f64],
    /// The initial state.
    pub x0: &'a [f64],
    /// About the cost.
    pub cost: f64,
    /// Sizes of states and controls.
    pub usual: &'a Sizes,
    /// Ends of the pieces of every stage as shares of it, the last of which is 1: constraints along the horizon are looked at there.
    pub cuts: Vec<Vec<f64>>,
    /// Do modes go on from a stage to the next, or are they those of the state there?
    pub goes_on: bool,
    /// The order of modes and transitions that a motion has to have.
    pub order: Option<ModeOrder>,
    /// What comes before it.
    pub before: Preceding,
}

/// What comes before a problem among others that are solved together with it.
#[derive(Default, Clone, Copy)]
pub(in crate::ocp) struct Preceding {
    /// Their variables.
    pub n: usize,
    /// Does its initial state follow from their end?
    pub leads_on: bool,
}

/// The problem in these variables.
pub(in crate::ocp) struct Shooting<'a> {
    ocp: &'a Ocp,
    e: &'a Extended,
    engine: Engine,
    /// Simulates without derivatives, once that was asked for.
    plain: Option<Engine>,
    /// Does the system depend on the time?
    timed: bool,
    pub(super) goes_on: bool,
    /// The order of modes and transitions that a motion has to have.
    order: Option<ModeOrder>,
    layout: Layout,
    /// Are second derivatives of the cost asked for? Those of the stage, by its inputs, with states and controls linear in them.
    is_curved: bool,
    curvature: Option<DMatrix<f64>>,
    /// What depends on the state at the end of the horizon, while that is taken down.
    ends: Option<AtEnd>,
    /// Steps of simulations so far.
    pub steps: usize,
    /// About the cost.
    cost: f64,
    /// Linear controls, which are states of the simulation behind the cost.
    ramps: Vec<usize>,
    at: Places,
    /// Parameters of every stage, as they are where they are given.
    params: Vec<f64>,
    /// Lengths of the stages, shares of the horizon where only that is free.
    lengths: Vec<f64>,
    x0: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    sizes: Vec<f64>,
    row_lower: Vec<f64>,
    row_upper: Vec<f64>,
    /// Sizes of the states and of the controls.
    usual: Sizes,
    /// Ends of the pieces of every stage as shares of it, the last of which is 1.
    cuts: Vec<Vec<f64>>,
}

/// Derivatives by the state at the end of the horizon of what depends on it there.
#[derive(Default)]
pub(in crate::ocp) struct AtEnd {
    /// Of the cost, none where that does not.
    pub cost: Vec<f64>,
    /// Of constraints by their numbers.
    pub rows: Vec<(usize, Vec<f64>)>,
}

/// What a row of the constraints belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ocp) enum RowOf {
    /// A path constraint by its number.
    Path(usize),
    /// The bounds of a state.
    State(usize),
    /// A terminal constraint.
    Terminal(usize),
    /// A constraint between both ends.
    Boundary(usize),
}

/// A point between stages with its derivatives by the variables.
#[derive(Clone)]
pub(super) struct Node {
    /// Is it the start of the horizon?
    pub begins: bool,
    pub t: f64,
    pub dt: DVector<f64>,
    /// States of the simulation: cost, linear controls, states.
    pub x: Vec<f64>,
    /// Of the states alone, `[nx × n]`.
    pub dx: DMatrix<f64>,
}

/// A point within a stage with its derivatives by the inputs of that.
struct Here {
    /// Is it the start of the horizon?
    begins: bool,
    /// Are the controls others than before?
    is_new: bool,
    t: f64,
    dt: DVector<f64>,
    /// States of the simulation: cost, linear controls, states.
    x: Vec<f64>,
    dx: DMatrix<f64>,
    /// Controls, linear ones at this point.
    u: Vec<f64>,
    du: DMatrix<f64>,
    p: Vec<f64>,
    dp: DMatrix<f64>,
}

/// Where the inputs of a stage are: the state and the time at its start, controls there, linear ones at its end, its length, parameters.
#[derive(Clone, Copy)]
struct Inputs {
    time: usize,
    controls: usize,
    ends: usize,
    length: usize,
    params: usize,
    n: usize,
}

/// Half of what lies between two bounds, or else what the value is.
fn size_of(value: f64, lower: f64, upper: f64, usual: f64) -> f64 {
    match (upper - lower).is_finite() && upper > lower {
        true => 0.5 * (upper - lower),
        false if value.abs().max(usual) > 0.0 => value.abs().max(usual),
        false => 1.0,
    }
}

/// Tolerances of simulations of the system with its cost.
fn options(ocp: &Ocp, cost: f64, usual: &Sizes) -> event::Options {
    let ramps = (0..ocp.linear.len()).filter(|&j| ocp.linear[j]).map(|j| usual.u.get(j).copied().unwrap_or(1.0));
    let sizes: Vec<f64> = std::iter::once(ocp.cost_size(cost)).chain(ramps).chain(usual.x.iter().copied()).collect();
    event::Options { max_steps: MAX_STEPS, ..tolerances(TOLERANCE, &sizes) }
}

/// An engine for points of descents, which may lie beyond the bounds that contacts were left out for; ends are traced within them.
fn on_the_way(system: &System, options: &event::Options) -> Result<Engine> {
    let mut engine = Engine::new(system, options)?;
    engine.pass_bounds();
    Ok(engine)
}

/// States with bounds.
fn bounded(ocp: &Ocp) -> Vec<usize> {
    let b = &ocp.x_bounds;
    (0..b[0].len()).filter(|&i| b[0][i].is_finite() || b[1][i].is_finite()).collect()
}

impl<'a> Shooting<'a> {
    /// Of an answer, with the multipliers that say where constraints act in it.
    pub(super) fn beside(ocp: &'a Ocp, b: &'a Built, r: &OcpResult, usual: &Sizes) -> Result<Shooting<'a>> {
        let x0 = r.trajectory.elements.first().map_or_else(|| vec![0.0; b.extended.system.dims().x], |e| e.x0.clone());
        let cuts = Shooting::cuts_of(ocp, b);
        let (durations, cost) = (&r.durations[..], r.cost_reached);
        // modes are those of the state, where nothing has a memory that it does not tell
        let (goes_on, before) = (ocp.is_simulated(), Preceding::default());
        let given = Given { durations, x0: &x0, cost, usual, cuts, goes_on, order: None, before };
        Shooting::new(ocp, &b.extended, given)
    }

    /// Of a problem that nothing has solved yet, `e` with the parameters of every stage.
    pub fn new(ocp: &'a Ocp, e: &'a Extended, given: Given) -> Result<Shooting<'a>> {
        let usual = given.usual;
        let (d, n) = (e.system.dims(), ocp.n_stages);
        let ramps: Vec<usize> = (0..ocp.linear.len()).filter(|&j| ocp.linear[j]).collect();
        let control_size = |j: usize| usual.u.get(j).copied().unwrap_or(1.0);
        let with_derivatives = event::Options { sensitivity: true.into(), ..options(ocp, given.cost, usual) };
        let mut s = Shooting {
            ocp,
            e,
            engine: on_the_way(&ocp.system_with_cost(e)?, &with_derivatives)?,
            plain: None,
            timed: e.system.depends_on_time(),
            goes_on: given.goes_on,
            order: given.order,
            layout: Layout::of(&ocp.system),
            is_curved: false,
            curvature: None,
            ends: None,
            steps: 0,
            cost: given.cost,
            at: Places {
                first: given.before.n,
                n: 0,
                all: 0,
                controls: given.before.n,
                ends: vec![None; ocp.linear.len()],
                lengths: 0,
                n_lengths: 0,
                params: vec![None; d.p],
                initial: vec![None; d.x],
            },
            ramps,
            params: e.params.clone(),
            lengths: given.durations.to_vec(),
            x0: given.x0.to_vec(),
            lower: Vec::new(),
            upper: Vec::new(),
            sizes: Vec::new(),
            row_lower: Vec::new(),
            row_upper: Vec::new(),
            usual: usual.clone(),
            cuts: given.cuts,
        };
        for k in 0..n {
            (0..d.u).for_each(|j| s.control(k, j, &control_size));
        }
        for j in s.ramps.clone() {
            s.at.ends[j] = Some(s.next());
            s.control(n - 1, j, &control_size);
        }
        s.at.lengths = s.next();
        s.at.n_lengths = match ocp.time {
            Durations::Horizon => 1,
            Durations::Stages => n,
            Durations::Fixed => 0,
        };
        let horizon: f64 = s.lengths.iter().sum();
        for k in 0..s.at.n_lengths {
            let value = if s.at.n_lengths == 1 { horizon } else { s.lengths[k] };
            s.variable(ocp.time_bounds, size_of(value, ocp.time_bounds[0], ocp.time_bounds[1], 0.0));
        }
        for j in 0..d.p {
            let bounds = match &ocp.p_bounds {
                _ if e.slack_params.contains(&j) => [0.0, f64::INFINITY],
                Some([l, u]) if j < l.len() && l[j] < u[j] => [l[j], u[j]],
                _ => continue,
            };
            s.at.params[j] = Some(s.next());
            s.variable(bounds, size_of(s.params[j], bounds[0], bounds[1], 0.0));
        }
        for i in 0..d.x {
            let bounds = [ocp.x0_bounds[0][i], ocp.x0_bounds[1][i]];
            if bounds[0] < bounds[1] && !given.before.leads_on {
                s.at.initial[i] = Some(s.next());
                s.variable(bounds, size_of(s.x0[i], bounds[0], bounds[1], usual.x[i]));
            }
        }
        (s.at.n, s.at.all) = (s.lower.len(), s.next());
        s.count_rows();
        Ok(s)
    }

    /// Ends of the pieces of every stage: where some constraint holds along it, equal pieces, and the points at which one acts in the
    /// answer, which a descent would violate between those.
    fn cuts_of(ocp: &Ocp, b: &Built) -> Vec<Vec<f64>> {
        let s = b.solver.solution();
        Shooting::cuts(ocp, &b.extended, b.problem.acting_shares(&s.x, &s.y, &s.z, ACTS))
    }

    /// The same with the shares of every stage at which constraints act, or are violated.
    pub fn cuts(ocp: &Ocp, e: &Extended, mut cuts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        if bounded(ocp).is_empty() && e.path.iter().all(|c| c.at == PathAt::ControlGrid) {
            return vec![vec![1.0]; ocp.n_stages];
        }
        for cuts in &mut cuts {
            cuts.sort_by(f64::total_cmp);
            cuts.retain(|c| (SAME_POINT..1.0 - SAME_POINT).contains(c));
            cuts.dedup_by(|b, a| *b - *a < SAME_POINT);
            let equal = (1..PIECES).map(|i| i as f64 / PIECES as f64);
            let apart: Vec<f64> = equal.filter(|e| cuts.iter().all(|c| (c - e).abs() > NEXT)).collect();
            cuts.extend(apart);
            cuts.push(1.0);
            cuts.sort_by(f64::total_cmp);
        }
        cuts
    }

    /// Number of variables.
    pub fn n(&self) -> usize {
        self.at.n
    }

    /// Says how many variables there are with those of all problems that are solved together.
    pub(super) fn set_all(&mut self, n: usize) {
        self.at.all = n;
    }

    /// Where the next variable is placed.
    fn next(&self) -> usize {
        self.at.first + self.lower.len()
    }

    fn variable(&mut self, [l, u]: [f64; 2], size: f64) {
        self.lower.push(l);
        self.upper.push(u);
        self.sizes.push(size);
    }

    fn control(&mut self, stage: usize, j: usize, size: &dyn Fn(usize) -> f64) {
        let [l, u] = self.ocp.bounds_of_control(stage, j);
        self.variable([l, u], size_of(0.0, l, u, size(j)));
    }

    /// Place of the control at the start of stage `k`; at its end where it is linear.
    fn control_at(&self, k: usize, j: usize) -> usize {
        match self.at.ends.get(j).copied().flatten() {
            Some(end) if k == self.ocp.n_stages => end,
            _ => self.at.controls + k * self.e.system.dims().u + j,
        }
    }

    /// Variables of an answer, its own alone: its controls and, where they are linear, their ends `[n_stages · nu]`, lengths, parameters, initial states.
    fn start(&self, controls: &[f64], ends: &[f64]) -> Vec<f64> {
        let (nu, n, first) = (self.e.system.dims().u, self.ocp.n_stages, self.at.first);
        let mut z = vec![0.0; self.at.n];
        z[..n * nu].copy_from_slice(controls);
        for (j, at) in self.at.ends.iter().enumerate() {
            at.iter().for_each(|&at| z[at - first] = ends[(n - 1) * nu + j]);
        }
        let lengths = &mut z[self.at.lengths - first..][..self.at.n_lengths];
        match lengths {
            [one] => *one = self.lengths.iter().sum(),
            all => all.copy_from_slice(&self.lengths[..all.len()]),
        }
        let given = self.at.params.iter().zip(&self.params).chain(self.at.initial.iter().zip(&self.x0));
        given.for_each(|(at, v)| at.iter().for_each(|&at| z[at - first] = *v));
        z
    }

    /// Variables with controls of the user and their ends, `[n_stages · nu]` each; slacks are as in the solution that the problem `b` has.
    pub(super) fn place(&self, b: &Built, controls: (&[f64], &[f64])) -> Vec<f64> {
        let w = &b.solver.solution().x;
        self.place_among([b.problem.controls(w), b.problem.control_ends(w)], controls)
    }

    /// The same among controls and slacks `[n_stages · nu]` that are given.
    pub fn place_among(&self, mut all: [Vec<f64>; 2], (controls, ends): (&[f64], &[f64])) -> Vec<f64> {
        let (own, wide) = (self.ocp.system.dims().u.max(1), self.e.system.dims().u.max(1));
        for (all, moved) in all.iter_mut().zip([controls, ends]) {
            for (all, moved) in all.chunks_mut(wide).zip(moved.chunks(own)) {
                all[..moved.len()].copy_from_slice(moved);
            }
        }
        self.start(&all[0], &all[1])
    }

    /// What a simulation makes of controls of the user and their ends, see [`Shooting::place`]; `None` where it fails.
    pub(super) fn simulated(&mut self, b: &Built, controls: (&[f64], &[f64])) -> Result<Option<Values>> {
        self.values_at(&self.place(b, controls))
    }

    /// Takes the engine without derivatives instead of the usual one, or back.
    pub(super) fn exchange_plain(&mut self) -> Result<()> {
        let plain = match self.plain.take() {
            Some(e) => e,
            None => on_the_way(&self.ocp.system_with_cost(self.e)?, &self.options())?,
        };
        self.plain = Some(self.exchange(plain));
        Ok(())
    }

    /// The time that the last simulation has reached.
    pub(super) fn time(&self) -> f64 {
        self.engine.time()
    }

    /// Simulates by another engine, until the one before comes back.
    pub(super) fn exchange(&mut self, engine: Engine) -> Engine {
        std::mem::replace(&mut self.engine, engine)
    }

    /// An engine that keeps all events and dense output.
    pub(super) fn tracing(&self) -> Result<Engine> {
        let options = event::Options { dense: true, ..self.options() };
        Engine::stopping_for_all(&self.ocp.system_with_cost(self.e)?, &options)
    }

    fn options(&self) -> event::Options {
        options(self.ocp, self.cost, &self.usual)
    }

    /// Do modes go on from a stage to the next?
    pub fn goes_on(&self) -> bool {
        self.goes_on
    }

    /// The problem as it was stated.
    pub fn ocp(&self) -> &'a Ocp {
        self.ocp
    }

    /// The problem that is simulated.
    pub fn extended(&self) -> &Extended {
        self.e
    }

    /// Sizes of states and controls.
    pub fn usual(&self) -> &Sizes {
        &self.usual
    }

    /// Are second derivatives of the cost asked for from here on?
    pub(super) fn ask_curvature(&mut self, asked: bool) {
        self.is_curved = asked;
    }

    /// Number of control stages.
    pub fn n_stages(&self) -> usize {
        self.ocp.n_stages
    }

    /// States of the simulation in front of those of the system: the cost, linear controls.
    pub fn n_front(&self) -> usize {
        1 + self.ramps.len()
    }

    /// Controls and slacks `[n_stages · nu]` among variables, linear ones at the start of every stage.
    pub fn all_controls(&self, z: &[f64]) -> Vec<f64> {
        let nu = self.e.system.dims().u;
        (0..self.ocp.n_stages)
            .flat_map(|k| (0..nu).map(move |j| (k, j)))
            .map(|(k, j)| z[self.control_at(k, j)])
            .collect()
    }

    /// Those of the user among these.
    pub fn own_controls(&self, z: &[f64]) -> Vec<f64> {
        let (own, wide) = (self.ocp.system.dims().u, self.e.system.dims().u.max(1));
        self.all_controls(z).chunks(wide).flat_map(|u| u[..own].to_vec()).collect()
    }

    /// Parameters `[np]` among variables, those of the first stage where they are given.
    pub fn all_params(&self, z: &[f64]) -> Vec<f64> {
        self.at.params.iter().zip(&self.params).map(|(at, given)| at.map_or(*given, |at| z[at])).collect()
    }

    /// Variables with controls of the user and their ends, `[n_stages · nu]` each, and slacks as they are at first.
    pub fn place_fresh(&self, controls: (&[f64], &[f64])) -> Vec<f64> {
        let all = vec![SLACK; self.ocp.n_stages * self.e.system.dims().u];
        self.place_among([all.clone(), all], controls)
    }

    /// What every row is of, with its control stage and the share of that behind it.
    pub fn rows(&self) -> Vec<(RowOf, usize, f64)> {
        let mut out = Vec::with_capacity(self.row_lower.len());
        let mut add = |of: RowOf, n: usize, stage: usize, share: f64| {
            out.extend(std::iter::repeat_n((of, stage, share), n));
        };
        for k in 0..self.ocp.n_stages {
            self.e.path.iter().enumerate().for_each(|(i, c)| add(RowOf::Path(i), c.lower.len(), k, 0.0));
            for cut in &self.cuts[k] {
                bounded(self.ocp).into_iter().for_each(|s| add(RowOf::State(s), 1, k, *cut));
                let here = self.e.path.iter().enumerate();
                let here = here.filter(|(_, c)| *cut == 1.0 || c.at != PathAt::ControlGrid);
                here.for_each(|(i, c)| add(RowOf::Path(i), c.lower.len(), k, *cut));
            }
        }
        let last = self.ocp.n_stages - 1;
        self.e.terminal.iter().enumerate().for_each(|(i, c)| add(RowOf::Terminal(i), c.lower.len(), last, 1.0));
        self.e.boundary.iter().enumerate().for_each(|(i, c)| add(RowOf::Boundary(i), c.lower.len(), last, 1.0));
        out
    }

    /// What a row is of, in words.
    pub fn row_name(&self, row: usize) -> String {
        match self.rows().get(row) {
            Some((RowOf::Path(i), k, _)) => format!("path constraint {i} in control stage {k}"),
            Some((RowOf::State(i), k, _)) => format!("the bounds of state {i} in control stage {k}"),
            Some((RowOf::Terminal(i), ..)) => format!("terminal constraint {i}"),
            _ => "a constraint between both ends".into(),
        }
    }

    /// A simulation with its derivatives, and those by the state at its end.
    pub fn with_end(&mut self, z: &[f64]) -> Result<Option<(Values, AtEnd)>> {
        self.ends = Some(AtEnd::default());
        let found = self.values_at(z);
        let ends = self.ends.take().unwrap_or_default();
        Ok(found?.map(|v| (v, ends)))
    }

    /// The first parameter among the inputs of a stage.
    pub fn params_of_block(&self) -> usize {
        self.inputs().params
    }

    fn inputs(&self) -> Inputs {
        let d = self.e.system.dims();
        let (time, controls) = (d.x, d.x + 1);
        let (ends, length) = (controls + d.u, controls + d.u + self.ramps.len());
        Inputs { time, controls, ends, length, params: length + 1, n: length + 1 + d.p }
    }

    /// The place of an initial state among the variables, where it is free.
    pub fn initial_at(&self, state: usize) -> Option<usize> {
        self.at.initial[state]
    }

    /// That of a parameter.
    pub fn param_at(&self, j: usize) -> Option<usize> {
        self.at.params[j]
    }

    /// Moves a datum that is no variable, an initial state or a parameter of all stages behind those; returns its size.
    pub fn move_datum(&mut self, datum: usize, by: f64) -> f64 {
        let np = self.e.system.dims().p;
        match datum.checked_sub(self.x0.len()) {
            None => {
                self.x0[datum] += by;
                self.usual.x[datum]
            }
            Some(j) => {
                self.params.chunks_mut(np).for_each(|p| p[j] += by);
                size_of(self.params[j], 0.0, f64::INFINITY, self.usual.p.get(j).copied().unwrap_or(1.0))
            }
        }
    }

    /// Is a control linear on every stage?
    pub fn is_linear(&self, control: usize) -> bool {
        self.at.ends.get(control).is_some_and(Option::is_some)
    }

    /// Draws lengths, parameters and initial states that are free within their bounds; those without two bounds stay, and so do slacks.
    pub(super) fn draw(&self, z: &mut [f64], numbers: &mut SplitMix64) {
        for at in self.at.lengths - self.at.first..self.at.n {
            let (l, u) = (self.lower[at], self.upper[at]);
            if (u - l).is_finite() {
                z[at] = l + (u - l) * numbers.share();
            }
        }
    }

    /// Variables with the controls of the user a stage earlier or later; those at the end stay what they are.
    pub fn shifted(&self, z: &[f64], earlier: bool) -> Vec<f64> {
        let (n, own) = (self.ocp.n_stages, self.ocp.u_bounds[0].len());
        let mut out = z.to_vec();
        for (k, j) in (1..n).flat_map(|k| (0..own).map(move |j| (k, j))) {
            let [before, behind] = [k - 1, k].map(|k| self.control_at(k, j));
            if earlier {
                out[before] = z[behind];
            } else {
                out[behind] = z[before];
            }
        }
        out
    }

    /// Variables with these controls of the user in a stage.
    pub fn with_controls(&self, z: &[f64], stage: usize, u: &[f64]) -> Vec<f64> {
        let mut out = z.to_vec();
        u.iter().enumerate().for_each(|(j, u)| out[self.control_at(stage, j)] = *u);
        out
    }

    /// Controls of the user at both ends of the stages, `[n_stages · nu]` each.
    pub fn user_controls(&self, z: &[f64]) -> [Vec<f64>; 2] {
        let (n, own) = (self.ocp.n_stages, self.ocp.u_bounds[0].len());
        let linear = |j: usize| self.at.ends[j].is_some();
        [0, 1].map(|shift| {
            let of = |k: usize, j: usize| z[self.control_at(if linear(j) { k + shift } else { k }, j)];
            (0..n).flat_map(|k| (0..own).map(move |j| (k, j))).map(|(k, j)| of(k, j)).collect()
        })
    }

    /// Takes the variables over into an answer: user's controls, lengths, parameters, initial state.
    pub fn tell(&self, z: &[f64], r: &mut OcpResult) {
        [r.controls, r.control_ends] = self.user_controls(z);
        (0..self.ocp.n_stages).for_each(|k| r.durations[k] = self.length(z, k).0);
        let count = r.params.len();
        for (p, at) in r.params.iter_mut().zip(&self.at.params[..count]) {
            *p = at.map_or(*p, |at| z[at]);
        }
        if let Some(e) = r.trajectory.elements.first_mut() {
            e.x0.iter_mut().zip(&self.at.initial).for_each(|(x, at)| *x = at.map_or(*x, |at| z[at]));
        }
    }

    /// Lengths of the stages.
    pub fn durations(&self, z: &[f64]) -> Vec<f64> {
        (0..self.ocp.n_stages).map(|k| self.length(z, k).0).collect()
    }

    /// Length of a stage, the variable behind it and its share.
    fn length(&self, z: &[f64], k: usize) -> (f64, Option<(usize, f64)>) {
        match self.at.n_lengths {
            0 => (self.lengths[k], None),
            1 if self.ocp.n_stages > 1 || self.ocp.time == Durations::Horizon => {
                let share = self.lengths[k] / self.lengths.iter().sum::<f64>();
                (share * z[self.at.lengths], Some((self.at.lengths, share)))
            }
            _ => (z[self.at.lengths + k], Some((self.at.lengths + k, 1.0))),
        }
    }

    /// Bounds of all constraints in the order of [`Shooting::evaluate`].
    fn count_rows(&mut self) {
        let mut bounds = [Vec::new(), Vec::new()];
        let mut add = |l: &[f64], u: &[f64]| {
            bounds[0].extend_from_slice(l);
            bounds[1].extend_from_slice(u);
        };
        for k in 0..self.ocp.n_stages {
            self.e.path.iter().for_each(|c| add(&c.lower, &c.upper));
            for cut in &self.cuts[k] {
                for s in bounded(self.ocp) {
                    add(&self.ocp.x_bounds[0][s..=s], &self.ocp.x_bounds[1][s..=s]);
                }
                let last = *cut == 1.0;
                let here = self.e.path.iter().filter(|c| last || c.at != PathAt::ControlGrid);
                here.for_each(|c| add(&c.lower, &c.upper));
            }
        }
        self.e.terminal.iter().for_each(|c| add(&c.lower, &c.upper));
        self.e.boundary.iter().for_each(|c| add(&c.lower, &c.upper));
        [self.row_lower, self.row_upper] = bounds;
    }

    /// The start of the horizon.
    pub(super) fn begin(&self, z: &[f64]) -> Node {
        let (d, n) = (self.e.system.dims(), self.at.all);
        let first = self.n_front();
        let mut node = Node {
            begins: true,
            t: self.ocp.t0,
            dt: DVector::zeros(n),
            x: vec![0.0; first + d.x],
            dx: DMatrix::zeros(d.x, n),
        };
        for (i, at) in self.at.initial.iter().enumerate() {
            node.x[first + i] = at.map_or(self.x0[i], |at| z[at]);
            at.iter().for_each(|&at| node.dx[(i, at)] = 1.0);
        }
        node
    }

    /// The start of stage `k`, and slopes of linear controls on it, which are the controls of the simulation.
    fn enter(&self, z: &[f64], k: usize, node: &Node) -> (Here, (Vec<f64>, DMatrix<f64>)) {
        let (d, i) = (self.e.system.dims(), self.inputs());
        let first = self.n_front();
        let length = self.length(z, k).0;
        let unit = |rows: usize, at: usize| {
            let mut out = DMatrix::zeros(rows, i.n);
            (0..rows).for_each(|r| out[(r, at + r)] = 1.0);
            out
        };
        let param = |j: usize| self.at.params[j].map_or(self.params[k * d.p + j], |at| z[at]);
        let mut here = Here {
            begins: node.begins,
            is_new: true,
            t: node.t,
            dt: DVector::zeros(i.n),
            x: node.x.clone(),
            dx: DMatrix::zeros(first + d.x, i.n),
            u: (0..d.u).map(|j| z[self.control_at(k, j)]).collect(),
            du: unit(d.u, i.controls),
            p: (0..d.p).map(param).collect(),
            dp: unit(d.p, i.params),
        };
        (0..d.x).for_each(|s| here.dx[(first + s, s)] = 1.0);
        here.dt[i.time] = if node.dt.iter().any(|d| *d != 0.0) { 1.0 } else { 0.0 };
        let (mut slope, mut dslope) = (here.u.clone(), here.du.clone());
        for (r, &j) in self.ramps.iter().enumerate() {
            here.x[1 + r] = here.u[j];
            here.dx[(1 + r, i.controls + j)] = 1.0;
            slope[j] = (z[self.control_at(k + 1, j)] - here.u[j]) / length;
            dslope.row_mut(j).fill(0.0);
            dslope[(j, i.ends + r)] = 1.0 / length;
            dslope[(j, i.controls + j)] = -1.0 / length;
            dslope[(j, i.length)] = -slope[j] / length;
        }
        (here, (slope, dslope))
    }

    /// The derivatives of the inputs of stage `k` by the variables; what is behind it is not known yet.
    fn block(&self, z: &[f64], k: usize, node: &Node, here: &Here, first: usize) -> Block {
        let (d, i) = (self.e.system.dims(), self.inputs());
        let mut own: Vec<(usize, usize, f64)> =
            (0..d.u).map(|j| (i.controls + j, self.control_at(k, j), 1.0)).collect();
        own.extend(self.ramps.iter().enumerate().map(|(r, &j)| (i.ends + r, self.control_at(k + 1, j), 1.0)));
        own.extend(self.length(z, k).1.map(|(at, share)| (i.length, at, share)));
        own.extend(self.at.params.iter().enumerate().filter_map(|(j, at)| at.map(|at| (i.params + j, at, 1.0))));
        let mut dense = node.dx.clone();
        if here.dt[i.time] != 0.0 {
            dense = dense.insert_row(d.x, 0.0);
            dense.row_mut(d.x).copy_from(&node.dt.transpose());
        }
        Block {
            begins: node.begins,
            states: d.x,
            n_inputs: i.n,
            dense,
            own,
            next: DMatrix::zeros(0, i.n),
            cost: vec![0.0; i.n],
            first,
            rows: Vec::new(),
            start: Vec::new(),
            curvature: None,
        }
    }

    /// Simulates stage `k` from a point between stages on, and adds its cost and rows; at the last one those of the end of the horizon, whose start is
    /// `start`. Nothing where that does not get to its end.
    fn stage(&mut self, z: &[f64], k: usize, node: &Node, start: &Node, out: &mut Values) -> Result<Option<Node>> {
        let is_last = k + 1 == self.ocp.n_stages;
        let (mut here, (slope, dslope)) = self.enter(z, k, node);
        let (length, by) = self.length(z, k);
        let by = by.map(|_| self.inputs().length);
        let mut block = self.block(z, k, node, &here, out.rows.len());
        let (cost, first) = (here.x[0], self.n_front());
        self.curvature = self.is_curved.then(|| DMatrix::zeros(block.n_inputs, block.n_inputs));
        for c in &self.e.path {
            let found = self.values(&c.f, &here, None);
            self.add(found, false, out, &mut block);
        }
        let mut before = 0.0;
        for i in 0..self.cuts[k].len() {
            let cut = self.cuts[k][i];
            let part = cut - std::mem::replace(&mut before, cut);
            here.is_new = i == 0;
            if !self.piece(&mut here, (&slope, &dslope), part * length, by.map(|at| (at, part)))? {
                return Ok(None);
            }
            let last = cut == 1.0;
            let ends = is_last && last;
            for s in bounded(self.ocp) {
                if let Some(end) = self.ends.as_mut().filter(|_| ends) {
                    let mut by = vec![0.0; here.x.len() - first];
                    by[s] = 1.0;
                    end.rows.push((out.rows.len(), by));
                }
                out.rows.push(here.x[first + s]);
                out.usual.push(self.usual.x[s]);
                block.rows.extend(here.dx.row(first + s).iter());
            }
            for c in self.e.path.iter().filter(|c| last || c.at != PathAt::ControlGrid) {
                let found = self.values(&c.f, &here, None);
                self.add(found, ends, out, &mut block);
            }
        }
        block.cost.iter_mut().zip(here.dx.row(0).iter()).for_each(|(g, v)| *g += v);
        out.cost += here.x[0] - cost;
        let costs = [self.e.grid_cost.as_ref(), self.e.mayer.as_ref().filter(|_| is_last)];
        for f in costs.into_iter().flatten() {
            let Rows { value, slopes, by_state, .. } = self.values(f, &here, None);
            out.cost += value[0];
            block.cost.iter_mut().zip(slopes.row(0).iter()).for_each(|(g, s)| *g += s);
            if let Some(end) = self.ends.as_mut().filter(|_| is_last) {
                end.cost.resize(by_state.ncols(), 0.0);
                end.cost.iter_mut().zip(by_state.row(0).iter()).for_each(|(g, s)| *g += s);
            }
            self.add_curvature(Some(f), &here, 1.0);
        }
        if is_last {
            for c in &self.e.terminal {
                let found = self.values(&c.f, &here, None);
                self.add(found, true, out, &mut block);
            }
            for c in &self.e.boundary {
                let found = self.values(&c.f, &here, Some(start));
                block.start.push((out.rows.len(), found.by_start.clone()));
                self.add(found, true, out, &mut block);
            }
        }
        block.curvature = self.curvature.take().filter(|c| c.iter().any(|v| *v != 0.0));
        let mut node = Node { begins: false, t: here.t, x: here.x, ..node.clone() };
        if self.engine.sensitivity().is_some() {
            self.length(z, k).1.iter().for_each(|(at, share)| node.dt[*at] += share);
            block.next = here.dx.rows(first, self.e.system.dims().x).into_owned();
            node.dx = block.by_variables(&block.next);
            out.push(block, &start.dx);
        }
        Ok(Some(node))
    }

    /// Adds constraints to those of a stage, at the end of the horizon or before.
    fn add(&mut self, found: Rows, is_end: bool, out: &mut Values, block: &mut Block) {
        if let Some(end) = self.ends.as_mut().filter(|_| is_end) {
            let rows = found.by_state.row_iter().map(|r| r.iter().copied().collect());
            end.rows.extend((out.rows.len()..).zip(rows));
        }
        out.rows.extend_from_slice(&found.value);
        out.usual.extend_from_slice(&found.usual);
        found.slopes.row_iter().for_each(|row| block.rows.extend(row.iter()));
    }

    /// Simulates a piece of a stage of this length, which changes with a variable, with these slopes of the controls.
    fn piece(
        &mut self,
        here: &mut Here,
        (slope, dslope): (&[f64], &DMatrix<f64>),
        length: f64,
        by: Option<(usize, f64)>,
    ) -> Result<bool> {
        stop::check()?;
        let end = here.t + length;
        let begins = std::mem::take(&mut here.begins) || !self.goes_on;
        if begins {
            self.engine.reinit(here.t, &here.x)?;
        }
        if begins || here.is_new {
            self.engine.set_params(&here.p)?;
            self.engine.set_controls(slope)?;
        }
        // what begins later is the motion from where it has moved on: ∂x/∂t₀ = −(∂x/∂x₀) ẋ₀
        let moves = self.timed && here.dt.iter().any(|d| *d != 0.0);
        self.engine.begin_derivatives(moves.then_some(end))?;
        let mut rate = vec![0.0; if moves { here.x.len() } else { 0 }];
        if moves {
            self.engine.whole_derivative(&mut rate);
        }
        let cost = self.e.lagrange.as_ref();
        self.add_curvature(cost, here, 0.5 * length);
        let steps = self.engine.stats().steps;
        let reached = length > 0.0 && matches!(self.engine.advance(end)?, event::Outcome::Reached);
        self.steps += self.engine.stats().steps - steps;
        stop::check()?;
        if !reached {
            return Ok(false);
        }
        let (nx, np, nu) = (here.x.len(), here.p.len(), dslope.nrows());
        here.x.copy_from_slice(self.engine.state());
        here.t = end;
        if let Some(s) = self.engine.sensitivity() {
            let s = DMatrix::from_row_slice(nx, nx + np + nu, s);
            let mut dx = s.columns(0, nx) * &here.dx;
            dx += s.columns(nx, np) * &here.dp;
            dx += s.columns(nx + np, nu) * dslope;
            let mut now = DVector::zeros(nx);
            if moves || by.is_some() {
                self.engine.whole_derivative(now.as_mut_slice());
            }
            if moves {
                dx += (&now - s.columns(0, nx) * DVector::from_vec(rate)) * here.dt.transpose();
            }
            if let Some((at, share)) = by {
                let mut column = dx.column_mut(at);
                column += share * now;
                here.dt[at] += share;
            }
            here.dx = dx;
        }
        for (r, &j) in self.ramps.iter().enumerate() {
            here.u[j] = here.x[1 + r];
            let row = here.dx.row(1 + r).into_owned();
            here.du.row_mut(j).copy_from(&row);
        }
        self.add_curvature(cost, here, 0.5 * length);
        Ok(true)
    }

    /// Adds the positive part of the second derivatives of a cost at a point, with this weight, where they are added up. Where it has none
    /// nothing is added: they are a guess.
    fn add_curvature(&mut self, f: Option<&SharedFunction>, here: &Here, weight: f64) {
        let (Some(sum), Some(f)) = (self.curvature.as_mut(), f) else { return };
        let (d, pattern) = (f.dims(), f.hess_pattern());
        let at = Point { t: here.t, x: &here.x[1 + self.ramps.len()..], u: &here.u, p: &here.p };
        let (mut entries, mut work) = (vec![0.0; pattern.nnz()], vec![0.0; f.work_len()]);
        if f.hessian(&at, &[1.0], &mut entries, &mut work).is_err() || entries.iter().any(|v| !v.is_finite()) {
            return;
        }
        let mut inputs = Vec::with_capacity(2 * pattern.nnz());
        for j in 0..d.n_in() {
            pattern.rows(j).iter().for_each(|&i| inputs.extend_from_slice(&[i, j]));
        }
        inputs.sort_unstable();
        inputs.dedup();
        if inputs.is_empty() {
            return;
        }
        let place = |i: usize| inputs.binary_search(&i).unwrap_or(0);
        let mut own = DMatrix::zeros(inputs.len(), inputs.len());
        for j in 0..d.n_in() {
            for (&i, v) in pattern.rows(j).iter().zip(&entries[pattern.range(j)]) {
                (own[(place(i), place(j))], own[(place(j), place(i))]) = (*v, *v);
            }
        }
        let mut eigen = own.symmetric_eigen();
        eigen.eigenvalues.iter_mut().for_each(|v| *v = (weight * *v).max(0.0));
        let by = |i: usize| match i {
            i if i < d.x => here.dx.row(1 + self.ramps.len() + i).into_owned(),
            i if i < d.x + d.u => here.du.row(i - d.x).into_owned(),
            i if i < d.x + d.u + d.p => here.dp.row(i - d.x - d.u).into_owned(),
            _ => here.dt.transpose(),
        };
        let rows: Vec<_> = inputs.iter().map(|&i| by(i)).collect();
        let change = DMatrix::from_rows(&rows);
        *sum += change.transpose() * eigen.recompose() * change;
    }

    /// Values of a function, their derivatives by the inputs of the stage and what they are changed by when states and controls change by their
    /// sizes; NaN where it has none. With `start`, states at the start of the horizon come first.
    fn values(&mut self, f: &SharedFunction, here: &Here, start: Option<&Node>) -> Rows {
        let first = self.n_front();
        let nx = here.x.len() - first;
        let mut x: Vec<f64> = start.map_or_else(Vec::new, |s| s.x[first..].to_vec());
        let front = x.len();
        x.extend_from_slice(&here.x[first..]);
        let (d, m) = (f.dims(), f.n_out());
        let at = Point { t: here.t, x: &x, u: &here.u, p: &here.p };
        let pattern = f.jac_pattern();
        let (mut value, mut entries, mut work) = (vec![f64::NAN; m], vec![0.0; pattern.nnz()], vec![0.0; f.work_len()]);
        let mut out = Rows {
            value: Vec::new(),
            slopes: DMatrix::zeros(m, here.dt.len()),
            by_start: DMatrix::zeros(m, front),
            by_state: DMatrix::zeros(m, nx),
            usual: vec![0.0; m],
        };
        let found = f.value(&at, &mut value, &mut work).is_ok() && f.jacobian(&at, &mut entries, &mut work).is_ok();
        if !found {
            value.fill(f64::NAN);
            return Rows { value, ..out };
        }
        let size = |j: usize| match j.checked_sub(x.len()) {
            None => self.usual.x.get(j % nx),
            Some(j) => self.usual.u.get(j),
        };
        for j in 0..d.n_in() {
            let entries = pattern.rows(j).iter().zip(&entries[pattern.range(j)]);
            let change = match j {
                j if j < front => None,
                j if j < d.x => Some(here.dx.row(first + j - front).into_owned()),
                j if j < d.x + d.u => Some(here.du.row(j - d.x).into_owned()),
                j if j < d.x + d.u + d.p => Some(here.dp.row(j - d.x - d.u).into_owned()),
                _ => Some(here.dt.transpose()),
            };
            for (&i, v) in entries {
                out.usual[i] += v.abs() * size(j).unwrap_or(&0.0);
                match &change {
                    None => out.by_start[(i, j)] += v,
                    Some(change) => {
                        let mut row = out.slopes.row_mut(i);
                        row += change * *v;
                    }
                }
                if (front..d.x).contains(&j) {
                    out.by_state[(i, j - front)] += v;
                }
            }
        }
        Rows { value, ..out }
    }

    /// Simulates the horizon from its start, adds cost and rows, and returns its end; nothing where that is not reached.
    pub(super) fn follow(&mut self, z: &[f64], start: &Node, out: &mut Values) -> Result<Option<Node>> {
        let mut node = start.clone();
        for k in 0..self.ocp.n_stages {
            match self.stage(z, k, &node, start, out)? {
                Some(next) => node = next,
                None => return Ok(None),
            }
        }
        let follows = self.order.as_ref().is_none_or(|given| self.order_of_motion(start.t, node.t).is_like(given));
        Ok(follows.then_some(node))
    }

    /// Modes and transitions of the last simulation.
    pub(super) fn order_of_motion(&self, t0: f64, end: f64) -> ModeOrder {
        ModeOrder::of(&self.engine, &self.layout, [t0, end], self.ocp.same_time())
    }
}

/// Values of a function at a point of the simulation, their derivatives by the inputs of the stage, by the state at the start of the horizon, and
/// by the state there alone, and what states and controls of their sizes change them by.
struct Rows {
    value: Vec<f64>,
    slopes: DMatrix<f64>,
    by_start: DMatrix<f64>,
    by_state: DMatrix<f64>,
    usual: Vec<f64>,
}

impl Program for Shooting<'_> {
    fn bounds(&self) -> (&[f64], &[f64], &[f64]) {
        (&self.lower, &self.upper, &self.sizes)
    }

    fn row_bounds(&self) -> (&[f64], &[f64]) {
        (&self.row_lower, &self.row_upper)
    }

    fn evaluate(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        out.clear(self.at.all);
        let start = self.begin(z);
        Ok(self.follow(z, &start, out)?.is_some() && out.is_finite())
    }

    fn evaluate_plain(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        self.exchange_plain()?;
        let found = self.evaluate(z, out);
        self.exchange_plain()?;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fesd::StatePoint;
    use crate::func::{Callback, Dims};
    use crate::linalg::csc::Pattern;
    use crate::nlp::Control;
    use crate::settings::Settings;
    use crate::system::System;
    use std::sync::Arc;

    /// A mass turns round at a wall inside of a stage, where no third of it ends.
    #[test]
    fn constraints_are_looked_at_where_they_act_in_the_answer() {
        let d = Dims { x: 2, u: 1, p: 0 };
        let of = |n: usize, f: fn(&Point, &mut [f64])| -> SharedFunction {
            let f = Callback::new("of", d, n, move |at, o| {
                f(at, o);
                0
            });
            Arc::new(f.with_jacobian_pattern(Pattern::dense(n, d.n_in())).unwrap())
        };
        let mut system = System::new(2, 1, 0).unwrap();
        system.set_f0(of(2, |at, o| (o[0], o[1]) = (at.x[1], at.u[0]))).unwrap();
        let mut o = Ocp::new(&system, 2.0, 4, &Settings { n_s: 3, n_fe: 3, ..Settings::default() }).unwrap();
        o.set_x0(&[0.0, 1.0]).unwrap();
        o.set_u_bounds(&[-5.0], &[5.0]).unwrap();
        o.set_x_bounds(&[f64::NEG_INFINITY; 2], &[0.35, f64::INFINITY]).unwrap();
        o.set_lagrange(of(1, |at, o| o[0] = at.u[0] * at.u[0])).unwrap();
        o.add_terminal(of(1, |at, o| o[0] = at.x[0]), &[0.0], &[0.0]).unwrap();
        o.solve(&mut Control::default()).unwrap();
        let (b, r) = (o.built.as_ref().unwrap(), o.result.clone().unwrap());
        let w = &b.solver.solution().x;
        let at_wall = |p: &StatePoint| (w[p.at] - 0.35).abs() < 1e-9 && p.share < 1.0 - SAME_POINT;
        let wall: Vec<StatePoint> = b.problem.state_points(w).into_iter().filter(at_wall).collect();
        assert!(!wall.is_empty());
        let shooting = Shooting::beside(&o, b, &r, &o.sizes().unwrap()).unwrap();
        assert!(wall.iter().any(|p| shooting.cuts[p.stage].contains(&p.share)), "{wall:?}, {:?}", shooting.cuts);
        for cuts in &shooting.cuts {
            assert!(cuts.len() >= PIECES && cuts.windows(2).all(|c| c[0] < c[1]) && cuts.last() == Some(&1.0));
        }
    }
}
