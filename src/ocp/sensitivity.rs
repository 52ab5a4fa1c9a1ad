//! Derivatives of the optimum with respect to initial state and parameters, from one factorisation.

use super::{Built, Ocp};
use crate::error::{Error, Result};
use crate::fesd::Fesd;
use crate::func::EvalError;
use crate::mpcc::{Change, Mpcc, Tangent};
use crate::nlp::Nlp;
use crate::stop;

/// Step of the central differences in a parameter, relative: their error is about 1e-10 with exact derivatives of the
/// model.
const STEP: f64 = 1e-5;

/// How the optimum follows its data while the order of modes stays as it is. Data are the initial state `[nx]`, then the
/// parameters `[np]`; a component of the initial state that is free is no datum, its derivatives are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct OcpSensitivity {
    /// Derivatives of the cost, one per datum.
    pub cost: Vec<f64>,
    /// Derivatives of the controls, `[n_stages · nu]` for every datum.
    pub controls: Vec<f64>,
    /// Derivatives of all variables of the discretised problem, `[n]` for every datum.
    pub variables: Vec<f64>,
    /// Some bound or complementarity is active without a multiplier: on the other side the derivatives are others.
    pub one_sided: bool,
}

impl Ocp {
    /// Derivatives of the last solution, which must be exact ([`crate::mpcc::Polish::Done`]). Parameters enter by
    /// central differences of the optimality conditions, the rest is exact: A. V. Fiacco's theorem on the branch.
    pub fn sensitivity(&mut self) -> Result<OcpSensitivity> {
        if self.is_simulated() || self.simulated.leads || !self.is_scene() && self.is_answered_by_simulation() {
            return self.simulated_sensitivity();
        }
        if self.system.mechanics().is_some() {
            return self.scene_sensitivity();
        }
        let d = self.system.dims();
        let Some(Built { problem, solver, bounds, extended, .. }) = self.built.as_deref_mut() else {
            return Err(Error::State("there is no solution to differentiate: solve the problem first".into()));
        };
        let (x0, u) = problem.places();
        let (w, y) = (solver.solution().x.clone(), solver.solution().y.clone());
        let values = Params { stages: extended.params.clone(), n: extended.system.dims().p };
        let is_datum = |i: usize| bounds.xl[x0 + i] == bounds.xu[x0 + i];
        let initial =
            |i: usize| Change { fixed: Vec::from_iter(is_datum(i).then_some((x0 + i, 1.0))), ..Change::default() };
        let mut changes: Vec<Change> = (0..d.x).map(initial).collect();
        let mut explicit = vec![0.0; d.x + d.p];
        problem.set_polishing(true);
        for k in 0..d.p {
            let found = parameter(values.stages[k], |h| {
                values.set(problem, k, h);
                let r = conditions(problem, &w, &y);
                values.set(problem, k, 0.0);
                r
            });
            if found.is_err() {
                problem.set_polishing(false);
            }
            let (change, cost) = found.map_err(|e| no_value(k, &e))?;
            changes.push(change);
            explicit[d.x + k] = cost;
        }
        problem.set_polishing(false);
        let tangents = solver.tangents(problem, bounds, &changes)?;
        let controls = |t: &Tangent| u.iter().flat_map(|&u| t.x[u..u + d.u].to_vec()).collect::<Vec<f64>>();
        Ok(OcpSensitivity {
            cost: tangents.iter().zip(&explicit).map(|(t, e)| t.objective + e).collect(),
            controls: tangents.iter().flat_map(controls).collect(),
            one_sided: tangents.iter().any(|t| t.one_sided),
            variables: tangents.into_iter().flat_map(|t| t.x).collect(),
        })
    }
}

pub(super) fn no_value(k: usize, e: &EvalError) -> Error {
    if *e == EvalError::Stopped {
        return stop::error();
    }
    Error::NonFinite(format!("the model has no value at parameters next to the given ones ({e:?}): parameter {k}"))
}

/// Parameters of every stage, `n` each.
pub(super) struct Params {
    pub stages: Vec<f64>,
    pub n: usize,
}

impl Params {
    /// Sets them, the `k`-th ones moved by `h`.
    pub fn set(&self, p: &mut Fesd, k: usize, h: f64) {
        let mut moved = self.stages.clone();
        for (stage, values) in moved.chunks_mut(self.n).enumerate() {
            values[k] += h;
            // finite, and as many as before
            let _ = p.set_stage_params(stage, values);
        }
    }
}

/// What a parameter of the value `at` does to gradient of the Lagrangian, rows, and cost while the variables are held: `conditions` has
/// them where it is moved by its argument.
pub(super) fn parameter(
    at: f64,
    mut conditions: impl FnMut(f64) -> std::result::Result<Conditions, EvalError>,
) -> std::result::Result<(Change, f64), EvalError> {
    let h = STEP * at.abs().max(1.0);
    let (right, left) = (conditions(h)?, conditions(-h)?);
    let difference = |a: &[f64], b: &[f64]| -> Vec<(usize, f64)> {
        let d = a.iter().zip(b).map(|(a, b)| (a - b) / (2.0 * h)).enumerate();
        d.filter(|d| d.1 != 0.0).collect()
    };
    let change =
        Change { fixed: Vec::new(), gradient: difference(&right.1, &left.1), rows: difference(&right.2, &left.2) };
    Ok((change, (right.0 - left.0) / (2.0 * h)))
}

/// Cost, gradient of the Lagrangian, rows.
pub(super) type Conditions = (f64, Vec<f64>, Vec<f64>);

pub(super) fn conditions(p: &mut dyn Nlp, w: &[f64], y: &[f64]) -> std::result::Result<Conditions, EvalError> {
    let (mut grad, mut jac) = (vec![0.0; p.n()], vec![0.0; p.jac_pattern().nnz()]);
    let mut rows = vec![0.0; p.m()];
    let cost = p.eval(w, &mut rows)?;
    p.derivatives(w, &mut grad, &mut jac)?;
    let pattern = p.jac_pattern();
    for (j, g) in grad.iter_mut().enumerate() {
        *g += pattern.range(j).map(|k| jac[k] * y[pattern.row_idx()[k]]).sum::<f64>();
    }
    Ok((cost, grad, rows))
}
