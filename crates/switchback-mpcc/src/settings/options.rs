//! All options: written by `make header` from options.toml of the settings; do not edit.

use super::{bad, Bound::{Closed, Open}, Kind, OptionInfo};
use crate::error::Result;
use std::mem::offset_of;

/// Runge-Kutta family (option rk_family).
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

impl RkFamily {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["radau_iia", "gauss_legendre", "explicit", "radau_ia", "lobatto_iiia", "lobatto_iiib", "lobatto_iiic"];
    const ALL: [RkFamily; 7] = [RkFamily::RadauIia, RkFamily::GaussLegendre, RkFamily::Explicit, RkFamily::RadauIa, RkFamily::LobattoIiia, RkFamily::LobattoIiib, RkFamily::LobattoIiic];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Complementarity form of switching terms (option dcs_form).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DcsForm {
    /// Chosen for each subsystem. Stewart's form, unless the Heaviside form has fewer pairs and no more variables, or controls alone decide some of its switching functions and not the others.
    Auto = 0,
    /// One pair for each region.
    Stewart = 1,
    /// Two pairs for each switching function; subsystems given by indicators stay in Stewart's form.
    Heaviside = 2,
}

impl DcsForm {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["auto", "stewart", "heaviside"];
    const ALL: [DcsForm; 3] = [DcsForm::Auto, DcsForm::Stewart, DcsForm::Heaviside];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Treatment of switches by the discretisation (option discretisation).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discretisation {
    /// Finite elements with switch detection: element boundaries move onto the switches.
    Fesd = 0,
    /// Fixed step sizes; switches lie inside the elements and the order drops to one.
    Standard = 1,
}

impl Discretisation {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["fesd", "standard"];
    const ALL: [Discretisation; 2] = [Discretisation::Fesd, Discretisation::Standard];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Unknowns at the stage points (option stage_form).
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

impl StageForm {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["auto", "values", "derivatives"];
    const ALL: [StageForm; 3] = [StageForm::Auto, StageForm::Values, StageForm::Derivatives];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Granularity of the cross complementarity (option cross).
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

impl Cross {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["element", "stage", "full", "point"];
    const ALL: [Cross; 4] = [Cross::Element, Cross::Stage, Cross::Full, Cross::Point];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Step equilibration during the homotopy (option step_equilibration).
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
    /// Difference of neighbouring step sizes weighted by the square of the switch indicator eta.
    EtaSquared = 4,
    /// Products of switch indicator and difference of step sizes equal to zero.
    EtaEquation = 5,
    /// Difference of neighbouring step sizes weighted by the hyperbolic tangent of the switch indicator eta, whose size then counts only where it is small.
    EtaSaturated = 6,
}

impl StepEquilibration {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["none", "mean", "difference", "eta_product", "eta_squared", "eta_equation", "eta_saturated"];
    const ALL: [StepEquilibration; 7] = [StepEquilibration::None, StepEquilibration::Mean, StepEquilibration::Difference, StepEquilibration::EtaProduct, StepEquilibration::EtaSquared, StepEquilibration::EtaEquation, StepEquilibration::EtaSaturated];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Polishing after the homotopy (option polish).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polish {
    /// The interior point solution is final.
    Off = 0,
    /// Fix the active set and solve the smooth problem to polish_tol.
    On = 1,
}

impl Polish {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["off", "on"];
    const ALL: [Polish; 2] = [Polish::Off, Polish::On];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Initial guess of the discretised problem (option initial_guess).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialGuess {
    /// Initial value of the states at every node.
    Constant = 0,
    /// A simulation with the guessed controls.
    Simulation = 1,
    /// A simulation of the system smoothed as at the start of the homotopy, with weights and multipliers that fit.
    Smoothed = 2,
    /// The solution of the problem with fixed steps, early in its homotopy.
    TimeStepping = 3,
}

impl InitialGuess {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["constant", "simulation", "smoothed", "time_stepping"];
    const ALL: [InitialGuess; 4] = [InitialGuess::Constant, InitialGuess::Simulation, InitialGuess::Smoothed, InitialGuess::TimeStepping];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Search for the solution of an optimal control problem (option ocp_start).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OcpStart {
    /// All ways in one race: the guess, smoothed problems, descents on simulations from random controls, and the homotopy. Each has its share of the work, and what gains has more. The cheapest solution that a simulation confirms is kept.
    Portfolio = 0,
    /// The homotopy from the guess alone.
    Homotopy = 1,
    /// Smoothed problems and sequences next to their solutions; the homotopy only where they lead to no solution.
    Smoothing = 2,
}

impl OcpStart {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["portfolio", "homotopy", "smoothing"];
    const ALL: [OcpStart; 3] = [OcpStart::Portfolio, OcpStart::Homotopy, OcpStart::Smoothing];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Strategies for a program with complementarity constraints (option portfolio).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Portfolio {
    /// Only the homotopy that the other options describe.
    Off = 0,
    /// The homotopy, and where it ends without a solution other strategies, until one has a solution.
    Rescue = 1,
    /// All strategies; the best solution is kept.
    All = 2,
    /// The strategies of rescue, then homotopies with heavier objectives until two have the same objective, then branches next to the best solution. The best solution is kept.
    Agree = 3,
}

impl Portfolio {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["off", "rescue", "all", "agree"];
    const ALL: [Portfolio; 4] = [Portfolio::Off, Portfolio::Rescue, Portfolio::All, Portfolio::Agree];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Factorisation of the Newton matrices (option linear_solver).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolver {
    /// Chosen by the fill of the factors: columns where they are sparse, dense blocks where they are not.
    Auto = 0,
    /// SuiteSparse LDL, column by column; only in a library linked with it.
    Suitesparse = 1,
    /// Dense blocks of columns, by faer; only in a library built with it.
    Faer = 2,
    /// SuiteSparse's column-by-column algorithm, built into this library.
    Native = 3,
}

impl LinearSolver {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["auto", "suitesparse", "faer", "native"];
    const ALL: [LinearSolver; 4] = [LinearSolver::Auto, LinearSolver::Suitesparse, LinearSolver::Faer, LinearSolver::Native];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Order of elimination in the Newton matrices (option ordering).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ordering {
    /// Approximate minimum degree.
    Amd = 0,
    /// Variables as they are numbered (for a horizon: along time), every row behind its last variable.
    Natural = 1,
}

impl Ordering {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["amd", "natural"];
    const ALL: [Ordering; 2] = [Ordering::Amd, Ordering::Natural];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Inputs with respect to which a simulation is differentiated (option sensitivity).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensitivity {
    /// Nothing.
    Off = 0,
    /// Initial states, parameters and controls.
    On = 1,
    /// Parameters and controls, without initial states.
    Inputs = 2,
}

impl Sensitivity {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["off", "on", "inputs"];
    const ALL: [Sensitivity; 3] = [Sensitivity::Off, Sensitivity::On, Sensitivity::Inputs];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// An ingredient of a method that can be left out.
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// The ingredient is left out.
    Off = 0,
    /// The ingredient is used.
    On = 1,
}

impl Switch {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["off", "on"];
    const ALL: [Switch; 2] = [Switch::Off, Switch::On];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Relaxation or penalty in the place of the complementarity constraints until the active set is identified (option relaxation).
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

impl Relaxation {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["scholtes", "scholtes_eq", "scholtes_lumped", "lin_fukushima", "kadrani", "steffensen_ulbrich", "steffensen_ulbrich_poly", "kanzow_schwartz", "fischer_burmeister", "natural_residual", "chen_chen_kanzow", "two_sided", "raghunathan_biegler", "l1_penalty", "linf_penalty", "l1_elastic", "elastic", "direct"];
    const ALL: [Relaxation; 18] = [Relaxation::Scholtes, Relaxation::ScholtesEq, Relaxation::ScholtesLumped, Relaxation::LinFukushima, Relaxation::Kadrani, Relaxation::SteffensenUlbrich, Relaxation::SteffensenUlbrichPoly, Relaxation::KanzowSchwartz, Relaxation::FischerBurmeister, Relaxation::NaturalResidual, Relaxation::ChenChenKanzow, Relaxation::TwoSided, Relaxation::RaghunathanBiegler, Relaxation::L1Penalty, Relaxation::LinfPenalty, Relaxation::L1Elastic, Relaxation::Elastic, Relaxation::Direct];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Changes of relaxation or penalty and barrier parameter (option homotopy).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Homotopy {
    /// Relaxation and barrier parameter fall together, and every problem is solved loosely.
    Coupled = 0,
    /// Every problem is solved to the tolerance, from a larger barrier parameter again.
    Outer = 1,
}

impl Homotopy {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["coupled", "outer"];
    const ALL: [Homotopy; 2] = [Homotopy::Coupled, Homotopy::Outer];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Integration method of the modes in event-driven simulation (option integration).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integration {
    /// An explicit pair chosen by the tolerance, that of order 5 where switches cut one step after the other short; Radau IIA in modes that turn out to be stiff.
    Auto = 0,
    /// Dormand and Prince 5(4).
    Dp5 = 1,
    /// Dormand and Prince 8(5,3).
    Dop853 = 2,
    /// Radau IIA of order 5.
    Radau5 = 3,
}

impl Integration {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["auto", "dp5", "dop853", "radau5"];
    const ALL: [Integration; 4] = [Integration::Auto, Integration::Dp5, Integration::Dop853, Integration::Radau5];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Continuation of an event-driven simulation where switches accumulate (option zeno).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZenoPolicy {
    /// Go on in the sliding mode on the surfaces where the switches accumulate, also in one of order two, whose indicators have no rate either. Without such a mode go on by steps with a stated error. Derivatives are NaN behind a mode of order two.
    Continue = 0,
    /// End the run with the outcome zeno.
    Stop = 1,
    /// Pass the accumulation by steps of a method that needs no switches, which also finds a sliding mode that begins there. Slower and less accurate than continue. Derivatives are NaN behind it.
    TimeStepping = 2,
}

impl ZenoPolicy {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["continue", "stop", "time_stepping"];
    const ALL: [ZenoPolicy; 3] = [ZenoPolicy::Continue, ZenoPolicy::Stop, ZenoPolicy::TimeStepping];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Continuation of an event-driven simulation where it is not unique (option ambiguity).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AmbiguityPolicy {
    /// Keep the present active set if it may continue, else take the fewest active cells, else the lowest indices.
    First = 0,
    /// End the run with the outcome ambiguous.
    Stop = 1,
    /// Take the continuation whose active modes come first in the list of preferred modes; among equals as first.
    Prefer = 2,
}

impl AmbiguityPolicy {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["first", "stop", "prefer"];
    const ALL: [AmbiguityPolicy; 3] = [AmbiguityPolicy::First, AmbiguityPolicy::Stop, AmbiguityPolicy::Prefer];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Velocity of a sliding mode where surfaces meet and their effects multiply (option selection).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selection {
    /// Every surface has a weight, and weights of modes are their products, as independent smoothings of the surfaces lead to.
    Bilinear = 0,
    /// Moments method for two surfaces: modes are balanced by the norms of their rates. Where more surfaces meet the simulation stops.
    Moments = 1,
    /// Weights of the least Euclidean norm, as long as none of them vanishes.
    Norm = 2,
    /// Fewest active cells that keep the surfaces: an extreme velocity.
    Fewest = 3,
}

impl Selection {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["bilinear", "moments", "norm", "fewest"];
    const ALL: [Selection; 4] = [Selection::Bilinear, Selection::Moments, Selection::Norm, Selection::Fewest];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Verbosity of the log sink; each level contains the ones before it (option log_level).
#[repr(i64)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogLevel {
    /// Nothing.
    Silent = 0,
    /// Failures.
    Error = 1,
    /// Results that need attention.
    Warning = 2,
    /// One summary per solve.
    Info = 3,
    /// One line per iteration.
    Debug = 4,
    /// Inner steps: line search, factorisations, active-set changes.
    Trace = 5,
}

impl LogLevel {
    /// Value names, by value.
    pub const NAMES: &'static [&'static str] = &["silent", "error", "warning", "info", "debug", "trace"];
    const ALL: [LogLevel; 6] = [LogLevel::Silent, LogLevel::Error, LogLevel::Warning, LogLevel::Info, LogLevel::Debug, LogLevel::Trace];

