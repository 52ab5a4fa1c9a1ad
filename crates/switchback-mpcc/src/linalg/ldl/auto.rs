//! The choice of a backend: by name, or by what the analysis says about the factors.

use super::{Columns, Factorisation, LdlStats, Native, Ordering, SymmetricSolver};
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
/// [`Error::Unsupported`] for SuiteSparse or faer in a library built without it.
pub fn solver(kind: LinearSolver, ordering: Ordering) -> Result<Box<dyn SymmetricSolver>> {
    match kind {
        LinearSolver::Auto => Ok(Box::new(Auto::new(ordering))),
        LinearSolver::Suitesparse => suitesparse(ordering).ok_or_else(|| absent("suitesparse")),
        LinearSolver::Faer => blocks(ordering).ok_or_else(|| absent("faer")),
        LinearSolver::Native => Ok(Box::new(Native::with_ordering(ordering))),
    }
}

fn absent(name: &str) -> Error {
    Error::Unsupported(format!(
        "linear_solver '{name}' is not in this library; build it with the cargo feature '{name}', or choose 'auto' or 'native'"
    ))
}

#[cfg(feature = "suitesparse")]
fn suitesparse(ordering: Ordering) -> Option<Box<dyn SymmetricSolver>> {
    Some(Box::new(super::SuiteSparse::with_ordering(ordering)))
}

#[cfg(not(feature = "suitesparse"))]
fn suitesparse(_: Ordering) -> Option<Box<dyn SymmetricSolver>> {
    None
}

#[cfg(feature = "faer")]
fn blocks(ordering: Ordering) -> Option<Box<dyn SymmetricSolver>> {
    Some(Box::new(Faer::new(Form::Supernodal, ordering)))
}

#[cfg(not(feature = "faer"))]
fn blocks(_: Ordering) -> Option<Box<dyn SymmetricSolver>> {
    None
}

/// Columns ([`Columns`]) where the factors are sparse, faer (if it is there) where an entry of L costs [`BLOCKS_FROM`] operations
/// or more. The choice depends on the structure alone.
pub struct Auto {
    ordering: Ordering,
    chosen: Box<dyn SymmetricSolver>,
}

impl Auto {
    /// A solver without a structure; call [`SymmetricSolver::analyse`] next.
    pub fn new(ordering: Ordering) -> Auto {
        Auto { ordering, chosen: Box::new(Columns::new()) }
    }
}

impl SymmetricSolver for Auto {
    fn name(&self) -> &'static str {
        self.chosen.name()
    }

    fn analyse(&mut self, upper: &Pattern) -> Result<()> {
        super::check_upper(upper)?;
        let ordering = Ordering::Given(self.ordering.order(upper)?);
        let mut columns = Columns::with_ordering(ordering.clone());
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
        let columns = Columns::new().name();
        assert_eq!(name(50), columns);
        assert_eq!(name(300), if cfg!(feature = "faer") { "faer" } else { columns });
    }

    #[test]
    fn by_name() {
        assert_eq!(solver(LinearSolver::Native, Ordering::Amd).unwrap().name(), "native");
        let optional = [
            (LinearSolver::Suitesparse, "suitesparse", cfg!(feature = "suitesparse")),
            (LinearSolver::Faer, "faer", cfg!(feature = "faer")),
        ];
        for (kind, name, present) in optional {
            match solver(kind, Ordering::Natural) {
                Ok(s) => assert!(present && s.name() == name),
                Err(e) => assert!(!present && e.to_string().contains("cargo feature"), "{e}"),
            }
        }
    }
}
