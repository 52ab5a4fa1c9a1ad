//! Implicit functions as nodes: solutions of equations, and least values of inner problems.
//!
//! ```text
//! w(z):  G(w, z) = 0,      or  w(z) = argmin_w F(w, z),  G = ∇_w F,      V(z) = F(w(z), z)
//! ```
//!
//! Where the node is evaluated, a damped Newton method finds `w`, always from the start that is given: the same inputs give the same bits.
//! Derivatives are nodes again: `∂w/∂z = −G_w⁻¹ G_z` by the implicit function theorem, and `∂V/∂z = F_z`, since `F_w = 0` (envelope theorem).
//! So there are derivatives of any order. See Nocedal and Wright, *Numerical Optimization*, chapters 3 and 11; Milgrom and Segal 2002.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::dag::{Block, Dag, External, Group, Id, Node};
use super::linear;
use super::op::Unary;
use super::saved::SavedGraph;
use super::tape::Tape;
use crate::error::{Error, Result};
use crate::func::{Dims, EvalError, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// Newton steps at most. The method is quadratic near a solution, so that more of them mean that there is none.
pub(super) const MOST_STEPS: usize = 100;

/// A step that is this small against the unknowns is the last one: its error is the square of it.
pub(super) const LAST_STEP: f64 = 1e-9;

/// A step this small against all unknowns on the way that does not shrink any more is rounding: a root near zero has no digits of its own.
pub(super) const ROUNDED_STEP: f64 = 1e-12;

/// Share of the decrease that the slope promises which a step must have (Nocedal and Wright, section 3.1).
pub(super) const ARMIJO: f64 = 1e-4;

/// A promised change of this share of the terms of the merit is within its rounding: it does not say whether a step is good.
pub(super) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Halvings of a step at most, to below the digits of a number.
const MOST_HALVINGS: usize = 52;

/// An implicit function as data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedImplicit {
    unknowns: usize,
    arguments: usize,
    /// Does it minimise? Then the roots are the function that is least, the value, and the starts; else equations and starts.
    least: bool,
    graph: SavedGraph,
}

/// Programs for one implicit function: unknowns are states of its own graph, arguments are parameters.
pub(super) struct Implicit {
    n: usize,
    dims: Dims,
    saved: Option<SavedImplicit>,
    residual: Tape,
    jacobian: Tape,
    start: Tape,
    /// What is least, and the value there.
    least: Option<(Tape, Tape)>,
    /// Is the value the largest over unit vectors, as a signed distance is?
    largest: bool,
    jac_pattern: Pattern,
    hess_pattern: Pattern,
    own: Templates,
}

/// Derivatives of an implicit function in its own graph.
struct Templates {
    dag: Dag,
    /// `G_w`, by columns.
    matrix: Vec<Id>,
    /// Entries of `G_z`: row, argument.
    arguments: Vec<(usize, usize, Id)>,
    /// Entries of `V_z`.
    value: Vec<(usize, Id)>,
}

/// Derivatives of an implicit function at the nodes of a graph.
pub(super) struct Partials {
    /// Unknowns.
    pub(super) n: usize,
    pub(super) matrix: Vec<Id>,
    /// `G_z`: row, argument, value.
    pub(super) arguments: Vec<(usize, usize, Id)>,
    /// `V_z`: argument, value.
    pub(super) value: Vec<(usize, Id)>,
    /// First component that is an unknown.
    pub(super) first: usize,
}

impl Implicit {
    /// Of the roots in a graph of unknowns (states) and arguments (parameters).
    fn new(mut dag: Dag, n: usize, m: usize, least: bool, roots: &[Id]) -> Result<Implicit> {
        let dims = Dims { x: n, u: 0, p: m };
        let saved = SavedGraph::new(&dag, roots).ok().filter(|g| g.functions().is_empty());
        let saved = saved.map(|graph| SavedImplicit { unknowns: n, arguments: m, least, graph });
        let (own, start) = roots.split_at(roots.len() - n);
        let w = dag.inputs(Block::X, n);
        let z = dag.inputs(Block::P, m);
        let equations = if least { dag.dense_jacobian(&own[..1], &w)? } else { own.to_vec() };
        let matrix = dag.dense_jacobian(&equations, &w)?;
        let arguments = dag.jacobian(&equations, &z)?.into_iter().map(|e| (e.row, e.col, e.value)).collect();
        let tape = |dag: &Dag, outputs: &[Id]| Tape::new(dag, dims, 0, outputs);
        let (own_cost, own_value) = (own[0], own[own.len().min(2) - 1]);
        let (mut value, mut programs) = (Vec::new(), None);
        if least {
            value = dag.jacobian(&own[1..2], &z)?.into_iter().map(|e| (e.col, e.value)).collect();
            programs = Some((tape(&dag, &own[..1])?, tape(&dag, &own[1..2])?));
        }
        let n_out = n + usize::from(least);
        Ok(Implicit {
            n,
            dims: Dims { x: m, u: 0, p: 0 },
            saved,
            residual: tape(&dag, &equations)?,
            jacobian: tape(&dag, &matrix)?,
            start: tape(&dag, start)?,
            // the cost of a signed distance is not its value
            largest: least && own_cost != own_value,
            least: programs,
            jac_pattern: Pattern::dense(n_out, m + 1),
            hess_pattern: Pattern::empty(m + 1, m + 1),
            own: Templates { dag, matrix, arguments, value },
        })
    }

