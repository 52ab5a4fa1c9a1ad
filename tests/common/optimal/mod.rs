//! Optimal control problems of the literature, each with its usual start: the gallery of the report.
//!
//! Whoever uses it has the models of the report in the module `crate::models`.
#![allow(dead_code)]

mod cycles;
mod genes;
mod problems;

use std::sync::Arc;
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::Model;
use switchback::ocp::Ocp;
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};

/// A problem, and how its plot is labelled.
pub struct Problem {
    pub name: &'static str,
    /// What to see in the plot.
    pub see: &'static str,
    pub ocp: Ocp,
    pub time: &'static str,
    /// Labels of states and controls; without one a state is not drawn.
    pub states: &'static [&'static str],
    pub controls: &'static [&'static str],
    /// Length of the horizon by other means, where it is free.
    pub horizon: Option<f64>,
}

/// Name, system, initial state and duration of the gene networks without a control.
#[allow(unused_imports)]
pub use genes::free;

/// Every problem.
pub fn all() -> impl Iterator<Item = Problem> {
    let made = problems::all().into_iter().chain(cycles::all()).chain(genes::all());
    made.map(|p| p.expect("the data fit"))
}

/// Radau IIA with switch detection.
fn set(n_s: i64, n_fe: i64) -> Settings {
    Settings { n_s, n_fe, ..Settings::default() }
}

fn function(g: &Graph, d: Dims, name: &str, outputs: &[Expr]) -> SharedFunction {
    Arc::new(g.function(name, d, outputs).expect("the function is well formed"))
}

/// The system of a model given by its right-hand side.
fn system(g: &Graph, d: Dims, rhs: &[Expr]) -> System {
    let built = Model::from_rhs("model", d.u, d.p, rhs).and_then(|m| m.build(g));
    built.expect("the model is well formed").system
}

/// Euclidean distance.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
