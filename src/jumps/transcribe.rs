//! From a problem and a plan of elements to a program: motion, costs, constraints and lengths, the same for all programs of
//! scenes. What contacts add is in `modal` (given modes) and `complementary` (modes the program finds).
//!
//! An element has a start of its own: the last end, or, where velocities may jump, the same coordinates with other velocities.
//! At the stage points of a Radau IIA method stand coordinates, velocities and `h` times their rates,
//!
//! ```text
//! X_j = x_start + Σ_i a_ji V_i,    V_q = h N v,    M(q) V_v = h (f_v + Σ n λ + B τ),
//! ```
//!
//! so that no inverse of the inertia is needed and contact forces are linear in their rows.

use super::assembly::{Builder, Input, Program, COST};
use super::functions::ContactFunctions;
use super::guards::Guard;
use super::modes::ContactMode;
use super::problem::Problem;
use super::scales::{self, Units};
use super::track::{Piece, Track};
use crate::fesd::{Durations, PathAt};
use crate::func::{EvalError, Point};
use crate::mpcc::Mpcc;
use crate::nlp::{Bounds, Nlp};
use crate::system::SharedFunction;

pub(super) const INF: f64 = f64::INFINITY;
/// Free variables.
pub(super) const FREE: [f64; 2] = [-INF, INF];
/// Not negative.
pub(super) const POSITIVE: [f64; 2] = [0.0, INF];
/// Not positive.
pub(super) const NEGATIVE: [f64; 2] = [-INF, 0.0];
/// Equations.
pub(super) const EQUAL: [f64; 2] = [0.0, 0.0];

/// A place of a motion: first coordinate, first velocity, the time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) q: usize,
    pub(super) v: usize,
    pub(super) t: Input,
}

/// Normal and tangential force, or impulse, of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Forces {
    pub(super) normal: usize,
    pub(super) tangential: Option<usize>,
}

/// Does a boundary between elements have an impact?
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Jump {
    /// One with these parts.
    Given(Vec<ContactMode>),
    /// That is for the program to find out.
    Undecided,
}

/// One element of a plan.
#[derive(Debug, Clone)]
pub(super) struct Planned {
    pub(super) stage: usize,
    /// Modes of the contacts; none where the program finds them.
    pub(super) modes: Option<Vec<ContactMode>>,
    pub(super) jump: Option<Jump>,
    /// Its part of the horizon, to start from.
    pub(super) span: [f64; 2],
    /// The part of the guess it takes states and forces from.
    pub(super) from: [f64; 2],
    /// Bounds of its length; equal ones fix it.
    pub(super) length: [f64; 2],
    /// As long as the one before.
    pub(super) tied: bool,
}

/// An impact of a program.
#[derive(Debug, Clone)]
pub(super) struct Impact {
    /// Velocities before it.
    pub(super) before: Place,
    /// Change of the velocities.
    pub(super) change: usize,
    /// Of every contact that takes part.
    pub(super) impulses: Vec<Option<Forces>>,
}

/// Variables of one element.
#[derive(Debug, Clone)]
pub(super) struct Element {
    pub(super) stage: usize,
    pub(super) h: usize,
    pub(super) start: Place,
    pub(super) points: Vec<Place>,
    /// `h` times the rates of coordinates and velocities at the stage points.
    pub(super) rates: Vec<usize>,
    /// First row of `M V_v = h (…)` at every stage point.
    pub(super) momentum_rows: Vec<usize>,
    /// Forces at the stage points, of every contact that may have one; impulses of the element, `h` times the force, where it is `impulsive`.
    pub(super) forces: Vec<Vec<Option<Forces>>>,
    pub(super) impulsive: bool,
    pub(super) impact: Option<Impact>,
    pub(super) modes: Option<Vec<ContactMode>>,
    pub(super) jump: Option<Vec<ContactMode>>,
}

impl Element {
    pub(super) fn end(&self) -> Place {
        self.points[self.points.len() - 1]
    }
}

/// Share of the largest violation from which a row is worth naming.
const TOLD: f64 = 0.01;

