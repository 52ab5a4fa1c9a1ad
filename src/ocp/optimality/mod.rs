//! Is an answer optimal for the control problem, and not only for its discretisation? The costates are computed by the
//! derivatives of event-driven simulations, stage by stage from the states of the answer, and with the multipliers of the
//! constraints they give the derivatives of the cost with respect to controls, free lengths, parameters and initial
//! states; what is left of these inside their bounds must vanish.
//!
//! A switch that lies between two control stages is a kink of the cost: it happens under the control before when the state
//! arrives earlier, and under the one behind when it arrives later. With `W = 0` the surface, `n` its gradient, `f_A, f_B`
//! the velocities before and behind the switch and `Λ` the costate behind it, the costate before is `Λ + c n`, where
//!
//! ```text
//! c = Λᵀ (f_B − f_A) / (nᵀ f_A + W_t)            (the transposed jump of (6.25))
//! ```
//!
//! with the velocities under the control before (`c_b`) or behind (`c_a`). A constraint that holds all the time and acts at the
//! switch with the force `φ` goes with it: it takes `φᵀ f_A / (nᵀ f_A + W_t)` from both, and as much in the direction of `n` from the
//! costate where it acts at a switch inside of a stage. The answer is stationary if some `c` between the two makes the derivatives
//! vanish: `c_b − c` and `c − c_a` are then the derivatives of the cost towards either side. Where the state comes to a surface
//! exactly at the end of a stage, and the next control turns it back, `c ≥ 0` is the derivative of moving away from the surface, and
//! that of passing it is `Λᵀ b − c` with `b` the change of the state by what happens beyond.
//! At the end of the horizon the same holds, with the costate that the cost at the end makes.
//!
//! Where a surface is touched on the way, without speed towards it (`nᵀ f_A = 0`), and the velocity beyond leads back to it (`nᵀ f_B < 0`), as
//! where a mass that friction would hold comes to rest for a moment, a state that comes further slides until the motion leads away. What
//! it is then differs from what it would have been without the surface by `−(f_B − f_A) nᵀ δx / (nᵀ (f_B − f_A))`, which is the limit of the jump
//! of derivatives where sliding begins, so that `0 ≤ c ≤ −Λᵀ (f_B − f_A) / (nᵀ (f_B − f_A))`.
//! Controls that stay on a surface have a file of their own.

mod bounds;
mod controls;
mod multipliers;
mod simulate;
mod slopes;
#[cfg(test)]
mod tests;

use super::accuracy::{self, with_cost};
use super::solve::Built;
use super::{Durations, Ocp, OcpResult};
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::event::{self, Engine};
use crate::fesd::{Fesd, Row, StatePoint};
use crate::func::EvalError;
use crate::nlp::Bounds;
use crate::stop::{self, Why};
use controls::Movable;
use nalgebra::{DMatrix, DVector};
use simulate::Stage;
use slopes::{Free, Quantities};

/// Tolerance of the simulations.
const TOLERANCE: f64 = 1e-9;
const MAX_STEPS: usize = 200_000;
/// Share of a stage, at least and at most, that is left out around its ends, where a switch of the answer and of the
/// simulation may be on different sides of the end.
const MARGIN: [f64; 2] = [1e-7, 1e-3];
/// Multiples of the difference between answer and simulation that count as doubt about where a switch is.
const DOUBT: f64 = 10.0;
/// Multiples of its tolerance that a simulation may be off by itself.
const NOISE: f64 = 1e3;
/// Share of its range by which a simulated state may be off at the end of a stage, for derivatives that are those of the
/// answer.
const OFF: f64 = 1e-2;
/// First-order changes, relative to those that single terms of the cost make, that count as none: what is
/// left to gain is of the order of their square, 1e-8. Answers to programs have 1e-5 or less; what has more is looked at by descent.
pub(super) const NONE: f64 = 1e-4;
/// Distance from a bound, in units of the size of a quantity, at which it is reached.
const AT_BOUND: f64 = 1e-6;
/// Multiples of what derivatives make of the difference between a simulation and an answer that count as another motion.
const AWAY: f64 = 10.0;
/// Why nothing is known of an answer whose controls lead elsewhere.
pub(super) const OTHER: &str = "the simulation of the controls is not that of the answer";
/// The same of one whose derivatives along single stages would say something.
pub(super) const CONTRADICTED: &str =
    "the simulation of the controls is off the answer by more than what a verdict is true within";
