//! A problem of a file as a program with pairs of variables, and what is found for it as values of the problem.
//!
//! A variable `x_j` of the problem is `o + s w_j` with a variable `w_j ≥ 0` of the program where one of its bounds takes part in a
//! complementarity constraint. The constraint `F` becomes another variable, `F − v = 0`, `0 ≤ w_j ⊥ v ≥ 0`. Where both bounds
//! take part it is `F = p − q`, with `0 ≤ x_j − l ⊥ p ≥ 0` and `0 ≤ u − x_j ⊥ q ≥ 0`.

use crate::expression::Translation;
use crate::nl::{Body, Place, Problem, Row};
use crate::program::{Cost, Program};
use crate::statement::{Part, Statement};
use switchback::expr::Id;
use switchback::mpcc::{Conflict, Solution};
use switchback::nlp::Bounds;
use switchback::{Error, Result};

const INF: f64 = f64::INFINITY;

/// `x = offset + factor w`, a variable of the problem by one of the program.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shift {
    offset: f64,
    factor: f64,
}

/// Where the dual value of a constraint is found.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Dual {
    /// The multiplier of a row.
    Row(usize),
    /// The multiplier of the bound of a variable, times this factor.
    Bound(usize, f64),
}

/// A problem that can be solved.
pub struct Translated {
    /// The program.
    pub program: Program,
    /// Its bounds.
    pub bounds: Bounds,
    /// Where to start.
    pub start: Vec<f64>,
    /// Pairs that come from expressions with kinks or conditions.
    pub n_kinks: usize,
    shifts: Vec<Shift>,
    duals: Vec<Dual>,
    /// Variables of the program that stand for a distance of a variable of the problem from a bound, and the factor of that.
    copies: Vec<(usize, usize, f64)>,
    maximise: bool,
}

/// Values of the problem that belong to a solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// Variables.
    pub x: Vec<f64>,
    /// Change of the objective for a unit of the right-hand side of every constraint.
    pub duals: Vec<f64>,
    /// Change of the objective for a unit of the active bound of every variable.
    pub reduced_costs: Vec<f64>,
}

/// Translates a problem with one of its objectives, or with none.
///
/// # Errors
/// [`Error::Unsupported`] for operators and constraints that cannot be had, [`Error::Range`] for bounds that are none.
pub fn translate(problem: &Problem, objective: Option<usize>) -> Result<Translated> {
    let n = problem.bounds.len();
    for (j, (l, u)) in problem.bounds.iter().enumerate() {
        if *l == INF || *u == -INF {
            return Err(Error::Range(format!("variable {j} is bounded to infinity")));
        }
    }
    let mut to = Statement::default();
    for ((l, u), start) in problem.bounds.iter().zip(&problem.start) {
        let v = to.variable(*l, *u);
        to.variables[v].start = *start;
    }
    let mut b = Builder {
        problem,
        uses: uses(problem),
        shifts: vec![Shift { offset: 0.0, factor: 1.0 }; n],
        duals: Vec::new(),
        copies: Vec::new(),
        to,
    };
    b.choose_shifts()?;

    let variables = b.inputs();
    let objective = objective.map(|k| &problem.objectives[k]);
    let bodies = problem.constraints.iter().chain(objective.map(|o| &o.body));
    let roots: Vec<Place> = bodies.filter_map(|body| body.nonlinear).collect();
    let nodes = Translation::new(problem, &roots, &variables, &mut b.to)?;
    let n_kinks = b.to.pairs.len();
    // Rows of kinks come first: the start of a constraint may depend on them.
    for i in 0..problem.rows.len() {
        b.constraint(i, &nodes)?;
    }
    let mut cost = Cost::default();
    let maximise = objective.is_some_and(|o| o.maximise);
    if let Some(o) = objective {
        let (nonlinear, linear, constant) = b.body(&o.body, &nodes)?;
        let sign = if maximise { -1.0 } else { 1.0 };
        cost = Cost {
            nonlinear: nonlinear.map(|id| if maximise { b.to.dag.neg(id) } else { id }),
            linear: linear.into_iter().map(|(j, a)| (j, sign * a)).collect(),
            constant: sign * constant,
        };
    }
    let Builder { to, shifts, duals, copies, .. } = b;
    let mut start: Vec<f64> = to.variables.iter().map(|v| v.start).collect();
    let starts = to.starts.clone();
    let (mut program, bounds) = Program::new(to, cost)?;
    program.complete(&mut start, &starts);
    Ok(Translated { program, bounds, start, n_kinks, shifts, duals, copies, maximise })
}

