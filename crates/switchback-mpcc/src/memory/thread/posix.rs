//! Threads of POSIX.
//!
//! A thread of `std` has a handle for which `std` asks the allocator of the system, past that of the library, and where
//! there is no room for those 48 bytes the process ends. The threads here ask for nothing that cannot be refused.

use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::ptr;

use super::{Work, STACK};

/// A thread; it is waited for when this is dropped.
#[derive(Debug)]
pub struct Running {
    id: libc::pthread_t,
}

// SAFETY: any thread may wait for another one, and this does nothing else. The identifier is a pointer on some systems.
unsafe impl Send for Running {}
unsafe impl Sync for Running {}

impl Drop for Running {
    fn drop(&mut self) {
        // SAFETY: the thread was begun, and is waited for once.
        unsafe { libc::pthread_join(self.id, ptr::null_mut()) };
    }
}

/// Begins a thread; none where the system refuses.
///
/// # Safety
/// The thread is waited for before what `work` has borrowed ends.
pub unsafe fn launch(work: Work<'_>) -> Option<Running> {
    let task = Box::into_raw(Box::new(work));
    let mut id = MaybeUninit::<libc::pthread_t>::uninit();
    let mut attributes = MaybeUninit::<libc::pthread_attr_t>::uninit();
    // SAFETY: the attributes are initialised before they are used, and destroyed once; `task` belongs to the thread where that begins.
    unsafe {
        let mut begun = libc::pthread_attr_init(attributes.as_mut_ptr()) == 0;
        if begun {
            // refused where the system wants more: then the thread has the stack that is usual there
            libc::pthread_attr_setstacksize(attributes.as_mut_ptr(), STACK);
            begun = libc::pthread_create(id.as_mut_ptr(), attributes.as_ptr(), run, task.cast()) == 0;
            libc::pthread_attr_destroy(attributes.as_mut_ptr());
        }
        if begun {
            return Some(Running { id: id.assume_init() });
        }
        drop(Box::from_raw(task));
    }
    None
}

extern "C" fn run(task: *mut c_void) -> *mut c_void {
    // SAFETY: `launch` has made the box, and nobody else has it.
    let work = unsafe { Box::from_raw(task.cast::<Work<'_>>()) };
    // whoever waits sees that nothing came
    let _ = catch_unwind(AssertUnwindSafe(work));
    ptr::null_mut()
}
