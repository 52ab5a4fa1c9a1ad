//! The border itself: no panic leaves, every failure becomes a status and a message of the thread. A lack of memory too, see
//! [`switchback::memory`].

use super::raw;
use super::status::swb_status;
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ffi::{c_char, CStr, CString};
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::Once;
use switchback::error::{Error, Result};
use switchback::memory;

struct LastError {
    message: CString,
    user_code: i32,
}

thread_local! {
    /// Guards open on this thread; panics below one are reported by status, not on stderr.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    /// Where the last panic below a guard happened.
    static PLACE: RefCell<Option<String>> = const { RefCell::new(None) };
    /// A message that a signal handler may leave, newer than that of `LAST`.
    static CONSTANT: Cell<Option<&'static CStr>> = const { Cell::new(None) };
    static LAST: RefCell<LastError> = RefCell::new(LastError { message: CString::default(), user_code: 0 });
}

/// Run the body of an export: the status of its result, with panics caught and the error remembered.
pub fn guard(body: impl FnOnce() -> Result<()>) -> swb_status {
    // what was done without memory is not to be relied on, even if it ended well
    let body = || body().and_then(|()| memory::check());
    match caught(|| memory::call(body)) {
        Ok(()) => swb_status::SWB_OK,
        Err(e) => {
            remember(&e);
            swb_status::from(&e)
        }
    }
}

/// Run the body of an export that returns a value instead of a status; `fallback` after a panic.
pub fn query<R>(fallback: R, body: impl FnOnce() -> R) -> R {
    caught(|| Ok(body())).unwrap_or_else(|e| {
        remember(&e);
        fallback
    })
}

/// Run `body`; a panic becomes [`Error::Internal`] with its place.
pub fn caught<R>(body: impl FnOnce() -> Result<R>) -> Result<R> {
    silence();
    // glibc ends the process where it has no memory to note that these are to be dropped: not when there is an error to keep
    let _ = LAST.try_with(|_| ());
    let _ = PLACE.try_with(|_| ());
    DEPTH.with(|d| d.set(d.get() + 1));
    let result = catch_unwind(AssertUnwindSafe(body));
    DEPTH.with(|d| d.set(d.get() - 1));
    result.unwrap_or_else(|payload| {
        let place = PLACE.with(|p| p.take()).unwrap_or_default();
        let payload = match memory::from_panic(payload) {
            Ok(e) => return Err(e),
            Err(other) => other,
        };
        let message = format!("{} ({place})", panic_text(&*payload));
        // A payload may panic in its own destructor.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(payload)));
        Err(Error::Internal(message))
    })
}

/// Longest message, in bytes: texts of the caller may be part of it, however long they are.
const LONGEST: usize = 4000;

/// Make `e` the last error of this thread.
pub fn remember(e: &Error) {
    let mut text = e.to_string();
    if text.len() > LONGEST {
        let end = (0..=LONGEST).rev().find(|&k| text.is_char_boundary(k)).unwrap_or(0);
        text.truncate(end);
        text.push_str(" ...");
    }
    let message = raw::c_string(&text);
    let user_code = if let Error::User { code, .. } = e { *code } else { 0 };
    let _ = LAST.try_with(|last| *last.borrow_mut() = LastError { message, user_code });
    let _ = CONSTANT.try_with(|c| c.set(None));
}

/// Make a constant text the last error of this thread: nothing is allocated or freed, so a signal handler may do it.
pub fn remember_constant(text: &'static CStr) {
    let _ = CONSTANT.try_with(|c| c.set(Some(text)));
}

fn constant() -> Option<&'static CStr> {
    CONSTANT.try_with(Cell::get).ok().flatten()
}

fn panic_text(payload: &(dyn Any + Send)) -> &str {
    match payload.downcast_ref::<&str>() {
        Some(s) => s,
        None => payload.downcast_ref::<String>().map_or("panic", String::as_str),
    }
}

/// Put a hook in front of the current one, once, that keeps panics below a guard off stderr.
fn silence() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let guarded = DEPTH.try_with(|d| d.get() > 0).unwrap_or(false);
            // Panics of foreign Rust callbacks that cannot unwind abort the process: not silently.
            let aborts = info.payload().downcast_ref::<&str>().is_some_and(|s| s.contains("cannot unwind"));
            if guarded && !aborts {
                let place = info.location().map(ToString::to_string);
                let _ = PLACE.try_with(|p| p.replace(place));
            } else {
                previous(info);
            }
        }));
    });
}

