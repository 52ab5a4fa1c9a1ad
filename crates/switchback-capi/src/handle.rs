//! Opaque objects: a Rust value behind a handle, which knows its type and who uses it.
//!
//! Every use goes through [`with_ref`] or [`with_mut`], which look the handle up in the table of live objects
//! ([`super::slots`]; NULL, a freed object, another type and any other pointer are refused without reading what they
//! point to) and borrow at run time: shared uses may overlap, an exclusive one may not. So a callback that calls back
//! into its own object, or a second thread that should not be there, gets [`Error::State`]. A panic inside an exclusive
//! use leaves the object unusable, except for [`free`].

use super::guard::{caught, guard, query, remember, remember_constant};
use super::raw;
use super::slots::{Kind, Refusal, Slot, OBJECTS};
use super::status::swb_status;
use std::cell::{Cell, RefCell, UnsafeCell};
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use switchback::error::{Error, Result};
use switchback::memory;

/// An exported marker type, opaque in the header, and the value behind it.
pub trait Object {
    /// What a handle of the marker type stands for.
    type Value: Send;
    /// Name of the marker type.
    const NAME: &'static str;
}

/// Flag that stops a running call; shared with the value when it is created.
pub type Interrupt = Arc<AtomicBool>;

struct Body<T> {
    interrupt: Interrupt,
    /// The first call that should have completed the object and failed, unless somebody dealt with it.
    failed: Mutex<Option<Error>>,
    value: UnsafeCell<T>,
}

const fn kind<O: Object>() -> Kind {
    &O::NAME
}

/// Number of objects that were created and not freed: for tests that look for leaks. Objects of the library are found
/// through a table, so tools that search the memory for lost pointers do not miss those that were not freed.
#[no_mangle]
pub extern "C" fn swb_live_objects() -> i64 {
    query(0, || OBJECTS.live())
}

/// Make a value and hand it out; `*out` is NULL on failure.
///
/// # Safety
/// `out` is NULL or can be written.
pub unsafe fn create<O: Object>(out: *mut *mut O, make: impl FnOnce(&Interrupt) -> Result<O::Value>) -> Result<()> {
    unsafe { raw::write(out, ptr::null_mut(), "out")? };
    // Room first: what `make` has made may hold something of the caller, which a failure afterwards would give back.
    let vacancy = OBJECTS.reserve()?;
    let mut room: Vec<Body<O::Value>> = Vec::new();
    room.try_reserve_exact(1).map_err(|_| Error::Library(format!("out of memory: no room for a {}", O::NAME)))?;
    let interrupt = Interrupt::default();
    let value = make(&interrupt).inspect_err(|e| note_creation::<O>(e))?;
    // made from the reserve: not kept
    memory::check()?;
    room.push(Body { interrupt, failed: Mutex::new(None), value: UnsafeCell::new(value) });
    let body = Box::into_raw(room.into_boxed_slice()).cast::<Body<O::Value>>();
    unsafe { out.write(ptr::without_provenance_mut(vacancy.fill(kind::<O>(), body.cast()))) };
    Ok(())
}

// --- objects that could not be completed ---------------------------------------------------------------

/// The address of an object, and what forgets its failure.
type Forgettable = (usize, fn(usize));

