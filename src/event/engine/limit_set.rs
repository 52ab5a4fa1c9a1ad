//! From accumulating switches into the set they lead to, the motion in which the right-hand side knows.

use super::accumulation::MEMORY;
use super::{recover, Cut, Engine, Pair, Progress, EPS};
use crate::error::Result;
use crate::event::tape::Time;
use crate::event::watch::Watch;
use crate::event::{Accumulation, Outcome, Zeno};
use crate::func::EvalError;

/// Distance to the limit set relative to the tolerances from which on the solution is in it.
const NEAR: f64 = 0.1;
/// The same where nothing else continues it.
pub(super) const FAILED: f64 = 1e3;
/// Switches in a row between which the time has only become shorter, and by which factor: a solution that comes ever closer
/// without an end is followed no further, and how far it was then is noted.
const MANY: usize = 4096;
const SHORTER: f64 = 8.0;
/// Weights of a motion in a limit set are inside of their bounds by so much.
const INSIDE: f64 = 1e-6;

/// Where the motion comes from that goes on in a limit set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Origin {
    /// It was in none.
    Outside,
    /// It was in one, and is at a surface.
    Inside,
    /// It may have been in one, and rounding has carried it away: nothing but steps would go on, with this error.
    Lost { steps: f64 },
    /// It was in one, and the weight of a cell, one of two of a subsystem that the set does not tie by order two, has vanished.
    Weight { sub: usize, cell: usize },
}

