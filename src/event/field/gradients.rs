//! Gradients of all that is watched, as compressed rows: what a function does not depend on costs nothing.

use super::Field;
use crate::func::{Dims, EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::system::SharedFunction;

/// Which inputs the watched functions depend on. Inputs are numbered `x`, `p`, `u`, `t`; those of a row ascend.
#[derive(Debug, Default)]
pub(in crate::event) struct Gradients {
    nx: usize,
    /// Number of inputs.
    n_z: usize,
    /// Where the rows begin; one place more than there are rows.
    begin: Vec<usize>,
    columns: Vec<usize>,
    /// How many inputs of a row are states, and whether its last one is time.
    states: Vec<(usize, bool)>,
}

/// The gradient of one function.
#[derive(Debug, Clone, Copy)]
pub(in crate::event) struct Row<'a> {
    /// Columns and values of the derivatives with respect to the state.
    pub(in crate::event) columns: &'a [usize],
    pub(in crate::event) values: &'a [f64],
    /// Columns and values of all derivatives.
    pub(in crate::event) all: (&'a [usize], &'a [f64]),
    /// Derivative with respect to time.
    pub(in crate::event) t: f64,
}

impl Row<'_> {
    /// Derivatives with respect to states, with their places.
    #[inline]
    pub(in crate::event) fn states(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.columns.iter().copied().zip(self.values.iter().copied())
    }

    /// Derivatives with respect to all inputs, with their places.
    pub(in crate::event) fn inputs(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.all.0.iter().copied().zip(self.all.1.iter().copied())
    }

    /// Rate of change for a velocity.
    #[inline]
    pub(in crate::event) fn along(&self, velocity: &[f64]) -> f64 {
        self.states().map(|(i, g)| g * velocity[i]).sum::<f64>() + self.t
    }
}

impl Gradients {
    pub(super) fn new(dims: &Dims) -> Gradients {
        Gradients { nx: dims.x, n_z: dims.x + dims.p + dims.u + 1, begin: vec![0], ..Gradients::default() }
    }

    /// Adds the rows of a function with the Jacobian pattern `p`; returns where the entries of its Jacobian go.
    pub(in crate::event) fn push(&mut self, p: &Pattern, dims: &Dims) -> Vec<usize> {
        let column = super::Columns { nx: dims.x, nu: dims.u, np: dims.p };
        let first = self.columns.len();
        let mut entries: Vec<(usize, usize, usize)> = p
            .columns()
            .flat_map(|(c, own)| own.map(move |k| (c, k)))
            .map(|(c, k)| (p.row_idx()[k], column.of(c), k))
            .collect();
        entries.sort_unstable();
        let mut map = vec![0; p.nnz()];
        let mut row = 0;
        for (i, &(r, c, k)) in entries.iter().enumerate() {
            self.begin.resize(self.begin.len() + r - row, first + i);
            row = r;
            map[k] = first + i;
            self.columns.push(c);
        }
        self.begin.resize(self.begin.len() + p.n_rows() - row, self.columns.len());
        for w in self.begin.windows(2).skip(self.states.len()) {
            let own = &self.columns[w[0]..w[1]];
            self.states.push((own.partition_point(|c| *c < self.nx), own.last() == Some(&(self.n_z - 1))));
        }
        map
    }

    /// Number of entries of all rows.
    pub(in crate::event) fn len(&self) -> usize {
        self.columns.len()
    }

    /// Places of the entries of row `j`, and their columns.
    pub(super) fn entries(&self, j: usize) -> (std::ops::Range<usize>, &[usize]) {
        let range = self.begin[j]..self.begin[j + 1];
        (range.clone(), &self.columns[range])
    }

    /// The states that function `j` depends on.
    pub(in crate::event) fn states_of(&self, j: usize) -> &[usize] {
        let from = self.begin[j];
        &self.columns[from..from + self.states[j].0]
    }

    /// Row `j` of the gradients with the entries `values`.
    #[inline]
    pub(in crate::event) fn row<'a>(&'a self, values: &'a [f64], j: usize) -> Row<'a> {
        let (from, to) = (self.begin[j], self.begin[j + 1]);
        let (columns, values) = (&self.columns[from..to], &values[from..to]);
        let (n, timed) = self.states[j];
        let t = if timed { values[values.len() - 1] } else { 0.0 };
        Row { columns: &columns[..n], values: &values[..n], all: (columns, values), t }
    }
}

