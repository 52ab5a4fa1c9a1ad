//! Costs that switch: sums of smooth terms and of maxima with positive factors, as `|a|`, `max(a, b)` and `max(a, 0)²` are.
//!
//! A choice `A` where `ψ > 0`, else `B`, is `max(A, B) = B + max(0, A − B)` where `A − B` is a positive multiple of `ψ`, and
//! `min(A, B) = A − max(0, A − B)` where it is a negative one. Both are decided on coefficients in exact arithmetic.

use std::sync::Arc;

use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

use super::dag::{Dag, Id, Node};
use super::exact::shifted_f64;
use super::function::ExprFunction;
use super::op::Binary;
use super::switching::LinearForm;
use crate::error::{Error, Result};
use crate::func::{Dims, Function, Kinked, Maximum};

/// Pieces of one maximum at most: `n` sums of moduli in one have `2ⁿ`.
const MAX_PIECES: usize = 64;

/// `weight max(0, pieces)`, or its square.
struct Parts {
    weight: f64,
    pieces: Vec<Id>,
    squared: bool,
}

/// A choice between two values that meet where it switches.
struct Choice {
    /// The values; the difference of the first and the second.
    a: Id,
    b: Id,
    difference: Id,
    /// The larger one is chosen, rather than the smaller.
    larger: bool,
}

impl Dag {
    /// A function of these outputs: one output alone may be a cost with kinks.
    ///
    /// # Errors
    /// As [`ExprFunction::new`], and [`Dag::cost`] for one output.
    pub fn function(&mut self, name: &str, dims: Dims, outputs: &[Id]) -> Result<Arc<dyn Function>> {
        match *outputs {
            [output] => self.cost(name, dims, output),
            _ => Ok(Arc::new(ExprFunction::new(name, self, dims, outputs)?)),
        }
    }

    /// A cost that may have kinks: [`ExprFunction`] where the output does not switch, else [`Kinked`].
    ///
    /// # Errors
    /// As [`ExprFunction::new`]; [`Error::Unsupported`] for a cost that is not a sum of smooth terms and of maxima with positive factors.
    pub fn cost(&mut self, name: &str, dims: Dims, output: Id) -> Result<Arc<dyn Function>> {
        if !self.switches(output) {
            return Ok(Arc::new(ExprFunction::new(name, self, dims, &[output])?));
        }
        let (smooth, maxima) = self.maxima(output).ok_or_else(|| {
            Error::Unsupported(format!(
                "function '{name}': sign, abs, min, max and where are evaluated in costs that are sums of smooth terms and of maxima with \
                 positive factors, such as abs(a) and max(a, 0)**2, and nowhere else: build a model of the dynamics, which turns them into \
                 switching functions"
            ))
        })?;
        let smooth = Arc::new(ExprFunction::new(name, self, dims, &[smooth])?);
        let mut kinks = Vec::new();
        for m in maxima {
            let of = Arc::new(ExprFunction::new(name, self, dims, &m.pieces)?);
            kinks.push(Maximum { weight: m.weight, of, squared: m.squared });
        }
        Ok(Arc::new(Kinked::new(name, smooth, kinks)?))
    }

    fn switches(&self, id: Id) -> bool {
        self.reachable(&[id]).iter().any(|&id| matches!(self.node(id), Node::Select(..)))
    }

    /// `smooth + Σ maxima`, none where the value is nothing like that.
    fn maxima(&mut self, id: Id) -> Option<(Id, Vec<Parts>)> {
        let (mut smooth, mut maxima) = (self.constant(0.0), Vec::new());
        let mut open = vec![(id, BigRational::one())];
        while let Some((id, factor)) = open.pop() {
            let form = self.linear_form(id);
            let constant = self.constant(shifted_f64(&(&form.constant * &factor), 0));
            smooth = self.add(smooth, constant);
            for (term, c) in form.terms {
                let c = c * &factor;
                let size = shifted_f64(&c.abs(), 0);
                if !self.switches(term) {
                    smooth = self.plus(smooth, &c, term);
                } else if let Some(inner) = self.square_of(term) {
                    let one_sided = self.one_sided(inner).filter(|_| c.is_positive())?;
                    maxima.push(Parts { weight: size, pieces: self.largest_of(one_sided)?, squared: true });
                } else {
                    let choice = self.meeting(term)?;
                    if choice.larger != c.is_positive() {
                        return None;
                    }
                    maxima.push(Parts { weight: size, pieces: self.largest_of(choice.difference)?, squared: false });
                    open.push((if choice.larger { choice.b } else { choice.a }, c));
                }
            }
        }
        Some((smooth, maxima))
    }

    /// `sum + c term`.
    fn plus(&mut self, sum: Id, c: &BigRational, term: Id) -> Id {
        if c.is_one() {
            return self.add(sum, term);
        }
        let factor = self.constant(shifted_f64(c, 0));
        let product = self.mul(factor, term);
        self.add(sum, product)
    }

    fn square_of(&self, id: Id) -> Option<Id> {
        match self.node(id) {
            Node::PowI(a, 2) => Some(a),
            Node::Binary(Binary::Mul, a, b) if a == b => Some(a),
            _ => None,
        }
    }

    /// A choice without a jump.
    fn meeting(&mut self, id: Id) -> Option<Choice> {
        let Node::Select(condition, a, b) = self.node(id) else { return None };
        let Node::Positive(s) = self.node(condition) else { return None };
        let difference = self.sub(a, b);
        let form = self.linear_form(difference);
        let written = self.switches[s as usize].psi;
        let others = self.nearly_equal(s as usize).to_vec();
        let ratio = std::iter::once(written).chain(others).find_map(|psi| form.ratio_to(&self.linear_form(psi)))?;
        Some(Choice { a, b, difference, larger: ratio.is_positive() })
    }

