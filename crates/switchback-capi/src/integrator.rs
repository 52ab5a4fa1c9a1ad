//! Event-driven simulation, step by step.

use super::guard::guard;
use super::handle::{self, running, setting, Object};
use super::log::{swb_log_fn, LogSink};
use super::raw;
use super::report::write_sized;
use super::run::{ending_number, order, swb_run, swb_run_stats};
use super::settings;
use super::status::swb_status;
use super::system::swb_system;
use std::ffi::{c_char, c_void};
use std::mem::size_of;
use std::sync::Arc;
use switchback::error::{Error, Result};
use switchback::event::{Branching, Engine, Gradient, Term};
use switchback::session::{Integrator, StepKind};
use switchback::settings::{Settings, Value};

/// Event-driven integrator of a system: explicit or implicit steps inside of modes, sliding modes as
/// differential-algebraic equations, every switch located to rounding. swb_simulator solves the equations of FESD
/// instead.
pub struct swb_integrator(());
impl Object for swb_integrator {
    type Value = Integrator;
    const NAME: &'static str = "swb_integrator";
}

/// Results of a step.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_progress_kind {
    /// A step inside of a mode.
    Stepped = 0,
    /// A step that ends at a switch.
    Switched = 1,
    /// Nothing, or no more: the time asked for is reached, or the simulation ended; see swb_integrator_get_outcome.
    Done = 2,
    /// A step that ends at a stop time.
    StopTime = 3,
}

/// A step of an event-driven simulation.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_progress {
    /// Size of this struct in bytes, as the library knows it.
    pub struct_size: u64,
    /// Time reached.
    pub t: f64,
    /// [nx] state reached; valid during the call only.
    pub x: *const f64,
    /// States.
    pub nx: i64,
    /// An enum swb_progress_kind.
    pub kind: i64,
    /// Steps so far, rejected ones not counted.
    pub steps: i64,
    /// Switches so far.
    pub switches: i64,
}

/// Called once per accepted step by the thread that simulates; a return other than 0 stops with the outcome
/// SWB_RUN_OUTCOME_STOPPED. `info` is valid during the call only. Must not unwind.
pub type swb_progress_fn = Option<unsafe extern "C" fn(info: *const swb_progress, user_data: *mut c_void) -> i32>;

/// Called about every hundredth of a second, between steps, by the thread that simulates, in calls that take so long; a return
/// other than 0 stops with the outcome SWB_RUN_OUTCOME_STOPPED. Must not unwind.
pub type swb_poll_fn = Option<unsafe extern "C" fn(user_data: *mut c_void) -> i32>;

/// A point from which several solutions go on.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_branching {
    /// Size of this struct in bytes, as the library knows it.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// [nx] state.
    pub x: *const f64,
    /// States.
    pub nx: i64,
    /// Continuations.
    pub n_continuations: i64,
    /// Modes of all subsystems that can switch, one after the other.
    pub n_modes: i64,
    /// [n_modes] active modes before, 0 or 1.
    pub before: *const i32,
    /// [n_continuations * n_modes] active modes of the continuations, those of one together.
    pub active: *const i32,
    /// [n_continuations * nx] derivatives of the state, those of one continuation together.
    pub velocity: *const f64,
}

/// Called where the continuation is not unique: returns the number of the continuation to take, from 0, or a negative
/// number to stop. `branching` is valid during the call only. Must not unwind.
pub type swb_decide_fn = Option<unsafe extern "C" fn(branching: *const swb_branching, user_data: *mut c_void) -> i64>;

/// A C callback that decides, with its user data.
#[derive(Clone, Copy)]
struct Decide {
    function: unsafe extern "C" fn(*const swb_branching, *mut c_void) -> i64,
    user_data: *mut c_void,
}

// SAFETY: as for `LogSink`.
unsafe impl Send for Decide {}
unsafe impl Sync for Decide {}

