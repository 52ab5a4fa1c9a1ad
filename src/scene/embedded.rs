//! Functions of a few of the inputs of a system, in the place of functions of all of them.

use std::sync::{Arc, OnceLock};

use crate::error::{Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id, SavedGraph};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::system::SharedFunction;

/// A function of some states and parameters, as one of all of them whose other outputs are zero.
///
/// All places increase, so the entries of the Jacobian keep their order.
pub(super) struct Embedded {
    pub(super) name: String,
    pub(super) inner: SharedFunction,
    /// Sizes of all inputs.
    pub(super) dims: Dims,
    /// Number of all outputs.
    pub(super) n_out: usize,
    /// Where the states of the inner function stand among all.
    pub(super) x: Vec<u32>,
    /// The same of its parameters.
    pub(super) p: Vec<u32>,
    /// The same of its outputs.
    pub(super) out: Vec<u32>,
    pub(super) patterns: OnceLock<[Pattern; 2]>,
}

impl Embedded {
    /// Patterns of Jacobian and Hessian. They are as large as the system, and in time stepping nobody asks for them.
    fn patterns(&self) -> &[Pattern; 2] {
        self.patterns.get_or_init(|| {
            let (inner, own, n) = (self.inner.jac_pattern(), self.inner.dims(), self.dims.n_in());
            let column = |c: usize| match c {
                c if c < own.x => self.x[c] as usize,
                c if c < own.x + own.u => self.dims.x + (c - own.x),
                c if c < own.t_col() => self.dims.x + self.dims.u + self.p[c - own.x - own.u] as usize,
                _ => self.dims.t_col(),
            };
            let (mut rows, mut columns) = (Vec::with_capacity(inner.nnz()), Vec::with_capacity(inner.nnz()));
            for c in 0..inner.n_cols() {
                rows.extend(inner.rows(c).iter().map(|&r| self.out[r] as usize));
                columns.resize(rows.len(), column(c));
            }
            [Pattern::from_triplets(self.n_out, n, &rows, &columns).0, Pattern::from_triplets(n, n, &[], &[]).0]
        })
    }

    /// Calls `f` with the inner point, room for the inner outputs and the inner workspace.
    fn at<T>(&self, at: &Point, work: &mut [f64], f: impl FnOnce(&Point, &mut [f64], &mut [f64]) -> T) -> T {
        let (x, work) = work.split_at_mut(self.x.len());
        let (p, work) = work.split_at_mut(self.p.len());
        let (out, work) = work.split_at_mut(self.out.len());
        x.iter_mut().zip(&self.x).for_each(|(v, &i)| *v = at.x[i as usize]);
        p.iter_mut().zip(&self.p).for_each(|(v, &i)| *v = at.p[i as usize]);
        f(&Point { x, p, ..*at }, out, work)
    }
}

/// What a function of a few of the inputs in the place of one of all is made of: the function, and places of its states, parameters and
/// outputs, each increasing.
pub struct Embedding {
    /// The function of a few inputs; controls and time are those of all.
    pub f: SharedFunction,
    /// Places of its states among all.
    pub states: Vec<u32>,
    /// Places of its parameters.
    pub params: Vec<u32>,
    /// Places of its outputs; the others are zero.
    pub outputs: Vec<u32>,
}

impl Embedding {
    /// The function of inputs of these sizes, with so many outputs.
    ///
    /// # Errors
    /// [`Error::Dimension`] where the places are no places of what the function has.
    pub fn function(self, name: &str, dims: Dims, n_out: usize) -> Result<SharedFunction> {
        let own = self.f.dims();
        let fits = |places: &[u32], n: usize, of: usize| {
            places.len() == n && places.windows(2).all(|w| w[0] < w[1]) && places.iter().all(|&i| (i as usize) < of)
        };
        let all = fits(&self.states, own.x, dims.x) && fits(&self.params, own.p, dims.p);
        if !all || !fits(&self.outputs, self.f.n_out(), n_out) || own.u != dims.u {
            return Err(Error::Dimension(format!(
                "function '{name}' is one of a few inputs, and their places or those of its outputs do not fit"
            )));
        }
        let Embedding { f: inner, states: x, params: p, outputs: out } = self;
        Ok(Arc::new(Embedded { name: name.to_owned(), inner, dims, n_out, x, p, out, patterns: OnceLock::new() }))
    }
}

/// What a function is made of, where it is one of a few of its inputs.
pub fn embedding_of(f: &dyn Function) -> Option<Embedding> {
    let e = f.as_any()?.downcast_ref::<Embedded>()?;
    Some(Embedding { f: e.inner.clone(), states: e.x.clone(), params: e.p.clone(), outputs: e.out.clone() })
}

/// Expressions that a function computes; none where it is not made of them. Unlike the function itself they have second derivatives.
///
/// # Errors
/// Those of expressions that cannot be saved.
pub fn saved_expressions(f: &dyn Function) -> Option<Result<SavedGraph>> {
    let known = f.as_any()?;
    match known.downcast_ref::<ExprFunction>() {
        Some(e) => Some(e.source().cloned()),
        None => known.downcast_ref::<Embedded>()?.expressions(),
    }
}

