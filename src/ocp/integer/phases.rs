//! Choices in problems of several phases: a sequence is those of all phases, one behind the other. Dwell times hold within each phase.

use std::rc::Rc;

use super::levels::{Levels, Sequence};
use super::space::Motion;
use super::Claim;
use crate::error::{Error, Result};
use crate::nlp::{Control, Outcome};
use crate::ocp::portfolio::SEARCH;
use crate::ocp::programs::plan;
use crate::ocp::request::Request;
use crate::ocp::{MultiPhase, MultiPhaseResult, Ocp};
use crate::search::{self, explore, Budget, Limits, Neighbour, Rank, Sampler, Source, Space};
use crate::settings::OcpStart;
use crate::stop;

type Motions = Rc<Vec<Motion>>;
type Candidate = search::Candidate<Sequence, Motions>;

/// The sequences of a problem of several phases.
struct PhasedChoices {
    /// Of every phase.
    levels: Vec<Levels>,
    /// The problem whose choices are fixed.
    inner: MultiPhase,
    request: Request,
    has_guess: bool,
    constant: usize,
    relaxed: bool,
    sampler: Sampler,
    samples: i64,
}

/// What the program of a sequence ended at.
struct Ended {
    sequence: Sequence,
    result: MultiPhaseResult,
}

impl PhasedChoices {
    fn new(of: &MultiPhase, request: &Request) -> Result<PhasedChoices> {
        let inner = of.blank();
        Ok(PhasedChoices {
            levels: inner.phases.iter().map(Levels::new).collect::<Result<_>>()?,
            has_guess: inner.phases.iter().any(|p| p.u_guess.is_some()),
            constant: 0,
            relaxed: false,
            sampler: Sampler::new(of.settings.search_seed as u64),
            samples: of.settings.search_samples,
            // one descent or one program for every sequence: the search is over these
            request: Request { start: OcpStart::Homotopy, ..request.of_a_part() },
            inner,
        })
    }

    /// The parts of a sequence, one for every phase.
    fn parts<'a>(&self, sequence: &'a [u16]) -> Vec<&'a [u16]> {
        let mut rest = sequence;
        let part = |l: &Levels| {
            let (own, next) = rest.split_at(l.n() * l.n_stages());
            rest = next;
            own
        };
        self.levels.iter().map(part).collect()
    }

    fn is_held(&self, sequence: &[u16]) -> bool {
        self.levels.iter().zip(self.parts(sequence)).all(|(l, s)| l.is_held(s))
    }

    /// A sequence made of one for every phase, from what may be chosen in it and its problem.
    fn made(&self, of: &dyn Fn(&Levels, &Ocp) -> Sequence) -> Sequence {
        self.levels.iter().zip(&self.inner.phases).flat_map(|(l, p)| of(l, p)).collect()
    }

    /// A sequence of which nothing is known but its choices.
    fn candidate(&self, sequence: Sequence) -> Candidate {
        let parts = self.parts(&sequence);
        let each = self.levels.iter().zip(&self.inner.phases).zip(parts);
        let motions = each.map(|((l, p), s)| {
            let mut controls = p.control_guess();
            l.write(s, &mut controls);
            Motion::with_controls(controls)
        });
        let motions = Rc::new(motions.collect());
        Candidate::new(sequence, motions)
    }

    /// Solves with every choice between two values.
    fn solve_between(
        &mut self,
        [low, high]: [&[u16]; 2],
        from: &[Motion],
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<MultiPhaseResult> {
        let (low, high) = (self.parts(low), self.parts(high));
        for (k, p) in self.inner.phases.iter_mut().enumerate() {
            p.chosen = Some(self.levels[k].bounds(p, low[k], high[k]));
            if let Some(motion) = from.get(k) {
                motion.begin(p);
            }
        }
        let r = self.inner.solve_fixed(&self.request, control)?;
        budget.solved(r.dimensions.0, &r.stats);
        Ok(r)
    }

    /// The nearest sequences to the problem with all choices between their least and their largest values.
    fn relaxation(&mut self, budget: &mut Budget, control: &mut Control) -> Result<Vec<Candidate>> {
        let widest = [0, 1].map(|side: usize| self.made(&|l, _| l.widest()[side].clone()));
        let r = self.solve_between([&widest[0], &widest[1]], &[], budget, control)?;
        let motions: Motions = Rc::new(r.phases.iter().map(Motion::of).collect());
        let u: Vec<&[f64]> = r.phases.iter().map(|p| &p.controls[..]).collect();
        let of = |round: &dyn Fn(&Levels, &[f64]) -> Sequence| -> Sequence {
            self.levels.iter().zip(&u).flat_map(|(l, u)| round(l, u)).collect()
        };
        let mut all = vec![of(&|l, u| l.rounded(u)), of(&|l, u| l.nearest(u))];
        all.dedup();
        let held = all.into_iter().filter(|s| self.is_held(s));
        Ok(held.map(|s| Candidate::new(s, motions.clone())).collect())
    }

    /// The next sequence whose choices stay the same over every phase.
    fn next_constant(&mut self) -> Option<Candidate> {
        let most = self.levels.iter().map(|l| l.constant().len()).max().unwrap_or(0);
        let k = self.constant;
        self.constant += 1;
        let of = |l: &Levels, _: &Ocp| l.constant().get(k).or(l.constant().last()).cloned().unwrap_or_default();
        (k < most).then(|| self.candidate(self.made(&of)))
    }

    fn draw(&mut self, best: Option<&Ended>) -> Vec<Candidate> {
        let mut out: Vec<Candidate> = Vec::new();
        for _ in 0..self.samples {
            let mut sequence = Vec::new();
            for (k, (l, p)) in self.levels.iter().zip(&self.inner.phases).enumerate() {
                let known = best.map_or_else(|| p.control_guess(), |b| b.result.phases[k].controls.clone());
                let drawn = self.sampler.draw(l.n_stages(), &p.control_ranges(), &known);
                sequence.extend(l.nearest(&drawn));
            }
            if out.iter().all(|c| c.sequence != sequence) {
                out.push(self.candidate(sequence));
            }
        }
        out
    }
}

