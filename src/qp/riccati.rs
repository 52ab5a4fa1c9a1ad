//! Newton steps of programs with stages, in time linear in their number.
//!
//! With `z_k = [u_k; x_k]`, blocks `H_k`, weights `W_i` of rows `a_i` and `F_k = [B_k A_k]`, the recursion
//!
//! ```text
//! M_k = H_k + Σ_i W_i a_i a_iᵀ + F_kᵀ P_{k+1} F_k = [Λ_k ·; G_k ·],   Λ_k = L_k L_kᵀ,   Y_k = G_k L_k⁻ᵀ,
//! P_k = (M_k)_xx − Y_k Y_kᵀ
//! ```
//!
//! eliminates the controls from the last stage to the first (G. Frison, J. B. Jørgensen, *Efficient implementation of the Riccati
//! recursion for solving linear-quadratic control problems*, 2013; G. Frison, M. Diehl, *HPIPM: a high-performance quadratic programming
//! framework for model predictive control*, 2020). A stage depends on those behind it alone: where weights change up to stage `k`, only the stages
//! `0..=k` are made anew. Controls that are fixed have a row and a column of the identity.
//!
//! Steps follow from a sweep back with the gradient and one forth with the controlled system, so that nothing grows where the system is
//! unstable and the controlled one is not. Multipliers of the dynamics are `λ_k = P_k dx_k + p_k`.

use super::{Initial, StageQp};
use crate::linalg::dense::{axpy, dot, gemm, gemv, gemv_transposed, potrf, Left, Mode, Right};

/// Columns of the triangle of a symmetric product that are computed at once.
const PANEL: usize = 8;

/// Matrices of a program as the recursion reads them.
pub(super) struct Blocks {
    pub n: usize,
    pub nx: usize,
    pub nu: usize,
    /// `nx + nu`.
    pub w: usize,
    /// `[R S; Sᵀ Q]`, `w × w`, for every node; no controls at the last.
    hess: Vec<f64>,
    /// `[B A]`, `nx × w`.
    f: Vec<f64>,
    /// `[D C]`, `w`, for every row.
    pub rows: Vec<f64>,
    /// Rows of node `k` are `first[k]..first[k + 1]`.
    pub first: Vec<usize>,
}

impl Blocks {
    pub fn new(qp: &StageQp) -> Blocks {
        let (n, nx, nu) = (qp.n, qp.nx, qp.nu);
        let w = nx + nu;
        let first = (0..n + 2).map(|k| qp.rows.partition_point(|r| r.node < k)).collect();
        Blocks {
            n,
            nx,
            nu,
            w,
            hess: vec![0.0; (n + 1) * w * w],
            f: vec![0.0; n * nx * w],
            rows: vec![0.0; qp.rows.len() * w],
            first,
        }
    }

    /// Copies the matrices.
    pub fn take(&mut self, qp: &StageQp) {
        let (nx, nu, w) = (self.nx, self.nu, self.w);
        for k in 0..=self.n {
            let block = &mut self.hess[k * w * w..(k + 1) * w * w];
            for j in 0..nx {
                let column = &mut block[(nu + j) * w..(nu + j + 1) * w];
                column[nu..].copy_from_slice(&qp.hess_x[(k * nx + j) * nx..(k * nx + j + 1) * nx]);
                if k < self.n {
                    column[..nu].copy_from_slice(&qp.hess_xu[(k * nx + j) * nu..(k * nx + j + 1) * nu]);
                }
            }
            if k == self.n {
                break;
            }
            for j in 0..nu {
                block[j * w..j * w + nu].copy_from_slice(&qp.hess_u[(k * nu + j) * nu..(k * nu + j + 1) * nu]);
                (0..nx).for_each(|i| block[j * w + nu + i] = block[(nu + i) * w + j]);
            }
            let f = &mut self.f[k * nx * w..(k + 1) * nx * w];
            f[..nx * nu].copy_from_slice(&qp.b[k * nx * nu..(k + 1) * nx * nu]);
            f[nx * nu..].copy_from_slice(&qp.a[k * nx * nx..(k + 1) * nx * nx]);
        }
        for (i, row) in self.rows.chunks_exact_mut(w).enumerate() {
            row[..nu].copy_from_slice(&qp.row_u[i * nu..(i + 1) * nu]);
            row[nu..].copy_from_slice(&qp.row_x[i * nx..(i + 1) * nx]);
            if qp.rows[i].node == self.n {
                row[..nu].fill(0.0);
            }
        }
    }

