//! Moving horizon estimation: states, constant parameters and process noise of the last samples from what was measured.
//!
//! ```text
//! min  ½ |x_0 − m|²_{P⁻¹} + Σ_k ½ |w_k|²_{Q⁻¹} + Σ_k ½ |y_k − h(x_k)|²_{R⁻¹}
//! s.t. x_{k+1} = ψ_k(x_k, u_k) + w_k,   l ≤ x_k ≤ u
//! ```
//!
//! over the last `n` stages (C. Rao, J. Rawlings, D. Mayne, *Constrained state estimation for nonlinear discrete-time systems*, 2003). A sample is an iteration of Gauss and
//! Newton: [`Mhe::prepare`] linearises and factorises, [`Mhe::estimate`] embeds the measurement. What leaves the window is kept in the arrival
//! cost, `m` and `P`, by an update that linearises at the estimate (P. Kühl, M. Diehl, T. Kraus, J. Schlöder, H. Bock, *A real-time algorithm for moving horizon
//! state and parameter estimation*, 2011): for linear systems without bounds the last state is that of the Kalman filter.

use super::arrival::Arrival;
use super::controller::ELASTIC;
use super::evaluate::{has_value, Many};
use super::options::{Options as Controls, Source};
use super::problem;
use super::stage::{Stage, Starts};
use crate::error::{finite, Error, Result};
use crate::func::EvalResult;
use crate::ocp::Ocp;
use crate::qp::{Initial, QpSolution, QpSolver, QpStatus, Row, StageQp, Stagewise, Terms};
use crate::system::SharedFunction;
use crate::tableau::Family;
use std::time::{Duration, Instant};

/// Options of an estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct MheOptions {
    /// Iterations per sample at most; those behind the first linearise within [`Mhe::estimate`].
    pub iterations: usize,
    /// They end where a step is below this share of the standard deviations of the start.
    pub tol: f64,
    /// Seconds that [`Mhe::estimate`] may take, infinite for as many as it needs; checked in every iteration.
    pub deadline: f64,
    /// Runge-Kutta family of the model; that of the problem's settings without it.
    pub family: Option<Family>,
    /// Stages of the method, 0: as the problem's settings say.
    pub n_s: usize,
    /// Steps in every stage, 0: as many as the settings have finite elements.
    pub steps: usize,
}

impl Default for MheOptions {
    fn default() -> MheOptions {
        MheOptions { iterations: 1, tol: 1e-8, deadline: f64::INFINITY, family: None, n_s: 0, steps: 0 }
    }
}

/// Standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise<'a> {
    /// Of the states at the start `[nx]`, positive.
    pub initial: &'a [f64],
    /// Of what is added to the states in every stage `[nx]`; zero where nothing is. Constant parameters are states with a zero derivative and zero
    /// here, parameters that wander have the step of a random walk.
    pub process: &'a [f64],
    /// Of the measurements `[ny]`, positive.
    pub measurement: &'a [f64],
}

/// Result of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// [`Source::Qp`], [`Source::SoftQp`] where bounds cannot all be met, [`Source::Tangent`] where the deadline came first, [`Source::Plan`] where the
    /// state is a prediction, since functions have no value.
    pub source: Source,
    /// How the last quadratic program ended.
    pub status: QpStatus,
    /// Iterations of Gauss and Newton.
    pub iterations: usize,
    /// Seconds.
    pub time: f64,
}

/// The last samples, node by node. The control of a node is that of the stage before it.
struct Window {
    x: Vec<f64>,
    w: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    t: Vec<f64>,
    y: Vec<f64>,
}