    /// Value of this number; `None` outside the enumeration.
    pub fn from_i64(value: i64) -> Option<Self> {
        Self::ALL.get(usize::try_from(value).ok()?).copied()
    }

    /// Name of the value.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

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
    /// Limit on the wall time of one solve in seconds, with guesses, certificate, comparison and further rounds. The solve ends at most one factorisation or 16 model evaluations later, and returns the best point so far. A model function that runs is not interrupted.
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
    /// Barrier parameter of a relaxed problem as a multiple of its relaxation.
    pub mu_over_sigma: f64,
    /// Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses.
    pub plateau_mu: f64,
    /// Constraint violation at which the first problem, at sigma_init, counts as solved.
    pub plateau_viol: f64,
    /// Identify the active set and solve the smooth problem that remains (enum polish).
    pub polish: i64,
    /// Tolerance of the solution after the option polish.
    pub polish_tol: f64,
    /// Initial guess of a solve without a guess of the states (enum initial_guess).
    pub initial_guess: i64,
    /// Verbosity of the log sink (enum log_level).
    pub log_level: i64,
    /// Factorisation of the Newton matrices (enum linear_solver).
    pub linear_solver: i64,
    /// Order of elimination in the Newton matrices (enum ordering).
    pub ordering: i64,
    /// Scale objective and rows by their gradients at the starting point (enum toggle).
    pub scaling: i64,
    /// Start the pairs of a program on the central path instead of at the starting point (enum toggle).
    pub centre_pairs: i64,
    /// Limit the multipliers of products pair by pair before the whole Hessian is perturbed (enum toggle).
    pub convexify_pairs: i64,
    /// Polish with a clear active set before the relaxation is small (enum toggle).
    pub early_polish: i64,
    /// Solve the square system of the active set by Newton's method (enum toggle).
    pub square_newton: i64,
    /// Certify exact points, and follow descent directions from points that are not B-stationary (enum toggle).
    pub certify: i64,
    /// Number of homotopy steps that may be repeated from the last relaxation with a smaller reduction, when steps at the next one stay short.
    pub sigma_retries: i64,
    /// Limit on the second-order corrections of an interior-point step.
    pub max_soc: i64,
    /// Restore feasibility after several tiny interior-point steps in a row (enum toggle).
    pub restore_tiny: i64,
    /// Relaxation or penalty in the place of the complementarity constraints until the active set is identified (enum relaxation).
    pub relaxation: i64,
    /// Changes of relaxation or penalty and barrier parameter: together, or one problem after the other (enum homotopy).
    pub homotopy: i64,
    /// First penalty parameter of the penalties among the relaxations; sigma is its inverse.
    pub penalty_init: f64,
    /// Compare a solution of optimal control with an event-driven simulation of its controls (enum toggle).
    pub accuracy: i64,
    /// Relative and absolute tolerance of the simulation that the option accuracy compares a solution of optimal control with.
    pub accuracy_tol: f64,
    /// Mode sequences that a search tries before it ends of itself; 0: as many as its effort says.
    pub mode_search: i64,
    /// Complementarity form of switching terms (enum dcs_form).
    pub dcs_form: i64,
    /// Largest number of factors in a product of the Heaviside form; longer products are lifted.
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
    /// Limit on the steps of an event-driven simulation, accepted and rejected.
    pub max_steps: i64,
    /// Limit on the switches in the log of an event-driven simulation; further ones are only counted.
    pub max_switches: i64,
    /// Continuation of an event-driven simulation where switches accumulate (enum zeno_policy).
    pub zeno: i64,
    /// Continuation of an event-driven simulation where it is not unique (enum ambiguity_policy).
    pub ambiguity: i64,
    /// Keep the dense output of an event-driven simulation (enum toggle).
    pub dense: i64,
    /// Compute the derivatives of an event-driven simulation and of its switching times (enum sensitivity).
    pub sensitivity: i64,
    /// Record an event-driven simulation for adjoint derivatives (enum toggle).
    pub adjoint: i64,
    /// Compute by another solve the least violation of constraints that cannot be met (enum toggle).
    pub explain: i64,
    /// Error at the ends of the control stages down to which the grid of an optimal control problem is refined; 0: the grid stays.
    pub adapt_tol: f64,
    /// Limit on the number of refined grids of an optimal control problem, when adapt_tol is positive.
    pub adapt_rounds: i64,
    /// Limit on the finite elements of a refined grid over all control stages, when adapt_tol is positive.
    pub adapt_elements: i64,
    /// Limit on the bytes that building, solving or simulating may take; 0: no limit.
    pub max_memory: i64,
    /// Search for the solution of an optimal control problem (enum ocp_start).
    pub ocp_start: i64,
    /// Strategies for a program with complementarity constraints within its iterations (enum portfolio).
    pub portfolio: i64,
    /// Velocity of a sliding mode where surfaces meet and their effects multiply. Where the chosen rule has no weights between 0 and 1, an extreme velocity is taken (enum selection).
    pub selection: i64,
    /// Work of a search after its last gain as a multiple of that until it: more finds better optima, less ends sooner.
    pub search_effort: f64,
    /// Share of the cost by which a solution has to be better for a search to go on for it: smaller gains are taken, but not worked for.
    pub search_gain: f64,
    /// Random controls that a search draws and simulates at a time; 0: none.
    pub search_samples: i64,
    /// Seed of the random controls of a search.
    pub search_seed: i64,
    /// Work of an exact search over choices at most, in variables of a program times iterations, or states times steps of simulations; 0: none.
    pub search_exact: f64,
    /// Dense output keeps at least so many of the last steps, and at most a quarter more: older ones are dropped; 0: all.
    pub dense_steps: i64,
    /// Work of a branch and bound over the branches of a program with linear rows and a convex quadratic objective at most, in entries of tableaus; 0: none. Where it is enough the solution is global, with proof, or the program is shown to be infeasible. Other programs get a tenth of it for every model of them that is searched for better branches.
    pub branch_work: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            struct_size: std::mem::size_of::<Settings>() as u64,
            rk_family: 0,
            n_s: 3,
            n_fe: 3,
            discretisation: 0,
            stage_form: 0,
            cross: 0,
            step_equilibration: 2,
            rho_h: 1.0,
            gamma_h: 1.0,
            tol: 1e-9,
            max_iter: 3000,
            max_time: f64::INFINITY,
            mu_init: 0.1,
            sigma_init: 1.0,
            sigma_min: 1e-9,
            sigma_factor: 0.1,
            sigma_exponent: 1.5,
            mu_over_sigma: 0.1,
            plateau_mu: 0.0,
            plateau_viol: 0.0001,
            polish: 1,
            polish_tol: 1e-12,
            initial_guess: 0,
            log_level: 0,
            linear_solver: 0,
            ordering: 0,
            scaling: 1,
            centre_pairs: 1,
            convexify_pairs: 1,
            early_polish: 1,
            square_newton: 1,
            certify: 1,
            sigma_retries: 4,
            max_soc: 4,
            restore_tiny: 1,
            relaxation: 0,
            homotopy: 0,
            penalty_init: 1.0,
            accuracy: 1,
            accuracy_tol: 1e-11,
            mode_search: 0,
            dcs_form: 0,
            lift_depth: 2,
            integration: 0,
            rtol: 1e-8,
            atol: 1e-10,
            h_init: 0.0,
            h_max: f64::INFINITY,
            max_steps: 10000000,
            max_switches: 1000000,
            zeno: 0,
            ambiguity: 0,
            dense: 0,
            sensitivity: 0,
            adjoint: 0,
            explain: 1,
            adapt_tol: 0.0,
            adapt_rounds: 10,
            adapt_elements: 1000,
            max_memory: 0,
            ocp_start: 0,
            portfolio: 1,
            selection: 0,
            search_effort: 1.0,
            search_gain: 0.001,
            search_samples: 64,
            search_seed: 0,
            search_exact: 2000000.0,
            dense_steps: 0,
            branch_work: 1000000.0,
        }
    }
}

/// All options, in the order of the fields of [`Settings`].
pub static OPTIONS: &[OptionInfo] = &[
    OptionInfo {
        name: "rk_family",
        group: "discretisation",
        kind: Kind::Enum(RkFamily::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(6.0),
        symbol: "",
        doc: "Runge-Kutta family (enum rk_family).",
        setup_only: true,
        offset: offset_of!(Settings, rk_family),
        get: |s| s.rk_family as f64,
        set: |s, v| s.rk_family = v as i64,
    },
    OptionInfo {
        name: "n_s",
        group: "discretisation",
        kind: Kind::Int,
        default: 3.0,
        min: Closed(1.0),
        max: Closed(9.0),
        symbol: "n_s",
        doc: "Stage points of the Runge-Kutta method.",
        setup_only: true,
        offset: offset_of!(Settings, n_s),
        get: |s| s.n_s as f64,
        set: |s, v| s.n_s = v as i64,
    },
    OptionInfo {
        name: "n_fe",
        group: "discretisation",
        kind: Kind::Int,
        default: 3.0,
        min: Closed(1.0),
        max: Closed(1000.0),
        symbol: "N_FE",
        doc: "Finite elements of a control stage or a simulation step.",
        setup_only: true,
        offset: offset_of!(Settings, n_fe),
        get: |s| s.n_fe as f64,
        set: |s, v| s.n_fe = v as i64,
    },
    OptionInfo {
        name: "discretisation",
        group: "discretisation",
        kind: Kind::Enum(Discretisation::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Treatment of switches: moving element boundaries or fixed steps (enum discretisation).",
        setup_only: true,
        offset: offset_of!(Settings, discretisation),
        get: |s| s.discretisation as f64,
        set: |s, v| s.discretisation = v as i64,
    },
    OptionInfo {
        name: "stage_form",
        group: "discretisation",
        kind: Kind::Enum(StageForm::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2.0),
        symbol: "",
        doc: "Unknowns at the stage points (enum stage_form).",
        setup_only: true,
        offset: offset_of!(Settings, stage_form),
        get: |s| s.stage_form as f64,
        set: |s, v| s.stage_form = v as i64,
    },
    OptionInfo {
        name: "cross",
        group: "discretisation",
        kind: Kind::Enum(Cross::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(3.0),
        symbol: "",
        doc: "Granularity of the cross complementarity (enum cross).",
        setup_only: true,
        offset: offset_of!(Settings, cross),
        get: |s| s.cross as f64,
        set: |s, v| s.cross = v as i64,
    },
    OptionInfo {
        name: "step_equilibration",
        group: "discretisation",
        kind: Kind::Enum(StepEquilibration::NAMES),
        default: 2.0,
        min: Closed(0.0),
        max: Closed(6.0),
        symbol: "",
        doc: "Step equilibration during the homotopy (enum step_equilibration).",
        setup_only: true,
        offset: offset_of!(Settings, step_equilibration),
        get: |s| s.step_equilibration as f64,
        set: |s, v| s.step_equilibration = v as i64,
    },
    OptionInfo {
        name: "rho_h",
        group: "discretisation",
        kind: Kind::Float,
        default: 1.0,
        min: Closed(0.0),
        max: Open(f64::INFINITY),
        symbol: "rho_h",
        doc: "Weight of the soft step equilibration, in optimal control in multiples of the steepest change of the cost.",
        setup_only: false,
        offset: offset_of!(Settings, rho_h),
        get: |s| s.rho_h,
        set: |s, v| s.rho_h = v,
    },
    OptionInfo {
        name: "gamma_h",
        group: "discretisation",
        kind: Kind::Float,
        default: 1.0,
        min: Open(0.0),
        max: Closed(1.0),
        symbol: "gamma_h",
        doc: "Step sizes stay between (1 - gamma_h) and (1 + gamma_h) times the nominal one.",
        setup_only: false,
        offset: offset_of!(Settings, gamma_h),
        get: |s| s.gamma_h,
        set: |s, v| s.gamma_h = v,
    },
    OptionInfo {
        name: "tol",
        group: "relaxation",
        kind: Kind::Float,
        default: 1e-9,
        min: Open(0.0),
        max: Open(1.0),
        symbol: "epsilon_tol",
        doc: "Convergence tolerance of the interior point at sigma = 0, before polishing.",
        setup_only: false,
        offset: offset_of!(Settings, tol),
        get: |s| s.tol,
        set: |s, v| s.tol = v,
    },
    OptionInfo {
        name: "max_iter",
        group: "limits",
        kind: Kind::Int,
        default: 3000.0,
        min: Closed(0.0),
        max: Closed(1000000000.0),
        symbol: "",
        doc: "Limit on the interior point iterations of one solve, over all homotopy steps.",
        setup_only: false,
        offset: offset_of!(Settings, max_iter),
        get: |s| s.max_iter as f64,
        set: |s, v| s.max_iter = v as i64,
    },
    OptionInfo {
        name: "max_time",
        group: "limits",
        kind: Kind::Float,
        default: f64::INFINITY,
        min: Closed(0.0),
        max: Closed(f64::INFINITY),
        symbol: "",
        doc: "Limit on the wall time of one solve in seconds, with guesses, certificate, comparison and further rounds. The solve ends at most one factorisation or 16 model evaluations later, and returns the best point so far. A model function that runs is not interrupted.",
        setup_only: false,
        offset: offset_of!(Settings, max_time),
        get: |s| s.max_time,
        set: |s, v| s.max_time = v,
    },
    OptionInfo {
        name: "mu_init",
        group: "relaxation",
        kind: Kind::Float,
        default: 0.1,
        min: Open(0.0),
        max: Closed(1000000000000000.0),
        symbol: "mu_0",
        doc: "Initial barrier parameter.",
        setup_only: false,
        offset: offset_of!(Settings, mu_init),
        get: |s| s.mu_init,
        set: |s, v| s.mu_init = v,
    },
    OptionInfo {
        name: "sigma_init",
        group: "relaxation",
        kind: Kind::Float,
        default: 1.0,
        min: Open(0.0),
        max: Closed(1000000000000000.0),
        symbol: "sigma_0",
        doc: "Initial relaxation of the complementarity.",
        setup_only: false,
        offset: offset_of!(Settings, sigma_init),
        get: |s| s.sigma_init,
        set: |s, v| s.sigma_init = v,
    },
    OptionInfo {
        name: "sigma_min",
        group: "relaxation",
        kind: Kind::Float,
        default: 1e-9,
        min: Open(0.0),
        max: Closed(1.0),
        symbol: "sigma_N",
        doc: "Smallest relaxation of the complementarity.",
        setup_only: false,
        offset: offset_of!(Settings, sigma_min),
        get: |s| s.sigma_min,
        set: |s, v| s.sigma_min = v,
    },
    OptionInfo {
        name: "sigma_factor",
        group: "relaxation",
        kind: Kind::Float,
        default: 0.1,
        min: Open(0.0),
        max: Open(1.0),
        symbol: "kappa_sigma",
        doc: "Linear reduction of the relaxation: sigma becomes at most sigma_factor sigma.",
        setup_only: false,
        offset: offset_of!(Settings, sigma_factor),
        get: |s| s.sigma_factor,
        set: |s, v| s.sigma_factor = v,
    },
    OptionInfo {
        name: "sigma_exponent",
        group: "relaxation",
        kind: Kind::Float,
        default: 1.5,
        min: Closed(1.0),
        max: Closed(3.0),
        symbol: "theta_sigma",
        doc: "Superlinear reduction of the relaxation: sigma becomes at most sigma^sigma_exponent.",
        setup_only: false,
        offset: offset_of!(Settings, sigma_exponent),
        get: |s| s.sigma_exponent,
        set: |s, v| s.sigma_exponent = v,
    },
    OptionInfo {
        name: "mu_over_sigma",
        group: "relaxation",
        kind: Kind::Float,
        default: 0.1,
        min: Open(0.0),
        max: Closed(1000.0),
        symbol: "",
        doc: "Barrier parameter of a relaxed problem as a multiple of its relaxation.",
        setup_only: false,
        offset: offset_of!(Settings, mu_over_sigma),
        get: |s| s.mu_over_sigma,
        set: |s, v| s.mu_over_sigma = v,
    },
    OptionInfo {
        name: "plateau_mu",
        group: "relaxation",
        kind: Kind::Float,
        default: 0.0,
        min: Closed(0.0),
        max: Open(f64::INFINITY),
        symbol: "",
        doc: "Barrier parameter at which the first problem, at sigma_init, counts as solved; 0: the library chooses.",
        setup_only: false,
        offset: offset_of!(Settings, plateau_mu),
        get: |s| s.plateau_mu,
        set: |s, v| s.plateau_mu = v,
    },
    OptionInfo {
        name: "plateau_viol",
        group: "relaxation",
        kind: Kind::Float,
        default: 0.0001,
        min: Open(0.0),
        max: Open(f64::INFINITY),
        symbol: "",
        doc: "Constraint violation at which the first problem, at sigma_init, counts as solved.",
        setup_only: false,
        offset: offset_of!(Settings, plateau_viol),
        get: |s| s.plateau_viol,
        set: |s, v| s.plateau_viol = v,
    },
    OptionInfo {
        name: "polish",
        group: "answer",
        kind: Kind::Enum(Polish::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Identify the active set and solve the smooth problem that remains (enum polish).",
        setup_only: false,
        offset: offset_of!(Settings, polish),
        get: |s| s.polish as f64,
        set: |s, v| s.polish = v as i64,
    },
    OptionInfo {
        name: "polish_tol",
        group: "answer",
        kind: Kind::Float,
        default: 1e-12,
        min: Open(0.0),
        max: Open(1.0),
        symbol: "",
        doc: "Tolerance of the solution after the option polish.",
        setup_only: false,
        offset: offset_of!(Settings, polish_tol),
        get: |s| s.polish_tol,
        set: |s, v| s.polish_tol = v,
    },
    OptionInfo {
        name: "initial_guess",
        group: "control",
        kind: Kind::Enum(InitialGuess::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(3.0),
        symbol: "",
        doc: "Initial guess of a solve without a guess of the states (enum initial_guess).",
        setup_only: false,
        offset: offset_of!(Settings, initial_guess),
        get: |s| s.initial_guess as f64,
        set: |s, v| s.initial_guess = v as i64,
    },
    OptionInfo {
        name: "log_level",
        group: "limits",
        kind: Kind::Enum(LogLevel::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(5.0),
        symbol: "",
        doc: "Verbosity of the log sink (enum log_level).",
        setup_only: false,
        offset: offset_of!(Settings, log_level),
        get: |s| s.log_level as f64,
        set: |s, v| s.log_level = v as i64,
    },
    OptionInfo {
        name: "linear_solver",
        group: "newton",
        kind: Kind::Enum(LinearSolver::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(3.0),
        symbol: "",
        doc: "Factorisation of the Newton matrices (enum linear_solver).",
        setup_only: true,
        offset: offset_of!(Settings, linear_solver),
        get: |s| s.linear_solver as f64,
        set: |s, v| s.linear_solver = v as i64,
    },
    OptionInfo {
        name: "ordering",
        group: "newton",
        kind: Kind::Enum(Ordering::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Order of elimination in the Newton matrices (enum ordering).",
        setup_only: true,
        offset: offset_of!(Settings, ordering),
        get: |s| s.ordering as f64,
        set: |s, v| s.ordering = v as i64,
    },
    OptionInfo {
        name: "scaling",
        group: "newton",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Scale objective and rows by their gradients at the starting point (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, scaling),
        get: |s| s.scaling as f64,
        set: |s, v| s.scaling = v as i64,
    },
    OptionInfo {
        name: "centre_pairs",
        group: "relaxation",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Start the pairs of a program on the central path instead of at the starting point (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, centre_pairs),
        get: |s| s.centre_pairs as f64,
        set: |s, v| s.centre_pairs = v as i64,
    },
    OptionInfo {
        name: "convexify_pairs",
        group: "newton",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Limit the multipliers of products pair by pair before the whole Hessian is perturbed (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, convexify_pairs),
        get: |s| s.convexify_pairs as f64,
        set: |s, v| s.convexify_pairs = v as i64,
    },
    OptionInfo {
        name: "early_polish",
        group: "answer",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Polish with a clear active set before the relaxation is small (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, early_polish),
        get: |s| s.early_polish as f64,
        set: |s, v| s.early_polish = v as i64,
    },
    OptionInfo {
        name: "square_newton",
        group: "answer",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Solve the square system of the active set by Newton's method (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, square_newton),
        get: |s| s.square_newton as f64,
        set: |s, v| s.square_newton = v as i64,
    },
    OptionInfo {
        name: "certify",
        group: "answer",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Certify exact points, and follow descent directions from points that are not B-stationary (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, certify),
        get: |s| s.certify as f64,
        set: |s, v| s.certify = v as i64,
    },
    OptionInfo {
        name: "sigma_retries",
        group: "relaxation",
        kind: Kind::Int,
        default: 4.0,
        min: Closed(0.0),
        max: Closed(100.0),
        symbol: "",
        doc: "Number of homotopy steps that may be repeated from the last relaxation with a smaller reduction, when steps at the next one stay short.",
        setup_only: false,
        offset: offset_of!(Settings, sigma_retries),
        get: |s| s.sigma_retries as f64,
        set: |s, v| s.sigma_retries = v as i64,
    },
    OptionInfo {
        name: "max_soc",
        group: "newton",
        kind: Kind::Int,
        default: 4.0,
        min: Closed(0.0),
        max: Closed(100.0),
        symbol: "",
        doc: "Limit on the second-order corrections of an interior-point step.",
        setup_only: false,
        offset: offset_of!(Settings, max_soc),
        get: |s| s.max_soc as f64,
        set: |s, v| s.max_soc = v as i64,
    },
    OptionInfo {
        name: "restore_tiny",
        group: "newton",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Restore feasibility after several tiny interior-point steps in a row (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, restore_tiny),
        get: |s| s.restore_tiny as f64,
        set: |s, v| s.restore_tiny = v as i64,
    },
    OptionInfo {
        name: "relaxation",
        group: "relaxation",
        kind: Kind::Enum(Relaxation::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(17.0),
        symbol: "",
        doc: "Relaxation or penalty in the place of the complementarity constraints until the active set is identified (enum relaxation).",
        setup_only: true,
        offset: offset_of!(Settings, relaxation),
        get: |s| s.relaxation as f64,
        set: |s, v| s.relaxation = v as i64,
    },
    OptionInfo {
        name: "homotopy",
        group: "relaxation",
        kind: Kind::Enum(Homotopy::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Changes of relaxation or penalty and barrier parameter: together, or one problem after the other (enum homotopy).",
        setup_only: false,
        offset: offset_of!(Settings, homotopy),
        get: |s| s.homotopy as f64,
        set: |s, v| s.homotopy = v as i64,
    },
    OptionInfo {
        name: "penalty_init",
        group: "relaxation",
        kind: Kind::Float,
        default: 1.0,
        min: Closed(1e-9),
        max: Closed(1000000000.0),
        symbol: "rho_0",
        doc: "First penalty parameter of the penalties among the relaxations; sigma is its inverse.",
        setup_only: false,
        offset: offset_of!(Settings, penalty_init),
        get: |s| s.penalty_init,
        set: |s, v| s.penalty_init = v,
    },
    OptionInfo {
        name: "accuracy",
        group: "control",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Compare a solution of optimal control with an event-driven simulation of its controls (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, accuracy),
        get: |s| s.accuracy as f64,
        set: |s, v| s.accuracy = v as i64,
    },
    OptionInfo {
        name: "accuracy_tol",
        group: "control",
        kind: Kind::Float,
        default: 1e-11,
        min: Closed(1e-13),
        max: Closed(0.01),
        symbol: "",
        doc: "Relative and absolute tolerance of the simulation that the option accuracy compares a solution of optimal control with.",
        setup_only: false,
        offset: offset_of!(Settings, accuracy_tol),
        get: |s| s.accuracy_tol,
        set: |s, v| s.accuracy_tol = v,
    },
    OptionInfo {
        name: "mode_search",
        group: "search",
        kind: Kind::Int,
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1000000.0),
        symbol: "",
        doc: "Mode sequences that a search tries before it ends of itself; 0: as many as its effort says.",
        setup_only: false,
        offset: offset_of!(Settings, mode_search),
        get: |s| s.mode_search as f64,
        set: |s, v| s.mode_search = v as i64,
    },
    OptionInfo {
        name: "dcs_form",
        group: "discretisation",
        kind: Kind::Enum(DcsForm::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2.0),
        symbol: "",
        doc: "Complementarity form of switching terms (enum dcs_form).",
        setup_only: true,
        offset: offset_of!(Settings, dcs_form),
        get: |s| s.dcs_form as f64,
        set: |s, v| s.dcs_form = v as i64,
    },
    OptionInfo {
        name: "lift_depth",
        group: "discretisation",
        kind: Kind::Int,
        default: 2.0,
        min: Closed(2.0),
        max: Closed(64.0),
        symbol: "n_d",
        doc: "Largest number of factors in a product of the Heaviside form; longer products are lifted.",
        setup_only: true,
        offset: offset_of!(Settings, lift_depth),
        get: |s| s.lift_depth as f64,
        set: |s, v| s.lift_depth = v as i64,
    },
    OptionInfo {
        name: "integration",
        group: "events",
        kind: Kind::Enum(Integration::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(3.0),
        symbol: "",
        doc: "Integration method of the modes in event-driven simulation (enum integration).",
        setup_only: false,
        offset: offset_of!(Settings, integration),
        get: |s| s.integration as f64,
        set: |s, v| s.integration = v as i64,
    },
    OptionInfo {
        name: "rtol",
        group: "events",
        kind: Kind::Float,
        default: 1e-8,
        min: Closed(0.0),
        max: Open(1.0),
        symbol: "",
        doc: "Relative tolerance of the local error in event-driven simulation.",
        setup_only: false,
        offset: offset_of!(Settings, rtol),
        get: |s| s.rtol,
        set: |s, v| s.rtol = v,
    },
    OptionInfo {
        name: "atol",
        group: "events",
        kind: Kind::Float,
        default: 1e-10,
        min: Closed(0.0),
        max: Open(f64::INFINITY),
        symbol: "",
        doc: "Absolute tolerance of the local error in event-driven simulation.",
        setup_only: false,
        offset: offset_of!(Settings, atol),
        get: |s| s.atol,
        set: |s, v| s.atol = v,
    },
    OptionInfo {
        name: "h_init",
        group: "events",
        kind: Kind::Float,
        default: 0.0,
        min: Closed(0.0),
        max: Open(f64::INFINITY),
        symbol: "h_0",
        doc: "First step of an event-driven simulation; 0: the library chooses.",
        setup_only: false,
        offset: offset_of!(Settings, h_init),
        get: |s| s.h_init,
        set: |s, v| s.h_init = v,
    },
    OptionInfo {
        name: "h_max",
        group: "events",
        kind: Kind::Float,
        default: f64::INFINITY,
        min: Open(0.0),
        max: Closed(f64::INFINITY),
        symbol: "",
        doc: "Longest step of an event-driven simulation.",
        setup_only: false,
        offset: offset_of!(Settings, h_max),
        get: |s| s.h_max,
        set: |s, v| s.h_max = v,
    },
    OptionInfo {
        name: "max_steps",
        group: "events",
        kind: Kind::Int,
        default: 10000000.0,
        min: Closed(0.0),
        max: Closed(1000000000000000.0),
        symbol: "",
        doc: "Limit on the steps of an event-driven simulation, accepted and rejected.",
        setup_only: false,
        offset: offset_of!(Settings, max_steps),
        get: |s| s.max_steps as f64,
        set: |s, v| s.max_steps = v as i64,
    },
    OptionInfo {
        name: "max_switches",
        group: "events",
        kind: Kind::Int,
        default: 1000000.0,
        min: Closed(0.0),
        max: Closed(1000000000000000.0),
        symbol: "",
        doc: "Limit on the switches in the log of an event-driven simulation; further ones are only counted.",
        setup_only: false,
        offset: offset_of!(Settings, max_switches),
        get: |s| s.max_switches as f64,
        set: |s, v| s.max_switches = v as i64,
    },
    OptionInfo {
        name: "zeno",
        group: "events",
        kind: Kind::Enum(ZenoPolicy::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2.0),
        symbol: "",
        doc: "Continuation of an event-driven simulation where switches accumulate (enum zeno_policy).",
        setup_only: false,
        offset: offset_of!(Settings, zeno),
        get: |s| s.zeno as f64,
        set: |s, v| s.zeno = v as i64,
    },
    OptionInfo {
        name: "ambiguity",
        group: "events",
        kind: Kind::Enum(AmbiguityPolicy::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2.0),
        symbol: "",
        doc: "Continuation of an event-driven simulation where it is not unique (enum ambiguity_policy).",
        setup_only: false,
        offset: offset_of!(Settings, ambiguity),
        get: |s| s.ambiguity as f64,
        set: |s, v| s.ambiguity = v as i64,
    },
    OptionInfo {
        name: "dense",
        group: "events",
        kind: Kind::Enum(Switch::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Keep the dense output of an event-driven simulation (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, dense),
        get: |s| s.dense as f64,
        set: |s, v| s.dense = v as i64,
    },
    OptionInfo {
        name: "sensitivity",
        group: "events",
        kind: Kind::Enum(Sensitivity::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2.0),
        symbol: "",
        doc: "Compute the derivatives of an event-driven simulation and of its switching times (enum sensitivity).",
        setup_only: false,
        offset: offset_of!(Settings, sensitivity),
        get: |s| s.sensitivity as f64,
        set: |s, v| s.sensitivity = v as i64,
    },
    OptionInfo {
        name: "adjoint",
        group: "events",
        kind: Kind::Enum(Switch::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Record an event-driven simulation for adjoint derivatives (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, adjoint),
        get: |s| s.adjoint as f64,
        set: |s, v| s.adjoint = v as i64,
    },
    OptionInfo {
        name: "explain",
        group: "answer",
        kind: Kind::Enum(Switch::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Compute by another solve the least violation of constraints that cannot be met (enum toggle).",
        setup_only: false,
        offset: offset_of!(Settings, explain),
        get: |s| s.explain as f64,
        set: |s, v| s.explain = v as i64,
    },
    OptionInfo {
        name: "adapt_tol",
        group: "control",
        kind: Kind::Float,
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1.0),
        symbol: "",
        doc: "Error at the ends of the control stages down to which the grid of an optimal control problem is refined; 0: the grid stays.",
        setup_only: false,
        offset: offset_of!(Settings, adapt_tol),
        get: |s| s.adapt_tol,
        set: |s, v| s.adapt_tol = v,
    },
    OptionInfo {
        name: "adapt_rounds",
        group: "control",
        kind: Kind::Int,
        default: 10.0,
        min: Closed(0.0),
        max: Closed(1000.0),
        symbol: "",
        doc: "Limit on the number of refined grids of an optimal control problem, when adapt_tol is positive.",
        setup_only: false,
        offset: offset_of!(Settings, adapt_rounds),
        get: |s| s.adapt_rounds as f64,
        set: |s, v| s.adapt_rounds = v as i64,
    },
    OptionInfo {
        name: "adapt_elements",
        group: "control",
        kind: Kind::Int,
        default: 1000.0,
        min: Closed(1.0),
        max: Closed(1000000.0),
        symbol: "",
        doc: "Limit on the finite elements of a refined grid over all control stages, when adapt_tol is positive.",
        setup_only: false,
        offset: offset_of!(Settings, adapt_elements),
        get: |s| s.adapt_elements as f64,
        set: |s, v| s.adapt_elements = v as i64,
    },
    OptionInfo {
        name: "max_memory",
        group: "limits",
        kind: Kind::Int,
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1000000000000000.0),
        symbol: "",
        doc: "Limit on the bytes that building, solving or simulating may take; 0: no limit.",
        setup_only: false,
        offset: offset_of!(Settings, max_memory),
        get: |s| s.max_memory as f64,
        set: |s, v| s.max_memory = v as i64,
    },
    OptionInfo {
        name: "ocp_start",
        group: "search",
        kind: Kind::Enum(OcpStart::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2.0),
        symbol: "",
        doc: "Search for the solution of an optimal control problem (enum ocp_start).",
        setup_only: false,
        offset: offset_of!(Settings, ocp_start),
        get: |s| s.ocp_start as f64,
        set: |s, v| s.ocp_start = v as i64,
    },
    OptionInfo {
        name: "portfolio",
        group: "relaxation",
        kind: Kind::Enum(Portfolio::NAMES),
        default: 1.0,
        min: Closed(0.0),
        max: Closed(3.0),
        symbol: "",
        doc: "Strategies for a program with complementarity constraints within its iterations (enum portfolio).",
        setup_only: false,
        offset: offset_of!(Settings, portfolio),
        get: |s| s.portfolio as f64,
        set: |s, v| s.portfolio = v as i64,
    },
    OptionInfo {
        name: "selection",
        group: "events",
        kind: Kind::Enum(Selection::NAMES),
        default: 0.0,
        min: Closed(0.0),
        max: Closed(3.0),
        symbol: "",
        doc: "Velocity of a sliding mode where surfaces meet and their effects multiply. Where the chosen rule has no weights between 0 and 1, an extreme velocity is taken (enum selection).",
        setup_only: false,
        offset: offset_of!(Settings, selection),
        get: |s| s.selection as f64,
        set: |s, v| s.selection = v as i64,
    },
    OptionInfo {
        name: "search_effort",
        group: "search",
        kind: Kind::Float,
        default: 1.0,
        min: Closed(0.0),
        max: Closed(1000000.0),
        symbol: "",
        doc: "Work of a search after its last gain as a multiple of that until it: more finds better optima, less ends sooner.",
        setup_only: false,
        offset: offset_of!(Settings, search_effort),
        get: |s| s.search_effort,
        set: |s, v| s.search_effort = v,
    },
    OptionInfo {
        name: "search_gain",
        group: "search",
        kind: Kind::Float,
        default: 0.001,
        min: Closed(1e-9),
        max: Open(1.0),
        symbol: "",
        doc: "Share of the cost by which a solution has to be better for a search to go on for it: smaller gains are taken, but not worked for.",
        setup_only: false,
        offset: offset_of!(Settings, search_gain),
        get: |s| s.search_gain,
        set: |s, v| s.search_gain = v,
    },
    OptionInfo {
        name: "search_samples",
        group: "search",
        kind: Kind::Int,
        default: 64.0,
        min: Closed(0.0),
        max: Closed(1000000.0),
        symbol: "",
        doc: "Random controls that a search draws and simulates at a time; 0: none.",
        setup_only: false,
        offset: offset_of!(Settings, search_samples),
        get: |s| s.search_samples as f64,
        set: |s, v| s.search_samples = v as i64,
    },
    OptionInfo {
        name: "search_seed",
        group: "search",
        kind: Kind::Int,
        default: 0.0,
        min: Closed(0.0),
        max: Closed(2147483647.0),
        symbol: "",
        doc: "Seed of the random controls of a search.",
        setup_only: false,
        offset: offset_of!(Settings, search_seed),
        get: |s| s.search_seed as f64,
        set: |s, v| s.search_seed = v as i64,
    },
    OptionInfo {
        name: "search_exact",
        group: "search",
        kind: Kind::Float,
        default: 2000000.0,
        min: Closed(0.0),
        max: Closed(f64::INFINITY),
        symbol: "",
        doc: "Work of an exact search over choices at most, in variables of a program times iterations, or states times steps of simulations; 0: none.",
        setup_only: false,
        offset: offset_of!(Settings, search_exact),
        get: |s| s.search_exact,
        set: |s, v| s.search_exact = v,
    },
    OptionInfo {
        name: "dense_steps",
        group: "events",
        kind: Kind::Int,
        default: 0.0,
        min: Closed(0.0),
        max: Closed(1000000000.0),
        symbol: "",
        doc: "Dense output keeps at least so many of the last steps, and at most a quarter more: older ones are dropped; 0: all.",
        setup_only: false,
        offset: offset_of!(Settings, dense_steps),
        get: |s| s.dense_steps as f64,
        set: |s, v| s.dense_steps = v as i64,
    },
    OptionInfo {
        name: "branch_work",
        group: "relaxation",
        kind: Kind::Float,
        default: 1000000.0,
        min: Closed(0.0),
        max: Closed(f64::INFINITY),
        symbol: "",
        doc: "Work of a branch and bound over the branches of a program with linear rows and a convex quadratic objective at most, in entries of tableaus; 0: none. Where it is enough the solution is global, with proof, or the program is shown to be infeasible. Other programs get a tenth of it for every model of them that is searched for better branches.",
        setup_only: false,
        offset: offset_of!(Settings, branch_work),
        get: |s| s.branch_work,
        set: |s, v| s.branch_work = v,
    },
];

impl Settings {
    /// [`RkFamily`] of these settings.
    pub fn rk_family(&self) -> Result<RkFamily> {
        RkFamily::from_i64(self.rk_family).ok_or_else(|| bad("rk_family", self.rk_family))
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
        StepEquilibration::from_i64(self.step_equilibration).ok_or_else(|| bad("step_equilibration", self.step_equilibration))
    }

    /// True where the option polish is on.
    pub fn polish(&self) -> bool {
        self.polish != 0
    }

    /// [`InitialGuess`] of these settings.
    pub fn initial_guess(&self) -> Result<InitialGuess> {
        InitialGuess::from_i64(self.initial_guess).ok_or_else(|| bad("initial_guess", self.initial_guess))
    }

    /// [`LogLevel`] of these settings.
    pub fn log_level(&self) -> Result<LogLevel> {
        LogLevel::from_i64(self.log_level).ok_or_else(|| bad("log_level", self.log_level))
    }

    /// [`LinearSolver`] of these settings.
    pub fn linear_solver(&self) -> Result<LinearSolver> {
        LinearSolver::from_i64(self.linear_solver).ok_or_else(|| bad("linear_solver", self.linear_solver))
    }

    /// [`Ordering`] of these settings.
    pub fn ordering(&self) -> Result<Ordering> {
        Ordering::from_i64(self.ordering).ok_or_else(|| bad("ordering", self.ordering))
    }

    /// True where the option scaling is on.
    pub fn scaling(&self) -> bool {
        self.scaling != 0
    }

    /// True where the option centre_pairs is on.
    pub fn centre_pairs(&self) -> bool {
        self.centre_pairs != 0
    }

    /// True where the option convexify_pairs is on.
    pub fn convexify_pairs(&self) -> bool {
        self.convexify_pairs != 0
    }

    /// True where the option early_polish is on.
    pub fn early_polish(&self) -> bool {
        self.early_polish != 0
    }

    /// True where the option square_newton is on.
    pub fn square_newton(&self) -> bool {
        self.square_newton != 0
    }

    /// True where the option certify is on.
    pub fn certify(&self) -> bool {
        self.certify != 0
    }

    /// True where the option restore_tiny is on.
    pub fn restore_tiny(&self) -> bool {
        self.restore_tiny != 0
    }

    /// [`Relaxation`] of these settings.
    pub fn relaxation(&self) -> Result<Relaxation> {
        Relaxation::from_i64(self.relaxation).ok_or_else(|| bad("relaxation", self.relaxation))
    }

    /// [`Homotopy`] of these settings.
    pub fn homotopy(&self) -> Result<Homotopy> {
        Homotopy::from_i64(self.homotopy).ok_or_else(|| bad("homotopy", self.homotopy))
    }

    /// True where the option accuracy is on.
    pub fn accuracy(&self) -> bool {
        self.accuracy != 0
    }

    /// [`DcsForm`] of these settings.
    pub fn dcs_form(&self) -> Result<DcsForm> {
        DcsForm::from_i64(self.dcs_form).ok_or_else(|| bad("dcs_form", self.dcs_form))
    }

    /// [`Integration`] of these settings.
    pub fn integration(&self) -> Result<Integration> {
        Integration::from_i64(self.integration).ok_or_else(|| bad("integration", self.integration))
    }

    /// [`ZenoPolicy`] of these settings.
    pub fn zeno(&self) -> Result<ZenoPolicy> {
        ZenoPolicy::from_i64(self.zeno).ok_or_else(|| bad("zeno", self.zeno))
    }

    /// [`AmbiguityPolicy`] of these settings.
    pub fn ambiguity(&self) -> Result<AmbiguityPolicy> {
        AmbiguityPolicy::from_i64(self.ambiguity).ok_or_else(|| bad("ambiguity", self.ambiguity))
    }

    /// True where the option dense is on.
    pub fn dense(&self) -> bool {
        self.dense != 0
    }

    /// [`Sensitivity`] of these settings.
    pub fn sensitivity(&self) -> Result<Sensitivity> {
        Sensitivity::from_i64(self.sensitivity).ok_or_else(|| bad("sensitivity", self.sensitivity))
    }

    /// True where the option adjoint is on.
    pub fn adjoint(&self) -> bool {
        self.adjoint != 0
    }

    /// True where the option explain is on.
    pub fn explain(&self) -> bool {
        self.explain != 0
    }

    /// [`OcpStart`] of these settings.
    pub fn ocp_start(&self) -> Result<OcpStart> {
        OcpStart::from_i64(self.ocp_start).ok_or_else(|| bad("ocp_start", self.ocp_start))
    }

    /// [`Portfolio`] of these settings.
    pub fn portfolio(&self) -> Result<Portfolio> {
        Portfolio::from_i64(self.portfolio).ok_or_else(|| bad("portfolio", self.portfolio))
    }

    /// [`Selection`] of these settings.
    pub fn selection(&self) -> Result<Selection> {
        Selection::from_i64(self.selection).ok_or_else(|| bad("selection", self.selection))
    }
}
