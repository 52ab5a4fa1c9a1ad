//! Sequential quadratic programming with few variables, for functions that are expensive and smooth but for kinks.
//!
//! Every step minimises a quadratic model of the cost with the violations of linearised constraints at a price, inside a
//! box (R. Fletcher, *Practical Methods of Optimization*, 1987, 14.4: the Sℓ₁QP method). Constraints that contradict each other
//! are nothing special then. The Hessian begins with the curvature of the cost, as far as it is known, and follows the damped BFGS update (J. Nocedal,
//! S. J. Wright, *Numerical Optimization*, 2006, 18.3).
//!
//! At a kink no smooth model is right. What a step finds that fails, or that ends at a kink, are the slopes of cost and constraints on its other side: the
//! model bends there with all of them; see [`super::hinges`]. A step stays on the side of a kink that it begins on, or crosses it where the
//! multiplier of that promises more than the bend costs. Where it stays and nothing is promised any more, the derivatives on both sides have a
//! combination that vanishes: no direction leads down.

use super::blocks::{curvature, Block};
use super::cliffs::Fall;
use super::hinges::Hinge;
use super::missed;
use crate::error::{Error, Result};
use crate::nlp::IterationInfo;
use crate::qp::{Condensing, Price, QpSolution, QpSolver, QpStatus, Row, StageQp, Terms};
use nalgebra::DMatrix;

/// What the box is at first, as a share of the sizes of the variables, and where it is too small to go on.
const FIRST_BOX: f64 = 0.1;
const LAST_BOX: f64 = 1e-8;
/// Shares of the predicted decrease from which a step is taken, from which the box stays, and from which it grows.
const TAKEN: f64 = 1e-4;
const FAIR: f64 = 0.25;
const GOOD: f64 = 0.75;
/// Predicted decrease, relative to the cost or to what one variable changes it by, below which nothing is left to gain, and the decrease
/// of a step that counts.
const NOTHING: f64 = 1e-10;
/// Differences of the cost, relative in the same way, that simulations do not tell: their tolerance. Slopes say more where nothing has a kink.
const MEASURED: f64 = 1e-8;
const PROGRESS: f64 = 1e-7;
/// Weights of sides are quotients of multipliers by differences of slopes, and as exact as these: curvature changes them between two points.
const ROUGH: f64 = 1e-3;
/// Predicted decrease over the box, or over the sizes of the variables where it is larger, relative to the steepest slope, below which no direction leads
/// down.
const STILL: f64 = 1e-2;
/// Violation of a constraint, relative to what the variables change it by, that counts as none.
const MET: f64 = 1e-7;
/// The same for a point that was moved until it meets them, and the steps of that.
const WELL_MET: f64 = 1e-9;
const RESTORED: usize = 8;
/// Price of a violation in units of the steepest change of the cost, its growth and its limit.
const PRICE: f64 = 10.0;
const DEARER: f64 = 4.0;
const DEAREST: f64 = 1e6;
/// Share of what a constraint is usually changed by below which slopes are no measure of it.
const FLAT: f64 = 1e-2;
/// Growth of the slopes of a constraint from which it is scaled anew.
const STEEPER: f64 = 4.0;
/// Share of the last decrease that is too small to be measured, from which steps go on.
const QUARTER: f64 = 0.25;
/// Share of the violation that a step must promise to take away, or else violations become dearer.
const PROMISE: f64 = 0.5;
const HELPED: f64 = 0.9;
/// Points on the other side of kinks that are remembered at most, the cosine of directions across kinks from which two are of the same, and the
/// distance, in boxes, from which one says nothing any more.
const PIECES: usize = 12;
const PARALLEL: f64 = 0.999;
const FAR: f64 = 100.0;
/// Share of a known curvature that is added to it: combinations of variables may have none.
const REGULAR: f64 = 1e-3;
/// Least curvature along a step, relative to that of the model, of Powell's damping.
const DAMPING: f64 = 0.2;

/// Simulations without derivatives that cost as much as one with them.
const PLAIN: usize = 4;
/// Distance, in the sizes of the variables, at which the end of a descent is looked around, the curvature there as a share of what counts as steep,
/// first-order change that ends that, and the one that counts as none.
const AROUND: f64 = 1e-4;
const BENDING: f64 = 1e-5;
const FLAT_AROUND: f64 = 1e-6;
const STATIONARY: f64 = crate::ocp::optimality::NONE;

/// A cost and constraints `lower ≤ c(z) ≤ upper` with their derivatives.
#[derive(Debug, Clone, Default)]
pub(in crate::ocp) struct Values {
    pub cost: f64,
    /// `[n]`
    pub gradient: Vec<f64>,
    /// `[m]`
    pub rows: Vec<f64>,
    /// What the constraints are usually changed by, zero where that is not known: `[m]`.
    pub usual: Vec<f64>,
    /// Row by row, `[m · n]`.
    pub jacobian: Vec<f64>,
    /// What cost and constraints are made of, where the program takes them apart.
    pub blocks: Vec<Block>,
}

impl Values {
    /// Takes everything back, for `n` variables.
    pub fn clear(&mut self, n: usize) {
        self.cost = 0.0;
        self.gradient.clear();
        self.gradient.resize(n, 0.0);
        self.rows.clear();
        self.usual.clear();
        self.jacobian.clear();
        self.blocks.clear();
    }

    /// Adds derivatives of the cost and of the constraints that a block has, where those of the state at the start of the problem are `start`.
    pub fn push(&mut self, block: Block, start: &DMatrix<f64>) {
        let (cost, rows) = block.derivatives(start);
        self.gradient.iter_mut().zip(cost.iter()).for_each(|(g, v)| *g += v);
        rows.row_iter().for_each(|row| self.jacobian.extend(row.iter()));
        self.blocks.push(block);
    }

    /// Are cost and constraints numbers?
    pub fn is_finite(&self) -> bool {
        self.cost.is_finite() && self.rows.iter().all(|v| v.is_finite())
    }
}

/// What is minimised.
pub(in crate::ocp) trait Program {
    /// Bounds of the variables and their sizes, all positive: `[n]` each.
    fn bounds(&self) -> (&[f64], &[f64], &[f64]);
    /// Bounds of the constraints.
    fn row_bounds(&self) -> (&[f64], &[f64]);
    /// Values at a point; false where there are none.
    fn evaluate(&mut self, z: &[f64], out: &mut Values) -> Result<bool>;

    /// The same without derivatives, where that costs less.
    fn evaluate_plain(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        self.evaluate(z, out)
    }

    /// Values and derivatives with the curvature of the cost in the blocks, where something is known of it.
    fn evaluate_curved(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        self.evaluate(z, out)
    }

