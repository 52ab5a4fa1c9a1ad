//! What this layer takes of the options: written by `make header` from options.toml of the settings; do not edit.

use crate::nlp::IpmSettings;
use crate::settings::{Homotopy, LinearSolver, Ordering, Portfolio, Relaxation, Settings};

/// Parameters of the path and the polish.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MpccSettings {
    /// Convergence tolerance of the interior point at sigma = 0, before polishing.
    pub tol: f64,
    /// Limit on the interior point iterations of one solve, over all homotopy steps.
    pub max_iter: usize,
    /// Initial barrier parameter.
    pub mu_init: f64,
    /// Initial relaxation of the complementarity.
    pub sigma_init: f64,
    /// Smallest relaxation of the complementarity.
    pub sigma_min: f64,
    /// Linear reduction of the relaxation: sigma becomes at most sigma_factor sigma.
    pub sigma_factor: f64,
    /// Superlinear reduction of the relaxation: sigma becomes at most sigma^sigma_exponent.
    pub sigma_exponent: f64,
    /// Barrier parameter of a relaxed problem as a multiple of its relaxation.
    pub mu_over_sigma: f64,
    /// Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses.
    pub plateau_mu: f64,
    /// Constraint violation at which the first problem, at sigma_init, counts as solved.
    pub plateau_viol: f64,
    /// Identify the active set and solve the smooth problem that remains.
    pub polish: bool,
    /// Tolerance of the solution after the option polish.
    pub polish_tol: f64,
    /// Factorisation of the Newton matrices. Fixed when the problem is built.
    pub linear_solver: LinearSolver,
    /// Order of elimination in the Newton matrices. Fixed when the problem is built.
    pub ordering: Ordering,
    /// Scale objective and rows by their gradients at the starting point.
    pub scaling: bool,
    /// Start the pairs of a program on the central path instead of at the starting point.
    pub centre_pairs: bool,
    /// Limit the multipliers of products pair by pair before the whole Hessian is perturbed.
    pub convexify_pairs: bool,
    /// Polish with a clear active set before the relaxation is small.
    pub early_polish: bool,
    /// Solve the square system of the active set by Newton's method.
    pub square_newton: bool,
    /// Certify exact points, and follow descent directions from points that are not B-stationary.
    pub certify: bool,
    /// Number of homotopy steps that may be repeated from the last relaxation with a smaller reduction, when steps at the next one stay short.
    pub sigma_retries: usize,
    /// Limit on the second-order corrections of an interior-point step.
    pub max_soc: usize,
    /// Restore feasibility after several tiny interior-point steps in a row.
    pub restore_tiny: bool,
    /// Relaxation or penalty in the place of the complementarity constraints until the active set is identified. Fixed when the problem is built.
    pub relaxation: Relaxation,
    /// Changes of relaxation or penalty and barrier parameter: together, or one problem after the other.
    pub homotopy: Homotopy,
    /// First penalty parameter of the penalties among the relaxations; sigma is its inverse.
    pub penalty_init: f64,
    /// Strategies for a program with complementarity constraints within its iterations.
    pub portfolio: Portfolio,
    /// Work of a branch and bound over the branches of a program with linear rows and a convex quadratic objective at most, in entries of tableaus; 0: none. Where it is enough the solution is global, with proof, or the program is shown to be infeasible. Other programs get a tenth of it for every model of them that is searched for better branches.
    pub branch_work: f64,
}

impl Default for MpccSettings {
    fn default() -> MpccSettings {
        MpccSettings::from(&Settings::default())
    }
}

impl From<&Settings> for MpccSettings {
    /// Numbers that are no value of an enumeration count as its default; [`Settings::validate`] names them.
    fn from(s: &Settings) -> MpccSettings {
        MpccSettings {
            tol: s.tol,
            max_iter: usize::try_from(s.max_iter).unwrap_or(0),
            mu_init: s.mu_init,
            sigma_init: s.sigma_init,
            sigma_min: s.sigma_min,
            sigma_factor: s.sigma_factor,
            sigma_exponent: s.sigma_exponent,
            mu_over_sigma: s.mu_over_sigma,
            plateau_mu: s.plateau_mu,
            plateau_viol: s.plateau_viol,
            polish: s.polish(),
            polish_tol: s.polish_tol,
            linear_solver: s.linear_solver().unwrap_or(LinearSolver::Auto),
            ordering: s.ordering().unwrap_or(Ordering::Amd),
            scaling: s.scaling(),
            centre_pairs: s.centre_pairs(),
            convexify_pairs: s.convexify_pairs(),
            early_polish: s.early_polish(),
            square_newton: s.square_newton(),
            certify: s.certify(),
            sigma_retries: usize::try_from(s.sigma_retries).unwrap_or(0),
            max_soc: usize::try_from(s.max_soc).unwrap_or(0),
            restore_tiny: s.restore_tiny(),
            relaxation: s.relaxation().unwrap_or(Relaxation::Scholtes),
            homotopy: s.homotopy().unwrap_or(Homotopy::Coupled),
            penalty_init: s.penalty_init,
            portfolio: s.portfolio().unwrap_or(Portfolio::Rescue),
            branch_work: s.branch_work,
        }
    }
}

impl MpccSettings {
    /// [`IpmSettings`] with the options that are in both; the others have their defaults.
    pub fn ipm(&self) -> IpmSettings {
        IpmSettings {
            max_iter: self.max_iter,
            linear_solver: self.linear_solver,
            ordering: self.ordering,
            convexify_pairs: self.convexify_pairs,
            max_soc: self.max_soc,
            restore_tiny: self.restore_tiny,
            ..IpmSettings::default()
        }
    }

    /// Writes the options that are in both and may change at any time.
    pub fn update_ipm(&self, ipm: &mut IpmSettings) {
        ipm.max_iter = self.max_iter;
        ipm.convexify_pairs = self.convexify_pairs;
        ipm.max_soc = self.max_soc;
        ipm.restore_tiny = self.restore_tiny;
    }
}
