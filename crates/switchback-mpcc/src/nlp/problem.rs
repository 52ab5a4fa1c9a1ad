//! The nonlinear program as the solver sees it.

use crate::error::{Error, Result};
use crate::func::{EvalError, EvalResult};
use crate::linalg::csc::Pattern;

/// `v`, or the nearest end of `[lo, hi]`. Unlike [`f64::clamp`] it has a value whatever its arguments: computed ends
/// may cross by rounding or be NaN after an underflow, and that is no reason to panic. Ends that are NaN do not count.
#[inline]
pub fn within(v: f64, lo: f64, hi: f64) -> f64 {
    if v < lo {
        lo
    } else if v > hi {
        hi
    } else {
        v
    }
}

/// Bounds of this modulus or more count as absent.
pub const INFINITE: f64 = 1e20;

/// A row of the constraints that is the product `x[a] · x[b]`.
///
/// The solver convexifies the product Hessian of such a row by itself before it perturbs the whole
/// Hessian, and never needs it evaluated by the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bilinear {
    /// First variable.
    pub a: usize,
    /// Second variable.
    pub b: usize,
    /// Row of `c`.
    pub row: usize,
}

/// Functions and derivatives of a nonlinear program; patterns are fixed.
pub trait Nlp {
    /// Number of variables.
    fn n(&self) -> usize;
    /// Number of rows of `c`.
    fn m(&self) -> usize;
    /// Pattern of the Jacobian of `c`, `m × n`.
    fn jac_pattern(&self) -> &Pattern;
    /// Pattern of the Hessian of `w f + yᵀc`, `n × n`, upper triangle.
    fn hess_pattern(&self) -> &Pattern;
    /// Objective, returned, and constraints `c[m]` at `x[n]`.
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError>;
    /// Gradient `grad[n]` and Jacobian values `jac[nnz]` at `x[n]`, the point evaluated last or another.
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult;
    /// Values of `∇²(w f + yᵀc)`, `hess[nnz]`, at the point where [`Nlp::derivatives`] was called last.
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult;
    /// Told of every barrier problem before its first evaluation; true when functions depend on it, and have to be
    /// evaluated again.
    fn set_level(&mut self, _sigma: f64, _mu: f64) -> bool {
        false
    }
    /// Factor the objective is scaled by; reports undo it.
    fn objective_scale(&self) -> f64 {
        1.0
    }
    /// Largest violation of the rows of the original problem that variables of this one stand for.
    fn elastic(&self, _x: &[f64]) -> f64 {
        0.0
    }
    /// Rows that are products of two variables.
    fn bilinear(&self) -> &[Bilinear] {
        &[]
    }
}

/// A point well inside an interval.
#[inline]
pub fn middle(lo: f64, hi: f64) -> f64 {
    match (lo.is_finite(), hi.is_finite()) {
        (true, true) => 0.5 * (lo + hi),
        (true, false) => lo.max(0.0),
        (false, true) => hi.min(0.0),
        (false, false) => 0.0,
    }
}

/// A point well inside of lower and upper bounds.
pub fn middles([lower, upper]: &[Vec<f64>; 2]) -> Vec<f64> {
    lower.iter().zip(upper).map(|(l, u)| middle(*l, *u)).collect()
}

/// Bounds of variables and rows. Equal bounds fix a variable or make a row an equality; a row without
/// finite bounds takes no part.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// Lower bounds `[n]`.
    pub xl: Vec<f64>,
    /// Upper bounds `[n]`.
    pub xu: Vec<f64>,
    /// Lower bounds of the rows `[m]`.
    pub cl: Vec<f64>,
    /// Upper bounds of the rows `[m]`.
    pub cu: Vec<f64>,
}

impl Bounds {
    /// No bounds at all.
    pub fn free(n: usize, m: usize) -> Bounds {
        Bounds {
            xl: vec![f64::NEG_INFINITY; n],
            xu: vec![f64::INFINITY; n],
            cl: vec![f64::NEG_INFINITY; m],
            cu: vec![f64::INFINITY; m],
        }
    }

    /// Copies values without changing sizes.
    pub fn copy_from(&mut self, other: &Bounds) {
        self.xl.copy_from_slice(&other.xl);
        self.xu.copy_from_slice(&other.xu);
        self.cl.copy_from_slice(&other.cl);
        self.cu.copy_from_slice(&other.cu);
    }

    /// Checks sizes, NaN and order.
    pub fn validate(&self, n: usize, m: usize) -> Result<()> {
        let pairs = [(&self.xl, &self.xu, n, "variable"), (&self.cl, &self.cu, m, "constraint")];
        for (lo, hi, len, what) in pairs {
            if lo.len() != len || hi.len() != len {
                return Err(Error::Dimension(format!(
                    "bounds of the {what}s have lengths {} and {}, expected {len}",
                    lo.len(),
                    hi.len()
                )));
            }
            for i in 0..len {
                if lo[i].is_nan() || hi[i].is_nan() {
                    return Err(Error::Range(format!("bound of {what} {i} is NaN; use an infinity for no bound")));
                }
                if lo[i] > hi[i] {
                    return Err(Error::Range(format!(
                        "{what} {i} has lower bound {} above upper bound {}",
                        lo[i], hi[i]
                    )));
                }
                if lo[i] >= INFINITE || hi[i] <= -INFINITE {
                    return Err(Error::Range(format!("{what} {i} is bounded to infinity: [{}, {}]", lo[i], hi[i])));
                }
            }
        }
        Ok(())
    }
}
