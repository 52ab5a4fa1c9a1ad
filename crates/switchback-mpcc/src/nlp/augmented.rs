//! The Newton system of the barrier problem: assembly, convexification, inertia, solution.
//!
//! Slacks are eliminated, so the matrix is
//!
//! ```text
//! [ H + Σ_x + δ_w I      Jᵀ        ]
//! [ J              −Σ_s⁻¹ − δ_c I  ]
//! ```
//!
//! of order `n + m` with a fixed pattern. Fixed variables and free rows keep their places as ±1 on the
//! diagonal, so that one symbolic factorisation serves every choice of bounds.

use super::iterate::{Iterate, RowKind, Shape, Values};
use super::problem::{Bilinear, Bounds, Nlp};
use crate::error::Result;
use crate::linalg::csc::Pattern;
use crate::linalg::kkt::{Kkt, KktSettings, KktStatus, LinearStats};
use crate::linalg::ldl::{self, interleaved};
use crate::random::SplitMix64;
use crate::settings::{LinearSolver, Ordering};
use crate::stop;

/// First perturbation of the Hessian, and its growth and decay (Wächter and Biegler, section 3.1).
const DELTA_W_FIRST: f64 = 1e-4;
const DELTA_W_MIN: f64 = 1e-20;
const DELTA_W_MAX: f64 = 1e20;
/// Perturbation of the dual block where rows are dependent, times `μ^(1/4)`.
const DELTA_C: f64 = 1e-8;
const GROW_FIRST: f64 = 100.0;
const GROW: f64 = 8.0;
const SHRINK: f64 = 1.0 / 3.0;
/// Share of the geometric mean of the barrier curvatures a product multiplier may reach.
const PAIR_CLIP: f64 = 0.999;

/// Residual, relative to the right-hand side, of a system that has a solution.
const CONSISTENT: f64 = 1e-6;

/// Where a pair's product enters the matrix.
#[derive(Debug, Clone, Copy)]
struct PairSlot {
    pair: Bilinear,
    entry: usize,
}

/// The system, its right-hand side and its solution.
pub(super) struct Augmented {
    n: usize,
    kkt: Kkt,
    values: Vec<f64>,
    // (position in values, column or row) of every Hessian and Jacobian entry
    hess_pos: Vec<u32>,
    hess_rc: Vec<(u32, u32)>,
    jac_pos: Vec<u32>,
    jac_rc: Vec<(u32, u32)>,
    diag: Vec<u32>,
    pairs: Vec<PairSlot>,
    pub rhs: Vec<f64>,
    pub sol: Vec<f64>,
    /// Last successful perturbation of the Hessian.
    delta_w_last: f64,
    /// Perturbation in the present factorisation.
    pub delta_w: f64,
    equilibrated_at: f64,
}

impl Augmented {
    pub fn new(nlp: &dyn Nlp, linear_solver: LinearSolver, ordering: Ordering) -> Result<Augmented> {
        let (n, m) = (nlp.n(), nlp.m());
        let (hp, jp) = (nlp.hess_pattern(), nlp.jac_pattern());
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        let mut hess_rc = Vec::with_capacity(hp.nnz());
        let mut jac_rc = Vec::with_capacity(jp.nnz());
        for j in 0..n {
            for &i in hp.rows(j) {
                rows.push(i);
                cols.push(j);
                hess_rc.push((i as u32, j as u32));
            }
        }
        for j in 0..n {
            for &i in jp.rows(j) {
                rows.push(j);
                cols.push(n + i);
                jac_rc.push((i as u32, j as u32));
            }
        }
        for k in 0..n + m {
            rows.push(k);
            cols.push(k);
        }
        let bilinear = nlp.bilinear();
        for p in bilinear {
            rows.push(p.a.min(p.b));
            cols.push(p.a.max(p.b));
        }
        let (pattern, map) = Pattern::from_triplets(n + m, n + m, &rows, &cols);
        let map: Vec<u32> = map.into_iter().map(|k| k as u32).collect();
        let (nh, nj) = (hess_rc.len(), jac_rc.len());
        let pairs = bilinear
            .iter()
            .enumerate()
            .map(|(k, &pair)| PairSlot { pair, entry: map[nh + nj + n + m + k] as usize })
            .collect();
        let order = match ordering {
            Ordering::Amd => ldl::Ordering::Amd,
            Ordering::Natural => ldl::Ordering::Given(interleaved(&pattern, n)),
        };
        let backend = ldl::solver(linear_solver, order)?;
        Ok(Augmented {
            n,
            values: vec![0.0; pattern.nnz()],
            kkt: Kkt::new(&pattern, n, backend, KktSettings::default())?,
            hess_pos: map[..nh].to_vec(),
            jac_pos: map[nh..nh + nj].to_vec(),
            diag: map[nh + nj..nh + nj + n + m].to_vec(),
            hess_rc,
            jac_rc,
            pairs,
            rhs: vec![0.0; n + m],
            sol: vec![0.0; n + m],
            delta_w_last: 0.0,
            delta_w: 0.0,
            equilibrated_at: f64::NAN,
        })
    }

