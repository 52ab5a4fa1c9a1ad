//! Compressed sparse columns: a validated pattern, and products that allocate nothing.
//!
//! A [`Pattern`] holds the structure alone. The values are a plain slice beside it, one per position,
//! so that one pattern serves many value vectors. Rows are strictly increasing within a column, hence
//! positions are unique and a lookup is a binary search.

use crate::error::{Error, Result};
use crate::memory;
use std::ops::Range;
use std::sync::OnceLock;

/// Structure of a sparse `n_rows x n_cols` matrix in compressed columns.
///
/// Column `j` owns the positions `range(j)`; `row_idx()[k]` is the row of position `k`. The
/// invariants (checked once, in [`Pattern::new`]): `col_ptr` has `n_cols + 1` entries, starts at 0, never
/// decreases and ends at `nnz`; rows are below `n_rows` and strictly increasing within a column.
#[derive(Debug, Clone)]
pub struct Pattern {
    n_rows: usize,
    n_cols: usize,
    columns: Columns,
    row_idx: Vec<usize>,
}

/// Where the columns begin.
#[derive(Debug, Clone)]
enum Columns {
    /// All of them, and the end of the last one.
    All(Vec<usize>),
    /// Those that are not empty, ascending, where they begin and the last one ends, and all where somebody has asked for them: what has few
    /// entries takes no memory for every column.
    Few { of: Vec<usize>, begin: Vec<usize>, all: OnceLock<Vec<usize>> },
}

/// So many columns for an entry are many.
const MANY_COLUMNS: usize = 8;

impl PartialEq for Pattern {
    fn eq(&self, other: &Pattern) -> bool {
        let same = (self.n_rows, self.n_cols, &self.row_idx) == (other.n_rows, other.n_cols, &other.row_idx);
        same && self.columns().eq(other.columns())
    }
}

impl Eq for Pattern {}

impl Pattern {
    /// Checks and takes a structure: `col_ptr` of length `n_cols + 1`, `row_idx` of length
    /// `col_ptr[n_cols]`.
    ///
    /// # Errors
    /// [`Error::Dimension`] for a wrong length; [`Error::Range`] for a column pointer that does not start
    /// at 0 or decreases, for a row outside the matrix, and for rows that are not strictly increasing
    /// within their column.
    pub fn new(n_rows: usize, n_cols: usize, col_ptr: Vec<usize>, row_idx: Vec<usize>) -> Result<Pattern> {
        if col_ptr.len().checked_sub(1) != Some(n_cols) {
            return Err(Error::Dimension(format!(
                "sparse pattern {n_rows}x{n_cols}: col_ptr has {} entries; pass one per column and a last one, the \
                 number of entries",
                col_ptr.len()
            )));
        }
        if col_ptr[0] != 0 {
            return Err(Error::Range(format!(
                "sparse pattern {n_rows}x{n_cols}: col_ptr[0] is {}; column pointers count from 0",
                col_ptr[0]
            )));
        }
        for j in 0..n_cols {
            if col_ptr[j + 1] < col_ptr[j] {
                return Err(Error::Range(format!(
                    "sparse pattern {n_rows}x{n_cols}: column {j} ends at {} before its start {}; col_ptr must not \
                     decrease",
                    col_ptr[j + 1],
                    col_ptr[j]
                )));
            }
        }
        if col_ptr[n_cols] != row_idx.len() {
            return Err(Error::Dimension(format!(
                "sparse pattern {n_rows}x{n_cols}: col_ptr ends at {} but there are {} row indices; the two must agree",
                col_ptr[n_cols],
                row_idx.len()
            )));
        }
        for j in 0..n_cols {
            let rows = &row_idx[col_ptr[j]..col_ptr[j + 1]];
            for (k, &i) in rows.iter().enumerate() {
                if i >= n_rows {
                    return Err(Error::Range(format!(
                        "sparse pattern {n_rows}x{n_cols}: column {j} has row {i}; rows count from 0 and stay below \
                         {n_rows}"
                    )));
                }
                if k > 0 && rows[k - 1] >= i {
                    return Err(Error::Range(format!(
                        "sparse pattern {n_rows}x{n_cols}: column {j} has row {i} after row {}; sort the rows of every \
                         column and merge duplicates",
                        rows[k - 1]
                    )));
                }
            }
        }
        Ok(Pattern { n_rows, n_cols, columns: Columns::All(col_ptr), row_idx })
    }

    /// The `m x n` pattern without entries.
    pub fn empty(m: usize, n: usize) -> Pattern {
        Pattern::from_triplets(m, n, &[], &[]).0
    }

