//! Steps that others make: an integrator outside asks for the velocity and for what is watched under the present modes, says when something has
//! vanished, and goes on from the modes and the state behind it. This is model exchange of the standard FMI.

use super::{recover, Engine, EPS};
use crate::error::{finite, Error, Result};
use crate::event::watch::Watch;
use crate::event::Outcome;
use crate::func::EvalError;

/// Changes of modes at one time at most; each of them makes another watched function positive.
const MOST: usize = 256;
/// Changes in a row with no time between them: more of them are an accumulation.
const CROWD: usize = 64;
/// Roundings of a value that say nothing.
const NOISE: f64 = 256.0;
/// What begins at zero may be this part of the tolerances below it, and this many times as far while it rises.
const ROOM: f64 = 1e-3;
const RISING: f64 = 64.0;

impl Engine {
    /// Checks that others can make the steps of this system.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for contacts, algebraic states, and modes that are formed on demand.
    pub fn check_outside(&self) -> Result<()> {
        let what = if self.field.has_contacts() {
            "contacts of a scene"
        } else if self.algebraic.is_some() {
            "algebraic states"
        } else if self.field.is_on_demand() {
            "more coupled switching functions than a list of modes can hold"
        } else {
            return Ok(());
        };
        Err(Error::Unsupported(format!("integrators outside of the library do not know {what}: take co-simulation")))
    }

    /// How many functions are watched at most, whatever the modes are.
    pub fn most_watched(&self) -> usize {
        let of = |s: &crate::event::field::Sub| s.n_q + s.cells.len();
        self.field.subs.iter().map(of).sum::<usize>() + self.field.guards.n_outputs()
    }

    /// Sets controls and parameters that change with the time: the modes stay until something vanishes.
    ///
    /// # Errors
    /// [`Error::Range`] for what is not finite, [`Error::Dimension`] for other numbers of values.
    pub fn set_data_outside(&mut self, u: &[f64], p: &[f64]) -> Result<()> {
        finite("control", u, self.field.u.len())?;
        finite("parameter", p, self.field.p.len())?;
        if self.field.u != u || self.field.p != p {
            self.field.u.copy_from_slice(u);
            self.field.p.copy_from_slice(p);
            self.field.forget();
        }
        Ok(())
    }

