//! Time-freezing of scenes: models in numerical time.

use super::expr::{ids, swb_expr, swb_model};
use super::guard::guard;
use super::handle;
use super::raw;
use super::report::{write_sized, Sized8};
use super::scene::swb_scene;
use super::status::swb_status;
use std::ffi::c_char;
use std::ptr;
use switchback::error::{Error, Result};
use switchback::freezing::{freeze_in, Layout, Options};

/// How a scene is made a piecewise smooth system in numerical time; swb_freeze_options_init sets the defaults.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_freeze_options {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Numerical time that a jump should take: the length of a step or of a finite element.
    pub step: f64,
    /// Rate at which gaps usually close.
    pub speed: f64,
    /// Strength a_n of the push of contacts without restitution; 0 for the recommended one.
    pub a_n: f64,
    /// Stiffness of contacts with restitution; 0 for the recommended one.
    pub stiffness: f64,
    /// Sliding speed below which a contact in space creeps; 0 for a thousandth of speed.
    pub creep: f64,
    /// 1: a control behind the others multiplies all rates, the speed of time.
    pub speed_of_time: i64,
}
unsafe impl Sized8 for swb_freeze_options {}

impl Default for swb_freeze_options {
    fn default() -> swb_freeze_options {
        let o = Options::default();
        swb_freeze_options {
            struct_size: size_of::<swb_freeze_options>() as u64,
            step: o.step,
            speed: o.speed,
            a_n: o.a_n,
            stiffness: o.stiffness,
            creep: o.creep,
            speed_of_time: o.speed_of_time.into(),
        }
    }
}

impl swb_freeze_options {
    /// Those of the caller, whose struct may be shorter or longer.
    unsafe fn read(from: *const swb_freeze_options) -> Result<Options> {
        let mut copy = swb_freeze_options::default();
        if !from.is_null() {
            raw::check(from, "options")?;
            let (size, ours) = (unsafe { from.cast::<u64>().read() }, copy.struct_size);
            if !(8..=1 << 16).contains(&size) || size % 8 != 0 {
                return Err(Error::State(format!(
                    "options has struct_size {size}: call swb_freeze_options_init first"
                )));
            }
            let to = (&mut copy as *mut swb_freeze_options).cast::<u8>();
            unsafe { ptr::copy_nonoverlapping(from.cast::<u8>(), to, size.min(ours) as usize) };
        }
        let speed_of_time = match copy.speed_of_time {
            0 | 1 => copy.speed_of_time == 1,
            v => return Err(Error::Range(format!("speed_of_time is {v}: it is 0 or 1"))),
        };
        let swb_freeze_options { step, speed, a_n, stiffness, creep, .. } = copy;
        Ok(Options { step, speed, a_n, stiffness, creep, speed_of_time, ..Options::default() })
    }
}

/// Places of states and controls in a model in numerical time: the states of the scene come first and keep their numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct swb_freeze_layout {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// First state that is the depth of a contact with restitution.
    pub first_depth: i64,
    /// Number of those states.
    pub n_depths: i64,
    /// The state that is the physical time.
    pub clock: i64,
    /// First state that is the integral of a cost over physical time.
    pub first_cost: i64,
    /// Number of those states.
    pub n_costs: i64,
    /// The control that is the speed of time, or -1.
    pub speed: i64,
}
unsafe impl Sized8 for swb_freeze_layout {}

impl swb_freeze_layout {
    fn of(l: &Layout) -> swb_freeze_layout {
        swb_freeze_layout {
            struct_size: 0,
            first_depth: l.depths.0 as i64,
            n_depths: (l.depths.1 - l.depths.0) as i64,
            clock: l.clock as i64,
            first_cost: l.costs.0 as i64,
            n_costs: (l.costs.1 - l.costs.0) as i64,
            speed: l.speed.map_or(-1, |k| k as i64),
        }
    }
}

/// Set options of time-freezing to their defaults.
///
/// @param[out] options     written
/// @param[in]  struct_size sizeof(swb_freeze_options)
/// @return SWB_OK; SWB_ERR_NULL; SWB_ERR_DIMENSION for a size that cannot be
#[no_mangle]
pub unsafe extern "C" fn swb_freeze_options_init(options: *mut swb_freeze_options, struct_size: u64) -> swb_status {
    guard(|| unsafe { write_sized(&swb_freeze_options::default(), options, struct_size, "options") })
}

/// Make a scene a piecewise smooth model in numerical time: its states get a clock, which stands still while auxiliary dynamics
/// take the velocities from one side of an impact to the other. Where the clock runs the states are those of the scene.
///
/// @param[in]  graph   the graph of all expressions of the scene; it grows
/// @param[in]  options NULL for the defaults
/// @param[in]  at      [n_at] state of the scene where a_n and stiffness are recommended; n_at = 0 for zeros
/// @param[in]  costs   [n_costs] expressions whose integrals over physical time become states
/// @param[out] layout  where things are; may be NULL
/// @param[in]  layout_size sizeof(swb_freeze_layout); any number if layout is NULL
/// @param[out] out     the new object, NULL on failure; free with swb_model_free
/// @return SWB_OK; SWB_ERR_STATE if forces are missing or the graph is another one; SWB_ERR_RANGE for options that are not
///         positive; SWB_ERR_UNSUPPORTED for restitution that is no number, and friction beside restitution; SWB_ERR_DIMENSION
#[no_mangle]
pub unsafe extern "C" fn swb_scene_freeze(
    scene: *mut swb_scene,
    graph: *mut swb_expr,
    options: *const swb_freeze_options,
    at: *const f64,
    n_at: i64,
    costs: *const i64,
    n_costs: i64,
    layout: *mut swb_freeze_layout,
    layout_size: u64,
    out: *mut *mut swb_model,
) -> swb_status {
    guard(|| unsafe {
        handle::create(out, |_| {
            handle::require(scene)?;
            let mut options = swb_freeze_options::read(options)?;
            options.at = raw::slice(at, n_at, "at")?.to_vec();
            handle::with_mut(scene, |s| {
                s.check_graph(graph)?;
                let made = handle::with_mut(graph, |dag| {
                    options.costs = ids(dag, costs, n_costs, "costs")?;
                    freeze_in(s.scene(), dag, &options)
                })?;
                if !layout.is_null() {
                    write_sized(&swb_freeze_layout::of(&made.layout), layout, layout_size, "layout")?;
                }
                s.set_frozen(made.report.to_string());
                Ok(made.model)
            })
        })
    })
}

/// Report on the contacts in the last call of swb_scene_freeze: strengths, the recommended ones, warnings.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before swb_scene_freeze
#[no_mangle]
pub unsafe extern "C" fn swb_scene_freeze_report(
    scene: *const swb_scene,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        let text = handle::with_ref(scene, |s| {
            let text = s.frozen().map(str::to_owned);
            text.ok_or_else(|| Error::State("the scene was not frozen: call swb_scene_freeze first".into()))
        })?;
        raw::write_text(text.as_bytes(), buf, len, needed)
    })
}
