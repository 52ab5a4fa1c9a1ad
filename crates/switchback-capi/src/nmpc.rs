//! Model predictive control in real time.

use super::guard::guard;
use super::handle::{self, Interrupt, Object};
use super::ocp::{copied, swb_ocp};
use super::raw;
use super::report::{check_sized, write_sized, Sized8};
use super::status::swb_status;
use std::ffi::c_char;
use std::mem::size_of;
use std::ptr;
use std::sync::atomic::Ordering;
use switchback::error::{Error, Result};
use switchback::expr::CReal;
use switchback::nmpc::{CCode, Feedback, Level, Monitor, Nmpc, Options, Preparation, QpMethod, Scheme, Worker};
use switchback::session::listening;
use switchback::stop::Stop;
use switchback::tableau::Family;

/// Controller: feedback for measured states by a few iterations per sample on an optimal control problem.
pub struct swb_nmpc(());
impl Object for swb_nmpc {
    type Value = Controller;
    const NAME: &'static str = "swb_nmpc";
}

/// Work done between two samples.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_nmpc_scheme {
    /// One linearisation at the last iterate per sample.
    Rti = 0,
    /// One iteration of a level per sample; levels A, B, C keep the matrices of the first linearisation.
    Mli = 1,
    /// Iterations of a level on the problem with the predicted state, then a linearisation.
    AsRti = 2,
    /// The problem with the predicted state is solved until it converges, then linearised.
    Asc = 3,
}

/// Levels of an iteration by what it evaluates.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_nmpc_level {
    /// Nothing: another initial value in the same quadratic program.
    A = 0,
    /// Values of the constraints; the gradient from the frozen Hessian.
    B = 1,
    /// Besides, the gradient of the Lagrangian by an adjoint sweep.
    C = 2,
    /// All Jacobians; the Hessian is that of Gauss and Newton.
    D0 = 3,
    /// All Jacobians; the Hessian is updated from gradients.
    D1 = 4,
    /// All Jacobians and the exact Hessian, made convex.
    D2 = 5,
}

/// How quadratic programs are solved.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_nmpc_qp {
    /// States eliminated, dual active set on the prepared inverse of the Hessian.
    Condensing = 0,
    /// States kept: active sets by a Riccati recursion, and an interior point where these do not settle. Work is linear in the number of
    /// stages.
    Stagewise = 1,
    /// The one of both that needs fewer operations at the size of the problem.
    Auto = 2,
}

/// Numbers of C code.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_c_real {
    /// double
    Double = 0,
    /// float
    Float = 1,
}

/// Sources of a control.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_nmpc_source {
    /// The quadratic program.
    Qp = 0,
    /// The quadratic program with constraints at a price, since they cannot all be met.
    SoftQp = 1,
    /// The affine law, an unfinished quadratic program or the plan, cut off at the bounds of the controls: what costs least.
    Tangent = 2,
    /// The last plan.
    Plan = 3,
    /// The last control again.
    Hold = 4,
}

/// How a quadratic program ended.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_nmpc_qp_status {
    /// Solved.
    Solved = 0,
    /// Constraints contradict each other.
    Infeasible = 1,
    /// The deadline or the bound on changes came first.
    OutOfTime = 2,
    /// Not convex on the controls, or not finite.
    Failed = 3,
}

/// What is behind the handle.
pub struct Controller {
    worker: Worker,
    u0: Vec<f64>,
    interrupt: Interrupt,
}

/// Options of a controller; swb_nmpc_options_init sets the defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_nmpc_options {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Work done between two samples, an enum swb_nmpc_scheme.
    pub scheme: i64,
    /// Level of an iteration by what it evaluates, an enum swb_nmpc_level: that of SWB_NMPC_SCHEME_MLI, and of the inner iterations of
    /// SWB_NMPC_SCHEME_AS_RTI; levels D also say where Hessians come from.
    pub level: i64,
    /// Inner iterations of advanced steps per sample, at most 10000.
    pub inner: i64,
    /// How quadratic programs are solved, an enum swb_nmpc_qp.
    pub qp_solver: i64,
    /// 1: the iterate moves by one stage at every sample; 0: it does not.
    pub shift: i64,
    /// An enum swb_rk_family for the predictions, or -1 for that of the problem's settings.
    pub rk_family: i64,
    /// Stages of the method, 0 for as many as the settings say.
    pub n_s: i64,
    /// Steps in every control stage, 0 for as many as the settings have finite elements.
    pub steps: i64,
    /// SWB_NMPC_SCHEME_ASC ends its iterations where states and controls change by less than this share of their size,
    /// SWB_NMPC_SCHEME_AS_RTI where they would change by less from then on, by the estimated contraction (10.18).
    pub tol: f64,
    /// Seconds that swb_nmpc_feedback may take; infinite for as many as it needs.
    pub deadline: f64,
    /// Price per unit of violation where constraints cannot all be met; 0: a thousand times the cost of meeting them one by one.
    pub elastic_price: f64,
    /// Systems that switch: alternatives to the plan at most, prepared where a control moves nothing since the system sticks, and
    /// other sequences of controls that choose; at most 64.
    pub flips: i64,
    /// Systems that switch: an alternative is taken where its predicted cost is lower than that of the plan by more than this share.
    pub hysteresis: f64,
    /// Changes of the active set in swb_nmpc_feedback at most (SWB_NMPC_QP_STAGEWISE: Newton steps), 0 for as many as it needs. What is left of
    /// them is made in the next preparation.
    pub max_changes: i64,
}

