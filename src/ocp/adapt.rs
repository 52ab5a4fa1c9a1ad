//! Grids that follow the error: finite elements are added where the simulation of the answer asks for them and taken away
//! where they are idle, and the next solve starts from the last solution with its mode sequence.

use super::solve::Start;
use super::{ModeSequence, Ocp, OcpResult};
use crate::error::Result;
use crate::mpcc::Polish;
use crate::nlp::{Control, Outcome, Statistics};

/// Share of the error asked for that one stage may make.
const SHARE: f64 = 0.3;
/// A stage with less than this part of its share may lose elements.
const IDLE: f64 = 1e-3;
/// Factor by which a grid must shrink to be worth another solve where the error is small enough already.
const WORTH: f64 = 1.25;
/// Factor by which a stage may grow at once.
const GROWTH: f64 = 2.0;
/// Points per element of the guess that carries a solution over.
const SAMPLES: usize = 4;
/// Tolerance of the simulation that measures, relative to the error asked for.
const RESOLUTION: f64 = 1e-2;

/// One solve on the way to a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    /// Elements of every stage.
    pub elements: Vec<usize>,
    /// Variables of the discretised problem.
    pub n_variables: usize,
    /// Largest difference of a state from the simulation at the ends of the control stages; NaN where that got stuck.
    pub error: f64,
    /// Cost.
    pub cost: f64,
    /// Was there an exact solution?
    pub exact: bool,
    /// Iterations.
    pub iterations: usize,
}

/// How a grid was adapted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Adaptation {
    /// The solves, the first on the grid that was given.
    pub rounds: Vec<Round>,
    /// The round whose solution was kept.
    pub kept: usize,
    /// Is its error as small as asked for?
    pub reached: bool,
}

/// What of the problem is borrowed to hand a solution over.
struct Borrowed {
    x_guess: Option<(Vec<f64>, Vec<f64>)>,
    u_guess: Option<Vec<f64>>,
    modes: Option<ModeSequence>,
    durations: Vec<f64>,
    params: Vec<f64>,
    stage_params: Option<Vec<f64>>,
    accuracy: (i64, f64),
}

impl Ocp {
    /// Solves until the error of the answer is `adapt_tol`, or the budget is spent. The grid that was reached stays.
    pub(super) fn adapt(&mut self, start: Start, control: &mut Control) -> Result<&OcpResult> {
        control.limit(self.settings.max_time);
        let before = Borrowed {
            x_guess: self.x_guess.clone(),
            u_guess: self.u_guess.clone(),
            modes: self.modes.clone(),
            durations: self.durations.clone(),
            params: self.params.clone(),
            stage_params: self.stage_params.clone(),
            accuracy: (self.settings.accuracy, self.settings.accuracy_tol),
        };
        self.settings.accuracy = 1;
        let resolution = (RESOLUTION * self.settings.adapt_tol).max(1e-13);
        self.settings.accuracy_tol = self.settings.accuracy_tol.min(resolution);
        let solved = self.adapt_rounds(start, control);
        self.x_guess = before.x_guess;
        self.u_guess = before.u_guess;
        self.modes = before.modes;
        self.durations = before.durations;
        self.params = before.params;
        self.stage_params = before.stage_params;
        (self.settings.accuracy, self.settings.accuracy_tol) = before.accuracy;
        let best = solved?;
        Ok(self.result.insert(best))
    }

    fn adapt_rounds(&mut self, start: Start, control: &mut Control) -> Result<OcpResult> {
        let tol = self.settings.adapt_tol;
        let mut story = Adaptation::default();
        let (mut spent, mut built) = (Statistics::default(), 0.0);
        let mut grown = vec![false; self.n_stages];
        let mut best: Option<OcpResult> = None;
        let mut start = start;
        loop {
            let r = self.run(start, control)?.clone();
            spent.add(&r.stats);
            built += r.time_build;
            story.rounds.push(Round {
                elements: self.elements(),
                n_variables: r.dimensions.0,
                error: r.error(),
                cost: r.cost,
                exact: r.polish == Polish::Done,
                iterations: r.stats.iterations,
            });
            let last = story.rounds.len() - 1;
            if best.as_ref().is_none_or(|b| r.is_better_than(b, tol)) {
                story.kept = last;
                best = Some(r.clone());
            }
            let stopped = !matches!(r.outcome, Outcome::Solved | Outcome::Stalled);
            if stopped || last >= self.settings.adapt_rounds as usize {
                break;
            }
            let elements = self.next_grid(&r, &mut grown);
            let most = self.settings.adapt_elements as usize;
            let (now, next) = (self.elements().iter().sum::<usize>(), elements.iter().sum::<usize>());
            let reached = r.is_exact() && r.error() <= tol;
            if elements == self.elements() || next > most || (reached && WORTH * next as f64 > now as f64) {
                break;
            }
            self.carry_over(&r)?;
            self.set_elements(&elements)?;
            start = Start::Carried;
        }
        let mut kept = match best {
            Some(b) if story.kept + 1 < story.rounds.len() => {
                // back to the grid of the best solution, so that derivatives and warm starts are those of the result
                self.carry_over(&b)?;
                self.set_elements(&story.rounds[story.kept].elements.clone())?;
                let again = self.run(Start::Carried, control)?.clone();
                spent.add(&again.stats);
                again
            }
            Some(b) => b,
            None => return Err(crate::error::Error::Internal("no round of the adaptation ended".into())),
        };
        story.reached = kept.is_exact() && kept.error() <= tol;
        let total = spent.time_total;
        kept.stats = Statistics { time_total: total, ..spent };
        kept.time_build = built;
        kept.adaptation = Some(story);
        Ok(kept)
    }

