//! Linear complementarity problems `0 ≤ z ⊥ q + M z ≥ 0` by complementary pivoting.
//!
//! C. E. Lemke, *Bimatrix equilibrium points and mathematical programming*, Management Science 11 (1965); R. W. Cottle, J.-S. Pang,
//! R. E. Stone, *The Linear Complementarity Problem* (1992), algorithm 4.4.5. Of matrices that are strictly copositive, or P, it always
//! ends at a solution; of monotone problems where there is one. Ties are broken by the lexicographic rule, so that no basis returns.
//! What it ends with is checked with the data as they were given.

/// Entry of a column, relative to its largest one, that counts as none.
const PIVOT: f64 = 1e-11;
/// Ratios, relative to the sizes of the data, that are the same.
const SAME: f64 = 1e-13;
/// Residual of a solution, relative to the terms of its row.
const MET: f64 = 1e-9;

/// A solution `z[n]`, and its slacks `q + M z`, by so much work at most in entries of the tableau. `None` where it ends at a ray, at rounding or at a limit, which
/// says nothing of the problem.
pub(super) fn solve(matrix: &[f64], q: &[f64], work: f64, goes_on: &dyn Fn() -> bool) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = q.len();
    let (m, q, unit) = scaled(matrix, q);
    if q.iter().all(|q| *q >= 0.0) {
        return check(matrix, &q, vec![0.0; n], &unit);
    }
    // columns: inverse of the basis `[n]`, the variables `z`, the artificial one, the right side
    let width = 2 * n + 2;
    let mut t = vec![0.0; n * width];
    for i in 0..n {
        let row = &mut t[i * width..][..width];
        row[i] = 1.0;
        row[n..2 * n].iter_mut().zip(&m[i * n..]).for_each(|(t, m)| *t = -m);
        row[2 * n] = -1.0;
        row[2 * n + 1] = q[i];
    }
    // variables: slacks `0..n`, `z` behind them, then the artificial one; a variable is the number of its column
    let mut basis: Vec<usize> = (0..n).collect();
    // of equal ones the last: its row of the identity is the lexicographically least
    let mut row = (0..n).min_by(|&a, &b| q[a].total_cmp(&q[b]).then(b.cmp(&a)))?;
    let (mut entering, mut spent) = (2 * n, 0.0);
    loop {
        spent += (n * width) as f64;
        if spent > work || !goes_on() {
            return None;
        }
        let leaving = std::mem::replace(&mut basis[row], entering);
        pivot(&mut t, width, row, entering);
        if leaving == 2 * n {
            let mut z = vec![0.0; n];
            for (i, v) in basis.iter().enumerate().filter(|v| *v.1 >= n) {
                z[v - n] = t[i * width + 2 * n + 1].max(0.0);
            }
            return check(matrix, &q, z, &unit);
        }
        // the partner of what left
        entering = if leaving < n { leaving + n } else { leaving - n };
        row = leaves(&t, width, entering, &basis)?;
    }
}

/// The row of the variable that reaches zero first: of several the artificial one, else the lexicographically first; none on a ray.
fn leaves(t: &[f64], width: usize, entering: usize, basis: &[usize]) -> Option<usize> {
    let n = basis.len();
    let largest = (0..n).fold(0f64, |a, i| a.max(t[i * width + entering].abs()));
    let ratio = |i: usize, column: usize| t[i * width + column] / t[i * width + entering];
    let rows = || (0..n).filter(|i| t[i * width + entering] > PIVOT * largest);
    let least = rows().map(|i| ratio(i, 2 * n + 1).max(0.0)).fold(f64::INFINITY, f64::min);
    let mut first: Option<usize> = None;
    for i in rows().filter(|i| ratio(*i, 2 * n + 1) <= least + SAME * (1.0 + least)) {
        if basis[i] == 2 * n {
            return Some(i);
        }
        let before = |j: usize| {
            let order = (0..n).map(|c| ratio(i, c).total_cmp(&ratio(j, c))).find(|o| o.is_ne());
            order.is_some_and(std::cmp::Ordering::is_lt)
        };
        if first.is_none_or(before) {
            first = Some(i);
        }
    }
    first
}

fn pivot(t: &mut [f64], width: usize, row: usize, column: usize) {
    let pivot = t[row * width + column];
    let own: Vec<f64> = t[row * width..][..width].iter().map(|v| v / pivot).collect();
    for (i, line) in t.chunks_mut(width).enumerate() {
        let factor = line[column];
        if i != row && factor != 0.0 {
            line.iter_mut().zip(&own).for_each(|(v, o)| *v -= factor * o);
            line[column] = 0.0;
        }
    }
    t[row * width..][..width].copy_from_slice(&own);
}

