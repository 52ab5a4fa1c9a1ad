//! Moving horizon estimation.

use super::function::{shared, swb_function};
use super::guard::guard;
use super::handle::{self, Interrupt, Object};
use super::nmpc::{check_info, count, family, read_options, swb_nmpc_info, write_files, write_info};
use super::ocp::{copied, swb_ocp};
use super::raw;
use super::report::{write_sized, Sized8};
use super::status::swb_status;
use std::ffi::c_char;
use std::mem::size_of;
use std::sync::atomic::Ordering;
use switchback::error::Result;
use switchback::nmpc::{Mhe, MheOptions, Noise};
use switchback::session::listening;
use switchback::stop::Stop;

/// Estimator: states and constant parameters from the measurements of the last samples.
pub struct swb_mhe(());
impl Object for swb_mhe {
    type Value = Estimator;
    const NAME: &'static str = "swb_mhe";
}

/// What is behind the handle.
pub struct Estimator {
    mhe: Mhe,
    x: Vec<f64>,
    covariance: Vec<f64>,
    interrupt: Interrupt,
}

impl Estimator {
    /// Runs `body`, which an interrupt ends.
    fn run<R>(&mut self, body: impl FnOnce(&mut Mhe) -> Result<R>) -> Result<R> {
        let mhe = &mut self.mhe;
        let result = Stop::on(&self.interrupt).scope(|| listening(|| body(mhe)));
        // one call ends, not the next
        self.interrupt.store(false, Ordering::Relaxed);
        result
    }
}

/// Options of an estimator; swb_mhe_options_init sets the defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_mhe_options {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Iterations of Gauss and Newton per sample at most, 1 to 10000; those behind the first linearise in swb_mhe_estimate.
    pub iterations: i64,
    /// An enum swb_rk_family for the model, or -1 for that of the problem's settings.
    pub rk_family: i64,
    /// Stages of the method, 0 for as many as the settings say.
    pub n_s: i64,
    /// Steps in every stage, 0 for as many as the settings have finite elements.
    pub steps: i64,
    /// Iterations end where a step is below this share of the standard deviations of the start.
    pub tol: f64,
    /// Seconds that swb_mhe_estimate may take; infinite for as many as it needs.
    pub deadline: f64,
}

unsafe impl Sized8 for swb_mhe_options {}

impl Default for swb_mhe_options {
    fn default() -> swb_mhe_options {
        let o = MheOptions::default();
        swb_mhe_options {
            struct_size: size_of::<swb_mhe_options>() as u64,
            iterations: o.iterations as i64,
            rk_family: -1,
            n_s: o.n_s as i64,
            steps: o.steps as i64,
            tol: o.tol,
            deadline: o.deadline,
        }
    }
}

impl swb_mhe_options {
    fn options(&self) -> Result<MheOptions> {
        Ok(MheOptions {
            iterations: count("iterations", self.iterations)?,
            tol: self.tol,
            deadline: self.deadline,
            family: family(self.rk_family)?,
            n_s: count("n_s", self.n_s)?,
            steps: count("steps", self.steps)?,
        })
    }
}

/// Set the defaults of the options of an estimator.
///
/// @param[out] options     every word is written
/// @param[in]  struct_size sizeof(swb_mhe_options)
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_options_init(options: *mut swb_mhe_options, struct_size: u64) -> swb_status {
    guard(|| unsafe { write_sized(&swb_mhe_options::default(), options, struct_size, "options") })
}

