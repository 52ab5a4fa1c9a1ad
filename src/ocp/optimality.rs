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
//! with the velocities under the control before (`c_b`) or behind (`c_a`). The answer is stationary if some `c` between the
//! two makes the derivatives vanish: `c_b − c` and `c − c_a` are then the derivatives of the cost towards either side.

use super::accuracy::{self, with_cost};
use super::solve::Built;
use super::{Durations, Ocp, OcpResult};
use crate::dcs::Dcs;
use crate::error::{Error, Result};
use crate::event::{self, Engine};
use crate::fesd::{Fesd, StatePoint};
use crate::func::{EvalError, Point};
use crate::mpcc::Polish;
use crate::nlp::Outcome;
use crate::stop::{self, Why};
use crate::system::SharedFunction;
use nalgebra::{DMatrix, DVector};

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
/// First-order changes, relative to those that single terms of the cost and the constraints make, that count as none: what is
/// left to gain is of the order of their square, 1e-6.
const NONE: f64 = 1e-3;
/// Distance from a bound, in units of the size of a quantity, at which it is reached.
const AT_BOUND: f64 = 1e-6;
/// Why nothing is known of an answer whose controls lead elsewhere.
pub(super) const OTHER: &str = "the simulation of the controls is not that of the answer";
/// Share of the largest distance from a surface, in terms of indicators, at which it is touched.
const TOUCH: f64 = 1e-7;
/// Share of its terms above which the speed towards a surface is one.
const SLOW: f64 = 1e-6;
/// Differences of velocities, relative to the velocities and to ranges of the states over the horizon, that count as none.
const SAME: f64 = 1e-4;
/// Singular values, relative to columns of length 1, that count as zero.
const RANK: f64 = 1e-9;
/// Share of the largest multiplier below which one acts nowhere.
const NOTHING: f64 = 1e-9;

/// What an answer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Verdict {
    /// Not known.
    Unknown = 0,
    /// No change of controls, free lengths, parameters, initial states lowers the cost to first order.
    LocalOptimum = 1,
    /// The same; switches lie between control stages, and the cost rises on either side.
    Kink = 2,
    /// Some change lowers the cost to first order.
    NotOptimal = 3,
}

impl Verdict {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Unknown => "unknown",
            Verdict::LocalOptimum => "local_optimum",
            Verdict::Kink => "kink",
            Verdict::NotOptimal => "not_optimal",
        }
    }
}

/// A switch between two control stages, or a surface that is touched without being crossed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kink {
    /// The stage behind it, or in which a surface is touched.
    pub stage: usize,
    /// Time.
    pub t: f64,
    /// Derivatives of the cost towards a switch in the stage before and in the stage behind, relative to what all controls
    /// together can do; negative where that lowers the cost, NaN where the surface is not reached under the control of that
    /// stage: then no small change leads there.
    pub before: f64,
    /// The same, behind.
    pub after: f64,
    /// No switch: the surface is touched and left again. The first derivative is then that away from it, the second that of a
    /// moment behind it, as long as the stage.
    pub touch: bool,
}

/// What is known of an answer as a point of the control problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimality {
    /// Verdict.
    pub verdict: Verdict,
    /// Why it is not known.
    pub reason: &'static str,
    /// The largest change of the cost to first order by one quantity within its bounds, over the size of the quantity,
    /// relative to what single terms change.
    pub residual: f64,
    /// Derivatives of the cost with respect to the controls `[n_stages · nu]` (slopes, where they are linear), with the
    /// multipliers of the constraints; those at bounds included.
    pub gradient: Vec<f64>,
    /// Switches between control stages.
    pub kinks: Vec<Kink>,
    /// Where the answer is not optimal: changes of the controls `[n_stages · nu]` that lower the cost to first order, the
    /// largest of them as large as the quantity usually is. Empty otherwise, and where controls are linear.
    pub direction: Vec<f64>,
}

impl Optimality {
    fn unknown(reason: &'static str) -> Optimality {
        let (gradient, kinks, direction) = Default::default();
        Optimality { verdict: Verdict::Unknown, reason, residual: f64::NAN, gradient, kinks, direction }
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
    margin: f64,
    start: Edge,
    end: Edge,
    pieces: Vec<Piece>,
}

/// A surface at which the cost has a kink.
struct Corner {
    stage: usize,
    t: f64,
    /// Gradient of the surface, in states of the simulation.
    normal: Vec<f64>,
    kind: Kind,
}

enum Kind {
    /// A switch between two stages: `(f_B − f_A) / (nᵀ f_A + W_t)` with the control before, and with the one behind; none
    /// where the surface is not reached.
    Switch { before: Option<Vec<f64>>, after: Option<Vec<f64>> },
    /// A surface that is touched from one side at a point: the first of its variables, and `f_B − f_A`.
    Touch { at: usize, beyond: Vec<f64> },
}

impl Corner {
    /// What the multiple of the gradient is compared with.
    fn sides(&self) -> [Option<&[f64]>; 2] {
        match &self.kind {
            Kind::Switch { before, after } => [before.as_deref(), after.as_deref()],
            Kind::Touch { beyond, .. } => [None, Some(beyond)],
        }
    }
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

/// A quantity that may change, with the derivatives of the Lagrange function: the first column is that with the multipliers
/// of the answer, the others are what a unit more of something adds: of a kink's gradient to the costate, then of the
/// multiplier of a constraint at the ends.
struct Free {
    slopes: Vec<f64>,
    /// Sum of the moduli of the terms of the first.
    terms: f64,
    size: f64,
    /// At its lower bound, at its upper one.
    held: [bool; 2],
}

impl Free {
    fn new(value: f64, bounds: [f64; 2], usual: f64, n: usize) -> Free {
        let [l, u] = bounds;
        let size = match (l.is_finite() && u.is_finite(), value.abs().max(usual)) {
            (true, _) => 0.5 * (u - l),
            (false, v) if v > 0.0 => v,
            _ => 1.0,
        };
        Free {
            slopes: vec![0.0; n],
            terms: 0.0,
            size,
            held: [value <= l + AT_BOUND * size, value >= u - AT_BOUND * size],
        }
    }

