//! Derivatives of an optimum with transitions: those of the program of its sequence, which is smooth.

use super::automaton::{Automaton, Sequence};
use super::guess::Guess;
use super::program::{Assembled, Program};
use crate::error::Result;
use crate::fesd::{Exit, Sizes};
use crate::mpcc::{Change, Mpcc, Solution, Tangent};
use crate::ocp::joint::Plan;
use crate::ocp::multipliers::{no_derivative, Answer, Multipliers, MultipliersOf};
use crate::ocp::request::Request;
use crate::ocp::sensitivity::{conditions, no_value, parameter, OcpSensitivity, Params};
use crate::ocp::Ocp;

/// The program of an answer, to be built again where its derivatives are asked for, and where it ended.
pub(in crate::ocp) struct Kept {
    pub(super) sequence: Sequence,
    pub(super) guess: Guess,
    pub(super) sizes: Sizes,
    pub(super) request: Request,
    pub(super) solution: Solution,
    /// What ends sliding modes in every leg.
    pub(super) exits: Vec<Exit>,
}

impl Kept {
    /// Calls `body` with the program at its solution; `whole` is the problem as it was solved.
    fn with<R>(&self, whole: &Ocp, body: impl FnOnce(&mut Program, &mut Assembled) -> Result<R>) -> Result<R> {
        let automaton = Automaton::new(&whole.system, &whole.x0_bounds[0], &whole.x_bounds);
        let mut program = Program::new(whole, &automaton, &self.sequence, &self.guess, &self.sizes, &self.request)?;
        program.built.iter_mut().zip(&self.exits).for_each(|(b, exit)| b.problem.set_exit(*exit));
        let mut all = program.assemble(&self.request)?;
        all.solver.restore(&self.solution);
        body(&mut program, &mut all)
    }

    /// As [`Ocp::multipliers`].
    pub fn multipliers(&self, whole: &Ocp, of: MultipliersOf) -> Result<Multipliers> {
        self.with(whole, |program, all| {
            let mut merged = Merged::new(whole, of);
            let last = program.legs.len() - 1;
            let mut t0 = whole.t0;
            for k in 0..=last {
                let start = t0;
                t0 += self.read_leg(program, &all.plan, (k, start), of, &mut merged)?;
            }
            if last > 0 {
                self.add_boundary(program, all, of, (whole.t0, t0), &mut merged)?;
            }
            Ok(Multipliers { times: merged.times, values: merged.values })
        })
    }

    /// Adds what leg `k`, which begins at `start`, says; returns its length.
    fn read_leg(
        &self,
        program: &mut Program,
        plan: &Plan,
        (k, start): (usize, f64),
        of: MultipliersOf,
        merged: &mut Merged,
    ) -> Result<f64> {
        let (leg, before) = (&program.legs[k], k.checked_sub(1).map(|i| &program.legs[i]));
        let again = leg.rows_again(&program.built[k], before, program.automaton);
        let resets = |t: usize| program.automaton.transitions[t].reset.is_some();
        let first = usize::from(!leg.begins.is_some_and(|p| resets(p.transition)));
        let (v, r) = (plan.variables[k]..plan.variables[k + 1], plan.rows[k]..plan.rows[k + 1]);
        let s = &self.solution;
        let (w, y, z) = (&s.x[v.clone()], &s.y[r], &s.z[v]);
        let is_last = k + 1 == program.legs.len();
        let mut a = Answer { problem: &mut program.built[k].problem, w, y, z, t0: start, again: &again, first };
        let length: f64 = a.problem.stage_lengths(w).iter().sum();
        let o = &leg.ocp;
        match of {
            MultipliersOf::Costates => {
                let found = a.of(o, of)?;
                // the first stage of a leg began in the leg before, its last one goes on in the next
                let from = usize::from(k > 0);
                let to = if is_last { o.n_stages + 1 } else { o.n_stages };
                merged.append(&found, from..to);
            }
            MultipliersOf::Controls => {
                let found = a.of(o, of)?;
                merged.add_stages(&found, leg.first, k > 0);
            }
            MultipliersOf::InitialState if k == 0 => merged.append(&a.of(o, of)?, 0..1),
            MultipliersOf::Params if k == 0 => merged.append(&a.of(o, of)?, 0..1),
            MultipliersOf::States | MultipliersOf::Path(_) => {
                let found = a.of(o, of)?;
                merged.append(&found, 0..found.times.len());
            }
            MultipliersOf::Terminal(_) if is_last => merged.append(&a.of(o, of)?, 0..1),
            MultipliersOf::Boundary(_) if is_last && k == 0 => merged.append(&a.of(o, of)?, 0..1),
            MultipliersOf::Relaxed(j) => {
                let whole = &program.whole.soft;
                let along = whole[j].at.is_some();
                if along || is_last {
                    // legs before a transition have no constraints at the end
                    let own = whole[..j].iter().filter(|s| is_last || s.at.is_some()).count();
                    let found = a.of(o, MultipliersOf::Relaxed(own))?;
                    merged.append(&found, 0..found.times.len());
                }
            }
            _ => {}
        }
        Ok(length)
    }

