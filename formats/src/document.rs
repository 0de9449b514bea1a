//! [`Document`]: the complete contents of a scene file.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use glam::Vec3;
use serde_json::Value;

use crate::alpha::{AlphaTest, Image};
use crate::staging::Folder;
use crate::{Contents, Error, ReadOptions, Warning};

/// The kind of a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Wavefront OBJ with MTL (read only).
    Obj,
    /// glTF 2.0 JSON with separate buffers.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
}

/// How an output is compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Compression {
    /// Not at all.
    #[default]
    None,
    /// By `EXT_meshopt_compression`, which readers must then support, without loss: what is read back is the same byte
    /// by byte. Buffer views that would not become smaller, and images, stay as they are.
    Meshopt,
}

/// A whole scene file: the glTF 2.0 JSON tree and the bytes of its buffers.
#[derive(Clone, Debug)]
pub struct Document {
    /// The glTF root object; properties in file order.
    pub json: Value,
    /// The bytes of `json.buffers[i]`, at least `byteLength` long.
    pub buffers: Vec<Bytes>,
    /// The file the document was read from, or the name that was given to its bytes.
    pub path: PathBuf,
    /// The kind of that file.
    pub kind: Kind,
    /// What the reader repaired or left out.
    pub warnings: Vec<Warning>,
    /// The bytes that the document was read from if they were in memory; it then refers to no file.
    pub in_memory: Option<Bytes>,
    /// What rounding took from the positions of an OBJ file; empty for glTF, and once accessors are renumbered.
    pub residuals: Residuals,
    /// The record of provenance that lies, or is to lie, beside the file (see [`crate::record`]).
    pub sidecar: Option<Value>,
}

/// What rounding to 32-bit floats took from positions that a file gives in more digits.
///
/// A residual is the exact position minus the stored one, in the coordinates of the mesh, itself rounded toward zero to
/// 32-bit floats: stored position and residual together hold about 48 bits. Their sum in double precision rounds to the
/// stored position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residuals {
    /// By accessor; those without are exact.
    of_accessors: HashMap<usize, Arc<[Vec3]>>,
}

impl Residuals {
    /// Returns the residuals of an accessor's positions; `None` if all are zero.
    pub fn get(&self, accessor: usize) -> Option<&Arc<[Vec3]>> {
        self.of_accessors.get(&accessor)
    }

    /// Sets the residuals of an accessor's positions, one per position; none if the list is empty.
    pub fn insert(&mut self, accessor: usize, residuals: Vec<Vec3>) {
        if !residuals.is_empty() {
            self.of_accessors.insert(accessor, residuals.into());
        }
    }

    /// Forgets all residuals.
    pub(crate) fn clear(&mut self) {
        self.of_accessors.clear();
    }
}

/// Component type of an accessor, with the numbers of glTF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Component {
    /// 8-bit signed.
    I8 = 5120,
    /// 8-bit unsigned.
    U8 = 5121,
    /// 16-bit signed.
    I16 = 5122,
    /// 16-bit unsigned.
    U16 = 5123,
    /// 32-bit unsigned.
    U32 = 5125,
    /// 32-bit float.
    F32 = 5126,
}

impl Component {
    /// Returns the size of one component in bytes.
    pub fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The number that little-endian bytes stand for; integers are not normalised.
    ///
    /// # Panics
    /// If there are fewer bytes than [`Component::size`].
    pub fn number(self, raw: &[u8]) -> f64 {
        match self {
            Component::I8 => f64::from(raw[0] as i8),
            Component::U8 => f64::from(raw[0]),
            Component::I16 => f64::from(i16::from_le_bytes([raw[0], raw[1]])),
            Component::U16 => f64::from(u16::from_le_bytes([raw[0], raw[1]])),
            Component::U32 => f64::from(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]])),
            Component::F32 => f64::from(f32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]])),
        }
    }

    /// The integer that stands for 1 in a normalised accessor; `None` for types that are not normalised.
    pub fn one(self) -> Option<f64> {
        match self {
            Component::I8 => Some(127.0),
            Component::U8 => Some(255.0),
            Component::I16 => Some(32_767.0),
            Component::U16 => Some(65_535.0),
            Component::U32 | Component::F32 => None,
        }
    }
}

/// The type of one element of an accessor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Element {
    /// Component type.
    pub component: Component,
    /// Number of components per element: 1 (SCALAR), 2, 3 or 4 (VECn). Matrices have 4, 9 or 16.
    pub components: usize,
    /// Whether integers represent the range 0..1 or -1..1.
    pub normalized: bool,
}

impl Element {
    /// Returns the size of one tightly packed element in bytes.
    pub fn size(self) -> usize {
        self.component.size() * self.components
    }

    /// One component as a number; normalised integers as the section "Animations" of the glTF 2.0 specification maps
    /// them.
    ///
    /// # Panics
    /// If there are fewer bytes than [`Component::size`].
    pub fn number(self, raw: &[u8]) -> f64 {
        let number = self.component.number(raw);
        match self.component.one().filter(|_| self.normalized) {
            Some(one) => (number / one).max(-1.0),
            None => number,
        }
    }
}

/// One vertex attribute of a primitive, with random access: element `i` is `data[i * stride..][..element.size()]`.
/// Sparse accessors are resolved.
#[derive(Clone, Debug)]
pub struct Attribute<'a> {
    /// The attribute's semantic, such as `NORMAL` or `TEXCOORD_0`.
    pub name: String,
    /// The type of its elements.
    pub element: Element,
    /// Number of elements.
    pub count: usize,
    /// Bytes from one element to the next.
    pub stride: usize,
    /// The bytes, from the first element on.
    pub data: Cow<'a, [u8]>,
}

