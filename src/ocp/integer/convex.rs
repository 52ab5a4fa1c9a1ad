//! Is a problem convex once its choices may be anywhere between their values? Then what such a problem costs bounds the cost of every sequence between
//! these values from below.

use nalgebra::DMatrix;

use crate::func::{Function, Point};
use crate::ocp::{Durations, Ocp};
use crate::system::SharedFunction;

/// Multiple of the rounding of the largest curvature by which one may be negative.
const ROUNDING: f64 = 10.0;

impl Ocp {
    /// Is the discretised problem convex, choices relaxed, whatever their values? False where that is not known: of functions that are no
    /// expressions, and of costs whose curvature depends on states, controls or the time.
    pub(super) fn relaxes_to_convex(&self) -> bool {
        let s = &self.system;
        let fixed = self.time == Durations::Fixed && self.complementarity.is_empty();
        let smooth = fixed && !self.switches() && s.inclusions().is_empty() && s.mechanics().is_none();
        let stated = || self.path.iter().map(|c| &c.f).chain(self.terminal.iter().map(|c| &c.f));
        let affine = || {
            let ends = self.boundary.iter().map(|c| &c.f);
            let soft = self.soft.iter().map(|c| &c.f);
            let squares = self.squares.iter().map(|q| &q.f);
            let dynamics = s.f0().into_iter().chain(s.algebraic());
            dynamics.chain(stated()).chain(ends).chain(soft).chain(squares).all(|f| self.is_affine(f))
        };
        let costs = || self.lagrange.iter().chain(&self.mayer).all(|f| self.is_convex_quadratic(f));
        let positive = || self.squares.iter().all(|q| is_positive(&q.weights, q.f.n_out()));
        smooth && affine() && costs() && positive()
    }

    /// Inputs that are variables of the problem: all states and controls, and free parameters.
    fn varies(&self, f: &dyn Function) -> impl Fn(usize) -> bool {
        let d = f.dims();
        let free = self.free_params();
        move |c: usize| c < d.x + d.u || c < d.t_col() && free[c - d.x - d.u]
    }

    fn is_affine(&self, f: &SharedFunction) -> bool {
        let (varies, p) = (self.varies(f.as_ref()), f.hess_pattern());
        !f.hessian_is_approximate()
            && !f.jacobian_is_approximate()
            && (0..p.n_cols()).filter(|c| varies(*c)).all(|c| p.rows(c).iter().all(|r| !varies(*r)))
    }

    fn is_convex_quadratic(&self, f: &SharedFunction) -> bool {
        if self.is_affine(f) {
            return true;
        }
        if !f.hessian_is_constant() {
            return false;
        }
        let (d, p, varies) = (f.dims(), f.hess_pattern(), self.varies(f.as_ref()));
        let (x, u) = (vec![0.0; d.x], vec![0.0; d.u]);
        let at = Point { t: self.t0, x: &x, u: &u, p: self.params_of(0) };
        // parameters of stages may scale the cost differently from stage to stage
        if self.stage_params.is_some() {
            return false;
        }
        let mut h = vec![0.0; p.nnz()];
        if f.hessian(&at, &[1.0], &mut h, &mut vec![0.0; f.work_len()]).is_err() {
            return false;
        }
        let n = d.n_in();
        let mut all = DMatrix::zeros(n, n);
        for c in (0..n).filter(|c| varies(*c)) {
            for (r, v) in p.rows(c).iter().zip(&h[p.range(c)]).filter(|(r, _)| varies(**r)) {
                (all[(*r, c)], all[(c, *r)]) = (*v, *v);
            }
        }
        is_semidefinite(&all)
    }
}

fn is_positive(weights: &[f64], n: usize) -> bool {
    if weights.len() == n {
        return weights.iter().all(|w| *w >= 0.0);
    }
    let w = DMatrix::from_row_slice(n, n, weights);
    is_semidefinite(&(0.5 * (&w + w.transpose())))
}

/// Is a symmetric matrix positive semidefinite, up to rounding?
fn is_semidefinite(m: &DMatrix<f64>) -> bool {
    let values = m.clone().symmetric_eigenvalues();
    let largest = values.iter().fold(0f64, |a, v| a.max(v.abs()));
    largest.is_finite() && values.iter().all(|v| *v >= -ROUNDING * m.nrows() as f64 * f64::EPSILON * largest)
}