    /// The full `m x n` pattern, column-major.
    pub fn dense(m: usize, n: usize) -> Pattern {
        let mut row_idx = memory::with_capacity(m.saturating_mul(n));
        for _ in 0..n {
            row_idx.extend(0..m);
        }
        Pattern { n_rows: m, n_cols: n, columns: Columns::All((0..=n).map(|j| j * m).collect()), row_idx }
    }

    /// The full upper triangle with diagonal of an `n x n` matrix.
    pub fn dense_upper(n: usize) -> Pattern {
        let mut row_idx = memory::with_capacity((n + 1).saturating_mul(n) / 2);
        for j in 0..n {
            row_idx.extend(0..=j);
        }
        let all = (0..=n).map(|j| j * (j + 1) / 2).collect();
        Pattern { n_rows: n, n_cols: n, columns: Columns::All(all), row_idx }
    }

    /// The pattern of a list of triplets, and the value map: triplet `k` belongs to position `map[k]`.
    ///
    /// Duplicates share a position, so values are summed by `for k { v[map[k]] += t[k] }`. `rows` and
    /// `cols` have the same length.
    ///
    /// # Panics
    /// If the lengths differ or an index is outside the matrix (the caller builds the triplets; data from
    /// outside goes through [`Pattern::new`]).
    pub fn from_triplets(n_rows: usize, n_cols: usize, rows: &[usize], cols: &[usize]) -> (Pattern, Vec<usize>) {
        assert_eq!(rows.len(), cols.len(), "triplets need one row and one column each");
        let nt = rows.len();
        if MANY_COLUMNS * (nt + 1) < n_cols {
            return Pattern::from_few(n_rows, n_cols, rows, cols);
        }
        // Two stable counting sorts, by row and then by column.
        let mut count = vec![0usize; n_rows + 1];
        for &i in rows {
            assert!(i < n_rows, "triplet row {i} is outside 0..{n_rows}");
            count[i + 1] += 1;
        }
        for i in 0..n_rows {
            count[i + 1] += count[i];
        }
        let mut by_row = vec![0usize; nt];
        for (k, &i) in rows.iter().enumerate() {
            by_row[count[i]] = k;
            count[i] += 1;
        }
        let mut start = vec![0usize; n_cols + 1];
        for &j in cols {
            assert!(j < n_cols, "triplet column {j} is outside 0..{n_cols}");
            start[j + 1] += 1;
        }
        for j in 0..n_cols {
            start[j + 1] += start[j];
        }
        let mut next = start.clone();
        let mut order = vec![0usize; nt];
        for &k in &by_row {
            let j = cols[k];
            order[next[j]] = k;
            next[j] += 1;
        }
        let mut map = vec![0usize; nt];
        let mut col_ptr = memory::with_capacity(n_cols + 1);
        let mut row_idx: Vec<usize> = memory::with_capacity(nt);
        col_ptr.push(0);
        for j in 0..n_cols {
            let first = row_idx.len();
            for &k in &order[start[j]..start[j + 1]] {
                if row_idx.len() == first || row_idx[row_idx.len() - 1] != rows[k] {
                    row_idx.push(rows[k]);
                }
                map[k] = row_idx.len() - 1;
            }
            col_ptr.push(row_idx.len());
        }
        (Pattern { n_rows, n_cols, columns: Columns::All(col_ptr), row_idx }, map)
    }

    /// The same where there are many more columns than entries.
    fn from_few(n_rows: usize, n_cols: usize, rows: &[usize], cols: &[usize]) -> (Pattern, Vec<usize>) {
        let mut order: Vec<usize> = (0..rows.len()).collect();
        order.sort_by_key(|&k| (cols[k], rows[k]));
        let (mut of, mut begin, mut row_idx): (Vec<usize>, Vec<usize>, Vec<usize>) = Default::default();
        let mut map = vec![0usize; rows.len()];
        for k in order {
            let (i, j) = (rows[k], cols[k]);
            assert!(i < n_rows && j < n_cols, "triplet ({i}, {j}) is outside of {n_rows} x {n_cols}");
            let known = of.last() == Some(&j);
            if !known {
                of.push(j);
                begin.push(row_idx.len());
            }
            if !known || row_idx.last() != Some(&i) {
                row_idx.push(i);
            }
            map[k] = row_idx.len() - 1;
        }
        begin.push(row_idx.len());
        (Pattern { n_rows, n_cols, columns: Columns::Few { of, begin, all: OnceLock::new() }, row_idx }, map)
    }

