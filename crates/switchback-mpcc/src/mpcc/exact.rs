//! The least objective of all branches, with proof: branch and bound where rows are linear and the objective is convex and quadratic.
//!
//! With the sides of some pairs chosen and the others left open a convex program bounds all branches with these sides from below
//! (J. J. Júdice, A. M. Faustino, Ann. Oper. Res. 34 (1992); L. Bai, J. E. Mitchell, J.-S. Pang, Optim. Lett. 7 (2013), for convex
//! quadratic objectives). The tree is searched depth first, so that a tableau serves one node after the other with few pivots. Bounds
//! are those of weak duality ([`Proof`]); a branch is left out where its bound is no better than the best point.

use super::branches::{both, goes_on, Branches, DISTANCES, DRAWS};
use super::lemke;
use super::problem::{Mpcc, Side};
use super::quadratic::{Proof, Quadratic};
use super::simplex::{Found, Simplex};
use crate::linalg::csc::Pattern;
use crate::nlp::{within, INFINITE};
use crate::random::SplitMix64;

/// Share of the terms of the objective that a branch has to be better by.
const BETTER: f64 = 1e-9;
/// Rounding of values of an objective that is quadratic, relative to its terms.
const QUADRATIC: f64 = 1e-11;
/// Share of a diagonal entry of a Hessian that rounding leaves of a pivot that vanishes, for each variable.
const SEMIDEFINITE: f64 = 1e-12;

/// The best point, where there is one.
#[derive(Debug, Clone)]
pub(super) struct Best {
    /// Point `[n]`.
    pub x: Vec<f64>,
    /// Sides of the groups.
    pub sides: Vec<Side>,
    /// Its objective, and the size of the terms of that.
    pub objective: f64,
    pub size: f64,
    /// Multipliers of all rows `[m]` and of bounds `[n]`, as in [`Solution`](super::solver::Solution).
    pub y: Vec<f64>,
    pub z: Vec<f64>,
}

/// What a search has shown.
#[derive(Debug, Clone)]
pub(super) struct Minimum {
    pub best: Option<Best>,
    /// The point `[n]` that the last linear program ended at.
    pub last: Vec<f64>,
    /// No branch has a lower objective; infinite where none has a point.
    pub bound: f64,
    /// Is `best` the optimum, up to [`BETTER`], or is there no point?
    pub complete: bool,
}

/// The objective `constant + ½ xᵀQx + cᵀx`, convex.
pub(super) struct Convex {
    constant: f64,
    quadratic: Quadratic,
}

