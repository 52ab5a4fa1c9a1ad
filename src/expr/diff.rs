//! Derivatives as new nodes of the same graph.
//!
//! Forward and backward sweeps go over the nodes between the inputs and the outputs only; sums start empty and
//! constants fold, so an entry that is zero by structure never comes into being. Value, Jacobian and Hessian share all
//! subexpressions because equal nodes are one node.

use super::dag::{CallKind, Dag, Group, Id, Node};
use super::implicit::Partials;
use super::op::{Binary, Unary};
use crate::error::{Error, Result};
use crate::stop;

/// An entry of a matrix of expressions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Row.
    pub row: usize,
    /// Column.
    pub col: usize,
    /// Value, never the constant zero.
    pub value: Id,
}

const NONE: u32 = u32::MAX;

/// Nodes a sweep goes over between two questions whether the call is to end.
const NODES_PER_QUESTION: usize = 256;

/// The part of a graph that lies between inputs and outputs, oldest node first.
struct Region {
    ids: Vec<Id>,
    /// Place in `ids` of every node of the graph, or `NONE`; nothing where the part is small.
    place: Vec<u32>,
}

/// A part of a graph so many times smaller is small: places in it are looked up, and the others take no time.
const SMALL: usize = 32;

impl Region {
    /// Nodes under `outputs` that depend on an input of `wrt`.
    fn between(dag: &Dag, outputs: &[Id], wrt: &[Id]) -> Region {
        let mut all = dag.reachable(outputs);
        // All components of a group are handled together.
        let mut group_seen = vec![false; dag.groups.len()];
        for k in 0..all.len() {
            if let Node::Pick(g, _) = dag.node(all[k]) {
                if !std::mem::replace(&mut group_seen[g as usize], true) {
                    let e = &dag.groups[g as usize];
                    all.extend((e.first.0..e.first.0 + e.n).map(Id));
                }
            }
        }
        all.sort_unstable();
        all.dedup();
        let top = all.last().map_or(0, |id| id.index() + 1);
        if SMALL * all.len() < top {
            return Region::of_few(dag, all, wrt);
        }
        let mut active = vec![false; top];
        for w in wrt.iter().filter(|w| w.index() < top) {
            active[w.index()] = true;
        }
        for &id in &all {
            if !active[id.index()] {
                let mut any = false;
                dag.for_children(id, |c| any |= active[c.index()]);
                active[id.index()] = any;
            }
        }
        all.retain(|id| active[id.index()]);
        let mut place = vec![NONE; top];
        for (k, id) in all.iter().enumerate() {
            place[id.index()] = k as u32;
        }
        Region { ids: all, place }
    }

    /// The same where the graph is much larger.
    fn of_few(dag: &Dag, all: Vec<Id>, wrt: &[Id]) -> Region {
        let inputs: Vec<Id> = {
            let mut inputs = wrt.to_vec();
            inputs.sort_unstable();
            inputs
        };
        let mut active = vec![false; all.len()];
        for k in 0..all.len() {
            let mut any = inputs.binary_search(&all[k]).is_ok();
            if !any {
                dag.for_children(all[k], |c| any |= all.binary_search(&c).is_ok_and(|c| active[c]));
            }
            active[k] = any;
        }
        let ids = all.into_iter().zip(active).filter(|a| a.1).map(|a| a.0).collect();
        Region { ids, place: Vec::new() }
    }

    fn place(&self, id: Id) -> Option<usize> {
        match self.place.get(id.index()) {
            Some(&k) if k != NONE => Some(k as usize),
            None if self.place.is_empty() => self.ids.binary_search(&id).ok(),
            _ => None,
        }
    }
}

impl Dag {
    /// Jacobian of `outputs` with respect to the inputs `wrt` (nodes made by [`Dag::input`]), entries that are not
    /// zero by structure, by columns.
    ///
    /// Sweeps go forward or backward, whichever visits fewer nodes.
    pub fn jacobian(&mut self, outputs: &[Id], wrt: &[Id]) -> Result<Vec<Entry>> {
        let region = Region::between(self, outputs, wrt);
        let backward = self.backward_visits(&region, outputs);
        let mut entries = match self.forward_visits(&region, wrt, backward) {
            true => self.jacobian_forward(&region, outputs, wrt)?,
            false => self.jacobian_backward(&region, outputs, wrt)?,
        };
        entries.sort_unstable_by_key(|e| (e.col, e.row));
        Ok(entries)
    }

