//! Starting points: what was given, a constant, a simulation, a smoothed one, or the solution of an easier problem.

use super::extend::Extended;
use super::{CostAt, Ocp, SLACK};
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::event::{self, Engine};
use crate::fesd::{Fesd, Options, Spec};
use crate::func::{Callback, EvalError, Point};
use crate::linalg::cholesky;
use crate::linalg::csc::Pattern;
use crate::mpcc::{MpccSettings, MpccSolver};
use crate::nlp::{middles, Control, Nlp, Outcome};
use crate::settings::{Discretisation, InitialGuess};
use crate::sim::{Simulator, SolveOptions};
use crate::system::{SharedFunction, System};

/// Tolerance of simulations that are guesses, and their steps at most.
const TOLERANCE: f64 = 1e-6;
const MAX_STEPS: usize = 100_000;
/// Points of a simulation that are kept for every element.
const POINTS: usize = 3;
/// Steps to a state that meets the terminal conditions, and the share of the first violation that counts as none.
const TARGET_STEPS: usize = 20;
const TARGET_MET: f64 = 1e-6;
/// Relaxation at which the problem on fixed steps is left.
const EARLY: f64 = 0.1;

/// States at times from the start of the horizon, controls of every stage.
pub(super) struct Guess {
    times: Vec<f64>,
    states: Vec<f64>,
    controls: Vec<f64>,
    /// Weights and multipliers are to fit the states.
    pairs: bool,
}

impl Guess {
    /// States at a time.
    pub fn state(&self, t: f64, x: &mut [f64]) {
        interpolate(&self.times, &self.states, t, x);
    }
}

impl Ocp {
    /// The point a cold solve starts from, and what it was made of.
    pub(super) fn starting_point(
        &self,
        problem: &mut Fesd,
        e: &Extended,
        stage_params: &[f64],
        options: &SolveOptions,
        control: &mut Control,
    ) -> Result<(Vec<f64>, Guess)> {
        let guess = self.make_guess(problem, e, stage_params, options, control)?;
        let mut w = vec![0.0; problem.n()];
        self.write_guess(problem, &guess, &mut w);
        if guess.pairs && problem.relax_pairs(&mut w, options.solver.sigma_init).is_err() {
            // without values the multipliers stay as they were written
            problem.forget_trouble();
        }
        if problem.write_members(&mut w).is_err() {
            problem.forget_trouble();
        }
        Ok((w, guess))
    }

    fn write_guess(&self, problem: &Fesd, guess: &Guess, w: &mut [f64]) {
        let nu = self.system.dims().u;
        problem.guess(
            w,
            self.t0,
            |t, x| guess.state(t, x),
            |k, u| {
                u[..nu].copy_from_slice(&guess.controls[k * nu..(k + 1) * nu]);
                u[nu..].fill(SLACK);
            },
        );
    }

    fn make_guess(
        &self,
        problem: &Fesd,
        e: &Extended,
        stage_params: &[f64],
        options: &SolveOptions,
        control: &mut Control,
    ) -> Result<Guess> {
        let controls = self.control_guess();
        if let Some((times, states)) = &self.x_guess {
            return Ok(Guess { times: times.clone(), states: states.clone(), controls, pairs: false });
        }
        let x0: Vec<f64> = middles(&self.x0_bounds);
        let constant = Guess { times: vec![0.0], states: x0.clone(), controls, pairs: false };
        let mut kind = options.initial_guess;
        if self.modes.is_some() && kind == InitialGuess::Constant {
            // a branch problem wants states on the right side of its switches
            kind = InitialGuess::Simulation;
        }
        let system = match kind {
            InitialGuess::Constant => return Ok(constant),
            InitialGuess::TimeStepping => {
                return self.on_fixed_steps(problem, e, stage_params, options, constant, control)
            }
            InitialGuess::Simulation => Ok(self.system.clone()),
            InitialGuess::Smoothed => self.smoothed(options),
        };
        let loose = self.loose(TOLERANCE, MAX_STEPS);
        let n_fe = &problem.spec().n_fe;
        let (times, states) = match system.and_then(|s| Engine::stopping_for_all(&s, &loose)) {
            Ok(mut engine) => self.by_events(&mut engine, &x0, &constant.controls, n_fe)?,
            Err(Error::Unsupported(_)) => self.by_elements(&x0, &constant.controls, options, control)?,
            Err(e) => return Err(e),
        };
        Ok(Guess { times, states, pairs: kind == InitialGuess::Smoothed, ..constant })
    }