impl Convex {
    /// That of `p` near `x`, where it is one: values and second derivatives at points up to a million times as far out follow it.
    pub fn of(p: &mut dyn Mpcc, branches: &Branches, x: &[f64]) -> Option<Convex> {
        let (n, m) = (p.n(), p.m());
        let (mut c, mut grad, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
        let mut hess = vec![0.0; p.hess_pattern().nnz()];
        let base: Vec<f64> = branches.inside(x);
        let f0 = p.eval(&base, &mut c).ok()?;
        p.derivatives(&base, &mut grad, &mut jac).ok()?;
        p.hessian(&base, 1.0, &vec![0.0; m], &mut hess).ok()?;
        let entries = both_triangles(p.hess_pattern(), &hess);
        if entries.iter().map(|e| e.2).chain(grad.iter().copied()).any(|v| !v.is_finite())
            || !is_semidefinite(n, &entries)
        {
            return None;
        }
        let (mut linear, mut sizes) = (grad.clone(), vec![0.0; n]);
        for &(i, j, q) in &entries {
            linear[i] -= q * base[j];
            sizes[i] += (q * base[j]).abs();
        }
        for ((c, size), g) in linear.iter_mut().zip(&sizes).zip(&grad) {
            // what rounding leaves of a derivative that vanishes at the origin
            if c.abs() <= QUADRATIC * (size + g.abs()) {
                *c = 0.0;
            }
        }
        let quadratic = Quadratic::new(entries, linear);
        let constant = f0 - quadratic.value(&base);
        let convex = Convex { constant, quadratic };
        let mut draw = SplitMix64::new(1);
        let mut other = base.clone();
        for distance in DISTANCES.iter().flat_map(|d| [*d; DRAWS]) {
            for (j, x) in other.iter_mut().enumerate() {
                let away = distance * base[j].abs().max(1.0) * (2.0 * draw.share() - 1.0);
                *x = within(base[j] + away, branches.bounds.xl[j], branches.bounds.xu[j]);
            }
            let f = p.eval(&other, &mut c).ok()?;
            let size = convex.constant.abs() + convex.quadratic.terms(&other) + convex.quadratic.terms(&base);
            if (f - convex.value(&other)).abs() > QUADRATIC * size {
                return None;
            }
        }
        Some(convex)
    }

    /// The model `f + gᵀ(x − x̄) + ½ (x − x̄)ᵀQ(x − x̄)` at the point `x̄`, with the entries of both triangles of `Q`. What is not semidefinite
    /// is left out of it.
    pub fn model(f: f64, gradient: &[f64], pattern: &Pattern, hess: &[f64], x: &[f64]) -> Option<Convex> {
        let n = x.len();
        let mut entries = both_triangles(pattern, hess);
        if entries.iter().map(|e| e.2).chain(gradient.iter().copied()).any(|v| !v.is_finite()) {
            return None;
        }
        if !is_semidefinite(n, &entries) {
            entries = semidefinite_part(n, &entries);
        }
        let mut linear = gradient.to_vec();
        entries.iter().for_each(|&(i, j, q)| linear[i] -= q * x[j]);
        let quadratic = Quadratic::new(entries, linear);
        Some(Convex { constant: f - quadratic.value(x), quadratic })
    }

    /// The objective, where it is the same everywhere.
    pub fn is_constant(&self) -> Option<f64> {
        self.quadratic.is_zero().then_some(self.constant)
    }

    fn value(&self, x: &[f64]) -> f64 {
        self.constant + self.quadratic.value(x)
    }

    /// What differences of objectives are compared with.
    pub fn size(&self, x: &[f64]) -> f64 {
        self.constant.abs().max(self.quadratic.terms(x))
    }
}

/// Entries of both triangles of a symmetric matrix that are not zero, from its upper one.
fn both_triangles(pattern: &Pattern, values: &[f64]) -> Vec<(usize, usize, f64)> {
    let mut entries = Vec::new();
    for j in 0..pattern.n_cols() {
        for k in pattern.range(j).filter(|k| values[*k] != 0.0) {
            let i = pattern.row_idx()[k];
            entries.push((i, j, values[k]));
            if i != j {
                entries.push((j, i, values[k]));
            }
        }
    }
    entries
}

/// Is a symmetric matrix of `n` rows positive semidefinite, up to rounding of entries in units in which its diagonal is one? By
/// elimination, the largest diagonal first.
fn is_semidefinite(n: usize, entries: &[(usize, usize, f64)]) -> bool {
    // the rows that are not zero: where a diagonal vanishes its row has to
    let mut place = vec![usize::MAX; n];
    let mut unit = Vec::new();
    for &(i, _, q) in entries.iter().filter(|e| e.0 == e.1) {
        place[i] = unit.len();
        unit.push(q.max(0.0).sqrt());
    }
    if entries.iter().any(|e| place[e.0] == usize::MAX || unit[place[e.0]] == 0.0) {
        return false;
    }
    let n = unit.len();
    let mut a = vec![0.0; n * n];
    for &(i, j, q) in entries {
        let (i, j) = (place[i], place[j]);
        a[i * n + j] = q / (unit[i] * unit[j]);
    }
    let room = SEMIDEFINITE * n as f64;
    let mut left: Vec<usize> = (0..n).collect();
    while let Some(at) = (0..left.len()).max_by(|&i, &j| a[left[i] * (n + 1)].total_cmp(&a[left[j] * (n + 1)])) {
        let i = left.swap_remove(at);
        let pivot = a[i * (n + 1)];
        if pivot <= room {
            // what is left has no diagonal: it has to vanish
            return std::iter::once(&i)
                .chain(&left)
                .all(|&r| left.iter().chain([&i]).all(|&c| a[r * n + c].abs() <= room));
        }
        for &r in &left {
            let factor = a[r * n + i] / pivot;
            if factor != 0.0 {
                for &c in &left {
                    a[r * n + c] -= factor * a[i * n + c];
                }
            }
        }
    }
    true
}

/// The nearest positive semidefinite matrix: without the eigenvalues that are negative.
fn semidefinite_part(n: usize, entries: &[(usize, usize, f64)]) -> Vec<(usize, usize, f64)> {
    let mut place = vec![usize::MAX; n];
    let mut rows: Vec<usize> = entries.iter().map(|e| e.0).collect();
    rows.sort_unstable();
    rows.dedup();
    rows.iter().enumerate().for_each(|(k, i)| place[*i] = k);
    let k = rows.len();
    let mut a = nalgebra::DMatrix::zeros(k, k);
    entries.iter().for_each(|&(i, j, q)| a[(place[i], place[j])] = q);
    let eigen = a.symmetric_eigen();
    let (values, vectors) = (eigen.eigenvalues, eigen.eigenvectors);
    let largest = values.iter().fold(0f64, |a, v| a.max(*v));
    let floor = SEMIDEFINITE * k as f64 * largest;
    let kept: Vec<usize> = (0..k).filter(|i| values[*i] > floor).collect();
    let mut part = Vec::new();
    for i in 0..k {
        for j in 0..k {
            let q: f64 = kept.iter().map(|&v| values[v] * vectors[(i, v)] * vectors[(j, v)]).sum();
            if q != 0.0 {
                part.push((rows[i], rows[j], q));
            }
        }
    }
    part
}

/// Nodes from which a search is worth its work.
const FEW: f64 = 4.0;

/// A node: sides that are chosen, and the bound of the node above it.
struct Node {
    chosen: Vec<Option<Side>>,
    bound: f64,
}

/// A search for the least objective.
struct Search<'a, 'b> {
    branches: &'a Branches<'b>,
    f: &'a Convex,
    lp: Simplex,
    proof: Proof,
    best: Option<Best>,
    /// Objective from which on nothing is looked for.
    ceiling: f64,
}

/// What a program of a node ended with.
enum Solved {
    Empty,
    Point,
    /// Nothing is shown, or the objective falls without end.
    Open,
}

/// Is so much work enough for a few nodes of `n` variables and `m` rows? From nothing one takes as many pivots as there are of both.
pub(super) fn is_worth(n: usize, m: usize, work: f64) -> bool {
    let (n, m) = (n as f64, m as f64);
    FEW * (n + m) * n * (m + 1.0) <= work
}

impl Branches<'_> {
    /// The solution of a linear complementarity problem with this objective, which does not depend on it, by complementary pivoting; nothing
    /// where the program is another one or where that does not end at a solution.
    pub fn by_pivots(&self, p: &dyn Mpcc, objective: f64, work: f64) -> Option<Best> {
        let (n, k) = (self.n, self.pairs.len());
        if n != 2 * k || self.m() != k || p.lifts().len() != k || self.n_groups != k {
            return None;
        }
        // of every pair the variable `z`, the variable that stands for the row, and the row
        let mut known = vec![None; n];
        p.lifts().iter().for_each(|&(row, v)| known[v] = Some(row));
        let triple = |&(a, b): &(usize, usize)| match (known[a], known[b]) {
            (None, Some(row)) => Some((a, b, row)),
            (Some(row), None) => Some((b, a, row)),
            _ => None,
        };
        let triples: Vec<(usize, usize, usize)> = self.pairs.iter().map(triple).collect::<Option<_>>()?;
        let (lower, upper) = (&self.bounds.xl, &self.bounds.xu);
        if lower.iter().any(|l| *l != 0.0) || upper.iter().any(|u| *u < INFINITE) {
            return None;
        }
        let (mut matrix, mut q) = (vec![0.0; k * k], vec![0.0; k]);
        for (i, &(_, w, row)) in triples.iter().enumerate() {
            let a = &self.rows[row * n..][..n];
            let (lo, hi) = self.sides[row];
            // a variable counted from its upper bound has the negative of its row
            let sign = -a[w];
            if lo != hi || sign.abs() != 1.0 || triples.iter().any(|t| t.1 != w && a[t.1] != 0.0) {
                return None;
            }
            q[i] = -sign * lo;
            triples.iter().enumerate().for_each(|(j, t)| matrix[i * k + j] = sign * a[t.0]);
        }
        let (z, w) = lemke::solve(&matrix, &q, work, &goes_on)?;
        let mut best = Best {
            x: vec![0.0; n],
            sides: Vec::new(),
            objective,
            size: objective.abs(),
            y: vec![0.0; k],
            z: vec![0.0; n],
        };
        for (i, &(at_z, at_w, _)) in triples.iter().enumerate() {
            (best.x[at_z], best.x[at_w]) = (z[i], w[i]);
        }
        let side = |&(a, b): &(usize, usize)| if best.x[a] <= best.x[b] { Side::First } else { Side::Second };
        best.sides = self.pairs.iter().map(side).collect();
        Some(best)
    }