    /// [`Dag::jacobian`] with all entries, `outputs × wrt` by columns.
    ///
    /// # Errors
    /// [`Error::Range`] if `wrt` holds a node that is no input, or one twice.
    pub fn dense_jacobian(&mut self, outputs: &[Id], wrt: &[Id]) -> Result<Vec<Id>> {
        for (k, &w) in wrt.iter().enumerate() {
            if !matches!(self.node(w), Node::Input(..)) || wrt[..k].contains(&w) {
                return Err(Error::Range(format!(
                    "derivatives are taken with respect to inputs, each once; number {k}, {}, is not one",
                    self.text(w)
                )));
            }
        }
        let zero = self.constant(0.0);
        let mut out = vec![zero; outputs.len() * wrt.len()];
        for e in self.jacobian(outputs, wrt)? {
            out[e.row + outputs.len() * e.col] = e.value;
        }
        Ok(out)
    }

    /// Gradient of `Σ_i weights[i] outputs[i]` with respect to `wrt`: the entries that are not zero by structure.
    pub fn gradient(&mut self, outputs: &[Id], weights: &[Id], wrt: &[Id]) -> Result<Vec<(usize, Id)>> {
        let region = Region::between(self, outputs, wrt);
        let seeds: Vec<(Id, Id)> = outputs.iter().copied().zip(weights.iter().copied()).collect();
        let all: Vec<usize> = (0..region.ids.len()).collect();
        let mut adjoint = vec![None; region.ids.len()];
        self.sweep_back(&region, &all, &seeds, &mut adjoint)?;
        Ok(self.read_inputs(&region, &adjoint, wrt))
    }

    /// Hessian of `Σ_i weights[i] outputs[i]`, upper triangle (`row ≤ col`), by columns.
    pub fn hessian(&mut self, outputs: &[Id], weights: &[Id], wrt: &[Id]) -> Result<Vec<Entry>> {
        let gradient = self.gradient(outputs, weights, wrt)?;
        let ids: Vec<Id> = gradient.iter().map(|g| g.1).collect();
        let entries = self.jacobian(&ids, wrt)?;
        let mut upper: Vec<Entry> = entries.iter().map(|e| Entry { row: gradient[e.row].0, ..*e }).collect();
        // An entry that simplified to zero in one half is zero.
        let mut lower: Vec<(usize, usize)> = upper.iter().filter(|e| e.row > e.col).map(|e| (e.col, e.row)).collect();
        lower.sort_unstable();
        upper.retain(|e| e.row == e.col || (e.row < e.col && lower.binary_search(&(e.row, e.col)).is_ok()));
        upper.sort_unstable_by_key(|e| (e.col, e.row));
        Ok(upper)
    }

    /// Nodes backward sweeps visit, one sweep per output.
    fn backward_visits(&self, region: &Region, outputs: &[Id]) -> usize {
        let mut mark = Marks::new(region.ids.len());
        outputs.iter().map(|&o| self.below(region, o, &mut mark).len()).sum()
    }

    /// Do forward sweeps visit fewer nodes than `limit`?
    fn forward_visits(&self, region: &Region, wrt: &[Id], limit: usize) -> bool {
        // Inputs each node depends on; given up when there are too many.
        let mut sets: Vec<Vec<u32>> = Vec::with_capacity(region.ids.len());
        let mut total = 0;
        let columns = Columns::new(wrt);
        for &id in &region.ids {
            let mut set: Vec<u32> = columns.of(id).into_iter().map(|c| c as u32).collect();
            self.for_children(id, |c| {
                if let Some(k) = region.place(c) {
                    set.extend_from_slice(&sets[k]);
                }
            });
            set.sort_unstable();
            set.dedup();
            total += set.len();
            if total > limit {
                return false;
            }
            sets.push(set);
        }
        true
    }

