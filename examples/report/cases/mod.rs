//! The cases, and what they share.

mod adaptation;
mod automata;
mod gallery;
mod guesses;
mod jumps;
mod latency;
mod linalg;
mod model_eval;
mod mpcc_textbook;
mod nmpc;
mod optima;
mod oscillator;
mod relaxations;
mod scenes;
mod sim;
mod sliding_families;
mod sliding_ocp;
mod step_equilibration;
mod stepping;
mod switching;
mod tutorial_ocp;
mod units;

use crate::json::Object;
use crate::Context;
use std::time::Instant;
use switchback::nlp::{Control, Outcome, Statistics};
use switchback::settings::{Discretisation, RkFamily, Settings};
use switchback::sim::{SimResult, Simulator};
use switchback::system::System;

/// A case: what it measures is printed, recorded and plotted through the context.
pub type Case = fn(&Context);

/// Names and cases.
pub const ALL: &[(&str, Case)] = &[
    ("oscillator", oscillator::run),
    ("sim", sim::run),
    ("automata", automata::run),
    ("units", units::run),
    ("switching", switching::run),
    ("tutorial-ocp", tutorial_ocp::run),
    ("sliding-ocp", sliding_ocp::run),
    ("adaptation", adaptation::run),
    ("gallery", gallery::run),
    ("guesses", guesses::run),
    ("optima", optima::run),
    ("latency", latency::run),
    ("step-equilibration", step_equilibration::run),
    ("stepping", stepping::run),
    ("mpcc-textbook", mpcc_textbook::run),
    ("nmpc", nmpc::run),
    ("linalg", linalg::run),
    ("model-eval", model_eval::run),
    ("relaxations", relaxations::run),
    ("scenes", scenes::run),
    ("jumps", jumps::run),
];

pub const BOTH: [Discretisation; 2] = [Discretisation::Fesd, Discretisation::Standard];

/// Default settings of this method.
pub fn settings(family: RkFamily, n_s: usize, n_fe: usize, discretisation: Discretisation) -> Settings {
    Settings {
        rk_family: family as i64,
        n_s: n_s as i64,
        n_fe: n_fe as i64,
        discretisation: discretisation as i64,
        ..Settings::default()
    }
}

/// What every result has.
pub struct Measured {
    pub n_sim: usize,
    pub error: f64,
    pub wall_s: f64,
    pub stats: Statistics,
    pub outcome: Outcome,
}

impl Measured {
    /// The fields every line of JSON has.
    pub fn object(&self, case: &str, set: &Settings) -> Object {
        let name = |names: &[&'static str], i: i64| names[i as usize];
        Object::new()
            .text("case", case)
            .text("method", name(RkFamily::NAMES, set.rk_family))
            .text("discretisation", name(Discretisation::NAMES, set.discretisation))
            .int("n_s", set.n_s as usize)
            .int("n_fe", set.n_fe as usize)
            .int("n_sim", self.n_sim)
            .num("error", self.error)
            .num("wall_s", self.wall_s)
            .int("iterations", self.stats.iterations)
            .int("factorisations", self.stats.factorisations)
            .text("outcome", self.outcome.name())
    }
}

/// A simulation with the state it ended in and the seconds it took, building included; short ones are timed
/// as the best of three.
pub fn simulate(sys: &System, set: &Settings, x0: &[f64], t_end: f64, n_sim: usize) -> (SimResult, Vec<f64>, f64) {
    let mut best = f64::INFINITY;
    loop {
        let first = best.is_infinite();
        let clock = Instant::now();
        let mut s = Simulator::new(sys, set).expect("the settings fit the system");
        s.set_state(0.0, x0).expect("the state fits");
        let r = s.run(t_end, n_sim, &mut Control::default()).expect("the run is well posed");
        let wall = clock.elapsed().as_secs_f64();
        best = best.min(wall);
        if wall > 0.02 || !first {
            return (r, s.state().to_vec(), best);
        }
    }
}

/// Euclidean distance.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Slope of `log y` over `log x` by least squares.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|p| (p.0.ln(), p.1.ln())).collect();
    let (mx, my) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let sxy: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    let sxx: f64 = logs.iter().map(|p| (p.0 - mx) * (p.0 - mx)).sum();
    sxy / sxx
}

/// Short text of an error.
pub fn short(v: f64) -> String {
    format!("{v:.2e}")
}