/// A moving horizon estimator. All memory is taken when it is made, but what contacts and transitions need.
pub struct Mhe {
    pub(super) options: MheOptions,
    pub(super) n: usize,
    pub(super) nx: usize,
    pub(super) nu: usize,
    pub(super) np: usize,
    pub(super) ny: usize,
    pub(super) switches: bool,
    pub(super) h: f64,
    lengths: Vec<f64>,
    pub(super) t0: f64,
    stage: Box<dyn Stage>,
    pub(super) one: Box<dyn Stage>,
    pub(super) measured: Many,
    first_measured: Many,
    pub(super) qp: StageQp,
    solver: Stagewise,
    step: QpSolution,
    /// The states that have noise, and its standard deviations; those of the measurements.
    pub(super) noisy: Vec<usize>,
    pub(super) process: Vec<f64>,
    pub(super) sigma: Vec<f64>,
    pub(super) deviations: Vec<f64>,
    pub(super) bounds: [Vec<f64>; 2],
    pub(super) bounded: Vec<usize>,
    window: Window,
    /// Parameters from now on.
    pub(super) params: Vec<f64>,
    samples: u64,
    /// Stages of the window that were; those before them do nothing.
    filled: usize,
    arrival: Arrival,
    filter: Arrival,
    pub(super) start: Vec<f64>,
    /// There is a program for the next measurement; it counts on all outputs.
    ready: bool,
    estimated: bool,
    predicted: Vec<f64>,
    next: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    jac: Vec<f64>,
    residual: Vec<f64>,
}

fn refuse<T>(what: &str) -> Result<T> {
    Err(Error::Unsupported(format!("an estimator does not know {what}")))
}

fn deviations(what: &str, v: &[f64], n: usize, zero: bool) -> Result<()> {
    finite(what, v, n)?;
    // weights are squares of their inverses
    let bad = |v: f64| v < 0.0 || (v == 0.0 && !zero) || (v > 0.0 && !(v * v).recip().is_normal());
    match v.iter().position(|v| bad(*v)) {
        None => Ok(()),
        Some(i) => Err(Error::Range(format!(
            "{what} {i} is {}: standard deviations are {}, and numbers whose squares have an inverse",
            v[i],
            if zero { "not negative" } else { "positive" }
        ))),
    }
}

