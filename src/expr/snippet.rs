//! Tapes without registers: every operation has one result, and operands are inputs, constants or such results.
//!
//! From this form the outputs can be taken apart, and programs that differ only in their inputs and constants can be told:
//! they have the same [`Shape`].

use std::collections::{HashMap, HashSet};

use super::tape::{Code, Tape};

/// Where an operand comes from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// By its number among all inputs.
    Input(u32),
    Constant(f64),
    /// The result of an operation, by its number.
    Result(u32),
}

/// One operation. Those with one operand have it twice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Operation {
    pub(super) code: Code,
    pub(super) a: Place,
    pub(super) b: Place,
    /// Exponent of an integer power; sixteen times the table plus the order of the derivative of a piecewise polynomial.
    pub(super) n: u32,
}

/// Operations in their order, and the outputs.
#[derive(Debug, Clone, Default)]
pub(super) struct Snippet {
    pub(super) operations: Vec<Operation>,
    pub(super) outputs: Vec<Place>,
}

/// What programs have in common that differ only in their inputs and constants. Operands are numbered: inputs in the order of
/// their first use, then constants, then results.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Shape {
    pub(super) n_inputs: u32,
    pub(super) n_constants: u32,
    /// Code, both operands, exponent or table.
    pub(super) operations: Vec<(Code, u32, u32, u32)>,
    pub(super) outputs: Vec<u32>,
}

impl Code {
    /// Has it a second operand that is computed?
    pub(super) fn has_two_operands(self) -> bool {
        matches!(self, Code::Add | Code::Sub | Code::Mul | Code::Div | Code::Pow | Code::Atan2)
    }
}

impl Snippet {
    /// Of a tape whose tables of piecewise polynomials come behind `tables` others; none where it decomposes matrices or
    /// calls functions.
    pub(super) fn of(t: &Tape, tables: u32) -> Option<Snippet> {
        const NONE: u32 = u32::MAX;
        let (n_loads, first) = (t.loads.len(), t.first_register());
        let mut defined = vec![NONE; t.work_len()];
        let place = |r: u32, defined: &[u32]| {
            let r = r as usize;
            if r < n_loads {
                Place::Input(t.loads[r].flat)
            } else if r < first {
                Place::Constant(t.constants[r - n_loads])
            } else {
                Place::Result(defined[r])
            }
        };
        let mut operations = Vec::with_capacity(t.code.len());
        for (k, i) in t.code.iter().enumerate() {
            let a = place(i.a, &defined);
            let constant = || Place::Constant(t.immediates[i.b as usize]);
            let (code, a, b, n) = match i.code {
                Code::AddConstant => (Code::Add, constant(), a, 0),
                Code::ConstantMinus => (Code::Sub, constant(), a, 0),
                Code::Scale => (Code::Mul, constant(), a, 0),
                Code::ConstantOver => (Code::Div, constant(), a, 0),
                Code::Add | Code::Sub | Code::Mul | Code::Div | Code::Pow | Code::Atan2 => {
                    (i.code, a, place(i.b, &defined), 0)
                }
                Code::PowI => (i.code, a, a, i.b),
                Code::Piecewise => (i.code, a, a, i.b + 16 * tables),
                Code::Neg | Code::Square | Code::Sqrt | Code::Unary(_) => (i.code, a, a, 0),
                Code::Block => return None,
            };
            operations.push(Operation { code, a, b, n });
            defined[i.dst as usize] = k as u32;
        }
        let outputs = t.outputs.iter().map(|&o| place(o, &defined)).collect();
        Some(Snippet { operations, outputs })
    }

    /// Takes the operations that more than two outputs need out of the rest, which has their results as inputs from number
    /// `first` on.
    pub(super) fn without_common(&self, first: u32) -> (Snippet, Snippet) {
        let common = self.common();
        let mut number = vec![0u32; self.operations.len()];
        let mut n = [0u32; 2];
        for (to, common) in number.iter_mut().zip(&common) {
            *to = n[usize::from(*common)];
            n[usize::from(*common)] += 1;
        }
        let is_common = |r: u32| common[r as usize];
        let inside = |p: Place| match p {
            Place::Result(r) => Place::Result(number[r as usize]),
            p => p,
        };
        let outside = |p: Place| match p {
            Place::Result(r) if is_common(r) => Place::Input(first + number[r as usize]),
            p => inside(p),
        };
        let (mut common, mut rest) = (Snippet::default(), Snippet::default());
        for (r, o) in self.operations.iter().enumerate() {
            if is_common(r as u32) {
                common.operations.push(Operation { a: inside(o.a), b: inside(o.b), ..*o });
            } else {
                rest.operations.push(Operation { a: outside(o.a), b: outside(o.b), ..*o });
            }
        }
        common.outputs = (0..n[1]).map(Place::Result).collect();
        rest.outputs = self.outputs.iter().map(|p| outside(*p)).collect();
        (common, rest)
    }

