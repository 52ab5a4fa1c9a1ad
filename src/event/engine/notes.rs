//! Events that change nothing: where the condition of a note becomes true, time and state are written down. No step ends for that.
//!
//! A step that is accepted is looked through on its dense output, which is interpolated where a function bends, on shorter and shorter parts
//! until the interpolation is good. The state at an event is then that of a step from the start of the accepted one which ends there, by the
//! same pair, so it is as accurate as one at which a step does end; an implicit step is not repeated, and its dense output counts.

use super::algebraic::Follower;
use super::{recover, Engine, EPS};
use crate::error::Result;
use crate::event::bernstein::{self, First, Sampler, NODES};
use crate::event::calendar::UnitEvents;
use crate::event::explicit;
use crate::event::field::gradient_map;
use crate::event::step::{derivative, horner, Step};
use crate::event::Noted;
use crate::func::{Dims, EvalError, EvalResult, Point};
use crate::system::{Effect, System, Transition};

/// What interpolations may be off by between their nodes, relative to the largest value there.
const FRACTION: f64 = 0.01;
/// How often a part of a step is halved where they are off by more.
const HALVINGS: usize = 8;
/// A zero is as close to the end of a step as rounding, times this, makes it.
const MARGIN: f64 = 8.0;
/// A part of a step is not halved where a function is so small there, relative to its largest value.
const SMALL: f64 = 1e-9;
/// Zeros of one function in one step at most: more are rounding.
const ZEROS: usize = 64;
/// A zero at the end of a step moves by no more than this part of it when the step is repeated.
const NEAR: f64 = 0.01;

/// A transition that notes, and what is known of its condition.
struct Note {
    number: usize,
    transition: Transition,
    /// Function and input of every entry of the Jacobian.
    entries: Vec<(usize, usize)>,
    /// States that its condition depends on, with the discrete ones that it asks for.
    inputs: Vec<usize>,
    /// Was the condition true at the end of the last step? None: it is not watched yet.
    held: Option<bool>,
    /// Which of its functions are beyond zero.
    beyond: Vec<bool>,
    v: [Vec<f64>; 2],
}

/// All of them, with memory.
pub(super) struct Notes {
    all: Vec<Note>,
    side: Step,
    /// Entries of the last Jacobian.
    jac: Vec<f64>,
    work: Vec<f64>,
    x: Vec<f64>,
    f: Vec<f64>,
    n_z: usize,
    /// Zeros in the present step: relative time, function, and whether it rises.
    zeros: Vec<(f64, usize, bool)>,
}

/// A function that is zero to rounding at the end of a step: does it rise, and in which part of the step before is it rounding?
#[derive(Debug, Clone, Copy)]
struct End {
    rises: bool,
    part: f64,
}

/// A time in a step in which nothing that a note depends on goes its own way; with the events of single units in the step, if there are any.
#[derive(Clone, Copy)]
struct Window<'a> {
    from: f64,
    to: f64,
    units: Option<&'a UnitEvents>,
}

/// A function along a window: relative time to its value.
pub(super) type Along<'a> = dyn FnMut(f64) -> std::result::Result<f64, EvalError> + 'a;

impl Notes {
    /// Those of a system; none where it has none.
    pub(super) fn new(system: &System) -> Option<Box<Notes>> {
        let dims: Dims = system.dims();
        let noted = system.transitions().iter().enumerate().filter(|t| t.1.rule.effect == Effect::Note);
        let note = |(number, t): (usize, &Transition)| {
            let n = t.guard.n_out();
            let rows: Vec<usize> = (0..n).collect();
            let n_z = dims.x + dims.p + dims.u + 1;
            let map = gradient_map(&t.guard, &rows, &dims);
            let entries: Vec<(usize, usize)> = map.into_iter().map(|place| (place / n_z, place % n_z)).collect();
            let states = entries.iter().map(|e| e.1).filter(|i| *i < dims.x);
            let mut inputs: Vec<usize> = states.chain(t.from.iter().map(|f| f.0)).collect();
            inputs.sort_unstable();
            inputs.dedup();
            Note {
                number,
                entries,
                inputs,
                held: None,
                beyond: vec![false; n],
                v: [vec![0.0; n], vec![0.0; n]],
                transition: t.clone(),
            }
        };
        let all: Vec<Note> = noted.map(note).collect();
        if all.is_empty() {
            return None;
        }
        let n_z = dims.x + dims.p + dims.u + 1;
        let most = |f: &dyn Fn(&Note) -> usize| all.iter().map(f).max().unwrap_or(0);
        Some(Box::new(Notes {
            side: Step::new(dims.x),
            jac: vec![0.0; most(&|n| n.entries.len())],
            work: vec![0.0; most(&|n| n.transition.guard.work_len())],
            x: vec![0.0; dims.x],
            f: vec![0.0; dims.x],
            n_z,
            zeros: Vec::new(),
            all,
        }))
    }

