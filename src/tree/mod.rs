//! Binary trees over boxes.
//!
//! D. Meister, J. Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", IEEE TVCG
//! 24(3), 2018, with D. Meister, J. Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization",
//! Computer Graphics Forum 37(2), 2018, as implemented by the crate `obvhs`. Equal input gives an equal tree. Trees do
//! not store boxes: [`Tree::refit`] computes them in the coordinates and precision needed.

mod clustering;
mod divide;
mod graft;
mod retain;

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;

use self::divide::{divide, joined};
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::Bounds;

/// How much time to spend on building a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// To order triangles.
    Fast,
    /// To compute a cost, or to trace.
    Medium,
    /// To compute a cost with one item per leaf, like instances in a TLAS.
    Instances,
}

impl Quality {
    /// Parameters for clustering, optimisation and collapsing into leaves.
    fn params(self) -> BvhBuildParams {
        match self {
            Quality::Fast => BvhBuildParams::very_fast_build(),
            Quality::Medium => BvhBuildParams::medium_build(),
            Quality::Instances => BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() },
        }
    }

    /// Items per leaf when boxes are indistinguishable.
    fn equal_leaf(self) -> usize {
        match self {
            Quality::Fast | Quality::Medium => 4,
            Quality::Instances => 1,
        }
    }
}

/// A node of a [`Tree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// For an inner node, its children are `nodes[first]` and `nodes[first + 1]`; for a leaf, its items are
    /// `order[first..first + count]`.
    pub first: u32,
    /// Number of items in a leaf; 0 for an inner node.
    pub count: u32,
}

impl Node {
    /// Whether the node holds items.
    pub fn is_leaf(&self) -> bool {
        self.count > 0
    }

    /// Returns the items of a leaf, as a range of [`Tree::order`]; empty for an inner node.
    pub fn items(&self) -> std::ops::Range<usize> {
        if self.is_leaf() { self.first as usize..(self.first + self.count) as usize } else { 0..0 }
    }
}

/// A binary tree over numbered items. Children come after their parent; leaves, in depth-first order with left before
/// right, hold consecutive ranges of `order`. Without items there are no nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tree {
    /// The nodes; the root is the first.
    pub nodes: Vec<Node>,
    /// The items, in tree order.
    pub order: Vec<u32>,
}

/// A box as passed to the builder.
#[derive(Clone, Copy)]
pub(super) struct Boxed(pub(super) Aabb);

impl Boundable for Boxed {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tree {
    /// Builds a tree over finite, non-empty boxes; item `i` is `boxes[i]`.
    ///
    /// Departs from the papers when many boxes share one Morton cell (equal triangles, or a far outlier that squeezes
    /// the rest of the scene into a few cells): clustering such boxes takes quadratic time, so they enter the tree as
    /// one item and get a tree of their own, scaled to their own extent. Very many boxes are first divided into parts
    /// from the top down (`divide`), which takes less memory and uses all threads.
    pub fn build(boxes: &[Bounds], quality: Quality) -> Tree {
        build_members((0..boxes.len() as u32).collect(), quality, &|i| boxes[i as usize])
    }

    /// Builds a tree over the boxes that are not empty and small enough for their areas to be finite; item `i` is
    /// `boxes[i]`, and `order` omits the others.
    pub fn build_usable(boxes: &[Bounds], quality: Quality) -> Tree {
        Tree::build_from(boxes.len(), quality, &|i| boxes[i as usize])
    }

    /// Like [`Tree::build_usable`], but computes boxes on demand, each of them several times.
    pub fn build_from(count: usize, quality: Quality, bounds: &(dyn Fn(u32) -> Bounds + Sync)) -> Tree {
        let usable = |b: Bounds| !b.is_empty() && b.min.abs().max(b.max.abs()).max_element() < LARGEST;
        let members =
            (0..count as u32).into_par_iter().with_min_len(CHEAP_ELEMENTS).filter(|&i| usable(bounds(i))).collect();
        build_members(members, quality, bounds)
    }

