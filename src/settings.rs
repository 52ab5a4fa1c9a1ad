//! Settings of discretisation and solver: one sized struct, one table that describes it.
//!
//! [`OPTIONS`] is the only source of names, defaults, ranges and descriptions. The struct is the fast
//! door (C programs fill it directly), the table is the other one: set and get by name, with
//! introspection for bindings and a hint when a name is misspelt. Tests keep both the same.
//!
//! Leaf module: knows [`crate::error`] only. It judges single values and simple pairs of values; what a
//! combination means for a problem is checked where the problem is built.

use crate::error::{Error, Result};
use std::fmt::Write as _;
use std::mem::offset_of;

/// Runge-Kutta family (rk_family).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RkFamily {
    /// Radau IIA: stiffly accurate, order 2 n_s - 1.
    RadauIia = 0,
    /// Gauss-Legendre: order 2 n_s, no stage at the end of the element.
    GaussLegendre = 1,
    /// Explicit methods, for modes that are not stiff.
    Explicit = 2,
    /// Radau IA: order 2 n_s - 1, a stage near the start instead of the end.
    RadauIa = 3,
    /// Lobatto IIIA: order 2 n_s - 2, stages at both ends; not for sliding modes.
    LobattoIiia = 4,
    /// Lobatto IIIB: order 2 n_s - 2; not for sliding modes.
    LobattoIiib = 5,
    /// Lobatto IIIC: order 2 n_s - 2, stiffly accurate.
    LobattoIiic = 6,
}

/// Complementarity form of what switches (dcs_form).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DcsForm {
    /// Subsystem by subsystem: Stewart's, unless the Heaviside form has fewer pairs and no more variables.
    Auto = 0,
    /// One pair for each region.
    Stewart = 1,
    /// Two pairs for each switching function; subsystems given by indicators stay in Stewart's form.
    Heaviside = 2,
}

/// Treatment of switches by the discretisation (discretisation).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discretisation {
    /// Finite elements with switch detection: element boundaries move onto the switches.
    Fesd = 0,
    /// Fixed step sizes; switches lie inside the elements and the order drops to one.
    Standard = 1,
}

/// Unknowns at the stage points (stage_form).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageForm {
    /// The library chooses.
    Auto = 0,
    /// States at the stage points (integral form).
    Values = 1,
    /// State derivatives at the stage points (differential form).
    Derivatives = 2,
}

/// Granularity of the cross complementarity (cross).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cross {
    /// One pair for each finite element and component, between two sums over the stage points.
    Element = 0,
    /// One pair for each stage point and component, against the sum over the element.
    Stage = 1,
    /// One pair for each pair of stage points and component.
    Full = 2,
    /// One pair for each point and component, between the multiplier there and the sum of the weights over the element.
    Point = 3,
}

/// Step equilibration during the homotopy (step_equilibration).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepEquilibration {
    /// No term: step sizes without a switch between them are not determined.
    None = 0,
    /// Penalty on the deviation from the mean step size.
    Mean = 1,
    /// Penalty on the difference of neighbouring step sizes.
    Difference = 2,
    /// Difference of neighbouring step sizes weighted by the switch indicator eta.
    EtaProduct = 3,
    /// The same with the square of the indicator.
    EtaSquared = 4,
    /// Products of indicator and difference equal to zero.
    EtaEquation = 5,
    /// As eta_product with the hyperbolic tangent of the indicator: its size counts only where it is small.
    EtaSaturated = 6,
}

/// Polishing after the homotopy (polish).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polish {
    /// The interior point solution is final.
    Off = 0,
    /// Fix the active set and solve the smooth problem to polish_tol.
    On = 1,
}

/// Initial guess of the discretised problem (initial_guess).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialGuess {
    /// The initial value at every node.
    Constant = 0,
    /// A simulation with the guessed controls.
    Simulation = 1,
    /// A simulation of the system smoothed as at the start of the homotopy, with weights and multipliers that fit.
    Smoothed = 2,
    /// The solution of the problem with fixed steps, early in its homotopy.
    TimeStepping = 3,
}

/// Where optimal control problems start from (ocp_start).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OcpStart {
    /// Smoothed problems lead to mode sequences, several of which are solved; the homotopy from the guess is followed too, as a
    /// second opinion. The cheapest answer is kept.
    Portfolio = 0,
    /// The homotopy from the guess alone.
    Homotopy = 1,
    /// Smoothed problems alone; the homotopy only where they lead to no answer.
    Smoothing = 2,
}

/// Which strategies solve a program with complementarity constraints (portfolio).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Portfolio {
    /// The path that the other options describe alone.
    Off = 0,
    /// Where that path ends without a solution the other strategies follow, until one has a solution.
    Rescue = 1,
    /// All strategies; the best solution is kept.
    All = 2,
}

/// Factorisation of the Newton matrices (linear_solver).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolver {
    /// By the fill of the factors: columns where they are sparse, dense blocks where they are not.
    Auto = 0,
    /// SuiteSparse LDL, column by column.
    Suitesparse = 1,
    /// faer, with dense blocks of columns; only in a library built with it.
    Faer = 2,
}

/// Order of elimination in the Newton matrices (ordering).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ordering {
    /// Approximate minimum degree.
    Amd = 0,
    /// Variables as they are numbered (for a horizon: along time), every row behind its last variable.
    Natural = 1,
}

/// An ingredient of a method that can be left out.
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// Without it.
    Off = 0,
    /// With it.
    On = 1,
}

/// What stands for the complementarity constraints until the active set is identified (relaxation).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relaxation {
    /// Products at most sigma.
    Scholtes = 0,
    /// Products equal to sigma.
    ScholtesEq = 1,
    /// Sums of products at most sigma: one row per group, or one in all where pairs form no groups.
    ScholtesLumped = 2,
    /// Products at most sigma, and products of the members shifted by sqrt(sigma) at least sigma.
    LinFukushima = 3,
    /// Members at least -sqrt(sigma), products of the members less sqrt(sigma) not positive.
    Kadrani = 4,
    /// The corner of the feasible set rounded by a sine.
    SteffensenUlbrich = 5,
    /// The corner of the feasible set rounded by a polynomial.
    SteffensenUlbrichPoly = 6,
    /// One of the members at most sqrt(sigma).
    KanzowSchwartz = 7,
    /// Smoothed function of Fischer and Burmeister equal to zero.
    FischerBurmeister = 8,
    /// Smoothed minimum of the members equal to zero.
    NaturalResidual = 9,
    /// Smoothed function of Chen, Chen and Kanzow equal to zero.
    ChenChenKanzow = 10,
    /// Bounds and products relaxed pair by pair, tightened by the signs of the multipliers.
    TwoSided = 11,
    /// Products at most the barrier parameter.
    RaghunathanBiegler = 12,
    /// Sum of the products in the objective.
    L1Penalty = 13,
    /// Largest product in the objective.
    LinfPenalty = 14,
    /// Products at most an elastic variable each, whose sum is in the objective.
    L1Elastic = 15,
    /// Products in the objective, ordinary rows relaxed by one elastic variable.
    Elastic = 16,
    /// Products at most zero.
    Direct = 17,
}

