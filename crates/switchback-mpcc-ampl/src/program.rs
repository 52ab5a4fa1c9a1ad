//! A statement as the solver sees it: nonlinear parts are one function, linear parts are added to it.

use crate::statement::{Part, Row, Statement};
use switchback::expr::{Dag, ExprFunction, Id};
use switchback::func::{EvalError, EvalResult};
use switchback::linalg::csc::Pattern;
use switchback::nlp::{Bounds, Nlp};
use switchback::{stop, Dims, Function, Point, Result};

/// Objective to minimise: nonlinear part, linear terms, constant.
#[derive(Debug, Clone, Default)]
pub struct Cost {
    /// Nonlinear part.
    pub nonlinear: Option<Id>,
    /// Variables and their factors.
    pub linear: Vec<(usize, f64)>,
    /// What is added.
    pub constant: f64,
}

/// Objective and rows of a program.
pub struct Program {
    n: usize,
    /// Outputs: the nonlinear part of the objective, if it has one, and those of the rows in `nonlinear_rows`.
    function: ExprFunction,
    cost_is_nonlinear: bool,
    cost: Cost,
    nonlinear_rows: Vec<usize>,
    /// Entries of linear parts: row, column, factor, place in `jac`.
    linear: Vec<(usize, usize, f64, usize)>,
    /// Where entries of the Jacobian of the function go: a place in `jac`, or a column of the gradient.
    places: Vec<std::result::Result<usize, usize>>,
    jac: Pattern,
    hess: Pattern,
    constants: Vec<f64>,
    m: usize,
    out: Vec<f64>,
    jac_values: Vec<f64>,
    weights: Vec<f64>,
    work: Vec<f64>,
    /// Was a function not defined somewhere?
    undefined: Option<&'static str>,
}

impl Program {
    /// Makes a program of a statement, with the bounds of its variables and rows. Its pairs are left to others.
    pub fn new(statement: Statement, cost: Cost) -> Result<(Program, Bounds)> {
        let Statement { mut dag, variables, rows, .. } = statement;
        let (n, m) = (variables.len(), rows.len());
        let bounds = Bounds {
            xl: variables.iter().map(|v| v.lower).collect(),
            xu: variables.iter().map(|v| v.upper).collect(),
            cl: rows.iter().map(|r| r.lower).collect(),
            cu: rows.iter().map(|r| r.upper).collect(),
        };
        let nonlinear_rows: Vec<usize> = (0..m).filter(|i| rows[*i].nonlinear.is_some()).collect();
        let function = function(&mut dag, n, &cost, &rows)?;
        let cost_is_nonlinear = cost.nonlinear.is_some();

        let (mut at_row, mut at_col) = (Vec::new(), Vec::new());
        let mut linear = Vec::new();
        for (i, row) in rows.iter().enumerate() {
            for (j, a) in &row.linear {
                linear.push((i, *j, *a, at_row.len()));
                at_row.push(i);
                at_col.push(*j);
            }
        }
        let mut places = Vec::new();
        let p = function.jac_pattern();
        let first = usize::from(cost_is_nonlinear);
        for j in 0..p.n_cols() {
            for &k in p.rows(j) {
                places.push(match k.checked_sub(first) {
                    None => Err(j),
                    Some(k) => {
                        at_row.push(nonlinear_rows[k]);
                        at_col.push(j);
                        Ok(at_row.len() - 1)
                    }
                });
            }
        }
        let (jac, map) = Pattern::from_triplets(m, n, &at_row, &at_col);
        linear.iter_mut().for_each(|l| l.3 = map[l.3]);
        places.iter_mut().flatten().for_each(|k| *k = map[*k]);
        let h = function.hess_pattern();
        let hess = Pattern::new(n, n, h.col_ptr()[..=n].to_vec(), h.row_idx().to_vec())?;
        let program = Program {
            n,
            m,
            out: vec![0.0; function.n_out()],
            jac_values: vec![0.0; p.nnz()],
            weights: vec![0.0; function.n_out()],
            work: vec![0.0; function.work_len()],
            function,
            cost_is_nonlinear,
            cost,
            nonlinear_rows,
            linear,
            places,
            jac,
            hess,
            constants: rows.iter().map(|r| r.constant).collect(),
            undefined: None,
        };
        Ok((program, bounds))
    }