    /// The implicit function behind an external one.
    pub(super) fn of(f: &External) -> Option<&Implicit> {
        f.as_any()?.downcast_ref()
    }

    /// Number of unknowns.
    pub(super) fn unknowns(&self) -> usize {
        self.n
    }

    /// Does it minimise?
    pub(super) fn is_least(&self) -> bool {
        self.least.is_some()
    }

    /// Its programs of unknowns (states) and arguments (parameters), by what they compute.
    pub(super) fn programs(&self) -> impl Iterator<Item = (&'static str, &Tape)> {
        let least = self.least.iter().flat_map(|(cost, value)| [("cost", cost), ("least", value)]);
        [("start", &self.start), ("residual", &self.residual), ("matrix", &self.jacobian)].into_iter().chain(least)
    }

    /// It as data, where it calls no function of the user.
    pub(super) fn saved(&self) -> Option<&SavedImplicit> {
        self.saved.as_ref()
    }

    /// Bounds of a signed distance where its arguments are in intervals, `z[2 i]` to `z[2 i + 1]`.
    ///
    /// A largest value is no less than the value at any place, and so than that at the place of the middle. Where this is positive the bodies
    /// are apart, and the only maximum is found.
    pub(super) fn value_bounds(&self, z: &[f64], work: &mut [f64]) -> Option<[f64; 2]> {
        let (n, m) = (self.n, self.dims.x);
        let (_, value) = self.least.as_ref().filter(|_| self.largest)?;
        let (low, work) = work.split_at_mut(m);
        let (high, work) = work.split_at_mut(m);
        let (middle, work) = work.split_at_mut(m);
        let (found, work) = work.split_at_mut(n + 1);
        for (i, c) in z.chunks_exact(2).take(m).enumerate() {
            (low[i], high[i], middle[i]) = (c[0], c[1], 0.5 * (c[0] + c[1]));
        }
        if !middle.iter().all(|c| c.is_finite()) {
            return None;
        }
        self.value(&Point { t: 0.0, x: middle, u: &[], p: &[] }, found, work).ok()?;
        let w = &found[1..];
        let (mut least, mut most) = ([0.0], [0.0]);
        value.bounds(&point(w, low), &point(w, high), &mut least, &mut most, work);
        // the direction has length one to rounding
        let length = norm(w);
        let least = least[0] / (length * (1.0 + 8.0 * f64::EPSILON));
        (least > 0.0).then_some([least, f64::INFINITY])
    }

    /// Unknowns of an inner problem of that size by Newton's method with a matrix that is made positive: every step descends.
    fn descend(&self, z: &[f64], f: &Tape, w: &mut [f64], a: &mut Arrays) -> EvalResult {
        let n = self.n;
        let (mut last, mut scale) = (f64::INFINITY, 0.0);
        for _ in 0..MOST_STEPS {
            let f0 = value(f, w, z, a.work)?;
            self.residual.run(&point(w, z), &[], a.residual, a.work)?;
            self.jacobian.run(&point(w, z), &[], a.matrix, a.work)?;
            let shifted = positive_step(n, a.matrix, a.residual, a.factor, a.step);
            let size = largest(a.step);
            scale = largest(w).max(scale);
            let slope: f64 = a.step.iter().zip(&*a.residual).map(|(d, g)| d * g).sum();
            // terms may cancel: they are as large as the curvature makes them over the unknowns
            let rounding = ROUNDING * (f0.abs() + largest(a.matrix) * scale * scale);
            let certain = slope.abs() > rounding;
            let stays = size >= 0.5 * last;
            if !shifted && (size <= LAST_STEP * largest(w) || stays && size <= ROUNDED_STEP * scale) {
                w.iter_mut().zip(&*a.step).for_each(|(w, d)| *w += d);
                return Ok(());
            }
            // where the cost is nearly flat rounding moves the unknowns for ever, and the value no more
            if !shifted && stays && !certain {
                return Ok(());
            }
            last = if shifted { f64::INFINITY } else { size };
            let good = |t: f64, now: EvalResult, v: f64| now.is_ok() && (!certain || v <= f0 + ARMIJO * t * slope);
            // where second derivatives jump, as those of tables do, steps end just before, and no place shows that it is better
            let (t, defined) = search(w, a, |trial, a| value(f, trial, z, a.work), good)?;
            if certain && defined && t * slope.abs() <= rounding {
                return Ok(());
            }
        }
        Err(EvalError::Recoverable)
    }