unsafe impl Sized8 for swb_nmpc_options {}

impl Default for swb_nmpc_options {
    fn default() -> swb_nmpc_options {
        let o = Options::default();
        swb_nmpc_options {
            struct_size: size_of::<swb_nmpc_options>() as u64,
            scheme: o.scheme as i64,
            level: o.level as i64,
            inner: o.inner as i64,
            qp_solver: o.qp as i64,
            shift: o.shift.into(),
            rk_family: -1,
            n_s: o.n_s as i64,
            steps: o.steps as i64,
            tol: o.tol,
            deadline: o.deadline,
            elastic_price: o.elastic_price,
            flips: o.flips as i64,
            hysteresis: o.hysteresis,
            max_changes: o.max_changes as i64,
        }
    }
}

/// The entry of a table with this number.
pub(super) fn pick<T: Copy>(what: &str, all: &[T], number: i64) -> Result<T> {
    let found = usize::try_from(number).ok().and_then(|k| all.get(k)).copied();
    found.ok_or_else(|| Error::Range(format!("there is no {what} {number}: it is 0 to {}", all.len() - 1)))
}

pub(super) fn count(what: &str, v: i64) -> Result<usize> {
    usize::try_from(v).map_err(|_| Error::Range(format!("{what} is {v}: it is not negative")))
}

/// Options of the caller, whose struct may be shorter or longer; the defaults for NULL.
pub(super) unsafe fn read_options<T: Sized8 + Default>(from: *const T, init: &str) -> Result<T> {
    let mut copy = T::default();
    if from.is_null() {
        return Ok(copy);
    }
    raw::check(from, "options")?;
    let size = unsafe { from.cast::<u64>().read() };
    if !(8..=1 << 16).contains(&size) || size % 8 != 0 {
        return Err(Error::State(format!("options has struct_size {size}: call {init} first")));
    }
    let to = (&mut copy as *mut T).cast::<u8>();
    unsafe { ptr::copy_nonoverlapping(from.cast::<u8>(), to, size.min(size_of::<T>() as u64) as usize) };
    Ok(copy)
}

/// The Runge-Kutta family with this number, that of the problem's settings for -1.
pub(super) fn family(number: i64) -> Result<Option<Family>> {
    let families = [
        Family::RadauIia,
        Family::GaussLegendre,
        Family::Explicit,
        Family::RadauIa,
        Family::LobattoIiia,
        Family::LobattoIiib,
        Family::LobattoIiic,
    ];
    if number == -1 {
        return Ok(None);
    }
    pick("rk_family", &families, number).map(Some)
}

impl swb_nmpc_options {
    fn options(&self) -> Result<Options> {
        let levels = [Level::A, Level::B, Level::C, Level::D0, Level::D1, Level::D2];
        Ok(Options {
            scheme: pick("scheme", &[Scheme::Rti, Scheme::Mli, Scheme::AsRti, Scheme::Asc], self.scheme)?,
            level: pick("level", &levels, self.level)?,
            inner: count("inner", self.inner)?,
            tol: self.tol,
            qp: pick("qp_solver", &[QpMethod::Condensing, QpMethod::Stagewise, QpMethod::Auto], self.qp_solver)?,
            shift: pick("shift", &[false, true], self.shift)?,
            deadline: self.deadline,
            elastic_price: self.elastic_price,
            family: family(self.rk_family)?,
            n_s: count("n_s", self.n_s)?,
            steps: count("steps", self.steps)?,
            flips: count("flips", self.flips)?,
            hysteresis: self.hysteresis,
            max_changes: count("max_changes", self.max_changes)?,
        })
    }
}

