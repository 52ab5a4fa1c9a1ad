//! Surfaces that are held inside of algebraic equations: weights as further unknowns.
//!
//! ```text
//! ẋ = f(x, z, w),   0 = h(x, z, w) = (1 − w) h_i(x, z) + w h_j(x, z),   0 ≤ w ≤ 1,   ψ = 0
//! ```
//!
//! Two modes `i` and `j` of a subsystem are apart where its function `ψ` vanishes. Where neither has its region beyond, the rows of both
//! have a weight that keeps `ψ` at zero: Filippov's solution of the equations and the derivatives together. There are two cases.
//!
//! - `ψ` depends on algebraic states that the weight moves, as a relay inside of its own loop does: `ψ(x, z) = 0` determines the weight.
//! - `ψ` depends on other states alone. Then its rate does: `ψ_x f(x, z, w) + ψ_t = 0`, and what rounding and the method leave of `ψ`
//!   is taken from the states at the end of every step, as for all surfaces that slide.

use super::algebraic::{Algebraic, Solver};
use super::steps::of_fewer;
use super::{SharedFunction, Subsystem, System};
use crate::func::{EvalError, EvalResult, Point};

/// Points at which modes are compared.
const POINTS: usize = 6;
/// What is the same up to this part at all of them is the same.
const SAME: f64 = 1e-9;
/// A rate below so many roundings of its terms has no sign.
pub(super) const NO_RATE: f64 = 256.0;
/// Passes that put states onto surfaces.
const PASSES: usize = 3;

/// What determines a weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum By {
    /// The switching function, by the algebraic states.
    Value,
    /// Its rate.
    Rate,
}

/// Two modes and the surface between them.
pub(super) struct Held {
    /// The modes on its sides.
    pub(super) low: usize,
    pub(super) high: usize,
    /// Weights of the functions whose sum is negative on the side of `low`, and positive on that of `high`.
    pub(super) terms: Vec<(usize, f64)>,
    pub(super) by: By,
}

/// A function that gives derivatives: its outputs with the states they move, under the modes of a loop or always.
pub(super) struct Flow {
    pub(super) f: SharedFunction,
    pub(super) rows: Vec<(usize, usize)>,
    pub(super) switched: Option<(usize, usize)>,
}

impl Flow {
    pub(super) fn function(&self) -> &SharedFunction {
        &self.f
    }
}

/// Modes that count at a point with their weights, and what these change by with the weight of the loop.
pub(super) type Taken = ([(usize, f64, f64); 2], usize);

impl Algebraic {
    /// How the outputs of loop `k` are taken together.
    pub(super) fn taken(&self, s: &Solver, k: usize) -> Taken {
        let (l, mode) = (&self.loops[k], s.modes[k]);
        match l.held.get(mode.wrapping_sub(l.n_modes)) {
            Some(h) => {
                let w = s.w[l.weight.unwrap_or(0)];
                ([(h.low, 1.0 - w, -1.0), (h.high, w, 1.0)], 2)
            }
            None => ([(mode, 1.0, 0.0); 2], 1),
        }
    }

    /// The surface that loop `k` holds.
    pub(super) fn held(&self, s: &Solver, k: usize) -> Option<&Held> {
        let l = &self.loops[k];
        l.held.get(s.modes[k].wrapping_sub(l.n_modes))
    }

    /// Gradient of a surface of loop `k` by all inputs to `s.gradient`.
    fn gradient(&self, s: &mut Solver, k: usize, terms: &[(usize, f64)], at: &Point) -> EvalResult {
        let f = self.loops[k].functions();
        let p = f.jac_pattern();
        f.jacobian(at, &mut s.buffer[..p.nnz()], &mut s.work)?;
        s.gradient.fill(0.0);
        for (c, entries) in p.columns() {
            for e in entries {
                let weight = terms.iter().find(|t| t.0 == p.row_idx()[e]).map_or(0.0, |t| t.1);
                s.gradient[c] += weight * s.buffer[e];
            }
        }
        Ok(())
    }

