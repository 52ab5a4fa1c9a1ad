//! Expressions of a file: nodes that know only older ones, so that no depth of nesting needs a stack.

use super::operator::{self, Arity, Operator};
use super::source::Source;
use switchback::{Error, Result};

/// Number of a node.
pub type Place = u32;

/// A node of an expression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// A number.
    Number(f64),
    /// A variable of the problem.
    Variable(u32),
    /// An operator and its operands.
    Apply(Operator, Range),
    /// A piecewise-linear term in another node: slopes and breakpoints by turns, a slope first and last.
    Piecewise(Range, Place),
    /// What is not supported; its name is number so many.
    Refused(u32),
}

/// A part of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    first: u32,
    n: u32,
}

/// All expressions of a problem.
#[derive(Debug, Clone, Default)]
pub struct Forest {
    nodes: Vec<Node>,
    operands: Vec<Place>,
    numbers: Vec<f64>,
    refused: Vec<String>,
    /// Nodes of the defined variables, behind the variables of the problem.
    defined: Vec<Option<Place>>,
}

/// An operator whose operands are still to come.
struct Open {
    what: std::result::Result<Operator, u32>,
    missing: usize,
    n: usize,
}

impl Forest {
    /// No expressions; there will be so many defined variables.
    pub fn new(n_defined: usize) -> Forest {
        Forest { defined: vec![None; n_defined], ..Forest::default() }
    }

    /// The nodes, the oldest first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Operands of an operator.
    pub fn operands(&self, r: Range) -> &[Place] {
        &self.operands[r.first as usize..(r.first + r.n) as usize]
    }

    /// Slopes and breakpoints by turns.
    pub fn numbers(&self, r: Range) -> &[f64] {
        &self.numbers[r.first as usize..(r.first + r.n) as usize]
    }

    /// Name of what is not supported.
    pub fn refusal(&self, k: u32) -> &str {
        self.refused.get(k as usize).map_or("", String::as_str)
    }

    fn push(&mut self, node: Node) -> Result<Place> {
        let place = Place::try_from(self.nodes.len()).ok().filter(|p| *p < Place::MAX);
        let place = place.ok_or_else(|| Error::Range(".nl file: more than 4 billion nodes in expressions".into()))?;
        self.nodes.push(node);
        Ok(place)
    }

    fn range(all: usize, n: usize) -> Result<Range> {
        let ends = (u32::try_from(all), u32::try_from(n));
        let (Ok(end), Ok(n)) = ends else { return Err(Error::Range(".nl file: expressions are too large".into())) };
        Ok(Range { first: end - n, n })
    }

    /// Adds an operator.
    pub fn apply(&mut self, op: Operator, operands: &[Place]) -> Result<Place> {
        self.operands.extend_from_slice(operands);
        let range = Forest::range(self.operands.len(), operands.len())?;
        self.push(Node::Apply(op, range))
    }

    fn refuse(&mut self, name: String) -> u32 {
        self.refused.push(name);
        (self.refused.len() - 1) as u32
    }

    /// Gives a defined variable, by its number among these, its expression: a nonlinear part and linear terms.
    pub fn define(&mut self, k: usize, nonlinear: Place, linear: &[(usize, f64)]) -> Result<()> {
        let mut root = nonlinear;
        for (j, a) in linear {
            let v = self.push(Node::Variable(*j as u32))?;
            let a = self.push(Node::Number(*a))?;
            let term = self.apply(Operator::Multiply, &[a, v])?;
            root = self.apply(Operator::Add, &[root, term])?;
        }
        self.defined[k] = Some(root);
        Ok(())
    }

    /// Reads an expression; the problem has `n_vars` variables.
    pub fn read(&mut self, source: &mut Source, n_vars: usize) -> Result<Place> {
        let mut open: Vec<Open> = Vec::new();
        let mut done: Vec<Place> = Vec::new();
        loop {
            let mut place = match self.item(source, n_vars)? {
                Item::Value(place) => place,
                Item::Operator(what, n) => {
                    open.push(Open { what, missing: n, n });
                    continue;
                }
            };
            // A value may be the last operand of several operators.
            loop {
                let Some(top) = open.last_mut() else { return Ok(place) };
                done.push(place);
                top.missing -= 1;
                if top.missing > 0 {
                    break;
                }
                let operands = done.split_off(done.len() - top.n);
                place = match top.what {
                    Ok(op) => self.apply(op, &operands)?,
                    Err(name) => self.push(Node::Refused(name))?,
                };
                open.pop();
            }
        }
    }

