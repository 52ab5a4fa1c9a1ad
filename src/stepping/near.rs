//! Which contacts have to be looked at in a step.
//!
//! A contact that is open is looked at again only when it could be closed. Every coordinate has a *budget*: the most it may
//! move from one point where gaps are evaluated to the next. While all coordinates of a contact keep to their budgets, they
//! are, `k` steps after it was looked at, in a box of `k` budgets around where they were. The gap is bounded over such boxes
//! by interval arithmetic that rounds outwards ([`crate::func::Function::bounds`]): if it is positive over the box of `k`
//! steps (and over the time they take) the contact is left alone for `k` steps. In every step each coordinate is compared with
//! its budget; where it has moved further the budget is raised and all contacts of the coordinate are looked at at once.
//! Contacts that share a lower bound of their gaps ([`crate::system::Separation`]), as those of two bodies share the distance of spheres
//! around them, are asked together first: while that bound is positive over a box none of their own gaps is evaluated.
//! So no contact is missed, whatever the bodies do, and what a step costs grows with the coordinates and with the contacts
//! that are near, not with all contacts. Gaps that nothing is known of (callbacks) are looked at in every step.

use std::sync::Arc;

use crate::func::{EvalError, EvalResult, Function, Point};
use crate::system::{Local, Separation};

/// Steps until a contact is looked at again are less than this.
const WHEEL: usize = 1024;
/// Boxes tried for a contact at most.
const TRIES: usize = 3;
/// Steps after which budgets may shrink.
const WINDOW: u64 = 256;
/// What rounding adds to a box, relative to its size.
const INFLATE: f64 = 1.0 + 1e-9;
const NONE: u32 = u32::MAX;

/// Lists of lists in two arrays.
pub(super) struct Lists {
    start: Vec<usize>,
    items: Vec<usize>,
}

impl Lists {
    pub(super) fn new<'a>(lists: impl Iterator<Item = &'a [usize]>) -> Lists {
        let mut l = Lists { start: vec![0], items: Vec::new() };
        for list in lists {
            l.items.extend_from_slice(list);
            l.start.push(l.items.len());
        }
        l
    }

    /// Who lists what: the same relation, read the other way.
    fn transposed(&self, n: usize) -> Lists {
        let mut start = vec![0; n + 1];
        self.items.iter().for_each(|&j| start[j + 1] += 1);
        (0..n).for_each(|j| start[j + 1] += start[j]);
        let (mut next, mut items) = (start.clone(), vec![0; self.items.len()]);
        for i in 0..self.start.len() - 1 {
            for &j in self.of(i) {
                items[next[j]] = i;
                next[j] += 1;
            }
        }
        Lists { start, items }
    }

    pub(super) fn of(&self, i: usize) -> &[usize] {
        &self.items[self.start[i]..self.start[i + 1]]
    }
}

/// Where gaps are evaluated.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) t: f64,
    pub(super) q: &'a [f64],
    pub(super) u: &'a [f64],
    pub(super) p: &'a [f64],
}

/// Contacts with one lower bound of their gaps.
struct Group {
    bound: Arc<Separation>,
    /// All of them are open in this step and before.
    until: u64,
    /// Step in which it was asked last.
    asked: u64,
    closing: f64,
}

/// The queue.
pub(super) struct Near {
    contacts: Arc<[Local]>,
    touching: Lists,
    /// Step in which a contact is due; its neighbours in the list of that step.
    due: Vec<u64>,
    next: Vec<u32>,
    before: Vec<u32>,
    /// First contact that is due in a step, by the step modulo [`WHEEL`].
    wheel: Vec<u32>,
    /// How much of the gap a step takes at most, as far as it is known: a guess that says which box to try.
    closing: Vec<f64>,
    groups: Vec<Group>,
    /// The group of a contact.
    group: Vec<Option<usize>>,
    budget: Vec<f64>,
    /// Largest motion since budgets were last looked at.
    most: Vec<f64>,
    last: Vec<f64>,
    step: u64,
    fresh: bool,
    look_at_all: bool,
    /// Contacts that cannot open.
    closed: Vec<bool>,
    /// Contacts looked at in this step.
    list: Vec<usize>,
    /// Contacts whose gap is not positive, increasing, and their gaps.
    pub(super) active: Vec<usize>,
    pub(super) gaps: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    work: Vec<f64>,
    /// Gaps evaluated, and bounds over boxes.
    pub(super) looked: u64,
    pub(super) bounded: u64,
}

