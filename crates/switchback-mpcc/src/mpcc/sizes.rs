//! Sizes of variables that a program shows by itself, for users whose variables are in units far from each other.
//!
//! In fitting units the terms of a row are of one size: factors `2^{r_i}` of rows and sizes `2^{c_j}` of variables make the logarithms of
//! `2^{r_i} |J_ij| 2^{c_j}` smallest in the least squares (A. R. Curtis, J. K. Reid, J. Inst. Math. Appl. 10, 1972, 118-124), the gradient of
//! the objective being one more row. Constant terms of rows are entries of a column of size one. Multiplied variables and rows then have
//! multiplied sizes and factors, whatever units they are in. The start says nothing: entries of one that was an answer before may be tiny.
//!
//! Units that people choose are mostly good, and better than what gradients at one point tell. So these sizes are for programs whose variables
//! are in units that are far apart ([`MIXED`]). Single variables that are far off are left alone: derivatives that are small by chance look
//! the same.

use crate::linalg::csc::Pattern;
use crate::nlp::{Bounds, INFINITE};

/// Mean distance of the exponents of two in a row from their median, from which units are mixed: a factor of eleven.
const MIXED: f64 = 3.5;
/// Largest exponent: what is beyond comes from derivatives that vanish at the point by chance.
const MAX_EXPONENT: f64 = 30.0;
/// An entry that is as good as none, relative to the largest one of its row.
const NO_ENTRY: f64 = 1e-14;
/// Sweeps of Gauss and Seidel at most, and the change of exponents that is none.
const SWEEPS: usize = 50;
const SETTLED: f64 = 0.02;
/// A constant that is rounding, relative to the terms it is left from.
const ROUNDING: f64 = 1e-10;

/// Values and derivatives at a point, not scaled.
#[derive(Debug)]
pub(super) struct Terms<'a> {
    /// First derivatives of the rows.
    pub jac: (&'a Pattern, &'a [f64]),
    /// Gradient of the objective.
    pub grad: &'a [f64],
    /// Values of the rows.
    pub c: &'a [f64],
    /// The point.
    pub x: &'a [f64],
    /// Bounds of rows and variables.
    pub bounds: &'a Bounds,
}

/// Writes the sizes of variables, powers of two; 1 where their units are good. Variables with `lifted` are left out.
pub(super) fn choose(t: &Terms, lifted: &[bool], sizes: &mut [f64]) {
    let entries = entries(t, lifted);
    if spread(&entries) > MIXED {
        let e = exponents(t, &entries);
        for (size, e) in sizes.iter_mut().zip(&e).filter(|(_, e)| !e.is_nan()) {
            *size = e.round().clamp(-MAX_EXPONENT, MAX_EXPONENT).exp2();
        }
    }
}

/// An entry of the first derivatives: row, column, and the logarithm to base two of its size.
type Entry = (usize, usize, f64);

/// Those of the rows, and of the objective after them, sorted by rows.
fn entries(t: &Terms, lifted: &[bool]) -> Vec<Entry> {
    let (jac, values) = t.jac;
    let (n, m) = (t.grad.len(), t.c.len());
    let mut least = vec![0f64; m];
    for (&i, v) in jac.row_idx().iter().zip(values).filter(|(i, _)| **i < m) {
        least[i] = least[i].max(NO_ENTRY * v.abs());
    }
    let mut entries: Vec<Entry> = Vec::with_capacity(values.len() + n);
    for j in (0..n).filter(|&j| !lifted[j]) {
        let column = jac.rows(j).iter().zip(&values[jac.range(j)]).filter(|(i, v)| **i < m && v.abs() > least[**i]);
        entries.extend(column.filter_map(|(&i, &v)| log(v).map(|l| (i, j, l))));
        entries.extend(log(t.grad[j]).map(|l| (m, j, l)));
    }
    entries.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.2.total_cmp(&b.2)));
    entries
}

/// How far the entries of a row are apart, in the mean: the distance from their median. Rows with one entry say nothing.
fn spread(entries: &[Entry]) -> f64 {
    let mut apart = Mean::default();
    for row in entries.chunk_by(|a, b| a.0 == b.0).filter(|row| row.len() > 1) {
        let middle = 0.5 * (row[(row.len() - 1) / 2].2 + row[row.len() / 2].2);
        row.iter().for_each(|e| apart.add((e.2 - middle).abs()));
    }
    apart.value()
}

/// The logarithm to base two of the size of a number, unless that is nothing or none.
fn log(v: f64) -> Option<f64> {
    (v != 0.0 && v.is_finite()).then(|| v.abs().log2())
}

