//! Discretising and solving; answers in the user's terms.

use std::time::Instant;

use super::accuracy::{self, Accuracy, Answer, Replay};
use super::between::Rows;
use super::diagnosis::Case;
use super::extend::{Extended, Statement};
use super::identify::Identifier;
use super::neighbours::Grid;
use super::optimality::{Optimality, Verdict};
use super::portfolio::SEARCH;
use super::request::{Comparison, Request};
use super::{CostOf, Durations, Ocp, OcpResult, SLACK};
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::fesd::{Fesd, Sizes, Spec, Trajectory};
use crate::func::EvalError;
use crate::memory;
use crate::mpcc::{Distance, Mpcc, MpccSettings, MpccSolver, Polish, Side, Solution, Warm};
use crate::nlp::{allowance, Bounds, Control, Nlp, Outcome, Statistics};
use crate::settings::OcpStart;
use crate::sim::SolveOptions;
use crate::stop::{self, Why};
use crate::system::{Regions, SharedFunction};

/// The discretised problem, ready to be solved again and again.
pub(super) struct Built {
    pub problem: Fesd,
    pub solver: MpccSolver,
    pub bounds: Bounds,
    pub identifier: Identifier,
    pub extended: Extended,
    options: SolveOptions,
    /// What warm starts go on from: the last solution that did not fail for want of values.
    pub(super) last: Option<Solution>,
}

impl Built {
    /// Takes over options that leave the structure as it is.
    fn set_options(&mut self, options: &SolveOptions) {
        self.options = *options;
        self.solver.settings = options.solver;
        self.identifier.set_options(options);
        self.problem.set_rho_h(options.discretisation.rho_h);
    }

    /// Sets the sizes the solver measures by; references and slacks have the size 1.
    pub fn set_sizes(&mut self, sizes: &Sizes) {
        let d = self.extended.system.dims();
        let more = |own: &[f64], n: usize| own.iter().copied().chain(std::iter::repeat(1.0)).take(n).collect();
        self.problem.set_sizes(&Sizes { u: more(&sizes.u, d.u), p: more(&sizes.p, d.p), ..sizes.clone() });
    }

    /// Elements of every stage.
    pub fn n_fe(&self) -> &[usize] {
        &self.problem.spec().n_fe
    }
}

/// What a solve is given, ready for the discretised problem.
struct Prepared {
    /// Parameters of every stage, references and slacks included.
    stage_params: Vec<f64>,
    /// Sides and lengths of the elements of a mode sequence.
    modes: Option<(Vec<Side>, Vec<f64>)>,
}

/// Where a solve starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// From the guesses, along the homotopy.
    Cold,
    /// From guesses and modes that are an earlier solution on another grid.
    Carried,
    /// From the branch problem of the modes that were given, and nothing else.
    Branch,
    /// The same, where a descent on simulations ended.
    Lowest,
    /// The same, of a sequence next to one with a solution: given up where it is not solved soon.
    Near,
    /// From the last solution.
    Warm,
}

impl Start {
    /// Is a branch problem all that is to be solved?
    fn is_branch(self) -> bool {
        matches!(self, Start::Branch | Start::Lowest | Start::Near)
    }
}

/// Runs a call within the time and the iterations that are asked for. The limit of iterations that is set by default is one of every single
/// solve: what a search takes in all is not known beforehand.
pub(super) fn bounded<R>(request: &Request, control: &mut Control, body: impl FnOnce(&mut Control) -> R) -> R {
    let most = request.options.solver.max_iter;
    let most = if most == MpccSettings::default().max_iter { usize::MAX } else { most };
    allowance::within(most, || control.within(request.options.max_time, body))
}

/// What is known of an answer before it is reported.
pub(super) struct Before {
    /// What programs have taken that led to it.
    pub stats: Statistics,
    /// Why the search for it was cut, where it was.
    pub cut: Option<Why>,
    /// A simulation of its controls.
    pub accuracy: Option<Accuracy>,
}

