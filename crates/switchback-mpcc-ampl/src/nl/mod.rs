//! Problems as AMPL writes them: `.nl` files in text or binary form (D. M. Gay, *Writing .nl files*, 2005).
//!
//! What is read may be anything. Nothing here panics, recurses, or takes more memory than a multiple of the size of the file.
//! Errors name the line of a text, or the byte of a binary file, and what was expected there.

mod forest;
mod header;
mod operator;
mod segments;
mod source;

pub use forest::{kinks, Forest, Node, Place, Range};
pub use header::Header;
pub use operator::Operator;
pub use segments::read;

/// A nonlinear part and linear terms.
#[derive(Debug, Clone, Default)]
pub struct Body {
    /// The nonlinear part, which may be constant.
    pub nonlinear: Option<Place>,
    /// Variables and their factors.
    pub linear: Vec<(usize, f64)>,
}

impl Body {
    /// Value at `x`, where the nodes have these values.
    pub fn value(&self, x: &[f64], nodes: &[f64]) -> f64 {
        let start = self.nonlinear.map_or(0.0, |p| nodes[p as usize]);
        self.linear.iter().fold(start, |sum, (j, a)| sum + a * x[*j])
    }
}

/// An objective.
#[derive(Debug, Clone, Default)]
pub struct Objective {
    /// Largest instead of smallest value.
    pub maximise: bool,
    /// What it is.
    pub body: Body,
}

/// What holds of a constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Row {
    /// Between two bounds, which may be infinite.
    Within(f64, f64),
    /// Complementary to a variable: not negative where the variable is at its lower bound, not positive where it is at its upper
    /// bound, zero between.
    Complements {
        /// The variable.
        variable: usize,
        /// Does its lower bound take part?
        lower: bool,
        /// Does its upper bound?
        upper: bool,
    },
}

/// A problem as it is in the file.
#[derive(Debug, Clone, Default)]
pub struct Problem {
    /// What the header says.
    pub header: Header,
    /// All expressions.
    pub forest: Forest,
    /// Bodies of the constraints.
    pub constraints: Vec<Body>,
    /// What holds of them.
    pub rows: Vec<Row>,
    /// The objectives.
    pub objectives: Vec<Objective>,
    /// Bounds of the variables.
    pub bounds: Vec<(f64, f64)>,
    /// Where to start; zero where nothing is said.
    pub start: Vec<f64>,
    /// Names of imported functions.
    pub functions: Vec<String>,
}
