//! The table of live objects: what a handle is, and how it is told from one that has been freed.
//!
//! A handle is a number in the guise of a pointer: the index of a slot and the generation of the slot's content. It
//! is never dereferenced. A slot counts its generations up whenever its object is freed, so a stale handle does not
//! fit any object that takes the place. Slots stay where they are for the life of the process: looking one up is safe
//! whatever the number, whatever other threads do. A slot whose generations are used up is retired, so no handle ever
//! comes round again. The top bit of a handle is set, which no address of a 64-bit program has: a pointer to anything
//! else is no handle.
//!
//! State of a slot, in one atomic word: how many calls use the object (shared uses, or one exclusive use), how many
//! look at its interrupt flag, and the generation. All operations are lock-free, so a child process after `fork` can
//! go on, and a signal handler can raise an interrupt flag.

use std::alloc::{alloc_zeroed, dealloc, Layout};
use std::ptr;
use std::sync::atomic::{AtomicI64, AtomicPtr, AtomicU32, AtomicU64, Ordering};
use switchback::error::{Error, Result};

/// Name of the type of an object, at an address that lives as long as the process.
pub type Kind = &'static &'static str;

// --- Handles: top bit | generation | index | three zeros, as the address of something aligned would have.

const INDEX_SHIFT: u32 = 3;
#[cfg(target_pointer_width = "64")]
const INDEX_BITS: u32 = 24;
#[cfg(not(target_pointer_width = "64"))]
const INDEX_BITS: u32 = 14;
const GENERATION_BITS: u32 = usize::BITS - 1 - INDEX_BITS - INDEX_SHIFT;
/// Never handed out.
const LAST_GENERATION: u64 = (1 << GENERATION_BITS) - 1;
const TOP: usize = 1 << (usize::BITS - 1);
const MAX_SLOTS: u32 = 1 << INDEX_BITS;

fn encode(index: u32, generation: u64) -> usize {
    TOP | (generation as usize) << (INDEX_BITS + INDEX_SHIFT) | (index as usize) << INDEX_SHIFT
}

/// Index and generation, if this could be a handle.
fn decode(handle: usize) -> Option<(u32, u64)> {
    let unused = (1 << INDEX_SHIFT) - 1;
    if handle & TOP == 0 || handle & unused != 0 {
        return None;
    }
    let index = (handle >> INDEX_SHIFT) as u32 & (MAX_SLOTS - 1);
    let generation = (handle & !TOP) >> (INDEX_BITS + INDEX_SHIFT);
    Some((index, generation as u64))
}

// --- State of a slot: generation | pins | uses.

const USES_BITS: u32 = 20;
const PINS_BITS: u32 = 8;
const USES: u64 = (1 << USES_BITS) - 1;
const ONE_PIN: u64 = 1 << USES_BITS;
const PINS: u64 = ((1 << PINS_BITS) - 1) << USES_BITS;
const GENERATION_SHIFT: u32 = USES_BITS + PINS_BITS;

/// No object is here.
const VACANT: u64 = USES;
/// One call uses the object alone.
const EXCLUSIVE: u64 = USES - 1;
/// A call ended by a defect of the library: the object can only be freed.
const BROKEN: u64 = USES - 2;
/// Largest number of shared uses.
const MAX_SHARED: u64 = USES - 3;

const fn generation_of(state: u64) -> u64 {
    state >> GENERATION_SHIFT
}

const _: () = assert!(GENERATION_BITS + GENERATION_SHIFT <= 64);

/// Aligned so that threads with objects of their own do not share a cache line.
#[repr(C, align(64))]
pub struct Slot {
    state: AtomicU64,
    body: AtomicPtr<()>,
    kind: AtomicPtr<&'static str>,
    /// The next vacant slot, its index plus one; 0: none.
    next: AtomicU32,
}

impl Slot {
    /// What `create` was given.
    pub fn body(&self) -> *mut () {
        self.body.load(Ordering::Relaxed)
    }
}

/// Slots in chunks that double in size: the first holds `FIRST`, and none ever moves.
pub struct Table {
    chunks: [AtomicPtr<Slot>; CHUNKS],
    /// Slots that were ever used.
    known: AtomicU32,
    /// The first vacant slot, its index plus one (0: none), below a count of changes: two states of the list that begin
    /// with the same slot differ.
    vacant: AtomicU64,
    live: AtomicI64,
}

const FIRST: u32 = 64;
const CHUNKS: usize = (INDEX_BITS - FIRST.ilog2() + 1) as usize;

