//! Optimal control.

use super::function::{shared, shared_cost, swb_function};
use super::guard::guard;
use super::handle::{self, running, setting, Interrupt, Object};
use super::log::swb_log_fn;
use super::raw;
use super::report::{
    outcome_number, polished_number, swb_iteration_fn, swb_residuals, swb_stats, write_sized, Exclusive, Hooks,
};
use super::settings;
use super::status::swb_status;
use super::system::swb_system;
use super::threads;
use super::trajectory::{hand_out, swb_trajectory};
use std::ffi::{c_char, c_void};
use switchback::document::write_ocp;
use switchback::error::{Error, Result};
use switchback::fesd::PathAt;
use switchback::memory::sizes;
use switchback::nlp::Outcome;
use switchback::ocp::{Around, Multipliers, MultipliersOf, Nominal, Ocp, OcpResult, OcpSensitivity};
use switchback::settings::{LogLevel, Settings, Value};

/// Optimal control problem of a system: piecewise constant controls on an equidistant grid of stages.
pub struct swb_ocp(());
impl Object for swb_ocp {
    type Value = Problem;
    const NAME: &'static str = "swb_ocp";
}

/// Places at which a path constraint holds.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_path_at {
    /// At both ends of every control stage, with the control of that stage.
    ControlGrid = 0,
    /// At the start of every control stage and the end of every finite element.
    Elements = 1,
    /// At the start of every control stage and at every stage point.
    StagePoints = 2,
}

/// What is behind the handle.
pub struct Problem {
    ocp: Exclusive<Ocp>,
    pub(super) settings: Settings,
    result: Option<OcpResult>,
    /// What the last solve returned as an error.
    refused: Option<String>,
    /// What several starts found.
    pub(super) starts: Vec<Result<OcpResult>>,
    pub(super) hooks: Hooks,
}

impl Problem {
    /// The problem as a document.
    pub(super) fn json(&mut self) -> Result<String> {
        let settings = self.settings;
        write_ocp(self.ocp.get(), &settings)
    }

    fn set_option(&mut self, name: &str, value: Value) -> Result<()> {
        let mut settings = self.settings;
        settings.set_by_name(name, value)?;
        self.set_settings(settings)
    }

    fn set_settings(&mut self, settings: Settings) -> Result<()> {
        self.settings = settings;
        Ok(())
    }

    pub(super) fn solve(&mut self, warm: bool) -> Result<Outcome> {
        let solved = self.run(warm);
        self.remember(solved)
    }

    /// Keeps the text of a solve that is refused.
    fn remember<T>(&mut self, solved: Result<T>) -> Result<T> {
        self.refused = solved.as_ref().err().map(ToString::to_string);
        solved
    }

    fn run(&mut self, warm: bool) -> Result<Outcome> {
        let level = self.settings.verbosity();
        let (ocp, result) = (self.ocp.get(), &mut self.result);
        ocp.set_settings(&self.settings)?;
        *result = None;
        let outcome = self.hooks.run("ocp", level, |control| {
            let r = if warm { ocp.solve_warm(control) } else { ocp.solve(control) }?;
            *result = Some(r.clone());
            if r.outcome == Outcome::Failed && r.undefined {
                return Err(Error::NonFinite(r.message.clone()));
            }
            Ok(r.outcome)
        });
        let outcome = outcome.map_err(|e| in_words(e, self.result.as_ref()))?;
        let importance = if outcome == Outcome::Solved { LogLevel::Info } else { LogLevel::Warning };
        self.hooks.tell(level, importance, || {
            self.result.as_ref().map_or_else(String::new, |r| {
                format!(
                    "ocp outcome = {}, polish = {:?}, cost = {:.10e}, primal = {:.2e}, dual = {:.2e}, pair_min = {:.2e}, \
                     iterations = {}, variables = {}, constraints = {}, pairs = {}, time = {:.3e}, time_build = {:.3e}",
                    r.outcome.name(),
                    r.polish,
                    r.cost,
                    r.residuals.primal,
                    r.residuals.dual,
                    r.residuals.pair_min,
                    r.stats.iterations,
                    r.dimensions.0,
                    r.dimensions.1,
                    r.dimensions.2,
                    r.stats.time_total,
                    r.time_build
                )
            })
        });
        let message = self.result.as_ref().map_or("", |r| &r.message);
        if !message.is_empty() {
            self.hooks.tell(level, LogLevel::Warning, || format!("ocp: {message}"));
        }
        self.warn_of_simulation(level);
        Ok(outcome)
    }

