//! Where orders of contacts come from: simulations, time stepping and relaxed programs, a part of each at a time.

use std::collections::VecDeque;
use std::rc::Rc;

use super::answer::Answer;
use super::complementary;
use super::frozen;
use super::modes::{ContactMode, Sequence};
use super::options::{Method, Options};
use super::problem::Problem;
use super::simulate::{simulate, Met};
use super::space::{Motion, Order};
use super::stepping;
use super::track::{interpolate, Piece, Track};
use super::transcribe::Transcription;
use crate::error::Result;
use crate::freezing::Report;
use crate::mpcc::{Mpcc, MpccSettings, MpccSolver};
use crate::nlp::{Bounds, Control, Outcome};
use crate::search::{Budget, Candidate, Source};
use crate::stop;

/// Relaxations at which FESD with jumps is asked for modes, and iterations it gets to each of them.
const STOPS: [f64; 3] = [1e-1, 1e-2, 1e-4];
const COMPLEMENTARY_ITERATIONS: usize = 200;

/// Steps of a control stage in time stepping, the relaxations at which it is asked for modes, and its iterations to each of them.
const STEPS: usize = 2;
const STEPPING_STOPS: [f64; 2] = [1e-2, 1e-4];
const STEPPING_ITERATIONS: usize = 500;

/// First relaxation of time-freezing, as a multiple of that of other programs: its multipliers are made those of the relaxed conditions at the states
/// of the guess, and with a wider one they say less of which contact is next.
const FROZEN_SIGMA: f64 = 0.1;
/// Relaxations at which time-freezing is asked for modes, and its iterations to each of them.
const FROZEN_STOPS: [f64; 2] = [1e-2, 1e-3];
const FROZEN_ITERATIONS: usize = 250;

/// Times and states that a relaxed program begins with.
type States = Option<(Vec<f64>, Vec<f64>)>;

/// Relaxed programs that are to be followed.
enum Begin {
    /// Time stepping, from the initial state or states.
    Steps(States),
    /// Time stepping with steps half as long, from what it has found with longer ones.
    FinerSteps,
    /// FESD with jumps, from the motion of time stepping.
    JumpsAtSteps,
    /// FESD with jumps, from the initial state or states.
    Jumps(States),
    /// Time-freezing, from the initial state or states.
    Freezing(States),
}

enum Kind {
    Steps { coarse: Problem, t: Box<Transcription>, n: usize },
    Jumps(Box<Transcription>),
    Freezing { coarse: Problem, t: Box<frozen::Program> },
}

/// A relaxed program that is followed from stop to stop of its relaxation, each from the point before; at every stop motions are read off it.
struct Relaxed {
    kind: Kind,
    solver: MpccSolver,
    from: Vec<f64>,
    sigma: f64,
    stops: VecDeque<f64>,
    /// Had it a solution at the last stop, as far as is known?
    is_feasible: bool,
}

impl Relaxed {
    fn new(mut kind: Kind, settings: MpccSettings, sigma: f64, stops: &[f64], most: usize) -> Result<Relaxed> {
        let max_iter = settings.max_iter.min(most);
        let settings = MpccSettings { polish: false, certify: false, early_polish: false, max_iter, ..settings };
        let (program, _, start) = kind.parts();
        let from = start.to_vec();
        let solver = MpccSolver::new(program, settings)?;
        let stops = stops.iter().copied().filter(|s| *s <= sigma).collect();
        Ok(Relaxed { kind, solver, from, sigma, stops, is_feasible: true })
    }

    /// Goes to the next stop; false where there is none, or the program leads nowhere. What has no solution has none with a smaller relaxation either.
    fn go_on(&mut self, budget: &mut Budget, control: &mut Control) -> bool {
        let Some(end) = self.stops.pop_front() else { return false };
        self.solver.settings.sigma_init = self.sigma;
        self.solver.settings.sigma_min = end;
        self.sigma = end;
        let (program, bounds, _) = self.kind.parts();
        let solution = self.solver.solve(program, bounds, &self.from, control);
        budget.solved(self.from.len(), &solution.stats);
        self.is_feasible = !matches!(solution.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible);
        let leads = solution.residuals.primal.is_finite();
        if leads {
            self.from.copy_from_slice(&solution.x);
        }
        if !self.is_feasible {
            self.stops.clear();
        }
        leads
    }
}

impl Kind {
    /// The program, its bounds, and where it starts.
    fn parts(&mut self) -> (&mut dyn Mpcc, &Bounds, &[f64]) {
        match self {
            Kind::Steps { t, .. } | Kind::Jumps(t) => (&mut t.program, &t.bounds, &t.start),
            Kind::Freezing { t, .. } => (&mut t.fesd, &t.bounds, &t.start),
        }
    }
}

/// What a source has to do, and what it is at.
#[derive(Default)]
struct Programs {
    left: VecDeque<Begin>,
    at: Option<Relaxed>,
}