    /// Another run begins.
    pub(super) fn reset(&mut self) {
        self.all.iter_mut().for_each(|n| n.held = None);
    }
}

impl Note {
    fn toward(&self) -> f64 {
        self.transition.direction.sign()
    }

    fn is_true(&self) -> bool {
        match &self.transition.clauses[..] {
            [] => self.beyond[0],
            all => all.iter().any(|c| c.iter().all(|l| self.beyond[*l])),
        }
    }

    /// Values of its functions, positive where they are beyond zero.
    fn values(&mut self, end: usize, at: &Point, work: &mut [f64]) -> EvalResult {
        self.transition.guard.value(at, &mut self.v[end], work)?;
        let toward = self.toward();
        self.v[end].iter_mut().for_each(|v| *v *= toward);
        Ok(())
    }
}

impl Engine {
    /// Looks through the step that is accepted and ends at `t1`. The state is still that at its start.
    pub(super) fn note_events(&mut self, t1: f64) -> Result<()> {
        // what has been evaluated at the end of the step is needed there
        let (alpha, q, dq) = (self.field.alpha.clone(), self.field.q.clone(), self.field.dq.clone());
        let r = self.save_dense();
        let r = r.and_then(|()| self.note_within(t1, None));
        (self.field.alpha, self.field.q, self.field.dq) = (alpha, q, dq);
        r
    }

    /// The same where single units have switched in the step, whose dense output is known.
    pub(super) fn note_within(&mut self, t1: f64, units: Option<&UnitEvents>) -> Result<()> {
        let Some(mut notes) = self.notes.take() else { return Ok(()) };
        let logged = self.log.notes.len();
        if let Some(a) = &self.algebraic {
            // no guard depends on them, and all begin with them
            for i in a.states().chain(a.n_states()..self.nx) {
                notes.x[i] = self.x[i];
            }
        }
        let (mut r, mut times) = (Ok(()), Vec::new());
        for k in 0..notes.all.len() {
            times.clear();
            times.extend([self.t, t1]);
            if let Some(c) = units {
                notes.all[k].inputs.iter().for_each(|i| c.tracks.breaks(*i, self.t, &mut times));
                times.retain(|t| *t <= t1);
                times.sort_unstable_by(f64::total_cmp);
                times.dedup();
            }
            for w in times.windows(2) {
                let w = Window { from: w[0], to: w[1], units };
                if r.is_ok() {
                    let looked = self.look_through(&mut notes, k, w);
                    r = recover(looked.map(|()| true), false).map(|_| ());
                }
            }
        }
        self.notes = Some(notes);
        // each transition has been looked at for itself
        self.log.notes[logged..].sort_by(|a, b| a.t.total_cmp(&b.t));
        r
    }

    /// A run begins: what is true before anything happens is not noted, and what a jump at this time makes true is.
    pub(super) fn note_start(&mut self) -> Result<()> {
        let Some(mut notes) = self.notes.take() else { return Ok(()) };
        let mut r = Ok(());
        for k in 0..notes.all.len() {
            notes.x.copy_from_slice(&self.x);
            notes.f.copy_from_slice(&self.f);
            if r.is_ok() && notes.all[k].held.is_none() && is_watched(&notes, k) {
                let known = self.look_at_start(&mut notes, k, self.t);
                r = recover(known.map(|()| true), false).map(|known| {
                    notes.all[k].held = known.then(|| notes.all[k].is_true());
                });
            }
        }
        self.notes = Some(notes);
        r
    }

