//! The core of a scene: all objects except domes that enclose the rest and those far outside it
//! ([`exceptional`]).
//!
//! One sky dome or one far object makes the box of the scene so large that a share of its area says nothing about the
//! rest. Thresholds on shares of the scene use the box of the core instead. If nothing is set apart, that is the box of
//! the scene, bit for bit.

use super::apart::{Apart, exceptional};
use super::object::{Object, objects};
use super::{Bounds, Instance, InstanceId, Scene};

/// The core of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Core {
    bounds: Bounds,
    /// The domes, in ascending order.
    domes: Vec<Object>,
    /// The objects far outside, in ascending order.
    outliers: Vec<Object>,
    /// The objects outside the core, which are the two above, in ascending order.
    apart: Vec<Object>,
    /// The instances all of whose objects are outside the core, in ascending order.
    instances_apart: Vec<u32>,
}

impl Core {
    /// Finds the core. An instance with objects on both sides counts with the boxes of those in the core.
    pub(super) fn of(scene: &Scene) -> Core {
        let all = objects(scene, (0..scene.instances.len() as u32).map(InstanceId));
        let Apart { shells, outliers } = exceptional(scene, &all);
        let [domes, outliers] = [shells, outliers].map(|of| of.into_iter().map(|i| all[i]).collect::<Vec<Object>>());
        let mut apart = [domes.as_slice(), &outliers].concat();
        apart.sort_unstable();
        let bounds = if apart.is_empty() { scene.bounds() } else { Bounds::EMPTY };
        let mut core = Core { bounds, domes, outliers, apart, instances_apart: Vec::new() };
        if core.apart.is_empty() {
            return core;
        }
        for (i, instance) in (0u32..).zip(&scene.instances) {
            match core.count_apart(i) {
                0 => core.bounds = core.bounds.union(&scene.instance_boxes()[i as usize]),
                count if count == scene.mesh_of(InstanceId(i)).geometries.len() => core.instances_apart.push(i),
                _ => core.bounds = core.bounds.union(&core.box_of_rest(scene, i, instance)),
            }
        }
        core
    }

    /// Returns the box around the core: that of its instances' boxes, transformed from their meshes' as a driver does.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Returns the boxes of all instances ([`Scene::instance_boxes`]), empty for those outside the core.
    pub fn instance_boxes(&self, scene: &Scene) -> Vec<Bounds> {
        let mut boxes = scene.instance_boxes().to_vec();
        self.instances_apart.iter().for_each(|&i| boxes[i as usize] = Bounds::EMPTY);
        boxes
    }

    /// Whether the core is the whole scene: no object is set apart.
    pub fn is_whole(&self) -> bool {
        self.apart.is_empty()
    }

    /// Returns the objects that enclose the core, in ascending order.
    pub(crate) fn domes(&self) -> &[Object] {
        &self.domes
    }

    /// Returns the objects far outside the core, in ascending order.
    pub(crate) fn outliers(&self) -> &[Object] {
        &self.outliers
    }

    /// Whether an object is outside the core.
    pub(crate) fn sets_apart(&self, object: Object) -> bool {
        self.apart.binary_search(&object).is_ok()
    }

    /// Whether all objects of an instance are outside the core.
    pub fn sets_instance_apart(&self, instance: InstanceId) -> bool {
        self.instances_apart.binary_search(&instance.0).is_ok()
    }

    /// Returns how many objects of an instance are outside the core.
    fn count_apart(&self, instance: u32) -> usize {
        let end = |instance: u32| self.apart.partition_point(|o| o.instance < instance);
        end(instance + 1) - end(instance)
    }

    /// Returns the box around the objects of an instance that are in the core.
    fn box_of_rest(&self, scene: &Scene, i: u32, instance: &Instance) -> Bounds {
        let geometries = (0u32..).zip(&scene.mesh_of(InstanceId(i)).geometries);
        let rest = geometries.filter(|&(geometry, _)| !self.sets_apart(Object { instance: i, geometry }));
        rest.fold(Bounds::EMPTY, |all, (_, g)| all.union(&g.bounds().transformed(&instance.transform)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use glam::{DAffine3, Vec3};

    /// A heap of two overlapping fields, with or without a dome of one triangle and a far object.
    fn heap(dome: bool, moon: bool) -> Scene {
        let mut builder = SceneBuilder::default();
        (0..4).for_each(|i| builder.object("field", 0, row(Vec3::new(0.0, i as f32, 0.5 * i as f32), 300)));
        if dome {
            builder.object("sky", 0, vec![[Vec3::splat(-900.0), Vec3::new(900.0, -900.0, 0.0), Vec3::splat(900.0)]]);
        }
        if moon {
            builder.object("moon", 0, row(Vec3::X * 1e9, 1));
        }
        builder.scene()
    }

    #[test]
    fn the_core_of_a_scene_without_exceptions_is_the_scene() {
        for scene in [Scene::default(), heap(false, false)] {
            assert!(scene.core().is_whole());
            assert_eq!(scene.core().bounds(), scene.bounds());
        }
    }

    #[test]
    fn domes_and_far_objects_leave_the_core_alone() {
        let expected = heap(false, false).bounds();
        for (dome, moon) in [(true, false), (false, true), (true, true)] {
            let scene = heap(dome, moon);
            assert_eq!(scene.core().bounds(), expected, "dome {dome}, moon {moon}");
            let apart: Vec<bool> =
                (0..scene.instances.len() as u32).map(|i| scene.core().sets_instance_apart(InstanceId(i))).collect();
            assert_eq!(apart[..4], [false; 4]);
            assert!(apart[4..].iter().all(|&apart| apart));
        }
    }

    #[test]
    fn shells_hardly_larger_than_the_rest_are_in_the_core() {
        let mut builder = SceneBuilder::default();
        (0..4).for_each(|i| builder.object("field", 0, row(Vec3::new(0.0, i as f32, 0.5 * i as f32), 300)));
        builder.object("walls", 0, vec![[Vec3::splat(-1.0), Vec3::new(301.0, -1.0, 0.0), Vec3::new(301.0, 5.0, 3.0)]]);
        let scene = builder.scene();
        let all = objects(&scene, (0..5).map(InstanceId));
        assert_eq!(crate::scene::apart(&scene, &all).shells, [4]);
        assert!(scene.core().is_whole());
    }

    #[test]
    fn an_instance_of_dome_and_houses_counts_with_its_houses() {
        let dome = vec![[Vec3::splat(-900.0), Vec3::new(900.0, -900.0, 0.0), Vec3::splat(900.0)]];
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("town", vec![(0, row(Vec3::ZERO, 200)), (1, dome)]);
        builder.place(mesh, "town", DAffine3::IDENTITY);
        let scene = builder.scene();
        assert!(!scene.core().sets_instance_apart(InstanceId(0)));
        assert!(scene.core().sets_apart(Object { instance: 0, geometry: 1 }));
        assert_eq!(scene.core().bounds(), scene.meshes[0].geometries[0].bounds());
    }
}
