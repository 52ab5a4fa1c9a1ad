//! A model function at many points at once.

use crate::error::{Error, Result};
use crate::expr::{ExprFunction, LANES};
use crate::func::{Dims, EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::stop;
use crate::system::SharedFunction;

/// Has a function a value? What ends the call is an error of it.
pub(super) fn has_value(outcome: EvalResult) -> Result<bool> {
    match outcome {
        Ok(()) => Ok(true),
        Err(EvalError::Recoverable) => Ok(false),
        Err(EvalError::Fatal(code)) => {
            Err(Error::User { code, what: "a function of the model returned a negative code".into() })
        }
        Err(EvalError::Stopped) => Err(stop::error()),
    }
}

/// Points, inputs and results of one function. Quantity `i` of point `k` is at `i · n + k`: quantities lie beside each other
/// for all points, so that programs of expressions run on eight points at a time.
pub(super) struct Many {
    f: SharedFunction,
    pub n: usize,
    pub dims: Dims,
    pub inputs: Vec<f64>,
    pub value: Vec<f64>,
    pub jac: Vec<f64>,
    pub hess: Vec<f64>,
    /// Row and column of every entry.
    pub jac_entries: Vec<(usize, usize)>,
    pub hess_entries: Vec<(usize, usize)>,
    lanes: Vec<[f64; LANES]>,
    /// For functions that know one point at a time: a point, a result, a workspace.
    point: Vec<f64>,
    result: Vec<f64>,
    work: Vec<f64>,
    /// Calls for values, Jacobians, Hessians: one for all points.
    pub counts: [u64; 3],
}

fn entries(p: &Pattern) -> Vec<(usize, usize)> {
    (0..p.n_cols()).flat_map(|j| p.rows(j).iter().map(move |&i| (i, j))).collect()
}

impl Many {
    /// Room for `n` points; second derivatives only where they are asked for.
    pub fn new(f: &SharedFunction, n: usize, second: bool) -> Many {
        let dims = f.dims();
        let expression = f.as_any().and_then(|f| f.downcast_ref::<ExprFunction>());
        let lanes = expression.map_or_else(Vec::new, ExprFunction::batch_work);
        let jac_entries = entries(f.jac_pattern());
        let hess_entries = if second { entries(f.hess_pattern()) } else { Vec::new() };
        let longest = f.n_out().max(jac_entries.len()).max(hess_entries.len());
        let weights = if second { f.n_out() } else { 0 };
        Many {
            n,
            dims,
            inputs: vec![0.0; (dims.n_in() + weights) * n],
            value: vec![0.0; f.n_out() * n],
            jac: vec![0.0; jac_entries.len() * n],
            hess: vec![0.0; hess_entries.len() * n],
            jac_entries,
            hess_entries,
            lanes,
            point: vec![0.0; dims.n_in() + f.n_out()],
            result: vec![0.0; longest],
            work: vec![0.0; f.work_len()],
            f: f.clone(),
            counts: [0; 3],
        }
    }

    /// The function.
    pub fn function(&self) -> &SharedFunction {
        &self.f
    }

    pub fn n_out(&self) -> usize {
        self.f.n_out()
    }

    /// Does no output have second derivatives?
    pub fn is_affine(&self) -> bool {
        self.f.hess_pattern().nnz() == 0
    }

    /// Sets one point.
    pub fn set(&mut self, k: usize, t: f64, x: &[f64], u: &[f64], p: &[f64]) {
        let n = self.n;
        let values = x.iter().chain(u).chain(p).copied().chain(std::iter::once(t));
        values.enumerate().for_each(|(j, v)| self.inputs[j * n + k] = v);
    }

    /// The Jacobian by the first `nx` inputs at one point, `[n_out · nx]`, row-major.
    pub fn jacobian_by_states(&self, k: usize, nx: usize, out: &mut [f64]) {
        out.fill(0.0);
        for (e, &(i, c)) in self.jac_entries.iter().enumerate().filter(|e| e.1 .1 < nx) {
            out[i * nx + c] = self.jac[e * self.n + k];
        }
    }

    /// Sets the weights of the Hessian at one point.
    pub fn set_weights(&mut self, k: usize, weights: impl Iterator<Item = f64>) {
        let (n, first) = (self.n, self.dims.n_in());
        weights.enumerate().for_each(|(j, v)| self.inputs[(first + j) * n + k] = v);
    }

    pub fn values(&mut self) -> EvalResult {
        self.counts[0] += 1;
        self.run(0)
    }

    pub fn jacobians(&mut self) -> EvalResult {
        self.counts[1] += 1;
        self.run(1)
    }

    /// Hessians of the sums of the outputs with [`Many::set_weights`].
    pub fn hessians(&mut self) -> EvalResult {
        self.counts[2] += 1;
        self.run(2)
    }

    fn run(&mut self, order: usize) -> EvalResult {
        let Many { f, n, inputs, lanes, .. } = self;
        let out = match order {
            0 => &mut self.value,
            1 => &mut self.jac,
            _ => &mut self.hess,
        };
        if out.is_empty() {
            return Ok(());
        }
        if stop::requested().is_some() {
            return Err(EvalError::Stopped);
        }
        if let Some(e) = f.as_any().and_then(|f| f.downcast_ref::<ExprFunction>()) {
            let tape = [e.value_tape(), e.jacobian_tape(), e.hessian_tape()][order];
            tape.run_batch(*n, inputs, out, lanes)?;
            return if out.iter().all(|v| v.is_finite()) { Ok(()) } else { Err(EvalError::Recoverable) };
        }
        let d = self.dims;
        let size = out.len() / *n;
        let result = &mut self.result[..size];
        for k in 0..*n {
            for (j, v) in self.point.iter_mut().enumerate() {
                *v = inputs.get(j * *n + k).copied().unwrap_or(0.0);
            }
            let (at, weights) = self.point.split_at(d.n_in());
            let (x, u, p) = (&at[..d.x], &at[d.x..d.x + d.u], &at[d.x + d.u..d.t_col()]);
            let at = Point { t: at[d.t_col()], x, u, p };
            match order {
                0 => f.value(&at, result, &mut self.work)?,
                1 => f.jacobian(&at, result, &mut self.work)?,
                _ => f.hessian(&at, weights, result, &mut self.work)?,
            }
            result.iter().enumerate().for_each(|(i, v)| out[i * *n + k] = *v);
        }
        Ok(())
    }
}
