//! How far an answer is from the system it is meant for: the controls found are simulated by the event-driven engine,
//! which shares neither equations nor grid with the discretisation, and the cost is integrated along. Systems that the
//! engine does not know, with inclusions or algebraic equations, are simulated by finite elements of another order on a
//! finer grid.

use super::between::{Between, Rows, Watch};
use super::rewire::Rewire;
use super::terms::Stack;
use crate::error::{Error, Result};
use crate::event::{Engine, Options, Outcome, Progress};
use crate::fesd;
use crate::func::{Dims, Point};
use crate::nlp::{self, Control};
use crate::settings::Discretisation;
use crate::sim::{Simulator, SolveOptions};
use crate::stop::{self, Why};
use crate::system::{combination, SharedFunction, System};
use crate::tableau::Family;

/// Steps the simulation may take: an answer that needs more is not worth the wait.
const MAX_STEPS: usize = 200_000;
/// Points of every step of a simulation at which its states are taken down: between them they are straight lines, and the slopes of the
/// guess are those.
const SAMPLES: usize = 16;

/// Comparison of an answer with the simulation of its controls.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// How the simulation ended, `None` where it was asked to end; what follows is NaN from where it did not get.
    pub outcome: Option<Outcome>,
    /// Why, where the end of the horizon is not reached.
    pub reason: String,
    /// Largest difference of a state at the end of every control stage `[n_stages]`.
    pub stages: Vec<f64>,
    /// The last of them: that at the end of the horizon.
    pub terminal: f64,
    /// Largest violation of a terminal constraint by the end of the simulation.
    pub terminal_violation: f64,
    /// Cost of the simulation.
    pub cost: f64,
    /// Cost of the answer less that of the simulation.
    pub cost_error: f64,
    /// Simulated state at the end `[nx]`.
    pub x_end: Vec<f64>,
    /// Switches of the simulation.
    pub n_switches: usize,
    /// Largest difference at the end of every stage where the simulation of the stage starts at the state of the answer:
    /// what the stage itself makes of the error, `[n_stages]`, NaN where it got stuck. Empty unless the grid is adapted, or the simulation
    /// is another motion.
    pub local: Vec<f64>,
    /// True where the simulation of some stage, from the state of the answer at its start, is another motion too.
    pub elsewhere: bool,
    /// Does a stage that is simulated by itself, from the state of the answer, lead elsewhere? Where the whole does not, modes are those of a past.
    pub(super) parts_ways: bool,
    /// Moduli of the differences of the states at the ends of the stages `[n_stages · nx]`, and the largest moduli of the states there `[nx]`, where
    /// the simulation reaches the end.
    differences: Vec<f64>,
    sizes: Vec<f64>,
    /// Share of its size by which a quantity may be off because the simulation is.
    noise: f64,
    /// The largest violation of every row of the path constraints and of every bound of a state in every control stage along the simulation, those
    /// that there are.
    pub along: Vec<Between>,
    /// The largest of the differences, in shares of their states, that nothing is certified beside, see [`Difference`].
    pub apart: Option<Difference>,
}

/// A state of the answer and of the simulation at the end of a control stage, further apart than [`APART`] of its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Control stage.
    pub stage: usize,
    /// State.
    pub state: usize,
    /// The difference.
    pub value: f64,
    /// Largest modulus of the state at the ends of the control stages, of the answer or of the simulation.
    pub size: f64,
}

impl Difference {
    /// The difference as a share of the size of the state.
    pub fn share(&self) -> f64 {
        self.value / self.size
    }
}

