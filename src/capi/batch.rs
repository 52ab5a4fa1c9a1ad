//! Many event-driven simulations of one system on several threads.

use super::guard::{caught, guard};
use super::handle::{self, Interrupt, Object};
use super::integrator::listening;
use super::raw;
use super::run::{modes_of, outcome_number, swb_run, swb_run_outcome, Record};
use super::settings;
use super::status::swb_status;
use super::system::swb_system;
use super::threads;
use crate::error::{Error, Result};
use crate::event::{Engine, Options, Outcome};
use crate::memory;
use crate::settings::Settings;
use crate::stop::Stop;
use crate::system::System;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Event-driven simulations of one system from several initial states, with controls and parameters of their own.
pub struct swb_batch(());
impl Object for swb_batch {
    type Value = Batch;
    const NAME: &'static str = "swb_batch";
}

/// What is behind the handle.
pub struct Batch {
    system: System,
    options: Options,
    n_modes: Vec<i64>,
    interrupt: Interrupt,
    runs: Vec<Result<Record>>,
}

/// Inputs of the runs: none, one for all, or one for each.
struct Inputs<'a> {
    values: &'a [f64],
    width: usize,
    shared: bool,
}

impl<'a> Inputs<'a> {
    fn new(values: &'a [f64], width: usize, n_runs: usize, what: &str) -> Result<Inputs<'a>> {
        let shared = values.len() == width;
        if !values.is_empty() && !shared && values.len() != width * n_runs {
            return Err(Error::Dimension(format!(
                "{what} has length {}: give {width} for all runs, or {width} for each of the {n_runs}",
                values.len()
            )));
        }
        Ok(Inputs { values, width, shared })
    }

    fn of(&self, run: usize) -> Option<&'a [f64]> {
        let start = if self.shared { 0 } else { run * self.width };
        (!self.values.is_empty()).then(|| &self.values[start..start + self.width])
    }
}

impl Batch {
    fn run(&mut self, (t0, t1): (f64, f64), x0: &[f64], u: &[f64], p: &[f64], threads: i64) -> Result<()> {
        let d = self.system.dims();
        if x0.len() % d.x != 0 {
            return Err(Error::Dimension(format!("x0 has length {}, no multiple of the {} states", x0.len(), d.x)));
        }
        let n_runs = x0.len() / d.x;
        let (u, p) = (Inputs::new(u, d.u, n_runs, "u")?, Inputs::new(p, d.p, n_runs, "p")?);
        let threads = threads::number(threads, self.system.is_serial())?;
        let (next, interrupt) = (AtomicUsize::new(0), &self.interrupt);
        let one = |i: usize| -> Result<Record> {
            let clock = Instant::now();
            let result = listening(|| {
                let mut engine = Engine::new(&self.system, &self.options)?;
                engine.set_interrupt(interrupt.clone());
                engine.reinit(t0, &x0[i * d.x..(i + 1) * d.x])?;
                if let Some(u) = u.of(i) {
                    engine.set_controls(u)?;
                }
                if let Some(p) = p.of(i) {
                    engine.set_params(p)?;
                }
                let stopped = match engine.advance(t1) {
                    Err(Error::Interrupted) => true,
                    other => other.map(|_| false)?,
                };
                Ok((engine.into_run(), stopped))
            });
            let (mut run, stopped) = result?;
            let mut outcome = outcome_number(run.outcome);
            if stopped && run.outcome == Outcome::Reached {
                outcome = swb_run_outcome::Stopped as i32;
                run.reason = format!("t = {}: interrupted", run.t);
            }
            let seconds = clock.elapsed().as_secs_f64();
            Ok(Record { run, outcome, t_start: t0, seconds, n_modes: self.n_modes.clone() })
        };
        let stop = Stop::on(interrupt);
        let work = || -> Vec<(usize, Result<Record>)> {
            let mut mine = Vec::new();
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= n_runs {
                    return mine;
                }
                mine.push((i, caught(|| stop.scope(|| memory::call(|| one(i))))));
            }
        };
        let mut runs: Vec<(usize, Result<Record>)> = std::thread::scope(|scope| {
            // without room for another thread the others do its work
            let spawn = || {
                let room = memory::room_for_thread();
                room.then(|| std::thread::Builder::new().spawn_scoped(scope, work).ok()).flatten()
            };
            let others: Vec<_> = (1..threads.min(n_runs)).map_while(|_| spawn()).collect();
            let mut all = work();
            for o in others {
                all.extend(o.join().unwrap_or_default());
            }
            all
        });
        runs.sort_by_key(|r| r.0);
        self.interrupt.store(false, Ordering::Relaxed);
        if runs.len() != n_runs {
            return Err(Error::Internal("a thread of the batch panicked".into()));
        }
        self.runs = runs.into_iter().map(|r| r.1).collect();
        Ok(())
    }

    fn get(&self, index: i64) -> Result<&Record> {
        let n = self.runs.len();
        let found = usize::try_from(index).ok().and_then(|i| self.runs.get(i));
        let run = found.ok_or_else(|| Error::Dimension(format!("there is no run {index}, the batch has {n}")))?;
        run.as_ref().map_err(Clone::clone)
    }
}

