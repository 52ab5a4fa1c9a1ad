//! What happens in a step, unit by unit: the next zero of every watched function, and what each state does in the step.
//!
//! A step of all states is made as if nothing happened in it. What happens then at a time `t` changes the states around it, from `t` to the end
//! of the step: these are integrated anew, with the dense output of the others, and the functions that depend on them have their next zeros
//! elsewhere. All others stay as they are.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::bernstein::Sampler;
use super::explicit::Flow;
#[cfg(doc)]
use super::field::SLIDES;
use super::field::{Depends, Field, Moving};
use super::step::{derivative, horner, Poly, Step};
use super::Jump;
use crate::func::{EvalError, EvalResult};

/// A zero of a watched function.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// Its time.
    pub(super) t: f64,
    /// The source: the place of the function, or, for weights, that of the cell behind all places.
    pub(super) source: usize,
    /// Rate of the function there, falling.
    pub(super) rate: f64,
    version: u32,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Entry) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Entry) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    /// The earliest one is the largest; of several at one time that of the first source.
    fn cmp(&self, other: &Entry) -> Ordering {
        other.t.total_cmp(&self.t).then(other.source.cmp(&self.source))
    }
}

/// A polynomial that a state follows from a time on.
#[derive(Debug, Clone, Copy)]
struct Piece {
    t: f64,
    /// Unit of its relative time.
    h: f64,
    poly: Poly,
    /// The one before it, plus one; 0 where that is the dense output of the step.
    before: u32,
}

/// What the states do in a step that is cut for some of them only.
#[derive(Debug, Default)]
pub(super) struct Tracks {
    pieces: Vec<Piece>,
    /// Of every state its last piece, plus one; 0 for the dense output of the step.
    head: Vec<u32>,
    /// States with pieces of their own.
    pub(super) touched: Vec<u32>,
}

impl Tracks {
    /// All states follow the dense output of the step.
    pub(super) fn clear(&mut self) {
        self.pieces.clear();
        self.touched.iter().for_each(|i| self.head[*i as usize] = 0);
        self.touched.clear();
    }

    /// Polynomial of state `i` at time `t` among the pieces that end with `head`: its start, its unit, its coefficients.
    #[inline]
    fn piece<'a>(&'a self, step: &'a Step, i: usize, mut head: u32, t: f64) -> (f64, f64, &'a Poly) {
        while head > 0 {
            let p = &self.pieces[head as usize - 1];
            if p.t <= t {
                return (p.t, p.h, &p.poly);
            }
            head = p.before;
        }
        (step.t, step.h, &step.poly[i])
    }

    /// Has state `i` pieces of its own?
    pub(super) fn is_touched(&self, i: usize) -> bool {
        self.head[i] > 0
    }

    /// Value of state `i`.
    #[inline]
    pub(super) fn value(&self, step: &Step, i: usize, t: f64) -> f64 {
        self.value_from(step, i, self.head[i], t)
    }

    #[inline]
    fn value_from(&self, step: &Step, i: usize, head: u32, t: f64) -> f64 {
        let (start, h, poly) = self.piece(step, i, head, t);
        horner(poly, (t - start) / h)
    }

    /// `k`-th derivative of state `i`.
    pub(super) fn derivative(&self, step: &Step, i: usize, k: usize, t: f64) -> f64 {
        let (start, h, poly) = self.piece(step, i, self.head[i], t);
        derivative(poly, k, (t - start) / h) / h.powi(k as i32)
    }

    /// Value and derivative at time `t` on the piece that state `i` follows at time `from`.
    pub(super) fn follow(&self, step: &Step, i: usize, from: f64, t: f64) -> (f64, f64) {
        let (start, h, poly) = self.piece(step, i, self.head[i], from);
        let s = (t - start) / h;
        (horner(poly, s), derivative(poly, 1, s) / h)
    }

    /// When the piece begins that state `i` follows up to time `t`, but for one that begins there; `from` at least.
    pub(super) fn last_break(&self, i: usize, from: f64, t: f64) -> f64 {
        let head = self.head_before(i, t);
        head.checked_sub(1).map_or(from, |h| self.pieces[h as usize].t.max(from))
    }

    /// The pieces of state `i`, the last one first: start, unit, coefficients.
    pub(super) fn pieces_of(&self, i: usize) -> impl Iterator<Item = (f64, f64, &Poly)> {
        let mut head = self.head[i];
        std::iter::from_fn(move || {
            let p = &self.pieces[(head as usize).checked_sub(1)?];
            head = p.before;
            Some((p.t, p.h, &p.poly))
        })
    }

    /// Times between `from` and the end of the step at which another piece of state `i` begins.
    pub(super) fn breaks(&self, i: usize, from: f64, to: &mut Vec<f64>) {
        let mut head = self.head[i];
        while head > 0 {
            let p = &self.pieces[head as usize - 1];
            if p.t <= from {
                return;
            }
            to.push(p.t);
            head = p.before;
        }
    }

    /// Coefficients of state `i` in powers of the time relative to `from` and `to`, between which no other piece begins.
    pub(super) fn between(&self, step: &Step, i: usize, (from, to): (f64, f64)) -> Poly {
        let (start, h, poly) = self.piece(step, i, self.head[i], from);
        let (shift, scale) = ((from - start) / h, (to - from) / h);
        let mut c = *poly;
        // Taylor coefficients at the new origin, by repeated division
        for m in 0..c.len() {
            for j in (m..c.len() - 1).rev() {
                c[j] += shift * c[j + 1];
            }
        }
        let mut power = 1.0;
        for c in &mut c {
            *c *= power;
            power *= scale;
        }
        c
    }

    /// The last piece of state `i` that begins before `t`, plus one: what is behind it is given up.
    fn head_before(&self, i: usize, t: f64) -> u32 {
        let mut head = self.head[i];
        while head > 0 && self.pieces[head as usize - 1].t >= t {
            head = self.pieces[head as usize - 1].before;
        }
        head
    }
}

