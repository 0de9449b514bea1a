//! `single`: the thesis's "single GAS".
//!
//! Helps static scenes whose objects overlap, because the driver's builder sees all triangles at once; hurts if many
//! instances share a mesh, because each copy is stored, and it cannot follow the frames of rotated objects.

use crate::layout::Layout;
use crate::layout::builder::{Builder, Geometries, objects};
use crate::methods::instancing::{Known, bake_within_limits};
use crate::methods::parts::{bake_part, parts};
use crate::methods::{InstanceOptions, PartOptions};
use crate::scene::{InstanceId, Scene};

/// Creates one group of all instances that are not pinned, with one geometry per material, ordered by material. A
/// material whose primitives differ in their vertex attributes gets one geometry per set of attributes. A lone instance
/// needs no baking: it stays, with its geometries joined in the same way. Isolated and non-opaque triangles get further
/// groups if the options say so.
pub(super) fn single(scene: &Scene, instances: &InstanceOptions, options: &PartOptions, known: &Known) -> Layout {
    bake_within_limits(scene, instances, known, |bake| {
        let mut layout = Builder::new(scene);
        bake.place_left(&mut layout);
        let baked: Vec<_> = bake.baked().collect();
        let whole = PartOptions { one_geometry_per_group: false, ..*options };
        match parts(scene, &baked, &whole).as_slice() {
            [] | [_] => join_all(scene, &baked, &mut layout),
            several => several.iter().for_each(|part| bake_part(scene, part, &mut layout)),
        }
        layout.finish()
    })
}

/// Adds one group of some instances to a layout.
pub(super) fn join_all(scene: &Scene, instances: &[InstanceId], layout: &mut Builder) {
    match *instances {
        [] => {}
        [lone] => layout.place_joined(lone),
        ref several => layout.bake("scene".to_owned(), join(scene, several)),
    }
}

fn join(scene: &Scene, instances: &[InstanceId]) -> Geometries {
    let mut geometries = Geometries::default();
    for object in objects(scene, instances.iter().copied()) {
        geometries.add(object.geometry(scene), object.triangles(scene));
    }
    geometries
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::layout::{Content, GroupGeometry};
    use crate::methods::{Method, Options, run};
    use crate::scene::{Pinned, TriangleRef};
    use glam::{DAffine3, DVec3, Vec3};

    fn geometries(layout: &Layout, group: usize) -> &[GroupGeometry] {
        match &layout.groups[group].content {
            Content::Baked { geometries, .. } | Content::Piece { geometries, .. } => geometries,
            Content::Kept(_) => &[],
        }
    }

    #[test]
    fn an_empty_scene_gives_an_empty_layout() {
        assert!(run(Method::Single, &Scene::default(), &Options::default()).groups.is_empty());
    }

    #[test]
    fn all_instances_become_one_group_with_a_geometry_a_material() {
        let mut builder = SceneBuilder::default();
        builder.object("red", 1, row(Vec3::ZERO, 4));
        let lamp = builder.mesh("lamp", vec![(1, row(Vec3::ZERO, 3)), (0, row(Vec3::Y, 2))]);
        builder.place(lamp, "left", at(1.0, 0.0, 0.0));
        builder.place(lamp, "mirrored", DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        let scene = builder.scene();
        let layout = run(Method::Single, &scene, &Options::default());
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["baked scene"]);
        let sizes: Vec<_> = geometries(&layout, 0).iter().map(|g| (g.material, g.triangles.len())).collect();
        assert_eq!(sizes, [(Some(0), 4), (Some(1), 10)]);
        assert_eq!(geometries(&layout, 0)[0].triangles[2], TriangleRef { instance: 2, triangle: 3 });
    }

    #[test]
    fn vertex_formats_of_a_material_stay_apart() {
        let mut builder = SceneBuilder::default();
        builder.object("plain", 0, row(Vec3::ZERO, 4));
        builder.object("with colours", 0, row(Vec3::Y, 2));
        let mut scene = builder.scene();
        scene.meshes[1].geometries[0].merge_class = 7;
        let layout = run(Method::Single, &scene, &Options::default());
        assert_eq!(layout.check(&scene), Ok(()));
        let classes: Vec<_> = geometries(&layout, 0).iter().map(|g| (g.material, g.merge_class)).collect();
        assert_eq!(classes, [(Some(0), 0), (Some(0), 7)]);
    }

    #[test]
    fn pinned_instances_stay() {
        let mut builder = SceneBuilder::default();
        builder.object("a", 0, row(Vec3::ZERO, 1));
        builder.object("b", 0, row(Vec3::ZERO, 1));
        let door = builder.mesh("door", vec![(0, row(Vec3::ZERO, 2))]);
        builder.place(door, "door", DAffine3::IDENTITY).pinned = Some(Pinned::Animated);
        let scene = builder.scene();
        let layout = run(Method::Single, &scene, &Options::default());
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["kept door", "baked scene"]);
    }

    #[test]
    fn a_lone_instance_stays_as_it_is() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("all", vec![(0, row(Vec3::ZERO, 1)), (1, row(Vec3::X, 1))]);
        builder.place(mesh, "turned", DAffine3::from_rotation_x(1.0));
        let scene = builder.scene();
        assert_eq!(group_names(&run(Method::Single, &scene, &Options::default())), ["kept all"]);
    }

    #[test]
    fn geometries_of_one_material_are_joined_in_a_lone_instance() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("all", vec![(0, row(Vec3::ZERO, 1)), (1, row(Vec3::X, 1)), (0, row(Vec3::Y, 3))]);
        builder.place(mesh, "turned", DAffine3::from_rotation_x(1.0));
        let scene = builder.scene();
        let layout = run(Method::Single, &scene, &Options::default());
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["piece all"]);
        assert_eq!(geometries(&layout, 0).iter().map(|g| g.triangles.len()).collect::<Vec<_>>(), [4, 1]);
    }
}