impl Space for PhasedChoices {
    type Sequence = Sequence;
    type Motion = Motions;
    type Solution = Ended;

    fn propose(
        &mut self,
        source: Source,
        best: Option<&Ended>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate>> {
        Ok(match source {
            Source::Guess if std::mem::take(&mut self.has_guess) => {
                vec![self.candidate(self.made(&|l, p| l.nearest(&p.control_guess())))]
            }
            Source::Relaxation if !std::mem::replace(&mut self.relaxed, true) => self.relaxation(budget, control)?,
            Source::Simulation => self.next_constant().into_iter().collect(),
            Source::Samples if self.sampler.begin_round() => self.draw(best),
            _ => Vec::new(),
        })
    }

    fn solve(
        &mut self,
        c: &Candidate,
        _: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Sequence, Ended)>> {
        let motions = c.motion.clone();
        let result = match self.solve_between([&c.sequence[..]; 2], &motions, budget, control) {
            // a sequence that no simulation follows leads nowhere
            Err(Error::Numeric(_)) => return Ok(Vec::new()),
            found => found?,
        };
        Ok(vec![(c.sequence.clone(), Ended { sequence: c.sequence.clone(), result })])
    }

    fn rank(&self, s: &Ended) -> Rank {
        let cost = s.result.phases.iter().map(|p| p.priced).sum::<f64>();
        Rank {
            feasible: s.result.outcome == Outcome::Solved,
            contradicted: false,
            cost,
            violation: s.result.residuals.primal,
            idle: 0,
            rounding: f64::EPSILON * cost.abs(),
        }
    }

    fn neighbours(&self, s: &Ended) -> (Vec<Neighbour<Sequence>>, Motions) {
        let mut all = Vec::new();
        let mut first = 0;
        for (l, part) in self.levels.iter().zip(self.parts(&s.sequence)) {
            for change in l.next_to(part) {
                let mut sequence = s.sequence.clone();
                sequence[first..first + part.len()].copy_from_slice(&change.sequence);
                let kind = usize::from(!change.is_single);
                all.push(Neighbour { promise: 0.0, kind, is_local: change.is_single, sequence });
            }
            first += part.len();
        }
        (all, Rc::new(s.result.phases.iter().map(Motion::of).collect()))
    }

    fn moved(&self, _: &Ended, motion: &Motions, to: &Sequence) -> Motions {
        let each = motion.iter().zip(&self.levels).zip(self.parts(to));
        Rc::new(each.map(|((m, l), s)| m.with_choices(l, s)).collect())
    }
}

impl MultiPhase {
    /// Solves a problem of phases whose controls choose: a search over sequences of choices, then the program of the best one.
    pub(in crate::ocp) fn solve_choices(
        &mut self,
        request: &Request,
        control: &mut Control,
    ) -> Result<MultiPhaseResult> {
        let mut space = PhasedChoices::new(self, request)?;
        let mut budget = Budget::new(f64::INFINITY);
        let sources = [Source::Guess, Source::Relaxation, Source::Simulation, Source::Samples];
        let any = !self.phases.iter().any(|p| p.has_costs());
        let plan = plan(&self.settings, &sources, self.settings.search_effort, request.search, any);
        let found = control.sooner(SEARCH, |control| explore(&mut space, &plan, Vec::new(), &mut budget, control))?;
        let (settled, tried) = (found.settled, found.tried);
        let Some((best, _)) = found.all.into_iter().next() else {
            let none = || Error::Numeric("no sequence of choices could be tried: give a guess of the controls".into());
            return Err(stop::requested().map_or_else(none, |why| why.error()));
        };
        let parts = space.parts(&best.sequence);
        let bounds: Vec<_> =
            (0..parts.len()).map(|k| space.levels[k].bounds(&self.phases[k], parts[k], parts[k])).collect();
        let guesses: Vec<_> = self.phases.iter_mut().map(|p| (p.x_guess.take(), p.u_guess.take())).collect();
        for ((p, bounds), r) in self.phases.iter_mut().zip(bounds).zip(&best.result.phases) {
            p.chosen = Some(bounds);
            Motion::of(r).begin(p);
        }
        let solved = self.solve_fixed(&Request { start: OcpStart::Homotopy, ..*request }, control);
        for (p, (x, u)) in self.phases.iter_mut().zip(guesses) {
            (p.x_guess, p.u_guess) = (x, u);
        }
        let mut r = solved?;
        if r.outcome != Outcome::Solved {
            r.message =
                format!("none of the {tried} sequences of choices that were tried has a solution: {}", r.message);
        }
        let claim = Claim { settled, ..Claim::nothing() };
        r.phases.iter_mut().filter_map(|p| p.optimality.as_mut()).for_each(|o| o.judge_choices(&claim));
        r.stats.add(&budget.stats);
        Ok(r)
    }
}
