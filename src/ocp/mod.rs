//! Optimal control of piecewise smooth systems.
//!
//! ```text
//! min ∫ L(x,u,p,t) dt + M(x(T),p)
//! s.t. dynamics,  x0 ∈ [x0_l, x0_u],  x ∈ [x_l, x_u],  u ∈ [u_l, u_u],
//!      c_l ≤ c(x,u,p,t) ≤ c_u along the horizon,  e_l ≤ e(x(T),p) ≤ e_u
//! ```
//!
//! Controls are piecewise constant on an equidistant grid of stages; every stage has the same number of finite
//! elements (7.50). [`Ocp`] collects the problem, discretises it when it is first solved, and keeps structure and
//! symbolic factorisation for further solves with other bounds, parameters and starting points.

mod accuracy;
mod identify;
mod neighbours;
mod sensitivity;
mod statement;
mod terms;

pub use accuracy::Accuracy;
pub use sensitivity::OcpSensitivity;
pub use statement::Statement;

use std::time::Instant;

use self::accuracy::Answer;
use self::identify::Identifier;
use crate::dcs::{Dcs, FormOptions};
use crate::error::{finite, Error, Result};
use crate::event::Engine;
use crate::fesd::{Exit, Fesd, Options, PathAt, PathConstraint, Spec, Terminal, Trajectory};
use crate::linalg::kkt::LinearStats;
use crate::mpcc::{MpccSettings, MpccSolver, Polish, Side, Wanted};
use crate::nlp::{Bounds, Control, Nlp, Outcome, Residuals, Statistics};
use crate::settings::{InitialGuess, Settings};
use crate::sim::Simulator;
use crate::system::{SharedFunction, System};

/// What a solve found.
#[derive(Debug, Clone)]
pub struct OcpResult {
    /// How it ended.
    pub outcome: Outcome,
    /// Was the active set identified and the problem solved with it?
    pub polish: Polish,
    /// The user's cost alone.
    pub cost: f64,
    /// Controls `[n_stages · nu]`.
    pub controls: Vec<f64>,
    /// States, switches, dense output.
    pub trajectory: Trajectory,
    /// What is left of every residual.
    pub residuals: Residuals,
    /// What it cost; building the problem is not part of it.
    pub stats: Statistics,
    /// Seconds to build the problem, 0 when an earlier structure was used again.
    pub time_build: f64,
    /// Variables, rows, complementarity pairs of the discretised problem.
    pub dimensions: (usize, usize, usize),
    /// Comparison with a simulation of the controls; `None` when it is not asked for.
    pub accuracy: Option<Accuracy>,
}

struct Built {
    problem: Fesd,
    solver: MpccSolver,
    bounds: Bounds,
    identifier: Identifier,
}

/// An optimal control problem.
pub struct Ocp {
    system: System,
    settings: Settings,
    horizon: f64,
    n_stages: usize,
    t0: f64,
    lagrange: Option<SharedFunction>,
    mayer: Option<SharedFunction>,
    path: Vec<PathConstraint>,
    terminal: Vec<Terminal>,
    x_bounds: [Vec<f64>; 2],
    x0_bounds: [Vec<f64>; 2],
    u_bounds: [Vec<f64>; 2],
    params: Vec<f64>,
    x_guess: Option<(Vec<f64>, Vec<f64>)>,
    u_guess: Option<Vec<f64>>,
    built: Option<Built>,
    /// Simulates answers, with the tolerance it was made for.
    engine: Option<(Engine, f64)>,
    result: Option<OcpResult>,
}

