//! Through accumulating switches by steps that need no switches.
//!
//! A step of Euler's method with the velocity at its start and the active set of its end: `θ` solves the conditions
//! (6.19) for the indicators that `x + h ẋ` has to first order, `0 ≤ θ_i ⊥ g_i + h ġ_i(θ) − μ_k ≥ 0`. It is consistent
//! of order 1, holds sliding modes exactly, and does not chatter. The number of steps is doubled until the end point
//! changes by less than the tolerance.
//!
//! Where these conditions have no solution, or functions have no gradients, Euler's polygon with the mode of the present point is
//! left: it needs nothing but velocities, and what its polygons tend to are solutions of the differential inclusion
//! (A. F. Filippov, *Differential Equations with Discontinuous Righthand Sides* (1988), section 7, theorem 1).

use super::limit_set::{Origin, FAILED};
use super::{recover, Engine, Progress, EPS};
use crate::dcs::filippov::implicit_step;
use crate::error::Result;
use crate::event::tape::Time;
use crate::event::{step, Accumulation, Outcome, Zeno};
use crate::func::EvalError;
use crate::stop;

/// Steps of the first pass, and of the last one.
const STEPS: (usize, usize) = (8, 2048);
/// The same for polygons, whose steps cost one velocity each.
const POLYGON: (usize, usize) = (64, 16384);
/// Factor of the length where one passage is not enough.
const GROWTH: f64 = 8.0;

/// Work of the passages of a whole run in steps, and how much of it may be done ahead of time; sides of a polygon that are as much
/// work as one step, and what a passage costs beside its steps.
const WORK: f64 = 16384.0;
const AHEAD: f64 = 4096.0;
const SIDES: f64 = 8.0;
const PASSAGE: f64 = 128.0;

impl Engine {
    /// Goes from the present point to a time behind `t_limit`, the estimated point of accumulation.
    pub(super) fn step_through(&mut self, t_limit: f64) -> Result<Progress> {
        self.set_sizes(1.0);
        let (t0, end) = (self.t, self.t_stop);
        let least = (2.0 * (t_limit - t0)).max(1e3 * EPS * t0.abs()).max(f64::MIN_POSITIVE).max(self.length_on_time());
        // where the last passage was not long enough this one is longer, so there are few of them
        let (from, until) = self.calendar.passage;
        let follows = t0 - until <= GROWTH * (until - from);
        let longer = if follows { GROWTH * (until - from) } else { 0.0 };
        self.calendar.passages = if follows { self.calendar.passages + 1 } else { 0 };
        // a solution that chatters on and on is followed all the same: less accurately, which is noted
        let allowed = 4f64.powi(self.calendar.passages);
        let (least, mut span) = (least.min(end - t0), least.max(longer).min(end - t0));
        let x0 = self.x.clone();
        let before = self.field.active.clone();
        self.set_march_weights();
        let (wanted, mut polygon) = (span, false);
        let (steps, error, x) = loop {
            let patient = span > least;
            let passed = self.refine((span, allowed, patient), &x0, &before, polygon)?;
            match passed {
                // shorter where that helps
                Some((_, error, _)) if error > allowed && span > least => span = (span / GROWTH).max(least),
                None if span > least => span = (span / GROWTH).max(least),
                Some(p) => break p,
                None if !polygon => (span, polygon) = (wanted, true),
                None => {
                    self.field.set_active(&before);
                    let text = format!("switches accumulate at t = {t_limit}, and no step leads beyond");
                    return Ok(self.fail(Outcome::Zeno, text));
                }
            }
        };
        self.field.set_active(&before);
        if error > FAILED {
            if let Some(p) = self.rescue(&before, Origin::Lost { steps: error })? {
                self.stepper.h = self.no_time();
                return Ok(p);
            }
        }
        let t1 = if span >= end - t0 { end } else { t0 + span };
        self.calendar.passage = (t_limit.max(t0), t1);
        let t = self.calendar.recent.limit(t_limit);
        self.accumulations_push(Accumulation { t, until: t1, steps, error });
        self.straight_line(t1, &x);
        self.log.stats.steps += steps;
        self.calendar.behind = true;
        self.log.one_sided = true;
        self.mark_time(Time::Unknown);
        self.blur_sensitivity();
        self.t = t1;
        self.x.copy_from_slice(&x);
        self.calendar.recent.forget();
        self.calendar.recent.last = t1;
        self.calendar.recent.falling = Default::default();
        self.restart = true;
        Ok(Progress::Switched)
    }

