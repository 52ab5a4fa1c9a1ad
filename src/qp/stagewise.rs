//! States kept: Newton steps by a Riccati recursion, for an active set and inside an interior-point method. All work is linear in the
//! number of stages.
//!
//! 1. *Active set.* With a guess of which constraints hold with equality the optimality conditions are linear; one Newton step solves
//!    them, and signs say what else the set should be (M. Hintermüller, K. Ito, K. Kunisch, *The primal-dual active set strategy as a semismooth
//!    Newton method*, 2003). From the set of the last sample this takes a few steps, each of which makes only the stages up to the last
//!    change anew. Active bounds of controls are eliminated; active rows have the weight `ρ_i` and multipliers that are corrected until the rows
//!    hold (M. J. D. Powell, *A method for nonlinear constraints in minimization problems*, 1969). It need not converge.
//! 2. *Interior point.* Where the set does not settle, a predictor-corrector method (S. Mehrotra, *On the implementation of a primal-dual
//!    interior point method*, 1992; G. Frison, M. Diehl, *HPIPM*, 2020) begins at the solution without constraints. As soon as two of its
//!    iterates point to the same active set, that one is the next guess (A. S. El-Bakry, R. A. Tapia, Y. Zhang, *A study of indicators for
//!    identifying zero variables in interior-point methods*, 1994).
//! 3. *Contradictions.* Multipliers of rows that contradict each other grow without bound. Rows with multipliers `y` cannot all be met if `yᵀ(a(z) − b)`
//!    is positive for all controls within their bounds (Farkas); that is verified by a sweep.
//!
//! A violation `s` at the price `p s + q s²` is eliminated from every step, so it costs no variable.

use super::riccati::{Blocks, Covariance, Recursion, Sweep, Weights};
use super::{Initial, QpSolution, QpSolver, QpStatus, StageQp, Terms};
use crate::error::Result;
use crate::linalg::dense::{axpy, dot, gemv_transposed};

/// A row counts as violated beyond this share of the size of its terms.
const FEASIBLE: f64 = 1e-10;
/// Weight of an active row times `aᵀ H⁻¹ a`: one over the share of its violation that a step leaves, and the digits that the step loses.
/// Corrections make up for both; the square root of the rounding unit balances them.
const STIFF: f64 = 6.7e7;
/// Steps of the set of the last sample without fewer changes than ever before. A factorisation of the interior point costs as much as such a
/// step.
const PATIENCE: usize = 1;
/// Corrections of active rows at most, where the set is settled.
const CORRECTIONS: usize = 4;
/// Steps of an active set, and iterations of the interior point, at most.
const MOST: usize = 60;
/// Share of the way to the boundary that a step goes (HPIPM, Mehrotra).
const BOUNDARY: f64 = 0.995;
/// The interior point has converged where products of slacks and multipliers are this share of what they were at the start.
const CLOSED: f64 = f64::EPSILON;
/// Where it can go no further, this share will do.
const NEARLY: f64 = 1e-11;
/// What is left of a certificate's components along free directions, relative to its terms.
const FREE: f64 = 1e-9;

/// What a constraint is at present.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Not active.
    Out,
    /// Holds with equality.
    In,
    /// Violated at its price.
    Beyond,
}

/// One bound of a constraint in the interior point: slack `t`, multiplier `λ`, violation `s` with its multiplier `ν`.
#[derive(Debug, Clone, Copy, Default)]
struct Side {
    on: bool,
    /// It may be violated, at a linear price, so that `s ≥ 0` has a multiplier.
    soft: bool,
    linear: bool,
    t: f64,
    lambda: f64,
    s: f64,
    nu: f64,
    /// What is left of `h + s − t = 0`, and of the derivative by `s`.
    gap: f64,
    slope: f64,
    /// The last step, and its products, for the corrector.
    dt: f64,
    dlambda: f64,
    ds: f64,
    dnu: f64,
    by_t: f64,
    by_s: f64,
}

impl Side {
    /// Second derivative by the violation, and its first one, of what is left of a step without the multiplier.
    fn stiffness(&self, quadratic: f64) -> f64 {
        2.0 * quadratic + if self.linear { self.nu / self.s } else { 0.0 }
    }

    fn push(&self) -> f64 {
        self.slope + if self.linear { self.by_s / self.s } else { 0.0 }
    }
}

/// How an attempt ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Solved,
    /// It leads nowhere.
    Stuck,
    Late,
    /// Rows contradict each other.
    Contradiction,
}

/// A method whose work is linear in the number of stages. All memory is taken when it is made.
pub struct Stagewise {
    n_u: usize,
    blocks: Blocks,
    /// Without constraints; with the weights `have`.
    free: Recursion,
    now: Recursion,
    have: Weights,
    want: Weights,
    /// No control is fixed.
    loose: Vec<bool>,
    sweep: Sweep,
    covariance: Covariance,
    /// How far constraints move for a unit of their multiplier: bounds of controls by themselves, rows with all controls.
    reach: Vec<f64>,
    ready: bool,
    /// The point `[(n + 1) · (nu + nx)]`, controls of a node first; gradient of the cost, gaps of the dynamics, values of rows there.
    z: Vec<f64>,
    g: Vec<f64>,
    c: Vec<f64>,
    values: Vec<f64>,
    has_gaps: bool,
    /// It is the solution of this program for another first state.
    is_solution: bool,
    /// Gradient of the Lagrangian without the dynamics.
    gy: Vec<f64>,
    /// Signed multipliers, and what Newton's equations take for them, bounds first.
    y: Vec<f64>,
    aim: Vec<f64>,
    state: Vec<State>,
    side: Vec<f64>,
    /// Prices of rows; infinite for those that may not be violated.
    linear: Vec<f64>,
    quadratic: Vec<f64>,
    /// Sides of the interior point, lower before upper, and how constraints move by a step.
    sides: Vec<Side>,
    dv: Vec<f64>,
    /// Active sets that the interior point has pointed to last, and that was tried last.
    pointed: Vec<i8>,
    tried: Vec<i8>,
    kept: Vec<f64>,
    kept_y: Vec<f64>,
    /// Values of rows at the solution without constraints, where they are known.
    free_values: Vec<f64>,
    u: Vec<f64>,
    cut: Vec<f64>,
    spread: [Vec<f64>; 2],
    iterations: usize,
    /// Stages that were factorised.
    stages: u64,
}

