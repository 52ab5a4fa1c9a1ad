//! The graph: nodes that exist once.
//!
//! Nodes are numbered in the order of creation and know only older nodes, so the numbers are a topological order and
//! no algorithm on the graph needs recursion. Equal nodes are one node; what a constructor can simplify at
//! once (constants, neutral elements, like terms) never becomes a node. The same calls give the same numbers.

use std::collections::{BTreeMap, HashSet};

use super::op::{powi, Binary, Unary};
use super::piecewise::Piecewise;
use super::switching::{Switch, SwitchKey};
use crate::error::{Error, Result};
use crate::memory;

/// A node of a [`Dag`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id(pub(super) u32);

impl Id {
    /// Number of the node.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Blocks of inputs: those of [`crate::func::Point`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Block {
    /// States, or the variables of an optimisation problem.
    X,
    /// Controls.
    U,
    /// Parameters.
    P,
    /// Time.
    T,
    /// Weights of the outputs in a Hessian; not for models.
    Weight,
    /// Unknowns of inner problems, see [`Dag::implicit`]; nowhere else.
    Unknown,
}

/// The operation of a node and its operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Node {
    /// A constant, by its bits.
    Const(u64),
    /// Component of an input block.
    Input(Block, u32),
    /// Function of one argument.
    Unary(Unary, Id),
    /// Function of two arguments.
    Binary(Binary, Id, Id),
    /// Integer power, not 0 or 1.
    PowI(Id, i32),
    /// Derivative of this order of a piecewise polynomial.
    Piecewise(u32, u8, Id),
    /// Component of a vector-valued group.
    Pick(u32, u32),
    /// A condition that is decided.
    Truth(bool),
    /// Condition `ψ > 0` with this switching function.
    Positive(u32),
    /// Negated condition.
    Not(Id),
    /// Both conditions.
    And(Id, Id),
    /// One condition at least.
    Or(Id, Id),
    /// The first value where the condition holds, else the second.
    Select(Id, Id, Id),
}

/// Several values that come from one computation.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Group {
    /// LU decomposition of a matrix stored by columns; has no values of its own.
    Factor { n: u32, matrix: Vec<Id> },
    /// Solution of a linear system with a decomposed matrix, or its transpose.
    Solve { factor: u32, transposed: bool, rhs: Vec<Id> },
    /// Values (`None`), Jacobian entries, or Hessian entries of one output of an external function.
    Call { function: u32, what: CallKind, args: Vec<Id> },
}

/// What a call of an external function computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum CallKind {
    Value,
    Jacobian,
    /// Of this output.
    Hessian(u32),
}

/// A group with its first component.
#[derive(Debug, Clone)]
pub(super) struct GroupEntry {
    pub(super) group: Group,
    pub(super) first: Id,
    pub(super) n: u32,
}

/// A function that is a node.
pub(crate) type External = std::sync::Arc<dyn crate::func::Function>;

/// A hash-consed graph of scalar expressions and conditions.
#[derive(Default)]
pub struct Dag {
    nodes: Vec<Node>,
    table: Table,
    pub(super) groups: Vec<GroupEntry>,
    group_index: BTreeMap<Group, u32>,
    pub(super) functions: Vec<External>,
    pub(super) piecewise: Vec<Piecewise>,
    pub(super) switches: Vec<Switch>,
    pub(super) switch_index: BTreeMap<SwitchKey, u32>,
    /// Unknowns of inner problems that were handed out.
    pub(super) n_unknowns: usize,
}

impl Dag {
    /// Nodes a graph may have; [`Id`] is a 32-bit number.
    pub const MAX_NODES: usize = u32::MAX as usize - 1;