    /// The least objective `f` of all branches, by so much work at most, in entries of tableaus. All rows have to be linear.
    pub fn minimum(&self, f: &Convex, work: f64) -> Minimum {
        self.below(f, f64::INFINITY, work)
    }

    /// The same of what is below an objective.
    pub fn below(&self, f: &Convex, ceiling: f64, work: f64) -> Minimum {
        let mut lp = Simplex::beside(self.n, self.m(), self.rows.clone(), f.quadratic.rows());
        lp.allowed = work;
        let mut s = Search { branches: self, f, lp, proof: Proof::default(), best: None, ceiling };
        let mut stack = vec![Node { chosen: vec![None; self.n_groups], bound: f64::NEG_INFINITY }];
        let mut open = f64::INFINITY;
        while let Some(node) = stack.pop() {
            if s.is_beaten(node.bound) {
                continue;
            }
            if s.lp.work > work || !goes_on() {
                open = open.min(node.bound);
                continue;
            }
            s.visit(node, &mut stack, &mut open);
        }
        let complete = s.is_beaten(open) || (open == f64::INFINITY && s.best.is_none());
        let best = s.best.as_ref().map_or(f64::INFINITY, |b| b.objective);
        Minimum { bound: best.min(open), complete, last: s.lp.point().collect(), best: s.best }
    }
}

