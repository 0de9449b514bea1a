//! What each command does, without a command line.

pub mod bake;
pub mod calls;
pub mod inspect;
mod measure;
pub mod source;
pub mod verify;
