//! Small linear systems and external functions: several values from one computation.

use super::dag::{Block, CallKind, Dag, External, Group, Id, Node};
use crate::error::{Error, Result};
use crate::memory::{self, sizes};

impl Dag {
    /// Solution of `A x = b`, `matrix` by columns `n × n`, `rhs[n]`.
    ///
    /// The matrix is decomposed numerically (LU with partial pivoting) where the solution is evaluated, once for all
    /// right-hand sides and derivatives; its inverse is never written out. Parts of the matrix that are not coupled
    /// are solved apart, so that patterns stay exact, and rows with one entry become divisions.
    pub fn solve(&mut self, matrix: &[Id], rhs: &[Id]) -> Result<Vec<Id>> {
        let n = rhs.len();
        if n == 0 || matrix.len() != n * n {
            return Err(Error::Dimension(format!(
                "linear system: {} entries of the matrix for {n} right-hand sides, expected {}",
                matrix.len(),
                n * n
            )));
        }
        let blocks = blocks(n, |i, j| self.as_const(matrix[i + n * j]) == Some(0.0)).ok_or_else(|| {
            Error::Range(format!("linear system of size {n}: the matrix is singular whatever its entries are"))
        })?;
        let mut x: Vec<Option<Id>> = vec![None; n];
        // Rows of a block use its own columns and columns of blocks solved before.
        for (rows, cols) in blocks {
            let mut b = Vec::with_capacity(rows.len());
            for &i in &rows {
                let mut r = rhs[i];
                for j in (0..n).filter(|j| !cols.contains(j)) {
                    if self.as_const(matrix[i + n * j]) == Some(0.0) {
                        continue;
                    }
                    let known = x[j].expect("blocks come in order");
                    let term = self.mul(matrix[i + n * j], known);
                    r = self.sub(r, term);
                }
                b.push(r);
            }
            let block: Vec<Id> = cols.iter().flat_map(|&j| rows.iter().map(move |&i| matrix[i + n * j])).collect();
            for (&j, v) in cols.iter().zip(self.solve_block(&block, &b)) {
                x[j] = Some(v);
            }
        }
        Ok(x.into_iter().flatten().collect())
    }

    fn solve_block(&mut self, matrix: &[Id], rhs: &[Id]) -> Vec<Id> {
        if let (&[a], &[b]) = (matrix, rhs) {
            return vec![self.div(b, a)];
        }
        let n = rhs.len();
        let factor = self.group(Group::Factor { n: n as u32, matrix: matrix.to_vec() }, 0);
        self.solve_factored(factor, false, rhs)
    }

    /// Solution with a matrix that is decomposed already; zero right-hand sides cost nothing.
    pub(super) fn solve_factored(&mut self, factor: u32, transposed: bool, rhs: &[Id]) -> Vec<Id> {
        let zero = |dag: &Dag, b: Id| dag.as_const(b) == Some(0.0);
        let Some(&first) = rhs.iter().find(|b| !zero(self, **b)) else { return rhs.to_vec() };
        if self.is_negative(first) {
            // right-hand sides that differ in their sign have one solution, and its digits
            let opposite: Vec<Id> = rhs.iter().map(|&b| self.neg(b)).collect();
            let x = self.solve_factored(factor, transposed, &opposite);
            return x.into_iter().map(|x| self.neg(x)).collect();
        }
        let g = self.group(Group::Solve { factor, transposed, rhs: rhs.to_vec() }, rhs.len());
        (0..rhs.len()).map(|k| self.pick(g, k)).collect()
    }

    /// Outputs of an external function at `args`, one for each of its inputs: `x`, `u`, `p`, then `t`.
    ///
    /// Derivatives are those of the function: Jacobians, and the Hessian of each output. They are what it says
    /// they are; finite differences stay finite differences.
    pub fn call(&mut self, function: &External, args: &[Id]) -> Result<Vec<Id>> {
        self.call_as(function, CallKind::Value, args)
    }