/// Result of a preparation, a feedback or an estimate.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_nmpc_info {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Preparation: 1 if there is a quadratic program for the next sample.
    pub ready: i64,
    /// Preparation: inner iterations. Estimate: iterations of Gauss and Newton.
    pub inner: i64,
    /// Feedback and estimate: where the result comes from, an enum swb_nmpc_source.
    pub source: i64,
    /// Feedback and estimate: how the quadratic program ended, an enum swb_nmpc_qp_status.
    pub qp_status: i64,
    /// Feedback: changes of the active set.
    pub qp_iterations: i64,
    /// Seconds.
    pub time: f64,
}

unsafe impl Sized8 for swb_nmpc_info {}

impl swb_nmpc_info {
    fn of_preparation(p: &Preparation) -> swb_nmpc_info {
        swb_nmpc_info { ready: p.ready.into(), inner: p.inner as i64, time: p.time, ..swb_nmpc_info::empty() }
    }

    fn of_feedback(f: &Feedback) -> swb_nmpc_info {
        swb_nmpc_info {
            source: f.source as i64,
            qp_status: f.status as i64,
            qp_iterations: f.iterations as i64,
            time: f.time,
            ..swb_nmpc_info::empty()
        }
    }

    pub(super) fn empty() -> swb_nmpc_info {
        swb_nmpc_info {
            struct_size: size_of::<swb_nmpc_info>() as u64,
            ready: 0,
            inner: 0,
            source: 0,
            qp_status: 0,
            qp_iterations: 0,
            time: 0.0,
        }
    }
}

/// Counts and times of a controller's own work since it was made or reset. Evaluations are counted for the whole horizon at once,
/// those of dynamics at every point of a Runge-Kutta step.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_nmpc_monitor {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Estimate of the linear rate of contraction (10.18), the ratio of the last two inner steps; NaN without two.
    pub kappa: f64,
    /// Estimate of omega/2 of (10.18); NaN without three inner steps.
    pub omega: f64,
    /// The last inner step, relative to the size of states and controls.
    pub step: f64,
    /// Distance of the last measured from the predicted state, relative to the size of the states; NaN without a prediction.
    pub prediction: f64,
    /// Preparations, and their seconds: of the last, of all, of the longest.
    pub preparations: i64,
    /// Seconds of the last preparation.
    pub preparation_last: f64,
    /// Seconds of all preparations.
    pub preparation_total: f64,
    /// Seconds of the longest preparation.
    pub preparation_worst: f64,
    /// Feedbacks, and their seconds: of the last, of all, of the longest.
    pub feedbacks: i64,
    /// Seconds of the last feedback.
    pub feedback_last: f64,
    /// Seconds of all feedbacks.
    pub feedback_total: f64,
    /// Seconds of the longest feedback.
    pub feedback_worst: f64,
    /// Values of functions.
    pub values: i64,
    /// Jacobians.
    pub jacobians: i64,
    /// Adjoint sweeps.
    pub adjoints: i64,
    /// Hessians.
    pub hessians: i64,
    /// Values in the last preparation.
    pub last_values: i64,
    /// Jacobians in the last preparation.
    pub last_jacobians: i64,
    /// Adjoint sweeps in the last preparation.
    pub last_adjoints: i64,
    /// Hessians in the last preparation.
    pub last_hessians: i64,
    /// Quadratic programs solved.
    pub qps: i64,
    /// Iterations of all of them.
    pub qp_iterations: i64,
    /// Linearisations whose functions had no value, or whose program was not convex.
    pub failed_linearisations: i64,
    /// Feedbacks from the quadratic program.
    pub from_qp: i64,
    /// Feedbacks from the program with constraints at a price.
    pub from_soft_qp: i64,
    /// Feedbacks from the affine law, cut off.
    pub from_tangent: i64,
    /// Feedbacks from the last plan.
    pub from_plan: i64,
    /// Feedbacks that repeat the last control.
    pub from_hold: i64,
    /// Systems that switch: alternatives to the plan that were prepared.
    pub alternatives: i64,
    /// Flips that were taken.
    pub flips: i64,
}

unsafe impl Sized8 for swb_nmpc_monitor {}

