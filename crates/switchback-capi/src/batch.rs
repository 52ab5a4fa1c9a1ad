//! Many event-driven simulations of one system on several threads.

use super::guard::{caught, guard};
use super::handle::{self, Object};
use super::raw;
use super::run::{ending_number, swb_run};
use super::settings;
use super::status::swb_status;
use super::system::swb_system;
use super::threads;
use switchback::memory;
use switchback::session::Batch;
use switchback::settings::Settings;

/// Event-driven simulations of one system from several initial states, with controls and parameters of their own.
pub struct swb_batch(());
impl Object for swb_batch {
    type Value = Batch;
    const NAME: &'static str = "swb_batch";
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
            handle::require(system)?;
            let system = handle::with_ref(system, |s| Ok(s.clone()))?;
            Batch::new(system, &settings, interrupt)
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
        let threads = threads::number(n_threads)?;
        handle::with_mut(batch, |b| b.run((t0, t1), x0, u, p, threads, &|run| caught(run)))
    })
}

/// Number of runs of the last swb_batch_run; 0 before.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_batch_size(batch: *const swb_batch, n_runs: *mut i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(batch, |b| raw::write(n_runs, b.runs().len() as i64, "n_runs")) })
}

/// Final states of all runs.
///
/// @param[out] x [n] n_runs * nx, those of one run together; NaN for runs that failed
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_batch_states(batch: *const swb_batch, x: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(batch, |b| {
            let failed = vec![f64::NAN; b.n_states()];
            let mut all = memory::with_capacity(b.runs().len() * failed.len());
            all.extend(b.runs().iter().flat_map(|r| r.as_ref().map_or(&failed, |r| &r.run.x).iter().copied()));
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
            let all: Vec<i32> = b
                .runs()
                .iter()
                .map(|r| r.as_ref().map_or_else(|e| swb_status::from(e) as i32, |r| ending_number(r.ending)))
                .collect();
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
