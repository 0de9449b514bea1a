//! Methods that make layouts. One method a file, each a pure function `(&Scene, &Options) -> Layout`.

mod bvh;
mod cluster;
mod frames;
mod instancing;
mod isolate;
mod keep;
mod overlap;
mod parts;
mod per_object;
mod pieces;
mod plan_id;
mod single;

pub use cluster::{Cache, looseness};
pub use parts::{isolates, opacities_differ};
pub use plan_id::PlanId;

use crate::cost::segments::Segment;
use crate::layout::Layout;
use crate::scene::Scene;
use std::sync::Arc;

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
    pub const fn name(self) -> &'static str {
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