    /// Values at a point; `None` where an evaluation fails, which says nothing of the problem.
    fn values_at(&mut self, z: &[f64]) -> Result<Option<Values>> {
        let mut values = Values::default();
        match self.evaluate(z, &mut values) {
            Err(e @ (Error::Interrupted | Error::OutOfTime | Error::Internal(_))) => Err(e),
            Ok(true) => Ok(Some(values)),
            Ok(false) | Err(_) => Ok(None),
        }
    }
}

/// The end of a descent.
#[derive(Debug, Clone)]
pub(in crate::ocp) struct Lowest {
    pub z: Vec<f64>,
    /// Costs at the start and at the end.
    pub before: f64,
    pub cost: f64,
    /// Violation of the constraints at the start, relative to what the variables change them by.
    pub violated: f64,
    /// What gains are relative to.
    pub unit: f64,
    /// How often the program was evaluated.
    pub evaluations: usize,
    /// Decrease of the cost, relative to what it is or one variable changes it by, whichever is more. What it costs to meet
    /// constraints that the start violates is counted with their multipliers; see [`restore`] for a start that violates none.
    pub gain: f64,
    /// Largest violation of a constraint, relative to what the variables change it by.
    pub violation: f64,
    /// Did it end by itself, and not at a limit?
    pub ended: bool,
    /// Did it end where no direction leads down, and is that so at a kink only?
    pub stationary: bool,
    pub kink: bool,
    /// Multipliers of the constraints, positive at upper bounds: `[m]`.
    pub multipliers: Vec<f64>,
    /// First-order change within a unit box that is left, relative to `unit`; NaN where nobody looked around.
    pub left: f64,
    /// Do its variables stand for no motion, as far as somebody has looked?
    pub contradicted: bool,
    /// At a kink the points next to the end whose derivatives make up a combination that vanishes, with their weights; the rest of 1 is that of the end.
    pub beside: Vec<(f64, Vec<f64>)>,
}

impl Lowest {
    /// The points whose derivatives make up those of the end, with their weights: the end itself, and at a kink what is next to it.
    pub fn sides(&self) -> impl Iterator<Item = (f64, &[f64])> {
        let own = 1.0 - self.beside.iter().map(|b| b.0).sum::<f64>();
        std::iter::once((own, &self.z[..])).chain(self.beside.iter().map(|b| (b.0, &b.1[..])))
    }
}

/// Values at the end of a step that failed.
pub(super) struct Piece {
    pub(super) y: Vec<f64>,
    values: Values,
}

/// What vanishes where no direction leads down.
#[derive(Default)]
struct Certificate {
    /// Of the constraints.
    multipliers: Vec<f64>,
    /// Points on the other side of kinks with the weights of their derivatives.
    beside: Vec<(f64, Vec<f64>)>,
    /// The combination is one of generalised derivatives: no weight of a side is negative or beyond 1. A kink that the model did not cross, though it is pushed
    /// at by more than it costs, has none.
    proven: bool,
}

/// A descent in variables divided by their sizes, with the cost and the constraints divided by what the variables change them by.
pub(super) struct Descent<'a> {
    program: &'a mut dyn Program,
    n: usize,
    m: usize,
    size: Vec<f64>,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    row_lower: Vec<f64>,
    row_upper: Vec<f64>,
    /// Factors of the cost and of the constraints, and the steepest slope of the cost with it.
    unit: f64,
    slope: f64,
    row_unit: Vec<f64>,
    /// What is known of the Hessian where a descent begins, or nothing.
    curvature: Option<DMatrix<f64>>,
    qp: StageQp,
    solver: Condensing,
    /// Price of violations.
    price: f64,
    pub(super) pieces: Vec<Piece>,
    /// Multipliers of the constraints as last found: kinks are looked at in the Lagrange function.
    multipliers: Vec<f64>,
}

/// Looks at the cost and the largest violation after a step; true where the descent is to be given up.
pub(in crate::ocp) type GiveUp<'a> = &'a mut dyn FnMut(&IterationInfo) -> bool;

/// Descends from `z`, with at most `evaluations` evaluations, unless `watch` gives it up. `None` where there are no values at `z`.
pub(in crate::ocp) fn minimise(
    program: &mut dyn Program,
    z: &[f64],
    evaluations: usize,
    watch: GiveUp,
) -> Result<Option<Lowest>> {
    let mut here = Values::default();
    let (lower, upper, _) = program.bounds();
    let z: Vec<f64> = z.iter().zip(lower.iter().zip(upper)).map(|(v, (l, u))| v.max(*l).min(*u)).collect();
    if !program.evaluate_curved(&z, &mut here)? {
        return Ok(None);
    }
    let (rows, violated) = (here.rows.len(), unmet(program, &here));
    let Some(mut descent) = Descent::new(program, &here)? else {
        // nothing that varies changes anything to first order: it is what it is, and optimal where nothing varies
        let stationary = z.is_empty();
        return Ok(Some(Lowest {
            unit: here.cost.abs().max(f64::MIN_POSITIVE),
            before: here.cost,
            cost: here.cost,
            violated,
            violation: violated,
            evaluations: 1,
            gain: 0.0,
            ended: true,
            stationary,
            kink: false,
            multipliers: vec![0.0; rows],
            left: 0.0,
            contradicted: false,
            beside: Vec::new(),
            z,
        }));
    };
    descent.scale(&mut here);
    let before = here.clone();
    let mut lowest = descent.run(&z, here, evaluations, watch)?;
    // multipliers of constraints whose slopes vanish, as that of a speed which friction has brought to rest, are without bound: what
    // they make of a violation that counts as none is no gain
    lowest.violated = descent.violation(before.rows.iter().copied()).1;
    lowest.gain += if lowest.violated <= MET { before.cost } else { descent.lagrangian(&before) };
    lowest.before = before.cost / descent.unit;
    lowest.unit = 1.0 / descent.unit;
    Ok(Some(lowest))
}

/// The largest violation of a constraint, as a share of what it is usually changed by.
fn unmet(program: &dyn Program, v: &Values) -> f64 {
    let (lower, upper) = program.row_bounds();
    (0..v.rows.len()).map(|i| missed(v, [lower, upper], i)).fold(0.0, f64::max)
}

