//! Operators of expressions: numbers, names, operands, values.

use Operator::*;

/// An operator of an expression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    Power,
    /// `max(a − b, 0)`
    Less,
    Minimum,
    Maximum,
    Floor,
    Ceil,
    Abs,
    Negate,
    Or,
    And,
    LessThan,
    AtMost,
    Equal,
    AtLeast,
    GreaterThan,
    NotEqual,
    Not,
    /// `b` where `a` is true, else `c`.
    If,
    Tanh,
    Tan,
    Sqrt,
    Sinh,
    Sin,
    Log10,
    Log,
    Exp,
    Cosh,
    Cos,
    Atanh,
    Atan2,
    Atan,
    Asinh,
    Asin,
    Acosh,
    Acos,
    Sum,
    IntegerDivide,
    Precision,
    Round,
    Truncate,
    Square,
}

/// Number of operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arity {
    /// So many.
    Fixed(usize),
    /// A number that is in the file.
    List,
}

/// Numbers of operators in files, names in AMPL, operands, and the operators; those without one are known by name alone.
const TABLE: &[(i32, &str, Arity, Option<Operator>)] = {
    const ONE: Arity = Arity::Fixed(1);
    const TWO: Arity = Arity::Fixed(2);
    const THREE: Arity = Arity::Fixed(3);
    &[
        (0, "+", TWO, Some(Add)),
        (1, "-", TWO, Some(Subtract)),
        (2, "*", TWO, Some(Multiply)),
        (3, "/", TWO, Some(Divide)),
        (4, "mod", TWO, Some(Remainder)),
        (5, "^", TWO, Some(Power)),
        (6, "less", TWO, Some(Less)),
        (11, "min", Arity::List, Some(Minimum)),
        (12, "max", Arity::List, Some(Maximum)),
        (13, "floor", ONE, Some(Floor)),
        (14, "ceil", ONE, Some(Ceil)),
        (15, "abs", ONE, Some(Abs)),
        (16, "unary -", ONE, Some(Negate)),
        (20, "or", TWO, Some(Or)),
        (21, "and", TWO, Some(And)),
        (22, "<", TWO, Some(LessThan)),
        (23, "<=", TWO, Some(AtMost)),
        (24, "=", TWO, Some(Equal)),
        (28, ">=", TWO, Some(AtLeast)),
        (29, ">", TWO, Some(GreaterThan)),
        (30, "!=", TWO, Some(NotEqual)),
        (34, "not", ONE, Some(Not)),
        (35, "if", THREE, Some(If)),
        (37, "tanh", ONE, Some(Tanh)),
        (38, "tan", ONE, Some(Tan)),
        (39, "sqrt", ONE, Some(Sqrt)),
        (40, "sinh", ONE, Some(Sinh)),
        (41, "sin", ONE, Some(Sin)),
        (42, "log10", ONE, Some(Log10)),
        (43, "log", ONE, Some(Log)),
        (44, "exp", ONE, Some(Exp)),
        (45, "cosh", ONE, Some(Cosh)),
        (46, "cos", ONE, Some(Cos)),
        (47, "atanh", ONE, Some(Atanh)),
        (48, "atan2", TWO, Some(Atan2)),
        (49, "atan", ONE, Some(Atan)),
        (50, "asinh", ONE, Some(Asinh)),
        (51, "asin", ONE, Some(Asin)),
        (52, "acosh", ONE, Some(Acosh)),
        (53, "acos", ONE, Some(Acos)),
        (54, "sum", Arity::List, Some(Sum)),
        (55, "div", TWO, Some(IntegerDivide)),
        (56, "precision", TWO, Some(Precision)),
        (57, "round", TWO, Some(Round)),
        (58, "trunc", TWO, Some(Truncate)),
        (59, "count", Arity::List, None),
        (60, "numberof", Arity::List, None),
        (61, "numberof of symbols", Arity::List, None),
        (62, "atleast", TWO, None),
        (63, "atmost", TWO, None),
        (65, "if with symbols", THREE, None),
        (66, "exactly", TWO, None),
        (67, "not atleast", TWO, None),
        (68, "not atmost", TWO, None),
        (69, "not exactly", TWO, None),
        (70, "forall", Arity::List, Some(And)),
        (71, "exists", Arity::List, Some(Or)),
        (72, "==>", THREE, None),
        (73, "<==>", TWO, None),
        (74, "alldiff", Arity::List, None),
        (75, "not alldiff", Arity::List, None),
        (76, "^ with a constant exponent", TWO, Some(Power)),
        (77, "square", ONE, Some(Square)),
        (78, "^ with a constant base", TWO, Some(Power)),
    ]
};

/// Name, operands and operator of a number in a file.
pub fn of_number(n: i32) -> Option<(&'static str, Arity, Option<Operator>)> {
    TABLE.iter().find(|row| row.0 == n).map(|row| (row.1, row.2, row.3))
}

