//! Rebuilding expressions with switches decided, and switching functions that contain switches themselves.

use std::collections::BTreeMap;

use super::dag::{Block, Dag, Group, Id, Node};
use super::extend::Domains;
use super::op::{Binary, Unary};
use crate::error::Result;
use crate::stop;

/// Branches of all switching functions that switch.
const MAX_BRANCHES: usize = 1024;

/// Expressions, and the nodes they consist of: see [`Dag::undecided`].
#[derive(Debug, Clone)]
pub struct Undecided {
    roots: Vec<Id>,
    ids: Vec<Id>,
    /// What arguments are at least, see [`extend`](super::extend).
    domains: Domains,
}

impl Dag {
    /// Switching functions the nodes depend on, sorted; those inside other switching functions too.
    pub fn switches_of(&self, roots: &[Id]) -> Vec<usize> {
        let mut out: Vec<usize> = self
            .reachable(roots)
            .into_iter()
            .filter_map(|id| match self.node(id) {
                Node::Positive(s) => Some(s as usize),
                _ => None,
            })
            .collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Copies expressions where switches with a known sign (`Some(true)`: positive) are decided.
    pub fn decide(&mut self, roots: &[Id], sign: &dyn Fn(usize) -> Option<bool>) -> Vec<Id> {
        let all = self.undecided(roots);
        self.decide_all(&all, sign)
    }

    /// Copies expressions with an input in the place of every condition `ψ_s > 0`: weight `k` for the switching function
    /// `switches[k]`, which is 1 where it is positive and 0 where it is not, and arithmetic in the place of choices.
    pub fn with_signs(&mut self, roots: &[Id], switches: &[usize]) -> Vec<Id> {
        let mut place = vec![None; self.n_switches()];
        switches.iter().enumerate().for_each(|(k, &s)| place[s] = Some(k));
        let mut replace = |dag: &mut Dag, s: u32| place[s as usize].map(|k| dag.input(Block::Weight, k));
        self.rebuild_with(roots, &mut replace, &|block, i| (block, i as usize), &BTreeMap::new(), true)
    }

    /// True where the node is an input of a block for which `holds`.
    pub fn is_input_of(&self, id: Id, holds: impl Fn(Block) -> bool) -> bool {
        matches!(self.node(id), Node::Input(block, _) if holds(block))
    }

    /// The opposite of a condition, or of the number that stands for one.
    fn opposite(&mut self, c: Id) -> Id {
        if self.is_condition(c) {
            return self.not(c);
        }
        let one = self.constant(1.0);
        self.sub(one, c)
    }

    /// Both conditions, or numbers that stand for them.
    fn conjunction(&mut self, a: Id, b: Id) -> Id {
        match self.is_condition(a) || self.is_condition(b) {
            true => self.and(a, b),
            false => self.mul(a, b),
        }
    }

    /// At least one condition, or number that stands for one.
    fn disjunction(&mut self, a: Id, b: Id) -> Id {
        if self.is_condition(a) || self.is_condition(b) {
            return self.or(a, b);
        }
        let (sum, product) = (self.add(a, b), self.mul(a, b));
        self.sub(sum, product)
    }

    /// A choice under a condition, or under the number that stands for one.
    fn choice(&mut self, c: Id, a: Id, b: Id) -> Id {
        if self.is_condition(c) {
            return self.select(c, a, b);
        }
        let opposite = self.opposite(c);
        let (a, b) = (self.mul(c, a), self.mul(opposite, b));
        self.add(a, b)
    }

    /// Expressions to be decided, for many sign patterns one after the other.
    pub fn undecided(&self, roots: &[Id]) -> Undecided {
        let ids = self.reachable(roots);
        Undecided { domains: self.domains(roots, &ids), roots: roots.to_vec(), ids }
    }

    /// [`Dag::decide`] of prepared expressions. Only what a pattern leaves of them is built.
    pub fn decide_all(&mut self, all: &Undecided, sign: &dyn Fn(usize) -> Option<bool>) -> Vec<Id> {
        let ids = self.left_of(all, sign);
        let mut replace = |dag: &mut Dag, s: u32| sign(s as usize).map(|holds| dag.truth(holds));
        let place = |block: Block, i: u32| (block, i as usize);
        self.rebuild_nodes(&all.roots, ids, &mut replace, &place, &BTreeMap::new(), &all.domains)
    }

    /// Truth of the conditions among some expressions that a pattern decides, in the order of their nodes.
    pub fn truths(&self, all: &Undecided, sign: &dyn Fn(usize) -> Option<bool>) -> BTreeMap<Id, bool> {
        let mut known: BTreeMap<Id, bool> = BTreeMap::new();
        for &id in all.ids.iter().filter(|id| self.is_condition(**id)) {
            let of = |a: Id| known.get(&a).copied();
            let truth = match self.node(id) {
                Node::Truth(holds) => Some(holds),
                Node::Positive(s) => sign(s as usize),
                Node::Not(a) => of(a).map(|v| !v),
                Node::And(a, b) => match (of(a), of(b)) {
                    (Some(false), _) | (_, Some(false)) => Some(false),
                    (Some(true), v) | (v, Some(true)) => v,
                    _ => None,
                },
                Node::Or(a, b) => match (of(a), of(b)) {
                    (Some(true), _) | (_, Some(true)) => Some(true),
                    (Some(false), v) | (v, Some(false)) => v,
                    _ => None,
                },
                _ => None,
            };
            known.extend(truth.map(|v| (id, v)));
        }
        known
    }

    /// The nodes that are needed under a pattern, ascending.
    fn left_of(&self, all: &Undecided, sign: &dyn Fn(usize) -> Option<bool>) -> Vec<Id> {
        let truths = self.truths(all, sign);
        let top = all.ids.last().map_or(0, |id| id.index() + 1);
        let mut needed = vec![false; top];
        all.roots.iter().for_each(|r| needed[r.index()] = true);
        // parents are younger than their children
        for &id in all.ids.iter().rev().filter(|id| **id < Id(top as u32)) {
            if !needed[id.index()] {
                continue;
            }
            match self.node(id) {
                Node::Select(c, a, b) => {
                    needed[c.index()] = true;
                    let sides: &[Id] = match truths.get(&c) {
                        Some(true) => &[a],
                        Some(false) => &[b],
                        None => &[a, b],
                    };
                    sides.iter().for_each(|k| needed[k.index()] = true);
                }
                Node::Positive(s) if sign(s as usize).is_some() => {}
                _ => self.for_children(id, |k| needed[k.index()] = true),
            }
        }
        all.ids.iter().copied().filter(|id| needed[id.index()]).collect()
    }

    /// Replaces conditions by ones whose switching functions are smooth: `ψ > 0` with a `ψ` that switches
    /// with `χ` becomes `(χ > 0 and ψ⁺ > 0) or (χ < 0 and ψ⁻ > 0)`.
    ///
    /// None if there are too many branches.
    ///
    /// # Errors
    /// What [`crate::stop`] ends it with.
    pub fn smooth_switches(&mut self, roots: &[Id]) -> Result<Option<Vec<Id>>> {
        let mut known: Vec<Option<Id>> = Vec::new();
        // branches that all of them together may still have
        let mut left = MAX_BRANCHES;
        // Inner switching functions are older than those they are part of.
        for s in self.switches_of(roots) {
            if known.len() <= s {
                known.resize(s + 1, None);
            }
            let psi = self.switches[s].psi;
            if !self.switches_of(&[psi]).is_empty() {
                match self.smooth_condition(psi, &mut left)? {
                    Some(c) => known[s] = Some(c),
                    None => return Ok(None),
                }
            }
        }
        Ok(Some(self.rebuild(roots, &mut |_, s| known.get(s as usize).copied().flatten())))
    }

    /// Condition `ψ > 0` over smooth switching functions; none if it has more branches than are `left`.
    fn smooth_condition(&mut self, whole: Id, left: &mut usize) -> Result<Option<Id>> {
        // Branches still to be looked at, with the conditions that lead to them.
        let yes = self.truth(true);
        let mut branches = vec![(yes, whole)];
        let mut result = self.truth(false);
        while let Some((path, psi)) = branches.pop() {
            stop::check()?;
            let Some(&first) = self.switches_of(&[psi]).first() else {
                if *left == 0 {
                    return Ok(None);
                }
                *left -= 1;
                let here = self.positive(psi);
                let both = self.and(path, here);
                result = self.or(result, both);
                continue;
            };
            let chi = self.intern(Node::Positive(first as u32));
            for holds in [true, false] {
                let branch = self.decide(&[psi], &|s| (s == first).then_some(holds))[0];
                let way = if holds { chi } else { self.not(chi) };
                let path = self.and(path, way);
                if self.node(path) != Node::Truth(false) {
                    branches.push((path, branch));
                }
            }
        }
        Ok(Some(result))
    }

    /// Copies expressions with inputs that have other numbers in their block.
    pub fn renumber(&mut self, roots: &[Id], number: &dyn Fn(Block, usize) -> usize) -> Vec<Id> {
        self.rebuild_with(
            roots,
            &mut |_, _| None,
            &|block, i| (block, number(block, i as usize)),
            &BTreeMap::new(),
            false,
        )
    }

    /// Copies expressions with other inputs: `place` says which block an input goes to, and its number there.
    pub fn move_inputs(&mut self, roots: &[Id], place: &dyn Fn(Block, usize) -> (Block, usize)) -> Vec<Id> {
        self.rebuild_with(roots, &mut |_, _| None, &|block, i| place(block, i as usize), &BTreeMap::new(), false)
    }

    /// Copies the nodes under `roots` with conditions replaced.
    pub(super) fn rebuild(&mut self, roots: &[Id], replace: &mut dyn FnMut(&mut Dag, u32) -> Option<Id>) -> Vec<Id> {
        self.rebuild_with(roots, replace, &|block, i| (block, i as usize), &BTreeMap::new(), false)
    }

    /// Copies expressions with nodes replaced.
    pub fn replace(&mut self, roots: &[Id], by: &BTreeMap<Id, Id>) -> Vec<Id> {
        self.rebuild_with(roots, &mut |_, _| None, &|block, i| (block, i as usize), by, false)
    }

    /// The same with other inputs, and other nodes in the place of some; `decides` says that functions are continued beyond the branches
    /// that are left of them, see [`extend`](super::extend).
    fn rebuild_with(
        &mut self,
        roots: &[Id],
        replace: &mut dyn FnMut(&mut Dag, u32) -> Option<Id>,
        place: &dyn Fn(Block, u32) -> (Block, usize),
        by: &BTreeMap<Id, Id>,
        decides: bool,
    ) -> Vec<Id> {
        let ids = self.reachable(roots);
        let domains = if decides { self.domains(roots, &ids) } else { Domains::new() };
        self.rebuild_nodes(roots, ids, replace, place, by, &domains)
    }

    /// The same where the nodes that are copied, children first, are known.
    fn rebuild_nodes(
        &mut self,
        roots: &[Id],
        ids: Vec<Id>,
        replace: &mut dyn FnMut(&mut Dag, u32) -> Option<Id>,
        place: &dyn Fn(Block, u32) -> (Block, usize),
        by: &BTreeMap<Id, Id>,
        domains: &Domains,
    ) -> Vec<Id> {
        let top = ids.last().map_or(0, |id| id.index() + 1);
        let mut new: Vec<Option<Id>> = vec![None; top];
        let mut new_groups: Vec<Option<u32>> = vec![None; self.groups.len()];
        for id in ids {
            if let Some(&other) = by.get(&id) {
                new[id.index()] = Some(other);
                continue;
            }
            let at = |a: Id| new.get(a.index()).copied().flatten().unwrap_or(a);
            let copy = match self.node(id) {
                Node::Const(_) | Node::Truth(_) => id,
                Node::Input(block, i) => {
                    let (block, i) = place(block, i);
                    self.input(block, i)
                }
                Node::Positive(s) => match replace(self, s) {
                    Some(c) => c,
                    None => {
                        let old = self.switches[s as usize].psi;
                        let psi = at(old);
                        if psi == old {
                            id
                        } else {
                            self.positive(psi)
                        }
                    }
                },
                Node::Unary(op, a) => {
                    let a = self.in_domain(domains, id, at(a));
                    self.unary(op, a)
                }
                Node::Binary(Binary::Div, a, b) => {
                    let (a, b) = (at(a), at(b));
                    let b = self.in_domain(domains, id, b);
                    self.binary(Binary::Div, a, b)
                }
                Node::Binary(op, a, b) => {
                    let (a, b) = (at(a), at(b));
                    let a = self.in_domain(domains, id, a);
                    self.binary(op, a, b)
                }
                Node::PowI(a, n) => {
                    let a = self.in_domain(domains, id, at(a));
                    self.powi(a, n)
                }
                Node::Piecewise(table, order, a) => {
                    let a = at(a);
                    self.piecewise_node(table, order, a)
                }
                Node::Not(a) => {
                    let a = at(a);
                    self.opposite(a)
                }
                Node::And(a, b) => {
                    let (a, b) = (at(a), at(b));
                    self.conjunction(a, b)
                }
                Node::Or(a, b) => {
                    let (a, b) = (at(a), at(b));
                    self.disjunction(a, b)
                }
                Node::Select(c, a, b) => {
                    let (c, a, b) = (at(c), at(a), at(b));
                    self.choice(c, a, b)
                }
                Node::Pick(g, k) => {
                    let h = match new_groups[g as usize] {
                        Some(h) => h,
                        None => {
                            let h = self.copy_group(g, &new);
                            new_groups[g as usize] = Some(h);
                            h
                        }
                    };
                    self.pick(h, k as usize)
                }
            };
            new[id.index()] = Some(copy);
        }
        roots.iter().map(|r| new.get(r.index()).copied().flatten().unwrap_or(*r)).collect()
    }

    /// The argument of the function that takes the place of node `id`.
    fn in_domain(&mut self, domains: &Domains, id: Id, argument: Id) -> Id {
        domains.get(&id).map_or(argument, |least| self.continued(argument, *least))
    }

    fn copy_group(&mut self, g: u32, new: &[Option<Id>]) -> u32 {
        let at = |v: &[Id]| v.iter().map(|a| new.get(a.index()).copied().flatten().unwrap_or(*a)).collect::<Vec<Id>>();
        let entry = self.groups[g as usize].clone();
        let group = match entry.group {
            Group::Factor { n, matrix } => Group::Factor { n, matrix: at(&matrix) },
            Group::Solve { factor, transposed, rhs } => {
                Group::Solve { factor: self.copy_group(factor, new), transposed, rhs: at(&rhs) }
            }
            Group::Call { function, what, args } => Group::Call { function, what, args: at(&args) },
        };
        self.group(group, entry.n as usize)
    }

    /// Splits an expression into a smooth part and a sum of `factor · atom`, where factors are smooth and atoms are
    /// the switching parts that are no sums themselves: `(F − a sign v − b sign w) / m` has two atoms. Solutions of
    /// linear systems with a smooth matrix are split as well.
    pub fn split_sum(&mut self, root: Id) -> (Id, Vec<(Id, Id)>) {
        let switching = self.switching_nodes(root);
        let is_smooth = |id: Id| !switching.get(id.index()).copied().unwrap_or(false);
        let mut smooth = self.constant(0.0);
        let mut terms: Vec<(Id, Id)> = Vec::new();
        let one = self.constant(1.0);
        let mut stack = vec![(root, one)];
        while let Some((id, factor)) = stack.pop() {
            if is_smooth(id) {
                let term = self.mul(factor, id);
                smooth = self.add(smooth, term);
                continue;
            }
            match self.node(id) {
                Node::Binary(Binary::Add, a, b) => stack.extend([(b, factor), (a, factor)]),
                Node::Binary(Binary::Sub, a, b) => stack.extend([(b, self.neg(factor)), (a, factor)]),
                Node::Unary(Unary::Neg, a) => stack.push((a, self.neg(factor))),
                Node::Binary(Binary::Mul, a, b) if is_smooth(a) => stack.push((b, self.mul(factor, a))),
                Node::Binary(Binary::Mul, a, b) if is_smooth(b) => stack.push((a, self.mul(factor, b))),
                Node::Binary(Binary::Div, a, b) if is_smooth(b) => stack.push((a, self.div(factor, b))),
                Node::Pick(g, k) => match self.split_solution(g, k as usize, &is_smooth) {
                    Some((part, columns)) => {
                        stack.push((part, factor));
                        for (b, column) in columns {
                            stack.push((b, self.mul(factor, column)));
                        }
                    }
                    None => terms.push((factor, id)),
                },
                _ => terms.push((factor, id)),
            }
        }
        // One term for each atom.
        terms.sort_by_key(|t| t.1);
        let mut merged: Vec<(Id, Id)> = Vec::new();
        for (factor, atom) in terms {
            match merged.last_mut() {
                Some(last) if last.1 == atom => last.0 = self.add(last.0, factor),
                _ => merged.push((factor, atom)),
            }
        }
        merged.retain(|t| self.as_const(t.0) != Some(0.0));
        (smooth, merged)
    }

    /// Which nodes under a root depend on a condition.
    fn switching_nodes(&self, root: Id) -> Vec<bool> {
        let mut switching = vec![false; root.index() + 1];
        for id in self.reachable(&[root]) {
            let mut any = self.is_condition(id);
            self.for_children(id, |c| any |= switching[c.index()]);
            switching[id.index()] = any;
        }
        switching
    }

    /// Component `k` of a solution: the part of the smooth right-hand sides, and for every other right-hand side its
    /// factor, an entry of the inverse.
    #[allow(clippy::type_complexity)]
    fn split_solution(&mut self, g: u32, k: usize, is_smooth: &dyn Fn(Id) -> bool) -> Option<(Id, Vec<(Id, Id)>)> {
        let Group::Solve { factor, transposed, rhs } = self.groups[g as usize].group.clone() else { return None };
        let Group::Factor { matrix, .. } = &self.groups[factor as usize].group else { return None };
        if !matrix.iter().all(|&a| is_smooth(a)) {
            return None;
        }
        let (zero, one) = (self.constant(0.0), self.constant(1.0));
        let smooth_rhs: Vec<Id> = rhs.iter().map(|&b| if is_smooth(b) { b } else { zero }).collect();
        let part = self.solve_factored(factor, transposed, &smooth_rhs)[k];
        let mut columns = Vec::new();
        for (j, &b) in rhs.iter().enumerate().filter(|b| !is_smooth(*b.1)) {
            let unit: Vec<Id> = (0..rhs.len()).map(|i| if i == j { one } else { zero }).collect();
            columns.push((b, self.solve_factored(factor, transposed, &unit)[k]));
        }
        Some((part, columns))
    }
}

#[cfg(test)]
mod tests {
    use super::super::dag::Block;
    use super::*;

