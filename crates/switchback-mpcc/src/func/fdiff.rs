//! Finite differences with fixed sparse patterns and column colouring.
//!
//! Columns that share no row are moved together, so that a Jacobian costs two evaluations per colour
//! (A. R. Curtis, M. J. D. Powell, J. K. Reid, 1974). Nothing here allocates during evaluation.

use super::{Dims, EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::memory::{self, sizes};

/// Relative step of central first differences, `eps^(1/3)`.
pub(super) const STEP_FIRST: f64 = 6.055454452393343e-6;
/// Relative step of second differences of values, `eps^(1/4)`.
pub(super) const STEP_SECOND: f64 = 1.220703125e-4;

/// Partition of the columns of a pattern into groups without a common row; empty columns are in none.
#[derive(Debug, Clone, Default)]
pub(super) struct Colouring {
    ptr: Vec<usize>,
    cols: Vec<usize>,
}

impl Colouring {
    /// Greedy colouring, columns with many entries first.
    pub(super) fn of(pattern: &Pattern) -> Colouring {
        let n = pattern.n_cols();
        let by_row = transpose(pattern);
        let mut order: Vec<usize> = (0..n).filter(|&j| !pattern.rows(j).is_empty()).collect();
        order.sort_by_key(|&j| std::cmp::Reverse(pattern.rows(j).len()));
        let mut colour = vec![usize::MAX; n];
        let mut taken_by: Vec<usize> = Vec::new();
        for &j in &order {
            for &r in pattern.rows(j) {
                for &k in by_row.row(r) {
                    if colour[k] != usize::MAX {
                        taken_by[colour[k]] = j;
                    }
                }
            }
            let free = taken_by.iter().position(|&t| t != j).unwrap_or(taken_by.len());
            if free == taken_by.len() {
                taken_by.push(usize::MAX);
            }
            colour[j] = free;
        }
        let mut ptr = vec![0];
        let mut cols = Vec::with_capacity(order.len());
        for g in 0..taken_by.len() {
            cols.extend((0..n).filter(|&j| colour[j] == g));
            ptr.push(cols.len());
        }
        Colouring { ptr, cols }
    }

    /// The groups, each a list of columns.
    pub(super) fn groups(&self) -> impl Iterator<Item = &[usize]> {
        self.ptr.windows(2).map(|w| &self.cols[w[0]..w[1]])
    }
}

/// Columns by row.
struct Rows {
    ptr: Vec<usize>,
    cols: Vec<usize>,
}

impl Rows {
    fn row(&self, r: usize) -> &[usize] {
        &self.cols[self.ptr[r]..self.ptr[r + 1]]
    }
}

fn transpose(pattern: &Pattern) -> Rows {
    let mut ptr = vec![0; pattern.n_rows() + 1];
    for &r in pattern.row_idx() {
        ptr[r + 1] += 1;
    }
    for r in 0..pattern.n_rows() {
        ptr[r + 1] += ptr[r];
    }
    let mut next = ptr.clone();
    let mut cols = vec![0; pattern.nnz()];
    for j in 0..pattern.n_cols() {
        for &r in pattern.rows(j) {
            cols[next[r]] = j;
            next[r] += 1;
        }
    }
    Rows { ptr, cols }
}

/// Jacobian of which nothing is known: dense in `x`, `u` and `p`, so that no derivative is zero by omission; empty in
/// `t`, because a function of time makes time a state of what is discretised.
pub(super) fn dense_without_time(dims: Dims, n_out: usize) -> Pattern {
    let what = "a Jacobian whose pattern is not given is dense in states, controls and parameters, give the pattern";
    let n = sizes::entries(what, &[n_out, dims.t_col()]).unwrap_or_else(|e| memory::unwind(e));
    let (mut rows, mut cols) = (memory::with_capacity(n), memory::with_capacity(n));
    for j in 0..dims.t_col() {
        for i in 0..n_out {
            rows.push(i);
            cols.push(j);
        }
    }
    Pattern::from_triplets(n_out, dims.n_in(), &rows, &cols).0
}

/// Upper triangle of the pattern of `JᵀJ`: columns of the Jacobian that share a row may be coupled.
pub(super) fn hessian_pattern_of(jac: &Pattern) -> Pattern {
    let n = jac.n_cols();
    let by_row = transpose(jac);
    let mut seen = vec![usize::MAX; n];
    let (mut rows, mut cols) = (Vec::new(), Vec::new());
    for j in 0..n {
        for &r in jac.rows(j) {
            for &k in by_row.row(r) {
                if k <= j && seen[k] != j {
                    seen[k] = j;
                    memory::room(&mut rows, 1);
                    memory::room(&mut cols, 1);
                    rows.push(k);
                    cols.push(j);
                }
            }
        }
    }
    Pattern::from_triplets(n, n, &rows, &cols).0
}

/// Symmetric expansion of an upper triangle, with the entry of the triangle behind every entry.
pub(super) fn expand(upper: &Pattern) -> (Pattern, Vec<usize>) {
    let n = upper.n_cols();
    let (mut rows, mut cols, mut source) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..n {
        for k in upper.range(j) {
            let i = upper.row_idx()[k];
            rows.push(i);
            cols.push(j);
            source.push(k);
            if i != j {
                rows.push(j);
                cols.push(i);
                source.push(k);
            }
        }
    }
    let (full, place) = Pattern::from_triplets(n, n, &rows, &cols);
    let mut map = vec![0; full.nnz()];
    for (s, p) in source.into_iter().zip(place) {
        map[p] = s;
    }
    (full, map)
}

/// Input `j` of a point, in the numbering of the patterns.
pub(super) fn input(dims: Dims, at: &Point, j: usize) -> f64 {
    if j < dims.x {
        at.x[j]
    } else if j < dims.x + dims.u {
        at.u[j - dims.x]
    } else if j < dims.t_col() {
        at.p[j - dims.x - dims.u]
    } else {
        at.t
    }
}

/// Writes all inputs of a point into `z[n_in]`.
pub(super) fn gather(dims: Dims, at: &Point, z: &mut [f64]) {
    z[..dims.x].copy_from_slice(at.x);
    z[dims.x..dims.x + dims.u].copy_from_slice(at.u);
    z[dims.x + dims.u..dims.t_col()].copy_from_slice(at.p);
    z[dims.t_col()] = at.t;
}

/// The point whose inputs are `z[n_in]`.
pub(super) fn point(dims: Dims, z: &[f64]) -> Point<'_> {
    Point { t: z[dims.t_col()], x: &z[..dims.x], u: &z[dims.x..dims.x + dims.u], p: &z[dims.x + dims.u..dims.t_col()] }
}