    /// Controls of a start.
    pub(super) fn control_size(&mut self) -> usize {
        let ocp = self.ocp.get();
        ocp.n_stages() * ocp.system().dims().u
    }

    pub(super) fn random(&mut self, n: usize, seed: u64) -> Vec<Vec<f64>> {
        self.ocp.get().random_starts(n, seed)
    }

    /// Solves from several guesses, every solve within `around`, and keeps the best.
    pub(super) fn solve_starts(&mut self, guesses: &[Vec<f64>], threads: i64, around: Around) -> Result<usize> {
        let solved = self.run_starts(guesses, threads, around);
        self.remember(solved)
    }

    fn run_starts(&mut self, guesses: &[Vec<f64>], threads: i64, around: Around) -> Result<usize> {
        let level = self.settings.verbosity();
        let (ocp, result, starts) = (self.ocp.get(), &mut self.result, &mut self.starts);
        let threads = threads::number(threads)?;
        ocp.set_settings(&self.settings)?;
        *result = None;
        starts.clear();
        let mut best = 0;
        self.hooks.run("ocp", level, |control| {
            let found = ocp.solve_starts_within(guesses, threads, control, around)?;
            (best, *starts) = (found.best, found.results);
            *result = ocp.result().cloned();
            // a point without values is the business of its start
            Ok(result.as_ref().map_or(Outcome::Stopped, |r| r.outcome))
        })?;
        Ok(best)
    }

    /// A solution whose controls cannot be simulated to the end deserves a second look.
    fn warn_of_simulation(&mut self, level: LogLevel) {
        let reason = self.result.as_ref().and_then(|r| r.accuracy.as_ref()).map(|a| a.reason.clone());
        if let Some(reason) = reason.filter(|r| !r.is_empty()) {
            self.hooks
                .tell(level, LogLevel::Warning, || format!("ocp: the simulation of the controls ends early: {reason}"));
        }
    }

    pub(super) fn count_multipliers(&mut self, of: MultipliersOf) -> usize {
        self.ocp.get().count_multipliers(of)
    }

    pub(super) fn multipliers(&mut self, of: MultipliersOf) -> Result<Multipliers> {
        self.of_solution(|ocp| ocp.multipliers(of))
    }

    fn sensitivity(&mut self) -> Result<OcpSensitivity> {
        self.of_solution(Ocp::sensitivity)
    }

    /// What is computed of the last solution, which calls model functions and can be interrupted.
    fn of_solution<T>(&mut self, compute: impl FnOnce(&mut Ocp) -> Result<T>) -> Result<T> {
        self.result()?;
        let mut found = None;
        let ocp = self.ocp.get();
        let max_time = self.settings.max_time;
        self.hooks.run("ocp", LogLevel::Silent, |control| {
            found = Some(control.within(max_time, |_| compute(ocp))?);
            Ok(Outcome::Solved)
        })?;
        found.ok_or_else(|| Error::Internal("nothing was computed".into()))
    }

    /// What there is to say of the last solve: of its result, or what it returned as an error instead of one.
    pub(super) fn message(&self) -> Result<&str> {
        match (&self.result, &self.refused) {
            (None, Some(refused)) => Ok(refused),
            _ => Ok(&self.result()?.message),
        }
    }

    pub(super) fn result(&self) -> Result<&OcpResult> {
        self.result.as_ref().ok_or_else(|| Error::State("there is no result: call swb_ocp_solve first".into()))
    }
}

/// A function without a value, with the place where it has none.
fn in_words(e: Error, r: Option<&OcpResult>) -> Error {
    match (e, r.map(|r| &r.message)) {
        (Error::NonFinite(_), Some(m)) if !m.is_empty() => Error::NonFinite(m.clone()),
        (e, _) => e,
    }
}

/// A copy of the problem behind a handle.
pub(super) fn copied(problem: &mut Problem) -> Result<Ocp> {
    let settings = problem.settings;
    let mut ocp = problem.ocp.get().blank();
    ocp.set_settings(&settings)?;
    Ok(ocp)
}

/// A problem with a result, behind a handle.
pub(super) fn solved(ocp: Ocp, result: OcpResult, interrupt: &Interrupt) -> Problem {
    Problem { result: Some(result), ..new(ocp, interrupt) }
}

