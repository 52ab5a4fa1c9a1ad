//! The Jacobian of the velocity as compressed rows, with the inputs `x`, `p`, `u`, `t` as columns: what a state does not depend on
//! costs nothing.

use super::{Columns, Field, Sub};
use crate::dcs::Drift;
use crate::func::{EvalResult, Function, Point};

/// Rows of a matrix by those entries that can be other than zero. The columns of a row are in no particular order.
#[derive(Debug, Clone, Default)]
pub(in crate::event) struct Rows {
    /// Where the rows begin; one place more than there are rows.
    pub(super) begin: Vec<usize>,
    pub(super) columns: Vec<u32>,
    pub(super) values: Vec<f64>,
    /// Rows with the same number have the same columns.
    pattern: u64,
}

impl Rows {
    /// Makes room for as many rows and entries.
    pub(in crate::event) fn reserve(&mut self, rows: usize, entries: usize) {
        self.begin.reserve(rows + 1);
        self.columns.reserve(entries);
        self.values.reserve(entries);
    }

    fn restart(&mut self) {
        // odd ones: those for fixed weights have an even one
        self.pattern = (self.pattern + 2) | 1;
        self.begin.clear();
        self.begin.push(0);
        self.columns.clear();
        self.values.clear();
    }

    /// Makes this a copy of `other` without new memory, where there is enough.
    pub(super) fn copy(&mut self, other: &Rows) {
        self.take_pattern(other);
        self.values.iter_mut().zip(&other.values).for_each(|(to, v)| *to = *v);
    }

    /// The same entries as in `other`, of which the values are still to come.
    pub(super) fn take_pattern(&mut self, other: &Rows) {
        if self.pattern != other.pattern {
            self.pattern = other.pattern;
            self.begin.clone_from(&other.begin);
            self.columns.clone_from(&other.columns);
            self.values.resize(other.values.len(), 0.0);
        }
    }

    /// Has it the same entries as `other`, whatever their values are?
    pub(in crate::event) fn is_like(&self, other: &Rows) -> bool {
        self.pattern == other.pattern
    }

    /// The nonzero entries of a full matrix with rows of the length `n`.
    fn compress(&mut self, full: &[f64], n: usize) {
        self.restart();
        for row in full.chunks_exact(n) {
            for (z, v) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
                self.columns.push(z as u32);
                self.values.push(*v);
            }
            self.begin.push(self.columns.len());
        }
    }

    /// The nonzero entries of a full matrix with rows of the length `n`.
    #[cfg(test)]
    pub(in crate::event) fn of_full(full: &[f64], n: usize) -> Rows {
        let mut rows = Rows::default();
        rows.compress(full, n);
        rows
    }

    /// Columns and values of row `i`.
    #[inline(always)]
    pub(in crate::event) fn row(&self, i: usize) -> (&[u32], &[f64]) {
        let own = self.begin[i]..self.begin[i + 1];
        (&self.columns[own.clone()], &self.values[own])
    }

    /// The entries of row `i`.
    pub(in crate::event) fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (columns, values) = self.row(i);
        columns.iter().map(|c| *c as usize).zip(values.iter().copied())
    }
}

/// The Jacobian for fixed weights, and where the functions write its entries: the same rows under every active set.
#[derive(Debug, Default)]
pub(super) struct Fixed {
    pub(super) rows: Rows,
    /// Of every drift: entry of its Jacobian, place.
    pub(super) drifts: Vec<Vec<(usize, usize)>>,
    /// The same of every mode of every subsystem.
    pub(super) modes: Vec<Vec<Vec<(usize, usize)>>>,
}

