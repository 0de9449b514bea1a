//! The cost of a two-level structure.
//!
//! SAH extended to two levels: C. Benthin, S. Woop, I. Wald, A. Áfra, "Improved Two-Level BVHs using Partial
//! Re-Braiding", High Performance Graphics 2017, describe the problem; the cost of an instance entry is our own.

use glam::{DMat3, DVec3};

use super::sah::{FaceAreas, TRAVERSAL};
use super::structure::Structure;
use crate::layout::Layout;

/// Cost of entering an instance (transforming the ray and starting at another root), relative to [`TRAVERSAL`]. Fitted
/// on an NVIDIA H200 over 97 layouts of 15 scenes: an entry costs about 4.4 binary node steps for incoherent rays and 7
/// for coherent ones.
pub const INSTANCE_ENTRY: f64 = 5.0;

/// The terms of a two-level cost, in squared world units: areas times costs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwoLevelCost {
    /// C_t times the areas of the TLAS's inner nodes.
    pub top: f64,
    /// C_x times the areas of the placements' world boxes.
    pub entries: f64,
    /// For each placement, C_t times the areas of its BLAS's inner nodes plus C_i times the areas of its leaves, each
    /// counted once per triangle in it.
    pub bottom: f64,
}

impl TwoLevelCost {
    /// Sums the terms for a layout and its structure.
    pub fn of(structure: &Structure, layout: &Layout) -> TwoLevelCost {
        let top = structure.tlas.bounds(&structure.boxes);
        let inner = structure.tlas.nodes.iter().zip(&top).filter(|(node, _)| !node.is_leaf());
        let placed = layout.placements.iter().zip(&structure.boxes).map(|(placement, bounds)| {
            let areas = &structure.blas[placement.group as usize].areas;
            TwoLevelCost::of_placement(bounds.area(), areas, &placement.transform.matrix3)
        });
        TwoLevelCost::sum(inner.map(|(_, bounds)| bounds.area()), placed)
    }

    /// Returns the terms of one placement: `area` is that of its world box, `areas` are those of its BLAS, `linear` is
    /// the linear part of world from group.
    ///
    /// A BLAS node is intersected in group space, so its area in world units is that of the parallelepiped into which
    /// the placement transforms its box, not that of the larger world box around it: under a matrix M, faces
    /// perpendicular to an axis are scaled by the length of that column of M's cofactor matrix. TLAS nodes and entries
    /// use world boxes, as a driver sees them.
    pub fn of_placement(area: f64, areas: &FaceAreas, linear: &DMat3) -> TwoLevelCost {
        TwoLevelCost { top: 0.0, entries: INSTANCE_ENTRY * area, bottom: areas.cost(face_scale(linear)) }
    }

    /// Sums the areas of the TLAS's inner nodes and the terms of the placements.
    pub fn sum(inner: impl Iterator<Item = f64>, placements: impl Iterator<Item = TwoLevelCost>) -> TwoLevelCost {
        let mut sum = TwoLevelCost { top: inner.map(|area| TRAVERSAL * area).sum(), ..TwoLevelCost::default() };
        for placement in placements {
            sum.entries += placement.entries;
            sum.bottom += placement.bottom;
        }
        sum
    }

    /// Returns the two-level cost: (1/A_S)[C_t sum over TLAS inner nodes A_n + sum over instances (C_x A_loose + C_t
    /// sum over its BLAS inner nodes A_n + C_i sum over its leaves A_l N_l)]. `scene_area` is A_S, the surface area of
    /// the box of the scene, not of the layout, so that costs of layouts are comparable. At least 0, lower is better; 0
    /// if the scene has no area. Does not model occlusion or the order in which rays meet boxes.
    pub fn cost(&self, scene_area: f64) -> f64 {
        super::share(self.top + self.entries + self.bottom, scene_area)
    }

    /// Returns the SAH cost of the TLAS and the BLASes below its leaves taken as one tree: the two-level cost with free
    /// entries.
    pub fn flat_cost(&self, scene_area: f64) -> f64 {
        super::share(self.top + self.bottom, scene_area)
    }
}

