//! Optimal control of systems with transitions: hysteresis, automata, resets.
//!
//! A sequence of transitions, each with the control stage it is made in, is a smooth problem: between two transitions the
//! discrete states are constant, the times of the transitions are variables, a stage with a transition is cut there, the guard
//! that passes zero is an equality at that time, and every guard that is watched keeps its sign until then. Sequences to begin
//! with come from simulations by events; from the best one with a solution the search goes to sequences next to it, as long as
//! the cost falls. A transition is put in only where its guard comes close to zero along the best answer: where it stays away a
//! small change of the controls would not make it, so nothing near the answer is left out. What is not near it is asked of simulations of
//! controls drawn at random ([`look`]), whose sequences are tried for a share of what the search has taken, as long as one is better.

mod automaton;
mod guess;
mod legs;
mod look;
mod program;

use std::collections::BTreeSet;
use std::time::Instant;

use self::automaton::{Automaton, Passage, Sequence};
use self::guess::Guess;
use self::program::Program;
use super::accuracy::{self, Accuracy, Answer, Replay};
use super::between::Rows;
use super::extend::{Extended, Statement};
use super::optimality::{Kink, Optimality, OTHER};
use super::request::{Comparison, Request};
use super::solve::Start;
use super::{CostOf, Durations, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Sizes;
use crate::nlp::{allowance, Control, Outcome, SecondOrder, Statistics};
use crate::settings::OcpStart;
use crate::sim::SolveOptions;
use crate::stop;

/// Sequences that are solved at most where the option mode_search does not say more.
const SEQUENCES: usize = 200;
/// Share of the cost by which one must be lower to count as better.
const GAIN: f64 = 1e-9;
/// Iterations of a sequence once another one has a solution: so many times those of the best one, which are taken for this
/// many at least. What has a solution takes about as many; what has none would take hundreds to find that out.
const LONGER: usize = 2;
const USUAL: usize = 15;
/// Share of the violation by which one must be lower to count as better.
const LESS: f64 = 0.5;
/// Answers that are not the best whose neighbours are tried.
const PATIENCE: usize = 3;
/// Iterations of a second look, as a share of those before.
const LOOK_SHARE: f64 = 0.5;
/// A guard that stays further away from zero than this share of its range is not made to pass it.
const NEAR: f64 = 0.1;

/// Distance of a transition from the end of a stage, as a share of the stage, at which it is there, and share of the range of a guard at which it
/// touches zero.
const AT_END: f64 = 1e-6;
const TOUCHES: f64 = 1e-6;

/// A transition of an answer.
#[derive(Debug, Clone, PartialEq)]
pub struct JumpMade {
    /// Time.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: usize,
    /// The control stage it is made in.
    pub stage: usize,
    /// Its guard was beyond zero where its discrete state began, or where the control changed.
    pub at_once: bool,
    /// State just before `[nx]`.
    pub before: Vec<f64>,
    /// State just behind `[nx]`.
    pub after: Vec<f64>,
}

/// A sequence with what its program found.
struct Found {
    sequence: Sequence,
    result: OcpResult,
    /// Were the sequences next to it tried?
    expanded: bool,
}

impl Found {
    /// What the search goes by: answers by their cost, then what is none by its violation.
    fn rank(&self) -> (bool, f64) {
        match self.result.is_exact() {
            true => (false, self.result.cost),
            false => (true, self.result.residuals.primal),
        }
    }
}

/// The search: what was tried and what is best.
struct Search<'a> {
    ocp: &'a Ocp,
    automaton: Automaton,
    sizes: Sizes,
    request: Request,
    tried: BTreeSet<Sequence>,
    /// What was found, the best first.
    found: Vec<Found>,
    spent: Statistics,
    /// Sequences that may still be tried.
    left: usize,
    /// May a better answer be elsewhere, and is it asked for?
    looks: bool,
}

impl Ocp {
    /// Does the system have transitions?
    pub(super) fn has_transitions(&self) -> bool {
        !self.system.transitions().is_empty()
    }