/// Share of the size of a state from which a difference contradicts what is said of an answer: it is the first-order change that counts as
/// none ([`super::optimality::NONE`]), and derivatives at another motion are off by a share of this order. The cost is a state of the simulation
/// like the others: from the same share of its size on it is another one.
const APART: f64 = super::optimality::NONE;
/// The same, from which the motion is another one: the root of [`APART`]. Derivatives explain a difference up to terms of the order of its square,
/// which count from here on.
const LARGE: f64 = 1e-2;
const _: () = assert!((LARGE * LARGE - APART).abs() <= 1e-9 * APART);
/// Share of its size by which a state is off at the end of a stage that is simulated by itself where the simulation has nothing to do with the
/// answer: neither an unstable system nor the error of a method makes that in one stage.
pub(super) const ELSEWHERE: f64 = 0.5;
/// Multiples of its tolerance up to which a difference may be the simulation's own: its errors add up.
const NOISE: f64 = 1e3;

impl Accuracy {
    /// What is known without a simulation.
    pub(super) fn unknown(n_stages: usize, nx: usize) -> Accuracy {
        Accuracy {
            outcome: None,
            reason: String::new(),
            stages: vec![f64::NAN; n_stages],
            terminal: f64::NAN,
            terminal_violation: f64::NAN,
            cost: f64::NAN,
            cost_error: f64::NAN,
            x_end: vec![f64::NAN; nx],
            n_switches: 0,
            local: Vec::new(),
            elsewhere: false,
            parts_ways: false,
            differences: Vec::new(),
            sizes: Vec::new(),
            noise: 0.0,
            along: Vec::new(),
            apart: None,
        }
    }

    /// A comparison that was asked to end before it began.
    pub(super) fn stopped(n_stages: usize, nx: usize, why: Why) -> Accuracy {
        Accuracy { reason: why.words().into(), ..Accuracy::unknown(n_stages, nx) }
    }

    /// True where the simulation reached the end of the horizon.
    pub fn reached(&self) -> bool {
        self.outcome == Some(Outcome::Reached)
    }

    /// Does it get to the end, and is it the motion of the answer?
    pub(super) fn follows(&self) -> bool {
        self.reached() && self.large().is_none()
    }

    /// The largest difference, where it says that the motion is another one.
    pub fn large(&self) -> Option<Difference> {
        self.apart.filter(|d| d.share() > LARGE)
    }

    /// Takes over what simulations of single stages say.
    pub(super) fn take_stages(&mut self, stages: &[Accuracy]) {
        let is_far = |a: &Accuracy| a.differences.iter().zip(&self.sizes).any(|(d, size)| *d > ELSEWHERE * size);
        self.parts_ways = stages.iter().any(is_far);
        self.elsewhere = self.parts_ways && self.large().is_some();
        self.local = stages.iter().map(|a| a.terminal).collect();
    }

    /// The largest violation along the simulation as a share of its size; `None` where there is none.
    pub fn between(&self) -> Option<Between> {
        self.along.iter().copied().max_by(|a, b| a.share().total_cmp(&b.share()))
    }

    /// The largest violation, where nothing is certified beside it.
    pub fn violated(&self) -> Option<Between> {
        self.between().filter(Accuracy::counts)
    }

    /// Is a violation more than what counts as none?
    pub(super) fn counts(b: &Between) -> bool {
        b.share() > APART
    }

    /// Does the simulation contradict the answer, whose cost has this size? One that was not finished says nothing.
    pub(super) fn contradicts(&self, cost_size: f64) -> bool {
        let other = self.apart.is_some() || self.violated().is_some() || self.costs_otherwise(cost_size);
        self.outcome.is_some() && (!self.reached() || other)
    }

    /// Is the cost of the simulation another one than that of the answer, which has this size?
    pub(super) fn costs_otherwise(&self, cost_size: f64) -> bool {
        self.cost_error.is_nan() || self.cost_error.abs() > APART.max(self.noise) * cost_size
    }
}