    /// Does every direction have to solve for the rows, however small their violation is beside the gradient?
    pub fn demand_rows(&mut self, on: bool) {
        self.kkt.demand_rows(on);
    }

    pub fn factorisations(&self) -> usize {
        self.kkt.factorisations()
    }

    pub fn stats(&self) -> LinearStats {
        self.kkt.stats()
    }

    /// Forgets what earlier solves taught about perturbation and scaling.
    pub fn restart(&mut self) {
        self.delta_w_last = 0.0;
        self.equilibrated_at = f64::NAN;
    }

    /// Writes the matrix; `hessian` false puts the identity in its place (least-squares multipliers).
    pub fn assemble(&mut self, shape: &Shape, b: &Bounds, it: &Iterate, v: &Values, hessian: bool) {
        let n = self.n;
        self.values.fill(0.0);
        if hessian {
            for (k, &(i, j)) in self.hess_rc.iter().enumerate() {
                if !(shape.fixed[i as usize] || shape.fixed[j as usize]) {
                    self.values[self.hess_pos[k] as usize] += v.hess[k];
                }
            }
        }
        for (k, &(i, j)) in self.jac_rc.iter().enumerate() {
            if !(shape.fixed[j as usize] || shape.row[i as usize] == RowKind::Free) {
                self.values[self.jac_pos[k] as usize] += v.jac[k];
            }
        }
        for j in 0..n {
            let d = &mut self.values[self.diag[j] as usize];
            if shape.fixed[j] || !hessian {
                *d = 1.0;
            } else {
                *d += sigma_x(shape, b, it, j);
            }
        }
        for i in 0..it.s.len() {
            let d = &mut self.values[self.diag[n + i] as usize];
            match shape.row[i] {
                RowKind::Free => *d = -1.0,
                RowKind::Equality => {}
                RowKind::Inequality if hessian => *d = -1.0 / sigma_s(shape, b, it, i),
                RowKind::Inequality => *d = -1.0,
            }
        }
    }

    /// Factors with the right inertia; perturbs where needed. False when no perturbation helps.
    ///
    /// `pairwise` convexifies products first. `mu` decides when the equilibration is due again, and scales `δ_c`.
    pub fn factor(&mut self, shape: &Shape, b: &Bounds, it: &Iterate, mu: f64, pairwise: bool) -> bool {
        let due = self.equilibrated_at != mu;
        if due {
            self.kkt.equilibrate(&self.values);
            self.equilibrated_at = mu;
        }
        self.delta_w = 0.0;
        let mut delta_c = 0.0;
        let mut status = self.kkt.factor(&self.values, 0.0, 0.0);
        if status == KktStatus::Ok {
            return true;
        }
        if stop::requested().is_some() {
            return false;
        }
        if !due {
            // a scaling chosen for other values may be what is wrong
            self.kkt.equilibrate(&self.values);
        }
        if pairwise && self.clip_pairs(shape, b, it) {
            status = self.kkt.factor(&self.values, 0.0, 0.0);
            if status == KktStatus::Ok {
                return true;
            }
        }
        if status == KktStatus::Singular {
            delta_c = DELTA_C * mu.powf(0.25);
            status = self.kkt.factor(&self.values, 0.0, delta_c);
            if status == KktStatus::Ok {
                return true;
            }
        }
        let first = self.delta_w_last == 0.0;
        let mut delta = if first { DELTA_W_FIRST } else { (SHRINK * self.delta_w_last).max(DELTA_W_MIN) };
        while delta <= DELTA_W_MAX && stop::requested().is_none() {
            match self.kkt.factor(&self.values, delta, delta_c) {
                KktStatus::Ok => {
                    self.delta_w_last = delta;
                    self.delta_w = delta;
                    return true;
                }
                KktStatus::Singular if delta_c == 0.0 => delta_c = DELTA_C * mu.powf(0.25),
                _ => {}
            }
            delta *= if first { GROW_FIRST } else { GROW };
        }
        false
    }

