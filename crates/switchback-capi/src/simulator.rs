//! Simulation.

use super::guard::guard;
use super::handle::{self, running, setting, Interrupt, Object};
use super::log::swb_log_fn;
use super::raw;
use super::report::{outcome_number, swb_iteration_fn, swb_residuals, swb_stats, write_sized, Exclusive, Hooks};
use super::settings;
use super::status::swb_status;
use super::system::swb_system;
use super::trajectory::{hand_out, swb_trajectory};
use std::ffi::{c_char, c_void};
use switchback::document;
use switchback::error::{check_run, Result};
use switchback::memory;
use switchback::nlp::Outcome;
use switchback::settings::{LogLevel, Settings, Value};
use switchback::sim::{SimResult, Simulator};
use switchback::system::System;

/// Simulator of a system: time, state, and the trajectory since the state was set.
pub struct swb_simulator(());
impl Object for swb_simulator {
    type Value = Simulation;
    const NAME: &'static str = "swb_simulator";
}

/// What is behind the handle.
pub struct Simulation {
    system: System,
    pub(super) settings: Settings,
    simulator: Exclusive<Simulator>,
    /// The settings changed since the simulator was built.
    stale: bool,
    t: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    result: SimResult,
    time_build: f64,
    pub(super) hooks: Hooks,
}

impl Simulation {
    fn new(system: System, settings: Settings, interrupt: &Interrupt) -> Result<Simulation> {
        system.validate()?;
        let clock = std::time::Instant::now();
        let simulator = Simulator::new(&system, &settings)?;
        let d = system.dims();
        Ok(Simulation {
            settings,
            stale: false,
            t: 0.0,
            x: vec![0.0; d.x],
            u: vec![0.0; d.u],
            p: vec![0.0; d.p],
            result: simulator.empty_result(),
            time_build: clock.elapsed().as_secs_f64(),
            simulator: Exclusive::new(simulator),
            hooks: Hooks::new(interrupt),
            system,
        })
    }

    /// What is to be simulated from here, as a document.
    pub(super) fn json(&self, duration: f64, n_steps: usize) -> Result<String> {
        document::write_simulation(&document::Simulation {
            system: self.system.clone(),
            settings: self.settings,
            t0: self.t,
            x0: self.x.clone(),
            u: self.u.clone(),
            p: self.p.clone(),
            duration,
            n_steps,
        })
    }

    /// A simulator that stands where a document begins.
    pub(super) fn of_document(d: document::Simulation, interrupt: &Interrupt) -> Result<Simulation> {
        let mut s = Simulation::new(d.system, d.settings, interrupt)?;
        let simulator = s.simulator.get();
        simulator.set_params(&d.p)?;
        simulator.set_controls(&d.u)?;
        simulator.set_state(d.t0, &d.x0)?;
        (s.t, s.x, s.u, s.p) = (d.t0, d.x0, d.u, d.p);
        Ok(s)
    }

    fn set_option(&mut self, name: &str, value: Value) -> Result<()> {
        let mut settings = self.settings;
        settings.set_by_name(name, value)?;
        self.set_settings(settings)
    }

    fn set_settings(&mut self, settings: Settings) -> Result<()> {
        self.stale |= settings != self.settings;
        self.settings = settings;
        Ok(())
    }

    /// A simulator with the present settings.
    fn refresh(&mut self) -> Result<()> {
        if !self.stale {
            return Ok(());
        }
        let clock = std::time::Instant::now();
        let mut simulator = Simulator::new(&self.system, &self.settings)?;
        simulator.set_params(&self.p)?;
        simulator.set_controls(&self.u)?;
        simulator.set_state(self.t, &self.x)?;
        let empty = simulator.empty_result();
        if empty.trajectory.tableau() != self.result.trajectory.tableau() {
            // elements of different methods do not go together
            self.result = empty;
        }
        self.time_build = clock.elapsed().as_secs_f64();
        self.simulator = Exclusive::new(simulator);
        self.stale = false;
        Ok(())
    }

    /// Does `n_steps` steps over `duration` and appends them to the trajectory.
    fn run(&mut self, duration: f64, n_steps: i64) -> Result<Outcome> {
        memory::limited(self.settings.max_memory, || self.run_within(duration, n_steps))
    }

    fn run_within(&mut self, duration: f64, n_steps: i64) -> Result<Outcome> {
        check_run(duration, n_steps)?;
        self.refresh()?;
        let (t0, level) = (self.t, self.settings.verbosity());
        let (simulator, result) = (self.simulator.get(), &mut self.result);
        let max_time = self.settings.max_time;
        let outcome = self.hooks.run("simulation", level, |control| {
            control.within(max_time, |control| {
                for k in 1..=n_steps {
                    // the grid does not inherit the rounding of sums
                    let end = t0 + duration * (k as f64 / n_steps as f64);
                    simulator.advance(end - simulator.time(), control, result);
                    memory::check()?;
                    if result.outcome != Outcome::Solved {
                        break;
                    }
                }
                Ok(result.outcome)
            })
        });
        self.t = simulator.time();
        self.x.copy_from_slice(simulator.state());
        let outcome = outcome?;
        let importance = if outcome == Outcome::Solved { LogLevel::Info } else { LogLevel::Warning };
        self.hooks.tell(level, importance, || {
            let (r, s) = (&self.result, &self.result.stats);
            format!(
                "simulation outcome = {}, t = {}, steps = {}, homotopies = {}, elements = {}, switches = {}, \
                 iterations = {}, time = {:.3e}",
                outcome.name(),
                self.t,
                r.steps,
                r.homotopies,
                r.trajectory.elements.len(),
                r.trajectory.switches.len(),
                s.iterations,
                s.time_total
            )
        });
        Ok(outcome)
    }
}