/// Why the derivatives say nothing of an answer.
const WITHOUT_DERIVATIVES: &str = "derivatives along the simulation are not finite";
/// Where neither multipliers that prove an answer were found nor a proof that there are none.
const UNDECIDED: &str = "whether multipliers prove the answer was not decided in time";
/// Share of the largest distance from a surface, in terms of indicators, at which it is touched.
const TOUCH: f64 = 1e-7;
/// Multiples of the distance that an answer keeps from surfaces at which they are touched: it is kept up to the error of the method.
const KEPT: f64 = 1.5;
/// Share of its terms, and of what the ranges of the states make of it, above which the speed towards a surface is one.
const SLOW: f64 = 1e-6;
/// Differences of velocities, relative to the velocities and to ranges of the states over the horizon, that count as none.
const SAME: f64 = 1e-4;
/// Singular values, relative to columns of length 1, that count as zero.
const RANK: f64 = 1e-9;
/// Share of the largest multiplier below which one acts nowhere.
const NOTHING: f64 = 1e-9;

/// Verdicts on an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Verdict {
    /// Not known.
    Unknown = 0,
    /// No change of controls, free lengths, parameters, initial states lowers the cost to first order.
    LocalOptimum = 1,
    /// Local optimum at a kink; switches lie between control stages, and the cost rises on either side.
    Kink = 2,
    /// Some change lowers the cost to first order.
    NotOptimal = 3,
    /// No answer with other choices costs less by more than [`Optimality::gap`] says.
    Global = 4,
}

impl Verdict {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Unknown => "unknown",
            Verdict::LocalOptimum => "local_optimum",
            Verdict::Kink => "kink",
            Verdict::NotOptimal => "not_optimal",
            Verdict::Global => "global",
        }
    }
}

/// A switch between two control stages, or a surface that is touched without being crossed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kink {
    /// The stage behind it, the number of stages at the end of the horizon; or the one in which a surface is touched.
    pub stage: usize,
    /// Time.
    pub t: f64,
    /// Derivatives of the cost towards a switch in the stage before and in the stage behind, relative to what all controls
    /// together can do; negative where that lowers the cost, NaN where the surface is not reached under the control of that
    /// stage, and no small change leads there, or where the motion jumps to another one, which costs more or misses constraints.
    pub before: f64,
    /// Derivative in the stage behind.
    pub after: f64,
    /// No switch: the surface is touched and left again. The first derivative is then that away from it, the second that of a
    /// moment behind it, as long as the stage; where the control turns the state back at the end of a stage, on both sides, that of
    /// passing it, and where the surface would hold a state that comes further, that of being held. Where the controls of the stage stay on the surface, as on `u = 0` of `|u|`, they are those towards either side; where
    /// the motion jumps there, as at a lever between two gears, the first is that away from the surface and the second NaN.
    pub touch: bool,
}

/// Optimality of an answer as a point of the control problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimality {
    /// Verdict.
    pub verdict: Verdict,
    /// Why it is not known, or by what else than its derivatives.
    pub reason: &'static str,
    /// Largest share of the cost by which another answer may be cheaper, whatever its choices; NaN where that is not known.
    pub gap: f64,
    /// The largest change of the cost to first order by one quantity within its bounds, over the size of the quantity,
    /// relative to what single terms of the cost change.
    pub residual: f64,
    /// Derivatives of the cost with respect to the controls `[n_stages · nu]` (slopes, where they are linear), with the
    /// multipliers of the constraints; those at bounds included.
    pub gradient: Vec<f64>,
    /// Switches between control stages.
    pub kinks: Vec<Kink>,
    /// Changes of the controls where the answer is not optimal: `[n_stages · nu]` that lower the cost to first order, the
    /// largest of them as large as the quantity usually is. Empty otherwise, and where controls are linear.
    pub direction: Vec<f64>,
    /// Are there constraints along the path that act, or may act, with other multipliers than those of the answer?
    others: bool,
}

impl Kink {
    /// One of which derivatives towards its sides are not known.
    pub(super) fn without_derivatives(stage: usize, t: f64, touch: bool) -> Kink {
        Kink { stage, t, before: f64::NAN, after: f64::NAN, touch }
    }
}

impl Optimality {
    /// Of an answer that is the optimum of one order of events. Where `doubt` says why nothing is known of it, it is that; where no small change of
    /// the controls changes the order it is a local optimum, and else a kink, for `compared` says that the orders beside it were solved for.
    pub(super) fn of_one_order(
        doubt: Option<&'static str>,
        compared: &'static str,
        residual: f64,
        gradient: Vec<f64>,
        kinks: Vec<Kink>,
    ) -> Optimality {
        let (verdict, reason) = match doubt {
            Some(why) => (Verdict::Unknown, why),
            None if kinks.is_empty() => (Verdict::LocalOptimum, ""),
            None => (Verdict::Kink, compared),
        };
        let gap = f64::NAN;
        Optimality { verdict, reason, gap, residual, gradient, kinks, direction: Vec::new(), others: false }
    }

    /// A descent on simulations from the answer led nowhere: it is what that says, and there is no direction.
    pub(super) fn certify_by_descent(&mut self, verdict: Verdict) {
        self.verdict = verdict;
        self.reason = match verdict {
            Verdict::Unknown => "derivatives do not say that it is optimal, but a descent on simulations gains nothing",
            _ => "a descent on simulations gains nothing",
        };
        self.direction.clear();
    }

