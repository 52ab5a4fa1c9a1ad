//! When the program of a sequence is given up: most sequences next to a good one have no solution or a worse one, and only saying so exactly is
//! expensive.

use crate::nlp::{Control, IterationInfo};
use crate::stop;

/// Iterations without half the violation after which a program is given up. Where Newton's method converges, every full step takes more than that.
const PATIENCE: usize = 10;
/// Violation, in the units that programs are scaled to, below which patience is three times as long, and below which a point is feasible enough
/// for its cost to say something.
const CLOSE: f64 = 1e-2;
const CLOSE_PATIENCE: usize = 3;
const FEASIBLE: f64 = 1e-4;
/// Barrier parameter up to which costs are those of the program but for what [`WINDOW`] iterations change.
const SMALL_BARRIER: f64 = 1e-4;
/// Iterations over which a cost is watched, and share of what is missing by which it has to fall in them.
const WINDOW: usize = 4;
const FALL: f64 = 0.25;
/// Length from which linear rows hold after a step, and share of its last value by which a violation has to fall in it. Rows contradict each other
/// when so many such steps in a row leave the violation as it is. What is left is what the regularisation leaves of rows that cannot hold.
const WHOLE_STEP: f64 = 0.95;
const FALLS: f64 = 0.02;
const CONTRADICTED: usize = 5;
/// Share of a step from which it counts as a whole one, and change of the violation in it, as a share, that counts as none.
const WHOLE: f64 = 0.5;
const SAME: f64 = 0.1;
/// Trials of the line search from which a step counts as cut.
const CUT: usize = 3;

/// How long a program is worth its iterations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patience {
    /// Iterations without half the violation.
    pub iterations: usize,
    /// Iterations that a whole step counts for which leaves the violation as it is: Newton's method is at the least there is then.
    pub stationary: usize,
    /// Steps that were cut, less those that were not, after which a program whose constraints nearly hold creeps.
    pub cut: usize,
}

impl Patience {
    /// So many times the usual one.
    pub fn usual(times: usize) -> Patience {
        Patience { iterations: PATIENCE.saturating_mul(times), stationary: 1, cut: usize::MAX }
    }
}

/// Watches the iterations of a program.
pub(crate) struct EarlyTermination {
    /// A cost that has to be met, infinite where none has.
    cost: f64,
    patience: Patience,
    /// Violation of the rows that the program aims at.
    tolerance: f64,
    least: f64,
    last: f64,
    since: usize,
    costs: [f64; WINDOW],
    seen: usize,
    /// Whole steps in a row that have left the violation as it was.
    stationary: usize,
    /// Steps that were cut, less those that were not.
    cut: usize,
    begun: bool,
    over: bool,
    /// Largest modulus of the cost on the way, and of points that are feasible enough for it to say something.
    pub largest: f64,
    pub largest_feasible: f64,
}

impl EarlyTermination {
    /// For a program whose rows are to be met to `tolerance`, and whose cost has to come down to `cost`, infinite where any does.
    pub fn new(cost: f64, patience: Patience, tolerance: f64) -> EarlyTermination {
        EarlyTermination {
            cost,
            patience,
            tolerance,
            least: f64::INFINITY,
            last: f64::INFINITY,
            since: 0,
            costs: [f64::INFINITY; WINDOW],
            seen: 0,
            stationary: 0,
            cut: 0,
            begun: false,
            over: false,
            largest: 0.0,
            largest_feasible: 0.0,
        }
    }

    /// Was the program given up?
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Looks at an iteration; true where the program is to be given up.
    pub fn should_stop(&mut self, i: &IterationInfo) -> bool {
        if i.phase == b'c' {
            // a linear program of the certificate says nothing of the sequence
            return false;
        }
        if i.phase == b' ' && i.objective.is_finite() {
            self.largest = self.largest.max(i.objective.abs());
            if i.inf_pr <= FEASIBLE {
                self.largest_feasible = self.largest_feasible.max(i.objective.abs());
            }
        }
        if i.iter == 0 && std::mem::replace(&mut self.begun, true) {
            // the first point of a restoration has no violation, in a program of its own
            return self.over;
        }
        if i.inf_pr <= 0.5 * self.least {
            self.least = i.inf_pr;
            self.since = 0;
        } else {
            let stationary = i.alpha_pr > WHOLE && (i.inf_pr - self.last).abs() <= SAME * self.last;
            self.since += if stationary { self.patience.stationary } else { 1 };
        }
        let idle = i.alpha_pr > WHOLE_STEP && i.inf_pr > self.tolerance && i.mu <= SMALL_BARRIER;
        let idle = idle && self.last.is_finite() && (i.inf_pr - self.last).abs() <= FALLS * self.last;
        self.stationary = if idle { self.stationary + 1 } else { 0 };
        self.last = i.inf_pr;
        let Patience { iterations, cut, .. } = self.patience;
        let far = self.since > iterations && self.least > CLOSE;
        let near = self.since > CLOSE_PATIENCE.saturating_mul(iterations) && self.least > FEASIBLE;
        self.cut = if i.trials >= CUT && i.inf_pr <= FEASIBLE { self.cut + 1 } else { self.cut.saturating_sub(1) };
        let contradicts = self.stationary >= CONTRADICTED;
        self.over = far || near || self.cut > cut || contradicts || self.is_too_expensive(i);
        self.over
    }

