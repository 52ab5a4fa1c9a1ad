//! Shared libraries: opening, and addresses by name.

use std::ffi::{c_void, CStr, CString};
use std::path::Path;

use super::elf;
use super::object::Code;
use crate::error::{Error, Result};

/// An open shared library; closed when nobody needs its code any more.
pub(super) struct Library {
    handle: *mut c_void,
    path: String,
}

// SAFETY: the loader may be used by all threads; the handle is only passed to it.
unsafe impl Send for Library {}
unsafe impl Sync for Library {}

impl Library {
    /// Opens a library, as `dlopen` finds it: a path without a slash is searched for in the system's folders.
    ///
    /// # Safety
    /// Opening runs the library's initialisers: it must be one the caller trusts.
    pub(super) unsafe fn open(path: &Path) -> Result<Library> {
        let text = path.to_string_lossy().into_owned();
        let c_path = CString::new(text.as_bytes())
            .map_err(|_| Error::Range("the path of the library contains a NUL character".into()))?;
        if text.is_empty() {
            // The loader would return the program itself.
            return Err(Error::Range("the path of the library is empty".into()));
        }
        if elf::is_cut_short(path) {
            return Err(Error::Library(format!(
                "{text} cannot be loaded: the file ends before the library does: build or copy it again"
            )));
        }
        // SAFETY: a NUL-terminated text; the caller trusts what is run.
        let handle = unsafe { libc::dlopen(c_path.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        if handle.is_null() {
            return Err(Error::Library(format!("{text} cannot be loaded: {}", last_complaint())));
        }
        Ok(Library { handle, path: text })
    }

    /// The path it was opened by.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Address of the symbol made of these parts, if it is there.
    pub(super) fn symbol(&self, parts: &[&str]) -> Option<Code> {
        let name = CString::new(parts.concat()).ok()?;
        // SAFETY: the handle is open, the name NUL-terminated.
        let address = unsafe { libc::dlsym(self.handle, name.as_ptr()) };
        if address.is_null() {
            return None;
        }
        // SAFETY: not null, and function pointers have the size of data pointers wherever there is dlsym.
        Some(unsafe { std::mem::transmute::<*mut c_void, Code>(address) })
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        // SAFETY: opened by us, closed once.
        unsafe { libc::dlclose(self.handle) };
    }
}

fn last_complaint() -> String {
    // SAFETY: the text is the loader's, of this thread, and copied at once.
    unsafe {
        let text = libc::dlerror();
        match text.is_null() {
            true => "the loader does not say why".into(),
            false => CStr::from_ptr(text).to_string_lossy().into_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_have_a_reason() {
        let open = |p: &str| unsafe { Library::open(Path::new(p)) }.map(|_| ()).unwrap_err();
        assert!(matches!(open(""), Error::Range(_)));
        assert!(matches!(open("a\0b"), Error::Range(_)));
        let text = open("/no/such/library.so").to_string();
        assert!(text.contains("/no/such/library.so cannot be loaded"), "{text}");
        assert!(matches!(open(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")), Error::Library(_)));
    }

    #[test]
    fn symbols_of_the_mathematical_library() {
        let name = if cfg!(target_os = "macos") { "libm.dylib" } else { "libm.so.6" };
        let m = unsafe { Library::open(Path::new(name)) }.unwrap();
        assert!(m.symbol(&["c", "os"]).is_some());
        assert!(m.symbol(&["no_such_function"]).is_none());
        assert!(m.symbol(&["a\0b"]).is_none());
    }
}
