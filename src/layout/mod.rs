//! Layouts: which triangles share a BLAS, and what such an assignment is made of.
//!
//! [`Layout`] is the model; [`Layout::check`] holds it against its scene. `crate::methods` makes layouts.

mod axes;
pub(crate) mod builder;
mod check;
mod note;
mod order;
mod per_geometry;
mod placed_trees;
pub mod store;
mod stored;
#[cfg(test)]
pub(crate) mod test_scenes;

pub(crate) use axes::{WAYS, turn_axes, turn_stored};
pub use note::{Changed, Limit, Meshes, Note, Stay};
pub use order::{order_by_tree, order_for_good};
pub use per_geometry::{BlasPer, as_built, per_geometry};
pub use placed_trees::PlacedTrees;
pub use stored::stored;

use crate::scene::{InstanceId, MeshId, Opacity, Scene, TriangleRef};
use glam::DAffine3;

/// A whole assignment of a scene's triangles to mesh groups and instances.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// The mesh groups (BLASes).
    pub groups: Vec<Group>,
    /// Their placements (TLAS entries).
    pub placements: Vec<Placement>,
    /// What the method did and left out, and why.
    pub notes: Vec<Note>,
}

/// The triangles built into one BLAS.
#[derive(Clone, Debug)]
pub struct Group {
    /// Name of the glTF mesh to be.
    pub name: String,
    /// What is in it.
    pub content: Content,
}

/// What a group holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// A mesh of the input exactly as it is.
    Kept(MeshId),
    /// Some triangles of one input mesh, or all, for any number of its instances, stored in a frame.
    Piece {
        /// The mesh.
        mesh: MeshId,
        /// Mesh from group; each coefficient is exactly a 32-bit float. Triangles whose frame is the identity are stored
        /// as they are.
        frame: DAffine3,
        /// One geometry for each material and vertex format. Only the `triangle` of the references counts; their
        /// `instance` is the first that places the mesh.
        geometries: Vec<GroupGeometry>,
    },
    /// Triangles of any instances, placed: world coordinates, stored in a frame.
    Baked {
        /// World from group; each coefficient is exactly a 32-bit float.
        frame: DAffine3,
        /// One geometry for each material (and each vertex format within it).
        geometries: Vec<GroupGeometry>,
    },
}

impl Content {
    /// Whether it is a mesh as it is; all else is written anew.
    pub fn is_kept(&self) -> bool {
        matches!(self, Content::Kept(_))
    }

    /// Mesh from group for a piece; the identity for others.
    pub fn piece_frame(&self) -> DAffine3 {
        if let Content::Piece { frame, .. } = self { *frame } else { DAffine3::IDENTITY }
    }

    /// Triangles of a group, counted once however often it is placed.
    pub fn triangle_count(&self, scene: &Scene) -> usize {
        match self {
            Content::Kept(mesh) => scene.meshes[mesh.0 as usize].triangle_count(),
            Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => {
                geometries.iter().map(|g| g.triangles.len()).sum()
            }
        }
    }
}

/// The triangles of one geometry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroupGeometry {
    /// Index into [`Scene::materials`].
    pub material: Option<u32>,
    /// As in [`crate::scene::Geometry::merge_class`].
    pub merge_class: u32,
    /// How rays pass through the material.
    pub opacity: Opacity,
    /// The triangles in the order in which they are written.
    pub triangles: Vec<TriangleRef>,
}

/// One instance of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index into [`Layout::groups`].
    pub group: u32,
    /// The input instance whose mesh (or a piece of it) this places; `None` for a baked group.
    pub instance: Option<InstanceId>,
    /// World from group.
    pub transform: DAffine3,
}
