//! Discrete states and transitions of scenes.

use std::ffi::c_char;

use super::expr::swb_expr;
use super::handle::{self, setting};
use super::model_transition::stated;
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
/// @return SWB_OK; SWB_ERR_RANGE for a value that is not finite; SWB_ERR_UNSUPPORTED for projected systems
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
/// A reset may move bodies. Contacts, impacts and friction follow from the new state; bodies that overlap behind it, and constraints
/// that it leaves, end the run.
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
///         lists do not belong together; SWB_ERR_STATE for expressions of another graph; SWB_ERR_UNSUPPORTED for projected systems
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
