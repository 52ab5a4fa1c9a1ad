//! Zeros of higher order.
//!
//! Where a function of time and state vanishes together with its rate, as `q - sin q`, Newton's method converges slowly to its zero or stops before
//! it, and next to it values are rounding. Where it is, and what comes behind it, is then said by signs alone: those of values that are
//! larger than rounding.

use super::search::Found;
use super::{recover, Engine, Progress, Tried, EPS};
use crate::error::Result;
use crate::event::watch::Watch;
use crate::func::{EvalError, EvalResult};

/// Rate of a function over a whole step, relative to the largest value in it, below which its zero need not be a simple one. One that is
/// costs a few evaluations more.
const FLAT: f64 = 1e-3;

/// Part of a value nearby that the rate at a simple zero makes at least.
const SIMPLE: f64 = 0.1;

/// So many roundings of its terms are no value.
const NEAR: f64 = 1e3;

/// A zero of higher order that a step has ended at.
#[derive(Debug, Clone)]
pub(super) struct Flat {
    /// Signs of values up to this one mean nothing.
    pub(super) level: f64,
    /// A time before and behind it at which gradients mean something.
    pub(super) beside: f64,
    /// They are so far away that derivatives are not accurate.
    pub(super) coarse: bool,
    /// Other functions that have one there: places, and levels. Transitions of those that are guards have not been made.
    others: Vec<(usize, f64)>,
}

/// Where a function is evaluated: at a relative time of the present step, or a time behind its end along the velocity there.
#[derive(Debug, Clone, Copy)]
enum Path {
    Dense,
    Line,
}

/// A place, and the value there.
type Sample = (f64, f64);

/// Places between which a function falls through zero: the last one before which it is certainly positive, the first one behind which it is
/// certainly negative.
#[derive(Debug, Clone, Copy)]
struct Edges {
    above: f64,
    below: f64,
    level: f64,
}

impl Edges {
    fn middle(&self) -> f64 {
        0.5 * (self.above + self.below)
    }
}

impl Engine {
    /// Ends the step, which was `full` long at first, at a zero of higher order if there is one next to its end. `None` if there is none: the
    /// step is as it was. `Some(None)` if that does not succeed.
    pub(super) fn land_if_flat(
        &mut self,
        l: usize,
        (rate, full): (f64, f64),
        slope: f64,
        grown: f64,
    ) -> Result<Option<Option<Progress>>> {
        if !self.may_be_flat(l, rate, full) || !recover(self.bends_at_zero(l, rate, full), false)? {
            return Ok(None);
        }
        let h = self.stepper.step.h;
        if let Some(p) = self.land_on_flat(l, full, slope, grown)? {
            return Ok(Some(Some(p)));
        }
        // its sign does not change, or there are several
        if !self.repeat(h)? || !recover(self.watched(l, self.t + h).map(|_| true), false)? {
            return Ok(Some(None));
        }
        Ok(None)
    }

    /// Is the rate next to the end of a step, which was `full` long at first, so small that its zero may be one of higher order?
    pub(super) fn may_be_flat(&self, l: usize, rate: f64, full: f64) -> bool {
        let w = &self.functions.watches[l];
        if w.is_affine(&self.field) || !matches!(w, Watch::Enter { .. } | Watch::Guard { .. }) {
            return false;
        }
        let size = self.functions.samples[l].iter().fold(self.functions.w0[l].abs(), |m, v| m.max(v.abs()));
        if rate.abs() * full > FLAT * size {
            return false;
        }
        // what is rounding all the way has no rate that says anything
        size > NEAR * EPS * w.scale(&self.field.dq, &self.field, self.stepper.step.t, &self.stepper.step.x1).value
    }

