//! Results of event-driven simulation: copies that belong to the caller.

use super::guard::{guard, query};
use super::handle::{self, Object};
use super::raw;
use super::report::{write_sized, Sized8};
use super::status::swb_status;
use std::ffi::{c_char, CStr};
use std::mem::size_of;
use std::ptr;
use switchback::error::{Error, Result};
use switchback::event::{self, Kind, Outcome};
use switchback::session::{Ending, Record};

/// Result of an event-driven simulation: state, switches, derivatives, dense output. Owned by the caller, independent
/// of the object it comes from.
pub struct swb_run(());
impl Object for swb_run {
    type Value = Record;
    const NAME: &'static str = "swb_run";
}

/// How an event-driven simulation stands. Numbers are only ever added.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_run_outcome {
    /// The time asked for is reached.
    Reached = 0,
    /// More steps than the option max_steps allows.
    MaxSteps = 1,
    /// The step became too short: a solution that grows without bound, a function that is not defined, tolerances
    /// below rounding.
    StepTooSmall = 2,
    /// Switches accumulate, and there is no sliding mode beyond, or the option zeno says stop.
    Zeno = 3,
    /// The continuation is not unique and the option ambiguity says stop.
    Ambiguous = 4,
    /// No active set continues the solution.
    NoContinuation = 5,
    /// A transition of the effect SWB_EFFECT_STOP happened: the run has ended where it was to.
    Event = 6,
    /// A callback or an interrupt asked to stop; the next call goes on.
    Stopped = 100,
}

const OUTCOMES: &[(Option<Outcome>, swb_run_outcome, &CStr)] = &[
    (Some(Outcome::Reached), swb_run_outcome::Reached, c"reached"),
    (Some(Outcome::MaxSteps), swb_run_outcome::MaxSteps, c"max_steps"),
    (Some(Outcome::StepTooSmall), swb_run_outcome::StepTooSmall, c"step_too_small"),
    (Some(Outcome::Zeno), swb_run_outcome::Zeno, c"zeno"),
    (Some(Outcome::Ambiguous), swb_run_outcome::Ambiguous, c"ambiguous"),
    (Some(Outcome::NoContinuation), swb_run_outcome::NoContinuation, c"no_continuation"),
    (Some(Outcome::Event), swb_run_outcome::Event, c"event"),
    (None, swb_run_outcome::Stopped, c"stopped"),
];

/// Number of an ending in the header.
pub(super) fn ending_number(e: Ending) -> i32 {
    let found = OUTCOMES.iter().find(|row| !e.stopped && row.0 == Some(e.outcome));
    found.map_or(swb_run_outcome::Stopped as i32, |row| row.1 as i32)
}

/// Name of an outcome of an event-driven simulation, such as "reached"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_run_outcome_name(outcome: i32) -> *const c_char {
    query(ptr::null(), || OUTCOMES.iter().find(|row| row.1 as i32 == outcome).map_or(ptr::null(), |row| row.2.as_ptr()))
}

/// Kinds of switches of an event-driven simulation.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_event_kind {
    /// Modes leave the active set and others enter it.
    Cross = 0,
    /// Modes enter: a sliding mode begins, or gets another mode.
    Enter = 1,
    /// Modes leave: a sliding mode ends, or loses a mode.
    Leave = 2,
    /// Modes leave although they could stay: the solution is not unique.
    Spontaneous = 3,
}

/// A change of the active set of a subsystem.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_event {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// An enum swb_event_kind.
    pub kind: i64,
    /// The subsystem, counted among those with more than one mode.
    pub subsystem: i64,
    /// Active modes before, bit i for mode i; modes from 64 on are in swb_run_event_modes only.
    pub before: u64,
    /// Active modes after.
    pub after: u64,
    /// 1 if another subsystem switches at the same time.
    pub simultaneous: i64,
    /// 1 if the continuation was unique.
    pub unique: i64,
    /// Rate at which the quantity that vanishes (a difference of indicators g, or a weight theta) goes through zero
    /// before the switch; NaN where the switch is not caused by one.
    pub rate: f64,
    /// Cosine between the gradient of the surface and the velocity: near zero the contact is grazing. NaN for a
    /// weight.
    pub transversality: f64,
}
unsafe impl Sized8 for swb_event {}

