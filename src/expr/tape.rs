//! Evaluation: a flat list of instructions over registers.
//!
//! The workspace holds the inputs that are used, then constants that are no operands of arithmetic, then registers that
//! are used again as soon as their value is dead. Nothing is allocated and nothing recurses while a tape runs. A batch runs every instruction on [`LANES`]
//! points at once, stored beside each other, so that the compiler can vectorise.

use std::cell::Cell;

use super::dag::{Block, CallKind, Dag, External, Group, Id, Node};
use super::linear;
use super::op::{powi, Binary, Unary};
use super::piecewise::Piecewise;
use super::sums::Sums;
use crate::error::{Error, Result};
pub use crate::func::LANES;
use crate::func::{Dims, EvalError, EvalResult, Lanes, Point};
use crate::memory;

/// Code of [`EvalError::Fatal`] for external functions nested without end: one that calls itself through a callback.
pub const CYCLE_CODE: i32 = i32::MIN + 1;

/// Calls of external functions inside each other.
const MAX_NESTING: u32 = 32;

/// What an instruction does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Code {
    Add,
    Sub,
    Mul,
    Div,
    /// Arithmetic with a constant: its number is the second operand, its place the left.
    AddConstant,
    ConstantMinus,
    Scale,
    ConstantOver,
    Neg,
    Square,
    Sqrt,
    Pow,
    Atan2,
    Unary(Unary),
    /// Exponent in the second operand.
    PowI,
    /// Sixteen times the table plus the order of the derivative in the second operand.
    Piecewise,
    /// Number of the block in the first operand; the destination is its first register.
    Block,
}

/// `register[dst] = code(register[a], register[b])`
#[derive(Debug, Clone, Copy)]
pub(super) struct Instruction {
    pub(super) code: Code,
    pub(super) dst: u32,
    pub(super) a: u32,
    pub(super) b: u32,
}

impl Instruction {
    /// What it computes of the registers `w`; of a block, which has several results, nothing.
    #[inline(always)]
    pub(super) fn compute(&self, w: &[f64], immediates: &[f64], tables: &[Piecewise]) -> f64 {
        let (a, b) = (self.a as usize, self.b as usize);
        match self.code {
            Code::Add => w[a] + w[b],
            Code::Sub => w[a] - w[b],
            Code::Mul => w[a] * w[b],
            Code::Div => w[a] / w[b],
            Code::AddConstant => immediates[b] + w[a],
            Code::ConstantMinus => immediates[b] - w[a],
            Code::Scale => immediates[b] * w[a],
            Code::ConstantOver => immediates[b] / w[a],
            Code::Neg => -w[a],
            Code::Square => w[a] * w[a],
            Code::Sqrt => w[a].sqrt(),
            Code::Pow => w[a].powf(w[b]),
            Code::Atan2 => w[a].atan2(w[b]),
            Code::Unary(op) => op.eval(w[a]),
            Code::PowI => powi(w[a], self.b as i32),
            Code::Piecewise => tables[b >> 4].eval((b & 15) as u8, w[a]),
            Code::Block => 0.0,
        }
    }
}

/// An input: its block (`x`, `u`, `p`, `t`, weights), its place there, and its place among all inputs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Load {
    pub(super) block: u32,
    pub(super) index: u32,
    pub(super) flat: u32,
}

/// A computation with several results in registers that follow each other.
#[derive(Clone)]
pub(super) enum Compound {
    /// Decomposes a matrix; pivots follow it.
    Factor { n: usize, matrix: Vec<u32> },
    /// `lu` is the first register of the decomposition.
    Solve { n: usize, lu: usize, transposed: bool, rhs: Vec<u32> },
    /// `scratch` holds inputs, weights, results and workspace without gaps.
    Call { f: External, what: CallKind, args: Vec<u32>, scratch: usize, n: usize },
}

