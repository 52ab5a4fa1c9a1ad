//! What duality says of the cost of the solution, long before it is reached.
//!
//! The Lagrangian `L(·, y, z)` lies below the cost of every feasible point, and where all functions are convex `L(x*) ≥ L(x) + rᵀ(x* − x)`,
//! with `r` its gradient (S. Boyd and L. Vandenberghe, Convex Optimization, 2004, 3.1.3 and 5.1.3). The way to the solution is not known, and Newton's
//! direction stands for it. Where rows contradict each other the multipliers grow along a ray, and the bound with them: without end, while violations hardly
//! change. A program that is not convex may have a solution below it.

use super::iterate::RowKind;
use super::solver::Ipm;

/// Multiple of what Newton's direction takes off the Lagrangian: it is not the whole way where functions are not quadratic.
const TAKEN_OFF: f64 = 4.0;

impl Ipm {
    /// A bound of the cost of the solution from below, in the scale of the objective, by the present direction; minus infinity where the Hessian was
    /// shifted for it, so that the Lagrangian has no least value nearby.
    pub(super) fn bound(&self) -> f64 {
        if self.system.delta_w > 0.0 {
            return f64::NEG_INFINITY;
        }
        let (it, b, shape) = (&self.it, &self.bounds, &self.shape);
        let (mut lagrangian, mut slope) = (self.v.f, 0.0);
        for i in (0..it.s.len()).filter(|i| shape.row[*i] != RowKind::Free) {
            lagrangian += it.y[i] * self.residual[i];
            if shape.row[i] == RowKind::Inequality {
                let mut r = -it.y[i];
                if shape.has_cl[i] {
                    r -= it.vl[i];
                    lagrangian -= it.vl[i] * (it.s[i] - b.cl[i]);
                }
                if shape.has_cu[i] {
                    r += it.vu[i];
                    lagrangian -= it.vu[i] * (b.cu[i] - it.s[i]);
                }
                slope += r * self.ds[i];
            }
        }
        for j in (0..it.x.len()).filter(|j| !shape.fixed[*j]) {
            let mut r = self.lag[j];
            if shape.has_xl[j] {
                r -= it.zl[j];
                lagrangian -= it.zl[j] * (it.x[j] - b.xl[j]);
            }
            if shape.has_xu[j] {
                r += it.zu[j];
                lagrangian -= it.zu[j] * (b.xu[j] - it.x[j]);
            }
            slope += r * self.dx[j];
        }
        lagrangian - TAKEN_OFF * slope.abs()
    }
}
