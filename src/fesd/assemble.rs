//! Rows and Jacobian of the discretised problem out of the cached values of the model functions.
//!
//! One traversal writes every derivative entry; run once with a recorder it gives the pattern, run with the map of that
//! pattern it fills the values, so the two cannot drift apart.

use super::eta::{self, Shape};
use super::layout::ElementIndex;
use super::problem::{Call, ElementCalls, Fesd};
use crate::dcs::IndicatorRow;
use crate::memory;
use crate::tableau::{Family, Tableau};

/// Receives the entries of a sparse matrix in a fixed order.
pub(super) trait Sink {
    fn add(&mut self, row: usize, col: usize, v: f64);
}

#[derive(Default)]
pub(super) struct Recorder {
    pub rows: Vec<usize>,
    pub cols: Vec<usize>,
}

impl Sink for Recorder {
    fn add(&mut self, row: usize, col: usize, _: f64) {
        memory::room(&mut self.rows, 1);
        memory::room(&mut self.cols, 1);
        self.rows.push(row);
        self.cols.push(col);
    }
}

pub(super) struct Writer<'a> {
    pub map: &'a [u32],
    pub k: usize,
    pub values: &'a mut [f64],
}

impl Sink for Writer<'_> {
    #[inline]
    fn add(&mut self, _: usize, _: usize, v: f64) {
        self.values[self.map[self.k] as usize] += v;
        self.k += 1;
    }
}

/// Adds to the upper triangle.
#[inline]
pub(super) fn add_sym<S: Sink>(sink: &mut S, i: usize, j: usize, v: f64) {
    if i <= j {
        sink.add(i, j, v);
    } else {
        sink.add(j, i, v);
    }
}

impl Fesd {
    /// Variable behind input column `col` of a call; none for constants.
    #[inline]
    pub(super) fn var(&self, c: &Call, col: u32) -> Option<usize> {
        let j = self.inputs[c.inputs + col as usize] as usize;
        (j < self.l.n).then_some(j)
    }

    /// `out[r]` = right-hand side at stage point `i` of an element.
    pub(super) fn rhs(&self, e: &ElementIndex, ec: &ElementCalls, i: usize, w: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (rows, c) in self.smooth_rows().zip(&ec.drift[i]) {
            for (o, &r) in rows.iter().enumerate() {
                out[r] += self.cache.val[c.val + o];
            }
        }
        let (form, theta) = (self.spec.dcs.form(), e.theta[i]);
        for (term, c) in form.terms.iter().zip(&ec.modes[i]) {
            let nr = term.rows.len();
            for (mode, weights) in term.weights.iter().enumerate() {
                for v in weights {
                    for (o, &r) in term.rows.iter().enumerate() {
                        out[r] += w[theta + v] * self.cache.val[c.val + mode * nr + o];
                    }
                }
            }
        }
        for (f, c) in form.inclusions.iter().zip(&ec.included[i]) {
            for (o, &r) in f.rows.iter().enumerate() {
                out[r] += self.cache.val[c.val + o];
            }
        }
        if let Some(k) = self.spec.dcs.clock() {
            out[k] = 1.0;
        }
        for (j, r) in self.linear_controls() {
            out[r] = w[e.u + j];
        }
    }

    /// The states driven by the calls [`ElementCalls::drift`] of a point.
    pub(super) fn smooth_rows(&self) -> impl Iterator<Item = &Vec<usize>> {
        let dcs = &self.spec.dcs;
        let apart = if dcs.combined().is_some() { &[][..] } else { dcs.drifts() };
        dcs.combined().map(|c| &c.rows).into_iter().chain(apart.iter().map(|d| &d.rows))
    }

    /// Controls that are states: their numbers as controls and as states.
    pub(super) fn linear_controls(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.l.linear.iter().enumerate().filter_map(|(j, r)| r.map(|r| (j, r)))
    }

    /// Factor of the right-hand side in the rows of state `r`: there is no step size where it is a residual.
    #[inline]
    pub(super) fn coef(&self, r: usize, h: f64) -> f64 {
        if self.l.values_form && !self.l.z.contains(&r) {
            -h
        } else {
            -1.0
        }
    }

    /// States with a derivative.
    pub(super) fn differential(&self) -> impl Iterator<Item = usize> + Clone {
        (0..self.l.z.start).chain(self.l.z.end..self.l.nx)
    }

