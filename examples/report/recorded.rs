//! Problems recorded as lists of instructions (`.mpcc` files), one list per function and derivative.
//!
//! Little endian: `MPCCVM1\0`; 28 integers: `n`, `m`, `c`, entries of the Jacobian and of the Hessian, length of the
//! name, two unused, and for each of five functions the numbers of instructions, registers, constants and outputs; the
//! name; start, bounds of variables and rows; both patterns, by columns, with column numbers; for `G` and `H` the
//! variables they are, or −1; then constants and instructions `(operation, target, a, b)` of `f`, its gradient, the rows
//! `[g; G; H]`, their Jacobian, and the Hessian of the Lagrangian with weights `[f, g, G, H]`.

use switchback::func::{EvalError, EvalResult};
use switchback::linalg::csc::Pattern;
use switchback::mpcc::Member;
use switchback::nlp::{Bounds, Nlp};

/// A list of instructions.
#[derive(Clone)]
struct Tape {
    constants: Vec<f64>,
    code: Vec<[i32; 4]>,
    registers: usize,
    outputs: usize,
}

/// A recorded nonlinear program.
#[derive(Clone)]
pub struct Recorded {
    n: usize,
    m: usize,
    jac: Pattern,
    hess: Pattern,
    tapes: Vec<Tape>,
    registers: Vec<f64>,
    weights: Vec<f64>,
    x: Vec<f64>,
}

/// What a file holds.
pub struct File {
    pub program: Recorded,
    pub bounds: Bounds,
    pub members: Vec<(Member, Member)>,
    pub start: Vec<f64>,
}

struct Bytes<'a> {
    data: &'a [u8],
    at: usize,
}

impl Bytes<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], String> {
        let end = self.at.checked_add(n).filter(|&e| e <= self.data.len()).ok_or("the file is cut short")?;
        let part = &self.data[self.at..end];
        self.at = end;
        Ok(part)
    }
    fn floats(&mut self, n: usize) -> Result<Vec<f64>, String> {
        let b = self.take(8 * n)?;
        Ok(b.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().expect("eight bytes"))).collect())
    }
    fn ints(&mut self, n: usize) -> Result<Vec<i32>, String> {
        let b = self.take(4 * n)?;
        Ok(b.chunks_exact(4).map(|c| i32::from_le_bytes(c.try_into().expect("four bytes"))).collect())
    }
    /// Integers padded to eight bytes.
    fn padded(&mut self, n: usize) -> Result<Vec<i32>, String> {
        let mut v = self.ints(n + n % 2)?;
        v.truncate(n);
        Ok(v)
    }
    fn pattern(&mut self, rows: usize, cols: usize, nnz: usize) -> Result<Pattern, String> {
        let size = |v: Vec<i32>| -> Vec<usize> { v.into_iter().map(|i| i.max(0) as usize).collect() };
        let col_ptr = size(self.padded(cols + 1)?);
        let row_idx = size(self.padded(nnz)?);
        self.padded(nnz)?;
        Pattern::new(rows, cols, col_ptr, row_idx).map_err(|e| e.to_string())
    }
}

/// Reads a problem.
pub fn read(path: &std::path::Path) -> Result<File, String> {
    let data = std::fs::read(path).map_err(|e| e.to_string())?;
    let mut b = Bytes { data: &data, at: 0 };
    if b.take(8)? != b"MPCCVM1\0" {
        return Err("not a recorded problem".into());
    }
    let head = b.ints(28)?;
    let size = |i: usize| head[i].max(0) as usize;
    let (n, m, c) = (size(0), size(1), size(2));
    b.take(size(5))?;
    let start = b.floats(n)?;
    let (xl, xu) = (b.floats(n)?, b.floats(n)?);
    let (mut cl, mut cu) = (b.floats(m)?, b.floats(m)?);
    let rows = m + 2 * c;
    let jac = b.pattern(rows, n, size(3))?;
    let hess = b.pattern(n, n, size(4))?;
    let (g, h) = (b.padded(c)?, b.padded(c)?);
    let mut tapes = Vec::new();
    for k in 0..5 {
        let s = |i: usize| size(8 + 4 * k + i);
        let constants = b.floats(s(2))?;
        let code = b.ints(4 * s(0))?.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect();
        let tape = Tape { constants, code, registers: s(1), outputs: s(3) };
        tape.check(n, 1 + rows)?;
        tapes.push(tape);
    }
    cl.resize(rows, f64::NEG_INFINITY);
    cu.resize(rows, f64::INFINITY);
    let mut member = |variable: i32, row: usize| {
        let j = variable.max(0) as usize;
        // a variable that is never zero is lifted, so that the problem may be called infeasible
        if variable >= 0 && xl[j] <= 0.0 && xu[j] > 0.0 {
            return Member::Variable(j);
        }
        cl[row] = 0.0;
        Member::Row(row)
    };
    let members = (0..c).map(|i| (member(g[i], m + i), member(h[i], m + c + i))).collect();
    let registers = vec![0.0; tapes.iter().map(|t| t.registers).max().unwrap_or(0)];
    let weights = vec![0.0; 1 + rows];
    let program = Recorded { n, m: rows, jac, hess, tapes, registers, weights, x: vec![0.0; n] };
    Ok(File { program, bounds: Bounds { xl, xu, cl, cu }, members, start })
}