impl swb_nmpc_monitor {
    fn of(m: &Monitor) -> swb_nmpc_monitor {
        let (e, last, s) = (m.evaluations, m.last_evaluations, m.sources);
        swb_nmpc_monitor {
            struct_size: size_of::<swb_nmpc_monitor>() as u64,
            kappa: m.kappa,
            omega: m.omega,
            step: m.step,
            prediction: m.prediction,
            preparations: m.preparation.count as i64,
            preparation_last: m.preparation.last,
            preparation_total: m.preparation.total,
            preparation_worst: m.preparation.worst,
            feedbacks: m.feedback.count as i64,
            feedback_last: m.feedback.last,
            feedback_total: m.feedback.total,
            feedback_worst: m.feedback.worst,
            values: e.values as i64,
            jacobians: e.jacobians as i64,
            adjoints: e.adjoints as i64,
            hessians: e.hessians as i64,
            last_values: last.values as i64,
            last_jacobians: last.jacobians as i64,
            last_adjoints: last.adjoints as i64,
            last_hessians: last.hessians as i64,
            qps: m.qps as i64,
            qp_iterations: m.qp_iterations as i64,
            failed_linearisations: m.failed_linearisations as i64,
            from_qp: s[0] as i64,
            from_soft_qp: s[1] as i64,
            from_tangent: s[2] as i64,
            from_plan: s[3] as i64,
            from_hold: s[4] as i64,
            alternatives: m.alternatives as i64,
            flips: m.flips as i64,
        }
    }
}

impl Controller {
    /// Runs `body`, which an interrupt ends.
    fn run<R>(&mut self, body: impl FnOnce(&mut Nmpc) -> Result<R>) -> Result<R> {
        let interrupt = &self.interrupt;
        self.worker.with(|nmpc| {
            let result = Stop::on(interrupt).scope(|| listening(|| body(nmpc)));
            // one call ends, not the next
            interrupt.store(false, Ordering::Relaxed);
            result
        })
    }
}

/// Set the defaults of the options of a controller.
///
/// @param[out] options     every word is written
/// @param[in]  struct_size sizeof(swb_nmpc_options)
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_options_init(options: *mut swb_nmpc_options, struct_size: u64) -> swb_status {
    guard(|| unsafe { write_sized(&swb_nmpc_options::default(), options, struct_size, "options") })
}

/// Create a controller for a problem as it is stated now. All memory is taken here, but what contacts, transitions and choices need. The problem is copied;
/// the first iterate is its guess. Costs along the horizon are summed over the starts of the stages (10.1), path constraints hold
/// there. Systems that switch are simulated by events in every stage, with the tolerances of the settings; they take level D0 and
/// every scheme but SWB_NMPC_SCHEME_MLI.
///
/// @param[in]  ocp     may be changed, solved and freed afterwards
/// @param[in]  options NULL for the defaults
/// @param[out] out     the new object, NULL on failure; free with swb_nmpc_free
/// @return SWB_OK; SWB_ERR_UNSUPPORTED for what controllers do not know: transitions, contacts, free times and parameters, linear controls,
///         periodicity, complementarity, penalties of the largest violation; SWB_ERR_RANGE if an option is outside its range
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_create(
    ocp: *mut swb_ocp,
    options: *const swb_nmpc_options,
    out: *mut *mut swb_nmpc,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let options = read_options(options, "swb_nmpc_options_init")?.options()?;
            handle::require(ocp)?;
            let ocp = handle::with_mut(ocp, copied)?;
            let nmpc = Nmpc::new(&ocp, &options)?;
            let u0 = vec![0.0; nmpc.nu()];
            Ok(Controller { worker: Worker::new(nmpc, interrupt), u0, interrupt: interrupt.clone() })
        })
    })
}

/// Sizes of a controller.
///
/// @param[out] n  control stages
/// @param[out] nx states that are measured: those with a derivative
/// @param[out] nu controls
/// @return SWB_OK; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_sizes(c: *const swb_nmpc, n: *mut i64, nx: *mut i64, nu: *mut i64) -> swb_status {
    guard(|| unsafe {
        let sizes = handle::with_ref(c, |c| Ok(c.worker.sizes()))?;
        let outputs = [(n, "n"), (nx, "nx"), (nu, "nu")];
        outputs.iter().try_for_each(|(p, what)| raw::check(*p, what))?;
        outputs.into_iter().zip(sizes).try_for_each(|((p, what), v)| raw::write(p, v as i64, what))
    })
}

/// Solve the problem for an initial state to convergence, from the present iterate: the start of a closed loop.
///
/// @param[in]  x0         [nx]
/// @param[in]  max_iter   steps at most
/// @param[out] iterations steps made; NULL if not wanted
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE; SWB_ERR_NUMERIC if it does not converge, the iterate being the last point;
///         SWB_ERR_USER; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_initialise(
    c: *mut swb_nmpc,
    x0: *const f64,
    nx: i64,
    max_iter: i64,
    iterations: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let x0 = raw::slice(x0, nx, "x0")?;
        let most = count("max_iter", max_iter)?;
        let done = handle::with_mut(c, |c| c.run(|c| c.initialise(x0, most)))?;
        raw::write_optional(iterations, done as i64);
        Ok(())
    })
}