    /// Outputs, entries of the Jacobian, or entries of the Hessian of one output.
    pub(super) fn call_as(&mut self, function: &External, what: CallKind, args: &[Id]) -> Result<Vec<Id>> {
        let n_in = function.dims().n_in();
        if args.len() != n_in {
            return Err(Error::Dimension(format!(
                "function '{}' takes {n_in} inputs (x, u, p, then t), {} expressions given",
                function.name(),
                args.len()
            )));
        }
        if let Some(&c) = args.iter().find(|&&a| self.is_condition(a)) {
            return Err(Error::Range(format!(
                "input {} of '{}' is a condition, not a value",
                c.index(),
                function.name()
            )));
        }
        let index = self.function_number(function);
        let n = match what {
            CallKind::Value => function.n_out(),
            CallKind::Jacobian => function.jac_pattern().nnz(),
            CallKind::Hessian(_) => function.hess_pattern().nnz(),
        };
        let g = self.group(Group::Call { function: index, what, args: args.to_vec() }, n);
        Ok((0..n).map(|k| self.pick(g, k)).collect())
    }

    /// The number of a function among those that are called.
    pub(super) fn function_number(&mut self, function: &External) -> u32 {
        let same = |f: &External| std::ptr::addr_eq(std::sync::Arc::as_ptr(f), std::sync::Arc::as_ptr(function));
        let index = self.functions.iter().position(same).unwrap_or_else(|| {
            self.functions.push(function.clone());
            self.functions.len() - 1
        });
        index as u32
    }

    /// The decompositions of matrices that the nodes need: numbers that are equal for equal matrices, sorted.
    pub fn decompositions_of(&self, roots: &[Id]) -> Vec<u32> {
        let of = |id: Id| match self.node(id) {
            Node::Pick(g, _) => match self.groups[g as usize].group {
                Group::Solve { factor, .. } => Some(factor),
                _ => None,
            },
            _ => None,
        };
        let mut all: Vec<u32> = self.reachable(roots).into_iter().filter_map(of).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Inner product.
    pub fn dot(&mut self, a: &[Id], b: &[Id]) -> Result<Id> {
        if a.len() != b.len() {
            return Err(Error::Dimension(format!("inner product of {} and {} expressions", a.len(), b.len())));
        }
        let mut sum = self.constant(0.0);
        for (&a, &b) in a.iter().zip(b) {
            let product = self.mul(a, b);
            sum = self.add(sum, product);
        }
        Ok(sum)
    }

    /// Euclidean norm; it has no derivative at zero.
    pub fn norm(&mut self, a: &[Id]) -> Result<Id> {
        let square = self.dot(a, a)?;
        Ok(self.unary(super::op::Unary::Sqrt, square))
    }

    /// `A B`, by columns: `A` is `m × k`, `B` is `k × n`.
    pub fn matmul(&mut self, m: usize, k: usize, n: usize, a: &[Id], b: &[Id]) -> Result<Vec<Id>> {
        if m.checked_mul(k) != Some(a.len()) || k.checked_mul(n) != Some(b.len()) {
            return Err(Error::Dimension(format!(
                "product of {m} x {k} and {k} x {n}: {} and {} entries given",
                a.len(),
                b.len()
            )));
        }
        let mut out = memory::with_capacity(sizes::entries("the product", &[m, n])?);
        for j in 0..n {
            for i in 0..m {
                let row: Vec<Id> = (0..k).map(|l| a[i + m * l]).collect();
                out.push(self.dot(&row, &b[k * j..k * (j + 1)])?);
            }
        }
        Ok(out)
    }

    /// Inputs `0..n` of a block.
    pub fn inputs(&mut self, block: Block, n: usize) -> Vec<Id> {
        (0..n).map(|i| self.input(block, i)).collect()
    }
}

/// Block triangular form: rows and columns of the diagonal blocks, in the order of solution; `None` for a
/// structurally singular matrix.
#[allow(clippy::type_complexity)]
fn blocks(n: usize, zero: impl Fn(usize, usize) -> bool) -> Option<Vec<(Vec<usize>, Vec<usize>)>> {
    // A row for every column by augmenting paths, searched breadth first.
    let (mut row_of, mut col_of) = (vec![n; n], vec![n; n]);
    for start in 0..n {
        let mut from = vec![n; n];
        let mut queue = vec![start];
        let mut end = None;
        let mut head = 0;
        while let (Some(&j), None) = (queue.get(head), end) {
            head += 1;
            for i in (0..n).filter(|&i| !zero(i, j)) {
                if from[i] != n {
                    continue;
                }
                from[i] = j;
                if col_of[i] == n {
                    end = Some(i);
                    break;
                }
                queue.push(col_of[i]);
            }
        }
        let mut i = end?;
        loop {
            let j = from[i];
            let before = row_of[j];
            (row_of[j], col_of[i]) = (i, j);
            if j == start {
                break;
            }
            i = before;
        }
    }
    // Column j needs the columns of its row; what needs each other is one block. Reachability is enough at this size.
    let mut reach = vec![false; n * n];
    for j in 0..n {
        for k in 0..n {
            reach[j * n + k] = j == k || !zero(row_of[j], k);
        }
    }
    for m in 0..n {
        for j in 0..n {
            if reach[j * n + m] {
                for k in 0..n {
                    reach[j * n + k] |= reach[m * n + k];
                }
            }
        }
    }
    let needs = |j: usize| (0..n).filter(|&k| reach[j * n + k]).count();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|&j| (needs(j), j));
    let mut done = vec![false; n];
    let mut out = Vec::new();
    for j in order {
        if done[j] {
            continue;
        }
        let cols: Vec<usize> = (0..n).filter(|&k| reach[j * n + k] && reach[k * n + j]).collect();
        cols.iter().for_each(|&k| done[k] = true);
        out.push((cols.iter().map(|&k| row_of[k]).collect(), cols));
    }
    Some(out)
}

