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
mod kinds;
mod meshopt;
mod obj;
mod outline;
pub mod properties;
pub mod record;
pub mod staging;
pub mod unchecked;

pub use contents::Contents;
pub use document::Document;
pub use error::{Error, ErrorKind, Warning};
pub use outline::{Outline, outline, outline_with};

use std::path::{Path, PathBuf};

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

/// How to read an OBJ file. Without effect on glTF, but for `root`.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ObjOptions {
    /// Whether to refuse a file with damaged faces, texture coordinates or normals, which are otherwise left out with a
    /// warning.
    pub strict: bool,
    /// Folders in which materials and textures are sought that are not beside the file.
    pub search: Vec<PathBuf>,
    /// Which normals to read or generate.
    pub normals: ObjNormals,
    /// Which surfaces are seen from both sides.
    pub double_sided: DoubleSided,
    /// The axis of the file that points up; glTF's is y.
    pub z_up: bool,
    /// Length of the file's unit in metres, above 0; `None` for 1 without a word.
    pub unit: Option<f64>,
    /// Folder that all files must be in that a scene names, of glTF too. Without it, glTF may name no absolute paths.
    pub root: Option<PathBuf>,
}

/// Normals of an OBJ file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ObjNormals {
    /// Those of the file; faces of smoothing groups that lack normals get generated ones.
    #[default]
    Keep,
    /// Generated for all faces: per smoothing group, flat outside of groups, smooth if the file has no groups.
    Generate,
    /// None.
    None,
}

/// Surfaces of an OBJ file that are seen from both sides. OBJ has no notion of it, and most programs show both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DoubleSided {
    /// Materials of surfaces that are not closed.
    #[default]
    Auto,
    /// All materials.
    Always,
    /// None.
    Never,
}

impl ObjOptions {
    /// The same options with these folders to search.
    pub fn with_search(self, search: Vec<PathBuf>) -> Self {
        ObjOptions { search, ..self }
    }

    /// The same options with this folder that all files must be in.
    pub fn with_root(self, root: Option<PathBuf>) -> Self {
        ObjOptions { root, ..self }
    }

    /// The same options with `strict` set.
    pub fn with_strict(self, strict: bool) -> Self {
        ObjOptions { strict, ..self }
    }
}

/// Reads an OBJ (`.obj`, also compressed as `.obj.gz`), glTF (`.gltf`) or binary glTF (`.glb`) file, distinguished by content and extension.
///
/// # Errors
/// Returns an [`Error`] that names the file, the place in it and the cause; never panics on any input.
pub fn read(path: &Path) -> Result<Document, Error> {
    read_with(path, &ObjOptions::default())
}

/// Like [`read`], with options for OBJ files.
///
/// # Errors
/// See [`read`].
pub fn read_with(path: &Path, options: &ObjOptions) -> Result<Document, Error> {
    let root = options.root.as_deref();
    if !obj::is_obj(path) {
        return gltf::read::read(path, root);
    }
    if let Some(root) = root {
        gltf::bounds::check_files(path, &outline_with(path, options)?.files, root)?;
    }
    obj::read(path, options)
}

/// Returns the names of the glTF extensions that are known, as the table `gltf/references/table.rs` lists them; one that
/// ends in `*` stands for all that begin like it. Required extensions that are not known are refused; others are carried
/// through, and what they may refer to is left as it is.
pub fn known_extensions() -> impl Iterator<Item = &'static str> {
    gltf::references::table::names()
}

/// Reads the bytes of an OBJ, glTF or GLB file, distinguished by content and by the extension of `name`, which errors
/// report as the file. No file is read: the bytes must include buffers and images (GLB, data URIs); MTL files of an
/// OBJ count as missing, which causes a warning.
///
/// # Errors
/// See [`read`]; also fails for glTF that refers to another file.
pub fn read_bytes(name: impl AsRef<Path>, bytes: impl Into<Bytes>) -> Result<Document, Error> {
    read_bytes_with(name, bytes, &ObjOptions::default())
}

/// Like [`read_bytes`], with options for OBJ files.
///
/// # Errors
/// See [`read_bytes`].
pub fn read_bytes_with(
    name: impl AsRef<Path>,
    bytes: impl Into<Bytes>,
    options: &ObjOptions,
) -> Result<Document, Error> {
    let (name, bytes) = (name.as_ref(), bytes.into());
    if obj::is_obj(name) { obj::read_bytes(name, bytes, options) } else { gltf::read::read_bytes(name, bytes) }
}
