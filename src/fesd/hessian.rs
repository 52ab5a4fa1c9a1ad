//! Hessian of the Lagrangian of the discretised problem: the weights of the model functions, and all entries.

use super::assemble::{add_sym, others, sum_of, Sink};
use super::eta;
use super::problem::{Call, Fesd, Reference};

impl Fesd {
    /// Weights with which the Hessian of every call enters.
    pub(super) fn hessian_weights(&mut self, w: &[f64], obj: f64, y: &[f64]) {
        let mut wgt = std::mem::take(&mut self.cache.wgt);
        wgt.fill(0.0);
        let l = &self.l;
        let form = self.spec.dcs.form();
        let equation = |wgt: &mut [f64], calls: &[Call], k: usize, row: usize| {
            let r = &form.rows[k];
            for (j, v) in r.weights.iter().enumerate() {
                wgt[calls[r.source].wgt + j] += y[row] * v;
            }
        };
        let indicator = |wgt: &mut [f64], calls: &[Call], row: usize| {
            (0..form.rows.len()).for_each(|k| equation(wgt, calls, k, row + k));
        };
        for (s, calls) in l.starts.iter().zip(&self.ind_start) {
            s.rows.iter().enumerate().for_each(|(i, &k)| equation(&mut wgt, calls, k, s.row + i));
        }
        if let Some(row) = l.row_z0 {
            for (d, c) in self.spec.dcs.drifts().iter().zip(&self.drift_start) {
                for (o, &r) in d.rows.iter().enumerate().filter(|(_, r)| l.z.contains(r)) {
                    wgt[c.wgt + o] += y[row + r - l.z.start];
                }
            }
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..self.tableau.n_s {
                let row = e.row_dyn[i];
                let smooth = self.smooth_rows().zip(&ec.drift[i]);
                for (rows, c) in smooth.chain(form.inclusions.iter().zip(&ec.included[i]).map(|(f, c)| (&f.rows, c))) {
                    for (o, &r) in rows.iter().enumerate() {
                        wgt[c.wgt + o] += self.coef(r, h) * y[row + r];
                    }
                }
                for (term, c) in form.terms.iter().zip(&ec.modes[i]) {
                    let nr = term.rows.len();
                    for (mode, weights) in term.weights.iter().enumerate() {
                        for v in weights {
                            for (o, &r) in term.rows.iter().enumerate() {
                                wgt[c.wgt + mode * nr + o] += self.coef(r, h) * y[row + r] * w[e.theta[i] + v];
                            }
                        }
                    }
                }
                indicator(&mut wgt, &ec.ind[i], e.row_alg[i]);
                if let Some(c) = ec.lagrange.get(i) {
                    wgt[c.wgt] += obj * h * self.tableau.b[i];
                }
            }
            if e.lambda_end.is_some() {
                indicator(&mut wgt, &ec.ind_end, e.row_end_alg);
            }
        }
        for (call, row) in self.constraint_calls() {
            for o in 0..self.functions[call.f].n_out() {
                wgt[call.wgt + o] += y[row + o];
            }
        }
        for c in &self.mayer {
            wgt[c.wgt] += obj;
        }
        self.cache.wgt = wgt;
    }

