//! Motions under given controls by the event engine: guesses of modes, and replays of answers.

use super::modes::ContactMode;
use super::problem::Problem;
use super::scales;
use super::track::{Piece, Track};
use crate::error::{Error, Result};
use crate::event::{Engine, Impact, ImpactKind, Options, Outcome, Progress, Run, Statistics};
use crate::func::Point;
use crate::system::SharedFunction;

/// Tolerance of simulations that are guesses, relative to the sizes of the states, and their steps at most.
const TOLERANCE: f64 = 1e-6;
const MAX_STEPS: usize = 100_000;
/// Impacts and changes of modes of a simulation that is to be followed, which is left behind them: each is kept, and rounding may make them without end.
pub(super) const MAX_EVENTS: usize = 20_000;
/// Parts of a control stage that last less, as a share of it, are left out.
const SHORT: f64 = 1e-7;

/// A simulation with piecewise constant controls, and where it ended if it did not reach the end.
pub(super) struct Simulated {
    pub(super) run: Run,
    /// Ends of the control stages that were reached, the start first.
    pub(super) times: Vec<f64>,
    /// States there `[nx]` each.
    pub(super) states: Vec<f64>,
}

/// What is simulated.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    pub(super) x0: &'a [f64],
    /// Controls `[n_stages · wide.u]`.
    pub(super) controls: &'a [f64],
    /// Lengths of the stages.
    pub(super) durations: &'a [f64],
    /// Parameters of every stage `[n_stages · wide.p]`.
    pub(super) params: &'a [f64],
}

/// How accurately, with how many steps at most, and whether the motion between the ends of stages is kept.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort<'a> {
    pub(super) tolerance: f64,
    /// Sizes of the states that the tolerance is relative to where they pass through zero; none: 1.
    pub(super) sizes: &'a [f64],
    pub(super) max_steps: usize,
    /// Impacts and changes of modes at most: each may cost as much as hundreds of steps.
    pub(super) max_events: usize,
    pub(super) dense: bool,
    /// Does it end where it leaves the bounds that contacts were left out for? A guess need not: what is left out costs nothing then, and what
    /// programs make of it is simulated within them.
    pub(super) bounded: bool,
}

/// Simulates controls `[n_stages · wide.u]` over stages of lengths `durations`.
pub(super) fn simulate(p: &Problem, x0: &[f64], controls: &[f64], durations: &[f64]) -> Result<Simulated> {
    let sizes = scales::of_states(p, x0);
    let effort = Effort { sizes: &sizes, ..GUESS };
    simulate_with(p, Inputs { x0, controls, durations, params: &p.given.params }, effort)
}

/// The effort of a guess.
const GUESS: Effort = Effort {
    tolerance: TOLERANCE,
    sizes: &[],
    max_steps: MAX_STEPS,
    max_events: MAX_EVENTS,
    dense: true,
    bounded: false,
};

/// The same with other parameters and another effort.
pub(super) fn simulate_with(p: &Problem, inputs: Inputs, effort: Effort) -> Result<Simulated> {
    let Effort { tolerance, sizes, max_steps, max_events, dense, bounded } = effort;
    let mut options = Options { max_steps, dense, ..Options::with_tolerance(tolerance, tolerance) };
    if !sizes.is_empty() {
        options.atol = sizes.iter().map(|s| tolerance * s).collect();
    }
    let (g, mut engine) = (&p.given, Engine::new(&p.given.system, &options)?);
    if !bounded {
        engine.pass_bounds();
    }
    engine.reinit(g.t0, inputs.x0)?;
    let (mut times, mut states) = (vec![g.t0], inputs.x0.to_vec());
    let (mut u, mut params): (&[f64], &[f64]) = (&[], &[]);
    for (k, d) in inputs.durations.iter().enumerate() {
        let of_stage = &inputs.params[k * g.wide.p..k * g.wide.p + g.dims.p];
        let control = &inputs.controls[k * g.wide.u..k * g.wide.u + g.dims.u];
        // the engine finds its modes anew behind new data
        if k == 0 || of_stage != params {
            engine.set_params(of_stage)?;
        }
        if k == 0 || control != u {
            engine.set_controls(control)?;
        }
        (u, params) = (control, of_stage);
        let end = times[k] + d;
        let stop = end.max(engine.time());
        let few = |s: Statistics| s.switches + s.impacts <= max_events;
        while few(engine.stats()) && engine.step(stop)? != Progress::Done {}
        if !few(engine.stats()) || engine.outcome() != Outcome::Reached {
            break;
        }
        times.push(end);
        states.extend_from_slice(engine.state());
    }
    Ok(Simulated { run: engine.take_run(), times, states })
}

