//! Event-driven simulation, step by step.

use super::guard::guard;
use super::handle::{self, Interrupt, Object};
use super::log::{swb_log_fn, LogSink};
use super::raw;
use super::report::{write_sized, Exclusive};
use super::run::{modes_of, order, outcome_name, outcome_number, swb_run, swb_run_outcome, swb_run_stats, Record};
use super::settings;
use super::status::swb_status;
use super::system::swb_system;
use crate::error::{Error, Result};
use crate::event::{Branching, Decider, Engine, Options, Outcome, Progress, Run, Statistics, Term};
use crate::func::trouble;
use crate::memory;
use crate::settings::{LogLevel, Settings, Value};
use crate::stop::Stop;
use crate::system::System;
use std::ffi::{c_char, c_void};
use std::mem::size_of;
use std::ptr;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Event-driven integrator of a system: explicit or implicit steps inside of modes, sliding modes as
/// differential-algebraic equations, every switch located to rounding. swb_simulator solves the equations of FESD
/// instead.
pub struct swb_integrator(());
impl Object for swb_integrator {
    type Value = Integrator;
    const NAME: &'static str = "swb_integrator";
}

/// What a step did.
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

/// What is behind the handle.
pub struct Integrator {
    system: System,
    settings: Settings,
    /// Tolerances state by state, where they were set so.
    tolerances: Option<(Vec<f64>, Vec<f64>)>,
    /// Preferred modes of the subsystems that can switch.
    preferred: Vec<Vec<usize>>,
    decide: Option<Decide>,
    engine: Exclusive<Engine>,
    /// The settings changed since the engine was built.
    stale: bool,
    /// A call failed in the middle of a step.
    broken: bool,
    t_start: f64,
    t: f64,
    x: Vec<f64>,
    f: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
    n_modes: Vec<i64>,
    active: Vec<Vec<usize>>,
    stop_times: Vec<f64>,
    outcome: i32,
    reason: String,
    stats: Statistics,
    seconds: f64,
    interrupt: Interrupt,
    progress: swb_progress_fn,
    progress_data: *mut c_void,
    log: Option<LogSink>,
}

// SAFETY: as for `LogSink`; the engine is reached by exclusive use only.
unsafe impl Send for Integrator {}
unsafe impl Sync for Integrator {}

/// An engine with these settings.
fn build(
    system: &System,
    settings: &Settings,
    tolerances: &Option<(Vec<f64>, Vec<f64>)>,
    preferred: &[Vec<usize>],
) -> Result<Engine> {
    let mut o = Options { preferred: preferred.to_vec(), ..Options::from(settings) };
    if let Some((rtol, atol)) = tolerances {
        (o.rtol, o.atol) = (rtol.clone(), atol.clone());
    }
    Engine::new(system, &o)
}

/// Run `body`, which may call user functions, and say which one it was that ended it.
pub(super) fn listening<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    let (result, troubles) = trouble::collect(true, body);
    match &troubles.fatal {
        Some(complaint) => Err(complaint.error()),
        None => result,
    }
}

impl Integrator {
    fn new(system: System, settings: Settings, interrupt: &Interrupt) -> Result<Integrator> {
        system.validate()?;
        let d = system.dims();
        let n_modes = modes_of(&system);
        let preferred = vec![Vec::new(); n_modes.len()];
        let engine = build(&system, &settings, &None, &preferred)?;
        Ok(Integrator {
            settings,
            tolerances: None,
            preferred,
            decide: None,
            stale: false,
            broken: false,
            t_start: 0.0,
            t: 0.0,
            x: vec![0.0; d.x],
            f: vec![0.0; d.x],
            u: vec![0.0; d.u],
            p: vec![0.0; d.p],
            active: vec![Vec::new(); n_modes.len()],
            n_modes,
            stop_times: Vec::new(),
            outcome: swb_run_outcome::Reached as i32,
            reason: String::new(),
            stats: Statistics::default(),
            seconds: 0.0,
            engine: Exclusive::new(engine),
            interrupt: interrupt.clone(),
            progress: None,
            progress_data: ptr::null_mut(),
            log: None,
            system,
        })
    }

    fn set_option(&mut self, name: &str, value: Value) -> Result<()> {
        let mut settings = self.settings;
        settings.set_by_name(name, value)?;
        self.set_settings(settings);
        Ok(())
    }

