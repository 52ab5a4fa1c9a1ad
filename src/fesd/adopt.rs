//! The solution of one Runge-Kutta method as a starting point for another on the same grid.

use super::problem::Fesd;
use crate::tableau::Family;

impl Fesd {
    /// Are the relaxed problems of this method as good as those of Radau IIA?
    ///
    /// Only a method whose stage values are those of one polynomial through the start, with the end among them, holds a
    /// sliding mode by complementarity at its points alone: others have an equation too many, one too few, or a point that
    /// may lie on the wrong side of the surface. Their active sets are found with such a method in their place.
    pub fn relaxes_well(&self) -> bool {
        !self.l.fesd || self.tableau.family == Family::RadauIia
    }

    /// Writes into `w` the point `from` of `other`, which differs from this problem in the method alone and
    /// [relaxes well](Fesd::relaxes_well): its polynomials at the stage points of this one.
    pub fn adopt(&self, other: &Fesd, from: &[f64], w: &mut [f64]) {
        let (l, o) = (&self.l, &other.l);
        let copy = |w: &mut [f64], to: usize, at: usize, n: usize| w[to..to + n].copy_from_slice(&from[at..at + n]);
        w.fill(0.0);
        for (to, at) in l.params.iter().chain(&l.time).zip(o.params.iter().chain(&o.time)) {
            if let (Some(to), Some(at)) = (*to, *at) {
                w[to] = from[at];
            }
        }
        copy(w, l.x0, o.x0, l.nx);
        for (to, at) in l.starts.iter().zip(&o.starts) {
            copy(w, to.lambda, at.lambda, l.n_cells);
            copy(w, to.mu, at.mu, l.n_mu);
        }
        for (&to, &at) in l.u.iter().zip(&o.u) {
            copy(w, to, at, l.nu);
        }
        let (n, n_o) = (self.tableau.n_s, other.tableau.n_s);
        // weights of the other stages at the stages of this one: in the state, and in what has no initial value
        let (mut of_state, mut of_stage) = (vec![0.0; n * n_o], vec![0.0; n * n_o]);
        for (i, &c) in self.tableau.c.iter().enumerate() {
            let row = i * n_o..(i + 1) * n_o;
            other.tableau.interpolation_weights(c, &mut of_stage[row.clone()]);
            if other.tableau.state_weights(c, &mut of_state[row.clone()]).is_err() {
                of_state[row.clone()].copy_from_slice(&of_stage[row]);
            }
        }
        let a_inv = other.tableau.a_inv.as_deref().unwrap_or(&[]);
        for (e, oe) in l.elements.iter().zip(&o.elements) {
            if let (Some(to), Some(at)) = (e.h, oe.h) {
                w[to] = from[at];
            }
            let h = other.h_of(oe, from).max(f64::MIN_POSITIVE);
            let sum = |weights: &[f64], at: &[usize], r: usize| -> f64 {
                weights.iter().zip(at).map(|(v, &j)| v * from[j + r]).sum()
            };
            for i in 0..n {
                let (states, stages) = (&of_state[i * n_o..(i + 1) * n_o], &of_stage[i * n_o..(i + 1) * n_o]);
                for r in 0..l.nx {
                    let algebraic = l.z.contains(&r);
                    let weights = if algebraic { stages } else { states };
                    let start = from[oe.x_start + r];
                    let rest = if algebraic { 0.0 } else { 1.0 - weights.iter().sum::<f64>() };
                    w[e.x[i] + r] = rest * start + sum(weights, &oe.x, r);
                    if !l.values_form && !algebraic {
                        let slope = |row: &[f64]| -> f64 {
                            row.iter().zip(&oe.x).map(|(a, &j)| a * (from[j + r] - start)).sum::<f64>() / h
                        };
                        w[e.v[i] + r] = stages.iter().zip(a_inv.chunks(n_o)).map(|(v, row)| v * slope(row)).sum();
                    }
                }
                for c in 0..l.n_cells {
                    w[e.theta[i] + c] = sum(stages, &oe.theta, c).max(0.0);
                    w[e.lambda[i] + c] = sum(stages, &oe.lambda, c).max(0.0);
                }
                for k in 0..l.n_mu {
                    w[e.mu[i] + k] = sum(stages, &oe.mu, k);
                }
                self.write_products(w, e.theta[i]);
            }
            if e.row_end.is_some() {
                copy(w, e.x_end, oe.x_end, l.nx);
            }
            if let Some(to) = e.lambda_end {
                copy(w, to, oe.lambda[n_o - 1], l.n_cells);
                copy(w, e.mu_end, oe.mu[n_o - 1], l.n_mu);
            }
            self.write_sums(w, e);
        }
    }
}
