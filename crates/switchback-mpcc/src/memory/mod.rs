//! Running out of memory is an error, not the end of the process.
//!
//! Rust's collections abort the process when memory cannot be had. Four things keep that from happening:
//!
//! * sizes that nobody can mean are refused before anything is made of them ([`sizes`]);
//! * what a problem will take is estimated from its counts and asked for first ([`need`]);
//! * large arrays are asked for in a way that can fail: the crate's own `vec!`, [`room`], [`reserve`](fn@reserve). Where a function
//!   cannot return an error the failure unwinds to the call that entered the library, see [`catching`];
//! * small requests that fail are served from a reserve of a few MB ([`allocator`]), and the call ends with an error at its
//!   next safe point ([`check`]), where it would end for an interrupt as well.
//!
//! Everything here is kept per thread: a call is not blamed for what another one takes.

#[cfg(feature = "allocator")]
pub mod allocator;
#[cfg(feature = "allocator")]
mod reserve;
pub mod sizes;
pub mod thread;

use std::any::Any;
use std::cell::Cell;
use std::panic::{catch_unwind, resume_unwind, AssertUnwindSafe};

use crate::error::{Error, Result};

/// Arrays of at least so many bytes are asked for in a way that can fail; smaller ones are what the reserve is for.
const LARGE: usize = 1 << 16;

/// What is missing where the limit is passed.
const OVER: usize = usize::MAX;

/// What a thread knows of its memory.
struct Account {
    /// Bytes allocated less bytes freed; negative where other threads allocated what is freed here.
    held: Cell<isize>,
    /// Allocations so far.
    count: Cell<usize>,
    /// [`held`](Account::held) may rise up to this.
    limit: Cell<isize>,
    /// Size of the first request of the call that could not be met, 0 while all were, [`OVER`] where the limit is passed.
    missing: Cell<usize>,
    /// Calls into the library that are open.
    calls: Cell<usize>,
    /// The request that is being made may fail.
    fallible: Cell<bool>,
}

thread_local! {
    static ACCOUNT: Account = const {
        Account {
            held: Cell::new(0),
            count: Cell::new(0),
            limit: Cell::new(isize::MAX),
            missing: Cell::new(0),
            calls: Cell::new(0),
            fallible: Cell::new(false),
        }
    };
}

/// Bytes this thread has allocated and not freed. Always 0 without the feature `allocator`.
pub fn held() -> isize {
    ACCOUNT.try_with(|a| a.held.get()).unwrap_or(0)
}

/// Allocations of this thread so far. Always 0 without the feature `allocator`.
pub fn allocations() -> usize {
    ACCOUNT.try_with(|a| a.count.get()).unwrap_or(0)
}

/// Is the call that runs on this thread to end for lack of memory? Cheap enough for every safe point.
#[inline]
pub fn short() -> bool {
    ACCOUNT
        .try_with(|a| {
            if a.missing.get() == 0 && a.held.get() > a.limit.get() {
                // stays so when the way out frees some
                a.missing.set(OVER);
            }
            a.missing.get() != 0
        })
        .unwrap_or(false)
}

/// `Err` if the call that runs on this thread is to end for lack of memory.
#[inline]
pub fn check() -> Result<()> {
    if short() {
        return Err(error());
    }
    Ok(())
}

/// What [`check`] says where memory is short.
#[cold]
pub fn error() -> Error {
    let missing = ACCOUNT.try_with(|a| a.missing.get()).unwrap_or(0);
    if missing == OVER {
        return Error::Library(
            "the call takes more memory than the option max_memory allows: raise it, or make the problem smaller"
                .into(),
        );
    }
    missing_error(missing)
}

fn missing_error(bytes: usize) -> Error {
    Error::Library(format!(
        "out of memory: {bytes} bytes more could not be had. Free objects that are not needed, or make the problem \
         smaller, then call again; an object that was in use says so if it can only be freed"
    ))
}

/// Runs a call into the library: what an earlier one lacked is forgotten. `Err` while too little of the reserve is left to
/// begin anything. Inside of another call nothing but the body.
pub fn call<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    struct Leave;
    impl Drop for Leave {
        fn drop(&mut self) {
            let _ = ACCOUNT.try_with(|a| a.calls.set(a.calls.get() - 1));
        }
    }
    let calls = ACCOUNT.try_with(|a| a.calls.replace(a.calls.get() + 1)).unwrap_or(0);
    let _leave = Leave;
    if calls == 0 {
        let _ = ACCOUNT.try_with(|a| a.missing.set(0));
        #[cfg(feature = "allocator")]
        if reserve::used() > reserve::SIZE / 2 {
            return Err(missing_error(LARGE));
        }
    }
    body()
}