    /// Is it known to be a local optimum?
    pub(super) fn is_optimum(&self) -> bool {
        matches!(self.verdict, Verdict::LocalOptimum | Verdict::Kink | Verdict::Global)
    }

    /// What was found says nothing of the control problem, and why. A direction in which the cost falls stays one to try.
    pub(super) fn withdraw(&mut self, reason: &'static str) {
        (self.verdict, self.reason, self.gap) = (Verdict::Unknown, reason, f64::NAN);
    }

    pub(super) fn unknown(reason: &'static str) -> Optimality {
        let (gradient, kinks, direction) = Default::default();
        let (verdict, gap, residual) = (Verdict::Unknown, f64::NAN, f64::NAN);
        Optimality { verdict, reason, gap, residual, gradient, kinks, direction, others: false }
    }
}

/// A part of a stage, up to a point where constraints act on states, or to the end of the stage.
struct Piece {
    /// Derivatives of the state at its end with respect to that at its start, parameters and controls.
    s: Vec<f64>,
    /// Velocity at its end.
    rate: Vec<f64>,
    /// State variables at its end, and the share of the stage before it.
    at: StatePoint,
    /// What moves its end with the states.
    moves: Option<Moves>,
}

/// A piece that ends at a switch: where a bound acts there, it acts at the switch and not at a time, as that on a level which rises until a valve
/// opens. `nᵀ δx + n_uᵀ δu + speed · δt = 0` gives the change of the time.
struct Moves {
    /// Gradient of the surface in states and in controls.
    normal: Vec<f64>,
    controls: Vec<f64>,
    /// As that of a [`Crossing`]: the speed is that before the switch.
    arrival: Vec<f64>,
}

/// An end of a stage without its margin.
struct Edge {
    t: f64,
    x: Vec<f64>,
    rate: Vec<f64>,
    regions: Vec<bool>,
}

/// A stage between its margins.
struct Leg {
    /// Difference between its end in the simulation and in the answer, in ranges of the states.
    off: f64,
    margin: f64,
    start: Edge,
    end: Edge,
    pieces: Vec<Piece>,
}

/// A surface at which the cost has a kink.
struct Corner {
    stage: usize,
    t: f64,
    /// Gradient of the surface in states of the simulation; none of one that controls stay on.
    normal: Vec<f64>,
    /// Its gradient in the controls, and the stage of these.
    controls: Vec<f64>,
    own: usize,
    kind: Kind,
}

enum Kind {
    /// A switch between two stages: with the control before, and with the one behind; none where the surface is not reached.
    Switch { before: Option<Crossing>, after: Option<Crossing> },
    /// A surface that is touched from one side at a point: the first of its variables, and `f_B − f_A`.
    Touch { at: usize, beyond: Vec<f64> },
    /// The same at the end of the horizon, or at that of a stage, where the control turns the state back, on the other side too: by how much the state differs behind
    /// that for every unit that the surface would be passed by; none where it would not come back. Or a surface that the state is on at the
    /// start of a stage because of the control there. Or, at a point (the first of its variables), one that would hold the state for a while
    /// had it come further: it slides up to about there then.
    Peak { at: Option<usize>, beyond: Option<Vec<f64>> },
    /// A surface that the controls of a stage stay on: for every piece of the stage, by how much more the state at its end changes on the
    /// side beyond for every unit that the surface is passed by.
    Control { beyond: Vec<Vec<f64>> },
    /// A surface that the controls of a stage stay beside, and on whose other side the motion is another one: controls there, next to it.
    Jump { across: Vec<f64> },
}

/// A surface that is crossed.
struct Crossing {
    /// `(f_B − f_A) / (nᵀ f_A + W_t)`.
    jump: Vec<f64>,
    /// `f_A / (nᵀ f_A + W_t)`: what acts on the state at the switch and goes with it acts along this as well.
    arrival: Vec<f64>,
}

impl Corner {
    /// What the multiple of the gradient is compared with, in terms of the costate at a point.
    fn sides(&self) -> [Option<&[f64]>; 2] {
        match &self.kind {
            Kind::Switch { before, after } => [before, after].map(|c| c.as_ref().map(|c| &c.jump[..])),
            Kind::Touch { beyond, .. } => [None, Some(beyond)],
            Kind::Peak { beyond, .. } => [beyond.as_deref(), None],
            Kind::Control { .. } | Kind::Jump { .. } => [None, None],
        }
    }

    /// What constraints that go with the switch act along as well, on both sides.
    fn arrivals(&self) -> [Option<&[f64]>; 2] {
        match &self.kind {
            Kind::Switch { before, after } => [before, after].map(|c| c.as_ref().map(|c| &c.arrival[..])),
            _ => [None, None],
        }
    }

