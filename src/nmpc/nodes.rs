//! What is known at the nodes of the horizon: times, parameters, states with their algebraic part.

use super::evaluate::Many;
use crate::func::{EvalError, EvalResult};
use crate::linalg::lu::Lu;
use crate::system::{SharedFunction, System};

/// Newton's method for algebraic states ends where a step is below this share of the largest of them.
const CONVERGED: f64 = 1e-13;
/// Iterations of it at most.
const MAX_NEWTON: usize = 50;

/// Data of the nodes 0 to `n`. The last node has the control of the last stage.
pub(super) struct Nodes {
    pub n: usize,
    /// Differential and algebraic states, controls, parameters.
    pub nx: usize,
    pub nz: usize,
    pub nu: usize,
    pub np: usize,
    /// Times of the nodes and lengths of the stages.
    pub t: Vec<f64>,
    pub h: Vec<f64>,
    /// Parameters `[(n + 1) · np]`.
    pub p: Vec<f64>,
    /// Algebraic states `[(n + 1) · nz]` with their derivatives by `(x, u)`, `[(n + 1) · nz · (nx + nu)]`, row-major.
    pub z: Vec<f64>,
    pub z_by: Vec<f64>,
    equations: Vec<(Many, usize)>,
    lu: Lu<f64>,
    work: Vec<f64>,
    full: Vec<f64>,
}

impl Nodes {
    pub fn new(system: &System, n: usize) -> Nodes {
        let (d, nz) = (system.dims(), system.n_algebraic());
        let nx = d.x - nz;
        let many = |f: &SharedFunction, first| (Many::new(f, n + 1, false), first);
        let equations = if nz == 0 {
            Vec::new()
        } else {
            let smooth = system.f0().or(system.mechanics().map(|m| &m.smooth));
            let f0 = smooth.map(|f| many(f, 0));
            f0.into_iter().chain(system.algebraic().map(|g| many(g, nx))).collect()
        };
        Nodes {
            n,
            nx,
            nz,
            nu: d.u,
            np: d.p,
            t: vec![0.0; n + 1],
            h: vec![0.0; n],
            p: vec![0.0; (n + 1) * d.p],
            z: vec![0.0; (n + 1) * nz],
            z_by: vec![0.0; (n + 1) * nz * (nx + d.u)],
            equations,
            lu: Lu::with_capacity(nz),
            work: vec![0.0; d.x.max(nz)],
            full: vec![0.0; nz * (d.x + d.u)],
        }
    }

    /// State with its algebraic part, control and parameters of node `k`, to `into`.
    pub fn put(&self, k: usize, x: &[f64], u: &[f64], into: &mut Many, point: usize) {
        let (n, nx, nz, nu) = (self.n, self.nx, self.nz, self.nu);
        let count = into.n;
        let stage = k.min(n - 1);
        let values = x[k * nx..(k + 1) * nx]
            .iter()
            .chain(&self.z[k * nz..(k + 1) * nz])
            .chain(&u[stage * nu..(stage + 1) * nu])
            .chain(&self.p[k * self.np..(k + 1) * self.np])
            .chain(&self.t[k..=k]);
        values.enumerate().for_each(|(j, v)| into.inputs[j * count + point] = *v);
    }

    /// Solves for the algebraic states of all nodes, from their last values.
    pub fn solve(&mut self, x: &[f64], u: &[f64]) -> EvalResult {
        if self.nz == 0 {
            return Ok(());
        }
        for _ in 0..MAX_NEWTON {
            self.evaluate(x, u)?;
            let mut worst = 0.0f64;
            for k in 0..=self.n {
                if !self.factorise(k) {
                    return Err(EvalError::Recoverable);
                }
                worst = worst.max(self.correct(k));
            }
            if !worst.is_finite() {
                break;
            }
            if worst <= CONVERGED {
                return self.differentiate(x, u);
            }
        }
        self.z.iter_mut().for_each(|z| *z = if z.is_finite() { *z } else { 0.0 });
        Err(EvalError::Recoverable)
    }

