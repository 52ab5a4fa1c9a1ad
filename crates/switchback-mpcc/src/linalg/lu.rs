//! Dense LU factorisations in place, real and complex, without allocation after the first use.

use super::dense::{axpy, dot, gemm, Left, Mode, Right};
use nalgebra::Complex;
use std::ops::{Add, Div, Mul, Sub};

/// A field with a size to pivot by.
pub trait Scalar:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Modulus.
    fn size(self) -> f64;
    /// `C -= A B` for `sizes` m, n, k: `m × k` entries of `a` and `m × n` of `c` column-major with their leading dimensions, the `k × n` of
    /// `b` row-major with its own.
    fn subtract_product(sizes: [usize; 3], a: (&[Self], usize), b: (&[Self], usize), c: &mut [Self], ld: usize);
    /// Scalar product.
    fn dot(a: &[Self], b: &[Self]) -> Self;
}

impl Scalar for f64 {
    #[inline]
    fn size(self) -> f64 {
        self.abs()
    }

    fn subtract_product(sizes: [usize; 3], a: (&[f64], usize), b: (&[f64], usize), c: &mut [f64], ld: usize) {
        gemm(sizes, Left { v: a.0, ld: a.1 }, Right { v: b.0, rs: b.1, cs: 1 }, c, ld, Mode::Subtract);
    }

    #[inline]
    fn dot(a: &[f64], b: &[f64]) -> f64 {
        dot(a, b)
    }
}

impl Scalar for Complex<f64> {
    #[inline]
    fn size(self) -> f64 {
        self.re.abs() + self.im.abs()
    }

    fn subtract_product([m, n, k]: [usize; 3], a: (&[Self], usize), b: (&[Self], usize), c: &mut [Self], ld: usize) {
        for j in 0..n {
            for l in 0..k {
                let f = b.0[l * b.1 + j];
                c[j * ld..j * ld + m].iter_mut().zip(&a.0[l * a.1..]).for_each(|(c, a)| *c -= f * *a);
            }
        }
    }

    fn dot(a: &[Self], b: &[Self]) -> Self {
        a.iter().zip(b).fold(Self::default(), |s, (a, b)| s + *a * *b)
    }
}

/// The row with the largest pivot among some; `None` if all are tiny.
#[inline]
fn pivot(mut rows: std::ops::Range<usize>, size: impl Fn(usize) -> f64) -> Option<usize> {
    let mut best = rows.next()?;
    let mut largest = size(best);
    for i in rows {
        let s = size(i);
        if s > largest {
            (best, largest) = (i, s);
        }
    }
    // NaN fails too
    (largest > 1e-14).then_some(best)
}

/// Columns that are eliminated together.
const PANEL: usize = 8;
/// Rows of right-hand sides that are solved for together.
const ROWS: usize = 4;
/// Right-hand sides lie in rows of multiples of this length.
const LANES: usize = 8;

/// Numbers that [`Lu::solve_block`] needs for `m` right-hand sides of `n` entries.
pub fn block_work(n: usize, m: usize) -> usize {
    n * m.next_multiple_of(LANES)
}

/// Factors of a square matrix, row-major, with row pivoting relative to the size of the rows.
#[derive(Debug, Default)]
pub struct Lu<T> {
    n: usize,
    a: Vec<T>,
    perm: Vec<usize>,
    scale: Vec<f64>,
    y: Vec<T>,
    /// Factors of a panel, for orders that have more than one.
    panel: Vec<T>,
}

impl<T: Scalar> Lu<T> {
    /// With room for matrices up to `n × n`.
    pub fn with_capacity(n: usize) -> Lu<T> {
        Lu {
            n: 0,
            a: Vec::with_capacity(n * n),
            perm: Vec::with_capacity(n),
            scale: Vec::with_capacity(n),
            y: Vec::with_capacity(n),
            panel: Vec::with_capacity(n * PANEL),
        }
    }

    /// A zero matrix of order `n` to write to.
    #[inline]
    pub fn clear(&mut self, n: usize) -> &mut [T] {
        self.n = n;
        self.a.clear();
        self.a.resize(n * n, T::default());
        &mut self.a
    }

    /// The matrix, to write to before it is factorised.
    #[inline]
    pub fn matrix(&mut self) -> &mut [T] {
        &mut self.a
    }

    /// Adds to an entry, by its place in the row-major matrix.
    #[inline]
    pub fn add(&mut self, at: usize, v: T) {
        self.a[at] = self.a[at] + v;
    }

    /// Factorises what was written; false if the matrix is singular to rounding.
    pub fn factorise(&mut self) -> bool {
        self.factorise_sized(|_| 1.0)
    }