/// Do everything for the next sample that needs no measurement. Where functions have no value the quadratic program of the
/// sample before is used further, which is no failure.
///
/// @param[in]  x_predicted [nx] the state that will be found; NULL with 0: one step of the model from the last state
/// @param[out] info        NULL if not wanted
/// @param[in]  struct_size sizeof(swb_nmpc_info)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_USER if a function returned a negative
///         code; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_prepare(
    c: *mut swb_nmpc,
    x_predicted: *const f64,
    nx: i64,
    info: *mut swb_nmpc_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        let x = raw::slice(x_predicted, nx, "x_predicted")?;
        check_info(info, struct_size)?;
        let done = handle::with_mut(c, |c| c.run(|c| c.prepare((nx != 0).then_some(x))))?;
        write_info(&swb_nmpc_info::of_preparation(&done), info, struct_size)
    })
}

/// Begin a preparation on a thread of the controller and return at once. swb_nmpc_feedback takes what was prepared; all other calls wait
/// until the preparation is over, and nothing else may be freed or changed by them before. The thread is started by the first call and
/// calls the functions of the model; where these may be called by one thread only (SWB_FUNCTION_FLAG_SERIAL), the preparation is
/// made before the call returns.
///
/// @param[in]  x_predicted [nx] the state that will be found; NULL with 0: one step of the model from the last state
/// @param[out] started     1; 0 if a preparation is running already, which goes on; NULL if not wanted
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite. How the preparation ends is said by swb_nmpc_wait.
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_prepare_async(
    c: *mut swb_nmpc,
    x_predicted: *const f64,
    nx: i64,
    started: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let x = raw::slice(x_predicted, nx, "x_predicted")?;
        let begun = handle::with_mut(c, |c| listening(|| c.worker.prepare((nx != 0).then_some(x))))?;
        raw::write_optional(started, i64::from(begun));
        Ok(())
    })
}

/// Wait for the preparation that swb_nmpc_prepare_async has begun.
///
/// @param[out] info        as of swb_nmpc_prepare; NULL if not wanted
/// @param[in]  struct_size sizeof(swb_nmpc_info)
/// @return SWB_OK; as swb_nmpc_prepare, how the preparation ended; SWB_ERR_STATE where there was none
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_wait(c: *mut swb_nmpc, info: *mut swb_nmpc_info, struct_size: u64) -> swb_status {
    guard(|| unsafe {
        check_info(info, struct_size)?;
        let done = handle::with_mut(c, |c| c.worker.wait())?;
        write_info(&swb_nmpc_info::of_preparation(&done), info, struct_size)
    })
}

/// Nothing is done where what it did could not be said.
pub(super) fn check_info(info: *mut swb_nmpc_info, struct_size: u64) -> Result<()> {
    if info.is_null() {
        return Ok(());
    }
    check_sized(info, struct_size, "info")
}

pub(super) unsafe fn write_info(value: &swb_nmpc_info, info: *mut swb_nmpc_info, struct_size: u64) -> Result<()> {
    if info.is_null() {
        return Ok(());
    }
    unsafe { write_sized(value, info, struct_size, "info") }
}

/// The control for a measured state. No model function is evaluated and nothing is allocated. There always is a control; info says
/// where it comes from, also for a state that is not finite. A preparation that runs on the controller's thread is waited for, for at
/// most half of the deadline; then the control is that of the last plan and its feedback law, cut off at its bounds.
///
/// @param[in]  x           [nx]
/// @param[out] u0          [nu]
/// @param[out] info        NULL if not wanted
/// @param[in]  struct_size sizeof(swb_nmpc_info)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_feedback(
    c: *mut swb_nmpc,
    x: *const f64,
    nx: i64,
    u0: *mut f64,
    nu: i64,
    info: *mut swb_nmpc_info,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        let x = raw::slice(x, nx, "x")?;
        check_info(info, struct_size)?;
        let done = handle::with_mut(c, |c| {
            raw::check_slice(u0, nu, c.u0.len(), "u0")?;
            let done = c.worker.feedback(x, &mut c.u0)?;
            raw::write_slice(u0, nu, &c.u0, "u0")?;
            Ok(done)
        })?;
        write_info(&swb_nmpc_info::of_feedback(&done), info, struct_size)
    })
}

/// Do what belongs to the last sample and can wait until its control is out: the plan, and the prediction of the next state. Every
/// other call does it where it is needed.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_finish(c: *mut swb_nmpc) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            c.run(|c| {
                c.finish();
                Ok(())
            })
        })
    })
}

