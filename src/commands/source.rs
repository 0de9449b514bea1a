//! Where a scene is read from.

use std::path::{Path, PathBuf};

use raykiln_formats::{Document, Error};

use crate::scene::LoadOptions;

/// Where a scene is read from.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Source {
    /// A file, with the files that it refers to.
    File(PathBuf),
    /// The bytes of a file that refers to no other, see [`raykiln_formats::read_bytes`].
    Bytes {
        /// The name of the file, for its extension and for messages.
        name: PathBuf,
        /// Its content.
        bytes: Vec<u8>,
    },
}

impl Source {
    /// Reads the scene.
    ///
    /// # Errors
    /// Like [`raykiln_formats::read`] and [`raykiln_formats::read_bytes`].
    pub fn read(self, options: &LoadOptions) -> Result<Document, Error> {
        match self {
            Source::File(path) => raykiln_formats::read_with(&path, &options.reading()),
            Source::Bytes { name, bytes } => raykiln_formats::read_bytes_with(name, bytes, &options.reading()),
        }
    }
}

impl From<&Path> for Source {
    fn from(path: &Path) -> Source {
        Source::File(path.to_owned())
    }
}
