//! The choice of a backend: by name, or by what the analysis says about the factors.

use super::{Factorisation, LdlStats, Ordering, SuiteSparse, SymmetricSolver};
#[cfg(feature = "faer")]
use super::{Faer, Form};
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;
use crate::settings::LinearSolver;

/// Operations per entry of L from which dense blocks beat columns (docs/benchmarks/linalg.md has the measurements).
pub const BLOCKS_FROM: f64 = 100.0;

/// A backend that eliminates in this order.
///
/// # Errors
/// [`Error::Unsupported`] for faer in a library built without it.
pub fn solver(kind: LinearSolver, ordering: Ordering) -> Result<Box<dyn SymmetricSolver>> {
    match kind {
        LinearSolver::Auto => Ok(Box::new(Auto::new(ordering))),
        LinearSolver::Suitesparse => Ok(Box::new(SuiteSparse::with_ordering(ordering))),
        LinearSolver::Faer => blocks(ordering).ok_or_else(|| {
            Error::Unsupported(
                "linear_solver 'faer' is not in this library; build it with the cargo feature 'faer', or choose 'auto' \
                 or 'suitesparse'"
                    .into(),
            )
        }),
    }
}

#[cfg(feature = "faer")]
fn blocks(ordering: Ordering) -> Option<Box<dyn SymmetricSolver>> {
    Some(Box::new(Faer::new(Form::Supernodal, ordering)))
}

#[cfg(not(feature = "faer"))]
fn blocks(_: Ordering) -> Option<Box<dyn SymmetricSolver>> {
    None
}

/// SuiteSparse where the factors are sparse, faer (if it is there) where an entry of L costs [`BLOCKS_FROM`] operations
/// or more. The choice depends on the structure alone.
pub struct Auto {
    ordering: Ordering,
    chosen: Box<dyn SymmetricSolver>,
}

impl Auto {
    /// A solver without a structure; call [`SymmetricSolver::analyse`] next.
    pub fn new(ordering: Ordering) -> Auto {
        Auto { ordering, chosen: Box::new(SuiteSparse::new()) }
    }
}

impl SymmetricSolver for Auto {
    fn name(&self) -> &'static str {
        self.chosen.name()
    }

    fn analyse(&mut self, upper: &Pattern) -> Result<()> {
        super::check_upper(upper)?;
        let ordering = Ordering::Given(self.ordering.order(upper)?);
        let mut columns = SuiteSparse::with_ordering(ordering.clone());
        columns.analyse(upper)?;
        let st = columns.stats();
        self.chosen = Box::new(columns);
        if st.flops >= BLOCKS_FROM * st.nnz_l as f64 && st.nnz_l > 0 {
            if let Some(mut blocks) = blocks(ordering) {
                blocks.analyse(upper)?;
                self.chosen = blocks;
            }
        }
        Ok(())
    }

    fn factor(&mut self, values: &[f64]) -> Factorisation {
        self.chosen.factor(values)
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        self.chosen.solve(rhs);
    }

    fn stats(&self) -> LdlStats {
        self.chosen.stats()
    }

    fn pivots(&self) -> (&[f64], &[usize]) {
        self.chosen.pivots()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fill_decides() {
        // A dense matrix of order n has (n − 1)/2 entries of L in a column, and 2/3 n operations for each.
        let name = |n: usize| {
            let mut s = Auto::new(Ordering::Amd);
            s.analyse(&Pattern::dense_upper(n)).unwrap();
            s.name()
        };
        assert_eq!(name(50), "suitesparse");
        assert_eq!(name(300), if cfg!(feature = "faer") { "faer" } else { "suitesparse" });
    }

    #[test]
    fn by_name() {
        assert_eq!(solver(LinearSolver::Suitesparse, Ordering::Amd).unwrap().name(), "suitesparse");
        match solver(LinearSolver::Faer, Ordering::Natural) {
            Ok(s) => assert_eq!(s.name(), "faer"),
            Err(e) => assert!(!cfg!(feature = "faer") && e.to_string().contains("cargo feature"), "{e}"),
        }
    }
}
