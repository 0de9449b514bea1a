//! Why a command failed.

use crate::verify::DeviceError;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] raykiln_formats::Error),
    /// The selected device cannot trace rays.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Raykiln produced something invalid.
    #[error("internal error, please report it: {0}")]
    Internal(String),
}
