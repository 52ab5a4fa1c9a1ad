//! Operators: [`Expr`] and [`Cond`] are handles into a [`Graph`] that can be written like numbers and truth values.

use std::cell::{RefCell, RefMut};
use std::fmt;
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, DivAssign, Mul, MulAssign, Neg, Not, Sub, SubAssign};
use std::sync::Arc;

use super::dag::{Block, Dag, External, Id};
use super::function::ExprFunction;
use super::op::{Binary, Unary};
use super::piecewise::Piecewise;
use crate::error::Result;
use crate::func::{Dims, Function};

/// A [`Dag`] that expressions can share while it grows.
#[derive(Default)]
pub struct Graph {
    dag: RefCell<Dag>,
}

/// A value in a graph.
#[derive(Clone, Copy)]
pub struct Expr<'g> {
    graph: &'g Graph,
    id: Id,
}

/// A condition in a graph.
#[derive(Clone, Copy)]
pub struct Cond<'g> {
    graph: &'g Graph,
    id: Id,
}

impl Graph {
    /// An empty graph.
    pub fn new() -> Graph {
        Graph::default()
    }

    /// The graph itself, to differentiate.
    ///
    /// # Panics
    /// If it is borrowed already: let go of the result before computing with expressions.
    pub fn dag(&self) -> RefMut<'_, Dag> {
        self.dag.borrow_mut()
    }

    /// The handle of a node.
    pub fn expr(&self, id: Id) -> Expr<'_> {
        Expr { graph: self, id }
    }

    fn cond(&self, id: Id) -> Cond<'_> {
        Cond { graph: self, id }
    }

    /// A constant.
    pub fn constant(&self, v: f64) -> Expr<'_> {
        self.expr(self.dag().constant(v))
    }

    /// State `i`.
    pub fn x(&self, i: usize) -> Expr<'_> {
        self.expr(self.dag().input(Block::X, i))
    }

    /// Control `i`.
    pub fn u(&self, i: usize) -> Expr<'_> {
        self.expr(self.dag().input(Block::U, i))
    }

    /// Parameter `i`.
    pub fn p(&self, i: usize) -> Expr<'_> {
        self.expr(self.dag().input(Block::P, i))
    }

    /// Time.
    pub fn t(&self) -> Expr<'_> {
        self.expr(self.dag().input(Block::T, 0))
    }

    /// Value of a piecewise polynomial.
    pub fn piecewise<'g>(&'g self, p: &Piecewise, a: Expr<'g>) -> Expr<'g> {
        self.own(a.graph);
        self.expr(self.dag().piecewise(p, a.id))
    }

    /// A table with switching functions at its breaks; see [`Dag::step_table`].
    pub fn step_table<'g>(&'g self, a: Expr<'g>, breaks: &[f64], values: &[Expr<'g>]) -> Result<Expr<'g>> {
        self.own(a.graph);
        let values = self.ids(values);
        let id = self.dag().step_table(a.id, breaks, &values)?;
        Ok(self.expr(id))
    }

    /// Solution of `A x = b`, `A` by columns; see [`Dag::solve`].
    pub fn solve<'g>(&'g self, matrix: &[Expr<'g>], rhs: &[Expr<'g>]) -> Result<Vec<Expr<'g>>> {
        let (a, b) = (self.ids(matrix), self.ids(rhs));
        let x = self.dag().solve(&a, &b)?;
        Ok(x.into_iter().map(|id| self.expr(id)).collect())
    }

    /// Outputs of an external function at `x`, `u`, `p`, `t`; see [`Dag::call`].
    pub fn call<'g>(&'g self, f: &External, args: &[Expr<'g>]) -> Result<Vec<Expr<'g>>> {
        let args = self.ids(args);
        let out = self.dag().call(f, &args)?;
        Ok(out.into_iter().map(|id| self.expr(id)).collect())
    }

    /// A function of inputs of these sizes; see [`ExprFunction::new`].
    pub fn function(&self, name: &str, dims: Dims, outputs: &[Expr]) -> Result<ExprFunction> {
        let ids = self.ids(outputs);
        ExprFunction::new(name, &mut self.dag(), dims, &ids)
    }

    /// A cost of inputs of these sizes that may have kinks; see [`Dag::cost`].
    pub fn cost(&self, name: &str, dims: Dims, output: Expr) -> Result<Arc<dyn Function>> {
        let ids = self.ids(&[output]);
        self.dag().cost(name, dims, ids[0])
    }

    /// Numbers of the nodes.
    pub fn ids(&self, all: &[Expr]) -> Vec<Id> {
        all.iter()
            .map(|e| {
                self.own(e.graph);
                e.id
            })
            .collect()
    }

    fn text(&self, id: Id) -> String {
        self.dag.try_borrow().map_or_else(|_| "…".into(), |d| d.text(id))
    }

    fn own(&self, other: &Graph) {
        assert!(std::ptr::eq(self, other), "expressions of two graphs cannot be combined");
    }
}

