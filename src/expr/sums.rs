//! Sums of products as one instruction, where a program runs at one point.
//!
//! In a chain like `((a + b c) - 2 d) + e` every operation waits for the one before it to go through memory, and the instruction for
//! it is looked up. As one instruction the partial sum stays in a register and the products do not wait. The terms are added in the
//! same order and every operation is rounded as before, so the result is the same to the last bit: a sign is a factor of ±1, and a term
//! without a second factor has the factor 1.

use super::piecewise::Piecewise;
use super::tape::{Code, Instruction};

/// An instruction of a program that runs at one point.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    One(Instruction),
    /// `register[dst] = Σ` of the terms from one number to another.
    Sum {
        dst: u32,
        from: u32,
        to: u32,
    },
}

/// `factor · register[a] · register[b]`
#[derive(Debug, Clone, Copy)]
pub(super) struct Term {
    factor: f64,
    a: u32,
    b: u32,
}

/// Adds the terms up in their order.
#[inline(always)]
fn sum(terms: &[Term], w: &[f64]) -> f64 {
    let product = |t: &Term| t.factor * (w[t.a as usize] * w[t.b as usize]);
    // there are at least two
    terms[1..].iter().fold(product(&terms[0]), |v, t| v + product(t))
}

/// Programs whose sums are one instruction each.
#[derive(Debug, Clone, Default)]
pub(super) struct Sums {
    pub(super) steps: Vec<Step>,
    terms: Vec<Term>,
}

/// What wrote nothing that is read: inputs and constants.
const NONE: usize = usize::MAX;

impl Sums {
    /// Adds the program `code` with the results `outputs`; the register `one` always holds 1. Says whether it has sums.
    pub(super) fn push(&mut self, code: &[Instruction], immediates: &[f64], outputs: &[u32], one: u32) -> bool {
        let plain = |s: &mut Sums| {
            s.steps.extend(code.iter().map(|i| Step::One(*i)));
            false
        };
        // what has several results reads more registers than its instruction says
        if code.iter().any(|i| i.code == Code::Block) {
            return plain(self);
        }
        let chains = Chains::of(code, outputs);
        let mut absorbed = vec![false; code.len()];
        let mut sums: Vec<Option<Vec<Term>>> = vec![None; code.len()];
        for i in (0..code.len()).rev().filter(|i| chains.is_sum(*i)) {
            if !absorbed[i] {
                sums[i] = chains.terms(i, immediates, one, &mut absorbed);
            }
        }
        if sums.iter().all(Option::is_none) {
            return plain(self);
        }
        for (i, instruction) in code.iter().enumerate() {
            if let Some(terms) = &sums[i] {
                let from = self.terms.len() as u32;
                self.terms.extend(terms);
                self.steps.push(Step::Sum { dst: instruction.dst, from, to: self.terms.len() as u32 });
            } else if !absorbed[i] {
                self.steps.push(Step::One(*instruction));
            }
        }
        true
    }

    /// Carries out steps on the registers `w`.
    #[inline(always)]
    pub(super) fn run(&self, steps: &[Step], w: &mut [f64], immediates: &[f64], tables: &[Piecewise]) {
        for step in steps {
            match step {
                Step::One(i) => w[i.dst as usize] = i.compute(w, immediates, tables),
                Step::Sum { dst, from, to } => w[*dst as usize] = sum(&self.terms[*from as usize..*to as usize], w),
            }
        }
    }
}

/// Which instruction computes what another one reads, and how long that stands in its register.
struct Chains<'a> {
    code: &'a [Instruction],
    /// Instructions that wrote the operands.
    operands: Vec<[usize; 2]>,
    /// How often results are read.
    uses: Vec<u32>,
    /// When another one takes the register.
    until: Vec<usize>,
}

/// An operand: its register, and the instruction that wrote it.
type Operand = (u32, usize);

/// One operation of a chain: what it adds, with its sign, and what it adds that to.
struct Link {
    added: Addend,
    rest: Addend,
}

#[derive(Clone, Copy)]
enum Addend {
    Register(f64, Operand),
    Constant(f64),
}