    /// The columns that are not empty, with their positions, ascending.
    pub fn columns(&self) -> impl Iterator<Item = (usize, Range<usize>)> + '_ {
        let (few, all) = match &self.columns {
            Columns::All(all) => (&[][..], &all[..]),
            Columns::Few { of, begin, .. } => (&of[..], &begin[..]),
        };
        let by_place = !matches!(self.columns, Columns::All(_));
        let each = all.windows(2).enumerate().filter(|(_, w)| w[0] < w[1]);
        each.map(move |(k, w)| (if by_place { few[k] } else { k }, w[0]..w[1]))
    }

    /// Number of rows.
    #[inline]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Number of columns.
    #[inline]
    pub fn n_cols(&self) -> usize {
        self.n_cols
    }

    /// Number of positions (stored entries).
    #[inline]
    pub fn nnz(&self) -> usize {
        self.row_idx.len()
    }

    /// Column pointers, `n_cols + 1` of them.
    #[inline]
    pub fn col_ptr(&self) -> &[usize] {
        match &self.columns {
            Columns::All(all) => all,
            Columns::Few { all, .. } => all.get_or_init(|| {
                let mut all = vec![0; self.n_cols + 1];
                self.columns().for_each(|(j, own)| all[j + 1] = own.len());
                (0..self.n_cols).for_each(|j| all[j + 1] += all[j]);
                all
            }),
        }
    }

    /// Row of every position, `nnz` of them.
    #[inline]
    pub fn row_idx(&self) -> &[usize] {
        &self.row_idx
    }

    /// Rows of column `j`, increasing. Panics for `j >= n_cols`.
    #[inline]
    pub fn rows(&self, j: usize) -> &[usize] {
        &self.row_idx[self.range(j)]
    }

    /// Positions of column `j`. Panics for `j >= n_cols`.
    #[inline]
    pub fn range(&self, j: usize) -> Range<usize> {
        match &self.columns {
            Columns::All(all) => all[j]..all[j + 1],
            Columns::Few { .. } => self.range_of_few(j),
        }
    }

    fn range_of_few(&self, j: usize) -> Range<usize> {
        assert!(j < self.n_cols, "column {j} of {}", self.n_cols);
        let Columns::Few { of, begin, .. } = &self.columns else { return 0..0 };
        match of.binary_search(&j) {
            Ok(k) => begin[k]..begin[k + 1],
            Err(k) => begin[k]..begin[k],
        }
    }

    /// True where the matrix is square with every entry on or above the diagonal.
    #[inline]
    pub fn is_upper(&self) -> bool {
        self.n_rows == self.n_cols && (0..self.n_cols).all(|j| self.rows(j).last().is_none_or(|&i| i <= j))
    }

    /// Position of entry `(row, col)`, or `None` if it is not stored or outside the matrix.
    #[inline]
    pub fn get(&self, row: usize, col: usize) -> Option<usize> {
        if col >= self.n_cols {
            return None;
        }
        let own = self.range(col);
        self.row_idx[own.clone()].binary_search(&row).ok().map(|k| own.start + k)
    }

    /// The transposed pattern, and the map: position `k` here is position `map[k]` there.
    pub fn transpose(&self) -> (Pattern, Vec<usize>) {
        let mut col_ptr = vec![0usize; self.n_rows + 1];
        for &i in &self.row_idx {
            col_ptr[i + 1] += 1;
        }
        for i in 0..self.n_rows {
            col_ptr[i + 1] += col_ptr[i];
        }
        let mut next = col_ptr.clone();
        let mut row_idx = vec![0usize; self.nnz()];
        let mut map = vec![0usize; self.nnz()];
        for j in 0..self.n_cols {
            for k in self.range(j) {
                let i = self.row_idx[k];
                row_idx[next[i]] = j;
                map[k] = next[i];
                next[i] += 1;
            }
        }
        (Pattern { n_rows: self.n_cols, n_cols: self.n_rows, columns: Columns::All(col_ptr), row_idx }, map)
    }
}

/// `y += alpha * A * x`, with `A` of pattern `p` and values `v` (`nnz`), `x` of `n_cols`, `y` of `n_rows`.
///
/// Allocates nothing. Panics if a length is wrong.
#[inline]
pub fn mul_add(p: &Pattern, v: &[f64], x: &[f64], y: &mut [f64], alpha: f64) {
    assert_eq!((v.len(), x.len(), y.len()), (p.nnz(), p.n_cols, p.n_rows), "mul_add: lengths of v, x, y");
    for (j, own) in p.columns() {
        let ax = alpha * x[j];
        let (rows, vals) = (&p.row_idx[own.clone()], &v[own]);
        for (&i, &a) in rows.iter().zip(vals) {
            y[i] += a * ax;
        }
    }
}

