//! Relaxed path, active set, polish.

use std::time::Instant;

use super::certificate::Certificate;
use super::claims::Shown;
use super::conflict::Conflict;
use super::endgame::{ActiveSet, Effort};
use super::homotopy::Spent;
use super::judge::Judge;
use super::path::Path;
use super::penalties;
use super::policy::Policy;
use super::portfolio::FoundBy;
use super::problem::{Mpcc, Side};
use super::proposer::{ActiveSetProposer, NoProposals};
use super::relaxation::{self, Sequence};
use super::relaxed::{Relaxed, Structure};
use super::settings::MpccSettings;
use crate::error::Result;
use crate::linalg::kkt::LinearStats;
use crate::nlp::{
    Bounds, Continuation, Control, Ipm, Iterate, Level, Monotone, Nlp, Outcome, Residuals, Start, Statistics,
};
use crate::settings::{Homotopy, Relaxation};
use crate::stop;

/// How the polish ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Polish {
    /// Not asked for, or not reached.
    None = 0,
    /// The branch problem is solved: the pairs are exactly complementary.
    Done = 1,
    /// The identified branch has no solution; the point is that of the relaxation.
    Rejected = 2,
}

/// Result of a solve.
#[derive(Debug, Clone)]
pub struct Solution {
    /// How it ended.
    pub outcome: Outcome,
    /// How the polish ended.
    pub polish: Polish,
    /// The point `[n]`.
    pub x: Vec<f64>,
    /// Objective, without terms that only guide the homotopy when polished.
    pub objective: f64,
    /// Multipliers of the ordinary rows `[m]`.
    pub y: Vec<f64>,
    /// Multipliers of the bounds of the variables, lower minus upper `[n]`. For members of pairs these are
    /// the multipliers `ν`, `ξ` of the MPCC, (2.31).
    pub z: Vec<f64>,
    /// Side of each group that is zero.
    pub sides: Vec<Side>,
    /// Residuals at `σ = 0`.
    pub residuals: Residuals,
    /// Kind of an exact point; unknown without a polish.
    pub certificate: Certificate,
    /// The constraints that conflict, where the problem is infeasible. `y` are then the multipliers of the least
    /// violation.
    pub conflict: Option<Conflict>,
    /// Strategy that found it.
    pub found_by: FoundBy,
    /// Cost of everything.
    pub stats: Statistics,
}

/// Relaxation at which the polish is tried in any case; later only when that one is rejected.
const FIRST_POLISH: f64 = 1e-6;
/// Relaxation whose solution is kept: where no exact point is found and no smaller relaxation is solved, it is the answer.
pub(super) const KEPT_RELAXATION: f64 = 3e-8;
/// Iterations one branch gets: near a solution it takes a handful.
const BRANCH_ITERATIONS: usize = 30;
/// Estimated multipliers of a branch problem up to this multiple of the gradient they balance are kept. Its start nearly solves it, and where the cost is not
/// curved, the Lagrange function is by its multipliers alone. Elsewhere, from points that are far from a solution, multipliers as large lead astray.
const BRANCH_MULTIPLIERS: f64 = 1e2;

/// A point to go on from: a solution of a problem of the same structure, or a guess as good.
#[derive(Debug, Clone, Copy)]
pub struct Warm<'a> {
    /// Variables `[n]`.
    pub x: &'a [f64],
    /// Multipliers of the rows `[m]`, as in [`Solution::y`].
    pub y: &'a [f64],
    /// Multipliers of the bounds `[n]`, lower minus upper, as in [`Solution::z`].
    pub z: &'a [f64],
}

