//! What is searched where simulations are all there is: controls that descents begin with.

use std::rc::Rc;

use super::thresholds::Thresholds;
use crate::error::{Error, Result};
use crate::func::Point;
use crate::nlp::{allowance, Control, IterationInfo, Outcome};
use crate::ocp::choices::Controlled;
use crate::ocp::descent::{self, minimise, restore, Chain, GiveUp, Lowest, Motion, Program, Shooting, Values};
use crate::ocp::{stage_times, OcpResult};
use crate::search::{Budget, Candidate, EarlyTermination, Limits, Neighbour, Patience, Rank, Sampler, Source, Space};
use crate::settings::Settings;
use crate::stop;

/// Simulations of the horizon of one descent at most.
const EVALUATIONS: usize = 80;
/// Violation from which one that has ended goes on while nothing else meets the constraints, and how often.
const NEARLY: f64 = 0.1;
const AGAIN: usize = 3;
/// Violation of a constraint, relative to what the variables change it by, that counts as none.
pub(super) const MET: f64 = 1e-6;

/// Kinds of neighbours.
const EARLIER: usize = 0;
const LATER: usize = 1;
const PASSED: usize = 2;

/// Variables of a descent.
type Start = Rc<Vec<f64>>;
/// Where a descent may begin.
type Proposal = Candidate<Vec<u64>, Start>;

/// Controls, with lengths, parameters and initial states that are free.
pub(super) struct Simulations<'a> {
    chain: Chain<'a>,
    settings: &'a Settings,
    /// Answers of before.
    last: Option<&'a [OcpResult]>,
    /// Controls of every problem that are tried without a search, those that come first last.
    controls: Vec<Vec<[Vec<f64>; 2]>>,
    /// Does nothing else follow the system? What promises no gain is left out then: descents through many contacts take long.
    alone: bool,
    /// Does a candidate lead along a way before all others?
    follows: bool,
    sampler: Sampler,
    best: Option<Best>,
    /// Of every problem.
    thresholds: Vec<Thresholds>,
}

/// The best solution so far.
struct Best {
    cost: f64,
    /// Its variables.
    z: Vec<f64>,
    /// Where its descent began: how far that was from the constraints, and its cost.
    start: [f64; 2],
}

/// Constant controls, at both ends of stages.
fn constant(u: Vec<f64>) -> [Vec<f64>; 2] {
    [u.clone(), u]
}

