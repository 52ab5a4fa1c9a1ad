//! Sequences of active sets next to a given one: a switch earlier or later, a phase left out, a phase put in.
//!
//! The homotopy ends at a local optimum of the program, and with it at one order of modes on one division of the
//! switches among the control stages. Where a switch lies inside its stage is for the optimiser; so the moves that lead
//! to another optimum take it into the stage before or behind.

use std::ops::Range;

use crate::mpcc::Side;

/// Sets proposed beside those that occur, up to this number of cells of a simplex: all single ones and pairs.
const SMALL: usize = 4;

/// Elements of every control stage, and numbers of cells whose weights sum to one: these change together.
#[derive(Debug, Clone, Default)]
pub(super) struct Grid {
    pub n_fe: Vec<usize>,
    pub sizes: Vec<usize>,
}

/// Elements with the same set, one after the other.
struct Phase {
    elements: Range<usize>,
    set: Vec<Side>,
}

/// Sequences found, each of them once, and never the one they are neighbours of.
struct Found<'a> {
    from: &'a [Side],
    n_cells: usize,
    list: Vec<Vec<Side>>,
}

impl Found<'_> {
    /// `from` with the set `set` of `cells` on `elements`.
    fn change(&mut self, elements: Range<usize>, cells: &Range<usize>, set: &[Side]) {
        self.change_all(&[(elements, cells.clone(), set)]);
    }

    fn change_all(&mut self, changes: &[(Range<usize>, Range<usize>, &[Side])]) {
        let mut sides = self.from.to_vec();
        for (elements, cells, set) in changes {
            for e in elements.clone() {
                sides[e * self.n_cells..][cells.clone()].copy_from_slice(set);
            }
        }
        self.add(sides);
    }

    fn add(&mut self, sides: Vec<Side>) {
        if sides != self.from && !self.list.contains(&sides) {
            self.list.push(sides);
        }
    }
}

impl Grid {
    pub fn n_cells(&self) -> usize {
        self.sizes.iter().sum()
    }

    /// Is this the grid of such sides?
    pub fn fits(&self, sides: &[Side]) -> bool {
        sides.len() == self.n_cells() * self.n_fe.iter().sum::<usize>() && !sides.is_empty()
    }

    fn start(&self, stage: usize) -> usize {
        self.n_fe[..stage].iter().sum()
    }

    fn stage_of(&self, element: usize) -> usize {
        (1..self.n_fe.len()).take_while(|&k| self.start(k) <= element).count()
    }

    /// May a switch at the start of stage `boundary` go into the stages on both sides?
    pub fn is_switch(&self, boundary: usize, sides: &[Side]) -> bool {
        let n = self.n_cells();
        let e = self.start(boundary);
        self.n_fe[boundary - 1].min(self.n_fe[boundary]) > 1 && sides[(e - 1) * n..e * n] != sides[e * n..(e + 1) * n]
    }

    /// Elements a switch at the start of element `at` passes on its way into the stage before.
    fn earlier(&self, at: usize) -> Option<Range<usize>> {
        let stage = self.stage_of(at);
        (stage > 0 && self.n_fe[stage - 1] > 1).then(|| self.start(stage) - 1..at)
    }

    /// The same on its way into the stage behind; from the start of a stage it is that stage itself.
    fn later(&self, at: usize) -> Option<Range<usize>> {
        let stage = self.stage_of(at);
        let next = if self.start(stage) == at { stage } else { stage + 1 };
        (next < self.n_fe.len() && self.n_fe[next] > 1).then(|| at..self.start(next) + 1)
    }

    fn simplices(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut first = 0;
        self.sizes.iter().map(move |n| {
            first += n;
            first - n..first
        })
    }

    fn phases(&self, cells: &Range<usize>, sides: &[Side]) -> Vec<Phase> {
        let mut out: Vec<Phase> = Vec::new();
        for (e, all) in sides.chunks_exact(self.n_cells()).enumerate() {
            let set = &all[cells.clone()];
            match out.last_mut() {
                Some(p) if p.set == set => p.elements.end = e + 1,
                _ => out.push(Phase { elements: e..e + 1, set: set.to_vec() }),
            }
        }
        out
    }

    /// What a switch exactly between two stages may want: to be inside one of them, which its branch cannot give it;
    /// or to take the other end of its phase along.
    pub fn off_boundaries(&self, sides: &[Side]) -> Vec<Vec<Side>> {
        let n = self.n_cells();
        let mut found = Found { from: sides, n_cells: n, list: Vec::new() };
        let boundaries: Vec<usize> = (1..self.n_fe.len()).filter(|&k| self.is_switch(k, sides)).collect();
        let all = 0..n;
        for &k in &boundaries {
            let e = self.start(k);
            found.change(e - 1..e, &all, &sides[e * n..(e + 1) * n]);
            found.change(e..e + 1, &all, &sides[(e - 1) * n..e * n]);
        }
        for &k in &boundaries {
            for cells in self.simplices() {
                let phases = self.phases(&cells, sides);
                let at = self.start(k);
                if let Some(j) = phases.iter().position(|p| p.elements.start == at) {
                    for phase in [j, j - 1] {
                        self.shift_phase(&phases, phase, &cells, &mut found);
                    }
                }
            }
        }
        found.list
    }