    /// Is there nothing to choose? Then the simulation is the answer.
    fn is_determined(&self) -> bool {
        let fixed = self.x0_bounds[0] == self.x0_bounds[1] && self.time == Durations::Fixed;
        fixed && self.system.dims().u == 0 && !self.free_params().contains(&true)
    }

    /// Solves a problem with transitions; a warm start begins with the sequence of the last answer.
    pub(super) fn solve_transitions(
        &mut self,
        start: Start,
        request: &Request,
        control: &mut Control,
    ) -> Result<&OcpResult> {
        let clock = Instant::now();
        legs::check(self)?;
        let last = if start == Start::Warm { self.result.take() } else { None };
        let mut search = Search::new(self, request)?;
        let (found, tried) = match search.run(last.as_ref(), control) {
            Ok(()) => (search.found.drain(..).next(), search.tried.len()),
            Err(e) => return Err(e),
        };
        let ended = search.left == 0;
        let (spent, text) = (search.spent, found.as_ref().map(|f| search.automaton.text(&f.sequence)));
        let automaton = search.automaton;
        let Some(Found { mut result, expanded, .. }) = found else {
            return Err(stop::requested().map_or_else(
                || {
                    Error::Numeric(
                        "no sequence of transitions could be tried: give another guess of the controls".into(),
                    )
                },
                |why| why.error(),
            ));
        };
        result.stats = spent;
        let text = text.unwrap_or_default();
        if let Some(why) = stop::requested() {
            result.message = format!("{}: the search ended after {tried} sequences of transitions", why.words());
            result.ended = Some(why.into()).filter(|_| result.outcome == Outcome::Solved);
        } else if result.outcome != Outcome::Solved {
            result.message = format!(
                "none of the {tried} sequences of transitions that were tried has a solution; the nearest one ({text}) \
                 violates constraints by {:.3e}",
                result.residuals.primal
            );
        } else if ended {
            result.message = format!(
                "the search ended after {tried} sequences of transitions: others may be better, raise the option mode_search"
            );
        }
        if let Some(c) = request.comparison {
            let found = self.compare_transitions(&result, c, &request.options)?;
            if let Some(text) = self.other_transitions(&found) {
                let more = if result.message.is_empty() { "" } else { "; " };
                result.message = format!("{}{more}{text}", result.message);
            }
            result.accuracy = Some(found);
        }
        if result.is_exact() {
            result.optimality = Some(self.certify_transitions(&result, &automaton, expanded));
        }
        result.stats.time_total = clock.elapsed().as_secs_f64();
        Ok(self.result.insert(result))
    }

    /// Says where the simulation has another discrete state than the answer.
    fn other_transitions(&self, a: &Accuracy) -> Option<String> {
        let large = a.large().filter(|l| self.system.discrete_states().contains(&l.state))?;
        Some(format!(
            "the simulation of the controls has another value of the discrete state {} at the end of stage {}: a transition is \
             made at the end of a stage, or a guard comes to zero and turns back there",
            large.state, large.stage
        ))
    }

    /// What is known of an answer as a point of the control problem: the program of its sequence is smooth, so that its conditions of second order
    /// say that it is an optimum among motions with these transitions. Where none of them is at the end of a stage and no guard that is watched
    /// touches zero, small changes of the controls keep the sequence; elsewhere the sequences next to it were solved for.
    fn certify_transitions(&self, r: &OcpResult, automaton: &Automaton, settled: bool) -> Optimality {
        let other = r.accuracy.as_ref().is_some_and(|a| a.contradicts(self.cost_size(r.priced)));
        let mut kinks = Vec::new();
        let kink = Kink::without_derivatives;
        let lengths = r.durations.iter();
        let ends: Vec<f64> = lengths
            .scan(self.t0, |t, d| {
                *t += d;
                Some(*t)
            })
            .collect();
        for j in &r.jumps {
            let stage =
                ends.iter().take(self.n_stages - 1).position(|t| (j.t - t).abs() <= AT_END * r.durations[j.stage]);
            kinks.extend(stage.map(|k| kink(k + 1, j.t, false)));
        }
        for near in guess::distances(r, self, automaton) {
            let touched = near.iter().enumerate().filter(|(_, share)| **share <= TOUCHES);
            kinks.extend(touched.map(|(k, _)| kink(k, ends[k] - 0.5 * r.durations[k], true)));
        }
        let doubt = if other {
            Some(OTHER)
        } else if r.certificate.second != SecondOrder::StrictMinimum {
            Some("the conditions of second order of the sequence of transitions are not shown to hold")
        } else if !settled {
            Some("not every sequence of transitions next to it was tried")
        } else {
            None
        };
        let compared = "the sequences of transitions next to it were tried, and none is better";
        Optimality::of_one_order(doubt, compared, r.residuals.dual, Vec::new(), kinks)
    }

