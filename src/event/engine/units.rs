//! Events of single units in a step of all states: only what depends on them is integrated anew.
//!
//! At an event at time `t_e` a state jumps, or its velocity does. Let `A` be the states that are integrated anew, from `t_e` to the end `t_1` of the
//! step, with the dense output of all others. A state `j` outside of `A` reads some of them, and goes on as if nothing had happened: its velocity is
//! off by `d_j(t) = f_j(new) - f_j(old)`, and it by `(t_1 - t_e) max |d_j|` at most, to first order. Where that is more than a small share of
//! its tolerance, `j` becomes one of `A`, and `A` is integrated once more. So `A` is as large as the event can be felt within the step, whatever
//! the number of units is, and the error that is left is that of a step which ends at its dense output. The states that were in `A`
//! at the last event of the same source are the first guess.
//!
//! What is not plain is left to the loop of all states, which ends the step there: sliding modes, functions with gradients that change, zeros of
//! higher order, values that are zero to rounding behind an event, a transition that happens twice at one time, and sources whose intervals shrink.

use super::accumulation::rest_of_series;
use super::control::ACCURATE;
use super::{recover, Engine, Progress, EPS};
use crate::error::Result;
use crate::event::bernstein::{self, First};
use crate::event::calendar::{Entry, UnitEvents, Units};
use crate::event::explicit::{self, Flow, Pair};
use crate::event::field::Owner;
use crate::event::step::{derivative, Poly};
use crate::event::{Jump, Kind, Outcome, Switch};

/// The part of all states that may be integrated anew for one event: else the step of all of them ends there.
const PART: usize = 4;
/// Steps of a group for one of all states: what needs more has another time scale.
const STEPS: usize = 32;
/// A rate, relative to what the states make of the function in a step, of a zero that may be of higher order.
const SLOW: f64 = 1e-6;
/// Velocities behind a surface that leave no doubt, relative to their terms.
const CLEAR: f64 = 1e-6;
/// Events in one step, by the number of states, behind which all states are brought to one time again.
const EVENTS: usize = 16;
/// Part of what counts as felt below which a state is left out the next time.
const HARDLY: f64 = 0.1;

impl Engine {
    /// May events in this step be left to the units?
    fn goes_by_units(&self) -> bool {
        self.calendar.within_steps
            && !self.stepper.step_implicit
            && self.derivatives.sens.is_none()
            && self.derivatives.tape.is_none()
            && self.notes.is_none()
            && !self.field.in_limit_set()
            && self.field.constant_gradients()
    }

    /// Follows what happens in the step to its end `t1`, unit by unit; `grown` is the length of the next one. None where that is nothing for it:
    /// the step is as it was.
    pub(super) fn follow_units(&mut self, t1: f64, grown: f64) -> Result<Option<Progress>> {
        if !self.goes_by_units() {
            return Ok(None);
        }
        let Some(mut c) = self.calendar.units.take() else { return Ok(None) };
        let (t, left) = self.follow_events(&mut c, t1);
        let known = if !c.events.is_empty() { self.end_units(&mut c, t, t1).map(Some) } else { Ok(None) };
        if c.events.is_empty() {
            c.tracks.clear();
        }
        self.calendar.units = Some(c);
        let Some(known) = known? else { return Ok(None) };
        self.stepper.h = grown;
        if !known {
            return Ok(Some(self.fail(Outcome::NoContinuation, "the system is not defined behind an event".into())));
        }
        let at = left.and_then(|e| {
            (0..self.functions.watches.len()).find(|l| self.source(&self.functions.watches[*l]) == e.source)
        });
        match at.zip(left) {
            Some((l, e)) => self.switch(l, e.rate, grown).map(Some),
            None => Ok(Some(Progress::Switched)),
        }
    }

