//! States eliminated: a dense program in the controls, made and factorised in the preparation.
//!
//! With `x_k = Φ_k x_0 + Γ_k U + g_k` the program has the Hessian `H = Γᵀ Q Γ + ...` and the gradient `h + H_x x_0`. The columns
//! of `[Φ_k Γ_k]` and of their adjoints are handled as one block of a stage, `2 N² n_x² n_u` operations in products with
//! `n_x × n_x` (J. Andersson, *A General-Purpose Software Framework for Dynamic Optimization*, 2013; G. Frison, J. B.
//! Jørgensen, *A fast condensing method for solution of linear-quadratic control problems*, 2013). `H⁻¹` and
//! `V = −H⁻¹ H_x` are part of the preparation, so that the feedback starts from `v_0 + V x_0`.

use super::dual::{DualActiveSet, Program, Rows};
use super::{QpSolution, QpSolver, QpStatus, StageQp, Terms};
use crate::error::Result;
use crate::linalg::dense::{gemm, gemv, gemv_transposed, inverse, potrf, Left, Mode, Right};

/// From this condition of the Hessian on, corrections take the gradient from the states: for unstable systems on long horizons
/// the Hessian is made of terms that are far larger than what they add up to.
const BAD: f64 = 1e6;

/// Condensing with a dual active-set method.
pub struct Condensing {
    nx: usize,
    /// Controls of all stages.
    n_u: usize,
    /// `[Φ_k Γ_k]` of every node `k`, `nx × (nx + k nu)`, and where each begins.
    gamma: Vec<f64>,
    gamma_at: Vec<usize>,
    /// `A_kᵀ`, the adjoint blocks of two nodes, `B_kᵀ`.
    transposed: Vec<f64>,
    adjoint: [Vec<f64>; 2],
    /// `[H_x H]`, all rows.
    hess: Vec<f64>,
    factor: Vec<f64>,
    scratch: [Vec<f64>; 2],
    inverse: Vec<f64>,
    gain: Vec<f64>,
    /// `h`, `v_0`, and both at the present `x_0`.
    h: Vec<f64>,
    v: Vec<f64>,
    h_now: Vec<f64>,
    v_now: Vec<f64>,
    x: Vec<f64>,
    ready: bool,
    /// A lower bound of the condition of `H`.
    condition: f64,
    active_set: DualActiveSet,
}

impl Condensing {
    /// Room for programs of the size of `qp`.
    pub fn new(qp: &StageQp) -> Result<Condensing> {
        let (n, nx, nu) = (qp.n, qp.nx, qp.nu);
        let n_u = n * nu;
        let mut gamma_at = vec![0];
        for k in 0..=n {
            gamma_at.push(gamma_at[k] + nx * (nx + k * nu));
        }
        let square = || vec![0.0; n_u * n_u];
        Ok(Condensing {
            nx,
            n_u,
            gamma: vec![0.0; gamma_at[n + 1]],
            gamma_at,
            transposed: vec![0.0; nx * nx.max(nu)],
            adjoint: [vec![0.0; nx * (nx + n_u)], vec![0.0; nx * (nx + n_u)]],
            hess: vec![0.0; n_u * (nx + n_u)],
            factor: square(),
            scratch: [square(), square()],
            inverse: square(),
            gain: vec![0.0; n_u * nx],
            h: vec![0.0; n_u],
            v: vec![0.0; n_u],
            h_now: vec![0.0; n_u],
            v_now: vec![0.0; n_u],
            x: vec![0.0; (n + 1) * nx],
            ready: false,
            condition: 1.0,
            active_set: DualActiveSet::new(n_u, qp.rows.len()),
        })
    }