/// Returns the matrix that transforms area vectors when `m` transforms points: its columns are the cross products of
/// those of `m`.
pub(super) fn cofactor(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Returns the factor by which a matrix scales areas perpendicular to each axis.
pub(super) fn face_scale(m: &DMat3) -> DVec3 {
    let cofactor = cofactor(m);
    DVec3::new(cofactor.x_axis.length(), cofactor.y_axis.length(), cofactor.z_axis.length())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::sah::INTERSECTION;
    use crate::cost::tests::{grid_mesh, instance, kept, scene};
    use crate::layout::store::Store;
    use crate::scene::{Bounds, Scene};
    use glam::{DAffine3, dvec3};
    use proptest::prelude::*;

    /// Surface area of the parallelepiped into which a transform maps a box.
    fn area_under(bounds: &Bounds, by: &DAffine3) -> f64 {
        let s = bounds.size();
        let edges = [DVec3::X * s.x, DVec3::Y * s.y, DVec3::Z * s.z].map(|e| by.transform_vector3(e));
        2.0 * (0..3).map(|i| edges[i].cross(edges[(i + 1) % 3]).length()).sum::<f64>()
    }

    /// Computes the two terms below the TLAS as written in the formula.
    fn term_by_term(scene: &Scene, layout: &Layout, structure: &Structure) -> (f64, f64) {
        let (mut entries, mut bottom) = (0.0, 0.0);
        for placement in &layout.placements {
            let group = placement.group as usize;
            let tree = &structure.blas[group].tree;
            let boxes = tree.bounds(&Store::new(scene, &layout.groups[group].content).boxes());
            entries += INSTANCE_ENTRY * boxes[0].transformed(&placement.transform).area();
            for (node, bounds) in tree.nodes.iter().zip(&boxes) {
                let price = if node.is_leaf() { INTERSECTION * f64::from(node.count) } else { TRAVERSAL };
                bottom += price * area_under(bounds, &placement.transform);
            }
        }
        (entries, bottom)
    }

    fn transforms() -> impl Strategy<Value = Vec<DAffine3>> {
        let transform = prop::collection::vec(-2.0..2.0f64, 12).prop_map(|c| DAffine3::from_cols_slice(&c));
        prop::collection::vec(transform, 1..6)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn cost_follows_the_formula_term_by_term(transforms in transforms()) {
            let instances = transforms.iter().enumerate().map(|(i, t)| instance(i as u32 % 2, *t)).collect();
            let scene = scene(vec![grid_mesh(7), grid_mesh(4)], instances);
            let layout = kept(&scene);
            let structure = Structure::build(&scene, &layout);
            let sum = TwoLevelCost::of(&structure, &layout);
            let (entries, bottom) = term_by_term(&scene, &layout, &structure);
            prop_assert!((sum.entries / entries - 1.0).abs() < 1e-12);
            prop_assert!((sum.bottom / bottom - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn two_instances_share_a_node_above() {
        let far = DAffine3::from_translation(dvec3(20.0, 0.0, 0.0));
        let scene = scene(vec![grid_mesh(2)], vec![instance(0, DAffine3::IDENTITY), instance(0, far)]);
        let layout = kept(&scene);
        let sum = TwoLevelCost::of(&Structure::build(&scene, &layout), &layout);
        assert_eq!(sum.top, scene.bounds().area());
        assert_eq!(sum.entries, 2.0 * INSTANCE_ENTRY * 2.0 * 4.0);
    }

    #[test]
    fn one_instance_costs_its_tree_and_one_entry() {
        let scene = scene(vec![grid_mesh(9)], vec![instance(0, DAffine3::IDENTITY)]);
        let layout = kept(&scene);
        let structure = Structure::build(&scene, &layout);
        let sum = TwoLevelCost::of(&structure, &layout);
        let boxes = Store::new(&scene, &layout.groups[0].content).boxes();
        let expected = crate::cost::sah::cost(&structure.blas[0].tree, &boxes);
        let area = scene.bounds().area();
        assert!((sum.flat_cost(area) / expected - 1.0).abs() < 1e-12);
        assert!((sum.cost(area) - expected - INSTANCE_ENTRY).abs() < 1e-12 * expected);
    }

    #[test]
    fn rotation_raises_no_cost_below_the_entry() {
        let cost_of = |t: DAffine3| {
            let scene = scene(vec![grid_mesh(5)], vec![instance(0, t)]);
            let layout = kept(&scene);
            TwoLevelCost::of(&Structure::build(&scene, &layout), &layout)
        };
        let (straight, turned) = (cost_of(DAffine3::IDENTITY), cost_of(DAffine3::from_rotation_z(0.7)));
        assert!((turned.bottom / straight.bottom - 1.0).abs() < 1e-12);
        assert!(turned.entries > 1.5 * straight.entries);
    }
}
