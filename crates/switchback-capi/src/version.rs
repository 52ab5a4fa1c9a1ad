//! Versions: of the library, of its ABI, and whether a header fits.

use super::guard::guard;
use super::status::swb_status;
use std::ffi::c_char;
use switchback::error::Error;

/// Number in a version string of cargo, at compile time.
const fn number(text: &str) -> i32 {
    let (bytes, mut n, mut i) = (text.as_bytes(), 0, 0);
    while i < bytes.len() {
        n = 10 * n + (bytes[i] - b'0') as i32;
        i += 1;
    }
    n
}

const MAJOR: i32 = number(env!("CARGO_PKG_VERSION_MAJOR"));
const MINOR: i32 = number(env!("CARGO_PKG_VERSION_MINOR"));

/// Version of the library, such as "0.2.0". Static.
#[no_mangle]
pub extern "C" fn swb_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Number of the ABI: libraries of the same number replace each other. The number in the SONAME:
/// before 1.0 the minor version, from then on 1000 times the major version.
#[no_mangle]
pub extern "C" fn swb_abi_version() -> i32 {
    if MAJOR == 0 {
        MINOR
    } else {
        1000 * MAJOR
    }
}

/// Compares this library with the header of the given version that a program was compiled with.
///
/// Call as swb_check_version(SWB_VERSION_MAJOR, SWB_VERSION_MINOR). Before 1.0 both numbers must be
/// equal; from then on the major ones, and the library must not be older.
///
/// @return SWB_OK; SWB_ERR_UNSUPPORTED with both versions in the message
#[no_mangle]
pub extern "C" fn swb_check_version(major: i32, minor: i32) -> swb_status {
    guard(|| {
        if serves((MAJOR, MINOR), (major, minor)) {
            return Ok(());
        }
        Err(Error::Unsupported(format!(
            "the program was compiled with the header of version {major}.{minor}, the library is {}",
            env!("CARGO_PKG_VERSION")
        )))
    })
}

fn serves(library: (i32, i32), header: (i32, i32)) -> bool {
    library.0 == header.0 && if library.0 == 0 { library.1 == header.1 } else { library.1 >= header.1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions() {
        assert_eq!(swb_check_version(MAJOR, MINOR), swb_status::SWB_OK);
        assert_eq!(swb_check_version(MAJOR, MINOR + 1), swb_status::SWB_ERR_UNSUPPORTED);
        assert!(serves((1, 4), (1, 2)) && !serves((1, 4), (1, 5)) && !serves((2, 0), (1, 0)));
        assert!(!serves((0, 4), (0, 3)));
    }
}
