//! A problem in single shooting taken apart by its stages.
//!
//! The state behind a stage is a function of the inputs of the stage: the state before it, and the controls, lengths, parameters that act in it. With
//! `W_k = ∂inputs_k / ∂z` all derivatives by the variables `z` are products with those by the inputs, the costates follow from the last stage
//! to the first, and second derivatives of the cost `l_k` of the stages make those of the whole, `Σ_k W_kᵀ ∇²l_k W_k`, with states linear in `z`.

use nalgebra::DMatrix;

/// A stage, or what leads from a problem to the next: values at a point and derivatives by its inputs.
#[derive(Debug, Clone)]
pub(in crate::ocp) struct Block {
    /// Is its first input the state at the start of a problem?
    pub begins: bool,
    /// The first of its inputs: the state behind the block before.
    pub states: usize,
    /// The number of inputs `q`.
    pub n_inputs: usize,
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
        let mut inputs = DMatrix::zeros(self.n_inputs, variables.len());
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
        let q = self.n_inputs;
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
}

/// Gradients of the Hamiltonians `cost + μᵀ rows + λᵀ next` of all blocks by their inputs, with the costates `λ` behind each; the first of them are the
/// costates in front.
pub(in crate::ocp) struct Gradients {
    /// `[q]` of each.
    pub of: Vec<Vec<f64>>,
    /// Of constraints between both ends, by the state at the start of the first problem.
    pub start: Vec<f64>,
}

impl Gradients {
    /// With weights of the cost and of all constraints.
    pub fn new(blocks: &[Block], weights: (f64, &[f64])) -> Gradients {
        let n = blocks.len();
        let mut out = Gradients { of: vec![Vec::new(); n], start: Vec::new() };
        let (mut along, mut of_start) = (Vec::new(), Vec::new());
        for (k, block) in blocks.iter().enumerate().rev() {
            along.resize(block.next.nrows(), 0.0);
            out.of[k] = block.gradient(&along, weights);
            along = out.of[k][..block.states].to_vec();
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

/// Second derivatives of the cost by the variables as far as they are known, `[n · n]`; nothing where none are.
pub(super) fn curvature(blocks: &[Block], n: usize) -> Option<DMatrix<f64>> {
    let mut sum: Option<DMatrix<f64>> = None;
    for block in blocks {
        let Some(own) = &block.curvature else { continue };
        let (variables, inputs) = block.acting();
        let part = inputs.transpose() * (own * &inputs);
        let sum = sum.get_or_insert_with(|| DMatrix::zeros(n, n));
        for (&at, column) in variables.iter().zip(part.column_iter()) {
            let mut to = sum.column_mut(at);
            variables.iter().zip(column.iter()).for_each(|(&i, v)| to[i] += v);
        }
    }
    sum
}