    /// Unknowns of equations by Newton's method with steps that make them smaller.
    fn find(&self, z: &[f64], w: &mut [f64], a: &mut Arrays) -> EvalResult {
        let n = self.n;
        let (mut last, mut scale) = (f64::INFINITY, 0.0);
        for _ in 0..MOST_STEPS {
            self.residual.run(&point(w, z), &[], a.residual, a.work)?;
            self.jacobian.run(&point(w, z), &[], a.matrix, a.work)?;
            a.factor[..n * n].copy_from_slice(a.matrix);
            if !linear::factor(n, a.factor) {
                return Err(EvalError::Recoverable);
            }
            a.step.iter_mut().zip(&*a.residual).for_each(|(d, g)| *d = -g);
            linear::solve(n, a.factor, false, a.step);
            let size = largest(a.step);
            scale = largest(w).max(scale);
            let rounded = size <= ROUNDED_STEP * scale;
            if size <= LAST_STEP * largest(w) || (rounded && size >= 0.5 * last) {
                w.iter_mut().zip(&*a.step).for_each(|(w, d)| *w += d);
                return Ok(());
            }
            last = size;
            let g0 = norm(a.residual);
            let good = |t: f64, now: EvalResult, g: f64| now.is_ok() && (rounded || g <= (1.0 - ARMIJO * t) * g0);
            search(
                w,
                a,
                |trial, a| self.residual.run(&point(trial, z), &[], a.residual, a.work).map(|()| norm(a.residual)),
                good,
            )?;
        }
        Err(EvalError::Recoverable)
    }
}

/// Goes along the step, as far as it is good: by which share of it, and was the merit defined wherever it was asked for?
fn search(
    w: &mut [f64],
    a: &mut Arrays,
    mut merit: impl FnMut(&[f64], &mut Arrays) -> std::result::Result<f64, EvalError>,
    good: impl Fn(f64, EvalResult, f64) -> bool,
) -> std::result::Result<(f64, bool), EvalError> {
    let (mut t, mut defined) = (1.0, true);
    let trial = std::mem::take(&mut a.trial);
    let mut found = Err(EvalError::Recoverable);
    for _ in 0..MOST_HALVINGS {
        for ((v, w), d) in trial.iter_mut().zip(&*w).zip(&*a.step) {
            *v = w + t * d;
        }
        let (result, v) = match merit(trial, a) {
            Ok(v) => (Ok(()), v),
            Err(EvalError::Recoverable) => (Err(EvalError::Recoverable), f64::INFINITY),
            Err(e) => {
                found = Err(e);
                break;
            }
        };
        if good(t, result, v) {
            found = Ok((t, defined));
            w.copy_from_slice(trial);
            break;
        }
        defined &= result.is_ok();
        t *= 0.5;
    }
    a.trial = trial;
    found
}

/// Memory of one solution.
struct Arrays<'a> {
    step: &'a mut [f64],
    trial: &'a mut [f64],
    residual: &'a mut [f64],
    matrix: &'a mut [f64],
    factor: &'a mut [f64],
    work: &'a mut [f64],
}

fn point<'a>(w: &'a [f64], z: &'a [f64]) -> Point<'a> {
    Point { t: 0.0, x: w, u: &[], p: z }
}

fn value(f: &Tape, w: &[f64], z: &[f64], work: &mut [f64]) -> std::result::Result<f64, EvalError> {
    let mut v = [0.0];
    f.run(&point(w, z), &[], &mut v, work)?;
    Ok(v[0])
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, c| c.abs().max(m))
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// The step `−(H + τ I)⁻¹ g` with the least `τ` of a doubling row with which the matrix is positive definite; is that not zero?
fn positive_step(n: usize, h: &[f64], g: &[f64], factor: &mut [f64], step: &mut [f64]) -> bool {
    let size = largest(h).max(f64::MIN_POSITIVE);
    let mut tau = 0.0;
    loop {
        factor[..n * n].copy_from_slice(h);
        (0..n).for_each(|i| factor[i + n * i] += tau);
        if cholesky(n, factor, size) {
            break;
        }
        tau = if tau == 0.0 { 1e-3 * size } else { 2.0 * tau };
        if !tau.is_finite() {
            break;
        }
    }
    for i in 0..n {
        let known: f64 = (0..i).map(|j| factor[i + n * j] * step[j]).sum();
        step[i] = (-g[i] - known) / factor[i + n * i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| factor[j + n * i] * step[j]).sum();
        step[i] = (step[i] - known) / factor[i + n * i];
    }
    tau != 0.0
}

/// `A = L Lᵀ`, in the lower half; false where a pivot is not positive to the digits of the matrix.
fn cholesky(n: usize, a: &mut [f64], size: f64) -> bool {
    for k in 0..n {
        let pivot = a[k + n * k] - (0..k).map(|j| a[k + n * j] * a[k + n * j]).sum::<f64>();
        if pivot.is_nan() || pivot <= f64::EPSILON * size {
            return false;
        }
        a[k + n * k] = pivot.sqrt();
        for i in k + 1..n {
            let known: f64 = (0..k).map(|j| a[i + n * j] * a[k + n * j]).sum();
            a[i + n * k] = (a[i + n * k] - known) / a[k + n * k];
        }
    }
    true
}

