//! `cluster`: groups of least predicted cost, regardless of objects, each in the frame that fits it best.
//!
//! Helps scenes with parts rotated against the axes and with thin geometry (pipes, cables, railings, furniture at an
//! angle), and bounds group sizes for engines that stream them; for axis-aligned geometry, the result is that of
//! `single`. A tree over all triangles is cut by dynamic programming ([`dynamic_programming`]), before or after units
//! such as connected components leave it ([`units`]), whichever has the lower predicted cost.

mod dynamic_programming;
mod facts;
mod ground;
mod met;
mod refit;
mod search;
mod soup;
#[cfg(test)]
mod tests;
mod units;

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::DAffine3;
use rustc_hash::FxHashSet;

use crate::cost::sah::TRAVERSAL;
use crate::layout::builder::{Builder, Geometries, Object, group_name, objects};
use crate::layout::{Layout, PlacedTrees, seams};
use crate::methods::instancing::{Known, bake_within_limits};
use crate::methods::parts::{Part, bake_part, parts};
use crate::methods::{ClusterOptions, InstanceOptions, Options, PartOptions, single};
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef};
use dynamic_programming::Group;
use facts::Turning;
use ground::ClusterInput;
use soup::{Soup, Turned};

/// Another frame for all triangles is used if its cost is below this share.
const WORTH_TURNING: f64 = 0.97;

/// Number of TLAS nodes that a group adds, each as large as its box.
const TLAS_NODES: f64 = 2.0;

/// Entry cost that dominates all other costs, so that bounds are met with as few groups as possible.
const FEWEST_GROUPS: f64 = 1e9;

/// The purpose of the groups.
#[derive(Clone, Copy, Debug)]
enum Purpose {
    /// Least predicted cost for the given entry cost.
    Groups { entry_cost: f64 },
    /// One group in the frame that fits it best; as few as possible if bounds divide it.
    Whole,
}

/// Constraints on groups; lengths are in half diagonals of the scene.
struct Limits {
    entry_cost: f64,
    min_turned: u32,
    max_triangles: u32,
    max_extent: f64,
    /// Whether a group may be divided without a bound that requires it.
    divide: bool,
    /// Whether units may leave.
    units: bool,
    /// Whether groups are improved by local search.
    improve: bool,
    /// Whether everything stays in one group if bounds allow it.
    whole: bool,
}

impl Limits {
    fn of(options: &ClusterOptions, purpose: Purpose, extent: f64) -> Limits {
        let entry_cost = match purpose {
            Purpose::Groups { entry_cost } => entry_cost,
            Purpose::Whole => FEWEST_GROUPS,
        };
        Limits {
            entry_cost,
            min_turned: options.min_turned_triangles,
            divide: options.search.divide,
            improve: options.search.improve,
            units: options.search.units,
            whole: matches!(purpose, Purpose::Whole),
            max_triangles: options.max_group_triangles.unwrap_or(u32::MAX),
            max_extent: options.max_group_extent_ratio.map_or(f64::INFINITY, |ratio| ratio * extent),
        }
    }

    /// Returns the cost factor of a group that leaves another: its entry and the TLAS nodes it adds.
    fn leaving_cost(&self) -> f64 {
        self.entry_cost + TLAS_NODES * TRAVERSAL
    }

    /// The fewest triangles of a group that is a length of a part with its own frame.
    fn fewest_per_length(&self) -> u32 {
        if self.divide { self.min_turned } else { u32::MAX }
    }

    fn allow(&self, triangles: u32, extent: f64) -> bool {
        triangles <= self.max_triangles && extent <= self.max_extent
    }
}

/// State shared by several runs over the same scene. Runs with equal options give equal layouts, with or without a
/// cache.
pub struct Cache {
    /// Lower bound on the entry costs of the runs.
    least_entry: f64,
    last: Option<(Key, Option<Rc<ClusterInput>>)>,
    /// The trees over the most triangles.
    trees: PlacedTrees,
    /// What was learned of the instances.
    pub(in crate::methods) instances: Known,
}

/// Lower bound on the entry cost for which parts with their own frame are searched.
const LEAST_ENTRY: f64 = 2.0;

