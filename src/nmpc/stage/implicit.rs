//! Implicit Runge-Kutta steps whose stage unknowns are eliminated, also for algebraic equations of index 1.
//!
//! ```text
//! K_i = f(x + h Σ_j a_ij K_j, Z_i, u),   0 = g(x + h Σ_j a_ij K_j, Z_i, u),   ψ = x + h Σ_i b_i K_i
//! ```
//!
//! `Z_i` is eliminated first, with `J_i = f_x − f_z g_z⁻¹ g_x`; what is left is `(I − h A ⊗ J) K' = ...` of `s n_x` unknowns. The
//! start of Newton's method is the last solution and its tangent ("lifted": J. Albersmeyer, M. Diehl, *The lifted Newton method*,
//! 2010), the matrix that of the last linearisation as long as it contracts; derivatives are those of the solution.

use super::super::evaluate::Many;
use super::{Evaluations, Stage, Starts};
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult};
use crate::linalg::lu::Lu;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// Newton's method ends where a step is below this share of the largest state, or of the largest algebraic state.
const CONVERGED: f64 = 1e-12;
/// Iterations of it at most.
const MAX_NEWTON: usize = 30;
/// An old matrix is given up where the steps shrink by less than this factor.
const CONTRACTION: f64 = 0.1;

/// One step of an implicit method in every stage.
pub(in super::super) struct ImplicitRk {
    n: usize,
    nx: usize,
    nz: usize,
    nu: usize,
    tableau: Tableau,
    /// Right-hand side and algebraic equations; the latter's first row among all.
    parts: Vec<(Many, usize)>,
    /// Of every stage: `K` and `Z` of all its stage points, their derivatives by `(x, u)`, the node they belong to.
    unknowns: Vec<f64>,
    tangent: Vec<f64>,
    node: Vec<f64>,
    known: bool,
    /// Factors of every stage, and of `g_z` at every stage point.
    outer: Vec<Lu<f64>>,
    inner: Vec<Lu<f64>>,
    factored: bool,
    /// Jacobians `[f_x f_z f_u; g_x g_z g_u]` of one stage point after another, row-major; then `f` with `z` eliminated.
    full: Vec<f64>,
    reduced: Vec<f64>,
    z_by: Vec<f64>,
    residual: Vec<f64>,
    column: Vec<f64>,
    evaluations: Evaluations,
}

impl ImplicitRk {
    /// `n` stages; the last `nz` states are algebraic, with `algebraic` added to their rows of `f`.
    pub fn new(
        f: &SharedFunction,
        algebraic: Option<&SharedFunction>,
        nz: usize,
        n: usize,
        tableau: Tableau,
    ) -> Result<ImplicitRk> {
        if tableau.a_inv.is_none() {
            return Err(Error::Unsupported(format!(
                "{:?} has a singular matrix of coefficients: take Gauss-Legendre or Radau IIA",
                tableau.family
            )));
        }
        let s = tableau.n_s;
        let d = f.dims();
        let (nx, nu) = (d.x - nz, d.u);
        let mut parts = vec![(Many::new(f, n * s, false), 0)];
        parts.extend(algebraic.map(|g| (Many::new(g, n * s, false), nx)));
        let (all, columns) = (nx + nz, nx + nz + nu);
        Ok(ImplicitRk {
            n,
            nx,
            nz,
            nu,
            parts,
            unknowns: vec![0.0; n * s * all],
            tangent: vec![0.0; n * s * all * (nx + nu)],
            node: vec![0.0; n * (nx + nu)],
            known: false,
            outer: (0..n).map(|_| Lu::with_capacity(s * nx)).collect(),
            inner: (0..n * s).map(|_| Lu::with_capacity(nz)).collect(),
            factored: false,
            full: vec![0.0; n * s * all * columns],
            reduced: vec![0.0; n * s * nx * (nx + nu)],
            z_by: vec![0.0; n * s * nz * (nx + nu)],
            residual: vec![0.0; n * s * all],
            column: vec![0.0; s * all.max(1)],
            tableau,
            evaluations: Evaluations::default(),
        })
    }

    /// First values of the algebraic states, `[nz]`, the same for all stages, where nothing is known yet.
    pub fn guess_algebraic(&mut self, z: &[f64]) {
        let (nx, all) = (self.nx, self.nx + self.nz);
        for point in self.unknowns.chunks_exact_mut(all) {
            point[nx..].copy_from_slice(z);
        }
    }

