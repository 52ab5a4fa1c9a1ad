//! Rows, Jacobian and Hessian of the discretised problem out of the cached values of the model functions.
//!
//! One traversal writes every derivative entry; run once with a recorder it gives the pattern, run with the map of that
//! pattern it fills the values, so the two cannot drift apart.

use super::eta;
use super::layout::ElementIndex;
use super::problem::{Call, ElementCalls, Fesd, Reference};

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
        for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
            for (o, &r) in d.rows.iter().enumerate() {
                out[r] += self.cache.val[c.val + o];
            }
        }
        let mut theta = e.theta[i];
        for (s, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
            let nr = s.rows.len();
            for cell in &s.cells {
                for (o, &r) in s.rows.iter().enumerate() {
                    out[r] += w[theta] * self.cache.val[c.val + cell.mode * nr + o];
                }
                theta += 1;
            }
        }
        if let Some(k) = self.spec.dcs.clock() {
            out[k] = 1.0;
        }
        for (j, r) in self.linear_controls() {
            out[r] = w[e.u + j];
        }
    }

    /// Controls that are states: their numbers as controls and as states.
    fn linear_controls(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.l.linear.iter().enumerate().filter_map(|(j, r)| r.map(|r| (j, r)))
    }

    /// Rows `g − λ − μ e` at one point.
    pub(super) fn indicator_rows(
        &self,
        calls: &[Call],
        row: usize,
        lambda: usize,
        mu: usize,
        w: &[f64],
        c: &mut [f64],
    ) {
        let mut cell_index = 0;
        for (k, (s, call)) in self.spec.dcs.subsystems().iter().zip(calls).enumerate() {
            for cell in &s.cells {
                let g: f64 = cell.weights.iter().enumerate().map(|(j, v)| v * self.cache.val[call.val + j]).sum();
                c[row + cell_index] = g - w[lambda + cell_index] - w[mu + k];
                cell_index += 1;
            }
        }
    }

    pub(super) fn constraint_values(&self, w: &[f64], c: &mut [f64], f: &mut [f64]) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        if let Some(lam) = l.lambda0 {
            self.indicator_rows(&self.ind_start, l.row_alg0, lam, l.mu0, w, c);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                self.rhs(e, ec, i, w, f);
                for r in 0..l.nx {
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
                let mut theta = e.theta[i];
                for (k, s) in self.spec.dcs.subsystems().iter().enumerate() {
                    c[e.row_norm[i] + k] = w[theta..theta + s.cells.len()].iter().sum::<f64>() - 1.0;
                    theta += s.cells.len();
                }
            }
            if let Some(row) = e.row_end {
                for r in 0..l.nx {
                    let xs = w[e.x_start + r];
                    let step: f64 = if l.values_form {
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
                    let all = e.lambda_start.iter().chain(&e.lambda).chain(&e.lambda_end);
                    c[row + k] = w[e.sum_lambda + k] - all.map(|&j| w[j + k]).sum::<f64>();
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
        for p in l.elements.windows(2) {
            if let Some(row) = p[1].row_equal {
                c[row] = self.h_of(&p[1], w) - self.h_of(&p[0], w);
            }
        }
        for (call, row) in self.constraint_calls() {
            let n = self.functions[call.f].n_out();
            c[row..row + n].copy_from_slice(&self.cache.val[call.val..call.val + n]);
        }
    }

    /// Constraints that are functions alone, and their first rows.
    fn constraint_calls(&self) -> impl Iterator<Item = (&Call, usize)> {
        let ends = self.terminal.iter().zip(&self.l.row_terminal);
        let both = self.boundary.iter().zip(&self.l.row_boundary);
        self.path.iter().zip(&self.path_rows).chain(ends).chain(both).map(|(c, &r)| (c, r))
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
        let on = self.l.eta;
        self.l.elements.windows(2).filter(move |p| on && p[1].n > 0).map(|p| (&p[0], &p[1]))
    }

    pub(super) fn eta_weight(&self) -> f64 {
        if self.polishing {
            0.0
        } else {
            self.spec.options.rho_h
        }
    }

    pub(super) fn eta_value(&self, w: &[f64], local: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, local);
            sum += eta::value(self.l.n_cells, local);
        }
        self.eta_weight() * sum
    }

    pub(super) fn load_eta(&self, a: &ElementIndex, b: &ElementIndex, w: &[f64], out: &mut [f64]) {
        for (k, o) in out.iter_mut().enumerate() {
            *o = w[self.eta_vars(a, b, k)];
        }
    }

    pub(super) fn indicator_jac<S: Sink>(&self, calls: &[Call], row: usize, lambda: usize, mu: usize, s: &mut S) {
        let mut first = 0;
        for (k, (sub, call)) in self.spec.dcs.subsystems().iter().zip(calls).enumerate() {
            for (p, &(col, o)) in self.jac_cols[call.f].iter().enumerate() {
                if let Some(v) = self.var(call, col) {
                    for (c, cell) in sub.cells.iter().enumerate() {
                        let weight = cell.weights[o as usize];
                        if weight != 0.0 {
                            s.add(row + first + c, v, weight * self.cache.jac[call.jac + p]);
                        }
                    }
                }
            }
            for c in 0..sub.cells.len() {
                s.add(row + first + c, lambda + first + c, -1.0);
                s.add(row + first + c, mu + k, -1.0);
            }
            first += sub.cells.len();
        }
    }

    /// Writes all Jacobian entries in a fixed order.
    pub(super) fn jacobian_entries<S: Sink>(&self, w: &[f64], f: &mut [f64], s: &mut S) {
        let (l, t) = (&self.l, &self.tableau);
        let n_s = t.n_s;
        if let Some(lam) = l.lambda0 {
            self.indicator_jac(&self.ind_start, l.row_alg0, lam, l.mu0, s);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            for i in 0..n_s {
                let row = e.row_dyn[i];
                // coefficient of the right-hand side in these rows
                let coef = if l.values_form { -h } else { -1.0 };
                self.rhs_jac(e, ec, i, row, coef, w, s);
                if l.values_form {
                    if let Some(hv) = e.h {
                        self.rhs(e, ec, i, w, f);
                        for r in 0..l.nx {
                            s.add(row + r, hv, -f[r]);
                        }
                    }
                    let a_inv = t.a_inv.as_deref().unwrap_or(&[]);
                    for r in 0..l.nx {
                        let mut sum = 0.0;
                        for j in 0..n_s {
                            s.add(row + r, e.x[j] + r, a_inv[i * n_s + j]);
                            sum += a_inv[i * n_s + j];
                        }
                        s.add(row + r, e.x_start + r, -sum);
                    }
                } else {
                    for r in 0..l.nx {
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
                let mut theta = e.theta[i];
                for (k, sub) in self.spec.dcs.subsystems().iter().enumerate() {
                    for _ in &sub.cells {
                        s.add(e.row_norm[i] + k, theta, 1.0);
                        theta += 1;
                    }
                }
            }
            if let Some(row) = e.row_end {
                for r in 0..l.nx {
                    s.add(row + r, e.x_end + r, 1.0);
                    let mut sum = 0.0;
                    for j in 0..n_s {
                        if l.values_form {
                            let d = self.end_weights[j];
                            s.add(row + r, e.x[j] + r, -d);
                            sum += d;
                        } else {
                            s.add(row + r, e.v[j] + r, -h * t.b[j]);
                            sum += t.b[j] * w[e.v[j] + r];
                        }
                    }
                    if l.values_form {
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
                    for &j in e.lambda_start.iter().chain(&e.lambda).chain(&e.lambda_end) {
                        s.add(row + c, j + c, -1.0);
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
        for p in l.elements.windows(2) {
            if let (Some(row), Some(a), Some(b)) = (p[1].row_equal, p[0].h, p[1].h) {
                s.add(row, b, 1.0);
                s.add(row, a, -1.0);
            }
        }
        for (call, row) in self.constraint_calls() {
            for (p, &(col, o)) in self.jac_cols[call.f].iter().enumerate() {
                if let Some(v) = self.var(call, col) {
                    s.add(row + o as usize, v, self.cache.jac[call.jac + p]);
                }
            }
        }
    }

    /// Derivatives of `coef · f` at a stage point with respect to its inputs and `θ`.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn rhs_jac<S: Sink>(
        &self,
        e: &ElementIndex,
        ec: &ElementCalls,
        i: usize,
        row: usize,
        coef: f64,
        w: &[f64],
        s: &mut S,
    ) {
        for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
            for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    s.add(row + d.rows[o as usize], v, coef * self.cache.jac[c.jac + p]);
                }
            }
        }
        let mut first = e.theta[i];
        for (sub, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
            let nr = sub.rows.len();
            for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                if let Some(v) = self.var(c, col) {
                    let (mode, r) = (o as usize / nr, o as usize % nr);
                    let theta = self.mode_weight(sub, first, mode, w);
                    s.add(row + sub.rows[r], v, coef * theta * self.cache.jac[c.jac + p]);
                }
            }
            for (k, cell) in sub.cells.iter().enumerate() {
                for (o, &r) in sub.rows.iter().enumerate() {
                    s.add(row + r, first + k, coef * self.cache.val[c.val + cell.mode * nr + o]);
                }
            }
            first += sub.cells.len();
        }
        for (j, r) in self.linear_controls() {
            s.add(row + r, e.u + j, coef);
        }
    }

    /// Σ θ over the cells of a mode.
    #[inline]
    pub(super) fn mode_weight(&self, sub: &crate::dcs::Stewart, theta: usize, mode: usize, w: &[f64]) -> f64 {
        sub.cells.iter().enumerate().filter(|(_, c)| c.mode == mode).map(|(k, _)| w[theta + k]).sum()
    }

    /// Weights with which the Hessian of every call enters.
    pub(super) fn hessian_weights(&mut self, w: &[f64], obj: f64, y: &[f64]) {
        let mut wgt = std::mem::take(&mut self.cache.wgt);
        wgt.fill(0.0);
        let l = &self.l;
        let indicator = |wgt: &mut [f64], calls: &[Call], row: usize| {
            let mut k = row;
            for (sub, c) in self.spec.dcs.subsystems().iter().zip(calls) {
                for cell in &sub.cells {
                    for (j, v) in cell.weights.iter().enumerate() {
                        wgt[c.wgt + j] += y[k] * v;
                    }
                    k += 1;
                }
            }
        };
        if l.lambda0.is_some() {
            indicator(&mut wgt, &self.ind_start, l.row_alg0);
        }
        for (e, ec) in l.elements.iter().zip(&self.ecalls) {
            let h = self.h_of(e, w);
            let coef = if l.values_form { -h } else { -1.0 };
            for i in 0..self.tableau.n_s {
                let row = e.row_dyn[i];
                for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
                    for (o, &r) in d.rows.iter().enumerate() {
                        wgt[c.wgt + o] += coef * y[row + r];
                    }
                }
                let mut theta = e.theta[i];
                for (sub, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
                    let nr = sub.rows.len();
                    for cell in &sub.cells {
                        for (o, &r) in sub.rows.iter().enumerate() {
                            wgt[c.wgt + cell.mode * nr + o] += coef * y[row + r] * w[theta];
                        }
                        theta += 1;
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
        if let Some(c) = &self.mayer {
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
            let coef = if l.values_form { -h } else { -1.0 };
            for i in 0..n_s {
                let row = e.row_dyn[i];
                let hv = e.h.filter(|_| l.values_form);
                for (d, c) in self.spec.dcs.drifts().iter().zip(&ec.drift[i]) {
                    if let Some(hv) = hv {
                        for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                            if let Some(v) = self.var(c, col) {
                                add_sym(s, v, hv, -y[row + d.rows[o as usize]] * self.cache.jac[c.jac + p]);
                            }
                        }
                    }
                }
                let mut first = e.theta[i];
                for (sub, c) in self.spec.dcs.subsystems().iter().zip(&ec.modes[i]) {
                    let nr = sub.rows.len();
                    for (p, &(col, o)) in self.jac_cols[c.f].iter().enumerate() {
                        let Some(v) = self.var(c, col) else { continue };
                        let (mode, r) = (o as usize / nr, o as usize % nr);
                        let yj = y[row + sub.rows[r]] * self.cache.jac[c.jac + p];
                        for (k, _) in sub.cells.iter().enumerate().filter(|(_, cell)| cell.mode == mode) {
                            add_sym(s, v, first + k, coef * yj);
                        }
                        if let Some(hv) = hv {
                            add_sym(s, v, hv, -self.mode_weight(sub, first, mode, w) * yj);
                        }
                    }
                    if let Some(hv) = hv {
                        for (k, cell) in sub.cells.iter().enumerate() {
                            let f: f64 = sub
                                .rows
                                .iter()
                                .enumerate()
                                .map(|(o, &r)| y[row + r] * self.cache.val[c.val + cell.mode * nr + o])
                                .sum();
                            add_sym(s, first + k, hv, -f);
                        }
                    }
                    first += sub.cells.len();
                }
                if let Some(hv) = hv {
                    for (j, r) in self.linear_controls() {
                        add_sym(s, e.u + j, hv, -y[row + r]);
                    }
                }
                if let (false, Some(hv)) = (l.values_form, e.h) {
                    for j in 0..n_s {
                        if t.a(i, j) != 0.0 {
                            for r in 0..l.nx {
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
                    for r in 0..l.nx {
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
        let weight = obj * self.eta_weight();
        for (a, b) in self.eta_pairs() {
            self.load_eta(a, b, w, local);
            for k in 0..local.len() {
                for j in 0..=k {
                    let v = if weight == 0.0 { 0.0 } else { weight * eta::hessian(l.n_cells, local, j, k) };
                    add_sym(s, self.eta_vars(a, b, j), self.eta_vars(a, b, k), v);
                }
            }
        }
    }
}

/// Weights of `λ` at the start, the stage points and the end of an element in its slope at the start: the derivative
/// at 0 of the polynomial through the start and the stage points. An explicit method knows the slope from the first
/// point its first stage leads to.
pub(super) fn slope_weights(c: &[f64]) -> Vec<f64> {
    if c[0] == 0.0 {
        let mut w = vec![0.0; c.len() + 2];
        let (first, at) = c.iter().enumerate().find(|(_, &c)| c > 0.0).map_or((c.len(), 1.0), |(i, &c)| (i, c));
        w[0] = -1.0 / at;
        w[first + 1] = 1.0 / at;
        return w;
    }
    let nodes: Vec<f64> = std::iter::once(0.0).chain(c.iter().copied()).collect();
    let others = |j: usize| nodes.iter().enumerate().filter(move |&(k, _)| k != j).map(|(_, v)| *v);
    (0..nodes.len())
        .map(|j| match j {
            0 => -others(0).map(|v| 1.0 / v).sum::<f64>(),
            _ => {
                let inner: f64 = others(j).filter(|&v| v != 0.0).map(|v| -v / (nodes[j] - v)).product();
                inner / nodes[j]
            }
        })
        .collect()
}
