//! Piecewise smooth systems.

use super::function::{point, shared, swb_function, swb_point};
use super::guard::guard;
use super::handle::{self, setting, Object};
use super::raw;
use super::status::swb_status;
use switchback::error::{Error, Result};
use switchback::memory::sizes::size;
use switchback::session::listening;
use switchback::system::{Inclusion, Regions, SetValued, Subsystem, System};

/// Piecewise smooth system: x' = f0(x,u,p,t) plus, for each subsystem, a convex combination of its modes.
pub struct swb_system(());
impl Object for swb_system {
    type Value = System;
    const NAME: &'static str = "swb_system";
}

/// Create a system without dynamics.
///
/// @param[in]  nx  states, at least 1
/// @param[in]  nu  controls
/// @param[in]  np  parameters
/// @param[out] out the new object, NULL on failure; free with swb_system_free
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_system_create(nx: i64, nu: i64, np: i64, out: *mut *mut swb_system) -> swb_status {
    guard(|| unsafe { handle::create(out, |_| System::new(size(nx, "nx")?, size(nu, "nu")?, size(np, "np")?)) })
}

/// Set the part of the right-hand side that does not switch: nx outputs.
///
/// @return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit
#[no_mangle]
pub unsafe extern "C" fn swb_system_set_f0(system: *mut swb_system, f0: *const swb_function) -> swb_status {
    setting(system, || unsafe {
        let f0 = shared(f0, "f0")?;
        handle::with_mut(system, |s| s.set_f0(f0))
    })
}

/// Rows as the library counts them.
unsafe fn rows_of(rows: *const i64, n_rows: i64) -> Result<Vec<usize>> {
    let rows = unsafe { raw::slice(rows, n_rows, "rows")? };
    let bad = |r: i64| Error::Range(format!("rows holds {r}: states count from 0"));
    rows.iter().map(|&r| usize::try_from(r).map_err(|_| bad(r))).collect()
}

unsafe fn add(
    system: *mut swb_system,
    (rows, n_rows): (*const i64, i64),
    modes: *const swb_function,
    n_modes: i64,
    index: *mut i64,
    regions: impl FnOnce() -> Result<Regions>,
) -> Result<()> {
    unsafe {
        let subsystem = Subsystem {
            rows: rows_of(rows, n_rows)?,
            modes: shared(modes, "modes")?,
            n_modes: size(n_modes, "n_modes")?,
            regions: regions()?,
        };
        let k = handle::with_mut(system, |s| s.add_subsystem(subsystem))?;
        raw::write_optional(index, k as i64);
    }
    Ok(())
}

/// Add a subsystem whose regions are given by switching functions and a sign matrix: mode i is valid where
/// signs[i][j] psi_j(x) > 0 for every j with signs[i][j] != 0.
///
/// @param[in]  rows    [n_rows] the states the modes drive
/// @param[in]  modes   n_rows * n_modes outputs: the vector fields, mode after mode
/// @param[in]  psi     switching functions, one output each
/// @param[in]  signs   [n_signs] n_modes rows with an entry -1, 0 or 1 for each switching function, row
///                     after row
/// @param[out] index   number of the subsystem; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat or regions overlap
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_subsystem(
    system: *mut swb_system,
    rows: *const i64,
    n_rows: i64,
    modes: *const swb_function,
    n_modes: i64,
    psi: *const swb_function,
    signs: *const i8,
    n_signs: i64,
    index: *mut i64,
) -> swb_status {
    setting(system, || unsafe {
        add(system, (rows, n_rows), modes, n_modes, index, || {
            let signs = raw::slice(signs, n_signs, "signs")?.to_vec();
            Ok(Regions::Signs { psi: shared(psi, "psi")?, signs })
        })
    })
}