impl Search<'_, '_> {
    /// Is a branch with this bound no better than the best point?
    fn is_beaten(&self, bound: f64) -> bool {
        bound >= self.ceiling || self.best.as_ref().is_some_and(|b| bound >= b.objective - BETTER * b.size)
    }

    fn solve(&mut self, chosen: &[Option<Side>]) -> Solved {
        self.branches.set(&mut self.lp, chosen, false);
        match self.lp.feasible(&goes_on) {
            Found::Infeasible => return Solved::Empty,
            Found::Point => {}
            _ => return Solved::Open,
        }
        match self.lp.minimise_quadratic(&self.f.quadratic, &mut self.proof, &goes_on) {
            Found::Point => Solved::Point,
            _ => Solved::Open,
        }
    }

    /// Solves the program of a node and puts those below it on the stack; what cannot be decided goes into `open`.
    fn visit(&mut self, node: Node, stack: &mut Vec<Node>, open: &mut f64) {
        let Node { chosen, bound } = node;
        let split = |stack: &mut Vec<Node>, group: usize, first: Side, bound: f64| {
            stack.extend(both(&chosen, group, first).into_iter().map(|chosen| Node { chosen, bound }));
        };
        let undecided = chosen.iter().position(Option::is_none);
        match self.solve(&chosen) {
            Solved::Empty => return,
            Solved::Point => {}
            Solved::Open => match undecided {
                Some(group) => return split(stack, group, Side::First, bound),
                None => {
                    *open = open.min(bound);
                    return;
                }
            },
        }
        let bound = bound.max(self.f.constant + self.proof.bound);
        if self.is_beaten(bound) {
            return;
        }
        let (all, worst) = self.branches.read(&self.lp, &chosen);
        if worst.is_none() || self.best.is_none() {
            // the branch next to this point
            if undecided.is_none() || matches!(self.solve(&all), Solved::Point) {
                self.take(&all);
            }
        }
        if self.is_beaten(bound) {
            return;
        }
        match worst.or(undecided) {
            Some(group) => split(stack, group, all[group].unwrap_or(Side::First), bound),
            None => *open = open.min(bound),
        }
    }

    /// Keeps the point that was found last, of the branch `all`, where it is the best.
    fn take(&mut self, all: &[Option<Side>]) {
        let x: Vec<f64> = self.lp.point().collect();
        let objective = self.f.value(&x);
        if objective >= self.ceiling || self.best.as_ref().is_some_and(|b| b.objective <= objective) {
            return;
        }
        let sides = all.iter().map(|s| s.unwrap_or(Side::First)).collect();
        let y = self.proof.rows.iter().map(|y| -y).collect();
        let size = self.f.size(&x);
        self.best = Some(Best { x, sides, objective, size, y, z: self.proof.variables.clone() });
    }
}