    /// Does the value before the end of the step, along the velocity there, come from more than the rate? At a distance that is larger than
    /// that of the zero, and so large that the rate would be seen.
    fn bends_at_zero(&mut self, l: usize, rate: f64, full: f64) -> std::result::Result<bool, EvalError> {
        /// Distances to the zero.
        const FAR: f64 = 30.0;
        let off = (self.value_on(l, Path::Line, 0.0)? / rate).abs();
        // rates of zero say nothing about how far it is
        let distance = if off.is_finite() { FAR * off } else { 0.0 }.max(EPS.sqrt() * full).min(0.5 * full);
        let value = self.value_on(l, Path::Line, -distance)?;
        self.value_on(l, Path::Line, 0.0)?;
        Ok(rate.abs() * distance <= SIMPLE * value.abs())
    }

    /// Ends the step at a zero of higher order, and switches there. `None` if the signs of the function do not change in it.
    fn land_on_flat(&mut self, l: usize, full: f64, slope: f64, grown: f64) -> Result<Option<Progress>> {
        /// Steps until the end is next to the zero.
        const TRIES: usize = 8;
        if !self.repeat(full)? || !recover(self.write_dense().map(|()| true), false)? {
            return Ok(None);
        }
        let most = self.t_stop - self.t;
        let mut h = full.min(most);
        if let Some(signs) = self.signs_in_samples(l) {
            let Some(found) = recover(self.edges(l, Path::Dense, signs).map(Some), None)?.flatten() else {
                return Ok(None);
            };
            h = h.min(found.middle() * full);
        }
        let floor = 4.0 * EPS * self.t.abs().max(full);
        let mut width = floor;
        for k in 0.. {
            if h <= floor || !self.repeat(h)? {
                return Ok(None);
            }
            let signs = recover(self.signs_around(l, width, full).map(Some), None)?.flatten();
            let edges = match signs {
                Some(signs) => recover(self.edges(l, Path::Line, signs).map(Some), None)?.flatten(),
                None => None,
            };
            let Some(edges) = edges else { return Ok(None) };
            let delta = edges.middle();
            if self.may_be_straight(delta, l) || k == TRIES {
                return self.end_at_flat(l, edges, full, slope, grown).map(Some);
            }
            if h + delta >= most && h == most {
                // it lies behind the time asked for
                let t_stop = self.t_stop;
                self.functions.w1[..self.functions.watches.len()].fill(f64::NAN);
                self.accept(t_stop)?;
                self.stepper.h = grown;
                return Ok(Some(Progress::Stepped));
            }
            width = width.max(edges.below - edges.above);
            h = (h + delta).min(most);
        }
        Ok(None)
    }

    /// Does the step with another length.
    pub(super) fn repeat(&mut self, h: f64) -> Result<bool> {
        self.stepper.step.h = h;
        self.log.stats.relocations += 1;
        Ok(matches!(self.attempt()?, Tried::Error(e) if e <= 10.0) && self.finish()?)
    }

    /// Relative times of the step at which the sampled function was positive, and negative or zero, one behind the other. `None` if all samples
    /// are positive: the zero is behind the last one.
    fn signs_in_samples(&self, l: usize) -> Option<(f64, f64)> {
        let samples = &self.functions.samples[l];
        let first = (1..samples.len()).find(|i| samples[*i] <= 0.0)?;
        Some((self.functions.sampler.nodes[first - 1], self.functions.sampler.nodes[first]))
    }

    /// Value of a watched function.
    fn value_on(&mut self, l: usize, path: Path, at: f64) -> std::result::Result<f64, EvalError> {
        let t = match path {
            Path::Dense => {
                self.stepper.step.at(at, &mut self.stepper.node);
                self.stepper.step.t + at * self.stepper.step.h
            }
            Path::Line => {
                let s = &self.stepper.step;
                self.stepper.node.iter_mut().zip(s.x1.iter().zip(&s.f1)).for_each(|(y, (x, f))| *y = x + at * f);
                s.t + s.h + at
            }
        };
        self.field.watched(t, &self.stepper.node)?;
        Ok(self.functions.watches[l].value(&self.field.q, &self.field))
    }

