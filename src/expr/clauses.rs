//! Conditions as lists of comparisons: one list of those that are all true is enough.

use std::collections::HashMap;

use super::dag::{Dag, Id, Node};
use crate::error::{Error, Result};

/// Lists of comparisons at most: `n` sums of two multiply to `2ⁿ`.
const MAX_CLAUSES: usize = 64;

/// Comparisons that are all true: switching functions, and whether they are positive.
type Clause = Vec<(u32, bool)>;

/// A condition as lists, see [`Dag::clauses`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Clauses {
    /// Functions that are positive where a comparison is true.
    pub functions: Vec<Id>,
    /// Lists of places among these: the condition is true where all of one list are positive. Without lists it is never true, with an
    /// empty one always.
    pub lists: Vec<Vec<usize>>,
}

impl Dag {
    /// A condition as lists of comparisons.
    ///
    /// # Errors
    /// [`Error::Range`] for a value; [`Error::Unsupported`] where there are more than 64 lists.
    pub fn clauses(&mut self, condition: Id) -> Result<Clauses> {
        if !self.is_condition(condition) {
            return Err(Error::Range(format!("{} is a value, not a condition such as a > 0", self.text(condition))));
        }
        // of every condition the lists for which it is true, and those for which it is false; none where there are too many
        let mut known: HashMap<Id, [Option<Vec<Clause>>; 2]> = HashMap::new();
        for id in self.reachable(&[condition]) {
            let lists = match self.node(id) {
                Node::Truth(true) => [Some(vec![Vec::new()]), Some(Vec::new())],
                Node::Truth(false) => [Some(Vec::new()), Some(vec![Vec::new()])],
                Node::Positive(s) => [true, false].map(|holds| Some(vec![vec![(s, holds)]])),
                Node::Not(a) => {
                    let [holds, fails] = known[&a].clone();
                    [fails, holds]
                }
                Node::And(a, b) => [product(&known[&a][0], &known[&b][0]), sum(&known[&a][1], &known[&b][1])],
                Node::Or(a, b) => [sum(&known[&a][0], &known[&b][0]), product(&known[&a][1], &known[&b][1])],
                _ => continue,
            };
            known.insert(id, lists);
        }
        let found = known.remove(&condition).and_then(|[holds, _]| holds).ok_or_else(|| {
            Error::Unsupported(format!(
                "a condition has more than {MAX_CLAUSES} ways to be true: state its parts as conditions of their own"
            ))
        })?;
        let mut literals: Clause = found.iter().flatten().copied().collect();
        literals.sort_unstable();
        literals.dedup();
        let place = |l: &(u32, bool)| literals.binary_search(l).unwrap_or(0);
        let lists = found.iter().map(|c| c.iter().map(place).collect()).collect();
        let mut functions = Vec::with_capacity(literals.len());
        for &(s, holds) in &literals {
            let psi = self
                .switching_function(s as usize)
                .ok_or_else(|| Error::Internal("a switching function is lost".into()))?;
            functions.push(if holds { psi } else { self.neg(psi) });
        }
        Ok(Clauses { functions, lists })
    }
}

/// All lists of both.
fn sum(a: &Option<Vec<Clause>>, b: &Option<Vec<Clause>>) -> Option<Vec<Clause>> {
    let (Some(a), Some(b)) = (a, b) else { return None };
    shortest(a.iter().chain(b).cloned().collect())
}

/// Every list of one with every list of the other.
fn product(a: &Option<Vec<Clause>>, b: &Option<Vec<Clause>>) -> Option<Vec<Clause>> {
    let (Some(a), Some(b)) = (a, b) else { return None };
    if a.len() * b.len() > MAX_CLAUSES * MAX_CLAUSES {
        return None;
    }
    let mut all = Vec::with_capacity(a.len() * b.len());
    for (x, y) in a.iter().flat_map(|x| b.iter().map(move |y| (x, y))) {
        let mut c: Clause = x.iter().chain(y).copied().collect();
        c.sort_unstable();
        c.dedup();
        // one comparison and its opposite are not true together
        if c.windows(2).all(|w| w[0].0 != w[1].0) {
            all.push(c);
        }
    }
    shortest(all)
}

/// Without lists that have all of another one; none where too many are left.
fn shortest(mut all: Vec<Clause>) -> Option<Vec<Clause>> {
    all.sort_unstable_by(|a, b| a.len().cmp(&b.len()).then_with(|| a.cmp(b)));
    let mut kept: Vec<Clause> = Vec::new();
    for c in all {
        if !kept.iter().any(|k| k.iter().all(|l| c.contains(l))) {
            kept.push(c);
        }
    }
    (kept.len() <= MAX_CLAUSES).then_some(kept)
}

#[cfg(test)]
mod tests {
    use super::super::dag::Block;
    use super::*;

    #[test]
    fn joined_comparisons_become_lists() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 3);
        let c: Vec<Id> = x.iter().map(|x| d.positive(*x)).collect();
        let lists = |d: &mut Dag, id: Id| d.clauses(id).unwrap().lists;
        assert_eq!(lists(&mut d, c[1]), [[0]]);
        // (a or b) and not c: two lists
        let (either, third) = (d.or(c[0], c[1]), d.not(c[2]));
        let both = d.and(either, third);
        let found = d.clauses(both).unwrap();
        let minus = d.neg(x[2]);
        assert_eq!(found.functions, [x[0], x[1], minus]);
        assert_eq!(found.lists, [[0, 2], [1, 2]]);
        // its opposite: neither a nor b, or c
        let opposite = d.not(both);
        let found = d.clauses(opposite).unwrap();
        assert_eq!(found.lists.len(), 2);
        // what is never true, and what is always
        let (never, always) = (d.and(both, opposite), d.or(both, opposite));
        assert!(lists(&mut d, never).is_empty());
        let absorbed = d.or(c[0], both);
        assert_eq!(lists(&mut d, absorbed).len(), 2);
        let always = lists(&mut d, always);
        assert!(always.len() == 1 && always[0].is_empty(), "{always:?}");
        assert!(d.clauses(x[0]).is_err());
    }

    #[test]
    fn too_many_lists_are_refused() {
        let mut d = Dag::new();
        let mut all = d.truth(true);
        for i in 0..8 {
            let (a, b) = (d.input(Block::X, 2 * i), d.input(Block::X, 2 * i + 1));
            let (a, b) = (d.positive(a), d.positive(b));
            let either = d.or(a, b);
            all = d.and(all, either);
        }
        assert!(matches!(d.clauses(all), Err(Error::Unsupported(_))));
        // the opposite has eight
        let opposite = d.not(all);
        assert_eq!(d.clauses(opposite).unwrap().lists.len(), 8);
    }
}