impl Translated {
    /// The values of the problem of a point of the program with its multipliers.
    pub fn answer(&self, found: &Solution) -> Answer {
        // The multipliers are those of f + yᵀc − zᵀw, with f to be minimised.
        let sign = if self.maximise { -1.0 } else { 1.0 };
        let x = self.shifts.iter().zip(&found.x).map(|(s, w)| s.offset + s.factor * w).collect();
        let dual = |d: &Dual| match *d {
            Dual::Row(i) => -sign * found.y[i],
            Dual::Bound(j, factor) => sign * factor * found.z[j],
        };
        let mut reduced: Vec<f64> = self.shifts.iter().zip(&found.z).map(|(s, z)| sign * s.factor * z).collect();
        for d in &self.duals {
            if let Dual::Bound(j, _) = d {
                reduced[*j] = 0.0;
            }
        }
        for (j, copy, factor) in &self.copies {
            reduced[*j] += sign * factor * found.z[*copy];
        }
        Answer { x, duals: self.duals.iter().map(dual).collect(), reduced_costs: reduced }
    }

    /// Weights of the constraints and of the bounds of variables in a conflict.
    pub fn conflict(&self, conflict: &Conflict) -> (Vec<f64>, Vec<f64>) {
        let (mut rows, mut variables) = (vec![0.0; self.duals.len()], vec![0.0; self.shifts.len()]);
        let mut weights = vec![0.0; self.bounds.cl.len()];
        conflict.rows.iter().for_each(|(row, weight)| weights[*row] = *weight);
        for (weight, dual) in rows.iter_mut().zip(&self.duals) {
            if let Dual::Row(row) = dual {
                *weight = weights[*row];
            }
        }
        for (j, weight) in &conflict.variables {
            if let Some(s) = self.shifts.get(*j) {
                variables[*j] = s.factor * weight;
            }
        }
        (rows, variables)
    }

    /// The value of the problem's objective for one of the program's.
    pub fn objective(&self, value: f64) -> f64 {
        if self.maximise {
            -value
        } else {
            value
        }
    }
}

struct Builder<'a> {
    problem: &'a Problem,
    /// Complementarity constraints a variable is a member of.
    uses: Vec<usize>,
    shifts: Vec<Shift>,
    duals: Vec<Dual>,
    copies: Vec<(usize, usize, f64)>,
    to: Statement,
}

/// The only term of a constraint that is a variable by itself, and what is added to it.
fn single(problem: &Problem, body: &Body) -> Option<(usize, f64, f64)> {
    let constant = match body.nonlinear {
        None => 0.0,
        Some(p) => match problem.forest.nodes()[p as usize] {
            crate::nl::Node::Number(v) => v,
            _ => return None,
        },
    };
    match body.linear[..] {
        [(j, a)] => Some((j, a, constant)),
        _ => None,
    }
}

/// In how many complementarity constraints every variable is, as the variable or as the constraint.
fn uses(problem: &Problem) -> Vec<usize> {
    let mut uses = vec![0; problem.bounds.len()];
    for (row, body) in problem.rows.iter().zip(&problem.constraints) {
        if let Row::Complements { variable, .. } = row {
            uses[*variable] += 1;
            if let Some((k, ..)) = single(problem, body) {
                uses[k] += 1;
            }
        }
    }
    uses
}