impl Function for Implicit {
    fn name(&self) -> &str {
        if self.least.is_some() {
            "least"
        } else {
            "implicit"
        }
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.n + usize::from(self.least.is_some())
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac_pattern
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess_pattern
    }
    fn work_len(&self) -> usize {
        let n = self.n;
        let tapes = [&self.residual, &self.jacobian, &self.start].into_iter();
        let tapes = tapes.chain(self.least.iter().flat_map(|(f, v)| [f, v]));
        let point = 5 * n + 2 * n * n + tapes.map(Tape::work_len).max().unwrap_or(0);
        // bounds need a point, corners of a box, and intervals
        let bounds = self.least.as_ref().map_or(0, |(_, v)| 2 * v.work_len());
        point.max(bounds) + 4 * self.dims.x + 2 * n + 4
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let n = self.n;
        let (step, work) = work.split_at_mut(n);
        let (trial, work) = work.split_at_mut(n);
        let (residual, work) = work.split_at_mut(n);
        let (matrix, work) = work.split_at_mut(n * n);
        let (factor, work) = work.split_at_mut(n * n + n);
        let (w, work) = work.split_at_mut(n);
        w.fill(0.0);
        self.start.run(&point(w, at.x), &[], trial, work)?;
        w.copy_from_slice(trial);
        let mut a = Arrays { step, trial, residual, matrix, factor, work };
        match &self.least {
            Some((f, v)) => {
                self.descend(at.x, f, w, &mut a)?;
                out[0] = value(v, w, at.x, a.work)?;
                out[1..=n].copy_from_slice(w);
            }
            None => {
                self.find(at.x, w, &mut a)?;
                out[..n].copy_from_slice(w);
            }
        }
        Ok(())
    }
    fn jacobian(&self, _: &Point, _: &mut [f64], _: &mut [f64]) -> EvalResult {
        // its derivatives are nodes, see `Dag::implicit_partials`
        Err(EvalError::Recoverable)
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Err(EvalError::Recoverable)
    }
    fn as_any(&self) -> Option<&dyn std::any::Any> {
        Some(self)
    }
}

impl Dag {
    /// `n` unknowns, for [`Dag::implicit`] and [`Dag::inner_minimum`]: they stand for what these find.
    pub fn unknowns(&mut self, n: usize) -> Vec<Id> {
        let first = self.n_unknowns;
        self.n_unknowns += n;
        (first..first + n).map(|i| self.input(Block::Unknown, i)).collect()
    }

    /// The solution of as many equations `G = 0` as there are unknowns, found by a damped Newton method from `start`. It has as many
    /// derivatives as the equations where their Jacobian with respect to the unknowns is regular.
    ///
    /// Where none is found the expression is not defined, as a root of a negative number is not.
    ///
    /// # Errors
    /// [`Error::Dimension`] for other numbers of equations or starts; [`Error::Range`] for unknowns that are none, or do not occur, and for
    /// starts that depend on them; [`Error::Unsupported`] for operators that switch.
    pub fn implicit(&mut self, equations: &[Id], unknowns: &[Id], start: &[Id]) -> Result<Vec<Id>> {
        if equations.len() != unknowns.len() {
            return Err(Error::Dimension(format!(
                "{} equations for {} unknowns: there must be as many",
                equations.len(),
                unknowns.len()
            )));
        }
        self.solved(false, equations, unknowns, start)
    }

    /// The least value of `cost` over the unknowns near `start`, and where it is: Newton's method with descent in every step. The value has
    /// as many derivatives as the cost where its second derivatives are positive definite.
    ///
    /// # Errors
    /// As [`Dag::implicit`].
    pub fn inner_minimum(&mut self, cost: Id, unknowns: &[Id], start: &[Id]) -> Result<(Id, Vec<Id>)> {
        self.value_at_minimum(cost, cost, unknowns, start)
    }

    /// Signed distance of two strictly convex bodies, and the unit normal from the second to the first.
    ///
    /// ```text
    /// gap(c) = max over |d| = 1 of  d · c − h(d),      h(d) = h_A(−d) + h_B(d)
    /// ```
    ///
    /// `between` is the way `c` from the origin of B to that of A, `support` the sum `h` of support functions `h_K(d) = max of d · x over K`, an
    /// expression of the unknowns `direction`. Positive values are distances, negative ones how far the bodies have to be moved apart. The gap
    /// is smooth through zero, down to an overlap of the sum of the radii of curvature at the contact: its derivative is the normal, and the
    /// point of contact of B is the gradient of `h_B`. `size` is a length of the order of the bodies, which scales the iteration.
    ///
    /// See Gilbert and Foo 1990, Cameron and Culley 1986; that the maximiser is differentiable is the implicit function theorem.
    ///
    /// # Errors
    /// As [`Dag::implicit`]; [`Error::Range`] for a size that is not positive.
    pub fn signed_distance(
        &mut self,
        between: &[Id],
        support: Id,
        direction: &[Id],
        start: &[Id],
        size: f64,
    ) -> Result<(Id, Vec<Id>)> {
        if between.len() != direction.len() {
            let (n, m) = (between.len(), direction.len());
            return Err(Error::Dimension(format!("the way between the bodies has {n} components, the direction {m}")));
        }
        if !(size > 0.0 && size.is_finite()) {
            return Err(Error::Range(format!("the size of the bodies is {size}: it must be positive")));
        }
        let along = self.dot(direction, between)?;
        let value = self.sub(along, support);
        // the ratio does not depend on the length of the direction, which a second term makes one
        let square = self.dot(direction, direction)?;
        let length = self.unary(Unary::Sqrt, square);
        let scale = self.constant(-1.0 / size);
        let ratio = self.div(value, length);
        let ratio = self.mul(scale, ratio);
        let one = self.constant(1.0);
        let off = self.sub(square, one);
        let off = self.powi(off, 2);
        let half = self.constant(0.5);
        let off = self.mul(half, off);
        let cost = self.add(ratio, off);
        self.value_at_minimum(cost, value, direction, start)
    }

