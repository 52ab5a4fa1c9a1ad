//! Expressions as a [`Function`].

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::bundle::Program;
use super::dag::{Block, Dag, Id, Node};
use super::held::no_floor;
use super::saved::SavedGraph;
use super::tape::{Tape, LANES};
use crate::error::{Error, Result};
use crate::func::trouble::{self, Complaint};
use crate::func::{Bundle, Dims, EvalError, EvalResult, Function, Lanes, Point};
use crate::linalg::csc::Pattern;

/// Expressions with exact derivatives, usable wherever a [`Function`] is.
///
/// ```
/// use switchback::expr::Graph;
/// use switchback::func::{Dims, Function};
///
/// let g = Graph::new();
/// let [x, y] = [g.x(0), g.x(1)];
/// let f = g.function("f", Dims { x: 2, u: 0, p: 0 }, &[x * y.sin()]).unwrap();
/// assert_eq!(f.jac_pattern().nnz(), 2);
/// assert_eq!(f.hess_pattern().nnz(), 2); // nothing at (x, x)
/// ```
#[derive(Clone)]
pub struct ExprFunction {
    name: String,
    dims: Dims,
    value: Tape,
    derivatives: OnceLock<Derivatives>,
    approximate: [bool; 2],
    parts: Vec<Part>,
    source: Arc<Result<SavedGraph>>,
    part_len: usize,
    order: Derived,
}

/// Which derivatives a function has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Derived {
    None,
    First,
    Second,
}

/// Programs and patterns of derivatives.
#[derive(Clone)]
struct Derivatives {
    jacobian: Tape,
    hessian: Tape,
    jac_pattern: Pattern,
    hess_pattern: Pattern,
}

impl Derivatives {
    /// Those that are not there: all entries of the Jacobian are no numbers, so that whoever evaluates it is told.
    fn undefined(dims: Dims, n_out: usize) -> Derivatives {
        Derivatives {
            jacobian: Tape::undefined(dims, n_out * dims.n_in()),
            hessian: Tape::undefined(dims, 0),
            jac_pattern: Pattern::dense(n_out, dims.n_in()),
            hess_pattern: Pattern::empty(dims.n_in(), dims.n_in()),
        }
    }

    /// Of outputs in a graph, which grows.
    fn new(dag: &mut Dag, dims: Dims, outputs: &[Id], order: Derived) -> Result<Derivatives> {
        let (columns, wrt) = inputs_of(dag, dims, outputs);
        if order == Derived::None {
            // what they depend on is known all the same: on the time or not
            let n = outputs.len();
            let all = |c: &usize| (0..n).map(|r| (r, *c)).collect::<Vec<_>>();
            let (rows, cols): (Vec<usize>, Vec<usize>) = columns.iter().flat_map(all).unzip();
            return Ok(Derivatives {
                jacobian: Tape::undefined(dims, rows.len()),
                jac_pattern: Pattern::from_triplets(n, dims.n_in(), &rows, &cols).0,
                ..Derivatives::undefined(dims, n)
            });
        }
        let weights = dag.inputs(Block::Weight, outputs.len());
        let mut jac = dag.jacobian(outputs, &wrt)?;
        let mut hess = if order == Derived::Second { dag.hessian(outputs, &weights, &wrt)? } else { Vec::new() };
        jac.iter_mut().for_each(|e| e.col = columns[e.col]);
        hess.iter_mut().for_each(|e| (e.row, e.col) = (columns[e.row], columns[e.col]));
        let tape = |dag: &Dag, n_weights: usize, entries: &[super::diff::Entry]| {
            let ids: Vec<Id> = entries.iter().map(|e| e.value).collect();
            Tape::new(dag, dims, n_weights, &ids)
        };
        let pattern = |n_rows: usize, entries: &[super::diff::Entry]| {
            let (rows, cols): (Vec<usize>, Vec<usize>) = entries.iter().map(|e| (e.row, e.col)).unzip();
            Pattern::from_triplets(n_rows, dims.n_in(), &rows, &cols).0
        };
        Ok(Derivatives {
            jacobian: tape(dag, 0, &jac)?,
            hessian: tape(dag, outputs.len(), &hess)?,
            jac_pattern: pattern(outputs.len(), &jac),
            hess_pattern: pattern(dims.n_in(), &hess),
        })
    }
}

