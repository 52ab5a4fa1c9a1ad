//! Primal-dual interior-point method for sparse nonlinear programs.
//!
//! ```text
//! min f(x)   s.t.   x_l ≤ x ≤ x_u,   c_l ≤ c(x) ≤ c_u
//! ```
//!
//! Filter line search after Wächter and Biegler (Math. Program. 106, 2006), written for problems whose
//! bounds move while they are solved: a [`Continuation`] owns the barrier parameter `μ` and a relaxation
//! `σ` that is the upper bound of a range of rows. Square and over-determined problems are legal. The
//! layer does not know time, and it knows of complementarity only that some rows are products of two
//! variables ([`Bilinear`]).
//!
//! `problem` is the interface, `iterate` holds the primal-dual point and its residuals, `augmented` the
//! Newton system, `filter` the acceptance test, `linesearch` the steps, `restore` the elastic problem,
//! `saddle` the way out of saddle points, `curvature` the conditions of second order, `tangent` derivatives of solutions, `solver` the main loop.

pub mod allowance;
mod augmented;
mod callback;
mod centrality;
mod curvature;
mod filter;
mod iterate;
mod linesearch;
mod problem;
mod report;
mod restore;
mod saddle;
#[rustfmt::skip]
mod settings;
mod solver;
mod start;
mod tangent;

pub use callback::{CallbackNlp, LagrangianFn, ParameterChange};
pub use curvature::{FirstOrder, SecondOrder};
pub use iterate::Iterate;
pub use problem::within;
pub use problem::{middle, middles};
pub use problem::{Bilinear, Bounds, Nlp, INFINITE};
pub use report::{Control, IterationInfo, Outcome, Residuals, Statistics};
pub use settings::IpmSettings;
pub(crate) use solver::lower_barrier;
pub use solver::{Advance, Continuation, Ipm, Level, Measures, Monotone, Start};
