//! Dense LU factorisations in place, real and complex, without allocation after the first use.

use super::dense::axpy;
use nalgebra::Complex;
use std::ops::{Add, Div, Mul, Sub};

/// A field with a size to pivot by.
pub(crate) trait Scalar:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn size(self) -> f64;
}

impl Scalar for f64 {
    #[inline]
    fn size(self) -> f64 {
        self.abs()
    }
}

impl Scalar for Complex<f64> {
    #[inline]
    fn size(self) -> f64 {
        self.re.abs() + self.im.abs()
    }
}

/// Factors of a square matrix, row-major, with row pivoting relative to the size of the rows.
#[derive(Debug, Default)]
pub(crate) struct Lu<T> {
    n: usize,
    a: Vec<T>,
    perm: Vec<usize>,
    scale: Vec<f64>,
    y: Vec<T>,
}

impl<T: Scalar> Lu<T> {
    /// With room for matrices up to `n × n`.
    pub(crate) fn with_capacity(n: usize) -> Lu<T> {
        Lu {
            n: 0,
            a: Vec::with_capacity(n * n),
            perm: Vec::with_capacity(n),
            scale: Vec::with_capacity(n),
            y: Vec::with_capacity(n),
        }
    }

    /// A zero matrix of order `n` to write to.
    pub(crate) fn clear(&mut self, n: usize) -> &mut [T] {
        self.n = n;
        self.a.clear();
        self.a.resize(n * n, T::default());
        &mut self.a
    }

    /// The matrix, to write to before it is factorised.
    pub(crate) fn matrix(&mut self) -> &mut [T] {
        &mut self.a
    }

    /// Adds to an entry, by its place in the row-major matrix.
    pub(crate) fn add(&mut self, at: usize, v: T) {
        self.a[at] = self.a[at] + v;
    }

    /// Factorises what was written; false if the matrix is singular to rounding.
    pub(crate) fn factorise(&mut self) -> bool {
        self.factorise_sized(|_| 1.0)
    }

    /// The same where the unknowns have sizes: pivots are chosen, and the matrix is called singular, as if every unknown
    /// were measured in units of its size.
    pub(crate) fn factorise_sized(&mut self, unknown: impl Fn(usize) -> f64) -> bool {
        let n = self.n;
        self.perm.clear();
        self.perm.extend(0..n);
        self.scale.clear();
        for i in 0..n {
            let row = self.a[i * n..(i + 1) * n].iter().enumerate();
            let s = row.fold(0.0f64, |m, (j, v)| m.max(v.size() * unknown(j)));
            if !(s > 0.0 && s.is_finite()) {
                return false;
            }
            self.scale.push(1.0 / s);
        }
        for k in 0..n {
            let unit = unknown(k);
            let size = |i: usize| self.a[i * n + k].size() * self.scale[i] * unit;
            let mut best = k;
            for i in k + 1..n {
                if size(i) > size(best) {
                    best = i;
                }
            }
            let pivot = size(best);
            if pivot.is_nan() || pivot <= 1e-14 {
                return false;
            }
            if best != k {
                for j in 0..n {
                    self.a.swap(k * n + j, best * n + j);
                }
                self.perm.swap(k, best);
                self.scale.swap(k, best);
            }
            let (top, bottom) = self.a.split_at_mut((k + 1) * n);
            let pivot = &top[k * n..];
            for row in bottom.chunks_exact_mut(n) {
                let l = row[k] / pivot[k];
                row[k] = l;
                for (r, p) in row[k + 1..].iter_mut().zip(&pivot[k + 1..]) {
                    *r = *r - l * *p;
                }
            }
        }
        true
    }

    /// Replaces the right-hand side by the solution.
    pub(crate) fn solve(&mut self, b: &mut [T]) {
        let n = self.n;
        // the usual orders of contacts and sliding modes, without the loops
        match (&self.a[..], &self.perm[..]) {
            ([a], _) => {
                b[0] = b[0] / *a;
                return;
            }
            ([a, u, l, d], &[i, j]) => {
                let y = b[i];
                b[1] = (b[j] - *l * y) / *d;
                b[0] = (y - *u * b[1]) / *a;
                return;
            }
            _ => {}
        }
        self.y.clear();
        self.y.extend(self.perm.iter().map(|&i| b[i]));
        let y = &mut self.y;
        for i in 0..n {
            let row = &self.a[i * n..i * n + i];
            let s = row.iter().zip(y.iter()).fold(y[i], |s, (l, v)| s - *l * *v);
            y[i] = s;
        }
        for i in (0..n).rev() {
            let row = &self.a[i * n..(i + 1) * n];
            let s = row[i + 1..].iter().zip(&y[i + 1..]).fold(y[i], |s, (u, v)| s - *u * *v);
            y[i] = s / row[i];
        }
        b[..n].copy_from_slice(y);
    }
}