/// How relaxation or penalty and barrier parameter change together (homotopy).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Homotopy {
    /// Together, every problem solved loosely.
    Coupled = 0,
    /// Every problem solved to the tolerance, from a larger barrier parameter again.
    Outer = 1,
}

/// Integration method of the modes in event-driven simulation (integration).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integration {
    /// An explicit pair chosen by the tolerance; Radau IIA in modes that turn out to be stiff.
    Auto = 0,
    /// Dormand and Prince 5(4).
    Dp5 = 1,
    /// Dormand and Prince 8(5,3).
    Dop853 = 2,
    /// Radau IIA of order 5.
    Radau5 = 3,
}

/// What an event-driven simulation does where switches accumulate (zeno).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZenoPolicy {
    /// Go on in the sliding mode on the surfaces the switches accumulate at, where there is one; else stop.
    Continue = 0,
    /// Stop.
    Stop = 1,
    /// Go through it by steps of a method that needs no switches.
    TimeStepping = 2,
}

/// What an event-driven simulation does where the continuation is not unique (ambiguity).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AmbiguityPolicy {
    /// The present active set if it may continue, else the fewest active cells, else the lowest indices.
    First = 0,
    /// Stop.
    Stop = 1,
    /// The one whose active modes come first in the list of preferred modes; among equals as first.
    Prefer = 2,
}

/// Verbosity of the log sink (log_level); each level contains the ones before it.
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogLevel {
    /// Nothing.
    Silent = 0,
    /// Failures.
    Error = 1,
    /// Results that deserve a second look.
    Warning = 2,
    /// One summary per solve.
    Info = 3,
    /// One line per iteration.
    Debug = 4,
    /// Inner steps: line search, factorisations, active-set changes.
    Trace = 5,
}

/// Writes the value names of an enumeration once, for conversion and for the option table.
macro_rules! value_names {
    ($type:ident { $($variant:ident = $name:literal),+ $(,)? }) => {
        impl $type {
            /// Value names, by value.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// Value of this number; `None` outside the enumeration.
            pub fn from_i64(value: i64) -> Option<Self> {
                [$(Self::$variant),+].into_iter().find(|v| *v as i64 == value)
            }

            /// Name of the value.
            pub fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }
        }
    };
}
value_names!(RkFamily {
    RadauIia = "radau_iia",
    GaussLegendre = "gauss_legendre",
    Explicit = "explicit",
    RadauIa = "radau_ia",
    LobattoIiia = "lobatto_iiia",
    LobattoIiib = "lobatto_iiib",
    LobattoIiic = "lobatto_iiic",
});
value_names!(DcsForm { Auto = "auto", Stewart = "stewart", Heaviside = "heaviside" });
value_names!(Discretisation { Fesd = "fesd", Standard = "standard" });
value_names!(StageForm { Auto = "auto", Values = "values", Derivatives = "derivatives" });
value_names!(Cross { Element = "element", Stage = "stage", Full = "full", Point = "point" });
value_names!(StepEquilibration {
    None = "none",
    Mean = "mean",
    Difference = "difference",
    EtaProduct = "eta_product",
    EtaSquared = "eta_squared",
    EtaEquation = "eta_equation",
    EtaSaturated = "eta_saturated",
});
value_names!(Polish { Off = "off", On = "on" });
value_names!(Switch { Off = "off", On = "on" });
value_names!(InitialGuess {
    Constant = "constant",
    Simulation = "simulation",
    Smoothed = "smoothed",
    TimeStepping = "time_stepping",
});
value_names!(Portfolio { Off = "off", Rescue = "rescue", All = "all" });
value_names!(OcpStart { Portfolio = "portfolio", Homotopy = "homotopy", Smoothing = "smoothing" });
value_names!(LinearSolver { Auto = "auto", Suitesparse = "suitesparse", Faer = "faer" });
value_names!(Ordering { Amd = "amd", Natural = "natural" });
value_names!(Relaxation {
    Scholtes = "scholtes",
    ScholtesEq = "scholtes_eq",
    ScholtesLumped = "scholtes_lumped",
    LinFukushima = "lin_fukushima",
    Kadrani = "kadrani",
    SteffensenUlbrich = "steffensen_ulbrich",
    SteffensenUlbrichPoly = "steffensen_ulbrich_poly",
    KanzowSchwartz = "kanzow_schwartz",
    FischerBurmeister = "fischer_burmeister",
    NaturalResidual = "natural_residual",
    ChenChenKanzow = "chen_chen_kanzow",
    TwoSided = "two_sided",
    RaghunathanBiegler = "raghunathan_biegler",
    L1Penalty = "l1_penalty",
    LinfPenalty = "linf_penalty",
    L1Elastic = "l1_elastic",
    Elastic = "elastic",
    Direct = "direct",
});
value_names!(Homotopy { Coupled = "coupled", Outer = "outer" });
value_names!(Integration { Auto = "auto", Dp5 = "dp5", Dop853 = "dop853", Radau5 = "radau5" });
value_names!(ZenoPolicy { Continue = "continue", Stop = "stop", TimeStepping = "time_stepping" });
value_names!(AmbiguityPolicy { First = "first", Stop = "stop", Prefer = "prefer" });
value_names!(LogLevel {
    Silent = "silent",
    Error = "error",
    Warning = "warning",
    Info = "info",
    Debug = "debug",
    Trace = "trace",
});

