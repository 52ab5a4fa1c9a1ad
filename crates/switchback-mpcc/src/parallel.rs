//! Independent pieces of work on several threads, of which one is that of the caller.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::memory::thread;

/// Threads for a wish of `n`, 0 standing for all processors. One if a function may only be called by the thread that called
/// the library.
pub fn threads(n: usize, serial: bool) -> usize {
    match n {
        _ if serial => 1,
        0 => std::thread::available_parallelism().map_or(1, |n| n.get()),
        n => n,
    }
}

/// The results of the pieces `0..n` in their order, `None` for those of a thread that panicked. Every thread takes the next
/// piece that nobody has; `own` does those of the thread of the caller, `other` those of `threads - 1` others, of which fewer
/// come where there is no room for one more. What a piece gives does not depend on who did it, so that the number of
/// threads changes nothing but the time.
pub fn each<T: Send>(
    n: usize,
    threads: usize,
    own: &mut dyn FnMut(usize) -> T,
    other: &(dyn Fn(usize) -> T + Sync),
) -> Vec<Option<T>> {
    let next = AtomicUsize::new(0);
    let work = |one: &mut dyn FnMut(usize) -> T| -> Vec<(usize, T)> {
        let mut done = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            if k >= n {
                return done;
            }
            done.push((k, one(k)));
        }
    };
    let all = Mutex::new(Vec::new());
    let give = |mut done: Vec<(usize, T)>| all.lock().unwrap_or_else(PoisonError::into_inner).append(&mut done);
    thread::beside(threads.min(n).saturating_sub(1), &|| give(work(&mut |k| other(k))), || give(work(own)));
    let mut results: Vec<Option<T>> = (0..n).map(|_| None).collect();
    for (k, result) in all.into_inner().unwrap_or_else(PoisonError::into_inner) {
        results[k] = Some(result);
    }
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn serial_functions_have_one_thread() {
        assert_eq!((threads(0, true), threads(8, true), threads(8, false)), (1, 1, 8));
        assert!(threads(0, false) >= 1);
    }

    #[test]
    fn results_are_in_order_and_every_piece_is_done_once() {
        for threads in [0, 1, 3, 100] {
            let done = AtomicUsize::new(0);
            let square = |k: usize| {
                done.fetch_add(1, Ordering::Relaxed);
                k * k
            };
            let found = each(50, threads, &mut |k| square(k), &square);
            assert_eq!(found, (0..50).map(|k| Some(k * k)).collect::<Vec<_>>());
            assert_eq!(done.load(Ordering::Relaxed), 50);
        }
        assert!(each(0, 4, &mut |k| k, &|k| k).is_empty());
    }

    #[test]
    fn a_thread_that_panics_loses_its_own_results_only() {
        let caller = std::thread::current().id();
        let other = |k: usize| if std::thread::current().id() == caller { k } else { panic!("piece {k}") };
        // the caller waits until another thread has taken a piece, and lost it
        let taken = AtomicUsize::new(0);
        let lost = |k: usize| {
            taken.fetch_add(1, Ordering::Relaxed);
            other(k)
        };
        let clock = std::time::Instant::now();
        let mut own = |k: usize| {
            while taken.load(Ordering::Relaxed) == 0 && clock.elapsed().as_secs() < 60 {
                std::thread::yield_now();
            }
            other(k)
        };
        let found = each(8, 2, &mut own, &lost);
        assert_eq!(found.iter().filter(|r| r.is_none()).count(), 1);
        assert!(found.iter().enumerate().all(|(k, r)| r.is_none_or(|r| r == k)));
    }
}
