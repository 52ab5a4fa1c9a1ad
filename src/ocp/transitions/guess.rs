//! What the program of a sequence starts from: a simulation by events, or the answer of a sequence next to it.

use super::automaton::{Automaton, Passage, Sequence};
use crate::error::{Error, Result};
use crate::event::{self, Engine};
use crate::func::Point;
use crate::nlp::middles;
use crate::ocp::{ModeSequence, Ocp, OcpResult};
use crate::system::Transition;

/// Tolerance of simulations, and their steps at most.
const TOLERANCE: f64 = 1e-7;
const MAX_STEPS: usize = 100_000;
/// Points of a simulation that are kept for every stage.
const POINTS: usize = 6;
/// Share of a stage that a transition is away from its ends where a solve starts.
const MARGIN: f64 = 0.1;
/// Transitions of a simulation that are taken at most.
const MOST: usize = 200;
/// Rounding of times, in units of the length of a stage: a transition so near the start of a stage is at it.
const AT_START: f64 = 1e-9;

/// States along the horizon, controls, lengths of stages, times of transitions.
#[derive(Debug, Clone)]
pub(super) struct Guess {
    /// Times from the start of the horizon, not falling: twice where the state jumps.
    pub times: Vec<f64>,
    pub states: Vec<f64>,
    /// Controls at the start of every stage.
    pub controls: Vec<f64>,
    /// Ends of the stages.
    pub ends: Vec<f64>,
    /// Times of the transitions.
    pub passages: Vec<f64>,
    pub params: Vec<f64>,
    /// Modes between the transitions, where they are given.
    pub modes: Option<ModeSequence>,
}

impl Guess {
    /// Start and end of a stage.
    pub fn stage(&self, k: usize) -> (f64, f64) {
        (if k == 0 { 0.0 } else { self.ends[k - 1] }, self.ends[k])
    }

    pub fn horizon(&self) -> f64 {
        self.ends[self.ends.len() - 1]
    }

    /// The state at the end of the horizon, or as far as the simulation came.
    pub fn last_state(&self) -> &[f64] {
        &self.states[self.states.len() - self.nx()..]
    }

    fn nx(&self) -> usize {
        self.states.len() / self.times.len()
    }

    /// The state at a time, with what is before or behind a jump there.
    fn state(&self, t: f64, behind: bool) -> Vec<f64> {
        let nx = self.nx();
        let k = if behind { self.times.partition_point(|s| *s <= t) } else { self.times.partition_point(|s| *s < t) };
        let at = |k: usize| &self.states[k * nx..(k + 1) * nx];
        if k == 0 {
            return at(0).to_vec();
        }
        if k == self.times.len() {
            return at(k - 1).to_vec();
        }
        let s = (t - self.times[k - 1]) / (self.times[k] - self.times[k - 1]);
        at(k - 1).iter().zip(at(k)).map(|(a, b)| (1.0 - s) * a + s * b).collect()
    }

    /// Rising times within a span, from its start, and the states there.
    pub fn between(&self, from: f64, to: f64) -> (Vec<f64>, Vec<f64>) {
        let nx = self.nx();
        let (mut times, mut states) = (vec![0.0], self.state(from, true));
        for (k, &t) in self.times.iter().enumerate() {
            if t > from && t < to && t - from > times[times.len() - 1] {
                times.push(t - from);
                states.extend_from_slice(&self.states[k * nx..(k + 1) * nx]);
            }
        }
        if to - from > times[times.len() - 1] {
            times.push(to - from);
            states.extend(self.state(to, false));
        }
        (times, states)
    }

    /// The guess for the sequence of `given`, which is complete: its times and modes, and the states that were given, where they were.
    pub fn for_modes(mut self, ocp: &Ocp, sequence: &[Passage], given: &ModeSequence) -> Guess {
        if let Some((times, states)) = &ocp.x_guess {
            (self.times, self.states) = (times.clone(), states.clone());
        }
        let mut last = 0f64;
        let mut known = given.transitions.iter().peekable();
        let time = |p: &Passage| {
            // what follows of itself may be left out
            if let Some(t) = known.next_if(|t| t.transition == p.transition) {
                let (from, to) = self.stage(p.stage);
                last = if p.at_once { from } else { t.t }.clamp(from, to).max(last);
            }
            last
        };
        self.passages = sequence.iter().map(time).collect();
        self.modes = (!given.cells.is_empty() || !given.modes.is_empty()).then(|| given.clone());
        self
    }