    /// Adds what constraints between both ends say where these are in different legs, of a horizon with these ends.
    fn add_boundary(
        &self,
        program: &mut Program,
        all: &mut Assembled,
        of: MultipliersOf,
        (start, end): (f64, f64),
        merged: &mut Merged,
    ) -> Result<()> {
        let (s, n) = (&self.solution, program.whole.boundary.len());
        let first = all.plan.links.len() - n;
        match of {
            MultipliersOf::Boundary(k) => {
                let row = all.plan.links[first + k].row;
                let width = program.whole.boundary[k].f.n_out();
                merged.append(&Multipliers { times: vec![end], values: s.y[row..row + width].to_vec() }, 0..1);
            }
            MultipliersOf::Costates => {
                let nx = program.whole.system.dims().x;
                let last = program.legs.len() - 1;
                let x0 = program.first[0] + program.built[0].problem.places().0;
                let x1 = program.first[last] + program.built[last].problem.end_place();
                let at_end = merged.values.len() - nx;
                let mut joint = program.joint(&mut all.plan);
                for k in first..first + n {
                    for (v, d) in joint.coupling_gradient(k, &s.x, &s.y).map_err(no_derivative)? {
                        if (x0..x0 + nx).contains(&v) {
                            merged.values[v - x0] += d;
                        } else if (x1..x1 + nx).contains(&v) {
                            merged.values[at_end + v - x1] += d;
                        }
                    }
                }
                debug_assert_eq!(merged.times[0], start);
            }
            _ => {}
        }
        Ok(())
    }

    /// As [`Ocp::sensitivity`].
    pub fn sensitivity(&self, whole: &Ocp) -> Result<OcpSensitivity> {
        self.with(whole, |program, Assembled { plan, solver, bounds }| {
            let d = whole.system.dims();
            let (w, y) = (&self.solution.x, &self.solution.y);
            let x0 = program.first[0] + program.built[0].problem.places().0;
            let states = &program.automaton.states;
            let is_datum = |i: usize| bounds.xl[x0 + i] == bounds.xu[x0 + i] && !states.contains(&i);
            let initial =
                |i: usize| Change { fixed: Vec::from_iter(is_datum(i).then_some((x0 + i, 1.0))), ..Change::default() };
            let mut changes: Vec<Change> = (0..d.x).map(initial).collect();
            let mut explicit = vec![0.0; d.x + d.p];
            program.joint(plan).set_polishing(true);
            let given = Given::of(program);
            for k in 0..d.p {
                let found = parameter(program.params[0][k], |h| {
                    given.set(program, plan, k, h);
                    conditions(&mut program.joint(plan), w, y)
                });
                given.set(program, plan, k, 0.0);
                let (change, cost) = found.map_err(|e| no_value(k, &e))?;
                changes.push(change);
                explicit[d.x + k] = cost;
            }
            program.joint(plan).set_polishing(false);
            let tangents = solver.tangents(&mut program.joint(plan), bounds, &changes)?;
            let controls = |t: &Tangent| -> Vec<f64> {
                let of = |stage: usize| {
                    let (k, i) = program.begins(stage);
                    let u = program.first[k] + program.built[k].problem.places().1[i];
                    t.x[u..u + d.u].to_vec()
                };
                (0..whole.n_stages).flat_map(of).collect()
            };
            Ok(OcpSensitivity {
                cost: tangents.iter().zip(&explicit).map(|(t, e)| t.objective + e).collect(),
                controls: tangents.iter().flat_map(controls).collect(),
                one_sided: tangents.iter().any(|t| t.one_sided),
                variables: tangents.into_iter().flat_map(|t| t.x).collect(),
            })
        })
    }
}

/// Parameters of all legs: with references and slacks in every stage, and those of the user.
struct Given {
    extended: Vec<Vec<f64>>,
    own: Vec<(Vec<f64>, Option<Vec<f64>>)>,
}

impl Given {
    fn of(program: &Program) -> Given {
        let own = program.legs.iter().map(|l| (l.ocp.params.clone(), l.ocp.stage_params.clone()));
        Given { extended: program.params.clone(), own: own.collect() }
    }

    /// Sets those of all legs, and of what ties them together, the `k`-th ones moved by `h`.
    fn set(&self, program: &mut Program, plan: &mut Plan, k: usize, h: f64) {
        for (j, leg) in program.legs.iter_mut().enumerate() {
            let b = &mut program.built[j];
            let n = b.extended.system.dims().p;
            Params { stages: self.extended[j].clone(), n }.set(&mut b.problem, k, h);
            (leg.ocp.params, leg.ocp.stage_params) = self.own[j].clone();
            let np = leg.ocp.params.len();
            leg.ocp.params[k] += h;
            leg.ocp.stage_params.iter_mut().flat_map(|p| p.chunks_mut(np)).for_each(|p| p[k] += h);
        }
        let couplings = program.couplings();
        plan.links.iter_mut().zip(couplings).for_each(|(l, c)| l.coupling = c);
    }
}

/// Multipliers of all legs.
#[derive(Default)]
struct Merged {
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Merged {
    fn new(whole: &Ocp, of: MultipliersOf) -> Merged {
        let n = if of == MultipliersOf::Controls { whole.n_stages } else { 0 };
        Merged { times: vec![0.0; n], values: vec![0.0; n * whole.system.dims().u] }
    }

    fn append(&mut self, m: &Multipliers, points: std::ops::Range<usize>) {
        let width = m.width();
        self.values.extend_from_slice(&m.values[points.start * width..points.end * width]);
        self.times.extend_from_slice(&m.times[points]);
    }

    /// Adds multipliers of stages from `first` on, which say when these begin but for the first of them where that `goes_on`.
    fn add_stages(&mut self, m: &Multipliers, first: usize, goes_on: bool) {
        let width = m.width();
        for (i, t) in m.times.iter().enumerate() {
            if i > 0 || !goes_on {
                self.times[first + i] = *t;
            }
            let own = &m.values[i * width..(i + 1) * width];
            let to = &mut self.values[(first + i) * width..(first + i + 1) * width];
            to.iter_mut().zip(own).for_each(|(a, b)| *a += b);
        }
    }
}