    /// The point at which the surface is touched, if that is neither the start nor the end of a stage.
    fn at(&self) -> Option<usize> {
        match self.kind {
            Kind::Touch { at, .. } => Some(at),
            Kind::Peak { at, .. } => at,
            _ => None,
        }
    }

    /// Is the surface touched, and not crossed?
    fn touches(&self) -> bool {
        !matches!(self.kind, Kind::Switch { .. })
    }
}

/// Which multipliers of constraints along the path an answer is judged with.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Multipliers {
    /// Those that it has.
    OfAnswer,
    /// Any that its point may have.
    Any,
}

/// By how much a state changes over the horizon, not less than a simulation is off by itself, and its largest modulus.
#[derive(Debug, Clone, Copy)]
struct Extent {
    range: f64,
    size: f64,
}

impl Extent {
    /// Of a state whose size is at least `least`.
    fn of(values: impl Iterator<Item = f64>, least: f64) -> Extent {
        let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let size = lo.abs().max(hi.abs()).max(least);
        Extent { range: (hi - lo).max(NOISE * TOLERANCE * size), size }
    }
}

/// The simulation by which an answer is judged.
struct Judge<'a> {
    engine: Engine,
    dcs: Dcs,
    w: &'a [f64],
    /// What constraints that hold all the time add to the derivatives by these, see [`Fesd::along_gradient`]: where they act at a switch they
    /// go with it.
    along: &'a [f64],
    /// By which variables do such constraints act, or may they?
    acts: &'a [bool],
    /// The state of an answer that every state of the simulation is; the cost is none.
    places: Vec<Option<usize>>,
    /// Ranges of the states of the simulation.
    ranges: Vec<f64>,
    /// Length of the horizon.
    horizon: f64,
    /// Share of the largest distance from a surface at which it is touched.
    touch: f64,
    /// Does the answer keep a distance from surfaces?
    keeps_clear: bool,
    n_p: usize,
    n_u: usize,
    /// Of every stage.
    params: Vec<f64>,
    controls: Vec<f64>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The largest modulus of a control over all stages.
fn largest_control(controls: &[f64], n_u: usize, j: usize) -> f64 {
    controls.iter().skip(j).step_by(n_u).fold(0f64, |m, v| m.max(v.abs()))
}

/// What every column of the costate says of a corner; then its gradient joins its own column.
type Sides = [Option<Vec<f64>>; 2];

/// A constraint whose multiplier may be another one than that of the answer. Those at the ends of the horizon always may: where the end lies
/// on a switching surface, the rows that keep the modes share the force with it. Those along the path may where constraints depend on each
/// other, so that many multipliers belong to one point.
struct Held {
    gradient: Vec<(usize, f64)>,
    /// Its multiplier at the answer, and how far it is from its lower and from its upper bound, nothing where it is at one.
    multiplier: f64,
    away: [f64; 2],
    /// Does it hold all the time? Where it acts at a switch it goes with it then.
    along: bool,
}

impl Held {
    /// The derivative of the constraint by a variable.
    fn by(&self, variable: usize) -> f64 {
        self.gradient.iter().filter(|g| g.0 == variable).map(|g| g.1).sum()
    }

    /// The variable that it bounds, where it is one alone, and its derivative by that.
    fn variable(&self) -> Option<(usize, f64)> {
        match self.gradient[..] {
            [one] => Some(one),
            _ => None,
        }
    }

    /// Of a row at `w`, with what its multiplier is and its bounds, where the multiplier may be another one; `sizes` are those of all variables.
    fn of(row: Row, multiplier: f64, [l, u]: [f64; 2], sizes: &[f64]) -> Option<Held> {
        // what the state can change a constraint by is its size, or else its bound
        let size = row.gradient.iter().map(|&(v, g)| (g * sizes[v]).abs()).fold(0.0, f64::max);
        let away = [(row.value - l, l), (u - row.value, u)].map(|(far, bound)| match far {
            far if bound.is_finite() && far <= AT_BOUND * bound.abs().max(size) => 0.0,
            far => far,
        });
        let acts = multiplier != 0.0 || away.contains(&0.0);
        acts.then_some(Held { gradient: row.gradient, multiplier, away, along: row.along })
    }

    /// The multipliers that it may have: with the sign of the bound that it is at, none where it is at none.
    fn signs(&self) -> [f64; 2] {
        let [low, high] = self.away.map(|far| if far == 0.0 { f64::INFINITY } else { 0.0 });
        [-low, high]
    }

    /// Takes from its multiplier what is of the other sign, and says how much that is. The square systems that answers are polished with know no signs:
    /// where constraints depend on each other some multipliers may have the wrong one.
    fn take_excess(&mut self) -> f64 {
        let [low, high] = self.signs();
        let right = self.multiplier.clamp(low, high);
        std::mem::replace(&mut self.multiplier, right) - right
    }