    #[test]
    fn switches_are_decided() {
        let mut d = Dag::new();
        let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
        let (a, b) = (d.abs(x), d.max(x, y));
        let e = d.add(a, b);
        assert_eq!(d.switches_of(&[e]), [0, 1]);
        let twice = d.add(x, x);
        assert_eq!(d.decide(&[e], &|_| Some(true)), [twice]);
        let zero = d.sub(y, x);
        assert_eq!(d.decide(&[e], &|_| Some(false)), [zero]);
        let half = d.decide(&[e], &|s| (s == 1).then_some(true))[0];
        assert_eq!(d.switches_of(&[half]), [0]);
    }

    #[test]
    fn sums_split_into_independent_terms() {
        let mut d = Dag::new();
        let [x, y, m] = [0, 1, 2].map(|i| d.input(Block::X, i));
        let (s, r) = (d.sign(x), d.sign(y));
        let half = d.constant(0.5);
        let scaled = d.mul(half, r);
        let sum = d.sub(scaled, s);
        let sum = d.add(sum, y);
        let e = d.div(sum, m);
        let (smooth, terms) = d.split_sum(e);
        assert_eq!(terms.len(), 2);
        assert!(d.switches_of(&[smooth]).is_empty());
        assert_eq!(terms.iter().map(|t| t.1).collect::<Vec<_>>(), [s.min(r), s.max(r)]);
        // Solutions of linear systems split too.
        let coupled = [m, x, x, y];
        let sol = d.solve(&coupled, &[s, r]).unwrap();
        let (smooth, terms) = d.split_sum(sol[0]);
        assert_eq!((d.as_const(smooth), terms.len()), (Some(0.0), 2));
    }

    #[test]
    fn switches_inside_switching_functions_come_out() {
        let mut d = Dag::new();
        let x = d.input(Block::X, 0);
        let one = d.constant(1.0);
        let a = d.abs(x);
        let inner = d.sub(a, one);
        let e = d.sign(inner);
        let smooth = d.smooth_switches(&[e]).unwrap().unwrap()[0];
        for s in d.switches_of(&[smooth]) {
            let psi = d.switching_function(s).unwrap();
            assert!(d.switches_of(&[psi]).is_empty());
        }
        // sign(|x| − 1) by the signs of x, x − 1 and −x − 1.
        let names: Vec<String> =
            d.switches_of(&[smooth]).iter().map(|&s| d.text(d.switching_function(s).unwrap())).collect();
        assert_eq!(names.len(), 3, "{names:?}");
    }
}