    fn hess(&self, k: usize) -> Left<'_> {
        Left { v: &self.hess[k * self.w * self.w..], ld: self.w }
    }

    pub fn f(&self, k: usize) -> Left<'_> {
        Left { v: &self.f[k * self.nx * self.w..], ld: self.nx }
    }

    pub fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.w..(i + 1) * self.w]
    }

    /// Gradient of the cost at `z`, `[(n + 1) · w]`, and values of all rows.
    pub fn gradient(&self, qp: &StageQp, z: &[f64], g: &mut [f64], values: &mut [f64]) {
        let (nx, nu, w) = (self.nx, self.nu, self.w);
        for k in 0..=self.n {
            let (own, g) = (&z[k * w..(k + 1) * w], &mut g[k * w..(k + 1) * w]);
            match k < self.n {
                true => g[..nu].copy_from_slice(&qp.grad_u[k * nu..(k + 1) * nu]),
                false => g[..nu].fill(0.0),
            }
            g[nu..].copy_from_slice(&qp.grad_x[k * nx..(k + 1) * nx]);
            gemv(w, w, self.hess(k), own, g);
            for i in self.first[k]..self.first[k + 1] {
                values[i] = dot(self.row(i), own);
            }
        }
    }

    /// What `z` leaves of the dynamics, `A x + B u + c − x⁺`.
    pub fn gaps(&self, qp: &StageQp, z: &[f64], c: &mut [f64]) {
        let (nx, nu, w) = (self.nx, self.nu, self.w);
        for k in 0..self.n {
            let c = &mut c[k * nx..(k + 1) * nx];
            c.copy_from_slice(&qp.c[k * nx..(k + 1) * nx]);
            gemv(nx, w, self.f(k), &z[k * w..(k + 1) * w], c);
            c.iter_mut().zip(&z[(k + 1) * w + nu..(k + 2) * w]).for_each(|(c, x)| *c -= x);
        }
    }
}

/// Weights a factorisation has: fixed controls, weights of the other controls and of rows.
#[derive(Clone, PartialEq)]
pub(super) struct Weights {
    pub fixed: Vec<bool>,
    pub u: Vec<f64>,
    pub rows: Vec<f64>,
}

impl Weights {
    pub fn new(n_u: usize, rows: usize) -> Weights {
        Weights { fixed: vec![false; n_u], u: vec![0.0; n_u], rows: vec![0.0; rows] }
    }

    pub fn clear(&mut self) {
        self.fixed.fill(false);
        self.u.fill(0.0);
        self.rows.fill(0.0);
    }

    pub fn copy_from(&mut self, other: &Weights) {
        self.fixed.copy_from_slice(&other.fixed);
        self.u.copy_from_slice(&other.u);
        self.rows.copy_from_slice(&other.rows);
    }
}

/// The recursion's factors.
pub(super) struct Recursion {
    n: usize,
    nx: usize,
    nu: usize,
    w: usize,
    /// `[L; Y]`, `w × nu`, of every stage.
    panel: Vec<f64>,
    /// `P_k`, both triangles.
    pub value: Vec<f64>,
    /// Cholesky factor of `P_0` and the weight of the arrival, where the first state is free.
    first: Vec<f64>,
    block: Vec<f64>,
    pf: Vec<f64>,
    transposed: Vec<f64>,
    /// Stages from here on have the weights that were given last; `n + 1`: none.
    valid: usize,
}

/// A step: `dz`, `[(n + 1) · w]`, with the multipliers of the dynamics; `lp` and `p` belong to the sweep back.
pub(super) struct Sweep {
    pub dz: Vec<f64>,
    pub lambda: Vec<f64>,
    lp: Vec<f64>,
    p: Vec<f64>,
    h: Vec<f64>,
    m: Vec<f64>,
}

impl Sweep {
    pub fn new(b: &Blocks) -> Sweep {
        Sweep {
            dz: vec![0.0; (b.n + 1) * b.w],
            lambda: vec![0.0; (b.n + 1) * b.nx],
            lp: vec![0.0; b.n * b.nu],
            p: vec![0.0; (b.n + 1) * b.nx],
            h: vec![0.0; b.nx],
            m: vec![0.0; b.w],
        }
    }
}

/// `L v = b` in place with a lower triangle whose columns are `ld` apart.
fn forth(n: usize, l: &[f64], ld: usize, v: &mut [f64]) {
    for j in 0..n {
        v[j] /= l[j + j * ld];
        let f = v[j];
        axpy(-f, &l[j + 1 + j * ld..n + j * ld], &mut v[j + 1..n]);
    }
}

