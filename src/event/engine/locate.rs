//! The location of a switch: the step repeated with the length that puts the switch at its end.

use super::control::ACCURATE;
use super::{recover, Engine, Progress, Tried, EPS};
use crate::error::Result;
use crate::event::watch::Watch;
use crate::func::EvalError;

/// A step so much shorter than the time between the last two jumps by one guard shows nothing but rounding of a guard.
const ROUNDING: f64 = 1e-3;

/// Attempts at a location whose lengths Newton's method chooses alone, and attempts at all where the sign of what vanishes
/// changes: functions like `sqrt |x|` have a zero that the polynomials of a method do not follow.
const PATIENT: usize = 6;
const MOST: usize = 48;

/// Lengths of a step between which what is watched changes its sign.
#[derive(Debug, Clone, Copy, Default)]
struct Bracket {
    before: Option<f64>,
    behind: Option<f64>,
}

impl Bracket {
    fn note(&mut self, h: f64, value: f64) {
        let side = if value > 0.0 { &mut self.before } else { &mut self.behind };
        *side = Some(h);
    }

    fn width(&self) -> f64 {
        self.before.zip(self.behind).map_or(f64::INFINITY, |(low, high)| high - low)
    }

    /// A length inside, by bisection where `next` is not well inside; none where the signs say nothing.
    fn middle(&self, next: f64) -> Option<f64> {
        let (Some(low), Some(high)) = (self.before, self.behind) else { return None };
        let margin = 0.1 * (high - low);
        Some(if next > low + margin && next < high - margin { next } else { 0.5 * (low + high) }).filter(|_| low < high)
    }
}

/// How an attempt to end a step on its dense output ended.
enum Inside {
    Landed(Progress),
    /// There is no zero, or another one before it.
    Missed,
    /// The zero may be one of higher order, which dense output does not show. The step is as it was.
    Flat,
}