impl Stagewise {
    /// Room for programs of the size of `qp`.
    pub fn new(qp: &StageQp) -> Result<Stagewise> {
        let blocks = Blocks::new(qp);
        let (n, nx, w, rows) = (qp.n, qp.nx, blocks.w, qp.rows.len());
        let n_u = n * qp.nu;
        let zeros = |n: usize| vec![0.0; n];
        let all = n_u + rows;
        Ok(Stagewise {
            n_u,
            free: Recursion::new(&blocks),
            now: Recursion::new(&blocks),
            have: Weights::new(n_u, rows),
            want: Weights::new(n_u, rows),
            loose: vec![false; n_u],
            sweep: Sweep::new(&blocks),
            covariance: Covariance::new(&blocks),
            reach: zeros(all),
            ready: false,
            z: zeros((n + 1) * w),
            g: zeros((n + 1) * w),
            c: zeros(n * nx),
            values: zeros(rows),
            has_gaps: true,
            is_solution: false,
            gy: zeros((n + 1) * w),
            y: zeros(all),
            aim: zeros(all),
            state: vec![State::Out; all],
            side: vec![1.0; all],
            linear: vec![f64::INFINITY; rows],
            quadratic: zeros(rows),
            sides: vec![Side::default(); 2 * all],
            dv: zeros(all),
            pointed: vec![0; all],
            tried: vec![0; all],
            kept: zeros((n + 1) * w),
            kept_y: zeros(all),
            free_values: zeros(rows),
            u: zeros(n_u),
            cut: zeros(n_u),
            spread: [zeros(nx), zeros(nx)],
            iterations: 0,
            stages: 0,
            blocks,
        })
    }

    /// Where control `i` is in `z`.
    fn at(&self, i: usize) -> usize {
        i / self.blocks.nu * self.blocks.w + i % self.blocks.nu
    }

    fn bounds(&self, i: usize, qp: &StageQp) -> [f64; 2] {
        match i.checked_sub(self.n_u) {
            None => [qp.u_lower[i], qp.u_upper[i]],
            Some(r) => [qp.row_lower[r], qp.row_upper[r]],
        }
    }

    fn bound(&self, i: usize, qp: &StageQp) -> f64 {
        let [lower, upper] = self.bounds(i, qp);
        if self.side[i] > 0.0 {
            upper
        } else {
            lower
        }
    }

    /// Linear and quadratic price; infinite for bounds of controls.
    fn price(&self, i: usize) -> (f64, f64) {
        match i.checked_sub(self.n_u) {
            None => (f64::INFINITY, 0.0),
            Some(r) => (self.linear[r], self.quadratic[r]),
        }
    }

    /// Is it an equation that may not be violated?
    fn is_equation(&self, i: usize, qp: &StageQp) -> bool {
        let [lower, upper] = self.bounds(i, qp);
        lower == upper && self.price(i).0 == f64::INFINITY
    }

    fn value(&self, i: usize) -> f64 {
        match i.checked_sub(self.n_u) {
            None => self.z[self.at(i)],
            Some(r) => self.values[r],
        }
    }

    /// Size of the terms of a constraint.
    fn size(&self, i: usize, qp: &StageQp, largest: f64, bound: f64) -> f64 {
        let Some(r) = i.checked_sub(self.n_u) else { return largest + bound.abs() + qp.u_base[i] };
        let (w, k) = (self.blocks.w, qp.rows[r].node);
        let own = self.blocks.row(r).iter().zip(&self.z[k * w..(k + 1) * w]);
        own.map(|(a, z)| (a * z).abs()).sum::<f64>() + bound.abs() + qp.row_base[r]
    }

    fn largest_control(&self) -> f64 {
        (0..self.n_u).fold(0.0f64, |m, i| m.max(self.z[self.at(i)].abs()))
    }

    /// Prices, and what is active of the guess: bounds and prices may be gone.
    fn begin(&mut self, qp: &StageQp, terms: &Terms) {
        for (r, row) in qp.rows.iter().enumerate() {
            (self.linear[r], self.quadratic[r]) = match (row.price, terms.elastic) {
                (Some(p), _) => (p.linear, p.quadratic),
                (None, Some(price)) => (price, 0.0),
                (None, None) => (f64::INFINITY, 0.0),
            };
        }
        for i in 0..self.state.len() {
            if self.is_equation(i, qp) {
                self.state[i] = State::In;
            }
            if self.state[i] == State::Out {
                continue;
            }
            if !self.bound(i, qp).is_finite() {
                self.state[i] = State::Out;
            } else if self.state[i] == State::Beyond && !self.price(i).0.is_finite() {
                self.state[i] = State::In;
            }
            if i >= self.n_u && self.reach[i] == 0.0 {
                self.state[i] = State::Out;
            }
        }
    }

    /// Weights of the active set, and fixed controls to their bounds. Is it empty?
    fn place(&mut self, qp: &StageQp) -> bool {
        self.want.clear();
        let mut empty = true;
        for i in 0..self.state.len() {
            if self.state[i] == State::Out {
                continue;
            }
            empty = false;
            let bound = self.bound(i, qp);
            match (i.checked_sub(self.n_u), self.state[i]) {
                (None, _) => {
                    self.want.fixed[i] = true;
                    let at = self.at(i);
                    self.has_gaps |= self.z[at] != bound;
                    self.z[at] = bound;
                }
                (Some(r), State::Beyond) => self.want.rows[r] = 2.0 * self.quadratic[r],
                (Some(r), _) => self.want.rows[r] = STIFF / self.reach[i],
            }
        }
        empty
    }

    /// Gradient, values and gaps at the point.
    fn evaluate(&mut self, qp: &StageQp) {
        self.blocks.gradient(qp, &self.z, &mut self.g, &mut self.values);
        if self.has_gaps {
            self.blocks.gaps(qp, &self.z, &mut self.c);
        }
    }

