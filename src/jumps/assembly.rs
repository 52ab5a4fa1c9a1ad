//! A nonlinear program whose rows are sums of model functions at points, and of linear terms.
//!
//! Every [`Term`] is a function, the variables or constants behind its inputs, and the rows its outputs are added to, times a
//! constant and, where an integral asks for it, times the length of an element. Values, Jacobian and Hessian follow from that
//! by one traversal; whoever states a program never writes a derivative.

use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::mpcc::Mpcc;
use crate::nlp::{Bounds, Nlp};
use crate::stop;
use crate::system::SharedFunction;

/// A row that does not exist: the output is not used.
pub(super) const NOWHERE: u32 = u32::MAX;
/// The cost instead of a row.
pub(super) const COST: u32 = u32::MAX - 1;
/// Marks inputs that are constants.
const CONSTANT: u32 = 1 << 31;

/// What an input of a function is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Input {
    /// A variable.
    Variable(usize),
    /// A constant.
    Constant(usize),
}

impl Input {
    fn code(self) -> u32 {
        match self {
            Input::Variable(j) => j as u32,
            Input::Constant(k) => k as u32 | CONSTANT,
        }
    }
}

/// A function at a point and where its outputs go.
#[derive(Debug, Clone, Copy)]
struct Term {
    f: usize,
    /// Where its inputs begin.
    inputs: usize,
    /// Where its rows begin.
    rows: usize,
    factor: f64,
    /// The variable that multiplies it, or [`NOWHERE`].
    times: u32,
    /// Where its values and derivatives begin in the cache.
    val: usize,
    jac: usize,
}

/// Collects variables, rows and terms.
#[derive(Default)]
pub(super) struct Builder {
    functions: Vec<SharedFunction>,
    terms: Vec<Term>,
    inputs: Vec<u32>,
    rows: Vec<u32>,
    /// Values and derivatives of all terms.
    lengths: [usize; 2],
    linear: Vec<(u32, u32, f64)>,
    quadratic: Vec<(u32, u32, f64)>,
    pub(super) constants: Vec<f64>,
    pub(super) xl: Vec<f64>,
    pub(super) xu: Vec<f64>,
    /// Where a solve starts.
    pub(super) start: Vec<f64>,
    /// Sizes the variables usually have.
    pub(super) size: Vec<f64>,
    pub(super) cl: Vec<f64>,
    pub(super) cu: Vec<f64>,
    pub(super) pairs: Vec<(usize, usize)>,
}

impl Builder {
    /// A block of `n` variables between bounds, with a start and a size; returns the first.
    pub(super) fn variables(&mut self, n: usize, bounds: [f64; 2], start: f64, size: f64) -> usize {
        let first = self.xl.len();
        self.xl.resize(first + n, bounds[0]);
        self.xu.resize(first + n, bounds[1]);
        self.start.resize(first + n, start);
        self.size.resize(first + n, size);
        first
    }

    /// The same with a size for each of them.
    pub(super) fn sized(&mut self, sizes: &[f64], bounds: [f64; 2]) -> usize {
        let first = self.variables(sizes.len(), bounds, 0.0, 1.0);
        self.size[first..].copy_from_slice(sizes);
        first
    }

    /// One constant; returns its number.
    pub(super) fn constant(&mut self, value: f64) -> usize {
        self.constants.push(value);
        self.constants.len() - 1
    }

    /// A block of `n` rows between bounds; returns the first.
    pub(super) fn rows(&mut self, n: usize, bounds: [f64; 2]) -> usize {
        let first = self.cl.len();
        self.cl.resize(first + n, bounds[0]);
        self.cu.resize(first + n, bounds[1]);
        first
    }

    /// The row that was made last.
    pub(super) fn last_row(&self) -> usize {
        self.cl.len() - 1
    }

    /// Adds `coefficient · variable` to a row.
    pub(super) fn linear(&mut self, row: usize, variable: usize, coefficient: f64) {
        self.linear.push((row as u32, variable as u32, coefficient));
    }

    /// Adds `weight ((a − b)/s)²` times the steepest change of the cost until the program is polished, with the size `s` of `a`: it
    /// guides, and counts for nothing in the end.
    pub(super) fn guide(&mut self, a: usize, b: usize, weight: f64) {
        self.quadratic.push((a as u32, b as u32, weight));
    }

