//! Simulation of piecewise smooth systems, step by step with FESD.
//!
//! Every step is a small square MPCC of `n_fe` finite elements. Its structure and symbolic factorisation serve
//! the whole simulation. A step first follows a predicted active set: with one active set per element the
//! equations are square and take a few Newton iterations; a multiplier of the wrong sign shows where the next
//! switch is, and the complementarity problem (6.19) which set follows. Only when that leads nowhere the
//! homotopy decides, and a step with more switches than elements is halved.
//!
//! Where the continuation is not unique, the set of the last element is kept if it is one of the solutions,
//! else the smallest set is taken, the lowest index first; the time is noted in [`SimResult::non_unique`].

mod arbiter;
#[cfg(test)]
mod memory_tests;
mod options;
mod transitions;

pub use arbiter::arbiter;
pub use options::SolveOptions;

use self::transitions::Watch;

use std::time::Instant;

use crate::dcs::filippov::{distinct, FilippovProblem, FilippovSolution};
use crate::dcs::{Dcs, DcsFields};
use crate::error::{check_run, finite, Error, Result};
use crate::fesd::{Exit, Fesd, Spec, Trajectory};
use crate::func::Point;
use crate::mpcc::{Mpcc, MpccSolver, Polish, Side};
use crate::nlp::{Bounds, Control, Nlp, Outcome, Statistics};
use crate::settings::{Discretisation, Settings};
use crate::system::System;
use crate::tableau::Tableau;

/// Result of a simulation.
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
    /// Times at which the continuation was not unique; the simulation took one of the solutions.
    pub non_unique: Vec<f64>,
    /// Steps that needed the homotopy.
    pub homotopies: usize,
    /// Parts of steps for which no active set was found: their solution is that of the relaxation, `λθ ≤ σ_min`.
    pub inexact: usize,
    /// Largest violation of the equations over the steps.
    pub primal: f64,
    /// Largest `min(λ, θ)` over the steps.
    pub pair_min: f64,
    /// Transitions in the order they were made, with their times.
    pub jumps: Vec<(f64, usize)>,
}

/// What finite elements do not know of transitions.
fn check_transitions(system: &System) -> Result<()> {
    let transitions = system.transitions();
    if let Some(k) = transitions.iter().position(|t| !t.is_plain()) {
        return Err(Error::Unsupported(format!(
            "transition {k} is no comparison that makes the state jump where it is true: a simulation by finite elements does not follow events that \
             note or stop, edges, and conditions of several comparisons; simulate the system event-driven"
        )));
    }
    if !transitions.is_empty() && system.n_algebraic() > 0 {
        return Err(Error::Unsupported(
            "a simulation by finite elements takes no transitions next to algebraic states: simulate the system event-driven".into(),
        ));
    }
    Ok(())
}

/// A step is halved at most so often.
const MAX_HALVINGS: usize = 10;
/// Parts of a step that may be beyond exact signs: the bound on the work where switches accumulate.
const MAX_TRIES: usize = 24;
/// Active sets tried at the start of a step before the homotopy decides.
const MAX_PLANS: usize = 6;
/// Distance to a switching surface that counts as being on it, relative to the way of a step: what the equations of the
/// step that ended there leave over.
const ON_SURFACE: f64 = 2e-8;
/// How far below zero the multipliers `λ`, `θ`, and `θ` at the end of the step may be: rounding of the Newton iteration. A `θ` of this size acts for
/// as short a time, its effect on the states is the square.
const SIGN_TOL: (f64, f64, f64) = (1e-10, 1e-8, 1e-8);
/// The same where no set satisfies the first tolerance: a switch so close to the end of the step that an element
/// behind it would have no length in double precision, or where the end of a sliding mode falls into the error of the
/// method at the end of the step. The next step then begins on the surface.
const LOOSE_SIGN_TOL: (f64, f64, f64) = (1e-8, 1e-6, 1e-3);

/// Cells among which the active ones behind a point are looked for.
#[derive(Clone, Copy)]
enum Near<'a> {
    /// Those the point is on the boundary of.
    Surface,
    /// These.
    Given(&'a [bool]),
}

/// A simulator: model, state, and what is reused from step to step.
pub struct Simulator {
    options: SolveOptions,
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
    branch: Bounds,
    fields: DcsFields,
    /// Length of the present step.
    length: f64,
    /// Active set of the last element, empty where none is known.
    last: Vec<bool>,
    saved_x: Vec<f64>,
    /// Parts beyond exact signs left to the present step.
    tries: usize,
    p: Vec<f64>,
    /// Transitions, where there are some.
    watch: Option<Watch>,
}

impl Simulator {
    /// Discretises one step of `system`. State, controls and parameters are zero until they are set.
    pub fn new(system: &System, settings: &Settings) -> Result<Simulator> {
        Simulator::with_options(system, &SolveOptions::from_settings(settings)?)
    }