/// Outputs that can be evaluated alone.
#[derive(Clone)]
struct Part {
    rows: Range<usize>,
    value: Tape,
    jacobian: Tape,
    /// Where the entries of the Jacobian belong.
    places: Vec<u32>,
}

impl ExprFunction {
    /// A function of inputs of these sizes. Derivatives are nodes of the graph too, so it grows.
    ///
    /// # Errors
    /// As [`Tape::new`] and [`Dag::jacobian`].
    pub fn new(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id]) -> Result<ExprFunction> {
        if dag.has_floor(outputs) {
            return Err(no_floor(name));
        }
        ExprFunction::with_order(name, dag, dims, outputs, Derived::Second)
    }

    /// One that may jump, see [`Dag::function_at_events`].
    pub(super) fn with_jumps(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id]) -> Result<ExprFunction> {
        ExprFunction::with_order(name, dag, dims, outputs, Derived::Second)
    }

    /// Makes a function of values alone, for those who never ask for derivatives: these are no numbers.
    pub fn values(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id]) -> Result<ExprFunction> {
        if dag.has_floor(outputs) {
            return Err(no_floor(name));
        }
        ExprFunction::with_order(name, dag, dims, outputs, Derived::None)
    }

    /// Makes a function without second derivatives, for those who never ask for them: [`Function::hess_pattern`] is empty and
    /// [`Function::hessian`] fails. The first ones are made when somebody asks for them, or for the workspace that they need.
    pub fn first_order(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id]) -> Result<ExprFunction> {
        if dag.has_floor(outputs) {
            return Err(no_floor(name));
        }
        ExprFunction::with_order(name, dag, dims, outputs, Derived::First)
    }

    fn with_order(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id], order: Derived) -> Result<ExprFunction> {
        let named = |e: Error| in_function(name, e);
        let value = Tape::new(dag, dims, 0, outputs).map_err(named)?;
        let f = ExprFunction {
            parts: Vec::new(),
            source: Arc::new(SavedGraph::new(dag, outputs)),
            part_len: 0,
            name: name.to_owned(),
            dims,
            derivatives: OnceLock::new(),
            approximate: value.approximate_derivatives(),
            value,
            order,
        };
        // copies of expressions do not know what they call
        let later = order == Derived::First && f.source.is_ok() && f.value.functions().next().is_none();
        if !later {
            let made = Derivatives::new(dag, dims, outputs, order).map_err(named)?;
            let _ = f.derivatives.set(made);
        }
        Ok(f)
    }

    /// Programs and patterns of derivatives. Those that are made later, of the saved expressions, are no numbers where they cannot be made.
    fn derivatives(&self) -> &Derivatives {
        self.derivatives.get_or_init(|| {
            let mut dag = Dag::new();
            let outputs = self.source().and_then(|s| s.restore(&mut dag, &[]));
            let made = outputs.and_then(|outputs| Derivatives::new(&mut dag, self.dims, &outputs, self.order));
            made.unwrap_or_else(|_| Derivatives::undefined(self.dims, self.value.n_out()))
        })
    }

    /// A function whose outputs come in parts of equal length that can be evaluated alone, such as modes of which one is
    /// active: [`Function::value_rows`] and [`Function::jacobian_rows`] of a part cost that part only.
    pub fn with_parts(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id], len: usize) -> Result<ExprFunction> {
        let mut f = ExprFunction { part_len: len, ..ExprFunction::new(name, dag, dims, outputs)? };
        for (k, part) in outputs.chunks(len.max(1)).enumerate() {
            let rows = k * len..k * len + part.len();
            let value = Tape::new(dag, dims, 0, part)?;
            let (columns, wrt) = inputs_of(dag, dims, part);
            let mut entries = dag.jacobian(part, &wrt)?;
            entries.iter_mut().for_each(|e| e.col = columns[e.col]);
            let ids: Vec<Id> = entries.iter().map(|e| e.value).collect();
            let jac_pattern = &f.derivatives().jac_pattern;
            let place = |e: &super::diff::Entry| jac_pattern.get(rows.start + e.row, e.col).map(|p| p as u32);
            // The sweep for the part alone may see zeros the whole did not, or the other way round.
            let places: Option<Vec<u32>> = entries.iter().map(place).collect();
            let n_known = jac_pattern.row_idx().iter().filter(|r| rows.contains(r)).count();
            match places {
                Some(places) if places.len() == n_known => {
                    let jacobian = Tape::new(dag, dims, 0, &ids)?;
                    f.parts.push(Part { rows, value, jacobian, places });
                }
                _ => {
                    f.parts.clear();
                    break;
                }
            }
        }
        Ok(f)
    }

    /// The program of the outputs `rows` alone.
    pub(super) fn tape_of(&self, rows: &Range<usize>) -> Option<&Tape> {
        if *rows == (0..self.value.n_out()) {
            return Some(&self.value);
        }
        self.part(rows).map(|p| &p.value)
    }

    fn part(&self, rows: &Range<usize>) -> Option<&Part> {
        let len = self.parts.first()?.rows.len();
        self.parts.get(rows.start / len).filter(|p| p.rows == *rows)
    }

    /// Notes a complaint where the result `r` is that of a point at which the function is not defined: `values` are
    /// the outputs from number `first` on, empty where they are not values.
    #[inline]
    fn checked(&self, part: &'static str, at: &Point, r: EvalResult, values: &[f64], first: usize) -> EvalResult {
        if r == Err(EvalError::Recoverable) {
            self.complain(part, at, values, first);
        }
        r
    }

    #[cold]
    fn complain(&self, part: &'static str, at: &Point, values: &[f64], first: usize) {
        let bad = values.iter().position(|v| !v.is_finite()).map(|i| (first + i, values[i]));
        let place = trouble::place(at, bad);
        trouble::note(Complaint { function: self.name.as_str().into(), part, code: 0, place, timeless: false });
    }

    /// Makes a shared function, see [`ExprFunction::new`].
    pub fn shared(name: &str, dag: &mut Dag, dims: Dims, outputs: &[Id]) -> Result<Arc<dyn Function>> {
        Ok(Arc::new(ExprFunction::new(name, dag, dims, outputs)?))
    }

    /// The expressions, for documents; an error if they cannot be saved.
    pub fn source(&self) -> Result<&SavedGraph> {
        self.source.as_ref().as_ref().map_err(|e| in_function(&self.name, e.clone()))
    }

    /// Length of the parts it was made of, 0 without parts.
    pub fn part_len(&self) -> usize {
        self.part_len
    }

    /// Was it made without second derivatives?
    pub fn is_first_order(&self) -> bool {
        self.order != Derived::Second
    }

    /// Depends on no input.
    pub fn is_constant(&self) -> bool {
        self.derivatives().jac_pattern.nnz() == 0
    }

    /// Has no second derivatives.
    pub fn is_affine(&self) -> bool {
        self.derivatives().hess_pattern.nnz() == 0 && !self.is_first_order()
    }

    /// Program of the values.
    pub fn value_tape(&self) -> &Tape {
        &self.value
    }

    /// Program of the Jacobian, entry by entry of the pattern.
    pub fn jacobian_tape(&self) -> &Tape {
        &self.derivatives().jacobian
    }

    /// Program of the Hessian; its weights are inputs.
    pub fn hessian_tape(&self) -> &Tape {
        &self.derivatives().hessian
    }

    /// Length of the workspace of [`Tape::run_batch`] for all three programs, in units of [`LANES`] numbers.
    pub fn batch_work(&self) -> Vec<[f64; LANES]> {
        vec![[0.0; LANES]; self.work_len()]
    }
}

