//! From a sum of switching terms to modes and regions of one subsystem.

use super::bounds::Bounds;
use super::certificate::Conflict;
use super::reach::Reach;
use super::signs::{Numbers, Signs};
use crate::error::{Error, Result};
use crate::expr::{Dag, Id, Node};
use crate::stop;

/// Cells a subsystem may have.
pub(super) const MAX_CELLS: usize = 4096;

/// What a subsystem adds to one state: `Σ factor · atom`.
#[derive(Debug, Clone)]
pub(super) struct Row {
    pub(super) state: usize,
    pub(super) terms: Vec<(Id, Id)>,
}

/// One subsystem: modes by sign pattern, after reduction.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    /// Switching functions that matter.
    pub(super) switches: Vec<usize>,
    /// States that are driven.
    pub(super) rows: Vec<usize>,
    /// Row of the sign matrix (0: does not matter), and the values for every driven state.
    pub(super) modes: Vec<(Vec<i8>, Vec<Id>)>,
    /// Patterns before reduction: possible, and all.
    pub(super) n_patterns: (usize, f64),
    /// Switching functions that were dropped because no mode depends on them.
    pub(super) without_effect: Vec<usize>,
    /// What turned out to be the same in all modes: state and value.
    pub(super) smooth: Vec<(usize, Id)>,
    /// Switching functions before reduction, and why some of their patterns cannot occur (numbers among these).
    pub(super) coupled: Vec<usize>,
    pub(super) conflicts: Vec<Conflict>,
    /// Conditions of choices that no pattern makes true, or false, with the value they always have.
    pub(super) decided: Vec<(Id, bool)>,
    /// The parts that switch, as they were written.
    pub(super) atoms: Vec<Id>,
    /// Sign patterns before reduction.
    pub(super) patterns: Vec<Vec<bool>>,
}

impl Cells {
    /// Cells of full sign patterns, the unit that has multipliers of its own.
    pub(super) fn n_cells(&self) -> usize {
        self.modes.iter().map(|m| 1usize << m.0.iter().filter(|s| **s == 0).count()).sum()
    }

    /// The atoms in mode `mode`: its values are those of every pattern that it stands for.
    pub(super) fn atoms_in(&self, dag: &mut Dag, mode: usize) -> Option<Vec<Id>> {
        let signs = &self.modes[mode].0;
        let place = |s: usize| self.coupled.iter().position(|c| *c == s);
        let places: Vec<usize> = self.switches.iter().map(|&s| place(s)).collect::<Option<_>>()?;
        let fits = |p: &&Vec<bool>| places.iter().zip(signs).all(|(&k, &s)| s == 0 || (s > 0) == p[k]);
        let pattern = self.patterns.iter().find(fits)?;
        Some(dag.decide(&self.atoms, &|s| place(s).map(|k| pattern[k])))
    }

    /// Different vector fields.
    pub(super) fn n_distinct(&self) -> usize {
        let mut all: Vec<&Vec<Id>> = self.modes.iter().map(|m| &m.1).collect();
        all.sort_unstable();
        all.dedup();
        all.len()
    }
}

