//! `bvh`: binned SAH on each object.
//!
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007, as presented in J. Bikker's article
//! "How to build a BVH", 2022, and used in T. Bilák's thesis "Scene optimization for RTX", 2024, chapter 4.1: a tree
//! over the triangles of each object, all trees growing breadth first until the node budget of the scene is spent; the
//! leaves become groups.
//!
//! Helps if objects are large and hollow; hurts if pieces overlap because of long triangles.
//!
//! Choices that the thesis leaves open: the node budget follows from the triangles of the objects that are
//! restructured; the root of each object counts as a node, even beyond the budget, and each split counts as two more; a
//! split must lower the SAH cost (sum of area times triangles), else the node is a leaf; bins are placed along the
//! longest axis of the node's box along which centroids differ.

use std::collections::VecDeque;

use rayon::prelude::*;

use crate::layout::builder::Builder;
use crate::layout::{Layout, Note};
use crate::methods::instancing::{Known, bake_within_limits};
use crate::methods::pieces::{CHUNK, Item, Piece, Pieces, bounds_of, centroid_bounds};
use crate::methods::{BvhOptions, InstanceOptions};
use crate::scene::{Bounds, Scene};

/// Number of bins along the axis of a split.
const BINS: usize = 16;

/// Splits each object by binned SAH within [`BvhOptions::nodes_per_triangle_ratio`] of the triangles of all objects.
pub(super) fn bvh(scene: &Scene, instances: &InstanceOptions, options: &BvhOptions) -> Layout {
    bake_within_limits(scene, instances, &Known::default(), |selection| {
        let mut layout = Builder::new(scene);
        selection.place_left(&mut layout);
        let mut pieces = Pieces::new(scene, selection);
        let leaves = split_all(&mut pieces, options, &mut layout);
        pieces.emit(&leaves, &mut layout);
        layout.finish()
    })
}

/// Returns the leaves of all trees, in the order of the objects.
fn split_all(pieces: &mut Pieces, options: &BvhOptions, layout: &mut Builder) -> Vec<Vec<Piece>> {
    let mut queue: VecDeque<(Piece, Bounds)> = pieces.whole().into();
    let triangles: usize = queue.iter().map(|(piece, _)| piece.len()).sum();
    let allowed = options.nodes_per_triangle_ratio * triangles as f64;
    let min_area = options.min_area_ratio * pieces.core_area;
    let mut nodes = queue.len();
    if allowed < (nodes + 2) as f64 && nodes > 0 {
        let allowed = allowed.max(0.0) as u64;
        layout.note(Note::NothingSplit { allowed, objects: nodes });
    }
    let mut leaves = Vec::new();
    while let Some((piece, bounds)) = queue.pop_front() {
        let may_split =
            (nodes + 2) as f64 <= allowed && piece.len() > options.min_triangles && bounds.area() > min_area;
        match may_split.then(|| split(pieces, piece)).flatten() {
            Some(children) => {
                nodes += 2;
                queue.extend(children);
            }
            None => leaves.push(piece),
        }
    }
    leaves.sort_unstable();
    leaves.into_iter().map(|leaf| vec![leaf]).collect()
}

/// Splits a node at the best plane between bins; `None` if no plane lowers its cost.
fn split(pieces: &mut Pieces, piece: Piece) -> Option<[(Piece, Bounds); 2]> {
    pieces.load(piece);
    let items = pieces.items(piece);
    let bounds = bounds_of(items);
    let bins = Bins::along_longest_axis(&bounds, &centroid_bounds(items))?;
    let (plane, cost) = best_plane(&bins.fill(items))?;
    if cost >= bounds.area() * items.len() as f64 {
        return None;
    }
    let children = pieces.divide(piece, |item| bins.index(item) <= plane);
    Some(children.map(|child| (child, bounds_of(pieces.items(child)))))
}

/// Maps centroids to bins.
struct Bins {
    axis: usize,
    start: f64,
    bins_per_unit: f64,
}

/// Number and box of the triangles in a bin.
#[derive(Clone, Copy)]
struct Bin {
    count: usize,
    bounds: Bounds,
}

