//! Control of the step length: tolerances, growth, stiffness, the first step.

use super::{recover, Engine, EPS};
use crate::error::Result;
use crate::event::explicit::{self, Pair};
use crate::event::radau::{self, Attempt};
use crate::event::sets;
use crate::event::step;
use crate::event::Method;
use crate::func::EvalError;

/// Steps in a row that look stiff before Radau IIA takes over.
const STIFF_STEPS: usize = 15;
/// Part of the limit of stability from which on the step is too long for a mode that is damped. What so many steps leave of it no
/// tolerance of the pairs sees: `exp(-3.25 · 15 / 3) = 9e-8` for the one of order 5, which is for tolerances above 1e-5, `6e-14` for that
/// of order 8. Above [`MILD`], or methods would take turns.
const DAMPED: f64 = 1.0 / 3.0;
/// Steps from one look for stiffness to the next.
const LOOK: usize = 4;
/// Steps in a row that look mild before an explicit pair takes over again, and the share of its stability they may use.
const MILD_STEPS: usize = 8;
const MILD: f64 = 0.25;

/// Part of the stability of a pair above which its dense output may show what the pair does and not the solution.
const NEAR: f64 = 0.2;

/// A move of so much of the tolerance leaves the derivative as it is.
pub(super) const UNSEEN: f64 = 1e-3;

/// Part of the tolerance that the error of a step that ends where its dense output says may be: errors of steps that are cut
/// short add up over many of them.
pub(super) const ACCURATE: f64 = 0.02;

/// How steps ended lately, see [`Engine::note_end`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Cut {
    /// Steps in a row that ended at a switch.
    short: usize,
    /// Steps that did not, less those that two for a switch are.
    long: usize,
    /// How many there were in a row when it was last asked whether order 3 is enough.
    asked: usize,
}

/// What is known of how fast a mode is compared with what the tolerances ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pace {
    Unknown,
    /// An explicit pair was at the limit of its stability.
    Stiff,
    /// Steps of Radau IIA were such that an explicit pair would have been stable.
    Mild,
}

/// First steps behind switches to a cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FirstStep {
    /// What the last one asked for, and how often in a row it had to be cut down or began as short as that.
    length: f64,
    short: usize,
}

impl FirstStep {
    /// Once is chance.
    const OFTEN: usize = 2;
    /// Now and then one begins as if nothing were known: it may pass over a transient that shorter ones have to follow.
    const AGAIN: usize = 8;

    /// The longest first step, as far as it is known.
    fn longest(&self) -> f64 {
        match self.short {
            n if n >= Self::OFTEN && n % Self::AGAIN != 0 => self.length,
            _ => f64::INFINITY,
        }
    }

    fn note(&mut self, next: f64, rejected: bool) {
        let short = rejected || self.longest().is_finite();
        (self.length, self.short) = (next, if short { self.short + 1 } else { 0 });
    }

    /// It ended at a switch and may be as long as this.
    pub(super) fn allow(&mut self, length: f64) {
        self.length = self.length.max(length);
    }
}

/// Failed attempts at one step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Beyond {
    attempts: usize,
    /// Length of the first of them.
    pub(super) longest: f64,
    /// Length of one that was beyond the stability of the explicit pair, and the speed that it showed.
    seen: Option<(f64, f64)>,
}

/// How an attempt at a step ended.
pub(super) enum Tried {
    Error(f64),
    Undefined,
    Diverged,
}

impl Engine {
    pub(super) fn set_weights(&mut self, with_end: bool) {
        let (sharpness, s) = (self.sharpness(), &self.stepper.step);
        let tolerances = self.atol.iter().zip(&self.rtol);
        let ends = s.x0.iter().zip(if with_end { &s.x1 } else { &s.f0 });
        let by = if with_end { 1.0 } else { s.h };
        for ((w, (atol, rtol)), (start, other)) in self.stepper.weights.iter_mut().zip(tolerances).zip(ends) {
            let size = start.abs().max((by * other).abs());
            *w = 1.0 / (sharpness * atol + rtol * size).max(f64::MIN_POSITIVE);
        }
    }

    /// Radau IIA estimates an error of order 3 for a result of order 5: its tolerance is looser.
    pub(super) fn shrink(&self) -> (f64, f64) {
        let r = self.rtol.iter().fold(f64::INFINITY, |m, v| m.min(*v)).clamp(1e-14, 0.1);
        let inner = 0.06 * r.powf(0.69);
        let shrink = (r / inner).min(1.0);
        // what the iteration may leave is a tenth of the tolerance itself
        (shrink, (0.1 * shrink).max(10.0 * EPS / inner))
    }

