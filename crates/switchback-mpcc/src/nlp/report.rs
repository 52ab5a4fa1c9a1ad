//! How a solve ended, what it cost, and what is left of every residual.

use super::allowance;
use crate::stop::{self, Stop, Why};

/// How an algorithm ended. Values ≥ 0 come with a usable point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Outcome {
    /// All residuals are below the tolerance.
    Solved = 0,
    /// Out of iterations; the point is the last iterate.
    MaxIter = 1,
    /// Out of time; the point is the last iterate.
    MaxTime = 2,
    /// A callback or an interrupt asked to stop; the point is the last iterate.
    Stopped = 3,
    /// There is no point: all branches show it, or the linear rows of a program without pairs, or a point minimises the violation of the constraints.
    Infeasible = 4,
    /// No progress possible although the tolerance is not reached.
    Stalled = 5,
    /// The iterates diverge.
    Diverging = 6,
    /// A function has no value at the starting point, or failed for good.
    Failed = 7,
    /// Only for an optimal control problem: its discretised problem is solved, but simulations of the controls, single stages included, are
    /// another motion.
    NotFollowed = 8,
    /// Converged to a point that minimises the violation of the constraints locally; whether there is a point elsewhere is not known.
    LocallyInfeasible = 9,
}

impl Outcome {
    /// Name as in the settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Solved => "solved",
            Outcome::MaxIter => "max_iter",
            Outcome::MaxTime => "max_time",
            Outcome::Stopped => "stopped",
            Outcome::Infeasible => "infeasible",
            Outcome::Stalled => "stalled",
            Outcome::Diverging => "diverging",
            Outcome::Failed => "failed",
            Outcome::NotFollowed => "not_followed",
            Outcome::LocallyInfeasible => "locally_infeasible",
        }
    }
}

impl From<Why> for Outcome {
    fn from(why: Why) -> Outcome {
        match why {
            Why::Interrupted => Outcome::Stopped,
            Why::OutOfTime => Outcome::MaxTime,
            // the call ends with an error, see `crate::memory::bounded`
            Why::OutOfMemory => Outcome::Stopped,
        }
    }
}

/// Residuals of the optimality conditions, unscaled, maximum norm.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Residuals {
    /// Violation of rows and bounds.
    pub primal: f64,
    /// Gradient of the Lagrangian.
    pub dual: f64,
    /// Products of slacks and multipliers of bounds.
    pub complementarity: f64,
    /// Largest `G_i H_i` over the pairs.
    pub pair_product: f64,
    /// Largest `min(G_i, H_i)` over the pairs.
    pub pair_min: f64,
}

/// Work and time of a solve.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Statistics {
    /// Interior-point iterations, restoration included.
    pub iterations: usize,
    /// Numeric factorisations.
    pub factorisations: usize,
    /// Evaluations of objective and constraints.
    pub evaluations: usize,
    /// Iterations inside the restoration phase.
    pub restoration_iterations: usize,
    /// Iterations spent in the polish.
    pub polish_iterations: usize,
    /// Largest perturbation of the Hessian.
    pub max_delta_w: f64,
    /// Bounds that were moved outwards because constraints left no room between them; the polish is under those given.
    pub moved_bounds: usize,
    /// Seconds in functions and derivatives.
    pub time_eval: f64,
    /// Seconds in factorisations and solves.
    pub time_linalg: f64,
    /// Seconds in all.
    pub time_total: f64,
}

impl Statistics {
    /// Adds the cost of a part, but for `time_total`: whoever adds up has a clock of its own.
    pub fn add(&mut self, part: &Statistics) {
        self.iterations += part.iterations;
        self.factorisations += part.factorisations;
        self.evaluations += part.evaluations;
        self.restoration_iterations += part.restoration_iterations;
        self.polish_iterations += part.polish_iterations;
        self.max_delta_w = self.max_delta_w.max(part.max_delta_w);
        self.moved_bounds += part.moved_bounds;
        self.time_eval += part.time_eval;
        self.time_linalg += part.time_linalg;
    }
}

