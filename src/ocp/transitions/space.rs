//! What is searched where there are transitions: sequences of them, simulations that have some, the programs of sequences, and those next to one.

use std::rc::Rc;

use super::automaton::{Automaton, Passage, Sequence};
use super::derivatives::Kept;
use super::guess::{self, Guess};
use super::program::{Program, Solved};
use crate::error::{Error, Result};
use crate::event::Engine;
use crate::fesd::{Sizes, Terminal};
use crate::func::Point;
use crate::jumps::spread::misses;
use crate::nlp::{Control, Outcome};
use crate::ocp::request::Request;
use crate::ocp::{JumpMade, ModeSequence, Ocp, OcpResult, TransitionAt};
use crate::search::{
    self, watched, Budget, EarlyTermination, Limits, Neighbour, Patience, Rank, Sampler, Source, Space,
};
use crate::stop;

/// A guard that stays further away from zero than this share of its range is not made to pass it: small changes of the controls do not take it there.
const NEAR: f64 = 0.1;
/// Range of a control without a bound, as a multiple of its largest modulus in the best solution.
const WIDER: f64 = 2.0;

/// What the program of a sequence ended at.
pub(super) struct Ended {
    pub sequence: Sequence,
    pub result: OcpResult,
    /// The program and where it ended.
    pub kept: Box<Kept>,
    /// Largest modulus of the cost on the way to it.
    largest: f64,
}

pub(super) type Candidate = search::Candidate<Sequence, Rc<Guess>>;

/// The sequences of a problem.
pub(super) struct Transitions<'a> {
    ocp: &'a Ocp,
    pub automaton: Automaton,
    sizes: Sizes,
    request: Request,
    engine: Engine,
    /// An answer of before.
    last: Option<&'a OcpResult>,
    /// What it begins with, where that is given.
    pub first: Option<Candidate>,
    /// Transitions that are made at times which nothing changes.
    timed: Vec<bool>,
    /// Controls that are simulated without a search, and how many were.
    controls: Vec<Vec<f64>>,
    simulated: usize,
    sampler: Sampler,
    largest: f64,
}

