//! Expressions as data, for documents: nodes by name that know older nodes only, so a cycle cannot be written down.
//!
//! What is restored goes through the constructors of [`Dag`]: no document can make a graph that could not have been
//! written by hand. A saved graph has been simplified already, so its values stay the same to the last bit.

use serde::{Deserialize, Serialize};

use super::dag::{Block, CallKind, Dag, External, Group, Id, Node};
use super::implicit::{Implicit, SavedImplicit};
use super::op::{Binary, Unary};
use super::piecewise::Piecewise;
use crate::error::{Error, Result};
use crate::func::Function;

/// Integer powers beyond this are refused: their derivatives would leave the integers.
const MAX_POWER: i32 = 1 << 24;

/// A node; operands are numbers of older nodes of the same [`SavedGraph`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SavedNode {
    Const(f64),
    Input(Block, u32),
    Unary(Unary, u32),
    Binary(Binary, u32, u32),
    PowI(u32, i32),
    /// Table, order of the derivative, argument.
    Table(u32, u8, u32),
    /// Group, component.
    Pick(u32, u32),
    Truth(bool),
    /// Of this switching function.
    Positive(u32),
    Not(u32),
    And(u32, u32),
    Or(u32, u32),
    Where(u32, u32, u32),
}

/// A piecewise polynomial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedTable {
    breaks: Vec<f64>,
    degree: usize,
    coefficients: Vec<f64>,
    smoothness: i32,
}

/// Several values from one computation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum SavedGroup {
    Solve { matrix: Vec<u32>, transposed: bool, rhs: Vec<u32> },
    Call { function: u32, args: Vec<u32> },
    CallJacobian { function: u32, args: Vec<u32> },
    CallHessian { function: u32, output: u32, args: Vec<u32> },
    Implicit { problem: u32, args: Vec<u32> },
}

/// A function that a document names but does not contain: it is supplied by its name when the document is read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signature {
    /// Name.
    pub name: String,
    /// Number of states.
    pub x: usize,
    /// Number of controls.
    pub u: usize,
    /// Number of parameters.
    pub p: usize,
    /// Number of outputs.
    pub outputs: usize,
}

impl Signature {
    /// Signature of a function.
    pub fn of(f: &dyn Function) -> Signature {
        let d = f.dims();
        Signature { name: f.name().to_owned(), x: d.x, u: d.u, p: d.p, outputs: f.n_out() }
    }

    /// The function of this name among those supplied.
    ///
    /// # Errors
    /// [`Error::State`] without one, [`Error::Range`] with several, [`Error::Dimension`] if its sizes are others.
    pub fn find(&self, supplied: &[External]) -> Result<External> {
        let mut named = supplied.iter().filter(|f| f.name() == self.name);
        let f = named.next().ok_or_else(|| {
            Error::State(format!("the document calls the function '{}': supply it when it is read", self.name))
        })?;
        if named.next().is_some() {
            return Err(Error::Range(format!("two functions named '{}' are supplied", self.name)));
        }
        if Signature::of(f.as_ref()) != *self {
            return Err(Error::Dimension(format!(
                "function '{}' is supplied with other numbers of inputs or outputs than the document has: x {}, u {}, \
                 p {}, outputs {}",
                self.name, self.x, self.u, self.p, self.outputs
            )));
        }
        Ok(f.clone())
    }
}

/// A part of a graph as data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedGraph {
    nodes: Vec<SavedNode>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    tables: Vec<SavedTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    groups: Vec<SavedGroup>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    functions: Vec<Signature>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    implicit: Vec<SavedImplicit>,
    roots: Vec<u32>,
}