impl Operator {
    /// Name in AMPL.
    pub fn name(self) -> &'static str {
        TABLE.iter().find(|row| row.3 == Some(self)).map_or("", |row| row.1)
    }

    /// Is the value true or false, as 1 or 0?
    pub fn is_logical(self) -> bool {
        matches!(self, Or | And | LessThan | AtMost | Equal | AtLeast | GreaterThan | NotEqual | Not)
    }

    /// Value of an operator, as AMPL has it; NaN where there is none.
    pub fn value(self, args: &[f64]) -> f64 {
        let a = args.first().copied().unwrap_or(f64::NAN);
        let b = args.get(1).copied().unwrap_or(f64::NAN);
        let truth = |t: bool| if t { 1.0 } else { 0.0 };
        match self {
            Add => a + b,
            Subtract => a - b,
            Multiply => a * b,
            Divide => a / b,
            Remainder => a % b,
            Power => a.powf(b),
            Less => (a - b).max(0.0),
            // a value that does not exist is not passed over
            Minimum => args.iter().fold(f64::INFINITY, |m, v| if *v < m || v.is_nan() { *v } else { m }),
            Maximum => args.iter().fold(f64::NEG_INFINITY, |m, v| if *v > m || v.is_nan() { *v } else { m }),
            Floor => a.floor(),
            Ceil => a.ceil(),
            Abs => a.abs(),
            Negate => -a,
            Or => truth(args.iter().any(|v| *v != 0.0)),
            And => truth(args.iter().all(|v| *v != 0.0)),
            LessThan => truth(a < b),
            AtMost => truth(a <= b),
            Equal => truth(a == b),
            AtLeast => truth(a >= b),
            GreaterThan => truth(a > b),
            NotEqual => truth(a != b),
            Not => truth(a == 0.0),
            If if a != 0.0 => b,
            If => args.get(2).copied().unwrap_or(f64::NAN),
            Tanh => a.tanh(),
            Tan => a.tan(),
            Sqrt => a.sqrt(),
            Sinh => a.sinh(),
            Sin => a.sin(),
            Log10 => a.log10(),
            Log => a.ln(),
            Exp => a.exp(),
            Cosh => a.cosh(),
            Cos => a.cos(),
            Atanh => a.atanh(),
            Atan2 => a.atan2(b),
            Atan => a.atan(),
            Asinh => a.asinh(),
            Asin => a.asin(),
            Acosh => a.acosh(),
            Acos => a.acos(),
            Sum => args.iter().sum(),
            IntegerDivide => (a / b).trunc(),
            Precision => precision(a, b),
            Round => digits(a, b, f64::round),
            Truncate => digits(a, b, f64::trunc),
            Square => a * a,
        }
    }
}

/// `a` with so many digits behind the decimal point.
fn digits(a: f64, n: f64, cut: fn(f64) -> f64) -> f64 {
    let scale = 10f64.powf(n.trunc());
    let scaled = cut(a * scale) / scale;
    // beyond the range of the numbers all digits are kept
    if scaled.is_finite() {
        scaled
    } else {
        a
    }
}

/// `a` with so many significant digits.
fn precision(a: f64, n: f64) -> f64 {
    if a == 0.0 || !a.is_finite() || n.is_nan() {
        return a;
    }
    let places = n.clamp(1.0, 17.0) as usize - 1;
    format!("{a:.places$e}").parse().unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_format() {
        // table 3 and 4 of "Writing .nl files"
        for (n, name) in
            [(5, "^"), (16, "unary -"), (35, "if"), (43, "log"), (48, "atan2"), (54, "sum"), (70, "forall")]
        {
            assert_eq!(of_number(n).unwrap().0, name);
        }
        assert!(of_number(7).is_none() && of_number(-1).is_none());
        assert!(TABLE.windows(2).all(|w| w[0].0 < w[1].0));
    }

    #[test]
    fn values() {
        assert_eq!(Less.value(&[3.0, 5.0]), 0.0);
        assert_eq!(Minimum.value(&[3.0, -5.0, 1.0]), -5.0);
        assert!(Maximum.value(&[f64::NAN, 1.0]).is_nan() && Minimum.value(&[1.0, f64::NAN, 0.0]).is_nan());
        assert_eq!((Round.value(&[2.345, 2.0]), Truncate.value(&[-2.7, 0.0])), (2.35, -2.0));
        assert_eq!((Precision.value(&[123.456, 2.0]), IntegerDivide.value(&[-7.0, 2.0])), (120.0, -3.0));
        assert_eq!((If.value(&[1.0, 2.0, 3.0]), If.value(&[0.0, 2.0, 3.0])), (2.0, 3.0));
        assert_eq!((And.value(&[1.0, 0.0]), Or.value(&[1.0, 0.0]), Not.value(&[0.0])), (0.0, 1.0, 1.0));
    }
}
