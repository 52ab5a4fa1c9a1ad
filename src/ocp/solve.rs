//! Discretising and solving; answers in the user's terms.

use std::time::Instant;

use super::accuracy::{self, Accuracy, Answer, Replay};
use super::diagnosis::Case;
use super::extend::{Extended, Slacks, Statement};
use super::identify::Identifier;
use super::neighbours::Grid;
use super::{Durations, Ocp, OcpResult, SLACK};
use crate::dcs::{Dcs, FormOptions};
use crate::error::{Error, Result};
use crate::fesd::{Fesd, Options, Spec, Trajectory};
use crate::mpcc::{Mpcc, MpccSettings, MpccSolver, Polish, Side, Solution, Wanted, Warm};
use crate::nlp::{Bounds, Control, Nlp, Outcome, Statistics};
use crate::system::{Regions, SharedFunction};

/// The discretised problem, ready to be solved again and again.
pub(super) struct Built {
    pub problem: Fesd,
    pub solver: MpccSolver,
    pub bounds: Bounds,
    pub identifier: Identifier,
    pub extended: Extended,
}

/// Where a solve starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// From the guesses, along the homotopy.
    Cold,
    /// From guesses and modes that are an earlier solution on another grid.
    Carried,
    /// From the last solution.
    Warm,
}

impl Ocp {
    pub(super) fn build(&mut self) -> Result<f64> {
        if self.built.is_some() {
            return Ok(0.0);
        }
        let clock = Instant::now();
        let extended = Extended::new(&Statement {
            system: &self.system,
            lagrange: self.lagrange.as_ref(),
            mayer: self.mayer.as_ref(),
            path: &self.path,
            terminal: &self.terminal,
            boundary: &self.boundary,
            squares: &self.squares,
            soft: &self.soft,
            complementarity: &self.complementarity,
        })?;
        self.check_free_params(&extended)?;
        let mut dcs = Dcs::new(&extended.system, FormOptions::from_settings(&self.settings)?)?;
        let e = &extended;
        let outer = e.lagrange.iter().chain(&e.mayer).chain(&e.grid_cost).chain(e.path.iter().map(|p| &p.f));
        let outer = outer.chain(e.terminal.iter().map(|t| &t.f)).chain(e.boundary.iter().map(|b| &b.f));
        let outer = outer.chain(e.complementarity.iter().map(|c| &c.f));
        if outer.into_iter().any(|f| !f.jac_pattern().rows(f.dims().t_col()).is_empty()) {
            dcs.require_clock();
        }
        let d = e.system.dims();
        let n_fe = self.elements();
        let mut linear = self.linear.clone();
        linear.resize(d.u, false);
        let mut free = self.free_params();
        free.resize(d.p, false);
        free[e.slack_params.clone()].fill(true);
        let spec = Spec {
            durations: self.time,
            linear,
            free_params: free,
            lagrange: e.lagrange.clone(),
            mayer: e.mayer.clone(),
            grid_cost: e.grid_cost.clone(),
            path: e.path.clone(),
            terminal: e.terminal.clone(),
            boundary: e.boundary.clone(),
            complementarity: e.complementarity.clone(),
            ..Spec::new(dcs, Options::from_settings(&self.settings)?, n_fe.clone())
        };
        let mut problem = Fesd::new(spec, self.durations[0])?;
        let solver = MpccSolver::new(&mut problem, MpccSettings::from(&self.settings))?;
        let bounds = problem.bounds();
        let mut identifier = Identifier::new(&extended.system, &self.settings);
        identifier.linear = self.linear.contains(&true);
        identifier.h_at = problem.lengths();
        identifier.n_sides = problem.n_element_groups();
        let sizes = problem.spec().dcs.form().simplices.iter().map(|c| c.len()).collect();
        identifier.grid = Grid { n_fe, sizes };
        (identifier.x0_at, identifier.u_at) = problem.places();
        self.built = Some(Built { problem, solver, bounds, identifier, extended });
        Ok(clock.elapsed().as_secs_f64())
    }

