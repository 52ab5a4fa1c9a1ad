//! Kernels against sums written out.

use super::*;

pub fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed;
    move || {
        s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

#[test]
fn products_of_all_shapes_and_modes() {
    let mut r = numbers(1);
    for m in [1, 3, 4, 7, 8, 13, 21] {
        for n in [1, 2, 4, 5, 9] {
            for k in [0, 1, 5, 17] {
                let (lda, ldc) = (m + 2, m + 1);
                let a: Vec<f64> = (0..lda * k.max(1)).map(|_| r()).collect();
                let b: Vec<f64> = (0..(k + 1) * (n + 1)).map(|_| r()).collect();
                let c0: Vec<f64> = (0..ldc * n).map(|_| r()).collect();
                for (rs, cs) in [(1, k + 1), (n + 1, 1)] {
                    for mode in [Mode::Set, Mode::Add, Mode::Subtract] {
                        let mut c = c0.clone();
                        gemm([m, n, k], Left { v: &a, ld: lda }, Right { v: &b, rs, cs }, &mut c, ldc, mode);
                        for j in 0..n {
                            for i in 0..m {
                                let s: f64 = (0..k).map(|l| a[i + l * lda] * b[l * rs + j * cs]).sum();
                                let old = c0[i + j * ldc];
                                let e = match mode {
                                    Mode::Set => s,
                                    Mode::Add => old + s,
                                    Mode::Subtract => old - s,
                                };
                                assert!((c[i + j * ldc] - e).abs() < 1e-14 * (1.0 + k as f64), "{m} {n} {k}");
                            }
                            // what lies between the columns is nobody's
                            assert_eq!(c[m + j * ldc], c0[m + j * ldc]);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn factors_and_inverses() {
    let mut r = numbers(2);
    for n in [1, 2, 5, 8, 9, 16, 23, 40] {
        let ld = n + 3;
        let g: Vec<f64> = (0..n * n).map(|_| r()).collect();
        let mut a = vec![f64::NAN; n * ld];
        for j in 0..n {
            for i in 0..n {
                let s: f64 = (0..n).map(|k| g[i + k * n] * g[j + k * n]).sum();
                a[i + j * ld] = s + if i == j { 0.1 } else { 0.0 };
            }
        }
        let mut l = a.clone();
        assert!(potrf(n, &mut l, ld));
        let mut root = vec![0.0; n * ld];
        inverse_root(n, &l, ld, &mut root, ld);
        let p = |i: usize, j: usize| (i.max(j)..n).map(|k| root[i + k * ld] * root[j + k * ld]).sum::<f64>();
        for j in 0..n {
            for i in 0..n {
                let one: f64 = (0..n).map(|k| a[i + k * ld] * p(k, j)).sum();
                assert!((one - f64::from(i == j)).abs() < 1e-11, "{n}: {i} {j} {one}");
                let back: f64 = (0..=i.min(j)).map(|k| l[i + k * ld] * l[j + k * ld]).sum();
                assert!((back - a[i + j * ld]).abs() < 1e-13 * n as f64);
            }
        }
    }
    let mut singular = [1.0, 1.0, 1.0, 1.0];
    assert!(!potrf(2, &mut singular, 2));
    let mut nan = [f64::NAN; 4];
    assert!(!potrf(2, &mut nan, 2));
}

#[test]
fn matrices_times_vectors() {
    let mut r = numbers(3);
    let (m, n, ld) = (9, 5, 11);
    let a: Vec<f64> = (0..ld * n).map(|_| r()).collect();
    let (x, mut y) = ([0.3, -0.2, 0.7, 1.1, -0.9], vec![1.0; m]);
    gemv(m, n, Left { v: &a, ld }, &x, &mut y);
    let mut z = vec![0.5; n];
    gemv_transposed(m, n, Left { v: &a, ld }, &y, &mut z);
    for i in 0..m {
        let e: f64 = 1.0 + (0..n).map(|j| a[i + j * ld] * x[j]).sum::<f64>();
        assert!((y[i] - e).abs() < 1e-14);
    }
    for j in 0..n {
        let e: f64 = 0.5 + (0..m).map(|i| a[i + j * ld] * y[i]).sum::<f64>();
        assert!((z[j] - e).abs() < 1e-14);
    }
}

#[test]
fn indefinite_matrices_become_definite() {
    let mut r = numbers(4);
    for n in [1, 2, 6, 11] {
        let mut a = vec![0.0; n * n];
        for j in 0..n {
            for i in 0..=j {
                a[i + j * n] = r();
                a[j + i * n] = a[i + j * n];
            }
        }
        let before = nalgebra::DMatrix::from_column_slice(n, n, &a).symmetric_eigen();
        let smallest = mirror_eigenvalues(n, &mut a, &mut vec![0.0; n * n + n], 0.01);
        assert!((smallest - before.eigenvalues.min()).abs() < 1e-13);
        let mirrored =
            nalgebra::DMatrix::from_diagonal(&before.eigenvalues.map(|v| if v > 0.01 { v } else { v.abs().max(0.01) }));
        let e = &before.eigenvectors * mirrored * before.eigenvectors.transpose();
        let d = (nalgebra::DMatrix::from_column_slice(n, n, &a) - e).abs().max();
        assert!(d < 1e-13, "{n}: {d}");
    }
}