/// Looks around the end of a descent, at a distance that simulations tell from their errors: what first order promises there, with all pieces that meet
/// there, is the change that is left, and the multipliers are those of it. A point that is lower is taken. (Gradient sampling: J. V. Burke,
/// A. S. Lewis, M. L. Overton, *A robust gradient sampling algorithm for nonsmooth, nonconvex optimization*, 2005.)
pub(in crate::ocp) fn look_around(program: &mut dyn Program, lowest: &mut Lowest) -> Result<()> {
    let mut here = Values::default();
    if !program.evaluate(&lowest.z, &mut here)? {
        return Ok(());
    }
    let Some(mut descent) = Descent::new(program, &here)? else { return Ok(()) };
    // what is left is compared with what the cost was divided by on the way
    (descent.unit, descent.slope) = (1.0 / lowest.unit, 1.0);
    let mut y: Vec<f64> = lowest.z.iter().zip(&descent.size).map(|(z, s)| z / s).collect();
    // next to a kink rounding decides on the side: what is said of a point is said of its bits
    if !descent.evaluate(&y, &mut here)? {
        return Ok(());
    }
    descent.price = DEARER
        * lowest
            .multipliers
            .iter()
            .zip(&descent.row_unit)
            .fold(PRICE, |m, (mu, r)| m.max((mu * descent.unit / r).abs()));
    let (mut lowest_flat, mut last) = (f64::INFINITY, None);
    let (mut found, mut there) = (QpSolution::new(&descent.qp), Values::default());
    for _ in 0..2 * PIECES {
        descent.qp.hess_u.fill(0.0);
        (0..descent.n).for_each(|j| descent.qp.hess_u[j * (descent.n + 1)] = BENDING / AROUND);
        let kinks = descent.hinges(&y, &here);
        let Some(crossed) = descent.step(&y, &here, AROUND, &kinks, &mut found) else { break };
        descent.multipliers.copy_from_slice(&found.row_mu[..descent.m]);
        let gain = descent.promised(&here, &found.u, &kinks).0;
        if gain / AROUND < lowest_flat {
            lowest_flat = gain / AROUND;
            last = Some((descent.certificate(&found, &kinks, &crossed), y.clone(), here.clone()));
        }
        if gain <= FLAT_AROUND * AROUND {
            break;
        }
        let next = descent.moved(&y, &found.u);
        lowest.evaluations += 1;
        if !descent.evaluate(&next, &mut there)? {
            break;
        }
        if descent.merit(&here) - descent.merit(&there) > FAIR * gain {
            (y, lowest_flat) = (next, f64::INFINITY);
            std::mem::swap(&mut here, &mut there);
        } else if !descent.remember(&y, &here, next, &there) {
            break;
        }
    }
    let Some((Certificate { multipliers, beside, proven }, y, here)) = last else { return Ok(()) };
    let violation = descent.violation(here.rows.iter().copied()).1;
    lowest.z = y.iter().zip(&descent.size).map(|(y, s)| y * s).collect();
    (lowest.cost, lowest.violation) = (here.cost / descent.unit, violation);
    (lowest.stationary, lowest.kink) = (lowest_flat <= STATIONARY && proven, !beside.is_empty());
    (lowest.left, lowest.multipliers, lowest.beside) = (lowest_flat, multipliers, beside);
    Ok(())
}

/// The nearest point to `z` that meets the constraints, by steps that are as short as they can be. `None` where none is found.
pub(in crate::ocp) fn restore(program: &mut dyn Program, z: &[f64]) -> Result<Option<Vec<f64>>> {
    let mut here = Values::default();
    if !program.evaluate(z, &mut here)? {
        return Ok(None);
    }
    let Some(mut descent) = Descent::new(program, &here)? else { return Ok(None) };
    descent.scale(&mut here);
    let mut y: Vec<f64> = z.iter().zip(&descent.size).map(|(z, s)| z / s).collect();
    let (mut found, mut there) = (QpSolution::new(&descent.qp), Values::default());
    let mut left = descent.violation(here.rows.iter().copied()).1;
    descent.restart();
    for _ in 0..RESTORED {
        here.gradient.fill(0.0);
        if left <= WELL_MET || descent.step(&y, &here, FIRST_BOX, &[], &mut found).is_none() {
            break;
        }
        let next = descent.moved(&y, &found.u);
        if !descent.evaluate(&next, &mut there)? {
            break;
        }
        let now = descent.violation(there.rows.iter().copied()).1;
        if now > PROMISE * left {
            break;
        }
        (left, y) = (now, next);
        std::mem::swap(&mut here, &mut there);
    }
    Ok((left <= MET).then(|| y.iter().zip(&descent.size).map(|(y, s)| y * s).collect()))
}