impl Simulated {
    /// The first contact whose friction and normal force contradict each other, and the time.
    pub(super) fn paradox(&self) -> Option<(usize, f64)> {
        self.run.impacts.iter().find(|i| i.kind == ImpactKind::Painleve).map(|i| (i.contact, i.t))
    }

    /// What it meets; an impact with the change of modes behind it is one change.
    pub(super) fn met(&self) -> Met {
        let changed = self.run.phases.windows(2).filter(|w| w[0].modes != w[1].modes).map(|w| w[1].t);
        let mut times: Vec<f64> = changed.chain(self.run.impacts.iter().map(|i| i.t)).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let within = |w: &[f64]| times.iter().filter(|&&t| w[0] < t && t <= w[1]).count();
        Met { paradox: self.paradox(), changes: self.times.windows(2).map(within).collect() }
    }

    /// The motion piece by piece; what was not reached is the last state at rest.
    pub(super) fn track(&self, p: &Problem, controls: &[f64], durations: &[f64]) -> Result<Track> {
        let n_stages = durations.len();
        let mut pieces = Vec::new();
        for k in 0..n_stages {
            let Some((&a, &b)) = self.times.get(k).zip(self.times.get(k + 1)) else { break };
            pieces.extend(self.stage(p, controls, (k, 1), [a, b])?);
        }
        self.rest(p, &mut pieces, durations);
        Ok(Track {
            tableau: p.given.tableau.clone(),
            nx: p.given.dims.x,
            pieces,
            controls: controls.to_vec(),
            free: Vec::new(),
        })
    }

