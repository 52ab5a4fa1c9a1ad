//! Several starting points at once. Every start is a solve of its own, so the results do not depend on the number of threads.

use std::sync::Mutex;

use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::nlp::middle;
use crate::nlp::{Control, IterationInfo, Outcome};
use crate::parallel;
use crate::random::SplitMix64;

/// Pieces of the horizon on which coarse guesses are constant, in turn, and the share of them that is at either bound.
const COARSE: [usize; 4] = [1, 2, 4, 8];
const AT_BOUND: f64 = 0.25;

/// A function around the solve of one start on its thread, see [`Ocp::solve_starts_within`].
pub type Around<'a> = &'a (dyn Fn(&mut dyn FnMut() -> Result<()>) -> Result<()> + Sync);

/// Results of several starts.
#[derive(Debug, Clone)]
pub struct Starts {
    /// The start that is the result of the problem now: the lowest cost among the solved ones, and among equals the first.
    pub best: usize,
    /// Result of every start, or why it could not be solved.
    pub results: Vec<Result<OcpResult>>,
}

impl Ocp {
    /// Solves from several guesses of the controls, `[n_stages · nu]` each, on `threads` threads (0: one for each processor), one of which is that of the
    /// caller, and keeps the best solution. With more than one, functions of the model are called from several threads
    /// at once; if one of them is [serial](crate::func::Function::is_serial), the thread of the caller does it all. A start that fails does not keep the others from being solved; `Err` if all fail.
    ///
    /// `control` interrupts all of them; its monitor sees the iterations on the thread of the caller only, and stops all.
    pub fn solve_starts(&mut self, controls: &[Vec<f64>], threads: usize, control: &mut Control) -> Result<Starts> {
        self.solve_starts_within(controls, threads, control, &|body| body())
    }

    /// Solves like [`Ocp::solve_starts`], every solve within `around`: for what is kept per thread.
    pub fn solve_starts_within(
        &mut self,
        controls: &[Vec<f64>],
        threads: usize,
        control: &mut Control,
        around: Around,
    ) -> Result<Starts> {
        if controls.is_empty() {
            return Err(Error::Dimension("no starting point is given".into()));
        }
        let mut problems = Vec::with_capacity(controls.len());
        for u in controls {
            let mut p = self.blank();
            p.set_u_guess(u)?;
            problems.push(Mutex::new(p));
        }
        let threads = parallel::threads(threads, self.statement().is_serial());
        let mut stop = control.stop.clone().with_flag();
        stop.limit(self.settings.max_time);
        let one = |k: usize, control: &mut Control| -> Result<()> {
            around(&mut || {
                let mut p = problems[k].lock().map_err(|_| Error::Internal("a start is poisoned".into()))?;
                let stopped = p.solve(control)?.outcome == Outcome::Stopped;
                if stopped {
                    stop.raise_flag();
                }
                Ok(())
            })
        };
        let watched = control.monitor.is_some();
        let mut monitor = |i: &IterationInfo| control.monitor.as_mut().is_none_or(|f| f(i));
        let monitor: Option<&mut dyn FnMut(&IterationInfo) -> bool> = if watched { Some(&mut monitor) } else { None };
        let mut own = Control { stop: stop.clone(), monitor };
        let other = |k: usize| one(k, &mut Control::of(stop.clone()));
        let ends = parallel::each(controls.len(), threads, &mut |k| one(k, &mut own), &other);
        let missing = || Err(Error::Internal("a thread of the starts panicked".into()));
        let mut problems: Vec<Option<Ocp>> = problems.into_iter().map(|p| p.into_inner().ok()).collect();
        let mut results: Vec<Result<OcpResult>> = problems.iter().map(|_| missing()).collect();
        for (k, end) in ends.into_iter().enumerate() {
            let Some(end) = end else { continue };
            let found = problems[k].as_ref().and_then(|p| p.result.clone());
            results[k] = end.and_then(|()| found.map_or_else(missing, Ok));
        }
        let value = |k: &usize| match &results[*k] {
            Ok(r) if r.is_solution() && !r.priced.is_nan() => (0, r.priced),
            Ok(r) => (1, r.residuals.primal),
            Err(_) => (2, 0.0),
        };
        let order = |a: &usize, b: &usize| {
            let (a, b) = ((value(a), a), (value(b), b));
            a.0 .0.cmp(&b.0 .0).then(a.0 .1.total_cmp(&b.0 .1)).then(a.1.cmp(b.1))
        };
        let best = (0..results.len()).min_by(order).unwrap_or(0);
        if let Err(e) = &results[best] {
            return Err(e.clone());
        }
        if let Some(p) = problems[best].take() {
            let own = self.u_guess.take();
            *self = p;
            self.u_guess = own;
        }
        Ok(Starts { best, results })
    }

