//! The main loop: residuals, level, Hessian, direction, line search, update.

use std::ops::Range;
use std::time::Instant;

use super::allowance;
use super::augmented::{sigma_s, Augmented};
use super::centrality::{Direction, Offsets};
use super::filter::Filter;
use super::iterate::{kkt_error, lagrangian_gradient, theta, Iterate, KktError, RowKind, Shape, Values};
use super::linesearch::{clamp_multiplier, tiny_gap, Search};
use super::problem::{Bounds, Nlp};
use super::report::{Control, IterationInfo, Outcome, Residuals, Statistics};
use super::restore::Restoration;
use super::saddle::Watch;
use super::settings::IpmSettings;
use crate::error::Result;
use crate::func::EvalError;
use crate::linalg::csc::Pattern;
use crate::linalg::kkt::LinearStats;
use crate::stop;

/// A barrier problem: barrier parameter `μ`, relaxation `σ`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Barrier parameter.
    pub mu: f64,
    /// Upper bound of the relaxed rows.
    pub sigma: f64,
}

/// Errors a [`Continuation`] decides by.
#[derive(Debug, Clone, Copy)]
pub struct Measures {
    /// Present level.
    pub level: Level,
    /// Scaled error of the barrier problem of this level.
    pub error: f64,
    /// Scaled error at `μ = 0`.
    pub error0: f64,
    /// Violation of the rows at this level.
    pub primal: f64,
    /// Dual infeasibility, scaled.
    pub dual: f64,
    /// Largest product of a pair.
    pub pair_product: f64,
    /// Violation that rounding alone explains.
    pub rounding: f64,
    /// Length of the last primal step; 1 before the first.
    pub alpha: f64,
    /// Number added to the diagonal of the Hessian for that step; 0 where nothing had to be.
    pub shift: f64,
    /// Largest smaller member of a pair.
    pub pair_min: f64,
    /// [`Nlp::elastic`].
    pub elastic: f64,
    /// Derivative of the optimal objective with respect to `ln σ`, as the multipliers of the relaxed rows tell it: `σ` times their
    /// sum.
    pub pull: f64,
}

/// Answers of a [`Continuation`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Advance {
    /// Go on with this level.
    Stay,
    /// Solved well enough: next level.
    To(Level),
    /// Too far from the last level: back to the point where that was left, and on with another one.
    Back(Level),
    /// On with this level from this point, with multipliers as at a start.
    Renew,
    /// The problem is solved.
    Done,
    /// Further iterations do not help.
    GiveUp,
}

/// Decides the sequence of barrier problems.
pub trait Continuation {
    /// The first level.
    fn start(&mut self) -> Level;
    /// Called at every iterate, again after every [`Advance::To`].
    fn advance(&mut self, m: &Measures) -> Advance;
    /// The line search found no way on; an easier level to retry, if any.
    fn jammed(&mut self, _m: &Measures) -> Option<Level> {
        None
    }
    /// Rows whose upper bound is `σ`.
    fn relaxed_rows(&self) -> Range<usize> {
        0..0
    }
    /// True where a level with a larger barrier parameter begins near its central path, instead of where the last one was left.
    fn recentres(&self) -> bool {
        false
    }
    /// True where short directions of the present level are corrected towards the central path.
    fn corrects(&self) -> bool {
        false
    }
}

/// The next barrier parameter, `max(floor, min(0.2 μ, μ^1.5))`.
pub(crate) fn lower_barrier(mu: f64, floor: f64) -> f64 {
    (0.2 * mu).min(mu.powf(1.5)).max(floor)
}

/// The monotone rule of Fiacco and McCormick: `μ ← max(tol/10, min(0.2 μ, μ^1.5))` once `E_μ ≤ 10 μ`.
#[derive(Debug, Clone, Copy)]
pub struct Monotone {
    /// First barrier parameter.
    pub mu_init: f64,
    /// Tolerance for the scaled error.
    pub tol: f64,
    /// Tolerance for the violation of the rows; at most `tol`.
    pub primal_tol: f64,
}

