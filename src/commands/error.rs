//! Why a command came to nothing.

use crate::verify::DeviceError;

/// Why a command came to nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] raykiln_formats::Error),
    /// The device named to trace on cannot do it.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Raykiln made something it must not make.
    #[error("internal error, please report it: {0}")]
    Internal(String),
}
