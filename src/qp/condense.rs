//! States eliminated: a dense program in the controls, made and factorised in the preparation.
//!
//! With `x_k = Φ_k x_0 + Γ_k U + g_k` the program has a Hessian `H` in the controls `U` of all stages. A Riccati recursion
//!
//! ```text
//! Λ_k = R_k + B_kᵀ P_{k+1} B_k = L_k L_kᵀ,   K_k = Λ_k⁻¹ (S_k + B_kᵀ P_{k+1} A_k),
//! P_k = Q_k + A_kᵀ P_{k+1} A_k − K_kᵀ Λ_k K_k
//! ```
//!
//! completes the squares, `½ Uᵀ H U = Σ ½ |L_kᵀ (u_k + K_k x_k)|²`, so that `u_k = −K_k x_k + L_k⁻ᵀ w_k` with free `w_k` gives a
//! factor of the inverse: `U = T W`, `H⁻¹ = T Tᵀ`. The columns of `T` and of the affine law `V` (`U = V x_0` without
//! constraints) are responses of the controlled system `A_k − B_k K_k`, one block of all columns of a stage at a time. Neither `H` nor
//! its Cholesky factor is formed; nothing cancels where the system itself is unstable and the controlled one is not (J. A.
//! Rossiter, B. Kouvaritakis, M. J. Rice, *A numerically robust state-space approach to stable-predictive control strategies*,
//! 1998; G. Frison, *Algorithms and Methods for High-Performance Model Predictive Control*, 2015). `Λ_k` are the Schur
//! complements of `H`: they are positive definite where it is.

use super::dual::{DualActiveSet, Program, Rows};
use super::{Initial, QpSolution, QpSolver, QpStatus, StageQp, Terms};
use crate::error::{Error, Result};
use crate::linalg::dense::{axpy, dot, gemm, gemv, gemv_transposed, inverse_root, potrf};
use crate::linalg::dense::{Left, Mode, Right, TILE_COLS};

/// From this condition of the Hessian on, the solution is corrected by the gradient that the states give.
const BAD: f64 = 1e4;
/// Columns of the triangle of a symmetric product that are computed at once.
const PANEL: usize = 8;

/// Condensing with a dual active-set method.
pub struct Condensing {
    nx: usize,
    nu: usize,
    /// Controls of all stages.
    n_u: usize,
    /// `nu` with zeros up to whole tiles of columns.
    wide: usize,
    /// `P_k` of every node, of `−K_kᵀ` (`nx × wide`) and `L_k⁻ᵀ` (`wide × wide`) of every stage.
    value: Vec<f64>,
    gain: Vec<f64>,
    root: Vec<f64>,
    scratch: Scratch,
    /// Response of the controlled system at two nodes, `(nx + n_u) × nx`: rows are columns of `[Φ Γ T]`.
    response: [Vec<f64>; 2],
    /// `[V T]ᵀ`, `(nx + n_u) × n_u`, with room for whole tiles.
    law: Vec<f64>,
    /// `T`, and `H⁻¹`.
    factor: Vec<f64>,
    inverse: Vec<f64>,
    /// Solution without constraints for `x_0 = 0`, and for the present `x_0`.
    v: Vec<f64>,
    v_now: Vec<f64>,
    x: Vec<f64>,
    adjoint: [Vec<f64>; 2],
    slope: Vec<f64>,
    by_factor: Vec<f64>,
    ready: bool,
    /// A lower bound of the condition of `H`.
    condition: f64,
    active_set: DualActiveSet,
}

/// Matrices of one stage.
struct Scratch {
    /// `B`, `P B`, `Aᵀ P B + Sᵀ`, `(Aᵀ P B + Sᵀ) L⁻ᵀ`, all `nx × wide`.
    b: Vec<f64>,
    pb: Vec<f64>,
    cross: Vec<f64>,
    half: Vec<f64>,
    /// `Λ` and its factor.
    pivot: Vec<f64>,
    /// `[Aᵀ −half]`, `[P A; halfᵀ]`: their product is `P_k − Q_k`.
    left: Vec<f64>,
    right: Vec<f64>,
    /// `A − B K`.
    closed: Vec<f64>,
}