/// A program that computes expressions.
#[derive(Clone)]
pub struct Tape {
    pub(super) dims: Dims,
    pub(super) n_weights: usize,
    pub(super) loads: Vec<Load>,
    pub(super) constants: Vec<f64>,
    /// Constant operands of instructions.
    pub(super) immediates: Vec<f64>,
    pub(super) code: Vec<Instruction>,
    /// The same for one point with sums as one instruction each, where there are any.
    sums: Option<Sums>,
    pub(super) compounds: Vec<Compound>,
    pub(super) piecewise: Vec<Piecewise>,
    pub(super) outputs: Vec<u32>,
    /// All results, if none depends on an input.
    fixed: Option<Vec<f64>>,
    n_slots: usize,
}

/// Blocks of inputs, as [`Load`] numbers them.
const PARAMETERS: u32 = 2;
const WEIGHTS: u32 = 4;

/// Bytes that compiling takes for every node of the graph, about.
const WORK: u128 = 64;

impl Tape {
    /// A program for `outputs` of inputs of these sizes, with `n_weights` further inputs.
    ///
    /// # Errors
    /// [`Error::Dimension`] for an input outside its block, [`Error::NonFinite`] for a constant that is not finite,
    /// [`Error::Unsupported`] for operators that switch, [`Error::Range`] for a condition in the place of a value.
    pub fn new(dag: &Dag, dims: Dims, n_weights: usize, outputs: &[Id]) -> Result<Tape> {
        memory::check()?;
        memory::need(WORK * dag.len() as u128, || format!("a program of a graph with {} nodes", dag.len()))?;
        Compiler::new(dag, dims, n_weights).run(outputs)
    }

    /// A program whose results are defined nowhere.
    pub(super) fn undefined(dims: Dims, n_out: usize) -> Tape {
        Tape {
            dims,
            n_weights: 0,
            loads: Vec::new(),
            constants: vec![f64::NAN],
            immediates: Vec::new(),
            code: Vec::new(),
            sums: None,
            compounds: Vec::new(),
            piecewise: Vec::new(),
            outputs: vec![0; n_out],
            fixed: None,
            n_slots: 1,
        }
    }

    /// Number of results.
    pub fn n_out(&self) -> usize {
        self.outputs.len()
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.code.len()
    }

    /// True if all results are inputs or constants.
    pub fn is_empty(&self) -> bool {
        self.code.is_empty()
    }

    /// Length of the workspace of [`Tape::run`], and of [`Tape::run_batch`] in units of [`LANES`] numbers.
    pub fn work_len(&self) -> usize {
        self.n_slots
    }

    pub(super) fn first_register(&self) -> usize {
        self.loads.len() + self.constants.len()
    }

    /// The external functions it calls.
    pub(super) fn functions(&self) -> impl Iterator<Item = &External> {
        self.compounds.iter().filter_map(|c| match c {
            Compound::Call { f, .. } => Some(f),
            _ => None,
        })
    }

    /// Is the result the same at all states, controls and times?
    pub(super) fn reads_parameters_only(&self) -> bool {
        self.functions().next().is_none() && self.loads.iter().all(|l| l.block == PARAMETERS || l.block == WEIGHTS)
    }

    /// Does an external function give its Jacobian, or its Hessian, by finite differences?
    pub(super) fn approximate_derivatives(&self) -> [bool; 2] {
        let (mut jac, mut hess) = (false, false);
        for f in self.functions() {
            jac |= f.jacobian_is_approximate();
            hess |= f.jacobian_is_approximate() || f.hessian_is_approximate();
        }
        [jac, hess]
    }

    /// Evaluates at one point, `out[n_out]`, `weights[n_weights]`, `work[work_len]`.
    pub fn run(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        if let Some(fixed) = &self.fixed {
            out[..fixed.len()].copy_from_slice(fixed);
            return Ok(());
        }
        let w = self.compute(at, weights, work)?;
        let mut finite = true;
        for (v, &o) in out.iter_mut().zip(&self.outputs) {
            *v = w[o as usize];
            finite &= v.is_finite();
        }
        if finite {
            Ok(())
        } else {
            Err(EvalError::Recoverable)
        }
    }

