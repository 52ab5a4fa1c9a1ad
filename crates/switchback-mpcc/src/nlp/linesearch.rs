//! Step lengths, the filter line search, second-order corrections, and what is done when it finds nothing.

use std::time::Instant;

use super::filter::{alpha_min, noise, DELTA, ETA_PHI, GAMMA_PHI, GAMMA_THETA, S_PHI, S_THETA};
use super::iterate::{barrier, lagrangian_gradient, theta, Iterate, RowKind};
use super::problem::{within, Nlp};
use super::solver::Ipm;
use crate::func::EvalError;

/// What the line search came to.
pub(super) enum Search {
    Accepted,
    Jammed,
    Fatal,
}

impl Ipm {
    /// Largest primal step length that keeps the fraction `1 − τ` of the distance to every bound.
    pub(super) fn alpha_primal(&self, tau: f64, soc: bool) -> f64 {
        let (dx, ds) = if soc { (&self.dx_soc, &self.ds_soc) } else { (&self.dx, &self.ds) };
        let (b, sh, it) = (&self.bounds, &self.shape, &self.it);
        let mut a = 1f64;
        for j in 0..self.n {
            if sh.has_xl[j] {
                a = a.min(ratio(tau, it.x[j] - b.xl[j], dx[j]));
            }
            if sh.has_xu[j] {
                a = a.min(ratio(tau, b.xu[j] - it.x[j], -dx[j]));
            }
        }
        for i in 0..self.m {
            if sh.has_cl[i] {
                a = a.min(ratio(tau, it.s[i] - b.cl[i], ds[i]));
            }
            if sh.has_cu[i] {
                a = a.min(ratio(tau, b.cu[i] - it.s[i], -ds[i]));
            }
        }
        a
    }

    pub(super) fn alpha_dual(&self, tau: f64) -> f64 {
        let it = &self.it;
        let mut a = 1f64;
        for j in 0..self.n {
            a = a.min(ratio(tau, it.zl[j], self.dzl[j])).min(ratio(tau, it.zu[j], self.dzu[j]));
        }
        for i in 0..self.m {
            a = a.min(ratio(tau, it.vl[i], self.dvl[i])).min(ratio(tau, it.vu[i], self.dvu[i]));
        }
        a
    }

    /// Directional derivative of the barrier objective.
    pub(super) fn slope(&self) -> f64 {
        let mu = self.level.mu;
        let (b, sh, it) = (&self.bounds, &self.shape, &self.it);
        let mut s = 0.0;
        for j in 0..self.n {
            let mut g = self.v.grad[j];
            if sh.has_xl[j] {
                g -= mu / (it.x[j] - b.xl[j]);
            }
            if sh.has_xu[j] {
                g += mu / (b.xu[j] - it.x[j]);
            }
            s += g * self.dx[j];
        }
        for i in 0..self.m {
            if sh.has_cl[i] {
                s -= mu / (it.s[i] - b.cl[i]) * self.ds[i];
            }
            if sh.has_cu[i] {
                s += mu / (b.cu[i] - it.s[i]) * self.ds[i];
            }
        }
        s
    }

    /// Evaluates the point `alpha` along the direction; barrier objective and violation, or why not.
    pub(super) fn try_point(
        &mut self,
        nlp: &mut dyn Nlp,
        alpha: f64,
        soc: bool,
    ) -> std::result::Result<(f64, f64), EvalError> {
        let (dx, ds) = if soc { (&self.dx_soc, &self.ds_soc) } else { (&self.dx, &self.ds) };
        for j in 0..self.n {
            self.trial.x[j] = self.it.x[j] + alpha * dx[j];
        }
        for i in 0..self.m {
            self.trial.s[i] = self.it.s[i] + alpha * ds[i];
        }
        let clock = Instant::now();
        self.stats.evaluations += 1;
        let r = nlp.eval(&self.trial.x, &mut self.c_trial);
        self.stats.time_eval += clock.elapsed().as_secs_f64();
        let f = r?;
        self.f_trial = f;
        let phi = barrier(&self.shape, &self.bounds, &self.trial.x, &self.trial.s, f, self.level.mu);
        let th = theta(&self.shape, &self.trial.s, &self.c_trial);
        if phi.is_finite() && th.is_finite() {
            Ok((phi, th))
        } else {
            Err(EvalError::Recoverable)
        }
    }