/// What is simulated: piecewise constant inputs, and what they are compared with.
pub(super) struct Answer<'a> {
    /// Usual sizes of the states.
    pub usual: &'a [f64],
    pub t0: f64,
    pub x0: &'a [f64],
    /// Lengths of the control stages.
    pub durations: &'a [f64],
    /// Controls `[n_stages · nu]` and parameters `[n_stages · np]`.
    pub controls: &'a [f64],
    /// Controls at the ends of the stages, and which are linear in between.
    pub control_ends: &'a [f64],
    pub linear: &'a [bool],
    pub params: &'a [f64],
    /// States at the ends of the stages `[n_stages · nx]`.
    pub states: &'a [f64],
    /// Of every stage with an event at its end the state on the other side of that: which side a simulation is on at that time is rounding.
    /// Empty where no events are known.
    pub beside: &'a [Option<Vec<f64>>],
    pub cost: f64,
    /// Size of the cost for tolerances.
    pub cost_size: f64,
    pub mayer: Option<&'a SharedFunction>,
    /// Cost at the end of every stage.
    pub grid_cost: Option<&'a SharedFunction>,
    /// Tolerance of the simulation.
    pub tol: f64,
    /// Terminal constraints with their bounds.
    pub terminal: Vec<(&'a SharedFunction, &'a [f64], &'a [f64])>,
    /// Constraints along the horizon, and bounds of the states; empty where nobody looks at them.
    pub path: Vec<Rows<'a>>,
    pub x_bounds: [&'a [f64]; 2],
}

impl Answer<'_> {
    /// What the first stage is simulated from and with: the state behind cost and ramps, the place of the answer's states
    /// in it, and the controls.
    fn start(&self) -> (Vec<f64>, usize, Vec<f64>) {
        let nu = self.controls.len() / self.durations.len();
        let ramps = (0..self.linear.len()).filter(|&j| self.linear[j]);
        let mut start = vec![0.0];
        let mut u = self.controls[..nu].to_vec();
        for j in ramps {
            start.push(u[j]);
            u[j] = (self.control_ends[j] - u[j]) / self.durations[0].max(f64::MIN_POSITIVE);
        }
        let first = start.len();
        start.extend_from_slice(self.x0);
        (start, first, u)
    }

    /// The stages as answers of their own, without costs at their ends.
    pub fn by_stage(&self) -> Vec<Answer<'_>> {
        let n = self.durations.len();
        let (nx, nu, np) = (self.x0.len(), self.controls.len() / n, self.params.len() / n);
        let mut t0 = self.t0;
        let stage = |k: usize| {
            let start = t0;
            t0 += self.durations[k];
            Answer {
                usual: self.usual,
                t0: start,
                x0: if k == 0 { self.x0 } else { &self.states[(k - 1) * nx..k * nx] },
                durations: &self.durations[k..=k],
                controls: &self.controls[k * nu..(k + 1) * nu],
                control_ends: &self.control_ends[k * nu..(k + 1) * nu],
                linear: self.linear,
                params: &self.params[k * np..(k + 1) * np],
                states: &self.states[k * nx..(k + 1) * nx],
                beside: &self.beside[k.min(self.beside.len())..(k + 1).min(self.beside.len())],
                cost: 0.0,
                cost_size: self.cost_size,
                mayer: None,
                grid_cost: None,
                tol: self.tol,
                terminal: Vec::new(),
                path: Vec::new(),
                x_bounds: [&[], &[]],
            }
        };
        (0..n).map(stage).collect()
    }
}

/// What simulates answers, made for one tolerance and one set of options.
pub(super) struct Replay {
    method: Method,
    tol: f64,
    /// Sizes of what is simulated, which the absolute tolerances are relative to.
    sizes: Vec<f64>,
    options: SolveOptions,
}

enum Method {
    /// The event-driven engine.
    Events(Box<Engine>),
    /// The same for projected systems with constant controls, which need no states beside them.
    Projected(Box<Projected>),
    /// For systems that it does not know: more accurate finite elements on a grid of their own.
    Elements(Box<Elements>),
}

/// A projected system as events follow it, with its cost by quadrature along the motion.
pub(super) struct Projected {
    engine: Engine,
    lagrange: Option<SharedFunction>,
    /// Controls and parameters of the system; what is behind them belongs to costs and constraints.
    dims: Dims,
    /// The cost so far, and the state.
    reached: Vec<f64>,
}

