//! An optimal control problem in its controls, free lengths, parameters and initial states alone: states, cost, constraints and
//! all derivatives come from an event-driven simulation (direct single shooting; derivatives through switches by (6.25)).

mod track;

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
use crate::system::SharedFunction;
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
    goes_on: bool,
    /// The order of modes and transitions that a motion has to have.
    order: Option<ModeOrder>,
    layout: Layout,
    /// Derivatives by states and parameters on the way, while they are taken down.
    records: Option<Vec<Record>>,
    /// Second derivatives of the cost by the variables with states and controls linear in them, while they are added up.
    curvature: Option<DMatrix<f64>>,
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

/// What a simulation passes, with derivatives by its states and the parameters there.
pub(in crate::ocp) enum Record {
    /// The start of a stage.
    Stage,
    /// A piece of a stage: of the states at its end.
    Piece { x: DMatrix<f64>, p: DMatrix<f64> },
    /// The cost, or rows from this one on; `start` is by the state at the start of the horizon.
    Outputs { first: Option<usize>, start: Option<DMatrix<f64>>, x: DMatrix<f64>, p: DMatrix<f64> },
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

/// A point of the simulation with the derivatives of what it depends on by the variables.
#[derive(Clone)]
pub(super) struct Here {
    /// Is it the start of the horizon?
    begins: bool,
    /// Are the controls others than before?
    is_new: bool,
    pub t: f64,
    pub dt: DVector<f64>,
    /// States of the simulation: cost, linear controls, states.
    pub x: Vec<f64>,
    pub dx: DMatrix<f64>,
    /// Controls, linear ones at this point.
    u: Vec<f64>,
    du: DMatrix<f64>,
    p: Vec<f64>,
    dp: DMatrix<f64>,
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
            engine: Engine::new(&ocp.system_with_cost(e)?, &with_derivatives)?,
            plain: None,
            timed: e.system.depends_on_time(),
            goes_on: given.goes_on,
            order: given.order,
            layout: Layout::of(&ocp.system),
            records: None,
            curvature: None,
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
            None => Engine::new(&self.ocp.system_with_cost(self.e)?, &self.options())?,
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

    /// Second derivatives of the cost by all variables are added up from here on.
    pub(super) fn begin_curvature(&mut self) {
        self.curvature = Some(DMatrix::zeros(self.at.all, self.at.all));
    }