impl Engine {
    /// Repeats the step with the length that makes the watched function vanish at its end, and switches there. `None`
    /// if that does not succeed. No step goes beyond the time asked for: a switch that turns out to lie behind it is left
    /// to the next call.
    pub(super) fn land(&mut self, l: usize, s: f64, slope: f64, grown: f64) -> Result<Option<Progress>> {
        self.functions.flat = None;
        if self.ends_inside(l, s) {
            match self.land_inside(l, s, slope, grown)? {
                Inside::Landed(p) => return Ok(Some(p)),
                Inside::Missed => return Ok(None),
                Inside::Flat => {}
            }
        }
        let full = self.stepper.step.h;
        let mut h = s * full;
        let floor = 4.0 * EPS * self.t.abs().max(full);
        if h <= floor && self.functions.depart[l] == 1 && matches!(self.functions.watches[l], Watch::Guard { .. }) {
            // a guard that has just been left with a positive rate: the step is too long for its interpolation, or so short
            // that all is rounding
            let before =
                self.calendar.recent.of(self.source(&self.functions.watches[l])).back(0).unwrap_or(self.t_start);
            let flight =
                self.calendar.recent.of(self.source(&self.functions.watches[l])).gap(0).unwrap_or(self.t - before);
            if self.stepper.step.h > ROUNDING * flight {
                return Ok(None);
            }
            return Ok(Some(self.end_at_accumulation(self.t)));
        }
        if h <= floor {
            // at the start itself: the active set was not the right one
            self.log.stats.relocations += 1;
            return self.switch(l, slope, 0.25 * full).map(Some);
        }
        let (mut slope, mut before, mut last) = (slope, None, f64::NAN);
        let base = self.begins_at(l);
        // what the interpolation says may be off by a little
        let most = (1.1 * full).min(self.t_stop - self.t);
        let end = self.functions.w1[l];
        // between two zeros that nearly are one (a short flight in a long step) the way is halved until it is between them
        let tries = if self.functions.watches[l].is_left_by_jumps() { 60 } else { 12 };
        let bracketed = matches!(self.functions.watches[l], Watch::Enter { .. });
        let mut bracket = Bracket::default();
        for k in 0..if bracketed { MOST } else { tries } {
            self.stepper.step.h = h;
            self.log.stats.relocations += 1;
            match self.attempt()? {
                Tried::Error(e) if e <= 10.0 => {}
                _ => return Ok(None),
            }
            if !self.finish()? {
                return Ok(None);
            }
            let Some((value, rate)) = recover(self.watched(l, self.t + h).map(Some), None)? else { return Ok(None) };
            let value = value - base;
            last = rate;
            if let Some((v, at)) = before {
                let secant: f64 = (value - v) / (h - at);
                if secant < 0.0 {
                    slope = secant;
                }
            }
            before = Some((value, h));
            // next to an accumulation a zero with a rate of the other sign is not found yet: roots are steep there
            let steep = rate >= 0.0 && self.sharpness() < 1.0;
            let rate = if rate < 0.0 { rate } else { slope };
            let delta = -value / rate;
            if !delta.is_finite() {
                return Ok(None);
            }
            if delta.abs() <= 1e-8 * h || delta.abs() <= floor || !steep && self.is_short(delta, l) {
                if let Some(p) = self.land_if_flat(l, (rate, full), slope, grown)? {
                    return Ok(p);
                }
                // forces of bodies that carry each other vanish together, and no step lies between them
                let at_once = self.field.has_contacts() && h <= self.no_time();
                if self.overlooked(l) && !at_once || self.comes_slowly(l, rate) {
                    return Ok(None);
                }
                return self.touch_down(l, slope, grown).map(Some);
            }
            if h >= most && delta > 0.0 && most < 1.1 * full {
                return self.pass(l, slope, grown, end);
            }
            let next = (h + delta).max(0.2 * h).min((5.0 * h).min(most));
            bracket.note(h, value);
            h = match (k < PATIENT, bracket.middle(next)) {
                (true, _) => next,
                (false, Some(_)) if bracket.width() <= floor => break,
                (false, Some(h)) => h,
                (false, None) if k < tries => next,
                // there is no change of sign
                (false, None) => break,
            };
        }
        if let (Some((value, _)), Watch::Leave { .. }) = (before, self.functions.watches[l]) {
            // weights are between 0 and 1: what is far from zero is not where it vanishes
            let rtol = self.rtol.iter().fold(0.0f64, |m, v| m.max(*v));
            if value > rtol.sqrt() {
                return Ok(None);
            }
        }
        if let Some(p) = self.land_if_flat(l, (last, full), slope, grown)? {
            return Ok(p);
        }
        // grazing: the length hardly matters for the value any more
        if let (Some((value, _)), Watch::Contact { .. }) = (before, self.functions.watches[l]) {
            let rtol = self.rtol.iter().fold(0.0f64, |m, v| m.max(*v));
            if value > rtol * self.functions.watches[l].scale(&self.functions.dq0, &self.field, self.t, &self.x).value {
                // there is no zero here: the step is too long for its interpolation
                return Ok(None);
            }
        }
        self.touch_down(l, slope, grown).map(Some)
    }

    /// May the step end where its dense output says, at relative time `s`? That is about as accurate as its error. It has the values and
    /// the velocities of both ends, so what it is off by in between has the factor `s² (1 − s)²`: a step that was to end at this switch
    /// has to end next to it, where that hardly costs accuracy.
    fn ends_inside(&self, l: usize, s: f64) -> bool {
        /// Part of what it is off by in the middle.
        const NEAR: f64 = 0.05;
        if !self.may_end_inside() || !self.stepper.dense_ready || self.functions.depart[l] != 0 {
            return false;
        }
        let w = self.functions.watches[l];
        let of_cell = matches!(w, Watch::Enter { .. } | Watch::Leave { .. });
        let straight = matches!(w, Watch::Guard { .. }) && w.is_affine(&self.field);
        let off = (4.0 * s * (1.0 - s)).powi(2);
        let near = self.foresight.foreseen && s > 0.5 && off <= NEAR && off * self.stepper.tried <= ACCURATE;
        near && (of_cell || straight) || of_cell && self.stepper.tried <= ACCURATE
    }