impl Projected {
    fn advance(&mut self, t: f64, u: &[f64], p: &[f64]) -> Result<Outcome> {
        let start = self.engine.time();
        self.engine.set_params(&p[..self.dims.p])?;
        self.engine.set_controls(&u[..self.dims.u])?;
        let outcome = self.engine.advance(t.max(start))?;
        self.reached[1..].copy_from_slice(self.engine.state());
        if let (Some(l), Some(path)) = (&self.lagrange, self.engine.path()) {
            self.reached[0] += path.integrate(start, &mut |t, x| values(l, &Point { t, x, u, p })[0])?;
        }
        Ok(outcome)
    }
}

/// Stage points and steps per control stage of simulations by finite elements: of another order than the answer's.
const STAGES: usize = 5;
const STEPS: usize = 8;

/// A simulation by finite elements, and what it met.
pub(super) struct Elements {
    simulator: Simulator,
    duration: f64,
    switches: Vec<f64>,
    reason: String,
}

impl Elements {
    /// Simulates a control stage that ends at `t`, and tells `look` times and states at the ends of its elements.
    fn advance(&mut self, t: f64, u: &[f64], p: &[f64], look: &mut dyn FnMut(f64, &[f64])) -> Result<Outcome> {
        self.simulator.set_params(p)?;
        self.simulator.set_controls(u)?;
        self.duration = t - self.simulator.time();
        if self.duration <= 0.0 {
            return Ok(Outcome::Reached);
        }
        let r = self.simulator.run(self.duration, STEPS, &mut Control::default())?;
        stop::check()?;
        self.switches.extend(r.trajectory.switches.iter().map(|s| s.t));
        r.trajectory.elements.iter().for_each(|e| look(e.t + e.h, &e.x1));
        self.reason = format!("the simulation by finite elements ended: {}", r.outcome.name());
        Ok(if r.outcome == nlp::Outcome::Solved { Outcome::Reached } else { Outcome::NoContinuation })
    }
}

/// Share of its usual size below which what a state is on the way says nothing of its size: it may be rounding.
pub(super) const LITTLE: f64 = 1e-3;

/// Sizes of cost, linear controls and states of an answer, in the order of [`with_cost`]: their largest moduli; 1 for states
/// and controls that are zero throughout.
fn sizes_of(a: &Answer) -> Vec<f64> {
    let nx = a.x0.len();
    let nu = a.linear.len();
    let largest = |values: &mut dyn Iterator<Item = f64>| match values.fold(0f64, |m, v| m.max(v.abs())) {
        m if m > 0.0 && m.is_finite() => m,
        _ => 1.0,
    };
    let ramp = |j: usize| largest(&mut a.controls.iter().chain(a.control_ends).skip(j).step_by(nu).copied());
    let state =
        |i: usize| largest(&mut a.states.iter().skip(i).step_by(nx).copied().chain([a.x0[i], LITTLE * a.usual[i]]));
    let ramps = (0..nu).filter(|&j| a.linear[j]).map(ramp);
    std::iter::once(a.cost_size).chain(ramps).chain((0..nx).map(state)).collect()
}

/// Tolerances of a simulation of quantities of these sizes.
pub(super) fn tolerances(tol: f64, sizes: &[f64]) -> Options {
    Options { atol: sizes.iter().map(|s| tol * s).collect(), ..Options::with_tolerance(tol, tol) }
}

/// Factor by which sizes may differ and still be the same for the tolerances of a simulation.
const ALIKE: f64 = 10.0;

