//! The linear system of the weights in a sliding mode, `C D α = −(C b + c_t)` (6.17c), with its structure.
//!
//! A row of `C` belongs to a pair of active cells of a subsystem and depends on what its indicators depend on; a column of
//! `D` moves the states that the subsystem drives. So an entry of `C D` is zero unless the indicators of the one subsystem
//! depend on the states that the other one drives. That is known beforehand. Subsystems that slide at the same time fall
//! into blocks that do not touch, and every block is factorised by itself: friction at a hundred joints costs a hundred
//! divisions, not a matrix of order a hundred.

use super::Pair;
use crate::event::step::Stages;
use crate::linalg::lu::Lu;

/// The rows of `C` of one subsystem meet the columns of `D` of another: places in the row, places in the column.
#[derive(Debug)]
struct Coupling {
    /// The subsystem whose columns these are.
    other: usize,
    places: Vec<(usize, usize)>,
}

/// Matrices of a sliding mode with the memory they need.
#[derive(Debug, Default)]
pub(in crate::event) struct Sliding {
    /// Columns of the rows of `C` of every subsystem, ascending; time is the last one where it is among them.
    columns: Vec<Vec<usize>>,
    /// How many of them are states, and whether the last one is time.
    states: Vec<(usize, bool)>,
    /// The states that every subsystem drives.
    rows: Vec<Vec<usize>>,
    couplings: Vec<Vec<Coupling>>,
    /// Of these the coupling of every subsystem with itself.
    own: Vec<Option<usize>>,
    /// Subsystems whose indicators depend on what this one drives, and itself.
    influences: Vec<Vec<usize>>,
    /// Those that touch no other one.
    untouched: Vec<bool>,
    /// Rows of `C`, and where that of every pair begins.
    pub(super) c: Vec<f64>,
    c_begin: Vec<usize>,
    /// Columns of `D`, and where that of every pair begins.
    pub(super) d: Vec<f64>,
    d_begin: Vec<usize>,
    /// Pairs in the order of the blocks, where every block begins, and for every pair its place in its block.
    order: Vec<usize>,
    begin: Vec<usize>,
    place: Vec<usize>,
    /// Block of every pair.
    block: Vec<usize>,
    /// Blocks whose weights a rule selects: they have no factors.
    left_out: Vec<bool>,
    /// The state of every pair where each of them is tied by one state, and moves that one only; else empty.
    lone: Vec<u32>,
    /// Factors of the blocks with more than one pair, and the entry of those with one.
    lu: Vec<Lu<f64>>,
    single: Vec<f64>,
    room: Vec<f64>,
}

impl Sliding {
    /// Of subsystems that drive `rows` and whose indicators depend on the inputs `columns`: states, then others, time as
    /// `n_z − 1`.
    pub(super) fn new(rows: Vec<Vec<usize>>, columns: Vec<Vec<usize>>, (nx, n_z): (usize, usize)) -> Sliding {
        let n_sub = rows.len();
        // which subsystems drive a state, and at which place
        let mut drivers: Vec<Vec<(usize, usize)>> = vec![Vec::new(); nx];
        for (k, rows) in rows.iter().enumerate() {
            for (i, &r) in rows.iter().enumerate() {
                drivers[r].push((k, i));
            }
        }
        let mut couplings: Vec<Vec<Coupling>> = Vec::with_capacity(n_sub);
        let mut influences: Vec<Vec<usize>> = vec![Vec::new(); n_sub];
        for (k, own) in columns.iter().enumerate() {
            let mut list: Vec<Coupling> = Vec::new();
            for (at, &c) in own.iter().enumerate().filter(|(_, c)| **c < nx) {
                for &(other, place) in &drivers[c] {
                    match list.iter_mut().find(|l| l.other == other) {
                        Some(l) => l.places.push((at, place)),
                        None => list.push(Coupling { other, places: vec![(at, place)] }),
                    }
                }
            }
            list.iter().for_each(|l| influences[l.other].push(k));
            couplings.push(list);
        }
        let states = columns.iter().map(|c| (c.partition_point(|c| *c < nx), c.last() == Some(&(n_z - 1)))).collect();
        let own = couplings.iter().enumerate().map(|(k, list)| list.iter().position(|c| c.other == k)).collect();
        let alone =
            |k: usize| couplings[k].iter().map(|c| c.other).chain(influences[k].iter().copied()).all(|o| o == k);
        let untouched = (0..n_sub).map(alone).collect();
        Sliding { columns, states, rows, couplings, own, influences, untouched, ..Sliding::default() }
    }