impl<'a> Chains<'a> {
    fn of(code: &'a [Instruction], outputs: &[u32]) -> Chains<'a> {
        let top =
            code.iter().flat_map(|i| [i.dst, i.a]).chain(outputs.iter().copied()).max().map_or(0, |m| m as usize + 1);
        let second = code.iter().filter(|i| i.code.has_two_operands()).map(|i| i.b as usize + 1).max().unwrap_or(0);
        let mut writer = vec![NONE; top.max(second)];
        let mut c = Chains {
            code,
            operands: Vec::with_capacity(code.len()),
            uses: vec![0; code.len()],
            until: vec![NONE; code.len()],
        };
        for (k, i) in code.iter().enumerate() {
            let a = writer[i.a as usize];
            let b = if i.code.has_two_operands() { writer[i.b as usize] } else { NONE };
            c.operands.push([a, b]);
            for d in [a, b].into_iter().filter(|d| *d != NONE) {
                c.uses[d] += 1;
            }
            let before = std::mem::replace(&mut writer[i.dst as usize], k);
            if before != NONE {
                c.until[before] = k;
            }
        }
        // what comes out is read from its register
        for d in outputs.iter().map(|o| writer[*o as usize]).filter(|d| *d != NONE) {
            c.uses[d] += 2;
        }
        c
    }

    fn is_sum(&self, i: usize) -> bool {
        matches!(self.code[i].code, Code::Add | Code::Sub | Code::AddConstant | Code::ConstantMinus)
    }

    /// Is it a sum that is read once?
    fn goes_on(&self, (_, d): Operand) -> bool {
        d != NONE && self.uses[d] == 1 && self.is_sum(d)
    }

    /// Does an operand still stand in its register at instruction `i`?
    fn stands(&self, (_, d): Operand, i: usize) -> bool {
        d == NONE || self.until[d] >= i
    }

    fn link(&self, i: usize, immediates: &[f64]) -> Link {
        let (c, [da, db]) = (&self.code[i], self.operands[i]);
        let (a, b) = ((c.a, da), (c.b, db));
        let constant = || immediates[c.b as usize];
        match c.code {
            // the order of two summands does not matter
            Code::Add if !self.goes_on(a) && self.goes_on(b) => {
                Link { added: Addend::Register(1.0, a), rest: Addend::Register(1.0, b) }
            }
            Code::Add => Link { added: Addend::Register(1.0, b), rest: Addend::Register(1.0, a) },
            Code::Sub => Link { added: Addend::Register(-1.0, b), rest: Addend::Register(1.0, a) },
            Code::AddConstant => Link { added: Addend::Constant(constant()), rest: Addend::Register(1.0, a) },
            _ => Link { added: Addend::Register(-1.0, a), rest: Addend::Constant(constant()) },
        }
    }

    /// A term at instruction `root`, with the product that it takes over; none where its operands do not stand any more.
    fn term(&self, addend: Addend, root: usize, immediates: &[f64], one: u32) -> Option<(Term, Option<usize>)> {
        let (sign, operand) = match addend {
            Addend::Constant(factor) => return Some((Term { factor, a: one, b: one }, None)),
            Addend::Register(sign, operand) => (sign, operand),
        };
        let d = operand.1;
        if d != NONE && self.uses[d] == 1 {
            let (c, [da, db]) = (&self.code[d], self.operands[d]);
            let (a, b) = ((c.a, da), (c.b, db));
            let term = match c.code {
                Code::Mul if self.stands(b, root) => Some(Term { factor: sign, a: c.a, b: c.b }),
                Code::Scale => Some(Term { factor: sign * immediates[c.b as usize], a: c.a, b: one }),
                Code::Neg => Some(Term { factor: -sign, a: c.a, b: one }),
                Code::Square => Some(Term { factor: sign, a: c.a, b: c.a }),
                _ => None,
            };
            if let Some(term) = term.filter(|_| self.stands(a, root)) {
                return Some((term, Some(d)));
            }
        }
        self.stands(operand, root).then_some((Term { factor: sign, a: operand.0, b: one }, None))
    }

    /// The longest chain that ends with instruction `root`, and what it takes over is `absorbed`; none where it takes over nothing.
    fn terms(&self, root: usize, immediates: &[f64], one: u32, absorbed: &mut [bool]) -> Option<Vec<Term>> {
        let mut terms = Vec::new();
        let mut taken = Vec::new();
        // the longest part that can be read here: its terms, what it takes over, and what it begins with
        let mut best: Option<(usize, usize, (Term, Option<usize>))> = None;
        let mut i = root;
        loop {
            let Link { added, rest } = self.link(i, immediates);
            let Some((term, product)) = self.term(added, root, immediates, one) else { break };
            terms.push(term);
            taken.extend(product);
            if let Some(first) = self.term(rest, root, immediates, one) {
                best = Some((terms.len(), taken.len(), first));
            }
            match rest {
                Addend::Register(_, operand) if self.goes_on(operand) => {
                    i = operand.1;
                    taken.push(i);
                }
                _ => break,
            }
        }
        let (n, n_taken, (first, product)) = best?;
        terms.truncate(n);
        taken.truncate(n_taken);
        terms.push(first);
        taken.extend(product);
        if taken.is_empty() {
            return None;
        }
        taken.iter().for_each(|d| absorbed[*d] = true);
        terms.reverse();
        Some(terms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUTS: u32 = 6;
    const ONE: u32 = 40;

    /// Numbers that are all but equal, so that every order of rounding shows.
    fn registers() -> Vec<f64> {
        let mut w: Vec<f64> =
            (0..=ONE).map(|i| (f64::from(i) * 1.7 + 0.3).sin() * 10f64.powi(i as i32 % 5 - 2)).collect();
        w[ONE as usize] = 1.0;
        w
    }

    fn run_plain(code: &[Instruction], immediates: &[f64]) -> Vec<f64> {
        let mut w = registers();
        code.iter().for_each(|i| w[i.dst as usize] = i.compute(&w, immediates, &[]));
        w
    }

    /// Results by sums are the same bits; how many instructions are left.
    fn check(code: &[Instruction], immediates: &[f64], outputs: &[u32]) -> usize {
        let mut s = Sums::default();
        s.push(code, immediates, outputs, ONE);
        let (mut w, expected) = (registers(), run_plain(code, immediates));
        s.run(&s.steps, &mut w, immediates, &[]);
        for o in outputs {
            assert_eq!(w[*o as usize].to_bits(), expected[*o as usize].to_bits(), "{o}: {code:?}");
        }
        s.steps.len()
    }

    fn op(code: Code, dst: u32, a: u32, b: u32) -> Instruction {
        Instruction { code, dst, a, b }
    }

    #[test]
    fn a_chain_is_one_instruction() {
        let code = [
            op(Code::Mul, 10, 0, 1),
            op(Code::Scale, 11, 2, 0),
            op(Code::Sub, 12, 10, 11),
            op(Code::Add, 13, 3, 12),
            op(Code::AddConstant, 14, 13, 1),
            op(Code::Square, 15, 4, 0),
            op(Code::Sub, 16, 14, 15),
        ];
        assert_eq!(check(&code, &[0.7, -1.9], &[16]), 1);
        // a partial sum that is read elsewhere stays
        assert_eq!(check(&code, &[0.7, -1.9], &[16, 13]), 2);
        assert_eq!(check(&[op(Code::Add, 10, 0, 1), op(Code::ConstantMinus, 11, 10, 0)], &[2.5], &[11]), 2);
        assert_eq!(check(&[op(Code::ConstantMinus, 10, 0, 0), op(Code::Add, 11, 10, 1)], &[2.5], &[11]), 1);
    }

    #[test]
    fn a_register_that_is_written_again_is_not_read_later() {
        // 10 holds a product, is taken by another result, and is read by it
        let code = [
            op(Code::Sqrt, 10, 1, 0),
            op(Code::Add, 11, 0, 10),
            op(Code::Mul, 10, 2, 3),
            op(Code::Atan2, 12, 10, 4),
            op(Code::Add, 13, 11, 12),
        ];
        check(&code, &[], &[13]);
    }

    #[test]
    fn zeros_keep_their_signs() {
        let mut s = Sums::default();
        let code =
            [op(Code::Mul, 10, 0, 1), op(Code::Sub, 11, 10, 2), op(Code::Neg, 12, 3, 0), op(Code::Add, 13, 11, 12)];
        assert!(s.push(&code, &[], &[13], ONE));
        for pattern in 0..16 {
            let mut w = registers();
            (0..4).for_each(|k| w[k] = if pattern >> k & 1 == 1 { -0.0 } else { 0.0 });
            let mut plain = w.clone();
            code.iter().for_each(|i| plain[i.dst as usize] = i.compute(&plain, &[], &[]));
            s.run(&s.steps, &mut w, &[], &[]);
            assert_eq!(w[13].to_bits(), plain[13].to_bits(), "{pattern}");
        }
    }

    #[test]
    fn random_programs_give_the_same_bits() {
        let mut state = 88172645463325252u64;
        let mut random = |n: u32| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 33) as u32 % n
        };
        let codes = [
            Code::Add,
            Code::Sub,
            Code::Add,
            Code::Mul,
            Code::AddConstant,
            Code::ConstantMinus,
            Code::Scale,
            Code::Neg,
            Code::Square,
        ];
        let (mut before, mut after) = (0, 0);
        for _ in 0..2000 {
            let n = 3 + random(12);
            // few registers, so that they are used again; what is read has been written
            let mut written = [false; (INPUTS + 6) as usize];
            written[..INPUTS as usize].fill(true);
            let code: Vec<Instruction> = (0..n)
                .map(|_| {
                    let code = codes[random(codes.len() as u32) as usize];
                    let mut operand = || Some(random(INPUTS + 6)).filter(|r| written[*r as usize]).unwrap_or(0);
                    let a = operand();
                    let b = if code.has_two_operands() { operand() } else { random(3) };
                    let dst = INPUTS + random(6);
                    written[dst as usize] = true;
                    op(code, dst, a, b)
                })
                .collect();
            let outputs: Vec<u32> = (0..1 + random(3)).map(|_| INPUTS + random(6)).collect();
            before += code.len();
            after += check(&code, &[0.3, -1.1, 7.0], &outputs);
        }
        assert!(after < before, "{before} {after}");
    }
}