    /// `n` guesses of the controls for [`Ocp::solve_starts`]: the guess a solve starts from, then random ones within the
    /// bounds of the controls, which take the place of infinity at a distance of 1 (or the size of the other bound). The
    /// same `seed` gives the same guesses.
    pub fn random_starts(&self, n: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut numbers = SplitMix64::new(seed);
        let ranges = self.control_ranges();
        let one = |k: usize, numbers: &mut SplitMix64| -> Vec<f64> {
            if k == 0 {
                return self.control_guess();
            }
            let drawn = (0..self.n_stages).flat_map(|_| &ranges).map(|[l, u]| l + (u - l) * numbers.share());
            self.within_bounds(drawn.collect())
        };
        (0..n).map(|k| one(k, &mut numbers)).collect()
    }

    /// `n` guesses of the controls, each constant on pieces of the horizon, where a control is at one of its bounds or between them: what they
    /// lead to is spread further than what controls do that are drawn anew for every stage, which cancel each other. The
    /// same `seed` gives the same guesses.
    pub(super) fn coarse_starts(&self, n: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut numbers = SplitMix64::new(seed);
        let ranges = self.control_ranges();
        let mut one = |k: usize| -> Vec<f64> {
            let drawn = numbers.on_pieces(self.n_stages, COARSE[k % COARSE.len()], ranges.len());
            let value = |((which, between), [l, u]): ((f64, f64), &[f64; 2])| match which {
                w if w < AT_BOUND => *l,
                w if w < 2.0 * AT_BOUND => *u,
                _ => l + (u - l) * between,
            };
            self.within_bounds(drawn.into_iter().zip(ranges.iter().cycle()).map(value).collect())
        };
        (0..n).map(&mut one).collect()
    }

    /// Ranges in which controls are drawn: their bounds, which take the place of infinity at a distance of 1, or the size of the other bound.
    pub(super) fn control_ranges(&self) -> Vec<[f64; 2]> {
        let range = |(l, u): (&f64, &f64)| {
            let size = |v: f64| if v.is_finite() { v.abs().max(1.0) } else { 1.0 };
            let at = middle(*l, *u);
            [if l.is_finite() { *l } else { at - size(*u) }, if u.is_finite() { *u } else { at + size(*l) }]
        };
        self.u_bounds[0].iter().zip(&self.u_bounds[1]).map(range).collect()
    }

    /// Bounds of the controls of a stage, those that are chosen already as they are.
    pub(super) fn control_bounds(&self, stage: usize) -> [&[f64]; 2] {
        let nu = self.u_bounds[0].len();
        match &self.chosen {
            Some(bounds) => [0, 1].map(|side| &bounds[side][stage * nu..(stage + 1) * nu]),
            None => [&self.u_bounds[0], &self.u_bounds[1]],
        }
    }

    /// Bounds of a control of a stage, among which slacks are behind those of the user.
    pub(super) fn bounds_of_control(&self, stage: usize, j: usize) -> [f64; 2] {
        match self.control_bounds(stage).map(|b| b.get(j).copied()) {
            [Some(l), Some(u)] => [l, u],
            _ => [0.0, f64::INFINITY],
        }
    }

    /// Controls `[n_stages · nu]`, moved into their bounds.
    pub(super) fn within_bounds(&self, mut controls: Vec<f64>) -> Vec<f64> {
        self.clamp(&mut controls);
        controls
    }

    /// Moves controls `[n_stages · nu]` into their bounds.
    pub(super) fn clamp(&self, controls: &mut [f64]) {
        let nu = self.u_bounds[0].len().max(1);
        for (k, u) in controls.chunks_exact_mut(nu).enumerate() {
            let [lower, upper] = self.control_bounds(k);
            u.iter_mut().zip(lower.iter().zip(upper)).for_each(|(u, (l, h))| *u = u.max(*l).min(*h));
        }
    }

    /// The problem as stated, nothing built and nothing solved.
    pub fn blank(&self) -> Ocp {
        Ocp {
            system: self.system.clone(),
            settings: self.settings,
            horizon: self.horizon,
            n_stages: self.n_stages,
            projected: self.projected.clone(),
            t0: self.t0,
            durations: self.durations.clone(),
            time: self.time,
            time_bounds: self.time_bounds,
            n_fe: self.n_fe.clone(),
            linear: self.linear.clone(),
            lagrange: self.lagrange.clone(),
            mayer: self.mayer.clone(),
            squares: self.squares.clone(),
            path: self.path.clone(),
            terminal: self.terminal.clone(),
            boundary: self.boundary.clone(),
            soft: self.soft.clone(),
            complementarity: self.complementarity.clone(),
            x_bounds: self.x_bounds.clone(),
            x0_bounds: self.x0_bounds.clone(),
            u_bounds: self.u_bounds.clone(),
            chosen: self.chosen.clone(),
            p_bounds: self.p_bounds.clone(),
            nominal: self.nominal.clone(),
            params: self.params.clone(),
            stage_params: self.stage_params.clone(),
            x_guess: self.x_guess.clone(),
            u_guess: self.u_guess.clone(),
            modes: self.modes.clone(),
            clearance: None,
            inside: Vec::new(),
            built: None,
            builds: 0,
            engine: None,
            result: None,
            sizes: self.sizes.clone(),
            measured: None,
            largest: 0.0,
            shifted: None,
            simulated: super::simulated::State { only: self.simulated.only, ..Default::default() },
            scene: self.scene.blank(),
        }
    }
}
