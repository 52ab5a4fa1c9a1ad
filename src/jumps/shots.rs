//! Shots: motions under controls drawn at random, simulated, and aimed at the constraints.
//!
//! Time stepping and finite elements with jumps begin with forces at a distance, which pull bodies to where they are to be: what only gets
//! there by bouncing off something that lies in another direction they do not find. A simulation bounces off whatever is there, and it costs
//! no more than a few iterations of a program. So controls that are constant on a few stretches of the horizon are drawn within their bounds
//! and simulated, the best shots of every order of impacts are aimed at the constraints by damped steps of Gauss and Newton (K. Levenberg,
//! 1944; D. W. Marquardt, 1963) with derivatives by differences through their impacts, and those that nearly hit are motions that contact
//! mode programs start from.

use super::answer::Answer;
use super::options::Options;
use super::problem::Problem;
use super::scales;
use super::simulate::{engine, run, simulate_with, Effort, Ends, Inputs, Simulated, MAX_EVENTS};
use super::spread::{off, spreads};
use super::track::Track;
use crate::error::Result;
use crate::event::{Engine, Run};
use crate::fesd::Durations;
use crate::func::Point;
use crate::linalg::cholesky;
use crate::random::SplitMix64;
use crate::stop;
use crate::system::SharedFunction;

/// Shots that are drawn for every one that is aimed, how many are drawn at random before others are drawn beside the best ones, and of how many, and how
/// many are aimed at most; share of their variables that are drawn anew, and how far they move at most, as a share of their range.
const DRAWN: usize = 15;
const AT_RANDOM: usize = 600;
const PARENTS: usize = 20;
const AIMED: usize = 120;
const MUTATED: f64 = 0.35;
const MOVED: f64 = 0.25;
/// Steps of simulations of all shots.
const MOST_STEPS: usize = 300_000;
/// Stretches of the horizon on which controls are constant, and how many of them there are at least for every condition at the end.
const STRETCHES: usize = 6;
const PER_CONDITION: usize = 2;
/// How coarse the controls that are drawn are, in turn; 0 for as many pieces as stretches.
const PIECES: [usize; 4] = [1, 2, 3, 0];
/// Parts of the shots in which a control is at its lower bound, at its upper one, or as it was given.
const AT_LOWER: f64 = 0.25;
const AT_UPPER: f64 = 0.5;
const AS_GIVEN: f64 = 0.6;
const SEED: u64 = 0x5eed;

/// Tolerance, relative to the sizes of the states, and steps of a simulation.
const EFFORT: Effort =
    Effort { tolerance: 1e-7, sizes: &[], max_steps: 4000, max_events: 400, dense: false, bounded: false };
/// Share of a range by which a variable moves for a difference.
const DIFFERENCE: f64 = 1e-4;
/// Steps of an aimed shot, damping they begin with, and how often a step is tried again with more of it.
const STEPS: usize = 12;
const DAMPING: f64 = 1e-3;
const MORE: f64 = 10.0;
const TRIALS: usize = 5;
/// Impacts of one contact in a row that are counted.
const ALIKE: usize = 3;
/// Largest violation, as a share of how far the shots are spread, at which a shot is not aimed any more, of one that hits, and of
/// one that nearly does.
const HIT: f64 = 1e-4;
const HITS: f64 = 0.02;
const NEARLY: f64 = 0.25;
/// Share of its violation that is left by a step of a shot that hits for it to be aimed on.
const HALVED: f64 = 0.5;
/// Share of its size by which a constraint is missed that counts as met.
const MET: f64 = 1e-6;
/// Range of a control without bounds, as a multiple of the constant control that would take the end as far as the target is away. The multiple
/// of a trial that it is read off is right where the trial goes about as far: others are tried again, so many times.
const REACH: f64 = 4.0;
const ABOUT: f64 = 10.0;
const TRIED: usize = 6;
const FIRST_TRIAL: f64 = 1.0;

/// How far the controls of a known answer may miss in a simulation, as a share of the sizes of the constraints: an unstable motion goes anywhere, and so do
/// shots beside it.
const FOLLOWED: f64 = 1.0;
/// Share of its cost by which another answer has to be cheaper for shots to be drawn anew, from controls like its own.
const CHEAPER: f64 = 0.01;
/// The multiple of the controls of the known answer that shots are drawn from.
const WIDER: f64 = 2.0;
/// Share of the range of a control below which an answer does nothing with it.
const IDLE: f64 = 1e-3;

/// A motion that was aimed at all constraints.
pub(super) struct Shot {
    pub(super) track: Track,
    miss: f64,
}