/// A row that does not hold.
#[derive(Debug, Clone)]
pub struct Broken {
    /// Names of the functions in it.
    pub functions: Vec<String>,
    /// The control stage it belongs to.
    pub stage: usize,
}

/// A program with the places of everything in it.
pub(super) struct Transcription {
    pub(super) program: Program,
    pub(super) bounds: Bounds,
    /// Where a solve starts.
    pub(super) start: Vec<f64>,
    pub(super) elements: Vec<Element>,
    pub(super) x0: Place,
    /// First control of every stage.
    pub(super) controls: Vec<usize>,
    /// Variables that are parameters.
    pub(super) params: Vec<Option<usize>>,
    /// Constants that are parameters, of every stage.
    pub(super) constants: Vec<Option<usize>>,
    /// Conditions of given modes.
    pub(super) guards: Vec<Guard>,
}

/// Collects a program, element by element.
pub(super) struct Transcriber<'a> {
    pub(super) p: &'a Problem,
    pub(super) guess: &'a Track,
    pub(super) b: Builder,
    pub(super) units: Units,
    pub(super) elements: Vec<Element>,
    x0: Place,
    controls: Vec<usize>,
    /// Of every stage, every parameter.
    params: Vec<Input>,
    free: Vec<Option<usize>>,
    time: Vec<Option<usize>>,
    zero: Input,
    /// Room for states.
    room: Vec<f64>,
}

