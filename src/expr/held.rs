//! Expressions that are evaluated once, at an event: what switches is decided there, and derivatives are those of the branch that is taken.

use super::dag::{Block, Dag, Id, Node};
use super::exact::shifted_f64;
use super::function::ExprFunction;
use super::op::Unary;
use super::piecewise::Piecewise;
use crate::error::{Error, Result};
use crate::func::Dims;
use num_traits::Zero;

impl Dag {
    /// A function that is evaluated at single times, as the reset of a transition is: it may switch and jump. A choice has the derivative of what is
    /// chosen, and `floor` has the derivative zero; jumps in between are not seen. All that can be chosen is evaluated, so it must be defined.
    ///
    /// # Errors
    /// As [`ExprFunction::new`].
    pub fn function_at_events(&mut self, name: &str, dims: Dims, outputs: &[Id]) -> Result<ExprFunction> {
        let decided = self.decided(outputs)?;
        ExprFunction::with_jumps(name, self, dims, &decided)
    }

    /// The same values without choices: `a` where `c`, else `b`, is `χ a + (1 − χ) b` with a table `χ` of steps that is 1 where `c` holds.
    fn decided(&mut self, outputs: &[Id]) -> Result<Vec<Id>> {
        let step = Piecewise::steps(&[0.0], &[0.0, 1.0])?;
        let mut known: Vec<Option<Id>> = Vec::new();
        // inner switching functions are older than those they are part of
        for s in self.switches_of(outputs) {
            known.resize(known.len().max(s + 1), None);
            let psi =
                self.switching_function(s).ok_or_else(|| Error::Internal("a switching function is lost".into()))?;
            let psi = self.rebuild(&[psi], &mut |_, s| known.get(s as usize).copied().flatten())[0];
            known[s] = Some(self.piecewise(&step, psi));
        }
        if known.is_empty() {
            return Ok(outputs.to_vec());
        }
        Ok(self.rebuild(outputs, &mut |_, s| known.get(s as usize).copied().flatten()))
    }

    /// Does a value jump between events without being a choice: has it `floor`?
    pub(crate) fn has_floor(&self, outputs: &[Id]) -> bool {
        self.reachable(outputs).iter().any(|id| matches!(self.node(*id), Node::Unary(Unary::Floor, _)))
    }

    /// Times at which tables of time in these expressions have knots, ascending, and whether a value jumps there.
    pub fn table_times(&self, outputs: &[Id]) -> Vec<(f64, bool)> {
        let mut found: Vec<(f64, bool)> = Vec::new();
        for id in self.reachable(outputs) {
            let Node::Piecewise(index, order, a) = self.node(id) else { continue };
            let (constant, terms) = self.affine_terms(a);
            let [(time, slope)] = &terms[..] else { continue };
            if self.node(*time) != Node::Input(Block::T, 0) || slope.is_zero() {
                continue;
            }
            let table = &self.piecewise[index as usize];
            let jumps = table.smoothness() < i32::from(order);
            let (constant, slope) = (shifted_f64(&constant, 0), shifted_f64(slope, 0));
            let at = table.breaks().iter().map(|b| (b - constant) / slope);
            found.extend(at.filter(|t| t.is_finite()).map(|t| (t, jumps)));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        // of several tables one jump is enough
        found.dedup_by(|b, a| {
            a.0 == b.0 && {
                a.1 |= b.1;
                true
            }
        });
        found
    }
}

/// That a function may not have `floor`.
pub(super) fn no_floor(name: &str) -> Error {
    Error::Unsupported(format!(
        "function '{name}': floor jumps again and again, and is evaluated where the state jumps only: in resets, clocks and values that are held"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{Function, Point};

    fn values(d: &mut Dag, out: Id, x: [f64; 2]) -> (f64, Vec<f64>) {
        let f = d.function_at_events("f", Dims { x: 2, u: 0, p: 0 }, &[out]).unwrap();
        let at = Point { t: 0.0, x: &x, u: &[], p: &[] };
        let (mut v, mut work) = ([0.0], vec![0.0; f.work_len()]);
        f.value(&at, &mut v, &mut work).unwrap();
        let mut jac = vec![0.0; f.jac_pattern().nnz()];
        f.jacobian(&at, &mut jac, &mut work).unwrap();
        let mut dense = vec![0.0; 2];
        let p = f.jac_pattern();
        (0..2).for_each(|c| p.range(c).for_each(|k| dense[c] = jac[k]));
        (v[0], dense)
    }

    #[test]
    fn choices_have_the_value_and_the_derivative_of_what_is_chosen() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 2);
        let square = d.powi(x[0], 2);
        let (low, high) = (d.constant(-1.0), d.constant(1.0));
        let bounded = d.clip(square, low, high);
        let out = d.mul(bounded, x[1]);
        assert_eq!(values(&mut d, out, [0.5, 3.0]), (0.75, vec![3.0, 0.25]));
        assert_eq!(values(&mut d, out, [2.0, 3.0]), (3.0, vec![0.0, 1.0]));
        // joined conditions
        let (a, b) = (d.positive(x[0]), d.positive(x[1]));
        let both = d.and(a, b);
        let out = d.select(both, square, x[1]);
        assert_eq!(values(&mut d, out, [3.0, 1.0]), (9.0, vec![6.0, 0.0]));
        assert_eq!(values(&mut d, out, [3.0, -1.0]), (-1.0, vec![0.0, 1.0]));
    }

    #[test]
    fn floor_has_no_derivative_and_is_refused_elsewhere() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 2);
        let whole = d.unary(Unary::Floor, x[0]);
        let rest = d.sub(x[0], whole);
        let out = d.mul(rest, x[1]);
        assert_eq!(values(&mut d, out, [2.75, 4.0]), (3.0, vec![4.0, 0.75]));
        assert_eq!(values(&mut d, out, [-0.25, 4.0]).0, 3.0);
        let refused = ExprFunction::new("f", &mut d, Dims { x: 2, u: 0, p: 0 }, &[out]);
        assert!(matches!(refused, Err(Error::Unsupported(_))));
    }

    #[test]
    fn knots_of_tables_of_time_are_known() {
        let mut d = Dag::new();
        let (t, x) = (d.input(Block::T, 0), d.input(Block::X, 0));
        let lines = Piecewise::lines(&[0.0, 1.0, 3.0], &[0.0, 2.0, 1.0]).unwrap();
        let steps = Piecewise::steps(&[1.0], &[0.0, 2.0]).unwrap();
        let two = d.constant(2.0);
        let twice = d.mul(two, t);
        let a = d.piecewise(&lines, twice);
        let b = d.piecewise(&steps, t);
        let c = d.piecewise(&lines, x);
        let sum = d.add(a, b);
        let all = d.add(sum, c);
        assert_eq!(d.table_times(&[all]), [(0.0, false), (0.5, false), (1.0, true), (1.5, false)]);
    }
}
