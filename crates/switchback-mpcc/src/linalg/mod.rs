//! Sparse linear algebra: compressed columns, LDLᵀ factorisation, the KKT level above it.
//!
//! `csc` holds patterns, matrices and value maps; `ldl` is the protocol of a symmetric solver with its
//! backends; `kkt` adds equilibration, regularisation, inertia and iterative refinement; `lu` and `cholesky` factorise
//! small dense matrices, `dense` has products and factors for larger ones. This layer does not know optimisation.

#[doc(hidden)]
pub mod cholesky;
pub mod csc;
#[doc(hidden)]
pub mod dense;
#[doc(hidden)]
pub mod forest;
#[doc(hidden)]
pub mod kkt;
mod krylov;
#[doc(hidden)]
pub mod ldl;
#[doc(hidden)]
pub mod lu;
#[doc(hidden)]
pub mod sparse_lu;
