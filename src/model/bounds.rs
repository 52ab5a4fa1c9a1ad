//! Bounds of expressions for arbitrary inputs, by interval arithmetic that rounds outwards.
//!
//! Every bound is a fact: no value of the expression lies outside, whatever real numbers the inputs are. Sums, products
//! and powers are rounded outwards where they are not exact; functions of the system's mathematical library, which are
//! right to a unit in the last place or two, by [`SLACK`] units.

use crate::expr::{Binary, Block, Dag, Id, Node, Unary};

/// Units in the last place that a value of the mathematical library may be wrong.
const SLACK: usize = 4;

/// The least and the largest value a node can have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// Any number.
pub(crate) const ALL: Interval = Interval { low: f64::NEG_INFINITY, high: f64::INFINITY };

/// Intervals of the nodes of a part of a graph.
pub(crate) struct Bounds {
    ids: Vec<Id>,
    of: Vec<Interval>,
}

impl Bounds {
    /// Of everything the roots are computed from, in one pass.
    pub(super) fn new(dag: &Dag, roots: &[Id]) -> Bounds {
        Bounds::within(dag, roots, &|_, _| ALL)
    }

    /// The same for inputs in these intervals.
    pub(crate) fn within(dag: &Dag, roots: &[Id], inputs: &dyn Fn(Block, usize) -> Interval) -> Bounds {
        let ids = dag.reachable(roots);
        let mut bounds = Bounds { of: Vec::with_capacity(ids.len()), ids };
        for k in 0..bounds.ids.len() {
            let interval = match dag.node(bounds.ids[k]) {
                Node::Input(block, i) => inputs(block, i as usize),
                _ => bounds.node(dag, bounds.ids[k]),
            };
            bounds.of.push(interval);
        }
        bounds
    }

    /// Of a node; any number where it is not known.
    pub(crate) fn get(&self, id: Id) -> Interval {
        self.ids.binary_search(&id).ok().and_then(|k| self.of.get(k)).copied().unwrap_or(ALL)
    }

    fn node(&self, dag: &Dag, id: Id) -> Interval {
        match dag.node(id) {
            Node::Const(bits) if f64::from_bits(bits).is_finite() => {
                Interval { low: f64::from_bits(bits), high: f64::from_bits(bits) }
            }
            Node::Unary(op, a) => unary(op, self.get(a)),
            Node::Binary(op, a, b) => binary(op, self.get(a), self.get(b)),
            Node::PowI(a, n) => power(self.get(a), n),
            _ => ALL,
        }
    }
}

impl Interval {
    fn new(low: f64, high: f64) -> Interval {
        // An overflow is no infinite value: the largest number is a bound then.
        if low.is_nan() || high.is_nan() || low > high {
            return ALL;
        }
        Interval { low: low.min(f64::MAX), high: high.max(f64::MIN) }
    }

    fn not_negative(self) -> bool {
        self.low >= 0.0
    }

    fn not_positive(self) -> bool {
        self.high <= 0.0
    }

    fn neg(self) -> Interval {
        Interval { low: -self.high, high: -self.low }
    }
}

fn steps(v: f64, n: usize, step: fn(f64) -> f64) -> f64 {
    (0..n).fold(v, |v, _| step(v))
}

/// An increasing function of the mathematical library with these limits, which is zero, or one, at zero exactly.
fn increasing(a: Interval, f: fn(f64) -> f64, limits: (f64, f64)) -> Interval {
    let at_zero = f(0.0);
    let mut low = steps(f(a.low), SLACK, f64::next_down).max(limits.0);
    let mut high = steps(f(a.high), SLACK, f64::next_up).min(limits.1);
    if a.not_negative() {
        low = low.max(at_zero);
    }
    if a.not_positive() {
        high = high.min(at_zero);
    }
    Interval::new(low, high)
}

