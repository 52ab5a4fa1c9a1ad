//! Model functions at the points of the grid, and where each of their inputs comes from.

use super::layout::{Layout, Spec};
use crate::system::SharedFunction;

/// A function at a point of the grid, and where its values lie in the cache.
#[derive(Debug, Clone, Copy)]
pub(super) struct Call {
    pub(super) f: usize,
    /// Where its inputs begin in [`Fesd::inputs`].
    pub(super) inputs: usize,
    pub(super) val: usize,
    pub(super) jac: usize,
    pub(super) hess: usize,
    /// Weights of the Hessian.
    pub(super) wgt: usize,
}

/// Collects functions, points and calls.
pub(super) struct Builder<'a> {
    spec: &'a Spec,
    l: &'a Layout,
    pub(super) functions: Vec<SharedFunction>,
    pub(super) calls: Vec<Call>,
    pub(super) inputs: Vec<u32>,
    /// Lengths of values, Jacobians, Hessians, weights.
    pub(super) sizes: [usize; 4],
}

impl<'a> Builder<'a> {
    pub(super) fn new(spec: &'a Spec, l: &'a Layout) -> Builder<'a> {
        Builder { spec, l, functions: Vec::new(), calls: Vec::new(), inputs: Vec::new(), sizes: [0; 4] }
    }

    /// The inputs of functions where the states begin at variable `x`, in a stage.
    pub(super) fn point(&mut self, x: usize, stage: usize) -> usize {
        let at = self.inputs.len();
        self.states(x);
        self.others(x, stage);
        at
    }

    /// The inputs of functions that see more variables behind the states.
    pub(super) fn point_with(&mut self, x: usize, more: impl Iterator<Item = usize>, stage: usize) -> usize {
        let at = self.inputs.len();
        self.states(x);
        self.inputs.extend(more.map(|j| j as u32));
        self.others(x, stage);
        at
    }

    /// The inputs of functions of the states of several points of an element.
    pub(super) fn points(&mut self, points: &[usize], stage: usize) -> usize {
        let at = self.inputs.len();
        points.iter().for_each(|&x| self.states(x));
        self.others(points[0], stage);
        at
    }

    /// The inputs of functions of both ends.
    pub(super) fn ends(&mut self, x0: usize, x: usize, stage: usize) -> usize {
        let at = self.inputs.len();
        self.states(x0);
        self.states(x);
        self.others(x, stage);
        at
    }

    fn states(&mut self, x: usize) {
        let nx = self.spec.dcs.dims().x;
        self.inputs.extend((x..x + nx).map(|j| j as u32));
    }

    fn others(&mut self, x: usize, stage: usize) {
        let (l, np) = (self.l, self.spec.dcs.dims().p);
        let constant = |k: usize| l.n + k;
        let u = l.linear.iter().enumerate().map(|(j, r)| r.map_or(l.u[stage] + j, |r| x + r));
        let p = l.params.iter().enumerate().map(|(j, v)| v.unwrap_or(constant(stage * np + j)));
        let t = self.spec.dcs.clock().map_or(constant(self.spec.n_stages() * np), |k| x + k);
        self.inputs.extend(u.chain(p).chain([t]).map(|j| j as u32));
    }

    pub(super) fn call(&mut self, f: &SharedFunction, inputs: usize) -> Call {
        let index = self.functions.iter().position(|g| std::sync::Arc::ptr_eq(f, g)).unwrap_or_else(|| {
            self.functions.push(f.clone());
            self.functions.len() - 1
        });
        let [val, jac, hess, wgt] = self.sizes;
        let c = Call { f: index, inputs, val, jac, hess, wgt };
        let add = [f.n_out(), f.jac_pattern().nnz(), f.hess_pattern().nnz(), f.n_out()];
        for (s, a) in self.sizes.iter_mut().zip(add) {
            *s += a;
        }
        self.calls.push(c);
        c
    }
}