    /// Derivatives of the states that move to `s.rate`.
    fn rates(&self, s: &mut Solver, at: &Point) -> EvalResult {
        s.rate.fill(0.0);
        let whole = s.whole(at);
        for flow in &self.flows {
            let at = &Point { x: &whole[..flow.f.dims().x], ..*at };
            let (taken, n) = flow.switched.map_or(([(0, 1.0, 0.0); 2], 1), |(k, _)| self.taken(s, k));
            for (mode, weight, _) in &taken[..n] {
                let by = flow.switched.map_or(0, |(_, n)| mode * n);
                flow.f.value(at, &mut s.buffer[..flow.f.n_out()], &mut s.work)?;
                flow.rows.iter().for_each(|(o, r)| s.rate[*r] += weight * s.buffer[by + o]);
            }
        }
        s.whole = whole;
        s.rate.iter().all(|v| v.is_finite()).then_some(()).ok_or(EvalError::Recoverable)
    }

    /// The value of the equation of a weight: the weight itself where its surface is not held.
    pub(super) fn weight_residual(&self, s: &mut Solver, k: usize, at: &Point) -> std::result::Result<f64, EvalError> {
        if let Some((_, w)) = s.fixed.filter(|f| f.0 == k) {
            return Ok(s.w[self.loops[k].weight.unwrap_or(0)] - w);
        }
        let Some(h) = self.held(s, k) else {
            let l = &self.loops[k];
            return Ok(s.w[l.weight.unwrap_or(0)] - l.weight_in(s.modes[k]));
        };
        match h.by {
            By::Value => {
                let f = self.loops[k].functions();
                f.value(at, &mut s.buffer[..f.n_out()], &mut s.work)?;
                Ok(h.terms.iter().map(|(o, t)| t * s.buffer[*o]).sum())
            }
            By::Rate => {
                self.rates(s, at)?;
                self.gradient(s, k, &h.terms, at)?;
                Ok(s.gradient[s.gradient.len() - 1] + s.gradient.iter().zip(&s.rate).map(|(g, r)| g * r).sum::<f64>())
            }
        }
    }

    /// The rate of a surface of loop `k`, and the sizes of its terms.
    pub(super) fn rate_of(
        &self,
        s: &mut Solver,
        k: usize,
        terms: &[(usize, f64)],
        at: &Point,
    ) -> std::result::Result<(f64, f64), EvalError> {
        self.rates(s, at)?;
        let sizes = self.sizes_of_rates_at(s, at)?;
        self.gradient(s, k, terms, at)?;
        let by_time = s.gradient[s.gradient.len() - 1];
        let rate = s.gradient.iter().zip(&s.rate).map(|(g, r)| g * r).sum::<f64>();
        let size = s.gradient.iter().zip(&sizes).map(|(g, r)| g.abs() * r).sum::<f64>();
        Ok((by_time + rate, by_time.abs() + size))
    }

    /// What derivatives of the states are sums of: of their values, and of all that they depend on.
    fn sizes_of_rates_at(&self, s: &mut Solver, at: &Point) -> std::result::Result<Vec<f64>, EvalError> {
        let mut sizes = vec![0.0; self.dims.x];
        let inputs: Vec<f64> = [at.x, at.u, at.p, &[at.t], &s.w].concat();
        let whole = s.whole(at);
        for flow in &self.flows {
            let at = &Point { x: &whole[..flow.f.dims().x], ..*at };
            let (taken, n) = flow.switched.map_or(([(0, 1.0, 0.0); 2], 1), |(k, _)| self.taken(s, k));
            let p = flow.f.jac_pattern();
            for (mode, weight, _) in &taken[..n] {
                let by = flow.switched.map_or(0, |(_, n)| mode * n);
                flow.f.value(at, &mut s.buffer[..flow.f.n_out()], &mut s.work)?;
                flow.rows.iter().for_each(|(o, r)| sizes[*r] += (weight * s.buffer[by + o]).abs());
                flow.f.jacobian(at, &mut s.buffer[..p.nnz()], &mut s.work)?;
                for (c, entries) in p.columns() {
                    let v = inputs.get(self.input_of(&flow.f, c)).copied().unwrap_or(0.0);
                    for e in entries {
                        if let Some((_, r)) = flow.rows.iter().find(|r| by + r.0 == p.row_idx()[e]) {
                            sizes[*r] += (weight * s.buffer[e] * v).abs();
                        }
                    }
                }
            }
        }
        s.whole = whole;
        Ok(sizes)
    }