impl<'a> Transcriber<'a> {
    /// Initial state, controls, parameters and lengths of stages.
    pub(super) fn new(p: &'a Problem, guess: &'a Track) -> Transcriber<'a> {
        let g = &p.given;
        let mut b = Builder::default();
        let zero = Input::Constant(b.constant(0.0));
        let t0 = Input::Constant(b.constant(g.t0));
        let mut params = Vec::with_capacity(g.params.len());
        for (k, &v) in g.params.iter().enumerate() {
            let j = k % g.wide.p.max(1);
            params.push(if g.free[j].is_some() { zero } else { Input::Constant(b.constant(v)) });
        }
        let mut free = vec![None; g.wide.p];
        for (j, bounds) in g.free.iter().enumerate() {
            let Some(bounds) = bounds else { continue };
            let start = guess.free.get(free.iter().flatten().count()).copied().unwrap_or(g.params[j]);
            let variable = b.variables(1, *bounds, start.clamp(bounds[0], bounds[1]), scales::unit(start.abs()));
            free[j] = Some(variable);
            for k in 0..g.durations.len() {
                params[k * g.wide.p + j] = Input::Variable(variable);
            }
        }
        let n_q = p.functions.n_q;
        let units = Units::new(p, &guess.controls);
        let q = b.sized(&units.x, FREE);
        let x0 = Place { q, v: q + n_q, t: t0 };
        let mut t = Transcriber {
            p,
            guess,
            b,
            units,
            elements: Vec::new(),
            x0,
            controls: Vec::new(),
            params,
            free,
            time: Vec::new(),
            zero,
            room: vec![0.0; g.dims.x],
        };
        t.write_state(g.t0, false, q, q + n_q);
        for i in 0..g.dims.x {
            (t.b.xl[q + i], t.b.xu[q + i]) = (g.x0_bounds[0][i], g.x0_bounds[1][i]);
        }
        t.lengths();
        t
    }

    fn lengths(&mut self) {
        let g = &self.p.given;
        match g.time {
            Durations::Fixed => self.time = vec![None; g.durations.len()],
            Durations::Horizon => {
                let total: f64 = g.durations.iter().sum();
                let t = self.b.variables(1, g.time_bounds, total, total);
                self.time = vec![Some(t); g.durations.len()];
            }
            Durations::Stages => {
                for &d in &g.durations {
                    let t = self.b.variables(1, g.time_bounds, d, d);
                    self.time.push(Some(t));
                }
            }
        }
    }

    /// Variables of the force of a contact, or of an impulse, that start from these values and have this size.
    pub(super) fn forces(&mut self, i: usize, start: [f64; 2], size: f64) -> Forces {
        let normal = self.b.variables(1, POSITIVE, start[0].max(0.0), size);
        let tangential = (self.contact(i).n_tangents > 0).then(|| self.b.variables(1, FREE, start[1], size));
        Forces { normal, tangential }
    }

    /// Controls of the next stage.
    pub(super) fn stage(&mut self) {
        let g = &self.p.given;
        let k = self.controls.len();
        let u = self.b.sized(&self.units.u, FREE);
        for j in 0..g.wide.u {
            let [lo, hi] = [g.u_bounds[0][j], g.u_bounds[1][j]];
            (self.b.xl[u + j], self.b.xu[u + j]) = (lo, hi);
            let start = self.guess.controls.get(k * g.wide.u + j).copied().unwrap_or(0.0);
            self.b.start[u + j] = start.max(lo).min(hi);
        }
        self.controls.push(u);
    }

    /// Writes the state of the guess as the start of coordinates and velocities.
    fn write_state(&mut self, t: f64, behind: bool, q: usize, v: usize) {
        let mut x = std::mem::take(&mut self.room);
        self.guess.state(t, behind, &mut x);
        let n_q = self.p.functions.n_q;
        self.b.start[q..q + n_q].copy_from_slice(&x[..n_q]);
        self.b.start[v..v + x.len() - n_q].copy_from_slice(&x[n_q..]);
        self.room = x;
    }

    /// Inputs of a function of the scene at a place; `more` stands behind the parameters.
    pub(super) fn inputs(&self, at: Place, stage: usize, more: &[Input]) -> Vec<Input> {
        let (g, f) = (&self.p.given, &self.p.functions);
        let mut all: Vec<Input> = (at.q..at.q + f.n_q).chain(at.v..at.v + f.n_v).map(Input::Variable).collect();
        all.extend((0..g.dims.u).map(|j| Input::Variable(self.controls[stage] + j)));
        all.extend_from_slice(&self.params[stage * g.wide.p..stage * g.wide.p + g.dims.p]);
        all.extend_from_slice(more);
        all.push(at.t);
        all
    }

    /// The same of a function of costs and constraints.
    fn outer_inputs(&self, places: &[Place], stage: usize) -> Vec<Input> {
        let (g, f) = (&self.p.given, &self.p.functions);
        let mut all = Vec::new();
        for at in places {
            all.extend((at.q..at.q + f.n_q).chain(at.v..at.v + f.n_v).map(Input::Variable));
        }
        all.extend((0..g.wide.u).map(|j| Input::Variable(self.controls[stage] + j)));
        all.extend_from_slice(&self.params[stage * g.wide.p..(stage + 1) * g.wide.p]);
        all.push(places[places.len() - 1].t);
        all
    }

    /// Inputs of a function that knows forces; accelerations begin at variable `a` where there are any.
    pub(super) fn force_inputs(&self, at: Place, stage: usize, a: Option<usize>, forces: Forces) -> Vec<Input> {
        let n_v = self.p.functions.n_v;
        let mut more: Vec<Input> = (0..n_v).map(|i| a.map_or(self.zero, |a| Input::Variable(a + i))).collect();
        more.push(Input::Variable(forces.normal));
        more.extend(forces.tangential.map(Input::Variable));
        self.inputs(at, stage, &more)
    }

    /// One row that holds a function with one output, between bounds.
    pub(super) fn row(&mut self, f: &SharedFunction, inputs: &[Input], bounds: [f64; 2]) -> usize {
        let row = self.b.rows(1, bounds);
        self.b.term(f, inputs, 1.0, None, [row as u32]);
        row
    }

    /// A function at inputs of the starting point; zeros where it has no value.
    pub(super) fn value(&self, f: &SharedFunction, inputs: &[Input]) -> Vec<f64> {
        let d = f.dims();
        let all: Vec<f64> = inputs
            .iter()
            .map(|i| match *i {
                Input::Variable(j) => self.b.start[j],
                Input::Constant(k) => self.b.constants[k],
            })
            .collect();
        let (u, p) = (d.x + d.u, d.x + d.u + d.p);
        let at = Point { t: all[p], x: &all[..d.x], u: &all[d.x..u], p: &all[u..p] };
        let mut out = vec![0.0; f.n_out()];
        if f.value(&at, &mut out, &mut vec![0.0; f.work_len()]).is_err() {
            out.fill(0.0);
        }
        out
    }

    pub(super) fn contact(&self, i: usize) -> &'a ContactFunctions {
        &self.p.functions.contacts[i]
    }

    /// The end of the last element, or the initial state.
    pub(super) fn last_end(&self) -> Place {
        self.elements.last().map_or(self.x0, Element::end)
    }

    /// Length, motion and cost of the next element; its contacts are still to come.
    pub(super) fn element(&mut self, plan: &Planned) -> usize {
        let length = plan.span[1] - plan.span[0];
        let h = self.b.variables(1, plan.length, length.max(plan.length[0]).min(plan.length[1]), length);
        if let (true, Some(last)) = (plan.tied, self.elements.last()) {
            let (before, row) = (last.h, self.b.rows(1, EQUAL));
            self.b.linear(row, h, 1.0);
            self.b.linear(row, before, -1.0);
        }
        let before = self.last_end();
        let impact = plan.jump.as_ref().map(|_| self.impact_motion(before, plan));
        let start = impact.as_ref().map_or(before, |(after, _)| *after);
        let n_s = self.p.given.tableau.n_s;
        let mut e = Element {
            stage: plan.stage,
            h,
            start,
            points: Vec::with_capacity(n_s),
            rates: Vec::with_capacity(n_s),
            momentum_rows: Vec::with_capacity(n_s),
            forces: Vec::with_capacity(n_s),
            impulsive: false,
            impact: impact.map(|i| i.1),
            modes: plan.modes.clone(),
            jump: match &plan.jump {
                Some(Jump::Given(j)) => Some(j.clone()),
                _ => None,
            },
        };
        for j in 0..n_s {
            self.point(&mut e, j, plan);
        }
        self.motion(&mut e);
        self.elements.push(e);
        self.elements.len() - 1
    }

    /// Velocities behind an impact and their change: `M(q) (v⁺ − v⁻)` is what impulses are to add up to.
    fn impact_motion(&mut self, before: Place, plan: &Planned) -> (Place, Impact) {
        let n_v = self.p.functions.n_v;
        let [lower, upper] = &self.p.given.x_bounds;
        let n_q = self.p.functions.n_q;
        let v = self.b.sized(&self.units.x[n_q..], FREE);
        for i in 0..n_v {
            (self.b.xl[v + i], self.b.xu[v + i]) = (lower[n_q + i], upper[n_q + i]);
        }
        let mut x = std::mem::take(&mut self.room);
        self.guess.state(plan.from[0], true, &mut x);
        self.b.start[v..v + n_v].copy_from_slice(&x[n_q..]);
        self.room = x;
        let change = self.b.sized(&self.units.x[n_q..], FREE);
        let rows = self.b.rows(n_v, EQUAL);
        for i in 0..n_v {
            self.b.linear(rows + i, change + i, 1.0);
            self.b.linear(rows + i, v + i, -1.0);
            self.b.linear(rows + i, before.v + i, 1.0);
            self.b.start[change + i] = self.b.start[v + i] - self.b.start[before.v + i];
        }
        let n_c = self.p.n_contacts();
        (Place { v, ..before }, Impact { before, change, impulses: vec![None; n_c] })
    }

    /// Forces of an impact: rows `M (v⁺ − v⁻) − Σ (n Λ + B T) = 0`.
    pub(super) fn impact_forces(&mut self, stage: usize, at: Place, impact: &Impact) {
        let f = &self.p.functions;
        let n_v = f.n_v;
        let rows = self.b.rows(n_v, EQUAL);
        let all = || (rows..rows + n_v).map(|r| r as u32);
        let more: Vec<Input> = (0..n_v).map(|i| Input::Variable(impact.change + i)).collect();
        let inputs = self.inputs(at, stage, &more);
        self.b.term(&f.momentum, &inputs, 1.0, None, all());
        for (i, forces) in impact.impulses.iter().enumerate() {
            let Some(forces) = forces else { continue };
            let inputs = self.force_inputs(at, stage, None, *forces);
            self.b.term(&f.contacts[i].push, &inputs, -1.0, None, all());
        }
    }

    /// Variables of a stage point.
    fn point(&mut self, e: &mut Element, j: usize, plan: &Planned) {
        let (n_q, n_v) = (self.p.functions.n_q, self.p.functions.n_v);
        let c = self.p.given.tableau.c[j];
        let [lower, upper] = &self.p.given.x_bounds;
        let q = self.b.sized(&self.units.x, FREE);
        for i in 0..n_q + n_v {
            (self.b.xl[q + i], self.b.xu[q + i]) = (lower[i], upper[i]);
        }
        let t = plan.from[0] + c * (plan.from[1] - plan.from[0]);
        self.write_state(t, false, q, q + n_q);
        let t = if self.p.knows_time {
            let start = plan.span[0] + c * (plan.span[1] - plan.span[0]);
            let t = self.b.variables(1, FREE, start, self.units.time);
            let bound = match e.start.t {
                Input::Constant(_) => self.p.given.t0,
                Input::Variable(_) => 0.0,
            };
            let row = self.b.rows(1, [bound, bound]);
            self.b.linear(row, t, 1.0);
            self.b.linear(row, e.h, -c);
            if let Input::Variable(before) = e.start.t {
                self.b.linear(row, before, -1.0);
            }
            Input::Variable(t)
        } else {
            self.zero
        };
        e.points.push(Place { q, v: q + n_q, t });
        e.rates.push(self.b.sized(&self.units.x, FREE));
        e.forces.push(vec![None; self.p.n_contacts()]);
    }

    /// Rows of the motion without contact forces, and the cost of the element.
    fn motion(&mut self, e: &mut Element) {
        let f = &self.p.functions;
        let (n_q, n) = (f.n_q, f.n_q + f.n_v);
        let tableau = &self.p.given.tableau;
        let n_s = tableau.n_s;
        for j in 0..n_s {
            let rows = self.b.rows(n, EQUAL);
            for i in 0..n {
                let start = if i < n_q { e.start.q + i } else { e.start.v + i - n_q };
                self.b.linear(rows + i, e.points[j].q + i, 1.0);
                self.b.linear(rows + i, start, -1.0);
                for k in 0..n_s {
                    self.b.linear(rows + i, e.rates[k] + i, -tableau.a(j, k));
                }
            }
        }
        self.start_rates(e);
        for j in 0..n_s {
            let rows = self.b.rows(n, EQUAL);
            for i in 0..n_q {
                self.b.linear(rows + i, e.rates[j] + i, 1.0);
            }
            let inputs = self.inputs(e.points[j], e.stage, &[]);
            self.b.term(&f.smooth, &inputs, -1.0, Some(e.h), (rows..rows + n).map(|r| r as u32));
            let more: Vec<Input> = (0..f.n_v).map(|i| Input::Variable(e.rates[j] + n_q + i)).collect();
            let inputs = self.inputs(e.points[j], e.stage, &more);
            self.b.term(&f.momentum, &inputs, 1.0, None, (rows + n_q..rows + n).map(|r| r as u32));
            e.momentum_rows.push(rows + n_q);
            if let Some(l) = &self.p.given.lagrange {
                let inputs = self.outer_inputs(&[e.points[j]], e.stage);
                self.b.term(l, &inputs, tableau.b[j], Some(e.h), [COST]);
            }
        }
    }

    /// Rates of the polynomial through the starting values.
    fn start_rates(&mut self, e: &Element) {
        let tableau = &self.p.given.tableau;
        let (n_q, n) = (self.p.functions.n_q, self.p.given.dims.x);
        let Some(inverse) = &tableau.a_inv else { return };
        for j in 0..tableau.n_s {
            for i in 0..n {
                let start = if i < n_q { e.start.q + i } else { e.start.v + i - n_q };
                let sum = (0..tableau.n_s)
                    .map(|k| inverse[j * tableau.n_s + k] * (self.b.start[e.points[k].q + i] - self.b.start[start]));
                self.b.start[e.rates[j] + i] = sum.sum();
            }
        }
    }

    /// A force of a contact at a stage point, with its part in the rows of the motion; `impulsive` where the variables are the force times
    /// the length of the element.
    pub(super) fn add_force(&mut self, element: usize, j: usize, i: usize, forces: Forces, impulsive: bool) {
        let e = &mut self.elements[element];
        e.forces[j][i] = Some(forces);
        e.impulsive = impulsive;
        let (at, stage, h) = (e.points[j], e.stage, (!impulsive).then_some(e.h));
        let rows = e.momentum_rows[j];
        let n_v = self.p.functions.n_v;
        let inputs = self.force_inputs(at, stage, None, forces);
        self.b.term(&self.p.functions.contacts[i].push, &inputs, -1.0, h, (rows..rows + n_v).map(|r| r as u32));
    }

    /// Holds contact `i` closed at a stage point: its gap is zero there, with a multiplier in the rates of the coordinates. A gap that is
    /// linear is held by its rate: collocation integrates it without error, and the row would only say the same again.
    pub(super) fn hold(&mut self, element: usize, j: usize, i: usize) {
        if self.contact(i).gap.hess_pattern().nnz() == 0 {
            return;
        }
        let e = &self.elements[element];
        let (at, stage, n_q) = (e.points[j], e.stage, self.p.functions.n_q);
        let rows = e.momentum_rows[j] - n_q;
        let mu = self.b.variables(1, FREE, 0.0, self.units.shifts[i]);
        let c = self.contact(i);
        let inputs = self.inputs(at, stage, &[Input::Variable(mu)]);
        self.b.term(&c.shift, &inputs, -1.0, None, (rows..rows + n_q).map(|r| r as u32));
        let inputs = self.inputs(at, stage, &[]);
        self.row(&c.gap, &inputs, EQUAL);
    }

    /// Lengths of the stages, constraints and costs of the horizon; the program.
    pub(super) fn finish(mut self) -> Transcription {
        self.stage_lengths();
        self.constraints();
        let start = std::mem::take(&mut self.b.start);
        let constant = |p: &Input| match *p {
            Input::Constant(k) => Some(k),
            Input::Variable(_) => None,
        };
        let constants = self.params.iter().map(constant).collect();
        let (program, bounds) = self.b.finish();
        Transcription {
            program,
            bounds,
            start,
            elements: self.elements,
            x0: self.x0,
            controls: self.controls,
            params: self.free,
            constants,
            guards: Vec::new(),
        }
    }

    /// `Σ h = T` for every stage with a length that is not fixed already.
    fn stage_lengths(&mut self) {
        let g = &self.p.given;
        let total: f64 = g.durations.iter().sum();
        for (k, &d) in g.durations.iter().enumerate() {
            let of_stage: Vec<usize> = self.elements.iter().filter(|e| e.stage == k).map(|e| e.h).collect();
            let fixed = of_stage.iter().all(|&h| self.b.xl[h] == self.b.xu[h]);
            let row = match self.time[k] {
                None if fixed => continue,
                None => self.b.rows(1, [d, d]),
                Some(t) => {
                    let row = self.b.rows(1, EQUAL);
                    let share = if g.time == Durations::Horizon { d / total } else { 1.0 };
                    self.b.linear(row, t, -share);
                    row
                }
            };
            for h in of_stage {
                self.b.linear(row, h, 1.0);
            }
        }
    }

    fn stage_elements(&self, k: usize) -> Vec<usize> {
        (0..self.elements.len()).filter(|&n| self.elements[n].stage == k).collect()
    }

    /// Places of a stage where a path constraint holds.
    fn path_places(&self, k: usize, at: PathAt) -> Vec<Place> {
        let of_stage = self.stage_elements(k);
        let (Some(&first), Some(&last)) = (of_stage.first(), of_stage.last()) else { return Vec::new() };
        let mut places = vec![self.elements[first].start];
        match at {
            PathAt::ControlGrid => places.push(self.elements[last].end()),
            PathAt::Elements => places.extend(of_stage.iter().map(|&n| self.elements[n].end())),
            PathAt::StagePoints => places.extend(of_stage.iter().flat_map(|&n| self.elements[n].points.clone())),
        }
        places
    }

    fn constraints(&mut self) {
        let g = &self.p.given;
        let n = g.durations.len();
        let bounded = |t: &mut Self, f: &SharedFunction, inputs: &[Input], lower: &[f64], upper: &[f64]| {
            let rows = t.b.rows(f.n_out(), FREE);
            for i in 0..f.n_out() {
                (t.b.cl[rows + i], t.b.cu[rows + i]) = (lower[i], upper[i]);
            }
            t.b.term(f, inputs, 1.0, None, (rows..rows + f.n_out()).map(|r| r as u32));
        };
        for c in &g.path {
            for k in 0..n {
                for at in self.path_places(k, c.at) {
                    let inputs = self.outer_inputs(&[at], k);
                    bounded(self, &c.f, &inputs, &c.lower, &c.upper);
                }
            }
        }
        let end = self.last_end();
        for c in &g.terminal {
            let inputs = self.outer_inputs(&[end], n - 1);
            bounded(self, &c.f, &inputs, &c.lower, &c.upper);
        }
        for c in &g.boundary {
            let inputs = self.outer_inputs(&[self.x0, end], n - 1);
            bounded(self, &c.f, &inputs, &c.lower, &c.upper);
        }
        if let Some(f) = &g.mayer {
            let inputs = self.outer_inputs(&[end], n - 1);
            self.b.term(f, &inputs, 1.0, None, [COST]);
        }
        if let Some(f) = &g.grid_cost {
            for k in 0..n {
                let Some(&last) = self.stage_elements(k).last() else { continue };
                let inputs = self.outer_inputs(&[self.elements[last].end()], k);
                self.b.term(f, &inputs, 1.0, None, [COST]);
            }
        }
    }
}

