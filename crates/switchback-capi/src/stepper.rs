//! Time stepping of scenes with many contacts.

use super::guard::guard;
use super::handle::{self, running, setting, Interrupt, Object};
use super::raw;
use super::report::{write_sized, Sized8};
use super::status::swb_status;
use super::system::swb_system;
use std::mem::size_of;
use std::ptr;
use std::sync::atomic::Ordering;
use switchback::error::{Error, Result};
use switchback::session::listening;
use switchback::stepping::{Options, Statistics, Stepper};
use switchback::stop::Stop;
use switchback::system::ImpactLaw;

/// Stepper: makes steps of a scene by the theta-method of Moreau and Jean, in which impacts need not be located. For
/// scenes with many contacts; of order 1 in the step.
pub struct swb_stepper(());
impl Object for swb_stepper {
    type Value = StepperObject;
    const NAME: &'static str = "swb_stepper";
}

/// What is behind the handle.
pub struct StepperObject {
    stepper: Stepper,
    sizes: [usize; 3],
    interrupt: Interrupt,
}

/// Options of a stepper; swb_step_options_init sets the defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_step_options {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Length of a step.
    pub h: f64,
    /// Place in a step at which functions are evaluated: 1/2 in its middle, 1 at its start.
    pub theta: f64,
    /// Impulses of a step are found to this share of them, measured by energy.
    pub tolerance: f64,
    /// Sweeps over the contacts and steps of conjugate gradients in a step at most.
    pub max_iterations: i64,
    /// An enum swb_impact_law, or -1 for that of the scene.
    pub law: i64,
    /// 1: what came to rest too deep is shifted back; 0: it is not.
    pub correct: i64,
    /// 1: every step looks at all contacts, for checks: the result is the same to the last bit.
    pub look_at_all: i64,
}

unsafe impl Sized8 for swb_step_options {}

impl Default for swb_step_options {
    fn default() -> swb_step_options {
        let o = Options::default();
        swb_step_options {
            struct_size: size_of::<swb_step_options>() as u64,
            h: o.h,
            theta: o.theta,
            tolerance: o.tolerance,
            max_iterations: o.max_iterations as i64,
            law: -1,
            correct: o.correct.into(),
            look_at_all: o.look_at_all.into(),
        }
    }
}

impl swb_step_options {
    /// Those of the caller, whose struct may be shorter or longer.
    unsafe fn read(from: *const swb_step_options) -> Result<swb_step_options> {
        let mut copy = swb_step_options::default();
        if from.is_null() {
            return Ok(copy);
        }
        raw::check(from, "options")?;
        let (size, ours) = (unsafe { from.cast::<u64>().read() }, copy.struct_size);
        if !(8..=1 << 16).contains(&size) || size % 8 != 0 {
            return Err(Error::State(format!("options has struct_size {size}: call swb_step_options_init first")));
        }
        let to = (&mut copy as *mut swb_step_options).cast::<u8>();
        unsafe { ptr::copy_nonoverlapping(from.cast::<u8>(), to, size.min(ours) as usize) };
        Ok(copy)
    }

    fn options(&self) -> Result<Options> {
        let flag = |what: &str, v: i64| match v {
            0 | 1 => Ok(v == 1),
            _ => Err(Error::Range(format!("{what} is {v}: it is 0 or 1"))),
        };
        let law = match self.law {
            -1 => None,
            0 => Some(ImpactLaw::Newton),
            1 => Some(ImpactLaw::Sequential),
            other => return Err(Error::Range(format!("there is no impact law {other}: see swb_impact_law"))),
        };
        Ok(Options {
            h: self.h,
            theta: self.theta,
            tolerance: self.tolerance,
            max_iterations: usize::try_from(self.max_iterations).unwrap_or(0),
            law,
            correct: flag("correct", self.correct)?,
            look_at_all: flag("look_at_all", self.look_at_all)?,
            ..Options::default()
        })
    }
}

/// Counts of the steps since the state was set, and how they went.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_step_stats {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Steps.
    pub steps: i64,
    /// Gaps evaluated.
    pub gaps: i64,
    /// Bounds of gaps over boxes.
    pub bounds: i64,
    /// Closed contacts, summed over the steps.
    pub contacts: i64,
    /// Most contacts closed at once.
    pub most_contacts: i64,
    /// Sweeps over the contacts.
    pub sweeps: i64,
    /// Steps of conjugate gradients.
    pub gradients: i64,
    /// Steps whose impulses were not found to the tolerance.
    pub unconverged: i64,
    /// The largest relative change left in such a step.
    pub worst_change: f64,
    /// The deepest penetration seen, in the unit of its gap.
    pub penetration: f64,
    /// The contact it was at, -1 if there was none.
    pub deepest: i64,
}

unsafe impl Sized8 for swb_step_stats {}