    /// `[Φ_k Γ_k]` from the first node on.
    fn propagate(&mut self, qp: &StageQp) {
        let (nx, nu) = (self.nx, qp.nu);
        let first = &mut self.gamma[..nx * nx];
        first.fill(0.0);
        (0..nx).for_each(|i| first[i + i * nx] = 1.0);
        for k in 0..qp.n {
            let (from, to) = self.gamma[self.gamma_at[k]..self.gamma_at[k + 2]].split_at_mut(nx * (nx + k * nu));
            if k == 0 {
                to[..nx * nx].copy_from_slice(&qp.a[..nx * nx]);
            } else {
                let right = Right { v: from, rs: 1, cs: nx };
                gemm([nx, nx + k * nu, nx], qp.a(k), right, to, nx, Mode::Set);
            }
            to[nx * (nx + k * nu)..].copy_from_slice(&qp.b[k * nx * nu..(k + 1) * nx * nu]);
        }
    }

    /// `[H_x H]` from the last node back: `W_k = Q_k [Φ_k Γ_k] + S_kᵀ E_k + A_kᵀ W_{k+1}`, rows `B_kᵀ W_{k+1} + S_k [Φ_k Γ_k] + R_k E_k`,
    /// where `E_k` are the columns of `u_k`.
    fn accumulate(&mut self, qp: &StageQp) {
        let (nx, nu, n_u) = (self.nx, qp.nu, self.n_u);
        let [mut after, mut own] = std::mem::take(&mut self.adjoint);
        product_with_hessian(qp, qp.n, &self.gamma[self.gamma_at[qp.n]..], nx + n_u, &mut after, Mode::Set);
        for k in (0..qp.n).rev() {
            let (before, width) = (nx + k * nu, nx + (k + 1) * nu);
            let gamma = &self.gamma[self.gamma_at[k]..self.gamma_at[k + 1]];
            transpose(nx, nu, qp.b(k), &mut self.transposed);
            let rows = &mut self.hess[k * nu..];
            let right = Right { v: &after, rs: 1, cs: nx };
            gemm([nu, width, nx], Left { v: &self.transposed, ld: nu }, right, rows, n_u, Mode::Set);
            gemm([nu, before, nx], qp.s(k), Right { v: gamma, rs: 1, cs: nx }, rows, n_u, Mode::Add);
            for j in 0..nu {
                for i in 0..nu {
                    rows[i + (before + j) * n_u] += qp.hess_u[k * nu * nu + i + j * nu];
                }
            }
            if k > 0 {
                transpose(nx, nx, qp.a(k), &mut self.transposed);
                gemm([nx, before, nx], Left { v: &self.transposed, ld: nx }, right, &mut own, nx, Mode::Set);
                product_with_hessian(qp, k, gamma, before, &mut own, Mode::Add);
                std::mem::swap(&mut after, &mut own);
            }
        }
        self.adjoint = [after, own];
    }

    /// Gradient `h` of the controls where `x_0 = 0` and all controls are zero, by one adjoint sweep, and `v_0 = −H⁻¹ h`.
    fn gradient(&mut self, qp: &StageQp) {
        let n_u = self.n_u;
        self.x.fill(0.0);
        self.v.fill(0.0);
        qp.roll_out(&self.v, &mut self.x);
        gradient_at(qp, &self.x, &self.v, &mut self.adjoint, &mut self.h);
        self.v.fill(0.0);
        gemv(n_u, n_u, Left { v: &self.inverse, ld: n_u }, &self.h, &mut self.v);
        self.v.iter_mut().for_each(|v| *v = -*v);
    }

    fn at(&mut self, x0: &[f64]) {
        let (nx, n_u) = (self.nx, self.n_u);
        self.h_now.copy_from_slice(&self.h);
        self.v_now.copy_from_slice(&self.v);
        gemv(n_u, nx, Left { v: &self.hess, ld: n_u }, x0, &mut self.h_now);
        gemv(n_u, nx, Left { v: &self.gain, ld: n_u }, x0, &mut self.v_now);
        self.x[..nx].copy_from_slice(x0);
    }
}

