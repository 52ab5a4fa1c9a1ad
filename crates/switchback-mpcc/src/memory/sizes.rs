//! Sizes that come from outside, and how large they may be: one place for the C interface, documents and constructors.

use crate::error::{Error, Result};

/// States, controls, parameters, outputs, modes, control stages, finite elements, steps, starts: more of any of them is no
/// problem this library could be meant for.
pub const MOST: usize = 1 << 20;

/// Variables and rows of a program, nodes of a graph: the factorisation and the graphs count in 32 bits.
pub const INDEX: usize = i32::MAX as usize;

/// Entries of a matrix or an array that nobody wrote down: products of sizes.
pub const ENTRIES: usize = 1 << 26;

/// A size up to [`MOST`].
pub fn size(n: i64, what: &str) -> Result<usize> {
    up_to(n, MOST, what)
}

/// A size up to [`INDEX`].
pub fn index(n: i64, what: &str) -> Result<usize> {
    up_to(n, INDEX, what)
}

fn up_to(n: i64, most: usize, what: &str) -> Result<usize> {
    match usize::try_from(n) {
        Ok(n) if n <= most => Ok(n),
        _ => Err(Error::Dimension(format!("{what} is {n}: it must lie between 0 and {most}"))),
    }
}

/// Refuses sizes beyond [`MOST`].
pub fn check(what: &str, all: &[usize]) -> Result<()> {
    match all.iter().find(|&&n| n > MOST) {
        Some(n) => Err(Error::Dimension(format!("{what}: {n} is too large, up to {MOST}"))),
        None => Ok(()),
    }
}

/// The product of sizes up to [`ENTRIES`]; `what` has so many values.
pub fn entries(what: &str, sizes: &[usize]) -> Result<usize> {
    let product = sizes.iter().try_fold(1_usize, |p, n| p.checked_mul(*n)).filter(|&p| p <= ENTRIES);
    product.ok_or_else(|| {
        let sizes: Vec<String> = sizes.iter().map(usize::to_string).collect();
        Error::Dimension(format!("{what}: {} entries, up to {ENTRIES} are possible", sizes.join(" times ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_named() {
        assert_eq!(size(1 << 20, "nx"), Ok(1 << 20));
        for n in [-1, (1 << 20) + 1, i64::MAX, i64::MIN] {
            let e = size(n, "nx").unwrap_err();
            assert!(e.code() == -2 && e.to_string().contains("nx") && e.to_string().contains("1048576"), "{e}");
            assert!(index(n, "n").is_err() == (n != (1 << 20) + 1));
        }
        assert!(check("stages", &[0, 1 << 20]).is_ok() && check("stages", &[1, usize::MAX]).is_err());
        assert_eq!(entries("m", &[1 << 13, 1 << 13]), Ok(1 << 26));
        assert_eq!(entries("m", &[]), Ok(1));
        for sizes in [&[1 << 14, 1 << 13][..], &[usize::MAX, usize::MAX], &[usize::MAX, 2]] {
            assert!(entries("m", sizes).unwrap_err().to_string().contains("67108864"));
        }
    }
}
