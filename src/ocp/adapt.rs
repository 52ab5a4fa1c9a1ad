//! Grids that follow the error: finite elements are added where the simulation of the answer asks for them and taken away
//! where they are idle, and the next solve starts from the last solution with its mode sequence.

use std::time::Instant;

use super::request::{Comparison, Request};
use super::solve::{Built, Start};
use super::{Ocp, OcpResult, MAX_ELEMENTS};
use crate::error::{Error, Result};
use crate::mpcc::Polish;
use crate::nlp::{Control, Outcome, Statistics};
use crate::settings::Settings;
use crate::stop;

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
/// Share of the cost by which one must be lower for the optimum to be another one.
const LOWER: f64 = 1e-3;
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
    /// True where there was an exact solution.
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
    /// True where its error is as small as asked for.
    pub reached: bool,
}

/// The best answer so far, with what was built for it where another grid has taken its place.
struct Kept {
    result: OcpResult,
    built: Option<Box<Built>>,
}

/// The rounds so far.
#[derive(Default)]
struct Rounds {
    story: Adaptation,
    spent: Statistics,
    time_build: f64,
    /// Stages that have grown: they do not shrink again.
    grown: Vec<bool>,
    best: Option<Kept>,
    /// The round that a limit or a stop has ended, and how.
    cut_short: Option<(usize, Outcome)>,
}

impl Ocp {
    /// Solves until the error of the answer is `adapt_tol`, or the budget is spent. Guesses, modes, lengths and grids that
    /// go from one round to the next are those of a copy of the problem: what was stated stays as it was. Warm starts and
    /// derivatives are those of the answer, on the grid that was reached.
    pub(super) fn adapt(&mut self, start: Start, request: &Request, control: &mut Control) -> Result<&OcpResult> {
        let clock = Instant::now();
        let tol = self.settings.accuracy_tol.min((RESOLUTION * self.settings.adapt_tol).max(1e-13));
        let request = Request { comparison: Some(Comparison { tol, by_stage: true }), ..*request };
        let mut work = self.blank();
        if let Some(b) = self.built.as_ref().filter(|_| start == Start::Warm) {
            work.n_fe = b.n_fe().to_vec();
        }
        (work.built, work.engine) = (self.built.take(), self.engine.take());
        let mut rounds = Rounds { grown: vec![false; self.n_stages], ..Rounds::default() };
        let end = work.adapt_rounds(start, &request, &mut rounds, control);
        let aside = rounds.best.as_mut().and_then(|k| k.built.take());
        (self.built, self.engine) = (aside.or(work.built), work.engine);
        self.builds += work.builds;
        end?;
        let Rounds { mut story, spent, time_build, best: Some(Kept { mut result, .. }), cut_short, .. } = rounds else {
            return Err(Error::Internal("no round of the adaptation ended".into()));
        };
        story.reached = result.is_exact() && result.error() <= self.settings.adapt_tol;
        let accurate = story.rounds.iter().position(|r| r.exact && r.error <= self.settings.adapt_tol);
        if let Some(dear) = accurate.filter(|_| !story.reached) {
            result.add_remark(&format!(
                "round {dear} of the adaptation is as accurate as asked for but dearer: the answer is that of round {}",
                story.kept
            ));
        }
        if let Some((last, outcome)) = cut_short.filter(|c| c.0 != story.kept) {
            let end = outcome.name();
            result.add_remark(&format!(
                "round {last} of the adaptation ended by {end}: the answer is that of round {}",
                story.kept
            ));
            if result.outcome == Outcome::Solved && matches!(outcome, Outcome::Stopped | Outcome::MaxTime) {
                result.ended = Some(outcome);
            }
        }
        result.stats = Statistics { time_total: clock.elapsed().as_secs_f64() - time_build, ..spent };
        result.time_build = time_build;
        result.adaptation = Some(story);
        Ok(self.result.insert(result))
    }

