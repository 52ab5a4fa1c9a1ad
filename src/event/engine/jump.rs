//! Transitions that are made: the state jumps, and what follows at the same time.
//!
//! With `dt` the derivative of the time of the jump, `f⁻` and `f⁺` the velocities around it and `r` the reset, the
//! derivatives at fixed time are `S⁺ = r_x (S⁻ + f⁻ dt) + r_p + r_t dt − f⁺ dt`; resets that make each other happen follow each other
//! in between. A guard that vanishes by itself at the same time has a time of its own, along the motion behind the transitions before it: the
//! derivatives are those of the side on which the transitions happen in this order.

use std::collections::HashMap;
use std::sync::atomic::Ordering;

use super::{recover, Engine, Progress, EPS};
use crate::error::{Error, Result};
use crate::event::watch::Watch;
use crate::event::{Jump, Outcome};
use crate::func::EvalError;
use crate::stop;
use crate::system::Effect;

/// How often one transition happens at one time at most, whatever others do in between.
const MOST: u32 = 1024;
/// A guard that since the last jump has come no further than this many roundings of its value goes to and fro in rounding.
const NOISE: f64 = 64.0;
/// The first step behind a jump may be this much longer than the time since the jump before it.
const LONGER: f64 = 4.0;

/// Transitions that follow each other at one time.
///
/// They go on for ever where the same one happens in the same state again: from there on everything repeats, as what follows depends on the
/// state alone. Such a cycle is found with one remembered state, which moves on whenever twice as many have gone by
/// (R. P. Brent, An improved Monte Carlo factorization algorithm, BIT 20 (1980) 176-184). Those whose states never repeat are given up.
#[derive(Default)]
struct Cascade {
    made: usize,
    /// The transition that is remembered, the state before it, and after how many.
    mark: (usize, Vec<f64>, usize),
    /// How often each has happened.
    times: HashMap<usize, u32>,
}

impl Cascade {
    /// Transition `g` is to happen in state `x`: says why not, if it never comes to an end.
    fn endless(&mut self, g: usize, x: &[f64]) -> Option<String> {
        self.made += 1;
        let (marked, state, at) = &mut self.mark;
        if *at > 0 && *marked == g && state == x {
            let cycle = self.made - *at;
            return Some(format!(
                "transitions trigger each other for ever at one time: {cycle} after transition {g} it happens again, in the same state"
            ));
        }
        if self.made >= 2 * *at {
            (*marked, *at) = (g, self.made);
            state.clear();
            state.extend_from_slice(x);
        }
        if self.made == 1 {
            // most have no other behind them
            return None;
        }
        let times = self.times.entry(g).or_default();
        *times += 1;
        (*times > MOST).then(|| {
            format!(
                "transition {g} happens {MOST} times at one time, in other states: they come to no end, or are so many that they \
                 should be one transition"
            )
        })
    }
}

impl Engine {
    /// The guard of watch `l` vanishes at the present point.
    pub(super) fn jump(&mut self, l: usize, slope: f64, grown: f64) -> Result<Progress> {
        let Some(made) = self.pass_guard(l, slope)? else { return Ok(Progress::Done) };
        // what happens next may happen soon again: a step much longer than the time since the last jump finds it badly
        self.stepper.h =
            if self.calendar.recent.n > 1 { grown.min(LONGER * self.calendar.recent.last_gap()) } else { grown };
        self.stepper.err_before = 1e-4;
        if self.log.outcome != Outcome::Reached {
            return Ok(Progress::Done);
        }
        if !made {
            return Ok(Progress::Stepped);
        }
        Ok(self.accumulate()?.unwrap_or(Progress::Switched))
    }

