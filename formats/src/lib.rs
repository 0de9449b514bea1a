//! Reads and writes OBJ and glTF for Raykiln.
//!
//! A [`Document`] is what the file says: the glTF JSON tree as it was written plus the bytes of its buffers.
//! Whatever Raykiln does not understand stays in it untouched. An OBJ file becomes a `Document` too, so that the
//! rest of the program knows one model. [`Contents`] is the checked, typed view of a `Document` from which a scene
//! is made. This crate knows no GPU, no BVH and no cost.

pub mod alpha;
pub mod contents;
pub mod document;
pub mod error;
mod gltf;
mod obj;
pub mod staging;

pub use contents::Contents;
pub use document::Document;
pub use error::{Error, Warning};

use std::path::Path;

/// How to treat what is doubtful in an input file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Refuse non-finite positions, which are otherwise dropped with a warning.
    pub strict: bool,
}

/// Reads an OBJ (`.obj`), glTF (`.gltf`) or binary glTF (`.glb`) file, told apart by content and extension.
///
/// # Errors
/// Returns an [`Error`] that names the file, the place in it and the cause; never panics on any input.
pub fn read(path: &Path) -> Result<Document, Error> {
    if obj::is_obj(path) { obj::read(path) } else { gltf::read::read(path) }
}
