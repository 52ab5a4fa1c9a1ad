//! Transitions of optimal controls: hysteresis, automata, resets.

use super::guard::guard;
use super::handle;
use super::ocp::swb_ocp;
use super::raw;
use super::report::Sized8;
use super::run::write_structs;
use super::status::swb_status;
use switchback::error::{Error, Result};
use switchback::ocp::{JumpMade, OcpResult};

/// A transition of an optimal control.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_ocp_jump {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: i64,
    /// The control stage it is made in, from 0.
    pub stage: i64,
    /// 1 if its guard was beyond zero where its discrete state began, or where the control changed: it does not pass zero.
    pub at_once: i64,
}
unsafe impl Sized8 for swb_ocp_jump {}

fn jump(r: &OcpResult, index: i64) -> Result<&JumpMade> {
    let n = r.jumps.len();
    let found = usize::try_from(index).ok().and_then(|i| r.jumps.get(i));
    found.ok_or_else(|| Error::Dimension(format!("there is no transition {index}, the answer has {n}")))
}

/// Number of transitions of the last answer.
///
/// @param[out] n_jumps transitions; 0 for systems without
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_jump_count(ocp: *const swb_ocp, n_jumps: *mut i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write(n_jumps, o.result()?.jumps.len() as i64, "n_jumps")) })
}

/// The transitions of the last answer in the order of time.
///
/// @param[out] jumps       [n] swb_ocp_jump_count
/// @param[in]  struct_size sizeof(swb_ocp_jump)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_jumps(
    ocp: *const swb_ocp,
    jumps: *mut swb_ocp_jump,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let of = |j: &JumpMade| swb_ocp_jump {
                struct_size: 0,
                t: j.t,
                transition: j.transition as i64,
                stage: j.stage as i64,
                at_once: j.at_once.into(),
            };
            write_structs(&o.result()?.jumps, of, jumps, n, struct_size, "jumps")
        })
    })
}

/// The states just before and just behind a transition of the last answer.
///
/// @param[in]  index  its place in swb_ocp_jumps, from 0
/// @param[out] before [n] nx
/// @param[out] after  [n] nx
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_jump_states(
    ocp: *const swb_ocp,
    index: i64,
    before: *mut f64,
    after: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let j = jump(o.result()?, index)?;
            raw::check_slice(after, n, j.after.len(), "after")?;
            raw::write_slice(before, n, &j.before, "before")?;
            raw::write_slice(after, n, &j.after, "after")
        })
    })
}
