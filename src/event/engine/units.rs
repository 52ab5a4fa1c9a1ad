//! Events of single units in a step of all states: only what depends on them is integrated anew.
//!
//! At an event at time `t_e` a state jumps, or its velocity does. Let `A` be the states that are integrated anew, from `t_e` to the end `t_1` of the
//! step, with the dense output of all others. A state `j` outside of `A` reads some of them, and goes on as if nothing had happened: its velocity is
//! off by `d_j(t) = f_j(new) - f_j(old)`, and it by `(t_1 - t_e) max |d_j|` at most, to first order. Where that is more than a small share of
//! its tolerance, `j` becomes one of `A`, and `A` is integrated once more. So `A` is as large as the event can be felt within the step, whatever
//! the number of units is, and the error that is left is that of a step which ends at its dense output. The states that were in `A`
//! at the last event of the same source are the first guess.
//!
//! A subsystem may slide by itself: on one surface, whose rate depends on the mode of no other one that slides. Its weight is watched as a function of
//! the states that it depends on.
//!
//! What is not plain is left to the loop of all states, which ends the step there: other sliding modes, functions with gradients that change, zeros of
//! higher order, values that are zero to rounding behind an event, a transition that happens twice at one time, and sources whose intervals shrink.

use super::accumulation::rest_of_series;
use super::control::{Cut, ACCURATE};
use super::notes::find_zeros;
use super::worth::Way;
use super::{recover, Engine, Progress, Statistics, EPS};
use crate::error::Result;
use crate::event::bernstein::{self, First, NODES};
use crate::event::calendar::{Crossing, Entry, UnitEvents, Units};
use crate::event::explicit::{self, Flow, Pair};
use crate::event::field::{Owner, Row, SLIDES};
use crate::event::step::{derivative, Poly};
use crate::event::{Jump, Kind, Method, Outcome, Switch};
use crate::func::EvalError;

/// Half of the digits, the root of [`EPS`]: a rate, relative to the size of its terms, that a zero of higher order shows where rounding splits it; and
/// a secant behind which the next one would change nothing but rounding.
const HALF: f64 = 1.49e-8;
/// Events in one step, by the number of states, behind which all states are brought to one time again: the memory of a step.
const EVENTS: usize = 16;

/// How far single units were followed in a step.
pub(super) enum Followed {
    /// Not at all: the step is as it was.
    Not,
    /// The dense output, which events are located on, is off by so much of what it may.
    Coarse(f64),
    To(Progress),
}

impl Engine {
    /// May events in this step be left to the units?
    fn goes_by_units(&self) -> bool {
        self.calendar.within_steps
            && self.calendar.worth.way() == Way::Units
            && !self.stepper.step_implicit
            && self.derivatives.sens.is_none()
            && self.derivatives.tape.is_none()
            && !self.field.in_limit_set()
    }

    /// The step has ended: what has it cost?
    pub(super) fn note_work(&mut self) {
        let Some(c) = &self.calendar.units else { return };
        let work = self.field.counts.values * self.nx + c.rows;
        let step = self.stepper.pair.rows().0.len() * self.nx;
        let Statistics { switches, jumps, .. } = self.log.stats;
        let before = self.calendar.worth.way();
        self.calendar.worth.note(work, switches + jumps, step);
        if self.calendar.worth.way() != before && self.options.method == Method::Auto && !self.stepper.implicit {
            // what it would come to after some steps, see [`Engine::note_end`]
            let usual = self.stepper.usual_pair;
            let short = before == Way::Units && usual == Pair::Dop853;
            (self.stepper.next_pair, self.stepper.cut) = (if short { Pair::Dp5 } else { usual }, Cut::default());
        }
    }

    /// Follows what happens in the step to its end `t1`, unit by unit; `grown` is the length of the next one.
    pub(super) fn follow_units(&mut self, t1: f64, grown: f64) -> Result<Followed> {
        if !self.goes_by_units() || self.calendar.units.is_none() {
            return Ok(Followed::Not);
        }
        let e = self.error_inside()? / ACCURATE;
        if e.is_nan() || e > 1.0 {
            return Ok(Followed::Coarse(e));
        }
        let Some(mut c) = self.calendar.units.take() else { return Ok(Followed::Not) };
        let (t, left) = self.follow_events(&mut c, t1);
        let known = if !c.events.is_empty() { self.end_units(&mut c, t, t1).map(Some) } else { Ok(None) };
        if c.events.is_empty() {
            c.tracks.clear();
        }
        let most = (t - self.stepper.step.t) * c.growth(self.stepper.pair.rows().0.len());
        self.calendar.units = Some(c);
        let Some(known) = known? else { return Ok(Followed::Not) };
        let by_output = 0.9 * self.stepper.step.h * e.powf(-1.0 / self.stepper.pair.order());
        self.stepper.h = grown.min(by_output).min(most);
        if !known {
            let p = self.fail(Outcome::NoContinuation, "the system is not defined behind an event".into());
            return Ok(Followed::To(p));
        }
        let at = left.and_then(|e| {
            (0..self.functions.watches.len()).find(|l| self.source(&self.functions.watches[*l]) == e.source)
        });
        let h = self.stepper.h;
        Ok(Followed::To(match at.zip(left) {
            Some((l, e)) => self.switch(l, e.rate, h)?,
            None => Progress::Switched,
        }))
    }

