//! What is searched where controls choose: sequences of choices, their programs, those next to one.

use std::rc::Rc;

use super::levels::{Levels, Sequence};
use crate::error::Result;
use crate::nlp::{Control, Outcome};
use crate::ocp::request::Request;
use crate::ocp::solve::Start;
use crate::ocp::{Ocp, OcpResult};
use crate::search::{
    self, watched, Budget, EarlyTermination, Limits, Neighbour, Patience, Rank, Sampler, Source, Space,
};
use crate::settings::OcpStart;

/// Where a program starts: controls, and states at times from the start of the horizon, where they are known.
pub(super) struct Motion {
    controls: Vec<f64>,
    states: Option<(Vec<f64>, Vec<f64>)>,
}

impl Motion {
    /// That of an answer.
    pub fn of(r: &OcpResult) -> Motion {
        let Some(t0) = r.trajectory.elements.first().map(|e| e.t) else {
            return Motion { controls: r.controls.clone(), states: None };
        };
        let (mut times, mut states) = (Vec::new(), Vec::new());
        for e in r.trajectory.elements.iter().filter(|e| e.h > 0.0) {
            if times.last().is_none_or(|t| *t < e.t - t0) {
                times.push(e.t - t0);
                states.extend_from_slice(&e.x0);
            }
            times.push(e.t + e.h - t0);
            states.extend_from_slice(&e.x1);
        }
        let rises = times.windows(2).all(|w| w[0] < w[1]);
        Motion { controls: r.controls.clone(), states: rises.then_some((times, states)) }
    }

    /// Controls of which no motion is known.
    pub fn with_controls(controls: Vec<f64>) -> Motion {
        Motion { controls, states: None }
    }

    /// The same with the choices of a sequence.
    pub fn with_choices(&self, levels: &Levels, sequence: &[u16]) -> Motion {
        let mut controls = self.controls.clone();
        levels.write(sequence, &mut controls);
        Motion { controls, states: self.states.clone() }
    }

    /// Makes a problem begin there, as far as its choices allow.
    pub fn begin(&self, ocp: &mut Ocp) {
        ocp.x_guess.clone_from(&self.states);
        ocp.u_guess = Some(ocp.within_bounds(self.controls.clone()));
    }
}

/// What the program of a sequence ended at.
pub(super) struct Ended {
    pub sequence: Sequence,
    pub result: OcpResult,
    /// Derivatives of the cost with respect to the choices `[n_stages · n_choices]`, zero where they are not known.
    prices: Vec<f64>,
    /// Largest modulus of the cost on the way to it.
    largest: f64,
}

impl Ended {
    /// Is it shown that the program of its sequence has no solution near its start, which is the only motion that there is where nothing is free?
    pub fn is_impossible(&self) -> bool {
        matches!(self.result.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible)
    }

    /// Does it solve the program of its sequence?
    pub fn is_solution(&self) -> bool {
        self.result.is_exact()
    }
}

type Candidate = search::Candidate<Sequence, Rc<Motion>>;

/// The sequences of a problem.
pub(super) struct Choices<'a> {
    pub levels: Rc<Levels>,
    /// The problem whose choices are fixed or narrowed.
    inner: Ocp,
    request: Request,
    /// Controls to begin with.
    guess: Option<Vec<f64>>,
    constant: Vec<Sequence>,
    /// Is a program without modes and transitions left where all choices are made?
    plain: bool,
    /// The solution with choices anywhere between their values, once it was asked for.
    relaxed: Option<OcpResult>,
    is_relaxed: bool,
    sampler: Sampler,
    largest: f64,
    ocp: &'a Ocp,
}

