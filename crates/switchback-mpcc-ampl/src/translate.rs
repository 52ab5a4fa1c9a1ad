//! A problem of a file as a program with pairs of variables, and what is found for it as values of the problem.
//!
//! A complementarity constraint is a box of the library, or a pair where the constraint is a variable by itself.

use crate::expression::Translation;
use crate::nl::{Body, Place, Problem, Row};
use crate::program::{Cost, Program};
use crate::statement::Statement;
use switchback::expr::Id;
use switchback::mpcc::{Boxed, Conflict, Lifted, Member, Solution};
use switchback::nlp::Bounds;
use switchback::{Error, Result};

const INF: f64 = f64::INFINITY;

/// Where the dual value of a constraint is found.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Dual {
    /// The multiplier of a row.
    Row(usize),
    /// The multiplier of the bound of a variable.
    Bound(usize),
}

/// A problem that can be solved.
pub struct Translated {
    /// The program.
    pub program: Lifted<Program>,
    /// Its bounds.
    pub bounds: Bounds,
    /// Where to start.
    pub start: Vec<f64>,
    /// Pairs that come from expressions with kinks or conditions.
    pub n_kinks: usize,
    /// Variables of the problem, which are the first ones of the program.
    n: usize,
    duals: Vec<Dual>,
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
    let mut b = Builder { problem, uses: uses(problem), duals: Vec::new(), boxes: Vec::new(), to };

    let variables: Vec<Id> = (0..n).map(|j| b.to.input(j)).collect();
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
    let Builder { to, duals, boxes, .. } = b;
    let mut start: Vec<f64> = to.variables.iter().map(|v| v.start).collect();
    let (starts, lifts, mut members) = (to.starts.clone(), to.lifts.clone(), to.pairs.clone());
    let (mut program, mut bounds) = Program::new(to, cost)?;
    program.complete(&mut start, &starts);
    for one in &boxes {
        one.write(&mut bounds, &mut members)?;
    }
    let mut program = Lifted::new(program, &members)?.with_lifts(&lifts);
    let bounds = program.bounds(&bounds)?;
    let start = program.start(&start);
    Ok(Translated { program, bounds, start, n_kinks, n, duals, maximise })
}

impl Translated {
    /// The values of the problem of a point of the program with its multipliers.
    pub fn answer(&self, found: &Solution) -> Answer {
        // The multipliers are those of f + yᵀc − zᵀw, with f to be minimised.
        let sign = if self.maximise { -1.0 } else { 1.0 };
        let (mut x, z) = (self.program.point(&found.x), self.program.bound_multipliers(&found.z));
        x.truncate(self.n);
        let dual = |d: &Dual| match *d {
            Dual::Row(i) => -sign * found.y[i],
            Dual::Bound(j) => sign * z[j],
        };
        let mut reduced: Vec<f64> = z[..self.n].iter().map(|z| sign * z).collect();
        for d in &self.duals {
            if let Dual::Bound(j) = d {
                reduced[*j] = 0.0;
            }
        }
        Answer { x, duals: self.duals.iter().map(dual).collect(), reduced_costs: reduced }
    }

