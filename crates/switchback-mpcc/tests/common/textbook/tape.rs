//! Expressions written as formulas, with exact first and second derivatives.
//!
//! Nodes live on a list per thread that is in use while a problem is written down, so expressions are numbers that
//! can be copied. Gradients by reverse sweeps, Hessians by a forward sweep along every variable followed by a
//! reverse one, patterns by walking the graph.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::{Add, Div, Mul, Neg, Sub};

use switchback_mpcc::func::{EvalError, EvalResult};
use switchback_mpcc::linalg::csc::Pattern;
use switchback_mpcc::nlp::Nlp;

/// An expression: the number of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ex(usize);

#[derive(Debug, Clone, Copy)]
enum Fun {
    Power(i32),
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
}

impl Fun {
    /// Value, first and second derivative.
    fn at(self, v: f64) -> [f64; 3] {
        match self {
            Fun::Power(n) => {
                let d = f64::from(n);
                // a zero exponent of the derivative must not meet a zero base
                let d2 = if n == 0 || n == 1 { 0.0 } else { d * (d - 1.0) * v.powi(n - 2) };
                [v.powi(n), if n == 0 { 0.0 } else { d * v.powi(n - 1) }, d2]
            }
            Fun::Sqrt => {
                let s = v.sqrt();
                [s, 0.5 / s, -0.25 / (s * v)]
            }
            Fun::Exp => [v.exp(); 3],
            Fun::Ln => [v.ln(), 1.0 / v, -1.0 / (v * v)],
            Fun::Sin => [v.sin(), v.cos(), -v.sin()],
            Fun::Cos => [v.cos(), -v.sin(), -v.cos()],
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Node {
    Var(usize),
    Const(f64),
    /// `a + c b`.
    Sum(Ex, f64, Ex),
    Product(Ex, Ex),
    Scaled(f64, Ex),
    Fun(Fun, Ex),
}

thread_local! {
    static NODES: RefCell<Vec<Node>> = const { RefCell::new(Vec::new()) };
}

fn push(node: Node) -> Ex {
    NODES.with_borrow_mut(|nodes| {
        nodes.push(node);
        Ex(nodes.len() - 1)
    })
}

impl Ex {
    /// A constant.
    pub fn constant(v: f64) -> Ex {
        push(Node::Const(v))
    }
    /// Variable `j` of the problem.
    pub fn variable(j: usize) -> Ex {
        push(Node::Var(j))
    }
    /// The number of the variable this is, if it is one and nothing else.
    pub fn as_variable(self) -> Option<usize> {
        NODES.with_borrow(|nodes| match nodes[self.0] {
            Node::Var(j) => Some(j),
            _ => None,
        })
    }
    /// `self^n`.
    pub fn powi(self, n: i32) -> Ex {
        push(Node::Fun(Fun::Power(n), self))
    }
    /// Square.
    pub fn sq(self) -> Ex {
        self.powi(2)
    }
    /// Square root.
    pub fn sqrt(self) -> Ex {
        push(Node::Fun(Fun::Sqrt, self))
    }
    /// Exponential.
    pub fn exp(self) -> Ex {
        push(Node::Fun(Fun::Exp, self))
    }
    /// Natural logarithm.
    pub fn ln(self) -> Ex {
        push(Node::Fun(Fun::Ln, self))
    }
    /// `self^a` for a positive base.
    pub fn powf(self, a: f64) -> Ex {
        (a * self.ln()).exp()
    }
    /// Sine.
    pub fn sin(self) -> Ex {
        push(Node::Fun(Fun::Sin, self))
    }
    /// Cosine.
    pub fn cos(self) -> Ex {
        push(Node::Fun(Fun::Cos, self))
    }
}

/// `Σ c_i x_i` plus a constant.
pub fn affine(c: &[f64], x: &[Ex], constant: f64) -> Ex {
    assert_eq!(c.len(), x.len());
    c.iter().zip(x).filter(|(c, _)| **c != 0.0).fold(Ex::constant(constant), |sum, (c, x)| sum + *c * *x)
}

/// Sum of expressions.
pub fn sum(terms: impl IntoIterator<Item = Ex>) -> Ex {
    terms.into_iter().reduce(|a, b| a + b).unwrap_or_else(|| Ex::constant(0.0))
}

impl Add for Ex {
    type Output = Ex;
    fn add(self, b: Ex) -> Ex {
        push(Node::Sum(self, 1.0, b))
    }
}
impl Sub for Ex {
    type Output = Ex;
    fn sub(self, b: Ex) -> Ex {
        push(Node::Sum(self, -1.0, b))
    }
}
impl Mul for Ex {
    type Output = Ex;
    fn mul(self, b: Ex) -> Ex {
        push(Node::Product(self, b))
    }
}
impl Div for Ex {
    type Output = Ex;
    fn div(self, b: Ex) -> Ex {
        self * b.powi(-1)
    }
}
impl Neg for Ex {
    type Output = Ex;
    fn neg(self) -> Ex {
        push(Node::Scaled(-1.0, self))
    }
}
impl Add<f64> for Ex {
    type Output = Ex;
    fn add(self, b: f64) -> Ex {
        self + Ex::constant(b)
    }
}
impl Sub<f64> for Ex {
    type Output = Ex;
    fn sub(self, b: f64) -> Ex {
        self + Ex::constant(-b)
    }
}
impl Mul<f64> for Ex {
    type Output = Ex;
    fn mul(self, b: f64) -> Ex {
        push(Node::Scaled(b, self))
    }
}
impl Div<f64> for Ex {
    type Output = Ex;
    fn div(self, b: f64) -> Ex {
        self * (1.0 / b)
    }
}
impl Add<Ex> for f64 {
    type Output = Ex;
    fn add(self, b: Ex) -> Ex {
        Ex::constant(self) + b
    }
}
impl Sub<Ex> for f64 {
    type Output = Ex;
    fn sub(self, b: Ex) -> Ex {
        Ex::constant(self) - b
    }
}
impl Mul<Ex> for f64 {
    type Output = Ex;
    fn mul(self, b: Ex) -> Ex {
        b * self
    }
}
impl Div<Ex> for f64 {
    type Output = Ex;
    fn div(self, b: Ex) -> Ex {
        self * b.powi(-1)
    }
}

/// Forgets all expressions.
pub fn clear() {
    NODES.with_borrow_mut(Vec::clear);
}

/// One output: the nodes it needs, in the order of evaluation, its variables, and where derivatives go.
#[derive(Debug, Clone)]
struct Output {
    root: usize,
    order: Vec<usize>,
    /// Variables, and the place of each in the row of the Jacobian (or the dense gradient).
    vars: Vec<(usize, usize)>,
    /// Variables with second derivatives.
    curved: Vec<usize>,
}

/// A nonlinear program as a list of nodes.
#[derive(Debug, Clone)]
pub struct Program {
    n: usize,
    nodes: Vec<Node>,
    objective: Output,
    rows: Vec<Output>,
    jac: Pattern,
    hess: Pattern,
    /// Point of the last derivatives.
    x: Vec<f64>,
    values: Vec<f64>,
    tangents: Vec<f64>,
    adjoints: Vec<f64>,
    adjoint_tangents: Vec<f64>,
    column: Vec<f64>,
}

/// Variables a node depends on, per node.
fn dependencies(nodes: &[Node]) -> Vec<BTreeSet<usize>> {
    let mut vars: Vec<BTreeSet<usize>> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let set = match *node {
            Node::Var(j) => BTreeSet::from([j]),
            Node::Const(_) => BTreeSet::new(),
            Node::Sum(a, _, b) | Node::Product(a, b) => vars[a.0].union(&vars[b.0]).copied().collect(),
            Node::Scaled(_, a) | Node::Fun(_, a) => vars[a.0].clone(),
        };
        vars.push(set);
    }
    vars
}

impl Output {
    /// The part of the graph below `root`; pairs of variables that interact are added to `pairs`.
    fn new(nodes: &[Node], deps: &[BTreeSet<usize>], root: Ex, pairs: &mut BTreeSet<(usize, usize)>) -> Output {
        let mut used = vec![false; root.0 + 1];
        used[root.0] = true;
        let mut curved = BTreeSet::new();
        let mut interact = |a: Ex, b: Ex| {
            for &i in &deps[a.0] {
                for &j in &deps[b.0] {
                    pairs.insert((i.min(j), i.max(j)));
                    curved.extend([i, j]);
                }
            }
        };
        for k in (0..=root.0).rev() {
            if !used[k] {
                continue;
            }
            match nodes[k] {
                Node::Var(_) | Node::Const(_) => {}
                Node::Sum(a, _, b) => {
                    used[a.0] = true;
                    used[b.0] = true;
                }
                Node::Product(a, b) => {
                    used[a.0] = true;
                    used[b.0] = true;
                    interact(a, b);
                }
                Node::Scaled(_, a) => used[a.0] = true,
                Node::Fun(_, a) => {
                    used[a.0] = true;
                    interact(a, a);
                }
            }
        }
        let order = (0..=root.0).filter(|&k| used[k]).collect();
        let vars = deps[root.0].iter().map(|&j| (j, j)).collect();
        Output { root: root.0, order, vars, curved: curved.into_iter().collect() }
    }
}

impl Program {
    /// `min f` with rows `c` in `n` variables; takes the expressions written since the last [`clear`].
    pub fn new(n: usize, f: Ex, c: &[Ex]) -> Program {
        let nodes = NODES.take();
        let deps = dependencies(&nodes);
        let mut pairs = BTreeSet::new();
        let objective = Output::new(&nodes, &deps, f, &mut pairs);
        let mut rows: Vec<Output> = c.iter().map(|&r| Output::new(&nodes, &deps, r, &mut pairs)).collect();
        let (mut ri, mut ci) = (Vec::new(), Vec::new());
        for (i, row) in rows.iter().enumerate() {
            for &(j, _) in &row.vars {
                ri.push(i);
                ci.push(j);
            }
        }
        let (jac, map) = Pattern::from_triplets(c.len(), n, &ri, &ci);
        for (place, k) in rows.iter_mut().flat_map(|r| &mut r.vars).zip(&map) {
            place.1 = *k;
        }
        let (hi, hj): (Vec<usize>, Vec<usize>) = pairs.into_iter().unzip();
        let (hess, _) = Pattern::from_triplets(n, n, &hi, &hj);
        let zeros = vec![0.0; nodes.len()];
        Program {
            n,
            objective,
            rows,
            jac,
            hess,
            x: vec![0.0; n],
            values: zeros.clone(),
            tangents: zeros.clone(),
            adjoints: zeros.clone(),
            adjoint_tangents: zeros,
            column: vec![0.0; n],
            nodes,
        }
    }

    fn forward(&mut self, x: &[f64]) {
        let v = &mut self.values;
        for (k, node) in self.nodes.iter().enumerate() {
            v[k] = match *node {
                Node::Var(j) => x[j],
                Node::Const(c) => c,
                Node::Sum(a, c, b) => v[a.0] + c * v[b.0],
                Node::Product(a, b) => v[a.0] * v[b.0],
                Node::Scaled(c, a) => c * v[a.0],
                Node::Fun(f, a) => f.at(v[a.0])[0],
            };
        }
    }

    /// Gradient of one output at the values of the last forward sweep, `(place, derivative)` in `put`.
    fn gradient(nodes: &[Node], v: &[f64], adj: &mut [f64], out: &Output, put: &mut [f64]) {
        for &k in &out.order {
            adj[k] = 0.0;
        }
        adj[out.root] = 1.0;
        for &k in out.order.iter().rev() {
            let a = adj[k];
            match nodes[k] {
                Node::Var(_) | Node::Const(_) => {}
                Node::Sum(l, c, r) => {
                    adj[l.0] += a;
                    adj[r.0] += c * a;
                }
                Node::Product(l, r) => {
                    adj[l.0] += a * v[r.0];
                    adj[r.0] += a * v[l.0];
                }
                Node::Scaled(c, l) => adj[l.0] += c * a,
                Node::Fun(f, l) => adj[l.0] += a * f.at(v[l.0])[1],
            }
        }
        for &(_, place) in &out.vars {
            put[place] = 0.0;
        }
        for &k in &out.order {
            if let Node::Var(j) = nodes[k] {
                if let Ok(i) = out.vars.binary_search_by_key(&j, |p| p.0) {
                    put[out.vars[i].1] += adj[k];
                }
            }
        }
    }

    /// `column = w ∇²out e_j`.
    fn hessian_column(&mut self, out: usize, j: usize, w: f64) {
        let out = if out == 0 { &self.objective } else { &self.rows[out - 1] };
        let (v, t, adj, adt) = (&self.values, &mut self.tangents, &mut self.adjoints, &mut self.adjoint_tangents);
        for &k in &out.order {
            adj[k] = 0.0;
            adt[k] = 0.0;
            t[k] = match self.nodes[k] {
                Node::Var(i) => f64::from(u8::from(i == j)),
                Node::Const(_) => 0.0,
                Node::Sum(a, c, b) => t[a.0] + c * t[b.0],
                Node::Product(a, b) => t[a.0] * v[b.0] + v[a.0] * t[b.0],
                Node::Scaled(c, a) => c * t[a.0],
                Node::Fun(f, a) => f.at(v[a.0])[1] * t[a.0],
            };
        }
        adj[out.root] = w;
        for &k in out.order.iter().rev() {
            let (a, d) = (adj[k], adt[k]);
            match self.nodes[k] {
                Node::Var(i) => self.column[i] += d,
                Node::Const(_) => {}
                Node::Sum(l, c, r) => {
                    adj[l.0] += a;
                    adt[l.0] += d;
                    adj[r.0] += c * a;
                    adt[r.0] += c * d;
                }
                Node::Product(l, r) => {
                    adj[l.0] += a * v[r.0];
                    adt[l.0] += d * v[r.0] + a * t[r.0];
                    adj[r.0] += a * v[l.0];
                    adt[r.0] += d * v[l.0] + a * t[l.0];
                }
                Node::Scaled(c, l) => {
                    adj[l.0] += c * a;
                    adt[l.0] += c * d;
                }
                Node::Fun(f, l) => {
                    let [_, f1, f2] = f.at(v[l.0]);
                    adj[l.0] += a * f1;
                    adt[l.0] += d * f1 + a * f2 * t[l.0];
                }
            }
        }
    }
}

fn finite<'a>(values: impl IntoIterator<Item = &'a f64>) -> EvalResult {
    if values.into_iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(EvalError::Recoverable)
    }
}

