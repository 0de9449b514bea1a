//! What each command does, without a command line.

pub mod bake;
pub mod inspect;
mod measure;
pub mod verify;
