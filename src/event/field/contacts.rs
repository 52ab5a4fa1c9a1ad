//! Contacts of a scene, as the engine watches them.

use super::near::Near;
use super::Field;
use crate::contact::{mode, Block, Dynamics};
use crate::event::step::{Stages, Step};
use crate::event::watch::{ContactWatch, Scale, Watch};
use crate::func::{EvalError, EvalResult, Point};
use crate::system::Mechanics;
use std::sync::Arc;

/// Values watched of one contact: gap, normal force, two more by its mode; then their rates, NaN where they are not known.
pub(in crate::event) const WATCHED: usize = 8;
/// From a value to its rate.
pub(in crate::event) const TO_RATE: usize = 4;

/// Contacts with their places among what is watched.
pub(in crate::event) struct Contacts {
    pub(in crate::event) dynamics: Dynamics,
    /// Place of the first value.
    q0: usize,
    /// Sizes of gap, normal force, sliding velocity and rate of the gap, of every contact.
    pub(in crate::event) sizes: Vec<[f64; 4]>,
    /// The point of the last right-hand side.
    last_t: f64,
    last_x: Vec<f64>,
    known: bool,
    /// The gradients of a gap and of its rate.
    rows: Vec<f64>,
    near: Near,
    /// Values of forces at the stages of the present step, three for every contact, and the stage that comes next; none where
    /// nobody wants them.
    traces: Vec<Stages>,
    stage: Option<usize>,
}

impl Contacts {
    pub(super) fn new(mechanics: &Arc<Mechanics>, q0: usize, nx: usize, n_z: usize) -> Contacts {
        let dynamics = Dynamics::new(mechanics);
        Contacts {
            sizes: vec![[0.0; 4]; dynamics.n_contacts()],
            dynamics,
            q0,
            last_t: 0.0,
            last_x: vec![0.0; nx],
            known: false,
            rows: vec![0.0; 2 * n_z],
            near: Near::new(mechanics),
            traces: vec![[0.0; 16]; 3 * mechanics.contacts.len()],
            stage: None,
        }
    }

    /// Place of the first value of contact `i`.
    pub(in crate::event) fn place(&self, i: usize) -> usize {
        self.q0 + WATCHED * i
    }

    /// Is contact `i` looked at in the present step?
    pub(in crate::event) fn is_near(&self, i: usize) -> bool {
        self.near.near[i]
    }

    /// The accelerations are no longer those of the present modes.
    pub(in crate::event) fn forget(&mut self) {
        self.known = false;
    }
}

impl Field {
    /// Does the system have contacts?
    pub(in crate::event) fn has_contacts(&self) -> bool {
        self.contacts.is_some()
    }

    /// Does a contact slide in space?
    pub(in crate::event) fn slides_in_space(&self) -> bool {
        self.contacts.as_ref().is_some_and(|c| {
            let all = self.active.iter().zip(&c.dynamics.mechanics.contacts);
            all.into_iter().any(|(set, contact)| contact.n_tangents == 2 && Dynamics::slides(set[0]))
        })
    }

    /// The contacts, if the system has any.
    pub(in crate::event) fn scene(&self) -> Option<&Contacts> {
        self.contacts.as_deref()
    }

    /// Runs `f` with the dynamics at a point.
    pub(in crate::event) fn with_contacts<T>(
        &mut self,
        t: f64,
        x: &[f64],
        f: impl FnOnce(&mut Contacts, &Point, &[Vec<usize>]) -> T,
    ) -> Option<T> {
        let mut contacts = self.contacts.take()?;
        let at = Point { t, x, u: &self.u, p: &self.p };
        let out = f(&mut contacts, &at, &self.active);
        self.contacts = Some(contacts);
        Some(out)
    }

    /// Right-hand side of a scene.
    pub(super) fn scene_rhs(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let Some(c) = &mut self.contacts else { return Ok(()) };
        let at = Point { t, x, u: &self.u, p: &self.p };
        if c.is_at(&at) {
            c.dynamics.write(out);
            c.trace();
            return Ok(());
        }
        self.counts.values += 1;
        c.known = false;
        c.dynamics.rhs(&at, &self.active, out)?;
        c.last_t = t;
        c.last_x.copy_from_slice(x);
        c.known = true;
        c.trace();
        Ok(())
    }

    /// Jacobian of the right-hand side of a scene.
    pub(super) fn scene_jacobian(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let r = self.with_contacts(t, x, |c, at, modes| {
            c.known = false;
            c.dynamics.jacobian(at, modes, out, None)
        });
        r.unwrap_or(Ok(()))
    }