    /// A Newton step to `sweep` for the multipliers in `aim`, with the factors of no constraints or those that are there.
    fn newton(&mut self, qp: &StageQp, x0: &[f64], empty: bool) {
        let (w, nu, n_u) = (self.blocks.w, self.blocks.nu, self.n_u);
        self.gy.copy_from_slice(&self.g);
        for i in 0..n_u {
            let at = self.at(i);
            self.gy[at] += self.aim[i];
        }
        for (r, row) in qp.rows.iter().enumerate() {
            let y = self.aim[n_u + r];
            if y != 0.0 {
                axpy(y, self.blocks.row(r), &mut self.gy[row.node * w..(row.node + 1) * w]);
            }
        }
        let (factors, fixed) = if empty { (&self.free, &self.loose) } else { (&self.now, &self.have.fixed) };
        let c = self.has_gaps.then_some(&self.c[..]);
        factors.back(&self.blocks, &self.gy, c, fixed, &mut self.sweep);
        let dx0 = &mut self.spread[0];
        dx0.iter_mut().zip(x0.iter().zip(&self.z[nu..w])).for_each(|(d, (x0, x))| *d = x0 - x);
        factors.forth(&self.blocks, qp, dx0, c, &mut self.sweep);
    }

    /// Factors with the weights that are wanted.
    fn factorise(&mut self, qp: &StageQp) -> bool {
        let nu = self.blocks.nu;
        let differs = |k: usize| {
            let (own, rows) = (k * nu..(k + 1) * nu, self.blocks.first[k]..self.blocks.first[k + 1]);
            let of_controls = k < qp.n
                && (self.want.fixed[own.clone()] != self.have.fixed[own.clone()]
                    || self.want.u[own.clone()] != self.have.u[own]);
            of_controls || self.want.rows[rows.clone()] != self.have.rows[rows]
        };
        if let Some(k) = (0..=qp.n).rev().find(|k| differs(*k)) {
            self.now.touch(k);
            self.have.copy_from(&self.want);
        }
        self.now.factorise(&self.blocks, &self.have, qp, &mut self.stages)
    }

    /// The active set, step by step, until so many steps have no fewer changes than ever before.
    fn settle(&mut self, qp: &StageQp, x0: &[f64], terms: &Terms, patience: usize) -> End {
        let (mut fewest, mut vain, mut corrections) = (usize::MAX, 0, 0);
        let mut known = false;
        for _ in 0..MOST {
            if self.iterations > 0 && terms.over(self.iterations) {
                return End::Late;
            }
            self.iterations += 1;
            let gaps_before = self.has_gaps;
            let empty = self.place(qp);
            if !known || (self.has_gaps && !gaps_before) {
                self.evaluate(qp);
            }
            self.aim_at_active(qp);
            if !empty && !self.factorise(qp) {
                return End::Stuck;
            }
            self.newton(qp, x0, empty);
            self.make_newton_step(qp);
            let stiff = self.state[self.n_u..].contains(&State::In);
            if !known && stiff {
                // a step from far away loses digits to the weights of rows, and signs with them: the next one is short
                self.aim_at_active(qp);
                self.newton(qp, x0, empty);
                self.make_newton_step(qp);
            }
            known = true;
            let Some((changes, open)) = self.revise(qp) else { return End::Contradiction };
            if changes == 0 {
                if !open && (corrections > 0 || !stiff) {
                    return End::Solved;
                }
                if corrections == CORRECTIONS {
                    return End::Stuck;
                }
                corrections += 1;
            } else if changes < fewest {
                (fewest, vain) = (changes, 0);
            } else {
                vain += 1;
                if vain > patience {
                    return End::Stuck;
                }
            }
        }
        End::Stuck
    }

    /// The step of `sweep`, and what is known at its end.
    fn make_newton_step(&mut self, qp: &StageQp) {
        axpy(1.0, &self.sweep.dz, &mut self.z);
        self.has_gaps = false;
        self.evaluate(qp);
        self.multipliers_of_active(qp);
    }

    /// What Newton's equations take for the multipliers of active rows.
    fn aim_at_active(&mut self, qp: &StageQp) {
        self.aim.fill(0.0);
        for i in self.n_u..self.state.len() {
            let r = i - self.n_u;
            let beyond = self.values[r] - self.bound(i, qp);
            self.aim[i] = match self.state[i] {
                State::Out => 0.0,
                State::In => self.y[i] + STIFF / self.reach[i] * beyond,
                State::Beyond => self.side[i] * self.linear[r] + 2.0 * self.quadratic[r] * beyond,
            };
        }
    }

    /// Multipliers after a step: those of rows from what Newton's equations took for them and how far the rows moved, since their values say
    /// no more than rounding times their weights; those of fixed controls from the gradient.
    fn multipliers_of_active(&mut self, qp: &StageQp) {
        let (nx, nu, w) = (self.blocks.nx, self.blocks.nu, self.blocks.w);
        for (r, row) in qp.rows.iter().enumerate() {
            let i = self.n_u + r;
            (self.y[i], self.dv[i]) = (self.aim[i], 0.0);
            if self.want.rows[r] != 0.0 {
                self.dv[i] = dot(self.blocks.row(r), &self.sweep.dz[row.node * w..(row.node + 1) * w]);
                self.y[i] += self.want.rows[r] * self.dv[i];
            }
        }
        for i in 0..self.n_u {
            self.y[i] = 0.0;
            if self.state[i] == State::Out {
                continue;
            }
            let (k, j) = (i / nu, i % nu);
            let f = self.blocks.f(k);
            let mut slope =
                self.g[k * w + j] + dot(&f.v[j * nx..(j + 1) * nx], &self.sweep.lambda[(k + 1) * nx..(k + 2) * nx]);
            for r in self.blocks.first[k]..self.blocks.first[k + 1] {
                slope += self.blocks.row(r)[j] * self.y[self.n_u + r];
            }
            self.y[i] = -slope;
        }
    }

    /// A row that is violated or not active, and never at its bound: nothing moves it, or small violations cost next to nothing.
    fn stays_beyond(&self, i: usize) -> bool {
        self.reach[i] == 0.0 || self.price(i).0 == 0.0
    }

