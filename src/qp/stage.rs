//! Data and solutions of quadratic programs with stages.

use crate::error::{Error, Result};
use crate::linalg::dense::{dot, gemv, gemv_transposed, Left};
use crate::memory::sizes;

/// What a unit of violation of a row costs: `linear s + quadratic s²`, `s ≥ 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Price {
    /// Per unit; not negative.
    pub linear: f64,
    /// Per squared unit; not negative.
    pub quadratic: f64,
}

/// A row of constraints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// The node it belongs to, 0 to `n`. Rows of node `n` have no controls.
    pub node: usize,
    /// `None`: it may not be violated.
    pub price: Option<Price>,
}

/// What is known of the first state.
#[derive(Debug, Clone, PartialEq)]
pub enum Initial {
    /// It is given.
    Given,
    /// It is free, at the price of the arrival `½ (x_0 − x̄)ᵀ W (x_0 − x̄)` with the weight `W`, `[nx · nx]`, both triangles: programs of
    /// estimation. Solutions are for a given `x̄`.
    Free(Vec<f64>),
}

/// Data of a program. Matrices are column-major, one behind the other; rows of constraints are sorted by node.
#[derive(Debug, Clone)]
pub struct StageQp {
    /// Number of stages `N`.
    pub n: usize,
    /// States of a node.
    pub nx: usize,
    /// Controls of a stage.
    pub nu: usize,
    /// Is `x_0` given?
    pub initial: Initial,
    /// `Q_k`, `[(n + 1) · nx · nx]`, symmetric, both triangles.
    pub hess_x: Vec<f64>,
    /// `S_k`, `[n · nu · nx]`, `nu × nx`.
    pub hess_xu: Vec<f64>,
    /// `R_k`, `[n · nu · nu]`, both triangles.
    pub hess_u: Vec<f64>,
    /// `q_k`, `[(n + 1) · nx]`.
    pub grad_x: Vec<f64>,
    /// `r_k`, `[n · nu]`.
    pub grad_u: Vec<f64>,
    /// `A_k`, `[n · nx · nx]`.
    pub a: Vec<f64>,
    /// `B_k`, `[n · nx · nu]`, `nx × nu`.
    pub b: Vec<f64>,
    /// `c_k`, `[n · nx]`.
    pub c: Vec<f64>,
    /// Bounds of the controls, `[n · nu]`.
    pub u_lower: Vec<f64>,
    /// Bounds of the controls, `[n · nu]`.
    pub u_upper: Vec<f64>,
    /// Rows of constraints, by rising node.
    pub rows: Vec<Row>,
    /// `C_i`, `[rows · nx]`.
    pub row_x: Vec<f64>,
    /// `D_i`, `[rows · nu]`; zero at node `n`.
    pub row_u: Vec<f64>,
    /// Bounds of the rows.
    pub row_lower: Vec<f64>,
    /// Bounds of the rows.
    pub row_upper: Vec<f64>,
    /// Sizes of what bounds of controls and of rows are differences from, zero where they are none: their rounding is that of these numbers.
    pub u_base: Vec<f64>,
    /// The same of rows.
    pub row_base: Vec<f64>,
}

impl StageQp {
    /// A program of this size with all data zero and no bounds.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a size is zero, nodes do not rise, or the program is too large.
    pub fn new(n: usize, nx: usize, nu: usize, rows: Vec<Row>) -> Result<StageQp> {
        if n == 0 || nx == 0 || nu == 0 {
            return Err(Error::Dimension(format!(
                "a program of {n} stages with {nx} states and {nu} controls: none may be zero"
            )));
        }
        if rows.windows(2).any(|w| w[0].node > w[1].node) || rows.last().is_some_and(|r| r.node > n) {
            return Err(Error::Dimension("rows of constraints are given node by node, the last node is n".into()));
        }
        let bad = |p: &Price| !(p.linear >= 0.0 && p.quadratic >= 0.0 && p.linear + p.quadratic > 0.0);
        if rows.iter().filter_map(|r| r.price.as_ref()).any(bad) {
            return Err(Error::Range("a violation has a price that is not positive".into()));
        }
        sizes::check("entries of a quadratic program", &[n + 1, nx, nx + n * nu])?;
        sizes::check("entries of its rows", &[rows.len() + 1, n, nu])?;
        let m = rows.len();
        let free = f64::INFINITY;
        Ok(StageQp {
            n,
            nx,
            nu,
            initial: Initial::Given,
            hess_x: vec![0.0; (n + 1) * nx * nx],
            hess_xu: vec![0.0; n * nu * nx],
            hess_u: vec![0.0; n * nu * nu],
            grad_x: vec![0.0; (n + 1) * nx],
            grad_u: vec![0.0; n * nu],
            a: vec![0.0; n * nx * nx],
            b: vec![0.0; n * nx * nu],
            c: vec![0.0; n * nx],
            u_lower: vec![-free; n * nu],
            u_upper: vec![free; n * nu],
            rows,
            row_x: vec![0.0; m * nx],
            row_u: vec![0.0; m * nu],
            row_lower: vec![-free; m],
            row_upper: vec![free; m],
            u_base: vec![0.0; n * nu],
            row_base: vec![0.0; m],
        })
    }