    /// The guess for another sequence: its transitions within their stages, where those that were there already stay.
    pub fn for_sequence(&self, old: &[Passage], new: &[Passage]) -> Guess {
        let mut used = vec![false; old.len()];
        let mut passages: Vec<f64> = Vec::with_capacity(new.len());
        let mut controls = self.controls.clone();
        let nu = controls.len() / self.ends.len();
        for p in new {
            let (from, to) = self.stage(p.stage);
            let margin = MARGIN * (to - from);
            let same = (0..old.len()).filter(|&i| !used[i] && old[i].transition == p.transition);
            let nearest = same.min_by_key(|&i| old[i].stage.abs_diff(p.stage));
            let wanted = match nearest {
                Some(i) if old[i].stage.abs_diff(p.stage) <= 1 => {
                    used[i] = true;
                    // what made the guard pass zero in its stage does so in the next one
                    let from = old[i].stage * nu;
                    controls[p.stage * nu..(p.stage + 1) * nu].copy_from_slice(&self.controls[from..from + nu]);
                    self.passages[i]
                }
                _ => 0.5 * (from + to),
            };
            let t = if p.at_once { from } else { wanted.max(from + margin).min(to - margin) };
            let before = passages.last().copied().unwrap_or(0.0);
            passages.push(if p.at_once { t.max(before) } else { t.max(before + 0.1 * margin).min(to) });
        }
        Guess { passages, controls, modes: None, ..self.clone() }
    }

    /// That of an answer of the problem, which may have begun at another time.
    pub fn of(r: &OcpResult) -> Guess {
        let t0 = r.trajectory.elements.first().map_or(0.0, |e| e.t);
        let (mut times, mut states) = (Vec::new(), Vec::new());
        for e in &r.trajectory.elements {
            times.push(e.t - t0);
            states.extend_from_slice(&e.x0);
            times.push(e.t + e.h - t0);
            states.extend_from_slice(&e.x1);
        }
        let mut end = 0.0;
        let ends = r.durations.iter().map(|d| {
            end += d;
            end
        });
        Guess {
            times,
            states,
            controls: r.controls.clone(),
            ends: ends.collect(),
            passages: r.jumps.iter().map(|j| j.t - t0).collect(),
            params: r.params.clone(),
            modes: None,
        }
    }
}

/// Controls to simulate: those of the guess, and where none were given and they have bounds also their extremes in two
/// halves and all along.
pub(in crate::ocp) fn controls(ocp: &Ocp) -> Vec<Vec<f64>> {
    let d = ocp.system.dims();
    let mut all = vec![ocp.control_guess()];
    let [lower, upper] = &ocp.u_bounds;
    let bounded = lower.iter().chain(upper).all(|v| v.is_finite());
    if ocp.u_guess.is_some() || !bounded || d.u == 0 {
        return all;
    }
    let half = ocp.n_stages.div_ceil(2);
    for (first, second) in [(upper, lower), (lower, upper), (upper, upper), (lower, lower)] {
        all.push((0..ocp.n_stages).flat_map(|k| if k < half { first } else { second }.clone()).collect());
    }
    all.into_iter().map(|u| ocp.within_bounds(u)).collect()
}

/// What simulates: one for all simulations of a search.
pub(super) fn engine(ocp: &Ocp) -> Result<Engine> {
    let loose = event::Options { max_steps: MAX_STEPS, ..event::Options::with_tolerance(TOLERANCE, TOLERANCE) };
    Engine::stopping_for_all(&ocp.system, &loose)
}

