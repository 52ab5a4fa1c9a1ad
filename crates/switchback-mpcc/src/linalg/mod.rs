//! Sparse linear algebra: compressed columns, LDLᵀ factorisation, the KKT level above it.
//!
//! `csc` holds patterns, matrices and value maps; `ldl` is the protocol of a symmetric solver with its
//! backends; `kkt` adds equilibration, regularisation, inertia and iterative refinement; `lu` and `cholesky` factorise
//! small dense matrices, `dense` has products and factors for larger ones. This layer does not know optimisation.

pub mod cholesky;
pub mod csc;
pub mod dense;
pub mod kkt;
mod krylov;
pub mod ldl;
pub mod lu;
pub mod sparse_lu;