/// All inputs in the order of the columns of derivative patterns: `x`, `u`, `p`, `t`.
pub(crate) fn all_inputs(dag: &mut Dag, dims: Dims) -> Vec<Id> {
    let mut all = dag.inputs(Block::X, dims.x);
    all.extend(dag.inputs(Block::U, dims.u));
    all.extend(dag.inputs(Block::P, dims.p));
    all.push(dag.input(Block::T, 0));
    all
}

/// The inputs that outputs depend on, in the order of the columns of derivative patterns, and these columns.
fn inputs_of(dag: &Dag, dims: Dims, outputs: &[Id]) -> (Vec<usize>, Vec<Id>) {
    let column = |id: &Id| match dag.node(*id) {
        Node::Input(Block::X, i) => Some((i as usize, *id)),
        Node::Input(Block::U, i) => Some((dims.x + i as usize, *id)),
        Node::Input(Block::P, i) => Some((dims.x + dims.u + i as usize, *id)),
        Node::Input(Block::T, _) => Some((dims.t_col(), *id)),
        _ => None,
    };
    let mut all: Vec<(usize, Id)> = dag.reachable(outputs).iter().filter_map(column).collect();
    all.sort_unstable();
    all.into_iter().unzip()
}

/// Puts the name of a function before a message.
pub(super) fn in_function(name: &str, e: Error) -> Error {
    let put = |s: String| format!("{name}: {s}");
    match e {
        Error::Dimension(s) => Error::Dimension(put(s)),
        Error::Range(s) => Error::Range(put(s)),
        Error::Unsupported(s) => Error::Unsupported(put(s)),
        Error::NonFinite(s) => Error::NonFinite(put(s)),
        other => other,
    }
}