fn unary(op: Unary, a: Interval) -> Interval {
    // the numbers next to π/2 and π that are larger
    let right_angle = std::f64::consts::FRAC_PI_2.next_up();
    let infinite = f64::INFINITY;
    match op {
        Unary::Neg => a.neg(),
        // where it is defined
        Unary::Sqrt => {
            let (low, high) = (a.low.max(0.0).sqrt(), a.high.max(0.0).sqrt());
            let exact = |root: f64, v: f64| {
                root == 0.0 || root.is_infinite() || (root * root == v && product_is_exact(root, root))
            };
            let low = if exact(low, a.low.max(0.0)) { low } else { low.next_down() };
            let high = if exact(high, a.high.max(0.0)) { high } else { high.next_up() };
            Interval::new(low, high)
        }
        Unary::Exp => increasing(a, f64::exp, (0.0, infinite)),
        Unary::Sin | Unary::Cos => Interval::new(-1.0, 1.0),
        Unary::Atan => increasing(a, f64::atan, (-right_angle, right_angle)),
        Unary::Tanh => increasing(a, f64::tanh, (-1.0, 1.0)),
        Unary::Sinh => increasing(a, f64::sinh, (-infinite, infinite)),
        Unary::Erf => increasing(a, |v| Unary::Erf.eval(v), (-1.0, 1.0)),
        Unary::Cosh => Interval::new(1.0, infinite),
        Unary::Acos => Interval::new(0.0, std::f64::consts::PI.next_up()),
        Unary::Asin => Interval::new(-right_angle, right_angle),
        Unary::Floor => Interval::new(a.low.floor(), a.high.floor()),
        Unary::Log | Unary::Tan => ALL,
    }
}

fn binary(op: Binary, a: Interval, b: Interval) -> Interval {
    match op {
        Binary::Add => Interval::new(sum(a.low, b.low, f64::next_down), sum(a.high, b.high, f64::next_up)),
        Binary::Sub => binary(Binary::Add, a, b.neg()),
        Binary::Mul => {
            let corners = [(a.low, b.low), (a.low, b.high), (a.high, b.low), (a.high, b.high)];
            let low = corners.iter().map(|c| product(c.0, c.1, f64::next_down)).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(|c| product(c.0, c.1, f64::next_up)).fold(f64::NEG_INFINITY, f64::max);
            Interval::new(low, high)
        }
        // the sign of a quotient, where it is defined
        Binary::Div => {
            let same = (a.not_negative() && b.not_negative()) || (a.not_positive() && b.not_positive());
            let other = (a.not_negative() && b.not_positive()) || (a.not_positive() && b.not_negative());
            match (same, other) {
                (true, _) => Interval::new(0.0, f64::INFINITY),
                (_, true) => Interval::new(f64::NEG_INFINITY, 0.0),
                _ => ALL,
            }
        }
        Binary::Pow if a.not_negative() => Interval::new(0.0, f64::INFINITY),
        Binary::Pow => ALL,
        Binary::Atan2 => {
            let angle = std::f64::consts::PI.next_up();
            Interval::new(-angle, angle)
        }
    }
}

fn power(a: Interval, n: i32) -> Interval {
    let at = |v: f64, step: fn(f64) -> f64| whole_power(v.abs(), n.unsigned_abs(), step);
    match (n > 0, n % 2 == 0) {
        (true, true) => {
            let least = if a.low > 0.0 {
                a.low
            } else if a.high < 0.0 {
                -a.high
            } else {
                0.0
            };
            let low = at(least, f64::next_down).max(0.0);
            Interval::new(low, at(a.low.abs().max(a.high.abs()), f64::next_up))
        }
        (true, false) => {
            let low = if a.low < 0.0 { -at(a.low, f64::next_up) } else { at(a.low, f64::next_down).max(0.0) };
            let high = if a.high < 0.0 { -at(a.high, f64::next_down).max(0.0) } else { at(a.high, f64::next_up) };
            Interval::new(low, high)
        }
        // where it is defined
        (false, true) => Interval::new(0.0, f64::INFINITY),
        (false, false) if a.not_negative() => Interval::new(0.0, f64::INFINITY),
        (false, false) if a.not_positive() => Interval::new(f64::NEG_INFINITY, 0.0),
        (false, false) => ALL,
    }
}

