//! Sequences of active sets next to a given one: a switch earlier or later, a phase left out, a phase put in.
//!
//! The homotopy ends at a local optimum of the program, and with it at one order of modes on one division of the
//! switches among the control stages. Its neighbours differ in one subsystem on a run of elements.

use crate::mpcc::Side;

/// Sets proposed beside those that occur, up to this number of cells of a subsystem: all single ones and pairs.
const SMALL: usize = 4;

/// One change: subsystem `cells` has the set `set` on `elements`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Move {
    elements: std::ops::Range<usize>,
    cells: std::ops::Range<usize>,
    set: Vec<Side>,
}

impl Move {
    /// Applies the change to the sides of all elements, `n_cells` each.
    pub fn apply(&self, n_cells: usize, sides: &mut [Side]) {
        for e in self.elements.clone() {
            sides[e * n_cells..][self.cells.clone()].copy_from_slice(&self.set);
        }
    }
}

/// Elements with the same set, one after the other.
struct Phase {
    elements: std::ops::Range<usize>,
    set: Vec<Side>,
}

/// All neighbours of `sides`, the likeliest first; `sizes` are the numbers of cells of the subsystems.
pub(super) fn neighbours(sizes: &[usize], sides: &[Side]) -> Vec<Move> {
    let n_cells: usize = sizes.iter().sum();
    if n_cells == 0 {
        return Vec::new();
    }
    let (mut shifted, mut removed, mut inserted) = (Vec::new(), Vec::new(), Vec::new());
    let mut first = 0;
    for &n in sizes {
        let cells = first..first + n;
        first += n;
        let phases = phases(n_cells, &cells, sides);
        let add = |to: &mut Vec<Move>, elements: std::ops::Range<usize>, set: &[Side]| {
            let m = Move { elements, cells: cells.clone(), set: set.to_vec() };
            if !m.elements.is_empty() && !to.contains(&m) {
                to.push(m);
            }
        };
        for distance in 1..=2 {
            for p in phases.windows(2) {
                let (a, b) = (&p[0], &p[1]);
                let at = b.elements.start;
                // a phase that would vanish is taken out below
                if distance < a.elements.len() {
                    add(&mut shifted, at - distance..at, &b.set);
                }
                if distance < b.elements.len() {
                    add(&mut shifted, at..at + distance, &a.set);
                }
            }
        }
        for (k, p) in phases.iter().enumerate() {
            let around = [k.checked_sub(1), (k + 1 < phases.len()).then_some(k + 1)];
            for other in around.into_iter().flatten() {
                add(&mut removed, p.elements.clone(), &phases[other].set);
            }
        }
        let sets = sets(n, &phases);
        for p in &phases {
            for e in p.elements.clone() {
                for set in sets.iter().filter(|s| **s != p.set) {
                    add(&mut inserted, e..e + 1, set);
                }
            }
        }
    }
    for m in removed.into_iter().chain(inserted) {
        if !shifted.contains(&m) {
            shifted.push(m);
        }
    }
    shifted
}

fn phases(n_cells: usize, cells: &std::ops::Range<usize>, sides: &[Side]) -> Vec<Phase> {
    let mut out: Vec<Phase> = Vec::new();
    for (e, all) in sides.chunks_exact(n_cells).enumerate() {
        let set = &all[cells.clone()];
        match out.last_mut() {
            Some(p) if p.set == set => p.elements.end = e + 1,
            _ => out.push(Phase { elements: e..e + 1, set: set.to_vec() }),
        }
    }
    out
}

/// Active sets a subsystem of `n` cells may have: those that occur, and the small ones of small subsystems.
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

    /// Mode 0 for two elements, then mode 1 for two.
    const TWO_PHASES: [Side; 8] = [A, B, A, B, B, A, B, A];

    fn all(sizes: &[usize], sides: &[Side]) -> Vec<Vec<Side>> {
        let apply = |m: &Move| {
            let mut s = sides.to_vec();
            m.apply(sizes.iter().sum(), &mut s);
            s
        };
        neighbours(sizes, sides).iter().map(apply).collect()
    }

    #[test]
    fn a_switch_may_be_earlier_or_later_and_come_first() {
        let found = all(&[2], &TWO_PHASES);
        assert_eq!(found[0], [A, B, B, A, B, A, B, A]);
        assert_eq!(found[1], [A, B, A, B, A, B, B, A]);
        // without the switch, with either mode; a sliding mode between
        assert!(found.contains(&vec![B, A, B, A, B, A, B, A]) && found.contains(&vec![A, B, A, B, A, B, A, B]));
        assert!(found.contains(&vec![A, B, A, A, B, A, B, A]));
        assert!(found.iter().all(|s| *s != TWO_PHASES), "the sequence itself is no neighbour");
        let mut once = found.clone();
        once.dedup();
        assert_eq!(once.len(), found.len());
    }

    #[test]
    fn subsystems_change_one_at_a_time() {
        let sides = [A, B, A, B, A, B, B, A];
        for s in all(&[2, 2], &sides) {
            let changed =
                |c: std::ops::Range<usize>| sides.chunks(4).zip(s.chunks(4)).any(|(a, b)| a[c.clone()] != b[c.clone()]);
            assert!(changed(0..2) != changed(2..4));
        }
        assert!(all(&[], &[]).is_empty());
    }
}
