//! The controller: what happens between samples and at them.

mod changes;

use super::branch::{Branches, Effort};
use super::choices::Choosing;
use super::evaluate::has_value;
use super::iterate::{Iterate, Step};
use super::linearise::{Linearisation, Model};
use super::monitor::{Contraction, Monitor};
use super::options::{Level, Options, QpMethod, Scheme, Source};
use super::problem;
use super::stage::{Evaluations, Stage, Starts};
use super::standby::{Passed, Standby};
use crate::error::{finite, Error, Result};
use crate::func::EvalError;
use crate::ocp::Ocp;
use crate::qp::{self, Condensing, QpSolution, QpSolver, QpStatus, Stagewise, Terms};
use crate::stop;
use std::time::{Duration, Instant};

/// Price of violations where rows cannot all be met, in units of what it costs to meet them one by one. With `Δ` the cost that the least
/// violations have, the sum of violations exceeds the least by at most `Δ` over the price: where rows are met like single ones, by a
/// thousandth of what the solution without constraints violates.
pub(super) const ELASTIC: f64 = 1e3;
/// A price stays as it is while the one that is asked for differs by no more than this factor.
const APART: f64 = 10.0;
/// Share of the predicted descent that a step of [`Nmpc::initialise`] must make (Armijo).
const ARMIJO: f64 = 1e-4;
/// Halvings of a step at most.
const HALVINGS: usize = 12;
/// A plan is compared with others that begin differently, and improved for longer, where a state was this far from the predicted one,
/// relative to the largest that was measured.
const DISTURBED: f64 = 0.01;
/// By how many times the inner iterations are more then: the plan is for another state.
const EFFORT: usize = 4;
/// Matrices that were frozen are made anew where they contract steps by less than this. By (10.19) an error that is contracted by `κ` from
/// sample to sample follows the solution, which moves by `d`, at `c₃ d/(1 − κ)` with `c₃ = γ κ`: from `κ = ½` on that is more than
/// what the solution itself moves, `γ d`; from `κ = 1` on there is no Lyapunov function of system and optimiser (A. Zanelli, Q.
/// Tran-Dinh, M. Diehl, *A Lyapunov function for the combined system-optimizer dynamics in inexact model predictive control*, 2021).
const CONTRACTS: f64 = 0.5;
/// [`Nmpc::initialise`] has converged where a step is below this share of the size of states and controls.
const CONVERGED: f64 = 1e-10;

/// Result of a preparation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preparation {
    /// True where there is a quadratic program for the next sample.
    pub ready: bool,
    /// Inner iterations.
    pub inner: usize,
    /// Seconds.
    pub time: f64,
}

/// Result of a feedback: the source of the control, and how the quadratic program ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedback {
    /// Source of the control.
    pub source: Source,
    /// How the quadratic program ended.
    pub status: QpStatus,
    /// Changes of its active set.
    pub iterations: usize,
    /// Seconds.
    pub time: f64,
}

/// What a solution of a program may take: nothing here is as much as it needs.
#[derive(Clone, Copy, Default)]
struct Within {
    deadline: Option<Instant>,
    /// Changes of the active set.
    most: Option<usize>,
}

/// What was found at the last sample and is not yet part of the iterate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pending {
    Nothing,
    Solved,
    /// The program is still to be solved to its end, with the control that was given.
    Unfinished,
    /// The iterate stays; its plan is one sample older.
    Aged,
}

/// A model predictive controller. All memory is taken when it is made, but what contacts, transitions and choices need.
pub struct Nmpc {
    options: Options,
    pub(super) model: Model,
    predictor: Box<dyn Stage>,
    lin: Linearisation,
    iterate: Iterate,
    other: Iterate,
    step: Step,
    pub(super) monitor: Monitor,
    pending: Pending,
    /// A preparation has been made since the last feedback.
    prepared: bool,
    /// Entry of the plan that belongs to the next sample.
    entry: usize,
    /// The last measured state and control; whether there are any.
    x: Vec<f64>,
    u: Vec<f64>,
    seen: bool,
    /// There was a sample since the iterate was shifted last.
    unshifted: bool,
    /// The predicted state, where there is one.
    predicted: Vec<f64>,
    has_prediction: bool,
    /// The largest size of a measured state so far, and how far the last one was from its prediction relative to that.
    largest: f64,
    shock: f64,
    scale: Vec<f64>,
    /// Sizes of states and controls that bounds and the first guess say.
    sizes: Vec<f64>,
    /// Room for the law of the program, for sizes of rounding, and for vectors of a stage.
    law: Vec<f64>,
    floors: Vec<f64>,
    work: Vec<f64>,
    /// The iterate is what a step of the present program led to.
    stepped: bool,
    /// Frozen matrices are those of other weights.
    outdated: bool,
    /// The last program had rows that could not all be met; the price per unit of their violation, zero where none is known.
    violating: bool,
    price: f64,
    start: [Vec<f64>; 2],
    next: Vec<f64>,
    /// For systems that switch.
    branches: Option<Box<Branches>>,
    /// Functions of the problem may be called by one thread only.
    serial: bool,
}

