//! Status codes: one enumeration, one table, the numbers of [`Error::code`].

use super::guard::query;
use std::ffi::{c_char, CStr};
use std::ptr;
use switchback::error::Error;

/// Status of a call: 0 or a negative code that says why the call could not do its work.
///
/// How an algorithm ended (solved, infeasible, out of iterations, ...) is not a status but an outcome.
/// Numbers are only ever added. -1 to -19: arguments; -20 to -29: user functions; -30 to -49: numerics;
/// -50 to -59: resources.
///
/// cbindgen:rename-all=None
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(clippy::upper_case_acronyms)]
pub enum swb_status {
    /// The call did its work.
    SWB_OK = 0,
    /// A required pointer is NULL.
    SWB_ERR_NULL = -1,
    /// A size or an index does not fit.
    SWB_ERR_DIMENSION = -2,
    /// A value is outside its range.
    SWB_ERR_RANGE = -3,
    /// The call does not fit the state of the object.
    SWB_ERR_STATE = -4,
    /// The combination is not supported.
    SWB_ERR_UNSUPPORTED = -5,
    /// Unknown option, or a value of the wrong type.
    SWB_ERR_OPTION = -6,
    /// A user function returned a negative code; see swb_last_user_code.
    SWB_ERR_USER = -20,
    /// A user function has no finite value where one is needed.
    SWB_ERR_NONFINITE = -21,
    /// Interrupted; the object can be used again.
    SWB_ERR_INTERRUPTED = -23,
    /// The numerical method cannot go on and there is no usable result.
    SWB_ERR_NUMERIC = -30,
    /// A foreign library failed, or a resource is missing.
    SWB_ERR_LIBRARY = -50,
    /// A defect of the library; the object can only be freed.
    SWB_ERR_INTERNAL = -99,
}

use swb_status::*;

/// Every code with its name and its general message.
pub const STATUS: &[(swb_status, &CStr, &CStr)] = &[
    (SWB_OK, c"SWB_OK", c"success"),
    (SWB_ERR_NULL, c"SWB_ERR_NULL", c"a required pointer is NULL"),
    (SWB_ERR_DIMENSION, c"SWB_ERR_DIMENSION", c"a size or an index does not fit"),
    (SWB_ERR_RANGE, c"SWB_ERR_RANGE", c"a value is outside its range"),
    (SWB_ERR_STATE, c"SWB_ERR_STATE", c"the call does not fit the state of the object"),
    (SWB_ERR_UNSUPPORTED, c"SWB_ERR_UNSUPPORTED", c"the combination is not supported"),
    (SWB_ERR_OPTION, c"SWB_ERR_OPTION", c"unknown option, or a value of the wrong type"),
    (SWB_ERR_USER, c"SWB_ERR_USER", c"a user function returned a negative code"),
    (SWB_ERR_NONFINITE, c"SWB_ERR_NONFINITE", c"a user function has no finite value where one is needed"),
    (SWB_ERR_INTERRUPTED, c"SWB_ERR_INTERRUPTED", c"interrupted; the object can be used again"),
    (SWB_ERR_NUMERIC, c"SWB_ERR_NUMERIC", c"the numerical method cannot go on"),
    (SWB_ERR_LIBRARY, c"SWB_ERR_LIBRARY", c"a foreign library failed, or a resource is missing"),
    (SWB_ERR_INTERNAL, c"SWB_ERR_INTERNAL", c"internal error, please report it"),
];

impl From<&Error> for swb_status {
    fn from(e: &Error) -> Self {
        let code = e.code();
        STATUS.iter().map(|row| row.0).find(|s| *s as i32 == code).unwrap_or(SWB_ERR_INTERNAL)
    }
}

/// General message of a status code; "unknown status" for any other number. Never NULL, static.
#[no_mangle]
pub extern "C" fn swb_status_string(status: i32) -> *const c_char {
    query(ptr::null(), || {
        let row = STATUS.iter().find(|row| row.0 as i32 == status);
        row.map_or(c"unknown status", |row| row.2).as_ptr()
    })
}

/// Name of a status code, such as "SWB_ERR_NULL"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_status_name(status: i32) -> *const c_char {
    query(ptr::null(), || {
        let row = STATUS.iter().find(|row| row.0 as i32 == status);
        row.map_or(ptr::null(), |row| row.1.as_ptr())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_has_a_status() {
        let s = String::new;
        let all = [
            Error::Null(s()),
            Error::Dimension(s()),
            Error::Range(s()),
            Error::State(s()),
            Error::Unsupported(s()),
            Error::Option(s()),
            Error::User { code: -3, what: s() },
            Error::NonFinite(s()),
            Error::Interrupted,
            Error::Numeric(s()),
            Error::Library(s()),
            Error::Internal(s()),
        ];
        for e in &all {
            assert_eq!(swb_status::from(e) as i32, e.code(), "{e:?}");
        }
        assert_eq!(all.len() + 1, STATUS.len());
    }

    #[test]
    fn names_are_those_of_the_enumeration() {
        for (status, name, message) in STATUS {
            assert_eq!(name.to_str().unwrap(), format!("{status:?}"));
            assert!(!message.is_empty());
        }
    }
}
