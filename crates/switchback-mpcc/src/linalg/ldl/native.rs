//! The up-looking LDL' without pivoting of T. Davis ("Algorithm 849: a concise sparse Cholesky factorization package",
//! ACM TOMS 31, 2005) in Rust, and the AMD ordering of a crate: the same operations in the same order as those of
//! SuiteSparse, for where that is not linked.
//!
//! The structure of L is found once, by rows and by columns. The numeric factorisation computes row after row: row `k` solves
//! a triangular system with the rows before it, whose entries are the columns that `row_idx` lists, in an order in which every
//! one comes after those it depends on.

use super::ordering::{Ordering, Permuted};
use super::{check_upper, judge, take_over, Factorisation, LdlStats, SymmetricSolver};
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;
use crate::memory;

/// No parent in the elimination tree, no row that was here before.
const NONE: u32 = u32::MAX;

/// LDL' of this library, with approximate minimum degree unless another order is asked for; see the module documentation.
#[derive(Default)]
pub struct Native {
    ordering: Ordering,
    n: usize,
    nnz_a: usize,
    flops: f64,
    analysed: bool,
    factored: bool,
    min_abs: f64,
    max_abs: f64,
    /// `perm[k]` is the row of A that is the `k`-th pivot.
    perm: Vec<usize>,
    /// Position `k` of `P A P'` takes the value `src[k]` of A.
    src: Vec<u32>,
    /// Columns of the upper triangle of `P A P'`.
    a_ptr: Vec<u32>,
    a_idx: Vec<u32>,
    a_val: Vec<f64>,
    /// Rows of L without the diagonal: columns in the order of elimination.
    row_ptr: Vec<u32>,
    row_idx: Vec<u32>,
    /// Columns of L without the diagonal.
    col_ptr: Vec<u32>,
    col_idx: Vec<u32>,
    col_val: Vec<f64>,
    /// Where the next entry of every column goes.
    next: Vec<u32>,
    d: Vec<f64>,
    /// All zero between two rows.
    work: Vec<f64>,
}

impl Native {
    /// A solver without a structure; call [`SymmetricSolver::analyse`] next.
    pub fn new() -> Native {
        Native::default()
    }

    /// A solver that eliminates in this order.
    pub fn with_ordering(ordering: Ordering) -> Native {
        Native { ordering, ..Native::default() }
    }

    /// Structure of L for the columns of the upper triangle in `a_ptr`, `a_idx`.
    fn symbolic(&mut self, n: usize) -> Result<()> {
        let mut parent = vec![NONE; n];
        let mut flag = vec![NONE; n];
        let mut counts = vec![0_u32; n];
        let mut nnz_l = 0_u64;
        for k in 0..n {
            flag[k] = k as u32;
            for &i in &self.a_idx[range(&self.a_ptr, k)] {
                let mut i = i as usize;
                while flag[i] != k as u32 {
                    if parent[i] == NONE {
                        parent[i] = k as u32;
                    }
                    counts[i] += 1;
                    nnz_l += 1;
                    flag[i] = k as u32;
                    i = parent[i] as usize;
                }
            }
        }
        fits(nnz_l, "entries of L")?;
        memory::need(16 * u128::from(nnz_l), || format!("the factorisation of {n} rows with {nnz_l} entries of L"))?;
        // One division for each entry of a column, a multiplication and an addition for each pair below.
        self.flops = counts.iter().map(|&c| f64::from(c)).map(|c| c * (c + 2.0)).sum();
        let nnz_l = nnz_l as usize;
        self.col_ptr = vec![0; n + 1];
        for (k, &c) in counts.iter().enumerate() {
            self.col_ptr[k + 1] = self.col_ptr[k] + c;
        }
        self.next = vec![0; n];
        self.next.copy_from_slice(&self.col_ptr[..n]);
        self.col_idx = vec![0; nnz_l];
        self.col_val = vec![0.0; nnz_l];
        self.row_ptr = vec![0; n + 1];
        self.row_idx = vec![0; nnz_l];
        flag.fill(NONE);
        // The paths of the elimination tree that a row takes, the last one first: then descendants come before their ancestors.
        let mut pattern = vec![0_u32; n];
        for k in 0..n {
            let (mut top, row) = (n, k as u32);
            flag[k] = row;
            for &i in &self.a_idx[range(&self.a_ptr, k)] {
                let (mut i, mut len) = (i as usize, 0);
                while flag[i] != row {
                    pattern[len] = i as u32;
                    len += 1;
                    flag[i] = row;
                    i = parent[i] as usize;
                }
                pattern.copy_within(..len, top - len);
                top -= len;
            }
            let start = self.row_ptr[k] as usize;
            let end = start + n - top;
            self.row_ptr[k + 1] = end as u32;
            self.row_idx[start..end].copy_from_slice(&pattern[top..]);
            for &i in &pattern[top..] {
                let next = &mut self.next[i as usize];
                self.col_idx[*next as usize] = row;
                *next += 1;
            }
        }
        Ok(())
    }

