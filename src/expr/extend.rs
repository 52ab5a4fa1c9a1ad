//! Branches of functions that are only defined where they are taken, continued beyond.
//!
//! `sqrt |a|` has the branches `sqrt a` and `sqrt −a`, and neither is defined on the other side of `a = 0`, where an
//! integrator looks for the switch, where a switching function that contains them is still evaluated, and where a program of
//! finite elements evaluates all modes. The same holds of `max(a, 0)^1.5` and of `log a` under the condition `a > 1`. Where the argument
//! of a root, a logarithm, a real power or a quotient is known to be at least some `b ≥ 0` as it was written, by its form and by the
//! conditions of the choices around it, its branch takes the argument as it is down to that bound, and something that stays positive
//! below: the same on its own side to the last bit, and defined on both. For `b = 0` that is the modulus, for `b > 0` a parabola from
//! `b/2` on that ends in `b/4`. Both are piecewise polynomials here, which do not switch.

use std::collections::BTreeMap;

use num_rational::BigRational;
use num_traits::Signed;

use super::dag::{Dag, Id, Node};
use super::exact::shifted_f64;
use super::op::{Binary, Unary};
use super::piecewise::Piecewise;
use super::switching::LinearForm;

/// Nodes that are looked at for the sign of one argument.
const MOST: usize = 256;
/// Conditions that count at most, those of the innermost choices.
const MOST_FACTS: usize = 16;
/// Ways in which a condition may hold that are looked at.
const MOST_WAYS: usize = 16;

/// Coefficients of the modulus as a piecewise polynomial.
const MODULUS: [f64; 4] = [0.0, -1.0, 0.0, 1.0];

/// Signs of switching functions: is it positive?
type Facts = Vec<(u32, bool)>;

/// Arguments that must be positive, by the node of their function: what they are at least.
pub(super) type Domains = BTreeMap<Id, f64>;

/// The argument that must not be negative, or must not be zero, and whether zero is allowed.
fn argument(node: Node) -> Option<(Id, bool)> {
    match node {
        Node::Unary(Unary::Sqrt | Unary::Log, a) | Node::Binary(Binary::Pow, a, _) => Some((a, true)),
        Node::Binary(Binary::Div, _, a) => Some((a, false)),
        Node::PowI(a, n) if n < 0 => Some((a, false)),
        _ => None,
    }
}

impl Dag {
    /// Functions among some nodes, children first, whose arguments are known to be at least zero, or more, by their form and by the choices
    /// around them.
    pub(super) fn domains(&self, roots: &[Id], ids: &[Id]) -> Domains {
        let mut found = Domains::new();
        let chooses = ids.iter().any(|id| matches!(self.node(*id), Node::Select(..)));
        if !chooses || !ids.iter().any(|id| self.limited(*id).is_some()) {
            return found;
        }
        let around = self.facts_around(roots, ids);
        for &id in ids {
            let Some((a, zero)) = self.limited(id) else { continue };
            let facts = around[id.index()].as_deref().unwrap_or(&[]);
            let least = self.lower_bound(a, facts).filter(|l| l.is_finite() && (zero || *l > 0.0));
            found.extend(least.map(|l| (id, l)));
        }
        found
    }

    /// As [`argument`] of a node, unless that is constant.
    fn limited(&self, id: Id) -> Option<(Id, bool)> {
        argument(self.node(id)).filter(|(a, _)| self.as_const(*a).is_none())
    }

    /// Of every node what is known wherever its value is used.
    fn facts_around(&self, roots: &[Id], ids: &[Id]) -> Vec<Option<Facts>> {
        let mut around: Vec<Option<Facts>> = vec![None; ids.last().map_or(0, |id| id.index() + 1)];
        fn meet(place: &mut Option<Facts>, facts: &[(u32, bool)]) {
            match place {
                Some(known) => known.retain(|f| facts.contains(f)),
                None => *place = Some(facts.to_vec()),
            }
        }
        roots.iter().for_each(|r| meet(&mut around[r.index()], &[]));
        for &id in ids.iter().rev() {
            let facts = around[id.index()].clone().unwrap_or_default();
            if let Node::Select(c, a, b) = self.node(id) {
                meet(&mut around[c.index()], &facts);
                for (branch, holds) in [(a, true), (b, false)] {
                    let mut inside = facts.clone();
                    self.add_facts(c, holds, &mut inside);
                    meet(&mut around[branch.index()], &inside);
                }
            } else {
                self.for_children(id, |k| meet(&mut around[k.index()], &facts));
            }
        }
        around
    }