    pub(super) fn attempt(&mut self) -> Result<Tried> {
        // that of an attempt before, which was not accepted, says nothing about this one
        self.stepper.dense_ready = false;
        let r = if self.stepper.implicit {
            self.set_weights(false);
            let (shrink, tol) = self.shrink();
            let tolerances = (self.atol.as_slice(), self.rtol.as_slice());
            self.stepper.radau.attempt(&mut self.field, &mut self.stepper.step, tolerances, shrink, tol).map(
                |a| match a {
                    Attempt::Error(e) => Tried::Error(e),
                    Attempt::Diverged => Tried::Diverged,
                },
            )
        } else {
            explicit::attempt(self.stepper.pair, &mut self.field, &mut self.stepper.step).map(|()| {
                self.set_weights(true);
                let e = explicit::error(self.stepper.pair, &self.stepper.step, &self.stepper.weights);
                if e.is_finite() {
                    Tried::Error(e)
                } else {
                    Tried::Undefined
                }
            })
        };
        if let Ok(Tried::Error(e)) = &r {
            self.stepper.tried = *e;
        }
        recover(r, Tried::Undefined)
    }

    /// Derivative at the end; false where it is not defined, or says that the estimate of the error means nothing.
    pub(super) fn finish(&mut self) -> Result<bool> {
        let r = if self.stepper.implicit {
            self.stepper.radau.finish(&mut self.field, &mut self.stepper.step)
        } else if self.stepper.pair == Pair::Dop853 {
            explicit::finish(self.stepper.pair, &mut self.field, &mut self.stepper.step)
        } else {
            Ok(())
        };
        if !self.stepper.implicit && self.looks_for_stiffness(self.log.stats.steps + 1) {
            // before the dense output, which has stages of its own
            (self.stepper.stiffness, self.stepper.damped) =
                explicit::stiffness(self.stepper.pair, &self.stepper.step, &self.stepper.weights);
        }
        if r.is_ok()
            && !self.stepper.implicit
            && explicit::is_misjudged(self.stepper.pair, &self.stepper.step, &self.stepper.weights)
        {
            return Ok(false);
        }
        let r = r.and_then(|()| self.return_to_surfaces());
        recover(r.map(|()| true), false)
    }

    /// Puts the end of an explicit step in a sliding mode onto the surfaces again, which the velocity is tangent to: what an
    /// explicit method drifts off them is part of its local error (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical
    /// Integration* (2006), section IV.4, on projection methods: the order stays).
    fn return_to_surfaces(&mut self) -> std::result::Result<(), EvalError> {
        if self.stepper.implicit || self.field.n_alg() == 0 {
            return Ok(());
        }
        let s = &mut self.stepper.step;
        self.stepper.node.copy_from_slice(&s.x1);
        if self.field.project(s.t + s.h, &mut s.x1)? {
            self.stepper.node.iter_mut().zip(&s.x1).for_each(|(n, x)| *n -= x);
            if step::norm(&self.stepper.node, &self.stepper.weights) > UNSEEN {
                self.field.rhs(s.t + s.h, &s.x1, &mut s.f1)?;
            }
        }
        Ok(())
    }

    /// A step has ended, at a switch or where the error let it. Where most steps are cut short by a switch, the
    /// pair of high order has nothing to do with the accuracy that it pays for: the pair of order 5 takes over, whose steps
    /// cost half as much and whose dense output costs nothing, until it makes more than two steps for one switch. Where
    /// evaluations cost much and steps are so short that order 3 is accurate enough too, that pair takes over in the same way,
    /// which costs half as much again. Says whether the next step has another pair than the last one.
    pub(super) fn note_end(&mut self, at_switch: bool) -> bool {
        /// Steps in a row, or more than there should be.
        const PATIENCE: usize = 8;
        self.foresight.note_end(at_switch);
        if self.stepper.implicit
            || self.field.in_limit_set()
            || self.options.method != Method::Auto
            || self.field.has_contacts()
        {
            return false;
        }
        let Cut { short, long, asked } = &mut self.stepper.cut;
        match at_switch {
            true => (*short, *long) = (*short + 1, long.saturating_sub(2)),
            false => (*short, *long, *asked) = (0, *long + 1, 0),
        }
        let (often, seldom) = (self.foresight.mostly_switches(), *long >= PATIENCE);
        let next = match self.stepper.pair {
            Pair::Dop853 if often => Pair::Dp5,
            Pair::Dp5 if seldom && self.stepper.usual_pair == Pair::Dop853 => Pair::Dop853,
            // not asked again at every switch
            Pair::Dp5 if *short >= *asked + PATIENCE => {
                *asked = *short;
                match self.lets_order_three() {
                    true => Pair::Bs3,
                    false => return false,
                }
            }
            Pair::Bs3 if seldom || self.stepper.tried > ACCURATE => Pair::Dp5,
            _ => return false,
        };
        self.stepper.cut = Cut::default();
        self.stepper.next_pair = next;
        true
    }