impl Replay {
    /// Of the system behind its cost and its linear controls, all of them states; the place of these among the controls is
    /// that of their slopes. What is simulated says how large they are. `projected` is the system as events follow it where the other is
    /// its form for finite elements.
    pub fn new(
        system: &System,
        projected: Option<&System>,
        lagrange: Option<&SharedFunction>,
        answer: &Answer,
        options: &SolveOptions,
    ) -> Result<Replay> {
        let tol = answer.tol;
        if let Some(projected) = projected.filter(|_| !answer.linear.contains(&true)) {
            let sizes = sizes_of(answer);
            let loose = Options { max_steps: MAX_STEPS, dense: true, ..tolerances(tol, &sizes[1..]) };
            let projected = Projected {
                engine: Engine::stopping_for_all(projected, &loose)?,
                lagrange: lagrange.cloned(),
                dims: projected.dims(),
                reached: vec![0.0; sizes.len()],
            };
            return Ok(Replay { method: Method::Projected(Box::new(projected)), tol, sizes, options: *options });
        }
        let extended = with_cost(projected.unwrap_or(system), system.dims(), lagrange, answer.linear)?;
        let sizes = sizes_of(answer);
        let loose = Options { max_steps: MAX_STEPS, ..tolerances(tol, &sizes) };
        match Engine::stopping_for_all(&extended, &loose) {
            Ok(engine) => {
                let method = Method::Events(Box::new(engine));
                return Ok(Replay { method, tol, sizes, options: *options });
            }
            // what events do not follow, finite elements of another order do
            Err(Error::Unsupported(_)) if projected.is_none() && system.mechanics().is_none() => {}
            Err(e) => return Err(e),
        }
        let coarse = &options.discretisation;
        let discretisation = fesd::Options {
            family: Family::RadauIia,
            n_s: if coarse.n_s == STAGES { STAGES + 1 } else { STAGES },
            discretisation: Discretisation::Fesd,
            ..*coarse
        };
        let simulator = Simulator::with_options(&extended, &SolveOptions { discretisation, n_fe: 2, ..*options })?;
        let elements = Elements { simulator, duration: 0.0, switches: Vec::new(), reason: String::new() };
        Ok(Replay { method: Method::Elements(Box::new(elements)), tol, sizes, options: *options })
    }

    /// Was it made for answers like this one?
    pub fn fits(&self, answer: &Answer, options: &SolveOptions) -> bool {
        let alike = |(a, b): (&f64, f64)| *a <= ALIKE * b && b <= ALIKE * a;
        match self.method {
            Method::Events(_) | Method::Projected(_) => {
                self.tol == answer.tol && self.sizes.iter().zip(sizes_of(answer)).all(alike)
            }
            Method::Elements(_) => self.tol == answer.tol && self.options == *options,
        }
    }

    pub(super) fn reinit(&mut self, t: f64, x: &[f64]) -> Result<()> {
        match &mut self.method {
            Method::Events(e) => e.reinit(t, x),
            Method::Projected(e) => {
                e.reached.copy_from_slice(x);
                e.engine.reinit(t, &x[1..])
            }
            Method::Elements(e) => {
                e.switches.clear();
                e.simulator.set_state(t, x)
            }
        }
    }

    /// Simulates a control stage that ends at `t`.
    pub(super) fn advance(&mut self, t: f64, u: &[f64], p: &[f64]) -> Result<Outcome> {
        match &mut self.method {
            Method::Events(e) => {
                e.set_params(p)?;
                e.set_controls(u)?;
                e.advance(t.max(e.time()))
            }
            Method::Projected(e) => e.advance(t, u, p),
            Method::Elements(e) => e.advance(t, u, p, &mut |_, _| {}),
        }
    }

