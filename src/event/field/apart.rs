//! Modes that follow at a point where several subsystems have a choice, one subsystem after the other where their rates do
//! not depend on each other.
//!
//! The rate of an indicator is its gradient times the velocity, so it depends on the modes of those subsystems only that
//! drive a state the indicator depends on ([`Sliding`](super::Sliding)). Where they are decided already, a subsystem with
//! two candidates is decided by four signs, and with its velocity the next ones are. What is left is the problem (6.19) of
//! few subsystems, [`Open`].

use super::Field;
use crate::dcs::filippov::{CellFields, Gradient, SubsystemCells};
use crate::event::sets;
use crate::func::{EvalError, EvalResult, Point};

/// A rate of at most this part of the size of its terms leaves a doubt about its sign.
const DOUBT: f64 = 1e-6;

/// The decisions at a point, with their memory.
#[derive(Default)]
pub(in crate::event) struct Apart {
    /// Active cells of every subsystem, as far as they are decided.
    pub(in crate::event) sets: Vec<Vec<usize>>,
    /// Subsystems that are not decided, ascending.
    pub(in crate::event) open: Vec<usize>,
    /// Weight of the first of two cells that slide.
    theta: Vec<f64>,
    decided: Vec<bool>,
    queue: Vec<usize>,
    base: Vec<f64>,
    /// Right-hand sides of two cells, and what they are added to.
    room: [Vec<f64>; 3],
}

impl Apart {
    /// Makes room for the decisions of subsystems with these numbers of cells, of `nx` states.
    pub(in crate::event) fn reserve(&mut self, cells: &[usize], nx: usize) {
        let n = cells.len();
        self.sets.extend(cells.iter().map(|c| Vec::with_capacity(*c)));
        self.open.reserve(n);
        self.theta.reserve(n);
        self.decided.reserve(n);
        // those that wait stand in it twice
        self.queue.reserve(2 * n);
        self.base.reserve(nx);
        self.room.iter_mut().for_each(|r| r.reserve(nx));
    }
}

/// How much is known of the modes behind a switch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::event) enum Known {
    /// All of them.
    All,
    /// All but those of the subsystems that are open.
    ButOpen,
    /// More than one subsystem has a choice.
    Little,
}

impl Field {
    /// The modes behind a switch of one subsystem, where the others go on as they are: those with one candidate, and those
    /// that slide on a surface that attracts, with weights inside of their bounds and rates that do not depend on the modes
    /// of the one that switches. The velocity before the switch and the weights are those of this point: what changes is the
    /// part of the one subsystem.
    pub(in crate::event) fn decide_changed(
        &mut self,
        (t, x, velocity): (f64, &[f64], &[f64]),
        candidates: &[Vec<usize>],
        a: &mut Apart,
    ) -> Result<Known, EvalError> {
        /// Weights this far inside of their bounds stay there.
        const INSIDE: f64 = 1e-6;
        let mut changed = None;
        for (k, c) in candidates.iter().enumerate() {
            let set = &self.active[k];
            let slides = |i: usize| {
                let alpha = self.alpha[i];
                self.sliding.attracts_alone(i) && alpha > INSIDE && alpha < 1.0 - INSIDE
            };
            let goes_on = match c.len() {
                1 => set == c,
                2 => set.len() == 2 && set.iter().all(|s| c.contains(s)) && slides(self.first_pair[k]),
                _ => false,
            };
            if !goes_on && changed.replace(k).is_some() {
                return Ok(Known::Little);
            }
        }
        let Some(k) = changed.filter(|k| candidates[*k].len() == 2) else { return Ok(Known::Little) };
        let touches = self.sliding.depends(k).iter().any(|o| *o != k && candidates[*o].len() > 1);
        if touches || self.sliding.dependencies(k).any(|o| o != k && candidates[o].len() > 1) {
            return Ok(Known::Little);
        }
        sets::assign(&mut a.sets, &self.active);
        a.theta.clear();
        let first = |k: usize| if self.active[k].len() == 2 { 1.0 - self.alpha[self.first_pair[k]] } else { 1.0 };
        a.theta.extend((0..candidates.len()).map(first));
        a.decided.clear();
        a.decided.resize(candidates.len(), true);
        a.base.clear();
        a.base.extend_from_slice(velocity);
        let mut base = std::mem::take(&mut a.base);
        for (cell, weight) in a.sets[k].iter().zip([a.theta[k], 1.0 - a.theta[k]]) {
            self.add_mode(t, x, *cell, -weight, &mut base)?;
        }
        let known = self.decide_one((t, x), &candidates[k], &mut base, a)?;
        a.base = base;
        a.decided[k] = known;
        a.open.clear();
        a.open.extend((!known).then_some(k));
        Ok(if known { Known::All } else { Known::ButOpen })
    }