/// `Lᵀ v = b` in place.
fn back(n: usize, l: &[f64], ld: usize, v: &mut [f64]) {
    for j in (0..n).rev() {
        v[j] = (v[j] - dot(&l[j + 1 + j * ld..n + j * ld], &v[j + 1..n])) / l[j + j * ld];
    }
}

impl Recursion {
    pub fn new(b: &Blocks) -> Recursion {
        let (n, nx, nu, w) = (b.n, b.nx, b.nu, b.w);
        Recursion {
            n,
            nx,
            nu,
            w,
            panel: vec![0.0; n * w * nu],
            value: vec![0.0; (n + 1) * nx * nx],
            first: vec![0.0; nx * nx],
            block: vec![0.0; w * w],
            pf: vec![0.0; nx * w],
            transposed: vec![0.0; nx * w],
            valid: n + 1,
        }
    }

    /// Nothing is known any more.
    pub fn forget(&mut self) {
        self.valid = self.n + 1;
    }

    /// The weights of stage `k` are other ones than before.
    pub fn touch(&mut self, k: usize) {
        self.valid = self.valid.max(k + 1);
    }

    /// Makes what is not valid; false where a pivot is not positive definite. The number of stages that were made is added to `work`.
    pub fn factorise(&mut self, b: &Blocks, weights: &Weights, qp: &StageQp, work: &mut u64) -> bool {
        if self.valid == 0 {
            return true;
        }
        let from = self.valid - 1;
        for k in (0..=from).rev() {
            *work += 1;
            if !self.stage(b, weights, k) {
                self.valid = k + 1;
                return false;
            }
        }
        self.valid = 0;
        let nx = self.nx;
        let Initial::Free(weight) = &qp.initial else { return true };
        for (to, (p, w)) in self.first.iter_mut().zip(self.value.iter().zip(weight)) {
            *to = p + w;
        }
        let good = potrf(nx, &mut self.first, nx);
        if !good {
            self.forget();
        }
        good
    }

    fn stage(&mut self, b: &Blocks, weights: &Weights, k: usize) -> bool {
        let (n, nx, nu, w) = (self.n, self.nx, self.nu, self.w);
        let block = &mut self.block[..];
        block.copy_from_slice(&b.hess[k * w * w..(k + 1) * w * w]);
        for i in b.first[k]..b.first[k + 1] {
            let weight = weights.rows[i];
            if weight == 0.0 {
                continue;
            }
            let a = b.row(i);
            for j in 0..w {
                axpy(weight * a[j], &a[j..], &mut block[j * (w + 1)..(j + 1) * w]);
            }
        }
        if k < n {
            let f = b.f(k);
            let next = Left { v: &self.value[(k + 1) * nx * nx..], ld: nx };
            gemm([nx, w, nx], next, Right { v: f.v, rs: 1, cs: nx }, &mut self.pf, nx, Mode::Set);
            for j in 0..w {
                (0..nx).for_each(|i| self.transposed[j + i * w] = f.v[i + j * nx]);
            }
            for j in (0..w).step_by(PANEL) {
                let columns = PANEL.min(w - j);
                let right = Right { v: &self.pf[j * nx..], rs: 1, cs: nx };
                let left = Left { v: &self.transposed[j..], ld: w };
                gemm([w - j, columns, nx], left, right, &mut block[j * (w + 1)..], w, Mode::Add);
            }
            let own = k * nu..(k + 1) * nu;
            for (j, (fixed, weight)) in weights.fixed[own.clone()].iter().zip(&weights.u[own]).enumerate() {
                if *fixed {
                    block[j * w..(j + 1) * w].fill(0.0);
                    (0..j).for_each(|l| block[j + l * w] = 0.0);
                    block[j * (w + 1)] = 1.0;
                } else {
                    block[j * (w + 1)] += weight;
                }
            }
            if !potrf(nu, block, w) {
                return false;
            }
            for j in 0..nu {
                let (before, column) = block.split_at_mut(j * w);
                for l in 0..j {
                    let f = before[j + l * w];
                    axpy(-f, &before[nu + l * w..(l + 1) * w], &mut column[nu..w]);
                }
                let d = column[j];
                column[nu..w].iter_mut().for_each(|v| *v /= d);
            }
            let (panel, rest) = block.split_at_mut(nu * w);
            for j in (0..nx).step_by(PANEL) {
                let columns = PANEL.min(nx - j);
                let left = Left { v: &panel[nu + j..], ld: w };
                let right = Right { v: &panel[nu + j..], rs: w, cs: 1 };
                gemm([nx - j, columns, nu], left, right, &mut rest[nu + j + j * w..], w, Mode::Subtract);
            }
            let to = &mut self.panel[k * w * nu..(k + 1) * w * nu];
            to.copy_from_slice(panel);
        }
        let value = &mut self.value[k * nx * nx..(k + 1) * nx * nx];
        for j in 0..nx {
            for i in j..nx {
                let v = block[nu + i + (nu + j) * w];
                (value[i + j * nx], value[j + i * nx]) = (v, v);
            }
        }
        value.iter().all(|v| v.is_finite())
    }

