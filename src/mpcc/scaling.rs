//! Scaling of objective and rows by their gradients at the starting point.
//!
//! Every function whose gradient has an entry above 100 is scaled down to that (A. Wächter, L. Biegler, Math. Program.
//! 106, 2006, section 3.8). Variables, and with them the pairs, stay as they are.

use crate::linalg::csc::Pattern;
use crate::nlp::Bounds;

/// Largest entry of a scaled gradient at the starting point.
const LARGEST: f64 = 100.0;
/// Smallest factor.
const SMALLEST: f64 = 1e-8;

/// Factors of objective and rows.
#[derive(Debug)]
pub(super) struct Scaling {
    /// Factor of the objective.
    pub objective: f64,
    /// Factor of every row `[m]`.
    pub rows: Vec<f64>,
    weights: Vec<f64>,
}

impl Scaling {
    /// No scaling, for `m` rows.
    pub fn new(m: usize) -> Scaling {
        Scaling { objective: 1.0, rows: vec![1.0; m], weights: vec![0.0; m] }
    }

    /// Factors 1.
    pub fn reset(&mut self) {
        self.objective = 1.0;
        self.rows.fill(1.0);
    }

    /// Factors from the gradients at a point.
    pub fn choose(&mut self, grad: &[f64], jac: &Pattern, values: &[f64]) {
        self.objective = factor(grad.iter().fold(0.0, |a, g| a.max(g.abs())));
        self.rows.fill(0.0);
        for (&i, v) in jac.row_idx().iter().zip(values) {
            if i < self.rows.len() {
                self.rows[i] = self.rows[i].max(v.abs());
            }
        }
        self.rows.iter_mut().for_each(|r| *r = factor(*r));
    }

    pub fn value(&self, f: f64, rows: &mut [f64]) -> f64 {
        rows.iter_mut().zip(&self.rows).for_each(|(c, s)| *c *= s);
        f * self.objective
    }

    pub fn derivatives(&self, grad: &mut [f64], jac: &Pattern, values: &mut [f64]) {
        grad.iter_mut().for_each(|g| *g *= self.objective);
        values.iter_mut().zip(jac.row_idx()).for_each(|(v, &i)| *v *= self.rows[i]);
    }

    /// Weights of objective and rows for the Hessian of the unscaled functions.
    pub fn weights(&mut self, w: f64, y: &[f64]) -> (f64, &[f64]) {
        for ((t, y), s) in self.weights.iter_mut().zip(y).zip(&self.rows) {
            *t = y * s;
        }
        (w * self.objective, &self.weights)
    }

    pub fn bounds(&self, out: &mut Bounds) {
        for (i, s) in self.rows.iter().enumerate() {
            out.cl[i] *= s;
            out.cu[i] *= s;
        }
    }
}

/// A power of two, so that scaling does not round.
fn factor(largest: f64) -> f64 {
    if largest > LARGEST && largest.is_finite() {
        (LARGEST / largest).max(SMALLEST).log2().floor().exp2()
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steep_functions_are_scaled_down_and_flat_ones_left_alone() {
        let (jac, _) = Pattern::from_triplets(3, 2, &[0, 1, 1], &[0, 0, 1]);
        let mut s = Scaling::new(3);
        s.choose(&[1e6, 0.0], &jac, &[50.0, 1e30, f64::INFINITY]);
        assert!(s.objective * 1e6 <= 100.0 && s.objective * 1e6 > 49.0 && s.objective.log2().fract() == 0.0);
        assert_eq!((s.rows[0], s.rows[2]), (1.0, 1.0));
        s.choose(&[0.0, 1.0], &jac, &[200.0, 1e30, 1.0]);
        assert_eq!((s.objective, s.rows[0]), (1.0, 0.5));
        assert!(s.rows[1] >= 0.5 * SMALLEST);
        let mut c = [4.0, 1.0, 3.0];
        assert_eq!(s.value(7.0, &mut c), 7.0);
        assert_eq!((c[0], c[2]), (2.0, 3.0));
        s.reset();
        assert_eq!(s.weights(2.0, &[1.0, 2.0, 3.0]), (2.0, &[1.0, 2.0, 3.0][..]));
    }
}
