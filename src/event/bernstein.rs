//! Zeros of polynomials on `[0, 1]` in Bernstein form: without a sign change among the coefficients there is none.

use nalgebra::DMatrix;

use super::step::Poly;

/// Samples per step.
pub(super) const NODES: usize = 9;
/// Bernstein coefficients of a polynomial of degree `NODES − 1`, or one less with the last entry unused.
pub(super) type Coefficients = [f64; NODES];

/// What a polynomial that is positive at 0 does first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum First {
    /// Nothing: it stays positive.
    None,
    /// It changes its sign here.
    Zero(f64),
    /// It touches zero here, to rounding.
    Touch(f64),
}

/// Samples at fixed nodes to Bernstein coefficients.
pub(super) struct Sampler {
    /// Chebyshev points of the second kind, 0 and 1 included.
    pub(super) nodes: [f64; NODES],
    full: Vec<f64>,
    /// For samples divided by a power of the time, without the first node.
    deflated: Vec<f64>,
}

impl Sampler {
    pub(super) fn new() -> Sampler {
        let mut nodes = [0.0; NODES];
        for (i, n) in nodes.iter_mut().enumerate() {
            *n = 0.5 * (1.0 - (std::f64::consts::PI * i as f64 / (NODES - 1) as f64).cos());
        }
        nodes[NODES - 1] = 1.0;
        Sampler { nodes, full: inverse(&nodes), deflated: inverse(&nodes[1..]) }
    }

    /// Coefficients of the polynomial through the samples, and its degree. With `power > 0` the samples vanish at 0
    /// like this power of the time, and the polynomial is what is left when it is divided out.
    pub(super) fn coefficients(&self, samples: &Coefficients, power: usize) -> (Coefficients, usize) {
        let mut out = [0.0; NODES];
        if power == 0 {
            for (o, row) in out.iter_mut().zip(self.full.chunks_exact(NODES)) {
                *o = row.iter().zip(samples).map(|(a, b)| a * b).sum();
            }
            // the ends are known exactly
            out[0] = samples[0];
            out[NODES - 1] = samples[NODES - 1];
            return (out, NODES - 1);
        }
        let n = NODES - 1;
        for (o, row) in out.iter_mut().zip(self.deflated.chunks_exact(n)) {
            *o = (0..n).map(|i| row[i] * samples[i + 1] / self.nodes[i + 1].powi(power as i32)).sum();
        }
        (out, n - 1)
    }
}

/// Bernstein coefficients of a polynomial that is given by those of its powers, up to `degree`: `b_j = Σ_k C(j, k) / C(n, k) c_k`.
pub(super) fn of_powers(c: &Poly, degree: usize) -> Coefficients {
    let mut out = [0.0; NODES];
    // divided by C(n, k), the coefficients are the differences at 0, which are summed up order by order
    let mut binomial = 1.0;
    for (k, o) in out[..=degree].iter_mut().enumerate() {
        *o = c[k] / binomial;
        binomial *= (degree - k) as f64 / (k + 1) as f64;
    }
    for m in 1..=degree {
        for j in (m..=degree).rev() {
            out[j] += out[j - 1];
        }
    }
    out
}

/// Inverse of the matrix of Bernstein polynomials at the nodes, row-major.
fn inverse(nodes: &[f64]) -> Vec<f64> {
    let d = nodes.len() - 1;
    let m = DMatrix::from_fn(d + 1, d + 1, |i, j| {
        let mut b = [0.0; NODES];
        b[j] = 1.0;
        value(&b[..=d], nodes[i])
    });
    // the nodes are distinct
    let inv = m.try_inverse().unwrap_or_else(|| DMatrix::zeros(d + 1, d + 1));
    inv.transpose().as_slice().to_vec()
}

/// De Casteljau.
#[inline]
pub(super) fn value(b: &[f64], s: f64) -> f64 {
    let mut c = [0.0; NODES];
    c[..b.len()].copy_from_slice(b);
    // lengths that are known when this is compiled
    match b.len() {
        NODES => reduce(&mut c, s),
        5 => reduce(&mut c[..5], s),
        n => reduce(&mut c[..n], s),
    }
}