    /// Error of the dense output of the step, on which events are located, relative to the tolerances.
    pub(super) fn error_inside(&mut self) -> Result<f64> {
        let r = explicit::error_inside(&mut self.field, &mut self.stepper.step, &self.stepper.weights);
        // the weights are those at the end again
        let n_alg = self.stepper.alpha_end.len();
        self.field.alpha[..n_alg].copy_from_slice(&self.stepper.alpha_end);
        recover(r, f64::NAN)
    }

    /// The events in their order. Says up to where they are followed, and which one is left that happens there.
    fn follow_events(&mut self, c: &mut UnitEvents, t1: f64) -> (f64, Option<Entry>) {
        let (t, h) = (self.stepper.step.t, self.stepper.step.h);
        c.begin();
        self.field.move_parts_to(t, &self.stepper.step.x0);
        c.cells.clear();
        c.cells.extend(self.field.active.iter().map(|set| if let [cell] = set[..] { cell } else { SLIDES }));
        self.field.mark_tied(&c.depends, &c.cells, &mut c.tied);
        self.look_at_straight(c);
        for n in 0..self.functions.zeros.len() {
            let (l, s, slope) = self.functions.zeros[n];
            let (source, at) = (self.source(&self.functions.watches[l]), t + s * h);
            let at = self.sharpened(c, source, (at, slope), (t, t1));
            c.enter(at, source, slope);
        }
        let mut last = t;
        while let Some(e) = c.next() {
            c.forget_event();
            let many = c.events.len() > EVENTS * self.nx || c.is_spent(self.stepper.pair.rows().0.len());
            if !many && e.t > t && e.t < t1 && self.happens(c, e, t1) {
                c.events.push(e.t);
                last = e.t;
                continue;
            }
            // a step of all states finds it, unless it happens with the last one
            let apart = e.t - last > self.no_time();
            return if apart { (0.5 * (last + e.t.min(t1)), None) } else { (e.t.clamp(t, t1), Some(e)) };
        }
        (t1, None)
    }

    /// What happens at a zero. False if it is left to the loop of all states: nothing has changed then.
    fn happens(&mut self, c: &mut UnitEvents, e: Entry, t1: f64) -> bool {
        let Some(&owner) = c.depends.owner.get(e.source) else { return false };
        let history = self.calendar.recent.of(e.source);
        let repeats = history.back(0).is_some_and(|last| e.t - last <= 64.0 * EPS * e.t.abs());
        let shrinks = history.gaps().is_some_and(|g| rest_of_series(&g).is_some());
        // weights are between 0 and 1
        let size = if let Owner::Weight(_) = owner { 1.0 } else { self.sizes_at(c, e.source, e.t).1 };
        // NaN is slow
        let clear = -e.rate * self.stepper.step.h > HALF * size;
        let level = self.functions.levels.get(e.source).is_some_and(|l| *l > 0.0);
        if repeats || shrinks || !clear || level {
            return false;
        }
        self.field.set_time_of_parts(e.t);
        let plain = match owner {
            Owner::Guard(g) => !self.field.guards.all[g].spent && self.cascades(c, g, e),
            Owner::Surface(k) => c.cells[k] != SLIDES && self.crosses(c, k, e),
            Owner::Weight(k) => c.cells[k] == SLIDES && self.lets_go_alone(c, k, e),
            Owner::Other => false,
        };
        if !plain {
            return false;
        }
        c.exchange_cells();
        if !self.integrate_around(c, e, t1) {
            c.exchange_cells();
            return false;
        }
        self.note_event(c, e);
        self.look_ahead(c, e.t, t1);
        true
    }

    /// The gradient of the function in place `q`: where it is not constant, where it was looked at last.
    fn gradient<'a>(&'a self, c: &'a UnitEvents, q: usize) -> Row<'a> {
        let own = if self.field.constant_gradients() { &self.functions.dq0 } else { &c.dq };
        self.field.gradients.row(own, q)
    }

    /// Looks at the gradients that are constant, where others are not.
    fn look_at_straight(&mut self, c: &mut UnitEvents) {
        if self.field.constant_gradients() || self.field.knows_straight() {
            return;
        }
        let s = &self.stepper.step;
        c.point.copy_from_slice(&s.x0);
        let straight = (0..c.depends.places).filter(|q| !c.depends.bent[*q]);
        let mut known = true;
        for q in straight.filter(|q| c.depends.owner[*q] != Owner::Other) {
            known &= self.field.gradient_by_parts(c.depends.owner[q], s.t, &c.point, &mut c.dq);
        }
        self.field.note_straight(known);
    }

    /// Looks at the gradient of the function in place `q` at the present event. False where it is not defined.
    fn look_at_gradient(&mut self, c: &mut UnitEvents, q: usize, t: f64) -> bool {
        if !c.depends.bent[q] {
            return true;
        }
        for &i in self.field.gradients.states_of(q) {
            c.point[i] = c.value(&self.stepper.step, i, t);
        }
        self.field.gradient_by_parts(c.depends.owner[q], t, &c.point, &mut c.dq)
    }

