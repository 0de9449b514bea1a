//! Errors and warnings: the file, the place in it, and the cause.

use std::path::{Path, PathBuf};
use std::{fmt, io};

/// What sort of error it is, for programs that act on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The system could not read or write a file.
    Io(io::ErrorKind),
    /// The file breaks a rule of its format.
    Invalid,
    /// The file needs something that is not supported, such as compressed geometry.
    Unsupported,
    /// The output cannot be written as asked for: its name, its place or its size.
    Output,
}

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[error("{}: {place}{}{cause}", file.display(), if place.is_empty() { "" } else { ": " })]
pub struct Error {
    /// The file at fault.
    pub file: PathBuf,
    /// The place in the file, such as `accessors[3].byteOffset` or `line 12`; empty for the whole file.
    pub place: String,
    /// Description of the problem.
    pub cause: String,
    /// What sort of error it is.
    pub kind: ErrorKind,
}

impl Error {
    /// An error at a place in a file, [`ErrorKind::Invalid`].
    pub fn at(file: &Path, place: impl Into<String>, cause: impl fmt::Display) -> Self {
        Error { file: file.to_owned(), place: place.into(), cause: cause.to_string(), kind: ErrorKind::Invalid }
    }

    /// Creates an error of the whole file.
    pub fn whole(file: &Path, cause: impl fmt::Display) -> Self {
        Error::at(file, "", cause)
    }

    /// The system could not read or write a file; `what` comes before its reason.
    pub fn io(file: &Path, what: &str, reason: &io::Error) -> Self {
        Error::whole(file, format_args!("{what}{reason}")).of_kind(ErrorKind::Io(reason.kind()))
    }

    /// The output cannot be written as asked for.
    pub(crate) fn output(file: &Path, cause: impl fmt::Display) -> Self {
        Error::whole(file, cause).of_kind(ErrorKind::Output)
    }

    /// The file needs something that is not supported.
    pub(crate) fn unsupported(self) -> Self {
        self.of_kind(ErrorKind::Unsupported)
    }

    pub(crate) fn of_kind(self, kind: ErrorKind) -> Self {
        Error { kind, ..self }
    }
}

/// Something that a reader repaired or left out, reported to the user once.
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
