//! Second-order conditions at the answer, and for programs without pairs those of first order.
//!
//! Of a strongly stationary point of a program with pairs they are those of the relaxed program (2.24), whose feasible points
//! include all near by: a strict local minimum of it is one of the program. At pairs with one positive member the other one is
//! zero near by, and counts as an equation; where both are zero, they are equations with positive multipliers.

use super::certificate::{BStationarity, Stationarity, HIDDEN};
use super::problem::{Mpcc, Side};
use super::relaxed::Relaxed;
use super::solver::{MpccSolver, Warm};
use crate::nlp::{Bounds, FirstOrder, Outcome, SecondOrder, INFINITE};
use crate::stop;

/// Distance from a bound, relative to it and to the unit of the solver, at which it is active; the answer is exact, or that of a
/// barrier method with a parameter of 1e-9.
const ACTIVE: f64 = 1e-7;
/// Multiplier, relative to the largest entry of the gradient or to its usual size, that is one.
const SIGN: f64 = 1e-7;
/// Product of a distance and a multiplier, relative to the same, that a barrier method leaves, and how many times the multiplier is
/// larger than the distance where the bound is active.
const PRODUCT: f64 = 1e-8;
const CLEAR: f64 = 100.0;
/// What multipliers may leave over of the gradient, relative to the largest of its entries and to its usual size.
const STATIONARY: f64 = 1e-6;
/// Distance, in units of the solver, whose gain to first order is compared with what violations hide.
const NEARBY: f64 = 1e-2;
/// Factorisations a verdict may take: along two sets of equations, for dependent ones, for a direction of negative curvature.
const FACTORISATIONS: f64 = 7.0;

/// How a constraint takes part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Held {
    No,
    /// Active, without a multiplier.
    Weakly,
    Strongly,
}

/// How large the gradient is.
struct Scale {
    size: f64,
}

impl Scale {
    /// Multipliers up to here are none.
    fn sign(&self) -> f64 {
        SIGN * self.size
    }

    /// Do the multipliers show that the point is stationary? Where they are so large that rounding, or violations of rows that count as
    /// none, times them come near the gradient they show nothing.
    fn holds(&self, first: &FirstOrder) -> bool {
        let tol = STATIONARY * self.size;
        first.left <= tol && first.rounding <= tol && first.hidden <= HIDDEN * self.size * NEARBY
    }

    /// How the bounds hold `v`, with the multiplier `z`, lower minus upper. `None` where that multiplier has no bound.
    fn held(&self, v: f64, lo: f64, hi: f64, z: f64) -> Option<Held> {
        let distance =
            |bound: f64| if bound.abs() < INFINITE { (v - bound).abs() / bound.abs().max(1.0) } else { INFINITE };
        let (below, above) = (distance(lo), distance(hi));
        if z.abs() <= self.sign() {
            return Some(if below.min(above) <= ACTIVE { Held::Weakly } else { Held::No });
        }
        let (gap, z) = (if z > 0.0 { below } else { above }, z.abs() / self.size);
        if gap <= ACTIVE || (gap * z <= PRODUCT && z > CLEAR * gap) {
            Some(Held::Strongly)
        } else if gap * z > PRODUCT {
            None
        } else if gap > CLEAR * z {
            Some(Held::No)
        } else {
            Some(Held::Weakly)
        }
    }
}