    /// What derivatives of the states are known to at a point where the equations are solved, where surfaces may be held: weights make sums vanish.
    pub(crate) fn noise_of_rates(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        p: &[f64],
    ) -> std::result::Result<Vec<f64>, EvalError> {
        let mut s = self.lock();
        self.settle(&mut s, &Point { t, x, u, p })?;
        let full = s.full.clone();
        let (states, weights) = full.split_at(self.dims.x);
        s.w.copy_from_slice(weights);
        let sizes = self.sizes_of_rates_at(&mut s, &Point { t, x: states, u, p })?;
        Ok(sizes.into_iter().map(|v| NO_RATE * f64::EPSILON * v).collect())
    }

    /// Derivatives of that equation by all inputs, and by the weights behind them, to `s.row`.
    pub(super) fn weight_row(&self, s: &mut Solver, k: usize, at: &Point) -> EvalResult {
        let own = self.dims.n_in() + self.loops[k].weight.unwrap_or(0);
        s.row.fill(0.0);
        let Some(h) = self.held(s, k) else {
            s.row[own] = 1.0;
            return Ok(());
        };
        if h.by == By::Rate {
            self.rates(s, at)?;
        }
        self.gradient(s, k, &h.terms, at)?;
        let n_in = self.dims.n_in();
        if h.by == By::Value {
            let Solver { row, gradient, .. } = s;
            row[..n_in].copy_from_slice(gradient);
            return Ok(());
        }
        // by the gradient that turns
        let f = self.loops[k].functions();
        let p = f.hess_pattern();
        if p.nnz() > 0 {
            let mut weights = vec![0.0; f.n_out()];
            h.terms.iter().for_each(|(o, t)| weights[*o] = *t);
            f.hessian(at, &weights, &mut s.buffer[..p.nnz()], &mut s.work)?;
            let along = |rate: &[f64], c: usize| match c {
                c if c < rate.len() => rate[c],
                c if c + 1 == n_in => 1.0,
                _ => 0.0,
            };
            for (c, entries) in p.columns() {
                for e in entries {
                    let r = p.row_idx()[e];
                    s.row[r] += s.buffer[e] * along(&s.rate, c);
                    if r != c {
                        s.row[c] += s.buffer[e] * along(&s.rate, r);
                    }
                }
            }
        }
        // by the rates
        let whole = s.whole(at);
        for flow in &self.flows {
            let at = &Point { x: &whole[..flow.f.dims().x], ..*at };
            let (taken, n) = flow.switched.map_or(([(0, 1.0, 0.0); 2], 1), |(k, _)| self.taken(s, k));
            let weight_column = flow.switched.and_then(|(k, _)| self.loops[k].weight).map(|w| n_in + w);
            let p = flow.f.jac_pattern();
            for (mode, weight, slope) in &taken[..n] {
                let by = flow.switched.map_or(0, |(_, n)| mode * n);
                flow.f.jacobian(at, &mut s.buffer[..p.nnz()], &mut s.work)?;
                let of_output = |gradient: &[f64], o: usize| {
                    let state = flow.rows.iter().find(|r| by + r.0 == o);
                    state.map_or(0.0, |r| gradient[r.1])
                };
                for (c, entries) in p.columns() {
                    let Some(to) = Some(self.input_of(&flow.f, c)).filter(|c| *c < s.row.len()) else { continue };
                    for e in entries {
                        s.row[to] += of_output(&s.gradient, p.row_idx()[e]) * weight * s.buffer[e];
                    }
                }
                if let Some(c) = weight_column.filter(|_| *slope != 0.0) {
                    flow.f.value(at, &mut s.buffer[..flow.f.n_out()], &mut s.work)?;
                    flow.rows.iter().for_each(|(o, r)| s.row[c] += slope * s.gradient[*r] * s.buffer[by + o]);
                }
            }
        }
        s.whole = whole;
        Ok(())
    }

