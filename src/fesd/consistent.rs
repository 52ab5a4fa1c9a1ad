//! Members of pairs that fit the states of a starting point.

use super::calls::Call;
use super::problem::Fesd;
use crate::func::EvalResult;

impl Fesd {
    /// Makes the members of path complementarities of `w` what their functions are, or zero where these are negative.
    /// Fails, and leaves them, where a function has no value.
    pub fn write_members(&mut self, w: &mut [f64]) -> EvalResult {
        if self.complementarity.is_empty() {
            return Ok(());
        }
        self.evaluate_values(w)?;
        for (c, &v) in self.complementarity.iter().zip(&self.l.members) {
            let n = self.functions[c.f].n_out();
            w[v..v + n].iter_mut().zip(&self.cache.val[c.val..c.val + n]).for_each(|(w, f)| *w = f.max(0.0));
        }
        Ok(())
    }

    /// Makes all weights and multipliers of `w` those of the relaxed conditions `θ λ = sigma` at its states. Fails, and
    /// leaves them, where a function has no value.
    pub fn relax_pairs(&mut self, w: &mut [f64], sigma: f64) -> EvalResult {
        self.evaluate_values(w)?;
        let (l, form) = (&self.l, self.spec.dcs.form());
        let mut theta = vec![0.0; l.n_weights];
        let (mut lambda, mut mu) = (vec![0.0; l.n_cells], vec![0.0; l.n_mu]);
        let solve = |calls: &[Call], theta: &mut [f64], lambda: &mut [f64], mu: &mut [f64]| {
            let value = |c: &Call, weights: &[f64]| -> f64 {
                weights.iter().enumerate().map(|(j, v)| v * self.cache.val[c.val + j]).sum()
            };
            let rows: Vec<f64> = form.rows.iter().map(|r| value(&calls[r.source], &r.weights)).collect();
            form.relaxed(&rows, sigma, theta, lambda, mu);
        };
        for (s, calls) in l.starts.iter().zip(&self.ind_start) {
            solve(calls, &mut theta, &mut lambda, &mut mu);
            let [cells, mus] = s.members(form);
            cells.into_iter().for_each(|c| w[s.lambda + c] = lambda[c]);
            mus.into_iter().for_each(|m| w[s.mu + m] = mu[m]);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            for i in 0..e.x.len() {
                solve(&ec.ind[i], &mut theta, &mut lambda, &mut mu);
                w[e.theta[i]..e.theta[i] + l.n_weights].copy_from_slice(&theta);
                w[e.lambda[i]..e.lambda[i] + l.n_cells].copy_from_slice(&lambda);
                w[e.mu[i]..e.mu[i] + l.n_mu].copy_from_slice(&mu);
            }
            if let Some(at) = e.lambda_end {
                solve(&ec.ind_end, &mut theta, &mut lambda, &mut mu);
                w[at..at + l.n_cells].copy_from_slice(&lambda);
                w[e.mu_end..e.mu_end + l.n_mu].copy_from_slice(&mu);
            }
            self.write_sums(w, e);
        }
        Ok(())
    }
}