    /// What may be added to its multiplier.
    fn range(&self) -> [f64; 2] {
        self.signs().map(|bound| bound - self.multiplier)
    }
}

/// What acts from outside the dynamics, see [`Fesd::outer_gradient`].
struct Outer {
    gradient: Vec<f64>,
    /// The same of the costs alone.
    cost: Vec<f64>,
    /// Constraints whose multipliers may be others: first those at the ends of the horizon.
    held: Vec<Held>,
    n_ends: usize,
    /// The state that is the time.
    clock: Option<usize>,
}

impl Outer {
    /// Do constraints hold the state, whose variables begin at `at`, on a surface with the gradient `normal`? Then no change that they allow
    /// passes it.
    fn holds(&self, judge: &Judge, at: usize, normal: &[f64]) -> bool {
        let ends = &self.held[..self.n_ends];
        let of = |e: &Held, p: &Option<usize>| p.map_or(0.0, |i| e.by(at + i));
        let a = DMatrix::from_fn(normal.len(), ends.len(), |i, j| judge.ranges[i] * of(&ends[j], &judge.places[i]));
        let b = DVector::from_fn(normal.len(), |i, _| judge.ranges[i] * normal[i]);
        if ends.is_empty() || !a.iter().chain(b.iter()).all(|v| v.is_finite()) {
            return false;
        }
        let norms: Vec<f64> = a.column_iter().map(|c| c.norm()).map(|n| if n > 0.0 { n } else { 1.0 }).collect();
        let units = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] / norms[j]);
        units.clone().svd(true, true).solve(&b, RANK).is_ok_and(|c| (&units * c - &b).norm() <= SAME * b.norm())
    }
}

impl Ocp {
    /// Judges the solution in `b` by simulations of its controls.
    pub(super) fn judge(&self, r: &OcpResult, b: &mut Built) -> Result<Optimality> {
        if !r.has_exact_modes() {
            return Ok(Optimality::unknown("the modes of the answer are not exact"));
        }
        // costates follow switches between smooth parts alone
        let only_simulated = self.projected.is_some() || !b.extended.system.is_of_modes_alone();
        if only_simulated && b.extended.complementarity.is_empty() {
            return self.judge_by_descent(r, Some(b));
        }
        let found = self.judge_with(r, b, Multipliers::OfAnswer)?;
        // the program's multipliers may not be the only ones: before an answer is called none, others are looked for
        if found.verdict != Verdict::NotOptimal || !found.others {
            return Ok(found);
        }
        self.judge_with(r, b, Multipliers::Any)
    }

