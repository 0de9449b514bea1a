//! From [`Document`] to files, staged.
use crate::Error;
use crate::document::{Document, Staged};
use std::path::Path;

pub(crate) fn stage(_doc: &Document, _out: &Path) -> Result<Staged, Error> {
    todo!()
}

pub(crate) fn stage_unchanged(_doc: &Document, _out: &Path) -> Result<Staged, Error> {
    todo!()
}

impl Staged {
    /// Where the staged scene file can be read before it is committed.
    pub fn path(&self) -> &Path {
        todo!()
    }

    /// Size of all staged files in bytes.
    pub fn bytes(&self) -> u64 {
        todo!()
    }

    /// Renames the files to their final names, the scene file last.
    ///
    /// # Errors
    /// Names the file that could not be put in place; files put in place before it are removed again.
    pub fn commit(self) -> Result<(), Error> {
        todo!()
    }
}