impl Field {
    /// Gradients of the indicators of all subsystems.
    pub(super) fn gradients_at(&mut self, t: f64, x: &[f64]) -> EvalResult {
        let at = Point { t, x, u: &self.u, p: &self.p };
        for s in &self.subs {
            scatter(&s.indicators, &at, &s.to_dq, &mut self.dq, (&mut self.buffer, &mut self.work))?;
        }
        Ok(())
    }

    /// Gradients where states are zero and a formula has no value there, as that of `|x| sqrt |x|`: what it tends to from one of
    /// the sides, if it does not grow on the way.
    #[cold]
    pub(super) fn gradients_beside(&mut self, t: f64, x: &[f64]) -> EvalResult {
        /// Distances from zero relative to the sizes of the states.
        const DISTANCES: [f64; 2] = [16.0 * f64::EPSILON, f64::EPSILON];
        let beside = |part: f64| -> Vec<f64> {
            let each = x.iter().zip(&self.floor);
            each.map(|(x, s)| if *x == 0.0 { part.signum() * (part.abs() * s).max(f64::MIN_POSITIVE) } else { *x })
                .collect()
        };
        if !x.contains(&0.0) {
            return Err(EvalError::Recoverable);
        }
        let points = [1.0, -1.0].map(|side| DISTANCES.map(|d| beside(side * d)));
        for s in &self.subs {
            let pattern = s.indicators.jac_pattern();
            let entries: Vec<usize> = (0..pattern.n_cols()).flat_map(|c| pattern.range(c)).collect();
            let mut ends = [vec![0.0; entries.len()], vec![0.0; entries.len()]];
            for row in 0..s.n_q {
                let own = || entries.iter().filter(|k| pattern.row_idx()[**k] == row);
                let found = points.iter().any(|sides| {
                    let known = sides.iter().zip(&mut ends).all(|(x, end)| {
                        let at = Point { t, x, u: &self.u, p: &self.p };
                        s.indicators.jacobian_rows(&at, row..row + 1, end, &mut self.work).is_ok()
                    });
                    let tends = |k: &usize| ends[1][*k].abs() <= (1.0 + f64::EPSILON.sqrt()) * ends[0][*k].abs();
                    known && own().all(tends)
                });
                if !found {
                    return Err(EvalError::Recoverable);
                }
                own().for_each(|k| self.dq[s.to_dq[*k]] = ends[1][*k]);
            }
        }
        Ok(())
    }
}

/// Writes the Jacobian of a function to the places of `map` in `out`; entries outside of its pattern stay as they are.
pub(in crate::event) fn scatter(
    f: &SharedFunction,
    at: &Point,
    map: &[usize],
    out: &mut [f64],
    (buffer, work): (&mut [f64], &mut [f64]),
) -> EvalResult {
    if map.is_empty() {
        return Ok(());
    }
    f.jacobian(at, &mut buffer[..map.len()], work)?;
    map.iter().zip(buffer).for_each(|(to, v)| out[*to] = *v);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_two_functions_have_their_columns_in_order() {
        let dims = Dims { x: 2, u: 1, p: 1 };
        let mut g = Gradients::new(&dims);
        // columns of a pattern: x0 x1 u p t
        let first = g.push(&Pattern::from_triplets(3, 5, &[2, 2, 0], &[2, 1, 4]).0, &dims);
        let second = g.push(&Pattern::from_triplets(1, 5, &[0, 0], &[0, 3]).0, &dims);
        assert_eq!(g.len(), 5);
        let mut values = vec![0.0; 5];
        // in the order of the columns of the patterns
        for (to, v) in first.iter().zip([1.0, 2.0, 3.0]).chain(second.iter().zip([4.0, 5.0])) {
            values[*to] = v;
        }
        let row = |j| g.row(&values, j).inputs().collect::<Vec<_>>();
        assert_eq!(row(0), [(4, 3.0)]);
        assert!(row(1).is_empty());
        assert_eq!(row(2), [(1, 1.0), (3, 2.0)]);
        assert_eq!(row(3), [(0, 4.0), (2, 5.0)]);
        assert_eq!(g.row(&values, 0).t, 3.0);
        assert_eq!(g.row(&values, 2).along(&[7.0, 10.0]), 10.0);
        assert_eq!(g.row(&values, 2).states().collect::<Vec<_>>(), [(1, 1.0)]);
    }
}