impl Builder<'_> {
    /// The constraint of a row that is a free variable which is in no other pair: the row's value is `a x_k + c`.
    fn own_variable(&self, i: usize) -> Option<(usize, f64, f64)> {
        let Row::Complements { variable, lower, upper } = self.problem.rows[i] else { return None };
        let (k, a, c) = single(self.problem, &self.problem.constraints[i])?;
        let free = self.problem.bounds[k] == (-INF, INF);
        (lower != upper && free && self.uses[k] == 1 && k != variable && self.gap(variable) > 0.0).then_some((k, a, c))
    }

    fn gap(&self, j: usize) -> f64 {
        self.problem.bounds[j].1 - self.problem.bounds[j].0
    }

    fn shift(&mut self, j: usize, offset: f64, factor: f64) {
        let v = &mut self.to.variables[j];
        let (l, u) = ((v.lower - offset) / factor, (v.upper - offset) / factor);
        (v.lower, v.upper) = if factor > 0.0 { (l, u) } else { (u, l) };
        v.start = (v.start - offset) / factor;
        self.shifts[j] = Shift { offset, factor };
    }

    /// Decides which variables are counted from one of their bounds.
    fn choose_shifts(&mut self) -> Result<()> {
        for i in 0..self.problem.rows.len() {
            let Row::Complements { variable: j, lower, upper } = self.problem.rows[i] else { continue };
            let (l, u) = self.problem.bounds[j];
            for (takes_part, bound, name) in [(lower, l, "lower"), (upper, u, "upper")] {
                if takes_part && bound.is_infinite() {
                    return Err(Error::Unsupported(format!(
                        "constraint {i} complements the {name} bound of variable {j}, which has none: give it one"
                    )));
                }
            }
            if let Some((k, a, c)) = self.own_variable(i) {
                // F = a x + c is not negative at a lower bound, and not positive at an upper one
                self.shift(k, -c / a, if lower == (a > 0.0) { 1.0 } else { -1.0 });
                self.to.variables[k].lower = 0.0;
            }
            if self.uses[j] == 1 && u > l {
                match (lower, upper) {
                    (true, _) => self.shift(j, l, 1.0),
                    (false, true) => self.shift(j, u, -1.0),
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// The variables of the problem in the graph.
    fn inputs(&mut self) -> Vec<Id> {
        let shifts = self.shifts.clone();
        let shifted = |(j, s): (usize, &Shift)| {
            let w = self.to.input(j);
            let d = &mut self.to.dag;
            let (offset, factor) = (d.constant(s.offset), d.constant(s.factor));
            let w = d.mul(factor, w);
            d.add(offset, w)
        };
        shifts.iter().enumerate().map(shifted).collect()
    }

    /// Nonlinear part, linear terms, and constant of a body, in the variables of the program.
    #[allow(clippy::type_complexity)]
    fn body(&mut self, body: &Body, nodes: &Translation) -> Result<(Option<Id>, Vec<(usize, f64)>, f64)> {
        let mut nonlinear = body.nonlinear.map(|p| nodes.id(p)).transpose()?;
        let mut constant = 0.0;
        if let Some(v) = nonlinear.and_then(|id| self.to.dag.as_const(id)) {
            (nonlinear, constant) = (None, v);
        }
        let mut linear = Vec::with_capacity(body.linear.len());
        for (j, a) in &body.linear {
            let s = self.shifts[*j];
            constant += a * s.offset;
            linear.push((*j, a * s.factor));
        }
        if !constant.is_finite() {
            return Err(Error::NonFinite(format!("an objective or a constraint has the constant term {constant}")));
        }
        Ok((nonlinear, linear, constant))
    }

    fn constraint(&mut self, i: usize, nodes: &Translation) -> Result<()> {
        let own = self.own_variable(i);
        let (nonlinear, linear, constant) = self.body(&self.problem.constraints[i], nodes)?;
        let row = self.to.row(nonlinear, linear, -constant, -constant);
        self.duals.push(Dual::Row(row));
        let (j, lower, upper) = match self.problem.rows[i] {
            Row::Within(l, u) => {
                if l == INF || u == -INF {
                    return Err(Error::Range(format!("constraint {i} is bounded to infinity")));
                }
                (self.to.rows[row].lower, self.to.rows[row].upper) = (l - constant, u - constant);
                return Ok(());
            }
            Row::Complements { variable, lower, upper } => (variable, lower, upper),
        };
        if let Some((k, a, _)) = own {
            (self.to.rows[row].lower, self.to.rows[row].upper) = (-INF, INF);
            self.duals[i] = Dual::Bound(k, if lower { 1.0 } else { -1.0 } / a.abs());
            let w = self.distance(j, lower);
            self.to.pairs.push((w, k));
            return Ok(());
        }
        if lower != upper && self.gap(j) > 0.0 {
            let (factor, part) = if lower { (-1.0, Part::Positive) } else { (1.0, Part::Negative) };
            let v = self.to.part(row, factor, part);
            let w = self.distance(j, lower);
            self.to.pairs.push((w, v));
        } else if lower && upper && self.gap(j) > 0.0 {
            let p = self.to.part(row, -1.0, Part::Positive);
            let q = self.to.part(row, 1.0, Part::Negative);
            let (above, below) = (self.distance(j, true), self.distance(j, false));
            self.to.pairs.extend([(above, p), (below, q)]);
        } else if lower || upper {
            // The variable is fixed at a bound that takes part.
            if upper {
                self.to.rows[row].lower = -INF;
            }
            if lower {
                self.to.rows[row].upper = INF;
            }
        }
        Ok(())
    }

    /// The variable of the program that is the distance of `x_j` from its lower or its upper bound.
    fn distance(&mut self, j: usize, lower: bool) -> usize {
        let (l, u) = self.problem.bounds[j];
        let (bound, factor) = if lower { (l, 1.0) } else { (u, -1.0) };
        let s = self.shifts[j];
        if self.uses[j] == 1 && s == (Shift { offset: bound, factor }) {
            return j;
        }
        // factor (x − bound) − v = 0
        let at = factor * (s.offset - bound);
        let v = self.to.variable(0.0, INF);
        self.to.row(None, vec![(j, factor * s.factor), (v, -1.0)], -at, -at);
        let w = self.to.variables[j].start;
        self.to.variables[v].start = (at + factor * s.factor * w).max(0.0);
        self.copies.push((j, v, factor));
        v
    }
}
