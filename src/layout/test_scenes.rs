//! Small scenes for the tests of the methods.

use glam::{DAffine3, DVec3, Vec3};
use proptest::prelude::*;

use crate::layout::{Content, Layout, Placement};
use crate::scene::{Bounds, Geometry, Instance, Material, Mesh, MeshId, Pinned, Scene};

/// A scene under construction. Nodes are numbered consecutively.
#[derive(Default)]
pub(crate) struct SceneBuilder(Scene);

impl SceneBuilder {
    /// Adds a mesh with geometries given as material and triangles.
    pub(crate) fn mesh(&mut self, name: &str, geometries: Vec<(u32, Vec<[Vec3; 3]>)>) -> MeshId {
        let mut first_triangle = 0;
        let geometry = |(i, (material, triangles)): (usize, (u32, Vec<[Vec3; 3]>))| {
            let count = triangles.len() as u32;
            first_triangle += count;
            Geometry {
                primitive: i as u32,
                material: Some(material),
                first_triangle: first_triangle - count,
                positions: triangles.concat().into(),
                triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
                ..Geometry::default()
            }
        };
        let geometries = geometries.into_iter().enumerate().map(geometry).collect::<Vec<_>>();
        let materials = geometries.iter().filter_map(|g| g.material).max().map_or(0, |m| m as usize + 1);
        let materials = materials.max(self.0.materials.len());
        self.0.materials.resize(materials, Material::default());
        let source = self.0.meshes.len() as u32;
        self.0.meshes.push(Mesh { name: name.into(), source, geometries, ..Mesh::default() });
        MeshId(source)
    }

    /// Places a mesh.
    pub(crate) fn place(&mut self, mesh: MeshId, name: &str, transform: DAffine3) -> &mut Instance {
        let node = self.0.instances.len() as u32;
        let instance = Instance { name: name.into(), node, copy: 0, mesh, transform, pinned: None };
        self.0.instances.push(instance);
        &mut self.0.instances[node as usize]
    }

    /// Adds a mesh of one geometry and places it with the identity.
    pub(crate) fn object(&mut self, name: &str, material: u32, triangles: Vec<[Vec3; 3]>) {
        let mesh = self.mesh(name, vec![(material, triangles)]);
        self.place(mesh, name, DAffine3::IDENTITY);
    }

    /// Returns the scene and asserts its invariants.
    pub(crate) fn scene(mut self) -> Scene {
        self.0.nodes = self.0.instances.len();
        assert_eq!(self.0.check(), Ok(()));
        self.0
    }
}

pub(crate) fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// `count` small triangles in a row along x, starting at `start`, one unit apart.
pub(crate) fn row(start: Vec3, count: usize) -> Vec<[Vec3; 3]> {
    (0..count).map(|i| small_triangle(start + Vec3::X * i as f32)).collect()
}

/// Eight heaps of two objects that overlap, without exceptions, with a dome 20 times as large around them, or also with
/// an object far away.
pub(crate) fn heaps(exceptions: u32) -> Scene {
    let mut builder = SceneBuilder::default();
    for i in 0..8 {
        let corner = Vec3::new(15.0 * (i % 4) as f32, 15.0 * (i / 4) as f32, 3.0 * i as f32);
        let layer = |by: f32| (0..6).flat_map(move |y| row(corner + Vec3::new(by, by + y as f32, 0.1 * y as f32), 12));
        builder.object("low", 0, layer(0.0).collect());
        builder.object("high", 1, layer(0.1 + 0.7 * i as f32).collect());
    }
    if exceptions > 0 {
        let middle = Vec3::new(30.0, 15.0, 12.0);
        builder.object("sky", 0, vec![[middle - 600.0, middle + Vec3::new(600.0, -600.0, 0.0), middle + 600.0]]);
    }
    if exceptions > 1 {
        builder.object("moon", 0, row(Vec3::new(0.0, 1e6, 0.0), 1));
    }
    builder.scene()
}

/// A triangle with edges of about half a unit, not flat along any axis.
pub(crate) fn small_triangle(corner: Vec3) -> [Vec3; 3] {
    [corner, corner + Vec3::new(0.5, 0.0, 0.25), corner + Vec3::new(0.0, 0.5, 0.25)]
}

