//! Optimal control: mode sequences, several starts, grids that were adapted.

use super::guard::{caught, guard};
use super::handle::{self, running, setting};
use super::ocp::{change, swb_ocp, Problem};
use super::raw;
use super::report::{outcome_number, polished_number};
use super::status::swb_status;
use switchback::error::{Error, Result};
use switchback::memory::{self, sizes};
use switchback::ocp::{ModeSequence, OcpResult, Round, TransitionAt};
use switchback::session::listening;

fn flags(values: &[i32]) -> Vec<bool> {
    values.iter().map(|v| *v != 0).collect()
}

fn numbers(flags: &[bool]) -> Vec<i32> {
    flags.iter().map(|f| i32::from(*f)).collect()
}

/// Sizes of the mode sequence of the last solution: a phase for every finite element that has a length.
///
/// @param[out] n_phases phases
/// @param[out] n_modes  modes, over all subsystems; may be NULL
/// @param[out] n_cells  sign patterns the modes consist of; may be NULL
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_mode_sizes(
    ocp: *const swb_ocp,
    n_phases: *mut i64,
    n_modes: *mut i64,
    n_cells: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let m = o.result()?.modes();
            let n = m.times.len().max(1);
            raw::write(n_phases, m.times.len() as i64, "n_phases")?;
            raw::write_optional(n_modes, (m.modes.len() / n) as i64);
            raw::write_optional(n_cells, (m.cells.len() / n) as i64);
            Ok(())
        })
    })
}

/// Mode sequence of the last solution.
///
/// @param[out] times  [n_times] n_phases, when the phases start, from the start of the horizon
/// @param[out] modes  [n_modes] n_phases times the number of modes: 1 where the mode is active; several modes of a subsystem
///                    are while it slides
/// @param[out] cells  [n_cells] the same for the sign patterns modes consist of; NULL if not wanted
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_modes(
    ocp: *const swb_ocp,
    times: *mut f64,
    n_times: i64,
    modes: *mut i32,
    n_modes: i64,
    cells: *mut i32,
    n_cells: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let m = o.result()?.modes();
            let wants_cells = n_cells != 0 || !cells.is_null();
            raw::check_slice(times, n_times, m.times.len(), "times")?;
            raw::check_slice(modes, n_modes, m.modes.len(), "modes")?;
            if wants_cells {
                raw::write_slice(cells, n_cells, &numbers(&m.cells), "cells")?;
            }
            raw::write_slice(times, n_times, &m.times, "times")?;
            raw::write_slice(modes, n_modes, &numbers(&m.modes), "modes")?;
            Ok(())
        })
    })
}

/// Give the order of modes: the next solves start with it, from the guesses of states and controls, and follow the
/// homotopy only where it has no solution. Every phase of a control stage needs a finite element there, which a solve
/// checks. Orders next to it are tried within the budget of the option mode_search only. Where simulations alone follow the system, only
/// motions with this order count, and the times say nothing.
///
/// @param[in] times [n_times] when the phases start, from the start of the horizon: the first at 0, not falling; n_times = 0
///                  forgets the order
/// @param[in] modes [n_modes] n_times times the number of modes: not 0 where the mode is active
/// @param[in] cells [n_cells] the same for the sign patterns modes consist of; none where the modes say all
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if the times fall or do not start at 0
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_modes(
    ocp: *mut swb_ocp,
    times: *const f64,
    n_times: i64,
    modes: *const i32,
    n_modes: i64,
    cells: *const i32,
    n_cells: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let times = raw::slice(times, n_times, "times")?.to_vec();
        let modes = flags(raw::slice(modes, n_modes, "modes")?);
        let cells = flags(raw::slice(cells, n_cells, "cells")?);
        let given = !times.is_empty();
        let transitions = Vec::new();
        change(ocp, |o| o.set_modes(given.then_some(ModeSequence { times, modes, cells, transitions })))
    })
}