    /// The velocity under the present modes. False where it is not defined.
    ///
    /// # Errors
    /// Those of the functions of the model.
    pub fn velocity_outside(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<bool> {
        recover(self.field.rhs(t, x, out).map(|()| true), false)
    }

    /// What is watched under the present modes: positive as long as they hold, 1 in the places that are left. `out` has
    /// [`Engine::most_watched`] places. `rooms`: what begins at zero by a little is above it, as others have to see it. False where something is not
    /// defined.
    ///
    /// # Errors
    /// Those of the functions of the model.
    pub fn watched_outside(&mut self, t: f64, x: &[f64], rooms: bool, out: &mut [f64]) -> Result<bool> {
        out.fill(1.0);
        if !recover(self.look_outside(t, x).map(|()| true), false)? {
            return Ok(false);
        }
        for (l, out) in out.iter_mut().enumerate().take(self.functions.watches.len()) {
            let room = if rooms { self.functions.w1[l] } else { 0.0 };
            *out = self.functions.watches[l].value(&self.field.q, &self.field) + room;
        }
        Ok(true)
    }

    /// Velocity, weights and values of what is watched.
    fn look_outside(&mut self, t: f64, x: &[f64]) -> std::result::Result<(), EvalError> {
        self.field.rhs(t, x, &mut self.stepper.node)?;
        self.field.watched(t, x)
    }

    /// Goes on from a time and a state that others have come to: finds the modes of a start, or those behind what has vanished, and makes the
    /// transitions that hold. The state behind them is [`Engine::state`]. What has passed zero is put back to it along the velocity, as far as the
    /// steps of others have gone beyond. `anew` says that data may have jumped: then the modes are looked at even where nothing has vanished.
    ///
    /// # Errors
    /// [`Error::Range`] for what is not finite or a time that lies behind, and those of the functions of the model.
    pub fn go_on_outside(&mut self, t: f64, x: &[f64], span: f64, anew: bool) -> Result<Outcome> {
        self.check_outside()?;
        finite("time", &[t, span], 2)?;
        finite("state", x, self.nx)?;
        let last = self.t;
        let began = !self.restart;
        self.t = t;
        self.t_stop = t + span.max(16.0 * EPS * t.abs());
        self.x.copy_from_slice(x);
        self.functions.flat = None;
        if began {
            self.calendar.crowd = 0;
            for k in 0.. {
                let Some(l) = self.passed_outside(last)? else { break };
                if k == MOST {
                    self.fail(Outcome::NoContinuation, "changes of modes at one time come to no end".into());
                }
                if self.log.outcome == Outcome::Reached {
                    self.pass_outside(l)?;
                    self.note_rooms()?;
                }
                if self.log.outcome != Outcome::Reached {
                    return Ok(self.log.outcome);
                }
            }
        }
        self.restart |= anew;
        if self.restart {
            self.begin(self.t_stop)?;
            if self.restart && self.log.outcome == Outcome::Reached {
                self.fail(Outcome::NoContinuation, "no single mode goes on from here: take co-simulation".into());
            }
        }
        self.note_rooms()?;
        Ok(self.log.outcome)
    }

    /// The function that has passed zero first at the present point, if there is one.
    fn passed_outside(&mut self, last: f64) -> Result<Option<usize>> {
        let (t, at) = (self.t, self.x.clone());
        let x = &at[..];
        let r = self.look_outside(t, x).and_then(|()| self.field.watched_gradients(t, x));
        if !recover(r.map(|()| true), false)? {
            // a mode that ends here may have no value any more: what is to be left is told by what is watched alone
            let known = recover(self.field.watched(t, &self.x).map(|()| true), false)?;
            let behind = |e: &Engine, l: usize| {
                let w = e.functions.watches[l];
                !w.is_leave() && w.value(&e.field.q, &e.field) + e.functions.w1[l] < 0.0
            };
            return Ok((0..self.functions.watches.len()).find(|l| known && behind(self, *l)));
        }
        self.f.copy_from_slice(&self.stepper.node);
        let mut first: Option<(f64, usize)> = None;
        for l in 0..self.functions.watches.len() {
            let w = self.functions.watches[l];
            let value = w.value(&self.field.q, &self.field);
            if value + self.functions.w1[l] >= 0.0 {
                continue;
            }
            // so long ago it vanished; of a weight nothing but that it has
            let rate = w.rate(&self.field.dq, &self.field, &self.f);
            if rate > 0.0 && value >= -RISING * self.room_of(l, (t, x)) {
                // errors of others, in what has just begun to rise
                continue;
            }
            let ago = if rate < 0.0 { (value / rate).min(t - last) } else { t - last };
            if first.is_none_or(|(most, _)| ago > most) {
                first = Some((ago, l));
            }
        }
        if let Some((_, l)) = first {
            self.put_back(l, t - last);
        }
        Ok(first.map(|(_, l)| l))
    }

    /// Puts the state back to where watch `l` vanishes, along the velocity, over `most` of time at most.
    fn put_back(&mut self, l: usize, most: f64) {
        let w = self.functions.watches[l];
        let Some(a) = w.place() else { return };
        let b = match w {
            Watch::Enter { b, .. } => b,
            _ => None,
        };
        let value = w.value(&self.field.q, &self.field);
        let along = |j: usize| self.field.gradient_row(j).states().map(|(i, g)| g * self.f[i]).sum::<f64>();
        let difference = along(a) - b.map_or(0.0, along);
        let sign = match w {
            Watch::Enter { sign, .. } | Watch::Guard { sign, .. } => sign,
            _ => return,
        };
        let delta = -value / (sign * difference);
        if delta.is_finite() && delta.abs() <= most {
            self.x.iter_mut().zip(&self.f).for_each(|(x, f)| *x += delta * f);
        }
    }

    /// Changes the modes, or makes a transition, where watch `l` vanishes.
    fn pass_outside(&mut self, l: usize) -> Result<()> {
        self.note_levels(l);
        if let Watch::Guard { guard, .. } = self.functions.watches[l] {
            if self.accumulates_outside(l)? {
                let text = format!("transition {guard} happens again within the tolerances: its events accumulate");
                self.fail(Outcome::Zeno, text);
                return Ok(());
            }
            let rate = self.functions.watches[l].rate(&self.field.dq, &self.field, &self.f);
            self.pass_guard(l, rate)?;
            return Ok(());
        }
        let before = self.field.active.clone();
        let r = self.switch_inner(l, f64::NAN, &before);
        if !recover(r.map(|()| true), false)? && self.log.outcome == Outcome::Reached {
            self.fail(Outcome::NoContinuation, "the modes around the switch are not defined there".into());
        }
        Ok(())
    }

    /// How far what is watched may be below zero before it has passed: what begins at zero by a little, anything else not at all.
    fn note_rooms(&mut self) -> Result<()> {
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        let (t, x) = (self.t, self.x.clone());
        let r = self.look_outside(t, &x).and_then(|()| self.field.watched_gradients(t, &x));
        if !recover(r.map(|()| true), false)? {
            self.fail(Outcome::NoContinuation, "the system is not defined at this point".into());
            return Ok(());
        }
        for l in 0..self.functions.watches.len() {
            let w = self.functions.watches[l];
            let value = w.value(&self.field.q, &self.field);
            let room = self.room_of(l, (t, &x));
            let far = RISING * room;
            self.functions.w1[l] = match w {
                Watch::Leave { .. } => (room - value).max(0.0),
                _ if value > room || value < -far => 0.0,
                _ => room - value.min(0.0) * 2.0,
            };
        }
        Ok(())
    }

    /// How far watch `l` may be below zero where it begins there. Its gradient is that of the last point.
    fn room_of(&self, l: usize, (t, x): (f64, &[f64])) -> f64 {
        let w = self.functions.watches[l];
        let rounding = match w {
            Watch::Leave { .. } => 64.0 * EPS,
            _ => 64.0 * EPS * w.scale(&self.field.dq, &self.field, t, x).value,
        };
        rounding.max(ROOM * self.tolerance_outside(l))
    }

    /// What the tolerances see of watch `l`.
    fn tolerance_outside(&self, l: usize) -> f64 {
        match (self.functions.watches[l].place(), self.functions.watches[l]) {
            (Some(a), Watch::Enter { b, .. }) => self.reach_of(a) + b.map_or(0.0, |b| self.reach_of(b)),
            (Some(a), _) => self.reach_of(a),
            // weights are shares of one
            (None, _) => self.rtol.iter().fold(0.0f64, |m, v| m.max(*v)),
        }
    }

    /// Has the guard of watch `l` come no further than the tolerances since its transition was made last? Then there are more and more of them.
    fn accumulates_outside(&mut self, l: usize) -> Result<bool> {
        let w = self.functions.watches[l];
        let back = matches!(w, Watch::Guard { back: true, .. });
        let Some(before) = self.calendar.recent.of(self.source(&w)).back(0).filter(|_| !back) else { return Ok(false) };
        let rate = w.rate(&self.field.dq, &self.field, &self.f);
        let noise = NOISE * EPS * w.scale(&self.field.dq, &self.field, self.t, &self.x).value;
        Ok(rate.abs() * (self.t - before) <= noise.max(self.tolerance_outside(l)))
    }

    /// Notes a change at this time, made by others; more than a crowd of them with no time in between end the run.
    pub fn note_outside(&mut self, crowd: &mut (f64, usize)) -> Outcome {
        let near = (self.t - crowd.0).abs() <= 64.0 * EPS * self.t.abs();
        *crowd = (self.t, if near { crowd.1 + 1 } else { 0 });
        if crowd.1 > CROWD && self.log.outcome == Outcome::Reached {
            self.fail(Outcome::Zeno, "events accumulate: end the simulation before, or take co-simulation".into());
        }
        self.log.outcome
    }
}