/// Behind a handle.
pub(super) fn new(ocp: Ocp, interrupt: &Interrupt) -> Problem {
    Problem {
        settings: *ocp.settings(),
        ocp: Exclusive::new(ocp),
        result: None,
        refused: None,
        starts: Vec::new(),
        hooks: Hooks::new(interrupt),
    }
}

pub(super) unsafe fn change(ocp: *mut swb_ocp, body: impl FnOnce(&mut Ocp) -> Result<()>) -> Result<()> {
    unsafe { handle::with_mut(ocp, |o| body(o.ocp.get())) }
}

/// Create an optimal control problem. Bounds are infinite, the initial state is free, the initial time is zero,
/// parameters have no values, and there is no cost, until they are set. A problem whose parameters have no values is not solved:
/// SWB_ERR_STATE.
///
/// @param[in]  system   copied; may be freed afterwards
/// @param[in]  horizon  duration
/// @param[in]  n_stages control intervals of equal length
/// @param[in]  settings NULL for the defaults
/// @param[out] out      the new object, NULL on failure; free with swb_ocp_free
/// @return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if the horizon is not
///         positive or an option is outside its range; SWB_ERR_DIMENSION without stages
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_create(
    system: *const swb_system,
    horizon: f64,
    n_stages: i64,
    settings: *const Settings,
    out: *mut *mut swb_ocp,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let settings = settings::read(settings)?;
            let n = sizes::size(n_stages, "n_stages")?;
            handle::require(system)?;
            handle::with_ref(system, |s| Ok(new(Ocp::new(s, horizon, n, &settings)?, interrupt)))
        })
    })
}

/// Set the cost rate, one output: its integral over the horizon is minimised. Expressions (swb_expr_function) may have abs, min and max in
/// them where these point down, as a sum of smooth terms and of maxima with positive factors does: their arguments may be
/// controls that are constant by stage, and parameters. A program has a variable in every stage for each.
///
/// @return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit; SWB_ERR_UNSUPPORTED for abs, min and max of what moves within a
///         stage: make such a cost the derivative of a further state of the model, and its value at the end the terminal cost
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_lagrange(ocp: *mut swb_ocp, f: *const swb_function) -> swb_status {
    setting(ocp, || unsafe {
        let f = shared_cost(f, "f")?;
        change(ocp, |o| o.set_lagrange(f))
    })
}

/// Set the terminal cost, one output; its control is that of the last stage. It may have abs, min and max in it as the cost rate, of
/// states, too.
///
/// @return SWB_OK; SWB_ERR_DIMENSION if the sizes of the function do not fit
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_mayer(ocp: *mut swb_ocp, f: *const swb_function) -> swb_status {
    setting(ocp, || unsafe {
        let f = shared_cost(f, "f")?;
        change(ocp, |o| o.set_mayer(f))
    })
}

/// Add the constraint lower <= f(x,u,p,t) <= upper along the horizon.
///
/// @param[in] lower [n_lower] one for each output
/// @param[in] upper [n_upper] one for each output
/// @param[in] at    an enum swb_path_at
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a lower bound is above the upper one or NaN
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_path(
    ocp: *mut swb_ocp,
    f: *const swb_function,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
    at: i32,
) -> swb_status {
    setting(ocp, || unsafe {
        let places = [
            (swb_path_at::ControlGrid, PathAt::ControlGrid),
            (swb_path_at::Elements, PathAt::Elements),
            (swb_path_at::StagePoints, PathAt::StagePoints),
        ];
        let at = places.iter().find(|p| p.0 as i32 == at).map(|p| p.1);
        let at = at.ok_or_else(|| Error::Range("at is no enum swb_path_at".into()))?;
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        let f = shared(f, "f")?;
        change(ocp, |o| o.add_path(f, lower, upper, at))
    })
}

/// Add the constraint lower <= f(x,u,p,t) <= upper at the end of the horizon; its control is that of the
/// last stage.
///
/// @param[in] lower [n_lower] one for each output
/// @param[in] upper [n_upper] one for each output
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_add_terminal(
    ocp: *mut swb_ocp,
    f: *const swb_function,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        let f = shared(f, "f")?;
        change(ocp, |o| o.add_terminal(f, lower, upper))
    })
}