/// One line of the iteration log, in the columns Ipopt made familiar, with `σ` and the pairs' residual.
#[derive(Debug, Clone, Copy)]
pub struct IterationInfo {
    /// Iteration number.
    pub iter: usize,
    /// Objective.
    pub objective: f64,
    /// Primal infeasibility.
    pub inf_pr: f64,
    /// Dual infeasibility.
    pub inf_du: f64,
    /// Barrier parameter.
    pub mu: f64,
    /// Relaxation parameter, 0 without one.
    pub sigma: f64,
    /// Largest product of a pair.
    pub inf_cc: f64,
    /// Length of the last primal step.
    pub step: f64,
    /// Perturbation of the Hessian.
    pub delta_w: f64,
    /// Dual step length.
    pub alpha_du: f64,
    /// Primal step length.
    pub alpha_pr: f64,
    /// Trial points of the line search.
    pub trials: usize,
    /// `' '` main phase, `'r'` restoration, `'p'` polish, `'j'` relaxation raised after a jam,
    /// `'s'` step that lowers the error as a whole, `'c'` a linear program of a certificate, numbered on its own.
    pub phase: u8,
    /// Cost of the best solution that a search around this solve has verified so far; infinite where there is none.
    pub incumbent: f64,
}

impl Default for IterationInfo {
    fn default() -> Self {
        IterationInfo {
            iter: 0,
            objective: 0.0,
            inf_pr: 0.0,
            inf_du: 0.0,
            mu: 0.0,
            sigma: 0.0,
            inf_cc: 0.0,
            step: 0.0,
            delta_w: 0.0,
            alpha_du: 0.0,
            alpha_pr: 0.0,
            trials: 0,
            phase: 0,
            incumbent: f64::INFINITY,
        }
    }
}

/// Phase of linear programs of certificates, whose iterations are none of the solve.
const CERTIFICATE: u8 = b'c';

/// Means to stop a solve from outside, and the listener to its progress.
#[derive(Default)]
pub struct Control<'a> {
    /// Ends the solve when another thread wants it, or when its time is over.
    pub stop: Stop,
    /// Called once per iteration; false stops.
    pub monitor: Option<&'a mut dyn FnMut(&IterationInfo) -> bool>,
}

impl Control<'_> {
    /// A control that ends with `stop`, without a monitor.
    pub fn of(stop: Stop) -> Control<'static> {
        Control { stop, monitor: None }
    }

    /// This control without the monitor: for a solve inside of a solve.
    pub fn quiet(&self) -> Control<'static> {
        Control::of(self.stop.clone())
    }

    /// Runs `body` with a control that reports every iteration as one of `phase`.
    pub(crate) fn in_phase<R>(&mut self, phase: u8, body: impl FnOnce(&mut Control) -> R) -> R {
        if phase == CERTIFICATE {
            return allowance::apart(|| self.marked(phase, body));
        }
        self.marked(phase, body)
    }

    fn marked<R>(&mut self, phase: u8, body: impl FnOnce(&mut Control) -> R) -> R {
        self.with_info(|i| IterationInfo { phase, ..*i }, body)
    }

    /// Runs `body` with a control that reports every iteration with the cost of the best solution so far, unless it knows of a better one.
    pub fn with_incumbent<R>(&mut self, incumbent: f64, body: impl FnOnce(&mut Control) -> R) -> R {
        self.with_info(|i| IterationInfo { incumbent: i.incumbent.min(incumbent), ..*i }, body)
    }

    /// Runs `body` with a control whose monitor is told what `of` makes of an iteration.
    fn with_info<R>(
        &mut self,
        of: impl Fn(&IterationInfo) -> IterationInfo,
        body: impl FnOnce(&mut Control) -> R,
    ) -> R {
        let stop = self.stop.clone();
        match &mut self.monitor {
            None => body(&mut Control::of(stop)),
            Some(monitor) => {
                let mut told = |i: &IterationInfo| monitor(&of(i));
                body(&mut Control { stop, monitor: Some(&mut told) })
            }
        }
    }

    /// Runs `body` with this as the stop of the thread, to end at most `seconds` from now.
    pub fn within<R>(&mut self, seconds: f64, body: impl FnOnce(&mut Self) -> R) -> R {
        let mut stop = self.stop.clone();
        stop.limit(seconds);
        self.under(stop, body)
    }

    /// Runs `body`, to end after this share of the time that is left; what follows has the rest.
    pub fn sooner<R>(&mut self, share: f64, body: impl FnOnce(&mut Self) -> R) -> R {
        self.under(self.stop.sooner(share), body)
    }

    /// Runs `body` with another stop, which is that of the thread meanwhile.
    fn under<R>(&mut self, stop: Stop, body: impl FnOnce(&mut Self) -> R) -> R {
        let given = std::mem::replace(&mut self.stop, stop.clone());
        let r = stop.scope(|| body(self));
        self.stop = given;
        r
    }

    /// Reports an iteration; returns why to stop, if so.
    pub fn check(&mut self, info: &IterationInfo) -> Option<Outcome> {
        if !self.monitor.as_mut().is_none_or(|f| f(info)) {
            stop::raise();
            return Some(Outcome::Stopped);
        }
        self.stop.why().or_else(stop::requested).map(Outcome::from)
    }
}