    /// The same with another value, whose derivatives along all ways of the minimiser vanish as well.
    fn value_at_minimum(&mut self, cost: Id, value: Id, unknowns: &[Id], start: &[Id]) -> Result<(Id, Vec<Id>)> {
        let all = self.solved(true, &[cost, value], unknowns, start)?;
        Ok((all[0], all[1..].to_vec()))
    }

    /// Unknowns of all inner problems that are solved where the nodes are evaluated.
    pub fn inner_unknowns(&self, roots: &[Id]) -> usize {
        let problem = |id: Id| match self.node(id) {
            Node::Pick(g, _) => match &self.groups[g as usize].group {
                Group::Call { function, .. } => Implicit::of(&self.functions[*function as usize]).map(|f| (g, f.n)),
                _ => None,
            },
            _ => None,
        };
        let found: BTreeMap<u32, usize> = self.reachable(roots).into_iter().filter_map(problem).collect();
        found.values().sum()
    }

    fn solved(&mut self, least: bool, own: &[Id], unknowns: &[Id], start: &[Id]) -> Result<Vec<Id>> {
        let n = unknowns.len();
        if n == 0 || start.len() != n {
            return Err(Error::Dimension(format!(
                "{} starts for {n} unknowns: there must be as many, and one at least",
                start.len()
            )));
        }
        for (k, &w) in unknowns.iter().enumerate() {
            if !matches!(self.node(w), Node::Input(Block::Unknown, _)) || unknowns[..k].contains(&w) {
                let text = self.text(w);
                return Err(Error::Range(format!(
                    "unknown {k}, {text}, is none, or there twice: make unknowns with unknowns(n)"
                )));
            }
        }
        let roots: Vec<Id> = own.iter().chain(start).copied().collect();
        let all = self.reachable(&roots);
        if all.iter().any(|&id| matches!(self.node(id), Node::Select(..)) || self.is_condition(id)) {
            return Err(Error::Unsupported(
                "an inner problem does not switch: sign, abs, min, max, where and conditions have no place in it"
                    .into(),
            ));
        }
        // what depends on the unknowns is copied, and all else that it uses is an argument
        let mut depends: BTreeSet<Id> = unknowns.iter().copied().collect();
        for &id in &all {
            let mut any = false;
            self.for_children(id, |c| any |= depends.contains(&c));
            if any {
                depends.insert(id);
            }
        }
        if let Some(k) = start.iter().position(|s| depends.contains(s)) {
            return Err(Error::Range(format!("start {k} depends on the unknowns: it says where they are looked for")));
        }
        if let Some(k) = unknowns.iter().position(|w| all.binary_search(w).is_err()) {
            return Err(Error::Range(format!("unknown {k} does not occur: nothing says what it is")));
        }
        let mut args: Vec<Id> = Vec::new();
        let mut take = |dag: &Dag, id: Id| {
            if !depends.contains(&id) && dag.as_const(id).is_none() && !args.contains(&id) {
                args.push(id);
            }
        };
        for &id in all.iter().filter(|id| depends.contains(id)) {
            self.for_children(id, |c| take(self, c));
        }
        roots.iter().for_each(|&r| take(self, r));
        let mut inner = Dag::new();
        let mut made: BTreeMap<Id, Id> = BTreeMap::new();
        for (k, &w) in unknowns.iter().enumerate() {
            made.insert(w, inner.input(Block::X, k));
        }
        for (k, &a) in args.iter().enumerate() {
            made.insert(a, inner.input(Block::P, k));
        }
        let roots = inner.copy_from(self, &roots, &mut made)?;
        let f = Implicit::new(inner, n, args.len(), least, &roots)?;
        self.call_implicit(f, &args)
    }

    /// Components of an implicit function at arguments; one that is there already is taken.
    fn call_implicit(&mut self, f: Implicit, args: &[Id]) -> Result<Vec<Id>> {
        let same = |g: &&External| f.saved.is_some() && Implicit::of(g).is_some_and(|g| g.saved == f.saved);
        let known = self.functions.iter().find(same).cloned();
        let f = known.unwrap_or_else(|| Arc::new(f));
        let mut args = args.to_vec();
        // implicit functions do not depend on the time by themselves
        args.push(self.constant(0.0));
        self.call(&f, &args)
    }

    /// Components of a saved implicit function.
    pub(super) fn restore_implicit(&mut self, s: &SavedImplicit, args: &[Id]) -> Result<Vec<Id>> {
        let own = if s.least { 2 } else { s.unknowns };
        if args.len() != s.arguments || s.unknowns == 0 || s.graph.n_roots() != own + s.unknowns {
            return Err(Error::Dimension(format!(
                "an implicit function of {} unknowns and {} arguments has {} expressions and is called with {}",
                s.unknowns,
                s.arguments,
                s.graph.n_roots(),
                args.len()
            )));
        }
        let known =
            self.functions.iter().find(|f| Implicit::of(f).is_some_and(|f| f.saved.as_ref() == Some(s))).cloned();
        if let Some(f) = known {
            let mut args = args.to_vec();
            args.push(self.constant(0.0));
            return self.call(&f, &args);
        }
        let mut inner = Dag::new();
        let roots = s.graph.restore(&mut inner, &[])?;
        if inner
            .reachable(&roots)
            .iter()
            .any(|&id| matches!(inner.node(id), Node::Select(..)) || inner.is_condition(id))
        {
            return Err(Error::Unsupported("an inner problem does not switch".into()));
        }
        let f = Implicit::new(inner, s.unknowns, s.arguments, s.least, &roots)?;
        self.call_implicit(f, args)
    }