/// The same value twice where a constraint is an equation, nothing where it is absent.
fn equation(on: bool, v: f64) -> (f64, f64) {
    if on {
        (v, v)
    } else {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
}

impl MpccSolver {
    /// Completes the certificate of the recorded answer by its curvature, as far as that is a small part of the work of the solve.
    pub(super) fn certify_curvature(&mut self, p: &mut dyn Mpcc, bounds: &Bounds) {
        let pure = p.pairs().is_empty();
        let s = &self.solution;
        let exact = s.outcome == Outcome::Solved && (pure || s.certificate.stationarity == Stationarity::S);
        let asked = self.settings.certify && exact && (pure || self.policy.free_pairs);
        if !asked || stop::requested().is_some() || !self.affords(FACTORISATIONS) {
            return;
        }
        let (x, y, z) = (
            std::mem::take(&mut self.solution.x),
            std::mem::take(&mut self.solution.y),
            std::mem::take(&mut self.solution.z),
        );
        p.set_polishing(true);
        self.load(p, &Warm { x: &x, y: &y, z: &z });
        (self.solution.x, self.solution.y, self.solution.z) = (x, y, z);
        self.branch.copy_from(bounds);
        if !pure {
            self.sides.copy_from_slice(&self.solution.sides);
            p.branch(&self.sides, &mut self.branch);
        }
        if self.ipm.look_at(&mut Relaxed { inner: p, st: &mut self.st }, &self.saved) {
            self.st.bounds(&self.branch, f64::INFINITY, &mut self.bounds);
            self.judge_curvature(p, pure);
        }
        p.set_polishing(false);
    }

    fn judge_curvature(&mut self, p: &dyn Mpcc, pure: bool) {
        let first = self.ipm.first_order(&self.bounds);
        // where the gradient vanishes it is compared with what it usually is
        let size = first.gradient.max(self.st.scaling.steepness());
        let scale = Scale { size };
        let Some(weak) = self.count_weak(&scale) else { return };
        if !scale.holds(&first) {
            return;
        }
        let both = p.pairs().iter().enumerate().filter(|(k, pair)| self.is_weak_pair(p, *k, **pair, &scale)).count();
        let cert = &mut self.solution.certificate;
        if pure {
            (cert.stationarity, cert.b, cert.sharp) = (Stationarity::S, BStationarity::Yes, true);
        }
        cert.second = SecondOrder::Undecided;
        if both == 0 {
            self.equations(&scale, false);
            if self.ipm.is_convex_along(&self.bounds) {
                self.solution.certificate.second = SecondOrder::StrictMinimum;
            }
        }
        if weak > 0 || both > 0 {
            self.st.bounds(&self.branch, f64::INFINITY, &mut self.bounds);
            self.equations(&scale, true);
        }
        self.solution.certificate.dependent = self.ipm.dependent(&self.bounds);
        let cert = &mut self.solution.certificate;
        if cert.second == SecondOrder::Undecided && cert.dependent == 0 && self.ipm.is_concave_along(&self.bounds) {
            cert.second = SecondOrder::Saddle;
        }
    }

    /// Bounds and rows that are active without a multiplier; `None` where a multiplier has no active bound.
    fn count_weak(&self, scale: &Scale) -> Option<usize> {
        let (it, b, mut weak) = (&self.saved, &self.bounds, 0);
        for j in (0..it.x.len()).filter(|&j| b.xl[j] < b.xu[j]) {
            weak += usize::from(scale.held(it.x[j], b.xl[j], b.xu[j], it.zl[j] - it.zu[j])? == Held::Weakly);
        }
        for i in (0..it.s.len()).filter(|&i| b.cl[i] < b.cu[i]) {
            weak += usize::from(scale.held(it.s[i], b.cl[i], b.cu[i], -it.y[i])? == Held::Weakly);
        }
        Some(weak)
    }

    /// Are both members of pair `k` zero, that which its branch fixes without a multiplier?
    fn is_weak_pair(&self, p: &dyn Mpcc, k: usize, (a, b): (usize, usize), scale: &Scale) -> bool {
        let it = &self.saved;
        let fixed = if self.sides[p.group(k)] == Side::First { a } else { b };
        it.x[a].max(it.x[b]) <= ACTIVE && it.zl[fixed] - it.zu[fixed] <= scale.sign()
    }

    /// Writes `bounds` in which active constraints are equations, those without a multiplier if they are asked for, and others absent.
    fn equations(&mut self, scale: &Scale, weak: bool) {
        let (it, b) = (&self.saved, &mut self.bounds);
        let counts = |held: Option<Held>| held == Some(Held::Strongly) || (weak && held == Some(Held::Weakly));
        for j in 0..it.x.len() {
            if b.xl[j] < b.xu[j] {
                let on = counts(scale.held(it.x[j], b.xl[j], b.xu[j], it.zl[j] - it.zu[j]));
                (b.xl[j], b.xu[j]) = equation(on, it.x[j]);
            }
        }
        for i in 0..it.s.len() {
            if b.cl[i] < b.cu[i] {
                let on = counts(scale.held(it.s[i], b.cl[i], b.cu[i], -it.y[i]));
                (b.cl[i], b.cu[i]) = equation(on, it.s[i]);
            }
        }
    }
}