impl Mhe {
    /// An estimator for the system, the stages, the parameters and the bounds of states of a problem, which has no costs and no other constraints. Its stages are the samples of the
    /// window, all of the same length; its initial state is the mean before the first measurement. `measured` gives `y` by state, parameters, time
    /// and the control of the stage before.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for what an estimator does not know, in words; [`Error::Range`] for options or deviations out of their ranges;
    /// [`Error::Dimension`]; [`Error::State`] for an initial state or parameters without values.
    pub fn new(ocp: &Ocp, measured: &SharedFunction, noise: &Noise, options: &MheOptions) -> Result<Mhe> {
        let s = ocp.statement();
        s.system.check_without_choices("an estimator")?;
        let d = s.system.dims();
        let (n, nx, nu, np, ny) = (s.n_stages, d.x, d.u, d.p, measured.n_out());
        if s.system.n_algebraic() > 0 {
            return refuse("algebraic states");
        }
        if let Some(i) = s.system.discrete_states().first() {
            return Err(Error::Unsupported(format!(
                "an estimator does not know discrete states, which have no deviations: transitions name state {i}, let guards and resets do without it"
            )));
        }
        if s.lagrange.is_some() || s.mayer.is_some() || !s.squares.is_empty() {
            return refuse("costs: give it measurements and their deviations instead");
        }
        let constraints = [s.path.len(), s.terminal.len(), s.boundary.len(), s.soft.len(), s.complementarity.len()];
        if constraints != [0; 5] {
            return refuse("constraints other than bounds of states");
        }
        let h = s.durations[0];
        if s.durations.iter().any(|d| (d - h).abs() > f64::EPSILON.sqrt() * h) {
            return refuse("stages of different lengths");
        }
        let md = measured.dims();
        if (md.x, md.u, md.p) != (nx, nu, np) || ny == 0 {
            return Err(Error::Dimension(format!(
                "the measurement has {} states, {} controls, {} parameters and {ny} values, the system {nx}, {nu}, {np}",
                md.x, md.u, md.p
            )));
        }
        deviations("initial deviation", noise.initial, nx, false)?;
        deviations("deviation of the process", noise.process, nx, true)?;
        deviations("deviation of the measurement", noise.measurement, ny, false)?;
        if !(1..=10_000).contains(&options.iterations) {
            return Err(Error::Range("iterations are 1 to 10000".into()));
        }
        if !(options.tol > 0.0 && options.tol.is_finite()) || options.deadline.is_nan() || options.deadline <= 0.0 {
            return Err(Error::Range("tol and deadline are positive".into()));
        }
        if s.params.iter().any(|p| p.is_nan()) {
            return Err(Error::State("the parameters have no values: set them in the problem before".into()));
        }
        let [low, high] = s.x0_bounds;
        if low.iter().zip(high).any(|(l, h)| l != h || !l.is_finite()) {
            return Err(Error::State(
                "the problem has no initial state: it is the mean before the first measurement".into(),
            ));
        }
        let controls =
            Controls { family: options.family, n_s: options.n_s, steps: options.steps, ..Controls::default() };
        controls.validate()?;
        let switches = problem::switches(&s);
        let noisy: Vec<usize> = (0..nx).filter(|i| noise.process[*i] > 0.0).collect();
        let process: Vec<f64> = noisy.iter().map(|i| noise.process[*i]).collect();
        let [lower, upper] = s.x_bounds;
        let bounded: Vec<usize> = (0..nx).filter(|i| lower[*i].is_finite() || upper[*i].is_finite()).collect();
        let rows = (0..=n).flat_map(|node| bounded.iter().map(move |_| Row { node, price: None })).collect();
        let nw = noisy.len().max(1);
        let mut qp = StageQp::new(n, nx, nw, rows)?;
        qp.initial = Initial::Free(vec![0.0; nx * nx]);
        for k in 0..n {
            for j in 0..nw {
                qp.hess_u[k * nw * nw + j * (nw + 1)] = process.get(j).map_or(1.0, |s| 1.0 / (s * s));
            }
        }
        for (r, row) in qp.row_x.chunks_exact_mut(nx).enumerate() {
            row[bounded[r % bounded.len()]] = 1.0;
        }
        let mut own = Mhe {
            stage: problem::stage(ocp, &controls, n)?,
            one: problem::stage(ocp, &controls, 1)?,
            measured: Many::new(measured, n + 1, false),
            first_measured: Many::new(measured, 1, false),
            solver: Stagewise::new(&qp)?,
            step: QpSolution::new(&qp),
            arrival: Arrival::new(low, noise.initial, ny, noisy.len()),
            filter: Arrival::new(low, noise.initial, ny, noisy.len()),
            options: options.clone(),
            sigma: noise.measurement.to_vec(),
            deviations: noise.initial.to_vec(),
            bounds: [lower.clone(), upper.clone()],
            window: Window {
                x: vec![0.0; (n + 1) * nx],
                w: vec![0.0; n * nw],
                u: vec![0.0; (n + 1) * nu],
                p: vec![0.0; (n + 1) * np],
                t: vec![0.0; n + 1],
                y: vec![f64::NAN; (n + 1) * ny],
            },
            params: s.params.to_vec(),
            start: low.clone(),
            lengths: vec![h; n],
            predicted: vec![0.0; nx],
            next: vec![0.0; n * nx],
            a: vec![0.0; n * nx * nx],
            b: vec![0.0; n * nx * nu],
            jac: vec![0.0; ny * nx],
            residual: vec![0.0; ny],
            samples: 0,
            filled: 0,
            ready: false,
            estimated: false,
            t0: s.t0,
            noisy,
            process,
            bounded,
            qp,
            n,
            nx,
            nu,
            np,
            ny,
            switches,
            h,
        };
        let mean = own.start.clone();
        own.reset(&mean)?;
        Ok(own)
    }

    /// Number of stages of the window.
    pub fn n(&self) -> usize {
        self.n
    }

    /// States.
    pub fn nx(&self) -> usize {
        self.nx
    }

    /// Controls.
    pub fn nu(&self) -> usize {
        self.nu
    }

    /// Measurements of a sample.
    pub fn ny(&self) -> usize {
        self.ny
    }

    /// Stages of the window that were, `n` at most; the others in front of them do nothing.
    pub fn filled(&self) -> usize {
        self.filled
    }

    /// States of the window `[(n + 1) · nx]`, the last sample at its end.
    pub fn states(&self) -> &[f64] {
        &self.window.x
    }

    /// Noise of the window `[n]` stages of as many as [`Mhe::noisy`] has.
    pub fn noise(&self) -> &[f64] {
        if self.noisy.is_empty() {
            &[]
        } else {
            &self.window.w
        }
    }

    /// The states that have noise.
    pub fn noisy(&self) -> &[usize] {
        &self.noisy
    }