    /// Value of the function in place `q` at the present event; NaN where it is not defined.
    fn value_at(&mut self, c: &UnitEvents, q: usize, t: f64) -> f64 {
        let s = &self.stepper.step;
        if c.depends.bent[q] {
            self.field.set_time_of_parts(t);
            for n in 0..self.field.gradients.states_of(q).len() {
                let i = self.field.gradients.states_of(q)[n];
                self.field.set_state_of_parts(i, c.value(s, i, t));
            }
            return self.field.watched_by_parts(c.depends.owner[q]);
        }
        let g = self.gradient(c, q);
        self.functions.q0[q] + g.states().map(|(i, g)| g * (c.value(s, i, t) - s.x0[i])).sum::<f64>() + g.t * (t - s.t)
    }

    /// Value of a function whose gradient is not constant, on the way.
    fn value_on_the_way(&mut self, c: &UnitEvents, q: usize, t: f64) -> f64 {
        self.field.set_time_of_parts(t);
        for n in 0..self.field.gradients.states_of(q).len() {
            let i = self.field.gradients.states_of(q)[n];
            self.field.set_state_of_parts(i, c.tracks.value(&self.stepper.step, i, t));
        }
        self.field.watched_by_parts(c.depends.owner[q])
    }

    /// Size of the terms of its value at the present event, and what it changes by when all states change by their size; NaN where its gradient is not
    /// defined.
    fn sizes_at(&mut self, c: &mut UnitEvents, q: usize, t: f64) -> (f64, f64) {
        if !self.look_at_gradient(c, q, t) {
            return (f64::NAN, f64::NAN);
        }
        let g = self.gradient(c, q);
        let reach: f64 = g.states().map(|(i, g)| g.abs() * self.field.size(i, c.value(&self.stepper.step, i, t))).sum();
        (reach + (g.t * t).abs(), reach + (g.t * self.stepper.step.h).abs())
    }

    /// Is transition `g` watched in the discrete states of the present event?
    fn is_armed(&self, c: &UnitEvents, g: usize, t: f64) -> bool {
        let from = &self.field.guards.all[g].transition.from;
        from.iter().all(|&(i, value)| c.value(&self.stepper.step, i, t) == value)
    }

    /// Makes transition `g` and those that hold behind it. False where one of them is not plain.
    fn cascades(&mut self, c: &mut UnitEvents, g: usize, e: Entry) -> bool {
        let (t, mut next) = (e.t, Some(g));
        while let Some(g) = next {
            if c.fired.contains(&(g as u32)) || c.fired.len() > self.nx || !self.make_one(c, g, t, e.rate) {
                return false;
            }
            next = None;
            while next.is_none() {
                let Some(q) = c.first_asked() else { break };
                let Owner::Guard(h) = c.depends.owner[q] else { continue };
                if !self.is_armed(c, h, t) {
                    continue;
                }
                let value = -self.field.guards.all[h].transition.direction.sign() * self.value_at(c, q, t);
                let rounding = 64.0 * EPS * self.sizes_at(c, q, t).0;
                let plain = !self.field.guards.all[h].spent && self.functions.levels[q] == 0.0;
                if !plain || rounding.is_nan() || value.is_nan() || value.abs() <= rounding {
                    return false;
                }
                next = (value < 0.0).then_some(h);
            }
        }
        // surfaces that the state has been moved over
        for n in 0..c.changes.len() {
            let i = c.changes[n].0 as usize;
            for m in 0..c.depends.watching.of(i).len() {
                let q = c.depends.watching.of(i)[m] as usize;
                let Owner::Surface(k) = c.depends.owner[q] else { continue };
                if c.cells[k] == SLIDES {
                    return false;
                }
                let (inside, other) = self.field.sides(k, c.cells[k]);
                let value = inside * self.value_at(c, q, t);
                let rounding = 64.0 * EPS * self.sizes_at(c, q, t).0;
                if rounding.is_nan() || value.is_nan() || value.abs() <= rounding {
                    return false;
                }
                if value < 0.0 && c.crossed.iter().all(|x| x.sub != k) {
                    c.crossed.push(Crossing { sub: k, cell: other, rate: f64::NAN, departs: 0 });
                }
            }
        }
        true
    }

    /// Makes one transition; the guards that may hold behind it are asked. False where its reset is not defined, or one of these is not plain.
    fn make_one(&mut self, c: &mut UnitEvents, g: usize, t: f64, rate: f64) -> bool {
        for &i in c.depends.of_reset.of(g) {
            self.field.set_state_of_parts(i as usize, c.value(&self.stepper.step, i as usize, t));
        }
        let mut values = std::mem::take(&mut c.values);
        let known = self.field.reset_by_parts(g, &mut values);
        c.values = values;
        if !known {
            return false;
        }
        let transition = &self.field.guards.all[g].transition;
        let reset = transition.reset.as_ref().map_or(&[][..], |r| &r.rows);
        let (values, to) = (c.values.clone(), &transition.to);
        let moved = reset.iter().copied().zip(values).chain(to.iter().copied());
        let logged = self.log.jumps.len() + c.jumps.len() < self.options.max_log;
        let mut jump = Jump {
            t,
            transition: g,
            states: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
            rate: if c.fired.is_empty() { -rate } else { f64::NAN },
            simultaneous: false,
            dt: Vec::new(),
        };
        for (i, value) in moved {
            if logged {
                jump.states.push(i);
                jump.before.push(c.value(&self.stepper.step, i, t));
                jump.after.push(value);
            }
            c.change(&self.stepper.step, i, t, value);
            for m in 0..c.depends.watching.of(i).len() {
                c.ask(c.depends.watching.of(i)[m] as usize);
            }
            for m in 0..c.depends.asking.of(i).len() {
                let asks = &self.field.guards.all[c.depends.asking.of(i)[m] as usize];
                if !asks.transition.is_plain() {
                    return false;
                }
                c.ask(asks.q);
            }
        }
        c.ask(self.field.guards.all[g].q);
        c.fired.push(g as u32);
        if logged {
            c.jumps.push(jump);
        }
        true
    }