/// Add a subsystem whose regions are given by Stewart's indicator functions: mode i is valid where g_i(x)
/// is the smallest.
///
/// @param[in]  rows       [n_rows] the states the modes drive
/// @param[in]  modes      n_rows * n_modes outputs: the vector fields, mode after mode
/// @param[in]  indicators g: n_modes outputs
/// @param[out] index      number of the subsystem; may be NULL
/// @return as swb_system_add_subsystem
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_subsystem_indicators(
    system: *mut swb_system,
    rows: *const i64,
    n_rows: i64,
    modes: *const swb_function,
    n_modes: i64,
    indicators: *const swb_function,
    index: *mut i64,
) -> swb_status {
    setting(system, || unsafe {
        add(system, (rows, n_rows), modes, n_modes, index, || {
            Ok(Regions::Indicators(shared(indicators, "indicators")?))
        })
    })
}

/// Add an inclusion in the steps of switching functions: f(x, alpha, u, p, t) is added to the derivatives of some
/// states, where alpha_j is 1 where psi_j > 0, 0 where psi_j < 0, and anything between where psi_j = 0. There are no
/// modes: the discretisation takes such terms in the Heaviside form, and trajectories list every switching function as
/// two modes, psi_j > 0 and psi_j < 0, behind the subsystems. Event-driven simulation does the same, behind the contacts of a
/// scene. It keeps psi_j at zero by an alpha_j between 0 and 1 that solves d psi_j / dt = 0, which need not be linear in it; where
/// several ways go on, the switch is not unique, and the option ambiguity says what follows. In a scene the row of a velocity is
/// a force, and a coordinate is driven by none. Where forces of contacts push what psi_j depends on, and f is linear in every
/// alpha_j, the weight is found with these forces: the modes are those of a contact that slides either way or sticks.
///
/// @param[in]  rows  [n_rows] the states driven
/// @param[in]  f     n_rows outputs; it is made with as many states as the system has, plus one for each switching
///                   function: x in front, alpha behind
/// @param[in]  psi   switching functions, one output each
/// @param[out] index number of the inclusion; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_inclusion(
    system: *mut swb_system,
    rows: *const i64,
    n_rows: i64,
    f: *const swb_function,
    psi: *const swb_function,
    index: *mut i64,
) -> swb_status {
    setting(system, || unsafe {
        let (f, psi) = (shared(f, "f")?, shared(psi, "psi")?);
        let inclusion = Inclusion { rows: rows_of(rows, n_rows)?, f, psi, set: SetValued::Step };
        let k = handle::with_mut(system, |s| s.add_inclusion(inclusion))?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Make the last n_z states algebraic: what f0 and modes add to their rows, and the outputs of g, adds up to zero
/// instead of being a derivative. Functions see them among the states. Their initial values are guesses where the
/// smooth equations determine them. Event-driven simulation takes equations of index 1: the matrix of their derivatives by
/// the algebraic states is regular. They are solved where a run begins, behind every event and at every point of a result;
/// a run that comes to a singular matrix ends there, and says so. Modes may switch inside of the equations. Where neither of
/// two modes goes on beyond the surface between them, it is held by a weight of both, as by a relay in its own loop.
/// In a scene they are the last of the states beside coordinates and velocities. Forces and friction may depend on them, gaps and
/// constraints may not.
/// States that transitions alone change, and that stand behind all others as those of a model do, are not counted: add
/// transitions before.
///
/// @param[in] n_z fewer than nx; 0: none
/// @param[in] g   n_z outputs; may be NULL if f0 and modes hold the equations
/// @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit
#[no_mangle]
pub unsafe extern "C" fn swb_system_set_algebraic(
    system: *mut swb_system,
    n_z: i64,
    g: *const swb_function,
) -> swb_status {
    setting(system, || unsafe {
        let g = if g.is_null() { None } else { Some(shared(g, "g")?) };
        handle::with_mut(system, |s| s.set_algebraic(size(n_z, "n_z")?, g))
    })
}

/// Add complementarity conditions 0 <= a_k, b_k >= 0, a_k b_k = 0 to the equations of algebraic states: one of both is zero,
/// and the other one is not negative, as current and voltage of an ideal diode. Linear complementarity systems have the
/// algebraic states themselves as a, and b = C x + D z + F u. Each condition is a subsystem with the modes a_k = 0 and
/// b_k = 0, in this order. Call swb_system_set_algebraic before.
///
/// @param[in]  rows  [n_rows] algebraic states, one for each condition
/// @param[in]  a     n_rows outputs; may be NULL: the states in rows
/// @param[in]  b     n_rows outputs
/// @param[out] index number of the first subsystem; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if rows repeat; SWB_ERR_STATE if a row is no
///         algebraic state
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_complementarity(
    system: *mut swb_system,
    rows: *const i64,
    n_rows: i64,
    a: *const swb_function,
    b: *const swb_function,
    index: *mut i64,
) -> swb_status {
    setting(system, || unsafe {
        let a = if a.is_null() { None } else { Some(shared(a, "a")?) };
        let (rows, b) = (rows_of(rows, n_rows)?, shared(b, "b")?);
        let k = handle::with_mut(system, |s| s.add_complementarity(&rows, a, b))?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Sizes of a system. Any output may be NULL.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_system_sizes(
    system: *const swb_system,
    nx: *mut i64,
    nu: *mut i64,
    np: *mut i64,
    n_subsystems: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(system, |s| {
            let d = s.dims();
            raw::write_optional(nx, d.x as i64);
            raw::write_optional(nu, d.u as i64);
            raw::write_optional(np, d.p as i64);
            raw::write_optional(n_subsystems, s.subsystems().len() as i64);
            Ok(())
        })
    })
}

/// Values whose zeros are the switching surfaces of a subsystem: its switching functions, or the differences
/// g_i - g_j, i < j, of its indicators, NaN where both are not the smallest two.
///
/// @param[in]  subsystem number of the subsystem
/// @param[in]  at        the point
/// @param[out] values    [n] one for each; NULL with n 0 to ask for their number
/// @param[out] needed    their number, written in any case; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NONFINITE if a function is not defined at the point
#[no_mangle]
pub unsafe extern "C" fn swb_system_surfaces(
    system: *const swb_system,
    subsystem: i64,
    at: *const swb_point,
    values: *mut f64,
    n: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(system, |s| {
            let all = s.subsystems();
            let found = usize::try_from(subsystem).ok().and_then(|k| all.get(k));
            let sub = found.ok_or_else(|| {
                Error::Dimension(format!("there is no subsystem {subsystem}, their number is {}", all.len()))
            })?;
            let at = point(at, s.dims())?;
            let f = match &sub.regions {
                Regions::Signs { psi, .. } | Regions::Indicators(psi) => psi,
            };
            let (mut out, mut work) = (vec![0.0; f.n_out()], vec![0.0; f.work_len()]);
            listening(|| {
                f.value(&at, &mut out, &mut work)
                    .map_err(|_| Error::NonFinite(format!("function '{}' is not defined at the point", f.name())))
            })?;
            if matches!(sub.regions, Regions::Indicators(_)) {
                out = differences(&out);
            }
            raw::write_optional(needed, out.len() as i64);
            if values.is_null() && n == 0 {
                return Ok(());
            }
            raw::write_slice(values, n, &out, "values")
        })
    })
}

/// `g_i − g_j` where no other indicator is smaller than both, else NaN.
fn differences(g: &[f64]) -> Vec<f64> {
    let pairs = (0..g.len()).flat_map(|i| (i + 1..g.len()).map(move |j| (i, j)));
    let smallest = |i: usize, j: usize| (0..g.len()).all(|k| k == i || k == j || g[k] >= g[i].max(g[j]));
    pairs.map(|(i, j)| if smallest(i, j) { g[i] - g[j] } else { f64::NAN }).collect()
}

/// Free; objects made of the system keep what they need. NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_system_free(system: *mut swb_system) {
    unsafe { handle::free(system) }
}

#[cfg(test)]
mod tests {
    use super::differences;

    #[test]
    fn surfaces_between_the_smallest_indicators_only() {
        let d = differences(&[1.0, 1.5, 4.0]);
        assert_eq!(d[0], -0.5);
        assert!(d[1].is_nan() && d[2].is_nan());
    }
}
