//! Limit cycles: a long simulation comes close to one, shooting makes it exact, and as a problem with a free horizon and
//! equal ends it is found again.
//!
//! A cycle may start anywhere on itself, so the problem needs a condition for the phase, `ẋ(0)ᵀ (x(0) − x̂) = 0` at a
//! point `x̂` of the simulation. Nothing else tells the relaxed problem which cycle is meant (an equilibrium is one for any
//! period), so the distance to the simulation at the ends of the stages is the cost.

use super::{distance, function, set, system, Problem};
use switchback::error::{Error, Result};
use switchback::event::{simulate, Engine, Options};
use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::ocp::{CostAt, Durations, Ocp};
use switchback::settings::Settings;
use switchback::system::System;

pub fn all() -> Vec<Result<Problem>> {
    vec![relay(), stick_slip(), belt()]
}

/// Relay feedback with sliding (di Bernardo, Johansson, Vasca 2001): the second half of a period is the negative of the
/// first.
fn relay() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 3, u: 0, p: 0 };
    let (omega, zeta) = (10.0, 0.05);
    let (y, a, b, s) = (g.x(0), g.x(1), g.x(2), g.x(0).sign());
    let first = -(2.0 * zeta * omega + 1.0) * y + a - s;
    let second = -(2.0 * zeta * omega + omega * omega) * y + b + 2.0 * s;
    let sys = system(&g, d, &[first, second, -omega * omega * y - s]);
    let half = Orbit { start: &[0.0, -0.001, -0.02], long: 60.0, sign: -1.0 };
    let (ocp, horizon) = half.problem(&g, &sys, 8, &set(6, 4))?;
    Ok(Problem {
        name: "relay-cycle",
        see: "half a period; twice it slides along y = 0",
        ocp,
        time: "time",
        states: &["y", "x2", "x3"],
        controls: &[],
        horizon: Some(horizon),
    })
}

/// Between a block of speed `v` and a belt of speed 0.2.
fn friction(v: Expr<'_>, strength: f64) -> Expr<'_> {
    v.gt(0.2).select(-strength / (0.8 + v), strength / (1.2 - v))
}

/// A block on a belt whose friction falls with the speed of slip (Dieci and Lopez 2009).
fn stick_slip() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 2, u: 0, p: 0 };
    let (q, v) = (g.x(0), g.x(1));
    let sys = system(&g, d, &[v, -q + friction(v, 1.0)]);
    let orbit = Orbit { start: &[-0.8, -1.0], long: 60.0, sign: 1.0 };
    let (ocp, horizon) = orbit.problem(&g, &sys, 6, &set(6, 3))?;
    Ok(Problem {
        name: "stick-slip",
        see: "the block sticks to the belt until the spring tears it off",
        ocp,
        time: "time",
        states: &["position", "speed"],
        controls: &[],
        horizon: Some(horizon),
    })
}

/// Two such blocks with a spring between them: for a part of the period both stick.
fn belt() -> Result<Problem> {
    let g = Graph::new();
    let d = Dims { x: 4, u: 0, p: 0 };
    let [q1, q2, v1, v2] = [g.x(0), g.x(1), g.x(2), g.x(3)];
    let first = -q1 + 0.2 * (q2 - q1) + friction(v1, 1.0);
    let second = -q2 + 0.2 * (q1 - q2) + friction(v2, 1.3);
    let sys = system(&g, d, &[v1, v2, first, second]);
    let orbit = Orbit { start: &[0.5, 0.3, 0.2, 0.2], long: 400.0, sign: 1.0 };
    let (ocp, horizon) = orbit.problem(&g, &sys, 10, &set(6, 2))?;
    Ok(Problem {
        name: "stick-slip-2",
        see: "between the slips of one block and of the other both stick",
        ocp,
        time: "time",
        states: &["position 1", "position 2", "speed 1", "speed 2"],
        controls: &[],
        horizon: Some(horizon),
    })
}

/// A switch, with the state there.
struct Visit<'a> {
    t: f64,
    before: &'a [usize],
    after: &'a [usize],
    x: Vec<f64>,
}

/// Where to look for a cycle.
struct Orbit<'a> {
    start: &'a [f64],
    /// Time by which the simulation has come close to the cycle.
    long: f64,
    /// −1: the second half of the period is the negative of the first, and half a period is looked for.
    sign: f64,
}