    /// Does the motion cross the surface of subsystem `k`, which leads from its present cell to the other one, or slide on it, by itself?
    fn crosses(&mut self, c: &mut UnitEvents, k: usize, e: Entry) -> bool {
        let (inside, other) = self.field.sides(k, c.cells[k]);
        let states: Vec<u32> = self.gradient(c, e.source).states().map(|s| s.0 as u32).collect();
        if states.iter().any(|i| c.tied[*i as usize]) {
            return false;
        }
        let before = std::mem::replace(&mut c.cells[k], other);
        c.group.gather(&states, |_| false, (&c.depends, &c.cells));
        self.start_group(c, e.t);
        c.step.resize(states.len());
        let UnitEvents { group, moving, tracks, step, .. } = c;
        let mut units = Units { field: &mut self.field, group, moving, tracks, step: &self.stepper.step };
        let known = units.write_velocity(e.t, &group.start, &mut step.f1).is_ok();
        c.cells[k] = before;
        let velocity = &c.step.f1;
        // the group has its states in the order of the gradient
        let g = self.gradient(c, e.source);
        let terms = || g.values.iter().zip(velocity).map(|(g, v)| g * v).chain([g.t]);
        let (rate, size) = (inside * terms().sum::<f64>(), terms().map(f64::abs).sum::<f64>());
        if !known || rate.is_nan() || rate.abs() <= HALF * size {
            return false;
        }
        let slides = rate > 0.0;
        if slides && (c.depends.bent[e.source] || self.field.slides_with_others(k, &c.cells)) {
            return false;
        }
        let (cell, departs) = if slides { (SLIDES, 0) } else { (other, 1) };
        c.crossed.push(Crossing { sub: k, cell, rate: e.rate, departs });
        true
    }

    /// Does the sliding mode of subsystem `k` end at a zero of one of its weights? On a surface that attracts, it does where the weight falls, see
    /// [`Engine::lets_go`]: the rate of the surface under the other mode passes zero with it, so it is left with a zero of order two.
    fn lets_go_alone(&mut self, c: &mut UnitEvents, k: usize, e: Entry) -> bool {
        let first = self.field.first_cell(k);
        let gone = e.source - c.depends.weight(first);
        self.field.list_weight(k, (&c.depends, &c.cells), &mut c.moving);
        c.list_inputs(k);
        if self.weight_at(c, e.t).is_none() {
            return false;
        }
        let across = c.moving.weights[0].1;
        let attracts = self.field.sides(k, first).0 * across > 0.0;
        if attracts {
            c.crossed.push(Crossing { sub: k, cell: first + 1 - gone, rate: e.rate, departs: 2 });
        }
        attracts
    }

    /// Weight of the second cell of the subsystem that is listed, at time `t`; none where it is not defined.
    fn weight_at(&mut self, c: &mut UnitEvents, t: f64) -> Option<f64> {
        self.field.set_time_of_parts(t);
        for &j in &c.inputs {
            self.field.set_state_of_parts(j as usize, c.tracks.value(&self.stepper.step, j as usize, t));
        }
        self.field.move_by_parts(&mut c.moving, &mut []).then(|| c.moving.weights[0].0)
    }

    /// Time of a zero of a weight that an interpolation has found, between `from` and `to`; of what else may vanish it is known already.
    fn sharpened(&mut self, c: &mut UnitEvents, source: usize, zero: (f64, f64), (from, to): (f64, f64)) -> f64 {
        let k = match c.depends.owner[source] {
            Owner::Weight(k) => k,
            Owner::Other => return zero.0,
            _ if c.depends.bent[source] => return self.sharpen_bent(c, source, zero, (from, to)).unwrap_or(zero.0),
            _ => return zero.0,
        };
        let second = source != c.depends.weight(self.field.first_cell(k));
        self.field.list_weight(k, (&c.depends, &c.cells), &mut c.moving);
        c.list_inputs(k);
        self.sharpen_weight(c, second, zero, (from, to)).unwrap_or(zero.0)
    }

    /// The same of a function whose gradient is not constant, where its rate is known but for its sign.
    fn sharpen_bent(
        &mut self,
        c: &UnitEvents,
        q: usize,
        (mut t, rate): (f64, f64),
        (from, to): (f64, f64),
    ) -> Option<f64> {
        let size = 1e-3 * (to - from);
        let (near, beside) = (self.value_on_the_way(c, q, t), self.value_on_the_way(c, q, (t - size).max(from)));
        // it falls, as it is watched
        let slope = if beside > near { rate } else { -rate };
        for _ in 0..4 {
            let delta = -self.value_on_the_way(c, q, t) / slope;
            if delta.is_nan() || delta.abs() > size {
                return None;
            }
            t = (t + delta).clamp(from, to);
        }
        Some(t)
    }

