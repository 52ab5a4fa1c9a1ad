//! Problems of several phases: each with its own system, horizon, costs and constraints, linked by constraints between the
//! end of one and the start of the next. All phases are discretised, and solved as one program. Where events alone follow one of them, all are
//! simulated, see [`simulated`](super::simulated).

use std::time::Instant;

use super::diagnosis::Case;
use super::joint::{self, Link, Plan, Program};
use super::request::{Comparison, Request};
use super::simulated::Task;
use super::solve::{Built, Start};
use super::terms::Stack;
use super::{check_bounds, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::func::Dims;
use crate::memory;
use crate::mpcc::{MpccSolver, Polish, Solution};
use crate::nlp::{Bounds, Control, Nlp, Outcome, Residuals, Statistics};
use crate::settings::Settings;
use crate::sim::SolveOptions;
use crate::system::{combination, SharedFunction};

/// Violations of links worth a word.
const VIOLATED: f64 = 1e-6;

/// Result of a solve of several phases.
#[derive(Debug, Clone)]
pub struct MultiPhaseResult {
    /// How it ended.
    pub outcome: Outcome,
    /// Outcome of the polish, which identifies the active set of all phases and solves the problem with it.
    pub polish: Polish,
    /// Why it is no exact solution, in the words of the model; empty where there is nothing to say.
    pub message: String,
    /// Sum of the costs of the phases.
    pub cost: f64,
    /// Results of the phases; outcome, residuals and statistics are those of all.
    pub phases: Vec<OcpResult>,
    /// Largest violation of a link.
    pub link_violation: f64,
    /// Largest difference of a state at the end of a phase from the simulation of its controls; NaN without one.
    pub error: f64,
    /// Residuals at the end.
    pub residuals: Residuals,
    /// Work and time of the solve.
    pub stats: Statistics,
    /// Variables, rows, complementarity pairs.
    pub dimensions: (usize, usize, usize),
}

/// Phases one after the other.
pub struct MultiPhase {
    pub(super) phases: Vec<Ocp>,
    /// Between phase `k` and the next.
    links: Vec<Vec<Link>>,
    pub(super) settings: Settings,
    joint: Option<Joint>,
    result: Option<MultiPhaseResult>,
}

struct Joint {
    plan: Plan,
    solver: MpccSolver,
}

impl MultiPhase {
    /// Phases in their order. Their initial states are tied to nothing but their own bounds until they are linked.
    pub fn new(phases: Vec<Ocp>) -> Result<MultiPhase> {
        let Some(first) = phases.first() else {
            return Err(Error::Dimension("a problem of several phases needs one at least".into()));
        };
        let settings = first.settings;
        let links = (1..phases.len()).map(|_| Vec::new()).collect();
        Ok(MultiPhase { phases, links, settings, joint: None, result: None })
    }

    /// Number of phases.
    pub fn n_phases(&self) -> usize {
        self.phases.len()
    }

    /// A phase, to be changed before the next solve.
    pub fn phase_mut(&mut self, k: usize) -> Result<&mut Ocp> {
        let n = self.phases.len();
        self.phases.get_mut(k).ok_or_else(|| Error::Range(format!("phase {k} of {n}")))
    }

    /// Sizes of the functions that link phase `k` to the next: the states at its end, then those at the start of the next.
    pub fn link_dims(&self, k: usize) -> Result<Dims> {
        if k + 1 >= self.phases.len() {
            return Err(Error::Range(format!("there is no phase behind phase {k} of {}", self.phases.len())));
        }
        let nx = |k: usize| self.phases[k].system.dims().x;
        Ok(Dims { x: nx(k) + nx(k + 1), u: 0, p: 0 })
    }

    /// Requires `lower ≤ f(x_k(T), x_{k+1}(0)) ≤ upper`: `f` sees the states at the end of phase `k`, then those at the
    /// start of the next, no controls, no parameters, and zero as the time.
    pub fn link(&mut self, k: usize, f: SharedFunction, lower: &[f64], upper: &[f64]) -> Result<()> {
        let d = self.link_dims(k)?;
        if f.dims() != d {
            return Err(Error::Dimension(format!(
                "function '{}' links phases {k} and {}: it takes (x, u, p) of sizes ({}, {}, {}), expected ({}, 0, 0)",
                f.name(),
                k + 1,
                f.dims().x,
                f.dims().u,
                f.dims().p,
                d.x
            )));
        }
        check_bounds("link", lower, upper, f.n_out())?;
        self.add_link(k, Link { f, lower: lower.to_vec(), upper: upper.to_vec(), start: None });
        Ok(())
    }

    fn add_link(&mut self, k: usize, link: Link) {
        self.links[k].push(link);
        self.joint = None;
    }

    /// The next phase begins where phase `k` ends, in all states.
    pub fn link_continuous(&mut self, k: usize) -> Result<()> {
        let d = self.link_dims(k)?;
        let nx = self.phases[k].system.dims().x;
        if d.x != 2 * nx {
            return Err(Error::Dimension(format!(
                "phases {k} and {} have {nx} and {} states: link them by a function",
                k + 1,
                d.x - nx
            )));
        }
        let f = combination("continuity", d, (0..nx).map(|i| vec![(i, -1.0), (nx + i, 1.0)]).collect());
        let same = combination("continuity", Dims { x: nx, u: 0, p: 0 }, (0..nx).map(|i| vec![(i, 1.0)]).collect());
        let zeros = vec![0.0; nx];
        self.add_link(k, Link { f, lower: zeros.clone(), upper: zeros, start: Some(same) });
        Ok(())
    }

    /// The next phase begins at `r(x_k(T))`: a reset map of the states at the end of phase `k`, with as many outputs as the next phase has
    /// states, without controls, parameters and time. What a stage that drops off, a docking or a planned impact does to the states.
    pub fn link_reset(&mut self, k: usize, r: SharedFunction) -> Result<()> {
        let d = self.link_dims(k)?;
        let nx = self.phases[k].system.dims().x;
        let next = d.x - nx;
        if r.dims() != (Dims { x: nx, u: 0, p: 0 }) || r.n_out() != next {
            let (name, given, n) = (r.name(), r.dims(), r.n_out());
            return Err(Error::Dimension(format!(
                "the reset map '{name}' behind phase {k} has {n} outputs of inputs {given:?}, expected {next} of the {nx} states of the \
                 phase alone"
            )));
        }
        let behind = Stack::gather(&r, d, (0..nx).chain([d.t_col()]).collect());
        let start = combination("start", d, (0..next).map(|i| vec![(nx + i, -1.0)]).collect());
        let zeros = vec![0.0; next];
        let f = Stack::sum("reset", d, vec![behind, start]);
        self.add_link(k, Link { f, lower: zeros.clone(), upper: zeros, start: Some(r) });
        Ok(())
    }

    /// The result of the last solve.
    pub fn result(&self) -> Option<&MultiPhaseResult> {
        self.result.as_ref()
    }

    /// The settings of the solver: those of the first phase until they are set. Discretisation options count by phase.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes the settings of the solver.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<()> {
        settings.validate()?;
        if settings.validate_as_update(&self.settings).is_err() {
            self.joint = None;
        }
        self.settings = *settings;
        Ok(())
    }

    /// Solves. `Err` when a phase cannot be stated; how the solver ended is in the result.
    pub fn solve(&mut self, control: &mut Control) -> Result<&MultiPhaseResult> {
        // what was built is gone where this unwinds, and is built again by the next solve
        let seconds = self.settings.max_time;
        memory::bounded(self.settings.max_memory, || {
            control.within(seconds, |control| self.solve_within(control).map(|_| ()))
        })?;
        self.result.as_ref().ok_or_else(|| Error::Internal("a solve without a result".into()))
    }

    fn solve_within(&mut self, control: &mut Control) -> Result<&MultiPhaseResult> {
        let clock = Instant::now();
        self.phases.iter_mut().try_for_each(Ocp::complete_params)?;
        let request = Request { explain: false, ..Request::from_settings(&self.settings)? };
        self.phases.iter_mut().for_each(|p| p.chosen = None);
        let choices = self.phases.iter().any(|p| !p.system.choices().is_empty());
        let mut r = if choices { self.solve_choices(&request, control)? } else { self.solve_fixed(&request, control)? };
        r.stats.time_total = clock.elapsed().as_secs_f64();
        Ok(self.result.insert(r))
    }

    /// The same problem, nothing built and nothing solved.
    pub(super) fn blank(&self) -> MultiPhase {
        let phases = self.phases.iter().map(Ocp::blank).collect();
        MultiPhase { phases, links: self.links.clone(), settings: self.settings, joint: None, result: None }
    }

    /// Solves with the choices that are made.
    pub(super) fn solve_fixed(&mut self, request: &Request, control: &mut Control) -> Result<MultiPhaseResult> {
        if self.phases.iter().any(|p| p.is_simulated() || p.is_scene()) {
            return self.solve_simulated(request, control);
        }
        for p in &mut self.phases {
            let before = p.builds;
            p.build(Start::Cold, &SolveOptions::from_settings(&p.settings)?)?;
            if p.builds != before {
                // what is built with it is used again as long as nothing of the structure changes
                self.joint = None;
            }
        }
        self.place_in_time();
        let mut built = Vec::with_capacity(self.phases.len());
        for p in &mut self.phases {
            built.push(p.built.take().ok_or_else(|| Error::Internal("a phase was not built".into()))?);
        }
        // the parts are handed out, and come back whatever happens
        let mut joint = self.joint.take();
        let r = self.solve_built(&mut built, &mut joint, request, control);
        self.joint = joint;
        for (p, b) in self.phases.iter_mut().zip(built) {
            p.built = Some(b);
        }
        r
    }

    /// Nominal times at which the phases begin.
    fn place_in_time(&mut self) {
        let mut t = self.phases[0].t0;
        for p in &mut self.phases {
            p.t0 = t;
            t += p.durations.iter().sum::<f64>();
        }
    }

    /// Solves by shooting, where finite elements do not follow a phase.
    fn solve_simulated(&mut self, request: &Request, control: &mut Control) -> Result<MultiPhaseResult> {
        self.place_in_time();
        self.phases.iter().try_for_each(Ocp::check_simulated)?;
        let bases = self.phases.iter().map(|p| p.base(None)).collect::<Result<Vec<_>>>()?;
        let mut task =
            Task { ocps: self.phases.iter_mut().collect(), links: &self.links, settings: &self.settings, effort: 1.0 };
        let found = task.solve(bases, None, request, control)?;
        let mut messages: Vec<String> = Some(found.missed).filter(|m| !m.is_empty()).into_iter().collect();
        let error = |worst: f64, r: &OcpResult| match &r.accuracy {
            Some(a) if !worst.is_nan() && !a.terminal.is_nan() => worst.max(a.terminal),
            _ => f64::NAN,
        };
        let own = found.results.iter().enumerate().filter(|(_, r)| !r.message.is_empty());
        messages.extend(own.map(|(k, r)| format!("phase {k}: {}", r.message)));
        for (p, r) in self.phases.iter_mut().zip(&found.results) {
            p.result = Some(r.clone());
        }
        let last = found.results.last().ok_or_else(|| Error::Internal("phases without results".into()))?;
        Ok(MultiPhaseResult {
            outcome: last.outcome,
            polish: last.polish,
            message: messages.join("; "),
            cost: found.results.iter().map(|r| r.cost).sum(),
            link_violation: found.link_violation,
            error: found.results.iter().fold(0.0, error),
            residuals: last.residuals,
            stats: last.stats,
            dimensions: last.dimensions,
            phases: found.results,
        })
    }

    fn solve_built(
        &mut self,
        built: &mut [Box<Built>],
        joint: &mut Option<Joint>,
        request: &Request,
        control: &mut Control,
    ) -> Result<MultiPhaseResult> {
        let mut params = Vec::new();
        for (p, b) in self.phases.iter().zip(built.iter_mut()) {
            params.push(p.prepare(b)?);
            if p.switches() {
                b.set_sizes(&p.sizes()?);
            }
            b.identifier.restart(true, request.search);
            b.problem.forget_trouble();
            let exit = b.problem.usual_exit();
            b.problem.set_exit(exit);
        }
        let Joint { plan, solver } = match joint {
            Some(j) => j,
            None => {
                let mut plan = Plan::new(&self.links, built);
                let mut all = Program { parts: built.iter_mut().map(|b| &mut b.problem).collect(), plan: &mut plan };
                let solver = MpccSolver::new(&mut all, request.options.solver)?;
                joint.insert(Joint { plan, solver })
            }
        };
        let bounds = plan.bounds(built, self.phases[0].t0);
        let start = self.starting_point(plan, built, &params, &request.options, control)?;
        solver.settings = request.options.solver;
        joint::solve(plan, solver, built, &bounds, &start, control);
        let mut all = Program { parts: built.iter_mut().map(|b| &mut b.problem).collect(), plan };
        let dimensions = (all.n(), all.m(), all.plan.pairs.len());
        let mut c = vec![f64::NAN; all.m()];
        let evaluated = all.eval(&solver.solution().x, &mut c).is_ok();
        let s = solver.solution().clone();
        let mut r = MultiPhaseResult {
            outcome: s.outcome,
            polish: s.polish,
            message: String::new(),
            cost: 0.0,
            phases: Vec::new(),
            link_violation: if evaluated { worst_link(plan, &bounds, &c).1 } else { f64::NAN },
            error: 0.0,
            residuals: s.residuals,
            stats: s.stats,
            dimensions,
        };
        let worst = worst_link(plan, &bounds, &c);
        self.read_phases(&mut r, plan, &s, built, &params, request, control)?;
        if r.outcome != Outcome::Solved && worst.1 > VIOLATED {
            let more = if r.message.is_empty() { "" } else { "; " };
            r.message = format!("{}{more}{}", r.message, self.name_of_link(plan, worst));
        }
        Ok(r)
    }

    /// Results, accuracies and messages of the phases.
    #[allow(clippy::too_many_arguments)]
    fn read_phases(
        &mut self,
        r: &mut MultiPhaseResult,
        plan: &Plan,
        s: &Solution,
        built: &mut [Box<Built>],
        params: &[Vec<f64>],
        request: &Request,
        control: &Control,
    ) -> Result<()> {
        let mut t0 = self.phases[0].t0;
        let mut messages = Vec::new();
        for (k, (p, b)) in self.phases.iter_mut().zip(built.iter_mut()).enumerate() {
            let own = Solution {
                x: s.x[plan.variables[k]..plan.variables[k + 1]].to_vec(),
                sides: s.sides[plan.groups[k]..plan.groups[k + 1]].to_vec(),
                ..s.clone()
            };
            p.t0 = t0;
            let mut found = p.read(&mut b.problem, &own, &b.extended, &params[k]);
            t0 += found.durations.iter().sum::<f64>();
            if request.comparison.is_some() {
                let options = SolveOptions::from_settings(&p.settings)?;
                let c = Comparison { tol: p.settings.accuracy_tol, by_stage: false };
                let a = p.compare(&found, &b.problem, &own.x, &b.extended, &params[k], c, &options)?;
                r.error = if a.terminal.is_nan() { a.terminal } else { r.error.max(a.terminal) };
                found.accuracy = Some(a);
            } else {
                r.error = f64::NAN;
            }
            // constraints of a phase alone say little: the links take part
            let (bounds, system) = (&b.bounds, &b.extended.system);
            let mut case = Case { result: &found, problem: &mut b.problem, bounds, w: &own.x, system, cut: None };
            let diagnosis = p.diagnose(&mut case, request, control);
            found.take(diagnosis);
            if !found.message.is_empty() {
                messages.push(format!("phase {k}: {}", found.message));
            }
            r.cost += found.cost;
            r.phases.push(found);
        }
        for (p, found) in self.phases.iter_mut().zip(&r.phases) {
            p.result = Some(found.clone());
        }
        r.message = messages.join("; ");
        Ok(())
    }

    /// A row of a link in words.
    fn name_of_link(&self, plan: &Plan, (row, by): (usize, f64)) -> String {
        let numbered = self.links.iter().enumerate().flat_map(|(k, list)| (0..list.len()).map(move |j| (k, j)));
        for ((phase, j), l) in numbered.zip(&plan.links) {
            let f = &l.link.f;
            if (l.row..l.row + f.n_out()).contains(&row) {
                let (name, row) = (f.name(), row - l.row);
                return format!("link {j} ('{name}') behind phase {phase}, row {row}, is violated by {by:.3e}");
            }
        }
        format!("a phase does not begin where the one before it ends, by {by:.3e} in time")
    }

    /// Starting points of the phases; where nothing is known of the start of one it is the end of that before.
    fn starting_point(
        &mut self,
        plan: &Plan,
        built: &mut [Box<Built>],
        params: &[Vec<f64>],
        options: &SolveOptions,
        control: &mut Control,
    ) -> Result<Vec<f64>> {
        let mut w = Vec::with_capacity(plan.n());
        let mut end: Vec<f64> = Vec::new();
        for ((p, b), params) in self.phases.iter_mut().zip(built.iter_mut()).zip(params) {
            let nx = p.system.dims().x;
            let open = p.x0_bounds.iter().flatten().all(|v| v.is_infinite());
            let chained = open && p.x_guess.is_none() && end.len() == nx;
            if chained {
                p.x_guess = Some((vec![0.0], end));
            }
            let own = p.starting_point(&mut b.problem, &b.extended, params, options, control).map(|s| s.0);
            if chained {
                p.x_guess = None;
            }
            let own = own?;
            let at = b.problem.end_place();
            end = own[at..at + nx].to_vec();
            w.extend_from_slice(&own);
        }
        Ok(w)
    }
}

