//! Small linear systems that may be singular: what redundant contacts share is shared with the least norm.

use nalgebra::{DMatrix, DVector};

use crate::linalg::lu::Lu;

/// Singular values below this share of the largest are zero: ten thousand times rounding, below what data can mean.
const RANK: f64 = 1e-11;

/// Entries below this share of the largest of their row and of their column are rounding of the decomposition.
const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// Sets entries to zero that are the rounding of others: a contact that nothing pushes would have a force that is rounding of those of others, with a sign
/// that opens it, where bodies rest beside each other. The bound is the geometric mean of the largest in the row and in the column, which does not depend on
/// the units of the gaps.
fn without_rounding(a: &mut DMatrix<f64>) {
    let rows: Vec<f64> = a.row_iter().map(|r| r.amax()).collect();
    let columns: Vec<f64> = a.column_iter().map(|c| c.amax()).collect();
    for (i, row) in rows.iter().enumerate() {
        for (j, column) in columns.iter().enumerate() {
            if a[(i, j)].abs() <= ROUNDING * (row * column).sqrt() {
                a[(i, j)] = 0.0;
            }
        }
    }
}

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
        if let Ok(mut inverse) = svd.pseudo_inverse(RANK * largest) {
            without_rounding(&mut inverse);
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

#[cfg(test)]
mod tests {
    use super::LeastNorm;

    /// Two bodies that rest beside each other on a floor: the push between them and the frictions are one too many, and nothing pushes.
    #[test]
    fn what_nothing_pushes_has_no_force_at_all() {
        // rows: the push, and of both bodies the weight and the friction; masses of 1 and 0.7
        let masses = [1.0, 1.0, 0.7, 0.7];
        let jacobian: [[f64; 4]; 5] = [
            [-1.0, 0.0, 1.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        let mut s = LeastNorm::with_capacity(5);
        let a = s.clear(5);
        for i in 0..5 {
            for j in 0..5 {
                a[5 * i + j] = (0..4).map(|k| jacobian[i][k] * jacobian[j][k] / masses[k]).sum();
            }
        }
        assert!(s.factorise() && s.is_singular());
        let mut b = [0.0, 9.81, 0.0, 9.81, 0.0];
        s.solve(&mut b);
        assert_eq!([b[0], b[2], b[4]], [0.0; 3], "{b:?}");
        assert!((b[1] - 9.81).abs() < 1e-13 && (b[3] - 6.867).abs() < 1e-13, "{b:?}");
    }
}
