//! Double-double arithmetic: unevaluated sums of two numbers, about 31 digits. Elementary functions by series.
#![allow(dead_code)]

use std::ops::{Add, Div, Mul, Neg, Sub};

/// `hi + lo` with `|lo| ≤ ulp(hi)/2`.
#[derive(Debug, Clone, Copy)]
pub struct Dd {
    hi: f64,
    lo: f64,
}

fn two_sum(a: f64, b: f64) -> Dd {
    let s = a + b;
    let v = s - a;
    Dd { hi: s, lo: (a - (s - v)) + (b - v) }
}

fn two_product(a: f64, b: f64) -> Dd {
    let p = a * b;
    Dd { hi: p, lo: a.mul_add(b, -p) }
}

impl From<f64> for Dd {
    fn from(v: f64) -> Dd {
        Dd { hi: v, lo: 0.0 }
    }
}

impl Add for Dd {
    type Output = Dd;
    fn add(self, o: Dd) -> Dd {
        let (s, t) = (two_sum(self.hi, o.hi), two_sum(self.lo, o.lo));
        let u = two_sum(s.hi, s.lo + t.hi);
        two_sum(u.hi, u.lo + t.lo)
    }
}

impl Neg for Dd {
    type Output = Dd;
    fn neg(self) -> Dd {
        Dd { hi: -self.hi, lo: -self.lo }
    }
}

impl Sub for Dd {
    type Output = Dd;
    fn sub(self, o: Dd) -> Dd {
        self + -o
    }
}

impl Mul for Dd {
    type Output = Dd;
    fn mul(self, o: Dd) -> Dd {
        let p = two_product(self.hi, o.hi);
        two_sum(p.hi, p.lo + (self.hi * o.lo + self.lo * o.hi))
    }
}

impl Div for Dd {
    type Output = Dd;
    fn div(self, o: Dd) -> Dd {
        let q = Dd::from(self.hi / o.hi);
        let r = self - q * o;
        let q = q + Dd::from(r.hi / o.hi);
        let r = self - q * o;
        q + Dd::from(r.hi / o.hi)
    }
}

impl Dd {
    pub const ZERO: Dd = Dd { hi: 0.0, lo: 0.0 };
    pub const ONE: Dd = Dd { hi: 1.0, lo: 0.0 };
    pub const PI: Dd = Dd { hi: std::f64::consts::PI, lo: 1.224_646_799_147_353_2e-16 };
    pub const PI_2: Dd = Dd { hi: std::f64::consts::FRAC_PI_2, lo: 6.123_233_995_736_766e-17 };

    pub fn hi(self) -> f64 {
        self.hi
    }

    fn small(self, beside: Dd) -> bool {
        self.hi.abs() <= 1e-34 * beside.hi.abs()
    }

    pub fn sqrt(self) -> Dd {
        let s = Dd::from(self.hi.sqrt());
        let half = Dd::from(0.5);
        let s = half * (s + self / s);
        half * (s + self / s)
    }

    /// Series of `e^(a/256)`, squared eight times.
    pub fn exp(self) -> Dd {
        let a = self * Dd::from(1.0 / 256.0);
        let (mut term, mut sum, mut n) = (Dd::ONE, Dd::ONE, 1.0);
        while !term.small(sum) && n < 60.0 {
            term = term * a / Dd::from(n);
            sum = sum + term;
            n += 1.0;
        }
        (0..8).fold(sum, |s, _| s * s)
    }

    /// Newton's method on the exponential.
    pub fn ln(self) -> Dd {
        let mut y = Dd::from(self.hi.ln());
        for _ in 0..3 {
            y = y + self * (-y).exp() - Dd::ONE;
        }
        y
    }

    fn sin_cos(self) -> (Dd, Dd) {
        // Away from large arguments by whole quarter turns.
        let k = (self.hi / std::f64::consts::FRAC_PI_2).round();
        let a = self - Dd::from(k) * Dd::PI_2;
        let square = -(a * a);
        let series = |first: Dd, start: f64| {
            let (mut term, mut sum, mut n) = (first, first, start);
            while !term.small(sum) && n < 80.0 {
                term = term * square / Dd::from(n * (n + 1.0));
                sum = sum + term;
                n += 2.0;
            }
            sum
        };
        let (s, c) = (series(a, 2.0), series(Dd::ONE, 1.0));
        match (k as i64).rem_euclid(4) {
            0 => (s, c),
            1 => (c, -s),
            2 => (-s, -c),
            _ => (-c, s),
        }
    }

    pub fn sin(self) -> Dd {
        self.sin_cos().0
    }

    pub fn cos(self) -> Dd {
        self.sin_cos().1
    }

    /// `tan(a − y)` is the error up to third order.
    pub fn atan(self) -> Dd {
        let mut y = Dd::from(self.hi.atan());
        for _ in 0..3 {
            let (s, c) = y.sin_cos();
            y = y + (self * c - s) / (c + self * s);
        }
        y
    }

    /// Series of positive terms.
    pub fn erf(self) -> Dd {
        let y = Dd::from(2.0) * self * self;
        let (mut term, mut sum, mut n) = (Dd::ONE, Dd::ONE, 3.0);
        while !term.small(sum) && n < 1000.0 {
            term = term * y / Dd::from(n);
            sum = sum + term;
            n += 2.0;
        }
        Dd::from(2.0) / Dd::PI.sqrt() * self * sum * (-(self * self)).exp()
    }
}