impl Decide {
    fn ask(&self, b: &Branching, n_modes: &[i64]) -> Option<usize> {
        let flags = |modes: &[Vec<usize>]| -> Vec<i32> {
            let of =
                |(m, &n): (&Vec<usize>, &i64)| (0..n as usize).map(|i| m.contains(&i).into()).collect::<Vec<i32>>();
            modes.iter().zip(n_modes).flat_map(of).collect()
        };
        let before = flags(&b.before);
        let active: Vec<i32> = b.continuations.iter().flat_map(|c| flags(&c.modes)).collect();
        let velocity: Vec<f64> = b.continuations.iter().flat_map(|c| c.velocity.iter().copied()).collect();
        let info = swb_branching {
            struct_size: size_of::<swb_branching>() as u64,
            t: b.t,
            x: b.x.as_ptr(),
            nx: b.x.len() as i64,
            n_continuations: b.continuations.len() as i64,
            n_modes: before.len() as i64,
            before: before.as_ptr(),
            active: active.as_ptr(),
            velocity: velocity.as_ptr(),
        };
        // SAFETY: the contract of `swb_decide_fn`; what is pointed to outlives the call.
        let taken = unsafe { (self.function)(&info, self.user_data) };
        usize::try_from(taken).ok().filter(|&i| i < b.continuations.len())
    }
}

/// A C callback that is told of steps, with its user data.
#[derive(Clone, Copy)]
struct Progress {
    function: unsafe extern "C" fn(*const swb_progress, *mut c_void) -> i32,
    user_data: *mut c_void,
}

// SAFETY: as for `LogSink`.
unsafe impl Send for Progress {}

impl Progress {
    fn tell(&self, engine: &Engine, kind: StepKind) -> bool {
        let stats = engine.stats();
        let info = swb_progress {
            struct_size: size_of::<swb_progress>() as u64,
            t: engine.time(),
            x: engine.state().as_ptr(),
            nx: engine.state().len() as i64,
            kind: kind_number(kind) as i64,
            steps: stats.steps as i64,
            switches: stats.switches as i64,
        };
        // SAFETY: the contract of `swb_progress_fn`; the struct outlives the call.
        unsafe { (self.function)(&info, self.user_data) == 0 }
    }
}

/// A C callback that is asked whether to go on, with its user data.
#[derive(Clone, Copy)]
struct Poll {
    function: unsafe extern "C" fn(*mut c_void) -> i32,
    user_data: *mut c_void,
}

// SAFETY: as for `LogSink`.
unsafe impl Send for Poll {}

impl Poll {
    fn ask(&self) -> bool {
        // SAFETY: the contract of `swb_poll_fn`.
        unsafe { (self.function)(self.user_data) == 0 }
    }
}

fn kind_number(kind: StepKind) -> swb_progress_kind {
    match kind {
        StepKind::Stepped => swb_progress_kind::Stepped,
        StepKind::Switched => swb_progress_kind::Switched,
        StepKind::Done => swb_progress_kind::Done,
        StepKind::StopTime => swb_progress_kind::StopTime,
    }
}

/// Create an integrator. Time, state, controls and parameters are zero until they are set.
///
/// @param[in]  system   copied; may be freed afterwards
/// @param[in]  settings NULL for the defaults
/// @param[out] out      the new object, NULL on failure; free with swb_integrator_free
/// @return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_create(
    system: *const swb_system,
    settings: *const Settings,
    out: *mut *mut swb_integrator,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let settings = settings::read(settings)?;
            settings.validate()?;
            handle::require(system)?;
            let system = handle::with_ref(system, |s| Ok(s.clone()))?;
            Integrator::new(system, settings, interrupt)
        })
    })
}

/// Set time and state, and begin anew: log, statistics, derivatives and dense output are cleared, changed options are
/// taken over. Controls, parameters and stop times stay.
///
/// @param[in] x [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite, or tolerances are too small
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_reinit(
    integrator: *mut swb_integrator,
    t: f64,
    x: *const f64,
    nx: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let x = raw::slice(x, nx, "x")?;
        handle::with_mut(integrator, |o| o.reinit(t, x))
    })
}

/// Set the controls, constant from now on. The active modes are found anew.
///
/// @param[in] u [nu]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_controls(
    integrator: *mut swb_integrator,
    u: *const f64,
    nu: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let u = raw::slice(u, nu, "u")?;
        handle::with_mut(integrator, |o| o.set_controls(u))
    })
}

/// Set the parameters. The active modes are found anew.
///
/// @param[in] p [np]
/// @return as swb_integrator_set_controls
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_params(
    integrator: *mut swb_integrator,
    p: *const f64,
    np: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let p = raw::slice(p, np, "p")?;
        handle::with_mut(integrator, |o| o.set_params(p))
    })
}

