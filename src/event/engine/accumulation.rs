//! Accumulating switches.

use super::limit_set::FAILED;
use super::{recover, Engine, Progress, EPS};
use crate::error::Result;
use crate::event::tape::Time;
use crate::event::{Accumulation, Outcome, Zeno};

/// Intervals between switches that are remembered.
pub(super) const MEMORY: usize = 8;

/// Where switches were lately.
pub(super) struct Recent {
    pub(super) gaps: [f64; MEMORY],
    pub(super) n: usize,
    pub(super) last: f64,
    /// Indicators that vanished, `MEMORY × n_q`.
    pub(super) zero: Vec<bool>,
    /// Nothing slid behind them.
    pub(super) free: [bool; MEMORY],
    /// There were transitions among them.
    pub(super) jumps: bool,
}

impl Recent {
    /// Time between two switches, the `i`-th of those that are remembered.
    pub(super) fn gap(&self, i: usize) -> f64 {
        self.gaps[(self.n + i) % MEMORY]
    }

    /// Time between the last two switches or jumps.
    pub(super) fn last_gap(&self) -> f64 {
        self.gaps[(self.n + MEMORY - 1) % MEMORY]
    }
}

impl Engine {
    /// Notes the time of a switch and what vanished there.
    pub(super) fn remember(&mut self) {
        let i = self.recent.n % MEMORY;
        self.recent.gaps[i] = self.t - self.recent.last;
        self.recent.last = self.t;
        let n = self.zero.len();
        self.recent.zero[i * n..(i + 1) * n].copy_from_slice(&self.zero);
        self.recent.free[i] = self.field.n_alg() == 0;
        self.recent.n += 1;
    }

    /// Ends the run where transitions accumulate.
    pub(super) fn end_at_accumulation(&mut self, limit: f64) -> Progress {
        self.accumulations_push(Accumulation { t: limit, until: self.t, steps: 0, error: 0.0 });
        let text =
            format!("transitions accumulate at t = {limit}: what comes behind needs a discrete state of its own");
        self.fail(Outcome::Zeno, text)
    }

    pub(super) fn accumulations_push(&mut self, a: Accumulation) {
        if self.accumulations.len() < self.options.max_log {
            self.accumulations.push(a);
        }
    }

    /// Marks what vanished at the last switches, and what the present sliding modes tie.
    pub(super) fn mark_recent(&mut self) {
        self.mark_last(MEMORY);
    }

    /// The same for so many of them.
    pub(super) fn mark_last(&mut self, switches: usize) {
        let n = self.zero.len();
        self.zero.fill(false);
        for back in 1..=switches {
            let m = (self.recent.n + MEMORY - back) % MEMORY;
            for j in 0..n {
                self.zero[j] |= self.recent.zero[m * n + j];
            }
        }
        self.keep_surfaces();
    }

    /// Does the present mode slide on all surfaces that the last switches were at? The last of them began it, where the
    /// surfaces could not be told apart any more.
    fn is_past_accumulation(&mut self) -> bool {
        self.mark_recent();
        let all = self.zero.clone();
        self.zero.fill(false);
        self.keep_surfaces();
        self.zero == all
    }

    /// Do switches accumulate here? Then the policy decides.
    pub(super) fn accumulate(&mut self) -> Result<Option<Progress>> {
        if !self.recent.jumps {
            if let Some(p) = self.approach_limit_set()? {
                return Ok(Some(p));
            }
        }
        if self.recent.n <= MEMORY {
            return Ok(None);
        }
        let half = MEMORY / 2;
        let gap = |i: usize| self.recent.gap(i);
        let (old, new) = ((0..half).map(gap).sum::<f64>(), (half..MEMORY).map(gap).sum::<f64>());
        let ratio = new / old;
        let stuck = old + new <= 64.0 * EPS * self.t.abs();
        if !(ratio < 0.95 || stuck) {
            return Ok(None);
        }
        let left = if stuck { 0.0 } else { new * ratio / (1.0 - ratio) };
        for i in 0..self.nx {
            let tol = self.atol[i] + self.rtol[i] * self.x[i].abs();
            if self.f[i].abs() * left > 1e-2 * tol.max(4.0 * EPS * self.x[i].abs()) && !stuck {
                return Ok(None);
            }
        }
        let loosest = self.rtol.iter().fold(1e-14f64, |m, v| m.max(*v));
        if left > 1e-2 * loosest * self.t.abs() && !stuck {
            return Ok(None);
        }
        self.stats.accumulations += 1;
        self.recent.n = 0;
        let jumps = std::mem::take(&mut self.recent.jumps);
        let limit = self.t + left;
        if jumps {
            return Ok(Some(self.end_at_accumulation(limit)));
        }
        let text = format!("switches accumulate at t = {limit}");
        if self.options.zeno != Zeno::Stop {
            if self.is_past_accumulation() {
                self.accumulations_push(Accumulation { t: limit, until: self.t, steps: 0, error: 0.0 });
                return Ok(None);
            }
            self.mark_recent();
            if let Some(p) = self.enter_limit_set(FAILED, limit, false)? {
                return Ok(Some(p));
            }
        }
        if self.options.zeno == Zeno::TimeStepping {
            return self.step_through(limit).map(Some);
        }
        self.accumulations_push(Accumulation { t: limit, until: self.t, steps: 0, error: 0.0 });
        if self.options.zeno == Zeno::Stop {
            return Ok(Some(self.fail(Outcome::Zeno, text)));
        }
        let before = self.field.active.clone();
        self.mark_recent();
        let kept = self.kept_modes();
        let formed = self.form_modes(&kept);
        if !recover(formed, false)? {
            return Ok(Some(self.fail(Outcome::Zeno, text)));
        }
        let candidates = self.candidates();
        let r = self.choose(&candidates, self.h.max(1e3 * EPS * self.t.abs()));
        let unique = recover(r, false)?;
        if self.outcome != Outcome::Reached {
            return Ok(Some(Progress::Done));
        }
        let tied: usize = self.field.active.iter().map(Vec::len).sum();
        if tied <= before.iter().map(Vec::len).sum() {
            let failed = self.fail(Outcome::Zeno, text + ", and no sliding mode begins there");
            return Ok(Some(self.go_through(&before, true)?.unwrap_or(failed)));
        }
        self.mark_time(Time::Unknown);
        let r = self.enter().and_then(|()| self.project_sensitivity());
        self.one_sided = true;
        if !recover(r.map(|()| true), false)? {
            let failed = self.fail(Outcome::Zeno, text + ", where the sliding mode is not defined");
            return Ok(Some(self.go_through(&before, true)?.unwrap_or(failed)));
        }
        self.log(&before, f64::NAN, None, unique);
        Ok(Some(Progress::Switched))
    }
}