impl Bins {
    fn along_longest_axis(bounds: &Bounds, centroids: &Bounds) -> Option<Self> {
        let (size, spread) = (bounds.size(), centroids.size());
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| size[b].total_cmp(&size[a]));
        let axis = axes.into_iter().find(|&axis| spread[axis] > 0.0)?;
        Some(Bins { axis, start: centroids.min[axis], bins_per_unit: BINS as f64 / spread[axis] })
    }

    fn index(&self, item: &Item) -> usize {
        (((f64::from(item.centroid[self.axis]) - self.start) * self.bins_per_unit) as usize).min(BINS - 1)
    }

    fn fill(&self, items: &[Item]) -> [Bin; BINS] {
        let fill = |mut bins: [Bin; BINS], item: &Item| {
            let bin = &mut bins[self.index(item)];
            *bin = bin.join(&Bin { count: 1, bounds: item.bounds });
            bins
        };
        let join = |a: [Bin; BINS], b: [Bin; BINS]| std::array::from_fn(|i| a[i].join(&b[i]));
        let chunks = items.par_chunks(CHUNK).map(|chunk| chunk.iter().fold([Bin::EMPTY; BINS], fill));
        chunks.reduce(|| [Bin::EMPTY; BINS], join)
    }
}

impl Bin {
    const EMPTY: Bin = Bin { count: 0, bounds: Bounds::EMPTY };

    fn join(&self, other: &Bin) -> Bin {
        Bin { count: self.count + other.count, bounds: self.bounds.union(&other.bounds) }
    }

    fn cost(&self) -> f64 {
        self.count as f64 * self.bounds.area()
    }
}