/// Set the parameters. Between a preparation and its feedback they enter the prepared program by one evaluation of the model; for systems
/// that switch they count from the next preparation on.
///
/// @param[in] p [n] np values for the whole horizon, n_stages np for its stages, or (n_stages + 1) np for its nodes
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite; SWB_ERR_INTERRUPTED; SWB_ERR_USER for a negative code of a
///         callback
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_params(c: *mut swb_nmpc, p: *const f64, n: i64) -> swb_status {
    guard(|| unsafe {
        let p = raw::slice(p, n, "p")?;
        handle::with_mut(c, |c| c.run(|c| c.set_params(p)))
    })
}

/// Set the references of a least-squares term. Between a preparation and its feedback they enter the prepared program.
///
/// @param[in] term its number, in the order they were added to the problem
/// @param[in] y    [n] one reference for all nodes of the term, or one for each
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if there is no such term or a value is not finite; SWB_ERR_INTERRUPTED;
///         SWB_ERR_USER for a negative code of a callback
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_references(c: *mut swb_nmpc, term: i64, y: *const f64, n: i64) -> swb_status {
    guard(|| unsafe {
        let y = raw::slice(y, n, "y")?;
        let term = count("term", term)?;
        handle::with_mut(c, |c| c.run(|c| c.set_references(term, y)))
    })
}

/// Set the time of the first node, from the next preparation on.
///
/// @return SWB_OK; SWB_ERR_RANGE
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_time(c: *mut swb_nmpc, t0: f64) -> swb_status {
    guard(|| unsafe { handle::with_mut(c, |c| c.run(|c| c.set_time(t0))) })
}

/// Set the weights of a least-squares term, in the order they were added to the problem: from the next preparation on.
///
/// @param[in] w [n_w] the diagonal, or the matrix row by row
/// @return SWB_OK; SWB_ERR_RANGE for a term there is not, or a weight that is not finite; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_weights(c: *mut swb_nmpc, term: i64, w: *const f64, n_w: i64) -> swb_status {
    guard(|| unsafe {
        let (w, term) = (raw::slice(w, n_w, "w")?, count("term", term)?);
        handle::with_mut(c, |c| c.run(|c| c.set_weights(term, w)))
    })
}

/// Set the bounds of the controls, infinite for none. Between a preparation and its feedback they count at once.
///
/// @param[in] lower [nu]
/// @param[in] upper [nu]
/// @return SWB_OK; SWB_ERR_RANGE if a lower bound is above the upper one or NaN; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_control_bounds(
    c: *mut swb_nmpc,
    lower: *const f64,
    upper: *const f64,
    nu: i64,
) -> swb_status {
    guard(|| unsafe {
        let (lower, upper) = (raw::slice(lower, nu, "lower")?, raw::slice(upper, nu, "upper")?);
        handle::with_mut(c, |c| c.run(|c| c.set_control_bounds(lower, upper)))
    })
}

/// Set the bounds of the states that have a derivative, infinite for none. Between a preparation and its feedback they count at once.
///
/// @param[in] lower [nx]
/// @param[in] upper [nx]
/// @return SWB_OK; SWB_ERR_RANGE if a lower bound is above the upper one or NaN, or for a state that has no bound in the problem;
///         SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_state_bounds(
    c: *mut swb_nmpc,
    lower: *const f64,
    upper: *const f64,
    nx: i64,
) -> swb_status {
    guard(|| unsafe {
        let (lower, upper) = (raw::slice(lower, nx, "lower")?, raw::slice(upper, nx, "upper")?);
        handle::with_mut(c, |c| c.run(|c| c.set_state_bounds(lower, upper)))
    })
}

/// The cost of the plan with the prices of its violations, summed over the nodes as in (10.1).
///
/// @param[out] value
/// @return SWB_OK; SWB_ERR_NUMERIC if functions have no value at the plan; SWB_ERR_STATE without values of the parameters; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_get_objective(c: *mut swb_nmpc, value: *mut f64) -> swb_status {
    guard(|| unsafe {
        raw::check(value, "value")?;
        let v = handle::with_mut(c, |c| c.run(|c| c.objective()))?;
        value.write(v);
        Ok(())
    })
}

/// The feedback gain of the first stage where no constraint is active: u = u_0 + K (x - x_0).
///
/// @param[out] k [nu nx] row by row
/// @return SWB_OK; SWB_ERR_STATE if nothing is prepared; SWB_ERR_DIMENSION; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_get_gain(c: *mut swb_nmpc, k: *mut f64, n: i64) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            let [_, nx, nu] = c.worker.sizes();
            raw::check_slice(k, n, nu * nx, "k")?;
            let mut gain = vec![0.0; nu * nx];
            c.run(|c| c.gain(&mut gain))?;
            raw::write_slice(k, n, &gain, "k")
        })
    })
}