/// States that are integrated together, from an event on.
#[derive(Debug, Default)]
pub(super) struct Group {
    /// The states; those that nothing but transitions moves come last.
    pub(super) states: Vec<u32>,
    /// How many move by themselves.
    pub(super) moving: usize,
    /// Values at the start.
    pub(super) start: Vec<f64>,
    /// The new last pieces.
    heads: Vec<u32>,
    /// States that the velocities depend on beside these.
    inputs: Vec<u32>,
    /// Place of every state in the group, plus one, if it is of the present one.
    place: Vec<u32>,
}

impl Group {
    /// Place of state `i`.
    #[inline]
    pub(super) fn place(&self, i: usize) -> Option<usize> {
        (self.place[i] as usize).checked_sub(1)
    }

    /// Another one, of these states; those that `still` says do not move by themselves.
    pub(super) fn gather(
        &mut self,
        states: &[u32],
        still: impl Fn(usize) -> bool,
        (depends, cells): (&Depends, &[usize]),
    ) {
        self.forget();
        self.states.extend(states.iter().filter(|i| !still(**i as usize)));
        self.moving = self.states.len();
        self.states.extend(states.iter().filter(|i| still(**i as usize)));
        for (k, &i) in self.states.iter().enumerate() {
            self.place[i as usize] = k as u32 + 1;
        }
        let Group { states, moving, inputs, place, .. } = self;
        for &i in &states[..*moving] {
            depends.each_read(i as usize, cells, |j| {
                // still states are inputs, too
                if place[j as usize] == 0 || place[j as usize] as usize > *moving {
                    inputs.push(j);
                }
            });
        }
        self.inputs.sort_unstable();
        self.inputs.dedup();
    }

    fn forget(&mut self) {
        self.states.iter().for_each(|i| self.place[*i as usize] = 0);
        self.states.clear();
        self.inputs.clear();
        self.heads.clear();
        self.start.clear();
    }
}

/// Some states as what a pair integrates.
pub(super) struct Units<'a> {
    pub(super) field: &'a mut Field,
    pub(super) group: &'a Group,
    pub(super) moving: &'a mut Moving,
    pub(super) tracks: &'a Tracks,
    /// The step of all states.
    pub(super) step: &'a Step,
}