/// Settings of discretisation and solver.
///
/// Fill with `swb_settings_init` in C, `Settings::default()` in Rust, then change what differs. Fields
/// are only ever appended; every field is 8 bytes wide, so there are no holes. An integer field that is
/// an enumeration takes the values of the enumeration named in its description. Ranges: see the option
/// table (`swb_option_range`).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Size of this struct in bytes, written by the init function: tells the library how much to read.
    pub struct_size: u64,
    /// Runge-Kutta family (enum rk_family).
    pub rk_family: i64,
    /// Stage points of the Runge-Kutta method.
    pub n_s: i64,
    /// Finite elements of a control stage or a simulation step.
    pub n_fe: i64,
    /// Treatment of switches: moving element boundaries or fixed steps (enum discretisation).
    pub discretisation: i64,
    /// Unknowns at the stage points (enum stage_form).
    pub stage_form: i64,
    /// Granularity of the cross complementarity (enum cross).
    pub cross: i64,
    /// Step equilibration during the homotopy (enum step_equilibration).
    pub step_equilibration: i64,
    /// Weight of the soft step equilibration, in optimal control in multiples of the steepest change of the cost.
    pub rho_h: f64,
    /// Step sizes stay between (1 - gamma_h) and (1 + gamma_h) times the nominal one.
    pub gamma_h: f64,
    /// Convergence tolerance of the interior point at sigma = 0, before polishing.
    pub tol: f64,
    /// Limit on the interior point iterations of one solve, over all homotopy steps.
    pub max_iter: i64,
    /// Limit on the wall time of one solve, in seconds, with everything it does: guesses, certificate, comparison, further rounds. It ends at most one factorisation or 16 model evaluations later, with what was found before; a model function that takes long itself is waited for.
    pub max_time: f64,
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
    /// Barrier parameter that belongs to a relaxation, as a multiple of it.
    pub mu_over_sigma: f64,
    /// Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses.
    pub plateau_mu: f64,
    /// Constraint violation at which the first problem, at sigma_init, counts as solved.
    pub plateau_viol: f64,
    /// Identify the active set and solve the smooth problem that remains (enum polish).
    pub polish: i64,
    /// Tolerance of the polished solution.
    pub polish_tol: f64,
    /// Initial guess where none is given (enum initial_guess).
    pub initial_guess: i64,
    /// Verbosity of the log sink (enum log_level).
    pub log_level: i64,
    /// Factorisation of the Newton matrices (enum linear_solver).
    pub linear_solver: i64,
    /// Order of elimination in the Newton matrices (enum ordering).
    pub ordering: i64,
    /// Scale objective and rows by their gradients at the starting point (enum toggle).
    pub scaling: i64,
    /// Start the pairs of a program on the central path, wherever the starting point has them (enum toggle).
    pub centre_pairs: i64,
    /// Limit the multipliers of products pair by pair before the whole Hessian is perturbed (enum toggle).
    pub convexify_pairs: i64,
    /// Try an active set that leaves no doubt before the relaxation is small (enum toggle).
    pub early_polish: i64,
    /// Solve the square system of the active set by Newton's method (enum toggle).
    pub square_newton: i64,
    /// Certify exact points, and follow descents from those that are not B-stationary (enum toggle).
    pub certify: i64,
    /// Rungs of the relaxation that may be taken back when the next one is too far.
    pub sigma_retries: i64,
    /// Second-order corrections of a step.
    pub max_soc: i64,
    /// Restore feasibility after a row of tiny steps (enum toggle).
    pub restore_tiny: i64,
    /// What stands for the complementarity constraints until the active set is identified (enum relaxation).
    pub relaxation: i64,
    /// How relaxation or penalty and barrier parameter change together (enum homotopy).
    pub homotopy: i64,
    /// First penalty parameter of the relaxations that are penalties; their sigma is its inverse.
    pub penalty_init: f64,
    /// Simulate the controls of an optimal control problem by the event-driven engine and compare (enum toggle).
    pub accuracy: i64,
    /// Relative and absolute tolerance of that simulation.
    pub accuracy_tol: f64,
    /// Neighbouring mode sequences that are tried after the first solution of an optimal control problem; 0: none.
    pub mode_search: i64,
    /// Complementarity form of what switches (enum dcs_form).
    pub dcs_form: i64,
    /// Factors at most in the products of the Heaviside form before they are lifted.
    pub lift_depth: i64,
    /// Integration method of the modes in event-driven simulation (enum integration).
    pub integration: i64,
    /// Relative tolerance of the local error in event-driven simulation.
    pub rtol: f64,
    /// Absolute tolerance of the local error in event-driven simulation.
    pub atol: f64,
    /// First step of an event-driven simulation; 0: the library chooses.
    pub h_init: f64,
    /// Longest step of an event-driven simulation.
    pub h_max: f64,
    /// Steps of an event-driven simulation at most, accepted and rejected.
    pub max_steps: i64,
    /// Switches an event-driven simulation keeps in its log at most; those beyond are counted only.
    pub max_switches: i64,
    /// What an event-driven simulation does where switches accumulate (enum zeno_policy).
    pub zeno: i64,
    /// What an event-driven simulation does where the continuation is not unique (enum ambiguity_policy).
    pub ambiguity: i64,
    /// Keep the dense output of an event-driven simulation (enum toggle).
    pub dense: i64,
    /// Compute the derivatives of an event-driven simulation and of its switching times (enum toggle).
    pub sensitivity: i64,
    /// Record an event-driven simulation for adjoint derivatives (enum toggle).
    pub adjoint: i64,
    /// Find out by another solve by how much constraints that cannot be met are violated at best (enum toggle).
    pub explain: i64,
    /// Error at the ends of the control stages up to which finite elements are added; 0: the grid stays.
    pub adapt_tol: f64,
    /// Solves on further grids at most.
    pub adapt_rounds: i64,
    /// Finite elements of such a grid at most, over all stages.
    pub adapt_elements: i64,
    /// Bytes that building, solving or simulating may take at most; 0: as many as there are.
    pub max_memory: i64,
    /// Where optimal control problems start from (enum ocp_start).
    pub ocp_start: i64,
    /// Which strategies solve a program with complementarity constraints within its iterations (enum portfolio).
    pub portfolio: i64,
}

/// A value on its way to or from an option.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// For integer and enumeration options, and for float options.
    Int(i64),
    /// For float options.
    Float(f64),
    /// For every option: a number as text, or the value name of an enumeration.
    Text(String),
}

impl From<i64> for Value {
    fn from(v: i64) -> Self {
        Value::Int(v)
    }
}
impl From<f64> for Value {
    fn from(v: f64) -> Self {
        Value::Float(v)
    }
}
impl From<&str> for Value {
    fn from(v: &str) -> Self {
        Value::Text(v.to_owned())
    }
}

/// Kind of an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Integer.
    Int,
    /// Floating-point number.
    Float,
    /// Enumeration: the names of the values 0, 1, ...
    Enum(&'static [&'static str]),
}

/// An end of a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// The value itself is allowed.
    Closed(f64),
    /// The value itself is not allowed.
    Open(f64),
}

impl Bound {
    /// Number of this end.
    pub fn value(self) -> f64 {
        match self {
            Bound::Closed(v) | Bound::Open(v) => v,
        }
    }