/// Set tolerances of the local error state by state, instead of the options rtol and atol. They are taken over by the
/// next swb_integrator_reinit, or at once before the first step.
///
/// @param[in] rtol [n_rtol] relative, one value or one for each state
/// @param[in] atol [n_atol] absolute, one value or one for each state
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is negative or not finite, or both of a state are too
///         small
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_tolerances(
    integrator: *mut swb_integrator,
    rtol: *const f64,
    n_rtol: i64,
    atol: *const f64,
    n_atol: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let (rtol, atol) = (raw::slice(rtol, n_rtol, "rtol")?, raw::slice(atol, n_atol, "atol")?);
        handle::with_mut(integrator, |o| o.set_tolerances(rtol, atol))
    })
}

/// Set times at which steps end, for functions of time that are not smooth there and for output.
///
/// @param[in] t [n] in any order; those behind the present time are passed over; none: no stop times
/// @return SWB_OK; SWB_ERR_RANGE if a time is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_stop_times(
    integrator: *mut swb_integrator,
    t: *const f64,
    n: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let times = raw::slice(t, n, "t")?;
        handle::with_mut(integrator, |o| o.set_stop_times(times))
    })
}

/// Set the modes a subsystem should take where the continuation is not unique, the preferred first, for the option
/// ambiguity = prefer. Taken over by the next swb_integrator_reinit, or at once before the first step.
///
/// @param[in] subsystem counted among those with more than one mode
/// @param[in] modes     [n] those that are not named come last
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such subsystem; SWB_ERR_RANGE if there is no such mode
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_preferred(
    integrator: *mut swb_integrator,
    subsystem: i64,
    modes: *const i64,
    n: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let modes = raw::slice(modes, n, "modes")?;
        handle::with_mut(integrator, |o| o.set_preferred(subsystem, modes))
    })
}

/// Set who decides where the continuation is not unique, before the option ambiguity does; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_decider(
    integrator: *mut swb_integrator,
    decide: swb_decide_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(integrator, || unsafe {
        handle::with_mut(integrator, |o| {
            let decide = decide.map(|function| Decide { function, user_data });
            o.set_decider(decide.map(|d| Arc::new(move |b: &Branching, n_modes: &[i64]| d.ask(b, n_modes)) as _));
            Ok(())
        })
    })
}

/// Do one step, not beyond t_stop nor a stop time.
///
/// @param[out] kind an enum swb_progress_kind; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE if t_stop is behind the present time; SWB_ERR_USER if a user function returned a
///         negative code; SWB_ERR_STATE after a call that failed so, until swb_integrator_reinit
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_step(
    integrator: *mut swb_integrator,
    t_stop: f64,
    kind: *mut i32,
) -> swb_status {
    running(integrator, || unsafe {
        let did = handle::with_mut(integrator, |o| o.run(t_stop, true))?;
        raw::write_optional(kind, kind_number(did) as i32);
        Ok(())
    })
}

/// Integrate to the time t, exactly. Time and state are those at the end, or where the simulation ended before.
///
/// @param[out] outcome an enum swb_run_outcome; may be NULL
/// @return as swb_integrator_step
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_advance(
    integrator: *mut swb_integrator,
    t: f64,
    outcome: *mut i32,
) -> swb_status {
    running(integrator, || unsafe {
        let reached = handle::with_mut(integrator, |o| o.run(t, false).map(|_| ending_number(o.ending().0)))?;
        raw::write_optional(outcome, reached);
        Ok(())
    })
}

/// Integrate to the last of the times, and write the states at all of them, which are on the dense output of the steps: no step ends for
/// them, and the dense output of the run need not be kept. At a switch the state before it counts.
///
/// @param[in]  t       [n] increasing, none behind the present time; none: nothing is done
/// @param[out] x       [n * nx] states, those of a time together; NaN at times that the simulation did not reach
/// @param[in]  n_x     n * nx
/// @param[out] outcome an enum swb_run_outcome; may be NULL
/// @return as swb_integrator_step; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a time is not finite or the times do not increase
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_sample(
    integrator: *mut swb_integrator,
    t: *const f64,
    n: i64,
    x: *mut f64,
    n_x: i64,
    outcome: *mut i32,
) -> swb_status {
    running(integrator, || unsafe {
        let times = raw::slice(t, n, "t")?;
        let reached = handle::with_mut(integrator, |o| {
            let wanted = times.len().checked_mul(o.state().len());
            if usize::try_from(n_x).ok() != wanted {
                let nx = o.state().len();
                return Err(Error::Dimension(format!(
                    "x has room for {n_x} values: {n} times and {nx} states need others"
                )));
            }
            let states = o.sample(times)?;
            raw::write_slice(x, n_x, &states, "x")?;
            Ok(ending_number(o.ending().0))
        })?;
        raw::write_optional(outcome, reached);
        Ok(())
    })
}