    /// Inputs and weights behind them that the equation of the weight of loop `k` may depend on.
    pub(super) fn weight_columns(&self, k: usize) -> Vec<usize> {
        let (l, n_in) = (&self.loops[k], self.dims.n_in());
        let mut columns = vec![n_in + l.weight.unwrap_or(0)];
        for h in &l.held {
            let f = l.functions();
            let counts = |r: usize| h.terms.iter().any(|t| t.0 == r);
            let of_psi = |c: usize| f.jac_pattern().rows(c).iter().any(|r| counts(*r));
            let psi: Vec<usize> = (0..n_in).filter(|c| of_psi(*c)).collect();
            if h.by == By::Value {
                columns.extend(psi);
                continue;
            }
            for (c, entries) in f.hess_pattern().columns() {
                entries.for_each(|e| columns.extend([c, f.hess_pattern().row_idx()[e]]));
            }
            for flow in &self.flows {
                let n = flow.switched.map_or(flow.f.n_out(), |s| s.1);
                let counts = |o: usize| flow.rows.iter().any(|(own, r)| *own == o % n && psi.contains(r));
                let p = flow.f.jac_pattern();
                let own = (0..p.n_cols()).filter(|c| p.rows(*c).iter().any(|o| counts(*o)));
                columns.extend(own.map(|c| self.input_of(&flow.f, c)).filter(|c| *c < n_in + self.n_weights()));
                let weight = flow.switched.and_then(|(k, _)| self.loops[k].weight);
                columns.extend(weight.filter(|_| (0..n).any(counts)).map(|w| n_in + w));
            }
        }
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// Adds what the equation of the weight of loop `k`, times `v`, bends by to a list of inputs and weights: place, place, value.
    /// [`EvalError::Recoverable`] where it has no second derivatives here.
    pub(super) fn weight_bends(
        &self,
        s: &mut Solver,
        k: usize,
        at: &Point,
        v: f64,
        out: &mut Vec<(usize, usize, f64)>,
    ) -> EvalResult {
        let Some(h) = self.held(s, k).filter(|_| v != 0.0) else { return Ok(()) };
        let f = self.loops[k].functions();
        let p = f.hess_pattern();
        if h.by == By::Value {
            let mut weights = vec![0.0; f.n_out()];
            h.terms.iter().for_each(|(o, t)| weights[*o] = v * t);
            f.hessian(at, &weights, &mut s.buffer[..p.nnz()], &mut s.work)?;
            for (c, entries) in p.columns() {
                out.extend(entries.map(|e| (p.row_idx()[e], c, s.buffer[e])));
            }
            return Ok(());
        }
        if p.nnz() > 0 {
            // third derivatives of the surface would be needed
            return Err(EvalError::Recoverable);
        }
        self.gradient(s, k, &h.terms, at)?;
        let whole = s.whole(at);
        for flow in &self.flows {
            let at = &Point { x: &whole[..flow.f.dims().x], ..*at };
            let (taken, n) = flow.switched.map_or(([(0, 1.0, 0.0); 2], 1), |(k, _)| self.taken(s, k));
            let column = flow.switched.and_then(|(k, _)| self.loops[k].weight).map(|w| self.dims.n_in() + w);
            for (mode, weight, slope) in &taken[..n] {
                let by = flow.switched.map_or(0, |(_, n)| mode * n);
                let mut of_output = vec![0.0; flow.f.n_out()];
                flow.rows.iter().for_each(|(o, r)| of_output[by + o] = v * s.gradient[*r]);
                let Solver { buffer, other, work, .. } = s;
                let input = |c: usize| self.input_of(&flow.f, c);
                bends_of((&flow.f, at, &input), &of_output, (*weight, *slope, column), (buffer, other, work), out)?;
            }
        }
        Ok(())
    }

    /// Behind a transition of loop `k` from mode `before` into the next one: does the function that they are apart by go on, or does it
    /// come back? Then the surface is held, and its number among the modes is given.
    pub(super) fn comes_back(
        &self,
        s: &mut Solver,
        (k, before): (usize, usize),
        at: &Point,
    ) -> std::result::Result<Option<usize>, EvalError> {
        let (l, now) = (&self.loops[k], s.modes[k]);
        let is_between = |h: &Held| (h.low.min(h.high), h.low.max(h.high)) == (now.min(before), now.max(before));
        let Some(i) = l.held.iter().position(is_between) else { return Ok(None) };
        let h = &l.held[i];
        let toward = if h.high == now { 1.0 } else { -1.0 };
        let (there, weights) = s.full.split_at(self.dims.x);
        s.w.copy_from_slice(weights);
        let there = there.to_vec();
        let at = Point { x: &there, ..*at };
        let back = match h.by {
            By::Value => {
                let (v, rounding) = self.regions_at(k, &at)?;
                let sum = |of: &dyn Fn(usize, f64) -> f64| h.terms.iter().map(|(o, t)| of(*o, *t)).sum::<f64>();
                toward * sum(&|o, t| t * v[o]) < -sum(&|o, t| t.abs() * rounding[o])
            }
            By::Rate => {
                let (rate, size) = self.rate_of(s, k, &h.terms, &at)?;
                toward * rate <= NO_RATE * f64::EPSILON * size
            }
        };
        Ok(back.then_some(l.n_modes + i))
    }

    /// Loop `k` is in one of its own modes at a point with the solution: the mode on the other side of a surface that it is on, if the motion
    /// goes there.
    pub(super) fn goes_over(
        &self,
        (k, now): (usize, usize),
        at: &Point,
        v: &[f64],
        rounding: &[f64],
    ) -> std::result::Result<Option<usize>, EvalError> {
        let l = &self.loops[k];
        for h in l.held.iter().filter(|h| h.by == By::Rate && (h.low == now || h.high == now)) {
            let sum = |of: &dyn Fn(usize, f64) -> f64| h.terms.iter().map(|(o, t)| of(*o, *t)).sum::<f64>();
            if sum(&|o, t| t * v[o]).abs() > sum(&|o, t| t.abs() * rounding[o]) {
                continue;
            }
            let mut s = self.lock();
            let weights = s.full[self.dims.x..].to_vec();
            s.w.copy_from_slice(&weights);
            let (rate, size) = self.rate_of(&mut s, k, &h.terms, at)?;
            let (toward, other) = if h.low == now { (1.0, h.high) } else { (-1.0, h.low) };
            if toward * rate > NO_RATE * f64::EPSILON * size {
                return Ok(Some(other));
            }
        }
        Ok(None)
    }

    /// Puts the states in `x` that move onto the surfaces that are held by their rates; `size` is that of a state. Says whether any has moved.
    pub(crate) fn settle_held(
        &self,
        (t, u, p): (f64, &[f64], &[f64]),
        x: &mut [f64],
        size: &dyn Fn(usize, f64) -> f64,
    ) -> std::result::Result<bool, EvalError> {
        let mut moved = false;
        for _ in 0..if self.n_weights() > 0 { PASSES } else { 0 } {
            let mut again = false;
            for (k, l) in self.loops.iter().enumerate() {
                let mode = self.mode_at(k, x[self.dims.x + k]);
                let Some(h) = l.held.get(mode.wrapping_sub(l.n_modes)).filter(|h| h.by == By::Rate) else { continue };
                let at = Point { t, x: &x[..self.dims.x], u, p };
                let (v, rounding) = self.regions_at(k, &at)?;
                let value: f64 = h.terms.iter().map(|(o, t)| t * v[*o]).sum();
                let noise: f64 = h.terms.iter().map(|(o, t)| t.abs() * rounding[*o]).sum();
                if value.abs() <= noise / 32.0 {
                    continue;
                }
                let mut s = self.lock();
                let there = x[..self.dims.x].to_vec();
                self.gradient(&mut s, k, &h.terms, &Point { t, x: &there, u, p })?;
                let of = |i: usize| Some(size(i, there[i])).filter(|s| *s > 0.0).unwrap_or(1.0);
                let steep = |i: usize| if self.driven[i] { s.gradient[i] * of(i) } else { 0.0 };
                let total: f64 = (0..self.dims.x).map(|i| steep(i).powi(2)).sum();
                if total > 0.0 {
                    (0..self.dims.x).for_each(|i| x[i] -= value / total * steep(i) * of(i));
                    again = true;
                }
            }
            moved |= again;
            if !again {
                break;
            }
        }
        Ok(moved)
    }
}

/// Adds the second derivatives of outputs with these weights, times `weight`, and what comes by the weight in `column` whose slope is `slope`.
/// `room` is for the Hessian, the Jacobian, and work.
pub(super) fn bends_of(
    (f, at, input): (&SharedFunction, &Point, &dyn Fn(usize) -> usize),
    weights: &[f64],
    (weight, slope, column): (f64, f64, Option<usize>),
    (hess, jac, work): (&mut [f64], &mut [f64], &mut [f64]),
    out: &mut Vec<(usize, usize, f64)>,
) -> EvalResult {
    if weights.iter().all(|v| *v == 0.0) {
        return Ok(());
    }
    let p = f.hess_pattern();
    if p.nnz() > 0 {
        f.hessian(at, weights, &mut hess[..p.nnz()], work)?;
        for (c, entries) in p.columns() {
            out.extend(entries.map(|e| (input(p.row_idx()[e]), input(c), weight * hess[e])));
        }
    }
    if let Some(column) = column.filter(|_| slope != 0.0) {
        let p = f.jac_pattern();
        f.jacobian(at, &mut jac[..p.nnz()], work)?;
        for (c, entries) in p.columns() {
            out.extend(entries.map(|e| (input(c), column, slope * weights[p.row_idx()[e]] * jac[e])));
        }
    }
    Ok(())
}

/// The functions that give derivatives, and which states have one that is known to the equations: not those that other subsystems drive,
/// whose modes are not theirs.
pub(super) fn flows(system: &System, loop_of: &dyn Fn(usize) -> Option<usize>) -> (Vec<Flow>, Vec<bool>, Vec<bool>) {
    let (z, nx) = (system.algebraic_states(), system.dims.x);
    let (mut all, mut driven, mut known) = (Vec::new(), vec![false; nx], vec![true; nx]);
    if let Some(f) = &system.f0 {
        let rows: Vec<(usize, usize)> = (0..nx).filter(|r| !z.contains(r)).map(|r| (r, r)).collect();
        for (o, r) in &rows {
            driven[*r] |= f.jac_pattern().row_idx().contains(o);
        }
        all.push(Flow { f: f.clone(), rows, switched: None });
    }
    if let Some(m) = &system.mechanics {
        let rows: Vec<(usize, usize)> = (0..nx).filter(|r| !z.contains(r)).map(|r| (r, r)).collect();
        all.push(Flow { f: of_fewer(&m.smooth, system.dims), rows, switched: None });
    }
    for (k, s) in system.subsystems.iter().enumerate() {
        let own = loop_of(k);
        let rows: Vec<(usize, usize)> = s.rows.iter().copied().enumerate().filter(|r| !z.contains(&r.1)).collect();
        rows.iter().for_each(|r| driven[r.1] = true);
        if own.is_none() && s.n_modes > 1 {
            rows.iter().for_each(|r| known[r.1] = false);
        } else if !rows.is_empty() {
            all.push(Flow { f: s.modes.clone(), rows, switched: own.map(|k| (k, s.rows.len())) });
        }
    }
    // states that nothing but a constant drives move, too
    let discrete = system.discrete_states();
    (0..z.start).filter(|i| discrete.binary_search(i).is_err()).for_each(|i| driven[i] = true);
    if let Some(m) = &system.mechanics {
        // nor are those that the forces of contacts push; and coordinates stay where gaps are zero
        let pushed = m.pushed();
        known.iter_mut().zip(&pushed).filter(|k| *k.1).for_each(|k| *k.0 = false);
        driven.iter_mut().enumerate().filter(|(i, _)| *i < m.n_q || pushed[*i]).for_each(|d| *d.1 = false);
    }
    (all, driven, known)
}

/// Do the rows of two modes go over into each other where the sum of these functions vanishes? Looks at some points: there the difference of
/// each is one multiple of the sum.
pub(super) fn are_one(s: &Subsystem, psi: &SharedFunction, terms: &[(usize, f64)], modes: (usize, usize)) -> bool {
    let d = psi.dims();
    let n = s.rows.len();
    let (mut v, mut f) = (vec![0.0; psi.n_out()], vec![0.0; s.modes.n_out()]);
    let (mut work, mut own) = (vec![0.0; psi.work_len()], vec![0.0; s.modes.work_len()]);
    let mut ratios: Vec<Option<f64>> = vec![None; n];
    let mut compared = 0;
    let mut number = 0.5f64;
    for _ in 0..POINTS {
        // spread between -2 and 2, none of them special
        let inputs: Vec<f64> = (0..d.n_in())
            .map(|_| {
                number = (number + 0.618_033_988_749_895).fract();
                4.0 * number - 2.0
            })
            .collect();
        let (x, rest) = inputs.split_at(d.x);
        let (u, p) = rest.split_at(d.u);
        let at = Point { t: p[d.p], x, u, p: &p[..d.p] };
        if psi.value(&at, &mut v, &mut work).is_err() || s.modes.value(&at, &mut f, &mut own).is_err() {
            continue;
        }
        let sum: f64 = terms.iter().map(|(o, t)| t * v[*o]).sum();
        for (r, ratio) in ratios.iter_mut().enumerate() {
            let (a, b) = (f[modes.0 * n + r], f[modes.1 * n + r]);
            match ratio {
                None if sum != 0.0 => *ratio = Some((b - a) / sum),
                None => return false,
                Some(c) => {
                    let off = (b - a - *c * sum).abs();
                    if off.is_nan() || off > SAME * (a.abs() + b.abs()) {
                        return false;
                    }
                }
            }
        }
        compared += 1;
    }
    compared > 1
}