    /// The next active set by the signs at the point: how many constraints change, and whether active rows are still to be corrected.
    /// Nothing where a row is violated that nothing can move.
    fn revise(&mut self, qp: &StageQp) -> Option<(usize, bool)> {
        let largest = self.largest_control();
        let (mut changes, mut open) = (0, false);
        for i in 0..self.state.len() {
            let ([lower, upper], v) = (self.bounds(i, qp), self.value(i));
            if self.state[i] == State::Out {
                let (beyond, side, bound) =
                    if v - upper > lower - v { (v - upper, 1.0, upper) } else { (lower - v, -1.0, lower) };
                if beyond.is_nan() || beyond <= 0.0 || beyond <= FEASIBLE * self.size(i, qp, largest, bound) {
                    continue;
                }
                self.side[i] = side;
                changes += 1;
                if self.reach[i] == 0.0 && self.price(i).0 == f64::INFINITY {
                    return None;
                }
                self.state[i] = if self.stays_beyond(i) { State::Beyond } else { State::In };
                continue;
            }
            let bound = self.bound(i, qp);
            let tolerance = FEASIBLE * self.size(i, qp, largest, bound);
            let beyond = self.side[i] * (v - bound);
            if self.state[i] == State::Beyond {
                if beyond < -tolerance {
                    self.state[i] = if self.stays_beyond(i) { State::Out } else { State::In };
                    self.y[i] = self.side[i] * self.linear[i - self.n_u];
                    changes += 1;
                }
                continue;
            }
            open |= i >= self.n_u && beyond.abs() > tolerance;
            if self.is_equation(i, qp) {
                continue;
            }
            let multiplier = self.side[i] * self.y[i];
            let (most, _) = self.price(i);
            if multiplier * self.reach[i] < -tolerance {
                // an equation with a price has two sides
                if lower == upper {
                    self.side[i] = -self.side[i];
                } else {
                    self.state[i] = State::Out;
                    self.y[i] = 0.0;
                }
                changes += usize::from(lower != upper || -multiplier > most);
                if lower == upper && -multiplier > most {
                    self.state[i] = State::Beyond;
                }
            } else if (multiplier - most) * self.reach[i] > tolerance {
                self.state[i] = State::Beyond;
                changes += 1;
            }
        }
        Some((changes, open))
    }

    /// The solution without constraints, and how far it violates them: the largest `v²/(aᵀ H⁻¹ a)`, in units of the cost.
    fn start(&mut self, qp: &StageQp, x0: &[f64]) -> f64 {
        self.z.fill(0.0);
        self.has_gaps = true;
        self.evaluate(qp);
        self.aim.fill(0.0);
        self.newton(qp, x0, true);
        self.z.copy_from_slice(&self.sweep.dz);
        self.has_gaps = false;
        self.evaluate(qp);
        self.free_values.copy_from_slice(&self.values);
        let mut most = 0.0f64;
        for i in 0..self.state.len() {
            let ([lower, upper], v) = (self.bounds(i, qp), self.value(i));
            let beyond = (v - upper).max(lower - v);
            if beyond > 0.0 && self.reach[i] > 0.0 {
                most = most.max(beyond * beyond / self.reach[i]);
            }
        }
        most
    }

    /// What it costs to cut the controls of the point off at their bounds, by the derivative there: the largest `|∂J/∂u_j| |Δu_j|` of a single one. Where
    /// the system is unstable it is far more than what a bound costs under feedback by all other controls, and so are the multipliers.
    fn cost_of_cutting(&mut self, qp: &StageQp) -> f64 {
        let (nx, nu, w) = (self.blocks.nx, self.blocks.nu, self.blocks.w);
        self.kept.copy_from_slice(&self.z);
        for k in 0..qp.n {
            let (own, after) = self.kept[k * w..(k + 2) * w].split_at_mut(w);
            for j in 0..nu {
                own[j] = own[j].max(qp.u_lower[k * nu + j]).min(qp.u_upper[k * nu + j]);
            }
            qp.step(k, &own[nu..], &own[..nu], &mut after[nu..]);
        }
        self.blocks.gradient(qp, &self.kept, &mut self.g, &mut self.values);
        let [own, before] = &mut self.spread;
        own.copy_from_slice(&self.g[qp.n * w + nu..]);
        let mut most = 0.0f64;
        for k in (0..qp.n).rev() {
            let (slope, of_state) = self.g[k * w..(k + 1) * w].split_at_mut(nu);
            gemv_transposed(nx, nu, qp.b(k), own, slope);
            before.copy_from_slice(of_state);
            gemv_transposed(nx, nx, qp.a(k), own, before);
            std::mem::swap(own, before);
            for (j, slope) in slope.iter().enumerate() {
                let cost = (slope * (self.z[k * w + j] - self.kept[k * w + j])).abs();
                // a system that grows beyond all numbers says nothing
                most = if cost.is_finite() { most.max(cost) } else { most };
            }
        }
        self.evaluate(qp);
        most
    }

    /// Slacks and multipliers of the start: products are those of the largest violation.
    fn enter(&mut self, qp: &StageQp, mu: f64) {
        for i in 0..self.state.len() {
            let ([lower, upper], v) = (self.bounds(i, qp), self.value(i));
            let ((linear, quadratic), equation) = (self.price(i), self.is_equation(i, qp));
            self.y[i] = 0.0;
            if equation && i < self.n_u {
                let at = self.at(i);
                self.has_gaps |= self.z[at] != lower;
                self.z[at] = lower;
            }
            for (up, h) in [v - lower, upper - v].into_iter().enumerate() {
                let side = &mut self.sides[2 * i + up];
                *side = Side { on: h.is_finite() && !equation && self.reach[i] > 0.0, ..Side::default() };
                if !side.on {
                    continue;
                }
                side.soft = linear.is_finite();
                side.linear = side.soft && linear > 0.0;
                side.t = h.abs().max((mu * self.reach[i]).sqrt());
                side.lambda = mu / side.t;
                if side.soft && !side.linear {
                    side.s = 0.5 * side.lambda / quadratic;
                }
                if side.linear {
                    side.s = (mu * self.reach[i]).sqrt();
                    let most = linear + 2.0 * quadratic * side.s;
                    side.lambda = side.lambda.min(0.5 * most);
                    side.nu = most - side.lambda;
                }
            }
        }
    }

