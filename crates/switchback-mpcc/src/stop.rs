//! Ending a call early: a flag that another thread may raise, and a latest end.
//!
//! A [`Stop`] is given to the call that is to end ([`crate::nlp::Control::stop`]), which makes it the stop of its thread for
//! as long as it runs ([`Stop::scope`]). Whatever it calls asks [`check`] or [`requested`], at any depth and without a
//! parameter that leads there: before every evaluation of a model function, every factorisation, every step of a
//! simulation. Once the answer was yes it stays so until the scope ends, so that a loop that takes a failed evaluation for
//! a point without values finds out at its next one.
//!
//! The clock is read at every [`EVERY`]th question only, so a question costs a few nanoseconds. A call therefore ends at
//! most [`EVERY`] model evaluations or one factorisation after its time is over; after an interrupt, one of either.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::memory;

/// Questions for one look at the clock.
pub const EVERY: u32 = 16;

/// Why a call is to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// The flag was raised, or a monitor asked for it.
    Interrupted,
    /// The latest end has passed.
    OutOfTime,
    /// Memory could not be had, or is more than allowed ([`crate::memory`]).
    OutOfMemory,
}

impl Why {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Why::Interrupted => "interrupted",
            Why::OutOfTime => "max_time was over",
            Why::OutOfMemory => "out of memory",
        }
    }

    /// The error of a call that ends without a result.
    pub fn error(self) -> Error {
        match self {
            Why::Interrupted => Error::Interrupted,
            Why::OutOfTime => Error::OutOfTime,
            Why::OutOfMemory => memory::error(),
        }
    }
}

/// Means to end a call from outside; by default none.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    flag: Option<Arc<AtomicBool>>,
    deadline: Option<Instant>,
}

impl Stop {
    /// Ends when `flag` is raised. Whoever owns the flag lowers it.
    pub fn on(flag: &Arc<AtomicBool>) -> Stop {
        Stop { flag: Some(flag.clone()), deadline: None }
    }

    /// Sets the latest end `seconds` from now, unless there is one or the number is not finite.
    pub fn limit(&mut self, seconds: f64) {
        if seconds.is_finite() && self.deadline.is_none() {
            // none where that is beyond all clocks
            self.deadline = Duration::try_from_secs_f64(seconds).ok().and_then(|d| Instant::now().checked_add(d));
        }
    }

    /// This stop with the latest end after this share of the time that is left.
    pub fn sooner(&self, share: f64) -> Stop {
        let now = Instant::now();
        let deadline = self.deadline.map(|d| now + d.saturating_duration_since(now).mul_f64(share));
        Stop { flag: self.flag.clone(), deadline }
    }

    /// This stop with a flag, a new one where there is none: for work that several threads share.
    pub fn with_flag(mut self) -> Stop {
        self.flag.get_or_insert_default();
        self
    }

    /// Raises the flag.
    pub fn raise_flag(&self) {
        if let Some(f) = &self.flag {
            f.store(true, Ordering::Relaxed);
        }
    }

    /// Reason for the call to end, if there is one. Reads the clock.
    pub fn why(&self) -> Option<Why> {
        if self.flag.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) {
            return Some(Why::Interrupted);
        }
        self.deadline.is_some_and(|d| Instant::now() >= d).then_some(Why::OutOfTime)
    }

    /// Runs `body` with this as the stop of the thread. Inside of another scope an empty stop changes nothing.
    pub fn scope<R>(&self, body: impl FnOnce() -> R) -> R {
        let nested = WATCH.with_borrow(|w| w.armed && (self.is_empty() || w.stop.is_same(self)));
        if nested {
            return body();
        }
        let watch = Watch { stop: self.clone(), armed: true, skip: 0, over: None };
        let _restore = Restore(Some(WATCH.replace(watch)));
        body()
    }

    /// Runs `body` with this as the stop of the thread, and as if nothing had ended yet: what [`raise`] ends in there ends nothing
    /// outside.
    pub fn scope_apart<R>(&self, body: impl FnOnce() -> R) -> R {
        let watch = Watch { stop: self.clone(), armed: true, skip: 0, over: None };
        let _restore = Restore(Some(WATCH.replace(watch)));
        let r = body();
        // a flag that is up will be seen again outside
        WATCH.with_borrow_mut(|w| w.over = None);
        r
    }

    fn is_empty(&self) -> bool {
        self.flag.is_none() && self.deadline.is_none()
    }

    fn has_flag_of(&self, other: &Stop) -> bool {
        match (&self.flag, &other.flag) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        }
    }

    fn is_same(&self, other: &Stop) -> bool {
        self.deadline == other.deadline && self.has_flag_of(other)
    }
}

/// The stop of a thread.
struct Watch {
    stop: Stop,
    armed: bool,
    /// Questions until the next look at the clock.
    skip: u32,
    over: Option<Why>,
}

thread_local! {
    static WATCH: RefCell<Watch> = const {
        RefCell::new(Watch { stop: Stop { flag: None, deadline: None }, armed: false, skip: 0, over: None })
    };
}

