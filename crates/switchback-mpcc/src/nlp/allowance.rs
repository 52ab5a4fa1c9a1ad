//! Iterations that a call may spend in all its solves together.
//!
//! A search solves many programs, each with a limit of its own. What bounds the call is set around the search ([`within`]), and every iteration of
//! every interior-point solve on its thread counts ([`spend`]), those of certificates excepted ([`apart`]), which no statistics count either. A solve
//! that begins with nothing left ends at its starting point.

use std::cell::Cell;

thread_local! {
    static LEFT: Cell<usize> = const { Cell::new(usize::MAX) };
}

/// Puts a number of iterations back when it is dropped, also after a panic.
struct Restore(usize);

impl Drop for Restore {
    fn drop(&mut self) {
        LEFT.set(self.0);
    }
}

/// Iterations that are left to the call that runs on this thread; `usize::MAX` without a limit.
pub fn left() -> usize {
    LEFT.get()
}

/// True where all iterations are spent.
pub fn is_over() -> bool {
    left() == 0
}

/// Counts iterations.
pub fn spend(iterations: usize) {
    match LEFT.get() {
        usize::MAX => {}
        n => LEFT.set(n.saturating_sub(iterations)),
    }
}

/// Runs `body` with at most so many iterations, and no more than are left.
pub fn within<R>(most: usize, body: impl FnOnce() -> R) -> R {
    let outside = left();
    let inside = most.min(outside);
    let mut restore = Restore(outside);
    LEFT.set(inside);
    let r = body();
    if outside != usize::MAX {
        restore.0 = outside - (inside - left());
    }
    r
}

/// Runs `body` with one iteration less than is left.
pub(super) fn but_one<R>(body: impl FnOnce() -> R) -> R {
    match left() {
        usize::MAX => body(),
        n => within(n.saturating_sub(1), body),
    }
}

/// Runs `body` without counting.
pub fn apart<R>(body: impl FnOnce() -> R) -> R {
    let _restore = Restore(LEFT.replace(usize::MAX));
    body()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iterations_count_in_all_scopes_around_them() {
        assert!(!is_over());
        within(5, || {
            spend(1);
            within(2, || {
                spend(1);
                apart(|| (0..9).for_each(|_| spend(1)));
                assert_eq!(left(), 1);
                but_one(|| assert!(is_over()));
                spend(1);
                assert!(is_over());
                spend(1);
            });
            assert_eq!(left(), 2);
            within(9, || assert_eq!(left(), 2));
        });
        assert_eq!(left(), usize::MAX);
        but_one(|| assert_eq!(left(), usize::MAX));
    }
}