    /// Would the last step of the pair of order 5 have been far more accurate than asked for with that of order 3, too?
    fn lets_order_three(&self) -> bool {
        self.field.many_functions()
            && self.may_end_inside()
            && explicit::error_of_order_three(&self.stepper.step, &self.stepper.weights) <= 0.5 * ACCURATE
    }

    /// Has the method of the present mode to be implicit from its start? Not next to an accumulation: a root that vanishes at
    /// its switches is infinitely steep there, for an instant, and an implicit method with that Jacobian estimates no error.
    pub(super) fn begins_implicit(&self) -> bool {
        if self.field.is_explicit_only() {
            return false;
        }
        match self.options.method {
            Method::Radau5 => true,
            Method::Dp5 | Method::Dop853 => false,
            Method::Auto => self.stepper.stiff_mode && self.sharpness() == 1.0,
        }
    }

    /// Is the present mode stiff, as far as is known when it begins? One that nothing is known of is as the mode before: what is
    /// fast beside a surface mostly is fast on it and behind it too, and an explicit pair would find that out at the limit of its
    /// stability, where its dense output has zeros that the solution has not.
    pub(super) fn begins_stiff(&self) -> bool {
        let slid = |(set, stiff): (&Vec<usize>, &bool)| *stiff && set.len() > 1;
        let fast = |pace: Pace| pace == Pace::Stiff || pace == Pace::Unknown && self.stepper.stiff_mode;
        fast(self.stepper.stiff[self.stepper.stiff.len() - 1]) && self.field.active.is_empty()
            || self.field.active_cells().any(|c| fast(self.stepper.stiff[c]))
            || self.field.active.iter().zip(&self.stepper.stiff_slides).any(slid)
            // the direction of a slide in space turns at a rate that falls with the velocity, from infinity
            || self.field.scene().is_some_and(|c| c.dynamics.begins.iter().any(|b| *b > 0.0))
    }

    /// Step length after a success.
    pub(super) fn grown(&self, err: f64, rejected: bool) -> f64 {
        let factor = if self.stepper.implicit {
            let n = radau::MAX_NEWTON as f64;
            let safe = 0.9 * (2.0 * n + 1.0) / (2.0 * n + self.stepper.radau.last_newton as f64);
            let factor = (safe * err.max(1e-8).powf(-0.25)).clamp(0.2, 8.0);
            // a step that is hardly longer is not worth new factors
            if self.stepper.radau.keeps() && (1.0..=1.2).contains(&factor) {
                1.0
            } else {
                factor
            }
        } else {
            // proportional-integral control, which the pair of order 8 does without
            // the first step of a scene is a guess, and flights and slides are often polynomials
            let guessed = self.log.stats.steps == 0 && self.field.has_contacts();
            let least = if guessed { 1e-18 } else { 1e-10 };
            let (factor, most) = match self.stepper.pair {
                Pair::Bs3 => (err.max(least).powf(-1.0 / 3.0), 5.0),
                Pair::Dp5 => (err.max(least).powf(-0.17) * self.stepper.err_before.powf(0.04), 10.0),
                Pair::Dop853 => (1.0 / err.max(least).sqrt().sqrt().sqrt(), 6.0),
            };
            let most = if guessed { 100.0 } else { most };
            (0.9 * factor).clamp(0.333, most)
        };
        if self.foresight.foreseen && !rejected {
            // what ends at a switch says nothing about longer steps
            return self.stepper.h.min(self.options.h_max);
        }
        let h = self.stepper.step.h * if rejected { factor.min(1.0) } else { factor };
        // the last step before a stop is short for that reason alone
        let wanted = self.stepper.h.min(self.options.h_max);
        if !rejected && self.stepper.step.h < 0.999 * wanted {
            h.max(wanted)
        } else {
            h
        }
    }

