//! Horizons that move on: the solution one control stage later is simulated from the state that was measured, and the phases of that
//! simulation are the start of a mode program. Switches move with the time, and into the stages where the new state puts them.

use super::{Durations, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::nlp::middle;

/// Share of the largest cost of a plan so far by which the cost may rise from one sample to the next, and below which nothing
/// is left that is worth a search: noise.
pub(super) const SURPRISE: f64 = 0.01;

impl Ocp {
    /// Makes the last solution, one control stage later, the guess of the next solve; the last stage is repeated. A warm solve
    /// simulates it from the initial state that is set by then, and starts from the modes and switching times of that.
    pub fn shift(&mut self) -> Result<()> {
        let r =
            self.result.as_ref().ok_or_else(|| Error::State("there is no solution to shift: solve first".into()))?;
        let nu = self.system.dims().u;
        let mut u = r.controls[nu..].to_vec();
        u.extend_from_slice(&r.control_ends[(self.n_stages - 1) * nu..]);
        let mut moved = Box::new(r.clone());
        moved.control_ends.drain(..nu);
        moved.control_ends.extend_from_slice(&r.control_ends[(self.n_stages - 1) * nu..]);
        moved.controls.clone_from(&u);
        if self.time == Durations::Stages {
            moved.durations.rotate_left(1);
            moved.durations[self.n_stages - 1] = r.durations[self.n_stages - 1];
        }
        let from = self.t0 + r.durations[0];
        let (mut times, mut x) = (Vec::new(), Vec::new());
        for e in r.trajectory.elements.iter().filter(|e| e.stage > 0) {
            if times.last().is_none_or(|t| e.t - from > *t) {
                times.push(e.t - from);
                x.extend_from_slice(&e.x0);
            }
        }
        if let Some(e) = r.trajectory.elements.last().filter(|_| !times.is_empty()) {
            if e.h > 1e-12 {
                times.push(e.t + e.h - from);
                x.extend_from_slice(&e.x1);
            }
        }
        if let (Some(first), Some(later)) =
            (moved.trajectory.elements.first_mut(), r.trajectory.elements.iter().find(|e| e.stage > 0))
        {
            first.x0.clone_from(&later.x0);
        }
        if self.n_stages > 1 {
            self.set_x_guess(&times, &x)?;
        }
        self.set_u_guess(&u)?;
        self.shifted = Some(moved);
        Ok(())
    }

    /// Makes an answer that was found before one of the problem as it is stated now, to start from: what is data is that of now, what is free
    /// stays within the bounds of now.
    pub(super) fn restate(&self, r: &mut OcpResult) {
        r.params = self.params_from(r);
        r.durations = self.durations_from(&r.durations);
        let nu = self.system.dims().u.max(1);
        let n = self.n_stages;
        for (i, u) in r.controls.chunks_exact_mut(nu).chain(r.control_ends.chunks_exact_mut(nu)).enumerate() {
            let [lower, upper] = self.control_bounds(i % n);
            u.iter_mut().zip(lower.iter().zip(upper)).for_each(|(u, (l, h))| *u = u.clamp(*l, *h));
        }
    }

    /// Parameters to start from: those that are free as an answer has them, within the bounds of now, the others as they are set.
    pub(super) fn params_from(&self, r: &OcpResult) -> Vec<f64> {
        let mut params = self.params.clone();
        let Some([lower, upper]) = self.p_bounds.as_ref().filter(|_| self.stage_params.is_none()) else {
            return params;
        };
        for (j, p) in params.iter_mut().enumerate().filter(|(j, _)| lower[*j] < upper[*j]) {
            *p = r.params[j].clamp(lower[j], upper[j]);
        }
        params
    }

    /// Lengths of stages to start from, likewise: where the horizon is free the stages have their shares of it.
    fn durations_from(&self, found: &[f64]) -> Vec<f64> {
        let within = |d: f64| d.clamp(self.time_bounds[0], self.time_bounds[1]);
        match self.time {
            Durations::Fixed => self.durations.clone(),
            Durations::Horizon => {
                let own: f64 = self.durations.iter().sum();
                let share = within(found.iter().sum()) / own;
                self.durations.iter().map(|d| d * share).collect()
            }
            Durations::Stages => found.iter().map(|d| within(*d)).collect(),
        }
    }

    /// The same, and the state it begins with.
    pub(super) fn restate_start(&self, r: &mut OcpResult) {
        self.restate(r);
        if let Some(e) = r.trajectory.elements.first_mut() {
            for (i, x) in e.x0.iter_mut().enumerate() {
                let (l, u) = (self.x0_bounds[0][i], self.x0_bounds[1][i]);
                *x = if l == u { middle(l, u) } else { x.clamp(l, u) };
            }
        }
    }
}
