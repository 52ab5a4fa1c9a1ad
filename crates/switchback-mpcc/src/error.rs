//! Errors of the library: what went wrong, with the numbers, and what to do about it.
//!
//! An [`Error`] means that a call could not do its work. How an algorithm ended (solved, infeasible,
//! out of iterations) is no error: that is [`crate::nlp::Outcome`].

use std::fmt;

/// Why a call failed. The message says what to do; [`Error::code`] is the status of the C ABI.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A required pointer was null.
    Null(String),
    /// A size or an index does not fit.
    Dimension(String),
    /// A value is outside its range (NaN, lower bound above upper bound, unsorted pattern ...).
    Range(String),
    /// The call does not fit the state of the object.
    State(String),
    /// The combination is not supported.
    Unsupported(String),
    /// An unknown option or a value of the wrong type.
    Option(String),
    /// A user function returned a negative code.
    User {
        /// The code.
        code: i32,
        /// The function and its part.
        what: String,
    },
    /// A user function has no finite value where one is needed.
    NonFinite(String),
    /// Stopped by `interrupt`, or by a callback that asked for it.
    Interrupted,
    /// Stopped because `max_time` was over before there was a result.
    OutOfTime,
    /// The numerical method cannot go on and there is no usable result.
    Numeric(String),
    /// A foreign library failed, or a resource is missing.
    Library(String),
    /// A defect in this library, caught at the boundary.
    Internal(String),
}

/// Result of a fallible call.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Status code of the C ABI; append-only, see `docs/errors.md`.
    pub fn code(&self) -> i32 {
        match self {
            Error::Null(_) => -1,
            Error::Dimension(_) => -2,
            Error::Range(_) => -3,
            Error::State(_) => -4,
            Error::Unsupported(_) => -5,
            Error::Option(_) => -6,
            Error::User { .. } => -20,
            Error::NonFinite(_) => -21,
            Error::Interrupted | Error::OutOfTime => -23,
            Error::Numeric(_) => -30,
            Error::Library(_) => -50,
            Error::Internal(_) => -99,
        }
    }

    /// This error with other words.
    pub fn with_text(&self, text: impl FnOnce(&str) -> String) -> Error {
        match self {
            Error::Null(s) => Error::Null(text(s)),
            Error::Dimension(s) => Error::Dimension(text(s)),
            Error::Range(s) => Error::Range(text(s)),
            Error::State(s) => Error::State(text(s)),
            Error::Unsupported(s) => Error::Unsupported(text(s)),
            Error::Option(s) => Error::Option(text(s)),
            Error::User { code, what } => Error::User { code: *code, what: text(what) },
            Error::NonFinite(s) => Error::NonFinite(text(s)),
            Error::Numeric(s) => Error::Numeric(text(s)),
            Error::Library(s) => Error::Library(text(s)),
            Error::Internal(s) => Error::Internal(text(s)),
            Error::Interrupted | Error::OutOfTime => self.clone(),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Null(s)
            | Error::Dimension(s)
            | Error::Range(s)
            | Error::State(s)
            | Error::Unsupported(s)
            | Error::Option(s)
            | Error::NonFinite(s)
            | Error::Numeric(s)
            | Error::Library(s) => f.write_str(s),
            Error::User { code, what } => write!(f, "{what} returned {code}: a negative code stops the call"),
            Error::Interrupted => f.write_str("interrupted; the object can be used again"),
            Error::OutOfTime => f.write_str(
                "max_time was over before there was a result: allow more time, or make the problem smaller; the object can \
                 be used again",
            ),
            Error::Internal(s) => write!(f, "internal error, please report it: {s}"),
        }
    }
}

impl std::error::Error for Error {}

/// Checks a number that must be positive and finite; `what` it is, for the message.
pub fn check_positive(what: &str, value: f64) -> Result<()> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(Error::Range(format!("{what} is {value}: it must be positive and finite")))
}

/// Checks how long a run takes and in how many steps it is made.
pub fn check_run(duration: f64, n_steps: i64) -> Result<()> {
    check_positive("the duration", duration)?;
    if n_steps < 1 {
        return Err(Error::Range(format!("the number of steps is {n_steps}: it must be at least 1")));
    }
    Ok(())
}

/// Checks length and finiteness of input data.
pub fn finite(what: &str, v: &[f64], n: usize) -> Result<()> {
    if v.len() != n {
        return Err(Error::Dimension(format!("{} values given for {what}, expected {n}", v.len())));
    }
    match v.iter().position(|x| !x.is_finite()) {
        Some(i) => Err(Error::Range(format!("{what} {i} is {}: it must be finite", v[i]))),
        None => Ok(()),
    }
}
