//! The derivative of a gradient in one direction: forward over the adjoint.
//!
//! Along the tape a tangent `s` of the state goes forward, and the adjoint `v` with its derivative `w` goes back. Every entry moves the adjoint by a linear operator,
//! `v⁻ = Aᵀ v`, that depends on where it stands, so `w⁻ = Aᵀ w + (dA/dε)ᵀ v`. The derivative of the operator is a central difference of the same operator at
//! `x ± δ s` and `x ± 2 δ s`, with stages evaluated anew over the same step: nothing of error control is in it.
//!
//! At an event the time moves, too. The map from the state before to that behind, both at the time of the recorded event, goes on with the old mode for the time `τ`
//! to where the event happens, makes it there, and goes back by `τ` in the new mode. At the recorded point `τ = 0`, with `τ' = r s`, so
//! that the derivative of its transpose has two terms beside that of the saltation matrix (6.25) at the moved point `x + ε (s + f⁻ τ')`: `τ' f⁻_xᵀ` before it, and
//! `−τ' f⁺_xᵀ` behind it.

use super::{recovered, Gradient, Sweep, Times};
use crate::error::{Error, Result};
use crate::event::explicit::{self, Pair};
use crate::event::field::Field;
use crate::event::guard::Reset;
use crate::event::radau::Radau;
use crate::event::step::Step;
use crate::event::tape::{Entry, Event, Tape, Time};
use crate::event::watch::Watch;
use crate::func::{EvalError, EvalResult};
use crate::stop;

/// What a gradient is, and how it changes in one direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Along {
    /// The gradient itself.
    pub gradient: Gradient,
    /// Its derivative in the direction: the product of the Hessian with it.
    pub derivative: Gradient,
    /// The derivative of the final state in the direction.
    pub state: Vec<f64>,
}

struct Direction<'a> {
    sweep: Sweep<'a>,
    /// Of parameters, then controls.
    q: Vec<f64>,
    /// Parameters and controls that hold here.
    base: (Vec<f64>, Vec<f64>),
    /// Derivatives of the adjoint with respect to state, and parameters and controls.
    w: Vec<f64>,
    h: Vec<f64>,
    step: Step,
    reset: Reset,
    data: Vec<f64>,
}

/// Goes over the tape with the direction, and back from the derivative `v` with respect to the final state, which is the same in the whole direction. Leaves active
/// set, parameters and controls of the field changed.
pub(in crate::event) fn sweep(
    tape: &Tape,
    radau: &Radau,
    field: &mut Field,
    v: &[f64],
    direction: &Gradient,
) -> Result<Along> {
    let (nx, n_z) = (field.nx, field.n_z);
    let sweep = Sweep::new(tape, radau, field, v);
    let q: Vec<f64> = direction.p.iter().chain(&direction.u).copied().collect();
    let mut d = Direction {
        base: (sweep.field.p.clone(), sweep.field.u.clone()),
        sweep,
        w: vec![0.0; nx],
        h: vec![0.0; q.len()],
        q,
        step: Step::new(nx),
        reset: Reset::new(nx, n_z),
        data: Vec::new(),
    };
    let mut s = direction.x0.clone();
    let mut tangents = Vec::with_capacity(tape.entries.len());
    let armed = d.sweep.field.watch_alone(Vec::new());
    let done = d.go(&mut s, &mut tangents);
    d.sweep.field.watch_alone(armed);
    done?;
    let of = |x0: Vec<f64>, mut g: Vec<f64>, np: usize| {
        let u = g.split_off(np);
        Gradient { x0, p: g, u }
    };
    let np = direction.p.len();
    let Direction { sweep, w, h, .. } = d;
    Ok(Along { gradient: of(sweep.v, sweep.g, np), derivative: of(w, h, np), state: s })
}