    /// [`Tape::run`] with result `i` written to `out[places[i]]`.
    pub(super) fn run_to(&self, at: &Point, out: &mut [f64], places: &[u32], work: &mut [f64]) -> EvalResult {
        let w = self.compute(at, &[], work)?;
        let mut finite = true;
        for (&place, &o) in places.iter().zip(&self.outputs) {
            let v = w[o as usize];
            out[place as usize] = v;
            finite &= v.is_finite();
        }
        if finite {
            Ok(())
        } else {
            Err(EvalError::Recoverable)
        }
    }

    /// Loads inputs and constants, runs the instructions, and returns the registers.
    fn compute<'w>(
        &self,
        at: &Point,
        weights: &[f64],
        work: &'w mut [f64],
    ) -> std::result::Result<&'w mut [f64], EvalError> {
        let w = &mut work[..self.n_slots];
        let t = [at.t];
        let blocks = [at.x, at.u, at.p, &t, weights];
        for (v, l) in w.iter_mut().zip(&self.loads) {
            *v = blocks[l.block as usize][l.index as usize];
        }
        for (v, c) in w[self.loads.len()..].iter_mut().zip(&self.constants) {
            *v = *c;
        }
        if let Some(sums) = &self.sums {
            w[self.n_slots - 1] = 1.0;
            sums.run(&sums.steps, w, &self.immediates, &self.piecewise);
            return Ok(w);
        }
        for i in &self.code {
            if i.code == Code::Block {
                self.compounds[i.a as usize].run(i.dst as usize, w)?;
                continue;
            }
            w[i.dst as usize] = i.compute(w, &self.immediates, &self.piecewise);
        }
        Ok(w)
    }

    /// Evaluates at `n` points. Input `j` (numbered `x`, `u`, `p`, `t`, then weights) of point `k` is
    /// `inputs[j n + k]`, result `i` is written to `out[i n + k]`; `work[work_len]`.
    ///
    /// Values that are not finite are written as they are.
    ///
    /// # Errors
    /// What an external function returned, or [`EvalError::Recoverable`] for a singular linear system.
    pub fn run_batch(&self, n: usize, inputs: &[f64], out: &mut [f64], work: &mut [[f64; LANES]]) -> EvalResult {
        let k = self.loads.len();
        let w = &mut work[..self.n_slots];
        for (r, &c) in w[k..].iter_mut().zip(&self.constants) {
            *r = [c; LANES];
        }
        let mut start = 0;
        while start < n {
            let m = LANES.min(n - start);
            for (l, r) in self.loads.iter().zip(&mut w[..k]) {
                let j = l.flat as usize;
                let v = &inputs[j * n + start..j * n + start + m];
                r[..m].copy_from_slice(v);
                // Idle lanes repeat the last point.
                r[m..].fill(v[m - 1]);
            }
            self.run_lanes(w)?;
            for (i, &o) in self.outputs.iter().enumerate() {
                out[i * n + start..i * n + start + m].copy_from_slice(&w[o as usize][..m]);
            }
            start += m;
        }
        Ok(())
    }

    /// Evaluates at [`LANES`] points: `inputs` are numbered as for [`Tape::run_batch`], result `i` is written to
    /// `out[places[i]]`, or to `out[i]` without `places`; `work[work_len]`. Values that are not finite are written as they are.
    pub(super) fn run_points(
        &self,
        inputs: &[Lanes],
        out: &mut [Lanes],
        places: Option<&[u32]>,
        work: &mut [Lanes],
    ) -> EvalResult {
        let k = self.loads.len();
        let w = &mut work[..self.n_slots];
        w[k..].iter_mut().zip(&self.constants).for_each(|(r, c)| *r = [*c; LANES]);
        w.iter_mut().zip(&self.loads).for_each(|(r, l)| *r = inputs[l.flat as usize]);
        self.run_lanes(w)?;
        match places {
            Some(places) => places.iter().zip(&self.outputs).for_each(|(p, o)| out[*p as usize] = w[*o as usize]),
            None => out.iter_mut().zip(&self.outputs).for_each(|(to, o)| *to = w[*o as usize]),
        }
        Ok(())
    }

    fn run_lanes(&self, w: &mut [[f64; LANES]]) -> EvalResult {
        for i in &self.code {
            if i.code == Code::Block {
                self.compounds[i.a as usize].run_lanes(i.dst as usize, w)?;
                continue;
            }
            let a = w[i.a as usize];
            let b = || w[i.b as usize];
            let c = || self.immediates[i.b as usize];
            // One loop per operation, so that each is vectorised.
            w[i.dst as usize] = match i.code {
                Code::Add => map2(a, b(), |a, b| a + b),
                Code::Sub => map2(a, b(), |a, b| a - b),
                Code::Mul => map2(a, b(), |a, b| a * b),
                Code::Div => map2(a, b(), |a, b| a / b),
                Code::AddConstant => map1(a, c(), |a, c| c + a),
                Code::ConstantMinus => map1(a, c(), |a, c| c - a),
                Code::Scale => map1(a, c(), |a, c| c * a),
                Code::ConstantOver => map1(a, c(), |a, c| c / a),
                Code::Pow => map2(a, b(), f64::powf),
                Code::Atan2 => map2(a, b(), f64::atan2),
                Code::Neg => a.map(|a| -a),
                Code::Square => a.map(|a| a * a),
                Code::Sqrt => a.map(f64::sqrt),
                Code::Unary(op) => a.map(|a| op.eval(a)),
                Code::PowI => a.map(|a| powi(a, i.b as i32)),
                Code::Piecewise => {
                    let p = &self.piecewise[(i.b >> 4) as usize];
                    a.map(|a| p.eval((i.b & 15) as u8, a))
                }
                Code::Block => a,
            };
        }
        Ok(())
    }
}

