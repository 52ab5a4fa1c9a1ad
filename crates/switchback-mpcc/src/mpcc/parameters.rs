//! Derivatives of a solution with respect to the parameters of its functions, forwards and as an adjoint.

use super::lifted::Lifted;
use super::solver::MpccSolver;
use super::tangent::{Change, Sides, Tangent};
use crate::error::{finite, Error, Result};
use crate::func::EvalError;
use crate::nlp::{Bounds, CallbackNlp, Nlp, ParameterChange};
use crate::stop;

/// How a solution follows one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterTangent {
    /// Derivative of the point, in the variables of the program `[n]`; NaN where it is not known.
    pub x: Vec<f64>,
    /// Derivative of the objective; NaN likewise.
    pub objective: f64,
    /// On which sides of the parameter they hold; none where they are not known.
    pub sides: Sides,
}

/// Weights of the parameters from weights of point and objective: a product of their derivative with these from the left.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterWeights {
    /// Of every parameter `[np]`; NaN where the derivative is not known.
    pub p: Vec<f64>,
    /// On which sides of every parameter they hold.
    pub sides: Vec<Sides>,
}

impl MpccSolver {
    /// Derivatives of the last solution with respect to all parameters, the active set held. The problem, its parameters and
    /// `bounds` must be those of that solve, and its result exact. A solve with the factorised matrix for every parameter.
    ///
    /// # Errors
    /// As [`MpccSolver::tangents`]; [`Error::NonFinite`] where the functions have no derivatives, [`Error::Numeric`] where those by
    /// parameters that were given are not those of the functions.
    pub fn parameter_tangents(
        &mut self,
        p: &mut Lifted<CallbackNlp>,
        bounds: &Bounds,
    ) -> Result<Vec<ParameterTangent>> {
        let (changes, explicit) = self.parameter_changes(p)?;
        let found = if changes.is_empty() { Vec::new() } else { self.tangents_of(p, bounds, &changes, true)? };
        let zero = p.point(&vec![0.0; p.n()]);
        let to_own = |(t, explicit): (Tangent, &f64)| {
            let known = t.sides != Sides::Neither;
            // the map from variables of the solver to those of the program is affine
            let moved = p.point(&t.x);
            let x = moved.iter().zip(&zero).map(|(x, o)| if known { x - o } else { f64::NAN }).collect();
            ParameterTangent { x, objective: if known { t.objective + explicit } else { f64::NAN }, sides: t.sides }
        };
        Ok(found.into_iter().zip(&explicit).map(to_own).collect())
    }

    /// The weights of all parameters for a weight `x` of the point, in the variables of the program `[n]`, and `objective` of the objective.
    /// One solve for all parameters where the solution is differentiable; where it is not, one for each.
    ///
    /// # Errors
    /// As [`MpccSolver::parameter_tangents`]; [`Error::Dimension`] if `x` has another size.
    pub fn parameter_vjp(
        &mut self,
        p: &mut Lifted<CallbackNlp>,
        bounds: &Bounds,
        x: &[f64],
        objective: f64,
    ) -> Result<ParameterWeights> {
        finite("weight of the point", x, p.inner().n())?;
        finite("weight of the objective", &[objective], 1)?;
        let (changes, explicit) = self.parameter_changes(p)?;
        let weights = [p.weight(x)];
        if let Some(adjoint) = self.adjoints(p, bounds, &weights)?.and_then(|mut all| all.pop()) {
            let y = self.solution().y.clone();
            let sum = |list: &[(usize, f64)], with: &[f64]| list.iter().map(|(i, v)| v * with[*i]).sum::<f64>();
            let one = |(c, explicit): (&Change, &f64)| {
                let of_point = sum(&c.gradient, &adjoint.gradient) + sum(&c.rows, &adjoint.rows);
                of_point + objective * (explicit + sum(&c.rows, &y))
            };
            let p = changes.iter().zip(&explicit).map(one).collect();
            return Ok(ParameterWeights { p, sides: vec![Sides::Both; changes.len()] });
        }
        let found = self.parameter_tangents(p, bounds)?;
        let one = |t: &ParameterTangent| {
            let of_point: f64 = t.x.iter().zip(x).filter(|(_, w)| **w != 0.0).map(|(t, w)| t * w).sum();
            let of_objective = if objective == 0.0 { 0.0 } else { objective * t.objective };
            of_point + of_objective
        };
        Ok(ParameterWeights { p: found.iter().map(one).collect(), sides: found.iter().map(|t| t.sides).collect() })
    }

    /// What the parameters do to the conditions of the last solution while its variables are held, and to its objective.
    fn parameter_changes(&self, p: &mut Lifted<CallbackNlp>) -> Result<(Vec<Change>, Vec<f64>)> {
        let s = self.solution();
        let (x, m) = (p.point(&s.x), p.inner().m());
        let found = p.inner().parameter_changes(&x, &s.y[..m]).map_err(no_value)?;
        if !p.inner().parameters_agree(&x, &s.y[..m], &found).map_err(no_value)? {
            return Err(Error::Numeric(
                "the derivatives by the parameters that were given are not those of the functions: give the columns of the \
                 parameters in Jacobians and Hessians, and in their patterns"
                    .into(),
            ));
        }
        let explicit = found.iter().map(|c| c.objective).collect();
        let to_change = |c: ParameterChange| {
            let gradient = c.gradient.into_iter().map(|(j, v)| (j, p.factor(j) * v)).collect();
            Change { fixed: Vec::new(), gradient, rows: c.rows }
        };
        Ok((found.into_iter().map(to_change).collect(), explicit))
    }
}

fn no_value(e: EvalError) -> Error {
    if e == EvalError::Stopped {
        return stop::error();
    }
    Error::NonFinite(format!(
        "a function has no derivatives at the solution, or no value at parameters next to it ({e:?})"
    ))
}
