//! Away from saddle points.
//!
//! Newton's method with a corrected inertia leaves a saddle along its directions of negative curvature `−κ`, where a correction `δ_w`
//! makes a distance grow by `δ_w/(δ_w − κ)` in every whole step. A distance that is zero stays zero: iterates of a symmetric problem
//! that start on its axis of symmetry (straight towards an obstacle in the middle, say) stay on it, and as the correction damps all
//! other directions, too, they creep along it. A small disturbance in every variable is enough to get away.

use super::solver::Ipm;
use super::Nlp;

/// Corrected whole steps in a row after which iterates may be at a saddle, and share of the dual infeasibility that has to be left by
/// then: elsewhere they bring it down.
const STEPS: usize = 10;
const LEFT: f64 = 0.1;
/// Steps that count as whole.
const WHOLE: f64 = 0.99;
/// Disturbance relative to the size of a variable, and to its distance from a bound: far above rounding, far below what a step changes.
const DISTURBANCE: f64 = 1e-5;
const INSIDE: f64 = 0.1;
/// Disturbances of one solve: after that many, negative curvature is all along the way and no saddle.
const MOST: usize = 5;

/// Watches for saddle points.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Watch {
    steps: usize,
    dual: f64,
    ended: bool,
    pub(super) disturbed: usize,
}

impl Watch {
    /// Are iterates at a saddle after this step? `step` is the length of an accepted one.
    pub(super) fn sees(&mut self, step: Option<f64>, delta_w: f64, dual: f64) -> bool {
        if delta_w == 0.0 || step.is_none_or(|a| a < WHOLE) || self.disturbed == MOST {
            self.steps = 0;
            return false;
        }
        if self.steps == 0 {
            self.dual = dual;
        }
        self.steps += 1;
        if self.steps <= STEPS {
            return false;
        }
        self.steps = 0;
        let sees = dual > LEFT * self.dual;
        self.disturbed += usize::from(sees);
        sees
    }

    /// Is the end of a solve, whose last step needed this correction, a saddle? It is asked once: what comes back to the same point has
    /// nowhere else to go.
    pub(super) fn ends(&mut self, delta_w: f64) -> bool {
        let may_be = delta_w > 0.0 && !self.ended && self.disturbed < MOST;
        self.ended |= may_be;
        self.disturbed += usize::from(may_be);
        may_be
    }
}

impl Ipm {
    /// Moves every variable that is not fixed by a little inside of its bounds, in every `round` to another place. Where a function
    /// has no value there the point stays. False where it has none at the point itself any more.
    pub(super) fn disturb(&mut self, nlp: &mut dyn Nlp, round: usize) -> bool {
        self.trial.x.copy_from_slice(&self.it.x);
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        for j in (0..self.it.x.len()).filter(|j| !self.shape.fixed[*j]) {
            let x = self.trial.x[j];
            // equidistributed in [−1, 1]
            let r = 2.0 * (golden * (j * (MOST + 1) + round) as f64).fract() - 1.0;
            let room = if r < 0.0 { x - self.bounds.xl[j] } else { self.bounds.xu[j] - x };
            self.it.x[j] = x + r * (DISTURBANCE * x.abs().max(1.0)).min(INSIDE * room);
        }
        if !self.evaluate(nlp) || !self.differentiate(nlp) {
            self.it.x.copy_from_slice(&self.trial.x);
            if !self.evaluate(nlp) || !self.differentiate(nlp) {
                return false;
            }
        }
        self.forget_filter();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_corrected_whole_steps_that_lead_nowhere_are_at_a_saddle() {
        let mut w = Watch::default();
        assert!((0..STEPS).all(|_| !w.sees(Some(1.0), 0.1, 1.0)));
        assert!(w.sees(Some(1.0), 0.1, 0.9));
        assert_eq!(w.disturbed, 1);
        // steps that were cut, that needed no correction, or that help begin the count anew
        for (step, delta, dual) in
            [(Some(0.5), 0.1, 1.0), (Some(1.0), 0.0, 1.0), (None, 0.1, 1.0), (Some(1.0), 0.1, 0.01)]
        {
            (0..STEPS).for_each(|_| assert!(!w.sees(Some(1.0), 0.1, 1.0)));
            assert!(!w.sees(step, delta, dual));
        }
        assert!((0..20 * MOST * STEPS).filter(|_| w.sees(Some(1.0), 0.1, 1.0)).count() == MOST - 1);
    }
}