    /// Makes the transition whose guard vanishes in watch `l`, and says whether it has been made: a guard may be back, or another output have to
    /// pass zero too. None where the system is not defined there.
    pub(super) fn pass_guard(&mut self, l: usize, slope: f64) -> Result<Option<bool>> {
        let Watch::Guard { guard, a, back, .. } = self.functions.watches[l] else {
            return Err(Error::Internal("a jump without a guard".into()));
        };
        let g = &mut self.field.guards.all[guard];
        g.last = a - g.q;
        let alone = g.transition.clauses.is_empty();
        let happens = alone || back || recover(self.becomes_true(guard), false)?;
        let r = match (back, happens) {
            (true, _) => self.watch_again(guard),
            (_, true) => self.jump_inner(l, guard, slope),
            // another output has to pass zero too
            _ => self.enter(),
        };
        if !recover(r.map(|()| true), false)? {
            let text = format!("the system is not defined where transition {guard} happens, or behind it");
            self.fail(Outcome::NoContinuation, text);
            return Ok(None);
        }
        Ok(Some(!back && happens))
    }

    /// A guard that had passed zero is back; of several outputs one is, and what is watched is chosen anew.
    fn watch_again(&mut self, guard: usize) -> std::result::Result<(), EvalError> {
        let g = &mut self.field.guards.all[guard];
        g.spent = !g.transition.clauses.is_empty();
        self.enter()
    }

    /// Is the condition of a guard with several outputs true, now that the last one has passed zero?
    fn becomes_true(&mut self, guard: usize) -> std::result::Result<bool, EvalError> {
        self.arrive()?;
        self.functions.q0.copy_from_slice(&self.field.q);
        self.functions.dq0.copy_from_slice(&self.field.dq);
        let g = &self.field.guards.all[guard];
        let (q, n, last) = (g.q, g.n, g.last);
        let mut known = Vec::with_capacity(n);
        for l in 0..n {
            known.push(l == last || self.is_output_beyond(guard, q + l, 1.0)?);
        }
        Ok(self.field.guards.is_true(guard, |l| known[l]))
    }

    /// Is the output of a guard at place `a` beyond zero in its direction, or at zero and on its way?
    fn is_output_beyond(&mut self, guard: usize, a: usize, toward: f64) -> std::result::Result<bool, EvalError> {
        Ok(self.is_beyond(&Watch::Guard { guard, a, sign: -toward, back: false })?.is_some())
    }

    /// Chooses what is watched of guards with several outputs, and passes over what waits for an edge. Values and gradients are those at the
    /// present point.
    pub(super) fn choose_outputs(&mut self) -> std::result::Result<(), EvalError> {
        if self.field.guards.are_plain() {
            return Ok(());
        }
        // to know values nothing of the guards is needed
        let mut guards = std::mem::take(&mut self.field.guards);
        let r = guards.choose(|g, l| self.is_output_beyond(usize::MAX, g.q + l, g.transition.direction.sign()));
        self.field.guards = guards;
        r
    }

    fn jump_inner(&mut self, l: usize, guard: usize, slope: f64) -> std::result::Result<(), EvalError> {
        let t = self.t;
        self.arrive()?;
        let w = self.functions.watches[l];
        let rate = if slope.is_finite() { w.rate(&self.field.dq, &self.field, &self.f) } else { slope };
        if self.has_not_moved(&w, rate)? {
            self.end_at_accumulation(t);
            return Ok(());
        }
        let place = self.field.guards.all[guard].place();
        self.functions.reached[place] = 0.0;
        let scale = w.scale(&self.field.dq, &self.field, t, &self.x);
        self.log.one_sided |= match &self.functions.flat {
            Some(flat) => flat.coarse,
            None => rate.abs() < 1e-6 * scale.reach * self.field.pace(&self.x, &self.f),
        };
        self.differentiate_time(l)?;
        self.functions.zero.fill(false);
        self.functions.zero[place] = true;
        self.remember(self.source(&w), None);
        self.calendar.recent.note_jump();
        self.make(guard, -rate)
    }