    /// A state at which the terminal constraints hold and terminal least squares vanish, near the initial one: minimal
    /// steps of Gauss and Newton. `None` where there is nothing to reach, or it is not reached.
    pub(super) fn target(&self) -> Option<Vec<f64>> {
        self.target_with(&[])
    }

    /// The same where these functions of the states keep vanishing: equations that hold already are part of every step then.
    pub(super) fn target_with(&self, held: &[&SharedFunction]) -> Option<Vec<f64>> {
        let none = vec![0.0; held.iter().map(|f| f.n_out()).max().unwrap_or(0)];
        let d = self.system.dims();
        let mut x: Vec<f64> = middles(&self.x0_bounds);
        let start = x.clone();
        let u = self.control_guess();
        let t = self.t0 + self.durations.iter().sum::<f64>();
        let last = &u[(self.n_stages - 1) * d.u..];
        let wanted: Vec<(&SharedFunction, &[f64], &[f64])> = self
            .terminal
            .iter()
            .map(|e| (&e.f, &e.lower[..], &e.upper[..]))
            .chain(
                self.squares
                    .iter()
                    .filter(|q| q.place == CostAt::Terminal)
                    .map(|q| (&q.f, &q.references[..], &q.references[..])),
            )
            .chain(held.iter().map(|f| (*f, &none[..f.n_out()], &none[..f.n_out()])))
            .collect();
        let mut first = f64::NAN;
        for step in 0..=TARGET_STEPS {
            let at = Point { t, x: &x, u: last, p: self.params_of(self.n_stages - 1) };
            // rows of the violated conditions and how far they are from their bounds
            let (mut rows, mut off): (Vec<Vec<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
            for (f, lower, upper) in &wanted {
                let values = value(f, &at).ok()?;
                let p = f.jac_pattern();
                let mut jac = vec![0.0; p.nnz()];
                f.jacobian(&at, &mut jac, &mut vec![0.0; f.work_len()]).ok()?;
                for (i, v) in values.iter().enumerate() {
                    let miss = v.clamp(lower[i], upper[i]) - v;
                    let row: Vec<f64> = (0..d.x).map(|j| p.get(i, j).map_or(0.0, |k| jac[k])).collect();
                    let counts = miss != 0.0 || !held.is_empty() && lower[i] == upper[i];
                    if counts && row.iter().any(|v| *v != 0.0) {
                        rows.push(row);
                        off.push(miss);
                    }
                }
            }
            let size = off.iter().fold(0f64, |a, v| a.max(v.abs()));
            if step == 0 {
                first = size;
            }
            if size <= TARGET_MET * first {
                return (x != start).then_some(x);
            }
            let n = rows.len();
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let mut gram: Vec<f64> = (0..n * n).map(|k| product(&rows[k % n], &rows[k / n])).collect();
            for i in 0..n {
                // dependent conditions share the step
                gram[i * n + i] *= 1.0 + 1e-9;
            }
            if !cholesky::factorise(n, &mut gram) {
                return None;
            }
            cholesky::solve(&gram, &mut off);
            for (row, v) in rows.iter().zip(&off) {
                x.iter_mut().zip(row).for_each(|(x, r)| *x += r * v);
            }
        }
        None
    }

    /// Controls as given, or in the middle of their bounds.
    pub(super) fn control_guess(&self) -> Vec<f64> {
        if let Some(u) = &self.u_guess {
            return u.clone();
        }
        if let Some(chosen) = &self.chosen {
            return middles(chosen);
        }
        let one: Vec<f64> = middles(&self.u_bounds);
        one.repeat(self.n_stages)
    }

    /// Controls to simulate: those of the guess, and where none were given and they have bounds also their extremes in two
    /// halves and all along.
    pub(super) fn extremes(&self) -> Vec<Vec<f64>> {
        let mut all = vec![self.control_guess()];
        let [lower, upper] = &self.u_bounds;
        let bounded = lower.iter().chain(upper).all(|v| v.is_finite());
        if self.u_guess.is_some() || !bounded || lower.is_empty() {
            return all;
        }
        let half = self.n_stages.div_ceil(2);
        for (first, second) in [(upper, lower), (lower, upper), (upper, upper), (lower, lower)] {
            all.push((0..self.n_stages).flat_map(|k| if k < half { first } else { second }.clone()).collect());
        }
        all.into_iter().map(|u| self.within_bounds(u)).collect()
    }

    pub(super) fn params_of(&self, stage: usize) -> &[f64] {
        let np = self.params.len();
        self.stage_params.as_ref().map_or(&self.params[..], |s| &s[stage * np..(stage + 1) * np])
    }

    /// Simulates by events. What fails half way is still a better start than a constant.
    fn by_events(
        &self,
        engine: &mut Engine,
        x0: &[f64],
        controls: &[f64],
        n_fe: &[usize],
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        let (mut times, mut states) = (vec![0.0], x0.to_vec());
        let nu = self.system.dims().u;
        let mut start = 0.0;
        engine.reinit(self.t0, x0)?;
        for (k, &length) in self.durations.iter().enumerate() {
            engine.set_params(self.params_of(k))?;
            engine.set_controls(&controls[k * nu..(k + 1) * nu])?;
            let n = POINTS * n_fe[k];
            for i in 1..=n {
                let t = start + length * i as f64 / n as f64;
                match engine.advance(self.t0 + t) {
                    Ok(event::Outcome::Reached) => {}
                    // the solve that is to start there is asked to end as well, and says so
                    Ok(_) | Err(Error::Interrupted | Error::OutOfTime) => return Ok((times, states)),
                    Err(e) => return Err(e),
                }
                times.push(t);
                states.extend_from_slice(engine.state());
            }
            start += length;
        }
        Ok((times, states))
    }

    /// Simulates by finite elements, for systems that the engine does not know.
    fn by_elements(
        &self,
        x0: &[f64],
        controls: &[f64],
        options: &SolveOptions,
        control: &mut Control,
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        let (mut times, mut states) = (vec![0.0], x0.to_vec());
        let nu = self.system.dims().u;
        let mut sim = Simulator::with_options(&self.system, options)?;
        sim.set_state(self.t0, x0)?;
        for k in 0..self.n_stages {
            sim.set_params(self.params_of(k))?;
            sim.set_controls(&controls[k * nu..(k + 1) * nu])?;
            let mut inner = control.quiet();
            let r = sim.run(self.durations[k], 1, &mut inner)?;
            for e in r.trajectory.elements.iter().filter(|e| e.h > 1e-12) {
                times.push(e.t + e.h - self.t0);
                states.extend_from_slice(&e.x1);
            }
            if r.outcome != Outcome::Solved {
                break;
            }
        }
        Ok((times, states))
    }

    /// The system with the weights of the relaxation that the homotopy starts with: it does not switch.
    fn smoothed(&self, options: &SolveOptions) -> Result<System> {
        let d = self.system.dims();
        if self.system.n_algebraic() > 0 {
            return Err(Error::Unsupported("a smoothed system is an ordinary differential equation".into()));
        }
        let dcs = Dcs::new(&self.system, options.form)?;
        let sigma = options.solver.sigma_init;
        let field = Callback::new("smoothed", d, d.x, move |at, out| code(smoothed_field(&dcs, sigma, at, out)));
        let mut s = System::new(d.x, d.u, d.p)?;
        s.set_f0(std::sync::Arc::new(field.with_jacobian_pattern(Pattern::dense(d.x, d.n_in()))?))?;
        Ok(s)
    }

    /// The problem with fixed steps, solved to where the homotopy has not decided much.
    fn on_fixed_steps(
        &self,
        problem: &Fesd,
        e: &Extended,
        stage_params: &[f64],
        options: &SolveOptions,
        constant: Guess,
        control: &mut Control,
    ) -> Result<Guess> {
        let spec = problem.spec();
        let on_grid = Options { discretisation: Discretisation::Standard, ..spec.options };
        let mut fixed = Fesd::new(Spec { options: on_grid, ..spec.clone() }, self.durations[0])?;
        let sigma_min = EARLY.min(options.solver.sigma_init);
        let settings = MpccSettings { polish: false, certify: false, sigma_min, ..options.solver };
        let mut solver = MpccSolver::new(&mut fixed, settings)?;
        let mut bounds = fixed.bounds();
        self.write_data(&mut fixed, &mut bounds, e, stage_params)?;
        let mut w = vec![0.0; fixed.n()];
        self.write_guess(&fixed, &constant, &mut w);
        let mut inner = control.quiet();
        let found = solver.solve(&mut fixed, &bounds, &w, &mut inner);
        if matches!(found.outcome, Outcome::Failed | Outcome::Diverging) {
            return Ok(constant);
        }
        let w = &found.x;
        let (d, wide) = (self.system.dims(), e.system.dims().u);
        let (x, u) = (fixed.end_states(w), fixed.controls(w));
        let mut guess = Guess { times: Vec::new(), states: Vec::new(), controls: Vec::new(), pairs: false };
        for k in 0..self.n_stages {
            guess.controls.extend_from_slice(&u[k * wide..k * wide + d.u]);
        }
        let mut start = 0.0;
        let mut ends = x.chunks_exact(d.x);
        guess.times.push(0.0);
        guess.states.extend(ends.next().unwrap_or(&constant.states));
        for (&length, &n) in self.durations.iter().zip(&spec.n_fe) {
            for i in 1..=n {
                guess.times.push(start + length * i as f64 / n as f64);
                guess.states.extend(ends.next().unwrap_or(&constant.states));
            }
            start += length;
        }
        Ok(guess)
    }
}

fn code(r: std::result::Result<(), EvalError>) -> i32 {
    match r {
        Ok(()) => 0,
        Err(EvalError::Recoverable) => 1,
        Err(EvalError::Fatal(code)) => code,
        // asked again before the next evaluation
        Err(EvalError::Stopped) => 1,
    }
}

/// `f0 + Σ θ_σ F`, with `θ_σ` of the relaxed conditions at the point.
fn smoothed_field(dcs: &Dcs, sigma: f64, at: &Point, out: &mut [f64]) -> std::result::Result<(), EvalError> {
    let form = dcs.form();
    let sources: Vec<Vec<f64>> = form.sources.iter().map(|f| value(f, at)).collect::<std::result::Result<_, _>>()?;
    let combine = |source: usize, w: &[f64]| w.iter().zip(&sources[source]).map(|(a, b)| a * b).sum::<f64>();
    let rows: Vec<f64> = form.rows.iter().map(|r| combine(r.source, &r.weights)).collect();
    let mut theta = vec![0.0; form.n_weights()];
    form.relaxed(&rows, sigma, &mut theta, &mut vec![0.0; form.n_cells], &mut vec![0.0; form.n_mu]);
    out.fill(0.0);
    for d in dcs.drifts() {
        for (&r, v) in d.rows.iter().zip(value(&d.f, at)?) {
            out[r] += v;
        }
    }
    for t in &form.terms {
        let modes = value(&t.modes, at)?;
        for (columns, weights) in modes.chunks_exact(t.rows.len()).zip(&t.weights) {
            let weight: f64 = weights.iter().map(|w| theta[*w]).sum();
            t.rows.iter().zip(columns).for_each(|(&r, v)| out[r] += weight * v);
        }
    }
    for i in &form.inclusions {
        let x: Vec<f64> = at.x.iter().copied().chain(i.alpha.iter().map(|a| theta[*a])).collect();
        for (&r, v) in i.rows.iter().zip(value(&i.f, &Point { x: &x, ..*at })?) {
            out[r] += v;
        }
    }
    Ok(())
}

fn value(f: &SharedFunction, at: &Point) -> std::result::Result<Vec<f64>, EvalError> {
    let mut out = vec![0.0; f.n_out()];
    f.value(at, &mut out, &mut vec![0.0; f.work_len()]).map(|()| out)
}

pub(super) fn interpolate(times: &[f64], states: &[f64], t: f64, x: &mut [f64]) {
    let nx = x.len();
    let k = times.partition_point(|&s| s <= t).clamp(1, times.len());
    let a = &states[(k - 1) * nx..k * nx];
    if k == times.len() {
        x.copy_from_slice(a);
        return;
    }
    let b = &states[k * nx..(k + 1) * nx];
    let s = ((t - times[k - 1]) / (times[k] - times[k - 1])).clamp(0.0, 1.0);
    for i in 0..nx {
        x[i] = (1.0 - s) * a[i] + s * b[i];
    }
}