/// `y += alpha * A' * x`, with `A` of pattern `p` and values `v` (`nnz`), `x` of `n_rows`, `y` of `n_cols`.
///
/// Allocates nothing. Panics if a length is wrong.
#[inline]
pub fn mul_add_transposed(p: &Pattern, v: &[f64], x: &[f64], y: &mut [f64], alpha: f64) {
    assert_eq!((v.len(), x.len(), y.len()), (p.nnz(), p.n_rows, p.n_cols), "mul_add_transposed: lengths of v, x, y");
    for (j, own) in p.columns() {
        let (rows, vals) = (&p.row_idx[own.clone()], &v[own]);
        let mut s = 0.0;
        for (&i, &a) in rows.iter().zip(vals) {
            s += a * x[i];
        }
        y[j] += alpha * s;
    }
}

/// `y += alpha * A * x` for a symmetric `A` of which pattern and values hold the upper triangle.
///
/// `v` has `nnz` entries, `x` and `y` have `n`. Entries below the diagonal must not be stored (see
/// [`Pattern::is_upper`]): they would count twice. Allocates nothing. Panics if a length is wrong.
#[inline]
pub fn mul_add_symmetric_upper(p: &Pattern, v: &[f64], x: &[f64], y: &mut [f64], alpha: f64) {
    assert_eq!(p.n_rows, p.n_cols, "mul_add_symmetric_upper: a symmetric matrix is square");
    assert_eq!(
        (v.len(), x.len(), y.len()),
        (p.nnz(), p.n_cols, p.n_rows),
        "mul_add_symmetric_upper: lengths of v, x, y"
    );
    for (j, own) in p.columns() {
        let (mut rows, mut vals) = (&p.row_idx[own.clone()], &v[own]);
        let ax = alpha * x[j];
        let mut s = 0.0;
        // The diagonal, if stored, is the last entry of its column.
        if let (Some((&i, r)), Some((&a, t))) = (rows.split_last(), vals.split_last()) {
            if i == j {
                s = a * x[j];
                (rows, vals) = (r, t);
            }
        }
        for (&i, &a) in rows.iter().zip(vals) {
            y[i] += a * ax;
            s += a * x[i];
        }
        y[j] += alpha * s;
    }
}

#[cfg(test)]
#[allow(clippy::needless_range_loop)]
mod tests {
    use super::*;

    fn dense_of(p: &Pattern, v: &[f64]) -> Vec<Vec<f64>> {
        let mut a = vec![vec![0.0; p.n_cols()]; p.n_rows()];
        for j in 0..p.n_cols() {
            for k in p.range(j) {
                a[p.row_idx()[k]][j] += v[k];
            }
        }
        a
    }

    fn sample() -> (Pattern, Vec<f64>) {
        let p = Pattern::new(3, 4, vec![0, 2, 2, 5, 6], vec![0, 2, 0, 1, 2, 1]).unwrap();
        (p, vec![1.0, -2.0, 3.0, 0.5, 4.0, -7.0])
    }

    #[test]
    fn new_refuses_and_names_the_column() {
        let range = |r: Result<Pattern>| match r {
            Err(Error::Range(s)) => s,
            other => panic!("{other:?}"),
        };
        let dim = |r: Result<Pattern>| match r {
            Err(Error::Dimension(s)) => s,
            other => panic!("{other:?}"),
        };
        assert!(dim(Pattern::new(2, 2, vec![0, 1], vec![0])).contains("col_ptr has 2"));
        assert!(dim(Pattern::new(2, 2, vec![], vec![])).contains("col_ptr has 0"));
        assert!(dim(Pattern::new(2, 2, vec![0, 1, 3], vec![0, 1])).contains("ends at 3"));
        assert!(range(Pattern::new(2, 1, vec![1, 1], vec![0])).contains("col_ptr[0]"));
        assert!(range(Pattern::new(2, 2, vec![0, 2, 1], vec![0])).contains("column 1"));
        assert!(range(Pattern::new(2, 2, vec![0, 1, 2], vec![0, 2])).contains("column 1 has row 2"));
        assert!(range(Pattern::new(3, 1, vec![0, 2], vec![1, 0])).contains("column 0 has row 0 after row 1"));
        assert!(range(Pattern::new(3, 1, vec![0, 2], vec![1, 1])).contains("merge duplicates"));
        assert!(Pattern::new(0, 0, vec![0], vec![]).is_ok());
        // A pointer beyond the row indices with a decrease after it must not panic.
        assert!(range(Pattern::new(2, 2, vec![0, 9, 1], vec![0])).contains("column 1"));
        // No overflow on the largest size.
        assert!(dim(Pattern::new(1, usize::MAX, vec![0], vec![])).contains("col_ptr"));
    }