impl<'a> Transitions<'a> {
    pub fn new(ocp: &'a Ocp, last: Option<&'a OcpResult>, request: &Request) -> Result<Transitions<'a>> {
        let seed = ocp.settings.search_seed as u64;
        Ok(Transitions {
            automaton: Automaton::new(&ocp.system, &ocp.x0_bounds[0], &ocp.x_bounds),
            sizes: ocp.sizes()?,
            request: request.of_a_part(),
            engine: guess::engine(ocp)?,
            controls: guess::controls(ocp),
            simulated: 0,
            sampler: Sampler::new(seed),
            largest: 0.0,
            last,
            first: None,
            timed: ocp.timed_transitions(),
            ocp,
        })
    }

    fn simulate(&mut self, controls: &[f64], budget: &mut Budget) -> Result<(Sequence, Guess)> {
        let found = guess::simulate(self.ocp, &self.automaton, &mut self.engine, controls);
        budget.simulated(self.ocp.system.dims().x, self.engine.stats().steps);
        found
    }

    /// The sequence of an answer of before, from its motion.
    fn of_last(&mut self) -> Vec<Candidate> {
        if let Some(given) = self.first.take() {
            return vec![given];
        }
        let Some(r) = self.last.take().filter(|r| r.outcome == Outcome::Solved) else { return Vec::new() };
        let passage = |j: &JumpMade| Passage { transition: j.transition, stage: j.stage, at_once: j.at_once };
        let mut start = r.clone();
        self.ocp.restate(&mut start);
        vec![Candidate::new(r.jumps.iter().map(passage).collect(), Rc::new(Guess::of(&start)))]
    }

    /// The sequence that is given, with the simulation of the guess, and its modes between the transitions.
    pub fn given(&mut self, modes: &ModeSequence, budget: &mut Budget) -> Result<Candidate> {
        let passage = |t: &TransitionAt| Passage { transition: t.transition, stage: t.stage, at_once: t.at_once };
        let sequence: Sequence = modes.transitions.iter().map(passage).collect();
        let sequence = self.automaton.complete(&sequence).ok_or_else(|| {
            Error::Range(format!(
                "the transitions of the given modes cannot follow each other: {}",
                self.automaton.text(&sequence)
            ))
        })?;
        let motion = match self.controls.first().cloned() {
            Some(controls) => self.simulate(&controls, budget)?.1,
            None => return Err(Error::Internal("no controls to simulate".into())),
        };
        Ok(Candidate::new(sequence.clone(), Rc::new(motion.for_modes(self.ocp, &sequence, modes))))
    }

    /// Sequences of simulations of random controls with their motions, none of them twice, those first whose end comes closest to its conditions.
    fn samples(&mut self, best: Option<&Ended>, budget: &mut Budget) -> Vec<Candidate> {
        let nu = self.ocp.system.dims().u;
        let guessed = self.ocp.control_guess();
        let known = best.map_or(&guessed[..], |b| &b.result.controls);
        let ranges: Vec<[f64; 2]> = (0..nu).map(|j| range(self.ocp, known, j)).collect();
        let mut motions: Vec<(Sequence, Guess)> = Vec::new();
        let mut ends: Vec<Vec<f64>> = Vec::new();
        for _ in 0..self.ocp.settings.search_samples {
            if stop::requested().is_some() {
                break;
            }
            let controls = self.ocp.within_bounds(self.sampler.draw(self.ocp.n_stages, &ranges, known));
            // what cannot be simulated leads nowhere
            let Ok((sequence, motion)) = self.simulate(&controls, budget) else { continue };
            let Some(end) = conditions(self.ocp, &motion) else { continue };
            motions.push((sequence, motion));
            ends.push(end);
        }
        let of = |c: &Terminal| {
            c.lower.iter().copied().zip(c.upper.iter().copied()).map(|(l, u)| [l, u]).collect::<Vec<_>>()
        };
        let bounds: Vec<[f64; 2]> = self.ocp.terminal.iter().flat_map(of).collect();
        let misses = misses(ends.iter().map(|e| &e[..]), &bounds);
        let mut sorted: Vec<(f64, (Sequence, Guess))> = misses.into_iter().zip(motions).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut out: Vec<Candidate> = Vec::new();
        for (_, (sequence, motion)) in sorted {
            if out.iter().all(|known| known.sequence != sequence) {
                out.push(Candidate::new(sequence, Rc::new(motion)));
            }
        }
        out
    }
}