/// Derivatives of the dense output with respect to time at a time in the last step.
///
/// @param[in]  k   order of the derivative, 0 for the state
/// @param[out] dky [nx]
/// @return SWB_OK; SWB_ERR_RANGE if t is outside of the last step or k is negative; SWB_ERR_STATE before the first step
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_dky(
    integrator: *mut swb_integrator,
    t: f64,
    k: i64,
    dky: *mut f64,
    nx: i64,
) -> swb_status {
    guard(|| unsafe {
        let k = order(k)?;
        handle::with_mut(integrator, |o| {
            let out = o.get_dky(t, k)?;
            raw::write_slice(dky, nx, &out, "dky")
        })
    })
}

/// Time reached.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_time(integrator: *const swb_integrator, t: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write(t, o.time(), "t")) })
}

/// State reached.
///
/// @param[out] x [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_state(
    integrator: *const swb_integrator,
    x: *mut f64,
    nx: i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write_slice(x, nx, o.state(), "x")) })
}

/// Derivative of the state with respect to time under the present active modes; 0 before the first step.
///
/// @param[out] f [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_derivative(
    integrator: *const swb_integrator,
    f: *mut f64,
    nx: i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write_slice(f, nx, o.derivative(), "f")) })
}

/// Active modes of a subsystem: one alone, or several in a sliding mode; none before the first step.
///
/// @param[in]  subsystem counted among those with more than one mode
/// @param[out] active    [n] 0 or 1 for each mode of the subsystem
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_active(
    integrator: *const swb_integrator,
    subsystem: i64,
    active: *mut i32,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(integrator, |o| {
            let flags: Vec<i32> = o.active(subsystem)?.into_iter().map(i32::from).collect();
            raw::write_slice(active, n, &flags, "active")
        })
    })
}

/// How the simulation stands.
///
/// @param[out] outcome an enum swb_run_outcome
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_outcome(
    integrator: *const swb_integrator,
    outcome: *mut i32,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write(outcome, ending_number(o.ending().0), "outcome")) })
}

/// Why the simulation ended early, in words; if it did not, what is not known to the tolerances, or "".
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL, written in any case; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_reason(
    integrator: *const swb_integrator,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write_text(o.ending().1.as_bytes(), buf, len, needed)) })
}

/// Work since the last swb_integrator_reinit.
///
/// @param[out] stats       every field is written
/// @param[in]  struct_size sizeof(swb_run_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_stats(
    integrator: *const swb_integrator,
    stats: *mut swb_run_stats,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(integrator, |o| {
            let (work, seconds) = o.stats();
            write_sized(&swb_run_stats::of(work, seconds), stats, struct_size, "stats")
        })
    })
}

/// A copy of the result since the last swb_integrator_reinit: switches, derivatives, dense output.
///
/// @param[out] out the new object, NULL on failure; free with swb_run_free
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_run(integrator: *mut swb_integrator, out: *mut *mut swb_run) -> swb_status {
    guard(|| unsafe { handle::create(out, |_| handle::with_mut(integrator, |o| o.record())) })
}

