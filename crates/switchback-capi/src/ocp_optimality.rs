//! What an optimal control is as a point of the control problem, beyond its discretisation.

use super::guard::{guard, query};
use super::handle;
use super::ocp::swb_ocp;
use super::raw;
use super::report::{write_sized, Sized8};
use super::status::swb_status;
use std::ffi::{c_char, CStr};
use std::ptr;
use switchback::error::{Error, Result};
use switchback::ocp::{Kink, OcpResult, Optimality, Verdict};

/// Verdicts on an optimal control as a point of the control problem: whether the cost is stationary under changes of controls, free
/// lengths, free parameters and free initial states, when every change is simulated by events.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_verdict {
    /// Not known; swb_ocp_get_optimality_reason says why.
    Unknown = 0,
    /// No change lowers the cost to first order, or a descent on simulations gains nothing.
    LocalOptimum = 1,
    /// Local optimum at a kink: switches lie exactly between control stages, surfaces are touched, or modes change, and the cost rises
    /// towards either side.
    Kink = 2,
    /// Some change lowers the cost to first order.
    NotOptimal = 3,
    /// An exact search over all choices (swb_system_add_choice) found no answer that costs less by more than the gap of swb_optimality.
    Global = 4,
}

const VERDICTS: &[(Verdict, swb_verdict, &CStr)] = &[
    (Verdict::Unknown, swb_verdict::Unknown, c"unknown"),
    (Verdict::LocalOptimum, swb_verdict::LocalOptimum, c"local_optimum"),
    (Verdict::Kink, swb_verdict::Kink, c"kink"),
    (Verdict::NotOptimal, swb_verdict::NotOptimal, c"not_optimal"),
    (Verdict::Global, swb_verdict::Global, c"global"),
];

/// Name of an enum swb_verdict, such as "kink"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_verdict_name(verdict: i32) -> *const c_char {
    query(ptr::null(), || VERDICTS.iter().find(|row| row.1 as i32 == verdict).map_or(ptr::null(), |row| row.2.as_ptr()))
}

/// Optimality of an optimal control.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_optimality {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// enum swb_verdict.
    pub verdict: i64,
    /// Switches that lie between two control stages, see swb_ocp_get_kink.
    pub n_kinks: i64,
    /// Largest first-order change of the cost by one quantity within its bounds, over the size of the quantity, relative to
    /// what single terms of cost and constraints change; NaN where it is not known. Up to 1e-4 counts as none.
    pub residual: f64,
    /// Largest share of the cost by which an answer with other choices may be cheaper; NaN where that is not known.
    pub gap: f64,
}
unsafe impl Sized8 for swb_optimality {}

/// A switch that lies between two control stages, or a surface that is touched: there the cost has a kink.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_kink {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// The control stage behind the switch, the number of stages at the end of the horizon; or the one in which a surface is touched.
    pub stage: i64,
    /// Time of the switch.
    pub t: f64,
    /// Derivative of the cost towards a switch in the stage before, relative as the residual of swb_optimality: negative
    /// where that lowers the cost, NaN where there is no such switch.
    pub before: f64,
    /// Derivative towards a switch in the stage behind.
    pub after: f64,
    /// 1 where nothing switches, but a surface is touched and left to the side the state came from: `before` is then the
    /// derivative away from it, `after` that of a moment behind it; where the control turns the state back at the end of a stage,
    /// on both sides, that of passing it; where the controls of the stage stay on the surface, as on u = 0 of |u|, they are those towards
    /// either side. 0 otherwise.
    pub touch: i64,
}
unsafe impl Sized8 for swb_kink {}

impl swb_kink {
    fn of(k: &Kink) -> swb_kink {
        swb_kink {
            struct_size: 0,
            stage: k.stage as i64,
            t: k.t,
            before: k.before,
            after: k.after,
            touch: i64::from(k.touch),
        }
    }
}

fn optimality(r: &OcpResult) -> Result<&Optimality> {
    r.optimality.as_ref().ok_or_else(|| {
        Error::State("the controls were not simulated: switch the option accuracy on, then solve".into())
    })
}

/// Verdict on the last solution as an optimum of the control problem. Derivatives of event-driven simulations of its controls and the
/// multipliers of its constraints decide, independently of the discretisation.
///
/// @param[out] optimality  every field is written
/// @param[in]  struct_size sizeof(swb_optimality)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve, and where the option accuracy is off
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_optimality(
    ocp: *const swb_ocp,
    optimality: *mut swb_optimality,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let found = self::optimality(o.result()?)?;
            let own = swb_optimality {
                struct_size: 0,
                verdict: found.verdict as i64,
                n_kinks: found.kinks.len() as i64,
                residual: found.residual,
                gap: found.gap,
            };
            write_sized(&own, optimality, struct_size, "optimality")
        })
    })
}

/// A switch of the last solution that lies between two control stages.
///
/// @param[in]  index       below n_kinks of swb_optimality
/// @param[out] kink        every field is written
/// @param[in]  struct_size sizeof(swb_kink)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_STATE as swb_ocp_get_optimality
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_kink(
    ocp: *const swb_ocp,
    index: i64,
    kink: *mut swb_kink,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let kinks = &optimality(o.result()?)?.kinks;
            let found = usize::try_from(index).ok().and_then(|i| kinks.get(i)).ok_or_else(|| {
                Error::Range(format!("there is no switch {index} between control stages: there are {}", kinks.len()))
            })?;
            write_sized(&swb_kink::of(found), kink, struct_size, "kink")
        })
    })
}

/// Derivatives of the cost with respect to the controls of the last solution, with the multipliers of its constraints; of
/// controls that are linear, with respect to their slopes. Those of controls at their bounds need not vanish. NaN where the
/// verdict is SWB_VERDICT_UNKNOWN for want of a simulation.
///
/// @param[out] gradient [n_stages * nu] the controls of the first stage first
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_optimality
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_reduced_gradient(ocp: *const swb_ocp, gradient: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let r = o.result()?;
            let found = &optimality(r)?.gradient;
            let unknown = vec![f64::NAN; r.controls.len()];
            raw::write_slice(gradient, n, if found.is_empty() { &unknown } else { found }, "gradient")
        })
    })
}

/// Changes of the controls that lower the cost of the last solution to first order, where its verdict is
/// SWB_VERDICT_NOT_OPTIMAL: the largest of them is as large as that control usually is. All zero for any other verdict, and
/// where controls are linear.
///
/// @param[out] direction [n_stages * nu] the controls of the first stage first
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE as swb_ocp_get_optimality
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_descent(ocp: *const swb_ocp, direction: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let r = o.result()?;
            let found = &optimality(r)?.direction;
            let none = vec![0.0; r.controls.len()];
            raw::write_slice(direction, n, if found.is_empty() { &none } else { found }, "direction")
        })
    })
}

/// Why it is not known whether the last solution is optimal; empty where it is.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE as swb_ocp_get_optimality
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_optimality_reason(
    ocp: *const swb_ocp,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(ocp, |o| Ok(optimality(o.result()?)?.reason))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_have_the_same_numbers_and_names() {
        for (v, number, name) in VERDICTS {
            assert_eq!((*v as i32, v.name()), (*number as i32, name.to_str().unwrap()));
        }
        assert!(swb_verdict_name(5).is_null() && swb_verdict_name(-1).is_null());
    }
}
