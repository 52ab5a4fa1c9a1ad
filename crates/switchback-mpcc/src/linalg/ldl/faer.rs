//! faer: supernodal LDL' (blocks of columns with one structure are dense, and updated by matrix products), its
//! simplicial form (column by column), and the supernodal LBL' that pivots inside a block.
//!
//! The matrix is permuted here, so faer sees no permutation. The triangular solves of the LDL' forms are here too:
//! for a single right-hand side plain loops over the columns of a block beat general routines. No threads.

use super::ordering::{Ordering, Permuted};
use super::{check_upper, judge, take_over, Factorisation, Inertia, LdlStats, SymmetricSolver};
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::{LdltError, LdltRegularization};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::simplicial::{self, SymbolicSimplicialCholesky};
use faer::sparse::linalg::cholesky::supernodal::{self, SupernodalIntranodeLbltRef, SymbolicSupernodalCholesky};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par};
use std::ops::Range;

/// Form of the factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Column by column: little overhead, for sparse factors.
    Simplicial,
    /// Dense blocks of columns: for factors with much fill.
    #[default]
    Supernodal,
    /// Dense blocks of columns with symmetric pivoting inside each of them (pivots of order 1 and 2): bears small
    /// pivots that the others grow on, at a higher price.
    Pivoted,
}

/// Structure of the factors.
enum Symbolic {
    Simplicial(SymbolicSimplicialCholesky<u32>),
    Supernodal(SymbolicSupernodalCholesky<u32>),
}

/// The structure faer was given, and all memory of the factorisation.
struct Plan {
    symbolic: Symbolic,
    /// Upper triangle of `P A P'` for simplicial, lower triangle for supernodal factors.
    a: SymbolicSparseColMat<u32>,
    /// Position `k` of `a` takes the value `src[k]` of A.
    src: Vec<u32>,
    values: Vec<f64>,
    l: Vec<f64>,
    memory: MemBuffer,
}

/// Solver on faer; see the module documentation.
pub struct Faer {
    form: Form,
    ordering: Ordering,
    n: usize,
    nnz_a: usize,
    nnz_l: usize,
    flops: f64,
    min_abs: f64,
    max_abs: f64,
    factored: bool,
    /// `None` before the analysis and for an empty matrix.
    plan: Option<Plan>,
    analysed: bool,
    /// Row of A of every pivot, before pivoting inside blocks.
    order: Vec<usize>,
    /// Row of A of every pivot, after it.
    pivot_order: Vec<usize>,
    d: Vec<f64>,
    /// Pivoted form: off-diagonal entries of the blocks of D (zero where there is none), permutation and inverse.
    subdiag: Vec<f64>,
    forward: Vec<u32>,
    inverse: Vec<u32>,
    work: Vec<f64>,
    /// Rows below a block, in the triangular solves.
    below: Vec<f64>,
}

impl Default for Faer {
    fn default() -> Faer {
        Faer::new(Form::default(), Ordering::default())
    }
}

impl Faer {
    /// A solver without a structure; call [`SymmetricSolver::analyse`] next.
    pub fn new(form: Form, ordering: Ordering) -> Faer {
        Faer {
            form,
            ordering,
            n: 0,
            nnz_a: 0,
            nnz_l: 0,
            flops: 0.0,
            min_abs: 0.0,
            max_abs: 0.0,
            factored: false,
            plan: None,
            analysed: false,
            order: Vec::new(),
            pivot_order: Vec::new(),
            d: Vec::new(),
            subdiag: Vec::new(),
            forward: Vec::new(),
            inverse: Vec::new(),
            work: Vec::new(),
            below: Vec::new(),
        }
    }
}

impl Faer {
    /// Factors a unit matrix of the structure `upper`: the matrix products below keep memory for every thread, which they take when
    /// they are first called on it. A solver that moves to another thread takes it there once more.
    fn rehearse(&mut self, upper: &Pattern) {
        let mut unit = vec![0.0; self.nnz_a];
        for k in (0..self.n).filter_map(|j| upper.get(j, j)) {
            unit[k] = 1.0;
        }
        self.factor(&unit);
        self.factored = false;
        (self.min_abs, self.max_abs) = (0.0, 0.0);
    }
}