    /// Which operations do more than two outputs need? Neighbours that share a difference compute it each for themselves.
    fn common(&self) -> Vec<bool> {
        // the first two outputs that need an operation
        let mut users: Vec<[Option<u32>; 2]> = vec![[None; 2]; self.operations.len()];
        let mut many = vec![false; self.operations.len()];
        let note = |users: &mut [[Option<u32>; 2]], many: &mut [bool], p: Place, output: u32| {
            let Place::Result(r) = p else { return };
            let own = &mut users[r as usize];
            match own.iter().position(|u| u.is_none_or(|u| u == output)) {
                Some(i) => own[i] = Some(output),
                None => many[r as usize] = true,
            }
        };
        self.outputs.iter().zip(0..).for_each(|(p, o)| note(&mut users, &mut many, *p, o));
        for (r, o) in self.operations.iter().enumerate().rev() {
            for p in [o.a, o.b] {
                users[r].into_iter().flatten().for_each(|u| note(&mut users, &mut many, p, u));
                if let (Place::Result(q), true) = (p, many[r]) {
                    many[q as usize] = true;
                }
            }
        }
        many
    }

    /// Operations that some of the outputs need, ascending.
    fn needed(&self, outputs: std::ops::Range<usize>) -> Vec<u32> {
        let mut needed: HashSet<u32> = HashSet::new();
        let mut ahead: Vec<u32> = Vec::new();
        let mut ask = |p: Place, ahead: &mut Vec<u32>| {
            if let Place::Result(r) = p {
                if needed.insert(r) {
                    ahead.push(r);
                }
            }
        };
        self.outputs[outputs].iter().for_each(|p| ask(*p, &mut ahead));
        let mut own: Vec<u32> = Vec::new();
        while let Some(r) = ahead.pop() {
            own.push(r);
            let o = &self.operations[r as usize];
            ask(o.a, &mut ahead);
            ask(o.b, &mut ahead);
        }
        own.sort_unstable();
        own
    }

    /// Some of the outputs, with the operations that they need.
    pub(super) fn part(&self, outputs: std::ops::Range<usize>) -> Snippet {
        let own = self.needed(outputs.clone());
        let place = |p: Place| match p {
            Place::Result(r) => Place::Result(own.partition_point(|o| *o < r) as u32),
            p => p,
        };
        let operation = |r: &u32| {
            let o = self.operations[*r as usize];
            Operation { a: place(o.a), b: place(o.b), ..o }
        };
        Snippet {
            operations: own.iter().map(operation).collect(),
            outputs: self.outputs[outputs].iter().map(|p| place(*p)).collect(),
        }
    }

    /// Number of constants that are operands or outputs.
    pub(super) fn constants(&self) -> usize {
        let count = |o: &Operation| {
            let second = o.code.has_two_operands() && matches!(o.b, Place::Constant(_));
            usize::from(matches!(o.a, Place::Constant(_))) + usize::from(second)
        };
        let constant = |p: &&Place| matches!(p, Place::Constant(_));
        self.operations.iter().map(count).sum::<usize>() + self.outputs.iter().filter(constant).count()
    }

    /// Its shape, with its inputs and constants.
    pub(super) fn shape(&self) -> (Shape, Vec<u32>, Vec<f64>) {
        let (mut inputs, mut constants): (Vec<u32>, Vec<f64>) = (Vec::new(), Vec::new());
        let places = self.operations.iter().flat_map(|o| [Some(o.a), o.code.has_two_operands().then_some(o.b)]);
        let mut numbers: Vec<Place> = Vec::new();
        let mut known: HashMap<u32, u32> = HashMap::new();
        for p in places.flatten().chain(self.outputs.iter().copied()) {
            numbers.push(match p {
                Place::Input(i) => {
                    let next = inputs.len() as u32;
                    let place = *known.entry(i).or_insert(next);
                    if place == next {
                        inputs.push(i);
                    }
                    Place::Input(place)
                }
                Place::Constant(c) => {
                    constants.push(c);
                    Place::Input(u32::MAX - (constants.len() - 1) as u32)
                }
                p => p,
            });
        }
        let (n_inputs, n_constants) = (inputs.len() as u32, constants.len() as u32);
        let mut numbers = numbers.into_iter().map(|p| match p {
            Place::Result(r) => n_inputs + n_constants + r,
            Place::Input(i) if i < n_inputs => i,
            Place::Input(i) => n_inputs + (u32::MAX - i),
            Place::Constant(_) => 0,
        });
        let mut next = || numbers.next().unwrap_or(0);
        let operation = |o: &Operation| {
            let a = next();
            let b = if o.code.has_two_operands() { next() } else { a };
            (o.code, a, b, o.n)
        };
        let operations = self.operations.iter().map(operation).collect();
        let outputs = (0..self.outputs.len()).map(|_| next()).collect();
        (Shape { n_inputs, n_constants, operations, outputs }, inputs, constants)
    }
}