    /// Copies expressions of another graph: `made` says what takes the place of nodes, and is added to.
    fn copy_from(&mut self, other: &Dag, roots: &[Id], made: &mut BTreeMap<Id, Id>) -> Result<Vec<Id>> {
        let mut open: Vec<Id> = roots.to_vec();
        let mut met: BTreeSet<Id> = BTreeSet::new();
        while let Some(id) = open.pop() {
            if !made.contains_key(&id) && met.insert(id) {
                other.for_children(id, |c| open.push(c));
            }
        }
        let mut groups: BTreeMap<u32, u32> = BTreeMap::new();
        for id in met {
            let at = |a: Id| made[&a];
            let copy = match other.node(id) {
                Node::Const(bits) => self.constant(f64::from_bits(bits)),
                Node::Input(block, i) => self.input(block, i as usize),
                Node::Unary(op, a) => self.unary(op, at(a)),
                Node::Binary(op, a, b) => self.binary(op, at(a), at(b)),
                Node::PowI(a, n) => self.powi(at(a), n),
                Node::Piecewise(table, order, a) => {
                    self.piecewise_derivative(&other.piecewise[table as usize], order, at(a))
                }
                Node::Pick(g, k) => {
                    let h = self.copy_group_from(other, g, made, &mut groups)?;
                    self.pick(h, k as usize)
                }
                _ => return Err(Error::Internal("an inner problem with a condition".into())),
            };
            made.insert(id, copy);
        }
        Ok(roots.iter().map(|r| made[r]).collect())
    }

    fn copy_group_from(
        &mut self,
        other: &Dag,
        g: u32,
        made: &BTreeMap<Id, Id>,
        groups: &mut BTreeMap<u32, u32>,
    ) -> Result<u32> {
        if let Some(&h) = groups.get(&g) {
            return Ok(h);
        }
        let at = |v: &[Id]| v.iter().map(|a| made[a]).collect::<Vec<Id>>();
        let entry = &other.groups[g as usize];
        let group = match &entry.group {
            Group::Factor { n, matrix } => Group::Factor { n: *n, matrix: at(matrix) },
            Group::Solve { factor, transposed, rhs } => {
                let factor = self.copy_group_from(other, *factor, made, groups)?;
                Group::Solve { factor, transposed: *transposed, rhs: at(rhs) }
            }
            Group::Call { function, what, args } => {
                let function = self.function_number(&other.functions[*function as usize]);
                Group::Call { function, what: *what, args: at(args) }
            }
        };
        let h = self.group(group, entry.n as usize);
        groups.insert(g, h);
        Ok(h)
    }

    /// Derivatives of the implicit function whose components are those of group `g`; none where it is another function.
    pub(super) fn implicit_partials(&mut self, function: u32, g: u32, args: &[Id]) -> Result<Option<Partials>> {
        let f = self.functions[function as usize].clone();
        let Some(f) = Implicit::of(&f) else { return Ok(None) };
        let first = usize::from(f.least.is_some());
        let own = &f.own;
        let mut made: BTreeMap<Id, Id> = BTreeMap::new();
        for id in 0..own.dag.len() {
            let id = own.dag.id(id)?;
            match own.dag.node(id) {
                Node::Input(Block::X, k) => made.insert(id, self.pick(g, first + k as usize)),
                Node::Input(Block::P, k) => made.insert(id, args[k as usize]),
                _ => None,
            };
        }
        let mut at = |dag: &mut Dag, id: Id| dag.copy_from(&own.dag, &[id], &mut made).map(|v| v[0]);
        let matrix = own.matrix.iter().map(|&id| at(self, id)).collect::<Result<Vec<Id>>>()?;
        let mut arguments = Vec::with_capacity(own.arguments.len());
        for &(row, arg, id) in &own.arguments {
            arguments.push((row, arg, at(self, id)?));
        }
        let mut value = Vec::with_capacity(own.value.len());
        for &(arg, id) in &own.value {
            value.push((arg, at(self, id)?));
        }
        Ok(Some(Partials { n: f.n, matrix, arguments, value, first }))
    }

    /// Solution with the matrix of an implicit function.
    pub(super) fn solve_implicit(&mut self, p: &Partials, transposed: bool, rhs: &[Id]) -> Vec<Id> {
        if p.n == 1 {
            return vec![self.div(rhs[0], p.matrix[0])];
        }
        let factor = self.group(Group::Factor { n: p.n as u32, matrix: p.matrix.clone() }, 0);
        self.solve_factored(factor, transposed, rhs)
    }
}

#[cfg(test)]
mod tests {
    use super::super::function::ExprFunction;
    use super::*;

