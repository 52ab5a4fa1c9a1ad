//! Where a barrier problem begins: inside the bounds, with multipliers that fit.

use super::iterate::RowKind;
use super::problem::{within, Nlp, INFINITE};
use super::solver::{Ipm, Start};

/// Share of the barrier parameter from which the product of a distance and its multiplier is as good as on the central path.
const NEAR_PATH: f64 = 0.1;

impl Ipm {
    /// Point inside the bounds, function values, multipliers.
    pub(super) fn initialise(&mut self, nlp: &mut dyn Nlp, start: Start) -> bool {
        let (push, warm) = match start {
            Start::Cold(x) => {
                self.it.x.copy_from_slice(x);
                (self.settings.bound_push, false)
            }
            Start::Warm(it, push) => {
                self.it.copy_from(it);
                (push, true)
            }
        };
        let Ipm { it, bounds: b, shape, .. } = self;
        for j in 0..it.x.len() {
            it.x[j] = if shape.fixed[j] { b.xl[j] } else { push_inside(it.x[j], b.xl[j], b.xu[j], push) };
        }
        if !self.evaluate(nlp) || !self.differentiate(nlp) {
            // there are no residuals at this point, and those of an earlier one are not its own
            let Ipm { it, v, .. } = self;
            v.f = f64::NAN;
            v.c.fill(f64::INFINITY);
            v.grad.fill(f64::INFINITY);
            v.jac.fill(0.0);
            for z in [&mut it.s, &mut it.y, &mut it.zl, &mut it.zu, &mut it.vl, &mut it.vu] {
                z.fill(0.0);
            }
            return false;
        }
        let Ipm { it, bounds: b, shape, v, .. } = self;
        for i in 0..it.s.len() {
            it.s[i] = match shape.row[i] {
                RowKind::Equality => b.cl[i],
                RowKind::Free => v.c[i],
                RowKind::Inequality => push_inside(v.c[i], b.cl[i], b.cu[i], push),
            };
            if shape.row[i] == RowKind::Free {
                it.y[i] = 0.0;
            }
        }
        self.start_bound_multipliers(warm);
        if !warm {
            self.estimate_multipliers();
        }
        true
    }

    /// Multipliers of bounds on the central path; where `warm`, those that are there are kept.
    pub(super) fn start_bound_multipliers(&mut self, warm: bool) {
        let Ipm { it, bounds: b, shape, level, .. } = self;
        for j in 0..it.x.len() {
            it.zl[j] = start_multiplier(shape.has_xl[j], warm, it.zl[j], it.x[j] - b.xl[j], level.mu);
            it.zu[j] = start_multiplier(shape.has_xu[j], warm, it.zu[j], b.xu[j] - it.x[j], level.mu);
        }
        for i in 0..it.s.len() {
            it.vl[i] = start_multiplier(shape.has_cl[i], warm, it.vl[i], it.s[i] - b.cl[i], level.mu);
            it.vu[i] = start_multiplier(shape.has_cu[i], warm, it.vu[i], b.cu[i] - it.s[i], level.mu);
        }
    }

    /// Multipliers as at a start: those of bounds on the central path, those of rows by least squares. What was learnt about the
    /// perturbation of the Hessian with the old ones is forgotten.
    pub(super) fn renew_multipliers(&mut self) {
        self.start_bound_multipliers(false);
        self.system.restart();
        self.estimate_multipliers();
    }

    /// Least-squares multipliers of the rows, (36) of Wächter and Biegler; zero where they are too large for the gradient they balance.
    pub(super) fn estimate_multipliers(&mut self) {
        let Ipm { system, shape, bounds, it, v, n, .. } = self;
        it.y.fill(0.0);
        system.assemble(shape, bounds, it, v, false);
        for j in 0..*n {
            system.rhs[j] = if shape.fixed[j] { 0.0 } else { -(v.grad[j] - it.zl[j] + it.zu[j]) };
        }
        for i in 0..it.y.len() {
            system.rhs[*n + i] = if shape.row[i] == RowKind::Inequality { -(it.vu[i] - it.vl[i]) } else { 0.0 };
        }
        if system.factor_plain() && system.solve() {
            let y = &system.sol[*n..];
            let largest = |v: &[f64]| v.iter().fold(0f64, |a, v| a.max(v.abs()));
            let most = self.settings.y_init_max.max(self.settings.y_init_share * largest(&v.grad));
            if largest(y) <= most {
                it.y.copy_from_slice(y);
            }
        }
        for i in 0..it.y.len() {
            if shape.row[i] == RowKind::Free {
                it.y[i] = 0.0;
            }
        }
    }