impl Lu<f64> {
    /// Replaces `m` right-hand sides by their solutions: `b` is row-major, `n × m`, and so is `work`.
    pub(crate) fn solve_block(&self, m: usize, b: &mut [f64], work: &mut [f64]) {
        let n = self.n;
        for (i, &from) in self.perm.iter().enumerate() {
            work[i * m..(i + 1) * m].copy_from_slice(&b[from * m..(from + 1) * m]);
        }
        for i in 0..n {
            let (done, rest) = work.split_at_mut(i * m);
            for j in 0..i {
                axpy(-self.a[i * n + j], &done[j * m..(j + 1) * m], &mut rest[..m]);
            }
        }
        for i in (0..n).rev() {
            let (front, done) = work.split_at_mut((i + 1) * m);
            let row = &mut front[i * m..];
            for j in i + 1..n {
                axpy(-self.a[i * n + j], &done[(j - i - 1) * m..(j - i) * m], row);
            }
            let pivot = self.a[i * n + i];
            for v in row.iter_mut() {
                *v /= pivot;
            }
        }
        b[..n * m].copy_from_slice(&work[..n * m]);
    }

    /// Replaces the right-hand side by the solution of the transposed system.
    pub(crate) fn solve_transposed(&mut self, b: &mut [f64]) {
        let n = self.n;
        self.y.clear();
        self.y.extend_from_slice(&b[..n]);
        let y = &mut self.y;
        for i in 0..n {
            y[i] /= self.a[i * n + i];
            let v = y[i];
            let row = &self.a[i * n..(i + 1) * n];
            y[i + 1..].iter_mut().zip(&row[i + 1..]).for_each(|(y, u)| *y -= u * v);
        }
        for i in (0..n).rev() {
            let v = y[i];
            let row = &self.a[i * n..i * n + i];
            y[..i].iter_mut().zip(row).for_each(|(y, l)| *y -= l * v);
        }
        for (i, &p) in self.perm.iter().enumerate() {
            b[p] = self.y[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_badly_scaled_rows_and_finds_singular_matrices() {
        let mut lu = Lu::<f64>::with_capacity(3);
        let a = [0.0, 2e8, 1e8, 1e-8, 0.0, 3e-8, 1.0, 1.0, 1.0];
        let x = [1.0, -2.0, 3.0];
        lu.clear(3).copy_from_slice(&a);
        assert!(lu.factorise());
        let mut b: Vec<f64> = (0..3).map(|i| (0..3).map(|j| a[3 * i + j] * x[j]).sum()).collect();
        lu.solve(&mut b);
        assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
        lu.clear(2).copy_from_slice(&[1.0, 2.0, 2.0, 4.0]);
        assert!(!lu.factorise());
        lu.clear(1)[0] = f64::NAN;
        assert!(!lu.factorise());
    }

    #[test]
    fn solves_transposed_systems() {
        let mut lu = Lu::<f64>::with_capacity(3);
        let a = [0.0, 2.0, 1.0, -1.0, 0.5, 3.0, 4.0, 1.0, 1.0];
        let x = [1.0, -2.0, 3.0];
        lu.clear(3).copy_from_slice(&a);
        assert!(lu.factorise());
        let mut b: Vec<f64> = (0..3).map(|j| (0..3).map(|i| a[3 * i + j] * x[i]).sum()).collect();
        lu.solve_transposed(&mut b);
        assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
    }

    #[test]
    fn solves_several_right_hand_sides_at_once() {
        let (n, m) = (5, 3);
        let mut lu = Lu::<f64>::with_capacity(n);
        let wave = |k: usize| (1.7 * k as f64 + 0.4).sin();
        // waves alone have rank two
        let entry = |k: usize| wave(k) + if k % (n + 1) == 0 { 2.0 } else { 0.0 };
        lu.clear(n).iter_mut().enumerate().for_each(|(k, v)| *v = entry(k));
        assert!(lu.factorise());
        let b: Vec<f64> = (0..n * m).map(|k| wave(k + 100)).collect();
        let (mut block, mut work) = (b.clone(), vec![0.0; n * m]);
        lu.solve_block(m, &mut block, &mut work);
        for c in 0..m {
            let mut column: Vec<f64> = (0..n).map(|r| b[r * m + c]).collect();
            lu.solve(&mut column);
            assert!((0..n).all(|r| (column[r] - block[r * m + c]).abs() < 1e-12 * (1.0 + column[r].abs())));
        }
    }

    #[test]
    fn solves_complex_systems() {
        let i = Complex::new(0.0, 1.0);
        let one = Complex::new(1.0, 0.0);
        let mut lu = Lu::with_capacity(2);
        lu.clear(2).copy_from_slice(&[i, one, one, i + i]);
        assert!(lu.factorise());
        let mut b = [i * one + one * i, one + (i + i) * i];
        lu.solve(&mut b);
        assert!((b[0] - one).size() < 1e-15 && (b[1] - i).size() < 1e-15);
    }
}