impl Condensing {
    /// Room for programs of the size of `qp`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a free first state.
    pub fn new(qp: &StageQp) -> Result<Condensing> {
        if qp.initial != Initial::Given {
            return Err(Error::Unsupported(
                "condensing needs a given first state: solve this program stage by stage".into(),
            ));
        }
        let (n, nx, nu) = (qp.n, qp.nx, qp.nu);
        let n_u = n * nu;
        let wide = nu.div_ceil(TILE_COLS) * TILE_COLS;
        let zeros = |n: usize| vec![0.0; n];
        Ok(Condensing {
            nx,
            nu,
            n_u,
            wide,
            value: zeros((n + 1) * nx * nx),
            gain: zeros(n * nx * wide),
            root: zeros(n * wide * wide),
            scratch: Scratch {
                b: zeros(nx * wide),
                pb: zeros(nx * wide),
                cross: zeros(nx * wide),
                half: zeros(nx * wide),
                pivot: zeros(nu * nu),
                left: zeros(nx * (nx + nu)),
                right: zeros((nx + nu) * nx),
                closed: zeros(nx * nx),
            },
            response: [zeros((nx + n_u) * nx), zeros((nx + n_u) * nx)],
            law: zeros((nx + n_u) * (n_u + wide - nu)),
            factor: zeros(n_u * n_u),
            inverse: zeros(n_u * n_u),
            v: zeros(n_u),
            v_now: zeros(n_u),
            x: zeros((n + 1) * nx),
            adjoint: [zeros(nx), zeros(nx)],
            slope: zeros(nu),
            by_factor: zeros(n_u),
            ready: false,
            condition: 1.0,
            active_set: DualActiveSet::new(n_u, qp.rows.len()),
        })
    }

    /// The Riccati recursion; false where a `Λ_k` is not positive definite.
    fn recur(&mut self, qp: &StageQp) -> bool {
        let (nx, n) = (self.nx, qp.n);
        self.value[n * nx * nx..].copy_from_slice(&qp.hess_x[n * nx * nx..]);
        (0..n).rev().all(|k| self.eliminate(qp, k))
    }

    /// One stage of it.
    fn eliminate(&mut self, qp: &StageQp, k: usize) -> bool {
        let (nx, nu, wide) = (self.nx, self.nu, self.wide);
        let Scratch { b, pb, cross, half, pivot, left, right, .. } = &mut self.scratch;
        let (own, after) = self.value[k * nx * nx..(k + 2) * nx * nx].split_at_mut(nx * nx);
        let next = Left { v: after, ld: nx };
        b[..nx * nu].copy_from_slice(&qp.b[k * nx * nu..(k + 1) * nx * nu]);
        gemm([nx, wide, nx], next, Right { v: b, rs: 1, cs: nx }, pb, nx, Mode::Set);
        for j in 0..nu {
            for i in j..nu {
                let product = dot(&b[i * nx..(i + 1) * nx], &pb[j * nx..(j + 1) * nx]);
                pivot[i + j * nu] = qp.hess_u[k * nu * nu + i + j * nu] + product;
            }
        }
        if !potrf(nu, pivot, nu) {
            return false;
        }
        let root = &mut self.root[k * wide * wide..(k + 1) * wide * wide];
        inverse_root(nu, pivot, nu, root, wide);
        transpose(nx, nx, qp.a(k), left);
        gemm([nx, wide, nx], Left { v: left, ld: nx }, Right { v: pb, rs: 1, cs: nx }, cross, nx, Mode::Set);
        let s = &qp.hess_xu[k * nu * nx..(k + 1) * nu * nx];
        for i in 0..nx {
            for j in 0..nu {
                cross[i + j * nx] += s[j + i * nu];
            }
        }
        let by_root = Right { v: root, rs: 1, cs: wide };
        gemm([nx, wide, nu], Left { v: cross, ld: nx }, by_root, half, nx, Mode::Set);
        let gain = &mut self.gain[k * nx * wide..(k + 1) * nx * wide];
        let by_transposed = Right { v: root, rs: wide, cs: 1 };
        gemm([nx, wide, nu], Left { v: half, ld: nx }, by_transposed, gain, nx, Mode::Set);
        gain.iter_mut().for_each(|v| *v = -*v);
        // the value of the first node is of no use
        if k == 0 {
            return true;
        }
        gemm([nx, nx, nx], next, Right { v: &qp.a[k * nx * nx..], rs: 1, cs: nx }, right, nx + nu, Mode::Set);
        for j in 0..nu {
            for i in 0..nx {
                left[i + (nx + j) * nx] = -half[i + j * nx];
                right[nx + j + i * (nx + nu)] = half[i + j * nx];
            }
        }
        for j in (0..nx).step_by(PANEL) {
            let (rows, columns) = (nx - j, PANEL.min(nx - j));
            let right = Right { v: &right[j * (nx + nu)..], rs: 1, cs: nx + nu };
            let to = &mut own[j * (nx + 1)..];
            gemm([rows, columns, nx + nu], Left { v: &left[j..], ld: nx }, right, to, nx, Mode::Set);
        }
        let q = &qp.hess_x[k * nx * nx..(k + 1) * nx * nx];
        for j in 0..nx {
            for i in j..nx {
                let v = own[i + j * nx] + q[i + j * nx];
                (own[i + j * nx], own[j + i * nx]) = (v, v);
            }
        }
        true
    }