impl Flow for Units<'_> {
    fn velocity<'a>(&'a mut self, t: f64, x: &[f64], room: &'a mut [f64]) -> std::result::Result<&'a [f64], EvalError> {
        self.write_velocity(t, x, room)?;
        Ok(room)
    }

    fn write_velocity(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let g = self.group;
        self.field.set_time_of_parts(t);
        g.states.iter().zip(x).for_each(|(i, v)| self.field.set_state_of_parts(*i as usize, *v));
        for &j in &g.inputs {
            let j = j as usize;
            let v = match g.place(j) {
                Some(k) => g.start[k],
                None => self.tracks.value(self.step, j, t),
            };
            self.field.set_state_of_parts(j, v);
        }
        match self.field.move_by_parts(self.moving, out) {
            true => Ok(()),
            false => Err(EvalError::Recoverable),
        }
    }
}

/// A subsystem goes over to another cell, or begins or ends to slide.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    pub(super) sub: usize,
    /// The cell that it goes over to, or [`SLIDES`]; once it has, the one before.
    pub(super) cell: usize,
    /// Rate of what vanishes; NaN where a jump has moved the state over the surface.
    pub(super) rate: f64,
    /// Order of the zero that the switching function has where the new cell begins.
    pub(super) departs: usize,
}

/// The events of single units within a step.
pub(super) struct UnitEvents {
    pub(super) depends: Depends,
    heap: BinaryHeap<Entry>,
    /// Entries of a source that have another version are of the past.
    versions: Vec<u32>,
    /// What the states do in the last step.
    pub(super) tracks: Tracks,
    pub(super) group: Group,
    pub(super) moving: Moving,
    /// The step of a group.
    pub(super) step: Step,
    pub(super) weights: Vec<f64>,
    /// Active cells of the subsystems, or [`SLIDES`].
    pub(super) cells: Vec<usize>,
    /// States that subsystems drive which slide in a way that is nothing for single units, and those that their surfaces depend on.
    pub(super) tied: Vec<bool>,
    /// States that nothing but transitions moves.
    pub(super) still: Vec<bool>,
    /// Of every source the states that were integrated anew at the last event.
    reach: Vec<Vec<u32>>,
    /// States in all these lists.
    reached: usize,
    /// States that jump at the present event: what they were, and what they are; and the place of each, plus one.
    pub(super) changes: Vec<(u32, f64, f64)>,
    changed: Vec<u32>,
    /// Transitions and switches of the present event that are still to be logged.
    pub(super) jumps: Vec<Jump>,
    pub(super) fired: Vec<u32>,
    pub(super) crossed: Vec<Crossing>,
    /// States that a weight depends on.
    pub(super) inputs: Vec<u32>,
    /// Where not all gradients are constant: those of functions, where they were looked at last, at a point of which few states are known.
    pub(super) dq: Vec<f64>,
    pub(super) point: Vec<f64>,
    pub(super) sampler: Sampler,
    /// Sources to be looked at again.
    asked: Vec<u32>,
    seen: Vec<bool>,
    pub(super) values: Vec<f64>,
    pub(super) times: Vec<f64>,
    /// Times of the events of this step.
    pub(super) events: Vec<f64>,
    /// States whose velocities were evaluated by themselves; those of this step, and those of them that an event moves at once.
    pub(super) rows: usize,
    pub(super) spent: usize,
    pub(super) needed: usize,
}

impl UnitEvents {
    pub(super) fn new(field: &Field, discrete: &[usize]) -> Option<UnitEvents> {
        let depends = field.depends()?;
        let (nx, n) = (field.nx, field.q.len() + field.n_cells);
        let mut still = vec![false; nx];
        discrete.iter().for_each(|d| still[*d] = true);
        Some(UnitEvents {
            heap: BinaryHeap::new(),
            versions: vec![0; n],
            tracks: Tracks { head: vec![0; nx], ..Tracks::default() },
            group: Group { place: vec![0; nx], ..Group::default() },
            moving: Moving::default(),
            step: Step::new(0),
            weights: Vec::new(),
            cells: Vec::new(),
            tied: vec![false; nx],
            still,
            reach: vec![Vec::new(); n],
            reached: 0,
            changes: Vec::new(),
            changed: vec![0; nx],
            jumps: Vec::new(),
            fired: Vec::new(),
            crossed: Vec::new(),
            inputs: Vec::new(),
            dq: if field.constant_gradients() { Vec::new() } else { vec![0.0; field.dq.len()] },
            point: vec![0.0; nx],
            sampler: Sampler::new(),
            asked: Vec::new(),
            seen: vec![false; n],
            values: Vec::new(),
            times: Vec::new(),
            events: Vec::new(),
            rows: 0,
            spent: 0,
            needed: 0,
            depends,
        })
    }