    /// What may not change.
    fn held(n: usize) -> Free {
        Free { slopes: vec![0.0; n], terms: 0.0, size: 0.0, held: [true; 2] }
    }

    fn add(&mut self, column: usize, term: f64) {
        self.slopes[column] += term;
        if column == 0 {
            self.terms += term.abs();
        }
    }

    /// The slope along `c`, as far as bounds let it be followed, over its size.
    fn left(&self, c: &[f64]) -> f64 {
        let g = self.slopes[0] + c.iter().zip(&self.slopes[1..]).map(|(c, s)| c * s).sum::<f64>();
        let g = if self.held[0] { g.min(0.0) } else { g };
        self.size * if self.held[1] { g.max(0.0) } else { g }
    }
}

/// The simulation by which an answer is judged.
struct Judge<'a> {
    engine: Engine,
    dcs: Dcs,
    w: &'a [f64],
    /// The state of an answer that every state of the simulation is; the cost is none.
    places: Vec<Option<usize>>,
    /// Ranges of the states of the simulation.
    ranges: Vec<f64>,
    n_p: usize,
    n_u: usize,
    /// Of every stage.
    params: Vec<f64>,
    controls: Vec<f64>,
}

impl Judge<'_> {
    /// Number of states of the simulation.
    fn n(&self) -> usize {
        self.places.len()
    }

    /// The state of the answer where its variables begin at `at`.
    fn state(&self, at: usize) -> Vec<f64> {
        self.places.iter().map(|p| p.map_or(0.0, |i| self.w[at + i])).collect()
    }

    fn start(&mut self, t: f64, x: &[f64], stage: usize, control: usize) -> Result<()> {
        self.engine.reinit(t, x)?;
        self.engine.set_params(&self.params[stage * self.n_p..(stage + 1) * self.n_p])?;
        self.engine.set_controls(&self.controls[control * self.n_u..(control + 1) * self.n_u])
    }

    fn advance(&mut self, t: f64) -> Result<bool> {
        stop::check()?;
        let reached = matches!(self.engine.advance(t)?, event::Outcome::Reached);
        stop::check()?;
        Ok(reached)
    }

    /// Velocity under the control of another stage, a little behind `t`.
    fn velocity(
        &mut self,
        (t, x): (f64, &[f64]),
        stage: usize,
        control: usize,
        little: f64,
    ) -> Result<Option<Vec<f64>>> {
        self.start(t, x, stage, control)?;
        Ok(self.advance(t + little)?.then(|| self.engine.derivative().to_vec()))
    }

    /// Gradient of the surface between two regions and its derivative with respect to time: what is positive where the
    /// second one is active.
    fn surface(&self, from: usize, to: usize, t: f64, x: &[f64], stage: usize) -> Option<(Vec<f64>, f64)> {
        let form = self.dcs.form();
        let row = |c: usize| form.rows.iter().find(|r| r.lambda.iter().any(|l| l.0 == c));
        let (a, b) = (row(from)?, row(to)?);
        let f = form.sources.get(a.source).filter(|_| a.source == b.source)?;
        let first = self.n() - self.dcs.dims().x;
        let d = f.dims();
        let p = &self.params[stage * self.n_p..(stage + 1) * self.n_p];
        let u = vec![0.0; d.u];
        let pattern = f.jac_pattern();
        let mut jac = vec![0.0; pattern.nnz()];
        f.jacobian(&Point { t, x: &x[first..], u: &u, p }, &mut jac, &mut vec![0.0; f.work_len()]).ok()?;
        let weights: Vec<f64> = a.weights.iter().zip(&b.weights).map(|(a, b)| a - b).collect();
        let column = |j: usize| pattern.rows(j).iter().zip(&jac[pattern.range(j)]).map(|(&i, v)| weights[i] * v).sum();
        let normal = (0..self.n()).map(|i| i.checked_sub(first).map_or(0.0, column)).collect();
        Some((normal, column(d.t_col())))
    }
}

