//! Decompresses a document while it is read, so that nothing later knows what it was compressed with.

mod budget;
mod draco;
mod fallback;
mod meshopt;

pub(super) use fallback::is_fallback;

use self::budget::Budget;
use crate::{Document, Error};

/// Replaces all compressed data of a document by what it stands for.
pub(super) fn decompress(doc: &mut Document) -> Result<(), Error> {
    let mut budget = Budget::of(doc);
    meshopt::decompress(doc, &mut budget)?;
    draco::decompress(doc, &mut budget)
}