impl<'a> Descent<'a> {
    /// `None` where no variable changes the cost or a constraint.
    fn new(program: &'a mut dyn Program, at: &Values) -> Result<Option<Descent<'a>>> {
        let [lower, upper, size] = <[&[f64]; 3]>::from(program.bounds()).map(<[f64]>::to_vec);
        let [row_lower, row_upper] = <[&[f64]; 2]>::from(program.row_bounds()).map(<[f64]>::to_vec);
        let (n, m) = (size.len(), at.rows.len());
        let steepest = |g: &[f64]| g.iter().zip(&size).fold(0f64, |a, (g, s)| a.max((g * s).abs()));
        let unit = steepest(&at.gradient);
        // where the slopes of a cost vanish, as those of an effort do where nothing is done, it is its curvature that says how large it is
        let curved = curvature(&at.blocks, n);
        let diagonal = curved.iter().flat_map(|c| c.diagonal().iter().copied().collect::<Vec<f64>>());
        let bends = diagonal.zip(&size).fold(0f64, |a, (c, s)| a.max(0.5 * c * s * s));
        let of_rows: Vec<f64> = at.jacobian.chunks_exact(n.max(1)).map(steepest).collect();
        let all = of_rows.iter().fold(unit.max(bends), |a, b| a.max(*b));
        if n == 0 || !(all > 0.0 && all.is_finite()) {
            return Ok(None);
        }
        // A constraint that the variables do not change, as the speed of what friction holds, has no size of its own: rounding is no slope.
        // It takes that of what changes it elsewhere, or of its value.
        let whole = |i: usize| {
            let size = of_rows[i].max(FLAT * at.usual[i]);
            let size = if size > 0.0 { size } else { at.rows[i].abs() };
            (1.0 / size.max(f64::MIN_POSITIVE)).min(f64::MAX)
        };
        let row_unit: Vec<f64> = (0..m).map(whole).collect();
        let priced = |i: usize| (i < m).then_some(Price { linear: 1.0, quadratic: 0.0 });
        let rows = (0..m + PIECES).map(|i| Row { node: 0, price: priced(i) }).collect();
        let qp = StageQp::new(1, 1, n, rows)?;
        let over = |b: &[f64], s: &[f64]| b.iter().zip(s).map(|(b, s)| b / s).collect::<Vec<f64>>();
        let times = |b: &[f64], s: &[f64]| b.iter().zip(s).map(|(b, s)| b * s).collect::<Vec<f64>>();
        let (lower, upper) = (over(&lower, &size), over(&upper, &size));
        let (row_lower, row_upper) = (times(&row_lower, &row_unit), times(&row_upper, &row_unit));
        let solver = Condensing::new(&qp)?;
        let steepest = unit;
        let unit = 1.0 / steepest.max(at.cost.abs()).max(bends).max(f64::MIN_POSITIVE);
        Ok(Some(Descent {
            curvature: curved.map(|c| DMatrix::from_fn(n, n, |i, j| c[(i, j)] * unit * size[i] * size[j])),
            program,
            n,
            m,
            size,
            lower,
            upper,
            row_lower,
            row_upper,
            unit,
            slope: steepest * unit,
            row_unit,
            qp,
            solver,
            price: PRICE,
            pieces: Vec::new(),
            multipliers: vec![0.0; m],
        }))
    }

    /// Values in the units of the descent.
    fn scale(&self, v: &mut Values) {
        v.cost *= self.unit;
        v.gradient.iter_mut().zip(&self.size).for_each(|(g, s)| *g *= self.unit * s);
        v.rows.iter_mut().zip(&self.row_unit).for_each(|(c, f)| *c *= f);
        for (row, f) in v.jacobian.chunks_exact_mut(self.n).zip(&self.row_unit) {
            row.iter_mut().zip(&self.size).for_each(|(g, s)| *g *= f * s);
        }
    }

    /// Constraints whose slopes have grown are divided by them: where a descent begins they may be flat, as the distance from the middle
    /// of an obstacle is, and what is measured by that would outweigh everything else.
    fn rescale(&mut self, here: &mut Values) {
        let n = self.n;
        for i in 0..self.m {
            let slope = row(here, n, i).iter().fold(0f64, |a, v| a.max(v.abs()));
            if slope <= STEEPER {
                continue;
            }
            let pieces = self.pieces.iter_mut().map(|p| &mut p.values);
            for v in std::iter::once(&mut *here).chain(pieces) {
                v.rows[i] /= slope;
                v.jacobian[i * n..(i + 1) * n].iter_mut().for_each(|g| *g /= slope);
            }
            self.row_unit[i] /= slope;
            self.row_lower[i] /= slope;
            self.row_upper[i] /= slope;
            self.multipliers[i] *= slope;
        }
    }

    /// The merit of a point, infinite where it has none.
    pub(super) fn merit_at(&mut self, y: &[f64]) -> Result<f64> {
        let z: Vec<f64> = y.iter().zip(&self.size).map(|(y, s)| y * s).collect();
        let mut out = Values::default();
        let found = self.program.evaluate_plain(&z, &mut out)?;
        self.scale(&mut out);
        let merit = self.merit(&out);
        Ok(if found && merit.is_finite() { merit } else { f64::INFINITY })
    }

    fn evaluate(&mut self, y: &[f64], out: &mut Values) -> Result<bool> {
        let z: Vec<f64> = y.iter().zip(&self.size).map(|(y, s)| y * s).collect();
        let found = self.program.evaluate(&z, out)?;
        self.scale(out);
        Ok(found && out.cost.is_finite() && out.gradient.iter().chain(&out.jacobian).all(|v| v.is_finite()))
    }

    /// Violations of the constraints, summed, and the largest.
    fn violation(&self, rows: impl Iterator<Item = f64>) -> (f64, f64) {
        let bounds = self.row_lower.iter().zip(&self.row_upper);
        let by = rows.zip(bounds).map(|(c, (l, u))| (l - c).max(c - u).max(0.0));
        by.fold((0.0, 0f64), |(sum, worst), v| (sum + v, worst.max(v)))
    }

    /// The cost with the violations of constraints that act, at their multipliers.
    fn lagrangian(&self, v: &Values) -> f64 {
        let bounds = self.row_lower.iter().zip(&self.row_upper);
        let rows = self.multipliers.iter().zip(&v.rows).zip(bounds);
        let term = |((mu, c), (l, u)): ((&f64, &f64), (&f64, &f64))| match mu {
            mu if *mu > 0.0 => mu * (c - u),
            mu if *mu < 0.0 => mu * (c - l),
            _ => 0.0,
        };
        v.cost + rows.map(term).sum::<f64>()
    }

    pub(super) fn merit(&self, v: &Values) -> f64 {
        v.cost + self.price * self.violation(v.rows.iter().copied()).0
    }

    /// Kinks that are known, as they are seen from a point.
    fn hinges(&self, y: &[f64], here: &Values) -> Vec<Option<Hinge>> {
        self.pieces.iter().map(|p| Hinge::between((y, here), (&p.y, &p.values))).collect()
    }

    /// Solves the model at `here` within a box: on the side of all kinks that the point is on, then behind those that are worth crossing, one after
    /// the other, as long as the model promises more. Which are crossed; `None` where that fails.
    fn step(
        &mut self,
        y: &[f64],
        here: &Values,
        radius: f64,
        kinks: &[Option<Hinge>],
        out: &mut QpSolution,
    ) -> Option<Vec<bool>> {
        let mut crossed = vec![false; kinks.len()];
        if !self.solve_on(y, here, &here.rows, radius, (kinks, &crossed), out) {
            return None;
        }
        let mut best = self.promised(here, &out.u, kinks).0;
        let mut tried = crossed.clone();
        loop {
            let worth = |k: usize| -> f64 {
                let push = out.row_mu[self.m + k];
                kinks[k].as_ref().map_or(0.0, |h| push - h.bend(&out.row_mu[..self.m]).max(0.0))
            };
            let open = (0..kinks.len()).filter(|&k| !tried[k] && out.row_mu[self.m + k] > NOTHING && worth(k) > 0.0);
            let Some(k) = open.max_by(|&a, &b| worth(a).total_cmp(&worth(b))) else { break };
            tried[k] = true;
            crossed[k] = true;
            let mut other = out.clone();
            if self.reaches(kinks[k].as_ref(), y, radius)
                && self.solve_on(y, here, &here.rows, radius, (kinks, &crossed), &mut other)
            {
                let promised = self.promised(here, &other.u, kinks).0;
                if promised > best {
                    best = promised;
                    *out = other;
                    continue;
                }
            }
            crossed[k] = false;
        }
        Some(crossed)
    }

    /// Is a kink within the box?
    fn reaches(&self, kink: Option<&Hinge>, y: &[f64], radius: f64) -> bool {
        let Some(kink) = kink else { return false };
        let furthest = kink.across.iter().enumerate().map(|(j, g)| match *g > 0.0 {
            true => g * (self.upper[j] - y[j]).min(radius).max(0.0),
            false => g * (self.lower[j] - y[j]).max(-radius).min(0.0),
        });
        furthest.sum::<f64>() > kink.distance
    }

    /// Solves the model at `here`, with constraints of these values, within a box and on these sides of kinks. False where that fails.
    fn solve_on(
        &mut self,
        y: &[f64],
        here: &Values,
        rows: &[f64],
        radius: f64,
        (kinks, crossed): (&[Option<Hinge>], &[bool]),
        out: &mut QpSolution,
    ) -> bool {
        let (n, m, qp) = (self.n, self.m, &mut self.qp);
        qp.grad_u.copy_from_slice(&here.gradient);
        for j in 0..n {
            qp.u_lower[j] = (self.lower[j] - y[j]).max(-radius).min(0.0);
            qp.u_upper[j] = (self.upper[j] - y[j]).min(radius).max(0.0);
        }
        qp.row_u[..m * n].copy_from_slice(&here.jacobian);
        for i in 0..m {
            qp.row_lower[i] = self.row_lower[i] - rows[i];
            qp.row_upper[i] = self.row_upper[i] - rows[i];
            qp.rows[i].price = Some(Price { linear: self.price, quadratic: 0.0 });
        }
        for i in 0..PIECES {
            let row = m + i;
            (qp.row_lower[row], qp.row_upper[row]) = (f64::NEG_INFINITY, f64::INFINITY);
            let Some(kink) = kinks.get(i).and_then(Option::as_ref) else { continue };
            qp.row_u[row * n..(row + 1) * n].copy_from_slice(&kink.across);
            if !crossed[i] {
                qp.row_upper[row] = kink.distance;
                continue;
            }
            qp.row_lower[row] = kink.distance;
            qp.grad_u.iter_mut().zip(&kink.across).for_each(|(g, a)| *g += kink.cost * a);
            for (i, w) in kink.rows.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                qp.row_u[i * n..(i + 1) * n].iter_mut().zip(&kink.across).for_each(|(r, a)| *r += w * a);
                qp.row_lower[i] += w * kink.distance;
                qp.row_upper[i] += w * kink.distance;
            }
        }
        if !self.solver.prepare(qp) || self.solver.solve(qp, &[0.0], &Terms::default()) != QpStatus::Solved {
            return false;
        }
        self.solver.expand(qp, out);
        out.u.iter().all(|d| d.is_finite())
    }