    /// Places of the nodes under one node, ascending.
    fn below(&self, region: &Region, root: Id, mark: &mut Marks) -> Vec<usize> {
        let Some(k) = region.place(root) else { return Vec::new() };
        let mut out = vec![k];
        mark.next();
        mark.set(k);
        let mut head = 0;
        while head < out.len() {
            let id = region.ids[out[head]];
            head += 1;
            let mut visit = |c: Id| {
                if let Some(k) = region.place(c) {
                    if mark.set(k) {
                        out.push(k);
                    }
                }
            };
            self.for_children(id, &mut visit);
            if let Node::Pick(g, _) = self.node(id) {
                let e = &self.groups[g as usize];
                (e.first.0..e.first.0 + e.n).for_each(|k| visit(Id(k)));
            }
        }
        out.sort_unstable();
        out
    }

    fn jacobian_backward(&mut self, region: &Region, outputs: &[Id], wrt: &[Id]) -> Result<Vec<Entry>> {
        let one = self.constant(1.0);
        let mut mark = Marks::new(region.ids.len());
        let mut adjoint = vec![None; region.ids.len()];
        let mut entries = Vec::new();
        let columns = Columns::new(wrt);
        for (row, &o) in outputs.iter().enumerate() {
            let places = self.below(region, o, &mut mark);
            self.sweep_back(region, &places, &[(o, one)], &mut adjoint)?;
            for &k in &places {
                let v = adjoint[k].take();
                if let (Some(col), Some(value)) = (columns.of(region.ids[k]), v) {
                    if self.as_const(value) != Some(0.0) {
                        entries.push(Entry { row, col, value });
                    }
                }
            }
        }
        Ok(entries)
    }

    fn read_inputs(&self, region: &Region, adjoint: &[Option<Id>], wrt: &[Id]) -> Vec<(usize, Id)> {
        let columns = Columns::new(wrt);
        let mut out: Vec<(usize, Id)> = region
            .ids
            .iter()
            .zip(adjoint)
            .filter_map(|(&id, &v)| Some((columns.of(id)?, v?)))
            .filter(|g| self.as_const(g.1) != Some(0.0))
            .collect();
        out.sort_unstable();
        out
    }

    /// Backward sweep over `places` (ascending): adjoints of the seeded sum.
    fn sweep_back(
        &mut self,
        region: &Region,
        places: &[usize],
        seeds: &[(Id, Id)],
        adjoint: &mut [Option<Id>],
    ) -> Result<()> {
        for &(o, w) in seeds {
            if let Some(k) = region.place(o) {
                self.accumulate(adjoint, k, w);
            }
        }
        for (step, &k) in places.iter().rev().enumerate() {
            if step % NODES_PER_QUESTION == 0 {
                stop::check()?;
            }
            let id = region.ids[k];
            if let Node::Pick(g, component) = self.node(id) {
                if component == 0 {
                    self.group_back(region, g, adjoint)?;
                }
                continue;
            }
            let Some(w) = adjoint[k] else { continue };
            for (c, partial) in self.partials(id, |c| region.place(c).is_some())?.into_iter().flatten() {
                if let Some(kc) = region.place(c) {
                    let v = self.mul(w, partial);
                    self.accumulate(adjoint, kc, v);
                }
            }
        }
        Ok(())
    }

    fn accumulate(&mut self, adjoint: &mut [Option<Id>], k: usize, v: Id) {
        adjoint[k] = Some(match adjoint[k] {
            Some(sum) => self.add(sum, v),
            None => v,
        });
    }