    /// The same where the unknowns have sizes: pivots are chosen, and the matrix is called singular, as if every unknown
    /// were measured in units of its size.
    pub fn factorise_sized(&mut self, unknown: impl Fn(usize) -> f64) -> bool {
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
        if n >= 2 * PANEL {
            return self.factorise_panels(&unknown);
        }
        (0..n).all(|k| {
            let size = |i: usize| self.a[i * n + k].size() * self.scale[i] * unknown(k);
            let Some(best) = pivot(k..n, size) else { return false };
            self.exchange(k, best);
            let (top, bottom) = self.a.split_at_mut((k + 1) * n);
            let pivot = &top[k * n..];
            for row in bottom.chunks_exact_mut(n) {
                let l = row[k] / pivot[k];
                row[k] = l;
                for (r, p) in row[k + 1..].iter_mut().zip(&pivot[k + 1..]) {
                    *r = *r - l * *p;
                }
            }
            true
        })
    }

    /// The same, some columns at a time: these lie behind each other while they are eliminated.
    fn factorise_panels(&mut self, unknown: impl Fn(usize) -> f64) -> bool {
        let n = self.n;
        for from in (0..n).step_by(PANEL) {
            let (to, ld) = ((from + PANEL).min(n), n - from);
            self.panel.resize(ld * (to - from), T::default());
            for (i, row) in self.a[from * n..].chunks_exact(n).enumerate() {
                row[from..to].iter().enumerate().for_each(|(j, v)| self.panel[i + j * ld] = *v);
            }
            for k in 0..to - from {
                let scale = &self.scale[from..];
                let size = |i: usize| self.panel[i + k * ld].size() * scale[i] * unknown(from + k);
                let Some(best) = pivot(k..ld, size) else { return false };
                if best != k {
                    self.panel.chunks_exact_mut(ld).for_each(|column| column.swap(k, best));
                    self.exchange(from + k, from + best);
                }
                let (front, behind) = self.panel.split_at_mut((k + 1) * ld);
                let column = &mut front[k * ld + k..];
                let pivot = column[0];
                column[1..].iter_mut().for_each(|v| *v = *v / pivot);
                for other in behind.chunks_exact_mut(ld) {
                    let (head, rest) = other[k..].split_at_mut(1);
                    let u = head[0];
                    rest.iter_mut().zip(&column[1..]).for_each(|(v, l)| *v = *v - *l * u);
                }
            }
            for (i, row) in self.a[from * n..].chunks_exact_mut(n).enumerate() {
                row[from..to].iter_mut().enumerate().for_each(|(j, v)| *v = self.panel[i + j * ld]);
            }
            if to < n {
                self.update(from, to);
            }
        }
        true
    }

    /// Exchanges two rows.
    fn exchange(&mut self, k: usize, best: usize) {
        if best == k {
            return;
        }
        let n = self.n;
        let (front, back) = self.a.split_at_mut(best * n);
        front[k * n..(k + 1) * n].swap_with_slice(&mut back[..n]);
        self.perm.swap(k, best);
        self.scale.swap(k, best);
    }