    /// What constraints change by in the model.
    fn changes(&self, here: &Values, d: &[f64], kinks: &[Option<Hinge>]) -> Vec<f64> {
        let mut out: Vec<f64> = here.jacobian.chunks_exact(self.n).map(|row| dot(row, d)).collect();
        for kink in kinks.iter().flatten() {
            let beyond = kink.beyond(d).max(0.0);
            out.iter_mut().zip(&kink.rows).for_each(|(c, w)| *c += w * beyond);
        }
        out
    }

    /// Decrease of the merit function that the model promises, and the violation it leaves.
    fn promised(&self, here: &Values, d: &[f64], kinks: &[Option<Hinge>]) -> (f64, f64) {
        let n = self.n;
        let curvature: f64 = (0..n).map(|j| d[j] * dot(&self.qp.hess_u[j * n..(j + 1) * n], d)).sum();
        let left = self.violation(here.rows.iter().zip(self.changes(here, d, kinks)).map(|(c, d)| c + d)).0;
        let bends: f64 = kinks.iter().flatten().map(|k| k.cost * k.beyond(d).max(0.0)).sum();
        let now = self.violation(here.rows.iter().copied()).0;
        (-dot(&here.gradient, d) - bends - 0.5 * curvature + self.price * (now - left), left)
    }

    fn run(&mut self, z: &[f64], mut here: Values, evaluations: usize, watch: GiveUp) -> Result<Lowest> {
        let mut y: Vec<f64> = z.iter().zip(&self.size).map(|(z, s)| z / s).collect();
        self.restart();
        let mut found = QpSolution::new(&self.qp);
        let (mut there, mut radius, mut spent, mut steps) = (Values::default(), FIRST_BOX, 1, 0);
        let (mut fresh, mut flattest, mut promised, mut unseen) = (true, f64::INFINITY, f64::INFINITY, f64::INFINITY);
        let (mut fall, mut given_up): (Option<Fall>, bool) = (None, false);
        let mut certificate = Certificate { multipliers: vec![0.0; self.m], proven: true, ..Certificate::default() };
        while spent < evaluations && radius > LAST_BOX {
            self.pieces.retain(|p| p.y.iter().zip(&y).all(|(a, b)| (a - b).abs() <= FAR * radius));
            let kinks = self.hinges(&y, &here);
            let Some(crossed) = self.step(&y, &here, radius, &kinks, &mut found) else {
                if fresh {
                    break;
                }
                self.restart();
                fresh = true;
                continue;
            };
            let (mut gain, left) = self.promised(&here, &found.u, &kinks);
            let now = self.violation(here.rows.iter().copied());
            if now.1 > MET && left > PROMISE * now.0 && self.price < DEAREST && left < HELPED * promised {
                // as long as that makes the step meet the constraints better
                promised = left;
                self.price *= DEARER;
                continue;
            }
            promised = f64::INFINITY;
            self.multipliers.copy_from_slice(&found.row_mu[..self.m]);
            if left <= MET && self.lower_price() {
                gain = self.promised(&here, &found.u, &kinks).0;
            }
            let flat = gain / (radius.min(1.0) * self.slope.max(NOTHING));
            if flat < flattest {
                (flattest, certificate) = (flat, self.certificate(&found, &kinks, &crossed));
            }
            let mut next = self.moved(&y, &found.u);
            if gain <= NOTHING && !fresh && !self.pieces.is_empty() {
                // what crossed kinks have taught the Hessian may be all that holds a step back
                self.restart();
                fresh = true;
                continue;
            }
            let smooth = kinks.iter().all(Option::is_none);
            if smooth && gain > 0.0 && gain <= MEASURED.min(QUARTER * unseen) {
                // too little to be measured, but slopes at its end are smaller where the Hessian is right: as long as that shows
                spent += 1;
                let level = self.merit(&here) + MEASURED;
                if self.evaluate(&next, &mut there)? && self.merit(&there) <= level {
                    self.update((&y, &here), (&next, &there), &found, fresh);
                    (fresh, unseen) = (false, gain);
                    y = next;
                    std::mem::swap(&mut here, &mut there);
                } else {
                    unseen = 0.0;
                }
                continue;
            }
            if gain <= NOTHING {
                spent += 1;
                if gain > 0.0 && self.evaluate(&next, &mut there)? && self.merit(&there) <= self.merit(&here) {
                    y = next;
                    std::mem::swap(&mut here, &mut there);
                }
                break;
            }
            spent += 1;
            let mut reached = self.evaluate(&next, &mut there)?;
            let mut ratio = if reached { (self.merit(&here) - self.merit(&there)) / gain } else { f64::NEG_INFINITY };
            let once_more = spent < evaluations;
            if once_more && reached && ratio < FAIR && self.violation(there.rows.iter().copied()).0 > now.0 + MET {
                spent += 1;
                let model = (&kinks[..], &crossed[..]);
                self.correct((&y, &here), (radius, gain), model, (&mut next, &mut there, &mut found, &mut ratio))?;
            }
            reached &= ratio.is_finite();
            let longest = found.u.iter().fold(0f64, |m, d| m.max(d.abs())).min(radius);
            let taken = reached && ratio > TAKEN;
            let rise = Fall { by: self.merit(&there) - self.merit(&here), longest, radius, price: self.price };
            radius = match ratio {
                r if r > GOOD => (2.0 * longest).max(radius),
                r if r > FAIR => radius,
                _ if taken => 0.5 * longest,
                _ => 0.25 * longest,
            };
            if taken {
                fall = None;
                self.update((&y, &here), (&next, &there), &found, fresh);
                fresh = false;
                if self.merit(&here) - self.merit(&there) > PROGRESS {
                    flattest = f64::INFINITY;
                }
                let before = std::mem::replace(&mut y, next);
                std::mem::swap(&mut here, &mut there);
                // a step that ends at a kink may end on either side of it
                let at_kink = found.row_mu[self.m..].iter().any(|mu| mu.abs() > NOTHING) || crossed.contains(&true);
                if ratio < GOOD || at_kink {
                    self.remember(&y, &here, before, &there);
                }
                self.rescale(&mut here);
            } else if reached {
                let before = fall.filter(|f| f.goes_on(&rise));
                let (is_held, simulated) = match before {
                    Some(_) => self.hold(&y, &here, (&next, &rise))?,
                    None => (false, 0),
                };
                spent += simulated.div_ceil(PLAIN);
                if let Some(before) = before.filter(|_| is_held) {
                    // the other variables have the box that they had before
                    (radius, fall) = (before.radius, None);
                } else {
                    fall = Some(rise);
                    // twice the distance at which the other piece begins, if it does within the step
                    radius = if self.remember(&y, &here, next, &there) { 0.5 * longest } else { radius };
                }
            }
            let violation = self.violation(here.rows.iter().copied()).1;
            let told = IterationInfo {
                iter: steps,
                objective: here.cost / self.unit,
                inf_pr: violation,
                ..Default::default()
            };
            steps += 1;
            if watch(&told) {
                given_up = true;
                break;
            }
        }
        let Certificate { multipliers, beside, proven } = certificate;
        Ok(Lowest {
            z: y.iter().zip(&self.size).map(|(y, s)| y * s).collect(),
            before: f64::NAN,
            violated: f64::NAN,
            unit: f64::NAN,
            cost: here.cost / self.unit,
            evaluations: spent,
            gain: -here.cost,
            violation: self.violation(here.rows.iter().copied()).1,
            ended: spent < evaluations && !given_up,
            stationary: flattest <= STILL && proven,
            kink: !beside.is_empty(),
            beside,
            multipliers,
            left: f64::NAN,
            contradicted: false,
        })
    }

