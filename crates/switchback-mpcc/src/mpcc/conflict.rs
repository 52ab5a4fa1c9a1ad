//! Which constraints of an infeasible program contradict each other.
//!
//! At a minimiser of the sum of violations there are multipliers `y` of the rows, in `[−1, 1]` up to a factor, whose
//! combination of gradients is held by the bounds alone: `Jᵀy = z`. For linear rows that is a proof after Farkas,
//! `yᵀc` being above what any point within the bounds allows; for others it is one to first order.

use crate::linalg::csc::{mul_add_transposed, Pattern};
use crate::nlp::Bounds;

/// Constraints that contradict each other, the heaviest first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Conflict {
    /// Rows and their weights; positive where the upper bound, negative where the lower bound takes part.
    pub rows: Vec<(usize, f64)>,
    /// Variables whose bounds take part, and their weights; positive for the lower bound, negative for the upper.
    /// Members of pairs that are held at zero by a positive partner have either sign.
    pub variables: Vec<(usize, f64)>,
    /// By how much the weighted sum of the rows exceeds what their bounds allow; the proof needs it positive.
    pub gap: f64,
    /// Largest component of `Jᵀy − z`, which the proof needs to vanish.
    pub residual: f64,
}

/// Weights below this are left out of the lists.
const NEGLIGIBLE: f64 = 1e-6;

impl Conflict {
    /// Combines the rows with the multipliers `y[m]` that a minimiser `x[n]` of the violation has, `c[m]` and `jac`
    /// being the rows and their Jacobian there. Weights are scaled to a largest row weight of 1. Bounds up to `active`
    /// away count as active; `pairs` may be empty.
    ///
    /// A multiplier with a sign that the row's position excludes is dropped; the residual then shows what is missing.
    #[allow(clippy::too_many_arguments)]
    pub fn combine(
        x: &[f64],
        c: &[f64],
        jac: &Pattern,
        jac_values: &[f64],
        bounds: &Bounds,
        pairs: &[(usize, usize)],
        y: &[f64],
        active: f64,
    ) -> Conflict {
        let at_upper = |i: usize| c[i] >= bounds.cu[i] - active * bounds.cu[i].abs().max(1.0);
        let at_lower = |i: usize| c[i] <= bounds.cl[i] + active * bounds.cl[i].abs().max(1.0);
        let mut weights: Vec<f64> = (0..c.len())
            .map(|i| if (y[i] > 0.0 && at_upper(i)) || (y[i] < 0.0 && at_lower(i)) { y[i] } else { 0.0 })
            .collect();
        let largest = weights.iter().fold(0f64, |a, w| a.max(w.abs()));
        if largest == 0.0 || !largest.is_finite() {
            return Conflict::default();
        }
        weights.iter_mut().for_each(|w| *w /= largest);
        let gap = (0..c.len())
            .filter(|&i| weights[i] != 0.0)
            .map(|i| weights[i] * (c[i] - if weights[i] > 0.0 { bounds.cu[i] } else { bounds.cl[i] }))
            .sum();
        let mut held = vec![false; x.len()];
        for &(a, b) in pairs {
            let (small, other) = if x[a] <= x[b] { (a, b) } else { (b, a) };
            held[small] = held[small] || (x[small] <= active && x[other] > active);
        }
        let mut z = vec![0.0; x.len()];
        mul_add_transposed(jac, jac_values, &weights, &mut z, 1.0);
        let mut residual = 0f64;
        for j in 0..x.len() {
            let (lo, hi) = (bounds.xl[j], bounds.xu[j]);
            let bound = if z[j] > 0.0 { x[j] - lo } else { hi - x[j] };
            if !(lo == hi || held[j] || bound <= active * x[j].abs().max(1.0)) {
                residual = residual.max(z[j].abs());
                z[j] = 0.0;
            }
        }
        Conflict { rows: heaviest(&weights), variables: heaviest(&z), gap, residual }
    }
}

/// Indices and values of what is not negligible, by modulus.
fn heaviest(weights: &[f64]) -> Vec<(usize, f64)> {
    let mut list: Vec<(usize, f64)> =
        weights.iter().copied().enumerate().filter(|(_, w)| w.abs() > NEGLIGIBLE).collect();
    list.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f64 = f64::INFINITY;

    /// `x ≥ 2`, `2x + 2y ≤ 1`, `y ≥ 0`, and a row that takes no part; the violation is least on `1/2 ≤ x ≤ 2`, `y = 0`.
    #[test]
    fn rows_and_bounds_that_contradict_are_named() {
        let jac = Pattern::dense(3, 2);
        let values = [1.0, 2.0, 1.0, 0.0, 2.0, -1.0];
        let mut b = Bounds::free(2, 3);
        b.cl = vec![2.0, -INF, -5.0];
        b.cu = vec![INF, 1.0, 5.0];
        b.xl[1] = 0.0;
        // gradients (1, 0) and (2, 2): weights −1 and 1/2 leave (0, 1) to the bound of y
        let c = [1.0, 2.0, 1.0];
        let found = Conflict::combine(&[1.0, 0.0], &c, &jac, &values, &b, &[], &[-3.0, 1.5, 0.7], 1e-8);
        assert_eq!(found.rows, vec![(0, -1.0), (1, 0.5)]);
        assert_eq!(found.variables, vec![(1, 1.0)]);
        assert_eq!((found.gap, found.residual), (1.5, 0.0));
        // weights that are no proof say so
        let found = Conflict::combine(&[1.0, 0.0], &c, &jac, &values, &b, &[], &[-3.0, 0.0, 0.0], 1e-8);
        assert_eq!((found.residual, found.gap), (1.0, 1.0));
        assert_eq!(
            Conflict::combine(&[1.0, 0.0], &c, &jac, &values, &b, &[], &[0.0, 0.0, f64::NAN], 1e-8),
            Conflict::default()
        );
    }

    /// `u + v ≤ −1 + t`, `t ≤ 0` with `u ⊥ v`: at `u = 0`, `v = 3` the partner holds `u`, and `v` is not held.
    #[test]
    fn members_with_a_positive_partner_are_held() {
        let jac = Pattern::dense(1, 2);
        let mut b = Bounds::free(2, 1);
        b.xl = vec![0.0, 0.0];
        b.cu[0] = -1.0;
        let combine =
            |x: [f64; 2], row: [f64; 2], c: f64| Conflict::combine(&x, &[c], &jac, &row, &b, &[(0, 1)], &[1.0], 1e-8);
        let found = combine([0.0, 3.0], [-1.0, 0.0], 0.0);
        assert_eq!((found.variables.clone(), found.residual), (vec![(0, -1.0)], 0.0));
        let found = combine([0.0, 0.0], [-1.0, 0.0], 0.0);
        assert_eq!((found.variables.clone(), found.residual), (vec![], 1.0));
        let found = combine([0.0, 3.0], [0.0, 1.0], 3.0);
        assert_eq!((found.residual, found.gap), (1.0, 4.0));
    }
}