    /// Writes the watched values of all contacts under their modes.
    pub(super) fn scene_watched(&mut self, t: f64, x: &[f64]) -> EvalResult {
        let mut q = std::mem::take(&mut self.q);
        let mut evaluated = 0;
        let r = self.with_contacts(t, x, |c, at, modes| {
            let first_order = c.dynamics.is_first_order();
            // rates of open constraints are those under the present field
            let mut closed = first_order;
            for (i, set) in modes.iter().enumerate() {
                if set[0] == mode::OPEN && !c.near.near[i] {
                    continue;
                }
                if set[0] == mode::OPEN {
                    c.dynamics.load_gap(at, i)?;
                    let place = c.place(i);
                    let [gap, rate] = c.dynamics.block(i).gap;
                    (q[place], q[place + TO_RATE]) = (gap, rate);
                } else {
                    closed = true;
                }
            }
            if !closed {
                return Ok(());
            }
            evaluated = c.accelerate(at, modes)?;
            for (i, set) in modes.iter().enumerate() {
                let place = c.place(i);
                if set[0] == mode::OPEN {
                    if first_order {
                        c.dynamics.load_contact(at, i)?;
                        q[place + TO_RATE] = c.dynamics.gap_acceleration(i);
                    }
                    continue;
                }
                c.write(at, i, set[0], &mut q[place..place + WATCHED])?;
            }
            Ok(())
        });
        self.q = q;
        self.counts.values += evaluated;
        r.unwrap_or(Ok(()))
    }

    /// Writes the values, without rates, of the contacts for which `wanted` holds, those of forces only if they are asked for; and those of
    /// guards.
    pub(in crate::event) fn scene_values(
        &mut self,
        (t, x): (f64, &[f64]),
        forces: bool,
        wanted: impl Fn(usize) -> bool,
    ) -> EvalResult {
        let mut q = std::mem::take(&mut self.q);
        let mut evaluated = 0;
        let r = self.with_contacts(t, x, |c, at, modes| {
            if forces {
                evaluated = c.accelerate(at, modes)?;
            }
            for (i, set) in modes.iter().enumerate().filter(|(i, _)| wanted(*i)) {
                let place = c.place(i);
                if set[0] == mode::OPEN {
                    c.dynamics.load_gap(at, i)?;
                    q[place] = c.dynamics.block(i).gap[0];
                    continue;
                }
                c.write(at, i, set[0], &mut q[place..place + WATCHED])?;
            }
            Ok(())
        });
        self.q = q;
        self.counts.values += evaluated;
        r.unwrap_or(Ok(()))?;
        self.watched_beside(t, x)
    }

    /// A watched function and its rate for a velocity, where they take no accelerations.
    pub(in crate::event) fn contact_alone(
        &mut self,
        (contact, what): (usize, ContactWatch),
        (t, x): (f64, &[f64]),
        velocity: &[f64],
    ) -> Result<Option<(f64, f64)>, EvalError> {
        let r = self.with_contacts(t, x, |c, at, modes| match what {
            ContactWatch::Gap if !c.dynamics.is_first_order() => {
                c.dynamics.load_gap(at, contact)?;
                let [gap, rate] = c.dynamics.block(contact).gap;
                Ok(Some((gap, rate)))
            }
            ContactWatch::Speed => {
                c.dynamics.load_contact(at, contact)?;
                let d = c.dynamics.direction(contact, modes[contact][0]);
                Ok(Some((c.speed(contact, d), c.dynamics.sliding_acceleration_of(contact, d, velocity))))
            }
            _ => Ok(None),
        });
        r.unwrap_or(Ok(None))
    }

    /// The stages of an explicit step begin, the first of them, at its start, is known: forces at them are noted.
    pub(in crate::event) fn begin_stages(&mut self) {
        if let Some(c) = &mut self.contacts {
            c.stage = Some(1);
        }
    }

    /// No more stages come.
    pub(in crate::event) fn end_stages(&mut self) {
        if let Some(c) = &mut self.contacts {
            c.stage = None;
        }
    }

    /// Values of a force of a contact at the stages of the last explicit step, but the first.
    pub(in crate::event) fn force_at_stages(&self, contact: usize, what: ContactWatch) -> Option<&Stages> {
        let k = match what {
            ContactWatch::Pressure => 0,
            ContactWatch::Cone(sign) if sign > 0.0 => 1,
            ContactWatch::Cone(_) => 2,
            ContactWatch::Gap | ContactWatch::Speed => return None,
        };
        self.contacts.as_ref().map(|c| &c.traces[3 * contact + k])
    }