impl Direction<'_> {
    /// Forward and back; the tangent before every entry, and the last one.
    fn go(&mut self, s: &mut Vec<f64>, tangents: &mut Vec<Vec<f64>>) -> Result<()> {
        let tape = self.sweep.tape;
        for (i, e) in tape.entries.iter().enumerate() {
            stop::check()?;
            tangents.push(s.clone());
            recovered(self.forward(i, e, s)?)?;
        }
        for (i, e) in tape.entries.iter().enumerate().rev() {
            stop::check()?;
            recovered(self.back(i, e, &tangents[i]))?;
        }
        Ok(())
    }

    fn load(&mut self, i: usize) {
        self.sweep.load(i);
        self.base.0.copy_from_slice(&self.sweep.field.p);
        self.base.1.copy_from_slice(&self.sweep.field.u);
    }

    /// Parameters and controls moved by so much of their direction.
    fn move_inputs(&mut self, by: f64) {
        let (f, (p, u)) = (&mut self.sweep.field, &self.base);
        let (of_p, of_u) = self.q.split_at(p.len());
        let moved = |to: &mut [f64], from: &[f64], q: &[f64]| {
            to.iter_mut().zip(from).zip(q).for_each(|((to, v), q)| *to = v + by * q);
        };
        moved(&mut f.p, p, of_p);
        moved(&mut f.u, u, of_u);
        f.forget();
    }

    /// How far to go in the direction for a central difference of fourth order: the root of fifth order of rounding, relative to the size of what moves
    /// fastest.
    fn reach(&self, x: &[f64], s: &[f64]) -> f64 {
        let f = &self.sweep.field;
        let or_one = |v: f64| if v > 0.0 { v } else { 1.0 };
        let of_states = x.iter().zip(s).enumerate().map(|(i, (x, s))| s.abs() / or_one(f.size(i, *x)));
        let inputs = || self.base.0.iter().chain(&self.base.1);
        let largest = or_one(inputs().fold(0.0, |m: f64, v| m.max(v.abs())));
        let of_inputs = inputs().zip(&self.q).map(|(v, q)| q.abs() / if *v == 0.0 { largest } else { v.abs() });
        match of_states.chain(of_inputs).fold(0.0, f64::max) {
            0.0 => 0.0,
            speed => f64::EPSILON.powf(0.2) / speed,
        }
    }

    /// Derivative of the time of an event, and with it what is moved to the event: the derivative of the state there.
    fn to_event(&self, row: &[f64], before: &[f64], s: &[f64]) -> (f64, Vec<f64>) {
        let (by_x, by_q) = row.split_at(s.len());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let dt = dot(by_x, s) + dot(by_q, &self.q);
        (dt, s.iter().zip(before).map(|(s, f)| s + f * dt).collect())
    }

    /// The tangent `s` behind an entry.
    fn forward(&mut self, i: usize, e: &Entry, s: &mut Vec<f64>) -> Result<EvalResult> {
        let (tape, nx) = (self.sweep.tape, s.len());
        let n_c = nx + self.q.len();
        match *e {
            Entry::Data { .. } => self.load(i + 1),
            Entry::Stop { .. } | Entry::Switch { time: Time::Fixed, .. } => {}
            Entry::Explicit { at, set, t, h, part, rest, pair, .. } => {
                self.sweep.enter(set);
                return Ok(self.forward_explicit(&tape.data[at..], (t, h, part, rest), pair, s));
            }
            Entry::Switch { at, time: Time::Moves, first, event, .. } => {
                event.ok_or_else(|| unknown(format!("switch {first}")))?;
                let (row, jump) = tape.data[at..at + n_c + nx].split_at(n_c);
                let (dt, _) = self.to_event(row, jump, s);
                s.iter_mut().zip(jump).for_each(|(s, j)| *s += j * dt);
            }
            Entry::Jump { at, n, log, event, .. } => {
                event.ok_or_else(|| unknown(format!("transition {log}")))?;
                let (row, rest) = tape.data[at..].split_at(n_c);
                let (before, rest) = rest.split_at(nx);
                let (after, resets) = rest.split_at(nx);
                let (dt, mut moved) = self.to_event(row, before, s);
                for jac in resets[..n * nx * (n_c + 1)].chunks_exact(nx * (n_c + 1)) {
                    let along = |r: &[f64]| {
                        let z = moved.iter().chain(&self.q).chain(std::iter::once(&dt));
                        r.iter().zip(z).map(|(r, z)| r * z).sum::<f64>()
                    };
                    moved = jac.chunks_exact(n_c + 1).map(along).collect();
                }
                *s = moved.iter().zip(after).map(|(s, f)| s - f * dt).collect();
            }
            Entry::Project { at, set, t } => {
                self.sweep.enter(set);
                let r = self.sweep.field.hidden(t, &tape.data[at..at + nx]);
                return Ok(r.map(|()| self.project(s)));
            }
            Entry::Implicit { t, .. } => {
                return Err(unsupported(t, "an implicit step, as stiff modes have: simulate with an explicit method"))
            }
            Entry::Gap { t } => return Err(unsupported(t, "steps through accumulating switches")),
            Entry::Switch { first, time: Time::Unknown, .. } => return Err(unknown(format!("switch {first}"))),
            Entry::Part { .. } => return Err(unknown("contacts that close together".into())),
        }
        Ok(Ok(()))
    }

    /// `s − D (C D)⁻¹ C s` where the field stands.
    fn project(&mut self, s: &mut [f64]) {
        let (f, nx) = (&mut self.sweep.field, s.len());
        let (r, last) = (f.n_alg(), f.n_z - 1);
        let along = |b: usize| -> f64 {
            f.c(b).filter(|c| c.0 < last).map(|(i, c)| c * if i < nx { s[i] } else { self.q[i - nx] }).sum()
        };
        let mut rhs: Vec<f64> = (0..r).map(along).collect();
        f.solve_constraints(1, &mut rhs);
        for (b, v) in rhs.iter().enumerate() {
            f.d(b).for_each(|(a, d)| s[a] -= d * v);
        }
    }

    fn forward_explicit(&mut self, data: &[f64], (t, h, part, rest): Times, pair: Pair, s: &mut [f64]) -> EvalResult {
        let (nx, rows) = (s.len(), pair.rows().0);
        let last = rows.len() - 1;
        let inside = self.sweep.read_step(data, (t, h, part, rest), pair)?;
        let n = last + usize::from(rest != 0.0 || inside.is_some());
        let at = |own: &mut [f64], k: &[Vec<f64>], weights: &mut dyn Iterator<Item = (usize, f64)>| {
            weights.for_each(|(j, a)| own.iter_mut().zip(&k[j]).for_each(|(o, k)| *o += h * a * k));
        };
        let mut k: Vec<Vec<f64>> = Vec::with_capacity(n);
        for i in 0..n {
            let mut own = s.to_vec();
            at(&mut own, &k, &mut rows[i].iter().copied());
            let jac = &self.sweep.jacobians[i];
            let z = |z: usize| if z < nx { own[z] } else { self.q[z - nx] };
            let of = |m| jac.entries(m).filter(|e| e.0 < nx + self.q.len()).map(|(i, a)| a * z(i)).sum::<f64>();
            k.push((0..nx).map(of).collect());
        }
        match &inside {
            Some(weights) => at(s, &k, &mut weights.iter().copied().enumerate().take(n)),
            None => {
                at(s, &k, &mut rows[last].iter().copied());
                if rest != 0.0 {
                    s.iter_mut().zip(&k[last]).for_each(|(s, k)| *s += rest * k);
                }
            }
        }
        if self.sweep.stand_at_end(&data[..nx], (t, h, part), pair, inside.as_ref())? {
            self.project(s);
        }
        Ok(())
    }

    /// Adjoint and its derivative before an entry, from those behind it; `s` is the tangent before it.
    fn back(&mut self, i: usize, e: &Entry, s: &[f64]) -> EvalResult {
        let (tape, nx) = (self.sweep.tape, s.len());
        let n_c = nx + self.q.len();
        match *e {
            Entry::Data { .. } => self.load(i),
            Entry::Explicit { at, set, t, h, part, rest, pair, .. } => {
                self.sweep.enter(set);
                let (data, times) = (&tape.data[at..], (t, h, part, rest));
                let by = self.reach(&data[..nx], s);
                let near = |d: &mut Self, by| {
                    d.repeat(&data[..nx], s, times, pair, by)?;
                    let own = std::mem::take(&mut d.data);
                    let r = d.sweep.explicit(&own, times, pair);
                    d.data = own;
                    r
                };
                self.differentiate(by, |d| d.sweep.explicit(data, times, pair), near)?;
            }
            Entry::Switch { at, time: Time::Moves, event: Some(event), .. } => {
                let data = &tape.data[at..at + n_c + nx];
                self.event(&tape.events[event], &data[..n_c], s, |d| {
                    d.sweep.switch(data, 0.0);
                    Ok(())
                })?;
            }
            Entry::Jump { at, n, event: Some(event), .. } => {
                let data = &tape.data[at..];
                self.event(&tape.events[event], &data[..n_c], s, |d| {
                    d.sweep.jump(data, n, 0.0);
                    Ok(())
                })?;
            }
            Entry::Project { at, set, t } => {
                self.sweep.enter(set);
                let x = &tape.data[at..at + nx];
                let project = |d: &mut Self, by: f64| {
                    let y: Vec<f64> = x.iter().zip(s).map(|(x, s)| x + by * s).collect();
                    d.sweep.field.hidden(t, &y)?;
                    d.sweep.project();
                    Ok(())
                };
                let by = self.reach(x, s);
                self.differentiate(by, |d| project(d, 0.0), project)?;
            }
            // the others do not move the adjoint, or the way forward has refused them
            _ => {}
        }
        Ok(())
    }

    /// Moves adjoint and derivative by an operator, `base`, that is `near(by)` at a distance in the direction.
    fn differentiate(
        &mut self,
        by: f64,
        base: impl Fn(&mut Self) -> EvalResult,
        near: impl Fn(&mut Self, f64) -> EvalResult,
    ) -> EvalResult {
        let (v, g) = (self.sweep.v.clone(), self.sweep.g.clone());
        let (mut dv, mut dg) = (vec![0.0; v.len()], vec![0.0; g.len()]);
        // nothing moves where the distance is zero
        let points = if by == 0.0 { 0 } else { 4 };
        for (steps, weight) in
            [(-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0)].into_iter().take(points)
        {
            let (weight, by) = (weight / by, steps * by);
            self.sweep.v.copy_from_slice(&v);
            self.sweep.g.fill(0.0);
            self.move_inputs(by);
            let r = near(self, by);
            self.move_inputs(0.0);
            r?;
            dv.iter_mut().zip(&self.sweep.v).for_each(|(d, v)| *d += weight * v);
            dg.iter_mut().zip(&self.sweep.g).for_each(|(d, g)| *d += weight * g);
        }
        self.sweep.v.copy_from_slice(&self.w);
        self.sweep.g.copy_from_slice(&self.h);
        base(self)?;
        self.w.iter_mut().zip(&self.sweep.v).zip(dv).for_each(|((w, v), d)| *w = v + d);
        self.h.iter_mut().zip(&self.sweep.g).zip(dg).for_each(|((h, g), d)| *h = g + d);
        (self.sweep.v, self.sweep.g) = (v, g);
        base(self)
    }

    /// What the tape would have of a step of the same length from `x0 + by s`.
    fn repeat(&mut self, x0: &[f64], s: &[f64], (t, h, part, _): Times, pair: Pair, by: f64) -> EvalResult {
        let (step, field) = (&mut self.step, &mut *self.sweep.field);
        (step.t, step.h) = (t, h);
        step.x0.iter_mut().zip(x0.iter().zip(s)).for_each(|(y, (x, s))| *y = x + by * s);
        field.rhs(t, &step.x0, &mut step.f0)?;
        explicit::attempt(pair, field, step)?;
        let last = pair.rows().0.len() - 1;
        self.data.clear();
        self.data.extend_from_slice(&step.x0);
        for j in 0..last + usize::from(part < 1.0) {
            self.data.extend(step.k.iter().map(|k| k[j]));
        }
        field.write_traces(last, &mut self.data);
        Ok(())
    }

    /// Moves adjoint and derivative over an event, whose time has the derivatives `row`; `base` is its operator.
    fn event(&mut self, e: &Event, row: &[f64], s: &[f64], base: impl Fn(&mut Self) -> EvalResult) -> EvalResult {
        let (dt, moved) = self.to_event(row, &e.f, s);
        let behind = self.happen(e, e.t, &e.x)?;
        let v = self.sweep.v.clone();
        if !e.ends {
            self.add_velocity(e.after, (e.t, &behind), -dt, &v)?;
        }
        let by = self.reach(&e.x, &moved);
        self.differentiate(by, base, |d, by| {
            let y: Vec<f64> = e.x.iter().zip(&moved).map(|(x, s)| x + by * s).collect();
            d.happen(e, e.t + by * dt, &y)?;
            let data = std::mem::take(&mut d.data);
            d.sweep.jump(&data, e.made.len(), 0.0);
            d.data = data;
            Ok(())
        })?;
        let v = self.sweep.v.clone();
        self.add_velocity(e.before, (e.t, &e.x), dt, &v)
    }

    /// What the tape would have of an event at this point; the state behind it.
    fn happen(&mut self, e: &Event, t: f64, y: &[f64]) -> std::result::Result<Vec<f64>, EvalError> {
        let (tape, field, nx) = (self.sweep.tape, &mut *self.sweep.field, y.len());
        let (mut f, mut row) = (vec![0.0; nx], vec![0.0; field.n_z]);
        field.set_active(&tape.sets[e.before]);
        field.watch_alone(if let Watch::Guard { guard, .. } = e.watch { vec![guard] } else { Vec::new() });
        field.rhs(t, y, &mut f)?;
        field.watched(t, y)?;
        field.watched_gradients(t, y)?;
        e.watch.time_gradient(field, (t, y, &f), &mut row)?;
        self.data.clear();
        self.data.extend_from_slice(&row[..field.n_z - 1]);
        self.data.extend_from_slice(&f);
        let (mut x, mut resets) = (y.to_vec(), Vec::new());
        for &g in &e.made {
            field.reset(g, (t, &x), true, &mut self.reset)?;
            resets.extend_from_slice(&self.reset.jac);
            if !e.ends {
                x.copy_from_slice(&self.reset.x);
            }
        }
        f.fill(0.0);
        if !e.ends {
            field.set_active(&tape.sets[e.after]);
            field.rhs(t, &x, &mut f)?;
        }
        self.data.extend_from_slice(&f);
        self.data.extend_from_slice(&resets);
        Ok(x)
    }

    /// Adds so much of the transpose of the derivatives of the velocity at a point to the derivative of the adjoint.
    fn add_velocity(&mut self, set: usize, (t, x): (f64, &[f64]), by: f64, v: &[f64]) -> EvalResult {
        let (tape, nx) = (self.sweep.tape, x.len());
        let n_c = nx + self.q.len();
        let field = &mut *self.sweep.field;
        field.set_active(&tape.sets[set]);
        field.rhs(t, x, &mut self.step.f)?;
        field.linearise(t, x)?;
        for (m, v) in v.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            for (z, a) in field.velocity_rows().entries(m).filter(|e| e.0 < n_c) {
                let to = if z < nx { &mut self.w[z] } else { &mut self.h[z - nx] };
                *to += by * v * a;
            }
        }
        Ok(())
    }
}

fn unknown(what: String) -> Error {
    Error::Unsupported(format!(
        "{what} has no second derivatives: its time is that of another event, or a zero of higher order"
    ))
}

fn unsupported(t: f64, what: &str) -> Error {
    Error::Unsupported(format!("t = {t}: no second derivatives through {what}"))
}
