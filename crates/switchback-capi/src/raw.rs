//! Pointers of the caller: checked before they are read, written without a reference to them.

use std::ffi::{c_char, CStr, CString};
use std::{ptr, slice};
use switchback::error::{Error, Result};

/// The array `[n]` at `p`. NULL is an empty array if `n` is 0.
///
/// # Safety
/// `p` is NULL or points to `n` initialised values that nobody writes while the slice lives.
pub unsafe fn slice<'a, T>(p: *const T, n: i64, what: &str) -> Result<&'a [T]> {
    let n = length(n, what)?;
    if n == 0 {
        return Ok(&[]);
    }
    check(p, what)?;
    Ok(unsafe { slice::from_raw_parts(p, n) })
}

/// The value at `p`, copied.
///
/// # Safety
/// `p` is NULL or points to an initialised value.
pub unsafe fn read<T: Copy>(p: *const T, what: &str) -> Result<T> {
    check(p, what)?;
    Ok(unsafe { p.read() })
}

/// Check that `p` can be written: for several outputs, check all before the first is written.
pub fn check<T>(p: *const T, what: &str) -> Result<()> {
    if p.is_null() {
        return Err(Error::Null(format!("{what} is NULL")));
    }
    if !p.is_aligned() {
        return Err(Error::Range(format!("{what} is not aligned to {} bytes", std::mem::align_of::<T>())));
    }
    Ok(())
}

/// Write a required output.
///
/// # Safety
/// `p` is NULL or can be written.
pub unsafe fn write<T>(p: *mut T, value: T, what: &str) -> Result<()> {
    check(p, what)?;
    unsafe { p.write(value) };
    Ok(())
}

/// Write an output that is not wanted if `p` is NULL.
///
/// # Safety
/// `p` is NULL or can be written.
pub unsafe fn write_optional<T>(p: *mut T, value: T) {
    if !p.is_null() && p.is_aligned() {
        unsafe { p.write(value) };
    }
}

/// Check that `count` values can be written to the output `[n]` at `p`: for several outputs, check all before the first
/// is written.
pub fn check_slice<T>(p: *mut T, n: i64, count: usize, what: &str) -> Result<()> {
    if length(n, what)? != count {
        return Err(Error::Dimension(format!("{what} has length {n}, not {count}")));
    }
    if count == 0 {
        return Ok(());
    }
    check(p, what)
}

/// Write `values` to the output `[n]` at `p`; `n` must be their number.
///
/// # Safety
/// `p` is NULL or `n` values can be written there; it does not overlap `values`.
pub unsafe fn write_slice<T: Copy>(p: *mut T, n: i64, values: &[T], what: &str) -> Result<()> {
    check_slice(p, n, values.len(), what)?;
    if values.is_empty() {
        return Ok(());
    }
    unsafe { ptr::copy_nonoverlapping(values.as_ptr(), p, values.len()) };
    Ok(())
}

/// The C string at `p` as UTF-8.
///
/// # Safety
/// `p` is NULL or points to a NUL-terminated text that nobody writes while the result lives.
pub unsafe fn text<'a>(p: *const c_char, what: &str) -> Result<&'a str> {
    check(p, what)?;
    unsafe { CStr::from_ptr(p) }.to_str().map_err(|_| Error::Range(format!("{what} is not UTF-8")))
}

/// Write a text with its final NUL to `[len]` at `buf`, and its length with the NUL to `needed`.
///
/// NULL with length 0 asks for the length only. A short buffer is an error and stays untouched.
///
/// # Safety
/// `buf` is NULL or `len` bytes can be written there; `needed` is NULL or can be written.
pub unsafe fn write_text(text: &[u8], buf: *mut c_char, len: i64, needed: *mut i64) -> Result<()> {
    let capacity = length(len, "the buffer")?;
    let wanted = text.len() + 1;
    unsafe { write_optional(needed, wanted as i64) };
    if capacity == 0 && buf.is_null() {
        return Ok(());
    }
    check(buf, "the buffer")?;
    if capacity < wanted {
        return Err(Error::Dimension(format!("the buffer has length {len}, the text needs {wanted}")));
    }
    unsafe {
        ptr::copy_nonoverlapping(text.as_ptr().cast::<c_char>(), buf, text.len());
        buf.add(text.len()).write(0);
    }
    Ok(())
}

/// A C string of any text; an inner NUL ends it.
pub fn c_string(text: &str) -> CString {
    let end = text.find('\0').unwrap_or(text.len());
    CString::new(&text[..end]).unwrap_or_default()
}

/// A length that an array can have.
pub fn length(n: i64, what: &str) -> Result<usize> {
    // More bytes than that do not exist for any of our types.
    const LIMIT: i64 = i64::MAX / 64;
    if !(0..=LIMIT).contains(&n) {
        return Err(Error::Dimension(format!("{what} has length {n}")));
    }
    Ok(n as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn null_is_an_empty_array_only() {
        unsafe {
            assert!(slice::<f64>(ptr::null(), 0, "x").unwrap().is_empty());
            assert_eq!(slice::<f64>(ptr::null(), 1, "x").unwrap_err().code(), -1);
            assert_eq!(slice::<f64>(ptr::null(), -1, "x").unwrap_err().code(), -2);
            let x = [1.0, 2.0];
            let odd = x.as_ptr().cast::<u8>().wrapping_add(1).cast::<f64>();
            assert_eq!(slice(odd, 1, "x").unwrap_err().code(), -3);
            assert_eq!(slice(x.as_ptr(), 2, "x").unwrap(), x);
            assert_eq!(slice(x.as_ptr(), i64::MAX, "x").unwrap_err().code(), -2);
        }
    }

    #[test]
    fn outputs_are_untouched_on_failure() {
        let mut y = [7.0; 3];
        unsafe {
            assert_eq!(write_slice(y.as_mut_ptr(), 3, &[1.0, 2.0], "y").unwrap_err().code(), -2);
            assert_eq!(y, [7.0; 3]);
            write_slice(y.as_mut_ptr(), 2, &[1.0, 2.0], "y").unwrap();
            write_slice::<f64>(ptr::null_mut(), 0, &[], "y").unwrap();
        }
        assert_eq!(y, [1.0, 2.0, 7.0]);
    }

    #[test]
    fn texts() {
        unsafe {
            assert_eq!(text(c"tol".as_ptr(), "name").unwrap(), "tol");
            assert_eq!(text(c"\xff".as_ptr(), "name").unwrap_err().code(), -3);
            assert_eq!(text(ptr::null(), "name").unwrap_err().code(), -1);
        }
        assert_eq!(c_string("a\0b").as_c_str(), c"a");
    }
}
