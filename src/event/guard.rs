//! The guards of transitions, as the engine watches them.

use super::field::{gradient_map, scatter, Gradients};
use crate::func::{Dims, EvalResult, Point};
use crate::system::Transition;

/// A transition with what its guard needs to be watched beside the indicators.
pub(super) struct Guard {
    pub(super) transition: Transition,
    /// Its place among the indicator functions.
    pub(super) q: usize,
    /// Its gradient is constant.
    pub(super) affine: bool,
    /// Where the entries of its Jacobian go.
    to_dq: Vec<usize>,
    /// Where those of the Jacobian of the reset go.
    to_reset: Vec<usize>,
    /// It has passed zero, and is watched again when it has been back.
    pub(super) spent: bool,
    /// Its gradient, which is constant, stands among the others.
    known: bool,
}

/// All guards, and which are watched.
#[derive(Default)]
pub(super) struct Guards {
    pub(super) all: Vec<Guard>,
    /// Those of the present discrete states.
    pub(super) armed: Vec<usize>,
}

impl Guards {
    /// Of a list of transitions; the first guard has the place `q0` among the indicators, and their `gradients` are behind
    /// those of the indicators.
    pub(super) fn new(transitions: &[Transition], q0: usize, dims: &Dims, gradients: &mut Gradients) -> Guards {
        let guard = |(i, t): (usize, &Transition)| Guard {
            q: q0 + i,
            affine: t.guard.hess_pattern().nnz() == 0,
            to_dq: gradients.push(t.guard.jac_pattern(), dims),
            to_reset: t.reset.as_ref().map_or_else(Vec::new, |r| gradient_map(&r.f, &r.rows, dims)),
            transition: t.clone(),
            spent: false,
            known: false,
        };
        Guards {
            all: transitions.iter().enumerate().map(guard).collect(),
            armed: Vec::with_capacity(transitions.len()),
        }
    }

    /// Finds out which are watched in the discrete states of `x`. Those that were not before begin anew.
    pub(super) fn arm(&mut self, x: &[f64]) {
        self.armed.clear();
        for (i, g) in self.all.iter_mut().enumerate() {
            if g.transition.from.iter().all(|&(state, value)| x[state] == value) {
                self.armed.push(i);
            } else {
                g.spent = false;
            }
        }
    }

    /// Nothing has happened yet.
    pub(super) fn reset(&mut self, x: &[f64]) {
        self.all.iter_mut().for_each(|g| g.spent = false);
        self.arm(x);
    }

    /// Values of those that are watched.
    pub(super) fn values(&self, at: &Point, q: &mut [f64], work: &mut [f64]) -> EvalResult {
        for g in self.armed.iter().map(|&i| &self.all[i]) {
            g.transition.guard.value(at, &mut q[g.q..g.q + 1], work)?;
        }
        Ok(())
    }

    /// Gradients of those that are watched; `room` is a buffer for one of them, and work space. Where they stay (`constant`) those of all
    /// are evaluated once.
    pub(super) fn gradients(
        &mut self,
        at: &Point,
        dq: &mut [f64],
        constant: bool,
        room: (&mut [f64], &mut [f64]),
    ) -> EvalResult {
        if constant {
            // those of other discrete states, too: they may be watched within a step
            for g in self.all.iter_mut().filter(|g| !g.known) {
                scatter(&g.transition.guard, at, &g.to_dq, dq, (&mut *room.0, &mut *room.1))?;
                g.known = true;
            }
            return Ok(());
        }
        for g in self.armed.iter().map(|&i| &self.all[i]) {
            scatter(&g.transition.guard, at, &g.to_dq, dq, (&mut *room.0, &mut *room.1))?;
        }
        Ok(())
    }

    /// Parameters or controls have changed: gradients are not known any more.
    pub(super) fn forget(&mut self) {
        self.all.iter_mut().for_each(|g| g.known = false);
    }
}

/// What a transition makes of a state, with the derivatives of that.
pub(super) struct Reset {
    /// The state behind it.
    pub(super) x: Vec<f64>,
    /// Its derivatives with respect to state, parameters, controls and time before it, row-major `nx × n_z`; empty until they are
    /// asked for.
    pub(super) jac: Vec<f64>,
    n_z: usize,
}

impl Reset {
    pub(super) fn new(nx: usize, n_z: usize) -> Reset {
        Reset { x: vec![0.0; nx], jac: Vec::new(), n_z }
    }

    /// Makes room for the derivatives; all are zero.
    pub(super) fn clear_derivatives(&mut self) {
        self.jac.clear();
        self.jac.resize(self.x.len() * self.n_z, 0.0);
    }

    /// Evaluates the reset of a transition at a point; `room` is a buffer for its Jacobian, and work space.
    pub(super) fn evaluate(
        &mut self,
        guard: &Guard,
        at: &Point,
        derivatives: bool,
        room: (&mut [f64], &mut [f64]),
    ) -> EvalResult {
        let (nx, n_z) = (self.x.len(), self.n_z);
        if derivatives {
            self.clear_derivatives();
        }
        self.x.copy_from_slice(at.x);
        (0..if derivatives { nx } else { 0 }).for_each(|i| self.jac[i * n_z + i] = 1.0);
        if let Some(r) = &guard.transition.reset {
            r.f.value(at, &mut room.0[..r.rows.len()], room.1)?;
            r.rows.iter().zip(&*room.0).for_each(|(i, v)| self.x[*i] = *v);
            if derivatives {
                r.rows.iter().for_each(|i| self.jac[i * n_z + i] = 0.0);
                scatter(&r.f, at, &guard.to_reset, &mut self.jac, room)?;
            }
        }
        for &(state, value) in &guard.transition.to {
            self.x[state] = value;
            if derivatives {
                self.jac[state * n_z..(state + 1) * n_z].fill(0.0);
            }
        }
        Ok(())
    }
}
