//! Which open contacts a step has to look at.
//!
//! Every coordinate has a *budget*, about what it moves in a step, and a clock counts how many budgets the coordinates have
//! used up, the one that moves most for all of them. A contact whose gap is positive over the box of `k` budgets around a
//! point, by interval arithmetic that rounds outwards ([`crate::func::Function::bounds`]), stays open until the clock has
//! gone on by `k`, and is not looked at until then. What a step uses is known before it is accepted, so a contact that may
//! close in it is looked at in it. So no contact is missed whose coordinates move no faster between the stages of a step than
//! twice what they do at them. Contacts that share a lower bound of their gaps ([`Separation`]) are asked together first, and what a step costs grows with the contacts that can close soon. Gaps of which nothing is
//! known (callbacks), and contacts that are closed, are looked at in every step.

use crate::event::step::Step;
use std::sync::Arc;

use crate::func::{Function, Point};
use crate::system::{Contact, Mechanics, Separation};

/// Scenes with fewer contacts look at all of them.
const FEW: usize = 8;
/// How much faster than at the stages a coordinate may move between them.
const MARGIN: f64 = 2.0;
/// The step that is accepted may be longer by this than the one that was looked at.
const LONGER: f64 = 1.25;
/// A step may use so many budgets, or they are raised.
const MOST: f64 = 4.0;
/// Budgets of a box at most.
const FAR: f64 = 256.0;
/// Boxes tried for a contact.
const TRIES: usize = 3;
/// Accepted steps after which budgets may shrink.
const WINDOW: usize = 64;
/// What rounding adds to a box, relative to its size.
const INFLATE: f64 = 1.0 + 1e-9;

/// Contacts with one lower bound of their gaps.
struct Group {
    bound: Arc<Separation>,
    /// Until which time of the clock all of them are open.
    due: f64,
    closing: f64,
    /// Was it asked in this look?
    asked: bool,
}

/// What is known of the contacts that are open.
pub(super) struct Near {
    on: bool,
    /// Until which time of the clock a contact is open.
    due: Vec<f64>,
    /// The contacts to look at in the step.
    pub(super) near: Vec<bool>,
    /// Those whose values at the start of the step are known.
    pub(super) known: Vec<bool>,
    /// How much of a gap one budget takes, as far as it is known.
    closing: Vec<f64>,
    groups: Vec<Group>,
    /// The group of a contact.
    group: Vec<Option<usize>>,
    clock: f64,
    budget: Vec<f64>,
    /// The time that belongs to a budget.
    time: f64,
    /// Most that was used since budgets were last looked at.
    most: Vec<f64>,
    steps: usize,
    reach: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    work: Vec<f64>,
}

impl Near {
    pub(super) fn new(m: &Mechanics) -> Near {
        let n = m.contacts.len();
        let local = || m.contacts.iter().filter_map(|c| c.local.as_ref());
        // what never opens is looked at in any case
        let known = |c: &Contact| c.local.is_some() || !c.kind.opens();
        let (group, bounds) = Separation::groups(m.contacts.iter().map(|c| c.local.as_ref()));
        let functions = || local().map(|l| &l.gap).chain(bounds.iter().map(|b| &b.distance));
        let states = functions().map(|f| f.dims().x).max().unwrap_or(0);
        let work = functions().map(|f| 2 * f.work_len()).max().unwrap_or(0);
        let group_of = |bound| Group { bound, due: f64::NEG_INFINITY, closing: 0.0, asked: false };
        let groups = bounds.iter().cloned().map(group_of).collect();
        Near {
            on: n >= FEW && m.contacts.iter().all(known),
            due: vec![f64::NEG_INFINITY; n],
            near: vec![true; n],
            known: vec![false; n],
            closing: vec![0.0; n],
            groups,
            group,
            clock: 0.0,
            budget: vec![0.0; m.n_q],
            time: 0.0,
            most: vec![0.0; m.n_q],
            steps: 0,
            reach: vec![0.0; m.n_q],
            low: vec![0.0; states],
            high: vec![0.0; states],
            work: vec![0.0; work],
        }
    }

    /// Everything is looked at again: at the start, and where parameters change.
    pub(super) fn reset(&mut self) {
        self.due.fill(f64::NEG_INFINITY);
        self.near.fill(true);
        self.known.fill(false);
        self.closing.fill(0.0);
        self.forget_groups(|_| true);
        self.clock = 0.0;
        self.steps = 0;
        self.budget.fill(0.0);
        self.most.fill(0.0);
        self.time = 0.0;
    }

    fn forget_groups(&mut self, which: impl Fn(&Group) -> bool) {
        for g in self.groups.iter_mut().filter(|g| which(g)) {
            (g.due, g.closing) = (f64::NEG_INFINITY, 0.0);
        }
    }

    /// How far the coordinates may go in a step.
    fn measure(&mut self, s: &Step, implicit: bool) {
        let h = s.h.abs();
        for (j, reach) in self.reach.iter_mut().enumerate() {
            let ends = s.f0[j].abs().max(s.f1[j].abs());
            *reach = match implicit {
                true => 2.0 * MARGIN * (h * ends).max((s.x1[j] - s.x0[j]).abs()),
                false => MARGIN * h * s.k[j][..s.n_k].iter().fold(ends, |m, k| m.max(k.abs())),
            };
        }
    }

    /// Budgets that the measured step uses.
    fn used(&self, h: f64) -> f64 {
        let share = |(r, b): (&f64, &f64)| if *r == 0.0 { 0.0 } else { r / b };
        self.reach.iter().zip(&self.budget).map(share).fold(h.abs() / self.time, f64::max)
    }

