//! The Jacobian of the velocity at the stages of an explicit step, several of them side by side: what the functions do is the
//! same at every stage, and one instruction does it at all of them.
//!
//! In a sliding mode the weights and the columns of `D` at the stages are those the step was made with: they are kept as it goes,
//! see [`Field::trace_weights`], and nothing is evaluated a second time but its start.

use super::rows::{Filled, Rows};
use super::Field;
use crate::event::explicit::Pair;
use crate::event::step::Stages;
use crate::func::{EvalError, EvalResult, Function, Lanes, Point, LANES};
use crate::linalg::dense::wide;

/// Stages of an explicit step, its end included.
pub(in crate::event) const MOST_STAGES: usize = 13;

/// The first `n` stages of an explicit step from `(t, x0)`, with the derivatives at its stages by component.
pub(in crate::event) struct StagesOf<'a> {
    pub(in crate::event) pair: Pair,
    pub(in crate::event) t: f64,
    pub(in crate::event) h: f64,
    pub(in crate::event) x0: &'a [f64],
    pub(in crate::event) k: &'a [Stages],
    pub(in crate::event) n: usize,
}

impl StagesOf<'_> {
    /// The state at stage `i`, to the last digit that of the step: differences of functions are noisy.
    pub(in crate::event) fn point(&self, i: usize, x: &mut [f64]) {
        let row = self.pair.rows().0[i];
        for ((x, x0), k) in x.iter_mut().zip(self.x0).zip(self.k) {
            *x = x0 + self.h * row.iter().map(|&(j, a)| a * k[j]).sum::<f64>();
        }
    }

    /// Times and states at the stages from `first` on; where there are no more, the last one again.
    fn points(&self, first: usize, t: &mut Lanes, x: &mut [Lanes]) {
        wide(|| self.points_wide(first, t, x));
    }

    #[inline(always)]
    fn points_wide(&self, first: usize, t: &mut Lanes, x: &mut [Lanes]) {
        let (rows, c) = self.pair.rows();
        let (mut weights, mut used) = ([[0.0; LANES]; MOST_STAGES], 0);
        for l in 0..LANES {
            let i = (first + l).min(self.n - 1);
            t[l] = self.t + c[i] * self.h;
            for &(j, a) in rows[i] {
                weights[j][l] = a;
                used = used.max(j + 1);
            }
        }
        for ((x, x0), k) in x.iter_mut().zip(self.x0).zip(self.k) {
            let mut sum = [0.0; LANES];
            for (weights, k) in weights[..used].iter().zip(k) {
                (0..LANES).for_each(|l| sum[l] += weights[l] * k);
            }
            (0..LANES).for_each(|l| x[l] = x0 + self.h * sum[l]);
        }
    }
}

/// Room for a few stages.
#[derive(Debug, Default)]
pub(super) struct Side {
    /// In the order `x`, `u`, `p`, `t`.
    inputs: Vec<Lanes>,
    buffer: Vec<Lanes>,
    work: Vec<Lanes>,
    /// Entries for fixed weights, and with what the weights add.
    fixed: Vec<Lanes>,
    values: Vec<Lanes>,
    /// Derivatives of one rate, and of those of a block.
    line: Vec<Lanes>,
    rates: Vec<Lanes>,
    column: Vec<f64>,
    x: Vec<f64>,
}

/// `to += a v`
#[inline(always)]
fn add(to: &mut Lanes, a: f64, v: &Lanes) {
    (0..LANES).for_each(|l| to[l] += a * v[l]);
}

/// `to += a v`, stage by stage
#[inline(always)]
fn add_product(to: &mut Lanes, a: &Lanes, v: &Lanes) {
    (0..LANES).for_each(|l| to[l] += a[l] * v[l]);
}

/// The stages from `first` on.
fn lanes(trace: &Stages, first: usize) -> &Lanes {
    trace[first..first + LANES].try_into().expect("stages are a multiple of the lanes")
}

/// Are all of them numbers?
fn finite<'a>(values: impl Iterator<Item = &'a Lanes>) -> bool {
    let mut zero = [0.0; LANES];
    values.for_each(|v| (0..LANES).for_each(|l| zero[l] += v[l] * 0.0));
    zero.iter().all(|z| *z == 0.0)
}

impl Field {
    /// Are the Jacobians at the stages of a step found side by side? Not where a rule selects weights or the gradients of the
    /// surfaces change with the point, and not in scenes and limit sets.
    pub(in crate::event) fn linearises_at_once(&self) -> bool {
        let general = self.has_contacts() || self.is_selected() || self.limit.is_some();
        !general && (self.pairs.is_empty() || self.valid.constant)
    }

