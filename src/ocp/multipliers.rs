//! Multipliers of the constraints of the last solution, and costates.

use super::{stage_times, Built, Ocp, OcpResult};
use crate::error::{Error, Result};
use crate::fesd::Fesd;
use crate::func::EvalError;
use crate::mpcc::Mpcc;
use crate::stop;

/// Owners of multipliers. Those of constraints and bounds are positive where an upper bound is active, negative where a
/// lower one is: raising that bound by `d` changes the optimal cost by `−d` times the multiplier, to first order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MultipliersOf {
    /// Costates `[nx]` at the start of every control stage and at the end of the horizon: derivatives of the cost that is still to
    /// come, constraints behind that time included, with respect to the state; at the end, of terminal cost and constraints.
    Costates,
    /// Bounds of the initial state `[nx]`: where it is fixed, the negative derivative of the optimal cost with respect to it.
    InitialState,
    /// Bounds of the states `[nx]`, at the stage points and ends of all finite elements.
    States,
    /// Bounds of the controls `[nu]` in every control stage; zero for controls that are linear, whose values are bounded as states
    /// are.
    Controls,
    /// Bounds of the parameters `[np]`; zero for those that are given.
    Params,
    /// A path constraint, in the order in which they were added, at all points at which it holds.
    Path(usize),
    /// A terminal constraint.
    Terminal(usize),
    /// A constraint between both ends.
    Boundary(usize),
    /// A constraint that may be violated at a price; in the order in which they were added.
    Relaxed(usize),
}

/// Multipliers at points of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Multipliers {
    /// Times of the points; the start of the stage for controls, the end of the horizon for what holds there, its start for initial
    /// state and parameters.
    pub times: Vec<f64>,
    /// Equally many numbers for every point, one point behind the other.
    pub values: Vec<f64>,
}

impl Multipliers {
    /// Numbers for every point.
    pub fn width(&self) -> usize {
        self.values.len() / self.times.len().max(1)
    }
}

/// A point of the discretised problem.
pub(super) struct Answer<'a> {
    pub problem: &'a mut Fesd,
    pub w: &'a [f64],
    pub y: &'a [f64],
    pub z: &'a [f64],
    pub t0: f64,
    /// Rows that say nothing of their own.
    pub again: &'a [usize],
    /// The first of the points at which the states have bounds: 1 behind an initial state, which has its own.
    pub first: usize,
}

impl Answer<'_> {
    fn bounds(&self, at: usize, n: usize) -> impl Iterator<Item = f64> + '_ {
        self.z[at..at + n].iter().map(|z| -z)
    }

    fn starts(&self) -> Vec<f64> {
        stage_times(self.t0, &self.problem.stage_lengths(self.w))
    }

    fn end(&self) -> f64 {
        self.t0 + self.problem.stage_lengths(self.w).iter().sum::<f64>()
    }

    fn path(&self, index: usize, value: impl Fn(usize) -> Vec<f64>) -> Multipliers {
        let mut points = self.problem.path_rows(index, self.w);
        points.retain(|p| !self.again.contains(&p.1));
        Multipliers {
            times: points.iter().map(|p| self.t0 + p.0).collect(),
            values: points.iter().flat_map(|p| value(p.1)).collect(),
        }
    }

    fn at_end(&self, values: Vec<f64>) -> Multipliers {
        Multipliers { times: vec![self.end()], values }
    }

    fn costates(&mut self) -> Result<Multipliers> {
        let found = self.problem.costates(self.w, self.y);
        let values = found.map_err(no_derivative)?;
        Ok(Multipliers { times: self.starts(), values })
    }

    fn states(&self, nx: usize) -> Multipliers {
        let (starts, lengths) = (self.starts(), self.problem.stage_lengths(self.w));
        let points = self.problem.state_points(self.w);
        Multipliers {
            times: points[self.first..].iter().map(|p| starts[p.stage] + p.share * lengths[p.stage]).collect(),
            values: points[self.first..].iter().flat_map(|p| self.bounds(p.at, nx)).collect(),
        }
    }

    /// Multipliers of the problem `o` at this point.
    pub fn of(&mut self, o: &Ocp, of: MultipliersOf) -> Result<Multipliers> {
        let a = self;
        let t0 = a.t0;
        let d = o.system.dims();
        let start = |values: Vec<f64>| Multipliers { times: vec![t0], values };
        Ok(match of {
            MultipliersOf::Costates => {
                a.problem.set_polishing(true);
                let found = a.costates();
                a.problem.set_polishing(false);
                found?
            }
            MultipliersOf::InitialState => start(a.bounds(a.problem.places().0, d.x).collect()),
            MultipliersOf::States => a.states(d.x),
            MultipliersOf::Controls => {
                let mut times = a.starts();
                times.pop();
                let linear = a.problem.ramp_places();
                let of = |(j, v): (usize, f64)| if linear[j].is_some() { 0.0 } else { v };
                let stages = a.problem.places().1;
                let values = stages.iter().flat_map(|&u| a.bounds(u, d.u).enumerate().map(of)).collect();
                Multipliers { times, values }
            }
            MultipliersOf::Params => {
                let places = &a.problem.param_places()[..d.p];
                start(places.iter().map(|p| p.map_or(0.0, |at| -a.z[at])).collect())
            }
            MultipliersOf::Path(k) => {
                let width = o.path[k].f.n_out();
                a.path(k, |row| a.y[row..row + width].to_vec())
            }
            MultipliersOf::Terminal(k) => {
                let row = a.problem.end_rows()[0][k];
                a.at_end(a.y[row..row + o.terminal[k].f.n_out()].to_vec())
            }
            MultipliersOf::Boundary(k) => {
                let row = a.problem.end_rows()[1][k];
                a.at_end(a.y[row..row + o.boundary[k].f.n_out()].to_vec())
            }
            MultipliersOf::Relaxed(k) => {
                // the lower bounds, then the upper ones: of a row at most one is active
                let (width, before, at_end) = o.place_of_relaxed(k);
                let both = |row: usize| (row..row + width).map(|r| a.y[r] + a.y[r + width]).collect::<Vec<f64>>();
                if at_end {
                    let row = a.problem.end_rows()[0][o.terminal.len() + before];
                    a.at_end(both(row))
                } else {
                    a.path(o.path.len() + before, both)
                }
            }
        })
    }
}

