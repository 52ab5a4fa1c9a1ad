//! What a run leaves: dense output and the log of switches.

use super::{recover, Engine, EPS};
use crate::error::{finite, Error, Result};
use crate::event::explicit;
use crate::event::path;
use crate::event::sets;
use crate::event::{Contact, Kind, Switch};
use crate::func::EvalError;
use crate::memory;

/// States at times that were asked for before.
#[derive(Debug, Default)]
pub(super) struct Sampled {
    /// In their order, and how many of them are known.
    times: Vec<f64>,
    known: usize,
    /// Their states, one after the other; NaN where they are not known.
    states: Vec<f64>,
}

impl Sampled {
    /// Are there any up to this time?
    pub(super) fn are_wanted(&self, t1: f64) -> bool {
        self.times.get(self.known).is_some_and(|t| *t <= t1)
    }

    /// Writes those up to time `t1`.
    pub(super) fn write(&mut self, t1: f64, nx: usize, mut state: impl FnMut(f64, &mut [f64])) {
        while let Some(&t) = self.times.get(self.known).filter(|t| **t <= t1) {
            state(t, &mut self.states[self.known * nx..(self.known + 1) * nx]);
            self.known += 1;
        }
    }
}

impl Engine {
    /// Asks for the states at these times, which increase and do not lie behind, on the way that comes: they are on the dense output of
    /// the steps, of which none is kept and none ends for them. At a switch the step before it counts.
    pub fn want_samples(&mut self, times: &[f64]) -> Result<()> {
        finite("time", times, times.len())?;
        if let Some(t) = times.iter().find(|t| **t < self.t) {
            return Err(Error::Range(format!("time {t} lies behind: {} is reached", self.t)));
        }
        if let Some(w) = times.windows(2).find(|w| w[1] < w[0]) {
            return Err(Error::Range(format!("times must increase: {} comes behind {}", w[1], w[0])));
        }
        let mut s = Sampled::default();
        memory::reserve(&mut s.times, times.len())?;
        let nx = self.n_shown();
        memory::reserve(&mut s.states, times.len() * nx)?;
        s.times.extend_from_slice(times);
        s.states.resize(times.len() * self.nx, f64::NAN);
        self.log.sampled = s;
        Ok(())
    }

    /// The states asked for, one after the other, which are not asked for any more; NaN at times behind the one reached.
    pub fn take_samples(&mut self) -> Vec<f64> {
        let (t, nx, x) = (self.t, self.n_shown(), &self.x);
        self.log.sampled.write(t, nx, |_, out| out.copy_from_slice(&x[..nx]));
        std::mem::take(&mut self.log.sampled).states
    }

    /// A piece of the dense output, which stands in the step, ends at time `t1`.
    pub(super) fn note_piece(&mut self, t1: f64) {
        let nx = self.n_shown();
        let s = &self.stepper.step;
        if let Some(p) = &mut self.log.path {
            p.push(s.t, t1, s.h, &s.poly[..nx]);
        }
        let (follower, u, p) = (self.algebraic.as_deref(), &self.field.u, &self.field.p);
        self.log.sampled.write(t1, nx, |t, out| {
            s.at((t - s.t) / s.h, out);
            if let Some(a) = follower {
                a.show(t, out, &s.x0[nx..], u, p);
            }
        });
        self.note_algebraic(t1);
    }

    /// `k`-th derivative of the dense output at a time in the last step.
    pub fn get_dky(&mut self, t: f64, k: usize, out: &mut [f64]) -> Result<()> {
        let nx = self.n_shown();
        if out.len() != nx {
            return Err(Error::Dimension(format!("room for {} values, a state has {nx}", out.len())));
        }
        if self.stepper.step.h == 0.0 {
            return Err(Error::State("there is no dense output before the first step".into()));
        }
        let slack = 8.0 * EPS * self.t.abs();
        if !(t >= self.stepper.step.t - slack && t <= self.t + slack) {
            let (a, b) = (self.stepper.step.t, self.t);
            return Err(Error::Range(format!("time {t} is outside of the last step, {a} to {b}")));
        }
        self.save_dense()?;
        path::eval(
            &self.stepper.step.poly,
            (t - self.stepper.step.t) / self.stepper.step.h,
            self.stepper.step.h,
            k,
            out,
        );
        if let Some(c) = &self.calendar.units {
            for &i in &c.tracks.touched {
                out[i as usize] = c.tracks.derivative(&self.stepper.step, i as usize, k, t);
            }
        }
        self.algebraic_dky(t, k, out);
        Ok(())
    }