/// The sources of a problem.
pub(super) struct Sources<'a> {
    p: &'a Problem,
    options: &'a Options,
    /// Orders that are given, with their motions.
    pub(super) given: VecDeque<(Sequence, Motion)>,
    is_simulated: bool,
    /// What the simulation of the guess met, once it was asked for.
    pub(super) met: Option<Met>,
    stepping: Programs,
    relaxation: Programs,
    has_stepped: bool,
    /// The motion that time stepping has found last, and the steps of a stage it had.
    coarse: Option<(Track, usize)>,
    /// What stood for the contacts when time-freezing was asked last.
    pub(super) freezing: Option<Report>,
    /// Starts so far.
    starts: usize,
}

impl<'a> Sources<'a> {
    pub(super) fn new(p: &'a Problem, options: &'a Options) -> Sources<'a> {
        let mut sources = Sources {
            p,
            options,
            given: VecDeque::new(),
            is_simulated: false,
            met: None,
            stepping: Programs::default(),
            relaxation: Programs::default(),
            has_stepped: false,
            coarse: None,
            freezing: None,
            starts: 0,
        };
        if let Some(sequence) = &options.sequence {
            let track = Rc::new(sources.plain_track(options.states.as_ref()));
            sources.give(sequence.clone(), track, None);
        }
        let (states, line) = (options.states.clone(), sources.line());
        let all = || std::iter::once(states.clone()).chain(line.clone().map(Some));
        let Sources { stepping, relaxation, .. } = &mut sources;
        stepping.left.push_back(Begin::Steps(states.clone()));
        stepping.left.push_back(Begin::FinerSteps);
        stepping.left.extend(line.clone().map(|l| Begin::Steps(Some(l))));
        stepping.left.push_back(Begin::FinerSteps);
        match options.method {
            Method::Freezing => relaxation.left.extend(all().map(Begin::Freezing)),
            _ => {
                relaxation.left.push_back(Begin::JumpsAtSteps);
                relaxation.left.extend(all().map(Begin::Jumps));
            }
        }
        sources
    }

    /// Gives an order that is solved for first.
    pub(super) fn give(&mut self, sequence: Sequence, track: Rc<Track>, point: Option<Rc<[Vec<f64>; 3]>>) {
        self.given.push_back((sequence, Motion { track, point, start: self.starts, given: true, close: false }));
        self.starts += 1;
    }

    /// The next part of what a source does.
    pub(super) fn next(
        &mut self,
        source: Source,
        best: Option<&Answer>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate<Order, Motion>>> {
        let solution = best.filter(|b| b.is_solved());
        match source {
            Source::Guess => {
                let given = self.given.pop_front();
                Ok(given.into_iter().map(|(s, motion)| Candidate::new(Order::new(s), motion)).collect())
            }
            Source::Simulation => self.simulation(budget),
            Source::Stepping | Source::Relaxation => self.relaxed(source, solution.is_some(), budget, control),
            _ => Ok(Vec::new()),
        }
    }

    /// Work that the first step of a source is expected to take.
    pub(super) fn expected(&self, source: Source) -> Option<f64> {
        let g = &self.p.given;
        // states, velocities behind impacts, forces with their multipliers
        let at_a_point = 2 * g.dims.x + 6 * self.p.n_contacts();
        let n = self.p.n_stages() * at_a_point;
        match source {
            Source::Stepping => Some((STEPS * n * STEPPING_ITERATIONS) as f64),
            Source::Relaxation => Some((self.options.n_fe * g.tableau.n_s * n * COMPLEMENTARY_ITERATIONS) as f64),
            _ => None,
        }
    }

    /// Motions of one start.
    fn start(&mut self, motions: impl IntoIterator<Item = Track>) -> Vec<Candidate<Order, Motion>> {
        let start = self.starts;
        self.starts += 1;
        let of = |track: Track| {
            let order = Order::new(track.sequence(self.p.n_stages()));
            let motion = Motion { track: Rc::new(track), point: None, start, given: false, close: false };
            Candidate::new(order, motion)
        };
        motions.into_iter().map(of).collect()
    }

    /// The simulation of the guess.
    fn simulation(&mut self, budget: &mut Budget) -> Result<Vec<Candidate<Order, Motion>>> {
        if std::mem::replace(&mut self.is_simulated, true) {
            return Ok(Vec::new());
        }
        let (o, durations) = (self.options, &self.p.given.durations);
        let run = simulate(self.p, &o.x0, &o.controls, durations)?;
        budget.simulated(self.p.given.dims.x, run.run.stats.steps);
        self.met = Some(run.met());
        let track = run.track(self.p, &o.controls, durations)?;
        Ok(self.start([track]))
    }

    /// The next stop of a relaxed program. All but the first are asked for want of a solution alone: in paired comparisons they have bettered none.
    fn relaxed(
        &mut self,
        source: Source,
        is_solved: bool,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate<Order, Motion>>> {
        let mut programs = std::mem::take(self.programs(source));
        let mut found = Vec::new();
        while found.is_empty() && stop::requested().is_none() {
            if programs.at.is_none() {
                let is_first = source == Source::Stepping && !std::mem::replace(&mut self.has_stepped, true);
                let Some(begin) = programs.left.pop_front().filter(|_| is_first || !is_solved) else { break };
                programs.at = self.begin(begin)?;
            }
            if let Some(program) = &mut programs.at {
                if program.go_on(budget, control) {
                    let motions = self.read(program, budget)?;
                    found = self.start(motions);
                } else {
                    programs.at = None;
                }
            }
        }
        *self.programs(source) = programs;
        Ok(found)
    }

    fn programs(&mut self, source: Source) -> &mut Programs {
        if source == Source::Stepping {
            &mut self.stepping
        } else {
            &mut self.relaxation
        }
    }

    /// A relaxed program at its first relaxation; nothing where there is none to begin with.
    fn begin(&mut self, begin: Begin) -> Result<Option<Relaxed>> {
        let (p, o) = (self.p, self.options);
        let wide = o.solver.sigma_init;
        let steps = |guess: &Track, n: usize, sigma: f64| -> Result<Option<Relaxed>> {
            let coarse = p.with_one_stage_point()?;
            let t = Box::new(stepping::transcribe(&coarse, n, guess));
            let kind = Kind::Steps { coarse, t, n };
            Relaxed::new(kind, o.solver, sigma, &STEPPING_STOPS, STEPPING_ITERATIONS).map(Some)
        };
        let jumps = |guess: &Track, sigma: f64| -> Result<Option<Relaxed>> {
            let kind = Kind::Jumps(Box::new(complementary::transcribe(p, o.n_fe, o.rho_h, guess)));
            Relaxed::new(kind, o.solver, sigma, &STOPS, COMPLEMENTARY_ITERATIONS).map(Some)
        };
        match begin {
            Begin::Steps(states) => steps(&self.plain_track(states.as_ref()), STEPS, wide),
            Begin::FinerSteps => match &self.coarse {
                Some((guess, n)) => steps(guess, 2 * n, STEPPING_STOPS[0]),
                None => Ok(None),
            },
            // nearly a motion of its own: its relaxation begins where that of steps ends
            Begin::JumpsAtSteps => match &self.coarse {
                Some((guess, _)) => jumps(guess, STEPPING_STOPS[0]),
                None => Ok(None),
            },
            Begin::Jumps(states) => jumps(&self.plain_track(states.as_ref()), wide),
            Begin::Freezing(states) => {
                let durations = &p.given.durations;
                let seen = simulate(p, &o.x0, &o.controls, durations)?.track(p, &o.controls, durations)?;
                let coarse = p.with_one_stage_point()?;
                let (guess, sigma) = (self.plain_track(states.as_ref()), FROZEN_SIGMA * wide);
                let t = Box::new(frozen::transcribe(&coarse, (&guess, &seen), sigma)?);
                self.freezing = Some(t.report.clone());
                let kind = Kind::Freezing { coarse, t };
                Relaxed::new(kind, o.solver, sigma, &FROZEN_STOPS, FROZEN_ITERATIONS).map(Some)
            }
        }
    }

    /// Motions of a relaxed program: its own, of time stepping also those without contacts that hardly count, and that of the simulation of its controls.
    fn read(&mut self, r: &Relaxed, budget: &mut Budget) -> Result<Vec<Track>> {
        let w = &r.from;
        let (mut motions, x0) = match &r.kind {
            Kind::Steps { coarse, t, n } => {
                if r.is_feasible {
                    self.coarse = Some((complementary::read(coarse, t, w), *n));
                }
                let of = |level: &f64| stepping::motion(coarse, t, w, *level);
                (stepping::LEVELS.iter().map(of).collect(), Some(t.state(coarse, t.x0, w)))
            }
            Kind::Jumps(t) => (vec![complementary::read(self.p, t, w)], None),
            Kind::Freezing { coarse, t } => (vec![t.read(coarse, w)], None),
        };
        let found: &Track = &motions[0];
        let x0 = x0.or_else(|| found.pieces.first().map(|q| q.x0.clone()));
        let mut lengths = vec![0.0; self.p.n_stages()];
        found.pieces.iter().for_each(|p| lengths[p.stage] += p.h);
        if let Some(run) = x0.and_then(|x0| simulate(self.p, &x0, &found.controls, &lengths).ok()) {
            budget.simulated(self.p.given.dims.x, run.run.stats.steps);
            let simulated = run.track(self.p, &found.controls, &lengths)?;
            motions.push(simulated);
        }
        Ok(motions)
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
    fn line(&self) -> States {
        let o = self.options;
        let target = self.p.given.target.as_ref().filter(|_| o.states.is_none())?;
        Some((vec![0.0, self.p.given.durations.iter().sum()], [&o.x0[..], &target[..]].concat()))
    }
}
