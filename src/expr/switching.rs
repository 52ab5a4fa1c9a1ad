//! Conditions and the operators that switch: `sign`, `abs`, `min`, `max`, `clip`, `relay`, dead zone, `where`.
//!
//! None of them is evaluated. Each becomes a choice between smooth expressions under a condition `ψ > 0`, and a
//! switching function `ψ` exists once, however often it is written and with whatever sign or positive factor.
//! On `ψ = 0` Filippov's solution counts, so `ψ > 0` and `ψ ≥ 0` are the same.
//!
//! Whether two are the same is decided on their coefficients in exact arithmetic, so it does not depend on units.

use std::collections::BTreeMap;

use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

use super::dag::{Dag, Id, Node};
use super::exact::{exact, is_long, rounded};
use super::op::{Binary, Unary};
use crate::error::{Error, Result};

/// A switching function.
#[derive(Debug, Clone)]
pub(super) struct Switch {
    /// As it was written first.
    pub(super) psi: Id,
    /// Others that are the same but for the last binary digit of a coefficient.
    pub(super) nearly: Vec<Id>,
}

/// Coefficients of a switching function divided by the size of the first one, each rounded once; last the constant.
pub(super) type SwitchKey = Vec<(Id, i64, i64)>;

/// `constant + Σ coefficient · term` over terms that are no sums, sorted by node; exact.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearForm {
    pub(super) constant: BigRational,
    pub(super) terms: Vec<(Id, BigRational)>,
}

impl LinearForm {
    /// The form divided by the size of its first coefficient; none without terms.
    fn normalised(&self) -> Option<LinearForm> {
        let lead = self.terms.first()?.1.abs();
        let terms = self.terms.iter().map(|(id, c)| (*id, c / &lead)).collect();
        Some(LinearForm { constant: &self.constant / &lead, terms })
    }

    fn negated(&self) -> LinearForm {
        LinearForm { constant: -&self.constant, terms: self.terms.iter().map(|(id, c)| (*id, -c)).collect() }
    }

    pub(super) fn times(&self, factor: &BigRational) -> LinearForm {
        LinearForm {
            constant: &self.constant * factor,
            terms: self.terms.iter().map(|(id, c)| (*id, c * factor)).collect(),
        }
    }

    /// The form with another one in the place of one of its terms.
    pub(super) fn replaced(&self, term: Id, by: &LinearForm) -> LinearForm {
        let mut terms: BTreeMap<Id, BigRational> = self.terms.iter().cloned().collect();
        let Some(factor) = terms.remove(&term) else { return self.clone() };
        for (id, c) in &by.terms {
            *terms.entry(*id).or_insert_with(BigRational::zero) += c * &factor;
        }
        terms.retain(|_, c| !c.is_zero());
        LinearForm { constant: &self.constant + &by.constant * &factor, terms: terms.into_iter().collect() }
    }

    fn key(&self) -> SwitchKey {
        let entry = |id: Id, c: &BigRational| {
            let (digits, power) = rounded(c);
            (id, digits, power)
        };
        let terms = self.terms.iter().map(|(id, c)| entry(*id, c));
        terms.chain([entry(Id(u32::MAX), &self.constant)]).collect()
    }
}

/// Sums with more terms are taken as they stand: they cost more switching functions, never wrong ones.
const MAX_TERMS: usize = 512;