    /// Functions whose Jacobian is left to differences do not know parameters as variables unless a pattern says so.
    fn check_free_params(&self, e: &Extended) -> Result<()> {
        let s = &e.system;
        let regions = s.subsystems().iter().map(|sub| match &sub.regions {
            Regions::Signs { psi, .. } => psi,
            Regions::Indicators(g) => g,
        });
        let dynamics = s.f0().into_iter().chain(s.subsystems().iter().map(|sub| &sub.modes)).chain(regions);
        let costs = e.lagrange.iter().chain(&e.mayer).chain(&e.grid_cost);
        let rows = e.path.iter().map(|c| &c.f).chain(e.terminal.iter().map(|c| &c.f));
        let rows = rows.chain(e.complementarity.iter().map(|c| &c.f));
        let all: Vec<_> = dynamics.chain(costs).chain(rows).chain(e.boundary.iter().map(|c| &c.f)).collect();
        for (j, _) in self.free_params().iter().enumerate().filter(|f| *f.1) {
            let column = |f: &SharedFunction| f.dims().x + f.dims().u + j;
            if !all.iter().any(|f| !f.jac_pattern().rows(column(f)).is_empty()) {
                return Err(Error::Unsupported(format!(
                    "parameter {j} is free, but no function has a derivative with respect to it: declare the pattern \
                     of the Jacobian of those that depend on it"
                )));
            }
        }
        Ok(())
    }

    /// Elements of every stage.
    pub(super) fn elements(&self) -> Vec<usize> {
        if self.n_fe.is_empty() {
            vec![self.settings.n_fe as usize; self.n_stages]
        } else {
            self.n_fe.clone()
        }
    }

    /// Solves. `Err` when the problem cannot be stated; how the solver ended is in the result.
    pub fn solve(&mut self, control: &mut Control) -> Result<&OcpResult> {
        self.solve_from(Start::Cold, control)
    }

    /// Solves from the last solution: after small changes of bounds, initial state, parameters or references the active
    /// set is tried first, and the homotopy only where that fails. Without a solution as [`Ocp::solve`].
    pub fn solve_warm(&mut self, control: &mut Control) -> Result<&OcpResult> {
        let start = if self.built.is_some() && self.result.is_some() { Start::Warm } else { Start::Cold };
        self.solve_from(start, control)
    }

    fn solve_from(&mut self, start: Start, control: &mut Control) -> Result<&OcpResult> {
        if self.settings.adapt_tol > 0.0 {
            self.adapt(start, control)
        } else {
            self.run(start, control)
        }
    }

    /// Makes the last solution, one control stage later, the guess of the next solve; the last stage is repeated.
    pub fn shift(&mut self) -> Result<()> {
        let r =
            self.result.as_ref().ok_or_else(|| Error::State("there is no solution to shift: solve first".into()))?;
        let nu = self.system.dims().u;
        let mut u = r.controls[nu..].to_vec();
        u.extend_from_slice(&r.control_ends[(self.n_stages - 1) * nu..]);
        let from = self.t0 + r.durations[0];
        let (mut times, mut x) = (Vec::new(), Vec::new());
        for e in r.trajectory.elements.iter().filter(|e| e.stage > 0) {
            if times.last().is_none_or(|t| e.t - from > *t) {
                times.push(e.t - from);
                x.extend_from_slice(&e.x0);
            }
        }
        if let Some(e) = r.trajectory.elements.last().filter(|_| !times.is_empty()) {
            if e.h > 1e-12 {
                times.push(e.t + e.h - from);
                x.extend_from_slice(&e.x1);
            }
        }
        if self.n_stages > 1 {
            self.set_x_guess(&times, &x)?;
        }
        self.set_u_guess(&u)
    }

