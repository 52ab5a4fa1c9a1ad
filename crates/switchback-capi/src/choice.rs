//! Controls that choose.

use super::expr::swb_model;
use super::handle::{self, setting};
use super::raw;
use super::status::swb_status;
use super::system::swb_system;
use switchback::error::{Error, Result};

/// The number of a control.
fn place(control: i64) -> Result<usize> {
    usize::try_from(control).map_err(|_| Error::Range(format!("control is {control}: controls count from 0")))
}

/// Say that a control chooses among values: on or off, a gear, a number of machines. Optimal control problems made of the system later search the
/// best choice of every control stage; simulations take any value.
///
/// @param[in]  control from 0
/// @param[in]  values  [n] in any order
/// @param[in]  dwell   time for which a value holds at least once it was chosen, 0 for none. The value at the start of a horizon may be left at any
///                     time, and the end of the horizon may cut the last one short.
/// @param[out] index   number of the choice; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE for a control that does not exist or chooses already, for values that are not finite, repeat or are none,
///         and for a dwell time that is negative or not finite
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_choice(
    system: *mut swb_system,
    control: i64,
    values: *const f64,
    n: i64,
    dwell: f64,
    index: *mut i64,
) -> swb_status {
    setting(system, || unsafe {
        let values = raw::slice(values, n, "values")?;
        let k = handle::with_mut(system, |s| s.add_choice(place(control)?, values, dwell))?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Say that a control of a model, and thereby of all systems made of it later, chooses among values; see swb_system_add_choice.
///
/// @param[in]  control from 0
/// @param[in]  values  [n] in any order
/// @param[in]  dwell   time for which a value holds at least once it was chosen, 0 for none
/// @param[out] index   number of the choice; may be NULL
/// @return as swb_system_add_choice
#[no_mangle]
pub unsafe extern "C" fn swb_model_add_choice(
    model: *mut swb_model,
    control: i64,
    values: *const f64,
    n: i64,
    dwell: f64,
    index: *mut i64,
) -> swb_status {
    setting(model, || unsafe {
        let values = raw::slice(values, n, "values")?;
        let k = handle::with_mut(model, |m| m.add_choice(place(control)?, values, dwell))?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}