    /// Do the rates of the indicators of a subsystem depend on the modes of another?
    pub(in crate::event) fn depends(&self, on: usize) -> &[usize] {
        &self.influences[on]
    }

    /// Subsystems that the rates of the indicators of subsystem `k` depend on.
    pub(in crate::event) fn dependencies(&self, k: usize) -> impl Iterator<Item = usize> + '_ {
        self.couplings[k].iter().map(|c| c.other)
    }

    /// Makes room for every set of pairs, of which subsystem `k` has at most `pairs[k]`. Returns the entries that all columns of `D` have then.
    pub(super) fn reserve(&mut self, pairs: &[usize]) -> usize {
        let most: usize = pairs.iter().sum();
        let total = |of: &[Vec<usize>]| pairs.iter().zip(of).map(|(n, list)| n * list.len()).sum::<usize>();
        let (nc, nd) = (total(&self.columns), total(&self.rows));
        self.c.reserve(nc);
        self.d.reserve(nd);
        let lists =
            [&mut self.c_begin, &mut self.d_begin, &mut self.order, &mut self.begin, &mut self.place, &mut self.block];
        lists.into_iter().for_each(|v| v.reserve(most + 1));
        self.left_out.reserve(most + 1);
        self.lone.reserve(most);
        self.single.reserve(most);
        self.room.reserve(most);
        // a block is made of whole subsystems: the i-th of those with more than one pair has none of those before the i-th that may be in one
        let mut left = most;
        for (k, n) in pairs.iter().enumerate() {
            if *n > 1 || !self.untouched[k] {
                if left > 1 {
                    self.lu.push(Lu::with_capacity(left));
                }
                left -= n;
            }
        }
        nd
    }

    /// Lays out the matrices of the pairs, in the order of their subsystems; `first` is the first pair of every subsystem.
    pub(super) fn lay_out(&mut self, pairs: &[Pair], first: &[usize]) {
        let r = pairs.len();
        if r == 0 && self.order.is_empty() && !self.begin.is_empty() {
            return;
        }
        let (mut nc, mut nd) = (0, 0);
        self.c_begin.clear();
        self.d_begin.clear();
        for p in pairs {
            self.c_begin.push(nc);
            self.d_begin.push(nd);
            nc += self.columns[p.sub].len();
            nd += self.rows[p.sub].len();
        }
        self.c_begin.push(nc);
        self.d_begin.push(nd);
        let lone = |p: &Pair| match (&self.columns[p.sub][..], &self.rows[p.sub][..]) {
            (&[c], &[r]) if c == r => Some(c as u32),
            _ => None,
        };
        self.lone.clear();
        self.lone.extend(pairs.iter().map_while(lone));
        if self.lone.len() < r {
            self.lone.clear();
        }
        self.c.resize(nc.max(self.c.len()), 0.0);
        self.d.resize(nd.max(self.d.len()), 0.0);
        self.find_blocks(pairs, first);
        let largest = self.begin.windows(2).filter(|w| w[1] - w[0] > 1).count();
        while self.lu.len() < largest {
            self.lu.push(Lu::with_capacity(2));
        }
        self.single.resize(r.max(self.single.len()), 0.0);
        self.room.resize(r.max(self.room.len()), 0.0);
    }

    /// Pairs whose subsystems touch, directly or by way of others, are one block.
    fn find_blocks(&mut self, pairs: &[Pair], first: &[usize]) {
        const NONE: usize = usize::MAX;
        self.order.clear();
        self.begin.clear();
        self.block.clear();
        self.block.resize(pairs.len(), NONE);
        self.place.clear();
        self.place.resize(pairs.len(), 0);
        for start in 0..pairs.len() {
            if self.block[start] != NONE {
                continue;
            }
            let (number, from) = (self.begin.len(), self.order.len());
            self.begin.push(from);
            self.block[start] = number;
            self.order.push(start);
            let own = pairs[start].sub;
            if self.untouched[own] && first[own + 1] == first[own] + 1 {
                continue;
            }
            let mut at = from;
            while at < self.order.len() {
                let k = pairs[self.order[at]].sub;
                at += 1;
                for &other in self.influences[k].iter().chain(self.couplings[k].iter().map(|c| &c.other)).chain([&k]) {
                    for i in first[other]..first[other + 1] {
                        if self.block[i] == NONE {
                            self.block[i] = number;
                            self.order.push(i);
                        }
                    }
                }
            }
            // in the order of the pairs, as if there were one block only
            self.order[from..].sort_unstable();
            for (i, &pair) in self.order[from..].iter().enumerate() {
                self.place[pair] = i;
            }
        }
        self.begin.push(self.order.len());
        self.left_out.clear();
        self.left_out.resize(self.begin.len() - 1, false);
    }

    /// Number of blocks.
    pub(super) fn n_blocks(&self) -> usize {
        self.left_out.len()
    }

    /// The pairs of a block, ascending.
    pub(super) fn pairs_of(&self, block: usize) -> &[usize] {
        &self.order[self.begin[block]..self.begin[block + 1]]
    }

    /// The weights of a block are somebody else's matter: nothing is factorised or solved for it.
    pub(super) fn leave_out(&mut self, block: usize) {
        self.left_out[block] = true;
    }

    /// Are two pairs in one block?
    pub(super) fn touch(&self, i: usize, j: usize) -> bool {
        self.block[i] == self.block[j]
    }

    /// Column of `D` of pair `i`: the states it moves, and by how much.
    pub(in crate::event) fn column(&self, pair: Pair, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let values = &self.d[self.d_begin[i]..self.d_begin[i + 1]];
        self.rows[pair.sub].iter().copied().zip(values.iter().copied())
    }

    /// Where column `i` of `D` begins.
    pub(super) fn place_of_column(&self, i: usize) -> usize {
        self.d_begin[i]
    }

    /// Adds `D α`.
    pub(super) fn add_columns(&self, pairs: &[Pair], alpha: &[f64], out: &mut [f64]) {
        if !self.lone.is_empty() {
            self.lone.iter().zip(self.d.iter().zip(alpha)).for_each(|(&i, (d, a))| out[i as usize] += a * d);
            return;
        }
        for ((p, a), w) in pairs.iter().zip(alpha).zip(self.d_begin.windows(2)) {
            for (&row, d) in self.rows[p.sub].iter().zip(&self.d[w[0]..w[1]]) {
                out[row] += a * d;
            }
        }
    }

    /// Row of `C` of pair `i`: inputs, and the derivatives by them.
    pub(in crate::event) fn row(&self, pair: Pair, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let values = &self.c[self.c_begin[i]..self.c_begin[i + 1]];
        self.columns[pair.sub].iter().copied().zip(values.iter().copied())
    }

    /// The part of [`Sliding::row`] with derivatives by states.
    pub(in crate::event) fn row_of_states(&self, pair: Pair, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.row(pair, i).take(self.states[pair.sub].0)
    }

    /// Memory of the row of `C` of pair `i`.
    pub(super) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.c[self.c_begin[i]..self.c_begin[i + 1]]
    }

    /// Memory of the columns of `D` of the pairs `i`.
    pub(super) fn columns_mut(&mut self, i: std::ops::Range<usize>) -> &mut [f64] {
        &mut self.d[self.d_begin[i.start]..self.d_begin[i.end]]
    }

    /// Rate of constraint `i` for a velocity.
    pub(super) fn rate(&self, pair: Pair, i: usize, velocity: &[f64]) -> f64 {
        let moved = self.row_of_states(pair, i).map(|(c, g)| g * velocity[c]).sum::<f64>();
        if self.states[pair.sub].1 {
            moved + self.c[self.c_begin[i + 1] - 1]
        } else {
            moved
        }
    }

    /// Entry of `C D`.
    pub(super) fn entry(&self, pairs: &[Pair], i: usize, j: usize) -> f64 {
        let (k, other) = (pairs[i].sub, pairs[j].sub);
        let list = &self.couplings[k];
        let coupling = match self.own[k] {
            Some(own) if k == other => Some(&list[own]),
            _ => list.iter().find(|c| c.other == other),
        };
        let Some(coupling) = coupling else { return 0.0 };
        let (c, d) = (&self.c[self.c_begin[i]..], &self.d[self.d_begin[j]..]);
        coupling.places.iter().map(|&(a, b)| c[a] * d[b]).sum()
    }

    /// Factorises `C D`, block by block; false where it is singular to rounding.
    pub(super) fn factorise(&mut self, pairs: &[Pair], first: &[usize]) -> bool {
        let mut large = 0;
        for b in 0..self.begin.len() - 1 {
            let (from, to) = (self.begin[b], self.begin[b + 1]);
            let i = self.order[from];
            if to - from == 1 {
                let v = self.entry(pairs, i, i);
                if v == 0.0 || !v.is_finite() {
                    return false;
                }
                self.single[i] = v;
                continue;
            }
            large += 1;
            if !self.left_out[b] && !self.factorise_block((b, large - 1), pairs, first) {
                return false;
            }
        }
        true
    }

    /// Factorises block `b`, which is number `large` among those of several pairs.
    pub(super) fn factorise_block(&mut self, (b, large): (usize, usize), pairs: &[Pair], first: &[usize]) -> bool {
        let (from, to) = (self.begin[b], self.begin[b + 1]);
        let mut lu = std::mem::take(&mut self.lu[large]);
        let n = to - from;
        let m = lu.clear(n);
        for (a, &i) in self.order[from..to].iter().enumerate() {
            for coupling in &self.couplings[pairs[i].sub] {
                for j in first[coupling.other]..first[coupling.other + 1] {
                    m[a * n + self.place[j]] = self.entry(pairs, i, j);
                }
            }
        }
        let regular = lu.factorise();
        self.lu[large] = lu;
        regular
    }

    /// The terms of the entry of `C D` of pair `i`: a factor, and the place of the other among the columns of `D`.
    pub(super) fn own_entry(&self, pair: Pair, i: usize) -> impl Iterator<Item = (f64, usize)> + '_ {
        let own = self.own[pair.sub].map_or(&[][..], |own| &self.couplings[pair.sub][own].places[..]);
        own.iter().map(move |&(a, b)| (self.c[self.c_begin[i] + a], self.d_begin[i] + b))
    }

    /// All columns of `D`, one after the other.
    pub(super) fn columns(&self) -> &[f64] {
        &self.d[..self.d_begin.last().copied().unwrap_or(0)]
    }

    /// Where the column of pair `i` is among them.
    pub(super) fn places_of_column(&self, i: usize) -> std::ops::Range<usize> {
        self.d_begin[i]..self.d_begin[i + 1]
    }

    /// Takes the columns of block `b` from what was kept of them at stage `i`.
    pub(super) fn recall(&mut self, b: usize, traces: &[Stages], i: usize) {
        for &pair in &self.order[self.begin[b]..self.begin[b + 1]] {
            let own = self.d_begin[pair]..self.d_begin[pair + 1];
            self.d[own.clone()].iter_mut().zip(&traces[own]).for_each(|(d, trace)| *d = trace[i]);
        }
    }

    /// Is the weight of pair `i` alone in its block, and does its surface attract: `C D > 0`, as it was factorised last?
    pub(super) fn attracts_alone(&self, i: usize) -> bool {
        let b = self.block[i];
        self.begin[b + 1] - self.begin[b] == 1 && self.single[i] > 0.0
    }

    /// Is pair `i` alone in its block?
    pub(super) fn is_alone(&self, i: usize) -> bool {
        let b = self.block[i];
        self.begin[b + 1] - self.begin[b] == 1
    }

    /// The entry of `C D` of pair `i`, which is alone in its block, as it was factorised last.
    pub(super) fn alone(&self, i: usize) -> f64 {
        self.single[i]
    }

    /// Rate of constraint `i` where nothing moves.
    pub(super) fn rate_by_time(&self, pair: Pair, i: usize) -> f64 {
        if self.states[pair.sub].1 {
            self.c[self.c_begin[i + 1] - 1]
        } else {
            0.0
        }
    }

    /// Rate of constraint `i` along a mode of subsystem `other`.
    pub(super) fn along_modes(&self, pair: Pair, i: usize, other: usize, mode: &[f64]) -> f64 {
        let coupling = self.couplings[pair.sub].iter().find(|c| c.other == other);
        let c = &self.c[self.c_begin[i]..];
        coupling.map_or(0.0, |o| o.places.iter().map(|&(a, b)| c[a] * mode[b]).sum())
    }

    /// Weights of the pairs, and their factors, where every pair is alone in its block: `alpha = −(C b + c_t) / (C D)`. None
    /// where one is not, false where a factor is singular.
    pub(super) fn weights_alone(&mut self, pairs: &[Pair], base: &[f64], alpha: &mut [f64]) -> Option<bool> {
        if self.begin.len() != pairs.len() + 1 {
            return None;
        }
        if !self.lone.is_empty() {
            let mut regular = true;
            let own = self.lone.iter().zip(self.c.iter().zip(&self.d)).zip(self.single.iter_mut().zip(alpha));
            for ((&state, (c, d)), (single, alpha)) in own {
                let entry = c * d;
                regular &= entry != 0.0 && entry.is_finite();
                *single = entry;
                *alpha = -(c * base[state as usize]) / entry;
            }
            return Some(regular);
        }
        for (i, (p, alpha)) in pairs.iter().zip(alpha).enumerate() {
            let (n, timed) = self.states[p.sub];
            let c = &self.c[self.c_begin[i]..self.c_begin[i + 1]];
            let mut rate = 0.0;
            for (c, &state) in c[..n].iter().zip(&self.columns[p.sub]) {
                rate += c * base[state];
            }
            if timed {
                rate += c[c.len() - 1];
            }
            let d = &self.d[self.d_begin[i]..];
            let own = self.own[p.sub].map(|own| &self.couplings[p.sub][own].places[..]);
            let mut entry = 0.0;
            for &(a, b) in own.unwrap_or(&[]) {
                entry += c[a] * d[b];
            }
            if entry == 0.0 || !entry.is_finite() {
                return Some(false);
            }
            self.single[i] = entry;
            *alpha = -rate / entry;
        }
        Some(true)
    }

    /// Solves with `C D`, as it was factorised last.
    pub(super) fn solve(&mut self, b: &mut [f64]) {
        self.solve_rows(1, b);
    }

    /// The same for `n` right-hand sides, `b [r × n]`.
    pub(super) fn solve_rows(&mut self, n: usize, b: &mut [f64]) {
        self.solve_with(n, b, |lu, b| lu.solve(b));
    }

    /// Solves with the transpose of `C D`.
    pub(super) fn solve_transposed(&mut self, b: &mut [f64]) {
        self.solve_with(1, b, |lu, b| lu.solve_transposed(b));
    }

    /// Solves with block `large` among those of several pairs, as it was factorised last, for `n` right-hand sides, `b [m × n]`.
    pub(super) fn solve_block(&mut self, large: usize, n: usize, b: &mut [f64]) {
        let m = b.len() / n.max(1);
        let room = &mut self.room[..m];
        for c in 0..n {
            room.iter_mut().zip(b[c..].iter().step_by(n)).for_each(|(r, v)| *r = *v);
            if room.iter().any(|v| *v != 0.0) {
                self.lu[large].solve(room);
                room.iter().zip(b[c..].iter_mut().step_by(n)).for_each(|(r, v)| *v = *r);
            }
        }
    }

    fn solve_with(&mut self, n: usize, b: &mut [f64], solve: impl Fn(&mut Lu<f64>, &mut [f64])) {
        let mut large = 0;
        for (w, left_out) in self.begin.windows(2).zip(&self.left_out) {
            let own = &self.order[w[0]..w[1]];
            if let &[i] = own {
                b[i * n..(i + 1) * n].iter_mut().for_each(|v| *v /= self.single[i]);
                continue;
            }
            large += 1;
            if *left_out {
                continue;
            }
            let room = &mut self.room[..own.len()];
            for c in 0..n {
                room.iter_mut().zip(own).for_each(|(r, &i)| *r = b[i * n + c]);
                // most of many right-hand sides have nothing here
                if room.iter().any(|v| *v != 0.0) {
                    solve(&mut self.lu[large - 1], room);
                    room.iter().zip(own).for_each(|(r, &i)| b[i * n + c] = *r);
                }
            }
        }
    }
}