    /// The same, with the multipliers of constraints along the path that the answer has, or with any that belong to its point.
    fn judge_with(&self, r: &OcpResult, b: &mut Built, which: Multipliers) -> Result<Optimality> {
        let e = &b.extended;
        if !e.complementarity.is_empty() {
            return Ok(Optimality::unknown("the derivatives that judge an answer do not go through complementarities"));
        }
        let d = e.system.dims();
        let solution = b.solver.solution();
        let (w, y, z) = (solution.x.clone(), solution.y.clone(), solution.z.clone());
        let none = (vec![0.0; y.len()], vec![0.0; z.len()]);
        let mut outer = |y: &[f64], z: &[f64]| b.problem.outer_gradient(&w, y, z);
        let (cost_alone, mut gradient) = match outer(&none.0, &none.1).and_then(|cost| Ok((cost, outer(&y, &z)?))) {
            Ok(both) => both,
            Err(EvalError::Stopped) => return Err(stop::error()),
            Err(_) => return Ok(Optimality::unknown("a function of the model has no value at the answer")),
        };
        let mut along = b.problem.along_gradient(&w, &y, &z);
        let system = with_cost(&e.system, e.system.dims(), e.lagrange.as_ref(), &self.linear)?;
        let Ok(dcs) = Dcs::stewart(&system) else { return Ok(Optimality::unknown("the system has no indicators")) };
        let ramps = b.problem.ramp_places().iter().flatten();
        let places: Vec<Option<usize>> =
            std::iter::once(None).chain(ramps.map(|r| Some(*r))).chain((0..d.x).map(Some)).collect();
        let points = b.problem.state_points(&w);
        let controls = b.problem.places().1;
        let usual = b.problem.state_sizes();
        let stages = bounds::Stages {
            starts: &starts(self.t0, &r.durations),
            lengths: &r.durations,
            params: &all_params(&b.problem, &b.extended.params, d.p, &w),
            controls: &controls.iter().flat_map(|&u| w[u..u + d.u].to_vec()).collect::<Vec<f64>>(),
        };
        let cost = Extent { range: 0.0, size: self.cost_size(r.cost) };
        let extent = |p: &Option<usize>| {
            p.map_or(cost, |i| Extent::of(points.iter().map(|p| w[p.at + i]), accuracy::LITTLE * usual[i]))
        };
        let extents: Vec<Extent> = places.iter().map(extent).collect();
        let of_states = &extents[extents.len() - d.x..];
        let sizes: Vec<f64> = extents.iter().map(|e| e.size).collect();
        let tight = accuracy::tolerances(TOLERANCE, &sizes);
        let options = event::Options { sensitivity: true.into(), max_steps: MAX_STEPS, ..tight };
        let movable = self.movable(stages.controls, d.u);
        let mut var_sizes = vec![0.0; w.len()];
        for p in &points {
            of_states.iter().enumerate().for_each(|(i, e)| var_sizes[p.at + i] = e.size);
        }
        for &u in &controls {
            var_sizes[u..u + d.u].copy_from_slice(&movable.sizes);
        }
        let own = |row: Row| {
            let at = row.row;
            Held::of(row, y[at], [b.bounds.cl[at], b.bounds.cu[at]], &var_sizes)
        };
        let mut held: Vec<Held> = b.problem.end_gradients().into_iter().filter_map(own).collect();
        let n_ends = held.len();
        let mut path: Vec<Held> = b.problem.path_gradients().into_iter().filter_map(own).collect();
        path.extend(bounds_of_states(&points, &places, (&w, &z), &b.bounds, &var_sizes));
        let mut bounded = vec![false; w.len()];
        path.iter().filter_map(Held::variable).for_each(|(v, _)| bounded[v] = true);
        let kept = bounds::on_own_surfaces(&e.system, &points, (&w, &bounded), &usual, &stages);
        path.retain(|c| {
            let Some((v, g)) = c.variable().filter(|(v, _)| kept.contains(v)) else { return true };
            gradient[v] -= c.multiplier * g;
            along[v] -= if c.along { c.multiplier * g } else { 0.0 };
            false
        });
        for c in held.iter_mut().chain(&mut path) {
            let excess = c.take_excess();
            for &(v, g) in c.gradient.iter().filter(|_| excess != 0.0) {
                gradient[v] -= excess * g;
                along[v] -= if c.along { excess * g } else { 0.0 };
            }
        }
        let others = !path.is_empty();
        let mut acts: Vec<bool> = along.iter().map(|a| *a != 0.0).collect();
        if which == Multipliers::Any {
            path.iter().filter(|c| c.along).flat_map(|c| &c.gradient).for_each(|g| acts[g.0] = true);
            held.append(&mut path);
        }
        let outer = Outer { gradient, cost: cost_alone, held, n_ends, clock: b.problem.spec().dcs.clock() };
        let mut judge = Judge {
            engine: Engine::stopping_for_all(&system, &options)?,
            dcs,
            w: &w,
            along: &along,
            acts: &acts,
            // the simulation itself is no better than its tolerance
            ranges: extents.iter().map(|e| e.range).collect(),
            horizon: r.durations.iter().sum(),
            places,
            keeps_clear: b.problem.clearance().is_some(),
            touch: TOUCH + b.problem.clearance().map_or(0.0, |c| KEPT * c.share),
            n_p: d.p,
            n_u: d.u,
            params: stages.params.to_vec(),
            controls: stages.controls.to_vec(),
        };
        let first = points.first().map_or(0, |p| p.at);
        let all = points.clone();
        let mut touches = judge.touches(self.t0, &r.durations, &points)?;
        if let Some(end) = points.last() {
            touches.retain(|c| c.stage < r.durations.len() || !outer.holds(&judge, end.at, &c.normal));
        }
        let points = acting(points, (&outer.gradient, &outer.held), d.x, &touches);
        let stages = Stage::all(self.t0, &r.durations, &points, &touches);
        let Some((mut legs, mut kinks)) = judge.simulate(&stages)? else {
            return Ok(Optimality::unknown(OTHER));
        };
        let held = judge.held_on_surfaces(&system, &movable, &stages, &all, &mut legs)?;
        kinks.extend(touches.into_iter().chain(held));
        if judge.departs(self.t0, &r.durations, first, &legs, &kinks)? {
            return Ok(Optimality::unknown(OTHER));
        }
        let mut q = self.quantities(&judge, b, r, &outer, kinks.len());
        let sides = judge.sweep(&legs, &kinks, &outer, &mut q);
        let mut found = q.verdict(&kinks, &sides, &outer.held, self.system.dims().u);
        found.others = others;
        if found.verdict == Verdict::Kink {
            if let Some(direction) = self.lower_across(r, b, &kinks, &movable)? {
                (found.verdict, found.direction) = (Verdict::NotOptimal, direction);
            }
        }
        Ok(found)
    }