    /// Factors the matrix once more with a perturbed dual block, for dependent rows.
    pub fn factor_dependent(&mut self, mu: f64) -> bool {
        self.kkt.factor(&self.values, self.delta_w, DELTA_C * mu.powf(0.25).max(1e-1)) == KktStatus::Ok
    }

    /// Factors without asking for a positive definite reduced Hessian (least-squares multipliers).
    pub fn factor_plain(&mut self) -> bool {
        self.kkt.equilibrate(&self.values);
        self.equilibrated_at = f64::NAN;
        self.kkt.factor(&self.values, 0.0, 0.0) == KktStatus::Ok
    }

    /// Factors with `lift` added to the curvature of every variable that is not fixed, in units of the equilibrated matrix.
    pub fn factor_lifted(&mut self, shape: &Shape, lift: f64) -> KktStatus {
        self.kkt.equilibrate(&self.values);
        self.equilibrated_at = f64::NAN;
        for (j, scale) in self.kkt.scaling()[..self.n].iter().enumerate().filter(|(j, _)| !shape.fixed[*j]) {
            self.values[self.diag[j] as usize] += lift / (scale * scale);
        }
        self.kkt.factor(&self.values, 0.0, 0.0)
    }

    /// Number of equations whose gradients depend on those of others: eigenvalues of `J Jᵀ` up to `least`, in units of the equilibrated
    /// matrix, which was assembled without the Hessian. By inertia: `[I Jᵀ; J least]` has as many more positive eigenvalues.
    pub fn dependent_rows(&mut self, shape: &Shape, least: f64) -> usize {
        self.kkt.equilibrate(&self.values);
        self.equilibrated_at = f64::NAN;
        let equations = self.kkt.scaling()[self.n..].iter().zip(&shape.row).enumerate();
        for (i, (scale, _)) in equations.filter(|(_, (_, kind))| **kind == RowKind::Equality) {
            self.values[self.diag[self.n + i] as usize] += least / (scale * scale);
        }
        self.kkt.factor(&self.values, 0.0, 0.0);
        self.kkt.inertia().positive.saturating_sub(self.n)
    }

    /// The right-hand side whose primal part is `r`, in units of the equilibrated matrix, and whose rows are zero.
    pub fn load_right_hand_side(&mut self, r: &[f64]) {
        for (out, (r, scale)) in self.rhs.iter_mut().zip(r.iter().zip(self.kkt.scaling())) {
            *out = r / scale;
        }
        self.rhs[self.n..].fill(0.0);
    }

    /// The primal part of the solution, in units of the equilibrated matrix, as a vector of length 1: a step of inverse iteration.
    pub fn scaled_solution(&self, out: &mut [f64]) {
        for (out, (x, scale)) in out.iter_mut().zip(self.sol.iter().zip(self.kkt.scaling())) {
            *out = x / scale;
        }
        let length = out.iter().map(|v| v * v).sum::<f64>().sqrt();
        out.iter_mut().for_each(|v| *v /= length);
    }

    /// Solves for `sol` from `rhs`; false when the solution is no use.
    pub fn solve(&mut self) -> bool {
        let Augmented { kkt, rhs, sol, .. } = self;
        kkt.solve(rhs, sol).ok && sol.iter().all(|v| v.is_finite())
    }

    /// Solves for `sol` from `rhs`; false where the right-hand side is not in the range of the matrix.
    pub fn solve_consistent(&mut self) -> bool {
        let Augmented { kkt, rhs, sol, .. } = self;
        let s = kkt.solve(rhs, sol);
        s.ok && s.relative <= CONSISTENT
    }

    /// Has the system a solution for every right-hand side, or for every one whose rows are zero? Asked of one that is drawn, which almost
    /// surely has a share outside of the range if that is not everything. The factors bear singular matrices, because of their static shift.
    pub fn is_onto(&mut self, rows: bool) -> bool {
        let mut random = SplitMix64::new(1);
        let n = if rows { self.rhs.len() } else { self.n };
        self.rhs.fill(0.0);
        for (out, scale) in self.rhs[..n].iter_mut().zip(self.kkt.scaling()) {
            *out = (random.share() - 0.5) / scale;
        }
        self.solve_consistent()
    }

    /// The Hessian times `x[n]`.
    pub fn times_hessian(&self, v: &Values, x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (h, &(i, j)) in v.hess.iter().zip(&self.hess_rc) {
            let (i, j) = (i as usize, j as usize);
            out[i] += h * x[j];
            if i != j {
                out[j] += h * x[i];
            }
        }
    }

