//! A reader over separate pieces of text.

use std::io::{BufRead, Read, Result};

use bytes::{Buf, Bytes};

/// Reads the pieces in order, and frees each once it is read.
pub(super) struct Chunks<I> {
    rest: I,
    current: Bytes,
}

impl<I: Iterator<Item = Bytes>> Chunks<I> {
    pub(super) fn new(chunks: I) -> Self {
        Chunks { rest: chunks, current: Bytes::new() }
    }
}

impl<I: Iterator<Item = Bytes>> Read for Chunks<I> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let available = self.fill_buf()?;
        let length = available.len().min(out.len());
        out[..length].copy_from_slice(&available[..length]);
        self.consume(length);
        Ok(length)
    }
}

impl<I: Iterator<Item = Bytes>> BufRead for Chunks<I> {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        while self.current.is_empty() {
            match self.rest.next() {
                Some(next) => self.current = next,
                None => break,
            }
        }
        Ok(&self.current)
    }

    fn consume(&mut self, amount: usize) {
        self.current.advance(amount);
    }
}