    /// The equations of the multipliers at one point.
    fn indicator_rows(&self, calls: &[Call], row: usize, lambda: usize, mu: usize, w: &[f64], c: &mut [f64]) {
        let rows = &self.spec.dcs.form().rows;
        c[row..row + rows.len()]
            .iter_mut()
            .zip(rows)
            .for_each(|(c, r)| *c = self.indicator_row(calls, r, lambda, mu, w));
    }

    fn indicator_row(&self, calls: &[Call], r: &IndicatorRow, lambda: usize, mu: usize, w: &[f64]) -> f64 {
        let val = calls[r.source].val;
        let g: f64 = r.weights.iter().enumerate().map(|(j, v)| v * self.cache.val[val + j]).sum();
        let multipliers = r.lambda.iter().fold(g, |g, &(cell, v)| g + v * w[lambda + cell]);
        r.mu.map_or(multipliers, |m| multipliers - w[mu + m])
    }

    pub(super) fn constraint_values(&self, w: &[f64], c: &mut [f64], f: &mut [f64], local: &mut [f64]) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        let rows = &self.spec.dcs.form().rows;
        for (s, calls) in l.starts.iter().zip(&self.ind_start) {
            for (i, &k) in s.rows.iter().enumerate() {
                c[s.row + i] = self.indicator_row(calls, &rows[k], s.lambda, s.mu, w);
            }
        }
        if let Some(row) = l.row_z0 {
            c[row..row + l.z.len()].fill(0.0);
            for (d, call) in self.spec.dcs.drifts().iter().zip(&self.drift_start) {
                for (o, &r) in d.rows.iter().enumerate().filter(|(_, r)| l.z.contains(r)) {
                    c[row + r - l.z.start] += self.cache.val[call.val + o];
                }
            }
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                self.rhs(e, ec, i, w, f);
                for r in l.z.clone() {
                    c[e.row_dyn[i] + r] = -f[r];
                    if !l.values_form {
                        c[e.row_conv[i] + r] = w[e.v[i] + r];
                    }
                }
                for r in self.differential() {
                    let xs = w[e.x_start + r];
                    if l.values_form {
                        let a_inv = t.a_inv.as_deref().unwrap_or(&[]);
                        let d: f64 = (0..n_s).map(|j| a_inv[i * n_s + j] * (w[e.x[j] + r] - xs)).sum();
                        c[e.row_dyn[i] + r] = d - h * f[r];
                    } else {
                        let d: f64 = (0..n_s).map(|j| t.a(i, j) * w[e.v[j] + r]).sum();
                        c[e.row_dyn[i] + r] = w[e.v[i] + r] - f[r];
                        c[e.row_conv[i] + r] = w[e.x[i] + r] - xs - h * d;
                    }
                }
                self.indicator_rows(&ec.ind[i], e.row_alg[i], e.lambda[i], e.mu[i], w, c);
                let (form, theta) = (self.spec.dcs.form(), e.theta[i]);
                for (k, cells) in form.simplices.iter().enumerate() {
                    c[e.row_norm[i] + k] = w[theta + cells.start..theta + cells.end].iter().sum::<f64>() - 1.0;
                }
                for (k, factors) in form.products.iter().enumerate() {
                    let product: f64 = factors.iter().map(|v| w[theta + v]).product();
                    c[e.row_prod[i] + k] = w[theta + l.n_cells + k] - product;
                }
            }
            if let Some(row) = e.row_end {
                for r in 0..l.nx {
                    let xs = w[e.x_start + r];
                    let step: f64 = if l.values_form || l.z.contains(&r) {
                        (0..n_s).map(|j| self.end_weights[j] * (w[e.x[j] + r] - xs)).sum()
                    } else {
                        h * (0..n_s).map(|j| t.b[j] * w[e.v[j] + r]).sum::<f64>()
                    };
                    c[row + r] = w[e.x_end + r] - xs - step;
                }
            }
            if let Some(lam) = e.lambda_end {
                self.indicator_rows(&ec.ind_end, e.row_end_alg, lam, e.mu_end, w, c);
            }
            if let Some(row) = e.row_sum_theta {
                for k in 0..l.n_cells {
                    c[row + k] = w[e.sum_theta + k] - e.theta.iter().map(|&j| w[j + k]).sum::<f64>();
                }
            }
            if let Some(row) = e.row_sum_lambda {
                for k in 0..l.n_cells {
                    c[row + k] = w[e.sum_lambda + k] - l.lambdas(e, k).map(|j| w[j + k]).sum::<f64>();
                }
            }
            for (row, weights) in [(e.row_first, &self.first), (e.row_last, &self.last)] {
                let Some(row) = row else { continue };
                for k in 0..l.n_cells {
                    c[row + k] = e.theta.iter().zip(weights).map(|(&j, d)| d * w[j + k]).sum();
                }
            }
            if let (Some(row), Some(start)) = (e.row_slope, e.lambda_start) {
                for k in 0..l.n_cells {
                    let points = std::iter::once(&start).chain(&e.lambda);
                    c[row + k] = points.chain(&e.lambda_end).zip(&self.slope).map(|(&j, d)| d * w[j + k]).sum();
                }
            }
        }
        for (k, &row) in l.row_time.iter().enumerate() {
            let free = self.free_length(k).map_or(0.0, |(v, share)| share * w[v]);
            c[row] = l.stage(k).iter().map(|e| self.h_of(e, w)).sum::<f64>() - free;
        }
        for e in &l.elements {
            let (Some((v, share)), Some(hv)) = (self.free_length(e.stage), e.h) else { continue };
            for (row, factor) in self.length_rows(e) {
                c[row] = w[hv] - factor * share * w[v];
            }
        }
        for (i, p) in l.elements.windows(2).enumerate() {
            if let (Some(row), Some(shape)) = (p[1].row_eta, l.eta) {
                self.load_eta(&p[0], &p[1], w, local);
                c[row] = eta::value(shape, l.n_cells, local);
            }
            if let Some(row) = p[1].row_equal {
                c[row] = self.h_of(&p[1], w) - self.ratio(i + 1) * self.h_of(&p[0], w);
            }
        }
        for (call, row) in self.constraint_calls() {
            let n = self.functions[call.f].n_out();
            c[row..row + n].copy_from_slice(&self.cache.val[call.val..call.val + n]);
        }
        for (row, v) in self.members() {
            c[row] -= w[v];
        }
    }

    /// Rows that tie members of path complementarities to their functions, and the members.
    pub(super) fn members(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let places = self.complementarity.iter().zip(self.l.row_members.iter().zip(&self.l.members));
        places.flat_map(|(c, (&r, &v))| (0..self.functions[c.f].n_out()).map(move |i| (r + i, v + i)))
    }

    /// Constraints that are functions alone, and their first rows.
    pub(super) fn constraint_calls(&self) -> impl Iterator<Item = (&Call, usize)> {
        let ends = self.terminal.iter().zip(&self.l.row_terminal);
        let both = self.boundary.iter().zip(&self.l.row_boundary);
        let pairs = self.complementarity.iter().zip(&self.l.row_members);
        self.path.iter().zip(&self.path_rows).chain(ends).chain(both).chain(pairs).map(|(c, &r)| (c, r))
    }

    /// Rows `h − f T_k` of an element, with `f`.
    fn length_rows(&self, e: &ElementIndex) -> impl Iterator<Item = (usize, f64)> {
        let (h, g) = (1.0 / self.spec.n_fe[e.stage] as f64, self.spec.options.gamma_h);
        let range = e.row_range.map(|r| [(r, (1.0 - g) * h), (r + 1, (1.0 + g) * h)]);
        e.row_tied.map(|r| (r, h)).into_iter().chain(range.into_iter().flatten())
    }

    /// Local variables of the η term between two elements.
    pub(super) fn eta_vars(&self, a: &ElementIndex, b: &ElementIndex, k: usize) -> usize {
        let n = self.l.n_cells;
        match (k / n.max(1), k % n.max(1)) {
            (0, i) => a.sum_lambda + i,
            (1, i) => b.sum_lambda + i,
            (2, i) => a.sum_theta + i,
            (3, i) => b.sum_theta + i,
            (_, i) => if i == 0 { a.h } else { b.h }.unwrap_or(0),
        }
    }

    /// Neighbouring elements of one control stage with an η term between them.
    pub(super) fn eta_pairs(&self) -> impl Iterator<Item = (&ElementIndex, &ElementIndex)> {
        let on = self.l.eta.is_some();
        self.l.elements.windows(2).filter(move |p| on && p[1].n > 0).map(|p| (&p[0], &p[1]))
    }

    /// The shape of the η terms where they are penalties.
    pub(super) fn eta_penalty(&self) -> Option<Shape> {
        self.l.eta.filter(|s| *s != Shape::Equation)
    }

    /// Weight of what guides steps outside of the polish.
    pub(super) fn guidance_weight(&self) -> f64 {
        if self.polishing {
            0.0
        } else {
            self.guidance_unit * self.spec.options.rho_h
        }
    }

    pub(super) fn eta_value(&self, w: &[f64], local: &mut [f64]) -> f64 {
        let Some(shape) = self.eta_penalty() else { return 0.0 };
        let mut sum = 0.0;
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, local);
            sum += eta::value(shape, self.l.n_cells, local);
        }
        self.guidance_weight() * sum
    }

    pub(super) fn load_eta(&self, a: &ElementIndex, b: &ElementIndex, w: &[f64], out: &mut [f64]) {
        for (k, o) in out.iter_mut().enumerate() {
            *o = w[self.eta_vars(a, b, k)];
        }
    }

    fn indicator_jac<S: Sink>(&self, calls: &[Call], row: usize, lambda: usize, mu: usize, s: &mut S) {
        let all = 0..self.spec.dcs.form().rows.len();
        self.indicator_rows_jac(calls, all.map(|k| (row + k, k)), lambda, mu, s);
    }

    /// Of the equations `k` in the rows given with them.
    fn indicator_rows_jac<S: Sink>(
        &self,
        calls: &[Call],
        rows: impl Iterator<Item = (usize, usize)>,
        lambda: usize,
        mu: usize,
        s: &mut S,
    ) {
        for (row, k) in rows {
            let r = &self.spec.dcs.form().rows[k];
            let call = &calls[r.source];
            for (p, &(col, o)) in self.jac_cols[call.f].iter().enumerate() {
                let weight = r.weights[o as usize];
                if let (Some(v), true) = (self.var(call, col), weight != 0.0) {
                    s.add(row, v, weight * self.cache.jac[call.jac + p]);
                }
            }
            for &(cell, v) in &r.lambda {
                s.add(row, lambda + cell, v);
            }
            if let Some(m) = r.mu {
                s.add(row, mu + m, -1.0);
            }
        }
    }

    /// Writes all Jacobian entries in a fixed order.
    pub(super) fn jacobian_entries<S: Sink>(&self, w: &[f64], f: &mut [f64], local: &mut [f64], s: &mut S) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        for (start, calls) in l.starts.iter().zip(&self.ind_start) {
            let rows = start.rows.iter().enumerate().map(|(i, &k)| (start.row + i, k));
            self.indicator_rows_jac(calls, rows, start.lambda, start.mu, s);
        }
        if let Some(row) = l.row_z0 {
            for (d, c) in self.spec.dcs.drifts().iter().zip(&self.drift_start) {
                for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                    let r = d.rows[o as usize];
                    if let (Some(v), true) = (self.var(c, col), l.z.contains(&r)) {
                        s.add(row + r - l.z.start, v, self.cache.jac[c.jac + p]);
                    }
                }
            }
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                let row = e.row_dyn[i];
                self.rhs_jac(e, ec, i, w, s);
                if l.values_form {
                    if let Some(hv) = e.h {
                        self.rhs(e, ec, i, w, f);
                        for r in self.differential() {
                            s.add(row + r, hv, -f[r]);
                        }
                    }
                    let a_inv = t.a_inv.as_deref().unwrap_or(&[]);
                    for r in self.differential() {
                        let mut sum = 0.0;
                        for j in 0..n_s {
                            s.add(row + r, e.x[j] + r, a_inv[i * n_s + j]);
                            sum += a_inv[i * n_s + j];
                        }
                        s.add(row + r, e.x_start + r, -sum);
                    }
                } else {
                    for r in l.z.clone() {
                        s.add(e.row_conv[i] + r, e.v[i] + r, 1.0);
                    }
                    for r in self.differential() {
                        s.add(row + r, e.v[i] + r, 1.0);
                        let conv = e.row_conv[i] + r;
                        s.add(conv, e.x[i] + r, 1.0);
                        s.add(conv, e.x_start + r, -1.0);
                        let mut sum = 0.0;
                        for j in 0..n_s {
                            if t.a(i, j) != 0.0 {
                                s.add(conv, e.v[j] + r, -h * t.a(i, j));
                                sum += t.a(i, j) * w[e.v[j] + r];
                            }
                        }
                        if let Some(hv) = e.h {
                            s.add(conv, hv, -sum);
                        }
                    }
                }
                self.indicator_jac(&ec.ind[i], e.row_alg[i], e.lambda[i], e.mu[i], s);
                let (form, theta) = (self.spec.dcs.form(), e.theta[i]);
                for (k, cells) in form.simplices.iter().enumerate() {
                    for v in cells.clone() {
                        s.add(e.row_norm[i] + k, theta + v, 1.0);
                    }
                }
                for (k, factors) in form.products.iter().enumerate() {
                    s.add(e.row_prod[i] + k, theta + l.n_cells + k, 1.0);
                    for (a, &v) in factors.iter().enumerate() {
                        s.add(e.row_prod[i] + k, theta + v, -others(factors, &[a], theta, w));
                    }
                }
            }
            if let Some(row) = e.row_end {
                for r in 0..l.nx {
                    s.add(row + r, e.x_end + r, 1.0);
                    let mut sum = 0.0;
                    let by_value = l.values_form || l.z.contains(&r);
                    for j in 0..n_s {
                        if by_value {
                            let d = self.end_weights[j];
                            s.add(row + r, e.x[j] + r, -d);
                            sum += d;
                        } else {
                            s.add(row + r, e.v[j] + r, -h * t.b[j]);
                            sum += t.b[j] * w[e.v[j] + r];
                        }
                    }
                    if by_value {
                        s.add(row + r, e.x_start + r, sum - 1.0);
                    } else {
                        s.add(row + r, e.x_start + r, -1.0);
                        if let Some(hv) = e.h {
                            s.add(row + r, hv, -sum);
                        }
                    }
                }
            }
            if let Some(lam) = e.lambda_end {
                self.indicator_jac(&ec.ind_end, e.row_end_alg, lam, e.mu_end, s);
            }
            for c in 0..l.n_cells {
                if let Some(row) = e.row_sum_theta {
                    s.add(row + c, e.sum_theta + c, 1.0);
                    for &j in &e.theta {
                        s.add(row + c, j + c, -1.0);
                    }
                }
                if let Some(row) = e.row_sum_lambda {
                    s.add(row + c, e.sum_lambda + c, 1.0);
                    for j in l.lambdas(e, c) {
                        s.add(row + c, j + c, -1.0);
                    }
                }
                for (row, weights) in [(e.row_first, &self.first), (e.row_last, &self.last)] {
                    let Some(row) = row else { continue };
                    for (&j, &d) in e.theta.iter().zip(weights) {
                        s.add(row + c, j + c, d);
                    }
                }
                if let (Some(row), Some(start)) = (e.row_slope, e.lambda_start) {
                    for (&j, &d) in std::iter::once(&start).chain(&e.lambda).chain(&e.lambda_end).zip(&self.slope) {
                        if d != 0.0 {
                            s.add(row + c, j + c, d);
                        }
                    }
                }
            }
        }
        for e in &l.elements {
            let Some(hv) = e.h else { continue };
            let free = self.free_length(e.stage);
            if let Some(&row) = l.row_time.get(e.stage) {
                s.add(row, hv, 1.0);
                if let (Some((v, share)), 0) = (free, e.n) {
                    s.add(row, v, -share);
                }
            }
            if let Some((v, share)) = free {
                for (row, factor) in self.length_rows(e) {
                    s.add(row, hv, 1.0);
                    s.add(row, v, -factor * share);
                }
            }
        }
        for (i, p) in l.elements.windows(2).enumerate() {
            if let (Some(row), Some(shape)) = (p[1].row_eta, l.eta) {
                self.load_eta(&p[0], &p[1], w, local);
                for k in 0..local.len() {
                    s.add(row, self.eta_vars(&p[0], &p[1], k), eta::gradient(shape, l.n_cells, local, k));
                }
            }
            if let (Some(row), Some(a), Some(b)) = (p[1].row_equal, p[0].h, p[1].h) {
                s.add(row, b, 1.0);
                s.add(row, a, -self.ratio(i + 1));
            }
        }
        for (call, row) in self.constraint_calls() {
            for (p, &(col, o)) in self.jac_cols[call.f].iter().enumerate() {
                if let Some(v) = self.var(call, col) {
                    s.add(row + o as usize, v, self.cache.jac[call.jac + p]);
                }
            }
        }
        for (row, v) in self.members() {
            s.add(row, v, -1.0);
        }
    }

    /// Derivatives of the right-hand side in the rows of stage point `i` with respect to its inputs and `θ`.
    pub(super) fn rhs_jac<S: Sink>(&self, e: &ElementIndex, ec: &ElementCalls, i: usize, w: &[f64], s: &mut S) {
        let (form, row, theta) = (self.spec.dcs.form(), e.row_dyn[i], e.theta[i]);
        let h = self.h_of(e, w);
        let smooth = self.smooth_rows().zip(&ec.drift[i]);
        for (rows, c) in smooth.chain(form.inclusions.iter().zip(&ec.included[i]).map(|(f, c)| (&f.rows, c))) {
            for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    let r = rows[o as usize];
                    s.add(row + r, v, self.coef(r, h) * self.cache.jac[c.jac + p]);
                }
            }
        }
        for (term, c) in form.terms.iter().zip(&ec.modes[i]) {
            let nr = term.rows.len();
            for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    let (mode, r) = (o as usize / nr, term.rows[o as usize % nr]);
                    let weight = sum_of(&term.weights[mode], theta, w);
                    s.add(row + r, v, self.coef(r, h) * weight * self.cache.jac[c.jac + p]);
                }
            }
            for (mode, weights) in term.weights.iter().enumerate() {
                for v in weights {
                    for (o, &r) in term.rows.iter().enumerate() {
                        s.add(row + r, theta + v, self.coef(r, h) * self.cache.val[c.val + mode * nr + o]);
                    }
                }
            }
        }
        for (j, r) in self.linear_controls() {
            s.add(row + r, e.u + j, self.coef(r, h));
        }
    }
}

