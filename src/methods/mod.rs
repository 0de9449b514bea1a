//! Layout methods: one per file, each a pure function of the scene and the options it uses.

mod bvh;
mod cluster;
mod frames;
mod instancing;
mod keep;
mod options;
mod overlap;
mod parts;
mod per_object;
mod pieces;
mod plan_id;
mod single;
#[cfg(test)]
mod tests_of_invariance;

pub use cluster::{Cache, looseness};
pub(crate) use options::ClusterSearch;
pub use options::{
    BvhOptions, ClusterOptions, InstanceOptions, Instances, Options, OverlapOptions, OverlapRule, PartOptions,
    SingleOptions,
};
pub use parts::{isolates, opacities_differ};
pub use plan_id::PlanId;

use crate::layout::Layout;
use crate::scene::Scene;

/// The method that chooses a layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// The input unchanged.
    #[default]
    Keep,
    /// One group of everything that is not pinned.
    Single,
    /// One group per object and material.
    PerObject,
    /// Binned SAH on each object.
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

    /// Returns the name used on the command line and in reports.
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

/// Runs a method. The layout's triangles are in file order; [`crate::layout::order_by_tree`] sorts them.
///
/// # Panics
/// In debug builds, if the layout does not hold each placed triangle exactly once ([`Layout::check`]).
pub fn run(method: Method, scene: &Scene, options: &Options) -> Layout {
    run_with(&mut Cache::default(), method, scene, options)
}

/// Like [`run`], for several runs over the same scene, whose instances may be pinned in between.
///
/// # Panics
/// Like [`run`].
pub fn run_with(cache: &mut Cache, method: Method, scene: &Scene, options: &Options) -> Layout {
    let Options { instances, parts, single, bvh, overlap, cluster } = options;
    let layout = match method {
        Method::Keep => keep::keep(scene),
        Method::Single if single.turned => cluster::whole(scene, instances, parts, cluster, cache),
        Method::Single => single::single(scene, instances, parts, &cache.instances),
        Method::PerObject => per_object::per_object(scene),
        Method::Bvh => bvh::bvh(scene, instances, bvh),
        Method::Overlap => overlap::overlap(scene, instances, overlap),
        Method::Cluster => cluster::cluster(scene, instances, parts, cluster, cache),
    };
    debug_assert_eq!(layout.check(scene), Ok(()), "{method:?}");
    layout
}