    fn group_back(&mut self, region: &Region, g: u32, adjoint: &mut [Option<Id>]) -> Result<()> {
        let entry = self.groups[g as usize].clone();
        let zero = self.constant(0.0);
        let of = |dag: &Dag, k: u32| region.place(dag.pick(g, k as usize)).and_then(|k| adjoint[k]);
        let weights: Vec<Id> = (0..entry.n).map(|k| of(self, k).unwrap_or(zero)).collect();
        if weights.iter().all(|&w| w == zero) {
            return Ok(());
        }
        match entry.group {
            Group::Factor { .. } => {}
            Group::Solve { factor, transposed, rhs } => {
                let z = self.solve_factored(factor, !transposed, &weights);
                for (&b, &z) in rhs.iter().zip(&z) {
                    if let Some(k) = region.place(b) {
                        self.accumulate(adjoint, k, z);
                    }
                }
                // x = A⁻¹ b: the adjoint of A is −z xᵀ, of its transpose −x zᵀ.
                for (i, j, a) in self.active_matrix(factor, region) {
                    let (r, c) = if transposed { (j, i) } else { (i, j) };
                    let x = self.pick(g, c);
                    let v = self.mul(z[r], x);
                    let v = self.neg(v);
                    self.accumulate(adjoint, a, v);
                }
            }
            Group::Call { function, what, args } => {
                if let Some(p) = self.implicit_partials(function, g, &args)? {
                    self.implicit_back(region, &p, &weights, &args, adjoint);
                    return Ok(());
                }
                for (out, arg, partial) in self.call_partials(function, what, &args, |a| region.place(a).is_some())? {
                    if let Some(k) = region.place(args[arg]) {
                        let v = self.mul(weights[out], partial);
                        self.accumulate(adjoint, k, v);
                    }
                }
            }
        }
        Ok(())
    }

    /// Adjoints of the arguments of an implicit function: `V_zᵀ v − G_zᵀ G_w⁻ᵀ w` for the weights of value and unknowns.
    fn implicit_back(
        &mut self,
        region: &Region,
        p: &Partials,
        weights: &[Id],
        args: &[Id],
        adjoint: &mut [Option<Id>],
    ) {
        let zero = self.constant(0.0);
        if p.first == 1 && weights[0] != zero {
            for &(arg, slope) in &p.value {
                if let Some(k) = region.place(args[arg]) {
                    let v = self.mul(weights[0], slope);
                    self.accumulate(adjoint, k, v);
                }
            }
        }
        if weights[p.first..].iter().all(|&w| w == zero) {
            return;
        }
        let z = self.solve_implicit(p, true, &weights[p.first..]);
        for &(row, arg, slope) in &p.arguments {
            if let Some(k) = region.place(args[arg]) {
                let v = self.mul(z[row], slope);
                let v = self.neg(v);
                self.accumulate(adjoint, k, v);
            }
        }
    }

    /// Tangents of the components of an implicit function.
    fn implicit_forward(
        &mut self,
        region: &Region,
        p: &Partials,
        args: &[Id],
        tangents: &[Vec<(u32, Id)>],
    ) -> Vec<Vec<(u32, Id)>> {
        let n = p.n;
        let mut rows: Vec<Vec<(u32, Id)>> = vec![Vec::new(); n];
        for &(row, arg, slope) in &p.arguments {
            if let Some(k) = region.place(args[arg]) {
                let minus = self.neg(slope);
                self.add_scaled(&mut rows[row], &tangents[k], minus);
            }
        }
        let mut out: Vec<Vec<(u32, Id)>> = vec![Vec::new(); p.first + n];
        for &(arg, slope) in &p.value {
            if let Some(k) = region.place(args[arg]) {
                self.add_scaled(&mut out[0], &tangents[k], slope);
            }
        }
        for (col, b) in self.columns_of(&rows) {
            for (out, x) in out[p.first..].iter_mut().zip(self.solve_implicit(p, false, &b)) {
                out.push((col, x));
            }
        }
        out
    }

    /// Right-hand sides of all columns that occur in rows.
    fn columns_of(&mut self, rows: &[Vec<(u32, Id)>]) -> Vec<(u32, Vec<Id>)> {
        let mut cols: Vec<u32> = rows.iter().flatten().map(|e| e.0).collect();
        cols.sort_unstable();
        cols.dedup();
        let zero = self.constant(0.0);
        let entry = |r: &Vec<(u32, Id)>, col: u32| r.binary_search_by_key(&col, |e| e.0).map_or(zero, |k| r[k].1);
        cols.into_iter().map(|col| (col, rows.iter().map(|r| entry(r, col)).collect())).collect()
    }

    /// Entries of a decomposed matrix that depend on the inputs: row, column, place.
    fn active_matrix(&self, factor: u32, region: &Region) -> Vec<(usize, usize, usize)> {
        let Group::Factor { n, matrix } = &self.groups[factor as usize].group else { return Vec::new() };
        let n = *n as usize;
        matrix.iter().enumerate().filter_map(|(e, &a)| Some((e % n, e / n, region.place(a)?))).collect()
    }