impl Ocp {
    /// The problem with its own parameters and controls.
    pub(super) fn extended(&self) -> Result<Extended> {
        Extended::new(&Statement {
            system: &self.system,
            lagrange: self.lagrange.as_ref(),
            mayer: self.mayer.as_ref(),
            path: &self.path,
            terminal: &self.terminal,
            boundary: &self.boundary,
            squares: &self.squares,
            soft: &self.soft,
            complementarity: &self.complementarity,
        })
    }

    /// The problem as a simulation of its controls prices it: kinks of costs are parts of them, and the price of relaxed constraints is no part.
    pub(super) fn simulated_costs(&self) -> Result<Extended> {
        let lagrange = self.with_kinks(self.lagrange.as_ref(), CostOf::Running)?;
        let mayer = self.with_kinks(self.mayer.as_ref(), CostOf::Terminal)?;
        Extended::new(&Statement {
            system: &self.system,
            lagrange: lagrange.as_ref(),
            mayer: mayer.as_ref(),
            path: &[],
            terminal: &self.terminal,
            boundary: &[],
            squares: &self.squares,
            soft: &[],
            complementarity: &[],
        })
    }

    /// Discretises the problem unless that was done: with the same structure, and on the same grid. A warm start stays on
    /// the grid there is, which adaptation may have changed.
    pub(super) fn build(&mut self, start: Start, options: &SolveOptions) -> Result<f64> {
        self.system.check_without_contacts("this kind of optimal control problem")?;
        let n_fe = self.elements(options);
        let serves = |b: &Built| {
            b.options.fits(options)
                && (start == Start::Warm || b.n_fe() == n_fe && b.problem.spec().inside == self.inside)
        };
        if let Some(b) = self.built.as_mut().filter(|b| serves(b)) {
            b.set_options(options);
            return Ok(0.0);
        }
        if start == Start::Warm {
            // another grid
            self.inside.clear();
        }
        self.built = None;
        let clock = Instant::now();
        let extended = self.extended()?;
        self.check_free_params(&extended)?;
        let mut dcs = Dcs::new(&extended.system, options.form)?;
        let e = &extended;
        let outer = e.lagrange.iter().chain(&e.mayer).chain(&e.grid_cost).chain(e.path.iter().map(|p| &p.f));
        let outer = outer.chain(e.terminal.iter().map(|t| &t.f)).chain(e.boundary.iter().map(|b| &b.f));
        let outer = outer.chain(e.complementarity.iter().map(|c| &c.f));
        if outer.into_iter().any(|f| !f.jac_pattern().rows(f.dims().t_col()).is_empty()) {
            dcs.require_clock();
        }
        let d = e.system.dims();
        let mut linear = self.linear.clone();
        linear.resize(d.u, false);
        let mut free = self.free_params();
        free.resize(d.p, false);
        free[e.slack_params.clone()].fill(true);
        let spec = Spec {
            durations: self.time,
            linear,
            free_params: free,
            stage_params: self.stage_params.is_some(),
            lagrange: e.lagrange.clone(),
            mayer: e.mayer.clone(),
            grid_cost: e.grid_cost.clone(),
            path: e.path.clone(),
            terminal: e.terminal.clone(),
            boundary: e.boundary.clone(),
            complementarity: e.complementarity.clone(),
            inside: self.inside.clone(),
            ..Spec::new(dcs, options.discretisation, n_fe.clone())
        };
        let mut problem = Fesd::new(spec, self.durations[0])?;
        stop::check_building(problem.n())?;
        let solver = MpccSolver::new(&mut problem, options.solver)?;
        let bounds = problem.bounds();
        let mut identifier = Identifier::new(&extended.system, options);
        identifier.linear = self.linear.contains(&true);
        identifier.h_at = problem.lengths();
        identifier.n_sides = problem.n_element_groups();
        let spec = problem.spec();
        let form = spec.dcs.form();
        let sizes = form.groups().iter().map(|c| c.len()).collect();
        let across = form.groups_across(&spec.linear, spec.stage_params);
        identifier.grid = Grid { n_fe, sizes, across };
        (identifier.x0_at, identifier.u_at) = problem.places();
        self.built =
            Some(Box::new(Built { problem, solver, bounds, identifier, extended, options: *options, last: None }));
        self.builds += 1;
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

    /// Elements of every stage, as they were stated.
    pub(super) fn elements(&self, options: &SolveOptions) -> Vec<usize> {
        if self.n_fe.is_empty() {
            vec![options.n_fe; self.n_stages]
        } else {
            self.n_fe.clone()
        }
    }

    /// Solves. `Err` when the problem cannot be stated; how the solver ended is in the result. Earlier solves leave
    /// nothing behind that counts: the same problem gives the same bits.
    pub fn solve(&mut self, control: &mut Control) -> Result<&OcpResult> {
        self.solve_from(Start::Cold, control)
    }

    /// Solves from the last solution: after small changes of bounds, initial state, parameters or references the active
    /// set is tried first, and the homotopy only where that fails. Stays on the grid that adaptation has reached. Without a
    /// solution as [`Ocp::solve`]; a solve that failed for want of function values leaves the solution before.
    pub fn solve_warm(&mut self, control: &mut Control) -> Result<&OcpResult> {
        if self.is_scene() {
            return self.solve_scene(Start::Warm, control);
        }
        let options = SolveOptions::from_settings(&self.settings)?;
        let known = self.built.as_ref().is_some_and(|b| b.last.is_some() && b.options.fits(&options));
        let by_sequence = self.is_simulated() || !self.system.choices().is_empty();
        let known = known || ((by_sequence || self.simulated.leads) && self.result.is_some());
        self.solve_from(if known { Start::Warm } else { Start::Cold }, control)
    }

    /// Is it solved by orders of contacts?
    pub(super) fn is_scene(&self) -> bool {
        self.system.mechanics().is_some() && !self.is_simulated()
    }

    fn solve_from(&mut self, start: Start, control: &mut Control) -> Result<&OcpResult> {
        if self.is_scene() {
            return self.solve_scene(start, control);
        }
        let request = Request::from_settings(&self.settings)?;
        self.complete_params()?;
        let led = std::mem::take(&mut self.simulated.leads) && start == Start::Warm;
        self.simulated.last = None;
        if start != Start::Warm {
            self.inside.clear();
            // where constraints are violated in a simulation must not depend on the answer that its tolerances were made for
            self.engine = self.engine.take().filter(|_| self.path.is_empty());
        }
        // what was built is gone where this unwinds, and is built again by the next solve
        memory::bounded(self.settings.max_memory, || {
            bounded(&request, control, |control| {
                if !self.system.choices().is_empty() {
                    return self.solve_choices(start, &request, control);
                }
                self.chosen = None;
                if led {
                    return self.solve_simulated(start, &request, control);
                }
                self.solve_chosen(start, &request, control)
            })
        })?;
        self.conclude()
    }

    /// Solves where no choice is open, on one grid or several, and looks at what grids do not show.
    pub(super) fn solve_chosen(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<()> {
        if self.is_simulated() {
            return self.solve_simulated(start, request, control);
        }
        let adapts = self.settings.adapt_tol > 0.0;
        let solved = if adapts { self.adapt(start, request, control) } else { self.search(start, request, control) };
        solved.map(|_| ())?;
        self.follow_contacts(start, request, control)?;
        self.impose_between(request, control)?;
        self.better_by_simulations(request, control)
    }

    /// Where a program has no solution, or a descent on simulations leads from it to less, and no search goes on from there, the end of descents takes
    /// its place.
    fn better_by_simulations(&mut self, request: &Request, control: &mut Control) -> Result<()> {
        let none = |r: &OcpResult| matches!(r.outcome, Outcome::LocallyInfeasible | Outcome::Stalled);
        let is_bettered =
            |r: &OcpResult| none(r) || r.optimality.as_ref().is_some_and(|o| o.verdict == Verdict::NotOptimal);
        let asked = request.start != OcpStart::Homotopy && request.comparison.is_some();
        let may = asked && !self.has_search() && self.complementarity.is_empty();
        let Some(before) = self.result.clone().filter(|r| may && is_bettered(r)) else { return Ok(()) };
        let solved = self.solve_simulated(Start::Warm, request, control);
        let gained = |r: &OcpResult| r.is_exact() && (!before.is_exact() || r.priced < before.priced);
        let found = match solved {
            Ok(()) => self.result.take(),
            Err(Error::Interrupted | Error::OutOfTime | Error::Unsupported(_) | Error::Numeric(_)) => None,
            Err(e) => return Err(e),
        };
        let mut stats = before.stats;
        if let Some(r) = &found {
            stats.add(&r.stats);
            stats.time_total += r.stats.time_total;
        }
        // else the answer before stays one
        let better = found.filter(gained);
        if better.is_none() {
            (self.simulated.last, self.simulated.leads) = (None, false);
        }
        self.result = Some(OcpResult { stats, ..better.unwrap_or(before) });
        Ok(())
    }

    /// The result of a solve that is over, with the outcome that says so of a solution that is no whole success.
    pub(super) fn conclude(&mut self) -> Result<&OcpResult> {
        if let Some(r) = self.result.as_mut() {
            r.outcome = r.ended.unwrap_or(r.outcome);
        }
        self.last_result()
    }

    /// The result of a solve that has just ended without an error, which there always is.
    pub(super) fn last_result(&self) -> Result<&OcpResult> {
        self.result.as_ref().ok_or_else(|| Error::Internal("a solve without a result".into()))
    }

    /// One solve on one grid: discretises where that is due, prepares, solves, reports. What was built stays whatever
    /// happens, and after an error it is as before.
    pub(super) fn run(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<&OcpResult> {
        let time_build = self.build(start, &request.options)?;
        let Some(mut built) = self.built.take() else {
            return Err(Error::Internal("the problem was not built".into()));
        };
        built.solver.settings.max_iter = request.options.solver.max_iter.min(allowance::left());
        let result = self.run_built(&mut built, start, request, control);
        let broken = matches!(built.problem.trouble().map(|t| t.error), Some(EvalError::Fatal(_)));
        match &result {
            Ok(r) if r.outcome != Outcome::Failed && !broken => built.last = Some(built.solver.solution().clone()),
            Ok(_) => {}
            Err(_) => built.last.iter().for_each(|s| built.solver.restore(s)),
        }
        self.built = Some(built);
        let mut result = result?;
        result.time_build = time_build;
        Ok(self.result.insert(result))
    }

    fn run_built(
        &mut self,
        b: &mut Built,
        start: Start,
        request: &Request,
        control: &mut Control,
    ) -> Result<OcpResult> {
        let given = self.prepare_solve(b, start, request)?;
        // a solve that is compared and judged leaves time for both
        let share = if request.comparison.is_some() { SEARCH } else { 1.0 };
        let (before, cut) = control.sooner(share, |control| {
            let before = self.solve_discretised(b, &given, start, request, control);
            (before, stop::requested())
        });
        self.report(b, &given.stage_params, Before { stats: before?, cut, accuracy: None }, request, control)
    }

    /// Writes data and options into what was built.
    fn prepare_solve(&self, b: &mut Built, start: Start, request: &Request) -> Result<Prepared> {
        let modes = match &self.modes {
            Some(m) if start != Start::Warm && b.problem.detects_switches() => {
                Some(m.on_grid(b.problem.spec().dcs.form(), &self.durations, b.n_fe())?)
            }
            _ => None,
        };
        let stage_params = self.prepare(b)?;
        if request.start == OcpStart::Homotopy && self.x_guess.is_some() {
            // a trajectory that is given says more than sizes: the homotopy stays near it in the units it is given in
            b.problem.forget_sizes();
        } else if start != Start::Warm && self.switches() {
            b.set_sizes(&self.known_or_own_sizes()?);
        }
        let improves = match start {
            Start::Carried => true,
            Start::Near | Start::Branch | Start::Lowest => !request.plain_branches,
            Start::Cold => modes.is_none(),
            Start::Warm => false,
        };
        b.identifier.restart(improves || request.search > 0, request.search);
        if start != Start::Warm {
            b.problem.set_clearance(self.clearance.clone());
        }
        b.problem.forget_trouble();
        let usual = b.problem.usual_exit();
        b.problem.set_exit(usual);
        Ok(Prepared { stage_params, modes })
    }

    /// Solves from where `start` says; what was spent besides the last solve of the solver.
    fn solve_discretised(
        &self,
        b: &mut Built,
        given: &Prepared,
        start: Start,
        request: &Request,
        control: &mut Control,
    ) -> Result<Statistics> {
        let mut before = Statistics::default();
        if let (Start::Warm, Some(last)) = (start, &b.last) {
            let warm = Warm { x: &last.x, y: &last.y, z: &last.z };
            let Built { problem, solver, bounds, identifier, .. } = b;
            solver.solve_warm(problem, bounds, &warm, control, identifier);
        } else if start.is_branch() || !self.solve_by_stand_in(b, given, request, &mut before, control)? {
            self.solve_from_guesses(b, given, start, request, control)?;
        }
        let Built { problem, solver, bounds, identifier, .. } = b;
        let found = solver.solution();
        if !start.is_branch() && found.polish == Polish::Rejected && found.outcome == Outcome::Solved {
            let usual = problem.usual_exit();
            problem.set_exit(usual.other());
            if !solver.polish_again(problem, bounds, control, identifier) {
                problem.set_exit(usual);
                solver.rescue(problem, bounds, control, identifier);
            }
        }
        Ok(before)
    }

    /// The way of a method whose relaxed problems are not well posed: the solution with Radau IIA in its place leads to
    /// the branch problem. True when that has a solution; `spent` is what it took besides.
    fn solve_by_stand_in(
        &self,
        b: &mut Built,
        given: &Prepared,
        request: &Request,
        spent: &mut Statistics,
        control: &mut Control,
    ) -> Result<bool> {
        if given.modes.is_some() || b.problem.relaxes_well() || !request.options.solver.polish {
            return Ok(false);
        }
        let (found, cost) = self.with_stand_in(&b.problem, &request.options, control)?;
        spent.add(&cost);
        let Some((other, mut x)) = found else { return Ok(false) };
        let Built { problem, solver, bounds, identifier, .. } = b;
        // a function without a value leaves them at zero, and the solve says so
        let _ = problem.write_members(&mut x);
        // switches between control stages were moved off them already
        identifier.restart(request.search > 0, request.search);
        let usual = problem.usual_exit();
        let near = [usual, usual.other()].into_iter().any(|exit| {
            problem.set_exit(exit);
            let ok = solver.solve_near(problem, bounds, &other, &x, control, identifier);
            if !ok {
                spent.add(&solver.solution().stats);
            }
            ok
        });
        if !near {
            identifier.restart(true, request.search);
            problem.set_exit(usual);
        }
        Ok(near)
    }

    /// From the guesses: with a mode sequence its branch problem, without one, or where that has no solution, the
    /// homotopy.
    fn solve_from_guesses(
        &self,
        b: &mut Built,
        given: &Prepared,
        start: Start,
        request: &Request,
        control: &mut Control,
    ) -> Result<()> {
        let Built { problem, solver, bounds, identifier, extended, .. } = b;
        let (w0, guess) = self.starting_point(problem, extended, &given.stage_params, &request.options, control)?;
        let mut spent = Statistics::default();
        if let Some((sides, lengths)) = &given.modes {
            let (mut w, mut sides) = (w0.clone(), sides.clone());
            problem.guess_active_set(&mut w, self.t0, lengths, &sides, |t, x| guess.state(t, x));
            if start.is_branch() {
                problem.fit_weights(&mut w, &sides);
            }
            sides.extend(problem.member_sides(&w0));
            let distance = match start {
                Start::Near => Distance::Near,
                Start::Lowest => Distance::Close,
                _ => Distance::Far,
            };
            if solver.solve_sides(problem, bounds, &sides, (&w, distance), control, identifier) {
                return Ok(());
            }
            if start.is_branch() {
                return Ok(());
            }
            spent = solver.solution().stats;
            identifier.restart(true, request.search);
        }
        solver.solve_with(problem, bounds, &w0, control, identifier);
        solver.add_cost(&spent);
        Ok(())
    }

    /// The solution in the user's terms, compared with a simulation and explained as far as that is asked for; with what was spent before the last
    /// solve, and why the solve was cut, where it was.
    pub(super) fn report(
        &mut self,
        b: &mut Built,
        stage_params: &[f64],
        Before { stats, cut, accuracy }: Before,
        request: &Request,
        control: &mut Control,
    ) -> Result<OcpResult> {
        let Built { problem, solver, extended, .. } = b;
        let solution = solver.solution();
        let mut result = self.read(problem, solution, extended, stage_params);
        result.stats.add(&stats);
        if let Some(c) = request.comparison {
            let options = &request.options;
            // where there is no time to simulate again
            result.accuracy = match accuracy.filter(|_| stop::requested().is_some()) {
                Some(known) => Some(known),
                None => Some(self.compare(&result, problem, &solution.x, extended, stage_params, c, options)?),
            };
            result.optimality = Some(self.judge_in_time(&result, b)?);
            self.withhold_verdict(&mut result);
        }
        let Built { problem, solver, bounds, extended, .. } = b;
        let solution = solver.solution();
        let w = &solution.x;
        let mut case = Case { result: &result, problem, bounds, w, system: &extended.system, cut };
        let found = self.diagnose(&mut case, request, control);
        result.take(found);
        if request.comparison.is_some() {
            self.name_choice(&mut result)?;
        }
        if result.outcome == Outcome::Solved && result.accuracy.as_ref().is_some_and(|a| a.elsewhere) {
            result.ended = Some(Outcome::NotFollowed);
        }
        result.tell_spent(request);
        if let Some(why) = cut {
            result.tell_cut(why);
        }
        Ok(result)
    }

    /// Says where controls are choices. The optimum of one order of modes is none of the problem where a control has not chosen; what is an
    /// optimum with a kink there has.
    pub(super) fn name_choice(&self, r: &mut OcpResult) -> Result<()> {
        let Some(choice) = self.choice(r)? else { return Ok(()) };
        r.add_remark(&choice.text);
        if let Some(doubt) = choice.doubt {
            let relaxed = |o: &Optimality| o.verdict == Verdict::LocalOptimum;
            r.optimality = r.optimality.take().map(|o| if relaxed(&o) { Optimality::unknown(doubt) } else { o });
        }
        Ok(())
    }

    /// Writes the data of this solve into what was built; returns the parameters of every stage.
    pub(super) fn prepare(&self, b: &mut Built) -> Result<Vec<f64>> {
        let Built { problem, bounds, identifier, extended: e, .. } = b;
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
    pub(super) fn extended_params(&self, e: &Extended) -> Vec<f64> {
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
        let (mut lower, mut upper) = (vec![0.0; wide.u], vec![f64::INFINITY; wide.u]);
        for k in 0..self.n_stages {
            let own = self.control_bounds(k);
            lower[..own[0].len()].copy_from_slice(own[0]);
            upper[..own[1].len()].copy_from_slice(own[1]);
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
        let (violation, penalty) = self.relaxation(e, &params, &controls, &durations);
        let cost = match problem.cost(&s.x) {
            Ok(c) => c - penalty,
            // no time left to ask: the solver knows
            Err(EvalError::Stopped) if s.polish == Polish::Done => s.objective - penalty,
            Err(EvalError::Stopped) => s.objective - problem.guidance(&s.x) - penalty,
            Err(_) => f64::NAN,
        };
        let user_params = if self.stage_params.is_some() { &stage_params[..d.p] } else { &params[..d.p] };
        OcpResult {
            outcome: s.outcome,
            polish: s.polish,
            message: String::new(),
            cost: if s.outcome == Outcome::Solved { cost } else { f64::NAN },
            cost_reached: cost,
            priced: cost + penalty,
            undefined: false,
            ended: None,
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
            optimality: None,
            adaptation: None,
            jumps: Vec::new(),
            phases: Vec::new(),
            contacts: None,
        }
    }

    /// Compares an answer with the simulation of its controls; nothing is known where there is no time for it.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn compare(
        &mut self,
        r: &OcpResult,
        problem: &Fesd,
        w: &[f64],
        e: &Extended,
        stage_params: &[f64],
        comparison: Comparison,
        options: &SolveOptions,
    ) -> Result<Accuracy> {
        let (n_stages, nx) = (self.n_stages, e.system.dims().x);
        let stopped = |why| Ok(Accuracy::stopped(n_stages, nx, why));
        if let Some(why) = stop::requested() {
            return stopped(why);
        }
        match self.measure(r, problem, w, e, stage_params, comparison, options) {
            Err(Error::Interrupted) => stopped(Why::Interrupted),
            Err(Error::OutOfTime) => stopped(Why::OutOfTime),
            r => r,
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn measure(
        &mut self,
        r: &OcpResult,
        problem: &Fesd,
        w: &[f64],
        e: &Extended,
        stage_params: &[f64],
        comparison: Comparison,
        options: &SolveOptions,
    ) -> Result<Accuracy> {
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
        let total = r.priced;
        let usual = problem.state_sizes();
        let answer = Answer {
            usual: &usual,
            t0: self.t0,
            x0: &elements[0].x0,
            durations: &r.durations,
            controls: &problem.controls(w),
            control_ends: &problem.control_ends(w),
            linear: &self.linear,
            params: &params,
            states: &states,
            beside: &[],
            cost: total,
            cost_size: self.cost_size(total),
            tol: comparison.tol,
            mayer: e.mayer.as_ref(),
            grid_cost: e.grid_cost.as_ref(),
            terminal: e.terminal.iter().map(|t| (&t.f, &t.lower[..], &t.upper[..])).collect(),
            // those that are soft have rows behind these, and are priced
            path: e.path.iter().take(self.path.len()).map(Rows::of).collect(),
            x_bounds: [&self.x_bounds[0], &self.x_bounds[1]],
        };
        let mut engine = match self.engine.take().filter(|e| e.fits(&answer, options)) {
            Some(e) => e,
            None => Replay::new(&e.system, self.projected.as_ref(), e.lagrange.as_ref(), &answer, options)?,
        };
        let mut found = accuracy::measure(&mut engine, &answer)?;
        found.cost -= total - r.cost_reached;
        if comparison.by_stage || (r.is_exact() && found.large().is_some()) {
            let each = answer.by_stage();
            let stages = each.iter().map(|a| accuracy::measure(&mut engine, a)).collect::<Result<Vec<Accuracy>>>()?;
            found.take_stages(&stages);
        }
        self.engine = Some(engine);
        Ok(found)
    }
}
