//! Archives of the format ZIP, whose files are stored as they are (PKWARE, APPNOTE 6.3, sections 4.3.6 to 4.3.16).

use crate::error::{Error, Result};
use crate::memory;

/// An archive in memory.
#[derive(Default)]
pub(super) struct Archive {
    bytes: Vec<u8>,
    /// The list of files at the end.
    directory: Vec<u8>,
    files: u16,
}

/// The cyclic redundancy check of 32 bits.
fn check_sum(bytes: &[u8]) -> u32 {
    let mut table = [0u32; 256];
    for (i, entry) in table.iter_mut().enumerate() {
        *entry = (0..8).fold(i as u32, |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 });
    }
    !bytes.iter().fold(!0u32, |c, b| table[((c ^ u32::from(*b)) & 255) as usize] ^ (c >> 8))
}

impl Archive {
    /// Adds a file; parts of its path are separated by slashes.
    ///
    /// # Errors
    /// [`Error::Range`] where the format has no room for it.
    pub(super) fn add(&mut self, path: &str, content: &[u8]) -> Result<()> {
        let large = |_| Error::Range("a unit has at most 4 GB".into());
        let size = u32::try_from(content.len()).map_err(large)?;
        let at = u32::try_from(self.bytes.len()).map_err(large)?;
        memory::room(&mut self.bytes, content.len() + path.len() + 64);
        // version needed, flags (names in UTF-8), stored, first of January 1980
        let mut common = [20u16, 0x800, 0, 0, 0x21].map(u16::to_le_bytes).concat();
        for v in [check_sum(content), size, size] {
            common.extend_from_slice(&v.to_le_bytes());
        }
        common.extend_from_slice(&(path.len() as u16).to_le_bytes());
        common.extend_from_slice(&0u16.to_le_bytes());
        for part in [&b"PK\x03\x04"[..], &common, path.as_bytes(), content] {
            self.bytes.extend_from_slice(part);
        }
        // made by version 2.0 for Unix, no comment, first disk, files that may be run
        let (made, mode) = ((3u16 << 8 | 20).to_le_bytes(), (0o100_755u32 << 16).to_le_bytes());
        for part in [&b"PK\x01\x02"[..], &made, &common, &[0; 6], &mode, &at.to_le_bytes(), path.as_bytes()] {
            self.directory.extend_from_slice(part);
        }
        self.files += 1;
        Ok(())
    }

    /// The whole archive.
    ///
    /// # Errors
    /// [`Error::Range`] where it is too large for the format.
    pub(super) fn finish(mut self) -> Result<Vec<u8>> {
        let large = |_| Error::Range("a unit has at most 4 GB".into());
        let (at, size) = (u32::try_from(self.bytes.len()).map_err(large)?, self.directory.len() as u32);
        self.bytes.append(&mut self.directory);
        let files = self.files.to_le_bytes();
        for part in [&b"PK\x05\x06\0\0\0\0"[..], &files, &files, &size.to_le_bytes(), &at.to_le_bytes(), &[0; 2]] {
            self.bytes.extend_from_slice(part);
        }
        Ok(self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_sum_is_that_of_the_standard() {
        assert_eq!(check_sum(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn an_archive_ends_with_its_directory() {
        let mut a = Archive::default();
        a.add("one/two.txt", b"content").unwrap();
        let bytes = a.finish().unwrap();
        assert_eq!(bytes.len(), 30 + 11 + 7 + 46 + 11 + 22);
        assert_eq!(&bytes[..4], b"PK\x03\x04");
        assert_eq!(&bytes[48..52], b"PK\x01\x02");
    }
}