/// Create a moving horizon estimator for the system, the stages, the parameters and the bounds of states of a problem, which has no costs and no other
/// constraints. Its stages are the samples of the window and have the same length; its initial state is the mean before the first measurement. All memory
/// is taken here, but what contacts and transitions need. Constant parameters are estimated as states with a zero derivative.
///
/// @param[in]  ocp         copied as it is stated now
/// @param[in]  measured    y by state, control of the stage before, parameters and time; dimensions of the system
/// @param[in]  initial     [n_initial] nx standard deviations of the state before the first measurement, positive
/// @param[in]  process     [n_process] nx standard deviations of what is added to the states in every stage, zero for none
/// @param[in]  measurement [n_measurement] ny standard deviations of the measurements, positive
/// @param[in]  options     NULL for the defaults
/// @param[out] out         the new object, NULL on failure; free with swb_mhe_free
/// @return SWB_OK; SWB_ERR_UNSUPPORTED for what estimators do not know: costs, other constraints, discrete states, choices, algebraic states;
///         SWB_ERR_DIMENSION; SWB_ERR_RANGE if an option or a deviation is outside its range; SWB_ERR_STATE without an initial state or
///         parameters; SWB_ERR_USER
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_create(
    ocp: *mut swb_ocp,
    measured: *const swb_function,
    initial: *const f64,
    n_initial: i64,
    process: *const f64,
    n_process: i64,
    measurement: *const f64,
    n_measurement: i64,
    options: *const swb_mhe_options,
    out: *mut *mut swb_mhe,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let options = read_options(options, "swb_mhe_options_init")?.options()?;
            let noise = Noise {
                initial: raw::slice(initial, n_initial, "initial")?,
                process: raw::slice(process, n_process, "process")?,
                measurement: raw::slice(measurement, n_measurement, "measurement")?,
            };
            handle::require(ocp)?;
            let measured = shared(measured, "measured")?;
            let ocp = handle::with_mut(ocp, copied)?;
            let mhe = listening(|| Mhe::new(&ocp, &measured, &noise, &options))?;
            let nx = mhe.nx();
            Ok(Estimator { mhe, x: vec![0.0; nx], covariance: vec![0.0; nx * nx], interrupt: interrupt.clone() })
        })
    })
}

/// Sizes of an estimator.
///
/// @param[out] n  stages of the window
/// @param[out] nx states
/// @param[out] nu controls
/// @param[out] ny measurements of a sample
/// @param[out] nw states that have noise
/// @return SWB_OK; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_sizes(
    c: *mut swb_mhe,
    n: *mut i64,
    nx: *mut i64,
    nu: *mut i64,
    ny: *mut i64,
    nw: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let sizes = handle::with_mut(c, |c| Ok([c.mhe.n(), c.mhe.nx(), c.mhe.nu(), c.mhe.ny(), c.mhe.noisy().len()]))?;
        let outputs = [(n, "n"), (nx, "nx"), (nu, "nu"), (ny, "ny"), (nw, "nw")];
        outputs.iter().try_for_each(|(p, what)| raw::check(*p, what))?;
        outputs.into_iter().zip(sizes).try_for_each(|((p, what), v)| raw::write(p, v as i64, what))
    })
}

/// Go to the next sample under a control, and do everything for it that needs no measurement: arrival cost, prediction, linearisation, factors.
///
/// @param[in]  u           [nu] control from the last sample to this one; NULL with 0 for a system without
/// @param[out] info        NULL if not wanted
/// @param[in]  struct_size sizeof(swb_nmpc_info)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER if a function returned a negative
///         code; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_prepare(
    c: *mut swb_mhe,
    u: *const f64,
    nu: i64,
    info: *mut swb_nmpc_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        let u = raw::slice(u, nu, "u")?;
        check_info(info, struct_size)?;
        let (ready, time) = handle::with_mut(c, |c| {
            c.run(|c| {
                let start = std::time::Instant::now();
                c.prepare(u).map(|ready| (ready, start.elapsed().as_secs_f64()))
            })
        })?;
        write_info(&swb_nmpc_info { ready: ready.into(), time, ..swb_nmpc_info::empty() }, info, struct_size)
    })
}

/// The state at the sample of the last preparation, or at the start, from its measurements. It is a prediction where info says
/// SWB_NMPC_SOURCE_PLAN: functions have no value at the estimate.
///
/// @param[in]  y           [ny] NaN for what was not measured
/// @param[out] x           [nx]
/// @param[out] info        NULL if not wanted
/// @param[in]  struct_size sizeof(swb_nmpc_info)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a measurement is infinite; SWB_ERR_STATE where the sample has an estimate: call
///         swb_mhe_prepare; SWB_ERR_USER; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_estimate(
    c: *mut swb_mhe,
    y: *const f64,
    ny: i64,
    x: *mut f64,
    nx: i64,
    info: *mut swb_nmpc_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        let y = raw::slice(y, ny, "y")?;
        check_info(info, struct_size)?;
        let done = handle::with_mut(c, |c| {
            raw::check_slice(x, nx, c.x.len(), "x")?;
            let mut found = std::mem::take(&mut c.x);
            let done = c.run(|c| c.estimate(y, &mut found));
            c.x = found;
            let done = done?;
            raw::write_slice(x, nx, &c.x, "x")?;
            Ok(done)
        })?;
        let of_estimate = swb_nmpc_info {
            inner: done.iterations as i64,
            source: done.source as i64,
            qp_status: done.status as i64,
            time: done.time,
            ..swb_nmpc_info::empty()
        };
        write_info(&of_estimate, info, struct_size)
    })
}