impl swb_step_stats {
    fn of(s: &Statistics) -> swb_step_stats {
        swb_step_stats {
            struct_size: size_of::<swb_step_stats>() as u64,
            steps: s.steps as i64,
            gaps: s.gaps as i64,
            bounds: s.bounds as i64,
            contacts: s.contacts as i64,
            most_contacts: s.most_contacts as i64,
            sweeps: s.sweeps as i64,
            gradients: s.gradients as i64,
            unconverged: s.unconverged as i64,
            worst_change: s.worst_change,
            penetration: s.penetration,
            deepest: s.deepest.map_or(-1, |c| c as i64),
        }
    }
}

impl StepperObject {
    /// Runs `body`, which an interrupt ends.
    fn run<R>(&mut self, body: impl FnOnce(&mut Stepper) -> Result<R>) -> Result<R> {
        let (stepper, interrupt) = (&mut self.stepper, &self.interrupt);
        let result = Stop::on(interrupt).scope(|| listening(|| body(stepper)));
        // one call ends, not the next
        interrupt.store(false, Ordering::Relaxed);
        result
    }
}

/// Set the defaults of the options of a stepper.
///
/// @param[out] options     every word is written
/// @param[in]  struct_size sizeof(swb_step_options)
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION if the size is no size of such a struct
#[no_mangle]
pub unsafe extern "C" fn swb_step_options_init(options: *mut swb_step_options, struct_size: u64) -> swb_status {
    guard(|| unsafe { write_sized(&swb_step_options::default(), options, struct_size, "options") })
}

/// Create a stepper of a scene. It has no state yet; controls and parameters are zero until they are set.
///
/// @param[in]  system  of swb_scene_system; copied, may be freed afterwards
/// @param[in]  options NULL for the defaults
/// @param[out] out     the new object, NULL on failure; free with swb_stepper_free
/// @return SWB_OK; SWB_ERR_STATE if the system is no scene; SWB_ERR_UNSUPPORTED for projected systems; SWB_ERR_RANGE if an
///         option is outside its range; SWB_ERR_NUMERIC if a constant inertia is not positive definite
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_create(
    system: *const swb_system,
    options: *const swb_step_options,
    out: *mut *mut swb_stepper,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |interrupt| {
            let options = swb_step_options::read(options)?.options()?;
            handle::require(system)?;
            let system = handle::with_ref(system, |s| Ok(s.clone()))?;
            let d = system.dims();
            let stepper = Stepper::new(&system, &options)?;
            Ok(StepperObject { stepper, sizes: [d.x, d.u, d.p], interrupt: interrupt.clone() })
        })
    })
}

/// Set time and state (coordinates, then velocities), and forget impulses and statistics. Set the parameters first.
///
/// @param[in] x [nx]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite or a gap is negative by more than a thousandth
///         of the coordinates in it and more than two steps make; SWB_ERR_NONFINITE if a function is not defined there;
///         SWB_ERR_NUMERIC if the inertia is not positive definite
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_set_state(
    stepper: *mut swb_stepper,
    t: f64,
    x: *const f64,
    nx: i64,
) -> swb_status {
    setting(stepper, || unsafe {
        let x = raw::slice(x, nx, "x")?;
        handle::with_mut(stepper, |s| s.run(|s| s.reset(t, x)))
    })
}

/// Set the controls, constant from now on.
///
/// @param[in] u [nu]
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_RANGE if a value is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_set_controls(stepper: *mut swb_stepper, u: *const f64, nu: i64) -> swb_status {
    setting(stepper, || unsafe {
        let u = raw::slice(u, nu, "u")?;
        handle::with_mut(stepper, |s| s.stepper.set_controls(u))
    })
}

/// Set the parameters, constant from now on.
///
/// @param[in] p [np]
/// @return as swb_stepper_set_controls
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_set_params(stepper: *mut swb_stepper, p: *const f64, np: i64) -> swb_status {
    setting(stepper, || unsafe {
        let p = raw::slice(p, np, "p")?;
        handle::with_mut(stepper, |s| s.stepper.set_params(p))
    })
}

/// Make one step of the length h of the options.
///
/// @return SWB_OK; SWB_ERR_STATE before swb_stepper_set_state, and after a step that failed; SWB_ERR_USER if a user function
///         returned a negative code; SWB_ERR_NONFINITE if one has no value where it is needed, or the state grows without
///         end; SWB_ERR_RANGE if friction or restitution is out of range; SWB_ERR_NUMERIC if the inertia is not positive
///         definite; SWB_ERR_INTERRUPTED
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_step(stepper: *mut swb_stepper) -> swb_status {
    running(stepper, || unsafe { handle::with_mut(stepper, |s| s.run(Stepper::step)) })
}

/// Make equal steps, not longer than h, that end at a time.
///
/// @param[in] t not before the time reached
/// @return as swb_stepper_step; where it fails, time and state are those of the last step that was made
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_advance(stepper: *mut swb_stepper, t: f64) -> swb_status {
    running(stepper, || unsafe { handle::with_mut(stepper, |s| s.run(|s| s.advance(t))) })
}

