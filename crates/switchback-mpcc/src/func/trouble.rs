//! Complaints of functions during a call, so that the call can say so.
//!
//! A solver sees of a failing function only that it failed. Functions made of closures and functions made of
//! expressions write down here, per thread, which of them it was, which output and at which point; whoever ends a
//! call because of it reads the complaint. Calls nest (a callback may solve another object), hence scopes.

use super::Point;
use crate::error::Error;
use std::cell::RefCell;
use std::fmt::Write;
use std::sync::Arc;

/// Numbers of a block of inputs that a message shows.
const SHOWN: usize = 8;

/// One complaint.
#[derive(Clone, Debug)]
pub struct Complaint {
    /// Name of the function.
    pub function: Arc<str>,
    /// Value, Jacobian or Hessian.
    pub part: &'static str,
    /// Code of the callback; 0 for an output that is not finite.
    pub code: i32,
    /// Place and kind, in words that follow "is not finite where it is needed"; may be empty.
    pub place: String,
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
    /// Complaints so far.
    count: usize,
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
        now.count += 1;
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

/// Number of complaints in this call so far: what [`last_after`] compares with.
pub fn count() -> usize {
    NOW.with(|now| now.borrow().count)
}

/// The last complaint about a function that is not defined, in words, if there was one after the first `count`.
pub fn last_after(count: usize) -> Option<String> {
    NOW.with(|now| {
        let now = now.borrow();
        now.last.as_ref().filter(|_| now.count > count).map(|c| c.error().to_string())
    })
}

/// The words for an output that is not finite, and for the point: `bad` is the number of the output and its value,
/// as far as there is one.
pub fn place(at: &Point, bad: Option<(usize, f64)>) -> String {
    let mut s = String::new();
    if let Some((i, v)) = bad {
        let _ = write!(s, " (output {i} is {v})");
    }
    let _ = write!(s, " at t = {:?}", at.t);
    for (name, block) in [("x", at.x), ("u", at.u), ("p", at.p)] {
        if block.is_empty() {
            continue;
        }
        let shown: Vec<String> = block.iter().take(SHOWN).map(|v| format!("{v:?}")).collect();
        let more = if block.len() > SHOWN { ", ..." } else { "" };
        let _ = write!(s, ", {name} = [{}{more}]", shown.join(", "));
    }
    s
}

/// True while a solver is at work.
pub fn solving() -> bool {
    NOW.with(|now| now.borrow().solving)
}

impl Complaint {
    /// The complaint as the error of a call that cannot go on.
    pub fn error(&self) -> Error {
        let (part, name, code, place) = (self.part, &self.function, self.code, &self.place);
        if code < 0 {
            return Error::User { code, what: format!("the {part} of function '{name}'") };
        }
        let hint = if self.timeless && code == 0 {
            "; it is not told the time: if it depends on it, say so by its Jacobian pattern or swb_function_set_inputs"
        } else {
            ": start from another point, or tighten the bounds"
        };
        Error::NonFinite(if code > 0 {
            format!("the {part} of function '{name}' is not defined where it is needed (code {code}){place}{hint}")
        } else {
            format!("the {part} of function '{name}' is not finite where it is needed{place}{hint}")
        })
    }
}

/// The error of a call that ended because a function has no value, whatever the function is made of.
pub fn undefined(part: &'static str, function: &str) -> Error {
    Complaint { function: function.into(), part, code: 0, place: String::new(), timeless: false }.error()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(code: i32) -> Complaint {
        Complaint { function: "f".into(), part: "value", code, place: String::new(), timeless: false }
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

    #[test]
    fn complaints_name_output_and_point() {
        let at = Point { t: 0.5, x: &[1.0, -2.0], u: &[], p: &[0.25] };
        let words = place(&at, Some((1, f64::INFINITY)));
        assert_eq!(words, " (output 1 is inf) at t = 0.5, x = [1.0, -2.0], p = [0.25]");
        assert!(place(&Point { x: &[0.0; 20], ..at }, None).contains("0.0, ...]"));
        let ((), _) = collect(true, || {
            let before = count();
            assert!(last_after(before).is_none());
            note(Complaint { place: words.clone(), ..complaint(0) });
            assert!(last_after(before).unwrap().contains("output 1 is inf"));
            assert!(last_after(count()).is_none());
        });
    }
}
