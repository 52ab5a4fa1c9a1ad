//! How many threads a call may work on.

use crate::error::{Error, Result};

/// Threads for `n_threads` of the caller, 0 standing for all processors. One if a function may only be called by the
/// thread that called the library.
pub fn number(n_threads: i64, serial: bool) -> Result<usize> {
    let n =
        usize::try_from(n_threads).map_err(|_| Error::Range(format!("n_threads is {n_threads}: give 0 or more")))?;
    Ok(match n {
        _ if serial => 1,
        0 => std::thread::available_parallelism().map_or(1, |n| n.get()),
        n => n,
    })
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn serial_functions_have_one_thread() {
        assert_eq!((number(0, true), number(8, true), number(8, false)), (Ok(1), Ok(1), Ok(8)));
        assert!(number(0, false).is_ok_and(|n| n >= 1));
        assert_eq!(number(-1, true).unwrap_err().code(), -3);
    }
}
