//! Numbers without rounding: what is concluded from the coefficients of a model is concluded from exactly these.
//!
//! Every finite `f64` is an integer times a power of two, so sums and products of coefficients are rational numbers
//! that can be held exactly.

use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};

/// Numerators and denominators with more binary digits than this are not computed with: eight numbers of the full
/// range of `f64` multiplied fit into it, and arithmetic stays fast.
const MAX_BITS: u64 = 1 << 15;

/// The number itself; none for NaN and infinities.
pub(crate) fn exact(v: f64) -> Option<BigRational> {
    BigRational::from_float(v)
}

/// Is the number too long to compute with?
pub(super) fn is_long(q: &BigRational) -> bool {
    q.numer().bits().max(q.denom().bits()) > MAX_BITS
}

/// `q 2^shift`, rounded; zero or infinite beyond the range of `f64`.
pub(crate) fn shifted_f64(q: &BigRational, shift: i64) -> f64 {
    let places = shift.unsigned_abs() as usize;
    let moved = if shift >= 0 {
        BigRational::new_raw(q.numer() << places, q.denom().clone())
    } else {
        BigRational::new_raw(q.numer().clone(), q.denom() << places)
    };
    moved.to_f64().unwrap_or(0.0)
}

/// `⌊log2 |q|⌋` or one more; zero has none.
pub(crate) fn magnitude(q: &BigRational) -> Option<i64> {
    (!q.is_zero()).then(|| q.numer().bits() as i64 - q.denom().bits() as i64)
}

/// The number as nearest multiple of a power of two with 53 binary digits, as `f64` has them, without limits on the
/// power: `(digits, power)`.
pub(super) fn rounded(q: &BigRational) -> (i64, i64) {
    let Some(size) = magnitude(q) else { return (0, 0) };
    // a quotient of 54 to 56 digits, and whether something is left
    let shift = 55 - size;
    let (mut n, mut d) = (q.numer().abs(), q.denom().clone());
    if shift >= 0 {
        n <<= shift as usize;
    } else {
        d <<= (-shift) as usize;
    }
    let digits = &n / &d;
    let mut left = digits.clone() * &d != n;
    let (mut k, mut power) = (digits.to_u64().unwrap_or(0), -shift);
    while k >= 1 << 54 {
        left |= k & 1 == 1;
        (k, power) = (k >> 1, power + 1);
    }
    // 54 digits: the last one decides, to even where nothing is left
    let up = k & 1 == 1 && (left || k & 2 == 2);
    (k, power) = ((k >> 1) + u64::from(up), power + 1);
    if k == 1 << 53 {
        (k, power) = (1 << 52, power + 1);
    }
    (if q.is_negative() { -(k as i64) } else { k as i64 }, power)
}

/// A rational number of small integers.
#[cfg(test)]
pub(crate) fn ratio(n: i64, d: i64) -> BigRational {
    BigRational::new(n.into(), d.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_that_of_f64() {
        let mut seed = 5u64;
        let mut next = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 1) as i64 - (1 << 62)
        };
        for _ in 0..2000 {
            let (n, d) = (next(), next() >> (next() & 31));
            let q = ratio(n, if d == 0 { 1 } else { d });
            let (k, power) = rounded(&q);
            let v = q.to_f64().unwrap();
            assert_eq!(k as f64 * 2f64.powi(power as i32), v, "{q}");
        }
        for v in [1.0, -3.0, 0.1, 1e300, -1e-300, f64::MAX, f64::MIN_POSITIVE] {
            let (k, power) = rounded(&exact(v).unwrap());
            assert_eq!(shifted_f64(&BigRational::from_integer(k.into()), power), v);
        }
        // beyond the range of f64 numbers stay apart
        let tiny = exact(1e-300).unwrap();
        let a = &tiny * &tiny;
        assert_ne!(rounded(&a), rounded(&(&a * &tiny)));
        assert_eq!(rounded(&ratio(0, 1)), (0, 0));
    }
}