    /// An empty graph.
    pub fn new() -> Dag {
        Dag::default()
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True without nodes.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The node of a number.
    pub fn id(&self, index: usize) -> Result<Id> {
        if index < self.nodes.len() {
            return Ok(Id(index as u32));
        }
        Err(Error::Range(format!("expression {index} does not exist: the graph has {}", self.nodes.len())))
    }

    /// The operation of a node and its operands.
    #[inline]
    pub fn node(&self, id: Id) -> Node {
        self.nodes[id.index()]
    }

    /// The functions that nodes call.
    pub(crate) fn external_functions(&self) -> &[External] {
        &self.functions
    }

    /// Value of a constant.
    pub fn as_const(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Const(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// True for conditions, false for values.
    pub fn is_condition(&self, id: Id) -> bool {
        matches!(self.node(id), Node::Truth(_) | Node::Positive(_) | Node::Not(_) | Node::And(..) | Node::Or(..))
    }

    pub(super) fn intern(&mut self, node: Node) -> Id {
        let nodes = &self.nodes;
        match self.table.find(&node, nodes) {
            Ok(id) => id,
            Err(slot) => {
                assert!(nodes.len() < Self::MAX_NODES, "the graph is full");
                let id = Id(nodes.len() as u32);
                memory::room(&mut self.nodes, 1);
                self.nodes.push(node);
                self.table.insert(slot, id);
                id
            }
        }
    }

    /// A constant. Values that are not finite are refused when a function is made of them.
    pub fn constant(&mut self, v: f64) -> Id {
        // One zero.
        self.intern(Node::Const((v + 0.0).to_bits()))
    }

    /// Component `index` of an input block (0 for the time).
    pub fn input(&mut self, block: Block, index: usize) -> Id {
        self.intern(Node::Input(block, index as u32))
    }

    /// Value of a function of one argument.
    pub fn unary(&mut self, op: Unary, a: Id) -> Id {
        if op == Unary::Neg {
            return self.neg(a);
        }
        if let Some(v) = self.as_const(a) {
            return self.constant(op.eval(v));
        }
        match (op, self.node(a)) {
            (Unary::Exp, Node::Unary(Unary::Log, b)) | (Unary::Log, Node::Unary(Unary::Exp, b)) => b,
            // Odd and even functions: the sign goes outside, or away.
            (
                Unary::Sin | Unary::Tan | Unary::Asin | Unary::Atan | Unary::Sinh | Unary::Tanh | Unary::Erf,
                Node::Unary(Unary::Neg, b),
            ) => {
                let inner = self.intern(Node::Unary(op, b));
                self.neg(inner)
            }
            (Unary::Cos | Unary::Cosh, Node::Unary(Unary::Neg, b)) => self.intern(Node::Unary(op, b)),
            _ => self.intern(Node::Unary(op, a)),
        }
    }

    /// Value of a function of two arguments.
    pub fn binary(&mut self, op: Binary, a: Id, b: Id) -> Id {
        match op {
            Binary::Add => self.add(a, b),
            Binary::Sub => self.sub(a, b),
            Binary::Mul => self.mul(a, b),
            Binary::Div => self.div(a, b),
            Binary::Pow => self.pow(a, b),
            Binary::Atan2 => match (self.as_const(a), self.as_const(b)) {
                (Some(y), Some(x)) => self.constant(y.atan2(x)),
                _ => self.intern(Node::Binary(Binary::Atan2, a, b)),
            },
        }
    }

    /// `−a`
    pub fn neg(&mut self, a: Id) -> Id {
        match self.node(a) {
            Node::Const(bits) => self.constant(-f64::from_bits(bits)),
            Node::Unary(Unary::Neg, b) => b,
            Node::Binary(Binary::Sub, x, y) => self.sub(y, x),
            Node::Binary(Binary::Mul, c, x) if self.as_const(c).is_some() => {
                let c = self.neg(c);
                self.mul(c, x)
            }
            Node::Binary(Binary::Add, k, x) if self.as_const(k).is_some() => {
                let k = self.neg(k);
                self.sub(k, x)
            }
            _ => self.intern(Node::Unary(Unary::Neg, a)),
        }
    }

    /// A negative number, or written with a minus sign or a negative factor.
    pub(super) fn is_negative(&self, a: Id) -> bool {
        self.as_const(a).unwrap_or_else(|| self.scaled(a).0) < 0.0
    }

    /// `c · x` of a node: the constant factor and the rest.
    fn scaled(&self, a: Id) -> (f64, Id) {
        match self.node(a) {
            Node::Unary(Unary::Neg, x) => {
                let (c, x) = match self.node(x) {
                    Node::Binary(Binary::Mul, c, y) => self.as_const(c).map_or((1.0, x), |c| (c, y)),
                    _ => (1.0, x),
                };
                (-c, x)
            }
            Node::Binary(Binary::Mul, c, x) => self.as_const(c).map_or((1.0, a), |c| (c, x)),
            _ => (1.0, a),
        }
    }

    /// `k + rest`, if the node is a sum with a constant.
    fn shifted(&self, a: Id) -> Option<(f64, Id)> {
        match self.node(a) {
            Node::Binary(Binary::Add, k, x) => self.as_const(k).map(|k| (k, x)),
            _ => None,
        }
    }

    /// `a + b`
    pub fn add(&mut self, a: Id, b: Id) -> Id {
        let (ca, cb) = (self.as_const(a), self.as_const(b));
        match (ca, cb) {
            (Some(x), Some(y)) => return self.constant(x + y),
            (Some(0.0), None) => return b,
            (None, Some(0.0)) => return a,
            (None, Some(_)) => return self.add(b, a),
            (Some(k), None) => {
                if let Some((l, x)) = self.shifted(b) {
                    let sum = self.constant(k + l);
                    return self.add(sum, x);
                }
                // k + (l − x)
                if let Node::Binary(Binary::Sub, l, x) = self.node(b) {
                    if let Some(l) = self.as_const(l) {
                        let sum = self.constant(k + l);
                        return self.sub(sum, x);
                    }
                }
                return match self.node(b) {
                    Node::Unary(Unary::Neg, x) => self.intern(Node::Binary(Binary::Sub, a, x)),
                    _ => self.intern(Node::Binary(Binary::Add, a, b)),
                };
            }
            (None, None) => {}
        }
        if let Some(sum) = self.like_terms(a, b, 1.0) {
            return sum;
        }
        match (self.node(a), self.node(b)) {
            (_, Node::Unary(Unary::Neg, y)) => return self.sub(a, y),
            (Node::Unary(Unary::Neg, x), _) => return self.sub(b, x),
            (_, Node::Binary(Binary::Sub, x, y)) if y == a => return x,
            (Node::Binary(Binary::Sub, x, y), _) if y == b => return x,
            _ => {}
        }
        self.intern(Node::Binary(Binary::Add, a.min(b), a.max(b)))
    }

    /// `a − b`
    pub fn sub(&mut self, a: Id, b: Id) -> Id {
        match (self.as_const(a), self.as_const(b)) {
            (Some(x), Some(y)) => return self.constant(x - y),
            (_, Some(y)) => {
                let k = self.constant(-y);
                return self.add(k, a);
            }
            (Some(0.0), None) => return self.neg(b),
            (Some(k), None) => {
                if let Some((l, x)) = self.shifted(b) {
                    let rest = self.constant(k - l);
                    return self.sub(rest, x);
                }
                if let Node::Binary(Binary::Sub, l, x) = self.node(b) {
                    if let Some(l) = self.as_const(l) {
                        let rest = self.constant(k - l);
                        return self.add(rest, x);
                    }
                }
                return match self.node(b) {
                    Node::Unary(Unary::Neg, x) => self.add(a, x),
                    _ => self.intern(Node::Binary(Binary::Sub, a, b)),
                };
            }
            (None, None) => {}
        }
        if let Some(sum) = self.like_terms(a, b, -1.0) {
            return sum;
        }
        match (self.node(a), self.node(b)) {
            (_, Node::Unary(Unary::Neg, y)) => return self.add(a, y),
            (Node::Unary(Unary::Neg, x), _) => {
                let sum = self.add(x, b);
                return self.neg(sum);
            }
            (Node::Binary(Binary::Add, x, y), _) if y == b => return x,
            (Node::Binary(Binary::Add, x, y), _) if x == b => return y,
            (_, Node::Binary(Binary::Add, x, y)) if x == a => return self.neg(y),
            (_, Node::Binary(Binary::Add, x, y)) if y == a => return self.neg(x),
            (Node::Binary(Binary::Sub, x, y), _) if x == b => return self.neg(y),
            (_, Node::Binary(Binary::Sub, x, y)) if x == a => return y,
            _ => {}
        }
        self.intern(Node::Binary(Binary::Sub, a, b))
    }

    /// `c1 x + sign c2 x` as one term.
    fn like_terms(&mut self, a: Id, b: Id, sign: f64) -> Option<Id> {
        let ((ca, xa), (cb, xb)) = (self.scaled(a), self.scaled(b));
        if xa != xb {
            return None;
        }
        let c = self.constant(ca + sign * cb);
        Some(self.mul(c, xa))
    }

    /// `a b`; constant factors become one where it has all its digits.
    pub fn mul(&mut self, a: Id, b: Id) -> Id {
        match (self.as_const(a), self.as_const(b)) {
            (Some(x), Some(y)) => return self.constant(x * y),
            (None, Some(_)) => return self.mul(b, a),
            (Some(c), None) => {
                if c == 0.0 || c == 1.0 {
                    return if c == 0.0 { a } else { b };
                }
                let (d, x) = self.scaled(b);
                if d != 1.0 && keeps_digits(c * d) {
                    let product = self.constant(c * d);
                    return self.mul(product, x);
                }
                return match c {
                    -1.0 => self.neg(b),
                    _ => self.intern(Node::Binary(Binary::Mul, a, b)),
                };
            }
            (None, None) => {}
        }
        let ((ca, xa), (cb, xb)) = (self.scaled(a), self.scaled(b));
        if ca * cb != 1.0 {
            if !keeps_digits(ca * cb) {
                return self.intern(Node::Binary(Binary::Mul, a.min(b), a.max(b)));
            }
            let product = self.mul(xa, xb);
            let c = self.constant(ca * cb);
            return self.mul(c, product);
        }
        let power = |dag: &Dag, x: Id| match dag.node(x) {
            Node::PowI(y, n) => (y, n),
            _ => (x, 1),
        };
        let ((ya, na), (yb, nb)) = (power(self, xa), power(self, xb));
        if ya == yb {
            if let Some(n) = na.checked_add(nb) {
                return self.powi(ya, n);
            }
        }
        // a (x / a) = x
        if let Node::Binary(Binary::Div, x, y) = self.node(b) {
            if y == a {
                return x;
            }
        }
        if let Node::Binary(Binary::Div, x, y) = self.node(a) {
            if y == b {
                return x;
            }
        }
        self.intern(Node::Binary(Binary::Mul, xa.min(xb), xa.max(xb)))
    }

    /// `a / b`
    pub fn div(&mut self, a: Id, b: Id) -> Id {
        let (mut a, mut b) = (a, b);
        // a / (x / y); a loop, because quotients can be nested deeply
        while let Node::Binary(Binary::Div, x, y) = self.node(b) {
            (a, b) = (self.mul(a, y), x);
        }
        match (self.as_const(a), self.as_const(b)) {
            (Some(x), Some(y)) => return self.constant(x / y),
            (Some(0.0), None) => return a,
            (None, Some(y)) if keeps_digits(1.0 / y) || y == 0.0 || !y.is_finite() => {
                let c = self.constant(1.0 / y);
                return self.mul(c, a);
            }
            (None, Some(_)) => return self.intern(Node::Binary(Binary::Div, a, b)),
            _ => {}
        }
        if a == b {
            return self.constant(1.0);
        }
        let ((ca, xa), (cb, xb)) = (self.scaled(a), self.scaled(b));
        if ca != 1.0 || cb != 1.0 {
            if !keeps_digits(ca / cb) {
                return self.intern(Node::Binary(Binary::Div, a, b));
            }
            let c = self.constant(ca / cb);
            let q = self.div(xa, xb);
            return self.mul(c, q);
        }
        match (self.node(a), self.node(b)) {
            (Node::PowI(x, n), _) if x == b => return self.powi(x, n - 1),
            (Node::Binary(Binary::Mul, x, y), _) if y == b => return x,
            (Node::Binary(Binary::Mul, x, y), _) if x == b => return y,
            _ => {}
        }
        self.intern(Node::Binary(Binary::Div, a, b))
    }

    /// `aⁿ`, `n` an integer.
    pub fn powi(&mut self, a: Id, n: i32) -> Id {
        if let Some(v) = self.as_const(a) {
            return self.constant(powi(v, n));
        }
        match n {
            0 => return self.constant(1.0),
            1 => return a,
            -1 => {
                let one = self.constant(1.0);
                return self.div(one, a);
            }
            _ => {}
        }
        match self.node(a) {
            Node::PowI(x, m) => {
                if let Some(k) = m.checked_mul(n) {
                    return self.powi(x, k);
                }
            }
            Node::Unary(Unary::Neg, x) => {
                let p = self.powi(x, n);
                return if n % 2 == 0 { p } else { self.neg(p) };
            }
            Node::Binary(Binary::Sub, x, y) if n % 2 == 0 && x > y => {
                let d = self.sub(y, x);
                return self.powi(d, n);
            }
            _ => {}
        }
        self.intern(Node::PowI(a, n))
    }

    /// `aᵇ`; an integer power where `b` is an integer constant, a square root where it is one half.
    pub fn pow(&mut self, a: Id, b: Id) -> Id {
        match (self.as_const(a), self.as_const(b)) {
            (Some(x), Some(y)) => return self.constant(x.powf(y)),
            // exponents have no unit; beyond a million a power by squaring is no more exact than one by logarithms
            (None, Some(y)) if y.fract() == 0.0 && y.abs() < 1e6 => return self.powi(a, y as i32),
            (None, Some(0.5)) => return self.unary(Unary::Sqrt, a),
            _ => {}
        }
        self.intern(Node::Binary(Binary::Pow, a, b))
    }

    /// Makes a group, or finds it, and returns its number.
    pub(super) fn group(&mut self, group: Group, n: usize) -> u32 {
        if let Some(&g) = self.group_index.get(&group) {
            return g;
        }
        let g = self.groups.len() as u32;
        let first = Id(self.nodes.len() as u32);
        self.group_index.insert(group.clone(), g);
        self.groups.push(GroupEntry { group, first, n: n as u32 });
        for k in 0..n {
            self.intern(Node::Pick(g, k as u32));
        }
        g
    }

    /// Component `k` of a group.
    pub(super) fn pick(&self, g: u32, k: usize) -> Id {
        Id(self.groups[g as usize].first.0 + k as u32)
    }

    /// Calls `visit` with everything the node is computed from; for a component that is all its group needs.
    pub(super) fn for_children(&self, id: Id, mut visit: impl FnMut(Id)) {
        match self.node(id) {
            Node::Const(_) | Node::Input(..) | Node::Truth(_) => {}
            Node::Unary(_, a) | Node::PowI(a, _) | Node::Piecewise(_, _, a) | Node::Not(a) => visit(a),
            Node::Binary(_, a, b) | Node::And(a, b) | Node::Or(a, b) => {
                visit(a);
                visit(b);
            }
            Node::Positive(s) => visit(self.switches[s as usize].psi),
            Node::Select(c, a, b) => {
                visit(c);
                visit(a);
                visit(b);
            }
            Node::Pick(g, _) => self.for_group_children(g, &mut visit),
        }
    }

    fn for_group_children(&self, g: u32, visit: &mut impl FnMut(Id)) {
        match &self.groups[g as usize].group {
            Group::Factor { matrix, .. } => matrix.iter().for_each(|&a| visit(a)),
            Group::Call { args, .. } => args.iter().for_each(|&a| visit(a)),
            Group::Solve { factor, rhs, .. } => {
                rhs.iter().for_each(|&a| visit(a));
                self.for_group_children(*factor, visit);
            }
        }
    }

    /// All nodes the roots are computed from, themselves included, oldest first.
    pub fn reachable(&self, roots: &[Id]) -> Vec<Id> {
        let mut seen = Seen::below(roots.iter().map(|r| r.index() + 1).max().unwrap_or(0));
        let mut stack: Vec<Id> = roots.to_vec();
        let mut out = Vec::new();
        while let Some(id) = stack.pop() {
            if !seen.insert(id.index()) {
                continue;
            }
            out.push(id);
            match self.node(id) {
                // The other components of the group need the same.
                Node::Pick(g, _) => {
                    let e = &self.groups[g as usize];
                    let known = (e.first.0..e.first.0 + e.n).any(|k| k != id.0 && seen.contains(k as usize));
                    if !known {
                        self.for_children(id, |c| stack.push(c));
                    }
                }
                _ => self.for_children(id, |c| stack.push(c)),
            }
        }
        out.sort_unstable();
        out
    }
}

/// Numbers of nodes that were met: a set while they are few, so that looking at a small part of a large graph costs as much
/// as that part.
enum Seen {
    Few(HashSet<usize>, usize),
    Many(Vec<bool>),
}

impl Seen {
    /// A set of numbers that is worth a table has at least so many of them, and this share of all.
    const SHARE: usize = 64;

    fn below(top: usize) -> Seen {
        if top <= 64 * Seen::SHARE {
            return Seen::Many(vec![false; top]);
        }
        Seen::Few(HashSet::new(), top)
    }

    fn contains(&self, k: usize) -> bool {
        match self {
            Seen::Few(set, _) => set.contains(&k),
            Seen::Many(all) => all.get(k).copied().unwrap_or(false),
        }
    }

    /// Adds a number; false if it was there.
    fn insert(&mut self, k: usize) -> bool {
        if let Seen::Few(set, top) = self {
            if set.len() * Seen::SHARE < *top {
                return set.insert(k);
            }
            let mut all = vec![false; *top];
            set.iter().for_each(|&k| all[k] = true);
            *self = Seen::Many(all);
        }
        match self {
            Seen::Many(all) => !std::mem::replace(&mut all[k], true),
            Seen::Few(set, _) => set.insert(k),
        }
    }
}

/// Did a product or quotient of constants that are not zero stay within the numbers with 53 digits? What is smaller or
/// larger would lose digits, or the whole term, that its factors one by one have.
fn keeps_digits(v: f64) -> bool {
    v.is_normal()
}

/// Open addressing over node numbers. A slot holds the upper half of the hash, then the number: nodes are looked at only
/// where the hash agrees, and a larger table is filled without hashing again.
#[derive(Default)]
struct Table {
    slots: Vec<u64>,
    used: usize,
}

const FREE: u64 = u64::MAX;

fn slot_of(hash: u64, id: Id) -> u64 {
    (hash & !0xffff_ffff) | u64::from(id.0)
}

impl Table {
    /// The node, or the slot where it belongs and its hash.
    fn find(&self, node: &Node, nodes: &[Node]) -> std::result::Result<Id, (usize, u64)> {
        let hash = hash(node);
        if self.slots.is_empty() {
            return Err((0, hash));
        }
        let mask = self.slots.len() - 1;
        let mut at = (hash >> 32) as usize & mask;
        loop {
            let slot = self.slots[at];
            if slot == FREE {
                return Err((at, hash));
            }
            let id = Id(slot as u32);
            if slot == slot_of(hash, id) && nodes[id.index()] == *node {
                return Ok(id);
            }
            at = (at + 1) & mask;
        }
    }

    fn insert(&mut self, (at, hash): (usize, u64), id: Id) {
        if 2 * (self.used + 1) > self.slots.len() {
            let larger = vec![FREE; (2 * self.slots.len()).max(64)];
            for slot in std::mem::replace(&mut self.slots, larger) {
                if slot != FREE {
                    self.put(slot);
                }
            }
            self.put(slot_of(hash, id));
        } else {
            self.slots[at] = slot_of(hash, id);
        }
        self.used += 1;
    }

    fn put(&mut self, slot: u64) {
        let mask = self.slots.len() - 1;
        let mut at = (slot >> 32) as usize & mask;
        while self.slots[at] != FREE {
            at = (at + 1) & mask;
        }
        self.slots[at] = slot;
    }
}

fn hash(node: &Node) -> u64 {
    use std::hash::{Hash, Hasher};
    struct Mix(u64);
    impl Hasher for Mix {
        fn finish(&self) -> u64 {
            // the upper half, which counts, from all bits: those of whole numbers end in zeros
            self.0.wrapping_mul(0xd6e8_feb8_6659_fd93)
        }
        fn write(&mut self, bytes: &[u8]) {
            for &b in bytes {
                self.write_u64(u64::from(b));
            }
        }
        fn write_u32(&mut self, v: u32) {
            self.write_u64(u64::from(v));
        }
        fn write_usize(&mut self, v: usize) {
            self.write_u64(v as u64);
        }
        fn write_u64(&mut self, v: u64) {
            let x = (self.0.rotate_left(23) ^ v).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            self.0 = x ^ (x >> 32);
        }
    }
    let mut h = Mix(0);
    node.hash(&mut h);
    h.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers as constants, and inputs, spread over the table: of `n` values in `n` places 63 % are taken by chance.
    #[test]
    fn hashes_spread() {
        let n = 1 << 16;
        let taken = |node: &dyn Fn(u32) -> Node| {
            let mut places: Vec<u64> = (0..n).map(|k| (hash(&node(k)) >> 32) & u64::from(n - 1)).collect();
            places.sort_unstable();
            places.dedup();
            places.len() as f64 / f64::from(n)
        };
        let numbers = taken(&|k| Node::Const(f64::from(k).to_bits()));
        let inputs = taken(&|k| Node::Input(Block::X, k));
        let sums = taken(&|k| Node::Binary(Binary::Mul, Id(k), Id(k / 3)));
        assert!(numbers > 0.5 && inputs > 0.5 && sums > 0.5, "{numbers} {inputs} {sums}");
    }

    fn dag() -> (Dag, Id, Id) {
        let mut d = Dag::new();
        let (x, y) = (d.input(Block::X, 0), d.input(Block::X, 1));
        (d, x, y)
    }

    #[test]
    fn equal_nodes_are_one_node() {
        let (mut d, x, y) = dag();
        let (a, b) = (d.add(x, y), d.add(y, x));
        assert_eq!(a, b);
        let (a, b) = (d.mul(x, y), d.mul(y, x));
        assert_eq!(a, b);
        let n = d.len();
        for k in 0..1000 {
            let c = d.constant(f64::from(k));
            let s = d.add(c, x);
            d.unary(Unary::Sin, s);
        }
        let m = d.len();
        // 0 + x is x, with a sine of its own.
        assert_eq!(m - n, 3 * 1000 - 1);
        for k in 0..1000 {
            let c = d.constant(f64::from(k));
            let s = d.add(x, c);
            d.unary(Unary::Sin, s);
        }
        assert_eq!(d.len(), m);
    }

    #[test]
    fn simplification() {
        let (mut d, x, y) = dag();
        let [zero, one, two, three] = [0.0, 1.0, 2.0, 3.0].map(|v| d.constant(v));
        assert_eq!(d.add(x, zero), x);
        assert_eq!(d.mul(x, one), x);
        assert_eq!(d.mul(zero, x), zero);
        assert_eq!(d.sub(x, x), zero);
        assert_eq!(d.div(x, x), one);
        let twice = d.mul(two, x);
        assert_eq!(d.add(x, x), twice);
        assert_eq!(d.sub(twice, x), x);
        let s = d.add(x, y);
        assert_eq!(d.sub(s, x), y);
        assert_eq!(d.sub(s, y), x);
        let m = d.sub(x, y);
        let n = d.sub(y, x);
        assert_eq!(d.neg(m), n);
        assert_eq!(d.add(m, y), x);
        let square = d.powi(x, 2);
        assert_eq!(d.mul(x, x), square);
        let cube = d.powi(x, 3);
        assert_eq!(d.mul(square, x), cube);
        assert_eq!(d.div(cube, x), square);
        assert_eq!(d.pow(x, three), cube);
        let a = d.add(one, x);
        let b = d.add(a, two);
        let c = d.add(three, x);
        assert_eq!(b, c);
        let k = d.sub(one, x);
        let k = d.sub(one, k);
        assert_eq!(k, x);
        let minus = d.neg(x);
        let (p, q) = (d.mul(minus, y), d.mul(x, y));
        assert_eq!(d.neg(p), q);
        let e = d.unary(Unary::Exp, x);
        assert_eq!(d.unary(Unary::Log, e), x);
        let q = d.div(x, y);
        let inverse = d.div(one, q);
        assert_eq!(inverse, d.div(y, x));
        let (s, t) = (d.unary(Unary::Sin, minus), d.unary(Unary::Sin, x));
        assert_eq!(d.neg(s), t);
        let minus_zero = d.constant(-0.0);
        assert_eq!(minus_zero, zero);
    }

    #[test]
    fn like_terms_of_negative_multiples_end() {
        let (mut d, x, y) = dag();
        let two = d.constant(2.0);
        let a = d.mul(two, x);
        let b = d.neg(a);
        let zero = d.constant(0.0);
        assert_eq!(d.add(a, b), zero);
        let c = d.mul(b, y);
        let e = d.mul(a, y);
        assert_eq!(d.add(c, e), zero);
    }

    #[test]
    fn constants_out_of_range_do_not_swallow_terms() {
        let (mut d, x, y) = dag();
        let [small, large, zero] = [1e-200, 1e200, 0.0].map(|v| d.constant(v));
        let (a, b) = (d.mul(small, x), d.mul(small, y));
        for e in [d.mul(a, b), d.mul(small, a)] {
            assert!(e != zero && d.as_const(e).is_none());
        }
        let (p, q) = (d.mul(large, x), d.mul(large, y));
        let huge = [d.mul(p, q), d.mul(large, p), d.div(p, b), d.div(a, q)];
        let tiny = d.constant(1e-310);
        let over = d.div(x, tiny);
        for e in huge.into_iter().chain([over]) {
            for id in d.reachable(&[e]) {
                assert!(d.as_const(id).is_none_or(|v| v.is_finite() && v != 0.0));
            }
        }
        // taken together again they are ordinary numbers
        let back = d.mul(small, p);
        assert_eq!(back, x);
    }

    #[test]
    fn only_what_is_needed_is_reachable() {
        let (mut d, x, y) = dag();
        let a = d.add(x, y);
        let s = d.unary(Unary::Sin, a);
        d.unary(Unary::Cos, s);
        assert_eq!(d.reachable(&[s]), [x, y, a, s]);
        assert!(d.id(99).is_err());
    }
}
