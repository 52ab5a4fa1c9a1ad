//! Constraints along the horizon between the points at which the program imposes them: the simulation of the controls looks at them there.

use super::accuracy::{Accuracy, LITTLE};
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::{Inside, PathConstraint};
use crate::func::Point;
use crate::nlp::{Control, Outcome};
use crate::stop;
use crate::system::SharedFunction;

/// Points of a control stage, and of every step of its simulation, at which constraints are looked at, at least.
const PER_STAGE: f64 = 64.0;
const PER_STEP: f64 = 4.0;

/// Owners of a violation along the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// The path constraint of this number.
    Path(usize),
    /// A bound of a state.
    State,
}

/// The largest violation of a constraint along a simulation of the controls, as a share of its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// The constraint.
    pub of: Along,
    /// Its row, or the state.
    pub row: usize,
    /// Time of the model.
    pub t: f64,
    /// Control stage.
    pub stage: usize,
    /// The violation, in the unit of the constraint.
    pub value: f64,
    /// By how much the value of the row changes along the simulation, or [`LITTLE`] of its largest modulus where that is more.
    pub size: f64,
}

impl Between {
    /// The violation as a share of its size.
    pub fn share(&self) -> f64 {
        self.value / self.size
    }
}

/// A constraint along the horizon with its bounds.
pub(super) struct Rows<'a> {
    pub f: &'a SharedFunction,
    pub lower: &'a [f64],
    pub upper: &'a [f64],
}

impl<'a> Rows<'a> {
    /// Of a path constraint.
    pub fn of(c: &'a PathConstraint) -> Rows<'a> {
        Rows { f: &c.f, lower: &c.lower, upper: &c.upper }
    }
}

/// Rounds in which points are added at most. A point where the violation is largest halves the distance of points at least, which divides the
/// violation by four: seven take one of the size of the constraint to [`super::optimality::NONE`] of it.
const ROUNDS: usize = 7;

impl Ocp {
    /// Where the simulation of an answer violates a path constraint between the points at which it is imposed: the program is solved again from the
    /// answer with the constraint imposed at those times, too, inside of their elements. What has an answer that violates less takes its place.
    pub(super) fn impose_between(&mut self, request: &Request, control: &mut Control) -> Result<()> {
        for _ in 0..ROUNDS {
            let Some(r) = self.result.as_ref().filter(|r| r.outcome == Outcome::Solved && r.ended.is_none()) else {
                break;
            };
            let Some(before) = r.accuracy.as_ref().and_then(|a| a.violated()).filter(|_| r.is_exact()) else { break };
            let (Some(b), None) = (self.built.as_ref(), stop::requested()) else { break };
            let points = self.points_inside(r);
            if points.is_empty() {
                break;
            }
            let r = r.clone();
            let mut work = self.blank();
            work.carry_over(&r)?;
            work.set_elements(b.n_fe())?;
            work.inside = self.inside.iter().copied().chain(points).collect();
            match work.run(Start::Carried, request, control) {
                Ok(_) => {}
                Err(Error::Interrupted | Error::OutOfTime) => break,
                Err(e) => return Err(e),
            }
            let Some(mut next) = work.result.take() else { break };
            let less = |a: &Accuracy| a.reached() && a.violated().is_none_or(|b| b.share() < before.share());
            self.builds += work.builds;
            if !next.is_exact() || !next.accuracy.as_ref().is_some_and(less) {
                if let Some(r) = self.result.as_mut() {
                    r.stats.add(&next.stats);
                }
                break;
            }
            next.stats.add(&r.stats);
            next.adaptation = r.adaptation;
            (self.built, self.engine, self.inside) = (work.built, work.engine, work.inside);
            self.result = Some(next);
        }
        Ok(())
    }

    /// The points inside of elements at which the simulation of an answer violates path constraints.
    fn points_inside(&self, r: &OcpResult) -> Vec<Inside> {
        let found = r.accuracy.iter().flat_map(|a| a.along.iter().filter(|b| Accuracy::counts(b)));
        let elements = &r.trajectory.elements;
        let mut points: Vec<Inside> = Vec::new();
        for b in found {
            let Along::Path(path) = b.of else { continue };
            let Some(element) = elements.iter().position(|e| e.stage == b.stage && b.t < e.t + e.h) else { continue };
            let e = &elements[element];
            let share = (b.t - e.t) / e.h;
            // rows of one constraint may be violated at one time
            let known = |p: &Inside| (p.path, p.element) == (path, element) && p.share == share;
            if (0.0..=1.0).contains(&share) && !points.iter().any(known) {
                points.push(Inside { path, element, share });
            }
        }
        points
    }
}

/// The largest violation of a row in a stage, and between what its values are.
#[derive(Clone, Copy)]
struct Seen {
    violation: f64,
    t: f64,
    stage: usize,
    range: [f64; 2],
}

impl Seen {
    const NOTHING: Seen = Seen { violation: 0.0, t: f64::NAN, stage: 0, range: [f64::INFINITY, f64::NEG_INFINITY] };

