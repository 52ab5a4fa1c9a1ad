//! Trajectories: copies of what a simulation or an optimal control problem found.

use super::guard::guard;
use super::handle::{self, Object};
use super::raw;
use super::report::{write_sized, Sized8};
use super::status::swb_status;
use std::mem::size_of;
use switchback::error::{Error, Result};
use switchback::fesd::{Element, Switch, SwitchKind, Trajectory};
use switchback::memory;

/// Trajectory of a simulation or of an optimal control problem: finite elements, each a polynomial, that
/// end where the system switches. Owned by the caller, independent of the object it comes from.
pub struct swb_trajectory(());
impl Object for swb_trajectory {
    type Value = Trajectory;
    const NAME: &'static str = "swb_trajectory";
}

/// Numbers of a trajectory, the lengths of its arrays.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_trajectory_info {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// States.
    pub nx: i64,
    /// Finite elements.
    pub n_elements: i64,
    /// Stage points of each element.
    pub n_s: i64,
    /// Subsystems that can switch: those with more than one mode, in the order they were added.
    pub n_subsystems: i64,
    /// Modes of all these subsystems, one after the other.
    pub n_modes: i64,
    /// Switches.
    pub n_switches: i64,
    /// Start.
    pub t_start: f64,
    /// End.
    pub t_end: f64,
}
unsafe impl Sized8 for swb_trajectory_info {}

/// Kinds of switches.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_switch_kind {
    /// Modes leave the active set and others enter it.
    Cross = 0,
    /// Modes enter: a sliding mode begins, or gets another mode.
    Enter = 1,
    /// Modes leave: a sliding mode ends, or loses a mode.
    Leave = 2,
}

/// A change of the active set of a subsystem.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_switch {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// The element that begins here.
    pub element: i64,
    /// The subsystem.
    pub subsystem: i64,
    /// An enum swb_switch_kind.
    pub kind: i64,
    /// Active modes before, bit i for mode i; modes from 64 on are in swb_trajectory_active only.
    pub before: u64,
    /// Active modes after.
    pub after: u64,
}
unsafe impl Sized8 for swb_switch {}

impl swb_switch {
    fn of(s: &Switch) -> swb_switch {
        let mask = |modes: &[usize]| modes.iter().filter(|&&m| m < 64).fold(0, |bits, &m| bits | 1 << m);
        let kind = match s.kind {
            SwitchKind::Cross => swb_switch_kind::Cross,
            SwitchKind::Enter => swb_switch_kind::Enter,
            SwitchKind::Leave => swb_switch_kind::Leave,
            _ => unreachable!("every kind has a number in the header"),
        };
        swb_switch {
            struct_size: size_of::<swb_switch>() as u64,
            t: s.t,
            element: s.element as i64,
            subsystem: s.subsystem as i64,
            kind: kind as i64,
            before: mask(&s.before),
            after: mask(&s.after),
        }
    }
}

/// Write one value for each element, or several.
unsafe fn per_element<T: Copy>(
    trajectory: *const swb_trajectory,
    out: *mut T,
    n: i64,
    what: &str,
    values: impl Fn(&Trajectory, &Element, &mut Vec<T>),
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(trajectory, |r| {
            let mut all = Vec::new();
            r.elements.iter().for_each(|e| values(r, e, &mut all));
            raw::write_slice(out, n, &all, what)
        })
    })
}

/// Numbers of a trajectory.
///
/// @param[out] info        every field is written
/// @param[in]  struct_size sizeof(swb_trajectory_info)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_get_info(
    trajectory: *const swb_trajectory,
    info: *mut swb_trajectory_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(trajectory, |r| {
            let times = r.times();
            let value = swb_trajectory_info {
                struct_size: 0,
                nx: r.nx() as i64,
                n_elements: r.elements.len() as i64,
                n_s: r.tableau().n_s as i64,
                n_subsystems: r.modes.len() as i64,
                n_modes: r.modes.iter().sum::<usize>() as i64,
                n_switches: r.switches.len() as i64,
                t_start: times.first().copied().unwrap_or(f64::NAN),
                t_end: times.last().copied().unwrap_or(f64::NAN),
            };
            write_sized(&value, info, struct_size, "info")
        })
    })
}

/// Times of the element boundaries.
///
/// @param[out] t [n] n_elements + 1; none if there are no elements
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_times(trajectory: *const swb_trajectory, t: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(trajectory, |r| raw::write_slice(t, n, &r.times(), "t")) })
}

/// States at the element boundaries.
///
/// @param[out] x [n] (n_elements + 1) * nx, the states of one boundary together; none if there are no
///               elements
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_states(trajectory: *const swb_trajectory, x: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(trajectory, |r| {
            let mut all = memory::with_capacity(usize::try_from(n).unwrap_or(0).min((r.elements.len() + 1) * r.nx()));
            r.elements.first().iter().for_each(|e| all.extend(&e.x0));
            r.elements.iter().for_each(|e| all.extend(&e.x1));
            raw::write_slice(x, n, &all, "x")
        })
    })
}