    /// Decides which of the contacts for which `open` holds are to be looked at in a step that ends where it says. False
    /// where all are, always.
    pub(super) fn look(
        &mut self,
        m: &Mechanics,
        (s, implicit): (&Step, bool),
        at: &Point,
        open: impl Fn(usize) -> bool,
    ) -> bool {
        if !self.on {
            return false;
        }
        self.measure(s, implicit);
        self.raise(m, s.h.abs());
        let used = LONGER * self.used(s.h);
        self.groups.iter_mut().for_each(|g| g.asked = false);
        for i in 0..self.due.len() {
            let far =
                |n: &mut Near| n.due[i] >= n.clock + used || n.is_apart(at, i, used) || n.stays_open(m, at, i, used);
            self.near[i] = !open(i) || !far(self);
        }
        true
    }

    /// Raises the budgets that the measured step exceeds by far; what was promised for the smaller ones is void.
    fn raise(&mut self, m: &Mechanics, h: f64) {
        let mut all = false;
        if h > MOST * self.time {
            self.time = h;
            all = true;
        }
        for j in 0..self.budget.len() {
            if self.reach[j] <= MOST * self.budget[j] {
                continue;
            }
            self.budget[j] = self.reach[j];
            for (i, c) in m.contacts.iter().enumerate() {
                if c.local.as_ref().is_some_and(|l| l.coordinates.contains(&j)) {
                    (self.due[i], self.closing[i]) = (f64::NEG_INFINITY, 0.0);
                }
            }
            self.forget_groups(|g| g.bound.coordinates.contains(&j));
        }
        if all {
            self.forget_groups(|_| true);
            self.due.fill(f64::NEG_INFINITY);
            self.closing.fill(0.0);
        }
    }

    /// Are all contacts of the group of contact `i` open for certain while `used` budgets are used? A group is asked once.
    fn is_apart(&mut self, at: &Point, i: usize, used: f64) -> bool {
        let Some(g) = self.group[i] else { return false };
        let group = &mut self.groups[g];
        if group.due >= self.clock + used {
            return true;
        }
        if std::mem::replace(&mut group.asked, true) {
            return false;
        }
        let (bound, mut closing) = (group.bound.clone(), group.closing);
        let due = self.positive_until(at, (&*bound.distance, &bound.coordinates), used, &mut closing);
        let group = &mut self.groups[g];
        group.closing = closing;
        group.due = due.unwrap_or(group.due);
        due.is_some()
    }

    /// Is contact `i` open for certain while `used` budgets are used? Then it is known until when.
    fn stays_open(&mut self, m: &Mechanics, at: &Point, i: usize, used: f64) -> bool {
        let Some(l) = &m.contacts[i].local else { return false };
        let mut closing = self.closing[i];
        let due = self.positive_until(at, (&*l.gap, &l.coordinates), used, &mut closing);
        self.closing[i] = closing;
        self.due[i] = due.unwrap_or(self.due[i]);
        due.is_some()
    }

    /// Until which time of the clock a function of these coordinates is positive for certain, `used` budgets at least. `closing` is how much of it
    /// one budget takes.
    fn positive_until(
        &mut self,
        at: &Point,
        f: (&dyn Function, &[usize]),
        used: f64,
        closing: &mut f64,
    ) -> Option<f64> {
        let value = self.least(at, f, 0.0)?;
        let guess = |closing: f64, share: f64| (share * value / closing).min(FAR);
        let mut k = if *closing == 0.0 { FAR } else { guess(*closing, 0.9) };
        for _ in 0..TRIES {
            if k.is_nan() || k < used {
                // what was known of its closing may be out of date some time
                *closing *= 0.97;
                return None;
            }
            let low = self.least(at, f, k)?;
            if low.is_finite() {
                *closing = (value - low).max(0.0) / k;
            }
            if low > 0.0 {
                return Some(self.clock + k);
            }
            let better = if low.is_finite() { guess(*closing, 0.8) } else { k / 8.0 };
            k = better.min(k / 2.0);
        }
        None
    }

    /// Lower bound of a function of coordinates over a box of `k` budgets around a point, and over the time that belongs to them.
    fn least(&mut self, at: &Point, (f, coordinates): (&dyn Function, &[usize]), k: f64) -> Option<f64> {
        let n = f.dims().x;
        let (low, high) = (&mut self.low[..n], &mut self.high[..n]);
        low.fill(0.0);
        high.fill(0.0);
        for (place, &j) in coordinates.iter().enumerate() {
            let reach = self.budget[j] * k * INFLATE;
            (low[place], high[place]) = ((at.x[j] - reach).next_down(), (at.x[j] + reach).next_up());
        }
        let end = at.t + (self.time * INFLATE + 4.0 * f64::EPSILON * at.t.abs()) * k;
        let (mut a, mut b) = ([0.0], [0.0]);
        let from = Point { x: low, ..*at };
        let to = Point { t: end.next_up(), x: high, ..*at };
        f.bounds(&from, &to, &mut a, &mut b, &mut self.work).then_some(a[0])
    }

    /// A step is accepted.
    pub(super) fn accept(&mut self, s: &Step, implicit: bool) {
        if !self.on {
            return;
        }
        self.known.copy_from_slice(&self.near);
        self.measure(s, implicit);
        self.clock += self.used(s.h);
        self.most.iter_mut().zip(&self.reach).for_each(|(m, r)| *m = m.max(*r));
        self.steps += 1;
        if self.steps % WINDOW == 0 {
            // what was promised for larger budgets holds for smaller ones
            for (b, m) in self.budget.iter_mut().zip(&mut self.most) {
                *b = (0.25 * *b).max(*m).min(*b);
                *m = 0.0;
            }
        }
    }
}