    /// Adds `factor · f(inputs)`, times the variable `times` where there is one, to rows: `rows` gives the row of every
    /// output, or [`NOWHERE`], or [`COST`].
    pub(super) fn term(
        &mut self,
        f: &SharedFunction,
        inputs: &[Input],
        factor: f64,
        times: Option<usize>,
        rows: impl IntoIterator<Item = u32>,
    ) {
        let known = self.functions.iter().position(|g| std::sync::Arc::ptr_eq(f, g));
        let index = known.unwrap_or_else(|| {
            self.functions.push(f.clone());
            self.functions.len() - 1
        });
        let [val, jac] = self.lengths;
        let (at, first) = (self.inputs.len(), self.rows.len());
        self.inputs.extend(inputs.iter().map(|i| i.code()));
        self.rows.extend(rows);
        debug_assert_eq!(self.inputs.len() - at, f.dims().n_in());
        debug_assert_eq!(self.rows.len() - first, f.n_out());
        let times = times.map_or(NOWHERE, |h| h as u32);
        self.terms.push(Term { f: index, inputs: at, rows: first, factor, times, val, jac });
        self.lengths = [val + f.n_out(), jac + f.jac_pattern().nnz()];
    }

    /// The program and its bounds.
    pub(super) fn finish(self) -> (Program, Bounds) {
        let bounds = Bounds { xl: self.xl, xu: self.xu, cl: self.cl, cu: self.cu };
        let longest = self.functions.iter().map(|f| f.dims().n_in()).max().unwrap_or(0);
        let work = self.functions.iter().map(|f| f.work_len()).max().unwrap_or(0);
        let outputs = self.functions.iter().map(|f| f.n_out()).max().unwrap_or(0);
        let second = self.functions.iter().map(|f| f.hess_pattern().nnz()).max().unwrap_or(0);
        let list = |p: &Pattern| -> Vec<(u32, u32)> {
            (0..p.n_cols()).flat_map(|j| p.rows(j).iter().map(move |&i| (i as u32, j as u32))).collect()
        };
        let mut program = Program {
            n: bounds.xl.len(),
            m: bounds.cl.len(),
            jac_entries: self.functions.iter().map(|f| list(f.jac_pattern())).collect(),
            hess_entries: self.functions.iter().map(|f| list(f.hess_pattern())).collect(),
            functions: self.functions,
            terms: self.terms,
            inputs: self.inputs,
            rows: self.rows,
            linear: self.linear,
            weights_told: self.quadratic.iter().map(|q| q.2).collect(),
            quadratic: self.quadratic,
            constants: self.constants,
            pairs: self.pairs,
            size: self.size,
            jac: Pattern::empty(0, 0),
            jac_map: Vec::new(),
            hess: Pattern::empty(0, 0),
            hess_map: Vec::new(),
            val: vec![0.0; self.lengths[0]],
            val_jac: vec![0.0; self.lengths[1]],
            weights: vec![0.0; outputs],
            second: vec![0.0; second],
            point: vec![0.0; longest],
            work: vec![0.0; work],
            polishing: false,
            trouble: None,
        };
        program.make_patterns();
        (program, bounds)
    }
}

/// The program, ready to be solved.
pub(super) struct Program {
    n: usize,
    m: usize,
    functions: Vec<SharedFunction>,
    /// Entries (row, column) of the patterns of the functions.
    jac_entries: Vec<Vec<(u32, u32)>>,
    hess_entries: Vec<Vec<(u32, u32)>>,
    terms: Vec<Term>,
    inputs: Vec<u32>,
    rows: Vec<u32>,
    linear: Vec<(u32, u32, f64)>,
    quadratic: Vec<(u32, u32, f64)>,
    /// Weights of the quadratic terms as multiples of the steepest change of the cost, for differences of usual size.
    weights_told: Vec<f64>,
    constants: Vec<f64>,
    pairs: Vec<(usize, usize)>,
    size: Vec<f64>,
    jac: Pattern,
    jac_map: Vec<usize>,
    hess: Pattern,
    hess_map: Vec<usize>,
    /// Values and Jacobians of all terms.
    val: Vec<f64>,
    val_jac: Vec<f64>,
    weights: Vec<f64>,
    second: Vec<f64>,
    point: Vec<f64>,
    work: Vec<f64>,
    polishing: bool,
    /// The last function without a value, and why.
    trouble: Option<(usize, EvalError)>,
}

/// Reads the inputs of a term into a point.
fn gather(point: &mut [f64], inputs: &[u32], x: &[f64], constants: &[f64]) {
    for (v, &i) in point.iter_mut().zip(inputs) {
        *v = if i & CONSTANT != 0 { constants[(i & !CONSTANT) as usize] } else { x[i as usize] };
    }
}

impl Program {
    /// Constants of the functions: parameters, times.
    pub(super) fn constants_mut(&mut self) -> &mut [f64] {
        &mut self.constants
    }

    /// The function that had no value last, by name.
    pub(super) fn trouble(&self) -> Option<(&str, EvalError)> {
        self.trouble.map(|(f, e)| (self.functions[f].name(), e))
    }

    fn inputs_of(&self, t: &Term) -> &[u32] {
        &self.inputs[t.inputs..t.inputs + self.functions[t.f].dims().n_in()]
    }