    /// The first step behind a switch of one subsystem is as long as it was the last times at the same cell, where steps had to be cut down
    /// to that: what was slow before the switch says nothing about a transient that begins there, and circuits and controllers come
    /// back to the same modes again and again. For implicit steps only: those of an explicit pair are as short as its stability anyway, and
    /// where switches accumulate no first step is like the one before.
    pub(super) fn begin_as_before(&mut self) {
        let mut changed = (0..self.before.len()).filter(|k| !sets::same_set(&self.before[*k], &self.field.active[*k]));
        self.stepper.entered = match (changed.next(), changed.next()) {
            (Some(k), None) if self.stepper.implicit && self.field.active[k].len() == 1 => {
                Some(self.field.active[k][0])
            }
            _ => None,
        };
        if let Some(cell) = self.stepper.entered {
            self.stepper.h = self.stepper.h.min(self.stepper.first_steps[cell].longest());
        }
    }

    /// The first step behind a switch is accepted, and `next` is what its error asks for.
    pub(super) fn note_first_step(&mut self, next: f64, rejected: bool) {
        if let Some(cell) = self.stepper.entered.take() {
            self.stepper.first_steps[cell].note(next, rejected);
        }
    }

    /// Factor of the step length after a failure.
    pub(super) fn shrunk(&self, err: f64) -> f64 {
        let order = if self.stepper.implicit { 4.0 } else { self.stepper.pair.order() };
        (0.9 * err.powf(-1.0 / order)).clamp(0.1, 0.9)
    }

    /// The longest step over which the derivatives of the solution are as accurate as the solution: they follow the linear
    /// equation `Ṡ = J S` with every mode of `J` in it, also those that the state does not show and its error says nothing
    /// about. A method of order `p` makes an error of `(h ρ)^(p+1) / (p+1)!` in a mode with the frequency `ρ`. The fastest
    /// mode is looked for by a few powers of `J`. Where it is damped its part of the derivatives is gone at once, and steps
    /// that are stable are enough; where those are far shorter than the state wants, the system is stiff.
    pub(super) fn variational_step(&mut self) -> Result<f64> {
        /// Steps from one look to the next, where the steps are well below the limit.
        const LOOK: usize = 8;
        if self.stepper.implicit
            || self.field.in_limit_set()
            || (self.derivatives.sens.is_none() && self.derivatives.tape.is_none())
        {
            return Ok(f64::INFINITY);
        }
        let (limit, last) = self.derivatives.variational;
        let far = self.stepper.h < 0.5 * limit && self.log.stats.steps < last + LOOK;
        if far && !self.stepper.fresh && last <= self.log.stats.steps {
            return Ok(limit);
        }
        let r = self.field.linearise(self.t, &self.x);
        if !recover(r.map(|()| true), false)? {
            return Ok(f64::INFINITY);
        }
        let rtol = self.rtol.iter().fold(f64::INFINITY, |m, v| m.min(*v)).clamp(1e-14, 0.1);
        let (p, factorial) = match self.stepper.pair {
            Pair::Bs3 => (4.0, 24.0),
            Pair::Dp5 => (6.0, 720.0),
            Pair::Dop853 => (9.0, 362_880.0),
        };
        let (modulus, damped) = self.fastest_mode();
        // next to a stop in space the direction of friction turns ever faster, and where it turns to is what counts
        let damped = damped && !self.field.slides_in_space();
        let reach = if damped { 0.5 * self.stepper.pair.stability() } else { (factorial * rtol).powf(1.0 / p) };
        let limit = reach / modulus.max(f64::MIN_POSITIVE);
        self.derivatives.variational = (limit, self.log.stats.steps);
        self.derivatives.held_back = if damped && self.stepper.h > limit { self.derivatives.held_back + 1 } else { 0 };
        if self.derivatives.held_back > STIFF_STEPS && self.options.method == Method::Auto {
            self.derivatives.held_back = 0;
            self.turn_stiff();
            return Ok(f64::INFINITY);
        }
        Ok(limit)
    }

