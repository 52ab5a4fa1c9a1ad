//! A problem in single shooting taken apart by its stages, and the Hessian of its Lagrange function by those of the stages.
//!
//! The state behind a stage is a function of the inputs of the stage: the state before it, and the controls, lengths, parameters that act in it. With the
//! costates `λ` of the motion the Hessian of the Lagrange function by the variables `z` is a sum,
//!
//! ```text
//! ∇²L = Σ_k W_kᵀ ∇²H_k W_k,    H_k = cost_k + μᵀ rows_k + λ_{k+1}ᵀ x_{k+1},    W_k = ∂inputs_k / ∂z.
//! ```
//!
//! Every `H_k` is a function of few inputs and has a damped BFGS update of its own (M. J. D. Powell, 1978), so that one step shows as many curvatures
//! as there are stages, and steps do not grow with their number (H. G. Bock, K. J. Plitt, *A multiple shooting algorithm for direct solution of
//! optimal control problems*, 1984).

use nalgebra::{DMatrix, DVector};

/// Least curvature along a step, relative to that of the model, of Powell's damping.
const DAMPING: f64 = 0.2;
/// Share of a known curvature that is added to it: combinations of variables may have none.
const REGULAR: f64 = 1e-3;
/// Share of the largest curvature below which one counts as none.
const NOTHING: f64 = 1e-10;

/// A stage, or what leads from a problem to the next: values at a point and derivatives by its inputs.
#[derive(Debug, Clone)]
pub(in crate::ocp) struct Block {
    /// Is its first input the state at the start of a problem?
    pub begins: bool,
    /// The first of its inputs: the state behind the block before.
    pub states: usize,
    /// `[q]`
    pub inputs: Vec<f64>,
    /// Derivatives of the first inputs by the variables, `[at most q × n]`.
    pub dense: DMatrix<f64>,
    /// Inputs behind those that are a multiple of a variable: the input, the variable, the factor.
    pub own: Vec<(usize, usize, f64)>,
    /// Derivatives by the inputs: of the state behind it, of the cost, and of the constraints from `first` on, row by row.
    pub next: DMatrix<f64>,
    pub cost: Vec<f64>,
    pub first: usize,
    pub rows: Vec<f64>,
    /// Derivatives of constraints, from one on each, by the state at the start of the problem.
    pub start: Vec<(usize, DMatrix<f64>)>,
    /// The positive part of the second derivatives of its cost as far as they are known, `[q × q]`.
    pub curvature: Option<DMatrix<f64>>,
}

impl Block {
    /// A program that is not taken apart, of `n` variables.
    pub fn whole(z: &[f64], gradient: &[f64], jacobian: &[f64]) -> Block {
        let n = z.len();
        Block {
            begins: false,
            states: 0,
            inputs: z.to_vec(),
            dense: DMatrix::zeros(0, n),
            own: (0..n).map(|j| (j, j, 1.0)).collect(),
            next: DMatrix::zeros(0, n),
            cost: gradient.to_vec(),
            first: 0,
            rows: jacobian.to_vec(),
            start: Vec::new(),
            curvature: None,
        }
    }

    /// Rows `by` of derivatives by the inputs as derivatives by the variables.
    pub fn by_variables(&self, by: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = by.columns(0, self.dense.nrows()) * &self.dense;
        for &(input, variable, factor) in &self.own {
            out.column_mut(variable).axpy(factor, &by.column(input), 1.0);
        }
        out
    }

    /// The variables that its inputs depend on, and the derivatives of these `[q × variables]`: no control acts before its stage.
    fn acting(&self) -> (Vec<usize>, DMatrix<f64>) {
        let mut acts: Vec<bool> = self.dense.column_iter().map(|c| c.iter().any(|v| *v != 0.0)).collect();
        self.own.iter().for_each(|(_, variable, _)| acts[*variable] = true);
        let variables: Vec<usize> = (0..acts.len()).filter(|&v| acts[v]).collect();
        let mut inputs = DMatrix::zeros(self.inputs.len(), variables.len());
        for (mut to, &v) in inputs.column_iter_mut().zip(&variables) {
            to.rows_mut(0, self.dense.nrows()).copy_from(&self.dense.column(v));
        }
        for (input, variable, factor) in &self.own {
            if let Ok(at) = variables.binary_search(variable) {
                inputs[(*input, at)] = *factor;
            }
        }
        (variables, inputs)
    }