impl Shot {
    /// Does it nearly meet them?
    pub(super) fn nearly_hits(&self) -> bool {
        self.miss <= NEARLY
    }
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// A control, on one of the stretches.
    Control(usize, usize),
    /// The length of the horizon, as a multiple of that of the guess.
    Length,
    /// A state at the start.
    Start(usize),
    Parameter(usize),
}

/// What may be chosen, within a finite range.
#[derive(Debug, Clone, Copy)]
struct Variable {
    kind: Kind,
    lower: f64,
    upper: f64,
    given: f64,
}

/// Everything a simulation needs.
struct Filled {
    x0: Vec<f64>,
    controls: Vec<f64>,
    durations: Vec<f64>,
    params: Vec<f64>,
}

impl Filled {
    /// What an answer has, with its controls within their bounds: the point of a program that failed need not be.
    fn of_answer(p: &Problem, a: &Answer) -> Filled {
        let (g, wide) = (&p.given, p.given.wide.u.max(1));
        let bounded = |(k, u): (usize, &f64)| u.max(g.u_bounds[0][k % wide]).min(g.u_bounds[1][k % wide]);
        let mut params = g.params.clone();
        for &(j, value) in &a.params {
            (0..p.n_stages()).for_each(|k| params[k * g.wide.p + j] = value);
        }
        let controls = a.controls().iter().enumerate().map(bounded).collect();
        Filled { x0: a.x0.clone(), controls, durations: a.durations(p.n_stages()), params }
    }

    fn inputs(&self) -> Inputs<'_> {
        Inputs { x0: &self.x0, controls: &self.controls, durations: &self.durations, params: &self.params }
    }
}

/// Values of all constraints, their bounds, the order of contacts, and the ends of the control stages.
#[derive(Clone)]
struct Flight {
    values: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    word: Vec<(usize, bool)>,
    ends: Ends,
}

/// A flight with its variables, as shares of their ranges.
struct Drawn {
    at: Vec<f64>,
    flight: Flight,
    /// Was it aimed, or is it what became of one that was?
    aimed: bool,
}

struct Range<'a> {
    p: &'a Problem,
    o: &'a Options,
    /// A cost that is to be met as a constraint is.
    below: Option<f64>,
    /// Sizes of the values of all constraints, where an answer says what they are: none is spread by more.
    most_spread: Vec<f64>,
    /// Steps of simulations, beyond which no more shots are drawn or aimed.
    most_steps: usize,
    variables: Vec<Variable>,
    /// Sizes of the states.
    sizes: Vec<f64>,
    /// Simulates all shots: a search makes thousands of short ones, and to make an engine takes as long as many of their steps.
    engine: Engine,
    stretches: usize,
    steps: usize,
    /// Are shots that hit aimed on, as close as they get?
    closely: bool,
}

/// Shots at the constraints, some of them drawn and one of them aimed at a time.
pub(super) struct Volley<'a> {
    range: Range<'a>,
    drawn: Vec<Drawn>,
    numbers: SplitMix64,
    /// Orders of contacts that were aimed from, or at which what was aimed ended.
    asked: Vec<Vec<(usize, bool)>>,
    /// Shots that were drawn, and those that were aimed.
    n_drawn: usize,
    n_aimed: usize,
}