impl Default for Cache {
    fn default() -> Self {
        Cache { least_entry: LEAST_ENTRY, last: None, trees: PlacedTrees::default(), instances: Known::default() }
    }
}

/// The inputs that a [`ClusterInput`] depends on.
#[derive(PartialEq)]
struct Key {
    objects: Vec<Object>,
    /// The keys of corners that others share; `None` if frames are not searched for.
    outside: Option<FxHashSet<u64>>,
    min_turned: u32,
}

impl Cache {
    /// Creates a cache for runs with only these options; it skips searches that could pay off in none of them.
    pub fn serving<'a>(runs: impl IntoIterator<Item = &'a Options>) -> Cache {
        let least = |Options { instances, cluster, .. }: &Options| {
            // Parts divided by bounds are groups at any cost; with rays, areas hardly predict whether an entry pays
            // off.
            let cut_by_rays = cluster.search.segments.is_some();
            if cluster.is_bounded() || cut_by_rays { LEAST_ENTRY } else { instances.entry_cost }
        };
        Cache {
            least_entry: runs.into_iter().map(least).fold(f64::INFINITY, f64::min).max(LEAST_ENTRY),
            ..Cache::default()
        }
    }

    fn ground(&mut self, scene: &Scene, key: Key) -> Option<Rc<ClusterInput>> {
        if !self.last.as_ref().is_some_and(|(last, _)| *last == key) {
            // Drop the old input first, because both together may not fit in memory.
            self.retire();
            let turning = Turning { fewest: key.min_turned, least_entry: self.least_entry };
            let ground = ClusterInput::new(scene, &key.objects, key.outside.as_ref(), turning).map(Rc::new);
            self.last = Some((key, ground));
        }
        self.last.as_ref().and_then(|(_, ground)| ground.clone())
    }

    /// Drops everything but the trees, which are kept if they cover more triangles than those already kept.
    fn retire(&mut self) {
        let last = self.last.take().and_then(|(_, ground)| Rc::into_inner(ground?));
        if let Some(trees) = last.map(ClusterInput::into_trees).filter(|trees| trees.len() > self.trees.len()) {
            self.trees = trees;
        }
    }

    /// Returns the trees that the runs built.
    pub fn into_trees(mut self) -> PlacedTrees {
        self.retire();
        self.trees
    }
}

/// Returns how much larger the boxes of triangles are than necessary: the surface area of the world boxes of all
/// triangles that may be regrouped, divided by that of the tightest possible boxes; at least 1. Computed from an even
/// sample of the triangles.
pub fn looseness(scene: &Scene) -> f64 {
    let free = (0..scene.instances.len() as u32).map(InstanceId);
    let free: Vec<Object> = objects(scene, free.filter(|i| scene.instances[i.0 as usize].pinned.is_none()));
    let triangles: usize = free.iter().map(|o| o.geometry(scene).triangles.len()).sum();
    let step = triangles.div_ceil(SAMPLES).max(1);
    let sample = free.iter().flat_map(|o| o.triangles(scene)).step_by(step);
    let areas = sample.map(|at| {
        let corners = scene.world_corners(at);
        [Bounds::of(corners).area(), soup::tightest(corners)]
    });
    let [loose, tight] = areas.fold([0.0, 0.0], |sum, a| [sum[0] + a[0], sum[1] + a[1]]);
    if tight > 0.0 && loose.is_finite() { (loose / tight).max(1.0) } else { 1.0 }
}

/// Number of triangles sampled to measure how loose boxes are.
const SAMPLES: usize = 1 << 16;

/// Creates the groups of least predicted cost.
pub(super) fn cluster(
    scene: &Scene,
    instances: &InstanceOptions,
    parts: &PartOptions,
    options: &ClusterOptions,
    cache: &mut Cache,
) -> Layout {
    let purpose = Purpose::Groups { entry_cost: instances.entry_cost };
    Clustering { scene, instances, parts, options, purpose }.lay_out(cache)
}

/// Creates one group per part, in the frame that fits it best.
pub(super) fn whole(
    scene: &Scene,
    instances: &InstanceOptions,
    parts: &PartOptions,
    options: &ClusterOptions,
    cache: &mut Cache,
) -> Layout {
    Clustering { scene, instances, parts, options, purpose: Purpose::Whole }.lay_out(cache)
}

