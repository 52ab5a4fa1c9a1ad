//! Hessians from gradients, node by node (level D1).

use super::iterate::Iterate;
use crate::linalg::dense::{dot, gemv_transposed, Left};
use crate::qp::StageQp;

/// Powell's damping: the change of the gradient is mixed with that of the model where their product with the step is below this
/// share (J. Nocedal, S. J. Wright, *Numerical Optimization*, 2006, procedure 18.2).
const DAMPING: f64 = 0.2;

/// Blocks `[Q Sᵀ; S R]` of all nodes, updated by the damped BFGS formula from changes of the gradient of the Lagrangian with the
/// present multipliers (H. G. Bock, K. J. Plitt, *A multiple shooting algorithm for direct solution of optimal control
/// problems*, 1984). They start as the Gauss-Newton Hessian.
pub(super) struct BlockUpdates {
    n: usize,
    width: usize,
    blocks: Vec<f64>,
    /// Point and derivatives of the last update.
    x: Vec<f64>,
    u: Vec<f64>,
    grad_x: Vec<f64>,
    grad_u: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    row_x: Vec<f64>,
    row_u: Vec<f64>,
    known: bool,
    s: Vec<f64>,
    y: Vec<f64>,
    bs: Vec<f64>,
}

impl BlockUpdates {
    pub fn new(n: usize, nx: usize, nu: usize, rows: usize) -> BlockUpdates {
        let width = nx + nu;
        BlockUpdates {
            n,
            width,
            blocks: vec![0.0; (n + 1) * width * width],
            x: vec![0.0; (n + 1) * nx],
            u: vec![0.0; n * nu],
            grad_x: vec![0.0; (n + 1) * nx],
            grad_u: vec![0.0; n * nu],
            a: vec![0.0; n * nx * nx],
            b: vec![0.0; n * nx * nu],
            row_x: vec![0.0; rows * nx],
            row_u: vec![0.0; rows * nu],
            known: false,
            s: vec![0.0; width],
            y: vec![0.0; width],
            bs: vec![0.0; width],
        }
    }

    pub fn reset(&mut self) {
        self.known = false;
    }

    /// The gradient of the cost at the last point has changed by this: references are others now.
    pub fn change_gradient(&mut self, gx: &[f64], gu: &[f64]) {
        self.grad_x.iter_mut().zip(gx).for_each(|(t, f)| *t += f);
        self.grad_u.iter_mut().zip(gu).for_each(|(t, f)| *t += f);
    }

    /// The gradient of the cost at the last point is this: parameters are others now.
    pub fn set_gradient(&mut self, gx: &[f64], gu: &[f64]) {
        self.grad_x.copy_from_slice(gx);
        self.grad_u.copy_from_slice(gu);
    }

    /// One update from the last point to this one; the first takes the Hessian of the program.
    pub fn update(&mut self, qp: &StageQp, at: &Iterate, nx: usize, nu: usize) {
        if self.known {
            for k in 0..=self.n {
                self.update_block(qp, at, k, nx, nu);
            }
        } else {
            self.take(qp, nx, nu);
        }
        self.known = true;
        self.x.copy_from_slice(&at.x);
        self.u.copy_from_slice(&at.u);
        self.grad_x.copy_from_slice(&qp.grad_x);
        self.grad_u.copy_from_slice(&qp.grad_u);
        self.a.copy_from_slice(&qp.a);
        self.b.copy_from_slice(&qp.b);
        self.row_x.copy_from_slice(&qp.row_x);
        self.row_u.copy_from_slice(&qp.row_u);
    }

    fn take(&mut self, qp: &StageQp, nx: usize, nu: usize) {
        let w = self.width;
        for k in 0..=self.n {
            let block = &mut self.blocks[k * w * w..(k + 1) * w * w];
            block.fill(0.0);
            for j in 0..nx {
                (0..nx).for_each(|i| block[i + j * w] = qp.hess_x[k * nx * nx + i + j * nx]);
                for i in 0..if k < self.n { nu } else { 0 } {
                    let v = qp.hess_xu[k * nu * nx + i + j * nu];
                    (block[nx + i + j * w], block[j + (nx + i) * w]) = (v, v);
                }
            }
            for j in 0..if k < self.n { nu } else { 0 } {
                (0..nu).for_each(|i| block[nx + i + (nx + j) * w] = qp.hess_u[k * nu * nu + i + j * nu]);
            }
        }
    }