#[inline(always)]
fn reduce(c: &mut [f64], s: f64) -> f64 {
    reduce_to(c, s, 1);
    c[0]
}

/// Steps of de Casteljau until `left` coefficients are left.
#[inline(always)]
fn reduce_to(c: &mut [f64], s: f64, left: usize) {
    for m in (left..c.len()).rev() {
        for i in 0..m {
            c[i] += s * (c[i + 1] - c[i]);
        }
    }
}

/// Value and derivative: the two coefficients before the last step are the derivative's.
fn value_and_slope(b: &[f64], s: f64) -> (f64, f64) {
    let mut c = [0.0; NODES];
    let n = b.len();
    if n < 2 {
        return (b[0], 0.0);
    }
    c[..n].copy_from_slice(b);
    match n {
        NODES => reduce_to(&mut c, s, 2),
        5 => reduce_to(&mut c[..5], s, 2),
        n => reduce_to(&mut c[..n], s, 2),
    }
    let d = c[1] - c[0];
    (c[0] + s * d, (n - 1) as f64 * d)
}

/// Derivative.
pub(super) fn slope(b: &[f64], s: f64) -> f64 {
    let d = b.len() - 1;
    let mut c = [0.0; NODES];
    for i in 0..d {
        c[i] = (b[i + 1] - b[i]) * d as f64;
    }
    value(&c[..d], s)
}

/// First change of sign from plus to minus on `(0, 1]`. Every one is found, however close to the next: where the
/// coefficients do not decide, the interval is divided, down to `1e-9`; what is closer counts as touching.
pub(super) fn first(b: &[f64]) -> First {
    if b[0] <= 0.0 {
        return First::Zero(0.0);
    }
    match changes(b) {
        0 => First::None,
        1 => First::Zero(zero(b)),
        _ => first_of_several(b),
    }
}

/// What rounding of samples may lift a polynomial by, relative to its largest coefficient, and that of coefficients which are known.
pub(super) const ROUNDING_OF_SAMPLES: f64 = 1e-13;
pub(super) const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Where a polynomial that stays positive comes so near to zero that only `rounding` tells it from one that touches.
pub(super) fn nearly_touches(b: &[f64], rounding: f64) -> Option<f64> {
    let largest = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut lowered = [0.0; NODES];
    let lowered = &mut lowered[..b.len()];
    lowered.iter_mut().zip(b).for_each(|(l, v)| *l = v - rounding * largest);
    match first(lowered) {
        First::None => None,
        First::Zero(s) | First::Touch(s) => Some(s),
    }
}

/// Where a polynomial that stays positive comes below `level`, if it turns there and does not go on falling behind the end.
pub(super) fn turns_below(b: &[f64], level: f64) -> Option<f64> {
    let n = b.len();
    let (falls, rises) = (b[1] <= b[0], b[n - 1] > b[n - 2]);
    if b[0] <= level && !falls || b[n - 1] <= level && !rises {
        return None;
    }
    let mut lowered = [0.0; NODES];
    let lowered = &mut lowered[..n];
    lowered.iter_mut().zip(b).for_each(|(l, v)| *l = v - level);
    match first(lowered) {
        First::None => None,
        First::Zero(s) | First::Touch(s) => Some(s),
    }
}

/// Does a polynomial that passes zero turn at no less than `−level`?
pub(super) fn dips(b: &[f64], level: f64) -> bool {
    let n = b.len();
    let mut lifted = [0.0; NODES];
    let lifted = &mut lifted[..n];
    lifted.iter_mut().zip(b).for_each(|(l, v)| *l = v + level);
    first(lifted) == First::None && (b[n - 1] > 0.0 || b[n - 1] > b[n - 2])
}

/// Changes of sign from one coefficient to the next: at least as many as there are zeros.
fn changes(c: &[f64]) -> usize {
    c.windows(2).filter(|w| (w[0] > 0.0) != (w[1] > 0.0)).count()
}

