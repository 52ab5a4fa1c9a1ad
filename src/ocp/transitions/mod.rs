//! Optimal control of systems with transitions: hysteresis, automata, resets.
//!
//! A sequence of transitions, each with the control stage it is made in, is a smooth problem: between two transitions the
//! discrete states are constant, the times of the transitions are variables, a stage with a transition is cut there, the guard
//! that passes zero is an equality at that time, and every guard that is watched keeps its sign until then. Sequences to begin
//! with come from simulations by events. A transition is put in only where its guard comes close to zero along a solution: where it stays away a
//! small change of the controls would not make it, so nothing near is left out. What is not near is asked of simulations of random controls.
//! [`space`] says this to the [search](crate::search).

mod automaton;
mod derivatives;
mod guess;
mod legs;
mod program;
mod space;

pub(super) use guess::controls as extremes;

use std::time::Instant;

use self::automaton::{Automaton, Sequence};
use self::derivatives::Kept;
use self::space::{Ended, Transitions};
use super::accuracy::{self, Accuracy, Answer, Replay};
use super::between::Rows;
use super::optimality::{Kink, Optimality, OTHER};
use super::programs::plan;
use super::request::{Comparison, Request};
use super::solve::Start;
use super::{stage_times, Durations, Ocp, OcpResult, TransitionAt};
use crate::error::{Error, Result};
use crate::nlp::{Control, Outcome, SecondOrder};
use crate::search::{self, explore, Budget, Limits, Source, Space};
use crate::settings::OcpStart;
use crate::sim::SolveOptions;
use crate::stop;

/// Distance of a transition from the end of a stage, as a share of the stage, at which it is there, and share of the range of a guard at which it
/// touches zero.
pub(super) const AT_END: f64 = 1e-6;
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

/// What a problem knows of transitions.
#[derive(Default)]
pub(super) struct State {
    /// It is a part of a problem, before a transition: its last stage goes on in the next part.
    pub goes_on: bool,
    /// The program of the last answer, and the problem as it was then.
    pub last: Option<(Box<Ocp>, Box<Kept>)>,
}

impl State {
    /// The same without answers.
    pub fn blank(&self) -> State {
        State { goes_on: self.goes_on, last: None }
    }
}

impl Ocp {
    /// Does the system have transitions?
    pub(super) fn has_transitions(&self) -> bool {
        !self.system.transitions().is_empty()
    }

    /// Can these transitions be part of a sequence of modes?
    pub(super) fn check_sequence(&self, given: &[TransitionAt]) -> Result<()> {
        let n = self.system.transitions().len();
        let Some(t) = given.iter().find(|t| t.transition >= n || t.stage >= self.n_stages) else { return Ok(()) };
        Err(Error::Range(format!(
            "transition {} in stage {} of the given modes: the system has {n} transitions, the problem {} stages",
            t.transition, t.stage, self.n_stages
        )))
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
        self.check_discrete_start()?;
        self.transitions.last = None;
        let last = if matches!(start, Start::Warm | Start::Carried) { self.result.take() } else { None };
        let mut budget = Budget::new(f64::INFINITY);
        let (found, automaton) = self.search_transitions(last.as_ref(), request, &mut budget, control)?;
        let (tried, ended, settled) = (found.tried, found.ended, found.settled);
        let Some((Ended { mut result, sequence, kept, .. }, _)) = found.all.into_iter().next() else {
            return Err(stop::requested().map_or_else(
                || {
                    Error::Numeric(
                        "no sequence of transitions could be tried: give another guess of the controls".into(),
                    )
                },
                |why| why.error(),
            ));
        };
        let text = automaton.text(&sequence);
        result.stats = budget.stats;
        if let Some(why) = stop::requested() {
            result.message = format!("{}: the search ended after {tried} sequences of transitions", why.words());
            result.ended = Some(why.into()).filter(|_| result.outcome == Outcome::Solved);
        } else if result.outcome != Outcome::Solved {
            result.message = format!(
                "none of the {tried} sequences of transitions that were tried has a solution; the nearest one ({text}) \
                 violates constraints by {:.3e}",
                result.residuals.primal
            );
        } else if ended == search::Ended::Limit {
            result.message = format!(
                "the search ended after {tried} sequences of transitions: others may be better, raise the option max_iter"
            );
        }
        if let Some(c) = request.comparison {
            let found = self.compare_motion(&result, &[], c, &request.options)?;
            if let Some(text) = self.other_transitions(&found) {
                let more = if result.message.is_empty() { "" } else { "; " };
                result.message = format!("{}{more}{text}", result.message);
            }
            result.accuracy = Some(found);
            if let Some(text) = self.violated_between(&result) {
                result.add_remark(&text);
            }
        }
        if result.is_exact() {
            let known = self.certify_transitions(&result, &automaton, settled);
            result.optimality = Some(self.or_by_descent(known, &result));
        }
        result.stats.time_total = clock.elapsed().as_secs_f64();
        if result.has_exact_modes() {
            self.transitions.last = Some((Box::new(self.blank()), kept));
        }
        Ok(self.result.insert(result))
    }