    /// What a step says of the point it begins at.
    fn certificate(&self, found: &QpSolution, kinks: &[Option<Hinge>], crossed: &[bool]) -> Certificate {
        let of_model = &found.row_mu[..self.m];
        let multipliers = of_model.iter().zip(&self.row_unit).map(|(mu, r)| mu * r / self.unit).collect();
        let pushed = |k: usize, h: &Hinge| match found.row_mu[self.m + k] {
            push if push.abs() <= NOTHING => 0.0,
            push => push / h.bend(of_model),
        };
        let weight = |k: usize| kinks[k].as_ref().map_or(0.0, |h| f64::from(u8::from(crossed[k])) + pushed(k, h));
        let all: Vec<(f64, usize)> = (0..kinks.len()).map(|k| (weight(k), k)).collect();
        let proven = all.iter().all(|(w, _)| (-ROUGH..=1.0 + ROUGH).contains(w));
        let back = |p: &Piece| p.y.iter().zip(&self.size).map(|(y, s)| y * s).collect();
        let acting = all.into_iter().filter(|(w, _)| w.is_finite() && *w > NOTHING);
        let beside = acting.map(|(w, k)| (w, back(&self.pieces[k]))).collect();
        Certificate { multipliers, beside, proven }
    }

    /// A price that only a start far from the constraints needed would make every step along curved constraints fail: where a step meets
    /// them, it falls to what their multipliers ask for (R. H. Byrd, J. Nocedal, R. A. Waltz, *Steering exact penalty methods*, 2008).
    /// Does it? The step stays the same.
    fn lower_price(&mut self) -> bool {
        let needed = self.multipliers.iter().fold(PRICE, |m, mu| m.max(DEARER * mu.abs()));
        let falls = self.price > DEARER * needed;
        if falls {
            self.price = needed;
        }
        falls
    }

    /// Where a step makes violations larger the curvature of the constraints is what is wrong: once more with their values at its end.
    fn correct(
        &mut self,
        (y, here): (&[f64], &Values),
        (radius, gain): (f64, f64),
        model: (&[Option<Hinge>], &[bool]),
        (next, there, found, ratio): (&mut Vec<f64>, &mut Values, &mut QpSolution, &mut f64),
    ) -> Result<()> {
        let changes = self.changes(here, &found.u, model.0);
        let shifted: Vec<f64> = there.rows.iter().zip(changes).map(|(c, d)| c - d).collect();
        let mut second = found.clone();
        if !self.solve_on(y, here, &shifted, radius, model, &mut second) {
            return Ok(());
        }
        let corrected = self.moved(y, &second.u);
        let mut values = Values::default();
        // most of these fail, which values say without derivatives
        let promises = (self.merit(here) - self.merit_at(&corrected)?) / gain > *ratio;
        if promises && self.evaluate(&corrected, &mut values)? {
            let better = (self.merit(here) - self.merit(&values)) / gain;
            if better > *ratio {
                (*ratio, *next, *there, *found) = (better, corrected, values, second);
            }
        }
        Ok(())
    }

    /// Remembers a point as one on the other side of a kink. Is it one that was not known?
    fn remember(&mut self, y: &[f64], here: &Values, at: Vec<f64>, values: &Values) -> bool {
        let values = Values { blocks: Vec::new(), ..values.clone() };
        let piece = Piece { y: at, values };
        let kink = |p: &Piece| Hinge::between((y, here), (&p.y, &p.values));
        let own = kink(&piece);
        let alike = |p: &Piece| match (&own, kink(p)) {
            (Some(own), Some(other)) => dot(&own.across, &other.across) > PARALLEL,
            (own, other) => own.is_none() && other.is_none(),
        };
        let same = self.pieces.iter().position(alike);
        match same {
            Some(i) => self.pieces[i] = piece,
            None => {
                if self.pieces.len() == PIECES {
                    self.pieces.remove(0);
                }
                self.pieces.push(piece);
            }
        }
        same.is_none()
    }

