//! Sizes of the quantities of a problem: what is known of them by bounds, and what a few simulations show.
//!
//! The solver measures variables by them, so that units of states, controls, time and switching functions do not matter.

use super::accuracy::tolerances;
use super::{CostAt, LeastSquares, Ocp};
use crate::error::Result;
use crate::event::{self, Engine};
use crate::fesd::Sizes;
use crate::func::Point;
use crate::nlp::{middle, middles, INFINITE};
use crate::system::{SetValued, SharedFunction};

/// Share of the values of a quantity that are not larger than what counts as its size.
const QUANTILE: f64 = 0.75;
/// Values of every control stage that are looked at.
const SAMPLES: usize = 4;
/// Simulations: the controls of the guess, then others within their bounds.
const RUNS: usize = 5;
/// Share of what a problem usually costs below which a cost is as good as none: it has no size of its own.
const FREE: f64 = 1e-6;
/// Values of a state, relative to the size it is simulated with, that are rounding.
const ROUNDING: f64 = 1e-10;
/// Tolerance and steps of a simulation.
const TOLERANCE: f64 = 1e-4;
const MAX_STEPS: usize = 20_000;

/// Usual sizes of quantities in their own units, positive, as far as they are known: an empty list knows nothing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Nominal {
    /// States `[nx]`.
    pub x: Vec<Option<f64>>,
    /// Controls `[nu]`.
    pub u: Vec<Option<f64>>,
    /// Parameters `[np]`.
    pub p: Vec<Option<f64>>,
}

impl LeastSquares {
    /// What the term costs over stages of these lengths if its function has the values `r` all along.
    fn size(&self, r: &[f64], durations: &[f64]) -> f64 {
        let n = r.len();
        let of_stage = |k: usize| {
            let y = &self.references[if self.references.len() > n { k * n } else { 0 }..][..n];
            let weight = |i: usize, j: usize| match self.weights.len() {
                diagonal if diagonal == n => {
                    if i == j {
                        self.weights[i]
                    } else {
                        0.0
                    }
                }
                _ => self.weights[i * n + j],
            };
            let product = |i: usize| (0..n).map(|j| weight(i, j) * (r[j] - y[j])).sum::<f64>() * (r[i] - y[i]);
            (0..n).map(product).sum::<f64>().abs()
        };
        match self.place {
            CostAt::Running => durations.iter().enumerate().map(|(k, h)| h * of_stage(k)).sum(),
            CostAt::ControlGrid => (0..durations.len()).map(of_stage).sum(),
            CostAt::Terminal => of_stage(durations.len() - 1),
        }
    }
}

/// The values of a function at a point; `None` where it has none or one is not finite.
fn known_value(f: &SharedFunction, at: &Point) -> Option<Vec<f64>> {
    let mut out = vec![0.0; f.n_out()];
    f.value(at, &mut out, &mut vec![0.0; f.work_len()]).ok()?;
    (!out.is_empty() && out.iter().all(|v| v.is_finite())).then_some(out)
}

impl Nominal {
    /// Nothing is known.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty() && self.u.is_empty() && self.p.is_empty()
    }
}

/// What a list says of a quantity.
fn told(list: &[Option<f64>], i: usize) -> Option<f64> {
    list.get(i).copied().flatten()
}

impl Ocp {
    /// Sizes that are known already, or else [`Ocp::sizes`].
    pub(super) fn known_or_own_sizes(&self) -> Result<Sizes> {
        match &self.sizes {
            Some(known) => Ok(known.clone()),
            None => self.sizes(),
        }
    }

