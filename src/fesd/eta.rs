//! The step equilibration term `η (h_1 − h_0)²` with the indicator of (7.10), `η = Π_i (λ^B_i λ^F_i + θ^B_i θ^F_i)`.
//!
//! The thesis asks for `η (h_1 − h_0) = 0`. Such rows have no multipliers in the limit (their gradients vanish at a
//! switch), and an interior-point method creeps on them; as a penalty the term has the same zeros, is zero at
//! exact solutions whatever its weight, and leaves exactness to the branch problem.
//!
//! Local variables, in this order: `λ^B`, `λ^F`, `θ^B`, `θ^F` (`n` each), `h_0`, `h_1`.

/// Number of local variables for `n` components.
pub(super) fn n_local(n: usize) -> usize {
    4 * n + 2
}

fn upsilon(n: usize, w: &[f64], i: usize) -> f64 {
    w[i] * w[n + i] + w[2 * n + i] * w[3 * n + i]
}

/// Product of `υ_k` over `k` outside `skip`.
fn product(n: usize, w: &[f64], skip: &[usize]) -> f64 {
    (0..n).filter(|k| !skip.contains(k)).map(|k| upsilon(n, w, k)).product()
}

/// Partner of local variable `j < 4n` in its product, and its component.
fn partner(n: usize, j: usize) -> (usize, usize) {
    let (block, i) = (j / n, j % n);
    ((block ^ 1) * n + i, i)
}

/// Value of the term.
pub(super) fn value(n: usize, w: &[f64]) -> f64 {
    product(n, w, &[]) * (w[4 * n + 1] - w[4 * n]).powi(2)
}

/// Derivative with respect to local variable `j`.
pub(super) fn gradient(n: usize, w: &[f64], j: usize) -> f64 {
    let dh = w[4 * n + 1] - w[4 * n];
    if j >= 4 * n {
        let g = 2.0 * product(n, w, &[]) * dh;
        return if j == 4 * n { -g } else { g };
    }
    let (p, i) = partner(n, j);
    product(n, w, &[i]) * w[p] * dh * dh
}

/// Second derivative with respect to local variables `j ≤ k`.
pub(super) fn hessian(n: usize, w: &[f64], j: usize, k: usize) -> f64 {
    let dh = w[4 * n + 1] - w[4 * n];
    if j >= 4 * n {
        let g = 2.0 * product(n, w, &[]);
        return if j == k { g } else { -g };
    }
    let (pj, i) = partner(n, j);
    if k >= 4 * n {
        let g = 2.0 * product(n, w, &[i]) * w[pj] * dh;
        return if k == 4 * n { -g } else { g };
    }
    let (pk, l) = partner(n, k);
    if i == l {
        return if pj == k { product(n, w, &[i]) * dh * dh } else { 0.0 };
    }
    product(n, w, &[i, l]) * w[pj] * w[pk] * dh * dh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let n = 3;
        let mut w: Vec<f64> = (0..n_local(n)).map(|k| 0.3 + 0.17 * k as f64 % 0.9).collect();
        let e = 1e-6;
        for j in 0..n_local(n) {
            let g = gradient(n, &w, j);
            let keep = w[j];
            w[j] = keep + e;
            let (vp, gp): (f64, Vec<f64>) = (value(n, &w), (0..n_local(n)).map(|k| gradient(n, &w, k)).collect());
            w[j] = keep - e;
            let (vm, gm): (f64, Vec<f64>) = (value(n, &w), (0..n_local(n)).map(|k| gradient(n, &w, k)).collect());
            w[j] = keep;
            assert!((g - (vp - vm) / (2.0 * e)).abs() < 1e-8, "{j}");
            for k in j..n_local(n) {
                let fd = (gp[k] - gm[k]) / (2.0 * e);
                assert!((hessian(n, &w, j, k) - fd).abs() < 1e-8, "{j} {k}");
            }
        }
    }
}