/// Lengths of the elements.
///
/// @param[out] h [n] n_elements
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_steps(trajectory: *const swb_trajectory, h: *mut f64, n: i64) -> swb_status {
    unsafe { per_element(trajectory, h, n, "h", |_, e, all| all.push(e.h)) }
}

/// Control stages the elements belong to; 0 in simulations.
///
/// @param[out] stage [n] n_elements
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_control_stages(
    trajectory: *const swb_trajectory,
    stage: *mut i64,
    n: i64,
) -> swb_status {
    unsafe { per_element(trajectory, stage, n, "stage", |_, e, all| all.push(e.stage as i64)) }
}

/// Numbers of modes of the subsystems that can switch.
///
/// @param[out] n_modes [n] n_subsystems
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_modes(
    trajectory: *const swb_trajectory,
    n_modes: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(trajectory, |r| {
            let modes: Vec<i64> = r.modes.iter().map(|&m| m as i64).collect();
            raw::write_slice(n_modes, n, &modes, "n_modes")
        })
    })
}

/// Active modes in the elements: one alone, or several in a sliding mode.
///
/// @param[out] active [n] n_elements * n_modes, 0 or 1, the modes of one element together
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_active(
    trajectory: *const swb_trajectory,
    active: *mut i32,
    n: i64,
) -> swb_status {
    unsafe {
        per_element(trajectory, active, n, "active", |_, e, all| all.extend(e.active.iter().map(|&a| i32::from(a))))
    }
}

/// Times of the stage points.
///
/// @param[out] t [n] n_elements * n_s
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_stage_times(
    trajectory: *const swb_trajectory,
    t: *mut f64,
    n: i64,
) -> swb_status {
    unsafe { per_element(trajectory, t, n, "t", |r, e, all| all.extend(r.tableau().c.iter().map(|c| e.t + c * e.h))) }
}

/// States at the stage points.
///
/// @param[out] x [n] n_elements * n_s * nx, the states of one point together
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_stage_states(
    trajectory: *const swb_trajectory,
    x: *mut f64,
    n: i64,
) -> swb_status {
    unsafe { per_element(trajectory, x, n, "x", |_, e, all| all.extend(&e.xs)) }
}

/// Convex multipliers of the modes at the stage points; NaN where the states are those of a simulation and several modes are active.
///
/// @param[out] theta [n] n_elements * n_s * n_modes, the multipliers of one point together
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_stage_theta(
    trajectory: *const swb_trajectory,
    theta: *mut f64,
    n: i64,
) -> swb_status {
    unsafe { per_element(trajectory, theta, n, "theta", |_, e, all| all.extend(&e.theta)) }
}

/// Switches in the order of time.
///
/// @param[out] switches    [n] n_switches
/// @param[in]  struct_size sizeof(swb_switch)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_switches(
    trajectory: *const swb_trajectory,
    switches: *mut swb_switch,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(trajectory, |r| {
            if usize::try_from(n) != Ok(r.switches.len()) {
                return Err(Error::Dimension(format!("switches has length {n}, not {}", r.switches.len())));
            }
            let bytes = switches.cast::<u8>();
            for (k, s) in r.switches.iter().enumerate() {
                let at = bytes.wrapping_add(k * struct_size as usize);
                write_sized(
                    &swb_switch::of(s),
                    if bytes.is_null() { switches } else { at.cast() },
                    struct_size,
                    "switches",
                )?;
            }
            Ok(())
        })
    })
}

/// States at any times, by the polynomials of the elements.
///
/// @param[in]  t [n_t] between start and end, in any order
/// @param[out] x [n_x] n_t * nx, the states of one time together
/// @return SWB_OK; SWB_ERR_RANGE if a time is outside; SWB_ERR_STATE if the trajectory is empty
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_state_at(
    trajectory: *const swb_trajectory,
    t: *const f64,
    n_t: i64,
    x: *mut f64,
    n_x: i64,
) -> swb_status {
    guard(|| unsafe {
        let times = raw::slice(t, n_t, "t")?;
        handle::with_ref(trajectory, |r| {
            let mut all = vec![0.0; times.len() * r.nx()];
            for (&t, x) in times.iter().zip(all.chunks_exact_mut(r.nx())) {
                r.state(t, x)?;
            }
            raw::write_slice(x, n_x, &all, "x")
        })
    })
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_trajectory_free(trajectory: *mut swb_trajectory) {
    unsafe { handle::free(trajectory) }
}

/// Hand out a copy.
pub(super) unsafe fn hand_out(trajectory: Result<&Trajectory>, out: *mut *mut swb_trajectory) -> Result<()> {
    unsafe { handle::create(out, |_| trajectory.cloned()) }
}