    /// Finds the contacts that others hold back, at the point of the last right-hand side; see [`Dynamics::find_carried`].
    pub(in crate::event) fn find_carried(&mut self, x: &[f64]) {
        let floor = &self.floor;
        let Some(c) = &mut self.contacts else { return };
        let n_q = c.dynamics.mechanics.n_q;
        let t = c.last_t;
        let size = |b: &Block| b.sliding_size(n_q, (t, x), floor);
        c.dynamics.find_carried(&self.active, &size);
    }

    /// Decides which contacts are looked at in a step; false where all are, always.
    pub(in crate::event) fn look_near(&mut self, s: &Step, implicit: bool) -> bool {
        let any = self.with_contacts(s.t, &s.x0, |c, at, modes| {
            let Contacts { near, dynamics, .. } = c;
            near.look(&dynamics.mechanics, (s, implicit), at, |i| modes[i][0] == mode::OPEN)
        });
        any.unwrap_or(false)
    }

    /// Is a watched function looked at in the present step? Those of contacts that are far are not.
    pub(in crate::event) fn looks_at(&self, w: &Watch) -> bool {
        match (w, &self.contacts) {
            (Watch::Contact { contact, .. }, Some(c)) => c.near.near[*contact],
            _ => true,
        }
    }

    /// A step is accepted.
    pub(in crate::event) fn accept_near(&mut self, s: &Step, implicit: bool) {
        if let Some(c) = &mut self.contacts {
            c.near.accept(s, implicit);
        }
    }

    /// All contacts are looked at again.
    pub(in crate::event) fn look_at_all(&mut self) {
        if let Some(c) = &mut self.contacts {
            c.near.reset();
        }
    }

    /// A motion begins: no contact is held back by others yet, whatever was so at the end of the last one.
    pub(in crate::event) fn carry_none(&mut self) {
        if let Some(c) = &mut self.contacts {
            c.dynamics.carried.fill(false);
            c.dynamics.begins.fill(0.0);
        }
    }

    /// The gap of an open contact and its rate where a step begins, if they are not known there.
    pub(in crate::event) fn approach(&mut self, i: usize, s: &Step) -> Result<Option<[f64; 2]>, EvalError> {
        let floor = std::mem::take(&mut self.floor);
        let r = self.with_contacts(s.t, &s.x0, |c, at, modes| {
            if std::mem::replace(&mut c.near.known[i], true) {
                return Ok(None);
            }
            c.sizes[i] = c.sizes_of(i, modes[i][0], at, &floor)?;
            c.dynamics.load_gap(at, i)?;
            Ok(Some(c.dynamics.block(i).gap))
        });
        self.floor = floor;
        r.unwrap_or(Ok(None))
    }

    /// The gradient of a watched function of a contact with respect to `x`, `p`, `u`, `t`.
    pub(in crate::event) fn contact_gradient(
        &mut self,
        (contact, what): (usize, ContactWatch),
        (t, x): (f64, &[f64]),
        out: &mut [f64],
    ) -> EvalResult {
        let r = self.with_contacts(t, x, |c, at, modes| {
            c.known = false;
            c.gradient(contact, what, at, modes, out)
        });
        r.unwrap_or(Ok(()))
    }

    /// Finds the sizes that what is watched of the contacts is compared with, at a point whose right-hand side has just been
    /// evaluated.
    pub(in crate::event) fn contact_sizes(&mut self, t: f64, x: &[f64]) -> EvalResult {
        let floor = std::mem::take(&mut self.floor);
        let r = self.with_contacts(t, x, |c, at, modes| {
            for i in 0..modes.len() {
                let looked = modes[i][0] != mode::OPEN || c.near.near[i];
                if looked {
                    c.sizes[i] = c.sizes_of(i, modes[i][0], at, &floor)?;
                }
                (c.near.near[i], c.near.known[i]) = (looked, looked);
            }
            c.raise_force_sizes();
            Ok(())
        });
        self.floor = floor;
        r.unwrap_or(Ok(()))
    }

    /// Finds the sizes of the closed contacts, and of that of an event, anew at the event: a phase that began at rest knew
    /// no velocities.
    pub(in crate::event) fn renew_sizes(&mut self, t: f64, x: &[f64], event: Option<usize>) -> EvalResult {
        let floor = std::mem::take(&mut self.floor);
        let r = self.with_contacts(t, x, |c, at, modes| {
            for (i, set) in modes.iter().enumerate() {
                if set[0] == mode::OPEN && event != Some(i) {
                    continue;
                }
                let (new, old) = (c.sizes_of(i, set[0], at, &floor)?, &mut c.sizes[i]);
                // forces that vanish here had a size before
                new.iter().zip(old.iter_mut()).for_each(|(n, o)| *o = o.max(*n));
            }
            c.raise_force_sizes();
            Ok(())
        });
        self.floor = floor;
        r.unwrap_or(Ok(()))
    }

