//! Conditions and the operators that switch: `sign`, `abs`, `min`, `max`, `clip`, `relay`, dead zone, `where`.
//!
//! None of them is evaluated. Each becomes a choice between smooth expressions under a condition `ψ > 0`, and a
//! switching function `ψ` exists once, however often it is written and with whatever sign or positive factor.
//! On `ψ = 0` Filippov's solution counts, so `ψ > 0` and `ψ ≥ 0` are the same.

use super::dag::{Dag, Id, Node};
use super::op::{Binary, Unary};
use crate::error::{Error, Result};

/// A switching function as it was written first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Switch {
    pub(super) psi: Id,
}

/// `constant + Σ coefficient · term` over terms that are no sums, sorted by node.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearForm {
    pub(super) constant: f64,
    pub(super) terms: Vec<(Id, f64)>,
}

/// Sums with more terms are taken as they stand.
const MAX_TERMS: usize = 512;

impl Dag {
    /// Splits sums, differences and constant factors.
    pub(super) fn linear_form(&self, id: Id) -> LinearForm {
        let mut form = LinearForm { constant: 0.0, terms: Vec::new() };
        let mut stack = vec![(id, 1.0)];
        while let Some((a, c)) = stack.pop() {
            if form.terms.len() > MAX_TERMS {
                return LinearForm { constant: 0.0, terms: vec![(id, 1.0)] };
            }
            match self.node(a) {
                Node::Const(bits) => form.constant += c * f64::from_bits(bits),
                Node::Unary(Unary::Neg, x) => stack.push((x, -c)),
                Node::Binary(Binary::Add, x, y) => stack.extend([(x, c), (y, c)]),
                Node::Binary(Binary::Sub, x, y) => stack.extend([(x, c), (y, -c)]),
                Node::Binary(Binary::Mul, k, x) => match self.as_const(k) {
                    Some(k) => stack.push((x, c * k)),
                    None => form.terms.push((a, c)),
                },
                _ => form.terms.push((a, c)),
            }
        }
        form.terms.sort_by_key(|t| t.0);
        form.terms.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1 += next.1;
            }
            same
        });
        form.terms.retain(|t| t.1 != 0.0);
        form
    }

    /// The value as `constant + Σ coefficient · term` over terms that are no sums.
    pub fn affine_terms(&self, id: Id) -> (f64, Vec<(Id, f64)>) {
        let form = self.linear_form(id);
        (form.constant, form.terms)
    }

    /// The condition `ψ > 0`. Of a `ψ` that is an increasing odd function of something, as `h³` or `atan h`, that
    /// something is taken, which has a gradient where `ψ` has none.
    pub fn positive(&mut self, psi: Id) -> Id {
        let mut psi = psi;
        let mut form = self.linear_form(psi);
        while let (&[(term, c)], 0.0) = (&form.terms[..], form.constant) {
            let inner = match self.node(term) {
                Node::PowI(h, n) if n % 2 != 0 => h,
                Node::Unary(Unary::Sinh | Unary::Tanh | Unary::Atan | Unary::Asin | Unary::Erf | Unary::Sqrt, h) => h,
                _ => break,
            };
            psi = if c > 0.0 { inner } else { self.neg(inner) };
            form = self.linear_form(psi);
        }
        let Some(&(_, lead)) = form.terms.first() else {
            return self.truth(form.constant > 0.0);
        };
        let scale = lead.abs();
        let key = |flip: f64| -> Vec<(Id, u64)> {
            let entry = |id, v: f64| (id, (flip * v / scale + 0.0).to_bits());
            let mut key: Vec<_> = form.terms.iter().map(|t| entry(t.0, t.1)).collect();
            key.push(entry(Id(u32::MAX), form.constant));
            key
        };
        if let Some(&s) = self.switch_index.get(&key(1.0)) {
            return self.intern(Node::Positive(s));
        }
        if let Some(&s) = self.switch_index.get(&key(-1.0)) {
            let p = self.intern(Node::Positive(s));
            return self.not(p);
        }
        let s = self.switches.len() as u32;
        self.switches.push(Switch { psi });
        self.switch_index.insert(key(1.0), s);
        self.intern(Node::Positive(s))
    }

    /// A decided condition.
    pub fn truth(&mut self, holds: bool) -> Id {
        self.intern(Node::Truth(holds))
    }

    /// The opposite.
    pub fn not(&mut self, c: Id) -> Id {
        match self.node(c) {
            Node::Truth(v) => self.truth(!v),
            Node::Not(a) => a,
            _ => self.intern(Node::Not(c)),
        }
    }

    /// Both.
    pub fn and(&mut self, a: Id, b: Id) -> Id {
        match (self.node(a), self.node(b)) {
            (Node::Truth(true), _) => return b,
            (_, Node::Truth(true)) => return a,
            (Node::Truth(false), _) | (_, Node::Truth(false)) => return self.truth(false),
            _ => {}
        }
        if a == b {
            return a;
        }
        if self.not(a) == b {
            return self.truth(false);
        }
        self.intern(Node::And(a.min(b), a.max(b)))
    }

    /// At least one.
    pub fn or(&mut self, a: Id, b: Id) -> Id {
        match (self.node(a), self.node(b)) {
            (Node::Truth(false), _) => return b,
            (_, Node::Truth(false)) => return a,
            (Node::Truth(true), _) | (_, Node::Truth(true)) => return self.truth(true),
            _ => {}
        }
        if a == b {
            return a;
        }
        if self.not(a) == b {
            return self.truth(true);
        }
        self.intern(Node::Or(a.min(b), a.max(b)))
    }

    /// `a` where the condition holds, `b` elsewhere.
    pub fn select(&mut self, condition: Id, a: Id, b: Id) -> Id {
        if a == b {
            return a;
        }
        match self.node(condition) {
            Node::Truth(holds) => return if holds { a } else { b },
            Node::Not(c) => return self.select(c, b, a),
            _ => {}
        }
        if let Node::Select(c, x, _) = self.node(a) {
            if c == condition {
                return self.select(condition, x, b);
            }
        }
        if let Node::Select(c, _, y) = self.node(b) {
            if c == condition {
                return self.select(condition, a, y);
            }
        }
        self.intern(Node::Select(condition, a, b))
    }

    /// 1 where `a > 0`, −1 where `a < 0`.
    pub fn sign(&mut self, a: Id) -> Id {
        let (plus, minus) = (self.constant(1.0), self.constant(-1.0));
        self.relay(a, plus, minus)
    }

    /// `on` where `a > 0`, `off` where `a < 0`.
    pub fn relay(&mut self, a: Id, on: Id, off: Id) -> Id {
        let c = self.positive(a);
        self.select(c, on, off)
    }

    /// Modulus.
    pub fn abs(&mut self, a: Id) -> Id {
        let minus = self.neg(a);
        self.relay(a, a, minus)
    }

    /// The smaller value.
    pub fn min(&mut self, a: Id, b: Id) -> Id {
        let d = self.sub(b, a);
        self.relay(d, a, b)
    }

    /// The larger value.
    pub fn max(&mut self, a: Id, b: Id) -> Id {
        let d = self.sub(a, b);
        self.relay(d, a, b)
    }

    /// The nearest value in `[low, high]`.
    pub fn clip(&mut self, a: Id, low: Id, high: Id) -> Id {
        let above = self.sub(a, high);
        let below = self.sub(low, a);
        let inner = self.relay(below, low, a);
        self.relay(above, high, inner)
    }

    /// 0 for `|a| < half_width`, the distance with the sign of `a` beyond.
    pub fn dead_zone(&mut self, a: Id, half_width: Id) -> Id {
        let above = self.sub(a, half_width);
        let below = self.add(a, half_width);
        let zero = self.constant(0.0);
        let inner = self.relay(below, zero, below);
        self.relay(above, above, inner)
    }

    /// A table of constants with switching functions at its breaks: `values[i]` between `breaks[i−1]` and `breaks[i]`.
    pub fn step_table(&mut self, a: Id, breaks: &[f64], values: &[Id]) -> Result<Id> {
        if values.len() != breaks.len() + 1 {
            return Err(Error::Dimension(format!(
                "table with {} breaks and {} values: one value more than breaks",
                breaks.len(),
                values.len()
            )));
        }
        if breaks.iter().any(|b| !b.is_finite()) || breaks.windows(2).any(|w| w[0] >= w[1]) {
            return Err(Error::Range("the breaks of a table must be finite and increasing".into()));
        }
        let mut out = values[0];
        for (b, &v) in breaks.iter().zip(&values[1..]) {
            let b = self.constant(*b);
            let d = self.sub(a, b);
            out = self.relay(d, v, out);
        }
        Ok(out)
    }

    /// Number of switching functions found so far.
    pub fn n_switches(&self) -> usize {
        self.switches.len()
    }

    /// Switching function `s`.
    pub fn switching_function(&self, s: usize) -> Option<Id> {
        self.switches.get(s).map(|s| s.psi)
    }

    /// Multi-affine expression in `α_s = alpha[s] ∈ [0, 1]` that is 1 where the condition holds (Table 6.3, with
    /// `A ∪ B: α_A + α_B − α_A α_B` and `A \ B: α_A (1 − α_B)`).
    pub fn region_expression(&mut self, condition: Id, alpha: &[Id]) -> Result<Id> {
        let ids = self.reachable(&[condition]);
        let mut value: Vec<Id> = Vec::with_capacity(ids.len());
        let one = self.constant(1.0);
        for &id in &ids {
            let of = |a: Id| value[ids.binary_search(&a).expect("children come first")];
            let v = match self.node(id) {
                Node::Truth(holds) => self.constant(f64::from(u8::from(holds))),
                Node::Positive(s) => *alpha.get(s as usize).ok_or_else(|| {
                    Error::Dimension(format!("{} step variables for {} switching functions", alpha.len(), s + 1))
                })?,
                Node::Not(a) => {
                    let a = of(a);
                    self.sub(one, a)
                }
                Node::And(a, b) => {
                    let (a, b) = (of(a), of(b));
                    self.mul(a, b)
                }
                Node::Or(a, b) => {
                    let (a, b) = (of(a), of(b));
                    let (sum, product) = (self.add(a, b), self.mul(a, b));
                    self.sub(sum, product)
                }
                // Parts of switching functions.
                _ => one,
            };
            value.push(v);
        }
        match ids.binary_search(&condition) {
            Ok(k) if self.is_condition(condition) => Ok(value[k]),
            _ => Err(Error::Range("this expression is a value, a condition is needed".into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dag::Block;
    use super::*;

    #[test]
    fn a_switching_function_exists_once_up_to_sign_and_scale() {
        let mut d = Dag::new();
        let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
        let k = d.constant(0.2);
        let two = d.constant(2.0);
        let a = d.sub(x, k);
        let c = d.positive(a);
        let b = d.sub(k, x);
        let e = d.positive(b);
        assert_eq!(d.not(e), c);
        let twice = d.mul(two, a);
        assert_eq!(d.positive(twice), c);
        let s = d.add(a, y);
        let s = d.sub(s, y);
        assert_eq!(d.positive(s), c);
        assert_eq!(d.n_switches(), 1);
        let other = d.sub(x, y);
        d.abs(other);
        let other = d.sub(y, x);
        d.sign(other);
        d.max(x, y);
        d.min(x, y);
        assert_eq!(d.n_switches(), 2);
        let cube = d.powi(other, 3);
        let cube = d.neg(cube);
        d.sign(cube);
        assert_eq!(d.n_switches(), 2);
        let minus_one = d.constant(-1.0);
        let no = d.positive(minus_one);
        assert_eq!(d.select(no, x, y), y);
    }

    #[test]
    fn conditions_simplify() {
        let mut d = Dag::new();
        let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
        let (a, b) = (d.positive(x), d.positive(y));
        let not_a = d.not(a);
        let (yes, no) = (d.truth(true), d.truth(false));
        assert_eq!(d.and(a, not_a), no);
        assert_eq!(d.or(a, not_a), yes);
        assert_eq!(d.and(a, a), a);
        assert_eq!(d.or(no, b), b);
        assert_eq!(d.and(a, b), d.and(b, a));
        let s = d.select(a, x, y);
        assert_eq!(d.select(a, s, y), s);
        assert_eq!(d.select(not_a, y, x), s);
    }

    /// Table 6.3, corrected.
    #[test]
    fn region_expressions_are_their_truth_tables() {
        let mut d = Dag::new();
        let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
        let (a, b) = (d.positive(x), d.positive(y));
        let not_b = d.not(b);
        let regions = [a, d.or(a, b), d.and(a, b), d.not(a), d.and(a, not_b)];
        let table: [fn(bool, bool) -> bool; 5] = [|a, _| a, |a, b| a | b, |a, b| a & b, |a, _| !a, |a, b| a & !b];
        for (r, holds) in regions.into_iter().zip(table) {
            for (va, vb) in [(false, false), (false, true), (true, false), (true, true)] {
                let alpha = [va, vb].map(|v| d.constant(f64::from(u8::from(v))));
                let e = d.region_expression(r, &alpha).unwrap();
                assert_eq!(d.as_const(e), Some(f64::from(u8::from(holds(va, vb)))));
            }
        }
        assert!(d.region_expression(x, &[]).is_err());
        assert!(d.region_expression(a, &[]).is_err());
    }
}