#[inline]
fn map2(a: [f64; LANES], b: [f64; LANES], f: impl Fn(f64, f64) -> f64) -> [f64; LANES] {
    std::array::from_fn(|l| f(a[l], b[l]))
}

#[inline]
fn map1(a: [f64; LANES], c: f64, f: impl Fn(f64, f64) -> f64) -> [f64; LANES] {
    a.map(|a| f(a, c))
}

impl Compound {
    /// Computes at one point. Out of line, which keeps the loop over instructions small.
    #[inline(never)]
    fn run(&self, dst: usize, w: &mut [f64]) -> EvalResult {
        match self {
            Compound::Factor { n, matrix } => {
                for (k, &m) in matrix.iter().enumerate() {
                    w[dst + k] = w[m as usize];
                }
                regular(linear::factor(*n, &mut w[dst..]))
            }
            Compound::Solve { n, lu, transposed, rhs } => {
                for (k, &r) in rhs.iter().enumerate() {
                    w[dst + k] = w[r as usize];
                }
                // A decomposition comes before what uses it.
                let (before, x) = w.split_at_mut(dst);
                linear::solve(*n, &before[*lu..], *transposed, x);
                Ok(())
            }
            Compound::Call { .. } => self.call::<1>(dst, w, 0),
        }
    }

    /// [`Compound::run`] at [`LANES`] points.
    #[inline(never)]
    fn run_lanes(&self, dst: usize, w: &mut [[f64; LANES]]) -> EvalResult {
        match self {
            Compound::Factor { n, matrix } => {
                for (k, &m) in matrix.iter().enumerate() {
                    w[dst + k] = w[m as usize];
                }
                regular(linear::factor_lanes(*n, &mut w[dst..]))
            }
            Compound::Solve { n, lu, transposed, rhs } => {
                for (k, &r) in rhs.iter().enumerate() {
                    w[dst + k] = w[r as usize];
                }
                let (before, x) = w.split_at_mut(dst);
                linear::solve_lanes(*n, &before[*lu..], *transposed, x);
                Ok(())
            }
            Compound::Call { .. } => {
                (0..LANES).try_for_each(|lane| self.call::<LANES>(dst, w.as_flattened_mut(), lane))
            }
        }
    }

