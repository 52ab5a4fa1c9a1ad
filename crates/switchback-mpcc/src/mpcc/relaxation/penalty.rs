//! Exact penalties, section 2.4.3, with the penalty parameter `ρ = 1/σ`.

use super::{Elastic, Jet, Row, Sequence, Softness, Strategy};

/// `f + ρ Σ a b`, (2.33).
pub(super) struct L1;

impl Strategy for L1 {
    fn rows(&self) -> &'static [Row] {
        &[]
    }
    fn jet(&self, _: usize, _: f64, _: f64, _: &Softness) -> Jet {
        Jet::default()
    }
    fn weights(&self, sigma: f64) -> (f64, f64) {
        (1.0 / sigma, 0.0)
    }
    fn sequence(&self) -> Sequence {
        Sequence::Penalty
    }
}

/// `f + ρ s`, `a b ≤ s`.
pub(super) struct Linf;

impl Strategy for Linf {
    fn rows(&self) -> &'static [Row] {
        const { &[Row::AT_MOST.product().elastic()] }
    }
    fn jet(&self, _: usize, a: f64, b: f64, _: &Softness) -> Jet {
        Jet::product(a, b, 0.0, 0.0)
    }
    fn elastic(&self) -> Elastic {
        Elastic::Common
    }
    fn weights(&self, sigma: f64) -> (f64, f64) {
        (0.0, 1.0 / sigma)
    }
    fn sequence(&self) -> Sequence {
        Sequence::Penalty
    }
}

/// `f + ρ Σ s_k`, `a_k b_k ≤ s_k`.
pub(super) struct L1Elastic;

impl Strategy for L1Elastic {
    fn rows(&self) -> &'static [Row] {
        Linf.rows()
    }
    fn jet(&self, i: usize, a: f64, b: f64, q: &Softness) -> Jet {
        Linf.jet(i, a, b, q)
    }
    fn elastic(&self) -> Elastic {
        Elastic::Each
    }
    fn weights(&self, sigma: f64) -> (f64, f64) {
        Linf.weights(sigma)
    }
    fn sequence(&self) -> Sequence {
        Sequence::Penalty
    }
}

/// `f + ρ (Σ a b + s)`, ordinary rows relaxed by `s` on either side (Anitescu, SIAM J. Optim. 15, 2005).
pub(super) struct Elasticity;

impl Strategy for Elasticity {
    fn rows(&self) -> &'static [Row] {
        &[]
    }
    fn jet(&self, _: usize, _: f64, _: f64, _: &Softness) -> Jet {
        Jet::default()
    }
    fn elastic(&self) -> Elastic {
        Elastic::Common
    }
    fn relaxes_rows(&self) -> bool {
        true
    }
    fn weights(&self, sigma: f64) -> (f64, f64) {
        (1.0 / sigma, 1.0 / sigma)
    }
    fn sequence(&self) -> Sequence {
        Sequence::Penalty
    }
}