    pub(super) fn run(&mut self, start: Start, control: &mut Control) -> Result<&OcpResult> {
        let time_build = self.build()?;
        let given = match (&self.built, &self.modes) {
            (Some(b), Some(m)) if start != Start::Warm && b.problem.detects_switches() => {
                Some(m.on_grid(b.problem.spec().dcs.form(), &self.durations, &b.identifier.grid.n_fe)?)
            }
            _ => None,
        };
        let Some(Built { mut problem, mut solver, mut bounds, mut identifier, mut extended }) = self.built.take()
        else {
            return Err(Error::Internal("the problem was not built".into()));
        };
        let stage_params = self.prepare(&mut problem, &mut bounds, &mut identifier, &mut extended)?;
        let budget = self.settings.mode_search as usize;
        let has_modes = given.is_some();
        let improves = start == Start::Carried || (start == Start::Cold && !has_modes);
        identifier.restart(improves || budget > 0, budget);
        solver.settings = MpccSettings::from(&self.settings);
        control.limit(self.settings.max_time);
        problem.forget_trouble();
        let usual = problem.usual_exit();
        let (mut before, mut near) = (Statistics::default(), false);
        if start == Start::Cold && !has_modes && !problem.relaxes_well() && self.settings.polish() {
            let (found, cost) = self.with_stand_in(&problem, control)?;
            before.add(&cost);
            if let Some((other, mut x)) = found {
                // a function without a value leaves them at zero, and the solve says so
                let _ = problem.write_members(&mut x);
                // neighbours were searched already
                identifier.restart(false, 0);
                near = [usual, usual.other()].into_iter().any(|exit| {
                    problem.set_exit(exit);
                    let suggest = &mut |k: Wanted, w: &[f64], s: &mut [Side]| identifier.suggest(k, w, s);
                    let ok = solver.solve_near(&mut problem, &bounds, &other, &x, control, suggest);
                    if !ok {
                        before.add(&solver.solution().stats);
                    }
                    ok
                });
                if !near {
                    identifier.restart(true, budget);
                }
            }
        }
        if !near {
            problem.set_exit(usual);
        }
        if start == Start::Warm {
            let s = solver.solution();
            let (x, y, z) = (s.x.clone(), s.y.clone(), s.z.clone());
            solver.solve_warm(&mut problem, &bounds, &Warm { x: &x, y: &y, z: &z }, control, &mut |k, w, s| {
                identifier.suggest(k, w, s)
            });
        } else if !near {
            let (w0, guess) = self.starting_point(&mut problem, &extended, &stage_params, control)?;
            let mut spent = None;
            if let Some((mut sides, lengths)) = given {
                let mut w = w0.clone();
                problem.guess_active_set(&mut w, self.t0, &lengths, &sides, |t, x| guess.state(t, x));
                sides.extend(problem.member_sides(&w0));
                if !solver
                    .solve_sides(&mut problem, &bounds, &sides, &w, control, &mut |k, w, s| identifier.suggest(k, w, s))
                {
                    spent = Some(solver.solution().stats);
                    identifier.restart(true, budget);
                }
            }
            if !has_modes || spent.is_some() {
                solver.solve_with(&mut problem, &bounds, &w0, control, &mut |k, w, s| identifier.suggest(k, w, s));
                solver.add_cost(&spent.unwrap_or_default());
            }
        }
        let found = solver.solution();
        if found.polish == Polish::Rejected && found.outcome == Outcome::Solved {
            problem.set_exit(usual.other());
            if !solver.polish_again(&mut problem, &bounds, control, &mut |k, w, s| identifier.suggest(k, w, s)) {
                problem.set_exit(usual);
                solver.rescue(&mut problem, &bounds, control, &mut |k, w, s| identifier.suggest(k, w, s));
            }
        }
        let mut result = self.read(&mut problem, solver.solution(), &extended, &stage_params);
        result.time_build = time_build;
        result.stats.add(&before);
        if self.settings.accuracy != 0 && result.outcome != Outcome::Stopped {
            result.accuracy = Some(self.measure(&result, &problem, &solver.solution().x, &extended, &stage_params)?);
        }
        let w = &solver.solution().x;
        let mut case = Case { result: &result, problem: &mut problem, bounds: &bounds, w, system: &extended.system };
        let message = self.diagnose(&mut case, control);
        result.message = message;
        self.built = Some(Built { problem, solver, bounds, identifier, extended });
        Ok(self.result.insert(result))
    }