/// Chunk of a slot, and place in it.
fn place(index: u32) -> (usize, usize) {
    let shifted = index + FIRST;
    let chunk = shifted.ilog2() - FIRST.ilog2();
    (chunk as usize, (shifted - (FIRST << chunk)) as usize)
}

/// The objects of the process.
pub static OBJECTS: Table = Table::new();

impl Table {
    pub const fn new() -> Table {
        Table {
            chunks: [const { AtomicPtr::new(ptr::null_mut()) }; CHUNKS],
            known: AtomicU32::new(0),
            vacant: AtomicU64::new(0),
            live: AtomicI64::new(0),
        }
    }

    /// Number of objects that are not freed.
    pub fn live(&self) -> i64 {
        self.live.load(Ordering::Relaxed)
    }

    /// Takes a slot for an object that is about to be made.
    pub fn reserve(&self) -> Result<Vacancy<'_>> {
        let index = match self.pop() {
            Some(index) => index,
            None => self.grow()?,
        };
        let slot = self.slot(index).ok_or_else(|| Error::Internal("a slot without memory".into()))?;
        Ok(Vacancy { table: self, slot, index })
    }

    /// Claims an object for one of many calls that may overlap.
    pub fn share(&self, handle: usize, kind: Kind) -> Result<&Slot> {
        let claimed = self.change(handle, kind, |state| match state & USES {
            uses if uses < MAX_SHARED => Next::To(state + 1),
            uses => Next::Refused(uses),
        });
        claimed.map_err(|refusal| refusal.error(kind))
    }

    /// Gives back what [`Table::share`] claimed.
    pub fn unshare(&self, slot: &Slot) {
        slot.state.fetch_sub(1, Ordering::Release);
    }

    /// Claims an object for one call alone.
    pub fn take(&self, handle: usize, kind: Kind) -> Result<&Slot> {
        let claimed = self.change(handle, kind, |state| match state & USES {
            0 => Next::To(state | EXCLUSIVE),
            uses => Next::Refused(uses),
        });
        claimed.map_err(|refusal| refusal.error(kind))
    }

    /// Gives back what [`Table::take`] claimed; `broken` leaves an object that can only be removed.
    pub fn untake(&self, slot: &Slot, broken: bool) {
        slot.state.fetch_sub(if broken { EXCLUSIVE - BROKEN } else { EXCLUSIVE }, Ordering::Release);
    }

    /// Keeps an object from being removed for a moment, whoever uses it. Allocates nothing, so that a signal handler may
    /// do it.
    pub fn pin(&self, handle: usize, kind: Kind) -> std::result::Result<&Slot, Refusal> {
        self.change(handle, kind, |state| match state & PINS {
            PINS => Next::Wait,
            _ => Next::To(state + ONE_PIN),
        })
    }

    /// Gives back what [`Table::pin`] claimed.
    pub fn unpin(&self, slot: &Slot) {
        slot.state.fetch_sub(ONE_PIN, Ordering::Release);
    }

    /// Takes an object out that nobody uses and returns what [`Table::insert`] was given.
    pub fn remove(&self, handle: usize, kind: Kind) -> Result<*mut ()> {
        let removed = self.change(handle, kind, |state| match state & USES {
            0 | BROKEN if state & PINS != 0 => Next::Wait,
            // From here on the handle is stale.
            0 | BROKEN => Next::To((generation_of(state) + 1) << GENERATION_SHIFT | VACANT),
            uses => Next::Refused(uses),
        });
        let slot = removed.map_err(|refusal| refusal.error(kind))?;
        let body = slot.body.swap(ptr::null_mut(), Ordering::Relaxed);
        self.live.fetch_sub(1, Ordering::Relaxed);
        if let Some((index, generation)) = decode(handle) {
            // The last generation is never handed out: handles of the one before stay stale.
            if generation + 1 < LAST_GENERATION {
                self.push(index, slot);
            }
        }
        Ok(body)
    }

    /// Moves the slot of a live handle of this kind from one state to another.
    fn change(&self, handle: usize, kind: Kind, next: impl Fn(u64) -> Next) -> std::result::Result<&Slot, Refusal> {
        let (index, generation) = decode(handle).ok_or(Refusal::Unknown)?;
        let slot = self.slot(index).ok_or(Refusal::Unknown)?;
        let mut state = slot.state.load(Ordering::Acquire);
        loop {
            let now = generation_of(state);
            if generation < now {
                return Err(Refusal::Freed);
            }
            if generation > now || state & USES == VACANT {
                return Err(Refusal::Unknown);
            }
            // If the slot changes hands in between, this may be the kind of a later object: the state shows it.
            let found = slot.kind.load(Ordering::Acquire);
            if !is_kind(found, kind) {
                let again = slot.state.load(Ordering::Acquire);
                if generation_of(again) == generation {
                    return Err(Refusal::Unknown);
                }
                state = again;
                continue;
            }
            match next(state) {
                Next::To(to) => match slot.state.compare_exchange_weak(state, to, Ordering::Acquire, Ordering::Acquire)
                {
                    Ok(_) => return Ok(slot),
                    Err(seen) => state = seen,
                },
                Next::Wait => {
                    std::hint::spin_loop();
                    state = slot.state.load(Ordering::Acquire);
                }
                Next::Refused(uses) => return Err(Refusal::Taken(uses)),
            }
        }
    }

    /// The slot, if it was ever used.
    fn slot(&self, index: u32) -> Option<&Slot> {
        let (chunk, offset) = place(index);
        let slots = self.chunks[chunk].load(Ordering::Acquire);
        // SAFETY: a chunk has a slot for every offset that `place` gives, is made of zeros, which are a slot, and stays.
        (!slots.is_null()).then(|| unsafe { &*slots.add(offset) })
    }

    /// A slot that was never used.
    fn grow(&self) -> Result<u32> {
        let mut index = self.known.load(Ordering::Relaxed);
        loop {
            if index >= MAX_SLOTS {
                return Err(Error::Library(format!(
                    "there are {} objects, there can be no more: free some",
                    self.live()
                )));
            }
            self.make_chunk(place(index).0)?;
            match self.known.compare_exchange_weak(index, index + 1, Ordering::Relaxed, Ordering::Relaxed) {
                Ok(_) => {
                    // Before the slot has a kind: until then it is no object.
                    if let Some(slot) = self.slot(index) {
                        slot.state.store(VACANT, Ordering::Release);
                    }
                    return Ok(index);
                }
                Err(seen) => index = seen,
            }
        }
    }

    fn make_chunk(&self, chunk: usize) -> Result<()> {
        if !self.chunks[chunk].load(Ordering::Acquire).is_null() {
            return Ok(());
        }
        let no_memory = || Error::Library("out of memory: no room for another object".into());
        let layout = Layout::array::<Slot>((FIRST as usize) << chunk).map_err(|_| no_memory())?;
        // SAFETY: the layout is not empty.
        let fresh = unsafe { alloc_zeroed(layout) }.cast::<Slot>();
        if fresh.is_null() {
            return Err(no_memory());
        }
        let none = ptr::null_mut();
        if self.chunks[chunk].compare_exchange(none, fresh, Ordering::AcqRel, Ordering::Acquire).is_err() {
            // SAFETY: another thread was faster; nobody else knows this memory.
            unsafe { dealloc(fresh.cast(), layout) }
        }
        Ok(())
    }

    fn pop(&self) -> Option<u32> {
        let mut head = self.vacant.load(Ordering::Acquire);
        loop {
            let index = ((head & FIRST_VACANT) as u32).checked_sub(1)?;
            let next = self.slot(index)?.next.load(Ordering::Relaxed);
            match self.vacant.compare_exchange_weak(head, changed(head, next), Ordering::Acquire, Ordering::Acquire) {
                Ok(_) => return Some(index),
                Err(seen) => head = seen,
            }
        }
    }

    fn push(&self, index: u32, slot: &Slot) {
        let mut head = self.vacant.load(Ordering::Relaxed);
        loop {
            slot.next.store((head & FIRST_VACANT) as u32, Ordering::Relaxed);
            match self.vacant.compare_exchange_weak(head, changed(head, index + 1), Ordering::AcqRel, Ordering::Relaxed)
            {
                Ok(_) => return,
                Err(seen) => head = seen,
            }
        }
    }
}