/// Step for an input of the given value.
pub(super) fn step(relative: f64, value: f64) -> f64 {
    relative * value.abs().max(1.0)
}

/// Sparse first differences of a vector function.
pub(super) struct Differences<'a> {
    pub(super) dims: Dims,
    pub(super) pattern: &'a Pattern,
    pub(super) colouring: &'a Colouring,
}

/// A vector function to difference.
type Eval<'a> = &'a mut dyn FnMut(&Point, &mut [f64]) -> EvalResult;
/// Receives (entry of the pattern, value).
type Emit<'a> = &'a mut dyn FnMut(usize, f64);

/// Memory of [`Differences::run`].
struct Scratch<'a> {
    z: &'a mut [f64],
    f: [&'a mut [f64]; 3],
}

impl Differences<'_> {
    /// Length of the workspace for a function of `n_in` inputs with `n_rows` outputs.
    pub(super) fn work_len(n_in: usize, n_rows: usize) -> usize {
        n_in + 3 * n_rows
    }

    /// Central differences, two evaluations per colour; one-sided of second order at the border of the domain.
    ///
    /// Every entry of the pattern is emitted once. Where a group of columns cannot be moved to both sides
    /// its columns are treated one by one.
    pub(super) fn run(&self, at: &Point, eval: Eval, emit: Emit, work: &mut [f64]) -> EvalResult {
        let m = self.pattern.n_rows();
        let (z, rest) = work.split_at_mut(self.dims.n_in());
        let (f0, rest) = rest.split_at_mut(m);
        let (f1, rest) = rest.split_at_mut(m);
        let mut s = Scratch { z, f: [f0, f1, &mut rest[..m]] };
        gather(self.dims, at, s.z);
        for group in self.colouring.groups() {
            match self.central(at, group, eval, emit, &mut s) {
                Err(EvalError::Recoverable) => {
                    for j in group {
                        self.single(at, *j, group.len() > 1, eval, emit, &mut s)?;
                    }
                }
                other => other?,
            }
        }
        Ok(())
    }

    /// Evaluates with the columns moved by `multiple` steps, and moves them back.
    fn moved(&self, at: &Point, cols: &[usize], multiple: f64, eval: Eval, z: &mut [f64], f: &mut [f64]) -> EvalResult {
        for &j in cols {
            z[j] = shifted(input(self.dims, at, j), multiple);
        }
        let result = eval(&point(self.dims, z), f);
        for &j in cols {
            z[j] = input(self.dims, at, j);
        }
        result
    }

    fn central(&self, at: &Point, group: &[usize], eval: Eval, emit: Emit, s: &mut Scratch) -> EvalResult {
        let [fp, fm, _] = &mut s.f;
        self.moved(at, group, 1.0, eval, s.z, fp)?;
        self.moved(at, group, -1.0, eval, s.z, fm)?;
        for &j in group {
            let v = input(self.dims, at, j);
            let width = shifted(v, 1.0) - shifted(v, -1.0);
            for k in self.pattern.range(j) {
                let r = self.pattern.row_idx()[k];
                emit(k, (fp[r] - fm[r]) / width);
            }
        }
        Ok(())
    }

    fn single(&self, at: &Point, j: usize, try_central: bool, eval: Eval, emit: Emit, s: &mut Scratch) -> EvalResult {
        if try_central {
            match self.central(at, &[j], eval, emit, s) {
                Err(EvalError::Recoverable) => {}
                other => return other,
            }
        }
        let [f0, f1, f2] = &mut s.f;
        eval(&point(self.dims, s.z), f0)?;
        let v = input(self.dims, at, j);
        for side in [-1.0, 1.0] {
            match self.moved(at, &[j], side, eval, s.z, f1) {
                Err(EvalError::Recoverable) => continue,
                other => other?,
            }
            let d1 = shifted(v, side) - v;
            match self.moved(at, &[j], 2.0 * side, eval, s.z, f2) {
                Err(EvalError::Recoverable) => {
                    for k in self.pattern.range(j) {
                        let r = self.pattern.row_idx()[k];
                        emit(k, (f1[r] - f0[r]) / d1);
                    }
                }
                other => {
                    other?;
                    let d2 = shifted(v, 2.0 * side) - v;
                    for k in self.pattern.range(j) {
                        let r = self.pattern.row_idx()[k];
                        let (s1, s2) = ((f1[r] - f0[r]) / d1, (f2[r] - f0[r]) / d2);
                        emit(k, (s1 * d2 - s2 * d1) / (d2 - d1));
                    }
                }
            }
            return Ok(());
        }
        Err(EvalError::Recoverable)
    }
}

