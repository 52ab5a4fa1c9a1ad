//! The linearised problem at a point of an MPCC, (2.29) with a trust region.
//!
//! ```text
//! min ∇fᵀd   s.t.   rows and bounds, linearised,   |d|_∞ ≤ ρ,   signs of d at the members of biactive pairs
//! ```
//!
//! One structure serves every choice of signs, so the interior-point method analyses it once. Nothing is believed
//! because the method says so: every variable has two bounds, hence any multipliers of the rows give a lower bound of
//! the optimum (weak duality), and a step counts as a descent only if it is one after its own violation is paid for.

use super::certificate::{Local, HIDDEN};
use crate::error::Result;
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::{mul_add, mul_add_transposed, Pattern};
use crate::linalg::forest::{join, root};
use crate::linalg::kkt::LinearStats;
use crate::nlp::{within, Bounds, Control, Ipm, IpmSettings, Iterate, Monotone, Nlp, Outcome, Start, INFINITE};

/// Signs that a component of the step may have. The multiplier of its bound then has the polar signs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Signs {
    pub neg: bool,
    pub pos: bool,
}

impl Signs {
    /// Multiplier free.
    pub const ZERO: Signs = Signs { neg: false, pos: false };
    /// Multiplier not negative.
    pub const UP: Signs = Signs { neg: false, pos: true };
    /// Multiplier not positive.
    pub const DOWN: Signs = Signs { neg: true, pos: false };
    /// Multiplier zero.
    pub const FREE: Signs = Signs { neg: true, pos: true };

    fn and(self, o: Signs) -> Signs {
        Signs { neg: self.neg && o.neg, pos: self.pos && o.pos }
    }
}

/// Signs of the two members of a pair.
pub(super) type Piece = (Signs, Signs);

/// What is known of the optimum of a linear program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// `d = 0` is optimal: there are multipliers.
    Stationary,
    /// A feasible step lowers the objective.
    Descent,
    /// Neither could be shown.
    Unclear,
    /// There are no factorisations left.
    Spent,
    /// Interrupted, or out of time.
    Stopped,
}

/// Relaxation of the inequalities, which may have no interior otherwise, and first barrier parameter; the next attempt
/// is made when the one before shows nothing.
const ATTEMPTS: [(f64, f64); 3] = [(1e-9, 1e-1), (1e-8, 1.0), (1e-6, 1e-2)];
/// Iterations of an attempt.
const MAX_ITER: usize = 80;
/// Tolerance of the linear programs, whose data are of order one.
const LP_TOL: f64 = 1e-10;
/// Tolerance at which a first look is taken.
const ROUGH: f64 = 1e-4;
/// Distance from the bounds, relative, that the point found with [`ROUGH`] is kept at.
const WARM_PUSH: f64 = 1e-12;
/// Rows whose gradient is below this are none to first order.
const NO_ROW: f64 = 1e-12;

/// Share of a multiplier that is known well enough.
const DIGITS: f64 = 1e-3;

/// Linear program in the units of the trust region; objective and rows have gradients of maximum norm 1.
struct Linear {
    jac: Pattern,
    hess: Pattern,
    grad: Vec<f64>,
    values: Vec<f64>,
}

