//! The inertia matrix at a point: factored once where it is constant, never where it is diagonal.

use crate::func::{EvalError, EvalResult, Point};
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

/// A pivot below this share of its diagonal entry is rounding: the matrix is not positive definite to working precision.
const PIVOT: f64 = 8.0 * f64::EPSILON;

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
                let fine = cholesky(n, &mut l);
                (Mass::Dense { n, l, constant: true }, fine)
            }
            Inertia::Varying { .. } => (Mass::Dense { n, l: vec![0.0; n * n], constant: false }, true),
        }
    }

    /// Is it the same everywhere?
    pub(super) fn is_constant(&self) -> bool {
        !matches!(self, Mass::Dense { constant: false, .. })
    }

    /// Evaluates and factors the matrix where it varies.
    pub(super) fn load(&mut self, m: &Mechanics, at: &Point, work: &mut [f64]) -> EvalResult {
        if let (Mass::Dense { n, l, constant: false }, Inertia::Varying { matrix, .. }) = (self, &m.inertia) {
            matrix.value(at, l, work)?;
            if !cholesky(*n, l) {
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
            Mass::Dense { n, l, .. } => {
                for i in 0..*n {
                    let s = (0..i).fold(b[i], |s, k| s - l[i * n + k] * b[k]);
                    b[i] = s / l[i * n + i];
                }
                for i in (0..*n).rev() {
                    let s = (i + 1..*n).fold(b[i], |s, k| s - l[k * n + i] * b[k]);
                    b[i] = s / l[i * n + i];
                }
            }
        }
    }
}

/// Replaces the lower triangle of a symmetric matrix by its factor; false if it is not positive definite.
fn cholesky(n: usize, a: &mut [f64]) -> bool {
    for j in 0..n {
        let d = (0..j).fold(a[j * n + j], |s, k| s - a[j * n + k] * a[j * n + k]);
        // also where it is no number
        if !(d > PIVOT * a[j * n + j].abs() && d.is_finite()) {
            return false;
        }
        let d = d.sqrt();
        a[j * n + j] = d;
        for i in j + 1..n {
            let s = (0..j).fold(a[i * n + j], |s, k| s - a[i * n + k] * a[j * n + k]);
            a[i * n + j] = s / d;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_solve_and_what_is_not_definite_is_refused() {
        let a = [4.0, 2.0, 1.0, 2.0, 5.0, 3.0, 1.0, 3.0, 6.0];
        let mut l = a.to_vec();
        assert!(cholesky(3, &mut l));
        let m = Mass::Dense { n: 3, l, constant: true };
        let x = [1.0, -2.0, 0.5];
        let mut b: Vec<f64> = (0..3).map(|i| (0..3).map(|j| a[3 * i + j] * x[j]).sum()).collect();
        m.solve(&mut b);
        assert!(b.iter().zip(x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
        for bad in [[1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 2.0, 1.0], [0.0; 4], [f64::NAN; 4]] {
            assert!(!cholesky(2, &mut bad.to_vec()), "{bad:?}");
        }
    }
}