    pub(super) fn save_dense(&mut self) -> Result<()> {
        if self.stepper.step.h == 0.0 {
            return Ok(());
        }
        let r = self.write_dense();
        recover(r.map(|()| true), false)?;
        Ok(())
    }

    /// Dense output of the last step, evaluated under the active set it had.
    pub(super) fn write_dense(&mut self) -> std::result::Result<(), EvalError> {
        if self.stepper.dense_ready {
            return Ok(());
        }
        if self.stepper.step_implicit {
            self.stepper.radau.dense(&mut self.stepper.step, self.stepper.fresh);
        } else {
            let foreign = !sets::same(&self.stepper.step_sets, &self.field.active);
            let present = foreign.then(|| (self.field.active.clone(), self.field.limit.take()));
            if foreign {
                self.field.set_active(&self.stepper.step_sets);
            }
            let r = explicit::dense(self.stepper.pair, &mut self.field, &mut self.stepper.step);
            if let Some((active, limit)) = present {
                self.field.set_active(&active);
                self.field.limit = limit;
            }
            r?;
        }
        self.stepper.dense_ready = true;
        Ok(())
    }

    /// Notes a surface that is only touched: the derivatives hold for one side.
    pub(super) fn touch(&mut self, mut contact: Contact) {
        if let Some(a) = &self.algebraic {
            contact.subsystem = a.outer(contact.subsystem);
        }
        self.log.one_sided = true;
        if self.log.contacts.len() < self.options.max_log {
            self.log.contacts.push(contact);
        }
    }

    /// Writes what changed to the log.
    pub(super) fn log(&mut self, before: &[Vec<usize>], rate: f64, cosine: Option<f64>, unique: bool) {
        let start = self.log.switches.len();
        let mut n = 0;
        for (k, set) in before.iter().enumerate() {
            if sets::same_set(set, &self.field.active[k]) {
                continue;
            }
            let goes_on = self.field.has_modes_of(k, set, &self.field.active[k]);
            let was_there = self.field.has_modes_of(k, &self.field.active[k], set);
            if goes_on && was_there {
                continue;
            }
            n += 1;
            if self.log.switches.len() >= self.options.max_log {
                continue;
            }
            let kind = if goes_on {
                Kind::Enter
            } else if was_there {
                if unique {
                    Kind::Leave
                } else {
                    Kind::Spontaneous
                }
            } else {
                Kind::Cross
            };
            self.log.switches.push(Switch {
                t: self.t,
                kind,
                simultaneous: false,
                subsystem: self.algebraic.as_ref().map_or(k, |a| a.outer(k)),
                before: self.field.modes_of(k, set),
                after: self.field.modes(k),
                rate,
                transversality: cosine.unwrap_or(f64::NAN),
                unique,
                dt: self.shown_dt(),
            });
        }
        self.log.stats.switches += n;
        self.log.one_sided |= n > 1;
        for s in &mut self.log.switches[start..] {
            s.simultaneous = n > 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_written_once_and_in_their_order() {
        let mut s = Sampled { times: vec![0.5, 1.0, 1.0, 3.0], known: 0, states: vec![f64::NAN; 8] };
        assert!(!s.are_wanted(0.4) && s.are_wanted(0.5));
        let state = |by: f64| move |t: f64, out: &mut [f64]| out.copy_from_slice(&[t, by]);
        s.write(0.4, 2, state(0.0));
        s.write(1.0, 2, state(1.0));
        assert!(!s.are_wanted(2.9));
        s.write(2.0, 2, state(2.0));
        assert_eq!(s.states[..6], [0.5, 1.0, 1.0, 1.0, 1.0, 1.0]);
        assert!(s.states[6..].iter().all(|v| v.is_nan()));
        s.write(4.0, 2, state(4.0));
        assert_eq!(s.states[6..], [3.0, 4.0]);
        assert!(!s.are_wanted(f64::INFINITY));
    }
}
