//! Scalar operations: values, and nothing else.

/// Functions of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Unary {
    /// `−a`
    Neg,
    /// `√a`
    Sqrt,
    /// `eᵃ`
    Exp,
    /// Natural logarithm.
    Log,
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Inverse sine.
    Asin,
    /// Inverse cosine.
    Acos,
    /// Inverse tangent.
    Atan,
    /// Hyperbolic sine.
    Sinh,
    /// Hyperbolic cosine.
    Cosh,
    /// Hyperbolic tangent.
    Tanh,
    /// Error function.
    Erf,
    /// The largest whole number that is not larger; for what is evaluated at events.
    Floor,
}

impl Unary {
    /// All of them.
    pub const ALL: [Unary; 15] = [
        Unary::Neg,
        Unary::Sqrt,
        Unary::Exp,
        Unary::Log,
        Unary::Sin,
        Unary::Cos,
        Unary::Tan,
        Unary::Asin,
        Unary::Acos,
        Unary::Atan,
        Unary::Sinh,
        Unary::Cosh,
        Unary::Tanh,
        Unary::Erf,
        Unary::Floor,
    ];

    /// Name, as in C.
    pub fn name(self) -> &'static str {
        match self {
            Unary::Neg => "-",
            Unary::Sqrt => "sqrt",
            Unary::Exp => "exp",
            Unary::Log => "log",
            Unary::Sin => "sin",
            Unary::Cos => "cos",
            Unary::Tan => "tan",
            Unary::Asin => "asin",
            Unary::Acos => "acos",
            Unary::Atan => "atan",
            Unary::Sinh => "sinh",
            Unary::Cosh => "cosh",
            Unary::Tanh => "tanh",
            Unary::Erf => "erf",
            Unary::Floor => "floor",
        }
    }

    /// Value at `a`.
    #[inline(never)]
    pub fn eval(self, a: f64) -> f64 {
        match self {
            Unary::Neg => -a,
            Unary::Sqrt => a.sqrt(),
            Unary::Exp => a.exp(),
            Unary::Log => a.ln(),
            Unary::Sin => a.sin(),
            Unary::Cos => a.cos(),
            Unary::Tan => a.tan(),
            Unary::Asin => a.asin(),
            Unary::Acos => a.acos(),
            Unary::Atan => a.atan(),
            Unary::Sinh => a.sinh(),
            Unary::Cosh => a.cosh(),
            Unary::Tanh => a.tanh(),
            Unary::Erf => erf(a),
            Unary::Floor => a.floor(),
        }
    }
}

/// Functions of two arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Binary {
    /// `a + b`
    Add,
    /// `a − b`
    Sub,
    /// `a b`
    Mul,
    /// `a / b`
    Div,
    /// `aᵇ`, `b` real.
    Pow,
    /// Angle of the point `(b, a)`.
    Atan2,
}

impl Binary {
    /// All of them.
    pub const ALL: [Binary; 6] = [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Pow, Binary::Atan2];

    /// Sign, or name as in C.
    pub fn name(self) -> &'static str {
        match self {
            Binary::Add => "+",
            Binary::Sub => "-",
            Binary::Mul => "*",
            Binary::Div => "/",
            Binary::Pow => "pow",
            Binary::Atan2 => "atan2",
        }
    }

    /// Value at `a`, `b`.
    #[inline]
    pub fn eval(self, a: f64, b: f64) -> f64 {
        match self {
            Binary::Add => a + b,
            Binary::Sub => a - b,
            Binary::Mul => a * b,
            Binary::Div => a / b,
            Binary::Pow => a.powf(b),
            Binary::Atan2 => a.atan2(b),
        }
    }
}

/// `aⁿ` by squaring; the order of the products is fixed, so that C code gives the same bits.
#[inline]
pub fn powi(a: f64, n: i32) -> f64 {
    let (mut base, mut k, mut out) = (a, n.unsigned_abs(), 1.0);
    loop {
        if k & 1 == 1 {
            out *= base;
        }
        k >>= 1;
        if k == 0 {
            break;
        }
        base *= base;
    }
    if n < 0 {
        1.0 / out
    } else {
        out
    }
}

/// Error function, absolute error of a few units in the last place: a series of positive terms up to 2.4, a
/// continued fraction beyond. Argument and value are numbers without unit, so its constants are no tolerances.
pub fn erf(x: f64) -> f64 {
    let a = x.abs();
    if a < 2.4 {
        let y = 2.0 * x * x;
        let (mut term, mut sum, mut n) = (1.0, 1.0, 3.0);
        while term > 1e-17 * sum {
            term *= y / n;
            sum += term;
            n += 2.0;
        }
        return std::f64::consts::FRAC_2_SQRT_PI * x * sum * (-x * x).exp();
    }
    if a > 6.0 {
        return if x > 0.0 { 1.0 } else { -1.0 };
    }
    // NaN comes here and stays NaN.
    let mut f = a;
    for k in (1..=60).rev() {
        f = a + 0.5 * f64::from(k) / f;
    }
    let tail = 0.5 * std::f64::consts::FRAC_2_SQRT_PI * (-a * a).exp() / f;
    if x > 0.0 {
        1.0 - tail
    } else {
        tail - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_function() {
        // Abramowitz and Stegun, table 7.1, and the complement at 3 and 4.
        let known = [
            (0.0, 0.0),
            (0.5, 0.520_499_877_813_046_5),
            (1.0, 0.842_700_792_949_714_9),
            (2.0, 0.995_322_265_018_952_7),
            (3.0, 1.0 - 2.209_049_699_858_544e-5),
            (4.0, 1.0 - 1.541_725_790_028_002e-8),
        ];
        for (x, y) in known {
            assert!((erf(x) - y).abs() < 4e-16, "{x}: {} {y}", erf(x));
            assert_eq!(erf(-x), -erf(x));
        }
        assert!((erf(2.4f64.next_down()) - erf(2.4)).abs() < 1e-15);
        assert_eq!((erf(7.0), erf(f64::INFINITY), erf(f64::NEG_INFINITY)), (1.0, 1.0, -1.0));
        assert!(erf(f64::NAN).is_nan());
        assert!((erf(1e-300) / 1e-300 - std::f64::consts::FRAC_2_SQRT_PI).abs() < 1e-15);
    }

    #[test]
    fn integer_powers() {
        for n in -9..=9 {
            let exact = 1.5f64.powf(f64::from(n));
            assert!((powi(1.5, n) - exact).abs() <= 4e-16 * exact, "{n}");
        }
        assert_eq!((powi(2.0, 10), powi(2.0, -2), powi(-2.0, 3), powi(0.0, 0)), (1024.0, 0.25, -8.0, 1.0));
    }
}