impl Fixed {
    pub(super) fn new(nx: usize, np: usize, nu: usize, drifts: &[Drift], subs: &[Sub]) -> Fixed {
        let column = Columns { nx, nu, np };
        // row, column, and for now the place among these
        let mut all: Vec<(usize, u32)> = Vec::new();
        let mut note = |f: &dyn Function, from: usize, to: &[usize]| -> Vec<(usize, usize)> {
            let (p, mut own) = (f.jac_pattern(), Vec::new());
            for (c, own_entries) in p.columns() {
                for k in own_entries {
                    if let Some(&row) = p.row_idx()[k].checked_sub(from).and_then(|i| to.get(i)) {
                        own.push((k, all.len()));
                        all.push((row, column.of(c) as u32));
                    }
                }
            }
            own
        };
        let mut of_drifts: Vec<Vec<(usize, usize)>> = drifts.iter().map(|d| note(d.f.as_ref(), 0, &d.rows)).collect();
        let mut of_modes: Vec<Vec<Vec<(usize, usize)>>> = Vec::with_capacity(subs.len());
        for s in subs {
            let n = s.rows.len().max(1);
            of_modes.push((0..s.modes.n_out() / n).map(|m| note(s.modes.as_ref(), m * n, &s.rows)).collect());
        }
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_unstable_by_key(|i| all[*i]);
        let mut rows = Rows { begin: vec![0], pattern: 2, ..Rows::default() };
        let mut place = vec![0; all.len()];
        for (n, &i) in order.iter().enumerate() {
            let (row, col) = all[i];
            if n == 0 || all[order[n - 1]] != all[i] {
                rows.begin.resize(row + 1, rows.columns.len());
                rows.columns.push(col);
            }
            place[i] = rows.columns.len() - 1;
        }
        rows.begin.resize(nx + 1, rows.columns.len());
        rows.values = vec![0.0; rows.columns.len()];
        let all = of_drifts.iter_mut().chain(of_modes.iter_mut().flatten()).flatten();
        all.for_each(|(_, p)| *p = place[*p]);
        Fixed { rows, drifts: of_drifts, modes: of_modes }
    }

    /// The inputs that the velocity of state `i` depends on for fixed weights, whatever the modes are.
    pub(super) fn inputs(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        self.rows.row(i).0.iter().map(|c| *c as usize)
    }

    /// The entries of row `i` as they were evaluated last.
    pub(super) fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.rows.entries(i)
    }

    /// Writes the matrix in full, with rows of the length `n`.
    pub(super) fn expand(&self, n: usize, out: &mut [f64]) {
        out.fill(0.0);
        for (i, row) in out.chunks_exact_mut(n).enumerate() {
            self.rows.entries(i).for_each(|(z, v)| row[z] = v);
        }
    }
}

/// What the weights of sliding modes add to the Jacobian for fixed weights: rows of states that subsystems drive have what the rates
/// of the surfaces depend on.
#[derive(Debug, Default)]
pub(super) struct Filled {
    pub(super) rows: Rows,
    /// The rows are those of the present active set.
    pub(super) listed: bool,
    /// Places of the entries for fixed weights, and where these are.
    pub(super) own: Vec<(u32, u32)>,
    /// Of every block the inputs that its weights depend on, and where they begin.
    pub(super) inputs: Vec<u32>,
    pub(super) begin: Vec<usize>,
    /// Where these are in the rows of the states that its pairs drive, pair by pair.
    pub(super) places: Vec<u32>,
    /// Where an input stands in a row, and for whom that was noted.
    at: Vec<u32>,
    seen: Vec<usize>,
    /// States that blocks drive.
    driven: Vec<(usize, usize)>,
    /// Derivatives of the rates of a block, and of one surface.
    rates: Vec<f64>,
    line: Vec<f64>,
    velocity: Vec<f64>,
    full: Vec<f64>,
}

impl Filled {
    /// Makes room for any mode of `pairs` pairs, whose columns of `D` have `driven` entries, among `nx` states and `n_z` inputs.
    pub(super) fn reserve(&mut self, [nx, n_z, pairs, driven]: [usize; 4]) {
        self.rows.reserve(nx, nx * n_z);
        self.own.reserve(nx * n_z);
        self.inputs.reserve(pairs * n_z);
        self.begin.reserve(pairs + 1);
        self.places.reserve(driven * n_z);
        self.at.reserve(n_z);
        self.seen.reserve(n_z);
        self.driven.reserve(driven);
        self.rates.reserve(pairs * n_z);
        self.line.reserve(n_z);
        self.velocity.reserve(nx);
        self.full.reserve(nx * n_z);
    }
}

impl Field {
    /// Entries of the Jacobian of `b + D α` for fixed `α`.
    pub(super) fn linearise_fixed(&mut self, t: f64, x: &[f64], alpha: &[f64]) -> EvalResult {
        self.linearise_modes(t, x, alpha, |_| true)
    }

