//! Expressions that switch, as functions of the inputs and of which switching functions are positive.
//!
//! A switching function `ψ_s` counts as `w_s = 1` where it is positive and `w_s = 0` where it is negative, and a choice between `a`
//! and `b` under a condition `c` is `c a + (1 − c) b`, with products and complements for the conditions. Signs are inputs then, and
//! one program evaluates every mode and its derivatives: a network of `2 n` rectifiers has `2^(2n)` sign patterns, none of which has to
//! be formed before it is needed.

use super::dag::{Block, Dag, Id};
use super::function::{all_inputs, in_function};
use super::tape::Tape;
use crate::error::{Error, Result};
use crate::func::trouble::{self, Complaint};
use crate::func::{Dims, EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;

/// Expressions with exact first derivatives for given signs of the switching functions.
#[derive(Clone)]
pub struct SignedFunction {
    name: String,
    dims: Dims,
    n_signs: usize,
    value: Tape,
    jacobian: Tape,
    jac_pattern: Pattern,
    affine: bool,
}

impl SignedFunction {
    /// The function `outputs` of inputs of these sizes under given signs of the switching functions `switches`, which are all that it
    /// depends on. Derivatives are nodes of the graph too, so it grows.
    ///
    /// # Errors
    /// As [`Tape::new`] and [`Dag::jacobian`].
    pub fn new(name: &str, dag: &mut Dag, dims: Dims, switches: &[usize], outputs: &[Id]) -> Result<SignedFunction> {
        let named = |e: Error| in_function(name, e);
        let outputs = dag.with_signs(outputs, switches);
        let wrt = all_inputs(dag, dims);
        let entries = dag.jacobian(&outputs, &wrt).map_err(named)?;
        let ids: Vec<Id> = entries.iter().map(|e| e.value).collect();
        let (rows, cols): (Vec<usize>, Vec<usize>) = entries.iter().map(|e| (e.row, e.col)).unzip();
        let constant = |id: &Id| !dag.reachable(&[*id]).iter().any(|i| dag.is_input_of(*i, |b| b != Block::Weight));
        Ok(SignedFunction {
            name: name.to_owned(),
            dims,
            n_signs: switches.len(),
            value: Tape::new(dag, dims, switches.len(), &outputs).map_err(named)?,
            jacobian: Tape::new(dag, dims, switches.len(), &ids).map_err(named)?,
            jac_pattern: Pattern::from_triplets(outputs.len(), dims.n_in(), &rows, &cols).0,
            affine: ids.iter().all(constant),
        })
    }

    /// Name used in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Input blocks.
    pub fn dims(&self) -> Dims {
        self.dims
    }

    /// Number of switching functions.
    pub fn n_signs(&self) -> usize {
        self.n_signs
    }

    /// Length of the value.
    pub fn n_out(&self) -> usize {
        self.value.n_out()
    }

    /// Pattern of the Jacobian whatever the signs, `n_out × n_in`.
    pub fn jac_pattern(&self) -> &Pattern {
        &self.jac_pattern
    }

    /// True where the derivatives are constant as long as the signs are.
    pub fn is_affine(&self) -> bool {
        self.affine
    }

    /// Length of the workspace.
    pub fn work_len(&self) -> usize {
        self.value.work_len().max(self.jacobian.work_len())
    }

    /// True where it may only be called by one thread.
    pub fn is_serial(&self) -> bool {
        self.value.functions().any(|f| f.is_serial())
    }

    /// Value, `out[n_out]`, with 1 for every switching function that counts as positive and 0 for the others, `signs[n_signs]`.
    pub fn value(&self, at: &Point, signs: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let out = &mut out[..self.value.n_out()];
        let r = self.value.run(at, signs, out, work);
        self.checked("value", at, r, out)
    }

    /// Jacobian, `out[jac_pattern().nnz()]` in the order of its columns.
    pub fn jacobian(&self, at: &Point, signs: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let r = self.jacobian.run(at, signs, &mut out[..self.jacobian.n_out()], work);
        self.checked("Jacobian", at, r, &[])
    }

    /// Notes a complaint where the function is not defined at the point.
    fn checked(&self, part: &'static str, at: &Point, r: EvalResult, values: &[f64]) -> EvalResult {
        if r == Err(EvalError::Recoverable) {
            let bad = values.iter().position(|v| !v.is_finite()).map(|i| (i, values[i]));
            let place = trouble::place(at, bad);
            trouble::note(Complaint { function: self.name.as_str().into(), part, code: 0, place, timeless: false });
        }
        r
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `max(x, 0) + |max(x, 0) - y|` in its four modes, with derivatives.
    #[test]
    fn signs_are_inputs() {
        let mut d = Dag::new();
        let (x, y, zero) = (d.input(Block::X, 0), d.input(Block::X, 1), d.constant(0.0));
        let a = d.max(x, zero);
        let inner = d.sub(a, y);
        let b = d.abs(inner);
        let e = d.add(a, b);
        let dims = Dims { x: 2, u: 0, p: 0 };
        let all = d.switches_of(&[e]);
        let f = SignedFunction::new("f", &mut d, dims, &all, &[e]).unwrap();
        assert_eq!((f.n_signs(), f.is_affine(), f.jac_pattern().nnz()), (2, true, 2));
        let (mut out, mut jac, mut work) = ([0.0], [0.0; 2], vec![0.0; f.work_len()]);
        let at = Point { t: 0.0, x: &[3.0, 5.0], u: &[], p: &[] };
        for (signs, value, gradient) in [
            ([0.0, 0.0], 5.0, [0.0, 1.0]),
            ([0.0, 1.0], -5.0, [0.0, -1.0]),
            ([1.0, 0.0], 5.0, [0.0, 1.0]),
            ([1.0, 1.0], 1.0, [2.0, -1.0]),
        ] {
            f.value(&at, &signs, &mut out, &mut work).unwrap();
            f.jacobian(&at, &signs, &mut jac, &mut work).unwrap();
            assert_eq!((out, jac), ([value], gradient), "{signs:?}");
        }
        // conditions made of others
        let (p, q) = (d.positive(x), d.positive(y));
        let not = d.not(q);
        let (both, one) = (d.and(p, not), d.constant(1.0));
        let e = d.select(both, one, zero);
        let either = d.or(p, q);
        let g = d.select(either, one, zero);
        let all = d.switches_of(&[e, g]);
        let f = SignedFunction::new("f", &mut d, dims, &all, &[e, g]).unwrap();
        let mut out = [0.0; 2];
        for (signs, values) in
            [([0.0, 0.0], [0.0, 0.0]), ([0.0, 1.0], [0.0, 1.0]), ([1.0, 0.0], [1.0, 1.0]), ([1.0, 1.0], [0.0, 1.0])]
        {
            f.value(&at, &signs, &mut out, &mut vec![0.0; f.work_len()]).unwrap();
            assert_eq!(out, values, "{signs:?}");
        }
    }
}