    /// Returns the items below a node, as a range of [`Tree::order`].
    pub fn items_below(&self, node: u32) -> std::ops::Range<usize> {
        let (mut first, mut last) = (node as usize, node as usize);
        while !self.nodes[first].is_leaf() {
            first = self.nodes[first].first as usize;
        }
        while !self.nodes[last].is_leaf() {
            last = self.nodes[last].first as usize + 1;
        }
        self.nodes[first].items().start..self.nodes[last].items().end
    }

    /// Returns the box around the items below each node, given the boxes of all items; parallel to `nodes`.
    pub fn bounds(&self, boxes: &[Bounds]) -> Vec<Bounds> {
        let around = |items: &[u32]| items.iter().fold(Bounds::EMPTY, |all, &i| all.union(&boxes[i as usize]));
        self.refit(around, Bounds::union)
    }

    /// Computes a value for each node from the bottom up, such as its box: `leaf` from the items of a leaf (in tree
    /// order), `join` from the values of two children. The result is parallel to `nodes`.
    pub fn refit<T: Clone>(&self, mut leaf: impl FnMut(&[u32]) -> T, mut join: impl FnMut(&T, &T) -> T) -> Vec<T> {
        let mut reversed: Vec<T> = Vec::with_capacity(self.nodes.len());
        let last = self.nodes.len().wrapping_sub(1);
        for node in self.nodes.iter().rev() {
            let value = if node.is_leaf() {
                leaf(&self.order[node.items()])
            } else {
                let left = last - node.first as usize;
                join(&reversed[left], &reversed[left - 1])
            };
            reversed.push(value);
        }
        reversed.reverse();
        reversed
    }

    /// Gives a node two children and returns the first.
    pub(super) fn split(&mut self, at: usize) -> usize {
        let child = self.nodes.len();
        self.nodes[at] = Node { first: child as u32, count: 0 };
        self.nodes.extend([Node { first: 0, count: 0 }; 2]);
        child
    }

    /// Turns a node into a leaf that holds the next items in tree order.
    pub(super) fn fill(&mut self, at: usize, items: Vec<u32>) {
        self.nodes[at] = Node { first: self.order.len() as u32, count: items.len() as u32 };
        self.order.extend(items);
    }

