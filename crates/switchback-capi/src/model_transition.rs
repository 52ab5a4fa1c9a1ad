//! Transitions and discrete states of models: guards and resets are expressions.

use std::ffi::c_char;
use std::ptr;

use super::expr::{swb_expr, swb_model};
use super::guard::guard;
use super::handle::{self, setting};
use super::raw;
use super::status::swb_status;
use super::transition::{direction_of, rule_of, values_of};
use switchback::error::{Error, Result};
use switchback::expr::{Dag, Id};
use switchback::memory::sizes::size;
use switchback::model::{Built, Clock, Pwm, Strikes, Transition};
use switchback::system::{Direction, Effect, Rule, Trigger};

/// Say that the last n states of a model are discrete, and with which values they begin where nothing else is given: only
/// transitions change them. Reports name them and documents keep the values; simulations start where they are told to. Names of
/// values (swb_model_set_value_names) are given behind this.
///
/// @param[in] initial [n]
/// @return SWB_OK; SWB_ERR_DIMENSION if there are more values than states; SWB_ERR_RANGE for a value that is not finite; SWB_ERR_STATE
///         if such a state has a derivative
#[no_mangle]
pub unsafe extern "C" fn swb_model_set_discrete(model: *mut swb_model, initial: *const f64, n: i64) -> swb_status {
    setting(model, || unsafe {
        let initial = raw::slice(initial, n, "initial")?;
        handle::with_mut(model, |m| m.set_discrete(initial))
    })
}

/// Name the values 0, 1, ... of a discrete state: the states of an automaton. Reports and documents keep the names.
///
/// @param[in] discrete the discrete state, from 0: those of swb_model_set_discrete, in their order
/// @param[in] names    the names, each behind the first after a line break; NULL for none
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such discrete state; SWB_ERR_RANGE for names that are empty or repeat
#[no_mangle]
pub unsafe extern "C" fn swb_model_set_value_names(
    model: *mut swb_model,
    discrete: i64,
    names: *const c_char,
) -> swb_status {
    setting(model, || unsafe {
        let k = size(discrete, "discrete")?;
        let given = if names.is_null() { "" } else { raw::text(names, "names")? };
        let list: Vec<String> =
            if given.is_empty() { Vec::new() } else { given.split('\n').map(str::to_owned).collect() };
        handle::with_mut(model, |m| m.set_value_names(k, &list))
    })
}

/// Names of the values of a discrete state, as swb_model_set_value_names takes them; an empty text if there are none.
///
/// @param[in]  discrete the discrete state, from 0
/// @param[out] buf      [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed   length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such discrete state, or the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_model_get_value_names(
    model: *const swb_model,
    discrete: i64,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let k = size(discrete, "discrete")?;
        handle::with_ref(model, |m| {
            let n = m.value_names().len();
            let names = m.value_names().get(k);
            let names =
                names.ok_or_else(|| Error::Dimension(format!("there is no discrete state {k}, the model has {n}")))?;
            raw::write_text(names.join("\n").as_bytes(), buf, len, needed)
        })
    })
}

/// Add a transition to a model, and thereby to all systems made of it later; see swb_system_add_transition.
///
/// @param[in]  graph         the graph the model was made of
/// @param[in]  guard         an expression, or a condition: joined of comparisons, it becomes true (rising) or false (falling)
/// @param[in]  direction     enum swb_direction
/// @param[in]  from_states   [n_from_states] discrete states that must have the values
/// @param[in]  from_values   [n_from_values] for the transition to be watched; none: always
/// @param[in]  reset_states  [n_reset_states] states that become what
/// @param[in]  resets        [n_resets] these expressions of the state before say; the others stay as they are
/// @param[in]  to_states     [n_to_states] discrete states that get the values
/// @param[in]  to_values     [n_to_values] behind the reset
/// @param[out] index         number of the transition; may be NULL
/// @return as swb_system_add_transition; SWB_ERR_RANGE for resets that are conditions; SWB_ERR_UNSUPPORTED for guards that switch
#[no_mangle]
pub unsafe extern "C" fn swb_model_add_transition(
    model: *mut swb_model,
    graph: *mut swb_expr,
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
    let (jump, level) = (Effect::Jump as i32, Trigger::Level as i32);
    unsafe {
        swb_model_add_event(
            model,
            graph,
            ptr::null(),
            jump,
            level,
            guard,
            direction,
            from_states,
            n_from_states,
            from_values,
            n_from_values,
            reset_states,
            n_reset_states,
            resets,
            n_resets,
            to_states,
            n_to_states,
            to_values,
            n_to_values,
            index,
        )
    }
}