impl SavedGraph {
    /// Saves the nodes that the roots are computed from.
    ///
    /// # Errors
    /// [`Error::NonFinite`] for constants that are not finite, [`Error::Unsupported`] if two functions that are called
    /// have one name.
    pub fn new(dag: &Dag, roots: &[Id]) -> Result<SavedGraph> {
        let reachable = dag.reachable(roots);
        let number = |id: Id| reachable.binary_search(&id).map_or(0, |k| k as u32);
        let numbers = |ids: &[Id]| ids.iter().map(|&id| number(id)).collect::<Vec<u32>>();
        let mut saved = SavedGraph { roots: numbers(roots), ..SavedGraph::default() };
        let (mut tables, mut groups) = (Vec::new(), Vec::new());
        let (mut functions, mut implicit) = (Vec::new(), Vec::new());
        let place = |list: &mut Vec<u32>, k: u32| {
            list.iter().position(|&l| l == k).unwrap_or_else(|| {
                list.push(k);
                list.len() - 1
            }) as u32
        };
        for &id in &reachable {
            let node = match dag.node(id) {
                Node::Const(bits) => {
                    let v = f64::from_bits(bits);
                    if !v.is_finite() {
                        return Err(Error::NonFinite(format!("a constant is {v}: it cannot be saved")));
                    }
                    SavedNode::Const(v)
                }
                Node::Input(block, i) => SavedNode::Input(block, i),
                Node::Unary(op, a) => SavedNode::Unary(op, number(a)),
                Node::Binary(op, a, b) => SavedNode::Binary(op, number(a), number(b)),
                Node::PowI(a, n) => SavedNode::PowI(number(a), n),
                Node::Piecewise(table, order, a) => SavedNode::Table(place(&mut tables, table), order, number(a)),
                Node::Pick(g, k) => SavedNode::Pick(place(&mut groups, g), k),
                Node::Truth(holds) => SavedNode::Truth(holds),
                Node::Positive(s) => SavedNode::Positive(number(dag.switches[s as usize].psi)),
                Node::Not(a) => SavedNode::Not(number(a)),
                Node::And(a, b) => SavedNode::And(number(a), number(b)),
                Node::Or(a, b) => SavedNode::Or(number(a), number(b)),
                Node::Select(c, a, b) => SavedNode::Where(number(c), number(a), number(b)),
            };
            saved.nodes.push(node);
        }
        for &g in &groups {
            let group = match &dag.groups[g as usize].group {
                Group::Solve { factor, transposed, rhs } => {
                    let Group::Factor { matrix, .. } = &dag.groups[*factor as usize].group else {
                        return Err(Error::Internal("a linear system without matrix".into()));
                    };
                    SavedGroup::Solve { matrix: numbers(matrix), transposed: *transposed, rhs: numbers(rhs) }
                }
                Group::Call { function, args, .. } if Implicit::of(&dag.functions[*function as usize]).is_some() => {
                    // the time is no argument of it
                    let args = numbers(&args[..args.len() - 1]);
                    SavedGroup::Implicit { problem: place(&mut implicit, *function), args }
                }
                Group::Call { function, what, args } => {
                    let (function, args) = (place(&mut functions, *function), numbers(args));
                    match what {
                        CallKind::Value => SavedGroup::Call { function, args },
                        CallKind::Jacobian => SavedGroup::CallJacobian { function, args },
                        CallKind::Hessian(i) => SavedGroup::CallHessian { function, output: *i, args },
                    }
                }
                Group::Factor { .. } => return Err(Error::Internal("a matrix has no components".into())),
            };
            saved.groups.push(group);
        }
        saved.tables = tables.iter().map(|&t| saved_table(&dag.piecewise[t as usize])).collect();
        for &f in &implicit {
            let problem = Implicit::of(&dag.functions[f as usize]).and_then(Implicit::saved).ok_or_else(|| {
                Error::Unsupported("an inner problem that calls a function of its own cannot be saved".into())
            })?;
            saved.implicit.push(problem.clone());
        }
        for &f in &functions {
            let signature = Signature::of(dag.functions[f as usize].as_ref());
            if saved.functions.iter().any(|g| g.name == signature.name) {
                return Err(Error::Unsupported(format!(
                    "two functions are named '{}': give each a name of its own to save the expressions that call them",
                    signature.name
                )));
            }
            saved.functions.push(signature);
        }
        Ok(saved)
    }

