//! Optimal control problems of several phases.

use super::function::{shared, swb_function};
use super::guard::guard;
use super::handle::{self, running, setting, Interrupt, Object};
use super::ocp::{self, swb_ocp};
use super::raw;
use super::report::{outcome_number, polished_number, swb_iteration_fn, write_sized, Exclusive, Hooks, Sized8};
use super::settings;
use super::status::swb_status;
use std::ffi::{c_char, c_void};
use switchback::error::{Error, Result};
use switchback::nlp::Outcome;
use switchback::ocp::{MultiPhase, MultiPhaseResult};
use switchback::settings::{LogLevel, Settings};

/// Optimal control problem of phases, each with its own system, horizon, costs and constraints, linked by constraints
/// between the end of one and the start of the next.
pub struct swb_multiphase(());
impl Object for swb_multiphase {
    type Value = Phases;
    const NAME: &'static str = "swb_multiphase";
}

/// What is behind the handle.
pub struct Phases {
    problem: Exclusive<MultiPhase>,
    n_phases: usize,
    result: Option<MultiPhaseResult>,
    hooks: Hooks,
}

impl Phases {
    fn solve(&mut self) -> Result<Outcome> {
        let (problem, result) = (self.problem.get(), &mut self.result);
        *result = None;
        self.hooks.run("multiphase", LogLevel::Silent, |control| {
            let r = problem.solve(control)?;
            *result = Some(r.clone());
            if r.outcome == Outcome::Failed && r.phases.iter().any(|p| p.undefined) {
                return Err(Error::NonFinite(r.message.clone()));
            }
            Ok(r.outcome)
        })
    }

    fn result(&self) -> Result<&MultiPhaseResult> {
        self.result.as_ref().ok_or_else(|| Error::State("there is no result: call swb_multiphase_solve first".into()))
    }
}

/// Result of a solve of several phases; the phases are asked for theirs, see swb_multiphase_get_phase.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_multiphase_info {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// An enum swb_outcome.
    pub outcome: i64,
    /// An enum swb_polished.
    pub polished: i64,
    /// Number of phases.
    pub n_phases: i64,
    /// Sum of the costs of the phases; NaN unless the outcome is SWB_OUTCOME_SOLVED.
    pub cost: f64,
    /// Largest violation of a link.
    pub link_violation: f64,
    /// Largest difference of a state at the end of a phase from the simulation of its controls; NaN without one.
    pub error: f64,
    /// Iterations.
    pub iterations: i64,
    /// Seconds in all.
    pub time_total: f64,
}
unsafe impl Sized8 for swb_multiphase_info {}

unsafe fn change(m: *mut swb_multiphase, body: impl FnOnce(&mut MultiPhase) -> Result<()>) -> Result<()> {
    unsafe { handle::with_mut(m, |m| body(m.problem.get())) }
}

fn index(k: i64, what: &str) -> Result<usize> {
    usize::try_from(k).map_err(|_| Error::Range(format!("{what} {k} is negative")))
}

/// Create a problem of phases, one after the other. The initial state of a phase is free unless its problem bounds it;
/// links tie it to the end of the phase before. A function of time sees the time from the start of the first phase on.
///
/// @param[in]  phases   [n_phases] copied as they are stated; may be freed afterwards
/// @param[in]  settings of the solver; NULL for those of the first phase
/// @param[out] out      the new object, NULL on failure; free with swb_multiphase_free
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION without phases; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_create(
    phases: *const *mut swb_ocp,
    n_phases: i64,
    settings: *const Settings,
    out: *mut *mut swb_multiphase,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt: &Interrupt| {
            let mut list = Vec::new();
            for &p in raw::slice(phases, n_phases, "phases")? {
                handle::require(p)?;
                list.push(handle::with_mut(p, ocp::copied)?);
            }
            let n_phases = list.len();
            let mut problem = MultiPhase::new(list)?;
            if !settings.is_null() {
                problem.set_settings(&settings::read(settings)?)?;
            }
            Ok(Phases { problem: Exclusive::new(problem), n_phases, result: None, hooks: Hooks::new(interrupt) })
        })
    })
}