    /// Calls an external function with the registers of one lane; register `r` is at `w[r S + lane]`.
    fn call<const S: usize>(&self, dst: usize, w: &mut [f64], lane: usize) -> EvalResult {
        let Compound::Call { f, what, args, scratch, n } = self else { return Ok(()) };
        let at = |r: usize| r * S + lane;
        let d = f.dims();
        let (w, s) = w.split_at_mut(scratch * S);
        let (input, s) = s.split_at_mut(d.n_in());
        let (weights, s) = s.split_at_mut(f.n_out());
        let (out, work) = s.split_at_mut(*n);
        for (v, &a) in input.iter_mut().zip(args) {
            *v = w[at(a as usize)];
        }
        let (x, u, p) = (&input[..d.x], &input[d.x..d.x + d.u], &input[d.x + d.u..d.t_col()]);
        let point = Point { t: input[d.t_col()], x, u, p };
        nested(|| match what {
            CallKind::Value => f.value(&point, out, work),
            CallKind::Jacobian => f.jacobian(&point, out, work),
            CallKind::Hessian(i) => {
                weights.fill(0.0);
                weights[*i as usize] = 1.0;
                f.hessian(&point, weights, out, work)
            }
        })?;
        for (k, &v) in out.iter().enumerate() {
            w[at(dst + k)] = v;
        }
        Ok(())
    }
}

fn regular(matrix: bool) -> EvalResult {
    if matrix {
        Ok(())
    } else {
        Err(EvalError::Recoverable)
    }
}

thread_local! {
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Runs a call of an external function; one that never ends is refused before the stack overflows.
fn nested(call: impl FnOnce() -> EvalResult) -> EvalResult {
    let depth = DEPTH.get();
    if depth >= MAX_NESTING {
        return Err(EvalError::Fatal(CYCLE_CODE));
    }
    DEPTH.set(depth + 1);
    let result = call();
    DEPTH.set(depth);
    result
}

const NONE: u32 = u32::MAX;

/// Turns a part of a graph into a tape.
struct Compiler<'a> {
    dag: &'a Dag,
    tape: Tape,
    /// Register of every node, by number.
    slot: Vec<u32>,
    /// Place of the last use of every node; `NONE` for what must stay.
    last: Vec<u32>,
    free: Vec<u32>,
    /// First register of every group.
    group_slot: Vec<u32>,
    tables: Vec<u32>,
}