/// Message of the last call that failed on this thread; "" if none did.
///
/// The text stays valid until the next call that fails on this thread; a successful call does not
/// change it. Never NULL.
#[no_mangle]
pub extern "C" fn swb_last_error() -> *const c_char {
    let last = || LAST.try_with(|last| last.borrow().message.as_ptr()).unwrap_or(c"".as_ptr());
    constant().map_or_else(last, CStr::as_ptr)
}

/// Code that the user function returned, if the last failed call of this thread failed by it; else 0.
#[no_mangle]
pub extern "C" fn swb_last_user_code() -> i32 {
    match constant() {
        Some(_) => 0,
        None => LAST.try_with(|last| last.borrow().user_code).unwrap_or(0),
    }
}

/// Copy the message of the last failed call on this thread.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL, written in any case; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short. The last error is unchanged; if there was none, it is that
///         of this call.
#[no_mangle]
pub unsafe extern "C" fn swb_last_error_copy(buf: *mut c_char, len: i64, needed: *mut i64) -> swb_status {
    let result = caught(|| {
        let last = || LAST.try_with(|last| last.borrow().message.clone()).unwrap_or_default();
        let text = constant().map_or_else(last, CStr::to_owned);
        unsafe { raw::write_text(text.to_bytes(), buf, len, needed) }
    });
    match result {
        Ok(()) => swb_status::SWB_OK,
        Err(e) => {
            if constant().is_none() && LAST.try_with(|last| last.borrow().message.is_empty()).unwrap_or(false) {
                remember(&e);
            }
            swb_status::from(&e)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last() -> String {
        unsafe { CStr::from_ptr(swb_last_error()) }.to_str().unwrap().to_owned()
    }

    #[test]
    fn failure_is_remembered_and_success_keeps_it() {
        assert_eq!(guard(|| Err(Error::Range("x[3] is NaN".into()))), swb_status::SWB_ERR_RANGE);
        assert_eq!(last(), "x[3] is NaN");
        assert_eq!(guard(|| Ok(())), swb_status::SWB_OK);
        assert_eq!(last(), "x[3] is NaN");
        let user = Error::User { code: -7, what: "the right-hand side".into() };
        assert_eq!(guard(|| Err(user)), swb_status::SWB_ERR_USER);
        assert_eq!(swb_last_user_code(), -7);
    }

    #[test]
    fn a_constant_message_lasts_until_the_next_failure() {
        guard(|| Err(Error::State("abc".into())));
        remember_constant(c"constant");
        assert_eq!(last(), "constant");
        guard(|| Err(Error::User { code: -3, what: "f".into() }));
        assert!(last().contains("-3") && swb_last_user_code() == -3);
        remember_constant(c"constant");
        assert_eq!(swb_last_user_code(), 0);
    }

    #[test]
    fn panic_becomes_a_status_with_its_place() {
        let status = guard(|| panic!("index {} of {}", 4, 3));
        assert_eq!(status, swb_status::SWB_ERR_INTERNAL);
        let message = last();
        assert!(message.contains("index 4 of 3") && message.contains("guard.rs"), "{message}");
        assert_eq!(query(5, || panic!("again")), 5);
    }

    #[test]
    fn nested_guards() {
        let outer = guard(|| {
            assert_eq!(guard(|| panic!("inner")), swb_status::SWB_ERR_INTERNAL);
            Err(Error::Interrupted)
        });
        assert_eq!(outer, swb_status::SWB_ERR_INTERRUPTED);
        assert_eq!(DEPTH.with(Cell::get), 0);
    }

    #[test]
    fn copy_tells_the_length_and_writes_only_what_fits() {
        guard(|| Err(Error::State("abc".into())));
        let mut needed = 0;
        let mut buf = [1 as c_char; 8];
        unsafe {
            assert_eq!(swb_last_error_copy(std::ptr::null_mut(), 0, &mut needed), swb_status::SWB_OK);
            assert_eq!(needed, 4);
            assert_eq!(swb_last_error_copy(buf.as_mut_ptr(), 3, &mut needed), swb_status::SWB_ERR_DIMENSION);
            assert_eq!(buf, [1; 8]);
            assert_eq!(swb_last_error_copy(buf.as_mut_ptr(), 4, std::ptr::null_mut()), swb_status::SWB_OK);
            assert_eq!(CStr::from_ptr(buf.as_ptr()), c"abc");
            assert_eq!(buf[4], 1);
        }
        assert_eq!(last(), "abc");
    }
}