impl Continuation for Monotone {
    fn start(&mut self) -> Level {
        Level { mu: self.mu_init, sigma: 0.0 }
    }
    fn advance(&mut self, m: &Measures) -> Advance {
        if m.error0 <= self.tol && m.primal <= self.primal_tol.max(m.rounding) {
            return Advance::Done;
        }
        let (mu, floor) = (m.level.mu, 0.1 * self.tol);
        if m.error <= 10.0 * mu && mu > floor {
            Advance::To(Level { mu: lower_barrier(mu, floor), ..m.level })
        } else {
            Advance::Stay
        }
    }
}

/// Starting points of a solve.
#[derive(Debug, Clone, Copy)]
pub enum Start<'a> {
    /// From a point `x[n]`, multipliers estimated.
    Cold(&'a [f64]),
    /// From a primal-dual point of the same problem, kept as it is up to `push` from the bounds.
    Warm(&'a Iterate, f64),
}

/// Distance from the start, relative, and relative decrease of the objective per step, of an unbounded problem.
const FAR: f64 = 1e6;
const FALL: f64 = 1e-3;

/// Steps this short, this many in a row, lead nowhere from a point that violates the rows.
const TINY_STEP: f64 = 1e-2;
const TINY_STEPS: usize = 6;

/// Steps in a row that are cut short to less than this, relative to the size of the point: the rows leave no room between
/// their bounds.
const STANDING: f64 = 1e-6;
const STANDING_STEPS: usize = 5;
/// How far bounds without room between them move, relative to their size and at least to one in the scaled problem: less
/// than rows may be violated by. (Section 3.5 of Wächter and Biegler; there all bounds move by 1e-8 before the first step.)
const ROOM: f64 = 1e-9;
/// How often bounds move in one solve.
const ROOMS: usize = 2;

/// A step this much longer than the point comes from a singular matrix.
const ABSURD: f64 = 1e4;

/// What the end of a solve is called: a failure after the call was asked to end is that end.
fn ended_by(outcome: Outcome) -> Outcome {
    match outcome {
        Outcome::Failed | Outcome::Stalled | Outcome::Infeasible | Outcome::LocallyInfeasible => {
            stop::requested().map_or(outcome, Outcome::from)
        }
        _ => outcome,
    }
}

/// Called with every accepted `x`; true ends the solve (used by the restoration phase).
pub(super) type Probe<'a> = &'a mut dyn FnMut(&[f64]) -> bool;

/// An interior-point solver for problems of one structure. All memory is allocated by [`Ipm::new`], but
/// for the restoration phase, which allocates when it is first needed.
pub struct Ipm {
    pub(super) n: usize,
    pub(super) m: usize,
    pub(super) jac: Pattern,
    pub(super) settings: IpmSettings,
    pub(super) shape: Shape,
    pub(super) bounds: Bounds,
    pub(super) it: Iterate,
    pub(super) trial: Iterate,
    /// Where the last level was left.
    left: Iterate,
    /// Rows whose upper bound is `σ`.
    relaxed: Range<usize>,
    pub(super) v: Values,
    pub(super) c_trial: Vec<f64>,
    pub(super) f_trial: f64,
    pub(super) lag: Vec<f64>,
    pub(super) system: Augmented,
    pub(super) filter: Filter,
    pub(super) dx: Vec<f64>,
    pub(super) ds: Vec<f64>,
    pub(super) dzl: Vec<f64>,
    pub(super) dzu: Vec<f64>,
    pub(super) dvl: Vec<f64>,
    pub(super) dvu: Vec<f64>,
    // directions of the second-order correction
    pub(super) dx_soc: Vec<f64>,
    pub(super) ds_soc: Vec<f64>,
    pub(super) residual: Vec<f64>,
    pub(super) offsets: Offsets,
    // the direction before its last correction, and before all of them, where it was corrected
    pub(super) before: Direction,
    pub(super) plain: Direction,
    pub(super) corrected: bool,
    pub(super) level: Level,
    pub(super) stats: Statistics,
    pub(super) info: IterationInfo,
    pub(super) phase: u8,
    pub(super) resto: Option<Box<Restoration>>,
    /// A function asked to stop.
    pub(super) fatal: bool,
    /// The call was asked to end while the rows, or the derivatives, of the point reached were evaluated: they are those
    /// of several points.
    torn: [bool; 2],
    /// Size of the starting point, objective before, and steps in a row on the way to infinity.
    x_start: f64,
    f_before: f64,
    fall_before: f64,
    falling: usize,
}

impl Ipm {
    /// Analyses the structure of `nlp` and allocates everything a solve needs.
    pub fn new(nlp: &dyn Nlp, settings: IpmSettings) -> Result<Ipm> {
        let (n, m) = (nlp.n(), nlp.m());
        let hess_nnz = nlp.hess_pattern().nnz();
        let jac = nlp.jac_pattern().clone();
        let system = Augmented::new(nlp, settings.linear_solver, settings.ordering)?;
        stop::check_building(n)?;
        Ok(Ipm {
            n,
            m,
            settings,
            shape: Shape::new(n, m),
            bounds: Bounds::free(n, m),
            it: Iterate::zeros(n, m),
            trial: Iterate::zeros(n, m),
            left: Iterate::zeros(n, m),
            relaxed: 0..0,
            v: Values {
                f: 0.0,
                c: vec![0.0; m],
                grad: vec![0.0; n],
                jac: vec![0.0; jac.nnz()],
                hess: vec![0.0; hess_nnz],
            },
            c_trial: vec![0.0; m],
            f_trial: 0.0,
            lag: vec![0.0; n],
            system,
            filter: Filter::new(),
            dx: vec![0.0; n],
            ds: vec![0.0; m],
            dzl: vec![0.0; n],
            dzu: vec![0.0; n],
            dvl: vec![0.0; m],
            dvu: vec![0.0; m],
            dx_soc: vec![0.0; n],
            ds_soc: vec![0.0; m],
            residual: vec![0.0; m],
            offsets: Offsets::new(n, m),
            before: Direction::new(n, m),
            plain: Direction::new(n, m),
            corrected: false,
            level: Level { mu: 0.1, sigma: 0.0 },
            stats: Statistics::default(),
            info: IterationInfo::default(),
            phase: b' ',
            resto: None,
            fatal: false,
            torn: [false; 2],
            x_start: 1.0,
            f_before: 0.0,
            fall_before: 0.0,
            falling: 0,
            jac,
        })
    }

    /// Constants of the method.
    pub fn settings_mut(&mut self) -> &mut IpmSettings {
        &mut self.settings
    }

    /// The primal-dual point reached.
    pub fn iterate(&self) -> &Iterate {
        &self.it
    }

    /// Objective at that point.
    pub fn objective(&self) -> f64 {
        self.v.f
    }

    /// Rows at that point.
    pub fn constraints(&self) -> &[f64] {
        &self.v.c
    }

    /// Sizes `[m]` of the terms of the rows at that point to first order, `Σ |J_ij x_j|`: times `ε` the rounding of their values.
    pub fn row_terms(&self, terms: &mut [f64]) {
        row_terms(&self.jac, &self.v.jac, &self.it.x, terms);
    }

    /// Bounds of the last solve, with `σ` where it ended.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The level the last solve ended at.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Work and time of the last solve.
    pub fn statistics(&self) -> &Statistics {
        &self.stats
    }

    /// Structure and work of the factorisations so far, those of a restoration phase left out.
    pub fn linear_statistics(&self) -> LinearStats {
        self.system.stats()
    }

    /// Marks the lines of the log.
    pub fn set_phase(&mut self, phase: u8) {
        self.phase = phase;
    }

    /// Solves from `start` under `bounds`. The point, its residuals and the statistics are then available.
    pub fn solve(
        &mut self,
        nlp: &mut dyn Nlp,
        bounds: &Bounds,
        start: Start,
        continuation: &mut dyn Continuation,
        control: &mut Control,
    ) -> Outcome {
        self.run(nlp, bounds, start, continuation, control, None)
    }

    pub(super) fn run(
        &mut self,
        nlp: &mut dyn Nlp,
        bounds: &Bounds,
        start: Start,
        continuation: &mut dyn Continuation,
        control: &mut Control,
        mut probe: Option<Probe>,
    ) -> Outcome {
        let clock = Instant::now();
        self.stats = Statistics::default();
        let base = self.system.factorisations();
        let outcome = control.within(f64::INFINITY, |control| {
            let outcome = self.iterate_to_end(nlp, bounds, start, continuation, control, &mut probe);
            ended_by(outcome)
        });
        self.stats.factorisations += self.system.factorisations() - base;
        self.stats.time_total = clock.elapsed().as_secs_f64();
        outcome
    }

    fn iterate_to_end(
        &mut self,
        nlp: &mut dyn Nlp,
        bounds: &Bounds,
        start: Start,
        continuation: &mut dyn Continuation,
        control: &mut Control,
        probe: &mut Option<Probe>,
    ) -> Outcome {
        self.bounds.copy_from(bounds);
        self.level = continuation.start();
        nlp.set_level(self.level.sigma, self.level.mu);
        self.relaxed = continuation.relaxed_rows();
        self.relax(self.relaxed.clone());
        self.shape.classify(&self.bounds);
        self.system.restart();
        self.system.demand_rows(self.settings.exact_rows);
        if !self.initialise(nlp, start) {
            return Outcome::Failed;
        }
        self.forget_filter();
        self.info = IterationInfo { alpha_pr: 1.0, ..IterationInfo::default() };
        self.left.copy_from(&self.it);
        self.x_start = 1.0 + self.it.x.iter().fold(0f64, |a, v| a.max(v.abs()));
        self.falling = 0;
        (self.f_before, self.fall_before) = (0.0, 0.0);
        let (mut jams, mut tiny_steps, mut standing, mut rooms) = (0, 0, 0, 0);
        let mut saddle = Watch::default();
        loop {
            let mut m = self.measure(nlp);
            self.fill_info(nlp, &m);
            if let Some(stop) = control.check(&self.info) {
                return stop;
            }
            loop {
                match continuation.advance(&m) {
                    // a solution is not given up for want of iterations
                    Advance::Done
                        if self.phase != b'p'
                            && self.stats.iterations < self.settings.max_iter
                            && !allowance::is_over()
                            && saddle.ends(self.system.delta_w) =>
                    {
                        if !self.disturb(nlp, saddle.disturbed) {
                            return Outcome::Failed;
                        }
                        break;
                    }
                    Advance::Done => return Outcome::Solved,
                    Advance::GiveUp => return Outcome::Stalled,
                    Advance::Stay => break,
                    Advance::Back(level) => {
                        if !self.go_back(nlp) || !self.change_level(nlp, level, continuation.relaxed_rows()) {
                            return Outcome::Failed;
                        }
                        m = self.measure(nlp);
                    }
                    Advance::Renew => {
                        if !self.change_level(nlp, self.level, continuation.relaxed_rows()) {
                            return Outcome::Failed;
                        }
                        self.renew_multipliers();
                        self.left.copy_from(&self.it);
                        m = self.measure(nlp);
                    }
                    Advance::To(level) => {
                        self.left.copy_from(&self.it);
                        let raised = level.mu > self.level.mu && continuation.recentres();
                        if raised && !self.recentre(nlp, level.mu) {
                            return Outcome::Failed;
                        }
                        if !self.change_level(nlp, level, continuation.relaxed_rows()) {
                            return Outcome::Failed;
                        }
                        m = self.measure(nlp);
                    }
                }
            }
            if self.diverges(&m) {
                return Outcome::Diverging;
            }
            if self.stats.iterations >= self.settings.max_iter || allowance::is_over() {
                return Outcome::MaxIter;
            }
            self.info.phase = self.phase;
            let searched =
                if self.direction(nlp, continuation.corrects()) { self.line_search(nlp) } else { Search::Jammed };
            if let Some(why) = stop::requested().filter(|_| !matches!(searched, Search::Accepted)) {
                return why.into();
            }
            let tiny = matches!(searched, Search::Accepted) && self.info.alpha_pr < TINY_STEP;
            tiny_steps = if tiny { tiny_steps + 1 } else { 0 };
            standing = if self.stands(&searched, &m) { standing + 1 } else { 0 };
            let step = matches!(searched, Search::Accepted).then_some(self.info.alpha_pr);
            let at_saddle = saddle.sees(step, self.system.delta_w, m.dual);
            let lost = tiny_steps > TINY_STEPS
                && self.settings.restore_tiny
                && self.settings.restoration
                && m.primal > 1e-4
                && jams < 20;
            match searched {
                Search::Accepted if lost => {
                    tiny_steps = 0;
                    jams += 1;
                    let m = self.measure(nlp);
                    if let Some(end) = self.restore(nlp, control, &m) {
                        return end;
                    }
                    self.info.phase = b'r';
                }
                _ if self.fatal => return Outcome::Failed,
                Search::Accepted if standing >= STANDING_STEPS && rooms < ROOMS => {
                    (standing, rooms) = (0, rooms + 1);
                    self.make_room(nlp, continuation.relaxed_rows());
                }
                Search::Accepted if at_saddle => {
                    if !self.disturb(nlp, saddle.disturbed) {
                        return Outcome::Failed;
                    }
                }
                Search::Accepted => {
                    if probe.as_mut().is_some_and(|p| p(&self.it.x)) {
                        return Outcome::Solved;
                    }
                }
                Search::Fatal => return Outcome::Failed,
                Search::Jammed => {
                    if self.soft_step(nlp) {
                        self.info.phase = b's';
                    } else if let Some(level) = continuation.jammed(&m) {
                        self.info.phase = b'j';
                        if !self.go_back(nlp) || !self.change_level(nlp, level, continuation.relaxed_rows()) {
                            return Outcome::Failed;
                        }
                    } else if self.settings.restoration && jams < 20 {
                        jams += 1;
                        if let Some(end) = self.restore(nlp, control, &m) {
                            return end;
                        }
                        self.info.phase = b'r';
                    } else {
                        return Outcome::Stalled;
                    }
                }
            }
            self.stats.iterations += 1;
            allowance::spend(1);
            self.stats.max_delta_w = self.stats.max_delta_w.max(self.system.delta_w);
        }
    }

    fn relax(&mut self, rows: Range<usize>) {
        for i in rows {
            self.bounds.cu[i] = self.level.sigma;
        }
    }

    pub(super) fn evaluate(&mut self, nlp: &mut dyn Nlp) -> bool {
        let clock = Instant::now();
        self.stats.evaluations += 1;
        let r = nlp.eval(&self.it.x, &mut self.v.c);
        self.stats.time_eval += clock.elapsed().as_secs_f64();
        self.torn[0] = r == Err(EvalError::Stopped);
        match r {
            Ok(f) => {
                self.v.f = f;
                f.is_finite()
            }
            Err(_) => {
                if self.torn[0] {
                    self.v.f = f64::NAN;
                }
                false
            }
        }
    }

    pub(super) fn differentiate(&mut self, nlp: &mut dyn Nlp) -> bool {
        let clock = Instant::now();
        let r = nlp.derivatives(&self.it.x, &mut self.v.grad, &mut self.v.jac);
        self.stats.time_eval += clock.elapsed().as_secs_f64();
        self.torn[1] = r == Err(EvalError::Stopped);
        r.is_ok()
    }

    pub(super) fn errors<const N: usize>(&self, mu: [f64; N]) -> [KktError; N] {
        kkt_error(&self.shape, &self.bounds, &self.it, &self.v.c, &self.lag, mu)
    }

    pub(super) fn measure(&mut self, nlp: &dyn Nlp) -> Measures {
        lagrangian_gradient(&self.shape, &self.jac, &self.v, &self.it.y, &mut self.lag);
        let [e, e0] = self.errors([self.level.mu, 0.0]);
        Measures {
            level: self.level,
            error: e.scaled(),
            error0: e0.scaled(),
            primal: e.primal,
            dual: e.dual / e.s_d,
            pair_product: self.pair_product(nlp),
            rounding: rounding(&self.jac, &self.v.jac, &self.it.x, &mut self.residual),
            alpha: self.info.alpha_pr,
            shift: self.system.delta_w,
            pair_min: self.pair_min(nlp),
            elastic: nlp.elastic(&self.it.x),
            pull: self.level.sigma * self.relaxed.clone().map(|i| self.it.vu[i]).sum::<f64>(),
        }
    }

    /// Back to the point where the last level was left.
    fn go_back(&mut self, nlp: &mut dyn Nlp) -> bool {
        self.it.copy_from(&self.left);
        self.evaluate(nlp) && self.differentiate(nlp)
    }

    fn pair_product(&self, nlp: &dyn Nlp) -> f64 {
        nlp.bilinear().iter().map(|p| self.it.x[p.a] * self.it.x[p.b]).fold(0.0, f64::max)
    }

    fn pair_min(&self, nlp: &dyn Nlp) -> f64 {
        nlp.bilinear().iter().map(|p| self.it.x[p.a].min(self.it.x[p.b])).fold(0.0, f64::max)
    }

    /// Scaled error of the optimality conditions at `μ = 0`, at the point reached.
    pub fn error(&mut self) -> f64 {
        lagrangian_gradient(&self.shape, &self.jac, &self.v, &self.it.y, &mut self.lag);
        self.errors([0.0])[0].scaled()
    }

    /// Unscaled residuals at the point reached; NaN where the solve was asked to end before they were known.
    pub fn residuals(&mut self, nlp: &dyn Nlp) -> Residuals {
        lagrangian_gradient(&self.shape, &self.jac, &self.v, &self.it.y, &mut self.lag);
        let [e] = self.errors([0.0]);
        let known = |torn: bool, v: f64| if torn { f64::NAN } else { v };
        Residuals {
            primal: known(self.torn[0], e.primal),
            dual: known(self.torn[0] || self.torn[1], e.dual),
            complementarity: e.compl,
            pair_product: self.pair_product(nlp),
            pair_min: self.pair_min(nlp),
        }
    }

    fn fill_info(&mut self, nlp: &dyn Nlp, m: &Measures) {
        let i = &mut self.info;
        i.iter = self.settings.first_iteration + self.stats.iterations;
        i.objective = self.v.f / nlp.objective_scale();
        i.inf_pr = m.primal;
        i.inf_du = m.dual;
        i.mu = m.level.mu;
        i.sigma = m.level.sigma;
        i.inf_cc = m.pair_product;
        i.delta_w = self.system.delta_w;
    }

    /// Moves to another barrier problem; slacks of rows whose bound moved follow it. False when functions that
    /// depend on the level have no value there.
    fn change_level(&mut self, nlp: &mut dyn Nlp, level: Level, rows: Range<usize>) -> bool {
        self.level = level;
        if nlp.set_level(level.sigma, level.mu) && !(self.evaluate(nlp) && self.differentiate(nlp)) {
            return false;
        }
        for i in rows {
            if self.shape.row[i] != RowKind::Inequality {
                continue;
            }
            self.bounds.cu[i] = level.sigma;
            // the distance that keeps this row on the central path with its present multiplier, as far as that is a
            // distance in double precision
            let gap = (level.mu / self.it.vu[i].max(1e-300)).min(0.9 * level.sigma).max(tiny_gap(level.sigma));
            self.it.s[i] = self.v.c[i].min(level.sigma - gap);
            let dist = level.sigma - self.it.s[i];
            self.it.vu[i] = clamp_multiplier(self.it.vu[i], dist, level.mu);
        }
        self.forget_filter();
        true
    }

    /// What was reached before does not count any more.
    pub(super) fn forget_filter(&mut self) {
        self.filter.reset(theta(&self.shape, &self.it.s, &self.v.c), self.settings.theta_room);
    }

    /// Was the last step cut short to next to nothing, where the rows are satisfied and only the multipliers are not?
    fn stands(&self, searched: &Search, before: &Measures) -> bool {
        let size = self.it.x.iter().fold(1.0f64, |a, v| a.max(v.abs()));
        let IterationInfo { alpha_pr, step, .. } = self.info;
        let cut = matches!(searched, Search::Accepted) && alpha_pr < 1.0 && alpha_pr * step <= STANDING * size;
        cut && before.primal <= 10.0 * ROOM && before.dual > before.primal
    }

    /// Moves the bounds that the point is closer to than `ROOM` outwards. Where constraints leave no room between their
    /// bounds (an equation that puts a state on its bound, say) there is no point inside of them, distances shrink to
    /// rounding, and multipliers grow without limit. Bounds of pairs and of relaxed rows stay: they have their own
    /// relaxation.
    fn make_room(&mut self, nlp: &dyn Nlp, relaxed: Range<usize>) {
        let Ipm { it, bounds: b, shape: sh, level, stats, .. } = self;
        let mut paired = vec![false; it.x.len()];
        for p in nlp.bilinear() {
            (paired[p.a], paired[p.b]) = (true, true);
        }
        // the bound `b`, on the side `out` of the value `v`, with its multiplier `z`
        let mut move_out = |v: f64, b: &mut f64, z: &mut f64, out: f64| {
            let room = ROOM * b.abs().max(1.0);
            if out * (*b - v) < room {
                stats.moved_bounds += 1;
                *b += out * room;
                *z = level.mu / (out * (*b - v));
            }
        };
        for j in (0..it.x.len()).filter(|j| !paired[*j]) {
            if sh.has_xl[j] {
                move_out(it.x[j], &mut b.xl[j], &mut it.zl[j], -1.0);
            }
            if sh.has_xu[j] {
                move_out(it.x[j], &mut b.xu[j], &mut it.zu[j], 1.0);
            }
        }
        for i in (0..it.s.len()).filter(|i| !relaxed.contains(i)) {
            if sh.has_cl[i] {
                move_out(it.s[i], &mut b.cl[i], &mut it.vl[i], -1.0);
            }
            if sh.has_cu[i] {
                move_out(it.s[i], &mut b.cu[i], &mut it.vu[i], 1.0);
            }
        }
        self.estimate_multipliers();
        self.forget_filter();
    }

    /// Newton direction of the barrier problem; `centre`: corrected where it is cut short.
    fn direction(&mut self, nlp: &mut dyn Nlp, centre: bool) -> bool {
        let clock = Instant::now();
        let hessian = nlp.hessian(&self.it.x, 1.0, &self.it.y, &mut self.v.hess);
        self.fatal = matches!(hessian, Err(EvalError::Fatal(_) | EvalError::Stopped));
        let evaluated = clock.elapsed().as_secs_f64();
        self.stats.time_eval += evaluated;
        if hessian.is_err() {
            return false;
        }
        let Ipm { system, shape, bounds, it, v, residual, .. } = self;
        system.assemble(shape, bounds, it, v, true);
        for i in 0..it.s.len() {
            residual[i] = if shape.row[i] == RowKind::Free { 0.0 } else { v.c[i] - it.s[i] };
        }
        let mut ok = system.factor(shape, bounds, it, self.level.mu, self.settings.convexify_pairs)
            && self.solve_direction(false);
        if ok && self.step_is_absurd() {
            // dependent rows: only with a perturbed dual block does the step stay with the problem
            ok = self.system.factor_dependent(self.level.mu) && self.solve_direction(false);
        }
        self.corrected = ok && centre && self.correct_centrality();
        self.stats.time_linalg += clock.elapsed().as_secs_f64() - evaluated;
        ok
    }

    /// Do the iterates go to infinity? Either they are there, or the objective has been falling without end along
    /// full steps through points that are as good as feasible.
    fn diverges(&mut self, m: &Measures) -> bool {
        let largest = self.it.x.iter().fold(0f64, |a, v| a.max(v.abs()));
        let fall = self.f_before - self.v.f;
        let falling = self.v.f < 0.0 && fall > 0.0 && (fall >= -FALL * self.f_before || fall >= 0.9 * self.fall_before);
        self.fall_before = fall;
        let far = largest > FAR * self.x_start && m.primal <= 1e-6 * largest;
        self.falling = if falling && far && m.alpha > 0.9 { self.falling + 1 } else { 0 };
        self.f_before = self.v.f;
        largest > 1e20 || self.falling >= 8
    }

    /// Is the step out of all proportion to the point?
    pub(super) fn step_is_absurd(&self) -> bool {
        let largest = |v: &[f64]| v.iter().fold(0f64, |a, v| a.max(v.abs()));
        largest(&self.dx) > ABSURD * (1.0 + largest(&self.it.x))
    }

    /// Solves with the present factor for the violation in `residual`; `soc` writes only the primal part.
    pub(super) fn solve_direction(&mut self, soc: bool) -> bool {
        let mu = self.level.mu;
        let Ipm { system, shape, bounds: b, it, lag, residual, n, offsets: o, .. } = self;
        for j in 0..*n {
            let mut r = -lag[j];
            if shape.has_xl[j] {
                r += (mu + o.xl[j]) / (it.x[j] - b.xl[j]);
            }
            if shape.has_xu[j] {
                r -= (mu + o.xu[j]) / (b.xu[j] - it.x[j]);
            }
            system.rhs[j] = if shape.fixed[j] { 0.0 } else { r };
        }
        for i in 0..residual.len() {
            system.rhs[*n + i] = match shape.row[i] {
                RowKind::Free => 0.0,
                RowKind::Equality => -residual[i],
                RowKind::Inequality => -residual[i] - slack_gradient(shape, b, it, i, mu, o) / sigma_s(shape, b, it, i),
            };
        }
        if !system.solve() {
            return false;
        }
        let (dx, ds) = if soc { (&mut self.dx_soc, &mut self.ds_soc) } else { (&mut self.dx, &mut self.ds) };
        dx.copy_from_slice(&system.sol[..*n]);
        let dy = &system.sol[*n..];
        for i in 0..residual.len() {
            ds[i] = if shape.row[i] == RowKind::Inequality {
                (dy[i] - slack_gradient(shape, b, it, i, mu, o)) / sigma_s(shape, b, it, i)
            } else {
                0.0
            };
        }
        if soc {
            return true;
        }
        self.trial.y.copy_from_slice(dy);
        for j in 0..*n {
            self.dzl[j] = multiplier_step(shape.has_xl[j], it.zl[j], it.x[j] - b.xl[j], dx[j], mu + o.xl[j]);
            self.dzu[j] = multiplier_step(shape.has_xu[j], it.zu[j], b.xu[j] - it.x[j], -dx[j], mu + o.xu[j]);
        }
        for i in 0..residual.len() {
            self.dvl[i] = multiplier_step(shape.has_cl[i], it.vl[i], it.s[i] - b.cl[i], ds[i], mu + o.cl[i]);
            self.dvu[i] = multiplier_step(shape.has_cu[i], it.vu[i], b.cu[i] - it.s[i], -ds[i], mu + o.cu[i]);
        }
        true
    }

    /// Writes the multipliers of fixed variables into `z`, which may stop short of the last variables: what is left of
    /// the gradient of the Lagrangian.
    pub fn fixed_multipliers(&self, z: &mut [f64]) {
        for j in (0..z.len()).filter(|&j| self.shape.fixed[j]) {
            let rows = self.jac.range(j).map(|k| self.v.jac[k] * self.it.y[self.jac.row_idx()[k]]);
            z[j] = self.v.grad[j] + rows.sum::<f64>();
        }
    }
}

/// Sizes of the terms of the rows, `Σ |J_ij x_j|`.
fn row_terms(jac: &Pattern, values: &[f64], x: &[f64], terms: &mut [f64]) {
    terms.fill(0.0);
    for (j, x) in x.iter().enumerate() {
        for k in jac.range(j) {
            terms[jac.row_idx()[k]] += (values[k] * x).abs();
        }
    }
}

/// Rounding error of the rows: the largest sum of terms times `ε`; `work[m]` is overwritten.
fn rounding(jac: &Pattern, values: &[f64], x: &[f64], work: &mut [f64]) -> f64 {
    row_terms(jac, values, x, work);
    4.0 * f64::EPSILON * work.iter().fold(0f64, |a, v| a.max(*v))
}

/// Gradient of the barrier Lagrangian in the slack of row `i`, whose bounds have parameters of their own.
#[inline]
fn slack_gradient(shape: &Shape, b: &Bounds, it: &Iterate, i: usize, mu: f64, o: &Offsets) -> f64 {
    let mut g = -it.y[i];
    if shape.has_cl[i] {
        g -= (mu + o.cl[i]) / (it.s[i] - b.cl[i]);
    }
    if shape.has_cu[i] {
        g += (mu + o.cu[i]) / (b.cu[i] - it.s[i]);
    }
    g
}

#[inline]
fn multiplier_step(has: bool, z: f64, dist: f64, d_dist: f64, mu: f64) -> f64 {
    if has {
        (mu - z * d_dist) / dist - z
    } else {
        0.0
    }
}