    fn set_settings(&mut self, settings: Settings) {
        self.stale |= settings != self.settings;
        self.settings = settings;
    }

    fn set_tolerances(&mut self, rtol: &[f64], atol: &[f64]) -> Result<()> {
        let wanted = Some((rtol.to_vec(), atol.to_vec()));
        build(&self.system, &self.settings, &wanted, &self.preferred)?;
        self.tolerances = wanted;
        self.stale = true;
        Ok(())
    }

    fn set_preferred(&mut self, subsystem: i64, modes: &[i64]) -> Result<()> {
        let k = self.subsystem(subsystem)?;
        let bad = |m: i64| Error::Range(format!("subsystem {k} has no mode {m}, it has {}", self.n_modes[k]));
        let list = modes.iter().map(|&m| usize::try_from(m).ok().filter(|_| m < self.n_modes[k]).ok_or_else(|| bad(m)));
        self.preferred[k] = list.collect::<Result<_>>()?;
        self.stale = true;
        Ok(())
    }

    fn set_decider(&mut self, decide: Option<Decide>) {
        self.decide = decide;
        let n_modes = self.n_modes.clone();
        self.engine.get().set_decider(decide.map(|d| Box::new(move |b: &Branching| d.ask(b, &n_modes)) as Decider));
    }

    fn subsystem(&self, index: i64) -> Result<usize> {
        let n = self.n_modes.len();
        usize::try_from(index).ok().filter(|&k| k < n).ok_or_else(|| {
            Error::Dimension(format!("there is no subsystem {index} that switches, their number is {n}"))
        })
    }

    fn reinit(&mut self, t: f64, x: &[f64]) -> Result<()> {
        if self.stale || self.broken {
            let mut engine = build(&self.system, &self.settings, &self.tolerances, &self.preferred)?;
            engine.reinit(t, x)?;
            engine.set_controls(&self.u)?;
            engine.set_params(&self.p)?;
            self.engine = Exclusive::new(engine);
            self.set_decider(self.decide);
            (self.stale, self.broken) = (false, false);
        } else {
            self.engine.get().reinit(t, x)?;
        }
        (self.t_start, self.t, self.seconds) = (t, t, 0.0);
        self.x.copy_from_slice(x);
        self.look();
        Ok(())
    }

    /// Keep what may be read while others read, too.
    fn look(&mut self) {
        let engine = self.engine.get();
        self.t = engine.time();
        self.x.copy_from_slice(engine.state());
        self.f.copy_from_slice(engine.derivative());
        self.outcome = outcome_number(engine.outcome());
        self.reason.clear();
        self.reason.push_str(engine.reason());
        self.stats = engine.stats();
        for (k, active) in self.active.iter_mut().enumerate() {
            *active = engine.active(k);
        }
    }

    fn set_inputs(&mut self, what: impl FnOnce(&mut Engine) -> Result<()>) -> Result<()> {
        let engine = self.engine.get();
        listening(|| what(engine))
    }

    /// New options are taken over where nothing is lost by it.
    fn prepare(&mut self) -> Result<()> {
        if self.broken {
            return Err(Error::State(
                "the last call failed in the middle of a step: call swb_integrator_reinit".into(),
            ));
        }
        if self.stale && self.stats.steps == 0 && self.t == self.t_start {
            let x = self.x.clone();
            self.reinit(self.t_start, &x)?;
        }
        Ok(())
    }