    /// Is the number itself outside the range?
    pub fn is_open(self) -> bool {
        matches!(self, Bound::Open(_))
    }
}

/// Description of one option: a row of [`OPTIONS`].
pub struct OptionInfo {
    /// Name, equal to the field of [`Settings`].
    pub name: &'static str,
    /// Kind, with the value names of enumerations.
    pub kind: Kind,
    /// Default; integers and enumeration values are exact in f64.
    pub default: f64,
    /// Lower end of the range.
    pub min: Bound,
    /// Upper end of the range.
    pub max: Bound,
    /// Symbol in the literature, or empty.
    pub symbol: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// Fixed once the object is built (it shapes the problem), or free between solves?
    pub setup_only: bool,
    /// Byte offset in [`Settings`].
    pub offset: usize,
    get: fn(&Settings) -> f64,
    set: fn(&mut Settings, f64),
}

const SETUP: bool = true;
const FREE: bool = false;
const INF: f64 = f64::INFINITY;
use Bound::{Closed, Open};

/// A row of the table; the field itself gives name, offset and access.
macro_rules! row {
    ($field:ident: Enum($type:ident::$default:ident), $symbol:literal, $setup:ident, $doc:literal) => {
        row!(@ $field, i64, Kind::Enum($type::NAMES), $type::$default as i64 as f64,
            Closed(0.0), Closed(($type::NAMES.len() - 1) as f64), $symbol, $setup, $doc)
    };
    ($field:ident: Int($default:literal, $min:expr, $max:expr), $symbol:literal, $setup:ident, $doc:literal) => {
        row!(@ $field, i64, Kind::Int, $default as f64, $min, $max, $symbol, $setup, $doc)
    };
    ($field:ident: Float($default:expr, $min:expr, $max:expr), $symbol:literal, $setup:ident, $doc:literal) => {
        row!(@ $field, f64, Kind::Float, $default, $min, $max, $symbol, $setup, $doc)
    };
    (@ $field:ident, $type:ty, $kind:expr, $default:expr, $min:expr, $max:expr, $symbol:literal, $setup:ident, $doc:literal) => {
        OptionInfo {
            name: stringify!($field),
            kind: $kind,
            default: $default,
            min: $min,
            max: $max,
            symbol: $symbol,
            doc: $doc,
            setup_only: $setup,
            offset: offset_of!(Settings, $field),
            get: |s| s.$field as f64,
            set: |s, v| s.$field = v as $type,
        }
    };
}

