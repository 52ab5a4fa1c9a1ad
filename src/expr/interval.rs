//! Bounds of the values of a program over a box of inputs.
//!
//! The instructions run on intervals that are rounded outwards, so no value that [`Tape::run`] computes at a point of the
//! box lies outside, nor any exact one. Where an operation is not defined in the whole box nothing is known of it.

use super::dag::CallKind;
use super::implicit::Implicit;
use super::op::Unary;
use super::piecewise::Piecewise;
use super::tape::{Code, Compound, Tape};
use crate::func::Point;

/// Units in the last place that a value of the mathematical library may be wrong.
const SLACK: usize = 4;

/// Sines of larger numbers are between −1 and 1, and nothing more is said of them.
const LARGE_ANGLE: f64 = 1e6;

/// Lower and upper bound.
type Range = [f64; 2];

const ALL: Range = [f64::NEG_INFINITY, f64::INFINITY];

/// Widened by one unit in the last place; everything where a bound is no number.
#[inline]
fn out(low: f64, high: f64) -> Range {
    if low <= high {
        [low.next_down(), high.next_up()]
    } else {
        ALL
    }
}

fn widen(low: f64, high: f64) -> Range {
    let r = (0..SLACK).fold([low, high], |r, _| [r[0].next_down(), r[1].next_up()]);
    if low <= high {
        r
    } else {
        ALL
    }
}

#[inline]
fn add(a: Range, b: Range) -> Range {
    out(a[0] + b[0], a[1] + b[1])
}

#[inline]
fn neg(a: Range) -> Range {
    [-a[1], -a[0]]
}

fn mul(a: Range, b: Range) -> Range {
    let corners = [a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]];
    // zero times infinity
    if corners.iter().any(|c| c.is_nan()) {
        return ALL;
    }
    let low = corners.iter().copied().fold(f64::INFINITY, f64::min);
    let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    out(low, high)
}

fn div(a: Range, b: Range) -> Range {
    if b[0] > 0.0 || b[1] < 0.0 {
        mul(a, out(1.0 / b[1], 1.0 / b[0]))
    } else {
        ALL
    }
}

fn square(a: Range) -> Range {
    let (l, h) = (a[0].abs(), a[1].abs());
    let least = if a[0] <= 0.0 && a[1] >= 0.0 { 0.0 } else { l.min(h) };
    let most = l.max(h);
    let r = out(least * least, most * most);
    [r[0].max(0.0), r[1]]
}

fn power(a: Range, n: i32) -> Range {
    if n < 0 {
        return div([1.0, 1.0], power(a, n.saturating_neg()));
    }
    // as the program computes it, one product after the other rounded outwards
    let mut result = [1.0, 1.0];
    let (mut base, mut k) = (a, n);
    while k > 0 {
        if k & 1 == 1 {
            result = mul(result, base);
        }
        k >>= 1;
        if k > 0 {
            base = square(base);
        }
    }
    result
}

/// Does `from + 2π k` lie between `a` and `b` for a whole number `k`, or so near that rounding may decide?
fn meets(a: f64, b: f64, from: f64) -> bool {
    let turn = 2.0 * std::f64::consts::PI;
    let slack = 1e-9;
    ((b - from) / turn + slack).floor() >= ((a - from) / turn - slack).ceil()
}

fn sine(a: Range, shift: f64, f: fn(f64) -> f64) -> Range {
    let largest = a[0].abs().max(a[1].abs());
    if largest.is_nan() || largest >= LARGE_ANGLE {
        return [-1.0, 1.0];
    }
    let quarter = std::f64::consts::FRAC_PI_2;
    let (l, h) = (f(a[0]), f(a[1]));
    let r = widen(l.min(h), l.max(h));
    let low = if meets(a[0], a[1], -quarter - shift) { -1.0 } else { r[0].max(-1.0) };
    let high = if meets(a[0], a[1], quarter - shift) { 1.0 } else { r[1].min(1.0) };
    [low, high]
}

