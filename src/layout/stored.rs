//! The scene that a layout results in, as a ray tracer sees it.

use std::sync::Arc;

use raykiln_formats::record::{GeometryHash, Provenance};
use rayon::prelude::*;

use super::store::{Store, Vertices};
use crate::layout::{Content, GroupGeometry, Layout};
use crate::parallel::{self, CHEAP_ELEMENTS};
use crate::scene::{AlphaTest, AlphaTexture, Geometry, Instance, Known, Mesh, MeshId, Scene, TriangleRef};

/// Returns the scene of a layout: one mesh per group and one instance per placement, in their order, with positions as
/// they would be stored, rounded once. For tracing only: it does not record the sources of triangles.
pub fn stored(scene: &Scene, layout: &Layout) -> Scene {
    let meshes: Vec<Arc<Mesh>> = parallel::map_each(&layout.groups, &|group| mesh(scene, &group.content));
    let instance = |placement: &super::Placement| Instance {
        name: String::new(),
        transform: placement.transform,
        mesh: MeshId(placement.group),
        pinned: None,
        ..scene.instances[placement.instance.map_or(0, |i| i.0 as usize)].clone()
    };
    Scene {
        meshes: meshes.into_iter().collect(),
        instances: layout.placements.iter().map(instance).collect(),
        materials: scene.materials.clone(),
        images: scene.images.clone(),
        cameras: scene.cameras.clone(),
        nodes: scene.nodes,
        provenance: Provenance::Unrecorded,
        geometry: GeometryHash::default(),
        copied_nodes: scene.copied_nodes.clone(),
        stand_ins: Arc::default(),
        boxes: Known::default(),
        core: Known::default(),
    }
}

/// Returns the triangle of the input that a triangle of the [`stored`] scene of a layout shows.
pub fn shown(layout: &Layout, at: TriangleRef) -> TriangleRef {
    let placement = &layout.placements[at.instance as usize];
    let placed = |triangle| TriangleRef { instance: placement.instance.map_or(0, |i| i.0), triangle };
    match &layout.groups[placement.group as usize].content {
        Content::Kept(_) => placed(at.triangle),
        Content::Piece { geometries, .. } => placed(nth(geometries, at.triangle as usize).triangle),
        Content::Baked { geometries, .. } => nth(geometries, at.triangle as usize),
    }
}

/// Returns a triangle by its number, counted across geometries.
fn nth(geometries: &[GroupGeometry], mut number: usize) -> TriangleRef {
    for geometry in geometries {
        match geometry.triangles.get(number) {
            Some(at) => return *at,
            None => number -= geometry.triangles.len(),
        }
    }
    panic!("a group has fewer triangles than its stored mesh");
}

fn mesh(scene: &Scene, content: &Content) -> Arc<Mesh> {
    let geometries = match content {
        Content::Kept(mesh) => return scene.meshes.share(mesh.0 as usize),
        Content::Piece { geometries, .. } | Content::Baked { geometries, .. } => geometries,
    };
    let store = Store::new(scene, content);
    let geometry = |(number, of): (usize, &GroupGeometry)| Geometry {
        primitive: number as u32,
        first_triangle: store.of_geometry(number).start as u32,
        ..geometry(&store, of)
    };
    Mesh { geometries: geometries.iter().enumerate().map(geometry).collect(), ..Mesh::default() }.into()
}

/// Returns a geometry of a group.
fn geometry(store: &Store, of: &GroupGeometry) -> Geometry {
    let vertices = store.vertices(of, |_, _, _| {});
    let stored = |&(part, vertex): &(u32, u32)| vertices.parts[part as usize].stored(vertex);
    Geometry {
        material: of.material,
        opacity: of.opacity,
        merge_class: of.merge_class,
        positions: vertices.list.par_iter().with_min_len(CHEAP_ELEMENTS).map(stored).collect(),
        alpha: alpha(&vertices),
        triangles: vertices.triangles,
        ..Geometry::default()
    }
}

/// Returns the alpha test of an alpha-tested geometry; all its triangles use the same texture, because they share a
/// material.
fn alpha(vertices: &Vertices) -> Option<AlphaTest> {
    let first = vertices.parts.first()?.geometry.alpha.as_ref()?;
    let texcoord = |&(part, vertex): &(u32, u32)| {
        let alpha = vertices.parts[part as usize].geometry.alpha.as_ref();
        let texture = alpha.and_then(|alpha| alpha.texture.as_ref());
        texture.and_then(|t| t.texcoords.get(vertex as usize)).copied().unwrap_or_default()
    };
    let texture = first.texture.as_ref().map(|texture| {
        let known = !texture.texcoords.is_empty();
        let texcoords = if known { vertices.list.iter().map(texcoord).collect() } else { Vec::new() };
        AlphaTexture { texcoords, ..*texture }
    });
    Some(AlphaTest { texture, ..*first })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::methods::{Method, Options, run};
    use crate::scene::InstanceId;
    use proptest::prelude::*;

    /// The largest distance between a corner and its position in the stored scene, over all placed triangles.
    fn largest_error(scene: &Scene, layout: &Layout, stored: &Scene) -> f64 {
        let mut largest = 0.0f64;
        for instance in 0..layout.placements.len() as u32 {
            for triangle in 0..stored.mesh_of(InstanceId(instance)).triangle_count() as u32 {
                let at = TriangleRef { instance, triangle };
                let corners = scene.world_corners(shown(layout, at)).into_iter();
                largest = corners.zip(stored.world_corners(at)).map(|(a, b)| a.distance(b)).fold(largest, f64::max);
            }
        }
        largest
    }

    proptest! {
        #[test]
        fn every_layout_stores_the_same_triangles(scene in any_scene(), method in 0..Method::ALL.len()) {
            let layout = run(Method::ALL[method], &scene, &Options::default());
            let stored = stored(&scene, &layout);
            prop_assert_eq!(stored.check(), Ok(()));
            prop_assert_eq!(stored.triangles_placed(), scene.triangles_placed());
            prop_assert!(largest_error(&scene, &layout, &stored) < 1e-5);
        }
    }
}
