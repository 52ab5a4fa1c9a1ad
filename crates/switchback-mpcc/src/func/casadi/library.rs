//! Shared libraries: opening, and addresses by name.

use std::path::Path;

use super::elf;
use super::loader::Loaded;
use super::object::Code;
use crate::error::{Error, Result};

/// An open shared library; closed when nobody needs its code any more.
pub(super) struct Library {
    loaded: Loaded,
    path: String,
}

impl Library {
    /// Opens a library, as the system finds it: a path without a folder is searched for in the system's folders.
    ///
    /// # Safety
    /// Opening runs the library's initialisers: it must be one the caller trusts.
    pub(super) unsafe fn open(path: &Path) -> Result<Library> {
        let text = path.to_string_lossy().into_owned();
        if text.contains('\0') {
            return Err(Error::Range("the path of the library contains a NUL character".into()));
        }
        if text.is_empty() {
            // The loader would return the program itself.
            return Err(Error::Range("the path of the library is empty".into()));
        }
        if elf::is_cut_short(path) {
            return Err(Error::Library(format!(
                "{text} cannot be loaded: the file ends before the library does: build or copy it again"
            )));
        }
        // SAFETY: the caller trusts what is run.
        match unsafe { Loaded::open(path) } {
            Ok(loaded) => Ok(Library { loaded, path: text }),
            Err(complaint) => Err(Error::Library(format!("{text} cannot be loaded: {complaint}"))),
        }
    }

    /// The path it was opened by.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Address of the symbol made of these parts, if it is there.
    pub(super) fn symbol(&self, parts: &[&str]) -> Option<Code> {
        self.loaded.symbol(&parts.concat())
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
        let name = match std::env::consts::OS {
            "macos" => "libm.dylib",
            "windows" => "msvcrt.dll",
            _ => "libm.so.6",
        };
        let m = unsafe { Library::open(Path::new(name)) }.unwrap();
        assert!(m.symbol(&["c", "os"]).is_some());
        assert!(m.symbol(&["no_such_function"]).is_none());
        assert!(m.symbol(&["a\0b"]).is_none());
    }
}