impl<'g> Expr<'g> {
    /// Number of the node.
    pub fn id(self) -> Id {
        self.id
    }

    /// Value, if it is a constant.
    pub fn as_const(self) -> Option<f64> {
        self.graph.dag().as_const(self.id)
    }

    fn unary(self, op: Unary) -> Expr<'g> {
        self.graph.expr(self.graph.dag().unary(op, self.id))
    }

    fn binary(self, op: Binary, b: Expr<'g>) -> Expr<'g> {
        self.graph.own(b.graph);
        self.graph.expr(self.graph.dag().binary(op, self.id, b.id))
    }

    /// `√self`
    pub fn sqrt(self) -> Expr<'g> {
        self.unary(Unary::Sqrt)
    }
    /// Exponential.
    pub fn exp(self) -> Expr<'g> {
        self.unary(Unary::Exp)
    }
    /// Natural logarithm.
    pub fn ln(self) -> Expr<'g> {
        self.unary(Unary::Log)
    }
    /// Sine.
    pub fn sin(self) -> Expr<'g> {
        self.unary(Unary::Sin)
    }
    /// Cosine.
    pub fn cos(self) -> Expr<'g> {
        self.unary(Unary::Cos)
    }
    /// Tangent.
    pub fn tan(self) -> Expr<'g> {
        self.unary(Unary::Tan)
    }
    /// Inverse sine.
    pub fn asin(self) -> Expr<'g> {
        self.unary(Unary::Asin)
    }
    /// Inverse cosine.
    pub fn acos(self) -> Expr<'g> {
        self.unary(Unary::Acos)
    }
    /// Inverse tangent.
    pub fn atan(self) -> Expr<'g> {
        self.unary(Unary::Atan)
    }
    /// Angle of the point `(x, self)`.
    pub fn atan2(self, x: impl Into<Operand<'g>>) -> Expr<'g> {
        self.binary(Binary::Atan2, x.into().in_graph(self.graph))
    }
    /// Hyperbolic sine.
    pub fn sinh(self) -> Expr<'g> {
        self.unary(Unary::Sinh)
    }
    /// Hyperbolic cosine.
    pub fn cosh(self) -> Expr<'g> {
        self.unary(Unary::Cosh)
    }
    /// Hyperbolic tangent.
    pub fn tanh(self) -> Expr<'g> {
        self.unary(Unary::Tanh)
    }
    /// Error function.
    pub fn erf(self) -> Expr<'g> {
        self.unary(Unary::Erf)
    }
    /// The largest whole number that is not larger: in resets, whose jumps are at events.
    pub fn floor(self) -> Expr<'g> {
        self.unary(Unary::Floor)
    }
    /// Integer power.
    pub fn powi(self, n: i32) -> Expr<'g> {
        self.graph.expr(self.graph.dag().powi(self.id, n))
    }
    /// Real power.
    pub fn powf(self, b: impl Into<Operand<'g>>) -> Expr<'g> {
        self.binary(Binary::Pow, b.into().in_graph(self.graph))
    }

    fn switching(self, f: impl FnOnce(&mut Dag, Id) -> Id) -> Expr<'g> {
        self.graph.expr(f(&mut self.graph.dag(), self.id))
    }

    /// The other operand as a node of the same graph.
    fn operand(self, b: impl Into<Operand<'g>>) -> Id {
        let b = b.into().in_graph(self.graph);
        self.graph.own(b.graph);
        b.id
    }

    /// Sign; a switching function.
    pub fn sign(self) -> Expr<'g> {
        self.switching(|d, a| d.sign(a))
    }
    /// Modulus; a switching function.
    pub fn abs(self) -> Expr<'g> {
        self.switching(|d, a| d.abs(a))
    }
    /// The smaller one; a switching function.
    pub fn min(self, b: impl Into<Operand<'g>>) -> Expr<'g> {
        let b = self.operand(b);
        self.switching(|d, a| d.min(a, b))
    }
    /// The larger one; a switching function.
    pub fn max(self, b: impl Into<Operand<'g>>) -> Expr<'g> {
        let b = self.operand(b);
        self.switching(|d, a| d.max(a, b))
    }
    /// The nearest value of an interval; two switching functions.
    pub fn clip(self, low: impl Into<Operand<'g>>, high: impl Into<Operand<'g>>) -> Expr<'g> {
        let (low, high) = (self.operand(low), self.operand(high));
        self.switching(|d, a| d.clip(a, low, high))
    }
    /// `on` where positive, `off` where negative; a switching function.
    pub fn relay(self, on: impl Into<Operand<'g>>, off: impl Into<Operand<'g>>) -> Expr<'g> {
        let (on, off) = (self.operand(on), self.operand(off));
        self.switching(|d, a| d.relay(a, on, off))
    }
    /// Zero up to `half_width`, then the distance; two switching functions.
    pub fn dead_zone(self, half_width: impl Into<Operand<'g>>) -> Expr<'g> {
        let half_width = self.operand(half_width);
        self.switching(|d, a| d.dead_zone(a, half_width))
    }
    /// The condition `self > b`.
    pub fn gt(self, b: impl Into<Operand<'g>>) -> Cond<'g> {
        let d = self - b.into();
        d.graph.cond(d.graph.dag().positive(d.id))
    }
    /// The condition `self < b`.
    pub fn lt(self, b: impl Into<Operand<'g>>) -> Cond<'g> {
        !self.gt(b)
    }
}

impl<'g> Cond<'g> {
    /// Number of the node.
    pub fn id(self) -> Id {
        self.id
    }

    /// `a` where the condition holds, `b` elsewhere.
    pub fn select(self, a: impl Into<Operand<'g>>, b: impl Into<Operand<'g>>) -> Expr<'g> {
        let (a, b) = (a.into().in_graph(self.graph), b.into().in_graph(self.graph));
        self.graph.own(a.graph);
        self.graph.own(b.graph);
        self.graph.expr(self.graph.dag().select(self.id, a.id, b.id))
    }
}

impl Not for Cond<'_> {
    type Output = Self;
    fn not(self) -> Self {
        self.graph.cond(self.graph.dag().not(self.id))
    }
}