    fn evaluate(&mut self, x: &[f64], u: &[f64]) -> EvalResult {
        let mut equations = std::mem::take(&mut self.equations);
        let mut done = Ok(());
        for (f, _) in &mut equations {
            (0..=self.n).for_each(|k| self.put(k, x, u, f, k));
            done = done.and_then(|()| f.values()).and_then(|()| f.jacobians());
        }
        self.equations = equations;
        done
    }

    /// Factors of the derivatives of the equations of node `k` by its algebraic states; all derivatives to `full`.
    fn factorise(&mut self, k: usize) -> bool {
        let (nx, nz, nu) = (self.nx, self.nz, self.nu);
        let columns = nx + nz + nu;
        self.full.fill(0.0);
        for (f, first) in &self.equations {
            for (e, &(i, c)) in f.jac_entries.iter().enumerate().filter(|e| e.1 .1 < columns) {
                if let Some(r) = (*first + i).checked_sub(nx) {
                    self.full[r * columns + c] += f.jac[e * f.n + k];
                }
            }
        }
        let m = self.lu.clear(nz);
        for r in 0..nz {
            m[r * nz..(r + 1) * nz].copy_from_slice(&self.full[r * columns + nx..][..nz]);
        }
        self.lu.factorise()
    }

    /// A step of Newton's method at node `k`; its size relative to the algebraic states.
    fn correct(&mut self, k: usize) -> f64 {
        let (nx, nz) = (self.nx, self.nz);
        let r = &mut self.work[..nz];
        r.fill(0.0);
        for (f, first) in &self.equations {
            for i in 0..f.n_out() {
                if let Some(row) = (*first + i).checked_sub(nx) {
                    r[row] -= f.value[i * f.n + k];
                }
            }
        }
        self.lu.solve(r);
        let z = &mut self.z[k * nz..(k + 1) * nz];
        let (mut change, mut largest) = (0.0f64, 0.0f64);
        for (z, r) in z.iter_mut().zip(&*r) {
            *z += r;
            change = if r.is_nan() { f64::NAN } else { change.max(r.abs()) };
            largest = largest.max(z.abs());
        }
        if change == 0.0 {
            0.0
        } else {
            change / largest
        }
    }

    /// Derivatives at the solution.
    fn differentiate(&mut self, x: &[f64], u: &[f64]) -> EvalResult {
        let (nx, nz, nu) = (self.nx, self.nz, self.nu);
        let columns = nx + nz + nu;
        self.evaluate(x, u)?;
        for k in 0..=self.n {
            if !self.factorise(k) {
                return Err(EvalError::Recoverable);
            }
            for c in 0..nx + nu {
                let from = if c < nx { c } else { c + nz };
                let column = &mut self.work[..nz];
                (0..nz).for_each(|r| column[r] = -self.full[r * columns + from]);
                self.lu.solve(column);
                (0..nz).for_each(|r| self.z_by[(k * nz + r) * (nx + nu) + c] = column[r]);
            }
        }
        Ok(())
    }

    /// Adds `v` times the derivative of input column `c` at node `k` by `(x, u)` to `row[nx + nu]`. At the last node controls do
    /// not count.
    #[inline]
    pub fn add_derivative(&self, k: usize, c: usize, v: f64, row: &mut [f64]) {
        let (nx, nz, nu) = (self.nx, self.nz, self.nu);
        let counted = if k == self.n { nx } else { nx + nu };
        if c < nx {
            row[c] += v;
        } else if c < nx + nz {
            let z_by = &self.z_by[(k * nz + c - nx) * (nx + nu)..][..counted];
            row.iter_mut().zip(z_by).for_each(|(r, z)| *r += v * z);
        } else if c - nz < counted {
            row[c - nz] += v;
        }
    }
}