/// All options, in the order of the fields of [`Settings`].
#[rustfmt::skip]
pub static OPTIONS: &[OptionInfo] = &[
    row!(rk_family: Enum(RkFamily::RadauIia), "", SETUP,
        "Runge-Kutta family (enum rk_family)."),
    row!(n_s: Int(3, Closed(1.0), Closed(9.0)), "n_s", SETUP,
        "Stage points of the Runge-Kutta method."),
    row!(n_fe: Int(3, Closed(1.0), Closed(1000.0)), "N_FE", SETUP,
        "Finite elements of a control stage or a simulation step."),
    row!(discretisation: Enum(Discretisation::Fesd), "", SETUP,
        "Treatment of switches: moving element boundaries or fixed steps (enum discretisation)."),
    row!(stage_form: Enum(StageForm::Auto), "", SETUP,
        "Unknowns at the stage points (enum stage_form)."),
    row!(cross: Enum(Cross::Element), "", SETUP,
        "Granularity of the cross complementarity (enum cross)."),
    row!(step_equilibration: Enum(StepEquilibration::Difference), "", SETUP,
        "Step equilibration during the homotopy (enum step_equilibration)."),
    row!(rho_h: Float(1.0, Closed(0.0), Open(INF)), "rho_h", FREE,
        "Weight of the soft step equilibration, in optimal control in multiples of the steepest change of the cost."),
    row!(gamma_h: Float(1.0, Open(0.0), Closed(1.0)), "gamma_h", FREE,
        "Step sizes stay between (1 - gamma_h) and (1 + gamma_h) times the nominal one."),
    row!(tol: Float(1e-9, Open(0.0), Open(1.0)), "epsilon_tol", FREE,
        "Convergence tolerance of the interior point at sigma = 0, before polishing."),
    row!(max_iter: Int(3000, Closed(0.0), Closed(1e9)), "", FREE,
        "Limit on the interior point iterations of one solve, over all homotopy steps."),
    row!(max_time: Float(INF, Closed(0.0), Closed(INF)), "", FREE,
        "Limit on the wall time of one solve, in seconds, with everything it does: guesses, certificate, comparison, further rounds. It ends at most one factorisation or 16 model evaluations later, with what was found before; a model function that takes long itself is waited for."),
    // rows whose bound is 1e20 or more count as free: a relaxation stays well below
    row!(mu_init: Float(0.1, Open(0.0), Closed(1e15)), "mu_0", FREE,
        "Initial barrier parameter."),
    row!(sigma_init: Float(1.0, Open(0.0), Closed(1e15)), "sigma_0", FREE,
        "Initial relaxation of the complementarity."),
    row!(sigma_min: Float(1e-9, Open(0.0), Closed(1.0)), "sigma_N", FREE,
        "Smallest relaxation of the complementarity."),
    row!(sigma_factor: Float(0.1, Open(0.0), Open(1.0)), "kappa_sigma", FREE,
        "Linear reduction of the relaxation: sigma becomes at most sigma_factor sigma."),
    row!(sigma_exponent: Float(1.5, Closed(1.0), Closed(3.0)), "theta_sigma", FREE,
        "Superlinear reduction of the relaxation: sigma becomes at most sigma^sigma_exponent."),
    row!(mu_over_sigma: Float(0.1, Open(0.0), Closed(1e3)), "", FREE,
        "Barrier parameter that belongs to a relaxation, as a multiple of it."),
    row!(plateau_mu: Float(0.0, Closed(0.0), Open(INF)), "", FREE,
        "Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses."),
    row!(plateau_viol: Float(1e-4, Open(0.0), Open(INF)), "", FREE,
        "Constraint violation at which the first problem, at sigma_init, counts as solved."),
    row!(polish: Enum(Polish::On), "", FREE,
        "Identify the active set and solve the smooth problem that remains (enum polish)."),
    row!(polish_tol: Float(1e-12, Open(0.0), Open(1.0)), "", FREE,
        "Tolerance of the polished solution."),
    row!(initial_guess: Enum(InitialGuess::Constant), "", FREE,
        "Initial guess where none is given (enum initial_guess)."),
    row!(log_level: Enum(LogLevel::Silent), "", FREE,
        "Verbosity of the log sink (enum log_level)."),
    row!(linear_solver: Enum(LinearSolver::Auto), "", SETUP,
        "Factorisation of the Newton matrices (enum linear_solver)."),
    row!(ordering: Enum(Ordering::Amd), "", SETUP,
        "Order of elimination in the Newton matrices (enum ordering)."),
    row!(scaling: Enum(Switch::On), "", FREE,
        "Scale objective and rows by their gradients at the starting point (enum toggle)."),
    row!(centre_pairs: Enum(Switch::On), "", FREE,
        "Start the pairs of a program on the central path, wherever the starting point has them (enum toggle)."),
    row!(convexify_pairs: Enum(Switch::On), "", FREE,
        "Limit the multipliers of products pair by pair before the whole Hessian is perturbed (enum toggle)."),
    row!(early_polish: Enum(Switch::On), "", FREE,
        "Try an active set that leaves no doubt before the relaxation is small (enum toggle)."),
    row!(square_newton: Enum(Switch::On), "", FREE,
        "Solve the square system of the active set by Newton's method (enum toggle)."),
    row!(certify: Enum(Switch::On), "", FREE,
        "Certify exact points, and follow descents from those that are not B-stationary (enum toggle)."),
    row!(sigma_retries: Int(4, Closed(0.0), Closed(100.0)), "", FREE,
        "Rungs of the relaxation that may be taken back when the next one is too far."),
    row!(max_soc: Int(4, Closed(0.0), Closed(100.0)), "", FREE,
        "Second-order corrections of a step."),
    row!(restore_tiny: Enum(Switch::On), "", FREE,
        "Restore feasibility after a row of tiny steps (enum toggle)."),
    row!(relaxation: Enum(Relaxation::Scholtes), "", SETUP,
        "What stands for the complementarity constraints until the active set is identified (enum relaxation)."),
    row!(homotopy: Enum(Homotopy::Coupled), "", FREE,
        "How relaxation or penalty and barrier parameter change together (enum homotopy)."),
    row!(penalty_init: Float(1.0, Closed(1e-9), Closed(1e9)), "rho_0", FREE,
        "First penalty parameter of the relaxations that are penalties; their sigma is its inverse."),
    row!(accuracy: Enum(Switch::On), "", FREE,
        "Simulate the controls of an optimal control problem by the event-driven engine and compare (enum toggle)."),
    row!(accuracy_tol: Float(1e-11, Closed(1e-13), Closed(1e-2)), "", FREE,
        "Relative and absolute tolerance of that simulation."),
    row!(mode_search: Int(0, Closed(0.0), Closed(1e6)), "", FREE,
        "Neighbouring mode sequences that are tried after the first solution of an optimal control problem; 0: none."),
    row!(dcs_form: Enum(DcsForm::Auto), "", SETUP,
        "Complementarity form of what switches (enum dcs_form)."),
    row!(lift_depth: Int(2, Closed(2.0), Closed(64.0)), "n_d", SETUP,
        "Factors at most in the products of the Heaviside form before they are lifted."),
    row!(integration: Enum(Integration::Auto), "", FREE,
        "Integration method of the modes in event-driven simulation (enum integration)."),
    row!(rtol: Float(1e-8, Closed(0.0), Open(1.0)), "", FREE,
        "Relative tolerance of the local error in event-driven simulation."),
    row!(atol: Float(1e-10, Closed(0.0), Open(INF)), "", FREE,
        "Absolute tolerance of the local error in event-driven simulation."),
    row!(h_init: Float(0.0, Closed(0.0), Open(INF)), "h_0", FREE,
        "First step of an event-driven simulation; 0: the library chooses."),
    row!(h_max: Float(INF, Open(0.0), Closed(INF)), "", FREE,
        "Longest step of an event-driven simulation."),
    row!(max_steps: Int(10000000, Closed(0.0), Closed(1e15)), "", FREE,
        "Steps of an event-driven simulation at most, accepted and rejected."),
    row!(max_switches: Int(1000000, Closed(0.0), Closed(1e15)), "", FREE,
        "Switches an event-driven simulation keeps in its log at most; those beyond are counted only."),
    row!(zeno: Enum(ZenoPolicy::Continue), "", FREE,
        "What an event-driven simulation does where switches accumulate (enum zeno_policy)."),
    row!(ambiguity: Enum(AmbiguityPolicy::First), "", FREE,
        "What an event-driven simulation does where the continuation is not unique (enum ambiguity_policy)."),
    row!(dense: Enum(Switch::Off), "", FREE,
        "Keep the dense output of an event-driven simulation (enum toggle)."),
    row!(sensitivity: Enum(Switch::Off), "", FREE,
        "Compute the derivatives of an event-driven simulation and of its switching times (enum toggle)."),
    row!(adjoint: Enum(Switch::Off), "", FREE,
        "Record an event-driven simulation for adjoint derivatives (enum toggle)."),
    row!(explain: Enum(Switch::On), "", FREE,
        "Find out by another solve by how much constraints that cannot be met are violated at best (enum toggle)."),
    row!(adapt_tol: Float(0.0, Closed(0.0), Closed(1.0)), "", FREE,
        "Error at the ends of the control stages up to which finite elements are added; 0: the grid stays."),
    row!(adapt_rounds: Int(10, Closed(0.0), Closed(1000.0)), "", FREE,
        "Solves on further grids at most."),
    row!(adapt_elements: Int(1000, Closed(1.0), Closed(1e6)), "", FREE,
        "Finite elements of such a grid at most, over all stages."),
    row!(max_memory: Int(0, Closed(0.0), Closed(1e15)), "", FREE,
        "Bytes that building, solving or simulating may take at most; 0: as many as there are."),
    row!(ocp_start: Enum(OcpStart::Portfolio), "", FREE,
        "Where optimal control problems start from (enum ocp_start)."),
    row!(portfolio: Enum(Portfolio::Rescue), "", FREE,
        "Which strategies solve a program with complementarity constraints within its iterations (enum portfolio)."),
];

impl OptionInfo {
    /// Current value in `settings`.
    pub fn get(&self, settings: &Settings) -> Value {
        match self.kind {
            Kind::Float => Value::Float((self.get)(settings)),
            Kind::Int | Kind::Enum(_) => Value::Int((self.get)(settings) as i64),
        }
    }

    /// Current value in `settings` as text: the value name of an enumeration, else a number that reads
    /// back to the same bits.
    pub fn get_text(&self, settings: &Settings) -> String {
        let v = (self.get)(settings);
        match self.kind {
            Kind::Float => float_text(v),
            Kind::Int => format!("{}", v as i64),
            Kind::Enum(names) => match names.get(v as usize) {
                Some(name) if v >= 0.0 => (*name).to_owned(),
                _ => format!("{}", v as i64),
            },
        }
    }

