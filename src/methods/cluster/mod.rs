//! `cluster`: groups of least predicted cost, whatever objects their triangles belong to, each in the frame that fits
//! it best.
//!
//! Helps scenes whose parts are turned against the axes and thin geometry (pipes, cables, railings, furniture at an
//! angle), and bounds groups for engines that stream them; on geometry along the axes it comes to what `single` does.
//! A tree over all triangles is cut by a dynamic programme ([`dynamic_programming`]), before or after units such as connected
//! components left it ([`units`]), whichever is predicted to cost less.

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

use crate::cost::sah::TRAVERSAL;
use crate::layout::builder::{Builder, Geometries, Object, group_name, objects};
use crate::layout::{Layout, PlacedTrees};
use crate::methods::instancing::bake_within_limits;
use crate::methods::parts::{Part, bake_part, parts};
use crate::methods::{ClusterOptions, InstanceOptions, Options, PartOptions, single};
use crate::scene::{Bounds, InstanceId, Scene};
use dynamic_programming::Group;
use facts::Turning;
use ground::ClusterInput;
use soup::{Soup, Turned};

/// Another frame for all triangles must cost less than this share to be taken.
const WORTH_TURNING: f64 = 0.97;

/// Nodes of the TLAS that a group adds, each as large as its box.
const TLAS_NODES: f64 = 2.0;

/// Cost of entering a group beside which nothing else counts, so that bounds are kept with as few groups as can be.
const FEWEST_GROUPS: f64 = 1e9;

/// What triangles are put into groups for.
#[derive(Clone, Copy, Debug)]
enum Purpose {
    /// Least predicted cost, given that of entering a group.
    Groups { entry_cost: f64 },
    /// One group in the frame that fits it best; as few as can be where bounds divide it.
    Whole,
}

/// What groups are allowed to be; lengths in half diagonals of the scene.
struct Limits {
    entry_cost: f64,
    min_turned: u32,
    max_triangles: u32,
    max_extent: f64,
    /// Whether a group may be divided without a bound that asks for it.
    divide: bool,
    /// Whether units may leave.
    units: bool,
    /// Whether groups are improved by local search.
    improve: bool,
    /// Whether all stays in one group if bounds allow it.
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

    /// What it costs to meet a group that leaves another one: its entry, and what it adds to the TLAS.
    fn leaving_cost(&self) -> f64 {
        self.entry_cost + TLAS_NODES * TRAVERSAL
    }

    fn allow(&self, triangles: u32, extent: f64) -> bool {
        triangles <= self.max_triangles && extent <= self.max_extent
    }
}

/// What several runs over the same scene share. Runs with equal options give equal layouts, with a cache or without.
pub struct Cache {
    /// No run has an entry cost below this one.
    least_entry: f64,
    last: Option<(Key, Option<Rc<ClusterInput>>)>,
    /// Those over most triangles.
    trees: PlacedTrees,
}

/// The least entry cost by which parts are looked for that could have a frame of their own.
const LEAST_ENTRY: f64 = 2.0;

impl Default for Cache {
    fn default() -> Self {
        Cache { least_entry: LEAST_ENTRY, last: None, trees: PlacedTrees::default() }
    }
}

/// What a [`ClusterInput`] depends on.
type Key = (Vec<Object>, bool, u32);

impl Cache {
    /// For runs with these options alone: what could pay in none of them is not looked for.
    pub fn serving<'a>(runs: impl IntoIterator<Item = &'a Options>) -> Cache {
        let least = |Options { instances, cluster, .. }: &Options| {
            // What bounds divide is a group whatever it costs; by rays, areas tell little of what an entry is worth.
            let cut_by_rays = cluster.search.segments.is_some();
            if cluster.is_bounded() || cut_by_rays { LEAST_ENTRY } else { instances.entry_cost }
        };
        Cache {
            least_entry: runs.into_iter().map(least).fold(f64::INFINITY, f64::min).max(LEAST_ENTRY),
            ..Cache::default()
        }
    }

    fn ground(&mut self, scene: &Scene, objects: &[Object], turns: bool, min_turned: u32) -> Option<Rc<ClusterInput>> {
        let serves = |key: &Key| (&*key.0, key.1, key.2) == (objects, turns, min_turned);
        if !self.last.as_ref().is_some_and(|(key, _)| serves(key)) {
            // The old one goes first: both at once could be too much.
            self.retire();
            let turning = Turning { fewest: min_turned, least_entry: self.least_entry };
            let ground = ClusterInput::new(scene, objects, turns, turning).map(Rc::new);
            self.last = Some(((objects.to_vec(), turns, min_turned), ground));
        }
        self.last.as_ref().and_then(|(_, ground)| ground.clone())
    }

    /// Lets go of all but the trees, where they are over more triangles than those that are known.
    fn retire(&mut self) {
        let last = self.last.take().and_then(|(_, ground)| Rc::into_inner(ground?));
        if let Some(trees) = last.map(ClusterInput::into_trees).filter(|trees| trees.len() > self.trees.len()) {
            self.trees = trees;
        }
    }

    /// The trees that the runs built.
    pub fn into_trees(mut self) -> PlacedTrees {
        self.retire();
        self.trees
    }
}

/// How much larger the boxes of triangles are than they need be: the surface area of the world boxes of all triangles
/// that may be regrouped over that of the tightest boxes there are; at least 1. An even sample of the triangles tells.
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

/// Triangles that tell how loose the boxes of all are.
const SAMPLES: usize = 1 << 16;

/// The groups of least predicted cost.
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

/// One group of each part, in the frame that fits it best.
pub(super) fn whole(
    scene: &Scene,
    instances: &InstanceOptions,
    parts: &PartOptions,
    options: &ClusterOptions,
    cache: &mut Cache,
) -> Layout {
    Clustering { scene, instances, parts, options, purpose: Purpose::Whole }.lay_out(cache)
}

/// What is to be laid out, and how.
struct Clustering<'a> {
    scene: &'a Scene,
    instances: &'a InstanceOptions,
    parts: &'a PartOptions,
    options: &'a ClusterOptions,
    purpose: Purpose,
}

impl Clustering<'_> {
    fn lay_out(&self, cache: &mut Cache) -> Layout {
        let cache = std::cell::RefCell::new(cache);
        bake_within_limits(self.scene, self.instances, |bake| {
            let mut layout = Builder::new(self.scene);
            bake.place_left(&mut layout);
            let baked: Vec<InstanceId> = bake.baked().collect();
            let parts = parts(self.scene, &baked, self.parts);
            for part in &parts {
                match (self.groups(part, &mut cache.borrow_mut()), parts.len()) {
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

    /// The groups of a part and what they were found in; `None` if it stays whole, along the axes of the world.
    fn groups(&self, part: &Part, cache: &mut Cache) -> Option<(Rc<ClusterInput>, Vec<Group>)> {
        let ground =
            cache.ground(self.scene, &part.objects, self.instances.frames, self.options.min_turned_triangles)?;
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

/// World from group: the group's rotation, about the middle of its triangles where it is turned.
fn frame(scene: &Scene, soup: &Soup, group: &Group) -> DAffine3 {
    if group.frame == Turned::NOT {
        return DAffine3::IDENTITY;
    }
    let corners = group.items.iter().flat_map(|&t| scene.world_corners(soup.refs[t as usize]));
    DAffine3 { matrix3: group.frame.rotation, translation: Bounds::of(corners).stored_center() }
}