    /// Writes what note `k` depends on, and its velocity, at a time in a window.
    fn move_note(&self, notes: &mut Notes, k: usize, w: &Window, t: f64) {
        let s = &self.stepper.step;
        let Notes { all, x, f, .. } = notes;
        for &i in &all[k].inputs {
            (x[i], f[i]) = match w.units {
                Some(c) => c.tracks.follow(s, i, w.from, t),
                None if t == w.from => (self.x[i], self.f[i]),
                None if t == w.to => (s.x1[i], s.f1[i]),
                None => {
                    let along = (t - s.t) / s.h;
                    (horner(&s.poly[i], along), derivative(&s.poly[i], 1, along) / s.h)
                }
            };
        }
    }

    /// Finds out which functions of a note are beyond zero at the point that has been written, or at zero and on their way.
    fn look_at_start(&mut self, notes: &mut Notes, k: usize, t: f64) -> EvalResult {
        let at = Point { t, x: &notes.x, u: &self.field.u, p: &self.field.p };
        notes.all[k].values(0, &at, &mut notes.work)?;
        self.gradients_of(notes, k, t)?;
        for l in 0..notes.all[k].beyond.len() {
            let (near, rate) = self.nearness(notes, (k, l), t);
            let note = &mut notes.all[k];
            let v = note.v[0][l];
            note.beyond[l] = if v.abs() <= near { note.toward() * rate > 0.0 } else { v > 0.0 };
        }
        Ok(())
    }

    /// Value of the terms of function `l` at the point that has been written, its rounding in units of the machine precision, and its rate; of the Jacobian
    /// that stands in `jac`.
    fn rate_of(&self, notes: &Notes, (k, l): (usize, usize), t: f64) -> (f64, f64) {
        let (mut terms, mut rate) = (0.0, 0.0);
        let own = notes.all[k].entries.iter().zip(&notes.jac).filter(|(e, _)| e.0 == l);
        for (&(_, i), g) in own {
            if i < self.nx {
                terms += g.abs() * self.field.size(i, notes.x[i]);
                rate += g * notes.f[i];
            } else if i == notes.n_z - 1 {
                terms += (g * t).abs();
                rate += g;
            }
        }
        (terms, rate)
    }

    fn gradients_of(&self, notes: &mut Notes, k: usize, t: f64) -> EvalResult {
        let Notes { all, jac, work, x, .. } = notes;
        let note = &all[k];
        let at = Point { t, x, u: &self.field.u, p: &self.field.p };
        note.transition.guard.jacobian(&at, &mut jac[..note.entries.len()], work)
    }

    /// Values of function `l` up to this one are rounding; and its rate.
    fn nearness(&self, notes: &Notes, l: (usize, usize), t: f64) -> (f64, f64) {
        let (terms, rate) = self.rate_of(notes, l, t);
        ((64.0 * EPS * terms).max(8.0 * EPS * rate.abs() * t.abs()), rate)
    }

    fn look_through(&mut self, notes: &mut Notes, k: usize, w: Window) -> std::result::Result<(), EvalError> {
        self.move_note(notes, k, &w, w.from);
        if !is_watched(notes, k) {
            notes.all[k].held = None;
            return Ok(());
        }
        let before = notes.all[k].held;
        self.look_at_start(notes, k, w.from)?;
        if before == Some(false) && notes.all[k].is_true() {
            // a jump has made it true
            let dt = self.shown_dt();
            let x = self.state_in(&w, w.from);
            self.log_note(Noted { t: w.from, transition: notes.all[k].number, x, rate: f64::NAN, dt });
        }
        notes.zeros.clear();
        let ends = self.look_at_end(notes, k, &w)?;
        for (l, end) in ends.iter().enumerate() {
            self.zeros_of(notes, (k, l), &w, *end)?;
        }
        notes.zeros.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut held = notes.all[k].is_true();
        for i in 0..notes.zeros.len() {
            let (s, l, rises) = notes.zeros[i];
            notes.all[k].beyond[l] = rises;
            let now = notes.all[k].is_true();
            if now && !held {
                self.note(notes, (k, l), s, &w)?;
            }
            held = now;
        }
        // what is at zero at the end passes it there, whatever follows
        for (l, end) in ends.iter().enumerate() {
            let Some(end) = end else { continue };
            let passes = end.rises && !notes.all[k].beyond[l];
            notes.all[k].beyond[l] = end.rises;
            let now = notes.all[k].is_true();
            if passes && now && !held {
                self.note(notes, (k, l), 1.0, &w)?;
            }
            held = now;
        }
        notes.all[k].held = Some(held);
        Ok(())
    }

