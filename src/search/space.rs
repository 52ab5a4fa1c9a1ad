//! What is searched.

use super::budget::Budget;
use super::rank::Rank;
use crate::error::Result;
use crate::nlp::Control;

/// Where candidates come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Source {
    /// An answer to a problem nearby, or what the user gave: a sequence, states, controls.
    Guess,
    /// Simulations of controls that need no search: those of the guess, extremes of the bounds.
    Simulation,
    /// The solution of a problem with fewer conditions: choices anywhere between their values, contacts whose forces act at a distance.
    Relaxation,
    /// Time stepping, all steps of it in one program.
    Stepping,
    /// Problems with smooth surfaces in the place of switches, wide ones first.
    Smoothing,
    /// Simulations of random controls, aimed at the constraints.
    Samples,
    /// Sequences next to what a source has found; no source of its own.
    Neighbours,
    /// Candidates that came closest where nothing has a solution, with more patience; no source of its own.
    Retries,
}

/// A sequence and the motion that its program begins with.
#[derive(Debug, Clone)]
pub(crate) struct Candidate<S, M> {
    pub sequence: S,
    pub motion: M,
    /// The cost that the source expects, minus infinity where it expects none: what promises no gain is not solved. Infinity is for what leads nowhere: it
    /// is not solved either, and says nothing of others.
    pub promise: f64,
}

impl<S, M> Candidate<S, M> {
    /// One of which the source expects no cost.
    pub fn new(sequence: S, motion: M) -> Candidate<S, M> {
        Candidate { sequence, motion, promise: f64::NEG_INFINITY }
    }
}

/// A sequence next to that of a solution.
#[derive(Debug, Clone)]
pub(crate) struct Neighbour<S> {
    pub sequence: S,
    /// The change of cost that first order promises for a small step towards it; 0 where multipliers say nothing.
    pub promise: f64,
    /// Which change it is. Kinds that have led to better solutions come first.
    pub kind: usize,
    /// Has the motion of the solution reached what lies between it and this sequence? A solution whose local neighbours are no better is a local
    /// optimum.
    pub is_local: bool,
}

/// How long the program of a sequence is worth its iterations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Cost of the best solution, infinite where there is none: what stays above is given up.
    pub cost: f64,
    /// Multiple of the usual patience with a violation that does not fall.
    pub patience: usize,
}

/// What is searched: sequences, their programs, what lies next to them.
pub(crate) trait Space {
    /// A sequence of modes without lengths. It is what is remembered.
    type Sequence: Clone + Ord;
    /// States, controls, lengths: where the program of a sequence begins.
    type Motion: Clone;
    /// What the program of a sequence ended at.
    type Solution;

    /// The next candidates of a source; none where it has no more. `best` is the best solution so far.
    ///
    /// # Errors
    /// Those of simulations and of building programs, which end the search.
    fn propose(
        &mut self,
        source: Source,
        best: Option<&Self::Solution>,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<Candidate<Self::Sequence, Self::Motion>>>;

    /// Work that the first step of a source is expected to take; `None` where it is what all steps take on average.
    fn expected(&self, _source: Source) -> Option<f64> {
        None
    }

    /// Solves the program of a sequence, or gives it up at the limits: what it ended at, a solution or not, and what sequences ended at that it led to on
    /// the way, each with its sequence. Nothing where the sequence cannot be.
    ///
    /// # Errors
    /// Those of building it.
    fn solve(
        &mut self,
        candidate: &Candidate<Self::Sequence, Self::Motion>,
        limits: Limits,
        budget: &mut Budget,
        control: &mut Control,
    ) -> Result<Vec<(Self::Sequence, Self::Solution)>>;

    /// What a solution is ordered by.
    fn rank(&self, s: &Self::Solution) -> Rank;

    /// Compares a solution that would be the best with a simulation of its controls, which may change its rank.
    ///
    /// # Errors
    /// Those of the simulation.
    fn verify(&mut self, _s: &mut Self::Solution, _budget: &mut Budget, _control: &mut Control) -> Result<()> {
        Ok(())
    }

    /// Sequences next to that of a solution, and the motion their programs begin with.
    fn neighbours(&self, s: &Self::Solution) -> (Vec<Neighbour<Self::Sequence>>, Self::Motion);

    /// The motion that the program of a sequence next to a solution begins with, where its own motion does not do.
    fn moved(&self, _from: &Self::Solution, motion: &Self::Motion, _to: &Self::Sequence) -> Self::Motion {
        motion.clone()
    }
}
