//! The closed contacts of a step as sparse rows, structure of arrays.

use super::inertia::Blocks;
use super::near::Lists;
use crate::func::{EvalResult, Point};
use crate::system::{Contact, Kind, Local};

/// What of the contacts does not change: which velocities they touch.
pub(super) struct Touched {
    /// Velocities that the normal or a tangent has entries for.
    pub(super) own: Lists,
    /// Velocities that a force of the contact moves: whole blocks of the inertia.
    pub(super) moved: Lists,
    /// Blocks of the inertia that it moves.
    blocks: Lists,
    /// Place of every own velocity among those that are moved.
    places: Lists,
}

impl Touched {
    pub(super) fn new(contacts: &[Local], inertia: &Blocks) -> Touched {
        let own: Vec<&[usize]> = contacts.iter().map(|c| c.velocities.as_slice()).collect();
        let mut blocks: Vec<Vec<usize>> = Vec::with_capacity(own.len());
        for list in &own {
            let mut b: Vec<usize> = list.iter().map(|&i| inertia.of[i]).collect();
            b.sort_unstable();
            b.dedup();
            blocks.push(b);
        }
        let all = |b: &Vec<usize>| b.iter().flat_map(|&b| inertia.members(b).iter().copied()).collect::<Vec<usize>>();
        let moved: Vec<Vec<usize>> = blocks.iter().map(all).collect();
        let mut places: Vec<Vec<usize>> = Vec::with_capacity(own.len());
        for (list, b) in own.iter().zip(&blocks) {
            let before =
                |of: usize| b.iter().take_while(|&&o| o != of).map(|&o| inertia.members(o).len()).sum::<usize>();
            places.push(list.iter().map(|&i| before(inertia.of[i]) + inertia.place(i)).collect());
        }
        let lists = |l: &[Vec<usize>]| Lists::new(l.iter().map(Vec::as_slice));
        Touched {
            own: Lists::new(own.into_iter()),
            moved: lists(&moved),
            blocks: lists(&blocks),
            places: lists(&places),
        }
    }
}

/// The closed contacts. Contact `a` of them has the rows `first[a]..first[a + 1]`: the normal, then its tangents.
#[derive(Default)]
pub(super) struct Rows {
    /// Numbers of the contacts.
    pub(super) contact: Vec<usize>,
    pub(super) first: Vec<usize>,
    pub(super) friction: Vec<f64>,
    /// Coefficients of friction for sticking.
    pub(super) stiction: Vec<f64>,
    pub(super) kind: Vec<Kind>,
    /// Did it slide in the last sweep?
    pub(super) slides: Vec<bool>,
    pub(super) restitution: Vec<f64>,
    /// Gap where the functions were evaluated.
    pub(super) gap: Vec<f64>,
    /// Rate of the gap at the start of the step.
    pub(super) rate: Vec<f64>,
    /// `G M⁻¹ Gᵀ` of the contact alone, `3 × 3`.
    pub(super) own: Vec<[f64; 9]>,
    /// Entries of row `r`: `entries[from[r]..from[r + 1]]`, at the velocities the contact touches.
    from: Vec<usize>,
    entries: Vec<f64>,
    /// The row times `M⁻¹`: `shifts[shift_from[r]..shift_from[r + 1]]`, at the velocities the contact moves.
    shift_from: Vec<usize>,
    shifts: Vec<f64>,
    /// What of the rate of the row has nothing to do with the velocities.
    pub(super) drive: Vec<f64>,
    /// Impulses.
    pub(super) impulse: Vec<f64>,
    local: Vec<f64>,
    out: Vec<f64>,
}

impl Rows {
    pub(super) fn clear(&mut self) {
        self.contact.clear();
        self.friction.clear();
        self.stiction.clear();
        self.kind.clear();
        self.slides.clear();
        self.restitution.clear();
        self.gap.clear();
        self.rate.clear();
        self.own.clear();
        self.entries.clear();
        self.shifts.clear();
        self.drive.clear();
        self.impulse.clear();
        for starts in [&mut self.first, &mut self.from, &mut self.shift_from] {
            starts.clear();
            starts.push(0);
        }
    }

    /// Number of contacts.
    pub(super) fn len(&self) -> usize {
        self.contact.len()
    }

    /// Components of the impulse of contact `a` beside the normal one.
    pub(super) fn n_tangents(&self, a: usize) -> usize {
        self.first[a + 1] - self.first[a] - 1
    }

