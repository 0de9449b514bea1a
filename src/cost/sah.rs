//! SAH cost.
//!
//! J. Goldsmith, J. Salmon, "Automatic Creation of Object Hierarchies for Ray Tracing", IEEE CG&A 7(5), 1987, and J. D.
//! MacDonald, K. S. Booth, "Heuristics for Ray Tracing Using Space Subdivision", The Visual Computer 6, 1990: the
//! expected cost of a random line through the scene that enters each box it meets and hits nothing.

use glam::DVec3;

use crate::scene::Bounds;
use crate::tree::Tree;

/// Cost of traversing an inner node; the unit of all costs.
pub const TRAVERSAL: f64 = 1.0;

/// Cost of a triangle test.
pub const INTERSECTION: f64 = 1.0;

/// Returns the SAH cost of a tree over items with the given boxes: (1/A_root)(C_t sum over inner nodes A_n + C_i sum
/// over leaves A_l N_l), where C_t is [`TRAVERSAL`] and C_i is [`INTERSECTION`]. At least 0, lower is better; 0 if the
/// root has no area. Does not model occlusion or the order in which rays meet nodes.
pub fn cost(tree: &Tree, boxes: &[Bounds]) -> f64 {
    let bounds = tree.bounds(boxes);
    let root = bounds.first().map_or(0.0, Bounds::area);
    super::share(FaceAreas::of(tree, &bounds).cost(DVec3::ONE), root)
}

/// Surface areas of the boxes of a tree, summed separately for the faces perpendicular to each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaceAreas {
    /// Areas of inner nodes.
    pub inner: DVec3,
    /// Areas of leaves, each counted once per item in it.
    pub leaves: DVec3,
}

impl FaceAreas {
    /// Sums the boxes of a tree's nodes; `bounds` is parallel to them.
    pub fn of(tree: &Tree, bounds: &[Bounds]) -> FaceAreas {
        FaceAreas::sum(tree.nodes.iter().zip(bounds).map(|(node, bounds)| (node.count, *bounds)))
    }

    /// Sums the boxes of nodes, each given with its number of items: 0 for an inner node.
    pub fn sum(nodes: impl Iterator<Item = (u32, Bounds)>) -> FaceAreas {
        let mut sums = FaceAreas::default();
        for (count, bounds) in nodes {
            let s = bounds.size();
            let faces = 2.0 * DVec3::new(s.y * s.z, s.z * s.x, s.x * s.y);
            match count {
                0 => sums.inner += faces,
                count => sums.leaves += f64::from(count) * faces,
            }
        }
        sums
    }

    /// Returns C_t times the area of inner nodes plus C_i times that of leaves, in squared units, with faces
    /// perpendicular to each axis scaled by `scale`.
    pub fn cost(&self, scale: DVec3) -> f64 {
        (TRAVERSAL * self.inner + INTERSECTION * self.leaves).dot(scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::{Node, Quality};

    fn cube(x: f64) -> Bounds {
        Bounds { min: DVec3::new(x, 0.0, 0.0), max: DVec3::new(x + 1.0, 1.0, 1.0) }
    }

    #[test]
    fn two_cubes_cost_a_node_and_a_test_each_where_met() {
        let nodes = vec![Node { first: 1, count: 0 }, Node { first: 0, count: 1 }, Node { first: 1, count: 1 }];
        let tree = Tree { nodes, order: vec![0, 1] };
        assert_eq!(cost(&tree, &[cube(0.0), cube(3.0)]), (18.0 + 6.0 + 6.0) / 18.0);
    }

    #[test]
    fn one_leaf_costs_its_items() {
        let tree = Tree { nodes: vec![Node { first: 0, count: 3 }], order: vec![0, 1, 2] };
        assert_eq!(cost(&tree, &[cube(0.0), cube(1.0), cube(5.0)]), 3.0);
    }

    #[test]
    fn no_area_costs_nothing() {
        assert_eq!(cost(&Tree::default(), &[]), 0.0);
        let points = vec![Bounds { min: DVec3::ONE, max: DVec3::ONE }; 100];
        assert_eq!(cost(&Tree::build(&points, Quality::Medium), &points), 0.0);
    }

    #[test]
    fn cost_does_not_depend_on_scale() {
        let boxes = |scale: f64| -> Vec<Bounds> {
            let at = |i: u32| DVec3::new(f64::from(i % 13), f64::from(i % 7), f64::from(i % 5));
            (0..200).map(|i| Bounds { min: scale * at(i), max: scale * (at(i) + DVec3::ONE) }).collect()
        };
        let tree = Tree::build(&boxes(1.0), Quality::Medium);
        let expected = cost(&tree, &boxes(1.0));
        assert!(expected > 1.0);
        for scale in [1e-30, 1e30] {
            assert!((cost(&tree, &boxes(scale)) / expected - 1.0).abs() < 1e-12);
        }
    }
}
