//! Implicit Runge-Kutta steps whose stage unknowns are eliminated, also for algebraic equations of index 1.
//!
//! ```text
//! K_i = f(x + h Σ_j a_ij K_j, Z_i, u),   0 = g(x + h Σ_j a_ij K_j, Z_i, u),   ψ = x + h Σ_i b_i K_i
//! ```
//!
//! `Z_i` is eliminated first, with `J_i = f_x − f_z g_z⁻¹ g_x`; what is left is `(I − h A ⊗ J) K' = ...` of `s n_x` unknowns. The
//! start of Newton's method is the last solution and its tangent ("lifted": J. Albersmeyer, M. Diehl, *The lifted Newton method*,
//! 2010), the matrix that of the last linearisation as long as it contracts; derivatives are those of the solution. Adjoint sweeps take
//! Jacobians at the solution too, and the factors of that matrix with corrections.

use super::super::evaluate::Many;
use super::{Evaluations, Stage, Starts};
use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult};
use crate::linalg::dense::axpy;
use crate::linalg::lu::{block_work, Lu};
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// Newton's method ends where a step is below this share of the largest state, or of the largest algebraic state.
const CONVERGED: f64 = 1e-12;
/// Where steps no longer shrink with a matrix of their own, rounding decides: below this share of the states that is a solution.
const STALLED: f64 = 1e-9;
/// Iterations of it at most.
const MAX_NEWTON: usize = 30;
/// An old matrix is given up where the steps shrink by less than this factor.
const CONTRACTION: f64 = 0.1;
/// For multipliers it is given up later: a correction of them evaluates nothing.
const DUAL_CONTRACTION: f64 = 0.5;
/// Corrections of multipliers at most.
const MAX_CORRECTIONS: usize = 40;

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
    /// Newton's method in every stage.
    newton: Vec<Newton>,
    /// Jacobians `[f_x f_z f_u; g_x g_z g_u]` of one stage point after another, row-major; then `f` with `z` eliminated.
    full: Vec<f64>,
    reduced: Vec<f64>,
    z_by: Vec<f64>,
    residual: Vec<f64>,
    column: Vec<f64>,
    /// Right-hand sides of all columns at once.
    block: Vec<f64>,
    block_work: Vec<f64>,
    /// Multipliers of the stage equations, quantity by quantity for all points, what they leave, and their products with the
    /// columns of the Jacobians.
    dual: Vec<f64>,
    dual_gap: Vec<f64>,
    products: Vec<f64>,
    evaluations: Evaluations,
}

/// How far Newton's method is in a stage.
#[derive(Debug, Clone, Copy)]
struct Newton {
    /// The factors are of no use any more.
    stale: bool,
    /// There is something left to do.
    open: bool,
    /// The last step, relative to the states; infinite where factors are new.
    last: f64,
    /// The same across new factors.
    before: f64,
    /// Steps that shrank too slowly.
    stalls: usize,
}

impl Newton {
    fn begin(&mut self) {
        (self.open, self.last, self.before, self.stalls) = (true, f64::INFINITY, f64::INFINITY, 0);
    }

    /// Another step.
    fn see(&mut self, change: f64) {
        // what is left after this step, where steps shrink at the rate they did
        let left = if self.last.is_finite() { change * change / self.last } else { change };
        if change <= CONVERGED || (change < self.last && left <= CONVERGED) {
            self.open = false;
            return;
        }
        if change > CONTRACTION * self.before {
            self.stalls += 1;
            self.stale = true;
        }
        // the second time the matrix was that of the point
        self.open = !(self.stalls >= 2 && change <= STALLED);
        (self.last, self.before) = (change, change);
    }
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
            newton: vec![Newton { stale: true, open: true, last: 0.0, before: 0.0, stalls: 0 }; n],
            full: vec![0.0; n * s * all * columns],
            reduced: vec![0.0; n * s * nx * (nx + nu)],
            z_by: vec![0.0; n * s * nz * (nx + nu)],
            residual: vec![0.0; n * s * all],
            column: vec![0.0; s * all.max(1)],
            block: vec![0.0; (s * nx).max(nz) * (nx + nu)],
            block_work: vec![0.0; block_work((s * nx).max(nz), nx + nu)],
            dual: vec![0.0; n * s * all],
            dual_gap: vec![0.0; n * s * all],
            products: vec![0.0; n * s * columns],
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

