//! Shared libraries that were cut short: the loader of the system maps them all the same, and reading behind the end of
//! the file ends the process.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Does the file say that it is longer than it is? Looks at ELF files of 64 bits, little endian (System V ABI, chapter 4);
/// anything else, and files that cannot be read, are left to the loader.
pub(super) fn is_cut_short(path: &Path) -> bool {
    File::open(path).ok().and_then(|mut file| longest_end(&mut file)).is_some_and(|(end, length)| end > length)
}

/// The largest end of a segment or of the table of sections, and the length of the file.
fn longest_end(file: &mut File) -> Option<(u64, u64)> {
    const HEADER: usize = 64;
    const SEGMENT: usize = 56;
    let length = file.metadata().ok().filter(std::fs::Metadata::is_file)?.len();
    let mut header = [0u8; HEADER];
    let read = read_up_to(file, &mut header)?;
    if read < 6 || header[..4] != *b"\x7fELF" || header[4] != 2 || header[5] != 1 {
        return None;
    }
    if read < HEADER {
        return Some((HEADER as u64, length));
    }
    let half = |at: usize| u64::from(u16::from_le_bytes([header[at], header[at + 1]]));
    let (segments, sections) = (word(&header, 32), word(&header, 40));
    let (segment_size, n_segments) = (half(54), half(56));
    let mut end = sections.saturating_add(half(58) * half(60));
    end = end.max(segments.saturating_add(segment_size * n_segments));
    if end > length || segment_size != SEGMENT as u64 {
        return Some((end, length));
    }
    file.seek(SeekFrom::Start(segments)).ok()?;
    for _ in 0..n_segments {
        let mut segment = [0u8; SEGMENT];
        file.read_exact(&mut segment).ok()?;
        end = end.max(word(&segment, 8).saturating_add(word(&segment, 32)));
    }
    Some((end, length))
}

fn word(bytes: &[u8], at: usize) -> u64 {
    bytes[at..at + 8].iter().rev().fold(0, |v, &b| v << 8 | u64::from(b))
}

fn read_up_to(file: &mut File, buffer: &mut [u8]) -> Option<usize> {
    let mut n = 0;
    while n < buffer.len() {
        match file.read(&mut buffer[n..]).ok()? {
            0 => break,
            k => n += k,
        }
    }
    Some(n)
}

#[cfg(test)]
#[cfg(all(target_os = "linux", target_pointer_width = "64", target_endian = "little"))]
mod tests {
    use super::*;

    #[test]
    fn every_beginning_of_a_library_is_noticed() {
        let own = std::env::current_exe().unwrap();
        assert!(!is_cut_short(&own));
        assert!(!is_cut_short(Path::new("/no/such/file")));
        let whole = std::fs::metadata(&own).unwrap().len();
        let mut head = vec![0u8; 5000];
        File::open(&own).unwrap().read_exact(&mut head).unwrap();
        let path = std::env::temp_dir().join(format!("switchback-cut-{}", std::process::id()));
        for n in [6, 63, 64, 100, 1000, 5000] {
            std::fs::write(&path, &head[..n]).unwrap();
            assert!(is_cut_short(&path), "{n} of {whole} bytes");
        }
        std::fs::write(&path, "no library").unwrap();
        assert!(!is_cut_short(&path));
        std::fs::remove_file(&path).unwrap();
    }
}
