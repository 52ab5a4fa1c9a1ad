//! What may change while a controller runs, and what it says of its plan.

use super::{Level, Nmpc, Scheme};
use crate::error::{finite, Error, Result};
use crate::func::EvalError;

/// Lower bounds that are not above upper ones, infinite for none.
fn check_bounds(what: &str, lower: &[f64], upper: &[f64], n: usize) -> Result<()> {
    if lower.len() != n || upper.len() != n {
        let (l, u) = (lower.len(), upper.len());
        return Err(Error::Dimension(format!("bounds of {what}s have {l} and {u} entries, expected {n}")));
    }
    for (i, (l, u)) in lower.iter().zip(upper).enumerate() {
        if l.is_nan() || u.is_nan() || l > u {
            return Err(Error::Range(format!(
                "{what} {i} has the bounds {l} and {u}: the lower one is at most the upper one, infinite for none"
            )));
        }
    }
    Ok(())
}

impl Nmpc {
    /// Sets the weights of least-squares term `k`: the diagonal of `W`, or all of it. They count from the next preparation on, where frozen
    /// matrices are made anew.
    ///
    /// # Errors
    /// [`Error::Range`], [`Error::Dimension`].
    pub fn set_weights(&mut self, k: usize, weights: &[f64]) -> Result<()> {
        finite("weight", weights, weights.len())?;
        let n_terms = self.model.costs.squares.len();
        let Some(term) = self.model.costs.squares.get(k) else {
            return Err(Error::Range(format!("least-squares term {k}: there are {n_terms}")));
        };
        let n = term.f.n_out();
        if weights.len() != n && weights.len() != n * n {
            return Err(Error::Dimension(format!(
                "{} weights given, expected {n}, or a matrix of {}",
                weights.len(),
                n * n
            )));
        }
        self.finish();
        // the program that is there keeps its own: other references would change its gradient by the weights of its Hessian
        self.model.costs.squares[k].keep_weights(weights);
        Ok(())
    }

    /// Takes over weights that were set.
    pub(super) fn take_weights(&mut self) {
        // all of them, not the first alone
        if self.model.costs.squares.iter_mut().filter_map(|s| s.take_weights().then_some(())).count() == 0 {
            return;
        }
        self.model.revision += 1;
        self.lin.forget_updates();
        let keeps = matches!(self.options.level, Level::A | Level::B | Level::C);
        self.outdated = keeps && matches!(self.options.scheme, Scheme::Mli | Scheme::AsRti);
    }

    /// Sets the bounds of the controls, infinite for none. Between a preparation and its feedback they count at once.
    ///
    /// # Errors
    /// [`Error::Range`], [`Error::Dimension`].
    pub fn set_control_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        check_bounds("control", lower, upper, self.nu())?;
        let other = |j: &usize| lower[*j] != self.model.u_lower[*j] || upper[*j] != self.model.u_upper[*j];
        let chooses = |j: &usize| self.model.chooses[*j];
        if let Some(j) = (0..self.nu()).filter(chooses).find(other) {
            return Err(Error::Range(format!(
                "control {j} chooses among values: its bounds are those of the problem, make another controller for others"
            )));
        }
        self.finish();
        self.model.u_lower.copy_from_slice(lower);
        self.model.u_upper.copy_from_slice(upper);
        self.lin.embed_control_bounds(&self.model);
        if let Some(b) = &mut self.branches {
            b.each(|lin| lin.embed_control_bounds(&self.model));
        }
        Ok(())
    }

    /// Sets the bounds of the states that have a derivative, infinite for none. Between a preparation and its feedback they count at once.
    ///
    /// # Errors
    /// [`Error::Range`], also for a state that has no bound in the problem: the program has no row for it; [`Error::Dimension`].
    pub fn set_state_bounds(&mut self, lower: &[f64], upper: &[f64]) -> Result<()> {
        let nx = self.nx();
        check_bounds("state", lower, upper, nx)?;
        for i in 0..nx {
            if (lower[i].is_finite() || upper[i].is_finite()) && !self.model.constraints.has_row(i) {
                return Err(Error::Range(format!(
                    "state {i} has no bound in the problem: give it one there, which may be far away, before the controller is made"
                )));
            }
        }
        self.finish();
        self.model.constraints.set_state_bounds(lower, upper);
        self.lin.embed_state_bounds(&self.model);
        if let Some(b) = &mut self.branches {
            b.each(|lin| lin.embed_state_bounds(&self.model));
        }
        Ok(())
    }

    /// The cost of the plan, with the prices of its violations: sums over the nodes as in (10.1). Costs and constraints are evaluated.
    ///
    /// # Errors
    /// [`Error::Numeric`] where functions have no value at the plan; [`Error::Interrupted`]; [`Error::User`] for a fatal code of a callback.
    pub fn objective(&mut self) -> Result<f64> {
        self.check_params()?;
        self.finish();
        let (nodes, it) = (&mut self.model.nodes, &self.iterate);
        let mut all = || -> std::result::Result<f64, EvalError> {
            nodes.solve(&it.x, &it.u)?;
            let cost = self.model.costs.value(nodes, &it.x, &it.u)?;
            self.model.constraints.values(nodes, &it.x, &it.u)?;
            Ok(cost + self.model.constraints.violation()[1])
        };
        match all() {
            Ok(v) => Ok(v),
            Err(EvalError::Recoverable) => Err(Error::Numeric("costs or constraints have no value at the plan".into())),
            Err(e) => self.note(Err(e)).map(|()| f64::NAN),
        }
    }

    /// The feedback gain of the first stage where no constraint is active, `out[nu · nx]`, row by row: `u = u_0 + K (x − x_0)`.
    ///
    /// # Errors
    /// [`Error::State`] where nothing is prepared; [`Error::Dimension`].
    pub fn gain(&mut self, out: &mut [f64]) -> Result<()> {
        let (nx, nu) = (self.nx(), self.nu());
        if out.len() != nu * nx {
            return Err(Error::Dimension(format!("a gain of {} entries, expected {}", out.len(), nu * nx)));
        }
        if !self.lin.gains(&mut self.law) {
            return Err(Error::State("there is no program: call prepare before".into()));
        }
        for (e, out) in out.iter_mut().enumerate() {
            *out = self.law[e / nx + e % nx * nu];
        }
        Ok(())
    }

    /// Nodes of the rows of the program, in the order of [`super::super::Iterate::row_mu`].
    pub fn row_nodes(&self) -> impl Iterator<Item = usize> + '_ {
        self.model.constraints.rows().iter().map(|r| r.node)
    }
}
