//! `keep`: the structure of the input.
//!
//! Helps if the author's structure is already good; the other methods are compared with it.

use crate::layout::Layout;
use crate::layout::builder::Builder;
use crate::scene::{InstanceId, Scene};

/// Keeps each instance unchanged.
pub(super) fn keep(scene: &Scene) -> Layout {
    let mut layout = Builder::new(scene);
    (0..scene.instances.len() as u32).for_each(|i| layout.keep(InstanceId(i)));
    layout.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Pinned;
    use glam::Vec3;

    #[test]
    fn an_empty_scene_gives_an_empty_layout() {
        let layout = keep(&Scene::default());
        assert!(layout.groups.is_empty() && layout.placements.is_empty());
    }

    #[test]
    fn instances_of_a_mesh_share_its_group() {
        let mut builder = SceneBuilder::default();
        let cube = builder.mesh("cube", vec![(0, row(Vec3::ZERO, 3)), (1, row(Vec3::Y, 2))]);
        let unused = builder.mesh("unused", vec![(0, row(Vec3::ZERO, 1))]);
        builder.place(cube, "a", at(1.0, 0.0, 0.0));
        builder.place(cube, "b", at(2.0, 0.0, 0.0)).pinned = Some(Pinned::Skinned);
        let scene = builder.scene();
        let layout = keep(&scene);
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["kept cube"]);
        assert_eq!(layout.placements.len(), 2);
        assert_eq!(layout.placements[1].transform, at(2.0, 0.0, 0.0));
        assert_eq!(unused.0, 1);
    }

    #[test]
    fn what_is_left_of_a_mesh_with_dropped_triangles_is_one_piece() {
        let mut builder = SceneBuilder::default();
        let torn = builder.mesh("torn", vec![(0, row(Vec3::ZERO, 3)), (1, row(Vec3::Y, 2))]);
        builder.place(torn, "a", at(1.0, 0.0, 0.0));
        builder.place(torn, "b", at(2.0, 0.0, 0.0)).pinned = Some(Pinned::Animated);
        let mut scene = builder.scene();
        scene.meshes[0].dropped = true;
        scene.meshes[0].geometries[1].kept = Some(vec![0, 2]);
        let layout = keep(&scene);
        assert_eq!(layout.check(&scene), Ok(()));
        assert_eq!(group_names(&layout), ["piece torn"]);
        assert_eq!(layout.placements.len(), 2);
    }
}
