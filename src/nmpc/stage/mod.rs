//! From one node of the horizon to the next: `x_{k+1} = ψ_k(x_k, u_k)` with derivatives, all stages at once.

mod chain;
mod events;
mod explicit;
mod implicit;
mod memory;
mod sensitivity;
#[cfg(test)]
mod tests;

pub(super) use chain::Chain;
pub(super) use events::EventStage;
pub(super) use explicit::ExplicitRk;
pub(super) use implicit::ImplicitRk;

use crate::func::EvalResult;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// Where the stages start: node by node `x[n · nx]`, `u[n · nu]`, `p[n · np]`, times and lengths of the stages `[n]`.
#[derive(Clone, Copy)]
pub(super) struct Starts<'a> {
    pub x: &'a [f64],
    pub u: &'a [f64],
    pub p: &'a [f64],
    pub t: &'a [f64],
    pub h: &'a [f64],
}

/// Evaluations of model functions, each for all stages at once.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Evaluations {
    /// Values of right-hand sides, costs and constraints.
    pub values: u64,
    /// Their Jacobians for forward derivatives.
    pub jacobians: u64,
    /// Adjoint sweeps.
    pub adjoints: u64,
    /// Hessians.
    pub hessians: u64,
}

/// A discretisation of the dynamics. Nothing is allocated after it was made, but by [`EventStage`] at contacts and transitions. Results are those of a failed evaluation's
/// function; outputs are then undefined.
pub(super) trait Stage: Send {
    /// `ψ_k`, `next[n · nx]`.
    fn values(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult;
    /// `ψ_k` and its derivatives `a[n · nx · nx]`, `b[n · nx · nu]`, column-major. With `lambda[n · nx]` also the second derivatives
    /// of `λ_kᵀ ψ_k`: lower triangles of `(nx + nu)²` for every stage, column-major, added to `hess`.
    fn linearise(
        &mut self,
        at: &Starts,
        next: &mut [f64],
        a: &mut [f64],
        b: &mut [f64],
        second: Option<(&[f64], &mut [f64])>,
    ) -> EvalResult;
    /// `ψ_k`, and `(∂ψ_k/∂x)ᵀ λ_k`, `(∂ψ_k/∂u)ᵀ λ_k` by one reverse sweep: `gx[n · nx]`, `gu[n · nu]`.
    fn adjoint(&mut self, at: &Starts, lambda: &[f64], next: &mut [f64], gx: &mut [f64], gu: &mut [f64]) -> EvalResult;
    /// Function, steps in a stage and tableau, where the method is an explicit one.
    fn explicit(&self) -> Option<(&SharedFunction, usize, &Tableau)> {
        None
    }
    /// Evaluations so far.
    fn evaluations(&self) -> Evaluations;
    /// Why the last call had no value, in words, where that is known.
    fn failure(&self) -> Option<&str> {
        None
    }
    /// Where control `j` moved nothing in the last stage of the last [`Stage::linearise`], since the system sticks: the values, below
    /// and above, at which it begins to.
    fn break_away(&self, _j: usize) -> Option<[f64; 2]> {
        None
    }
}