    /// The last solution carried to other nodes by its tangent.
    fn predict(&mut self, at: &Starts) {
        let (nx, nu, s, all) = (self.nx, self.nu, self.tableau.n_s, self.nx + self.nz);
        for k in 0..self.n {
            let node = &mut self.node[k * (nx + nu)..(k + 1) * (nx + nu)];
            let new = at.x[k * nx..(k + 1) * nx].iter().chain(&at.u[k * nu..(k + 1) * nu]);
            for (c, (old, new)) in node.iter_mut().zip(new).enumerate() {
                let change = new - *old;
                *old = *new;
                if self.known && change != 0.0 {
                    let tangent = &self.tangent[(k * (nx + nu) + c) * s * all..][..s * all];
                    let unknowns = &mut self.unknowns[k * s * all..(k + 1) * s * all];
                    unknowns.iter_mut().zip(tangent).for_each(|(v, t)| *v += t * change);
                }
            }
        }
    }

    /// Inputs of the functions at all stage points.
    fn place(&mut self, at: &Starts) {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let all = nx + nz;
        let np = self.parts[0].0.dims.p;
        for k in 0..self.n {
            let unknowns = &self.unknowns[k * s * all..(k + 1) * s * all];
            for i in 0..s {
                let point = &mut self.column[..all];
                point[..nx].copy_from_slice(&at.x[k * nx..(k + 1) * nx]);
                for j in 0..s {
                    let f = at.h[k] * self.tableau.a(i, j);
                    point[..nx].iter_mut().zip(&unknowns[j * all..]).for_each(|(v, k)| *v += f * k);
                }
                point[nx..].copy_from_slice(&unknowns[i * all + nx..(i + 1) * all]);
                let t = at.t[k] + self.tableau.c[i] * at.h[k];
                for (f, _) in &mut self.parts {
                    f.set(k * s + i, t, point, &at.u[k * nu..(k + 1) * nu], &at.p[k * np..(k + 1) * np]);
                }
            }
        }
    }

    /// `f − K` and `g` at all stage points.
    fn residuals(&mut self, at: &Starts) -> EvalResult {
        self.place(at);
        let (nx, all, points) = (self.nx, self.nx + self.nz, self.n * self.tableau.n_s);
        for (at, r) in self.residual.chunks_exact_mut(all).zip(self.unknowns.chunks_exact(all)) {
            at[..nx].iter_mut().zip(r).for_each(|(r, k)| *r = -k);
            at[nx..].fill(0.0);
        }
        for (f, first) in &mut self.parts {
            f.values()?;
            for i in 0..f.n_out() {
                for q in 0..points {
                    self.residual[q * all + *first + i] += f.value[i * points + q];
                }
            }
        }
        self.evaluations.values += 1;
        Ok(())
    }

    /// Jacobians at the present unknowns, and all factors.
    fn factorise(&mut self, at: &Starts) -> EvalResult {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let (all, columns, points) = (nx + nz, nx + nz + nu, self.n * s);
        self.full.fill(0.0);
        for (f, first) in &mut self.parts {
            f.jacobians()?;
            for (e, &(i, c)) in f.jac_entries.iter().enumerate().filter(|e| e.1 .1 < columns) {
                for q in 0..points {
                    self.full[(q * all + *first + i) * columns + c] += f.jac[e * points + q];
                }
            }
        }
        for q in 0..points {
            self.eliminate(q)?;
        }
        for k in 0..self.n {
            let lu = &mut self.outer[k];
            let m = lu.clear(s * nx);
            for i in 0..s {
                let reduced = &self.reduced[(k * s + i) * nx * (nx + nu)..];
                for j in 0..s {
                    let f = at.h[k] * self.tableau.a(i, j);
                    for r in 0..nx {
                        let row = &mut m[(i * nx + r) * s * nx + j * nx..][..nx];
                        row.iter_mut().zip(&reduced[r * (nx + nu)..]).for_each(|(m, v)| *m = -f * v);
                        if i == j {
                            row[r] += 1.0;
                        }
                    }
                }
            }
            if !lu.factorise() {
                return Err(EvalError::Recoverable);
            }
        }
        self.factored = true;
        Ok(())
    }

