//! The primal-dual point, the kinds of its rows and columns, and the residuals of the KKT conditions.

use super::problem::{Bounds, INFINITE};
use crate::linalg::csc::{mul_add_transposed, Pattern};

/// A primal-dual point. Signs: the Lagrangian is `f + yᵀ(c − s) − zlᵀ(x − xl) − zuᵀ(xu − x) − ...`.
#[derive(Debug, Clone, PartialEq)]
pub struct Iterate {
    /// Variables `[n]`.
    pub x: Vec<f64>,
    /// Slacks of the inequality rows `[m]`; the fixed value for equalities.
    pub s: Vec<f64>,
    /// Multipliers of the rows `[m]`.
    pub y: Vec<f64>,
    /// Multipliers of the lower bounds of `x`, `≥ 0`.
    pub zl: Vec<f64>,
    /// Multipliers of the upper bounds of `x`, `≥ 0`.
    pub zu: Vec<f64>,
    /// Multipliers of the lower bounds of `s`, `≥ 0`.
    pub vl: Vec<f64>,
    /// Multipliers of the upper bounds of `s`, `≥ 0`.
    pub vu: Vec<f64>,
}

impl Iterate {
    /// All zero.
    pub fn zeros(n: usize, m: usize) -> Iterate {
        let (a, b) = (vec![0.0; n], vec![0.0; m]);
        Iterate { x: a.clone(), s: b.clone(), y: b.clone(), zl: a.clone(), zu: a, vl: b.clone(), vu: b }
    }

    /// Copies values without changing sizes.
    pub fn copy_from(&mut self, o: &Iterate) {
        self.x.copy_from_slice(&o.x);
        self.s.copy_from_slice(&o.s);
        self.y.copy_from_slice(&o.y);
        self.zl.copy_from_slice(&o.zl);
        self.zu.copy_from_slice(&o.zu);
        self.vl.copy_from_slice(&o.vl);
        self.vu.copy_from_slice(&o.vu);
    }
}

/// What a row takes part as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RowKind {
    Equality,
    Inequality,
    Free,
}

/// Kinds of rows and columns under given bounds.
#[derive(Debug)]
pub(super) struct Shape {
    pub fixed: Vec<bool>,
    pub row: Vec<RowKind>,
    pub has_xl: Vec<bool>,
    pub has_xu: Vec<bool>,
    pub has_cl: Vec<bool>,
    pub has_cu: Vec<bool>,
    /// Number of bound multipliers.
    pub n_bounds: usize,
    /// Rows that take part.
    pub n_rows: usize,
}

impl Shape {
    pub fn new(n: usize, m: usize) -> Shape {
        Shape {
            fixed: vec![false; n],
            row: vec![RowKind::Free; m],
            has_xl: vec![false; n],
            has_xu: vec![false; n],
            has_cl: vec![false; m],
            has_cu: vec![false; m],
            n_bounds: 0,
            n_rows: 0,
        }
    }

    pub fn classify(&mut self, b: &Bounds) {
        self.n_bounds = 0;
        self.n_rows = 0;
        for j in 0..b.xl.len() {
            self.fixed[j] = b.xl[j] == b.xu[j];
            self.has_xl[j] = !self.fixed[j] && b.xl[j] > -INFINITE;
            self.has_xu[j] = !self.fixed[j] && b.xu[j] < INFINITE;
            self.n_bounds += self.has_xl[j] as usize + self.has_xu[j] as usize;
        }
        for i in 0..b.cl.len() {
            let (lo, hi) = (b.cl[i] > -INFINITE, b.cu[i] < INFINITE);
            self.row[i] = if b.cl[i] == b.cu[i] {
                RowKind::Equality
            } else if lo || hi {
                RowKind::Inequality
            } else {
                RowKind::Free
            };
            let ineq = self.row[i] == RowKind::Inequality;
            self.has_cl[i] = ineq && lo;
            self.has_cu[i] = ineq && hi;
            self.n_rows += (self.row[i] != RowKind::Free) as usize;
            self.n_bounds += self.has_cl[i] as usize + self.has_cu[i] as usize;
        }
    }
}

/// Values of the functions at a point.
#[derive(Debug)]
pub(super) struct Values {
    pub f: f64,
    pub c: Vec<f64>,
    pub grad: Vec<f64>,
    pub jac: Vec<f64>,
    pub hess: Vec<f64>,
}

/// Maximum norms of the residuals, and the factors that scale them in the error.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct KktError {
    pub primal: f64,
    pub dual: f64,
    pub compl: f64,
    pub s_d: f64,
    pub s_c: f64,
}

impl KktError {
    /// Scaled optimality error, (5) of Wächter and Biegler.
    pub fn scaled(&self) -> f64 {
        self.primal.max(self.dual / self.s_d).max(self.compl / self.s_c)
    }
}