    /// Elements of every stage for the next round.
    fn next_grid(&self, r: &OcpResult, grown: &mut [bool]) -> Vec<usize> {
        let order = r.trajectory.tableau().order().max(1) as f64;
        let phases = phases_of(r, self.n_stages);
        let now = self.elements();
        let simulated = r.accuracy.as_ref().map_or(&[][..], |a| &a.stages);
        let stuck = simulated.iter().position(|m| m.is_nan());
        let local = r.accuracy.as_ref().map_or(&[][..], |a| &a.local);
        // errors of the stages grow on their way to the end
        let largest = local.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let growth = (r.error() / largest).max(1.0);
        let share = SHARE * self.settings.adapt_tol / growth;
        let mut next = now.clone();
        for k in 0..self.n_stages {
            let error = local.get(k).copied().unwrap_or(f64::NAN);
            let wanted = if !r.is_exact() {
                // no element to spare for the switches
                if phases[k] >= now[k] || stuck == Some(k) {
                    now[k] + 1
                } else {
                    now[k]
                }
            } else if error.is_nan() {
                now[k] + usize::from(stuck == Some(k))
            } else {
                let ideal = now[k] as f64 * (error / share).powf(1.0 / order);
                if error > share {
                    (ideal.ceil().min(GROWTH * now[k] as f64) as usize).max(now[k] + 1)
                } else if error < IDLE * share && !grown[k] {
                    (ideal.ceil() as usize).max(now[k].div_ceil(2))
                } else {
                    now[k]
                }
            };
            grown[k] |= wanted > now[k];
            next[k] = wanted.max(phases[k]);
        }
        if !r.is_exact() && next == now {
            next.iter_mut().for_each(|n| *n += 1);
        }
        next
    }

    /// Makes a solution the guess of the next solve: states, controls, lengths, free parameters, modes.
    fn carry_over(&mut self, r: &OcpResult) -> Result<()> {
        let nx = r.trajectory.nx();
        let t0 = r.trajectory.elements.first().map_or(0.0, |e| e.t);
        let (mut times, mut states) = (Vec::new(), Vec::new());
        let mut put = |t: f64, x: &[f64]| {
            if times.last().is_none_or(|last| t > *last) {
                times.push(t);
                states.extend_from_slice(x);
            }
        };
        let mut x = vec![0.0; nx];
        for e in r.trajectory.elements.iter().filter(|e| e.h > 1e-9 * r.durations[e.stage]) {
            put(e.t - t0, &e.x0);
            for j in 1..SAMPLES {
                let t = e.t + e.h * j as f64 / SAMPLES as f64;
                r.trajectory.state(t, &mut x)?;
                put(t - t0, &x);
            }
            put(e.t + e.h - t0, &e.x1);
        }
        self.set_x_guess(&times, &states)?;
        self.set_u_guess(&r.controls)?;
        if r.durations.iter().all(|d| *d > 0.0) {
            self.durations.clone_from(&r.durations);
        }
        if self.stage_params.is_none() {
            self.params.clone_from(&r.params);
        }
        self.modes = r.is_exact().then(|| r.modes());
        Ok(())
    }
}

impl OcpResult {
    /// Largest difference of a state from the simulation at the ends of the control stages; NaN without a simulation, or
    /// where it ended early.
    pub fn error(&self) -> f64 {
        let Some(a) = &self.accuracy else { return f64::NAN };
        a.stages.iter().fold(0.0, |m: f64, v| if v.is_nan() || m.is_nan() { f64::NAN } else { m.max(*v) })
    }

    fn is_exact(&self) -> bool {
        self.outcome == Outcome::Solved && self.polish != Polish::Rejected
    }

    /// Exact ones are better, then those that can be simulated, then those with the error asked for, among them the
    /// smaller, else the more accurate.
    fn is_better_than(&self, other: &OcpResult, tol: f64) -> bool {
        let reached = |r: &OcpResult| r.error() <= tol;
        let rank = |r: &OcpResult| (!r.is_exact(), r.error().is_nan(), !reached(r));
        let (a, b) = (rank(self), rank(other));
        // another optimum, which a coarser grid may leave no room to get away from
        let worse = self.cost > other.cost + tol.max(1e-6) * (1.0 + other.cost.abs());
        if a == b && reached(self) && worse {
            return false;
        }
        a < b
            || (a == b
                && if reached(self) { self.dimensions.0 < other.dimensions.0 } else { self.error() < other.error() })
    }
}

/// Phases with one active set in every stage.
fn phases_of(r: &OcpResult, n_stages: usize) -> Vec<usize> {
    let mut counts = vec![0; n_stages];
    let mut last: Option<(usize, &[bool])> = None;
    for e in r.trajectory.elements.iter().filter(|e| e.h > 1e-9 * r.durations[e.stage]) {
        let phase = (e.stage, &e.active_cells[..]);
        if last != Some(phase) {
            counts[e.stage] += 1;
        }
        last = Some(phase);
    }
    counts.iter().map(|n| (*n).max(1)).collect()
}
