//! `per-object`: the thesis's "GAS per object".
//!
//! Helps if objects are small and separate; hurts if one object lies inside the box of another.

use crate::layout::Layout;
use crate::layout::builder::{Builder, objects};
use crate::scene::{InstanceId, Scene};

/// Creates one group per geometry of each mesh, placed by all instances of that mesh; pinned instances stay unchanged.
pub(super) fn per_object(scene: &Scene) -> Layout {
    let mut layout = Builder::new(scene);
    for (i, instance) in scene.instances.iter().enumerate() {
        let id = InstanceId(i as u32);
        if instance.pinned.is_some() {
            layout.keep(id);
        } else {
            objects(scene, [id]).into_iter().for_each(|object| layout.place_object(object));
        }
    }
    layout.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Pinned;
    use glam::Vec3;

    #[test]
    fn a_mesh_of_one_geometry_stays_and_one_of_several_falls_apart() {
        let mut builder = SceneBuilder::default();
        builder.object("floor", 0, row(Vec3::ZERO, 4));
        let lamp = builder.mesh("lamp", vec![(0, row(Vec3::ZERO, 3)), (1, row(Vec3::Y, 2))]);
        builder.place(lamp, "left", at(1.0, 0.0, 0.0));
        builder.place(lamp, "right", at(2.0, 0.0, 0.0));
        let scene = builder.scene();
        let layout = per_object(&scene);
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["kept floor", "piece lamp.0", "piece lamp.1"]);
        assert_eq!(group_sizes(&scene, &layout), [4, 3, 2]);
        let placed: Vec<_> = layout.placements.iter().map(|p| (p.instance.unwrap().0, p.group)).collect();
        assert_eq!(placed, [(0, 0), (1, 1), (1, 2), (2, 1), (2, 2)]);
    }

    #[test]
    fn a_pinned_instance_stays_whole() {
        let mut builder = SceneBuilder::default();
        let lamp = builder.mesh("lamp", vec![(0, row(Vec3::ZERO, 3)), (1, row(Vec3::Y, 2))]);
        builder.place(lamp, "swinging", at(1.0, 0.0, 0.0)).pinned = Some(Pinned::Animated);
        builder.place(lamp, "still", at(2.0, 0.0, 0.0));
        let scene = builder.scene();
        let layout = per_object(&scene);
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["kept lamp", "piece lamp.0", "piece lamp.1"]);
    }
}