/// Violation of the rows in the maximum norm.
pub(super) fn primal_error(shape: &Shape, it: &Iterate, c: &[f64]) -> f64 {
    let mut e = 0f64;
    for i in 0..c.len() {
        if shape.row[i] != RowKind::Free {
            e = e.max((c[i] - it.s[i]).abs());
        }
    }
    e
}

/// Violation of the rows in the sum norm, the measure of the filter.
pub(super) fn theta(shape: &Shape, s: &[f64], c: &[f64]) -> f64 {
    let mut t = 0.0;
    for i in 0..c.len() {
        if shape.row[i] != RowKind::Free {
            t += (c[i] - s[i]).abs();
        }
    }
    t
}

/// `φ_μ = f − μ Σ ln(distance to bounds)`; +∞ when a point is outside.
pub(super) fn barrier(shape: &Shape, b: &Bounds, x: &[f64], s: &[f64], f: f64, mu: f64) -> f64 {
    // products of distances are accumulated so that one logarithm serves many bounds
    let mut acc = LogSum::default();
    for j in 0..x.len() {
        if shape.has_xl[j] {
            acc.push(x[j] - b.xl[j]);
        }
        if shape.has_xu[j] {
            acc.push(b.xu[j] - x[j]);
        }
    }
    for i in 0..s.len() {
        if shape.has_cl[i] {
            acc.push(s[i] - b.cl[i]);
        }
        if shape.has_cu[i] {
            acc.push(b.cu[i] - s[i]);
        }
    }
    f - mu * acc.finish()
}

/// Sum of logarithms of positive numbers with few calls of `ln`.
#[derive(Debug)]
struct LogSum {
    product: f64,
    sum: f64,
}

impl Default for LogSum {
    fn default() -> Self {
        LogSum { product: 1.0, sum: 0.0 }
    }
}

impl LogSum {
    #[inline]
    fn push(&mut self, d: f64) {
        self.product *= d.max(0.0);
        if !(1e-150..=1e150).contains(&self.product) {
            self.sum += self.product.ln();
            self.product = 1.0;
        }
    }
    fn finish(self) -> f64 {
        self.sum + self.product.ln()
    }
}

/// `out = ∇f + Jᵀy`, and 0 for fixed variables.
pub(super) fn lagrangian_gradient(shape: &Shape, jac: &Pattern, v: &Values, y: &[f64], out: &mut [f64]) {
    out.copy_from_slice(&v.grad);
    mul_add_transposed(jac, &v.jac, y, out, 1.0);
    for j in 0..out.len() {
        if shape.fixed[j] {
            out[j] = 0.0;
        }
    }
}

/// Residuals of the barrier problems with the parameters `mu`; `lag` is [`lagrangian_gradient`].
pub(super) fn kkt_error<const N: usize>(
    shape: &Shape,
    b: &Bounds,
    it: &Iterate,
    c: &[f64],
    lag: &[f64],
    mu: [f64; N],
) -> [KktError; N] {
    const S_MAX: f64 = 100.0;
    let mut e = KktError { primal: primal_error(shape, it, c), ..KktError::default() };
    let (mut sum_z, mut sum_y) = (0.0, 0.0);
    let mut compl = [0f64; N];
    let mut product = |distance: f64, z: f64| {
        for (compl, mu) in compl.iter_mut().zip(mu) {
            *compl = compl.max((distance * z - mu).abs());
        }
        sum_z += z;
    };
    for j in 0..it.x.len() {
        e.dual = e.dual.max((lag[j] - it.zl[j] + it.zu[j]).abs());
        if shape.has_xl[j] {
            product(it.x[j] - b.xl[j], it.zl[j]);
        }
        if shape.has_xu[j] {
            product(b.xu[j] - it.x[j], it.zu[j]);
        }
    }
    for i in 0..it.s.len() {
        sum_y += it.y[i].abs();
        if shape.row[i] == RowKind::Inequality {
            e.dual = e.dual.max((-it.y[i] - it.vl[i] + it.vu[i]).abs());
            if shape.has_cl[i] {
                product(it.s[i] - b.cl[i], it.vl[i]);
            }
            if shape.has_cu[i] {
                product(b.cu[i] - it.s[i], it.vu[i]);
            }
        }
    }
    let n_z = shape.n_bounds.max(1) as f64;
    let n_all = (shape.n_bounds + shape.n_rows).max(1) as f64;
    e.s_c = S_MAX.max(sum_z / n_z) / S_MAX;
    e.s_d = S_MAX.max((sum_z + sum_y) / n_all) / S_MAX;
    compl.map(|compl| KktError { compl, ..e })
}
