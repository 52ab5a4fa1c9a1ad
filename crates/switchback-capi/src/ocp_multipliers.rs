//! Multipliers and costates of an optimal control.

use super::guard::guard;
use super::handle;
use super::ocp::swb_ocp;
use super::raw;
use super::status::swb_status;
use switchback::error::{Error, Result};
use switchback::ocp::{Multipliers, MultipliersOf};

/// Owners of multipliers. Those of constraints and bounds are positive where an upper bound is active and negative where a
/// lower one is: raising that bound by d changes the optimal cost by -d times the multiplier, to first order.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_multipliers_of {
    /// Costates, nx at the start of every control stage and at the end of the horizon: derivatives of the cost that is still to
    /// come, constraints behind that time included, with respect to the state; at the end, of terminal cost and constraints.
    Costates = 0,
    /// Bounds of the initial state, nx: where it is fixed, the negative derivative of the optimal cost with respect to it.
    InitialState = 1,
    /// Bounds of the states, nx at the stage points and ends of all finite elements.
    States = 2,
    /// Bounds of the controls, nu at the start of every control stage; zero for controls that are linear, whose values are bounded
    /// as states are.
    Controls = 3,
    /// Bounds of the parameters, np; zero for those that are given.
    Params = 4,
    /// A path constraint, at all points at which it holds; those of all points together are the effect of its bound.
    Path = 5,
    /// A terminal constraint.
    Terminal = 6,
    /// A constraint between both ends of the horizon.
    Boundary = 7,
    /// A constraint that may be violated at a price.
    Relaxed = 8,
}

fn of(of: i32, index: i64) -> Result<MultipliersOf> {
    let k = usize::try_from(index).unwrap_or(usize::MAX);
    Ok(match of {
        0 => MultipliersOf::Costates,
        1 => MultipliersOf::InitialState,
        2 => MultipliersOf::States,
        3 => MultipliersOf::Controls,
        4 => MultipliersOf::Params,
        5 => MultipliersOf::Path(k),
        6 => MultipliersOf::Terminal(k),
        7 => MultipliersOf::Boundary(k),
        8 => MultipliersOf::Relaxed(k),
        _ => return Err(Error::Range(format!("{of} is no enum swb_multipliers_of"))),
    })
}

/// Constraints of a kind that multipliers belong to; 1 for what is no list.
///
/// @param[in]  of enum swb_multipliers_of
/// @param[out] n  constraints, in the order in which they were added
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_count_multipliers(ocp: *mut swb_ocp, of: i32, n: *mut i64) -> swb_status {
    guard(|| unsafe { handle::with_mut(ocp, |o| raw::write(n, o.count_multipliers(self::of(of, 0)?) as i64, "n")) })
}

/// Sizes of the multipliers of the last solution.
///
/// @param[in]  of      enum swb_multipliers_of
/// @param[in]  index   which constraint, below swb_ocp_count_multipliers; does not count for what is no list
/// @param[out] n_times points of time
/// @param[out] width   numbers at each of them
/// @return SWB_OK; SWB_ERR_NULL; otherwise as swb_ocp_get_multipliers
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_multiplier_sizes(
    ocp: *mut swb_ocp,
    of: i32,
    index: i64,
    n_times: *mut i64,
    width: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(ocp, |o| {
            raw::check(n_times, "n_times")?;
            raw::check(width, "width")?;
            let m = o.multipliers(self::of(of, index)?)?;
            raw::write(n_times, m.times.len() as i64, "n_times")?;
            raw::write(width, m.width() as i64, "width")
        })
    })
}

/// Multipliers of the last solution, which must be exact: polished, or of a problem without switches. Not known of several phases.
///
/// @param[in]  of     enum swb_multipliers_of
/// @param[in]  index  which constraint, in the order in which they were added; does not count for what is no list
/// @param[out] times  [n_times] the points of time; those at the start of the horizon for initial state and parameters
/// @param[out] values [n_values] n_times times the width, those of one point together
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution; SWB_ERR_USER, SWB_ERR_NONFINITE if
///         the model fails
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_multipliers(
    ocp: *mut swb_ocp,
    of: i32,
    index: i64,
    times: *mut f64,
    n_times: i64,
    values: *mut f64,
    n_values: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(ocp, |o| {
            let Multipliers { times: t, values: v } = o.multipliers(self::of(of, index)?)?;
            raw::check_slice(values, n_values, v.len(), "values")?;
            raw::write_slice(times, n_times, &t, "times")?;
            raw::write_slice(values, n_values, &v, "values")
        })
    })
}