    /// The same without the modes of those subsystems that are not `asked` for.
    fn linearise_modes(&mut self, t: f64, x: &[f64], alpha: &[f64], asked: impl Fn(usize) -> bool) -> EvalResult {
        self.counts.jacobians += 1;
        self.linear.fixed.rows.values.fill(0.0);
        let at = Point { t, x, u: &self.u, p: &self.p };
        for (d, own) in self.drifts.iter().zip(&self.linear.fixed.drifts) {
            let n = d.f.jac_pattern().nnz();
            d.f.jacobian(&at, &mut self.buffer[..n], &mut self.work)?;
            own.iter().for_each(|&(k, place)| self.linear.fixed.rows.values[place] += self.buffer[k]);
        }
        for (k, s) in self.subs.iter().enumerate().filter(|(k, _)| asked(*k)) {
            let (nr, nnz) = (s.rows.len(), s.modes.jac_pattern().nnz());
            for &cell in &self.active[k] {
                let mode = s.cells[cell - s.first].mode;
                let own = &self.linear.fixed.modes[k][mode];
                if own.is_empty() {
                    continue;
                }
                let weight = self.theta_in(alpha, cell);
                s.modes.jacobian_rows(&at, mode * nr..(mode + 1) * nr, &mut self.buffer[..nnz], &mut self.work)?;
                own.iter().for_each(|&(k, place)| self.linear.fixed.rows.values[place] += weight * self.buffer[k]);
            }
        }
        Ok(())
    }

    /// Jacobian of the velocity as explicit methods follow it, see [`Field::velocity_rows`]: in a sliding mode the weights change with
    /// the point, such that the velocity stays tangential,
    ///
    /// ```text
    /// ∂v = J + D ∂α,   C D ∂α = −(C J + ∂(∇c v + c_t)),
    /// ```
    ///
    /// with `J` the Jacobian for fixed weights.
    pub(in crate::event) fn linearise(&mut self, t: f64, x: &[f64]) -> EvalResult {
        self.linear.weights_add = !self.pairs.is_empty() || self.has_contacts() || self.is_selected();
        let r = if self.linear.weights_add {
            let mut filled = self.linear.filled.take().unwrap_or_default();
            let r = self.linearise_velocity(t, x, &mut filled);
            self.linear.filled = Some(filled);
            r
        } else {
            self.linearise_fixed(t, x, &[])
        };
        self.counts.entries += self.velocity_rows().values.len();
        r
    }

    /// The rows that [`Field::linearise`] has found last.
    pub(in crate::event) fn velocity_rows(&self) -> &Rows {
        match &self.linear.filled {
            Some(filled) if self.linear.weights_add => &filled.rows,
            _ => &self.linear.fixed.rows,
        }
    }

    fn linearise_velocity(&mut self, t: f64, x: &[f64], filled: &mut Filled) -> EvalResult {
        if self.has_contacts() || self.is_selected() {
            filled.listed = false;
            filled.full.resize(self.nx * self.n_z, 0.0);
            self.jacobian(t, x, &[], &mut filled.full)?;
            filled.rows.compress(&filled.full, self.n_z);
            return Ok(());
        }
        if self.asks_for_weights() {
            self.hidden(t, x)?;
            filled.velocity.resize(self.nx, 0.0);
            self.combine(&mut filled.velocity);
        }
        let (alpha, still) = (std::mem::take(&mut self.alpha), std::mem::take(&mut self.still));
        let r = self.linearise_modes(t, x, &alpha, |k| !still.unasked[k]);
        (self.alpha, self.still) = (alpha, still);
        r?;
        if !filled.listed {
            self.list_rows(filled);
        }
        self.add_weights(t, x, filled)
    }