    /// A step begins.
    pub(super) fn begin(&mut self) {
        self.heap.clear();
        self.tracks.clear();
        self.events.clear();
        (self.spent, self.needed) = (0, 0);
    }

    /// The length of the next step relative to this one that is worth it at most, where a step of all states evaluates the velocity at so many stages.
    ///
    /// There are as many events as a step is long, and what each of them is felt by grows with the time that is left: what its neighbours cost goes
    /// with the square of the length, `c h²`, beside what a step costs, `a`. The cost of a unit of time, `(a + c h²) / h`, is least where both are the same.
    pub(super) fn growth(&self, stages: usize) -> f64 {
        let (all, beside) = (self.still.len() * stages, self.spent.saturating_sub(self.needed));
        (all as f64 / beside as f64).sqrt()
    }

    /// Has so much been spent on neighbours that it is cheaper to end the step?
    pub(super) fn is_spent(&self, stages: usize) -> bool {
        /// How much shorter a step should have been; it is not known beforehand when many events come together.
        const SHORTER: f64 = 0.25;
        self.growth(stages) < SHORTER
    }

    /// So many states have been evaluated by themselves.
    pub(super) fn spend(&mut self, rows: usize) {
        self.rows += rows;
        self.spent += rows;
    }

    /// A function vanishes at this time.
    pub(super) fn enter(&mut self, t: f64, source: usize, rate: f64) {
        self.heap.push(Entry { t, source, rate, version: self.versions[source] });
    }

    /// What was expected of this source does not happen.
    pub(super) fn strike_out(&mut self, source: usize) {
        self.versions[source] = self.versions[source].wrapping_add(1);
    }

    /// The next zero.
    pub(super) fn next(&mut self) -> Option<Entry> {
        while let Some(e) = self.heap.pop() {
            if e.version == self.versions[e.source] {
                return Some(e);
            }
        }
        None
    }

    /// Value of state `i` at the present event, behind what has jumped so far.
    pub(super) fn value(&self, step: &Step, i: usize, t: f64) -> f64 {
        match self.changed[i] {
            0 => self.tracks.value(step, i, t),
            k => self.changes[k as usize - 1].2,
        }
    }

    /// State `i` jumps to a value.
    pub(super) fn change(&mut self, step: &Step, i: usize, t: f64, to: f64) {
        match self.changed[i] {
            0 => {
                self.changes.push((i as u32, self.tracks.value(step, i, t), to));
                self.changed[i] = self.changes.len() as u32;
            }
            k => self.changes[k as usize - 1].2 = to,
        }
    }

    /// The next event begins.
    pub(super) fn forget_event(&mut self) {
        self.changes.iter().for_each(|c| self.changed[c.0 as usize] = 0);
        self.changes.clear();
        self.jumps.clear();
        self.fired.clear();
        self.crossed.clear();
        self.forget_asked();
    }

    /// Lists the states that the weight of subsystem `k` depends on.
    pub(super) fn list_inputs(&mut self, k: usize) {
        self.inputs.clear();
        self.depends.each_read_of_weight(k, |j| self.inputs.push(j));
        self.inputs.sort_unstable();
        self.inputs.dedup();
    }

    /// Source `q` is to be looked at.
    pub(super) fn ask(&mut self, q: usize) {
        if !std::mem::replace(&mut self.seen[q], true) {
            self.asked.push(q as u32);
        }
    }

    /// The first of those to be looked at, which is not to be any more.
    pub(super) fn first_asked(&mut self) -> Option<usize> {
        let k = (0..self.asked.len()).min_by_key(|k| self.asked[*k])?;
        let q = self.asked.swap_remove(k) as usize;
        self.seen[q] = false;
        Some(q)
    }

    /// The surfaces that are crossed have their other sides.
    pub(super) fn exchange_cells(&mut self) {
        self.crossed.iter_mut().for_each(|x| std::mem::swap(&mut self.cells[x.sub], &mut x.cell));
    }

    /// Another run begins.
    pub(super) fn reset(&mut self) {
        self.tracks.clear();
        self.reach.iter_mut().for_each(Vec::clear);
        (self.reached, self.rows) = (0, 0);
    }