    pub(crate) fn a(&self, k: usize) -> Left<'_> {
        Left { v: &self.a[k * self.nx * self.nx..], ld: self.nx }
    }

    pub(crate) fn b(&self, k: usize) -> Left<'_> {
        Left { v: &self.b[k * self.nx * self.nu..], ld: self.nx }
    }

    pub(crate) fn q(&self, k: usize) -> Left<'_> {
        Left { v: &self.hess_x[k * self.nx * self.nx..], ld: self.nx }
    }

    pub(crate) fn s(&self, k: usize) -> Left<'_> {
        Left { v: &self.hess_xu[k * self.nu * self.nx..], ld: self.nu }
    }

    pub(crate) fn r(&self, k: usize) -> Left<'_> {
        Left { v: &self.hess_u[k * self.nu * self.nu..], ld: self.nu }
    }

    /// `x_{k+1} = A_k x_k + B_k u_k + c_k`
    pub(crate) fn step(&self, k: usize, x: &[f64], u: &[f64], next: &mut [f64]) {
        let (nx, nu) = (self.nx, self.nu);
        next.copy_from_slice(&self.c[k * nx..(k + 1) * nx]);
        gemv(nx, nx, self.a(k), x, next);
        gemv(nx, nu, self.b(k), u, next);
    }

    /// All states from the first, `x[(n + 1) · nx]`, under controls `u[n · nu]`.
    pub(crate) fn roll_out(&self, u: &[f64], x: &mut [f64]) {
        let (nx, nu) = (self.nx, self.nu);
        for k in 0..self.n {
            let (before, after) = x.split_at_mut((k + 1) * nx);
            self.step(k, &before[k * nx..], &u[k * nu..(k + 1) * nu], &mut after[..nx]);
        }
    }

    /// Value of the program at states and controls of all nodes, with prices of violations; rows without one have `price` per unit.
    pub(crate) fn objective(&self, x: &[f64], u: &[f64], price: f64) -> f64 {
        let (nx, nu) = (self.nx, self.nu);
        let mut sum = dot(&self.grad_x, x) + dot(&self.grad_u, u);
        for k in 0..=self.n {
            let own = &x[k * nx..(k + 1) * nx];
            for (j, v) in own.iter().enumerate() {
                sum += 0.5 * v * dot(&self.hess_x[(k * nx + j) * nx..][..nx], own);
            }
            if k == self.n {
                break;
            }
            let control = &u[k * nu..(k + 1) * nu];
            for (j, v) in own.iter().enumerate() {
                sum += v * dot(&self.hess_xu[(k * nx + j) * nu..][..nu], control);
            }
            for (j, v) in control.iter().enumerate() {
                sum += 0.5 * v * dot(&self.hess_u[(k * nu + j) * nu..][..nu], control);
            }
        }
        for (i, row) in self.rows.iter().enumerate() {
            let v = self.row_value(i, x, u);
            let beyond = (v - self.row_upper[i]).max(self.row_lower[i] - v).max(0.0);
            let price = row.price.unwrap_or(Price { linear: price, quadratic: 0.0 });
            sum += beyond * (price.linear + price.quadratic * beyond);
        }
        sum
    }

    /// Value of row `i` at states and controls of all nodes.
    pub(crate) fn row_value(&self, i: usize, x: &[f64], u: &[f64]) -> f64 {
        let (nx, nu, k) = (self.nx, self.nu, self.rows[i].node);
        let s = dot(&self.row_x[i * nx..(i + 1) * nx], &x[k * nx..(k + 1) * nx]);
        if k < self.n {
            s + dot(&self.row_u[i * nu..(i + 1) * nu], &u[k * nu..(k + 1) * nu])
        } else {
            s
        }
    }

    /// Multipliers `λ_0, …, λ_N` of the dynamics that make the derivatives by the states zero, from the last node back:
    /// `λ_k = Q_k x_k + S_kᵀ u_k + q_k + A_kᵀ λ_{k+1} + Σ_i C_iᵀ μ_i`.
    pub(crate) fn multipliers(&self, x: &[f64], u: &[f64], row_mu: &[f64], lambda: &mut [f64]) {
        let (nx, nu) = (self.nx, self.nu);
        let mut i = self.rows.len();
        for k in (0..=self.n).rev() {
            let (own, after) = lambda.split_at_mut((k + 1) * nx);
            let own = &mut own[k * nx..];
            own.copy_from_slice(&self.grad_x[k * nx..(k + 1) * nx]);
            gemv(nx, nx, self.q(k), &x[k * nx..(k + 1) * nx], own);
            if k < self.n {
                gemv_transposed(nu, nx, self.s(k), &u[k * nu..(k + 1) * nu], own);
                gemv_transposed(nx, nx, self.a(k), &after[..nx], own);
            }
            while i > 0 && self.rows[i - 1].node == k {
                i -= 1;
                if row_mu[i] != 0.0 {
                    crate::linalg::dense::axpy(row_mu[i], &self.row_x[i * nx..(i + 1) * nx], own);
                }
            }
        }
    }

    /// The row of the same kind one node earlier: as many rows behind the first of its node.
    pub(crate) fn earlier_row(&self, i: usize) -> Option<usize> {
        let rows = &self.rows;
        let node = rows[i].node.checked_sub(1)?;
        let first = |k: usize| rows.partition_point(|r| r.node < k);
        let j = first(node) + (i - first(node + 1));
        (j < rows.len() && rows[j].node == node).then_some(j)
    }

    /// Entry of row `i`'s controls in all controls is at `node · nu`; nothing at the last node.
    pub(crate) fn own_controls(&self, i: usize) -> Option<(usize, &[f64])> {
        let (k, nu) = (self.rows[i].node, self.nu);
        (k < self.n).then(|| (k * nu, &self.row_u[i * nu..(i + 1) * nu]))
    }
}

