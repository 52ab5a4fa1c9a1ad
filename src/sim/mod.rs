//! Simulation of piecewise smooth systems, step by step with FESD.
//!
//! Every step is a small square MPCC of `n_fe` finite elements. Its structure and symbolic factorisation serve
//! the whole simulation. A step first tries the active set the last one ended with, which costs a few Newton
//! iterations; only when that branch has no solution the homotopy decides where the step switches.

use std::time::Instant;

use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::fesd::{Fesd, Options, Spec, Trajectory};
use crate::mpcc::{Mpcc, MpccSolver, Polish, Side};
use crate::nlp::{Bounds, Control, Nlp, Outcome, Statistics};
use crate::ocp::{deadline, finite, mpcc_settings};
use crate::settings::Settings;
use crate::system::System;
use crate::tableau::Tableau;

/// What a simulation found.
#[derive(Debug, Clone)]
pub struct SimResult {
    /// How it ended; anything but solved is that of the step that failed.
    pub outcome: Outcome,
    /// States, switches, dense output, up to the failed step.
    pub trajectory: Trajectory,
    /// Cost of all steps.
    pub stats: Statistics,
    /// Steps done.
    pub steps: usize,
    /// Steps that needed the homotopy.
    pub homotopies: usize,
    /// Largest violation of the equations over the steps.
    pub primal: f64,
    /// Largest `min(λ, θ)` over the steps.
    pub pair_min: f64,
}

/// Iterations a predicted active set gets before the homotopy takes over.
const PREDICTION_ITERATIONS: usize = 25;

/// A simulator: model, state, and what is reused from step to step.
pub struct Simulator {
    settings: Settings,
    nx: usize,
    nu: usize,
    problem: Fesd,
    solver: MpccSolver,
    bounds: Bounds,
    tableau: Tableau,
    t: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    w: Vec<f64>,
    sides: Vec<Side>,
    /// Has a solution to start the next step from?
    warm: bool,
}

impl Simulator {
    /// Discretises one step of `system`. State, controls and parameters are zero until they are set.
    pub fn new(system: &System, settings: &Settings) -> Result<Simulator> {
        settings.validate()?;
        let d = system.dims();
        let dcs = Dcs::stewart(system)?;
        let options = Options::from_settings(settings)?;
        let spec = Spec {
            dcs,
            options,
            n_stages: 1,
            n_fe: settings.n_fe as usize,
            lagrange: None,
            mayer: None,
            path: Vec::new(),
            terminal: Vec::new(),
        };
        let mut problem = Fesd::new(spec, 1.0)?;
        let solver = MpccSolver::new(&mut problem, mpcc_settings(settings))?;
        Ok(Simulator {
            settings: *settings,
            nx: d.x,
            nu: d.u,
            bounds: problem.bounds(),
            tableau: problem.tableau().clone(),
            t: 0.0,
            x: vec![0.0; d.x],
            u: vec![0.0; d.u],
            w: vec![0.0; problem.n()],
            sides: vec![Side::First; problem.n_groups()],
            warm: false,
            problem,
            solver,
        })
    }

    /// Sets time and state; the next step starts there.
    pub fn set_state(&mut self, t: f64, x: &[f64]) -> Result<()> {
        finite("time", &[t], 1)?;
        finite("state", x, self.nx)?;
        self.t = t;
        self.x.copy_from_slice(x);
        self.warm = false;
        Ok(())
    }

    /// Sets the controls, constant from now on.
    pub fn set_controls(&mut self, u: &[f64]) -> Result<()> {
        finite("control", u, self.nu)?;
        self.u.copy_from_slice(u);
        Ok(())
    }

