//! [`Entry`]: a result that is being read from the store.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::PathBuf;

use blake3::{Hash, Hasher};
use serde::{Deserialize, Serialize};

/// First line of each file.
pub(super) const MAGIC: &str = "raykiln.cache/1\n";
/// The most bytes of the list of parts.
const MOST_LISTED: u64 = 1 << 24;

/// A part of a result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Its name.
    pub name: String,
    /// Its length.
    pub bytes: u64,
}

/// A result that is being read: its parts one after the other.
#[derive(Debug)]
pub struct Entry {
    pub(super) path: PathBuf,
    /// The parts in their order.
    pub parts: Vec<Part>,
    expected: Hash,
    rest: Hashing<BufReader<File>>,
}

/// Reads, and hashes what it read.
#[derive(Debug)]
struct Hashing<R> {
    from: R,
    hasher: Hasher,
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.from.read(buffer)?;
        self.hasher.update(&buffer[..count]);
        Ok(count)
    }
}

fn damaged(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_owned())
}

impl Entry {
    /// Opens a file of the store.
    ///
    /// # Errors
    /// Fails if the file cannot be read or is not of this form; the kind is then `InvalidData`.
    pub(super) fn open(path: PathBuf) -> io::Result<Entry> {
        let mut file = BufReader::with_capacity(1 << 16, File::open(&path)?);
        let mut head = vec![0; MAGIC.len() + 65];
        file.read_exact(&mut head).map_err(|_| damaged("it is too short"))?;
        let hash = head.strip_prefix(MAGIC.as_bytes()).and_then(|hash| Hash::from_hex(hash.trim_ascii_end()).ok());
        let expected = hash.ok_or_else(|| damaged("it does not start as a file of the cache does"))?;
        let mut hasher = Hasher::new();
        let mut list = Vec::new();
        (&mut file).take(MOST_LISTED).read_until(b'\n', &mut list)?;
        hasher.update(&list);
        let parts = serde_json::from_slice(&list).map_err(|_| damaged("its list of parts cannot be read"))?;
        Ok(Entry { path, parts, expected, rest: Hashing { from: file, hasher } })
    }

    /// Writes the bytes of the next part of this length to `to`.
    ///
    /// # Errors
    /// Fails if the bytes cannot be read, or cannot be written.
    pub fn copy(&mut self, bytes: u64, to: &mut dyn Write) -> io::Result<()> {
        let copied = io::copy(&mut (&mut self.rest).take(bytes), to)?;
        if copied == bytes { Ok(()) } else { Err(damaged("it is cut short")) }
    }

    /// Reads all parts; whether they are as they were stored.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub(super) fn check(mut self) -> io::Result<bool> {
        let bytes = self.parts.iter().fold(0_u64, |sum, part| sum.saturating_add(part.bytes));
        self.copy(bytes, &mut io::sink())?;
        self.finish()
    }

    /// Whether the bytes that were read are those that were stored; to be called after all parts.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub fn finish(mut self) -> io::Result<bool> {
        let more = io::copy(&mut self.rest, &mut io::sink())?;
        Ok(more == 0 && self.rest.hasher.finalize() == self.expected)
    }
}