    /// Writes the data of this solve into what was built; returns the parameters of every stage.
    pub(super) fn prepare(
        &self,
        problem: &mut Fesd,
        bounds: &mut Bounds,
        identifier: &mut Identifier,
        e: &mut Extended,
    ) -> Result<Vec<f64>> {
        let stage_params = self.extended_params(e);
        self.write_data(problem, bounds, e, &stage_params)?;
        identifier.durations.clone_from(&self.durations);
        identifier.n_p = e.system.dims().p;
        identifier.params.clone_from(&stage_params);
        e.params.clone_from(&stage_params);
        identifier.t0 = self.t0;
        identifier.detects = problem.detects_switches();
        identifier.fixed = self.time == Durations::Fixed && !problem.param_places().iter().any(Option::is_some);
        Ok(stage_params)
    }

    /// Parameters of every stage with references and slacks behind the user's.
    fn extended_params(&self, e: &Extended) -> Vec<f64> {
        let (np, wide) = (self.params.len(), e.system.dims().p);
        let mut all = vec![SLACK; self.n_stages * wide];
        for (k, p) in all.chunks_mut(wide.max(1)).enumerate().take(if wide == 0 { 0 } else { self.n_stages }) {
            let own = self.stage_params.as_ref().map_or(&self.params[..], |s| &s[k * np..(k + 1) * np]);
            p[..np].copy_from_slice(own);
            for (q, &at) in self.squares.iter().zip(&e.references) {
                let n = q.f.n_out();
                let from = if q.references.len() > n { k * n } else { 0 };
                p[at..at + n].copy_from_slice(&q.references[from..from + n]);
            }
        }
        all
    }

    /// Hands parameters, lengths and bounds to the discretised problem.
    pub(super) fn write_data(
        &self,
        problem: &mut Fesd,
        bounds: &mut Bounds,
        e: &Extended,
        stage_params: &[f64],
    ) -> Result<()> {
        let wide = e.system.dims();
        problem.set_params(&stage_params[..wide.p])?;
        for k in 0..if wide.p == 0 { 0 } else { self.n_stages } {
            problem.set_stage_params(k, &stage_params[k * wide.p..(k + 1) * wide.p])?;
        }
        problem.set_durations(&self.durations)?;
        problem.write_durations(bounds);
        let n_lengths = if self.time == Durations::Horizon { 1 } else { self.n_stages };
        for k in 0..n_lengths {
            problem.bound_duration(bounds, k, self.time_bounds[0], self.time_bounds[1]);
        }
        problem.bound_states(bounds, &self.x_bounds[0], &self.x_bounds[1]);
        problem.bound_initial(bounds, &self.x0_bounds[0], &self.x0_bounds[1], self.t0);
        let more = wide.u - self.u_bounds[0].len();
        let lower = [&self.u_bounds[0][..], &vec![0.0; more]].concat();
        let upper = [&self.u_bounds[1][..], &vec![f64::INFINITY; more]].concat();
        for k in 0..self.n_stages {
            problem.bound_control(bounds, k, &lower, &upper);
        }
        if let Some([lower, upper]) = &self.p_bounds {
            for (j, (l, u)) in lower.iter().zip(upper).enumerate() {
                problem.bound_param(bounds, j, *l, *u);
            }
        }
        for j in e.slack_params.clone() {
            problem.bound_param(bounds, j, 0.0, f64::INFINITY);
        }
        bounds.validate(problem.n(), problem.m())
    }