    /// All entries of the Jacobian in the order in which they are written: linear terms, then terms.
    fn visit_jacobian(&self, mut entry: impl FnMut(u32, u32)) {
        for &(row, col, _) in &self.linear {
            entry(row, col);
        }
        for t in &self.terms {
            let inputs = self.inputs_of(t);
            for &(i, j) in &self.jac_entries[t.f] {
                let (row, col) = (self.rows[t.rows + i as usize], inputs[j as usize]);
                if row < COST && col & CONSTANT == 0 {
                    entry(row, col);
                }
            }
            if t.times != NOWHERE {
                for i in 0..self.functions[t.f].n_out() {
                    if self.rows[t.rows + i] < COST {
                        entry(self.rows[t.rows + i], t.times);
                    }
                }
            }
        }
    }

    /// All entries of the Hessian, upper triangle, in the order in which they are written.
    fn visit_hessian(&self, mut entry: impl FnMut(u32, u32)) {
        let mut upper = |a: u32, b: u32| entry(a.min(b), a.max(b));
        for &(a, b, _) in &self.quadratic {
            upper(a, a);
            upper(a, b);
            upper(b, b);
        }
        for t in &self.terms {
            let inputs = self.inputs_of(t);
            for &(i, j) in &self.hess_entries[t.f] {
                let (a, b) = (inputs[i as usize], inputs[j as usize]);
                if (a | b) & CONSTANT == 0 {
                    upper(a, b);
                }
            }
            if t.times != NOWHERE {
                for &(i, j) in &self.jac_entries[t.f] {
                    let col = inputs[j as usize];
                    if self.rows[t.rows + i as usize] != NOWHERE && col & CONSTANT == 0 {
                        upper(t.times, col);
                    }
                }
            }
        }
    }

    fn make_patterns(&mut self) {
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        self.visit_jacobian(|i, j| {
            rows.push(i as usize);
            cols.push(j as usize);
        });
        (self.jac, self.jac_map) = Pattern::from_triplets(self.m, self.n, &rows, &cols);
        rows.clear();
        cols.clear();
        self.visit_hessian(|i, j| {
            rows.push(i as usize);
            cols.push(j as usize);
        });
        (self.hess, self.hess_map) = Pattern::from_triplets(self.n, self.n, &rows, &cols);
    }

    /// Evaluates all terms: values, or Jacobians.
    fn evaluate(&mut self, x: &[f64], jacobians: bool) -> EvalResult {
        for k in 0..self.terms.len() {
            let t = self.terms[k];
            let f = &self.functions[t.f];
            let d = f.dims();
            let at = &mut self.point[..d.n_in()];
            gather(at, &self.inputs[t.inputs..t.inputs + d.n_in()], x, &self.constants);
            let (u, p) = (d.x + d.u, d.x + d.u + d.p);
            let at = Point { t: at[p], x: &at[..d.x], u: &at[d.x..u], p: &at[u..p] };
            let done = if jacobians {
                let nnz = self.jac_entries[t.f].len();
                f.jacobian(&at, &mut self.val_jac[t.jac..t.jac + nnz], &mut self.work)
            } else {
                f.value(&at, &mut self.val[t.val..t.val + f.n_out()], &mut self.work)
            };
            if let Err(e) = done {
                self.trouble = Some((t.f, e));
                return Err(e);
            }
        }
        Ok(())
    }

    fn factor(t: &Term, x: &[f64]) -> f64 {
        t.factor * if t.times == NOWHERE { 1.0 } else { x[t.times as usize] }
    }

    /// Names of the functions in a row, and the last variable behind them.
    pub(super) fn behind(&self, row: usize) -> (Vec<&str>, usize) {
        let (mut names, mut last) = (Vec::new(), 0);
        for t in &self.terms {
            let f = &self.functions[t.f];
            if self.rows[t.rows..t.rows + f.n_out()].iter().any(|r| *r as usize == row) {
                names.push(f.name());
                let variables = self.inputs_of(t).iter().filter(|c| **c & CONSTANT == 0);
                last = variables.fold(last, |m, v| m.max(*v as usize));
            }
        }
        (names, last)
    }