/// Rows of constraints of the program: bounds of states and constraints, node by node.
///
/// @param[out] rows
/// @return SWB_OK; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_count_rows(c: *mut swb_nmpc, rows: *mut i64) -> swb_status {
    guard(|| unsafe {
        raw::check(rows, "rows")?;
        let n = handle::with_mut(c, |c| c.worker.with(|c| Ok(c.row_nodes().count())))?;
        rows.write(n as i64);
        Ok(())
    })
}

/// Multipliers of the plan: positive at upper, negative at lower bounds.
///
/// @param[out] lambda [(n + 1) nx] of the dynamics, the first of the initial value
/// @param[out] mu     [n nu] of the bounds of the controls
/// @param[out] row_mu [rows] of the rows of constraints, see swb_nmpc_count_rows
/// @param[out] nodes  [rows] the nodes of these
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_get_multipliers(
    c: *mut swb_nmpc,
    lambda: *mut f64,
    n_lambda: i64,
    mu: *mut f64,
    n_mu: i64,
    row_mu: *mut f64,
    n_row_mu: i64,
    nodes: *mut i64,
    n_nodes: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            let [n, nx, nu] = c.worker.sizes();
            let rows = c.worker.with(|c| Ok(c.row_nodes().count()))?;
            raw::check_slice(lambda, n_lambda, (n + 1) * nx, "lambda")?;
            raw::check_slice(mu, n_mu, n * nu, "mu")?;
            raw::check_slice(row_mu, n_row_mu, rows, "row_mu")?;
            raw::check_slice(nodes, n_nodes, rows, "nodes")?;
            c.worker.with(|c| {
                c.row_nodes().enumerate().for_each(|(i, k)| nodes.add(i).write(k as i64));
                let plan = c.plan();
                raw::write_slice(lambda, n_lambda, plan.lambda(), "lambda")?;
                raw::write_slice(mu, n_mu, plan.u_mu(), "mu")?;
                raw::write_slice(row_mu, n_row_mu, plan.row_mu(), "row_mu")
            })
        })
    })
}

/// Set the seconds a feedback may take.
///
/// @return SWB_OK; SWB_ERR_RANGE if they are not positive
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_deadline(c: *mut swb_nmpc, seconds: f64) -> swb_status {
    guard(|| unsafe { handle::with_mut(c, |c| c.worker.with(|c| c.set_deadline(seconds))) })
}

/// Set the iterate; its multipliers are zero.
///
/// @param[in] x [(n + 1) nx], those of the first node first
/// @param[in] u [n nu]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_set_iterate(
    c: *mut swb_nmpc,
    x: *const f64,
    n_x: i64,
    u: *const f64,
    n_u: i64,
) -> swb_status {
    guard(|| unsafe {
        let (x, u) = (raw::slice(x, n_x, "x")?, raw::slice(u, n_u, "u")?);
        handle::with_mut(c, |c| c.worker.with(|c| c.set_iterate(x, u)))
    })
}

/// Write the controller as C files (C99) to a folder, which is made if it is not there: prefix.h, prefix.c, prefix_main.c, prefix_record.h,
/// prefix_fmu.c, modelDescription.xml, modelDescription_fmi3.xml, buildDescription.xml and Makefile. There is no heap, no thread and no clock; all
/// memory is one static object of prefix_arena_bytes bytes. "make fmu" makes a unit for co-simulation of them (FMI 2.0), "make fmu3" one of FMI 3.0.
///
/// The functions are prefix_prepare, prefix_feedback, prefix_set_reference, prefix_set_params, prefix_reset, prefix_plan_x and prefix_plan_u, described
/// in prefix.h. The controller in C begins with the present plan, parameters and references. The main program repeats a closed loop that is
/// recorded here; this controller is afterwards as after swb_nmpc_set_iterate with its plan.
///
/// @param[in] folder    path, UTF-8
/// @param[in] prefix    what names begin with, a C identifier
/// @param[in] precision an enum swb_c_real
/// @return SWB_OK; SWB_ERR_UNSUPPORTED with a message for systems that switch, implicit methods, algebraic states, costs that are no least
///         squares, functions that are no expressions, schemes other than rti and as_rti, levels other than d0; SWB_ERR_STATE if qp_solver is not
///         stagewise; SWB_ERR_RANGE for the prefix, the precision, or if a file cannot be written
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_write_c(
    c: *mut swb_nmpc,
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

/// Writes the files that `make` gives for a prefix and a precision, an enum swb_c_real, to a folder.
///
/// # Safety
/// Texts end with a zero.
pub(super) unsafe fn write_files(
    folder: *const c_char,
    prefix: *const c_char,
    precision: i64,
    make: impl FnOnce(&str, CReal) -> Result<CCode>,
) -> Result<()> {
    let (folder, prefix) = unsafe { (raw::text(folder, "folder")?, raw::text(prefix, "prefix")?) };
    let real = pick("precision", &[CReal::Double, CReal::Float], precision)?;
    make(prefix, real)?.write(std::path::Path::new(folder))
}

/// Back to the start: the guess of the problem, no multipliers, nothing measured, monitor at zero.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_reset(c: *mut swb_nmpc) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            c.worker.with(|c| {
                c.reset();
                Ok(())
            })
        })
    })
}