impl Ocp {
    /// A problem over `[0, horizon]` with `n_stages` control intervals. Bounds are infinite, the initial value is
    /// free, parameters are zero until they are set.
    pub fn new(system: &System, horizon: f64, n_stages: usize, settings: &Settings) -> Result<Ocp> {
        system.validate()?;
        settings.validate()?;
        if !(horizon > 0.0 && horizon.is_finite()) {
            return Err(Error::Range(format!("the horizon is {horizon}: it must be positive and finite")));
        }
        if n_stages == 0 {
            return Err(Error::Dimension("the horizon needs at least one control stage".into()));
        }
        let d = system.dims();
        let free = |n: usize| [vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]];
        Ok(Ocp {
            system: system.clone(),
            settings: *settings,
            horizon,
            n_stages,
            t0: 0.0,
            lagrange: None,
            mayer: None,
            path: Vec::new(),
            terminal: Vec::new(),
            x_bounds: free(d.x),
            x0_bounds: free(d.x),
            u_bounds: free(d.u),
            params: vec![0.0; d.p],
            x_guess: None,
            u_guess: None,
            built: None,
            engine: None,
            result: None,
        })
    }

    /// The system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Number of control stages.
    pub fn n_stages(&self) -> usize {
        self.n_stages
    }

    /// Sets the cost rate, one output.
    pub fn set_lagrange(&mut self, f: SharedFunction) -> Result<()> {
        self.check(&f, Some(1))?;
        self.lagrange = Some(f);
        self.engine = None;
        self.built = None;
        Ok(())
    }

    /// Sets the terminal cost, one output.
    pub fn set_mayer(&mut self, f: SharedFunction) -> Result<()> {
        self.check(&f, Some(1))?;
        self.mayer = Some(f);
        self.built = None;
        Ok(())
    }

    /// Adds a constraint along the horizon.
    pub fn add_path(&mut self, f: SharedFunction, lower: &[f64], upper: &[f64], at: PathAt) -> Result<()> {
        self.check(&f, None)?;
        check_bounds("path constraint", lower, upper, f.n_out())?;
        self.path.push(PathConstraint { f, lower: lower.to_vec(), upper: upper.to_vec(), at });
        self.built = None;
        Ok(())
    }

    /// Adds a constraint at the end of the horizon.
    pub fn add_terminal(&mut self, f: SharedFunction, lower: &[f64], upper: &[f64]) -> Result<()> {
        self.check(&f, None)?;
        check_bounds("terminal constraint", lower, upper, f.n_out())?;
        self.terminal.push(Terminal { f, lower: lower.to_vec(), upper: upper.to_vec() });
        self.built = None;
        Ok(())
    }

    /// Sets bounds of the states at all stage points and element ends after the initial time.
    pub fn set_x_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("state", lower, upper, self.system.dims().x)?;
        self.x_bounds = [lower.to_vec(), upper.to_vec()];
        Ok(())
    }

    /// Sets bounds of the initial value; equal bounds fix it.
    pub fn set_x0_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("initial value", lower, upper, self.system.dims().x)?;
        self.x0_bounds = [lower.to_vec(), upper.to_vec()];
        Ok(())
    }

    /// Fixes the initial value.
    pub fn set_x0(&mut self, x0: &[f64]) -> Result<()> {
        self.set_x0_bounds(x0, x0)
    }

    /// Sets bounds of the controls.
    pub fn set_u_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("control", lower, upper, self.system.dims().u)?;
        self.u_bounds = [lower.to_vec(), upper.to_vec()];
        Ok(())
    }

    /// Sets the parameters.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.params.len())?;
        self.params.copy_from_slice(p);
        Ok(())
    }

    /// Sets the initial time.
    pub fn set_t0(&mut self, t0: f64) -> Result<()> {
        finite("initial time", &[t0], 1)?;
        self.t0 = t0;
        Ok(())
    }

    /// Gives states `x[times.len() · nx]` at rising times from the start of the horizon; linear in between.
    pub fn set_x_guess(&mut self, times: &[f64], x: &[f64]) -> Result<()> {
        finite("time of the guess", times, times.len())?;
        if times.is_empty() || times.windows(2).any(|w| w[0] >= w[1]) {
            return Err(Error::Range("the times of the guess must be given and rise".into()));
        }
        finite("state of the guess", x, times.len() * self.system.dims().x)?;
        self.x_guess = Some((times.to_vec(), x.to_vec()));
        Ok(())
    }

    /// Gives controls `u[n_stages · nu]` to start from.
    pub fn set_u_guess(&mut self, u: &[f64]) -> Result<()> {
        finite("control of the guess", u, self.n_stages * self.system.dims().u)?;
        self.u_guess = Some(u.to_vec());
        Ok(())
    }

    /// Changes the settings. The problem is discretised again where its structure depends on what changed.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<()> {
        settings.validate()?;
        if settings.validate_as_update(&self.settings).is_err() {
            self.built = None;
        }
        self.settings = *settings;
        Ok(())
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Structure and work of the factorisations since the problem was built; `None` before the first solve.
    pub fn linear_statistics(&self) -> Option<LinearStats> {
        self.built.as_ref().map(|b| b.solver.linear_statistics())
    }

    /// The result of the last solve.
    pub fn result(&self) -> Option<&OcpResult> {
        self.result.as_ref()
    }

    fn check(&self, f: &SharedFunction, n_out: Option<usize>) -> Result<()> {
        if f.dims() != self.system.dims() {
            return Err(Error::Dimension(format!(
                "function '{}' takes other numbers of states, controls or parameters than the system",
                f.name()
            )));
        }
        match n_out {
            Some(n) if f.n_out() != n => {
                Err(Error::Dimension(format!("function '{}' has {} outputs, expected {n}", f.name(), f.n_out())))
            }
            _ => Ok(()),
        }
    }

    fn build(&mut self) -> Result<f64> {
        if self.built.is_some() {
            return Ok(0.0);
        }
        let clock = Instant::now();
        let mut dcs = Dcs::new(&self.system, FormOptions::from_settings(&self.settings)?)?;
        let t_col = self.system.dims().t_col();
        let outer = self.lagrange.iter().chain(&self.mayer).chain(self.path.iter().map(|p| &p.f));
        if outer.chain(self.terminal.iter().map(|t| &t.f)).any(|f| !f.jac_pattern().rows(t_col).is_empty()) {
            dcs.require_clock();
        }
        let n_fe = self.settings.n_fe as usize;
        let spec = Spec {
            lagrange: self.lagrange.clone(),
            mayer: self.mayer.clone(),
            path: self.path.clone(),
            terminal: self.terminal.clone(),
            ..Spec::new(dcs, Options::from_settings(&self.settings)?, vec![n_fe; self.n_stages])
        };
        let mut problem = Fesd::new(spec, self.horizon / self.n_stages as f64)?;
        let solver = MpccSolver::new(&mut problem, MpccSettings::from(&self.settings))?;
        let bounds = problem.bounds();
        let mut identifier = Identifier::new(&self.system, &self.settings);
        identifier.duration = self.horizon / self.n_stages as f64;
        identifier.n_fe = n_fe;
        identifier.h_at = problem.lengths();
        identifier.cells = problem.spec().dcs.subsystems().iter().map(|s| s.cells.len()).collect();
        (identifier.x0_at, identifier.u_at) = problem.places();
        self.built = Some(Built { problem, solver, bounds, identifier });
        Ok(clock.elapsed().as_secs_f64())
    }

    /// Solves. `Err` when the problem cannot be stated; how the solver ended is in the result.
    pub fn solve(&mut self, control: &mut Control) -> Result<&OcpResult> {
        let time_build = self.build()?;
        let guess = self.state_guess(control)?;
        let Some(Built { mut problem, mut solver, mut bounds, mut identifier }) = self.built.take() else {
            return Err(Error::Internal("the problem was not built".into()));
        };
        let d = self.system.dims();
        problem.set_params(&self.params)?;
        problem.bound_states(&mut bounds, &self.x_bounds[0], &self.x_bounds[1]);
        problem.bound_initial(&mut bounds, &self.x0_bounds[0], &self.x0_bounds[1], self.t0);
        for k in 0..self.n_stages {
            problem.bound_control(&mut bounds, k, &self.u_bounds[0], &self.u_bounds[1]);
        }
        bounds.validate(problem.n(), problem.m())?;
        let mut w0 = vec![0.0; problem.n()];
        let u_start = self.control_guess();
        problem.guess(
            &mut w0,
            self.t0,
            |t, x| interpolate(&guess.0, &guess.1, t, x),
            |k, u| u.copy_from_slice(&u_start[k * d.u..(k + 1) * d.u]),
        );
        solver.settings = MpccSettings::from(&self.settings);
        control.limit(self.settings.max_time);
        identifier.params.clone_from(&self.params);
        identifier.t0 = self.t0;
        identifier.restart(self.settings.mode_search as usize);
        let detects = problem.detects_switches();
        let mut suggest = |k: Wanted, w: &[f64], sides: &mut [Side]| detects && identifier.suggest(k, w, sides);
        problem.set_exit(Exit::Slope);
        solver.solve_with(&mut problem, &bounds, &w0, control, &mut suggest);
        let found = solver.solution();
        if found.polish == Polish::Rejected && found.outcome == Outcome::Solved {
            problem.set_exit(Exit::Theta);
            solver.polish_again(&mut problem, &bounds, control, &mut suggest);
        }
        let s = solver.solution();
        let mut trajectory = Trajectory::new(&problem.spec().dcs, problem.tableau());
        let sides = (s.polish == Polish::Done).then_some(&s.sides[..]);
        trajectory.append(&problem, &s.x, sides, self.t0);
        let mut result = OcpResult {
            outcome: s.outcome,
            polish: s.polish,
            cost: problem.cost(&s.x).unwrap_or(f64::NAN),
            controls: problem.controls(&s.x),
            trajectory,
            residuals: s.residuals,
            stats: s.stats,
            time_build,
            dimensions: (problem.n(), problem.m(), crate::mpcc::Mpcc::pairs(&problem).len()),
            accuracy: None,
        };
        self.built = Some(Built { problem, solver, bounds, identifier });
        if self.settings.accuracy != 0 && result.outcome != Outcome::Stopped {
            result.accuracy = self.measure(&result)?;
        }
        Ok(self.result.insert(result))
    }

    /// Compares an answer with the simulation of its controls.
    fn measure(&mut self, r: &OcpResult) -> Result<Option<Accuracy>> {
        let tol = self.settings.accuracy_tol;
        let (mut engine, tol) = match self.engine.take() {
            Some((e, t)) if t == tol => (e, t),
            _ => match accuracy::engine(&self.system, self.lagrange.as_ref(), tol) {
                Ok(e) => (e, tol),
                // a kind of system that the engine does not know
                Err(Error::Unsupported(_)) => return Ok(None),
                Err(e) => return Err(e),
            },
        };
        let n = self.n_stages;
        let ends = r
            .trajectory
            .elements
            .iter()
            .enumerate()
            .filter(|(k, e)| r.trajectory.elements.get(k + 1).is_none_or(|next| next.stage != e.stage));
        let states: Vec<f64> = ends.flat_map(|(_, e)| e.x1.iter().copied()).collect();
        let found = accuracy::measure(
            &mut engine,
            &Answer {
                t0: self.t0,
                x0: &r.trajectory.elements[0].x0,
                durations: &vec![self.horizon / n as f64; n],
                controls: &r.controls,
                params: &self.params.repeat(n),
                states: &states,
                cost: r.cost,
                mayer: self.mayer.as_ref(),
                terminal: self.terminal.iter().map(|t| (&t.f, &t.lower[..], &t.upper[..])).collect(),
            },
        );
        self.engine = Some((engine, tol));
        found.map(Some)
    }

    fn control_guess(&self) -> Vec<f64> {
        if let Some(u) = &self.u_guess {
            return u.clone();
        }
        let one: Vec<f64> = self.u_bounds[0].iter().zip(&self.u_bounds[1]).map(|(l, u)| middle(*l, *u)).collect();
        one.repeat(self.n_stages)
    }

    /// Times and states to start from.
    fn state_guess(&self, control: &mut Control) -> Result<(Vec<f64>, Vec<f64>)> {
        if let Some(g) = &self.x_guess {
            return Ok(g.clone());
        }
        let x0: Vec<f64> = self.x0_bounds[0].iter().zip(&self.x0_bounds[1]).map(|(l, u)| middle(*l, *u)).collect();
        if self.settings.initial_guess()? == InitialGuess::Simulation {
            let mut sim = Simulator::new(&self.system, &self.settings)?;
            sim.set_params(&self.params)?;
            sim.set_state(self.t0, &x0)?;
            let u = self.control_guess();
            let mut inner = Control { interrupt: control.interrupt, monitor: None, deadline: control.deadline };
            let r = sim.run_stages(self.horizon, self.n_stages, Some(&u), &mut inner)?;
            // a simulation that fails half way is still a better start than a constant
            let (mut times, mut states) = (vec![0.0], x0.clone());
            for e in r.trajectory.elements.iter().filter(|e| e.h > 1e-12) {
                times.push(e.t + e.h - self.t0);
                states.extend_from_slice(&e.x1);
            }
            return Ok((times, states));
        }
        Ok((vec![0.0], x0))
    }
}