/// Add a transition with a name, an effect and a trigger to a model; the rest is that of swb_model_add_transition. See swb_system_add_event.
///
/// @param[in]  graph         the graph the model was made of
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
/// @return as swb_system_add_event; SWB_ERR_RANGE for resets that are conditions; SWB_ERR_UNSUPPORTED for guards that switch
#[no_mangle]
pub unsafe extern "C" fn swb_model_add_event(
    model: *mut swb_model,
    graph: *mut swb_expr,
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
    self::setting(model, || unsafe {
        let made = stated(
            rule_of(name, effect, trigger)?,
            (guard, direction),
            ((from_states, n_from_states), (from_values, n_from_values)),
            ((reset_states, n_reset_states), (resets, n_resets)),
            ((to_states, n_to_states), (to_values, n_to_values)),
        )?;
        let k = handle::with_mut(graph, |dag| {
            let t = made(dag)?;
            handle::with_mut(model, |m| m.add_transition(dag, t))
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// What a clock does, as callers give it.
pub(super) struct Given {
    pub(super) reset_states: List<i64>,
    pub(super) resets: List<i64>,
    pub(super) to_states: List<i64>,
    pub(super) to_values: List<f64>,
}

/// A clock as callers give it: what makes it of the expressions of a graph.
pub(super) unsafe fn clock<'a>(
    strikes: Strikes,
    count: i64,
    given: &Given,
) -> Result<impl FnOnce(&Dag) -> Result<Clock> + 'a> {
    let count = size(count, "count")?;
    let to = unsafe { values_of(given.to_states, given.to_values, "to")? };
    let states: &'a [i64] = unsafe { raw::slice(given.reset_states.0, given.reset_states.1, "reset_states")? };
    let ids: &'a [i64] = unsafe { raw::slice(given.resets.0, given.resets.1, "resets")? };
    Ok(move |dag: &Dag| Ok(Clock { strikes, count, reset: resets_of(dag, states, ids)?, to }))
}

/// Pulse-width modulation as callers give it.
pub(super) fn pulses(dag: &Dag, duty: i64, (period, offset): (f64, f64), pulse: i64, count: i64) -> Result<Pwm> {
    let (pulse, count) = (size(pulse, "pulse")?, size(count, "count")?);
    Ok(Pwm { duty: dag.id(place(duty, "duty")?)?, period, offset, pulse, count })
}

/// Adds a clock that strikes at these times.
unsafe fn add_clock(
    (model, graph): (*mut swb_model, *mut swb_expr),
    strikes: impl FnOnce() -> Result<Strikes>,
    count: i64,
    given: &Given,
    index: *mut i64,
) -> swb_status {
    setting(model, || unsafe {
        let made = clock(strikes()?, count, given)?;
        let k = handle::with_mut(graph, |dag| {
            let clock = made(dag)?;
            handle::with_mut(model, |m| m.add_clock(dag, &clock))
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// A list as callers give it.
type List<T> = (*const T, i64);

/// A transition as callers give it: what makes it of the expressions of a graph.
pub(super) unsafe fn stated<'a>(
    rule: Rule,
    (guard, direction): (i64, i32),
    from: (List<i64>, List<f64>),
    reset: (List<i64>, List<i64>),
    to: (List<i64>, List<f64>),
) -> Result<impl FnOnce(&Dag) -> Result<Transition> + 'a> {
    let direction = direction_of(direction)?;
    let (from, to) = unsafe { (values_of(from.0, from.1, "from")?, values_of(to.0, to.1, "to")?) };
    let states: &'a [i64] = unsafe { raw::slice(reset.0 .0, reset.0 .1, "reset_states")? };
    let ids: &'a [i64] = unsafe { raw::slice(reset.1 .0, reset.1 .1, "resets")? };
    Ok(move |dag: &Dag| {
        let guard = dag.id(place(guard, "guard")?)?;
        Ok(Transition { guard, direction, from, reset: resets_of(dag, states, ids)?, to, rule })
    })
}

/// States and the expressions that they become.
fn resets_of(dag: &Dag, states: &[i64], ids: &[i64]) -> Result<Vec<(usize, Id)>> {
    if states.len() != ids.len() {
        return Err(Error::Dimension(format!(
            "there are {} states to reset and {} expressions: give one for each",
            states.len(),
            ids.len()
        )));
    }
    let one = |(&s, &id)| Ok((place(s, "reset_states")?, dag.id(place(id, "resets")?)?));
    states.iter().zip(ids).map(one).collect()
}

fn place(v: i64, what: &str) -> Result<usize> {
    usize::try_from(v).map_err(|_| Error::Range(format!("{what} is {v}: states and expressions count from 0")))
}

/// Add a clock to a model: a transition at the times offset, offset + period, and so on. The times are those of the formula to the last digit, however many there
/// are. A run that begins later begins with the number of times before it as the count.
///
/// @param[in]  graph         the graph the model was made of
/// @param[in]  period        from one time to the next, positive
/// @param[in]  offset        the first time
/// @param[in]  count         the discrete state that counts the times
/// @param[in]  reset_states  [n_reset_states] states that become what
/// @param[in]  resets        [n_resets] these expressions of the state before say, which may switch and jump: a value that is sampled, a controller
/// @param[in]  to_states     [n_to_states] discrete states that get the values
/// @param[in]  to_values     [n_to_values] behind the reset
/// @param[out] index         number of the transition; may be NULL
/// @return as swb_model_add_transition; SWB_ERR_RANGE for times that are not finite, a period that is not positive, or a reset of the count
#[no_mangle]
pub unsafe extern "C" fn swb_model_add_clock(
    model: *mut swb_model,
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
    unsafe { add_clock((model, graph), || Ok(Strikes::Every { period, offset }), count, &given, index) }
}

/// Add a clock with a list of times to a model: a transition for each.
///
/// @param[in]  graph         the graph the model was made of
/// @param[in]  times         [n_times] which increase, one at least
/// @param[in]  count         the discrete state that counts the times
/// @param[in]  reset_states  [n_reset_states] states that become what
/// @param[in]  resets        [n_resets] these expressions of the state before say, at every time the same; they may depend on the count
/// @param[in]  to_states     [n_to_states] discrete states that get the values
/// @param[in]  to_values     [n_to_values] behind the reset
/// @param[out] index         number of the first transition; may be NULL
/// @return as swb_model_add_clock; SWB_ERR_RANGE for times that do not increase, or that there are none of
#[no_mangle]
pub unsafe extern "C" fn swb_model_add_times(
    model: *mut swb_model,
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
    unsafe { add_clock((model, graph), strikes, count, &given, index) }
}

/// Add pulse-width modulation to a model: a discrete state is 1 from the times offset, offset + period, and so on, until a part of the period is over, and then 0.
///
/// @param[in]  graph   the graph the model was made of
/// @param[in]  duty    the part, an expression: the pulse ends where the ramp reaches it
/// @param[in]  period  from one time to the next, positive
/// @param[in]  offset  the first time
/// @param[in]  pulse   the discrete state that is the pulse
/// @param[in]  count   another one, which counts the times
/// @param[out] index   number of the transition that ends the pulse, before that of the clock; may be NULL
/// @return as swb_model_add_clock; SWB_ERR_RANGE for a number that is not between 0 and 1 as the part
#[no_mangle]
pub unsafe extern "C" fn swb_model_add_pwm(
    model: *mut swb_model,
    graph: *mut swb_expr,
    duty: i64,
    period: f64,
    offset: f64,
    pulse: i64,
    count: i64,
    index: *mut i64,
) -> swb_status {
    setting(model, || unsafe {
        let k = handle::with_mut(graph, |dag| {
            let pwm = pulses(dag, duty, (period, offset), pulse, count)?;
            handle::with_mut(model, |m| m.add_pwm(dag, &pwm))
        })?;
        raw::write_optional(index, k as i64);
        Ok(())
    })
}

/// Effect, trigger and name of a transition of a model.
///
/// @param[in]  index   of the transition, from 0
/// @param[out] effect  enum swb_effect; may be NULL
/// @param[out] trigger enum swb_trigger; may be NULL
/// @param[out] buf     [len] the name with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed  length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such transition, or the buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_model_get_rule(
    model: *const swb_model,
    index: i64,
    effect: *mut i32,
    trigger: *mut i32,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(model, |m| {
            let rule = &transition(m, index)?.rule;
            // before the others, which a call that fails leaves as they are
            raw::write_text(rule.name.as_bytes(), buf, len, needed)?;
            raw::write_optional(effect, rule.effect as i32);
            raw::write_optional(trigger, rule.trigger as i32);
            Ok(())
        })
    })
}

/// Numbers of discrete states and of transitions of a model. Any output may be NULL.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_model_transition_counts(
    model: *const swb_model,
    n_discrete: *mut i64,
    n_transitions: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(model, |m| {
            raw::write_optional(n_discrete, m.discrete().len() as i64);
            raw::write_optional(n_transitions, m.transitions().len() as i64);
            Ok(())
        })
    })
}

