//! A starting point for a given active set of every element.

use super::calls::Call;
use super::problem::Fesd;
use crate::mpcc::Side;

impl Fesd {
    /// Turns the guess `w` of [`Fesd::guess`] into one on elements of the given lengths with the active set `sides`:
    /// states by `x_at(t, x)` with `t` from the start of the horizon, active cells in equal shares, and the multipliers of
    /// the others by the switching functions there.
    pub fn guess_active_set(
        &mut self,
        w: &mut [f64],
        t0: f64,
        lengths: &[f64],
        sides: &[Side],
        mut x_at: impl FnMut(f64, &mut [f64]),
    ) {
        let nx_user = self.spec.dcs.dims().x;
        let mut t = 0.0;
        for (e, &length) in self.l.elements.iter().zip(lengths) {
            if let Some(j) = e.h {
                w[j] = length;
            }
            let ends = e.row_end.map(|_| (e.x_end, 1.0));
            for (x, c) in e.x.iter().zip(&self.tableau.c).map(|(&x, &c)| (x, c)).chain(ends) {
                x_at(t + c * length, &mut w[x..x + nx_user]);
                if let Some(clock) = self.spec.dcs.clock() {
                    w[x + clock] = t0 + t + c * length;
                }
            }
            t += length;
        }
        // a model without a value there will say so when it is solved
        let known = self.cost(w).is_ok();
        let n = self.l.n_cells;
        for (s, calls) in self.l.starts.iter().zip(&self.ind_start).filter(|_| known) {
            self.multipliers(calls, &sides[s.element * n..(s.element + 1) * n], s.lambda, s.mu, w);
            self.clear_absent(s, w);
        }
        for (k, (e, calls)) in self.l.elements.iter().zip(&self.ecalls).enumerate() {
            let sides = &sides[k * n..(k + 1) * n];
            for (i, &theta) in e.theta.iter().enumerate() {
                self.shares(sides, theta, w);
                if known {
                    self.multipliers(&calls.ind[i], sides, e.lambda[i], e.mu[i], w);
                }
            }
            if let Some(lambda) = e.lambda_end.filter(|_| known) {
                self.multipliers(&calls.ind_end, sides, lambda, e.mu_end, w);
            }
            self.write_sums(w, e);
        }
    }

    /// Equal weights of the active cells.
    fn shares(&self, sides: &[Side], theta: usize, w: &mut [f64]) {
        for cells in &self.spec.dcs.form().simplices {
            let n_active = cells.clone().filter(|&c| sides[c] == Side::First).count().max(1);
            for c in cells.clone() {
                w[theta + c] = if sides[c] == Side::First { 1.0 / n_active as f64 } else { 0.0 };
            }
        }
        for c in self.spec.dcs.form().multipliers.iter().cloned().flatten() {
            w[theta + c] = if sides[c] == Side::First { self.size(theta + c) } else { 0.0 };
        }
        self.write_products(w, theta);
    }

    /// Multipliers by the switching functions evaluated last: zero where the cell is active, not negative elsewhere.
    fn multipliers(&self, calls: &[Call], sides: &[Side], lambda: usize, mu: usize, w: &mut [f64]) {
        let rows = &self.spec.dcs.form().rows;
        let value = |k: usize| -> f64 {
            let val = calls[rows[k].source].val;
            rows[k].weights.iter().enumerate().map(|(j, v)| v * self.cache.val[val + j]).sum()
        };
        w[mu..mu + self.l.n_mu].fill(f64::INFINITY);
        for (k, r) in rows.iter().enumerate() {
            if let Some(m) = r.mu.filter(|_| r.lambda.iter().any(|&(c, _)| sides[c] == Side::First)) {
                w[mu + m] = w[mu + m].min(value(k));
            }
        }
        for v in w[mu..mu + self.l.n_mu].iter_mut().filter(|v| !v.is_finite()) {
            *v = 0.0;
        }
        for (k, r) in rows.iter().enumerate() {
            let rest = value(k) - r.mu.map_or(0.0, |m| w[mu + m]);
            for &(c, factor) in &r.lambda {
                w[lambda + c] = if sides[c] == Side::First { 0.0 } else { (-rest / factor).max(0.0) };
            }
        }
    }
}