fn failed(e: FaerError, n: usize) -> Error {
    Error::Library(format!("faer: {e:?} in the analysis of a matrix with {n} rows"))
}

impl SymmetricSolver for Faer {
    fn name(&self) -> &'static str {
        match self.form {
            Form::Simplicial => "faer simplicial",
            Form::Supernodal => "faer",
            Form::Pivoted => "faer pivoted",
        }
    }

    fn analyse(&mut self, upper: &Pattern) -> Result<()> {
        check_upper(upper)?;
        *self = Faer::new(self.form, std::mem::take(&mut self.ordering));
        let (n, nnz) = (upper.n_cols(), upper.nnz());
        // faer marks with the largest values of the signed index.
        if n.max(nnz) >= i32::MAX as usize {
            return Err(Error::Unsupported(format!(
                "faer: {n} rows and {nnz} entries do not fit the 32-bit index; split the problem or use a shorter \
                 horizon"
            )));
        }
        self.analysed = true;
        if n == 0 {
            return Ok(());
        }
        let Permuted { order, upper: p, src } = Permuted::new(upper, self.ordering.order(upper)?);
        let symbolic_upper = compressed(&p);
        let mut etree = vec![0i32; n];
        let mut counts = vec![0u32; n];
        let request = simplicial::prefactorize_symbolic_cholesky_scratch::<u32>(n, nnz)
            .or(simplicial::factorize_simplicial_symbolic_cholesky_scratch::<u32>(n))
            .or(supernodal::factorize_supernodal_symbolic_cholesky_scratch::<u32>(n));
        let mut memory = MemBuffer::new(request);
        let stack = MemStack::new(&mut memory);
        let tree = simplicial::prefactorize_symbolic_cholesky(&mut etree, &mut counts, symbolic_upper.as_ref(), stack);
        self.nnz_l = counts.iter().map(|&c| c as usize - 1).sum();
        // One division for each entry of a column, a multiplication and an addition for each pair below.
        self.flops = counts.iter().map(|&c| f64::from(c - 1)).map(|c| c * (c + 2.0)).sum();
        let (symbolic, a, src) = if self.form == Form::Simplicial {
            let s = simplicial::factorize_simplicial_symbolic_cholesky(symbolic_upper.as_ref(), tree, &counts, stack);
            (Symbolic::Simplicial(s.map_err(|e| failed(e, n))?), symbolic_upper, src)
        } else {
            let s = supernodal::factorize_supernodal_symbolic_cholesky(
                symbolic_upper.as_ref(),
                tree,
                &counts,
                stack,
                Default::default(),
            );
            let (lower, map) = transposed(&p);
            let src = map.iter().map(|&k| src[k]).collect();
            (Symbolic::Supernodal(s.map_err(|e| failed(e, n))?), compressed(&lower), src)
        };
        let (len, request) = match (&symbolic, self.form) {
            (Symbolic::Simplicial(s), _) => {
                (s.len_val(), simplicial::factorize_simplicial_numeric_ldlt_scratch::<u32, f64>(n))
            }
            (Symbolic::Supernodal(s), Form::Pivoted) => (
                s.len_val(),
                supernodal::factorize_supernodal_numeric_intranode_lblt_scratch::<u32, f64>(
                    s,
                    Par::Seq,
                    Default::default(),
                )
                .or(s.solve_in_place_scratch::<f64>(1, Par::Seq)),
            ),
            (Symbolic::Supernodal(s), _) => (
                s.len_val(),
                supernodal::factorize_supernodal_numeric_ldlt_scratch::<u32, f64>(s, Par::Seq, Default::default()),
            ),
        };
        if let Symbolic::Supernodal(s) = &symbolic {
            self.below = vec![0.0; blocks(s).map(|b| b.rows.len()).max().unwrap_or(0)];
        }
        self.plan =
            Some(Plan { symbolic, a, src, values: vec![0.0; nnz], l: vec![0.0; len], memory: MemBuffer::new(request) });
        (self.n, self.nnz_a) = (n, nnz);
        self.pivot_order = order.clone();
        self.order = order;
        self.d = vec![0.0; n];
        self.work = vec![0.0; n];
        if self.form == Form::Pivoted {
            self.subdiag = vec![0.0; n];
            self.forward = vec![0; n];
            self.inverse = vec![0; n];
        }
        self.rehearse(upper);
        Ok(())
    }

    fn factor(&mut self, values: &[f64]) -> Factorisation {
        assert!(self.analysed, "{}: factor before analyse", self.name());
        assert_eq!(values.len(), self.nnz_a, "{}: one value per entry of the analysed pattern", self.name());
        self.factored = false;
        (self.min_abs, self.max_abs) = (0.0, 0.0);
        let Some(plan) = &mut self.plan else {
            self.factored = true;
            return Factorisation::Ok(Inertia::default());
        };
        if let Some(bad) = take_over(values, &plan.src, &mut plan.values) {
            let col = plan.a.col_ptr().partition_point(|&p| p as usize <= bad) - 1;
            return Factorisation::Singular { pivot: self.order[col] };
        }
        let a = SparseColMatRef::new(plan.a.as_ref(), &plan.values);
        let stack = MemStack::new(&mut plan.memory);
        let plain = LdltRegularization::default();
        let done = match (&plan.symbolic, self.form) {
            (Symbolic::Simplicial(s), _) => {
                simplicial::factorize_simplicial_numeric_ldlt(&mut plan.l, a, plain, s, stack)
                    .map(drop)
                    .map_err(|LdltError::ZeroPivot { index }| index - 1)
            }
            (Symbolic::Supernodal(s), Form::Pivoted) => {
                supernodal::factorize_supernodal_numeric_intranode_lblt(
                    &mut plan.l,
                    &mut self.subdiag,
                    &mut self.forward,
                    &mut self.inverse,
                    a,
                    s,
                    Par::Seq,
                    stack,
                    Default::default(),
                );
                for (row, &k) in self.pivot_order.iter_mut().zip(&self.forward) {
                    *row = self.order[k as usize];
                }
                Ok(())
            }
            (Symbolic::Supernodal(s), _) => supernodal::factorize_supernodal_numeric_ldlt(
                &mut plan.l,
                a,
                plain,
                s,
                Par::Seq,
                stack,
                Default::default(),
            )
            .map(drop)
            .map_err(|LdltError::ZeroPivot { index }| index),
        };
        if let Err(index) = done {
            return Factorisation::Singular { pivot: self.order[index] };
        }
        plan.diagonal(&mut self.d);
        if self.form == Form::Pivoted {
            eigenvalues(&mut self.d, &self.subdiag);
        }
        let (inertia, range) = match judge(&self.d) {
            Ok(found) => found,
            Err(k) => return Factorisation::Singular { pivot: self.pivot_order[k] },
        };
        [self.min_abs, self.max_abs] = range;
        self.factored = true;
        Factorisation::Ok(inertia)
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        assert!(self.factored, "{}: solve needs a successful factorisation", self.name());
        assert_eq!(rhs.len(), self.n, "{}: one right-hand side value per row", self.name());
        let Some(plan) = &mut self.plan else { return };
        for (w, &i) in self.work.iter_mut().zip(&self.pivot_order) {
            *w = rhs[i];
        }
        match (&plan.symbolic, self.form) {
            (Symbolic::Simplicial(s), _) => solve_simplicial(s, &plan.l, &self.d, &mut self.work),
            (Symbolic::Supernodal(s), Form::Pivoted) => {
                let perm = PermRef::new_checked(&self.forward, &self.inverse, self.n);
                SupernodalIntranodeLbltRef::new(s, &plan.l, &self.subdiag, perm)
                    .solve_in_place_no_numeric_permute_with_conj(
                        Conj::No,
                        MatMut::from_column_major_slice_mut(&mut self.work, self.n, 1),
                        Par::Seq,
                        MemStack::new(&mut plan.memory),
                    );
            }
            (Symbolic::Supernodal(s), _) => {
                solve_supernodal(s, &plan.l, &self.d, &mut self.work, &mut self.below);
            }
        }
        for (&w, &i) in self.work.iter().zip(&self.pivot_order) {
            rhs[i] = w;
        }
    }

    fn stats(&self) -> LdlStats {
        LdlStats {
            name: self.name(),
            n: self.n,
            nnz_a: self.nnz_a,
            nnz_l: self.nnz_l,
            flops: self.flops,
            min_abs_pivot: self.min_abs,
            max_abs_pivot: self.max_abs,
        }
    }

    fn pivots(&self) -> (&[f64], &[usize]) {
        if self.factored {
            (&self.d, &self.pivot_order)
        } else {
            (&[], &[])
        }
    }
}