    /// Is the number inside the range of this option? NaN never is.
    pub fn contains(&self, v: f64) -> bool {
        (match self.min {
            Closed(a) => v >= a,
            Open(a) => v > a,
        }) && match self.max {
            Closed(b) => v <= b,
            Open(b) => v < b,
        }
    }

    /// Range as text: `[1, 9]`, `(0, inf)`, or the value names of an enumeration.
    pub fn range_text(&self) -> String {
        if let Kind::Enum(names) = self.kind {
            return names.join(" | ");
        }
        let (left, right) = (if self.min.is_open() { '(' } else { '[' }, if self.max.is_open() { ')' } else { ']' });
        format!("{left}{}, {}{right}", self.min.value(), self.max.value())
    }

    fn check(&self, v: f64) -> Result<()> {
        if self.contains(v) {
            return Ok(());
        }
        Err(Error::Range(match self.kind {
            Kind::Enum(_) => format!("option '{}' is {v}, which is none of {}", self.name, self.enum_text()),
            _ => format!("option '{}' is {v}, outside {}", self.name, self.range_text()),
        }))
    }

    fn enum_text(&self) -> String {
        let Kind::Enum(names) = self.kind else {
            return String::new();
        };
        let pairs: Vec<String> = names.iter().enumerate().map(|(i, n)| format!("{i} ({n})")).collect();
        pairs.join(", ")
    }

    /// Number for this option out of a value of any type.
    fn number(&self, value: &Value) -> Result<f64> {
        match (self.kind, value) {
            (Kind::Float, Value::Float(v)) => Ok(*v),
            (_, Value::Int(v)) => {
                // Beyond 2^53 an integer is not exact in f64; no range reaches that far.
                if v.unsigned_abs() > 1 << 53 {
                    return Err(Error::Range(format!("option '{}' is {v}, outside {}", self.name, self.range_text())));
                }
                Ok(*v as f64)
            }
            (Kind::Int | Kind::Enum(_), Value::Float(v)) => {
                Err(Error::Option(format!("option '{}' takes {}, not the float {v}", self.name, self.kind_text())))
            }
            (Kind::Float, Value::Text(t)) => t.trim().parse::<f64>().map_err(|_| self.not_a_value(t)),
            (Kind::Int, Value::Text(t)) => {
                let v = t.trim().parse::<i64>().map_err(|_| self.not_a_value(t))?;
                self.number(&Value::Int(v))
            }
            (Kind::Enum(names), Value::Text(t)) => {
                let t = t.trim();
                if let Some(i) = names.iter().position(|n| *n == t) {
                    return Ok(i as f64);
                }
                match t.parse::<i64>() {
                    Ok(v) => self.number(&Value::Int(v)),
                    Err(_) => Err(self.not_a_value(t)),
                }
            }
        }
    }

    fn kind_text(&self) -> &'static str {
        match self.kind {
            Kind::Int => "an integer",
            Kind::Float => "a number",
            Kind::Enum(_) => "a value name or its integer",
        }
    }

    fn not_a_value(&self, text: &str) -> Error {
        let mut message = format!("option '{}' takes {}, not '{}'", self.name, self.kind_text(), shortened(text));
        if let Kind::Enum(names) = self.kind {
            match nearest(text, names.iter().copied()) {
                Some(n) => message += &format!("; did you mean '{n}'?"),
                None => message += &format!("; one of {}", names.join(", ")),
            }
        }
        Error::Option(message)
    }
}

/// Row of an option by name; the error names the nearest option.
pub fn option(name: &str) -> Result<&'static OptionInfo> {
    OPTIONS.iter().find(|o| o.name == name).ok_or_else(|| {
        let hint = match nearest(name, OPTIONS.iter().map(|o| o.name)) {
            Some(n) => format!("; did you mean '{n}'?"),
            None => String::new(),
        };
        Error::Option(format!("unknown option '{}'{hint}", shortened(name)))
    })
}

impl Default for Settings {
    fn default() -> Self {
        let mut s = Settings {
            struct_size: std::mem::size_of::<Settings>() as u64,
            rk_family: 0,
            n_s: 0,
            n_fe: 0,
            discretisation: 0,
            stage_form: 0,
            cross: 0,
            step_equilibration: 0,
            rho_h: 0.0,
            gamma_h: 0.0,
            tol: 0.0,
            max_iter: 0,
            max_time: 0.0,
            mu_init: 0.0,
            sigma_init: 0.0,
            sigma_min: 0.0,
            sigma_factor: 0.0,
            sigma_exponent: 0.0,
            mu_over_sigma: 0.0,
            plateau_mu: 0.0,
            plateau_viol: 0.0,
            polish: 0,
            polish_tol: 0.0,
            initial_guess: 0,
            log_level: 0,
            linear_solver: 0,
            ordering: 0,
            scaling: 0,
            centre_pairs: 0,
            convexify_pairs: 0,
            early_polish: 0,
            square_newton: 0,
            certify: 0,
            sigma_retries: 0,
            max_soc: 0,
            restore_tiny: 0,
            relaxation: 0,
            homotopy: 0,
            penalty_init: 0.0,
            accuracy: 0,
            accuracy_tol: 0.0,
            mode_search: 0,
            dcs_form: 0,
            lift_depth: 0,
            integration: 0,
            rtol: 0.0,
            atol: 0.0,
            h_init: 0.0,
            h_max: 0.0,
            max_steps: 0,
            max_switches: 0,
            zeno: 0,
            ambiguity: 0,
            dense: 0,
            sensitivity: 0,
            adjoint: 0,
            explain: 0,
            adapt_tol: 0.0,
            adapt_rounds: 0,
            adapt_elements: 0,
            max_memory: 0,
            ocp_start: 0,
            portfolio: 0,
        };
        for o in OPTIONS {
            (o.set)(&mut s, o.default);
        }
        s
    }
}

impl Settings {
    /// Set an option by name. An unknown name or a value of the wrong type is [`Error::Option`], a value
    /// outside the range [`Error::Range`]; the settings are then unchanged.
    pub fn set_by_name(&mut self, name: &str, value: impl Into<Value>) -> Result<()> {
        let o = option(name)?;
        let v = o.number(&value.into())?;
        o.check(v)?;
        (o.set)(self, v);
        Ok(())
    }

    /// Value of an option by name; enumerations as integers.
    pub fn get_by_name(&self, name: &str) -> Result<Value> {
        Ok(option(name)?.get(self))
    }

