//! Optimal control: what a problem can be made of beside costs and constraints of one kind; free lengths and parameters.

use super::function::{shared, swb_function};
use super::guard::guard;
use super::handle::{self, running, setting};
use super::ocp::{change, swb_ocp};
use super::raw;
use super::report::outcome_number;
use super::status::swb_status;
use switchback::error::{Error, Result};
use switchback::fesd::PathAt;
use switchback::memory::sizes;
use switchback::ocp::{CostAt, Durations, Norm};

/// Freedom of the optimiser in the lengths of the control stages.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_free_time {
    /// Nothing.
    None = 0,
    /// The horizon; the stages keep their shares of it.
    Horizon = 1,
    /// Every stage.
    Stages = 2,
}

/// Places at which a least-squares term counts.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_cost_at {
    /// Integrated along the horizon.
    Running = 0,
    /// Summed over the ends of the control stages.
    ControlGrid = 1,
    /// At the end of the horizon.
    Terminal = 2,
}

/// How the violation of a relaxed constraint is penalised.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_norm {
    /// Sum of the violations, integrated along the horizon.
    L1 = 0,
    /// Sum of their squares, integrated along the horizon.
    L2 = 1,
    /// The largest violation.
    Linf = 2,
}

fn choose<T: Copy>(all: &[(i32, T)], value: i32, what: &str) -> Result<T> {
    let found = all.iter().find(|c| c.0 == value).map(|c| c.1);
    found.ok_or_else(|| Error::Range(format!("{value} is no {what}")))
}

fn all_sizes(values: &[i64], what: &str) -> Result<Vec<usize>> {
    let size = |v: &i64| {
        if *v < 0 {
            return Err(Error::Range(format!("{what} {v} is negative")));
        }
        sizes::size(*v, what)
    };
    values.iter().map(size).collect()
}

/// Add the constraint lower <= f([x(0); x(T)], u, p, t) <= upper between both ends of the horizon: f has 2 nx states, and sees
/// control and time of the end.
///
/// @param[in] lower [n_lower] one for each output
/// @param[in] upper [n_upper] one for each output
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_boundary(
    ocp: *mut swb_ocp,
    f: *const swb_function,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        let f = shared(f, "f")?;
        change(ocp, |o| o.add_boundary(f, lower, upper))
    })
}

/// Require that states have the same values at both ends of the horizon.
///
/// @param[in] states [n_states] indices of states
/// @return SWB_OK; SWB_ERR_RANGE if there is no such state
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_periodic(ocp: *mut swb_ocp, states: *const i64, n_states: i64) -> swb_status {
    setting(ocp, || unsafe {
        let states = all_sizes(raw::slice(states, n_states, "states")?, "state")?;
        change(ocp, |o| o.add_periodic(&states))
    })
}

/// Add (f - y)' W (f - y) to the cost, integrated, summed over the ends of the control stages, or at the end.
///
/// @param[in] weights    [n_weights] the diagonal of W, one for each output, or all of W
/// @param[in] references [n_references] y, or one y for every control stage
/// @param[in] at         an enum swb_cost_at
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_least_squares(
    ocp: *mut swb_ocp,
    f: *const swb_function,
    weights: *const f64,
    n_weights: i64,
    references: *const f64,
    n_references: i64,
    at: i32,
) -> swb_status {
    setting(ocp, || unsafe {
        let at = choose(
            &[
                (swb_cost_at::Running as i32, CostAt::Running),
                (swb_cost_at::ControlGrid as i32, CostAt::ControlGrid),
                (swb_cost_at::Terminal as i32, CostAt::Terminal),
            ],
            at,
            "enum swb_cost_at",
        )?;
        let weights = raw::slice(weights, n_weights, "weights")?;
        let references = raw::slice(references, n_references, "references")?;
        let f = shared(f, "f")?;
        change(ocp, |o| o.add_least_squares(f, weights, references, at))
    })
}

/// Change the references of a least-squares term.
///
/// @param[in] term       in the order they were added, from 0
/// @param[in] references [n_references] as swb_ocp_add_least_squares
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no such term
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_references(
    ocp: *mut swb_ocp,
    term: i64,
    references: *const f64,
    n_references: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let references = raw::slice(references, n_references, "references")?;
        let term = all_sizes(&[term], "term")?[0];
        change(ocp, |o| o.set_references(term, references))
    })
}

/// Add a constraint that may be violated at a price: weight times the norm of the violation. The cost that is reported is
/// without it; see swb_ocp_get_violation.
///
/// @param[in] lower [n_lower] one for each output
/// @param[in] upper [n_upper] one for each output
/// @param[in] at    an enum swb_path_at, or -1: at the end of the horizon
/// @param[in] norm  an enum swb_norm
/// @return as swb_ocp_add_path; SWB_ERR_RANGE if the weight is not positive
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_relaxed(
    ocp: *mut swb_ocp,
    f: *const swb_function,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
    at: i32,
    norm: i32,
    weight: f64,
) -> swb_status {
    setting(ocp, || unsafe {
        let places =
            [(-1, None), (0, Some(PathAt::ControlGrid)), (1, Some(PathAt::Elements)), (2, Some(PathAt::StagePoints))];
        let at = choose(&places, at, "enum swb_path_at, nor -1")?;
        let norms =
            [(swb_norm::L1 as i32, Norm::L1), (swb_norm::L2 as i32, Norm::L2), (swb_norm::Linf as i32, Norm::Linf)];
        let norm = choose(&norms, norm, "enum swb_norm")?;
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        let f = shared(f, "f")?;
        change(ocp, |o| o.add_relaxed(f, lower, upper, at, norm, weight))
    })
}

