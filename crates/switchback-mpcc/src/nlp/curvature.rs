//! Second-order conditions at a solution, by the inertia of the matrix of its optimality conditions.
//!
//! With some active constraints as equations and the others absent, `[H Jᵀ; J 0]` has as many positive eigenvalues as there are
//! variables exactly where the Hessian `H` of the Lagrangian is positive definite on the tangent space of these equations
//! (N. I. M. Gould, Math. Programming 32, 1985). The critical cone lies inside of the tangent space of the constraints that have a
//! multiplier, and holds that of all active ones: the first shows a strict local minimum, the second a saddle.
//!
//! The static shift of the factorisation moves eigenvalues that are as small as itself, so curvature counts only where it is
//! [`LEAST`] or more, relative to the entries of its row and column (the matrix is equilibrated). A negative one is believed by its
//! direction alone.

use super::iterate::{lagrangian_gradient, Iterate};
use super::problem::{Bounds, Nlp};
use super::solver::Ipm;
use crate::linalg::kkt::KktStatus;

/// Verdicts of the conditions of second order on a point that satisfies those of first order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum SecondOrder {
    /// Sufficient conditions hold: the objective is larger at all other feasible points near by.
    StrictMinimum = 0,
    /// A direction along the active constraints, whose gradients are independent, has negative curvature: no local minimum.
    Saddle = 1,
    /// Neither could be shown.
    Undecided = 2,
    /// Not asked: the point is no exact one, or does not satisfy the conditions of first order.
    #[default]
    Unknown = 3,
}

impl SecondOrder {
    /// Name as in reports.
    pub fn name(self) -> &'static str {
        match self {
            SecondOrder::StrictMinimum => "strict_minimum",
            SecondOrder::Saddle => "saddle",
            SecondOrder::Undecided => "undecided",
            SecondOrder::Unknown => "unknown",
        }
    }
}

/// Conditions of first order at a point with multipliers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FirstOrder {
    /// The largest entry of the gradient of the objective.
    pub gradient: f64,
    /// The part of it that the multipliers leave over.
    pub left: f64,
    /// Size that rounding may have left over of the terms of the gradient of the Lagrangian.
    pub rounding: f64,
    /// Worth of the violations of rows: multipliers times violations.
    pub hidden: f64,
}

/// Least curvature that counts, and largest eigenvalue of `J Jᵀ` that is that of dependent rows, of an equilibrated matrix: more than
/// its static shift of 3e-8 makes.
const LEAST: f64 = 1e-6;
/// Growth of the curvature that is added on the way to the largest under which a direction is still one of descent, and its end.
const GROW: f64 = 1e4;
const MOST: f64 = 1e2;
/// Steps of inverse iteration towards a direction of negative curvature.
const STEPS: usize = 8;

impl Ipm {
    /// Functions, gradients and the Hessian of the Lagrangian at a point with multipliers; false where something has no value.
    pub fn look_at(&mut self, nlp: &mut dyn Nlp, at: &Iterate) -> bool {
        self.it.copy_from(at);
        self.evaluate(nlp)
            && self.differentiate(nlp)
            && nlp.hessian(&self.it.x, 1.0, &self.it.y, &mut self.v.hess).is_ok()
    }

    /// The conditions of first order at the point of [`Ipm::look_at`] with its multipliers, in variables that `bounds` do not fix.
    pub fn first_order(&mut self, bounds: &Bounds) -> FirstOrder {
        self.shape.classify(bounds);
        lagrangian_gradient(&self.shape, &self.jac, &self.v, &self.it.y, &mut self.lag);
        let Ipm { shape, jac, v, it, lag, n, .. } = self;
        let mut found = FirstOrder::default();
        for j in (0..*n).filter(|j| !shape.fixed[*j]) {
            let z = it.zl[j] - it.zu[j];
            let rows: f64 = jac.range(j).map(|k| (v.jac[k] * it.y[jac.row_idx()[k]]).abs()).sum();
            found.left = found.left.max((lag[j] - z).abs());
            found.rounding = found.rounding.max(f64::EPSILON * (v.grad[j].abs() + z.abs() + rows));
        }
        found.gradient = v.grad.iter().fold(0f64, |a, g| a.max(g.abs()));
        let violation = |i: usize| (bounds.cl[i] - v.c[i]).max(v.c[i] - bounds.cu[i]).max(0.0);
        found.hidden = it.y.iter().enumerate().map(|(i, y)| y.abs() * violation(i)).sum();
        found
    }

    /// True where the Hessian at the point of [`Ipm::look_at`] is positive definite along the equations of `bounds`, in which active constraints
    /// are equations and others absent.
    pub fn is_convex_along(&mut self, bounds: &Bounds) -> bool {
        self.factor_along(bounds, -LEAST) == KktStatus::Ok
    }

    /// True where the Hessian has negative curvature along the equations of `bounds`, as in [`Ipm::is_convex_along`]. Only where a direction is found.
    pub fn is_concave_along(&mut self, bounds: &Bounds) -> bool {
        let mut lift = LEAST;
        if self.factor_along(bounds, lift) != KktStatus::WrongInertia {
            return false;
        }
        // with as much curvature as leaves it negative the eigenvalue next to zero is that of the direction wanted
        while lift < MOST && self.factor_along(bounds, GROW * lift) == KktStatus::WrongInertia {
            lift *= GROW;
        }
        self.factor_along(bounds, lift);
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        let Ipm { system, shape, n, dx, .. } = self;
        for (j, d) in dx.iter_mut().enumerate() {
            *d = if shape.fixed[j] { 0.0 } else { 2.0 * (golden * (j + 1) as f64).fract() - 1.0 };
        }
        for _ in 0..STEPS {
            system.load_right_hand_side(dx);
            if !system.solve_consistent() {
                return false;
            }
            // the right-hand side times d is dᵀ(H + lift)d, as d is along the equations
            let curvature: f64 = system.rhs[..*n].iter().zip(&system.sol).map(|(r, d)| r * d).sum();
            if curvature < 0.0 {
                return true;
            }
            system.scaled_solution(dx);
        }
        false
    }

    /// Number of equations of `bounds`, as in [`Ipm::is_convex_along`], whose gradients depend on those of others.
    pub fn dependent(&mut self, bounds: &Bounds) -> usize {
        self.assemble_along(bounds, false);
        self.system.dependent_rows(&self.shape, LEAST)
    }

    fn assemble_along(&mut self, bounds: &Bounds, hessian: bool) {
        self.shape.classify(bounds);
        let Ipm { system, shape, it, v, .. } = self;
        system.assemble(shape, bounds, it, v, hessian);
    }

    fn factor_along(&mut self, bounds: &Bounds, lift: f64) -> KktStatus {
        self.assemble_along(bounds, true);
        self.system.factor_lifted(&self.shape, lift)
    }
}