impl Nlp for Linear {
    fn n(&self) -> usize {
        self.jac.n_cols()
    }
    fn m(&self) -> usize {
        self.jac.n_rows()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        c.fill(0.0);
        mul_add(&self.jac, &self.values, x, c, 1.0);
        Ok(dot(&self.grad, x))
    }
    fn derivatives(&mut self, _: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        grad.copy_from_slice(&self.grad);
        jac.copy_from_slice(&self.values);
        Ok(())
    }
    fn hessian(&mut self, _: &[f64], _: f64, _: &[f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

/// The linearised problem, its solver, and the multipliers or the step found last.
pub(super) struct Lpcc {
    lp: Linear,
    ipm: Ipm,
    /// Bounds of the step; members of biactive pairs have the widest that any piece allows.
    widest: Bounds,
    /// With the signs of the present piece.
    bounds: Bounds,
    relaxed: Bounds,
    /// Lower bound of a member of a biactive pair that may not fall: what is left of it.
    floor: Vec<f64>,
    rough: Iterate,
    row_scale: Vec<f64>,
    /// Distances that count as none, of the bounds of the variables and of the rows, in units of the trust region.
    none: (Vec<f64>, Vec<f64>),
    /// Is what they may hide to be counted? Where multipliers of a type are looked for, the type is that of the point without them.
    pub exact: bool,
    grad_scale: f64,
    tol: f64,
    rho: f64,
    origin: Vec<f64>,
    activity: Vec<f64>,
    signs: Vec<Signs>,
    /// Part of every variable, see [`Lpcc::split`]; before, a forest over variables and rows.
    part: Vec<usize>,
    /// Number of the part with a root, while parts are numbered.
    number: Vec<usize>,
    /// Step `[n]` of the last program, in units of the trust region.
    pub step: Vec<f64>,
    /// Multipliers of the rows `[m]`, in the units of the MPCC.
    pub y: Vec<f64>,
    /// Multipliers of the bounds and of the members of pairs `[n]`, lower minus upper.
    pub z: Vec<f64>,
    /// Programs solved.
    pub lps: usize,
    /// Interior-point iterations in them.
    pub iterations: usize,
    /// Factorisations in them, and how many there may be.
    pub factorisations: usize,
    max_factorisations: usize,
}

impl Lpcc {
    /// Allocates for Jacobians with the pattern `jac`, `m × n`.
    pub fn new(jac: &Pattern) -> Result<Lpcc> {
        let (m, n) = (jac.n_rows(), jac.n_cols());
        let lp =
            Linear { jac: jac.clone(), hess: Pattern::empty(n, n), grad: vec![0.0; n], values: vec![0.0; jac.nnz()] };
        let settings = IpmSettings { max_iter: MAX_ITER, restoration: false, ..IpmSettings::default() };
        Ok(Lpcc {
            ipm: Ipm::new(&lp, settings)?,
            lp,
            widest: Bounds::free(n, m),
            bounds: Bounds::free(n, m),
            relaxed: Bounds::free(n, m),
            floor: vec![0.0; n],
            rough: Iterate::zeros(n, m),
            row_scale: vec![1.0; m],
            none: (vec![0.0; n], vec![0.0; m]),
            exact: true,
            grad_scale: 1.0,
            tol: 0.0,
            rho: 1.0,
            origin: vec![0.0; n],
            activity: vec![0.0; m],
            signs: vec![Signs::FREE; n],
            part: vec![0; n + m],
            number: vec![0; n + m],
            step: vec![0.0; n],
            y: vec![0.0; m],
            z: vec![0.0; n],
            lps: 0,
            iterations: 0,
            factorisations: 0,
            max_factorisations: usize::MAX,
        })
    }

    /// Counts from here.
    pub fn begin(&mut self) {
        (self.lps, self.iterations, self.factorisations) = (0, 0, 0);
    }

    /// Allows so many factorisations since [`Lpcc::begin`].
    pub fn allow(&mut self, factorisations: usize) {
        self.max_factorisations = factorisations;
    }

    /// Are there no factorisations left?
    pub fn is_spent(&self) -> bool {
        self.factorisations >= self.max_factorisations
    }

    /// Structure and work of the factorisations.
    pub fn linear_statistics(&self) -> LinearStats {
        self.ipm.linear_statistics()
    }

    /// Linearises at a point. Distances up to `active` from a bound count as none; `tol` is the violation of the
    /// stationarity conditions that is allowed, in the units of the gradient, which is not zero.
    pub fn load(&mut self, p: &Local, active: f64, tol: f64, rho: f64) {
        self.rho = rho;
        self.grad_scale = p.grad.iter().fold(0f64, |a, g| a.max(g.abs()));
        self.tol = tol / self.grad_scale;
        for (s, g) in self.lp.grad.iter_mut().zip(p.grad) {
            *s = g / self.grad_scale;
        }
        self.row_scale.fill(0.0);
        for (v, &i) in p.jac_values.iter().zip(p.jac.row_idx()) {
            self.row_scale[i] = self.row_scale[i].max(v.abs());
        }
        for ((s, v), &i) in self.lp.values.iter_mut().zip(p.jac_values).zip(p.jac.row_idx()) {
            let scale = self.row_scale[i];
            *s = if scale > NO_ROW { v / scale } else { 0.0 };
        }
        let room = |distance: f64| if distance <= active { 0.0 } else { distance / rho };
        let none = |distance: f64| if distance <= active { distance.abs() / rho } else { 0.0 };
        for j in 0..p.x.len() {
            let b = p.bounds;
            self.none.0[j] = none(p.x[j] - b.xl[j]).max(none(b.xu[j] - p.x[j]));
            let fixed = b.xl[j] == b.xu[j];
            self.widest.xl[j] = if fixed { 0.0 } else { -room(p.x[j] - b.xl[j]).min(1.0) };
            self.widest.xu[j] = if fixed { 0.0 } else { room(b.xu[j] - p.x[j]).min(1.0) };
        }
        // a member of a pair that may not fall below zero can still lose what is left of it
        self.floor.copy_from_slice(&self.widest.xl);
        self.activity.fill(0.0);
        for (v, &i) in self.lp.values.iter().zip(p.jac.row_idx()) {
            self.activity[i] += v.abs();
        }
        for i in 0..p.c.len() {
            let (lo, hi, scale) = (p.bounds.cl[i], p.bounds.cu[i], self.row_scale[i]);
            self.none.1[i] = match (p.c[i] - lo, hi - p.c[i]) {
                _ if scale <= NO_ROW => 0.0,
                (below, _) if lo == hi => below.abs() / scale / rho,
                (below, above) => none(below / scale).max(none(above / scale)),
            };
            let room = |distance: f64, absent: bool| match room(distance / scale) {
                r if absent || scale <= NO_ROW || r > self.activity[i] => f64::INFINITY,
                r => r,
            };
            self.widest.cl[i] = -room(p.c[i] - lo, lo <= -INFINITE);
            self.widest.cu[i] = room(hi - p.c[i], hi >= INFINITE);
            if lo == hi && scale > NO_ROW {
                self.widest.cl[i] = 0.0;
                self.widest.cu[i] = 0.0;
            }
        }
        self.signs.fill(Signs::FREE);
    }

    /// Variable `j` is zero whatever its neighbours do: its multiplier is free.
    pub fn pin(&mut self, j: usize) {
        self.widest.xl[j] = 0.0;
        self.widest.xu[j] = 0.0;
    }

    /// Variable `j` is a member of a biactive pair: its bounds below are those of the pieces.
    pub fn unpin(&mut self, j: usize) {
        self.widest.xl[j] = -1.0;
    }

    /// Splits the problem into parts that share no variable, row or pair, and returns their number. Part 0 is all that
    /// has no pair.
    pub fn split(&mut self, members: &[(usize, usize)]) -> usize {
        let n = self.lp.n();
        let Lpcc { part, number, widest: b, lp, .. } = self;
        part.iter_mut().enumerate().for_each(|(v, p)| *p = v);
        for j in (0..n).filter(|&j| b.xl[j] < b.xu[j]) {
            for k in lp.jac.range(j) {
                let i = lp.jac.row_idx()[k];
                let takes_part = b.cl[i] > f64::NEG_INFINITY || b.cu[i] < f64::INFINITY;
                if takes_part && lp.values[k] != 0.0 {
                    join(part, j, n + i);
                }
            }
        }
        for &(a, b) in members {
            join(part, a, b);
        }
        for v in 0..part.len() {
            part[v] = root(part, v);
        }
        number.fill(0);
        let mut count = 0;
        for &(a, _) in members {
            if number[part[a]] == 0 {
                count += 1;
                number[part[a]] = count;
            }
        }
        part.iter_mut().for_each(|p| *p = number[*p]);
        count + 1
    }

    /// Part of a variable.
    pub fn part(&self, j: usize) -> usize {
        self.part[j]
    }

    /// Solves with the signs `pieces` at the `members` of biactive pairs. A variable in several has all of their signs.
    /// Outside of the part `only`, if given, the step is zero.
    pub fn solve(
        &mut self,
        members: &[(usize, usize)],
        pieces: impl Fn(usize) -> Piece,
        only: Option<usize>,
        control: &mut Control,
    ) -> Verdict {
        for &(a, b) in members {
            self.signs[a] = Signs::FREE;
            self.signs[b] = Signs::FREE;
        }
        for (k, &(a, b)) in members.iter().enumerate() {
            let (sa, sb) = pieces(k);
            self.signs[a] = self.signs[a].and(sa);
            self.signs[b] = self.signs[b].and(sb);
        }
        self.bounds.copy_from(&self.widest);
        for &(a, b) in members {
            for j in [a, b] {
                if !self.signs[j].neg {
                    self.bounds.xl[j] = self.floor[j];
                }
                if !self.signs[j].pos {
                    self.bounds.xu[j] = 0.0;
                }
            }
        }
        if let Some(only) = only {
            for j in (0..self.lp.n()).filter(|&j| self.part[j] != only) {
                self.bounds.xl[j] = 0.0;
                self.bounds.xu[j] = 0.0;
            }
        }
        for (slack, mu) in ATTEMPTS {
            self.relax(slack);
            self.lps += 1;
            // a descent shows long before the last digits do
            for (mu, tol, margin) in [(mu, ROUGH, 1e6), (0.1 * ROUGH, LP_TOL, 10.0)] {
                if self.is_spent() {
                    return Verdict::Spent;
                }
                self.ipm.settings_mut().max_iter = MAX_ITER.min(self.max_factorisations - self.factorisations);
                let mut rule = Monotone { mu_init: mu, tol, primal_tol: LP_TOL };
                let start = if tol == ROUGH { Start::Cold(&self.origin) } else { Start::Warm(&self.rough, WARM_PUSH) };
                let (ipm, lp, bounds) = (&mut self.ipm, &mut self.lp, &self.relaxed);
                let outcome = control.in_phase(b'c', |control| ipm.solve(lp, bounds, start, &mut rule, control));
                self.iterations += self.ipm.statistics().iterations;
                self.factorisations += self.ipm.statistics().factorisations;
                if matches!(outcome, Outcome::Stopped | Outcome::MaxTime) {
                    return Verdict::Stopped;
                }
                match self.judge(margin) {
                    Verdict::Unclear => self.rough.copy_from(self.ipm.iterate()),
                    verdict => return verdict,
                }
            }
        }
        Verdict::Unclear
    }

    /// Gives the inequalities that are active an interior.
    fn relax(&mut self, slack: f64) {
        let (b, r) = (&self.bounds, &mut self.relaxed);
        let sides = [(&b.xl, &b.xu, &mut r.xl, &mut r.xu), (&b.cl, &b.cu, &mut r.cl, &mut r.cu)];
        for (lo, hi, rlo, rhi) in sides {
            for i in 0..lo.len() {
                let slack = if lo[i] == hi[i] { 0.0 } else { slack };
                rlo[i] = lo[i] - slack;
                rhi[i] = hi[i] + slack;
            }
        }
    }

    /// What the point of the interior-point method shows for the bounds that are not relaxed. A descent is `margin`
    /// times what its violation may be worth.
    fn judge(&mut self, margin: f64) -> Verdict {
        let it = self.ipm.iterate();
        if it.x.iter().chain(&it.y).any(|v| !v.is_finite()) {
            return Verdict::Unclear;
        }
        let b = &self.bounds;
        // `loss` is what slacks cost; a multiplier of a row that cannot become active is dropped
        let mut loss = 0.0;
        for i in 0..self.y.len() {
            let room = if it.y[i] > 0.0 { b.cu[i] } else { -b.cl[i] };
            self.y[i] = if room < 1.0 { it.y[i] } else { 0.0 };
            loss += self.y[i].abs() * room.min(1.0);
        }
        self.z.copy_from_slice(&self.lp.grad);
        mul_add_transposed(&self.lp.jac, &self.lp.values, &self.y, &mut self.z, 1.0);
        let mut residual = 0f64;
        for j in 0..self.z.len() {
            let room = if self.z[j] > 0.0 { -b.xl[j] } else { b.xu[j] };
            if room < 1.0 {
                loss += self.z[j].abs() * room;
            } else {
                residual = residual.max(self.z[j].abs());
                self.z[j] = 0.0;
            }
        }
        for (e, (x, (lo, hi))) in self.step.iter_mut().zip(it.x.iter().zip(b.xl.iter().zip(&b.xu))) {
            *e = within(*x, *lo, *hi);
        }
        self.activity.fill(0.0);
        mul_add(&self.lp.jac, &self.lp.values, &self.step, &mut self.activity, 1.0);
        let gain = -dot(&self.lp.grad, &self.step);
        let paid: f64 = (0..self.y.len())
            .map(|i| (1.0 + it.y[i].abs()) * (b.cl[i] - self.activity[i]).max(self.activity[i] - b.cu[i]).max(0.0))
            .sum();
        if residual.max(loss) <= self.tol && self.is_trusted() {
            for (y, s) in self.y.iter_mut().zip(&self.row_scale) {
                *y *= if *s > NO_ROW { self.grad_scale / s } else { 0.0 };
            }
            for z in &mut self.z {
                *z *= self.grad_scale;
            }
            Verdict::Stationary
        } else if gain > self.tol && gain > margin * paid {
            Verdict::Descent
        } else {
            Verdict::Unclear
        }
    }

    /// Is what rounding and distances that count as none may hide, multiplied by the multipliers, small beside the gradient?
    fn is_trusted(&self) -> bool {
        let (lp, y) = (&self.lp, &self.y);
        let terms = |j: usize| -> f64 {
            let rows: f64 = lp.jac.range(j).map(|k| (lp.values[k] * y[lp.jac.row_idx()[k]]).abs()).sum();
            rows + lp.grad[j].abs() + self.z[j].abs()
        };
        let worth = |none: &[f64], v: &[f64]| -> f64 { none.iter().zip(v).map(|(d, v)| d * v.abs()).sum() };
        let hidden = worth(&self.none.0, &self.z) + worth(&self.none.1, y);
        (hidden <= HIDDEN || !self.exact) && (0..lp.n()).all(|j| rounding_of(terms(j), self.z[j]) <= self.tol)
    }

    /// Writes the step of the last program in the units of the MPCC into `d[n]`.
    pub fn unscaled_step(&self, d: &mut [f64]) {
        for (d, e) in d.iter_mut().zip(&self.step) {
            *d = self.rho * e;
        }
    }
}

/// What rounding may leave of a component of the gradient of the Lagrangian: nothing where the multiplier `z` of its bound is
/// known to some digits, and so its sign.
fn rounding_of(terms: f64, z: f64) -> f64 {
    let rounding = f64::EPSILON * terms;
    if rounding <= DIGITS * z.abs() {
        0.0
    } else {
        rounding
    }
}

/// The largest of these at a point with multipliers.
pub(super) fn rounding(p: &Local) -> f64 {
    (0..p.x.len()).fold(0f64, |largest, j| {
        let rows: f64 = p.jac.range(j).map(|k| (p.jac_values[k] * p.y[p.jac.row_idx()[k]]).abs()).sum();
        largest.max(rounding_of(p.grad[j].abs() + p.z[j].abs() + rows, p.z[j]))
    })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