/// Create a simulator. Time, state, controls and parameters are zero until they are set.
///
/// @param[in]  system   copied; may be freed afterwards
/// @param[in]  settings NULL for the defaults
/// @param[out] out      the new object, NULL on failure; free with swb_simulator_free
/// @return SWB_OK; SWB_ERR_STATE if the system has no dynamics; SWB_ERR_RANGE if an option is outside its
///         range; SWB_ERR_UNSUPPORTED if options do not go together
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_create(
    system: *const swb_system,
    settings: *const Settings,
    out: *mut *mut swb_simulator,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let settings = settings::read(settings)?;
            settings.validate()?;
            handle::require(system)?;
            let system = handle::with_ref(system, |s| Ok(s.clone()))?;
            Simulation::new(system, settings, interrupt)
        })
    })
}

/// Set time and state, and begin a new trajectory.
///
/// @param[in] x [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_state(
    sim: *mut swb_simulator,
    t: f64,
    x: *const f64,
    nx: i64,
) -> swb_status {
    setting(sim, || unsafe {
        let x = raw::slice(x, nx, "x")?;
        handle::with_mut(sim, |s| {
            s.simulator.get().set_state(t, x)?;
            s.t = t;
            s.x.copy_from_slice(x);
            s.result = s.simulator.get().empty_result();
            Ok(())
        })
    })
}

/// Set the controls, constant from now on.
///
/// @param[in] u [nu]
/// @return as swb_simulator_set_state
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_controls(sim: *mut swb_simulator, u: *const f64, nu: i64) -> swb_status {
    setting(sim, || unsafe {
        let u = raw::slice(u, nu, "u")?;
        handle::with_mut(sim, |s| {
            s.simulator.get().set_controls(u)?;
            s.u.copy_from_slice(u);
            Ok(())
        })
    })
}

/// Set the parameters.
///
/// @param[in] p [np]
/// @return as swb_simulator_set_state
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_params(sim: *mut swb_simulator, p: *const f64, np: i64) -> swb_status {
    setting(sim, || unsafe {
        let p = raw::slice(p, np, "p")?;
        handle::with_mut(sim, |s| {
            s.simulator.get().set_params(p)?;
            s.p.copy_from_slice(p);
            Ok(())
        })
    })
}

/// Simulate over a duration in equal steps of n_fe finite elements each, from where the last call ended;
/// the trajectory grows. It ends early where a step fails; time, state and trajectory are then those of
/// the last step that was done.
///
/// @param[out] outcome an enum swb_outcome: solved, or that of the step that failed; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_USER if a user function returned a negative code;
///         SWB_ERR_NONFINITE if one has no value where it is needed
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_run(
    sim: *mut swb_simulator,
    duration: f64,
    n_steps: i64,
    outcome: *mut i32,
) -> swb_status {
    running(sim, || unsafe {
        let reached = handle::with_mut(sim, |s| s.run(duration, n_steps))?;
        raw::write_optional(outcome, outcome_number(reached));
        Ok(())
    })
}

/// Simulate one step of n_fe finite elements over the duration h; the trajectory grows.
///
/// @param[out] outcome an enum swb_outcome; may be NULL
/// @return as swb_simulator_run
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_step(sim: *mut swb_simulator, h: f64, outcome: *mut i32) -> swb_status {
    unsafe { swb_simulator_run(sim, h, 1, outcome) }
}

/// Forget trajectory and statistics; time and state stay.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_clear(sim: *mut swb_simulator) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(sim, |s| {
            s.result = s.simulator.get().empty_result();
            Ok(())
        })
    })
}

/// Sizes of a simulator.
///
/// @param[out] nx states; may be NULL
/// @param[out] nu controls; may be NULL
/// @param[out] np parameters; may be NULL
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_sizes(
    sim: *const swb_simulator,
    nx: *mut i64,
    nu: *mut i64,
    np: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(sim, |s| {
            for (to, n) in [(nx, s.x.len()), (nu, s.u.len()), (np, s.p.len())] {
                raw::write_optional(to, n as i64);
            }
            Ok(())
        })
    })
}

/// Time reached.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_time(sim: *const swb_simulator, t: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(sim, |s| raw::write(t, s.t, "t")) })
}