/// Puts the stop of the surrounding scope back, also after a panic.
struct Restore(Option<Watch>);

impl Drop for Restore {
    fn drop(&mut self) {
        let Some(outer) = self.0.take() else { return };
        WATCH.with_borrow_mut(|w| {
            let inner = std::mem::replace(w, outer);
            // a monitor that asked to stop is not asked again
            let asked = inner.over == Some(Why::Interrupted) && inner.stop.has_flag_of(&w.stop);
            if w.armed && asked && w.over.is_none() {
                w.over = inner.over;
            }
        });
    }
}

/// Reason for the call that runs on this thread to end, if there is one. Cheap enough for every evaluation of a model function.
#[inline]
pub fn requested() -> Option<Why> {
    if memory::short() {
        return Some(Why::OutOfMemory);
    }
    WATCH.with_borrow_mut(|w| {
        if !w.armed || w.over.is_some() {
            return w.over;
        }
        if w.stop.flag.as_ref().is_some_and(|f| f.load(Ordering::Relaxed)) {
            w.over = Some(Why::Interrupted);
        } else if w.stop.deadline.is_some() {
            if w.skip == 0 {
                w.skip = EVERY;
                w.over = w.stop.why();
            }
            w.skip -= 1;
        }
        w.over
    })
}

/// `Err` if the call that runs on this thread is to end.
#[inline]
pub fn check() -> Result<()> {
    requested().map_or(Ok(()), |why| Err(why.error()))
}

/// Variables from which a problem takes long enough to build to ask in between.
const LARGE: usize = 10_000;

/// Checks like [`check`], between the parts of building a problem in `n` variables. A small one is built in no time: a call whose time
/// is over then has an outcome, and its starting point as the result.
pub fn check_building(n: usize) -> Result<()> {
    if n > LARGE {
        check()
    } else {
        Ok(())
    }
}

/// Error of [`check`] after an evaluation that was not done because the call is to end.
pub fn error() -> Error {
    requested().map_or(Error::Interrupted, Why::error)
}

/// Ends the call that runs on this thread, as its interrupt would.
pub fn raise() {
    WATCH.with_borrow_mut(|w| {
        if w.armed && w.over.is_none() {
            w.over = Some(Why::Interrupted);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_stops_what_has_no_stop() {
        assert_eq!((requested(), check()), (None, Ok(())));
        raise();
        assert_eq!(requested(), None);
        Stop::default().scope(|| assert_eq!(requested(), None));
    }

    #[test]
    fn the_flag_ends_the_call_and_the_scope_forgets_it() {
        let flag = Arc::new(AtomicBool::new(false));
        let stop = Stop::on(&flag);
        stop.scope(|| {
            assert_eq!(requested(), None);
            flag.store(true, Ordering::Relaxed);
            assert_eq!(check(), Err(Error::Interrupted));
            // once asked for it stays
            flag.store(false, Ordering::Relaxed);
            assert_eq!(requested(), Some(Why::Interrupted));
        });
        stop.scope(|| assert_eq!(requested(), None));
    }

    #[test]
    fn the_deadline_is_seen_within_so_many_questions() {
        let mut stop = Stop::default();
        stop.limit(f64::INFINITY);
        assert_eq!(stop.why(), None);
        stop.limit(1e300);
        assert_eq!(stop.why(), None);
        stop.limit(0.0);
        stop.limit(1e3); // the first one holds
        assert_eq!(stop.why(), Some(Why::OutOfTime));
        stop.scope(|| {
            let asked = (0..=EVERY).position(|_| requested().is_some());
            assert!(asked.is_some(), "the deadline was not seen");
            assert_eq!(check(), Err(Error::OutOfTime));
            assert_eq!((check_building(LARGE), check_building(LARGE + 1)), (Ok(()), Err(Error::OutOfTime)));
        });
    }

    #[test]
    fn scopes_nest_and_panics_leave_them() {
        let (a, b) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(true)));
        let (a, b) = (Stop::on(&a), Stop::on(&b));
        a.scope(|| {
            b.scope(|| assert_eq!(requested(), Some(Why::Interrupted)));
            assert_eq!(requested(), None);
            let r = std::panic::catch_unwind(|| b.scope(|| panic!("in the scope")));
            assert!(r.is_err() && requested().is_none());
            // what has no stop of its own keeps that of its surroundings
            Stop::default().scope(raise);
            assert_eq!(requested(), Some(Why::Interrupted));
        });
        assert_eq!(requested(), None);
    }

    #[test]
    fn what_a_monitor_asks_for_inside_holds_outside() {
        let flag = Arc::new(AtomicBool::new(false));
        let outer = Stop::on(&flag);
        let mut inner = outer.clone();
        inner.limit(1e3);
        outer.scope(|| {
            inner.scope(raise);
            assert_eq!(requested(), Some(Why::Interrupted));
        });
    }
}
