//! Threads whose beginning may be refused.
//!
//! Each system has its own way to begin one, behind the same interface: `launch`, and a `Running` that is waited for when it is
//! dropped. Where there are no threads, none begins, and the callers do the work themselves.

#![allow(unsafe_code)]

#[cfg(unix)]
mod posix;
#[cfg(unix)]
use posix as system;
#[cfg(windows)]
mod windows;
#[cfg(windows)]
use windows as system;
#[cfg(not(any(unix, windows)))]
mod absent;
#[cfg(not(any(unix, windows)))]
use absent as system;

use super::room_for_thread;

/// Bytes of the stack of a thread, as many as `std` gives.
#[cfg(any(unix, windows))]
const STACK: usize = 2 << 20;

type Work<'a> = Box<dyn FnOnce() + Send + 'a>;

/// A thread that runs, or has ended; it is waited for when this is dropped.
#[derive(Debug)]
pub struct Thread {
    _running: system::Running,
}

impl Thread {
    /// Begins `work` on a thread of its own, where a panic ends nothing else; none where there is no room for one, or where
    /// the system has no threads.
    pub fn start(work: impl FnOnce() + Send + 'static) -> Option<Thread> {
        // SAFETY: what the work has borrowed lives as long as the program.
        unsafe { launch(Box::new(work)) }
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
    // SAFETY: the caller sees to it.
    unsafe { system::launch(work) }.map(|running| Thread { _running: running })
}

#[cfg(all(test, any(unix, windows)))]
mod tests {
    use std::panic::{catch_unwind, AssertUnwindSafe};
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