impl<'a> Choices<'a> {
    pub fn new(ocp: &'a Ocp, guess: Option<Vec<f64>>, request: &Request) -> Result<Choices<'a>> {
        let levels = Rc::new(Levels::new(ocp)?);
        let mut inner = ocp.blank();
        inner.modes = None;
        Ok(Choices {
            constant: levels.constant(),
            levels,
            inner,
            request: request.of_a_part(),
            guess: guess.or_else(|| ocp.u_guess.clone()),
            plain: !ocp.is_simulated() && !ocp.switches(),
            relaxed: None,
            is_relaxed: false,
            sampler: Sampler::new(ocp.settings.search_seed as u64),
            largest: 0.0,
            ocp,
        })
    }

    /// Controls with the choices of a sequence, and all others as they are given.
    fn controls(&self, sequence: &[u16], from: &[f64]) -> Vec<f64> {
        let mut controls = from.to_vec();
        self.levels.write(sequence, &mut controls);
        controls
    }

    /// Solves with every choice between two values: from a motion, or else from where a solve begins.
    pub fn solve_between(
        &mut self,
        [low, high]: [&[u16]; 2],
        from: Option<&Motion>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<OcpResult> {
        let inner = &mut self.inner;
        inner.chosen = Some(self.levels.bounds(self.ocp, low, high));
        match from {
            Some(motion) => motion.begin(inner),
            None => (inner.x_guess, inner.u_guess) = (self.ocp.x_guess.clone(), None),
        }
        if inner.is_simulated() {
            // one descent for every sequence: the search is over these
            let request = Request { start: OcpStart::Homotopy, ..self.request };
            inner.solve_simulated(Start::Cold, &request, control)?;
        } else if self.plain {
            inner.run(Start::Cold, &self.request, control)?;
        } else {
            inner.search(Start::Cold, &self.request, control)?;
        }
        let r = inner.last_result()?.clone();
        budget.solved(r.dimensions.0, &r.stats);
        Ok(r)
    }

    /// The problem with all choices between their least and their largest values.
    pub fn relax(&mut self, budget: &mut Budget, control: &mut Control) -> Result<&OcpResult> {
        let r = match self.relaxed.take() {
            Some(r) => r,
            None => {
                let [low, high] = self.levels.widest();
                // where it has no solution no sequence has one, and that is to be known
                let usual = std::mem::replace(&mut self.request.explain, self.plain);
                let r = self.solve_between([&low, &high], None, budget, control);
                self.request.explain = usual;
                r?
            }
        };
        Ok(self.relaxed.insert(r))
    }

    /// Derivatives with respect to the choices of the last program: multipliers of what is fixed.
    fn prices(&self) -> Vec<f64> {
        let n = self.levels.n() * self.levels.n_stages();
        let Some(b) = self.inner.built.as_ref() else { return vec![0.0; n] };
        let (z, stages) = (&b.solver.solution().z, b.problem.places().1);
        let m = self.levels.n();
        let price = |e: usize| z.get(stages[e / m] + self.levels.control(e % m)).copied().unwrap_or(0.0);
        (0..n).map(price).collect()
    }

    /// Random controls as the nearest sequences, none of them twice.
    fn samples(&mut self, best: Option<&Ended>) -> Vec<Candidate> {
        let ranges = self.ocp.control_ranges();
        let guess = self.ocp.control_guess();
        let known = best.map_or(&guess[..], |b| &b.result.controls);
        let mut out: Vec<Candidate> = Vec::new();
        for _ in 0..self.ocp.settings.search_samples {
            let controls = self.sampler.draw(self.levels.n_stages(), &ranges, known);
            let sequence = self.levels.nearest(&controls);
            if out.iter().all(|c| c.sequence != sequence) {
                out.push(self.candidate(sequence, known));
            }
        }
        out
    }

    /// Solves the program of a sequence with all patience.
    pub fn solve_sequence(
        &mut self,
        sequence: Sequence,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Option<Ended>> {
        let candidate = self.candidate(sequence, &self.ocp.control_guess());
        let limits = Limits { cost: f64::INFINITY, patience: usize::MAX };
        Ok(self.solve(&candidate, limits, budget, control)?.into_iter().next().map(|e| e.1))
    }

    /// A sequence of which nothing is known but its choices; the other controls are those given.
    fn candidate(&self, sequence: Sequence, from: &[f64]) -> Candidate {
        let controls = self.controls(&sequence, from);
        Candidate::new(sequence, Rc::new(Motion { controls, states: None }))
    }
}

impl Space for Choices<'_> {
    type Sequence = Sequence;
    type Motion = Rc<Motion>;
    type Solution = Ended;

    fn propose(
        &mut self,
        source: Source,
        best: Option<&Ended>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate>> {
        Ok(match source {
            Source::Guess => match self.guess.take() {
                Some(u) => vec![self.candidate(self.levels.nearest(&u), &u)],
                None => Vec::new(),
            },
            Source::Relaxation if !self.is_relaxed => {
                self.is_relaxed = true;
                let r = self.relax(budget, control)?;
                let (u, motion) = (r.controls.clone(), Rc::new(Motion::of(r)));
                let mut all = vec![self.levels.rounded(&u), self.levels.nearest(&u)];
                all.dedup();
                let of = |sequence| Candidate::new(sequence, motion.clone());
                all.into_iter().filter(|s| self.levels.is_held(s)).map(of).collect()
            }
            Source::Simulation if !self.constant.is_empty() => {
                let sequence = self.constant.remove(0);
                vec![self.candidate(sequence, &self.ocp.control_guess())]
            }
            Source::Samples if self.sampler.begin_round() => self.samples(best),
            _ => Vec::new(),
        })
    }

    fn solve(
        &mut self,
        c: &Candidate,
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Sequence, Ended)>> {
        // a search within a search gives its own programs up
        let plain = self.plain;
        let cost = if plain { limits.cost } else { f64::INFINITY };
        let patience = Patience::usual(if plain { limits.patience } else { usize::MAX });
        let mut watch = EarlyTermination::new(cost, patience, self.request.options.solver.tol);
        let both = [&c.sequence[..]; 2];
        let result = match plain {
            true => watched(&mut watch, control, |control| self.solve_between(both, Some(&c.motion), budget, control)),
            false => self.solve_between(both, Some(&c.motion), budget, control),
        };
        let result = result?.given_up(&watch);
        self.largest = self.largest.max(watch.largest);
        let ended = Ended { sequence: c.sequence.clone(), prices: self.prices(), result, largest: watch.largest };
        Ok(vec![(c.sequence.clone(), ended)])
    }

    fn rank(&self, s: &Ended) -> Rank {
        s.result.rank(s.result.priced, self.largest.max(s.largest))
    }

    fn neighbours(&self, s: &Ended) -> (Vec<Neighbour<Sequence>>, Rc<Motion>) {
        let promise = |sequence: &[u16], entries: &[usize]| {
            let step = |e: &usize| self.levels.value(*e, sequence[*e]) - self.levels.value(*e, s.sequence[*e]);
            if s.is_solution() {
                entries.iter().map(|e| s.prices[*e] * step(e)).sum()
            } else {
                0.0
            }
        };
        let of = |c: super::levels::Change| Neighbour {
            promise: promise(&c.sequence, &c.entries),
            kind: usize::from(!c.is_single),
            is_local: c.is_single,
            sequence: c.sequence,
        };
        (self.levels.next_to(&s.sequence).into_iter().map(of).collect(), Rc::new(Motion::of(&s.result)))
    }

    fn moved(&self, _: &Ended, motion: &Rc<Motion>, to: &Sequence) -> Rc<Motion> {
        let controls = self.controls(to, &motion.controls);
        Rc::new(Motion { controls, states: motion.states.clone() })
    }
}
