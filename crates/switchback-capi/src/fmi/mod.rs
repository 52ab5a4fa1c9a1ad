//! The functions of the standard FMI around models, versions 2.0 and 3.0: the library is the binary of the units that it writes.
//!
//! Names and types are those of the standard, so they are no part of `switchback.h`; macros write them out, which the header generator does not
//! see. Instances are pointers that importers hand back, as the standard has it.

// names of the standard
#![allow(non_snake_case)]

mod three;
mod two;

use super::guard::{caught, remember};
use std::ffi::{c_char, CStr, CString};
use std::path::PathBuf;
use switchback::error::{Error, Result};
use switchback::fmu::Unit;

/// Writes the functions of the standard out.
macro_rules! exports {
    ($(fn $name:ident($($argument:ident: $type:ty),* $(,)?) -> $result:ty $body:block)*) => {
        $(
            #[no_mangle]
            pub unsafe extern "C" fn $name($($argument: $type),*) -> $result $body
        )*
    };
}
/// The same for functions that no unit of the library has: they say so.
macro_rules! refused {
    ($($name:ident($($argument:ident: $type:ty),* $(,)?);)*) => {
        $(
            #[no_mangle]
            pub unsafe extern "C" fn $name(c: *mut Instance, $($argument: $type),*) -> Status {
                $(let _ = $argument;)*
                unsafe { instance(c, |_| Err(Error::Unsupported(concat!(stringify!($name), " is not known").into()))) }
            }
        )*
    };
}
pub(crate) use {exports, refused};

/// Results of the standard.
#[repr(i32)]
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Status {
    Ok = 0,
    Discard = 2,
    Error = 3,
}

/// A text of the importer.
unsafe fn text(p: *const c_char, what: &str) -> Result<String> {
    if p.is_null() {
        return Err(Error::Range(format!("{what} is NULL")));
    }
    Ok(unsafe { CStr::from_ptr(p) }.to_string_lossy().into_owned())
}

/// A value of the importer's array for every value reference of it.
unsafe fn pairs<'a>(references: *const u32, n: usize, values: *const f64) -> impl Iterator<Item = (usize, f64)> + 'a {
    (0..n).map(move |i| unsafe { (*references.add(i) as usize, *values.add(i)) })
}

unsafe fn set(unit: &mut Unit, references: *const u32, n: usize, values: *const f64) -> Result<()> {
    unsafe { pairs(references, n, values) }.try_for_each(|(r, v)| unit.set(r, v))
}

unsafe fn get(unit: &mut Unit, references: *const u32, n: usize, values: *mut f64) -> Result<()> {
    for i in 0..n {
        unsafe { *values.add(i) = unit.get(*references.add(i) as usize)? };
    }
    Ok(())
}

/// A list of the importer with this many places.
unsafe fn list<'a>(values: *mut f64, n: usize, wanted: usize) -> Result<&'a mut [f64]> {
    if n != wanted {
        return Err(Error::Dimension(format!("{n} values where there are {wanted}")));
    }
    if n == 0 {
        return Ok(&mut []);
    }
    if values.is_null() {
        return Err(Error::Range("a list is NULL".into()));
    }
    Ok(unsafe { std::slice::from_raw_parts_mut(values, n) })
}

/// The path of a folder, which version 2.0 gives as a resource of the scheme `file`.
fn folder(location: &str) -> Result<PathBuf> {
    let Some(rest) = location.strip_prefix("file:") else { return Ok(PathBuf::from(location)) };
    let path = match rest.strip_prefix("//") {
        Some(r) => r.find('/').map_or("", |k| &r[k..]),
        None => rest,
    };
    let (bytes, mut out, mut i) = (path.as_bytes(), Vec::new(), 0);
    while i < bytes.len() {
        let code =
            (bytes[i] == b'%').then(|| path.get(i + 1..i + 3).and_then(|h| u8::from_str_radix(h, 16).ok())).flatten();
        out.push(code.unwrap_or(bytes[i]));
        i += if code.is_some() { 3 } else { 1 };
    }
    let path = String::from_utf8(out).map_err(|_| Error::Range(format!("'{location}' is no path in UTF-8")))?;
    // "/C:/folder"
    let drive = cfg!(windows) && path.as_bytes().get(2) == Some(&b':');
    Ok(PathBuf::from(if drive { &path[1..] } else { &path[..] }))
}

/// Runs the body of a function: the message of an error goes to `log`.
fn run(log: impl FnOnce(&CStr), body: impl FnOnce() -> Result<Status>) -> Status {
    match caught(body) {
        Ok(status) => status,
        Err(e) => {
            remember(&e);
            let message = CString::new(e.to_string().replace('\0', " ")).unwrap_or_default();
            log(&message);
            Status::Error
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_paths_or_resources() {
        for (location, path) in [
            ("file:///tmp/a%20b/resources", "/tmp/a b/resources"),
            ("file:/tmp/r", "/tmp/r"),
            ("file://localhost/tmp/r", "/tmp/r"),
            ("/tmp/100%", "/tmp/100%"),
        ] {
            assert_eq!(folder(location).unwrap(), PathBuf::from(path));
        }
    }
}
