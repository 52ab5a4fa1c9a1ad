//! Sizes of the variables of a discretised problem, from those of the quantities of the model.

use super::problem::Fesd;

/// Sizes that quantities of the model usually have, all positive: of the states `[nx]`, the controls `[nu]`, the
/// parameters `[np]`, and the switching functions (or indicators) of all subsystems that switch, one after the other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sizes {
    /// States.
    pub x: Vec<f64>,
    /// Controls.
    pub u: Vec<f64>,
    /// Parameters.
    pub p: Vec<f64>,
    /// Switching functions; what is behind the end has the size 1.
    pub psi: Vec<f64>,
}

impl Fesd {
    /// Sets the sizes the solver measures the variables by; without them all are 1. Weights have the size 1, those that
    /// push the size that moves states by theirs over the horizon, multipliers that of their indicators, lengths that of the steps of an equidistant grid.
    pub fn set_sizes(&mut self, sizes: &Sizes) {
        self.spec.dcs.measure(&sizes.psi);
        let l = &self.l;
        let mut w = vec![1.0; l.n];
        let horizon: f64 = self.durations.iter().sum();
        for (v, size) in l.params.iter().zip(&sizes.p) {
            if let Some(j) = *v {
                w[j] = *size;
            }
        }
        let put_x = |w: &mut [f64], at: usize, unit: f64| {
            w[at..at + sizes.x.len()].iter_mut().zip(&sizes.x).for_each(|(w, s)| *w = s / unit);
            if let Some(c) = self.spec.dcs.clock() {
                w[at + c] = horizon / unit;
            }
            for (r, s) in l.linear.iter().zip(&sizes.u) {
                if let Some(r) = *r {
                    w[at + r] = s / unit;
                }
            }
        };
        let (lambda, mu) = self.multiplier_sizes(&sizes.psi);
        let pushes = self.push_sizes(sizes, horizon);
        let put = |w: &mut [f64], at: usize, values: &[f64]| w[at..at + values.len()].copy_from_slice(values);
        put_x(&mut w, l.x0, 1.0);
        for s in &l.starts {
            put(&mut w, s.lambda, &lambda);
            put(&mut w, s.mu, &mu);
        }
        for (k, &u) in l.u.iter().enumerate() {
            for (j, s) in sizes.u.iter().enumerate() {
                let rate = l.linear.get(j).is_some_and(Option::is_some);
                w[u + j] = if rate { s / self.durations[k] } else { *s };
            }
            if let Some((v, share)) = self.free_length(k) {
                w[v] = self.durations[k] / share;
            }
        }
        for e in &l.elements {
            if let Some(j) = e.h {
                w[j] = self.h_nominal(e.stage);
            }
            for i in 0..e.x.len() {
                put_x(&mut w, e.x[i], 1.0);
                if let Some(&v) = e.v.get(i) {
                    put_x(&mut w, v, horizon);
                }
                put(&mut w, e.lambda[i], &lambda);
                put(&mut w, e.mu[i], &mu);
                pushes.iter().for_each(|&(c, size)| w[e.theta[i] + c] = size);
            }
            if l.sums {
                pushes.iter().for_each(|&(c, size)| w[e.sum_theta + c] = size);
            }
            if e.row_end.is_some() {
                put_x(&mut w, e.x_end, 1.0);
            }
            if let Some(j) = e.lambda_end {
                put(&mut w, j, &lambda);
                put(&mut w, e.mu_end, &mu);
            }
            if e.row_sum_lambda.is_some() {
                put(&mut w, e.sum_lambda, &lambda);
            }
        }
        self.sizes = w;
    }

    /// Makes all sizes 1.
    pub fn forget_sizes(&mut self) {
        self.sizes.clear();
        self.guidance_unit = 1.0;
        self.spec.dcs.measure(&[]);
    }

    /// Makes the penalties on step sizes a share of the cost, whose steepest change in variables of their sizes is told: a step
    /// that differs from its reference by a usual one costs `rho_h` times that. Only where there are sizes.
    pub(super) fn measure_guidance(&mut self, steepest: f64) {
        let steps = self.l.elements.iter().filter(|e| e.h.is_some()).map(|e| self.h_nominal(e.stage));
        let (n, sum) = steps.fold((0.0, 0.0), |(n, sum), h| (n + 1.0, sum + h));
        if n > 0.0 && !self.sizes.is_empty() {
            self.guidance_unit = steepest * (n / sum).powi(2);
        }
    }

    /// Cells whose weights push, and the sizes of these: `ẋ = ∇c λ` moves a state of size `s` by that over the horizon `T` with
    /// `λ = s²/(c T)`.
    fn push_sizes(&self, sizes: &Sizes, horizon: f64) -> Vec<(usize, f64)> {
        let form = self.spec.dcs.form();
        let mut out = Vec::new();
        let (nx, lambda) = (sizes.x.len(), self.multiplier_sizes(&sizes.psi).0);
        for cells in &form.multipliers {
            let Some(i) = form.inclusions.iter().find(|i| i.alpha.first() == Some(&cells.start)) else { continue };
            for (k, c) in cells.clone().enumerate() {
                let pushed = i.f.jac_pattern().rows(nx + k).iter().filter_map(|&o| sizes.x.get(i.rows[o]));
                let most = pushed.fold(0.0, |m: f64, s| m.max(*s));
                out.push((c, if most > 0.0 { most * most / (lambda[c] * horizon) } else { 1.0 }));
            }
        }
        out
    }

    /// Sizes of `λ` and `μ` at a point.
    fn multiplier_sizes(&self, psi: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let form = self.spec.dcs.form();
        let mut first = 0;
        let firsts: Vec<usize> = form
            .sources
            .iter()
            .map(|f| {
                first += f.n_out();
                first - f.n_out()
            })
            .collect();
        let (mut lambda, mut mu) = (vec![0f64; form.n_cells], vec![0f64; form.n_mu]);
        for r in &form.rows {
            let of = |(j, v): (usize, &f64)| v.abs() * psi.get(firsts[r.source] + j).copied().unwrap_or(1.0);
            let size = r.weights.iter().enumerate().map(of).fold(0.0, f64::max);
            r.lambda.iter().for_each(|&(c, _)| lambda[c] = lambda[c].max(size));
            r.mu.iter().for_each(|&m| mu[m] = mu[m].max(size));
        }
        (lambda, mu)
    }
}