/// Runs `body`, which may add up to `max` bytes to what the thread holds; 0 means no limit. Within another such call the
/// lower limit holds.
pub fn limited<R>(max: i64, body: impl FnOnce() -> R) -> R {
    struct Restore(isize);
    impl Drop for Restore {
        fn drop(&mut self) {
            let _ = ACCOUNT.try_with(|a| a.limit.set(self.0));
        }
    }
    let outer = ACCOUNT.try_with(|a| a.limit.get()).unwrap_or(isize::MAX);
    let _restore = Restore(outer);
    if max > 0 {
        let limit = held().saturating_add(isize::try_from(max).unwrap_or(isize::MAX)).min(outer);
        let _ = ACCOUNT.try_with(|a| a.limit.set(limit));
    }
    body()
}

/// `Err` unless about `bytes` more can be had and are allowed; `what` they are for, in the words of the user.
pub fn need(bytes: u128, what: impl FnOnce() -> String) -> Result<()> {
    let left = ACCOUNT.try_with(|a| a.limit.get().saturating_sub(a.held.get())).unwrap_or(isize::MAX);
    let mb = |b: f64| format!("{:.1} MB", b / 1e6);
    if left != isize::MAX && bytes > left.max(0) as u128 && limit_set() {
        return Err(Error::Library(format!(
            "{} takes about {}, and the option max_memory leaves {}: raise it, or make the problem smaller",
            what(),
            mb(bytes as f64),
            mb(left.max(0) as f64)
        )));
    }
    if bytes < LARGE as u128 {
        return Ok(());
    }
    // asked for and given back at once: nothing is written to it, so it costs address space for a moment
    let mut probe = Vec::<u8>::new();
    let got = usize::try_from(bytes).is_ok_and(|n| try_reserve(&mut probe, n));
    if !got {
        return Err(Error::Library(format!(
            "out of memory: {} takes about {}, which cannot be had. Free objects that are not needed, or make the problem \
             smaller",
            what(),
            mb(bytes as f64)
        )));
    }
    Ok(())
}

/// Is there room for another thread? What the system takes for one, its thread-local data among it, cannot be refused: where
/// that fails the process ends.
pub fn room_for_thread() -> bool {
    // a stack of 2 MB, and as much again several times for what the thread begins with
    need(16 << 20, String::new).is_ok()
}

fn limit_set() -> bool {
    ACCOUNT.try_with(|a| a.limit.get() != isize::MAX).unwrap_or(false)
}

/// Makes room for `more` values, or says that there is none.
pub fn reserve<T>(v: &mut Vec<T>, more: usize) -> Result<()> {
    if v.capacity() - v.len() >= more {
        return Ok(());
    }
    if enlarge(v, more) {
        return check();
    }
    Err(missing_error(more.saturating_mul(size_of::<T>())))
}

/// Makes room for `more` values before they are pushed; unwinds to [`catching`] if there is none.
#[inline]
pub fn room<T>(v: &mut Vec<T>, more: usize) {
    if v.capacity() - v.len() < more {
        grow(v, more);
    }
}

#[cold]
fn grow<T>(v: &mut Vec<T>, more: usize) {
    if !enlarge(v, more) {
        fail(more.saturating_mul(size_of::<T>()));
    }
}

/// An empty vector with room for `n` values; unwinds to [`catching`] if there is none.
pub fn with_capacity<T>(n: usize) -> Vec<T> {
    let mut v = Vec::new();
    if !try_reserve(&mut v, n) {
        fail(n.saturating_mul(size_of::<T>()));
    }
    v
}

/// The values of an iterator that knows its length; unwinds to [`catching`] if there is no room for them.
pub fn collect<T>(values: impl ExactSizeIterator<Item = T>) -> Vec<T> {
    let mut v = with_capacity(values.len());
    v.extend(values);
    v
}

/// `vec![value; n]`: large ones unwind to [`catching`] instead of aborting the process.
pub fn filled<T: Clone>(value: T, n: usize) -> Vec<T> {
    if n.saturating_mul(size_of::<T>()) < LARGE {
        return std::vec![value; n];
    }
    let mut v = with_capacity(n);
    v.resize(n, value);
    v
}

/// Makes room for `more` values, and for many more where there is memory: twice as many as before, as a vector would itself,
/// else a few in proportion, so that filling up what is left does not ask for every value again.
fn enlarge<T>(v: &mut Vec<T>, more: usize) -> bool {
    let n = v.len();
    [n.max(4), n / 8, 1024].iter().any(|&spare| try_reserve(v, more.max(spare))) || try_reserve(v, more)
}

/// Like [`Vec::try_reserve_exact`], without touching the reserve.
fn try_reserve<T>(v: &mut Vec<T>, more: usize) -> bool {
    let fallible = |on| ACCOUNT.try_with(|a| a.fallible.replace(on)).unwrap_or(false);
    let before = fallible(true);
    let ok = v.try_reserve_exact(more).is_ok();
    fallible(before);
    ok
}

/// Payload of an unwinding call that has no memory: without size, so that nothing has to be allocated for it.
struct OutOfMemory;

