//! First-order conditions at the end of a descent.

use crate::error::{Error, Result};
use crate::ocp::descent::{Lowest, Program, Shooting};

/// The Lagrange function at the end of a descent, to first order.
pub(super) struct Slopes {
    /// Largest change by one variable within its bounds, over its size, relative to the cost or what one variable changes it by.
    pub residual: f64,
    /// Derivatives by the controls of the user `[n_stages · nu]`.
    pub controls: Vec<f64>,
}

impl Shooting<'_> {
    /// What is left of the first-order conditions at the end of a descent.
    pub(super) fn residual(&mut self, z: &[f64], found: &Lowest) -> Result<Slopes> {
        let gradient = self.lagrangian(z, &found.multipliers)?;
        let (lower, upper, size) = self.bounds();
        let at = |b: f64, j: usize| (z[j] - b).abs() <= f64::EPSILON.sqrt() * size[j];
        let left = |j: usize| match gradient[j] {
            g if g > 0.0 && at(lower[j], j) || g < 0.0 && at(upper[j], j) => 0.0,
            g => g.abs() * size[j] / found.unit,
        };
        let residual = (0..z.len()).map(left).fold(0.0, f64::max);
        Ok(Slopes { residual, controls: self.own_controls(&gradient) })
    }

    /// The gradient of the cost with multiples of the constraints.
    pub(super) fn lagrangian(&mut self, z: &[f64], multipliers: &[f64]) -> Result<Vec<f64>> {
        let missing = || Error::Numeric("the end of a descent has no derivatives".into());
        let values = self.simulated_at(z)?.ok_or_else(missing)?;
        let mut gradient = values.gradient;
        for (mu, row) in multipliers.iter().zip(values.jacobian.chunks_exact(z.len())).filter(|(mu, _)| **mu != 0.0) {
            gradient.iter_mut().zip(row).for_each(|(g, v)| *g += mu * v);
        }
        Ok(gradient)
    }
}
