//! Who knows other active sets.

use super::problem::Side;

/// Purposes of an active set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProposalKind {
    /// The set that was identified has no solution: the `k`-th other one.
    Repair(usize),
    /// Nor has any of those: the `k`-th neighbour of the sides given.
    Rescue(usize),
    /// A set is solved: the `k`-th neighbour that may be better.
    Improve(usize),
    /// A neighbour has no solution, but the point given is better than the best: the set without what vanishes there.
    Collapse,
}

/// Proposes active sets: which sets are next to one another only the problem behind the program knows.
pub trait ActiveSetProposer {
    /// Changes the present `sides` to a set of the `kind` wanted, given the `point` reached, in the user's units. False where it knows
    /// no more; the sides do not count then.
    fn propose(&mut self, kind: ProposalKind, point: &[f64], sides: &mut [Side]) -> bool;
}

/// Knows no set but the one that is identified.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoProposals;

impl ActiveSetProposer for NoProposals {
    fn propose(&mut self, _: ProposalKind, _: &[f64], _: &mut [Side]) -> bool {
        false
    }
}