    fn adapt_rounds(
        &mut self,
        start: Start,
        request: &Request,
        rounds: &mut Rounds,
        control: &mut Control,
    ) -> Result<()> {
        let Settings { adapt_tol: tol, adapt_rounds, adapt_elements, .. } = self.settings;
        let mut start = start;
        loop {
            let r = match self.search(start, request, control) {
                Ok(r) => r.clone(),
                // what is asked to end has no value: that is no failure of the rounds before
                Err(e) => {
                    let why = stop::requested().filter(|_| rounds.best.is_some()).ok_or(e)?;
                    rounds.cut_short = Some((rounds.story.rounds.len(), why.into()));
                    return Ok(());
                }
            };
            // the search gives stages as many elements as its sequence needs
            let now = match &self.built {
                Some(b) => b.n_fe().to_vec(),
                None => self.elements(&request.options),
            };
            rounds.spent.add(&r.stats);
            rounds.time_build += r.time_build;
            let last = rounds.story.rounds.len();
            rounds.story.rounds.push(Round {
                elements: now.clone(),
                n_variables: r.dimensions.0,
                error: r.error(),
                cost: r.cost,
                exact: r.polish == Polish::Done,
                iterations: r.stats.iterations,
            });
            if rounds.best.as_ref().is_none_or(|b| r.is_better_than(&b.result, tol)) {
                rounds.story.kept = last;
                rounds.best = Some(Kept { result: r.clone(), built: None });
            }
            if !matches!(r.outcome, Outcome::Solved | Outcome::Stalled) {
                rounds.cut_short = Some((last, r.outcome));
                return Ok(());
            }
            let elements = self.next_grid(&r, &now, &mut rounds.grown);
            let sizes = (now.iter().sum::<usize>(), elements.iter().sum::<usize>());
            let reached = r.is_exact() && r.error() <= tol;
            if last >= adapt_rounds as usize
                || elements == now
                || sizes.1 > adapt_elements as usize
                || elements.iter().any(|n| *n > MAX_ELEMENTS)
                || (reached && WORTH * sizes.1 as f64 > sizes.0 as f64)
            {
                return Ok(());
            }
            self.carry_over(&r)?;
            self.set_elements(&elements)?;
            if let Some(best) = rounds.best.as_mut().filter(|_| rounds.story.kept == last) {
                best.built = self.built.take();
            }
            start = Start::Carried;
        }
    }

    /// Elements of every stage for the round after the one with the answer `r` on the grid `now`.
    fn next_grid(&self, r: &OcpResult, now: &[usize], grown: &mut [bool]) -> Vec<usize> {
        let order = r.trajectory.tableau().order().max(1) as f64;
        let phases = phases_of(r, self.n_stages);
        let simulated = r.accuracy.as_ref().map_or(&[][..], |a| &a.stages);
        let stuck = simulated.iter().position(|m| m.is_nan());
        let local = r.accuracy.as_ref().map_or(&[][..], |a| &a.local);
        // errors of the stages grow on their way to the end
        let largest = local.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let growth = (r.error() / largest).max(1.0);
        let share = SHARE * self.settings.adapt_tol / growth;
        let mut next = now.to_vec();
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
    pub(super) fn carry_over(&mut self, r: &OcpResult) -> Result<()> {
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
        self.params = self.params_from(r);
        // phases of a simulation know no grid, which may have fewer elements
        self.modes = (r.is_exact() && r.phases.is_empty()).then(|| r.modes());
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

    /// What it costs by itself and in a simulation, whichever is more; `None` where no simulation confirms it.
    fn surely_costs(&self) -> Option<f64> {
        let a = self.accuracy.as_ref().filter(|a| self.is_exact() && a.reached() && a.apart.is_none())?;
        Some(self.cost.max(a.cost)).filter(|c| c.is_finite())
    }

    /// Solved ones are better, then exact ones, then those that can be simulated, then those with the error asked for,
    /// among them the smaller, else the more accurate.
    fn is_better_than(&self, other: &OcpResult, tol: f64) -> bool {
        let reached = |r: &OcpResult| r.error() <= tol;
        // what is cheaper in a simulation, too, and by more than errors are worth, is another optimum: no accuracy makes up for it
        match (self.surely_costs(), other.surely_costs()) {
            (Some(a), _) if a < other.cost - LOWER * other.cost.abs() => return true,
            (_, Some(b)) if b < self.cost - LOWER * self.cost.abs() => return false,
            _ => {}
        }
        let rank = |r: &OcpResult| (r.outcome != Outcome::Solved, !r.is_exact(), r.error().is_nan(), !reached(r));
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