    /// Moves what is too close to its bound for the barrier parameter `mu` onto the central path: the larger one of distance and
    /// multiplier stays, the smaller one grows. A problem that was solved leaves both tiny in turn, and steps of the next one would be
    /// cut short at once. False where functions have no value there.
    pub(super) fn recentre(&mut self, nlp: &mut dyn Nlp, mu: f64) -> bool {
        let Ipm { it, bounds: b, shape: sh, .. } = self;
        let centre = |v: &mut f64, z: &mut f64, bound: f64, out: f64, room: f64| {
            if let Some((dist, multiplier)) = centred(out * (*v - bound), *z, room, mu) {
                *v = bound + out * dist;
                *z = multiplier;
            }
        };
        for j in (0..it.x.len()).filter(|j| !sh.fixed[*j]) {
            let room = b.xu[j] - b.xl[j];
            if sh.has_xl[j] {
                centre(&mut it.x[j], &mut it.zl[j], b.xl[j], 1.0, room);
            }
            if sh.has_xu[j] {
                centre(&mut it.x[j], &mut it.zu[j], b.xu[j], -1.0, room);
            }
        }
        for i in (0..it.s.len()).filter(|i| sh.row[*i] == RowKind::Inequality) {
            let room = b.cu[i] - b.cl[i];
            if sh.has_cl[i] {
                centre(&mut it.s[i], &mut it.vl[i], b.cl[i], 1.0, room);
            }
            if sh.has_cu[i] {
                centre(&mut it.s[i], &mut it.vu[i], b.cu[i], -1.0, room);
            }
        }
        self.evaluate(nlp) && self.differentiate(nlp)
    }
}

/// A distance and its multiplier on the central path of `mu`, where they are far below it: the larger one stays, and no distance grows
/// beyond half of the `room` between two bounds.
fn centred(dist: f64, z: f64, room: f64, mu: f64) -> Option<(f64, f64)> {
    if dist * z >= NEAR_PATH * mu {
        return None;
    }
    let dist = dist.max((mu / z).min(mu.sqrt()).min(0.5 * room));
    Some((dist, mu / dist))
}

fn start_multiplier(has: bool, warm: bool, z: f64, dist: f64, mu: f64) -> f64 {
    match (has, warm) {
        (false, _) => 0.0,
        (true, true) if z > 0.0 => z,
        _ => mu / dist,
    }
}

/// Moves a value inside its bounds by a relative distance, (34)-(35) of Wächter and Biegler.
pub(super) fn push_inside(v: f64, lo: f64, hi: f64, push: f64) -> f64 {
    let (has_lo, has_hi) = (lo > -INFINITE, hi < INFINITE);
    match (has_lo, has_hi) {
        (true, true) => {
            let pl = (push * lo.abs().max(1.0)).min(push.min(0.25) * (hi - lo));
            let pu = (push * hi.abs().max(1.0)).min(push.min(0.25) * (hi - lo));
            within(v, lo + pl, hi - pu)
        }
        (true, false) => v.max(lo + push * lo.abs().max(1.0)),
        (false, true) => v.min(hi - push * hi.abs().max(1.0)),
        (false, false) => v,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The larger one of the two stays; what is on the path, or above it, is left alone.
    #[test]
    fn what_hugs_its_bound_is_put_on_the_central_path() {
        let (inf, mu) = (f64::INFINITY, 1.0 / 64.0);
        // held by a multiplier of 2: the distance follows it
        assert_eq!(centred(1e-9, 2.0, inf, mu), Some((mu / 2.0, 2.0)));
        // free at a distance of 2: the multiplier follows it
        assert_eq!(centred(2.0, 1e-9, inf, mu), Some((2.0, mu / 2.0)));
        // neither says anything
        assert_eq!(centred(1e-9, 1e-9, inf, mu), Some((0.125, 0.125)));
        // not beyond the middle of two bounds
        assert_eq!(centred(1e-9, 1e-9, 0.125, mu), Some((0.0625, 0.25)));
        assert_eq!(centred(mu, 1.0, inf, mu), None);
        assert_eq!(centred(1.0, 1.0, inf, mu), None);
    }
}