    /// Has a guard that vanishes at this rate come no further than rounding since it did so last?
    fn has_not_moved(&mut self, w: &Watch, rate: f64) -> std::result::Result<bool, EvalError> {
        let Some(before) = self.calendar.recent.of(self.source(w)).back(0) else { return Ok(false) };
        let noise = NOISE * w.rounding(&self.field.dq, &self.field, self.t, &self.x);
        if rate.abs() * (self.t - before) > noise {
            return Ok(false);
        }
        // a zero of higher order has no rate
        if w.place().is_some_and(|a| self.functions.reached[a] > noise) {
            return Ok(false);
        }
        self.write_dense()?;
        self.stepper.step.at(0.5, &mut self.stepper.node);
        self.field.watched(self.stepper.step.t + 0.5 * self.stepper.step.h, &self.stepper.node)?;
        let mut moved = w.value(&self.field.q, &self.field).abs();
        self.stepper.step.at(0.0, &mut self.stepper.node);
        self.field.watched(self.stepper.step.t, &self.stepper.node)?;
        moved = moved.max(w.value(&self.field.q, &self.field).abs());
        self.field.watched(self.t, &self.x)?;
        Ok(moved <= noise)
    }

    /// Makes the transitions whose guards hold at the present point, if there are any; the derivatives of the time are those
    /// of the last switch.
    pub(super) fn make_held(&mut self) -> std::result::Result<(), EvalError> {
        if self.field.guards.armed.is_empty() || self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        match self.held()? {
            Some((g, touches)) => {
                self.log.one_sided |= touches;
                self.make(g, f64::NAN)
            }
            None => Ok(()),
        }
    }

    /// Is the call that runs to end?
    fn is_called_off(&mut self) -> bool {
        let flagged = self.interrupt.as_ref().is_some_and(|f| f.load(Ordering::Relaxed));
        flagged || stop::requested().is_some() || self.is_to_end()
    }

    /// Makes the transitions that the last call has left, see [`Engine::make`].
    pub(super) fn make_rest(&mut self) -> Result<Progress> {
        self.unmade = false;
        Ok(self.make_what_holds("system")?.unwrap_or(Progress::Switched))
    }

    /// Makes the transitions that hold. Where `what` is not defined behind one of them the run ends, and it says how.
    pub(super) fn make_what_holds(&mut self, what: &str) -> Result<Option<Progress>> {
        if recover(self.make_held().map(|()| true), false)? {
            return Ok(None);
        }
        Ok(Some(self.fail(Outcome::NoContinuation, format!("the {what} is not defined behind a transition"))))
    }

    /// Makes the transitions that hold at a start, and chooses the first step where they do not end the run.
    pub(super) fn start_off(&mut self, t_stop: f64, what: &str) -> Result<()> {
        // transitions that the last call has left happen at a time of their own, while data change at this one
        self.log.one_sided |= std::mem::take(&mut self.unmade);
        self.make_what_holds(what)?;
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        self.restart = false;
        self.stepper.err_before = 1e-4;
        let given = std::mem::take(&mut self.stepper.given);
        self.stepper.h = match given > 0.0 && !self.stepper.implicit && self.options.h0 == 0.0 {
            true => given.min(t_stop - self.t).min(self.options.h_max),
            false => self.initial_step(t_stop - self.t)?,
        };
        Ok(())
    }

