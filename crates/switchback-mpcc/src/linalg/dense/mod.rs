//! Dense kernels for the matrices of real-time control: products, Cholesky factors, inverses.
//!
//! Matrices are column-major with a leading dimension. Every entry of a product is summed in the order of the inner index,
//! whatever the sizes and the tiles, so the same input gives the same bits. Nothing allocates. The loops are ordinary
//! Rust; [`dispatch`] compiles them a second time for processors with wide registers and fused products.

#[allow(unsafe_code)]
mod dispatch;

pub use dispatch::{wide, widest, Kernel};

/// Rows of a tile that is kept in registers.
const TILE_ROWS: usize = 8;
/// Columns of a tile that is kept in registers.
pub const TILE_COLS: usize = 4;
/// Columns that a factorisation handles at once.
const PANEL: usize = 8;

/// A left factor: `m × k` entries, rows beside each other.
#[derive(Clone, Copy)]
pub struct Left<'a> {
    /// Entries, one row after the other.
    pub v: &'a [f64],
    /// From one row to the next.
    pub ld: usize,
}

/// A right factor: entry `(i, j)` is `v[i * rs + j * cs]`, so a transposed matrix is one with its steps exchanged.
#[derive(Clone, Copy)]
pub struct Right<'a> {
    /// Entries.
    pub v: &'a [f64],
    /// From one row to the next.
    pub rs: usize,
    /// From one column to the next.
    pub cs: usize,
}

/// What happens to the left side of an assignment.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// `C = A B`
    Set,
    /// `C += A B`
    Add,
    /// `C -= A B`
    Subtract,
}

/// Product of `m × k` and `k × n` into `c` with the leading dimension `ldc`.
#[inline]
pub fn gemm([m, n, k]: [usize; 3], a: Left, b: Right, c: &mut [f64], ldc: usize, mode: Mode) {
    dispatch::gemm([m, n, k], a, b, c, ldc, mode);
}

#[inline(always)]
fn gemm_body<const FUSED: bool>([m, n, k]: [usize; 3], a: Left, b: Right, c: &mut [f64], ldc: usize, mode: Mode) {
    if b.rs == 1 {
        gemm_strided::<FUSED, true>([m, n, k], a, b, c, ldc, mode);
    } else {
        gemm_strided::<FUSED, false>([m, n, k], a, b, c, ldc, mode);
    }
}

/// `COLUMNS`: the columns of the right factor are contiguous. The smaller factor is the one that is read again and again.
#[inline(always)]
fn gemm_strided<const FUSED: bool, const COLUMNS: bool>(
    [m, n, k]: [usize; 3],
    a: Left,
    b: Right,
    c: &mut [f64],
    ldc: usize,
    mode: Mode,
) {
    if m <= n {
        gemm_block::<FUSED, COLUMNS>([0, m, 0, n, k], a, b, c, ldc, mode);
        return;
    }
    let mut i = 0;
    while i < m {
        // rows that do not fill a tile go with the last ones that do
        let end = if m - i < 2 * TILE_ROWS { m } else { i + TILE_ROWS };
        gemm_block::<FUSED, COLUMNS>([i, end, 0, n, k], a, b, c, ldc, mode);
        i = end;
    }
}

/// Rows `i0` to `i1` and columns `j0` to `j1` of a product.
#[inline(always)]
fn gemm_block<const FUSED: bool, const COLUMNS: bool>(
    [i0, i1, j0, j1, k]: [usize; 5],
    a: Left,
    b: Right,
    c: &mut [f64],
    ldc: usize,
    mode: Mode,
) {
    let mut j = j0;
    while j + TILE_COLS <= j1 {
        gemm_columns::<FUSED, COLUMNS, TILE_COLS>([i0, i1, j, k], a, b, c, ldc, mode);
        j += TILE_COLS;
    }
    while j < j1 {
        gemm_columns::<FUSED, COLUMNS, 1>([i0, i1, j, k], a, b, c, ldc, mode);
        j += 1;
    }
}