    /// Back to the start with the mean `x0[nx]`: nothing was measured.
    ///
    /// # Errors
    /// [`Error::Dimension`], [`Error::Range`]; those of [`Mhe::prepare`].
    pub fn reset(&mut self, x0: &[f64]) -> Result<()> {
        finite("initial state", x0, self.nx)?;
        self.start.copy_from_slice(x0);
        self.arrival.reset(x0);
        self.window.x.chunks_exact_mut(self.nx).for_each(|x| x.copy_from_slice(x0));
        self.window.w.fill(0.0);
        self.window.u.fill(0.0);
        self.window.y.fill(f64::NAN);
        if self.np > 0 {
            self.window.p.chunks_exact_mut(self.np).for_each(|p| p.copy_from_slice(&self.params));
        }
        (self.samples, self.filled, self.estimated) = (0, 0, false);
        self.window.t.fill(self.t0);
        self.solver.reset();
        self.linearise()
    }

    /// Sets the parameters `[np]` from the next preparation on; samples that were keep theirs.
    ///
    /// # Errors
    /// [`Error::Range`], [`Error::Dimension`].
    pub fn set_params(&mut self, p: &[f64]) -> Result<()> {
        finite("parameter", p, self.np)?;
        self.params.copy_from_slice(p);
        Ok(())
    }

    /// Goes to the next sample under the control `u[nu]`, and does everything for it that needs no measurement: arrival cost, prediction, linearisation,
    /// factors. True where there is a program.
    ///
    /// # Errors
    /// [`Error::Dimension`], [`Error::Range`]; [`Error::Interrupted`] if the call was to end; [`Error::User`] for a fatal code of a callback.
    pub fn prepare(&mut self, u: &[f64]) -> Result<bool> {
        finite("control", u, self.nu)?;
        let (n, nx, nu, np, ny) = (self.n, self.nx, self.nu, self.np, self.ny);
        // what ends the call ends it before the window moves
        self.predict(u)?;
        if self.filled == n && !has_value(self.leave())? {
            // the estimate of the second node is the mean, with what was known of the first
            self.arrival.follow(&self.window.x[nx..2 * nx], &self.noisy, &self.process);
        }
        let nw = self.qp.nu;
        self.window.x.copy_within(nx.., 0);
        self.window.w.copy_within(nw.., 0);
        self.window.u.copy_within(nu.., 0);
        self.window.p.copy_within(np.., 0);
        self.window.t.copy_within(1.., 0);
        self.window.y.copy_within(ny.., 0);
        self.window.w[(n - 1) * nw..].fill(0.0);
        self.window.u[n * nu..].copy_from_slice(u);
        self.window.p[n * np..].copy_from_slice(&self.params);
        self.window.y[n * ny..].fill(f64::NAN);
        self.samples += 1;
        self.window.t[n] = self.t0 + self.samples as f64 * self.h;
        self.filled = (self.filled + 1).min(n);
        self.window.x[n * nx..].copy_from_slice(&self.predicted);
        self.estimated = false;
        self.solver.shift(&self.qp);
        self.linearise()?;
        Ok(self.ready)
    }

    /// The state at the next sample under a control; the last one where functions have no value.
    fn predict(&mut self, u: &[f64]) -> Result<()> {
        let (n, nx, np) = (self.n, self.nx, self.np);
        let x = &self.window.x[n * nx..];
        let (p, t) = (&self.window.p[n * np..], &self.window.t[n..]);
        let outcome = self.one.values(&Starts { x, u, p, t, h: std::slice::from_ref(&self.h) }, &mut self.predicted);
        if !has_value(outcome)? || !self.predicted.iter().all(|v| v.is_finite()) {
            self.predicted.copy_from_slice(x);
        }
        Ok(())
    }

    /// A state at the next sample under a control, by the model, written over the state; false where functions have no value.
    pub(super) fn simulate(&mut self, u: &[f64], x: &mut [f64]) -> Result<bool> {
        let (p, t) = (&self.params[..], std::slice::from_ref(&self.window.t[self.n]));
        let outcome = self.one.values(&Starts { x, u, p, t, h: std::slice::from_ref(&self.h) }, &mut self.predicted);
        x.copy_from_slice(&self.predicted);
        Ok(has_value(outcome)? && x.iter().all(|v| v.is_finite()))
    }

