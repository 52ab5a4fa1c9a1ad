//! Centrality correctors: directions that keep more of their length.
//!
//! A step is cut short by the few bounds whose products of distance and multiplier it takes far off the central path. With the
//! factor at hand one more solution aims at a path on which these products are within a range of `μ` at the end of a longer step
//! (J. Gondzio, Computational Optimization and Applications 6, 1996). Rows and multipliers are linearised as before: the corrected
//! direction is a Newton direction of a barrier problem with a parameter for every bound. Its full step is taken where it is the
//! longer one and the filter accepts the point it leads to; otherwise the direction of before is searched.

use super::iterate::Iterate;
use super::solver::Ipm;

/// Range of products of distance and multiplier, relative to `μ`, that is as good as the central path.
const LEAST: f64 = 0.1;
const MOST: f64 = 10.0;
/// By how much longer a step is aimed at.
const LONGER: f64 = 0.3;
/// Share of the sum of primal and dual step length that a correction wins at least: below, what differs is rounding.
const WON: f64 = 1e-4;
/// A step of this length needs no correction.
const LONG: f64 = 0.9;
/// Corrections of one direction at most.
const CORRECTIONS: usize = 2;

/// Barrier parameters of single bounds, as differences from that of the level.
pub(super) struct Offsets {
    pub xl: Vec<f64>,
    pub xu: Vec<f64>,
    pub cl: Vec<f64>,
    pub cu: Vec<f64>,
}

impl Offsets {
    pub fn new(n: usize, m: usize) -> Offsets {
        Offsets { xl: vec![0.0; n], xu: vec![0.0; n], cl: vec![0.0; m], cu: vec![0.0; m] }
    }

    fn clear(&mut self) {
        for v in [&mut self.xl, &mut self.xu, &mut self.cl, &mut self.cu] {
            v.fill(0.0);
        }
    }
}

/// A direction that is kept beside the present one.
pub(super) struct Direction {
    dx: Vec<f64>,
    ds: Vec<f64>,
    dy: Vec<f64>,
    dzl: Vec<f64>,
    dzu: Vec<f64>,
    dvl: Vec<f64>,
    dvu: Vec<f64>,
}

impl Direction {
    pub fn new(n: usize, m: usize) -> Direction {
        let (x, c) = (|| vec![0.0; n], || vec![0.0; m]);
        Direction { dx: x(), ds: c(), dy: c(), dzl: x(), dzu: x(), dvl: c(), dvu: c() }
    }
}

/// What brings the product of a distance and its multiplier back into the range, at the ends of steps of these lengths.
fn offset(has: bool, [dist, d_dist]: [f64; 2], [z, dz]: [f64; 2], [alpha_pr, alpha_du]: [f64; 2], mu: f64) -> f64 {
    if !has {
        return 0.0;
    }
    let product = (dist + alpha_pr * d_dist) * (z + alpha_du * dz);
    (product.clamp(LEAST * mu, MOST * mu) - product).max(-MOST * mu)
}

impl Ipm {
    /// Corrects a short direction; the one of before is then in `plain`. False where nothing is won.
    pub(super) fn correct_centrality(&mut self) -> bool {
        let tau = self.fraction_to_boundary();
        let mut corrected = false;
        for _ in 0..CORRECTIONS {
            let lengths = [self.alpha_primal(tau, false), self.alpha_dual(tau)];
            if lengths[0].min(lengths[1]) >= LONG {
                break;
            }
            self.aim_longer(lengths.map(|a| (a + LONGER).min(1.0)));
            // the direction so far goes to `before`, and that of the first solution from there to `plain`
            self.swap_with_before();
            let solved = self.solve_direction(false) && !self.step_is_absurd();
            let now = [self.alpha_primal(tau, false), self.alpha_dual(tau)];
            let sum = lengths[0] + lengths[1];
            let longer = now[0] >= lengths[0] && now[1] >= lengths[1].min(LONG) && now[0] + now[1] >= (1.0 + WON) * sum;
            if !(solved && longer) {
                self.swap_with_before();
                break;
            }
            if !corrected {
                std::mem::swap(&mut self.plain, &mut self.before);
            }
            corrected = true;
        }
        self.offsets.clear();
        corrected
    }

    /// Adds to the offsets what keeps products in their range along steps of these lengths.
    fn aim_longer(&mut self, lengths: [f64; 2]) {
        let mu = self.level.mu;
        let (b, sh, o) = (&self.bounds, &self.shape, &mut self.offsets);
        let Iterate { x, s, zl, zu, vl, vu, .. } = &self.it;
        for (j, d) in self.dx.iter().enumerate() {
            o.xl[j] += offset(sh.has_xl[j], [x[j] - b.xl[j], *d], [zl[j], self.dzl[j]], lengths, mu);
            o.xu[j] += offset(sh.has_xu[j], [b.xu[j] - x[j], -d], [zu[j], self.dzu[j]], lengths, mu);
        }
        for (i, d) in self.ds.iter().enumerate() {
            o.cl[i] += offset(sh.has_cl[i], [s[i] - b.cl[i], *d], [vl[i], self.dvl[i]], lengths, mu);
            o.cu[i] += offset(sh.has_cu[i], [b.cu[i] - s[i], -d], [vu[i], self.dvu[i]], lengths, mu);
        }
    }

    /// The direction as it was before its corrections.
    pub(super) fn undo_corrections(&mut self) {
        std::mem::swap(&mut self.plain, &mut self.before);
        self.swap_with_before();
    }

    fn swap_with_before(&mut self) {
        let Direction { dx, ds, dy, dzl, dzu, dvl, dvu } = &mut self.before;
        for (a, b) in [
            (&mut self.dx, dx),
            (&mut self.ds, ds),
            (&mut self.trial.y, dy),
            (&mut self.dzl, dzl),
            (&mut self.dzu, dzu),
            (&mut self.dvl, dvl),
            (&mut self.dvu, dvu),
        ] {
            std::mem::swap(a, b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With its offset as a change of `μ` the product ends in the range; what is far too large is only lowered by its upper end.
    #[test]
    fn products_are_brought_back() {
        let at = |dist: [f64; 2], z: [f64; 2]| offset(true, dist, z, [0.5, 0.5], 1e-2);
        assert_eq!(at([1.0, 0.0], [1e-2, 0.0]), 0.0);
        // 0.2 * 1e-3 is below 1e-3
        assert!((at([0.2, 0.0], [2e-3, -2e-3]) - (1e-3 - 2e-4)).abs() < 1e-15);
        // 0.5 * 0.3 is above 0.1
        assert!((at([0.4, 0.2], [0.2, 0.2]) - (0.1 - 0.15)).abs() < 1e-15);
        assert!((at([1.0, 0.0], [1e3, 0.0]) + 0.1).abs() < 1e-15);
        assert_eq!(offset(false, [1.0, 0.0], [1e3, 0.0], [1.0, 1.0], 1e-2), 0.0);
    }
}
