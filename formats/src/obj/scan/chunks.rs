//! A reader over pieces of text that lie apart.

use std::io::{BufRead, Read, Result};

/// Reads one piece after the other.
pub(super) struct Chunks<'a> {
    rest: std::vec::IntoIter<&'a [u8]>,
    current: &'a [u8],
}

impl<'a> Chunks<'a> {
    pub(super) fn new(chunks: Vec<&'a [u8]>) -> Self {
        Chunks { rest: chunks.into_iter(), current: &[] }
    }
}

impl Read for Chunks<'_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let available = self.fill_buf()?;
        let length = available.len().min(out.len());
        out[..length].copy_from_slice(&available[..length]);
        self.consume(length);
        Ok(length)
    }
}

impl BufRead for Chunks<'_> {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        while self.current.is_empty() {
            match self.rest.next() {
                Some(next) => self.current = next,
                None => break,
            }
        }
        Ok(self.current)
    }

    fn consume(&mut self, amount: usize) {
        self.current = &self.current[amount..];
    }
}