    /// Modulus of the eigenvalue of the last Jacobian that is largest, and whether it is damped: from `v`, `J v` and `J² v`
    /// with `v` in the plane of the fastest mode, where `λ² = c₁ λ + c₀`.
    fn fastest_mode(&mut self) -> (f64, bool) {
        const POWERS: usize = 8;
        let nx = self.nx;
        let [v, w, z] = &mut self.derivatives.powers;
        let (field, x) = (&self.field, &self.x);
        // all states measured by their size, or as they are where they have none
        let size = |i: usize| Some(field.size(i, x[i])).filter(|s| *s > 0.0).unwrap_or(1.0);
        let entries = &mut self.derivatives.nonzero;
        entries.clear();
        for i in 0..nx {
            let own = field.velocity_rows().entries(i).filter(|e| e.0 < nx && e.1 != 0.0);
            let unit = 1.0 / size(i);
            entries.extend(own.map(|(j, a)| (i, j, a * size(j) * unit)));
        }
        let product = |v: &[f64], out: &mut [f64]| {
            out.fill(0.0);
            entries.iter().for_each(|&(i, j, a)| out[i] += a * v[j]);
        };
        let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        // no direction in particular
        v.iter_mut().enumerate().for_each(|(i, v)| *v = if i % 2 == 0 { 1.0 } else { -0.7 } + 0.1 * (i % 5) as f64);
        for _ in 0..POWERS {
            product(v, w);
            let n = norm(w);
            if !(n > 0.0 && n.is_finite()) {
                return (0.0, false);
            }
            v.iter_mut().zip(w.iter()).for_each(|(v, w)| *v = w / n);
        }
        product(v, w);
        product(w, z);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (vv, vw, ww, vz, wz) = (dot(v, v), dot(v, w), dot(w, w), dot(v, z), dot(w, z));
        let det = vv * ww - vw * vw;
        if det <= 1e-6 * vv * ww {
            // one real mode
            let value = vw / vv;
            return (value.abs(), value < 0.0);
        }
        let (c1, c0) = ((vv * wz - vw * vz) / det, (ww * vz - vw * wz) / det);
        let discriminant = 0.25 * c1 * c1 + c0;
        if discriminant >= 0.0 {
            let root = discriminant.sqrt();
            let (a, b) = (0.5 * c1 + root, 0.5 * c1 - root);
            let fastest = if a.abs() >= b.abs() { a } else { b };
            // two modes that take turns are none that is damped
            let both = (a + b).abs() < 0.1 * (a.abs() + b.abs());
            return (fastest.abs(), !both && fastest < 0.0);
        }
        let modulus = (-c0).sqrt();
        // damped within a fraction of a turn
        (modulus, 0.5 * c1 < -0.5 * modulus)
    }

    /// Back to the explicit pair where it is stable with the steps that accuracy allows, by a bound on the Jacobian
    /// that leaves room so that the methods do not take turns.
    fn watch_mildness(&mut self) {
        if self.stepper.radau.speed() * self.stepper.step.h > MILD * self.stepper.pair.stability() {
            self.stepper.mild_steps = 0;
            return;
        }
        self.stepper.mild_steps += 1;
        if self.stepper.mild_steps < MILD_STEPS {
            return;
        }
        (self.stepper.implicit, self.stepper.stiff_mode) = (false, false);
        (self.stepper.stiff_steps, self.stepper.mild_steps) = (0, 0);
        self.set_pace(Pace::Mild);
    }

    /// The present mode is stiff from here on.
    pub(super) fn turn_stiff(&mut self) {
        (self.stepper.implicit, self.stepper.stiff_mode) = (true, true);
        if self.field.n_alg() > 0 {
            for (stiff, set) in self.stepper.stiff_slides.iter_mut().zip(&self.field.active) {
                *stiff |= set.len() > 1;
            }
            return;
        }
        self.set_pace(Pace::Stiff);
    }

    /// Notes how fast the present mode is.
    fn set_pace(&mut self, pace: Pace) {
        if self.field.active.is_empty() {
            let none = self.stepper.stiff.len() - 1;
            self.stepper.stiff[none] = pace;
        }
        for c in self.field.active_cells() {
            self.stepper.stiff[c] = pace;
        }
    }