    /// Does a subsystem slide on one surface that attracts, with a rate that depends on the modes of no other that slides?
    pub(in crate::event) fn slides_alone(&self, k: usize) -> bool {
        let i = self.first_pair[k];
        self.first_pair[k + 1] == i + 1 && self.sliding.attracts_alone(i)
    }

    /// Decides what the signs of the rates decide among `candidates`, cells by subsystem; the rest is left open.
    pub(in crate::event) fn decide_apart(
        &mut self,
        (t, x): (f64, &[f64]),
        candidates: &[Vec<usize>],
        a: &mut Apart,
    ) -> EvalResult {
        let n_sub = candidates.len();
        a.sets.resize(n_sub, Vec::new());
        a.theta.resize(n_sub, 1.0);
        a.decided.clear();
        a.decided.resize(n_sub, false);
        a.base.resize(self.nx, 0.0);
        self.gradients(t, x)?;
        let mut base = std::mem::take(&mut a.base);
        self.drift(t, x, &mut base)?;
        for (k, c) in candidates.iter().enumerate().filter(|(_, c)| c.len() == 1) {
            a.sets[k].clone_from(c);
            a.decided[k] = true;
            self.add_cell(t, x, c[0], &mut base)?;
        }
        a.queue.clear();
        a.queue.extend((0..n_sub).filter(|k| !a.decided[*k]));
        let mut at = 0;
        while at < a.queue.len() {
            let k = a.queue[at];
            at += 1;
            let ready = self.sliding.dependencies(k).all(|d| d == k || a.decided[d]);
            if a.decided[k]
                || !ready
                || candidates[k].len() != 2
                || !self.decide_one((t, x), &candidates[k], &mut base, a)?
            {
                continue;
            }
            a.decided[k] = true;
            // those that waited for it and had their turn
            for &other in self.sliding.depends(k) {
                if !a.decided[other] && a.queue[..at].contains(&other) {
                    a.queue.push(other);
                }
            }
        }
        a.base = base;
        self.reopen(a);
        a.open.clear();
        a.open.extend((0..n_sub).filter(|k| !a.decided[*k]));
        Ok(())
    }

    /// The second-order condition of what is open needs to know how the weights change that its rates depend on.
    fn reopen(&self, a: &mut Apart) {
        a.queue.clear();
        a.queue.extend((0..a.decided.len()).filter(|k| !a.decided[*k]));
        while let Some(k) = a.queue.pop() {
            for other in self.sliding.dependencies(k) {
                if a.decided[other] && a.sets[other].len() > 1 {
                    a.decided[other] = false;
                    a.queue.push(other);
                }
            }
        }
    }