    /// The same, and `watch` looks at constraints on the way; `ramps` are controls that are states, with their slopes in `u`.
    fn advance_watched(
        &mut self,
        t: f64,
        (u, ramps): (&[f64], &[usize]),
        p: &[f64],
        watch: &mut Watch,
    ) -> Result<Outcome> {
        match &mut self.method {
            Method::Events(e) => {
                e.set_params(p)?;
                e.set_controls(u)?;
                let (start, end) = (e.time(), t.max(e.time()));
                watch.look(start, e.state(), (u, ramps), p);
                let mut going = true;
                while going {
                    let before = e.time();
                    going = e.step(end)? != Progress::Done;
                    let h = e.time() - before;
                    if h > 0.0 {
                        let n = Watch::points(h, end - start);
                        let mut inside = std::mem::take(&mut watch.inside);
                        // at the end of a step, too: what is reached there may lie behind a jump
                        for j in 1..=n {
                            let t = if j < n { before + h * j as f64 / n as f64 } else { e.time() };
                            if e.get_dky(t, 0, &mut inside).is_ok() {
                                watch.look(t, &inside, (u, ramps), p);
                            }
                        }
                        watch.inside = inside;
                        watch.look(e.time(), e.state(), (u, ramps), p);
                    }
                }
                Ok(e.outcome())
            }
            Method::Projected(e) => {
                let start = e.engine.time();
                watch.look(start, &e.reached, (u, ramps), p);
                let outcome = e.advance(t, u, p)?;
                let h = e.engine.time() - start;
                if let Some(path) = e.engine.path().filter(|_| h > 0.0) {
                    let n = Watch::points(h, h);
                    let mut inside = std::mem::take(&mut watch.inside);
                    for j in 1..n {
                        let t = start + h * j as f64 / n as f64;
                        if path.eval(t, 0, &mut inside[1..]).is_ok() {
                            watch.look(t, &inside, (u, ramps), p);
                        }
                    }
                    watch.inside = inside;
                }
                watch.look(start + h, &e.reached, (u, ramps), p);
                Ok(outcome)
            }
            Method::Elements(e) => {
                watch.look(e.simulator.time(), e.simulator.state(), (u, ramps), p);
                e.advance(t, u, p, &mut |t, x| watch.look(t, x, (u, ramps), p))
            }
        }
    }

    /// Simulates the stages of `answer` one after the other, from its states again where `off(simulated, answer)` says so,
    /// and takes down states and active regions, of `n_regions`. `None` for systems that are not simulated by events.
    pub fn trace(
        &mut self,
        answer: &Answer,
        off: &dyn Fn(&[f64], &[f64]) -> bool,
        n_regions: usize,
    ) -> Result<Option<super::sequence::Traced>> {
        let Method::Events(e) = &mut self.method else { return Ok(None) };
        let mut found = super::sequence::Traced::default();
        let nx = answer.x0.len();
        let mut t = answer.t0;
        let mut fresh = true;
        let mut inside = vec![0.0; e.state().len()];
        for (k, one) in answer.by_stage().iter().enumerate() {
            let (start, first, u) = one.start();
            if k > 0 {
                fresh = fresh || off(&e.state()[first..], one.x0);
            }
            if fresh {
                e.reinit(t, &start)?;
                fresh = false;
            } else if first > 1 {
                let mut x = start;
                x[first..].copy_from_slice(&e.state()[first..]);
                e.reinit(t, &x)?;
            }
            e.set_params(one.params)?;
            e.set_controls(&u)?;
            if k == 0 {
                found.times.push(0.0);
                found.states.extend_from_slice(one.x0);
            }
            let end = t + one.durations[0];
            let mut phases: Vec<(Vec<bool>, f64)> = Vec::new();
            while e.time() < end {
                let before = e.time();
                let done = e.step(end)?;
                if e.outcome() != Outcome::Reached || e.time() <= before && done == crate::event::Progress::Done {
                    fresh = true;
                    break;
                }
                let mut set = vec![false; n_regions];
                e.cells_of_step().for_each(|c| set[c] = true);
                let h = e.time() - before;
                match phases.last_mut() {
                    Some((last, sum)) if *last == set => *sum += h,
                    _ => phases.push((set, h)),
                }
                for j in 1..SAMPLES {
                    let t = before + h * j as f64 / SAMPLES as f64;
                    if t > answer.t0 + found.times[found.times.len() - 1] && t < e.time() {
                        e.get_dky(t, 0, &mut inside)?;
                        found.times.push(t - answer.t0);
                        found.states.extend_from_slice(&inside[first..first + nx]);
                    }
                }
                if e.time() > answer.t0 + found.times[found.times.len() - 1] {
                    found.times.push(e.time() - answer.t0);
                    found.states.extend_from_slice(&e.state()[first..first + nx]);
                }
            }
            t = end;
            let reached: f64 = phases.iter().map(|p| p.1).sum();
            match phases.last_mut() {
                Some(p) => p.1 += one.durations[0] - reached,
                // nothing is known of the stage: as the one before
                None => match found.phases.stages.last().and_then(|s| s.last()) {
                    Some((set, _)) => phases.push((set.clone(), one.durations[0])),
                    None => return Ok(None),
                },
            }
            found.phases.stages.push(phases);
        }
        Ok(Some(found))
    }

