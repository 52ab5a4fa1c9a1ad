//! Threads whose beginning may be refused.
//!
//! A thread of `std` has a handle for which `std` asks the allocator of the system, past that of the library, and where
//! there is no room for those 48 bytes the process ends. The threads here ask for nothing that cannot be refused.

#![allow(unsafe_code)]

use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::ptr;

use super::room_for_thread;

/// Bytes of the stack of a thread, as many as `std` gives.
const STACK: usize = 2 << 20;

type Work<'a> = Box<dyn FnOnce() + Send + 'a>;

/// A thread that runs, or has ended; it is waited for when this is dropped.
#[derive(Debug)]
pub struct Thread {
    id: libc::pthread_t,
}

impl Thread {
    /// Begins `work` on a thread of its own, where a panic ends nothing else; none where there is no room for one.
    pub fn start(work: impl FnOnce() + Send + 'static) -> Option<Thread> {
        // SAFETY: what the work has borrowed lives as long as the program.
        unsafe { launch(Box::new(work)) }
    }
}

impl Drop for Thread {
    fn drop(&mut self) {
        // SAFETY: the thread was begun, and is waited for once.
        unsafe { libc::pthread_join(self.id, ptr::null_mut()) };
    }
}

/// Runs `other` on up to `n` further threads beside `own`, and waits for all of them, also where `own` panics.
pub fn beside(n: usize, other: &(dyn Fn() + Sync), own: impl FnOnce()) {
    // SAFETY: the threads are waited for before this returns or unwinds, while `other` is borrowed.
    let threads: Vec<Thread> = (0..n).map_while(|_| unsafe { launch(Box::new(other)) }).collect();
    own();
    drop(threads);
}

/// Begins a thread.
///
/// # Safety
/// The thread is waited for before what `work` has borrowed ends.
unsafe fn launch(work: Work<'_>) -> Option<Thread> {
    if !room_for_thread() {
        return None;
    }
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
            return Some(Thread { id: id.assume_init() });
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::Arc;

    use super::*;

    #[test]
    fn a_thread_is_waited_for() {
        let count = Arc::new(AtomicUsize::new(0));
        let shared = count.clone();
        let thread = Thread::start(move || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            shared.fetch_add(1, Ordering::Relaxed);
        });
        assert!(thread.is_some());
        drop(thread);
        assert_eq!(count.load(Ordering::Relaxed), 1);
        assert_eq!(Arc::strong_count(&count), 1);
    }

    #[test]
    fn a_panic_ends_its_thread_only() {
        drop(Thread::start(|| std::panic::resume_unwind(Box::new("on purpose"))));
        let count = AtomicUsize::new(0);
        let add = || {
            if count.fetch_add(1, Ordering::Relaxed) == 1 {
                std::panic::resume_unwind(Box::new("on purpose"));
            }
        };
        let own = catch_unwind(AssertUnwindSafe(|| beside(3, &add, || panic!("on purpose, of the caller"))));
        assert!(own.is_err());
        assert_eq!(count.load(Ordering::Relaxed), 3);
    }
}