/// A slot that is taken; given back if no object comes.
pub struct Vacancy<'a> {
    table: &'a Table,
    slot: &'a Slot,
    index: u32,
}

impl Vacancy<'_> {
    /// Enters the object; the handle is never 0.
    pub fn fill(self, kind: Kind, body: *mut ()) -> usize {
        let Vacancy { table, slot, index } = &self;
        slot.body.store(body, Ordering::Relaxed);
        slot.kind.store(ptr::from_ref(kind).cast_mut(), Ordering::Release);
        // The slot is ours: only its state tells others that it is taken.
        let generation = generation_of(slot.state.load(Ordering::Relaxed));
        slot.state.store(generation << GENERATION_SHIFT, Ordering::Release);
        table.live.fetch_add(1, Ordering::Relaxed);
        let handle = encode(*index, generation);
        std::mem::forget(self);
        handle
    }
}

impl Drop for Vacancy<'_> {
    fn drop(&mut self) {
        self.table.push(self.index, self.slot);
    }
}

const FIRST_VACANT: u64 = u32::MAX as u64;

/// The list with another first slot, and one change more.
fn changed(head: u64, first: u32) -> u64 {
    (head & !FIRST_VACANT).wrapping_add(FIRST_VACANT + 1) | u64::from(first)
}

