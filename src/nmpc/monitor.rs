//! How a controller is doing: contraction, times, counts.

use super::stage::Evaluations;
use std::time::Duration;

/// Times of one phase.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Timing {
    /// Times it ran.
    pub count: u64,
    /// Seconds of the last time, of all, of the longest.
    pub last: f64,
    /// Seconds of all times.
    pub total: f64,
    /// Seconds of the longest.
    pub worst: f64,
}

impl Timing {
    pub(super) fn add(&mut self, d: Duration) -> f64 {
        self.last = d.as_secs_f64();
        self.count += 1;
        self.total += self.last;
        self.worst = self.worst.max(self.last);
        self.last
    }

    /// Those of another, which ran later.
    pub(super) fn merge(&mut self, later: &Timing) {
        if later.count > 0 {
            self.last = later.last;
        }
        self.count += later.count;
        self.total += later.total;
        self.worst = self.worst.max(later.worst);
    }
}

/// Counts and times of a controller's own work since it was made or reset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitor {
    /// `κ` of (10.18), estimated as the ratio of the last two steps on the problem with one initial value; NaN before there were
    /// two. Iterations converge where it is below 1.
    pub kappa: f64,
    /// `ω/2` of (10.18), from how that ratio changes with the length of the step; NaN before there were three.
    pub omega: f64,
    /// Size of the last step relative to the size of states and controls.
    pub step: f64,
    /// Distance of the measured from the predicted state at the last sample, relative to the size of the states; NaN without a prediction.
    pub prediction: f64,
    /// Preparations.
    pub preparation: Timing,
    /// Feedbacks.
    pub feedback: Timing,
    /// Evaluations of model functions, each for the whole horizon.
    pub evaluations: Evaluations,
    /// Evaluations in the last preparation alone.
    pub last_evaluations: Evaluations,
    /// Quadratic programs solved, and iterations of all.
    pub qps: u64,
    /// Iterations of the quadratic programs.
    pub qp_iterations: u64,
    /// Linearisations whose functions had no value or whose program was not convex: the one before was used further.
    pub failed_linearisations: u64,
    /// Feedbacks by their source.
    pub sources: [u64; 5],
    /// Systems that switch: alternatives to plans that were prepared, and those that were taken.
    pub alternatives: u64,
    /// Alternatives that were taken.
    pub flips: u64,
}

impl Default for Monitor {
    fn default() -> Monitor {
        Monitor {
            kappa: f64::NAN,
            omega: f64::NAN,
            step: f64::NAN,
            prediction: f64::NAN,
            preparation: Timing::default(),
            feedback: Timing::default(),
            evaluations: Evaluations::default(),
            last_evaluations: Evaluations::default(),
            qps: 0,
            qp_iterations: 0,
            failed_linearisations: 0,
            sources: [0; 5],
            alternatives: 0,
            flips: 0,
        }
    }
}

/// Steps on the problem with one initial value, for the estimates of contraction.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Contraction {
    last: Option<f64>,
    ratio: Option<(f64, f64)>,
}

impl Contraction {
    /// What is left after a step of this size, by the rate of the last two; the step itself where there is no rate, or no contraction.
    pub fn left(&self, size: f64) -> f64 {
        match self.ratio {
            Some((kappa, _)) if kappa < 1.0 => size * (kappa / (1.0 - kappa)),
            _ => size,
        }
    }

    /// The ratio of the last two steps.
    pub fn rate(&self) -> Option<f64> {
        self.ratio.map(|r| r.0)
    }

    /// Another step of this size.
    pub fn see(&mut self, size: f64, monitor: &mut Monitor) {
        monitor.step = size;
        if let Some(before) = self.last.filter(|b| *b > 0.0) {
            let ratio = size / before;
            // ratio = κ + (ω/2) size of the step before: two of them give both
            if let Some((r, s)) = self.ratio.filter(|r| r.1 != before) {
                monitor.omega = ((r - ratio) / (s - before)).max(0.0);
            }
            monitor.kappa = ratio;
            self.ratio = Some((ratio, before));
        }
        self.last = Some(size);
    }
}