    /// Integrates to `t`, or does one step only.
    fn run(&mut self, t: f64, one: bool) -> Result<swb_progress_kind> {
        self.prepare()?;
        let clock = Instant::now();
        let level = if self.log.is_some() { self.settings.verbosity() as i64 } else { 0 };
        let mut stopped = false;
        let mut kind = swb_progress_kind::Done;
        let mut logged = self.stats.switches;
        let (engine, stop_times) = (self.engine.get(), &self.stop_times);
        let (progress, data, log, interrupt) = (self.progress, self.progress_data, self.log, &self.interrupt);
        let result = listening(|| loop {
            if interrupt.swap(false, Ordering::Relaxed) {
                stopped = true;
                return Ok(());
            }
            let now = engine.time();
            let next = stop_times.iter().copied().find(|&s| s > now && s < t);
            let done = engine.step(next.unwrap_or(t))?;
            kind = match done {
                _ if engine.outcome() == Outcome::Reached && Some(engine.time()) == next => swb_progress_kind::StopTime,
                Progress::Stepped => swb_progress_kind::Stepped,
                Progress::Switched => swb_progress_kind::Switched,
                Progress::Done => swb_progress_kind::Done,
            };
            let stats = engine.stats();
            if let Some(log) = log {
                if level >= LogLevel::Debug as i64 {
                    let recent = stats.switches - logged;
                    let all = engine.switches();
                    all[all.len().saturating_sub(recent)..]
                        .iter()
                        .for_each(|s| log.line(LogLevel::Debug, &switch_line(s)));
                }
                if level >= LogLevel::Trace as i64 && done != Progress::Done {
                    log.line(LogLevel::Trace, &format!("step t = {:.17e}, steps = {}", engine.time(), stats.steps));
                }
            }
            logged = stats.switches;
            if done == Progress::Done {
                return Ok(());
            }
            if let Some(f) = progress {
                let info = swb_progress {
                    struct_size: size_of::<swb_progress>() as u64,
                    t: engine.time(),
                    x: engine.state().as_ptr(),
                    nx: engine.state().len() as i64,
                    kind: kind as i64,
                    steps: stats.steps as i64,
                    switches: stats.switches as i64,
                };
                // SAFETY: the contract of `swb_progress_fn`; the struct outlives the call.
                if unsafe { f(&info, data) } != 0 {
                    stopped = true;
                    return Ok(());
                }
            }
            if one {
                return Ok(());
            }
        });
        self.seconds += clock.elapsed().as_secs_f64();
        self.look();
        if let Err(e) = result {
            // arguments and memory are checked before anything is done
            let before = matches!(e, Error::Range(_) | Error::Dimension(_));
            self.broken = !before && !self.engine.get().was_refused();
            self.tell(LogLevel::Error, || format!("integration error = {e}"));
            return Err(e);
        }
        if stopped {
            self.outcome = swb_run_outcome::Stopped as i32;
            self.reason = format!("t = {}: a callback or an interrupt asked to stop", self.t);
        }
        if !one || kind == swb_progress_kind::Done {
            let good = self.outcome == swb_run_outcome::Reached as i32;
            self.tell(if good { LogLevel::Info } else { LogLevel::Warning }, || self.summary());
        }
        Ok(kind)
    }

    fn summary(&self) -> String {
        let name = outcome_name(self.outcome).to_string_lossy();
        let s = &self.stats;
        let why = if self.reason.is_empty() { String::new() } else { format!(", reason = {}", self.reason) };
        format!(
            "integration outcome = {name}, t = {}, steps = {}, rejections = {}, switches = {}, evaluations = {}, time = \
             {:.3e}{why}",
            self.t, s.steps, s.rejections, s.switches, s.evaluations, self.seconds
        )
    }

    fn tell(&self, importance: LogLevel, line: impl FnOnce() -> String) {
        if let (Some(log), true) = (&self.log, self.settings.verbosity() as i64 >= importance as i64) {
            log.line(importance, &line());
        }
    }

    /// The result so far.
    fn record(&mut self) -> Result<Record> {
        let engine = self.engine.get();
        let bytes = engine.path().map_or(0, |p| p.bytes()) + size_of_val(engine.switches());
        memory::need(bytes as u128, || "a copy of the run".into())?;
        let run = Run {
            outcome: engine.outcome(),
            reason: self.reason.clone(),
            t: engine.time(),
            x: engine.state().to_vec(),
            switches: engine.switches().to_vec(),
            jumps: engine.jumps().to_vec(),
            impacts: engine.impacts().to_vec(),
            phases: engine.phases().to_vec(),
            mechanics: engine.mechanics(),
            stats: engine.stats(),
            path: engine.path().cloned(),
            sensitivity: engine.sensitivity().map(<[f64]>::to_vec),
            one_sided: engine.one_sided(),
            branchings: engine.branchings().to_vec(),
            contacts: engine.contacts().to_vec(),
            accumulations: engine.accumulations().to_vec(),
        };
        Ok(Record {
            run,
            outcome: self.outcome,
            t_start: self.t_start,
            seconds: self.seconds,
            n_modes: self.n_modes.clone(),
        })
    }
}