impl Nlp for Program {
    fn n(&self) -> usize {
        self.n
    }
    fn m(&self) -> usize {
        self.rows.len()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn eval(&mut self, x: &[f64], c: &mut [f64]) -> Result<f64, EvalError> {
        self.forward(x);
        for (c, row) in c.iter_mut().zip(&self.rows) {
            *c = self.values[row.root];
        }
        let f = self.values[self.objective.root];
        finite(c.iter().chain([&f]))?;
        Ok(f)
    }
    fn derivatives(&mut self, x: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        self.x.copy_from_slice(x);
        self.forward(x);
        grad.fill(0.0);
        Program::gradient(&self.nodes, &self.values, &mut self.adjoints, &self.objective, grad);
        for row in &self.rows {
            Program::gradient(&self.nodes, &self.values, &mut self.adjoints, row, jac);
        }
        finite(grad.iter().chain(jac.iter()))
    }
    fn hessian(&mut self, _x: &[f64], w: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let x = std::mem::take(&mut self.x);
        self.forward(&x);
        self.x = x;
        hess.fill(0.0);
        for out in 0..=self.rows.len() {
            let (o, weight) = if out == 0 { (&self.objective, w) } else { (&self.rows[out - 1], y[out - 1]) };
            if weight == 0.0 {
                continue;
            }
            for j in o.curved.clone() {
                self.column.fill(0.0);
                self.hessian_column(out, j, weight);
                for (k, &i) in self.hess.range(j).zip(self.hess.rows(j)) {
                    hess[k] += self.column[i];
                }
            }
        }
        finite(hess.iter())
    }
}