/// `A = P L U` in place: `a[i + n j]`, the `n` pivot rows follow the matrix.
///
/// False for a matrix that is singular or not finite.
pub(super) fn factor(n: usize, a: &mut [f64]) -> bool {
    // Small sizes are unrolled.
    match n {
        2 => factor_sized(2, a),
        3 => factor_sized(3, a),
        4 => factor_sized(4, a),
        _ => factor_sized(n, a),
    }
}

#[inline(always)]
fn factor_sized(n: usize, a: &mut [f64]) -> bool {
    let (a, pivots) = a[..n * n + n].split_at_mut(n * n);
    for k in 0..n {
        let mut p = k;
        for i in k + 1..n {
            if a[i + n * k].abs() > a[p + n * k].abs() {
                p = i;
            }
        }
        pivots[k] = p as f64;
        let pivot = a[p + n * k];
        if pivot == 0.0 || !pivot.is_finite() {
            return false;
        }
        if p != k {
            for j in 0..n {
                a.swap(k + n * j, p + n * j);
            }
        }
        for i in k + 1..n {
            a[i + n * k] /= pivot;
        }
        for j in k + 1..n {
            let f = a[k + n * j];
            for i in k + 1..n {
                a[i + n * j] -= a[i + n * k] * f;
            }
        }
    }
    true
}

/// Solves in place with the result of [`factor`].
pub(super) fn solve(n: usize, lu: &[f64], transposed: bool, x: &mut [f64]) {
    match n {
        2 => solve_sized(2, lu, transposed, x),
        3 => solve_sized(3, lu, transposed, x),
        4 => solve_sized(4, lu, transposed, x),
        _ => solve_sized(n, lu, transposed, x),
    }
}

