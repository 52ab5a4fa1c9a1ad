//! The end of a descent in the user's terms: controls, the motion that a simulation of them is, its events.

use super::derivatives::gradient;
use super::judged;
use super::space::{failure, MET};
use crate::error::{Error, Result};
use crate::event;
use crate::fesd::{Element, Switch, SwitchKind, Trajectory};
use crate::mpcc::Polish;
use crate::nlp::{Outcome, Residuals};
use crate::ocp::descent::{missed, violation, Chain, Lowest, Motion, Program, Shooting, Values};
use crate::ocp::request::{Comparison, Request};
use crate::ocp::{stage_times, Adaptation, Contacts, Ocp, OcpResult, Round};
use crate::tableau::{Family, Tableau};

/// Points of an element of the motion that is reported: those of Radau's method, whose order dense output has.
const POINTS: usize = 3;
/// Share of an element by which its start is looked at behind an event there.
const BEHIND: f64 = 1e-9;

/// Distance of a transition from the end of a stage, as a share of the stage, at which it is there.
const AT_END: f64 = 1e-6;

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

/// The end of a descent on problems one behind the other.
pub(super) struct End {
    /// A simulation of every problem.
    pub motions: Vec<Motion>,
    /// The gradient of the Lagrange function.
    pub gradient: Vec<f64>,
    /// What constraint is missed by how much; empty where all are met.
    pub missed: String,
    /// The largest violation of a link.
    pub link_violation: f64,
    /// Variables, rows, pairs.
    pub dimensions: (usize, usize, usize),
}

impl End {
    pub fn new(chain: &mut Chain, lowest: &Lowest) -> Result<End> {
        let (motions, values) = chain.traced(&lowest.z, AT_END)?;
        let Some(values) = values else {
            let why = motions.iter().map(|m| &m.run.reason[..]).find(|r| !r.is_empty());
            let why = why.unwrap_or("the end is not reached");
            return Err(Error::Numeric(format!("the answer of a descent is simulated no more: {why}")));
        };
        let (lower, upper) = chain.row_bounds();
        let of_link = |i: usize| violation(&values, [lower, upper], i);
        Ok(End {
            link_violation: chain.rows_between().map(of_link).fold(0.0, f64::max),
            missed: if lowest.violation <= MET { String::new() } else { missed_text(chain, &values) },
            dimensions: (lowest.z.len(), lower.len(), 0),
            gradient: gradient(chain, lowest)?,
            motions,
        })
    }
}

/// What constraint is missed by how much.
fn missed_text(chain: &Chain, v: &Values) -> String {
    let (lower, upper) = chain.row_bounds();
    let share = |i: usize| missed(v, [lower, upper], i);
    let worst = (0..v.rows.len()).max_by(|a, b| share(*a).total_cmp(&share(*b)));
    let Some(i) = worst else { return String::new() };
    format!(
        "no controls were found whose simulation meets the constraints; those that come closest miss {} by {:.3e}: its value is {:.6e}, its \
         bounds are {} and {}",
        chain.row_name(i),
        violation(v, [lower, upper], i),
        v.rows[i],
        lower[i],
        upper[i]
    )
}

/// What one of the problems has of the end of a descent.
pub(super) struct Own<'a> {
    pub shooting: &'a Shooting<'a>,
    pub gradient: &'a [f64],
    /// Are all constraints met?
    pub solved: bool,
}

/// A switch of a simulation, with the element that begins there.
fn switch(s: &event::Switch, elements: &[Element]) -> Switch {
    let kind = match s.kind {
        event::Kind::Cross => SwitchKind::Cross,
        event::Kind::Enter => SwitchKind::Enter,
        event::Kind::Leave | event::Kind::Spontaneous => SwitchKind::Leave,
    };
    let element = elements.partition_point(|e| e.t + 0.5 * e.h < s.t);
    Switch { t: s.t, element, subsystem: s.subsystem, kind, before: s.before.clone(), after: s.after.clone() }
}

