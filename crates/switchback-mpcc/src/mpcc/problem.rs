//! The problem with complementarity constraints as the solver sees it.

use crate::nlp::{Bounds, Nlp};

/// The member of a pair that is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// `w_a = 0`.
    First,
    /// `w_b = 0`.
    Second,
}

impl Side {
    /// The other one.
    pub fn other(self) -> Side {
        match self {
            Side::First => Side::Second,
            Side::Second => Side::First,
        }
    }
}

/// A nonlinear program with complementarity pairs `0 ≤ w_a ⊥ w_b ≥ 0`. The rows of the [`Nlp`] are the
/// ordinary ones; the solver adds the products.
pub trait Mpcc: Nlp {
    /// The pairs `(a, b)`; both variables have lower bound 0. A variable may be in several pairs.
    fn pairs(&self) -> &[(usize, usize)];

    /// Number of decisions. Pairs of one group have the same side zero.
    fn n_groups(&self) -> usize {
        self.pairs().len()
    }

    /// Group of a pair.
    fn group(&self, pair: usize) -> usize {
        pair
    }

    /// Changes `bounds` to those of the branch problem in which `sides[group]` is zero.
    fn branch(&self, sides: &[Side], bounds: &mut Bounds) {
        for (k, &(a, b)) in self.pairs().iter().enumerate() {
            let zero = match sides[self.group(k)] {
                Side::First => a,
                Side::Second => b,
            };
            bounds.xl[zero] = 0.0;
            bounds.xu[zero] = 0.0;
        }
    }

    /// Makes `x`, a point of the branch `from`, a starting point of the branch `to`: what may be positive there and was
    /// zero is moved inside.
    fn enter_branch(&self, from: &[Side], to: &[Side], x: &mut [f64]) {
        for (k, &(a, b)) in self.pairs().iter().enumerate() {
            let g = self.group(k);
            if from[g] != to[g] {
                x[if to[g] == Side::First { b } else { a }] = 1e-2;
            }
        }
    }

    /// Writes the sizes the variables usually have, where the problem knows them: the solver works in their units. Those of
    /// the two members of a pair are those its relaxation is measured by.
    fn sizes(&self, _out: &mut [f64]) {}

    /// Rows `G(w) - v = 0` and their variables `v`, which stand for functions: they have the units of their rows. A row may have
    /// several such variables, a variable one row.
    fn lifts(&self) -> &[(usize, usize)] {
        &[]
    }

    /// True for a discretised problem. Then its starting point knows something of the pairs, its branches are exact where
    /// they have a solution, and what a branch fixes beside the pairs belongs to the statement.
    fn is_discretised(&self) -> bool {
        false
    }

    /// Terms that only guide the homotopy are left out while `on`.
    fn set_polishing(&mut self, _on: bool) {}

    /// Told, where the problem knows the sizes of its variables: the largest first or second derivative of the objective of the
    /// polish at the point a solve starts from, in variables of their sizes; 1 where there is none. What is added to that objective
    /// outside of the polish can be made a share of it.
    fn set_steepest(&mut self, _steepest: f64) {}
}
