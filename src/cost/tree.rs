//! Binary trees over boxes.
//!
//! D. Meister, J. Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", IEEE
//! TVCG 24(3), 2018, with D. Meister, J. Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization",
//! Computer Graphics Forum 37(2), 2018, as the crate `obvhs` builds them, in one thread, so that equal input gives
//! an equal tree. The tree holds no boxes: [`Tree::refit`] computes them in whatever frame and precision is wanted.

use std::time::Duration;

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::{Boundable, BvhBuildParams};

use crate::scene::Bounds;

/// How much time to spend on a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// For an order of triangles.
    Fast,
    /// For a cost, and for tracing.
    Medium,
}

/// A node of a [`Tree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// Inner node: its children are `nodes[first]` and `nodes[first + 1]`. Leaf: its items are
    /// `order[first..first + count]`.
    pub first: u32,
    /// Items of a leaf; 0 for an inner node.
    pub count: u32,
}

impl Node {
    /// Whether the node holds items.
    pub fn is_leaf(&self) -> bool {
        self.count > 0
    }

    /// The items of a leaf, as a range of [`Tree::order`]; empty for an inner node.
    pub fn items(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// A binary tree over numbered items. Children come after their parent; leaves, met depth first and left before
/// right, hold consecutive ranges of `order`. No nodes where there are no items.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tree {
    /// The nodes; the root is the first.
    pub nodes: Vec<Node>,
    /// The items, in tree order.
    pub order: Vec<u32>,
}

struct Boxed(Aabb);

impl Boundable for Boxed {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tree {
    /// Builds a tree over finite, non-empty boxes; item `i` is `boxes[i]`.
    pub fn build(boxes: &[Bounds], quality: Quality) -> Tree {
        if boxes.is_empty() {
            return Tree::default();
        }
        let params = match quality {
            Quality::Fast => BvhBuildParams::very_fast_build(),
            Quality::Medium => BvhBuildParams::medium_build(),
        };
        let bvh = build_bvh2(&in_unit_cube(boxes), params, &mut Duration::default());
        let mut tree = Tree { nodes: Vec::with_capacity(bvh.nodes.len()), order: Vec::with_capacity(boxes.len()) };
        tree.nodes.push(Node { first: 0, count: 0 });
        let mut stack = vec![(0, 0)];
        while let Some((from, to)) = stack.pop() {
            let node = &bvh.nodes[from];
            let first = node.first_index as usize;
            if node.prim_count > 0 {
                tree.nodes[to] = Node { first: tree.order.len() as u32, count: node.prim_count };
                tree.order.extend_from_slice(&bvh.primitive_indices[first..first + node.prim_count as usize]);
            } else {
                let child = tree.nodes.len();
                tree.nodes[to] = Node { first: child as u32, count: 0 };
                tree.nodes.extend([Node { first: 0, count: 0 }; 2]);
                stack.extend([(first + 1, child + 1), (first, child)]);
            }
        }
        tree
    }

    /// Computes a value for every node from the bottom up, such as its box: `leaf` from the items of a leaf (in
    /// tree order), `join` from the values of two children. The result runs parallel to `nodes`.
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

    /// The largest number of nodes on a way from the root to a leaf; 0 for an empty tree.
    pub fn depth(&self) -> usize {
        self.refit(|_| 1, |a: &usize, b| 1 + a.max(b)).first().copied().unwrap_or(0)
    }
}

/// The boxes moved and scaled uniformly into the unit cube, so that areas neither overflow nor vanish in the
/// builder's single precision.
fn in_unit_cube(boxes: &[Bounds]) -> Vec<Boxed> {
    let all = boxes.iter().fold(Bounds::EMPTY, |all, b| all.union(b));
    let center = all.center();
    let extent = all.size().max_element();
    let scale = if extent > 0.0 { 1.0 / extent } else { 0.0 };
    let point = |p: glam::DVec3| Vec3A::from((scale * (p - center)).as_vec3());
    boxes.iter().map(|b| Boxed(Aabb::new(point(b.min), point(b.max)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, dvec3};

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
    fn refit_bounds_every_item() {
        let boxes = unit_boxes((0..500).map(|i| dvec3((i % 23) as f64, (i % 17) as f64, (i % 5) as f64)));
        let tree = Tree::build(&boxes, Quality::Medium);
        let bounds = tree.refit(
            |items| items.iter().fold(Bounds::EMPTY, |b, &i| b.union(&boxes[i as usize])),
            |a, b| a.union(b),
        );
        assert_eq!(bounds[0], boxes.iter().fold(Bounds::EMPTY, |a, b| a.union(b)));
    }
}
