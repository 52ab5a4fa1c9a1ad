//! Is a point at which the rows cannot be met a minimiser of their violation?
//!
//! The claim that a program is infeasible rests on the elastic program
//!
//! ```text
//! min Σ w_i (p_i + q_i)   s.t.   c_l ≤ c(x) − p + q ≤ c_u,   bounds of x,   0 ≤ x_a ⊥ x_b ≥ 0,   p, q ≥ 0
//! ```
//!
//! with the scaling of the rows as `w`: at the point, with `p`, `q` the violations, no step to first order lowers its
//! objective ([`BStationarity::Yes`]). A restoration phase minimises something else, with the pairs relaxed and the
//! distance from its reference point as a further term, so what it ends at may be no such point.

use super::certificate::{BStationarity, CertSettings, Certifier, Local};
use super::judge::allowance;
use super::problem::Mpcc;
use crate::linalg::csc::{mul_add_transposed, Pattern};
use crate::nlp::{Bounds, Control};

/// A violation counts from this share of the terms of its row and its bound: a hundred million times what rounding leaves.
const VIOLATED: f64 = 1e-8;
/// Nodes of the search: what takes more is not shown.
const NODES: usize = 50;

/// A point that claims to be a minimiser of the violation.
pub(super) struct Claim<'a> {
    /// The point `[n]`.
    pub x: &'a [f64],
    /// Multipliers of the rows `[m]` that the restoration ended with; their common factor does not matter.
    pub y: &'a [f64],
    /// Weights of the violations `[m]`.
    pub weights: &'a [f64],
    /// Bounds of the program.
    pub bounds: &'a Bounds,
}

impl Claim<'_> {
    /// Is it one, with a violation that is positive? `work` is that of the solve that ended there.
    pub fn holds(&self, p: &mut dyn Mpcc, work: f64, control: &mut Control) -> bool {
        let (n, m) = (p.n(), p.m());
        let (mut c, mut grad, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
        p.set_polishing(true);
        let known = p.eval(self.x, &mut c).is_ok() && p.derivatives(self.x, &mut grad, &mut jac).is_ok();
        p.set_polishing(false);
        if !known {
            return false;
        }
        let pattern = p.jac_pattern();
        let over: Vec<f64> = (0..m).map(|i| (c[i] - self.bounds.cu[i]).max(0.0)).collect();
        let under: Vec<f64> = (0..m).map(|i| (self.bounds.cl[i] - c[i]).max(0.0)).collect();
        let violated = self.violated(pattern, &jac, &over, &under);
        let Some(y) = self.multipliers(&violated) else { return false };
        let Ok(elastic) = elastic_pattern(pattern) else { return false };
        let mut values = jac;
        values.extend(std::iter::repeat_n(-1.0, m).chain(std::iter::repeat_n(1.0, m)));
        let mut z = vec![0.0; n];
        mul_add_transposed(pattern, &values[..pattern.nnz()], &y, &mut z, 1.0);
        z.extend((0..m).map(|i| self.weights[i] - y[i]));
        z.extend((0..m).map(|i| self.weights[i] + y[i]));
        let x = [self.x, &over, &under].concat();
        for i in 0..m {
            c[i] += under[i] - over[i];
        }
        grad.fill(0.0);
        grad.extend_from_slice(self.weights);
        grad.extend_from_slice(self.weights);
        let mut bounds = Bounds::free(n + 2 * m, m);
        bounds.xl = [&self.bounds.xl[..], &vec![0.0; 2 * m]].concat();
        bounds.xu[..n].copy_from_slice(&self.bounds.xu);
        (bounds.cl, bounds.cu) = (self.bounds.cl.clone(), self.bounds.cu.clone());
        let local = Local {
            x: &x,
            c: &c,
            grad: &grad,
            jac: &elastic,
            jac_values: &values,
            bounds: &bounds,
            pairs: p.pairs(),
            y: &y,
            z: &z,
        };
        let Ok(mut certifier) = Certifier::new(&elastic, p.pairs()) else { return false };
        let max_factorisations = allowance(&certifier, work);
        let settings = CertSettings { max_nodes: NODES, type_nodes: 0, max_factorisations, ..CertSettings::default() };
        certifier.certify(&local, &settings, control).b == BStationarity::Yes
    }

    /// Of every row: above its upper bound (1), below its lower bound (-1), or within what rounding explains (0).
    fn violated(&self, pattern: &Pattern, jac: &[f64], over: &[f64], under: &[f64]) -> Vec<f64> {
        let m = over.len();
        let mut size = vec![0.0; m];
        for (j, x) in self.x.iter().enumerate() {
            for k in pattern.range(j) {
                size[pattern.row_idx()[k]] += (jac[k] * x).abs();
            }
        }
        let beyond = |i: usize, v: f64, bound: f64| v > VIOLATED * (size[i] + bound.abs());
        (0..m)
            .map(|i| {
                if over[i] > 0.0 && beyond(i, over[i], self.bounds.cu[i]) {
                    1.0
                } else if under[i] > 0.0 && beyond(i, under[i], self.bounds.cl[i]) {
                    -1.0
                } else {
                    0.0
                }
            })
            .collect()
    }

    /// Multipliers of the rows of the elastic program: those of violated rows are the weights, the others are those of the
    /// restoration in proportion. `None` where nothing is violated, or the signs say something else.
    fn multipliers(&self, violated: &[f64]) -> Option<Vec<f64>> {
        let of_violated = || violated.iter().zip(self.y.iter().zip(self.weights)).filter(|v| *v.0 != 0.0);
        let weight: f64 = of_violated().map(|(_, (_, w))| w * w).sum();
        let along: f64 = of_violated().map(|(s, (y, w))| s * y * w).sum();
        let factor = weight / along;
        if weight == 0.0 || !factor.is_finite() || factor <= 0.0 {
            return None;
        }
        let one = |(s, (y, w)): (&f64, (&f64, &f64))| if *s == 0.0 { (factor * y).clamp(-w, *w) } else { s * w };
        Some(violated.iter().zip(self.y.iter().zip(self.weights)).map(one).collect())
    }
}

