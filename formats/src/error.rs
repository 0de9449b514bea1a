//! Errors and warnings: the file, the place in it, and the cause.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {place}{}{cause}", file.display(), if place.is_empty() { "" } else { ": " })]
pub struct Error {
    /// The file at fault.
    pub file: PathBuf,
    /// The place in the file, such as `accessors[3].byteOffset` or `line 12`; empty for the file as a whole.
    pub place: String,
    /// What is wrong there, in words.
    pub cause: String,
}

impl Error {
    /// An error at a place in a file.
    pub fn at(file: &Path, place: impl Into<String>, cause: impl fmt::Display) -> Self {
        Error { file: file.to_owned(), place: place.into(), cause: cause.to_string() }
    }

    /// An error of the file as a whole.
    pub fn whole(file: &Path, cause: impl fmt::Display) -> Self {
        Error::at(file, "", cause)
    }
}

/// Something a reader mended or left out, worth telling the user once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The place in the file, as in [`Error::place`].
    pub place: String,
    /// What was found and what was done about it.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place.as_str() {
            "" => f.write_str(&self.message),
            place => write!(f, "{place}: {}", self.message),
        }
    }
}