#[inline(always)]
fn solve_sized(n: usize, lu: &[f64], transposed: bool, x: &mut [f64]) {
    let (a, pivots) = lu[..n * n + n].split_at(n * n);
    let x = &mut x[..n];
    if transposed {
        for k in 0..n {
            for i in 0..k {
                x[k] -= a[i + n * k] * x[i];
            }
            x[k] /= a[k + n * k];
        }
        for k in (0..n).rev() {
            for i in k + 1..n {
                x[k] -= a[i + n * k] * x[i];
            }
        }
        for k in (0..n).rev() {
            x.swap(k, pivots[k] as usize);
        }
        return;
    }
    // The rows of L are swapped as well, so all swaps come first.
    for k in 0..n {
        x.swap(k, pivots[k] as usize);
    }
    for k in 0..n {
        for i in k + 1..n {
            x[i] -= a[i + n * k] * x[k];
        }
    }
    for k in (0..n).rev() {
        x[k] /= a[k + n * k];
        for i in 0..k {
            x[i] -= a[i + n * k] * x[k];
        }
    }
}

/// Numbers of several points beside each other.
type Lanes<const L: usize> = [f64; L];

#[inline(always)]
fn subtract_product<const L: usize>(x: &mut Lanes<L>, a: Lanes<L>, b: Lanes<L>) {
    for l in 0..L {
        x[l] -= a[l] * b[l];
    }
}

#[inline(always)]
fn divide<const L: usize>(x: &mut Lanes<L>, a: Lanes<L>) {
    for l in 0..L {
        x[l] /= a[l];
    }
}

/// Swaps entries `k` and `p` of every lane, each with its own `p`.
fn swap_lanes<const L: usize>(x: &mut [Lanes<L>], k: usize, p: Lanes<L>) {
    for l in 0..L {
        let p = p[l] as usize;
        if p != k {
            (x[k][l], x[p][l]) = (x[p][l], x[k][l]);
        }
    }
}

/// [`factor`] of the matrices of all lanes; false if one of them is singular.
pub(super) fn factor_lanes<const L: usize>(n: usize, a: &mut [Lanes<L>]) -> bool {
    let (a, pivots) = a[..n * n + n].split_at_mut(n * n);
    for k in 0..n {
        let mut p = [k as f64; L];
        let mut pivot = a[k + n * k];
        for i in k + 1..n {
            for l in 0..L {
                let v = a[i + n * k][l];
                if v.abs() > pivot[l].abs() {
                    (p[l], pivot[l]) = (i as f64, v);
                }
            }
        }
        pivots[k] = p;
        if pivot.iter().any(|v| *v == 0.0 || !v.is_finite()) {
            return false;
        }
        if p != [k as f64; L] {
            for column in a.chunks_exact_mut(n) {
                swap_lanes(column, k, p);
            }
        }
        for i in k + 1..n {
            divide(&mut a[i + n * k], pivot);
        }
        for j in k + 1..n {
            let f = a[k + n * j];
            for i in k + 1..n {
                let v = a[i + n * k];
                subtract_product(&mut a[i + n * j], v, f);
            }
        }
    }
    true
}

