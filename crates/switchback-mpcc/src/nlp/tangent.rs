//! Derivative of a solution with respect to its data.
//!
//! With every active bound an equation and no other, the optimality conditions are `∇L(w, y, q) = 0`, `c(w, q) = 0` in the
//! free variables `w` and the data `q`; by the implicit function theorem
//!
//! ```text
//! [ ∇²L  Jᵀ ] [ dw ]     [ ∂∇L/∂q ]
//! [ J       ] [ dy ] = − [ ∂c/∂q  ]  dq
//! ```
//!
//! with the matrix of the last Newton step (A. V. Fiacco, Introduction to Sensitivity and Stability Analysis, 1983).

//!
//! The matrix is symmetric: the adjoint of this map, which takes a weight of the point to weights of `∂∇L/∂q` and `∂c/∂q`, is another
//! solve with it.

use super::iterate::RowKind;
use super::problem::Nlp;
use super::solver::Ipm;

impl Ipm {
    /// Factors the matrix of the optimality conditions at the iterate; false where the solution is not regular: no
    /// isolated minimiser, or a function that cannot be evaluated.
    pub fn linearise(&mut self, nlp: &mut dyn Nlp) -> bool {
        if !self.evaluate(nlp)
            || !self.differentiate(nlp)
            || nlp.hessian(&self.it.x, 1.0, &self.it.y, &mut self.v.hess).is_err()
        {
            return false;
        }
        let mu = self.level.mu;
        let Ipm { system, shape, bounds, it, v, .. } = self;
        system.assemble(shape, bounds, it, v, true);
        system.factor(shape, bounds, it, mu, false) && system.delta_w == 0.0
    }

    /// After [`Ipm::linearise`]: is the matrix regular? If it is not, and the solution is isolated, gradients of the equations are
    /// dependent, and not every change of the data has a derivative: [`Ipm::tangent`] says which has.
    pub fn is_regular(&mut self) -> bool {
        self.system.is_onto(true)
    }

    /// After [`Ipm::linearise`]: is the solution isolated among those of its equations?
    pub fn is_isolated(&mut self) -> bool {
        self.system.is_onto(false)
    }

    /// Weights of `∂∇L/∂q`, in `dx[n]`, and of `∂c/∂q`, in `dy[m]`, of a weight `dx[n]` of the point: the adjoint of
    /// [`Ipm::tangent`], up to the sign. False when the system cannot be solved.
    pub fn adjoint(&mut self, dx: &mut [f64], dy: &mut [f64]) -> bool {
        let Ipm { system, shape, n, .. } = self;
        for (j, d) in dx.iter().enumerate() {
            system.rhs[j] = if shape.fixed[j] { 0.0 } else { *d };
        }
        system.rhs[*n..].fill(0.0);
        if !system.solve_consistent() {
            return false;
        }
        for (j, d) in dx.iter_mut().enumerate() {
            *d = if shape.fixed[j] { 0.0 } else { system.sol[j] };
        }
        for (i, d) in dy.iter_mut().enumerate() {
            *d = if shape.row[i] == RowKind::Free { 0.0 } else { system.sol[*n + i] };
        }
        true
    }

    /// `∇²L dx + Jᵀ dy` in `gradient[n]` and `J dx` in `rows[m]`, with the derivatives of [`Ipm::linearise`].
    pub fn rates(&self, dx: &[f64], dy: &[f64], gradient: &mut [f64], rows: &mut [f64]) {
        self.system.times_hessian(&self.v, dx, gradient);
        rows.fill(0.0);
        for (j, g) in gradient.iter_mut().enumerate() {
            for k in self.jac.range(j) {
                let i = self.jac.row_idx()[k];
                *g += self.v.jac[k] * dy[i];
                rows[i] += self.v.jac[k] * dx[j];
            }
        }
    }

    /// Change `dx[n]`, `dy[m]` of the point and its multipliers after [`Ipm::linearise`]. On entry `dx` holds the change
    /// of the values of fixed variables, and `∂∇L/∂q dq` for the free ones; `dy` holds `∂c/∂q dq`. False when the
    /// system cannot be solved.
    pub fn tangent(&mut self, dx: &mut [f64], dy: &mut [f64]) -> bool {
        let Ipm { system, shape, v, jac, n, .. } = self;
        for (j, d) in dx.iter().enumerate() {
            system.rhs[j] = if shape.fixed[j] { 0.0 } else { -d };
        }
        for (i, d) in dy.iter().enumerate() {
            system.rhs[*n + i] = if shape.row[i] == RowKind::Free { 0.0 } else { -d };
        }
        system.fixed_columns(shape, v, dx);
        for (j, d) in dx.iter().enumerate().filter(|(j, d)| shape.fixed[*j] && **d != 0.0) {
            for k in jac.range(j) {
                let i = jac.row_idx()[k];
                if shape.row[i] != RowKind::Free {
                    system.rhs[*n + i] -= v.jac[k] * d;
                }
            }
        }
        if !system.solve_consistent() {
            return false;
        }
        for (j, d) in dx.iter_mut().enumerate().filter(|(j, _)| !shape.fixed[*j]) {
            *d = system.sol[j];
        }
        dy.copy_from_slice(&system.sol[*n..]);
        true
    }
}