    /// Sizes of states, controls, parameters and switching functions.
    pub(super) fn sizes(&self) -> Result<Sizes> {
        let d = self.system.dims();
        let n_psi = self.system.switching_functions().iter().map(|f| f.n_out()).sum();
        let (mut x, mut psi) = (vec![Vec::new(); d.x], vec![Vec::new(); n_psi]);
        let known = self.known_sizes();
        let mut prior = or_one(&known);
        self.simulate_sizes(&prior, &mut x, &mut psi)?;
        // simulations with tolerances that were guessed are made again with those that they show
        let shown = |v: &Vec<f64>| quantile(v.clone()).filter(|s| *s > ROUNDING);
        let seen: Vec<Option<f64>> = x.iter().map(shown).collect();
        let guessed = |(k, s): (&Option<f64>, &Option<f64>)| k.is_none() && s.is_some();
        if known.iter().zip(&seen).any(guessed) {
            let better = |((k, s), p): ((Option<f64>, Option<f64>), &f64)| k.or(s).unwrap_or(*p);
            prior = known.into_iter().zip(seen).zip(&prior).map(better).collect();
            x.iter_mut().chain(&mut psi).for_each(Vec::clear);
            self.simulate_sizes(&prior, &mut x, &mut psi)?;
        }
        let state = |(i, values): (usize, Vec<f64>)| {
            let start = magnitude(middle(self.x0_bounds[0][i], self.x0_bounds[1][i])).unwrap_or(0.0);
            let seen = quantile(values).filter(|s| *s > ROUNDING * prior[i]).unwrap_or(0.0).max(start);
            told(&self.nominal.x, i).or(bounded(&self.x_bounds, i)).or(magnitude(seen)).unwrap_or(prior[i])
        };
        let guess = self.control_guess();
        let control = |j: usize| {
            let seen = guess.iter().skip(j).step_by(d.u).fold(0f64, |a, v| a.max(v.abs()));
            let one_sided = [self.u_bounds[0][j], self.u_bounds[1][j]].into_iter().find_map(magnitude);
            told(&self.nominal.u, j).or(bounded(&self.u_bounds, j)).or(magnitude(seen)).or(one_sided).unwrap_or(1.0)
        };
        let param = |j: usize| {
            let free = self.p_bounds.as_ref().and_then(|b| bounded(b, j));
            told(&self.nominal.p, j).or(magnitude(self.params[j])).or(free).unwrap_or(1.0)
        };
        let x: Vec<f64> = x.into_iter().enumerate().map(state).collect();
        let mut psi: Vec<f64> = psi.into_iter().map(|v| quantile(v).unwrap_or(1.0)).collect();
        psi.extend(self.constraint_sizes(&x));
        Ok(Sizes { u: (0..d.u).map(control).collect(), p: (0..d.p).map(param).collect(), x, psi })
    }

    /// Sizes of the constraints of projected systems: what states of their sizes make of them, at the initial state. Those of inclusions of
    /// another kind are 1.
    fn constraint_sizes(&self, sizes: &[f64]) -> Vec<f64> {
        let x0: Vec<f64> = middles(&self.x0_bounds);
        let u = vec![0.0; self.system.dims().u];
        let at = Point { t: self.t0, x: &x0, u: &u, p: self.params_of(0) };
        let mut out = Vec::new();
        for i in self.system.inclusions() {
            let (n, p) = (i.psi.n_out(), i.psi.jac_pattern());
            let (mut slopes, mut work) = (vec![0.0; p.nnz()], vec![0.0; i.psi.work_len()]);
            let known = i.set == SetValued::Multiplier && i.psi.jacobian(&at, &mut slopes, &mut work).is_ok();
            let mut own = vec![0f64; n];
            for (j, size) in sizes.iter().enumerate().filter(|_| known) {
                p.rows(j).iter().zip(&slopes[p.range(j)]).for_each(|(&o, v)| own[o] += v.abs() * size);
            }
            out.extend(own.into_iter().map(|s| magnitude(s).unwrap_or(1.0)));
        }
        out
    }

    /// Sizes of the states before anything was simulated, as far as the problem says something: two bounds say most, then the
    /// initial state, where it is to go, and one bound.
    fn known_sizes(&self) -> Vec<Option<f64>> {
        let target = self.target();
        let size = |i: usize| {
            let start = magnitude(middle(self.x0_bounds[0][i], self.x0_bounds[1][i]));
            let one_sided = || [self.x_bounds[0][i], self.x_bounds[1][i]].into_iter().find_map(magnitude);
            let goal = || target.as_ref().and_then(|x| magnitude(x[i]));
            told(&self.nominal.x, i).or(bounded(&self.x_bounds, i)).or(start).or_else(goal).or_else(one_sided)
        };
        (0..self.system.dims().x).map(size).collect()
    }