    /// The motion from `a` to `b`, which are the ends of control stage `k`, piece by piece: `finer` times as many pieces of a phase as its program
    /// has elements.
    fn stage(&self, p: &Problem, controls: &[f64], (k, finer): (usize, usize), [a, b]: [f64; 2]) -> Result<Vec<Piece>> {
        let mut cuts = vec![a];
        let inside = |t: f64| t > a + SHORT * (b - a) && t < b - SHORT * (b - a);
        cuts.extend(self.run.phases.iter().map(|p| p.t).filter(|&t| inside(t)));
        cuts.extend(self.run.impacts.iter().map(|i| i.t).filter(|&t| inside(t)));
        cuts.push(b);
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|s, t| (*s - *t).abs() <= SHORT * (b - a));
        let mut pieces = Vec::new();
        for w in cuts.windows(2) {
            let n = ((finer * p.given.n_fe[k]) as f64 * (w[1] - w[0]) / (b - a)).ceil().max(1.0);
            let cut = |i: f64| if i < n { w[0] + i / n * (w[1] - w[0]) } else { w[1] };
            for i in 0..n as usize {
                pieces.push(self.piece(p, controls, k, [w[0], w[1]], [cut(i as f64), cut((i + 1) as f64)])?);
            }
        }
        Ok(pieces)
    }

    /// The part from `a` to `b` of a phase.
    fn piece(
        &self,
        p: &Problem,
        controls: &[f64],
        stage: usize,
        [start, end]: [f64; 2],
        [a, b]: [f64; 2],
    ) -> Result<Piece> {
        let g = &p.given;
        let path = self.run.path.as_ref().ok_or_else(|| Error::Internal("a simulation without output".into()))?;
        let (nx, n_c, h) = (g.dims.x, p.n_contacts(), b - a);
        let numbers = self.run.contact_modes(0.5 * (start + end))?;
        let modes: Vec<ContactMode> =
            numbers.iter().map(|&m| ContactMode::from_number(m).unwrap_or(ContactMode::Open)).collect();
        let mut piece = Piece { t: a, h, stage, modes, ..Piece::default() };
        piece.x0 = vec![0.0; nx];
        path.eval(if a > start { a } else { a + SHORT * h }, 0, &mut piece.x0)?;
        for c in &g.tableau.c {
            let (t, mut x) = ((a + c * h).min(b), vec![0.0; nx]);
            path.eval(t, 0, &mut x)?;
            piece.xs.extend_from_slice(&x);
            let forces = self.run.contact_forces(a + (c * h).min((1.0 - SHORT) * h))?;
            piece.forces.extend(forces.iter().flat_map(|f| [f[0], f[1]]));
        }
        if a > start {
            return Ok(piece);
        }
        let hits: Vec<&Impact> = self.run.impacts.iter().filter(|i| (i.t - a).abs() <= SHORT * (end - start)).collect();
        if hits.iter().any(|i| i.impulse[0] > 0.0) {
            let mut parts = vec![ContactMode::Open; n_c];
            piece.impulses = vec![0.0; 2 * n_c];
            for i in hits {
                piece.impulses[2 * i.contact] += i.impulse[0];
                piece.impulses[2 * i.contact + 1] += i.impulse[1];
                parts[i.contact] = self.direction(p, i.contact, &piece, controls);
            }
            for i in 0..n_c {
                // what stays closed holds against the impact
                if piece.modes[i].is_closed() && !parts[i].is_closed() {
                    parts[i] = piece.modes[i];
                }
            }
            piece.jump = Some(parts);
        }
        Ok(piece)
    }

    /// What a contact does behind an impact, by its sliding velocity there.
    fn direction(&self, p: &Problem, i: usize, piece: &Piece, controls: &[f64]) -> ContactMode {
        if piece.modes[i].is_closed() {
            return piece.modes[i];
        }
        let g = &p.given;
        let Some(f) = &p.functions.contacts[i].slide else { return ContactMode::Closed };
        let u = &controls[piece.stage * g.wide.u..piece.stage * g.wide.u + g.dims.u];
        let params = &g.params[piece.stage * g.wide.p..piece.stage * g.wide.p + g.dims.p];
        let mut s = [0.0];
        let at = Point { t: piece.t, x: &piece.x0, u, p: params };
        if f.value(&at, &mut s, &mut vec![0.0; f.work_len()]).is_err() {
            return ContactMode::Closed;
        }
        let size = piece.x0[p.functions.n_q..].iter().take(p.functions.n_own()).fold(0f64, |m, v| m.max(v.abs()));
        if s[0].abs() <= 1e-9 * size {
            ContactMode::Closed
        } else if s[0] > 0.0 {
            ContactMode::Slides
        } else {
            ContactMode::SlidesBack
        }
    }

    /// Costs of a simulation that reached its end; NaN for others. A running cost is an integral along the output, or, without one, by the
    /// trapezoidal rule over the stages.
    pub(super) fn cost(&self, p: &Problem, inputs: Inputs) -> Result<f64> {
        let g = &p.given;
        let (n, nx) = (self.times.len() - 1, g.dims.x);
        if n < g.durations.len() {
            return Ok(f64::NAN);
        }
        let value = |f: &SharedFunction, t: f64, x: &[f64], k: usize| {
            let (u, q) =
                (&inputs.controls[k * g.wide.u..(k + 1) * g.wide.u], &inputs.params[k * g.wide.p..(k + 1) * g.wide.p]);
            let mut out = [f64::NAN];
            match f.value(&Point { t, x, u, p: q }, &mut out, &mut vec![0.0; f.work_len()]) {
                Ok(()) => out[0],
                Err(_) => f64::NAN,
            }
        };
        let at = |f: &SharedFunction, end: usize, k: usize| {
            value(f, self.times[end], &self.states[end * nx..(end + 1) * nx], k)
        };
        let mut sum = 0.0;
        if let Some(l) = &g.lagrange {
            let stage = |t: f64| self.times.partition_point(|s| *s <= t).saturating_sub(1).min(n - 1);
            let by_stages = |k: usize| 0.5 * (self.times[k + 1] - self.times[k]) * (at(l, k, k) + at(l, k + 1, k));
            sum += match &self.run.path {
                Some(path) => path.integrate(self.times[0], &mut |t, x| value(l, t, x, stage(t)))?,
                None => (0..n).map(by_stages).sum(),
            };
        }
        if let Some(f) = &g.grid_cost {
            sum += (0..n).map(|k| at(f, k + 1, k)).sum::<f64>();
        }
        if let Some(f) = &g.mayer {
            sum += value(f, self.run.t, &self.run.x, n - 1);
        }
        Ok(sum)
    }

    /// Fills stages that were not reached.
    fn rest(&self, p: &Problem, pieces: &mut Vec<Piece>, durations: &[f64]) {
        let reached = self.times.len() - 1;
        let (nx, n_c, n_s) = (p.given.dims.x, p.n_contacts(), p.given.tableau.n_s);
        let mut t = self.times[reached];
        for k in reached..durations.len() {
            let modes = pieces.last().map_or_else(|| vec![ContactMode::Open; n_c], |p| p.modes.clone());
            let x = &self.run.x;
            pieces.push(Piece {
                t,
                h: durations[k],
                stage: k,
                modes,
                x0: x.clone(),
                xs: (0..n_s).flat_map(|_| x.iter().copied()).take(n_s * nx).collect(),
                forces: vec![0.0; n_s * n_c * 2],
                ..Piece::default()
            });
            t += durations[k];
        }
    }
}

