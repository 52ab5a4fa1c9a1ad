//! Sparse LU factorisation with partial pivoting, real and complex, whose structure is found once and used again.
//!
//! Columns are eliminated in an order of minimum degree; the first factorisation is left-looking with a depth-first search
//! for the pattern of every column (J. R. Gilbert, T. Peierls, *Sparse partial pivoting in time proportional to arithmetic
//! operations*, SIAM J. Sci. Stat. Comput. 9, 1988). Later ones take over pattern and pivots, and search again where a pivot
//! has become small.

use super::csc::Pattern;
use super::ldl::Ordering;
use super::lu::Scalar;
use crate::error::Result;

/// The pivot is on the diagonal where that is at least this part of the largest candidate, which keeps the fill low.
const DIAGONAL: f64 = 0.1;
/// A pivot that is taken over is at least this part of the largest entry below it.
const STILL_GOOD: f64 = 1e-3;
/// Pivots relative to the size of their row and unknown that count as zero.
const SINGULAR: f64 = 1e-14;
const NONE: usize = usize::MAX;

/// Columns of a triangular factor; rows are numbered by pivots.
#[derive(Debug, Default)]
struct Columns<T> {
    begin: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<T>,
}

impl<T: Scalar> Columns<T> {
    fn clear(&mut self) {
        self.begin.clear();
        self.begin.push(0);
        self.rows.clear();
        self.values.clear();
    }

    fn push(&mut self, row: usize, value: T) {
        self.rows.push(row);
        self.values.push(value);
    }

    fn range(&self, k: usize) -> std::ops::Range<usize> {
        self.begin[k]..self.begin[k + 1]
    }
}

/// Factors of a square matrix with a fixed pattern.
#[derive(Debug)]
pub struct SparseLu<T> {
    a: Pattern,
    values: Vec<T>,
    /// Column of every pivot.
    order: Vec<usize>,
    /// Row of every pivot, and pivot of every row.
    row: Vec<usize>,
    pivot: Vec<usize>,
    /// The structure is that of an earlier factorisation.
    known: bool,
    lower: Columns<T>,
    upper: Columns<T>,
    diagonal: Vec<T>,
    scale: Vec<f64>,
    x: Vec<T>,
    /// Column for which a row was last reached; path, place on it, and what was reached.
    mark: Vec<usize>,
    path: Vec<(usize, usize)>,
    reached: Vec<usize>,
}

impl<T: Scalar> SparseLu<T> {
    /// For matrices with this pattern.
    ///
    /// # Errors
    /// Those of the ordering.
    pub fn new(a: Pattern) -> Result<SparseLu<T>> {
        let n = a.n_cols();
        let (mut rows, mut cols) = (Vec::with_capacity(a.nnz()), Vec::with_capacity(a.nnz()));
        for j in 0..n {
            for &i in a.rows(j) {
                rows.push(i.min(j));
                cols.push(i.max(j));
            }
        }
        let order = Ordering::Amd.order(&Pattern::from_triplets(n, n, &rows, &cols).0)?;
        Ok(SparseLu {
            values: vec![T::default(); a.nnz()],
            order,
            row: vec![NONE; n],
            pivot: vec![NONE; n],
            known: false,
            lower: Columns::default(),
            upper: Columns::default(),
            diagonal: vec![T::default(); n],
            scale: vec![0.0; n],
            x: vec![T::default(); n],
            mark: vec![NONE; n],
            path: Vec::with_capacity(n),
            reached: Vec::with_capacity(n),
            a,
        })
    }

    /// The entries of the matrix, zero, to add to.
    #[inline]
    pub fn clear(&mut self) -> &mut [T] {
        self.values.fill(T::default());
        &mut self.values
    }

    /// Factorises what was written, with unknowns of these sizes; false if the matrix is singular to rounding.
    pub fn factorise_sized(&mut self, unknown: impl Fn(usize) -> f64) -> bool {
        self.scale.fill(0.0);
        for j in 0..self.a.n_cols() {
            let size = unknown(j);
            for k in self.a.range(j) {
                let s = &mut self.scale[self.a.row_idx()[k]];
                *s = s.max(self.values[k].size() * size);
            }
        }
        if !self.scale.iter().all(|s| *s > 0.0 && s.is_finite()) {
            return false;
        }
        self.scale.iter_mut().for_each(|s| *s = 1.0 / *s);
        if self.known && self.factorise_again(&unknown) {
            return true;
        }
        self.known = self.factorise_anew(&unknown);
        self.known
    }