    /// The same of the weight of the second cell, or of the first, of the subsystem that is listed.
    fn sharpen_weight(
        &mut self,
        c: &mut UnitEvents,
        second: bool,
        (mut t, rate): (f64, f64),
        (from, to): (f64, f64),
    ) -> Option<f64> {
        let (mut slope, mut before) = (rate, None);
        for _ in 0..6 {
            let alpha = self.weight_at(c, t)?;
            let value = if second { alpha } else { 1.0 - alpha };
            if let Some((v, at)) = before {
                let secant: f64 = (value - v) / (t - at);
                slope = if secant < 0.0 { secant } else { slope };
            }
            before = Some((value, t));
            let next = (t - value / slope).clamp(from, to);
            if (next - t).abs() <= HALF * (to - from) {
                return Some(next);
            }
            t = next;
        }
        None
    }

    /// Enters the next zero of a weight of subsystem `k` between `from` and `to`; where a weight is not defined, `from`.
    fn look_for_end(&mut self, c: &mut UnitEvents, k: usize, (from, to): (f64, f64)) {
        self.field.list_weight(k, (&c.depends, &c.cells), &mut c.moving);
        c.list_inputs(k);
        let mut times = std::mem::take(&mut c.times);
        times.clear();
        times.extend([from, to]);
        c.inputs.iter().for_each(|i| c.tracks.breaks(*i as usize, from, &mut times));
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        let found = times.windows(2).find_map(|w| self.end_between(c, (w[0], w[1])));
        c.times = times;
        let first = self.field.first_cell(k);
        match found {
            Some(Some((t, cell, rate))) => c.enter(t, c.depends.weight(first + cell), rate),
            // it is left to the step of all states
            Some(None) => c.enter(from, c.depends.weight(first), f64::NAN),
            None => {}
        }
    }

    /// Time of the first zero of a weight of the subsystem that is listed, which of its two cells has it, and the rate there; none inside where they are not
    /// defined.
    fn end_between(&mut self, c: &mut UnitEvents, (from, to): (f64, f64)) -> Option<Option<(f64, usize, f64)>> {
        let (mut samples, h) = ([0.0; NODES], to - from);
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        // every second one says whether the others are worth it
        for i in (0..NODES).step_by(2).chain((1..NODES).step_by(2)) {
            if i == 1 && ![(lo, hi), (1.0 - hi, 1.0 - lo)].iter().any(|(lo, hi)| may_vanish(*lo, *hi)) {
                return None;
            }
            let s = self.functions.sampler.nodes[i];
            let Some(v) = self.weight_at(c, from + s * h) else { return Some(None) };
            (samples[i], lo, hi) = (v, lo.min(v), hi.max(v));
        }
        let mut first: Option<(f64, usize, f64)> = None;
        for cell in [1, 0] {
            if cell == 0 {
                samples.iter_mut().for_each(|v| *v = 1.0 - *v);
            }
            let (b, degree) = self.functions.sampler.coefficients(&samples, 0);
            let b = &b[..=degree];
            if let First::Zero(s) = bernstein::first(b) {
                let (t, rate) = (from + s * h, bernstein::slope(b, s) / h);
                if first.is_none_or(|f| t < f.0) {
                    first = Some((t, cell, rate));
                }
            }
        }
        let (t, cell, rate) = first?;
        Some(self.sharpen_weight(c, cell == 1, (t, rate), (from, to)).map(|t| (t, cell, rate)))
    }

    /// Lists what moves the group, and the values it begins with behind the present event.
    fn start_group(&self, c: &mut UnitEvents, t: f64) {
        let UnitEvents { group, moving, depends, cells, .. } = c;
        let n = group.moving;
        let place = |i: usize| group.place(i).filter(|k| *k < n);
        self.field.list_moving(&group.states[..n], (depends, cells), place, moving);
        for k in 0..c.group.states.len() {
            let value = c.value(&self.stepper.step, c.group.states[k] as usize, t);
            c.group.start.push(value);
        }
    }

    /// Integrates what the present event can be felt by anew. False if that is too much, or not plain.
    fn integrate_around(&mut self, c: &mut UnitEvents, e: Entry, t1: f64) -> bool {
        let mut states: Vec<u32> = c.changes.iter().map(|x| x.0).collect();
        for x in &c.crossed {
            states.extend(c.depends.drives.of(x.sub));
        }
        let moved = |i: &u32| !c.still[*i as usize];
        c.needed += self.stepper.pair.rows().0.len() * states.iter().filter(|i| moved(i)).count();
        let source = c.fired.first().map_or(e.source, |g| self.field.guards.all[*g as usize].q);
        states.extend(c.take_reach(source));
        // else it ends the step, part of which is made again
        let most = c.spent + 2 * self.nx * self.stepper.pair.rows().0.len();
        let mark = c.mark();
        loop {
            states.sort_unstable();
            states.dedup();
            let plain = |i: &u32| {
                let others = |q: &u32| c.depends.owner[*q as usize] == Owner::Other;
                !c.tied[*i as usize] && !c.depends.watching.of(*i as usize).iter().any(others)
            };
            if c.spent > most || !states.iter().all(plain) {
                return false;
            }
            let UnitEvents { group, depends, still, cells, .. } = c;
            group.gather(&states, |i| still[i], (depends, cells));
            c.part_from(e.t);
            self.start_group(c, e.t);
            let felt = self.integrate_group(c, (e.t, t1), most).then(|| self.feels(c, e.t, t1, &mut states)).flatten();
            match felt {
                Some(false) => break,
                Some(true) => c.give_up(mark),
                None => {
                    c.give_up(mark);
                    return false;
                }
            }
        }
        c.note_reach(source);
        c.commit();
        true
    }