impl swb_event {
    fn of(s: &event::Switch) -> swb_event {
        let mask = |modes: &[usize]| modes.iter().filter(|&&m| m < 64).fold(0, |bits, &m| bits | 1 << m);
        let kind = match s.kind {
            Kind::Cross => swb_event_kind::Cross,
            Kind::Enter => swb_event_kind::Enter,
            Kind::Leave => swb_event_kind::Leave,
            Kind::Spontaneous => swb_event_kind::Spontaneous,
            _ => unreachable!("every kind has a number in the header"),
        };
        swb_event {
            struct_size: size_of::<swb_event>() as u64,
            t: s.t,
            kind: kind as i64,
            subsystem: s.subsystem as i64,
            before: mask(&s.before),
            after: mask(&s.after),
            simultaneous: s.simultaneous.into(),
            unique: s.unique.into(),
            rate: s.rate,
            transversality: s.transversality,
        }
    }
}

/// Work of an event-driven simulation.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_run_stats {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Accepted steps.
    pub steps: i64,
    /// Rejected steps.
    pub rejections: i64,
    /// Steps repeated to end at a switch.
    pub relocations: i64,
    /// Evaluations of the right-hand side.
    pub evaluations: i64,
    /// Evaluations of its Jacobian.
    pub jacobians: i64,
    /// Newton iterations.
    pub newton: i64,
    /// Factorisations.
    pub factorisations: i64,
    /// Switches, all subsystems together, those beyond the option max_switches included.
    pub switches: i64,
    /// Points at which switches accumulate.
    pub accumulations: i64,
    /// Seconds.
    pub time_total: f64,
    /// Transitions.
    pub jumps: i64,
    /// Impacts, each contact for itself.
    pub impacts: i64,
    /// What transitions noted, that beyond the option max_switches included.
    pub notes: i64,
}
unsafe impl Sized8 for swb_run_stats {}

impl swb_run_stats {
    pub(super) fn of(s: &event::Statistics, seconds: f64) -> swb_run_stats {
        swb_run_stats {
            struct_size: 0,
            steps: s.steps as i64,
            rejections: s.rejections as i64,
            relocations: s.relocations as i64,
            evaluations: s.evaluations as i64,
            jacobians: s.jacobians as i64,
            newton: s.newton as i64,
            factorisations: s.factorisations as i64,
            switches: s.switches as i64,
            accumulations: s.accumulations as i64,
            time_total: seconds,
            jumps: s.jumps as i64,
            impacts: s.impacts as i64,
            notes: s.notes as i64,
        }
    }
}

/// Numbers of a run, the lengths of its arrays.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_run_info {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// States.
    pub nx: i64,
    /// An enum swb_run_outcome.
    pub outcome: i64,
    /// Start.
    pub t_start: f64,
    /// Time reached.
    pub t_end: f64,
    /// Switches in the log.
    pub n_events: i64,
    /// Subsystems that can switch: those with more than one mode, in the order they were added.
    pub n_subsystems: i64,
    /// Steps with dense output; 0 without the option dense.
    pub n_pieces: i64,
    /// Columns of the derivatives: initial states (none where the option sensitivity is "inputs"), parameters, controls; 0 without the option.
    pub n_columns: i64,
    /// 1 if the derivatives hold for one side only: simultaneous switches, a continuation that is not unique, a surface
    /// that is only touched, accumulating switches.
    pub one_sided: i64,
    /// Points with several continuations.
    pub n_branch_points: i64,
    /// Surfaces only touched.
    pub n_contacts: i64,
    /// Points at which switches accumulate.
    pub n_accumulations: i64,
    /// Transitions in the log.
    pub n_jumps: i64,
    /// Impacts in the log, one for every contact with an impulse.
    pub n_impacts: i64,
    /// Contacts of the scene.
    pub n_scene_contacts: i64,
    /// 1 if contacts of the scene were redundant at some time: the motion is unique, the forces are those of least norm.
    pub redundant: i64,
    /// What transitions noted, see swb_run_notes.
    pub n_notes: i64,
    /// The transition that ended the run, from 0; -1 if none did.
    pub stopped_by: i64,
}
unsafe impl Sized8 for swb_run_info {}