impl Judge<'_> {
    /// Simulates a stage between the points `points` of the answer, the first of which is its start. `None` where the
    /// simulation is not that of the answer.
    fn leg(&mut self, k: usize, t0: f64, length: f64, points: &[StatePoint]) -> Result<Option<Leg>> {
        let [first, inner @ ..] = points else { return Ok(None) };
        let (Some(next), Some(last)) = (inner.first(), inner.last()) else { return Ok(None) };
        let (x0, x1) = (self.state(first.at), self.state(last.at));
        // a state on a surface may go on to either side: that of the answer is where its next point is
        let toward = |share: f64| -> Vec<f64> {
            let part = (share / next.share.max(share)).min(1.0);
            x0.iter().zip(self.state(next.at)).map(|(a, b)| a + part * (b - a)).collect()
        };
        let (near, ahead) = (toward(MARGIN[0]), toward(0.5 * MARGIN[1]));
        self.start(t0 + MARGIN[0] * length, &near, k, k)?;
        if !self.advance(t0 + length)? {
            return Ok(None);
        }
        let off = self.off(&x1);
        if off.is_nan() || off > OFF {
            return Ok(None);
        }
        // where the answer and the simulation differ their switches do too: the margin is as wide
        let share = (DOUBT * off).clamp(MARGIN[0], MARGIN[1]);
        let part = 0.5 * share / (0.5 * MARGIN[1]);
        let near: Vec<f64> = x0.iter().zip(&ahead).map(|(a, b)| a + part * (b - a)).collect();
        self.start(t0 + 0.5 * length * share, &near, k, k)?;
        if !self.advance(t0 + length * share)? {
            return Ok(None);
        }
        let start = self.edge();
        let mut pieces: Vec<Piece> = Vec::with_capacity(inner.len());
        for p in inner {
            let (x, here) = (self.engine.state().to_vec(), self.engine.time());
            self.start(here, &x, k, k)?;
            let to = t0 + length * p.share.clamp(share, 1.0 - share);
            if to > here && !self.advance(to)? {
                return Ok(None);
            }
            let Some(s) = self.engine.sensitivity() else { return Ok(None) };
            let rate = if to > here { self.engine.derivative() } else { &start.rate };
            pieces.push(Piece { s: s.to_vec(), rate: rate.to_vec(), at: *p });
        }
        Ok(Some(Leg { margin: length * share, start, end: self.edge(), pieces }))
    }

    fn edge(&self) -> Edge {
        let mut regions = vec![false; self.dcs.n_cells()];
        self.engine.cells_of_step().for_each(|c| regions[c] = true);
        let (x, rate) = (self.engine.state().to_vec(), self.engine.derivative().to_vec());
        Edge { t: self.engine.time(), x, rate, regions }
    }

    /// Largest difference of the simulated state from `x`, in ranges of the states.
    fn off(&self, x: &[f64]) -> f64 {
        let pairs = self.engine.state().iter().zip(x).zip(&self.ranges);
        pairs
            .filter(|(_, r)| **r > 0.0)
            .fold(0.0, |m, ((a, b), r)| if m >= (a - b).abs() / r { m } else { (a - b).abs() / r })
    }

    /// Indicators of all cells at a point, less the smallest of their subsystem.
    fn distances(&self, t: f64, x: &[f64], stage: usize) -> Option<Vec<f64>> {
        let form = self.dcs.form();
        let p = &self.params[stage * self.n_p..(stage + 1) * self.n_p];
        let at = |f: &SharedFunction| {
            let mut out = vec![0.0; f.n_out()];
            let u = vec![0.0; f.dims().u];
            f.value(&Point { t, x, u: &u, p }, &mut out, &mut vec![0.0; f.work_len()]).ok().map(|()| out)
        };
        let values: Vec<Vec<f64>> = form.sources.iter().map(at).collect::<Option<_>>()?;
        let mut out = vec![0.0; form.n_cells];
        for r in &form.rows {
            let g = dot(&r.weights, &values[r.source]);
            r.lambda.iter().for_each(|&(c, _)| out[c] = g);
        }
        for cells in &form.simplices {
            let least = out[cells.clone()].iter().copied().fold(f64::INFINITY, f64::min);
            out[cells.clone()].iter_mut().for_each(|g| *g -= least);
        }
        Some(out)
    }

    /// Surfaces that the states touch at one of the points and leave to the side they came from, where the velocity on the
    /// other side is another one.
    fn touches(&mut self, t0: f64, lengths: &[f64], points: &[StatePoint]) -> Result<Vec<Corner>> {
        let starts: Vec<f64> = lengths.iter().scan(t0, |t, h| Some(std::mem::replace(t, *t + h))).collect();
        let time = |p: &StatePoint| starts[p.stage] + p.share * lengths[p.stage];
        let mut all: Vec<(StatePoint, Vec<f64>)> = Vec::with_capacity(points.len());
        for p in points {
            let apart = all.last().is_none_or(|(q, _)| time(p) - time(q) > MARGIN[0] * lengths[p.stage]);
            if let Some(d) = self.distances(time(p), &self.state(p.at), p.stage).filter(|_| apart) {
                all.push((*p, d));
            }
        }
        let n = self.dcs.n_cells();
        let scale: Vec<f64> = (0..n).map(|c| all.iter().fold(0.0, |m, (_, d)| d[c].max(m))).collect();
        let mut out = Vec::new();
        for cells in self.dcs.form().simplices.clone() {
            for c in cells.clone() {
                let near = |i: usize| all[i].1[c] <= TOUCH * scale[c];
                let active = |i: usize| cells.clone().find(|&a| all[i].1[a] == 0.0);
                for i in 1..all.len().saturating_sub(1) {
                    let alone = near(i) && !near(i - 1) && !near(i + 1);
                    let Some(a) = active(i - 1).filter(|a| alone && *a != c && active(i + 1) == Some(*a)) else {
                        continue;
                    };
                    let (p, t) = (all[i].0, time(&all[i].0));
                    if let Some(corner) = self.touch(p, t, (a, c), scale[c], lengths)? {
                        out.push(corner);
                    }
                }
            }
        }
        Ok(out)
    }

    /// A touched surface between the regions `of`; none where the velocity is the same on both sides.
    fn touch(
        &mut self,
        p: StatePoint,
        t: f64,
        of: (usize, usize),
        scale: f64,
        lengths: &[f64],
    ) -> Result<Option<Corner>> {
        let x = self.state(p.at);
        let Some((normal, _)) = self.surface(of.0, of.1, t, &x, p.stage) else { return Ok(None) };
        let step = TOUCH * scale / dot(&normal, &normal);
        let little = MARGIN[0] * lengths[p.stage];
        let mut beside = |sign: f64| {
            let moved: Vec<f64> = x.iter().zip(&normal).map(|(x, n)| x + sign * step * n).collect();
            self.velocity((t, &moved), p.stage, p.stage, little)
        };
        let (Some(there), Some(here)) = (beside(1.0)?, beside(-1.0)?) else { return Ok(None) };
        let beyond: Vec<f64> = there.iter().zip(&here).map(|(b, a)| b - a).collect();
        let horizon: f64 = lengths.iter().sum();
        // the cost has no range: its rate is compared with itself
        let usual = |i: usize| (self.ranges[i] / horizon).max(there[i].abs().max(here[i].abs()));
        if !beyond.iter().enumerate().any(|(i, f)| f.abs() > SAME * usual(i)) {
            return Ok(None);
        }
        Ok(Some(Corner { stage: p.stage, t, normal, kind: Kind::Touch { at: p.at, beyond } }))
    }

    /// The switches between two stages: regions that are active behind, and were not before.
    fn between(&mut self, k: usize, before: &Leg, behind: &Leg) -> Result<Vec<Corner>> {
        let simplices = self.dcs.form().simplices.clone();
        let mut out = Vec::new();
        for cells in simplices {
            let (a, b) = (&before.end.regions, &behind.start.regions);
            let Some(to) = cells.clone().find(|&c| b[c] && !a[c]) else { continue };
            let Some(from) = cells.clone().find(|&c| a[c] && !b[c]).or_else(|| cells.clone().find(|&c| a[c])) else {
                continue;
            };
            let Some((normal, moves)) = self.surface(from, to, before.end.t, &before.end.x, k - 1) else { continue };
            let over = |fa: &[f64], fb: &[f64]| -> Option<Vec<f64>> {
                let v = dot(&normal, fa) + moves;
                let terms = normal.iter().zip(fa).map(|(n, f)| (n * f).abs()).sum::<f64>() + moves.abs();
                (v > SLOW * terms).then(|| fa.iter().zip(fb).map(|(a, b)| (b - a) / v).collect())
            };
            let little = 0.1 * before.margin.min(behind.margin);
            let (end, start) = (&before.end, &behind.start);
            let new_before = self.velocity((start.t, &start.x), k, k - 1, little)?;
            let old_behind = self.velocity((end.t, &end.x), k - 1, k, little)?;
            let kind = Kind::Switch {
                before: new_before.and_then(|fb| over(&before.end.rate, &fb)),
                after: old_behind.and_then(|fa| over(&fa, &behind.start.rate)),
            };
            out.push(Corner { stage: k, t: 0.5 * (before.end.t + behind.start.t), normal, kind });
        }
        Ok(out)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// All quantities that may change.
struct Quantities {
    /// Controls `[n_stages · nu]`.
    controls: Vec<Free>,
    /// Initial values of the states of the simulation behind the cost.
    initial: Vec<Free>,
    /// Parameters `[np]`.
    params: Vec<Free>,
    /// Lengths of the stages, or of the horizon.
    lengths: Vec<Free>,
    /// Share of every stage in its length.
    shares: Vec<f64>,
    /// Largest change of the cost by one state that changes by its range.
    states: f64,
    /// Lengths of the stages.
    lasting: Vec<f64>,
}

impl Quantities {
    /// What the length of a stage is, and its share in that.
    fn length(&mut self, stage: usize) -> Option<(&mut Free, f64)> {
        let at = if self.lengths.len() == 1 { 0 } else { stage };
        let share = self.shares[stage];
        self.lengths.get_mut(at).map(|l| (l, share))
    }

    fn all(&self) -> impl Iterator<Item = &Free> {
        self.controls.iter().chain(&self.initial).chain(&self.params).chain(&self.lengths)
    }

    /// Multiples `c [n]` of the columns, as small as they can be within `range`, that leave least of the slopes.
    fn fit(&self, range: &[[f64; 2]]) -> Vec<f64> {
        let n = range.len();
        let mut c = vec![0.0; n];
        let mut fixed = vec![false; n];
        // what a bound holds back may not be fitted: it joins where the rest pulls it away from the bound
        let mut rows: Vec<&Free> = self.all().filter(|f| f.held == [false; 2]).collect();
        for _ in 0..=n + self.controls.len() {
            let open: Vec<usize> = (0..n).filter(|&j| !fixed[j]).collect();
            if open.is_empty() || rows.is_empty() {
                break;
            }
            let slope = |f: &Free, j: usize| f.size * f.slopes[j + 1];
            let norm = |j: usize| rows.iter().map(|f| slope(f, j).powi(2)).sum::<f64>().sqrt();
            let units: Vec<f64> = open.iter().map(|&j| Some(norm(j)).filter(|n| *n > 0.0).unwrap_or(1.0)).collect();
            let a = DMatrix::from_fn(rows.len(), open.len(), |i, j| slope(rows[i], open[j]) / units[j]);
            let held = |f: &Free| (0..n).filter(|&j| fixed[j]).map(|j| c[j] * slope(f, j)).sum::<f64>();
            let b = DVector::from_fn(rows.len(), |i, _| -rows[i].size * rows[i].slopes[0] - held(rows[i]));
            let Ok(found) = a.svd(true, true).solve(&b, RANK) else { break };
            open.iter().zip(found.iter().zip(&units)).for_each(|(&j, (v, u))| c[j] = v / u);
            let outside = |j: usize| (range[j][0] - c[j]).max(c[j] - range[j][1]);
            let worst = open.iter().copied().max_by(|&i, &j| outside(i).total_cmp(&outside(j)));
            if let Some(j) = worst.filter(|&j| outside(j) > 0.0) {
                c[j] = c[j].clamp(range[j][0], range[j][1]);
                fixed[j] = true;
                continue;
            }
            let known = rows.len();
            let pulled = self.all().filter(|f| f.held != [false; 2] && f.held != [true; 2] && f.left(&c).abs() > 0.0);
            let more: Vec<&Free> = pulled.filter(|f| !rows.iter().any(|r| std::ptr::eq(*r, *f))).collect();
            rows.extend(more);
            if rows.len() == known {
                break;
            }
        }
        c
    }
}

impl Judge<'_> {
    /// Simulates all stages. `None` where that does not lead to the states of the answer.
    fn simulate(&mut self, t0: f64, lengths: &[f64], points: &[StatePoint]) -> Result<Option<(Vec<Leg>, Vec<Corner>)>> {
        let (mut legs, mut kinks): (Vec<Leg>, Vec<Corner>) = (Vec::new(), Vec::new());
        let (mut t, mut first) = (t0, 0);
        for (k, &length) in lengths.iter().enumerate() {
            let last = points.iter().rposition(|p| p.stage == k).unwrap_or(first);
            let Some(leg) = self.leg(k, t, length, &points[first..=last])? else { return Ok(None) };
            if let Some(before) = legs.last() {
                kinks.extend(self.between(k, before, &leg)?);
            }
            legs.push(leg);
            (t, first) = (t + length, last);
        }
        Ok(Some((legs, kinks)))
    }

    /// Sweeps backwards through the stages and adds up the slopes of all quantities. Returns for every kink what every
    /// column of the costate behind it says of the multiple of its gradient that the costate jumps by: with the switch in
    /// the stage before, and in the one behind.
    fn sweep(&self, legs: &[Leg], kinks: &[Corner], outer: &Outer, q: &mut Quantities) -> Vec<Sides> {
        let (n, n_z) = (self.n(), self.n() + self.n_p + self.n_u);
        let mut columns = vec![vec![0.0; n]; 1 + kinks.len() + outer.ends.len()];
        columns[0][0] = 1.0;
        // what shifts everything behind by a unit of time
        let mut clock = 0.0;
        let mut sides = vec![[None, None]; kinks.len()];
        for (k, leg) in legs.iter().enumerate().rev() {
            for (m, piece) in leg.pieces.iter().enumerate().rev() {
                let force: Vec<Vec<f64>> =
                    (0..columns.len()).map(|c| self.force(outer, c, kinks.len(), piece)).collect();
                for (i, b) in kinks.iter().enumerate() {
                    if matches!(b.kind, Kind::Touch { at, .. } if at == piece.at.at) {
                        pass(&mut columns, i, b, &mut sides[i]);
                    }
                }
                columns.iter_mut().zip(&force).for_each(|(l, f)| l.iter_mut().zip(f).for_each(|(l, f)| *l += f));
                let late = outer.clock.map_or(0.0, |c| outer.gradient[piece.at.at + c]);
                let end = m + 1 == leg.pieces.len();
                if let Some((length, share)) = q.length(k) {
                    for (c, (column, force)) in columns.iter().zip(&force).enumerate() {
                        let (moved, part) = if end { (column, 1.0) } else { (force, piece.at.share) };
                        length.add(c, share * part * dot(moved, &piece.rate));
                    }
                    length.add(0, share * if end { clock + late } else { piece.at.share * late });
                }
                clock += late;
                for (c, column) in columns.iter_mut().enumerate() {
                    let mut back = vec![0.0; n];
                    for (row, l) in piece.s.chunks_exact(n_z).zip(column.iter()).filter(|r| *r.1 != 0.0) {
                        back.iter_mut().zip(row).for_each(|(b, s)| *b += l * s);
                        q.params.iter_mut().zip(&row[n..]).for_each(|(p, s)| p.add(c, l * s));
                        let own = &mut q.controls[k * self.n_u..(k + 1) * self.n_u];
                        own.iter_mut().zip(&row[n + self.n_p..]).for_each(|(u, s)| u.add(c, l * s));
                    }
                    *column = back;
                }
                let change = |(l, r): (&f64, &f64)| (l * r).abs();
                q.states = columns[0].iter().zip(&self.ranges).map(change).fold(q.states, f64::max);
            }
            for (i, b) in
                kinks.iter().enumerate().filter(|(_, b)| b.stage == k && matches!(b.kind, Kind::Switch { .. }))
            {
                pass(&mut columns, i, b, &mut sides[i]);
            }
        }
        for (c, column) in columns.iter().enumerate() {
            q.initial.iter_mut().zip(&column[1..]).for_each(|(x, l)| x.add(c, *l));
        }
        sides
    }

    /// What acts on the states at the end of a piece in a column.
    fn force(&self, outer: &Outer, column: usize, n_kinks: usize, piece: &Piece) -> Vec<f64> {
        let gradient = match column.checked_sub(1 + n_kinks) {
            Some(r) => &outer.ends[r].gradient,
            None if column == 0 => &outer.gradient,
            None => return vec![0.0; self.n()],
        };
        self.places.iter().map(|p| p.map_or(0.0, |i| gradient[piece.at.at + i])).collect()
    }
}

