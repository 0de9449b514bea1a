//! [`Contents`]: the checked, typed view of a [`Document`](crate::Document) that a scene is made from.

use std::sync::Arc;

use glam::{DAffine3, Vec3};

use crate::Warning;
use crate::record::{GeometryHash, Provenance};

/// Contents of the default scene of a document. Indices are those of the glTF file.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// All nodes of the file, including those outside the default scene.
    pub nodes: Vec<Node>,
    /// Root nodes of the default scene (`scene`, else the first scene, else all nodes without a parent).
    pub roots: Vec<usize>,
    /// All meshes of the file.
    pub meshes: Vec<Mesh>,
    /// All materials of the file.
    pub materials: Vec<Material>,
    /// All cameras of the file.
    pub cameras: Vec<Camera>,
    /// Where its triangles come from, if an earlier bake recorded it.
    pub provenance: Provenance,
    /// Hash of its geometry, to which a record of provenance is bound.
    pub geometry: GeometryHash,
    /// What was left out of the view, such as triangles with a non-finite corner.
    pub warnings: Vec<Warning>,
}

/// A glTF node.
#[derive(Clone, Debug, Default)]
pub struct Node {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// The parent node; `None` at the root.
    pub parent: Option<usize>,
    /// The child nodes.
    pub children: Vec<usize>,
    /// The mesh placed here.
    pub mesh: Option<usize>,
    /// The skin of the mesh.
    pub skin: Option<usize>,
    /// The camera placed here.
    pub camera: Option<usize>,
    /// Parent-from-node transform. Finite; may be mirrored or singular.
    pub local: DAffine3,
    /// `EXT_mesh_gpu_instancing`: the node-from-copy transform of each copy of the mesh; `None` without the extension.
    pub copies: Option<Vec<DAffine3>>,
    /// Whether an animation moves the node itself (its descendants move with it) or changes its morph weights.
    pub animated: bool,
    /// Whether a scene other than the default one shows this node.
    pub in_other_scene: bool,
    /// Why the node, with all nodes below it, must keep its mesh and its place, besides animations, skins and scenes.
    pub hold: Option<Hold>,
    /// Whether the node is not shown, with all nodes below it: it is hidden (`KHR_node_visibility`), or a lower level of
    /// detail of another (`MSFT_lod`).
    pub hidden: bool,
}

/// Why a node or mesh must stay as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Hold {
    /// The node has an extension that says something of its triangles, or that is not known.
    Extension,
    /// An extension refers to it by number or pointer, or may do so.
    Referred,
    /// The node is a joint of a skin, which applications move.
    Joint,
    /// The node has a camera or a light, with which applications move it.
    Attached,
    /// An extension of the mesh would be lost.
    MeshExtension,
    /// A primitive has an extension with data in the order of its triangles or vertices, or one that is not known.
    Order,
    /// A primitive has matrices as vertex attributes.
    Matrix,
    /// The extras of a node or primitive leave no room to record what becomes of it.
    NoRoom,
}

/// Maps each triangle of a mesh, counted across its primitives, to a triangle of another mesh, counted likewise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriangleOrder {
    runs: Vec<[u32; 2]>,
    /// The first triangle of each run, followed by the total number.
    starts: Vec<u64>,
}

impl TriangleOrder {
    /// Creates the order from consecutive runs: first triangle of the other mesh, number of triangles. Returns `None`
    /// if a run exceeds the largest number.
    pub fn new(runs: Vec<[u32; 2]>) -> Option<TriangleOrder> {
        let mut starts = Vec::with_capacity(runs.len() + 1);
        let mut next = 0;
        for &[first, count] in &runs {
            first.checked_add(count)?;
            starts.push(next);
            next += u64::from(count);
        }
        starts.push(next);
        Some(TriangleOrder { runs, starts })
    }

    /// Creates the order from the triangles themselves; `None` if it is the identity.
    pub fn of(triangles: &[u32]) -> Option<TriangleOrder> {
        if (0..).zip(triangles).all(|(i, &t)| i == t) {
            return None;
        }
        let mut runs: Vec<[u32; 2]> = Vec::new();
        for &triangle in triangles {
            match runs.last_mut() {
                Some([first, count]) if *first + *count == triangle => *count += 1,
                _ => runs.push([triangle, 1]),
            }
        }
        TriangleOrder::new(runs)
    }

    /// Returns the runs.
    pub fn runs(&self) -> &[[u32; 2]] {
        &self.runs
    }

    /// Returns the triangle of the other mesh that `triangle` maps to; `None` beyond the last run.
    pub fn triangle(&self, triangle: u32) -> Option<u32> {
        let at = u64::from(triangle);
        let run = self.starts.partition_point(|&start| start <= at).checked_sub(1)?;
        let [first, count] = *self.runs.get(run)?;
        let within = u32::try_from(at - self.starts[run]).ok()?;
        (within < count).then_some(first + within)
    }
}

/// A glTF mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// Its primitives, in file order.
    pub primitives: Vec<Primitive>,
    /// Why the mesh must stay whole.
    pub hold: Option<Hold>,
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
    /// Whether its material, or one that a variant gives it, has lengths in the coordinates of the mesh, such as the
    /// thickness of glass: they change their meaning if a scale is written out.
    pub in_mesh_units: bool,
    /// Primitives with equal keys (and equal materials) may be joined into one: they have the same vertex attributes of
    /// the same types (positions, normals and tangents count as 32-bit floats), extensions and extras.
    pub merge_key: String,
}

/// The triangles of a primitive, in its own coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// Vertex positions as stored (dequantised if the file quantises them). Primitives that refer to the same accessor
    /// share them.
    pub positions: Arc<[[f32; 3]]>,
    /// What rounding took from the positions, see [`Residuals`](crate::document::Residuals); `None` if nothing.
    pub residuals: Option<Arc<[Vec3]>>,
    /// Vertices of each triangle, counter-clockwise seen from the front; strips and fans are unrolled. Every index
    /// is below `positions.len()` and every corner is finite.
    pub corners: Vec<[u32; 3]>,
    /// Index in the file of each triangle; `None` if none was dropped. A triangle is dropped if a corner is not finite.
    pub kept: Option<Vec<u32>>,
}

/// How a material lets rays pass.
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

/// The properties of a glTF material that matter to tracing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// `name`, if the file has one.
    pub name: Option<String>,
    /// Alpha mode.
    pub opacity: Opacity,
    /// Whether back faces are shown.
    pub double_sided: bool,
    /// Its colours, and which textures it has.
    pub look: Look,
    /// The first material of the file that equals this one except for name and extras, if it precedes this one.
    pub same_as: Option<usize>,
}

/// Appearance of a material in the core properties of glTF; numbers are rounded to six significant digits, as tools
/// write them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// `baseColorFactor`.
    pub base_color: [f64; 4],
    /// `metallicFactor`.
    pub metallic: f64,
    /// `roughnessFactor`.
    pub roughness: f64,
    /// `emissiveFactor`.
    pub emissive: [f64; 3],
    /// Whether it has textures for base colour, metallic-roughness, normals, occlusion and emission.
    pub textures: [bool; 5],
}

impl Default for Look {
    /// Returns the look of the default material.
    fn default() -> Look {
        Look { base_color: [1.0; 4], metallic: 1.0, roughness: 1.0, emissive: [0.0; 3], textures: [false; 5] }
    }
}

/// A glTF camera. It looks along its node's -z, with y up.
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
