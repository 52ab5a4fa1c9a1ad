//! What answers where a controller is not at hand: the last plan with its feedback law.

use super::monitor::Timing;
use super::options::Source;
use std::time::Duration;

/// A plan with the law of the program that gave it, `u_k + K_k (x − x_k)`: without constraints, the solution of the program that begins
/// at node `k`.
#[derive(Debug, Clone)]
pub(super) struct Standby {
    nx: usize,
    nu: usize,
    /// States `[(n + 1) · nx]`, controls `[n · nu]`, gains `[n]` of `nu × nx`, column-major.
    pub x: Vec<f64>,
    pub u: Vec<f64>,
    pub gain: Vec<f64>,
    /// Is there a law?
    pub has_gain: bool,
    /// Bounds of the controls.
    pub u_lower: Vec<f64>,
    pub u_upper: Vec<f64>,
    /// Stage of the plan that belongs to the next sample.
    pub entry: usize,
}

impl Standby {
    pub fn new(n: usize, nx: usize, nu: usize) -> Standby {
        Standby {
            nx,
            nu,
            x: vec![0.0; (n + 1) * nx],
            u: vec![0.0; n * nu],
            gain: vec![0.0; n * nu * nx],
            has_gain: false,
            u_lower: vec![f64::NEG_INFINITY; nu],
            u_upper: vec![f64::INFINITY; nu],
            entry: 0,
        }
    }

    /// The control for a state, and where it comes from; behind the end of the plan the `last` one again.
    pub fn control(&mut self, x: &[f64], last: &[f64], u0: &mut [f64]) -> Source {
        let (nx, nu, k) = (self.nx, self.nu, self.entry);
        self.entry += 1;
        let Some(plan) = self.u.chunks_exact(nu).nth(k) else {
            u0.copy_from_slice(last);
            return Source::Hold;
        };
        u0.copy_from_slice(plan);
        let mut source = Source::Plan;
        if self.has_gain && x.iter().all(|v| v.is_finite()) {
            let own = &self.x[k * nx..(k + 1) * nx];
            let columns = self.gain[k * nx * nu..(k + 1) * nx * nu].chunks_exact(nu);
            for ((x, own), column) in x.iter().zip(own).zip(columns) {
                u0.iter_mut().zip(column).for_each(|(u, g)| *u += g * (x - own));
            }
            source = Source::Tangent;
        }
        if !u0.iter().all(|v| v.is_finite()) {
            u0.copy_from_slice(plan);
            source = Source::Plan;
        }
        let bounds = self.u_lower.iter().zip(&self.u_upper);
        u0.iter_mut().zip(bounds).for_each(|(u, (l, h))| *u = u.max(*l).min(*h));
        source
    }
}

/// Samples at which another answered, of which a controller is still to learn.
#[derive(Debug, Clone)]
pub(super) struct Passed {
    /// How many.
    pub samples: usize,
    /// The last of them: state, whether it was measured, control.
    pub x: Vec<f64>,
    pub measured: bool,
    pub u: Vec<f64>,
    /// Where controls came from, and how long it took.
    pub sources: [u64; 5],
    pub timing: Timing,
}

impl Passed {
    pub fn new(nx: usize, nu: usize) -> Passed {
        let (x, u) = (vec![0.0; nx], vec![0.0; nu]);
        Passed { samples: 0, x, measured: false, u, sources: [0; 5], timing: Timing::default() }
    }

    /// Another one.
    pub fn add(&mut self, x: &[f64], u: &[f64], source: Source, time: Duration) {
        self.samples += 1;
        self.x.copy_from_slice(x);
        self.measured = x.iter().all(|v| v.is_finite());
        self.u.copy_from_slice(u);
        self.sources[source as usize] += 1;
        self.timing.add(time);
    }

    /// None any more; the last control is kept.
    pub fn clear(&mut self) {
        self.samples = 0;
        self.sources = [0; 5];
        self.timing = Timing::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_law_then_the_plan_then_the_last_control() {
        let mut s = Standby::new(3, 2, 1);
        s.x.copy_from_slice(&[0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 0.0, 0.0]);
        s.u.copy_from_slice(&[0.1, 0.2, 0.3]);
        s.gain.copy_from_slice(&[0.0, 0.0, -0.5, 0.25, 9.0, 9.0]);
        (s.u_lower[0], s.u_upper[0], s.has_gain, s.entry) = (-1.0, 1.0, true, 1);
        let mut u = [0.0];
        assert_eq!(s.control(&[1.2, 2.4], &[0.7], &mut u), Source::Tangent);
        assert!((u[0] - (0.2 - 0.5 * 0.2 + 0.25 * 0.4)).abs() < 1e-15, "{u:?}");
        assert_eq!((s.control(&[f64::NAN, 0.0], &[0.7], &mut u), u), (Source::Plan, [0.3]));
        assert_eq!((s.control(&[1.0, 1.0], &[0.7], &mut u), u), (Source::Hold, [0.7]));
        s.entry = 2;
        assert_eq!((s.control(&[9.0, 9.0], &[0.7], &mut u), u), (Source::Tangent, [1.0]));
        s.entry = 2;
        assert_eq!((s.control(&[f64::MAX, -f64::MAX], &[0.7], &mut u), u), (Source::Plan, [0.3]));
    }
}
