//! What a point is worth in the problem as the file states it, computed from its expressions alone.
//!
//! The program that is solved has other variables, and step functions in the place of conditions. Here nothing of it is used.

use crate::nl::{Body, Problem, Row};

/// Objective and violations of a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// Value of the objective.
    pub objective: Option<f64>,
    /// Largest violation, relative to terms and bounds above 1; NaN where an expression has no value.
    pub violation: f64,
    /// What has it.
    pub place: String,
}

/// Looks at the point `x`.
pub fn look(problem: &Problem, objective: Option<usize>, x: &[f64]) -> Truth {
    let nodes = problem.forest.values(x);
    let mut truth =
        Truth { objective: objective.map(|k| problem.objectives[k].body.value(x, &nodes)), ..Truth::default() };
    for (j, (v, (l, u))) in x.iter().zip(&problem.bounds).enumerate() {
        let miss = (l - v).max(v - u).max(0.0);
        truth.take(miss / finite(&[*l, *u]), || format!("variable {j}"));
    }
    for (i, (body, row)) in problem.constraints.iter().zip(&problem.rows).enumerate() {
        let c = body.value(x, &nodes);
        let size = size(body, x, &nodes);
        let miss = match *row {
            Row::Within(l, u) if c.is_finite() => (l - c).max(c - u).max(0.0) / size.max(finite(&[l, u])),
            Row::Within(..) => f64::NAN,
            Row::Complements { variable, lower, upper } => {
                let (l, u) = problem.bounds[variable];
                let v = x[variable];
                let l = if lower { l } else { f64::NEG_INFINITY };
                let u = if upper { u } else { f64::INFINITY };
                // zero exactly at a solution: the distance from v to the projection of v - c
                let onto = if c.is_nan() { c } else { (v - c).max(l).min(u) };
                (v - onto).abs() / size.max(finite(&[l, u]))
            }
        };
        truth.take(miss, || format!("constraint {i}"));
    }
    truth
}

impl Truth {
    fn take(&mut self, miss: f64, place: impl FnOnce() -> String) {
        if miss > self.violation || (miss.is_nan() && !self.violation.is_nan()) {
            (self.violation, self.place) = (miss, place());
        }
    }
}

/// The largest finite modulus, 1 at least.
fn finite(values: &[f64]) -> f64 {
    values.iter().filter(|v| v.is_finite()).fold(1.0, |m, v| v.abs().max(m))
}

/// The largest term of a body, 1 at least.
fn size(body: &Body, x: &[f64], nodes: &[f64]) -> f64 {
    let start = body.nonlinear.map_or(1.0, |p| finite(&[nodes[p as usize]]));
    body.linear.iter().fold(start, |m, (j, a)| finite(&[m, a * x[*j]]))
}
