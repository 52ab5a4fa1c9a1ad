//! Allocations of a thread, for programs that must not allocate.

/// Allocations of this thread so far.
pub fn count() -> usize {
    switchback::memory::allocations()
}
