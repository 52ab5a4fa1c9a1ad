//! Right-hand sides with so many sign patterns that their modes are formed where they are needed.
//!
//! A network of rectifiers with two layers of 64 has `2^128` sign patterns, of which a trajectory meets a few dozen. Such a system is
//!
//! ```text
//! ẋ = f(x, w, u, p, t),   w_j = 1 where ψ_j(x, w, u, p, t) > 0,   w_j = 0 where it is negative
//! ```
//!
//! where `ψ_j` depends on the signs of the functions before it only. Event-driven simulation evaluates both under the present signs.
//! What needs all modes beforehand, as programs of optimal control do, refuses such a system.

use std::sync::Arc;

use super::System;
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Point};
use crate::linalg::csc::Pattern;

/// A function of the usual inputs and of which switching functions are positive.
pub trait Signed: Send + Sync {
    /// Input blocks.
    fn dims(&self) -> Dims;
    /// Length of the value.
    fn n_out(&self) -> usize;
    /// Pattern of the Jacobian with respect to the inputs, whatever the signs.
    fn jac_pattern(&self) -> &Pattern;
    /// True where the Jacobian is constant as long as the signs are.
    fn is_affine(&self) -> bool;
    /// Length of the workspace.
    fn work_len(&self) -> usize;
    /// Value, `out[n_out]`; `signs` holds 1 for every switching function that counts as positive, 0 for the others.
    fn value(&self, at: &Point, signs: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult;
    /// Entries of the Jacobian in the order of its columns.
    fn jacobian(&self, at: &Point, signs: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult;
    /// True where it may be called by one thread only.
    fn is_serial(&self) -> bool;
}

/// A right-hand side whose modes are formed on demand.
#[derive(Clone)]
pub struct OnDemand {
    /// Derivatives of all states.
    pub rhs: Arc<dyn Signed>,
    /// The switching functions `ψ`.
    pub psi: Arc<dyn Signed>,
    /// For every switching function the functions before it whose signs it depends on, ascending.
    pub upstream: Vec<Vec<usize>>,
}

impl System {
    /// The right-hand side whose modes are formed on demand, where it is one.
    pub fn on_demand(&self) -> Option<&Arc<OnDemand>> {
        self.on_demand.as_ref()
    }

    /// Makes `d` the whole right-hand side. Transitions may be added; nothing else drives the states then.
    ///
    /// # Errors
    /// [`Error::State`] where the system has dynamics already, [`Error::Dimension`] for sizes that do not fit, [`Error::Range`] where a
    /// switching function depends on the sign of one that does not come before it.
    pub fn set_on_demand(&mut self, d: OnDemand) -> Result<()> {
        let empty = self.f0.is_none() && self.subsystems.is_empty() && self.inclusions.is_empty();
        if !empty || self.n_z > 0 || self.mechanics.is_some() {
            return Err(Error::State("a right-hand side with modes on demand is the only one of its system".into()));
        }
        let n = d.psi.n_out();
        if d.rhs.dims() != self.dims
            || d.psi.dims() != self.dims
            || d.rhs.n_out() != self.dims.x
            || d.upstream.len() != n
        {
            return Err(Error::Dimension(
                "right-hand side and switching functions take the inputs of the system, and the first has an output for every state"
                    .into(),
            ));
        }
        if let Some(j) = (0..n).find(|&j| d.upstream[j].iter().any(|&i| i >= j)) {
            return Err(Error::Range(format!(
                "switching function {j} depends on signs that do not come before its own"
            )));
        }
        self.on_demand = Some(Arc::new(d));
        Ok(())
    }

    /// An error where modes are formed on demand, for those who need all of them.
    pub fn check_modes_known(&self) -> Result<()> {
        match &self.on_demand {
            None => Ok(()),
            Some(d) => Err(Error::Unsupported(format!(
                "the model has {} coupled switching functions, too many to form a mode for every sign pattern: its modes are formed on \
                 demand in event-driven simulation, and nothing else can do without all of them. Write the model as a sum of terms that \
                 switch separately, with fewer choices inside of choices, or with smooth functions in their place",
                d.psi.n_out()
            ))),
        }
    }
}