impl Space for Transitions<'_> {
    type Sequence = Sequence;
    type Motion = Rc<Guess>;
    type Solution = Ended;

    fn propose(
        &mut self,
        source: Source,
        best: Option<&Ended>,
        budget: &mut Budget,
        _: &mut Control,
    ) -> Result<Vec<Candidate>> {
        loop {
            let found = match source {
                Source::Guess => self.of_last(),
                Source::Simulation => match self.controls.get(self.simulated).cloned() {
                    Some(controls) => {
                        self.simulated += 1;
                        let (sequence, motion) = self.simulate(&controls, budget)?;
                        vec![Candidate::new(sequence, Rc::new(motion))]
                    }
                    None => Vec::new(),
                },
                Source::Samples if self.sampler.begin_round() => self.samples(best, budget),
                _ => Vec::new(),
            };
            // a source whose next sequences cannot be has not ended
            let ended = found.is_empty();
            // the sequence as it is remembered, with what follows of itself
            let complete = |c: Candidate| Some(Candidate { sequence: self.automaton.complete(&c.sequence)?, ..c });
            let found: Vec<Candidate> = found.into_iter().filter_map(complete).collect();
            if ended || !found.is_empty() {
                return Ok(found);
            }
        }
    }

    fn solve(
        &mut self,
        c: &Candidate,
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Sequence, Ended)>> {
        let program = Program::new(self.ocp, &self.automaton, &c.sequence, &c.motion, &self.sizes, &self.request)?;
        let mut watch =
            EarlyTermination::new(limits.cost, Patience::usual(limits.patience), self.request.options.solver.tol);
        let Solved { result, solution, exits } =
            watched(&mut watch, control, |control| program.solve(&self.request, control))?;
        let result = result.given_up(&watch);
        budget.solved(result.dimensions.0, &result.stats);
        self.largest = self.largest.max(watch.largest);
        let kept = Box::new(Kept {
            sequence: c.sequence.clone(),
            guess: (*c.motion).clone(),
            sizes: self.sizes.clone(),
            request: self.request,
            solution,
            exits,
        });
        let ended = Ended { sequence: c.sequence.clone(), result, kept, largest: watch.largest };
        Ok(vec![(c.sequence.clone(), ended)])
    }

    fn rank(&self, s: &Ended) -> Rank {
        s.result.rank(s.result.cost, self.largest.max(s.largest))
    }

    /// Sequences next to one, the nearest first; all of them are local, as transitions whose guards stay away are not put in.
    fn neighbours(&self, s: &Ended) -> (Vec<Neighbour<Sequence>>, Rc<Guess>) {
        let motion = Guess::of(&s.result);
        // what is no answer does not say which guards matter
        let near = s.result.is_exact().then(|| guess::distances(&s.result, self.ocp, &self.automaton));
        let near = |t: usize, k: usize| near.as_ref().is_none_or(|n: &Vec<Vec<f64>>| n[t][k] <= NEAR);
        let mut next = self.automaton.neighbours(&s.sequence, self.ocp.n_stages, &near);
        // what is made at known times is made then in every sequence
        let clocks = |s: &Sequence| -> Vec<(usize, usize)> {
            s.iter().filter(|p| self.timed[p.transition]).map(|p| (p.transition, p.stage)).collect()
        };
        let own = clocks(&s.sequence);
        next.retain(|n| clocks(n) == own);
        next.sort_by(|a, b| distance(&s.sequence, &motion, a).total_cmp(&distance(&s.sequence, &motion, b)));
        let kind = |n: &Sequence| 1 + n.len().abs_diff(s.sequence.len());
        let of = |sequence: Sequence| Neighbour { promise: 0.0, kind: kind(&sequence), is_local: true, sequence };
        (next.into_iter().map(of).collect(), Rc::new(motion))
    }

    fn moved(&self, from: &Ended, motion: &Rc<Guess>, to: &Sequence) -> Rc<Guess> {
        Rc::new(motion.for_sequence(&from.sequence, to))
    }
}

/// What a control is drawn from.
fn range(ocp: &Ocp, known: &[f64], j: usize) -> [f64; 2] {
    let nu = ocp.system.dims().u;
    let own = known.iter().skip(j).step_by(nu).fold(0f64, |m, u| m.max(u.abs()));
    let own = if own > 0.0 { own } else { 1.0 };
    let [lower, upper] = [ocp.u_bounds[0][j], ocp.u_bounds[1][j]];
    [if lower.is_finite() { lower } else { -WIDER * own }, if upper.is_finite() { upper } else { WIDER * own }]
}

/// Values of the conditions at the end of a motion; nothing where one has no value.
fn conditions(ocp: &Ocp, motion: &Guess) -> Option<Vec<f64>> {
    let (last, nu) = (ocp.n_stages - 1, ocp.system.dims().u);
    let (x, u) = (motion.last_state(), &motion.controls[last * nu..]);
    let mut values = Vec::new();
    for c in &ocp.terminal {
        let at = Point { t: ocp.t0 + motion.horizon(), x, u, p: ocp.params_of(last) };
        let mut out = vec![0.0; c.f.n_out()];
        c.f.value(&at, &mut out, &mut vec![0.0; c.f.work_len()]).ok()?;
        values.extend(out);
    }
    values.iter().all(|v| v.is_finite()).then_some(values)
}

/// How far a sequence is from another one: how far its transitions have to be moved, in stages; those put in or left out count
/// as one each.
fn distance(from: &[Passage], guess: &Guess, to: &[Passage]) -> f64 {
    if from.len() != to.len() {
        return 1.0 + from.len().abs_diff(to.len()) as f64;
    }
    let moved = from.iter().zip(to).zip(&guess.passages).map(|((a, b), t)| {
        let (start, end) = guess.stage(b.stage);
        let length = (end - start).max(f64::MIN_POSITIVE);
        match (a.transition == b.transition, a.stage == b.stage) {
            (true, true) => 0.0,
            (true, false) => ((start - t).max(t - end) / length).max(0.0),
            _ => 1.0,
        }
    });
    moved.sum()
}