    fn jacobian_forward(&mut self, region: &Region, outputs: &[Id], wrt: &[Id]) -> Result<Vec<Entry>> {
        let one = self.constant(1.0);
        // Sparse tangents, each a list of (column, derivative).
        let mut tangents: Vec<Vec<(u32, Id)>> = Vec::with_capacity(region.ids.len());
        let columns = Columns::new(wrt);
        let mut k = 0;
        let mut step = 0;
        while k < region.ids.len() {
            if step % NODES_PER_QUESTION == 0 {
                stop::check()?;
            }
            step += 1;
            let id = region.ids[k];
            let col = columns.of(id);
            if let Some(col) = col {
                tangents.push(vec![(col as u32, one)]);
            } else if let Node::Pick(g, _) = self.node(id) {
                let all = self.group_forward(region, g, &tangents)?;
                k += all.len();
                tangents.extend(all);
                continue;
            } else {
                let mut sum: Vec<(u32, Id)> = Vec::new();
                for (c, partial) in self.partials(id, |c| region.place(c).is_some())?.into_iter().flatten() {
                    if let Some(kc) = region.place(c) {
                        self.add_scaled(&mut sum, &tangents[kc], partial);
                    }
                }
                tangents.push(sum);
            }
            k += 1;
        }
        let mut entries = Vec::new();
        for (row, &o) in outputs.iter().enumerate() {
            if let Some(k) = region.place(o) {
                entries.extend(tangents[k].iter().map(|&(col, value)| Entry { row, col: col as usize, value }));
            }
        }
        Ok(entries)
    }

    /// `sum += factor · v`, both sorted by columns; zeros vanish.
    fn add_scaled(&mut self, sum: &mut Vec<(u32, Id)>, v: &[(u32, Id)], factor: Id) {
        let mut out = Vec::with_capacity(sum.len() + v.len());
        let (mut a, mut b) = (0, 0);
        while a < sum.len() || b < v.len() {
            let take_a = b == v.len() || (a < sum.len() && sum[a].0 <= v[b].0);
            let take_b = a == sum.len() || (b < v.len() && v[b].0 <= sum[a].0);
            let (col, value) = match (take_a, take_b) {
                (true, false) => sum[a],
                (false, _) => (v[b].0, self.mul(v[b].1, factor)),
                (true, true) => {
                    let scaled = self.mul(v[b].1, factor);
                    (v[b].0, self.add(sum[a].1, scaled))
                }
            };
            a += usize::from(take_a);
            b += usize::from(take_b);
            if self.as_const(value) != Some(0.0) {
                out.push((col, value));
            }
        }
        *sum = out;
    }

    /// Tangents of all components of a group.
    fn group_forward(&mut self, region: &Region, g: u32, tangents: &[Vec<(u32, Id)>]) -> Result<Vec<Vec<(u32, Id)>>> {
        let entry = self.groups[g as usize].clone();
        let n = entry.n as usize;
        // Right-hand sides of the linear systems, or the derivatives themselves, by component.
        let mut rows: Vec<Vec<(u32, Id)>> = vec![Vec::new(); n];
        let one = self.constant(1.0);
        match entry.group {
            Group::Factor { .. } => {}
            Group::Call { function, what, args } => {
                if let Some(p) = self.implicit_partials(function, g, &args)? {
                    return Ok(self.implicit_forward(region, &p, &args, tangents));
                }
                for (out, arg, partial) in self.call_partials(function, what, &args, |a| region.place(a).is_some())? {
                    if let Some(k) = region.place(args[arg]) {
                        self.add_scaled(&mut rows[out], &tangents[k], partial);
                    }
                }
            }
            Group::Solve { factor, transposed, rhs } => {
                for (row, &b) in rows.iter_mut().zip(&rhs) {
                    if let Some(k) = region.place(b) {
                        self.add_scaled(row, &tangents[k], one);
                    }
                }
                for (i, j, a) in self.active_matrix(factor, region) {
                    let (r, c) = if transposed { (j, i) } else { (i, j) };
                    let x = self.pick(g, c);
                    let minus = self.neg(x);
                    self.add_scaled(&mut rows[r], &tangents[a], minus);
                }
                let mut out: Vec<Vec<(u32, Id)>> = vec![Vec::new(); n];
                for (col, b) in self.columns_of(&rows) {
                    for (out, x) in out.iter_mut().zip(self.solve_factored(factor, transposed, &b)) {
                        out.push((col, x));
                    }
                }
                return Ok(out);
            }
        }
        Ok(rows)
    }