/// Returns the number of triangles of each group.
pub(crate) fn group_sizes(scene: &Scene, layout: &Layout) -> Vec<usize> {
    layout.groups.iter().map(|g| g.content.triangle_count(scene)).collect()
}

/// Returns the names of the groups, each after `kept`, `piece` or `baked`.
pub(crate) fn group_names(layout: &Layout) -> Vec<String> {
    let kind = |content: &Content| match content {
        Content::Kept(_) => "kept",
        Content::Piece { .. } => "piece",
        Content::Baked { .. } => "baked",
    };
    layout.groups.iter().map(|g| format!("{} {}", kind(&g.content), g.name)).collect()
}

/// Returns the world box of each placement: the transformed box of a kept mesh or piece, or the box of baked triangles.
pub(crate) fn placed_bounds(scene: &Scene, layout: &Layout) -> Vec<Bounds> {
    let points = |corners: [Vec3; 3]| corners.map(|p| p.as_dvec3());
    let bounds = |placement: &Placement| match &layout.groups[placement.group as usize].content {
        Content::Kept(mesh) => {
            let mesh = &scene.meshes[mesh.0 as usize];
            let triangles = 0..mesh.triangle_count() as u32;
            Bounds::of(triangles.flat_map(|t| points(mesh.corners(t)))).transformed(&placement.transform)
        }
        Content::Piece { mesh, frame, geometries } => {
            let (mesh, into) = (&scene.meshes[mesh.0 as usize], frame.inverse());
            let triangles = geometries.iter().flat_map(|g| &g.triangles);
            let corners = triangles.flat_map(|t| points(mesh.corners(t.triangle))).map(|p| into.transform_point3(p));
            Bounds::of(corners).transformed(&placement.transform)
        }
        Content::Baked { geometries, .. } => {
            Bounds::of(geometries.iter().flat_map(|g| &g.triangles).flat_map(|&t| scene.world_corners(t)))
        }
    };
    layout.placements.iter().map(bounds).collect()
}

fn transform() -> impl Strategy<Value = DAffine3> {
    let rotation = (0..4u32).prop_map(|q| DAffine3::from_rotation_y(f64::from(q) * 0.9));
    let scale = prop_oneof![Just(DVec3::ONE), Just(DVec3::new(-1.0, 1.0, 1.0)), Just(DVec3::new(2.0, 0.5, 1.0))];
    (rotation, scale, [-4.0..4.0, -4.0..4.0, -4.0..4.0])
        .prop_map(|(r, s, t)| DAffine3::from_translation(DVec3::from(t)) * r * DAffine3::from_scale(s))
}

fn triangles() -> impl Strategy<Value = Vec<[Vec3; 3]>> {
    let corner = || [-9..9i8, -9..9i8, -3..3i8].prop_map(|c| Vec3::from(c.map(f32::from)) * 0.5);
    prop::collection::vec([corner(), corner(), corner()], 1..40)
}

/// Generates scenes of a few meshes, some with several geometries, some placed several times, some pinned, some with
/// dropped triangles.
pub(crate) fn any_scene() -> impl Strategy<Value = Scene> {
    let mesh = prop::collection::vec((0..3u32, 0..2u32, triangles()), 1..4);
    let meshes = prop::collection::vec((mesh, 0..5u8), 1..5);
    let instances = prop::collection::vec((any::<prop::sample::Index>(), transform(), 0..4u8), 0..9);
    (meshes, instances).prop_map(|(meshes, instances)| {
        let mut builder = SceneBuilder::default();
        for (geometries, kind) in meshes {
            let classes: Vec<u32> = geometries.iter().map(|g| g.1).collect();
            let mesh = builder.mesh("mesh", geometries.into_iter().map(|(m, _, t)| (m, t)).collect());
            let made = &mut builder.0.meshes[mesh.0 as usize];
            made.geometries.iter_mut().zip(classes).for_each(|(g, class)| g.merge_class = class);
            made.dropped = kind == 0;
            if made.dropped {
                made.geometries[0].kept = Some((1..=made.geometries[0].triangles.len() as u32).collect());
            }
        }
        for (mesh, transform, pin) in instances {
            let mesh = MeshId(mesh.index(builder.0.meshes.len()) as u32);
            builder.place(mesh, "node", transform).pinned = (pin == 0).then_some(Pinned::Animated);
        }
        builder.scene()
    })
}
