//! The protocol of a symmetric solver, and its backends.
//!
//! A backend factors a symmetric, possibly indefinite matrix `A` given by its upper triangle. It knows
//! neither scaling nor regularisation nor refinement: that is the level above ([`super::kkt`]).
//!
//! # Protocol
//! 1. [`SymmetricSolver::analyse`] once per structure: orders, finds the fill, allocates all memory.
//! 2. [`SymmetricSolver::factor`] as often as the values change; the values come in the order of the
//!    pattern that was analysed. Allocates nothing.
//! 3. The inertia comes with the successful factorisation. A zero pivot, NaN or infinity ends it with
//!    [`Factorisation::Singular`], and there is nothing to solve with.
//! 4. [`SymmetricSolver::solve`] in place, as often as wanted after a successful factorisation.
//!
//! The same pattern and values give the same bits. Every backend passes the one suite in `conformance`.

mod auto;
#[cfg(test)]
mod conformance;
mod dense;
#[cfg(feature = "faer")]
mod faer;
mod native;
mod ordering;
#[cfg(feature = "suitesparse")]
mod suitesparse;

pub use auto::{solver, Auto, BLOCKS_FROM};
pub use dense::Dense;
#[cfg(feature = "faer")]
pub use faer::{Faer, Form};
pub use native::Native;
pub use ordering::{interleaved, Ordering};
#[cfg(feature = "suitesparse")]
pub use suitesparse::SuiteSparse;

#[cfg(not(feature = "suitesparse"))]
use native::amd;
#[cfg(not(feature = "suitesparse"))]
pub use native::Native as Columns;
#[cfg(feature = "suitesparse")]
use suitesparse::amd;
/// The backend that eliminates column by column where none is named, and the order that it takes.
#[cfg(feature = "suitesparse")]
pub use suitesparse::SuiteSparse as Columns;

use super::csc::Pattern;
use crate::error::{Error, Result};

/// How many eigenvalues are positive, negative and zero (Sylvester's law: the signs of the pivots).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Inertia {
    /// Number of positive eigenvalues.
    pub positive: usize,
    /// Number of negative eigenvalues.
    pub negative: usize,
    /// Number of zero eigenvalues.
    pub zero: usize,
}

/// How a numeric factorisation ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Factorisation {
    /// There are factors to solve with.
    Ok(Inertia),
    /// A pivot was zero or not finite, or an input value was not finite; no factors.
    Singular {
        /// Row of the matrix (unpermuted) whose pivot failed, or the column of the value that is not
        /// finite.
        pivot: usize,
    },
}

/// Facts about the last analysis and factorisation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LdlStats {
    /// Name of the backend.
    pub name: &'static str,
    /// Order of the matrix.
    pub n: usize,
    /// Entries of the upper triangle, as given.
    pub nnz_a: usize,
    /// Entries of L below the diagonal.
    pub nnz_l: usize,
    /// Floating-point operations of one factorisation (multiplications, additions and divisions).
    pub flops: f64,
    /// Smallest absolute pivot of the last factorisation; 0 before it, after a breakdown, and for `n = 0`.
    pub min_abs_pivot: f64,
    /// Largest absolute pivot of the last factorisation; 0 likewise.
    pub max_abs_pivot: f64,
}

/// Puts the values `src` of the matrix in the order of elimination. The place of the first that is not finite, if there is one.
fn take_over(values: &[f64], src: &[u32], to: &mut [f64]) -> Option<usize> {
    let mut finite = true;
    for (a, &k) in to.iter_mut().zip(src) {
        let v = values[k as usize];
        finite &= v.is_finite();
        *a = v;
    }
    if finite {
        None
    } else {
        to.iter().position(|v| !v.is_finite())
    }
}

/// Inertia of a matrix with these pivots, and the smallest and the largest absolute one, 0 without any. The place of the first pivot that is
/// zero or not finite is an error.
fn judge(pivots: &[f64]) -> std::result::Result<(Inertia, [f64; 2]), usize> {
    let mut positive = 0;
    // Without the sign, the bits of floats order like the floats, NaN last.
    let (mut lo, mut hi) = (u64::MAX, 0);
    for &d in pivots {
        positive += usize::from(d > 0.0);
        let bits = d.abs().to_bits();
        lo = lo.min(bits);
        hi = hi.max(bits);
    }
    let inertia = Inertia { positive, negative: pivots.len() - positive, zero: 0 };
    if pivots.is_empty() {
        return Ok((inertia, [0.0; 2]));
    }
    let range = [lo, hi].map(f64::from_bits);
    if range[0] == 0.0 || !range[1].is_finite() {
        return Err(pivots.iter().position(|d| *d == 0.0 || !d.is_finite()).unwrap_or(0));
    }
    Ok((inertia, range))
}

/// A direct solver for symmetric indefinite systems; the protocol is in the module documentation.
pub trait SymmetricSolver: Send {
    /// Name of the backend, for logs.
    fn name(&self) -> &'static str;

    /// Takes the structure: the upper triangle, square, rows sorted. All memory is allocated here. May be
    /// called again with another structure.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the pattern is not square or has entries below the diagonal,
    /// [`Error::Unsupported`] if the backend cannot index the factors, [`Error::Library`] if the ordering
    /// fails.
    fn analyse(&mut self, upper: &Pattern) -> Result<()>;

    /// Factors the matrix whose upper triangle has `values`, in the order of the analysed pattern.
    ///
    /// # Panics
    /// Before [`SymmetricSolver::analyse`], or if the number of values is not that of the pattern.
    fn factor(&mut self, values: &[f64]) -> Factorisation;

    /// Replaces `rhs` (length `n`) by the solution.
    ///
    /// # Panics
    /// If the last factorisation was not successful, or for a wrong length.
    fn solve(&mut self, rhs: &mut [f64]);

    /// Facts about the last analysis and factorisation.
    fn stats(&self) -> LdlStats;

    /// Pivots of the last successful factorisation, in elimination order, and that order: the `k`-th
    /// pivot belongs to row `order[k]`. Both are empty for a backend without scalar pivots.
    fn pivots(&self) -> (&[f64], &[usize]) {
        (&[], &[])
    }
}

/// Refuses what is not an upper triangle.
fn check_upper(upper: &Pattern) -> Result<()> {
    if upper.is_upper() {
        return Ok(());
    }
    if upper.n_rows() != upper.n_cols() {
        return Err(Error::Dimension(format!(
            "symmetric solver: the pattern is {}x{}; a symmetric matrix is square",
            upper.n_rows(),
            upper.n_cols()
        )));
    }
    let j = (0..upper.n_cols()).find(|&j| upper.rows(j).last().is_some_and(|&i| i > j)).unwrap_or(0);
    Err(Error::Dimension(format!(
        "symmetric solver: column {j} has entries below the diagonal; pass the upper triangle only"
    )))
}