fn unary(op: Unary, a: Range) -> Range {
    let increasing = |f: fn(f64) -> f64| widen(f(a[0]), f(a[1]));
    match op {
        Unary::Neg => neg(a),
        Unary::Sqrt if a[0] >= 0.0 => {
            let r = out(a[0].sqrt(), a[1].sqrt());
            [r[0].max(0.0), r[1]]
        }
        Unary::Exp => increasing(f64::exp),
        Unary::Log if a[0] > 0.0 => increasing(f64::ln),
        Unary::Atan => increasing(f64::atan),
        Unary::Tanh => increasing(f64::tanh),
        Unary::Sinh => increasing(f64::sinh),
        Unary::Asin if a[0] >= -1.0 && a[1] <= 1.0 => increasing(f64::asin),
        Unary::Acos if a[0] >= -1.0 && a[1] <= 1.0 => widen(a[1].acos(), a[0].acos()),
        Unary::Floor => [a[0].floor(), a[1].floor()],
        Unary::Cosh => {
            let least = if a[0] <= 0.0 && a[1] >= 0.0 { 0.0 } else { a[0].abs().min(a[1].abs()) };
            widen(least.cosh(), a[0].abs().max(a[1].abs()).cosh())
        }
        Unary::Sin => sine(a, 0.0, f64::sin),
        Unary::Cos => sine(a, std::f64::consts::FRAC_PI_2, f64::cos),
        Unary::Sqrt | Unary::Log | Unary::Asin | Unary::Acos | Unary::Tan | Unary::Erf => ALL,
    }
}

/// Of a table: of every piece in the interval, by Horner's rule.
fn table(p: &Piecewise, a: Range) -> Range {
    let (breaks, n) = (p.breaks(), p.degree() + 1);
    let (first, last) = (breaks.partition_point(|b| *b <= a[0]), breaks.partition_point(|b| *b <= a[1]));
    let mut all = [f64::INFINITY, f64::NEG_INFINITY];
    for (k, c) in p.coefficients().chunks_exact(n).enumerate().take(last + 1).skip(first) {
        let origin = breaks.get(k.saturating_sub(1)).copied().unwrap_or(0.0);
        let from = if k == first { a[0] } else { breaks[k - 1] };
        let to = if k == last { a[1] } else { breaks[k] };
        // a piece of constant value is known however far it goes
        let degree = c.iter().rposition(|c| *c != 0.0).unwrap_or(0);
        let s = out(from - origin, to - origin);
        let r = c[..degree].iter().rev().fold([c[degree]; 2], |v, c| add(mul(v, s), [*c; 2]));
        all = [all[0].min(r[0]), all[1].max(r[1])];
    }
    if all[0] <= all[1] {
        all
    } else {
        ALL
    }
}

impl Compound {
    /// Bounds of what a block computes; nothing is known of most.
    fn bounds(&self, dst: usize, l: &mut [f64], h: &mut [f64]) {
        let Compound::Call { f, what: CallKind::Value, args, scratch, n } = self else { return };
        let Some(f) = Implicit::of(f) else { return };
        let (l, work) = l.split_at_mut(*scratch);
        let (z, work) = work.split_at_mut(2 * args.len());
        for (a, v) in args.iter().zip(z.chunks_exact_mut(2)) {
            v.copy_from_slice(&[l[*a as usize], h[*a as usize]]);
        }
        let [low, high] = f.value_bounds(z, work).unwrap_or(ALL);
        if *n > 0 {
            (l[dst], h[dst]) = (low, high);
        }
    }
}

