//! Small linear systems and external functions: several values from one computation.

use super::dag::{Block, CallKind, Dag, External, Group, Id};
use crate::error::{Error, Result};

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
        if rhs.iter().all(|&b| self.as_const(b) == Some(0.0)) {
            return rhs.to_vec();
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
        let same = |f: &External| std::ptr::addr_eq(std::sync::Arc::as_ptr(f), std::sync::Arc::as_ptr(function));
        let index = self.functions.iter().position(same).unwrap_or_else(|| {
            self.functions.push(function.clone());
            self.functions.len() - 1
        });
        let n = match what {
            CallKind::Value => function.n_out(),
            CallKind::Jacobian => function.jac_pattern().nnz(),
            CallKind::Hessian(_) => function.hess_pattern().nnz(),
        };
        let g = self.group(Group::Call { function: index as u32, what, args: args.to_vec() }, n);
        Ok((0..n).map(|k| self.pick(g, k)).collect())
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
        if a.len() != m * k || b.len() != k * n {
            return Err(Error::Dimension(format!(
                "product of {m} x {k} and {k} x {n}: {} and {} entries given",
                a.len(),
                b.len()
            )));
        }
        let mut out = Vec::with_capacity(m * n);
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

/// `A = P L U` in place. Entry `(i, j)` is `w[at + (i + n j) S]`, the `n` pivot rows follow the matrix.
///
/// False for a matrix that is singular or not finite.
pub(super) fn factor<const S: usize>(n: usize, w: &mut [f64], at: usize) -> bool {
    let a = |i: usize, j: usize| at + (i + n * j) * S;
    for k in 0..n {
        let mut p = k;
        for i in k + 1..n {
            if w[a(i, k)].abs() > w[a(p, k)].abs() {
                p = i;
            }
        }
        w[a(k, n)] = p as f64;
        let pivot = w[a(p, k)];
        if pivot == 0.0 || !pivot.is_finite() {
            return false;
        }
        if p != k {
            for j in 0..n {
                w.swap(a(k, j), a(p, j));
            }
        }
        for i in k + 1..n {
            w[a(i, k)] /= pivot;
        }
        for j in k + 1..n {
            let f = w[a(k, j)];
            for i in k + 1..n {
                w[a(i, j)] -= w[a(i, k)] * f;
            }
        }
    }
    true
}

/// Solves with the result of [`factor`] at `lu`; right-hand side and solution are `w[b + k S]`.
pub(super) fn solve<const S: usize>(n: usize, w: &mut [f64], lu: usize, transposed: bool, b: usize) {
    let a = |i: usize, j: usize| lu + (i + n * j) * S;
    let x = |k: usize| b + k * S;
    if transposed {
        for k in 0..n {
            for i in 0..k {
                w[x(k)] -= w[a(i, k)] * w[x(i)];
            }
            w[x(k)] /= w[a(k, k)];
        }
        for k in (0..n).rev() {
            for i in k + 1..n {
                w[x(k)] -= w[a(i, k)] * w[x(i)];
            }
        }
        for k in (0..n).rev() {
            let p = w[a(k, n)] as usize;
            w.swap(x(k), x(p));
        }
        return;
    }
    // The rows of L are swapped as well, so all swaps come first.
    for k in 0..n {
        let p = w[a(k, n)] as usize;
        w.swap(x(k), x(p));
    }
    for k in 0..n {
        for i in k + 1..n {
            w[x(i)] -= w[a(i, k)] * w[x(k)];
        }
    }
    for k in (0..n).rev() {
        w[x(k)] /= w[a(k, k)];
        for i in 0..k {
            w[x(i)] -= w[a(i, k)] * w[x(k)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dense_solver_in_both_directions() {
        let a = [0.0, 2.0, 1.0, 1.0, 1.0, -1.0, 3.0, 0.5, 2.0];
        let x = [1.0, -2.0, 0.5];
        for transposed in [false, true] {
            let at = |i: usize, j: usize| if transposed { a[j + 3 * i] } else { a[i + 3 * j] };
            // Two lanes; the second is used.
            let mut w = vec![f64::NAN; 2 * 15];
            (0..9).for_each(|k| w[2 * k + 1] = a[k]);
            (0..3).for_each(|i| w[2 * (12 + i) + 1] = (0..3).map(|j| at(i, j) * x[j]).sum());
            assert!(factor::<2>(3, &mut w, 1));
            solve::<2>(3, &mut w, 1, transposed, 25);
            for (k, x) in x.iter().enumerate() {
                assert!((w[25 + 2 * k] - x).abs() < 1e-14, "{} {x}", w[25 + 2 * k]);
            }
        }
        assert!(!factor::<1>(2, &mut [1.0, 2.0, 2.0, 4.0, 0.0, 0.0], 0));
        assert!(!factor::<1>(1, &mut [f64::NAN, 0.0], 0));
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
