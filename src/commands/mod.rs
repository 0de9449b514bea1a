//! The commands, independent of the command line.

pub mod bake;
#[cfg(feature = "cli")]
pub mod batch;
pub mod cached;
pub mod calls;
mod error;
mod fingerprint;
pub mod inspect;
pub(crate) mod measure;
pub mod render;
pub(crate) mod rules;
pub mod source;
pub mod time;
pub mod verify;

pub use error::{CommandError, PlanError};
