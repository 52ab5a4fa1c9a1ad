//! Derivatives over an explicit step, a few columns at a time: all stages of so few stay in the fast memory, and one instruction
//! does the same to all columns of a panel.

use super::explicit::Pair;
use super::field::Rows;
use super::pairs::{bs3, dop853, dp5, Row};
use super::step::Stages;
use crate::linalg::dense::{widest, Kernel};

/// Columns of a panel.
const WIDE: usize = 8;
const NARROW: usize = 4;
/// Stages of a step at most, its end included.
const STAGES: usize = 13;
/// What is kept of a row: its start, and its derivatives at the stages.
const KEPT: usize = STAGES + 1;

/// A row of a panel; a narrow one uses the first of them.
type Lanes = [f64; WIDE];

/// Some columns of the derivatives, and the rows where these can be other than zero.
#[derive(Debug, Default)]
struct Panel {
    rows: Vec<u32>,
    columns: Vec<u32>,
}

/// All columns, and the memory to move them over a step.
#[derive(Debug)]
pub(super) struct Panels {
    nx: usize,
    n_z: usize,
    /// The input that the first column is of.
    first: usize,
    panels: Vec<Panel>,
    y: Vec<Lanes>,
    k: Vec<Lanes>,
    /// Rows that change in the present step, and those of a panel among them.
    changes: Vec<bool>,
    moving: Vec<u32>,
}

/// One step: the pair, its length, weights of the stages where it ends inside, what is gone along the velocity behind its end, and the
/// Jacobians at the stages.
pub(super) struct Linearised<'a> {
    pub(super) pair: Pair,
    pub(super) h: f64,
    pub(super) inside: Option<Stages>,
    pub(super) rest: f64,
    pub(super) stages: &'a [Rows],
}

impl Panels {
    /// Of the inputs from `first` on, the last of `n_z` left out, which is the time; with `inputs[i]` those that row `i` can depend on, none where
    /// nothing is known of that.
    pub(super) fn new(nx: usize, n_z: usize, first: usize, inputs: Option<&[Vec<usize>]>) -> Panels {
        let asked = first..n_z - 1;
        let mut rows: Vec<Vec<u32>> = vec![Vec::new(); n_z];
        match inputs {
            Some(inputs) => {
                for (i, inputs) in inputs.iter().enumerate() {
                    inputs.iter().filter(|c| asked.contains(c)).for_each(|c| rows[*c].push(i as u32));
                }
            }
            None => rows[asked.clone()].iter_mut().for_each(|r| r.extend(0..nx as u32)),
        }
        let mut order: Vec<usize> = asked.filter(|c| !rows[*c].is_empty()).collect();
        order.sort_by(|a, b| rows[*a].cmp(&rows[*b]));
        let mut panels: Vec<Panel> = Vec::new();
        for c in order {
            let own = std::mem::take(&mut rows[c]);
            if let Some(last) = panels.last_mut().filter(|p| p.columns.len() < WIDE) {
                let both = union(&last.rows, &own);
                // rows without entries are less work than a panel more
                if 4 * both.len() <= 5 * own.len().max(last.rows.len()) {
                    last.rows = both;
                    last.columns.push(c as u32);
                    continue;
                }
            }
            panels.push(Panel { rows: own, columns: vec![c as u32] });
        }
        let most = panels.iter().map(|p| p.rows.len()).max().unwrap_or(0);
        Panels {
            nx,
            n_z,
            first,
            panels,
            y: vec![[0.0; WIDE]; n_z],
            k: vec![[0.0; WIDE]; most * KEPT],
            changes: Vec::with_capacity(nx),
            moving: Vec::with_capacity(nx),
        }
    }

    /// Do these have fewer entries than the whole matrix?
    pub(super) fn is_sparse(&self) -> bool {
        self.panels.iter().any(|p| p.rows.len() < self.nx)
    }

    /// `K_i = J_i (S + h Σ_j a_ij K_j)`, `S⁺ = S + h Σ_j b_j K_j` and the rest behind the end, with `S` row-major.
    pub(super) fn explicit(&mut self, step: &Linearised, s: &mut [f64]) {
        self.find_changes(step.stages, s);
        widest(Sweep { step, s, to: self });
    }

