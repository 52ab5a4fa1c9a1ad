//! What an optimal control says of itself: how far it is from the system, or why there is none.

use super::diagnosis::swb_certificate;
use super::guard::guard;
use super::handle;
use super::ocp::swb_ocp;
use super::raw;
use super::report::{write_sized, Sized8};
use super::status::swb_status;
use std::ffi::c_char;
use switchback::error::{Error, Result};
use switchback::ocp::{Accuracy, Along, OcpResult};

/// Comparison of an optimal control with a simulation of its controls: by the event-driven engine, or by finite elements of
/// another order where there are inclusions or algebraic equations. NaN from where the simulation did not get.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_accuracy {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// 1 if the simulation reached the end of the horizon.
    pub reached: i64,
    /// Switches of the simulation.
    pub n_switches: i64,
    /// Largest difference of a state at the ends of the control stages.
    pub worst: f64,
    /// Largest difference of a state at the end of the horizon.
    pub terminal: f64,
    /// Largest violation of a terminal constraint by the end of the simulation.
    pub terminal_violation: f64,
    /// Cost of the simulation.
    pub cost: f64,
    /// Cost of the solution less that of the simulation.
    pub cost_error: f64,
    /// Largest violation of a path constraint or of a bound of a state along the simulation, also between the points at which they are
    /// imposed, in their unit; 0 where there is none.
    pub along_violation: f64,
    /// Its time; NaN where there is none.
    pub along_time: f64,
    /// Number of that path constraint, in the order in which they were added; -1 for a bound of a state, -2 where there is none.
    pub along_constraint: i64,
    /// Row of the path constraint, or the state.
    pub along_row: i64,
}
unsafe impl Sized8 for swb_accuracy {}

impl swb_accuracy {
    fn of(a: &Accuracy) -> swb_accuracy {
        let worst = a.stages.iter().fold(0.0, |m: f64, v| if v.is_nan() { *v } else { m.max(*v) });
        let between = a.between();
        swb_accuracy {
            struct_size: 0,
            reached: i64::from(a.reached()),
            n_switches: a.n_switches as i64,
            worst,
            terminal: a.terminal,
            terminal_violation: a.terminal_violation,
            cost: a.cost,
            cost_error: a.cost_error,
            along_violation: between.map_or(0.0, |b| b.value),
            along_time: between.map_or(f64::NAN, |b| b.t),
            along_constraint: between.map_or(-2, |b| match b.of {
                Along::Path(k) => k as i64,
                Along::State => -1,
            }),
            along_row: between.map_or(0, |b| b.row as i64),
        }
    }
}

fn accuracy(r: &OcpResult) -> Result<&Accuracy> {
    r.accuracy.as_ref().ok_or_else(|| {
        Error::State("the controls were not simulated: switch the option accuracy on, then solve".into())
    })
}

/// Sizes of an optimal control problem.
///
/// @param[out] nx       states; may be NULL
/// @param[out] nu       controls; may be NULL
/// @param[out] np       parameters; may be NULL
/// @param[out] n_stages control stages; may be NULL
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_sizes(
    ocp: *mut swb_ocp,
    nx: *mut i64,
    nu: *mut i64,
    np: *mut i64,
    n_stages: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        super::ocp::change(ocp, |o| {
            let d = o.system().dims();
            for (to, n) in [(nx, d.x), (nu, d.u), (np, d.p), (n_stages, o.n_stages())] {
                raw::write_optional(to, n as i64);
            }
            Ok(())
        })
    })
}

/// How far the last solution is from the system: its controls are simulated again, by other means and at the tolerance
/// accuracy_tol.
///
/// @param[out] accuracy    every field is written
/// @param[in]  struct_size sizeof(swb_accuracy)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve, and where the option accuracy is off
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_accuracy(
    ocp: *const swb_ocp,
    accuracy: *mut swb_accuracy,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            write_sized(&swb_accuracy::of(self::accuracy(o.result()?)?), accuracy, struct_size, "accuracy")
        })
    })
}

/// Knowledge of the last solution as a point of the discretised program: type of stationarity, B-stationarity; unknown
/// unless it is exact (SWB_POLISHED_DONE) and the option certify is on.
///
/// @param[out] certificate every field is written
/// @param[in]  struct_size sizeof(swb_certificate)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_certificate(
    ocp: *const swb_ocp,
    certificate: *mut swb_certificate,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            write_sized(&swb_certificate::of(&o.result()?.certificate), certificate, struct_size, "certificate")
        })
    })
}

/// Largest difference between a state of the last solution and of the simulation at the end of every control stage.
///
/// @param[out] stages [n_stages] one for each control stage
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_accuracy
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_mismatch(ocp: *const swb_ocp, stages: *mut f64, n_stages: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| raw::write_slice(stages, n_stages, &accuracy(o.result()?)?.stages, "stages"))
    })
}

/// Why the last solve did not end with an exact solution, in the words of the model: which constraint cannot be met and by
/// how much, which function has no value where, which stage needs more elements. Of a solution, why the comparison accuracy
/// says nothing, or which state of the simulation is far off and what helps. Stages, elements, rows and states are
/// counted from zero. Empty where there is nothing to say. After a solve that returned an error it is there too.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_message(
    ocp: *const swb_ocp,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(ocp, |o| Ok(o.message()?.to_owned()))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}