/// The input and options of a layout.
struct Clustering<'a> {
    scene: &'a Scene,
    instances: &'a InstanceOptions,
    parts: &'a PartOptions,
    options: &'a ClusterOptions,
    purpose: Purpose,
}

impl Clustering<'_> {
    fn lay_out(&self, cache: &mut Cache) -> Layout {
        let known = cache.instances.clone();
        let cache = std::cell::RefCell::new(cache);
        bake_within_limits(self.scene, self.instances, &known, |bake| {
            let mut layout = Builder::new(self.scene);
            bake.place_left(&mut layout);
            let baked: Vec<InstanceId> = bake.baked().collect();
            let parts = parts(self.scene, &baked, self.parts);
            let outside = self.instances.frames.then(|| self.shared(&parts, &baked));
            for part in &parts {
                match (self.groups(part, outside.clone(), &mut cache.borrow_mut()), parts.len()) {
                    (Some((ground, groups)), _) => {
                        push(self.scene, &part.objects, &ground.soup, &groups, &mut layout);
                    }
                    (None, 1) => single::join_all(self.scene, &baked, &mut layout),
                    (None, _) => bake_part(self.scene, part, &mut layout),
                }
            }
            layout.finish()
        })
    }

    /// Returns the keys of the corners that several parts share, or a part and an instance that stays, which the input
    /// places by the same transform.
    fn shared(&self, parts: &[Part], baked: &[InstanceId]) -> FxHashSet<u64> {
        let of_objects = |objects: &[Object]| objects.iter().flat_map(|object| object.triangles(self.scene)).collect();
        let left = seams::left_beside(self.scene, baked);
        if parts.len() == 1 && left.is_empty() {
            return FxHashSet::default();
        }
        let parts = parts.iter().map(|part| of_objects(&part.objects));
        let sets: Vec<Vec<TriangleRef>> = parts.chain([of_objects(&objects(self.scene, left))]).collect();
        seams::shared_keys(self.scene, &sets)
    }

    /// Returns the groups of a part and the input they were found in; `None` if the part stays whole, along the world
    /// axes.
    fn groups(
        &self,
        part: &Part,
        outside: Option<FxHashSet<u64>>,
        cache: &mut Cache,
    ) -> Option<(Rc<ClusterInput>, Vec<Group>)> {
        let objects = part.objects.clone();
        let ground =
            cache.ground(self.scene, Key { objects, outside, min_turned: self.options.min_turned_triangles })?;
        let segments = self.options.search.segments.as_ref().filter(|segments| !segments.is_empty());
        let groups = ground.cut(&Limits::of(self.options, self.purpose, ground.extent()), segments);
        let is_whole = groups.is_empty() || (groups.len() == 1 && groups[0].frame == Turned::NOT);
        (!is_whole).then_some((ground, groups))
    }
}

/// Adds groups to a layout.
fn push(scene: &Scene, objects: &[Object], soup: &Soup, groups: &[Group], layout: &mut Builder) {
    let object_of = |t: u32| soup.objects.partition_point(|&first| first <= t) - 1;
    let mut numbers = vec![0u32; objects.len()];
    for group in groups {
        let mut geometries = Geometries::default();
        let mut sizes: BTreeMap<u32, usize> = BTreeMap::new();
        for run in group.items.chunk_by(|&a, &b| object_of(a) == object_of(b)) {
            let object = object_of(run[0]);
            *sizes.entry(object as u32).or_default() += run.len();
            geometries.add(objects[object].geometry(scene), run.iter().map(|&t| soup.refs[t as usize]));
        }
        let name = group_name(scene, objects, &sizes, &mut numbers);
        layout.bake_in(frame(scene, soup, group), name, geometries);
    }
}

/// Returns world from group: the group's rotation, about the middle of its triangles if it is rotated.
fn frame(scene: &Scene, soup: &Soup, group: &Group) -> DAffine3 {
    if group.frame == Turned::NOT {
        return DAffine3::IDENTITY;
    }
    let corners = group.items.iter().flat_map(|&t| scene.world_corners(soup.refs[t as usize]));
    DAffine3 { matrix3: group.frame.rotation, translation: Bounds::of(corners).stored_center() }
}