    /// The events in their order. Says up to where they are followed, and which one is left that happens there.
    fn follow_events(&mut self, c: &mut UnitEvents, t1: f64) -> (f64, Option<Entry>) {
        let (t, h) = (self.stepper.step.t, self.stepper.step.h);
        c.begin(
            self.functions
                .zeros
                .iter()
                .map(|&(l, s, slope)| (t + s * h, self.source(&self.functions.watches[l]), slope)),
        );
        self.field.move_parts_to(t, &self.stepper.step.x0);
        c.cells.clear();
        c.cells.extend(self.field.active.iter().map(|set| if let [cell] = set[..] { cell } else { usize::MAX }));
        self.field.mark_tied(&mut c.tied);
        let mut last = t;
        while let Some(e) = c.next() {
            c.forget_event();
            let many = c.events.len() > EVENTS * self.nx;
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
        // NaN is slow
        let clear = -e.rate * self.stepper.step.h > SLOW * self.sizes_at(c, e.source, e.t).1;
        if repeats || shrinks || !clear || self.functions.levels[e.source] > 0.0 {
            return false;
        }
        self.field.set_time_of_parts(e.t);
        let plain = match owner {
            Owner::Guard(g) => !self.field.guards.all[g].spent && self.cascades(c, g, e),
            Owner::Surface(k) => c.cells[k] != usize::MAX && self.crosses(c, k, e),
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

    /// Value of the function in place `q`, whose gradient is constant.
    fn value_at(&self, c: &UnitEvents, q: usize, t: f64) -> f64 {
        let (g, s) = (self.field.gradients.row(&self.functions.dq0, q), &self.stepper.step);
        self.functions.q0[q] + g.states().map(|(i, g)| g * (c.value(s, i, t) - s.x0[i])).sum::<f64>() + g.t * (t - s.t)
    }

    /// Size of the terms of its value, and what it changes by when all states change by their size.
    fn sizes_at(&self, c: &UnitEvents, q: usize, t: f64) -> (f64, f64) {
        let g = self.field.gradients.row(&self.functions.dq0, q);
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
                if !plain || value.is_nan() || value.abs() <= rounding {
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
                if c.cells[k] == usize::MAX {
                    return false;
                }
                let (inside, other) = self.field.sides(k, c.cells[k]);
                let value = inside * self.value_at(c, q, t);
                if value.is_nan() || value.abs() <= 64.0 * EPS * self.sizes_at(c, q, t).0 {
                    return false;
                }
                if value < 0.0 && c.crossed.iter().all(|x| x.0 as usize != k) {
                    c.crossed.push((k as u32, other, f64::NAN));
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

    /// Does the motion cross the surface of subsystem `k`, which leads from its present cell to the other one?
    fn crosses(&mut self, c: &mut UnitEvents, k: usize, e: Entry) -> bool {
        let (inside, other) = self.field.sides(k, c.cells[k]);
        let states: Vec<u32> =
            self.field.gradients.row(&self.functions.dq0, e.source).states().map(|s| s.0 as u32).collect();
        if states.iter().any(|i| c.tied[*i as usize]) {
            return false;
        }
        let before = std::mem::replace(&mut c.cells[k], other);
        c.group.gather(&states, |_| false, &c.depends);
        self.start_group(c, e.t);
        c.step.resize(states.len());
        let UnitEvents { group, moving, tracks, step, .. } = c;
        let mut units = Units { field: &mut self.field, group, moving, tracks, step: &self.stepper.step };
        let known = units.write_velocity(e.t, &group.start, &mut step.f1).is_ok();
        c.cells[k] = before;
        let velocity = &c.step.f1;
        // the group has its states in the order of the gradient
        let g = self.field.gradients.row(&self.functions.dq0, e.source);
        let terms = || g.values.iter().zip(velocity).map(|(g, v)| g * v).chain([g.t]);
        let (rate, size) = (inside * terms().sum::<f64>(), terms().map(f64::abs).sum::<f64>());
        if !known || rate.is_nan() || rate > -CLEAR * size {
            return false;
        }
        c.crossed.push((k as u32, other, e.rate));
        true
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
        for n in 0..c.fired.len() {
            states.extend(c.reach_of(self.field.guards.all[c.fired[n] as usize].q));
        }
        if c.fired.is_empty() {
            states.extend(c.reach_of(e.source));
        }
        for x in &c.crossed {
            states.extend(self.field.driven_by(x.0 as usize).iter().map(|i| *i as u32));
        }
        let mark = c.mark();
        loop {
            states.sort_unstable();
            states.dedup();
            let plain = |i: &u32| {
                let others = |q: &u32| c.depends.owner[*q as usize] == Owner::Other;
                !c.tied[*i as usize] && !c.depends.watching.of(*i as usize).iter().any(others)
            };
            if PART * states.len() > self.nx || !states.iter().all(plain) {
                return false;
            }
            let UnitEvents { group, depends, still, .. } = c;
            group.gather(&states, |i| still[i], depends);
            c.part_from(e.t);
            self.start_group(c, e.t);
            let felt = self.integrate_group(c, e.t, t1).then(|| self.feels(c, e.t, t1, &mut states)).flatten();
            match felt {
                Some(false) => break,
                Some(true) => c.give_up(mark),
                None => {
                    c.give_up(mark);
                    return false;
                }
            }
        }
        let (step, weights, middle) = (&self.stepper.step, &self.stepper.weights, 0.5 * (e.t + t1));
        let source = c.fired.first().map_or(e.source, |g| self.field.guards.all[*g as usize].q);
        c.note_reach(source, |c, k| {
            let i = c.group.states[k] as usize;
            let moved = |t: f64| (c.new_value(step, i, t) - c.tracks.value(step, i, t)).abs() * weights[i];
            k < c.group.moving && moved(middle).max(moved(t1)) > HARDLY * ACCURATE
        });
        c.commit();
        true
    }

    /// Integrates the group from `t` to `t1`. False where it would take many steps, or a function is not defined.
    fn integrate_group(&mut self, c: &mut UnitEvents, t: f64, t1: f64) -> bool {
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
        for _ in 0..STEPS {
            let last = h >= 0.99 * (t1 - t);
            let UnitEvents { group, moving, tracks, step, weights, .. } = c;
            (step.t, step.h) = (t, if last { t1 - t } else { h });
            let mut units = Units { field: &mut self.field, group, moving, tracks, step: &self.stepper.step };
            c.rows += n * pair.rows().0.len();
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
            let good = err <= 1.0 && known && !explicit::is_misjudged(pair, step, weights);
            if !good || explicit::dense(pair, &mut units, step).is_err() {
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
            let outside = |j: &&u32| c.group.place(**j as usize).is_none();
            beside.extend(c.depends.readers.of(i as usize).iter().filter(outside));
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
            let mut worst = 0.0f64;
            for s in [0.0, 0.5, 1.0] {
                let at = t + s * (t1 - t);
                self.field.set_time_of_parts(at);
                let (mut new, mut old) = ([0.0], [0.0]);
                for &i in c.depends.reads.of(own).iter().chain([&j]) {
                    self.field.set_state_of_parts(i as usize, c.new_value(&self.stepper.step, i as usize, at));
                }
                let mut known = self.field.move_by_parts(&mut c.moving, &mut new);
                for &i in c.depends.reads.of(own).iter().chain([&j]) {
                    self.field.set_state_of_parts(i as usize, c.tracks.value(&self.stepper.step, i as usize, at));
                }
                known &= self.field.move_by_parts(&mut c.moving, &mut old);
                worst = worst.max((new[0] - old[0]).abs());
                if !known || worst.is_nan() {
                    return None;
                }
            }
            c.rows += 6;
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
        for &(k, before, rate) in &c.crossed {
            if self.log.switches.len() >= self.options.max_log {
                continue;
            }
            let (k, after) = (k as usize, c.cells[k as usize]);
            let q = self.field.surfaces(k).start;
            let speed = self.stepper.step.f0.iter().map(|v| v * v).sum::<f64>().sqrt();
            let steepness =
                self.field.gradients.row(&self.functions.dq0, q).states().map(|s| s.1 * s.1).sum::<f64>().sqrt();
            self.log.switches.push(Switch {
                t: e.t,
                kind: Kind::Cross,
                simultaneous: c.crossed.len() > 1,
                subsystem: k,
                before: self.field.modes_of(k, &[before]),
                after: self.field.modes_of(k, &[after]),
                rate,
                transversality: rate / (steepness * speed),
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
            c.ask(self.field.surfaces(c.crossed[n].0 as usize).start);
        }
        while let Some(q) = c.first_asked() {
            c.strike_out(q);
            let (sign, departs) = match c.depends.owner[q] {
                Owner::Guard(h) if self.is_armed(c, h, t) => {
                    let g = &self.field.guards.all[h];
                    let toward = g.transition.direction.sign();
                    (if g.spent { toward } else { -toward }, false)
                }
                Owner::Surface(k) if c.cells[k] != usize::MAX => {
                    let here = c.crossed.iter().any(|x| x.0 as usize == k && !x.2.is_nan());
                    (self.field.sides(k, c.cells[k]).0, here)
                }
                _ => continue,
            };
            if let Some((at, rate)) = self.next_zero(c, q, sign, (t, t1), departs) {
                c.enter(at, q, rate);
            }
        }
    }

    /// The next time between `from` and `to` at which `sign` times the function in place `q` falls through zero, and its rate there. Where it
    /// `departs` it is zero at `from`.
    fn next_zero(
        &self,
        c: &mut UnitEvents,
        q: usize,
        sign: f64,
        (from, to): (f64, f64),
        departs: bool,
    ) -> Option<(f64, f64)> {
        let (g, s) = (self.field.gradients.row(&self.functions.dq0, q), &self.stepper.step);
        let mut times = std::mem::take(&mut c.times);
        times.clear();
        times.extend([from, to]);
        g.states().for_each(|(i, _)| c.tracks.breaks(i, from, &mut times));
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
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
            if departs && n == 0 {
                p.rotate_left(1);
                (p[degree], degree) = (0.0, degree - 1);
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

    /// Ends the step, which reaches to `t1`, at time `t`, behind the events so far. False where the system is not defined there.
    fn end_units(&mut self, c: &mut UnitEvents, t: f64, t1: f64) -> Result<bool> {
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
        for (set, &cell) in sets.iter_mut().zip(&c.cells) {
            if let [own] = &mut set[..] {
                *own = cell;
            }
        }
        self.field.set_active(&sets);
        self.field.arm(&self.x);
        self.note_end(false);
        recover(self.enter().and_then(|()| self.make_held()).map(|()| true), false)
    }
}