    /// The solution in the user's terms.
    pub(super) fn read(&self, problem: &mut Fesd, s: &Solution, e: &Extended, stage_params: &[f64]) -> OcpResult {
        let d = self.system.dims();
        let mut trajectory = Trajectory::new(&problem.spec().dcs, problem.tableau());
        let sides = (s.polish == Polish::Done).then_some(&s.sides[..]);
        trajectory.append(problem, &s.x, sides, self.t0);
        let wide = e.system.dims().u;
        let own = |all: &[f64]| -> Vec<f64> {
            (0..self.n_stages).flat_map(|k| all[k * wide..k * wide + d.u].iter().copied()).collect()
        };
        let (controls, ends) = (problem.controls(&s.x), problem.control_ends(&s.x));
        let durations = problem.stage_lengths(&s.x);
        let params = problem.params_at(&s.x);
        let (mut violation, mut penalty) = (0f64, 0.0);
        for (soft, at) in self.soft.iter().zip(&e.slacks) {
            let mut take = |slacks: &[f64], duration: f64| {
                violation = slacks.iter().fold(violation, |m, v| m.max(*v));
                penalty += soft.penalty(slacks, duration);
            };
            match at {
                Slacks::Params(r) => take(&params[r.clone()], 1.0),
                Slacks::Controls(r) => {
                    for (u, h) in controls.chunks_exact(wide).zip(&durations) {
                        take(&u[r.clone()], *h);
                    }
                }
            }
        }
        let user_params = if self.stage_params.is_some() { &stage_params[..d.p] } else { &params[..d.p] };
        OcpResult {
            outcome: s.outcome,
            polish: s.polish,
            message: String::new(),
            cost: problem.cost(&s.x).map_or(f64::NAN, |c| c - penalty),
            control_ends: if self.linear.contains(&true) { own(&ends) } else { own(&controls) },
            controls: own(&controls),
            durations,
            params: user_params.to_vec(),
            violation,
            trajectory,
            residuals: s.residuals,
            certificate: s.certificate,
            stats: s.stats,
            time_build: 0.0,
            dimensions: (problem.n(), problem.m(), problem.pairs().len()),
            accuracy: None,
            adaptation: None,
        }
    }

    /// Compares an answer with the simulation of its controls.
    pub(super) fn measure(
        &mut self,
        r: &OcpResult,
        problem: &Fesd,
        w: &[f64],
        e: &Extended,
        stage_params: &[f64],
    ) -> Result<Accuracy> {
        let tol = self.settings.accuracy_tol;
        let (mut engine, tol) = match self.engine.take() {
            Some((e, t)) if t == tol => (e, t),
            _ => (Replay::new(&e.system, e.lagrange.as_ref(), &self.linear, &self.settings)?, tol),
        };
        let elements = &r.trajectory.elements;
        let ends = elements.iter().enumerate().filter(|(k, e)| {
            let next = elements.get(k + 1);
            next.is_none_or(|next| next.stage != e.stage)
        });
        let states: Vec<f64> = ends.flat_map(|(_, e)| e.x1.iter().copied()).collect();
        let mut params = stage_params.to_vec();
        let np = e.system.dims().p;
        for (j, at) in problem.param_places().iter().enumerate() {
            if let Some(v) = *at {
                (0..self.n_stages).for_each(|k| params[k * np + j] = w[v]);
            }
        }
        let total = r.cost + self.penalty(problem, w, e, &r.durations);
        let answer = Answer {
            t0: self.t0,
            x0: &elements[0].x0,
            durations: &r.durations,
            controls: &problem.controls(w),
            control_ends: &problem.control_ends(w),
            linear: &self.linear,
            params: &params,
            states: &states,
            cost: total,
            mayer: e.mayer.as_ref(),
            grid_cost: e.grid_cost.as_ref(),
            terminal: e.terminal.iter().map(|t| (&t.f, &t.lower[..], &t.upper[..])).collect(),
        };
        let mut found = accuracy::measure(&mut engine, &answer)?;
        found.cost -= total - r.cost;
        if self.settings.adapt_tol > 0.0 {
            found.local = answer
                .by_stage()
                .iter()
                .map(|a| Ok(accuracy::measure(&mut engine, a)?.terminal))
                .collect::<Result<_>>()?;
        }
        self.engine = Some((engine, tol));
        Ok(found)
    }

    /// What the violation of relaxed constraints costs at a point.
    fn penalty(&self, problem: &Fesd, w: &[f64], e: &Extended, durations: &[f64]) -> f64 {
        let (controls, params) = (problem.controls(w), problem.params_at(w));
        let wide = e.system.dims().u.max(1);
        let of = |(soft, at): (&super::extend::Soft, &Slacks)| -> f64 {
            match at {
                Slacks::Params(r) => soft.penalty(&params[r.clone()], 1.0),
                Slacks::Controls(r) => {
                    controls.chunks_exact(wide).zip(durations).map(|(u, h)| soft.penalty(&u[r.clone()], *h)).sum()
                }
            }
        };
        self.soft.iter().zip(&e.slacks).map(of).sum()
    }
}