    /// Which of value, Jacobian and Hessian was not defined somewhere.
    pub fn undefined(&self) -> Option<&'static str> {
        self.undefined
    }

    /// Gives variables that are parts of rows their start, from the other variables of `x[n]`.
    pub fn complete(&mut self, x: &mut [f64], starts: &[(usize, usize, Part)]) {
        let mut c = vec![0.0; self.m];
        let mut row_of = vec![None; self.n];
        starts.iter().for_each(|(i, v, _)| row_of[*v] = Some(*i));
        // Expressions may be nested: every round completes one level more.
        for _ in 0..=starts.len().min(LEVELS) {
            if self.eval(x, &mut c).is_err() {
                return;
            }
            // What the variables contribute themselves is no part of the value.
            for (i, j, a, _) in &self.linear {
                if row_of[*j] == Some(*i) {
                    c[*i] -= a * x[*j];
                }
            }
            let mut changed = false;
            for (i, v, part) in starts {
                let value = part.of(c[*i]);
                changed |= std::mem::replace(&mut x[*v], value) != value;
            }
            if !changed {
                return;
            }
        }
    }

    fn note(&mut self, part: &'static str, r: EvalResult) -> EvalResult {
        if r == Err(EvalError::Recoverable) {
            self.undefined.get_or_insert(part);
        }
        r
    }
}

/// Levels of nested kinks whose start is computed; deeper ones start at what is known then.
const LEVELS: usize = 50;

fn function(dag: &mut Dag, n: usize, cost: &Cost, rows: &[Row]) -> Result<ExprFunction> {
    let outputs: Vec<Id> = cost.nonlinear.into_iter().chain(rows.iter().filter_map(|r| r.nonlinear)).collect();
    ExprFunction::new("the problem", dag, Dims { x: n, u: 0, p: 0 }, &outputs)
}

impl Nlp for Program {
    fn n(&self) -> usize {
        self.n
    }
    fn m(&self) -> usize {
        self.m
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        if stop::requested().is_some() {
            return Err(EvalError::Stopped);
        }
        let r = self.function.value(&Point { t: 0.0, x, u: &[], p: &[] }, &mut self.out, &mut self.work);
        self.note("value", r)?;
        let (cost, parts) = self.out.split_at(usize::from(self.cost_is_nonlinear));
        c.copy_from_slice(&self.constants);
        for (i, v) in self.nonlinear_rows.iter().zip(parts) {
            c[*i] += *v;
        }
        for (i, j, a, _) in &self.linear {
            c[*i] += a * x[*j];
        }
        let start = cost.first().copied().unwrap_or(0.0) + self.cost.constant;
        Ok(self.cost.linear.iter().fold(start, |sum, (j, a)| sum + a * x[*j]))
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let r = self.function.jacobian(&Point { t: 0.0, x, u: &[], p: &[] }, &mut self.jac_values, &mut self.work);
        self.note("Jacobian", r)?;
        grad.fill(0.0);
        jac.fill(0.0);
        for (j, a) in &self.cost.linear {
            grad[*j] += a;
        }
        for (_, _, a, k) in &self.linear {
            jac[*k] += a;
        }
        for (v, place) in self.jac_values.iter().zip(&self.places) {
            match place {
                Ok(k) => jac[*k] += v,
                Err(j) => grad[*j] += v,
            }
        }
        Ok(())
    }
    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let first = usize::from(self.cost_is_nonlinear);
        self.weights[..first].fill(w);
        for (weight, i) in self.weights[first..].iter_mut().zip(&self.nonlinear_rows) {
            *weight = y[*i];
        }
        let at = Point { t: 0.0, x, u: &[], p: &[] };
        let r = self.function.hessian(&at, &self.weights, hess, &mut self.work);
        self.note("Hessian", r)
    }
}