    fn forget_asked(&mut self) {
        self.asked.iter().for_each(|q| self.seen[*q as usize] = false);
        self.asked.clear();
    }

    /// The states that were integrated anew at the last event of this source; nothing is known of it any more.
    pub(super) fn take_reach(&mut self, source: usize) -> impl Iterator<Item = u32> + '_ {
        self.reached -= self.reach[source].len();
        self.reach[source].drain(..)
    }

    /// Notes the states of the group that move for the next event of the source, as long as such lists are together no longer than a few lists of all
    /// states.
    pub(super) fn note_reach(&mut self, source: usize) {
        const LISTS: usize = 16;
        let own = &self.group.states[..self.group.moving];
        if self.reached + own.len() <= LISTS * self.still.len() {
            self.reach[source].extend_from_slice(own);
            self.reached += own.len();
        }
    }

    /// The group follows other pieces from time `t` on: none of them are known yet.
    pub(super) fn part_from(&mut self, t: f64) {
        let g = &mut self.group;
        g.heads.clear();
        g.heads.extend(g.states.iter().map(|i| self.tracks.head_before(*i as usize, t)));
    }

    /// Number of pieces, to give up later ones.
    pub(super) fn mark(&self) -> usize {
        self.tracks.pieces.len()
    }

    /// Gives up pieces that nothing follows.
    pub(super) fn give_up(&mut self, mark: usize) {
        self.tracks.pieces.truncate(mark);
    }

    /// The state in place `k` of the group goes on like this.
    pub(super) fn go_on(&mut self, k: usize, (t, h): (f64, f64), poly: Poly) {
        let before = self.group.heads[k];
        self.tracks.pieces.push(Piece { t, h, poly, before });
        self.group.heads[k] = self.tracks.pieces.len() as u32;
    }

    /// Value that state `i` has at time `t` with the new pieces of the group.
    pub(super) fn new_value(&self, step: &Step, i: usize, t: f64) -> f64 {
        match self.group.place(i) {
            Some(k) => self.tracks.value_from(step, i, self.group.heads[k], t),
            None => self.tracks.value(step, i, t),
        }
    }

    /// The group follows its new pieces.
    pub(super) fn commit(&mut self) {
        for (&i, &head) in self.group.states.iter().zip(&self.group.heads) {
            if self.tracks.head[i as usize] == 0 && head > 0 {
                self.tracks.touched.push(i);
            }
            self.tracks.head[i as usize] = head;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earliest_entry_is_next_and_those_struck_out_are_passed_over() {
        let mut heap = BinaryHeap::new();
        for (t, source, version) in [(2.0, 0, 0), (1.0, 3, 0), (1.0, 1, 0), (0.5, 2, 1)] {
            heap.push(Entry { t, source, rate: -1.0, version });
        }
        let order: Vec<usize> = std::iter::from_fn(|| heap.pop()).map(|e| e.source).collect();
        assert_eq!(order, [2, 1, 3, 0]);
    }

    /// `x = t³` on `0 .. 2`, from `t = 1` on `x = 1 + 5 (t - 1)`.
    #[test]
    fn pieces_take_over_from_their_start_on() {
        let mut step = Step::new(1);
        (step.t, step.h) = (0.0, 2.0);
        step.poly[0][3] = 8.0;
        let mut line = Poly::default();
        (line[0], line[1]) = (1.0, 5.0);
        let tracks =
            Tracks { pieces: vec![Piece { t: 1.0, h: 1.0, poly: line, before: 0 }], head: vec![1], touched: vec![0] };
        let at = |t| tracks.value(&step, 0, t);
        assert_eq!([at(0.5), at(1.0), at(1.5)], [0.125, 1.0, 3.5]);
        assert_eq!(tracks.derivative(&step, 0, 1, 0.5), 0.75);
        let mut breaks = Vec::new();
        tracks.breaks(0, 0.0, &mut breaks);
        assert_eq!(breaks, [1.0]);
        // (1/2 + s/2)³ with s from 0 to 1 between 1/2 and 1
        let c = tracks.between(&step, 0, (0.5, 1.0));
        assert_eq!(c[..4], [0.125, 0.375, 0.375, 0.125]);
        assert_eq!(tracks.head_before(0, 1.0), 0);
    }
}