/// `out (+)= Q_k M` with `columns` columns of `M`; a diagonal `Q_k` costs what it holds.
fn product_with_hessian(qp: &StageQp, k: usize, m: &[f64], columns: usize, out: &mut [f64], mode: Mode) {
    let nx = qp.nx;
    let q = qp.q(k);
    let diagonal = (0..nx).all(|j| (0..nx).all(|i| i == j || q.v[i + j * nx] == 0.0));
    if !diagonal {
        gemm([nx, columns, nx], q, Right { v: m, rs: 1, cs: nx }, out, nx, mode);
        return;
    }
    for c in 0..columns {
        let (to, from) = (&mut out[c * nx..(c + 1) * nx], &m[c * nx..(c + 1) * nx]);
        for i in 0..nx {
            let v = q.v[i * (nx + 1)] * from[i];
            to[i] = if mode == Mode::Set { v } else { to[i] + v };
        }
    }
}

fn transpose(m: usize, n: usize, a: Left, out: &mut [f64]) {
    for j in 0..n {
        for i in 0..m {
            out[j + i * n] = a.v[i + j * a.ld];
        }
    }
}

/// Rows of the program as rows of the dense one.
struct Condensed<'a> {
    qp: &'a StageQp,
    gamma: &'a [f64],
    gamma_at: &'a [usize],
    x: &'a mut [f64],
    adjoint: &'a mut [Vec<f64>; 2],
}

impl Rows for Condensed<'_> {
    fn values(&mut self, u: &[f64], out: &mut [f64]) {
        self.qp.roll_out(u, self.x);
        out.iter_mut().enumerate().for_each(|(i, v)| *v = self.qp.row_value(i, self.x, u));
    }

    fn form(&mut self, i: usize, a: &mut [f64]) {
        let (nx, nu, k) = (self.qp.nx, self.qp.nu, self.qp.rows[i].node);
        a.fill(0.0);
        let gamma = Left { v: &self.gamma[self.gamma_at[k] + nx * nx..self.gamma_at[k + 1]], ld: nx };
        gemv_transposed(nx, k * nu, gamma, &self.qp.row_x[i * nx..(i + 1) * nx], a);
        if let Some((at, own)) = self.qp.own_controls(i) {
            a[at..at + nu].copy_from_slice(own);
        }
    }

    fn gradient(&mut self, u: &[f64], out: &mut [f64]) {
        self.qp.roll_out(u, self.x);
        gradient_at(self.qp, self.x, u, self.adjoint, out);
    }
}

/// Derivatives of the cost by the controls at states that follow the dynamics, by one adjoint sweep.
fn gradient_at(qp: &StageQp, x: &[f64], u: &[f64], adjoint: &mut [Vec<f64>; 2], out: &mut [f64]) {
    let (nx, nu) = (qp.nx, qp.nu);
    let [next, own] = adjoint;
    let (next, own) = (&mut next[..nx], &mut own[..nx]);
    next.copy_from_slice(&qp.grad_x[qp.n * nx..]);
    gemv(nx, nx, qp.q(qp.n), &x[qp.n * nx..], next);
    for k in (0..qp.n).rev() {
        let (x, u) = (&x[k * nx..(k + 1) * nx], &u[k * nu..(k + 1) * nu]);
        let h = &mut out[k * nu..(k + 1) * nu];
        h.copy_from_slice(&qp.grad_u[k * nu..(k + 1) * nu]);
        gemv(nu, nx, qp.s(k), x, h);
        gemv(nu, nu, qp.r(k), u, h);
        gemv_transposed(nx, nu, qp.b(k), next, h);
        own.copy_from_slice(&qp.grad_x[k * nx..(k + 1) * nx]);
        gemv(nx, nx, qp.q(k), x, own);
        gemv_transposed(nu, nx, qp.s(k), u, own);
        gemv_transposed(nx, nx, qp.a(k), next, own);
        next.copy_from_slice(own);
    }
}

