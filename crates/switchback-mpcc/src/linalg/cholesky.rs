//! Dense Cholesky factorisations of small matrices in place, row-major.

/// A pivot below this share of its diagonal entry is rounding: the matrix is not positive definite to working precision.
const PIVOT: f64 = 8.0 * f64::EPSILON;

/// Replaces the lower triangle of a symmetric matrix by its factor; false if it is not positive definite.
pub fn factorise(n: usize, a: &mut [f64]) -> bool {
    for j in 0..n {
        let d = (0..j).fold(a[j * n + j], |s, k| s - a[j * n + k] * a[j * n + k]);
        // also where it is no number
        if !(d > PIVOT * a[j * n + j].abs() && d.is_finite()) {
            return false;
        }
        let d = d.sqrt();
        a[j * n + j] = d;
        for i in j + 1..n {
            let s = (0..j).fold(a[i * n + j], |s, k| s - a[i * n + k] * a[j * n + k]);
            a[i * n + j] = s / d;
        }
    }
    true
}

/// Replaces `b` by the solution, with the factor `l` of order `b.len()`.
pub fn solve(l: &[f64], b: &mut [f64]) {
    let n = b.len();
    for i in 0..n {
        let s = (0..i).fold(b[i], |s, k| s - l[i * n + k] * b[k]);
        b[i] = s / l[i * n + i];
    }
    for i in (0..n).rev() {
        let s = (i + 1..n).fold(b[i], |s, k| s - l[k * n + i] * b[k]);
        b[i] = s / l[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_solve_and_what_is_not_definite_is_refused() {
        let a = [4.0, 2.0, 1.0, 2.0, 5.0, 3.0, 1.0, 3.0, 6.0];
        let mut l = a.to_vec();
        assert!(factorise(3, &mut l));
        let x = [1.0, -2.0, 0.5];
        let mut b: Vec<f64> = (0..3).map(|i| (0..3).map(|j| a[3 * i + j] * x[j]).sum()).collect();
        solve(&l, &mut b);
        assert!(b.iter().zip(x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
        for bad in [[1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 2.0, 1.0], [0.0; 4], [f64::NAN; 4]] {
            assert!(!factorise(2, &mut bad.to_vec()), "{bad:?}");
        }
    }
}
