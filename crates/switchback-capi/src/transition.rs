//! Transitions: of a system, and in the result of a simulation.

use std::ffi::c_char;
use std::ptr;

use super::function::{shared, swb_function};
use super::guard::guard;
use super::handle::{self, setting};
use super::raw;
use super::report::Sized8;
use super::run::{need_derivatives, swb_run, write_structs};
use super::status::swb_status;
use super::system::swb_system;
use switchback::error::{Error, Result};
use switchback::event::{Jump, Noted};
use switchback::session::Record;
use switchback::system::{Direction, Effect, Rule, Transition, Trigger};

/// The direction in which the guard of a transition passes zero.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_direction {
    /// From below: the transition happens where the guard becomes positive.
    Rising = 0,
    /// From above: the transition happens where the guard becomes negative.
    Falling = 1,
}

/// What happens where the condition of a transition becomes true.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_effect {
    /// The state jumps.
    Jump = 0,
    /// Time and state are written down; no step ends for that.
    Note = 1,
    /// The run ends there.
    Stop = 2,
}

/// Does a transition happen where its condition is true, or where it becomes true?
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_trigger {
    /// Where it is true: at once when its discrete states begin, if it is true then.
    Level = 0,
    /// Where it becomes true: what is true when its discrete states begin has to be false before. All that note or stop have this one.
    Edge = 1,
}

/// Discrete states and their values.
pub(super) unsafe fn values_of(
    (states, n_states): (*const i64, i64),
    (values, n_values): (*const f64, i64),
    what: &str,
) -> Result<Vec<(usize, f64)>> {
    let (states, values) = unsafe { (raw::slice(states, n_states, what)?, raw::slice(values, n_values, what)?) };
    if states.len() != values.len() {
        return Err(Error::Dimension(format!(
            "`{what}` has {} states and {} values: give one value for each",
            states.len(),
            values.len()
        )));
    }
    let bad = |s: i64| Error::Range(format!("`{what}` names the state {s}: states count from 0"));
    states.iter().zip(values).map(|(&s, &v)| Ok((usize::try_from(s).map_err(|_| bad(s))?, v))).collect()
}

pub(super) fn direction_of(direction: i32) -> Result<Direction> {
    match direction {
        0 => Ok(Direction::Rising),
        1 => Ok(Direction::Falling),
        d => Err(Error::Range(format!("direction is {d}: give an enum swb_direction"))),
    }
}

/// Add a transition: where the guard passes zero in its direction while the discrete states are as `from` says, the state
/// becomes what reset makes of it, and the discrete states become as `to` says.
///
/// A discrete state is a state that a transition names in `from` or `to`; its derivative must be zero. Only the event-driven
/// simulation follows transitions. A guard that is beyond zero, or at zero and on its way, when the discrete states become as
/// `from` says, acts at once: at the start and after a change of controls or parameters, too. Of several at one time the first
/// that was added is made first, and the others if they still hold; 64 at one time end the run. A transition that leaves its
/// own guard beyond zero is watched again when the guard has been back.
///
/// @param[in]  guard       one output
/// @param[in]  direction   enum swb_direction
/// @param[in]  from_states [n_from_states] discrete states that must have the values
/// @param[in]  from_values [n_from_values] for the transition to be watched; none: always
/// @param[in]  reset       nx outputs, the state behind the transition; NULL: the state before it
/// @param[in]  to_states   [n_to_states] discrete states that get the values
/// @param[in]  to_values   [n_to_values] behind the reset
/// @param[out] index       number of the transition; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if sizes do not fit; SWB_ERR_RANGE if states do not exist or repeat, or for an unknown
///         direction; SWB_ERR_STATE if nothing changes
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_transition(
    system: *mut swb_system,
    guard: *const swb_function,
    direction: i32,
    from_states: *const i64,
    n_from_states: i64,
    from_values: *const f64,
    n_from_values: i64,
    reset: *const swb_function,
    to_states: *const i64,
    n_to_states: i64,
    to_values: *const f64,
    n_to_values: i64,
    index: *mut i64,
) -> swb_status {
    let (jump, level) = (Effect::Jump as i32, Trigger::Level as i32);
    unsafe {
        swb_system_add_event(
            system,
            ptr::null(),
            jump,
            level,
            guard,
            direction,
            from_states,
            n_from_states,
            from_values,
            n_from_values,
            reset,
            to_states,
            n_to_states,
            to_values,
            n_to_values,
            index,
        )
    }
}