/// Gradient of a function of the run with respect to initial state, parameters and controls, by the transpose of the
/// forward derivatives in reverse order. It costs about as much as the run, whatever the number of parameters, and needs
/// the option adjoint.
///
/// @param[in]  v      [nx] its derivative with respect to the state reached
/// @param[in]  t      [n_t] times at whose states the function depends on, too, where the run had stopped: ends of
///                    swb_integrator_advance and stop times
/// @param[in]  v_t    [n_v_t] n_t * nx, its derivatives with respect to these states, those of one time together
/// @param[in]  events [n_events] switches on whose times it depends, by their place in the log
/// @param[in]  weight [n_weight] n_events, its derivatives with respect to these times
/// @param[out] dx0    [nx0] nx, gradient with respect to the initial state
/// @param[out] dp     [np] gradient with respect to the parameters
/// @param[out] du     [nu] gradient with respect to the controls
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a time or a switch is none of the run; SWB_ERR_STATE without the
///         option adjoint; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_adjoint(
    integrator: *mut swb_integrator,
    v: *const f64,
    nx: i64,
    t: *const f64,
    n_t: i64,
    v_t: *const f64,
    n_v_t: i64,
    events: *const i64,
    n_events: i64,
    weight: *const f64,
    n_weight: i64,
    dx0: *mut f64,
    nx0: i64,
    dp: *mut f64,
    np: i64,
    du: *mut f64,
    nu: i64,
) -> swb_status {
    guard(|| unsafe {
        let (v, t, v_t) = (raw::slice(v, nx, "v")?, raw::slice(t, n_t, "t")?, raw::slice(v_t, n_v_t, "v_t")?);
        let (events, weight) = (raw::slice(events, n_events, "events")?, raw::slice(weight, n_weight, "weight")?);
        handle::with_mut(integrator, |o| {
            let terms = terms(o.state().len(), (t, v_t), (events, weight))?;
            let g = o.adjoint(v, &terms)?;
            for (p, n, values, what) in [(dx0, nx0, &g.x0, "dx0"), (dp, np, &g.p, "dp"), (du, nu, &g.u, "du")] {
                raw::check_slice(p, n, values.len(), what)?;
            }
            raw::write_slice(dx0, nx0, &g.x0, "dx0")?;
            raw::write_slice(dp, np, &g.p, "dp")?;
            raw::write_slice(du, nu, &g.u, "du")
        })
    })
}

/// Derivative of a gradient by swb_integrator_adjoint in a direction: the product of the Hessian with it, where v does not change. What v changes by adds a
/// gradient of its own. Needs the option adjoint; the derivative has about half of the digits, and costs about ten gradients.
///
/// @param[in]  v       [nx] the derivative of the function with respect to the state reached
/// @param[in]  x0      [nx0] nx, direction of the initial state
/// @param[in]  p       [np] direction of the parameters
/// @param[in]  u       [nu] direction of the controls
/// @param[out] ddx0    [nddx0] nx, derivative of the gradient with respect to the initial state
/// @param[out] ddp     [nddp] np, derivative of the gradient with respect to the parameters
/// @param[out] ddu     [nddu] nu, derivative of the gradient with respect to the controls
/// @param[out] dx      [ndx] nx, derivative of the state reached in the direction
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE for numbers that are not finite; SWB_ERR_STATE without the option adjoint; SWB_ERR_UNSUPPORTED where the run
///         has implicit steps, contacts, zeros of higher order, or transitions that follow another event at the same time; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_adjoint_along(
    integrator: *mut swb_integrator,
    v: *const f64,
    nx: i64,
    x0: *const f64,
    nx0: i64,
    p: *const f64,
    np: i64,
    u: *const f64,
    nu: i64,
    ddx0: *mut f64,
    nddx0: i64,
    ddp: *mut f64,
    nddp: i64,
    ddu: *mut f64,
    nddu: i64,
    dx: *mut f64,
    ndx: i64,
) -> swb_status {
    guard(|| unsafe {
        let (v, x0) = (raw::slice(v, nx, "v")?, raw::slice(x0, nx0, "x0")?);
        let (p, u) = (raw::slice(p, np, "p")?, raw::slice(u, nu, "u")?);
        let direction = Gradient { x0: x0.to_vec(), p: p.to_vec(), u: u.to_vec() };
        handle::with_mut(integrator, |o| {
            let found = o.adjoint_along(v, &direction)?;
            let d = &found.derivative;
            let all = [
                (ddx0, nddx0, &d.x0, "ddx0"),
                (ddp, nddp, &d.p, "ddp"),
                (ddu, nddu, &d.u, "ddu"),
                (dx, ndx, &found.state, "dx"),
            ];
            for (to, n, values, what) in all {
                raw::check_slice(to, n, values.len(), what)?;
            }
            all.iter().try_for_each(|&(to, n, values, what)| raw::write_slice(to, n, values, what))
        })
    })
}

