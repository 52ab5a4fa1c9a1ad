//! Functions that are smooth but for kinks, to first order: on one side of a kink they have other slopes, which the end of a step that crossed it shows.
//!
//! ```text
//! f(y + d) ≈ f(y) + F d + Σ_k w_k max(0, g_kᵀ d − b_k)
//! ```
//!
//! Cost and constraints have their kinks at the same places, where the motion changes its modes, so that one direction `g_k` and one distance `b_k ≥ 0`
//! belong to a kink, with what every function bends by there, `w_k`. (Piecewise linearisation: A. Griewank, *On stable piecewise linearization
//! and generalized algorithmic differentiation*, 2013; its minimisation by signs: A. Griewank, A. Walther, 2016.)

use super::sqp::Values;
use nalgebra::{DMatrix, DVector};

/// Steps of the power method for the direction of a kink.
const POWERS: usize = 8;
/// Share of the slopes below which a change of them is rounding.
const ROUNDING: f64 = 1e-9;
/// Shares of the way to another point between which slopes change in the middle: that is what curvature does, and a kink is elsewhere when
/// it is seen from the next point.
const MIDDLE: [f64; 2] = [0.4, 0.6];

/// A kink as it is seen from a point.
#[derive(Debug, Clone)]
pub(super) struct Hinge {
    /// Across the kink, of length one `[n]`, and how far away it is.
    pub across: Vec<f64>,
    pub distance: f64,
    /// What the slope across it changes by behind it: of the cost and of the constraints `[m]`.
    pub cost: f64,
    pub rows: Vec<f64>,
}

impl Hinge {
    /// The kink between a point `y` with values `here` and another one on its other side; nothing where slopes are the same there, or differ by curvature.
    pub fn between((y, here): (&[f64], &Values), (at, there): (&[f64], &Values)) -> Option<Hinge> {
        let (n, m) = (y.len(), here.rows.len());
        let bend = DMatrix::from_fn(1 + m, n, |i, j| match i {
            0 => there.gradient[j] - here.gradient[j],
            i => there.jacobian[(i - 1) * n + j] - here.jacobian[(i - 1) * n + j],
        });
        let way = DVector::from_iterator(n, at.iter().zip(y).map(|(a, b)| a - b));
        // what the functions of the other side are above those of this one, at this point
        let value = |i: usize| if i == 0 { there.cost - here.cost } else { there.rows[i - 1] - here.rows[i - 1] };
        let slope = |i: usize, v: &Values| match i {
            0 => v.gradient.iter().zip(way.iter()).map(|(g, d)| g * d).sum::<f64>(),
            i => v.jacobian[(i - 1) * n..i * n].iter().zip(way.iter()).map(|(g, d)| g * d).sum(),
        };
        let above = DVector::from_iterator(1 + m, (0..=m).map(|i| value(i) - slope(i, there)));
        let steepest = here.gradient.iter().chain(&here.jacobian).fold(0f64, |a, v| a.max(v.abs()));
        let longest = (0..=m).max_by(|&a, &b| bend.row(a).norm_squared().total_cmp(&bend.row(b).norm_squared()))?;
        let mut across = bend.row(longest).transpose();
        if across.norm() <= ROUNDING * steepest || !across.norm().is_finite() {
            return None;
        }
        for _ in 0..POWERS {
            across /= across.norm();
            across = bend.tr_mul(&(&bend * &across));
        }
        across /= across.norm();
        // it is crossed on the way to the other side
        if across.dot(&way) < 0.0 {
            across.neg_mut();
        }
        let jump = &bend * &across;
        let (distance, reach) = (-jump.dot(&above) / jump.norm_squared(), across.dot(&way));
        if distance.is_nan() || distance >= reach || (MIDDLE[0] * reach..MIDDLE[1] * reach).contains(&distance) {
            return None;
        }
        Some(Hinge {
            across: across.as_slice().to_vec(),
            distance: distance.max(0.0),
            cost: jump[0],
            rows: jump.rows(1, m).iter().copied().collect(),
        })
    }

    /// How far behind the kink the end of a step is, negative before it.
    pub fn beyond(&self, step: &[f64]) -> f64 {
        self.across.iter().zip(step).map(|(g, d)| g * d).sum::<f64>() - self.distance
    }

    /// What the Lagrange function bends by, with these multipliers of the constraints.
    pub fn bend(&self, multipliers: &[f64]) -> f64 {
        self.cost + self.rows.iter().zip(multipliers).map(|(w, mu)| w * mu).sum::<f64>()
    }
}