    /// Integrates the group from `t` to `t1`. False where more than `most` would be spent, or a function is not defined.
    fn integrate_group(&mut self, c: &mut UnitEvents, (t, t1): (f64, f64), most: usize) -> bool {
        let n = c.group.moving;
        for k in n..c.group.states.len() {
            let mut poly = Poly::default();
            poly[0] = c.group.start[k];
            c.go_on(k, (t, t1 - t), poly);
        }
        if n == 0 {
            return true;
        }
        let (pair, sharpness) = (self.stepper.pair, self.sharpness());
        c.step.resize(n);
        c.weights.resize(n, 0.0);
        c.step.x0.copy_from_slice(&c.group.start[..n]);
        let (mut t, mut h, mut fresh) = (t, t1 - t, true);
        while c.spent <= most {
            let last = h >= 0.99 * (t1 - t);
            c.spend(n * pair.rows().0.len());
            let UnitEvents { group, moving, tracks, step, weights, .. } = c;
            (step.t, step.h) = (t, if last { t1 - t } else { h });
            let mut units = Units { field: &mut self.field, group, moving, tracks, step: &self.stepper.step };
            if std::mem::take(&mut fresh) && units.write_velocity(t, &step.x0, &mut step.f0).is_err() {
                return false;
            }
            let mut known = explicit::attempt(pair, &mut units, step).is_ok();
            for (k, &i) in group.states[..n].iter().enumerate() {
                let (atol, rtol) = (self.atol[i as usize], self.rtol[i as usize]);
                let size = step.x0[k].abs().max(step.x1[k].abs());
                weights[k] = 1.0 / (sharpness * atol + rtol * size).max(f64::MIN_POSITIVE);
            }
            let err = if known { explicit::error(pair, step, weights) } else { f64::NAN };
            if err <= 1.0 && pair == Pair::Dop853 {
                known = explicit::finish(pair, &mut units, step).is_ok();
            }
            // NaN fails too
            let plain = err <= 1.0 && known && !explicit::is_misjudged(pair, step, weights);
            let mut good = plain && explicit::dense(pair, &mut units, step).is_ok();
            let mut err = err;
            if good {
                // what is off by more than what counts as felt is felt by all states, one after the other
                err = err.max(explicit::error_inside(&mut units, step, weights).unwrap_or(f64::NAN) / ACCURATE);
                good = err <= 1.0;
            }
            if !good {
                h = step.h * if err > 1.0 { (0.9 * err.powf(-1.0 / pair.order())).clamp(0.1, 0.9) } else { 0.25 };
                continue;
            }
            let (from, unit) = (step.t, step.h);
            for k in 0..n {
                let poly = c.step.poly[k];
                c.go_on(k, (from, unit), poly);
            }
            if last {
                return true;
            }
            t += unit;
            h = unit * (0.9 * err.max(1e-10).powf(-1.0 / pair.order())).clamp(0.333, 6.0);
            let s = &mut c.step;
            s.x0.copy_from_slice(&s.x1);
            s.f0.copy_from_slice(&s.f1);
        }
        false
    }

    /// Adds the states that feel what the group does from `t` on to `states`. Says whether there are any; none where one of them is not plain.
    fn feels(&mut self, c: &mut UnitEvents, t: f64, t1: f64, states: &mut Vec<u32>) -> Option<bool> {
        let mut beside: Vec<u32> = Vec::new();
        for &i in &c.group.states {
            c.depends.each_reader(i as usize, &c.cells, |j| {
                if c.group.place(j as usize).is_none() {
                    beside.push(j);
                }
            });
        }
        beside.sort_unstable();
        beside.dedup();
        let mut any = false;
        for j in beside {
            let own = j as usize;
            if c.tied[own] {
                return None;
            }
            let UnitEvents { moving, depends, cells, .. } = c;
            self.field.list_moving(&[j], (depends, cells), |i| (i == own).then_some(0), moving);
            let mut reads = std::mem::take(&mut c.inputs);
            reads.clear();
            reads.push(j);
            c.depends.each_read(own, &c.cells, |i| reads.push(i));
            let mut worst = 0.0f64;
            for s in [0.0, 0.5, 1.0] {
                let at = t + s * (t1 - t);
                self.field.set_time_of_parts(at);
                let (mut new, mut old) = ([0.0], [0.0]);
                for &i in &reads {
                    self.field.set_state_of_parts(i as usize, c.new_value(&self.stepper.step, i as usize, at));
                }
                let mut known = self.field.move_by_parts(&mut c.moving, &mut new);
                for &i in &reads {
                    self.field.set_state_of_parts(i as usize, c.tracks.value(&self.stepper.step, i as usize, at));
                }
                known &= self.field.move_by_parts(&mut c.moving, &mut old);
                worst = worst.max((new[0] - old[0]).abs());
                if !known || worst.is_nan() {
                    return None;
                }
            }
            c.inputs = reads;
            c.spend(6);
            if (t1 - t) * worst * self.stepper.weights[own] > ACCURATE {
                states.push(j);
                any = true;
            }
        }
        Some(any)
    }