impl Attribute<'_> {
    /// Returns the bytes of an element.
    ///
    /// # Panics
    /// If there is no such element.
    pub fn bytes(&self, index: u32) -> &[u8] {
        &self.data[index as usize * self.stride..][..self.element.size()]
    }

    /// Returns the components of an element as numbers; missing ones are 0, except that a missing fourth is 1.
    ///
    /// # Panics
    /// If there is no such element.
    pub fn numbers(&self, index: u32) -> [f64; 4] {
        let element = self.element;
        let mut values = [0.0, 0.0, 0.0, 1.0];
        for (value, raw) in values.iter_mut().zip(self.bytes(index).chunks_exact(element.component.size())) {
            *value = element.number(raw);
        }
        values
    }
}

impl Document {
    /// Returns the size of the file that the document was read from and of the buffer files that it refers to, in bytes;
    /// `None` if one of them cannot be looked at again.
    pub fn file_bytes(&self) -> Option<u64> {
        crate::gltf::write::file_bytes(self)
    }

    /// Returns the checked, typed view of this document's default scene.
    ///
    /// # Errors
    /// Names the first place at which the document breaks a rule of glTF 2.0 that the view relies on: indices out
    /// of range, accessors past their buffers, node cycles, nodes with two parents, unknown required extensions;
    /// with `options.strict` also non-finite positions.
    pub fn contents(&self, options: ReadOptions) -> Result<Contents, Error> {
        crate::gltf::contents::contents(self, options)
    }

    /// Returns the vertex attributes of a primitive, in file order. The document must have passed
    /// [`Document::contents`].
    pub fn attributes(&self, mesh: usize, primitive: usize) -> Vec<Attribute<'_>> {
        crate::gltf::attributes::attributes(self, mesh, primitive)
    }

    /// Returns the alpha test of a material. The document must have passed [`Document::contents`].
    ///
    /// # Errors
    /// Names the place at which textures break a rule of glTF 2.0.
    pub fn alpha_test(&self, material: usize) -> Result<AlphaTest, Error> {
        crate::gltf::alpha::alpha_test(self, material)
    }

    /// Returns the texture coordinates `TEXCOORD_set` of a primitive's vertices, as stored in the file.
    ///
    /// # Errors
    /// Fails if the attribute is missing or invalid.
    pub fn texcoords(&self, mesh: usize, primitive: usize, set: usize) -> Result<Vec<[f32; 2]>, Error> {
        crate::gltf::alpha::texcoords(self, mesh, primitive, set)
    }

    /// Returns an image of the document. If the image is invalid, [`Image::read`] fails.
    pub fn image(&self, index: usize) -> Image {
        crate::gltf::alpha::image(self, index)
    }

    /// Returns the unsigned integers of a SCALAR accessor, if it exists and is valid.
    pub fn scalars(&self, accessor: usize) -> Option<Vec<u32>> {
        crate::gltf::attributes::scalars(self, accessor)
    }

    /// Writes the document as `.glb`, or `.gltf` with one `.bin` and its images, into a hidden folder beside
    /// `out`; nothing appears under the final names before [`Staged::commit`].
    ///
    /// # Errors
    /// Names the file that could not be written, or an extension of `out` that is neither `.glb` nor `.gltf`.
    pub fn stage(&self, out: &Path) -> Result<Staged, Error> {
        crate::gltf::write::stage(self, out)
    }

    /// Like [`Document::stage`], compressed.
    ///
    /// # Errors
    /// See [`Document::stage`].
    pub fn stage_with(&self, out: &Path, compression: Compression) -> Result<Staged, Error> {
        crate::gltf::write::stage_with(self, out, compression)
    }

    /// Stages the input file byte for byte, with the files it refers to if `out` is in another folder. If input and
    /// output differ in kind, this is [`Document::stage`].
    ///
    /// # Errors
    /// See [`Document::stage`].
    pub fn stage_unchanged(&self, out: &Path) -> Result<Staged, Error> {
        crate::gltf::write::stage_unchanged(self, out)
    }
}

pub use crate::gltf::staged::Placed;

/// Rejects an output that [`Document::stage`] could not write, before any work is done.
///
/// # Errors
/// An extension that is neither `.glb` nor `.gltf`; a folder that is missing or cannot be written to.
pub fn check_output(out: &Path) -> Result<(), Error> {
    crate::gltf::write::check(out)
}

/// Whether a file of an earlier output can have the name `name` beside `out`: the name stays in the folder, and the file
/// replaces no buffer of another scene.
pub fn can_hold(out: &Path, name: &Path) -> bool {
    crate::gltf::write::can_hold(out, name)
}

/// Files written but not yet in place. They are removed if dropped without [`Staged::commit`].
#[derive(Debug)]
pub struct Staged {
    pub(crate) folder: Folder,
    /// The destination folder.
    pub(crate) target: PathBuf,
    /// Files in `folder`, each with its final path; the scene file itself comes last.
    pub(crate) files: Vec<(PathBuf, PathBuf)>,
    /// What could not be copied, such as missing images.
    pub warnings: Vec<Warning>,
    /// Whether the scene file is the input byte for byte.
    pub is_input: bool,
}
