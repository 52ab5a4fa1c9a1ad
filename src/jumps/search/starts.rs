//! Where searches begin: motions of simulations and of relaxed programs, and the modes that are read off them.

use super::super::complementary;
use super::super::frozen;
use super::super::modes::{ContactMode, Key};
use super::super::shots::{Shot, Volley};
use super::super::simulate::simulate;
use super::super::stepping;
use super::super::track::{interpolate, Piece, Track};
use super::super::transcribe::Transcription;
use super::{Answer, Method, Options, Search, Seen, ITERATIONS, NEAR_ITERATIONS};
use crate::error::Result;
use crate::mpcc::{Mpcc, MpccSettings, MpccSolver};
use crate::nlp::{Bounds, Control};
use crate::stop;

/// Relaxations at which FESD with jumps is asked for modes, and iterations it gets to each of them.
const STOPS: [f64; 3] = [1e-1, 1e-2, 1e-4];
const COMPLEMENTARY_ITERATIONS: usize = 200;

/// Steps of a control stage in time stepping, the relaxations at which it is asked for modes, and its iterations to each of them.
const STEPS: usize = 2;
const STEPPING_STOPS: [f64; 2] = [1e-2, 1e-4];
const STEPPING_ITERATIONS: usize = 500;
/// How often the steps are halved where their sequences have no solution.
const REFINED: usize = 2;

/// Shots whose modes are tried.
const SHOTS: usize = 10;

/// First relaxation of time-freezing, as a multiple of that of other programs: its multipliers are made those of the relaxed conditions at the states
/// of the guess, and with a wider one they say less of which contact is next.
const FROZEN_SIGMA: f64 = 0.1;
/// Relaxations at which time-freezing is asked for modes, and its iterations to each of them.
const FROZEN_STOPS: [f64; 2] = [1e-2, 1e-3];
const FROZEN_ITERATIONS: usize = 250;

/// Where a search begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// The simulation of the guessed controls, or modes that are given.
    Guess,
    /// Time stepping from the initial state.
    Steps,
    /// Simulated shots that nearly meet the constraints.
    Shots,
    /// Time stepping from a straight line to the target.
    StepsOnLine,
    /// Time stepping with shorter steps, from what it has found with longer ones.
    FineSteps,
    /// FESD with jumps, from the motion of time stepping.
    ComplementaritySteps,
    /// FESD with jumps, from the initial state and from that line.
    Complementarity,
    /// Time-freezing, from both.
    Freezing,
}

impl Start {
    /// Is it only for want of a solution?
    pub(super) fn is_for_want(self) -> bool {
        !matches!(self, Start::Guess | Start::Steps)
    }
}

/// Starts of a search, in the order they are tried.
pub(super) fn starts(o: &Options) -> Vec<Start> {
    use Start::{Complementarity, ComplementaritySteps, FineSteps, Freezing, Guess, Shots, Steps, StepsOnLine};
    match o.method {
        Method::Auto if o.sequence.is_some() => vec![Guess],
        Method::Auto => vec![Guess, Steps, Shots, FineSteps, StepsOnLine, ComplementaritySteps, Complementarity],
        Method::Modes => vec![Guess],
        Method::Steps => vec![Steps, FineSteps, StepsOnLine],
        Method::Shots => vec![Shots],
        Method::Freezing => vec![Freezing],
        Method::FesdJ if o.sequence.is_some() => vec![Guess, Complementarity],
        Method::FesdJ => vec![Complementarity],
    }
}

/// A relaxed program that is solved from stop to stop of its relaxation.
trait Relaxed {
    /// The program, its bounds, and where it starts.
    fn parts(&mut self) -> (&mut dyn Mpcc, &Bounds, &[f64]);
}

impl Relaxed for Transcription {
    fn parts(&mut self) -> (&mut dyn Mpcc, &Bounds, &[f64]) {
        (&mut self.program, &self.bounds, &self.start)
    }
}

impl Relaxed for frozen::Program {
    fn parts(&mut self) -> (&mut dyn Mpcc, &Bounds, &[f64]) {
        (&mut self.fesd, &self.bounds, &self.start)
    }
}

