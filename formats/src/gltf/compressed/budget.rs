//! How many bytes a file may decompress to.

use crate::Document;

/// Bytes that any file may decompress to: 256 MiB.
const ALWAYS: u64 = 1 << 28;
/// Bytes per byte of the file beyond that. Whole files of either codec stay far below it; only constant attributes reach
/// it, which no codec bounds.
const RATIO: u64 = 256;

/// What a file may still decompress to, so that a small one cannot exhaust memory, however often it refers to the same
/// compressed bytes.
pub(super) struct Budget {
    left: u64,
    total: u64,
}

impl Budget {
    /// The budget of a document whose buffers are those of its file.
    pub(super) fn of(doc: &Document) -> Self {
        let total = ALWAYS.max(doc.distinct_bytes().saturating_mul(RATIO));
        Budget { left: total, total }
    }

    /// Returns what is left, in bytes.
    pub(super) fn left(&self) -> u64 {
        self.left
    }

    /// Gives bytes back that were taken and not used.
    pub(super) fn give_back(&mut self, bytes: u64) {
        self.left += bytes;
    }

    /// Takes bytes from the budget.
    ///
    /// # Errors
    /// Describes the limit, if fewer are left.
    pub(super) fn take(&mut self, bytes: u64) -> Result<(), String> {
        self.left = self
            .left
            .checked_sub(bytes)
            .ok_or_else(|| format!("a file of this size can have at most {} bytes of decompressed data", self.total))?;
        Ok(())
    }
}