    /// Value and derivatives against those of a closed form.
    fn agree(dag: &mut Dag, nx: usize, a: Id, b: Id, points: &[Vec<f64>]) {
        let dims = Dims { x: nx, u: 0, p: 0 };
        let [f, g] = [a, b].map(|id| ExprFunction::new("f", dag, dims, &[id]).unwrap());
        let full = |f: &ExprFunction, x: &[f64]| {
            let mut work = vec![0.0; f.work_len()];
            let at = Point { t: 0.0, x, u: &[], p: &[] };
            let (mut v, mut j) = (vec![0.0], vec![0.0; f.jac_pattern().nnz()]);
            let mut h = vec![0.0; f.hess_pattern().nnz()];
            f.value(&at, &mut v, &mut work).unwrap();
            f.jacobian(&at, &mut j, &mut work).unwrap();
            f.hessian(&at, &[1.0], &mut h, &mut work).unwrap();
            for (pattern, values) in [(f.jac_pattern(), j), (f.hess_pattern(), h)] {
                let mut dense = vec![0.0; nx * nx];
                for c in 0..nx {
                    pattern.range(c).for_each(|k| dense[pattern.row_idx()[k] * nx + c] = values[k]);
                }
                v.extend(dense);
            }
            v
        };
        for x in points {
            for (a, b) in full(&f, x).iter().zip(full(&g, x)) {
                assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()), "{x:?}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_root_has_the_derivatives_of_its_closed_form() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 2);
        let w = d.unknowns(1);
        // w³ + w = x + y²,  y = x1; then w of what w is: a root within a root
        let cube = d.powi(w[0], 3);
        let left = d.add(cube, w[0]);
        let square = d.powi(x[1], 2);
        let right = d.add(x[0], square);
        let equation = d.sub(left, right);
        let root = d.implicit(&[equation], &w, &[right]).unwrap();
        let cube = d.powi(root[0], 3);
        let back = d.add(cube, root[0]);
        agree(&mut d, 2, back, right, &[vec![0.0, 0.0], vec![3.0, -2.0], vec![-1e3, 1.0], vec![1e-3, 1e-3]]);
    }

    #[test]
    fn the_least_value_has_the_derivatives_of_its_closed_form() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 2);
        let w = d.unknowns(2);
        // w0² + w0 w1 + w1² − x0 w0 − x1 w1 has the least value −(x0² − x0 x1 + x1²)/3
        let terms = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| d.mul(w[i], w[j]));
        let linear = d.dot(&w, &x).unwrap();
        let sum = d.add(terms[0], terms[1]);
        let sum = d.add(sum, terms[2]);
        let cost = d.sub(sum, linear);
        let zero = d.constant(0.0);
        let (least, at) = d.inner_minimum(cost, &w, &[zero, zero]).unwrap();
        let terms = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| d.mul(x[i], x[j]));
        let sum = d.sub(terms[1], terms[0]);
        let sum = d.sub(sum, terms[2]);
        let third = d.constant(1.0 / 3.0);
        let closed = d.mul(third, sum);
        let points = [vec![0.0, 0.0], vec![3.0, -2.0], vec![-1e3, 1.0]];
        agree(&mut d, 2, least, closed, &points);
        let two = d.constant(2.0);
        let twice = d.mul(two, x[0]);
        let place = d.sub(twice, x[1]);
        let place = d.mul(third, place);
        agree(&mut d, 2, at[0], place, &points);
    }

    #[test]
    fn the_gap_of_circles_is_their_distance() {
        let mut d = Dag::new();
        let c = d.inputs(Block::X, 3);
        let w = d.unknowns(3);
        let square = d.dot(&w, &w).unwrap();
        let length = d.unary(Unary::Sqrt, square);
        let sum = d.constant(1.5);
        let support = d.mul(sum, length);
        // not the direction itself
        let one = d.constant(1.0);
        let start = [c[0], c[1], one];
        let (gap, normal) = d.signed_distance(&c, support, &w, &start, 1.0).unwrap();
        let square = d.dot(&c, &c).unwrap();
        let distance = d.unary(Unary::Sqrt, square);
        let closed = d.sub(distance, sum);
        let points = [vec![1.0, 1.0, 0.1], vec![-3.0, 0.5, 2.0], vec![0.5, 0.1, 1.0], vec![100.0, 10.0, 3.0]];
        agree(&mut d, 3, gap, closed, &points);
        let first = d.div(c[0], distance);
        agree(&mut d, 3, normal[0], first, &points);
    }

    #[test]
    fn bounds_of_gaps_hold_and_are_of_use() {
        let mut d = Dag::new();
        let c = d.inputs(Block::X, 2);
        let w = d.unknowns(2);
        let four = d.constant(4.0);
        let squares = [0, 1].map(|i| d.powi(w[i], 2));
        let wide = d.mul(four, squares[0]);
        let inside = d.add(wide, squares[1]);
        let support = d.unary(Unary::Sqrt, inside);
        let (gap, _) = d.signed_distance(&c, support, &w, &c, 2.0).unwrap();
        // next to a value of a table of the same input
        let clamp = crate::expr::Piecewise::lines(&[-1.0, 1.0], &[-1.0, 1.0]).unwrap();
        let near = d.piecewise(&clamp, c[0]);
        let f = ExprFunction::new("f", &mut d, Dims { x: 2, u: 0, p: 0 }, &[gap, near]).unwrap();
        let mut work = vec![0.0; 2 * f.work_len()];
        for (low, high) in
            [([3.0, 1.0], [3.5, 1.5]), ([-9.0, -4.0], [-8.0, 4.0]), ([0.2, 3.0], [0.4, 3.1]), ([0.3, 0.4], [0.5, 0.5])]
        {
            let (mut least, mut most) = ([0.0; 2], [0.0; 2]);
            assert!(f.bounds(&point(&low, &[]), &point(&high, &[]), &mut least, &mut most, &mut work));
            let mut smallest = f64::INFINITY;
            for i in 0..=10 {
                for j in 0..=10 {
                    let x = [
                        low[0] + (high[0] - low[0]) * f64::from(i) / 10.0,
                        low[1] + (high[1] - low[1]) * f64::from(j) / 10.0,
                    ];
                    let mut v = [0.0; 2];
                    f.value(&point(&x, &[]), &mut v, &mut work).unwrap();
                    assert!(least[0] <= v[0] && v[0] <= most[0] && least[1] <= v[1] && v[1] <= most[1], "{x:?}");
                    smallest = smallest.min(v[0]);
                }
            }
            // far away they are close, and nothing is said of bodies that overlap
            assert!(smallest < 0.0 || least[0] > 0.5 * smallest, "{least:?} {smallest}");
            assert!(most[1] - least[1] <= high[0] - low[0] + 1e-12);
        }
    }

    #[test]
    fn what_is_no_inner_problem_is_refused() {
        let mut d = Dag::new();
        let x = d.input(Block::X, 0);
        let w = d.unknowns(1);
        let f = d.sub(w[0], x);
        assert!(matches!(d.implicit(&[f], &[x], &[x]), Err(Error::Range(_))));
        assert!(matches!(d.implicit(&[f], &w, &[]), Err(Error::Dimension(_))));
        assert!(matches!(d.implicit(&[x], &w, &[x]), Err(Error::Range(_))));
        assert!(matches!(d.implicit(&[f], &w, &w), Err(Error::Range(_))));
        let s = d.sign(f);
        assert!(matches!(d.implicit(&[s], &w, &[x]), Err(Error::Unsupported(_))));
        assert!(matches!(d.signed_distance(&[x], x, &w, &[x], 0.0), Err(Error::Range(_))));
        // an unknown is nothing by itself
        let dims = Dims { x: 1, u: 0, p: 0 };
        assert!(matches!(ExprFunction::new("f", &mut d, dims, &w), Err(Error::Range(_))));
        // a root that is zero but for rounding
        let sine = d.unary(Unary::Sin, x);
        let one = d.constant(1.0);
        let at_zero = {
            let cube = d.powi(w[0], 3);
            let sum = d.add(w[0], cube);
            let equation = d.sub(sum, sine);
            let root = d.implicit(&[equation], &w, &[one]).unwrap();
            ExprFunction::new("f", &mut d, dims, &root).unwrap()
        };
        for k in 0..20 {
            let (mut v, mut work) = ([1.0], vec![0.0; at_zero.work_len()]);
            let x = [std::f64::consts::PI * f64::from(k)];
            at_zero.value(&Point { t: 0.0, x: &x, u: &[], p: &[] }, &mut v, &mut work).unwrap();
            assert!((v[0] - x[0].sin()).abs() < 1e-20 + 1e-9 * x[0].sin().abs(), "{v:?} {x:?}");
        }
        // no root: no value
        let square = d.powi(w[0], 2);
        let equation = d.add(square, one);
        let equation = d.add(equation, x);
        let root = d.implicit(&[equation], &w, &[x]).unwrap();
        let f = ExprFunction::new("f", &mut d, dims, &root).unwrap();
        let mut work = vec![0.0; f.work_len()];
        let at = |x| f.value(&Point { t: 0.0, x, u: &[], p: &[] }, &mut [0.0], &mut work.clone());
        assert_eq!(at(&[3.0]), Err(EvalError::Recoverable));
        assert_eq!(at(&[-2.0]), Ok(()));
        work.clear();
    }

    #[test]
    fn implicit_functions_are_saved_and_shared() {
        let mut d = Dag::new();
        let x = d.inputs(Block::X, 2);
        let make = |d: &mut Dag, x: Id| {
            let w = d.unknowns(1);
            let cube = d.powi(w[0], 3);
            let left = d.add(cube, w[0]);
            let equation = d.sub(left, x);
            d.implicit(&[equation], &w, &[x]).unwrap()[0]
        };
        let (a, b) = (make(&mut d, x[0]), make(&mut d, x[1]));
        assert_eq!(d.functions.len(), 1);
        let sum = d.add(a, b);
        let saved = SavedGraph::new(&d, &[sum]).unwrap();
        let text = serde_json::to_string(&saved).unwrap();
        let read: SavedGraph = serde_json::from_str(&text).unwrap();
        let restored = read.restore(&mut d, &[]).unwrap();
        assert_eq!((restored[0], d.functions.len()), (sum, 1));
        let mut other = Dag::new();
        let ids = read.restore(&mut other, &[]).unwrap();
        assert_eq!(SavedGraph::new(&other, &ids).unwrap(), saved);
        let f = ExprFunction::new("f", &mut d, Dims { x: 2, u: 0, p: 0 }, &[sum]).unwrap();
        let code = crate::expr::write_c(&[&f]).unwrap();
        assert_eq!(code.matches("f_inner0_value(double").count(), 1);
    }
}