    /// `V` and `T` by the responses of the controlled system, and `H⁻¹ = T Tᵀ`.
    fn respond(&mut self, qp: &StageQp) {
        let (nx, nu, n_u, wide) = (self.nx, self.nu, self.n_u, self.wide);
        let ld = nx + n_u;
        let [mut own, mut next] = std::mem::take(&mut self.response);
        for j in 0..nx {
            own[j * ld..j * ld + nx].fill(0.0);
            own[j + j * ld] = 1.0;
        }
        for k in 0..qp.n {
            let columns = nx + k * nu;
            let gain = &self.gain[k * nx * wide..(k + 1) * nx * wide];
            let root = &self.root[k * wide * wide..(k + 1) * wide * wide];
            // the columns behind the stage's own are written later
            let law = &mut self.law[k * nu * ld..];
            let by_gain = Right { v: gain, rs: 1, cs: nx };
            gemm([columns, wide, nx], Left { v: &own, ld }, by_gain, law, ld, Mode::Set);
            for j in 0..nu {
                (0..nu).for_each(|i| law[columns + j + i * ld] = root[i + j * wide]);
            }
            if k + 1 == qp.n {
                break;
            }
            let (a, b) = (&qp.a[k * nx * nx..(k + 1) * nx * nx], qp.b(k));
            let closed = &mut self.scratch.closed;
            closed.copy_from_slice(a);
            gemm([nx, nx, nu], b, Right { v: gain, rs: nx, cs: 1 }, closed, nx, Mode::Add);
            let by_closed = Right { v: closed, rs: nx, cs: 1 };
            gemm([columns, nx, nx], Left { v: &own, ld }, by_closed, &mut next, ld, Mode::Set);
            // the columns of the stage's own controls, B L⁻ᵀ
            for j in 0..nu {
                for i in 0..nx {
                    next[columns + j + i * ld] = (0..=j).map(|l| b.v[i + l * nx] * root[l + j * wide]).sum();
                }
            }
            std::mem::swap(&mut own, &mut next);
        }
        self.response = [own, next];
        for i in 0..n_u {
            let columns = (i / nu + 1) * nu;
            for j in 0..columns {
                self.factor[i + j * n_u] = self.law[nx + j + i * ld];
            }
        }
        for j in (0..n_u).step_by(PANEL) {
            let columns = PANEL.min(n_u - j);
            // where the rows of T end
            let inner = ((j + columns - 1) / nu + 1) * nu;
            let left = Left { v: &self.factor[j..], ld: n_u };
            let right = Right { v: &self.law[nx + j * ld..], rs: 1, cs: ld };
            let to = &mut self.inverse[j * (n_u + 1)..];
            gemm([n_u - j, columns, inner], left, right, to, n_u, Mode::Set);
        }
        for j in 0..n_u {
            for i in j + 1..n_u {
                self.inverse[j + i * n_u] = self.inverse[i + j * n_u];
            }
        }
    }