    /// Finds the rows that change: those of states that a sliding mode holds still do not, and neither do those that depend on such
    /// rows only, where these are zero.
    fn find_changes(&mut self, stages: &[Rows], s: &[f64]) {
        let (nx, n_c) = (self.nx, self.n_z - 1 - self.first);
        self.changes.clear();
        let alike = stages.iter().all(|j| j.is_like(&stages[0]));
        if !alike || stages.is_empty() {
            self.changes.resize(nx, true);
            return;
        }
        self.changes.extend((0..nx).map(|a| !stages[0].row(a).0.is_empty()));
        if !self.changes.contains(&false) {
            return;
        }
        for a in (0..nx).filter(|a| !stages[0].row(*a).0.is_empty()) {
            let quiet = |z: &u32| {
                let z = *z as usize;
                z < nx && stages[0].row(z).0.is_empty() && s[z * n_c..(z + 1) * n_c].iter().all(|v| *v == 0.0)
            };
            self.changes[a] = !stages[0].row(a).0.iter().all(quiet);
        }
    }
}

/// Of two ascending lists.
fn union(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut out: Vec<u32> = a.iter().chain(b).copied().collect();
    out.sort_unstable();
    out.dedup();
    out
}

struct Sweep<'a, 'b> {
    step: &'a Linearised<'b>,
    s: &'a mut [f64],
    to: &'a mut Panels,
}

impl Kernel for Sweep<'_, '_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Panels { nx, n_z, first, panels, y, k, changes, moving } = self.to;
        for p in panels.iter() {
            moving.clear();
            moving.extend(p.rows.iter().copied().filter(|a| changes[*a as usize]));
            match p.columns.len() <= NARROW {
                true => panel::<NARROW, FUSED>((*nx, *n_z, *first), (p, moving), self.step, self.s, y, k),
                false => panel::<WIDE, FUSED>((*nx, *n_z, *first), (p, moving), self.step, self.s, y, k),
            }
        }
    }
}

/// `sum + a v`, for all columns.
#[inline(always)]
fn add<const W: usize, const FUSED: bool>(a: f64, v: &Lanes, sum: &mut Lanes) {
    for l in 0..W {
        sum[l] = if FUSED { a.mul_add(v[l], sum[l]) } else { a * v[l] + sum[l] };
    }
}

/// A panel while it is moved over a step: its rows, the step, room for the arguments of the stages, and what is kept of the rows.
struct Moved<'a, 'b> {
    rows: &'a [u32],
    step: &'a Linearised<'b>,
    y: &'a mut [Lanes],
    k: &'a mut [Lanes],
}

impl Moved<'_, '_> {
    /// The arguments of a stage. The length of its row of the tableau is known when this is compiled: the weights stay in registers.
    #[inline(always)]
    fn argument<const W: usize, const FUSED: bool, const M: usize>(&mut self, row: &Row<M>) {
        let scaled = row.map(|(_, a)| self.step.h * a);
        for (own, &a) in self.k.chunks_exact(KEPT).zip(self.rows) {
            let own: &[Lanes; KEPT] = own.try_into().expect("a chunk");
            let mut sum = own[0];
            for m in 0..M {
                add::<W, FUSED>(scaled[m], &own[1 + row[m].0], &mut sum);
            }
            self.y[a as usize] = sum;
        }
    }

    /// The arguments where the step ends inside.
    #[inline(always)]
    fn argument_inside<const W: usize, const FUSED: bool>(&mut self, weights: &Stages, n: usize) {
        for (own, &a) in self.k.chunks_exact(KEPT).zip(self.rows) {
            let mut sum = own[0];
            for (w, k) in weights[..n].iter().zip(&own[1..]) {
                add::<W, FUSED>(self.step.h * w, k, &mut sum);
            }
            self.y[a as usize] = sum;
        }
    }

    /// The derivatives at stage `i`.
    #[inline(always)]
    fn derivatives<const W: usize, const FUSED: bool>(&mut self, i: usize) {
        let jacobian = &self.step.stages[i];
        for (own, &a) in self.k.chunks_exact_mut(KEPT).zip(self.rows) {
            let mut sum = [0.0; WIDE];
            let (columns, values) = jacobian.row(a as usize);
            columns.iter().zip(values).for_each(|(z, v)| add::<W, FUSED>(*v, &self.y[*z as usize], &mut sum));
            own[1 + i] = sum;
        }
    }