/// Add 0 <= a(x,u,p,t) _|_ b(x,u,p,t) >= 0 along the horizon, component by component: both are not negative, and one of them
/// is zero. Pairs of controls alone belong to the control grid; elsewhere they would be said several times.
///
/// @param[in] a  n outputs
/// @param[in] b  as many
/// @param[in] at an enum swb_path_at; the starts of stages are left out
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_complementarity(
    ocp: *mut swb_ocp,
    a: *const swb_function,
    b: *const swb_function,
    at: i32,
) -> swb_status {
    setting(ocp, || unsafe {
        let places = [(0, PathAt::ControlGrid), (1, PathAt::Elements), (2, PathAt::StagePoints)];
        let at = choose(&places, at, "enum swb_path_at")?;
        let (a, b) = (shared(a, "a")?, shared(b, "b")?);
        change(ocp, |o| o.add_complementarity(a, b, at))
    })
}

/// Set the number of finite elements of every control stage; without it all have as many as the option n_fe says.
///
/// @param[in] n_fe [n] one for every stage, at least 1
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_elements(ocp: *mut swb_ocp, n_fe: *const i64, n: i64) -> swb_status {
    setting(ocp, || unsafe {
        let n_fe = all_sizes(raw::slice(n_fe, n, "n_fe")?, "number of elements")?;
        change(ocp, |o| o.set_elements(&n_fe))
    })
}

/// Set the lengths of the control stages; where they are free, those to start from.
///
/// @param[in] durations [n] one for every stage, positive
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_durations(ocp: *mut swb_ocp, durations: *const f64, n: i64) -> swb_status {
    setting(ocp, || unsafe {
        let durations = raw::slice(durations, n, "durations")?;
        change(ocp, |o| o.set_durations(durations))
    })
}

/// Let the optimiser choose lengths.
///
/// @param[in] what  an enum swb_free_time
/// @param[in] lower of the horizon, or of a stage
/// @param[in] upper of the horizon, or of a stage
/// @return SWB_OK; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_free_time(ocp: *mut swb_ocp, what: i32, lower: f64, upper: f64) -> swb_status {
    setting(ocp, || unsafe {
        let all = [
            (swb_free_time::None as i32, Durations::Fixed),
            (swb_free_time::Horizon as i32, Durations::Horizon),
            (swb_free_time::Stages as i32, Durations::Stages),
        ];
        let what = choose(&all, what, "enum swb_free_time")?;
        change(ocp, |o| o.set_free_time(what, lower, upper))
    })
}

/// Bound the length of the horizon where those of the stages are free; after swb_ocp_set_initial_time.
///
/// @return SWB_OK; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_horizon(ocp: *mut swb_ocp, lower: f64, upper: f64) -> swb_status {
    setting(ocp, || unsafe { change(ocp, |o| o.add_horizon(lower, upper)) })
}

/// Make controls continuous and linear on every stage; the others stay constant.
///
/// @param[in] linear [nu] 1 or 0 for every control
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_linear_controls(ocp: *mut swb_ocp, linear: *const i32, nu: i64) -> swb_status {
    setting(ocp, || unsafe {
        let linear: Vec<bool> = raw::slice(linear, nu, "linear")?.iter().map(|v| *v != 0).collect();
        change(ocp, |o| o.set_linear_controls(&linear))
    })
}

/// Make parameters with a lower bound below the upper one variables, which start at the values of swb_ocp_set_params;
/// the others keep those values.
///
/// @param[in] lower [n_lower] np
/// @param[in] upper [n_upper] np
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_param_bounds(
    ocp: *mut swb_ocp,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        change(ocp, |o| o.set_param_bounds(lower, upper))
    })
}

/// Set parameters that change from control stage to control stage.
///
/// @param[in] p [n_p] n_stages * np, the parameters of one stage together
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_stage_params(ocp: *mut swb_ocp, p: *const f64, n_p: i64) -> swb_status {
    setting(ocp, || unsafe {
        let p = raw::slice(p, n_p, "p")?;
        change(ocp, |o| o.set_stage_params(p))
    })
}

/// Solve from the last solution: after small changes its active set is tried first.
///
/// @param[out] outcome as swb_ocp_solve
/// @return as swb_ocp_solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_solve_warm(ocp: *mut swb_ocp, outcome: *mut i32) -> swb_status {
    running(ocp, || unsafe {
        let reached = handle::with_mut(ocp, |o| o.solve(true))?;
        raw::write_optional(outcome, outcome_number(reached));
        Ok(())
    })
}

/// Make the last solution, one control stage later, the guess of the next solve. swb_ocp_solve_warm then simulates it from the
/// initial state that is set by then, and starts from its modes and switching times.
///
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_shift(ocp: *mut swb_ocp) -> swb_status {
    guard(|| unsafe { change(ocp, |o| o.shift()) })
}

/// Lengths of the control stages of the last solution.
///
/// @param[out] durations [n] n_stages
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_durations(ocp: *const swb_ocp, durations: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write_slice(durations, n, &o.result()?.durations, "durations")) })
}

/// Parameters of the last solution, those that were free as they were found.
///
/// @param[out] p [n_p] np
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_params(ocp: *const swb_ocp, p: *mut f64, n_p: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write_slice(p, n_p, &o.result()?.params, "p")) })
}

/// Controls at the end of every stage: others than at its start where they are linear.
///
/// @param[out] u [n_u] n_stages * nu, the controls of one stage together
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_control_ends(ocp: *const swb_ocp, u: *mut f64, n_u: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write_slice(u, n_u, &o.result()?.control_ends, "u")) })
}

/// Largest violation of a relaxed constraint.
///
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_violation(ocp: *const swb_ocp, violation: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write(violation, o.result()?.violation, "violation")) })
}