    /// The direction across one of the surfaces at which the cost jumps, where a simulation of the controls there costs less.
    fn lower_across(&self, r: &OcpResult, b: &Built, kinks: &[Corner], movable: &Movable) -> Result<Option<Vec<f64>>> {
        let own = self.system.dims().u;
        let across = |k: &Corner| match &k.kind {
            Kind::Jump { across } => {
                let mut moved = [r.controls.clone(), r.control_ends.clone()];
                // those that are linear move along no surface of controls
                for j in (0..own).filter(|&j| !self.linear.get(j).copied().unwrap_or(false)) {
                    moved.iter_mut().for_each(|u| u[k.own * own + j] = across[j]);
                }
                Some(moved)
            }
            _ => None,
        };
        let all: Vec<[Vec<f64>; 2]> = kinks.iter().filter_map(across).collect();
        let lower = if all.is_empty() { None } else { self.first_lower(b, r, all)? };
        Ok(lower.map(|(u, _)| {
            let mut direction: Vec<f64> = u.iter().zip(&r.controls).map(|(a, b)| a - b).collect();
            let shares = direction.iter().zip(movable.sizes[..own].iter().cycle()).map(|(d, size)| d.abs() / size);
            let largest = shares.fold(0.0, f64::max);
            direction.iter_mut().for_each(|d| *d /= largest);
            direction
        }))
    }

    /// The same, as far as there is time.
    pub(super) fn judge_in_time(&self, r: &OcpResult, b: &mut Built) -> Result<Optimality> {
        let stopped = |why: Why| Ok(Optimality::unknown(why.words()));
        if let Some(why) = stop::requested() {
            return stopped(why);
        }
        match self.judge(r, b) {
            Err(Error::Interrupted) => stopped(Why::Interrupted),
            Err(Error::OutOfTime) => stopped(Why::OutOfTime),
            r => r,
        }
    }

    /// Nothing is certified beside a simulation that contradicts it: the derivatives are those of another motion then.
    pub(super) fn withhold_verdict(&self, r: &mut OcpResult) {
        let Some(a) = r.accuracy.as_ref().filter(|a| a.contradicts(self.cost_size(r.priced))) else { return };
        let other = !a.reached() || a.large().is_some();
        let Some(o) = r.optimality.as_mut() else { return };
        let withdrawn = match o.verdict {
            Verdict::Unknown => false,
            Verdict::LocalOptimum | Verdict::Kink | Verdict::Global => true,
            // that a descent on simulations leads to less is true whatever the answer says
            Verdict::NotOptimal => other && o.reason.is_empty(),
        };
        if withdrawn {
            o.withdraw(CONTRADICTED);
        }
    }

    /// Judges the last solution, where there is one, once: the result keeps what was found.
    pub(super) fn judged(&mut self) -> Result<Option<Optimality>> {
        if let Some(o) = self.result.as_ref().and_then(|r| r.optimality.clone()) {
            return Ok(Some(o));
        }
        let (Some(mut b), Some(mut r)) = (self.built.take(), self.result.take()) else { return Ok(None) };
        let found = self.judge(&r, &mut b);
        if let Ok(o) = &found {
            r.optimality = Some(o.clone());
        }
        (self.built, self.result) = (Some(b), Some(r));
        found.map(Some)
    }

    /// Bounds of the controls, in which slacks are behind those of the user.
    fn bounds_of_controls(&self, n_u: usize) -> [Vec<f64>; 2] {
        let wide = |own: &[f64], other: f64| own.iter().copied().chain(std::iter::repeat(other)).take(n_u).collect();
        [wide(&self.u_bounds[0], 0.0), wide(&self.u_bounds[1], f64::INFINITY)]
    }

    /// Sizes and bounds of the controls.
    fn movable(&self, controls: &[f64], n_u: usize) -> Movable {
        let bounds = self.bounds_of_controls(n_u);
        let size = |j: usize| Free::new(0.0, [bounds[0][j], bounds[1][j]], largest_control(controls, n_u, j), 0).size;
        Movable { sizes: (0..n_u).map(size).collect(), bounds }
    }