/// Values with which the discrete states, the last ones, begin.
///
/// @param[out] initial [n] n_discrete of swb_model_transition_counts
/// @return SWB_OK; SWB_ERR_DIMENSION if n is another number
#[no_mangle]
pub unsafe extern "C" fn swb_model_get_discrete(model: *const swb_model, initial: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(model, |m| raw::write_slice(initial, n, m.discrete(), "initial")) })
}

fn transition(m: &Built, index: i64) -> Result<&Transition> {
    let all = m.transitions();
    let found = usize::try_from(index).ok().and_then(|i| all.get(i));
    found.ok_or_else(|| Error::Dimension(format!("there is no transition {index}, the model has {}", all.len())))
}

/// How long the lists of a transition of a model are. Any output may be NULL.
///
/// @param[in]  index   of the transition, from 0
/// @param[out] n_from  discrete states it asks for
/// @param[out] n_reset states it resets
/// @param[out] n_to    discrete states it sets
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such transition
#[no_mangle]
pub unsafe extern "C" fn swb_model_transition_sizes(
    model: *const swb_model,
    index: i64,
    n_from: *mut i64,
    n_reset: *mut i64,
    n_to: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(model, |m| {
            let t = transition(m, index)?;
            raw::write_optional(n_from, t.from.len() as i64);
            raw::write_optional(n_reset, t.reset.len() as i64);
            raw::write_optional(n_to, t.to.len() as i64);
            Ok(())
        })
    })
}