impl Tape {
    /// Bounds of all results over the points between `low` and `high`, `work[2 work_len]`.
    pub(super) fn bounds(
        &self,
        low: &Point,
        high: &Point,
        out_low: &mut [f64],
        out_high: &mut [f64],
        work: &mut [f64],
    ) {
        let (l, h) = work.split_at_mut(self.work_len());
        let (times_low, times_high) = ([low.t], [high.t]);
        let (from, to) = ([low.x, low.u, low.p, &times_low], [high.x, high.u, high.p, &times_high]);
        for (k, load) in self.loads.iter().enumerate() {
            let (block, index) = (load.block as usize, load.index as usize);
            (l[k], h[k]) = (from[block][index], to[block][index]);
        }
        for (k, c) in self.constants.iter().enumerate() {
            (l[self.loads.len() + k], h[self.loads.len() + k]) = (*c, *c);
        }
        // what blocks compute is not known
        let registers = self.first_register();
        l[registers..].fill(f64::NEG_INFINITY);
        h[registers..self.work_len()].fill(f64::INFINITY);
        for i in &self.code {
            let at = |k: u32| [l[k as usize], h[k as usize]];
            let constant = || [self.immediates[i.b as usize]; 2];
            let r = match i.code {
                Code::Add => add(at(i.a), at(i.b)),
                Code::Sub => add(at(i.a), neg(at(i.b))),
                Code::Mul if i.a == i.b => square(at(i.a)),
                Code::Mul => mul(at(i.a), at(i.b)),
                Code::Div => div(at(i.a), at(i.b)),
                Code::AddConstant => add(constant(), at(i.a)),
                Code::ConstantMinus => add(constant(), neg(at(i.a))),
                Code::Scale => mul(constant(), at(i.a)),
                Code::ConstantOver => div(constant(), at(i.a)),
                Code::Neg => neg(at(i.a)),
                Code::Square => square(at(i.a)),
                Code::Sqrt => unary(Unary::Sqrt, at(i.a)),
                Code::Unary(op) => unary(op, at(i.a)),
                Code::PowI => power(at(i.a), i.b as i32),
                Code::Piecewise if i.b & 15 == 0 => table(&self.piecewise[(i.b >> 4) as usize], at(i.a)),
                Code::Pow | Code::Atan2 | Code::Piecewise => ALL,
                Code::Block => {
                    self.compounds[i.a as usize].bounds(i.dst as usize, l, h);
                    continue;
                }
            };
            (l[i.dst as usize], h[i.dst as usize]) = (r[0], r[1]);
        }
        for (k, &o) in self.outputs.iter().enumerate() {
            (out_low[k], out_high[k]) = (l[o as usize], h[o as usize]);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::expr::{Expr, Graph};
    use crate::func::{Dims, Function, Point};

    fn at(x: &[f64]) -> Point<'_> {
        Point { t: 0.0, x, u: &[], p: &[] }
    }

    /// Values at points of random boxes stay inside, and boxes that are points have narrow bounds.
    #[test]
    fn no_value_lies_outside() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let cases: Vec<Expr> = vec![
            x + y * 3.0,
            (x * x + y * y).sqrt() - 0.4,
            x * y - 2.0 / (y * y + 1.0),
            x.sin() + 0.3 * y.cos() + x * y.sin(),
            (x - y).powi(3) + x.powi(2) + (x * x + 1.0).powi(-2),
            (0.1 * x).exp() + (x * x + 2.0).ln() + y.atan() + y.tanh() + (0.1 * y).cosh() + (0.1 * x).sinh(),
            (0.9 * x.sin()).asin() + (0.9 * y.cos()).acos(),
            x / y + 1.0 / x,
        ];
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for (k, e) in cases.into_iter().enumerate() {
            let f = g.function("f", Dims { x: 2, u: 0, p: 0 }, &[e]).unwrap();
            let mut work = vec![0.0; 2 * f.work_len()];
            for _ in 0..300 {
                let size = [0.0, 1e-9, 0.1, 5.0][(random() * 4.0) as usize];
                let low = [10.0 * random() - 5.0, 10.0 * random() - 5.0];
                let high = [low[0] + size * random(), low[1] + size * random()];
                let (mut a, mut b) = ([0.0], [0.0]);
                assert!(f.bounds(&at(&low), &at(&high), &mut a, &mut b, &mut work));
                for _ in 0..20 {
                    let z = [0, 1].map(|i: usize| (low[i] + random() * (high[i] - low[i])).clamp(low[i], high[i]));
                    let mut v = [0.0];
                    f.value(&at(&z), &mut v, &mut work).unwrap();
                    assert!(a[0] <= v[0] && v[0] <= b[0], "case {k}: {v:?} outside of {a:?} {b:?} at {z:?}");
                }
                if size <= 1e-9 && k < 7 {
                    assert!(b[0] - a[0] < 1e-6, "case {k}: {a:?} {b:?} at {low:?}");
                }
            }
        }
    }
}
