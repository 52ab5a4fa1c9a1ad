//! Threads of `std`, with the arithmetic of the thread that begins them.
//!
//! The handle of such a thread, some ten bytes, comes from the heap of the process and cannot be refused: [`room_for_thread`]
//! has asked for much more just before.
//!
//! Threads of POSIX round as the one that began them; those of Windows begin with other settings than programs of MinGW have, and
//! functions of its library, which compute with more digits than results have, end with other last bits there.
//!
//! [`room_for_thread`]: super::room_for_thread

use std::ffi::c_int;
use std::mem::transmute;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::thread::{Builder, JoinHandle};

use super::{Work, STACK};

// fenv.h of C
extern "C" {
    fn fegetenv(env: *mut Arithmetic) -> c_int;
    fn fesetenv(env: *const Arithmetic) -> c_int;
}

/// `fenv_t`: precision and rounding of a thread; 32 bytes on the largest of these systems.
#[repr(C, align(16))]
struct Arithmetic([u8; 64]);

/// A thread; it is waited for when this is dropped.
#[derive(Debug)]
pub struct Running {
    handle: Option<JoinHandle<()>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        // a panic stays with its thread
        let _ = self.handle.take().map(JoinHandle::join);
    }
}

/// Begins a thread; none where the system refuses.
///
/// # Safety
/// The thread is waited for before what `work` has borrowed ends.
pub unsafe fn launch(work: Work<'_>) -> Option<Running> {
    // SAFETY: the caller sees to it that what is borrowed outlives the thread.
    let work = unsafe { transmute::<Work<'_>, Work<'static>>(work) };
    let mut arithmetic = Arithmetic([0; 64]);
    // SAFETY: there is room for what is written.
    let known = unsafe { fegetenv(&mut arithmetic) } == 0;
    let body = move || {
        if known {
            // SAFETY: as written by `fegetenv`.
            unsafe { fesetenv(&arithmetic) };
        }
        // whoever waits sees that nothing came
        drop(catch_unwind(AssertUnwindSafe(work)));
    };
    Builder::new().stack_size(STACK).spawn(body).ok().map(|handle| Running { handle: Some(handle) })
}