    /// The row whose pivot is zero, if there is one.
    fn numeric(&mut self) -> Option<usize> {
        let Native { a_ptr, a_idx, a_val, row_ptr, row_idx, col_ptr, col_idx, col_val, next, d, work, .. } = self;
        let n = d.len();
        let y = &mut work[..n];
        next.copy_from_slice(&col_ptr[..n]);
        for k in 0..n {
            for p in range(a_ptr, k) {
                y[a_idx[p] as usize] += a_val[p];
            }
            let mut dk = y[k];
            y[k] = 0.0;
            for &i in &row_idx[range(row_ptr, k)] {
                let i = i as usize;
                let yi = y[i];
                y[i] = 0.0;
                let (start, end) = (col_ptr[i] as usize, next[i] as usize);
                for (&row, &l) in col_idx[start..end].iter().zip(&col_val[start..end]) {
                    y[row as usize] -= l * yi;
                }
                let l = yi / d[i];
                dk -= l * yi;
                col_val[end] = l;
                next[i] = end as u32 + 1;
            }
            d[k] = dk;
            if dk == 0.0 {
                return Some(k);
            }
        }
        None
    }
}

/// Positions of column or row `k`.
#[inline]
fn range(ptr: &[u32], k: usize) -> std::ops::Range<usize> {
    ptr[k] as usize..ptr[k + 1] as usize
}

fn fits(v: u64, what: &str) -> Result<()> {
    if v < u64::from(NONE) {
        return Ok(());
    }
    Err(Error::Unsupported(format!(
        "native: {v} {what} do not fit the 32-bit index of LDL; split the problem or use a shorter horizon"
    )))
}

/// Approximate minimum degree order of the symmetric matrix with this upper triangle: `order[k]` is the `k`-th pivot. Where
/// SuiteSparse is linked its own takes the place of this one.
#[cfg(any(test, not(feature = "suitesparse")))]
pub(super) fn amd(upper: &Pattern) -> Result<Vec<usize>> {
    let n = upper.n_cols();
    if n == 0 {
        return Ok(Vec::new());
    }
    fits(2 * upper.nnz() as u64 + n as u64, "entries")?;
    // The crate counts on every diagonal entry, which does not change the order.
    let mut ptr = Vec::with_capacity(n + 1);
    let mut idx = Vec::with_capacity(upper.nnz() + n);
    ptr.push(0_u32);
    for j in 0..n {
        let rows = upper.rows(j);
        idx.extend(rows.iter().map(|&i| i as u32));
        if rows.last() != Some(&j) {
            idx.push(j as u32);
        }
        ptr.push(idx.len() as u32);
    }
    // Inside it has A + A' and a fifth more in words, a copy of the input, and a dozen arrays of length n.
    let words = 24 * upper.nnz() as u128 / 10 + 16 * n as u128;
    memory::need(8 * words + 4 * idx.len() as u128, || format!("the order of elimination of {n} rows"))?;
    let (order, _, _) = ::amd::order(n as u32, &ptr, &idx, &::amd::Control::default())
        .map_err(|status| Error::Library(format!("native: amd returned {status:?} for {n} rows")))?;
    Ok(order.iter().map(|&v| v as usize).collect())
}