impl Function for ExprFunction {
    fn name(&self) -> &str {
        &self.name
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.value.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.derivatives().jac_pattern
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.derivatives().hess_pattern
    }
    fn work_len(&self) -> usize {
        let parts = self.parts.iter().map(|p| p.value.work_len().max(p.jacobian.work_len())).max().unwrap_or(0);
        let d = self.derivatives();
        parts.max(self.value.work_len()).max(d.jacobian.work_len()).max(d.hessian.work_len())
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let out = &mut out[..self.value.n_out()];
        let r = self.value.run(at, &[], out, work);
        self.checked("value", at, r, out, 0)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let jacobian = &self.derivatives().jacobian;
        let r = jacobian.run(at, &[], &mut out[..jacobian.n_out()], work);
        self.checked("Jacobian", at, r, &[], 0)
    }
    fn value_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let Some(p) = self.part(&rows) else { return self.value(at, out, work) };
        let r = p.value.run(at, &[], &mut out[rows.clone()], work);
        self.checked("value", at, r, &out[rows.clone()], rows.start)
    }
    fn jacobian_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let Some(p) = self.part(&rows) else { return self.jacobian(at, out, work) };
        let r = p.jacobian.run_to(at, out, &p.places, work);
        self.checked("Jacobian", at, r, &[], 0)
    }
    fn jacobian_lanes(
        &self,
        rows: Range<usize>,
        inputs: &[Lanes],
        out: &mut [Lanes],
        work: &mut [Lanes],
    ) -> Option<EvalResult> {
        let (tape, places) = match self.part(&rows) {
            Some(p) => (&p.jacobian, Some(&p.places[..])),
            None => (&self.derivatives().jacobian, None),
        };
        // calls of other functions are points one after the other anyway, and what they complain about has to be noted
        let alone = tape.functions().next().is_some();
        (!alone).then(|| tape.run_points(inputs, out, places, work))
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        if self.is_first_order() {
            return Err(EvalError::Recoverable);
        }
        let hessian = &self.derivatives().hessian;
        let r = hessian.run(at, weights, &mut out[..hessian.n_out()], work);
        self.checked("Hessian", at, r, &[], 0)
    }
    fn bounds(&self, low: &Point, high: &Point, out_low: &mut [f64], out_high: &mut [f64], work: &mut [f64]) -> bool {
        self.value.bounds(low, high, out_low, out_high, work);
        true
    }
    fn hessian_is_constant(&self) -> bool {
        !self.is_first_order() && self.derivatives().hessian.reads_parameters_only()
    }
    fn as_any(&self) -> Option<&dyn std::any::Any> {
        Some(self)
    }
    fn bundle(&self, parts: &[(&dyn Function, Range<usize>)]) -> Option<Box<dyn Bundle>> {
        Some(Box::new(Program::new(parts)?))
    }
    fn is_serial(&self) -> bool {
        // Derivatives call what the value calls.
        self.value.functions().any(|f| f.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.approximate[0]
    }
    fn hessian_is_approximate(&self) -> bool {
        self.approximate[1]
    }
}
