//! What is asked of a solve of the problem: one solve of the discretised problem, and what surrounds it.

use super::solve::Start;
use super::Ocp;
use crate::error::Result;
use crate::nlp::Control;
use crate::settings::{OcpStart, Settings};
use crate::sim::SolveOptions;

/// How the controls of an answer are simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Comparison {
    /// Relative and absolute tolerance of the simulation.
    pub tol: f64,
    /// Every stage by itself too, from the state of the answer?
    pub by_stage: bool,
}

/// A solve on one grid with what surrounds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Request {
    pub options: SolveOptions,
    /// Neighbouring mode sequences that may be tried.
    pub search: usize,
    /// The comparison of the answer with a simulation, where it is asked for.
    pub comparison: Option<Comparison>,
    /// Where a cold solve starts from.
    pub start: OcpStart,
    /// Where constraints cannot be met: find out by how much at best?
    pub explain: bool,
    /// Answers of branch problems stay as they are: whether sequences next to them are better is asked of the best of several only.
    pub plain_branches: bool,
}

impl Request {
    /// As the settings say, on one grid.
    pub fn from_settings(s: &Settings) -> Result<Request> {
        Ok(Request {
            options: SolveOptions::from_settings(s)?,
            search: s.mode_search as usize,
            comparison: (s.accuracy != 0).then_some(Comparison { tol: s.accuracy_tol, by_stage: false }),
            start: s.ocp_start()?,
            explain: s.explain != 0,
            plain_branches: false,
        })
    }

    /// The same for one of several solves: what is found is neither compared with a simulation nor explained.
    pub fn of_a_part(&self) -> Request {
        Request { comparison: None, explain: false, ..*self }
    }

    /// One solve of one discretised problem and nothing else.
    pub fn inside(options: &SolveOptions) -> Request {
        Request {
            options: *options,
            search: 0,
            comparison: None,
            start: OcpStart::Homotopy,
            explain: false,
            plain_branches: false,
        }
    }
}

impl Ocp {
    /// Solves the discretised problem from the guesses and does nothing else: for solves inside solves.
    pub(super) fn solve_inside(&mut self, options: &SolveOptions, control: &mut Control) -> Result<()> {
        let request = Request::inside(options);
        self.run(Start::Cold, &request, control).map(|_| ())
    }
}