    /// Writes all Hessian entries in a fixed order; the Hessians of the calls are in the cache.
    pub(super) fn hessian_entries<S: Sink>(&self, w: &[f64], obj: f64, y: &[f64], local: &mut [f64], s: &mut S) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        for c in &self.calls {
            for (p, &(col, row)) in self.hess_cols[c.f].iter().enumerate() {
                if let (Some(a), Some(b)) = (self.var(c, row), self.var(c, col)) {
                    add_sym(s, a, b, self.cache.hess[c.hess + p]);
                }
            }
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                let (form, row, theta) = (self.spec.dcs.form(), e.row_dyn[i], e.theta[i]);
                let hv = e.h.filter(|_| l.values_form);
                // the step size is a factor of derivatives only
                let timed = |r: usize| hv.filter(|_| !l.z.contains(&r));
                let smooth = self.smooth_rows().zip(&ec.drift[i]);
                for (rows, c) in smooth.chain(form.inclusions.iter().zip(&ec.included[i]).map(|(f, c)| (&f.rows, c))) {
                    for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                        let r = rows[o as usize];
                        if let (Some(hv), Some(v)) = (timed(r), self.var(c, col)) {
                            add_sym(s, v, hv, -y[row + r] * self.cache.jac[c.jac + p]);
                        }
                    }
                }
                for (term, c) in form.terms.iter().zip(&ec.modes[i]) {
                    let nr = term.rows.len();
                    for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                        let Some(v) = self.var(c, col) else { continue };
                        let (mode, r) = (o as usize / nr, term.rows[o as usize % nr]);
                        let yj = y[row + r] * self.cache.jac[c.jac + p];
                        for k in &term.weights[mode] {
                            add_sym(s, v, theta + k, self.coef(r, h) * yj);
                        }
                        if let Some(hv) = timed(r) {
                            add_sym(s, v, hv, -sum_of(&term.weights[mode], theta, w) * yj);
                        }
                    }
                    let Some(hv) = hv else { continue };
                    for (mode, weights) in term.weights.iter().enumerate() {
                        let timed = term.rows.iter().enumerate().filter(|(_, r)| !l.z.contains(r));
                        let f: f64 = timed.map(|(o, &r)| y[row + r] * self.cache.val[c.val + mode * nr + o]).sum();
                        for k in weights {
                            add_sym(s, theta + k, hv, -f);
                        }
                    }
                }
                for (k, factors) in form.products.iter().enumerate() {
                    for a in 0..factors.len() {
                        for b in 0..a {
                            let v = -y[e.row_prod[i] + k] * others(factors, &[a, b], theta, w);
                            add_sym(s, theta + factors[a], theta + factors[b], v);
                        }
                    }
                }
                if let Some(hv) = hv {
                    for (j, r) in self.linear_controls() {
                        add_sym(s, e.u + j, hv, -y[row + r]);
                    }
                }
                if let (false, Some(hv)) = (l.values_form, e.h) {
                    for j in 0..n_s {
                        if t.a(i, j) != 0.0 {
                            for r in self.differential() {
                                add_sym(s, e.v[j] + r, hv, -y[e.row_conv[i] + r] * t.a(i, j));
                            }
                        }
                    }
                }
                if let (Some(c), Some(hv)) = (ec.lagrange.get(i), e.h) {
                    for (p, &(col, _)) in self.jac_cols[c.f].iter().enumerate() {
                        if let Some(v) = self.var(c, col) {
                            add_sym(s, v, hv, obj * t.b[i] * self.cache.jac[c.jac + p]);
                        }
                    }
                }
            }
            if let (Some(row), false, Some(hv)) = (e.row_end, l.values_form, e.h) {
                for j in 0..n_s {
                    for r in self.differential() {
                        add_sym(s, e.v[j] + r, hv, -y[row + r] * t.b[j]);
                    }
                }
            }
        }
        let rho = 2.0 * obj * self.soft_weight();
        for (a, b) in self.soft_terms() {
            add_sym(s, a, a, rho);
            if let Reference::Variable(b, f) = b {
                add_sym(s, b, b, rho * f * f);
                add_sym(s, a, b, -rho * f);
            }
        }
        let Some(shape) = l.eta else { return };
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, local);
            let weight = b.row_eta.map_or(obj * self.guidance_weight(), |r| y[r]);
            for k in 0..local.len() {
                for j in 0..=k {
                    let v = if weight == 0.0 { 0.0 } else { weight * eta::hessian(shape, l.n_cells, local, j, k) };
                    add_sym(s, self.eta_vars(a, b, j), self.eta_vars(a, b, k), v);
                }
            }
        }
    }
}
