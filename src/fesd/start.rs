//! A starting point for a given active set of every element.

use super::assemble::Sink;
use super::calls::Call;
use super::problem::Fesd;
use crate::linalg::{cholesky, dense};
use crate::mpcc::Side;
use crate::nlp::Nlp;

/// Share of the largest diagonal entry of normal equations that is added to all of them: weights that nothing determines stay as they are.
const UNIQUE: f64 = 1e-10;

/// Entries of the columns of all weights at one point, column by column.
struct WeightColumns<'a> {
    row: usize,
    theta: usize,
    n_rows: usize,
    values: &'a mut [f64],
}

impl Sink for WeightColumns<'_> {
    fn add(&mut self, row: usize, col: usize, v: f64) {
        let at = col.checked_sub(self.theta).map(|c| c * self.n_rows + row - self.row);
        if let Some(value) = at.and_then(|k| self.values.get_mut(k)) {
            *value += v;
        }
    }
}

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

    /// Gives the active cells of a guess whose states are those of a motion the weights of that motion: the equations of the stage points
    /// hold with them, in the sense of least squares with every equation in the unit of its state. Weights stay where functions have no
    /// value or derivative, and where stage values are not the unknowns.
    pub fn fit_weights(&mut self, w: &mut [f64], sides: &[Side]) {
        if !self.l.values_form {
            return;
        }
        let mut rows = vec![0.0; self.l.m];
        // modes are linear in weights and their products, other functions of them need Jacobians
        let included = !self.spec.dcs.form().inclusions.is_empty();
        if self.eval(w, &mut rows).is_err() || included && self.evaluate_jacobians(w).is_err() {
            return;
        }
        let l = &self.l;
        let (n, nx) = (l.n_cells, l.nx);
        let mut residual = vec![0.0; nx];
        let mut by_weight = vec![0.0; l.n_weights * nx];
        for (k, (e, calls)) in l.elements.iter().zip(&self.ecalls).enumerate() {
            let free = self.free_weights(&sides[k * n..(k + 1) * n]);
            if free.is_empty() {
                continue;
            }
            for (i, &theta) in e.theta.iter().enumerate() {
                by_weight.fill(0.0);
                let mut into = WeightColumns { row: e.row_dyn[i], theta, n_rows: nx, values: &mut by_weight };
                self.rhs_jac(e, calls, i, w, &mut into);
                let mut columns = vec![0.0; free.len() * nx];
                for (column, pair) in columns.chunks_exact_mut(nx).zip(&free) {
                    for (slope, values) in self.weight_slopes(*pair, theta, w).iter().zip(by_weight.chunks_exact(nx)) {
                        dense::axpy(*slope, values, column);
                    }
                    column.iter_mut().enumerate().for_each(|(r, v)| *v /= self.size(e.x[i] + r));
                    column[l.z.clone()].fill(0.0);
                }
                for r in self.differential() {
                    residual[r] = rows[e.row_dyn[i] + r] / self.size(e.x[i] + r);
                }
                if let Some(step) = least_squares(&columns, &residual, free.len()) {
                    for (&(c, rest), d) in free.iter().zip(&step) {
                        w[theta + c] += d;
                        rest.into_iter().for_each(|rest| w[theta + rest] -= d);
                    }
                    self.bring_in_range(theta, w);
                }
            }
            self.write_sums(w, e);
        }
    }

    /// Weights that an active set leaves free: cells of a simplex with the one that takes up what they change, and multipliers of
    /// constraints.
    fn free_weights(&self, sides: &[Side]) -> Vec<(usize, Option<usize>)> {
        let form = self.spec.dcs.form();
        let active = |c: &usize| sides[*c] == Side::First;
        let mut free = Vec::new();
        for cells in &form.simplices {
            let mut on = cells.clone().filter(active);
            let rest = on.next();
            free.extend(on.map(|c| (c, rest)));
        }
        free.extend(form.multipliers.iter().cloned().flatten().filter(active).map(|c| (c, None)));
        free
    }

    /// Derivatives of all weights, cells and products, with respect to that of `cell`, which `rest` takes up.
    fn weight_slopes(&self, (cell, rest): (usize, Option<usize>), theta: usize, w: &[f64]) -> Vec<f64> {
        let mut slopes = vec![0.0; self.l.n_weights];
        slopes[cell] = 1.0;
        rest.into_iter().for_each(|rest| slopes[rest] = -1.0);
        for (k, factors) in self.spec.dcs.form().products.iter().enumerate() {
            let others =
                |f: usize| -> f64 { (0..factors.len()).filter(|g| *g != f).map(|g| w[theta + factors[g]]).product() };
            slopes[self.l.n_cells + k] = (0..factors.len()).map(|f| slopes[factors[f]] * others(f)).sum();
        }
        slopes
    }

    /// Moves weights to where they are not negative, those of a simplex with the sum of one.
    fn bring_in_range(&self, theta: usize, w: &mut [f64]) {
        w[theta..theta + self.l.n_cells].iter_mut().for_each(|v| *v = v.max(0.0));
        for cells in &self.spec.dcs.form().simplices {
            let weights = &mut w[theta + cells.start..theta + cells.end];
            let sum: f64 = weights.iter().sum();
            weights.iter_mut().for_each(|v| *v /= sum);
        }
        self.write_products(w, theta);
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

/// The step that makes `residual + columns · step` least, of `n` columns; none where nothing changes it.
fn least_squares(columns: &[f64], residual: &[f64], n: usize) -> Option<Vec<f64>> {
    let column = |a: usize| &columns[a * residual.len()..(a + 1) * residual.len()];
    let mut normal: Vec<f64> = (0..n * n).map(|ab| dense::dot(column(ab / n), column(ab % n))).collect();
    let mut step: Vec<f64> = (0..n).map(|a| -dense::dot(column(a), residual)).collect();
    let largest = (0..n).map(|a| normal[a * (n + 1)]).fold(0.0, f64::max);
    (0..n).for_each(|a| normal[a * (n + 1)] += UNIQUE * largest);
    if !cholesky::factorise(n, &mut normal) {
        return None;
    }
    cholesky::solve(&normal, &mut step);
    step.iter().all(|d| d.is_finite()).then_some(step)
}
