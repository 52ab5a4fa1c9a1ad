//! Smoothed C-functions equal to zero (Facchinei, Jiang and Qi, Math. Program. 85, 1999). All are smoothed so that
//! their zeros are `a b = σ`, `a, b > 0`.

use super::{Jet, Row, Softness, Strategy};

/// `a + b − √(a² + b² + 2σ)`.
fn fischer_burmeister(a: f64, b: f64, sigma: f64) -> Jet {
    let r = (a * a + b * b + 2.0 * sigma).sqrt();
    let s = a + b;
    // the difference cancels near the curve, the quotient does not
    let v = if s > 0.0 { 2.0 * (a * b - sigma) / (s + r) } else { s - r };
    let r3 = r * r * r;
    Jet { v, d: (1.0 - a / r, 1.0 - b / r), dd: (-(b * b + 2.0 * sigma) / r3, a * b / r3, -(a * a + 2.0 * sigma) / r3) }
}

/// Function of Fischer and Burmeister.
pub(super) struct FischerBurmeister;

impl Strategy for FischerBurmeister {
    fn rows(&self) -> &'static [Row] {
        &[Row::EQUAL]
    }
    fn jet(&self, _: usize, a: f64, b: f64, q: &Softness) -> Jet {
        fischer_burmeister(a, b, q.sigma)
    }
    fn curved(&self) -> bool {
        true
    }
}

/// Natural residual: `min(a, b)` smoothed, `½ (a + b − √((a − b)² + 4σ))`.
pub(super) struct NaturalResidual;

impl Strategy for NaturalResidual {
    fn rows(&self) -> &'static [Row] {
        &[Row::EQUAL]
    }
    fn jet(&self, _: usize, a: f64, b: f64, q: &Softness) -> Jet {
        let w = a - b;
        let r = (w * w + 4.0 * q.sigma).sqrt();
        let s = a + b;
        let v = if s > 0.0 { 2.0 * (a * b - q.sigma) / (s + r) } else { 0.5 * (s - r) };
        let (d, dd) = (0.5 * w / r, 2.0 * q.sigma / (r * r * r));
        Jet { v, d: (0.5 - d, 0.5 + d), dd: (-dd, dd, -dd) }
    }
    fn curved(&self) -> bool {
        true
    }
}

/// Half that of Fischer and Burmeister, half the product (Chen, Chen and Kanzow, Math. Program. 88, 2000).
pub(super) struct ChenChenKanzow;

impl Strategy for ChenChenKanzow {
    fn rows(&self) -> &'static [Row] {
        &[Row::EQUAL]
    }
    fn jet(&self, _: usize, a: f64, b: f64, q: &Softness) -> Jet {
        const LAMBDA: f64 = 0.5;
        let (f, p) = (fischer_burmeister(a, b, q.sigma), Jet::product(a, b, 0.0, q.sigma));
        let mix = |f: f64, p: f64| LAMBDA * f + (1.0 - LAMBDA) * p;
        Jet {
            v: mix(f.v, p.v),
            d: (mix(f.d.0, p.d.0), mix(f.d.1, p.d.1)),
            dd: (mix(f.dd.0, p.dd.0), mix(f.dd.1, p.dd.1), mix(f.dd.2, p.dd.2)),
        }
    }
    fn curved(&self) -> bool {
        true
    }
}
