//! A program as it is put together: variables, rows, pairs.

use switchback::expr::{Block, Dag, Id};
use switchback::mpcc::Member;

/// A variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variable {
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// Where a solve starts.
    pub start: f64,
}

/// A row `nonlinear + linear + constant` and its bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Nonlinear part.
    pub nonlinear: Option<Id>,
    /// Variables and their factors.
    pub linear: Vec<(usize, f64)>,
    /// What is added.
    pub constant: f64,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
}

/// How the start of a variable follows from the value of its row at the other variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its positive part.
    Positive,
    /// Minus its negative part.
    Negative,
    /// One where it is positive, zero where it is not.
    IsPositive,
    /// The other way round.
    IsNegative,
}

/// Program with pairs `0 ≤ a ⊥ b ≥ 0`, under construction.
#[derive(Default)]
pub struct Statement {
    /// Graph of the nonlinear parts; its inputs are the variables.
    pub dag: Dag,
    /// Variables.
    pub variables: Vec<Variable>,
    /// Rows.
    pub rows: Vec<Row>,
    /// Members of the pairs.
    pub pairs: Vec<(Member, Member)>,
    /// Rows and variables that stand for what is in them.
    pub lifts: Vec<(usize, usize)>,
    /// Row, variable and part of it the variable starts at: rows in the order in which they depend on each other.
    pub starts: Vec<(usize, usize, Part)>,
}

impl Statement {
    /// A new variable; its start is zero.
    pub fn variable(&mut self, lower: f64, upper: f64) -> usize {
        self.variables.push(Variable { lower, upper, start: 0.0 });
        self.variables.len() - 1
    }

    /// A variable in the graph.
    pub fn input(&mut self, j: usize) -> Id {
        self.dag.input(Block::X, j)
    }

    /// A new row.
    pub fn row(&mut self, nonlinear: Option<Id>, linear: Vec<(usize, f64)>, lower: f64, upper: f64) -> usize {
        self.rows.push(Row { nonlinear, linear, constant: 0.0, lower, upper });
        self.rows.len() - 1
    }

    /// A new variable `v ≥ 0` that is a part of row `i`, to which it is added with this factor.
    fn part(&mut self, i: usize, factor: f64, part: Part) -> usize {
        let v = self.variable(0.0, f64::INFINITY);
        self.rows[i].linear.push((v, factor));
        self.lifts.push((i, v));
        self.starts.push((i, v, part));
        v
    }

    fn pair(&mut self, a: usize, b: usize) {
        self.pairs.push((Member::Variable(a), Member::Variable(b)));
    }

    /// `(p, q)` with `e = p − q`, both not negative, of which no pair is made yet.
    fn split(&mut self, e: Id) -> (usize, usize, usize) {
        let i = self.row(Some(e), Vec::new(), 0.0, 0.0);
        (self.part(i, -1.0, Part::Positive), self.part(i, 1.0, Part::Negative), i)
    }

    /// The positive and the negative part of an expression: `e = p − q`, `0 ≤ p ⊥ q ≥ 0`.
    pub fn parts(&mut self, e: Id) -> (Id, Id) {
        let (p, q, _) = self.split(e);
        self.pair(p, q);
        (self.input(p), self.input(q))
    }

    /// One where an expression is positive, zero where it is negative, between where it is zero: `e = p − q`, `0 ≤ p ⊥ 1 − θ ≥ 0`,
    /// `0 ≤ q ⊥ θ ≥ 0`.
    pub fn step(&mut self, e: Id) -> Id {
        let (p, q, i) = self.split(e);
        let (on, off) = (self.variable(0.0, 1.0), self.variable(0.0, 1.0));
        self.row(None, vec![(on, 1.0), (off, 1.0)], 1.0, 1.0);
        self.starts.extend([(i, on, Part::IsPositive), (i, off, Part::IsNegative)]);
        self.pair(p, off);
        self.pair(q, on);
        self.input(on)
    }
}

impl Part {
    /// The start, from the value of the row.
    pub fn of(self, value: f64) -> f64 {
        match self {
            Part::Positive => value.max(0.0),
            Part::Negative => (-value).max(0.0),
            Part::IsPositive => f64::from(u8::from(value > 0.0)),
            Part::IsNegative => f64::from(u8::from(value <= 0.0)),
        }
    }
}