    /// Jacobians at the present unknowns, and factors: of all stages, or where those that are there are of no use.
    fn factorise(&mut self, at: &Starts, all_stages: bool) -> EvalResult {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let (all, columns, points) = (nx + nz, nx + nz + nu, self.n * s);
        if all_stages {
            self.newton.iter_mut().for_each(|stage| stage.stale = true);
        }
        let length = s * all * columns;
        let stages = self.full.chunks_exact_mut(length).zip(&self.newton).filter(|e| e.1.stale);
        stages.for_each(|(full, _)| full.fill(0.0));
        for (f, first) in &mut self.parts {
            f.jacobians()?;
            for (e, &(i, c)) in f.jac_entries.iter().enumerate().filter(|e| e.1 .1 < columns) {
                for q in (0..points).filter(|q| self.newton[q / s].stale) {
                    self.full[(q * all + *first + i) * columns + c] += f.jac[e * points + q];
                }
            }
        }
        for q in 0..points {
            if self.newton[q / s].stale {
                self.eliminate(q)?;
            }
        }
        for k in 0..self.n {
            if !std::mem::take(&mut self.newton[k].stale) {
                continue;
            }
            self.newton[k].last = f64::INFINITY;
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
                self.newton[k].stale = true;
                return Err(EvalError::Recoverable);
            }
        }
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
        let m = nx + nu;
        let block = &mut self.block[..nz * m];
        for r in 0..nz {
            let row = &full[(nx + r) * columns..(nx + r + 1) * columns];
            (0..m).for_each(|c| block[r * m + c] = -row[if c < nx { c } else { c + nz }]);
        }
        lu.solve_block(m, block, &mut self.block_work);
        for r in 0..nx {
            let to = &mut reduced[r * m..(r + 1) * m];
            for i in 0..nz {
                axpy(full[r * columns + nx + i], &block[i * m..(i + 1) * m], to);
            }
        }
        for c in 0..m {
            let z = &mut self.z_by[(q * m + c) * nz..][..nz];
            (0..nz).for_each(|r| z[r] = block[r * m + c]);
        }
        Ok(())
    }

    /// One step of Newton's method with the present factors in the stages where there is something left to do; false where it is not finite.
    fn newton_step(&mut self, at: &Starts) -> bool {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let (all, columns) = (nx + nz, nx + nz + nu);
        for k in 0..self.n {
            if !self.newton[k].open {
                continue;
            }
            let mut worst = 0.0f64;
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
            if !(worst + change).is_finite() {
                return false;
            }
            self.newton[k].see(worst);
        }
        true
    }

    /// Solves for the stage unknowns at all nodes, and `ψ`.
    fn solve(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult {
        self.predict(at);
        self.newton.iter_mut().for_each(Newton::begin);
        for _ in 0..MAX_NEWTON {
            self.residuals(at)?;
            if self.newton.iter().any(|stage| stage.stale && stage.open) {
                self.factorise(at, false)?;
            }
            if !self.newton_step(at) {
                break;
            }
            if !self.newton.iter().any(|stage| stage.open) {
                self.advance(at, next);
                return Ok(());
            }
        }
        // nothing of this is a start for the next time
        self.known = false;
        self.newton.iter_mut().for_each(|stage| stage.stale = true);
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

    /// Multipliers of the stage equations, `Mᵀ y = −(h b ⊗ λ, 0)` with the matrix `M` of their derivatives by `(K, Z)`, and the products of `y`
    /// with the Jacobians. The factors are those of the last matrix that was factorised; what they leave is corrected until
    /// nothing is left. False where that does not contract.
    fn multipliers(&mut self, at: &Starts, lambda: &[f64]) -> bool {
        self.dual.fill(0.0);
        self.products.fill(0.0);
        let mut last = f64::INFINITY;
        for _ in 0..MAX_CORRECTIONS {
            self.dual_residual(at, lambda);
            let change = self.correct_dual(at);
            self.multiply_dual();
            let left = if last.is_finite() { change * change / last } else { change };
            if change <= CONVERGED || (change < last && left <= CONVERGED) {
                return true;
            }
            if change.is_nan() || change > DUAL_CONTRACTION * last {
                return false;
            }
            last = change;
        }
        false
    }

    /// Products of the multipliers with the Jacobians of all stage points, quantity by quantity.
    fn multiply_dual(&mut self) {
        let (columns, points) = (self.nx + self.nz + self.nu, self.n * self.tableau.n_s);
        self.products.fill(0.0);
        for (f, first) in &self.parts {
            for (e, &(i, c)) in f.jac_entries.iter().enumerate().filter(|e| e.1 .1 < columns) {
                let y = &self.dual[(*first + i) * points..][..points];
                let entries = f.jac[e * points..][..points].iter().zip(y);
                let to = &mut self.products[c * points..][..points];
                to.iter_mut().zip(entries).for_each(|(v, (d, y))| *v += d * y);
            }
        }
    }

    /// What the multipliers leave of their equations.
    fn dual_residual(&mut self, at: &Starts, lambda: &[f64]) {
        let (nx, nz, s) = (self.nx, self.nz, self.tableau.n_s);
        let points = self.n * s;
        for r in 0..nx {
            for q in 0..points {
                let (k, j) = (q / s, q % s);
                let by_x = &self.products[r * points + k * s..][..s];
                let through: f64 = by_x.iter().enumerate().map(|(i, v)| self.tableau.a(i, j) * v).sum();
                let given = self.tableau.b[j] * lambda[k * nx + r];
                self.dual_gap[r * points + q] = self.dual[r * points + q] - at.h[k] * (given + through);
            }
        }
        let z = nx * points..(nx + nz) * points;
        self.dual_gap[z.clone()].iter_mut().zip(&self.products[z]).for_each(|(g, v)| *g = -v);
    }

    /// Adds what the factors make of the residual; the largest change relative to the multipliers, over all stages.
    fn correct_dual(&mut self, at: &Starts) -> f64 {
        let (nx, nz, nu, s) = (self.nx, self.nz, self.nu, self.tableau.n_s);
        let (all, columns, points) = (nx + nz, nx + nz + nu, self.n * s);
        let mut worst = 0.0f64;
        for k in 0..self.n {
            let h = at.h[k];
            for j in 0..s {
                for r in 0..nx {
                    let mut v = self.dual_gap[r * points + k * s + j];
                    for i in 0..if nz > 0 { s } else { 0 } {
                        let q = k * s + i;
                        let z_by = &self.z_by[(q * (nx + nu) + r) * nz..][..nz];
                        let t: f64 =
                            z_by.iter().enumerate().map(|(z, d)| d * self.dual_gap[(nx + z) * points + q]).sum();
                        v += h * self.tableau.a(i, j) * t;
                    }
                    self.column[j * nx + r] = -v;
                }
            }
            self.outer[k].solve_transposed(&mut self.column[..s * nx]);
            let (mut change, mut size) = (0.0f64, 0.0f64);
            let mut add = |y: &mut f64, d: f64| {
                *y += d;
                change = change.max(d.abs());
                size = size.max(y.abs());
            };
            for i in 0..s {
                let q = k * s + i;
                let own = &self.column[i * nx..(i + 1) * nx];
                own.iter().enumerate().for_each(|(r, d)| add(&mut self.dual[r * points + q], *d));
                if nz == 0 {
                    continue;
                }
                let to = &mut self.block_work[..nz];
                (0..nz).for_each(|z| to[z] = self.dual_gap[(nx + z) * points + q]);
                for (r, d) in own.iter().enumerate() {
                    let f_z = &self.full[(q * all + r) * columns + nx..][..nz];
                    axpy(-d, f_z, to);
                }
                self.inner[q].solve_transposed(to);
                to.iter().enumerate().for_each(|(z, d)| add(&mut self.dual[(nx + z) * points + q], *d));
            }
            if change > 0.0 || change.is_nan() {
                worst = worst.max(change / size);
            }
            if change.is_nan() {
                return f64::NAN;
            }
        }
        worst
    }

    /// Derivatives of the unknowns of stage `k` by `(x, u)`: those of `K` row by row to `block`, all column by column to `tangent`.
    fn derivatives(&mut self, at: &Starts, k: usize) {
        let (nx, nz, s) = (self.nx, self.nz, self.tableau.n_s);
        let (all, m) = (nx + nz, nx + self.nu);
        let rows = &self.reduced[k * s * nx * m..(k + 1) * s * nx * m];
        self.block[..s * nx * m].copy_from_slice(rows);
        self.outer[k].solve_block(m, &mut self.block[..s * nx * m], &mut self.block_work);
        let block = &self.block;
        for c in 0..m {
            let tangent = &mut self.tangent[(k * m + c) * s * all..][..s * all];
            for i in 0..s {
                (0..nx).for_each(|r| tangent[i * all + r] = block[(i * nx + r) * m + c]);
                if nz == 0 {
                    continue;
                }
                let z_by = &self.z_by[(k * s + i) * m * nz..(k * s + i + 1) * m * nz];
                let to = &mut tangent[i * all + nx..(i + 1) * all];
                to.copy_from_slice(&z_by[c * nz..(c + 1) * nz]);
                for e in 0..nx {
                    let dx: f64 = (0..s).map(|j| at.h[k] * self.tableau.a(i, j) * block[(j * nx + e) * m + c]).sum();
                    axpy(dx, &z_by[e * nz..(e + 1) * nz], to);
                }
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
        self.factorise(at, true)?;
        self.evaluations.jacobians += 1;
        let (nx, nu, s) = (self.nx, self.nu, self.tableau.n_s);
        for k in 0..self.n {
            self.derivatives(at, k);
            let (a, b) = (&mut a[k * nx * nx..(k + 1) * nx * nx], &mut b[k * nx * nu..(k + 1) * nx * nu]);
            a.fill(0.0);
            b.fill(0.0);
            for r in 0..nx {
                a[r + r * nx] = 1.0;
                for i in 0..s {
                    let f = at.h[k] * self.tableau.b[i];
                    let row = &self.block[(i * nx + r) * (nx + nu)..(i * nx + r + 1) * (nx + nu)];
                    (0..nx).for_each(|c| a[r + c * nx] += f * row[c]);
                    (0..nu).for_each(|c| b[r + c * nx] += f * row[nx + c]);
                }
            }
        }
        self.known = true;
        Ok(())
    }

    fn adjoint(&mut self, at: &Starts, lambda: &[f64], next: &mut [f64], gx: &mut [f64], gu: &mut [f64]) -> EvalResult {
        self.solve(at, next)?;
        self.place(at);
        for (f, _) in &mut self.parts {
            f.jacobians()?;
        }
        self.evaluations.adjoints += 1;
        if self.newton.iter().any(|stage| stage.stale) {
            self.factorise(at, false)?;
        }
        if !self.multipliers(at, lambda) {
            self.factorise(at, true)?;
            if !self.multipliers(at, lambda) {
                return Err(EvalError::Recoverable);
            }
        }
        let (nx, nu, s) = (self.nx, self.nu, self.tableau.n_s);
        let (all, points) = (nx + self.nz, self.n * s);
        let of_stage = |products: &[f64], c: usize, k: usize| products[c * points + k * s..][..s].iter().sum::<f64>();
        for k in 0..self.n {
            let lambda = &lambda[k * nx..(k + 1) * nx];
            (0..nx).for_each(|r| gx[k * nx + r] = lambda[r] + of_stage(&self.products, r, k));
            (0..nu).for_each(|j| gu[k * nu + j] = of_stage(&self.products, all + j, k));
        }
        Ok(())
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }
}