    /// The same, 1 where nothing is known.
    pub(super) fn prior_sizes(&self) -> Vec<f64> {
        or_one(&self.known_sizes())
    }

    /// What the problem usually costs: moduli of the running cost over the horizon, of the terminal cost and of the sums of squares,
    /// where states and controls are off the initial state by their sizes, whichever way costs more; 0 where that is not known.
    fn usual_cost(&self) -> f64 {
        let d = self.system.dims();
        let x0: Vec<f64> = middles(&self.x0_bounds);
        let (x, u) = match &self.sizes {
            Some(s) => (s.x.clone(), s.u.clone()),
            None => (self.prior_sizes(), vec![1.0; d.u]),
        };
        let horizon: f64 = self.durations.iter().sum();
        let costs = |x_sign: f64, u_sign: f64| {
            let x: Vec<f64> = x0.iter().zip(&x).map(|(x0, s)| x0 + x_sign * s).collect();
            let u: Vec<f64> = u.iter().map(|s| u_sign * s).collect();
            let point = Point { t: self.t0, x: &x, u: &u, p: self.params_of(0) };
            let at = |f: &Option<SharedFunction>| {
                let v = f.as_ref().and_then(|f| known_value(f, &point));
                v.map_or(0.0, |v| v[0].abs())
            };
            let squares =
                self.squares.iter().filter_map(|q| Some(q.size(&known_value(&q.f, &point)?, &self.durations)));
            horizon * at(&self.lagrange) + at(&self.mayer) + squares.sum::<f64>()
        };
        let sides = [-1.0, 0.0, 1.0].into_iter().flat_map(|x| [(x, -1.0), (x, 1.0)]);
        sides.map(|(x, u)| costs(x, u)).fold(0.0, f64::max)
    }

    /// The smallest size a cost may have: an optimum that costs nothing, as the tracking of what can be reached exactly, has none of
    /// its own, and what is relative to it would be relative to rounding.
    pub(super) fn least_cost(&self) -> f64 {
        FREE * self.usual_cost()
    }

    /// Size of a cost for tolerances; 1 where nothing is known.
    pub(super) fn cost_size(&self, cost: f64) -> f64 {
        magnitude(cost.abs().max(self.least_cost())).filter(|s| s.is_finite()).unwrap_or(1.0)
    }

    /// Does anything switch? Programs of smooth systems are scaled by their gradients alone.
    pub(super) fn switches(&self) -> bool {
        let s = &self.system;
        s.subsystems().iter().any(|s| s.n_modes > 1) || !s.inclusions().is_empty()
    }

    /// A simulation of the problem's system as accurate as `tol`, relative to the sizes of its states.
    pub(super) fn loose(&self, tol: f64, max_steps: usize) -> event::Options {
        event::Options { max_steps, ..tolerances(tol, &self.prior_sizes()) }
    }