/// Rows `i0` to `i1` of the columns from `j` on.
#[inline(always)]
fn gemm_columns<const FUSED: bool, const COLUMNS: bool, const NR: usize>(
    [i0, i1, j, k]: [usize; 4],
    a: Left,
    b: Right,
    c: &mut [f64],
    ldc: usize,
    mode: Mode,
) {
    let mut i = i0;
    while i + TILE_ROWS <= i1 {
        tile::<FUSED, COLUMNS, TILE_ROWS, NR>([i, j, k], a, b, c, ldc, mode);
        i += TILE_ROWS;
    }
    if i < i1 && i > i0 && mode == Mode::Set {
        // what is left with rows that are there already: the same sums again
        tile::<FUSED, COLUMNS, TILE_ROWS, NR>([i1 - TILE_ROWS, j, k], a, b, c, ldc, mode);
        return;
    }
    if i + 4 <= i1 {
        tile::<FUSED, COLUMNS, 4, NR>([i, j, k], a, b, c, ldc, mode);
        i += 4;
    }
    while i < i1 {
        tile::<FUSED, COLUMNS, 1, NR>([i, j, k], a, b, c, ldc, mode);
        i += 1;
    }
}

#[inline(always)]
fn tile<const FUSED: bool, const COLUMNS: bool, const MR: usize, const NR: usize>(
    [i, j, k]: [usize; 3],
    a: Left,
    b: Right,
    c: &mut [f64],
    ldc: usize,
    mode: Mode,
) {
    // indices instead of iterators: loops over arrays of known length stay in registers at every level of optimisation
    let mut sum = [[0.0f64; MR]; NR];
    if k > 0 && COLUMNS {
        let mut right = [&b.v[..0]; NR];
        for jj in 0..NR {
            right[jj] = &b.v[(j + jj) * b.cs..(j + jj) * b.cs + k];
        }
        for (l, left) in a.v[i..].chunks(a.ld).take(k).enumerate() {
            let left = &left[..MR];
            for jj in 0..NR {
                add_row::<FUSED, MR>(left, right[jj][l], &mut sum[jj]);
            }
        }
    } else if k > 0 {
        let mut rights = b.v[j * b.cs..].chunks(b.rs);
        for left in a.v[i..].chunks(a.ld).take(k) {
            let (left, Some(right)) = (&left[..MR], rights.next()) else { break };
            for jj in 0..NR {
                add_row::<FUSED, MR>(left, right[jj * b.cs], &mut sum[jj]);
            }
        }
    }
    for jj in 0..NR {
        let to = &mut c[i + (j + jj) * ldc..i + (j + jj) * ldc + MR];
        for ii in 0..MR {
            to[ii] = match mode {
                Mode::Set => sum[jj][ii],
                Mode::Add => to[ii] + sum[jj][ii],
                Mode::Subtract => to[ii] - sum[jj][ii],
            };
        }
    }
}

#[inline(always)]
fn add_row<const FUSED: bool, const MR: usize>(left: &[f64], right: f64, sum: &mut [f64; MR]) {
    for ii in 0..MR {
        sum[ii] = if FUSED { left[ii].mul_add(right, sum[ii]) } else { left[ii] * right + sum[ii] };
    }
}

/// `y += A x` with `m × n` entries.
#[inline]
pub fn gemv(m: usize, n: usize, a: Left, x: &[f64], y: &mut [f64]) {
    dispatch::gemv(m, n, a, x, y);
}

#[inline(always)]
fn gemv_body<const FUSED: bool>(m: usize, n: usize, a: Left, x: &[f64], y: &mut [f64]) {
    let (x, y) = (&x[..n], &mut y[..m]);
    for j in 0..n {
        let (column, x) = (&a.v[j * a.ld..j * a.ld + m], x[j]);
        for i in 0..m {
            y[i] = if FUSED { column[i].mul_add(x, y[i]) } else { column[i] * x + y[i] };
        }
    }
}

