//! Threads of `std`.
//!
//! The handle of such a thread, some ten bytes, comes from the heap of the process and cannot be refused: [`room_for_thread`]
//! has asked for much more just before.
//!
//! [`room_for_thread`]: super::room_for_thread

use std::mem::transmute;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::thread::{Builder, JoinHandle};

use super::{Work, STACK};

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
    // whoever waits sees that nothing came
    let body = || drop(catch_unwind(AssertUnwindSafe(work)));
    Builder::new().stack_size(STACK).spawn(body).ok().map(|handle| Running { handle: Some(handle) })
}