    /// [`Field::linearise`] at stages of the last step, or of one whose weights have been given back by
    /// [`Field::read_traces`].
    pub(in crate::event) fn linearise_stages(&mut self, s: &StagesOf, to: &mut Vec<Rows>) -> EvalResult {
        to.resize_with(s.n.max(to.len()), Rows::default);
        let mut side = self.side.take().unwrap_or_else(|| Box::new(self.room_of_stages()));
        let r = self.linearise_all(s, &mut side, to);
        self.side = Some(side);
        r
    }

    /// Makes room for what any mode needs: from here on no step allocates in a sliding mode, unless a rule selects its weights.
    pub(in crate::event) fn reserve(&mut self) {
        let (nx, n_z, most) = (self.nx, self.n_z, self.alpha.len());
        let pairs: Vec<usize> = self.subs.iter().map(|s| s.cells.len().saturating_sub(1)).collect();
        let driven = self.sliding.reserve(&pairs);
        self.first_pair.reserve(self.active.len() + 1);
        self.still.reserve(nx, most, self.subs.len());
        if self.traces.keeps_columns {
            self.traces.columns.reserve(driven);
        }
        let mut filled = self.linear.filled.take().unwrap_or_default();
        filled.reserve([nx, n_z, most, driven]);
        self.linear.filled = Some(filled);
        let mut side = self.side.take().unwrap_or_else(|| Box::new(self.room_of_stages()));
        side.values.reserve(nx * n_z);
        side.rates.reserve(most * n_z);
        side.column.reserve(most * n_z);
        self.side = Some(side);
    }

    fn room_of_stages(&self) -> Side {
        Side {
            inputs: vec![[0.0; LANES]; self.n_z],
            buffer: vec![[0.0; LANES]; self.buffer.len()],
            work: vec![[0.0; LANES]; self.work.len()],
            fixed: vec![[0.0; LANES]; self.linear.fixed.rows.values.len()],
            line: vec![[0.0; LANES]; self.n_z],
            x: vec![0.0; self.nx],
            ..Side::default()
        }
    }

    fn linearise_all(&mut self, s: &StagesOf, side: &mut Side, to: &mut [Rows]) -> EvalResult {
        if self.linearises_at_once() && self.linearise_at_once(s, side, to)? {
            return Ok(());
        }
        let c = s.pair.rows().1;
        for (i, to) in to[..s.n].iter_mut().enumerate() {
            s.point(i, &mut side.x);
            self.linearise(s.t + c[i] * s.h, &side.x)?;
            to.copy(self.velocity_rows());
        }
        Ok(())
    }

    /// False where something is not finite: asked point by point the functions say more about it.
    fn linearise_at_once(&mut self, s: &StagesOf, side: &mut Side, to: &mut [Rows]) -> Result<bool, EvalError> {
        self.linear.weights_add = !self.pairs.is_empty();
        let mut filled = self.linear.filled.take().unwrap_or_default();
        self.find_still();
        if self.linear.weights_add {
            if self.asks_for_weights() {
                self.hidden(s.t, s.x0)?;
                self.trace_weights(0);
            }
            if !filled.listed {
                self.list_rows(&mut filled);
            }
        }
        let [nx, nu, np] = [self.nx, self.u.len(), self.p.len()];
        side.inputs[nx..nx + nu].iter_mut().zip(&self.u).for_each(|(to, v)| *to = [*v; LANES]);
        side.inputs[nx + nu..].iter_mut().zip(&self.p).for_each(|(to, v)| *to = [*v; LANES]);
        let mut known = true;
        for first in (0..s.n).step_by(LANES) {
            let (x, rest) = side.inputs.split_at_mut(nx);
            s.points(first, &mut rest[nu + np], x);
            let n = (s.n - first).min(LANES);
            known = self.fixed_side_by_side((first, n), side)?;
            if known && self.linear.weights_add {
                known = self.weights_side_by_side((first, n), side, &filled);
            }
            if !known {
                break;
            }
            let (rows, values) = match self.linear.weights_add {
                true => (&filled.rows, &side.values),
                false => (&self.linear.fixed.rows, &side.fixed),
            };
            for (l, to) in to[first..first + n].iter_mut().enumerate() {
                to.take_pattern(rows);
                to.values.iter_mut().zip(values).for_each(|(to, v)| *to = v[l]);
            }
        }
        self.linear.filled = Some(filled);
        if known {
            self.counts.jacobians += s.n;
            self.counts.entries += s.n * to[0].values.len();
        }
        Ok(known)
    }

    /// Weight of an active cell at the stages from `first` on.
    fn theta_side_by_side(&self, cell: usize, first: usize) -> Lanes {
        let mut base = [1.0; LANES];
        for i in self.pairs_of(self.owner[cell]) {
            let alpha = lanes(&self.traces.weights[i], first);
            if self.pairs[i].cell == cell {
                return *alpha;
            }
            (0..LANES).for_each(|l| base[l] -= alpha[l]);
        }
        base
    }

