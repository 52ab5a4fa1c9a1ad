//! What user functions complained about during a call, so that the call can say so.
//!
//! The solver sees of a failing function only that it failed. The adapter around a C callback writes down
//! name and code here, per thread; the export that started the call reads it at the end. Calls nest (a
//! callback may solve another object), hence scopes.

use crate::error::Error;
use std::cell::RefCell;
use std::sync::Arc;

/// One complaint.
#[derive(Clone, Debug)]
pub struct Complaint {
    /// Name of the function.
    pub function: Arc<str>,
    /// Value, Jacobian or Hessian.
    pub part: &'static str,
    /// Code of the callback; 0 for an output that is not finite.
    pub code: i32,
    /// The function gets no time although it may want it.
    pub timeless: bool,
}

/// The complaints of one call.
#[derive(Default)]
pub struct Troubles {
    /// A solver is at work, no direct evaluation.
    solving: bool,
    /// The negative code, if there was one.
    pub fatal: Option<Complaint>,
    /// The last positive code or value that is not finite.
    pub last: Option<Complaint>,
}

thread_local! {
    static NOW: RefCell<Troubles> = RefCell::default();
}

/// Run `body` with a clean slate and return what user functions complained about.
pub fn collect<R>(solving: bool, body: impl FnOnce() -> R) -> (R, Troubles) {
    struct Restore(Option<Troubles>);
    impl Restore {
        fn swap(&mut self) -> Troubles {
            self.0.take().map_or_else(Troubles::default, |outer| NOW.with(|now| now.replace(outer)))
        }
    }
    impl Drop for Restore {
        fn drop(&mut self) {
            self.swap();
        }
    }
    let mut outer = Restore(Some(NOW.with(|now| now.replace(Troubles { solving, ..Troubles::default() }))));
    let result = body();
    let found = outer.swap();
    (result, found)
}

/// Write down a complaint; a negative code ends the call.
pub fn note(complaint: Complaint) {
    NOW.with(|now| {
        let mut now = now.borrow_mut();
        if complaint.code < 0 {
            now.fatal.get_or_insert(complaint);
        } else {
            now.last = Some(complaint);
        }
    });
}

/// The negative code that ended this call already: no user function is called any more.
pub fn fatal() -> Option<i32> {
    NOW.with(|now| now.borrow().fatal.as_ref().map(|c| c.code))
}

/// Is a solver at work?
pub fn solving() -> bool {
    NOW.with(|now| now.borrow().solving)
}

impl Complaint {
    /// As the error of a call that cannot go on.
    pub fn error(&self) -> Error {
        let (part, name, code) = (self.part, &self.function, self.code);
        if code < 0 {
            return Error::User { code, what: format!("the {part} of function '{name}'") };
        }
        if code > 0 {
            return Error::NonFinite(format!(
                "the {part} of function '{name}' is not defined where it is needed (code {code}): start from another \
                 point, or tighten the bounds"
            ));
        }
        let hint = if self.timeless {
            "; it is not told the time: if it depends on it, say so by its Jacobian pattern or swb_function_set_inputs"
        } else {
            ": start from another point, or tighten the bounds"
        };
        Error::NonFinite(format!("the {part} of function '{name}' is not finite where it is needed{hint}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(code: i32) -> Complaint {
        Complaint { function: "f".into(), part: "value", code, timeless: false }
    }

    #[test]
    fn scopes_nest() {
        let ((), outer) = collect(true, || {
            note(complaint(3));
            let ((), inner) = collect(false, || {
                assert!(!solving() && fatal().is_none());
                note(complaint(-7));
                note(complaint(-8));
                assert_eq!(fatal(), Some(-7));
            });
            assert_eq!(inner.fatal.unwrap().code, -7);
            assert!(inner.last.is_none() && solving() && fatal().is_none());
        });
        assert_eq!((outer.last.unwrap().code, outer.fatal.is_none()), (3, true));
        assert!(!solving());
    }

    #[test]
    fn a_panic_restores_the_outer_scope() {
        let ((), outer) = collect(true, || {
            let inner = std::panic::catch_unwind(|| collect(false, || panic!("defect")));
            assert!(inner.is_err() && solving());
        });
        assert!(outer.fatal.is_none());
    }

    #[test]
    fn errors_name_the_function() {
        let text = |c: &Complaint| c.error().to_string();
        assert_eq!(complaint(-4).error().code(), -20);
        assert!(text(&complaint(-4)).contains("value of function 'f' returned -4"));
        assert!(text(&complaint(2)).contains("code 2"));
        let blind = Complaint { timeless: true, ..complaint(0) };
        assert_eq!(blind.error().code(), -21);
        assert!(text(&blind).contains("swb_function_set_inputs"));
    }
}