    /// Times relative to the end of the step before and behind its zero, at which the function has signs; the first ones that are tried are
    /// `near` it.
    fn signs_around(&mut self, l: usize, near: f64, full: f64) -> std::result::Result<Option<(f64, f64)>, EvalError> {
        let mut ends = [0.0; 2];
        let here = self.value_on(l, Path::Line, 0.0)?;
        for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
            // before it the function is positive
            let mut distance = near;
            let mut value = here;
            while value * sign >= 0.0 {
                if distance > 0.5 * full.min(self.stepper.step.h) {
                    return Ok(None);
                }
                *end = sign * distance;
                value = self.value_on(l, Path::Line, *end)?;
                distance *= 2.0;
            }
        }
        Ok(Some((ends[0], ends[1])))
    }

    /// Where the function falls through zero between two places.
    fn edges(&mut self, l: usize, path: Path, (from, to): (f64, f64)) -> std::result::Result<Option<Edges>, EvalError> {
        let unit = match path {
            Path::Dense => self.stepper.step.h,
            Path::Line => 1.0,
        };
        let finest = 4.0 * EPS * self.t.abs().max(self.stepper.step.h) / unit;
        let (low, high) = self.bisect(l, path, (from, to), 0.0, finest)?;
        if low.1 <= 0.0 || high.1 > 0.0 {
            return Ok(None);
        }
        let noise = self.noise_on(l, path, 0.5 * (low.0 + high.0), finest)?;
        let above = self.bisect(l, path, (from, high.0), noise, finest)?.0;
        let below = if self.value_on(l, path, to)? < -noise {
            self.bisect(l, path, (low.0, to), -noise, finest)?.1
        } else {
            (to, noise)
        };
        let level = above.1.abs().max(below.1.abs()).max(2.0 * noise);
        Ok((above.0 <= below.0).then_some(Edges { above: above.0, below: below.0, level }))
    }

    /// Two places, as near to each other as this, between which the function falls to less than `limit`, with its values.
    fn bisect(
        &mut self,
        l: usize,
        path: Path,
        (from, to): (f64, f64),
        limit: f64,
        finest: f64,
    ) -> std::result::Result<(Sample, Sample), EvalError> {
        let mut low = (from, self.value_on(l, path, from)?);
        let mut high = (to, self.value_on(l, path, to)?);
        while high.0 - low.0 > finest {
            let at = 0.5 * (low.0 + high.0);
            if at <= low.0 || at >= high.0 {
                break;
            }
            let value = self.value_on(l, path, at)?;
            // zero, which is on neither side, is behind the first edge and before the second
            let falls = if limit.is_sign_negative() { value < limit } else { value <= limit };
            *if falls { &mut high } else { &mut low } = (at, value);
        }
        Ok((low, high))
    }

    /// What rounding makes of values: from the fourth differences of values at places that differ by rounding (J. J. Moré, S. M. Wild, Estimating
    /// computational noise, SIAM J. Sci. Comput. 33 (2011) 1292-1314, (2.2)).
    fn noise_on(&mut self, l: usize, path: Path, at: f64, finest: f64) -> std::result::Result<f64, EvalError> {
        const ORDER: usize = 4;
        /// `(k!)² / (2k)!` of the order.
        const SHARE: f64 = 1.0 / 70.0;
        let mut table = [0.0; 3 * ORDER];
        for (i, v) in table.iter_mut().enumerate() {
            *v = self.value_on(l, path, at + (i as f64 - 1.5 * ORDER as f64) * finest)?;
        }
        for k in 1..=ORDER {
            (0..table.len() - k).for_each(|i| table[i] = table[i + 1] - table[i]);
        }
        let differences = &table[..2 * ORDER];
        let mean = differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64;
        // signs are wrong where several of these come together
        Ok(ORDER as f64 * (SHARE * mean).sqrt())
    }

    /// What a zero is like at a place, where the function has no sign for a time `width`, or is rounding up to `level`.
    fn flat_at(&mut self, l: usize, at: f64, (level, width): (f64, f64), full: f64) -> Result<Flat> {
        // rounding of gradients of a zero of order three, and what they change by, are as large at this distance
        let fine = EPS.sqrt().sqrt() * full.max(self.usual_step());
        let beside = fine.max(2.0 * width);
        let mut level = level.max(f64::MIN_POSITIVE);
        for side in [-beside, beside] {
            let value = recover(self.value_on(l, Path::Line, at + side).map(Some), None)?;
            level = value.map_or(level, |v| level.max(v.abs()));
        }
        Ok(Flat { level, beside, coarse: beside > fine, others: Vec::new() })
    }

    /// Adds the other functions that fall through a zero of higher order at a time behind the end of the step.
    fn find_others(&mut self, l: usize, flat: &mut Flat, delta: f64) -> EvalResult {
        let mut values = [0.0; 2].map(|_| Vec::new());
        for (list, side) in values.iter_mut().zip([-flat.beside, flat.beside]) {
            self.value_on(l, Path::Line, delta + side)?;
            list.extend(self.functions.watches.iter().map(|w| w.value(&self.field.q, &self.field)));
        }
        self.value_on(l, Path::Line, delta)?;
        self.field.watched_gradients(self.stepper.step.t + self.stepper.step.h + delta, &self.stepper.node)?;
        let [before, behind] = &values;
        for (m, w) in self.functions.watches.iter().enumerate().filter(|(m, w)| *m != l && !w.is_affine(&self.field)) {
            let Some(a) = w.place().filter(|_| before[m] > 0.0 && behind[m] < 0.0) else { continue };
            let rate = w.rate(&self.field.dq, &self.field, &self.stepper.step.f1);
            let level = before[m].max(-behind[m]);
            if !matches!(w, Watch::Contact { .. }) && rate.abs() * flat.beside <= FLAT * level {
                flat.others.push((a, level));
            }
        }
        Ok(())
    }

    /// Notes in which functions signs of small values mean nothing where watch `l` has vanished.
    pub(super) fn note_levels(&mut self, l: usize) {
        if let Some(a) = self.functions.watches[l].place() {
            self.functions.levels[a] = self.functions.flat.as_ref().map_or(0.0, |f| f.level);
        }
        for (a, level) in self.functions.flat.iter().flat_map(|f| &f.others) {
            self.functions.levels[*a] = *level;
        }
    }

    /// Does the guard at place `a` vanish at the zero of another function, and has its transition not been made?
    pub(super) fn is_due(&self, a: usize) -> bool {
        self.functions.flat.as_ref().is_some_and(|f| f.others.iter().any(|o| o.0 == a))
    }

    /// The transition of the guard at place `a` is made.
    pub(super) fn note_made(&mut self, a: usize) {
        if let Some(f) = &mut self.functions.flat {
            f.others.retain(|o| o.0 != a);
        }
    }

    /// Ends the step at a zero of higher order between these edges.
    fn end_at_flat(&mut self, l: usize, edges: Edges, full: f64, slope: f64, grown: f64) -> Result<Progress> {
        let delta = edges.middle();
        let width = edges.below - edges.above;
        let mut flat = self.flat_at(l, delta, (edges.level, width), full)?;
        recover(self.find_others(l, &mut flat, delta).map(|()| true), false)?;
        self.functions.flat = Some(flat);
        self.stepper.step.x1.iter_mut().zip(&self.stepper.step.f1).for_each(|(x, f)| *x += delta * f);
        let t = (self.t + self.stepper.step.h + delta).min(self.t_stop);
        if self.field.n_alg() > 0 {
            let r = self.field.rhs(t, &self.stepper.step.x1, &mut self.stepper.node).map(|()| true);
            recover(r, false)?;
        }
        let known =
            (0..self.nx).map(|i| self.tolerance_of(i) / self.stepper.step.f1[i].abs()).fold(f64::INFINITY, f64::min);
        if width > known.max(64.0 * EPS * t.abs()) && self.log.reason.is_empty() {
            self.log.reason = format!(
                "t = {t}: a switching function or guard is so flat where it vanishes that between t - {half:.1e} and t + {half:.1e} its \
                 value is rounding, and the tolerances ask for {known:.1e}: state one that vanishes with a rate",
                half = 0.5 * width
            );
        }
        self.functions.w1[..self.functions.watches.len()].fill(f64::NAN);
        self.accept(t)?;
        let grown = if self.note_end(true) { grown.min(self.stepper.step.h) } else { grown };
        self.switch(l, slope, grown)
    }

    /// Derivatives of the time of a zero of higher order: the ratio of gradient and rate has a limit there, which is the mean of those on
    /// both sides up to the square of their distance.
    pub(super) fn time_gradient_at_flat(&mut self, l: usize, beside: f64) -> EvalResult {
        let mut row = std::mem::take(&mut self.derivatives.time_row);
        let mut mean = vec![0.0; row.len()];
        let mut at = self.x.clone();
        let mut known = Ok(());
        for side in [-beside, beside] {
            at.iter_mut().zip(self.x.iter().zip(&self.f)).for_each(|(y, (x, f))| *y = x + side * f);
            let t = self.t + side;
            known = self.field.watched_gradients(t, &at);
            if known.is_ok() {
                known = self.functions.watches[l].time_gradient(&mut self.field, (t, &at, &self.f), &mut row);
            }
            if known.is_err() {
                break;
            }
            mean.iter_mut().zip(&row).for_each(|(m, r)| *m += 0.5 * r);
        }
        row.copy_from_slice(&mean);
        self.derivatives.time_row = row;
        known?;
        self.field.watched_gradients(self.t, &self.x)
    }

    /// Is a value rounding, next to a zero of higher order?
    pub(super) fn is_level(&self, w: &Watch, value: f64) -> bool {
        let level = self.level(w);
        level > 0.0 && value.abs() <= level
    }

    /// Values of a watched function up to this one are rounding where it vanished last; zero where that was no zero of higher order.
    pub(super) fn level(&self, w: &Watch) -> f64 {
        w.place().map_or(0.0, |a| self.functions.levels[a])
    }

    /// The same if the step begins there, else zero.
    pub(super) fn level_at_start(&self, l: usize) -> f64 {
        let level = self.level(&self.functions.watches[l]);
        if self.functions.depart[l] == 2 && self.functions.w0[l].abs() <= level {
            level
        } else {
            0.0
        }
    }

    /// The first zero of a sampled function in a step that begins at one of higher order, whose order is not known; `None` where
    /// the step does not begin so.
    pub(super) fn first_behind_flat(&self, l: usize) -> Option<Found> {
        /// The step is too long by much.
        const LONG: f64 = 16.0;
        let level = self.level_at_start(l);
        if level == 0.0 {
            return None;
        }
        let (samples, nodes) = (&self.functions.samples[l], &self.functions.sampler.nodes);
        let Some(seen) = (1..samples.len()).find(|i| samples[*i].abs() > level) else { return Some(Found::Nothing) };
        if samples[seen] < 0.0 {
            // what lies ahead of the start is positive
            return Some(Found::Coarse(LONG));
        }
        let falls = (seen + 1..samples.len()).find(|i| samples[*i] <= 0.0);
        Some(falls.map_or(Found::Nothing, |i| {
            let slope = (samples[i] - samples[i - 1]) / (nodes[i] - nodes[i - 1]);
            Found::Zero(l, nodes[i] - samples[i] / slope, slope / self.stepper.step.h)
        }))
    }

    /// Does a guard that has just had a zero of higher order go on below zero, in the present modes? The first value ahead that is no rounding
    /// says so.
    pub(super) fn falls_ahead(&mut self, l: usize, level: f64) -> std::result::Result<bool, EvalError> {
        let most = self.usual_step();
        let mut ahead = 64.0 * EPS * self.t.abs().max(most);
        let mut value = self.functions.watches[l].value(&self.functions.q0, &self.field);
        while value.abs() <= level && ahead <= most {
            self.stepper.node.iter_mut().zip(self.x.iter().zip(&self.f)).for_each(|(y, (x, f))| *y = x + ahead * f);
            self.field.watched(self.t + ahead, &self.stepper.node)?;
            value = self.functions.watches[l].value(&self.field.q, &self.field);
            ahead *= 2.0;
        }
        self.field.watched(self.t, &self.x)?;
        Ok(value < 0.0)
    }
}
