//! Derivatives of an answer with respect to initial state and parameters, while modes and jumps keep their order.

use super::exact::Solved;
use super::problem::Problem;
use super::transcribe::Transcription;
use crate::error::{Error, Result};
use crate::func::EvalError;
use crate::mpcc::{Change, Mpcc};
use crate::nlp::Nlp;
use crate::stop;

/// Step of the central differences in a parameter, relative: their error is about 1e-10 with exact derivatives of the
/// model.
const STEP: f64 = 1e-5;

/// How an answer follows its data: the initial state `[nx]`, then the parameters of the scene `[np]`. Components that are free
/// are no data; their derivatives are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Derivatives {
    /// Of the cost, one per datum.
    pub cost: Vec<f64>,
    /// Of the controls, `[n_stages · nu]` for every datum.
    pub controls: Vec<f64>,
    /// Of all variables of the program, `[n]` for every datum.
    pub variables: Vec<f64>,
    /// A bound is active without a multiplier: on its other side the derivatives are others.
    pub one_sided: bool,
}

impl Solved {
    /// Derivatives of the solution. Parameters enter by central differences of the optimality conditions, the rest is exact.
    ///
    /// # Errors
    /// [`Error::State`] where the program has no solution, [`Error::NonFinite`] where the model has no value next to the
    /// parameters, [`Error::Numeric`] for solutions that are not isolated.
    pub fn derivatives(&mut self, p: &Problem) -> Result<Derivatives> {
        let d = p.given.dims;
        let (t, solver) = (&mut self.transcription, &mut self.solver);
        let (w, y) = (solver.solution().x.clone(), solver.solution().y.clone());
        let x0 = t.x0.q;
        let mut changes: Vec<Change> = Vec::with_capacity(d.x + d.p);
        for i in x0..x0 + d.x {
            let is_datum = t.bounds.xl[i] == t.bounds.xu[i];
            changes.push(Change { fixed: Vec::from_iter(is_datum.then_some((i, 1.0))), ..Change::default() });
        }
        let mut explicit = vec![0.0; d.x + d.p];
        t.program.set_polishing(true);
        for k in 0..d.p {
            let found = parameter(t, p, k, &w, &y);
            if found.is_err() {
                t.program.set_polishing(false);
            }
            let (change, cost) = found.map_err(|e| no_value(k, e))?;
            changes.push(change);
            explicit[d.x + k] = cost;
        }
        t.program.set_polishing(false);
        let tangents = solver.tangents(&mut t.program, &t.bounds, &changes)?;
        let of = |x: &[f64]| t.controls.iter().flat_map(|&u| x[u..u + d.u].to_vec()).collect::<Vec<f64>>();
        Ok(Derivatives {
            cost: tangents.iter().zip(&explicit).map(|(t, e)| t.objective + e).collect(),
            controls: tangents.iter().flat_map(|t| of(&t.x)).collect(),
            one_sided: tangents.iter().any(|t| t.one_sided),
            variables: tangents.into_iter().flat_map(|t| t.x).collect(),
        })
    }
}

fn no_value(k: usize, e: EvalError) -> Error {
    if e == EvalError::Stopped {
        return stop::error();
    }
    Error::NonFinite(format!("the model has no value at parameters next to the given ones ({e:?}): parameter {k}"))
}

/// What parameter `k` does to gradient of the Lagrangian, rows, and cost while the variables are held.
fn parameter(
    t: &mut Transcription,
    p: &Problem,
    k: usize,
    w: &[f64],
    y: &[f64],
) -> std::result::Result<(Change, f64), EvalError> {
    let wide = p.given.wide.p;
    let places: Vec<usize> = (0..p.n_stages()).filter_map(|s| t.constants[s * wide + k]).collect();
    let before: Vec<f64> = places.iter().map(|&j| t.program.constants_mut()[j]).collect();
    // of a parameter that is zero nothing says how large it usually is
    let size = before.first().map_or(0.0, |v| v.abs());
    let h = STEP * if size > 0.0 { size } else { 1.0 };
    let mut at = |h: f64| {
        for (&j, v) in places.iter().zip(&before) {
            t.program.constants_mut()[j] = v + h;
        }
        let r = conditions(t, w, y);
        for (&j, v) in places.iter().zip(&before) {
            t.program.constants_mut()[j] = *v;
        }
        r
    };
    let (right, left) = (at(h)?, at(-h)?);
    let difference = |a: &[f64], b: &[f64]| -> Vec<(usize, f64)> {
        let d = a.iter().zip(b).map(|(a, b)| (a - b) / (2.0 * h)).enumerate();
        d.filter(|d| d.1 != 0.0).collect()
    };
    let change =
        Change { fixed: Vec::new(), gradient: difference(&right.1, &left.1), rows: difference(&right.2, &left.2) };
    Ok((change, (right.0 - left.0) / (2.0 * h)))
}

/// Cost, gradient of the Lagrangian, rows.
type Conditions = (f64, Vec<f64>, Vec<f64>);

fn conditions(t: &mut Transcription, w: &[f64], y: &[f64]) -> std::result::Result<Conditions, EvalError> {
    let p = &mut t.program;
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
