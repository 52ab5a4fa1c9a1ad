//! All operators under one number each, for interfaces that pass operators as data.

use super::dag::{Dag, Id};
use super::op::{Binary, Unary};
use crate::error::{Error, Result};

/// An operator. The numbers are part of the C interface: new ones are added at the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[allow(missing_docs)]
#[non_exhaustive]
pub enum Operator {
    Neg = 0,
    Sqrt,
    Exp,
    Log,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Erf,
    Floor,
    Add = 20,
    Sub,
    Mul,
    Div,
    Pow,
    Atan2,
    /// Condition `a > 0`.
    Positive = 40,
    Not,
    And,
    Or,
    /// `b` where the condition `a` holds, else `c`.
    Where,
    Sign,
    Abs,
    Min,
    Max,
    /// `a` limited to `[b, c]`.
    Clip,
    /// `b` where `a > 0`, else `c`.
    Relay,
    /// Distance of `a` from `[−b, b]`, with sign.
    DeadZone,
}

/// What an operand must be.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Value,
    Condition,
}

impl Operator {
    /// All operators.
    pub const ALL: [Operator; 33] = {
        use Operator::*;
        [
            Neg, Sqrt, Exp, Log, Sin, Cos, Tan, Asin, Acos, Atan, Sinh, Cosh, Tanh, Erf, Floor, Add, Sub, Mul, Div,
            Pow, Atan2, Positive, Not, And, Or, Where, Sign, Abs, Min, Max, Clip, Relay, DeadZone,
        ]
    };

    /// The operator with this number.
    pub fn from_number(n: i32) -> Result<Operator> {
        let all = Operator::ALL;
        all.into_iter().find(|o| *o as i32 == n).ok_or_else(|| Error::Range(format!("there is no operator {n}")))
    }

    fn operands(self) -> &'static [Kind] {
        use Kind::{Condition as C, Value as V};
        match self {
            Operator::Not => &[C],
            Operator::And | Operator::Or => &[C, C],
            Operator::Where => &[C, V, V],
            Operator::Clip | Operator::Relay => &[V, V, V],
            Operator::Add
            | Operator::Sub
            | Operator::Mul
            | Operator::Div
            | Operator::Pow
            | Operator::Atan2
            | Operator::Min
            | Operator::Max
            | Operator::DeadZone => &[V, V],
            _ => &[V],
        }
    }

    /// Number of operands.
    pub fn arity(self) -> usize {
        self.operands().len()
    }
}

impl Dag {
    /// Applies an operator.
    ///
    /// # Errors
    /// [`Error::Dimension`] for a wrong number of operands, [`Error::Range`] for a condition in the place of a value or
    /// the other way round.
    pub fn apply(&mut self, op: Operator, args: &[Id]) -> Result<Id> {
        let kinds = op.operands();
        if args.len() != kinds.len() {
            return Err(Error::Dimension(format!("{op:?} takes {} operands, {} given", kinds.len(), args.len())));
        }
        for (k, (&a, &kind)) in args.iter().zip(kinds).enumerate() {
            if self.is_condition(a) != (kind == Kind::Condition) {
                let (is, wanted) =
                    if kind == Kind::Value { ("condition", "value") } else { ("value", "condition such as a > 0") };
                return Err(Error::Range(format!("operand {k} of {op:?} is a {is}, not a {wanted}")));
            }
        }
        let unary = |dag: &mut Dag, op: Unary| dag.unary(op, args[0]);
        let binary = |dag: &mut Dag, op: Binary| dag.binary(op, args[0], args[1]);
        Ok(match op {
            Operator::Neg => unary(self, Unary::Neg),
            Operator::Sqrt => unary(self, Unary::Sqrt),
            Operator::Exp => unary(self, Unary::Exp),
            Operator::Log => unary(self, Unary::Log),
            Operator::Sin => unary(self, Unary::Sin),
            Operator::Cos => unary(self, Unary::Cos),
            Operator::Tan => unary(self, Unary::Tan),
            Operator::Asin => unary(self, Unary::Asin),
            Operator::Acos => unary(self, Unary::Acos),
            Operator::Atan => unary(self, Unary::Atan),
            Operator::Sinh => unary(self, Unary::Sinh),
            Operator::Cosh => unary(self, Unary::Cosh),
            Operator::Tanh => unary(self, Unary::Tanh),
            Operator::Erf => unary(self, Unary::Erf),
            Operator::Floor => unary(self, Unary::Floor),
            Operator::Add => binary(self, Binary::Add),
            Operator::Sub => binary(self, Binary::Sub),
            Operator::Mul => binary(self, Binary::Mul),
            Operator::Div => binary(self, Binary::Div),
            Operator::Pow => binary(self, Binary::Pow),
            Operator::Atan2 => binary(self, Binary::Atan2),
            Operator::Positive => self.positive(args[0]),
            Operator::Not => self.not(args[0]),
            Operator::And => self.and(args[0], args[1]),
            Operator::Or => self.or(args[0], args[1]),
            Operator::Where => self.select(args[0], args[1], args[2]),
            Operator::Sign => self.sign(args[0]),
            Operator::Abs => self.abs(args[0]),
            Operator::Min => self.min(args[0], args[1]),
            Operator::Max => self.max(args[0], args[1]),
            Operator::Clip => self.clip(args[0], args[1], args[2]),
            Operator::Relay => self.relay(args[0], args[1], args[2]),
            Operator::DeadZone => self.dead_zone(args[0], args[1]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::dag::Block;
    use super::*;

    #[test]
    fn numbers_and_operands() {
        let mut d = Dag::new();
        let x = d.input(Block::X, 0);
        let c = d.positive(x);
        for op in Operator::ALL {
            assert_eq!(Operator::from_number(op as i32).unwrap(), op);
            let good: Vec<Id> = op.operands().iter().map(|k| if *k == Kind::Value { x } else { c }).collect();
            d.apply(op, &good).unwrap();
            let bad: Vec<Id> = op.operands().iter().map(|k| if *k == Kind::Value { c } else { x }).collect();
            assert!(matches!(d.apply(op, &bad), Err(Error::Range(_))));
            assert!(matches!(d.apply(op, &good[1..]), Err(Error::Dimension(_))));
        }
        assert!(Operator::from_number(19).is_err() && Operator::from_number(-1).is_err());
    }
}