    /// Counts and logs the present event; the cells of what was crossed are those before.
    fn note_event(&mut self, c: &mut UnitEvents, e: Entry) {
        for &g in &c.fired {
            self.calendar.recent.note_source(self.field.guards.all[g as usize].q, e.t);
        }
        if c.fired.is_empty() {
            self.calendar.recent.note_source(e.source, e.t);
        }
        self.log.stats.jumps += c.fired.len();
        // those of several units at one time are made one after the other
        let last = self.log.jumps.last_mut().filter(|j| j.t == e.t && !c.fired.is_empty());
        let several = c.fired.len() > 1 || last.is_some();
        if let Some(last) = last {
            last.simultaneous = true;
        }
        self.log.jumps.extend(c.jumps.drain(..).map(|j| Jump { simultaneous: several, ..j }));
        self.log.stats.switches += c.crossed.len();
        for &Crossing { sub, cell, rate, .. } in &c.crossed {
            if self.log.switches.len() >= self.options.max_log {
                continue;
            }
            let first = self.field.first_cell(sub);
            let modes = |cell: usize| match cell {
                SLIDES => self.field.modes_of(sub, &[first, first + 1]),
                _ => self.field.modes_of(sub, &[cell]),
            };
            let (kind, transversality) = match (cell, c.cells[sub]) {
                (SLIDES, _) => (Kind::Leave, f64::NAN),
                (_, after) => {
                    let q = self.field.surfaces(sub).start;
                    let speed = self.stepper.step.f0.iter().map(|v| v * v).sum::<f64>().sqrt();
                    let steepness = self.gradient(c, q).states().map(|s| s.1 * s.1).sum::<f64>().sqrt();
                    (if after == SLIDES { Kind::Enter } else { Kind::Cross }, rate / (steepness * speed))
                }
            };
            self.log.switches.push(Switch {
                t: e.t,
                kind,
                simultaneous: c.crossed.len() > 1,
                subsystem: sub,
                before: modes(cell),
                after: modes(c.cells[sub]),
                rate,
                transversality,
                unique: true,
                dt: Vec::new(),
            });
        }
    }

    /// The next zeros of all that depends on the present event, at time `t`.
    fn look_ahead(&mut self, c: &mut UnitEvents, t: f64, t1: f64) {
        for n in 0..c.group.states.len() {
            let i = c.group.states[n] as usize;
            for m in 0..c.depends.watching.of(i).len() {
                c.ask(c.depends.watching.of(i)[m] as usize);
            }
            let mut subs = std::mem::take(&mut c.inputs);
            subs.clear();
            c.depends.each_weight(i, &c.cells, |k| subs.push(k as u32));
            subs.iter().for_each(|k| c.ask(c.depends.weight(self.field.first_cell(*k as usize))));
            c.inputs = subs;
        }
        for n in 0..c.changes.len() {
            let i = c.changes[n].0 as usize;
            for m in 0..c.depends.asking.of(i).len() {
                c.ask(self.field.guards.all[c.depends.asking.of(i)[m] as usize].q);
            }
        }
        for n in 0..c.fired.len() {
            c.ask(self.field.guards.all[c.fired[n] as usize].q);
        }
        for n in 0..c.crossed.len() {
            let k = c.crossed[n].sub;
            c.ask(self.field.surfaces(k).start);
            c.ask(c.depends.weight(self.field.first_cell(k)));
        }
        while let Some(q) = c.first_asked() {
            c.strike_out(q);
            let (sign, departs) = match c.depends.owner[q] {
                Owner::Guard(h) if self.is_armed(c, h, t) => {
                    let g = &self.field.guards.all[h];
                    let toward = g.transition.direction.sign();
                    (if g.spent { toward } else { -toward }, 0)
                }
                Owner::Surface(k) if c.cells[k] != SLIDES => {
                    let here = c.crossed.iter().find(|x| x.sub == k);
                    (self.field.sides(k, c.cells[k]).0, here.map_or(0, |x| x.departs))
                }
                Owner::Weight(k) => {
                    let first = c.depends.weight(self.field.first_cell(k));
                    c.strike_out(first);
                    c.strike_out(first + 1);
                    if c.cells[k] == SLIDES {
                        self.look_for_end(c, k, (t, t1));
                    }
                    continue;
                }
                _ => continue,
            };
            if let Some((at, rate)) = self.next_zero(c, q, sign, (t, t1), departs) {
                c.enter(at, q, rate);
            }
        }
    }