    /// Sets the parameters.
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        self.problem.set_params(p)
    }

    /// Time reached.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// State reached.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Simulates over `duration` in `n_steps` equal steps of `n_fe` finite elements each.
    pub fn run(&mut self, duration: f64, n_steps: usize, control: &mut Control) -> Result<SimResult> {
        check_run(duration, n_steps)?;
        let mut r = self.empty_result();
        let (t0, h) = (self.t, duration / n_steps as f64);
        for k in 0..n_steps {
            // the grid does not inherit the rounding of sums
            self.t = t0 + k as f64 * h;
            self.advance(h, control, &mut r);
            if r.outcome != Outcome::Solved {
                break;
            }
        }
        Ok(r)
    }

    /// Simulates `n` stages of equal length with the controls `u[n · nu]`, one step each.
    pub(crate) fn run_stages(
        &mut self,
        duration: f64,
        n: usize,
        u: &[f64],
        nu: usize,
        mut control: Control,
    ) -> Result<SimResult> {
        check_run(duration, n)?;
        let mut r = self.empty_result();
        for k in 0..n {
            self.set_controls(&u[k * nu..(k + 1) * nu])?;
            self.advance(duration / n as f64, &mut control, &mut r);
            if r.outcome != Outcome::Solved {
                break;
            }
        }
        Ok(r)
    }

    /// An empty result to collect steps in.
    pub fn empty_result(&self) -> SimResult {
        SimResult {
            outcome: Outcome::Solved,
            trajectory: Trajectory::new(&self.problem.spec().dcs, &self.tableau),
            stats: Statistics::default(),
            steps: 0,
            homotopies: 0,
            primal: 0.0,
            pair_min: 0.0,
        }
    }

    /// Does one step of length `h` and appends it to `r`. When it fails, time and state stay as they are.
    pub fn advance(&mut self, h: f64, control: &mut Control, r: &mut SimResult) {
        let clock = Instant::now();
        if self.settings.max_time.is_finite() && control.deadline.is_none() {
            control.deadline = deadline(self.settings.max_time);
        }
        self.problem.set_duration(h);
        self.problem.write_durations(&mut self.bounds);
        self.problem.bound_initial(&mut self.bounds, &self.x, &self.x, self.t);
        self.problem.bound_control(&mut self.bounds, 0, &self.u, &self.u);
        self.problem.guess(&mut self.w, self.t, |_, x| x.copy_from_slice(&self.x), |_, u| u.copy_from_slice(&self.u));
        let predicted = self.warm && self.settings.polish() && self.predict(control, r);
        if !predicted {
            r.homotopies += 1;
            self.solver.settings = mpcc_settings(&self.settings);
            self.solver.solve(&mut self.problem, &self.bounds, &self.w, control);
            add(&mut r.stats, &self.solver.solution().stats);
        }
        let s = self.solver.solution();
        r.outcome = s.outcome;
        r.stats.time_total += clock.elapsed().as_secs_f64();
        if s.outcome != Outcome::Solved {
            self.warm = false;
            return;
        }
        r.primal = r.primal.max(s.residuals.primal);
        r.pair_min = r.pair_min.max(s.residuals.pair_min);
        let polished = s.polish == Polish::Done;
        r.trajectory.append(&self.problem, &s.x, polished.then_some(&s.sides[..]), self.t);
        r.steps += 1;
        if let Some(e) = r.trajectory.elements.last() {
            self.x.copy_from_slice(&e.x1);
        }
        self.t += h;
        self.warm = polished;
        if polished {
            self.continue_last_active_set();
        }
    }

    /// Every element of the next step gets the active set of the last element of this one.
    fn continue_last_active_set(&mut self) {
        let sides = &self.solver.solution().sides;
        let per_element = sides.len() / self.settings.n_fe as usize;
        let last = sides.len() - per_element;
        for (k, s) in self.sides.iter_mut().enumerate() {
            *s = sides[last + k % per_element.max(1)];
        }
    }

    fn predict(&mut self, control: &mut Control, r: &mut SimResult) -> bool {
        let ok = self.solver.solve_branch(
            &mut self.problem,
            &self.bounds,
            &self.sides,
            &self.w,
            PREDICTION_ITERATIONS,
            control,
        );
        add(&mut r.stats, &self.solver.solution().stats);
        ok
    }
}

fn check_run(duration: f64, n_steps: usize) -> Result<()> {
    if !(duration > 0.0 && duration.is_finite()) {
        return Err(Error::Range(format!("the duration is {duration}: it must be positive and finite")));
    }
    if n_steps == 0 {
        return Err(Error::Range("at least one step is needed".into()));
    }
    Ok(())
}

fn add(total: &mut Statistics, s: &Statistics) {
    total.iterations += s.iterations;
    total.factorisations += s.factorisations;
    total.evaluations += s.evaluations;
    total.restoration_iterations += s.restoration_iterations;
    total.polish_iterations += s.polish_iterations;
    total.max_delta_w = total.max_delta_w.max(s.max_delta_w);
    total.time_eval += s.time_eval;
    total.time_linalg += s.time_linalg;
}
