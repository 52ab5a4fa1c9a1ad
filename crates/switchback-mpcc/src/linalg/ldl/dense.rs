//! The reference backend: eigenvalues for the inertia and LU with partial pivoting for the solution, on
//! dense matrices (nalgebra). Cubic cost and memory inside `factor`: for tests and tiny systems.

use super::{check_upper, Factorisation, Inertia, LdlStats, SymmetricSolver};
use crate::error::Result;
use crate::linalg::csc::Pattern;
use nalgebra::{DMatrix, DVector, Dyn, LU};

/// Dense reference backend; see the module documentation.
///
/// An eigenvalue counts as zero up to `n * eps * max |eigenvalue|`, and then the matrix is singular. The
/// pivots of the statistics are the eigenvalues. Unlike the sparse backends it allocates in `factor`.
#[derive(Default)]
pub struct Dense {
    upper: Option<Pattern>,
    lu: Option<LU<f64, Dyn, Dyn>>,
    min_abs: f64,
    max_abs: f64,
}

impl Dense {
    /// A solver without a structure; call [`SymmetricSolver::analyse`] next.
    pub fn new() -> Dense {
        Dense::default()
    }
}

impl SymmetricSolver for Dense {
    fn name(&self) -> &'static str {
        "dense"
    }

    fn analyse(&mut self, upper: &Pattern) -> Result<()> {
        check_upper(upper)?;
        *self = Dense { upper: Some(upper.clone()), ..Dense::default() };
        Ok(())
    }

    fn factor(&mut self, values: &[f64]) -> Factorisation {
        let p = self.upper.as_ref().expect("dense: factor before analyse");
        assert_eq!(values.len(), p.nnz(), "dense: one value per entry of the analysed pattern");
        self.lu = None;
        (self.min_abs, self.max_abs) = (0.0, 0.0);
        let n = p.n_cols();
        let mut a = DMatrix::<f64>::zeros(n, n);
        for j in 0..n {
            for k in p.range(j) {
                if !values[k].is_finite() {
                    return Factorisation::Singular { pivot: j };
                }
                let i = p.row_idx()[k];
                a[(i, j)] = values[k];
                a[(j, i)] = values[k];
            }
        }
        let mut inertia = Inertia::default();
        if n > 0 {
            let eig = a.clone().symmetric_eigenvalues();
            let largest = eig.amax();
            let zero = n as f64 * f64::EPSILON * largest;
            for &e in eig.iter() {
                if e > zero {
                    inertia.positive += 1;
                } else if e < -zero {
                    inertia.negative += 1;
                } else {
                    inertia.zero += 1;
                }
            }
            if inertia.zero > 0 || !largest.is_finite() {
                return Factorisation::Singular { pivot: null_row(&a) };
            }
            (self.min_abs, self.max_abs) = (eig.amin(), largest);
        }
        self.lu = Some(a.lu());
        Factorisation::Ok(inertia)
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        let lu = self.lu.as_ref().expect("dense: solve needs a successful factorisation");
        let mut x = DVector::from_column_slice(rhs);
        if !rhs.is_empty() {
            let solved = lu.solve_mut(&mut x);
            assert!(solved, "dense: LU found a zero pivot although no eigenvalue is zero");
        }
        rhs.copy_from_slice(x.as_slice());
    }

    fn stats(&self) -> LdlStats {
        let n = self.upper.as_ref().map_or(0, Pattern::n_cols);
        let m = n as f64;
        LdlStats {
            name: self.name(),
            n,
            nnz_a: self.upper.as_ref().map_or(0, Pattern::nnz),
            nnz_l: n * n.saturating_sub(1) / 2,
            flops: 2.0 / 3.0 * m * m * m,
            min_abs_pivot: self.min_abs,
            max_abs_pivot: self.max_abs,
        }
    }
}

/// Row with the largest component in the null vector.
fn null_row(a: &DMatrix<f64>) -> usize {
    let e = a.clone().symmetric_eigen();
    let k = e.eigenvalues.iamin();
    e.eigenvectors.column(k).iamax()
}