/// Ends the call that runs with this error although the function at work cannot return one: unwinds to [`catching`]. For
/// sizes and memory only.
#[cold]
pub fn unwind(e: Error) -> ! {
    resume_unwind(Box::new(e))
}

#[cold]
fn fail(bytes: usize) -> ! {
    let _ = ACCOUNT.try_with(|a| a.missing.set(bytes.clamp(1, OVER - 1)));
    resume_unwind(Box::new(OutOfMemory))
}

/// The error behind a caught panic if it was for lack of memory, else the payload again.
pub fn from_panic(payload: Box<dyn Any + Send>) -> std::result::Result<Error, Box<dyn Any + Send>> {
    if payload.is::<OutOfMemory>() {
        return Ok(error());
    }
    payload.downcast().map(|e| *e)
}

/// Runs `body`; what unwinds out of it for lack of memory becomes an error. Other panics go on. Whoever calls this sees to it
/// that what `body` was working on is whole or gone.
pub fn catching<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    catch_unwind(AssertUnwindSafe(body))
        .unwrap_or_else(|payload| Err(from_panic(payload).unwrap_or_else(|other| resume_unwind(other))))
}

/// Runs `body` within a limit as [`limited`] does and catches as [`catching`] does; `Err` too where memory was short at any
/// time.
pub fn bounded<R>(max: i64, body: impl FnOnce() -> Result<R>) -> Result<R> {
    call(|| {
        limited(max, || {
            let found = catching(body)?;
            check()?;
            Ok(found)
        })
    })
}

/// As in the standard library, but `vec![value; n]` with a large `n` unwinds where memory cannot be had.
macro_rules! vec {
    ($value:expr; $n:expr) => { $crate::memory::filled($value, $n) };
    ($($tokens:tt)*) => { ::std::vec![$($tokens)*] };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_had_is_an_error() {
        let r = call(|| {
            let e = catching(|| Ok(filled(0u8, usize::MAX))).unwrap_err();
            assert!(e.code() == -50 && e.to_string().contains("out of memory"), "{e}");
            // inside of the call it stays so
            call(check)
        });
        assert!(r.is_err() && short());
        call(check).unwrap();
        let e = catching(|| Ok(with_capacity::<f64>(1 << 60))).unwrap_err();
        assert_eq!(e.code(), -50);
        call(check).unwrap();
        assert_eq!(reserve(&mut Vec::<u64>::new(), usize::MAX / 8).unwrap_err().code(), -50);
        let mut v = vec![1u8; 3];
        assert_eq!(
            catching(|| {
                room(&mut v, usize::MAX / 2);
                Ok(())
            })
            .unwrap_err()
            .code(),
            -50
        );
        assert_eq!(v, [1; 3]);
        call(check).unwrap();
    }

    #[test]
    fn other_panics_go_on() {
        let r = catch_unwind(|| catching(|| -> Result<()> { resume_unwind(Box::new(7)) }));
        assert_eq!(r.unwrap_err().downcast_ref(), Some(&7));
    }

    #[test]
    fn estimates_are_asked_for_first() {
        need(1 << 20, || unreachable!("there is a megabyte")).unwrap();
        let e = need(1 << 100, || "a problem with 3 stages".into()).unwrap_err();
        assert!(e.code() == -50 && e.to_string().contains("a problem with 3 stages"), "{e}");
    }

    #[test]
    fn the_limit_holds_inside_only() {
        limited(1 << 20, || {
            need(1 << 19, || unreachable!("within the limit")).unwrap();
            let e = need(1 << 21, || "it".into()).unwrap_err();
            assert!(e.to_string().contains("max_memory"), "{e}");
            limited(1 << 30, || assert!(need(1 << 21, || "it".into()).is_err()));
            limited(1 << 10, || assert!(need(1 << 11, || "it".into()).is_err()));
            check().unwrap();
            #[cfg(feature = "allocator")]
            {
                let large = vec![0u8; 2 << 20];
                assert!(check().unwrap_err().to_string().contains("max_memory"));
                drop(large);
                assert!(check().unwrap_err().to_string().contains("max_memory"));
                call(check).unwrap();
            }
        });
        need(1 << 21, || unreachable!("no limit any more")).unwrap();
    }

    #[test]
    #[cfg(feature = "allocator")]
    fn the_account_follows_allocations() {
        let (before, count) = (held(), allocations());
        let v = vec![0u8; 12345];
        assert_eq!((held() - before, allocations() - count), (12345, 1));
        drop(v);
        assert_eq!(held(), before);
    }

    #[test]
    fn ordinary_vectors() {
        let empty: Vec<f64> = vec![];
        assert!(empty.is_empty());
        let large = vec![0.5; LARGE];
        assert!(large.len() == LARGE && large.iter().all(|v| *v == 0.5));
        assert_eq!(collect(0..5), [0, 1, 2, 3, 4]);
    }
}