    /// Controls of the minimum for `x_0 = 0`: the affine part of the recursion, then the controlled system.
    fn affine(&mut self, qp: &StageQp) {
        let (nx, nu, wide) = (self.nx, self.nu, self.wide);
        let [p, before] = &mut self.adjoint;
        p.copy_from_slice(&qp.grad_x[qp.n * nx..]);
        for k in (0..qp.n).rev() {
            let value = Left { v: &self.value[(k + 1) * nx * nx..], ld: nx };
            gemv(nx, nx, value, &qp.c[k * nx..(k + 1) * nx], p);
            let slope = &mut self.v_now[k * nu..(k + 1) * nu];
            slope.copy_from_slice(&qp.grad_u[k * nu..(k + 1) * nu]);
            gemv_transposed(nx, nu, qp.b(k), p, slope);
            before.copy_from_slice(&qp.grad_x[k * nx..(k + 1) * nx]);
            gemv_transposed(nx, nx, qp.a(k), p, before);
            gemv(nx, nu, Left { v: &self.gain[k * nx * wide..], ld: nx }, slope, before);
            std::mem::swap(p, before);
        }
        self.x[..nx].fill(0.0);
        let half = &mut self.scratch.half[..nu];
        for k in 0..qp.n {
            let root = Left { v: &self.root[k * wide * wide..], ld: wide };
            let (x, next) = self.x[k * nx..(k + 2) * nx].split_at_mut(nx);
            let u = &mut self.v[k * nu..(k + 1) * nu];
            // −Λ⁻¹ (r + Bᵀ p) − K x
            half.fill(0.0);
            gemv_transposed(nu, nu, root, &self.v_now[k * nu..(k + 1) * nu], half);
            half.iter_mut().for_each(|v| *v = -*v);
            u.fill(0.0);
            gemv(nu, nu, root, half, u);
            gemv_transposed(nx, nu, Left { v: &self.gain[k * nx * wide..], ld: nx }, x, u);
            qp.step(k, x, u, next);
        }
    }

    /// Largest of what is known of the eigenvalues of `H` and of its inverse: how the cost grows with all controls of the first stage
    /// alike, whose effect lasts longest, and diagonal entries.
    fn estimate_condition(&mut self, qp: &StageQp) {
        let (nx, nu, n_u) = (self.nx, self.nu, self.n_u);
        let [x, qx] = &mut self.adjoint;
        x.fill(0.0);
        qp.b[..nx * nu].chunks_exact(nx).for_each(|b| axpy(1.0, b, x));
        let mut size: f64 = qp.hess_u[..nu * nu].iter().sum();
        for k in 1..=qp.n {
            qx.fill(0.0);
            gemv(nx, nx, qp.q(k), x, qx);
            size += dot(x, qx);
            if k < qp.n {
                qx.fill(0.0);
                gemv(nx, nx, qp.a(k), x, qx);
                std::mem::swap(x, qx);
            }
        }
        let largest = (0..n_u).fold(0.0f64, |v, i| v.max(self.inverse[i * (n_u + 1)]));
        self.condition = size / nu as f64 * largest;
    }

    /// The parts of the dense program.
    fn dense<'a>(&'a mut self, qp: &'a StageQp) -> (&'a [f64], &'a mut DualActiveSet, Condensed<'a>) {
        let Condensing { wide, gain, root, factor, inverse, x, adjoint, slope, by_factor, active_set, .. } = self;
        let rows = Condensed { qp, gain, root, wide: *wide, factor, x, adjoint, slope, by_factor };
        (inverse, active_set, rows)
    }

    fn at(&mut self, x0: &[f64]) {
        let (nx, n_u) = (self.nx, self.n_u);
        self.v_now.copy_from_slice(&self.v);
        gemv_transposed(nx, n_u, Left { v: &self.law, ld: nx + n_u }, x0, &mut self.v_now);
        self.x[..nx].copy_from_slice(x0);
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
    /// The controlled system, and `T`.
    gain: &'a [f64],
    root: &'a [f64],
    wide: usize,
    factor: &'a [f64],
    x: &'a mut [f64],
    adjoint: &'a mut [Vec<f64>; 2],
    /// Vectors of the controls of a stage, and of all.
    slope: &'a mut [f64],
    by_factor: &'a mut [f64],
}

impl Condensed<'_> {
    fn gain(&self, k: usize) -> Left<'_> {
        Left { v: &self.gain[k * self.qp.nx * self.wide..], ld: self.qp.nx }
    }

    /// `Tᵀ a_i` by an adjoint sweep through the controlled system: nothing is large there that cancels in `P a_i = T Tᵀ a_i`.
    fn transformed(&mut self, i: usize) {
        let (nx, nu, wide, k) = (self.qp.nx, self.qp.nu, self.wide, self.qp.rows[i].node);
        let [mut own, mut before] = std::mem::take(self.adjoint);
        self.by_factor.fill(0.0);
        own.copy_from_slice(&self.qp.row_x[i * nx..(i + 1) * nx]);
        let first = usize::from(k == self.qp.n);
        for j in (0..=k - first).rev() {
            let slope = &mut self.slope[..nu];
            slope.fill(0.0);
            before.fill(0.0);
            if j < k {
                gemv_transposed(nx, nu, self.qp.b(j), &own, slope);
                gemv_transposed(nx, nx, self.qp.a(j), &own, &mut before);
            } else {
                slope.copy_from_slice(&self.qp.row_u[i * nu..(i + 1) * nu]);
                before.copy_from_slice(&own);
            }
            let root = Left { v: &self.root[j * wide * wide..], ld: wide };
            gemv_transposed(nu, nu, root, &self.slope[..nu], &mut self.by_factor[j * nu..(j + 1) * nu]);
            gemv(nx, nu, self.gain(j), &self.slope[..nu], &mut before);
            std::mem::swap(&mut own, &mut before);
        }
        *self.adjoint = [own, before];
    }
}

