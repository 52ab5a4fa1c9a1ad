//! Quadratic programs with the structure of control stages.
//!
//! ```text
//! min  Σ_{k<N} ½ [x_k; u_k]ᵀ [Q_k S_kᵀ; S_k R_k] [x_k; u_k] + q_kᵀ x_k + r_kᵀ u_k  +  ½ x_Nᵀ Q_N x_N + q_Nᵀ x_N  +  prices
//! s.t. x_0 given or priced,  x_{k+1} = A_k x_k + B_k u_k + c_k,   l_k ≤ u_k ≤ u_k^max,
//!      l_i ≤ C_i x_k + D_i u_k ≤ u_i   for rows i at nodes k, some of which may be violated at a price
//! ```
//!
//! These are the quadratic programs (10.5) of real-time iterations. They are solved in two parts: [`QpSolver::prepare`] does
//! what does not depend on `x_0`, [`QpSolver::solve`] the rest, in microseconds. [`Condensing`] eliminates the states, [`Stagewise`] keeps them. Solvers allocate when they are made and
//! never again. This layer knows nothing of where the data come from.

mod condense;
mod dual;
mod flops;
mod riccati;
mod stage;
mod stagewise;

#[cfg(test)]
mod conformance;

pub use condense::Condensing;
pub use flops::is_long;
pub use stage::{Initial, Price, QpSolution, Row, StageQp};
pub use stagewise::Stagewise;

use std::time::Instant;

/// How the solution of a quadratic program ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum QpStatus {
    /// Solved.
    Solved = 0,
    /// Rows that may not be violated contradict each other.
    Infeasible = 1,
    /// The deadline or a bound on iterations came first; the control that is there is the best known, within its bounds.
    OutOfTime = 2,
    /// The Hessian is not positive definite on the controls, or data are not finite.
    Failed = 3,
}

/// Until when a solution may take, and how rows are treated that cannot be met.
#[derive(Debug, Clone, Copy, Default)]
pub struct Terms {
    /// Asked in every iteration.
    pub deadline: Option<Instant>,
    /// Iterations at most, of which there is one at least: the bound on the work of a solution.
    pub most: Option<usize>,
    /// All rows may be violated, at this price per unit: the program then always has a solution.
    pub elastic: Option<f64>,
    /// Methods that change one constraint at a time fail where they would loosen their tolerance: for those who ask for prices next.
    pub brief: bool,
}

impl Terms {
    /// Is the time over, or the work, after so many iterations?
    pub(crate) fn over(&self, iterations: usize) -> bool {
        self.most.is_some_and(|m| iterations >= m.max(1)) || self.deadline.is_some_and(|d| Instant::now() >= d)
    }
}

/// A method for these programs.
pub trait QpSolver: Send {
    /// Name for reports.
    fn name(&self) -> &'static str;
    /// Everything that does not depend on the initial state; the active set of the last solution is the guess for the next.
    /// False where the program is not convex on the controls or data are not finite: there is nothing prepared then.
    fn prepare(&mut self, qp: &StageQp) -> bool;
    /// As [`QpSolver::prepare`] where vectors of the program (gradients, `c_k`, bounds) have changed since and matrices have not.
    fn refresh(&mut self, qp: &StageQp);
    /// Solves for an initial state `x0[nx]`, or its mean before the first measurement where it is free ([`Initial::Free`]).
    fn solve(&mut self, qp: &StageQp, x0: &[f64], terms: &Terms) -> QpStatus;
    /// Controls of the last [`QpSolver::solve`], `[n · nu]`; those of the first stage lead.
    fn controls(&self) -> &[f64];
    /// States and multipliers of the last [`QpSolver::solve`].
    fn expand(&mut self, qp: &StageQp, out: &mut QpSolution);
    /// Controls for `x0` without regard of constraints: what is there before anything is solved.
    fn tangent(&mut self, qp: &StageQp, x0: &[f64]) -> &[f64];
    /// Feedback gains without constraints: `K_k`, `nu × nx` column-major for every stage, `[n · nu · nx]`, so that the solution of the program
    /// that begins at node `k` moves by `u_k = K_k x_k`. False where nothing is prepared.
    fn gains(&self, out: &mut [f64]) -> bool;
    /// What it costs to meet rows without a price one by one, per unit of violation, of those that the last [`QpSolver::solve`] met with: the
    /// scale of prices. Zero where controls move none of them.
    fn cost_of_rows(&mut self, qp: &StageQp) -> f64;
    /// Does the last solution violate rows that have no price of their own?
    fn violates(&self, qp: &StageQp) -> bool;
    /// Iterations of the last solution.
    fn iterations(&self) -> usize;
    /// Moves the guess of the active set by one stage towards the start.
    fn shift(&mut self, qp: &StageQp);
    /// Forgets the guess of the active set.
    fn reset(&mut self);
}