impl Search<'_> {
    /// The best answer that a start leads to, if it is better than those before.
    pub(super) fn explore(&mut self, start: Start, control: &mut Control) -> Result<()> {
        self.compete(control, |s, control| s.begin(start, control).map(|()| true))
    }

    fn begin(&mut self, start: Start, control: &mut Control) -> Result<()> {
        match start {
            Start::Guess => self.start_at_guess(control),
            Start::Steps => self.start_with_steps(&self.options.states, control),
            Start::Shots => self.start_with_shots(control),
            Start::FineSteps => self.refine_steps(control),
            Start::ComplementaritySteps => self.start_with_complementarity_at_steps(control),
            Start::StepsOnLine => match self.line() {
                Some(line) => self.start_with_steps(&Some(line), control),
                None => Ok(()),
            },
            Start::Complementarity => self.start_with_complementarity(control),
            Start::Freezing => self.start_with_freezing(control),
        }
    }

    /// Solves for the modes of an answer, from its point where the program is the same.
    pub(super) fn start_at_answer(&mut self, last: &Answer, control: &mut Control) -> Result<()> {
        self.attempt_from(&last.planned, &last.track, Some(&last.point), ITERATIONS, control).map(|_| ())
    }

    /// Simulates the guess and solves for its modes.
    pub(super) fn start_at_guess(&mut self, control: &mut Control) -> Result<()> {
        let o = self.options;
        let durations = &self.p.given.durations;
        if let Some(sequence) = &o.sequence {
            let guess = self.plain_track(o.states.as_ref());
            return self.attempt(sequence, &guess, ITERATIONS, control).map(|_| ());
        }
        if o.method == Method::FesdJ {
            return Ok(());
        }
        let run = simulate(self.p, &o.x0, &o.controls, durations)?;
        self.seen = Seen::Simulated(run.paradox());
        let track = run.track(self.p, &o.controls, durations)?;
        self.attempt(&track.sequence(self.p.n_stages()), &track, NEAR_ITERATIONS, control).map(|_| ())
    }

    /// The initial state all the time, or states at times.
    pub(super) fn plain_track(&self, states: Option<&(Vec<f64>, Vec<f64>)>) -> Track {
        let (g, o) = (&self.p.given, self.options);
        let (nx, n_c, n_s) = (g.dims.x, self.p.n_contacts(), g.tableau.n_s);
        let at = |t: f64| match states {
            Some((times, x)) => interpolate(times, x, t - g.t0, nx),
            None => o.x0.clone(),
        };
        let mut pieces = Vec::new();
        let mut t = g.t0;
        for (k, &h) in g.durations.iter().enumerate() {
            pieces.push(Piece {
                t,
                h,
                stage: k,
                modes: vec![ContactMode::Open; n_c],
                x0: at(t),
                xs: g.tableau.c.iter().flat_map(|c| at(t + c * h)).collect(),
                forces: vec![0.0; n_s * n_c * 2],
                ..Default::default()
            });
            t += h;
        }
        Track { tableau: g.tableau.clone(), nx, pieces, controls: o.controls.clone(), free: Vec::new() }
    }

    /// A straight line from the initial state to the target, where that is known and nothing else was given.
    pub(super) fn line(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let o = self.options;
        let target = o.target.as_ref().filter(|_| o.states.is_none())?;
        Some((vec![0.0, self.p.given.durations.iter().sum()], [&o.x0[..], &target[..]].concat()))
    }

    /// Modes of simulations that nearly meet the constraints, and, where none of them has a solution, of those that meet them as well as can be.
    pub(super) fn start_with_shots(&mut self, control: &mut Control) -> Result<()> {
        let mut volley = Volley::new(self.p, self.options)?;
        let shots = volley.shots()?;
        self.try_shots(shots, control)?;
        if !self.is_solved() && stop::requested().is_none() {
            let closer = volley.closer()?;
            // orders that were tried have other motions to begin with now
            let keys: Vec<Key> = closer.iter().map(|s| s.track.sequence(self.p.n_stages()).key()).collect();
            self.tried.retain(|t| !keys.contains(&t.0));
            self.try_shots(closer, control)?;
        }
        Ok(())
    }

    fn try_shots(&mut self, shots: Vec<Shot>, control: &mut Control) -> Result<()> {
        let mut left = SHOTS;
        for shot in shots {
            let sequence = shot.track.sequence(self.p.n_stages());
            if left == 0 || stop::requested().is_some() {
                break;
            }
            if self.is_new(&sequence) {
                left -= 1;
                self.attempt(&sequence, &shot.track, NEAR_ITERATIONS, control)?;
            }
        }
        Ok(())
    }

    /// Time stepping. At several stops of its relaxation sequences are read from its motion: with all its contacts, and without those
    /// that hardly count.
    pub(super) fn start_with_steps(
        &mut self,
        states: &Option<(Vec<f64>, Vec<f64>)>,
        control: &mut Control,
    ) -> Result<()> {
        let guess = self.plain_track(states.as_ref());
        self.follow_steps(STEPS, &guess, self.options.solver.sigma_init, control)
    }

    /// Time stepping again, with steps that are shorter and shorter, each from the motion of the last: coarse steps find where contacts are
    /// worth it, but a motion with them need not have one without their error beside it.
    pub(super) fn refine_steps(&mut self, control: &mut Control) -> Result<()> {
        for _ in 0..REFINED {
            let Some((guess, n)) = self.coarse.clone() else { break };
            if self.is_solved() || stop::requested().is_some() {
                break;
            }
            self.follow_steps(2 * n, &guess, STEPPING_STOPS[0], control)?;
        }
        Ok(())
    }

    pub(super) fn follow_steps(&mut self, n: usize, guess: &Track, sigma: f64, control: &mut Control) -> Result<()> {
        let coarse = self.p.with_one_stage_point()?;
        let mut t = stepping::transcribe(&coarse, n, guess);
        let relaxed = (sigma, &STEPPING_STOPS[..], STEPPING_ITERATIONS);
        self.along_relaxation(&mut t, relaxed, control, |search, t, from, control| {
            for level in stepping::LEVELS {
                let found = stepping::motion(&coarse, t, from, level);
                // what costs more than the motion with more contacts is not followed for long
                let most = if search.is_solved() { NEAR_ITERATIONS } else { ITERATIONS };
                search.attempt(&found.sequence(search.p.n_stages()), &found, most, control)?;
            }
            search.coarse = Some((complementary::read(&coarse, t, from), n));
            let found = stepping::motion(&coarse, t, from, stepping::LEVELS[0]);
            search.try_simulation_of(&found, &t.state(&coarse, t.x0, from), control)
        })
    }

    /// FESD with jumps from the motion of time stepping, which is nearly one of its own: its relaxation begins where that of steps ends.
    pub(super) fn start_with_complementarity_at_steps(&mut self, control: &mut Control) -> Result<()> {
        match self.coarse.clone() {
            Some((guess, _)) => self.follow_homotopy(&guess, STEPPING_STOPS[0], control),
            None => Ok(()),
        }
    }

    /// FESD with jumps from the initial state, and, where that leads to no solution, from a straight line to the target.
    pub(super) fn start_with_complementarity(&mut self, control: &mut Control) -> Result<()> {
        let o = self.options;
        let line = self.line();
        for states in [o.states.clone(), line.clone()] {
            let again = states.is_some() && states == line;
            let solved = self.best.as_ref().is_some_and(|b| b.0.is_solved());
            if again && (solved || stop::requested().is_some()) {
                break;
            }
            let guess = self.plain_track(states.as_ref());
            self.follow_homotopy(&guess, o.solver.sigma_init, control)?;
            if line.is_none() {
                break;
            }
        }
        Ok(())
    }

    /// FESD with jumps. At several stops of its relaxation its modes are read, and those of the simulation of its controls: far
    /// from the end it has seen more of the other motions, near the end it knows better when contacts close.
    pub(super) fn follow_homotopy(&mut self, guess: &Track, sigma: f64, control: &mut Control) -> Result<()> {
        let o = self.options;
        let mut t = complementary::transcribe(self.p, o.n_fe, o.rho_h, guess);
        let stops: Vec<f64> = STOPS.into_iter().filter(|s| *s <= sigma).collect();
        self.along_relaxation(&mut t, (sigma, &stops, COMPLEMENTARY_ITERATIONS), control, |search, t, from, control| {
            search.try_motion(&complementary::read(search.p, t, from), control)
        })
    }

    /// Time-freezing, by implicit Euler, from the initial state or the guessed states, and, where that leads to no solution, from a straight line
    /// to the target.
    pub(super) fn start_with_freezing(&mut self, control: &mut Control) -> Result<()> {
        let (o, p) = (self.options, self.p);
        let durations = &p.given.durations;
        let seen = simulate(p, &o.x0, &o.controls, durations)?.track(p, &o.controls, durations)?;
        let coarse = p.with_one_stage_point()?;
        let line = self.line();
        let sigma = FROZEN_SIGMA * o.solver.sigma_init;
        for states in std::iter::once(o.states.clone()).chain(line.map(Some)) {
            if self.is_solved() || stop::requested().is_some() {
                break;
            }
            let guess = self.plain_track(states.as_ref());
            let mut t = frozen::transcribe(&coarse, (&guess, &seen), o.target.as_deref(), sigma)?;
            self.freezing = Some(t.report.clone());
            let relaxed = (sigma, &FROZEN_STOPS[..], FROZEN_ITERATIONS);
            self.along_relaxation(&mut t, relaxed, control, |search, t, from, control| {
                search.try_motion(&t.read(&coarse, from), control)
            })?;
        }
        Ok(())
    }

    /// Solves a relaxed program from stop to stop of its relaxation, each from the point before; `each` reads sequences from the
    /// point. Given are the first relaxation, the stops, and the iterations to each of them.
    fn along_relaxation<R: Relaxed>(
        &mut self,
        t: &mut R,
        (mut sigma, stops, most): (f64, &[f64], usize),
        control: &mut Control,
        mut each: impl FnMut(&mut Self, &R, &[f64], &mut Control) -> Result<()>,
    ) -> Result<()> {
        let o = self.options;
        let max_iter = o.solver.max_iter.min(most);
        let settings = MpccSettings { polish: false, certify: false, early_polish: false, max_iter, ..o.solver };
        let (program, _, start) = t.parts();
        let mut from = start.to_vec();
        let mut solver = MpccSolver::new(program, settings)?;
        for &end in stops {
            if stop::requested().is_some() {
                break;
            }
            solver.settings.sigma_init = sigma;
            solver.settings.sigma_min = end;
            sigma = end;
            let (program, bounds, _) = t.parts();
            let solution = solver.solve(program, bounds, &from, control).clone();
            let dimensions = (program.n(), program.m(), program.pairs().len());
            self.note(dimensions, &solution.stats);
            if !solution.residuals.primal.is_finite() {
                break;
            }
            from.copy_from_slice(&solution.x);
            each(self, t, &from, control)?;
        }
        Ok(())
    }

    /// The modes of a motion, and those of the simulation of its controls.
    fn try_motion(&mut self, found: &Track, control: &mut Control) -> Result<()> {
        self.attempt(&found.sequence(self.p.n_stages()), found, NEAR_ITERATIONS, control)?;
        match found.pieces.first().map(|q| q.x0.clone()) {
            Some(x0) => self.try_simulation_of(found, &x0, control),
            None => Ok(()),
        }
    }

    /// The modes of the simulation of the controls of a motion.
    pub(super) fn try_simulation_of(&mut self, found: &Track, x0: &[f64], control: &mut Control) -> Result<()> {
        let lengths = self.stage_lengths(found);
        if let Ok(run) = simulate(self.p, x0, &found.controls, &lengths) {
            let track = run.track(self.p, &found.controls, &lengths)?;
            self.attempt(&track.sequence(self.p.n_stages()), &track, NEAR_ITERATIONS, control)?;
        }
        Ok(())
    }

    pub(super) fn stage_lengths(&self, track: &Track) -> Vec<f64> {
        let mut lengths = vec![0.0; self.p.n_stages()];
        track.pieces.iter().for_each(|p| lengths[p.stage] += p.h);
        lengths
    }
}
