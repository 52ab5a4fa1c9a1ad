//! Weights and multipliers under relaxed complementarity: the smoothed system that the homotopy starts from.

use super::form::Form;

impl Form {
    /// The weights `theta[n_weights]` and multipliers `lambda[n_cells]`, `mu[n_mu]` of a point with `θ λ = sigma` for every
    /// cell instead of zero, all else being met: `rows` are the combinations `Σ_j weights[j] f_j` of [`Form::rows`].
    ///
    /// Within cells whose weights sum to one `λ = g − ν`, and `Σ σ/(g − ν) = 1` determines `ν`. Where there is no `μ`, in
    /// the Heaviside form, `g` is the switching function for the cell below and zero for the one above. Constraints that are violated
    /// have a multiplier besides their weight: their rows are not met.
    pub fn relaxed(&self, rows: &[f64], sigma: f64, theta: &mut [f64], lambda: &mut [f64], mu: &mut [f64]) {
        lambda.fill(0.0);
        for (row, g) in self.rows.iter().zip(rows) {
            for &(cell, _) in row.lambda.iter().filter(|l| l.1 < 0.0) {
                lambda[cell] = *g;
            }
        }
        for cells in &self.simplices {
            let lowest = lambda[cells.clone()].iter().fold(f64::INFINITY, |m, g| m.min(*g));
            let shift = shift(&lambda[cells.clone()], lowest, sigma);
            for c in cells.clone() {
                // the difference first: next to zero it keeps its digits
                lambda[c] = (lambda[c] - lowest) + shift;
                theta[c] = sigma / lambda[c];
            }
        }
        for c in self.multipliers.iter().cloned().flatten() {
            // `λ − σ/λ = g`: where the constraint is violated the push grows with the violation
            let (g, root) = (lambda[c], lambda[c].hypot(2.0 * sigma.sqrt()));
            lambda[c] = if g > 0.0 { 0.5 * (root + g) } else { 2.0 * sigma / (root - g) };
            theta[c] = sigma / lambda[c];
        }
        for (row, g) in self.rows.iter().zip(rows) {
            if let (Some(m), Some(&(cell, _))) = (row.mu, row.lambda.first()) {
                mu[m] = g - lambda[cell];
            }
        }
        for (k, factors) in self.products.iter().enumerate() {
            theta[self.n_cells + k] = factors.iter().map(|f| theta[*f]).product();
        }
    }
}

/// `s > 0` with `Σ σ/(g − lowest + s) = 1`, by Newton's method from the left: the sum is convex and falls. It is a sum of
/// weights, numbers without unit, so the end of the iteration does not depend on the units of `g` and `σ`.
fn shift(g: &[f64], lowest: f64, sigma: f64) -> f64 {
    let mut s = sigma;
    for _ in 0..60 {
        let terms = || g.iter().map(|g| sigma / (g - lowest + s));
        let (excess, slope) = (terms().sum::<f64>() - 1.0, terms().map(|t| t * t).sum::<f64>() / sigma);
        if excess <= 1e-14 {
            break;
        }
        s += excess / slope;
    }
    s
}

#[cfg(test)]
mod tests {
    use super::super::form::{IndicatorRow, Term};
    use super::*;
    use crate::func::{Callback, Dims};
    use std::sync::Arc;

    fn check(f: &Form, rows: &[f64], sigma: f64) -> Vec<f64> {
        let (mut theta, mut lambda, mut mu) = (vec![0.0; f.n_weights()], vec![0.0; f.n_cells], vec![0.0; f.n_mu]);
        f.relaxed(rows, sigma, &mut theta, &mut lambda, &mut mu);
        for cells in &f.simplices {
            assert!((theta[cells.clone()].iter().sum::<f64>() - 1.0).abs() < 1e-12, "{theta:?}");
        }
        for c in 0..f.n_cells {
            assert!(theta[c] > 0.0 && lambda[c] > 0.0 && (theta[c] * lambda[c] - sigma).abs() < 1e-12 * (1.0 + sigma));
        }
        for (row, g) in f.rows.iter().zip(rows) {
            let left: f64 =
                row.lambda.iter().map(|&(c, v)| v * lambda[c]).sum::<f64>() + g - row.mu.map_or(0.0, |m| mu[m]);
            assert!(left.abs() < 1e-10, "{left}");
        }
        theta
    }

    #[test]
    fn conditions_are_met_in_both_forms() {
        let row = |lambda, mu| IndicatorRow { source: 0, weights: vec![1.0], lambda, mu };
        let stewart = Form {
            rows: (0..3).map(|c| row(vec![(c, -1.0)], Some(0))).collect(),
            simplices: std::iter::once(0..3).collect(),
            n_cells: 3,
            n_mu: 1,
            ..Form::default()
        };
        for sigma in [1.0, 1e-3, 1e-9] {
            let theta = check(&stewart, &[-2.0, 1.0, 5.0], sigma);
            assert!(theta[0] > theta[1] && theta[1] > theta[2] && (sigma > 1e-6 || theta[0] > 1.0 - 1e-8));
        }
        let d = Dims { x: 1, u: 0, p: 0 };
        let modes = Arc::new(Callback::new("F", d, 4, |_, _| 0));
        let weights = vec![vec![4], vec![1]];
        let heaviside = Form {
            rows: (0..2).map(|k| row(vec![(2 * k + 1, -1.0), (2 * k, 1.0)], None)).collect(),
            simplices: vec![0..2, 2..4],
            n_cells: 4,
            products: vec![vec![0, 2]],
            terms: vec![Term { rows: vec![0], modes, weights }],
            ..Form::default()
        };
        let theta = check(&heaviside, &[0.0, 3.0], 0.1);
        // on the surface one half; above it the upper cell
        assert!((theta[0] - 0.5).abs() < 1e-12 && theta[2] > 0.9);
        assert_eq!(theta[4], theta[0] * theta[2]);
        check(&heaviside, &[-7.0, 1e3], 1.0);
    }
}