/// Transitions of the last solution as a part of its mode sequence: see swb_ocp_set_mode_transitions.
///
/// @param[out] t          [n] swb_ocp_jump_count, times from the start of the horizon
/// @param[out] transition [n] which ones, in the order they were added to the system
/// @param[out] stage      [n] the control stages they are made in
/// @param[out] at_once    [n] 1 where the guard does not pass zero: it is beyond zero where its discrete state begins, or where the
///                        control changes
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_mode_transitions(
    ocp: *const swb_ocp,
    t: *mut f64,
    transition: *mut i64,
    stage: *mut i64,
    at_once: *mut i32,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let all = o.result()?.modes().transitions;
            raw::check_slice(transition, n, all.len(), "transition")?;
            raw::check_slice(stage, n, all.len(), "stage")?;
            raw::check_slice(at_once, n, all.len(), "at_once")?;
            raw::write_slice(t, n, &all.iter().map(|a| a.t).collect::<Vec<_>>(), "t")?;
            raw::write_slice(
                transition,
                n,
                &all.iter().map(|a| a.transition as i64).collect::<Vec<_>>(),
                "transition",
            )?;
            raw::write_slice(stage, n, &all.iter().map(|a| a.stage as i64).collect::<Vec<_>>(), "stage")?;
            raw::write_slice(at_once, n, &numbers(&all.iter().map(|a| a.at_once).collect::<Vec<_>>()), "at_once")
        })
    })
}

/// Give the transitions of the mode sequence, which swb_ocp_set_modes was given before: in the next solves only motions with these, in this order,
/// count. Without this call after swb_ocp_set_modes it is motions with none.
///
/// @param[in] t          [n] times from the start of the horizon; they say nothing, as swb_ocp_get_mode_transitions has them
/// @param[in] transition [n] which ones, in the order they were added to the system
/// @param[in] stage      [n] control stages, not falling; they say nothing else
/// @param[in] at_once    [n] not 0 where the guard is beyond zero without passing it; it says nothing
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE if no modes are given; SWB_ERR_RANGE for transitions or stages that do not exist, or
///         stages that fall
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_mode_transitions(
    ocp: *mut swb_ocp,
    t: *const f64,
    transition: *const i64,
    stage: *const i64,
    at_once: *const i32,
    n: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let t = raw::slice(t, n, "t")?;
        let (which, stage) = (raw::slice(transition, n, "transition")?, raw::slice(stage, n, "stage")?);
        let at_once = flags(raw::slice(at_once, n, "at_once")?);
        let mut all = Vec::with_capacity(t.len());
        for (k, &t) in t.iter().enumerate() {
            let (transition, stage) = (sizes::size(which[k], "transition")?, sizes::size(stage[k], "stage")?);
            all.push(TransitionAt { t, transition, stage, at_once: at_once[k] });
        }
        change(ocp, |o| {
            let given =
                o.modes().ok_or_else(|| Error::State("no modes are given: call swb_ocp_set_modes first".into()))?;
            o.set_modes(Some(ModeSequence { transitions: all, ..given.clone() }))
        })
    })
}

impl Problem {
    fn starts(&mut self, u: &[f64], threads: i64) -> Result<usize> {
        let width = self.control_size();
        if width == 0 || u.is_empty() || u.len() % width != 0 {
            return Err(Error::Dimension(format!(
                "u has length {}: give n_stages * nu = {width} numbers for every start",
                u.len()
            )));
        }
        let guesses: Vec<Vec<f64>> = u.chunks(width).map(<[f64]>::to_vec).collect();
        self.solve_starts(&guesses, threads, &|body| caught(|| listening(body)))
    }

    fn start(&self, k: i64) -> Result<&OcpResult> {
        let n = self.starts.len();
        let found = usize::try_from(k).ok().and_then(|k| self.starts.get(k));
        let found = found.ok_or_else(|| Error::Dimension(format!("there is no start {k}, there are {n}")))?;
        found.as_ref().map_err(Clone::clone)
    }

    fn rounds(&self) -> Result<&switchback::ocp::Adaptation> {
        self.result()?
            .adaptation
            .as_ref()
            .ok_or_else(|| Error::State("the grid was not adapted: set the option adapt_tol, then solve".into()))
    }

    fn round(&self, k: i64) -> Result<&Round> {
        let rounds = &self.rounds()?.rounds;
        let found = usize::try_from(k).ok().and_then(|k| rounds.get(k));
        found.ok_or_else(|| Error::Dimension(format!("there is no round {k}, there are {}", rounds.len())))
    }
}

/// Random controls to start from, the same for the same seed: first the guess a solve starts from, then random ones within
/// the bounds of the controls.
///
/// @param[out] u [n_u] n_stages * nu for every start
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_random_starts(ocp: *mut swb_ocp, seed: u64, u: *mut f64, n_u: i64) -> swb_status {
    running(ocp, || unsafe {
        handle::with_mut(ocp, |o| {
            let width = o.control_size().max(1);
            let n = raw::length(n_u, "u")? / width;
            sizes::entries("the list of starts", &[n, width])?;
            memory::need(3 * 8 * n_u.max(0) as u128, || format!("{n} starts"))?;
            raw::write_slice(u, n_u, &o.random(n, seed).concat(), "u")
        })
    })
}