/// A point from which several solutions go on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_branch_point {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// Continuations that differ in their velocity.
    pub n_continuations: i64,
    /// The continuation that was taken, from 0; -1 where the run stopped.
    pub taken: i64,
}
unsafe impl Sized8 for swb_branch_point {}

/// A surface that is only touched.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_contact {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// The subsystem, counted among those with more than one mode.
    pub subsystem: i64,
    /// Derivative of the difference of indicators along the solution.
    pub rate: f64,
    /// Cosine between the gradient of the surface and the velocity.
    pub transversality: f64,
}
unsafe impl Sized8 for swb_contact {}

/// Accumulating switches.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_accumulation {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time at which they accumulate, by the geometric series of the last intervals.
    pub t: f64,
    /// Time at which ordinary integration begins again.
    pub until: f64,
    /// Steps of the policy time_stepping, 0 with the others.
    pub steps: i64,
    /// Error that these steps added to the state, relative to the tolerance.
    pub error: f64,
}
unsafe impl Sized8 for swb_accumulation {}

/// Write one struct for each item of a list to an array of the caller.
pub(super) unsafe fn write_structs<S, T: Sized8>(
    items: &[S],
    of: impl Fn(&S) -> T,
    out: *mut T,
    n: i64,
    struct_size: u64,
    what: &str,
) -> Result<()> {
    if usize::try_from(n) != Ok(items.len()) {
        return Err(Error::Dimension(format!("{what} has length {n}, not {}", items.len())));
    }
    let bytes = out.cast::<u8>();
    for (k, item) in items.iter().enumerate() {
        let at = if bytes.is_null() { out } else { bytes.wrapping_add(k * struct_size as usize).cast() };
        unsafe { write_sized(&of(item), at, struct_size, what)? };
    }
    Ok(())
}

fn columns(r: &Record) -> usize {
    r.run.sensitivity.as_ref().map_or(0, |s| s.len() / r.run.x.len())
}

fn event(r: &Record, index: i64) -> Result<&event::Switch> {
    let n = r.run.switches.len();
    let found = usize::try_from(index).ok().and_then(|i| r.run.switches.get(i));
    found.ok_or_else(|| Error::Dimension(format!("there is no switch {index}, the log has {n}")))
}

pub(super) fn need_derivatives<T>(v: Option<T>) -> Result<T> {
    v.ok_or_else(|| Error::State("there are no derivatives: switch the option sensitivity on, then simulate".into()))
}

/// Numbers of a run.
///
/// @param[out] info        every field is written
/// @param[in]  struct_size sizeof(swb_run_info)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_get_info(
    run: *const swb_run,
    info: *mut swb_run_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let value = swb_run_info {
                struct_size: 0,
                nx: r.run.x.len() as i64,
                outcome: ending_number(r.ending).into(),
                t_start: r.t_start,
                t_end: r.run.t,
                n_events: r.run.switches.len() as i64,
                n_subsystems: r.n_modes.len() as i64,
                n_pieces: r.run.path.as_ref().map_or(0, |p| p.len()) as i64,
                n_columns: columns(r) as i64,
                one_sided: r.run.one_sided.into(),
                n_branch_points: r.run.branchings.len() as i64,
                n_contacts: r.run.contacts.len() as i64,
                n_accumulations: r.run.accumulations.len() as i64,
                n_jumps: r.run.jumps.len() as i64,
                n_impacts: r.run.impacts.len() as i64,
                redundant: r.run.phases.iter().any(|p| p.redundant).into(),
                n_scene_contacts: r.run.mechanics.as_ref().map_or(0, |m| m.contacts.len()) as i64,
                n_notes: r.run.notes.len() as i64,
                stopped_by: r.run.stopped_by.map_or(-1, |k| k as i64),
            };
            write_sized(&value, info, struct_size, "info")
        })
    })
}