impl<'a> Simulations<'a> {
    pub fn new(chain: Chain<'a>, settings: &'a Settings, last: Option<&'a [OcpResult]>) -> Simulations<'a> {
        let each: Vec<Vec<Vec<f64>>> = chain.parts().iter().map(|p| p.ocp().extremes()).collect();
        let most = each.iter().map(Vec::len).max().unwrap_or(0);
        // a problem with fewer of them keeps the guess that is its first
        let nth = |k: usize| each.iter().map(|c| constant(c.get(k).unwrap_or(&c[0]).clone())).collect();
        let controls = (0..most).rev().map(nth).collect();
        let sampler = Sampler::new(settings.search_seed as u64);
        let alone = chain.parts().iter().any(|p| p.ocp().is_simulated());
        let follows = chain.parts().iter().all(|p| p.ocp().u_guess.is_none());
        let thresholds = chain.parts().iter().map(|p| Thresholds::of(&p.ocp().system)).collect();
        Simulations { chain, settings, last, controls, alone, follows, sampler, best: None, thresholds }
    }

    fn candidate(&mut self, controls: &[[Vec<f64>; 2]]) -> Result<Proposal> {
        let z = self.chain.place(controls)?;
        Ok(Candidate::new(z.iter().map(|v| v.to_bits()).collect(), Rc::new(z)))
    }

    /// Steps of every problem so far.
    fn steps(&self) -> Vec<usize> {
        self.chain.steps().map(|s| s.1).collect()
    }

    /// Controls that lead along states of the guess, or to such as meet the terminal constraints, where there are some.
    fn following(&mut self, budget: &mut Budget) -> Result<Option<Proposal>> {
        let only = std::mem::take(&mut self.follows) && self.chain.parts().len() == 1;
        let Some(part) = self.chain.parts().first().filter(|_| only) else { return Ok(None) };
        let ocp = part.ocp();
        let u = ocp.driven(part.usual()).unwrap_or_else(|| ocp.within_bounds(ocp.control_guess()));
        let way = ocp.way(&stage_times(0.0, &ocp.durations)[1..]);
        let before = self.steps();
        let z = self.chain.place(&[constant(u)])?;
        let found = self.chain.track(z, &way)?;
        self.count(&before, budget);
        Ok(found.map(|z| Candidate::new(z.iter().map(|v| v.to_bits()).collect(), Rc::new(z))))
    }

    /// How far a simulation is from the constraints, and its cost; `None` where it fails.
    fn place(&mut self, z: &Start, budget: &mut Budget) -> Result<Option<[f64; 2]>> {
        let before = self.steps();
        let values = self.chain.plain_at(z)?;
        self.count(&before, budget);
        Ok(values.map(|v| [missed(&self.chain, &v), v.cost]))
    }

    /// May a descent from here lead to less than the best one? Not where its start was no further from the constraints and no dearer.
    fn promises(&self, place: &[f64; 2]) -> bool {
        !self.alone || self.best.as_ref().is_none_or(|b| place[0] < b.start[0] || place[1] < b.start[1])
    }

    /// The next controls that are tried without a search.
    fn next_controls(&mut self, budget: &mut Budget) -> Result<Option<Proposal>> {
        if let Some(found) = self.following(budget)? {
            return Ok(Some(found));
        }
        while let Some(controls) = self.controls.pop() {
            let candidate = self.candidate(&controls)?;
            let place = self.place(&candidate.motion, budget)?;
            // what cannot be simulated leads nowhere
            if place.is_some_and(|p| self.promises(&p)) {
                return Ok(Some(candidate));
            }
        }
        Ok(None)
    }

    /// Counts the steps since there were `before`.
    fn count(&self, before: &[usize], budget: &mut Budget) {
        count(&self.chain, before, budget);
    }

    /// Random controls that promise something, those first whose simulations miss the constraints least and cost least.
    fn samples(&mut self, budget: &mut Budget) -> Result<Vec<Proposal>> {
        let mut found: Vec<([f64; 2], Proposal)> = Vec::new();
        for drawn in 0..self.settings.search_samples {
            if stop::requested().is_some() {
                break;
            }
            // the guess and the best in turn
            let best = self.best.as_ref().filter(|_| drawn % 2 == 0);
            let sampler = &mut self.sampler;
            let draw = |p: &Shooting| {
                let o = p.ocp();
                let [known, _] = best.map_or_else(|| constant(o.control_guess()), |b| p.user_controls(&b.z));
                constant(o.within_bounds(sampler.draw(o.n_stages, &o.control_ranges(), &known)))
            };
            let controls: Vec<[Vec<f64>; 2]> = self.chain.parts().iter().map(draw).collect();
            let candidate = self.candidate(&controls)?;
            let Some(place) = self.place(&candidate.motion, budget)? else { continue };
            found.push((place, candidate));
        }
        found.retain(|(place, _)| self.promises(place));
        found.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        Ok(found.into_iter().map(|f| f.1).collect())
    }
}

/// The variables with the controls of one stage behind one of these thresholds, and which one it is.
fn passed(part: &Shooting, thresholds: &Thresholds, z: &[f64]) -> Vec<(usize, Vec<f64>)> {
    let ocp = part.ocp();
    let d = ocp.system.dims();
    if thresholds.count() == 0 || (0..d.u).any(|j| part.is_linear(j)) {
        return Vec::new();
    }
    let [controls, _] = part.user_controls(z);
    let sizes: Vec<f64> = ocp.control_ranges().iter().map(|[l, u]| 0.5 * (u - l)).collect();
    let x = vec![0.0; d.x];
    let mut found = Vec::new();
    for (k, t) in stage_times(ocp.t0, &ocp.durations)[..ocp.n_stages].iter().enumerate() {
        let (u, [lower, upper]) = (&controls[k * d.u..(k + 1) * d.u], ocp.control_bounds(k));
        let at = Point { t: *t, x: &x, u, p: ocp.params_of(k) };
        for (kind, next) in thresholds.passed(&at, &sizes).into_iter().enumerate() {
            let allowed = |u: &Vec<f64>| u.iter().zip(lower.iter().zip(upper)).all(|(u, (l, h))| l <= u && u <= h);
            found.extend(next.filter(allowed).map(|u| (kind, part.with_controls(z, k, &u))));
        }
    }
    found
}

/// Counts the steps of every problem since there were `before`.
pub(super) fn count(chain: &Chain, before: &[usize], budget: &mut Budget) {
    chain.steps().zip(before).for_each(|((nx, steps), before)| budget.simulated(nx, steps - before));
}

/// The largest violation of a constraint in units of what states and controls of their sizes change it by, none where it is within [`MET`].
fn missed(program: &dyn Program, v: &Values) -> f64 {
    let (lower, upper) = program.row_bounds();
    let of = |i: usize| descent::missed(v, [lower, upper], i);
    (0..v.rows.len()).map(of).filter(|m| *m > MET).fold(0.0, f64::max)
}

impl Space for Simulations<'_> {
    /// The bits of the variables: where a descent begins says where it ends.
    type Sequence = Vec<u64>;
    type Motion = Start;
    type Solution = Lowest;

