//! How many threads a call may work on.

use switchback::error::{Error, Result};

/// `n_threads` of the caller, 0 standing for all processors.
pub fn number(n_threads: i64) -> Result<usize> {
    usize::try_from(n_threads).map_err(|_| Error::Range(format!("n_threads is {n_threads}: give 0 or more")))
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_below_zero_are_refused() {
        assert_eq!((number(0), number(8)), (Ok(0), Ok(8)));
        assert_eq!(number(-1).unwrap_err().code(), -3);
    }
}