    /// Cost so far, controls that are states, states.
    pub(super) fn state(&self) -> &[f64] {
        match &self.method {
            Method::Events(e) => e.state(),
            Method::Projected(e) => &e.reached,
            Method::Elements(e) => e.simulator.state(),
        }
    }

    /// Steps since the last start; one for what counts none.
    pub(super) fn steps(&self) -> usize {
        match &self.method {
            Method::Events(e) => e.stats().steps,
            Method::Projected(e) => e.engine.stats().steps,
            Method::Elements(_) => STEPS,
        }
    }

    fn n_switches(&self) -> usize {
        match &self.method {
            Method::Events(e) => e.stats().switches,
            Method::Projected(e) => e.engine.stats().switches,
            Method::Elements(e) => e.switches.len(),
        }
    }

    /// Times of the switches.
    pub fn switch_times(&self) -> Vec<f64> {
        match &self.method {
            Method::Events(e) => e.switches().iter().map(|s| s.t).collect(),
            Method::Projected(e) => e.engine.switches().iter().map(|s| s.t).collect(),
            Method::Elements(e) => e.switches.clone(),
        }
    }

    fn reason(&self) -> &str {
        match &self.method {
            Method::Events(e) => e.reason(),
            Method::Projected(e) => e.engine.reason(),
            Method::Elements(e) => &e.reason,
        }
    }
}