    /// Derivatives of a node with respect to the children that matter.
    fn partials(&mut self, id: Id, wanted: impl Fn(Id) -> bool) -> Result<[Option<(Id, Id)>; 2]> {
        Ok(match self.node(id) {
            // Of a product or quotient: 1/x and ±1/y, not through x y, so that what is separate stays separate.
            Node::Unary(Unary::Log, a) if matches!(self.node(a), Node::Binary(Binary::Mul | Binary::Div, ..)) => {
                let Node::Binary(op, x, y) = self.node(a) else { return Ok([None, None]) };
                let one = self.constant(1.0);
                let sign = self.constant(if op == Binary::Mul { 1.0 } else { -1.0 });
                [Some((x, self.div(one, x))), Some((y, self.div(sign, y)))]
            }
            Node::Unary(op, a) => [Some((a, self.unary_partial(op, a, id))), None],
            Node::PowI(a, n) => {
                let p = self.powi(a, n - 1);
                let c = self.constant(f64::from(n));
                [Some((a, self.mul(c, p))), None]
            }
            Node::Piecewise(index, order, a) => [Some((a, self.piecewise_node(index, order + 1, a))), None],
            Node::Binary(op, a, b) => {
                let da = if wanted(a) { Some((a, self.binary_partial(op, a, b, id, true))) } else { None };
                let db = if wanted(b) { Some((b, self.binary_partial(op, a, b, id, false))) } else { None };
                [da, db]
            }
            Node::Const(_) | Node::Input(..) | Node::Pick(..) => [None, None],
            Node::Select(..) => {
                return Err(Error::Unsupported(
                    "a function with sign, abs, min, max or where has no derivative everywhere: build a model of it, \
                     which turns them into switching functions"
                        .into(),
                ))
            }
            Node::Truth(_) | Node::Positive(_) | Node::Not(_) | Node::And(..) | Node::Or(..) => {
                return Err(Error::Range("a condition has no derivative: choose values with where".into()))
            }
        })
    }

    fn unary_partial(&mut self, op: Unary, a: Id, value: Id) -> Id {
        let one = self.constant(1.0);
        match op {
            Unary::Neg => self.constant(-1.0),
            Unary::Sqrt => {
                let half = self.constant(0.5);
                self.div(half, value)
            }
            Unary::Exp => value,
            Unary::Log => self.div(one, a),
            Unary::Sin => self.unary(Unary::Cos, a),
            Unary::Cos => {
                let s = self.unary(Unary::Sin, a);
                self.neg(s)
            }
            Unary::Tan => {
                let s = self.powi(value, 2);
                self.add(one, s)
            }
            Unary::Asin | Unary::Acos => {
                // √((1 − a)(1 + a)) keeps its digits near ±1.
                let (l, r) = (self.sub(one, a), self.add(one, a));
                let p = self.mul(l, r);
                let root = self.unary(Unary::Sqrt, p);
                let c = if op == Unary::Asin { one } else { self.constant(-1.0) };
                self.div(c, root)
            }
            Unary::Atan => {
                let s = self.powi(a, 2);
                let d = self.add(one, s);
                self.div(one, d)
            }
            Unary::Sinh => self.unary(Unary::Cosh, a),
            Unary::Cosh => self.unary(Unary::Sinh, a),
            Unary::Tanh => {
                // 1 − tanh² would lose all digits for large arguments.
                let c = self.unary(Unary::Cosh, a);
                self.powi(c, -2)
            }
            Unary::Erf => {
                let s = self.powi(a, 2);
                let s = self.neg(s);
                let e = self.unary(Unary::Exp, s);
                let c = self.constant(std::f64::consts::FRAC_2_SQRT_PI);
                self.mul(c, e)
            }
            Unary::Floor => self.constant(0.0),
        }
    }

