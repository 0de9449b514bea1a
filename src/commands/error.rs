//! Why a command failed.

use crate::verify::DeviceError;

/// Why a plan does not hold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The input is another one.
    #[error("--plan: the input differs from that of the plan: its BLAKE3 hash is {found}, the plan's {planned}")]
    Input {
        /// The hash of the plan.
        planned: String,
        /// The hash of the file.
        found: String,
    },
    /// There is no such candidate.
    #[error("--plan: there is no candidate `{0}` among those of the plan's options")]
    NoCandidate(String),
    /// Other bytes would be written.
    #[error("--plan: the output differs from that of the plan: its BLAKE3 hash is {found}, the plan's {planned}")]
    Output {
        /// The hash of the plan.
        planned: String,
        /// The hash of the output.
        found: String,
    },
}

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
    /// The picture cannot be drawn.
    #[error(transparent)]
    Render(#[from] crate::render::RenderError),
    /// The plan to be followed does not hold here.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Raykiln produced something invalid.
    #[error("internal error, please report it: {0}")]
    Internal(String),
}