    /// Entries of the Jacobian of `b + D α` for fixed `α` at `n` stages from `first` on.
    fn fixed_side_by_side(&mut self, stages: (usize, usize), side: &mut Side) -> Result<bool, EvalError> {
        let (mut buffer, mut work) = (std::mem::take(&mut self.buffer), std::mem::take(&mut self.work));
        let r = self.fixed_with(stages, side, (&mut buffer, &mut work));
        (self.buffer, self.work) = (buffer, work);
        r
    }

    fn fixed_with(
        &self,
        (first, n): (usize, usize),
        side: &mut Side,
        (buffer, work): (&mut [f64], &mut [f64]),
    ) -> Result<bool, EvalError> {
        side.fixed.fill([0.0; LANES]);
        let dims = [self.nx, self.u.len(), self.p.len()];
        let mut evaluate = |f: &dyn Function, rows: std::ops::Range<usize>, side: &mut Side| -> EvalResult {
            let nnz = f.jac_pattern().nnz();
            if let Some(r) = f.jacobian_lanes(rows.clone(), &side.inputs, &mut side.buffer[..nnz], &mut side.work) {
                return r;
            }
            let [nx, nu, np] = dims;
            let (u, p) = (side.inputs[nx..nx + nu].iter(), side.inputs[nx + nu..nx + nu + np].iter());
            side.column.clear();
            side.column.extend(u.chain(p).map(|v| v[0]));
            let (u, p) = side.column.split_at(nu);
            for l in 0..n {
                side.x.iter_mut().zip(&side.inputs).for_each(|(x, v)| *x = v[l]);
                let at = Point { t: side.inputs[nx + nu + np][l], x: &side.x, u, p };
                f.jacobian_rows(&at, rows.clone(), &mut buffer[..nnz], work)?;
                side.buffer.iter_mut().zip(&buffer[..nnz]).for_each(|(to, v)| to[l..].fill(*v));
            }
            Ok(())
        };
        for (d, own) in self.drifts.iter().zip(&self.linear.fixed.drifts).filter(|(_, own)| !own.is_empty()) {
            if recovered(evaluate(d.f.as_ref(), 0..d.f.n_out(), side))? {
                own.iter().for_each(|&(k, place)| add(&mut side.fixed[place], 1.0, &side.buffer[k]));
            } else {
                return Ok(false);
            }
        }
        for (k, s) in self.subs.iter().enumerate() {
            let nr = s.rows.len();
            for &cell in &self.active[k] {
                let mode = s.cells[cell - s.first].mode;
                let own = &self.linear.fixed.modes[k][mode];
                if own.is_empty() || self.still.unasked[k] {
                    continue;
                }
                if !recovered(evaluate(s.modes.as_ref(), mode * nr..(mode + 1) * nr, side))? {
                    return Ok(false);
                }
                match self.active[k].len() {
                    1 => own.iter().for_each(|&(k, place)| add(&mut side.fixed[place], 1.0, &side.buffer[k])),
                    _ => {
                        let mut theta = self.theta_side_by_side(cell, first);
                        // nothing is known of stages that are not asked for
                        let last = theta[n - 1];
                        theta[n..].fill(last);
                        own.iter().for_each(|&(k, place)| add_product(&mut side.fixed[place], &theta, &side.buffer[k]));
                    }
                }
            }
        }
        Ok(finite(side.fixed.iter()))
    }

