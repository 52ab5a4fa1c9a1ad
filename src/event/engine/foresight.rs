//! Foresight of the next switch: a step beyond it would be thrown away.

use super::{recover, Engine};
use crate::error::Result;
use crate::event::explicit::Pair;
use crate::event::watch::Watch;
use crate::event::Method;

/// How far beyond the guess of a switch steps go that are to end there.
const MARGIN: f64 = 1.05;

/// Steps that the share of those at switches is one of.
const MEMORY: f64 = 8.0;

/// What is known of the next switch, and how good such guesses were.
#[derive(Debug, Clone, Default)]
pub(super) struct Foresight {
    /// Share of the last steps that ended at a switch.
    share: f64,
    /// What vanishes next by its source, from when on that was expected, and after which time.
    expected: Option<(usize, f64, f64)>,
    /// Of every source the part of the expected time after which it vanished the last time.
    late: Vec<f64>,
    /// Ends the present step a little behind where a switch is expected?
    pub(super) foreseen: bool,
    /// Algebraic variables at the point that is looked at.
    ahead: Vec<f64>,
}

/// A second point at which something is known of what is watched.
#[derive(Debug, Clone, Copy)]
enum Point {
    /// The start of the last step, so long ago: velocity, and gradients that are not constant.
    Before(f64),
    /// The end of a straight line along the velocity, so far ahead: velocity, and values of what is not straight itself.
    Ahead(f64),
}

impl Point {
    fn time(self) -> f64 {
        match self {
            Point::Before(h) => -h,
            Point::Ahead(h) => h,
        }
    }
}

impl Foresight {
    /// Of so many sources, with so many algebraic variables at most.
    pub(super) fn new(sources: usize, most: usize) -> Foresight {
        Foresight { late: vec![1.0; sources], ahead: Vec::with_capacity(most), ..Foresight::default() }
    }

    /// Another run begins.
    pub(super) fn reset(&mut self) {
        (self.share, self.expected, self.foreseen) = (0.0, None, false);
        self.late.fill(1.0);
    }

    /// A step has ended, at a switch or where the error let it.
    pub(super) fn note_end(&mut self, at_switch: bool) {
        self.share += (f64::from(u8::from(at_switch)) - self.share) / MEMORY;
    }

    /// Do most steps end at a switch?
    pub(super) fn mostly_switches(&self) -> bool {
        self.share > 0.5
    }

    /// A look ahead costs an evaluation, and spares a step of so many stages where a switch would cut it short. Once is chance: the step behind it would
    /// be cut short for nothing.
    fn pays(&self, stages: usize) -> bool {
        self.share * stages as f64 > 1.0 && self.share > 1.0 / MEMORY
    }

    /// This source vanishes at time `t`: how late is that compared with what was expected?
    pub(super) fn note_late(&mut self, source: usize, t: f64) {
        /// Where it is more than that, expectations mean nothing.
        const MOST: f64 = 2.0;
        if let Some((_, from, time)) = self.expected.take().filter(|e| e.0 == source) {
            self.late[source] = ((t - from) / time).clamp(1.0 / MOST, MOST);
        }
    }
}

impl Engine {
    /// Do steps end at switches so often that it pays to look for the next one? Next to an accumulation rates are those of roots, and say nothing.
    pub(super) fn looks_ahead(&self) -> bool {
        self.foresight.pays(self.stepper.pair.rows().0.len()) && self.may_end_inside() && self.sharpness() == 1.0
    }

    /// May steps end on their dense output? Contacts are held at the ends of steps, and derivatives follow the dense output of the pairs whose
    /// stages it needs no others for.
    pub(super) fn may_end_inside(&self) -> bool {
        let derives = self.derivatives.sens.is_some() || self.derivatives.tape.is_some();
        (!derives || self.stepper.pair != Pair::Dop853)
            && !self.stepper.implicit
            && self.options.method == Method::Auto
            && !self.field.has_contacts()
            && !self.field.in_limit_set()
    }

