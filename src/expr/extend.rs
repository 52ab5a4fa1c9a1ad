//! Branches of functions that are only defined where they are taken, continued beyond.
//!
//! `sqrt |a|` has the branches `sqrt a` and `sqrt −a`, and neither is defined on the other side of `a = 0`, where an
//! integrator looks for the switch and where a switching function that contains them is still evaluated. Where the argument
//! of a root, a logarithm or a real power is never negative as it was written, its branch takes the modulus of what is left
//! of it: the same on its own side to the last bit, and defined on both. The modulus is a piecewise polynomial here, which
//! does not switch.

use num_traits::Signed;

use super::dag::{Dag, Id, Node};
use super::op::{Binary, Unary};
use super::piecewise::Piecewise;

/// Nodes that are looked at for the sign of one argument.
const MOST: usize = 256;

impl Dag {
    /// Is the value never negative, by the form of the expression? Choices are not if neither branch is negative, or if they
    /// are a modulus.
    fn is_never_negative(&self, id: Id) -> bool {
        let mut open = vec![id];
        for _ in 0..MOST {
            let Some(id) = open.pop() else { return true };
            match self.node(id) {
                Node::Const(_) if self.as_const(id).is_some_and(|v| v >= 0.0) => {}
                Node::Unary(Unary::Sqrt | Unary::Exp | Unary::Cosh, _) => {}
                Node::PowI(_, n) if n % 2 == 0 => {}
                Node::Binary(Binary::Mul, a, b) if a == b => {}
                Node::PowI(a, _) | Node::Binary(Binary::Pow, a, _) => open.push(a),
                Node::Select(c, a, b) if self.is_modulus(c, a, b) => {}
                Node::Select(_, a, b) | Node::Binary(Binary::Add | Binary::Mul | Binary::Div, a, b) => {
                    open.extend([a, b])
                }
                _ => return false,
            }
        }
        false
    }

    /// Is a choice the modulus of its switching function?
    fn is_modulus(&self, condition: Id, a: Id, b: Id) -> bool {
        let Node::Positive(s) = self.node(condition) else { return false };
        let (psi, form) = (self.linear_form(self.switches[s as usize].psi), self.linear_form(a));
        let Some(ratio) = form.ratio_to(&psi) else { return false };
        ratio.is_positive() && self.linear_form(b) == psi.times(&-ratio)
    }

    /// Is there anything to continue in a function of `new`, which is made of `old` by deciding switches?
    fn loses_its_domain(&self, old: Id, new: Id) -> bool {
        old != new && !self.is_never_negative(new) && self.is_never_negative(old)
    }

    /// The argument of a root, a logarithm or a power: `new`, made of `old` by deciding switches, or its modulus.
    pub(super) fn within_domain(&mut self, old: Id, new: Id) -> Id {
        if !self.loses_its_domain(old, new) {
            return new;
        }
        match Piecewise::new(&[0.0], 1, &[0.0, -1.0, 0.0, 1.0], 0) {
            Ok(modulus) => self.piecewise(&modulus, new),
            Err(_) => new,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dag::Block;
    use super::*;

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
}