    /// Sizes along states at times from the start of the horizon with the controls of stages of these lengths; those of
    /// `known` for what vanishes there, and for what has bounds or nominal values.
    pub(super) fn sizes_along(
        &self,
        (times, states): (&[f64], &[f64]),
        controls: &[f64],
        durations: &[f64],
        known: &Sizes,
    ) -> Sizes {
        let d = self.system.dims();
        let (mut x, mut psi) = (vec![Vec::new(); d.x], vec![Vec::new(); known.psi.len()]);
        let functions = self.system.switching_functions();
        let (mut stage, mut end) = (0, durations[0]);
        for (t, state) in times.iter().zip(states.chunks_exact(d.x)) {
            while *t > end && stage + 1 < durations.len() {
                stage += 1;
                end += durations[stage];
            }
            let u = &controls[stage * d.u..(stage + 1) * d.u];
            x.iter_mut().zip(state).for_each(|(all, v)| all.push(v.abs()));
            sample(&functions, &Point { t: self.t0 + t, x: state, u, p: self.params_of(stage) }, &mut psi);
        }
        let given = |i: usize| told(&self.nominal.x, i).or(bounded(&self.x_bounds, i)).is_some();
        let seen = |v: Vec<f64>, known: f64| quantile(v).filter(|s| *s > ROUNDING * known);
        let state = |(i, v): (usize, Vec<f64>)| seen(v, known.x[i]).filter(|_| !given(i)).unwrap_or(known.x[i]);
        Sizes {
            x: x.into_iter().enumerate().map(state).collect(),
            psi: psi.into_iter().zip(&known.psi).map(|(v, k)| seen(v, *k).unwrap_or(*k)).collect(),
            ..known.clone()
        }
    }

    /// Values of states and switching functions in simulations with controls at their bounds and in between. Systems
    /// that are not simulated by events show none.
    fn simulate_sizes(&self, sizes: &[f64], x: &mut [Vec<f64>], psi: &mut [Vec<f64>]) -> Result<()> {
        let options = event::Options { max_steps: MAX_STEPS, ..tolerances(TOLERANCE, sizes) };
        let x0: Vec<f64> = middles(&self.x0_bounds);
        let system = self.projected.as_ref().unwrap_or(&self.system);
        let Ok(mut engine) = Engine::stopping_for_all(system, &options) else { return Ok(()) };
        let nu = self.system.dims().u;
        let functions = self.system.switching_functions();
        for controls in self.random_starts(RUNS, 0) {
            engine.reinit(self.t0, &x0)?;
            let mut t = self.t0;
            'run: for k in 0..self.n_stages {
                let u = &controls[k * nu..(k + 1) * nu];
                engine.set_params(self.params_of(k))?;
                engine.set_controls(u)?;
                for _ in 0..SAMPLES {
                    t += self.durations[k] / SAMPLES as f64;
                    if !matches!(engine.advance(t), Ok(event::Outcome::Reached)) {
                        break 'run;
                    }
                    let at = Point { t, x: engine.state(), u, p: self.params_of(k) };
                    x.iter_mut().zip(at.x).for_each(|(all, v)| all.push(v.abs()));
                    sample(&functions, &at, psi);
                }
            }
        }
        Ok(())
    }
}

/// Sizes, 1 where nothing is known.
fn or_one(known: &[Option<f64>]) -> Vec<f64> {
    known.iter().map(|s| s.unwrap_or(1.0)).collect()
}

/// Size of what has two bounds.
fn bounded(b: &[Vec<f64>; 2], j: usize) -> Option<f64> {
    let (l, u) = (b[0][j], b[1][j]);
    (l > -INFINITE && u < INFINITE).then(|| l.abs().max(u.abs())).filter(|s| *s > 0.0)
}

/// Modulus of a value that says something of a size.
fn magnitude(v: f64) -> Option<f64> {
    (v.abs() < INFINITE && v != 0.0).then(|| v.abs())
}

/// Adds the moduli of the switching functions at a point.
pub(super) fn sample(functions: &[SharedFunction], at: &Point, values: &mut [Vec<f64>]) {
    let mut first = 0;
    for f in functions {
        let mut out = vec![0.0; f.n_out()];
        if f.value(at, &mut out, &mut vec![0.0; f.work_len()]).is_ok() {
            out.iter().enumerate().for_each(|(j, v)| values[first + j].push(v.abs()));
        }
        first += f.n_out();
    }
}

/// A size of values that are not all zero.
pub(super) fn quantile(mut v: Vec<f64>) -> Option<f64> {
    v.retain(|v| v.is_finite());
    v.sort_unstable_by(f64::total_cmp);
    let at = *v.get(((v.len() as f64 - 1.0) * QUANTILE) as usize)?;
    let largest = *v.last()?;
    (largest > 0.0).then_some(if at > 1e-3 * largest { at } else { 0.1 * largest })
}