impl<'a> Volley<'a> {
    /// At the constraints alone.
    pub(super) fn new(p: &'a Problem, o: &'a Options) -> Result<Volley<'a>> {
        Ok(Volley::of(Range::new(p, o, MOST_STEPS, STRETCHES)?))
    }

    fn of(range: Range<'a>) -> Volley<'a> {
        let (drawn, asked) = (Vec::new(), Vec::new());
        Volley { range, drawn, numbers: SplitMix64::new(SEED), asked, n_drawn: 0, n_aimed: 0 }
    }

    /// At motions that cost less than a known one: its cost is a constraint like the others, and no control is drawn from much further than its own. There
    /// are none where its controls take a simulation elsewhere.
    pub(super) fn below(p: &'a Problem, o: &'a Options, known: &Answer) -> Result<Volley<'a>> {
        let mut range = Range::new(p, o, MOST_STEPS, STRETCHES)?;
        range.below = Some(known.cost);
        range.narrow(known.controls());
        range.size_up(known);
        if !range.follows(known) {
            range.most_steps = 0;
        }
        Ok(Volley::of(range))
    }

    /// Is it drawn for motions below this cost, or little more?
    pub(super) fn is_below(&mut self, cost: f64) -> bool {
        let Some(most) = self.range.below.filter(|most| most - cost <= CHEAPER * most.abs()) else { return false };
        if cost < most {
            self.range.below = Some(cost);
            self.drawn.iter_mut().filter_map(|d| d.flight.bounds.last_mut()).for_each(|b| b[1] = cost);
        }
        true
    }

    /// Steps of its simulations so far.
    pub(super) fn steps(&self) -> usize {
        self.range.steps
    }

    /// Draws some more shots, and aims the best of all that were not aimed yet; nothing where enough were.
    pub(super) fn next(&mut self) -> Result<Option<Shot>> {
        while self.n_aimed < AIMED && !self.range.is_over() {
            self.draw();
            let Volley { range, drawn, asked, n_aimed, .. } = self;
            *n_aimed += 1;
            let scales = range.spread(drawn);
            let times = |d: &Drawn| 1 + asked.iter().filter(|w| **w == d.flight.word).count();
            let off = |d: &Drawn| squares(&d.flight.off(&scales)).sqrt() * times(d) as f64;
            let fresh = (0..drawn.len()).filter(|&k| !drawn[k].aimed);
            let Some(k) = fresh.min_by(|a, b| off(&drawn[*a]).total_cmp(&off(&drawn[*b]))) else { continue };
            drawn[k].aimed = true;
            let found = range.aim(&drawn[k], &scales);
            asked.push(drawn[k].flight.word.clone());
            if found.flight.word != drawn[k].flight.word {
                asked.push(found.flight.word.clone());
            }
            let shot = range.shot(&found.at, largest(&found.flight.off(&scales)))?;
            drawn.push(found);
            if shot.is_some() {
                return Ok(shot);
            }
        }
        Ok(None)
    }

    /// Draws shots: at random to begin with, then each beside one of the best.
    fn draw(&mut self) {
        let parents = if self.n_drawn < AT_RANDOM {
            Vec::new()
        } else {
            best_of_every_word(&self.drawn, &self.range.spread(&self.drawn), PARENTS)
        };
        for k in 0..DRAWN {
            if self.range.is_over() {
                break;
            }
            let at = match parents.get(k % PARENTS) {
                Some(&parent) => self.range.beside(&self.drawn[parent].at, &mut self.numbers),
                None => self.range.drawn(self.n_drawn, &mut self.numbers),
            };
            self.n_drawn += 1;
            if let Some(flight) = self.range.fly(&at) {
                self.drawn.push(Drawn { at, flight, aimed: false });
            }
        }
    }
}

/// What the controls of an answer have in a simulation.
pub(super) enum Beside {
    /// A motion that ends nowhere near the answer: it is unstable, or of another kind, and so are those beside it.
    Elsewhere,
    /// One that nearly meets the constraints once it is aimed at them, where it does.
    Near(Option<Box<Shot>>),
}

/// The motion that the controls of an answer have in a simulation, aimed at the constraints by the controls of all stages: where a coarse grid has a motion
/// that there is not, one that there is lies beside it.
pub(super) fn beside(p: &Problem, o: &Options, answer: &Answer) -> Result<Beside> {
    let mut range = Range::new(p, o, MOST_STEPS, p.n_stages())?;
    range.closely = true;
    range.size_up(answer);
    if !range.follows(answer) {
        return Ok(Beside::Elsewhere);
    }
    let scales = range.most_spread.clone();
    let at: Vec<f64> = range.variables.iter().map(Variable::share_of_given).collect();
    let Some(flight) = range.fly(&at) else { return Ok(Beside::Near(None)) };
    let found = range.aim(&Drawn { at, flight, aimed: false }, &scales);
    let miss = largest(&found.flight.off(&scales));
    let shot = if miss <= NEARLY { range.shot(&found.at, miss)? } else { None };
    Ok(Beside::Near(shot.map(Box::new)))
}

