//! What a search for contact modes is asked for.

use super::modes::Sequence;
use crate::mpcc::MpccSettings;

/// How contact modes are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Method {
    /// From descents on simulations and time stepping, and, where descents lead to no solution, also from the simulated guess and FESD with jumps.
    #[default]
    Auto = 0,
    /// From the simulated guess and the sequences next to it.
    Modes = 1,
    /// From FESD with jumps.
    FesdJ = 2,
    /// From time stepping.
    Steps = 3,
    /// From descents on simulations alone.
    Shots = 4,
    /// From time-freezing: finite elements in a numerical time in which nothing jumps.
    Freezing = 5,
}

/// What has led to the controls to start from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lead {
    /// Nothing: they are a guess.
    Guess,
    /// Descents on simulations.
    Descents {
        /// Is their end known as an optimum?
        optimum: bool,
        /// Usual size of the cost: costs have its rounding.
        size: f64,
    },
}

/// What a search is given besides the problem.
#[derive(Debug, Clone)]
pub struct Options {
    /// How modes are found.
    pub method: Method,
    /// Parameters of the solver.
    pub solver: MpccSettings,
    /// Elements of a control stage in FESD with jumps.
    pub n_fe: usize,
    /// Weight of the soft step equilibration.
    pub rho_h: f64,
    /// Multiple of the work until the last gain after which the search ends, and share of the cost that counts as one.
    pub effort: f64,
    pub gain: f64,
    /// Orders of contacts that are tried at least.
    pub least_tried: usize,
    /// Is one solution better than another?
    pub has_costs: bool,
    /// What has led to the controls to start from.
    pub lead: Lead,
    /// Controls to start from `[n_stages · wide.u]`.
    pub controls: Vec<f64>,
    /// Initial state to start from.
    pub x0: Vec<f64>,
    /// Times and states to start from, where they are given.
    pub states: Option<(Vec<f64>, Vec<f64>)>,
    /// A mode sequence to start from.
    pub sequence: Option<Sequence>,
}
