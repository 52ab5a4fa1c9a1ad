//! Evaluation: the right-hand side under the active set and its parts, and what is watched.

use super::Field;
use crate::event::guard::Reset;
use crate::func::{EvalError, EvalResult, Point};

impl Field {
    /// The smooth part of the right-hand side.
    pub(in crate::event) fn drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        if self.bundled_drift(t, x, out) {
            return Ok(());
        }
        let at = Point { t, x, u: &self.u, p: &self.p };
        let mut rest = &self.drifts[..];
        if self.direct {
            rest = &self.drifts[1..];
            self.drifts[0].f.value(&at, out, &mut self.work)?;
        } else {
            out.fill(0.0);
        }
        for d in rest {
            d.f.value(&at, &mut self.buffer[..d.rows.len()], &mut self.work)?;
            for (v, &r) in self.buffer.iter().zip(&d.rows) {
                out[r] += v;
            }
        }
        Ok(())
    }

    /// Adds `weight` times the field of a cell.
    pub(in crate::event) fn add_mode(
        &mut self,
        t: f64,
        x: &[f64],
        cell: usize,
        weight: f64,
        out: &mut [f64],
    ) -> EvalResult {
        let at = Point { t, x, u: &self.u, p: &self.p };
        let s = &self.subs[self.owner[cell]];
        let mode = s.cells[cell - s.first].mode;
        let nr = s.rows.len();
        let rows = mode * nr..(mode + 1) * nr;
        s.modes.value_rows(&at, rows.clone(), &mut self.buffer[..s.n_out], &mut self.work)?;
        if s.identity {
            for (o, v) in out.iter_mut().zip(&self.buffer[rows]) {
                *o += weight * v;
            }
            return Ok(());
        }
        for (v, &r) in self.buffer[rows].iter().zip(&s.rows) {
            out[r] += weight * v;
        }
        Ok(())
    }

    /// Right-hand side; in a sliding mode with the weights that follow from time and state.
    #[inline]
    pub(in crate::event) fn rhs(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        if self.lone.is_some() {
            let f = self.rhs_view(t, x, &mut [])?;
            // a loop: a call to copy memory costs more than a few numbers
            for (o, v) in out.iter_mut().zip(f) {
                *o = v + 0.0;
            }
            return Ok(());
        }
        self.rhs_of_parts(t, x, out)
    }

    /// The same without a copy where one mode is the whole right-hand side; `room` is for the other cases.
    #[inline]
    pub(in crate::event) fn rhs_view<'a>(
        &'a mut self,
        t: f64,
        x: &[f64],
        room: &'a mut [f64],
    ) -> std::result::Result<&'a [f64], EvalError> {
        if let Some((from, to, n_out)) = self.lone {
            self.counts.values += 1;
            let at = Point { t, x, u: &self.u, p: &self.p };
            let modes = &self.subs[0].modes;
            modes.value_rows(&at, from..to, &mut self.buffer[..n_out], &mut self.work)?;
            return Ok(&self.buffer[from..to]);
        }
        self.rhs_of_parts(t, x, room)?;
        Ok(room)
    }

    fn rhs_of_parts(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        if self.contacts.is_some() {
            return self.scene_rhs(t, x, out);
        }
        if self.pairs.is_empty() {
            self.counts.values += 1;
            if self.bundled_rhs(t, x, out) {
                return Ok(());
            }
            self.drift(t, x, out)?;
            for k in 0..self.subs.len() {
                self.add_mode(t, x, self.active[k][0], 1.0, out)?;
            }
            return Ok(());
        }
        self.hidden(t, x)?;
        self.combine(out);
        Ok(())
    }

    /// `b + D α` of the last point with the weights it has.
    pub(in crate::event) fn combine(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.base);
        self.sliding.add_columns(&self.pairs, &self.alpha, out);
    }

    /// Sizes of the terms of `b + D α` of the last point.
    pub(in crate::event) fn combine_sizes(&self, out: &mut [f64]) {
        out.iter_mut().zip(&self.base).for_each(|(o, b)| *o = b.abs());
        for (i, alpha) in self.alpha.iter().enumerate().take(self.pairs.len()) {
            self.d(i).for_each(|(row, d)| out[row] += (alpha * d).abs());
        }
    }

    /// Evaluates `b` and `D`.
    pub(in crate::event) fn parts(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.contacts.is_some() {
            let mut base = std::mem::take(&mut self.base);
            let r = self.scene_rhs(t, x, &mut base);
            self.base = base;
            return r;
        }
        self.counts.values += 1;
        if self.bundled_parts(t, x) {
            return Ok(());
        }
        let mut base = std::mem::take(&mut self.base);
        let r = self.parts_into(t, x, &mut base);
        self.base = base;
        r
    }

    fn parts_into(&mut self, t: f64, x: &[f64], base: &mut [f64]) -> EvalResult {
        self.drift(t, x, base)?;
        let at = Point { t, x, u: &self.u, p: &self.p };
        for (k, s) in self.subs.iter().enumerate() {
            let (set, nr) = (&self.active[k], s.rows.len());
            let pairs = self.first_pair[k]..self.first_pair[k + 1];
            let own = self.sliding.columns_mut(pairs);
            for (i, &cell) in set.iter().enumerate().rev() {
                let mode = s.cells[cell - s.first].mode;
                let rows = mode * nr..(mode + 1) * nr;
                s.modes.value_rows(&at, rows.clone(), &mut self.buffer[..s.n_out], &mut self.work)?;
                let f = &self.buffer[rows];
                if i > 0 {
                    own[(i - 1) * nr..i * nr].copy_from_slice(f);
                    continue;
                }
                for column in own.chunks_exact_mut(nr.max(1)) {
                    column.iter_mut().zip(f).for_each(|(d, f)| *d -= f);
                }
                s.rows.iter().zip(f).for_each(|(&r, f)| base[r] += f);
            }
        }
        Ok(())
    }

    /// Indicator functions.
    pub(in crate::event) fn indicators(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.bundled_indicators(t, x) {
            return Ok(());
        }
        let at = Point { t, x, u: &self.u, p: &self.p };
        for s in &self.subs {
            s.indicators.value(&at, &mut self.q[s.q0..s.q0 + s.n_q], &mut self.work)?;
        }
        Ok(())
    }

    /// Gradients of the indicator functions.
    pub(in crate::event) fn gradients(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.valid.gradients && self.valid.constant {
            return Ok(());
        }
        match self.gradients_at(t, x) {
            Err(EvalError::Recoverable) => self.gradients_beside(t, x)?,
            r => r?,
        }
        self.valid.gradients = true;
        Ok(())
    }

    /// Everything that is watched: indicator functions, and the guards of the present discrete states.
    pub(in crate::event) fn watched(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.contacts.is_some() {
            self.scene_watched(t, x)?;
            return self.watched_beside(t, x);
        }
        self.indicators(t, x)?;
        self.watched_beside(t, x)
    }

    /// The same where the indicator functions are known at this point.
    #[inline]
    pub(in crate::event) fn watched_beside(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.guards.armed.is_empty() || self.bundled_guards(t, x) {
            return Ok(());
        }
        let at = Point { t, x, u: &self.u, p: &self.p };
        self.guards.values(&at, &mut self.q, &mut self.work)
    }

    /// Gradients of everything that is watched.
    pub(in crate::event) fn watched_gradients(&mut self, t: f64, x: &[f64]) -> EvalResult {
        self.gradients(t, x)?;
        if self.valid.guards && self.valid.constant {
            return Ok(());
        }
        if self.guards.armed.is_empty() {
            self.valid.guards = true;
            return Ok(());
        }
        let at = Point { t, x, u: &self.u, p: &self.p };
        let room = (&mut self.buffer[..], &mut self.work[..]);
        self.guards.gradients(&at, &mut self.dq, self.valid.constant, room)?;
        self.valid.guards = true;
        Ok(())
    }

    /// Guards of the discrete states of `x` are watched from here on.
    pub(in crate::event) fn arm(&mut self, x: &[f64]) {
        self.guards.arm(x);
        self.valid.guards = false;
    }

    /// Watches these transitions alone, whatever the discrete states are. What was watched before is given back.
    pub(in crate::event) fn watch_alone(&mut self, guards: Vec<usize>) -> Vec<usize> {
        self.valid.guards = false;
        std::mem::replace(&mut self.guards.armed, guards)
    }

    /// What transition `i` makes of the state.
    pub(in crate::event) fn reset(
        &mut self,
        i: usize,
        (t, x): (f64, &[f64]),
        derivatives: bool,
        out: &mut Reset,
    ) -> EvalResult {
        let at = Point { t, x, u: &self.u, p: &self.p };
        out.evaluate(&self.guards.all[i], &at, derivatives, (&mut self.buffer, &mut self.work))
    }
}