    /// Makes a simulator like [`Simulator::new`].
    pub fn with_options(system: &System, options: &SolveOptions) -> Result<Simulator> {
        let d = system.dims();
        check_transitions(system)?;
        let watch = (!system.transitions().is_empty()).then(|| Watch::new(system));
        let flow = system.without_transitions();
        let system = flow.with_multipliers()?;
        system.check_without_contacts("a simulation by finite elements")?;
        let dcs = Dcs::new(&system, options.form)?;
        let detects = options.discretisation.discretisation == Discretisation::Fesd;
        if options.n_fe < 2 && dcs.form().n_cells > 0 && detects {
            return Err(Error::Range(
                "n_fe = 1 leaves no element behind a switch: use at least 2 elements per step, or the discretisation \
                 'standard'"
                    .into(),
            ));
        }
        let spec = Spec::new(dcs, options.discretisation, vec![options.n_fe]);
        let mut problem = Fesd::new(spec, 1.0)?;
        let solver = MpccSolver::new(&mut problem, options.solver)?;
        Ok(Simulator {
            options: *options,
            nx: d.x,
            nu: d.u,
            bounds: problem.bounds(),
            tableau: problem.tableau().clone(),
            t: 0.0,
            x: vec![0.0; d.x],
            u: vec![0.0; d.u],
            w: vec![0.0; problem.n()],
            sides: vec![Side::First; problem.n_groups()],
            branch: problem.bounds(),
            fields: DcsFields::new(&problem.spec().dcs),
            length: 0.0,
            last: Vec::with_capacity(problem.n_cells()),
            saved_x: vec![0.0; d.x],
            tries: MAX_TRIES,
            p: vec![0.0; d.p],
            watch,
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
        self.last.clear();
        self.watch.iter_mut().for_each(Watch::begin);
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
        self.problem.set_params(p)?;
        self.p.copy_from_slice(p);
        Ok(())
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
        self.run_stages(duration, n_steps, None, control)
    }

    /// Simulates `n` stages of equal length, one step each, with the controls `u[n · nu]` where they are given.
    pub(crate) fn run_stages(
        &mut self,
        duration: f64,
        n: usize,
        u: Option<&[f64]>,
        control: &mut Control,
    ) -> Result<SimResult> {
        check_run(duration, n as i64)?;
        control.within(self.options.max_time, |control| self.run_within(duration, n, u, control))
    }

    fn run_within(&mut self, duration: f64, n: usize, u: Option<&[f64]>, control: &mut Control) -> Result<SimResult> {
        let mut r = self.empty_result();
        let (t0, h) = (self.t, duration / n as f64);
        for k in 0..n {
            if let Some(u) = u {
                self.set_controls(&u[k * self.nu..(k + 1) * self.nu])?;
            }
            // the grid does not inherit the rounding of sums
            self.t = t0 + k as f64 * h;
            self.advance(h, control, &mut r);
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
            inexact: 0,
            non_unique: Vec::new(),
            primal: 0.0,
            pair_min: 0.0,
            jumps: Vec::new(),
        }
    }

    /// Does one step of length `h` and appends it to `r`. When it fails, time and state stay as they are.
    pub fn advance(&mut self, h: f64, control: &mut Control, r: &mut SimResult) {
        let max_time = self.options.max_time;
        control.within(max_time, |control| self.advance_within(h, control, r));
    }

    fn advance_within(&mut self, h: f64, control: &mut Control, r: &mut SimResult) {
        let clock = Instant::now();
        let (t, elements, switches) = (self.t, r.trajectory.elements.len(), r.trajectory.switches.len());
        self.saved_x.copy_from_slice(&self.x);
        self.tries = MAX_TRIES;
        let jumps = r.jumps.len();
        self.pass(h, control, r);
        if r.outcome == Outcome::Solved {
            r.steps += 1;
            self.t = t + h;
        } else {
            self.t = t;
            self.x.copy_from_slice(&self.saved_x);
            self.last.clear();
            r.trajectory.elements.truncate(elements);
            r.trajectory.switches.truncate(switches);
            r.jumps.truncate(jumps);
        }
        r.stats.time_total += clock.elapsed().as_secs_f64();
    }

    /// A step, or two of half the length where the signs cannot be satisfied with so few elements.
    ///
    /// What a step of the smallest length cannot do exactly is decided by looser signs, then by the homotopy; without
    /// any predicted active set the homotopy comes first.
    fn divide(&mut self, h: f64, depth: usize, control: &mut Control, r: &mut SimResult) {
        self.prepare(h);
        let predicts = self.problem.detects_switches() && self.options.solver.polish;
        // fixed steps are not planned, but where the continuation is not unique is said all the same
        let mut plans = if self.problem.n_cells() > 0 { self.plans(r) } else { Vec::new() };
        if !predicts {
            plans.clear();
        }
        let mut done = self.follow_any(&plans, &[(SIGN_TOL, Exit::Theta), (SIGN_TOL, Exit::Slope)], control, r);
        if !done && !plans.is_empty() && depth > 0 && !is_stop(r.outcome) {
            return self.halve(h, depth, control, r);
        }
        if !done && !is_stop(r.outcome) {
            self.tries = self.tries.saturating_sub(1);
            done = self.follow_any(&plans, &[(LOOSE_SIGN_TOL, Exit::Slope)], control, r);
        }
        if is_stop(r.outcome) && !done {
            return;
        }
        if !done {
            self.start_guess();
            r.homotopies += 1;
            self.problem.set_exit(Exit::Slope);
            self.solver.solve(&mut self.problem, &self.bounds, &self.w, control);
            r.stats.add(&self.solver.solution().stats);
            let s = self.solver.solution();
            let inexact = s.outcome == Outcome::Solved && predicts && s.polish != Polish::Done;
            if (s.outcome != Outcome::Solved || inexact) && !is_stop(s.outcome) && depth > 0 && self.tries > 0 {
                return self.halve(h, depth, control, r);
            }
            r.inexact += inexact as usize;
        }
        self.take(h, r);
    }

    fn halve(&mut self, h: f64, depth: usize, control: &mut Control, r: &mut SimResult) {
        self.divide(0.5 * h, depth - 1, control, r);
        if r.outcome == Outcome::Solved && self.tries > 0 {
            self.divide(0.5 * h, depth - 1, control, r);
        } else if r.outcome == Outcome::Solved {
            r.outcome = Outcome::Stalled;
        }
    }

    /// Follows the plans one way after the other until one holds.
    fn follow_any(
        &mut self,
        plans: &[Vec<bool>],
        ways: &[((f64, f64, f64), Exit)],
        control: &mut Control,
        r: &mut SimResult,
    ) -> bool {
        for &(tol, exit) in ways {
            self.problem.set_exit(exit);
            for plan in plans {
                if self.follow(plan, tol, control, r) {
                    return true;
                }
                if is_stop(r.outcome) {
                    return false;
                }
            }
        }
        false
    }

    /// Bounds of a step of length `h` from the present state.
    fn prepare(&mut self, h: f64) {
        self.length = h;
        self.problem.set_duration(h);
        self.problem.write_durations(&mut self.bounds);
        self.problem.bound_initial(&mut self.bounds, &self.x, &self.x, self.t);
        self.problem.bound_control(&mut self.bounds, 0, &self.u, &self.u);
    }

    /// Starting point: the present state everywhere.
    fn start_guess(&mut self) {
        self.problem.guess(&mut self.w, self.t, |_, x| x.copy_from_slice(&self.x), |_, u| u.copy_from_slice(&self.u));
    }

    /// Takes over the solution of the step.
    fn take(&mut self, h: f64, r: &mut SimResult) {
        let s = self.solver.solution();
        r.outcome = s.outcome;
        self.last.clear();
        if s.outcome != Outcome::Solved {
            return;
        }
        r.primal = r.primal.max(s.residuals.primal);
        r.pair_min = r.pair_min.max(s.residuals.pair_min);
        let polished = s.polish == Polish::Done;
        r.trajectory.append(&self.problem, &s.x, polished.then_some(&s.sides[..]), self.t);
        if let Some(e) = r.trajectory.elements.last() {
            self.x.copy_from_slice(&e.x1);
        }
        self.t += h;
        if polished && self.problem.detects_switches() {
            let n = self.problem.n_cells();
            let end = s.sides.len();
            self.last.extend(s.sides[end - n..].iter().map(|&s| s == Side::First));
        }
    }

    /// Active sets a step may begin with: that of the last element first, then what (6.19) allows at this state.
    fn plans(&mut self, r: &mut SimResult) -> Vec<Vec<bool>> {
        let mut plans = Vec::new();
        let x = self.x.clone();
        let solutions = self.continuations(&x, self.t, Near::Surface);
        let sets: Vec<Vec<bool>> = solutions.iter().map(|s| self.active_cells(s)).collect();
        let several = distinct(&self.fields, &x, solutions).len() > 1;
        if several && r.non_unique.last().is_none_or(|&t| t < self.t) {
            r.non_unique.push(self.t);
        }
        if !self.last.is_empty() && (sets.is_empty() || sets.contains(&self.last)) {
            plans.push(self.last.clone());
        }
        for set in sets.into_iter().take(MAX_PLANS) {
            if !plans.contains(&set) {
                plans.push(set);
            }
        }
        plans
    }

    /// The active cells of the form in a solution of (6.19), which speaks of regions.
    fn active_cells(&self, s: &FilippovSolution) -> Vec<bool> {
        let dcs = &self.problem.spec().dcs;
        let mut regions = vec![false; dcs.n_cells()];
        s.sets.iter().flatten().for_each(|&c| regions[c] = true);
        dcs.from_regions(&regions)
    }

    /// Solutions of (6.19) at a state, with candidates by the values of the indicators, or given.
    fn continuations(&mut self, x: &[f64], t: f64, near: Near) -> Vec<FilippovSolution> {
        let dcs = &self.problem.spec().dcs;
        let at = Point { t, x, u: &self.u, p: self.problem.params() };
        if !dcs.predicts() || self.fields.move_to(&at, self.length).is_err() {
            return Vec::new();
        }
        let candidates = match near {
            Near::Given(c) => self.fields.lists(&dcs.to_regions(c)),
            Near::Surface => {
                let mut near = self.fields.near(ON_SURFACE);
                if self.problem.drifts() && !self.last.is_empty() {
                    // the last step ends beside the surface it slides on
                    for (near, slides) in near.iter_mut().zip(self.fields.lists(&dcs.to_regions(&self.last))) {
                        near.extend(slides);
                        near.sort_unstable();
                        near.dedup();
                    }
                }
                near
            }
        };
        let problem = FilippovProblem::new(&mut self.fields, t, x, &candidates);
        let found = problem.and_then(|p| p.solutions(&mut self.fields, self.length));
        found.map_or_else(|_| Vec::new(), |(found, _)| found)
    }

    /// Solves the square equations for the active set `first` in all elements; where a sign fails, the next
    /// element gets the set that follows, until all signs hold. False when that leads nowhere.
    fn follow(&mut self, first: &[bool], tol: (f64, f64, f64), control: &mut Control, r: &mut SimResult) -> bool {
        self.start_guess();
        let (n, n_fe) = (self.problem.n_cells(), self.options.n_fe);
        let mut current = first.to_vec();
        self.set_sides(0, &current);
        // first element of the present set
        let mut begin = 0;
        // candidates at a switch whose following set was chosen by the fields behind it, not at it
        let mut unverified: Option<Vec<bool>> = None;
        for _ in 0..2 * n_fe {
            self.branch.copy_from(&self.bounds);
            self.problem.branch(&self.sides, &mut self.branch);
            self.problem.free_signs(&mut self.branch);
            r.outcome = self.solver.solve_branch(&mut self.problem, &self.branch, &self.sides, &self.w, control);
            r.stats.add(&self.solver.solution().stats);
            if r.outcome != Outcome::Solved {
                return false;
            }
            if let Some(candidates) = unverified.take() {
                let (x, t) = self.problem.start_of(begin, &self.solver.solution().x);
                let (x, t) = (x.to_vec(), t.unwrap_or(self.t));
                let solutions = self.continuations(&x, t, Near::Given(&candidates));
                let sets: Vec<Vec<bool>> = solutions.iter().map(|s| self.active_cells(s)).collect();
                if let Some(first) = sets.first().filter(|_| !sets.contains(&current)) {
                    current.clone_from(first);
                    self.set_sides(begin, &current);
                    self.w.copy_from_slice(&self.solver.solution().x);
                    continue;
                }
            }
            let Some(v) = self.problem.first_violation(&self.solver.solution().x, &self.sides, tol.0, tol.1, tol.2)
            else {
                return true;
            };
            // the switch goes to the end of the element it was seen in, and leaves one element behind it
            let last = v.element.min(n_fe.saturating_sub(2));
            if v.element < begin || last < begin || n_fe == 1 {
                return false;
            }
            let (cell, of_theta, x, t) = (v.cell, v.of_theta, v.x.to_vec(), v.t.unwrap_or(self.t));
            let event = self.problem.event_time(&self.solver.solution().x, &v);
            if of_theta {
                current[cell] = false;
            } else {
                let mut candidates = current.clone();
                candidates[cell] = true;
                let next = self.continuations(&x, t, Near::Given(&candidates));
                let mut next = next.iter().map(|s| self.active_cells(s));
                let Some(next) = next.find(|set| *set != current) else { return false };
                current = next;
                unverified = Some(candidates);
            }
            if (0..n).all(|c| !current[c]) {
                return false;
            }
            begin = last + 1;
            self.set_sides(begin, &current);
            self.problem.restart(&self.solver.solution().x, last, event, &mut self.w);
        }
        false
    }

    /// Active set of all elements from `element` on.
    fn set_sides(&mut self, element: usize, active: &[bool]) {
        let n = active.len();
        for (k, s) in self.sides.iter_mut().enumerate().skip(element * n) {
            *s = if active[k % n] { Side::First } else { Side::Second };
        }
    }
}

/// Did somebody ask to stop?
fn is_stop(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Stopped | Outcome::MaxTime)
}