    /// Makes transition `guard`, and those that hold behind it. The velocity is that before. There may be many of them: a call that is to end
    /// leaves some to the next one.
    fn make(&mut self, guard: usize, rate: f64) -> std::result::Result<(), EvalError> {
        let mut before = self.field.active.clone();
        self.f_before.copy_from_slice(&self.f);
        let start = self.log.jumps.len();
        let recorded = self.derivatives.sens.is_some() || self.derivatives.tape.is_some();
        if let Some(s) = &mut self.derivatives.sens {
            s.advance(&self.f_before, 1.0);
        }
        let (mut resets, mut chain, mut cascade) = (Vec::new(), Vec::new(), Cascade::default());
        let (mut next, mut rate, mut unique, mut made, mut owned) = (Some((guard, false)), rate, true, 0, 0);
        let (mut log, mut tried) = ((self.log.switches.len(), start), false);
        let length = self.usual_step();
        self.settle()?;
        while let Some((g, vanishes)) = next {
            if made > 0 && self.is_called_off() {
                // what has been made is complete; the next step begins with the others, at the same time
                self.unmade = true;
                break;
            }
            if let Some(text) = cascade.endless(g, &self.x) {
                let modes = self.endless_modes(g);
                // one after the other they come to no end: all modes are tried, once
                if modes.is_none() || std::mem::replace(&mut tried, true) || !self.find_modes()? {
                    self.fail(Outcome::NoContinuation, modes.unwrap_or(text));
                    return Ok(());
                }
                (unique, cascade) = (false, Cascade::default());
                if self.field.has_contacts() {
                    self.scene_behind_jump(g, recorded, length, &mut resets)?;
                } else {
                    self.locate(true, length)?;
                }
                if self.log.outcome != Outcome::Reached {
                    return Ok(());
                }
                if !self.field.has_contacts() {
                    self.enter()?;
                }
                next = self.held()?;
                continue;
            }
            made += 1;
            if vanishes && recorded {
                self.part_from(g, log, &mut resets, &mut chain)?;
                log.1 = self.log.jumps.len();
            }
            self.note_made(self.field.guards.all[g].place());
            self.field.reset(g, (self.t, &self.x), recorded, &mut self.derivatives.reset)?;
            if self.derivatives.reset.x.iter().any(|v| !v.is_finite()) {
                return Err(EvalError::Recoverable);
            }
            if self.field.guards.all[g].transition.rule.effect != Effect::Stop {
                self.settle_reset(g)?;
            }
            if let Some(s) = &mut self.derivatives.sens {
                s.reset_by(&self.derivatives.reset.jac);
            }
            if self.derivatives.tape.is_some() {
                resets.extend_from_slice(&self.derivatives.reset.jac);
                chain.push(self.made_as(g));
            }
            let own = self.log_own(g, rate)?;
            if self.log.outcome == Outcome::Ambiguous {
                return Ok(());
            }
            owned += usize::from(own);
            if !own && self.log.jumps.len() < self.options.max_log {
                let nx = self.n_shown();
                self.log.jumps.push(Jump {
                    t: self.t,
                    transition: g,
                    states: Vec::new(),
                    before: self.x[..nx].to_vec(),
                    after: self.derivatives.reset.x[..nx].to_vec(),
                    rate,
                    simultaneous: false,
                    dt: self.shown_dt(),
                });
            }
            if self.field.guards.all[g].transition.rule.effect == Effect::Stop {
                self.end_at(g);
                break;
            }
            self.x.copy_from_slice(&self.derivatives.reset.x);
            self.field.arm(&self.x);
            if self.field.has_contacts() {
                unique &= self.scene_behind_jump(g, recorded, length, &mut resets)?;
                if self.log.outcome != Outcome::Reached {
                    return Ok(());
                }
            } else if self.stays_in_limit_set_behind_jump()? {
                before.clone_from(&self.field.active);
            } else {
                unique &= self.locate(true, length)?;
                if self.log.outcome != Outcome::Reached {
                    return Ok(());
                }
                self.enter()?;
            }
            if self.goes_on(g)? {
                // it is watched on its way back
                self.field.guards.all[g].spent = true;
                self.enter()?;
            }
            rate = f64::NAN;
            let held = self.held()?;
            self.log.one_sided |= held.is_some_and(|h| h.1);
            next = held;
        }
        self.log.stats.jumps += made - owned;
        self.log.one_sided |= !unique;
        for j in &mut self.log.jumps[start..] {
            j.simultaneous = made > 1;
        }
        if self.log.outcome == Outcome::Event {
            self.differentiate_end(log, &resets, chain);
            return Ok(());
        }
        self.differentiate_resets(log, &resets, chain)?;
        self.log(&before, f64::NAN, None, unique);
        Ok(())
    }

    /// Transition `g` ends the run.
    fn end_at(&mut self, g: usize) {
        let name = &self.field.guards.all[g].transition.rule.name;
        let text =
            if name.is_empty() { format!("transition {g} ends the run") } else { format!("'{name}' ends the run") };
        self.log.stopped_by = Some(g);
        self.fail(Outcome::Event, text);
    }

