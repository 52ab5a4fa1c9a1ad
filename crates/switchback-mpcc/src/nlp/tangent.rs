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
