//! Parts of several functions in one program: inputs and constants are loaded once, and every part is a range of its
//! instructions, so that parts that are needed together cost no more than their arithmetic.

use std::ops::Range;

use super::function::ExprFunction;
use super::tape::{Code, Instruction, Tape};
use super::Piecewise;
use crate::func::{Bundle, Function, Point};

/// The program. Its workspace holds all inputs in the order `x`, `u`, `p`, `t`, all constants, then the registers that
/// one part after the other uses.
pub(super) struct Program {
    work: Vec<f64>,
    immediates: Vec<f64>,
    piecewise: Vec<Piecewise>,
    code: Vec<Instruction>,
    outputs: Vec<u32>,
    /// Instructions and outputs of every part.
    parts: Vec<(Range<usize>, Range<usize>)>,
}

impl Program {
    /// Of outputs of functions; none where one of them is no expression, calls others, or has no program of its own for
    /// the outputs wanted.
    pub(super) fn new(parts: &[(&dyn Function, Range<usize>)]) -> Option<Program> {
        let tape = |(f, rows): &(&dyn Function, Range<usize>)| -> Option<Tape> {
            let f: &ExprFunction = (*f).as_any()?.downcast_ref()?;
            Some(f.tape_of(rows)?.clone())
        };
        let tapes: Vec<Tape> = parts.iter().map(tape).collect::<Option<_>>()?;
        let dims = tapes.first()?.dims;
        if tapes.iter().any(|t| t.dims != dims || t.n_weights > 0 || !t.compounds.is_empty()) {
            return None;
        }
        let n_in = dims.n_in();
        let n_constants: usize = tapes.iter().map(|t| t.constants.len()).sum();
        let own = |t: &Tape| t.work_len() - t.first_register();
        let n_registers = tapes.iter().map(own).max().unwrap_or(0);
        let mut p = Program {
            work: vec![0.0; n_in + n_constants + n_registers],
            immediates: Vec::new(),
            piecewise: Vec::new(),
            code: Vec::new(),
            outputs: Vec::new(),
            parts: Vec::new(),
        };
        let mut constants = n_in;
        for t in &tapes {
            p.append(t, constants, n_in + n_constants)?;
            constants += t.constants.len();
        }
        Some(p)
    }

    /// Adds a part whose constants begin at `constants` and whose registers begin at `registers`; none where it is larger
    /// than an instruction can address.
    fn append(&mut self, t: &Tape, constants: usize, registers: usize) -> Option<()> {
        let (n_loads, first) = (t.loads.len(), t.first_register());
        u32::try_from(registers + t.work_len()).ok()?;
        let place = |r: u32| -> u32 {
            let r = r as usize;
            let to = if r < n_loads {
                t.loads[r].flat as usize
            } else if r < first {
                constants + r - n_loads
            } else {
                registers + r - first
            };
            to as u32
        };
        self.work[constants..constants + t.constants.len()].copy_from_slice(&t.constants);
        let (immediates, tables) = (self.immediates.len() as u32, self.piecewise.len() as u32);
        let from = (self.code.len(), self.outputs.len());
        for i in &t.code {
            let b = match i.code {
                Code::AddConstant | Code::ConstantMinus | Code::Scale | Code::ConstantOver => immediates + i.b,
                Code::PowI => i.b,
                Code::Piecewise => i.b + 16 * tables,
                Code::Add | Code::Sub | Code::Mul | Code::Div | Code::Pow | Code::Atan2 => place(i.b),
                Code::Neg | Code::Square | Code::Sqrt | Code::Unary(_) => 0,
                Code::Block => return None,
            };
            self.code.push(Instruction { code: i.code, dst: place(i.dst), a: place(i.a), b });
        }
        self.immediates.extend(&t.immediates);
        self.piecewise.extend(t.piecewise.iter().cloned());
        self.outputs.extend(t.outputs.iter().map(|&o| place(o)));
        self.parts.push((from.0..self.code.len(), from.1..self.outputs.len()));
        Some(())
    }
}

impl Bundle for Program {
    fn move_to(&mut self, at: &Point) {
        let mut to = &mut self.work[..];
        for block in [at.x, at.u, at.p, &[at.t]] {
            let (own, rest) = to.split_at_mut(block.len());
            own.copy_from_slice(block);
            to = rest;
        }
    }

    fn evaluate(&mut self, part: usize, out: &mut [f64]) -> bool {
        let (code, outputs) = self.parts[part].clone();
        let w = &mut self.work[..];
        for i in &self.code[code] {
            w[i.dst as usize] = i.compute(w, &self.immediates, &self.piecewise);
        }
        let mut finite = true;
        for (v, &o) in out.iter_mut().zip(&self.outputs[outputs]) {
            *v = w[o as usize];
            finite &= v.is_finite();
        }
        finite
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Graph;
    use crate::func::Dims;

    #[test]
    fn parts_have_the_values_of_their_functions_to_the_last_bit() {
        let d = Dims { x: 3, u: 1, p: 1 };
        let g = Graph::new();
        let (x, u, p, t) = (|i| g.x(i), g.u(0), g.p(0), g.t());
        let smooth = [x(0) * x(1) + u.sin(), (x(2) - 2.0) * t / (p + 3.0), g.constant(0.25)];
        let a = g.function("a", d, &smooth).unwrap();
        let b = g.function("b", d, &[x(1).powi(3).exp(), 7.0 * x(2)]).unwrap();
        let parts: [(&dyn Function, Range<usize>); 2] = [(&a, 0..3), (&b, 0..2)];
        let mut program = Program::new(&parts).unwrap();
        for s in 0..3 {
            let v = |i: usize| (0.3 + f64::from(s) + i as f64).sin();
            let (xs, us, ps) = ([v(0), v(1), v(2)], [v(3)], [v(4)]);
            let at = Point { t: v(5), x: &xs, u: &us, p: &ps };
            program.move_to(&at);
            for (k, (f, rows)) in parts.iter().enumerate().rev() {
                let (mut own, mut out) = (vec![0.0; rows.len()], vec![0.0; rows.len()]);
                f.value(&at, &mut own, &mut vec![0.0; f.work_len()]).unwrap();
                assert!(program.evaluate(k, &mut out));
                assert_eq!(own, out);
            }
        }
        // outputs that have no program of their own
        assert!(Program::new(&[(&a, 0..2)]).is_none());
    }
}