/// A sum of logarithms, and how many there are.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, v: f64) {
        self.sum += v;
        self.count += 1;
    }

    fn value(self) -> f64 {
        if self.count > 0 {
            self.sum / self.count as f64
        } else {
            0.0
        }
    }
}

/// Exponents of two of the sizes, by least squares; NaN of variables that occur nowhere, or are left out.
fn exponents(t: &Terms, entries: &[Entry]) -> Vec<f64> {
    let (n, m) = (t.grad.len(), t.c.len());
    let mut rows = constants(t);
    rows.push(Mean::default());
    let (mut r, mut c) = (vec![Mean::default(); m + 1], vec![0.0; n]);
    let mut sums = vec![Mean::default(); n];
    for _ in 0..SWEEPS {
        r.copy_from_slice(&rows);
        for &(i, j, l) in entries {
            r[i].add(-l - c[j]);
        }
        sums.fill(Mean::default());
        for &(i, j, l) in entries {
            sums[j].add(-l - r[i].value());
        }
        let mut change = 0f64;
        for (c, s) in c.iter_mut().zip(&sums) {
            change = change.max((s.value() - *c).abs());
            *c = s.value();
        }
        if change < SETTLED {
            break;
        }
    }
    for (c, s) in c.iter_mut().zip(&sums) {
        if s.count == 0 {
            *c = f64::NAN;
        }
    }
    c
}

/// Logarithms, with the sign that makes them those of factors, of what the linearised rows have besides terms with variables.
fn constants(t: &Terms) -> Vec<Mean> {
    let (jac, values) = t.jac;
    let mut sums: Vec<(f64, f64)> = t.c.iter().map(|c| (*c, c.abs())).collect();
    for j in 0..jac.n_cols().min(t.x.len()) {
        for (&i, &v) in jac.rows(j).iter().zip(&values[jac.range(j)]) {
            if let Some(s) = sums.get_mut(i) {
                s.0 -= v * t.x[j];
                s.1 += (v * t.x[j]).abs();
            }
        }
    }
    let mut out = vec![Mean::default(); sums.len()];
    for (i, (sum, size)) in sums.into_iter().enumerate() {
        let finite = [t.bounds.cl[i], t.bounds.cu[i]].into_iter().find(|b| b.abs() < INFINITE);
        let bound = finite.unwrap_or(0.0);
        let constant = sum - bound;
        if constant.abs() > ROUNDING * (size + bound.abs()) {
            if let Some(l) = log(constant) {
                out[i].add(-l);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sizes of `x + y = 3`, `y = z` at `(1, 2, 2)`, variables and rows multiplied by powers of two.
    fn sizes(variables: [i32; 3], rows: [i32; 2]) -> [f64; 3] {
        let up = |e: i32| f64::from(e).exp2();
        let (jac, _) = Pattern::from_triplets(2, 3, &[0, 0, 1, 1], &[0, 1, 1, 2]);
        let entry = |i: usize, j: usize| up(rows[i] - variables[j]);
        let values = [entry(0, 0), entry(0, 1), entry(1, 1), -entry(1, 2)];
        let x = [0, 1, 2].map(|j| up(variables[j] + i32::from(j > 0)));
        let mut bounds = Bounds::free(3, 2);
        (bounds.cl[0], bounds.cu[0]) = (3.0 * up(rows[0]), 3.0 * up(rows[0]));
        (bounds.cl[1], bounds.cu[1]) = (0.0, 0.0);
        let c = [3.0 * up(rows[0]), 0.0];
        let mut sizes = [1.0; 3];
        choose(
            &Terms { jac: (&jac, &values), grad: &[0.0; 3], c: &c, x: &x, bounds: &bounds },
            &[false; 3],
            &mut sizes,
        );
        sizes
    }

    /// Good units stay as they are, in whatever units rows are. Mixed ones are found, up to rounding to powers of two.
    #[test]
    fn sizes_are_those_of_the_units() {
        assert_eq!(sizes([0; 3], [0; 2]), [1.0; 3]);
        assert_eq!(sizes([1, 2, -2], [20, -20]), [1.0; 3]);
        let some = sizes([-10, 12, 0], [0, 9]);
        assert!(some[0] < 0.01 && some[1] > 1e3 && (0.1..10.0).contains(&some[2]), "{some:?}");
        let others = sizes([-13, 15, 2], [-7, 0]);
        for (j, factor) in [0.125, 8.0, 4.0].into_iter().enumerate() {
            assert!((0.5..=2.0).contains(&(others[j] / some[j] / factor)), "{others:?} {some:?}");
        }
    }
}