    /// Weights of the constraints and of the bounds of variables in a conflict.
    pub fn conflict(&self, conflict: &Conflict) -> (Vec<f64>, Vec<f64>) {
        let (mut weights, mut of_bounds) = (vec![0.0; self.bounds.cl.len()], vec![0.0; self.bounds.xl.len()]);
        conflict.rows.iter().for_each(|(row, weight)| weights[*row] = *weight);
        conflict.variables.iter().for_each(|(j, weight)| of_bounds[*j] = *weight);
        let row = |d: &Dual| if let Dual::Row(row) = d { weights[*row] } else { 0.0 };
        let mut variables = self.program.bound_multipliers(&of_bounds);
        variables.truncate(self.n);
        (self.duals.iter().map(row).collect(), variables)
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
    duals: Vec<Dual>,
    boxes: Vec<Boxed>,
    to: Statement,
}

/// The variable that a constraint is.
fn single(problem: &Problem, body: &Body) -> Option<usize> {
    let is_zero = |p: Place| matches!(problem.forest.nodes()[p as usize], crate::nl::Node::Number(0.0));
    match body.linear[..] {
        [(j, 1.0)] if body.nonlinear.is_none_or(is_zero) => Some(j),
        _ => None,
    }
}

/// In how many complementarity constraints every variable is, as the variable or as the constraint.
fn uses(problem: &Problem) -> Vec<usize> {
    let mut uses = vec![0; problem.bounds.len()];
    for (row, body) in problem.rows.iter().zip(&problem.constraints) {
        if let Row::Complements { variable, .. } = row {
            uses[*variable] += 1;
            if let Some(k) = single(problem, body) {
                uses[k] += 1;
            }
        }
    }
    uses
}

impl Builder<'_> {
    /// The constraint of a row that is a free variable which is in no other pair.
    fn own_variable(&self, i: usize) -> Option<usize> {
        let Row::Complements { variable, lower, upper } = self.problem.rows[i] else { return None };
        let k = single(self.problem, &self.problem.constraints[i])?;
        let (l, u) = self.problem.bounds[variable];
        let free = self.problem.bounds[k] == (-INF, INF);
        (lower != upper && free && self.uses[k] == 1 && k != variable && u > l).then_some(k)
    }

    /// Nonlinear part, linear terms, and constant of a body.
    #[allow(clippy::type_complexity)]
    fn body(&self, body: &Body, nodes: &Translation) -> Result<(Option<Id>, Vec<(usize, f64)>, f64)> {
        let mut nonlinear = body.nonlinear.map(|p| nodes.id(p)).transpose()?;
        let mut constant = 0.0;
        if let Some(v) = nonlinear.and_then(|id| self.to.dag.as_const(id)) {
            (nonlinear, constant) = (None, v);
        }
        if !constant.is_finite() {
            return Err(Error::NonFinite(format!("an objective or a constraint has the constant term {constant}")));
        }
        Ok((nonlinear, body.linear.clone(), constant))
    }

    fn constraint(&mut self, i: usize, nodes: &Translation) -> Result<()> {
        let (nonlinear, linear, constant) = self.body(&self.problem.constraints[i], nodes)?;
        let row = self.to.row(nonlinear, linear, 0.0, 0.0);
        self.to.rows[row].constant = constant;
        self.duals.push(Dual::Row(row));
        let (j, lower, upper) = match self.problem.rows[i] {
            Row::Within(l, u) => {
                if l == INF || u == -INF {
                    return Err(Error::Range(format!("constraint {i} is bounded to infinity")));
                }
                (self.to.rows[row].lower, self.to.rows[row].upper) = (l, u);
                return Ok(());
            }
            Row::Complements { variable, lower, upper } => (variable, lower, upper),
        };
        let (l, u) = self.problem.bounds[j];
        for (takes_part, bound, name) in [(lower, l, "lower"), (upper, u, "upper")] {
            if takes_part && bound.is_infinite() {
                return Err(Error::Unsupported(format!(
                    "constraint {i} complements the {name} bound of variable {j}, which has none: give it one"
                )));
            }
        }
        if let Some(k) = self.own_variable(i) {
            // it is not negative at a lower bound, and not positive at an upper one
            (self.to.rows[row].lower, self.to.rows[row].upper) = (-INF, INF);
            self.duals[i] = Dual::Bound(k);
            if lower {
                self.to.variables[k].lower = 0.0;
                self.to.pairs.push((Member::Above(j), Member::Above(k)));
            } else {
                self.to.variables[k].upper = 0.0;
                self.to.pairs.push((Member::Below(j), Member::Below(k)));
            }
        } else {
            self.boxes.push(Boxed { variable: j, row, lower, upper });
        }
        Ok(())
    }
}
