//! Gordan's alternative as a linear program, in any arithmetic.
//!
//! Given columns `c_j ∈ Rᵐ`, some of them marked: either a combination `Σ y_j c_j = 0` with `y ≥ 0` has weight one on the
//! marked columns, or some `v` has `c_j·v > 0` for the marked and `c_j·v ≥ 0` for the other columns, never both (the
//! transposition theorem of Motzkin). Phase one of the simplex method finds one of the two.
//!
//! In rational arithmetic the answer is a proof. In floating point it is a proposal: quick, and to be checked.

use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

use crate::stop;

/// What the simplex method needs of a number.
pub(super) trait Number: Clone + PartialOrd + Zero + One {
    /// More than zero; in floating point more than the rounding of numbers of size one.
    fn is_clearly_positive(&self) -> bool;
    fn plus(&self, other: &Self) -> Self;
    fn negated(&self) -> Self;
    fn over(&self, other: &Self) -> Self;
    /// `self −= a b`
    fn subtract_product(&mut self, a: &Self, b: &Self);
}

impl Number for f64 {
    fn is_clearly_positive(&self) -> bool {
        // The columns are scaled to entries up to one. What is less is rounding, or is left to exact arithmetic.
        *self > 1e-9
    }
    fn plus(&self, other: &f64) -> f64 {
        self + other
    }
    fn negated(&self) -> f64 {
        -self
    }
    fn over(&self, other: &f64) -> f64 {
        self / other
    }
    fn subtract_product(&mut self, a: &f64, b: &f64) {
        *self -= a * b;
    }
}

impl Number for BigRational {
    fn is_clearly_positive(&self) -> bool {
        self.is_positive()
    }
    fn plus(&self, other: &BigRational) -> BigRational {
        self + other
    }
    fn negated(&self) -> BigRational {
        -self
    }
    fn over(&self, other: &BigRational) -> BigRational {
        self / other
    }
    fn subtract_product(&mut self, a: &BigRational, b: &BigRational) {
        if !a.is_zero() && !b.is_zero() {
            *self -= a * b;
        }
    }
}

/// One of the two alternatives.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Alternative<T> {
    /// The factors `y`.
    Combination(Vec<T>),
    /// The direction `v`.
    Separation(Vec<T>),
}

/// Decides between the alternatives for `columns` of length `m` that are marked or not. Bland's rule ends in exact
/// arithmetic; `None` where it takes more than `limit` exchanges, or the call is to end.
pub(super) fn alternative<T: Number>(columns: &[(Vec<T>, bool)], m: usize, limit: usize) -> Option<Alternative<T>> {
    let (n, rows) = (columns.len(), m + 1);
    // The columns, the artificial ones, the right-hand side; the last row has the reduced costs of the sum of the
    // artificial variables.
    let width = n + rows + 1;
    let mut table = vec![vec![T::zero(); width]; rows + 1];
    for (j, (column, marked)) in columns.iter().enumerate() {
        for (row, v) in table.iter_mut().zip(column) {
            row[j] = v.clone();
        }
        if *marked {
            table[m][j] = T::one();
        }
    }
    for i in 0..rows {
        table[i][n + i] = T::one();
    }
    table[m][width - 1] = T::one();
    for j in (0..n).chain([width - 1]) {
        let mut sum = T::zero();
        for row in &table[..rows] {
            sum = sum.plus(&row[j]);
        }
        table[rows][j] = sum;
    }
    let mut basis: Vec<usize> = (n..n + rows).collect();
    for _ in 0..limit {
        if stop::requested().is_some() {
            return None;
        }
        let Some(enter) = (0..n).find(|&j| table[rows][j].is_clearly_positive()) else {
            return Some(read(&table, &basis, n, rows));
        };
        let mut leave: Option<(usize, T)> = None;
        for i in (0..rows).filter(|&i| table[i][enter].is_clearly_positive()) {
            let ratio = table[i][width - 1].over(&table[i][enter]);
            let better = leave.as_ref().is_none_or(|(l, r)| ratio < *r || (ratio == *r && basis[i] < basis[*l]));
            if better {
                leave = Some((i, ratio));
            }
        }
        let (r, _) = leave?;
        exchange(&mut table, r, enter);
        basis[r] = enter;
    }
    None
}

/// The alternative a final table says: which one depends on whether artificial variables are left.
fn read<T: Number>(table: &[Vec<T>], basis: &[usize], n: usize, rows: usize) -> Alternative<T> {
    let last = n + rows;
    if table[rows][last].is_clearly_positive() {
        // the dual variables are the reduced costs of the artificial ones plus one
        let dual = |i: usize| table[rows][n + i].plus(&T::one());
        return Alternative::Separation((0..rows - 1).map(|i| dual(i).negated()).collect());
    }
    let mut y = vec![T::zero(); n];
    for (row, &j) in table.iter().zip(basis) {
        if j < n {
            y[j] = row[last].clone();
        }
    }
    Alternative::Combination(y)
}

fn exchange<T: Number>(table: &mut [Vec<T>], r: usize, enter: usize) {
    let pivot = table[r][enter].clone();
    for v in table[r].iter_mut().filter(|v| !v.is_zero()) {
        *v = v.over(&pivot);
    }
    let row = table[r].clone();
    for (i, other) in table.iter_mut().enumerate() {
        if i != r && !other[enter].is_zero() {
            let f = other[enter].clone();
            for (v, p) in other.iter_mut().zip(&row).filter(|(_, p)| !p.is_zero()) {
                v.subtract_product(&f, p);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::exact::ratio;

    fn dot(a: &[BigRational], b: &[BigRational]) -> BigRational {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// In exact arithmetic every answer is what it says.
    #[test]
    fn alternatives_are_proofs() {
        let mut seed = 3u64;
        let mut next = move |n: i64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((seed >> 33) as i64) % n
        };
        let mut seen = [0; 2];
        for case in 0..400 {
            let (m, n) = (1 + next(4) as usize, 1 + next(7) as usize);
            let mut columns: Vec<(Vec<BigRational>, bool)> =
                (0..n).map(|_| ((0..m).map(|_| ratio(next(7) - 3, 1 + next(3))).collect(), next(3) > 0)).collect();
            columns[0].1 = true;
            match alternative(&columns, m, 10_000).unwrap() {
                Alternative::Combination(y) => {
                    seen[0] += 1;
                    for i in 0..m {
                        let sum: BigRational = columns.iter().zip(&y).map(|(c, y)| &c.0[i] * y).sum();
                        assert!(sum.is_zero(), "case {case}");
                    }
                    let weight: BigRational = columns.iter().zip(&y).filter(|c| c.0 .1).map(|c| c.1).sum();
                    assert!(weight.is_one() && y.iter().all(|v| !v.is_negative()), "case {case}");
                }
                Alternative::Separation(v) => {
                    seen[1] += 1;
                    for (c, marked) in &columns {
                        let d = dot(c, &v);
                        assert!(d.is_positive() || (!marked && d.is_zero()), "case {case}");
                    }
                }
            }
        }
        assert!(seen.iter().all(|n| *n > 50), "{seen:?}");
    }

    #[test]
    fn what_takes_too_long_is_left_open() {
        let columns = [(vec![1.0, 2.0], true), (vec![-1.0, -2.0], true)];
        assert!(alternative(&columns, 2, 0).is_none());
        assert!(matches!(alternative(&columns, 2, 100), Some(Alternative::Combination(_))));
    }
}