impl Plan {
    /// Diagonal of D.
    fn diagonal(&self, d: &mut [f64]) {
        match &self.symbolic {
            Symbolic::Simplicial(s) => {
                for (d, &p) in d.iter_mut().zip(s.col_ptr()) {
                    *d = self.l[p as usize];
                }
            }
            Symbolic::Supernodal(s) => {
                for block in blocks(s) {
                    let values = &self.l[block.values.clone()];
                    for (k, d) in d[block.columns.clone()].iter_mut().enumerate() {
                        *d = values[k * (block.height() + 1)];
                    }
                }
            }
        }
    }
}

/// Dense columns of L with one structure.
struct Block<'a> {
    columns: Range<usize>,
    /// Rows below the triangle at the top.
    rows: &'a [u32],
    /// Where the values are, column by column.
    values: Range<usize>,
}

impl Block<'_> {
    fn width(&self) -> usize {
        self.columns.len()
    }

    fn height(&self) -> usize {
        self.columns.len() + self.rows.len()
    }
}

fn block(s: &SymbolicSupernodalCholesky<u32>, k: usize) -> Block<'_> {
    let at = |p: &[u32], k: usize| p[k] as usize;
    let rows = at(s.col_ptr_for_row_idx(), k)..at(s.col_ptr_for_row_idx(), k + 1);
    Block {
        columns: at(s.supernode_begin(), k)..at(s.supernode_end(), k),
        rows: &s.row_idx()[rows],
        values: at(s.col_ptr_for_val(), k)..at(s.col_ptr_for_val(), k + 1),
    }
}