/// Solve from several guesses of the controls and keep the best solution, which is then the result of the problem. The
/// results are those of single solves to the last bit, whatever the number of threads. A start that fails does not keep
/// the others from being solved.
///
/// The iteration callback is called on the thread of the caller only, for the starts that are solved there, and stops all
/// starts; so does swb_ocp_interrupt.
///
/// @param[in]  u         [n_u] n_stages * nu for every start
/// @param[in]  n_threads threads at most, of which one is that of the caller; 0: one for each processor. With more than 1,
///                       functions of the model are called by several threads at once; if one of them carries the flag
///                       SWB_SERIAL, the thread of the caller does it all
/// @param[out] best      the start that was kept; may be NULL
/// @return SWB_OK, however the solves ended; SWB_ERR_DIMENSION; SWB_ERR_RANGE if n_threads is negative; that of the
///         first start if all fail
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_solve_starts(
    ocp: *mut swb_ocp,
    u: *const f64,
    n_u: i64,
    n_threads: i64,
    best: *mut i64,
) -> swb_status {
    running(ocp, || unsafe {
        let u = raw::slice(u, n_u, "u")?;
        let kept = handle::with_mut(ocp, |o| o.starts(u, n_threads))?;
        raw::write_optional(best, kept as i64);
        Ok(())
    })
}

/// Results of the starts of the last swb_ocp_solve_starts.
///
/// @param[in]  start    from 0
/// @param[out] outcome  an enum swb_outcome; may be NULL
/// @param[out] polished an enum swb_polished; may be NULL
/// @param[out] cost     NaN unless the start was solved; may be NULL
/// @param[out] u        [n_u] n_stages * nu controls; NULL if not wanted
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such start; the status of the start if it failed, with its message
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_start(
    ocp: *const swb_ocp,
    start: i64,
    outcome: *mut i32,
    polished: *mut i32,
    cost: *mut f64,
    u: *mut f64,
    n_u: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let r = o.start(start)?;
            if n_u != 0 || !u.is_null() {
                raw::write_slice(u, n_u, &r.controls, "u")?;
            }
            raw::write_optional(outcome, outcome_number(r.outcome));
            raw::write_optional(polished, polished_number(r.polish));
            raw::write_optional(cost, r.cost);
            Ok(())
        })
    })
}

/// How the grid of the last solve was adapted (option adapt_tol).
///
/// @param[out] n_rounds solves on the way, the first on the grid that was given
/// @param[out] kept     the one whose solution was kept; may be NULL
/// @param[out] reached  1 if its error is as small as asked for; may be NULL
/// @return SWB_OK; SWB_ERR_STATE before the first solve, and where the option adapt_tol is 0
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_adaptation(
    ocp: *const swb_ocp,
    n_rounds: *mut i64,
    kept: *mut i64,
    reached: *mut i32,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let a = o.rounds()?;
            raw::write(n_rounds, a.rounds.len() as i64, "n_rounds")?;
            raw::write_optional(kept, a.kept as i64);
            raw::write_optional(reached, i32::from(a.reached));
            Ok(())
        })
    })
}

/// One solve on the way to an adapted grid.
///
/// @param[in]  round       from 0
/// @param[out] elements    [n_elements] n_stages, the finite elements of every control stage; NULL if not wanted
/// @param[out] n_variables of the discretised problem; may be NULL
/// @param[out] iterations  may be NULL
/// @param[out] error       largest difference of a state from the simulation at the ends of the control stages, NaN where
///                         the simulation got stuck; may be NULL
/// @param[out] cost        NaN unless the round was solved; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if there is no such round; SWB_ERR_STATE as swb_ocp_get_adaptation
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_round(
    ocp: *const swb_ocp,
    round: i64,
    elements: *mut i64,
    n_elements: i64,
    n_variables: *mut i64,
    iterations: *mut i64,
    error: *mut f64,
    cost: *mut f64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let r = o.round(round)?;
            if n_elements != 0 || !elements.is_null() {
                let counts: Vec<i64> = r.elements.iter().map(|n| *n as i64).collect();
                raw::write_slice(elements, n_elements, &counts, "elements")?;
            }
            raw::write_optional(n_variables, r.n_variables as i64);
            raw::write_optional(iterations, r.iterations as i64);
            raw::write_optional(error, r.error);
            raw::write_optional(cost, r.cost);
            Ok(())
        })
    })
}