    /// Both ends of a phase into the stages before, and into those behind.
    fn shift_phase(&self, phases: &[Phase], k: usize, cells: &Range<usize>, found: &mut Found) {
        if k == 0 || k + 1 >= phases.len() {
            return;
        }
        let (before, phase, after) = (&phases[k - 1], &phases[k], &phases[k + 1]);
        let (from, to) = (phase.elements.start, phase.elements.end);
        if let (Some(a), Some(b)) = (self.earlier(from), self.earlier(to)) {
            if a.start > before.elements.start && b.start > a.start {
                found.change_all(&[(a, cells.clone(), &phase.set), (b, cells.clone(), &after.set)]);
            }
        }
        if let (Some(a), Some(b)) = (self.later(from), self.later(to)) {
            if b.end < after.elements.end && a.end < b.end {
                found.change_all(&[(b, cells.clone(), &phase.set), (a, cells.clone(), &before.set)]);
            }
        }
    }

    /// All neighbours of `sides`, the likeliest first.
    pub fn neighbours(&self, sides: &[Side]) -> Vec<Vec<Side>> {
        let mut found = Found { from: sides, n_cells: self.n_cells(), list: Vec::new() };
        let all: Vec<(Range<usize>, Vec<Phase>)> =
            self.simplices().map(|cells| (cells.clone(), self.phases(&cells, sides))).collect();
        for (cells, phases) in &all {
            for p in phases.windows(2) {
                let at = p[1].elements.start;
                if let Some(r) = self.earlier(at).filter(|r| r.start > p[0].elements.start) {
                    found.change(r, cells, &p[1].set);
                }
                if let Some(r) = self.later(at).filter(|r| r.end < p[1].elements.end) {
                    found.change(r, cells, &p[0].set);
                }
            }
        }
        for (cells, phases) in &all {
            (0..phases.len()).for_each(|k| self.shift_phase(phases, k, cells, &mut found));
        }
        for (cells, phases) in &all {
            for p in phases.windows(2) {
                // a phase that would vanish is taken out below
                let at = p[1].elements.start;
                if p[0].elements.len() > 1 {
                    found.change(at - 1..at, cells, &p[1].set);
                }
                if p[1].elements.len() > 1 {
                    found.change(at..at + 1, cells, &p[0].set);
                }
            }
        }
        for (cells, phases) in &all {
            for (k, p) in phases.iter().enumerate() {
                let around = [k.checked_sub(1), (k + 1 < phases.len()).then_some(k + 1)];
                for other in around.into_iter().flatten() {
                    found.change(p.elements.clone(), cells, &phases[other].set);
                }
            }
        }
        for (cells, phases) in &all {
            let sets = sets(cells.len(), phases);
            for p in phases {
                for e in p.elements.clone() {
                    for set in sets.iter().filter(|s| **s != p.set) {
                        found.change(e..e + 1, cells, set);
                    }
                }
            }
        }
        found.list
    }
}

/// Active sets a simplex of `n` cells may have: those that occur, and the small ones of small simplices.
fn sets(n: usize, phases: &[Phase]) -> Vec<Vec<Side>> {
    let mut out: Vec<Vec<Side>> = Vec::new();
    let mut add = |s: Vec<Side>| {
        if !out.contains(&s) {
            out.push(s);
        }
    };
    phases.iter().for_each(|p| add(p.set.clone()));
    let of = |active: &[usize]| -> Vec<Side> {
        (0..n).map(|c| if active.contains(&c) { Side::First } else { Side::Second }).collect()
    };
    (0..n).for_each(|a| add(of(&[a])));
    if n <= SMALL {
        (0..n).for_each(|a| (a + 1..n).for_each(|b| add(of(&[a, b]))));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Side = Side::First;
    const B: Side = Side::Second;

    fn grid(n_fe: &[usize], sizes: &[usize]) -> Grid {
        Grid { n_fe: n_fe.to_vec(), sizes: sizes.to_vec() }
    }

    /// One simplex of two cells: `+` the first, `-` the second, `0` both.
    fn word(text: &str) -> Vec<Side> {
        text.chars()
            .flat_map(|c| match c {
                '+' => [A, B],
                '-' => [B, A],
                _ => [A, A],
            })
            .collect()
    }

    #[test]
    fn switches_go_into_other_stages_first_then_within_their_own() {
        let g = grid(&[3, 3], &[2]);
        let found = g.neighbours(&word("++++--"));
        // into the stage before
        assert_eq!(found[0], word("++----"));
        // within the stage, out of it, a phase between
        for w in ["+++---", "+++++-", "++++++", "------", "++++0-"] {
            assert!(found[1..].contains(&word(w)), "{w}");
        }
        assert!(found.iter().all(|s| *s != word("++++--")), "the sequence itself is no neighbour");
        let mut once = found.clone();
        once.dedup();
        assert_eq!(once.len(), found.len());
    }

    #[test]
    fn a_switch_between_stages_goes_inside_either_or_takes_its_phase_along() {
        let g = grid(&[3, 3, 3], &[2]);
        let found = g.off_boundaries(&word("+++00000-"));
        assert_eq!(found[..2], [word("++000000-"), word("++++0000-")]);
        assert_eq!(found[2..], [word("++000----")]);
        assert!(g.off_boundaries(&word("++00-----")).is_empty(), "no switch is between stages");
        // stages of one element have nothing inside
        assert!(grid(&[1, 1], &[2]).off_boundaries(&word("+-")).is_empty());
    }

    #[test]
    fn simplices_change_one_at_a_time() {
        let sides = [A, B, A, B, A, B, B, A];
        for s in grid(&[2], &[2, 2]).neighbours(&sides) {
            let changed = |c: Range<usize>| sides.chunks(4).zip(s.chunks(4)).any(|(a, b)| a[c.clone()] != b[c.clone()]);
            assert!(changed(0..2) != changed(2..4));
        }
        assert!(!grid(&[2], &[]).fits(&[]));
    }
}
