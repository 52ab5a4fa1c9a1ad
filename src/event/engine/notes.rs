//! Events that change nothing: where the condition of a note becomes true, time and state are written down. No step ends for that.
//!
//! A step that is accepted is looked through on its dense output, which is interpolated where a function bends, on shorter and shorter parts
//! until the interpolation is good. The state at an event is then that of a step from the start of the accepted one which ends there, by the
//! same pair, so it is as accurate as one at which a step does end; an implicit step is not repeated, and its dense output counts.

use super::{recover, Engine, EPS};
use crate::error::Result;
use crate::event::bernstein::{self, First, Sampler, NODES};
use crate::event::explicit;
use crate::event::field::{gradient_map, scatter};
use crate::event::step::Step;
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
    /// Where the entries of the Jacobian go, row by row.
    map: Vec<usize>,
    /// Was the condition true at the end of the last step? None: it is not watched yet.
    held: Option<bool>,
    /// Which of its functions are beyond zero.
    beyond: Vec<bool>,
    v: [Vec<f64>; 2],
}

/// All of them, with memory.
pub(super) struct Notes {
    all: Vec<Note>,
    sampler: Sampler,
    side: Step,
    jac: Vec<f64>,
    buffer: Vec<f64>,
    work: Vec<f64>,
    x: Vec<f64>,
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

/// A function along a step: relative time to its value.
type Along<'a> = dyn FnMut(f64) -> std::result::Result<f64, EvalError> + 'a;

impl Notes {
    /// Those of a system; none where it has none.
    pub(super) fn new(system: &System) -> Option<Box<Notes>> {
        let dims: Dims = system.dims();
        let noted = system.transitions().iter().enumerate().filter(|t| t.1.rule.effect == Effect::Note);
        let note = |(number, t): (usize, &Transition)| {
            let n = t.guard.n_out();
            let rows: Vec<usize> = (0..n).collect();
            Note {
                number,
                map: gradient_map(&t.guard, &rows, &dims),
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
            sampler: Sampler::new(),
            side: Step::new(dims.x),
            jac: vec![0.0; n_z * most(&|n| n.beyond.len())],
            buffer: vec![0.0; most(&|n| n.map.len())],
            work: vec![0.0; most(&|n| n.transition.guard.work_len())],
            x: vec![0.0; dims.x],
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
        let Some(mut notes) = self.notes.take() else { return Ok(()) };
        // what has been evaluated at the end of the step is needed there
        let (alpha, q, dq) = (self.field.alpha.clone(), self.field.q.clone(), self.field.dq.clone());
        let logged = self.log.notes.len();
        let mut r = self.save_dense();
        for k in 0..notes.all.len() {
            if r.is_ok() {
                let looked = self.look_through(&mut notes, k, t1);
                r = recover(looked.map(|()| true), false).map(|_| ());
            }
        }
        (self.field.alpha, self.field.q, self.field.dq) = (alpha, q, dq);
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
            if r.is_ok() && notes.all[k].held.is_none() && self.is_watched(&notes, k) {
                let known = self.look_at_start(&mut notes, k);
                r = recover(known.map(|()| true), false).map(|known| {
                    notes.all[k].held = known.then(|| notes.all[k].is_true());
                });
            }
        }
        self.notes = Some(notes);
        r
    }

    /// Are the discrete states as a note asks?
    fn is_watched(&self, notes: &Notes, k: usize) -> bool {
        notes.all[k].transition.from.iter().all(|&(state, value)| self.x[state] == value)
    }

    /// Finds out which functions of a note are beyond zero at the present point, or at zero and on their way.
    fn look_at_start(&mut self, notes: &mut Notes, k: usize) -> EvalResult {
        let (t, n) = (self.t, notes.all[k].beyond.len());
        let at = Point { t, x: &self.x, u: &self.field.u, p: &self.field.p };
        notes.all[k].values(0, &at, &mut notes.work)?;
        self.gradients_of(notes, k, t, &self.x)?;
        for l in 0..n {
            let (near, rate) = self.nearness(notes, l, (t, &self.x), &self.f);
            let note = &mut notes.all[k];
            let v = note.v[0][l];
            note.beyond[l] = if v.abs() <= near { note.toward() * rate > 0.0 } else { v > 0.0 };
        }
        Ok(())
    }

    /// Value of the terms of function `l` at a point, its rounding in units of the machine precision, and its rate; of the Jacobian that stands in
    /// `jac`.
    fn rate_of(&self, notes: &Notes, l: usize, (t, x): (f64, &[f64]), f: &[f64]) -> (f64, f64) {
        let g = &notes.jac[l * notes.n_z..(l + 1) * notes.n_z];
        let by_time = g[notes.n_z - 1];
        let terms = g.iter().zip(x).enumerate().map(|(i, (g, x))| g.abs() * self.field.size(i, *x)).sum::<f64>();
        (terms + (by_time * t).abs(), g.iter().zip(f).map(|(g, f)| g * f).sum::<f64>() + by_time)
    }

    fn gradients_of(&self, notes: &mut Notes, k: usize, t: f64, x: &[f64]) -> EvalResult {
        let Notes { all, jac, buffer, work, .. } = notes;
        let note = &all[k];
        let at = Point { t, x, u: &self.field.u, p: &self.field.p };
        jac.fill(0.0);
        scatter(&note.transition.guard, &at, &note.map, jac, (buffer, work))
    }

    /// Values of function `l` up to this one are rounding; and its rate.
    fn nearness(&self, notes: &Notes, l: usize, at: (f64, &[f64]), f: &[f64]) -> (f64, f64) {
        let (terms, rate) = self.rate_of(notes, l, at, f);
        ((64.0 * EPS * terms).max(8.0 * EPS * rate.abs() * at.0.abs()), rate)
    }

    fn look_through(&mut self, notes: &mut Notes, k: usize, t1: f64) -> std::result::Result<(), EvalError> {
        if !self.is_watched(notes, k) {
            notes.all[k].held = None;
            return Ok(());
        }
        let t0 = self.t;
        let before = notes.all[k].held;
        self.look_at_start(notes, k)?;
        if before == Some(false) && notes.all[k].is_true() {
            // a jump has made it true
            let dt = self.derivatives.sens.as_ref().map_or_else(Vec::new, |s| s.dt.clone());
            let noted = Noted { t: t0, transition: notes.all[k].number, x: self.x.clone(), rate: f64::NAN, dt };
            self.log_note(noted);
        }
        notes.zeros.clear();
        let ends = self.look_at_end(notes, k, t1)?;
        for (l, end) in ends.iter().enumerate() {
            self.zeros_of(notes, k, l, t1, *end)?;
        }
        notes.zeros.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut held = notes.all[k].is_true();
        for i in 0..notes.zeros.len() {
            let (s, l, rises) = notes.zeros[i];
            notes.all[k].beyond[l] = rises;
            let now = notes.all[k].is_true();
            if now && !held {
                self.note(notes, (k, l), s, t1)?;
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
                self.note(notes, (k, l), 1.0, t1)?;
            }
            held = now;
        }
        notes.all[k].held = Some(held);
        Ok(())
    }

    /// Which functions of a note are at zero to rounding at the end of the step; writes their values there.
    fn look_at_end(
        &mut self,
        notes: &mut Notes,
        k: usize,
        t1: f64,
    ) -> std::result::Result<Vec<Option<End>>, EvalError> {
        let h = t1 - self.stepper.step.t;
        let at = Point { t: t1, x: &self.stepper.step.x1, u: &self.field.u, p: &self.field.p };
        notes.all[k].values(1, &at, &mut notes.work)?;
        self.gradients_of(notes, k, t1, &self.stepper.step.x1)?;
        let end = |l: usize| {
            let (near, rate) = self.nearness(notes, l, (t1, &self.stepper.step.x1), &self.stepper.step.f1);
            let rises = notes.all[k].toward() * rate > 0.0;
            let part = MARGIN * near / (rate.abs() * h);
            (notes.all[k].v[1][l].abs() <= near).then_some(End { rises, part: if part < 1.0 { part } else { 0.0 } })
        };
        Ok((0..notes.all[k].beyond.len()).map(end).collect())
    }

    /// Finds the zeros of function `l` of a note in the step.
    fn zeros_of(&mut self, notes: &mut Notes, k: usize, l: usize, t1: f64, end: Option<End>) -> EvalResult {
        let (t0, h) = (self.stepper.step.t, t1 - self.stepper.step.t);
        let Notes { all, sampler, work, x, zeros, .. } = notes;
        let note = &mut all[k];
        let (u, p) = (&self.field.u, &self.field.p);
        let (first, last) = (note.v[0][l], note.v[1][l]);
        let (guard, toward, begins) = (note.transition.guard.clone(), note.toward(), note.beyond[l]);
        let (n, step) = (note.beyond.len(), &self.stepper.step);
        let mut out = vec![0.0; n];
        let mut value = |s: f64| match s {
            _ if s == 0.0 => Ok(first),
            _ if s == 1.0 => Ok(last),
            _ => {
                step.at(s * h / step.h, x);
                guard.value(&Point { t: t0 + s * h, x, u, p }, &mut out, work)?;
                Ok(toward * out[l])
            }
        };
        // at zero to rounding where it begins on the side its value is not on
        let departs = (first > 0.0) != begins || first == 0.0;
        find_zeros(sampler, &mut value, (begins, departs), &mut |s, rises| {
            // next to the end it is the zero there, or rounding
            if end.is_none_or(|end| s < 1.0 - end.part) {
                zeros.push((s, l, rises));
            }
        })
    }

    /// Writes down that function `l` of a note makes its condition true at relative time `s`.
    fn note(&mut self, notes: &mut Notes, (k, l): (usize, usize), s: f64, t1: f64) -> EvalResult {
        let h = t1 - self.stepper.step.t;
        let mut t = if s == 1.0 { t1 } else { self.stepper.step.t + s * h };
        let ended = s == 1.0;
        let mut state = std::mem::take(&mut notes.x);
        match ended {
            true => state.copy_from_slice(&self.stepper.step.x1),
            false => self.stepper.step.at(s * h / self.stepper.step.h, &mut state),
        }
        let explicit = !self.stepper.step_implicit;
        let mut velocity = vec![0.0; self.nx];
        let mut repeated = false;
        if explicit && !ended {
            let side = &mut notes.side;
            (side.t, side.h, side.part) = (self.stepper.step.t, t - self.stepper.step.t, 1.0);
            side.x0.copy_from_slice(&self.stepper.step.x0);
            side.f0.copy_from_slice(&self.stepper.step.f0);
            repeated = explicit::attempt(self.stepper.pair, &mut self.field, side).is_ok()
                && self.field.rhs(t, &side.x1, &mut velocity).is_ok();
        }
        if repeated {
            let at = notes.side.x1.clone();
            let point = Point { t, x: &at, u: &self.field.u, p: &self.field.p };
            let mut values = vec![0.0; notes.all[k].beyond.len()];
            notes.all[k].transition.guard.value(&point, &mut values, &mut notes.work)?;
            let value = values[l];
            self.gradients_of(notes, k, t, &at)?;
            let (_, rate) = self.rate_of(notes, l, (t, &at), &velocity);
            let delta = -value / rate;
            repeated = delta.abs() <= NEAR * notes.side.h;
            if repeated {
                t = (t + delta).clamp(self.stepper.step.t, t1);
                state.iter_mut().zip(at.iter().zip(&velocity)).for_each(|(x, (at, f))| *x = at + delta * f);
            }
        }
        let known = repeated || self.field.rhs(t, &state, &mut velocity).is_ok();
        self.gradients_of(notes, k, t, &state)?;
        let rate = if known { self.rate_of(notes, l, (t, &state), &velocity).1 } else { f64::NAN };
        let end = ended.then_some(t1);
        let dt = self.time_of_note(notes, l, (repeated, end), rate)?;
        let noted =
            Noted { t, transition: notes.all[k].number, x: state.clone(), rate: notes.all[k].toward() * rate, dt };
        self.log_note(noted);
        notes.x = state;
        Ok(())
    }

    /// Derivatives of the time of a note, whose gradient stands in `jac`: those of the state there are those of the step that was repeated.
    /// Behind an implicit step, which is not, they are not known.
    fn time_of_note(
        &mut self,
        notes: &mut Notes,
        l: usize,
        (repeated, end): (bool, Option<f64>),
        rate: f64,
    ) -> std::result::Result<Vec<f64>, EvalError> {
        let Some(mut s) = self.derivatives.sens.take() else { return Ok(Vec::new()) };
        let n_z = notes.n_z;
        let mut row = notes.jac[l * n_z..(l + 1) * n_z].to_vec();
        row.iter_mut().for_each(|g| *g /= -rate);
        let kept = (s.s.clone(), s.dt.clone());
        let own = &self.stepper.step;
        let (step, rest) = end.map_or((&notes.side, 0.0), |t1| (own, t1 - (own.t + own.h)));
        let r = match (repeated || end.is_some()) && !self.stepper.step_implicit && !self.field.in_limit_set() {
            true => s.explicit(self.stepper.pair, &mut self.field, step, rest).map(|()| true),
            false => Ok(false),
        };
        let dt = match r {
            Ok(true) => {
                s.time(&row[..n_z - 1]);
                s.dt.clone()
            }
            _ => vec![f64::NAN; s.dt.len()],
        };
        (s.s, s.dt) = kept;
        self.derivatives.sens = Some(s);
        match r {
            Err(EvalError::Recoverable) | Ok(_) => Ok(dt),
            Err(e) => Err(e),
        }
    }

    fn log_note(&mut self, noted: Noted) {
        self.log.stats.notes += 1;
        if self.log.notes.len() < self.options.max_log {
            self.log.notes.push(noted);
        }
    }
}

/// Calls `found` with all relative times at which a function passes zero, and whether it rises there. It begins on the side that `begins.0`
/// says, and `begins.1` says whether it is zero there.
fn find_zeros(
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