impl Nmpc {
    /// A controller for a problem as it is stated now. The plan is the problem's guess: call [`Nmpc::initialise`] for a better
    /// start.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for what a controller does not know, in words; [`Error::Range`] for options out of their ranges.
    pub fn new(ocp: &Ocp, options: &Options) -> Result<Nmpc> {
        options.validate()?;
        let (model, qp) = problem::build(ocp, options)?;
        let predictor = problem::stage(ocp, options, 1)?;
        let (n, nx, nu, rows) = (qp.n, qp.nx, qp.nu, qp.rows.len());
        let qp_method = match options.qp {
            QpMethod::Auto if qp::is_long(&qp) => QpMethod::Stagewise,
            QpMethod::Auto => QpMethod::Condensing,
            given => given,
        };
        let solver = || -> Result<Box<dyn QpSolver>> {
            match qp_method {
                QpMethod::Stagewise => Ok(Box::new(Stagewise::new(&qp)?)),
                _ => Ok(Box::new(Condensing::new(&qp)?)),
            }
        };
        let branches = if model.switches {
            let mut branches = Branches::new(&model, &qp, options.flips, solver, options.hessian())?;
            branches.choices = Choosing::new(ocp)?;
            Some(Box::new(branches))
        } else {
            None
        };
        let solver = solver()?;
        let step = Step { of: 0, solution: QpSolution::new(&qp) };
        let lin = Linearisation::new(&model, qp, solver, options.hessian());
        let zeros = || Iterate::zeros(n, nx, nu, rows);
        let mut c = Nmpc {
            options: Options { qp: qp_method, ..options.clone() },
            predictor,
            lin,
            iterate: zeros(),
            other: zeros(),
            step,
            monitor: Monitor::default(),
            pending: Pending::Nothing,
            prepared: false,
            entry: 0,
            x: vec![0.0; nx],
            u: vec![0.0; nu],
            seen: false,
            unshifted: false,
            predicted: vec![0.0; nx],
            has_prediction: false,
            largest: 0.0,
            shock: 0.0,
            scale: vec![1.0; nx + nu],
            sizes: vec![0.0; nx + nu],
            law: vec![0.0; n * nu * nx],
            floors: vec![0.0; nx + nu],
            work: vec![0.0; 2 * nx + nu],
            stepped: false,
            outdated: false,
            violating: false,
            price: 0.0,
            start: [vec![0.0; (n + 1) * nx], vec![0.0; n * nu]],
            next: vec![0.0; n * nx],
            branches,
            serial: ocp.statement().is_serial(),
            model,
        };
        c.take_guess(ocp);
        c.take_sizes(ocp);
        c.reset();
        Ok(c)
    }

    /// States and controls of the guess of the problem, `x_0` and zero within bounds where there is none.
    fn take_guess(&mut self, ocp: &Ocp) {
        let s = ocp.statement();
        let (n, nx, nu) = (self.n(), self.nx(), self.nu());
        let all = s.system.dims().x;
        let middle = |l: f64, u: f64| if l.is_finite() && u.is_finite() { 0.5 * (l + u) } else { 0f64.max(l).min(u) };
        for k in 0..=n {
            let x = &mut self.start[0][k * nx..(k + 1) * nx];
            for (i, x) in x.iter_mut().enumerate() {
                *x = match s.x_guess {
                    Some((times, values)) => {
                        interpolate(times, values, all, i, self.model.nodes.t[k] - self.model.nodes.t[0])
                    }
                    None => middle(s.x0_bounds[0][i], s.x0_bounds[1][i]),
                };
            }
        }
        for k in 0..n {
            for i in 0..nu {
                let u = s.u_guess.map_or(0.0, |u| u[k * nu + i]);
                self.start[1][k * nu + i] = u.max(self.model.u_lower[i]).min(self.model.u_upper[i]);
            }
        }
    }

    /// Sizes that do not depend on where the system is: a controller may start at rest, where states and controls are zero.
    fn take_sizes(&mut self, ocp: &Ocp) {
        let s = ocp.statement();
        let (nx, nu) = (self.nx(), self.nu());
        let (of_x, of_u) = self.sizes.split_at_mut(nx);
        let see = |sizes: &mut [f64], values: &[f64]| {
            for (i, v) in values.iter().enumerate().filter(|e| e.1.is_finite()) {
                let n = sizes.len();
                sizes[i % n] = sizes[i % n].max(v.abs());
            }
        };
        s.x_bounds.iter().for_each(|b| see(of_x, &b[..nx]));
        s.u_bounds.iter().for_each(|b| see(of_u, &b[..nu]));
        see(of_x, &self.start[0]);
        see(of_u, &self.start[1]);
    }

    /// Number of stages.
    pub fn n(&self) -> usize {
        self.model.nodes.n
    }

    /// Differential states: what is measured.
    pub fn nx(&self) -> usize {
        self.model.nodes.nx
    }

    /// Controls.
    pub fn nu(&self) -> usize {
        self.model.nodes.nu
    }

    /// Must functions of the problem be called by one thread only?
    pub(super) fn is_serial(&self) -> bool {
        self.serial
    }

    /// The options, with the method for quadratic programs that was chosen.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The plan: states and controls from the last sample on, with multipliers.
    pub fn plan(&mut self) -> &Iterate {
        self.finish();
        &self.iterate
    }

    /// The point the present quadratic program belongs to.
    pub fn linearisation(&self) -> &Iterate {
        self.lin.point()
    }

    /// How the controller is doing.
    pub fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// Sets the seconds a feedback may take.
    pub fn set_deadline(&mut self, seconds: f64) -> Result<()> {
        let options = Options { deadline: seconds, ..self.options.clone() };
        options.validate()?;
        self.options = options;
        Ok(())
    }