/// `y += Aᵀ x` with `m × n` entries of `A`, `x` of `m` and `y` of `n`.
#[inline]
pub fn gemv_transposed(m: usize, n: usize, a: Left, x: &[f64], y: &mut [f64]) {
    dispatch::gemv_transposed(m, n, a, x, y);
}

#[inline(always)]
fn gemv_transposed_body<const FUSED: bool>(m: usize, n: usize, a: Left, x: &[f64], y: &mut [f64]) {
    for (j, y) in y[..n].iter_mut().enumerate() {
        *y += dot_body::<FUSED>(&a.v[j * a.ld..j * a.ld + m], &x[..m]);
    }
}

/// Scalar product, summed in eight interleaved sums.
#[inline]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    dot_body::<false>(a, b)
}

#[inline(always)]
fn dot_body<const FUSED: bool>(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let (mut s, whole) = ([0.0; 8], n - n % 8);
    let mut i = 0;
    while i < whole {
        let (x, y) = (&a[i..i + 8], &b[i..i + 8]);
        for l in 0..8 {
            s[l] = if FUSED { x[l].mul_add(y[l], s[l]) } else { x[l] * y[l] + s[l] };
        }
        i += 8;
    }
    let mut rest = 0.0;
    for i in whole..n {
        rest += a[i] * b[i];
    }
    ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7])) + rest
}

/// `y += alpha x`
#[inline(always)]
pub fn axpy(alpha: f64, x: &[f64], y: &mut [f64]) {
    let n = x.len().min(y.len());
    let (x, y) = (&x[..n], &mut y[..n]);
    for i in 0..n {
        y[i] += alpha * x[i];
    }
}

/// Cholesky factor of the lower triangle of `a`, in place; false where a pivot is not above `n` times the rounding error of its
/// diagonal entry. The upper triangle is neither read nor written.
pub fn potrf(n: usize, a: &mut [f64], ld: usize) -> bool {
    dispatch::potrf(n, a, ld)
}

#[inline(always)]
fn potrf_body<const FUSED: bool>(n: usize, a: &mut [f64], ld: usize) -> bool {
    let tiny = n as f64 * f64::EPSILON;
    let mut p = 0;
    while p < n {
        let w = PANEL.min(n - p);
        // what the columns in front take from the panel; the diagonal entries before are their scale
        let mut scale = [0.0f64; PANEL];
        for j in 0..w {
            scale[j] = a[p + j + (p + j) * ld];
        }
        let (done, panel) = a.split_at_mut(p * ld);
        if p > 0 {
            let left = Left { v: &done[p..], ld };
            let right = Right { v: &done[p..], rs: ld, cs: 1 };
            gemm_body::<FUSED>([n - p, w, p], left, right, &mut panel[p..], ld, Mode::Subtract);
        }
        for j in 0..w {
            let (before, rest) = panel.split_at_mut(j * ld);
            let column = &mut rest[p + j..n];
            for k in 0..j {
                let l = before[p + j + k * ld];
                axpy(-l, &before[p + j + k * ld..n + k * ld], column);
            }
            let pivot = column[0];
            // NaN fails too
            if !(pivot > tiny * scale[j].abs() && pivot.is_finite()) {
                return false;
            }
            let root = pivot.sqrt();
            for i in 1..column.len() {
                column[i] /= root;
            }
            column[0] = root;
        }
        p += w;
    }
    true
}

/// `L⁻ᵀ` of a Cholesky factor `l`, upper triangular, so that `L⁻ᵀ L⁻¹` is the inverse of the matrix. What is below the diagonal is
/// not written.
pub fn inverse_root(n: usize, l: &[f64], ld: usize, root: &mut [f64], ld_root: usize) {
    dispatch::inverse_root(n, l, ld, root, ld_root);
}