fn blocks(s: &SymbolicSupernodalCholesky<u32>) -> impl DoubleEndedIterator<Item = Block<'_>> {
    (0..s.n_supernodes()).map(|k| block(s, k))
}

/// `x := (L D L')⁻¹ x` with the columns of L in blocks; `room` holds the rows below any block.
fn solve_supernodal(s: &SymbolicSupernodalCholesky<u32>, l: &[f64], d: &[f64], x: &mut [f64], room: &mut [f64]) {
    for b in blocks(s) {
        let w = b.width();
        let below = &mut room[..b.rows.len()];
        below.fill(0.0);
        for (j, col) in l[b.values.clone()].chunks_exact(b.height()).enumerate() {
            let xj = x[b.columns.start + j];
            subtract(&mut x[b.columns.clone()][j + 1..], &col[j + 1..w], xj);
            subtract(below, &col[w..], xj);
        }
        for (&i, v) in b.rows.iter().zip(below) {
            x[i as usize] += *v;
        }
    }
    for (x, d) in x.iter_mut().zip(d) {
        *x /= d;
    }
    for b in blocks(s).rev() {
        let w = b.width();
        let below = &mut room[..b.rows.len()];
        for (v, &i) in below.iter_mut().zip(b.rows) {
            *v = x[i as usize];
        }
        for (j, col) in l[b.values.clone()].chunks_exact(b.height()).enumerate().rev() {
            let sum = dot(&col[j + 1..w], &x[b.columns.clone()][j + 1..]) + dot(&col[w..], below);
            x[b.columns.start + j] -= sum;
        }
    }
}