    /// Length of a passage behind which the work of all of them is no more than the share of the run that is done: what makes them
    /// necessary again and again, or goes on and on, is gone through in time by fewer of them, with the error that they state.
    fn length_on_time(&self) -> f64 {
        let whole = self.t_stop - self.t_start;
        (self.calendar.passage_work - AHEAD) / WORK * whole - (self.t - self.t_start)
    }

    /// Counts work that a passage would have saved; is there time for more of it?
    pub(super) fn is_on_time(&mut self, steps: usize) -> bool {
        let on_time = self.length_on_time() <= 0.0;
        self.calendar.passage_work += steps as f64;
        on_time
    }

    /// Twice as many steps until that changes nothing any more: their number, the change relative to the tolerance,
    /// the end.
    #[allow(clippy::type_complexity)]
    fn refine(
        &mut self,
        (span, allowed, may_be_shorter): (f64, f64, bool),
        x0: &[f64],
        sets: &[Vec<usize>],
        polygon: bool,
    ) -> Result<Option<(usize, f64, Vec<f64>)>> {
        let (mut n, most) = if polygon { POLYGON } else { STEPS };
        let enough = 8 * n;
        let (mut coarse, mut before): (Option<Vec<f64>>, f64) = (None, 0.0);
        self.calendar.passage_work += PASSAGE;
        loop {
            stop::check()?;
            self.calendar.passage_work += n as f64 / if polygon { SIDES } else { 1.0 };
            let r = if polygon { self.polygon(span, n, x0) } else { self.march(span, n, x0, sets) };
            let Some(x) = recover(r, None)? else { return Ok(None) };
            if let Some(c) = &coarse {
                let change: Vec<f64> = x.iter().zip(c).map(|(a, b)| a - b).collect();
                let error = step::norm(&change, &self.stepper.weights);
                // errors of order one: more steps than are allowed would be necessary
                let hopeless = may_be_shorter && n >= enough && error * n as f64 > 2.0 * allowed * most as f64;
                if error <= allowed || n >= most || hopeless {
                    // how much more halving the steps moves the end than the state is large and may have gone: where that is much, or
                    // halving them before has moved it less, they grow without bound
                    let far = |i: usize| change[i].abs() / (self.field.size(i, x0[i]) + span * self.f[i].abs());
                    let far = (0..self.nx).map(far).fold(0.0f64, f64::max);
                    let grows = error > allowed && (far > 1.0 && error >= before || far > EPS.sqrt().recip());
                    return Ok((!grows).then_some((n, error, x)));
                }
                before = error;
            }
            coarse = Some(x);
            n *= 2;
        }
    }

    /// `n` steps from `x0`; none where a step has no solution.
    fn march(
        &mut self,
        span: f64,
        n: usize,
        x0: &[f64],
        sets: &[Vec<usize>],
    ) -> std::result::Result<Option<Vec<f64>>, EvalError> {
        self.field.set_active(sets);
        let (t0, h) = (self.t, span / n as f64);
        let mut x = x0.to_vec();
        let mut v = self.f.clone();
        for i in 0..n {
            let t = t0 + i as f64 * h;
            self.field.indicators(t, &x)?;
            self.field.gradients(t, &x)?;
            self.mark_near(h, &x, &v);
            let candidates = self.candidates();
            let Some(s) = implicit_step(&mut self.field, t, &x, &candidates, h)? else { return Ok(None) };
            x.iter_mut().zip(&s.velocity).for_each(|(x, v)| *x += h * v);
            self.field.set_active(&s.sets);
            v = s.velocity;
        }
        Ok(x.iter().all(|v| v.is_finite()).then_some(x))
    }