    /// Adds contact `c` with this gap, evaluated at a point.
    pub(super) fn add(
        &mut self,
        (l, n_q, contact): (&Local, usize, &Contact),
        touched: &Touched,
        inertia: &Blocks,
        at: &Point,
        (c, gap): (usize, f64),
        work: &mut [f64],
    ) -> EvalResult {
        let (n_c, n_o, n_tangents) = (l.coordinates.len(), l.velocities.len(), contact.n_tangents);
        self.local.clear();
        self.local.extend(l.coordinates.iter().map(|&j| at.x[j]));
        self.local.extend(l.velocities.iter().map(|&j| at.x[n_q + j]));
        self.local.extend(l.others.iter().map(|&j| at.x[n_q + inertia.of.len() + j]));
        let length = Local::rows_len(n_o, n_tangents);
        self.out.resize(length + usize::from(contact.stiction), 0.0);
        l.rows.value(&Point { x: &self.local, ..*at }, &mut self.out, work)?;
        let (v, out) = (&self.local[n_c..], &self.out);
        self.contact.push(c);
        self.gap.push(gap);
        self.rate.push(out[0]);
        self.friction.push(out[1]);
        self.stiction.push(if contact.stiction { out[length] } else { out[1] });
        self.kind.push(contact.kind);
        self.slides.push(false);
        self.restitution.push(out[2]);
        for k in 0..=n_tangents {
            let (rate, row) = match k {
                0 => (out[0], &out[3..3 + n_o]),
                _ => {
                    let from = 3 + n_o + (k - 1) * (1 + n_o);
                    (out[from], &out[from + 1..from + 1 + n_o])
                }
            };
            self.entries.extend_from_slice(row);
            self.from.push(self.entries.len());
            let n_moved = touched.moved.of(c).len();
            let begin = self.shifts.len();
            self.shifts.resize(begin + n_moved, 0.0);
            let shift = &mut self.shifts[begin..];
            touched.places.of(c).iter().zip(row).for_each(|(&place, r)| shift[place] = *r);
            let mut place = 0;
            for &b in touched.blocks.of(c) {
                let n = inertia.members(b).len();
                inertia.solve_block(b, &mut shift[place..place + n]);
                place += n;
            }
            self.shift_from.push(self.shifts.len());
            let moved: f64 = row.iter().zip(v).map(|(r, v)| r * v).sum();
            self.drive.push(rate - moved);
            self.impulse.push(0.0);
        }
        let (n, from) = (n_tangents + 1, *self.first.last().unwrap_or(&0));
        self.first.push(from + n);
        let mut w = [0.0; 9];
        for i in 0..n {
            for j in 0..n {
                let (row, shift) = (self.row(from + i), self.shift(from + j));
                w[3 * i + j] = touched.places.of(c).iter().zip(row).map(|(&place, r)| r * shift[place]).sum();
            }
        }
        self.own.push(w);
        Ok(())
    }

    #[inline]
    fn row(&self, r: usize) -> &[f64] {
        &self.entries[self.from[r]..self.from[r + 1]]
    }

    #[inline]
    fn shift(&self, r: usize) -> &[f64] {
        &self.shifts[self.shift_from[r]..self.shift_from[r + 1]]
    }

    /// Row `r`, one of contact `a`, times velocities.
    #[inline]
    pub(super) fn times(&self, t: &Touched, a: usize, r: usize, v: &[f64]) -> f64 {
        t.own.of(self.contact[a]).iter().zip(self.row(r)).map(|(&j, n)| n * v[j]).sum()
    }

    /// The largest value the row times velocities of these sizes can have.
    pub(super) fn times_abs(&self, t: &Touched, a: usize, r: usize, v: &[f64]) -> f64 {
        t.own.of(self.contact[a]).iter().zip(self.row(r)).map(|(&j, n)| (n * v[j]).abs()).sum()
    }

    /// Adds an impulse of row `r` to velocities.
    #[inline]
    pub(super) fn push(&self, t: &Touched, a: usize, r: usize, impulse: f64, v: &mut [f64]) {
        t.moved.of(self.contact[a]).iter().zip(self.shift(r)).for_each(|(&j, y)| v[j] += y * impulse);
    }

    /// Is the direction of the normal, or of the friction where there is no normal, known and does it move anything?
    pub(super) fn acts(&self, a: usize) -> bool {
        let w = self.own[a][if self.is_joint(a) { 4 } else { 0 }];
        w > 0.0 && w.is_finite()
    }

    /// Is it dry friction without a normal, whose normal impulse is given?
    pub(super) fn is_joint(&self, a: usize) -> bool {
        self.kind[a] == Kind::Joint
    }

    /// The least normal impulse there is.
    pub(super) fn least(&self, a: usize) -> f64 {
        if self.kind[a] == Kind::Bilateral {
            f64::NEG_INFINITY
        } else {
            0.0
        }
    }
}