    /// Derivatives of its cost and its constraints by the variables, where those of the state at the start of the problem are `start`.
    pub fn derivatives(&self, start: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let q = self.inputs.len();
        let mut rows = self.by_variables(&DMatrix::from_row_slice(self.rows.len() / q, q, &self.rows));
        for (first, by) in &self.start {
            rows.rows_mut(first - self.first, by.nrows()).gemm(1.0, by, start, 1.0);
        }
        (self.by_variables(&DMatrix::from_row_slice(1, q, &self.cost)), rows)
    }

    /// The gradient of its Hamiltonian by the inputs, with costates behind it and the weights of the cost and of all constraints.
    fn gradient(&self, behind: &[f64], (cost, weights): (f64, &[f64])) -> Vec<f64> {
        let mut out: Vec<f64> = self.cost.iter().map(|c| cost * c).collect();
        let q = out.len();
        for (lambda, row) in behind.iter().zip(self.next.row_iter()).filter(|(l, _)| **l != 0.0) {
            out.iter_mut().zip(row.iter()).for_each(|(o, v)| *o += lambda * v);
        }
        for (mu, row) in weights[self.first..].iter().zip(self.rows.chunks_exact(q)).filter(|(mu, _)| **mu != 0.0) {
            out.iter_mut().zip(row).for_each(|(o, v)| *o += mu * v);
        }
        out
    }

    /// Changes the units of the variables to these.
    pub fn scale(&mut self, size: &[f64]) {
        self.dense.column_iter_mut().zip(size).for_each(|(mut c, s)| c *= *s);
        self.own.iter_mut().for_each(|(_, variable, factor)| *factor *= size[*variable]);
    }
}

/// Gradients of the Hamiltonians of all blocks, with costates behind them: from the last one to the first, in reverse order.
pub(in crate::ocp) struct Gradients {
    /// `[q]` of each.
    pub of: Vec<Vec<f64>>,
    /// `[nx]` of each.
    pub behind: Vec<Vec<f64>>,
    /// Of constraints between both ends, by the state at the start of the first problem.
    pub start: Vec<f64>,
}

impl Gradients {
    /// With weights of the cost and of all constraints.
    pub fn new(blocks: &[Block], weights: (f64, &[f64])) -> Gradients {
        let n = blocks.len();
        let mut out = Gradients { of: vec![Vec::new(); n], behind: vec![Vec::new(); n], start: Vec::new() };
        let (mut along, mut of_start) = (Vec::new(), Vec::new());
        for (k, block) in blocks.iter().enumerate().rev() {
            along.resize(block.next.nrows(), 0.0);
            out.of[k] = block.gradient(&along, weights);
            out.behind[k] = std::mem::replace(&mut along, out.of[k][..block.states].to_vec());
            for (first, by) in &block.start {
                of_start.resize(by.ncols(), 0.0);
                for (mu, row) in weights.1[*first..].iter().zip(by.row_iter()) {
                    of_start.iter_mut().zip(row.iter()).for_each(|(s, v)| *s += mu * v);
                }
            }
            if block.begins {
                along.iter_mut().zip(&of_start).for_each(|(a, s)| *a += s);
                out.start = std::mem::take(&mut of_start);
            }
        }
        out
    }
}

/// Second derivatives of the cost by each of `n` variables, as far as they are known.
pub(super) fn bends(blocks: &[Block], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    Hessian { of: of_cost(blocks, 1.0), curved: true }.assemble(blocks, &mut out);
    out.into_iter().step_by(n + 1).collect()
}

fn of_cost(blocks: &[Block], unit: f64) -> Vec<DMatrix<f64>> {
    let none = |b: &Block| DMatrix::zeros(b.inputs.len(), b.inputs.len());
    blocks.iter().map(|b| b.curvature.as_ref().map_or_else(|| none(b), |c| c * unit)).collect()
}