    /// Adds the nodes to a graph and returns the roots. Functions that are called are found by name.
    ///
    /// # Errors
    /// [`Error::Range`] for what is no graph, else those of [`Signature::find`] and of the constructors of [`Dag`].
    pub fn restore(&self, dag: &mut Dag, supplied: &[External]) -> Result<Vec<Id>> {
        let tables: Vec<Piecewise> = self.tables.iter().map(restored_table).collect::<Result<_>>()?;
        let functions: Vec<External> = self.functions.iter().map(|f| f.find(supplied)).collect::<Result<_>>()?;
        let mut r = Restorer { saved: self, dag, functions, made: Vec::with_capacity(self.nodes.len()) };
        let mut groups: Vec<Option<Vec<Id>>> = vec![None; self.groups.len()];
        for (k, node) in self.nodes.iter().enumerate() {
            let id = r.node(*node, &tables, &mut groups).map_err(|e| at_node(k, e))?;
            r.made.push(id);
        }
        self.roots.iter().map(|&i| r.any(i)).collect()
    }

    /// Inputs that occur.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = (Block, usize)> + '_ {
        self.nodes.iter().filter_map(|n| match n {
            SavedNode::Input(block, i) => Some((*block, *i as usize)),
            _ => None,
        })
    }

    /// The same expressions of inputs with other numbers.
    pub(crate) fn renumbered(mut self, number: &dyn Fn(Block, usize) -> usize) -> SavedGraph {
        for n in &mut self.nodes {
            if let SavedNode::Input(block, i) = n {
                *i = number(*block, *i as usize) as u32;
            }
        }
        self
    }

    /// The roots as those at `places` among `n`; all others are zero.
    pub(crate) fn scattered(mut self, n: usize, places: &[u32]) -> SavedGraph {
        let zero = self.nodes.len() as u32;
        self.nodes.push(SavedNode::Const(0.0));
        let roots = std::mem::replace(&mut self.roots, vec![zero; n]);
        roots.into_iter().zip(places).for_each(|(root, &at)| self.roots[at as usize] = root);
        self
    }

    /// Signatures of the functions that are called.
    pub fn functions(&self) -> &[Signature] {
        &self.functions
    }

    /// Number of roots.
    pub fn n_roots(&self) -> usize {
        self.roots.len()
    }
}

fn at_node(k: usize, e: Error) -> Error {
    let put = |s: String| format!("node {k}: {s}");
    match e {
        Error::Dimension(s) => Error::Dimension(put(s)),
        Error::Range(s) => Error::Range(put(s)),
        other => other,
    }
}

fn saved_table(p: &Piecewise) -> SavedTable {
    SavedTable {
        breaks: p.breaks().to_vec(),
        degree: p.degree(),
        coefficients: p.coefficients().to_vec(),
        smoothness: p.smoothness(),
    }
}

fn restored_table(t: &SavedTable) -> Result<Piecewise> {
    // no polynomial of a table has more derivatives than it has powers
    let smoothness = t.smoothness.min(10);
    Piecewise::new(&t.breaks, t.degree, &t.coefficients, smoothness)
}

/// The steps of [`SavedGraph::restore`].
struct Restorer<'a> {
    saved: &'a SavedGraph,
    dag: &'a mut Dag,
    functions: Vec<External>,
    made: Vec<Id>,
}

