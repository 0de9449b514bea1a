//! Decompresses a document while it is read, so that nothing later knows what it was compressed with, and compresses
//! one while it is written.

mod budget;
mod draco;
mod fallback;
mod meshopt;
pub(super) mod writing;

pub(super) use fallback::is_fallback;

use self::budget::Budget;
use crate::extension_names::EXT_MESHOPT_COMPRESSION;
use crate::{Document, Error};

/// The extension of compressed outputs: the one that most readers know.
pub(super) const WRITTEN: &str = EXT_MESHOPT_COMPRESSION;

/// Replaces all compressed data of a document by what it stands for.
pub(super) fn decompress(doc: &mut Document) -> Result<(), Error> {
    let mut budget = Budget::of(doc);
    meshopt::decompress(doc, &mut budget)?;
    draco::decompress(doc, &mut budget)
}