    /// Sizes of a watched function of a contact.
    pub(in crate::event) fn contact_scale(&self, contact: usize, what: ContactWatch) -> Scale {
        let size = self.contacts.as_ref().map_or(1.0, |c| {
            let s = c.sizes[contact];
            match what {
                ContactWatch::Gap => s[0],
                ContactWatch::Pressure | ContactWatch::Cone(_) => s[1],
                ContactWatch::Speed => s[2],
            }
        });
        Scale { value: size, reach: size }
    }

    /// Adds what is watched under the present modes.
    pub(in crate::event) fn contact_watches(&self, out: &mut Vec<Watch>) {
        let Some(c) = &self.contacts else { return };
        for (contact, set) in self.active.iter().enumerate() {
            let place = c.place(contact);
            let mut add = |what: ContactWatch, k: usize| out.push(Watch::Contact { contact, what, a: place + k });
            let n_t = c.dynamics.mechanics.contacts[contact].n_tangents;
            if set[0] == mode::OPEN {
                add(ContactWatch::Gap, 0);
                continue;
            }
            if c.dynamics.opens(contact) {
                add(ContactWatch::Pressure, 1);
            }
            if Dynamics::slides(set[0]) {
                if n_t > 0 && !c.dynamics.carried[contact] {
                    add(ContactWatch::Speed, 2);
                }
            } else if n_t == 1 {
                add(ContactWatch::Cone(1.0), 2);
                add(ContactWatch::Cone(-1.0), 3);
            } else if n_t == 2 {
                add(ContactWatch::Cone(1.0), 2);
            }
        }
    }
}

impl Contacts {
    /// Sliding velocity of a contact along a direction, in space until it counts as zero.
    fn speed(&self, i: usize, direction: [f64; 2]) -> f64 {
        let d = &self.dynamics;
        let (n, s) = (d.mechanics.contacts[i].n_tangents, d.block(i).sliding);
        (0..n).map(|k| direction[k] * s[k]).sum::<f64>() - if n == 2 { d.stop(i) } else { 0.0 }
    }

    /// Was the right-hand side evaluated here last?
    pub(in crate::event) fn is_at(&self, at: &Point) -> bool {
        self.known && self.last_t == at.t && self.last_x == at.x
    }

    /// Notes the forces of closed contacts at a stage.
    fn trace(&mut self) {
        let Some(stage) = self.stage else { return };
        self.stage = Some(stage + 1);
        let d = &self.dynamics;
        for i in d.closed() {
            let (f, mu) = (d.forces[i], d.block(i).stiction);
            let cones = match d.mechanics.contacts[i].n_tangents {
                0 => [0.0; 2],
                1 => [mu * f[0] - f[1], mu * f[0] + f[1]],
                _ => [mu * f[0] - f[1].hypot(f[2]); 2],
            };
            for (k, v) in [f[0], cones[0], cones[1]].into_iter().enumerate() {
                self.traces[3 * i + k][stage.min(15)] = v;
            }
        }
    }

    /// Accelerations and forces at a point, if they are not known there. Says how often they were evaluated.
    fn accelerate(&mut self, at: &Point, modes: &[Vec<usize>]) -> Result<usize, EvalError> {
        if self.is_at(at) {
            return Ok(0);
        }
        self.known = false;
        self.dynamics.accelerate(at, modes)?;
        Ok(1)
    }

    /// Values and rates of a closed contact after an evaluation.
    fn write(&mut self, at: &Point, i: usize, m: usize, q: &mut [f64]) -> EvalResult {
        if Dynamics::slides(m) && self.dynamics.mechanics.contacts[i].n_tangents > 0 {
            // flat contacts are not evaluated anew for the forces
            self.dynamics.load_contact(at, i)?;
        }
        let d = &self.dynamics;
        let (b, f) = (d.block(i), d.forces[i]);
        q.fill(f64::NAN);
        q[1] = f[0];
        match (d.mechanics.contacts[i].n_tangents, Dynamics::slides(m)) {
            (0, _) => {}
            (_, true) => {
                let dir = d.direction(i, m);
                q[2] = self.speed(i, dir);
                q[2 + TO_RATE] = d.sliding_acceleration(i, dir);
            }
            (1, false) => {
                q[2] = b.stiction * f[0] - f[1];
                q[3] = b.stiction * f[0] + f[1];
            }
            (_, false) => q[2] = b.stiction * f[0] - f[1].hypot(f[2]),
        }
        Ok(())
    }

