//! Orders of elimination, and the permuted matrix a backend factors.

use super::amd;
use crate::error::{Error, Result};
use crate::linalg::csc::Pattern;

/// Order in which a backend eliminates rows and columns; given when it is made.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Ordering {
    /// Approximate minimum degree: little fill, found from the structure alone.
    #[default]
    Amd,
    /// As the matrix comes.
    Natural,
    /// Row `order[k]` is the `k`-th pivot; a permutation of all rows.
    Given(Vec<usize>),
}

impl Ordering {
    /// The order for this upper triangle: `order[k]` is the `k`-th pivot.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a given order is no permutation of the rows; those of AMD
    /// ([`Error::Unsupported`], [`Error::Library`]).
    pub fn order(&self, upper: &Pattern) -> Result<Vec<usize>> {
        let n = upper.n_cols();
        match self {
            Ordering::Amd => amd(upper),
            Ordering::Natural => Ok((0..n).collect()),
            Ordering::Given(order) => {
                let mut seen = vec![false; n];
                let all_new = order.iter().all(|&i| i < n && !std::mem::replace(&mut seen[i], true));
                if order.len() != n || !all_new {
                    return Err(Error::Dimension(format!(
                        "symmetric solver: the given order has {} entries and is no permutation of {n} rows; name each \
                         of 0..{n} once",
                        order.len()
                    )));
                }
                Ok(order.clone())
            }
        }
    }
}

/// Puts every dual row of a KKT matrix (rows from `n_primal` on) behind the last primal variable it holds, and
/// keeps the variables in their order. Where variables are numbered along time, this eliminates along time.
pub fn interleaved(upper: &Pattern, n_primal: usize) -> Vec<usize> {
    let n = upper.n_cols();
    let behind = |row: usize| upper.rows(row).iter().rev().find(|&&i| i < n_primal).map_or(n_primal, |&i| i);
    let mut order: Vec<usize> = (0..n).collect();
    // Stable: a variable goes before its rows, rows behind the same variable keep their order.
    order.sort_by_key(|&k| if k < n_primal { (k, 0) } else { (behind(k), 1) });
    order
}

/// Structure of `P A P'` with the way its values come from those of `A`.
pub(super) struct Permuted {
    /// `order[k]` is the row of `A` that is the `k`-th pivot.
    pub order: Vec<usize>,
    /// Upper triangle of `P A P'`.
    pub upper: Pattern,
    /// Position `k` of `upper` takes the value `src[k]` of `A`.
    pub src: Vec<u32>,
}

impl Permuted {
    /// Permutes the structure of `a`, an upper triangle with fewer than 2^32 entries.
    pub fn new(a: &Pattern, order: Vec<usize>) -> Permuted {
        let n = a.n_cols();
        let mut inv = vec![0usize; n];
        for (k, &i) in order.iter().enumerate() {
            inv[i] = k;
        }
        // By triplets: sorted, and without duplicates since a pattern has none.
        let mut rows = Vec::with_capacity(a.nnz());
        let mut cols = Vec::with_capacity(a.nnz());
        for j in 0..n {
            for &i in a.rows(j) {
                rows.push(inv[i].min(inv[j]));
                cols.push(inv[i].max(inv[j]));
            }
        }
        let (upper, map) = Pattern::from_triplets(n, n, &rows, &cols);
        debug_assert_eq!(upper.nnz(), a.nnz());
        let mut src = vec![0; a.nnz()];
        for (k, &pos) in map.iter().enumerate() {
            src[pos] = k as u32;
        }
        Permuted { order, upper, src }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders() {
        let p = Pattern::dense_upper(3);
        assert_eq!(Ordering::Natural.order(&p).unwrap(), [0, 1, 2]);
        assert_eq!(Ordering::Given(vec![2, 0, 1]).order(&p).unwrap(), [2, 0, 1]);
        let mut found = Ordering::Amd.order(&p).unwrap();
        found.sort_unstable();
        assert_eq!(found, [0, 1, 2]);
        for bad in [vec![0, 1], vec![0, 1, 1], vec![0, 1, 3], vec![0, 1, 2, 0]] {
            let message = Ordering::Given(bad).order(&p).unwrap_err().to_string();
            assert!(message.contains("no permutation of 3 rows"), "{message}");
        }
    }

    #[test]
    fn rows_follow_their_last_variable() {
        // Variables 0..4; row 4 holds 0 and 2, row 5 holds 1, row 6 nothing, row 7 holds 2.
        let entries = [(0, 0), (1, 1), (2, 2), (3, 3), (0, 4), (2, 4), (4, 4), (1, 5), (5, 5), (6, 6), (2, 7), (7, 7)];
        let (rows, cols): (Vec<usize>, Vec<usize>) = entries.iter().copied().unzip();
        let (p, _) = Pattern::from_triplets(8, 8, &rows, &cols);
        assert_eq!(interleaved(&p, 4), [0, 1, 5, 2, 4, 7, 3, 6]);
    }

    #[test]
    fn permuted_values_are_those_of_the_matrix() {
        let (p, _) = Pattern::from_triplets(3, 3, &[0, 1, 2, 0, 1], &[0, 1, 2, 2, 2]);
        let q = Permuted::new(&p, vec![2, 0, 1]);
        // Row and column of every value, back in the numbering of `p`.
        for k in 0..3 {
            for pos in q.upper.range(k) {
                let (i, j) = (q.order[q.upper.row_idx()[pos]], q.order[k]);
                assert_eq!(p.get(i.min(j), i.max(j)), Some(q.src[pos] as usize));
            }
        }
    }
}