    /// Decides between two cells by the rates of their difference of indicators under both, and adds what they make of the
    /// velocity to `base`. Says whether the rates leave no doubt.
    fn decide_one(
        &mut self,
        (t, x): (f64, &[f64]),
        pair: &[usize],
        base: &mut [f64],
        a: &mut Apart,
    ) -> Result<bool, EvalError> {
        let k = self.owner[pair[0]];
        let nr = self.subs[k].rows.len();
        let [fa, fb, held] = &mut a.room;
        for (cell, f) in pair.iter().zip([&mut *fa, &mut *fb]) {
            let at = Point { t, x, u: &self.u, p: &self.p };
            let s = &self.subs[k];
            let mode = s.cells[cell - s.first].mode;
            let rows = mode * nr..(mode + 1) * nr;
            match s.modes.value_rows(&at, rows.clone(), &mut self.buffer[..s.n_out], &mut self.work) {
                // rounding may have put the point behind the boundary of a mode: not for here
                Err(EvalError::Recoverable) => return Ok(false),
                r => r?,
            }
            f.clear();
            f.extend_from_slice(&self.buffer[rows]);
        }
        let s = &self.subs[k];
        held.clear();
        held.extend(s.rows.iter().map(|&r| base[r]));
        let (wa, wb) = (&s.cells[pair[0] - s.first].weights, &s.cells[pair[1] - s.first].weights);
        // switching functions have no common unit: two of them are left to the search
        if s.signs && wa.iter().zip(wb).filter(|(a, b)| a != b).count() > 1 {
            return Ok(false);
        }
        let mut rates = [0.0f64; 2];
        let mut terms = 0.0f64;
        for (f, rate) in [&*fa, &*fb].into_iter().zip(&mut rates) {
            s.rows.iter().zip(held.iter().zip(f)).for_each(|(&r, (h, f))| base[r] = h + f);
            let mut size = 0.0f64;
            for ((wa, wb), j) in wa.iter().zip(wb).zip(s.q0..) {
                let w = wb - wa;
                if w != 0.0 {
                    let g = self.gradients.row(&self.dq, j);
                    *rate += w * g.along(base);
                    size += w.abs() * (g.states().map(|(i, g)| (g * base[i]).abs()).sum::<f64>() + g.t.abs());
                }
            }
            terms = terms.max(size);
        }
        let [ra, rb] = rates;
        let clear = DOUBT * terms;
        let known = ra.abs() > clear && rb.abs() > clear && !(ra > 0.0 && rb < 0.0);
        // θ_a r_a + (1 − θ_a) r_b = 0
        let theta = match (ra > 0.0, rb > 0.0) {
            (true, _) => 1.0,
            (_, false) => 0.0,
            _ => rb / (rb - ra),
        };
        for (&r, (h, (fa, fb))) in s.rows.iter().zip(held.iter().zip(fa.iter().zip(fb.iter()))) {
            base[r] = if known { h + theta * fa + (1.0 - theta) * fb } else { *h };
        }
        if known {
            let set = &mut a.sets[k];
            set.clear();
            set.extend(pair.iter().zip([theta > 0.0, theta < 1.0]).filter(|e| e.1).map(|e| *e.0));
            a.theta[k] = theta;
        }
        Ok(known)
    }
}

/// The subsystems that are not decided, under the modes of the others.
pub(in crate::event) struct Open<'a> {
    pub(in crate::event) field: &'a mut Field,
    pub(in crate::event) apart: &'a Apart,
}

impl CellFields for Open<'_> {
    fn nx(&self) -> usize {
        self.field.nx
    }

    fn size(&self, i: usize, value: f64) -> f64 {
        self.field.size(i, value)
    }

    fn subsystem(&self, k: usize) -> SubsystemCells<'_> {
        self.field.subsystem(self.apart.open[k])
    }

    fn smooth(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        self.field.drift(t, x, out)?;
        let a = self.apart;
        if self.field.add_bundled((t, x), &a.decided, (&a.sets, &a.theta), out) {
            return Ok(());
        }
        for (k, set) in self.apart.sets.iter().enumerate().filter(|(k, _)| self.apart.decided[*k]) {
            match set[..] {
                [a, b] => {
                    let theta = self.apart.theta[k];
                    self.field.add_mode(t, x, a, theta, out)?;
                    self.field.add_mode(t, x, b, 1.0 - theta, out)?;
                }
                _ => self.field.add_cell(t, x, set[0], out)?,
            }
        }
        Ok(())
    }

    fn add_cell(&mut self, t: f64, x: &[f64], cell: usize, out: &mut [f64]) -> EvalResult {
        self.field.add_cell(t, x, cell, out)
    }

    fn gradients(&mut self, t: f64, x: &[f64]) -> EvalResult {
        self.field.gradients(t, x)
    }

    fn gradient(&self, j: usize) -> Gradient<'_> {
        CellFields::gradient(self.field, j)
    }

    fn value(&self, j: usize) -> f64 {
        self.field.q[j]
    }
}