/// A solution with its multipliers: those of bounds and rows are positive at upper and negative at lower bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct QpSolution {
    /// States `[(n + 1) · nx]`.
    pub x: Vec<f64>,
    /// Controls `[n · nu]`.
    pub u: Vec<f64>,
    /// `λ_0, …, λ_N`, `[(n + 1) · nx]`; `λ_0` belongs to the given `x_0`.
    pub lambda: Vec<f64>,
    /// Of the bounds of the controls `[n · nu]`.
    pub u_mu: Vec<f64>,
    /// Of the rows.
    pub row_mu: Vec<f64>,
}

impl QpSolution {
    /// Zeros for a program.
    pub fn new(qp: &StageQp) -> QpSolution {
        QpSolution {
            x: vec![0.0; (qp.n + 1) * qp.nx],
            u: vec![0.0; qp.n * qp.nu],
            lambda: vec![0.0; (qp.n + 1) * qp.nx],
            u_mu: vec![0.0; qp.n * qp.nu],
            row_mu: vec![0.0; qp.rows.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two stages, all terms of the objective with numbers of their own.
    #[test]
    fn the_objective_by_hand() {
        let rows =
            vec![Row { node: 1, price: Some(Price { linear: 2.0, quadratic: 3.0 }) }, Row { node: 2, price: None }];
        let mut qp = StageQp::new(2, 1, 1, rows).unwrap();
        qp.hess_x.copy_from_slice(&[2.0, 4.0, 6.0]);
        qp.hess_xu.copy_from_slice(&[0.5, -0.25]);
        qp.hess_u.copy_from_slice(&[1.0, 3.0]);
        qp.grad_x.copy_from_slice(&[1.0, -1.0, 2.0]);
        qp.grad_u.copy_from_slice(&[0.5, 1.5]);
        qp.row_x.copy_from_slice(&[1.0, 1.0]);
        qp.row_u.copy_from_slice(&[1.0, 0.0]);
        qp.row_upper.copy_from_slice(&[1.0, 0.5]);
        let (x, u) = ([1.0, 2.0, 3.0], [-1.0, 0.5]);
        let squares =
            0.5 * (2.0 + 4.0 * 4.0 + 6.0 * 9.0) + (0.5 * x[0] * u[0] - 0.25 * x[1] * u[1]) + 0.5 * (1.0 + 3.0 * 0.25);
        let linear = 1.0 - 2.0 + 6.0 - 0.5 + 0.75;
        // 2 + 0.5 exceeds 1 by 1.5, and 3 exceeds 0.5 by 2.5
        let prices = 2.0 * 1.5 + 3.0 * 1.5 * 1.5 + 10.0 * 2.5;
        assert!((qp.objective(&x, &u, 10.0) - squares - linear - prices).abs() < 1e-13);
    }
}
