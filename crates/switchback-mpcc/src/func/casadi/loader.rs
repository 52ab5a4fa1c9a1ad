//! The loader of shared libraries of the system, where it has one.

#[cfg(not(any(unix, windows)))]
pub(super) use absent::Loaded;
#[cfg(any(unix, windows))]
pub(super) use present::Loaded;

#[cfg(any(unix, windows))]
mod present {
    use std::error::Error;
    use std::path::Path;

    use super::super::object::Code;

    /// A library in memory; closed when dropped.
    pub(in super::super) struct Loaded(libloading::Library);

    impl Loaded {
        /// Opens a library, or says why not.
        ///
        /// # Safety
        /// Opening runs the library's initialisers.
        pub(in super::super) unsafe fn open(path: &Path) -> Result<Loaded, String> {
            // SAFETY: the caller trusts what is run.
            unsafe { open(path) }.map(Loaded).map_err(|e| match e.source() {
                Some(reason) => format!("{e}: {reason}"),
                None => e.to_string(),
            })
        }

        /// Address of a symbol, if it is there and not null.
        pub(in super::super) fn symbol(&self, name: &str) -> Option<Code> {
            // SAFETY: a pointer to code is as large as one to data wherever there are shared libraries; who calls the code casts
            // it to its type, while the library is open.
            unsafe { self.0.get::<Option<Code>>(name.as_bytes()) }.ok().and_then(|address| *address)
        }
    }

    #[cfg(unix)]
    unsafe fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
        use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
        // SAFETY: as of the caller.
        unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
    }

    #[cfg(windows)]
    unsafe fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
        use libloading::os::windows::{Library, LOAD_WITH_ALTERED_SEARCH_PATH};
        // Libraries that it needs are looked for beside it, as elsewhere; only defined for whole paths.
        let flags = if path.is_absolute() { LOAD_WITH_ALTERED_SEARCH_PATH } else { 0 };
        // SAFETY: as of the caller.
        unsafe { Library::load_with_flags(path, flags) }.map(Into::into)
    }
}

#[cfg(not(any(unix, windows)))]
mod absent {
    use std::path::Path;

    use super::super::object::Code;

    /// A library in memory, of which there is none.
    pub(in super::super) enum Loaded {}

    impl Loaded {
        /// Says that nothing can be loaded.
        ///
        /// # Safety
        /// Always safe; as where there are libraries.
        pub(in super::super) unsafe fn open(_: &Path) -> Result<Loaded, String> {
            Err("this system has no shared libraries: state the function by expressions, or by C functions".into())
        }

        /// No symbol.
        pub(in super::super) fn symbol(&self, _: &str) -> Option<Code> {
            match *self {}
        }
    }
}