impl Transcription {
    /// State at a place.
    pub(super) fn state(&self, p: &Problem, at: Place, w: &[f64]) -> Vec<f64> {
        let (n_q, n_v) = (p.functions.n_q, p.functions.n_v);
        w[at.q..at.q + n_q].iter().chain(&w[at.v..at.v + n_v]).copied().collect()
    }

    /// Sliding velocity of a contact at a state in an element; zero without a tangent.
    pub(super) fn slide(&self, p: &Problem, i: usize, x: &[f64], w: &[f64], e: &Element) -> f64 {
        p.functions.contacts[i].slide.as_ref().map_or(0.0, |f| self.value_at(p, f, x, w, e))
    }

    /// Gap of a contact at a place of an element.
    pub(super) fn gap(&self, p: &Problem, i: usize, at: Place, w: &[f64], e: &Element) -> f64 {
        self.value_at(p, &p.functions.contacts[i].gap, &self.state(p, at, w), w, e)
    }

    /// A function of the scene at a state in an element; zero where it has no value.
    fn value_at(&self, p: &Problem, f: &SharedFunction, x: &[f64], w: &[f64], e: &Element) -> f64 {
        let g = &p.given;
        let u = &w[self.controls[e.stage]..self.controls[e.stage] + g.dims.u];
        let params: Vec<f64> =
            (0..g.dims.p).map(|j| self.params[j].map_or(g.params[e.stage * g.wide.p + j], |v| w[v])).collect();
        let t = match e.end().t {
            Input::Variable(j) => w[j],
            Input::Constant(_) => g.t0,
        };
        let mut out = [0.0];
        let at = Point { t, x, u, p: &params };
        match f.value(&at, &mut out, &mut vec![0.0; f.work_len()]) {
            Ok(()) => out[0],
            Err(_) => 0.0,
        }
    }