/// What the event engine makes of the controls of an answer.
pub struct Replay {
    /// How it ended.
    pub outcome: Outcome,
    /// Why, where the end is not reached.
    pub reason: String,
    /// Largest difference of a state at the end of every control stage that was reached.
    pub differences: Vec<f64>,
    /// The last state.
    pub x_end: Vec<f64>,
    /// Changes of modes and impacts.
    pub events: usize,
    /// The cost, as an integral over the steps of the engine.
    pub cost: f64,
}

/// Simulates the controls of an answer with the tolerance `tol`, relative to the sizes of its states.
pub fn replay(p: &Problem, a: &super::Answer, durations: &[f64], tol: f64) -> Result<Replay> {
    let given = with_free_parameters(p, a);
    let inputs = Inputs { x0: &a.x0, controls: a.controls(), durations, params: &given };
    let sizes = scales::of_motion(p, &a.x0, &a.track.pieces);
    let s = simulate_with(p, inputs, Effort { tolerance: tol, sizes: &sizes, bounded: true, ..GUESS })?;
    let n = s.times.len() - 1;
    let mut differences = Vec::with_capacity(n);
    let mut x = vec![0.0; p.given.dims.x];
    let path = s.run.path.as_ref().ok_or_else(|| Error::Internal("a simulation without output".into()))?;
    for k in 0..n {
        if s.times[k + 1] == s.run.t {
            x.copy_from_slice(&s.run.x);
        } else {
            // an impact at the end of the stage: the answer has the state before it there
            path.eval(s.times[k + 1], 0, &mut x)?;
        }
        differences.extend(off_at_end(a, k, &s, s.times[k + 1], &x)?);
    }
    let cost = s.cost(p, inputs)?;
    let changes = s.run.phases.windows(2).filter(|w| w[0].modes != w[1].modes).count();
    let events = changes + s.run.impacts.len();
    Ok(Replay {
        outcome: s.run.outcome,
        reason: s.run.reason.clone(),
        differences,
        x_end: s.run.x.clone(),
        events,
        cost,
    })
}

/// Share of a control stage that an impact at its end may be before it in a simulation, which has the time of the impact to its own tolerance.
const ASIDE: f64 = 1e-3;

/// Largest difference of a simulation, with the state `x` at `end`, from an answer at the end of its control stage `k`; `None` where that has no such
/// stage. An impact at the end of the stage may be before the end in the simulation or behind it, and so may one that the answer does not have, as
/// its horizon ends where bodies meet.
fn off_at_end(a: &super::Answer, k: usize, s: &Simulated, end: f64, x: &[f64]) -> Result<Option<f64>> {
    let Some(last) = a.track.pieces.iter().rev().find(|q| q.stage == k) else { return Ok(None) };
    let own = &last.xs[last.xs.len() - x.len()..];
    let from = |x: &[f64], end: &[f64]| x.iter().zip(end).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
    let behind = a.track.pieces.iter().find(|q| q.stage == k + 1 && q.jump.is_some() && q.t <= last.t + last.h);
    let mut off = behind.map_or(f64::INFINITY, |q| from(x, &q.x0)).min(from(x, own));
    let length: f64 = a.track.pieces.iter().filter(|q| q.stage == k).map(|q| q.h).sum();
    let mut before = vec![0.0; x.len()];
    for impact in s.run.impacts.iter().filter(|i| (0.0..=ASIDE * length).contains(&(end - i.t))) {
        if let Some(path) = &s.run.path {
            path.eval(impact.t, 0, &mut before)?;
            off = off.min(from(&before, own));
        }
    }
    Ok(Some(off))
}

