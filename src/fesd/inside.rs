//! Path constraints at points inside of elements, between their stage points: at the collocation polynomial of the states.

use std::sync::Arc;

use super::layout::{ElementIndex, Layout, Spec};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;
use crate::system::SharedFunction;
use crate::tableau::Tableau;

/// A point inside of an element at which a path constraint holds as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inside {
    /// The path constraint.
    pub path: usize,
    /// The element, counted along the horizon.
    pub element: usize,
    /// Share of the element before the point, between 0 and 1.
    pub share: f64,
}

/// The values of a polynomial inside of an element as sums of states of the element.
pub(super) struct Nodes {
    /// First variables of the states.
    pub at: Vec<usize>,
    weights: Vec<f64>,
}

impl Nodes {
    /// The polynomial through the start of the element and its stage points, at a share of the element.
    pub fn new(e: &ElementIndex, tableau: &Tableau, share: f64) -> Nodes {
        // where the first stage point is the start that counts once
        let starts = tableau.c.first().is_some_and(|c| *c == 0.0);
        let start = (!starts).then_some((0.0, e.x_start));
        let all: Vec<(f64, usize)> =
            start.into_iter().chain(tableau.c.iter().copied().zip(e.x.iter().copied())).collect();
        let weight = |i: usize| {
            let others = all.iter().enumerate().filter(|(j, _)| *j != i);
            others.fold(1.0, |v, (_, n)| v * (share - n.0) / (all[i].0 - n.0))
        };
        Nodes { at: all.iter().map(|n| n.1).collect(), weights: (0..all.len()).map(weight).collect() }
    }

    /// A function of the states, controls, parameters and time there, as one of the states of all nodes.
    pub fn function(&self, f: &SharedFunction, spec: &Spec, l: &Layout) -> SharedFunction {
        let d = f.dims();
        let dims = Dims { x: self.at.len() * d.x, ..d };
        let state = |i: usize| self.weights.iter().enumerate().map(|(j, w)| (j * d.x + i, *w)).collect::<Vec<_>>();
        let own = |c: usize| vec![(dims.x + c - d.x, 1.0)];
        let control = |j: usize| l.linear.get(j).copied().flatten().map_or_else(|| own(d.x + j), state);
        let time = spec.dcs.clock().map_or_else(|| own(d.t_col()), state);
        let params = (0..d.p).map(|j| own(d.x + d.u + j));
        let terms = (0..d.x).map(state).chain((0..d.u).map(control)).chain(params).chain([time]).collect();
        Arc::new(Sums::new(f.clone(), dims, terms))
    }
}

/// A function whose inputs are sums of inputs.
struct Sums {
    f: SharedFunction,
    dims: Dims,
    /// What every input of the function is a sum of: columns and their weights.
    terms: Vec<Vec<(usize, f64)>>,
    jac: Pattern,
    hess: Pattern,
    /// Entries of the derivatives: where an entry of those of the function goes, and its factor.
    jac_map: Vec<(usize, usize, f64)>,
    hess_map: Vec<(usize, usize, f64)>,
}

impl Sums {
    fn new(f: SharedFunction, dims: Dims, terms: Vec<Vec<(usize, f64)>>) -> Sums {
        let (mut rows, mut cols, mut jac_map) = (Vec::new(), Vec::new(), Vec::new());
        let mut entry = 0;
        for (j, sum) in terms.iter().enumerate() {
            for &i in f.jac_pattern().rows(j) {
                for &(c, w) in sum {
                    rows.push(i);
                    cols.push(c);
                    jac_map.push((entry, 0, w));
                }
                entry += 1;
            }
        }
        let (jac, places) = Pattern::from_triplets(f.n_out(), dims.n_in(), &rows, &cols);
        jac_map.iter_mut().zip(places).for_each(|(m, p)| m.1 = p);
        let (mut rows, mut cols, mut hess_map) = (Vec::new(), Vec::new(), Vec::new());
        let mut entry = 0;
        for (j, sum) in terms.iter().enumerate() {
            for &i in f.hess_pattern().rows(j) {
                for &(a, v) in &terms[i] {
                    for &(b, w) in sum {
                        // of an entry of the diagonal the lower half is the upper one
                        if i == j && a > b {
                            continue;
                        }
                        // two different inputs that have a column in common: both halves fall on the diagonal
                        let twice = if i != j && a == b { 2.0 } else { 1.0 };
                        rows.push(a.min(b));
                        cols.push(a.max(b));
                        hess_map.push((entry, 0, twice * v * w));
                    }
                }
                entry += 1;
            }
        }
        let (hess, places) = Pattern::from_triplets(dims.n_in(), dims.n_in(), &rows, &cols);
        hess_map.iter_mut().zip(places).for_each(|(m, p)| m.1 = p);
        Sums { f, dims, terms, jac, hess, jac_map, hess_map }
    }

    fn inputs(&self, at: &Point, z: &mut [f64]) {
        let input = |c: usize| match c {
            c if c < self.dims.x => at.x[c],
            c if c < self.dims.x + self.dims.u => at.u[c - self.dims.x],
            c if c < self.dims.t_col() => at.p[c - self.dims.x - self.dims.u],
            _ => at.t,
        };
        z.iter_mut().zip(&self.terms).for_each(|(z, sum)| *z = sum.iter().map(|&(c, w)| w * input(c)).sum());
    }

    /// Calls `body` with the inputs of the function, a buffer for derivatives, and a workspace.
    fn with(
        &self,
        at: &Point,
        work: &mut [f64],
        body: impl FnOnce(&Point, &mut [f64], &mut [f64]) -> EvalResult,
    ) -> EvalResult {
        let d = self.f.dims();
        let (z, work) = work.split_at_mut(d.n_in());
        let (buffer, work) = work.split_at_mut(self.f.jac_pattern().nnz().max(self.f.hess_pattern().nnz()));
        self.inputs(at, z);
        let (x, u, p) = (&z[..d.x], &z[d.x..d.x + d.u], &z[d.x + d.u..d.t_col()]);
        body(&Point { t: z[d.t_col()], x, u, p }, buffer, work)
    }
}

impl Function for Sums {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.f.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        let derivatives = self.f.jac_pattern().nnz().max(self.f.hess_pattern().nnz());
        self.f.work_len() + derivatives + self.f.dims().n_in()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.with(at, work, |at, _, work| self.f.value(at, out, work))
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.with(at, work, |at, buffer, work| {
            let values = &mut buffer[..self.f.jac_pattern().nnz()];
            self.f.jacobian(at, values, work)?;
            out.fill(0.0);
            self.jac_map.iter().for_each(|&(from, to, w)| out[to] += w * values[from]);
            Ok(())
        })
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.with(at, work, |at, buffer, work| {
            let values = &mut buffer[..self.f.hess_pattern().nnz()];
            self.f.hessian(at, weights, values, work)?;
            out.fill(0.0);
            self.hess_map.iter().for_each(|&(from, to, w)| out[to] += w * values[from]);
            Ok(())
        })
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial()
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.f.jacobian_is_approximate()
    }
    fn hessian_is_approximate(&self) -> bool {
        self.f.hessian_is_approximate()
    }
}