    /// Takes what fixed variables that move by `dx[n]` do to the gradients of the free ones off the right-hand side.
    pub fn fixed_columns(&mut self, shape: &Shape, v: &Values, dx: &[f64]) {
        for (k, &(i, j)) in self.hess_rc.iter().enumerate() {
            let (i, j) = (i as usize, j as usize);
            for (free, fixed) in [(i, j), (j, i)] {
                if shape.fixed[fixed] && !shape.fixed[free] {
                    self.rhs[free] -= v.hess[k] * dx[fixed];
                }
            }
        }
    }

    /// Limits the multipliers of the products so that every 2 × 2 block with its barrier terms is positive
    /// semidefinite. True when something changed.
    fn clip_pairs(&mut self, shape: &Shape, b: &Bounds, it: &Iterate) -> bool {
        let mut changed = false;
        for p in &self.pairs {
            let Bilinear { a, b: bb, row } = p.pair;
            if shape.fixed[a] || shape.fixed[bb] || shape.row[row] == RowKind::Free {
                continue;
            }
            let limit = PAIR_CLIP * (sigma_x(shape, b, it, a) * sigma_x(shape, b, it, bb)).sqrt();
            let y = it.y[row];
            if y.abs() > limit {
                self.values[p.entry] += limit.copysign(y) - y;
                changed = true;
            }
        }
        changed
    }
}

/// Barrier curvature of variable `j`.
#[inline]
pub(super) fn sigma_x(shape: &Shape, b: &Bounds, it: &Iterate, j: usize) -> f64 {
    let mut s = 0.0;
    if shape.has_xl[j] {
        s += it.zl[j] / (it.x[j] - b.xl[j]);
    }
    if shape.has_xu[j] {
        s += it.zu[j] / (b.xu[j] - it.x[j]);
    }
    s
}

/// Barrier curvature of the slack of row `i`, kept away from zero.
#[inline]
pub(super) fn sigma_s(shape: &Shape, b: &Bounds, it: &Iterate, i: usize) -> f64 {
    let mut s = 0.0;
    if shape.has_cl[i] {
        s += it.vl[i] / (it.s[i] - b.cl[i]);
    }
    if shape.has_cu[i] {
        s += it.vu[i] / (b.cu[i] - it.s[i]);
    }
    s.max(1e-14)
}

#[cfg(all(test, feature = "faer"))]
mod on_faer {
    use std::sync::Arc;

    use crate::func::{Callback, Dims};
    use crate::nlp::{Bounds, CallbackNlp, Control, Ipm, IpmSettings, Monotone, Outcome, Start};
    use crate::settings::LinearSolver;

    /// `min Σ (x_i − sin i)⁴ + (Σ x_i)²/n` with `Σ x_i² ≤ 2` and `x_i ≥ −0.4`, on every backend.
    #[test]
    fn whole_solves_agree() {
        const N: usize = 40;
        let dims = Dims { x: N, u: 0, p: 0 };
        let solve = |linear_solver| {
            let f = Callback::new("f", dims, 1, |at, out| {
                let sum: f64 = at.x.iter().sum();
                let far = |(i, x): (usize, &f64)| (x - (i as f64).sin()).powi(4);
                out[0] = at.x.iter().enumerate().map(far).sum::<f64>() + sum * sum / N as f64;
                0
            });
            let c = Callback::new("c", dims, 1, |at, out| {
                out[0] = at.x.iter().map(|v| v * v).sum();
                0
            });
            let mut p = CallbackNlp::new(N, 0, Arc::new(f), Some(Arc::new(c))).unwrap();
            let bounds =
                Bounds { xl: vec![-0.4; N], xu: vec![f64::INFINITY; N], cl: vec![f64::NEG_INFINITY], cu: vec![2.0] };
            let mut ipm = Ipm::new(&p, IpmSettings { linear_solver, ..IpmSettings::default() }).unwrap();
            let mut rule = Monotone { mu_init: 0.1, tol: 1e-6, primal_tol: 1e-8 };
            let outcome = ipm.solve(&mut p, &bounds, Start::Cold(&[0.1; N]), &mut rule, &mut Control::default());
            assert_eq!(outcome, Outcome::Solved);
            (ipm.linear_statistics().backend, ipm.objective(), ipm.iterate().x.clone())
        };
        let (columns, blocks) = (solve(LinearSolver::Native), solve(LinearSolver::Faer));
        assert_eq!((columns.0, blocks.0), ("native", "faer"));
        assert!((columns.1 - blocks.1).abs() < 1e-8 * columns.1.abs(), "{} {}", columns.1, blocks.1);
        assert!(columns.2.iter().zip(&blocks.2).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