fn shifted(value: f64, multiple: f64) -> f64 {
    value + multiple * step(STEP_FIRST, value)
}

/// Second differences of a scalar function at the entries of an upper triangle, four evaluations per entry.
///
/// The error is about `1e-8` times the size of the function and of its fourth derivatives; at the border
/// of the domain, where the differences are one-sided, about `1e-4`. The workspace holds `n_in` numbers.
pub(super) fn second_differences(
    dims: Dims,
    upper: &Pattern,
    at: &Point,
    eval: &mut dyn FnMut(&Point) -> Result<f64, EvalError>,
    out: &mut [f64],
    work: &mut [f64],
) -> EvalResult {
    if upper.nnz() == 0 {
        return Ok(());
    }
    let z = &mut work[..dims.n_in()];
    gather(dims, at, z);
    let centre = eval(&point(dims, z))?;
    for j in 0..upper.n_cols() {
        for k in upper.range(j) {
            let i = upper.row_idx()[k];
            let (vi, vj) = (input(dims, at, i), input(dims, at, j));
            let (hi, hj) = (step(STEP_SECOND, vi), step(STEP_SECOND, vj));
            let mut corner = |a: f64, b: f64| {
                z[i] += a;
                z[j] += b;
                let v = eval(&point(dims, z));
                z[i] = vi;
                z[j] = vj;
                v
            };
            out[k] = if i == j { diagonal(&mut corner, hi, centre)? } else { mixed(&mut corner, hi, hj, centre)? };
        }
    }
    Ok(())
}

type Corner<'a> = &'a mut dyn FnMut(f64, f64) -> Result<f64, EvalError>;

/// Result of a stencil, or `None` where it leaves the domain.
fn inside(v: Result<f64, EvalError>) -> Result<Option<f64>, EvalError> {
    match v {
        Ok(v) => Ok(Some(v)),
        Err(EvalError::Recoverable) => Ok(None),
        Err(e) => Err(e),
    }
}

fn diagonal(f: Corner, h: f64, centre: f64) -> Result<f64, EvalError> {
    let mut stencil = |a: f64, b: f64| -> Result<f64, EvalError> {
        // Three equidistant points: one is the centre.
        let (va, vb) = (f(a, 0.0)?, f(b, 0.0)?);
        Ok(if a == -b { (va - centre + (vb - centre)) / (h * h) } else { (vb - va - (va - centre)) / (h * h) })
    };
    for (a, b) in [(h, -h), (-h, -2.0 * h), (h, 2.0 * h)] {
        if let Some(v) = inside(stencil(a, b))? {
            return Ok(v);
        }
    }
    Err(EvalError::Recoverable)
}