/// Why a run ended early, in words; if it reached its time, what is not known to the tolerances, or "".
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL, written in any case; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_run_reason(
    run: *const swb_run,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(run, |r| raw::write_text(r.run.reason.as_bytes(), buf, len, needed)) })
}

/// Work of a run.
///
/// @param[out] stats       every field is written
/// @param[in]  struct_size sizeof(swb_run_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_get_stats(
    run: *const swb_run,
    stats: *mut swb_run_stats,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| write_sized(&swb_run_stats::of(&r.run.stats, r.seconds), stats, struct_size, "stats"))
    })
}

/// State reached.
///
/// @param[out] x [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_state(run: *const swb_run, x: *mut f64, nx: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(run, |r| raw::write_slice(x, nx, &r.run.x, "x")) })
}

/// Switches in the order of time.
///
/// @param[out] events      [n] n_events
/// @param[in]  struct_size sizeof(swb_event)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_events(
    run: *const swb_run,
    events: *mut swb_event,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| write_structs(&r.run.switches, swb_event::of, events, n, struct_size, "events"))
    })
}

/// Points with several continuations, in the order of time.
///
/// @param[out] points      [n] n_branch_points
/// @param[in]  struct_size sizeof(swb_branch_point)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_branch_points(
    run: *const swb_run,
    points: *mut swb_branch_point,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let of = |b: &event::Branching| swb_branch_point {
                struct_size: 0,
                t: b.t,
                n_continuations: b.continuations.len() as i64,
                taken: b.taken.map_or(-1, |i| i as i64),
            };
            write_structs(&r.run.branchings, of, points, n, struct_size, "points")
        })
    })
}

/// Surfaces only touched, in the order of time.
///
/// @param[out] contacts    [n] n_contacts
/// @param[in]  struct_size sizeof(swb_contact)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_contacts(
    run: *const swb_run,
    contacts: *mut swb_contact,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let of = |c: &event::Contact| swb_contact {
                struct_size: 0,
                t: c.t,
                subsystem: c.subsystem as i64,
                rate: c.rate,
                transversality: c.transversality,
            };
            write_structs(&r.run.contacts, of, contacts, n, struct_size, "contacts")
        })
    })
}

/// Accumulating switches, in the order of time.
///
/// @param[out] points      [n] n_accumulations
/// @param[in]  struct_size sizeof(swb_accumulation)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_accumulations(
    run: *const swb_run,
    points: *mut swb_accumulation,
    n: i64,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let of = |a: &event::Accumulation| swb_accumulation {
                struct_size: 0,
                t: a.t,
                until: a.until,
                steps: a.steps as i64,
                error: a.error,
            };
            write_structs(&r.run.accumulations, of, points, n, struct_size, "points")
        })
    })
}

/// Numbers of modes of the subsystems that can switch.
///
/// @param[out] n_modes [n] n_subsystems
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_modes(run: *const swb_run, n_modes: *mut i64, n: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(run, |r| raw::write_slice(n_modes, n, &r.n_modes, "n_modes")) })
}