    /// `s = w − w_before`, `y` the change of `∇(cost + λᵀψ + μᵀc)` at fixed multipliers.
    fn update_block(&mut self, qp: &StageQp, at: &Iterate, k: usize, nx: usize, nu: usize) {
        let (w, last) = (self.width, k == self.n);
        self.s.fill(0.0);
        self.y.fill(0.0);
        for i in 0..nx {
            self.s[i] = at.x[k * nx + i] - self.x[k * nx + i];
            self.y[i] = qp.grad_x[k * nx + i] - self.grad_x[k * nx + i];
        }
        if !last {
            for i in 0..nu {
                self.s[nx + i] = at.u[k * nu + i] - self.u[k * nu + i];
                self.y[nx + i] = qp.grad_u[k * nu + i] - self.grad_u[k * nu + i];
            }
            let lambda = &at.lambda[(k + 1) * nx..(k + 2) * nx];
            let mut add = |v: &[f64], columns: usize, from: usize, sign: f64| {
                self.bs[..columns].fill(0.0);
                gemv_transposed(nx, columns, Left { v, ld: nx }, lambda, &mut self.bs[..columns]);
                self.y[from..].iter_mut().zip(&self.bs[..columns]).for_each(|(y, v)| *y += sign * v);
            };
            add(&qp.a[k * nx * nx..], nx, 0, 1.0);
            add(&self.a[k * nx * nx..], nx, 0, -1.0);
            add(&qp.b[k * nx * nu..], nu, nx, 1.0);
            add(&self.b[k * nx * nu..], nu, nx, -1.0);
        }
        for (i, row) in qp.rows.iter().enumerate().filter(|r| r.1.node == k) {
            let mu = at.row_mu[i];
            debug_assert_eq!(row.node, k);
            for j in 0..nx {
                self.y[j] += mu * (qp.row_x[i * nx + j] - self.row_x[i * nx + j]);
            }
            for j in 0..if last { 0 } else { nu } {
                self.y[nx + j] += mu * (qp.row_u[i * nu + j] - self.row_u[i * nu + j]);
            }
        }
        let block = &mut self.blocks[k * w * w..(k + 1) * w * w];
        self.bs.fill(0.0);
        gemv_transposed(w, w, Left { v: block, ld: w }, &self.s, &mut self.bs);
        let (sbs, mut sy) = (dot(&self.s, &self.bs), dot(&self.s, &self.y));
        // a step too small to say anything
        if sbs.is_nan() || sbs <= 0.0 || !sy.is_finite() {
            return;
        }
        if sy < DAMPING * sbs {
            let theta = (1.0 - DAMPING) * sbs / (sbs - sy);
            self.y.iter_mut().zip(&self.bs).for_each(|(y, b)| *y = theta * *y + (1.0 - theta) * b);
            sy = dot(&self.s, &self.y);
        }
        for j in 0..w {
            for i in 0..w {
                block[i + j * w] += self.y[i] * self.y[j] / sy - self.bs[i] * self.bs[j] / sbs;
            }
        }
    }

    /// The blocks as the Hessian of the program.
    pub fn write(&self, qp: &mut StageQp) {
        let (w, nx, nu) = (self.width, qp.nx, qp.nu);
        for k in 0..=self.n {
            let block = &self.blocks[k * w * w..(k + 1) * w * w];
            for j in 0..nx {
                (0..nx).for_each(|i| qp.hess_x[k * nx * nx + i + j * nx] = block[i + j * w]);
            }
            if k < self.n {
                for j in 0..nx {
                    (0..nu).for_each(|i| qp.hess_xu[k * nu * nx + i + j * nu] = block[nx + i + j * w]);
                }
                for j in 0..nu {
                    (0..nu).for_each(|i| qp.hess_u[k * nu * nu + i + j * nu] = block[nx + i + (nx + j) * w]);
                }
            }
        }
    }
}