    fn moved(&self, y: &[f64], d: &[f64]) -> Vec<f64> {
        let bounds = self.lower.iter().zip(&self.upper);
        y.iter().zip(d).zip(bounds).map(|((y, d), (l, u))| (y + d).max(*l).min(*u)).collect()
    }

    /// The Hessian before steps have shown more of it: the curvature of the cost, and for what that says nothing of the steepest slope over the
    /// sizes of the variables.
    fn restart(&mut self) {
        let (n, guess) = (self.n, self.slope.max(NOTHING));
        let h = &mut self.qp.hess_u;
        match &self.curvature {
            None => h.fill(0.0),
            Some(c) => h.copy_from_slice(c.as_slice()),
        }
        let largest = h.iter().step_by(n + 1).fold(0f64, |m, d| m.max(*d));
        for d in h.iter_mut().step_by(n + 1) {
            *d += if *d > NOTHING * largest { REGULAR * *d } else { guess };
        }
    }

    /// The damped update with what a step shows of the cost with the multipliers of the model; the first one measures the Hessian.
    fn update(&mut self, from: (&[f64], &Values), to: (&[f64], &Values), found: &QpSolution, first: bool) {
        let n = self.n;
        let ((y, here), (next, there)) = (from, to);
        let s: Vec<f64> = next.iter().zip(y).map(|(a, b)| a - b).collect();
        let mut change: Vec<f64> = there.gradient.iter().zip(&here.gradient).map(|(a, b)| a - b).collect();
        for (i, mu) in found.row_mu[..self.m].iter().enumerate().filter(|(_, mu)| **mu != 0.0) {
            let rows = row(there, n, i).iter().zip(row(here, n, i));
            change.iter_mut().zip(rows).for_each(|(c, (a, b))| *c += mu * (a - b));
        }
        let (yy, ys) = (dot(&change, &change), dot(&change, &s));
        if first && self.curvature.is_none() && ys > 0.0 && (yy / ys).is_finite() {
            (0..n).for_each(|j| self.qp.hess_u[j * (n + 1)] = yy / ys);
        }
        let h = &mut self.qp.hess_u;
        let hs: Vec<f64> = (0..n).map(|j| dot(&h[j * n..(j + 1) * n], &s)).collect();
        let (shs, sy) = (dot(&s, &hs), dot(&s, &change));
        if !(shs > 0.0 && sy.is_finite()) {
            return;
        }
        let theta = if sy >= DAMPING * shs { 1.0 } else { (1.0 - DAMPING) * shs / (shs - sy) };
        change.iter_mut().zip(&hs).for_each(|(c, b)| *c = theta * *c + (1.0 - theta) * b);
        let sr = dot(&s, &change);
        for j in 0..n {
            for i in 0..n {
                h[j * n + i] += change[i] * change[j] / sr - hs[i] * hs[j] / shs;
            }
        }
    }
}