    /// Weights and aims of the interior point for a centre `mu`; `corrected` with the products of the last step.
    fn aim_inside(&mut self, qp: &StageQp, mu: f64, corrected: bool) {
        let n_u = self.n_u;
        for i in 0..self.state.len() {
            let (linear, quadratic) = self.price(i);
            let (mut weight, mut aim) = (0.0, 0.0);
            let ([lower, upper], v) = (self.bounds(i, qp), self.value(i));
            if i >= n_u && self.is_equation(i, qp) && self.reach[i] > 0.0 {
                weight = STIFF / self.reach[i];
                aim = self.y[i] + weight * (v - lower);
            }
            if self.reach[i] == 0.0 && linear.is_finite() {
                // nothing moves this row: its price is a constant
                let beyond = (v - upper).max(lower - v).max(0.0);
                let sign = if v > upper { 1.0 } else { -1.0 };
                aim = if beyond > 0.0 { sign * (linear + 2.0 * quadratic * beyond) } else { 0.0 };
                self.y[i] = aim;
            }
            for (up, sign) in [-1.0, 1.0].into_iter().enumerate() {
                let side = &mut self.sides[2 * i + up];
                if !side.on {
                    continue;
                }
                let h = if up == 1 { upper - v } else { v - lower };
                side.gap = h + side.s - side.t;
                side.by_t = mu - side.t * side.lambda - if corrected { side.dt * side.dlambda } else { 0.0 };
                let (mut over, mut own) = (0.0, side.gap);
                if side.soft {
                    side.slope = side.lambda + side.nu - linear - 2.0 * quadratic * side.s;
                    if side.linear {
                        side.by_s = mu - side.s * side.nu - if corrected { side.ds * side.dnu } else { 0.0 };
                    }
                    over = 1.0 / side.stiffness(quadratic);
                    own += side.push() * over;
                }
                let scale = side.t + side.lambda * over;
                weight += side.lambda / scale;
                aim += sign * (side.lambda + (side.by_t - side.lambda * own) / scale);
            }
            match i.checked_sub(n_u) {
                None => (self.want.u[i], self.want.fixed[i]) = (weight, lower == upper),
                Some(r) => self.want.rows[r] = weight,
            }
            self.aim[i] = aim;
        }
    }

    /// How slacks and multipliers move by the step of `sweep`; the longest share of it that keeps them positive.
    fn follow(&mut self, qp: &StageQp) -> f64 {
        let (w, n_u) = (self.blocks.w, self.n_u);
        // what is longer than the whole step is cut off
        let mut longest = 2.0;
        for i in 0..self.state.len() {
            self.dv[i] = match i.checked_sub(n_u) {
                None => self.sweep.dz[self.at(i)],
                Some(r) => dot(self.blocks.row(r), &self.sweep.dz[qp.rows[r].node * w..(qp.rows[r].node + 1) * w]),
            };
            let (_, quadratic) = self.price(i);
            for (up, sign) in [1.0, -1.0].into_iter().enumerate() {
                let side = &mut self.sides[2 * i + up];
                if !side.on {
                    continue;
                }
                let dh = sign * self.dv[i];
                let (mut over, mut own) = (0.0, 0.0);
                if side.soft {
                    over = 1.0 / side.stiffness(quadratic);
                    own = side.push() * over;
                }
                side.dlambda = (side.by_t - side.lambda * (side.gap + own + dh)) / (side.t + side.lambda * over);
                side.ds = if side.soft { side.dlambda * over + own } else { 0.0 };
                side.dt = dh + side.ds + side.gap;
                let mut keep = |v: f64, d: f64| {
                    if v + longest * d < 0.0 {
                        longest = -v / d;
                    }
                };
                keep(side.t, side.dt);
                keep(side.lambda, side.dlambda);
                if side.linear {
                    side.dnu = (side.by_s - side.nu * side.ds) / side.s;
                    keep(side.s, side.ds);
                    keep(side.nu, side.dnu);
                }
            }
        }
        longest
    }