    fn binary_partial(&mut self, op: Binary, a: Id, b: Id, value: Id, first: bool) -> Id {
        let one = self.constant(1.0);
        match op {
            Binary::Add => one,
            Binary::Sub => {
                if first {
                    one
                } else {
                    self.constant(-1.0)
                }
            }
            Binary::Mul => {
                if first {
                    b
                } else {
                    a
                }
            }
            Binary::Div => {
                let inverse = self.div(one, b);
                if first {
                    inverse
                } else {
                    let v = self.mul(value, inverse);
                    self.neg(v)
                }
            }
            Binary::Pow => {
                if first {
                    let less = self.sub(b, one);
                    let p = self.pow(a, less);
                    self.mul(b, p)
                } else {
                    let l = self.unary(Unary::Log, a);
                    self.mul(l, value)
                }
            }
            Binary::Atan2 => {
                let (y, x) = (self.powi(a, 2), self.powi(b, 2));
                let r = self.add(y, x);
                if first {
                    self.div(b, r)
                } else {
                    let v = self.div(a, r);
                    self.neg(v)
                }
            }
        }
    }

    /// Derivatives of the outputs of a call: output, argument, value.
    fn call_partials(
        &mut self,
        function: u32,
        what: CallKind,
        args: &[Id],
        wanted: impl Fn(Id) -> bool,
    ) -> Result<Vec<(usize, usize, Id)>> {
        let f = self.functions[function as usize].clone();
        let (jac, hess) = (f.jac_pattern(), f.hess_pattern());
        let mut out = Vec::new();
        match what {
            CallKind::Value => {
                let g = self.group(Group::Call { function, what: CallKind::Jacobian, args: args.to_vec() }, jac.nnz());
                for j in (0..jac.n_cols()).filter(|&j| wanted(args[j])) {
                    out.extend(jac.range(j).map(|k| (jac.row_idx()[k], j, self.pick(g, k))));
                }
            }
            CallKind::Jacobian => {
                let mut by_row: Vec<Vec<(usize, usize)>> = vec![Vec::new(); f.n_out()];
                for j in 0..jac.n_cols() {
                    jac.range(j).for_each(|k| by_row[jac.row_idx()[k]].push((j, k)));
                }
                for (i, entries) in by_row.iter().enumerate() {
                    let coupled = |j: usize, l: usize| hess.get(j.min(l), j.max(l));
                    let any = entries.iter().any(|&(j, _)| (0..args.len()).any(|l| coupled(j, l).is_some()));
                    if !any {
                        continue;
                    }
                    let what = CallKind::Hessian(i as u32);
                    let g = self.group(Group::Call { function, what, args: args.to_vec() }, hess.nnz());
                    for &(j, entry) in entries {
                        for l in (0..args.len()).filter(|&l| wanted(args[l])) {
                            if let Some(k) = coupled(j, l) {
                                out.push((entry, l, self.pick(g, k)));
                            }
                        }
                    }
                }
            }
            CallKind::Hessian(_) => {
                return Err(Error::Unsupported(format!("function '{}' has no third derivatives", f.name())));
            }
        }
        Ok(out)
    }
}

/// The places of inputs among those that derivatives are taken by.
struct Columns {
    /// Inputs, ascending, and their places.
    all: Vec<(Id, u32)>,
}

impl Columns {
    fn new(wrt: &[Id]) -> Columns {
        let mut all: Vec<(Id, u32)> = wrt.iter().copied().zip(0..).collect();
        all.sort_unstable();
        Columns { all }
    }

    /// Place of a node, if it is one of them.
    fn of(&self, id: Id) -> Option<usize> {
        let k = self.all.partition_point(|a| a.0 < id);
        self.all.get(k).filter(|a| a.0 == id).map(|a| a.1 as usize)
    }
}

/// Marks that are cleared at no cost.
struct Marks {
    at: Vec<u32>,
    now: u32,
}

impl Marks {
    fn new(n: usize) -> Marks {
        Marks { at: vec![0; n], now: 0 }
    }
    fn next(&mut self) {
        self.now += 1;
    }
    /// True the first time.
    fn set(&mut self, k: usize) -> bool {
        std::mem::replace(&mut self.at[k], self.now) != self.now
    }
}