/// Returns the bin before the cheapest plane, and the cost of the plane: the sum of area times triangles of both sides.
/// The first plane wins ties; `None` if all triangles are in one bin.
fn best_plane(bins: &[Bin; BINS]) -> Option<(usize, f64)> {
    let mut right = *bins;
    for i in (0..BINS - 1).rev() {
        right[i] = bins[i].join(&right[i + 1]);
    }
    let mut left = Bin::EMPTY;
    let mut best: Option<(usize, f64)> = None;
    for plane in 0..BINS - 1 {
        left = left.join(&bins[plane]);
        let cost = left.cost() + right[plane + 1].cost();
        if left.count > 0 && right[plane + 1].count > 0 && best.is_none_or(|(_, least)| cost < least) {
            best = Some((plane, cost));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Pinned;
    use glam::{DAffine3, DVec3, Vec3};

    /// Options with enough nodes for any scene.
    fn ample() -> BvhOptions {
        BvhOptions { nodes_per_triangle_ratio: 1.0, min_area_ratio: 0.0, ..BvhOptions::default() }
    }

    fn checked(scene: &Scene, options: &BvhOptions) -> Layout {
        let layout = bvh(scene, &InstanceOptions::default(), options);
        assert_eq!(layout.check(scene), Ok(()));
        layout
    }

    /// Two clusters of ten triangles, far apart.
    fn dumbbell() -> Vec<[Vec3; 3]> {
        [row(Vec3::ZERO, 10), row(Vec3::X * 1000.0, 10)].concat()
    }

    #[test]
    fn an_empty_scene_gives_an_empty_layout() {
        assert!(checked(&Scene::default(), &ample()).groups.is_empty());
    }

    #[test]
    fn one_triangle_stays() {
        let mut builder = SceneBuilder::default();
        builder.object("one", 0, row(Vec3::ZERO, 1));
        assert_eq!(group_names(&checked(&builder.scene(), &ample())), ["kept one"]);
    }

    #[test]
    fn an_object_of_two_clusters_is_split_between_them() {
        let mut builder = SceneBuilder::default();
        builder.object("dumbbell", 0, dumbbell());
        let scene = builder.scene();
        let layout = checked(&scene, &BvhOptions { nodes_per_triangle_ratio: 3.0 / 20.0, ..ample() });
        assert_eq!(group_names(&layout), ["baked dumbbell.0", "baked dumbbell.1"]);
        assert_eq!(group_sizes(&scene, &layout), [10, 10]);
    }

    #[test]
    fn objects_of_eight_triangles_stay() {
        let mut builder = SceneBuilder::default();
        builder.object("eight", 0, row(Vec3::ZERO, 8));
        builder.object("nine", 0, row(Vec3::Y * 9.0, 9));
        let layout = checked(&builder.scene(), &ample());
        assert_eq!(group_names(&layout), ["kept eight", "baked nine.0", "baked nine.1"]);
    }

    #[test]
    fn the_node_budget_is_kept_and_shared_breadth_first() {
        let mut builder = SceneBuilder::default();
        builder.object("a", 0, row(Vec3::ZERO, 100));
        builder.object("b", 0, row(Vec3::Y * 900.0, 100));
        let scene = builder.scene();
        for (nodes, groups) in [(2, 2), (3, 2), (4, 3), (5, 3), (6, 4), (10, 6)] {
            let ratio = f64::from(nodes) / 200.0;
            let layout = checked(&scene, &BvhOptions { nodes_per_triangle_ratio: ratio, ..ample() });
            assert_eq!(layout.groups.len(), groups, "{nodes} nodes");
        }
        let layout = checked(&scene, &BvhOptions { nodes_per_triangle_ratio: 6.0 / 200.0, ..ample() });
        assert_eq!(group_sizes(&scene, &layout), [50, 50, 50, 50]);
    }

    #[test]
    fn a_budget_below_the_objects_splits_nothing_and_says_so() {
        let mut builder = SceneBuilder::default();
        builder.object("a", 0, row(Vec3::ZERO, 100));
        let layout = checked(&builder.scene(), &BvhOptions { nodes_per_triangle_ratio: 1e-3, ..ample() });
        assert_eq!(group_names(&layout), ["kept a"]);
        assert_eq!(layout.notes, [Note::NothingSplit { allowed: 0, objects: 1 }]);
    }

    #[test]
    fn small_boxes_stay() {
        let mut builder = SceneBuilder::default();
        builder.object("large", 0, row(Vec3::ZERO, 20));
        builder.object("small", 0, row(Vec3::ZERO, 20).iter().map(|t| t.map(|p| p * 0.01)).collect());
        let layout = checked(&builder.scene(), &BvhOptions { min_area_ratio: 0.5, ..ample() });
        assert_eq!(group_names(&layout), ["kept small", "baked large.0", "baked large.1"]);
    }

    #[test]
    fn equal_triangles_cannot_be_split() {
        let mut builder = SceneBuilder::default();
        builder.object("pile", 0, vec![small_triangle(Vec3::ONE); 20_000]);
        assert_eq!(group_names(&checked(&builder.scene(), &ample())), ["kept pile"]);
    }

    #[test]
    fn triangles_as_long_as_their_object_stay_together() {
        let spanning = |i: i32| [Vec3::X * -50.0, Vec3::X * 50.0, Vec3::new(i as f32 - 25.0, 10.0, 10.0)];
        let mut builder = SceneBuilder::default();
        builder.object("fan", 0, (0..50).map(spanning).collect());
        assert_eq!(group_names(&checked(&builder.scene(), &ample())), ["kept fan"]);
    }

    #[test]
    fn pinned_instances_stay_and_others_of_their_mesh_are_split() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("mesh", vec![(0, dumbbell())]);
        builder.place(mesh, "pinned", DAffine3::IDENTITY).pinned = Some(Pinned::Animated);
        builder.place(mesh, "mirrored", DAffine3::from_scale(DVec3::new(-1.0, 2.0, 1.0)));
        let scene = builder.scene();
        let layout = checked(&scene, &BvhOptions { nodes_per_triangle_ratio: 3.0 / 20.0, ..ample() });
        assert_eq!(group_names(&layout), ["kept mesh", "baked mirrored.0", "baked mirrored.1"]);
    }

    #[test]
    fn each_material_of_a_mesh_is_an_object() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("mesh", vec![(0, row(Vec3::ZERO, 5)), (1, dumbbell())]);
        builder.place(mesh, "node", at(1.0, 0.0, 0.0));
        let scene = builder.scene();
        let layout = checked(&scene, &BvhOptions { nodes_per_triangle_ratio: 4.0 / 25.0, ..ample() });
        assert_eq!(group_names(&layout), ["piece mesh.0", "baked node.1.0", "baked node.1.1"]);
        assert_eq!(group_sizes(&scene, &layout), [5, 10, 10]);
    }

    #[test]
    fn huge_and_tiny_scenes_are_split_alike() {
        let sizes = |scale: f32| {
            let mut builder = SceneBuilder::default();
            builder.object("row", 0, row(Vec3::ZERO, 100).iter().map(|t| t.map(|p| p * scale)).collect());
            let scene = builder.scene();
            group_sizes(&scene, &checked(&scene, &ample()))
        };
        let expected = sizes(1.0);
        assert!(expected.len() > 10);
        for power in [-90, -60, 60, 100] {
            assert_eq!(sizes(2f32.powi(power)), expected, "2^{power}");
        }
    }
}