impl Origin {
    fn is_inside(self) -> bool {
        matches!(self, Origin::Inside | Origin::Weight { .. })
    }
}

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
        /// Switches from which on the last two intervals may say that they become shorter, and by which factor at least.
        const FEW: usize = 3;
        const FAST: f64 = 0.25;
        /// A time in units of its rounding.
        const LATE: f64 = 1e3;
        if self.calendar.recent.n < FEW || self.calendar.recent.are_transitions() {
            return Ok(None);
        }
        if self.calendar.recent.n % MEMORY == 0 {
            let sum = self.calendar.recent.gaps.iter().sum();
            self.calendar.shrinking.note(sum);
        }
        // the state moves within the tolerance from one switch to the next
        let gap = self.calendar.recent.last_gap();
        let close = (0..self.nx).all(|i| self.f[i].abs() * gap <= 10.0 * self.tolerance_of(i));
        let endless = self.calendar.shrinking.endless();
        // an unstable set is left by ever longer ways
        let later: f64 = (MEMORY / 2..MEMORY).map(|i| self.calendar.recent.gap(i)).sum();
        let many = self.calendar.recent.n > MEMORY;
        // times between them that are hardly more than rounding say nothing soon
        let late = gap <= LATE * EPS * self.t.abs();
        let shrinks =
            later < 0.5 * self.calendar.recent.gaps.iter().sum::<f64>() && (self.calendar.recent.n % 4 == 0 || late);
        let falls = gap < FAST * self.calendar.recent.gap(MEMORY - 2) && self.calendar.recent.are_crossings_of_one(FEW);
        if !(close && (many && shrinks || falls) || endless && self.calendar.recent.n % MEMORY == 0) {
            return Ok(None);
        }
        let from = self.calendar.recent.before_last(if many { MEMORY } else { FEW });
        if self.options.zeno == Zeno::Stop {
            let text =
                format!("switches come ever closer: the last {MANY} of them have an end within reach or none at all");
            return Ok(endless.then(|| self.fail(Outcome::Zeno, text)));
        }
        self.mark_since(from);
        let most = if endless {
            f64::INFINITY
        } else if late {
            1.0
        } else {
            NEAR
        };
        let p = self.enter_limit_set(most, self.t, Origin::Outside)?;
        self.log.stats.accumulations += usize::from(p.is_some());
        Ok(p)
    }

    /// Next to a limit set rounding, or functions that are not defined on the other side of a surface, may make it look as if
    /// nothing continued the motion: then the set does, from the active set `before`. So it does at another surface where the
    /// motion was in a limit set already.
    pub(super) fn rescue(&mut self, before: &[Vec<usize>], from: Origin) -> Result<Option<Progress>> {
        if self.options.zeno == Zeno::Stop || self.field.has_contacts() {
            return Ok(None);
        }
        let failure = (self.log.outcome, std::mem::take(&mut self.log.reason));
        self.log.outcome = Outcome::Reached;
        self.field.set_active(before);
        let within = from.is_inside();
        let around = if matches!(from, Origin::Lost { .. }) { FAILED } else { 1.0 };
        let near = within || recover(self.mark_near_surfaces(around).map(|()| true), false)?;
        let p = if near { self.enter_limit_set(FAILED, self.t, from)? } else { None };
        match p {
            Some(_) => self.log.stats.accumulations += usize::from(!within),
            None => (self.log.outcome, self.log.reason) = failure,
        }
        Ok(p)
    }

    /// Where a sliding mode has lost its influence on the rate of its surface, it may have come to its end in finite time, as in
    /// `v' = -sqrt |v|`: its steps then go to and fro, and the limit set next to it is where it rests. Looks for that now and then.
    pub(super) fn come_to_rest(&mut self) -> Result<Option<Progress>> {
        /// Steps of one mode from one look to the next, and how far the set may be, in tolerances.
        const LOOK: usize = 64;
        const REST: f64 = 10.0;
        self.stepper.slid += 1;
        if self.stepper.slid % LOOK != 0 || self.field.n_alg() == 0 || self.field.in_limit_set() {
            return Ok(None);
        }
        if self.options.zeno == Zeno::Stop || self.field.has_contacts() {
            return Ok(None);
        }
        let r = self.field.rhs(self.t, &self.x, &mut self.stepper.node);
        let lost = recover(r.and_then(|()| self.field.has_lost_influence(self.t, &self.x)), false)?;
        if !lost || !recover(self.mark_near_surfaces(REST).map(|()| true), false)? {
            return Ok(None);
        }
        let p = self.enter_limit_set(REST, self.t, Origin::Outside)?;
        self.log.stats.accumulations += usize::from(p.is_some());
        Ok(p)
    }

    /// Marks the surfaces that are no farther than so many tolerances, those of the last switches, and those that slide.
    pub(super) fn mark_near_surfaces(&mut self, most: f64) -> std::result::Result<(), EvalError> {
        self.field.watched(self.t, &self.x)?;
        self.field.watched_gradients(self.t, &self.x)?;
        let from = self.calendar.recent.before_last(MEMORY);
        if self.calendar.recent.n > MEMORY && !self.calendar.recent.are_transitions() {
            self.mark_since(from);
        } else {
            self.functions.zero.fill(false);
            self.keep_surfaces();
        }
        for s in &self.field.subs {
            let least = self.field.q[s.q0..s.q0 + s.n_q].iter().fold(f64::INFINITY, |m, q| m.min(*q));
            for j in s.q0..s.q0 + s.n_q {
                let reach = self.reach_of(j);
                let value = self.field.q[j] - if s.signs { 0.0 } else { least };
                self.functions.zero[j] |= value.abs() <= most * reach;
            }
        }
        Ok(())
    }

    pub(super) fn tolerance_of(&self, i: usize) -> f64 {
        (self.atol[i] + self.rtol[i] * self.x[i].abs()).max(4.0 * EPS * self.x[i].abs()).max(f64::MIN_POSITIVE)
    }

    /// What the tolerances of the states make of the value of function `j`, by its gradient at the last point.
    pub(super) fn reach_of(&self, j: usize) -> f64 {
        self.field.gradient_row(j).states().map(|(i, g)| g.abs() * self.tolerance_of(i)).sum()
    }

    /// Goes on in the limit set of the surfaces that are marked as zero, if there is one no farther than `most` tolerances;
    /// `limit` is the time the switches lead to.
    pub(super) fn enter_limit_set(&mut self, most: f64, limit: f64, from: Origin) -> Result<Option<Progress>> {
        /// Times in a row without time between them.
        const TRIES: usize = 4;
        /// How much farther than it may be the set may turn out to be when its mode begins.
        const AGAIN: f64 = 10.0;
        /// Cells of a subsystem that meet: those of five surfaces. Among more of them weights are a matter of choice, and the work
        /// grows with their square.
        const MEET: usize = 32;
        if self.field.is_on_demand() {
            return Ok(None);
        }
        let within = from.is_inside();
        self.set_sizes(1.0);
        let at_once = self.t - self.calendar.limits.0 <= self.no_time();
        let before = self.field.active.clone();
        if !within {
            self.unmark_distant(most);
        }
        let mut sets = self.candidates();
        if at_once && self.calendar.limits.1 > TRIES
            || sets.iter().all(|c| c.len() < 2)
            || sets.iter().any(|c| c.len() > MEET)
        {
            return Ok(None);
        }
        if within {
            self.decide_others(&mut sets)?;
        }
        if let Origin::Weight { sub, cell } = from {
            // the rate of its function under the other cell alone is zero there and has the sign that leads away from then on,
            // as the weight goes on to fall: rates at this point could not tell
            sets[sub] = before[sub].iter().copied().filter(|c| *c != cell).collect();
        }
        let held = self.field.hold();
        let loose = if self.field.in_limit_set() { self.loose_functions(&sets, within) } else { Vec::new() };
        let tied = |sets: &[Vec<usize>]| sets.iter().map(Vec::len).sum::<usize>();
        // the same set again is no way to go on
        let least = if within || !self.field.in_limit_set() { 0 } else { tied(&before) + 1 };
        let present = self.field.limit.take();
        let found = self.find_limit_set(&sets, &loose)?;
        let nearer = |error: f64| matches!(from, Origin::Lost { steps } if error < steps);
        let found = found.filter(|error| *error <= most || nearer(*error) && self.is_lost_by_rounding());
        let Some(error) = found.filter(|_| tied(&self.field.active) >= least) else {
            self.field.release(held);
            self.field.limit = present;
            let r = self
                .field
                .rhs(self.t, &self.x, &mut self.stepper.node)
                .and_then(|()| self.field.watched(self.t, &self.x));
            recover(r.map(|()| true), false)?;
            return Ok(None);
        };
        self.calendar.limits = (self.t, if at_once { self.calendar.limits.1 + 1 } else { 0 });
        if !within {
            self.calendar.recent.forget();
            self.calendar.recent.falling = Default::default();
            self.calendar.shrinking = Shrinking::default();
            let t = self.calendar.recent.limit(limit);
            self.accumulations_push(Accumulation { t, until: self.t, steps: 0, error });
        }
        self.mark_time(Time::Unknown);
        let start = self.x.clone();
        self.x.copy_from_slice(&self.stepper.node);
        (self.stepper.next_pair, self.stepper.cut) = (Pair::Dp5, Cut::default());
        let r = self.enter();
        self.log.one_sided = true;
        self.blur_sensitivity();
        let entered = recover(r.map(|()| true), false)?;
        let moved = |e: &Engine, i: usize| (e.x[i] - start[i]).abs() / e.tolerance_of(i);
        // where conditions are nearly singular a projection may lead anywhere
        if !entered || (0..self.nx).any(|i| moved(self, i) > AGAIN * error.max(most).max(1.0)) {
            self.x.copy_from_slice(&start);
            let text = format!("switches accumulate at t = {limit}, where the motion is not defined");
            let failed = self.fail(Outcome::Zeno, text);
            return Ok(Some(self.go_through(&before, true)?.unwrap_or(failed)));
        }
        self.log(&before, f64::NAN, None, true);
        Ok(Some(Progress::Switched))
    }

    /// Is the point of the limit set in `node` no farther than rounding may carry a motion in it? A surface that is known to the rounding of the
    /// states is known to the root of that in the rate that is zero with it.
    fn is_lost_by_rounding(&self) -> bool {
        /// In units of the root of the rounding of the sizes of states.
        const AROUND: f64 = 64.0;
        let reach = AROUND * EPS.sqrt();
        (0..self.nx).all(|i| (self.stepper.node[i] - self.x[i]).abs() <= reach * self.field.size(i, self.x[i]))
    }

    /// At a switch of functions that the limit set does not tie by order two the motion in it goes on; false where it does not.
    pub(super) fn stay_in_limit_set(&mut self, l: usize, before: &[Vec<usize>]) -> Result<bool> {
        let (sub, mut functions) = match self.functions.watches[l] {
            Watch::Enter { sub, a, .. } => (sub, a..a + 1),
            Watch::Leave { sub, .. } => (sub, self.field.surfaces(sub)),
            _ => return Ok(false),
        };
        let from_watch = self.functions.watches[l];
        let from = match from_watch {
            Watch::Leave { sub, cell } if before[sub].len() == 2 => Origin::Weight { sub, cell },
            _ => Origin::Inside,
        };
        let beside = self.field.subs[sub].signs && !functions.any(|j| self.field.is_of_order_two(j));
        if self.field.in_limit(sub) && !beside || !recover(self.arrive().map(|()| true), false)? {
            return Ok(false);
        }
        self.functions.zero.fill(false);
        if let Watch::Enter { a, b, .. } = self.functions.watches[l] {
            self.functions.zero[a] = true;
            if let Some(b) = b {
                self.functions.zero[b] = true;
            }
        }
        self.keep_surfaces();
        let stays = self.enter_limit_set(FAILED, self.t, from)?.is_some() && self.log.outcome == Outcome::Reached;
        if stays {
            let source = self.source(&from_watch);
            self.remember(source, None);
            let rate = self.functions.watches.get(l).map_or(0.0, |w| w.rate(&self.functions.dq0, &self.field, &self.f));
            if self.field.active == before && rate > 0.0 {
                // next to where switches accumulate the slowest rate may be that of a zero of order one
                self.functions.depart[l] = 1;
            }
        }
        Ok(stays)
    }

    /// A transition that moves nothing by more than the tolerances that a limit set ties leaves the motion in it.
    pub(super) fn stays_in_limit_set_behind_jump(&mut self) -> std::result::Result<bool, EvalError> {
        if !self.field.in_limit_set() || self.options.zeno == Zeno::Stop {
            return Ok(false);
        }
        self.field.watched(self.t, &self.x)?;
        self.field.watched_gradients(self.t, &self.x)?;
        self.functions.zero.fill(false);
        self.keep_surfaces();
        let stays = matches!(self.enter_limit_set(1.0, self.t, Origin::Inside), Ok(Some(_)));
        Ok(stays && self.log.outcome == Outcome::Reached)
    }

    /// What lies so many tolerances away is not tied: its sign decides.
    fn unmark_distant(&mut self, most: f64) {
        let tied = std::mem::take(&mut self.functions.zero);
        self.functions.zero = vec![false; tied.len()];
        self.keep_surfaces();
        for j in (0..self.field.subs.len()).flat_map(|k| self.field.surfaces(k)).filter(|j| tied[*j]) {
            self.functions.zero[j] |= self.field.q[j].abs() <= most * self.reach_of(j);
        }
        for s in self.field.subs.iter().filter(|s| !s.signs) {
            (s.q0..s.q0 + s.n_q).for_each(|j| self.functions.zero[j] = tied[j]);
        }
    }

    /// Marked functions that a limit set may leave: those that are not tied by order two already, and whose subsystems are not
    /// decided.
    fn loose_functions(&self, sets: &[Vec<usize>], within: bool) -> Vec<usize> {
        /// So many at most: their signs are tried.
        const LOOSE: usize = 4;
        let open =
            |k: &usize| sets[*k].len() > 1 && (!within || self.apart.open.contains(k) || self.field.in_limit(*k));
        let functions = (0..self.field.subs.len()).filter(open).flat_map(|k| self.field.surfaces(k));
        functions.filter(|j| self.functions.zero[*j] && !self.field.is_of_order_two(*j)).take(LOOSE).collect()
    }

    /// Makes the motion in the limit set of `sets` the active mode, or, where its conditions contradict each other, that in one
    /// which leaves some of the functions `loose`, in the direction of their rates in it; the point of the set is left in
    /// `node`. Returns its distance.
    ///
    /// Where a surface is tied by order two, the weights that keep the motion on it also decide rates that do not vanish with it, as
    /// in a sliding observer whose estimates are switched on: the problem (6.19) of those functions, with weights that the limit
    /// set decides, is solved by trying its sign patterns.
    fn find_limit_set(&mut self, sets: &[Vec<usize>], loose: &[usize]) -> Result<Option<f64>> {
        self.field.set_active(sets);
        if let Some(error) = recover(self.limit_point(), None)? {
            return Ok(Some(error));
        }
        let patterns = 3usize.pow(loose.len() as u32);
        let digit = |pattern: usize, place: usize| [0.0, 1.0, -1.0][pattern / 3usize.pow(place as u32) % 3];
        let left = |pattern: &usize| (0..loose.len()).filter(|place| digit(*pattern, *place) != 0.0).count();
        let mut order: Vec<usize> = (1..patterns).collect();
        order.sort_by_key(left);
        for pattern in order {
            let signs: Vec<(usize, f64)> = loose.iter().enumerate().map(|(p, j)| (*j, digit(pattern, p))).collect();
            let some = self.field.restrict(sets, &signs);
            if some.iter().any(Vec::is_empty) || some.iter().all(|c| c.len() == 1) {
                continue;
            }
            self.field.set_active(&some);
            let Some(error) = recover(self.limit_point(), None)? else { continue };
            if recover(self.leaves_by(&signs), false)? {
                return Ok(Some(error));
            }
        }
        Ok(None)
    }

    /// Do the functions go where their signs (zero for those that are tied) say, from the point of the limit set in `node`?
    fn leaves_by(&mut self, signs: &[(usize, f64)]) -> std::result::Result<bool, EvalError> {
        /// A rate of at most this part of the size of its terms leaves a doubt about its sign.
        const DOUBT: f64 = 1e-6;
        self.field.watched(self.t, &self.stepper.node)?;
        self.field.watched_gradients(self.t, &self.stepper.node)?;
        let (mut velocity, mut terms) = (vec![0.0; self.nx], vec![0.0; self.nx]);
        self.field.combine(&mut velocity);
        self.field.combine_sizes(&mut terms);
        Ok(signs.iter().filter(|s| s.1 != 0.0).all(|(j, sign)| {
            let g = self.field.gradient_row(*j);
            let reach = self.reach_of(*j);
            let value = sign * self.field.q[*j];
            let rate = sign * (g.t + g.states().map(|(i, g)| g * velocity[i]).sum::<f64>());
            let size = g.t.abs() + g.states().map(|(i, g)| g.abs() * terms[i]).sum::<f64>();
            value > reach || value >= -reach && rate > DOUBT * size
        }))
    }

    /// In a limit set the rates of what it ties are zero: those subsystems that other rates decide cross, or slide by themselves.
    fn decide_others(&mut self, sets: &mut [Vec<usize>]) -> Result<()> {
        let within: Vec<bool> = (0..sets.len()).map(|k| self.field.in_limit(k)).collect();
        let mut apart = std::mem::take(&mut self.apart);
        let decided = self.field.decide_apart((self.t, &self.x), sets, &mut apart);
        if recover(decided.map(|()| true), false)? {
            for (k, set) in sets.iter_mut().enumerate().filter(|(k, _)| !apart.open.contains(k) && !within[*k]) {
                set.clone_from(&apart.sets[k]);
            }
        }
        self.apart = apart;
        Ok(())
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
        self.stepper.node.copy_from_slice(&y);
        Ok((inside && distance.is_finite()).then_some(distance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_that_only_shrink_are_endless_after_many() {
        let mut s = Shrinking::default();
        let windows = MANY / MEMORY;
        (0..windows).for_each(|k| s.note(1.0 - 0.9 * k as f64 / windows as f64));
        assert!(s.endless());
        // a longer one begins anew
        s.note(0.5);
        assert!(!s.endless());
        // not by as much as that
        let mut s = Shrinking::default();
        (0..2 * windows).for_each(|k| s.note(1.0 - 0.5 * k as f64 / windows as f64 / 2.0));
        assert!(!s.endless());
    }
}