    /// Ends the step where the watched function vanishes on its dense output, and switches there.
    fn land_inside(&mut self, l: usize, mut s: f64, slope: f64, grown: f64) -> Result<Inside> {
        let full = self.stepper.step.h;
        let w = self.functions.watches[l];
        if !w.is_affine(&self.field) {
            // Newton's method comes to a zero of higher order slowly, if it does
            match self.sharpen(l, s, slope)? {
                Some(found) => s = found,
                None if w.is_leave() => return Ok(Inside::Missed),
                None => return Ok(Inside::Flat),
            }
        }
        if s * full <= 4.0 * EPS * self.t.abs().max(full) {
            return Ok(Inside::Missed);
        }
        self.log.stats.relocations += 1;
        self.stepper.step.end_at(s);
        // so much of the error of the end has been made
        self.stepper.tried *= s * s * (3.0 - 2.0 * s);
        let mut t = (self.t + self.stepper.step.h).min(self.t_stop);
        self.settle_beside_guard(l, t)?;
        let Some((mut value, mut rate)) = recover(self.watched(l, t).map(Some), None)? else {
            return Ok(Inside::Missed);
        };
        if self.may_be_flat(l, rate, full) {
            return Ok(if self.repeat(full)? { Inside::Flat } else { Inside::Missed });
        }
        // the last digits, along the velocity
        for _ in 0..if w.is_leave() { 0 } else { 3 } {
            let end = &self.stepper.step;
            let rounding = w.rounding_of_zero(&self.field.dq, &self.field, (t, &end.x1), &end.f1);
            let rate_now = if rate < 0.0 { rate } else { slope };
            let most = 0.01 * self.stepper.step.h;
            let delta = (-value / rate_now).clamp(-most, most.min(self.t_stop - t));
            if value.abs() <= rounding || delta == 0.0 {
                break;
            }
            if !self.may_be_straight(delta, l) {
                // a zero of the dense output alone, which is off by more than the function changes: a shorter step has none
                return Ok(Inside::Missed);
            }
            self.stepper.step.x1.iter_mut().zip(&self.stepper.step.f1).for_each(|(x, f)| *x += delta * f);
            t += delta;
            self.settle_beside_guard(l, t)?;
            match recover(self.watched(l, t).map(Some), None)? {
                Some(found) => (value, rate) = found,
                None => return Ok(Inside::Missed),
            }
        }
        // the weights there, and the velocity that the switch begins with
        let r = self.field.rhs(t, &self.stepper.step.x1, &mut self.stepper.step.f1);
        if !recover(r.map(|()| true), false)? || self.overlooked(l) {
            return Ok(Inside::Missed);
        }
        self.functions.w1[..self.functions.watches.len()].fill(f64::NAN);
        self.accept(t)?;
        // derivatives evaluate the field elsewhere
        self.known_end = self.derivatives.sens.is_none() && self.notes.is_none();
        let grown = if self.note_end(true) { grown.min(self.stepper.step.h) } else { grown };
        self.switch(l, slope, grown).map(Inside::Landed)
    }

    /// Relative time of a zero on the dense output next to `s` of what is no straight function of the state.
    fn sharpen(&mut self, l: usize, mut s: f64, slope: f64) -> Result<Option<f64>> {
        /// Part of the step.
        const SHARP: f64 = 1e-8;
        let w = self.functions.watches[l];
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..6 {
            let t = self.stepper.step.t + s * self.stepper.step.h;
            self.stepper.step.at(s, &mut self.stepper.node);
            let alone = match w {
                Watch::Leave { cell, .. } => self.field.weight_alone(cell, t, &self.stepper.node),
                _ => None,
            };
            let r = match w {
                _ if alone.is_some() => Ok(()),
                Watch::Leave { .. } => self.field.hidden(t, &self.stepper.node),
                _ => self.field.watched(t, &self.stepper.node),
            };
            if !recover(r.map(|()| true), false)? {
                return Ok(None);
            }
            let value = alone.unwrap_or_else(|| w.value(&self.field.q, &self.field));
            let secant = before.map_or(f64::NAN, |(v, at)| (value - v) / (s - at));
            let per_step = if secant < 0.0 { secant } else { slope * self.stepper.step.h };
            before = Some((value, s));
            let next = s - value / per_step;
            // NaN fails too
            if !(next > 0.0 && next <= 1.0) {
                return Ok(None);
            }
            if (next - s).abs() <= SHARP * s {
                return Ok(Some(next));
            }
            s = next;
        }
        Ok(None)
    }

    /// The step to the time asked for, which a watched function seemed to vanish in; `end` is its value there.
    fn pass(&mut self, l: usize, slope: f64, grown: f64, end: f64) -> Result<Option<Progress>> {
        if end <= 0.0 || self.stepper.step.t + self.stepper.step.h < self.t_stop {
            return self.touch_down(l, slope, grown).map(Some);
        }
        let t_stop = self.t_stop;
        self.accept(t_stop)?;
        self.stepper.h = grown;
        Ok(Some(Progress::Stepped))
    }