/// Set bounds of the states at all stage points and element ends after the initial time.
///
/// @param[in] lower [n_lower] nx
/// @param[in] upper [n_upper] nx
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_state_bounds(
    ocp: *mut swb_ocp,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        change(ocp, |o| o.set_x_bounds(lower, upper))
    })
}

/// Set bounds of the initial state; equal bounds fix it.
///
/// @param[in] lower [n_lower] nx
/// @param[in] upper [n_upper] nx
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_initial_bounds(
    ocp: *mut swb_ocp,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        change(ocp, |o| o.set_x0_bounds(lower, upper))
    })
}

/// Fix the initial state.
///
/// @param[in] x0 [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is NaN
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_initial_state(ocp: *mut swb_ocp, x0: *const f64, nx: i64) -> swb_status {
    setting(ocp, || unsafe {
        let x0 = raw::slice(x0, nx, "x0")?;
        change(ocp, |o| {
            if let Some(i) = x0.iter().position(|v| !v.is_finite()) {
                return Err(Error::Range(format!("initial state {i} is {}: it must be finite", x0[i])));
            }
            o.set_x0(x0)
        })
    })
}

/// Set bounds of the controls.
///
/// @param[in] lower [n_lower] nu
/// @param[in] upper [n_upper] nu
/// @return as swb_ocp_add_path
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_control_bounds(
    ocp: *mut swb_ocp,
    lower: *const f64,
    n_lower: i64,
    upper: *const f64,
    n_upper: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (lower, upper) = (raw::slice(lower, n_lower, "lower")?, raw::slice(upper, n_upper, "upper")?);
        change(ocp, |o| o.set_u_bounds(lower, upper))
    })
}

/// Say how large quantities usually are, in their own units: the solver measures variables by that. What is not given it takes from
/// bounds, initial values, guesses and simulations; units then do not matter either, but a state that begins at zero and has no
/// bounds is better known to you.
///
/// @param[in] x [n_x] nx, positive; NaN where nothing is known; or NULL and 0
/// @param[in] u [n_u] nu, as x
/// @param[in] p [n_p] np, as x
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not positive and finite
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_nominal(
    ocp: *mut swb_ocp,
    x: *const f64,
    n_x: i64,
    u: *const f64,
    n_u: i64,
    p: *const f64,
    n_p: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let read = |v: *const f64, n: i64, what: &str| -> Result<Vec<Option<f64>>> {
            Ok(raw::slice(v, n, what)?.iter().map(|v| (!v.is_nan()).then_some(*v)).collect())
        };
        let nominal = Nominal { x: read(x, n_x, "x")?, u: read(u, n_u, "u")?, p: read(p, n_p, "p")? };
        change(ocp, |o| o.set_nominal(nominal))
    })
}

/// Set the parameters.
///
/// @param[in] p [np]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_params(ocp: *mut swb_ocp, p: *const f64, np: i64) -> swb_status {
    setting(ocp, || unsafe {
        let p = raw::slice(p, np, "p")?;
        change(ocp, |o| o.set_params(p))
    })
}

/// Set the initial time.
///
/// @return SWB_OK; SWB_ERR_RANGE if it is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_initial_time(ocp: *mut swb_ocp, t0: f64) -> swb_status {
    setting(ocp, || unsafe { change(ocp, |o| o.set_t0(t0)) })
}

/// Give states to start from, linear in between.
///
/// @param[in] times [n_times] rising, from the start of the horizon
/// @param[in] x     [n_x] n_times * nx, the states of one time together
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if times do not rise or a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_state_guess(
    ocp: *mut swb_ocp,
    times: *const f64,
    n_times: i64,
    x: *const f64,
    n_x: i64,
) -> swb_status {
    setting(ocp, || unsafe {
        let (times, x) = (raw::slice(times, n_times, "times")?, raw::slice(x, n_x, "x")?);
        change(ocp, |o| o.set_x_guess(times, x))
    })
}

/// Give controls to start from.
///
/// @param[in] u [n_u] n_stages * nu, the controls of one stage together
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_control_guess(ocp: *mut swb_ocp, u: *const f64, n_u: i64) -> swb_status {
    setting(ocp, || unsafe {
        let u = raw::slice(u, n_u, "u")?;
        change(ocp, |o| o.set_u_guess(u))
    })
}