    /// Lists the rows under the present active set.
    pub(super) fn list_rows(&self, to: &mut Filled) {
        let (sliding, fixed) = (&self.sliding, &self.linear.fixed);
        to.seen.clear();
        to.seen.resize(self.n_z, usize::MAX);
        to.at.resize(self.n_z, 0);
        to.inputs.clear();
        to.begin.clear();
        to.driven.clear();
        for b in 0..sliding.n_blocks() {
            to.begin.push(to.inputs.len());
            if self.still.blocks[b] {
                continue;
            }
            for &i in sliding.pairs_of(b) {
                let states = sliding.row_of_states(self.pairs[i], i).flat_map(|(a, _)| fixed.inputs(a));
                let bent = if self.valid.constant { 0 } else { usize::MAX };
                for z in states.chain(sliding.row(self.pairs[i], i).map(|c| c.0).take(bent)) {
                    if to.seen[z] != b {
                        to.seen[z] = b;
                        to.inputs.push(z as u32);
                    }
                }
                to.driven
                    .extend(sliding.column(self.pairs[i], i).map(|(a, _)| (a, b)).filter(|d| !self.still.states[d.0]));
            }
        }
        to.begin.push(to.inputs.len());
        to.driven.sort_unstable();
        to.driven.dedup();
        to.rows.restart();
        to.own.clear();
        to.seen.fill(usize::MAX);
        let mut next = 0;
        for a in 0..self.nx {
            if self.still.states[a] {
                to.rows.begin.push(to.rows.columns.len());
                continue;
            }
            for (z, from) in fixed.inputs(a).zip(fixed.rows.begin[a]..) {
                to.seen[z] = a;
                to.own.push((to.rows.columns.len() as u32, from as u32));
                to.rows.columns.push(z as u32);
            }
            while let Some(&(_, b)) = to.driven.get(next).filter(|d| d.0 == a) {
                next += 1;
                for &z in &to.inputs[to.begin[b]..to.begin[b + 1]] {
                    if to.seen[z as usize] != a {
                        to.seen[z as usize] = a;
                        to.rows.columns.push(z);
                    }
                }
            }
            to.rows.begin.push(to.rows.columns.len());
        }
        to.rows.values.resize(to.rows.columns.len(), 0.0);
        to.places.clear();
        for b in (0..sliding.n_blocks()).filter(|b| !self.still.blocks[*b]) {
            for &i in sliding.pairs_of(b) {
                for (a, _) in sliding.column(self.pairs[i], i).filter(|(a, _)| !self.still.states[*a]) {
                    for e in to.rows.begin[a]..to.rows.begin[a + 1] {
                        to.at[to.rows.columns[e] as usize] = e as u32;
                    }
                    to.places.extend(to.inputs[to.begin[b]..to.begin[b + 1]].iter().map(|z| to.at[*z as usize]));
                }
            }
        }
        to.listed = true;
    }

    /// Adds `D ∂α` to the Jacobian for fixed weights.
    fn add_weights(&mut self, t: f64, x: &[f64], to: &mut Filled) -> EvalResult {
        to.rows.values.fill(0.0);
        to.own.iter().for_each(|&(p, from)| to.rows.values[p as usize] = self.linear.fixed.rows.values[from as usize]);
        to.line.resize(self.n_z, 0.0);
        let mut places = &to.places[..];
        let mut large = 0;
        for b in 0..self.sliding.n_blocks() {
            let inputs = &to.inputs[to.begin[b]..to.begin[b + 1]];
            let (n, m) = (inputs.len(), self.sliding.pairs_of(b).len());
            if self.still.blocks[b] {
                large += usize::from(m > 1);
                continue;
            }
            to.rates.resize(to.rates.len().max(n * m), 0.0);
            let rates = &mut to.rates[..n * m];
            for (k, row) in rates.chunks_exact_mut(n.max(1)).enumerate() {
                let i = self.sliding.pairs_of(b)[k];
                inputs.iter().for_each(|z| to.line[*z as usize] = 0.0);
                if !self.valid.constant {
                    let sub = self.pairs[i].sub;
                    let own = self.pairs_of(sub);
                    self.room[own].fill(0.0);
                    self.room[i] = 1.0;
                    self.curvature_of(sub, (t, x, &to.velocity), &mut to.line)?;
                }
                for (a, c) in self.sliding.row_of_states(self.pairs[i], i) {
                    self.linear.fixed.entries(a).for_each(|(z, v)| to.line[z] -= c * v);
                }
                row.iter_mut().zip(inputs).for_each(|(r, z)| *r = to.line[*z as usize]);
            }
            if m == 1 {
                let entry = self.sliding.alone(self.sliding.pairs_of(b)[0]);
                rates.iter_mut().for_each(|r| *r /= entry);
            } else {
                self.sliding.solve_block(large, n, rates);
                large += 1;
            }
            for (row, &i) in to.rates.chunks_exact(n.max(1)).zip(self.sliding.pairs_of(b)) {
                for (_, d) in self.sliding.column(self.pairs[i], i).filter(|(a, _)| !self.still.states[*a]) {
                    let (own, rest) = places.split_at(n);
                    places = rest;
                    own.iter().zip(row).for_each(|(p, r)| to.rows.values[*p as usize] += d * r);
                }
            }
        }
        Ok(())
    }
}
