//! Functions that are linear in their inputs.

use std::sync::Arc;

use super::SharedFunction;
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// Input column `c` at a point.
pub(crate) fn input(at: &Point, c: usize) -> f64 {
    let (nx, nu, np) = (at.x.len(), at.u.len(), at.p.len());
    match c {
        c if c < nx => at.x[c],
        c if c < nx + nu => at.u[c - nx],
        c if c < nx + nu + np => at.p[c - nx - nu],
        _ => at.t,
    }
}

/// Linear combinations of inputs: for every output the columns and their factors.
pub(crate) fn combination(name: &str, dims: Dims, rows: Vec<Vec<(usize, f64)>>) -> SharedFunction {
    let entries = || rows.iter().enumerate().flat_map(|(i, row)| row.iter().map(move |&(c, v)| (i, c, v)));
    let (r, c): (Vec<usize>, Vec<usize>) = entries().map(|e| (e.0, e.1)).unzip();
    let (jac, map) = Pattern::from_triplets(rows.len(), dims.n_in(), &r, &c);
    let mut values = vec![0.0; jac.nnz()];
    entries().zip(map).for_each(|(e, k)| values[k] += e.2);
    Arc::new(Linear { name: name.to_owned(), dims, rows, hess: Pattern::empty(dims.n_in(), dims.n_in()), jac, values })
}

/// States themselves, as outputs.
pub(super) fn states(name: &str, dims: Dims, states: &[usize]) -> SharedFunction {
    combination(name, dims, states.iter().map(|&i| vec![(i, 1.0)]).collect())
}

/// What [`combination`] makes.
pub(crate) struct Linear {
    name: String,
    dims: Dims,
    /// Of every output the columns and their factors.
    pub(crate) rows: Vec<Vec<(usize, f64)>>,
    jac: Pattern,
    values: Vec<f64>,
    hess: Pattern,
}

impl Function for Linear {
    fn name(&self) -> &str {
        &self.name
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.rows.len()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn as_any(&self) -> Option<&dyn std::any::Any> {
        Some(self)
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        for (o, row) in out.iter_mut().zip(&self.rows) {
            *o = row.iter().map(|&(c, v)| v * input(at, c)).sum();
        }
        Ok(())
    }
    fn jacobian(&self, _: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.copy_from_slice(&self.values);
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}
