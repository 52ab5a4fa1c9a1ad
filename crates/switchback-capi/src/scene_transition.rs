//! Discrete states, transitions and clocks of scenes.

use std::ffi::c_char;

use switchback::error::Result;
use switchback::model::Strikes;

use super::expr::swb_expr;
use super::handle::{self, setting};
use super::model_transition::{clock, pulses, stated, Given};
use super::raw;
use super::scene::swb_scene;
use super::status::swb_status;
use super::transition::rule_of;

/// Add a discrete state to a scene, behind all its states: only transitions change it. Its rate is zero, and is none of those of
/// swb_scene_set_state_rates. Simulations start where they are told to.
///
/// @param[in]  name    for messages; NULL or "" for none
/// @param[in]  initial what it begins with where bindings are not told otherwise
/// @param[out] state   its place among the states; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE for a value that is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_discrete(
    scene: *mut swb_scene,
    name: *const c_char,
    initial: f64,
    state: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let name = if name.is_null() { "" } else { raw::text(name, "name")? };
        let k = handle::with_mut(scene, |s| s.change().add_discrete(name, initial))?;
        raw::write_optional(state, k as i64);
        Ok(())
    })
}

/// Add a transition to a scene: as swb_model_add_event, with the states of the scene. What is wrong with it is said by swb_scene_build.
///
/// A reset may move bodies. Contacts, impacts and friction follow from the new state; bodies that overlap behind it, constraints
/// that it leaves, and states of a projected system outside of their set end the run.
///
/// @param[in]  graph         the graph of the expressions
/// @param[in]  name          in results and reports, one line; NULL or "" for none
/// @param[in]  effect        enum swb_effect
/// @param[in]  trigger       enum swb_trigger
/// @param[in]  guard         an expression or a condition
/// @param[in]  direction     enum swb_direction
/// @param[in]  from_states   [n_from_states] discrete states that must have the values
/// @param[in]  from_values   [n_from_values] for the transition to be watched; none: always
/// @param[in]  reset_states  [n_reset_states] states that become what
/// @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump
/// @param[in]  to_states     [n_to_states] discrete states that get the values
/// @param[in]  to_values     [n_to_values] behind the reset
/// @param[out] index         number of the transition; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE for numbers that are no expressions, and unknown directions, effects and triggers; SWB_ERR_DIMENSION where
///         lists do not belong together; SWB_ERR_STATE for expressions of another graph
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_event(
    scene: *mut swb_scene,
    graph: *const swb_expr,
    name: *const c_char,
    effect: i32,
    trigger: i32,
    guard: i64,
    direction: i32,
    from_states: *const i64,
    n_from_states: i64,
    from_values: *const f64,
    n_from_values: i64,
    reset_states: *const i64,
    n_reset_states: i64,
    resets: *const i64,
    n_resets: i64,
    to_states: *const i64,
    n_to_states: i64,
    to_values: *const f64,
    n_to_values: i64,
    index: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let made = stated(
            rule_of(name, effect, trigger)?,
            (guard, direction),
            ((from_states, n_from_states), (from_values, n_from_values)),
            ((reset_states, n_reset_states), (resets, n_resets)),
            ((to_states, n_to_states), (to_values, n_to_values)),
        )?;
        let t = handle::with_ref(graph, |dag| made(dag))?;
        let k = handle::with_mut(scene, |s| {
            s.check_graph(graph)?;
            s.change().add_transition(t)
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Adds a clock that strikes at these times.
unsafe fn add_clock(
    (scene, graph): (*mut swb_scene, *mut swb_expr),
    strikes: impl FnOnce() -> Result<Strikes>,
    count: i64,
    given: &Given,
    index: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let made = clock(strikes()?, count, given)?;
        let k = handle::with_mut(graph, |dag| {
            let clock = made(dag)?;
            handle::with_mut(scene, |s| {
                s.check_graph(graph)?;
                s.change().add_clock(dag, &clock)
            })
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Add a clock to a scene: a transition at the times offset, offset + period, and so on, as swb_model_add_clock. A run that begins later has
/// to begin with the number of times before it as the count.
///
/// @param[in]  graph         the graph of the expressions
/// @param[in]  period        from one time to the next, positive
/// @param[in]  offset        the first time
/// @param[in]  count         the discrete state that counts the times, see swb_scene_add_discrete
/// @param[in]  reset_states  [n_reset_states] states that become what
/// @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump: a value that is sampled, a controller
/// @param[in]  to_states     [n_to_states] discrete states that get the values
/// @param[in]  to_values     [n_to_values] behind the reset
/// @param[out] index         number of the transition; may be NULL
/// @return as swb_scene_add_event; SWB_ERR_RANGE for times that are not finite, a period that is not positive, or a reset of the count
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_clock(
    scene: *mut swb_scene,
    graph: *mut swb_expr,
    period: f64,
    offset: f64,
    count: i64,
    reset_states: *const i64,
    n_reset_states: i64,
    resets: *const i64,
    n_resets: i64,
    to_states: *const i64,
    n_to_states: i64,
    to_values: *const f64,
    n_to_values: i64,
    index: *mut i64,
) -> swb_status {
    let given = Given {
        reset_states: (reset_states, n_reset_states),
        resets: (resets, n_resets),
        to_states: (to_states, n_to_states),
        to_values: (to_values, n_to_values),
    };
    unsafe { add_clock((scene, graph), || Ok(Strikes::Every { period, offset }), count, &given, index) }
}

/// Add a clock with a list of times to a scene: a transition for each.
///
/// @param[in]  graph         the graph of the expressions
/// @param[in]  times         [n_times] which increase, one at least
/// @param[in]  count         the discrete state that counts the times
/// @param[in]  reset_states  [n_reset_states] states that become what
/// @param[in]  resets        [n_resets] these expressions of the state before say, at every time the same; they may depend on the count
/// @param[in]  to_states     [n_to_states] discrete states that get the values
/// @param[in]  to_values     [n_to_values] behind the reset
/// @param[out] index         number of the first transition; may be NULL
/// @return as swb_scene_add_clock; SWB_ERR_RANGE for times that do not increase, or that there are none of
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_times(
    scene: *mut swb_scene,
    graph: *mut swb_expr,
    times: *const f64,
    n_times: i64,
    count: i64,
    reset_states: *const i64,
    n_reset_states: i64,
    resets: *const i64,
    n_resets: i64,
    to_states: *const i64,
    n_to_states: i64,
    to_values: *const f64,
    n_to_values: i64,
    index: *mut i64,
) -> swb_status {
    let given = Given {
        reset_states: (reset_states, n_reset_states),
        resets: (resets, n_resets),
        to_states: (to_states, n_to_states),
        to_values: (to_values, n_to_values),
    };
    let strikes = || Ok(Strikes::At(unsafe { raw::slice(times, n_times, "times") }?.to_vec()));
    unsafe { add_clock((scene, graph), strikes, count, &given, index) }
}

/// Add pulse-width modulation to a scene: a discrete state is 1 from the times offset, offset + period, and so on, until a part of the period is over,
/// and then 0.
///
/// @param[in]  graph   the graph of the expressions
/// @param[in]  duty    the part, an expression: the pulse ends where the ramp reaches it
/// @param[in]  period  from one time to the next, positive
/// @param[in]  offset  the first time
/// @param[in]  pulse   the discrete state that is the pulse
/// @param[in]  count   another one, which counts the times
/// @param[out] index   number of the transition that ends the pulse, before that of the clock; may be NULL
/// @return as swb_scene_add_clock; SWB_ERR_RANGE for a number that is not between 0 and 1 as the part
#[no_mangle]
pub unsafe extern "C" fn swb_scene_add_pwm(
    scene: *mut swb_scene,
    graph: *mut swb_expr,
    duty: i64,
    period: f64,
    offset: f64,
    pulse: i64,
    count: i64,
    index: *mut i64,
) -> swb_status {
    setting(scene, || unsafe {
        let k = handle::with_mut(graph, |dag| {
            let pwm = pulses(dag, duty, (period, offset), pulse, count)?;
            handle::with_mut(scene, |s| {
                s.check_graph(graph)?;
                s.change().add_pwm(dag, &pwm)
            })
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}