    #[test]
    fn constructors() {
        assert_eq!(Pattern::dense(2, 3), Pattern::new(2, 3, vec![0, 2, 4, 6], vec![0, 1, 0, 1, 0, 1]).unwrap());
        assert_eq!(Pattern::dense_upper(3), Pattern::new(3, 3, vec![0, 1, 3, 6], vec![0, 0, 1, 0, 1, 2]).unwrap());
        assert_eq!(Pattern::empty(4, 2).nnz(), 0);
        assert!(Pattern::dense_upper(4).is_upper() && Pattern::empty(3, 3).is_upper());
        assert!(!Pattern::dense(2, 2).is_upper() && !Pattern::empty(2, 3).is_upper());
    }

    #[test]
    fn lookup() {
        let (p, _) = sample();
        assert_eq!(p.get(2, 0), Some(1));
        assert_eq!(p.get(1, 2), Some(3));
        assert_eq!(p.get(1, 0), None);
        assert_eq!(p.get(0, 9), None);
        assert_eq!(p.get(9, 0), None);
        assert_eq!(p.rows(2), &[0, 1, 2]);
        assert_eq!(p.range(1), 2..2);
    }

    #[test]
    fn triplets_merge_and_map() {
        let rows = [2, 0, 2, 1, 0, 2];
        let cols = [1, 0, 1, 3, 1, 0];
        let t = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let (p, map) = Pattern::from_triplets(3, 4, &rows, &cols);
        assert_eq!(p, Pattern::new(3, 4, vec![0, 2, 4, 4, 5], vec![0, 2, 0, 2, 1]).unwrap());
        let mut v = vec![0.0; p.nnz()];
        for k in 0..t.len() {
            assert_eq!(p.get(rows[k], cols[k]), Some(map[k]));
            v[map[k]] += t[k];
        }
        assert_eq!(v, [2.0, 6.0, 5.0, 4.0, 4.0]);
        let (e, m) = Pattern::from_triplets(2, 2, &[], &[]);
        assert_eq!((e, m.len()), (Pattern::empty(2, 2), 0));
    }

    #[test]
    fn transposition() {
        let (p, v) = sample();
        let (t, map) = p.transpose();
        let mut tv = vec![0.0; t.nnz()];
        for k in 0..p.nnz() {
            tv[map[k]] = v[k];
        }
        let (a, b) = (dense_of(&p, &v), dense_of(&t, &tv));
        for i in 0..3 {
            for j in 0..4 {
                assert_eq!(a[i][j], b[j][i]);
            }
        }
        assert_eq!(Pattern::new(4, 3, t.col_ptr().to_vec(), t.row_idx().to_vec()).unwrap(), t);
        assert_eq!(t.transpose().0, p);
    }

    #[test]
    fn products() {
        let (p, v) = sample();
        let a = dense_of(&p, &v);
        let x = [1.0, 2.0, -3.0, 0.25];
        let mut y = [1.0, 1.0, 1.0];
        mul_add(&p, &v, &x, &mut y, -2.0);
        for i in 0..3 {
            let s: f64 = (0..4).map(|j| a[i][j] * x[j]).sum();
            assert_eq!(y[i], 1.0 - 2.0 * s);
        }
        let z = [3.0, -1.0, 0.5];
        let mut w = [0.0; 4];
        mul_add_transposed(&p, &v, &z, &mut w, 4.0);
        for j in 0..4 {
            let s: f64 = (0..3).map(|i| a[i][j] * z[i]).sum();
            assert_eq!(w[j], 4.0 * s);
        }
        // Upper triangle with a column that has no diagonal entry.
        let u = Pattern::new(3, 3, vec![0, 1, 2, 5], vec![0, 0, 0, 1, 2]).unwrap();
        let uv = [2.0, -1.0, 3.0, 5.0, 7.0];
        let full = [[2.0, -1.0, 3.0], [-1.0, 0.0, 5.0], [3.0, 5.0, 7.0]];
        let mut s = [0.0; 3];
        mul_add_symmetric_upper(&u, &uv, &z, &mut s, 0.5);
        for i in 0..3 {
            let e: f64 = (0..3).map(|j| full[i][j] * z[j]).sum();
            assert_eq!(s[i], 0.5 * e);
        }
    }
}
