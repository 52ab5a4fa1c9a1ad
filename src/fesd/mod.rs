//! Finite elements with switch detection: a dynamic complementarity system over a horizon as an MPCC.
//!
//! The horizon has control stages, each of finite elements whose lengths are variables. Inside an element
//! the active set cannot change (cross complementarity, (7.7)), so switches fall on element boundaries and
//! the order of the Runge-Kutta method survives them; step equilibration (7.10) fixes the lengths where
//! nothing switches. The standard discretisation (fixed lengths, complementarity per stage point, (7.4)) is
//! there to compare with.
//!
//! Choices, see the thesis ch. 7 and docs/dev/algorithms/fesd.md:
//! - one pair per element and component, between the sums of `λ` and of `θ` over the element;
//! - `μ` at the element end needs no `θ` of its own (7.12): some `θ_{n,m,i} > 0` forces `λ_{n,end,i} = 0` and
//!   with `λ ≥ 0` that is `μ = min g`;
//! - the first element takes `λ_{0,0}` from variables tied to `x_0` (Remark 7.1 with `x_0` free);
//! - in the branch problem equilibration is the linear `h_n = h_{n−1}`, and the end of a sliding mode is
//!   `θ = 0` at the boundary, which the complementarity conditions alone leave open by `O(h)`.
//!
//! `layout` numbers variables and rows, `calls` says where the inputs of model functions come from, `problem` evaluates the
//! model, `adopt` starts from the solution of another method, `assemble` and `hessian` write rows and derivatives, `branch`
//! the bounds, `start` and `restart` starting points for an active set and behind a switch, `trajectory` reads solutions,
//! `inside` holds constraints between stage points, `places` says what numbers stand for, `outer` what acts on states from outside the dynamics. This layer does not know the solver.

mod adopt;
mod assemble;
mod branch;
mod calls;
mod clearance;
mod consistent;
mod eta;
mod hessian;
mod inside;
mod layout;
mod outer;
mod places;
mod problem;
mod restart;
pub(crate) mod size;
mod sizes;
mod start;
mod trajectory;

pub use branch::{Exit, Violation};
pub use clearance::{Clearance, Piece};
pub use inside::Inside;
pub use layout::{Boundary, Durations, Options, PathAt, PathConstraint, PathPairs, Spec, Terminal};
pub use outer::{Row, StatePoint};
pub use places::{Part, Place, Role, RowMeaning, Trouble, VariableMeaning};
pub use problem::Fesd;
pub use sizes::Sizes;
pub use trajectory::{Element, Switch, SwitchKind, Trajectory};
