//! The record of provenance: from which triangle of the input each triangle of an output was made.
//!
//! A record is one value for the whole file. It is written as text into `extras.raykiln.record` of the glTF root, or into a
//! file beside it ([`sidecar`]), and refers to nothing in the file by a number that other tools change: what it says of
//! nodes and primitives holds as long as the hash of the geometry is the one that it names ([`GeometryHash`]).
//! `docs/provenance.md` specifies the text.

mod code;

use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

pub(crate) use code::{decode, encode};

/// A BLAKE3 hash of what a file shows: of all meshes the positions and triangles in their order, and of all nodes which
/// mesh and which copies of it they place. Names, transforms of nodes, materials and how data is stored do not count.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct GeometryHash(pub [u8; 32]);

impl fmt::Display for GeometryHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        blake3::Hash::from_bytes(self.0).to_hex().fmt(f)
    }
}

impl fmt::Debug for GeometryHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for GeometryHash {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        blake3::Hash::from_hex(text).map(|hash| GeometryHash(*hash.as_bytes())).map_err(|_| "a hash is malformed")
    }
}

/// A primitive of the input, as placed by a node of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Source {
    /// Node of the input; `None` for the one that the placing node of the output stands for.
    pub node: Option<u32>,
    /// Copy within that node (`EXT_mesh_gpu_instancing`), otherwise 0; 0 without a node.
    pub copy: u32,
    /// Mesh of the input.
    pub mesh: u32,
    /// Primitive of that mesh.
    pub primitive: u32,
}

/// Where the triangles of a primitive of the output come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origins {
    /// It has no triangles, or nothing is known of them.
    Unknown,
    /// Triangle for triangle from one primitive of the input.
    Same(Source),
    /// Each from its own.
    Each {
        /// Primitives of the input.
        sources: Vec<Source>,
        /// For each triangle, the index of its source and its number there.
        triangles: Vec<[u32; 2]>,
    },
}

impl Origins {
    /// Returns the origin of a triangle.
    pub fn of(&self, triangle: u32) -> Option<(Source, u32)> {
        match self {
            Origins::Unknown => None,
            Origins::Same(source) => Some((*source, triangle)),
            Origins::Each { sources, triangles } => {
                let &[source, number] = triangles.get(triangle as usize)?;
                Some((*sources.get(source as usize)?, number))
            }
        }
    }

    /// The primitives of the input.
    pub fn sources(&self) -> &[Source] {
        match self {
            Origins::Unknown => &[],
            Origins::Same(source) => std::slice::from_ref(source),
            Origins::Each { sources, .. } => sources,
        }
    }
}

/// What a node of the output, or a copy that it places, shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placed {
    /// Node of the output.
    pub node: u32,
    /// Copy within that node, otherwise 0.
    pub copy: u32,
    /// Index into [`Record::lists`].
    pub list: u32,
    /// The node of the input, and the copy within it, that [`Source`]s without a node are of.
    pub input: Option<(u32, u32)>,
    /// Whether it shows a mesh that stands in for a copy of it, which may be off by what rounding allows.
    pub stands_in: bool,
}

/// A record of provenance.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// The input. Of a bake of a bake this is the first input.
    pub input: GeometryHash,
    /// For each node of the output, the node of the input that it is; `None` for one that a bake added.
    pub nodes: Vec<Option<u32>>,
    /// Where the triangles of a mesh come from, by primitive.
    pub lists: Vec<Vec<Origins>>,
    /// What the nodes show, in ascending order of node and copy.
    pub placed: Vec<Placed>,
}

impl Record {
    /// Returns what a copy of a node shows.
    pub fn placed(&self, node: u32, copy: u32) -> Option<&Placed> {
        let at = self.placed.binary_search_by_key(&(node, copy), |placed| (placed.node, placed.copy)).ok()?;
        Some(&self.placed[at])
    }

    /// Returns where the triangles of a primitive come from, as a copy of a node shows them, with what places them there.
    pub fn origins(&self, node: u32, copy: u32, primitive: u32) -> Option<(&Placed, &Origins)> {
        let placed = self.placed(node, copy)?;
        Some((placed, self.lists.get(placed.list as usize)?.get(primitive as usize)?))
    }
}

/// What a file says of its provenance.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Provenance {
    /// Nothing.
    #[default]
    Unrecorded,
    /// A record of other geometry: the file was edited after the bake.
    Stale,
    /// A record that cannot be read, and why.
    Damaged(&'static str),
    /// A record of this geometry.
    Recorded(Arc<Record>),
}

impl Provenance {
    /// Returns the record, if it can be used.
    pub fn record(&self) -> Option<&Record> {
        match self {
            Provenance::Recorded(record) => Some(record),
            _ => None,
        }
    }
}

/// Returns the path of the file beside a scene that has its record.
pub fn sidecar(scene: &Path) -> PathBuf {
    let mut name = scene.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".record.json");
    scene.with_file_name(name)
}