    /// Returns the largest number of nodes on a path from the root to a leaf; 0 for an empty tree.
    pub fn depth(&self) -> usize {
        self.refit(|_| 1, |a: &usize, b| 1 + a.max(b)).first().copied().unwrap_or(0)
    }
}

/// More boxes than this in one Morton cell are clustered separately.
const CROWD: usize = 64;
/// More boxes than this are built in parts, because the builder takes about 130 bytes per box.
const PART: usize = 1 << 20;
/// Boxes per parallel task.
const CHUNK: usize = 1 << 12;
/// Coordinates below this have finite products.
const LARGEST: f64 = 1e150;

/// The items to cluster: single boxes, followed by trees over crowds of boxes.
struct Items {
    ones: Vec<u32>,
    crowds: Vec<Tree>,
    crowd_bounds: Vec<Bounds>,
}

/// A part of a tree that is still to be written.
enum Part<'a> {
    Clustered(&'a Bvh2, usize),
    Listed(&'a [u32]),
    Crowd(&'a Tree, usize),
}

impl Items {
    /// Returns the number of items.
    fn count(&self) -> usize {
        self.ones.len() + self.crowds.len()
    }

    /// Returns the tree that item `i` stands for; `None` if it is a single box.
    fn crowd(&self, i: u32) -> Option<&Tree> {
        (i as usize).checked_sub(self.ones.len()).map(|crowd| &self.crowds[crowd])
    }
}

/// Builds the tree over some items, in parts if there are very many.
fn build_members(members: Vec<u32>, quality: Quality, bounds: &(dyn Fn(u32) -> Bounds + Sync)) -> Tree {
    divide(members, PART, bounds, &|part| build_over(part, quality, bounds), &joined)
}

/// Builds the tree over some of the boxes. Boxes are not stored: they take more memory than the data they are computed
/// from, and memory use peaks here.
fn build_over(members: Vec<u32>, quality: Quality, bounds: &(dyn Fn(u32) -> Bounds + Sync)) -> Tree {
    let (ones, crowds) = crowded_cells(&members, bounds);
    if ones.is_empty() && crowds.len() == 1 {
        return halved(members, quality.equal_leaf());
    }
    drop(members);
    let around = |crowd: &Vec<u32>| crowd.iter().fold(Bounds::EMPTY, |all, &i| all.union(&bounds(i)));
    let crowd_bounds = crowds.iter().map(around).collect();
    let crowds = crowds.into_par_iter().map(|crowd| build_over(crowd, quality, bounds)).collect();
    let items = Items { ones, crowds, crowd_bounds };
    let seen = in_unit_cube(&items, bounds);
    cluster(&items, &seen, quality)
}

/// Splits members into those that share their Morton cell with few others, and the crowds of the other cells, both in
/// member order. The cells divide the box of the members' centroids, so all members form one crowd only if their
/// centroids are equal.
fn crowded_cells(members: &[u32], bounds: &(dyn Fn(u32) -> Bounds + Sync)) -> (Vec<u32>, Vec<Vec<u32>>) {
    let of_chunk = |chunk: &[u32]| Bounds::of(chunk.iter().map(|&i| bounds(i).center()));
    let centroids = members.par_chunks(CHUNK).map(of_chunk).reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
    let cells_per_unit = 1.0 / centroids.size().max_element() * f64::from(1 << 20);
    let cell = |i: u32| -> u64 {
        let offset = bounds(i).center() - centroids.min;
        let scaled = if cells_per_unit.is_finite() { offset * cells_per_unit } else { DVec3::ZERO };
        (scaled.x as u64) << 42 | (scaled.y as u64) << 21 | scaled.z as u64
    };
    let mut cells: Vec<(u64, u32)> =
        members.par_iter().enumerate().with_min_len(CHUNK).map(|(at, &i)| (cell(i), at as u32)).collect();
    cells.par_sort_unstable();
    let mut crowds: Vec<Vec<u32>> = Vec::new();
    let mut is_crowded = vec![false; members.len()];
    for chunk in cells.chunk_by(|a, b| a.0 == b.0).filter(|chunk| chunk.len() > CROWD) {
        crowds.push(chunk.iter().map(|c| members[c.1 as usize]).collect());
        chunk.iter().for_each(|c| is_crowded[c.1 as usize] = true);
    }
    let loners = members.iter().zip(is_crowded).filter(|(_, crowded)| !crowded).map(|(&i, _)| i);
    (loners.collect(), crowds)
}

/// Builds a balanced tree over indistinguishable boxes.
fn halved(members: Vec<u32>, leaf_items: usize) -> Tree {
    let mut tree = Tree { nodes: vec![Node { first: 0, count: 0 }], order: Vec::new() };
    let mut stack = vec![(0..members.len(), 0)];
    while let Some((range, to)) = stack.pop() {
        if range.len() <= leaf_items {
            tree.nodes[to] = Node { first: range.start as u32, count: range.len() as u32 };
        } else {
            let middle = range.start + range.len() / 2;
            let child = tree.split(to);
            stack.extend([(middle..range.end, child + 1), (range.start..middle, child)]);
        }
    }
    tree.order = members;
    tree
}

/// Builds the tree by locally ordered clustering and grafts in the trees of crowds.
fn cluster(items: &Items, boxed: &(dyn Fn(u32) -> Boxed + Sync), quality: Quality) -> Tree {
    let bvh = clustering::build(items.count(), boxed, &quality.params());
    let mut tree = Tree { nodes: Vec::with_capacity(bvh.nodes.len()), order: Vec::with_capacity(items.ones.len()) };
    if bvh.nodes.is_empty() {
        return tree;
    }
    tree.nodes.push(Node { first: 0, count: 0 });
    let mut stack = vec![(Part::Clustered(&bvh, 0), 0)];
    while let Some((part, to)) = stack.pop() {
        match part.open(items) {
            Opened::Leaf(members) => tree.fill(to, members),
            Opened::Inner(left, right) => {
                let child = tree.split(to);
                stack.extend([(right, child + 1), (left, child)]);
            }
        }
    }
    tree
}

/// What a [`Part`] consists of.
enum Opened<'a> {
    Leaf(Vec<u32>),
    Inner(Part<'a>, Part<'a>),
}

impl<'a> Part<'a> {
    fn open(self, items: &'a Items) -> Opened<'a> {
        match self {
            Part::Clustered(bvh, at) => {
                let node = &bvh.nodes[at];
                let first = node.first_index as usize;
                match node.prim_count as usize {
                    0 => Opened::Inner(Part::Clustered(bvh, first), Part::Clustered(bvh, first + 1)),
                    count => Part::Listed(&bvh.primitive_indices[first..first + count]).open(items),
                }
            }
            Part::Listed(list) => match (list, list.first().and_then(|&i| items.crowd(i))) {
                ([_], Some(tree)) => Part::Crowd(tree, 0).open(items),
                _ => match singles(list, items) {
                    Some(members) => Opened::Leaf(members),
                    None => {
                        let (left, right) = list.split_at(list.len() / 2);
                        Opened::Inner(Part::Listed(left), Part::Listed(right))
                    }
                },
            },
            Part::Crowd(tree, at) => {
                let node = tree.nodes[at];
                if node.is_leaf() {
                    Opened::Leaf(tree.order[node.items()].to_vec())
                } else {
                    Opened::Inner(Part::Crowd(tree, node.first as usize), Part::Crowd(tree, node.first as usize + 1))
                }
            }
        }
    }
}

/// Returns the boxes of the listed items; `None` if one of the items is a crowd.
fn singles(list: &[u32], items: &Items) -> Option<Vec<u32>> {
    list.iter().map(|&i| items.ones.get(i as usize).copied()).collect()
}

/// Margin added to boxes for the builder, relative to the unit cube: boxes that all lie on a line have no area to
/// distinguish them by, and clustering equal boxes takes quadratic time.
const REACH: f32 = 1.0 / (1 << 22) as f32;

/// Returns the boxes of items, moved and uniformly scaled into the unit cube, so that areas neither overflow nor
/// underflow in the builder's single precision.
fn in_unit_cube(items: &Items, bounds: &(dyn Fn(u32) -> Bounds + Sync)) -> impl Fn(u32) -> Boxed + Sync {
    let of_item = move |item: u32| match items.ones.get(item as usize) {
        Some(&one) => bounds(one),
        None => items.crowd_bounds[item as usize - items.ones.len()],
    };
    let every = (0..items.count() as u32).into_par_iter().with_min_len(CHUNK);
    let all = every.map(of_item).reduce(|| Bounds::EMPTY, |a, b| a.union(&b));
    let center = all.center();
    let scale = 1.0 / all.size().max_element();
    let scale = if scale.is_finite() { scale } else { 0.0 };
    let point = move |p: DVec3| Vec3A::from((scale * (p - center)).as_vec3());
    move |item| {
        let Bounds { min, max } = of_item(item);
        Boxed(Aabb::new(point(min) - REACH, point(max) + REACH))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn unit_boxes(at: impl IntoIterator<Item = DVec3>) -> Vec<Bounds> {
        at.into_iter().map(|min| Bounds { min, max: min + DVec3::ONE }).collect()
    }

    fn assert_each_item_once(tree: &Tree, items: usize) {
        let mut order = tree.order.clone();
        order.sort_unstable();
        assert!(order.iter().copied().eq(0..items as u32));
        let leaves: usize = tree.nodes.iter().map(|n| n.count as usize).sum();
        assert_eq!(leaves, items);
    }

    #[test]
    fn no_items_give_no_nodes() {
        assert_eq!(Tree::build(&[], Quality::Medium), Tree::default());
        assert_eq!(Tree::default().depth(), 0);
    }

    #[test]
    fn one_item_is_a_leaf() {
        let tree = Tree::build(&unit_boxes([DVec3::ZERO]), Quality::Medium);
        assert_eq!(tree.nodes, [Node { first: 0, count: 1 }]);
        assert_eq!(tree.depth(), 1);
    }

    #[test]
    fn leaves_follow_tree_order() {
        let tree = Tree::build(&unit_boxes((0..1000).map(|i| dvec3((i * 7 % 1000) as f64, 0.0, 0.0))), Quality::Fast);
        assert_each_item_once(&tree, 1000);
        let mut next = 0;
        let mut stack = vec![0];
        while let Some(n) = stack.pop() {
            let node = tree.nodes[n as usize];
            if node.is_leaf() {
                assert_eq!(node.first, next);
                next += node.count;
            } else {
                assert!(node.first > n);
                stack.extend([node.first + 1, node.first]);
            }
        }
    }

    #[test]
    fn equal_and_extreme_boxes_give_shallow_trees() {
        for scale in [1e-30, 1.0, 1e30] {
            let same = vec![Bounds { min: DVec3::ZERO, max: DVec3::splat(scale) }; 100_000];
            let tree = Tree::build(&same, Quality::Medium);
            assert_each_item_once(&tree, same.len());
            assert!(tree.depth() < 96, "depth {}", tree.depth());
        }
        let points = vec![Bounds { min: DVec3::ONE, max: DVec3::ONE }; 1000];
        assert_each_item_once(&Tree::build(&points, Quality::Medium), 1000);
    }

    #[test]
    fn a_far_outlier_does_not_make_the_rest_one_crowd() {
        let mut boxes = unit_boxes((0..50_000).map(|i| dvec3((i % 256) as f64, (i / 256) as f64, 0.0)));
        boxes.push(Bounds { min: DVec3::splat(1e12), max: DVec3::splat(1e12 + 1.0) });
        let tree = Tree::build(&boxes, Quality::Medium);
        assert_each_item_once(&tree, boxes.len());
        assert!(tree.depth() < 96, "depth {}", tree.depth());
        let small = tree.bounds(&boxes).iter().filter(|b| b.size().max_element() < 16.0).count();
        assert!(small > 20_000, "only {small} small nodes");
    }

    #[test]
    fn each_instance_has_its_own_leaf() {
        let mut boxes = unit_boxes((0..300).map(|i| dvec3((i % 7) as f64, (i % 11) as f64, 0.0)));
        boxes.extend(unit_boxes([dvec3(0.5, 0.5, 0.5); 200]));
        let tree = Tree::build(&boxes, Quality::Instances);
        assert_each_item_once(&tree, boxes.len());
        assert!(tree.nodes.iter().all(|n| n.count <= 1));
        assert_eq!(tree.nodes.len(), 2 * boxes.len() - 1);
    }

    #[test]
    fn boxes_beyond_measure_are_left_out() {
        let mut boxes = unit_boxes((0..10).map(|i| dvec3(i as f64, 0.0, 0.0)));
        boxes[3] = Bounds::EMPTY;
        boxes[5].max.y = f64::INFINITY;
        boxes[6].min.z = f64::NAN;
        boxes[8] = Bounds { min: DVec3::splat(-1e300), max: DVec3::splat(1e300) };
        let mut order = Tree::build_usable(&boxes, Quality::Instances).order;
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 4, 7, 9]);
    }

    #[test]
    fn boxes_of_the_smallest_sizes_give_a_tree() {
        let tiny = |i: u32| Bounds { min: DVec3::ZERO, max: DVec3::splat(f64::from(i) * 5e-324) };
        let boxes: Vec<Bounds> = (0..100).map(tiny).collect();
        assert_each_item_once(&Tree::build(&boxes, Quality::Medium), boxes.len());
    }

    #[test]
    fn points_and_segments_on_a_line_give_shallow_trees() {
        let line = |length: f64| {
            (0..32_000)
                .map(move |i| dvec3(f64::from(i), 0.0, 0.0))
                .map(move |min| Bounds { min, max: min + dvec3(length, 0.0, 0.0) })
                .collect::<Vec<_>>()
        };
        for boxes in [line(0.0), line(1.0)] {
            let tree = Tree::build(&boxes, Quality::Medium);
            assert_each_item_once(&tree, boxes.len());
            assert!(tree.depth() < 96, "depth {}", tree.depth());
        }
    }

    #[test]
    fn refit_bounds_every_item() {
        let boxes = unit_boxes((0..500).map(|i| dvec3((i % 23) as f64, (i % 17) as f64, (i % 5) as f64)));
        let tree = Tree::build(&boxes, Quality::Medium);
        assert_eq!(tree.bounds(&boxes)[0], boxes.iter().fold(Bounds::EMPTY, |a, b| a.union(b)));
    }
}