    /// Compares an answer with the simulation of its controls, transitions included.
    fn compare_transitions(&self, r: &OcpResult, c: Comparison, options: &SolveOptions) -> Result<Accuracy> {
        let nx = self.system.dims().x;
        if let Some(why) = stop::requested() {
            return Ok(Accuracy::stopped(self.n_stages, nx, why));
        }
        // without relaxed constraints: their price is no part of the cost that is compared
        let lagrange = self.with_kinks(self.lagrange.as_ref(), CostOf::Running)?;
        let mayer = self.with_kinks(self.mayer.as_ref(), CostOf::Terminal)?;
        let e = Extended::new(&Statement {
            system: &self.system,
            lagrange: lagrange.as_ref(),
            mayer: mayer.as_ref(),
            path: &[],
            terminal: &self.terminal,
            boundary: &[],
            squares: &self.squares,
            soft: &[],
            complementarity: &[],
        })?;
        let mut params = self.extended_params(&e);
        let wide = e.system.dims().p;
        if self.stage_params.is_none() && wide > 0 {
            params.chunks_mut(wide).for_each(|p| p[..r.params.len()].copy_from_slice(&r.params));
        }
        let elements = &r.trajectory.elements;
        let mut states = Vec::with_capacity(self.n_stages * nx);
        for k in 0..self.n_stages {
            let last = elements.iter().rev().find(|e| e.stage == k);
            states.extend(last.map_or_else(|| vec![f64::NAN; nx], |e| e.x1.clone()));
        }
        let usual = self.prior_sizes();
        let answer = Answer {
            usual: &usual,
            t0: self.t0,
            x0: r.jumps.first().filter(|j| j.t <= self.t0).map_or(&elements[0].x0, |j| &j.before),
            durations: &r.durations,
            controls: &r.controls,
            control_ends: &r.control_ends,
            linear: &self.linear,
            params: &params,
            states: &states,
            cost: r.cost_reached,
            cost_size: self.cost_size(r.cost_reached),
            mayer: e.mayer.as_ref(),
            grid_cost: None,
            tol: c.tol,
            terminal: e.terminal.iter().map(|t| (&t.f, &t.lower[..], &t.upper[..])).collect(),
            path: e.path.iter().take(self.path.len()).map(Rows::of).collect(),
            x_bounds: [&self.x_bounds[0], &self.x_bounds[1]],
        };
        let mut engine = Replay::new(&e.system, None, e.lagrange.as_ref(), &answer, options)?;
        match accuracy::measure(&mut engine, &answer) {
            Err(Error::Interrupted) => Ok(Accuracy::stopped(self.n_stages, nx, stop::Why::Interrupted)),
            Err(Error::OutOfTime) => Ok(Accuracy::stopped(self.n_stages, nx, stop::Why::OutOfTime)),
            r => r,
        }
    }
}