/// A transition of a model as it was given to swb_model_add_transition, or read by swb_model_from_json; its expressions are
/// those of the graph it was made of or read into.
///
/// @param[in]  index        of the transition, from 0
/// @param[out] guard        an expression
/// @param[out] direction    enum swb_direction
/// @param[out] from_states  [n_from_states] n_from of swb_model_transition_sizes
/// @param[out] from_values  [n_from_values] as many
/// @param[out] reset_states [n_reset_states] n_reset of swb_model_transition_sizes
/// @param[out] resets       [n_resets] as many
/// @param[out] to_states    [n_to_states] n_to of swb_model_transition_sizes
/// @param[out] to_values    [n_to_values] as many
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such transition or a length is another
#[no_mangle]
pub unsafe extern "C" fn swb_model_get_transition(
    model: *const swb_model,
    index: i64,
    guard: *mut i64,
    direction: *mut i32,
    from_states: *mut i64,
    n_from_states: i64,
    from_values: *mut f64,
    n_from_values: i64,
    reset_states: *mut i64,
    n_reset_states: i64,
    resets: *mut i64,
    n_resets: i64,
    to_states: *mut i64,
    n_to_states: i64,
    to_values: *mut f64,
    n_to_values: i64,
) -> swb_status {
    self::guard(|| unsafe {
        handle::with_ref(model, |m| {
            let t = transition(m, index)?;
            let states = |list: &[(usize, f64)]| list.iter().map(|d| d.0 as i64).collect::<Vec<i64>>();
            let values = |list: &[(usize, f64)]| list.iter().map(|d| d.1).collect::<Vec<f64>>();
            let (from, from_v, to, to_v) = (states(&t.from), values(&t.from), states(&t.to), values(&t.to));
            let reset: Vec<i64> = t.reset.iter().map(|r| r.0 as i64).collect();
            let ids: Vec<i64> = t.reset.iter().map(|r| r.1.index() as i64).collect();
            raw::check(guard, "guard")?;
            raw::check(direction, "direction")?;
            raw::check_slice(from_states, n_from_states, from.len(), "from_states")?;
            raw::check_slice(from_values, n_from_values, from.len(), "from_values")?;
            raw::check_slice(reset_states, n_reset_states, reset.len(), "reset_states")?;
            raw::check_slice(resets, n_resets, reset.len(), "resets")?;
            raw::check_slice(to_states, n_to_states, to.len(), "to_states")?;
            raw::check_slice(to_values, n_to_values, to.len(), "to_values")?;
            raw::write(guard, t.guard.index() as i64, "guard")?;
            raw::write(direction, if t.direction == Direction::Rising { 0 } else { 1 }, "direction")?;
            raw::write_slice(from_states, n_from_states, &from, "from_states")?;
            raw::write_slice(from_values, n_from_values, &from_v, "from_values")?;
            raw::write_slice(reset_states, n_reset_states, &reset, "reset_states")?;
            raw::write_slice(resets, n_resets, &ids, "resets")?;
            raw::write_slice(to_states, n_to_states, &to, "to_states")?;
            raw::write_slice(to_values, n_to_values, &to_v, "to_values")
        })
    })
}
