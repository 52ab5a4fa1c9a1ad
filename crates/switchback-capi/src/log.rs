//! Log lines on their way to a C callback.
//!
//! Each object has its own sink; the default is silence. A line is `name = value, ...` behind a word that
//! says what it is about, so programs can read it.

use super::guard::guard;
use super::raw;
use super::settings;
use super::status::swb_status;
use std::ffi::{c_char, c_void};
use std::sync::Arc;
use switchback::error::{Error, Result};
use switchback::session::Lines;
use switchback::settings::{LogLevel, Settings, OPTIONS};

/// Receives one log line, without line break. `level` is an enum swb_log_level, `line` is valid during
/// the call only. May be called by the thread that runs the solver, never after the call that was given
/// the sink, or the object that holds it, has ended. Must not unwind (no exception, no longjmp).
pub type swb_log_fn = Option<unsafe extern "C" fn(level: i64, line: *const c_char, user_data: *mut c_void)>;

/// A C callback for log lines with its user data.
#[derive(Clone, Copy)]
pub struct LogSink {
    function: unsafe extern "C" fn(i64, *const c_char, *mut c_void),
    user_data: *mut c_void,
}

// SAFETY: the contract of the header gives the object, and the callbacks it holds, to one thread at a
// time; concurrent const calls do not log.
unsafe impl Send for LogSink {}
unsafe impl Sync for LogSink {}

impl LogSink {
    /// The sink of a callback; `None` without one.
    pub fn new(function: swb_log_fn, user_data: *mut c_void) -> Option<Self> {
        function.map(|function| LogSink { function, user_data })
    }

    /// The sink as what the library writes lines to.
    pub fn lines(self) -> Lines {
        Arc::new(move |level, text| self.line(level, text))
    }

    /// Send one line. Names of the user and messages of other libraries may hold line breaks: a space takes their place.
    pub fn line(&self, level: LogLevel, text: &str) {
        let line = raw::c_string(&text.trim_end().replace(['\n', '\r'], " "));
        // SAFETY: the function obeys the contract of `swb_log_fn`; the line outlives the call.
        unsafe { (self.function)(level as i64, line.as_ptr(), self.user_data) }
    }
}

/// Send the settings to a log sink, one option a line, those that differ from the default at level info,
/// the others at level debug.
///
/// @param[in] settings  NULL for the defaults
/// @param[in] log       the sink
/// @param[in] user_data passed on unchanged
/// @return SWB_OK; SWB_ERR_NULL without a sink
#[no_mangle]
pub unsafe extern "C" fn swb_settings_log(
    settings: *const Settings,
    log: swb_log_fn,
    user_data: *mut c_void,
) -> swb_status {
    guard(|| -> Result<()> {
        let settings = unsafe { settings::read(settings)? };
        let sink = LogSink::new(log, user_data).ok_or_else(|| Error::Null("log is NULL".into()))?;
        let default = Settings::default();
        for o in OPTIONS {
            let value = o.get_text(&settings);
            let level = if value == o.get_text(&default) { LogLevel::Debug } else { LogLevel::Info };
            sink.line(level, &format!("settings {} = {value}", o.name));
        }
        Ok(())
    })
}
