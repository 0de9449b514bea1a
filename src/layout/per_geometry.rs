//! Layouts for renderers that build one BLAS per primitive.

use std::borrow::Cow;

use crate::layout::builder::first_instances;
use crate::layout::{Content, Group, GroupGeometry, Layout, Placement};
use glam::DAffine3;

use crate::scene::{MeshId, Scene, TriangleRef};

/// Returns the layout with one group per geometry, placed wherever its group was, in the order of the groups and their
/// geometries. Describes what is built, not what is written.
pub fn per_geometry(scene: &Scene, layout: &Layout) -> Layout {
    let first = first_instances(scene);
    let mut divided = Layout { notes: layout.notes.clone(), ..Layout::default() };
    let mut starts = vec![0];
    for group in &layout.groups {
        let contents = contents(scene, &first, &group.content).into_iter();
        divided.groups.extend(contents.map(|content| Group { name: group.name.clone(), content }));
        starts.push(divided.groups.len() as u32);
    }
    for placement in &layout.placements {
        let group = placement.group as usize;
        divided.placements.extend((starts[group]..starts[group + 1]).map(|group| Placement { group, ..*placement }));
    }
    divided
}

/// Returns one content per geometry.
fn contents(scene: &Scene, first: &[u32], content: &Content) -> Vec<Content> {
    match content {
        Content::Kept(mesh) if scene.meshes[mesh.0 as usize].geometries.len() < 2 => vec![content.clone()],
        Content::Kept(mesh) => geometries(scene, first[mesh.0 as usize], *mesh)
            .map(|geometry| Content::Piece { mesh: *mesh, frame: DAffine3::IDENTITY, geometries: vec![geometry] })
            .collect(),
        Content::Piece { mesh, frame, geometries } => geometries
            .iter()
            .map(|geometry| Content::Piece { mesh: *mesh, frame: *frame, geometries: vec![geometry.clone()] })
            .collect(),
        Content::Baked { frame, geometries } => geometries
            .iter()
            .map(|geometry| Content::Baked { frame: *frame, geometries: vec![geometry.clone()] })
            .collect(),
    }
}

/// Returns the geometries of a mesh.
fn geometries(scene: &Scene, instance: u32, mesh: MeshId) -> impl Iterator<Item = GroupGeometry> {
    scene.meshes[mesh.0 as usize].geometries.iter().map(move |of| {
        let triangles = of.first_triangle..of.first_triangle + of.triangles.len() as u32;
        GroupGeometry {
            material: of.material,
            merge_class: of.merge_class,
            opacity: of.opacity,
            triangles: triangles.map(|triangle| TriangleRef { instance, triangle }).collect(),
        }
    })
}

/// What one BLAS contains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BlasPer {
    /// All geometries of a mesh.
    #[default]
    Mesh,
    /// Each geometry separately, with its own instance wherever its mesh is placed.
    Primitive,
}

/// Returns a layout as its consumer builds it.
pub fn as_built<'l>(scene: &Scene, layout: &'l Layout, per: BlasPer) -> Cow<'l, Layout> {
    match per {
        BlasPer::Mesh => Cow::Borrowed(layout),
        BlasPer::Primitive => Cow::Owned(per_geometry(scene, layout)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost;
    use crate::layout::test_scenes::*;
    use crate::methods::{Method, Options, run};
    use glam::{DAffine3, Vec3};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_triangle_is_still_placed_once(mut scene in any_scene(), method in 0..Method::ALL.len()) {
            scene.instances.iter_mut().for_each(|i| i.pinned = None);
            let layout = run(Method::ALL[method], &scene, &Options::default());
            let divided = per_geometry(&scene, &layout);
            prop_assert_eq!(divided.check(&scene), Ok(()));
            let (before, after) = (cost::measure(&scene, &layout), cost::measure(&scene, &divided));
            prop_assert_eq!(before.geometries, after.mesh_groups);
            prop_assert_eq!(before.geometries, after.geometries);
            prop_assert_eq!(before.triangles_stored, after.triangles_stored);
            prop_assert_eq!(before.triangles_placed, after.triangles_placed);
        }
    }

    #[test]
    fn geometries_that_overlap_cost_an_entry_each() {
        let mut builder = SceneBuilder::default();
        (0..40).for_each(|material| builder.object("layer", material, row(Vec3::Y * 0.01 * material as f32, 20)));
        let scene = builder.scene();
        let layout = run(Method::Single, &scene, &Options::default());
        let divided = per_geometry(&scene, &layout);
        let (one, many) = (cost::measure(&scene, &layout), cost::measure(&scene, &divided));
        assert_eq!((one.instances, many.instances), (1, 40));
        assert!(many.two_level_cost > one.two_level_cost + 20.0 * cost::two_level::INSTANCE_ENTRY);
        assert!(many.blas_bytes + many.tlas_bytes > one.blas_bytes + one.tlas_bytes);
    }

    #[test]
    fn geometries_of_an_instanced_mesh_are_placed_with_each_instance() {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("lamp", vec![(0, row(Vec3::ZERO, 2)), (1, row(Vec3::Y, 3))]);
        (0..3).for_each(|i| drop(builder.place(mesh, "lamp", DAffine3::from_rotation_x(f64::from(i))).name.clone()));
        let scene = builder.scene();
        let divided = per_geometry(&scene, &run(Method::Keep, &scene, &Options::default()));
        assert_eq!(group_names(&divided), ["piece lamp", "piece lamp"]);
        assert_eq!(divided.placements.iter().map(|p| p.group).collect::<Vec<_>>(), [0, 1, 0, 1, 0, 1]);
    }
}