/// State reached.
///
/// @param[out] x [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_state(sim: *const swb_simulator, x: *mut f64, nx: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(sim, |s| raw::write_slice(x, nx, &s.x, "x")) })
}

/// How the last step ended.
///
/// @param[out] outcome an enum swb_outcome; solved before the first step
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_outcome(sim: *const swb_simulator, outcome: *mut i32) -> swb_status {
    guard(|| unsafe { handle::with_ref(sim, |s| raw::write(outcome, outcome_number(s.result.outcome), "outcome")) })
}

/// Largest residuals over the steps of the trajectory.
///
/// @param[out] residuals   every field is written
/// @param[in]  struct_size sizeof(swb_residuals)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_residuals(
    sim: *const swb_simulator,
    residuals: *mut swb_residuals,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(sim, |s| {
            let r = swb_residuals { primal: s.result.primal, pair_min: s.result.pair_min, ..swb_residuals::default() };
            write_sized(&r, residuals, struct_size, "residuals")
        })
    })
}

/// Work and time of the steps of the trajectory.
///
/// @param[out] stats       every field is written
/// @param[in]  struct_size sizeof(swb_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_stats(
    sim: *const swb_simulator,
    stats: *mut swb_stats,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(sim, |s| {
            let value = swb_stats {
                time_build: s.time_build,
                n_steps: s.result.steps as i64,
                n_homotopies: s.result.homotopies as i64,
                ..swb_stats::of(&s.result.stats)
            };
            write_sized(&value, stats, struct_size, "stats")
        })
    })
}

/// A copy of the trajectory since the state was set; empty before the first step.
///
/// @param[out] out the new object, NULL on failure; free with swb_trajectory_free
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_trajectory(
    sim: *const swb_simulator,
    out: *mut *mut swb_trajectory,
) -> swb_status {
    guard(|| unsafe {
        raw::write(out, std::ptr::null_mut(), "out")?;
        handle::with_ref(sim, |s| hand_out(Ok(&s.result.trajectory), out))
    })
}

/// Set an integer or enumeration option of a simulator (or a float one, to an integer) by name.
///
/// @return as swb_settings_set_int
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_int(sim: *mut swb_simulator, name: *const c_char, value: i64) -> swb_status {
    setting(sim, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(sim, |o| o.set_option(name, Value::Int(value)))
    })
}

/// Set a float option of a simulator by name.
///
/// @return as swb_settings_set_double
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_double(
    sim: *mut swb_simulator,
    name: *const c_char,
    value: f64,
) -> swb_status {
    setting(sim, || unsafe {
        let name = raw::text(name, "name")?;
        handle::with_mut(sim, |o| o.set_option(name, Value::Float(value)))
    })
}

/// Set any option of a simulator by name from text: a number, or the value name of an enumeration.
///
/// @return as swb_settings_set_string
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_string(
    sim: *mut swb_simulator,
    name: *const c_char,
    value: *const c_char,
) -> swb_status {
    setting(sim, || unsafe {
        let (name, value) = (raw::text(name, "name")?, raw::text(value, "value")?);
        handle::with_mut(sim, |o| o.set_option(name, Value::Text(value.to_owned())))
    })
}

/// Set all options of a simulator.
///
/// @param[in] settings NULL for the defaults
/// @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_settings(sim: *mut swb_simulator, settings: *const Settings) -> swb_status {
    setting(sim, || unsafe {
        let settings = settings::read(settings)?;
        settings.validate()?;
        handle::with_mut(sim, |o| o.set_settings(settings))
    })
}

/// Options of a simulator, all of them.
///
/// @param[out] settings    every field is written
/// @param[in]  struct_size sizeof(swb_settings)
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_get_settings(
    sim: *const swb_simulator,
    settings: *mut Settings,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(sim, |o| write_sized(&o.settings, settings, struct_size, "settings")) })
}

/// Set who is called once per iteration; NULL for nobody.
///
/// @param[in] user_data passed on unchanged
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_set_iteration(
    sim: *mut swb_simulator,
    iteration: swb_iteration_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(sim, || unsafe {
        handle::with_mut(sim, |o| {
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
pub unsafe extern "C" fn swb_simulator_set_log(
    sim: *mut swb_simulator,
    log: swb_log_fn,
    user_data: *mut c_void,
) -> swb_status {
    setting(sim, || unsafe {
        handle::with_mut(sim, |o| {
            o.hooks.set_log(log, user_data);
            Ok(())
        })
    })
}

/// Stop the call that runs now with the outcome SWB_OUTCOME_STOPPED, or the next one if none runs. From any
/// thread and from signal handlers; only swb_simulator_free must not run at the same time. It is heeded in every phase, before the
/// next evaluation of a model function and before the next factorisation: the call ends within the time of one of
/// these, a model function that takes long itself is waited for. What was found before stays the answer.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_interrupt(sim: *const swb_simulator) -> swb_status {
    unsafe { handle::interrupt(sim) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_simulator_free(sim: *mut swb_simulator) {
    unsafe { handle::free(sim) }
}
