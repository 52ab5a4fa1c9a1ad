//! What a run leaves: dense output and the log of switches.

use super::{recover, Engine, EPS};
use crate::error::{Error, Result};
use crate::event::explicit;
use crate::event::path;
use crate::event::sets;
use crate::event::{Contact, Kind, Switch};
use crate::func::EvalError;

impl Engine {
    /// `k`-th derivative of the dense output at a time in the last step.
    pub fn get_dky(&mut self, t: f64, k: usize, out: &mut [f64]) -> Result<()> {
        if out.len() != self.nx {
            return Err(Error::Dimension(format!("room for {} values, a state has {}", out.len(), self.nx)));
        }
        if self.step.h == 0.0 {
            return Err(Error::State("there is no dense output before the first step".into()));
        }
        let slack = 8.0 * EPS * self.t.abs();
        if !(t >= self.step.t - slack && t <= self.t + slack) {
            let (a, b) = (self.step.t, self.t);
            return Err(Error::Range(format!("time {t} is outside of the last step, {a} to {b}")));
        }
        self.save_dense()?;
        path::eval(&self.step.poly, (t - self.step.t) / self.step.h, self.step.h, k, out);
        Ok(())
    }

    pub(super) fn save_dense(&mut self) -> Result<()> {
        if self.step.h == 0.0 {
            return Ok(());
        }
        let r = self.write_dense();
        recover(r.map(|()| true), false)?;
        Ok(())
    }

    /// Dense output of the last step, evaluated under the active set it had.
    pub(super) fn write_dense(&mut self) -> std::result::Result<(), EvalError> {
        if self.dense_ready {
            return Ok(());
        }
        if self.step_implicit {
            self.radau.dense(&mut self.step, self.fresh);
        } else {
            let foreign = !sets::same(&self.step_sets, &self.field.active);
            let present = foreign.then(|| (self.field.active.clone(), self.field.limit.take()));
            if foreign {
                self.field.set_active(&self.step_sets);
            }
            let r = explicit::dense(self.pair, &mut self.field, &mut self.step);
            if let Some((active, limit)) = present {
                self.field.set_active(&active);
                self.field.limit = limit;
            }
            r?;
        }
        self.dense_ready = true;
        Ok(())
    }

    /// Notes a surface that is only touched: the derivatives hold for one side.
    pub(super) fn touch(&mut self, contact: Contact) {
        self.one_sided = true;
        if self.contacts.len() < self.options.max_log {
            self.contacts.push(contact);
        }
    }

    /// Writes what changed to the log.
    pub(super) fn log(&mut self, before: &[Vec<usize>], rate: f64, cosine: Option<f64>, unique: bool) {
        let start = self.switches.len();
        let mut n = 0;
        for (k, set) in before.iter().enumerate() {
            if sets::same_set(set, &self.field.active[k]) {
                continue;
            }
            let (a, b) = (self.field.modes_of(k, set), self.field.modes(k));
            if a == b {
                continue;
            }
            n += 1;
            if self.switches.len() >= self.options.max_log {
                continue;
            }
            let kind = if a.iter().all(|m| b.contains(m)) {
                Kind::Enter
            } else if b.iter().all(|m| a.contains(m)) {
                if unique {
                    Kind::Leave
                } else {
                    Kind::Spontaneous
                }
            } else {
                Kind::Cross
            };
            self.switches.push(Switch {
                t: self.t,
                kind,
                simultaneous: false,
                subsystem: k,
                before: a,
                after: b,
                rate,
                transversality: cosine.unwrap_or(f64::NAN),
                unique,
                dt: self.sens.as_ref().map_or_else(Vec::new, |s| s.dt.clone()),
            });
        }
        self.stats.switches += n;
        self.one_sided |= n > 1;
        for s in &mut self.switches[start..] {
            s.simultaneous = n > 1;
        }
    }
}
