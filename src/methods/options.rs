//! What methods may be told: options of each method, and those that several share.

use std::sync::Arc;

use crate::cost::segments::Segment;
use crate::cost::two_level::INSTANCE_ENTRY;

/// What a method does with the instances of a mesh that several place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Instances {
    /// All instances of a mesh are baked or all stay, the cheapest meshes first, as
    /// [`InstanceOptions::max_bytes_ratio`] allows.
    #[default]
    BakeOrKeep,
    /// For each mesh and instance: keep it, open it into pieces of its mesh that all opened instances share, or bake
    /// it; whatever is predicted to cost least within [`InstanceOptions::max_bytes_ratio`].
    Choose,
}

/// The options of all methods. Ratios run from 0 to 1 unless said otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// `single`, `bvh`, `overlap`, `cluster`: instances.
    pub instances: InstanceOptions,
    /// `single`, `cluster`: triangles that must not share a group.
    pub parts: PartOptions,
    /// `single` alone.
    pub single: SingleOptions,
    /// `bvh` alone.
    pub bvh: BvhOptions,
    /// `overlap` alone.
    pub overlap: OverlapOptions,
    /// `cluster` alone, and `single` in a frame of its own where bounds divide it.
    pub cluster: ClusterOptions,
}

/// What is done with instances, and what they cost.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct InstanceOptions {
    /// What is done with instances of shared meshes.
    pub shared: Instances,
    /// [`Instances::Choose`]: the number of pieces that meshes are opened into, for all instances that are not baked or for
    /// none. `None`: what is predicted to cost least, for those instances for which it gains most.
    pub pieces: Option<u32>,
    /// Predicted BLAS and TLAS bytes allowed over the input's; instances stay instanced beyond it. `None`: no limit.
    pub max_bytes_ratio: Option<f64>,
    /// [`Instances::Choose`], `cluster`: the cost of entering an instance, in node-traversal steps.
    pub entry_cost: f64,
    /// [`Instances::Choose`], `cluster`: whether groups may be stored in frames of their own.
    pub frames: bool,
}

impl Default for InstanceOptions {
    fn default() -> Self {
        InstanceOptions {
            shared: Instances::BakeOrKeep,
            pieces: None,
            max_bytes_ratio: None,
            entry_cost: INSTANCE_ENTRY,
            frames: true,
        }
    }
}

/// Which triangles get groups of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PartOptions {
    /// Objects that enclose the rest, or lie far outside it.
    pub isolate: bool,
    /// Triangles that are not opaque.
    pub split_opacity: bool,
    /// `cluster`: no group holds two geometries, for consumers that build one BLAS per primitive.
    pub(crate) one_geometry_per_group: bool,
}

/// How `single` stores its group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SingleOptions {
    /// In the frame that fits all of it best, if frames are allowed. What exceeds the bounds of [`ClusterOptions`] is divided.
    pub(crate) turned: bool,
}

/// How `bvh` divides objects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BvhOptions {
    /// Tree nodes allowed over triangles of the scene (thesis: 1e-3).
    pub nodes_per_triangle_ratio: f64,
    /// A node whose box area over the scene's is smaller than this is not split. The thesis does not name it: it only
    /// stops a division whose node budget is ample.
    pub min_area_ratio: f64,
    /// Objects with at most this many triangles are not split (thesis: 8).
    pub min_triangles: usize,
}

impl Default for BvhOptions {
    fn default() -> Self {
        BvhOptions { nodes_per_triangle_ratio: 1e-3, min_area_ratio: 1e-5, min_triangles: 8 }
    }
}

/// Which pairs of objects `overlap` splits and merges.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OverlapOptions {
    /// Pairs whose overlap area over the scene box's area is at most this are left alone (thesis: 0.005).
    pub skip_overlap_ratio: f64,
    /// Pairs whose overlap over their union is below this are split, others merged (thesis: 0.5).
    pub split_or_merge_ratio: f64,
    /// Pairs whose overlap over their union is below this are split in the middle, others at the overlap. The thesis does
    /// not name it; half of `split_or_merge_ratio`, since the overlap that remains hardly depends on it.
    pub split_ratio: f64,
    /// Done when the overlap ratio of the scene falls below this. The thesis does not name it; it is off.
    pub termination_overlap_ratio: f64,
    /// Objects with at most this many triangles are not split (thesis: 8).
    pub min_triangles: usize,
}

impl Default for OverlapOptions {
    fn default() -> Self {
        OverlapOptions {
            skip_overlap_ratio: 0.005,
            split_or_merge_ratio: 0.5,
            split_ratio: 0.25,
            termination_overlap_ratio: 0.0,
            min_triangles: 8,
        }
    }
}

/// What the groups of `cluster` may be.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClusterOptions {
    /// A part of fewer triangles gets no frame of its own.
    pub min_turned_triangles: u32,
    /// Most triangles of a group. `None`: no limit.
    pub max_group_triangles: Option<u32>,
    /// Longest side of a group's box over the longest side of the box of all. `None`: no limit.
    pub max_group_extent_ratio: Option<f64>,
    /// How groups are looked for.
    pub(crate) search: ClusterSearch,
}

impl Default for ClusterOptions {
    fn default() -> Self {
        ClusterOptions {
            min_turned_triangles: 16,
            max_group_triangles: None,
            max_group_extent_ratio: None,
            search: ClusterSearch::default(),
        }
    }
}

impl ClusterOptions {
    /// Whether groups are bounded.
    pub fn is_bounded(&self) -> bool {
        self.max_group_triangles.is_some() || self.max_group_extent_ratio.is_some()
    }
}

/// How `cluster` looks for groups.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ClusterSearch {
    /// Rays as far as they go, in the world; groups are chosen by which boxes these meet. `None`, or none: by the areas of
    /// boxes.
    pub(crate) segments: Option<Arc<[Segment]>>,
    /// Whether what stays in one frame may be divided if no bound asks for it.
    pub(crate) divide: bool,
    /// Whether connected components and objects may leave as a whole.
    pub(crate) units: bool,
    /// Whether groups are improved by local search.
    pub(crate) improve: bool,
}

impl Default for ClusterSearch {
    fn default() -> Self {
        ClusterSearch { segments: None, divide: true, units: true, improve: true }
    }
}
