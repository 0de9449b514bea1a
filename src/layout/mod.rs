//! Layouts: which triangles share a BLAS. One method a file, each a pure function `(&Scene, &Options) -> Layout`.

mod axes;
mod builder;
mod bvh;
mod check;
mod cluster;
mod frames;
mod instancing;
mod isolate;
mod keep;
mod order;
mod overlap;
mod parts;
mod per_geometry;
mod per_object;
mod pieces;
mod placed_trees;
mod single;
mod stored;
#[cfg(test)]
mod test_scenes;

pub(crate) use axes::{WAYS, turn_axes, turn_stored};
pub use cluster::{Cache, looseness};
pub use order::{order_by_tree, order_for_good};
pub use parts::{isolates, opacities_differ};
pub use per_geometry::per_geometry;
pub use placed_trees::PlacedTrees;
pub use stored::stored;

use crate::cost::bytes;
use crate::cost::segments::Segment;
use crate::scene::{InstanceId, MeshId, Opacity, Scene, TriangleRef};
use glam::DAffine3;
use std::sync::Arc;

/// A whole assignment of a scene's triangles to mesh groups and instances.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// The mesh groups (BLASes).
    pub groups: Vec<Group>,
    /// Their placements (TLAS entries).
    pub placements: Vec<Placement>,
    /// What the method left out and why, in words, for the report.
    pub notes: Vec<String>,
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

impl Layout {
    /// Predicted bytes of all BLASes and the TLAS; see [`bytes`].
    pub fn as_bytes(&self, scene: &Scene) -> u64 {
        let blas = self.groups.iter().map(|g| bytes::blas(g.content.triangle_count(scene) as u64));
        blas.fold(bytes::tlas(self.placements.len() as u64), u64::saturating_add)
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

/// The method that chooses a layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// The input as it is.
    #[default]
    Keep,
    /// One group of all that is not pinned.
    Single,
    /// One group for each object and material.
    PerObject,
    /// Binned SAH on every object.
    Bvh,
    /// Overlap reduction by splitting and merging.
    Overlap,
    /// Groups of least predicted cost, each in its own frame.
    Cluster,
}

impl Method {
    /// All methods, the unchanged scene first.
    pub const ALL: [Method; 6] =
        [Method::Keep, Method::Single, Method::PerObject, Method::Bvh, Method::Overlap, Method::Cluster];

    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Method::Keep => "keep",
            Method::Single => "single",
            Method::PerObject => "per-object",
            Method::Bvh => "bvh",
            Method::Overlap => "overlap",
            Method::Cluster => "cluster",
        }
    }
}

/// What a method does with the instances of a mesh that several place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Instances {
    /// All instances of a mesh are baked or all stay, the cheapest meshes first, as [`Options::max_bytes_ratio`]
    /// allows.
    #[default]
    BakeOrKeep,
    /// For each mesh and instance: keep it, open it into pieces of its mesh that all opened instances share, or bake
    /// it; whatever is predicted to cost least within [`Options::max_bytes_ratio`].
    Choose,
}