impl<'a> Range<'a> {
    /// With so many stretches of the horizon, or more where the conditions at the end ask for more.
    fn new(p: &'a Problem, o: &'a Options, most_steps: usize, stretches: usize) -> Result<Range<'a>> {
        let g = &p.given;
        let ends: usize = g.terminal.iter().map(|c| c.f.n_out()).chain(g.boundary.iter().map(|c| c.f.n_out())).sum();
        let least = (PER_CONDITION * ends).div_ceil(g.dims.u.max(1));
        let stretches = stretches.max(least).min(p.n_stages());
        let sizes = scales::of_states(p, &o.x0);
        let mut range = Range {
            p,
            o,
            below: None,
            most_spread: Vec::new(),
            most_steps,
            variables: Vec::new(),
            engine: engine(p, Effort { sizes: &sizes, ..EFFORT })?,
            sizes,
            stretches,
            steps: 0,
            closely: false,
        };
        let reaches = range.reaches();
        let mut variables = Vec::new();
        for s in 0..stretches {
            for (j, reach) in reaches.iter().enumerate() {
                let given = o.controls[range.first_stage(s) * g.wide.u + j];
                let bounds = [g.u_bounds[0][j], g.u_bounds[1][j]];
                variables.push(Variable::new(Kind::Control(j, s), bounds, given, *reach));
            }
        }
        if g.time != Durations::Fixed {
            let whole: f64 = g.durations.iter().sum();
            let stages = if g.time == Durations::Stages { p.n_stages() as f64 } else { 1.0 };
            let bounds = g.time_bounds.map(|b| b * stages / whole);
            let [lower, upper] = [bounds[0].max(0.5), bounds[1].min(2.0)];
            if lower < upper {
                variables.push(Variable { kind: Kind::Length, lower, upper, given: 1f64.clamp(lower, upper) });
            }
        }
        for i in 0..g.dims.x {
            let bounds = [g.x0_bounds[0][i], g.x0_bounds[1][i]];
            if bounds[0] < bounds[1] {
                variables.push(Variable::new(Kind::Start(i), bounds, o.x0[i], range.sizes[i]));
            }
        }
        for j in 0..g.dims.p {
            if let Some(bounds) = g.free[j] {
                let given = g.params[j];
                variables.push(Variable::new(Kind::Parameter(j), bounds, given, size_of_one(given, bounds)));
            }
        }
        range.variables = variables;
        Ok(range)
    }

    /// Half the range of every control that has no bounds: what takes the end as far as it is from the target, or, where no target is known, from
    /// where it would be by the size of a coordinate. The first trial has a size that nothing but the trial itself says to be right.
    fn reaches(&mut self) -> Vec<f64> {
        let (g, o) = (&self.p.given, self.o);
        let n_q = self.p.functions.n_q;
        let given = |j: usize| (0..self.p.n_stages()).fold(0f64, |m, k| m.max(o.controls[k * g.wide.u + j].abs()));
        let bounds = |j: usize| [g.u_bounds[0][j], g.u_bounds[1][j]];
        let mut out: Vec<f64> = (0..g.dims.u).map(|j| size_of_one(given(j), bounds(j))).collect();
        let mut at = self.filled(&[]);
        let Some(first) = self.simulate(&at, (0, &Ends::default())) else { return out };
        let from = first.run.x[..n_q].to_vec();
        // coordinates need not have one unit
        let sizes = self.sizes.clone();
        let share = |(k, (a, b)): (usize, (&f64, &f64))| ((a - b) / sizes[k]).powi(2);
        let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).enumerate().map(share).sum::<f64>().sqrt();
        let wanted = self.p.given.target.as_ref().map_or(1.0, |target| distance(&target[..n_q], &from));
        for (j, reach) in out.iter_mut().enumerate().filter(|(j, _)| bounds(*j).iter().any(|b| b.is_infinite())) {
            if *reach == 0.0 {
                *reach = FIRST_TRIAL;
            }
            let first = *reach;
            let mut moved_at_all = false;
            for _ in 0..if wanted > 0.0 { TRIED } else { 0 } {
                let controls = at.controls.clone();
                (0..self.p.n_stages()).for_each(|k| at.controls[k * g.wide.u + j] += *reach);
                let moved = self.simulate(&at, (0, &Ends::default()));
                let moves = moved.map_or(f64::INFINITY, |moved| distance(&moved.run.x[..n_q], &from));
                at.controls = controls;
                moved_at_all |= moves > 0.0;
                if moves == 0.0 {
                    // less than what friction holds, or a control that moves nothing
                    *reach *= ABOUT * ABOUT;
                    continue;
                }
                if (1.0 / ABOUT..=ABOUT).contains(&(moves / wanted)) {
                    *reach *= REACH * wanted / moves;
                    break;
                }
                // what has no end was far too much
                *reach *= if moves.is_finite() { wanted / moves } else { 1.0 / (ABOUT * ABOUT) };
            }
            if !moved_at_all {
                *reach = first;
            }
        }
        out
    }

    /// Ranges of the controls no larger than [`WIDER`] times those of an answer. One that does nothing with a control says nothing of how much of
    /// it there is to be.
    fn narrow(&mut self, controls: &[f64]) {
        let n_u = self.p.given.wide.u;
        for v in &mut self.variables {
            let Kind::Control(j, _) = v.kind else { continue };
            let own = controls.iter().skip(j).step_by(n_u).fold(0f64, |m, u| m.max(u.abs()));
            let [lower, upper] = [v.lower.max(-WIDER * own), v.upper.min(WIDER * own)];
            if lower < upper && own > IDLE * (v.upper - v.lower) {
                (v.lower, v.upper, v.given) = (lower, upper, v.given.clamp(lower, upper));
            }
        }
    }

    /// Sizes of the constraints as the motion of an answer says them. Shots under the same controls may go twenty times as far as it does, and
    /// shares of how far they are spread are then no distances that count.
    fn size_up(&mut self, known: &Answer) {
        let (p, g, nx) = (self.p, &self.p.given, self.p.given.dims.x);
        let f = Filled::of_answer(p, known);
        let mut ends = Ends { times: vec![g.t0], states: known.x0.clone() };
        for (k, d) in f.durations.iter().enumerate() {
            let x = ends.states.len();
            ends.times.push(ends.times[k] + d);
            ends.states.resize(x + nx, 0.0);
            known.track.state(ends.times[k + 1], false, &mut ends.states[x..]);
        }
        let sizes = scales::of_motion(p, &known.x0, &known.track.pieces);
        let mut out = Vec::new();
        for_every_constraint(p, &f, (&ends.times, &ends.states), |c| {
            match c {
                Constraint::Function { f, at, .. } => out.extend(scales::of_values(f, &at, &sizes)),
                Constraint::State { i, .. } => out.push(sizes[i]),
            }
            Some(())
        });
        if self.below.is_some() {
            out.push(known.cost.abs());
        }
        self.most_spread = out;
    }

    /// Do the controls of an answer, which the constraints have the sizes of, take a simulation anywhere near its end?
    fn follows(&mut self, answer: &Answer) -> bool {
        let f = Filled::of_answer(self.p, answer);
        let reached = self.simulate(&f, (0, &Ends::default()));
        let Some(all) = reached.and_then(|s| values(self.p, &f, &s)) else { return false };
        let off = |((v, bounds), size): (&(f64, [f64; 2]), &f64)| off(*v, *bounds, *size).abs();
        all.iter().zip(&self.most_spread).map(off).all(|miss| miss <= FOLLOWED)
    }

    /// How far the values of every constraint are spread.
    fn spread(&self, drawn: &[Drawn]) -> Vec<f64> {
        let mut out = spreads(drawn.iter().map(|d| &d.flight.values[..]));
        let most = self.most_spread.iter().map(|s| if *s > 0.0 { *s } else { f64::INFINITY });
        out.iter_mut().zip(most).for_each(|(s, most)| *s = s.min(most));
        out
    }

    fn first_stage(&self, stretch: usize) -> usize {
        (stretch * self.p.n_stages()).div_ceil(self.stretches)
    }

    fn is_over(&self) -> bool {
        self.steps > self.most_steps || stop::requested().is_some()
    }

    /// What was given, with these shares of the ranges.
    fn filled(&self, at: &[f64]) -> Filled {
        let (g, o, n) = (&self.p.given, self.o, self.p.n_stages());
        let mut out = Filled {
            x0: o.x0.clone(),
            controls: o.controls.clone(),
            durations: g.durations.clone(),
            params: g.params.clone(),
        };
        for (v, share) in self.variables.iter().zip(at) {
            let value = v.lower + share * (v.upper - v.lower);
            match v.kind {
                Kind::Control(j, s) => {
                    (self.first_stage(s)..self.first_stage(s + 1)).for_each(|k| out.controls[k * g.wide.u + j] = value);
                }
                Kind::Length => out.durations.iter_mut().for_each(|d| *d *= value),
                Kind::Start(i) => out.x0[i] = value,
                Kind::Parameter(j) => (0..n).for_each(|k| out.params[k * g.wide.p + j] = value),
            }
        }
        out
    }

    /// A simulation that reaches the end, from a control stage on until which the motion is known.
    fn simulate(&mut self, f: &Filled, from: (usize, &Ends)) -> Option<Simulated> {
        let s = run(self.p, &mut self.engine, f.inputs(), EFFORT.max_events, from).ok()?;
        let took = s.run.stats;
        // one with too many events has taken as much as one with too many steps
        self.steps += if took.switches + took.impacts > EFFORT.max_events { EFFORT.max_steps } else { took.steps };
        (s.times.len() == self.p.n_stages() + 1).then_some(s)
    }

    fn fly(&mut self, at: &[f64]) -> Option<Flight> {
        self.fly_from(at, (0, &Ends::default()))
    }

    /// A flight that is another one until a control stage; the order of contacts is that behind it.
    fn fly_from(&mut self, at: &[f64], from: (usize, &Ends)) -> Option<Flight> {
        let f = self.filled(at);
        let s = self.simulate(&f, from)?;
        let mut all = values(self.p, &f, &s)?;
        if let Some(most) = self.below {
            let cost = s.cost(self.p, f.inputs()).ok().filter(|c| c.is_finite())?;
            all.push((cost, [f64::NEG_INFINITY, most]));
        }
        let (values, bounds) = all.into_iter().unzip();
        Some(Flight { values, bounds, word: word(&s.run), ends: Ends { times: s.times, states: s.states } })
    }

    /// Shares of the variables beside those of another shot.
    fn beside(&self, at: &[f64], numbers: &mut SplitMix64) -> Vec<f64> {
        let mut at = at.to_vec();
        for share in &mut at {
            let (which, to) = (numbers.share(), numbers.share());
            if which < MUTATED {
                *share = (*share + MOVED * (2.0 * to - 1.0)).clamp(0.0, 1.0);
            }
        }
        at
    }

    /// Shares of the variables of the `k`-th shot: the first is the one of what was given, others are drawn at random.
    fn drawn(&self, k: usize, numbers: &mut SplitMix64) -> Vec<f64> {
        let n_u = self.p.given.dims.u;
        let pieces = numbers.on_pieces(self.stretches, PIECES[k % PIECES.len()], n_u);
        let control = |j: usize, s: usize| match pieces[s * n_u + j] {
            (w, _) if w < AT_LOWER => 0.0,
            (w, _) if w < AT_UPPER => 1.0,
            (w, _) if w < AS_GIVEN => self.variables[j].share_of_given(),
            (_, anywhere) => anywhere,
        };
        let of = |v: &Variable| match v.kind {
            _ if k == 0 => v.share_of_given(),
            Kind::Control(j, s) => control(j, s),
            _ => numbers.share(),
        };
        self.variables.iter().map(of).collect()
    }

    /// Steps towards the constraints, and where they get to.
    fn aim(&mut self, from: &Drawn, scales: &[f64]) -> Drawn {
        let (mut at, mut flight) = (from.at.clone(), from.flight.clone());
        let mut damping = DAMPING;
        for _ in 0..STEPS {
            let off = flight.off(scales);
            if largest(&off) <= HIT || self.is_over() {
                break;
            }
            let columns = self.columns(&at, &flight, scales);
            let hits = !self.closely && largest(&off) <= HITS;
            let mut better = false;
            for _ in 0..TRIALS {
                let next = step(&at, &columns, &off, damping);
                if let Some(found) = self.fly(&next) {
                    let left = squares(&found.off(scales)) / squares(&off);
                    if found.touches_all_of(&from.flight) && left < 1.0 {
                        // what hits is a start, and one that comes a little closer is the same start
                        better = !hits || left <= HALVED * HALVED;
                        (at, flight) = (next, found);
                        damping /= MORE;
                        break;
                    }
                }
                if hits {
                    break;
                }
                damping *= MORE;
            }
            if !better {
                break;
            }
        }
        Drawn { at, flight, aimed: true }
    }

    /// Derivatives of the violated constraints, one column for every variable.
    fn columns(&mut self, at: &[f64], flight: &Flight, scales: &[f64]) -> Vec<Vec<f64>> {
        let mut out = Vec::with_capacity(at.len());
        for j in 0..at.len() {
            let mut beside = at.to_vec();
            let d = if at[j] > 0.5 { -DIFFERENCE } else { DIFFERENCE };
            beside[j] += d;
            // a control changes nothing before its stretch
            let first = match self.variables[j].kind {
                Kind::Control(_, s) => self.first_stage(s),
                _ => 0,
            };
            let column = match self.fly_from(&beside, (first, &flight.ends)) {
                Some(moved) => flight.difference(&moved, scales).map(|v| v / d).collect(),
                None => vec![0.0; scales.len()],
            };
            out.push(column);
        }
        out
    }

    /// The motion of a shot.
    fn shot(&self, at: &[f64], miss: f64) -> Result<Option<Shot>> {
        let f = self.filled(at);
        let Ok(s) = simulate_with(self.p, f.inputs(), Effort { dense: true, sizes: &self.sizes, ..EFFORT }) else {
            return Ok(None);
        };
        let mut track = s.track(self.p, &f.controls, &f.durations)?;
        let g = &self.p.given;
        track.free = (0..g.wide.p).filter(|&j| g.free[j].is_some()).map(|j| f.params[j]).collect();
        Ok(Some(Shot { track, miss }))
    }
}

