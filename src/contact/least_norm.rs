//! Small linear systems that may be singular: what redundant contacts share is shared with the least norm.

use nalgebra::{DMatrix, DVector};

use crate::linalg::lu::Lu;

/// Singular values below this share of the largest are zero: ten thousand times rounding, below what data can mean.
const RANK: f64 = 1e-11;

/// Factors of a matrix, or its pseudo-inverse where it is singular.
pub(super) struct LeastNorm {
    lu: Lu<f64>,
    copy: Vec<f64>,
    n: usize,
    inverse: Option<DMatrix<f64>>,
}

impl LeastNorm {
    pub(super) fn with_capacity(n: usize) -> LeastNorm {
        LeastNorm { lu: Lu::with_capacity(n), copy: Vec::with_capacity(n * n), n: 0, inverse: None }
    }

    /// A zero matrix of order `n`, row-major, to write to.
    pub(super) fn clear(&mut self, n: usize) -> &mut [f64] {
        self.n = n;
        self.lu.clear(n)
    }

    /// Factors what was written; false if there are entries that are no numbers.
    pub(super) fn factorise(&mut self) -> bool {
        self.inverse = None;
        self.copy.clear();
        self.copy.extend_from_slice(self.lu.matrix());
        if self.copy.iter().any(|v| !v.is_finite()) {
            return false;
        }
        // redundancy shows as pivots of rounding; a matrix of order one is what it is
        if self.lu.factorise() && (self.n == 1 || self.well_conditioned()) {
            return true;
        }
        let a = DMatrix::from_row_slice(self.n, self.n, &self.copy);
        let svd = a.svd(true, true);
        let largest = svd.singular_values.max();
        if let Ok(inverse) = svd.pseudo_inverse(RANK * largest) {
            self.inverse = Some(inverse);
            return true;
        }
        false
    }

    /// Are all pivots well above rounding?
    fn well_conditioned(&mut self) -> bool {
        let n = self.n;
        let scale = self.copy.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let m = self.lu.matrix();
        (0..n).all(|i| m[i * n + i].abs() > RANK * scale)
    }

    /// The matrix, row-major, of the last factorisation.
    pub(super) fn entries(&self) -> &[f64] {
        &self.copy
    }

    /// Was the matrix singular?
    pub(super) fn is_singular(&self) -> bool {
        self.inverse.is_some()
    }

    /// Replaces the right-hand side by the solution of least norm.
    pub(super) fn solve(&mut self, b: &mut [f64]) {
        match &self.inverse {
            None if self.n == 1 => b[0] /= self.copy[0],
            None => self.lu.solve(b),
            Some(inverse) => {
                let x = inverse * DVector::from_column_slice(&b[..self.n]);
                b[..self.n].copy_from_slice(x.as_slice());
            }
        }
    }
}