/// The modes of an element. Their weights are not known where several are active.
fn put_modes(e: &mut Element, counts: &[usize], all: &[bool]) {
    let n: usize = counts.iter().sum();
    let mut first = 0;
    e.active = all.get(..n).map_or_else(|| vec![false; n], <[bool]>::to_vec);
    let mut weights = Vec::with_capacity(e.active.len());
    for n in counts {
        let own = &e.active[first..first + n];
        let alone = own.iter().filter(|a| **a).count() == 1;
        weights.extend(own.iter().map(|a| match a {
            true if alone => 1.0,
            true => f64::NAN,
            false => 0.0,
        }));
        first += n;
    }
    e.theta = weights.repeat(POINTS);
}

impl Ocp {
    /// The result of a descent.
    pub(super) fn simulated_result(
        &self,
        own: &Own,
        lowest: &Lowest,
        motion: Motion,
        request: &Request,
    ) -> Result<OcpResult> {
        let &Own { shooting, gradient, solved } = own;
        let d = self.system.dims();
        let (params, controls) = (shooting.all_params(&lowest.z), shooting.all_controls(&lowest.z));
        let mut r = OcpResult {
            outcome: if solved { Outcome::Solved } else { failure(lowest) },
            polish: if solved { Polish::Done } else { Polish::None },
            message: String::new(),
            cost: f64::NAN,
            cost_reached: f64::NAN,
            priced: motion.cost,
            controls: Vec::new(),
            control_ends: Vec::new(),
            durations: self.durations.clone(),
            params: if self.stage_params.is_some() { self.params_of(0).to_vec() } else { params[..d.p].to_vec() },
            violation: 0.0,
            trajectory: Trajectory::of_elements(&Tableau::new(Family::RadauIia, POINTS)?, d.x, Vec::new()),
            residuals: Residuals { primal: lowest.violation, ..Residuals::default() },
            certificate: Default::default(),
            stats: Default::default(),
            time_build: 0.0,
            dimensions: (0, 0, 0),
            accuracy: None,
            optimality: None,
            undefined: false,
            ended: None,
            adaptation: None,
            jumps: Vec::new(),
            phases: Vec::new(),
            contacts: None,
        };
        shooting.tell(&lowest.z, &mut r);
        let (violated, penalty) = self.relaxation(shooting.extended(), &params, &controls, &r.durations);
        (r.violation, r.cost_reached) = (violated, motion.cost - penalty);
        if solved {
            r.cost = r.cost_reached;
        }
        let beside = self.write_motion(motion, shooting.n_front(), &mut r)?;
        r.residuals.dual = lowest.left;
        if let (Some(c), true) = (request.comparison, solved) {
            // where modes are those of the state the motion has to go on from there by itself
            let c = Comparison { by_stage: c.by_stage || !shooting.goes_on(), ..c };
            let found = self.compare_motion(&r, &beside, c, &request.options)?;
            let other = found.contradicts(self.cost_size(r.priced));
            r.accuracy = Some(found);
            r.optimality = Some(judged(lowest, other, shooting.own_controls(gradient)));
            r.adaptation = self.simulated_adaptation(&r);
        }
        Ok(r)
    }