    /// The cost alone, without what only guides; `c` is room for the rows.
    pub(super) fn cost(&mut self, x: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        let before = std::mem::replace(&mut self.polishing, true);
        let cost = self.eval(x, c);
        self.polishing = before;
        cost
    }
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
        self.evaluate(x, false)?;
        c.fill(0.0);
        for &(row, col, k) in &self.linear {
            c[row as usize] += k * x[col as usize];
        }
        let mut cost = 0.0;
        for t in &self.terms {
            let factor = Self::factor(t, x);
            let n = self.functions[t.f].n_out();
            for (v, &row) in self.val[t.val..t.val + n].iter().zip(&self.rows[t.rows..t.rows + n]) {
                match row {
                    NOWHERE => {}
                    COST => cost += factor * v,
                    row => c[row as usize] += factor * v,
                }
            }
        }
        if !self.polishing {
            for &(a, b, k) in &self.quadratic {
                let d = x[a as usize] - x[b as usize];
                cost += k * d * d;
            }
        }
        Ok(cost)
    }

    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        self.evaluate(x, true)?;
        self.evaluate(x, false)?;
        grad.fill(0.0);
        jac.fill(0.0);
        let mut at = 0;
        for &(_, _, k) in &self.linear {
            jac[self.jac_map[at]] += k;
            at += 1;
        }
        for t in &self.terms {
            let factor = Self::factor(t, x);
            let inputs = &self.inputs[t.inputs..];
            for (k, &(i, j)) in self.jac_entries[t.f].iter().enumerate() {
                let (row, col) = (self.rows[t.rows + i as usize], inputs[j as usize]);
                if row == NOWHERE || col & CONSTANT != 0 {
                    continue;
                }
                let v = factor * self.val_jac[t.jac + k];
                if row == COST {
                    grad[col as usize] += v;
                } else {
                    jac[self.jac_map[at]] += v;
                    at += 1;
                }
            }
            if t.times != NOWHERE {
                for i in 0..self.functions[t.f].n_out() {
                    let v = t.factor * self.val[t.val + i];
                    match self.rows[t.rows + i] {
                        NOWHERE => {}
                        COST => grad[t.times as usize] += v,
                        _ => {
                            jac[self.jac_map[at]] += v;
                            at += 1;
                        }
                    }
                }
            }
        }
        if !self.polishing {
            for &(a, b, k) in &self.quadratic {
                let d = 2.0 * k * (x[a as usize] - x[b as usize]);
                grad[a as usize] += d;
                grad[b as usize] -= d;
            }
        }
        Ok(())
    }

    fn hessian(&mut self, x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        hess.fill(0.0);
        let mut at = 0;
        for &(_, _, k) in &self.quadratic {
            let k = if self.polishing { 0.0 } else { 2.0 * k * w };
            for v in [k, -k, k] {
                hess[self.hess_map[at]] += v;
                at += 1;
            }
        }
        for k in 0..self.terms.len() {
            let t = self.terms[k];
            let f = &self.functions[t.f];
            let (d, n) = (f.dims(), f.n_out());
            let factor = Self::factor(&t, x);
            let weight = |row: u32| match row {
                NOWHERE => 0.0,
                COST => w,
                row => y[row as usize],
            };
            for (v, &row) in self.weights.iter_mut().zip(&self.rows[t.rows..t.rows + n]) {
                *v = weight(row);
            }
            let inputs = &self.inputs[t.inputs..t.inputs + d.n_in()];
            if !self.hess_entries[t.f].is_empty() {
                let point = &mut self.point[..d.n_in()];
                gather(point, inputs, x, &self.constants);
                let (u, p) = (d.x + d.u, d.x + d.u + d.p);
                let place = Point { t: point[p], x: &point[..d.x], u: &point[d.x..u], p: &point[u..p] };
                let second = &mut self.second[..self.hess_entries[t.f].len()];
                f.hessian(&place, &self.weights[..n], second, &mut self.work)?;
                for (v, &(i, j)) in second.iter().zip(&self.hess_entries[t.f]) {
                    let (a, b) = (inputs[i as usize], inputs[j as usize]);
                    if (a | b) & CONSTANT == 0 {
                        // one variable behind two inputs has both halves of the symmetric entry
                        let twice = if a == b && i != j { 2.0 } else { 1.0 };
                        hess[self.hess_map[at]] += twice * factor * v;
                        at += 1;
                    }
                }
            }
            if t.times != NOWHERE {
                for (k, &(i, j)) in self.jac_entries[t.f].iter().enumerate() {
                    let (row, col) = (self.rows[t.rows + i as usize], inputs[j as usize]);
                    if row != NOWHERE && col & CONSTANT == 0 {
                        let twice = if col == t.times { 2.0 } else { 1.0 };
                        hess[self.hess_map[at]] +=
                            twice * t.factor * self.weights[i as usize] * self.val_jac[t.jac + k];
                        at += 1;
                    }
                }
            }
        }
        Ok(())
    }
}

impl Mpcc for Program {
    fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }
    fn sizes(&self, out: &mut [f64]) {
        for (o, s) in out.iter_mut().zip(&self.size) {
            *o = *s;
        }
    }
    fn is_discretised(&self) -> bool {
        true
    }
    fn set_polishing(&mut self, on: bool) {
        self.polishing = on;
    }
    fn set_steepest(&mut self, steepest: f64) {
        for ((a, _, weight), own) in self.quadratic.iter_mut().zip(&self.weights_told) {
            *weight = own * steepest / self.size[*a as usize].powi(2);
        }
    }
}
