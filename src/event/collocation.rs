//! The equations of an implicit step, linearised at its solution.
//!
//! ```text
//! Σ_j (A⁻¹)_ij Z_j / h = F(x0 + Z_i, α_i),   0 = c(x0 + Z_i),   x1 = x0 + Z_3
//! ```
//!
//! With `M` the derivative of these equations with respect to `(Z, α)` and `J_i = ∂F`, `G_i = ∂c` at the stages, a
//! variation of `x0` and the parameters moves the solution by `M δ = (J_i S, −G_i S)`. Forward and adjoint
//! sensitivities use the same matrices, so one is the transpose of the other.

use super::field::Field;
use super::radau::Radau;
use crate::func::{EvalError, EvalResult};
use crate::linalg::lu::Lu;

/// The matrices, with their memory.
pub(super) struct Collocation {
    nx: usize,
    n_z: usize,
    /// Algebraic variables.
    r: usize,
    /// Factors of `M`.
    pub(super) lu: Lu<f64>,
    /// `J_i`, `nx × n_z` each.
    jac: Vec<f64>,
    /// `G_i`, `r × n_z` each.
    g: Vec<f64>,
    x: Vec<f64>,
}

impl Collocation {
    pub(super) fn new(nx: usize, n_z: usize, most: usize) -> Collocation {
        Collocation {
            nx,
            n_z,
            r: 0,
            lu: Lu::with_capacity(3 * (nx + most)),
            jac: vec![0.0; 3 * nx * n_z],
            g: vec![0.0; 3 * most * n_z],
            x: vec![0.0; nx],
        }
    }

    /// Number of unknowns of a stage.
    pub(super) fn own(&self) -> usize {
        self.nx + self.r
    }

    /// `J_i`.
    pub(super) fn jac(&self, i: usize) -> &[f64] {
        let n = self.nx * self.n_z;
        &self.jac[i * n..(i + 1) * n]
    }

    /// `G_i`.
    pub(super) fn g(&self, i: usize) -> &[f64] {
        let n = self.r * self.n_z;
        &self.g[i * n..(i + 1) * n]
    }

    /// Linearises a step of length `h` from `(t, x0)` whose increments and weights at the stages are `z`.
    pub(super) fn assemble(
        &mut self,
        radau: &Radau,
        field: &mut Field,
        (t, h): (f64, f64),
        x0: &[f64],
        z: [&[f64]; 3],
    ) -> EvalResult {
        let (nx, n_z, r) = (self.nx, self.n_z, field.n_alg());
        self.r = r;
        let own = self.own();
        let n = 3 * own;
        self.lu.clear(n);
        for (i, z) in z.into_iter().enumerate() {
            self.x.iter_mut().zip(x0.iter().zip(z)).for_each(|(x, (x0, z))| *x = x0 + z);
            let t = t + radau.node(i) * h;
            if r > 0 {
                field.hidden(t, &self.x)?;
                let g = &mut self.g[i * r * n_z..(i + 1) * r * n_z];
                g.fill(0.0);
                for b in 0..r {
                    field.c(b).for_each(|(j, v)| g[b * n_z + j] = v);
                }
            }
            let jac = &mut self.jac[i * nx * n_z..(i + 1) * nx * n_z];
            field.jacobian(t, &self.x, &z[nx..nx + r], jac)?;
            let m = self.lu.matrix();
            for a in 0..nx {
                let row = &mut m[(i * own + a) * n..(i * own + a + 1) * n];
                for j in 0..3 {
                    row[j * own + a] += radau.a_inv[(i, j)] / h;
                }
                for b in 0..nx {
                    row[i * own + b] -= jac[a * n_z + b];
                }
            }
            for b in 0..r {
                field.d(b).for_each(|(a, v)| m[(i * own + a) * n + i * own + nx + b] = -v);
                let row = &mut m[(i * own + nx + b) * n + i * own..][..nx];
                field.c(b).filter(|c| c.0 < nx).for_each(|(a, v)| row[a] = v);
            }
        }
        let own = self.own();
        let size = |j: usize| radau.size(j % own);
        if self.lu.factorise_sized(size) {
            Ok(())
        } else {
            Err(EvalError::Recoverable)
        }
    }
}