/// Solve. The problem is discretised at the first solve, and again only when its structure changed.
///
/// @param[out] outcome an enum swb_outcome; may be NULL
/// @return SWB_OK, however the solver ended; SWB_ERR_USER if a user function returned a negative code;
///         SWB_ERR_NONFINITE if one has no value at the start; SWB_ERR_NUMERIC; SWB_ERR_RANGE,
///         SWB_ERR_UNSUPPORTED if options do not go together
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_solve(ocp: *mut swb_ocp, outcome: *mut i32) -> swb_status {
    running(ocp, || unsafe {
        let reached = handle::with_mut(ocp, |o| o.solve(false))?;
        raw::write_optional(outcome, outcome_number(reached));
        Ok(())
    })
}

/// How the last solve ended.
///
/// @param[out] outcome an enum swb_outcome
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_outcome(ocp: *const swb_ocp, outcome: *mut i32) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write(outcome, outcome_number(o.result()?.outcome), "outcome")) })
}

/// Outcome of the polish, which identifies the active set and solves the problem with it.
///
/// @param[out] polished an enum swb_polished
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_polished(ocp: *const swb_ocp, polished: *mut i32) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| raw::write(polished, polished_number(o.result()?.polish), "polished"))
    })
}

/// Cost of the solution, without terms that only guide the solver; NaN where there is none (unless the outcome is
/// SWB_OUTCOME_SOLVED, or SWB_OUTCOME_STOPPED after a round of an adaptation that was solved): what
/// another point costs says nothing about the problem (swb_ocp_get_cost_reached).
///
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_cost(ocp: *const swb_ocp, cost: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write(cost, o.result()?.cost, "cost")) })
}

/// Cost of the point at which the last solve ended, however it ended. Unless the outcome is SWB_OUTCOME_SOLVED the point
/// need not satisfy dynamics and constraints, and its cost may lie on either side of that of a solution. NaN where the
/// solve was stopped before it was known.
///
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_cost_reached(ocp: *const swb_ocp, cost: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write(cost, o.result()?.cost_reached, "cost")) })
}

/// Controls.
///
/// @param[out] u [n_u] n_stages * nu, the controls of one stage together
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_controls(ocp: *const swb_ocp, u: *mut f64, n_u: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| raw::write_slice(u, n_u, &o.result()?.controls, "u")) })
}

/// Derivatives of the last solution with respect to its data: the initial state `[nx]`, then the parameters `[np]`. The
/// order of modes is held; the solution must be exact (SWB_POLISHED_DONE). A component of the initial state that is free is
/// no datum: its derivatives are zero. Where the order of modes cannot be held in either direction, the derivatives with
/// respect to that datum are NaN and one_sided is 1. One factorisation for all of them; parameters cost four evaluations of the model
/// each.
///
/// @param[out] cost      [n_cost] nx + np, derivatives of the cost; NULL with n_cost 0 if not wanted
/// @param[out] u         [n_u] (nx + np) * n_stages * nu, derivatives of the controls, those of one datum together; NULL
///                       with n_u 0 if not wanted
/// @param[out] one_sided 1 if a bound is active without a multiplier: on the other side the derivatives are others; NULL
///                       if not wanted
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution; SWB_ERR_NUMERIC if it is no isolated
///         minimiser; SWB_ERR_USER, SWB_ERR_NONFINITE if the model fails next to the given parameters
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_sensitivity(
    ocp: *mut swb_ocp,
    cost: *mut f64,
    n_cost: i64,
    u: *mut f64,
    n_u: i64,
    one_sided: *mut i32,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(ocp, |o| {
            let s = o.sensitivity()?;
            let wanted = |n: i64, p: *mut f64| n != 0 || !p.is_null();
            if wanted(n_u, u) {
                raw::check_slice(u, n_u, s.controls.len(), "u")?;
            }
            if wanted(n_cost, cost) {
                raw::write_slice(cost, n_cost, &s.cost, "cost")?;
            }
            if wanted(n_u, u) {
                raw::write_slice(u, n_u, &s.controls, "u")?;
            }
            raw::write_optional(one_sided, i32::from(s.one_sided));
            Ok(())
        })
    })
}

/// Residuals of the last solve.
///
/// @param[out] residuals   every field is written
/// @param[in]  struct_size sizeof(swb_residuals)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_residuals(
    ocp: *const swb_ocp,
    residuals: *mut swb_residuals,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            write_sized(&swb_residuals::of(&o.result()?.residuals), residuals, struct_size, "residuals")
        })
    })
}

