//! Layouts: the assignment of triangles to BLASes and its parts.
//!
//! [`Layout`] is the model; [`Layout::check`] checks it against its scene. `crate::methods` creates layouts.

mod axes;
pub(crate) mod builder;
mod check;
mod note;
mod order;
mod per_geometry;
mod placed_trees;
mod rounds;
pub mod seams;
pub mod store;
mod stored;
#[cfg(test)]
pub(crate) mod test_scenes;

pub(crate) use axes::{WAYS, turn_axes, turn_stored};
pub(crate) use check::is_single_precision;
pub use note::{Changed, Limit, Meshes, Note, Stay};
pub use order::{order_by_tree, order_for_good};
pub use per_geometry::{BlasPer, as_built, per_geometry};
pub use placed_trees::PlacedTrees;
pub use rounds::{Round, Rounds};
pub use stored::{shown, stored};

use crate::scene::{InstanceId, MeshId, Opacity, Scene, TriangleRef};
use glam::DAffine3;

/// A complete assignment of a scene's triangles to mesh groups and instances.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// The mesh groups (BLASes).
    pub groups: Vec<Group>,
    /// Their placements (TLAS entries).
    pub placements: Vec<Placement>,
    /// What the method did and skipped, and why.
    pub notes: Vec<Note>,
    /// What the rounds of `overlap` did; `None` for other methods.
    pub rounds: Option<Rounds>,
}

impl Layout {
    /// Whether two layouts come to the same document but for names.
    pub(crate) fn is_same(&self, other: &Layout) -> bool {
        self.placements == other.placements
            && self.groups.len() == other.groups.len()
            && self.groups.iter().zip(&other.groups).all(|(a, b)| a.content == b.content)
    }
}

/// The triangles built into one BLAS.
#[derive(Clone, Debug)]
pub struct Group {
    /// Name of the glTF mesh to write.
    pub name: String,
    /// The triangles of the group.
    pub content: Content,
}

/// The content of a group.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// An unchanged mesh of the input.
    Kept(MeshId),
    /// Some or all triangles of one input mesh, for any number of its instances, stored in a frame.
    Piece {
        /// The mesh.
        mesh: MeshId,
        /// Mesh from group; each coefficient is exactly a 32-bit float. With the identity, triangles are stored
        /// unchanged.
        frame: DAffine3,
        /// One geometry per material and vertex format. Only the `triangle` of the references is used; their `instance`
        /// is the first that places the mesh.
        geometries: Vec<GroupGeometry>,
    },
    /// Placed triangles of any instances: world coordinates, stored in a frame.
    Baked {
        /// World from group; each coefficient is exactly a 32-bit float.
        frame: DAffine3,
        /// One geometry per material (and per vertex format within it).
        geometries: Vec<GroupGeometry>,
    },
}

impl Content {
    /// Whether this is an unchanged mesh; all other content is rewritten.
    pub fn is_kept(&self) -> bool {
        matches!(self, Content::Kept(_))
    }

    /// Returns mesh from group for a piece; the identity for other content.
    pub fn piece_frame(&self) -> DAffine3 {
        if let Content::Piece { frame, .. } = self { *frame } else { DAffine3::IDENTITY }
    }

    /// World from group for what is baked; the identity for others.
    pub fn baked_frame(&self) -> DAffine3 {
        if let Content::Baked { frame, .. } = self { *frame } else { DAffine3::IDENTITY }
    }

    /// The geometries of what is baked; none for others.
    pub fn baked_geometries(&self) -> &[GroupGeometry] {
        if let Content::Baked { geometries, .. } = self { geometries } else { &[] }
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
    /// See [`crate::scene::Geometry::merge_class`].
    pub merge_class: u32,
    /// How rays pass through the material.
    pub opacity: Opacity,
    /// The triangles in the order of writing.
    pub triangles: Vec<TriangleRef>,
}

/// One instance of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index into [`Layout::groups`].
    pub group: u32,
    /// The input instance whose mesh (or piece of it) this places; `None` for a baked group.
    pub instance: Option<InstanceId>,
    /// World from group.
    pub transform: DAffine3,
}