impl<'a> Search<'a> {
    fn new(ocp: &'a Ocp, request: &Request) -> Result<Search<'a>> {
        Ok(Search {
            ocp,
            automaton: Automaton::new(&ocp.system, &ocp.x0_bounds[0], &ocp.x_bounds),
            sizes: ocp.sizes()?,
            request: request.of_a_part(),
            tried: BTreeSet::new(),
            found: Vec::new(),
            spent: Statistics::default(),
            left: SEQUENCES.max(request.search),
            looks: ocp.has_costs() && request.start != OcpStart::Homotopy,
        })
    }

    /// Tries the sequences to begin with, then goes from the best one to those next to it as long as that helps.
    fn run(&mut self, last: Option<&OcpResult>, control: &mut Control) -> Result<()> {
        if let Some(r) = last.filter(|r| r.outcome == Outcome::Solved) {
            let passage = |j: &JumpMade| Passage { transition: j.transition, stage: j.stage, at_once: j.at_once };
            let sequence: Sequence = r.jumps.iter().map(passage).collect();
            let mut start = r.clone();
            self.ocp.restate(&mut start);
            self.attempt(sequence, &Guess::of(&start), control)?;
        }
        // an answer of before may have a sequence that the problem of now does not admit
        if self.found.is_empty() {
            let mut engine = guess::engine(self.ocp)?;
            for u in guess::controls(self.ocp) {
                let (sequence, guess) = guess::simulate(self.ocp, &self.automaton, &mut engine, &u)?;
                self.attempt(sequence, &guess, control)?;
            }
        }
        if self.ocp.is_determined() && self.found.first().is_some_and(|f| f.result.is_exact()) {
            return Ok(());
        }
        if last.is_some() {
            // an answer that is known to be good is improved, and that is all
            return self.descend(0, control);
        }
        self.descend(PATIENCE, control)?;
        while self.look_elsewhere(control)? {
            self.descend(PATIENCE, control)?;
        }
        Ok(())
    }

    /// Goes from the best sequence to those next to it as long as that helps, and to those next to so many others.
    fn descend(&mut self, mut patience: usize, control: &mut Control) -> Result<()> {
        while let Some(k) = self.found.iter().position(|f| !f.expanded) {
            if k > 0 && patience == 0 {
                break;
            }
            let before = self.found[0].rank();
            self.expand(k, control)?;
            if self.left == 0 || stop::requested().is_some() {
                break;
            }
            if self.found[0].rank() == before && k > 0 {
                patience -= 1;
            }
        }
        Ok(())
    }

    /// Tries sequences of controls drawn at random for a share of the iterations so far: all sequences next to an answer may cost more where
    /// another one, with transitions elsewhere, costs half of it. True where one is better.
    fn look_elsewhere(&mut self, control: &mut Control) -> Result<bool> {
        let Some(best) = self.found.first().filter(|f| self.looks && f.result.is_exact()) else { return Ok(false) };
        let most = self.spent.iterations + (LOOK_SHARE * self.spent.iterations as f64).ceil() as usize;
        for (sequence, guess) in look::shots(self.ocp, &self.automaton, &best.result.controls)? {
            if self.left == 0 || stop::requested().is_some() || self.spent.iterations >= most {
                break;
            }
            if self.attempt(sequence, &guess, control)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Tries the sequences next to one that was found, the nearest first, up to the first one that is better than all.
    fn expand(&mut self, k: usize, control: &mut Control) -> Result<()> {
        let f = &mut self.found[k];
        let (sequence, guess) = (f.sequence.clone(), Guess::of(&f.result));
        // what is no answer does not say which guards matter
        let near = f.result.is_exact().then(|| guess::distances(&f.result, self.ocp, &self.automaton));
        let near = |t: usize, k: usize| near.as_ref().is_none_or(|n: &Vec<Vec<f64>>| n[t][k] <= NEAR);
        let mut next = self.automaton.neighbours(&sequence, self.ocp.n_stages, &near);
        next.retain(|s| !self.tried.contains(s));
        next.sort_by(|a, b| distance(&sequence, &guess, a).total_cmp(&distance(&sequence, &guess, b)));
        for s in next {
            if self.left == 0 || stop::requested().is_some() {
                return Ok(());
            }
            let start = guess.for_sequence(&sequence, &s);
            if self.attempt(s, &start, control)? {
                return Ok(());
            }
        }
        if let Some(f) = self.found.iter_mut().find(|f| f.sequence == sequence) {
            f.expanded = true;
        }
        Ok(())
    }

    /// Solves the program of a sequence unless that was done. True if it is better than all others.
    fn attempt(&mut self, s: Sequence, guess: &Guess, control: &mut Control) -> Result<bool> {
        let Some(s) = self.automaton.complete(&s) else { return Ok(false) };
        let over = allowance::is_over() && !self.found.is_empty();
        if self.left == 0 || over || !self.tried.insert(s.clone()) {
            return Ok(false);
        }
        self.left -= 1;
        let mut request = self.request;
        if let Some(best) = self.found.first().filter(|f| f.result.is_exact()) {
            let solver = &mut request.options.solver;
            solver.max_iter = solver.max_iter.min(LONGER * best.result.stats.iterations.max(USUAL));
        }
        let program = Program::new(self.ocp, &self.automaton, &s, guess, &self.sizes, &request)?;
        let r = program.solve(&request, control)?;
        self.spent.add(&r.stats);
        let found = Found { sequence: s, result: r, expanded: false };
        let (rank, best) = (found.rank(), self.found.first().map(Found::rank));
        let better = best.is_none_or(|(none, value)| {
            let gain = if none { LESS * value } else { GAIN * value.abs() };
            (rank.0, rank.1) < (none, value - gain) || (none && !rank.0)
        });
        let at = self.found.partition_point(|f| f.rank() <= rank);
        self.found.insert(if better { 0 } else { at.max(usize::from(!self.found.is_empty())) }, found);
        Ok(better)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::{Callback, Dims};
    use crate::linalg::csc::Pattern;
    use crate::ocp::terms::combination;
    use crate::settings::Settings;
    use crate::system::{Direction, SharedFunction, System, Transition};
    use std::sync::Arc;

    /// Distance, speed and the turbo: its states, control and time.
    const D: Dims = Dims { x: 3, u: 1, p: 0 };

    /// The turbo, a discrete state, multiplies the acceleration.
    fn motion(factor: f64) -> Callback {
        let more = factor - 1.0;
        let f = Callback::new("f", D, 3, move |at, o| {
            o.copy_from_slice(&[at.x[1], at.u[0] * (1.0 + more * at.x[2]), 0.0]);
            0
        });
        let (jac, _) = Pattern::from_triplets(3, D.n_in(), &[0, 1, 1], &[1, 2, 3]);
        let f = f.with_jacobian(jac, move |at, o| {
            o.copy_from_slice(&[1.0, more * at.u[0], 1.0 + more * at.x[2]]);
            0
        });
        let (hess, _) = Pattern::from_triplets(D.n_in(), D.n_in(), &[2], &[3]);
        let curved = move |_: &crate::func::Point, w: &[f64], o: &mut [f64]| {
            o[0] = more * w[1];
            0
        };
        f.and_then(|f| f.with_hessian(hess, curved)).unwrap()
    }

    /// The speed less a limit.
    fn above(limit: f64) -> SharedFunction {
        let f = Callback::new("guard", D, 1, move |at, o| {
            o[0] = at.x[1] - limit;
            0
        });
        let (jac, _) = Pattern::from_triplets(1, D.n_in(), &[0], &[1]);
        let f = f.with_jacobian(jac, |_, o| {
            o[0] = 1.0;
            0
        });
        Arc::new(f.unwrap().linear())
    }

    /// The car with hysteresis on `n` stages.
    fn car(n: usize, (on, off, factor): (f64, f64, f64)) -> Ocp {
        let mut s = System::new(3, 1, 0).unwrap();
        s.set_f0(Arc::new(motion(factor))).unwrap();
        for (limit, direction, from) in [(on, Direction::Rising, 0.0), (off, Direction::Falling, 1.0)] {
            let (from, to) = (vec![(2, from)], vec![(2, 1.0 - from)]);
            s.add_transition(Transition { guard: above(limit), direction, from, reset: None, to }).unwrap();
        }
        let mut o = Ocp::new(&s, 10.0, n, &Settings { n_fe: 1, ..Settings::default() }).unwrap();
        o.set_x0(&[0.0; 3]).unwrap();
        let most = f64::INFINITY;
        o.set_x_bounds(&[-most, -25.0, -most], &[most, 25.0, most]).unwrap();
        o.set_u_bounds(&[-5.0], &[5.0]).unwrap();
        o.set_free_time(Durations::Horizon, 0.5, 100.0).unwrap();
        let end = combination("end", D, vec![vec![(0, 1.0)], vec![(1, 1.0)]]);
        o.add_terminal(end, &[150.0, 0.0], &[150.0, 0.0]).unwrap();
        o.set_mayer(combination("T", D, vec![vec![(D.t_col(), 1.0)]])).unwrap();
        o
    }

    fn pair(on: usize, off: usize) -> Sequence {
        let passage = |transition, stage| Passage { transition, stage, at_once: false };
        vec![passage(0, on), passage(1, off)]
    }

    /// Sequences of the reference (9.4 of the thesis) and what they cost.
    #[test]
    fn programs_of_given_sequences() {
        let o = car(10, (15.0, 10.0, 3.0));
        let request = Request::from_settings(&o.settings).unwrap();
        // the exact values of the others are known to the accuracy of the solver they were computed with
        let known = [(2, 8, 10.22925791133135, 1e-11), (2, 7, 10.253284759, 1e-6), (3, 8, 10.267941772, 1e-6)];
        for (on, off, cost, tol) in known {
            let mut s = Search::new(&o, &request).unwrap();
            let mut u = vec![5.0; 10];
            u[5..].fill(-5.0);
            let (sequence, guess) = guess::simulate(&o, &s.automaton, &mut guess::engine(&o).unwrap(), &u).unwrap();
            let start = guess.for_sequence(&sequence, &pair(on, off));
            s.attempt(pair(on, off), &start, &mut Control::default()).unwrap();
            let r = &s.found[0].result;
            assert!((r.cost - cost).abs() < tol, "{on} {off}: {} {}", r.cost, r.outcome.name());
        }
    }

    /// Every sequence of at most two transitions from two guesses each: none is better than what the search finds.
    #[test]
    fn the_search_finds_the_best_of_all_sequences() {
        for data in [(15.0, 10.0, 3.0), (12.0, 6.0, 2.0), (18.0, 12.0, 5.0)] {
            let mut o = car(7, data);
            let found = o.solve(&mut Control::default()).unwrap().clone();
            assert_eq!(found.outcome, Outcome::Solved);
            let request = Request::from_settings(&o.settings).unwrap();
            let mut best = f64::INFINITY;
            for half in [3, 4] {
                let mut s = Search::new(&o, &request).unwrap();
                let mut u = vec![5.0; 7];
                u[half..].fill(-5.0);
                let (sequence, guess) = guess::simulate(&o, &s.automaton, &mut guess::engine(&o).unwrap(), &u).unwrap();
                for (on, off) in (0..7).flat_map(|on| (on..7).map(move |off| (on, off))) {
                    let start = guess.for_sequence(&sequence, &pair(on, off));
                    s.attempt(pair(on, off), &start, &mut Control::default()).unwrap();
                }
                best = best.min(s.found[0].result.cost);
            }
            // both are known to the tolerance of the solver
            assert!(found.cost <= best * (1.0 + 1e-8), "{data:?}: {} {best}", found.cost);
        }
    }

    #[test]
    fn neighbours_are_sequences_that_can_be() {
        let o = car(5, (15.0, 10.0, 3.0));
        let a = Automaton::new(&o.system, &o.x0_bounds[0], &o.x_bounds);
        let all = a.neighbours(&pair(1, 3), 5, &|_, _| true);
        assert!(all.contains(&pair(0, 3)) && all.contains(&pair(2, 3)) && all.contains(&pair(1, 4)));
        assert!(all.contains(&Vec::new()) && all.contains(&pair(1, 3)[..1].to_vec()));
        assert!(all.iter().all(|s| a.values(s).is_some() && s.windows(2).all(|w| w[0].stage <= w[1].stage)));
        // no insertion without a guard near zero
        assert!(a.neighbours(&pair(1, 3), 5, &|_, _| false).iter().all(|s| s.len() <= 2));
    }
}
