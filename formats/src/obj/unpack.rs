//! Files compressed by gzip (`.obj.gz`).

use std::io::{Error, Read, Result};

use flate2::read::MultiGzDecoder;

/// Unpacked size in bytes that any file may have.
const FREE: u64 = 256 << 20;

/// Above [`FREE`]: unpacked size over packed size. Texts of numbers are 3 to 20 times as large as their archives, and
/// deflate cannot exceed 1032 (P. Deutsch, "DEFLATE Compressed Data Format Specification", RFC 1951, 1996).
const MOST_RATIO: u64 = 100;

/// Returns the contents of a file of `size` bytes, unpacked if it begins as gzip does.
pub(super) fn unpacked<'a>(mut file: impl Read + 'a, size: u64) -> Result<Box<dyn Read + 'a>> {
    let mut start = Vec::new();
    (&mut file).take(2).read_to_end(&mut start)?;
    let packed = start == [0x1F, 0x8B];
    let whole = std::io::Cursor::new(start).chain(file);
    if !packed {
        return Ok(Box::new(whole));
    }
    Ok(Box::new(Limited { inner: MultiGzDecoder::new(whole), left: FREE.max(size.saturating_mul(MOST_RATIO)) }))
}

/// Fails after a number of bytes.
struct Limited<R> {
    inner: R,
    left: u64,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let length = self.inner.read(out)?;
        let Some(left) = self.left.checked_sub(length as u64) else {
            return Err(Error::other("unpacks to more than 256 MiB and 100 times its size, as no scene does"));
        };
        self.left = left;
        Ok(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_that_unpacks_to_more_than_allowed_fails() {
        let read = |left: u64| Limited { inner: &[0u8; 100][..], left }.read_to_end(&mut Vec::new());
        assert_eq!(read(100).ok(), Some(100));
        assert!(read(99).is_err_and(|error| error.to_string().contains("256 MiB")));
    }

    #[test]
    fn short_and_plain_files_are_read_as_they_are() {
        for text in [&b""[..], b"v", b"v 0 0 0\n"] {
            let mut out = Vec::new();
            unpacked(text, 1).and_then(|mut file| file.read_to_end(&mut out)).expect("memory");
            assert_eq!(out, text);
        }
    }
}