/// Require lower <= f([x(T) of the phase; x(0) of the next]) <= upper: f has as many states as both phases together, no
/// controls and no parameters.
///
/// @param[in] phase the first of the two, counted from 0
/// @param[in] lower [n_lower] one for each output
/// @param[in] upper [n_upper] one for each output
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no phase behind, or a lower bound is above the upper one
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_link(
    m: *mut swb_multiphase,
    phase: i64,
    f: *const swb_function,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(m, || unsafe {
        let phase = index(phase, "phase")?;
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        let f = shared(f, "f")?;
        change(m, |m| m.link(phase, f, lower, upper))
    })
}

/// Require that the next phase begins where this one ends, in all states.
///
/// @param[in] phase counted from 0
/// @return as swb_multiphase_link
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_link_continuous(m: *mut swb_multiphase, phase: i64) -> swb_status {
    setting(m, || unsafe {
        let phase = index(phase, "phase")?;
        change(m, |m| m.link_continuous(phase))
    })
}

/// Require that the next phase begins at r(x(T)): what a stage that drops off, a docking or a planned impact does to the states.
///
/// @param[in] phase counted from 0
/// @param[in] r     the states at the end of the phase as they are at the start of the next: as many states as the phase, no controls
///                  and no parameters, one output for each state of the next phase
/// @return as swb_multiphase_link
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_link_reset(
    m: *mut swb_multiphase,
    phase: i64,
    r: *const swb_function,
) -> swb_status {
    setting(m, || unsafe {
        let phase = index(phase, "phase")?;
        let r = shared(r, "r")?;
        change(m, |m| m.link_reset(phase, r))
    })
}

/// Solve.
///
/// @param[out] outcome an enum swb_outcome; may be NULL
/// @return as swb_ocp_solve
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_solve(m: *mut swb_multiphase, outcome: *mut i32) -> swb_status {
    running(m, || unsafe {
        let reached = handle::with_mut(m, Phases::solve)?;
        raw::write_optional(outcome, outcome_number(reached));
        Ok(())
    })
}

/// Result of the last solve.
///
/// @param[out] info        every field is written
/// @param[in]  struct_size sizeof(swb_multiphase_info)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_get_info(
    m: *const swb_multiphase,
    info: *mut swb_multiphase_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(m, |m| {
            let r = m.result()?;
            let value = swb_multiphase_info {
                struct_size: 0,
                outcome: i64::from(outcome_number(r.outcome)),
                polished: i64::from(polished_number(r.polish)),
                n_phases: m.n_phases as i64,
                cost: r.cost,
                link_violation: r.link_violation,
                error: r.error,
                iterations: r.stats.iterations as i64,
                time_total: r.stats.time_total,
            };
            write_sized(&value, info, struct_size, "info")
        })
    })
}

/// Why the last solve did not end with an exact solution; empty where there is nothing to say.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_get_message(
    m: *const swb_multiphase,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(m, |m| Ok(m.result()?.message.clone()))?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}

/// A copy of a phase with its part of the last solution: swb_ocp_get_controls and its like read it. Its outcome, residuals
/// and statistics are those of all phases.
///
/// @param[in]  phase counted from 0
/// @param[out] out   the new object, NULL on failure; free with swb_ocp_free
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_get_phase(
    m: *mut swb_multiphase,
    phase: i64,
    out: *mut *mut swb_ocp,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt: &Interrupt| {
            let k = index(phase, "phase")?;
            handle::with_mut(m, |m| {
                let found = m.result()?.phases.get(k).cloned();
                let found = found.ok_or_else(|| Error::Range(format!("phase {k} of {}", m.n_phases)))?;
                Ok(ocp::solved(m.problem.get().phase_mut(k)?.blank(), found, interrupt))
            })
        })
    })
}

/// Set who is called once per iteration; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_set_iteration(
    m: *mut swb_multiphase,
    iteration: swb_iteration_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(m, || unsafe {
        handle::with_mut(m, |m| {
            m.hooks.set_iteration(iteration, user_data);
            Ok(())
        })
    })
}

/// Stop the call that runs now, or the next one if none runs; see swb_ocp_interrupt.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_interrupt(m: *const swb_multiphase) -> swb_status {
    unsafe { handle::interrupt(m) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_multiphase_free(m: *mut swb_multiphase) {
    unsafe { handle::free(m) }
}
