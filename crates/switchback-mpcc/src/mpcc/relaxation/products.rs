//! Relaxations by products of the members.

use super::{Jet, Row, Seen, Sequence, SigmaIn, Softness, Strategy};

/// `a b ≤ σ` (Scholtes, SIAM J. Optim. 11, 2001).
pub(super) struct Scholtes;

impl Strategy for Scholtes {
    fn rows(&self) -> &'static [Row] {
        const { &[Row::AT_MOST.product()] }
    }
    fn jet(&self, _: usize, a: f64, b: f64, _: &Softness) -> Jet {
        Jet::product(a, b, 0.0, 0.0)
    }
    fn sigma_in(&self) -> SigmaIn {
        SigmaIn::Bound
    }
}

/// `a b = σ`.
pub(super) struct Equal;

impl Strategy for Equal {
    fn rows(&self) -> &'static [Row] {
        const { &[Row::EQUAL.product()] }
    }
    fn jet(&self, _: usize, a: f64, b: f64, q: &Softness) -> Jet {
        Jet::product(a, b, 0.0, q.sigma)
    }
}

/// `Σ a b ≤ σ`.
pub(super) struct Lumped;

impl Strategy for Lumped {
    fn rows(&self) -> &'static [Row] {
        Scholtes.rows()
    }
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet {
        Scholtes.jet(i, a, b, q)
    }
    fn sigma_in(&self) -> SigmaIn {
        SigmaIn::Bound
    }
    fn lumped(&self) -> bool {
        true
    }
}

/// `a b ≤ t²`, `(a + t)(b + t) ≥ t²` with `t = √σ` (Lin and Fukushima, Ann. Oper. Res. 133, 2005). The last row,
/// `a + b ≥ −t`, never binds where these hold; it cuts off the second branch of the hyperbola.
pub(super) struct LinFukushima;

impl Strategy for LinFukushima {
    fn rows(&self) -> &'static [Row] {
        const { &[Row::AT_MOST.product(), Row::AT_LEAST.product(), Row::AT_LEAST] }
    }
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet {
        match i {
            0 => Jet::product(a, b, 0.0, q.sigma),
            // without the difference of two squares, which cancels
            1 => Jet { v: a * b + q.root * (a + b), ..Jet::product(a, b, q.root, 0.0) },
            _ => Jet::linear(a, b, (1.0, 1.0), q.root),
        }
    }
    fn lower(&self, sigma: f64) -> f64 {
        -sigma.sqrt()
    }
}

/// `a ≥ −δ_1`, `b ≥ −δ_2`, `a b ≤ δ_3` (DeMiguel, Friedlander, Nogales and Scholtes, SIAM J. Optim. 16, 2005), with
/// parameters that fall where the multipliers say which of the three has to be strict. At a new `σ` a multiplier counts
/// as positive or negative above `σ^0.7`; pairs of which both members are that large get a smaller `δ_3` as well.
pub(super) struct TwoSided;

impl TwoSided {
    const TAU: f64 = 0.3;
    const KAPPA: f64 = 0.1;
}

impl Strategy for TwoSided {
    fn rows(&self) -> &'static [Row] {
        const { &[Row::AT_MOST.product(), Row::AT_LEAST, Row::AT_LEAST] }
    }
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet {
        match i {
            0 => Jet::product(a, b, 0.0, q.own[2]),
            1 => Jet::linear(a, b, (1.0, 0.0), q.own[0]),
            _ => Jet::linear(a, b, (0.0, 1.0), q.own[1]),
        }
    }
    fn lower(&self, sigma: f64) -> f64 {
        -sigma.sqrt()
    }
    fn open(&self, sigma: f64) -> Option<[f64; 3]> {
        let t = 0.1 * sigma.sqrt();
        Some([t, t, sigma])
    }
    fn adapt(&self, sigma: f64, seen: &Seen, own: &mut [f64; 3]) {
        let threshold = sigma.powf(1.0 - Self::TAU);
        let strict = |v: &mut f64| *v = (Self::KAPPA * *v).min(sigma.powf(1.0 + Self::TAU));
        let (nu, x) = (seen.nu, seen.x);
        if nu.0.min(nu.1) < -threshold || x.0.min(x.1) > threshold {
            strict(&mut own[2]);
            return;
        }
        if nu.0 > threshold {
            strict(&mut own[0]);
        }
        if nu.1 > threshold {
            strict(&mut own[1]);
        }
    }
}

/// `a b ≤ χ μ`: `χ = 1` is the best of those Raghunathan and Biegler tried (SIAM J. Optim. 15, 2005), `χ = 0` leaves the
/// pairs as they are (Fletcher and Leyffer, Optim. Methods Softw. 19, 2004).
pub(super) struct Proportional(pub f64);

impl Strategy for Proportional {
    fn rows(&self) -> &'static [Row] {
        Scholtes.rows()
    }
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet {
        Scholtes.jet(i, a, b, q)
    }
    fn sigma_in(&self) -> SigmaIn {
        if self.0 > 0.0 {
            SigmaIn::Bound
        } else {
            SigmaIn::None
        }
    }
    fn sequence(&self) -> Sequence {
        Sequence::Barrier(self.0)
    }
}