fn row(v: &Values, n: usize, i: usize) -> &[f64] {
    &v.jacobian[i * n..(i + 1) * n]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A program by closures, `f(z)` with gradient and `c(z)` with Jacobian.
    struct Given<F: FnMut(&[f64], &mut Values)> {
        lower: Vec<f64>,
        upper: Vec<f64>,
        size: Vec<f64>,
        rows: [Vec<f64>; 2],
        f: F,
    }

    impl<F: FnMut(&[f64], &mut Values)> Program for Given<F> {
        fn bounds(&self) -> (&[f64], &[f64], &[f64]) {
            (&self.lower, &self.upper, &self.size)
        }
        fn row_bounds(&self) -> (&[f64], &[f64]) {
            (&self.rows[0], &self.rows[1])
        }
        fn evaluate(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
            (self.f)(z, out);
            Ok(true)
        }
    }

    /// Hock and Schittkowski, problem 71, in variables of very different sizes.
    #[test]
    fn a_textbook_problem_in_other_units() {
        let size = [1e-3, 1.0, 1e4, 1.0];
        let f = |z: &[f64], out: &mut Values| {
            let x: Vec<f64> = z.iter().zip(&size).map(|(z, s)| z / s).collect();
            let [a, b, c, d] = x[..] else { return };
            out.cost = a * d * (a + b + c) + c;
            let g = [d * (2.0 * a + b + c), a * d, a * d + 1.0, a * (a + b + c)];
            let product = a * b * c * d;
            (out.rows, out.usual) = (vec![product, a * a + b * b + c * c + d * d], vec![0.0; 2]);
            let j = [product / a, product / b, product / c, product / d, 2.0 * a, 2.0 * b, 2.0 * c, 2.0 * d];
            out.gradient = g.iter().zip(&size).map(|(g, s)| g / s).collect();
            out.jacobian = j.iter().zip(size.iter().cycle()).map(|(j, s)| j / s).collect();
        };
        let by = |v: f64| size.iter().map(|s| v * s).collect::<Vec<f64>>();
        let mut program = Given {
            lower: by(1.0),
            upper: by(5.0),
            size: by(2.0),
            rows: [vec![25.0, 40.0], vec![f64::INFINITY, 40.0]],
            f,
        };
        let r = minimise(&mut program, &[1e-3, 5.0, 5e4, 1.0], 100, &mut |_| false).unwrap().unwrap();
        let mut at = Values::default();
        program.evaluate(&r.z, &mut at).unwrap();
        assert!((at.cost - 17.014_017_289).abs() < 1e-6, "{}", at.cost);
        assert!(r.violation < MET && r.stationary && !r.kink, "{r:?}");
    }

    /// `|x| + (y − x)²`: no model is right at the kink, where the minimum is.
    #[test]
    fn a_kink() {
        let f = |z: &[f64], out: &mut Values| {
            let (x, y) = (z[0], z[1]);
            out.cost = x.abs() + (y - x).powi(2);
            out.gradient = vec![x.signum() - 2.0 * (y - x), 2.0 * (y - x)];
        };
        let free = |v: f64| vec![v; 2];
        let mut program = Given { lower: free(-10.0), upper: free(10.0), size: free(1.0), rows: Default::default(), f };
        let r = minimise(&mut program, &[3.0, -2.0], 100, &mut |_| false).unwrap().unwrap();
        let left = r.z[0].abs() + (r.z[1] - r.z[0]).powi(2);
        assert!(left < 1e-7 && r.stationary && r.kink, "{left} {r:?}");
    }

    /// The point of a circle where a cost that is nearly constant on it is least: from far away, where violations become so dear that steps
    /// along the circle would fail, and from next to its middle, where the constraint has hardly a slope.
    #[test]
    fn a_circle_from_afar_and_from_its_middle() {
        let f = |z: &[f64], out: &mut Values| {
            let (x, y) = (z[0], z[1]);
            out.cost = 2.0 * (x * x + y * y - 1.0) - x;
            out.gradient = vec![4.0 * x - 1.0, 4.0 * y];
            (out.rows, out.usual) = (vec![x * x + y * y], vec![1.0]);
            out.jacobian = vec![2.0 * x, 2.0 * y];
        };
        for (start, most) in [([-5.0, 3.0], 100), ([9.0, 9.0], 100), ([-1e-2, 1e-3], 50)] {
            let free = |v: f64| vec![v; 2];
            let rows = [vec![1.0], vec![1.0]];
            let mut program = Given { lower: free(-10.0), upper: free(10.0), size: free(1.0), rows, f };
            let r = minimise(&mut program, &start, most, &mut |_| false).unwrap().unwrap();
            assert!((r.cost + 1.0).abs() < 1e-8 && r.violation < MET && r.stationary, "{start:?}: {r:?}");
        }
    }

    /// A row that only rounding changes, as the speed of a mass that friction holds, is met.
    #[test]
    fn a_constraint_that_is_only_rounding() {
        let f = |z: &[f64], out: &mut Values| {
            (out.cost, out.gradient) = ((z[0] - 1.0).powi(2), vec![2.0 * (z[0] - 1.0)]);
            (out.rows, out.usual, out.jacobian) = (vec![3e-17 * z[0] + 2e-17], vec![1.0], vec![3e-17]);
        };
        let rows = [vec![0.0], vec![0.0]];
        let mut program = Given { lower: vec![0.0], upper: vec![2.0], size: vec![1.0], rows, f };
        let r = minimise(&mut program, &[0.2], 30, &mut |_| false).unwrap().unwrap();
        assert!((r.z[0] - 1.0).abs() < 1e-6 && r.violation < MET, "{r:?}");
    }

    /// `(x − a)² + y²` on a row with a kink, `y = 1 + |x − 1|`: its minimum is behind the kink, from where slopes of the row on this side lead astray, or
    /// the kink itself.
    #[test]
    fn a_constraint_with_a_kink() {
        for (aim, best, kink) in [(3.0, [1.5, 1.5], false), (1.5, [1.0, 1.0], true)] {
            for start in [-3.0, -0.2, 0.9, 4.0] {
                let f = move |z: &[f64], out: &mut Values| {
                    let (x, y) = (z[0], z[1]);
                    out.cost = (x - aim).powi(2) + y * y;
                    out.gradient = vec![2.0 * (x - aim), 2.0 * y];
                    (out.rows, out.usual) = (vec![y - (x - 1.0).abs()], vec![1.0]);
                    out.jacobian = vec![-(x - 1.0).signum(), 1.0];
                };
                let free = |v: f64| vec![v; 2];
                let rows = [vec![1.0], vec![1.0]];
                let mut program = Given { lower: free(-10.0), upper: free(10.0), size: free(1.0), rows, f };
                let r = minimise(&mut program, &[start, 3.0], 60, &mut |_| false).unwrap().unwrap();
                let off = (r.z[0] - best[0]).abs().max((r.z[1] - best[1]).abs());
                assert!(off < 1e-5 && r.violation < MET && r.stationary && r.kink == kink, "{aim} {start}: {r:?}");
            }
        }
    }

    /// `(x − 3)² + (y + x)² + 100 [x > 1]`: the edge, with the best of the other variable there.
    #[test]
    fn a_cliff() {
        for start in [[-4.0, -3.0], [0.99, -0.9], [0.5, 0.5]] {
            let f = |z: &[f64], out: &mut Values| {
                let (x, y) = (z[0], z[1]);
                out.cost = (x - 3.0).powi(2) + (y + x).powi(2) + if x > 1.0 { 100.0 } else { 0.0 };
                out.gradient = vec![2.0 * (x - 3.0) + 2.0 * (y + x), 2.0 * (y + x)];
            };
            let free = |v: f64| vec![v; 2];
            let mut program =
                Given { lower: free(-10.0), upper: free(10.0), size: free(1.0), rows: Default::default(), f };
            let r = minimise(&mut program, &start, 60, &mut |_| false).unwrap().unwrap();
            assert!(r.z[0] <= 1.0 && (r.cost - 4.0).abs() < 1e-6, "{start:?}: {r:?}");
        }
    }

    /// `x_{k+1} = x_k + h (sin x_k + u_k)` from 0 to `x(1) = 2` with the least effort, in its controls, with the blocks of its stages.
    struct Pushed {
        n: usize,
        bounds: [Vec<f64>; 3],
        row: [Vec<f64>; 2],
    }

    impl Program for Pushed {
        fn bounds(&self) -> (&[f64], &[f64], &[f64]) {
            let [lower, upper, size] = &self.bounds;
            (lower, upper, size)
        }
        fn row_bounds(&self) -> (&[f64], &[f64]) {
            (&self.row[0], &self.row[1])
        }
        fn evaluate(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
            let n = self.n;
            let h = 1.0 / n as f64;
            out.clear(n);
            let (mut x, mut dx) = (0.0f64, DMatrix::zeros(1, n));
            for (k, u) in z.iter().enumerate() {
                let next = DMatrix::from_row_slice(1, 2, &[1.0 + h * x.cos(), h]);
                let block = Block {
                    begins: k == 0,
                    states: 1,
                    n_inputs: 2,
                    dense: dx.clone(),
                    own: vec![(1, k, 1.0)],
                    cost: vec![0.0, 2.0 * h * u],
                    first: out.rows.len(),
                    rows: if k + 1 == n { next.as_slice().to_vec() } else { Vec::new() },
                    start: Vec::new(),
                    curvature: None,
                    next,
                };
                out.cost += h * u * u;
                x += h * (x.sin() + u);
                dx = block.by_variables(&block.next);
                if k + 1 == n {
                    out.rows.push(x);
                    out.usual.push(1.0);
                }
                out.push(block, &DMatrix::zeros(1, n));
            }
            Ok(true)
        }
    }

    /// Steps hardly grow with the number of stages.
    #[test]
    fn many_stages_take_few_steps() {
        let mut spent = Vec::new();
        for n in [10, 40, 160] {
            let bounds = [vec![-20.0; n], vec![20.0; n], vec![1.0; n]];
            let mut program = Pushed { n, bounds, row: [vec![2.0], vec![2.0]] };
            let r = minimise(&mut program, &vec![0.1; n], 100, &mut |_| false).unwrap().unwrap();
            assert!(r.stationary && r.violation < MET, "{n}: {r:?}");
            spent.push(r.evaluations);
        }
        assert!(spent[2] <= 2 * spent[0], "{spent:?}");
    }
}