    /// Largest modulus of a velocity at the stage points.
    pub(super) fn largest_speed(&self, p: &Problem, w: &[f64]) -> f64 {
        let n_v = p.functions.n_own();
        let of = |at: &Place| w[at.v..at.v + n_v].iter().fold(0f64, |m, v| m.max(v.abs()));
        self.elements.iter().flat_map(|e| &e.points).map(of).fold(0.0, f64::max)
    }

    /// The motion at a point of the program; `modes` says what the contacts do where the plan did not.
    pub(super) fn read(&self, p: &Problem, w: &[f64], modes: &dyn Fn(&Element) -> Vec<ContactMode>) -> Track {
        let (nx, n_c) = (p.given.dims.x, p.n_contacts());
        let state = |at: Place| self.state(p, at, w);
        let pair = |f: Option<Forces>| f.map_or([0.0; 2], |f| [w[f.normal], f.tangential.map_or(0.0, |t| w[t])]);
        let mut t = p.given.t0;
        let mut pieces = Vec::with_capacity(self.elements.len());
        for e in &self.elements {
            let h = w[e.h];
            let per = if e.impulsive && h > 0.0 { 1.0 / h } else { 1.0 };
            let mut forces = Vec::with_capacity(e.points.len() * n_c * 2);
            for at in &e.forces {
                at.iter().for_each(|f| forces.extend(pair(*f).map(|v| per * v)));
            }
            let impulses = e.impact.as_ref().map(|i| i.impulses.iter().flat_map(|f| pair(*f)).collect());
            pieces.push(Piece {
                t,
                h,
                stage: e.stage,
                modes: e.modes.clone().unwrap_or_else(|| modes(e)),
                jump: e.jump.clone(),
                x0: state(e.start),
                xs: e.points.iter().flat_map(|&at| state(at)).collect(),
                forces,
                impulses: impulses.unwrap_or_default(),
            });
            t += h;
        }
        let wide = p.given.wide.u;
        Track {
            tableau: p.given.tableau.clone(),
            nx,
            pieces,
            controls: self.controls.iter().flat_map(|&u| w[u..u + wide].iter().copied()).collect(),
            free: self.params.iter().flatten().map(|&j| w[j]).collect(),
        }
    }