/// A solver for problems of one structure.
pub struct MpccSolver {
    pub(super) st: Structure,
    /// How programs of this kind are treated.
    pub(super) policy: &'static Policy,
    pub(super) ipm: Ipm,
    /// Parameters, may be changed between solves.
    pub settings: MpccSettings,
    pub(super) bounds: Bounds,
    pub(super) saved: Iterate,
    /// Room for a point.
    pub(super) point: Vec<f64>,
    /// Room for a point in the user's units `[n]`.
    pub(super) room: Vec<f64>,
    pub(super) solution: Solution,
    pub(super) sides: Vec<Side>,
    pub(super) votes: Vec<(f64, f64)>,
    /// Groups, the least certain decision first.
    pub(super) order: Vec<usize>,
    pub(super) branch: Bounds,
    pub(super) active: ActiveSet,
    /// Near a solution: violations may not grow much any more.
    pub(super) close: bool,
    /// Objective of the point a branch got stuck at, infinite where that is far from feasible.
    pub(super) near: f64,
    pub(super) judge: Option<Judge>,
    /// A solver in elastic mode, once it was needed.
    pub(super) elastic: Option<Box<MpccSolver>>,
    /// Iterations one branch gets.
    pub(super) branch_iterations: usize,
    /// Do directions have to solve for the rows? Those of small relaxations are next to dependent, and their multipliers large.
    pub(super) exact_rows: bool,
    /// The solution of a small relaxation, where no exact point was found from it.
    pub(super) relaxed_answer: Option<Solution>,
    /// The objective of the answer that a path competes with, where one was found before.
    pub(super) rival: Option<f64>,
    /// Is this a part of the solve of another solver? What its outcome claims is for that one to show.
    pub(super) is_part: bool,
}

impl MpccSolver {
    /// Analyses the structure and allocates.
    pub fn new(p: &mut dyn Mpcc, settings: MpccSettings) -> Result<MpccSolver> {
        let (n, m, n_groups) = (p.n(), p.m(), p.n_groups());
        let mut st = Structure::new(p, relaxation::strategy(settings.relaxation));
        let (n_all, all) = st.size();
        stop::check_building(n_all)?;
        let ipm = Ipm::new(&Relaxed { inner: p, st: &mut st }, settings.ipm())?;
        Ok(MpccSolver {
            st,
            policy: Policy::of(p),
            ipm,
            settings,
            bounds: Bounds::free(n_all, all),
            branch: Bounds::free(n, m),
            saved: Iterate::zeros(n_all, all),
            point: vec![0.0; n_all],
            room: vec![0.0; n],
            solution: Solution {
                outcome: Outcome::Failed,
                polish: Polish::None,
                x: vec![0.0; n],
                objective: f64::NAN,
                y: vec![0.0; m],
                z: vec![0.0; n],
                sides: vec![Side::First; n_groups],
                residuals: Residuals::default(),
                certificate: Certificate::default(),
                conflict: None,
                found_by: FoundBy::default(),
                stats: Statistics::default(),
            },
            elastic: None,
            relaxed_answer: None,
            rival: None,
            is_part: false,
            exact_rows: false,
            sides: vec![Side::First; n_groups],
            votes: vec![(0.0, 0.0); n_groups],
            order: (0..n_groups).collect(),
            active: ActiveSet::new(n_all, all),
            close: false,
            near: f64::INFINITY,
            branch_iterations: BRANCH_ITERATIONS,
            judge: if p.pairs().is_empty() { None } else { Some(Judge::new(p)?) },
        })
    }

    /// From now on directions solve for the rows by themselves, however small their violation is beside the gradient: for points of rows next to
    /// dependent, whose violation the usual directions have left as it was.
    pub fn demand_rows(&mut self) {
        self.exact_rows = true;
    }

    /// Violation of the rows of a program without pairs that is aimed at.
    pub fn row_tolerance(&self) -> f64 {
        let s = &self.settings;
        // rounding may keep the last digits from the barrier method; the square system has them
        s.polish_tol.max(if s.polish && s.square_newton { 1e-10 } else { 1e-12 })
    }

    /// Structure and work of the factorisations since the solver was made.
    pub fn linear_statistics(&self) -> LinearStats {
        self.ipm.linear_statistics()
    }

    /// The result of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// Makes `solution`, found before by this solver, the result of the last solve again.
    pub fn restore(&mut self, solution: &Solution) {
        self.solution.clone_from(solution);
    }

