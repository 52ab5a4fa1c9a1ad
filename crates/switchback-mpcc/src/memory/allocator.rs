//! The allocator of the library: that of the system, an account per thread, and a reserve.
//!
//! Rust programs that bring an allocator of their own leave the feature `allocator` out; they then decide what a lack of
//! memory means, and the option `max_memory` knows estimates only.

#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr;

use super::{reserve, ACCOUNT};

struct Reserving;

#[global_allocator]
static ALLOCATOR: Reserving = Reserving;

/// Writes a request into the account; `grown` bytes more than before.
#[inline]
fn book(grown: isize, requests: usize) {
    // a thread that ends has no account any more
    let _ = ACCOUNT.try_with(|a| {
        a.held.set(a.held.get().wrapping_add(grown));
        a.count.set(a.count.get() + requests);
    });
}

/// What the system does not have: from the reserve, unless the request may fail. Whoever runs ends at the next safe point.
#[cold]
fn without_system(layout: Layout) -> *mut u8 {
    if ACCOUNT.try_with(|a| a.fallible.get()).unwrap_or(false) {
        return ptr::null_mut();
    }
    let _ = ACCOUNT.try_with(|a| {
        if a.missing.get() == 0 {
            a.missing.set(layout.size().max(1));
        }
    });
    reserve::allocate(layout)
}

// SAFETY: memory is that of the system allocator or of the reserve, and goes back to where its address says it is from;
// nothing here unwinds.
unsafe impl GlobalAlloc for Reserving {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let mut p = unsafe { System.alloc(layout) };
        if p.is_null() {
            p = without_system(layout);
        }
        if !p.is_null() {
            book(layout.size() as isize, 1);
        }
        p
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        let mut p = unsafe { System.alloc_zeroed(layout) };
        if p.is_null() {
            p = without_system(layout);
            if !p.is_null() {
                unsafe { p.write_bytes(0, layout.size()) };
            }
        }
        if !p.is_null() {
            book(layout.size() as isize, 1);
        }
        p
    }

    #[inline]
    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        book(-(layout.size() as isize), 0);
        if reserve::contains(p) {
            unsafe { reserve::free(p) };
        } else {
            unsafe { System.dealloc(p, layout) };
        }
    }

    #[inline]
    unsafe fn realloc(&self, p: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !reserve::contains(p) {
            let q = unsafe { System.realloc(p, layout, size) };
            if !q.is_null() {
                book(size as isize - layout.size() as isize, 1);
                return q;
            }
        }
        unsafe { self.move_to(p, layout, size) }
    }
}

impl Reserving {
    #[cold]
    unsafe fn move_to(&self, p: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller of `realloc` vouches that the size is valid for the alignment, and for `p`.
        unsafe {
            let q = self.alloc(Layout::from_size_align_unchecked(size, layout.align()));
            if !q.is_null() {
                ptr::copy_nonoverlapping(p, q, size.min(layout.size()));
                self.dealloc(p, layout);
            }
            q
        }
    }
}
