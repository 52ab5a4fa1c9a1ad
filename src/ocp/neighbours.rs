//! Sequences of active sets next to a given one: a switch earlier or later, a phase left out, a phase put in.
//!
//! The homotopy ends at a local optimum of the program, and with it at one order of modes on one division of the
//! switches among the control stages. Where a switch lies inside its stage is for the optimiser; so the moves that lead
//! to another optimum take it into the stage before or behind.

use std::ops::Range;

use crate::dcs::Across;
use crate::mpcc::Side;

/// Sets proposed beside those that occur, up to this number of cells of a simplex: all single ones and pairs.
const SMALL: usize = 4;

/// Elements of every control stage, numbers of cells that change together, and how these go on from stage to stage.
#[derive(Debug, Clone, Default)]
pub(super) struct Grid {
    pub n_fe: Vec<usize>,
    pub sizes: Vec<usize>,
    pub across: Vec<Across>,
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

    /// Elements of a stage.
    fn stage(&self, k: usize) -> Range<usize> {
        self.start(k)..self.start(k) + self.n_fe[k]
    }

    fn stage_of(&self, element: usize) -> usize {
        (1..self.n_fe.len()).take_while(|&k| self.start(k) <= element).count()
    }

    /// Cells whose sets change at the start of stage `boundary`, and might as well in the stages on both sides: their indicators are
    /// continuous there.
    pub fn switches(&self, boundary: usize, sides: &[Side]) -> Vec<Range<usize>> {
        let n = self.n_cells();
        let e = self.start(boundary);
        if self.n_fe[boundary - 1].min(self.n_fe[boundary]) < 2 {
            return Vec::new();
        }
        let (before, after) = (&sides[(e - 1) * n..e * n], &sides[e * n..(e + 1) * n]);
        self.simplices()
            .filter(|s| s.1 == Across::Tied && before[s.0.clone()] != after[s.0.clone()])
            .map(|s| s.0)
            .collect()
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

    fn simplices(&self) -> impl Iterator<Item = (Range<usize>, Across)> + '_ {
        let mut first = 0;
        self.sizes.iter().zip(&self.across).map(move |(n, across)| {
            first += n;
            (first - n..first, *across)
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
        let boundaries: Vec<(usize, Vec<Range<usize>>)> = (1..self.n_fe.len())
            .map(|k| (self.start(k), self.switches(k, sides)))
            .filter(|(_, switching)| !switching.is_empty())
            .collect();
        for (e, switching) in &boundaries {
            let with = |at: usize, from: usize| -> Vec<(Range<usize>, Range<usize>, &[Side])> {
                let set = |c: &Range<usize>| &sides[from * n..][c.clone()];
                switching.iter().map(|c| (at..at + 1, c.clone(), set(c))).collect()
            };
            found.change_all(&with(e - 1, *e));
            found.change_all(&with(*e, e - 1));
        }
        for (at, switching) in &boundaries {
            for cells in switching {
                let phases = self.phases(cells, sides);
                if let Some(j) = phases.iter().position(|p| p.elements.start == *at) {
                    for phase in [j, j - 1] {
                        self.shift_phase(&phases, phase, cells, &mut found);
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
        let of = |at_ends: bool| -> Vec<(Range<usize>, Vec<Phase>)> {
            let simplices = self.simplices().filter(|s| (s.1 == Across::Nothing) == at_ends);
            simplices.map(|(cells, _)| (cells.clone(), self.phases(&cells, sides))).collect()
        };
        let (all, chosen) = (of(false), of(true));
        for (cells, phases) in &chosen {
            for p in phases.windows(2) {
                let at = p[1].elements.start;
                let stage = self.stage_of(at);
                // what is exactly on the surface may be on both sides in one stage
                let before = if self.start(stage) == at { stage - 1 } else { stage };
                found.change(self.stage(before), cells, &p[1].set);
                found.change(self.stage(stage), cells, &p[0].set);
            }
        }
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
        for (cells, phases) in &chosen {
            let sets = sets(cells.len(), phases);
            for stage in 0..self.n_fe.len() {
                sets.iter().for_each(|set| found.change(self.stage(stage), cells, set));
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
        Grid { n_fe: n_fe.to_vec(), sizes: sizes.to_vec(), across: vec![Across::Tied; sizes.len()] }
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
    fn modes_that_controls_choose_change_by_whole_stages() {
        let g = Grid { across: vec![Across::Nothing], ..grid(&[2, 2, 2], &[2]) };
        let sides = word("++--++");
        assert!(g.off_boundaries(&sides).is_empty());
        let found = g.neighbours(&sides);
        assert_eq!(found[..3], ["----++", "++++++", "++----"].map(word));
        assert!(found.contains(&word("++00++")));
        assert!(
            found.iter().all(|s| s.chunks(4).all(|stage| stage[..2] == stage[2..])),
            "no switch is inside of a stage"
        );
    }

    #[test]
    fn modes_that_controls_choose_exactly_on_a_surface_become_those_of_whole_stages() {
        let g = Grid { across: vec![Across::Nothing], ..grid(&[3, 2], &[2]) };
        let found = g.neighbours(&word("++0--"));
        for w in ["000--", "+++--"] {
            assert!(found.contains(&word(w)), "{w}");
        }
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