/// Simulates controls by events: the transitions that are made and the states on the way. Stops early where the simulation
/// does; what follows is constant then.
pub(super) fn simulate(
    ocp: &Ocp,
    automaton: &Automaton,
    engine: &mut Engine,
    controls: &[f64],
) -> Result<(Sequence, Guess)> {
    let d = ocp.system.dims();
    let x0: Vec<f64> = middles(&ocp.x0_bounds);
    engine.reinit(ocp.t0, &x0)?;
    let mut g = Guess {
        times: vec![0.0],
        states: x0,
        controls: controls.to_vec(),
        ends: Vec::new(),
        passages: Vec::new(),
        params: ocp.params.clone(),
        modes: None,
    };
    let mut start = 0.0;
    'run: for (k, &length) in ocp.durations.iter().enumerate() {
        engine.set_params(ocp.params_of(k))?;
        engine.set_controls(&controls[k * d.u..(k + 1) * d.u])?;
        for i in 1..=POINTS {
            let t = start + length * i as f64 / POINTS as f64;
            match engine.advance(ocp.t0 + t) {
                Ok(event::Outcome::Reached) => {}
                Ok(_) | Err(Error::Interrupted | Error::OutOfTime) => break 'run,
                Err(e) => return Err(e),
            }
            g.times.push(t);
            g.states.extend_from_slice(engine.state());
        }
        start += length;
    }
    let mut end = 0.0;
    g.ends = ocp
        .durations
        .iter()
        .map(|h| {
            end += h;
            end
        })
        .collect();
    let mut sequence: Sequence = Vec::new();
    let mut before = f64::NEG_INFINITY;
    for j in engine.jumps().iter().take(MOST) {
        let t = j.t - ocp.t0;
        let mut stage = g.ends.partition_point(|e| *e < t).min(ocp.n_stages - 1);
        let turned = automaton.knows_controls(j.transition) && g.ends[stage] - t <= AT_START * length_of(&g, stage);
        // a guard of states alone passes zero at the end of a stage, it is not beyond it at the start of the next
        let at_once = j.rate.is_nan() && (t <= 0.0 || t <= before || turned);
        if at_once && turned && stage + 1 < ocp.n_stages {
            // the control of the stage that begins there made it happen
            stage += 1;
        }
        sequence.push(Passage { transition: j.transition, stage, at_once });
        g.insert_jump(t, &j.before, &j.after);
        before = t;
    }
    // constant guards are made where they hold
    let Some(complete) = automaton.complete(&sequence) else {
        return Ok((Vec::new(), g));
    };
    g.passages = passages(&complete, engine.jumps(), ocp.t0, &g);
    Ok((complete, g))
}

fn length_of(g: &Guess, k: usize) -> f64 {
    let (from, to) = g.stage(k);
    to - from
}

/// Times of the transitions of a sequence, those of the simulation where they are the same.
fn passages(sequence: &[Passage], jumps: &[event::Jump], t0: f64, g: &Guess) -> Vec<f64> {
    let mut last = 0f64;
    let mut jumps = jumps.iter().peekable();
    let time = |p: &Passage| {
        if let Some(j) = jumps.next_if(|j| j.transition == p.transition) {
            let (from, to) = g.stage(p.stage);
            last = (j.t - t0).max(from).min(to);
        }
        last
    };
    sequence.iter().map(time).collect()
}

impl Guess {
    /// Puts both sides of a jump between the points of a simulation.
    fn insert_jump(&mut self, t: f64, before: &[f64], after: &[f64]) {
        let nx = self.nx();
        let k = self.times.partition_point(|s| *s <= t);
        self.times.splice(k..k, [t, t]);
        self.states.splice(k * nx..k * nx, before.iter().chain(after).copied());
    }
}

/// How far the guards of an answer are from passing zero where they are watched and do not pass it: for every transition and
/// stage the least distance, as a share of the range of the guard along the horizon.
pub(super) fn distances(r: &OcpResult, ocp: &Ocp, automaton: &Automaton) -> Vec<Vec<f64>> {
    let d = ocp.system.dims();
    let of = |k: usize, t: &Transition| {
        let mut best = vec![f64::INFINITY; ocp.n_stages];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut work = vec![0.0; t.guard.work_len()];
        for e in &r.trajectory.elements {
            let leg = r.jumps.partition_point(|j| j.t <= e.t + 0.5 * e.h);
            let values: Vec<f64> = automaton.states.iter().map(|&i| e.x1[i]).collect();
            let passes = r.jumps.get(leg).is_some_and(|j| j.transition == k);
            let counts = !passes && automaton.is_armed(k, &values);
            let u = &r.controls[e.stage * d.u..(e.stage + 1) * d.u];
            for (at, x) in [(e.t, &e.x0), (e.t + e.h, &e.x1)] {
                let mut v = [f64::NAN];
                let at = Point { t: at, x, u, p: ocp.params_of(e.stage) };
                if t.guard.value(&at, &mut v, &mut work).is_err() || !v[0].is_finite() {
                    continue;
                }
                let v = -v[0] * t.direction.sign();
                (low, high) = (low.min(v), high.max(v));
                if counts {
                    best[e.stage] = best[e.stage].min(v);
                }
            }
        }
        let range = (high - low).max(f64::MIN_POSITIVE);
        best.into_iter().map(|v| (v / range).max(0.0)).collect()
    };
    automaton.transitions.iter().enumerate().map(|(k, t)| of(k, t)).collect()
}