    /// The mean product of slacks and multipliers after a share `t` of the step.
    fn complementarity(&self, t: f64) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for s in self.sides.iter().filter(|s| s.on) {
            sum += (s.t + t * s.dt) * (s.lambda + t * s.dlambda);
            count += 1;
            if s.linear {
                sum += (s.s + t * s.ds) * (s.nu + t * s.dnu);
                count += 1;
            }
        }
        sum / count.max(1) as f64
    }

    /// The interior point. `scale` is what constraints cost, by the start.
    fn interior(&mut self, qp: &StageQp, x0: &[f64], terms: &Terms, scale: f64) -> End {
        self.enter(qp, scale);
        self.pointed.fill(i8::MIN);
        self.tried.fill(i8::MIN);
        self.want.clear();
        self.sides.iter_mut().for_each(|s| (s.dt, s.dlambda, s.ds, s.dnu) = (0.0, 0.0, 0.0, 0.0));
        let start = self.complementarity(0.0);
        let (mut mu, mut left) = (start, 1.0);
        for _ in 0..MOST {
            if self.iterations > 0 && terms.over(self.iterations) {
                return End::Late;
            }
            self.iterations += 1;
            self.evaluate(qp);
            self.aim_inside(qp, 0.0, false);
            if !self.factorise(qp) {
                break;
            }
            self.newton(qp, x0, false);
            let longest = self.follow(qp).min(1.0);
            let after = self.complementarity(longest).max(0.0);
            // Mehrotra's centre; equations alone have none
            let centre = if mu > 0.0 { mu * (after / mu).powi(3).min(1.0) } else { 0.0 };
            self.aim_inside(qp, centre, true);
            self.newton(qp, x0, false);
            let t = (BOUNDARY * self.follow(qp)).min(1.0);
            if t.is_nan() || t <= f64::EPSILON {
                break;
            }
            self.make(qp, t);
            left *= 1.0 - t;
            self.has_gaps &= left > 0.0;
            mu = self.complementarity(0.0);
            if !mu.is_finite() {
                return End::Stuck;
            }
            if left > f64::EPSILON && self.contradicts(qp) {
                return End::Contradiction;
            }
            if self.point() {
                self.kept.copy_from_slice(&self.z);
                self.kept_y.copy_from_slice(&self.y);
                let gaps = self.has_gaps;
                self.adopt(qp);
                self.tried.copy_from_slice(&self.pointed);
                let end = self.settle(qp, x0, terms, 0);
                if matches!(end, End::Solved | End::Late) {
                    return end;
                }
                self.z.copy_from_slice(&self.kept);
                self.y.copy_from_slice(&self.kept_y);
                self.has_gaps = gaps;
                self.want.clear();
            }
            if mu <= CLOSED * start && left <= CLOSED {
                break;
            }
        }
        if mu <= NEARLY * start && left <= NEARLY {
            self.adopt(qp);
            End::Solved
        } else {
            End::Stuck
        }
    }

    /// Makes a share of the step of everything.
    fn make(&mut self, qp: &StageQp, t: f64) {
        axpy(t, &self.sweep.dz, &mut self.z);
        for i in 0..self.state.len() {
            if i >= self.n_u && self.is_equation(i, qp) && self.reach[i] > 0.0 {
                let target = self.aim[i] + STIFF / self.reach[i] * self.dv[i];
                self.y[i] += t * (target - self.y[i]);
            }
            for s in &mut self.sides[2 * i..2 * i + 2] {
                s.t += t * s.dt;
                s.lambda += t * s.dlambda;
                s.s += t * s.ds;
                s.nu += t * s.dnu;
                (s.dt, s.dlambda, s.ds, s.dnu) = (0.0, 0.0, 0.0, 0.0);
            }
        }
    }

    /// The active set that slacks and multipliers point to. Is it that of the last iterate, and another than the one that was tried?
    fn point(&mut self) -> bool {
        let mut same = true;
        for i in 0..self.state.len() {
            let mut sign = 0;
            let mut most = 1.0;
            for (up, s) in self.sides[2 * i..2 * i + 2].iter().enumerate().filter(|s| s.1.on) {
                // a multiplier moves the constraint further than its slack
                let ratio = s.lambda * self.reach[i] / s.t;
                if ratio > most {
                    most = ratio;
                    sign = if up == 1 { 1 } else { -1 };
                    if s.soft && s.s > s.nu * self.reach[i] {
                        sign *= 2;
                    }
                }
            }
            same &= self.pointed[i] == sign;
            self.pointed[i] = sign;
        }
        same && self.pointed != self.tried
    }

    /// Takes that active set, with its multipliers.
    fn adopt(&mut self, qp: &StageQp) {
        for i in 0..self.state.len() {
            if self.is_equation(i, qp) {
                self.state[i] = State::In;
                continue;
            }
            if self.reach[i] == 0.0 {
                continue;
            }
            let sign = self.pointed[i];
            self.state[i] = match sign.unsigned_abs() {
                1 => State::In,
                2 => State::Beyond,
                _ => State::Out,
            };
            if sign != 0 {
                self.side[i] = f64::from(sign.signum());
            }
            self.y[i] = self.sides[2 * i + 1].lambda - self.sides[2 * i].lambda;
        }
    }

    /// Do the multipliers of rows prove that these contradict each other? The largest value that `−yᵀ (a(z) − b)` can have under controls within their
    /// bounds is negative then.
    fn contradicts(&mut self, qp: &StageQp) -> bool {
        let (nx, nu, w, n_u) = (self.blocks.nx, self.blocks.nu, self.blocks.w, self.n_u);
        if self.has_gaps || !(0..qp.rows.len()).any(|r| self.linear[r] == f64::INFINITY) {
            return false;
        }
        let (mut sum, mut terms) = (0.0, 0.0);
        let [own, before] = &mut self.spread;
        own.fill(0.0);
        let mut free = 0.0f64;
        for k in (0..=qp.n).rev() {
            // by states: Aᵀ of what is behind, and the own rows
            before.fill(0.0);
            let after = &mut self.gy[..nu];
            after.fill(0.0);
            if k < qp.n {
                gemv_transposed(nx, nu, qp.b(k), own, after);
                gemv_transposed(nx, nx, qp.a(k), own, before);
            }
            for r in self.blocks.first[k]..self.blocks.first[k + 1] {
                if self.linear[r] < f64::INFINITY {
                    continue;
                }
                let i = n_u + r;
                let (lower, upper) = (qp.row_lower[r], qp.row_upper[r]);
                let y =
                    if lower == upper { self.y[i] } else { self.sides[2 * i + 1].lambda - self.sides[2 * i].lambda };
                if y == 0.0 {
                    continue;
                }
                let row = &self.blocks.rows[r * w..(r + 1) * w];
                let at = &self.z[k * w..(k + 1) * w];
                let value = dot(row, at);
                let bound = if y > 0.0 { upper } else { lower };
                sum += y * (value - bound);
                terms += (y * value).abs() + (y * bound).abs();
                axpy(y, &row[..nu], &mut self.gy[..nu]);
                axpy(y, &row[nu..], before);
            }
            for j in (0..nu).filter(|_| k < qp.n) {
                let (d, u) = (self.gy[j], self.z[k * w + j]);
                let to = if d > 0.0 { qp.u_lower[k * nu + j] } else { qp.u_upper[k * nu + j] };
                if to.is_finite() {
                    sum += d * (to - u);
                    terms += (d * u).abs() + (d * to).abs();
                } else {
                    free = free.max((d * u).abs().max(d * d * self.reach[k * nu + j]));
                }
            }
            std::mem::swap(own, before);
        }
        if let Initial::Free(_) = qp.initial {
            free = own.iter().zip(&self.z[nu..w]).fold(free, |m, (d, x)| m.max((d * x).abs()));
        }
        sum > FREE * terms && free <= FREE * sum
    }

    /// The controls of the point, within their bounds.
    fn take_controls(&mut self, qp: &StageQp) -> bool {
        for i in 0..self.n_u {
            self.u[i] = self.z[self.at(i)].max(qp.u_lower[i]).min(qp.u_upper[i]);
        }
        self.z.iter().all(|v| v.is_finite())
    }

    /// How far the bounds of the controls let a sum of controls and states of node `k` move at most, where states move by `spread`.
    fn span(&self, factors: &[f64], k: usize, spread: &[f64], qp: &StageQp) -> f64 {
        self.span_of(factors.iter().copied(), k, spread, qp)
    }

    fn span_of(&self, factors: impl Iterator<Item = f64>, k: usize, spread: &[f64], qp: &StageQp) -> f64 {
        let nu = self.blocks.nu;
        let width = |j: usize| match j.checked_sub(nu) {
            None => qp.u_upper[k * nu + j] - qp.u_lower[k * nu + j],
            Some(i) => spread[i],
        };
        factors.enumerate().filter(|e| e.1 != 0.0).map(|(j, a)| a.abs() * width(j)).sum()
    }
}

