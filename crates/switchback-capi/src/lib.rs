//! The C ABI over everything: `include/switchback.h` is generated from this folder.
//!
//! No mathematics lives here. An export checks what comes in over the border, calls one safe function of
//! the library and hands the result out. What the border promises:
//!
//! - no panic, exit, print or signal handler crosses it; a failure is a [`status::swb_status`], its
//!   message waits in the thread ([`guard`]);
//! - on failure nothing is written to outputs, except NULL to `*out` of a constructor and the needed
//!   length of a text;
//! - NULL with length 0 is an empty array; inputs are copied;
//! - `const swb_x *` may be used by several threads at once, `swb_x *` by one; breaking this, or calling
//!   back into the same object from a callback, is `SWB_ERR_STATE`, not undefined behaviour ([`handle`]);
//! - freeing NULL does nothing.
//!
//! # How to write an export
//!
//! One file per object, listed below in the order of the header. An object is a marker type (opaque in
//! the header) with the Rust type behind it:
//!
//! ```text
//! /// Optimal control problem.
//! pub struct swb_ocp(());
//! impl Object for swb_ocp {
//!     type Value = switchback::ocp::Ocp;
//!     const NAME: &'static str = "swb_ocp";
//! }
//!
//! /// Create an optimal control problem of `system`.
//! ///
//! /// @param[in]  system   copied; may be freed afterwards
//! /// @param[in]  settings NULL for the defaults
//! /// @param[out] out      the new object, NULL on failure; free with swb_ocp_free
//! /// @return SWB_OK; SWB_ERR_RANGE if an option is outside its range
//! #[no_mangle]
//! pub unsafe extern "C" fn swb_ocp_create(
//!     system: *const swb_system,
//!     settings: *const Settings,
//!     out: *mut *mut swb_ocp,
//! ) -> swb_status {
//!     guard(|| unsafe {
//!         let settings = settings::read(settings)?;
//!         handle::create(out, |_interrupt| {
//!             handle::with_ref(system, |s| Ocp::new(s.clone(), settings))
//!         })
//!     })
//! }
//!
//! /// Set the bounds of the control.
//! ///
//! /// @param[in] lower [nu]
//! /// @param[in] upper [nu]
//! /// @return SWB_OK; SWB_ERR_DIMENSION if nu does not fit
//! /// @thread exclusive on `ocp`
//! #[no_mangle]
//! pub unsafe extern "C" fn swb_ocp_set_control_bounds(
//!     ocp: *mut swb_ocp, lower: *const f64, n_lower: i64, upper: *const f64, n_upper: i64,
//! ) -> swb_status {
//!     guard(|| unsafe {
//!         let lower = raw::slice(lower, n_lower, "lower")?;
//!         let upper = raw::slice(upper, n_upper, "upper")?;
//!         handle::with_mut(ocp, |o| o.set_control_bounds(lower, upper))
//!     })
//! }
//!
//! /// Free; NULL is allowed.
//! #[no_mangle]
//! pub unsafe extern "C" fn swb_ocp_free(ocp: *mut swb_ocp) {
//!     unsafe { handle::free(ocp) }
//! }
//! ```
//!
//! Rules the header generator cannot enforce:
//! - the whole body sits in [`guard::guard`] (or [`guard::query`] if it returns a value);
//! - read all inputs first, compute, then write all outputs: [`raw::write_slice`] checks the length and
//!   never makes a reference to the caller's memory;
//! - types: `f64`, `i64` for sizes, indices and enumerations inside structs, `i32` for flags and
//!   enumeration arguments, `*const c_char`; enums are returned, never taken (an undefined number would
//!   be undefined behaviour); no `bool`, no `usize`;
//! - structs that may grow start with `struct_size: u64` and contain 8-byte fields only;
//! - callbacks are `Option<unsafe extern "C" fn(..., *mut c_void)>`, return 0 ok, > 0 recoverable, < 0
//!   fatal, and may be called while the object is borrowed: keep no other lock;
//! - what user functions complain about is in [`switchback::func::trouble`]; a solve runs inside [`report::Hooks::run`], which turns it
//!   into the status of the call;
//! - write every exported item out: the generator does not expand macros;
//! - after a change: `make header`, and the new symbols into `capi_tests/abi/symbols.txt`.
#![allow(unsafe_code)]
#![allow(non_camel_case_types)]
#![allow(rustdoc::broken_intra_doc_links)]
// The contract of all pointers is the one above; it is not repeated in a section of every function.
#![allow(clippy::missing_safety_doc)]
#![warn(missing_docs)]
#![allow(clippy::needless_range_loop)]

/// As in the standard library, but `vec![value; n]` with a large `n` unwinds where memory cannot be had.
macro_rules! vec {
    ($value:expr; $n:expr) => { switchback::memory::filled($value, $n) };
    ($($tokens:tt)*) => { ::std::vec![$($tokens)*] };
}

mod fmi;
pub mod guard;
pub mod handle;
mod json;
mod mpcc_json;
pub mod raw;
mod slots;
mod threads;

#[cfg(test)]
mod docs;

// What follows is in the order of the header; blank lines keep the formatter from sorting it.
pub mod status;

pub mod version;

pub mod log;

pub mod settings;

pub mod report;

pub mod freezing;
pub mod function;

pub mod casadi;

pub mod system;

pub mod expr;

pub mod choice;

pub mod trajectory;

pub mod simulator;

pub mod run;

pub mod transition;

pub mod scene;
pub mod scene_transition;

pub mod model_transition;

pub mod integrator;

pub mod stepper;

pub mod batch;

pub mod mhe;
pub mod nmpc;
pub mod ocp;
pub mod ocp_accuracy;
pub mod ocp_multipliers;
pub mod ocp_optimality;
pub mod ocp_scene;
pub mod ocp_search;
pub mod ocp_terms;
pub mod ocp_transitions;

pub mod multiphase;

pub mod document;

pub mod mpcc;
pub mod mpcc_derivatives;

pub mod diagnosis;
