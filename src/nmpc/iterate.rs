//! Points of the optimisation, and how one becomes the next.

use crate::qp::QpSolution;

/// A primal-dual point: states and controls of the horizon with multipliers of dynamics, bounds of controls, and rows.
///
/// There are three ways to get one: what the user sets, a shift, and a step of the linearisation it was computed from
/// ([`super::linearise::Linearisation::advance`]). Nothing adds a step to a point: a step holds the corrector of its linearisation,
/// which would count twice in any other place (section 10.3).
#[derive(Debug, Clone, PartialEq)]
pub struct Iterate {
    pub(super) x: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) lambda: Vec<f64>,
    pub(super) u_mu: Vec<f64>,
    pub(super) row_mu: Vec<f64>,
}

impl Iterate {
    pub(super) fn zeros(n: usize, nx: usize, nu: usize, rows: usize) -> Iterate {
        Iterate {
            x: vec![0.0; (n + 1) * nx],
            u: vec![0.0; n * nu],
            lambda: vec![0.0; (n + 1) * nx],
            u_mu: vec![0.0; n * nu],
            row_mu: vec![0.0; rows],
        }
    }

    /// States `[(n + 1) · nx]`.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// Controls `[n · nu]`.
    pub fn u(&self) -> &[f64] {
        &self.u
    }

    /// Multipliers of the dynamics `[(n + 1) · nx]`, the first of the initial value.
    pub fn lambda(&self) -> &[f64] {
        &self.lambda
    }

    /// Multipliers of the bounds of the controls `[n · nu]`: positive at upper, negative at lower bounds.
    pub fn u_mu(&self) -> &[f64] {
        &self.u_mu
    }

    /// Multipliers of the rows of constraints, node by node: positive at upper, negative at lower bounds.
    pub fn row_mu(&self) -> &[f64] {
        &self.row_mu
    }

    pub(super) fn copy_from(&mut self, other: &Iterate) {
        self.x.copy_from_slice(&other.x);
        self.u.copy_from_slice(&other.u);
        self.lambda.copy_from_slice(&other.lambda);
        self.u_mu.copy_from_slice(&other.u_mu);
        self.row_mu.copy_from_slice(&other.row_mu);
    }

    /// One stage earlier; what is new at the end repeats the last.
    pub(super) fn shift(&mut self, nx: usize, nu: usize) {
        let back = |v: &mut [f64], width: usize| {
            if v.len() > width {
                v.copy_within(width.., 0);
            }
        };
        back(&mut self.x, nx);
        back(&mut self.u, nu);
        back(&mut self.lambda, nx);
        back(&mut self.u_mu, nu);
    }

    /// The largest difference of states and controls to another, component by component relative to the scale of it.
    pub(super) fn distance(&self, other: &Iterate, scale: &[f64], nx: usize, nu: usize) -> f64 {
        let part = |a: &[f64], b: &[f64], from: usize, width: usize| {
            let d = a.iter().zip(b).enumerate().map(|(i, (a, b))| (a - b).abs() / scale[from + i % width]);
            d.fold(0.0, f64::max)
        };
        part(&self.x, &other.x, 0, nx).max(part(&self.u, &other.u, nx, nu))
    }
}

/// What a quadratic program found, still apart from the point it belongs to. Only the linearisation that made it can say
/// which point that leads to.
pub(super) struct Step {
    pub(super) of: u64,
    pub(super) solution: QpSolution,
}