    /// All states at a time in a window.
    fn state_in(&self, w: &Window, t: f64) -> Vec<f64> {
        let s = &self.stepper.step;
        let mut x = vec![0.0; self.nx];
        match w.units {
            // others may go their own way in between
            Some(c) => x.iter_mut().enumerate().for_each(|(i, x)| {
                let from = if t == w.to { c.tracks.last_break(i, w.from, t) } else { t };
                *x = c.tracks.follow(s, i, from, t).0;
            }),
            None if t == w.from => x.copy_from_slice(&self.x),
            None if t == w.to => x.copy_from_slice(&s.x1),
            None => s.at((t - s.t) / s.h, &mut x),
        }
        x
    }

    /// Which functions of a note are at zero to rounding at the end of the window; writes their values there.
    fn look_at_end(
        &mut self,
        notes: &mut Notes,
        k: usize,
        w: &Window,
    ) -> std::result::Result<Vec<Option<End>>, EvalError> {
        let (t, h) = (w.to, w.to - w.from);
        self.move_note(notes, k, w, t);
        let at = Point { t, x: &notes.x, u: &self.field.u, p: &self.field.p };
        notes.all[k].values(1, &at, &mut notes.work)?;
        self.gradients_of(notes, k, t)?;
        let end = |l: usize| {
            let (near, rate) = self.nearness(notes, (k, l), t);
            let rises = notes.all[k].toward() * rate > 0.0;
            let part = MARGIN * near / (rate.abs() * h);
            (notes.all[k].v[1][l].abs() <= near).then_some(End { rises, part: if part < 1.0 { part } else { 0.0 } })
        };
        Ok((0..notes.all[k].beyond.len()).map(end).collect())
    }

    /// Finds the zeros of function `l` of note `k` in the window.
    fn zeros_of(&mut self, notes: &mut Notes, (k, l): (usize, usize), w: &Window, end: Option<End>) -> EvalResult {
        let note = &notes.all[k];
        let (first, last) = (note.v[0][l], note.v[1][l]);
        let (guard, toward, begins) = (note.transition.guard.clone(), note.toward(), note.beyond[l]);
        let mut out = vec![0.0; note.beyond.len()];
        let mut zeros = std::mem::take(&mut notes.zeros);
        let mut value = |s: f64| match s {
            _ if s == 0.0 => Ok(first),
            _ if s == 1.0 => Ok(last),
            _ => {
                let t = w.from + s * (w.to - w.from);
                self.move_note(notes, k, w, t);
                let at = Point { t, x: &notes.x, u: &self.field.u, p: &self.field.p };
                guard.value(&at, &mut out, &mut notes.work)?;
                Ok(toward * out[l])
            }
        };
        // at zero to rounding where it begins on the side its value is not on
        let departs = (first > 0.0) != begins || first == 0.0;
        let r = find_zeros(&self.functions.sampler, &mut value, (begins, departs), &mut |s, rises| {
            // next to the end it is the zero there, or rounding
            if end.is_none_or(|end| s < 1.0 - end.part) {
                zeros.push((s, l, rises));
            }
        });
        notes.zeros = zeros;
        r
    }

