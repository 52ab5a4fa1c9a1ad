//! Descent on event-driven simulations: an answer that is not optimal, and whose direction no sequence of modes next to its own
//! follows, is bettered in its controls alone. What the descent ends at is the start of a mode program again.

mod shooting;
mod sqp;

use super::optimality::Verdict;
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use shooting::Shooting;

/// Simulations of the horizon of a descent at most.
const EVALUATIONS: usize = 80;
/// Variables of a descent at most: its quadratic programs are dense, and every one of them is a column of the sensitivities.
const VARIABLES: usize = 400;
/// Violation of a constraint, relative to what the variables change it by, with which a descent may end.
const MET: f64 = 1e-4;
/// Gain, relative to the cost, that counts as none.
const NONE: f64 = 1e-6;

/// Difference of the cost of an answer from that of its simulation, relative, above which a descent says nothing of it.
const SAME: f64 = 1e-3;

/// The end of a descent from an answer.
pub(super) enum Descent {
    /// Nothing is to be gained, that is what the answer is.
    Still(Verdict),
    /// The answer with other controls, lengths, parameters, initial states, that lead to less.
    Lower(Box<OcpResult>),
}

impl Ocp {
    /// Descends on simulations from the answer that `best` has, with the given controls. `None` where nothing is simulated, or there is
    /// nothing to vary.
    pub(super) fn descend(&self, best: &Ocp, known: &Sizes, controls: &[f64]) -> Result<Option<Descent>> {
        let (Some(b), Some(r)) = (best.built.as_ref(), best.result.as_ref()) else { return Ok(None) };
        let mut shooting = Shooting::new(self, b, r, known)?;
        if !(1..=VARIABLES).contains(&shooting.n()) {
            return Ok(None);
        }
        let w = &b.solver.solution().x;
        let mut all = b.problem.controls(w);
        let (own, wide) = (self.system.dims().u.max(1), b.extended.system.dims().u.max(1));
        for (all, moved) in all.chunks_mut(wide).zip(controls.chunks(own)) {
            all[..moved.len()].copy_from_slice(moved);
        }
        let z = shooting.start(&all, &b.problem.control_ends(w));
        let found = match sqp::minimise(&mut shooting, &z, EVALUATIONS) {
            Err(e @ (Error::Interrupted | Error::OutOfTime | Error::Internal(_))) => return Err(e),
            // a simulation that fails says nothing of the answer
            Err(_) | Ok(None) => return Ok(None),
            Ok(Some(found)) => found,
        };
        if found.violation > MET {
            return Ok(None);
        }
        if found.stationary && found.gain <= NONE {
            // a cost that simulations do not confirm is certified by nothing
            let own = r.cost_reached + best.penalty(&b.problem, w, &b.extended, &r.durations);
            if (found.before - own).abs() > SAME * found.before.abs().max(own.abs()) {
                return Ok(None);
            }
            return Ok(Some(Descent::Still(if found.kink { Verdict::Kink } else { Verdict::LocalOptimum })));
        }
        let mut moved = Box::new(r.clone());
        shooting.tell(&found.z, &mut moved);
        Ok(Some(Descent::Lower(moved)))
    }
}