impl SymmetricSolver for Native {
    fn name(&self) -> &'static str {
        "native"
    }

    fn analyse(&mut self, upper: &Pattern) -> Result<()> {
        check_upper(upper)?;
        *self = Native::with_ordering(std::mem::take(&mut self.ordering));
        let (n, nnz) = (upper.n_cols(), upper.nnz());
        fits(n as u64, "rows")?;
        fits(nnz as u64, "entries")?;
        let Permuted { order, upper: p, src } = Permuted::new(upper, self.ordering.order(upper)?);
        (self.perm, self.src) = (order, src);
        self.a_ptr = p.col_ptr().iter().map(|&v| v as u32).collect();
        self.a_idx = p.row_idx().iter().map(|&v| v as u32).collect();
        self.a_val = vec![0.0; nnz];
        self.symbolic(n)?;
        self.d = vec![0.0; n];
        self.work = vec![0.0; n];
        (self.n, self.nnz_a) = (n, nnz);
        self.analysed = true;
        Ok(())
    }

    fn factor(&mut self, values: &[f64]) -> Factorisation {
        assert!(self.analysed, "native: factor before analyse");
        assert_eq!(values.len(), self.nnz_a, "native: one value per entry of the analysed pattern");
        self.factored = false;
        (self.min_abs, self.max_abs) = (0.0, 0.0);
        if let Some(bad) = take_over(values, &self.src, &mut self.a_val) {
            let col = self.a_ptr.partition_point(|&p| p as usize <= bad) - 1;
            return Factorisation::Singular { pivot: self.perm[col] };
        }
        // what an overflow of the last factorisation may have left
        self.work.fill(0.0);
        if let Some(k) = self.numeric() {
            return Factorisation::Singular { pivot: self.perm[k] };
        }
        let (inertia, range) = match judge(&self.d) {
            Ok(found) => found,
            Err(k) => return Factorisation::Singular { pivot: self.perm[k] },
        };
        [self.min_abs, self.max_abs] = range;
        self.factored = true;
        Factorisation::Ok(inertia)
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        assert!(self.factored, "native: solve needs a successful factorisation");
        assert_eq!(rhs.len(), self.n, "native: one right-hand side value per row");
        let Native { col_ptr, col_idx, col_val, d, work: x, perm, .. } = self;
        for (w, &i) in x.iter_mut().zip(perm.iter()) {
            *w = rhs[i];
        }
        let column = |k: usize| {
            let r = range(col_ptr, k);
            col_idx[r.clone()].iter().zip(&col_val[r])
        };
        for k in 0..x.len() {
            let xk = x[k];
            for (&row, &l) in column(k) {
                x[row as usize] -= l * xk;
            }
        }
        for (w, &d) in x.iter_mut().zip(d.iter()) {
            *w /= d;
        }
        for k in (0..x.len()).rev() {
            let mut xk = x[k];
            for (&row, &l) in column(k) {
                xk -= l * x[row as usize];
            }
            x[k] = xk;
        }
        for (&w, &i) in x.iter().zip(perm.iter()) {
            rhs[i] = w;
        }
    }

    fn stats(&self) -> LdlStats {
        LdlStats {
            name: self.name(),
            n: self.n,
            nnz_a: self.nnz_a,
            nnz_l: self.col_idx.len(),
            flops: self.flops,
            min_abs_pivot: self.min_abs,
            max_abs_pivot: self.max_abs,
        }
    }

    fn pivots(&self) -> (&[f64], &[usize]) {
        if self.factored {
            (&self.d, &self.perm)
        } else {
            (&[], &[])
        }
    }
}