    /// What certainly holds where a condition does, or does not.
    fn add_facts(&self, condition: Id, holds: bool, facts: &mut Facts) {
        match self.node(condition) {
            Node::Positive(s) if !facts.contains(&(s, holds)) => {
                if facts.len() >= MOST_FACTS {
                    facts.remove(0);
                }
                facts.push((s, holds));
            }
            Node::Not(a) => self.add_facts(a, !holds, facts),
            Node::And(a, b) if holds => [a, b].into_iter().for_each(|c| self.add_facts(c, true, facts)),
            Node::Or(a, b) if !holds => [a, b].into_iter().for_each(|c| self.add_facts(c, false, facts)),
            _ => {}
        }
    }

    /// The ways in which a condition holds, or does not, beside what is known; none where there are too many.
    fn ways(&self, condition: Id, holds: bool, facts: &[(u32, bool)]) -> Option<Vec<Facts>> {
        let ways = match self.node(condition) {
            Node::Positive(s) if facts.contains(&(s, !holds)) => Vec::new(),
            Node::Positive(s) => vec![facts.iter().copied().chain([(s, holds)]).collect()],
            Node::Truth(v) => {
                if v == holds {
                    vec![facts.to_vec()]
                } else {
                    Vec::new()
                }
            }
            Node::Not(a) => self.ways(a, !holds, facts)?,
            Node::And(a, b) | Node::Or(a, b) if holds == matches!(self.node(condition), Node::And(..)) => {
                let first = self.ways(a, holds, facts)?;
                first.iter().map(|f| self.ways(b, holds, f)).collect::<Option<Vec<_>>>()?.concat()
            }
            Node::And(a, b) | Node::Or(a, b) => [self.ways(a, holds, facts)?, self.ways(b, holds, facts)?].concat(),
            _ => return None,
        };
        (ways.len() <= MOST_WAYS).then_some(ways)
    }

    /// What a value is at least, by the form of the expression and where these signs are known; none where it may be negative as far as that says.
    /// Infinite where nothing has these signs.
    fn lower_bound(&self, id: Id, facts: &[(u32, bool)]) -> Option<f64> {
        let mut left = MOST;
        self.least(id, facts, &mut left)
    }

    fn least(&self, id: Id, facts: &[(u32, bool)], left: &mut usize) -> Option<f64> {
        *left = left.checked_sub(1)?;
        let by_form = match self.node(id) {
            Node::Const(_) => return self.as_const(id).filter(|v| *v >= 0.0),
            Node::Unary(Unary::Sqrt, a) => Some(self.least(a, facts, left).map_or(0.0, f64::sqrt)),
            Node::Unary(Unary::Exp, _) => Some(0.0),
            Node::Unary(Unary::Cosh, _) => Some(1.0),
            Node::PowI(_, n) if n % 2 == 0 => Some(0.0),
            Node::Binary(Binary::Mul, a, b) if a == b => Some(0.0),
            Node::PowI(a, _) | Node::Binary(Binary::Pow, a, _) => self.least(a, facts, left).map(|_| 0.0),
            Node::Binary(Binary::Div, a, b) => {
                self.least(a, facts, left).and_then(|_| self.least(b, facts, left)).map(|_| 0.0)
            }
            Node::Binary(Binary::Mul, a, b) => {
                let a = self.least(a, facts, left);
                // nothing times infinity
                a.and_then(|a| self.least(b, facts, left).map(|b| if a == 0.0 || b == 0.0 { 0.0 } else { a * b }))
            }
            Node::Binary(Binary::Add, a, b) => {
                let a = self.least(a, facts, left);
                let sum = a.and_then(|a| self.least(b, facts, left).map(|b| a + b));
                sum.or_else(|| self.least_of_sum(&self.linear_form(id), facts, left))
            }
            Node::Binary(Binary::Sub, ..) => self.least_of_sum(&self.linear_form(id), facts, left),
            Node::Select(c, a, b) if self.is_modulus(c, a, b) => Some(0.0),
            Node::Select(c, a, b) => self.least_of_choice((c, a, b), facts, left),
            _ => None,
        };
        let by_facts = facts.iter().filter_map(|f| self.least_by(id, *f));
        by_facts.chain(by_form).fold(None, |m: Option<f64>, v| Some(m.map_or(v, |m| m.max(v))))
    }

    fn least_of_choice(&self, (c, a, b): (Id, Id, Id), facts: &[(u32, bool)], left: &mut usize) -> Option<f64> {
        let mut least = f64::INFINITY;
        for (branch, holds) in [(a, true), (b, false)] {
            // without a way that is known each branch stands for itself
            for way in self.ways(c, holds, facts).unwrap_or_else(|| vec![facts.to_vec()]) {
                least = least.min(self.least(branch, &way, left)?);
            }
        }
        Some(least)
    }