/// Half the range of a variable without bounds, to begin with: its value, else the larger of the finite bounds it has; 0 where it has neither.
fn size_of_one(given: f64, bounds: [f64; 2]) -> f64 {
    let known = bounds.into_iter().filter(|b| b.is_finite()).map(f64::abs);
    if given != 0.0 {
        given.abs()
    } else {
        known.fold(0.0, f64::max)
    }
}

impl Variable {
    fn new(kind: Kind, [lower, upper]: [f64; 2], given: f64, reach: f64) -> Variable {
        let given = given.max(lower).min(upper);
        let lower = if lower.is_finite() { lower } else { given - reach };
        let upper = if upper.is_finite() { upper } else { given + reach };
        Variable { kind, lower, upper, given }
    }

    fn share_of_given(&self) -> f64 {
        if self.upper > self.lower {
            (self.given - self.lower) / (self.upper - self.lower)
        } else {
            0.0
        }
    }
}

impl Flight {
    /// How far every constraint is from being met, as a share of its scale.
    fn off(&self, scales: &[f64]) -> Vec<f64> {
        let all = self.values.iter().zip(&self.bounds).zip(scales);
        all.map(|((v, bounds), scale)| off(*v, *bounds, *scale)).collect()
    }

    /// Has it a part for every contact that another one has a part for? What nothing touches any more has no derivative that leads back.
    fn touches_all_of(&self, other: &Flight) -> bool {
        other.word.iter().all(|e| self.word.iter().any(|own| own.0 == e.0))
    }