    /// `z' = −g_z⁻¹ [g_x g_u]` and `[f_x f_u] + f_z z'` at stage point `q`.
    fn eliminate(&mut self, q: usize) -> EvalResult {
        let (nx, nz, nu) = (self.nx, self.nz, self.nu);
        let (all, columns) = (nx + nz, nx + nz + nu);
        let full = &self.full[q * all * columns..(q + 1) * all * columns];
        let reduced = &mut self.reduced[q * nx * (nx + nu)..(q + 1) * nx * (nx + nu)];
        for r in 0..nx {
            let (row, to) = (&full[r * columns..], &mut reduced[r * (nx + nu)..(r + 1) * (nx + nu)]);
            to[..nx].copy_from_slice(&row[..nx]);
            to[nx..].copy_from_slice(&row[all..columns]);
        }
        if nz == 0 {
            return Ok(());
        }
        let lu = &mut self.inner[q];
        let m = lu.clear(nz);
        for r in 0..nz {
            m[r * nz..(r + 1) * nz].copy_from_slice(&full[(nx + r) * columns + nx..][..nz]);
        }
        if !lu.factorise() {
            return Err(EvalError::Recoverable);
        }
        for c in 0..nx + nu {
            let from = if c < nx { c } else { c + nz };
            let z = &mut self.z_by[(q * (nx + nu) + c) * nz..][..nz];
            (0..nz).for_each(|r| z[r] = -full[(nx + r) * columns + from]);
            lu.solve(z);
            for r in 0..nx {
                let f_z = &full[r * columns + nx..][..nz];
                reduced[r * (nx + nu) + c] += f_z.iter().zip(&*z).map(|(f, z)| f * z).sum::<f64>();
            }
        }
        Ok(())
    }

    /// One step of Newton's method with the present factors; the largest change relative to the states, over all stages.
    fn newton_step(&mut self, at: &Starts) -> f64 {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let (all, columns) = (nx + nz, nx + nz + nu);
        let mut worst = 0.0f64;
        for k in 0..self.n {
            let h = at.h[k];
            // r_f − f_z g_z⁻¹ r_g on the right
            for i in 0..s {
                let q = k * s + i;
                let (r_f, r_g) = self.residual[q * all..(q + 1) * all].split_at_mut(nx);
                self.column[i * nx..(i + 1) * nx].copy_from_slice(r_f);
                if nz > 0 {
                    self.inner[q].solve(r_g);
                    for r in 0..nx {
                        let f_z = &self.full[(q * all + r) * columns + nx..][..nz];
                        self.column[i * nx + r] -= f_z.iter().zip(&*r_g).map(|(f, v)| f * v).sum::<f64>();
                    }
                }
            }
            self.outer[k].solve(&mut self.column[..s * nx]);
            let scale = at.x[k * nx..(k + 1) * nx].iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let mut change = 0.0f64;
            for i in 0..s {
                let q = k * s + i;
                let unknowns = &mut self.unknowns[q * all..(q + 1) * all];
                for r in 0..nx {
                    let d = self.column[i * nx + r];
                    unknowns[r] += d;
                    change = change.max((h * d).abs());
                }
                // dz = −g_z⁻¹ r_g + z' dX, dX = h Σ a_ij dK_j
                let (mut largest, mut dz_most) = (0.0f64, 0.0f64);
                for r in 0..nz {
                    let mut d = -self.residual[q * all + nx + r];
                    for c in 0..nx {
                        let dx: f64 = (0..s).map(|j| h * self.tableau.a(i, j) * self.column[j * nx + c]).sum();
                        d += self.z_by[(q * (nx + nu) + c) * nz + r] * dx;
                    }
                    unknowns[nx + r] += d;
                    dz_most = dz_most.max(d.abs());
                    largest = largest.max(unknowns[nx + r].abs());
                }
                if dz_most > 0.0 {
                    worst = worst.max(dz_most / largest);
                }
            }
            if change > 0.0 {
                let size = scale.max(change);
                worst = worst.max(change / size);
            }
        }
        worst
    }