    fn gradient(
        &mut self,
        i: usize,
        what: ContactWatch,
        at: &Point,
        modes: &[Vec<usize>],
        out: &mut [f64],
    ) -> EvalResult {
        out.fill(0.0);
        let n_z = out.len();
        let d = &mut self.dynamics;
        match what {
            ContactWatch::Gap => d.gap_gradient(at, i, out),
            ContactWatch::Speed => {
                let dir = d.direction(i, modes[i][0]);
                let mut rows = vec![0.0; 3 * n_z];
                d.friction_gradients(at, i, &mut rows)?;
                let n = d.mechanics.contacts[i].n_tangents;
                for k in 0..n {
                    let row = &rows[(1 + k) * n_z..(2 + k) * n_z];
                    out.iter_mut().zip(row).for_each(|(o, r)| *o += dir[k] * r);
                }
                Ok(())
            }
            ContactWatch::Pressure | ContactWatch::Cone(_) => {
                let nx = at.x.len();
                let mut jac = vec![0.0; nx * n_z];
                let mut forces = vec![0.0; 3 * modes.len() * n_z];
                d.jacobian(at, modes, &mut jac, Some(&mut forces))?;
                let own = &forces[3 * i * n_z..(3 * i + 3) * n_z];
                let ContactWatch::Cone(sign) = what else {
                    out.copy_from_slice(&own[..n_z]);
                    return Ok(());
                };
                let f = d.forces[i];
                let size = f[1].hypot(f[2]);
                let dir = match d.mechanics.contacts[i].n_tangents {
                    1 => [sign, 0.0],
                    _ if size > 0.0 => [f[1] / size, f[2] / size],
                    _ => [0.0; 2],
                };
                let mut bound = vec![0.0; n_z];
                d.bound_gradient(at, i, &mut bound)?;
                let mu = d.block(i).stiction;
                for (z, o) in out.iter_mut().enumerate() {
                    *o = mu * own[z] + f[0] * bound[z] - dir[0] * own[n_z + z] - dir[1] * own[2 * n_z + z];
                }
                Ok(())
            }
        }
    }

    /// The size of a contact force is at least that of its rounding, where others make more of it than it has, and at most
    /// the largest there is; what is a billionth of that is nothing in any case.
    fn raise_force_sizes(&mut self) {
        const NOTHING: f64 = 1e-9;
        let Contacts { dynamics, sizes, .. } = self;
        // the friction of joints is no force on a normal
        let normal = dynamics.closed().filter(|i| !dynamics.is_joint(*i));
        let largest = normal.map(|i| sizes[i][1]).fold(0.0, f64::max);
        for (i, size) in dynamics.force_roundings() {
            sizes[i][1] = sizes[i][1].max(size.clamp(NOTHING * largest, largest));
        }
    }

    fn sizes_of(&mut self, i: usize, m: usize, at: &Point, floor: &[f64]) -> Result<[f64; 4], EvalError> {
        let n_q = self.dynamics.mechanics.n_q;
        let sum = |row: &[f64], from: usize| {
            let states = at.x[from..].iter().zip(&floor[from..]);
            row.iter().zip(states).map(|(g, (x, f))| g.abs() * (x.abs() + f)).sum::<f64>()
        };
        let mut rows = std::mem::take(&mut self.rows);
        rows.fill(0.0);
        let known = self.dynamics.gap_gradient(at, i, &mut rows);
        let first_order = self.dynamics.is_first_order();
        let (own, of_rate) = rows.split_at(rows.len() / 2);
        let gap = sum(&own[..if first_order { at.x.len() } else { n_q }], 0) + (own[own.len() - 1] * at.t).abs();
        let rate = sum(&of_rate[n_q..at.x.len()], n_q) + self.dynamics.block(i).gap[1].abs();
        self.rows = rows;
        known?;
        let rate = match first_order {
            true => {
                self.dynamics.load_contact(at, i)?;
                self.dynamics.gap_rate_size(i)
            }
            false => rate,
        };
        let mut out = [gap, 0.0, 0.0, rate];
        if m != mode::OPEN {
            self.dynamics.load_contact(at, i)?;
            out[1] = self.dynamics.force_size(i);
            if self.dynamics.is_switch(i) {
                // what its weight is compared with
                out[1] = 1.0;
            } else if self.dynamics.is_joint(i) {
                out[1] = out[1].max(self.dynamics.block(i).stiction.abs());
            }
            out[2] = self.dynamics.block(i).sliding_size(n_q, (at.t, at.x), floor);
        }
        Ok(out)
    }
}