/// `vⁿ` of a number that is not negative, by squaring, every product rounded one way.
fn whole_power(v: f64, n: u32, step: fn(f64) -> f64) -> f64 {
    let (mut base, mut k, mut out) = (v, n, 1.0f64);
    while k > 0 {
        if k & 1 == 1 {
            out = product(out, base, step).max(0.0);
        }
        k >>= 1;
        if k > 0 {
            base = product(base, base, step).max(0.0);
        }
    }
    out
}

/// `a + b`, rounded one way unless it is exact (the error of a sum is a number itself: Knuth's two-sum).
fn sum(a: f64, b: f64, step: fn(f64) -> f64) -> f64 {
    let s = a + b;
    if !s.is_finite() {
        return s;
    }
    let part = s - a;
    let error = (a - (s - part)) + (b - part);
    if error == 0.0 {
        s
    } else {
        step(s)
    }
}

/// `a b`, rounded one way unless it is exact; zero times anything is zero.
fn product(a: f64, b: f64, step: fn(f64) -> f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        return 0.0;
    }
    let p = a * b;
    if !p.is_finite() || product_is_exact(a, b) {
        p
    } else {
        step(p)
    }
}

/// The error of a product is a number itself, and zero if it is exact, unless it is too small to be one.
fn product_is_exact(a: f64, b: f64) -> bool {
    let p = a * b;
    p.abs() > 1e-290 && a.mul_add(b, -p) == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::{Expr, Graph};

    fn of(g: &Graph, e: Expr) -> (f64, f64) {
        let id = g.ids(&[e])[0];
        let i = Bounds::new(&g.dag(), &[id]).get(id);
        (i.low, i.high)
    }

    #[test]
    fn bounds_that_are_numbers_are_exact() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let inf = f64::INFINITY;
        let cases = [
            (x * x + 1.0, (1.0, inf)),
            (-(x * x) - 2.0, (-inf, -2.0)),
            (x.exp(), (0.0, inf)),
            ((x * x).exp(), (1.0, inf)),
            (x.cosh() * 3.0, (3.0, inf)),
            (x.sin() * y.cos(), (-1.0, 1.0)),
            ((x * x).tanh(), (0.0, 1.0)),
            ((x * x + 4.0).sqrt(), (2.0, inf)),
            ((x * x + 3.0).powi(3), (27.0, inf)),
            ((-(x * x) - 3.0).powi(3), (-inf, -27.0)),
            ((x * x) / (y * y + 1.0), (0.0, inf)),
            (-(x * x) / (y * y + 1.0), (-inf, 0.0)),
            ((x * x).powf(0.3), (0.0, inf)),
            (x.powi(-2), (0.0, inf)),
            (x + y, (-inf, inf)),
            (x.sinh() / y, (-inf, inf)),
        ];
        for (e, b) in cases {
            assert_eq!(of(&g, e), b, "{e:?}");
        }
    }

    /// The value of an angle's bound in `f64` is below the angle: it is no bound.
    #[test]
    fn bounds_that_are_rounded_are_rounded_outwards() {
        let g = Graph::new();
        let x = g.x(0);
        assert!(of(&g, x.atan()).1 > std::f64::consts::FRAC_PI_2);
        assert!(of(&g, x.acos()).1 > std::f64::consts::PI);
        let (low, high) = of(&g, (x.sin() + 1.5).exp());
        assert!(low < 0.5f64.exp() && high > 2.5f64.exp() && low > 0.5f64.exp() * (1.0 - 1e-14));
        let (low, high) = of(&g, x.sin() * 0.1 + 0.3);
        assert!(low <= 0.3 - 0.1 && (0.1 + 0.3..0.4 + 1e-15).contains(&high));
        let (low, _) = of(&g, (x * x + 2.0).sqrt());
        assert!(low < 2f64.sqrt() && low > 1.41);
        // an overflow is a large number, not an infinite one
        for e in [(x.cosh() * 1000.0).exp(), (x * x + 1e200).powi(2)] {
            let low = of(&g, e).0;
            assert!(low.is_finite() && low > 1e308);
        }
        // neither is an underflow zero
        assert!(of(&g, (x.sin() * 1e-200).powi(2)).1 > 0.0);
    }
}