/// What a method may be told. Ratios run from 0 to 1 unless said otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// `bvh`: tree nodes allowed over triangles of the scene (thesis: 1e-3).
    pub nodes_per_triangle_ratio: f64,
    /// `bvh`: a node whose box area over the scene's is smaller than this is not split.
    pub min_area_ratio: f64,
    /// `overlap`: pairs whose overlap area over the scene box's area is at most this are left alone (thesis: 0.005).
    pub skip_overlap_ratio: f64,
    /// `overlap`: pairs whose overlap over their union is below this are split, others merged (thesis: 0.5).
    pub split_or_merge_ratio: f64,
    /// `overlap`: pairs whose overlap over their union is below this are split in the middle, others at the overlap.
    pub split_ratio: f64,
    /// `overlap`: done when the overlap ratio of the scene falls below this.
    pub termination_overlap_ratio: f64,
    /// `bvh`, `overlap`: objects with at most this many triangles are not split (thesis: 8).
    pub min_triangles: usize,
    /// Predicted BLAS and TLAS bytes allowed over the input's; instances stay instanced beyond it. `None`: no limit.
    pub max_bytes_ratio: Option<f64>,
    /// What is done with instances of shared meshes; `keep` and `per-object` leave them as they are.
    pub instances: Instances,
    /// [`Instances::Choose`]: how many pieces meshes are opened into, for all instances that are not baked or for none. `None`:
    /// what is predicted to cost least, for those instances where it gains most.
    pub pieces: Option<u32>,
    /// `single`, `cluster`: objects that enclose the rest, or lie far outside it, get groups of their own.
    pub isolate: bool,
    /// `single`, `cluster`: triangles that are not opaque get groups of their own.
    pub split_opacity: bool,
    /// `cluster`: no group holds two geometries, for consumers that build one BLAS a primitive.
    pub one_geometry_a_group: bool,
    /// `cluster`, [`Instances::Choose`]: what it costs to enter an instance, in steps from node to node.
    pub entry_cost: f64,
    /// `cluster`: rays as far as they go, in the world; groups are chosen by which boxes these meet. `None`, or none: by
    /// the areas of boxes.
    pub segments: Option<Arc<[Segment]>>,
    /// `cluster`: whether what stays in one frame may be divided where no bound asks for it.
    pub divide: bool,
    /// `cluster`: whether connected components and objects may leave as a whole.
    pub units: bool,
    /// `cluster`: whether groups are improved by local search.
    pub search: bool,
    /// `cluster`: whether groups may be stored in frames of their own.
    pub frames: bool,
    /// `cluster`: a part of fewer triangles gets no frame of its own.
    pub min_turned_triangles: u32,
    /// `cluster`: most triangles of a group. `None`: no limit.
    pub max_group_triangles: Option<u32>,
    /// `cluster`: longest side of a group's box over the longest side of the box of all. `None`: no limit.
    pub max_group_extent_ratio: Option<f64>,
}

impl Default for Options {
    /// The values the thesis found best, where it names them. It does not name three: `min_area_ratio`, which only
    /// stops a `bvh` whose node budget is ample; `split_ratio`, here half of `split_or_merge_ratio`, since the overlap
    /// that remains hardly depends on it; and `termination_overlap_ratio`, which is off.
    fn default() -> Self {
        Options {
            nodes_per_triangle_ratio: 1e-3,
            min_area_ratio: 1e-5,
            skip_overlap_ratio: 0.005,
            split_or_merge_ratio: 0.5,
            split_ratio: 0.25,
            termination_overlap_ratio: 0.0,
            min_triangles: 8,
            max_bytes_ratio: None,
            instances: Instances::BakeOrKeep,
            pieces: None,
            isolate: false,
            split_opacity: false,
            one_geometry_a_group: false,
            entry_cost: crate::cost::two_level::INSTANCE_ENTRY,
            segments: None,
            divide: true,
            search: true,
            units: true,
            frames: true,
            min_turned_triangles: 16,
            max_group_triangles: None,
            max_group_extent_ratio: None,
        }
    }
}

/// Runs a method. The layout's triangles are in file order; [`order_by_tree`] sorts them.
///
/// # Panics
/// In debug builds, if the layout does not hold every placed triangle exactly once ([`Layout::check`]).
pub fn run(method: Method, scene: &Scene, options: &Options) -> Layout {
    run_with(&mut Cache::default(), method, scene, options)
}

/// As [`run`], several times over the same scene, whose instances may be pinned in between.
///
/// # Panics
/// As [`run`].
pub fn run_with(cache: &mut Cache, method: Method, scene: &Scene, options: &Options) -> Layout {
    let layout = match method {
        Method::Keep => keep::keep(scene, options),
        Method::Single => single::single(scene, options),
        Method::PerObject => per_object::per_object(scene, options),
        Method::Bvh => bvh::bvh(scene, options),
        Method::Overlap => overlap::overlap(scene, options),
        Method::Cluster => cluster::cluster(scene, options, cache),
    };
    debug_assert_eq!(layout.check(scene), Ok(()), "{method:?}");
    layout
}
