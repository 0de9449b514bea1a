//! The cost of sharing turned copies: the boxes around a turned model are looser.

use std::collections::BTreeMap;

use crate::copies::Copies;
use crate::cost::bytes;
use crate::cost::mesh_trees::MeshTrees;
use crate::cost::structure::Structure;
use crate::cost::two_level::TwoLevelCost;
use crate::layout;
use crate::layout::BlasPer;
use crate::methods::{self, Method};
use crate::scene::{MeshId, Scene};

/// The copies of one model that are turned such that the model's boxes are looser than their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Class {
    pub(super) model: MeshId,
    /// What sharing them adds to the two-level cost of the scene, excluding TLAS nodes; negative if the model's boxes
    /// are tighter than theirs. Infinite if it is not a number.
    pub(super) added_cost: f64,
    /// Predicted BLAS bytes that sharing them saves.
    pub(super) saved_bytes: u64,
}

/// The share of each instance in the two-level cost, in squared world units: its entry and the BLASes below.
pub(super) fn costs_of_instances(scene: &Scene, trees: &MeshTrees, per: BlasPer) -> Vec<f64> {
    let kept = methods::run(Method::Keep, scene, &methods::Options::default());
    let layout = layout::as_built(scene, &kept, per);
    let structure = Structure::build_with(scene, &layout, trees);
    let mut costs = vec![0.0; scene.instances.len()];
    for (placement, bounds) in layout.placements.iter().zip(&structure.boxes) {
        if let Some(instance) = placement.instance {
            let areas = &structure.blas[placement.group as usize].areas;
            let cost = TwoLevelCost::of_placement(bounds.area(), areas, &placement.transform.matrix3);
            costs[instance.0 as usize] += cost.entries + cost.bottom;
        }
    }
    costs
}

/// The turned copies grouped by model, in ascending order of cost per byte saved. `costs` are those of the scene's
/// instances without and with all copies shared; `scene` is the one without.
pub(super) fn classes(scene: &Scene, copies: &Copies, costs: [&[f64]; 2]) -> Vec<Class> {
    let mut classes: BTreeMap<MeshId, Class> = BTreeMap::new();
    let mut model_of = vec![None; scene.meshes.len()];
    for copy in copies.list.iter().filter(|copy| !copy.keeps_boxes()) {
        model_of[copy.mesh.0 as usize] = Some(copy.model);
        let new = Class { model: copy.model, added_cost: 0.0, saved_bytes: 0 };
        let saved = &mut classes.entry(copy.model).or_insert(new).saved_bytes;
        *saved = saved.saturating_add(bytes::blas(scene.meshes[copy.mesh.0 as usize].triangle_count() as u64));
    }
    let area = scene.bounds().area();
    for (instance, (before, after)) in scene.instances.iter().zip(costs[0].iter().zip(costs[1])) {
        if let Some(class) = model_of[instance.mesh.0 as usize].and_then(|model| classes.get_mut(&model)) {
            class.added_cost += (after - before) / area;
        }
    }
    let finite = |class: Class| match class.added_cost.is_finite() {
        true => class,
        false => Class { added_cost: f64::INFINITY, ..class },
    };
    let mut classes: Vec<Class> = classes.into_values().map(finite).collect();
    let price = |class: &Class| class.added_cost / class.saved_bytes.max(1) as f64;
    classes.sort_by(|a, b| price(a).total_cmp(&price(b)).then(a.model.cmp(&b.model)));
    classes
}

/// The number of leading classes that together add at most `most_added_cost`.
pub(super) fn affordable(classes: &[Class], most_added_cost: f64) -> usize {
    let mut sum = 0.0;
    let fits = |class: &&Class| {
        sum += class.added_cost;
        sum <= most_added_cost
    };
    classes.iter().take_while(fits).count()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::copies::CopiedMesh;
    use crate::verify::test_scenes::{cube, scene};
    use glam::{DAffine3, DMat3, DVec3};

    fn copy(mesh: u32, model: u32, motion: DAffine3) -> CopiedMesh {
        CopiedMesh { mesh: MeshId(mesh), model: MeshId(model), motion, order: None }
    }

    fn class(model: u32, added_cost: f64) -> Class {
        Class { model: MeshId(model), added_cost, saved_bytes: 256 }
    }

    #[test]
    fn only_what_is_turned_is_in_a_class_and_costs() {
        let turn = DAffine3::from_rotation_z(0.5);
        let quarter = DAffine3::from_mat3(DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z));
        let mut turned = cube(2, None);
        let points = Arc::make_mut(&mut turned.geometries[0].positions).iter_mut();
        points.for_each(|p| *p = turn.transform_point3(p.as_dvec3()).as_vec3());
        let meshes = vec![cube(0, None), cube(1, None), turned, cube(3, None)];
        let at = |mesh: u32| (mesh, DAffine3::from_translation(DVec3::X * 9.0 * f64::from(mesh)));
        let scene = scene(meshes, &[0, 1, 2, 3].map(at));
        let copies = Copies {
            list: vec![copy(1, 0, DAffine3::IDENTITY), copy(2, 0, turn), copy(3, 0, quarter)],
            most_saved_bytes: None,
        };
        assert_eq!([0, 1, 2].map(|i: usize| copies.list[i].keeps_boxes()), [true, false, true]);
        let costs = |scene: &Scene| costs_of_instances(scene, &MeshTrees::default(), BlasPer::Mesh);
        let before = costs(&scene);
        let after = costs(&scene.overlaid(&copies.overlay(&scene)));
        let classes = classes(&scene, &copies, [&before, &after]);
        assert_eq!(
            classes.iter().map(|c| (c.model, c.saved_bytes)).collect::<Vec<_>>(),
            [(MeshId(0), bytes::blas(12))]
        );
        let added = (after[2] - before[2]) / scene.bounds().area();
        assert_eq!(classes[0].added_cost, added);
        assert_eq!(after[1], before[1]);
    }

    #[test]
    fn the_cheapest_classes_are_affordable() {
        let classes = [class(3, -1.0), class(0, 1.5), class(1, 1.0), class(2, f64::INFINITY)];
        assert_eq!([-2.0, 0.0, 0.5, 1.5, f64::MAX].map(|most| affordable(&classes, most)), [0, 1, 2, 3, 3]);
        assert_eq!(affordable(&[], 0.0), 0);
    }

    #[test]
    fn costs_that_are_no_numbers_come_last() {
        let scene = scene(vec![cube(0, None); 4], &[0, 1, 2, 3].map(|mesh| (mesh, DAffine3::IDENTITY)));
        let turn = DAffine3::from_rotation_z(0.5);
        let copies = Copies { list: vec![copy(1, 0, turn), copy(3, 2, turn)], most_saved_bytes: None };
        let classes = classes(&scene, &copies, [&[0.0; 4], &[0.0, f64::NAN, 0.0, 1.0]]);
        assert_eq!(classes.iter().map(|c| c.model).collect::<Vec<_>>(), [MeshId(2), MeshId(0)]);
        assert_eq!(classes[1].added_cost, f64::INFINITY);
    }
}