    /// Share of the distance to a bound that a step may take.
    pub(super) fn fraction_to_boundary(&self) -> f64 {
        (1.0 - self.level.mu).max(0.99)
    }

    pub(super) fn line_search(&mut self, nlp: &mut dyn Nlp) -> Search {
        let tau = self.fraction_to_boundary();
        let th0 = theta(&self.shape, &self.it.s, &self.v.c);
        let phi0 = barrier(&self.shape, &self.bounds, &self.it.x, &self.it.s, self.v.f, self.level.mu);
        if std::mem::take(&mut self.corrected) {
            if let Some(search) = self.take_corrected(nlp, tau, phi0, th0) {
                return search;
            }
            self.undo_corrections();
        }
        let (alpha_max, alpha_du) = (self.alpha_primal(tau, false), self.alpha_dual(tau));
        let slope = self.slope();
        let a_min = alpha_min(th0, slope, self.filter.theta_min());
        let tiny = (0..self.n).all(|j| self.dx[j].abs() <= 10.0 * f64::EPSILON * (1.0 + self.it.x[j].abs()));
        let mut alpha = alpha_max;
        let mut trials = 0;
        self.info.alpha_du = alpha_du;
        loop {
            trials += 1;
            let tried = self.try_point(nlp, alpha, false);
            match tried {
                Err(EvalError::Fatal(_) | EvalError::Stopped) => return Search::Fatal,
                Err(EvalError::Recoverable) => {}
                Ok((phi, th)) => {
                    let ok = self.acceptable(alpha, phi0, th0, slope, phi, th);
                    if ok || tiny {
                        self.augment_filter(alpha, phi0, th0, slope, phi);
                        return self.accept(nlp, alpha, alpha_du, trials);
                    }
                    if trials == 1 && th >= th0 {
                        let alpha_soc = self.second_order_correction(nlp, alpha, tau, phi0, th0, slope, th);
                        if let Some(alpha_soc) = alpha_soc {
                            return self.accept(nlp, alpha_soc, alpha_du, trials);
                        }
                    }
                }
            }
            alpha *= 0.5;
            if alpha < a_min || trials > 40 {
                return Search::Jammed;
            }
        }
    }

    /// The full step along a corrected direction, where the filter takes it.
    fn take_corrected(&mut self, nlp: &mut dyn Nlp, tau: f64, phi0: f64, th0: f64) -> Option<Search> {
        let (alpha, alpha_du) = (self.alpha_primal(tau, false), self.alpha_dual(tau));
        let slope = self.slope();
        match self.try_point(nlp, alpha, false) {
            Ok((phi, th)) if self.acceptable(alpha, phi0, th0, slope, phi, th) => {
                self.augment_filter(alpha, phi0, th0, slope, phi);
                self.info.alpha_du = alpha_du;
                Some(self.accept(nlp, alpha, alpha_du, 1))
            }
            Err(EvalError::Fatal(_) | EvalError::Stopped) => Some(Search::Fatal),
            _ => None,
        }
    }

    pub(super) fn switching(alpha: f64, th0: f64, slope: f64) -> bool {
        slope < 0.0 && alpha * (-slope).powf(S_PHI) > DELTA * th0.powf(S_THETA)
    }

