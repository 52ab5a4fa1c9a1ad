//! What a search may spend, counted in work: the same on every machine, for every language a model is written in, and on any number of threads.

use crate::nlp::{allowance, Statistics};
use crate::stop;

/// Work that was done. The unit is a variable of a program in an iteration, or a state in a step of a simulation, which take about as long.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    most: f64,
    spent: f64,
    /// What all solves took.
    pub stats: Statistics,
}

impl Budget {
    /// At most so much work; infinite without a limit.
    pub fn new(most: f64) -> Budget {
        Budget { most, spent: 0.0, stats: Statistics::default() }
    }

    /// Work so far.
    pub fn spent(&self) -> f64 {
        self.spent
    }

    /// Counts the solve of a program with so many variables.
    pub fn solved(&mut self, variables: usize, stats: &Statistics) {
        self.stats.add(stats);
        self.spent += stats.iterations.max(1) as f64 * variables as f64;
    }

    /// Counts steps of simulations with so many states.
    pub fn simulated(&mut self, states: usize, steps: usize) {
        self.spent += (steps * states) as f64;
    }

    /// Is nothing left, by this or by what the caller allows?
    pub fn is_over(&self) -> bool {
        self.spent >= self.most || allowance::is_over() || stop::requested().is_some()
    }
}