/// Add a transition with a name, an effect and a trigger; the rest is that of swb_system_add_transition.
///
/// What notes or stops changes nothing: it has neither reset nor `to`. Where the run ends, derivatives are those of the last state with the time
/// of its end.
///
/// @param[in]  name        in results and reports, one line; NULL or "" for none
/// @param[in]  effect      enum swb_effect
/// @param[in]  trigger     enum swb_trigger
/// @param[in]  guard       one output
/// @param[in]  direction   enum swb_direction
/// @param[in]  from_states [n_from_states] discrete states that must have the values
/// @param[in]  from_values [n_from_values] for the transition to be watched; none: always
/// @param[in]  reset       nx outputs, the state behind the transition; NULL: the state before it
/// @param[in]  to_states   [n_to_states] discrete states that get the values
/// @param[in]  to_values   [n_to_values] behind the reset
/// @param[out] index       number of the transition; may be NULL
/// @return as swb_system_add_transition; SWB_ERR_RANGE for unknown effects and triggers and for a name that is there already; SWB_ERR_STATE if
///         what notes or stops changes the state, or has the trigger level
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_event(
    system: *mut swb_system,
    name: *const c_char,
    effect: i32,
    trigger: i32,
    guard: *const swb_function,
    direction: i32,
    from_states: *const i64,
    n_from_states: i64,
    from_values: *const f64,
    n_from_values: i64,
    reset: *const swb_function,
    to_states: *const i64,
    n_to_states: i64,
    to_values: *const f64,
    n_to_values: i64,
    index: *mut i64,
) -> swb_status {
    self::setting(system, || unsafe {
        let transition = Transition {
            guard: shared(guard, "guard")?,
            clauses: Vec::new(),
            direction: direction_of(direction)?,
            from: values_of((from_states, n_from_states), (from_values, n_from_values), "from")?,
            reset: if reset.is_null() { None } else { Some(shared(reset, "reset")?.into()) },
            to: values_of((to_states, n_to_states), (to_values, n_to_values), "to")?,
            rule: rule_of(name, effect, trigger)?,
        };
        let k = handle::with_mut(system, |s| s.add_transition(transition))?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Name, effect and trigger as they are given.
pub(super) unsafe fn rule_of(name: *const c_char, effect: i32, trigger: i32) -> Result<Rule> {
    let name = if name.is_null() { "" } else { unsafe { raw::text(name, "name")? } };
    Ok(Rule { name: name.to_owned(), effect: Effect::from_number(effect)?, trigger: Trigger::from_number(trigger)? })
}

/// Add times at which functions of a system are not smooth, such as the knots of a table of time. Event-driven simulation ends its steps there, and
/// begins anew where the right-hand side jumps. Tables in models say these times themselves.
///
/// @param[in] t     [n_t] in any order
/// @param[in] jumps [n_jumps] as many: 1 where the right-hand side jumps, else 0
/// @return SWB_OK; SWB_ERR_DIMENSION if the lengths differ; SWB_ERR_RANGE for times that are not finite
#[no_mangle]
pub unsafe extern "C" fn swb_system_add_known_times(
    system: *mut swb_system,
    t: *const f64,
    n_t: i64,
    jumps: *const i32,
    n_jumps: i64,
) -> swb_status {
    self::setting(system, || unsafe {
        let (t, jumps) = (raw::slice(t, n_t, "t")?, raw::slice(jumps, n_jumps, "jumps")?);
        if t.len() != jumps.len() {
            return Err(Error::Dimension(format!(
                "there are {} times and {} jumps: give one for each",
                t.len(),
                jumps.len()
            )));
        }
        let times: Vec<(f64, bool)> = t.iter().zip(jumps).map(|(t, j)| (*t, *j != 0)).collect();
        handle::with_mut(system, |s| s.add_known_times(&times))
    })
}

/// What a transition of the effect SWB_EFFECT_NOTE wrote down.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_note {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: i64,
    /// Rate at which the guard passes zero, positive in its direction; NaN where a jump of the state has made the condition true.
    pub rate: f64,
}
unsafe impl Sized8 for swb_note {}

/// What was noted in the order of time; the number is n_notes of swb_run_info.
///
/// @param[out] notes       [n] n_notes
/// @param[in]  struct_size sizeof(swb_note)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_notes(
    run: *const swb_run,
    notes: *mut swb_note,
    n: i64,
    struct_size: u64,
) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(run, |r| {
            let of = |n: &Noted| swb_note { struct_size: 0, t: n.t, transition: n.transition as i64, rate: n.rate };
            write_structs(&r.run.notes, of, notes, n, struct_size, "notes")
        })
    })
}