    /// Sets the parameters `[np]` of the whole horizon, `[n · np]` of its stages or `[(n + 1) · np]` of its nodes. Between a preparation
    /// and its feedback they enter the program by one evaluation of dynamics, constraints and costs at its point, while its matrices
    /// stay; for systems that switch they count from the next preparation on.
    ///
    /// # Errors
    /// [`Error::Range`], [`Error::Dimension`]; [`Error::Interrupted`] if the call was to end; [`Error::User`] for a fatal code of a
    /// callback.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        let (n, np) = (self.n(), self.model.nodes.np);
        finite("parameter", p, p.len())?;
        if p.len() != np && p.len() != n * np && p.len() != (n + 1) * np {
            return Err(Error::Dimension(format!(
                "{} parameters given: expected {np}, {} for the stages or {} for the nodes",
                p.len(),
                n * np,
                (n + 1) * np
            )));
        }
        self.finish();
        self.model.revision += 1;
        for k in 0..if np == 0 { 0 } else { n + 1 } {
            let from = if p.len() == np { 0 } else { k.min(p.len() / np - 1) * np };
            self.model.nodes.p[k * np..(k + 1) * np].copy_from_slice(&p[from..from + np]);
        }
        if np == 0 || self.model.switches || !self.lin.is_ready() || !self.program_stays() {
            return Ok(());
        }
        // level B evaluates values before it solves the next program
        let values = self.prepared || self.options.level == Level::A;
        self.other.copy_from(self.lin.point());
        let outcome = self.lin.embed_params(&mut self.model, &self.other, values);
        self.note(outcome)
    }

    /// Parameters without values are an error: all of them have values, or none.
    fn check_params(&self) -> Result<()> {
        if !self.model.nodes.p.first().is_some_and(|p| p.is_nan()) {
            return Ok(());
        }
        Err(Error::State(
            "the parameters have no values: give them by set_params of the controller, or of the problem before it is made of that".into(),
        ))
    }

    /// Is the present program solved once more before its gradient is evaluated again, or is that gradient compared with a later one?
    fn program_stays(&self) -> bool {
        match self.options.level {
            Level::A | Level::B if matches!(self.options.scheme, Scheme::Mli | Scheme::AsRti) => true,
            Level::D1 => true,
            _ => self.prepared,
        }
    }

    /// Sets the references of least-squares term `k`, in the order they were added to the problem: one for all its nodes, or one
    /// for each. Between a preparation and its feedback they enter the program by its gradient.
    ///
    /// # Errors
    /// [`Error::Range`], [`Error::Dimension`]; [`Error::Interrupted`] if the call was to end; [`Error::User`] for a fatal code of a
    /// callback.
    pub fn set_references(&mut self, k: usize, y: &[f64]) -> Result<()> {
        finite("reference", y, y.len())?;
        let n_terms = self.model.costs.squares.len();
        let Some(term) = self.model.costs.squares.get(k) else {
            return Err(Error::Range(format!("least-squares term {k}: there are {n_terms}")));
        };
        let sizes = term.reference_sizes();
        if !sizes.contains(&y.len()) {
            return Err(Error::Dimension(format!(
                "{} references given, expected {} for all nodes or {}",
                y.len(),
                sizes[0],
                sizes[1]
            )));
        }
        self.finish();
        let mut outcome = Ok(());
        if self.program_stays() {
            outcome = self.lin.embed_references(&mut self.model, k, y).and_then(|change| match &mut self.branches {
                Some(b) => b.embed_references(&mut self.model, k, y, change),
                None => Ok(()),
            });
        }
        self.model.costs.squares[k].set_references(y);
        if outcome.is_ok() {
            return Ok(());
        }
        self.note(outcome)
    }

    /// Sets the time of the first node.
    pub fn set_time(&mut self, t0: f64) -> Result<()> {
        finite("time", &[t0], 1)?;
        self.finish();
        self.model.revision += 1;
        let nodes = &mut self.model.nodes;
        nodes.t[0] = t0;
        for k in 0..nodes.n {
            nodes.t[k + 1] = nodes.t[k] + nodes.h[k];
        }
        Ok(())
    }

    /// Sets states `[(n + 1) · nx]` and controls `[n · nu]` as the iterate; its multipliers are zero.
    pub fn set_iterate(&mut self, x: &[f64], u: &[f64]) -> Result<()> {
        finite("state", x, (self.n() + 1) * self.nx())?;
        finite("control", u, self.n() * self.nu())?;
        self.forget();
        self.iterate.x.copy_from_slice(x);
        self.iterate.u.copy_from_slice(u);
        Ok(())
    }

    /// Back to the start: the guess of the problem, no multipliers, nothing measured.
    pub fn reset(&mut self) {
        self.forget();
        self.iterate.x.copy_from_slice(&self.start[0]);
        self.iterate.u.copy_from_slice(&self.start[1]);
        let nu = self.nu();
        self.u.copy_from_slice(&self.start[1][..nu]);
        if let Some(choices) = self.branches.as_mut().and_then(|b| b.choices.as_mut()) {
            choices.forget();
        }
        self.monitor = Monitor::default();
    }

    fn forget(&mut self) {
        self.pending = Pending::Nothing;
        self.prepared = false;
        self.entry = 0;
        self.seen = false;
        self.unshifted = false;
        self.has_prediction = false;
        self.largest = 0.0;
        self.shock = 0.0;
        self.stepped = false;
        self.outdated = false;
        self.violating = false;
        self.price = 0.0;
        self.lin.reset();
        if let Some(b) = &mut self.branches {
            b.forget();
        }
        for v in [&mut self.iterate.lambda, &mut self.iterate.u_mu, &mut self.iterate.row_mu] {
            v.fill(0.0);
        }
    }

    /// Does the work of the last sample that can wait: the plan from its quadratic program, and the prediction of the next state.
    /// Every other call does it where it is needed.
    pub fn finish(&mut self) {
        let pending = std::mem::replace(&mut self.pending, Pending::Nothing);
        let solved = match pending {
            Pending::Nothing => return,
            Pending::Aged => false,
            Pending::Solved => true,
            Pending::Unfinished => self.complete(),
        };
        if solved && self.take_step() {
            self.stepped = true;
            // the plan begins at the last sample
            self.entry = 1;
        } else {
            self.entry += 1;
        }
        self.predict();
    }

    /// The step of the last program is the iterate; false where it is not finite.
    fn take_step(&mut self) -> bool {
        self.lin.step(&mut self.step);
        self.lin.advance(&self.step, 1.0, &mut self.other);
        let finite = self.other.x.iter().chain(&self.other.lambda).all(|v| v.is_finite());
        if finite {
            std::mem::swap(&mut self.iterate, &mut self.other);
        }
        finite
    }

    /// Solves the program that the feedback had no time for, from where it was: the plan is the best one that begins with the control that was
    /// given. Is it solved?
    fn complete(&mut self) -> bool {
        let x = std::mem::take(&mut self.x);
        self.lin.fix_first_control(&self.u);
        let (status, violated) = self.solve_program(&x, Within::default(), &mut 0);
        self.lin.embed_control_bounds(&self.model);
        self.x = x;
        has_solution(status, violated)
    }

    /// Solves the prepared program for the state that is predicted, so that the feedback begins with an active set that is nearly its own: where rows
    /// could not be met at the last sample it is far from that of any other program, and where changes are bounded there are few of them to make.
    fn foresee(&mut self) {
        let wanted = self.violating || (self.options.max_changes > 0 && self.seen);
        if !wanted || !self.lin.is_ready() || self.entry > self.n() {
            return;
        }
        let nx = self.nx();
        let mut x = std::mem::take(&mut self.predicted);
        if !self.has_prediction {
            x.copy_from_slice(&self.iterate.x[self.entry * nx..(self.entry + 1) * nx]);
        }
        self.solve_program(&x, Within::default(), &mut 0);
        self.predicted = x;
    }

    /// `x̃ = ψ(x, u)` with the first stage's data of the last sample.
    fn predict(&mut self) {
        self.has_prediction = false;
        // plans of systems that switch are simulated from where the next sample begins
        let needed = self.model.switches || matches!(self.options.scheme, Scheme::AsRti | Scheme::Asc);
        if !self.seen || !needed {
            return;
        }
        let [x, u, mut next] = [&mut self.x, &mut self.u, &mut self.predicted].map(std::mem::take);
        self.has_prediction = self.step_model(&x, &u, &mut next);
        (self.x, self.u, self.predicted) = (x, u, next);
    }

    /// The first stage of the model from a state under a control; false where functions have no value.
    pub(super) fn step_model(&mut self, x: &[f64], u: &[f64], next: &mut [f64]) -> bool {
        let nodes = &self.model.nodes;
        let at = Starts { x, u, p: &nodes.p[..nodes.np], t: &nodes.t[..1], h: &nodes.h[..1] };
        self.predictor.values(&at, next).is_ok()
    }

    /// Everything for the next sample that needs no measurement. `predicted` is the state it will find, where that is known better
    /// than by one step of the model from the last state with the control that was returned.
    ///
    /// Where functions have no value at the iterate, the last linearisation is used further.
    ///
    /// # Errors
    /// [`Error::Dimension`]; [`Error::Interrupted`] if the call was to end; [`Error::User`] for a fatal code of a callback.
    pub fn prepare(&mut self, predicted: Option<&[f64]>) -> Result<Preparation> {
        self.check_params()?;
        if let Some(x) = predicted {
            finite("predicted state", x, self.nx())?;
        }
        let start = Instant::now();
        self.finish();
        self.take_weights();
        let before = self.model.evaluations();
        if let Some(x) = predicted {
            self.predicted.copy_from_slice(x);
            self.has_prediction = true;
        }
        if self.options.shift && std::mem::take(&mut self.unshifted) {
            self.iterate.shift(self.model.nodes.nx, self.model.nodes.nu);
            self.lin.shift();
            self.entry = self.entry.saturating_sub(1);
        }
        let inner = if self.model.switches { self.prepare_switching()? } else { self.prepare_smooth()? };
        self.prepared = true;
        let after = self.model.evaluations();
        self.monitor.evaluations = after;
        self.monitor.last_evaluations = difference(after, before);
        let time = self.monitor.preparation.add(start.elapsed());
        Ok(Preparation { ready: self.lin.is_ready(), inner, time })
    }

    /// Inner iterations and a linearisation; their number.
    fn prepare_smooth(&mut self) -> Result<usize> {
        if std::mem::take(&mut self.outdated) {
            let outcome = self.lin.linearise(&mut self.model, &self.iterate);
            self.note(outcome)?;
        }
        let inner = match self.options.scheme {
            Scheme::Rti | Scheme::Mli => 0,
            Scheme::AsRti | Scheme::Asc => self.inner_iterations()?,
        };
        let outcome = match (self.options.scheme, self.options.level) {
            (Scheme::Mli, Level::A) if self.lin.is_ready() => Ok(()),
            (Scheme::Mli, Level::B | Level::C) if self.lin.is_ready() => self.follow(),
            _ => self.lin.linearise(&mut self.model, &self.iterate),
        };
        self.note(outcome)?;
        self.foresee();
        Ok(inner)
    }

    /// An iteration of level B or C. Its values say how well the frozen matrices predicted the last step: where they leave more of it than
    /// [`CONTRACTS`] they are made anew.
    fn follow(&mut self) -> std::result::Result<(), EvalError> {
        self.lin.refresh(&mut self.model, &self.iterate, self.options.level == Level::C)?;
        if !std::mem::take(&mut self.stepped) || !self.lin.gains(&mut self.law) {
            return Ok(());
        }
        self.measure_scale();
        let (nx, scale) = (self.nx(), &self.scale);
        let s = &self.step.solution;
        let size =
            |v: &[f64], scale: &[f64]| v.iter().zip(scale.iter().cycle()).fold(0.0f64, |m, (v, s)| m.max(v.abs() / s));
        let made = size(&s.x, &scale[..nx]).max(size(&s.u, &scale[nx..]));
        if made <= self.options.tol {
            return Ok(());
        }
        let stages = self.n() - usize::from(self.options.shift);
        let kappa = self.lin.mismatch(&self.law, stages, scale, &mut self.work) / made;
        (self.monitor.kappa, self.monitor.step) = (kappa, made);
        if kappa <= CONTRACTS {
            return Ok(());
        }
        match self.lin.linearise(&mut self.model, &self.iterate) {
            // the matrices that are there have values at this point
            Err(EvalError::Recoverable) => Ok(()),
            outcome => outcome,
        }
    }

    /// The plan and its alternatives, simulated from the predicted state; the iterations made on the plan.
    fn prepare_switching(&mut self) -> Result<usize> {
        let mut inner = if self.options.scheme == Scheme::Rti { 0 } else { self.options.inner };
        if self.seen && self.shock > DISTURBED {
            inner *= EFFORT;
        }
        let tol = if self.options.scheme == Scheme::Asc { self.options.tol } else { 0.0 };
        let nx = self.nx();
        let from = if self.has_prediction { &self.predicted[..] } else { &self.iterate.x[..nx] };
        self.other.x[..nx].copy_from_slice(from);
        let done = self.search_branches(inner, tol)?;
        self.monitor.alternatives += self.branches.as_ref().map_or(0, |b| b.used() as u64);
        Ok(done)
    }

    /// Improves the plan and its alternatives from the first state of the other iterate.
    fn search_branches(&mut self, inner: usize, tol: f64) -> Result<usize> {
        // a controller that begins knows no state that its plan is for
        let disturbed = !self.seen || self.shock > DISTURBED;
        let effort = Effort { inner, tol, price: self.elastic_price(), disturbed };
        let nx = self.nx();
        let Some(b) = &mut self.branches else { return Ok(0) };
        b.x0.copy_from_slice(&self.other.x[..nx]);
        self.other.copy_from(&self.iterate);
        let outcome = b.prepare(&mut self.model, &mut self.lin, &mut self.iterate, effort);
        let done = *outcome.as_ref().unwrap_or(&0);
        if outcome.is_ok() {
            // the plan begins at the predicted state now
            self.entry = 0;
        } else {
            self.iterate.copy_from(&self.other);
        }
        self.note(outcome.map(|_| ()))?;
        Ok(done)
    }

    /// Counts what went wrong, and ends the call where that was asked for.
    fn note(&mut self, outcome: std::result::Result<(), EvalError>) -> Result<()> {
        if !(has_value(outcome)? && self.lin.is_ready()) {
            self.monitor.failed_linearisations += 1;
        }
        Ok(())
    }

    /// Iterations on the problem with the predicted state: line 3 of Algorithm 2.
    fn inner_iterations(&mut self) -> Result<usize> {
        if !self.has_prediction {
            return Ok(0);
        }
        let asc = self.options.scheme == Scheme::Asc;
        // another solution of the same program with the same data would be the same
        let most = if self.options.level == Level::A && !asc { self.options.inner.min(1) } else { self.options.inner };
        let mut contraction = Contraction::default();
        let mut contracts = true;
        for done in 0..most {
            let outcome = match self.options.level {
                Level::A if !asc => Ok(()),
                Level::B | Level::C if !asc && contracts && self.lin.is_ready() => {
                    self.lin.refresh(&mut self.model, &self.iterate, self.options.level == Level::C)
                }
                _ => self.lin.linearise(&mut self.model, &self.iterate),
            };
            let failed = outcome.is_err();
            self.note(outcome)?;
            if failed || !self.inner_step() {
                return Ok(done);
            }
            // both iterates are there: the step is their difference
            let size = self.distance();
            contraction.see(size, &mut self.monitor);
            contracts = contraction.rate().is_none_or(|kappa| kappa <= CONTRACTS);
            // a solution for its own sake ends by its steps, a point to linearise at by what is left
            let left = if asc { size } else { contraction.left(size) };
            if left <= self.options.tol {
                return Ok(done + 1);
            }
        }
        Ok(most)
    }

    /// The quadratic program with the predicted state; its step leads from the linearisation's own point.
    fn inner_step(&mut self) -> bool {
        let x = std::mem::take(&mut self.predicted);
        let (status, violated) = self.solve_program(&x, Within::default(), &mut 0);
        self.predicted = x;
        if !has_solution(status, violated) || !self.take_step() {
            return false;
        }
        // the plan begins at the predicted state now
        self.entry = 0;
        true
    }

    fn count_qp(&mut self) {
        self.monitor.qps += 1;
        self.monitor.qp_iterations += self.lin.qp_iterations() as u64;
    }

    /// How far the two iterates are apart, relative to the size of states and controls; zero where that is rounding.
    fn distance(&mut self) -> f64 {
        self.measure_scale();
        let (nx, nu) = (self.model.nodes.nx, self.model.nodes.nu);
        let size = self.iterate.distance(&self.other, &self.scale, nx, nu);
        if size > self.options.tol.min(CONVERGED) && self.is_rounding() {
            return 0.0;
        }
        size
    }

    /// Are the two iterates apart by no more than rounding? Controls at rest are differences of terms that cancel: what they are relative
    /// to themselves says nothing.
    fn is_rounding(&mut self) -> bool {
        let nx = self.model.nodes.nx;
        let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let way = self.iterate.x.iter().zip(&self.other.x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        // without a look at the matrices where states move
        if way > f64::EPSILON.sqrt() * largest(&self.iterate.x) || !self.lin.gains(&mut self.law) {
            return false;
        }
        self.lin.rounding(&self.iterate, &self.law, &mut self.floors);
        let within = |a: &[f64], b: &[f64], floors: &[f64]| {
            a.iter().zip(b).zip(floors.iter().cycle()).all(|((a, b), floor)| (a - b).abs() <= *floor)
        };
        let (of_x, of_u) = self.floors.split_at(nx);
        within(&self.iterate.x, &self.other.x, of_x) && within(&self.iterate.u, &self.other.u, of_u)
    }

    /// The size of every state and control: what it is over the horizon of the iterate, what bounds and guess say, and for a
    /// state what a control of that size does to it in a stage.
    fn measure_scale(&mut self) {
        let (nx, nu) = (self.model.nodes.nx, self.model.nodes.nu);
        self.scale.copy_from_slice(&self.sizes);
        for (e, b) in self.lin.qp.b.iter().enumerate().filter(|e| e.1.is_finite()) {
            let (i, j) = (e % nx, e / nx % nu);
            self.scale[i] = self.scale[i].max(b.abs() * self.sizes[nx + j]);
        }
        for (i, v) in self.iterate.x.iter().enumerate() {
            self.scale[i % nx] = self.scale[i % nx].max(v.abs());
        }
        for (i, v) in self.iterate.u.iter().enumerate() {
            self.scale[nx + i % nu] = self.scale[nx + i % nu].max(v.abs());
        }
        // a component at rest is measured by the largest one of its kind
        for range in [0..nx, nx..nx + nu] {
            let largest = self.scale[range.clone()].iter().fold(0.0f64, |m, v| m.max(*v));
            let floor = if largest > 0.0 { f64::EPSILON.sqrt() * largest } else { 1.0 };
            self.scale[range].iter_mut().for_each(|s| *s = s.max(floor));
        }
    }

    fn elastic_price(&self) -> f64 {
        if self.options.elastic_price > 0.0 {
            return self.options.elastic_price;
        }
        if self.price > 0.0 {
            return self.price;
        }
        // no row has been met with that controls move: the cost has no other scale
        let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let gradient = largest(&self.lin.qp.grad_x).max(largest(&self.lin.qp.grad_u));
        ELASTIC * if gradient > 0.0 { gradient } else { 1.0 }
    }

    /// Takes the price that the last program asks for where the one that is there is off by more than [`APART`]: every other price makes
    /// active rows begin anew. Is it a higher one?
    fn adapt_price(&mut self) -> bool {
        let asked = ELASTIC * self.lin.cost_of_rows();
        if asked == 0.0 || !asked.is_finite() || (asked <= APART * self.price && self.price <= APART * asked) {
            return false;
        }
        let more = asked > self.price;
        self.price = asked;
        more && self.options.elastic_price == 0.0
    }

    /// The control `u0[nu]` for a measured state `x[nx]`. There always is one, and [`Feedback::source`] says where it comes from.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a length is wrong.
    pub fn feedback(&mut self, x: &[f64], u0: &mut [f64]) -> Result<Feedback> {
        self.feedback_since(Instant::now(), x, u0)
    }

    /// The same for a sample that was there at `start`: its time counts from then on.
    pub(super) fn feedback_since(&mut self, start: Instant, x: &[f64], u0: &mut [f64]) -> Result<Feedback> {
        let (nx, nu) = (self.nx(), self.nu());
        if x.len() != nx || u0.len() != nu {
            return Err(Error::Dimension(format!(
                "feedback of {nx} states and {nu} controls: {} and {} given",
                x.len(),
                u0.len()
            )));
        }
        let d = self.options.deadline;
        let limit = Duration::try_from_secs_f64(d).ok();
        let most = Some(self.options.max_changes).filter(|m| *m > 0);
        let within = Within { deadline: limit.and_then(|d| start.checked_add(d)), most };
        if self.pending != Pending::Nothing {
            // two samples without anything in between: the plan of the first is not expanded any more
            self.entry += 1;
        }
        self.prepared = false;
        let measured = x.iter().all(|v| v.is_finite());
        let mut iterations = 0;
        let mut status = QpStatus::Failed;
        let mut source = Source::Plan;
        if measured {
            (status, source) = self.solve(x, u0, within, &mut iterations);
        }
        if matches!(source, Source::Qp | Source::SoftQp) {
            self.pending = Pending::Solved;
        } else if status == QpStatus::OutOfTime && source == Source::Tangent && self.is_limited() {
            self.pending = Pending::Unfinished;
        } else {
            self.pending = Pending::Aged;
        }
        if source == Source::Plan {
            source = self.retreat_to_plan(u0);
        }
        let bounds = self.model.u_lower.iter().zip(&self.model.u_upper);
        u0.iter_mut().zip(bounds).for_each(|(u, (l, h))| *u = u.max(*l).min(*h));
        if measured {
            self.keep_prediction_error(x);
            self.x.copy_from_slice(x);
            self.seen = true;
        } else {
            self.seen = false;
        }
        self.unshifted = self.seen;
        self.u.copy_from_slice(u0);
        if let Some(choices) = self.branches.as_mut().and_then(|b| b.choices.as_mut()) {
            choices.pass(u0);
        }
        self.monitor.sources[source as usize] += 1;
        let time = self.monitor.feedback.add(start.elapsed());
        Ok(Feedback { source, status, iterations, time })
    }

    /// What answers where this controller is not at hand: its plan, with the law of the program that gave it.
    pub(super) fn stand_by(&self, out: &mut Standby) {
        out.x.copy_from_slice(&self.iterate.x);
        out.u.copy_from_slice(&self.iterate.u);
        out.u_lower.copy_from_slice(&self.model.u_lower);
        out.u_upper.copy_from_slice(&self.model.u_upper);
        out.has_gain = self.lin.gains(&mut out.gain);
        out.entry = self.entry;
    }

    /// Learns of samples at which another answered.
    pub(super) fn catch_up(&mut self, passed: &mut Passed) {
        if passed.samples == 0 {
            return;
        }
        // the last one is counted when it is finished
        self.entry += passed.samples - 1 + usize::from(self.pending != Pending::Nothing);
        self.pending = Pending::Aged;
        if passed.measured {
            self.keep_prediction_error(&passed.x);
            self.x.copy_from_slice(&passed.x);
        }
        self.seen = passed.measured;
        self.unshifted = self.seen;
        self.u.copy_from_slice(&passed.u);
        if let Some(choices) = self.branches.as_mut().and_then(|b| b.choices.as_mut()) {
            match passed.samples {
                1 => choices.pass(&passed.u),
                _ => choices.pass_unseen(&passed.u),
            }
        }
        self.monitor.sources.iter_mut().zip(passed.sources).for_each(|(s, p)| *s += p);
        self.monitor.feedback.merge(&passed.timing);
        passed.clear();
    }

    /// Quadratic program, elastic quadratic program, tangent: the first that gives finite controls.
    fn solve(&mut self, x: &[f64], u0: &mut [f64], within: Within, iterations: &mut usize) -> (QpStatus, Source) {
        let (mut status, violated) = self.solve_program(x, within, iterations);
        let mut source = if violated { Source::SoftQp } else { Source::Qp };
        match status {
            QpStatus::Solved | QpStatus::Infeasible => self.lin.first_control(u0),
            QpStatus::OutOfTime => {
                let price = self.elastic_price();
                self.lin.cheapest_control(x, price, &mut self.law, &mut self.step, u0);
                source = Source::Tangent;
            }
            QpStatus::Failed if self.lin.is_ready() => {
                self.lin.tangent_control(x, u0);
                source = Source::Tangent;
            }
            QpStatus::Failed => source = Source::Plan,
        }
        let solved = status == QpStatus::Solved && source == Source::Qp;
        if self.choose_branch(x, within.deadline, solved, iterations) {
            self.lin.first_control(u0);
            (status, source) = (QpStatus::Solved, Source::Qp);
        }
        if source != Source::Plan && !u0.iter().all(|v| v.is_finite()) {
            source = Source::Plan;
        }
        (status, source)
    }

    /// The program, with rows that may be violated at a price where they cannot all be met; says whether some are.
    ///
    /// Where rows were violated at the last sample the program with prices comes first. Its penalties are exact (S.-P. Han, O. L. Mangasarian,
    /// *Exact penalty functions in nonlinear programming*, 1979): without violations its solution is that of the program without prices.
    fn solve_program(&mut self, x: &[f64], within: Within, iterations: &mut usize) -> (QpStatus, bool) {
        let Within { deadline, most } = within;
        if !self.violating {
            let terms = Terms { deadline, most, brief: true, ..Terms::default() };
            let status = self.solve_counted(x, terms, iterations);
            // without an end in time the program with prices, which has a solution, is the one to solve
            let late = status == QpStatus::OutOfTime && terms.over(*iterations);
            if status == QpStatus::Solved || late || !self.lin.is_ready() {
                return (status, false);
            }
            self.adapt_price();
        }
        let priced = |price: f64, done: usize| {
            let most = most.map(|m| m.saturating_sub(done));
            Terms { deadline, most, elastic: Some(price), ..Terms::default() }
        };
        let mut status = self.solve_counted(x, priced(self.elastic_price(), *iterations), iterations);
        if status == QpStatus::Solved && self.adapt_price() {
            status = self.solve_counted(x, priced(self.elastic_price(), *iterations), iterations);
        }
        self.violating = status != QpStatus::Solved || self.lin.violates();
        (if self.violating && status == QpStatus::Solved { QpStatus::Infeasible } else { status }, self.violating)
    }

    /// May a feedback be ended before its program is solved?
    fn is_limited(&self) -> bool {
        self.options.max_changes > 0 || self.options.deadline.is_finite()
    }

    fn solve_counted(&mut self, x: &[f64], terms: Terms, iterations: &mut usize) -> QpStatus {
        let status = self.lin.solve(x, &terms);
        *iterations += self.lin.qp_iterations();
        self.count_qp();
        status
    }

    /// Takes an alternative to the plan where that is cheaper.
    fn choose_branch(&mut self, x: &[f64], deadline: Option<Instant>, solved: bool, iterations: &mut usize) -> bool {
        let price = self.elastic_price();
        let Some(b) = &mut self.branches else { return false };
        let terms = Terms { deadline, ..Terms::default() };
        let choice = b.choose(&mut self.lin, x, &terms, (price, self.options.hysteresis, solved));
        self.monitor.qps += choice.qps;
        self.monitor.qp_iterations += choice.iterations;
        *iterations += choice.iterations as usize;
        self.monitor.flips += u64::from(choice.taken);
        choice.taken
    }

    /// The control that the last plan has for now; behind its end the last control.
    fn retreat_to_plan(&mut self, u0: &mut [f64]) -> Source {
        let nu = self.nu();
        match self.iterate.u.chunks_exact(nu).nth(self.entry) {
            Some(u) => {
                u0.copy_from_slice(u);
                Source::Plan
            }
            None => {
                u0.copy_from_slice(&self.u);
                Source::Hold
            }
        }
    }

    fn keep_prediction_error(&mut self, x: &[f64]) {
        self.monitor.prediction = f64::NAN;
        self.shock = 0.0;
        if self.has_prediction {
            let size = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let gap = x.iter().zip(&self.predicted).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            self.monitor.prediction = if gap > 0.0 { gap / size.max(gap) } else { 0.0 };
            self.largest = self.largest.max(size);
            self.shock = if gap > 0.0 { gap / self.largest.max(gap) } else { 0.0 };
        }
    }

    /// Solves the problem for an initial value to convergence by damped steps of the same kind, from the present iterate: the
    /// start of a controller. Returns the steps it took, or an error with what to do.
    ///
    /// # Errors
    /// [`Error::Numeric`] if it does not converge in `max_iter` steps; the iterate is the best point found.
    pub fn initialise(&mut self, x0: &[f64], max_iter: usize) -> Result<usize> {
        self.check_params()?;
        finite("initial value", x0, self.nx())?;
        self.finish();
        self.take_weights();
        self.has_prediction = false;
        let nx = self.nx();
        if self.model.switches {
            return self.initialise_switching(x0, max_iter);
        }
        self.iterate.x[..nx].copy_from_slice(x0);
        let mut penalty = 0.0f64;
        for done in 0..max_iter {
            stop::check()?;
            let outcome = self.lin.linearise(&mut self.model, &self.iterate);
            let failed = outcome.is_err();
            self.note(outcome)?;
            if failed || !self.lin.is_ready() {
                return Err(Error::Numeric(
                    "functions have no value, or the problem is not convex: give another guess".into(),
                ));
            }
            self.predicted.copy_from_slice(x0);
            let t = self.damped_step(&mut penalty)?;
            let size = self.distance();
            if t == 1.0 && size <= CONVERGED {
                // the plan begins at the sample to come
                self.entry = 0;
                return Ok(done + 1);
            }
        }
        Err(Error::Numeric(format!("no convergence in {max_iter} steps: give a better guess, or more steps")))
    }

    /// The best of the plan and its alternatives, each improved until that lowers its cost no further.
    fn initialise_switching(&mut self, x0: &[f64], max_iter: usize) -> Result<usize> {
        self.other.x[..x0.len()].copy_from_slice(x0);
        let failed = self.monitor.failed_linearisations;
        let done = self.search_branches(max_iter, 0.0)?;
        if self.monitor.failed_linearisations > failed || !self.lin.is_ready() {
            let unknown = "functions have no value there, or the problem is not convex";
            let why = self.model.stage.failure().unwrap_or(unknown);
            return Err(Error::Numeric(format!(
                "there is no linearisation of the plan from this state: {why}; give another guess"
            )));
        }
        if let Some(b) = &mut self.branches {
            b.take_cheapest(&mut self.lin, &mut self.iterate);
        }
        if done < max_iter {
            return Ok(done);
        }
        Err(Error::Numeric(format!("no convergence in {max_iter} steps: give a better guess, or more steps")))
    }

    /// One step with the share of it that decreases cost plus violations; `other` is the point before.
    fn damped_step(&mut self, penalty: &mut f64) -> Result<f64> {
        let x = std::mem::take(&mut self.predicted);
        let (status, violated) = self.solve_program(&x, Within::default(), &mut 0);
        self.predicted = x;
        if !has_solution(status, violated) {
            return Err(Error::Numeric("a quadratic program has no solution: give another guess".into()));
        }
        self.lin.step(&mut self.step);
        let s = &self.step.solution;
        let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        *penalty = penalty.max(2.0 * largest(&s.lambda).max(largest(&s.row_mu)));
        let qp = &self.lin.qp;
        let slope = |g: &[f64], d: &[f64]| g.iter().zip(d).map(|(g, d)| g * d).sum::<f64>();
        let along = slope(&qp.grad_x, &s.x) + slope(&qp.grad_u, &s.u);
        self.other.copy_from(&self.iterate);
        let [cost, violation] = self.merit()?.unwrap_or([f64::INFINITY, f64::INFINITY]);
        let descent = along - *penalty * violation;
        let before = cost + *penalty * violation;
        let mut t = 1.0;
        self.lin.advance(&self.step, t, &mut self.iterate);
        if self.is_rounding() {
            // no digit of the cost knows of it
            return Ok(t);
        }
        for _ in 0..HALVINGS {
            self.lin.advance(&self.step, t, &mut self.iterate);
            if let Some([cost, violation]) = self.merit()? {
                let rounding = f64::EPSILON.sqrt() * before.abs();
                if cost + *penalty * violation <= before + ARMIJO * t * descent.min(0.0) + rounding {
                    break;
                }
            }
            t *= 0.5;
        }
        Ok(t)
    }

    /// Cost with prices of violations, and violations that have none, of the iterate; nothing where functions have no value.
    fn merit(&mut self) -> Result<Option<[f64; 2]>> {
        let Model { nodes, stage, costs, constraints, .. } = &mut self.model;
        let (n, nx, it) = (nodes.n, nodes.nx, &self.iterate);
        let mut all = || -> std::result::Result<[f64; 2], EvalError> {
            nodes.solve(&it.x, &it.u)?;
            let cost = costs.value(nodes, &it.x, &it.u)?;
            constraints.values(nodes, &it.x, &it.u)?;
            let at = Starts { x: &it.x[..n * nx], u: &it.u, p: &nodes.p, t: &nodes.t, h: &nodes.h };
            let next = &mut self.next;
            stage.values(&at, next)?;
            let gaps: f64 = next.iter().zip(&it.x[nx..]).map(|(a, b)| (a - b).abs()).sum();
            let [hard, priced] = constraints.violation();
            Ok([cost + priced, gaps + hard])
        };
        match all() {
            Ok(m) => Ok(Some(m)),
            Err(EvalError::Recoverable) => Ok(None),
            Err(e) => self.note(Err(e)).map(|()| None),
        }
    }
}

/// Did a program end with a solution, with or without violations?
fn has_solution(status: QpStatus, violated: bool) -> bool {
    status == QpStatus::Solved || (violated && status == QpStatus::Infeasible)
}

fn difference(after: Evaluations, before: Evaluations) -> Evaluations {
    Evaluations {
        values: after.values - before.values,
        jacobians: after.jacobians - before.jacobians,
        adjoints: after.adjoints - before.adjoints,
        hessians: after.hessians - before.hessians,
    }
}

/// State `i` of a guess `values[times.len() · width]` at a time, linear in between.
fn interpolate(times: &[f64], values: &[f64], width: usize, i: usize, t: f64) -> f64 {
    let after = times.partition_point(|s| *s <= t);
    let value = |k: usize| values[k * width + i];
    if after == 0 {
        return value(0);
    }
    if after == times.len() {
        return value(after - 1);
    }
    let share = (t - times[after - 1]) / (times[after] - times[after - 1]);
    value(after - 1) + share * (value(after) - value(after - 1))
}