/// The row of a link, or of the start of a phase, that is violated most, and by how much.
fn worst_link(plan: &Plan, bounds: &Bounds, c: &[f64]) -> (usize, f64) {
    let first = plan.rows[plan.rows.len() - 1];
    let violation = |i: usize| (bounds.cl[i] - c[i]).max(c[i] - bounds.cu[i]).max(0.0);
    (first..plan.m).map(|i| (i, violation(i))).fold((first, 0.0), |a, b| if b.1 > a.1 { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::Callback;
    use crate::linalg::csc::Pattern;
    use crate::ocp::Durations;
    use crate::system::System;
    use std::sync::Arc;

    /// `x' = u x t`, with free stages; the next phase knows the time and has two states.
    fn phases() -> MultiPhase {
        let phase = |nx: usize, what: Durations| {
            let d = Dims { x: nx, u: 1, p: 0 };
            let f = Callback::new("f", d, nx, move |at, o| {
                o.iter_mut().zip(at.x).for_each(|(o, x)| *o = at.u[0] * x * (1.0 + at.t * x));
                0
            });
            let f = f.with_jacobian_pattern(Pattern::dense(nx, d.n_in())).unwrap();
            let mut s = System::new(nx, 1, 0).unwrap();
            s.set_f0(Arc::new(f)).unwrap();
            let mut o = Ocp::new(&s, 1.0, 2, &Settings { n_fe: 2, ..Settings::default() }).unwrap();
            o.set_free_time(what, 0.1, 2.0).unwrap();
            o
        };
        let mut m = MultiPhase::new(vec![phase(1, Durations::Stages), phase(2, Durations::Horizon)]).unwrap();
        let d = m.link_dims(0).unwrap();
        let f = Callback::new("link", d, 2, |at, o| {
            o[0] = at.x[0] * at.x[1] - at.x[2] * at.x[2];
            o[1] = at.x[2] - 3.0 * at.x[0];
            0
        });
        m.link(0, Arc::new(f), &[0.0; 2], &[0.0; 2]).unwrap();
        m
    }

    #[test]
    fn derivatives_of_the_joint_program() {
        let mut m = phases();
        let options = SolveOptions::from_settings(&m.settings).unwrap();
        m.phases.iter_mut().for_each(|p| assert!(p.build(Start::Cold, &options).is_ok()));
        let mut built: Vec<Box<Built>> = m.phases.iter_mut().map(|p| p.built.take().unwrap()).collect();
        let mut plan = Plan::new(&m.links, &built);
        assert_eq!(plan.clocks.len(), 1);
        let mut p = Program { parts: built.iter_mut().map(|b| &mut b.problem).collect(), plan: &mut plan };
        let (n, rows) = (p.n(), p.m());
        let at: Vec<f64> = (0..n).map(|j| 0.5 + 0.3 * (j as f64).sin()).collect();
        let (mut c, mut grad) = (vec![0.0; rows], vec![0.0; n]);
        let mut jac = vec![0.0; p.jac_pattern().nnz()];
        p.eval(&at, &mut c).unwrap();
        p.derivatives(&at, &mut grad, &mut jac).unwrap();
        let (mut up, mut down) = (c.clone(), c.clone());
        let pattern = p.jac_pattern().clone();
        for j in 0..n {
            let mut w = at.clone();
            w[j] += 1e-6;
            p.eval(&w, &mut up).unwrap();
            w[j] -= 2e-6;
            p.eval(&w, &mut down).unwrap();
            let mut column = vec![0.0; rows];
            for k in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                column[pattern.row_idx()[k]] = jac[k];
            }
            for i in 0..rows {
                let slope = (up[i] - down[i]) / 2e-6;
                assert!((slope - column[i]).abs() < 1e-6, "row {i}, variable {j}: {slope} {}", column[i]);
            }
        }
    }
}