    /// Does another watched function say that a switch before this one was missed? Then a shorter step shows it.
    pub(super) fn overlooked(&self, l: usize) -> bool {
        self.functions.looked.iter().any(|&m| {
            let w = &self.functions.watches[m];
            let value = w.value(&self.field.q, &self.field);
            if m == l || self.functions.depart[m] != 0 || value >= 0.0 {
                return false;
            }
            let near = 1e4 * EPS * w.scale(&self.field.dq, &self.field, self.t, &self.stepper.step.x1).value;
            value < -near.max(1e-2 * self.functions.w0[m])
        })
    }

    /// Is a straight line over this time as good as the step, with a margin?
    pub(super) fn is_short(&self, delta: f64, l: usize) -> bool {
        let s = &self.stepper.step;
        // what is lost at every impact has the same sign: over ten thousand of them it adds up
        let share = if matches!(self.functions.watches[l], Watch::Contact { .. }) { 1e7 } else { 1e3 };
        let bend = share * delta * delta / s.h;
        let straight = (0..self.nx).all(|i| bend * (s.f1[i] - s.f0[i]).abs() * self.stepper.weights[i] <= 1.0);
        !self.stepper.step_implicit && delta.abs() <= 0.01 * s.h && straight
    }

    /// May the last digits be a straight line over this time? Where a function hardly changes, rounding of its value is a long time.
    pub(super) fn may_be_straight(&self, delta: f64, l: usize) -> bool {
        let floor = 4.0 * EPS * self.t.abs().max(self.stepper.step.h);
        self.stepper.step_implicit && delta.is_finite()
            || delta.abs() <= (1e-8 * self.stepper.step.h).max(floor)
            || self.is_short(delta, l)
    }

    /// What a watched function that begins a little below zero comes back to, see [`Watch::may_begin_below`]; else zero.
    pub(super) fn begins_at(&self, l: usize) -> f64 {
        let below = self.functions.depart[l] > 0 && self.functions.watches[l].may_begin_below();
        if below {
            self.functions.w0[l].min(0.0)
        } else {
            0.0
        }
    }

    /// Value and rate of a watched function at the end of the step; the rate of a weight is NaN.
    pub(super) fn watched(&mut self, l: usize, t: f64) -> std::result::Result<(f64, f64), EvalError> {
        let w = self.functions.watches[l];
        self.field.watched(t, &self.stepper.step.x1)?;
        self.field.watched_gradients(t, &self.stepper.step.x1)?;
        let value = w.value(&self.field.q, &self.field);
        let rate = match w {
            Watch::Leave { .. } => f64::NAN,
            _ => w.rate_in(&self.field.q, &self.field.dq, &self.field, &self.stepper.step.f1),
        };
        Ok((value, rate))
    }

    /// The same where only this function has to be known.
    fn watched_alone(&mut self, l: usize, t: f64) -> std::result::Result<(f64, f64), EvalError> {
        let Watch::Contact { contact, what, .. } = self.functions.watches[l] else { return self.watched(l, t) };
        match self.field.contact_alone((contact, what), (t, &self.stepper.step.x1), &self.stepper.step.f1)? {
            Some(found) => Ok(found),
            None => self.watched(l, t),
        }
    }