    /// Solves for the stage unknowns at all nodes, and `ψ`.
    fn solve(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult {
        self.predict(at);
        let mut last = f64::INFINITY;
        for _ in 0..MAX_NEWTON {
            self.residuals(at)?;
            if !self.factored {
                self.factorise(at)?;
                last = f64::INFINITY;
            }
            let change = self.newton_step(at);
            if !change.is_finite() {
                break;
            }
            // what is left after this step, where steps shrink at the rate they did
            let left = if last.is_finite() { change * change / last } else { change };
            if change <= CONVERGED || (change < last && left <= CONVERGED) {
                self.advance(at, next);
                return Ok(());
            }
            if change > CONTRACTION * last {
                self.factored = false;
            }
            last = change;
        }
        // nothing of this is a start for the next time
        self.known = false;
        self.factored = false;
        self.unknowns.iter_mut().for_each(|v| {
            if !v.is_finite() {
                *v = 0.0;
            }
        });
        Err(EvalError::Recoverable)
    }

    fn advance(&self, at: &Starts, next: &mut [f64]) {
        let (nx, s, all) = (self.nx, self.tableau.n_s, self.nx + self.nz);
        for k in 0..self.n {
            let to = &mut next[k * nx..(k + 1) * nx];
            to.copy_from_slice(&at.x[k * nx..(k + 1) * nx]);
            for i in 0..s {
                let f = at.h[k] * self.tableau.b[i];
                to.iter_mut().zip(&self.unknowns[(k * s + i) * all..]).for_each(|(v, k)| *v += f * k);
            }
        }
    }

    /// Derivatives of the unknowns by column `c` of `(x, u)` in stage `k`, to `column[..s nx]` for `K`.
    fn derivative(&mut self, at: &Starts, k: usize, c: usize) {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let all = nx + nz;
        for i in 0..s {
            let reduced = &self.reduced[(k * s + i) * nx * (nx + nu)..];
            (0..nx).for_each(|r| self.column[i * nx + r] = reduced[r * (nx + nu) + c]);
        }
        self.outer[k].solve(&mut self.column[..s * nx]);
        let tangent = &mut self.tangent[(k * (nx + nu) + c) * s * all..][..s * all];
        for i in 0..s {
            let q = k * s + i;
            tangent[i * all..i * all + nx].copy_from_slice(&self.column[i * nx..(i + 1) * nx]);
            let z_by = &self.z_by[q * (nx + nu) * nz..(q + 1) * (nx + nu) * nz];
            let to = &mut tangent[i * all + nx..(i + 1) * all];
            to.copy_from_slice(&z_by[c * nz..(c + 1) * nz]);
            if nz == 0 {
                continue;
            }
            for e in 0..nx {
                let dx: f64 = (0..s).map(|j| at.h[k] * self.tableau.a(i, j) * self.column[j * nx + e]).sum();
                to.iter_mut().zip(&z_by[e * nz..]).for_each(|(t, z)| *t += z * dx);
            }
        }
    }
}

impl Stage for ImplicitRk {
    fn values(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult {
        self.solve(at, next)
    }

    fn linearise(
        &mut self,
        at: &Starts,
        next: &mut [f64],
        a: &mut [f64],
        b: &mut [f64],
        second: Option<(&[f64], &mut [f64])>,
    ) -> EvalResult {
        debug_assert!(second.is_none(), "problems with implicit steps are made without second derivatives");
        self.solve(at, next)?;
        self.place(at);
        self.factorise(at)?;
        self.evaluations.jacobians += 1;
        let (nx, nu, s) = (self.nx, self.nu, self.tableau.n_s);
        for k in 0..self.n {
            for c in 0..nx + nu {
                self.derivative(at, k, c);
                let to =
                    if c < nx { &mut a[(k * nx + c) * nx..][..nx] } else { &mut b[(k * nu + c - nx) * nx..][..nx] };
                to.fill(0.0);
                if c < nx {
                    to[c] = 1.0;
                }
                for i in 0..s {
                    let f = at.h[k] * self.tableau.b[i];
                    to.iter_mut().zip(&self.column[i * nx..]).for_each(|(t, k)| *t += f * k);
                }
            }
        }
        self.known = true;
        Ok(())
    }

    fn adjoint(&mut self, at: &Starts, lambda: &[f64], next: &mut [f64], gx: &mut [f64], gu: &mut [f64]) -> EvalResult {
        self.solve(at, next)?;
        self.place(at);
        self.factorise(at)?;
        self.evaluations.adjoints += 1;
        let (nx, nu, s) = (self.nx, self.nu, self.tableau.n_s);
        for k in 0..self.n {
            let lambda = &lambda[k * nx..(k + 1) * nx];
            for i in 0..s {
                let f = at.h[k] * self.tableau.b[i];
                (0..nx).for_each(|r| self.column[i * nx + r] = f * lambda[r]);
            }
            self.outer[k].solve_transposed(&mut self.column[..s * nx]);
            let (gx, gu) = (&mut gx[k * nx..(k + 1) * nx], &mut gu[k * nu..(k + 1) * nu]);
            gx.copy_from_slice(lambda);
            gu.fill(0.0);
            for i in 0..s {
                let reduced = &self.reduced[(k * s + i) * nx * (nx + nu)..];
                for r in 0..nx {
                    let (y, row) = (self.column[i * nx + r], &reduced[r * (nx + nu)..(r + 1) * (nx + nu)]);
                    gx.iter_mut().zip(row).for_each(|(g, v)| *g += v * y);
                    gu.iter_mut().zip(&row[nx..]).for_each(|(g, v)| *g += v * y);
                }
            }
        }
        Ok(())
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }
}