#[inline(always)]
fn inverse_root_body<const FUSED: bool>(n: usize, l: &[f64], ld: usize, root: &mut [f64], ld_root: usize) {
    let mut i = 0;
    while i < n {
        let w = PANEL.min(n - i);
        for j in i..i + w {
            root[j * ld_root..j * ld_root + i + w].fill(0.0);
        }
        // columns i.. of L⁻ᵀ: those of E minus what the columns in front take
        if i > 0 {
            let (done, rest) = root.split_at_mut(i * ld_root);
            let right = Right { v: &l[i..], rs: ld, cs: 1 };
            gemm_body::<FUSED>([i, w, i], Left { v: done, ld: ld_root }, right, rest, ld_root, Mode::Subtract);
        }
        for j in 0..w {
            root[i + j + (i + j) * ld_root] = 1.0;
        }
        for j in 0..w {
            let (before, rest) = root.split_at_mut((i + j) * ld_root);
            let column = &mut rest[..i + w];
            for k in 0..j {
                let f = l[i + j + (i + k) * ld];
                let from = &before[(i + k) * ld_root..(i + k) * ld_root + i + w];
                axpy(-f, from, column);
            }
            let d = l[i + j + (i + j) * ld];
            for r in 0..column.len() {
                column[r] /= d;
            }
        }
        i += w;
    }
}

/// Eigenvalues that are not above `floor` are replaced by their moduli, or by `floor` where these are smaller: directions of
/// negative curvature keep their size. By cyclic rotations (Jacobi); `a` has the leading dimension `n`, `work` is scratch of
/// `n² + n`. Returns the smallest eigenvalue before.
pub fn mirror_eigenvalues(n: usize, a: &mut [f64], work: &mut [f64], floor: f64) -> f64 {
    let (vectors, values) = work.split_at_mut(n * n);
    vectors.fill(0.0);
    (0..n).for_each(|i| vectors[i + i * n] = 1.0);
    let norm: f64 = a[..n * n].iter().map(|v| v * v).sum();
    let mut sweeps = 0;
    while off_diagonal(n, a) > f64::EPSILON * f64::EPSILON * norm && sweeps < MAX_SWEEPS {
        for q in 1..n {
            for p in 0..q {
                rotate(n, a, vectors, p, q);
            }
        }
        sweeps += 1;
    }
    let mut smallest = f64::INFINITY;
    for i in 0..n {
        smallest = smallest.min(a[i + i * n]);
        values[i] = if a[i + i * n] > floor { a[i + i * n] } else { a[i + i * n].abs().max(floor) };
    }
    for j in 0..n {
        for i in 0..=j {
            let s: f64 = (0..n).map(|k| vectors[i + k * n] * values[k] * vectors[j + k * n]).sum();
            a[i + j * n] = s;
            a[j + i * n] = s;
        }
    }
    smallest
}

fn off_diagonal(n: usize, a: &[f64]) -> f64 {
    (0..n).flat_map(|j| (0..j).map(move |i| a[i + j * n] * a[i + j * n])).sum()
}

/// Sweeps of rotations at most; six to ten reach the rounding error.
const MAX_SWEEPS: usize = 30;

fn rotate(n: usize, a: &mut [f64], v: &mut [f64], p: usize, q: usize) {
    let (app, aqq, apq) = (a[p + p * n], a[q + q * n], a[p + q * n]);
    if apq == 0.0 {
        return;
    }
    let tau = (aqq - app) / (2.0 * apq);
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = t * c;
    for k in 0..n {
        let (x, y) = (a[k + p * n], a[k + q * n]);
        a[k + p * n] = c * x - s * y;
        a[k + q * n] = s * x + c * y;
    }
    for k in 0..n {
        let (x, y) = (a[p + k * n], a[q + k * n]);
        a[p + k * n] = c * x - s * y;
        a[q + k * n] = s * x + c * y;
        let (x, y) = (v[k + p * n], v[k + q * n]);
        v[k + p * n] = c * x - s * y;
        v[k + q * n] = s * x + c * y;
    }
}

#[cfg(test)]
mod tests;