/// Why there is none.
pub(super) fn no_derivative(e: EvalError) -> Error {
    match e {
        EvalError::Stopped => stop::error(),
        _ => Error::NonFinite("a function of the model has no derivative at the solution".into()),
    }
}

impl Ocp {
    /// Outputs of a relaxed constraint, those before it at the same places, and whether these are the end of the horizon.
    pub(super) fn place_of_relaxed(&self, k: usize) -> (usize, usize, bool) {
        let c = &self.soft[k];
        let before = self.soft[..k].iter().filter(|s| s.at.is_none() == c.at.is_none()).count();
        (c.f.n_out(), before, c.at.is_none())
    }

    /// Constraints of the kind of `of`, whose index does not count; 1 for what is no list.
    pub fn count_multipliers(&self, of: MultipliersOf) -> usize {
        match of {
            MultipliersOf::Path(_) => self.path.len(),
            MultipliersOf::Terminal(_) => self.terminal.len(),
            MultipliersOf::Boundary(_) => self.boundary.len(),
            MultipliersOf::Relaxed(_) => self.n_relaxed(),
            _ => 1,
        }
    }

    /// Multipliers of the last solution, as the discretised problem has them: those of a path constraint add up to the effect of
    /// its bound at all points together. Known of exact solutions ([`crate::mpcc::Polish::Done`]). Of discrete states they are zero, and costates are those before a transition that is made at the same time.
    pub fn multipliers(&mut self, of: MultipliersOf) -> Result<Multipliers> {
        let mut found = self.found_multipliers(of)?;
        if matches!(of, MultipliersOf::Costates | MultipliersOf::InitialState | MultipliersOf::States) {
            let discrete = self.system.discrete_states();
            found.values.chunks_mut(self.system.dims().x).for_each(|x| discrete.iter().for_each(|&i| x[i] = 0.0));
        }
        Ok(found)
    }

    fn found_multipliers(&mut self, of: MultipliersOf) -> Result<Multipliers> {
        if self.is_scene() {
            self.simulate_answer()?;
        }
        let n = self.count_multipliers(of);
        if let MultipliersOf::Path(k)
        | MultipliersOf::Terminal(k)
        | MultipliersOf::Boundary(k)
        | MultipliersOf::Relaxed(k) = of
        {
            if k >= n {
                return Err(Error::Range(format!("there is no constraint {k} of this kind: there are {n}")));
            }
        }
        if self.is_answered_by_simulation() {
            return self.simulated_multipliers(of);
        }
        let none = || Error::State("there is no exact solution to have multipliers: solve the problem first".into());
        if !self.result.as_ref().is_some_and(OcpResult::has_exact_modes) {
            return Err(none());
        }
        let mut built = self.built.take().ok_or_else(none)?;
        let found = self.multipliers_of(&mut built, of);
        self.built = Some(built);
        found
    }

    fn multipliers_of(&self, Built { problem, solver, .. }: &mut Built, of: MultipliersOf) -> Result<Multipliers> {
        let s = solver.solution();
        let (w, y, z) = (&s.x[..], &s.y[..], &s.z[..]);
        Answer { problem, w, y, z, t0: self.t0, again: &[], first: 1 }.of(self, of)
    }
}