/// Sum of some weights at a stage point.
#[inline]
pub(super) fn sum_of(weights: &[usize], theta: usize, w: &[f64]) -> f64 {
    weights.iter().map(|v| w[theta + v]).sum()
}

/// Product of all factors but those at the places `skip`.
pub(super) fn others(factors: &[usize], skip: &[usize], theta: usize, w: &[f64]) -> f64 {
    factors.iter().enumerate().filter(|(k, _)| !skip.contains(k)).map(|(_, v)| w[theta + v]).product()
}

/// Weights of the values at the stage points in the first less the polynomial through the others.
pub(super) fn first_weights(tableau: &Tableau) -> Vec<f64> {
    let c = &tableau.c;
    let lagrange =
        |j: usize| -> f64 { (1..c.len()).filter(|&k| k != j).map(|k| (c[0] - c[k]) / (c[j] - c[k])).product() };
    (0..c.len()).map(|j| if j == 0 { 1.0 } else { -lagrange(j) }).collect()
}

/// Weights of `λ` at the start, the stage points and the end of an element in its slope at the start: the derivative
/// at 0 of the polynomial through the start and the stage points behind it. An explicit method knows the slope from the
/// first point its first stage leads to.
pub(super) fn slope_weights(tableau: &Tableau) -> Vec<f64> {
    let c = &tableau.c;
    let mut out = vec![0.0; c.len() + 2];
    if tableau.family == Family::Explicit {
        let (first, at) = c.iter().enumerate().find(|(_, &c)| c > 0.0).map_or((c.len(), 1.0), |(i, &c)| (i, c));
        out[0] = -1.0 / at;
        out[first + 1] = 1.0 / at;
        return out;
    }
    // a method whose only stage is at the start knows the end
    let ends = if c.iter().all(|c| *c == 0.0) { Some((c.len() + 1, 1.0)) } else { None };
    let behind = c.iter().enumerate().filter(|(_, c)| **c > 0.0).map(|(i, c)| (i + 1, *c));
    let nodes: Vec<(usize, f64)> = std::iter::once((0, 0.0)).chain(behind).chain(ends).collect();
    let others = |j: usize| nodes.iter().enumerate().filter(move |&(k, _)| k != j).map(|(_, v)| v.1);
    for (j, &(place, node)) in nodes.iter().enumerate() {
        out[place] = match j {
            0 => -others(0).map(|v| 1.0 / v).sum::<f64>(),
            _ => {
                let inner: f64 = others(j).filter(|&v| v != 0.0).map(|v| -v / (node - v)).product();
                inner / node
            }
        };
    }
    out
}
