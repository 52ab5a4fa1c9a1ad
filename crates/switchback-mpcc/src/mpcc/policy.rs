//! How programs of the two kinds are treated: those of users, and discretisations, which know their start.

use super::problem::Mpcc;

/// What a solve does with programs of a kind.
#[derive(Debug, PartialEq)]
pub(super) struct Policy {
    /// Scales so that nothing depends on units. Otherwise what is steep is scaled down.
    pub by_units: bool,
    /// Starts pairs on the central path, draws members back that are on a ray, and asks the curvature of exact points: of
    /// discretisations the start, rays and curvature are the caller's.
    pub free_pairs: bool,
    /// Tries other strategies and asks branches for proofs. A caller that discretises has its own, in other discretisations.
    pub goes_on: bool,
    /// Barrier parameter at the end of the first relaxed problem. It decides which local optimum is found: the better it is solved
    /// the better that is, and a start that knows nothing leaves it more to do.
    pub plateau: f64,
    /// Relaxations at which an active set that leaves no doubt is tried, where `early` allows; those of the rungs from a first
    /// relaxation of one.
    pub stops: [f64; 4],
    /// Tries active sets there. Where it does not the first relaxation is left more exactly, and all is tried at the first polish.
    pub early: bool,
    /// Descents of the linearised problem that are followed at most.
    pub descents: usize,
    /// Violation up to which the rows of a branch problem count as consistent: data from outside are rarely better.
    pub consistency: f64,
    /// Belongs what a branch fixes beside the pairs to the statement?
    pub branch_fixes: bool,
}

/// Programs of users.
static GIVEN: Policy = Policy {
    by_units: true,
    free_pairs: true,
    goes_on: true,
    plateau: 1e-4,
    stops: [0.1, 1e-2, 1e-3, 3.2e-5],
    early: true,
    descents: 10,
    consistency: 1e-8,
    branch_fixes: false,
};

/// Discretised problems.
static DISCRETISED: Policy = Policy {
    by_units: false,
    free_pairs: false,
    goes_on: false,
    plateau: 1e-3,
    stops: [1e-3; 4],
    early: false,
    descents: 0,
    consistency: 0.0,
    branch_fixes: true,
};

impl Policy {
    /// That of a program.
    pub fn of(p: &dyn Mpcc) -> &'static Policy {
        if p.is_discretised() {
            &DISCRETISED
        } else {
            &GIVEN
        }
    }
}
