//! Scaling of variables by their sizes, where the problem knows them, and of objective and rows by their gradients at the
//! starting point.
//!
//! Every function whose gradient has an entry above 100 is scaled down to that (A. Wächter, L. Biegler, Math. Program.
//! 106, 2006, section 3.8). Without sizes variables, and with them the pairs, stay as they are; with sizes
//! gradients are those in units of them, and are scaled up as well.

use super::problem::Mpcc;
use crate::linalg::csc::Pattern;
use crate::nlp::Bounds;

/// Largest entry of a scaled gradient at the starting point.
const LARGEST: f64 = 100.0;
/// Largest entry of the scaled gradient of the objective, and of its second derivatives, in variables of their sizes.
const OBJECTIVE: f64 = 100.0;
/// A gradient in variables of their sizes that is as good as zero.
const ROUNDING: f64 = 1e-12;
/// Smallest factor.
const SMALLEST: f64 = 1e-8;

/// Factors of objective and rows.
#[derive(Debug)]
pub(super) struct Scaling {
    /// Factor of the objective.
    pub objective: f64,
    /// Factor of every row `[m]`.
    pub rows: Vec<f64>,
    /// Size of every variable `[n]`: the solver sees `x / size`.
    pub sizes: Vec<f64>,
    /// Are there sizes other than 1?
    pub sized: bool,
    weights: Vec<f64>,
}

impl Scaling {
    /// No scaling, for `n` variables and `m` rows.
    pub fn new(n: usize, m: usize) -> Scaling {
        Scaling { objective: 1.0, rows: vec![1.0; m], sizes: vec![1.0; n], sized: false, weights: vec![0.0; m] }
    }

    /// Factors 1.
    pub fn reset(&mut self) {
        self.objective = 1.0;
        self.rows.fill(1.0);
    }

    /// Takes over the sizes a problem has for its variables.
    pub fn set_sizes(&mut self, p: &dyn Mpcc) {
        self.sizes.fill(1.0);
        p.sizes(&mut self.sizes);
        for s in &mut self.sizes {
            *s = if *s > 0.0 && s.is_finite() { *s } else { 1.0 };
        }
        self.sized = self.sizes.iter().any(|s| *s != 1.0);
    }

    /// Sizes that are powers of two: variables and bounds are then what they are in their own units, to the last bit.
    pub fn round_sizes(&mut self) {
        self.sizes.iter_mut().for_each(|s| *s = s.log2().round().exp2());
    }

    /// All sizes and factors 1.
    pub fn forget_sizes(&mut self) {
        self.reset();
        self.sizes.fill(1.0);
        self.sized = false;
    }

    /// Factors from the gradients at a point, with respect to variables of their sizes.
    pub fn choose(&mut self, grad: &[f64], hess: Option<(&Pattern, &[f64])>, jac: &Pattern, values: &[f64]) {
        let of = if self.sized { unit } else { factor };
        let mut steepest = grad.iter().zip(&self.sizes).fold(0f64, |a, (g, s)| a.max((g * s).abs()));
        if let Some((p, h)) = hess {
            for (j, s) in self.sizes.iter().enumerate() {
                let at = p.rows(j).iter().zip(&h[p.range(j)]);
                steepest = at.fold(steepest, |a, (&i, v)| a.max((v * s * self.sizes[i]).abs()));
            }
        }
        let target = if self.sized { OBJECTIVE } else { 1.0 };
        self.objective = target * of(steepest);
        self.rows.fill(0.0);
        for j in 0..jac.n_cols() {
            for (&i, v) in jac.rows(j).iter().zip(&values[jac.range(j)]) {
                if i < self.rows.len() {
                    self.rows[i] = self.rows[i].max((v * self.sizes[j]).abs());
                }
            }
        }
        self.rows.iter_mut().for_each(|r| *r = of(*r));
    }

    /// Size of the scaled gradient of the objective.
    pub fn steepness(&self) -> f64 {
        if self.sized {
            OBJECTIVE
        } else {
            1.0
        }
    }

    /// Variables in units of their sizes, and back.
    pub fn shrink(&self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).zip(&self.sizes).for_each(|((o, x), s)| *o = x / s);
    }

    pub fn grow(&self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).zip(&self.sizes).for_each(|((o, x), s)| *o = x * s);
    }

    /// The multiplier of row `i` in the units of the solver.
    pub fn row_multiplier(&self, i: usize, y: f64) -> f64 {
        y * self.objective / self.rows[i]
    }

    /// The multiplier of the bounds of variable `j` in the units of the solver.
    pub fn bound_multiplier(&self, j: usize, z: f64) -> f64 {
        z * self.objective * self.sizes[j]
    }

    pub fn value(&self, f: f64, rows: &mut [f64]) -> f64 {
        rows.iter_mut().zip(&self.rows).for_each(|(c, s)| *c *= s);
        f * self.objective
    }

    pub fn derivatives(&self, grad: &mut [f64], jac: &Pattern, values: &mut [f64]) {
        grad.iter_mut().for_each(|g| *g *= self.objective);
        values.iter_mut().zip(jac.row_idx()).for_each(|(v, &i)| *v *= self.rows[i]);
        if self.sized {
            grad.iter_mut().zip(&self.sizes).for_each(|(g, s)| *g *= s);
            for (j, s) in self.sizes.iter().enumerate() {
                values[jac.range(j)].iter_mut().for_each(|v| *v *= s);
            }
        }
    }

    /// Second derivatives with respect to variables of their sizes.
    pub fn hessian(&self, pattern: &Pattern, values: &mut [f64]) {
        for (j, s) in self.sizes.iter().enumerate().filter(|_| self.sized) {
            for (v, &i) in values[pattern.range(j)].iter_mut().zip(pattern.rows(j)) {
                *v *= s * self.sizes[i];
            }
        }
    }

    /// Weights of objective and rows for the Hessian of the unscaled functions.
    pub fn weights(&mut self, w: f64, y: &[f64]) -> (f64, &[f64]) {
        for ((t, y), s) in self.weights.iter_mut().zip(y).zip(&self.rows) {
            *t = y * s;
        }
        (w * self.objective, &self.weights)
    }

    pub fn bounds(&self, out: &mut Bounds) {
        for (j, s) in self.sizes.iter().enumerate().filter(|_| self.sized) {
            out.xl[j] /= s;
            out.xu[j] /= s;
        }
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

/// Makes the largest entry 1, unless it is rounding.
fn unit(largest: f64) -> f64 {
    if largest > ROUNDING && largest.is_finite() {
        1.0 / largest
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
        let mut s = Scaling::new(2, 3);
        s.choose(&[1e6, 0.0], None, &jac, &[50.0, 1e30, f64::INFINITY]);
        assert!(s.objective * 1e6 <= 100.0 && s.objective * 1e6 > 49.0 && s.objective.log2().fract() == 0.0);
        assert_eq!((s.rows[0], s.rows[2]), (1.0, 1.0));
        s.choose(&[0.0, 1.0], None, &jac, &[200.0, 1e30, 1.0]);
        assert_eq!((s.objective, s.rows[0]), (1.0, 0.5));
        assert!(s.rows[1] >= 0.5 * SMALLEST);
        let mut c = [4.0, 1.0, 3.0];
        assert_eq!(s.value(7.0, &mut c), 7.0);
        assert_eq!((c[0], c[2]), (2.0, 3.0));
        s.reset();
        assert_eq!(s.weights(2.0, &[1.0, 2.0, 3.0]), (2.0, &[1.0, 2.0, 3.0][..]));
    }
}