    fn propose(
        &mut self,
        source: Source,
        _: Option<&Lowest>,
        budget: &mut Budget,
        _: &mut Control,
    ) -> Result<Vec<Proposal>> {
        Ok(match source {
            Source::Guess => match self.last.take() {
                Some(last) => {
                    let known: Vec<_> = last.iter().map(|r| [r.controls.clone(), r.control_ends.clone()]).collect();
                    vec![self.candidate(&known)?]
                }
                None => Vec::new(),
            },
            Source::Simulation => self.next_controls(budget)?.into_iter().collect(),
            Source::Samples if self.sampler.begin_round() => self.samples(budget)?,
            _ => Vec::new(),
        })
    }

    fn solve(
        &mut self,
        candidate: &Proposal,
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Vec<u64>, Lowest)>> {
        let before = self.steps();
        let mut watch = EarlyTermination::new(limits.cost, Patience::usual(limits.patience), MET);
        // where nothing has a solution yet there is nothing better to do
        let mut given_up = |i: &IterationInfo| limits.cost.is_finite() && watch.should_stop(i);
        let mut found = descend(&mut self.chain, &candidate.motion, EVALUATIONS, &mut given_up, control)?;
        // the first one that nearly meets the constraints goes on until it does: the others are compared with it
        for _ in 0..AGAIN {
            let Some(nearly) = found.as_mut().filter(|f| f.violation > MET && f.violation <= NEARLY) else { break };
            if self.best.is_some() {
                break;
            }
            let start = restore(&mut self.chain, &nearly.z)?.unwrap_or_else(|| nearly.z.clone());
            let Some(mut next) = descend(&mut self.chain, &start, EVALUATIONS, &mut given_up, control)? else { break };
            next.evaluations += nearly.evaluations;
            let gained = next.violation < 0.5 * nearly.violation;
            *nearly = next;
            if !gained {
                break;
            }
        }
        self.count(&before, budget);
        budget.stats.iterations += found.as_ref().map_or(1, |f| f.evaluations);
        budget.stats.evaluations += found.as_ref().map_or(1, |f| f.evaluations);
        let better = |f: &&Lowest| f.violation <= MET && self.best.as_ref().is_none_or(|b| f.cost < b.cost);
        if let Some((cost, z)) = found.as_ref().filter(better).map(|f| (f.cost, f.z.clone())) {
            self.best = self.place(&candidate.motion, budget)?.map(|start| Best { cost, z, start });
        }
        Ok(found.map(|f| (candidate.sequence.clone(), f)).into_iter().collect())
    }