    /// What a sum is at least: that of each branch of a choice in it, as `max(a, b) - b`.
    fn least_of_sum(&self, form: &LinearForm, facts: &[(u32, bool)], left: &mut usize) -> Option<f64> {
        *left = left.checked_sub(1)?;
        let choice = form.terms.iter().find_map(|(id, _)| match self.node(*id) {
            Node::Select(c, a, b) => Some((*id, c, [(a, true), (b, false)])),
            _ => None,
        });
        let Some((id, condition, branches)) = choice else {
            let constant = form.terms.is_empty() && !form.constant.is_negative();
            let by_facts = facts.iter().filter_map(|f| self.least_of_form_by(form, *f));
            let all = by_facts.chain(constant.then(|| shifted_f64(&form.constant, 0)));
            return all.fold(None, |m: Option<f64>, v| Some(m.map_or(v, |m| m.max(v))));
        };
        let mut least = f64::INFINITY;
        for (branch, holds) in branches {
            let chosen = form.replaced(id, &self.linear_form(branch));
            for way in self.ways(condition, holds, facts).unwrap_or_else(|| vec![facts.to_vec()]) {
                least = least.min(self.least_of_sum(&chosen, &way, left)?);
            }
        }
        Some(least)
    }

    /// What a value is at least because it is a positive multiple of a switching function of this sign, and a constant that is not negative.
    fn least_by(&self, id: Id, fact: (u32, bool)) -> Option<f64> {
        self.least_of_form_by(&self.linear_form(id), fact)
    }

    fn least_of_form_by(&self, form: &LinearForm, (s, positive): (u32, bool)) -> Option<f64> {
        let psi = self.linear_form(self.switches[s as usize].psi);
        let ratio = &form.terms.first()?.1 / &psi.terms.first()?.1;
        let rest: BigRational = &form.constant - &ratio * &psi.constant;
        let multiple = form.terms == psi.times(&ratio).terms;
        (multiple && ratio.is_positive() == positive && !rest.is_negative()).then(|| shifted_f64(&rest, 0))
    }

    /// Is a choice the modulus of its switching function?
    fn is_modulus(&self, condition: Id, a: Id, b: Id) -> bool {
        let Node::Positive(s) = self.node(condition) else { return false };
        let (psi, form) = (self.linear_form(self.switches[s as usize].psi), self.linear_form(a));
        let Some(ratio) = form.ratio_to(&psi) else { return false };
        ratio.is_positive() && self.linear_form(b) == psi.times(&-ratio)
    }

    /// Is it a modulus as a table, which continues a branch beyond where it is taken?
    pub(crate) fn is_continuation(&self, id: Id) -> bool {
        let Node::Piecewise(index, 0, _) = self.node(id) else { return false };
        let p = &self.piecewise[index as usize];
        p.breaks() == [0.0] && p.coefficients() == MODULUS
    }