/// What a function depends on besides the state reached.
fn terms(nx: usize, (t, v_t): (&[f64], &[f64]), (events, weight): (&[i64], &[f64])) -> Result<Vec<Term>> {
    if v_t.len() != t.len() * nx {
        return Err(Error::Dimension(format!(
            "v_t has length {}, not {} for {} times",
            v_t.len(),
            t.len() * nx,
            t.len()
        )));
    }
    if weight.len() != events.len() {
        return Err(Error::Dimension(format!("weight has length {}, not {}", weight.len(), events.len())));
    }
    let index = |i: i64| usize::try_from(i).map_err(|_| Error::Range(format!("there is no switch {i}")));
    let states = t.iter().zip(v_t.chunks_exact(nx)).map(|(&t, v)| Ok(Term::State { t, v: v.to_vec() }));
    let times = events.iter().zip(weight).map(|(&i, &weight)| Ok(Term::Switch { index: index(i)?, weight }));
    states.chain(times).collect()
}

/// Set an integer or enumeration option of an integrator (or a float one, to an integer) by name. Options of the
/// integration are taken over by the next swb_integrator_reinit, or at once before the first step.
///
/// @return as swb_settings_set_int
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_int(
    integrator: *mut swb_integrator,
    name: *const c_char,
    value: i64,
) -> swb_status {
    setting(integrator, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(integrator, |o| o.set_option(name, Value::Int(value)))
    })
}

/// Set a float option of an integrator by name, as swb_integrator_set_int.
///
/// @return as swb_settings_set_double
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_double(
    integrator: *mut swb_integrator,
    name: *const c_char,
    value: f64,
) -> swb_status {
    setting(integrator, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(integrator, |o| o.set_option(name, Value::Float(value)))
    })
}

/// Set any option of an integrator by name from text, as swb_integrator_set_int.
///
/// @return as swb_settings_set_string
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_string(
    integrator: *mut swb_integrator,
    name: *const c_char,
    value: *const c_char,
) -> swb_status {
    setting(integrator, || unsafe {
        let (name, value) = (raw::text(name, "name")?, raw::text(value, "value")?);
        handle::with_mut(integrator, |o| o.set_option(name, Value::Text(value.to_owned())))
    })
}

/// Set all options of an integrator, as swb_integrator_set_int.
///
/// @param[in] settings NULL for the defaults
/// @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_settings(
    integrator: *mut swb_integrator,
    settings: *const Settings,
) -> swb_status {
    setting(integrator, || unsafe {
        let settings = settings::read(settings)?;
        settings.validate()?;
        handle::with_mut(integrator, |o| {
            o.set_settings(settings);
            Ok(())
        })
    })
}

/// Options of an integrator, all of them.
///
/// @param[out] settings    every field is written
/// @param[in]  struct_size sizeof(swb_settings)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_settings(
    integrator: *const swb_integrator,
    settings: *mut Settings,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| write_sized(o.settings(), settings, struct_size, "settings")) })
}

/// Set who is called once per accepted step; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_progress(
    integrator: *mut swb_integrator,
    progress: swb_progress_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(integrator, || unsafe {
        handle::with_mut(integrator, |o| {
            let progress = progress.map(|function| Progress { function, user_data });
            o.set_watch(progress.map(|p| Box::new(move |e: &Engine, kind: StepKind| p.tell(e, kind)) as _));
            Ok(())
        })
    })
}

/// Set who is asked now and then whether to go on; NULL for nobody. For interpreters that look for signals only where their own
/// code runs: swb_integrator_set_progress calls at every step, which for a small system may cost as much as the step.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_poll(
    integrator: *mut swb_integrator,
    poll: swb_poll_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(integrator, || unsafe {
        handle::with_mut(integrator, |o| {
            let poll = poll.map(|function| Poll { function, user_data });
            o.set_poll(poll.map(|p| Box::new(move || p.ask()) as _));
            Ok(())
        })
    })
}

/// Set who gets the log, as much as the option log_level says; NULL for nobody. A line for each call at level info, one
/// for each switch at level debug, one for each step at level trace.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_set_log(
    integrator: *mut swb_integrator,
    log: swb_log_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(integrator, || unsafe {
        handle::with_mut(integrator, |o| {
            o.set_lines(LogSink::new(log, user_data).map(LogSink::lines));
            Ok(())
        })
    })
}

/// Stop the call that runs now with the outcome SWB_RUN_OUTCOME_STOPPED, or the next one if none runs; the one after it
/// goes on. From any thread and from signal handlers; only swb_integrator_free must not run at the same time. It is heeded
/// between steps: a call ends within the time of one step, which takes some tens of evaluations of the model.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_interrupt(integrator: *const swb_integrator) -> swb_status {
    unsafe { handle::interrupt(integrator) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_free(integrator: *mut swb_integrator) {
    unsafe { handle::free(integrator) }
}
