//! Small scenes and rays for the tests.

use glam::{DAffine3, DVec3, Vec3};

use crate::scene::{Geometry, Instance, Mesh, MeshId, Opacity, Scene};
use crate::verify::rays::Ray;

/// Deterministic random numbers in [0, 1) (G. Steele, D. Lea, C. Flood, "Fast Splittable Pseudorandom Number
/// Generators", 2014).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a point in the cube from -`half` to `half`.
    pub(super) fn point(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()) * (2.0 * half) - half
    }
}

/// Returns rays that start all around the origin and aim at points near it.
pub(super) fn rays(count: usize, reach: f64) -> Vec<Ray> {
    let mut random = Random(7);
    let mut ray = || {
        let (from, to) = (random.point(2.0 * reach), random.point(reach));
        Ray { origin: from.as_vec3(), direction: (to - from).normalize().as_vec3(), t_min: 0.0, t_max: f32::INFINITY }
    };
    (0..count).map(|_| ray()).collect()
}

/// Returns unconnected triangles in the cube from -1 to 1.
pub(super) fn soup(triangles: usize, opacity: Opacity, seed: u64) -> Geometry {
    let mut random = Random(seed);
    let (mut geometry, mut positions) = (Geometry { opacity, ..Geometry::default() }, Vec::new());
    for t in 0..triangles as u32 {
        let center = random.point(0.8);
        positions.extend((0..3).map(|_| (center + random.point(0.2)).as_vec3()));
        geometry.triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
    }
    geometry.positions = positions.into();
    geometry
}

pub(super) fn geometry(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Geometry {
    Geometry {
        positions: positions.iter().map(|p| Vec3::from_array(*p)).collect(),
        triangles: triangles.to_vec(),
        ..Geometry::default()
    }
}

pub(super) fn mesh(mut geometries: Vec<Geometry>) -> Mesh {
    let mut first_triangle = 0;
    for g in &mut geometries {
        g.first_triangle = first_triangle;
        first_triangle += g.triangles.len() as u32;
    }
    Mesh { geometries, ..Mesh::default() }
}

pub(super) fn scene(meshes: Vec<Mesh>, placed: impl IntoIterator<Item = (u32, DAffine3)>) -> Scene {
    let place = |(mesh, transform)| Instance {
        name: String::new(),
        node: 0,
        copy: 0,
        mesh: MeshId(mesh),
        transform,
        pinned: None,
    };
    Scene { meshes: meshes.into(), instances: placed.into_iter().map(place).collect(), ..Scene::default() }
}

/// Returns a scene with three geometries in one mesh and one in another, of all kinds of opacity; its instances are
/// rotated, mirrored, sheared, stretched, and flat.
pub(super) fn mixed() -> Scene {
    let mask = Opacity::Mask { cutoff: 0.5 };
    let three = mesh(vec![soup(50, Opacity::Opaque, 1), soup(1, mask, 2), soup(80, Opacity::Blend, 3)]);
    let one = mesh(vec![soup(60, Opacity::Opaque, 4)]);
    let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.0);
    let mut sheared = DAffine3::from_translation(DVec3::new(0.0, 2.0, 0.0));
    sheared.matrix3.y_axis.x = 0.7;
    let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    let scaled = |x, y, z| DAffine3::from_scale(DVec3::new(x, y, z));
    let transforms = [
        (0, DAffine3::IDENTITY),
        (1, at(2.0, 0.0, 0.0) * turned),
        (0, at(-2.0, 0.0, 0.0) * scaled(-1.0, 1.0, 1.0)),
        (0, scaled(0.0, 1.0, 1.0)),
        (1, sheared),
        (1, at(0.0, -2.0, 0.0) * turned * scaled(1.0, -0.3, 2.0) * turned),
        (0, scaled(0.0, 0.0, 0.0)),
        (0, at(0.0, 0.0, 2.5) * scaled(-1.0, -1.0, -1.0)),
    ];
    scene(vec![three, one], transforms)
}