/// What every column of the costate says of a corner; then its gradient joins its own column.
type Sides = [Option<Vec<f64>>; 2];

fn pass(columns: &mut [Vec<f64>], i: usize, corner: &Corner, sides: &mut Sides) {
    *sides = corner.sides().map(|of| of.map(|jump| columns.iter().map(|l| dot(jump, l)).collect()));
    columns[1 + i].iter_mut().zip(&corner.normal).for_each(|(l, n)| *l += n);
}

/// A constraint at the ends of the horizon whose multiplier may be another one than that of the answer: where the end lies
/// on a switching surface, the rows that keep the modes share the force with it.
struct End {
    gradient: Vec<f64>,
    /// What may be added to its multiplier.
    range: [f64; 2],
}

impl Quantities {
    /// What the slopes say; `ends` is what may be added to the multipliers of constraints at the ends, `own` controls of
    /// every stage are the user's.
    fn verdict(&self, kinks: &[Corner], sides: &[Sides], ends: &[[f64; 2]], own: usize) -> Optimality {
        let scale = self.all().fold(self.states, |m, f| m.max(f.size * f.terms)).max(f64::MIN_POSITIVE);
        let left = |c: &[f64]| self.all().fold(0f64, |m, f| m.max(f.left(c).abs())) / scale;
        let any = [f64::NEG_INFINITY, f64::INFINITY];
        // at a touched surface the multiplier of staying on this side is not negative
        let stays = |k: &Corner| if matches!(k.kind, Kind::Touch { .. }) { [0.0, f64::INFINITY] } else { any };
        let mut range: Vec<[f64; 2]> = kinks.iter().map(stays).collect();
        range.extend_from_slice(ends);
        let jump = |of: &Option<Vec<f64>>, c: &[f64]| of.as_ref().map(|s| s[0] + dot(&s[1..], c));
        let mut c = self.fit(&range);
        // where several multiples do, one between the two sides is wanted
        for i in (0..kinks.len()).rev().filter(|&i| matches!(kinks[i].kind, Kind::Switch { .. })) {
            let [before, after] = [jump(&sides[i][0], &c), jump(&sides[i][1], &c)];
            let (high, low) = (before.unwrap_or(f64::INFINITY), after.unwrap_or(f64::NEG_INFINITY));
            if low <= high && !(low..=high).contains(&c[i]) {
                range[i] = [low, high];
                let other = self.fit(&range);
                if left(&other) > NONE.max(left(&c)) {
                    range[i] = any;
                } else {
                    c = other;
                }
            }
        }
        let residual = left(&c);
        let found: Vec<Kink> = kinks
            .iter()
            .zip(sides)
            .enumerate()
            .map(|(i, (b, side))| {
                let reach = self.all().map(|f| f.size * f.slopes[1 + i].abs()).sum::<f64>() / scale;
                let towards = |s: Option<f64>, sign: f64| s.map_or(f64::NAN, |s| sign * (s - c[i]) * reach);
                let touch = matches!(b.kind, Kind::Touch { .. });
                let [before, after] = match touch {
                    true => [c[i] * reach, jump(&side[1], &c).map_or(f64::NAN, |s| s * self.lasting[b.stage] / scale)],
                    false => [towards(jump(&side[0], &c), 1.0), towards(jump(&side[1], &c), -1.0)],
                };
                Kink { stage: b.stage, t: b.t, before, after, touch }
            })
            .collect();
        let falls = |k: &Kink| k.before < -NONE || k.after < -NONE;
        let (verdict, reason) = if !residual.is_finite() {
            (Verdict::Unknown, "the derivatives are not finite")
        } else if residual > NONE || found.iter().any(falls) {
            (Verdict::NotOptimal, "")
        } else if found.is_empty() {
            (Verdict::LocalOptimum, "")
        } else {
            (Verdict::Kink, "")
        };
        let all = (self.controls.len() / self.shares.len()).max(1);
        let users = || self.controls.iter().enumerate().filter(|(i, _)| i % all < own).map(|(_, f)| f);
        let worst =
            found.iter().enumerate().map(|(i, k)| (i, k.before.min(k.after))).min_by(|a, b| a.1.total_cmp(&b.1));
        let mut direction: Vec<f64> = match worst.filter(|w| residual <= NONE && w.1 < -NONE) {
            // towards the side of the kink that is lower: the surface is reached earlier, or later
            Some((i, low)) => {
                let sign = if found[i].touch || found[i].before == low { 1.0 } else { -1.0 };
                users().map(|f| sign * f.size * f.size * f.slopes[1 + i]).collect()
            }
            None => users().map(|f| -f.size * f.left(&c)).collect(),
        };
        let largest = direction.iter().zip(users()).map(|(d, f)| if f.size > 0.0 { d.abs() / f.size } else { 0.0 });
        let largest = largest.fold(0.0, f64::max);
        if verdict != Verdict::NotOptimal || !(largest > 0.0 && largest.is_finite()) {
            direction.clear();
        }
        direction.iter_mut().for_each(|d| *d /= largest);
        let gradient = users().map(|f| f.slopes[0] + dot(&c, &f.slopes[1..])).collect();
        Optimality { verdict, reason, residual, gradient, kinks: found, direction }
    }
}