    /// Derivatives of the state where the run ends, whose time moves: behind it nothing does. What is tied to surfaces stays on them.
    fn differentiate_end(&mut self, log: (usize, usize), resets: &[f64], made: Vec<usize>) {
        if let Some(tape) = &mut self.derivatives.tape {
            let n_c = self.derivatives.time_row.len() - 1;
            let rest = vec![0.0; self.nx];
            let event = tape.take_event(&self.field, made, true);
            tape.jump(log, &self.derivatives.time_row[..n_c], [&self.f_before, &rest], resets, event);
        }
    }

    /// Derivatives behind transitions of one time with these resets, whose velocities are that before them and the present one.
    fn differentiate_resets(
        &mut self,
        log: (usize, usize),
        resets: &[f64],
        made: Vec<usize>,
    ) -> std::result::Result<(), EvalError> {
        if let Some(s) = &mut self.derivatives.sens {
            s.advance(&self.f, -1.0);
        }
        if let Some(tape) = &mut self.derivatives.tape {
            let n_c = self.derivatives.time_row.len() - 1;
            let event = tape.take_event(&self.field, made, false);
            tape.jump(log, &self.derivatives.time_row[..n_c], [&self.f_before, &self.f], resets, event);
        }
        self.project_sensitivity()
    }

    /// The watch of the guard of a transition on its way to zero, if there is one.
    fn watch_of(&self, transition: usize) -> Option<usize> {
        let is_its = |w: &Watch| matches!(*w, Watch::Guard { guard, back: false, .. } if guard == transition);
        self.functions.watches.iter().position(is_its)
    }

    /// Transition `g` happens at a time of its own behind those with these resets, see [`Tape::jump`](crate::event::tape::Tape::jump).
    fn part_from(
        &mut self,
        g: usize,
        log: (usize, usize),
        resets: &mut Vec<f64>,
        made: &mut Vec<usize>,
    ) -> std::result::Result<(), EvalError> {
        let Some(l) = self.watch_of(g) else { return Ok(()) };
        if self.field.in_limit_set() {
            return Ok(());
        }
        self.differentiate_resets(log, resets, std::mem::take(made))?;
        resets.clear();
        self.f_before.copy_from_slice(&self.f);
        self.field.watched(self.t, &self.x)?;
        self.field.watched_gradients(self.t, &self.x)?;
        let at = (self.t, &self.x[..], &self.f[..]);
        self.functions.watches[l].time_gradient(&mut self.field, at, &mut self.derivatives.time_row)?;
        if let Some(s) = &mut self.derivatives.sens {
            s.time(&self.derivatives.time_row);
            s.advance(&self.f_before, 1.0);
        }
        Ok(())
    }

    /// Does a transition act at the present point: is its guard watched and beyond zero, or at zero and on its way? And is
    /// it at zero: then a small change decides whether it acts now.
    fn acts(&mut self, l: usize) -> std::result::Result<Option<(usize, bool)>, EvalError> {
        let w = self.functions.watches[l];
        let Watch::Guard { guard, back: false, .. } = w else { return Ok(None) };
        Ok(self.is_beyond(&w)?.map(|touches| (guard, touches)))
    }

    /// Is the guard of a watch beyond zero, or at zero and on its way? And is it at zero?
    fn is_beyond(&mut self, w: &Watch) -> std::result::Result<Option<bool>, EvalError> {
        let value = w.value(&self.functions.q0, &self.field);
        if self.is_level(w, value) {
            // rounding: it has happened, or happens with what vanished here
            return Ok(w.place().filter(|a| self.is_due(*a)).map(|_| false));
        }
        let (scale, rate) = w.scale_and_rate(&self.functions.dq0, &self.field, (self.t, &self.x), &self.f);
        let tol = (64.0 * EPS * scale.value).max(8.0 * EPS * rate.abs() * self.t.abs());
        let acts = value < -tol
            // all states are asked how fast they are where a guard is at zero only
            || value <= tol && rate < -1e-9 * scale.reach * self.field.pace(&self.x, &self.f) && -rate > self.rate_noise(w)?;
        Ok(acts.then_some(value >= -tol))
    }