    /// A time a little behind the first switch under this active set, as far as it can be foreseen, else infinity.
    ///
    /// The velocity at one more point says how the rates of what is watched change. Within a mode that is the start of the last step. Behind a switch it is
    /// one ahead: at two thirds of the time, where its weight is three quarters, that makes the time accurate to second order for functions that are
    /// straight (A. Ralston, *Runge-Kutta methods with minimum error bounds*, Math. Comp. 16 (1962)). What is left is much the same as the
    /// last time, where modes come back. What would come long before that point is not believed: that is what a fast transient looks like.
    ///
    /// What bends by itself does so along the line to that point, too; behind a step its gradients at both ends say so. A parabola next to a zero of
    /// higher order has none, and nothing is expected there.
    pub(super) fn time_to_switch(&mut self) -> Result<f64> {
        const POINT: f64 = 2.0 / 3.0;
        const LONG: f64 = 4.0;
        self.foresight.expected = None;
        let point = if self.stepper.fresh {
            // no farther than the step would go
            let longest = self.stepper.h.min(self.options.h_max).min(self.t_stop - self.t);
            let by = POINT * self.soonest(None).1.min(longest);
            if !self.look_at(by)? {
                return Ok(f64::INFINITY);
            }
            Point::Ahead(by)
        } else {
            self.stepper.node.copy_from_slice(&self.stepper.step.f0);
            self.foresight.ahead.clear();
            self.foresight.ahead.extend_from_slice(&self.stepper.alpha_end);
            Point::Before(self.stepper.step.h)
        };
        let (source, time) = self.soonest(Some(point));
        if LONG * time <= point.time() || time.is_infinite() {
            return Ok(f64::INFINITY);
        }
        self.foresight.expected = Some((source, self.t, time));
        Ok(MARGIN * self.foresight.late[source] * time)
    }

    /// Evaluates the velocity along a straight line after this time, and what is watched if it bends. False where they are not defined.
    fn look_at(&mut self, by: f64) -> Result<bool> {
        let n = self.field.n_alg();
        for ((y, x), f) in self.stepper.step.y.iter_mut().zip(&self.x).zip(&self.f) {
            *y = x + by * f;
        }
        let mut r = self.field.rhs(self.t + by, &self.stepper.step.y, &mut self.stepper.node);
        if self.functions.watches.iter().any(|w| !w.is_leave() && !w.is_affine(&self.field)) {
            r = r.and_then(|()| self.field.watched(self.t + by, &self.stepper.step.y));
        }
        self.foresight.ahead.clear();
        self.foresight.ahead.extend_from_slice(&self.field.alpha[..n]);
        self.field.alpha[..n].copy_from_slice(&self.stepper.alpha_start);
        recover(r.map(|()| true), false)
    }

    /// What vanishes first, and after which time; where something is known at one more point, rates change linearly, and how late a
    /// source was the last time counts.
    fn soonest(&self, point: Option<Point>) -> (usize, f64) {
        let mut least = (f64::INFINITY, 0, f64::INFINITY);
        for (l, w) in self.functions.watches.iter().enumerate().filter(|(l, _)| self.functions.depart[*l] == 0) {
            let value = self.functions.w0[l];
            let (rate, bend) = match (*w, point) {
                (Watch::Leave { cell, .. }, Some(point)) => {
                    ((self.field.theta_in(&self.foresight.ahead, cell) - value) / point.time(), 0.0)
                }
                _ => self.rate_and_bend(w, value, point),
            };
            let (source, time) = (self.source(w), first_zero(value, rate, bend));
            let usual = point.map_or(1.0, |_| self.foresight.late[source]) * time;
            if usual < least.0 {
                least = (usual, source, time);
            }
        }
        (least.1, least.2)
    }