    #[inline(always)]
    fn stage<const W: usize, const FUSED: bool, const M: usize>(&mut self, i: usize, row: &Row<M>) {
        self.argument::<W, FUSED, M>(row);
        self.derivatives::<W, FUSED>(i);
    }

    /// Everything up to the argument at the end.
    #[inline(always)]
    fn stages<const W: usize, const FUSED: bool>(&mut self) {
        macro_rules! stages {
            ($pair:ident: $($i:literal $row:ident)*, $end:ident) => {{
                self.stage::<W, FUSED, 0>(0, &[]);
                $(self.stage::<W, FUSED, _>($i, &$pair::$row);)*
                self.argument::<W, FUSED, _>(&$pair::$end);
            }};
        }
        match self.step.pair {
            Pair::Bs3 => stages!(bs3: 1 A1 2 A2, A3),
            Pair::Dp5 => stages!(dp5: 1 A1 2 A2 3 A3 4 A4 5 A5, A6),
            Pair::Dop853 => {
                stages!(dop853: 1 A1 2 A2 3 A3 4 A4 5 A5 6 A6 7 A7 8 A8 9 A9 10 A10 11 A11, A12);
            }
        }
    }
}

#[inline(always)]
fn panel<const W: usize, const FUSED: bool>(
    (nx, n_z, first): (usize, usize, usize),
    (p, moving): (&Panel, &[u32]),
    step: &Linearised,
    s: &mut [f64],
    y: &mut [Lanes],
    k: &mut [Lanes],
) {
    // parameters, controls and time do not move: their rows are those of the identity
    let n_c = n_z - 1 - first;
    let (y, k) = (&mut y[..n_z], &mut k[..moving.len() * KEPT]);
    for (l, c) in p.columns.iter().enumerate().filter(|(_, c)| **c as usize >= nx) {
        y[*c as usize][l] = 1.0;
    }
    if moving.len() < p.rows.len() {
        for &a in &p.rows {
            let start = &s[a as usize * n_c..(a as usize + 1) * n_c];
            y[a as usize].iter_mut().zip(&p.columns).for_each(|(own, c)| *own = start[*c as usize - first]);
        }
    }
    for (own, &a) in k.chunks_exact_mut(KEPT).zip(moving) {
        let start = &s[a as usize * n_c..(a as usize + 1) * n_c];
        own[0] = [0.0; WIDE];
        own[0].iter_mut().zip(&p.columns).for_each(|(own, c)| *own = start[*c as usize - first]);
    }
    let mut moved = Moved { rows: moving, step, y, k };
    moved.stages::<W, FUSED>();
    let last = step.pair.rows().0.len() - 1;
    if step.rest != 0.0 || step.inside.is_some() {
        moved.derivatives::<W, FUSED>(last);
    }
    if let Some(weights) = &step.inside {
        moved.argument_inside::<W, FUSED>(weights, last + 1);
    }
    for (own, &a) in k.chunks_exact(KEPT).zip(moving) {
        let end = &mut s[a as usize * n_c..(a as usize + 1) * n_c];
        let y = &mut y[a as usize];
        if step.rest != 0.0 {
            add::<W, FUSED>(step.rest, &own[1 + last], y);
        }
        p.columns.iter().zip(y.iter()).for_each(|(c, y)| end[*c as usize - first] = *y);
    }
    // nothing outside of the rows of the next one
    p.rows.iter().for_each(|a| y[*a as usize] = [0.0; WIDE]);
    for (l, c) in p.columns.iter().enumerate().filter(|(_, c)| **c as usize >= nx) {
        y[*c as usize][l] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::explicit::weights_at;

    /// Numbers that have nothing to do with each other.
    fn number(i: usize) -> f64 {
        (1.0 + 7.3 * i as f64).sin()
    }

    /// Chains of the states `2i`, `2i + 1` and one parameter each: a column may go with the others of its chain only.
    fn chains(n: usize) -> Vec<Vec<usize>> {
        (0..2 * n).map(|i| vec![i - i % 2, i - i % 2 + 1, 2 * n + i / 2]).collect()
    }

    #[test]
    fn columns_that_do_not_meet_cost_their_own_rows_only() {
        let size = |n: usize| {
            let all = Panels::new(2 * n, 3 * n + 1, 0, Some(&chains(n)));
            assert_eq!(all.panels.iter().map(|p| p.columns.len()).sum::<usize>(), 3 * n);
            all.panels.iter().map(|p| p.rows.len() * p.columns.len()).sum::<usize>()
        };
        assert_eq!((size(1), size(7), size(50)), (6, 42, 300));
        assert!(
            !Panels::new(2, 4, 0, Some(&chains(1))).is_sparse() && Panels::new(4, 7, 0, Some(&chains(2))).is_sparse()
        );
    }

    /// The stages with full matrices, column by column.
    fn by_hand(step: &Linearised, full: &[Vec<f64>], (nx, n_c): (usize, usize), s: &mut [f64]) {
        let (tableau, _) = step.pair.rows();
        for c in 0..n_c {
            let mut k: Vec<Vec<f64>> = Vec::new();
            for (i, row) in tableau.iter().enumerate() {
                let y = |a: usize| s[a * n_c + c] + step.h * row.iter().map(|&(j, v)| v * k[j][a]).sum::<f64>();
                let y: Vec<f64> = (0..nx).map(y).collect();
                let rate = |a: usize| -> f64 {
                    let own = &full[i][a * (n_c + 1)..(a + 1) * (n_c + 1)];
                    let by_input = if c < nx { 0.0 } else { own[c] };
                    by_input + own.iter().zip(&y).map(|(j, y)| j * y).sum::<f64>()
                };
                let rates: Vec<f64> = (0..nx).map(rate).collect();
                k.push(rates);
                if i + 1 == tableau.len() {
                    let inside = |a: usize, w: &Stages| -> f64 { k.iter().zip(w).map(|(k, w)| w * k[a]).sum() };
                    let end = |a: usize| match &step.inside {
                        Some(w) => s[a * n_c + c] + step.h * inside(a, w),
                        None => y[a] + step.rest * k[i][a],
                    };
                    let end: Vec<f64> = (0..nx).map(end).collect();
                    (0..nx).for_each(|a| s[a * n_c + c] = end[a]);
                }
            }
        }
    }

    #[test]
    fn panels_move_every_column_like_full_matrices() {
        let all = [
            (Pair::Bs3, 2, 0.01, 1.0),
            (Pair::Bs3, 2, 0.0, 0.7),
            (Pair::Dp5, 1, 0.0, 1.0),
            (Pair::Dp5, 3, 0.0, 0.9),
            (Pair::Dop853, 3, 0.01, 1.0),
            (Pair::Dop853, 9, 0.0, 1.0),
        ];
        for (pair, n, rest, part) in all {
            let inside = (part < 1.0).then(|| weights_at(pair, part));
            let (nx, n_c) = (2 * n, 3 * n);
            let inputs = chains(n);
            let full: Vec<Vec<f64>> = (0..STAGES)
                .map(|i| {
                    let mut m = vec![0.0; nx * (n_c + 1)];
                    for (a, inputs) in inputs.iter().enumerate() {
                        inputs.iter().for_each(|c| m[a * (n_c + 1) + c] = number(i * 100 + a * 10 + c));
                        m[a * (n_c + 1) + n_c] = 1e3;
                    }
                    m
                })
                .collect();
            let stages: Vec<Rows> = full.iter().map(|m| Rows::of_full(m, n_c + 1)).collect();
            let step = Linearised { pair, h: 0.3, inside, rest, stages: &stages };
            let mut start = vec![0.0; nx * n_c];
            for (a, inputs) in inputs.iter().enumerate() {
                inputs.iter().for_each(|c| start[a * n_c + c] = number(7 * a + c));
            }
            let mut expected = start.clone();
            by_hand(&step, &full, (nx, n_c), &mut expected);
            for own in [None, Some(&inputs[..])] {
                let mut s = start.clone();
                let mut panels = Panels::new(nx, n_c + 1, 0, own);
                // twice: nothing of the first time is left
                panels.explicit(&step, &mut s);
                s.copy_from_slice(&start);
                panels.explicit(&step, &mut s);
                for (v, e) in s.iter().zip(&expected) {
                    assert!((v - e).abs() <= 1e-13 * (1.0 + e.abs()), "{n} chains: {v} and not {e}");
                }
            }
        }
    }
}