    fn root(&self, k: usize) -> &[f64] {
        &self.panel[k * self.w * self.nu..(k + 1) * self.w * self.nu]
    }

    /// The sweep back for a gradient `g`, `[(n + 1) · w]`, and gaps `c`, `[n · nx]` of the dynamics, where there are any.
    pub fn back(&self, b: &Blocks, g: &[f64], c: Option<&[f64]>, fixed: &[bool], s: &mut Sweep) {
        let (n, nx, nu, w) = (self.n, self.nx, self.nu, self.w);
        s.p[n * nx..].copy_from_slice(&g[n * w + nu..]);
        for k in (0..n).rev() {
            s.h.copy_from_slice(&s.p[(k + 1) * nx..(k + 2) * nx]);
            if let Some(c) = c {
                let next = Left { v: &self.value[(k + 1) * nx * nx..], ld: nx };
                gemv(nx, nx, next, &c[k * nx..(k + 1) * nx], &mut s.h);
            }
            s.m.copy_from_slice(&g[k * w..(k + 1) * w]);
            gemv_transposed(nx, w, b.f(k), &s.h, &mut s.m);
            for j in (0..nu).filter(|j| fixed[k * nu + j]) {
                s.m[j] = 0.0;
            }
            let root = self.root(k);
            let (own, rest) = s.m.split_at_mut(nu);
            forth(nu, root, w, own);
            s.lp[k * nu..(k + 1) * nu].copy_from_slice(own);
            own.iter_mut().for_each(|v| *v = -*v);
            gemv(nx, nu, Left { v: &root[nu..], ld: w }, own, rest);
            s.p[k * nx..(k + 1) * nx].copy_from_slice(rest);
        }
    }

    /// The sweep forth from a step `dx0` of the first state, or from the arrival `x̄ − x_0` where that is free.
    pub fn forth(&self, b: &Blocks, qp: &StageQp, dx0: &[f64], c: Option<&[f64]>, s: &mut Sweep) {
        let (n, nx, nu, w) = (self.n, self.nx, self.nu, self.w);
        match &qp.initial {
            Initial::Given => s.dz[nu..w].copy_from_slice(dx0),
            Initial::Free(weight) => {
                // (P_0 + W) dx = W (x̄ − x_0) − p_0
                let to = &mut s.dz[nu..w];
                to.iter_mut().zip(&s.p[..nx]).for_each(|(d, p)| *d = -p);
                gemv(nx, nx, Left { v: weight, ld: nx }, dx0, to);
                forth(nx, &self.first, nx, to);
                back(nx, &self.first, nx, to);
            }
        }
        for k in 0..=n {
            let (own, after) = s.dz[k * w..].split_at_mut(w);
            let (u, x) = own.split_at_mut(nu);
            let lambda = &mut s.lambda[k * nx..(k + 1) * nx];
            lambda.copy_from_slice(&s.p[k * nx..(k + 1) * nx]);
            gemv(nx, nx, Left { v: &self.value[k * nx * nx..], ld: nx }, x, lambda);
            if k == n {
                u.fill(0.0);
                break;
            }
            let root = self.root(k);
            u.copy_from_slice(&s.lp[k * nu..(k + 1) * nu]);
            gemv_transposed(nx, nu, Left { v: &root[nu..], ld: w }, x, u);
            back(nu, root, w, u);
            u.iter_mut().for_each(|v| *v = -*v);
            let next = &mut after[nu..w];
            match c {
                Some(c) => next.copy_from_slice(&c[k * nx..(k + 1) * nx]),
                None => next.fill(0.0),
            }
            gemv(nx, w, b.f(k), own, next);
        }
    }

    /// `K_k`, `nu × nx`, of every stage: `u_k = K_k x_k`.
    pub fn gains(&self, out: &mut [f64]) {
        let (nx, nu, w) = (self.nx, self.nu, self.w);
        for (k, out) in out.chunks_exact_mut(nu * nx).enumerate() {
            let root = self.root(k);
            for (i, column) in out.chunks_exact_mut(nu).enumerate() {
                (0..nu).for_each(|j| column[j] = -root[nu + i + j * w]);
                back(nu, root, w, column);
            }
        }
    }