    /// From the sequence of an answer of before, or else from all sources.
    fn search_transitions(
        &self,
        last: Option<&OcpResult>,
        request: &Request,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<(search::Found<Ended, Sequence>, Automaton)> {
        let mut space = Transitions::new(self, last, request)?;
        let any = self.is_determined();
        let plan = |sources: &[Source], effort: f64| plan(&self.settings, sources, effort, request.search, any);
        if let (None, Some(modes)) = (last, &self.modes) {
            let given = space.given(modes, budget)?;
            let found = match request.search {
                0 => {
                    let unlimited = Limits { cost: f64::INFINITY, patience: usize::MAX };
                    search::Found::of_one(space.solve(&given, unlimited, budget, control)?)
                }
                _ => {
                    space.first = Some(given);
                    explore(&mut space, &plan(&[Source::Guess], 0.0), Vec::new(), budget, control)?
                }
            };
            if found.all.first().is_some_and(|f| f.0.result.is_exact()) || stop::requested().is_some() {
                return Ok((found, space.automaton));
            }
        }
        if last.is_some() {
            // an answer that is known to be good is improved, and that is all
            let found = explore(&mut space, &plan(&[Source::Guess], 0.0), Vec::new(), budget, control)?;
            if found.all.first().is_some_and(|f| f.0.result.is_exact()) || stop::requested().is_some() {
                return Ok((found, space.automaton));
            }
            // it may have a sequence that the problem of now does not admit
        }
        let samples = self.has_costs() && request.start != OcpStart::Homotopy;
        let sources = [Source::Simulation, Source::Samples];
        let plan = plan(if samples { &sources } else { &sources[..1] }, self.settings.search_effort);
        let found = explore(&mut space, &plan, Vec::new(), budget, control)?;
        Ok((found, space.automaton))
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
        let ends = &stage_times(self.t0, &r.durations)[1..];
        // what happens at known times stays where it is
        let timed = self.timed_transitions();
        for j in r.jumps.iter().filter(|j| !timed[j.transition]) {
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

    /// Which transitions are made at times that nothing changes, in stages that stay where they are.
    fn timed_transitions(&self) -> Vec<bool> {
        match self.time {
            Durations::Fixed => self.system.timed_transitions(&self.free_params()),
            _ => vec![false; self.system.transitions().len()],
        }
    }

    /// Compares an answer with the simulation of its controls, transitions included; `beside` are states on the other side of events at the ends of
    /// stages, where they are known.
    pub(in crate::ocp) fn compare_motion(
        &self,
        r: &OcpResult,
        beside: &[Option<Vec<f64>>],
        c: Comparison,
        options: &SolveOptions,
    ) -> Result<Accuracy> {
        let nx = self.system.dims().x;
        if let Some(why) = stop::requested() {
            return Ok(Accuracy::stopped(self.n_stages, nx, why));
        }
        let e = self.simulated_costs()?;
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
            beside,
            cost: r.cost_reached,
            cost_size: self.cost_size(r.cost_reached),
            mayer: e.mayer.as_ref(),
            grid_cost: e.grid_cost.as_ref(),
            tol: c.tol,
            terminal: e.terminal.iter().map(|t| (&t.f, &t.lower[..], &t.upper[..])).collect(),
            path: self.path.iter().map(Rows::of).collect(),
            x_bounds: [&self.x_bounds[0], &self.x_bounds[1]],
        };
        let mut engine = Replay::new(&e.system, None, e.lagrange.as_ref(), &answer, options)?;
        let measured = accuracy::measure(&mut engine, &answer).and_then(|mut found| {
            if c.by_stage {
                let each = answer.by_stage();
                let stages =
                    each.iter().map(|a| accuracy::measure(&mut engine, a)).collect::<Result<Vec<Accuracy>>>()?;
                found.take_stages(&stages);
            }
            Ok(found)
        });
        match measured {
            Err(Error::Interrupted) => Ok(Accuracy::stopped(self.n_stages, nx, stop::Why::Interrupted)),
            Err(Error::OutOfTime) => Ok(Accuracy::stopped(self.n_stages, nx, stop::Why::OutOfTime)),
            r => r,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::rc::Rc;

    use super::automaton::Passage;
    use super::*;
    use crate::func::{Callback, Dims};
    use crate::linalg::csc::Pattern;
    use crate::settings::Settings;
    use crate::system::combination;
    use crate::system::{Direction, Rule, SharedFunction, System, Transition};
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
            s.add_transition(Transition {
                guard: above(limit),
                direction,
                from,
                reset: None,
                to,
                rule: Rule::default(),
                clauses: vec![],
            })
            .unwrap();
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

    /// What the programs of pairs of transitions end at, from the simulation of full speed up to a stage and braking from there.
    fn programs(o: &Ocp, request: &Request, half: usize, pairs: &[(usize, usize)]) -> Vec<OcpResult> {
        let mut s = Transitions::new(o, None, request).unwrap();
        let mut u = vec![5.0; o.n_stages];
        u[half..].fill(-5.0);
        let (sequence, guess) = guess::simulate(o, &s.automaton, &mut guess::engine(o).unwrap(), &u).unwrap();
        let limits = Limits { cost: f64::INFINITY, patience: 100 };
        let mut one = |&(on, off): &(usize, usize)| {
            let motion = Rc::new(guess.for_sequence(&sequence, &pair(on, off)));
            let candidate = search::Candidate::new(pair(on, off), motion);
            let ended = s.solve(&candidate, limits, &mut Budget::new(f64::INFINITY), &mut Control::default());
            ended.unwrap().remove(0).1.result
        };
        pairs.iter().map(&mut one).collect()
    }

    /// Sequences of the reference (9.4 of the thesis) and what they cost.
    #[test]
    fn programs_of_given_sequences() {
        let o = car(10, (15.0, 10.0, 3.0));
        let request = Request::from_settings(&o.settings).unwrap();
        // the exact values of the others are known to the accuracy of the solver they were computed with
        let known = [(2, 8, 10.22925791133135, 1e-11), (2, 7, 10.253284759, 1e-6), (3, 8, 10.267941772, 1e-6)];
        for (on, off, cost, tol) in known {
            let r = programs(&o, &request, 5, &[(on, off)]).remove(0);
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
                let all: Vec<(usize, usize)> = (0..7).flat_map(|on| (on..7).map(move |off| (on, off))).collect();
                let solved = programs(&o, &request, half, &all).into_iter().filter(|r| r.is_exact());
                best = solved.map(|r| r.cost).fold(best, f64::min);
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