impl Rows for Condensed<'_> {
    fn values(&mut self, u: &[f64], out: &mut [f64]) {
        self.qp.roll_out(u, self.x);
        out.iter_mut().enumerate().for_each(|(i, v)| *v = self.qp.row_value(i, self.x, u));
    }

    fn form(&mut self, i: usize, a: &mut [f64], pa: &mut [f64]) {
        let (nx, nu, k) = (self.qp.nx, self.qp.nu, self.qp.rows[i].node);
        a.fill(0.0);
        let [own, before] = &mut *self.adjoint;
        own.copy_from_slice(&self.qp.row_x[i * nx..(i + 1) * nx]);
        for j in (0..k).rev() {
            gemv_transposed(nx, nu, self.qp.b(j), own, &mut a[j * nu..(j + 1) * nu]);
            before.fill(0.0);
            gemv_transposed(nx, nx, self.qp.a(j), own, before);
            std::mem::swap(own, before);
        }
        if let Some((at, own)) = self.qp.own_controls(i) {
            a[at..at + nu].copy_from_slice(own);
        }
        self.transformed(i);
        pa.fill(0.0);
        gemv(a.len(), a.len(), Left { v: self.factor, ld: a.len() }, self.by_factor, pa);
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
        std::mem::swap(next, own);
    }
}

impl QpSolver for Condensing {
    fn name(&self) -> &'static str {
        "condensing"
    }

    fn prepare(&mut self, qp: &StageQp) -> bool {
        self.ready = self.recur(qp);
        if !self.ready {
            return false;
        }
        self.respond(qp);
        self.affine(qp);
        self.estimate_condition(qp);
        let (inverse, active_set, mut rows) = self.dense(qp);
        active_set.prepare(inverse, &mut rows);
        self.ready = self.v.iter().all(|v| v.is_finite());
        self.ready
    }

    fn refresh(&mut self, qp: &StageQp) {
        if self.ready {
            self.affine(qp);
        }
    }

    fn solve(&mut self, qp: &StageQp, x0: &[f64], terms: &Terms) -> QpStatus {
        if !self.ready || !x0.iter().all(|v| v.is_finite()) {
            return QpStatus::Failed;
        }
        self.at(x0);
        let free = std::mem::take(&mut self.v_now);
        let ill_conditioned = self.condition > BAD;
        let (inverse, active_set, mut rows) = self.dense(qp);
        let program = Program::new(qp, inverse, &free, ill_conditioned);
        let status = active_set.solve(&program, &mut rows, terms);
        self.v_now = free;
        status
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

    fn tangent(&mut self, _qp: &StageQp, x0: &[f64]) -> &[f64] {
        if self.ready {
            self.at(x0);
        }
        &self.v_now
    }

    fn gains(&self, out: &mut [f64]) -> bool {
        let (nx, nu, wide) = (self.nx, self.nu, self.wide);
        for (to, from) in out.chunks_exact_mut(nu * nx).zip(self.gain.chunks_exact(nx * wide)) {
            transpose(nx, nu, Left { v: from, ld: nx }, to);
        }
        self.ready
    }

    fn cost_of_rows(&mut self, qp: &StageQp) -> f64 {
        let program = Program::new(qp, &self.inverse, &self.v_now, self.condition > BAD);
        self.active_set.cost_of_rows(&program)
    }

    fn violates(&self, qp: &StageQp) -> bool {
        self.active_set.violates(&qp.rows)
    }

    fn iterations(&self) -> usize {
        self.active_set.iterations()
    }

    fn shift(&mut self, qp: &StageQp) {
        self.active_set.shift(qp.nu, |i| qp.earlier_row(i));
    }

    fn reset(&mut self) {
        self.active_set.reset();
    }
}