    /// What is measured in a state of the last sample; false where functions have no value.
    pub(super) fn measure(&mut self, x: &[f64], u: &[f64], y: &mut [f64]) -> Result<bool> {
        self.first_measured.set(0, self.window.t[self.n], x, u, &self.params);
        let outcome = self.first_measured.values();
        y.copy_from_slice(&self.first_measured.value);
        Ok(has_value(outcome)? && y.iter().all(|v| v.is_finite()))
    }

    /// The first node leaves the window: what it knows of the second one is kept.
    fn leave(&mut self) -> EvalResult {
        let (nx, nu, np, ny) = (self.nx, self.nu, self.np, self.ny);
        let x = &self.window.x[..nx];
        self.first_measured.set(0, self.window.t[0], x, &self.window.u[..nu], &self.window.p[..np]);
        self.first_measured.values()?;
        self.first_measured.jacobians()?;
        self.first_measured.jacobian_by_states(0, nx, &mut self.jac);
        for i in 0..ny {
            let row = self.jac[i * nx..(i + 1) * nx].iter().zip(self.arrival.mean.iter().zip(x));
            let shift: f64 = row.map(|(h, (m, x))| h * (m - x)).sum();
            self.residual[i] = self.window.y[i] - self.first_measured.value[i] - shift;
        }
        let at = Starts {
            x,
            u: &self.window.u[nu..2 * nu],
            p: &self.window.p[..np],
            t: &self.window.t[..1],
            h: std::slice::from_ref(&self.h),
        };
        let (next, a, b) = (&mut self.next[..nx], &mut self.a[..nx * nx], &mut self.b[..nx * nu]);
        self.one.linearise(&at, next, a, b, None)?;
        self.arrival.measure(&self.jac, &self.sigma, &self.residual);
        self.arrival.pass([next, a, x], &self.noisy, &self.process);
        Ok(())
    }

    /// The program at the window.
    fn linearise(&mut self) -> Result<()> {
        self.ready = false;
        if has_value(self.evaluate())? {
            self.write();
            self.ready = self.solver.prepare(&self.qp);
        }
        Ok(())
    }

    /// Stages and measurements at the window.
    fn evaluate(&mut self) -> EvalResult {
        let (n, nx, nu, np) = (self.n, self.nx, self.nu, self.np);
        for k in 0..=n {
            let (x, u, p) = (
                &self.window.x[k * nx..(k + 1) * nx],
                &self.window.u[k * nu..(k + 1) * nu],
                &self.window.p[k * np..(k + 1) * np],
            );
            self.measured.set(k, self.window.t[k], x, u, p);
        }
        self.measured.values()?;
        self.measured.jacobians()?;
        let idle = n - self.filled;
        // stages of systems that switch are simulated one by one, and none that was not
        let (from, most) = if self.switches { (idle, 1) } else { (0, n) };
        for k in (from..n).step_by(most) {
            let at = Starts {
                x: &self.window.x[k * nx..(k + most) * nx],
                u: &self.window.u[(k + 1) * nu..(k + 1 + most) * nu],
                p: &self.window.p[k * np..(k + most) * np],
                t: &self.window.t[k..k + most],
                h: &self.lengths[k..k + most],
            };
            let next = &mut self.next[k * nx..(k + most) * nx];
            let a = &mut self.a[k * nx * nx..(k + most) * nx * nx];
            let b = &mut self.b[k * nx * nu..(k + most) * nx * nu];
            self.stage.linearise(&at, next, a, b, None)?;
        }
        Ok(())
    }