    /// The next time between `from` and `to` at which `sign` times the function in place `q` falls through zero, and its rate there. At `from` it has a zero
    /// of the order `departs`.
    fn next_zero(
        &mut self,
        c: &mut UnitEvents,
        q: usize,
        sign: f64,
        (from, to): (f64, f64),
        departs: usize,
    ) -> Option<(f64, f64)> {
        let mut times = std::mem::take(&mut c.times);
        times.clear();
        times.extend([from, to]);
        self.field.gradients.states_of(q).iter().for_each(|i| c.tracks.breaks(*i, from, &mut times));
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        if c.depends.bent[q] {
            let found = self.next_zero_of_bent(c, q, sign, &times, departs);
            c.times = times;
            return found;
        }
        let (g, s) = (self.gradient(c, q), &self.stepper.step);
        let mut found = None;
        for (n, w) in times.windows(2).enumerate() {
            let mut p = Poly::default();
            p[0] = sign * (self.functions.q0[q] + g.t * (w[0] - s.t));
            p[1] = sign * g.t * (w[1] - w[0]);
            for (i, g) in g.states() {
                let own = c.tracks.between(s, i, (w[0], w[1]));
                p.iter_mut().zip(own).for_each(|(p, c)| *p += sign * g * c);
                p[0] -= sign * g * s.x0[i];
            }
            let whole = p;
            let mut degree = p.len() - 1;
            for _ in 0..if n == 0 { departs } else { 0 } {
                p.rotate_left(1);
                (p[7], degree) = (0.0, degree - 1);
            }
            let b = bernstein::of_powers(&p, degree);
            if let First::Zero(at) = bernstein::first(&b[..=degree]) {
                let h = w[1] - w[0];
                found = Some((w[0] + at * h, derivative(&whole, 1, at) / h));
                break;
            }
        }
        c.times = times;
        found
    }

    /// The same of a function whose gradient is not constant, between times at which a state that it depends on goes its own way. Where it is not defined the
    /// zero is at the first of them, and its rate is not known.
    fn next_zero_of_bent(
        &mut self,
        c: &mut UnitEvents,
        q: usize,
        sign: f64,
        times: &[f64],
        departs: usize,
    ) -> Option<(f64, f64)> {
        let unknown = Some((times[0], f64::NAN));
        for (n, w) in times.windows(2).enumerate() {
            let h = w[1] - w[0];
            let mut value = |s: f64| match sign * self.value_on_the_way(c, q, w[0] + s * h) {
                v if v.is_finite() => Ok(v),
                _ => Err(EvalError::Recoverable),
            };
            let begins = n == 0 && departs > 0;
            if !begins && value(0.0).is_ok_and(|v| v <= 0.0) {
                return Some((w[0], f64::NAN));
            }
            let mut first = None;
            let known = find_zeros(&c.sampler, &mut value, (true, begins), &mut |s, rises| {
                first = first.or((!rises).then_some(w[0] + s * h));
            });
            if known.is_err() {
                return unknown;
            }
            let Some(t) = first else { continue };
            for &i in self.field.gradients.states_of(q) {
                c.point[i] = c.tracks.value(&self.stepper.step, i, t);
            }
            if !self.field.gradient_by_parts(c.depends.owner[q], t, &c.point, &mut c.dq) {
                return unknown;
            }
            let g = self.gradient(c, q);
            let along = g.states().map(|(i, g)| g * c.tracks.derivative(&self.stepper.step, i, 1, t)).sum::<f64>();
            return Some((t, sign * (along + g.t)));
        }
        None
    }

    /// Ends the step, which reaches to `t1`, at time `t`, behind the events so far. False where the system is not defined there.
    fn end_units(&mut self, c: &mut UnitEvents, t: f64, t1: f64) -> Result<bool> {
        if self.notes.is_some() {
            self.note_within(t, Some(c))?;
        }
        for i in 0..self.nx {
            if t < t1 || c.tracks.is_touched(i) {
                self.stepper.step.x1[i] = c.tracks.value(&self.stepper.step, i, t);
            }
        }
        if let Some(p) = &mut self.log.path {
            p.push(self.stepper.step.t, t, self.stepper.step.h, &self.stepper.step.poly);
            for &i in &c.tracks.touched {
                let own: Vec<_> = c.tracks.pieces_of(i as usize).filter(|p| p.0 < t).collect();
                own.into_iter().rev().for_each(|(from, h, poly)| p.push_own(i as usize, (from, h), poly));
            }
            p.cut(&c.events);
        }
        if self.log.sampled.are_wanted(t) {
            let (nx, s) = (self.nx, &self.stepper.step);
            self.log.sampled.write(t, nx, |t, out| {
                out.iter_mut().enumerate().for_each(|(i, o)| *o = c.tracks.value(s, i, t));
            });
        }
        self.log.stats.steps += 1;
        self.field.counts.values += c.rows / self.nx;
        c.rows %= self.nx;
        (self.calendar.crowd, self.stepper.err_before) = (0, 1e-4);
        self.functions.touched = None;
        if t == t1 {
            self.watch_stiffness();
        }
        self.t = t;
        self.x.copy_from_slice(&self.stepper.step.x1);
        let mut sets = self.field.active.clone();
        for (k, (set, &cell)) in sets.iter_mut().zip(&c.cells).enumerate() {
            match cell {
                SLIDES if set.len() == 1 => {
                    let first = self.field.first_cell(k);
                    (*set).clear();
                    set.extend([first, first + 1]);
                }
                SLIDES => {}
                own => {
                    set.clear();
                    set.push(own);
                }
            }
        }
        self.field.set_active(&sets);
        self.field.arm(&self.x);
        self.note_end(false);
        recover(self.enter().and_then(|()| self.make_held()).map(|()| true), false)
    }
}

/// Might a weight vanish that was between these values at some points?
fn may_vanish(lo: f64, hi: f64) -> bool {
    lo <= 0.5 * (hi - lo) + 1e-3 * hi
}
