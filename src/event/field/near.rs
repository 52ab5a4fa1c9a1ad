//! Which open contacts a step has to look at.
//!
//! Every coordinate has a *budget*, about what it moves in a step, and a clock counts how many budgets the coordinates have
//! used up, the one that moves most for all of them. A contact whose gap is positive over the box of `k` budgets around a
//! point, by interval arithmetic that rounds outwards ([`crate::func::Function::bounds`]), stays open until the clock has
//! gone on by `k`, and is not looked at until then. What a step uses is known before it is accepted, so a contact that may
//! close in it is looked at in it. So no contact is missed whose coordinates move no faster between the stages of a step than
//! twice what they do at them, and what a step costs grows with the contacts that can close soon. Gaps of which nothing is
//! known (callbacks), and contacts that are closed, are looked at in every step.

use crate::event::step::Step;
use crate::func::Point;
use crate::system::{Contact, Mechanics};

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
        let states = local().map(|l| l.gap.dims().x).max().unwrap_or(0);
        let work = local().map(|l| 2 * l.gap.work_len()).max().unwrap_or(0);
        Near {
            on: n >= FEW && m.contacts.iter().all(known),
            due: vec![f64::NEG_INFINITY; n],
            near: vec![true; n],
            known: vec![false; n],
            closing: vec![0.0; n],
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
        self.clock = 0.0;
        self.steps = 0;
        self.budget.fill(0.0);
        self.most.fill(0.0);
        self.time = 0.0;
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
        for i in 0..self.due.len() {
            self.near[i] = !open(i) || !(self.due[i] >= self.clock + used || self.stays_open(m, at, i, used));
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
        }
        if all {
            self.due.fill(f64::NEG_INFINITY);
            self.closing.fill(0.0);
        }
    }

    /// Is contact `i` open for certain while `used` budgets are used? Then it is known until when.
    fn stays_open(&mut self, m: &Mechanics, at: &Point, i: usize, used: f64) -> bool {
        let Some(gap) = self.least_gap(m, at, i, 0.0) else { return false };
        let guess = |closing: f64, share: f64| (share * gap / closing).min(FAR);
        let mut k = if self.closing[i] == 0.0 { FAR } else { guess(self.closing[i], 0.9) };
        for _ in 0..TRIES {
            if k.is_nan() || k < used {
                // what was known of its closing may be out of date some time
                self.closing[i] *= 0.97;
                return false;
            }
            let Some(low) = self.least_gap(m, at, i, k) else { return false };
            if low.is_finite() {
                self.closing[i] = (gap - low).max(0.0) / k;
            }
            if low > 0.0 {
                self.due[i] = self.clock + k;
                return true;
            }
            let better = if low.is_finite() { guess(self.closing[i], 0.8) } else { k / 8.0 };
            k = better.min(k / 2.0);
        }
        false
    }

    /// Lower bound of a gap over a box of `k` budgets around a point, and over the time that belongs to them.
    fn least_gap(&mut self, m: &Mechanics, at: &Point, i: usize, k: f64) -> Option<f64> {
        let l = m.contacts[i].local.as_ref()?;
        let n = l.gap.dims().x;
        let (low, high) = (&mut self.low[..n], &mut self.high[..n]);
        low.fill(0.0);
        high.fill(0.0);
        for (place, &j) in l.coordinates.iter().enumerate() {
            let reach = self.budget[j] * k * INFLATE;
            (low[place], high[place]) = ((at.x[j] - reach).next_down(), (at.x[j] + reach).next_up());
        }
        let end = at.t + (self.time * INFLATE + 4.0 * f64::EPSILON * at.t.abs()) * k;
        let (mut a, mut b) = ([0.0], [0.0]);
        let from = Point { x: low, ..*at };
        let to = Point { t: end.next_up(), x: high, ..*at };
        l.gap.bounds(&from, &to, &mut a, &mut b, &mut self.work).then_some(a[0])
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