    /// The program of what was evaluated.
    fn write(&mut self) {
        let (n, nx, nw, idle) = (self.n, self.nx, self.qp.nu, self.n - self.filled);
        for k in 0..n {
            let a = &mut self.qp.a[k * nx * nx..(k + 1) * nx * nx];
            let b = &mut self.qp.b[k * nx * nw..(k + 1) * nx * nw];
            let c = &mut self.qp.c[k * nx..(k + 1) * nx];
            let (x, after) = self.window.x[k * nx..(k + 2) * nx].split_at(nx);
            let w = &self.window.w[k * nw..(k + 1) * nw];
            b.fill(0.0);
            if k < idle {
                a.fill(0.0);
                (0..nx).for_each(|i| a[i * (nx + 1)] = 1.0);
                c.iter_mut().zip(x.iter().zip(after)).for_each(|(c, (x, after))| *c = x - after);
            } else {
                a.copy_from_slice(&self.a[k * nx * nx..(k + 1) * nx * nx]);
                let next = &self.next[k * nx..(k + 1) * nx];
                c.iter_mut().zip(next.iter().zip(after)).for_each(|(c, (next, after))| *c = next - after);
                for (j, &i) in self.noisy.iter().enumerate() {
                    b[j * nx + i] = 1.0;
                    c[i] += w[j];
                }
            }
            for (j, w) in w.iter().enumerate() {
                self.qp.grad_u[k * nw + j] = self.qp.hess_u[k * nw * nw + j * (nw + 1)] * w;
            }
        }
        let many = self.bounded.len();
        for k in 0..=n {
            self.write_node(k);
            for (r, &i) in self.bounded.iter().enumerate() {
                // nodes that were not are the first one that was
                let there = k >= idle;
                let bound = |b: &[f64], none: f64| if there { b[i] - self.window.x[k * nx + i] } else { none };
                self.qp.row_lower[k * many + r] = bound(&self.bounds[0], f64::NEG_INFINITY);
                self.qp.row_upper[k * many + r] = bound(&self.bounds[1], f64::INFINITY);
            }
        }
        if let Initial::Free(weight) = &mut self.qp.initial {
            self.arrival.weight(weight);
        }
    }

    /// Was output `i` measured at node `k`? The last sample counts as complete until it is there.
    fn has(&self, k: usize, i: usize) -> bool {
        k >= self.n - self.filled && ((k == self.n && !self.estimated) || self.window.y[k * self.ny + i].is_finite())
    }

    /// What the measurements of node `k` cost.
    fn write_node(&mut self, k: usize) {
        let (nx, ny, points) = (self.nx, self.ny, self.n + 1);
        self.measured.jacobian_by_states(k, nx, &mut self.jac);
        self.qp.hess_x[k * nx * nx..(k + 1) * nx * nx].fill(0.0);
        self.qp.grad_x[k * nx..(k + 1) * nx].fill(0.0);
        for i in 0..ny {
            if !self.has(k, i) {
                continue;
            }
            let weight = 1.0 / (self.sigma[i] * self.sigma[i]);
            let gap = self.window.y[k * ny + i] - self.measured.value[i * points + k];
            // the gradient of a measurement that is to come is written when it is there
            let gap = if gap.is_finite() { gap } else { 0.0 };
            let row = &self.jac[i * nx..(i + 1) * nx];
            for (j, h) in row.iter().enumerate() {
                self.qp.grad_x[k * nx + j] -= weight * h * gap;
                let column = &mut self.qp.hess_x[(k * nx + j) * nx..(k * nx + j + 1) * nx];
                column.iter_mut().zip(row).for_each(|(v, l)| *v += weight * h * l);
            }
        }
    }

    /// The state `x[nx]` at the sample of the last preparation, or at the start, from its measurements `y[ny]`; those that are NaN were not made.
    ///
    /// # Errors
    /// [`Error::Dimension`]; [`Error::Range`] for an infinite measurement; [`Error::State`] where the sample has an estimate: call [`Mhe::prepare`];
    /// [`Error::Interrupted`], [`Error::User`] from iterations behind the first.
    pub fn estimate(&mut self, y: &[f64], x: &mut [f64]) -> Result<Estimate> {
        let start = Instant::now();
        let (n, nx, ny) = (self.n, self.nx, self.ny);
        if y.len() != ny || x.len() != nx {
            let (given, wanted) = (y.len(), x.len());
            return Err(Error::Dimension(format!(
                "an estimate of {nx} states from {ny} measurements: {wanted} and {given} given"
            )));
        }
        if let Some(i) = y.iter().position(|v| v.is_infinite()) {
            return Err(Error::Range(format!("measurement {i} is {}: a missing one is NaN", y[i])));
        }
        if self.estimated {
            return Err(Error::State("this sample has an estimate: call prepare for the next one".into()));
        }
        let limit = Duration::try_from_secs_f64(self.options.deadline).ok();
        let terms = Terms { deadline: limit.and_then(|d| start.checked_add(d)), ..Terms::default() };
        self.window.y[n * ny..].copy_from_slice(y);
        self.estimated = true;
        self.write_node(n);
        if self.ready && y.iter().any(|v| v.is_nan()) {
            self.ready = self.solver.prepare(&self.qp);
        }
        let (mut status, mut source, mut done) = (QpStatus::Failed, Source::Plan, 0);
        while done < self.options.iterations {
            if done > 0 {
                if terms.over(0) {
                    break;
                }
                self.linearise()?;
            }
            if !self.ready {
                break;
            }
            done += 1;
            let (size, outcome) = self.improve(&terms);
            (status, source) = outcome;
            if source == Source::Plan || size <= self.options.tol {
                break;
            }
        }
        x.copy_from_slice(&self.window.x[n * nx..]);
        Ok(Estimate { source, status, iterations: done, time: start.elapsed().as_secs_f64() })
    }

