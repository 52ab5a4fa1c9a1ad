//! What this layer takes of the options: written by `make header` from options.toml of the settings; do not edit.

use crate::settings::{LinearSolver, Ordering, Settings};

/// Constants of the interior-point method; the parameters of the homotopy belong to the [`Continuation`](super::Continuation).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IpmSettings {
    /// Limit on the interior point iterations of one solve, over all homotopy steps.
    pub max_iter: usize,
    /// Factorisation of the Newton matrices. Fixed when the problem is built.
    pub linear_solver: LinearSolver,
    /// Order of elimination in the Newton matrices. Fixed when the problem is built.
    pub ordering: Ordering,
    /// Limit the multipliers of products pair by pair before the whole Hessian is perturbed.
    pub convexify_pairs: bool,
    /// Limit on the second-order corrections of an interior-point step.
    pub max_soc: usize,
    /// Restore feasibility after several tiny interior-point steps in a row.
    pub restore_tiny: bool,
    /// Relative distance a cold start keeps from the bounds (`κ_1 = κ_2`).
    pub bound_push: f64,
    /// Multipliers of the first least-squares estimate above this and above `y_init_share` are dropped.
    pub y_init_max: f64,
    /// Multipliers of the first least-squares estimate above this share of the largest entry of the gradient are dropped, too.
    pub y_init_share: f64,
    /// Allow a restoration phase.
    pub restoration: bool,
    /// Growth of the violation over that at the start of a level, up to which trial points are accepted.
    pub theta_room: f64,
    /// Solve every direction for the rows, however small their violation is compared with the gradient.
    pub exact_rows: bool,
    /// Number of the first iteration in the log.
    pub first_iteration: usize,
}

impl Default for IpmSettings {
    fn default() -> IpmSettings {
        IpmSettings::from(&Settings::default())
    }
}

impl From<&Settings> for IpmSettings {
    /// Numbers that are no value of an enumeration count as its default; [`Settings::validate`] names them.
    fn from(s: &Settings) -> IpmSettings {
        IpmSettings {
            max_iter: usize::try_from(s.max_iter).unwrap_or(0),
            linear_solver: s.linear_solver().unwrap_or(LinearSolver::Auto),
            ordering: s.ordering().unwrap_or(Ordering::Amd),
            convexify_pairs: s.convexify_pairs(),
            max_soc: usize::try_from(s.max_soc).unwrap_or(0),
            restore_tiny: s.restore_tiny(),
            bound_push: 1e-2,
            y_init_max: 1e3,
            y_init_share: 0.0,
            restoration: true,
            theta_room: 1e4,
            exact_rows: false,
            first_iteration: 0,
        }
    }
}