impl BitAnd for Cond<'_> {
    type Output = Self;
    fn bitand(self, b: Self) -> Self {
        self.graph.own(b.graph);
        self.graph.cond(self.graph.dag().and(self.id, b.id))
    }
}

impl BitOr for Cond<'_> {
    type Output = Self;
    fn bitor(self, b: Self) -> Self {
        self.graph.own(b.graph);
        self.graph.cond(self.graph.dag().or(self.id, b.id))
    }
}

/// The other operand: an expression or a number.
#[derive(Clone, Copy)]
pub enum Operand<'g> {
    /// An expression.
    Expr(Expr<'g>),
    /// A number.
    Number(f64),
}

impl<'g> From<Expr<'g>> for Operand<'g> {
    fn from(e: Expr<'g>) -> Self {
        Operand::Expr(e)
    }
}

impl From<f64> for Operand<'_> {
    fn from(v: f64) -> Self {
        Operand::Number(v)
    }
}

impl<'g> Operand<'g> {
    fn in_graph(self, graph: &'g Graph) -> Expr<'g> {
        match self {
            Operand::Expr(e) => e,
            Operand::Number(v) => graph.constant(v),
        }
    }
}

macro_rules! operator {
    ($($trait:ident $method:ident $op:ident),*) => {$(
        impl<'g, T: Into<Operand<'g>>> $trait<T> for Expr<'g> {
            type Output = Expr<'g>;
            fn $method(self, b: T) -> Expr<'g> {
                self.binary(Binary::$op, b.into().in_graph(self.graph))
            }
        }
        impl<'g> $trait<Expr<'g>> for f64 {
            type Output = Expr<'g>;
            fn $method(self, b: Expr<'g>) -> Expr<'g> {
                b.graph.constant(self).binary(Binary::$op, b)
            }
        }
    )*};
}
operator!(Add add Add, Sub sub Sub, Mul mul Mul, Div div Div);

macro_rules! assigning {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl<'g, T: Into<Operand<'g>>> $trait<T> for Expr<'g> {
            fn $method(&mut self, b: T) {
                *self = *self $op b;
            }
        }
    )*};
}
assigning!(AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *, DivAssign div_assign /);

impl<'g> Neg for Expr<'g> {
    type Output = Expr<'g>;
    fn neg(self) -> Expr<'g> {
        self.unary(Unary::Neg)
    }
}

impl<'g> std::iter::Sum for Expr<'g> {
    /// # Panics
    /// Without terms there is no graph the zero could belong to.
    fn sum<I: Iterator<Item = Expr<'g>>>(terms: I) -> Expr<'g> {
        terms.reduce(|a, b| a + b).expect("a sum of expressions needs a term")
    }
}

impl fmt::Debug for Expr<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.graph.text(self.id))
    }
}

impl fmt::Debug for Cond<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.graph.text(self.id))
    }
}