/// Active modes of its subsystem before and after a switch.
///
/// @param[in]  index  the switch, from 0
/// @param[out] before [n] 0 or 1 for each mode of the subsystem
/// @param[out] after  [n] the same
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_event_modes(
    run: *const swb_run,
    index: i64,
    before: *mut i32,
    after: *mut i32,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let s = event(r, index)?;
            let n_modes = r.n_modes.get(s.subsystem).copied().unwrap_or(0);
            let flags = |active: &[usize]| (0..n_modes as usize).map(|m| i32::from(active.contains(&m))).collect();
            let (a, b): (Vec<i32>, Vec<i32>) = (flags(&s.before), flags(&s.after));
            raw::check_slice(after, n, b.len(), "after")?;
            raw::write_slice(before, n, &a, "before")?;
            raw::write_slice(after, n, &b, "after")
        })
    })
}

/// Derivatives of the state reached with respect to initial states, parameters and controls, the latter changed by the
/// same amount over the whole run.
///
/// With the option sensitivity at inputs those of the initial states are left out; of a model that has neither parameters nor
/// controls no columns remain.
///
/// @param[out] s [n] nx * n_columns, by columns: those of the initial states, then of the parameters, then of the controls
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without the option sensitivity
#[no_mangle]
pub unsafe extern "C" fn swb_run_sensitivity(run: *const swb_run, s: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let rows = need_derivatives(r.run.sensitivity.as_ref())?;
            let (nx, columns) = (r.run.x.len(), columns(r));
            let all: Vec<f64> = (0..columns * nx).map(|k| rows[(k % nx) * columns + k / nx]).collect();
            raw::write_slice(s, n, &all, "s")
        })
    })
}

/// Derivatives of the time of a switch with respect to initial states, parameters and controls. NaN where the time has
/// none.
///
/// @param[in]  index the switch, from 0
/// @param[out] dt    [n] n_columns
/// @return as swb_run_sensitivity
#[no_mangle]
pub unsafe extern "C" fn swb_run_event_sensitivity(
    run: *const swb_run,
    index: i64,
    dt: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            need_derivatives(r.run.sensitivity.as_ref())?;
            raw::write_slice(dt, n, &event(r, index)?.dt, "dt")
        })
    })
}

/// Times between which the dense output has a polynomial each: starts and ends of the steps.
///
/// @param[out] t [n] n_pieces + 1; none if there are no pieces
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_times(run: *const swb_run, t: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(run, |r| {
            let times = r.run.path.as_ref().map_or_else(Vec::new, |p| p.times());
            raw::write_slice(t, n, &times, "t")
        })
    })
}

/// States at any times of the run, or their derivatives with respect to time. At a switch the piece before it counts.
///
/// @param[in]  t [n_t] between start and end, in any order
/// @param[in]  k order of the derivative, 0 for the state
/// @param[out] x [n_x] n_t * nx, the values of one time together
/// @return SWB_OK; SWB_ERR_RANGE if a time is outside or k is negative; SWB_ERR_STATE without the option dense
#[no_mangle]
pub unsafe extern "C" fn swb_run_evaluate(
    run: *const swb_run,
    t: *const f64,
    n_t: i64,
    k: i64,
    x: *mut f64,
    n_x: i64,
) -> swb_status {
    guard(|| unsafe {
        let times = raw::slice(t, n_t, "t")?;
        let k = order(k)?;
        handle::with_ref(run, |r| {
            let path = r.run.path.as_ref().ok_or_else(|| {
                Error::State("there is no dense output: switch the option dense on, then simulate".into())
            })?;
            let nx = r.run.x.len();
            let mut all = vec![0.0; times.len() * nx];
            for (&t, x) in times.iter().zip(all.chunks_exact_mut(nx)) {
                path.eval(t, k, x)?;
            }
            raw::write_slice(x, n_x, &all, "x")
        })
    })
}

/// Order of a derivative.
pub(super) fn order(k: i64) -> Result<usize> {
    usize::try_from(k).map_err(|_| Error::Range(format!("the order of the derivative is {k}: give 0 or more")))
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_run_free(run: *mut swb_run) {
    unsafe { handle::free(run) }
}
