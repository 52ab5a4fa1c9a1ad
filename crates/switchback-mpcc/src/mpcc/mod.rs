//! Mathematical programs with complementarity constraints.
//!
//! ```text
//! min f(w)   s.t.   bounds,   c_l ≤ c(w) ≤ c_u,   0 ≤ w_a ⊥ w_b ≥ 0 for pairs (a, b)
//! ```
//!
//! Vertical form: both members of a pair are variables with lower bound zero ([`Lifted`] brings functions
//! `G`, `H` into it). One interior-point run follows a [`relaxation`], by default `w_a w_b ≤ σ` (Scholtes), with
//! `σ` tied to the barrier parameter; then the active set is identified, the branch problem with that set is solved
//! to the last digits, and the multipliers of the pairs come out of it.

mod branches;
mod by_branches;
mod certificate;
#[cfg(test)]
mod certificate_tests;
mod claims;
mod conflict;
mod curvature;
pub mod diagnostics;
mod endgame;
mod exact;
mod homotopy;
mod infeasible;
mod judge;
mod lemke;
mod lifted;
mod lpcc;
mod models;
mod parameters;
mod path;
mod penalties;
mod policy;
mod portfolio;
mod problem;
mod proposer;
pub mod quadratic;
pub mod relaxation;
mod relaxed;
mod scaling;
mod search;
#[rustfmt::skip]
mod settings;
pub mod simplex;
mod sizes;
mod solver;
mod tangent;
mod violation;

pub use certificate::{BStationarity, CertSettings, Certificate, Certifier, Doubt, Local, Stationarity};
pub use conflict::Conflict;
pub use homotopy::Scholtes;
pub use lifted::{Boxed, Lifted, Member};
pub use parameters::{ParameterTangent, ParameterWeights};
pub use portfolio::FoundBy;
pub use problem::{Mpcc, Side};
pub use proposer::{ActiveSetProposer, NoProposals, ProposalKind};
pub use search::Distance;
pub use settings::MpccSettings;
pub use solver::{MpccSolver, Polish, Solution, Warm};
pub use tangent::{Adjoint, Change, Sides, Tangent};
