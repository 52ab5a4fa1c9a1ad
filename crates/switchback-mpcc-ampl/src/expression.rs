//! Expressions of a file in the graph of a program.
//!
//! The graph is smooth. What has kinks becomes variables and pairs: `|e| = p + q` and `max(e, 0) = p` with `e = p − q`,
//! `0 ≤ p ⊥ q ≥ 0`. Conditions become step functions, which lie between 0 and 1 where the two sides are equal, and
//! `if c then a else b` is `b + θ (a − b)`.

use std::sync::Arc;

use crate::nl::{kinks, Forest, Node, Operator, Place, Problem};
use crate::statement::Statement;
use switchback::expr::{Binary, Dag, Id, Unary};
use switchback::linalg::csc::Pattern;
use switchback::{Callback, Dims, Error, Function, Result};

/// Nodes of a file in the graph.
pub struct Translation<'a> {
    problem: &'a Problem,
    ids: Vec<Option<Id>>,
    functions: [Option<Arc<dyn Function>>; 3],
}

impl<'a> Translation<'a> {
    /// Translates what the roots are made of; `variables` are the variables of the problem in the graph.
    pub fn new(problem: &'a Problem, roots: &[Place], variables: &[Id], to: &mut Statement) -> Result<Translation<'a>> {
        let forest = &problem.forest;
        let mut used = vec![false; forest.nodes().len()];
        roots.iter().for_each(|r| used[*r as usize] = true);
        for k in (0..used.len()).rev() {
            if used[k] {
                match forest.nodes()[k] {
                    Node::Apply(_, r) => forest.operands(r).iter().for_each(|p| used[*p as usize] = true),
                    Node::Piecewise(_, at) => used[at as usize] = true,
                    _ => {}
                }
            }
        }
        let mut t = Translation { problem, ids: vec![None; used.len()], functions: [const { None }; 3] };
        for k in (0..used.len()).filter(|k| used[*k]) {
            t.ids[k] = Some(t.node(forest, k, variables, to)?);
        }
        Ok(t)
    }

    /// A node that was translated.
    pub fn id(&self, place: Place) -> Result<Id> {
        self.ids[place as usize].ok_or_else(|| Error::Internal(format!("node {place} was not translated")))
    }

    fn node(&mut self, forest: &Forest, k: usize, variables: &[Id], to: &mut Statement) -> Result<Id> {
        match forest.nodes()[k] {
            Node::Number(v) => Ok(to.dag.constant(v)),
            Node::Variable(j) => Ok(variables[j as usize]),
            Node::Refused(name) => Err(self.refuse(forest.refusal(name))),
            Node::Piecewise(r, at) => {
                let x = self.id(at)?;
                let numbers = forest.numbers(r);
                let slope = to.dag.constant(numbers[0]);
                let mut sum = to.dag.mul(slope, x);
                for (jump, b) in kinks(numbers) {
                    let b_id = to.dag.constant(b);
                    let beyond = to.dag.sub(x, b_id);
                    let beyond = positive(to, beyond);
                    let (jump_id, zero) = (to.dag.constant(jump), to.dag.constant(jump * (-b).max(0.0)));
                    let term = to.dag.mul(jump_id, beyond);
                    let term = to.dag.sub(term, zero);
                    sum = to.dag.add(sum, term);
                }
                Ok(sum)
            }
            Node::Apply(op, r) => {
                let places = forest.operands(r);
                if op == Operator::If {
                    return self.choice(forest, [places[0], places[1], places[2]], to);
                }
                let args = places.iter().map(|p| self.id(*p)).collect::<Result<Vec<Id>>>()?;
                let known: Option<Vec<f64>> = args.iter().map(|a| to.dag.as_const(*a)).collect();
                match known {
                    Some(known) => Ok(to.dag.constant(op.value(&known))),
                    None => self.apply(op, &args, to),
                }
            }
        }
    }

    fn refuse(&self, what: &str) -> Error {
        let name =
            what.strip_prefix("imported function ").and_then(|k| self.problem.functions.get(k.parse::<usize>().ok()?));
        let what = name.map_or_else(|| what.to_owned(), |name| format!("the imported function {name}"));
        Error::Unsupported(format!("the problem uses {what}, which is not supported: write it with other operators"))
    }

    /// `if c then a else b`
    fn choice(&mut self, forest: &Forest, [c, a, b]: [Place; 3], to: &mut Statement) -> Result<Id> {
        let condition = self.id(c)?;
        if let Some(v) = to.dag.as_const(condition) {
            return self.id(if v != 0.0 { a } else { b });
        }
        if !matches!(forest.nodes()[c as usize], Node::Apply(op, _) if op.is_logical()) {
            return Err(Error::Unsupported("the condition of an if is a number, not a comparison".into()));
        }
        let (a, b) = (self.id(a)?, self.id(b)?);
        let difference = to.dag.sub(a, b);
        let part = to.dag.mul(condition, difference);
        Ok(to.dag.add(b, part))
    }

    fn apply(&mut self, op: Operator, args: &[Id], to: &mut Statement) -> Result<Id> {
        use Operator as O;
        let (a, b) = (args[0], args.get(1).copied().unwrap_or(args[0]));
        let one = to.dag.constant(1.0);
        let d = &mut to.dag;
        Ok(match op {
            O::Add => d.add(a, b),
            O::Subtract => d.sub(a, b),
            O::Multiply => d.mul(a, b),
            O::Divide => d.div(a, b),
            O::Power => d.pow(a, b),
            O::Negate => d.neg(a),
            O::Square => d.powi(a, 2),
            O::Sum => sum(d, args),
            O::Tanh => d.unary(Unary::Tanh, a),
            O::Tan => d.unary(Unary::Tan, a),
            O::Sqrt => d.unary(Unary::Sqrt, a),
            O::Sinh => d.unary(Unary::Sinh, a),
            O::Sin => d.unary(Unary::Sin, a),
            O::Log => d.unary(Unary::Log, a),
            O::Exp => d.unary(Unary::Exp, a),
            O::Cosh => d.unary(Unary::Cosh, a),
            O::Cos => d.unary(Unary::Cos, a),
            O::Atan => d.unary(Unary::Atan, a),
            O::Asin => d.unary(Unary::Asin, a),
            O::Acos => d.unary(Unary::Acos, a),
            O::Atan2 => d.binary(Binary::Atan2, a, b),
            O::Log10 => {
                let (log, ten) = (d.unary(Unary::Log, a), d.constant(std::f64::consts::LN_10));
                d.div(log, ten)
            }
            O::Asinh | O::Acosh | O::Atanh => self.inverse(op, a, to)?,
            O::Abs => {
                let (p, q) = to.parts(a);
                to.dag.add(p, q)
            }
            O::Less => {
                let e = d.sub(a, b);
                positive(to, e)
            }
            O::Maximum => args[1..].iter().fold(a, |m, v| larger(to, m, *v)),
            O::Minimum => {
                let turned: Vec<Id> = args.iter().map(|v| d.neg(*v)).collect();
                let m = turned[1..].iter().fold(turned[0], |m, v| larger(to, m, *v));
                to.dag.neg(m)
            }
            O::GreaterThan | O::AtLeast => {
                let e = d.sub(a, b);
                to.step(e)
            }
            O::LessThan | O::AtMost => {
                let e = d.sub(b, a);
                to.step(e)
            }
            O::Not => d.sub(one, a),
            O::And => args[1..].iter().fold(a, |all, v| d.mul(all, *v)),
            O::Or => {
                let none = args.iter().fold(one, |none, v| {
                    let not = d.sub(one, *v);
                    d.mul(none, not)
                });
                d.sub(one, none)
            }
            O::Remainder | O::Floor | O::Ceil | O::Equal | O::NotEqual | O::IntegerDivide => return Err(jumps(op)),
            O::Precision | O::Round | O::Truncate | O::If => return Err(jumps(op)),
        })
    }

    /// Inverse hyperbolic functions, which are functions the graph calls.
    fn inverse(&mut self, op: Operator, a: Id, to: &mut Statement) -> Result<Id> {
        type Of = fn(f64) -> f64;
        let (k, name, f): (usize, &str, [Of; 3]) = match op {
            Operator::Asinh => {
                (0, "asinh", [f64::asinh, |x| 1.0 / x.hypot(1.0), |x| -x / (x.hypot(1.0) * (1.0 + x * x))])
            }
            Operator::Acosh => {
                let root: Of = |x| 1.0 / ((x - 1.0) * (x + 1.0)).sqrt();
                (1, "acosh", [f64::acosh, root, |x| -x / ((x - 1.0) * (x + 1.0)).powf(1.5)])
            }
            _ => {
                let first: Of = |x| 1.0 / ((1.0 - x) * (1.0 + x));
                (2, "atanh", [f64::atanh, first, |x| 2.0 * x / ((1.0 - x) * (1.0 + x)).powi(2)])
            }
        };
        let function = match &self.functions[k] {
            Some(f) => f.clone(),
            None => {
                let made = Callback::new(name, Dims { x: 1, u: 0, p: 0 }, 1, move |at, out| write(out, f[0](at.x[0])))
                    .with_jacobian(Pattern::from_triplets(1, 2, &[0], &[0]).0, move |at, out| {
                        write(out, f[1](at.x[0]))
                    })?
                    .with_hessian(Pattern::from_triplets(2, 2, &[0], &[0]).0, move |at, w, out| {
                        write(out, w[0] * f[2](at.x[0]))
                    })?;
                self.functions[k].insert(Arc::new(made)).clone()
            }
        };
        let time = to.dag.constant(0.0);
        let out = to.dag.call(&function, &[a, time])?;
        out.first().copied().ok_or_else(|| Error::Internal(format!("{name} has no value")))
    }
}

/// A sum by pairs: its depth is the logarithm of the number of terms, and so are rounding errors.
fn sum(d: &mut Dag, terms: &[Id]) -> Id {
    let mut terms = terms.to_vec();
    while terms.len() > 1 {
        terms = terms.chunks(2).map(|pair| if let [a, b] = *pair { d.add(a, b) } else { pair[0] }).collect();
    }
    terms[0]
}

/// Writes a value; 1 where it is not finite, for a function that is not defined there.
fn write(out: &mut [f64], value: f64) -> i32 {
    out[0] = value;
    i32::from(!value.is_finite())
}

fn jumps(op: Operator) -> Error {
    Error::Unsupported(format!(
        "the operator {} of variables jumps: only min, max, abs, <, <=, >=, > and piecewise-linear terms may have kinks or steps",
        op.name()
    ))
}

/// `max(e, 0)`
fn positive(to: &mut Statement, e: Id) -> Id {
    match to.dag.as_const(e) {
        Some(v) => to.dag.constant(v.max(0.0)),
        None => to.parts(e).0,
    }
}

/// `max(a, b)`
fn larger(to: &mut Statement, a: Id, b: Id) -> Id {
    let e = to.dag.sub(b, a);
    let more = positive(to, e);
    to.dag.add(a, more)
}