    /// A step; its size by the deviations of the start.
    fn improve(&mut self, terms: &Terms) -> (f64, (QpStatus, Source)) {
        let nx = self.nx;
        let mean = &mut self.step.lambda[..nx];
        mean.iter_mut().zip(self.arrival.mean.iter().zip(&self.window.x)).for_each(|(d, (m, x))| *d = m - x);
        let mut status = self.solver.solve(&self.qp, mean, terms);
        let mut source = Source::Qp;
        if status == QpStatus::Infeasible || (status == QpStatus::OutOfTime && !terms.over(0)) {
            let cost = self.solver.cost_of_rows(&self.qp);
            let largest = self.qp.grad_x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let scale = [cost, largest].into_iter().find(|v| *v > 0.0 && v.is_finite()).unwrap_or(1.0);
            status = self.solver.solve(&self.qp, mean, &Terms { elastic: Some(ELASTIC * scale), ..*terms });
            if self.solver.violates(&self.qp) {
                source = Source::SoftQp;
            }
        }
        match status {
            QpStatus::Solved => {}
            QpStatus::OutOfTime => source = Source::Tangent,
            _ => return (0.0, (status, Source::Plan)),
        }
        self.solver.expand(&self.qp, &mut self.step);
        let s = &self.step;
        if !s.x.iter().chain(&s.u).all(|v| v.is_finite()) {
            return (0.0, (QpStatus::Failed, Source::Plan));
        }
        let mut size = 0.0f64;
        for (x, (d, scale)) in self.window.x.iter_mut().zip(s.x.iter().zip(self.deviations.iter().cycle())) {
            *x += d;
            size = size.max(d.abs() / scale);
        }
        self.window.w.iter_mut().zip(&s.u).for_each(|(w, d)| *w += d);
        if source == Source::SoftQp {
            status = QpStatus::Infeasible;
        }
        (size, (status, source))
    }

    /// The covariance of the last state `[nx · nx]` by the linearisation of the last program, without regard of bounds.
    ///
    /// # Errors
    /// [`Error::Dimension`]; [`Error::State`] where there is no program.
    pub fn covariance(&mut self, out: &mut [f64]) -> Result<()> {
        let (n, nx, ny) = (self.n, self.nx, self.ny);
        if out.len() != nx * nx {
            return Err(Error::Dimension(format!("a covariance of {} entries, expected {}", out.len(), nx * nx)));
        }
        if !self.ready {
            return Err(Error::State("there is no program: functions have no value at the estimate".into()));
        }
        self.filter.copy_from(&self.arrival);
        for k in n - self.filled..=n {
            self.measured.jacobian_by_states(k, nx, &mut self.jac);
            self.residual.iter_mut().zip(&self.window.y[k * ny..]).for_each(|(e, y)| *e = 0.0 * y);
            self.filter.measure(&self.jac, &self.sigma, &self.residual);
            if k < n {
                // the root alone counts
                let a = &self.qp.a[k * nx * nx..(k + 1) * nx * nx];
                self.filter.pass([&self.start, a, &self.start], &self.noisy, &self.process);
            }
        }
        self.filter.covariance(out);
        Ok(())
    }
}
