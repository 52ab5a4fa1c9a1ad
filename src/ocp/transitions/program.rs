//! The program of a sequence of transitions: its legs as one program, tied by continuity or reset maps, by common controls and
//! parameters, and by the lengths of the control stages.

use super::automaton::{Automaton, Passage};
use super::guess::Guess;
use super::legs::{knows_time, Leg};
use crate::error::{Error, Result};
use crate::fesd::{Durations, Exit, Sizes};
use crate::func::Dims;
use crate::mpcc::{MpccSolver, Side, Solution};
use crate::nlp::{Bounds, Control, Outcome};
use crate::ocp::extend::Slacks;
use crate::ocp::guess::interpolate;
use crate::ocp::joint::{self, Coupling, Plan, Source};
use crate::ocp::request::Request;
use crate::ocp::solve::{Built, Start};
use crate::ocp::terms::{Places, Stack};
use crate::ocp::{JumpMade, Ocp, OcpResult};
use crate::system::combination;

/// The program, built.
pub(super) struct Program<'a> {
    pub whole: &'a Ocp,
    pub automaton: &'a Automaton,
    pub legs: Vec<Leg>,
    pub built: Vec<Box<Built>>,
    /// First variables of the legs.
    pub first: Vec<usize>,
    /// Parameters of every stage of every leg, references and slacks included.
    pub params: Vec<Vec<f64>>,
}

/// The legs as one program, and its solver.
pub(super) struct Assembled {
    pub plan: Plan,
    pub solver: MpccSolver,
    pub bounds: Bounds,
}

/// What a program ended at: in the user's terms, as a point of the program, and what ends sliding modes in every leg there.
pub(super) struct Solved {
    pub result: OcpResult,
    pub solution: Solution,
    pub exits: Vec<Exit>,
}

