//! Products of sparse Jacobians with dense sensitivities, for `L` stages side by side.
//!
//! A block has `rows × columns` entries of `L` numbers each. With many columns one stage at a time keeps the block in the nearest
//! cache; with few, eight stages fill the registers.

use crate::linalg::dense::axpy;

/// `out += J z` for the entries of `J`: entry `e` couples row `i` of `out` with row `j` of `z`; its values for the stages from `first`
/// on are at `jac[e · n + first]`.
#[inline(always)]
pub(super) fn product<const L: usize>(
    entries: &[(usize, usize)],
    jac: &[f64],
    [n, first]: [usize; 2],
    columns: usize,
    z: &[f64],
    out: &mut [f64],
) {
    let width = columns * L;
    for (e, &(i, j)) in entries.iter().enumerate() {
        let factors = lanes::<L>(jac, e * n + first, n - first);
        let (from, to) = (&z[j * width..(j + 1) * width], &mut out[i * width..(i + 1) * width]);
        if L == 1 {
            axpy(factors[0], from, to);
            continue;
        }
        let mut at = 0;
        while at < width {
            let (from, to) = (&from[at..at + L], &mut to[at..at + L]);
            for l in 0..L {
                to[l] += factors[l] * from[l];
            }
            at += L;
        }
    }
}

/// `out[i, column] += J_ij` for entries of inputs that are columns themselves.
#[inline(always)]
pub(super) fn direct<const L: usize>(
    entries: &[(usize, usize)],
    jac: &[f64],
    [n, first]: [usize; 2],
    columns: usize,
    out: &mut [f64],
) {
    for (e, &(i, c)) in entries.iter().enumerate() {
        let factors = lanes::<L>(jac, e * n + first, n - first);
        let to = &mut out[(i * columns + c) * L..(i * columns + c) * L + L];
        for l in 0..L {
            to[l] += factors[l];
        }
    }
}

/// `L` numbers from a place on, zeros where fewer than `L` stages are left.
#[inline(always)]
fn lanes<const L: usize>(v: &[f64], at: usize, left: usize) -> [f64; L] {
    let mut out = [0.0; L];
    let m = L.min(left);
    out[..m].copy_from_slice(&v[at..at + m]);
    out
}
