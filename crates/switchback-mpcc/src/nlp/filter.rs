//! The filter: pairs (constraint violation, barrier objective) no trial point may be dominated by.
//!
//! Wächter and Biegler, Math. Program. 106 (2006), section 2.3; constants as there.

/// Reduction of the violation asked of a trial point.
pub const GAMMA_THETA: f64 = 1e-5;
/// Reduction of the barrier objective asked of a trial point, per violation.
pub const GAMMA_PHI: f64 = 1e-8;
/// Exponent of the model decrease in the switching condition.
pub const S_PHI: f64 = 2.3;
/// Exponent of the violation in the switching condition.
pub const S_THETA: f64 = 1.1;
/// Factor of the switching condition.
pub const DELTA: f64 = 1.0;
/// Armijo constant.
pub const ETA_PHI: f64 = 1e-8;

const CAPACITY: usize = 512;

/// The filter. Its memory is allocated once; the oldest entries go when it is full.
#[derive(Debug)]
pub struct Filter {
    entries: Vec<(f64, f64)>,
    theta_max: f64,
    theta_min: f64,
}

impl Filter {
    pub fn new() -> Filter {
        Filter { entries: Vec::with_capacity(CAPACITY), theta_max: f64::INFINITY, theta_min: 0.0 }
    }

    /// Empties the filter for a new barrier problem that starts at violation `theta`; violations
    /// above `room` times that, or times `1e-4 room` if that is more, are refused.
    pub fn reset(&mut self, theta: f64, room: f64) {
        self.entries.clear();
        self.theta_max = room * theta.max(1e-4 * room);
        self.theta_min = 1e-4 * theta.max(1.0);
    }

    /// Violation below which the objective may be asked to decrease.
    pub fn theta_min(&self) -> f64 {
        self.theta_min
    }

    /// Is the pair outside the forbidden region?
    pub fn accepts(&self, theta: f64, phi: f64) -> bool {
        theta <= self.theta_max && self.entries.iter().all(|&(t, p)| theta <= t || phi <= p + noise(p))
    }

    /// Forbids everything (almost) as bad as the pair.
    pub fn add(&mut self, theta: f64, phi: f64) {
        let entry = ((1.0 - GAMMA_THETA) * theta, phi - GAMMA_PHI * theta);
        self.entries.retain(|&(t, p)| t < entry.0 || p < entry.1);
        if self.entries.len() == CAPACITY {
            self.entries.remove(0);
        }
        self.entries.push(entry);
    }
}

/// Rounding error to forgive when barrier objectives are compared.
pub fn noise(phi: f64) -> f64 {
    10.0 * f64::EPSILON * phi.abs()
}

/// Smallest step length worth trying before restoration, (23) of the paper.
pub fn alpha_min(theta: f64, slope: f64, theta_min: f64) -> f64 {
    let mut a = GAMMA_THETA;
    if slope < 0.0 {
        a = a.min(GAMMA_PHI * theta / -slope);
        if theta <= theta_min {
            a = a.min(DELTA * theta.powf(S_THETA) / (-slope).powf(S_PHI));
        }
    }
    0.05 * a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dominated_pairs_are_refused_until_the_reset() {
        let mut f = Filter::new();
        f.reset(1.0, 1e4);
        assert!(f.accepts(0.5, 10.0));
        f.add(0.5, 10.0);
        assert!(!f.accepts(0.6, 11.0));
        assert!(f.accepts(0.4, 11.0) && f.accepts(0.6, 9.0));
        f.add(0.4, 9.0);
        assert!(!f.accepts(0.45, 9.5));
        f.reset(1.0, 1e4);
        assert!(f.accepts(0.6, 11.0) && !f.accepts(2e4, 0.0));
    }

    #[test]
    fn a_full_filter_stays_within_its_memory() {
        let mut f = Filter::new();
        f.reset(1.0, 1e4);
        for i in 0..2000 {
            f.add(i as f64, -(i as f64));
        }
        assert!(f.entries.len() <= CAPACITY && f.entries.capacity() == CAPACITY);
    }
}