/// What acts from outside the dynamics, see [`Fesd::outer_gradient`].
struct Outer {
    gradient: Vec<f64>,
    ends: Vec<End>,
    /// The state that is the time.
    clock: Option<usize>,
}

impl Ocp {
    /// Judges the solution in `b` by simulations of its controls.
    pub(super) fn judge(&self, r: &OcpResult, b: &mut Built) -> Result<Optimality> {
        let exact = r.polish == Polish::Done || r.dimensions.2 == 0;
        if r.outcome != Outcome::Solved || !exact {
            return Ok(Optimality::unknown("the modes of the answer are not exact"));
        }
        let e = &b.extended;
        if e.system.n_algebraic() > 0 || !e.system.inclusions().is_empty() || !e.complementarity.is_empty() {
            return Ok(Optimality::unknown(
                "problems with algebraic equations or inclusions are not simulated by events",
            ));
        }
        let d = e.system.dims();
        let solution = b.solver.solution();
        let (w, y, z) = (solution.x.clone(), solution.y.clone(), solution.z.clone());
        let gradient = match b.problem.outer_gradient(&w, &y, &z) {
            Ok(g) => g,
            Err(EvalError::Stopped) => return Err(stop::error()),
            Err(_) => return Ok(Optimality::unknown("a function of the model has no value at the answer")),
        };
        let system = with_cost(&e.system, e.lagrange.as_ref(), &self.linear)?;
        let Ok(dcs) = Dcs::stewart(&system) else { return Ok(Optimality::unknown("the system has no indicators")) };
        let ramps = b.problem.ramp_places().iter().flatten();
        let places: Vec<Option<usize>> =
            std::iter::once(None).chain(ramps.map(|r| Some(*r))).chain((0..d.x).map(Some)).collect();
        let points = b.problem.state_points(&w);
        let controls = b.problem.places().1;
        let usual = b.problem.state_sizes();
        let cost = Extent { range: 0.0, size: if r.cost != 0.0 { r.cost.abs() } else { 1.0 } };
        let extent = |p: &Option<usize>| {
            p.map_or(cost, |i| Extent::of(points.iter().map(|p| w[p.at + i]), accuracy::LITTLE * usual[i]))
        };
        let extents: Vec<Extent> = places.iter().map(extent).collect();
        let of_states = &extents[extents.len() - d.x..];
        let sizes: Vec<f64> = extents.iter().map(|e| e.size).collect();
        let tight = accuracy::tolerances(TOLERANCE, &sizes);
        let options = event::Options { sensitivity: true, max_steps: MAX_STEPS, ..tight };
        let ends = b.problem.end_gradients().into_iter().filter_map(|(row, value, gradient)| {
            let (l, u) = (b.bounds.cl[row], b.bounds.cu[row]);
            // what the state can change a constraint by is its size, or else its bound
            let change = |p: &StatePoint| {
                of_states.iter().enumerate().map(|(i, e)| (gradient[p.at + i] * e.size).abs()).fold(0.0, f64::max)
            };
            let size = points.iter().map(change).fold(0.0, f64::max);
            // of an inequality the multiplier keeps its sign
            let at = |bound: f64| (value - bound).abs() <= AT_BOUND * bound.abs().max(size);
            let low = if at(l) { f64::NEG_INFINITY } else { -y[row].max(0.0) };
            let high = if at(u) { f64::INFINITY } else { -y[row].min(0.0) };
            (low < high).then_some(End { gradient, range: [low, high] })
        });
        let outer = Outer { gradient, ends: ends.collect(), clock: b.problem.spec().dcs.clock() };
        let mut judge = Judge {
            engine: Engine::new(&system, &options)?,
            dcs,
            w: &w,
            // the simulation itself is no better than its tolerance
            ranges: extents.iter().map(|e| e.range).collect(),
            places,
            n_p: d.p,
            n_u: d.u,
            params: all_params(&b.problem, &b.extended.params, d.p, &w),
            controls: controls.iter().flat_map(|&u| w[u..u + d.u].to_vec()).collect(),
        };
        let touches = judge.touches(self.t0, &r.durations, &points)?;
        let points = acting(points, &outer.gradient, d.x, &touches);
        let Some((legs, mut kinks)) = judge.simulate(self.t0, &r.durations, &points)? else {
            return Ok(Optimality::unknown(OTHER));
        };
        kinks.extend(touches);
        let mut q = self.quantities(&judge, b, r, &outer, kinks.len());
        let sides = judge.sweep(&legs, &kinks, &outer, &mut q);
        let ranges: Vec<[f64; 2]> = outer.ends.iter().map(|e| e.range).collect();
        Ok(q.verdict(&kinks, &sides, &ranges, self.system.dims().u))
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

    /// Judges the last solution, where there is one.
    pub(super) fn judged(&mut self) -> Result<Option<Optimality>> {
        let (Some(mut b), Some(r)) = (self.built.take(), self.result.take()) else { return Ok(None) };
        let found = self.judge(&r, &mut b);
        (self.built, self.result) = (Some(b), Some(r));
        found.map(Some)
    }

    /// Everything that may change, with its bounds and what acts on it directly.
    fn quantities(&self, judge: &Judge, b: &Built, r: &OcpResult, outer: &Outer, n_kinks: usize) -> Quantities {
        let n = 1 + n_kinks + outer.ends.len();
        let (w, problem) = (judge.w, &b.problem);
        let (own, n_u) = (self.system.dims().u, judge.n_u);
        let (x0_at, u_at) = problem.places();
        let direct = |mut f: Free, at: usize| {
            f.add(0, outer.gradient[at]);
            outer.ends.iter().enumerate().for_each(|(r, e)| f.add(1 + n_kinks + r, e.gradient[at]));
            f
        };
        let linear = |j: usize| problem.ramp_places().get(j).copied().flatten();
        let control_bounds = |j: usize| match j < own {
            true => [self.u_bounds[0][j], self.u_bounds[1][j]],
            false => [0.0, f64::INFINITY],
        };
        let largest = |j: usize| judge.controls.iter().skip(j).step_by(n_u).fold(0f64, |m, v| m.max(v.abs()));
        let control = |k: usize, j: usize| {
            let bounds = if linear(j).is_some() { [f64::NEG_INFINITY, f64::INFINITY] } else { control_bounds(j) };
            direct(Free::new(w[u_at[k] + j], bounds, largest(j), n), u_at[k] + j)
        };
        let initial = |i: usize| {
            let ramp = (0..own).find(|&j| linear(j) == Some(i));
            let bounds = ramp.map_or_else(|| [self.x0_bounds[0][i], self.x0_bounds[1][i]], control_bounds);
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
            states: 0.0,
            lasting: r.durations.clone(),
        }
    }
}

/// The start, first points and ends of stages, and the points in between where something acts on the first `n` states or a
/// surface is touched.
fn acting(all: Vec<StatePoint>, outer: &[f64], n: usize, touches: &[Corner]) -> Vec<StatePoint> {
    let force = |p: &StatePoint| outer[p.at..p.at + n].iter().fold(0f64, |m, v| m.max(v.abs()));
    let largest = all.iter().map(force).fold(0.0, f64::max);
    let ends: Vec<bool> =
        (0..all.len()).map(|i| i == 0 || all.get(i + 1).is_none_or(|next| next.stage != all[i].stage)).collect();
    let first = |i: usize| i <= 1 || ends[i - 1];
    let touched = |p: &StatePoint| touches.iter().any(|c| matches!(c.kind, Kind::Touch { at, .. } if at == p.at));
    let kept =
        all.iter().enumerate().filter(|(i, p)| ends[*i] || touched(p) || first(*i) || force(p) > NOTHING * largest);
    kept.map(|(_, p)| *p).collect()
}

/// Parameters of every stage, those that are variables as they are at `w`.
fn all_params(problem: &Fesd, given: &[f64], n: usize, w: &[f64]) -> Vec<f64> {
    let mut params = given.to_vec();
    for p in params.chunks_mut(n.max(1)) {
        p.iter_mut().zip(problem.param_places()).for_each(|(p, at)| *p = at.map_or(*p, |v| w[v]));
    }
    params
}