/// [`solve`] with the results of [`factor_lanes`].
pub(super) fn solve_lanes<const L: usize>(n: usize, lu: &[Lanes<L>], transposed: bool, x: &mut [Lanes<L>]) {
    let (a, pivots) = lu[..n * n + n].split_at(n * n);
    let x = &mut x[..n];
    if transposed {
        for k in 0..n {
            let mut v = x[k];
            for i in 0..k {
                subtract_product(&mut v, a[i + n * k], x[i]);
            }
            divide(&mut v, a[k + n * k]);
            x[k] = v;
        }
        for k in (0..n).rev() {
            let mut v = x[k];
            for i in k + 1..n {
                subtract_product(&mut v, a[i + n * k], x[i]);
            }
            x[k] = v;
        }
        for k in (0..n).rev() {
            swap_lanes(x, k, pivots[k]);
        }
        return;
    }
    for k in 0..n {
        swap_lanes(x, k, pivots[k]);
    }
    for k in 0..n {
        let f = x[k];
        for i in k + 1..n {
            subtract_product(&mut x[i], a[i + n * k], f);
        }
    }
    for k in (0..n).rev() {
        divide(&mut x[k], a[k + n * k]);
        let f = x[k];
        for i in 0..k {
            subtract_product(&mut x[i], a[i + n * k], f);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some numbers without order.
    fn numbers(n: usize, seed: usize) -> Vec<f64> {
        (0..n).map(|k| ((k * k * 7 + 3 * k + seed) as f64).sin()).collect()
    }

    #[test]
    fn solvers_of_all_sizes_in_both_directions() {
        for n in 1..=6 {
            for transposed in [false, true] {
                // Lanes with pivots of their own, and the same one by one.
                let matrices: Vec<Vec<f64>> = (0..3).map(|l| numbers(n * n, 11 * l + 1)).collect();
                let x = numbers(n, 5);
                let rhs = |a: &[f64]| -> Vec<f64> {
                    let at = |i: usize, j: usize| if transposed { a[j + n * i] } else { a[i + n * j] };
                    (0..n).map(|i| (0..n).map(|j| at(i, j) * x[j]).sum()).collect()
                };
                let lanes = |v: &dyn Fn(usize) -> Vec<f64>| -> Vec<[f64; 3]> {
                    let all = [v(0), v(1), v(2)];
                    (0..all[0].len()).map(|k| [all[0][k], all[1][k], all[2][k]]).collect()
                };
                let mut lu = lanes(&|l| [matrices[l].clone(), vec![0.0; n]].concat());
                let mut found = lanes(&|l| rhs(&matrices[l]));
                assert!(factor_lanes(n, &mut lu));
                solve_lanes(n, &lu, transposed, &mut found);
                for (l, a) in matrices.iter().enumerate() {
                    let mut one = [a.clone(), vec![0.0; n]].concat();
                    let mut y = rhs(a);
                    assert!(factor(n, &mut one));
                    solve(n, &one, transposed, &mut y);
                    for k in 0..n {
                        assert!((y[k] - x[k]).abs() < 1e-11, "size {n}: {} {}", y[k], x[k]);
                        assert_eq!(y[k].to_bits(), found[k][l].to_bits(), "size {n}");
                    }
                }
            }
        }
        assert!(!factor(2, &mut [1.0, 2.0, 2.0, 4.0, 0.0, 0.0]));
        assert!(!factor(1, &mut [f64::NAN, 0.0]));
        assert!(!factor_lanes(1, &mut [[1.0, 0.0], [0.0, 0.0]]));
    }

    #[test]
    fn block_triangular_form() {
        // Lower triangular with rows swapped: three blocks of one, each needing those before.
        let full = [[1, 1, 0], [1, 0, 0], [1, 1, 1]];
        let b = blocks(3, |i, j| full[i][j] == 0).unwrap();
        assert_eq!(b, [(vec![1], vec![0]), (vec![0], vec![1]), (vec![2], vec![2])]);
        let coupled = [[1, 1, 0], [1, 1, 0], [0, 1, 1]];
        let b = blocks(3, |i, j| coupled[i][j] == 0).unwrap();
        assert_eq!(b.iter().map(|b| b.1.clone()).collect::<Vec<_>>(), [vec![0, 1], vec![2]]);
        assert!(blocks(2, |_, j| j == 0).is_none());
    }

    #[test]
    fn wrong_sizes_are_refused() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 4);
        assert!(matches!(d.solve(&x, &x[..3]), Err(Error::Dimension(_))));
        assert!(matches!(d.solve(&[], &[]), Err(Error::Dimension(_))));
        assert!(matches!(d.dot(&x, &x[..3]), Err(Error::Dimension(_))));
        assert!(matches!(d.matmul(2, 2, 3, &x, &x), Err(Error::Dimension(_))));
        let zero = d.constant(0.0);
        assert!(matches!(d.solve(&[zero, zero, x[0], x[1]], &x[..2]), Err(Error::Range(_))));
    }
}