impl<'a> Program<'a> {
    /// Discretises the legs of a complete sequence.
    pub fn new(
        whole: &'a Ocp,
        automaton: &'a Automaton,
        sequence: &[Passage],
        guess: &Guess,
        sizes: &Sizes,
        request: &Request,
    ) -> Result<Program<'a>> {
        let mut legs = Leg::all(whole, automaton, sequence, guess)?;
        let far = legs.len() > 1 && whole.boundary.iter().any(|b| knows_time(b.f.as_ref()));
        if let (true, Some(last)) = (far, legs.last_mut()) {
            last.tell_time();
        }
        let (mut built, mut params) = (Vec::new(), Vec::new());
        for leg in &mut legs {
            leg.ocp.build(Start::Cold, &request.options)?;
            let mut b = leg.ocp.built.take().ok_or_else(|| Error::Internal("a leg was not built".into()))?;
            params.push(leg.ocp.prepare(&mut b)?);
            b.set_sizes(sizes);
            // the modes that are given are not to be left
            b.identifier.restart(leg.ocp.modes.is_none() || request.search > 0, request.search);
            b.problem.forget_trouble();
            let exit = b.problem.usual_exit();
            b.problem.set_exit(exit);
            built.push(b);
        }
        let first = Plan::first_variables(&built);
        Ok(Program { whole, automaton, legs, built, first, params })
    }

    /// What ties the legs together; constraints between both ends are the last ones.
    pub fn couplings(&self) -> Vec<Coupling> {
        let ties = (1..self.legs.len()).flat_map(|j| self.ties(j));
        ties.chain(self.lengths_of_stages()).chain(self.ends()).collect()
    }

    /// The legs as one program with a solver.
    pub fn assemble(&mut self, request: &Request) -> Result<Assembled> {
        let mut plan = Plan::coupled(&self.built, self.couplings());
        let solver = MpccSolver::new(&mut self.joint(&mut plan), request.options.solver)?;
        let bounds = self.bounds(&plan);
        Ok(Assembled { plan, solver, bounds })
    }

    /// The legs as one program.
    pub fn joint<'b>(&'b mut self, plan: &'b mut Plan) -> joint::Program<'b> {
        joint::Program { parts: self.built.iter_mut().map(|b| &mut b.problem).collect(), plan }
    }

    /// Solves it from the guess its legs carry.
    pub fn solve(mut self, request: &Request, control: &mut Control) -> Result<Solved> {
        let Assembled { mut plan, mut solver, bounds } = self.assemble(request)?;
        let mut start = Vec::with_capacity(plan.n());
        for (k, leg) in self.legs.iter().enumerate() {
            let b = &mut self.built[k];
            let options = &request.options;
            start.extend(leg.ocp.starting_point(&mut b.problem, &b.extended, &self.params[k], options, control)?.0);
        }
        let sides = self.given_sides(&plan, &mut start);
        let begin = joint::Begin { at: &start, sides: sides.as_deref() };
        joint::solve(&mut plan, &mut solver, &mut self.built, &bounds, begin, control);
        let dimensions = (plan.n(), plan.m, plan.pairs.len());
        let solution = solver.solution().clone();
        let exits = self.built.iter().map(|b| b.problem.exit()).collect();
        Ok(Solved { result: self.read(&plan, &solution, dimensions)?, solution, exits })
    }

    /// Sides of the modes that are given, where they are and fit the grid; the start is made to fit them.
    fn given_sides(&mut self, plan: &Plan, start: &mut [f64]) -> Option<Vec<Side>> {
        let mut all = Vec::new();
        for (k, leg) in self.legs.iter().enumerate() {
            let (b, modes) = (&mut self.built[k], leg.ocp.modes.as_ref()?);
            let own = &mut start[plan.variables[k]..plan.variables[k + 1]];
            let members: Vec<Side> = b.problem.member_sides(own).collect();
            let n_fe = b.n_fe().to_vec();
            let p = &mut b.problem;
            if p.detects_switches() {
                let (sides, lengths) = modes.on_grid(p.spec().dcs.form(), &leg.ocp.durations, &n_fe).ok()?;
                let (times, states) = leg.ocp.x_guess.as_ref()?;
                p.guess_active_set(own, leg.ocp.t0, &lengths, &sides, |t, x| interpolate(times, states, t, x));
                all.extend(sides);
            }
            all.extend(members);
        }
        Some(all)
    }

    /// The inputs `(u, p, t)` of functions at the end of leg `k`.
    fn inputs_at_end(&self, k: usize) -> Vec<Source> {
        let (b, first, leg) = (&self.built[k], self.first[k], &self.legs[k]);
        let p = &b.problem;
        let d = self.whole.system.dims();
        let end = first + p.end_place();
        let last = leg.ocp.n_stages - 1;
        let mut ramps = p.ramps().into_iter();
        let u = first + p.places().1[last];
        let mut out: Vec<Source> = Vec::new();
        for j in 0..d.u {
            let ramp = if self.whole.linear[j] { ramps.next() } else { None };
            out.push(Source::Variable(ramp.map_or(u + j, |r| end + r)));
        }
        let values = leg.ocp.params_of(last);
        for (j, value) in values.iter().enumerate().take(d.p) {
            let place = p.param_places().get(j).copied().flatten();
            out.push(place.map_or(Source::Constant(*value), |v| Source::Variable(first + v)));
        }
        let nominal = leg.ocp.t0 + leg.ocp.horizon;
        out.push(p.spec().dcs.clock().map_or(Source::Constant(nominal), |c| Source::Variable(end + c)));
        out
    }

    /// What ties leg `j` to the one before.
    fn ties(&self, j: usize) -> Vec<Coupling> {
        let d = self.whole.system.dims();
        let (a, b) = (&self.built[j - 1].problem, &self.built[j].problem);
        let (end, start) = (self.first[j - 1] + a.end_place(), self.first[j] + b.places().0);
        let mut out = Vec::new();
        let mut equal: Vec<(usize, usize)> = Vec::new();
        let reset = self.legs[j].begins.and_then(|p| self.automaton.transitions[p.transition].reset.clone());
        let is_discrete = |i: &usize| self.automaton.states.contains(i);
        match reset {
            None => equal.extend((0..d.x).filter(|i| !is_discrete(i)).map(|i| (end + i, start + i))),
            Some(r) => {
                let r = r.whole();
                // r(x, u, p, t) - x behind; discrete states have their values
                let both = Dims { x: 2 * d.x, ..d };
                let columns = Places { x: 0, u: 2 * d.x, p: 2 * d.x + d.u }.columns(d, both);
                let minus = combination("behind", both, (0..d.x).map(|i| vec![(d.x + i, -1.0)]).collect());
                let f = Stack::sum(r.name(), both, vec![Stack::gather(&r, both, columns), minus]);
                let states = (0..d.x).map(|i| end + i).chain((0..d.x).map(|i| start + i)).map(Source::Variable);
                let inputs = states.chain(self.inputs_at_end(j - 1)).collect();
                let bound = |v: f64| (0..d.x).map(|i| if is_discrete(&i) { v } else { 0.0 }).collect();
                out.push(Coupling { f, inputs, lower: bound(f64::NEG_INFINITY), upper: bound(f64::INFINITY) });
            }
        }
        equal.extend(a.ramps().into_iter().zip(b.ramps()).map(|(r, s)| (end + r, start + s)));
        for (v, w) in a.param_places().iter().zip(b.param_places()).take(d.p) {
            equal.extend(v.zip(*w).map(|(v, w)| (self.first[j - 1] + v, self.first[j] + w)));
        }
        equal.extend(self.common_slacks(j - 1).into_iter().zip(self.common_slacks(j)));
        if self.shares_stage(j) {
            let (u, v) = (a.places().1, b.places().1);
            let u = self.first[j - 1] + u[u.len() - 1];
            let v = self.first[j] + v[0];
            // slacks of the stage too: it has one price
            equal.extend((0..self.built[j].extended.system.dims().u).map(|i| (u + i, v + i)));
        }
        if !equal.is_empty() {
            let rows = equal.iter().map(|&(v, w)| vec![(v, -1.0), (w, 1.0)]).collect();
            out.push(linear("continuity", rows, &[0.0; 2]));
        }
        out
    }

    /// Variables of leg `k` that are slacks along the horizon, in the order of the constraints: all legs have the same.
    fn common_slacks(&self, k: usize) -> Vec<usize> {
        let (o, b) = (&self.legs[k].ocp, &self.built[k]);
        let of = o.soft.iter().zip(&b.extended.slacks).filter(|(s, _)| s.at.is_some());
        let params = of.flat_map(|(_, at)| if let Slacks::Params(r) = at { r.clone() } else { 0..0 });
        params.filter_map(|j| b.problem.param_places()[j]).map(|v| self.first[k] + v).collect()
    }

    /// The leg in which a stage begins, and the number of that stage there.
    pub fn begins(&self, stage: usize) -> (usize, usize) {
        let k = self.legs.iter().position(|l| stage < l.first + l.ocp.n_stages).unwrap_or(0);
        (k, stage - self.legs[k].first)
    }

    /// Does leg `j` begin within the last stage of the one before?
    fn shares_stage(&self, j: usize) -> bool {
        let before = &self.legs[j - 1];
        before.first + before.ocp.n_stages - 1 == self.legs[j].first
    }

    /// Variables that are the lengths of the pieces of every stage.
    fn pieces(&self) -> Vec<Vec<usize>> {
        let mut all = vec![Vec::new(); self.whole.n_stages];
        for (k, leg) in self.legs.iter().enumerate() {
            for (i, v) in self.built[k].problem.time_places().iter().enumerate() {
                all[leg.first + i].extend(v.map(|v| self.first[k] + v));
            }
        }
        all
    }

    /// Lengths of cut stages, and shares of the horizon.
    fn lengths_of_stages(&self) -> Vec<Coupling> {
        let o = self.whole;
        let pieces = self.pieces();
        let sum = |k: usize, factor: f64| pieces[k].iter().map(move |&v| (v, factor)).collect::<Vec<_>>();
        let total: f64 = o.durations.iter().sum();
        let mut out = Vec::new();
        for k in 0..o.n_stages {
            let bounds = self.bounds_of_stage(k);
            if pieces[k].len() > 1 && (o.time != Durations::Horizon || k == 0) {
                out.push(linear("length of a stage", vec![sum(k, 1.0)], &bounds));
            }
            if o.time == Durations::Horizon && k > 0 {
                let row = [sum(k - 1, total / o.durations[k - 1]), sum(k, -total / o.durations[k])].concat();
                out.push(linear("share of a stage", vec![row], &[0.0; 2]));
            }
        }
        out
    }

    /// Bounds of the length of a stage.
    fn bounds_of_stage(&self, k: usize) -> [f64; 2] {
        let o = self.whole;
        let share = o.durations[k] / o.durations.iter().sum::<f64>();
        match o.time {
            Durations::Fixed => [o.durations[k]; 2],
            Durations::Horizon => o.time_bounds.map(|v| v * share),
            Durations::Stages => o.time_bounds,
        }
    }

    /// Constraints between both ends of the horizon, where these are in different legs.
    fn ends(&self) -> Vec<Coupling> {
        let last = self.legs.len() - 1;
        if last == 0 {
            return Vec::new();
        }
        let nx = self.whole.system.dims().x;
        let start = self.built[0].problem.places().0;
        let end = self.first[last] + self.built[last].problem.end_place();
        let states = (0..nx).map(|i| start + i).chain((0..nx).map(|i| end + i)).map(Source::Variable);
        let inputs: Vec<Source> = states.chain(self.inputs_at_end(last)).collect();
        let coupling = |b: &crate::fesd::Boundary| Coupling {
            f: b.f.clone(),
            inputs: inputs.clone(),
            lower: b.lower.clone(),
            upper: b.upper.clone(),
        };
        self.whole.boundary.iter().map(coupling).collect()
    }

    /// Bounds of all; what several legs say is said once.
    fn bounds(&self, plan: &Plan) -> Bounds {
        let mut all = plan.bounds(&self.built, self.whole.t0);
        let d = self.whole.system.dims();
        let free = |all: &mut Bounds, v: usize| (all.xl[v], all.xu[v]) = (f64::NEG_INFINITY, f64::INFINITY);
        for (k, leg) in self.legs.iter().enumerate() {
            let b = &self.built[k];
            for row in leg.rows_again(b, k.checked_sub(1).map(|i| &self.legs[i]), self.automaton) {
                (all.cl[plan.rows[k] + row], all.cu[plan.rows[k] + row]) = (f64::NEG_INFINITY, f64::INFINITY);
            }
            if k == 0 {
                continue;
            }
            let params = b.problem.param_places().iter().take(d.p).flatten().map(|v| self.first[k] + v);
            params.chain(self.common_slacks(k)).for_each(|v| free(&mut all, v));
            if self.shares_stage(k) {
                let u = self.first[k] + b.problem.places().1[0];
                let is_ramp = |j: &usize| self.whole.linear.get(*j) == Some(&true);
                (0..b.extended.system.dims().u).filter(|j| !is_ramp(j)).for_each(|j| free(&mut all, u + j));
            }
        }
        for (k, pieces) in self.pieces().iter().enumerate() {
            if let ([v], true) = (&pieces[..], self.whole.time != Durations::Horizon || k == 0) {
                let [lower, upper] = self.bounds_of_stage(k);
                (all.xl[*v], all.xu[*v]) = (lower, upper);
            }
        }
        for (k, leg) in self.legs.iter().enumerate().filter(|l| l.1.ends_at_once()) {
            if let Some(v) = self.built[k].problem.time_places()[leg.ocp.n_stages - 1] {
                (all.xl[self.first[k] + v], all.xu[self.first[k] + v]) = (0.0, 0.0);
            }
        }
        all
    }

    /// The answer of all legs as one.
    fn read(&mut self, plan: &Plan, s: &Solution, dimensions: (usize, usize, usize)) -> Result<OcpResult> {
        let n_stages = self.whole.n_stages;
        let nu = self.whole.system.dims().u;
        let mut all: Option<OcpResult> = None;
        let mut t0 = self.whole.t0;
        for k in 0..self.legs.len() {
            let (leg, b) = (&mut self.legs[k], &mut self.built[k]);
            let own = Solution {
                x: s.x[plan.variables[k]..plan.variables[k + 1]].to_vec(),
                sides: s.sides[plan.groups[k]..plan.groups[k + 1]].to_vec(),
                ..s.clone()
            };
            leg.ocp.t0 = t0;
            let mut r = leg.ocp.read(&mut b.problem, &own, &b.extended, &self.params[k]);
            r.trajectory.elements.iter_mut().for_each(|e| leg.say_discrete(e, &self.automaton.states));
            t0 += r.durations.iter().sum::<f64>();
            let whole = all.get_or_insert_with(|| {
                let mut first = OcpResult {
                    controls: vec![0.0; n_stages * nu],
                    control_ends: vec![0.0; n_stages * nu],
                    durations: vec![0.0; n_stages],
                    cost: 0.0,
                    cost_reached: 0.0,
                    priced: 0.0,
                    violation: 0.0,
                    dimensions,
                    ..r.clone()
                };
                first.trajectory.elements.clear();
                first.trajectory.switches.clear();
                first
            });
            append(whole, leg, &r, nu);
        }
        let mut r = all.ok_or_else(|| Error::Internal("a sequence of transitions without a leg".into()))?;
        r.stats = s.stats;
        if r.outcome != Outcome::Solved {
            r.cost = f64::NAN;
        }
        Ok(r)
    }
}

