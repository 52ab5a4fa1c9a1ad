//! States that a motion may pass, those of the guess or a way to a state that meets the terminal constraints, and controls that move it there.

use crate::contact::Dynamics;
use crate::fesd::Sizes;
use crate::func::Point;
use crate::nlp::middles;
use crate::ocp::guess::interpolate;
use crate::ocp::{stage_times, Ocp};
use crate::system::{Mechanics, Order, SharedFunction};
use nalgebra::{DMatrix, DVector};

/// Share of the largest entry of a matrix of least squares below which a direction counts as none.
const DEPENDENT: f64 = 1e-10;
/// Share of the size of the coordinates up to which a gap on the way is closed.
const NEAR: f64 = 1e-4;

impl Ocp {
    /// States at times from the start of the horizon, `[nx]` each: of the guess; or from the initial state straight to a state that meets the terminal
    /// constraints, with coordinates of a scene along cubic curves that fit its velocities; or the initial state.
    pub(super) fn way(&self, times: &[f64]) -> Vec<Vec<f64>> {
        let (nx, horizon) = (self.system.dims().x, self.durations.iter().sum::<f64>());
        if let Some((given, states)) = &self.x_guess {
            let at = |t: &f64| {
                let mut x = vec![0.0; nx];
                interpolate(given, states, *t, &mut x);
                x
            };
            return times.iter().map(at).collect();
        }
        let start: Vec<f64> = middles(&self.x0_bounds);
        let target = self.held_target(&start).or_else(|| self.target()).unwrap_or_else(|| start.clone());
        let between = |s: f64| -> Vec<f64> { start.iter().zip(&target).map(|(a, b)| a + s * (b - a)).collect() };
        let scene = self.system.mechanics().filter(|m| m.order == Order::Second);
        let slopes = scene.and_then(|m| Some([self.rates(m, &start)?.0, self.rates(m, &target)?.0]));
        let (Some(m), Some([first, last])) = (scene, slopes) else {
            return times.iter().map(|t| between(t / horizon)).collect();
        };
        let at = |t: &f64| {
            let s = t / horizon;
            let mut x = between(s);
            let mut rate = vec![0.0; m.n_q];
            for i in 0..m.n_q {
                let (way, a, b) = (target[i] - start[i], horizon * first[i], horizon * last[i]);
                // the cubic curve with these values and slopes at both ends
                x[i] = start[i] + s * (a + s * (3.0 * way - 2.0 * a - b + s * (a + b - 2.0 * way)));
                rate[i] = (a + s * (2.0 * (3.0 * way - 2.0 * a - b) + 3.0 * s * (a + b - 2.0 * way))) / horizon;
            }
            if let Some((_, by)) = self.rates(m, &x) {
                let least = DEPENDENT * by.amax();
                if let Ok(v) = by.svd(true, true).solve(&DVector::from_vec(rate), least) {
                    x[m.velocities()].copy_from_slice(v.as_slice());
                }
            }
            x
        };
        times.iter().map(at).collect()
    }

    /// A state that meets the terminal constraints with the constraints of a scene, and contacts that are closed at the start closed: what is pushed
    /// takes with it what pushes.
    fn held_target(&self, start: &[f64]) -> Option<Vec<f64>> {
        let m = self.system.mechanics().filter(|m| m.order == Order::Second)?;
        let at = Point { t: self.t0, x: start, u: &self.control_guess()[..self.system.dims().u], p: self.params_of(0) };
        let size = start[..m.n_q].iter().fold(0f64, |a, v| a.max(v.abs()));
        let closed = |f: &SharedFunction| {
            let mut gap = vec![f64::NAN; f.n_out()];
            f.value(&at, &mut gap, &mut vec![0.0; f.work_len()]).is_ok() && gap[0].abs() <= NEAR * size
        };
        let contacts = m.contacts.iter().filter(|c| !c.kind.has_no_normal());
        let held: Vec<&SharedFunction> =
            contacts.filter(|c| !c.kind.opens() || closed(&c.gap)).map(|c| &c.gap).collect();
        if held.is_empty() {
            None
        } else {
            self.target_with(&held)
        }
    }

    /// Controls `[n_stages · nu]` that move a scene along [`Ocp::way`] by inverse dynamics in the middle of every stage, within their bounds; those of the guess
    /// where they are not known. `None` where the system is no scene.
    pub(super) fn driven(&self, usual: &Sizes) -> Option<Vec<f64>> {
        let m = self.system.mechanics().filter(|m| m.order == Order::Second)?;
        let (d, mut controls) = (self.system.dims(), self.within_bounds(self.control_guess()));
        let ends = stage_times(0.0, &self.durations);
        let middle = |k: usize| 0.5 * (ends[k] + ends[k + 1]);
        let (grid, inner) = (self.way(&ends), self.way(&(0..self.n_stages).map(middle).collect::<Vec<f64>>()));
        let size = |j: usize| match self.u_bounds[1][j] - self.u_bounds[0][j] {
            w if w.is_finite() && w > 0.0 => 0.5 * w,
            _ => usual.u.get(j).copied().unwrap_or(1.0),
        };
        let sizes: Vec<f64> = (0..d.u).map(size).collect();
        let near = NEAR * usual.x[..m.n_q].iter().fold(0f64, |a, v| a.max(*v));
        let mut dynamics = Dynamics::new(m);
        for k in 0..self.n_stages {
            let [before, behind] = [&grid[k], &grid[k + 1]].map(|x| &x[m.velocities()]);
            let wanted: Vec<f64> = before.iter().zip(behind).map(|(a, b)| (b - a) / self.durations[k]).collect();
            let u = &mut controls[k * d.u..(k + 1) * d.u];
            let at = Point { t: self.t0 + middle(k), x: &inner[k], u, p: self.params_of(k) };
            let found = dynamics.drive(&at, &wanted, (&sizes, &usual.x[m.velocities()]), near);
            if let Ok(Some(change)) = found {
                u.iter_mut().zip(&change).for_each(|(u, c)| *u += c);
            }
        }
        Some(self.within_bounds(controls))
    }

    /// Rates of the coordinates of a scene, and their derivatives by the velocities, which they are linear in.
    fn rates(&self, m: &Mechanics, x: &[f64]) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let (f, u) = (&m.smooth, self.control_guess());
        let (d, pattern) = (f.dims(), f.jac_pattern());
        let mut p = self.params_of(0).to_vec();
        p.resize(d.p, 0.0);
        let at = Point { t: self.t0, x, u: &u[..d.u], p: &p };
        let mut work = vec![0.0; f.work_len()];
        let (mut rates, mut entries) = (vec![0.0; f.n_out()], vec![0.0; pattern.nnz()]);
        f.value(&at, &mut rates, &mut work).and_then(|()| f.jacobian(&at, &mut entries, &mut work)).ok()?;
        let mut by = DMatrix::zeros(m.n_q, m.n_v);
        for j in m.velocities() {
            for (&i, v) in pattern.rows(j).iter().zip(&entries[pattern.range(j)]).filter(|(i, _)| **i < m.n_q) {
                by[(i, j - m.n_q)] = *v;
            }
        }
        rates.truncate(m.n_q);
        Some((rates, by))
    }
}