thread_local! {
    /// The object whose first failure the last failed call of this thread was, and how to forget it.
    static TO_HANDLE: Cell<Option<Forgettable>> = const { Cell::new(None) };
    /// The last object that could not be made on this thread: its type and why.
    static NOT_MADE: RefCell<Option<(&'static str, String)>> = const { RefCell::new(None) };
}

/// Run the body of an export that completes an object: after a failure the object does not run, see [`require`].
pub fn setting<O: Object>(object: *mut O, body: impl FnOnce() -> Result<()>) -> swb_status {
    let _ = TO_HANDLE.try_with(|t| t.set(None));
    guard(|| body().inspect_err(|e| note(object, e)))
}

/// Run the body of an export that works with what an object was completed to.
pub fn running<O: Object>(object: *const O, body: impl FnOnce() -> Result<()>) -> swb_status {
    guard(|| {
        require(object)?;
        body()
    })
}

/// Refuse an object that could not be completed, with the first error. An object that is in use, or is none, is left to the
/// call that follows.
pub fn require<O: Object>(object: *const O) -> Result<()> {
    with_failure(object.addr(), kind::<O>(), |body: &Body<O::Value>| match &*failure(body) {
        None => Ok(()),
        Some(e) => Err(e.with_text(|text| {
            format!("{} is incomplete, because a call on it failed: {text} (swb_error_handled says that a failure was dealt with)", O::NAME)
        })),
    })
    .unwrap_or(Ok(()))
}

fn failure<T>(body: &Body<T>) -> std::sync::MutexGuard<'_, Option<Error>> {
    body.failed.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Look at the failure of an object that nobody uses alone just now; nothing is done with others.
fn with_failure<T, R>(handle: usize, kind: Kind, look: impl FnOnce(&Body<T>) -> R) -> Option<R> {
    let slot = OBJECTS.share(handle, kind).ok()?;
    // SAFETY: callers pass the kind that belongs to `T`.
    let found = look(unsafe { &*slot.body().cast::<Body<T>>() });
    OBJECTS.unshare(slot);
    Some(found)
}

/// Note that a call on the object failed, unless one did before.
fn note<O: Object>(object: *mut O, e: &Error) {
    fn forget<O: Object>(handle: usize) {
        with_failure(handle, kind::<O>(), |body: &Body<O::Value>| *failure(body) = None);
    }
    let first = with_failure(object.addr(), kind::<O>(), |body: &Body<O::Value>| {
        let mut failed = failure(body);
        failed.is_none().then(|| *failed = Some(e.clone())).is_some()
    });
    if first == Some(true) {
        let _ = TO_HANDLE.try_with(|t| t.set(Some((object.addr(), forget::<O>))));
    }
}

fn note_creation<O: Object>(e: &Error) {
    let _ = NOT_MADE.try_with(|n| *n.borrow_mut() = Some((O::NAME, e.to_string())));
}

/// The end of a message about NULL in the place of an object: why the last one of its type could not be made.
pub fn why_null<O: Object>() -> String {
    let said = NOT_MADE.try_with(|n| n.borrow().as_ref().filter(|n| n.0 == O::NAME).map(|n| n.1.clone()));
    said.ok().flatten().map_or_else(String::new, |text| format!("; the last {} could not be made: {text}", O::NAME))
}

/// Say that the failure of the last call of this thread that set or added something was dealt with: the object runs without
/// what failed. Else an object for which such a call failed refuses to run, with the first error.
///
/// Bindings that throw an exception call it there, and programs that go on after a failure. Does nothing after a success.
#[no_mangle]
pub extern "C" fn swb_error_handled() {
    query((), || {
        if let Some((handle, forget)) = TO_HANDLE.try_with(Cell::take).ok().flatten() {
            forget(handle);
        }
    });
}

/// Use the object together with other shared uses.
///
/// # Safety
/// Any value of `object` is allowed: it is looked up, not read. So it is for all functions below.
pub unsafe fn with_ref<O: Object, R>(object: *const O, body: impl FnOnce(&O::Value) -> Result<R>) -> Result<R>
where
    O::Value: Sync,
{
    struct Release(&'static Slot);
    impl Drop for Release {
        fn drop(&mut self) {
            OBJECTS.unshare(self.0);
        }
    }
    let claim = Release(OBJECTS.share(address(object)?, kind::<O>())?);
    body(unsafe { &*body_of::<O>(claim.0).value.get() })
}

/// Use the object alone.
///
/// # Safety
/// As [`with_ref`].
pub unsafe fn with_mut<O: Object, R>(object: *mut O, body: impl FnOnce(&mut O::Value) -> Result<R>) -> Result<R> {
    struct Release(&'static Slot);
    impl Drop for Release {
        fn drop(&mut self) {
            OBJECTS.untake(self.0, std::thread::panicking());
        }
    }
    let claim = Release(OBJECTS.take(address(object)?, kind::<O>())?);
    body(unsafe { &mut *body_of::<O>(claim.0).value.get() })
}

/// Raise the interrupt flag of the object: from any thread or signal handler, also while it is in use. What a signal handler
/// must not do is left out: nothing is allocated, the message of a failure is a constant.
///
/// # Safety
/// As [`with_ref`].
pub unsafe fn interrupt<O: Object>(object: *const O) -> swb_status {
    if object.is_null() {
        remember_constant(c"the object to interrupt is NULL");
        return swb_status::SWB_ERR_NULL;
    }
    match OBJECTS.pin(object.addr(), kind::<O>()) {
        Ok(slot) => {
            unsafe { body_of::<O>(slot) }.interrupt.store(true, Ordering::Relaxed);
            OBJECTS.unpin(slot);
            swb_status::SWB_OK
        }
        Err(refusal) => {
            remember_constant(match refusal {
                Refusal::Freed => c"the object to interrupt has been freed",
                _ => c"the object to interrupt is no such object",
            });
            swb_status::SWB_ERR_STATE
        }
    }
}

/// Free the object; NULL does nothing. An object in use stays, and the last error says so.
///
/// # Safety
/// As [`with_ref`].
pub unsafe fn free<O: Object>(object: *mut O) {
    if object.is_null() {
        return;
    }
    let result = caught(|| {
        let body = OBJECTS.remove(address(object)?, kind::<O>())?;
        drop(unsafe { Box::from_raw(ptr::slice_from_raw_parts_mut(body.cast::<Body<O::Value>>(), 1)) });
        Ok(())
    });
    if let Err(e) = result {
        remember(&e);
    }
}

fn address<O: Object>(object: *const O) -> Result<usize> {
    if object.is_null() {
        return Err(Error::Null(format!("{} is NULL{}", O::NAME, why_null::<O>())));
    }
    Ok(object.addr())
}

/// What is in a slot that is claimed.
unsafe fn body_of<'a, O: Object>(slot: &Slot) -> &'a Body<O::Value> {
    // SAFETY: the kind of the slot was compared with that of `O`.
    unsafe { &*slot.body().cast() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guard::guard;

    struct Counter(());
    impl Object for Counter {
        type Value = (i64, Interrupt);
        const NAME: &'static str = "counter";
    }
    struct Other(());
    impl Object for Other {
        type Value = (i64, Interrupt);
        const NAME: &'static str = "other";
    }

    fn new(start: i64) -> *mut Counter {
        let mut out = ptr::null_mut();
        unsafe { create(&mut out, |i| Ok((start, i.clone()))) }.unwrap();
        out
    }

    #[test]
    fn life_cycle() {
        let c = new(4);
        unsafe {
            with_mut(c, |v| {
                v.0 += 1;
                Ok(())
            })
            .unwrap();
            assert_eq!(with_ref(c, |v| Ok(v.0)), Ok(5));
            assert_eq!(interrupt(c), swb_status::SWB_OK);
            assert!(with_ref(c, |v| Ok(v.1.load(Ordering::Relaxed))).unwrap());
            free(c);
            free(ptr::null_mut::<Counter>());
        }
    }

    #[test]
    fn failed_construction_leaves_null() {
        let mut out = ptr::NonNull::<Counter>::dangling().as_ptr();
        let e = unsafe { create(&mut out, |_| Err(Error::Range("no".into()))) }.unwrap_err();
        assert_eq!((e.code(), out.is_null()), (-3, true));
        assert_eq!(unsafe { create::<Counter>(ptr::null_mut(), |_| unreachable!()) }.unwrap_err().code(), -1);
    }

    #[test]
    fn overlapping_uses() {
        let c = new(0);
        unsafe {
            with_mut(c, |_| {
                assert_eq!(with_mut(c, |_| Ok(())).unwrap_err().code(), -4);
                assert_eq!(with_ref(c, |_| Ok(())).unwrap_err().code(), -4);
                assert_eq!(interrupt(c), swb_status::SWB_OK); // allowed at any time
                free(c); // refused
                Ok(())
            })
            .unwrap();
            with_ref(c, |_| {
                with_ref(c, |_| Ok(()))?;
                assert_eq!(with_mut(c, |_| Ok(())).unwrap_err().code(), -4);
                Ok(())
            })
            .unwrap();
            with_mut(c, |_| Ok(())).unwrap();
            free(c);
        }
    }

    #[test]
    fn wrong_pointers() {
        let c = new(0);
        unsafe {
            assert_eq!(with_ref(c.cast::<Other>(), |_| Ok(())).unwrap_err().code(), -4);
            assert_eq!(with_ref(ptr::null::<Counter>(), |_| Ok(())).unwrap_err().code(), -1);
            free(c.cast::<Other>()); // refused
            free(c);
        }
    }

    #[test]
    fn panic_breaks_the_object_only() {
        let c = new(0);
        unsafe {
            assert_eq!(guard(|| with_mut(c, |_| panic!("defect"))) as i32, -99);
            let e = with_ref(c, |_| Ok(())).unwrap_err();
            assert!(e.code() == -4 && e.to_string().contains("can only be freed"), "{e}");
            free(c);
        }
    }
}
