//! What is searched where simulations are all there is: controls that descents begin with.

use std::rc::Rc;

use crate::error::{Error, Result};
use crate::nlp::{Control, IterationInfo, Outcome};
use crate::ocp::descent::{self, minimise, Lowest, Program, Shooting, Values};
use crate::ocp::{transitions, Ocp, OcpResult};
use crate::search::{Budget, Candidate, Limits, Neighbour, Rank, Sampler, Source, Space};
use crate::stop;

/// Simulations of the horizon of one descent at most.
const EVALUATIONS: usize = 80;
/// Violation of a constraint, relative to what the variables change it by, that counts as none.
pub(super) const MET: f64 = 1e-6;

/// Variables of a descent.
type Start = Rc<Vec<f64>>;

/// Controls, with lengths, parameters and initial states that are free.
pub(super) struct Simulations<'a> {
    ocp: &'a Ocp,
    shooting: Shooting<'a>,
    /// An answer of before.
    last: Option<&'a OcpResult>,
    /// Controls that are tried without a search, those that come first last.
    controls: Vec<Vec<f64>>,
    sampler: Sampler,
}

impl<'a> Simulations<'a> {
    pub fn new(ocp: &'a Ocp, shooting: Shooting<'a>, last: Option<&'a OcpResult>) -> Simulations<'a> {
        let mut controls = transitions::extremes(ocp);
        controls.reverse();
        let sampler = Sampler::new(ocp.settings.search_seed as u64);
        Simulations { ocp, shooting, last, controls, sampler }
    }

    fn candidate(&self, controls: (&[f64], &[f64])) -> Candidate<Vec<u64>, Start> {
        let z = self.shooting.place_fresh(controls);
        Candidate::new(z.iter().map(|v| v.to_bits()).collect(), Rc::new(z))
    }

    /// Counts the steps since there were `before`.
    fn count(&self, before: usize, budget: &mut Budget) {
        budget.simulated(self.ocp.system.dims().x, self.shooting.steps - before);
    }

    /// Random controls, those first whose simulations miss the constraints least and cost least.
    fn samples(&mut self, budget: &mut Budget) -> Result<Vec<Candidate<Vec<u64>, Start>>> {
        let ranges = self.ocp.control_ranges();
        let known = self.ocp.control_guess();
        let mut found: Vec<(f64, f64, Candidate<Vec<u64>, Start>)> = Vec::new();
        for _ in 0..self.ocp.settings.search_samples {
            if stop::requested().is_some() {
                break;
            }
            let u = self.ocp.within_bounds(self.sampler.draw(self.ocp.n_stages, &ranges, &known));
            let candidate = self.candidate((&u, &u));
            let before = self.shooting.steps;
            let values = self.shooting.values_at(&candidate.motion)?;
            self.count(before, budget);
            // what cannot be simulated leads nowhere
            let Some(v) = values else { continue };
            found.push((missed(&self.shooting, &v), v.cost, candidate));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        Ok(found.into_iter().map(|f| f.2).collect())
    }
}

/// The largest violation of a constraint in units of what states and controls of their sizes change it by, none where it is within [`MET`].
fn missed(shooting: &Shooting, v: &Values) -> f64 {
    let (lower, upper) = shooting.row_bounds();
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
    ) -> Result<Vec<Candidate<Vec<u64>, Start>>> {
        Ok(match source {
            Source::Guess => {
                self.last.take().map(|r| self.candidate((&r.controls, &r.control_ends))).into_iter().collect()
            }
            Source::Simulation => self.controls.pop().map(|u| self.candidate((&u, &u))).into_iter().collect(),
            Source::Samples if self.sampler.begin_round() => self.samples(budget)?,
            _ => Vec::new(),
        })
    }

    fn solve(
        &mut self,
        candidate: &Candidate<Vec<u64>, Start>,
        _: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Vec<u64>, Lowest)>> {
        let before = self.shooting.steps;
        let found = descend(&mut self.shooting, &candidate.motion, EVALUATIONS, control)?;
        self.count(before, budget);
        budget.stats.iterations += found.as_ref().map_or(1, |f| f.evaluations);
        budget.stats.evaluations += found.as_ref().map_or(1, |f| f.evaluations);
        Ok(found.map(|f| (candidate.sequence.clone(), f)).into_iter().collect())
    }

    fn rank(&self, s: &Lowest) -> Rank {
        Rank {
            feasible: s.violation <= MET,
            contradicted: false,
            cost: s.cost,
            violation: s.violation,
            idle: 0,
            rounding: f64::EPSILON * s.before.abs().max(s.cost.abs()),
        }
    }

    fn neighbours(&self, s: &Lowest) -> (Vec<Neighbour<Vec<u64>>>, Start) {
        (Vec::new(), Rc::new(s.z.clone()))
    }
}

/// A descent that is reported; nothing where it does not begin.
pub(super) fn descend(
    shooting: &mut Shooting,
    z: &[f64],
    evaluations: usize,
    control: &mut Control,
) -> Result<Option<Lowest>> {
    let found = minimise(shooting, z, evaluations)?;
    if let (Some(f), Some(monitor)) = (&found, control.monitor.as_mut()) {
        let told = IterationInfo { iter: f.evaluations, objective: f.cost, inf_pr: f.violation, ..Default::default() };
        if !monitor(&told) {
            return Err(Error::Interrupted);
        }
    }
    Ok(found)
}

/// How a descent ended that meets no constraint: whether no direction leads to less violation.
pub(super) fn failure(s: &Lowest) -> Outcome {
    match s.stationary {
        true => Outcome::LocallyInfeasible,
        false => Outcome::Stalled,
    }
}