/// Adds the answer of a leg.
fn append(whole: &mut OcpResult, leg: &Leg, r: &OcpResult, nu: usize) {
    whole.cost += r.cost;
    whole.cost_reached += r.cost_reached;
    whole.priced += r.priced;
    whole.violation = whole.violation.max(r.violation);
    whole.undefined |= r.undefined;
    for (k, duration) in r.durations.iter().enumerate() {
        let stage = leg.first + k;
        let at = stage * nu..(stage + 1) * nu;
        if whole.durations[stage] == 0.0 {
            whole.controls[at.clone()].copy_from_slice(&r.controls[k * nu..(k + 1) * nu]);
        }
        whole.control_ends[at].copy_from_slice(&r.control_ends[k * nu..(k + 1) * nu]);
        whole.durations[stage] += duration;
    }
    let t = &mut whole.trajectory;
    if let (Some(p), Some(first)) = (leg.begins, r.trajectory.elements.first()) {
        if let Some(jump) = whole.jumps.last_mut() {
            jump.after.clone_from(&first.x0);
            jump.stage = p.stage;
        }
    }
    let n = t.elements.len();
    t.switches
        .extend(r.trajectory.switches.iter().map(|s| crate::fesd::Switch { element: n + s.element, ..s.clone() }));
    // elements of a stage without a length say nothing
    let empty = |e: &crate::fesd::Element| leg.ends_at_once() && e.stage + 1 == r.durations.len();
    let elements = r.trajectory.elements.iter().filter(|e| !empty(e));
    t.elements.extend(elements.map(|e| crate::fesd::Element { stage: leg.first + e.stage, ..e.clone() }));
    if let (Some(p), Some(e)) = (leg.ends, r.trajectory.elements.last()) {
        whole.jumps.push(JumpMade {
            t: e.t + e.h,
            transition: p.transition,
            stage: p.stage,
            at_once: p.at_once,
            before: e.x1.clone(),
            after: Vec::new(),
        });
    }
}

/// Linear rows of variables, all with the same bounds.
fn linear(name: &str, rows: Vec<Vec<(usize, f64)>>, bounds: &[f64; 2]) -> Coupling {
    let mut variables: Vec<usize> = rows.iter().flatten().map(|e| e.0).collect();
    variables.sort_unstable();
    variables.dedup();
    let d = Dims { x: variables.len(), u: 0, p: 0 };
    let place = |v: usize| variables.binary_search(&v).unwrap_or(0);
    let n = rows.len();
    let rows = rows.into_iter().map(|r| r.into_iter().map(|(v, f)| (place(v), f)).collect()).collect();
    let f = combination(name, d, rows);
    let inputs = variables.iter().map(|&v| Source::Variable(v)).chain([Source::Constant(0.0)]).collect();
    Coupling { f, inputs, lower: vec![bounds[0]; n], upper: vec![bounds[1]; n] }
}