impl Compiler<'_> {
    fn new(dag: &Dag, dims: Dims, n_weights: usize) -> Compiler<'_> {
        let tape = Tape {
            dims,
            n_weights,
            loads: Vec::new(),
            constants: Vec::new(),
            immediates: Vec::new(),
            code: Vec::new(),
            sums: None,
            compounds: Vec::new(),
            piecewise: Vec::new(),
            outputs: Vec::new(),
            fixed: None,
            n_slots: 0,
        };
        Compiler {
            dag,
            tape,
            slot: Vec::new(),
            last: Vec::new(),
            free: Vec::new(),
            group_slot: vec![NONE; dag.groups.len()],
            tables: vec![NONE; dag.piecewise.len()],
        }
    }

    fn run(mut self, outputs: &[Id]) -> Result<Tape> {
        let dag = self.dag;
        let ids = dag.reachable(outputs);
        let top = ids.last().map_or(0, |id| id.index() + 1);
        self.slot = vec![NONE; top];
        self.last = vec![0; top];
        if ids.iter().any(|&id| matches!(dag.node(id), Node::Select(..))) {
            return Err(Error::Unsupported(
                "sign, abs, min, max and where are not evaluated: build a model of the dynamics, which turns them into \
                 switching functions"
                    .into(),
            ));
        }
        let mut resident = vec![false; top];
        for &id in &ids {
            match dag.node(id) {
                Node::Input(block, index) => self.slot[id.index()] = self.input(block, index as usize)?,
                Node::Const(bits) => {
                    let v = f64::from_bits(bits);
                    if !v.is_finite() {
                        return Err(Error::NonFinite(format!(
                            "the expression contains the constant {v}: constants must be finite, also those that come \
                             out of computing with constants"
                        )));
                    }
                }
                Node::Truth(_) | Node::Positive(_) | Node::Not(_) | Node::And(..) | Node::Or(..) => {
                    return Err(Error::Range("a condition is no value: choose values with where".into()))
                }
                Node::Binary(Binary::Add | Binary::Sub | Binary::Mul | Binary::Div, _, b) => resident[b.index()] = true,
                _ => dag.for_children(id, |c| resident[c.index()] = true),
            }
        }
        outputs.iter().for_each(|o| resident[o.index()] = true);
        for &id in &ids {
            if let (Node::Const(bits), true) = (dag.node(id), resident[id.index()]) {
                self.slot[id.index()] = self.tape.first_register() as u32;
                self.tape.constants.push(f64::from_bits(bits));
            }
        }
        self.tape.n_slots = self.tape.first_register();
        for (place, &id) in ids.iter().enumerate() {
            let last = &mut self.last;
            dag.for_children(id, |c| last[c.index()] = place as u32);
        }
        for &o in outputs {
            self.last[o.index()] = NONE;
        }
        for (place, &id) in ids.iter().enumerate() {
            self.emit(place as u32, id);
        }
        self.tape.outputs = outputs.iter().map(|o| self.slot[o.index()]).collect();
        let mut sums = Sums::default();
        if sums.push(&self.tape.code, &self.tape.immediates, &self.tape.outputs, self.tape.n_slots as u32) {
            self.fresh(1);
            self.tape.sums = Some(sums);
        }
        self.tape.fixed = outputs.iter().map(|&o| dag.as_const(o)).collect();
        Ok(self.tape)
    }

    fn input(&mut self, block: Block, index: usize) -> Result<u32> {
        let d = self.tape.dims;
        let (number, size, first, name) = match block {
            Block::X => (0, d.x, 0, "x"),
            Block::U => (1, d.u, d.x, "u"),
            Block::P => (PARAMETERS, d.p, d.x + d.u, "p"),
            Block::T => (3, 1, d.t_col(), "t"),
            Block::Weight => (WEIGHTS, self.tape.n_weights, d.n_in(), "weights"),
            Block::Unknown => return Err(Error::Range(
                "the expression contains an unknown of an inner problem: take what the problem gives for it instead"
                    .into(),
            )),
        };
        if index < size {
            self.tape.loads.push(Load { block: number, index: index as u32, flat: (first + index) as u32 });
            return Ok((self.tape.loads.len() - 1) as u32);
        }
        Err(Error::Dimension(format!("the expression uses {name}[{index}], but {name} has the size {size}")))
    }

    fn emit(&mut self, place: u32, id: Id) {
        let dag = self.dag;
        let at = |c: &Compiler, a: Id| c.slot[a.index()];
        let (code, a, b) = match dag.node(id) {
            Node::Unary(op, a) => {
                let code = match op {
                    Unary::Neg => Code::Neg,
                    Unary::Sqrt => Code::Sqrt,
                    _ => Code::Unary(op),
                };
                (code, at(self, a), 0)
            }
            Node::Binary(op @ (Binary::Add | Binary::Sub | Binary::Mul | Binary::Div), a, b)
                if dag.as_const(a).is_some() =>
            {
                let code = match op {
                    Binary::Add => Code::AddConstant,
                    Binary::Sub => Code::ConstantMinus,
                    Binary::Mul => Code::Scale,
                    _ => Code::ConstantOver,
                };
                self.tape.immediates.extend(dag.as_const(a));
                (code, at(self, b), (self.tape.immediates.len() - 1) as u32)
            }
            Node::Binary(op, a, b) => {
                let code = match op {
                    Binary::Add => Code::Add,
                    Binary::Sub => Code::Sub,
                    Binary::Mul => Code::Mul,
                    Binary::Div => Code::Div,
                    Binary::Pow => Code::Pow,
                    Binary::Atan2 => Code::Atan2,
                };
                (code, at(self, a), at(self, b))
            }
            Node::PowI(a, 2) => (Code::Square, at(self, a), 0),
            Node::PowI(a, n) => (Code::PowI, at(self, a), n as u32),
            Node::Piecewise(table, order, a) => {
                (Code::Piecewise, at(self, a), 16 * self.table(table) + u32::from(order))
            }
            Node::Pick(g, k) => {
                if self.group_slot[g as usize] == NONE {
                    self.emit_group(g);
                    self.release(place, id);
                }
                self.slot[id.index()] = self.group_slot[g as usize] + k;
                return;
            }
            _ => return,
        };
        self.release(place, id);
        let dst = self.free.pop().unwrap_or_else(|| self.fresh(1));
        self.slot[id.index()] = dst;
        self.tape.code.push(Instruction { code, dst, a, b });
    }

    /// Frees the registers of operands that are not needed any more.
    fn release(&mut self, place: u32, id: Id) {
        let (dag, last, slot, free) = (self.dag, &mut self.last, &self.slot, &mut self.free);
        dag.for_children(id, |c| {
            let keeps = matches!(dag.node(c), Node::Input(..) | Node::Const(_) | Node::Pick(..));
            if last[c.index()] == place && !keeps {
                // Once, if it is an operand twice.
                last[c.index()] = NONE;
                free.push(slot[c.index()]);
            }
        });
    }

    fn fresh(&mut self, n: usize) -> u32 {
        let first = self.tape.n_slots;
        self.tape.n_slots += n;
        first as u32
    }

    fn table(&mut self, index: u32) -> u32 {
        if self.tables[index as usize] == NONE {
            self.tables[index as usize] = self.tape.piecewise.len() as u32;
            self.tape.piecewise.push(self.dag.piecewise[index as usize].clone());
        }
        self.tables[index as usize]
    }

    /// Blocks keep their registers: they are few, and decompositions are read by derivatives much later.
    fn emit_group(&mut self, g: u32) {
        let dag = self.dag;
        let entry = &dag.groups[g as usize];
        let slots = |c: &Compiler, ids: &[Id]| ids.iter().map(|a| c.slot[a.index()]).collect::<Vec<u32>>();
        let (compound, n) = match &entry.group {
            Group::Factor { n, matrix } => {
                let n = *n as usize;
                (Compound::Factor { n, matrix: slots(self, matrix) }, n * n + n)
            }
            Group::Solve { factor, transposed, rhs } => {
                if self.group_slot[*factor as usize] == NONE {
                    self.emit_group(*factor);
                }
                let lu = self.group_slot[*factor as usize] as usize;
                let n = rhs.len();
                (Compound::Solve { n, lu, transposed: *transposed, rhs: slots(self, rhs) }, n)
            }
            Group::Call { function, what, args } => {
                let f = dag.functions[*function as usize].clone();
                let n = entry.n as usize;
                let args = slots(self, args);
                // The scratch lies behind the results.
                let scratch = self.tape.n_slots + n;
                let total = n + f.dims().n_in() + f.n_out() + n + f.work_len();
                (Compound::Call { f, what: *what, args, scratch, n }, total)
            }
        };
        let dst = self.fresh(n);
        self.group_slot[g as usize] = dst;
        let a = self.tape.compounds.len() as u32;
        self.tape.compounds.push(compound);
        self.tape.code.push(Instruction { code: Code::Block, dst, a, b: 0 });
    }
}
