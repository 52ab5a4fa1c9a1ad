//! Optimal control of scenes: how contact modes are found, impacts, modes and forces of an answer.

use super::guard::guard;
use super::handle::{self, setting};
use super::ocp::{change, new, swb_ocp};
use super::raw;
use super::run::write_structs;
use super::scene::{impact_of, swb_impact, swb_scene};
use super::settings;
use super::status::swb_status;
use std::ffi::c_char;
use switchback::error::{Error, Result};
use switchback::memory::sizes;
use switchback::ocp::{Contacts, Jumps, Ocp};
use switchback::settings::Settings;

/// How an optimal control problem of a scene finds contact modes and impacts.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_jumps {
    /// By descents on simulations and by time stepping; where descents lead to no answer, also from a simulation of the guess and by finite elements with
    /// jumps.
    Auto = 0,
    /// From a simulation of the guess and the orders of modes next to it.
    Modes = 1,
    /// By finite elements with jumps: complementarity between gaps and forces in every element.
    FesdJ = 2,
    /// By time stepping: complementarity at the ends of equal steps of implicit Euler.
    Steps = 3,
    /// By descents on simulations, from the guess and from controls that are drawn at random, always the same ones.
    Shots = 4,
    /// By time-freezing: finite elements in a numerical time in which nothing jumps; without friction where there is restitution.
    Freezing = 5,
}

/// Create an optimal control problem of a scene that is built; as swb_ocp_create with the system of the scene. Its states are
/// coordinates, then velocities, then what else it has; horizon, control grid and costs are in physical time.
///
/// @param[in]  scene    copied; may be freed afterwards
/// @param[in]  horizon  duration
/// @param[in]  n_stages control intervals of equal length
/// @param[in]  settings NULL for the defaults
/// @param[out] out      the new object, NULL on failure; free with swb_ocp_free
/// @return as swb_ocp_create; SWB_ERR_STATE if the scene is not built
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_create_scene(
    scene: *const swb_scene,
    horizon: f64,
    n_stages: i64,
    settings: *const Settings,
    out: *mut *mut swb_ocp,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let settings = settings::read(settings)?;
            let n = sizes::size(n_stages, "n_stages")?;
            handle::require(scene)?;
            handle::with_ref(scene, |s| Ok(new(Ocp::new(&s.built()?.system, horizon, n, &settings)?, interrupt)))
        })
    })
}

/// Set how contact modes and impacts of a scene are found. Other systems do not look at it.
///
/// @param[in] jumps an enum swb_jumps
/// @return SWB_OK; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_jumps(ocp: *mut swb_ocp, jumps: i32) -> swb_status {
    setting(ocp, || unsafe {
        let method = match jumps {
            0 => Jumps::Auto,
            1 => Jumps::Modes,
            2 => Jumps::FesdJ,
            3 => Jumps::Steps,
            4 => Jumps::Shots,
            5 => Jumps::Freezing,
            _ => return Err(Error::Range(format!("jumps is {jumps}: give an enum swb_jumps"))),
        };
        change(ocp, |o| {
            o.set_jumps(method);
            Ok(())
        })
    })
}

unsafe fn with_contacts<R>(ocp: *const swb_ocp, body: impl FnOnce(&Contacts) -> Result<R>) -> Result<R> {
    unsafe {
        handle::with_ref(ocp, |o| match &o.result()?.contacts {
            Some(c) => body(c),
            None => Err(Error::State("the problem has no contacts: its system is no scene".into())),
        })
    }
}

/// Sizes of what the contacts of an answer do.
///
/// @param[out] n_contacts contacts of the scene, those that were left out not counted
/// @param[out] n_impacts  impacts, one for every contact with an impulse
/// @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_contacts(
    ocp: *const swb_ocp,
    n_contacts: *mut i64,
    n_impacts: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let (n, m) = with_contacts(ocp, |c| Ok((c.names.len() as i64, c.impacts.len() as i64)))?;
        raw::check(n_contacts, "n_contacts")?;
        raw::check(n_impacts, "n_impacts")?;
        raw::write(n_contacts, n, "n_contacts")?;
        raw::write(n_impacts, m, "n_impacts")
    })
}

/// The impacts of an answer in the order they happen. Their depth is NaN: it is not computed.
///
/// @param[out] impacts     [n] n_impacts of swb_ocp_get_contacts
/// @param[in]  struct_size sizeof(swb_impact)
/// @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_impacts(
    ocp: *const swb_ocp,
    impacts: *mut swb_impact,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        with_contacts(ocp, |c| write_structs(&c.impacts, impact_of, impacts, n, struct_size, "impacts"))
    })
}

/// Modes of the contacts of an answer at times.
///
/// @param[in]  t     [n_t] times within the horizon; at the time of an event the modes are those before it
/// @param[out] modes [n] n_t times n_contacts, enum swb_contact_mode, those of the first time first
/// @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_RANGE for times outside;
///         SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_contact_modes(
    ocp: *const swb_ocp,
    t: *const f64,
    n_t: i64,
    modes: *mut i64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let times = raw::slice(t, n_t, "t")?;
        let all = with_contacts(ocp, |c| {
            let mut all = Vec::new();
            for &t in times {
                all.extend(c.modes(t)?.iter().map(|&m| m as i64));
            }
            Ok(all)
        })?;
        raw::write_slice(modes, n, &all, "modes")
    })
}

/// Forces of the contacts of an answer at times: forces, not impulses.
///
/// @param[in]  t      [n_t] times within the horizon
/// @param[out] forces [n] n_t times n_contacts times 3: the normal force and those along the tangents, zero where the contact
///                    is open or has no tangents; the contacts of the first time first
/// @return as swb_ocp_contact_modes
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_contact_forces(
    ocp: *const swb_ocp,
    t: *const f64,
    n_t: i64,
    forces: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        let times = raw::slice(t, n_t, "t")?;
        let all = with_contacts(ocp, |c| {
            let mut all = Vec::new();
            for &t in times {
                all.extend(c.forces(t)?.into_iter().flatten());
            }
            Ok(all)
        })?;
        raw::write_slice(forces, n, &all, "forces")
    })
}

/// Report on the contacts in numerical time when the search was by time-freezing: the strength a_n of the push or the stiffness k of
/// every contact, the recommended one, how long a jump takes, warnings.
///
/// @param[out] buf    [len] the text with its final NUL, empty for other searches; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_STATE without a result or if the system is no scene; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_freezing_report(
    ocp: *const swb_ocp,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = with_contacts(ocp, |c| Ok(c.freezing.as_ref().map_or_else(String::new, ToString::to_string)))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}