/// Matrix and right side in units of rows and variables, powers of two in which the largest entries of rows and columns are about one, and
/// those of rows, then of variables.
fn scaled(matrix: &[f64], q: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let n = q.len();
    let (mut m, mut q, mut unit) = (matrix.to_vec(), q.to_vec(), vec![1.0; 2 * n]);
    let factor = |largest: f64| if largest > 0.0 { largest.log2().round().exp2() } else { 1.0 };
    for j in 0..n {
        unit[n + j] = factor((0..n).fold(0f64, |a, i| a.max(m[i * n + j].abs()))).recip();
        (0..n).for_each(|i| m[i * n + j] *= unit[n + j]);
    }
    for i in 0..n {
        let row = &mut m[i * n..][..n];
        unit[i] = factor(row.iter().fold(0f64, |a, v| a.max(v.abs()))).recip();
        row.iter_mut().for_each(|v| *v *= unit[i]);
        q[i] *= unit[i];
    }
    (m, q, unit)
}

/// The point in the units of the problem, if it is a solution there: of every pair the larger member stays as it is.
fn check(matrix: &[f64], q: &[f64], mut z: Vec<f64>, unit: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = z.len();
    (0..n).for_each(|j| z[j] *= unit[n + j]);
    let mut w = vec![0.0; n];
    for i in 0..n {
        let q = q[i] / unit[i];
        let terms = matrix[i * n..][..n].iter().zip(&z).map(|(m, z)| m * z);
        let (value, size) = terms.fold((q, q.abs()), |(s, t), v| (s + v, t + v.abs()));
        let room = MET * size;
        if value < -room || (value > room && z[i] > 0.0) {
            return None;
        }
        w[i] = if z[i] > 0.0 { 0.0 } else { value.max(0.0) };
    }
    Some((z, w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    fn go() -> bool {
        true
    }

    fn residual(m: &[f64], q: &[f64], z: &[f64]) -> f64 {
        let n = q.len();
        let w = |i: usize| q[i] + m[i * n..][..n].iter().zip(z).map(|(m, z)| m * z).sum::<f64>();
        (0..n).map(|i| z[i].min(w(i)).abs()).fold(0.0, f64::max)
    }

    /// K. G. Murty's problem: from the usual right side the method visits all `2^n` bases (*Computational complexity of complementary pivot
    /// methods*, Math. Program. Study 7, 1978). The solution is `z = (0, …, 0, 1)`.
    #[test]
    fn the_longest_way_ends_at_the_solution() {
        let n = 8;
        let m: Vec<f64> = (0..n * n)
            .map(|k| {
                if k / n == k % n {
                    1.0
                } else if k / n < k % n {
                    2.0
                } else {
                    0.0
                }
            })
            .collect();
        let (z, w) = solve(&m, &vec![-1.0; n], f64::INFINITY, &go).unwrap();
        assert!(z[..n - 1].iter().all(|z| *z == 0.0) && z[n - 1] == 1.0, "{z:?}");
        assert!(w[..n - 1].iter().all(|w| *w == 1.0) && w[n - 1] == 0.0, "{w:?}");
        assert!(solve(&m, &vec![-1.0; n], 10.0, &go).is_none());
    }

    /// Strictly copositive matrices, degenerate ones, and units.
    #[test]
    fn copositive_problems_are_solved() {
        let mut draw = SplitMix64::new(4);
        for case in 0..60 {
            let n = 1 + case % 20;
            let mut m: Vec<f64> = (0..n * n).map(|_| (4.0 * draw.share() - 2.0).max(0.0)).collect();
            (0..n).for_each(|i| m[i * (n + 1)] += 0.1);
            // ties
            let q: Vec<f64> = (0..n).map(|_| (4.0 * draw.share()).floor() - 2.0).collect();
            let (z, _) = solve(&m, &q, f64::INFINITY, &go).unwrap();
            assert!(residual(&m, &q, &z) < 1e-10, "{case}");
            let u: Vec<f64> = (0..n).map(|_| (20.0 * draw.share() - 10.0).round().exp2()).collect();
            let other: Vec<f64> = (0..n * n).map(|k| m[k] * u[k % n]).collect();
            let (there, _) = solve(&other, &q, f64::INFINITY, &go).unwrap();
            let back: Vec<f64> = there.iter().zip(&u).map(|(z, u)| z * u).collect();
            assert!(residual(&m, &q, &back) < 1e-10, "{case}");
        }
    }

    /// `w = −1 − z` has no solution.
    #[test]
    fn a_ray_is_no_solution() {
        assert!(solve(&[-1.0], &[-1.0], f64::INFINITY, &go).is_none());
    }
}
