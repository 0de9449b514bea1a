//! Options of methods: those of each method, and those that several share.

use std::sync::Arc;

use crate::cost::segments::Segment;
use crate::cost::two_level::INSTANCE_ENTRY;

/// How a method treats the instances of a mesh that several instances place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Instances {
    /// Either all instances of a mesh are baked or all stay, cheapest meshes first, within
    /// [`InstanceOptions::max_bytes_ratio`].
    #[default]
    BakeOrKeep,
    /// For each mesh and instance: keep it, open it into pieces of its mesh that all opened instances share, or bake
    /// it, whichever has the least predicted cost within [`InstanceOptions::max_bytes_ratio`].
    Choose,
}

/// The options of all methods. Ratios range from 0 to 1 unless stated otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// `single`, `bvh`, `overlap`, `cluster`: instances.
    pub instances: InstanceOptions,
    /// `single`, `cluster`: triangles that must not share a group.
    pub parts: PartOptions,
    /// `single` only.
    pub single: SingleOptions,
    /// `bvh` only.
    pub bvh: BvhOptions,
    /// `overlap` only.
    pub overlap: OverlapOptions,
    /// `cluster` only, and `single` in a frame of its own if bounds divide it.
    pub cluster: ClusterOptions,
}

/// How instances are treated, and what they cost.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct InstanceOptions {
    /// How instances of shared meshes are treated.
    pub shared: Instances,
    /// [`Instances::Choose`]: the number of pieces that meshes are opened into, applied to all instances that are not
    /// baked or to none. `None`: whatever has the least predicted cost, applied to the instances that gain most.
    pub pieces: Option<u32>,
    /// Maximum predicted BLAS and TLAS bytes relative to the input's; beyond it, instances stay instanced. `None`: no
    /// limit.
    pub max_bytes_ratio: Option<f64>,
    /// [`Instances::Choose`], `cluster`: the cost of entering an instance, in node-traversal steps.
    pub entry_cost: f64,
    /// [`Instances::Choose`], `cluster`: whether groups may be stored in their own frames.
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

/// Which triangles get their own groups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PartOptions {
    /// Objects that enclose the rest or lie far outside it.
    pub isolate: bool,
    /// Triangles that are not opaque.
    pub split_opacity: bool,
    /// `cluster`: each group holds only one geometry, for consumers that build one BLAS per primitive.
    pub(crate) one_geometry_per_group: bool,
}

/// How `single` stores its group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SingleOptions {
    /// Stores it in the frame that fits all of it best, if frames are allowed. Groups that exceed the bounds of
    /// [`ClusterOptions`] are divided.
    pub(crate) turned: bool,
}

/// How `bvh` divides objects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BvhOptions {
    /// Node budget relative to the triangles of the scene (thesis: 1e-3).
    pub nodes_per_triangle_ratio: f64,
    /// Nodes whose box area relative to that of the scene's core is smaller than this are not split. The thesis gives no value; it
    /// only stops a division with an ample node budget.
    pub min_area_ratio: f64,
    /// Objects with at most this many triangles are not split (thesis: 8).
    pub min_triangles: usize,
}

impl Default for BvhOptions {
    fn default() -> Self {
        BvhOptions { nodes_per_triangle_ratio: 1e-3, min_area_ratio: 1e-5, min_triangles: 8 }
    }
}

/// How literally `overlap` follows the thesis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OverlapRule {
    /// Objects that merged stay together; the state with the least overlap is taken, if it is less than the input's.
    #[default]
    Improved,
    /// As in listing 4.1 of the thesis; the state after the last round is taken.
    Thesis,
}

/// Which pairs of objects `overlap` splits and merges.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OverlapOptions {
    /// Pairs whose overlap area relative to the area of the core's box is at most this are left alone (thesis: 0.005).
    pub skip_overlap_ratio: f64,
    /// Pairs whose overlap area relative to the area of their union is below this are split, others merged (thesis:
    /// 0.5).
    pub split_or_merge_ratio: f64,
    /// Pairs whose overlap area relative to the area of their union is below this are split in the middle, others at
    /// the overlap. The thesis gives no value; the default is half of `split_or_merge_ratio`, because the remaining
    /// overlap hardly depends on it.
    pub split_ratio: f64,
    /// Stop when the overlap ratio of the scene's core falls below this. The thesis gives no value; it is off by default.
    pub termination_overlap_ratio: f64,
    /// Objects with at most this many triangles are not split (thesis: 8).
    pub min_triangles: usize,
    /// How literally the thesis is followed.
    pub rule: OverlapRule,
    /// Whether the costs of each round are computed, which takes the time of some trees over all triangles.
    pub series: bool,
}

impl Default for OverlapOptions {
    fn default() -> Self {
        OverlapOptions {
            skip_overlap_ratio: 0.005,
            split_or_merge_ratio: 0.5,
            split_ratio: 0.25,
            termination_overlap_ratio: 0.0,
            min_triangles: 8,
            rule: OverlapRule::default(),
            series: false,
        }
    }
}

/// Constraints on the groups of `cluster`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClusterOptions {
    /// Parts with fewer triangles do not get their own frame.
    pub min_turned_triangles: u32,
    /// Maximum number of triangles per group. `None`: no limit.
    pub max_group_triangles: Option<u32>,
    /// Maximum longest side of a group's box relative to the longest side of the box of all. `None`: no limit.
    pub max_group_extent_ratio: Option<f64>,
    /// How to search for groups.
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
    /// Whether group sizes are bounded.
    pub fn is_bounded(&self) -> bool {
        self.max_group_triangles.is_some() || self.max_group_extent_ratio.is_some()
    }
}

/// How `cluster` searches for groups.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ClusterSearch {
    /// Ray segments in world space; groups are chosen by the boxes that these meet. `None` or empty: by the areas of
    /// boxes.
    pub(crate) segments: Option<Arc<[Segment]>>,
    /// Whether triangles in one frame may be divided without a bound that requires it.
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
