//! From accumulating switches into the set they lead to, see [`field::limit`](crate::event::field).

use super::accumulation::MEMORY;
use super::{recover, Engine, Pair, Progress, EPS};
use crate::error::Result;
use crate::event::tape::Time;
use crate::event::Accumulation;
use crate::func::EvalError;

/// Distance to the limit set relative to the tolerances from which on the solution is in it.
const NEAR: f64 = 0.1;
/// Switches in a row between which the time has only become shorter, and by which factor: a solution that comes ever closer
/// without an end is followed no further, and how far it was then is noted.
const MANY: usize = 4096;
const SHORTER: f64 = 8.0;
/// Weights of a motion in a limit set are inside of their bounds by so much.
const INSIDE: f64 = 1e-6;

/// How long the time between switches has been becoming shorter.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shrinking {
    switches: usize,
    first: f64,
    last: f64,
}

impl Shrinking {
    /// Eight more switches have taken the time `sum`.
    fn note(&mut self, sum: f64) {
        if self.switches == 0 || sum > self.last {
            *self = Shrinking { switches: 0, first: sum, last: sum };
        }
        self.switches += MEMORY;
        self.last = sum;
    }

    fn endless(&self) -> bool {
        self.switches >= MANY && self.first >= SHORTER * self.last
    }
}

impl Engine {
    /// Is the solution in the limit set of the last switches, or will it come there through more of them than anyone wants?
    /// Then it goes on in it.
    pub(super) fn approach_limit_set(&mut self) -> Result<Option<Progress>> {
        if self.recent.n % MEMORY == 0 {
            let sum = self.recent.gaps.iter().sum();
            self.shrinking.note(sum);
        }
        // the state moves within the tolerance from one switch to the next
        let gap = self.recent.last_gap();
        let close = (0..self.nx).all(|i| self.f[i].abs() * gap <= 10.0 * self.tolerance_of(i));
        let endless = self.shrinking.endless();
        if !(close && self.recent.n % 4 == 0 || endless && self.recent.n % MEMORY == 0) {
            return Ok(None);
        }
        self.enter_limit_set(if endless { f64::INFINITY } else { NEAR }, self.t)
    }

    fn tolerance_of(&self, i: usize) -> f64 {
        (self.atol[i] + self.rtol[i] * self.x[i].abs()).max(4.0 * EPS * self.x[i].abs()).max(f64::MIN_POSITIVE)
    }

    /// Goes on in the limit set of the last switches, if there is one no farther than `most` tolerances; `limit` is the time
    /// the switches lead to.
    pub(super) fn enter_limit_set(&mut self, most: f64, limit: f64) -> Result<Option<Progress>> {
        let before = self.field.active.clone();
        self.mark_recent();
        let candidates = self.candidates();
        let tied = |sets: &[Vec<usize>]| sets.iter().map(Vec::len).sum::<usize>();
        if tied(&candidates) <= tied(&before) && self.field.in_limit_set() {
            return Ok(None);
        }
        let held = self.field.hold();
        self.field.set_active(&candidates);
        let found = recover(self.limit_point(), None)?.filter(|error| *error <= most);
        let Some(error) = found else {
            self.field.release(held);
            let r = self.field.rhs(self.t, &self.x, &mut self.node).and_then(|()| self.field.watched(self.t, &self.x));
            recover(r.map(|()| true), false)?;
            return Ok(None);
        };
        self.stats.accumulations += 1;
        self.recent.n = 0;
        self.shrinking = Shrinking::default();
        self.accumulations_push(Accumulation { t: limit, until: self.t, steps: 0, error });
        self.mark_time(Time::Unknown);
        self.x.copy_from_slice(&self.node);
        (self.next_pair, self.cut) = (Pair::Dp5, 0);
        let r = self.enter();
        self.one_sided = true;
        self.blur_sensitivity();
        if !recover(r.map(|()| true), false)? {
            let text = format!("switches accumulate at t = {limit}, where the motion is not defined");
            return Ok(Some(self.fail(crate::event::Outcome::Zeno, text)));
        }
        self.log(&before, f64::NAN, None, true);
        Ok(Some(Progress::Switched))
    }

    /// Finds the point of the limit set next to the state, which is left in `node`; its distance relative to the tolerances,
    /// or none where there is no such set.
    fn limit_point(&mut self) -> std::result::Result<Option<f64>, EvalError> {
        let t = self.t;
        self.field.scale_constraints(t, &self.x)?;
        if !self.field.begin_limit_set(t, &self.x)? {
            return Ok(None);
        }
        let mut y = self.x.clone();
        self.field.project(t, &mut y)?;
        self.field.hidden(t, &y)?;
        let inside = (0..self.field.subs.len())
            .filter(|k| self.field.active[*k].len() > 1)
            .all(|k| self.field.active[k].iter().all(|c| self.field.theta(*c) >= INSIDE));
        let distance = (0..self.nx).fold(0.0f64, |m, i| m.max((y[i] - self.x[i]).abs() / self.tolerance_of(i)));
        self.node.copy_from_slice(&y);
        Ok((inside && distance.is_finite()).then_some(distance))
    }
}