    /// What the columns `from` to `to`, which are done and in the panel, take from those behind.
    fn update(&mut self, from: usize, to: usize) {
        let (n, k) = (self.n, to - from);
        for r in from + 1..to {
            let (above, row) = self.a.split_at_mut(r * n);
            let (factors, row) = row[..n].split_at_mut(to);
            for j in from..r {
                let l = factors[j];
                row.iter_mut().zip(&above[j * n + to..(j + 1) * n]).for_each(|(v, u)| *v = *v - l * *u);
            }
        }
        let (top, bottom) = self.a.split_at_mut(to * n);
        // rows are the columns of the transposed matrices
        let (left, right) = ((&top[from * n + to..], n), (&self.panel[k..], n - from));
        T::subtract_product([n - to, n - to, k], left, right, &mut bottom[to..], n);
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&mut self, b: &mut [T]) {
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
        if n >= 2 * PANEL {
            for i in 0..n {
                y[i] = y[i] - T::dot(&self.a[i * n..i * n + i], y);
            }
            for i in (0..n).rev() {
                let row = &self.a[i * n..(i + 1) * n];
                y[i] = (y[i] - T::dot(&row[i + 1..], &y[i + 1..])) / row[i];
            }
            b[..n].copy_from_slice(y);
            return;
        }
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
    /// Is the determinant of what was factorised negative?
    pub fn is_determinant_negative(&self) -> bool {
        let n = self.n;
        let mut negative = (0..n).filter(|&i| self.a[i * n + i] < 0.0).count() % 2 == 1;
        // the parity of the exchanges: a cycle of length `l` takes `l - 1` of them
        let mut seen = vec![false; n];
        for i in 0..n {
            let mut at = i;
            while !seen[at] {
                seen[at] = true;
                at = self.perm[at];
                negative ^= !seen[at];
            }
        }
        negative
    }

    /// Replaces `m` right-hand sides by their solutions: `b` is row-major, `n × m`; `work` has [`block_work`] numbers.
    pub fn solve_block(&self, m: usize, b: &mut [f64], work: &mut [f64]) {
        let (n, ld) = (self.n, m.next_multiple_of(LANES));
        let work = &mut work[..n * ld];
        for (to, &from) in work.chunks_exact_mut(ld).zip(&self.perm) {
            to[..m].copy_from_slice(&b[from * m..(from + 1) * m]);
            to[m..].fill(0.0);
        }
        for i in (0..n).step_by(ROWS) {
            let end = (i + ROWS).min(n);
            let (done, own) = work.split_at_mut(i * ld);
            self.reduce([i, end, 0, i], done, own, ld);
            for r in i + 1..end {
                let (above, row) = own.split_at_mut((r - i) * ld);
                let rows = above.chunks_exact(ld);
                rows.zip(&self.a[r * n + i..]).for_each(|(v, f)| axpy(-f, v, &mut row[..ld]));
            }
        }
        for i in (0..n).step_by(ROWS).rev() {
            let end = (i + ROWS).min(n);
            let (front, done) = work.split_at_mut(end * ld);
            let own = &mut front[i * ld..];
            self.reduce([i, end, end, n], done, own, ld);
            for r in (i..end).rev() {
                let (row, below) = own[(r - i) * ld..].split_at_mut(ld);
                let rows = below.chunks_exact(ld);
                rows.zip(&self.a[r * n + r + 1..]).for_each(|(v, f)| axpy(-f, v, row));
                let inverse = 1.0 / self.a[r * n + r];
                row.iter_mut().for_each(|v| *v *= inverse);
            }
        }
        b[..n * m].chunks_exact_mut(m).zip(work.chunks_exact(ld)).for_each(|(b, row)| b.copy_from_slice(&row[..m]));
    }

    /// Rows `i` to `end` of right-hand sides minus what rows `from` to `to`, which are done, take from them.
    fn reduce(&self, [i, end, from, to]: [usize; 4], done: &[f64], own: &mut [f64], ld: usize) {
        if from < to {
            // rows are the columns of the transposed matrices
            let factors = Right { v: &self.a[i * self.n + from..], rs: 1, cs: self.n };
            gemm([ld, end - i, to - from], Left { v: done, ld }, factors, own, ld, Mode::Subtract);
        }
    }

    /// Replaces the right-hand side by the solution of the transposed system.
    pub fn solve_transposed(&mut self, b: &mut [f64]) {
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
        for (n, m) in [(5, 3), (4, 4), (9, 8), (11, 19), (1, 1), (34, 21)] {
            several_right_hand_sides(n, m);
        }
    }

    fn several_right_hand_sides(n: usize, m: usize) {
        let mut lu = Lu::<f64>::with_capacity(n);
        let wave = |k: usize| (1.7 * k as f64 + 0.4).sin();
        // waves alone have rank two
        let entry = |k: usize| wave(k) + if k % (n + 1) == 0 { 2.0 } else { 0.0 };
        lu.clear(n).iter_mut().enumerate().for_each(|(k, v)| *v = entry(k));
        assert!(lu.factorise());
        let b: Vec<f64> = (0..n * m).map(|k| wave(k + 100)).collect();
        let (mut block, mut work) = (b.clone(), vec![0.0; block_work(n, m)]);
        lu.solve_block(m, &mut block, &mut work);
        for c in 0..m {
            let mut column: Vec<f64> = (0..n).map(|r| b[r * m + c]).collect();
            lu.solve(&mut column);
            assert!((0..n).all(|r| (column[r] - block[r * m + c]).abs() < 1e-12 * (1.0 + column[r].abs())));
        }
    }

    /// `P A = L U` to rounding, with panels and without, for both fields.
    #[test]
    fn factors_give_the_matrix_back() {
        fn gap<T: Scalar>(lu: &mut Lu<T>, a: &[T], n: usize) -> f64 {
            lu.clear(n).copy_from_slice(a);
            assert!(lu.factorise());
            let mut worst = 0.0f64;
            for (i, &from) in lu.perm.iter().enumerate() {
                for j in 0..n {
                    let mut v = a[from * n + j];
                    for k in 0..=i.min(j) {
                        let u = lu.a[k * n + j];
                        v = v - if k == i { u } else { lu.a[i * n + k] * u };
                    }
                    worst = worst.max(v.size());
                }
            }
            worst
        }
        for n in [3, 15, 16, 17, 29, 40] {
            let a: Vec<f64> = (0..n * n).map(|k| ((k * k + 3 * k) as f64 * 0.37).sin()).collect();
            let own = gap(&mut Lu::with_capacity(n), &a, n);
            let turned: Vec<_> = a.iter().map(|a| Complex::new(0.6, 0.8) * a).collect();
            let complex = gap(&mut Lu::with_capacity(n), &turned, n);
            assert!(own.max(complex) <= 1e-13, "order {n}: {own:e} {complex:e}");
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