impl QpSolver for Stagewise {
    fn name(&self) -> &'static str {
        "stagewise"
    }

    fn prepare(&mut self, qp: &StageQp) -> bool {
        self.is_solution = false;
        self.blocks.take(qp);
        self.free.forget();
        self.now.forget();
        self.want.clear();
        self.ready = self.free.factorise(&self.blocks, &self.want, qp, &mut self.stages);
        if !self.ready {
            return false;
        }
        let (of_controls, of_rows) = self.reach.split_at_mut(self.n_u);
        self.free.compliance(of_controls, &mut self.u);
        if !of_rows.is_empty() {
            self.free.variances(&self.blocks, qp, of_rows, &mut self.covariance);
        }
        self.ready = self.reach.iter().all(|v| v.is_finite());
        if self.ready && !self.place(qp) {
            // the guess may be of use; where it is not, the feedback finds another
            self.factorise(qp);
        }
        self.ready
    }

    fn refresh(&mut self, _qp: &StageQp) {
        self.is_solution = false;
    }

    fn solve(&mut self, qp: &StageQp, x0: &[f64], terms: &Terms) -> QpStatus {
        (self.iterations, self.stages) = (0, 0);
        if !self.ready || !x0.iter().all(|v| v.is_finite()) {
            return QpStatus::Failed;
        }
        self.begin(qp, terms);
        let near = std::mem::take(&mut self.is_solution);
        let crossed = (0..self.state.len()).any(|i| {
            let [lower, upper] = self.bounds(i, qp);
            self.price(i).0 == f64::INFINITY && (lower > upper || lower.is_nan() || upper.is_nan())
        });
        if crossed {
            self.start(qp, x0);
            self.take_controls(qp);
            return QpStatus::Infeasible;
        }
        if near {
            self.kept.copy_from_slice(&self.z);
        } else {
            self.kept.fill(0.0);
        }
        if terms.elastic.is_some() {
            self.start(qp, x0);
        }
        // near its solution a step is short and loses no digits to the weights of rows
        self.z.copy_from_slice(&self.kept);
        self.has_gaps = !near;
        let mut end = self.settle(qp, x0, terms, PATIENCE);
        if end == End::Stuck {
            let scale = self.start(qp, x0).max(self.cost_of_cutting(qp));
            end = if scale > 0.0 { self.interior(qp, x0, terms, scale) } else { End::Stuck };
        }
        if end == End::Contradiction && self.iterations == 1 {
            self.start(qp, x0);
        }
        let finite = self.take_controls(qp);
        self.is_solution = finite && end == End::Solved;
        match end {
            _ if !finite => QpStatus::Failed,
            End::Solved => QpStatus::Solved,
            End::Contradiction => QpStatus::Infeasible,
            End::Stuck | End::Late => QpStatus::OutOfTime,
        }
    }

    fn controls(&self) -> &[f64] {
        &self.u
    }

    fn expand(&mut self, qp: &StageQp, out: &mut QpSolution) {
        let (nu, w) = (self.blocks.nu, self.blocks.w);
        out.u.copy_from_slice(&self.u);
        for (x, z) in out.x.chunks_exact_mut(qp.nx).zip(self.z.chunks_exact(w)) {
            x.copy_from_slice(&z[nu..]);
        }
        out.lambda.copy_from_slice(&self.sweep.lambda);
        out.u_mu.copy_from_slice(&self.y[..self.n_u]);
        out.row_mu.copy_from_slice(&self.y[self.n_u..]);
    }

    fn tangent(&mut self, qp: &StageQp, x0: &[f64]) -> &[f64] {
        self.cut.copy_from_slice(&self.u);
        if self.ready && x0.iter().all(|v| v.is_finite()) {
            self.is_solution = false;
            self.start(qp, x0);
            for i in 0..self.n_u {
                self.cut[i] = self.z[self.at(i)];
            }
        }
        &self.cut
    }

    fn gains(&self, out: &mut [f64]) -> bool {
        self.free.gains(out);
        self.ready
    }

    fn cost_of_rows(&mut self, qp: &StageQp) -> f64 {
        let (mut cost, mut sum) = (0.0, 0.0);
        let [mut spread, mut next] = std::mem::take(&mut self.spread);
        spread.fill(if qp.initial == Initial::Given { 0.0 } else { f64::INFINITY });
        for k in 0..=qp.n {
            for r in self.blocks.first[k]..self.blocks.first[k + 1] {
                let (value, lower, upper) = (self.free_values[r], qp.row_lower[r], qp.row_upper[r]);
                let (beyond, own) = ((value - upper).max(lower - value), self.reach[self.n_u + r]);
                if beyond > 0.0 && own > 0.0 && qp.rows[r].price.is_none() {
                    let v = beyond.min(self.span(self.blocks.row(r), k, &spread, qp));
                    cost += 0.5 * v * v / own;
                    sum += v;
                }
            }
            for (i, next) in next.iter_mut().enumerate().filter(|_| k < qp.n) {
                let line = |j: usize| self.blocks.f(k).v[i + j * qp.nx];
                *next = self.span_of((0..self.blocks.w).map(line), k, &spread, qp);
            }
            std::mem::swap(&mut spread, &mut next);
        }
        self.spread = [spread, next];
        if sum > 0.0 {
            cost / sum
        } else {
            0.0
        }
    }

    fn violates(&self, qp: &StageQp) -> bool {
        let rows = self.state[self.n_u..].iter().zip(&qp.rows);
        rows.into_iter().any(|(s, row)| row.price.is_none() && *s == State::Beyond)
    }

    fn iterations(&self) -> usize {
        self.iterations
    }

    fn shift(&mut self, qp: &StageQp) {
        for i in 0..self.state.len() {
            let (state, side, y) = (self.state[i], self.side[i], self.y[i]);
            self.state[i] = State::Out;
            let to = match i.checked_sub(self.n_u) {
                None => i.checked_sub(qp.nu),
                Some(r) => qp.earlier_row(r).map(|j| self.n_u + j),
            };
            if let Some(to) = to {
                (self.state[to], self.side[to], self.y[to]) = (state, side, y);
            }
        }
    }

    fn reset(&mut self) {
        self.state.fill(State::Out);
        self.y.fill(0.0);
        self.is_solution = false;
        self.ready = false;
    }
}