    /// Adds `D ∂α` where gradients are constant, see [`Field::linearise`].
    fn weights_side_by_side(&mut self, (first, n): (usize, usize), side: &mut Side, filled: &Filled) -> bool {
        side.values.resize(filled.rows.values.len(), [0.0; LANES]);
        side.values.fill([0.0; LANES]);
        filled.own.iter().for_each(|&(p, from)| side.values[p as usize] = side.fixed[from as usize]);
        let mut places = &filled.places[..];
        let mut large = 0;
        for b in 0..self.sliding.n_blocks() {
            let inputs = &filled.inputs[filled.begin[b]..filled.begin[b + 1]];
            let (n_in, m) = (inputs.len(), self.sliding.pairs_of(b).len());
            if self.still.blocks[b] {
                large += usize::from(m > 1);
                continue;
            }
            side.rates.resize(side.rates.len().max(n_in * m), [0.0; LANES]);
            for (&i, row) in self.sliding.pairs_of(b).iter().zip(side.rates.chunks_exact_mut(n_in.max(1))) {
                inputs.iter().for_each(|z| side.line[*z as usize] = [0.0; LANES]);
                for (a, c) in self.sliding.row_of_states(self.pairs[i], i) {
                    let own = self.linear.fixed.rows.begin[a]..self.linear.fixed.rows.begin[a + 1];
                    let columns = &self.linear.fixed.rows.columns[own.clone()];
                    columns.iter().zip(&side.fixed[own]).for_each(|(z, v)| add(&mut side.line[*z as usize], -c, v));
                }
                row.iter_mut().zip(inputs).for_each(|(r, z)| *r = side.line[*z as usize]);
            }
            let rates = &mut side.rates[..n_in * m];
            if m == 1 {
                let i = self.sliding.pairs_of(b)[0];
                let mut entry = [0.0; LANES];
                for (c, d) in self.sliding.own_entry(self.pairs[i], i) {
                    add(&mut entry, c, lanes(&self.traces.columns[d], first));
                }
                entry[n..].fill(1.0);
                if entry.contains(&0.0) || !finite(std::iter::once(&entry)) {
                    return false;
                }
                rates.iter_mut().for_each(|r| (0..LANES).for_each(|l| r[l] /= entry[l]));
            } else {
                for l in 0..n {
                    self.sliding.recall(b, &self.traces.columns, first + l);
                    if !self.sliding.factorise_block((b, large), &self.pairs, &self.first_pair) {
                        return false;
                    }
                    side.column.clear();
                    side.column.extend(rates.iter().map(|r| r[l]));
                    self.sliding.solve_block(large, n_in, &mut side.column);
                    rates.iter_mut().zip(&side.column).for_each(|(r, v)| r[l] = *v);
                }
                large += 1;
            }
            for (row, &i) in side.rates.chunks_exact(n_in.max(1)).zip(self.sliding.pairs_of(b)) {
                let states = self.sliding.column(self.pairs[i], i).map(|(a, _)| a);
                for (d, _) in self.sliding.places_of_column(i).zip(states).filter(|(_, a)| !self.still.states[*a]) {
                    let (own, rest) = places.split_at(n_in);
                    places = rest;
                    let d = lanes(&self.traces.columns[d], first);
                    own.iter().zip(row).for_each(|(p, r)| add_product(&mut side.values[*p as usize], d, r));
                }
            }
        }
        let mut defined = true;
        side.values.iter().for_each(|v| defined &= v[..n].iter().all(|v| v.is_finite()));
        defined
    }

    /// The last right-hand side was that of stage `i` of an explicit pair.
    #[inline]
    pub(in crate::event) fn trace_weights(&mut self, i: usize) {
        for (trace, alpha) in self.traces.weights.iter_mut().zip(&self.alpha).take(self.pairs.len()) {
            trace[i] = *alpha;
        }
        if self.traces.keeps_columns {
            let columns = self.sliding.columns();
            if self.traces.columns.len() < columns.len() {
                self.traces.columns.resize(columns.len(), [0.0; 16]);
            }
            self.traces.columns.iter_mut().zip(columns).for_each(|(trace, d)| trace[i] = *d);
        }
    }

    /// The algebraic variables at the stages of the present step of an explicit pair.
    pub(in crate::event) fn traces(&self) -> &[Stages] {
        &self.traces.weights[..self.pairs.len()]
    }

    /// Numbers that are kept of every stage but the first.
    pub(in crate::event) fn n_traced(&mut self) -> usize {
        match !self.pairs.is_empty() && self.linearises_at_once() && self.asks_for_weights() {
            true => self.pairs.len() + self.sliding.columns().len(),
            false => 0,
        }
    }

    /// Appends them, for the stages up to `last`.
    pub(in crate::event) fn write_traces(&mut self, last: usize, to: &mut Vec<f64>) {
        let n = self.n_traced();
        let traces = self.traces().iter().chain(&self.traces.columns).take(n);
        traces.for_each(|trace| to.extend_from_slice(&trace[1..=last]));
    }

    /// Takes them back.
    pub(in crate::event) fn read_traces(&mut self, last: usize, from: &[f64]) {
        let (n, r) = (self.n_traced(), self.pairs.len());
        self.traces.columns.resize(self.traces.columns.len().max(n.saturating_sub(r)), [0.0; 16]);
        let traces = self.traces.weights[..r].iter_mut().chain(&mut self.traces.columns).take(n);
        traces.zip(from.chunks_exact(last)).for_each(|(trace, own)| trace[1..=last].copy_from_slice(own));
    }
}

/// Has it succeeded? What is not defined may be said of it by its parts.
fn recovered(r: EvalResult) -> Result<bool, EvalError> {
    match r {
        Ok(()) => Ok(true),
        Err(EvalError::Recoverable) => Ok(false),
        Err(e) => Err(e),
    }
}
