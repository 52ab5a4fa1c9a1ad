//! The inertia matrix at a point: factored once where it is constant, never where it is diagonal.

use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::cholesky;
use crate::system::{Inertia, Mechanics};

/// A factored inertia matrix.
pub(super) enum Mass {
    Unit,
    /// Reciprocals of the diagonal.
    Diagonal(Vec<f64>),
    /// Lower factor of Cholesky, row-major.
    Dense {
        n: usize,
        l: Vec<f64>,
        constant: bool,
    },
}

impl Mass {
    /// Of equations of motion; false if a constant matrix is not positive definite.
    pub(super) fn new(m: &Mechanics) -> (Mass, bool) {
        let n = m.n_v;
        match &m.inertia {
            Inertia::Identity => (Mass::Unit, true),
            Inertia::Constant(a) => {
                if (0..n * n).all(|k| k / n == k % n || a[k] == 0.0) {
                    let d: Vec<f64> = (0..n).map(|i| 1.0 / a[i * n + i]).collect();
                    let fine = d.iter().all(|d| *d > 0.0 && d.is_finite());
                    return (Mass::Diagonal(d), fine);
                }
                let mut l = a.clone();
                let fine = cholesky::factorise(n, &mut l);
                (Mass::Dense { n, l, constant: true }, fine)
            }
            Inertia::Varying { .. } => (Mass::Dense { n, l: vec![0.0; n * n], constant: false }, true),
        }
    }

    /// Is it the same everywhere?
    pub(super) fn is_constant(&self) -> bool {
        !matches!(self, Mass::Dense { constant: false, .. })
    }

    /// Smallest pivot of a factored matrix.
    pub(super) fn smallest_pivot(&self) -> f64 {
        match self {
            Mass::Dense { n, l, .. } => (0..*n).map(|i| l[i * n + i] * l[i * n + i]).fold(f64::INFINITY, f64::min),
            _ => 1.0,
        }
    }

    /// Evaluates and factors the matrix where it varies.
    pub(super) fn load(&mut self, m: &Mechanics, at: &Point, work: &mut [f64]) -> EvalResult {
        if let (Mass::Dense { n, l, constant: false }, Inertia::Varying { matrix, .. }) = (self, &m.inertia) {
            matrix.value(at, l, work)?;
            if !cholesky::factorise(*n, l) {
                return Err(EvalError::Recoverable);
            }
        }
        Ok(())
    }

    /// Replaces `b` by `M⁻¹ b`.
    pub(super) fn solve(&self, b: &mut [f64]) {
        match self {
            Mass::Unit => {}
            Mass::Diagonal(d) => b.iter_mut().zip(d).for_each(|(b, d)| *b *= d),
            Mass::Dense { l, .. } => cholesky::solve(l, b),
        }
    }
}