/// The plan from the last sample on.
///
/// @param[out] x [(n + 1) nx], those of the first node first
/// @param[out] u [n nu]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_get_plan(
    c: *mut swb_nmpc,
    x: *mut f64,
    n_x: i64,
    u: *mut f64,
    n_u: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(c, |c| {
            let [n, nx, nu] = c.worker.sizes();
            raw::check_slice(x, n_x, (n + 1) * nx, "x")?;
            raw::check_slice(u, n_u, n * nu, "u")?;
            c.worker.with(|c| {
                let plan = c.plan();
                raw::write_slice(x, n_x, plan.x(), "x")?;
                raw::write_slice(u, n_u, plan.u(), "u")
            })
        })
    })
}

/// How the controller is doing.
///
/// @param[out] monitor     every word is written
/// @param[in]  struct_size sizeof(swb_nmpc_monitor)
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_get_monitor(
    c: *mut swb_nmpc,
    monitor: *mut swb_nmpc_monitor,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        let m = handle::with_mut(c, |c| c.worker.with(|c| Ok(swb_nmpc_monitor::of(c.monitor()))))?;
        write_sized(&m, monitor, struct_size, "monitor")
    })
}

/// End the call that runs: from any thread or signal handler. A preparation that is ended leaves the quadratic program before.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if the object has been freed
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_interrupt(c: *const swb_nmpc) -> swb_status {
    unsafe { handle::interrupt(c) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_nmpc_free(c: *mut swb_nmpc) {
    unsafe { handle::free(c) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use switchback::nmpc::Source;
    use switchback::qp::QpStatus;

    #[test]
    fn numbers_of_the_border_are_those_inside() {
        let schemes = [
            (swb_nmpc_scheme::Rti as i32, Scheme::Rti as i32),
            (swb_nmpc_scheme::Mli as i32, Scheme::Mli as i32),
            (swb_nmpc_scheme::AsRti as i32, Scheme::AsRti as i32),
            (swb_nmpc_scheme::Asc as i32, Scheme::Asc as i32),
        ];
        let levels = [
            (swb_nmpc_level::A as i32, Level::A as i32),
            (swb_nmpc_level::B as i32, Level::B as i32),
            (swb_nmpc_level::C as i32, Level::C as i32),
            (swb_nmpc_level::D0 as i32, Level::D0 as i32),
            (swb_nmpc_level::D1 as i32, Level::D1 as i32),
            (swb_nmpc_level::D2 as i32, Level::D2 as i32),
        ];
        let sources = [
            (swb_nmpc_source::Qp as i32, Source::Qp as i32),
            (swb_nmpc_source::SoftQp as i32, Source::SoftQp as i32),
            (swb_nmpc_source::Tangent as i32, Source::Tangent as i32),
            (swb_nmpc_source::Plan as i32, Source::Plan as i32),
            (swb_nmpc_source::Hold as i32, Source::Hold as i32),
        ];
        let ends = [
            (swb_nmpc_qp_status::Solved as i32, QpStatus::Solved as i32),
            (swb_nmpc_qp_status::Infeasible as i32, QpStatus::Infeasible as i32),
            (swb_nmpc_qp_status::OutOfTime as i32, QpStatus::OutOfTime as i32),
            (swb_nmpc_qp_status::Failed as i32, QpStatus::Failed as i32),
            (swb_nmpc_qp::Condensing as i32, QpMethod::Condensing as i32),
            (swb_nmpc_qp::Stagewise as i32, QpMethod::Stagewise as i32),
            (swb_nmpc_qp::Auto as i32, QpMethod::Auto as i32),
            (swb_c_real::Double as i32, CReal::Double as i32),
            (swb_c_real::Float as i32, CReal::Float as i32),
        ];
        assert!(schemes.iter().chain(&levels).chain(&sources).chain(&ends).all(|(a, b)| a == b));
    }
}