const CONST: i32 = 0;
const X: i32 = 1;
const Y: i32 = 2;
const OUT: i32 = 3;
const LAST: i32 = 49;
const ERF: i32 = 44;

impl Tape {
    /// Every index exists, every operation is known.
    fn check(&self, n_x: usize, n_y: usize) -> Result<(), String> {
        let inside = |i: i32, len: usize| i >= 0 && (i as usize) < len;
        let ok = |c: &[i32; 4]| match c[0] {
            CONST => inside(c[1], self.registers) && inside(c[2], self.constants.len()),
            X => inside(c[1], self.registers) && inside(c[2], n_x),
            Y => inside(c[1], self.registers) && inside(c[2], n_y),
            OUT => inside(c[1], self.outputs) && inside(c[2], self.registers),
            ERF => false,
            4..=LAST => inside(c[1], self.registers) && inside(c[2], self.registers) && inside(c[3], self.registers),
            _ => false,
        };
        match self.code.iter().find(|c| !ok(c)) {
            Some(c) => Err(format!("instruction {c:?} makes no sense")),
            None => Ok(()),
        }
    }

    /// Runs the list; `out` is written in full.
    fn run(&self, w: &mut [f64], x: &[f64], y: &[f64], out: &mut [f64]) -> EvalResult {
        out.fill(0.0);
        for &[op, o, a, b] in &self.code {
            let (o, i) = (o as usize, a as usize);
            match op {
                CONST => w[o] = self.constants[i],
                X => w[o] = x[i],
                Y => w[o] = y[i],
                OUT => out[o] = w[i],
                _ => w[o] = apply(op, w[i], w[b as usize]),
            }
        }
        if out.iter().all(|v| v.is_finite()) {
            Ok(())
        } else {
            Err(EvalError::Recoverable)
        }
    }
}

/// One operation on registers.
fn apply(op: i32, a: f64, b: f64) -> f64 {
    let truth = |t: bool| f64::from(u8::from(t));
    match op {
        4 => a,
        5 => a + b,
        6 => a - b,
        7 => a * b,
        8 => a / b,
        9 => -a,
        10 => a * a,
        11 => 2.0 * a,
        12 => 1.0 / a,
        13 => a.sqrt(),
        14 => a.exp(),
        15 => a.ln(),
        16 => a.powf(b),
        17 => a.sin(),
        18 => a.cos(),
        19 => a.tan(),
        20 => a.asin(),
        21 => a.acos(),
        22 => a.atan(),
        23 => a.sinh(),
        24 => a.cosh(),
        25 => a.tanh(),
        26 => a.asinh(),
        27 => a.acosh(),
        28 => a.atanh(),
        29 => a.atan2(b),
        30 => a.abs(),
        31 if a == 0.0 => a,
        31 => a.signum(),
        32 => a.min(b),
        33 => a.max(b),
        34 => truth(a < b),
        35 => truth(a <= b),
        36 => truth(a == b),
        37 => truth(a != b),
        38 => truth(a == 0.0),
        39 => truth(a != 0.0 && b != 0.0),
        40 => truth(a != 0.0 || b != 0.0),
        41 if a == 0.0 => 0.0,
        41 => b,
        42 => a.floor(),
        43 => a.ceil(),
        45 => a.ln_1p(),
        46 => a.exp_m1(),
        47 => a.hypot(b),
        48 => a.copysign(b),
        _ => a % b,
    }
}

impl Recorded {
    fn run(&mut self, k: usize, x: &[f64], out: &mut [f64]) -> EvalResult {
        self.tapes[k].run(&mut self.registers, x, &self.weights, out)
    }
}

impl Nlp for Recorded {
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
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> Result<f64, EvalError> {
        let mut f = [0.0];
        self.run(0, x, &mut f)?;
        self.run(2, x, c)?;
        Ok(f[0])
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        self.x.copy_from_slice(x);
        self.run(1, x, grad)?;
        self.run(3, x, jac)
    }
    fn hessian(&mut self, _x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        self.weights[0] = w;
        self.weights[1..].copy_from_slice(y);
        let x = std::mem::take(&mut self.x);
        let r = self.run(4, &x, hess);
        self.x = x;
        r
    }
}