    /// The last digits of the switching time: along the velocity, which is exact to rounding over so short a time.
    pub(super) fn touch_down(&mut self, l: usize, slope: f64, grown: f64) -> Result<Progress> {
        let mut t = (self.t + self.stepper.step.h).min(self.t_stop);
        let base = self.begins_at(l);
        for k in 0..4 {
            // all that is watched is known where the step ends
            let found = if k == 0 { self.watched(l, t) } else { self.watched_alone(l, t) }.map(Some);
            let Some((value, rate)) = recover(found, None)? else { break };
            let value = value - base;
            let rate = if rate < 0.0 { rate } else { slope };
            let end = &self.stepper.step;
            let w = &self.functions.watches[l];
            let rounding = w.rounding_of_zero(&self.field.dq, &self.field, (t, &end.x1), &end.f1);
            let most = if self.stepper.step_implicit { 1e-6 } else { 0.01 } * self.stepper.step.h;
            let delta = (-value / rate).max(-most).min(most.min(self.t_stop - t));
            if value.abs() <= rounding || !self.may_be_straight(delta, l) || delta == 0.0 {
                break;
            }
            for (x, f) in self.stepper.step.x1.iter_mut().zip(&self.stepper.step.f1) {
                *x += delta * f;
            }
            t += delta;
            if self.field.n_alg() > 0 {
                self.settle_beside_guard(l, t)?;
                // the weights at the new point
                let r = self.field.rhs(t, &self.stepper.step.x1, &mut self.stepper.node).map(|()| true);
                if !recover(r, false)? {
                    break;
                }
            }
        }
        self.functions.w1[..self.functions.watches.len()].fill(f64::NAN);
        self.accept(t)?;
        let grown = if self.note_end(true) { grown.min(self.stepper.step.h) } else { grown };
        self.switch(l, slope, grown)
    }

    /// Puts the end of an explicit step that ends at a guard onto the surfaces that slide, which a straight line and the dense output leave. What
    /// follows begins there: a guard that was at zero beside the surfaces would not be at zero on them, and pass it once more.
    fn settle_beside_guard(&mut self, l: usize, t: f64) -> Result<()> {
        let slides = self.field.n_alg() > 0 && !self.field.has_contacts() && !self.field.in_limit_set();
        if slides && !self.stepper.step_implicit && matches!(self.functions.watches[l], Watch::Guard { .. }) {
            recover(self.field.project(t, &mut self.stepper.step.x1).map(|_| true), false)?;
        }
        Ok(())
    }

    /// Where a function is not defined beyond a surface, steps only come near it: the rest, no longer than rounding,
    /// goes along the velocity.
    pub(super) fn reach_surface(&mut self) -> Result<Option<Progress>> {
        let nx = self.nx;
        let mut nearest = (f64::INFINITY, 0, 0.0);
        for &l in &self.functions.looked {
            let rate = self.functions.watches[l].rate_in(&self.functions.q0, &self.functions.dq0, &self.field, &self.f);
            let left = -self.functions.w0[l] / rate;
            if rate < 0.0 && left >= 0.0 && left < nearest.0 {
                nearest = (left, l, rate);
            }
        }
        let (left, l, rate) = nearest;
        if left > self.no_time() || self.field.n_alg() > 0 {
            return Ok(None);
        }
        let s = &mut self.stepper.step;
        s.h = left.max(f64::MIN_POSITIVE);
        for i in 0..nx {
            s.x1[i] = s.x0[i] + left * s.f0[i];
            s.poly[i] = [0.0; 8];
            s.poly[i][0] = s.x0[i];
            s.poly[i][1] = left * s.f0[i];
            s.k[i] = [s.f0[i]; 16];
        }
        s.f1.copy_from_slice(&s.f0);
        self.stepper.dense_ready = true;
        self.functions.w1[..self.functions.watches.len()].fill(f64::NAN);
        // shorter than rounding: no step that counts for the next length
        let t1 = self.t + left;
        self.accept(t1)?;
        let h = self.stepper.step.h.max(1e-6 * (self.t_stop - t1));
        self.switch(l, rate, h).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `sqrt |x|` with a sign: Newton's method alone leaves it.
    #[test]
    fn brackets_close_on_a_zero_that_is_infinitely_steep() {
        let value = |h: f64| (0.3 - h).signum() * (0.3f64 - h).abs().sqrt();
        let mut b = Bracket::default();
        assert_eq!((b.width(), b.middle(0.5)), (f64::INFINITY, None));
        b.note(0.0, value(0.0));
        assert_eq!(b.middle(0.5), None);
        b.note(1.0, value(1.0));
        // what is well inside is taken, else the middle
        assert_eq!((b.middle(0.4), b.middle(0.99), b.middle(f64::NAN)), (Some(0.4), Some(0.5), Some(0.5)));
        let mut h = 0.5;
        for _ in 0..40 {
            b.note(h, value(h));
            let newton = h + 2.0 * (0.3 - h);
            h = b.middle(newton).unwrap_or(h);
        }
        assert!(b.width() < 1e-9 && b.before <= Some(0.3) && b.behind >= Some(0.3), "{b:?}");
    }
}
