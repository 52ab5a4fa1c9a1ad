//! Complementarity conditions among algebraic equations.
//!
//! ```text
//! 0 ≤ a(x, z, u, p, t) ⊥ b(x, z, u, p, t) ≥ 0
//! ```
//!
//! One of both is zero, and the other one is not negative: `min(a, b) = 0`, an equation with two modes. Linear complementarity systems
//! (A. van der Schaft, J. Schumacher, *Complementarity modeling of hybrid systems*, IEEE Transactions on Automatic Control 43, 1998) have
//! `a = λ` and `b = C x + D λ + F u`.

use std::ops::Range;
use std::sync::Arc;

use super::linear::states;
use super::{Regions, SharedFunction, Subsystem, System};
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// Outputs that are sums of outputs of other functions of the same inputs.
pub(super) struct Combination {
    name: String,
    sources: Vec<SharedFunction>,
    /// Of every output its terms: source, output of it, factor.
    rows: Vec<Vec<(usize, usize, f64)>>,
    jac: Pattern,
    /// Of every source where the entries of its Jacobian go: entry, place, factor.
    places: Vec<Vec<(usize, usize, f64)>>,
    hess: Pattern,
    /// Of every source where the entries of its Hessian go.
    bends: Vec<Vec<usize>>,
}

impl Combination {
    pub(super) fn new(name: String, sources: Vec<SharedFunction>, rows: Vec<Vec<(usize, usize, f64)>>) -> Combination {
        let n_in = sources.first().map_or(0, |f| f.dims().n_in());
        let (mut at_row, mut at_col, mut from) = (Vec::new(), Vec::new(), Vec::new());
        for (k, f) in sources.iter().enumerate() {
            for (c, entries) in f.jac_pattern().columns() {
                for e in entries {
                    let output = f.jac_pattern().row_idx()[e];
                    for (r, terms) in rows.iter().enumerate() {
                        for (_, _, factor) in terms.iter().filter(|t| (t.0, t.1) == (k, output)) {
                            at_row.push(r);
                            at_col.push(c);
                            from.push((k, e, *factor));
                        }
                    }
                }
            }
        }
        let (jac, map) = Pattern::from_triplets(rows.len(), n_in, &at_row, &at_col);
        let mut places = vec![Vec::new(); sources.len()];
        from.into_iter().zip(map).for_each(|((k, e, factor), to)| places[k].push((e, to, factor)));
        let (mut at_row, mut at_col, mut of) = (Vec::new(), Vec::new(), Vec::new());
        for (k, f) in sources.iter().enumerate() {
            for (c, entries) in f.hess_pattern().columns() {
                for e in entries {
                    at_row.push(f.hess_pattern().row_idx()[e]);
                    at_col.push(c);
                    of.push(k);
                }
            }
        }
        let (hess, map) = Pattern::from_triplets(n_in, n_in, &at_row, &at_col);
        let mut bends = vec![Vec::new(); sources.len()];
        of.into_iter().zip(map).for_each(|(k, to)| bends[k].push(to));
        Combination { name, sources, rows, jac, places, hess, bends }
    }

    /// Outputs of a source that some of these rows need.
    fn needed(&self, k: usize, rows: &Range<usize>) -> Range<usize> {
        let terms = self.rows[rows.start.min(self.rows.len())..rows.end.min(self.rows.len())].iter().flatten();
        let own = terms.filter(|t| t.0 == k).map(|t| t.1);
        let (first, end) = own.fold((usize::MAX, 0), |(first, end), o| (first.min(o), end.max(o + 1)));
        first.min(end)..end
    }
}

/// A function with `n` outputs that are zero in front of each of these outputs of its own, or behind the last one.
pub(crate) fn with_zeros(f: &SharedFunction, places: &[usize], n: usize) -> SharedFunction {
    let mut rows = Vec::with_capacity(f.n_out() + places.len() * n);
    for o in 0..=f.n_out() {
        if places.contains(&o) {
            rows.resize(rows.len() + n, Vec::new());
        }
        if o < f.n_out() {
            rows.push(vec![(0, o, 1.0)]);
        }
    }
    Arc::new(Combination::new(f.name().to_owned(), vec![f.clone()], rows))
}