impl QpSolver for Condensing {
    fn name(&self) -> &'static str {
        "condensing"
    }

    fn prepare(&mut self, qp: &StageQp) -> bool {
        let (nx, n_u) = (self.nx, self.n_u);
        self.propagate(qp);
        self.accumulate(qp);
        self.factor.copy_from_slice(&self.hess[n_u * nx..]);
        self.ready = potrf(n_u, &mut self.factor, n_u);
        if !self.ready {
            return false;
        }
        let [x, xt] = &mut self.scratch;
        inverse(n_u, &self.factor, n_u, x, xt, &mut self.inverse);
        // the lower triangle is what was computed
        let hess = &mut self.hess[n_u * nx..];
        for j in 0..n_u {
            for i in j + 1..n_u {
                hess[j + i * n_u] = hess[i + j * n_u];
            }
        }
        let right = Right { v: &self.hess, rs: 1, cs: n_u };
        self.gain.fill(0.0);
        gemm([n_u, nx, n_u], Left { v: &self.inverse, ld: n_u }, right, &mut self.gain, n_u, Mode::Subtract);
        let largest = |m: &[f64]| (0..n_u).fold(0.0f64, |v, i| v.max(m[i * (n_u + 1)]));
        self.condition = largest(&self.hess[n_u * nx..]) * largest(&self.inverse);
        self.gradient(qp);
        let Condensing { gamma, gamma_at, x, adjoint, inverse, active_set, .. } = self;
        active_set.prepare(inverse, &mut Condensed { qp, gamma, gamma_at, x, adjoint });
        self.ready = self.h.iter().chain(&self.v).all(|v| v.is_finite());
        self.ready
    }

    fn refresh(&mut self, qp: &StageQp) {
        if self.ready {
            self.gradient(qp);
        }
    }

    fn solve(&mut self, qp: &StageQp, x0: &[f64], terms: &Terms) -> QpStatus {
        if !self.ready || !x0.iter().all(|v| v.is_finite()) {
            return QpStatus::Failed;
        }
        self.at(x0);
        let nx = self.nx;
        let by_states = self.condition > BAD;
        let Condensing { gamma, gamma_at, x, adjoint, inverse, hess, h_now, v_now, active_set, .. } = self;
        let program = Program {
            hessian: &hess[h_now.len() * nx..],
            inverse,
            gradient: h_now,
            free: v_now,
            lower: &qp.u_lower,
            upper: &qp.u_upper,
            row_lower: &qp.row_lower,
            row_upper: &qp.row_upper,
            rows: &qp.rows,
            corrections: if by_states { 2 } else { 1 },
            by_states,
        };
        active_set.solve(&program, &mut Condensed { qp, gamma, gamma_at, x, adjoint }, terms)
    }

    fn controls(&self) -> &[f64] {
        self.active_set.solution()
    }

    fn expand(&mut self, qp: &StageQp, out: &mut QpSolution) {
        out.u.copy_from_slice(self.active_set.solution());
        out.x[..self.nx].copy_from_slice(&self.x[..self.nx]);
        qp.roll_out(&out.u, &mut out.x);
        self.active_set.multipliers(&mut out.u_mu, &mut out.row_mu);
        qp.multipliers(&out.x, &out.u, &out.row_mu, &mut out.lambda);
    }

    fn tangent(&mut self, qp: &StageQp, x0: &[f64]) -> &[f64] {
        if self.ready {
            self.at(x0);
        }
        let bounds = qp.u_lower.iter().zip(&qp.u_upper);
        self.v_now.iter_mut().zip(bounds).for_each(|(v, (l, u))| *v = v.max(*l).min(*u));
        &self.v_now
    }

    fn iterations(&self) -> usize {
        self.active_set.iterations()
    }

    fn shift(&mut self, qp: &StageQp) {
        let rows = &qp.rows;
        self.active_set.shift(qp.nu, |i| {
            // the row of the same kind one node earlier: as many rows behind the first of its node
            let node = rows[i].node.checked_sub(1)?;
            let first = |k: usize| rows.partition_point(|r| r.node < k);
            let j = first(node) + (i - first(node + 1));
            (j < rows.len() && rows[j].node == node).then_some(j)
        });
    }

    fn reset(&mut self) {
        self.active_set.reset();
    }
}