    /// The first transition that acts.
    fn held(&mut self) -> std::result::Result<Option<(usize, bool)>, EvalError> {
        for l in 0..self.functions.watches.len() {
            let found = self.acts(l)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// What rounding makes of the rate of a guard where modes slide. What they tie is zero to the rounding of the states in it, and of what they
    /// are pulled by on both sides in a step. The rate of a guard that depends on it is known to no more than that: a body that friction
    /// holds has a velocity of `1e-17`, and does not go anywhere. Weights in equations are known to rounding of what they balance.
    pub(super) fn rate_noise(&mut self, w: &Watch) -> std::result::Result<f64, EvalError> {
        /// Roundings that are seen, and by how many of them states are moved to see what they do.
        const SEEN: f64 = 64.0;
        const FAR: f64 = 1e7;
        let held = self.noise_of_held(w)?;
        if self.field.n_alg() == 0 || self.field.has_contacts() || self.field.in_limit_set() {
            return Ok(held);
        }
        let mut there = std::mem::take(&mut self.stepper.node);
        let mut velocity = std::mem::take(&mut self.stepper.step.f);
        there.copy_from_slice(&self.x);
        let length = self.usual_step();
        let mut pull = vec![0.0f64; self.nx];
        for (i, d) in (0..self.field.n_alg()).flat_map(|pair| self.field.d(pair)) {
            pull[i] = pull[i].max(d.abs());
        }
        for k in (0..self.field.subs.len()).filter(|k| self.field.active[*k].len() > 1) {
            for j in self.field.surfaces(k) {
                for (i, g) in self.field.gradients.row(&self.functions.dq0, j).states() {
                    // by different parts, as those of two states may cancel
                    let part = 1.0 + (0.618_034 * i as f64).fract();
                    if g != 0.0 {
                        there[i] = self.x[i] + part * FAR * EPS * (self.field.size(i, self.x[i]) + length * pull[i]);
                    }
                }
            }
        }
        let n_alg = self.field.n_alg();
        let alpha = self.field.alpha[..n_alg].to_vec();
        let known = self.field.rhs(self.t, &there, &mut velocity);
        self.field.alpha[..n_alg].copy_from_slice(&alpha);
        let change =
            w.rate(&self.functions.dq0, &self.field, &velocity) - w.rate(&self.functions.dq0, &self.field, &self.f);
        self.stepper.node = there;
        self.stepper.step.f = velocity;
        match known {
            Ok(()) if change.is_finite() => Ok(held.max(SEEN / FAR * change.abs())),
            Ok(()) | Err(EvalError::Recoverable) => Ok(held),
            Err(e) => Err(e),
        }
    }

    /// Does the guard of transition `g`, which has just been made, go on below zero?
    fn goes_on(&mut self, g: usize) -> std::result::Result<bool, EvalError> {
        let Some(l) = self.watch_of(g) else { return Ok(false) };
        match self.level(&self.functions.watches[l]) {
            0.0 => Ok(self.acts(l)?.is_some()),
            level => self.falls_ahead(l, level),
        }
    }

    /// Discrete states stand still but for transitions.
    pub(super) fn check_discrete(&self) -> Result<()> {
        match self.discrete.iter().find(|d| self.f[**d] != 0.0) {
            Some(d) => Err(Error::State(format!(
                "state {d} is discrete, as transitions set or ask for its value, but its derivative is {}: make it zero",
                self.f[*d]
            ))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cascades_that_repeat_are_endless_and_counters_are_not() {
        let mut c = Cascade::default();
        // three transitions in turn, in states that repeat
        let after = (0..100).find(|k| c.endless(k % 3, &[f64::from((k % 3) as i32)]).is_some());
        assert!(after.is_some_and(|k| k < 12), "{after:?}");
        let mut c = Cascade::default();
        assert!((0..MOST as usize).all(|k| c.endless(k % 2, &[k as f64]).is_none()));
        // but not for ever
        let says = (0..2 * MOST as usize).find_map(|k| c.endless(0, &[-1.0 - k as f64]));
        assert!(says.is_some_and(|s| s.contains("1024 times")));
    }
}