    /// Does the cost of a point that meets the constraints stay above the one that has to be met?
    fn is_too_expensive(&mut self, i: &IterationInfo) -> bool {
        if i.inf_pr > FEASIBLE || i.mu > SMALL_BARRIER {
            self.seen = 0;
            return false;
        }
        let before = std::mem::replace(&mut self.costs[self.seen % WINDOW], i.objective);
        self.seen += 1;
        let missing = i.objective - self.cost;
        self.seen > WINDOW && missing > 0.0 && before - i.objective < FALL * missing
    }
}

/// Runs a solve that ends early where `watch` says so. What ends it in this way ends nothing outside; what the user's monitor ends does.
pub(crate) fn watched<R>(
    watch: &mut EarlyTermination,
    control: &mut Control,
    solve: impl FnOnce(&mut Control) -> R,
) -> R {
    let mut ended = false;
    let stop = control.stop.clone();
    let user = &mut control.monitor;
    let mut monitor = |i: &IterationInfo| {
        ended = !user.as_mut().is_none_or(|f| f(i));
        !ended && !watch.should_stop(i)
    };
    let mut inner = Control { stop: stop.clone(), monitor: Some(&mut monitor) };
    let r = stop.scope_apart(|| solve(&mut inner));
    if ended {
        stop::raise();
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patient(cost: f64) -> EarlyTermination {
        EarlyTermination::new(cost, Patience { iterations: 1000, stationary: 2, cut: 15 }, 1e-9)
    }

    /// The iterations after which a program is given up whose violation is `of(k)` at iteration `k`, all of them behind steps of length
    /// `alpha` and at the barrier parameter `mu`; at most `most`.
    fn given_up_after(of: impl Fn(usize) -> f64, (alpha, mu): (f64, f64), most: usize) -> usize {
        let mut p = patient(f64::INFINITY);
        let info = |k: usize| IterationInfo {
            iter: k,
            inf_pr: of(k),
            alpha_pr: alpha,
            mu,
            trials: 1,
            phase: b' ',
            ..Default::default()
        };
        (0..most).find(|&k| p.should_stop(&info(k))).unwrap_or(most)
    }

    #[test]
    fn rows_that_whole_steps_leave_as_they_are_contradict_each_other() {
        let stays = |_: usize| 1e-7;
        // the first iteration has no step that could have left it
        assert_eq!(given_up_after(stays, (1.0, 1e-8), 40), CONTRADICTED);
        // steps that are cut say nothing, nor do those at a large barrier
        assert_eq!(given_up_after(stays, (0.9, 1e-8), 40), 40);
        assert_eq!(given_up_after(stays, (1.0, 1e-2), 40), 40);
        // a fall by a tenth in every fourth step is a fall, and what is below the tolerance is a solution
        assert_eq!(given_up_after(|k| 1e-7 * 0.9f64.powi((k / 4) as i32), (1.0, 1e-8), 40), 40);
        assert_eq!(given_up_after(|_| 1e-10, (1.0, 1e-8), 40), 40);
    }

    #[test]
    fn what_stays_expensive_is_given_up() {
        let mut p = patient(1.0);
        let info = |k: usize, objective: f64| IterationInfo {
            iter: k,
            mu: 1e-6,
            objective,
            phase: b' ',
            ..Default::default()
        };
        assert_eq!((0..40).find(|&k| p.should_stop(&info(k, 2.0))), Some(WINDOW));
        let mut p = patient(1.0);
        assert_eq!((0..40).find(|&k| p.should_stop(&info(k, 1.0 + 0.7f64.powi(k as i32)))), None);
    }
}
