//! The guards of transitions, as the engine watches them.

use super::field::{gradient_map, scatter, Gradients};
use crate::func::{Dims, EvalResult, Point};
use crate::system::{Effect, Transition, Trigger};

/// A transition with what its guard needs to be watched beside the indicators.
pub(super) struct Guard {
    pub(super) transition: Transition,
    /// Its place among the indicator functions, that of the first of its `n` outputs. Notes have none: no step ends for them.
    pub(super) q: usize,
    pub(super) n: usize,
    /// Outputs that are watched: those whose zero may change the condition, see [`Guards::choose`]. Of one output it is that.
    pub(super) watched: Vec<usize>,
    /// The output that passed zero last.
    pub(super) last: usize,
    /// Its discrete states have begun and it waits for an edge: what is true now does not count.
    enters: bool,
    is_armed: bool,
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
    /// Is there one whose outputs have to be chosen, or that waits for an edge?
    careful: bool,
}

impl Guard {
    /// Writes its gradients to their places among all.
    pub(super) fn gradient(&self, at: &Point, dq: &mut [f64], room: (&mut [f64], &mut [f64])) -> EvalResult {
        scatter(&self.transition.guard, at, &self.to_dq, dq, room)
    }

    /// Places of its outputs among the indicator functions.
    pub(super) fn places(&self) -> std::ops::Range<usize> {
        self.q..self.q + self.n
    }

    /// The place of the output that passed zero last.
    pub(super) fn place(&self) -> usize {
        self.q + self.last
    }

    /// Is its condition true where `holds` says which outputs are beyond zero?
    fn is_true(&self, mut holds: impl FnMut(usize) -> bool) -> bool {
        match &self.transition.clauses[..] {
            [] => holds(0),
            all => all.iter().any(|c| c.iter().all(|l| holds(*l))),
        }
    }

    /// Chooses what is watched. A condition that is false becomes true where every output of one list is beyond zero: of each list one output
    /// that is not has to pass zero first, so it is enough to watch that one. A condition that is true stays so as long as the outputs of one list
    /// that is true do.
    fn choose(&mut self, mut holds: impl FnMut(usize) -> bool) {
        let now = self.is_true(&mut holds);
        // what has been made is watched again when it has been false
        self.spent = now && (self.spent || self.enters);
        self.enters = false;
        let clauses = &self.transition.clauses;
        if clauses.is_empty() {
            return;
        }
        self.watched.clear();
        if now {
            let own = clauses.iter().find(|c| c.iter().all(|l| holds(*l)));
            self.watched.extend(own.into_iter().flatten());
        } else {
            self.watched.extend(clauses.iter().filter_map(|c| c.iter().find(|l| !holds(**l))));
        }
        self.watched.sort_unstable();
        self.watched.dedup();
    }
}

impl Guards {
    /// Of a list of transitions; the first guard has the place `q0` among the indicators, and their `gradients` are behind
    /// those of the indicators.
    pub(super) fn new(transitions: &[Transition], q0: usize, dims: &Dims, gradients: &mut Gradients) -> Guards {
        let mut q = q0;
        let guard = |t: &Transition| {
            let note = t.rule.effect == Effect::Note;
            let n = if note { 0 } else { t.guard.n_out() };
            q += n;
            Guard {
                q: q - n,
                n,
                watched: (0..n.min(1)).collect(),
                last: 0,
                enters: false,
                is_armed: false,
                affine: note || t.guard.hess_pattern().nnz() == 0,
                to_dq: if note { Vec::new() } else { gradients.push(t.guard.jac_pattern(), dims) },
                to_reset: t.reset.as_ref().map_or_else(Vec::new, |r| gradient_map(&r.f, &r.rows, dims)),
                transition: t.clone(),
                spent: false,
                known: false,
            }
        };
        let all: Vec<Guard> = transitions.iter().map(guard).collect();
        let careful =
            |g: &Guard| g.n > 0 && (!g.transition.clauses.is_empty() || g.transition.rule.trigger == Trigger::Edge);
        Guards { careful: all.iter().any(careful), armed: Vec::with_capacity(all.len()), all }
    }

    /// Number of outputs of all of them.
    pub(super) fn n_outputs(&self) -> usize {
        self.all.iter().map(|g| g.n).sum()
    }

    /// Finds out which are watched in the discrete states of `x`. Those that were not before begin anew.
    pub(super) fn arm(&mut self, x: &[f64]) {
        self.armed.clear();
        for (i, g) in self.all.iter_mut().enumerate() {
            let armed = g.n > 0 && g.transition.from.iter().all(|&(state, value)| x[state] == value);
            if armed {
                self.armed.push(i);
                g.enters |= !g.is_armed && g.transition.rule.trigger == Trigger::Edge;
            } else {
                (g.spent, g.enters) = (false, false);
            }
            g.is_armed = armed;
        }
    }

    /// Nothing has happened yet.
    pub(super) fn reset(&mut self, x: &[f64]) {
        self.all.iter_mut().for_each(|g| (g.spent, g.is_armed, g.enters) = (false, false, false));
        self.arm(x);
    }

    /// Is the condition of guard `i` true, where `holds` says which of its outputs are beyond zero?
    pub(super) fn is_true(&self, i: usize, holds: impl FnMut(usize) -> bool) -> bool {
        self.all[i].is_true(holds)
    }

    /// Is there nothing to choose?
    #[inline]
    pub(super) fn are_plain(&self) -> bool {
        !self.careful
    }

    /// Chooses what is watched of guards with several outputs, and passes over what waits for an edge and is true when its discrete states begin;
    /// `holds` says of an output of a guard whether it is beyond zero, or at zero and on its way.
    pub(super) fn choose<E>(&mut self, mut holds: impl FnMut(&Guard, usize) -> Result<bool, E>) -> Result<(), E> {
        let mut known = Vec::new();
        for &i in &self.armed {
            let g = &mut self.all[i];
            if g.transition.clauses.is_empty() && !g.enters {
                continue;
            }
            known.clear();
            for l in 0..g.n {
                known.push(holds(g, l)?);
            }
            g.choose(|l| known[l]);
        }
        Ok(())
    }

    /// Values of those that are watched.
    pub(super) fn values(&self, at: &Point, q: &mut [f64], work: &mut [f64]) -> EvalResult {
        for g in self.armed.iter().map(|&i| &self.all[i]) {
            g.transition.guard.value(at, &mut q[g.places()], work)?;
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
                g.gradient(at, dq, (&mut *room.0, &mut *room.1))?;
                g.known = true;
            }
            return Ok(());
        }
        for g in self.armed.iter().map(|&i| &self.all[i]) {
            g.gradient(at, dq, (&mut *room.0, &mut *room.1))?;
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