    /// Writes down that function `l` of note `k` makes its condition true at relative time `s` of the window.
    fn note(&mut self, notes: &mut Notes, (k, l): (usize, usize), s: f64, w: &Window) -> EvalResult {
        let ended = s == 1.0;
        let mut t = if ended { w.to } else { w.from + s * (w.to - w.from) };
        let mut state = self.state_in(w, t);
        let (mut repeated, mut known) = (false, true);
        if w.units.is_some() {
            self.move_note(notes, k, w, t);
        } else {
            let mut velocity = vec![0.0; self.nx];
            if !self.stepper.step_implicit && !ended {
                let side = &mut notes.side;
                (side.t, side.h, side.part) = (self.stepper.step.t, t - self.stepper.step.t, 1.0);
                side.x0.copy_from_slice(&self.stepper.step.x0);
                side.f0.copy_from_slice(&self.stepper.step.f0);
                repeated = explicit::attempt(self.stepper.pair, &mut self.field, side).is_ok()
                    && self.field.rhs(t, &side.x1, &mut velocity).is_ok();
            }
            if repeated {
                notes.x.copy_from_slice(&notes.side.x1);
                notes.f.copy_from_slice(&velocity);
                let point = Point { t, x: &notes.x, u: &self.field.u, p: &self.field.p };
                let mut values = vec![0.0; notes.all[k].beyond.len()];
                notes.all[k].transition.guard.value(&point, &mut values, &mut notes.work)?;
                let value = values[l];
                self.gradients_of(notes, k, t)?;
                let (_, rate) = self.rate_of(notes, (k, l), t);
                let delta = -value / rate;
                repeated = delta.abs() <= NEAR * notes.side.h;
                if repeated {
                    t = (t + delta).clamp(w.from, w.to);
                    state.iter_mut().zip(notes.x.iter().zip(&velocity)).for_each(|(x, (at, f))| *x = at + delta * f);
                }
            }
            known = repeated || self.field.rhs(t, &state, &mut velocity).is_ok();
            notes.x.copy_from_slice(&state);
            notes.f.copy_from_slice(&velocity);
        }
        self.gradients_of(notes, k, t)?;
        let rate = if known { self.rate_of(notes, (k, l), t).1 } else { f64::NAN };
        let end = ended.then_some(w.to);
        let dt = self.time_of_note(notes, (k, l), (repeated, end), (t, rate))?;
        let rate = notes.all[k].toward() * rate;
        self.log_note(Noted { t, transition: notes.all[k].number, x: state, rate, dt });
        Ok(())
    }

    /// Derivatives of the time `t` of a note, whose gradient stands in `jac`: those of the state there are those of the step that was repeated, or of the
    /// dense output of an implicit one.
    fn time_of_note(
        &mut self,
        notes: &mut Notes,
        (k, l): (usize, usize),
        (repeated, end): (bool, Option<f64>),
        (t, rate): (f64, f64),
    ) -> std::result::Result<Vec<f64>, EvalError> {
        let Some(mut s) = self.derivatives.sens.take() else { return Ok(Vec::new()) };
        let mut row = vec![0.0; notes.n_z];
        let own = notes.all[k].entries.iter().zip(&notes.jac).filter(|(e, _)| e.0 == l);
        own.for_each(|(e, g)| row[e.1] += g / -rate);
        let n_z = notes.n_z;
        let kept = (s.s.clone(), s.dt.clone());
        let own = &self.stepper.step;
        let (step, rest) = end.map_or((&notes.side, 0.0), |t1| (own, t1 - (own.t + own.h)));
        let r = match (self.field.in_limit_set(), self.stepper.step_implicit) {
            (true, _) => Ok(false),
            (_, true) => {
                let at = (t - own.t) / own.h;
                s.implicit_to(&self.stepper.radau, &mut self.field, own, at).map(|()| true)
            }
            _ if repeated || end.is_some() => s.explicit(self.stepper.pair, &mut self.field, step, rest).map(|()| true),
            _ => Ok(false),
        };
        let dt = match r {
            Ok(true) => {
                s.time(&row[..n_z - 1]);
                Follower::shown(self.algebraic.as_deref(), &s.dt)
            }
            _ => Follower::shown(self.algebraic.as_deref(), &vec![f64::NAN; s.dt.len()]),
        };
        (s.s, s.dt) = kept;
        self.derivatives.sens = Some(s);
        match r {
            Err(EvalError::Recoverable) | Ok(_) => Ok(dt),
            Err(e) => Err(e),
        }
    }

    fn log_note(&mut self, mut noted: Noted) {
        if let Some(a) = &self.algebraic {
            a.show(noted.t, &mut noted.x, &[], &self.field.u, &self.field.p);
            noted.x.truncate(a.n_states());
        }
        self.log.stats.notes += 1;
        if self.log.notes.len() < self.options.max_log {
            self.log.notes.push(noted);
        }
    }
}

/// Are the discrete states of the point that has been written as note `k` asks?
fn is_watched(notes: &Notes, k: usize) -> bool {
    notes.all[k].transition.from.iter().all(|&(state, value)| notes.x[state] == value)
}