    /// What the dense output of a step that is to be accepted is off by, relative to the tolerances, where somebody is to see it and the step is near the limit of the
    /// stability of its pair. The error of the end says nothing about it there.
    pub(super) fn error_seen_inside(&mut self, t1: f64) -> Result<f64> {
        if self.stepper.step_implicit
            || self.log.path.is_none() && !self.log.sampled.are_wanted(t1)
            || self.field.is_explicit_only()
            || self.field.in_limit_set()
        {
            return Ok(0.0);
        }
        let (pair, weights) = (self.stepper.pair, &self.stepper.weights);
        if explicit::stiffness(pair, &self.stepper.step, weights).0 <= NEAR * pair.stability() {
            return Ok(0.0);
        }
        let r = self.write_dense();
        if !recover(r.map(|()| true), false)? {
            return Ok(0.0);
        }
        self.error_inside()
    }

    /// No step ends at the zero that the dense output of an explicit pair had. Where the step was near the limit of the
    /// stability of the pair, that output shows what the pair does and not the solution.
    pub(super) fn note_failed_landing(&mut self) {
        /// How many steps that look stiff it is worth.
        const WORTH: usize = 4;
        if self.stepper.implicit
            || self.options.method != Method::Auto
            || self.field.is_explicit_only()
            || self.stepper.stiffness <= NEAR * self.stepper.pair.stability()
        {
            return;
        }
        self.stepper.mild_steps = 0;
        self.stepper.stiff_steps += WORTH;
        if self.stepper.stiff_steps >= STIFF_STEPS {
            self.turn_stiff();
            self.stepper.step_implicit = true;
        }
    }

    /// The last attempt has failed: was it beyond the stability of the explicit pair, by a speed that one before it has shown too? (Next to
    /// where a function like `sqrt |x|` has no slope speeds have no limit, and every attempt shows another one.) Where the length comes down
    /// to what is stable by failures alone, a mode has begun that is faster than the solution was, and as long as nothing else is
    /// known of it an implicit method follows it: through a fast transient it goes as well, and where steps turn out to be those
    /// that an explicit pair would be stable with, that comes back. At the border of stability, where the usual test would find it
    /// out, the state is noise of the size of the tolerances, and surfaces that are closer than that are crossed at random.
    pub(super) fn is_beyond_stability(&mut self, beyond: &mut Beyond) -> Result<bool> {
        /// How far beyond at least.
        const FAR: f64 = 2.0;
        /// Speeds that are the same, seen by attempts one of which is so much shorter.
        const SAME: f64 = 2.0;
        const SHORTER: f64 = 0.25;
        let mild = |c: usize| self.stepper.stiff[c] == Pace::Mild;
        let known =
            self.field.active.is_empty() && mild(self.stepper.stiff.len() - 1) || self.field.active_cells().any(mild);
        if self.stepper.implicit
            || known
            || self.options.method != Method::Auto
            || self.field.is_explicit_only()
            || self.field.has_contacts()
        {
            return Ok(false);
        }
        beyond.attempts += 1;
        let high = self.stepper.pair == Pair::Dop853;
        if beyond.attempts == 1 {
            beyond.longest = self.stepper.step.h;
            // one failure is nothing special, and for this pair a look costs an evaluation
            if high {
                return Ok(false);
            }
        }
        let r =
            if high { explicit::finish(self.stepper.pair, &mut self.field, &mut self.stepper.step) } else { Ok(()) };
        let known = recover(r.map(|()| true), false)?;
        let (reach, _) = explicit::stiffness(self.stepper.pair, &self.stepper.step, &self.stepper.weights);
        if !known || reach <= FAR * self.stepper.pair.stability() {
            beyond.seen = None;
            return Ok(false);
        }
        let (h, speed) = (self.stepper.step.h, reach / self.stepper.step.h);
        match beyond.seen {
            Some((length, _)) if h > SHORTER * length => Ok(false),
            Some((_, before)) if speed <= SAME * before && before <= SAME * speed => Ok(true),
            _ => {
                beyond.seen = Some((h, speed));
                Ok(false)
            }
        }
    }

    /// Stiffness lasts: it is enough to look for it now and then, by the number of the step.
    fn looks_for_stiffness(&self, step: usize) -> bool {
        self.stepper.stiff_steps > 0 || step % LOOK == 0
    }