/// The Jacobian of the rows behind which stand those of `p` and `q`.
pub(super) fn elastic_pattern(jac: &Pattern) -> crate::error::Result<Pattern> {
    let (m, n) = (jac.n_rows(), jac.n_cols());
    let mut ptr = jac.col_ptr().to_vec();
    ptr.extend((1..=2 * m).map(|k| jac.nnz() + k));
    let mut rows = jac.row_idx().to_vec();
    rows.extend((0..m).chain(0..m));
    Pattern::new(m, n + 2 * m, ptr, rows)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::func::{Callback, Dims};
    use crate::mpcc::{Lifted, Member};
    use crate::nlp::CallbackNlp;

    /// Does the point `x` show that `c(x) = at` cannot be met, `0 ≤ x_0 ⊥ x_1 ≥ 0` if `pair`?
    fn shows(x: &[f64], at: &[f64], y: &[f64], pair: bool, c: fn(&[f64], &mut [f64])) -> bool {
        let d = Dims { x: x.len(), u: 0, p: 0 };
        let f = Callback::new("f", d, 1, |_, o| {
            o[0] = 0.0;
            0
        });
        let c = Callback::new("c", d, at.len(), move |p, o| {
            c(p.x, o);
            0
        });
        let program = CallbackNlp::new(x.len(), 0, Arc::new(f), Some(Arc::new(c))).unwrap();
        let members = [(Member::Variable(0), Member::Variable(1))];
        let mut p = Lifted::new(program, if pair { &members } else { &[] }).unwrap();
        let mut bounds = Bounds::free(x.len(), at.len());
        (bounds.cl, bounds.cu) = (at.to_vec(), at.to_vec());
        if pair {
            bounds.xl.fill(0.0);
        }
        let weights = vec![1.0; at.len()];
        Claim { x, y, weights: &weights, bounds: &bounds }.holds(&mut p, 0.0, &mut Control::default())
    }

    /// `x² = −1`: the violation is least at 0.
    #[test]
    fn a_minimiser_of_the_violation_shows_it_and_no_other_point() {
        let square = |x: &[f64], c: &mut [f64]| c[0] = x[0] * x[0];
        assert!(shows(&[0.0], &[-1.0], &[1.0], false, square));
        assert!(!shows(&[0.1], &[-1.0], &[1.0], false, square));
        // the factor of the multipliers does not matter, their sign does
        assert!(shows(&[0.0], &[-1.0], &[1e3], false, square));
        assert!(!shows(&[0.0], &[-1.0], &[-1.0], false, square));
        // what is met, or missed by rounding, shows nothing
        assert!(!shows(&[0.0], &[0.0], &[1.0], false, square));
        assert!(!shows(&[1e8], &[1e16 + 2.0], &[-1.0], false, square));
    }

    /// Two rows that contradict each other, in other units as well; multipliers that are missing are found.
    #[test]
    fn rows_that_contradict_each_other_do() {
        let both = |x: &[f64], c: &mut [f64]| {
            c[0] = x[0] + x[1];
            c[1] = x[0] + x[1];
        };
        assert!(shows(&[0.5, 0.5], &[1.0, 3.0], &[0.4, -1.0], false, both));
        assert!(shows(&[0.5, 0.5], &[1.0, 3.0], &[f64::NAN, -1.0], false, both));
        assert!(shows(&[5e5, 5e5], &[1e6, 3e6], &[1.0, -1.0], false, both));
    }

    /// `x_0 = 1`, `x_1 = 1` with `x_0 ⊥ x_1`: one of them can be had. At the origin every relaxation of the pair is
    /// stationary, and both ways on lower the violation.
    #[test]
    fn corners_of_pairs_do_not() {
        let own = |x: &[f64], c: &mut [f64]| c.copy_from_slice(x);
        assert!(!shows(&[0.0, 0.0], &[1.0, 1.0], &[-1.0, -1.0], true, own));
        assert!(shows(&[1.0, 0.0], &[1.0, 1.0], &[0.0, -1.0], true, own));
        assert!(shows(&[0.0, 0.0], &[-1.0, -1.0], &[1.0, 1.0], true, own));
    }
}