/// Simulates an answer and compares.
pub(super) fn measure(engine: &mut Replay, answer: &Answer) -> Result<Accuracy> {
    let (nx, n) = (answer.x0.len(), answer.durations.len());
    let (nu, np) = (answer.controls.len() / n, answer.params.len() / n);
    let ramps: Vec<usize> = (0..answer.linear.len()).filter(|&j| answer.linear[j]).collect();
    let mut start = vec![0.0];
    start.extend(ramps.iter().map(|&j| answer.controls[j]));
    let first = start.len();
    start.extend_from_slice(answer.x0);
    let mut found = Accuracy::unknown(n, nx);
    let (mut differences, mut sizes) = (vec![0.0; n * nx], vec![0.0f64; nx]);
    engine.reinit(answer.t0, &start)?;
    let mut watch = Watch::new(&answer.path, answer.x_bounds, start.len());
    let mut t = answer.t0;
    let (mut u, mut at_grid) = (vec![0.0; nu], 0.0);
    for k in 0..n {
        u.copy_from_slice(&answer.controls[k * nu..(k + 1) * nu]);
        for &j in &ramps {
            u[j] = (answer.control_ends[k * nu + j] - u[j]) / answer.durations[k].max(f64::MIN_POSITIVE);
        }
        t += answer.durations[k];
        let p = &answer.params[k * np..(k + 1) * np];
        let advanced = match watch.as_mut() {
            Some(watch) => {
                watch.begin(k);
                engine.advance_watched(t, (&u, &ramps), p, watch)
            }
            None => engine.advance(t, &u, p),
        };
        found.outcome = match advanced {
            Err(Error::Interrupted | Error::OutOfTime) => None,
            r => Some(r?),
        };
        found.n_switches = engine.n_switches();
        if !found.reached() {
            found.reason = stop::requested().map_or_else(|| engine.reason().to_owned(), |why| why.words().into());
            return Ok(found);
        }
        let own = &answer.states[k * nx..(k + 1) * nx];
        let off = |b: &[f64]| engine.state()[first..].iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        let other = answer.beside.get(k).and_then(|b| b.as_deref()).filter(|b| off(b) < off(own));
        let there = other.unwrap_or(own);
        for (i, (a, b)) in engine.state()[first..].iter().zip(there).enumerate() {
            differences[k * nx + i] = (a - b).abs();
            sizes[i] = sizes[i].max(a.abs()).max(b.abs());
        }
        found.stages[k] = off(there);
        if let Some(f) = answer.grid_cost {
            u.copy_from_slice(&answer.control_ends[k * nu..(k + 1) * nu]);
            let at = Point { t, x: &engine.state()[first..], u: &u, p: &answer.params[k * np..(k + 1) * np] };
            at_grid += values(f, &at)[0];
        }
    }
    found.along = watch.map_or_else(Vec::new, Watch::finish);
    found.noise = NOISE * answer.tol;
    let apart = |at: &usize| {
        let (size, usual) = (sizes[at % nx], answer.usual[at % nx]);
        differences[*at] > APART * size && differences[*at] > found.noise * usual
    };
    let share = |at: &usize| differences[*at] / sizes[at % nx];
    let worst = (0..n * nx).filter(apart).max_by(|a, b| share(a).total_cmp(&share(b)).then(b.cmp(a)));
    found.apart =
        worst.map(|at| Difference { stage: at / nx, state: at % nx, value: differences[at], size: sizes[at % nx] });
    (found.differences, found.sizes) = (differences, sizes);
    found.terminal = found.stages[n - 1];
    found.x_end.copy_from_slice(&engine.state()[first..]);
    u.copy_from_slice(&answer.control_ends[(n - 1) * nu..]);
    let at = Point { t, x: &found.x_end, u: &u, p: &answer.params[(n - 1) * np..] };
    found.cost = at_grid + engine.state()[0];
    if let Some(m) = answer.mayer {
        found.cost += values(m, &at)[0];
    }
    found.cost_error = answer.cost - found.cost;
    let mut worst = 0f64;
    for (f, lower, upper) in &answer.terminal {
        for (v, (l, u)) in values(f, &at).iter().zip(lower.iter().zip(*upper)) {
            // a value that does not exist violates
            worst = if v.is_nan() { f64::NAN } else { worst.max(l - v).max(v - u) };
        }
    }
    found.terminal_violation = worst;
    Ok(found)
}

pub(super) fn values(f: &SharedFunction, at: &Point) -> Vec<f64> {
    let mut out = vec![f64::NAN; f.n_out()];
    if f.value(at, &mut out, &mut vec![0.0; f.work_len()]).is_err() {
        out.fill(f64::NAN);
    }
    out
}

/// The system behind the integral of `lagrange` and its linear controls, which are states here; `wide` has as many controls and parameters as
/// `lagrange`, those of the system first.
pub(super) fn with_cost(
    system: &System,
    wide: Dims,
    lagrange: Option<&SharedFunction>,
    linear: &[bool],
) -> Result<System> {
    let d = system.dims();
    let ramps: Vec<(usize, usize)> = (0..linear.len()).filter(|&j| linear[j]).zip(1..).collect();
    let to = Dims { x: d.x + ramps.len() + 1, ..wide };
    let cost = match lagrange {
        Some(f) => Rewire::behind(wide, to, &ramps).function(f),
        None => combination("0", to, vec![Vec::new()]),
    };
    let slopes = combination("slopes", to, ramps.iter().map(|&(j, _)| vec![(to.x + j, 1.0)]).collect());
    let all = || (0..to.n_in()).collect::<Vec<usize>>();
    let rates = Stack::of("rates", to, vec![(cost, all()), (slopes, all())]);
    Rewire::behind(d, to, &ramps).behind_rates(system, rates)
}