    /// Changes of the constraints that are violated.
    fn difference<'b>(&'b self, moved: &'b Flight, scales: &'b [f64]) -> impl Iterator<Item = f64> + 'b {
        let off = self.off(scales);
        let values = self.values.iter().zip(&moved.values).zip(scales);
        values.zip(off).map(|(((a, b), scale), off)| if off == 0.0 { 0.0 } else { (b - a) / scale })
    }
}

/// A constraint with its bounds.
enum Constraint<'a> {
    Function { f: &'a SharedFunction, at: Point<'a>, bounds: [&'a [f64]; 2] },
    State { i: usize, value: f64, bounds: [f64; 2] },
}

/// Path constraints at the ends of stages, the conditions at the end, and bounded states at the ends of stages, given the times and states there.
fn for_every_constraint(
    p: &Problem,
    f: &Filled,
    (times, states): (&[f64], &[f64]),
    mut each: impl FnMut(Constraint) -> Option<()>,
) -> Option<()> {
    let (g, n) = (&p.given, p.n_stages());
    let nx = g.dims.x;
    let state = |end: usize| &states[end * nx..(end + 1) * nx];
    let at = |k: usize, x| {
        let (u, q) = (&f.controls[k * g.wide.u..(k + 1) * g.wide.u], &f.params[k * g.wide.p..(k + 1) * g.wide.p]);
        Point { t: times[k + 1], x, u, p: q }
    };
    for k in 0..n {
        for c in &g.path {
            each(Constraint::Function { f: &c.f, at: at(k, state(k + 1)), bounds: [&c.lower, &c.upper] })?;
        }
    }
    for c in &g.terminal {
        each(Constraint::Function { f: &c.f, at: at(n - 1, state(n)), bounds: [&c.lower, &c.upper] })?;
    }
    let both = [state(0), state(n)].concat();
    for c in &g.boundary {
        each(Constraint::Function { f: &c.f, at: at(n - 1, &both), bounds: [&c.lower, &c.upper] })?;
    }
    for k in 0..n {
        for i in 0..nx {
            let bounds = [g.x_bounds[0][i], g.x_bounds[1][i]];
            if bounds.iter().any(|b| b.is_finite()) {
                each(Constraint::State { i, value: state(k + 1)[i], bounds })?;
            }
        }
    }
    Some(())
}

/// What a motion misses, in the unit of the problem.
#[derive(Debug, Clone)]
pub struct Missed {
    /// The constraint.
    pub of: Of,
    /// How far its value is outside of its bounds.
    pub by: f64,
    /// The value.
    pub value: f64,
}

/// A constraint in words of the problem.
#[derive(Debug, Clone)]
pub enum Of {
    /// An output of a function.
    Function(String, usize),
    /// A state.
    State(usize),
}

/// A simulation of the controls of an answer that is no solution.
pub(super) fn simulation(p: &Problem, o: &Options, a: &Answer) -> Option<Simulated> {
    let sizes = scales::of_states(p, &o.x0);
    simulate_with(p, Filled::of_answer(p, a).inputs(), Effort { sizes: &sizes, max_events: MAX_EVENTS, ..EFFORT }).ok()
}

/// What the controls of an answer miss most in a simulation, as a share of the size that states of their sizes give a constraint; nothing
/// where a simulation meets all constraints or does not reach the end.
pub(super) fn missed(p: &Problem, o: &Options, a: &Answer, s: &Simulated) -> Option<Missed> {
    let f = Filled::of_answer(p, a);
    let sizes = scales::of_states(p, &o.x0);
    (s.times.len() == p.n_stages() + 1).then_some(())?;
    let mut worst: Option<(f64, Missed)> = None;
    let mut note = |of: Of, value: f64, [l, u]: [f64; 2], size: f64| {
        let by = (l - value).max(value - u);
        let share = by / if size > 0.0 { size } else { 1.0 };
        if share > MET && worst.as_ref().is_none_or(|w| share > w.0) {
            worst = Some((share, Missed { of, by, value }));
        }
    };
    for_every_constraint(p, &f, (&s.times, &s.states), |c| {
        match c {
            Constraint::Function { f, at, bounds: [lower, upper] } => {
                let mut values = vec![0.0; f.n_out()];
                f.value(&at, &mut values, &mut vec![0.0; f.work_len()]).ok()?;
                for (i, (v, size)) in values.iter().zip(scales::of_values(f, &at, &sizes)).enumerate() {
                    note(Of::Function(f.name().to_owned(), i), *v, [lower[i], upper[i]], size);
                }
            }
            Constraint::State { i, value, bounds } => note(Of::State(i), value, bounds, sizes[i]),
        }
        Some(())
    })?;
    worst.map(|w| w.1)
}

/// Values of all constraints, with their bounds.
fn values(p: &Problem, f: &Filled, s: &Simulated) -> Option<Vec<(f64, [f64; 2])>> {
    let mut out = Vec::new();
    for_every_constraint(p, f, (&s.times, &s.states), |c| {
        match c {
            Constraint::Function { f, at, bounds: [lower, upper] } => {
                let mut values = vec![0.0; f.n_out()];
                f.value(&at, &mut values, &mut vec![0.0; f.work_len()]).ok()?;
                out.extend(values.iter().zip(lower.iter().zip(upper)).map(|(v, (l, u))| (*v, [*l, *u])));
            }
            Constraint::State { value, bounds, .. } => out.push((value, bounds)),
        }
        Some(())
    })?;
    out.iter().all(|v| v.0.is_finite()).then_some(out)
}

/// Contacts in the order in which they are hit, open or close.
fn word(run: &Run) -> Vec<(usize, bool)> {
    let mut events: Vec<(f64, usize, bool)> = run.impacts.iter().map(|i| (i.t, i.contact, true)).collect();
    for pair in run.phases.windows(2) {
        for (i, (a, b)) in pair[0].modes.iter().zip(&pair[1].modes).enumerate() {
            if (*a == 0) != (*b == 0) {
                events.push((pair[1].t, i, false));
            }
        }
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<(usize, bool)> = Vec::new();
    for (_, contact, hit) in events {
        // impacts that accumulate are one order of contacts, however many of them there are
        let alike = out.iter().rev().take_while(|e| **e == (contact, hit)).count();
        if alike < ALIKE {
            out.push((contact, hit));
        }
    }
    out
}

/// Shots that come closest. The second best of an order of contacts counts as if it were twice as far off, the third as if it were three times
/// as far: other orders have their turn, those that are hopeless do not.
fn best_of_every_word(drawn: &[Drawn], scales: &[f64], most: usize) -> Vec<usize> {
    let misses: Vec<f64> = drawn.iter().map(|d| squares(&d.flight.off(scales))).collect();
    let mut order: Vec<usize> = (0..drawn.len()).collect();
    order.sort_by(|a, b| misses[*a].total_cmp(&misses[*b]));
    let before = |k: usize| order[..k].iter().filter(|&&o| drawn[o].flight.word == drawn[order[k]].flight.word).count();
    let mut ranked: Vec<(f64, usize)> =
        (0..order.len()).map(|k| (misses[order[k]].sqrt() * (1 + before(k)) as f64, order[k])).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().map(|r| r.1).take(most).collect()
}

/// A damped step of Gauss and Newton within the ranges; variables at their ends stay there where the step would leave them.
fn step(at: &[f64], columns: &[Vec<f64>], off: &[f64], damping: f64) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let slopes: Vec<f64> = columns.iter().map(|c| dot(c, off)).collect();
    let is_free = |j: &usize| !(at[*j] <= 0.0 && slopes[*j] >= 0.0 || at[*j] >= 1.0 && slopes[*j] <= 0.0);
    let free: Vec<usize> = (0..at.len()).filter(is_free).collect();
    let n = free.len();
    let mut matrix = vec![0.0; n * n];
    for (a, &i) in free.iter().enumerate() {
        for (b, &j) in free.iter().enumerate().take(a + 1) {
            matrix[a * n + b] = dot(&columns[i], &columns[j]);
        }
    }
    let largest = (0..n).map(|a| matrix[a * n + a]).fold(f64::MIN_POSITIVE, f64::max);
    (0..n).for_each(|a| matrix[a * n + a] += damping * largest);
    let mut d: Vec<f64> = free.iter().map(|&j| -slopes[j]).collect();
    let mut out = at.to_vec();
    if cholesky::factorise(n, &mut matrix) {
        cholesky::solve(&matrix, &mut d);
        free.iter().zip(d).for_each(|(&j, d)| out[j] = (out[j] + d).clamp(0.0, 1.0));
    }
    out
}

fn squares(off: &[f64]) -> f64 {
    off.iter().map(|v| v * v).sum()
}

fn largest(off: &[f64]) -> f64 {
    off.iter().fold(0.0, |m, v| m.max(v.abs()))
}
