//! Models as expressions: a graph of scalar operations, its exact derivatives, and programs that evaluate both.
//!
//! A [`Dag`] holds every expression once. [`Graph`] with [`Expr`] and [`Cond`] is the same with operators.
//! [`Dag::jacobian`] and [`Dag::hessian`] add derivatives to the graph, [`Tape`] evaluates any nodes of it at one point or
//! at many, [`ExprFunction`] makes a [`crate::func::Function`] of it, [`write_c`] writes it out in C.
//!
//! Operators that switch (`sign`, `abs`, `min`, `max`, `where`) are not evaluated: [`crate::model`] turns them into
//! switching functions and modes, and [`Graph::cost`] those of a cost into maxima that a program has variables for. What is evaluated at
//! single times only may switch ([`Dag::function_at_events`]).

mod bundle;
mod c_code;
mod c_inner;
mod clauses;
mod dag;
mod diff;
pub(crate) mod exact;
mod extend;
mod function;
mod graph;
mod held;
mod implicit;
mod interval;
mod kinks;
mod lagrange;
mod linear;
mod op;
mod operator;
mod piecewise;
mod saved;
mod saved_node;
mod signed;
mod snippet;
mod substitute;
mod sums;
mod switching;
mod tape;
mod text;

pub(crate) use c_code::{fingerprint, is_c_identifier};
pub use c_code::{write_c, write_c_first, CReal};
pub use clauses::Clauses;
pub use dag::{Block, Dag, Id, Node};
pub use diff::Entry;
pub(crate) use function::all_inputs;
pub use function::ExprFunction;
pub use graph::{Cond, Expr, Graph, Operand};
pub use op::{Binary, Unary};
pub use operator::Operator;
pub use piecewise::Piecewise;
pub use saved::{SavedGraph, Signature};
pub use signed::SignedFunction;
pub use tape::{Tape, CYCLE_CODE, LANES};