impl Function for Combination {
    fn name(&self) -> &str {
        &self.name
    }
    fn dims(&self) -> Dims {
        self.sources[0].dims()
    }
    fn n_out(&self) -> usize {
        self.rows.len()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        let room = |f: &SharedFunction| {
            f.n_out() + f.n_out().max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz()) + f.work_len()
        };
        self.sources.iter().map(room).max().unwrap_or(0)
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.value_rows(at, 0..self.rows.len(), out, work)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.jacobian_rows(at, 0..self.rows.len(), out, work)
    }
    fn value_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        for (k, f) in self.sources.iter().enumerate() {
            let needed = self.needed(k, &rows);
            if needed.is_empty() {
                continue;
            }
            let (own, work) = work.split_at_mut(f.n_out());
            f.value_rows(at, needed, own, work)?;
            for r in rows.clone() {
                out[r] += self.rows[r].iter().filter(|t| t.0 == k).map(|(_, o, c)| c * own[*o]).sum::<f64>();
            }
        }
        Ok(())
    }
    fn jacobian_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        for (k, f) in self.sources.iter().enumerate() {
            let needed = self.needed(k, &rows);
            if needed.is_empty() {
                continue;
            }
            let (own, work) = work.split_at_mut(f.jac_pattern().nnz());
            f.jacobian_rows(at, needed.clone(), own, work)?;
            let known = self.places[k].iter().filter(|p| needed.contains(&f.jac_pattern().row_idx()[p.0]));
            known.for_each(|(e, to, factor)| out[*to] += factor * own[*e]);
        }
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        for (k, f) in self.sources.iter().enumerate().filter(|s| s.1.hess_pattern().nnz() > 0) {
            let (of_outputs, work) = work.split_at_mut(f.n_out());
            let (own, work) = work.split_at_mut(f.hess_pattern().nnz());
            of_outputs.fill(0.0);
            for (terms, w) in self.rows.iter().zip(weights) {
                terms.iter().filter(|t| t.0 == k).for_each(|(_, o, c)| of_outputs[*o] += c * w);
            }
            f.hessian(at, of_outputs, own, work)?;
            self.bends[k].iter().zip(own).for_each(|(to, v)| out[*to] += *v);
        }
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.sources.iter().any(|f| f.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.sources.iter().any(|f| f.jacobian_is_approximate())
    }
    fn hessian_is_approximate(&self) -> bool {
        self.sources.iter().any(|f| f.hessian_is_approximate())
    }
}

impl System {
    /// Adds `0 ≤ a_k ⊥ b_k ≥ 0` to the equation of every algebraic state in `rows`: one of both is zero, and the other one is not negative. Without
    /// `a` it is the state itself. Each is a subsystem with two modes, `a_k = 0` and `b_k = 0`; the number of the first of them is returned.
    ///
    /// # Errors
    /// [`Error::State`] where a row is no algebraic state, see [`System::set_algebraic`]; [`Error::Dimension`] where `a` or `b` has other sizes;
    /// [`Error::Range`] for rows that repeat.
    pub fn add_complementarity(
        &mut self,
        rows: &[usize],
        a: Option<SharedFunction>,
        b: SharedFunction,
    ) -> Result<usize> {
        let first = self.subsystems.len();
        self.check_modes_known()?;
        self.check_rows("a complementarity", rows)?;
        if let Some(r) = rows.iter().find(|r| !self.algebraic_states().contains(r)) {
            return Err(Error::State(format!(
                "complementarity: state {r} has a derivative. Call set_algebraic before, and give algebraic states"
            )));
        }
        let n = rows.len();
        a.iter().chain([&b]).try_for_each(|f| self.check(f.as_ref(), n))?;
        let mut order: Vec<usize> = rows.to_vec();
        order.sort_unstable();
        let own = |k: usize| if a.is_some() { k } else { order.binary_search(&rows[k]).unwrap_or(0) };
        let a = a.clone().unwrap_or_else(|| states("the states", self.dims, &order));
        for (k, row) in rows.iter().enumerate() {
            let function = |name: &str, rows| -> SharedFunction {
                Arc::new(Combination::new(format!("{name} of {}", b.name()), vec![a.clone(), b.clone()], rows))
            };
            let one = |source: usize, factor: f64| (source, if source == 0 { own(k) } else { k }, factor);
            self.add_subsystem(Subsystem {
                rows: vec![*row],
                modes: function("both sides", vec![vec![one(0, 1.0)], vec![one(1, 1.0)]]),
                n_modes: 2,
                regions: Regions::Signs {
                    psi: function("difference", vec![vec![one(1, 1.0), one(0, -1.0)]]),
                    signs: vec![1, -1],
                },
            })?;
        }
        Ok(first)
    }
}