    /// Everything that may change, with its bounds and what acts on it directly.
    fn quantities(&self, judge: &Judge, b: &Built, r: &OcpResult, outer: &Outer, n_kinks: usize) -> Quantities {
        // the last column is that of the cost alone
        let n = 2 + n_kinks + outer.held.len();
        let (w, problem) = (judge.w, &b.problem);
        let (own, n_u) = (self.system.dims().u, judge.n_u);
        let (x0_at, u_at) = problem.places();
        let direct = |mut f: Free, at: usize| {
            f.add(0, outer.gradient[at]);
            outer.held.iter().enumerate().for_each(|(r, e)| f.add(1 + n_kinks + r, e.by(at)));
            f.add(n - 1, outer.cost[at]);
            f
        };
        let linear = |j: usize| problem.ramp_places().get(j).copied().flatten();
        let control = |k: usize, j: usize| {
            let free = [f64::NEG_INFINITY, f64::INFINITY];
            let bounds = if linear(j).is_some() { free } else { self.bounds_of_control(k, j) };
            direct(Free::new(w[u_at[k] + j], bounds, largest_control(&judge.controls, n_u, j), n), u_at[k] + j)
        };
        let initial = |i: usize| {
            let ramp = (0..own).find(|&j| linear(j) == Some(i));
            let own = || [self.x0_bounds[0][i], self.x0_bounds[1][i]];
            let bounds = ramp.map_or_else(own, |j| self.bounds_of_control(0, j));
            direct(Free::new(w[x0_at + i], bounds, 0.0, n), x0_at + i)
        };
        let np = self.params.len();
        let param = |j: usize| match (problem.param_places()[j], &self.p_bounds) {
            (Some(at), Some([l, u])) if j < np => direct(Free::new(w[at], [l[j], u[j]], 0.0, n), at),
            (Some(at), _) => direct(Free::new(w[at], [0.0, f64::INFINITY], 0.0, n), at),
            (None, _) => Free::held(n),
        };
        let length = |value: f64| match outer.clock {
            // what the model makes of the time itself is not followed
            Some(_) => Free::held(n),
            None => Free::new(value, self.time_bounds, 0.0, n),
        };
        let horizon: f64 = r.durations.iter().sum();
        let (lengths, shares) = match self.time {
            Durations::Fixed => (Vec::new(), vec![0.0; self.n_stages]),
            Durations::Horizon => (vec![length(horizon)], r.durations.iter().map(|d| d / horizon).collect()),
            Durations::Stages => (r.durations.iter().map(|d| length(*d)).collect(), vec![1.0; self.n_stages]),
        };
        Quantities {
            controls: (0..self.n_stages)
                .flat_map(|k| (0..n_u).map(move |j| (k, j)))
                .map(|(k, j)| control(k, j))
                .collect(),
            initial: judge.places.iter().flatten().map(|&i| initial(i)).collect(),
            params: (0..judge.n_p).map(param).collect(),
            lengths,
            shares,
            states: self.least_cost(),
            lasting: r.durations.clone(),
        }
    }
}

/// The bounds of the states behind the initial one whose multipliers may be others.
fn bounds_of_states(
    points: &[StatePoint],
    places: &[Option<usize>],
    (w, z): (&[f64], &[f64]),
    bounds: &Bounds,
    sizes: &[f64],
) -> Vec<Held> {
    let states = points.iter().skip(1).flat_map(|p| places.iter().flatten().map(move |i| p.at + i));
    let row = |v: usize| Row { row: v, value: w[v], gradient: vec![(v, 1.0)], along: true };
    states.filter_map(|v| Held::of(row(v), -z[v], [bounds.xl[v], bounds.xu[v]], sizes)).collect()
}

/// The start, first points and ends of stages, and the points in between where something acts on the first `n` states, or may act, or a
/// surface is touched.
fn acting(all: Vec<StatePoint>, outer: (&[f64], &[Held]), n: usize, touches: &[Corner]) -> Vec<StatePoint> {
    let (outer, held) = outer;
    let force = |p: &StatePoint| outer[p.at..p.at + n].iter().fold(0f64, |m, v| m.max(v.abs()));
    let mut may_act = vec![false; outer.len()];
    held.iter().flat_map(|c| &c.gradient).for_each(|g| may_act[g.0] = true);
    let may_act = |p: &StatePoint| may_act[p.at..p.at + n].contains(&true);
    let largest = all.iter().map(force).fold(0.0, f64::max);
    let ends: Vec<bool> =
        (0..all.len()).map(|i| i == 0 || all.get(i + 1).is_none_or(|next| next.stage != all[i].stage)).collect();
    let first = |i: usize| i <= 1 || ends[i - 1];
    let touched = |p: &StatePoint| touches.iter().any(|c| c.at() == Some(p.at));
    let acts = |p: &StatePoint| touched(p) || may_act(p) || force(p) > NOTHING * largest;
    let kept = all.iter().enumerate().filter(|(i, p)| ends[*i] || first(*i) || acts(p));
    kept.map(|(_, p)| *p).collect()
}

/// Times at which the stages start.
fn starts(t0: f64, lengths: &[f64]) -> Vec<f64> {
    lengths.iter().scan(t0, |t, h| Some(std::mem::replace(t, *t + h))).collect()
}

/// Parameters of every stage, those that are variables as they are at `w`.
fn all_params(problem: &Fesd, given: &[f64], n: usize, w: &[f64]) -> Vec<f64> {
    let mut params = given.to_vec();
    for p in params.chunks_mut(n.max(1)) {
        p.iter_mut().zip(problem.param_places()).for_each(|(p, at)| *p = at.map_or(*p, |v| w[v]));
    }
    params
}