impl Near {
    pub(super) fn new(contacts: &Arc<[Local]>, closed: Vec<bool>, n_q: usize, look_at_all: bool) -> Near {
        let n = contacts.len();
        let (group, bounds) = Separation::groups(contacts.iter().map(Some));
        let touched: Vec<Vec<usize>> = contacts.iter().map(Local::touched).collect();
        let functions = || contacts.iter().map(|c| &c.gap).chain(bounds.iter().map(|b| &b.distance));
        let states = functions().map(|f| f.dims().x).max().unwrap_or(0);
        let work = functions().map(|f| 2 * f.work_len()).max().unwrap_or(0);
        let groups = bounds.into_iter().map(|bound| Group { bound, until: 0, asked: 0, closing: 0.0 }).collect();
        Near {
            groups,
            group,
            touching: Lists::new(touched.iter().map(Vec::as_slice)).transposed(n_q),
            due: vec![0; n],
            next: vec![NONE; n],
            before: vec![NONE; n],
            wheel: vec![NONE; WHEEL],
            closing: vec![0.0; n],
            budget: vec![0.0; n_q],
            most: vec![0.0; n_q],
            last: vec![0.0; n_q],
            step: 0,
            fresh: true,
            look_at_all,
            closed,
            list: Vec::with_capacity(n),
            active: Vec::with_capacity(n.min(1024)),
            gaps: Vec::with_capacity(n.min(1024)),
            low: vec![0.0; states],
            high: vec![0.0; states],
            work: vec![0.0; work],
            looked: 0,
            bounded: 0,
            contacts: contacts.clone(),
        }
    }

    /// Forgets everything: the next step looks at all contacts. `moves` is how far each coordinate goes in a step now.
    pub(super) fn reset(&mut self, moves: impl Iterator<Item = f64>) {
        self.fresh = true;
        self.budget.iter_mut().zip(moves).for_each(|(b, m)| *b = 2.0 * m.abs());
    }

    /// Evaluates the gaps of the contacts that may be closed, and lists those that are. `h` is the longest step there is.
    /// Says which contact failed if one did.
    pub(super) fn look(&mut self, at: &Place, h: f64) -> Result<(), (usize, EvalError)> {
        self.step += 1;
        self.active.clear();
        self.gaps.clear();
        self.list.clear();
        if std::mem::take(&mut self.fresh) {
            self.wheel.fill(NONE);
            self.closing.fill(0.0);
            for g in &mut self.groups {
                (g.until, g.asked, g.closing) = (0, 0, 0.0);
            }
            self.most.fill(0.0);
            self.last.copy_from_slice(at.q);
            self.list.extend(0..self.due.len());
        } else {
            self.follow(at.q);
            let mut c = std::mem::replace(&mut self.wheel[self.step as usize % WHEEL], NONE);
            while c != NONE {
                self.list.push(c as usize);
                c = self.next[c as usize];
            }
            self.list.sort_unstable();
        }
        let list = std::mem::take(&mut self.list);
        let r = list.iter().try_for_each(|&c| self.look_at(at, h, c).map_err(|e| (c, e)));
        self.list = list;
        r
    }

    /// Compares the motion of every coordinate with its budget.
    fn follow(&mut self, q: &[f64]) {
        let shrink = self.step % WINDOW == 0;
        for j in 0..q.len() {
            let d = (q[j] - self.last[j]).abs();
            self.last[j] = q[j];
            self.most[j] = self.most[j].max(d);
            if d > self.budget[j] {
                self.budget[j] = 2.0 * d;
                let (first, end) = (self.touching.start[j], self.touching.start[j + 1]);
                for k in first..end {
                    let c = self.touching.items[k];
                    if let Some(g) = self.group[c] {
                        self.groups[g].until = 0;
                    }
                    if self.due[c] != self.step {
                        self.unlink(c);
                        self.link(c, self.step);
                    }
                }
            } else if shrink {
                // what was promised for larger budgets holds for smaller ones
                if 16.0 * self.most[j] < self.budget[j] {
                    self.budget[j] = 4.0 * self.most[j];
                }
                self.most[j] = 0.0;
            }
        }
    }

    fn unlink(&mut self, c: usize) {
        let (n, b) = (self.next[c], self.before[c]);
        if b == NONE {
            self.wheel[self.due[c] as usize % WHEEL] = n;
        } else {
            self.next[b as usize] = n;
        }
        if n != NONE {
            self.before[n as usize] = b;
        }
    }

    fn link(&mut self, c: usize, step: u64) {
        let first = std::mem::replace(&mut self.wheel[step as usize % WHEEL], c as u32);
        if first != NONE {
            self.before[first as usize] = c as u32;
        }
        (self.due[c], self.next[c], self.before[c]) = (step, first, NONE);
    }