    /// The value `a` of which this is `max(0, a)`, or `±` the square root of whose square it is: `min(0, −a)`.
    fn one_sided(&mut self, id: Id) -> Option<Id> {
        let c = self.meeting(id)?;
        let zero = |dag: &Dag, id: Id| dag.as_const(id) == Some(0.0);
        let a = match (zero(self, c.a), zero(self, c.b)) {
            (false, true) => c.a,
            (true, false) => c.b,
            _ => return None,
        };
        Some(if c.larger { a } else { self.neg(a) })
    }

    /// Smooth values of which this is the largest.
    fn largest_of(&mut self, id: Id) -> Option<Vec<Id>> {
        let form = self.linear_form(id);
        let mut pieces = vec![self.constant(shifted_f64(&form.constant, 0))];
        for (term, c) in form.terms {
            if !self.switches(term) {
                pieces = pieces.into_iter().map(|p| self.plus(p, &c, term)).collect();
                continue;
            }
            let choice = self.meeting(term)?;
            if choice.larger != c.is_positive() {
                return None;
            }
            let mut sides = Vec::new();
            for side in [choice.a, choice.b] {
                let zero = self.constant(0.0);
                let scaled = self.plus(zero, &c, side);
                sides.extend(self.largest_of(scaled)?);
            }
            if pieces.len() * sides.len() > MAX_PIECES {
                return None;
            }
            pieces =
                pieces.iter().flat_map(|&p| sides.iter().map(move |&s| (p, s))).map(|(p, s)| self.add(p, s)).collect();
        }
        Some(pieces)
    }
}

impl LinearForm {
    /// The factor with which `other` is this form; none where there is none.
    pub(super) fn ratio_to(&self, other: &LinearForm) -> Option<BigRational> {
        let ratio = &self.terms.first()?.1 / &other.terms.first()?.1;
        (!ratio.is_zero() && *self == other.times(&ratio)).then_some(ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Graph;
    use super::*;
    use crate::func::Point;

    const D: Dims = Dims { x: 1, u: 2, p: 0 };

    fn value(f: &dyn Function, x: f64, u: [f64; 2]) -> f64 {
        let (mut out, mut work) = ([0.0], vec![0.0; f.work_len()]);
        f.value(&Point { t: 0.0, x: &[x], u: &u, p: &[] }, &mut out, &mut work).unwrap();
        out[0]
    }

    #[test]
    fn sums_of_maxima_are_costs_and_have_their_values() {
        let g = Graph::new();
        let (x, u, v) = (g.x(0), g.u(0), g.u(1));
        let c = |v: f64| g.constant(v);
        type Plain = fn(f64, f64, f64) -> f64;
        let cases: [(_, Plain, usize); 8] = [
            (u.abs(), |_, u, _| u.abs(), 1),
            (c(0.1) * u.abs() + v.abs() * 3.0 + x * x, |x, u, v| 0.1 * u.abs() + 3.0 * v.abs() + x * x, 2),
            (u.max(v), |_, u, v| u.max(v), 1),
            (-u.min(c(0.3) * v) - 1.0, |_, u, v| -u.min(0.3 * v) - 1.0, 1),
            (u.max(c(0.0)) * u.max(c(0.0)) * 2.0, |_, u, _| 2.0 * u.max(0.0).powi(2), 1),
            ((u.abs() - 0.5).max(c(0.0)), |_, u, _| (u.abs() - 0.5).max(0.0), 1),
            ((u.abs() + v.abs() * 2.0 - 1.0).max(x), |x, u, v| (u.abs() + 2.0 * v.abs() - 1.0).max(x), 1),
            ((x - 1.0).min(c(0.0)).powi(2), |x, _, _| (x - 1.0).min(0.0).powi(2), 1),
        ];
        for (k, (e, plain, kinks)) in cases.iter().enumerate() {
            let f = g.cost("cost", D, *e).unwrap();
            assert_eq!(f.kinked().unwrap().kinks().len(), *kinks, "case {k}");
            for (x, u, v) in [(0.2, 0.7, -0.4), (1.3, -0.7, 0.2), (0.0, 0.1, 0.3), (-3.0, -2.0, -5.0)] {
                let (found, expected) = (value(f.as_ref(), x, [u, v]), plain(x, u, v));
                assert!((found - expected).abs() <= 1e-15 * expected.abs().max(1.0), "case {k}: {found} {expected}");
            }
        }
        assert!(g.cost("cost", D, u * v).unwrap().kinked().is_none());
    }

    #[test]
    fn what_points_up_or_jumps_is_no_cost() {
        let g = Graph::new();
        let (x, u, v) = (g.x(0), g.u(0), g.u(1));
        let zero = g.constant(0.0);
        let above = u.gt(zero);
        for e in [
            -u.abs(),
            u.min(v),
            u.sign(),
            x * u.abs(),
            u.abs().sqrt(),
            above.select(u * 2.0, u + 1.0),
            (v - u.abs()).max(zero),
            -(u.max(zero) * u.max(zero)),
            (u.abs() - 1.0).powi(2),
        ] {
            assert!(matches!(g.cost("cost", D, e), Err(Error::Unsupported(_))));
        }
        // 7 moduli in one maximum are 128 pieces
        let many = (0..7).fold(x, |s, k| s + (u - f64::from(k)).abs());
        assert!(g.cost("cost", D, many.max(zero)).is_err());
    }
}