impl Orbit<'_> {
    /// The problem, and the length of its horizon by shooting.
    fn problem(&self, g: &Graph, sys: &System, n_stages: usize, set: &Settings) -> Result<(Ocp, f64)> {
        let n = sys.dims().x;
        let tight = Options { dense: true, ..Options::with_tolerance(1e-12, 1e-13) };
        let run = simulate(sys, &tight, 0.0, self.start, self.long)?;
        let path = run.path.as_ref().ok_or_else(|| Error::Internal("the run has no dense output".into()))?;
        let at = |t: f64, k: usize| -> Result<Vec<f64>> {
            let mut x = vec![0.0; n];
            path.eval(t, k, &mut x).map(|()| x)
        };
        let mut visits = Vec::new();
        for s in &run.switches {
            visits.push(Visit { t: s.t, before: &s.before, after: &s.after, x: at(s.t, 0)? });
        }
        let [earlier @ .., last] = &visits[..] else {
            return Err(Error::State("the simulation never switches".into()));
        };
        let again = |v: &&Visit| (v.before, v.after) == (last.before, last.after) && distance(&v.x, &last.x) < 1e-6;
        let first = earlier.iter().rev().find(again);
        let first = first.ok_or_else(|| Error::State("the simulation has found no cycle".into()))?.t;
        let period = last.t - first;
        let length = if self.sign < 0.0 { 0.5 * period } else { period };
        // away from switches: the middle of the longest time without one
        let gap = |w: &[Visit]| w[1].t - w[0].t;
        let longest = visits.windows(2).filter(|w| w[0].t >= first).max_by(|a, b| gap(a).total_cmp(&gap(b)));
        let from = longest.map_or(first, |w| 0.5 * (w[0].t + w[1].t)) - period;
        let (x, velocity) = (at(from, 0)?, at(from, 1)?);

        let mut ocp = Ocp::new(sys, length, n_stages, set)?;
        ocp.set_free_time(Durations::Horizon, 0.8 * length, 1.25 * length)?;
        let ends = Dims { x: 2 * n, u: 0, p: 0 };
        let closed: Vec<Expr> = (0..n).map(|i| g.x(n + i) - self.sign * g.x(i)).collect();
        ocp.add_boundary(function(g, ends, "closed", &closed), &vec![0.0; n], &vec![0.0; n])?;
        let phase = (0..n).fold(g.constant(0.0), |sum, i| sum + velocity[i] * (g.x(i) - x[i]));
        ocp.add_boundary(function(g, ends, "phase", &[phase]), &[0.0], &[0.0])?;
        let (mut times, mut guess, mut references) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..=400 {
            times.push(length * f64::from(k) / 400.0);
            guess.extend(at(from + length * f64::from(k) / 400.0, 0)?);
        }
        for k in 1..=n_stages {
            references.extend(at(from + length * k as f64 / n_stages as f64, 0)?);
        }
        ocp.set_x_guess(&times, &guess)?;
        let states: Vec<Expr> = (0..n).map(|i| g.x(i)).collect();
        let f = function(g, sys.dims(), "x", &states);
        ocp.add_least_squares(f, &vec![1.0; n], &references, CostAt::ControlGrid)?;
        Ok((ocp, self.shoot(sys, x, velocity, length)?))
    }

    /// Newton's method for `x(T) = ± x(0)` with the derivatives of the simulation.
    fn shoot(&self, sys: &System, mut x: Vec<f64>, phase: Vec<f64>, mut length: f64) -> Result<f64> {
        let n = x.len();
        let tight = Options { sensitivity: true.into(), ..Options::with_tolerance(1e-13, 1e-14) };
        let mut engine = Engine::new(sys, &tight)?;
        let start = x.clone();
        for _ in 0..8 {
            engine.reinit(0.0, &x)?;
            engine.advance(length)?;
            let s = engine.sensitivity().ok_or_else(|| Error::Internal("the run has no derivatives".into()))?;
            let columns = s.len() / n;
            let mut a = vec![vec![0.0; n + 2]; n + 1];
            for i in 0..n {
                for j in 0..n {
                    a[i][j] = s[i * columns + j] - if i == j { self.sign } else { 0.0 };
                }
                a[i][n] = engine.derivative()[i];
                a[i][n + 1] = self.sign * x[i] - engine.state()[i];
                a[n][i] = phase[i];
                a[n][n + 1] += phase[i] * (start[i] - x[i]);
            }
            let step = eliminate(a);
            for i in 0..n {
                x[i] += step[i];
            }
            length += step[n];
        }
        Ok(length)
    }
}

/// Solves a small dense system whose right-hand side is the last column.
fn eliminate(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap_or(k);
        a.swap(k, pivot);
        let row = a[k].clone();
        for (i, other) in a.iter_mut().enumerate().filter(|r| r.0 != k) {
            debug_assert_ne!(i, k);
            let factor = other[k] / row[k];
            for (o, r) in other.iter_mut().zip(&row) {
                *o -= factor * r;
            }
        }
    }
    (0..n).map(|k| a[k][n] / a[k][k]).collect()
}