    /// Euler's polygon of `n` sides from `x0`: each has the velocity of the mode that its start lies in. None where a velocity is
    /// not defined.
    fn polygon(&mut self, span: f64, n: usize, x0: &[f64]) -> std::result::Result<Option<Vec<f64>>, EvalError> {
        let (t0, h) = (self.t, span / n as f64);
        let mut x = x0.to_vec();
        let mut sets: Vec<Vec<usize>> = vec![vec![usize::MAX]; self.field.subs.len()];
        for i in 0..n {
            let t = t0 + i as f64 * h;
            self.field.watched(t, &x)?;
            let mut same = true;
            for (k, set) in sets.iter_mut().enumerate() {
                let cell = self.cell_at(k);
                same &= set[0] == cell;
                set[0] = cell;
            }
            if !same {
                self.field.set_active(&sets);
            }
            self.field.rhs(t, &x, &mut self.stepper.node)?;
            x.iter_mut().zip(&self.stepper.node).for_each(|(x, v)| *x += h * v);
        }
        Ok(x.iter().all(|v| v.is_finite()).then_some(x))
    }

    /// The cell of subsystem `k` where the indicators were evaluated last.
    fn cell_at(&self, k: usize) -> usize {
        let s = &self.field.subs[k];
        if s.signs {
            return s.first + self.region(k);
        }
        let q = &self.field.q[s.q0..s.q0 + s.n_q];
        s.first + (0..s.n_q).min_by(|a, b| q[*a].total_cmp(&q[*b])).unwrap_or(0)
    }

    /// Goes on by steps where no active set continues the motion, which the run would end with otherwise: only next to surfaces,
    /// and only where velocities are defined there; `at_switch` says that the state has come to one. The failure stays where that leads nowhere.
    pub(super) fn go_through(&mut self, before: &[Vec<usize>], at_switch: bool) -> Result<Option<Progress>> {
        let elsewhere = self.field.has_contacts() || self.field.is_on_demand();
        if self.options.zeno == Zeno::Stop || elsewhere || before.iter().any(Vec::is_empty) {
            return Ok(None);
        }
        let failure = (self.log.outcome, std::mem::take(&mut self.log.reason));
        self.log.outcome = Outcome::Reached;
        self.field.set_active(before);
        // gradients may have no value there, and where a switch was made the state is at its surface
        let near = recover(self.mark_near_surfaces(1.0).map(|()| true), false)?;
        let meet = at_switch || near && self.candidates().iter().any(|c| c.len() > 1);
        if meet {
            let limit = self.t;
            let p = self.step_through(limit)?;
            if self.log.outcome == Outcome::Reached {
                self.log.stats.accumulations += 1;
                return Ok(Some(p));
            }
        }
        (self.log.outcome, self.log.reason) = failure;
        self.field.set_active(before);
        Ok(None)
    }

    /// Marks the indicators a step may bring to zero.
    fn mark_near(&mut self, h: f64, x: &[f64], v: &[f64]) {
        const MARGIN: f64 = 10.0;
        // the velocity may turn: every state may move by the share of its size that the fastest moves by
        let pace = self.field.pace(x, v);
        self.functions.zero.fill(false);
        self.keep_surfaces();
        for s in &self.field.subs {
            let least = self.field.q[s.q0..s.q0 + s.n_q].iter().fold(f64::INFINITY, |m, q| m.min(*q));
            for j in s.q0..s.q0 + s.n_q {
                let g = self.field.gradient_row(j);
                let reach = self.field.sum_of_sizes(g.states(), x);
                let value = self.field.q[j] - if s.signs { 0.0 } else { least };
                self.functions.zero[j] |= value.abs() <= MARGIN * h * (reach * pace + g.t.abs());
            }
        }
    }

    fn set_march_weights(&mut self) {
        for (i, w) in self.stepper.weights.iter_mut().enumerate() {
            *w = 1.0 / (self.atol[i] + self.rtol[i] * self.x[i].abs()).max(f64::MIN_POSITIVE);
        }
    }

    /// The dense output of the passage.
    fn straight_line(&mut self, t1: f64, x1: &[f64]) {
        let s = &mut self.stepper.step;
        (s.t, s.h) = (self.t, t1 - self.t);
        for (i, p) in s.poly.iter_mut().enumerate() {
            *p = [0.0; 8];
            (p[0], p[1]) = (self.x[i], x1[i] - self.x[i]);
        }
        self.stepper.dense_ready = true;
        self.note_piece(t1);
    }
}
