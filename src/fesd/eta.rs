//! Step equilibration with the indicator of (7.10), `η = Π_i (λ^B_i λ^F_i + θ^B_i θ^F_i)`, zero where something switches.
//!
//! The thesis asks for `η (h_1 − h_0) = 0`. Such rows have no multipliers in the limit (their gradients vanish at a
//! switch), and an interior-point method creeps on them; as penalties `η (h_1 − h_0)²`, `η² (h_1 − h_0)²` and
//! `tanh(η / ε) (h_1 − h_0)²` have the same zeros, are zero at exact solutions whatever their weight, and leave exactness to the branch problem.
//!
//! Local variables, in this order: `λ^B`, `λ^F`, `θ^B`, `θ^F` (`n` each), `h_0`, `h_1`.

/// What is made of the indicator and the difference `d` of the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    /// `η d²`.
    Product,
    /// `η² d²`.
    Squared,
    /// `tanh(η / ε) d²`: the weight saturates, whatever the size of the multipliers.
    Saturated,
    /// `η d`.
    Equation,
}

/// Indicator from which it counts as one in the saturated form.
const SATURATION: f64 = 0.1;

impl Shape {
    /// The factor of the indicator and its derivatives.
    fn of_eta(self, eta: f64) -> [f64; 3] {
        match self {
            Shape::Squared => [eta * eta, 2.0 * eta, 2.0],
            Shape::Saturated => {
                let t = (eta / SATURATION).tanh();
                let slope = (1.0 - t * t) / SATURATION;
                [t, slope, -2.0 * t * slope / SATURATION]
            }
            Shape::Product | Shape::Equation => [eta, 1.0, 0.0],
        }
    }

    /// The factor of the difference and its derivatives.
    fn of_difference(self, d: f64) -> [f64; 3] {
        match self {
            Shape::Equation => [d, 1.0, 0.0],
            Shape::Product | Shape::Squared | Shape::Saturated => [d * d, 2.0 * d, 2.0],
        }
    }
}

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

/// Derivative of `η` with respect to local variable `j < 4n`.
fn eta_j(n: usize, w: &[f64], j: usize) -> f64 {
    let (p, i) = partner(n, j);
    product(n, w, &[i]) * w[p]
}

/// Second derivative of `η` with respect to local variables `j ≤ k < 4n`.
fn eta_jk(n: usize, w: &[f64], j: usize, k: usize) -> f64 {
    let ((pj, i), (pk, l)) = (partner(n, j), partner(n, k));
    match i == l {
        true if pj == k => product(n, w, &[i]),
        true => 0.0,
        false => product(n, w, &[i, l]) * w[pj] * w[pk],
    }
}

/// Derivative of the difference with respect to local variable `j ≥ 4n`.
fn sign(n: usize, j: usize) -> f64 {
    if j == 4 * n {
        -1.0
    } else {
        1.0
    }
}

fn factors(shape: Shape, n: usize, w: &[f64]) -> ([f64; 3], [f64; 3]) {
    (shape.of_eta(product(n, w, &[])), shape.of_difference(w[4 * n + 1] - w[4 * n]))
}

/// Value of the term.
pub(super) fn value(shape: Shape, n: usize, w: &[f64]) -> f64 {
    let (e, d) = factors(shape, n, w);
    e[0] * d[0]
}

/// Derivative with respect to local variable `j`.
pub(super) fn gradient(shape: Shape, n: usize, w: &[f64], j: usize) -> f64 {
    let (e, d) = factors(shape, n, w);
    if j >= 4 * n {
        return e[0] * d[1] * sign(n, j);
    }
    e[1] * eta_j(n, w, j) * d[0]
}

/// Second derivative with respect to local variables `j ≤ k`.
pub(super) fn hessian(shape: Shape, n: usize, w: &[f64], j: usize, k: usize) -> f64 {
    let (e, d) = factors(shape, n, w);
    match (j >= 4 * n, k >= 4 * n) {
        (true, _) => e[0] * d[2] * sign(n, j) * sign(n, k),
        (false, true) => e[1] * eta_j(n, w, j) * d[1] * sign(n, k),
        (false, false) => {
            let curved = e[2] * eta_j(n, w, j) * eta_j(n, w, k);
            (curved + e[1] * eta_jk(n, w, j, k)) * d[0]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let n = 3;
        for shape in [Shape::Product, Shape::Squared, Shape::Saturated, Shape::Equation] {
            let mut w: Vec<f64> = (0..n_local(n)).map(|k| 0.3 + 0.17 * k as f64 % 0.9).collect();
            let e = 1e-6;
            let all = |w: &[f64]| -> (f64, Vec<f64>) {
                (value(shape, n, w), (0..n_local(n)).map(|k| gradient(shape, n, w, k)).collect())
            };
            for j in 0..n_local(n) {
                let g = gradient(shape, n, &w, j);
                let keep = w[j];
                w[j] = keep + e;
                let (vp, gp) = all(&w);
                w[j] = keep - e;
                let (vm, gm) = all(&w);
                w[j] = keep;
                assert!((g - (vp - vm) / (2.0 * e)).abs() < 1e-8, "{shape:?} {j}");
                for k in j..n_local(n) {
                    let fd = (gp[k] - gm[k]) / (2.0 * e);
                    assert!((hessian(shape, n, &w, j, k) - fd).abs() < 1e-8, "{shape:?} {j} {k}");
                }
            }
        }
    }

    /// Table 7.2: backward and forward sums of `(λ, θ)` of the two cells of a switching function, `ψ > 0` and `ψ < 0`.
    #[test]
    fn the_indicator_vanishes_exactly_where_something_switches() {
        let below = [(0.0, 1.0), (1.0, 0.0)].map(|(theta, lambda)| (lambda, theta));
        let above = [below[1], below[0]];
        let sliding = [(0.0, 0.4), (0.0, 0.6)];
        let eta = |b: [(f64, f64); 2], f: [(f64, f64); 2]| {
            let w = [b[0].0, b[1].0, f[0].0, f[1].0, b[0].1, b[1].1, f[0].1, f[1].1];
            product(2, &w, &[])
        };
        for (name, before, after, switches) in [
            ("no switch", below, below, false),
            ("no switch while sliding", sliding, sliding, false),
            ("crossing", below, above, true),
            ("entering", below, sliding, true),
            ("leaving", sliding, above, true),
        ] {
            assert_eq!(eta(before, after) == 0.0, switches, "{name}");
        }
    }
}