    /// The argument `new` of a function, made by deciding switches of one that is at least `least`: the same where it is that much, and
    /// positive elsewhere.
    pub(super) fn continued(&mut self, new: Id, least: f64) -> Id {
        if self.as_const(new).is_some() || self.lower_bound(new, &[]).is_some_and(|l| l >= least) {
            return new;
        }
        if least == 0.0 {
            return match Piecewise::new(&[0.0], 1, &MODULUS, 0) {
                Ok(modulus) => self.piecewise(&modulus, new),
                Err(_) => new,
            };
        }
        // what is added to the argument itself, so that nothing is rounded where it is zero
        let (b, half) = (least, 0.5 * least);
        let pieces = [0.5 * half, -1.0, 0.0, 0.5 * half, -1.0, 1.0 / b, 0.0, 0.0, 0.0];
        match Piecewise::new(&[0.0, half], 2, &pieces, 1) {
            Ok(more) => {
                let more = self.piecewise(&more, new);
                self.add(new, more)
            }
            Err(_) => new,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dag::Block;
    use super::super::ExprFunction;
    use super::*;
    use crate::func::{Dims, Function, Point};

    #[test]
    fn branches_of_roots_of_moduli_are_defined_on_both_sides() {
        let mut d = Dag::new();
        let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
        let modulus = d.abs(x);
        let whole = d.unary(Unary::Sqrt, modulus);
        for positive in [true, false] {
            let branch = d.decide(&[whole], &|_| Some(positive))[0];
            let Node::Unary(Unary::Sqrt, inside) = d.node(branch) else { panic!("{:?}", d.node(branch)) };
            assert!(matches!(d.node(inside), Node::Piecewise(..)));
        }
        // what the switches do not decide is as it was: a root that is not defined is an error of the model
        let root = d.unary(Unary::Sqrt, x);
        let zero = d.constant(0.0);
        let tank = d.relay(y, root, zero);
        assert_eq!(d.decide(&[tank], &|_| Some(true))[0], root);
        // nor is a modulus in the place of a difference
        let one = d.constant(1.0);
        let less = d.sub(modulus, one);
        let other = d.unary(Unary::Sqrt, less);
        let branch = d.decide(&[other], &|_| Some(true))[0];
        let plain = d.sub(x, one);
        assert_eq!(branch, d.unary(Unary::Sqrt, plain));
    }

    /// Values of both branches of a choice on both sides of its surface, and what the choice is there.
    fn branches(d: &mut Dag, whole: Id, x: f64) -> [f64; 2] {
        let own = Dims { x: 1, u: 0, p: 0 };
        [true, false].map(|positive| {
            let branch = d.decide(&[whole], &|_| Some(positive))[0];
            let f = ExprFunction::new("branch", d, own, &[branch]).unwrap();
            let (mut out, mut work) = ([f64::NAN], vec![0.0; f.work_len()]);
            let at = Point { t: 0.0, x: &[x], u: &[], p: &[] };
            f.value(&at, &mut out, &mut work).map_or(f64::NAN, |()| out[0])
        })
    }

    /// What is taken on one side of `x = c` only, as it is written and as numbers, for random `c`: its branch is the same number there and a number
    /// on the other side.
    #[test]
    fn pieces_are_defined_on_both_sides_of_their_surface() {
        type Build = fn(&mut Dag, Id, Id) -> Id;
        type Number = fn(f64, f64) -> f64;
        let cases: [(Build, Number); 8] = [
            (
                |d, x, c| {
                    let m = d.max(x, c);
                    let z = d.sub(m, c);
                    let e = d.constant(1.5);
                    d.binary(Binary::Pow, z, e)
                },
                |x, c| (x - c).powf(1.5),
            ),
            (
                |d, x, c| {
                    let z = d.sub(x, c);
                    let o = d.constant(0.0);
                    let m = d.max(z, o);
                    d.unary(Unary::Sqrt, m)
                },
                |x, c| (x - c).sqrt(),
            ),
            (
                |d, x, c| {
                    let z = d.sub(x, c);
                    let on = d.positive(z);
                    let r = d.unary(Unary::Sqrt, z);
                    let o = d.constant(0.0);
                    d.select(on, r, o)
                },
                |x, c| (x - c).sqrt(),
            ),
            (
                |d, x, c| {
                    let z = d.sub(x, c);
                    let on = d.positive(z);
                    let l = d.unary(Unary::Log, x);
                    let o = d.constant(0.0);
                    d.select(on, l, o)
                },
                |x, _| x.ln(),
            ),
            (
                |d, x, c| {
                    let m = d.max(x, c);
                    d.unary(Unary::Log, m)
                },
                |x, _| x.ln(),
            ),
            (
                |d, x, c| {
                    let m = d.max(x, c);
                    let e = d.constant(1.0);
                    d.div(e, m)
                },
                |x, _| 1.0 / x,
            ),
            (
                |d, x, c| {
                    let m = d.max(x, c);
                    d.powi(m, -2)
                },
                |x, _| 1.0 / (x * x),
            ),
            (
                |d, x, c| {
                    let m = d.max(x, c);
                    let k = d.constant(2.0);
                    let z = d.mul(k, m);
                    let e = d.constant(0.3);
                    d.binary(Binary::Pow, z, e)
                },
                |x, _| (2.0 * x).powf(0.3),
            ),
        ];
        let mut numbers = crate::random::SplitMix64::new(10);
        for (k, (build, number)) in cases.iter().enumerate() {
            for _ in 0..8 {
                let mut draw = || (4.0 * numbers.share() - 2.0).exp();
                let (c, more, less) = (draw(), draw(), draw());
                let mut d = Dag::new();
                let (x, at) = (d.input(Block::X, 0), d.constant(c));
                let whole = build(&mut d, x, at);
                let above = branches(&mut d, whole, c + more)[0];
                assert_eq!(above, number(c + more, c), "case {k}");
                for x in [c - less, c - 10.0 * c, 0.0] {
                    assert!(branches(&mut d, whole, x).iter().all(|v| v.is_finite()), "case {k} at {x}, {c}");
                }
            }
        }
    }

    /// What is negative somewhere on its own side stays an error of the model.
    #[test]
    fn what_is_not_defined_on_its_own_side_is_left_alone() {
        let mut d = Dag::new();
        let (x, zero, one) = (d.input(Block::X, 0), d.constant(0.0), d.constant(1.0));
        let less = d.sub(x, one);
        let (on, root) = (d.positive(x), d.unary(Unary::Sqrt, less));
        let whole = d.select(on, root, zero);
        assert!(branches(&mut d, whole, 0.5)[0].is_nan());
        let below = d.select(on, zero, root);
        assert!(branches(&mut d, below, -0.5)[1].is_nan());
    }
}