fn noted(r: &Record, index: i64) -> Result<&Noted> {
    let all = &r.run.notes;
    let found = usize::try_from(index).ok().and_then(|i| all.get(i));
    found.ok_or_else(|| Error::Dimension(format!("there is no note {index}, the run has {}", all.len())))
}

/// The state at a note.
///
/// @param[in]  index its place in swb_run_notes, from 0
/// @param[out] x     [n] nx
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_note_state(run: *const swb_run, index: i64, x: *mut f64, n: i64) -> swb_status {
    self::guard(|| unsafe { handle::with_ref(run, |r| raw::write_slice(x, n, &noted(r, index)?.x, "x")) })
}

/// Derivatives of the time of a note with respect to initial states, parameters and controls; NaN in an implicit step.
///
/// @param[in]  index its place in swb_run_notes, from 0
/// @param[out] dt    [n] n_columns
/// @return as swb_run_sensitivity
#[no_mangle]
pub unsafe extern "C" fn swb_run_note_sensitivity(run: *const swb_run, index: i64, dt: *mut f64, n: i64) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(run, |r| {
            need_derivatives(r.run.sensitivity.as_ref())?;
            raw::write_slice(dt, n, &noted(r, index)?.dt, "dt")
        })
    })
}

/// A transition that was made.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_jump {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Time.
    pub t: f64,
    /// The transition, in the order they were added to the system.
    pub transition: i64,
    /// 1 if another transition was made at the same time.
    pub simultaneous: i64,
    /// Rate at which the guard passes zero, positive in its direction; NaN where it held when its discrete state began.
    pub rate: f64,
}
unsafe impl Sized8 for swb_jump {}

/// The transitions of a run in the order they were made; their number is n_jumps of swb_run_info.
///
/// @param[out] jumps       [n] n_jumps
/// @param[in]  struct_size sizeof(swb_jump)
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_run_jumps(
    run: *const swb_run,
    jumps: *mut swb_jump,
    n: i64,
    struct_size: u64,
) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(run, |r| {
            let of = |j: &Jump| swb_jump {
                struct_size: 0,
                t: j.t,
                transition: j.transition as i64,
                simultaneous: j.simultaneous.into(),
                rate: j.rate,
            };
            write_structs(&r.run.jumps, of, jumps, n, struct_size, "jumps")
        })
    })
}

/// The place of a transition of a run.
fn place(r: &Record, index: i64) -> Result<usize> {
    let n = r.run.jumps.len();
    let found = usize::try_from(index).ok().filter(|i| *i < n);
    found.ok_or_else(|| Error::Dimension(format!("there is no transition {index}, the run has {n}")))
}

/// The states just before and just behind a transition. Where a system of many units is not stopped for what happens in one, those that the
/// transition does not name are NaN: dense output knows them.
///
/// @param[in]  index  its place in swb_run_jumps, from 0
/// @param[out] before [n] nx
/// @param[out] after  [n] nx
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_run_jump_states(
    run: *const swb_run,
    index: i64,
    before: *mut f64,
    after: *mut f64,
    n: i64,
) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(run, |r| {
            let (first, second) = r.run.jump_states(place(r, index)?);
            raw::check_slice(after, n, second.len(), "after")?;
            raw::write_slice(before, n, &first, "before")?;
            raw::write_slice(after, n, &second, "after")
        })
    })
}

/// Derivatives of the time of a transition with respect to initial states, parameters and controls.
///
/// @param[in]  index its place in swb_run_jumps, from 0
/// @param[out] dt    [n] n_columns
/// @return as swb_run_sensitivity
#[no_mangle]
pub unsafe extern "C" fn swb_run_jump_sensitivity(run: *const swb_run, index: i64, dt: *mut f64, n: i64) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(run, |r| {
            need_derivatives(r.run.sensitivity.as_ref())?;
            raw::write_slice(dt, n, &r.run.jumps[place(r, index)?].dt, "dt")
        })
    })
}
