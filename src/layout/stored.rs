//! The scene that a layout comes to, as a ray tracer sees it.

use glam::{DAffine3, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::layout::{Content, GroupGeometry, Layout};
use crate::scene::{AlphaTest, AlphaTexture, Geometry, Instance, InstanceId, Mesh, MeshId, Scene, TriangleRef};

/// The scene of a layout: one mesh for each group, one instance for each placement, in their order; positions as they
/// would be stored, rounded once. For tracing only: nothing says where a triangle comes from.
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
        copied_nodes: scene.copied_nodes.clone(),
    }
}

fn mesh(scene: &Scene, content: &Content) -> Mesh {
    match content {
        Content::Kept(mesh) => scene.meshes[mesh.0 as usize].clone(),
        Content::Piece { frame, geometries, .. } => geometries_of(scene, geometries, Space::Mesh, frame),
        Content::Baked { frame, geometries } => geometries_of(scene, geometries, Space::World, frame),
    }
}

/// What a frame is seen from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Space {
    Mesh,
    World,
}

/// Geometries in a frame.
fn geometries_of(scene: &Scene, geometries: &[GroupGeometry], space: Space, frame: &DAffine3) -> Mesh {
    let into = (*frame != DAffine3::IDENTITY).then(|| frame.inverse());
    let mut first_triangle = 0;
    let geometry = |(primitive, of): (usize, &GroupGeometry)| {
        first_triangle += of.triangles.len() as u32;
        Geometry {
            primitive: primitive as u32,
            material: of.material,
            opacity: of.opacity,
            merge_class: of.merge_class,
            first_triangle: first_triangle - of.triangles.len() as u32,
            ..Vertices::collect(scene, &of.triangles, space, into).geometry()
        }
    };
    Mesh { geometries: geometries.iter().enumerate().map(geometry).collect(), ..Mesh::default() }
}

/// The vertices of a geometry, each stored once: drivers join triangles that share them.
struct Vertices<'a> {
    scene: &'a Scene,
    space: Space,
    /// Group from `space`; `None` where that is the identity.
    into: Option<DAffine3>,
    /// Instance, geometry and vertex of the source, in order of first use.
    list: Vec<(u32, u32, u32)>,
    triangles: Vec<[u32; 3]>,
}

impl<'a> Vertices<'a> {
    fn collect(scene: &'a Scene, refs: &[TriangleRef], space: Space, into: Option<DAffine3>) -> Vertices<'a> {
        let mut vertices = Vertices { scene, space, into, list: Vec::new(), triangles: Vec::with_capacity(refs.len()) };
        let mut numbers: FxHashMap<(u32, u32, u32), u32> = FxHashMap::default();
        for &at in refs {
            let (mesh, triangle, mirrored) = vertices.source(at);
            let (geometry, triangle) = mesh.locate(triangle);
            let [a, b, c] = mesh.geometries[geometry].triangles[triangle];
            let list = &mut vertices.list;
            let corners = if mirrored { [a, c, b] } else { [a, b, c] }.map(|vertex| {
                let key = (at.instance, geometry as u32, vertex);
                *numbers.entry(key).or_insert_with(|| {
                    list.push(key);
                    list.len() as u32 - 1
                })
            });
            vertices.triangles.push(corners);
        }
        vertices
    }

    fn geometry(self) -> Geometry {
        let positions = self.list.par_iter().map(|&vertex| self.position(vertex)).collect();
        Geometry { positions, alpha: self.alpha(), triangles: self.triangles, ..Geometry::default() }
    }

    /// The mesh that a triangle is taken from, the triangle there, and whether it is turned over: what is baked comes from
    /// the mesh that the document places, as it does where it is written.
    fn source(&self, at: TriangleRef) -> (&'a Mesh, u32, bool) {
        match self.space {
            Space::Mesh => (self.scene.mesh_of(InstanceId(at.instance)), at.triangle, false),
            Space::World => {
                let origin = self.scene.origin(at);
                let mirrored = origin.transform.matrix3.determinant() < 0.0;
                (&self.scene.meshes[origin.mesh.0 as usize], origin.triangle, mirrored)
            }
        }
    }

    /// The geometry that a vertex is taken from, and world from its mesh.
    fn geometry_of(&self, (instance, geometry, _): (u32, u32, u32)) -> (&'a Geometry, DAffine3) {
        let placing = &self.scene.instances[instance as usize];
        let (mesh, transform) = match placing.stand_in.as_ref().filter(|_| self.space == Space::World) {
            Some(stand_in) => (stand_in.copy, stand_in.transform),
            None => (placing.mesh, placing.transform),
        };
        (&self.scene.meshes[mesh.0 as usize].geometries[geometry as usize], transform)
    }

    /// In the frame, computed in double precision and rounded once.
    fn position(&self, vertex: (u32, u32, u32)) -> Vec3 {
        let (geometry, transform) = self.geometry_of(vertex);
        let stored = geometry.positions[vertex.2 as usize];
        let seen = match self.space {
            Space::Mesh => stored.as_dvec3(),
            Space::World => transform.transform_point3(stored.as_dvec3()),
        };
        self.into.map_or(seen, |into| into.transform_point3(seen)).as_vec3()
    }

    /// What the triangles of an alpha-tested geometry test, which is the same texture for one material.
    fn alpha(&self) -> Option<AlphaTest> {
        let first = self.geometry_of(*self.list.first()?).0.alpha.as_ref()?;
        let placed = |&vertex: &(u32, u32, u32)| {
            let texture = self.geometry_of(vertex).0.alpha.as_ref().and_then(|alpha| alpha.texture.as_ref());
            texture.and_then(|t| t.texcoords.get(vertex.2 as usize)).copied().unwrap_or_default()
        };
        let texture = first.texture.as_ref().map(|texture| {
            let known = !texture.texcoords.is_empty();
            let texcoords = if known { self.list.iter().map(placed).collect() } else { Vec::new() };
            AlphaTexture { texcoords, ..*texture }
        });
        Some(AlphaTest { texture, ..*first })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::methods::{Method, Options, run};
    use proptest::prelude::*;

    /// The largest distance between a corner and where the stored scene has it, over all triangles that are placed.
    fn largest_error(scene: &Scene, layout: &Layout, stored: &Scene) -> f64 {
        let mut largest = 0.0f64;
        for (instance, placement) in (0..).zip(&layout.placements) {
            let content = &layout.groups[placement.group as usize].content;
            let all: Vec<u32> = (0..stored.mesh_of(InstanceId(instance)).triangle_count() as u32).collect();
            let placed = |triangle| TriangleRef { instance: placement.instance.map_or(0, |i| i.0), triangle };
            let sources: Vec<TriangleRef> = match content {
                Content::Kept(_) => all.iter().map(|&t| placed(t)).collect(),
                Content::Piece { geometries, .. } => {
                    geometries.iter().flat_map(|g| &g.triangles).map(|at| placed(at.triangle)).collect()
                }
                Content::Baked { geometries, .. } => geometries.iter().flat_map(|g| g.triangles.clone()).collect(),
            };
            assert_eq!(sources.len(), all.len());
            for (source, triangle) in sources.into_iter().zip(all) {
                let corners = scene.world_corners(source).into_iter();
                let stored = stored.world_corners(TriangleRef { instance, triangle });
                largest = corners.zip(stored).map(|(a, b)| a.distance(b)).fold(largest, f64::max);
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