    /// Reads what one letter begins.
    fn item(&mut self, source: &mut Source, n_vars: usize) -> Result<Item> {
        let what = "an expression";
        match source.letter(what)? {
            b'n' => self.number(source.finite("a number")?),
            b's' => {
                let value = source.short("an integer")?;
                self.number(value.into())
            }
            b'l' => {
                let value = source.int("an integer")?;
                self.number(value.into())
            }
            b'v' => Ok(Item::Value(self.variable(source, n_vars)?)),
            b'h' => {
                source.skip_string()?;
                let name = self.refuse("a text".into());
                Ok(Item::Value(self.push(Node::Refused(name))?))
            }
            b'f' => {
                let k = source.count("the number of a function")?;
                let n = source.count("the number of arguments of a function")?;
                let name = self.refuse(format!("imported function {k}"));
                match n {
                    0 => Ok(Item::Value(self.push(Node::Refused(name))?)),
                    n => Ok(Item::Operator(Err(name), n)),
                }
            }
            b'o' => {
                let code = source.int("the number of an operator")?;
                if code == 64 {
                    return Ok(Item::Value(self.piecewise(source, n_vars)?));
                }
                let Some((name, arity, op)) = operator::of_number(code) else {
                    return Err(source.fault(format_args!("there is no operator {code}")));
                };
                let n = match arity {
                    Arity::Fixed(n) => n,
                    Arity::List => source.count("a number of operands")?,
                };
                if n == 0 {
                    return Err(source.fault(format_args!("expected operands of {name}, found none")));
                }
                let what = op.ok_or_else(|| self.refuse(format!("the operator {name}")));
                Ok(Item::Operator(what, n))
            }
            other => Err(source.strange("an expression: o, n, v, s, l, f or h", other)),
        }
    }

    fn number(&mut self, value: f64) -> Result<Item> {
        Ok(Item::Value(self.push(Node::Number(value))?))
    }

    /// Reads the number of a variable, or of a defined variable.
    fn variable(&mut self, source: &mut Source, n_vars: usize) -> Result<Place> {
        let j = source.index("the number of a variable", n_vars + self.defined.len())?;
        if j < n_vars {
            return self.push(Node::Variable(j as u32));
        }
        self.defined[j - n_vars]
            .ok_or_else(|| source.fault(format_args!("the defined variable {j} is used before its segment V")))
    }

    fn piecewise(&mut self, source: &mut Source, n_vars: usize) -> Result<Place> {
        let n = source.count("a number of slopes")?;
        if n < 2 {
            return Err(source.fault(format_args!("a piecewise-linear term has {n} slopes: it must have 2 at least")));
        }
        let mut last = f64::NEG_INFINITY;
        for k in 0..2 * n - 1 {
            let what = if k % 2 == 0 { "a slope" } else { "a breakpoint" };
            let value = match source.letter(what)? {
                b'n' => source.finite(what)?,
                b's' => source.short(what)?.into(),
                b'l' => source.int(what)?.into(),
                other => return Err(source.strange(what, other)),
            };
            if k % 2 == 1 && std::mem::replace(&mut last, value) >= value {
                return Err(source.fault("breakpoints of a piecewise-linear term must increase"));
            }
            self.numbers.push(value);
        }
        let range = Forest::range(self.numbers.len(), 2 * n - 1)?;
        match source.letter("the variable of a piecewise-linear term")? {
            b'v' => {
                let at = self.variable(source, n_vars)?;
                self.push(Node::Piecewise(range, at))
            }
            other => Err(source.strange("the variable of a piecewise-linear term", other)),
        }
    }

    /// Values of all nodes at a point, as AMPL computes them; NaN where there is none.
    pub fn values(&self, x: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = Vec::with_capacity(self.nodes.len());
        let mut args = Vec::new();
        for node in &self.nodes {
            let value = match *node {
                Node::Number(v) => v,
                Node::Variable(j) => x[j as usize],
                Node::Apply(op, r) => {
                    args.clear();
                    args.extend(self.operands(r).iter().map(|p| values[*p as usize]));
                    op.value(&args)
                }
                Node::Piecewise(r, at) => piecewise(self.numbers(r), values[at as usize]),
                Node::Refused(_) => f64::NAN,
            };
            values.push(value);
        }
        values
    }
}

enum Item {
    Value(Place),
    /// An operator, or the name of one that is refused, and the number of its operands.
    Operator(std::result::Result<Operator, u32>, usize),
}

/// The piecewise-linear function that is zero at zero, with these slopes and breakpoints by turns.
pub fn piecewise(numbers: &[f64], at: f64) -> f64 {
    kinks(numbers).fold(numbers[0] * at, |sum, (jump, b)| sum + jump * ((at - b).max(0.0) - (-b).max(0.0)))
}

/// Jumps of the slope, and where they are.
pub fn kinks(numbers: &[f64]) -> impl Iterator<Item = (f64, f64)> + '_ {
    numbers.windows(3).step_by(2).map(|w| (w[2] - w[0], w[1]))
}