    /// The motion of a simulation, whose states stand behind `first` others, and its transitions; of every stage with an event at its end the
    /// state on the other side of that.
    fn write_motion(
        &self,
        Motion { run, phases, behind, .. }: Motion,
        first: usize,
        r: &mut OcpResult,
    ) -> Result<Vec<Option<Vec<f64>>>> {
        let path = run.path.as_ref().ok_or_else(|| Error::Internal("a simulation without output".into()))?;
        let tableau = r.trajectory.tableau().clone();
        let nx = self.system.dims().x;
        let mut events: Vec<f64> = run.jumps.iter().map(|j| j.t).collect();
        events.extend(run.impacts.iter().map(|i| i.t));
        events.extend(run.switches.iter().map(|s| s.t));
        events.extend(run.phases.iter().map(|p| p.t));
        events.sort_by(f64::total_cmp);
        let n_fe = self.n_fe.iter().copied().chain(std::iter::repeat(self.settings.n_fe as usize));
        let mut whole = vec![0.0; run.x.len()];
        let mut state = |t: f64| -> Result<Vec<f64>> {
            path.eval(t.min(run.t), 0, &mut whole)?;
            Ok(whole[first..first + nx].to_vec())
        };
        let (mut start, mut beside) = (self.t0, Vec::with_capacity(self.n_stages));
        for ((stage, length), n_fe) in r.durations.iter().enumerate().zip(n_fe) {
            let end = start + length;
            let inside = |t: &f64| *t > start + BEHIND * length && *t < end - BEHIND * length;
            let mut cuts: Vec<f64> = std::iter::once(start).chain(events.iter().copied().filter(inside)).collect();
            cuts.push(end);
            cuts.dedup_by(|b, a| *b - *a <= BEHIND * length);
            for w in cuts.windows(2) {
                let n = (n_fe as f64 * (w[1] - w[0]) / length).ceil().max(1.0);
                for i in 0..n as usize {
                    let (t, h) = (w[0] + (w[1] - w[0]) * i as f64 / n, (w[1] - w[0]) / n);
                    let mut x0 = state(if i == 0 { t + BEHIND * h } else { t })?;
                    if i == 0 {
                        // from behind an event back to it, along the tangent
                        let next = state(t + 2.0 * BEHIND * h)?;
                        x0.iter_mut().zip(next).for_each(|(x, next)| *x -= next - *x);
                    }
                    let mut xs = Vec::with_capacity(POINTS * nx);
                    for c in &tableau.c {
                        xs.extend(state(t + c * h)?);
                    }
                    r.trajectory.elements.push(Element::of_states(&tableau, stage, (t, h), x0, xs));
                }
            }
            let near = |t: &&f64| (*t - end).abs() <= AT_END * length;
            beside.push(match events.iter().find(near) {
                Some(t) if *t >= end && end < run.t => Some(state(end + AT_END * length)?),
                Some(t) if *t >= end => Some(run.x[first..first + nx].to_vec()),
                Some(t) => Some(state(*t)?),
                None if end >= run.t => behind.as_ref().map(|x| x[first..first + nx].to_vec()),
                None => None,
            });
            start = end;
        }
        r.phases = phases;
        let n_switching = self.system.n_switching();
        r.trajectory.modes = self.system.mode_counts()[..n_switching].to_vec();
        let switches = run.switches.iter().filter(|s| s.subsystem < n_switching);
        r.trajectory.switches = switches.map(|s| switch(s, &r.trajectory.elements)).collect();
        for e in &mut r.trajectory.elements {
            let last = r.phases.iter().rfind(|p| p.0 <= e.t - self.t0 + 0.5 * e.h);
            put_modes(e, &r.trajectory.modes, last.map_or(&[], |p| &p.1));
        }
        let ends = &stage_times(self.t0, &r.durations)[1..];
        let stage_of = |t: f64| ends.iter().take_while(|e| **e < t).count().min(self.n_stages - 1);
        r.jumps = run
            .jumps
            .iter()
            .map(|j| JumpMade {
                t: j.t,
                transition: j.transition,
                stage: stage_of(j.t),
                at_once: j.rate.is_nan(),
                before: j.before[first..first + nx].to_vec(),
                after: j.after[first..first + nx].to_vec(),
            })
            .collect();
        if run.mechanics.is_some() {
            r.contacts = Some(Contacts::of_run(run, ends));
        }
        Ok(beside)
    }

    /// Is the grid fine enough? There is none: states are simulated.
    fn simulated_adaptation(&self, r: &OcpResult) -> Option<Adaptation> {
        if self.settings.adapt_tol <= 0.0 {
            return None;
        }
        let round = Round {
            elements: vec![1; self.n_stages],
            n_variables: r.dimensions.0,
            error: r.error(),
            cost: r.cost_reached,
            exact: r.is_exact(),
            iterations: 0,
        };
        let reached = round.error <= self.settings.adapt_tol;
        Some(Adaptation { rounds: vec![round], kept: 0, reached })
    }
}