    pub(super) fn acceptable(&self, alpha: f64, phi0: f64, th0: f64, slope: f64, phi: f64, th: f64) -> bool {
        if !self.filter.accepts(th, phi) {
            return false;
        }
        if th0 <= self.filter.theta_min() && Self::switching(alpha, th0, slope) {
            phi <= phi0 + ETA_PHI * alpha * slope + noise(phi0)
        } else {
            th <= (1.0 - GAMMA_THETA) * th0 || phi <= phi0 - GAMMA_PHI * th0 + noise(phi0)
        }
    }

    pub(super) fn augment_filter(&mut self, alpha: f64, phi0: f64, th0: f64, slope: f64, phi: f64) {
        let armijo = phi <= phi0 + ETA_PHI * alpha * slope + noise(phi0);
        if !(Self::switching(alpha, th0, slope) && armijo) {
            self.filter.add(th0, phi0);
        }
    }

    /// Corrections for the curvature of the rows, section 2.4; the step length of an accepted one.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn second_order_correction(
        &mut self,
        nlp: &mut dyn Nlp,
        alpha: f64,
        tau: f64,
        phi0: f64,
        th0: f64,
        slope: f64,
        th_first: f64,
    ) -> Option<f64> {
        const KAPPA_SOC: f64 = 0.99;
        let mut th_old = th_first;
        let mut alpha_last = alpha;
        for k in 0..self.settings.max_soc {
            for i in 0..self.m {
                if self.shape.row[i] != RowKind::Free {
                    let before = if k == 0 { self.v.c[i] - self.it.s[i] } else { self.residual[i] };
                    self.residual[i] = alpha_last * before + self.c_trial[i] - self.trial.s[i];
                }
            }
            let clock = Instant::now();
            let ok = self.solve_direction(true);
            self.stats.time_linalg += clock.elapsed().as_secs_f64();
            if !ok {
                return None;
            }
            alpha_last = self.alpha_primal(tau, true);
            match self.try_point(nlp, alpha_last, true) {
                Ok((phi, th)) => {
                    if self.acceptable(alpha, phi0, th0, slope, phi, th) {
                        self.augment_filter(alpha, phi0, th0, slope, phi);
                        return Some(alpha_last);
                    }
                    if th > KAPPA_SOC * th_old {
                        return None;
                    }
                    th_old = th;
                }
                Err(_) => return None,
            }
        }
        None
    }

    /// Takes the point in `trial` with its values; multipliers go along by their own step length.
    pub(super) fn accept(&mut self, nlp: &mut dyn Nlp, alpha: f64, alpha_du: f64, trials: usize) -> Search {
        self.info.alpha_pr = alpha;
        self.info.trials = trials;
        self.info.step = self.dx.iter().fold(0.0, |a: f64, d| a.max(d.abs()));
        std::mem::swap(&mut self.it.x, &mut self.trial.x);
        std::mem::swap(&mut self.it.s, &mut self.trial.s);
        std::mem::swap(&mut self.v.c, &mut self.c_trial);
        self.v.f = self.f_trial;
        let mu = self.level.mu;
        let Ipm { it, trial, bounds: b, shape: sh, .. } = self;
        for i in 0..it.y.len() {
            if sh.row[i] != RowKind::Free {
                it.y[i] += alpha * trial.y[i];
            }
        }
        // distances may not underflow against the bound they belong to
        for j in 0..it.x.len() {
            if sh.has_xl[j] {
                it.x[j] = it.x[j].max(b.xl[j] + tiny_gap(b.xl[j]));
                it.zl[j] = clamp_multiplier(it.zl[j] + alpha_du * self.dzl[j], it.x[j] - b.xl[j], mu);
            }
            if sh.has_xu[j] {
                it.x[j] = it.x[j].min(b.xu[j] - tiny_gap(b.xu[j]));
                it.zu[j] = clamp_multiplier(it.zu[j] + alpha_du * self.dzu[j], b.xu[j] - it.x[j], mu);
            }
        }
        for i in 0..it.s.len() {
            if sh.has_cl[i] {
                it.s[i] = it.s[i].max(b.cl[i] + tiny_gap(b.cl[i]));
                it.vl[i] = clamp_multiplier(it.vl[i] + alpha_du * self.dvl[i], it.s[i] - b.cl[i], mu);
            }
            if sh.has_cu[i] {
                it.s[i] = it.s[i].min(b.cu[i] - tiny_gap(b.cu[i]));
                it.vu[i] = clamp_multiplier(it.vu[i] + alpha_du * self.dvu[i], b.cu[i] - it.s[i], mu);
            }
        }
        if self.differentiate(nlp) {
            Search::Accepted
        } else {
            Search::Fatal
        }
    }

    /// Takes the full step when it lowers the whole optimality error (soft restoration, section 3.3 of the
    /// paper on Ipopt); this is what brings the last digits when the filter only sees rounding.
    pub(super) fn soft_step(&mut self, nlp: &mut dyn Nlp) -> bool {
        let mu = self.level.mu;
        let tau = self.fraction_to_boundary();
        let before = self.errors([mu])[0].scaled();
        let alpha = self.alpha_primal(tau, false).min(self.alpha_dual(tau));
        if !alpha.is_finite() || self.dx.iter().any(|d| !d.is_finite()) {
            return false;
        }
        let saved_f = self.v.f;
        if self.try_point(nlp, alpha, false).is_err() {
            return false;
        }
        // keep what is needed to go back
        let mut saved = std::mem::replace(&mut self.trial, Iterate::zeros(0, 0));
        std::mem::swap(&mut self.v.c, &mut self.c_trial);
        std::mem::swap(&mut self.it.x, &mut saved.x);
        std::mem::swap(&mut self.it.s, &mut saved.s);
        self.v.f = self.f_trial;
        self.add_duals(&saved.y, alpha);
        let ok = self.differentiate(nlp);
        lagrangian_gradient(&self.shape, &self.jac, &self.v, &self.it.y, &mut self.lag);
        let better = ok && self.errors([mu])[0].scaled() <= (1.0 - 1e-4) * before;
        if !better {
            self.add_duals(&saved.y, -alpha);
            std::mem::swap(&mut self.it.x, &mut saved.x);
            std::mem::swap(&mut self.it.s, &mut saved.s);
            std::mem::swap(&mut self.v.c, &mut self.c_trial);
            self.v.f = saved_f;
            self.differentiate(nlp);
            lagrangian_gradient(&self.shape, &self.jac, &self.v, &self.it.y, &mut self.lag);
        }
        self.trial = saved;
        better
    }

    pub(super) fn add_duals(&mut self, dy: &[f64], alpha: f64) {
        let Ipm { it, dzl, dzu, dvl, dvu, .. } = self;
        for (v, d) in [
            (&mut it.y, dy),
            (&mut it.zl, &dzl[..]),
            (&mut it.zu, &dzu[..]),
            (&mut it.vl, &dvl[..]),
            (&mut it.vu, &dvu[..]),
        ] {
            for k in 0..v.len() {
                v[k] += alpha * d[k];
            }
        }
    }
}

/// Step length at which `value + α step = (1 − τ) value`.
#[inline]
fn ratio(tau: f64, value: f64, step: f64) -> f64 {
    if step < 0.0 {
        -tau * value / step
    } else {
        1.0
    }
}

/// Keeps a multiplier within a factor of the central path, (16) of Wächter and Biegler.
#[inline]
pub(super) fn clamp_multiplier(z: f64, dist: f64, mu: f64) -> f64 {
    const KAPPA_SIGMA: f64 = 1e10;
    within(z, mu / (KAPPA_SIGMA * dist), KAPPA_SIGMA * mu / dist)
}

/// Distance from a bound that rounding leaves.
#[inline]
pub(super) fn tiny_gap(bound: f64) -> f64 {
    1e-20f64.max(f64::EPSILON * bound.abs())
}