/// Calls `found` with all relative times at which a function passes zero, and whether it rises there. It begins on the side that `begins.0`
/// says, and `begins.1` says whether it is zero there.
pub(super) fn find_zeros(
    sampler: &Sampler,
    value: &mut Along,
    begins: (bool, bool),
    found: &mut dyn FnMut(f64, bool),
) -> EvalResult {
    let (mut side, mut power, mut n) = (begins.0, usize::from(begins.1), 0);
    let mut parts = vec![(0.0, 1.0, 0)];
    while let Some((a, b, depth)) = parts.pop() {
        let width: f64 = b - a;
        let place = |s: f64| if s == 1.0 { b } else { a + s * width };
        let sign = if side { 1.0 } else { -1.0 };
        let mut samples = [0.0; NODES];
        for (v, s) in samples.iter_mut().zip(sampler.nodes) {
            *v = sign * value(place(s))?;
        }
        let (c, degree) = sampler.coefficients(&samples, power);
        let c = &c[..=degree];
        let largest = samples.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut off = 0.0f64;
        // between the nodes in the middle, where they are far apart
        for w in sampler.nodes.windows(2).skip(NODES / 2 - 1).take(2) {
            let s = 0.5 * (w[0] + w[1]);
            let interpolated = bernstein::value(c, s) * s.powi(power as i32);
            off = off.max((interpolated - sign * value(place(s))?).abs());
        }
        if off > FRACTION * largest && depth < HALVINGS {
            // not at a zero, which would belong to both halves
            let mut middle = 0.5 * (a + b);
            if value(middle)?.abs() <= SMALL * largest {
                middle += 0.1 * (b - middle);
            }
            parts.push((middle, b, depth + 1));
            parts.push((a, middle, depth + 1));
            continue;
        }
        let zero = match bernstein::first(c) {
            First::Zero(s) if s > 0.0 => {
                // to rounding, or the rest of the part begins beside zero
                let slope = value_slope(c, s, power) / width;
                let mut zero = place(s);
                for _ in 0..3 {
                    let step = sign * value(zero)? / slope;
                    if step.is_nan() || step.abs() > FRACTION * width {
                        break;
                    }
                    zero = (zero - step).clamp(a, b);
                }
                zero
            }
            // a zero of higher order at the start, or none
            _ => {
                power = 0;
                continue;
            }
        };
        n += 1;
        if n > ZEROS {
            return Ok(());
        }
        side = !side;
        found(zero, side);
        power = 1;
        if b - zero > 4.0 * EPS {
            parts.push((zero, b, depth));
        } else {
            power = 0;
        }
    }
    Ok(())
}

/// Slope at a zero of an interpolation by powers, which a power is divided out of.
fn value_slope(c: &[f64], s: f64, power: usize) -> f64 {
    s.powi(power as i32) * bernstein::slope(c, s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zeros(mut f: impl FnMut(f64) -> f64, begins: (bool, bool)) -> Vec<(f64, bool)> {
        let mut all = Vec::new();
        find_zeros(&Sampler::new(), &mut |s| Ok(f(s)), begins, &mut |s, rises| all.push((s, rises))).unwrap();
        all
    }

    #[test]
    fn every_zero_of_an_oscillation_is_found() {
        let found = zeros(|s| (100.0 * s + 0.5).sin(), (true, false));
        assert_eq!(found.len(), 31);
        for (k, (s, rises)) in found.iter().enumerate() {
            let exact = ((k + 1) as f64 * std::f64::consts::PI - 0.5) / 100.0;
            assert!((s - exact).abs() < 1e-4, "{k}: {s} {exact}");
            assert_eq!(*rises, k % 2 == 1);
        }
    }

    #[test]
    fn a_function_that_leaves_zero_has_no_zero_there() {
        assert!(zeros(|s| s * (1.0 + s), (true, true)).is_empty());
        let found = zeros(|s| s * (0.5 - s), (true, true));
        assert!(found.len() == 1 && (found[0].0 - 0.5).abs() < 1e-9 && !found[0].1, "{found:?}");
        // rounding on the other side
        assert!(zeros(|s| s - 1e-17, (true, true)).is_empty());
        assert!(zeros(|s| 1.0 + s, (true, false)).is_empty());
    }
}