    /// With the pattern and the pivots of an earlier factorisation; false where a pivot is too small.
    fn factorise_again(&mut self, unknown: impl Fn(usize) -> f64) -> bool {
        let x = &mut self.x;
        for k in 0..self.order.len() {
            let (upper, lower) = (self.upper.range(k), self.lower.range(k));
            self.upper.rows[upper.clone()].iter().for_each(|&j| x[j] = T::default());
            self.lower.rows[lower.clone()].iter().for_each(|&j| x[j] = T::default());
            x[k] = T::default();
            let column = self.order[k];
            for e in self.a.range(column) {
                x[self.pivot[self.a.row_idx()[e]]] = self.values[e];
            }
            for e in upper {
                let j = self.upper.rows[e];
                let u = x[j];
                self.upper.values[e] = u;
                let own = self.lower.range(j);
                for (&i, l) in self.lower.rows[own.clone()].iter().zip(&self.lower.values[own]) {
                    x[i] = x[i] - *l * u;
                }
            }
            let size = |i: usize| x[i].size() * self.scale[self.row[i]] * unknown(column);
            let largest = self.lower.rows[lower.clone()].iter().fold(0.0f64, |m, &i| m.max(size(i)));
            let own = size(k);
            // NaN fails too
            if !(own > SINGULAR && own >= STILL_GOOD * largest) {
                return false;
            }
            let pivot = x[k];
            self.diagonal[k] = pivot;
            for e in lower {
                self.lower.values[e] = x[self.lower.rows[e]] / pivot;
            }
        }
        true
    }

    /// With a search for pattern and pivots. Rows of the factors keep their own numbers until all pivots are known.
    fn factorise_anew(&mut self, unknown: impl Fn(usize) -> f64) -> bool {
        self.lower.clear();
        self.upper.clear();
        self.pivot.fill(NONE);
        self.mark.fill(NONE);
        for k in 0..self.order.len() {
            let column = self.order[k];
            self.reach(k, column);
            for &i in &self.reached {
                self.x[i] = T::default();
            }
            for e in self.a.range(column) {
                self.x[self.a.row_idx()[e]] = self.values[e];
            }
            // what others are computed from was reached last
            for &i in self.reached.iter().rev() {
                let j = self.pivot[i];
                if j == NONE {
                    continue;
                }
                let u = self.x[i];
                self.upper.push(j, u);
                for e in self.lower.range(j) {
                    let r = self.lower.rows[e];
                    self.x[r] = self.x[r] - self.lower.values[e] * u;
                }
            }
            let (mut best, mut largest, mut diagonal) = (NONE, 0.0, 0.0);
            for &i in self.reached.iter().filter(|i| self.pivot[**i] == NONE) {
                let size = self.x[i].size() * self.scale[i] * unknown(column);
                if i == column {
                    diagonal = size;
                }
                if size > largest {
                    (best, largest) = (i, size);
                }
            }
            if best == NONE || !(largest > SINGULAR && largest.is_finite()) {
                return false;
            }
            if diagonal >= DIAGONAL * largest {
                best = column;
            }
            let pivot = self.x[best];
            (self.diagonal[k], self.row[k], self.pivot[best]) = (pivot, best, k);
            for &i in self.reached.iter().filter(|i| self.pivot[**i] == NONE) {
                self.lower.push(i, self.x[i] / pivot);
            }
            self.lower.begin.push(self.lower.rows.len());
            self.upper.begin.push(self.upper.rows.len());
        }
        self.lower.rows.iter_mut().for_each(|i| *i = self.pivot[*i]);
        true
    }