/// Enumerates and reduces; none where there are too many patterns. `nested` says that choices stood inside of choices.
pub(super) fn cells(
    dag: &mut Dag,
    bounds: &Bounds,
    switches: &[usize],
    rows: &[Row],
    nested: bool,
) -> Result<Option<Cells>> {
    let psi: Vec<Id> = switches.iter().filter_map(|&s| dag.switching_function(s)).collect();
    let Some(found) = Reach::new(dag, bounds, &psi).patterns(MAX_CELLS, nested)? else { return Ok(None) };
    let n_patterns = (found.all.len(), 2f64.powi(psi.len() as i32));
    let patterns = found.all.clone();
    let mut atoms: Vec<Id> = rows.iter().flat_map(|r| r.terms.iter().map(|t| t.1)).collect();
    atoms.sort_unstable();
    atoms.dedup();
    if found.all.is_empty() {
        return Err(Error::Internal("switching functions without a sign pattern".into()));
    }
    let mut all: Vec<(Signs, Vec<Id>)> = Vec::with_capacity(found.all.len());
    let conditions = conditions(dag, rows);
    // Did a pattern make the condition false, did one make it true?
    let mut seen = vec![[false; 2]; conditions.len()];
    let roots: Vec<Id> = rows.iter().flat_map(|r| r.terms.iter().map(|t| t.1)).collect();
    let (values, choices) = (dag.undecided(&roots), dag.undecided(&conditions));
    let mut place = vec![None; switches.last().map_or(0, |s| s + 1)];
    switches.iter().enumerate().for_each(|(k, &s)| place[s] = Some(k));
    for p in found.all {
        stop::check()?;
        let sign = |s: usize| place.get(s).copied().flatten().map(|k| p[k]);
        let mut decided = dag.decide_all(&values, &sign).into_iter();
        let mut sums = Vec::with_capacity(rows.len());
        for row in rows {
            let mut sum = dag.constant(0.0);
            for (&(factor, _), v) in row.terms.iter().zip(decided.by_ref()) {
                let term = dag.mul(factor, v);
                sum = dag.add(sum, term);
            }
            sums.push(sum);
        }
        let truths = dag.truths(&choices, &sign);
        for (seen, c) in seen.iter_mut().zip(&conditions) {
            match truths.get(c) {
                Some(holds) => seen[usize::from(*holds)] = true,
                None => *seen = [true; 2],
            }
        }
        all.push((p.iter().map(|&s| if s { 1 } else { -1 }).collect(), sums));
    }
    let mut out = Cells {
        switches: switches.to_vec(),
        rows: Vec::new(),
        modes: Vec::new(),
        n_patterns,
        without_effect: Vec::new(),
        smooth: Vec::new(),
        coupled: switches.to_vec(),
        conflicts: found.conflicts,
        decided: conditions.iter().zip(&seen).filter(|c| c.1[0] != c.1[1]).map(|c| (*c.0, c.1[1])).collect(),
        atoms,
        patterns,
    };
    drop_switches(&mut out, &mut all);
    // Rows without difference between modes are smooth.
    let differs: Vec<bool> = (0..rows.len()).map(|r| all.iter().any(|m| m.1[r] != all[0].1[r])).collect();
    for (r, row) in rows.iter().enumerate() {
        if differs[r] {
            out.rows.push(row.state);
        } else {
            out.smooth.push((row.state, all[0].1[r]));
        }
    }
    let keep = |v: &[Id]| v.iter().zip(&differs).filter(|d| *d.1).map(|d| *d.0).collect::<Vec<Id>>();
    out.modes = merge(all.into_iter().map(|(p, v)| (p, keep(&v))).collect());
    Ok(Some(out))
}

/// Conditions of the choices in the terms.
fn conditions(dag: &Dag, rows: &[Row]) -> Vec<Id> {
    let atoms: Vec<Id> = rows.iter().flat_map(|r| r.terms.iter().map(|t| t.1)).collect();
    let of = |id: Id| match dag.node(id) {
        Node::Select(c, ..) => Some(c),
        _ => None,
    };
    let mut all: Vec<Id> = dag.reachable(&atoms).into_iter().filter_map(of).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Forgets switching functions that separate only cells with equal modes.
fn drop_switches(out: &mut Cells, all: &mut Vec<(Signs, Vec<Id>)>) {
    let mut numbers = Numbers::new(all.iter().map(|m| &m.0));
    let mut k = 0;
    while k < out.switches.len() {
        let groups = numbers.equal_without(k, |i| &all[i].0, |_| false);
        if !groups.iter().all(|g| g.iter().all(|&i| all[i].1 == all[g[0]].1)) {
            k += 1;
            continue;
        }
        out.without_effect.push(out.switches.remove(k));
        let mut kept = vec![false; all.len()];
        groups.iter().for_each(|g| kept[g[0]] = true);
        let mut keep = kept.into_iter();
        all.retain(|_| keep.next().unwrap_or(true));
        all.iter_mut().for_each(|m| {
            m.0.remove(k);
        });
        numbers = Numbers::new(all.iter().map(|m| &m.0));
        // What was needed only together with the dropped one may be useless now.
        k = 0;
    }
}

/// Joins neighbouring cells with equal modes to rows with zeros.
fn merge(mut modes: Vec<(Signs, Vec<Id>)>) -> Vec<(Signs, Vec<Id>)> {
    let n = modes.first().map_or(0, |m| m.0.len());
    let mut numbers = Numbers::new(modes.iter().map(|m| &m.0));
    let mut used = vec![false; modes.len()];
    // A row of zeros alone would be valid everywhere.
    for j in 0..n {
        for group in numbers.equal_without(j, |i| &modes[i].0, |i| used[i]) {
            let side = |s: i8| group.iter().copied().find(|&i| modes[i].0[j] == s);
            if let (Some(a), Some(b)) = (side(1), side(-1)) {
                if modes[a].1 == modes[b].1 {
                    let (first, second) = (a.min(b), a.max(b));
                    used[second] = true;
                    numbers.change(first, j, modes[first].0[j], 0);
                    modes[first].0[j] = 0;
                }
            }
        }
    }
    let mut used = used.into_iter();
    modes.retain(|_| !used.next().unwrap_or(false));
    modes
}