fn mixed(f: Corner, hi: f64, hj: f64, centre: f64) -> Result<f64, EvalError> {
    let mut central = || -> Result<f64, EvalError> {
        let (pp, pm, mp, mm) = (f(hi, hj)?, f(hi, -hj)?, f(-hi, hj)?, f(-hi, -hj)?);
        Ok(((pp - pm) - (mp - mm)) / (4.0 * hi * hj))
    };
    if let Some(v) = inside(central())? {
        return Ok(v);
    }
    for (a, b) in [(-hi, -hj), (hi, hj), (-hi, hj), (hi, -hj)] {
        let mut corner =
            || -> Result<f64, EvalError> { Ok(((f(a, b)? - f(a, 0.0)?) - (f(0.0, b)? - centre)) / (a * b)) };
        if let Some(v) = inside(corner())? {
            return Ok(v);
        }
    }
    Err(EvalError::Recoverable)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic numbers in [0, 1).
    struct Lcg(u64);
    impl Lcg {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    fn random_pattern(rng: &mut Lcg, m: usize, n: usize, density: f64) -> Pattern {
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for j in 0..n {
            for i in 0..m {
                if rng.next() < density {
                    rows.push(i);
                    cols.push(j);
                }
            }
        }
        Pattern::from_triplets(m, n, &rows, &cols).0
    }

    #[test]
    fn groups_share_no_row_and_cover_all_columns() {
        let mut rng = Lcg(7);
        for trial in 0..200 {
            let (m, n) = (1 + trial % 13, 1 + trial % 17);
            let density = rng.next();
            let p = random_pattern(&mut rng, m, n, density);
            let colouring = Colouring::of(&p);
            let mut count = vec![0; n];
            for group in colouring.groups() {
                assert!(!group.is_empty());
                let mut used = vec![false; m];
                for &j in group {
                    count[j] += 1;
                    for &r in p.rows(j) {
                        assert!(!used[r]);
                        used[r] = true;
                    }
                }
            }
            for (j, c) in count.into_iter().enumerate() {
                assert_eq!(c, usize::from(!p.rows(j).is_empty()));
            }
        }
    }

    #[test]
    fn bands_take_as_many_colours_as_they_are_wide() {
        let n: usize = 40;
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for j in 0..n {
            for i in j.saturating_sub(1)..=(j + 1).min(n - 1) {
                rows.push(i);
                cols.push(j);
            }
        }
        let p = Pattern::from_triplets(n, n, &rows, &cols).0;
        assert!(Colouring::of(&p).groups().count() <= 5);
    }

    #[test]
    fn differences_are_exact_on_random_sparse_linear_functions() {
        let mut rng = Lcg(3);
        let dims = Dims { x: 5, u: 3, p: 2 };
        let n = dims.n_in();
        for _ in 0..50 {
            let m = 6;
            let pattern = random_pattern(&mut rng, m, n, 0.3);
            let values: Vec<f64> = (0..pattern.nnz()).map(|_| rng.next() - 0.5).collect();
            let z: Vec<f64> = (0..n).map(|_| 20.0 * (rng.next() - 0.5)).collect();
            let colouring = Colouring::of(&pattern);
            let mut out = vec![f64::NAN; pattern.nnz()];
            let mut work = vec![0.0; Differences::work_len(n, m)];
            let mut eval = |at: &Point, f: &mut [f64]| {
                f.fill(0.0);
                for j in 0..n {
                    for k in pattern.range(j) {
                        f[pattern.row_idx()[k]] += values[k] * input(dims, at, j);
                    }
                }
                Ok(())
            };
            Differences { dims, pattern: &pattern, colouring: &colouring }
                .run(&point(dims, &z), &mut eval, &mut |k, v| out[k] = v, &mut work)
                .unwrap();
            for (o, v) in out.iter().zip(&values) {
                assert!((o - v).abs() < 1e-8, "{o} {v}");
            }
        }
    }

    #[test]
    fn derived_hessian_pattern_couples_columns_of_one_row() {
        let mut rng = Lcg(11);
        for _ in 0..30 {
            let jac = random_pattern(&mut rng, 4, 9, 0.25);
            let h = hessian_pattern_of(&jac);
            assert!(h.is_upper());
            for j in 0..9 {
                for i in 0..=j {
                    let coupled = (0..4).any(|r| jac.get(r, i).is_some() && jac.get(r, j).is_some());
                    assert_eq!(h.get(i, j).is_some(), coupled);
                }
            }
            let (full, map) = expand(&h);
            for j in 0..9 {
                for i in 0..9 {
                    assert_eq!(full.get(i, j).map(|k| map[k]), h.get(i.min(j), i.max(j)));
                }
            }
        }
    }
}
