//! Opaque objects: a Rust value behind a pointer that knows its type and who uses it.
//!
//! Every use goes through [`with_ref`] or [`with_mut`], which check the pointer (NULL, another type, a
//! freed object as far as that can be seen) and borrow at run time: shared uses may overlap, an
//! exclusive one may not. So a callback that calls back into its own object, or a second thread that
//! should not be there, gets [`Error::State`]. A panic inside an exclusive use leaves the object
//! unusable, except for [`free`].

use super::guard::{caught, remember};
use super::raw;
use crate::error::{Error, Result};
use std::cell::UnsafeCell;
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};
use std::sync::Arc;

/// An exported marker type, opaque in the header, and the value behind it.
pub trait Object {
    /// What a pointer to the marker really points to.
    type Value: Send;
    /// Name of the marker type.
    const NAME: &'static str;
}

/// Flag that stops a running call; shared with the value when it is created.
pub type Interrupt = Arc<AtomicBool>;

struct Handle<T> {
    magic: AtomicU64,
    /// Number of shared uses, or [`EXCLUSIVE`], or [`BROKEN`].
    uses: AtomicI32,
    interrupt: Interrupt,
    value: UnsafeCell<T>,
}

const EXCLUSIVE: i32 = -1;
const BROKEN: i32 = -2;
const FREED: u64 = 0xdead_f4ee_0000_0001;

/// Hash of the type's name (FNV-1a).
const fn magic(name: &str) -> u64 {
    let (bytes, mut hash, mut i) = (name.as_bytes(), 0xcbf2_9ce4_8422_2325_u64, 0);
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0100_0000_01b3);
        i += 1;
    }
    hash
}

/// Make a value and hand it out; `*out` is NULL on failure.
///
/// # Safety
/// `out` is NULL or can be written.
pub unsafe fn create<O: Object>(out: *mut *mut O, make: impl FnOnce(&Interrupt) -> Result<O::Value>) -> Result<()> {
    unsafe { raw::write(out, ptr::null_mut(), "out")? };
    let interrupt = Interrupt::default();
    let value = make(&interrupt)?;
    let handle = Box::new(Handle {
        magic: AtomicU64::new(magic(O::NAME)),
        uses: AtomicI32::new(0),
        interrupt,
        value: UnsafeCell::new(value),
    });
    unsafe { out.write(Box::into_raw(handle).cast()) };
    Ok(())
}

/// Use the object together with other shared uses.
///
/// # Safety
/// `object` is NULL or comes from [`create`] and is not freed during the call.
pub unsafe fn with_ref<O: Object, R>(object: *const O, body: impl FnOnce(&O::Value) -> Result<R>) -> Result<R>
where
    O::Value: Sync,
{
    let handle = unsafe { check(object)? };
    let claim = |uses: i32| (uses >= 0).then_some(uses + 1);
    if let Err(uses) = handle.uses.fetch_update(Ordering::Acquire, Ordering::Relaxed, claim) {
        return Err(taken::<O>(uses));
    }
    struct Release<'a>(&'a AtomicI32);
    impl Drop for Release<'_> {
        fn drop(&mut self) {
            self.0.fetch_sub(1, Ordering::Release);
        }
    }
    let _release = Release(&handle.uses);
    body(unsafe { &*handle.value.get() })
}

/// Use the object alone.
///
/// # Safety
/// `object` is NULL or comes from [`create`] and is not freed during the call.
pub unsafe fn with_mut<O: Object, R>(object: *mut O, body: impl FnOnce(&mut O::Value) -> Result<R>) -> Result<R> {
    let handle = unsafe { check(object)? };
    let claimed = handle.uses.compare_exchange(0, EXCLUSIVE, Ordering::Acquire, Ordering::Relaxed);
    if let Err(uses) = claimed {
        return Err(taken::<O>(uses));
    }
    struct Release<'a>(&'a AtomicI32);
    impl Drop for Release<'_> {
        fn drop(&mut self) {
            let uses = if std::thread::panicking() { BROKEN } else { 0 };
            self.0.store(uses, Ordering::Release);
        }
    }
    let _release = Release(&handle.uses);
    body(unsafe { &mut *handle.value.get() })
}

/// Raise the interrupt flag of the object: from any thread or signal handler, also while it is in use.
///
/// # Safety
/// `object` is NULL or comes from [`create`] and is not freed during the call.
pub unsafe fn interrupt<O: Object>(object: *const O) -> Result<()> {
    unsafe { check(object)? }.interrupt.store(true, Ordering::Relaxed);
    Ok(())
}

/// Free the object; NULL does nothing. An object in use stays, and the last error says so.
///
/// # Safety
/// `object` is NULL or comes from [`create`] and is not used afterwards.
pub unsafe fn free<O: Object>(object: *mut O) {
    if object.is_null() {
        return;
    }
    let result = caught(|| {
        let handle = unsafe { check(object)? };
        let claim = |uses: i32| (uses == 0 || uses == BROKEN).then_some(EXCLUSIVE);
        if let Err(uses) = handle.uses.fetch_update(Ordering::Acquire, Ordering::Relaxed, claim) {
            return Err(taken::<O>(uses));
        }
        handle.magic.store(FREED, Ordering::Relaxed);
        drop(unsafe { Box::from_raw(object.cast::<Handle<O::Value>>()) });
        Ok(())
    });
    if let Err(e) = result {
        remember(&e);
    }
}

unsafe fn check<'a, O: Object>(object: *const O) -> Result<&'a Handle<O::Value>> {
    let p = object.cast::<Handle<O::Value>>();
    raw::check(p, O::NAME)?;
    // Only the first word is read before the type is known.
    let found = unsafe { &*ptr::addr_of!((*p).magic) }.load(Ordering::Relaxed);
    if found != magic(O::NAME) {
        let why = if found == FREED { "has been freed" } else { "is no such object" };
        return Err(Error::State(format!("the {} {why}", O::NAME)));
    }
    Ok(unsafe { &*p })
}

fn taken<O: Object>(uses: i32) -> Error {
    Error::State(match uses {
        BROKEN => format!("the {} was left behind by an internal error; it can only be freed", O::NAME),
        _ => format!("the {} is in use, by another thread or by the call that called back", O::NAME),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capi::guard::guard;

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
            interrupt(c).unwrap();
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
                interrupt(c)?; // allowed at any time
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