impl Restorer<'_> {
    fn any(&self, i: u32) -> Result<Id> {
        self.made.get(i as usize).copied().ok_or_else(|| {
            Error::Range(format!(
                "refers to node {i}, but only {} are known there: nodes know older ones",
                self.made.len()
            ))
        })
    }

    fn kind(&self, i: u32, condition: bool) -> Result<Id> {
        let id = self.any(i)?;
        if self.dag.is_condition(id) == condition {
            return Ok(id);
        }
        let (is, wanted) = if condition { ("value", "condition") } else { ("condition", "value") };
        Err(Error::Range(format!("operand {i} is a {is}, not a {wanted}")))
    }

    fn value(&self, i: u32) -> Result<Id> {
        self.kind(i, false)
    }

    fn condition(&self, i: u32) -> Result<Id> {
        self.kind(i, true)
    }

    fn values(&self, all: &[u32]) -> Result<Vec<Id>> {
        all.iter().map(|&i| self.value(i)).collect()
    }

    fn node(&mut self, node: SavedNode, tables: &[Piecewise], groups: &mut [Option<Vec<Id>>]) -> Result<Id> {
        Ok(match node {
            SavedNode::Const(v) => {
                if !v.is_finite() {
                    return Err(Error::Range(format!("the constant is {v}: it must be finite")));
                }
                self.dag.constant(v)
            }
            SavedNode::Input(block, i) => self.dag.input(block, i as usize),
            SavedNode::Unary(op, a) => {
                let a = self.value(a)?;
                self.dag.unary(op, a)
            }
            SavedNode::Binary(op, a, b) => {
                let (a, b) = (self.value(a)?, self.value(b)?);
                self.dag.binary(op, a, b)
            }
            SavedNode::PowI(a, n) => {
                if !(-MAX_POWER..=MAX_POWER).contains(&n) {
                    return Err(Error::Range(format!("the power {n} is too high")));
                }
                let a = self.value(a)?;
                self.dag.powi(a, n)
            }
            SavedNode::Table(t, order, a) => {
                let (a, n) = (self.value(a)?, tables.len());
                let table = tables.get(t as usize);
                let table = table.ok_or_else(|| Error::Range(format!("table {t} does not exist: there are {n}")))?;
                self.dag.piecewise_derivative(table, order, a)
            }
            SavedNode::Pick(g, k) => {
                let n = groups.len();
                let group = groups.get_mut(g as usize);
                let group = group.ok_or_else(|| Error::Range(format!("group {g} does not exist: there are {n}")))?;
                if group.is_none() {
                    *group = Some(self.group(g as usize)?);
                }
                let values = group.as_deref().unwrap_or_default();
                *values.get(k as usize).ok_or_else(|| {
                    Error::Range(format!("component {k} does not exist: group {g} has {}", values.len()))
                })?
            }
            SavedNode::Truth(holds) => self.dag.truth(holds),
            SavedNode::Positive(psi) => {
                let psi = self.value(psi)?;
                self.dag.positive(psi)
            }
            SavedNode::Not(a) => {
                let a = self.condition(a)?;
                self.dag.not(a)
            }
            SavedNode::And(a, b) => {
                let (a, b) = (self.condition(a)?, self.condition(b)?);
                self.dag.and(a, b)
            }
            SavedNode::Or(a, b) => {
                let (a, b) = (self.condition(a)?, self.condition(b)?);
                self.dag.or(a, b)
            }
            SavedNode::Where(c, a, b) => {
                let (c, a, b) = (self.condition(c)?, self.value(a)?, self.value(b)?);
                self.dag.select(c, a, b)
            }
        })
    }

    /// Components of a group, which is made where the first of them is met.
    fn group(&mut self, g: usize) -> Result<Vec<Id>> {
        let saved = self.saved;
        let (function, what, args) = match &saved.groups[g] {
            SavedGroup::Solve { matrix, transposed, rhs } => {
                let (n, entries) = (rhs.len(), matrix.len());
                if n == 0 || entries != n * n {
                    return Err(Error::Dimension(format!("a linear system of {n} rows has {entries} entries")));
                }
                let (matrix, rhs) = (self.values(matrix)?, self.values(rhs)?);
                let factor = self.dag.group(Group::Factor { n: n as u32, matrix }, 0);
                return Ok(self.dag.solve_factored(factor, *transposed, &rhs));
            }
            SavedGroup::Implicit { problem, args } => {
                let n = saved.implicit.len();
                let problem = saved.implicit.get(*problem as usize);
                let problem =
                    problem.ok_or_else(|| Error::Range(format!("an inner problem does not exist: there are {n}")))?;
                let args = self.values(args)?;
                return self.dag.restore_implicit(problem, &args);
            }
            SavedGroup::Call { function, args } => (*function, CallKind::Value, args),
            SavedGroup::CallJacobian { function, args } => (*function, CallKind::Jacobian, args),
            SavedGroup::CallHessian { function, output, args } => (*function, CallKind::Hessian(*output), args),
        };
        let n = self.functions.len();
        let f = self.functions.get(function as usize).cloned();
        let f = f.ok_or_else(|| Error::Range(format!("function {function} does not exist: there are {n}")))?;
        if let CallKind::Hessian(i) = what {
            if i as usize >= f.n_out() {
                return Err(Error::Range(format!("output {i} does not exist: '{}' has {}", f.name(), f.n_out())));
            }
        }
        let args = self.values(args)?;
        self.dag.call_as(&f, what, &args)
    }
}