/// The Hessian of a Lagrange function by those of its blocks.
#[derive(Debug, Default)]
pub(super) struct Hessian {
    /// `[q × q]` of each.
    of: Vec<DMatrix<f64>>,
    /// Does something of it come from the cost?
    pub curved: bool,
}

impl Hessian {
    /// What is known before steps have shown more: the curvature of the cost, times `unit`, and for variables of which that says nothing
    /// the curvature `guess`.
    pub fn restart(&mut self, blocks: &[Block], unit: f64, guess: f64, out: &mut [f64]) {
        self.curved = blocks.iter().any(|b| b.curvature.is_some());
        self.of = of_cost(blocks, unit);
        self.assemble(blocks, out);
        let n = (out.len() as f64).sqrt() as usize;
        let diagonal: Vec<f64> = out.iter().step_by(n + 1).copied().collect();
        let largest = diagonal.iter().fold(0f64, |m, d| m.max(*d));
        let more = |v: usize| if diagonal[v] > NOTHING * largest { REGULAR * diagonal[v] } else { guess };
        let inputs: Vec<Vec<(usize, usize, f64)>> = blocks.iter().map(begun).collect();
        let mut count = vec![0.0; n];
        inputs.iter().flatten().for_each(|(_, v, _)| count[*v] += 1.0);
        for (own, inputs) in self.of.iter_mut().zip(&inputs) {
            for &(input, v, factor) in inputs {
                own[(input, input)] += more(v) / (count[v] * factor * factor);
            }
        }
        self.assemble(blocks, out);
    }

    /// The damped updates with what a step shows of the Hamiltonians at its end, with weights of the cost and of all constraints.
    pub fn update(&mut self, here: &[Block], there: &[Block], weights: (f64, &[f64]), out: &mut [f64]) {
        let end = Gradients::new(there, weights);
        for (k, own) in self.of.iter_mut().enumerate() {
            let start = here[k].gradient(&end.behind[k], weights);
            let step =
                DVector::from_iterator(start.len(), there[k].inputs.iter().zip(&here[k].inputs).map(|(a, b)| a - b));
            let change = DVector::from_iterator(start.len(), end.of[k].iter().zip(&start).map(|(a, b)| a - b));
            damped(own, &step, change);
        }
        self.assemble(there, out);
    }

    /// The sum over all blocks `[n · n]`.
    fn assemble(&self, blocks: &[Block], out: &mut [f64]) {
        out.fill(0.0);
        let n = (out.len() as f64).sqrt() as usize;
        let mut sum = nalgebra::DMatrixViewMut::from_slice(out, n, n);
        for (own, block) in self.of.iter().zip(blocks) {
            let (variables, inputs) = block.acting();
            let part = inputs.transpose() * (own * &inputs);
            for (&at, column) in variables.iter().zip(part.column_iter()) {
                let mut to = sum.column_mut(at);
                variables.iter().zip(column.iter()).for_each(|(&i, v)| to[i] += v);
            }
        }
    }
}

/// Inputs of a block that are a multiple of a variable alone; at the start of a problem initial states are, too.
fn begun(block: &Block) -> Vec<(usize, usize, f64)> {
    let mut out = block.own.clone();
    if block.begins {
        for i in 0..block.states.min(block.dense.nrows()) {
            let row = block.dense.row(i);
            let mut entries = row.iter().enumerate().filter(|(_, v)| **v != 0.0);
            if let (Some((v, factor)), None) = (entries.next(), entries.next()) {
                out.push((i, v, *factor));
            }
        }
    }
    out
}

/// The update of a Hessian with a step and the change of the gradient along it.
fn damped(h: &mut DMatrix<f64>, s: &DVector<f64>, mut change: DVector<f64>) {
    let hs = &*h * s;
    let (shs, sy) = (s.dot(&hs), s.dot(&change));
    if !sy.is_finite() || !(shs > 0.0 || sy > 0.0) {
        return;
    }
    if sy < DAMPING * shs {
        let theta = (1.0 - DAMPING) * shs / (shs - sy);
        change = change * theta + &hs * (1.0 - theta);
    }
    let sr = s.dot(&change);
    h.ger(1.0 / sr, &change, &change, 1.0);
    if shs > 0.0 {
        h.ger(-1.0 / shs, &hs, &hs, 1.0);
    }
}