/// What becomes of a slot.
enum Next {
    To(u64),
    /// Others are about to change it.
    Wait,
    Refused(u64),
}

fn is_kind(found: *mut &'static str, kind: Kind) -> bool {
    // SAFETY: NULL or a `Kind`; two copies of one name may exist.
    ptr::eq(found, kind) || unsafe { found.as_ref() } == Some(kind)
}

/// Why a handle cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    Freed,
    /// No handle, or one of another type.
    Unknown,
    Taken(u64),
}

impl Refusal {
    pub fn error(self, kind: Kind) -> Error {
        Error::State(match self {
            Refusal::Freed => format!("the {kind} has been freed"),
            Refusal::Unknown => format!("the {kind} is no such object"),
            Refusal::Taken(BROKEN) => {
                format!("the {kind} was left behind by an internal error or a lack of memory; it can only be freed")
            }
            Refusal::Taken(MAX_SHARED) => {
                format!("the {kind} is used by {MAX_SHARED} calls at once, there can be no more")
            }
            Refusal::Taken(_) => format!(
                "the {kind} is in use: by another thread, by the call that called back, or by a call that a callback \
                 left without returning"
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Kind = &"a";
    const B: Kind = &"b";

    impl Table {
        fn insert(&self, kind: Kind, body: *mut ()) -> Result<usize> {
            self.reserve().map(|v| v.fill(kind, body))
        }
    }

    fn text<T>(r: Result<T>) -> String {
        r.err().map(|e| format!("{} {e}", e.code())).unwrap_or_default()
    }

    #[test]
    fn stale_handles_stay_stale_when_the_slot_is_used_again() {
        let table = Table::new();
        let mut stale = Vec::new();
        for k in 1..200usize {
            let h = table.insert(A, k as *mut ()).unwrap();
            assert_eq!(table.share(h, A).map(|s| (s.body() as usize, table.unshare(s)).0), Ok(k));
            for &old in &stale {
                assert_eq!(text(table.share(old, A)), "-4 the a has been freed");
                assert_eq!(text(table.remove(old, A)), "-4 the a has been freed");
            }
            assert_eq!(table.remove(h, A), Ok(k as *mut ()));
            stale.push(h);
        }
        assert_eq!((table.live(), table.known.into_inner()), (0, 1));
    }

    #[test]
    fn what_is_no_handle_is_refused() {
        let table = Table::new();
        let h = table.insert(A, ptr::null_mut()).unwrap();
        let local = 5u64;
        let address = ptr::from_ref(&local) as usize;
        let next_slot = h + (1 << INDEX_SHIFT);
        let next_generation = encode(0, 1);
        for wrong in
            [address, address | TOP, 1, 8, h + 1, h + 4, h & !TOP, usize::MAX, next_slot, next_generation, TOP >> 1]
        {
            assert_eq!(text(table.share(wrong, A)), "-4 the a is no such object", "{wrong:x}");
        }
        assert_eq!(text(table.take(h, B)), "-4 the b is no such object");
        assert_eq!(text(table.remove(h, B)), "-4 the b is no such object");
        table.remove(h, A).unwrap();
    }

    #[test]
    fn a_slot_is_retired_with_its_generations() {
        let table = Table::new();
        let first = table.insert(A, ptr::null_mut()).unwrap();
        table.remove(first, A).unwrap();
        let slot = table.slot(0).unwrap();
        slot.state.store((LAST_GENERATION - 2) << GENERATION_SHIFT | VACANT, Ordering::Relaxed);
        let handles: Vec<usize> = (0..3)
            .map(|_| {
                let h = table.insert(A, ptr::null_mut()).unwrap();
                table.remove(h, A).unwrap();
                h
            })
            .collect();
        assert_eq!(handles[0], encode(0, LAST_GENERATION - 2));
        assert_eq!(handles[1], encode(0, LAST_GENERATION - 1));
        assert_eq!(handles[2], encode(1, 0), "the slot is not used again");
        assert!(handles.iter().all(|&h| text(table.share(h, A)).contains("has been freed")));
        assert_eq!(generation_of(slot.state.load(Ordering::Relaxed)), LAST_GENERATION);
    }

    #[test]
    fn a_vacancy_is_given_back() {
        let table = Table::new();
        drop(table.reserve().unwrap());
        drop(table.reserve().unwrap());
        let h = table.insert(A, ptr::null_mut()).unwrap();
        assert_eq!(h, encode(0, 0));
        assert_eq!((table.live(), table.known.load(Ordering::Relaxed)), (1, 1));
    }

    #[test]
    fn uses_exclude_each_other_and_removal() {
        let table = Table::new();
        let h = table.insert(A, ptr::null_mut()).unwrap();
        let alone = table.take(h, A).unwrap();
        for refused in [text(table.take(h, A)), text(table.share(h, A)), text(table.remove(h, A))] {
            assert!(refused.contains("is in use"), "{refused}");
        }
        table.unpin(table.pin(h, A).unwrap());
        table.untake(alone, true);
        for refused in [text(table.take(h, A)), text(table.share(h, A))] {
            assert!(refused.contains("can only be freed"), "{refused}");
        }
        table.unpin(table.pin(h, A).unwrap());
        table.remove(h, A).unwrap();
    }

    #[test]
    fn handles_of_many_objects_differ() {
        let table = Table::new();
        let n = if cfg!(miri) { 300 } else { 20_000 };
        let mut all: Vec<usize> = (0..n).map(|k| table.insert(A, (k + 1) as *mut ()).unwrap()).collect();
        for (k, &h) in all.iter().enumerate() {
            assert_eq!(table.remove(h, A), Ok((k + 1) as *mut ()));
        }
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), n);
    }

    /// Eight threads work on the same few slots: every object is found by its own handle only, and freed once.
    #[test]
    fn threads_insert_use_and_remove() {
        let table = Table::new();
        let rounds = if cfg!(miri) { 30 } else { 20_000 };
        let removed = AtomicI64::new(0);
        std::thread::scope(|scope| {
            for thread in 0..8usize {
                let (table, removed) = (&table, &removed);
                scope.spawn(move || {
                    let kind = if thread % 2 == 0 { A } else { B };
                    let mut stale = 0;
                    for round in 0..rounds {
                        let mark = (thread << 24 | round << 1 | 1) as *mut ();
                        let h = table.insert(kind, mark).unwrap();
                        assert!(table.share(stale, kind).is_err());
                        let slot =
                            if round % 2 == 0 { table.share(h, kind).unwrap() } else { table.take(h, kind).unwrap() };
                        assert_eq!(slot.body(), mark);
                        assert!(table.remove(h, kind).is_err());
                        if round % 2 == 0 {
                            table.unshare(slot)
                        } else {
                            table.untake(slot, false)
                        }
                        assert_eq!(table.remove(h, kind), Ok(mark));
                        assert!(table.remove(h, kind).is_err());
                        removed.fetch_add(1, Ordering::Relaxed);
                        stale = h;
                    }
                });
            }
        });
        assert_eq!((table.live(), removed.into_inner()), (0, 8 * rounds as i64));
        assert!(table.known.into_inner() <= 64);
    }

    /// One handle and eight threads: removal succeeds once, and no use overlaps it.
    #[test]
    fn removal_and_use_race() {
        let table = Table::new();
        for _ in 0..if cfg!(miri) { 5 } else { 500 } {
            let h = table.insert(A, 8 as *mut ()).unwrap();
            let removals = AtomicI64::new(0);
            std::thread::scope(|scope| {
                for thread in 0..8 {
                    let (table, removals) = (&table, &removals);
                    scope.spawn(move || loop {
                        let slot = if thread % 2 == 0 { table.share(h, A).ok() } else { table.pin(h, A).ok() };
                        match slot {
                            Some(slot) => {
                                assert_eq!(slot.body(), 8 as *mut ());
                                if thread % 2 == 0 {
                                    table.unshare(slot)
                                } else {
                                    table.unpin(slot)
                                }
                            }
                            None => return,
                        }
                        if thread < 2 && table.remove(h, A).is_ok() {
                            removals.fetch_add(1, Ordering::Relaxed);
                        }
                    });
                }
            });
            assert_eq!((removals.into_inner(), table.live()), (1, 0));
        }
    }
}