/// Create a batch.
///
/// @param[in]  system   copied; may be freed afterwards. Its functions are called by several threads at once, unless one
///                      of them carries the flag SWB_SERIAL
/// @param[in]  settings NULL for the defaults
/// @param[out] out      the new object, NULL on failure; free with swb_batch_free
/// @return as swb_integrator_create
#[no_mangle]
pub unsafe extern "C" fn swb_batch_create(
    system: *const swb_system,
    settings: *const Settings,
    out: *mut *mut swb_batch,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let settings = settings::read(settings)?;
            settings.validate()?;
            let system = handle::with_ref(system, |s| Ok(s.clone()))?;
            system.validate()?;
            let n_modes = modes_of(&system);
            let options = Options { preferred: vec![Vec::new(); n_modes.len()], ..Options::from(&settings) };
            Engine::new(&system, &options)?;
            Ok(Batch { system, options, n_modes, interrupt: interrupt.clone(), runs: Vec::new() })
        })
    })
}

/// Simulate from t0 to t1, from every initial state. A run that fails does not keep the others from running. The results
/// are those of single runs to the last bit, whatever the number of threads.
///
/// @param[in] x0        [n_x0] the initial states, those of one run together
/// @param[in] u         [n_u] controls: none (zeros), nu for all runs, or nu for each
/// @param[in] p         [n_p] parameters, the same
/// @param[in] n_threads threads at most; 0: one for each processor. With a function that carries the flag SWB_SERIAL the
///                      thread of the caller does it all. Log and progress callbacks do not exist here
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if n_threads is negative
#[no_mangle]
pub unsafe extern "C" fn swb_batch_run(
    batch: *mut swb_batch,
    t0: f64,
    t1: f64,
    x0: *const f64,
    n_x0: i64,
    u: *const f64,
    n_u: i64,
    p: *const f64,
    n_p: i64,
    n_threads: i64,
) -> swb_status {
    guard(|| unsafe {
        let (x0, u, p) = (raw::slice(x0, n_x0, "x0")?, raw::slice(u, n_u, "u")?, raw::slice(p, n_p, "p")?);
        handle::with_mut(batch, |b| b.run((t0, t1), x0, u, p, n_threads))
    })
}

/// Number of runs of the last swb_batch_run; 0 before.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_batch_size(batch: *const swb_batch, n_runs: *mut i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(batch, |b| raw::write(n_runs, b.runs.len() as i64, "n_runs")) })
}

/// Final states of all runs.
///
/// @param[out] x [n] n_runs * nx, those of one run together; NaN for runs that failed
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_batch_states(batch: *const swb_batch, x: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(batch, |b| {
            let failed = vec![f64::NAN; b.system.dims().x];
            let mut all = memory::with_capacity(b.runs.len() * failed.len());
            all.extend(b.runs.iter().flat_map(|r| r.as_ref().map_or(&failed, |r| &r.run.x).iter().copied()));
            raw::write_slice(x, n, &all, "x")
        })
    })
}

/// How all runs ended.
///
/// @param[out] outcome [n] n_runs, an enum swb_run_outcome each, or the negative swb_status of a run that failed
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_batch_outcomes(batch: *const swb_batch, outcome: *mut i32, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(batch, |b| {
            let all: Vec<i32> =
                b.runs.iter().map(|r| r.as_ref().map_or_else(|e| swb_status::from(e) as i32, |r| r.outcome)).collect();
            raw::write_slice(outcome, n, &all, "outcome")
        })
    })
}

/// A copy of the result of one run.
///
/// @param[in]  index the run, from 0
/// @param[out] out   the new object, NULL on failure; free with swb_run_free
/// @return SWB_OK; SWB_ERR_DIMENSION; the status of the run if it failed, with its message
#[no_mangle]
pub unsafe extern "C" fn swb_batch_get_run(batch: *const swb_batch, index: i64, out: *mut *mut swb_run) -> swb_status {
    guard(|| unsafe { handle::create(out, |_| handle::with_ref(batch, |b| b.get(index)?.copy())) })
}

/// Stop the runs that are at work, with the outcome SWB_RUN_OUTCOME_STOPPED, or those of the next call if none are. From
/// any thread and from signal handlers; only swb_batch_free must not run at the same time. The call ends when every run has
/// finished its step.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_batch_interrupt(batch: *const swb_batch) -> swb_status {
    unsafe { handle::interrupt(batch) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_batch_free(batch: *mut swb_batch) {
    unsafe { handle::free(batch) }
}
