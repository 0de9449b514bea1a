//! `bvh`: binned SAH on every object.
//!
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007, as J. Bikker's article "How to
//! build a BVH", 2022, has it and the thesis of 2024 (chapter 4.1) uses it: a tree over the triangles of every object, all
//! trees growing breadth first until the nodes allowed for the scene are spent; the leaves become groups.
//!
//! Helps where objects are large and hollow; hurts where the pieces of long triangles overlap.
//!
//! Where the thesis leaves a choice: the root of every object counts as a node and every split as two more; a split
//! must lower the SAH cost (area times triangles, summed), else the node is a leaf; bins lie on the longest axis of the
//! node's box along which centroids differ at all.

use std::collections::VecDeque;

use super::builder::Builder;
use super::instancing::bake_within_limits;
use super::pieces::{Extent, Item, Piece, Pieces};
use super::{Layout, Options};
use crate::scene::{Bounds, Scene};

/// Bins along the axis of a split.
const BINS: usize = 16;

/// Splits every object by binned SAH within [`Options::nodes_per_triangle_ratio`] of the triangles of all objects.
pub(super) fn bvh(scene: &Scene, options: &Options) -> Layout {
    bake_within_limits(scene, options, |selection| {
        let mut layout = Builder::new(scene);
        selection.left().for_each(|instance| layout.keep(instance));
        let mut pieces = Pieces::new(scene, selection);
        let leaves = split_all(&mut pieces, options);
        pieces.emit(&leaves, &mut layout);
        layout.finish()
    })
}

/// The leaves of all trees, in the order of the objects.
fn split_all(pieces: &mut Pieces, options: &Options) -> Vec<Vec<Piece>> {
    let mut queue: VecDeque<(Piece, Bounds)> = pieces.whole().into();
    let triangles: usize = queue.iter().map(|(piece, _)| piece.len()).sum();
    let allowed = options.nodes_per_triangle_ratio * triangles as f64;
    let min_area = options.min_area_ratio * pieces.scene_area;
    let mut nodes = queue.len();
    let mut leaves = Vec::new();
    while let Some((piece, bounds)) = queue.pop_front() {
        let may_split = (nodes + 2) as f64 <= allowed && piece.len() > options.min_triangles && bounds.area() > min_area;
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
    let extent = Extent::of(items);
    let bins = Bins::along_longest_axis(&extent, &Extent::of_centroids(items))?;
    let (plane, cost) = best_plane(&bins.fill(items))?;
    if cost >= extent.bounds().area() * items.len() as f64 {
        return None;
    }
    let children = pieces.divide(piece, |item| bins.index(item) <= plane);
    Some(children.map(|child| (child, Extent::of(pieces.items(child)).bounds())))
}

/// How centroids fall into bins.
struct Bins {
    axis: usize,
    start: f32,
    bins_per_unit: f32,
}

impl Bins {
    fn along_longest_axis(extent: &Extent, centroids: &Extent) -> Option<Self> {
        let spread = |axis: usize| BINS as f32 / centroids.size()[axis];
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| extent.size()[b].total_cmp(&extent.size()[a]));
        // A spread too small to divide by counts as none.
        let axis = axes.into_iter().find(|&axis| centroids.size()[axis] > 0.0 && spread(axis).is_finite())?;
        Some(Bins { axis, start: centroids.min[axis], bins_per_unit: spread(axis) })
    }

    fn index(&self, item: &Item) -> usize {
        (((item.centroid[self.axis] - self.start) * self.bins_per_unit) as usize).min(BINS - 1)
    }

    /// Number and box of the triangles in each bin.
    fn fill(&self, items: &[Item]) -> [(usize, Extent); BINS] {
        let mut bins = [(0, Extent::EMPTY); BINS];
        for item in items {
            let (count, extent) = &mut bins[self.index(item)];
            *count += 1;
            extent.add(item);
        }
        bins
    }
}

/// The bin before the cheapest plane and the cost of that: for both sides area times triangles. Among equals the
/// first; `None` if all triangles are in one bin.
fn best_plane(bins: &[(usize, Extent); BINS]) -> Option<(usize, f64)> {
    let cost = |(count, extent): &(usize, Extent)| *count as f64 * extent.bounds().area();
    let join = |a: &(usize, Extent), b: &(usize, Extent)| (a.0 + b.0, a.1.union(&b.1));
    let mut right = *bins;
    for i in (0..BINS - 1).rev() {
        right[i] = join(&right[i], &right[i + 1]);
    }
    let mut left = (0, Extent::EMPTY);
    let mut best: Option<(usize, f64)> = None;
    for plane in 0..BINS - 1 {
        left = join(&left, &bins[plane]);
        let total = cost(&left) + cost(&right[plane + 1]);
        if left.0 > 0 && right[plane + 1].0 > 0 && best.is_none_or(|(_, least)| total < least) {
            best = Some((plane, total));
        }
    }
    best
}