#[cfg(test)]
mod tests {
    use super::super::conformance::{numbers, random, residual, Kind};
    use super::*;

    /// The factorisations of a solution do not grow with the horizon, from a guess that knows nothing and from the last one.
    #[test]
    fn work_is_linear_in_the_horizon() {
        let mut most = [0.0f64; 2];
        for (place, n) in [10usize, 640].into_iter().enumerate() {
            for seed in 0..6 {
                let (mut qp, mut x) = random(seed, [n, 3, 2], Kind { tight: 0.3, ..Kind::default() });
                // the same time as a system with a horizon that is as long: without that states grow
                qp.a.iter_mut().for_each(|a| *a *= 0.8);
                let mut solver = Stagewise::new(&qp).unwrap();
                assert!(solver.prepare(&qp));
                let mut r = numbers(seed);
                let mut s = QpSolution::new(&qp);
                for _ in 0..5 {
                    assert_eq!(solver.solve(&qp, &x, &Terms::default()), QpStatus::Solved, "{n} {seed}");
                    solver.expand(&qp, &mut s);
                    assert!(residual(&qp, &x, &s) < 1e-9, "{n} {seed}");
                    most[place] = most[place].max(solver.stages as f64 / n as f64);
                    x.iter_mut().for_each(|v| *v += 0.5 * r());
                }
            }
        }
        assert!(most[0] > 1.0 && most[1] < 2.0 * most[0], "{most:?} factorisations");
    }

    /// Programs of many sizes, units and prices, stable and unstable: solved, or called infeasible where the other method says so too, in a number of
    /// iterations that does not depend on the size.
    #[test]
    fn hard_programs_are_solved_or_said_to_be_infeasible() {
        let price = |linear, quadratic| Some(super::super::Price { linear, quadratic });
        let (mut solved, mut infeasible) = (0, 0);
        for seed in 0..360u64 {
            let size = [[5, 2, 1], [20, 3, 2], [40, 4, 1], [30, 6, 2], [60, 2, 2]][seed as usize % 5];
            let (rows, own_price, tight) = [
                (2, None, 0.35),
                (2, None, 2.0),
                (0, None, 0.2),
                (3, price(1e4, 0.0), 0.5),
                (3, price(1e-2, 1e3), 0.5),
                (1, price(5.0, 0.0), 0.05),
            ][(seed / 5) as usize % 6];
            let (mut qp, x) =
                random(seed + 9000, size, Kind { rows, price: own_price, tight, duplicates: seed % 2 == 0 });
            let mut r = numbers(seed);
            let growth = [0.6, 0.85, 1.0, 1.1][(seed / 30) as usize % 4];
            qp.a.iter_mut().for_each(|a| *a *= growth);
            let unit = 10f64.powf(3.0 * r());
            qp.hess_u.iter_mut().for_each(|v| *v *= unit);
            let (mut own, mut other) = (Stagewise::new(&qp).unwrap(), super::super::Condensing::new(&qp).unwrap());
            let convex = own.prepare(&qp);
            assert_eq!(convex, other.prepare(&qp), "{seed}");
            if !convex {
                continue;
            }
            let mut status = own.solve(&qp, &x, &Terms::default());
            if status == QpStatus::Infeasible {
                infeasible += 1;
                assert_ne!(other.solve(&qp, &x, &Terms::default()), QpStatus::Solved, "{seed}");
                status = own.solve(&qp, &x, &Terms { elastic: Some(1e5), ..Terms::default() });
                qp.rows.iter_mut().for_each(|r| r.price = price(1e5, 0.0));
            }
            assert_eq!(status, QpStatus::Solved, "{seed}");
            assert!(own.iterations() < MOST, "{seed}: {} iterations", own.iterations());
            let mut s = QpSolution::new(&qp);
            own.expand(&qp, &mut s);
            assert!(residual(&qp, &x, &s) < 1e-8, "{seed}: {:e}", residual(&qp, &x, &s));
            solved += 1;
        }
        assert!(solved > 180 && infeasible > 10, "{solved} {infeasible}: the programs have lost their point");
    }

    /// A change of the active set in the first stages makes these anew and no others.
    #[test]
    fn stages_behind_a_change_stay() {
        let (mut qp, _) = random(4, [40, 3, 1], Kind { tight: 1.0, ..Kind::default() });
        qp.a.iter_mut().for_each(|a| *a *= 0.5);
        let mut solver = Stagewise::new(&qp).unwrap();
        assert!(solver.prepare(&qp));
        let solve = |solver: &mut Stagewise, size: f64| {
            assert_eq!(solver.solve(&qp, &[size, -size, size], &Terms::default()), QpStatus::Solved);
            (0..qp.n).filter(|i| solver.state[*i] != State::Out).max().unwrap_or(0)
        };
        let last = solve(&mut solver, 0.0);
        let before = solver.state.clone();
        let size = (1..200).map(|s| 0.1 * f64::from(s)).find(|s| {
            solve(&mut solver, *s);
            solver.state != before
        });
        assert!(size.is_some() && last < 40, "nothing is active");
        let changed = (0..qp.n).filter(|i| solver.state[*i] != before[*i]).max().unwrap() as u64;
        assert!(
            solver.stages <= 2 * (changed + 1) && changed < 30,
            "{} stages for a change at {changed}",
            solver.stages
        );
    }
}
