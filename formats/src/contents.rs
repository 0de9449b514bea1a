//! [`Contents`]: the checked, typed view of a [`Document`](crate::Document) from which a scene is made.

use glam::DAffine3;

use crate::Warning;

/// What the default scene of a document holds. Indices are those of the glTF file.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// All nodes of the file, also those outside the default scene.
    pub nodes: Vec<Node>,
    /// Root nodes of the default scene (`scene`, else the first scene, else all nodes without a parent).
    pub roots: Vec<usize>,
    /// All meshes of the file.
    pub meshes: Vec<Mesh>,
    /// All materials of the file.
    pub materials: Vec<Material>,
    /// All cameras of the file.
    pub cameras: Vec<Camera>,
    /// What was left out of the view, such as triangles with a non-finite corner.
    pub warnings: Vec<Warning>,
}

/// A glTF node.
#[derive(Clone, Debug, Default)]
pub struct Node {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// The node above; `None` at the root.
    pub parent: Option<usize>,
    /// The nodes below.
    pub children: Vec<usize>,
    /// The mesh placed here.
    pub mesh: Option<usize>,
    /// Whether the node has a skin.
    pub skinned: bool,
    /// The camera placed here.
    pub camera: Option<usize>,
    /// Parent from node. Finite; may be mirrored or singular.
    pub local: DAffine3,
    /// `EXT_mesh_gpu_instancing`: node from copy, one for each copy of the mesh; `None` without the extension.
    pub copies: Option<Vec<DAffine3>>,
    /// Whether an animation moves this very node (its descendants move with it) or its morph weights.
    pub animated: bool,
    /// Whether a scene other than the default one shows this node.
    pub in_other_scene: bool,
    /// Extensions of the node whose meaning is not known here, so that it must stay as it is.
    pub unknown_extensions: Vec<String>,
}

/// A glTF mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// Its primitives, in file order.
    pub primitives: Vec<Primitive>,
}

/// A glTF primitive.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// The material; `None` is glTF's default material.
    pub material: Option<usize>,
    /// Its triangles; `None` for points and lines.
    pub triangles: Option<Triangles>,
    /// Whether it has morph targets.
    pub morphed: bool,
    /// Primitives with equal keys (and equal materials) may be joined into one: same vertex attributes of the same
    /// types (positions, normals and tangents count as 32-bit floats), same extensions and extras.
    pub merge_key: String,
    /// Where the triangles came from, if an earlier bake recorded it.
    pub provenance: Option<Provenance>,
}

/// Provenance as `extras.raykiln` of an output primitive records it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Provenance {
    /// `{"source": {"mesh": m, "primitive": p}}`: triangle for triangle the input's primitive; the node is the one
    /// that places it.
    Same {
        /// Mesh in the input.
        mesh: u32,
        /// Primitive in that mesh.
        primitive: u32,
    },
    /// `{"provenance": {"sources": [[node, copy, mesh, primitive], ...], "runs": accessor}}`.
    Runs {
        /// Source primitives: node (`null` in the file, `None` here, where the placing node is meant), copy, mesh, primitive.
        sources: Vec<Source>,
        /// Runs (index into `sources`, first source triangle, number of triangles), in the order of the output's triangles.
        runs: Vec<[u32; 3]>,
    },
}

/// A primitive of the input as a node of the input places it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Source {
    /// Node of the input; `None`: the node that places the primitive in the output.
    pub node: Option<u32>,
    /// Copy within that node (`EXT_mesh_gpu_instancing`), else 0.
    pub copy: u32,
    /// Mesh of the input.
    pub mesh: u32,
    /// Primitive of that mesh.
    pub primitive: u32,
}

/// The triangles of a primitive, in its own coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// Vertex positions as stored (dequantised where the file quantises).
    pub positions: Vec<[f32; 3]>,
    /// Vertices of each triangle, counter-clockwise seen from the front; strips and fans are unrolled. Every index
    /// is below `positions.len()` and every corner is finite.
    pub corners: Vec<[u32; 3]>,
    /// For each triangle its index in the file; `None` if none was dropped. A triangle is dropped when a corner is
    /// not finite.
    pub kept: Option<Vec<u32>>,
}

/// How rays pass through a material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Opacity {
    /// Every hit counts.
    #[default]
    Opaque,
    /// Alpha-tested.
    Mask {
        /// Smallest alpha that counts as a hit.
        cutoff: f64,
    },
    /// Blended.
    Blend,
}

/// A glTF material, as far as tracing goes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// Alpha mode.
    pub opacity: Opacity,
    /// Whether back faces are shown.
    pub double_sided: bool,
}

/// A glTF camera. Looks along its node's -z, y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Camera {
    /// Perspective.
    Perspective {
        /// Vertical field of view in radians.
        yfov: f64,
        /// Width over height, if given.
        aspect_ratio: Option<f64>,
    },
    /// Parallel.
    Orthographic {
        /// Half the width seen.
        xmag: f64,
        /// Half the height seen.
        ymag: f64,
    },
}