/// The outputs of a function as expressions of a graph, see [`saved_expressions`].
///
/// # Errors
/// Those of expressions that cannot be saved, or restored.
pub fn expressions_of(dag: &mut Dag, f: &dyn Function) -> Option<Result<Vec<Id>>> {
    Some(saved_expressions(f)?.and_then(|source| source.restore(dag, &[])))
}

impl Embedded {
    fn expressions(&self) -> Option<Result<SavedGraph>> {
        let number = |block: Block, i: usize| match block {
            Block::X => self.x[i] as usize,
            Block::P => self.p[i] as usize,
            _ => i,
        };
        let widened = |inner: SavedGraph| inner.renumbered(&number).scattered(self.n_out, &self.out);
        Some(saved_expressions(self.inner.as_ref())?.map(widened))
    }
}

impl Function for Embedded {
    fn name(&self) -> &str {
        &self.name
    }

    fn dims(&self) -> Dims {
        self.dims
    }

    fn n_out(&self) -> usize {
        self.n_out
    }

    fn jac_pattern(&self) -> &Pattern {
        &self.patterns()[0]
    }

    fn hess_pattern(&self) -> &Pattern {
        &self.patterns()[1]
    }

    fn work_len(&self) -> usize {
        self.x.len() + self.p.len() + self.out.len() + self.inner.work_len()
    }

    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, work, |there, own, work| {
            self.inner.value(there, own, work)?;
            out[..self.n_out].fill(0.0);
            own.iter().zip(&self.out).for_each(|(v, &i)| out[i as usize] = *v);
            Ok(())
        })
    }

    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.at(at, work, |there, _, work| self.inner.jacobian(there, out, work))
    }

    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        // there are none: the functions of contacts are differentiated once
        self.at(at, work, |there, _, work| self.inner.hessian(there, weights, out, work))
    }

    fn as_any(&self) -> Option<&dyn std::any::Any> {
        Some(self)
    }

    fn is_serial(&self) -> bool {
        self.inner.is_serial()
    }

    fn jacobian_is_approximate(&self) -> bool {
        self.inner.jacobian_is_approximate()
    }

    fn hessian_is_approximate(&self) -> bool {
        self.inner.hessian_is_approximate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Graph;

    #[test]
    fn places_of_values_and_derivatives() {
        let g = Graph::new();
        let (x, y, p, q, t) = (g.x(0), g.x(1), g.p(0), g.p(1), g.t());
        let small = g.function("small", Dims { x: 2, u: 1, p: 2 }, &[x * y, p * y + q * g.u(0) + t * t]).unwrap();
        let (a, b) = (g.x(1), g.x(4));
        let all = Dims { x: 5, u: 1, p: 3 };
        let zero = g.constant(0.0);
        let large = g.function("large", all, &[zero, a * b, zero, g.p(0) * b + g.p(2) * g.u(0) + t * t, zero]).unwrap();
        let e = Embedded {
            name: "large".into(),
            inner: Arc::new(small),
            dims: all,
            n_out: 5,
            x: vec![1, 4],
            p: vec![0, 2],
            out: vec![1, 3],
            patterns: OnceLock::new(),
        };
        assert_eq!(e.jac_pattern(), large.jac_pattern());
        let at = Point { t: 0.3, x: &[9.0, 2.0, 9.0, 9.0, 3.0], u: &[0.5], p: &[0.7, 9.0, 1.1] };
        let (mut u, mut v) = ([7.0; 5], [7.0; 5]);
        let mut work = vec![0.0; e.work_len().max(large.work_len())];
        e.value(&at, &mut u, &mut work).unwrap();
        large.value(&at, &mut v, &mut work).unwrap();
        assert_eq!(u, v);
        let n = e.jac_pattern().nnz();
        let (mut j, mut k) = (vec![0.0; n], vec![0.0; n]);
        e.jacobian(&at, &mut j, &mut work).unwrap();
        large.jacobian(&at, &mut k, &mut work).unwrap();
        assert_eq!(j, k);
        // as expressions it is the same function, with the second derivatives that it has not
        let mut dag = Dag::new();
        let outputs = e.expressions().unwrap().and_then(|s| s.restore(&mut dag, &[])).unwrap();
        let whole = ExprFunction::new("whole", &mut dag, all, &outputs).unwrap();
        assert_eq!((whole.jac_pattern(), whole.hess_pattern()), (large.jac_pattern(), large.hess_pattern()));
        let mut work = vec![0.0; whole.work_len().max(large.work_len())];
        whole.value(&at, &mut u, &mut work).unwrap();
        assert_eq!(u, v);
        let n = whole.hess_pattern().nnz();
        let (mut h, mut g) = (vec![0.0; n], vec![0.0; n]);
        whole.hessian(&at, &[1.0, 2.0, 3.0, 4.0, 5.0], &mut h, &mut work).unwrap();
        large.hessian(&at, &[1.0, 2.0, 3.0, 4.0, 5.0], &mut g, &mut work).unwrap();
        assert!(n > 0 && h == g, "{h:?} {g:?}");
    }
}