    /// `eᵀ Λ_k⁻¹ e` of every control, `[n · nu]`: how far it moves for a unit of its multiplier, were the later stages free and its
    /// state given.
    pub fn compliance(&self, out: &mut [f64], work: &mut [f64]) {
        let (nu, w) = (self.nu, self.w);
        for (i, out) in out.iter_mut().enumerate() {
            let (k, j) = (i / nu, i % nu);
            let v = &mut work[..nu];
            v.fill(0.0);
            v[j] = 1.0;
            forth(nu, self.root(k), w, v);
            *out = dot(v, v);
        }
    }

    /// `a_iᵀ H⁻¹ a_i` of every row by a recursion of covariances: a system under the controls `K_k x_k + L_k⁻ᵀ w_k` with white noise `w` has the
    /// covariance `H⁻¹`.
    pub fn variances(&self, b: &Blocks, qp: &StageQp, out: &mut [f64], scratch: &mut Covariance) {
        let (n, nx, nu, w) = (self.n, self.nx, self.nu, self.w);
        let Covariance { state, gain, closed, product, noise, vector } = scratch;
        state.fill(0.0);
        if let Initial::Free(_) = qp.initial {
            for (j, column) in state.chunks_exact_mut(nx).enumerate() {
                column[j] = 1.0;
                forth(nx, &self.first, nx, column);
                back(nx, &self.first, nx, column);
            }
        }
        for k in 0..=n {
            let has_controls = k < n;
            let root = if has_controls { self.root(k) } else { &[] };
            if has_controls {
                for (i, column) in gain.chunks_exact_mut(nu).enumerate() {
                    (0..nu).for_each(|j| column[j] = -root[nu + i + j * w]);
                    back(nu, root, w, column);
                }
            }
            for i in b.first[k]..b.first[k + 1] {
                let (own, of_state) = b.row(i).split_at(nu);
                let (u, rest) = vector.split_at_mut(nu);
                let (x, sx) = rest.split_at_mut(nx);
                x.copy_from_slice(of_state);
                u.copy_from_slice(own);
                if has_controls {
                    gemv_transposed(nu, nx, Left { v: gain, ld: nu }, u, x);
                    forth(nu, root, w, u);
                }
                sx.fill(0.0);
                gemv(nx, nx, Left { v: state, ld: nx }, x, sx);
                out[i] = dot(x, sx) + dot(u, u);
            }
            if !has_controls {
                break;
            }
            let f = b.f(k);
            closed.copy_from_slice(&f.v[nu * nx..w * nx]);
            gemm([nx, nx, nu], f, Right { v: gain, rs: 1, cs: nu }, closed, nx, Mode::Add);
            gemm([nx, nx, nx], Left { v: closed, ld: nx }, Right { v: state, rs: 1, cs: nx }, product, nx, Mode::Set);
            gemm([nx, nx, nx], Left { v: product, ld: nx }, Right { v: closed, rs: nx, cs: 1 }, state, nx, Mode::Set);
            // N = B L⁻ᵀ, column by column from N Lᵀ = B
            noise.copy_from_slice(&f.v[..nu * nx]);
            for j in 0..nu {
                let (own, later) = noise[j * nx..].split_at_mut(nx);
                own.iter_mut().for_each(|v| *v /= root[j + j * w]);
                for (l, column) in later.chunks_exact_mut(nx).enumerate() {
                    axpy(-root[j + 1 + l + j * w], own, column);
                }
            }
            gemm([nx, nx, nu], Left { v: noise, ld: nx }, Right { v: noise, rs: nx, cs: 1 }, state, nx, Mode::Add);
        }
    }
}

/// Room for [`Recursion::variances`].
pub(super) struct Covariance {
    state: Vec<f64>,
    gain: Vec<f64>,
    closed: Vec<f64>,
    product: Vec<f64>,
    noise: Vec<f64>,
    vector: Vec<f64>,
}

impl Covariance {
    pub fn new(b: &Blocks) -> Covariance {
        let (nx, nu) = (b.nx, b.nu);
        let square = || vec![0.0; nx * nx];
        Covariance {
            state: square(),
            gain: vec![0.0; nu * nx],
            closed: square(),
            product: square(),
            noise: vec![0.0; nx * nu],
            vector: vec![0.0; nu + 2 * nx],
        }
    }
}