    fn look(&mut self, value: f64, [lower, upper]: [f64; 2], t: f64, stage: usize) {
        if !value.is_finite() {
            return;
        }
        self.range = [self.range[0].min(value), self.range[1].max(value)];
        let violation = (lower - value).max(value - upper);
        if violation > self.violation {
            (self.violation, self.t, self.stage) = (violation, t, stage);
        }
    }
}

/// Looks at constraints along a simulation.
pub(super) struct Watch<'a> {
    path: &'a [Rows<'a>],
    x_bounds: [&'a [f64]; 2],
    /// Of every row, what was seen in the stage that is simulated, between what its values were before it, and what was found there.
    of_stage: Vec<Seen>,
    ranges: Vec<[f64; 2]>,
    found: Vec<(usize, Seen)>,
    /// Stage that is simulated.
    pub stage: usize,
    values: Vec<f64>,
    work: Vec<f64>,
    u: Vec<f64>,
    /// States of the simulation at a point.
    pub inside: Vec<f64>,
}

impl<'a> Watch<'a> {
    /// Of these constraints, in a simulation of so many states; none where nothing is bounded.
    pub fn new(path: &'a [Rows<'a>], x_bounds: [&'a [f64]; 2], n_states: usize) -> Option<Watch<'a>> {
        let n_rows: usize = path.iter().map(|p| p.f.n_out()).sum();
        let bounded = x_bounds.iter().any(|b| b.iter().any(|v| v.is_finite()));
        (n_rows > 0 || bounded).then(|| Watch {
            path,
            x_bounds,
            of_stage: vec![Seen::NOTHING; n_rows + x_bounds[0].len()],
            ranges: vec![Seen::NOTHING.range; n_rows + x_bounds[0].len()],
            found: Vec::new(),
            stage: 0,
            values: vec![0.0; path.iter().map(|p| p.f.n_out()).max().unwrap_or(0)],
            work: vec![0.0; path.iter().map(|p| p.f.work_len()).max().unwrap_or(0)],
            u: Vec::new(),
            inside: vec![0.0; n_states],
        })
    }

    /// Number of points in a step of length `h` of a stage of length `length`.
    pub fn points(h: f64, length: f64) -> usize {
        (PER_STAGE * h / length).clamp(PER_STEP, PER_STAGE).ceil() as usize
    }

    /// Looks at a point whose state is behind cost and linear controls, with these controls, of which `ramps` are among the states.
    pub fn look(&mut self, t: f64, state: &[f64], (u, ramps): (&[f64], &[usize]), p: &[f64]) {
        let x = &state[1 + ramps.len()..];
        self.u.clear();
        self.u.extend_from_slice(u);
        ramps.iter().zip(&state[1..]).for_each(|(&j, v)| self.u[j] = *v);
        let at = Point { t, x, u: &self.u, p };
        let mut row = 0;
        for c in self.path {
            let values = &mut self.values[..c.f.n_out()];
            let known = c.f.value(&at, values, &mut self.work).is_ok();
            for (v, (l, u)) in values.iter().zip(c.lower.iter().zip(c.upper)).filter(|_| known) {
                self.of_stage[row].look(*v, [*l, *u], t, self.stage);
                row += 1;
            }
            row += if known { 0 } else { c.f.n_out() };
        }
        for (i, (l, u)) in self.x_bounds[0].iter().zip(self.x_bounds[1]).enumerate() {
            self.of_stage[row + i].look(x[i], [*l, *u], t, self.stage);
        }
    }

    /// The next stage begins.
    pub fn begin(&mut self, stage: usize) {
        self.take_stage();
        self.stage = stage;
    }

    fn take_stage(&mut self) {
        for (row, s) in self.of_stage.iter_mut().enumerate() {
            let s = std::mem::replace(s, Seen::NOTHING);
            let [low, high] = self.ranges[row];
            self.ranges[row] = [low.min(s.range[0]), high.max(s.range[1])];
            if s.violation > 0.0 {
                self.found.push((row, s));
            }
        }
    }

    /// The largest violation of every row in every stage, those that there are.
    pub fn finish(mut self) -> Vec<Between> {
        self.take_stage();
        let path = self.path.iter().enumerate().flat_map(|(k, c)| (0..c.f.n_out()).map(move |r| (Along::Path(k), r)));
        let names: Vec<(Along, usize)> = path.chain((0..self.x_bounds[0].len()).map(|i| (Along::State, i))).collect();
        let between = |&(at, s): &(usize, Seen)| {
            let ((of, row), [low, high]) = (names[at], self.ranges[at]);
            let size = (high - low).max(LITTLE * low.abs().max(high.abs()));
            Between { of, row, t: s.t, stage: s.stage, value: s.violation, size }
        };
        self.found.iter().map(between).collect()
    }
}
