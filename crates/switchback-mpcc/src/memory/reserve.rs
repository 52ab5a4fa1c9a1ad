//! The reserve: a few MB in the image of the library, handed out when the system has no memory left.
//!
//! Blocks are taken first fit from a list of free ones in the order of their addresses, and join their neighbours when they
//! come back. That is slow where there are many, which does not matter: a call that lives on the reserve ends at its next safe
//! point. Pages that were never used cost address space only.

#![allow(unsafe_code)]

use std::alloc::Layout;
use std::cell::UnsafeCell;
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Bytes of the reserve.
pub const SIZE: usize = 8 << 20;

/// Large requests leave so much to small ones, which an error message and the way out need.
const KEPT: usize = SIZE / 8;
const SMALL: usize = 1 << 12;

/// Sizes are multiples of this, and blocks begin at such addresses.
const UNIT: usize = 16;

/// A block that is free. As large as the unit.
#[repr(C)]
struct Free {
    size: usize,
    next: *mut Free,
}

/// In front of the memory of a block that is used: where the block begins and how large it is. As large as the unit.
#[repr(C)]
struct Used {
    start: *mut u8,
    size: usize,
}

#[repr(C, align(4096))]
struct Space(UnsafeCell<[MaybeUninit<u8>; SIZE]>);

struct List(UnsafeCell<Option<*mut Free>>);

// SAFETY: both are touched under LOCK only.
unsafe impl Sync for Space {}
unsafe impl Sync for List {}

static SPACE: Space = Space(UnsafeCell::new([MaybeUninit::uninit(); SIZE]));
/// First free block; `None` before the first use.
static LIST: List = List(UnsafeCell::new(None));
static LOCK: AtomicBool = AtomicBool::new(false);
static USED: AtomicUsize = AtomicUsize::new(0);

/// Bytes handed out.
pub fn used() -> usize {
    USED.load(Ordering::Relaxed)
}

/// Is this memory of the reserve?
#[inline]
pub fn contains(p: *const u8) -> bool {
    (p as usize).wrapping_sub(SPACE.0.get() as usize) < SIZE
}

fn locked<R>(body: impl FnOnce(&mut *mut Free) -> R) -> R {
    while LOCK.compare_exchange_weak(false, true, Ordering::Acquire, Ordering::Relaxed).is_err() {
        std::hint::spin_loop();
    }
    // SAFETY: the lock is held, and the whole space is one free block at first.
    let result = unsafe {
        let first = (*LIST.0.get()).get_or_insert_with(|| {
            let all = SPACE.0.get().cast::<Free>();
            all.write(Free { size: SIZE, next: ptr::null_mut() });
            all
        });
        body(first)
    };
    LOCK.store(false, Ordering::Release);
    result
}

/// Memory for `layout`, or NULL.
pub fn allocate(layout: Layout) -> *mut u8 {
    // beyond that the sums below would overflow
    if layout.size() > SIZE || layout.align() > SIZE {
        return ptr::null_mut();
    }
    let slack = if layout.align() > UNIT { layout.align() } else { 0 };
    let size = layout.size().next_multiple_of(UNIT) + UNIT + slack;
    if layout.size() > SMALL && used() + size > SIZE - KEPT {
        return ptr::null_mut();
    }
    // SAFETY: every pointer in the list leads to a free block of the space with its header; the block found is at least as
    // large as asked for, and what is left of it is a multiple of the unit, so a header fits if it is not empty.
    locked(|first| unsafe {
        let mut link: *mut *mut Free = first;
        while !(*link).is_null() && (**link).size < size {
            link = &raw mut (**link).next;
        }
        let block = *link;
        if block.is_null() {
            return ptr::null_mut();
        }
        let rest = (*block).size - size;
        if rest > 0 {
            let tail = block.cast::<u8>().add(size).cast::<Free>();
            tail.write(Free { size: rest, next: (*block).next });
            *link = tail;
        } else {
            *link = (*block).next;
        }
        USED.fetch_add(size, Ordering::Relaxed);
        let start = block.cast::<u8>();
        let past = start.add(UNIT);
        let memory = past.add(past.align_offset(layout.align()));
        memory.sub(UNIT).cast::<Used>().write(Used { start, size });
        memory
    })
}

/// Takes memory back.
///
/// # Safety
/// `memory` comes from [`allocate`] and is not used any more.
pub unsafe fn free(memory: *mut u8) {
    // SAFETY: the header stands in front of the memory; free blocks are as in `allocate`.
    locked(|first| unsafe {
        let Used { start, size } = memory.sub(UNIT).cast::<Used>().read();
        USED.fetch_sub(size, Ordering::Relaxed);
        let block = start.cast::<Free>();
        let (mut link, mut before): (*mut *mut Free, *mut Free) = (first, ptr::null_mut());
        while !(*link).is_null() && *link < block {
            before = *link;
            link = &raw mut (**link).next;
        }
        block.write(Free { size, next: *link });
        *link = block;
        join(block);
        if !before.is_null() {
            join(before);
        }
    });
}

/// Joins a free block with the next one if that begins where it ends.
unsafe fn join(block: *mut Free) {
    // SAFETY: both are free blocks of the list, and the lock is held.
    unsafe {
        let next = (*block).next;
        if !next.is_null() && block.cast::<u8>().add((*block).size) == next.cast::<u8>() {
            (*block).size += (*next).size;
            (*block).next = (*next).next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of many sizes, taken and given back in an order without pattern, hold what was written to them.
    #[test]
    fn blocks_do_not_overlap_and_all_come_back() {
        let mut state = 7_u64;
        let mut random = move |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % n
        };
        let mut live: Vec<(*mut u8, usize, u8)> = Vec::new();
        for round in 0..2000 {
            if live.len() > 40 || (!live.is_empty() && random(3) == 0) {
                let (p, n, mark) = live.swap_remove(random(live.len()));
                let all = unsafe { std::slice::from_raw_parts(p, n) };
                assert!(all.iter().all(|b| *b == mark));
                unsafe { free(p) };
            } else {
                let (size, align) = (1 + random(20_000), 1 << random(9));
                let p = allocate(Layout::from_size_align(size, align).unwrap());
                assert!(!p.is_null() && p as usize % align == 0 && contains(p) && contains(p.wrapping_add(size - 1)));
                let mark = (round % 251) as u8;
                unsafe { p.write_bytes(mark, size) };
                live.push((p, size, mark));
            }
        }
        live.iter().for_each(|b| unsafe { free(b.0) });
        // other tests of this process may be at work, but none of them holds a megabyte of the reserve
        assert!(used() < 1 << 20);
        let whole = Layout::from_size_align(SIZE / 2, 8).unwrap();
        let p = allocate(whole);
        assert!(!p.is_null());
        unsafe { free(p) };
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        for size in [SIZE, SIZE - KEPT, SIZE + 1, isize::MAX as usize - 7] {
            assert!(allocate(Layout::from_size_align(size, 8).unwrap()).is_null());
        }
        assert!(!contains(ptr::null()) && !contains(SPACE.0.get().cast::<u8>().wrapping_sub(1)));
    }
}