    /// Check every value against its range, and the pairs that belong together.
    pub fn validate(&self) -> Result<()> {
        for o in OPTIONS {
            o.check((o.get)(self))?;
        }
        if self.sigma_min > self.sigma_init {
            return Err(Error::Range(format!(
                "option 'sigma_min' is {:e}, above 'sigma_init' {:e}",
                self.sigma_min, self.sigma_init
            )));
        }
        Ok(())
    }

    /// Check like [`Settings::validate`], and that nothing changed since `setup` that shapes the problem.
    pub fn validate_as_update(&self, setup: &Settings) -> Result<()> {
        self.validate()?;
        for o in OPTIONS.iter().filter(|o| o.setup_only) {
            if (o.get)(self) != (o.get)(setup) {
                return Err(Error::State(format!(
                    "option '{}' is fixed at setup: it was {}, not {}",
                    o.name,
                    o.get_text(setup),
                    o.get_text(self)
                )));
            }
        }
        Ok(())
    }

    /// All options as one JSON object; enumerations by value name, infinite values as text.
    pub fn to_json(&self) -> String {
        let mut out = String::from("{");
        for (i, o) in OPTIONS.iter().enumerate() {
            let text = o.get_text(self);
            let quoted = matches!(o.kind, Kind::Enum(_)) || !(o.get)(self).is_finite();
            let quote = if quoted { "\"" } else { "" };
            let comma = if i == 0 { "" } else { ", " };
            let _ = write!(out, "{comma}\"{}\": {quote}{text}{quote}", o.name);
        }
        out.push('}');
        out
    }

    /// [`RkFamily`] of these settings.
    pub fn rk_family(&self) -> Result<RkFamily> {
        RkFamily::from_i64(self.rk_family).ok_or_else(|| bad("rk_family", self.rk_family))
    }

    /// [`DcsForm`] of these settings.
    pub fn dcs_form(&self) -> Result<DcsForm> {
        DcsForm::from_i64(self.dcs_form).ok_or_else(|| bad("dcs_form", self.dcs_form))
    }

    /// [`Discretisation`] of these settings.
    pub fn discretisation(&self) -> Result<Discretisation> {
        Discretisation::from_i64(self.discretisation).ok_or_else(|| bad("discretisation", self.discretisation))
    }

    /// [`StageForm`] of these settings.
    pub fn stage_form(&self) -> Result<StageForm> {
        StageForm::from_i64(self.stage_form).ok_or_else(|| bad("stage_form", self.stage_form))
    }

    /// [`Cross`] of these settings.
    pub fn cross(&self) -> Result<Cross> {
        Cross::from_i64(self.cross).ok_or_else(|| bad("cross", self.cross))
    }

    /// [`StepEquilibration`] of these settings.
    pub fn step_equilibration(&self) -> Result<StepEquilibration> {
        StepEquilibration::from_i64(self.step_equilibration)
            .ok_or_else(|| bad("step_equilibration", self.step_equilibration))
    }

    /// Polishing on or off.
    pub fn polish(&self) -> bool {
        self.polish != Polish::Off as i64
    }

    /// [`OcpStart`] of these settings.
    pub fn ocp_start(&self) -> Result<OcpStart> {
        OcpStart::from_i64(self.ocp_start).ok_or_else(|| bad("ocp_start", self.ocp_start))
    }
    /// [`InitialGuess`] of these settings.
    pub fn initial_guess(&self) -> Result<InitialGuess> {
        InitialGuess::from_i64(self.initial_guess).ok_or_else(|| bad("initial_guess", self.initial_guess))
    }

    /// [`LinearSolver`] of these settings.
    pub fn linear_solver(&self) -> Result<LinearSolver> {
        LinearSolver::from_i64(self.linear_solver).ok_or_else(|| bad("linear_solver", self.linear_solver))
    }

    /// [`Ordering`] of these settings.
    pub fn ordering(&self) -> Result<Ordering> {
        Ordering::from_i64(self.ordering).ok_or_else(|| bad("ordering", self.ordering))
    }

    /// [`Relaxation`] of these settings; the default for a number outside.
    pub fn relaxation(&self) -> Relaxation {
        Relaxation::from_i64(self.relaxation).unwrap_or(Relaxation::Scholtes)
    }

    /// [`Homotopy`] of these settings; the default for a number outside.
    pub fn homotopy(&self) -> Homotopy {
        Homotopy::from_i64(self.homotopy).unwrap_or(Homotopy::Coupled)
    }

    /// [`Portfolio`] of these settings; the default for a number outside.
    pub fn portfolio(&self) -> Portfolio {
        Portfolio::from_i64(self.portfolio).unwrap_or(Portfolio::Rescue)
    }

    /// [`LogLevel`] of these settings; a number outside means the nearest level.
    pub fn log_level(&self) -> LogLevel {
        LogLevel::from_i64(self.log_level.clamp(0, LogLevel::Trace as i64)).unwrap_or(LogLevel::Silent)
    }
}

fn bad(name: &str, value: i64) -> Error {
    match option(name).and_then(|o| o.check(value as f64)) {
        Err(e) => e,
        Ok(()) => Error::Internal(format!("value {value} of option '{name}' has no name")),
    }
}

/// Shortest text that reads back to the same number, in the notation of C and JSON.
fn float_text(v: f64) -> String {
    if v.is_infinite() {
        return if v > 0.0 { "inf".into() } else { "-inf".into() };
    }
    let plain = format!("{v:?}");
    let scientific = format!("{v:e}");
    if scientific.len() < plain.len() {
        scientific
    } else {
        plain
    }
}

/// Longest text of the caller that is compared with names, or shown as it is.
const LONGEST_NAME: usize = 64;

/// A text of the caller for a message: its beginning, if it is longer than any name.
pub(crate) fn shortened(text: &str) -> std::borrow::Cow<'_, str> {
    match text.char_indices().nth(LONGEST_NAME) {
        Some((end, _)) => format!("{}... ({} bytes)", &text[..end], text.len()).into(),
        None => text.into(),
    }
}

/// The candidate nearest to `word`, if one is near enough to be meant.
pub(crate) fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > LONGEST_NAME {
        return None;
    }
    let word = word.trim().to_ascii_lowercase().replace(['-', ' '], "_");
    let limit = (word.chars().count() / 3).max(1) + 1;
    candidates
        .map(|c| (edit_distance(&word, c), c))
        .filter(|(d, c)| *d <= limit && *d < c.chars().count())
        .min_by_key(|(d, _)| *d)
        .map(|(_, c)| c)
}

/// Insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`.
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let width = b.len() + 1;
    let mut d = vec![0; (a.len() + 1) * width];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            d[i * width + j] = if i == 0 || j == 0 {
                i + j
            } else {
                let substitution = d[(i - 1) * width + j - 1] + usize::from(a[i - 1] != b[j - 1]);
                let mut best = substitution.min(d[(i - 1) * width + j] + 1).min(d[i * width + j - 1] + 1);
                if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                    best = best.min(d[(i - 2) * width + j - 2] + 1);
                }
                best
            };
        }
    }
    d[a.len() * width + b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_tiles_the_struct() {
        let mut next = 8; // behind struct_size
        for o in OPTIONS {
            assert_eq!(o.offset, next, "option {}", o.name);
            next += 8;
        }
        assert_eq!(next, std::mem::size_of::<Settings>());
        assert_eq!(std::mem::align_of::<Settings>(), 8);
    }

    #[test]
    fn docs_of_fields_and_table_agree() {
        let source = include_str!("settings.rs");
        let body = source.split("pub struct Settings {").nth(1).unwrap();
        let body = body.split("\n}").next().unwrap();
        let mut lines = body.lines().map(str::trim).skip_while(|l| !l.starts_with("pub struct_size"));
        lines.next();
        for o in OPTIONS {
            let doc = lines.next().unwrap().strip_prefix("/// ").unwrap();
            assert_eq!(doc, o.doc);
            assert!(lines.next().unwrap().starts_with(&format!("pub {}: ", o.name)));
        }
    }

    #[test]
    fn defaults_are_valid() {
        let s = Settings::default();
        s.validate().unwrap();
        assert_eq!(s.struct_size, std::mem::size_of::<Settings>() as u64);
        assert_eq!((s.n_s, s.n_fe, s.max_iter, s.step_equilibration), (3, 3, 3000, 2));
        assert_eq!(s.rk_family(), Ok(RkFamily::RadauIia));
        assert!(s.max_time.is_infinite() && s.polish());
        for o in OPTIONS {
            assert!(o.contains(o.default), "{}", o.name);
            assert!(!o.contains(f64::NAN), "{}", o.name);
            assert!(o.doc.ends_with('.') && !o.doc.contains('\n'), "{}", o.name);
        }
    }

    #[test]
    fn names_follow_values() {
        for (i, name) in StepEquilibration::NAMES.iter().enumerate() {
            assert_eq!(StepEquilibration::from_i64(i as i64).unwrap().name(), *name);
        }
        assert_eq!(RkFamily::from_i64(7), None);
        assert_eq!(RkFamily::from_i64(-1), None);
    }

    #[test]
    fn every_option_goes_round_by_text() {
        let mut s = Settings::default();
        for o in OPTIONS {
            let before = o.get_text(&s);
            s.set_by_name(o.name, before.as_str()).unwrap();
            assert_eq!(o.get_text(&s), before);
            assert_eq!(s.get_by_name(o.name).unwrap(), o.get(&s));
        }
        assert_eq!(s, Settings::default());
    }

    #[test]
    fn set_checks_type_and_range() {
        let mut s = Settings::default();
        s.set_by_name("tol", 1e-6).unwrap();
        s.set_by_name("n_s", 4i64).unwrap();
        s.set_by_name("rho_h", 2i64).unwrap();
        s.set_by_name("rk_family", "gauss_legendre").unwrap();
        s.set_by_name("max_time", "inf").unwrap();
        assert_eq!((s.tol, s.n_s, s.rho_h, s.rk_family), (1e-6, 4, 2.0, 1));
        let before = s;
        for (name, value, code) in [
            ("tol", Value::Float(0.0), -3),
            ("tol", Value::Float(1.0), -3),
            ("tol", Value::Float(f64::NAN), -3),
            ("gamma_h", Value::Float(1.5), -3),
            ("n_s", Value::Int(10), -3),
            ("n_s", Value::Int(i64::MIN), -3),
            ("n_s", Value::Float(2.0), -6),
            ("n_s", Value::Text("two".into()), -6),
            ("n_s", Value::Text("2.5".into()), -6),
            ("cross", Value::Int(4), -3),
            ("cross", Value::Text("elemnt".into()), -6),
            ("max_time", Value::Text("nan".into()), -3),
            ("none_such", Value::Int(0), -6),
            ("struct_size", Value::Int(0), -6),
        ] {
            let e = s.set_by_name(name, value.clone()).unwrap_err();
            assert_eq!(e.code(), code, "{name} {value:?}: {e}");
        }
        assert_eq!(s, before);
    }

    #[test]
    fn misspelt_names_are_recognised() {
        let hint = |name: &str| option(name).err().unwrap().to_string();
        assert_eq!(hint("tolr"), "unknown option 'tolr'; did you mean 'tol'?");
        assert_eq!(hint("max_itre"), "unknown option 'max_itre'; did you mean 'max_iter'?");
        assert_eq!(hint("max-iter"), "unknown option 'max-iter'; did you mean 'max_iter'?");
        assert_eq!(hint("discretization"), "unknown option 'discretization'; did you mean 'discretisation'?");
        assert_eq!(hint("frobnicate_all"), "unknown option 'frobnicate_all'");
        let e = Settings::default().set_by_name("cross", "elemnt").unwrap_err().to_string();
        assert!(e.ends_with("did you mean 'element'?"), "{e}");
    }

    #[test]
    fn validate_finds_bad_fields_and_pairs() {
        let bad = |change: fn(&mut Settings)| {
            let mut s = Settings::default();
            change(&mut s);
            s.validate().unwrap_err().to_string()
        };
        assert_eq!(bad(|s| s.tol = -1.0), "option 'tol' is -1, outside (0, 1)");
        assert_eq!(bad(|s| s.n_s = 0), "option 'n_s' is 0, outside [1, 9]");
        assert!(bad(|s| s.polish = 7).contains("none of 0 (off), 1 (on)"));
        assert!(bad(|s| s.sigma_init = 1e-12).contains("sigma_min"));
        let (old, mut new) = (Settings::default(), Settings::default());
        new.tol = 1e-7;
        new.validate_as_update(&old).unwrap();
        new.n_s = 4;
        assert_eq!(new.validate_as_update(&old).unwrap_err().code(), -4);
    }

    #[test]
    fn json_is_complete() {
        let json = Settings::default().to_json();
        assert!(json.starts_with("{\"rk_family\": \"radau_iia\", \"n_s\": 3, "), "{json}");
        assert!(json.contains("\"max_time\": \"inf\"") && json.contains("\"tol\": 1e-9"), "{json}");
        assert_eq!(json.matches(": ").count(), OPTIONS.len());
    }
}