    /// Rows that are not zero in column `k` of the factors: what can be reached from the entries of the matrix through
    /// columns that are done; every row comes before those that are needed for it.
    fn reach(&mut self, k: usize, column: usize) {
        self.reached.clear();
        for e in self.a.range(column) {
            let start = self.a.row_idx()[e];
            if self.mark[start] == k {
                continue;
            }
            self.mark[start] = k;
            self.path.push((start, 0));
            while let Some((i, at)) = self.path.pop() {
                let own = if self.pivot[i] == NONE { 0..0 } else { self.lower.range(self.pivot[i]) };
                let next = self.lower.rows[own.clone()][at..].iter().position(|r| self.mark[*r] != k);
                match next {
                    Some(step) => {
                        let r = self.lower.rows[own.start + at + step];
                        self.mark[r] = k;
                        self.path.push((i, at + step + 1));
                        self.path.push((r, 0));
                    }
                    None => self.reached.push(i),
                }
            }
        }
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&mut self, b: &mut [T]) {
        let (n, x) = (self.order.len(), &mut self.x);
        x.iter_mut().zip(&self.row).for_each(|(x, &i)| *x = b[i]);
        for k in 0..n {
            let (own, v) = (self.lower.range(k), x[k]);
            for (&i, l) in self.lower.rows[own.clone()].iter().zip(&self.lower.values[own]) {
                x[i] = x[i] - *l * v;
            }
        }
        for k in (0..n).rev() {
            let v = x[k] / self.diagonal[k];
            b[self.order[k]] = v;
            let own = self.upper.range(k);
            for (&j, u) in self.upper.rows[own.clone()].iter().zip(&self.upper.values[own]) {
                x[j] = x[j] - *u * v;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lu::Lu;
    use super::*;
    use nalgebra::Complex;

    /// Entries of a matrix with a constraint at its end, whose diagonal is zero: bands, some far away.
    fn matrix(n: usize, seed: f64) -> Vec<(usize, usize, f64)> {
        let mut all = Vec::new();
        let value =
            |i: usize, j: usize| ((1.7 * i as f64 + 0.9 * j as f64 + seed).sin() + 0.3) * 10f64.powi(i as i32 % 5 - 2);
        for i in 0..n - 1 {
            for j in [i.wrapping_sub(1), i, i + 1, (7 * i + 3) % (n - 1)] {
                if j < n - 1 && !all.iter().any(|e: &(usize, usize, f64)| (e.0, e.1) == (i, j)) {
                    all.push((i, j, value(i, j)));
                }
            }
        }
        for j in [0, 4, n / 2] {
            all.push((n - 1, j, value(n, j)));
            all.push((j, n - 1, value(j, n)));
        }
        all
    }

    #[test]
    fn solutions_are_those_of_the_dense_factors_with_new_and_with_old_pivots() {
        for n in [12, 40] {
            let (rows, cols): (Vec<usize>, Vec<usize>) = matrix(n, 0.0).iter().map(|e| (e.0, e.1)).unzip();
            let (pattern, map) = Pattern::from_triplets(n, n, &rows, &cols);
            let mut sparse = SparseLu::<f64>::new(pattern.clone()).unwrap();
            let mut complex = SparseLu::<Complex<f64>>::new(pattern).unwrap();
            // small changes keep the pivots, large ones do not
            for seed in [0.0, 1e-3, 2e-3, 2.0, 4.5] {
                let mut dense = Lu::with_capacity(n);
                let a = dense.clear(n);
                let all = matrix(n, seed);
                for (k, &(i, j, v)) in all.iter().enumerate() {
                    if k == 0 {
                        sparse.clear();
                        complex.clear();
                    }
                    a[i * n + j] += v;
                    sparse.values[map[k]] += v;
                    complex.values[map[k]] += Complex::new(v, 0.5 * v);
                }
                let b: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
                let (mut x, mut y) = (b.clone(), b.clone());
                let mut z: Vec<Complex<f64>> = b.iter().map(|v| Complex::new(*v, 0.0)).collect();
                assert!(dense.factorise() && sparse.factorise_sized(|_| 1.0) && complex.factorise_sized(|_| 1.0));
                dense.solve(&mut x);
                sparse.solve(&mut y);
                complex.solve(&mut z);
                let size = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                for i in 0..n {
                    assert!((x[i] - y[i]).abs() < 1e-9 * size, "{n} {seed} {i}: {} {}", x[i], y[i]);
                    let w = z[i] * Complex::new(1.0, 0.5);
                    assert!((x[i] - w.re).abs() + w.im.abs() < 1e-9 * size, "{n} {seed} {i}: {} {w}", x[i]);
                }
            }
        }
    }

    #[test]
    fn bands_have_little_fill_and_singular_matrices_are_said() {
        let n = 100;
        let band = |i: usize| (i.saturating_sub(1)..(i + 2).min(n)).map(move |j| (i, j));
        let (rows, cols): (Vec<usize>, Vec<usize>) = (0..n).flat_map(band).unzip();
        let (pattern, map) = Pattern::from_triplets(n, n, &rows, &cols);
        let mut lu = SparseLu::<f64>::new(pattern).unwrap();
        let a = lu.clear();
        map.iter().zip(rows.iter().zip(&cols)).for_each(|(k, (i, j))| a[*k] = if i == j { -2.0 } else { 1.0 });
        assert!(lu.factorise_sized(|_| 1.0));
        let fill = lu.lower.rows.len() + lu.upper.rows.len();
        assert!(fill <= 2 * map.len(), "{fill}");
        lu.clear().fill(1.0);
        lu.clear();
        assert!(!lu.factorise_sized(|_| 1.0));
        let a = lu.clear();
        map.iter()
            .zip(rows.iter().zip(&cols))
            .for_each(|(k, (i, j))| a[*k] = if i + j > 1 && *i < 2 { 0.0 } else { 1.0 });
        assert!(!lu.factorise_sized(|_| 1.0));
    }
}