#[inline(never)]
fn first_of_several(b: &[f64]) -> First {
    const DEPTH: usize = 30;
    let n = b.len();
    let mut stack = [([0.0; NODES], 0.0, 0.0); DEPTH + 2];
    stack[0].0[..n].copy_from_slice(b);
    stack[0].2 = 1.0;
    let mut top = 1;
    let mut touch = First::None;
    while top > 0 {
        top -= 1;
        let (c, lo, hi) = stack[top];
        let c = &c[..n];
        if c.iter().all(|v| *v > 0.0) {
            continue;
        }
        if c[0] <= 0.0 {
            return First::Zero(lo);
        }
        if changes(c) == 1 {
            return First::Zero(lo + (hi - lo) * zero(c));
        }
        if top + 2 > DEPTH || hi - lo < 1e-9 {
            if touch == First::None {
                touch = First::Touch(0.5 * (lo + hi));
            }
            continue;
        }
        let (mut left, mut right) = ([0.0; NODES], [0.0; NODES]);
        right[..n].copy_from_slice(c);
        for i in 0..n {
            left[i] = right[0];
            for j in 0..n - 1 - i {
                right[j] = 0.5 * (right[j] + right[j + 1]);
            }
        }
        // what is left of the triangle is the right half
        let mid = 0.5 * (lo + hi);
        stack[top] = (right, mid, hi);
        stack[top + 1] = (left, lo, mid);
        top += 2;
    }
    touch
}