fn check_bounds(what: &str, lower: &[f64], upper: &[f64], n: usize) -> Result<()> {
    if lower.len() != n || upper.len() != n {
        return Err(Error::Dimension(format!(
            "bounds of the {what} have {} and {} entries, expected {n}",
            lower.len(),
            upper.len()
        )));
    }
    for i in 0..n {
        if lower[i].is_nan() || upper[i].is_nan() {
            return Err(Error::Range(format!("bound of {what} {i} is NaN; use an infinity for no bound")));
        }
        if lower[i] > upper[i] {
            return Err(Error::Range(format!(
                "{what} {i} has lower bound {} above upper bound {}",
                lower[i], upper[i]
            )));
        }
    }
    Ok(())
}

/// A point well inside an interval.
fn middle(lo: f64, hi: f64) -> f64 {
    match (lo.is_finite(), hi.is_finite()) {
        (true, true) => 0.5 * (lo + hi),
        (true, false) => lo.max(0.0),
        (false, true) => hi.min(0.0),
        (false, false) => 0.0,
    }
}

fn interpolate(times: &[f64], states: &[f64], t: f64, x: &mut [f64]) {
    let nx = x.len();
    let k = times.partition_point(|&s| s <= t).clamp(1, times.len());
    let a = &states[(k - 1) * nx..k * nx];
    if k == times.len() {
        x.copy_from_slice(a);
        return;
    }
    let b = &states[k * nx..(k + 1) * nx];
    let s = ((t - times[k - 1]) / (times[k] - times[k - 1])).clamp(0.0, 1.0);
    for i in 0..nx {
        x[i] = (1.0 - s) * a[i] + s * b[i];
    }
}