    /// Adds what has been added up to `sum`, `[n · n]`, which may be empty, and ends that.
    pub(super) fn end_curvature(&mut self, sum: &mut Vec<f64>) {
        let Some(own) = self.curvature.take().filter(|c| c.iter().any(|v| *v > 0.0)) else { return };
        sum.resize(own.len(), 0.0);
        sum.iter_mut().zip(own.as_slice()).for_each(|(s, o)| *s += o);
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

    /// A simulation with its derivatives, and those by states and parameters on the way.
    pub fn recorded(&mut self, z: &[f64]) -> Result<Option<(Values, Vec<Record>)>> {
        self.records = Some(Vec::new());
        let found = self.values_at(z);
        let records = self.records.take().unwrap_or_default();
        Ok(found?.map(|v| (v, records)))
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

    /// Takes the variables over into an answer: user's controls, lengths, parameters, initial state.
    pub fn tell(&self, z: &[f64], r: &mut OcpResult) {
        let (n, own) = (self.ocp.n_stages, self.ocp.u_bounds[0].len());
        let place = |k: usize, j: usize| z[self.control_at(k, j)];
        let linear = |j: usize| self.at.ends[j].is_some();
        let all = |shift: usize| -> Vec<f64> {
            let of = |k: usize, j: usize| place(if linear(j) { k + shift } else { k }, j);
            (0..n).flat_map(|k| (0..own).map(move |j| (k, j))).map(|(k, j)| of(k, j)).collect()
        };
        (r.controls, r.control_ends) = (all(0), all(1));
        (0..n).for_each(|k| r.durations[k] = self.length(z, k).0);
        let count = r.params.len();
        for (p, at) in r.params.iter_mut().zip(&self.at.params[..count]) {
            *p = at.map_or(*p, |at| z[at]);
        }
        if let Some(e) = r.trajectory.elements.first_mut() {
            e.x0.iter_mut().zip(&self.at.initial).for_each(|(x, at)| *x = at.map_or(*x, |at| z[at]));
        }
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
    pub(super) fn begin(&self, z: &[f64]) -> Here {
        let (d, n) = (self.e.system.dims(), self.at.all);
        let first = 1 + self.ramps.len();
        let mut here = Here {
            begins: true,
            is_new: true,
            t: self.ocp.t0,
            dt: DVector::zeros(n),
            x: vec![0.0; first + d.x],
            dx: DMatrix::zeros(first + d.x, n),
            u: vec![0.0; d.u],
            du: DMatrix::zeros(d.u, n),
            p: vec![0.0; d.p],
            dp: DMatrix::zeros(d.p, n),
        };
        for (i, at) in self.at.initial.iter().enumerate() {
            here.x[first + i] = at.map_or(self.x0[i], |at| z[at]);
            at.iter().for_each(|&at| here.dx[(first + i, at)] = 1.0);
        }
        for (j, at) in self.at.params.iter().enumerate() {
            at.iter().for_each(|&at| here.dp[(j, at)] = 1.0);
        }
        here
    }

    /// Simulates stage `k` from `here` on; false where that does not get to its end.
    fn stage(&mut self, z: &[f64], k: usize, here: &mut Here, out: &mut Values) -> Result<bool> {
        let d = self.e.system.dims();
        let (length, by) = self.length(z, k);
        here.p.copy_from_slice(&self.params[k * d.p..(k + 1) * d.p]);
        for (j, at) in self.at.params.iter().enumerate() {
            at.iter().for_each(|&at| here.p[j] = z[at]);
        }
        here.du.fill(0.0);
        for j in 0..d.u {
            let at = self.control_at(k, j);
            here.u[j] = z[at];
            here.du[(j, at)] = 1.0;
        }
        // linear controls are states, and their slopes are the controls of the simulation
        let (mut slope, mut dslope) = (here.u.clone(), here.du.clone());
        for (r, &j) in self.ramps.iter().enumerate() {
            let (from, to) = (self.control_at(k, j), self.control_at(k + 1, j));
            here.x[1 + r] = z[from];
            here.dx.row_mut(1 + r).fill(0.0);
            here.dx[(1 + r, from)] = 1.0;
            slope[j] = (z[to] - z[from]) / length;
            dslope.row_mut(j).fill(0.0);
            dslope[(j, to)] = 1.0 / length;
            dslope[(j, from)] = -1.0 / length;
            by.iter().for_each(|(at, share)| dslope[(j, *at)] -= slope[j] * share / length);
        }
        if let Some(records) = &mut self.records {
            records.push(Record::Stage);
        }
        for c in &self.e.path {
            self.add_rows(&c.f, here, out);
        }
        let mut before = 0.0;
        for i in 0..self.cuts[k].len() {
            let cut = self.cuts[k][i];
            let part = cut - std::mem::replace(&mut before, cut);
            here.is_new = i == 0;
            if !self.piece(here, (&slope, &dslope), part * length, by.map(|(at, share)| (at, part * share)))? {
                return Ok(false);
            }
            let last = cut == 1.0;
            for s in bounded(self.ocp) {
                let at = 1 + self.ramps.len() + s;
                if let Some(records) = &mut self.records {
                    let (mut x, p) = (DMatrix::zeros(1, here.x.len()), DMatrix::zeros(1, d.p));
                    x[(0, at)] = 1.0;
                    records.push(Record::Outputs { first: Some(out.rows.len()), start: None, x, p });
                }
                out.rows.push(here.x[at]);
                out.usual.push(self.usual.x[s]);
                out.jacobian.extend(here.dx.row(at).iter());
            }
            for c in self.e.path.iter().filter(|c| last || c.at != PathAt::ControlGrid) {
                self.add_rows(&c.f, here, out);
            }
        }
        Ok(true)
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
            if let Some(records) = &mut self.records {
                let (x, p) = (s.columns(0, nx).into_owned(), s.columns(nx, np).into_owned());
                records.push(Record::Piece { x, p });
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
        let mut inputs: Vec<usize> =
            (0..d.n_in()).flat_map(|j| pattern.rows(j).iter().flat_map(move |&i| [i, j])).collect();
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

    /// Values of a function, their derivatives by the variables and what they are changed by when states and controls change by their
    /// sizes; NaN where it has none. With `before`, states at the start of the horizon come first. `row` is the first of its rows, none of the cost.
    fn values(&mut self, f: &SharedFunction, here: &Here, before: Option<&Here>, row: Option<usize>) -> Rows {
        let first = 1 + self.ramps.len();
        let mut x: Vec<f64> = before.map_or_else(Vec::new, |b| b.x[first..].to_vec());
        x.extend_from_slice(&here.x[first..]);
        let (d, m) = (f.dims(), f.n_out());
        let at = Point { t: here.t, x: &x, u: &here.u, p: &here.p };
        let pattern = f.jac_pattern();
        let (mut value, mut entries, mut work) = (vec![f64::NAN; m], vec![0.0; pattern.nnz()], vec![0.0; f.work_len()]);
        let (mut slopes, mut usual) = (DMatrix::zeros(m, self.at.all), vec![0.0; m]);
        if f.value(&at, &mut value, &mut work).is_err() || f.jacobian(&at, &mut entries, &mut work).is_err() {
            value.fill(f64::NAN);
            return Rows { value, slopes, usual };
        }
        let size = |j: usize| match j {
            j if j < x.len() => self.usual.x.get(j % (here.x.len() - first)),
            j => self.usual.u.get(j - x.len()),
        };
        for j in 0..d.n_in() {
            let change = match j {
                j if j < x.len() => match before {
                    Some(b) if j < here.x.len() - first => b.dx.row(first + j).into_owned(),
                    Some(_) => here.dx.row(first + j - (here.x.len() - first)).into_owned(),
                    None => here.dx.row(first + j).into_owned(),
                },
                j if j < d.x + d.u => here.du.row(j - d.x).into_owned(),
                j if j < d.x + d.u + d.p => here.dp.row(j - d.x - d.u).into_owned(),
                _ => here.dt.transpose(),
            };
            for (&i, v) in pattern.rows(j).iter().zip(&entries[pattern.range(j)]) {
                let mut row = slopes.row_mut(i);
                row += &change * *v;
                usual[i] += v.abs() * size(j).unwrap_or(&0.0);
            }
        }
        if let Some(records) = &mut self.records {
            let front = if before.is_some() { d.x / 2 } else { 0 };
            let (nx, np) = (here.x.len(), here.p.len());
            let (mut start, mut x, mut p) = (DMatrix::zeros(m, nx), DMatrix::zeros(m, nx), DMatrix::zeros(m, np));
            for j in 0..d.t_col() {
                let (to, column) = match j {
                    j if j < front => (&mut start, first + j),
                    j if j < d.x => (&mut x, first + j - front),
                    j if j < d.x + d.u => match self.ramps.iter().position(|r| *r == j - d.x) {
                        Some(r) => (&mut x, 1 + r),
                        None => continue,
                    },
                    j => (&mut p, j - d.x - d.u),
                };
                let entries = pattern.rows(j).iter().zip(&entries[pattern.range(j)]);
                entries.for_each(|(&i, v)| to[(i, column)] += v);
            }
            let start = before.map(|_| start);
            records.push(Record::Outputs { first: row, start, x, p });
        }
        Rows { value, slopes, usual }
    }

    /// Simulates the horizon from its start, adds cost and rows, and returns its end; nothing where that is not reached.
    pub(super) fn follow(&mut self, z: &[f64], start: &Here, out: &mut Values) -> Result<Option<Here>> {
        let mut here = start.clone();
        for k in 0..self.ocp.n_stages {
            if !self.stage(z, k, &mut here, out)? {
                return Ok(None);
            }
            self.add_cost(self.e.grid_cost.as_ref(), &here, out);
            self.add_curvature(self.e.grid_cost.as_ref(), &here, 1.0);
        }
        self.add_cost(self.e.mayer.as_ref(), &here, out);
        self.add_curvature(self.e.mayer.as_ref(), &here, 1.0);
        out.cost += here.x[0];
        out.gradient.iter_mut().zip(here.dx.row(0).iter()).for_each(|(g, s)| *g += s);
        for c in &self.e.terminal {
            self.add_rows(&c.f, &here, out);
        }
        for c in &self.e.boundary {
            self.values(&c.f, &here, Some(start), Some(out.rows.len())).add_to(out);
        }
        let follows = self.order.as_ref().is_none_or(|given| self.order_of_motion(start.t, here.t).is_like(given));
        Ok(follows.then_some(here))
    }

    /// Modes and transitions of the last simulation.
    pub(super) fn order_of_motion(&self, t0: f64, end: f64) -> ModeOrder {
        ModeOrder::of(&self.engine, &self.layout, [t0, end], self.ocp.same_time())
    }

    fn add_rows(&mut self, f: &SharedFunction, here: &Here, out: &mut Values) {
        self.values(f, here, None, Some(out.rows.len())).add_to(out);
    }

    fn add_cost(&mut self, f: Option<&SharedFunction>, here: &Here, out: &mut Values) {
        let Some(f) = f else { return };
        let Rows { value, slopes, .. } = self.values(f, here, None, None);
        out.cost += value[0];
        out.gradient.iter_mut().zip(slopes.row(0).iter()).for_each(|(g, s)| *g += s);
    }
}

/// Values of a function at a point of the simulation, their derivatives by the variables, and what states of their sizes change them by.
pub(super) struct Rows {
    pub value: Vec<f64>,
    pub slopes: DMatrix<f64>,
    pub usual: Vec<f64>,
}

impl Rows {
    pub fn add_to(&self, out: &mut Values) {
        out.rows.extend_from_slice(&self.value);
        out.usual.extend_from_slice(&self.usual);
        (0..self.value.len()).for_each(|i| out.jacobian.extend(self.slopes.row(i).iter()));
    }
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