    fn look_at(&mut self, at: &Place, h: f64, c: usize) -> EvalResult {
        if let Some(until) = self.group[c].and_then(|g| self.open_until(at, h, g)) {
            self.link(c, until + 1);
            return Ok(());
        }
        let gap = self.gap(at, c)?;
        self.looked += 1;
        let rest = if gap <= 0.0 || self.closed[c] {
            self.active.push(c);
            self.gaps.push(gap);
            0
        } else if self.look_at_all {
            0
        } else {
            self.open_steps(at, h, c, gap)
        };
        self.link(c, self.step + rest as u64 + 1);
        Ok(())
    }

    /// The gap of contact `c`.
    pub(super) fn gap(&mut self, at: &Place, c: usize) -> Result<f64, EvalError> {
        let l = &self.contacts[c];
        let x = &mut self.low[..l.gap.dims().x];
        gather(x, &l.coordinates, at.q);
        let mut out = [0.0];
        l.gap.value(&Point { t: at.t, x, u: at.u, p: at.p }, &mut out, &mut self.work)?;
        Ok(out[0])
    }

    /// For how many steps a contact with this gap stays open for certain.
    fn open_steps(&mut self, at: &Place, h: f64, c: usize, gap: f64) -> usize {
        let contacts = self.contacts.clone();
        let l = &contacts[c];
        let mut closing = self.closing[c];
        let steps = self.positive_steps(at, h, (&*l.gap, &l.coordinates), gap, &mut closing);
        self.closing[c] = closing;
        steps
    }

    /// The last step for which a group stays open for certain; none where it may close now.
    fn open_until(&mut self, at: &Place, h: f64, g: usize) -> Option<u64> {
        let group = &mut self.groups[g];
        if group.until >= self.step {
            return Some(group.until);
        }
        if std::mem::replace(&mut group.asked, self.step) == self.step || self.look_at_all {
            return None;
        }
        let (bound, mut closing) = (group.bound.clone(), group.closing);
        let f = (&*bound.distance, bound.coordinates.as_slice());
        self.bounded += 1;
        let now = self.least(at, h, f, 0).filter(|low| *low > 0.0)?;
        let steps = self.positive_steps(at, h, f, now, &mut closing);
        let group = &mut self.groups[g];
        group.closing = closing;
        group.until = self.step + steps as u64;
        Some(group.until)
    }

    /// For how many steps a function of these coordinates with this value stays positive for certain. `closing` is how much of it a step takes.
    fn positive_steps(
        &mut self,
        at: &Place,
        h: f64,
        f: (&dyn Function, &[usize]),
        value: f64,
        closing: &mut f64,
    ) -> usize {
        let most = WHEEL - 2;
        let guess = |closing: f64, share: f64| ((share * value / closing) as usize).min(most);
        // nothing is known yet, or nothing moves: a quotient of no number is taken as zero steps
        let mut k = if *closing == 0.0 { most } else { guess(*closing, 0.9) };
        if k < 2 {
            // near: what was known of its closing may be out of date some time
            *closing *= 0.97;
            return 0;
        }
        for _ in 0..TRIES {
            self.bounded += 1;
            let Some(low) = self.least(at, h, f, k) else {
                *closing = f64::INFINITY;
                return 0;
            };
            if low.is_finite() {
                *closing = (value - low).max(0.0) / k as f64;
            }
            if low > 0.0 {
                return k;
            }
            let better = if low.is_finite() { guess(*closing, 0.8) } else { k / 8 };
            k = better.min(k / 2);
            if k == 0 {
                break;
            }
        }
        0
    }

    /// Lower bound of a function of coordinates in the next `k` steps.
    fn least(&mut self, at: &Place, h: f64, (f, coordinates): (&dyn Function, &[usize]), k: usize) -> Option<f64> {
        let n = f.dims().x;
        let (low, high) = (&mut self.low[..n], &mut self.high[..n]);
        low.fill(0.0);
        high.fill(0.0);
        for (i, &j) in coordinates.iter().enumerate() {
            let reach = self.budget[j] * k as f64 * INFLATE;
            (low[i], high[i]) = ((at.q[j] - reach).next_down(), (at.q[j] + reach).next_up());
        }
        let end = at.t + (h * INFLATE + 4.0 * f64::EPSILON * at.t.abs()) * k as f64;
        let (mut a, mut b) = ([0.0], [0.0]);
        let from = Point { t: at.t, x: low, u: at.u, p: at.p };
        let to = Point { t: end.next_up(), x: high, ..from };
        f.bounds(&from, &to, &mut a, &mut b, &mut self.work).then_some(a[0])
    }
}

/// Copies the coordinates listed to the first places of `x`; the others are velocities, which gaps do not know.
fn gather(x: &mut [f64], list: &[usize], q: &[f64]) {
    x[list.len()..].fill(0.0);
    x.iter_mut().zip(list).for_each(|(x, &j)| *x = q[j]);
}
