//! Reads and writes OBJ and glTF for Raykiln.
//!
//! A [`Document`] holds the whole file: the glTF JSON tree as written plus the bytes of its buffers. Anything that
//! Raykiln does not understand stays in it untouched. An OBJ file becomes a `Document` too, so that the rest of the
//! program has one model; it is changed by the methods that [`edit`] adds. [`Contents`] is the checked, typed view of a
//! `Document` that a scene is made from. This crate does not depend on GPUs, BVHs or cost models.
//!
//! From a path, and from bytes in memory:
//!
//! ```
//! use raykiln_formats::{ReadOptions, read, read_bytes};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples/overlapping/scene.glb");
//! # if !path.exists() { return Ok(()) }
//! let document = read(&path)?;
//! let contents = document.contents(ReadOptions::default())?;
//! println!("{} meshes, placed by {} nodes", contents.meshes.len(), contents.nodes.len());
//!
//! let triangle = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let document = read_bytes("triangle.obj", &triangle[..])?;
//! let folder = tempfile::tempdir()?;
//! let staged = document.stage(&folder.path().join("triangle.glb"))?;
//! staged.commit()?;
//! # assert_eq!(read(&folder.path().join("triangle.glb"))?.contents(ReadOptions::default())?.meshes.len(), 1);
//! # Ok(())
//! # }
//! ```

pub mod alpha;
pub mod contents;
pub mod document;
pub mod edit;
pub mod error;
mod extension_names;
mod gltf;
mod meshopt;
mod obj;
mod outline;
pub mod properties;
pub mod staging;
pub mod unchecked;

pub use contents::Contents;
pub use document::Document;
pub use error::{Error, ErrorKind, Warning};
pub use outline::{Outline, outline};

use std::path::Path;

use bytes::Bytes;

/// How to treat questionable data in an input file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Whether to reject non-finite positions, which are otherwise dropped with a warning.
    pub strict: bool,
}

impl ReadOptions {
    /// The same options with `strict` set.
    pub fn with_strict(self, strict: bool) -> Self {
        ReadOptions { strict, ..self }
    }
}

/// Reads an OBJ (`.obj`), glTF (`.gltf`) or binary glTF (`.glb`) file, distinguished by content and extension.
///
/// # Errors
/// Returns an [`Error`] that names the file, the place in it and the cause; never panics on any input.
pub fn read(path: &Path) -> Result<Document, Error> {
    if obj::is_obj(path) { obj::read(path) } else { gltf::read::read(path) }
}

/// Reads the bytes of an OBJ, glTF or GLB file, distinguished by content and by the extension of `name`, which errors
/// report as the file. No file is read: the bytes must include buffers and images (GLB, data URIs); MTL files of an
/// OBJ count as missing, which causes a warning.
///
/// # Errors
/// See [`read`]; also fails for glTF that refers to another file.
pub fn read_bytes(name: impl AsRef<Path>, bytes: impl Into<Bytes>) -> Result<Document, Error> {
    let (name, bytes) = (name.as_ref(), bytes.into());
    if obj::is_obj(name) { obj::read_bytes(name, bytes) } else { gltf::read::read_bytes(name, bytes) }
}