impl Dag {
    /// Splits sums, differences and constant factors. What cannot be split, because a constant is not finite or the
    /// numbers would be too long, counts as a term.
    pub(super) fn linear_form(&self, id: Id) -> LinearForm {
        let mut form = LinearForm { constant: BigRational::zero(), terms: Vec::new() };
        // Coefficients of nodes still to be split, the youngest first: all uses of a node are known when it comes.
        let mut open = BTreeMap::from([(id, BigRational::one())]);
        while let Some((a, c)) = open.pop_last() {
            if form.terms.len() > MAX_TERMS {
                return LinearForm { constant: BigRational::zero(), terms: vec![(id, BigRational::one())] };
            }
            if c.is_zero() {
                continue;
            }
            let mut put = |id: Id, c: BigRational| *open.entry(id).or_insert_with(BigRational::zero) += c;
            let value = |id: Id| self.as_const(id).and_then(exact);
            match self.node(a) {
                _ if is_long(&c) => form.terms.push((a, c)),
                Node::Const(_) => match value(a) {
                    Some(v) => form.constant += c * v,
                    None => form.terms.push((a, c)),
                },
                Node::Unary(Unary::Neg, x) => put(x, -c),
                Node::Binary(Binary::Add, x, y) => {
                    put(x, c.clone());
                    put(y, c);
                }
                Node::Binary(Binary::Sub, x, y) => {
                    put(x, c.clone());
                    put(y, -c);
                }
                Node::Binary(Binary::Mul, k, x) => match value(k) {
                    Some(k) => put(x, c * k),
                    None => form.terms.push((a, c)),
                },
                Node::Binary(Binary::Div, x, k) => match value(k).filter(|k| !k.is_zero()) {
                    Some(k) => put(x, c / k),
                    None => form.terms.push((a, c)),
                },
                _ => form.terms.push((a, c)),
            }
        }
        form.terms.reverse();
        form
    }

    /// The value as `constant + Σ coefficient · term` over terms that are no sums, sorted by node, without rounding.
    pub fn affine_terms(&self, id: Id) -> (BigRational, Vec<(Id, BigRational)>) {
        let form = self.linear_form(id);
        (form.constant, form.terms)
    }

    /// Something of the same sign. Of a `ψ` that is an increasing odd function of something, as `h³` or `atan h`, that something is taken,
    /// which has a gradient where `ψ` has none.
    pub fn of_same_sign(&mut self, psi: Id) -> Id {
        let mut psi = psi;
        loop {
            let form = self.linear_form(psi);
            let (&[(term, ref c)], true) = (&form.terms[..], form.constant.is_zero()) else { return psi };
            let inner = match self.node(term) {
                Node::PowI(h, n) if n % 2 != 0 => h,
                Node::Unary(Unary::Sinh | Unary::Tanh | Unary::Atan | Unary::Asin | Unary::Erf | Unary::Sqrt, h) => h,
                _ => return psi,
            };
            psi = if c.is_positive() { inner } else { self.neg(inner) };
        }
    }

    /// The condition `ψ > 0`, with [`Dag::of_same_sign`] in the place of `ψ`.
    ///
    /// Two switching functions are one if all ratios of their coefficients agree to the last of the 53 binary digits a
    /// number has: their zeros are then closer than the rounding of one evaluation. Where the ratios are not equal
    /// exactly, [`Dag::nearly_equal`] says so.
    pub fn positive(&mut self, psi: Id) -> Id {
        let psi = self.of_same_sign(psi);
        let form = self.linear_form(psi);
        let Some(unit) = form.normalised() else {
            return self.truth(form.constant.is_positive());
        };
        let key = unit.key();
        let opposite = unit.negated();
        let known = |key: &SwitchKey| self.switch_index.get(key).copied();
        if let Some(s) = known(&key) {
            self.note_nearly(s, psi, &unit);
            return self.intern(Node::Positive(s));
        }
        if let Some(s) = known(&opposite.key()) {
            self.note_nearly(s, psi, &opposite);
            let p = self.intern(Node::Positive(s));
            return self.not(p);
        }
        let s = self.switches.len() as u32;
        self.switches.push(Switch { psi, nearly: Vec::new() });
        self.switch_index.insert(key, s);
        self.intern(Node::Positive(s))
    }

    /// Remembers a switching function that is taken for another one though it is not exactly the same.
    fn note_nearly(&mut self, s: u32, psi: Id, unit: &LinearForm) {
        let known = &self.switches[s as usize];
        if known.psi == psi || known.nearly.contains(&psi) {
            return;
        }
        if self.linear_form(known.psi).normalised().as_ref() != Some(unit) {
            self.switches[s as usize].nearly.push(psi);
        }
    }

    /// Functions that were taken for switching function `s` because they differ from a multiple of it in the last binary
    /// digit of a coefficient only.
    pub fn nearly_equal(&self, s: usize) -> &[Id] {
        self.switches.get(s).map_or(&[], |s| &s.nearly)
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