/// What becomes of an answer whose control stages are simulated one by one, each from the state of the answer at its start. Differences of a whole
/// replay grow with the motion, and where that is unstable they say nothing of the answer.
pub(super) struct Stages {
    /// Largest difference of a state at the end of every stage; infinite where a simulation does not reach it.
    pub(super) off: Vec<f64>,
    /// The motion: that of the simulations, and of the answer where they do not reach the end of a stage.
    pub(super) track: Track,
}

/// Pieces of a phase of these simulations, as a multiple of its elements: grids that are finer by that have their points there.
const FINER: usize = 4;

/// Simulates the control stages of an answer one by one.
pub(super) fn replay_stages(p: &Problem, a: &super::Answer, durations: &[f64], tol: f64) -> Result<Stages> {
    let g = &p.given;
    let given = with_free_parameters(p, a);
    let atol: Vec<f64> = scales::of_motion(p, &a.x0, &a.track.pieces).iter().map(|s| tol * s).collect();
    let options = Options { atol, dense: true, ..Options::with_tolerance(tol, tol) };
    let (mut t, mut off, mut pieces) = (g.t0, Vec::with_capacity(durations.len()), Vec::new());
    for (k, d) in durations.iter().enumerate() {
        let own: Vec<Piece> = a.track.pieces.iter().filter(|q| q.stage == k).cloned().collect();
        let Some(first) = own.first() else { break };
        let (params, controls) = (&given[k * g.wide.p..][..g.dims.p], &a.controls()[k * g.wide.u..][..g.dims.u]);
        let start = t;
        t += d;
        let simulate = || -> Result<Option<Simulated>> {
            let mut engine = Engine::new(&g.system, &options)?;
            engine.reinit(start, &first.x0)?;
            engine.set_params(params)?;
            engine.set_controls(controls)?;
            let reached = engine.advance(t.max(engine.time()))? == Outcome::Reached;
            let run = engine.into_run();
            Ok(reached.then(|| Simulated { times: vec![start, t], states: Vec::new(), run }))
        };
        let run = match simulate() {
            Err(e @ (Error::Interrupted | Error::OutOfTime)) => return Err(e),
            run => run.unwrap_or(None),
        };
        let difference = match &run {
            Some(r) => off_at_end(a, k, r, t, &r.run.x)?,
            None => None,
        };
        off.push(difference.unwrap_or(f64::INFINITY));
        match run.and_then(|r| r.stage(p, a.controls(), (k, FINER), [start, t]).ok()) {
            Some(mut simulated) => {
                // the simulation begins behind the impact
                simulated[0].jump.clone_from(&first.jump);
                simulated[0].impulses.clone_from(&first.impulses);
                pieces.extend(simulated);
            }
            None => pieces.extend(own),
        }
    }
    Ok(Stages { off, track: Track { pieces, ..a.track.clone() } })
}

/// What a simulation of given controls meets.
pub struct Met {
    /// The first contact, and the time, at which no forces continue the motion (Painlevé): friction and normal force contradict each other, and
    /// sliding stops by an impact without collision. Programs of contact modes do not have that.
    pub paradox: Option<(usize, f64)>,
    /// Impacts and changes of contact modes in every control stage that was reached.
    pub changes: Vec<usize>,
}

/// Simulates controls from an initial state.
pub fn met(p: &Problem, x0: &[f64], controls: &[f64], durations: &[f64]) -> Result<Met> {
    Ok(simulate(p, x0, controls, durations)?.met())
}

/// Parameters of all stages, those that are variables as the answer has them.
fn with_free_parameters(p: &Problem, a: &super::Answer) -> Vec<f64> {
    let g = &p.given;
    let mut params = g.params.clone();
    for &(j, v) in &a.params {
        (0..g.durations.len()).for_each(|k| params[k * g.wide.p + j] = v);
    }
    params
}
