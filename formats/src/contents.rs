//! [`Contents`]: the checked, typed view of a [`Document`](crate::Document) from which a scene is made.

use std::sync::Arc;

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
    /// What the node stands for in the input, if an earlier bake recorded it.
    pub source: Option<NodeSource>,
    /// What each copy stands for, where an earlier bake made one node of many; else empty.
    pub copy_sources: Vec<NodeSource>,
}

/// `extras.raykiln.source` of an output node: `{"node": n}`, of a node that places a copy of what `n` placed
/// `{"node": n, "mesh": m, "runs": accessor}`. For the copies of one node that was made of many it is `{"nodes": accessor,
/// "meshes": accessor, "runs": accessor}`, with a node, and if need be a mesh, for every copy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeSource {
    /// Node of the input.
    pub node: u32,
    /// The mesh of the input of which a copy is placed; `None` where the triangles themselves say what they are.
    pub copy_of: Option<CopyOf>,
}

/// A mesh of which a copy is placed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CopyOf {
    /// Mesh of the input.
    pub mesh: u32,
    /// Which of its triangles each triangle of the copy is; `None` where both are in the same order.
    pub order: Option<Arc<TriangleOrder>>,
}

/// For each triangle of a mesh, counted through its primitives, a triangle of another mesh, counted likewise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriangleOrder {
    runs: Vec<[u32; 2]>,
    /// The first triangle of each run, and their number.
    starts: Vec<u64>,
}

impl TriangleOrder {
    /// Of runs that follow each other: first triangle of the other mesh, number of triangles. `None` where a run
    /// passes the largest number.
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

    /// Of the triangles themselves; `None` where each is itself.
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

    /// The runs.
    pub fn runs(&self) -> &[[u32; 2]] {
        &self.runs
    }

    /// The triangle of the other mesh that `triangle` is; `None` beyond the last run.
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
    /// Its colours and which textures it has.
    pub look: Look,
    /// The first material of the file that says the same in everything but name and extras, if that is an earlier one.
    pub same_as: Option<usize>,
}

/// What a material says of its looks in the core properties of glTF; numbers are rounded to six significant digits, as
/// tools write them.
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
    /// Whether there are textures of the base colour, of metallic and roughness, of normals, of occlusion, of emission.
    pub textures: [bool; 5],
}

impl Default for Look {
    /// The default material's.
    fn default() -> Look {
        Look { base_color: [1.0; 4], metallic: 1.0, roughness: 1.0, emissive: [0.0; 3], textures: [false; 5] }
    }
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
