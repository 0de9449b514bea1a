//! The scene that a layout comes to, as a ray tracer sees it.

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::{Content, GroupGeometry, Layout};
use crate::scene::{AlphaTest, AlphaTexture, Geometry, Instance, InstanceId, Mesh, MeshId, Scene, TriangleRef};

/// The scene of a layout: one mesh for each group, one instance for each placement, in their order; positions as they
/// would be stored, rounded once. For tracing only: vertices are not shared, and nothing says where a triangle comes from.
pub fn stored(scene: &Scene, layout: &Layout) -> Scene {
    let meshes = layout.groups.par_iter().map(|group| mesh(scene, &group.content)).collect();
    let instance = |placement: &super::Placement| Instance {
        name: String::new(),
        transform: placement.transform,
        mesh: MeshId(placement.group),
        pinned: None,
        ..scene.instances[placement.instance.map_or(0, |i| i.0 as usize)].clone()
    };
    Scene {
        meshes,
        instances: layout.placements.iter().map(instance).collect(),
        materials: scene.materials.clone(),
        images: scene.images.clone(),
        cameras: scene.cameras.clone(),
        nodes: scene.nodes,
    }
}

fn mesh(scene: &Scene, content: &Content) -> Mesh {
    match content {
        Content::Kept(mesh) => scene.meshes[mesh.0 as usize].clone(),
        Content::Piece(mesh, geometries) => {
            let mesh = &scene.meshes[mesh.0 as usize];
            geometries_of(scene, geometries, |at| mesh.corners(at.triangle), |_| false)
        }
        Content::Baked { frame, geometries } => {
            let into = frame.inverse();
            let mirrored = |at: TriangleRef| scene.instances[at.instance as usize].mirrored();
            geometries_of(scene, geometries, |at| scene.world_corners(at).map(|p| rounded(&into, p)), mirrored)
        }
    }
}

fn rounded(into: &DAffine3, point: DVec3) -> Vec3 {
    if *into == DAffine3::IDENTITY { point.as_vec3() } else { into.transform_point3(point).as_vec3() }
}

/// Geometries with corners as given, the second and third of which are exchanged in mirrored triangles.
fn geometries_of(
    scene: &Scene,
    geometries: &[GroupGeometry],
    corners: impl Fn(TriangleRef) -> [Vec3; 3] + Sync,
    mirrored: impl Fn(TriangleRef) -> bool,
) -> Mesh {
    let mut first_triangle = 0;
    let geometry = |(primitive, of): (usize, &GroupGeometry)| {
        let count = of.triangles.len() as u32;
        first_triangle += count;
        Geometry {
            primitive: primitive as u32,
            material: of.material,
            opacity: of.opacity,
            alpha: alpha(scene, &of.triangles, &mirrored),
            merge_class: of.merge_class,
            first_triangle: first_triangle - count,
            positions: of.triangles.par_iter().flat_map_iter(|&at| corners(at)).collect(),
            triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            ..Geometry::default()
        }
    };
    Mesh { geometries: geometries.iter().enumerate().map(geometry).collect(), ..Mesh::default() }
}

/// What the triangles of an alpha-tested geometry test, which is the same texture for one material.
fn alpha(scene: &Scene, triangles: &[TriangleRef], mirrored: impl Fn(TriangleRef) -> bool) -> Option<AlphaTest> {
    let source = |at: TriangleRef| {
        let mesh = scene.mesh_of(InstanceId(at.instance));
        let (geometry, triangle) = mesh.locate(at.triangle);
        (&mesh.geometries[geometry], triangle)
    };
    let first = source(*triangles.first()?).0.alpha.as_ref()?;
    let texture = first.texture.as_ref().map(|texture| {
        let of_triangle = |&at: &TriangleRef| {
            let (geometry, triangle) = source(at);
            let placed =
                geometry.alpha.as_ref().and_then(|alpha| alpha.texture.as_ref()).map(|t| t.texcoords.as_slice());
            let [a, b, c] = geometry.triangles[triangle];
            let order = if mirrored(at) { [a, c, b] } else { [a, b, c] };
            order.map(|vertex| placed.and_then(|p| p.get(vertex as usize)).copied().unwrap_or_default())
        };
        let known = !texture.texcoords.is_empty();
        let texcoords = if known { triangles.iter().flat_map(of_triangle).collect() } else { Vec::new() };
        AlphaTexture { texcoords, ..*texture }
    });
    Some(AlphaTest { texture, ..*first })
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::*;
    use super::super::{Method, Options, run};
    use super::*;
    use proptest::prelude::*;

    /// World corners of all placed triangles, sorted.
    fn shown(scene: &Scene) -> Vec<[i64; 9]> {
        let mut all = Vec::new();
        for i in 0..scene.instances.len() as u32 {
            for triangle in 0..scene.mesh_of(InstanceId(i)).triangle_count() as u32 {
                let corners = scene.world_corners(TriangleRef { instance: i, triangle });
                let grid = |p: DVec3| p.to_array().map(|x| (x * 256.0).round() as i64);
                all.push(corners.map(grid).concat().try_into().expect("three corners"));
            }
        }
        all.sort_unstable();
        all
    }

    proptest! {
        #[test]
        fn every_layout_stores_the_same_triangles(scene in any_scene(), method in 0..Method::ALL.len()) {
            let layout = run(Method::ALL[method], &scene, &Options::default());
            let stored = stored(&scene, &layout);
            prop_assert_eq!(stored.check(), Ok(()));
            prop_assert_eq!(shown(&stored), shown(&scene));
        }
    }
}