    /// Largest violation of a row or a bound at a point, infinite where a function has no value; and of the rows with functions the
    /// one that is violated most.
    pub(super) fn violation(&mut self, w: &[f64]) -> (f64, Option<Broken>) {
        let mut rows = vec![0.0; self.program.m()];
        if self.program.cost(w, &mut rows).is_err() {
            return (f64::INFINITY, None);
        }
        let (sizes, units) = self.units_of_rows();
        let b = &self.bounds;
        let outside = |v: f64, lower: f64, upper: f64| (lower - v).max(v - upper).max(0.0);
        let of_row = |i: usize| outside(rows[i], b.cl[i], b.cu[i]) / units[i];
        let of_bounds = (0..w.len()).map(|j| outside(w[j], b.xl[j], b.xu[j]) / sizes[j]).fold(0.0, f64::max);
        let most = (0..rows.len()).map(of_row).fold(of_bounds, f64::max);
        // sums of variables alone say nothing about the scene
        let told = (0..rows.len()).filter(|&i| of_row(i) > TOLD * most && !self.program.behind(i).0.is_empty());
        let broken = told.max_by(|i, j| of_row(*i).total_cmp(&of_row(*j))).map(|row| {
            let (names, last) = self.program.behind(row);
            let stage = self.elements.iter().rfind(|e| e.h <= last).map_or(0, |e| e.stage);
            let mut functions: Vec<String> = names.into_iter().map(str::to_owned).collect();
            functions.dedup();
            Broken { functions, stage }
        });
        (most, broken)
    }

    /// Sizes of the variables, and units of the rows: what variables of their sizes change them by at the start, which is a motion.
    fn units_of_rows(&mut self) -> (Vec<f64>, Vec<f64>) {
        let p = &mut self.program;
        let mut sizes = vec![1.0; p.n()];
        p.sizes(&mut sizes);
        let (mut grad, mut jac) = (vec![0.0; p.n()], vec![0.0; p.jac_pattern().nnz()]);
        let mut largest = vec![0f64; p.m()];
        if p.derivatives(&self.start, &mut grad, &mut jac).is_ok() {
            let pattern = p.jac_pattern();
            for (j, size) in sizes.iter().enumerate() {
                for (&i, v) in pattern.rows(j).iter().zip(&jac[pattern.range(j)]) {
                    largest[i] = largest[i].max((v * size).abs());
                }
            }
        }
        (sizes, largest.into_iter().map(scales::unit).collect())
    }

    /// The cost at a point.
    pub(super) fn cost(&mut self, w: &[f64]) -> Result<f64, EvalError> {
        let mut rows = vec![0.0; self.program.m()];
        self.program.cost(w, &mut rows)
    }
}