/// Work and time of the last solve.
///
/// @param[out] stats       every field is written
/// @param[in]  struct_size sizeof(swb_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_stats(ocp: *const swb_ocp, stats: *mut swb_stats, struct_size: u64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(ocp, |o| {
            let r = o.result()?;
            let value = swb_stats {
                time_build: r.time_build,
                n_variables: r.dimensions.0 as i64,
                n_constraints: r.dimensions.1 as i64,
                n_pairs: r.dimensions.2 as i64,
                ..swb_stats::of(&r.stats)
            };
            write_sized(&value, stats, struct_size, "stats")
        })
    })
}

/// A copy of the trajectory of the last solve.
///
/// @param[out] out the new object, NULL on failure; free with swb_trajectory_free
/// @return SWB_OK; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_trajectory(ocp: *const swb_ocp, out: *mut *mut swb_trajectory) -> swb_status {
    guard(|| unsafe {
        raw::write(out, std::ptr::null_mut(), "out")?;
        handle::with_ref(ocp, |o| hand_out(o.result().map(|r| &r.trajectory), out))
    })
}

/// Set an integer or enumeration option of an optimal control problem (or a float one, to an integer) by name.
///
/// @return as swb_settings_set_int
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_int(ocp: *mut swb_ocp, name: *const c_char, value: i64) -> swb_status {
    setting(ocp, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(ocp, |o| o.set_option(name, Value::Int(value)))
    })
}

/// Set a float option of an optimal control problem by name.
///
/// @return as swb_settings_set_double
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_double(ocp: *mut swb_ocp, name: *const c_char, value: f64) -> swb_status {
    setting(ocp, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(ocp, |o| o.set_option(name, Value::Float(value)))
    })
}

/// Set any option of an optimal control problem by name from text: a number, or the value name of an enumeration.
///
/// @return as swb_settings_set_string
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_string(
    ocp: *mut swb_ocp,
    name: *const c_char,
    value: *const c_char,
) -> swb_status {
    setting(ocp, || unsafe {
        let (name, value) = (raw::text(name, "name")?, raw::text(value, "value")?);
        handle::with_mut(ocp, |o| o.set_option(name, Value::Text(value.to_owned())))
    })
}

/// Set all options of an optimal control problem.
///
/// @param[in] settings NULL for the defaults
/// @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_settings(ocp: *mut swb_ocp, settings: *const Settings) -> swb_status {
    setting(ocp, || unsafe {
        let settings = settings::read(settings)?;
        settings.validate()?;
        handle::with_mut(ocp, |o| o.set_settings(settings))
    })
}

/// Options of an optimal control problem, all of them.
///
/// @param[out] settings    every field is written
/// @param[in]  struct_size sizeof(swb_settings)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_get_settings(
    ocp: *const swb_ocp,
    settings: *mut Settings,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(ocp, |o| write_sized(&o.settings, settings, struct_size, "settings")) })
}

/// Set who is called once per iteration; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_iteration(
    ocp: *mut swb_ocp,
    iteration: swb_iteration_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(ocp, || unsafe {
        handle::with_mut(ocp, |o| {
            o.hooks.set_iteration(iteration, user_data);
            Ok(())
        })
    })
}

/// Set who gets the log, as much as the option log_level says; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_set_log(ocp: *mut swb_ocp, log: swb_log_fn, user_data: *mut c_void) -> swb_status {
    setting(ocp, || unsafe {
        handle::with_mut(ocp, |o| {
            o.hooks.set_log(log, user_data);
            Ok(())
        })
    })
}

/// Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
/// thread and from signal handlers; only swb_ocp_free must not run at the same time. It is heeded in every phase, before the
/// next evaluation of a model function and before the next factorisation: the call ends within the time of one of
/// these, a model function that takes long itself is waited for. What was found before stays the answer: an interrupt
/// during the comparison accuracy leaves the solution, with an accuracy that is NaN and a message. Where nothing was found
/// yet, while the problem is built or in swb_ocp_get_sensitivity, the call returns SWB_ERR_INTERRUPTED; max_time ends
/// calls in the same places.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_interrupt(ocp: *const swb_ocp) -> swb_status {
    unsafe { handle::interrupt(ocp) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_ocp_free(ocp: *mut swb_ocp) {
    unsafe { handle::free(ocp) }
}
