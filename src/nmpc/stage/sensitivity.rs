//! Products of sparse Jacobians with dense sensitivities, for `L` stages side by side.
//!
//! A block has `rows × columns` entries of `L` numbers each. With many columns one stage at a time keeps the block in the nearest
//! cache; with few, eight stages fill the registers.

/// Numbers that are handled at once where stages go one at a time; blocks then have a multiple of it as columns.
pub(super) const REGISTER: usize = 8;

/// `out += J z` for the entries of `J`, which are sorted by rows: entry `e` couples row `i` of `out` with row `j` of `z`; its values
/// for the stages from `first` on are at `jac[e · n + first]`.
#[inline(always)]
pub(super) fn product<const L: usize>(
    entries: &[(usize, usize)],
    jac: &[f64],
    [n, first]: [usize; 2],
    columns: usize,
    z: &[f64],
    out: &mut [f64],
) {
    if L == 1 {
        product_of_rows(entries, jac, [n, first], columns, z, out);
        return;
    }
    let width = columns * L;
    for (e, &(i, j)) in entries.iter().enumerate() {
        let factors = lanes::<L>(jac, e * n + first, n - first);
        let (from, to) = (&z[j * width..(j + 1) * width], &mut out[i * width..(i + 1) * width]);
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

/// The same for one stage: the sums of a row stay in registers.
#[inline(always)]
fn product_of_rows(
    entries: &[(usize, usize)],
    jac: &[f64],
    [n, k]: [usize; 2],
    columns: usize,
    z: &[f64],
    out: &mut [f64],
) {
    let mut from = 0;
    while from < entries.len() {
        let row = entries[from].0;
        let mut to = from;
        while to < entries.len() && entries[to].0 == row {
            to += 1;
        }
        let mut at = 0;
        while at + 2 * REGISTER <= columns {
            row_part::<{ 2 * REGISTER }>(&entries[from..to], &jac[from * n + k..], n, columns, at, z, out);
            at += 2 * REGISTER;
        }
        if at < columns {
            row_part::<REGISTER>(&entries[from..to], &jac[from * n + k..], n, columns, at, z, out);
        }
        from = to;
    }
}

#[inline(always)]
fn row_part<const W: usize>(
    entries: &[(usize, usize)],
    jac: &[f64],
    n: usize,
    columns: usize,
    at: usize,
    z: &[f64],
    out: &mut [f64],
) {
    let mut sum = [0.0; W];
    for (e, &(_, j)) in entries.iter().enumerate() {
        let (factor, from) = (jac[e * n], &z[j * columns + at..j * columns + at + W]);
        for l in 0..W {
            sum[l] += factor * from[l];
        }
    }
    let first = entries[0].0 * columns + at;
    let to = &mut out[first..first + W];
    for l in 0..W {
        to[l] += sum[l];
    }
}

/// `out = s + Σ_j factor(j) h K_j` over the first `count` blocks of `k`, with the lengths `steps` of the stages side by side.
#[inline(always)]
pub(super) fn combine<const L: usize>(
    factor: impl Fn(usize) -> f64,
    count: usize,
    steps: &[f64; L],
    k: &[f64],
    s: &[f64],
    out: &mut [f64],
) {
    let block = s.len();
    let step = |l: usize| if L == REGISTER { steps[l] } else { steps[0] };
    let mut at = 0;
    while at < block {
        let mut sum = [0.0; REGISTER];
        sum.copy_from_slice(&s[at..at + REGISTER]);
        for j in 0..count {
            let (f, k) = (factor(j), &k[j * block + at..j * block + at + REGISTER]);
            if f != 0.0 {
                for l in 0..REGISTER {
                    sum[l] += f * step(l) * k[l];
                }
            }
        }
        out[at..at + REGISTER].copy_from_slice(&sum);
        at += REGISTER;
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
