//! Relaxations that change the feasible set near its corner, or by a strip along its axes. `t` is the parameter of the
//! literature.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use super::{Jet, Row, Softness, Strategy};

/// `a, b ≥ −t`, `(a − t)(b − t) ≤ 0` with `t = √σ` (Kadrani, Dussault and Benchakroun, SIAM J. Optim. 20, 2009).
pub(super) struct Kadrani;

impl Strategy for Kadrani {
    fn rows(&self) -> &'static [Row] {
        const { &[Row::AT_MOST.product(), Row::AT_LEAST, Row::AT_LEAST] }
    }
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet {
        match i {
            0 => Jet::product(a, b, -q.root, 0.0),
            1 => Jet::linear(a, b, (1.0, 0.0), q.root),
            _ => Jet::linear(a, b, (0.0, 1.0), q.root),
        }
    }
    fn lower(&self, sigma: f64) -> f64 {
        -sigma.sqrt()
    }
}

/// Functions that round the corner of the modulus on `[−1, 1]`.
#[derive(Debug, Clone, Copy)]
pub(super) enum Arc {
    /// `1 + 2/π sin(πz/2 + 3π/2)`.
    Sine,
    /// `(3 + 6z² − z⁴)/8`.
    Polynomial,
}

impl Arc {
    /// Value and two derivatives.
    fn at(self, z: f64) -> (f64, f64, f64) {
        match self {
            Arc::Sine => {
                let (s, c) = (FRAC_PI_2 * z).sin_cos();
                (1.0 - FRAC_2_PI * c, s, FRAC_PI_2 * c)
            }
            Arc::Polynomial => {
                let z2 = z * z;
                ((3.0 + (6.0 - z2) * z2) / 8.0, (3.0 - z2) * z / 2.0, 1.5 * (1.0 - z2))
            }
        }
    }
}

/// `a + b ≤ φ(a − b)`, `φ` the modulus rounded on `[−t, t]` (Steffensen and Ulbrich, SIAM J. Optim. 20, 2010), with
/// `t = 2√σ/φ_1(0)`.
pub(super) struct SteffensenUlbrich(pub Arc);

impl Strategy for SteffensenUlbrich {
    fn rows(&self) -> &'static [Row] {
        &[Row::AT_MOST]
    }
    fn jet(&self, _: usize, a: f64, b: f64, q: &Softness) -> Jet {
        let t = 2.0 * q.root / self.0.at(0.0).0;
        let w = a - b;
        let (v, d, dd) = if w.abs() >= t {
            (w.abs(), w.signum(), 0.0)
        } else {
            let (v, d, dd) = self.0.at(w / t);
            (t * v, d, dd / t)
        };
        Jet { v: a + b - v, d: (1.0 - d, 1.0 + d), dd: (-dd, dd, -dd) }
    }
    fn curved(&self) -> bool {
        true
    }
}

/// `min(a, b) ≤ t` with `t = √σ`, as a differentiable function (Kanzow and Schwartz, SIAM J. Optim. 23, 2013).
pub(super) struct KanzowSchwartz;

impl Strategy for KanzowSchwartz {
    fn rows(&self) -> &'static [Row] {
        &[Row::AT_MOST]
    }
    fn jet(&self, _: usize, a: f64, b: f64, q: &Softness) -> Jet {
        let (p, r) = (a - q.root, b - q.root);
        if p + r >= 0.0 {
            Jet::product(a, b, -q.root, 0.0)
        } else {
            Jet { v: -0.5 * (p * p + r * r), d: (-p, -r), dd: (-1.0, 0.0, -1.0) }
        }
    }
    fn curved(&self) -> bool {
        true
    }
}