    /// Rate of what is watched, and half of what it changes by in unit time.
    fn rate_and_bend(&self, w: &Watch, value: f64, point: Option<Point>) -> (f64, f64) {
        let (f, field) = (&self.functions, &self.field);
        let rate = w.rate(&f.dq0, field, &self.f);
        let Some(point) = point else { return (rate, 0.0) };
        let (time, straight) = (point.time(), w.is_affine(field));
        let gradients = if matches!(point, Point::Before(_)) && !straight { &f.dq1 } else { &f.dq0 };
        let mut bend = 0.5 * (w.rate(gradients, field, &self.stepper.node) - rate) / time;
        if matches!(point, Point::Ahead(_)) && !straight {
            bend += (w.value(&field.q, field) - value - rate * time) / (time * time);
        }
        (rate, bend)
    }
}

/// First time at which `value + rate t + bend t²` vanishes, which is positive at 0; infinite where it stays positive.
fn first_zero(value: f64, rate: f64, bend: f64) -> f64 {
    let discriminant = rate * rate - 4.0 * bend * value;
    if value.is_nan() || value <= 0.0 || discriminant < 0.0 {
        return f64::INFINITY;
    }
    // the form without cancellation where it falls at first
    let root = discriminant.sqrt();
    let time = if rate <= 0.0 { 2.0 * value / (root - rate) } else { -0.5 * (rate + root) / bend };
    if time > 0.0 {
        time
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_of_parabolas() {
        // (t - 1)(t - 2), (t - 1)(t + 2) turned over, a line, one that rises, none
        let cases = [
            ((2.0, -3.0, 1.0), 1.0),
            ((2.0, -1.0, -1.0), 1.0),
            ((2.0, 1.0, -1.0), 2.0),
            ((3.0, -2.0, 0.0), 1.5),
            ((3.0, 2.0, 0.0), f64::INFINITY),
            ((1.0, 0.0, 1.0), f64::INFINITY),
            ((-1.0, -1.0, 0.0), f64::INFINITY),
        ];
        for ((value, rate, bend), exact) in cases {
            assert_eq!(first_zero(value, rate, bend), exact, "{value} {rate} {bend}");
        }
        assert_eq!(first_zero(f64::NAN, -1.0, 0.0), f64::INFINITY);
        // far from cancellation: the smaller root of t² - 1e8 t + 1 is 1e-8
        assert!((first_zero(1.0, -1e8, 1.0) / 1e-8 - 1.0).abs() < 1e-15);
    }

    /// It pays from the second switch in a row on, and for some steps behind them.
    #[test]
    fn a_look_ahead_pays_where_steps_are_often_cut_short() {
        let mut f = Foresight::new(1, 0);
        assert!(!f.pays(12));
        f.note_end(true);
        assert!(!f.pays(6) && !f.pays(12));
        f.note_end(true);
        assert!(f.pays(6) && f.pays(12) && !f.mostly_switches());
        (0..3).for_each(|_| f.note_end(false));
        assert!(!f.pays(6) && f.pays(12));
        (0..6).for_each(|_| f.note_end(true));
        assert!(f.mostly_switches());
        // every sixth step in the long run: as much as a look costs
        let mut pays = 0;
        for k in 0..600 {
            f.note_end(k % 6 == 0);
            pays += usize::from(f.pays(6));
        }
        assert!((200..400).contains(&pays), "{pays}");
    }

    #[test]
    fn lateness_is_that_of_what_was_expected() {
        let mut f = Foresight::new(2, 0);
        f.expected = Some((1, 2.0, 0.5));
        f.note_late(0, 2.6);
        assert_eq!(f.late, [1.0, 1.0]);
        f.expected = Some((1, 2.0, 0.5));
        f.note_late(1, 2.6);
        assert!((f.late[1] - 1.2).abs() < 1e-12);
        f.expected = Some((1, 2.0, 0.5));
        f.note_late(1, 12.6);
        assert_eq!(f.late[1], 2.0);
    }
}