fn switch_line(s: &crate::event::Switch) -> String {
    format!(
        "switch t = {:.17e}, kind = {}, subsystem = {}, before = {:?}, after = {:?}, rate = {:.3e}, unique = {}",
        s.t,
        s.kind.name(),
        s.subsystem,
        s.before,
        s.after,
        s.rate,
        s.unique
    )
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
    guard(|| unsafe {
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
    guard(|| unsafe {
        let u = raw::slice(u, nu, "u")?;
        handle::with_mut(integrator, |o| {
            o.set_inputs(|e| e.set_controls(u))?;
            o.u.copy_from_slice(u);
            Ok(())
        })
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
    guard(|| unsafe {
        let p = raw::slice(p, np, "p")?;
        handle::with_mut(integrator, |o| {
            o.set_inputs(|e| e.set_params(p))?;
            o.p.copy_from_slice(p);
            Ok(())
        })
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
    guard(|| unsafe {
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
    guard(|| unsafe {
        let mut times = raw::slice(t, n, "t")?.to_vec();
        if let Some(bad) = times.iter().find(|t| !t.is_finite()) {
            return Err(Error::Range(format!("a stop time is {bad}: it must be finite")));
        }
        times.sort_by(f64::total_cmp);
        handle::with_mut(integrator, |o| {
            o.stop_times = times;
            Ok(())
        })
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
    guard(|| unsafe {
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
    guard(|| unsafe {
        handle::with_mut(integrator, |o| {
            o.set_decider(decide.map(|function| Decide { function, user_data }));
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
    guard(|| unsafe {
        let did = handle::with_mut(integrator, |o| o.run(t_stop, true))?;
        raw::write_optional(kind, did as i32);
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
    guard(|| unsafe {
        let reached = handle::with_mut(integrator, |o| o.run(t, false).map(|_| o.outcome))?;
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
            let mut out = vec![0.0; o.x.len()];
            let engine = o.engine.get();
            listening(|| engine.get_dky(t, k, &mut out))?;
            raw::write_slice(dky, nx, &out, "dky")
        })
    })
}

/// Time reached.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_integrator_get_time(integrator: *const swb_integrator, t: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write(t, o.t, "t")) })
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
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write_slice(x, nx, &o.x, "x")) })
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
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write_slice(f, nx, &o.f, "f")) })
}

/// Which modes of a subsystem are active: one alone, or several in a sliding mode; none before the first step.
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
            let k = o.subsystem(subsystem)?;
            let flags: Vec<i32> = (0..o.n_modes[k] as usize).map(|m| o.active[k].contains(&m).into()).collect();
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
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write(outcome, o.outcome, "outcome")) })
}

/// Why the simulation ended early, in words; "" if it did not.
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
    guard(|| unsafe { handle::with_ref(integrator, |o| raw::write_text(o.reason.as_bytes(), buf, len, needed)) })
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
            write_sized(&swb_run_stats::of(&o.stats, o.seconds), stats, struct_size, "stats")
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
            let terms = terms(o.x.len(), (t, v_t), (events, weight))?;
            let stop = Stop::on(&o.interrupt);
            let engine = o.engine.get();
            let g = stop.scope(|| listening(|| engine.adjoint(v, &terms)));
            if matches!(g, Err(Error::Interrupted)) {
                o.interrupt.store(false, Ordering::Relaxed);
            }
            let g = g?;
            for (p, n, values, what) in [(dx0, nx0, &g.x0, "dx0"), (dp, np, &g.p, "dp"), (du, nu, &g.u, "du")] {
                raw::check_slice(p, n, values.len(), what)?;
            }
            raw::write_slice(dx0, nx0, &g.x0, "dx0")?;
            raw::write_slice(dp, np, &g.p, "dp")?;
            raw::write_slice(du, nu, &g.u, "du")
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
    guard(|| unsafe {
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
    guard(|| unsafe {
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
    guard(|| unsafe {
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
    guard(|| unsafe {
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
    guard(|| unsafe { handle::with_ref(integrator, |o| write_sized(&o.settings, settings, struct_size, "settings")) })
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
    guard(|| unsafe {
        handle::with_mut(integrator, |o| {
            (o.progress, o.progress_data) = (progress, user_data);
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
    guard(|| unsafe {
        handle::with_mut(integrator, |o| {
            o.log = LogSink::new(log, user_data);
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