    /// A control on the border between two modes is in neither.
    fn verify(&mut self, s: &mut Lowest, _: &mut Budget, _: &mut Control) -> Result<()> {
        if self.thresholds.iter().all(|t| t.count() == 0) {
            return Ok(());
        }
        let motions = self.chain.traced(&s.z, 0.0)?.0;
        for (part, Motion { run, .. }) in self.chain.parts().iter().zip(motions) {
            let (ocp, first) = (part.ocp(), part.n_front());
            let (params, [controls, _]) = (part.all_params(&s.z), part.user_controls(&s.z));
            let (Some(path), mut whole) = (run.path, vec![0.0; run.x.len()]) else { continue };
            let mut starts = Vec::with_capacity(ocp.n_stages);
            for t in &stage_times(ocp.t0, &part.durations(&s.z))[..ocp.n_stages] {
                path.eval(t.min(run.t), 0, &mut whole)?;
                starts.push((*t, whole[first..].to_vec()));
            }
            let own = Controlled { controls: &controls, params: &params[..ocp.system.dims().p], starts };
            s.contradicted |= ocp.choice_of(&own)?.is_some_and(|c| c.doubt.is_some());
        }
        Ok(())
    }

    fn rank(&self, s: &Lowest) -> Rank {
        Rank {
            feasible: s.violation <= MET,
            contradicted: s.contradicted,
            cost: s.cost,
            violation: s.violation,
            idle: 0,
            rounding: f64::EPSILON * s.before.abs().max(s.cost.abs()),
        }
    }

    /// Controls a stage earlier or later: events that no descent moves from one stage to another are in the next one then. Behind every threshold that
    /// the controls of a stage have.
    fn neighbours(&self, s: &Lowest) -> (Vec<Neighbour<Vec<u64>>>, Start) {
        let mut found = Vec::new();
        let mut add = |z: Vec<f64>, kind: usize, is_local: bool| {
            let sequence = z.iter().map(|v| v.to_bits()).collect();
            found.push(Neighbour { sequence, promise: 0.0, kind, is_local });
        };
        for (part, thresholds) in self.chain.parts().iter().zip(&self.thresholds) {
            add(part.shifted(&s.z, true), EARLIER, true);
            add(part.shifted(&s.z, false), LATER, true);
            for (kind, z) in passed(part, thresholds, &s.z) {
                add(z, PASSED + kind, false);
            }
        }
        (found, Rc::new(s.z.clone()))
    }

    fn moved(&self, _: &Lowest, _: &Start, to: &Vec<u64>) -> Start {
        Rc::new(to.iter().map(|v| f64::from_bits(*v)).collect())
    }
}

/// A descent whose steps are reported, unless `watch` gives it up; nothing where it does not begin. Its simulations count as iterations of the call.
pub(super) fn descend(
    program: &mut dyn Program,
    z: &[f64],
    evaluations: usize,
    watch: GiveUp,
    control: &mut Control,
) -> Result<Option<Lowest>> {
    if allowance::is_over() {
        return Ok(None);
    }
    let mut goes_on = true;
    let mut told = |i: &IterationInfo| {
        goes_on = control.monitor.as_mut().is_none_or(|f| f(i));
        !goes_on || watch(i)
    };
    let found = minimise(program, z, evaluations.min(allowance::left()), &mut told)?;
    allowance::spend(found.as_ref().map_or(1, |f| f.evaluations));
    if goes_on {
        Ok(found)
    } else {
        Err(Error::Interrupted)
    }
}

/// How a descent ended that meets no constraint: whether no direction leads to less violation.
pub(super) fn failure(s: &Lowest) -> Outcome {
    match s.stationary {
        true => Outcome::LocallyInfeasible,
        false => Outcome::Stalled,
    }
}