/// `x := (L D L')⁻¹ x` with L by columns, the diagonal entry first.
fn solve_simplicial(s: &SymbolicSimplicialCholesky<u32>, l: &[f64], d: &[f64], x: &mut [f64]) {
    let below = |j: usize| s.col_ptr()[j] as usize + 1..s.col_ptr()[j + 1] as usize;
    for j in 0..x.len() {
        let xj = x[j];
        for (&i, &v) in s.row_idx()[below(j)].iter().zip(&l[below(j)]) {
            x[i as usize] -= v * xj;
        }
    }
    for (x, d) in x.iter_mut().zip(d) {
        *x /= d;
    }
    for j in (0..x.len()).rev() {
        let mut xj = x[j];
        for (&i, &v) in s.row_idx()[below(j)].iter().zip(&l[below(j)]) {
            xj -= v * x[i as usize];
        }
        x[j] = xj;
    }
}

/// `y -= a x`.
fn subtract(y: &mut [f64], a: &[f64], x: f64) {
    for (y, a) in y.iter_mut().zip(a) {
        *y -= a * x;
    }
}

/// Scalar product in four interleaved sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let mut rest = 0.0;
    for (x, y) in a4.remainder().iter().zip(b4.remainder()) {
        rest += x * y;
    }
    let mut sums = [0.0; 4];
    for (x, y) in a4.zip(b4) {
        for ((s, x), y) in sums.iter_mut().zip(x).zip(y) {
            *s += x * y;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Replaces the diagonal entries of every block of order 2 by its eigenvalues, the larger one for the larger entry.
fn eigenvalues(d: &mut [f64], subdiag: &[f64]) {
    let mut k = 0;
    while k < d.len() {
        let e = subdiag[k];
        if e == 0.0 {
            k += 1;
            continue;
        }
        let (mean, half) = (0.5 * (d[k] + d[k + 1]), 0.5 * (d[k] - d[k + 1]));
        let radius = half.hypot(e).copysign(half);
        (d[k], d[k + 1]) = (mean + radius, mean - radius);
        k += 2;
    }
}

/// The pattern as faer has it.
fn compressed(p: &Pattern) -> SymbolicSparseColMat<u32> {
    let narrow = |v: &[usize]| v.iter().map(|&k| k as u32).collect();
    SymbolicSparseColMat::new_checked(p.n_rows(), p.n_cols(), narrow(p.col_ptr()), None, narrow(p.row_idx()))
}

/// The transposed pattern, and the position in `p` of each of its entries.
fn transposed(p: &Pattern) -> (Pattern, Vec<usize>) {
    let mut cols = Vec::with_capacity(p.nnz());
    for j in 0..p.n_cols() {
        cols.resize(cols.len() + p.rows(j).len(), j);
    }
    let (t, map) = Pattern::from_triplets(p.n_cols(), p.n_rows(), &cols, p.row_idx());
    let mut src = vec![0; p.nnz()];
    for (k, &pos) in map.iter().enumerate() {
        src[pos] = k;
    }
    (t, src)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::allocations;

    /// Blocks of all sizes: dense ones large enough for every routine behind the matrix products, and those of a sparse matrix.
    #[test]
    fn nothing_is_allocated_after_the_analysis() {
        let n = 300;
        let dense = Pattern::dense_upper(n);
        let band: Vec<(usize, usize)> = (0..n).flat_map(|j| (j.saturating_sub(3)..=j).map(move |i| (i, j))).collect();
        let (rows, cols): (Vec<usize>, Vec<usize>) = band.into_iter().unzip();
        let band = Pattern::from_triplets(n, n, &rows, &cols).0;
        for p in [&band, &dense] {
            let mut v = vec![0.1; p.nnz()];
            for j in 0..n {
                v[p.range(j).end - 1] = if j % 3 == 0 { -100.0 } else { 100.0 };
            }
            let nan = vec![f64::NAN; p.nnz()];
            for form in [Form::Simplicial, Form::Supernodal, Form::Pivoted] {
                let mut s = Faer::new(form, Ordering::Amd);
                s.analyse(p).unwrap();
                let mut x = vec![1.0; n];
                let before = allocations();
                assert!(before > 0, "the counter must count");
                for _ in 0..2 {
                    assert!(matches!(s.factor(&nan), Factorisation::Singular { .. }));
                    assert_eq!(s.factor(&v), Factorisation::Ok(Inertia { positive: 200, negative: 100, zero: 0 }));
                    s.solve(&mut x);
                }
                assert_eq!(allocations(), before, "{form:?}");
            }
        }
    }
}