/// How many states swb_stepper_run keeps.
///
/// @param[in]  t     end
/// @param[in]  every states are kept after so many steps, 1 or more
/// @param[out] n     states, the present one included
/// @return SWB_OK; SWB_ERR_RANGE; SWB_ERR_NULL
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_count(stepper: *const swb_stepper, t: f64, every: i64, n: *mut i64) -> swb_status {
    guard(|| unsafe {
        let every = at_least_one(every)?;
        let count = handle::with_ref(stepper, |s| s.stepper.count_records(t, every))?;
        raw::write(n, count as i64, "n")
    })
}

/// Make equal steps, not longer than h, that end at a time, and keep states.
///
/// @param[in]  t          not before the time reached
/// @param[in]  every      the state is kept after so many steps, and the last
/// @param[out] times      [n_times] as swb_stepper_count says: the present time, then those of the states that are kept
/// @param[out] states     [n_states] n_times times nx, those of the first time first
/// @param[out] impulses   [n_impulses] n_times times n_contacts times 3, those of the steps that end at these times; NULL
///                        with 0 if they are not wanted
/// @return as swb_stepper_step, and SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_run(
    stepper: *mut swb_stepper,
    t: f64,
    every: i64,
    times: *mut f64,
    n_times: i64,
    states: *mut f64,
    n_states: i64,
    impulses: *mut f64,
    n_impulses: i64,
) -> swb_status {
    running(stepper, || unsafe {
        let every = at_least_one(every)?;
        handle::with_mut(stepper, |s| {
            let n = s.stepper.count_records(t, every)?;
            let (nx, n_contacts) = (s.sizes[0], s.stepper.impulses().len());
            raw::check_slice(times, n_times, n, "times")?;
            raw::check_slice(states, n_states, n * nx, "states")?;
            let wanted = n_impulses != 0;
            if wanted {
                raw::check_slice(impulses, n_impulses, n * n_contacts * 3, "impulses")?;
            }
            let steps = s.run(|s| s.run_recording(t, every, wanted))?;
            raw::write_slice(times, n_times, &steps.times, "times")?;
            raw::write_slice(states, n_states, &steps.states, "states")?;
            if wanted {
                let mut all = vec![0.0; n * n_contacts * 3];
                for i in &steps.impulses {
                    let at = 3 * (i.record * n_contacts + i.contact);
                    all[at..at + 3].copy_from_slice(&i.impulse);
                }
                raw::write_slice(impulses, n_impulses, &all, "impulses")?;
            }
            Ok(())
        })
    })
}

fn at_least_one(every: i64) -> Result<u64> {
    u64::try_from(every)
        .ok()
        .filter(|&e| e > 0)
        .ok_or_else(|| Error::Range(format!("states are kept every {every} steps: give a number that is at least 1")))
}

/// Sizes of a stepper.
///
/// @param[out] nx         states: coordinates and velocities; may be NULL
/// @param[out] nu         controls; may be NULL
/// @param[out] np         parameters; may be NULL
/// @param[out] n_contacts contacts, those that were left out do not count; may be NULL
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_sizes(
    stepper: *const swb_stepper,
    nx: *mut i64,
    nu: *mut i64,
    np: *mut i64,
    n_contacts: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(stepper, |s| {
            for (to, n) in [nx, nu, np].into_iter().zip(s.sizes) {
                raw::write_optional(to, n as i64);
            }
            raw::write_optional(n_contacts, s.stepper.impulses().len() as i64);
            Ok(())
        })
    })
}

/// Time reached.
///
/// @return SWB_OK
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_get_time(stepper: *const swb_stepper, t: *mut f64) -> swb_status {
    guard(|| unsafe { handle::with_ref(stepper, |s| raw::write(t, s.stepper.time(), "t")) })
}

/// State reached.
///
/// @param[out] x [nx] coordinates, then velocities
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_get_state(stepper: *const swb_stepper, x: *mut f64, nx: i64) -> swb_status {
    guard(|| unsafe { handle::with_ref(stepper, |s| raw::write_slice(x, nx, s.stepper.state(), "x")) })
}

/// Impulses of the last step: impulses, not forces.
///
/// @param[out] impulses [n] 3 n_contacts: normal, then along the tangents there are, zero for others
/// @return SWB_OK; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_get_impulses(
    stepper: *const swb_stepper,
    impulses: *mut f64,
    n: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(stepper, |s| raw::write_slice(impulses, n, s.stepper.impulses().as_flattened(), "impulses"))
    })
}

/// Counts of the steps since the state was set, and how they went.
///
/// @param[out] stats
/// @param[in]  struct_size sizeof(swb_step_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION if the size is no size of such a struct
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_get_stats(
    stepper: *const swb_stepper,
    stats: *mut swb_step_stats,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(stepper, |s| {
            write_sized(&swb_step_stats::of(&s.stepper.statistics()), stats, struct_size, "stats")
        })
    })
}

/// End the call that runs, from another thread or a signal handler, after the step it is at; state and time are those of
/// that step, and the object can be used again.
///
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_STATE if this is no such object
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_interrupt(stepper: *const swb_stepper) -> swb_status {
    unsafe { handle::interrupt(stepper) }
}

/// Free; NULL is allowed.
#[no_mangle]
pub unsafe extern "C" fn swb_stepper_free(stepper: *mut swb_stepper) {
    unsafe { handle::free(stepper) }
}