/// Set the parameters from the next preparation on; samples that were keep theirs.
///
/// @param[in] p [np]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_set_params(c: *mut swb_mhe, p: *const f64, np: i64) -> swb_status {
    guard(|| unsafe {
        let p = raw::slice(p, np, "p")?;
        handle::with_mut(c, |c| c.mhe.set_params(p))
    })
}

/// Back to the start with another mean: nothing was measured.
///
/// @param[in] x0 [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_reset(c: *mut swb_mhe, x0: *const f64, nx: i64) -> swb_status {
    guard(|| unsafe {
        let x0 = raw::slice(x0, nx, "x0")?;
        handle::with_mut(c, |c| c.run(|c| c.reset(x0)))
    })
}

/// Write the estimator as C files (C99) to a folder, which is made if it is not there: prefix.h, prefix.c, prefix_main.c, prefix_record.h and
/// Makefile. There is no heap, no thread and no clock; all memory is one static object of prefix_arena_bytes bytes.
///
/// The functions are prefix_prepare, prefix_estimate, prefix_set_params, prefix_reset, prefix_states and prefix_filled, described in prefix.h. The estimator in
/// C begins with the initial state and the present parameters. The main program repeats estimates that are recorded here, from simulated measurements; this
/// estimator is afterwards as after swb_mhe_reset with the initial state.
///
/// @param[in] folder    path, UTF-8
/// @param[in] prefix    what names begin with, a C identifier
/// @param[in] precision an enum swb_c_real
/// @return SWB_OK; SWB_ERR_UNSUPPORTED with a message for systems that switch, implicit methods, deadlines, functions that are no expressions;
///         SWB_ERR_RANGE for the prefix, the precision, or if a file cannot be written
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_write_c(
    c: *mut swb_mhe,
    folder: *const c_char,
    prefix: *const c_char,
    precision: i64,
) -> swb_status {
    guard(|| unsafe {
        write_files(folder, prefix, precision, |prefix, real| {
            handle::with_mut(c, |c| c.run(|c| c.write_c(prefix, real)))
        })
    })
}

/// The window: states of its nodes, the last sample at the end, and noise of its stages.
///
/// @param[out] x      [(n + 1) nx]
/// @param[out] w      [n nw]; NULL with 0 if not wanted
/// @param[out] filled stages that were; those in front of them do nothing; NULL if not wanted
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_get_window(
    c: *mut swb_mhe,
    x: *mut f64,
    n_x: i64,
    w: *mut f64,
    n_w: i64,
    filled: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            let wanted = !w.is_null() || n_w != 0;
            raw::check_slice(x, n_x, c.mhe.states().len(), "x")?;
            if wanted {
                raw::check_slice(w, n_w, c.mhe.noise().len(), "w")?;
                raw::write_slice(w, n_w, c.mhe.noise(), "w")?;
            }
            raw::write_slice(x, n_x, c.mhe.states(), "x")?;
            raw::write_optional(filled, c.mhe.filled() as i64);
            Ok(())
        })
    })
}

/// The covariance of the last state by the linearisation of the last program, without regard of bounds.
///
/// @param[out] p [nx nx]
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION; SWB_ERR_STATE where there is no program
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_get_covariance(c: *mut swb_mhe, p: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            raw::check_slice(p, n, c.covariance.len(), "p")?;
            c.mhe.covariance(&mut c.covariance)?;
            raw::write_slice(p, n, &c.covariance, "p")
        })
    })
}

/// End the call that runs: from any thread or signal handler.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if the object has been freed
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_interrupt(c: *const swb_mhe) -> swb_status {
    unsafe { handle::interrupt(c) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_mhe_free(c: *mut swb_mhe) {
    unsafe { handle::free(c) }
}