/// The zero of a polynomial with one change of sign, by Newton steps that stay in a bracket.
fn zero(b: &[f64]) -> f64 {
    let (mut lo, mut hi) = (0.0, 1.0);
    let (first, last) = (b[0], b[b.len() - 1]);
    // a last coefficient that is rounding must not be taken for the zero
    let mut s = (first / (first - last)).clamp(0.1, 0.9);
    for _ in 0..60 {
        let (v, dv) = value_and_slope(b, s);
        if v > 0.0 {
            lo = s;
        } else {
            hi = s;
        }
        let newton = s - v / dv;
        // the step that ends there is located again by its own value
        if (newton - s).abs() <= 1e-12 || hi - lo <= 1e-14 {
            return newton.clamp(lo, hi);
        }
        let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
        s = next;
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(f: impl Fn(f64) -> f64, power: usize) -> (Coefficients, usize) {
        let s = Sampler::new();
        let mut v = [0.0; NODES];
        for (v, t) in v.iter_mut().zip(&s.nodes) {
            *v = f(*t);
        }
        s.coefficients(&v, power)
    }

    fn first_of(f: impl Fn(f64) -> f64, power: usize) -> Option<f64> {
        let (c, d) = of(f, power);
        match first(&c[..=d]) {
            First::Zero(s) => Some(s),
            First::None | First::Touch(_) => None,
        }
    }

    #[test]
    fn double_crossings_are_found_however_narrow() {
        for (at, width) in [(0.3, 1e-2), (0.71, 1e-4), (0.999, 1e-6), (0.02, 1e-5)] {
            let s = first_of(|t| (t - at) * (t - at) * (1.0 + t) - width * width, 0).unwrap();
            let f = |t: f64| (t - at) * (t - at) * (1.0 + t) - width * width;
            assert!(f(s).abs() < 1e-10 * width + 1e-15 && s < at, "{at} {width}: {s}");
        }
        assert_eq!(first_of(|t| (t - 0.4) * (t - 0.4) + 1e-6, 0), None);
        assert_eq!(first_of(|t| 1.0 - 0.999 * t, 0), None);
    }

    #[test]
    fn rounding_does_not_hide_a_touch() {
        for at in [0.2, 0.3 + 1e-3, 0.77] {
            let (c, d) = of(|t| (t - at) * (t - at) * (1.0 + t) + 1e-16, 0);
            let near = match first(&c[..=d]) {
                First::None => nearly_touches(&c[..=d], ROUNDING_OF_SAMPLES),
                First::Zero(s) | First::Touch(s) => Some(s),
            };
            assert!(near.is_some_and(|s| (s - at).abs() < 1e-6), "{at}: {near:?}");
        }
        let (c, d) = of(|t| (t - 0.4) * (t - 0.4) + 1e-11, 0);
        assert_eq!(nearly_touches(&c[..=d], ROUNDING_OF_SAMPLES), None);
    }

    #[test]
    fn what_turns_near_zero() {
        let turns = |at: f64, least: f64, level: f64| {
            let (c, d) = of(|t| (t - at) * (t - at) * (1.0 + t) + least, 0);
            turns_below(&c[..=d], level)
        };
        let s = turns(0.4, 1e-9, 2e-9).unwrap();
        assert!((s - 0.4).abs() < 1e-4, "{s}");
        assert_eq!(turns(0.4, 3e-9, 2e-9), None);
        let dips = |least: f64, level: f64| {
            let (c, d) = of(|t| (t - 0.4) * (t - 0.4) * (1.0 + t) - least, 0);
            dips(&c[..=d], level)
        };
        assert!(dips(1e-9, 2e-9) && !dips(3e-9, 2e-9));
        // it goes on falling, or has turned before
        assert_eq!((turns(1.0 + 1e-6, 1e-9, 2e-9), turns(-1e-6, 1e-9, 2e-9)), (None, None));
    }

    #[test]
    fn values_and_slopes_at_once() {
        let (c, d) = of(|t| (t - 0.4).sin() * t.exp(), 0);
        for s in [0.0, 0.31, 0.77, 1.0] {
            let (v, dv) = value_and_slope(&c[..=d], s);
            assert!((v - value(&c[..=d], s)).abs() < 1e-14 && (dv - slope(&c[..=d], s)).abs() < 1e-13, "{s}");
        }
        assert_eq!(value_and_slope(&[2.0], 0.3), (2.0, 0.0));
    }

    #[test]
    fn powers_in_bernstein_form() {
        let c = [0.7, -1.3, 0.4, 2.1, -0.6, 0.9, -1.7, 0.35];
        for degree in 1..c.len() {
            let b = of_powers(&c, degree);
            for s in [0.0, 0.2, 0.55, 1.0] {
                let exact = c[..=degree].iter().rev().fold(0.0, |v, c| v * s + c);
                assert!((value(&b[..=degree], s) - exact).abs() < 1e-14, "{degree} {s}");
            }
        }
    }

    #[test]
    fn touching_is_said() {
        let (c, d) = of(|t| (t - 0.4) * (t - 0.4), 0);
        match first(&c[..=d]) {
            First::Touch(s) => assert!((s - 0.4).abs() < 1e-6, "{s}"),
            // rounding may cut it
            First::Zero(s) => assert!((s - 0.4).abs() < 1e-6, "{s}"),
            First::None => panic!("it is not positive"),
        }
        let (c, d) = of(|t| (t - 0.4) * (t - 0.4) + 1e-12, 0);
        assert_eq!(first(&c[..=d]), First::None);
    }

    #[test]
    fn a_newton_step_that_no_longer_moves_is_the_zero() {
        let samples = [
            0.16587468520687876,
            0.14743035092606893,
            0.09256982512870733,
            0.0037021194465282903,
            -0.11229569499325798,
            -0.24142083094197764,
            -0.3620547543078749,
            -0.44878639673029874,
            -0.4804629514613859,
        ];
        let (c, d) = Sampler::new().coefficients(&samples, 0);
        let First::Zero(s) = first(&c[..=d]) else { panic!("it changes its sign") };
        assert!(value(&c[..=d], s).abs() < 1e-12 && s > 0.3, "{s}");
    }

    #[test]
    fn the_first_of_several_zeros() {
        let s = first_of(|t| (0.2 - t) * (0.5 - t) * (0.9 - t), 0).unwrap();
        assert!((s - 0.2).abs() < 1e-11, "{s}");
        let s = first_of(|t| (0.25 - t) * (0.25 - t) * (0.5 - t), 0).unwrap();
        assert!((s - 0.25).abs() < 1e-4 || (s - 0.5).abs() < 1e-12, "{s}");
    }

    #[test]
    fn zeros_at_the_start_are_divided_out() {
        assert_eq!(first_of(|t| t * (2.0 - t), 1), None);
        let s = first_of(|t| t * t * (0.01 - t), 2).unwrap();
        assert!((s - 0.01).abs() < 1e-12, "{s}");
        assert_eq!(first_of(|t| -t * (2.0 - t), 1), Some(0.0));
        let (c, d) = of(|t| t * t * (3.0 + t), 2);
        assert!((value(&c[..=d], 0.5) - 3.5).abs() < 1e-12);
        assert!((slope(&c[..=d], 0.5) - 1.0).abs() < 1e-11);
    }
}