    /// Solves from `x0[n]`.
    pub fn solve(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64], control: &mut Control) -> &Solution {
        self.solve_with(p, bounds, x0, control, &mut NoProposals)
    }

    /// Solves from `x0[n]`, next to the solution: the barrier parameter begins small, and the start stays as close to its bounds as it is.
    pub fn solve_close(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64], control: &mut Control) -> &Solution {
        self.close(|s, mu| {
            let usual = std::mem::replace(&mut s.settings.mu_init, mu);
            s.solve_with(p, bounds, x0, control, &mut NoProposals);
            s.settings.mu_init = usual;
        });
        &self.solution
    }

    /// Solves from `x0[n]`; `proposer` is asked for other active sets when the one that was identified has no solution.
    pub fn solve_with(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> &Solution {
        control.within(f64::INFINITY, |control| self.solve_within(p, bounds, x0, control, proposer));
        &self.solution
    }

    fn solve_within(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let clock = Instant::now();
        self.begin_exact(p);
        let s = self.settings;
        self.scale(p, bounds, x0);
        if self.st.bilinear.is_empty() {
            let mut rule = Monotone { mu_init: s.mu_init, tol: s.tol, primal_tol: self.row_tolerance() };
            p.set_polishing(true);
            self.st.bounds(bounds, 0.0, &mut self.bounds);
            let outcome = self.run_from(p, x0, &mut rule, control);
            self.record(p, outcome, Polish::None);
            self.confirm(p, bounds, control);
            if outcome == Outcome::Solved && s.polish && s.square_newton {
                self.saved.copy_from(self.ipm.iterate());
                self.settle_near(p, bounds, control);
            }
            p.set_polishing(false);
            self.certify_curvature(p, bounds);
            if self.policy.goes_on && !self.is_part {
                self.ask_rows(p, bounds, x0, control);
            }
        } else {
            // relaxations that cut the corner have a saddle on the diagonal
            let interior = matches!(s.relaxation, Relaxation::Scholtes | Relaxation::RaghunathanBiegler);
            let centre = s.centre_pairs && interior && self.policy.free_pairs;
            let minimum = self.search_branches(p, bounds, x0);
            let ended = minimum.as_ref().is_some_and(|m| self.end_by_branches(p, bounds, m, control, proposer));
            if !ended {
                self.follow_and_go_on(p, bounds, x0, (interior, centre), control, proposer);
            }
            match &minimum {
                Some(minimum) if ended => self.certify_by_branches(minimum),
                Some(minimum) => self.improve_by_branches(p, bounds, minimum, control, proposer),
                None => self.descend_by_models(p, bounds, control),
            }
            if self.policy.goes_on && !self.is_part {
                self.conclude(p, bounds, x0);
            }
        }
        self.explain(p, bounds);
        self.solution.stats.time_total = clock.elapsed().as_secs_f64();
    }

    /// The path, and what follows it where it has no solution.
    fn follow_and_go_on(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        (interior, centre): (bool, bool),
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let allowed = self.settings.max_iter;
        self.settings.max_iter = self.path_iterations();
        self.follow(p, bounds, x0, centre, control, proposer);
        self.settings.max_iter = allowed;
        if self.has_others() {
            self.doubt_relaxed();
        }
        self.confirm(p, bounds, control);
        if self.policy.goes_on {
            if !self.is_part {
                self.confirm_ray(p, bounds, x0);
            }
            let asked = self.is_open() && !self.is_part;
            let shown = if asked { self.ask_branches(p, bounds, x0) } else { Shown::default() };
            if self.has_others() && !shown.empty {
                // where the usual path ended without an answer its directions may have left the violations as they were
                let demanded = std::mem::replace(&mut self.exact_rows, true);
                self.go_on(p, bounds, x0, (interior, centre), control, proposer);
                self.exact_rows = demanded;
                self.compare(p, bounds, x0, centre, control, proposer);
            }
            self.settle_for_relaxed();
            self.find_least_violation(p, bounds, x0, shown, control, proposer);
        }
    }

    /// Solves from a primal-dual point. First the square system of the active set the point shows, which from the
    /// solution of a problem nearby takes a step or two; then its branch problem; then the whole path from `x`.
    pub fn solve_warm(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        warm: &Warm,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) -> &Solution {
        let clock = Instant::now();
        self.begin_exact(p);
        let as_given = std::mem::replace(&mut self.st.scaling.as_given, true);
        self.scale(p, bounds, warm.x);
        self.load(p, warm);
        let ok = if self.st.bilinear.is_empty() {
            let settled = self.settle_near(p, bounds, control);
            if settled {
                self.certify_curvature(p, bounds);
            }
            settled
        } else {
            self.polish(p, bounds, control, proposer, Effort::All)
        };
        if !ok {
            let cost = self.solution.stats;
            // the limit is that of the call
            let allowed = self.settings.max_iter;
            self.settings.max_iter = self.iterations_left();
            self.solve_with(p, bounds, warm.x, control, proposer);
            self.settings.max_iter = allowed;
            self.solution.stats.add(&cost);
        }
        self.st.scaling.as_given = as_given;
        self.solution.stats.time_total = clock.elapsed().as_secs_f64();
        &self.solution
    }

    /// Solves a program without pairs from a point, to the tolerance `tol` with a barrier parameter that begins at `mu`,
    /// and without a polish: one of a sequence of programs that lead elsewhere. Multipliers that are empty are estimated.
    pub fn solve_loosely(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        from: &Warm,
        [mu, tol]: [f64; 2],
        max_iter: usize,
        control: &mut Control,
    ) -> Outcome {
        let clock = Instant::now();
        self.begin(p);
        self.scale(p, bounds, from.x);
        let mut rule = Monotone { mu_init: mu, tol, primal_tol: tol };
        self.st.bounds(bounds, 0.0, &mut self.bounds);
        let usual = std::mem::replace(&mut self.settings.max_iter, max_iter);
        p.set_polishing(true);
        let outcome = if from.y.is_empty() {
            self.run_from(p, from.x, &mut rule, control)
        } else {
            self.load(p, from);
            let saved = std::mem::replace(&mut self.saved, Iterate::zeros(0, 0));
            let outcome = self.run(p, Start::Warm(&saved, mu), &mut rule, control, b' ');
            self.saved = saved;
            outcome
        };
        self.settings.max_iter = usual;
        self.record(p, outcome, Polish::None);
        p.set_polishing(false);
        self.solution.stats.time_total = clock.elapsed().as_secs_f64();
        outcome
    }

    /// From a point in the user's units.
    fn run_from(
        &mut self,
        p: &mut dyn Mpcc,
        x0: &[f64],
        path: &mut dyn Continuation,
        control: &mut Control,
    ) -> Outcome {
        let mut point = std::mem::take(&mut self.point);
        self.st.start(x0, &mut point);
        let outcome = self.run(p, Start::Cold(&point), path, control, b' ');
        self.point = point;
        outcome
    }

    /// Puts a point in the user's units into `saved`.
    pub(super) fn load(&mut self, p: &mut dyn Mpcc, warm: &Warm) {
        self.st.start(warm.x, &mut self.saved.x);
        // without values the active rows are found by violations
        let _ = Relaxed { inner: p, st: &mut self.st }.eval(&self.saved.x, &mut self.saved.s);
        let (it, scaling) = (&mut self.saved, &self.st.scaling);
        for v in [&mut it.y, &mut it.vl, &mut it.vu] {
            v.fill(0.0);
        }
        for (j, z) in warm.z.iter().enumerate() {
            let z = scaling.bound_multiplier(j, *z);
            it.zl[j] = z.max(0.0);
            it.zu[j] = (-z).max(0.0);
        }
        for (i, y) in warm.y.iter().enumerate() {
            it.y[i] = scaling.row_multiplier(i, *y);
            it.vl[i] = (-it.y[i]).max(0.0);
            it.vu[i] = it.y[i].max(0.0);
        }
    }

    /// The path of relaxed problems, with a look at the active set on the way.
    pub(super) fn follow(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        x0: &[f64],
        centre: bool,
        control: &mut Control,
        proposer: &mut dyn ActiveSetProposer,
    ) {
        let mut s = self.settings;
        if s.plateau_mu == 0.0 {
            s.plateau_mu = self.policy.plateau;
        }
        // where the last stop was left
        let mut level: Option<Level> = None;
        let early = &self.policy.stops;
        let mut stops = [FIRST_POLISH; 7];
        let by_penalties = self.st.strategy().sequence() == Sequence::Penalty && s.homotopy == Homotopy::Outer;
        let keeps = self.policy.goes_on && (by_penalties || self.st.strategy().sequence() == Sequence::Relaxation);
        // where penalties follow with the barrier parameter the last problems say nothing of how open the pairs are
        stops[early.len() + 1] = match keeps {
            true if by_penalties => penalties::KEPT,
            true => KEPT_RELAXATION,
            false => s.sigma_min,
        };
        stops[early.len() + 2] = s.sigma_min;
        if s.early_polish {
            stops[..early.len()].copy_from_slice(early);
        }
        for stop in &mut stops {
            *stop = if s.polish { stop.max(s.sigma_min) } else { s.sigma_min }.min(s.sigma_init);
        }
        let mut spent = self.has_others().then(Spent::default);
        for k in 0..stops.len() {
            let last = stops[k] == stops[stops.len() - 1];
            if !last && stops[k + 1] == stops[k] {
                continue;
            }
            let outcome = if let Some(level) = level {
                let mut path = Path::resume(s, &self.st, level, stops[k]).after(spent);
                self.st.bounds(bounds, level.sigma, &mut self.bounds);
                let saved = std::mem::replace(&mut self.saved, Iterate::zeros(0, 0));
                let outcome = self.run(p, Start::Warm(&saved, 1e-12), &mut path, control, b' ');
                spent = path.spent();
                self.saved = saved;
                outcome
            } else {
                let mut path = Path::new(s, &self.st, stops[k]).after(spent);
                self.st.bounds(bounds, path.start().sigma, &mut self.bounds);
                let mut start = std::mem::take(&mut self.point);
                self.st.start(x0, &mut start);
                if centre {
                    for b in &self.st.bilinear {
                        for j in [b.a, b.b] {
                            start[j] = (0.5 * s.sigma_init.sqrt()).min(self.bounds.xu[j]);
                        }
                    }
                }
                self.st.start_elastic(&mut start);
                let outcome = self.run(p, Start::Cold(&start), &mut path, control, b' ');
                spent = path.spent();
                self.point = start;
                outcome
            };
            // how exactly the relaxation is solved, where its solution may be kept
            let error = if keeps { self.ipm.error() } else { f64::INFINITY };
            // a line search that ends at rounding, at a point that solves this problem as far as its relaxation is exact, ends nothing
            let arrived = outcome == Outcome::Stalled && !last && !by_penalties && error <= stops[k];
            let outcome = if arrived { Outcome::Solved } else { outcome };
            self.record(p, outcome, self.solution.polish);
            if !s.polish || !matches!(outcome, Outcome::Solved | Outcome::Stalled) {
                return;
            }
            if self.is_beaten() {
                self.solution.outcome = Outcome::Stalled;
                return;
            }
            self.saved.copy_from(self.ipm.iterate());
            let tried = level.is_some();
            level = Some(self.ipm.level());
            let early = outcome == Outcome::Solved && stops[k] > FIRST_POLISH;
            if early && tried && self.ipm.statistics().iterations == 0 {
                // the same point was tried at the last stop
                continue;
            }
            let end = last || outcome == Outcome::Stalled;
            let effort = match early {
                true => Effort::Early,
                false if end || !self.policy.early => Effort::All,
                false => Effort::Identified,
            };
            if by_penalties && keeps && stops[k] <= penalties::KEPT {
                match outcome {
                    Outcome::Solved => {
                        self.keep_relaxed(Solution { polish: Polish::Rejected, ..self.solution.clone() })
                    }
                    // the answer that was kept is better than where a smaller barrier parameter has led
                    _ if self.relaxed_answer.is_some() => return,
                    _ => {}
                }
            }
            let exact = error.max(self.solution.residuals.pair_product) <= 2.0 * KEPT_RELAXATION;
            if outcome == Outcome::Solved && stops[k] == KEPT_RELAXATION && exact {
                // a smaller relaxation may leave less doubt about the active set
                self.keep_relaxed(Solution { polish: Polish::Rejected, ..self.solution.clone() });
                continue;
            }
            if self.polish(p, bounds, control, proposer, effort) || end {
                return;
            }
        }
    }

    /// Solves the branch problem with the given `bounds` from `x0[n]`, with `sides` the active set they stand for;
    /// when it has a solution, that is then the result.
    pub fn solve_branch(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        sides: &[Side],
        x0: &[f64],
        control: &mut Control,
    ) -> Outcome {
        let clock = Instant::now();
        self.begin_exact(p);
        self.st.scaling.reset();
        let it = &mut self.saved;
        self.st.start(x0, &mut it.x);
        for v in [&mut it.y, &mut it.vl, &mut it.vu, &mut it.zl, &mut it.zu] {
            v.fill(0.0);
        }
        self.sides.copy_from_slice(sides);
        self.branch.copy_from(bounds);
        let outcome = self.run_branch(p, control);
        if outcome == Outcome::Solved {
            self.record(p, outcome, Polish::Done);
        }
        self.solution.outcome = outcome;
        self.solution.stats.time_total = clock.elapsed().as_secs_f64();
        p.set_polishing(false);
        outcome
    }

    pub(super) fn scale(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, x0: &[f64]) {
        if self.settings.scaling {
            let (rows, grad) = (&mut self.saved.y[..self.st.m], &mut self.point[..x0.len()]);
            self.st.scale(p, bounds, x0, rows, grad);
        } else {
            self.st.scaling.reset();
        }
    }

    /// A solve begins: nothing of the last one counts but its point, where that is the start.
    pub(super) fn begin(&mut self, p: &mut dyn Mpcc) {
        p.set_polishing(false);
        let s = &mut self.solution;
        (s.outcome, s.polish, s.objective) = (Outcome::Failed, Polish::None, f64::NAN);
        (s.certificate, s.conflict, s.found_by) = (Certificate::default(), None, FoundBy::Path);
        (s.residuals, s.stats) = (Residuals::default(), Statistics::default());
        s.sides.fill(Side::First);
        (self.relaxed_answer, self.rival) = (None, None);
        self.st.reset();
        self.st.scaling.set_sizes(p);
        self.active.reset();
        self.close = false;
        self.near = f64::INFINITY;
        self.branch_iterations = BRANCH_ITERATIONS;
        self.ipm.settings_mut().restoration = true;
    }

    /// The same for a solve that ends at an exact answer: sizes are rounded to powers of two. Bounds and points are then what they are
    /// in the units of the problem, to the last bit, which degenerate active sets need. Smoothed problems, which decide what answer
    /// is found, are measured by the sizes as they are.
    pub(super) fn begin_exact(&mut self, p: &mut dyn Mpcc) {
        self.begin(p);
        self.st.scaling.round_sizes();
    }

    pub(super) fn run(
        &mut self,
        p: &mut dyn Mpcc,
        start: Start,
        path: &mut dyn Continuation,
        control: &mut Control,
        phase: u8,
    ) -> Outcome {
        let used = self.solution.stats.iterations;
        let settings = self.ipm.settings_mut();
        self.settings.update_ipm(settings);
        let left = self.settings.max_iter.saturating_sub(used);
        settings.max_iter = if phase == b'p' { left.min(self.branch_iterations) } else { left };
        settings.first_iteration = used;
        let estimates = phase == b'p' && matches!(start, Start::Cold(_));
        settings.y_init_share = if estimates { BRANCH_MULTIPLIERS } else { 0.0 };
        settings.theta_room = if self.close { 10.0 } else { 1e4 };
        settings.exact_rows = self.exact_rows;
        self.ipm.set_phase(phase);
        let mut relaxed = Relaxed { inner: p, st: &mut self.st };
        let outcome = self.ipm.solve(&mut relaxed, &self.bounds, start, path, control);
        let (total, s) = (&mut self.solution.stats, self.ipm.statistics());
        total.add(s);
        if phase == b'p' {
            total.polish_iterations += s.iterations;
        }
        outcome
    }

    /// Copies point, multipliers and residuals out of the interior-point solver.
    pub(super) fn record(&mut self, p: &mut dyn Mpcc, outcome: Outcome, polish: Polish) {
        let relaxed = Relaxed { inner: p, st: &mut self.st };
        self.solution.residuals = self.ipm.residuals(&relaxed);
        let (it, s) = (self.ipm.iterate(), &mut self.solution);
        self.st.complete(&it.x, &mut s.residuals);
        s.outcome = outcome;
        s.polish = polish;
        let scaling = &self.st.scaling;
        scaling.grow(&it.x, &mut s.x);
        s.objective = self.st.objective(self.ipm.objective(), &it.x);
        self.st.row_multipliers(&it.y, &mut s.y);
        for (y, scale) in s.y.iter_mut().zip(&scaling.rows) {
            *y *= scale;
        }
        for j in 0..s.z.len() {
            s.z[j] = it.zl[j] - it.zu[j];
        }
        if polish == Polish::Done {
            s.sides.copy_from_slice(&self.sides);
            // fixed members have no bound multiplier in the branch problem: it is the gradient that is left
            self.ipm.fixed_multipliers(&mut s.z);
        } else {
            self.st.pull_back(&it.x, &it.y, &mut s.z);
        }
        for v in s.y.iter_mut().chain(&mut s.z) {
            *v /= scaling.objective;
        }
        for (v, size) in s.z.iter_mut().zip(&scaling.sizes) {
            *v /= size;
        }
    }
}