    pub(super) fn watch_stiffness(&mut self) {
        let slides = self.stepper.implicit && self.field.n_alg() > 0;
        if self.options.method != Method::Auto || self.field.is_explicit_only() || slides {
            return;
        }
        if self.stepper.implicit {
            self.watch_mildness();
            return;
        }
        if !self.looks_for_stiffness(self.log.stats.steps) {
            return;
        }
        // Error control keeps the step a little below the limit of stability, where the embedded result is off: a damped mode that
        // steps of that length go on and on with is gone by many orders of magnitude, and nothing but stability is left of it. Not so
        // in a sliding mode that comes to rest like the root of a state, which gets ever faster.
        let damped = self.stepper.damped && self.field.n_alg() == 0;
        let limit = if damped { DAMPED } else { 1.0 } * self.stepper.pair.stability();
        if self.stepper.stiffness > limit {
            self.stepper.mild_steps = 0;
            self.stepper.stiff_steps += 1;
            if self.stepper.stiff_steps >= STIFF_STEPS {
                self.turn_stiff();
            }
        } else {
            self.stepper.mild_steps += 1;
            if self.stepper.mild_steps >= 6 {
                self.stepper.stiff_steps = 0;
            }
        }
    }

    /// Length of the first step. With `d0`, `d1`, `d2` the sizes of the state and of its first two derivatives relative
    /// to the tolerance, the shorter of `d0 / d1` and `sqrt(d0 / d2)` is the time in which the state changes by its own
    /// size, and a method of order `p` makes an error of a hundredth of the tolerance, by the rule of E. Hairer,
    /// S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I* (1993), section II.4, in a step of the
    /// `p`-th root of `0.01 / d0` of it. There the unit of time takes the place of that time.
    ///
    /// Where the motion does not depend on the time itself, a state whose velocity is rounding stays where it is: the second derivative is then
    /// that over the whole interval.
    pub(super) fn initial_step(&mut self, longest: f64) -> Result<f64> {
        /// Share of the interval that nothing is known about.
        const BLIND: f64 = 1e-6;
        let most = longest.min(self.options.h_max);
        if self.options.h0 > 0.0 {
            return Ok(self.options.h0.min(most));
        }
        let largest = self.x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for i in 0..self.nx {
            let size = self.field.size(i, self.x[i]);
            // without an absolute tolerance a component that happens to be zero says nothing about its size
            let value = if size > 0.0 { self.x[i].abs() } else { BLIND * largest };
            let tol = self.atol[i] + self.rtol[i] * value;
            self.stepper.weights[i] = 1.0 / tol.max(f64::MIN_POSITIVE);
            self.stepper.node[i] = size;
        }
        let norm = |v: &[f64]| step::norm(v, &self.stepper.weights);
        let (d0, d1) = (norm(&self.stepper.node), norm(&self.f));
        let first = if d0 > 0.0 && d1 > 0.0 { d0 / d1 } else { f64::INFINITY };
        let stays = first >= most / BLIND && !self.stepper.timed;
        let h = (0.01 * first).min(if first < most / BLIND || stays { most } else { BLIND * most });
        for ((y, x), f) in self.stepper.node.iter_mut().zip(&self.x).zip(&self.f) {
            *y = x + h * f;
        }
        let r = self.field.rhs(self.t + h, &self.stepper.node, &mut self.stepper.step.f);
        if !recover(r.map(|()| true), false)? {
            return Ok(h);
        }
        for (a, b) in self.stepper.step.f.iter_mut().zip(&self.f) {
            *a -= b;
        }
        let d2 = step::norm(&self.stepper.step.f, &self.stepper.weights) / h;
        let second = if d0 > 0.0 && d2 > 0.0 { (d0 / d2).sqrt() } else { f64::INFINITY };
        let order = if self.stepper.implicit { 4.0 } else { self.stepper.pair.order() };
        let own = first.min(second);
        let h1 = match own.is_finite() {
            true => own * (0.01 / d0).powf(1.0 / order).min(1.0),
            false if stays => most,
            false => BLIND.sqrt() * most,
        };
        Ok((100.0 * h).min(h1).min(most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_steps_are_as_short_as_before_where_that_happens_often() {
        let mut f = FirstStep::default();
        f.note(0.1, true);
        assert_eq!(f.longest(), f64::INFINITY);
        f.note(0.2, true);
        assert_eq!(f.longest(), 0.2);
        f.allow(0.3);
        assert_eq!(f.longest(), 0.3);
        // now and then one begins as if nothing were known
        let free = (0..16).filter(|_| {
            let free = f.longest().is_infinite();
            f.note(0.2, true);
            free
        });
        assert_eq!(free.count(), 2);
        // and where that passes, all do
        while f.longest().is_finite() {
            f.note(0.2, true);
        }
        f.note(1.0, false);
        assert_eq!(f.longest(), f64::INFINITY);
    }
}
