//! Scenes for tests.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use proptest::test_runner::Config;

use super::random::Random;
use super::rays::Ray;
use crate::scene::{Geometry, Instance, Mesh, MeshId, Scene};

/// Material, positions and triangles of a geometry.
pub(super) type Parts = (Option<u32>, Vec<Vec3>, Vec<[u32; 3]>);

/// Returns a configuration with this many random cases, or as many as `PROPTEST_CASES` sets.
pub(super) fn cases(usual: u32) -> Config {
    let asked = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok());
    Config::with_cases(asked.unwrap_or(usual))
}

/// Returns a mesh of the given geometries.
pub(super) fn mesh(source: u32, geometries: Vec<Parts>) -> Mesh {
    let mut mesh = Mesh { name: format!("mesh {source}"), source, ..Mesh::default() };
    for (primitive, (material, positions, triangles)) in (0..).zip(geometries) {
        let first_triangle = mesh.triangle_count() as u32;
        mesh.geometries.push(Geometry {
            primitive,
            material,
            first_triangle,
            positions: positions.into(),
            triangles,
            ..Geometry::default()
        });
    }
    mesh
}

pub(super) fn instance(node: u32, mesh: u32, transform: DAffine3) -> Instance {
    Instance { name: format!("node {node}"), node, copy: 0, mesh: MeshId(mesh), transform, pinned: None }
}

/// Returns a scene of meshes and placements, with nodes numbered in order.
pub(crate) fn scene(meshes: Vec<Mesh>, placements: &[(u32, DAffine3)]) -> Scene {
    let instances = (0..).zip(placements).map(|(node, &(mesh, transform))| instance(node, mesh, transform)).collect();
    Scene {
        meshes: meshes.into(),
        instances,
        materials: vec![Default::default(); 4],
        nodes: placements.len(),
        ..Scene::default()
    }
}

/// Returns a cube from -1 to 1 that faces outward, with two triangles per face.
pub(crate) fn cube(source: u32, material: Option<u32>) -> Mesh {
    let corner = |i: u32| Vec3::from_array([1, 2, 4].map(|bit| if i & bit != 0 { 1.0 } else { -1.0 }));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh(source, vec![(material, (0..8).map(corner).collect(), triangles)])
}

/// Returns a room (a cube seen from inside) that contains five cubes of two materials.
pub(crate) fn room() -> Scene {
    let mut walls = cube(0, Some(0));
    for t in &mut walls.geometries[0].triangles {
        t.swap(1, 2);
    }
    let mut two = cube(1, Some(1));
    let (half, rest) = two.geometries[0].triangles.split_at(6);
    let (half, rest, positions) = (half.to_vec(), rest.to_vec(), two.geometries[0].positions.to_vec());
    two = mesh(1, vec![(Some(1), positions.clone(), half), (Some(2), positions, rest)]);
    let at = |x: f64, y: f64, z: f64, size: f64, turn: f64| {
        DAffine3::from_translation(DVec3::new(x, y, z))
            * DAffine3::from_scale(DVec3::splat(size))
            * DAffine3::from_rotation_y(turn)
    };
    let placements = [
        (0, DAffine3::from_scale(DVec3::new(10.0, 4.0, 8.0))),
        (1, at(-6.0, -2.0, -5.0, 1.5, 0.3)),
        (1, at(4.0, -3.0, -4.0, 1.0, 1.0)),
        (1, at(0.0, 2.0, -6.0, 0.8, 0.2) * DAffine3::from_scale(DVec3::new(-1.0, 1.5, 1.0))),
        (1, at(-3.0, 0.0, 5.0, 1.2, 2.0)),
        (1, at(5.0, 1.0, 4.0, 1.1, 0.7)),
    ];
    scene(vec![walls, two], &placements)
}

/// Properties of a random scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    /// Scale factor of the whole scene.
    pub(super) size: f64,
    /// Distance from the origin, in multiples of the size.
    pub(super) offset: f64,
    /// Whether corners lie on integers, so that rays hit edges and sides of boxes exactly.
    pub(super) on_grid: bool,
    /// Whether triangles are a thousandth as wide as they are long.
    pub(super) thin: bool,
    /// Whether instances are mirrored, sheared and scaled by 1e-3 to 1e3.
    pub(super) wild: bool,
}

pub(super) fn random_scene(seed: u64, style: Style) -> Scene {
    let mut random = Random::at(seed, 50, 0);
    let meshes: Vec<Mesh> = (0..1 + random.below(3) as u32).map(|m| random_mesh(&mut random, m, style)).collect();
    let count = meshes.len() as u64;
    let placements: Vec<(u32, DAffine3)> =
        (0..1 + random.below(12)).map(|_| (random.below(count) as u32, random_transform(&mut random, style))).collect();
    scene(meshes, &placements)
}

fn random_point(random: &mut Random, style: Style) -> DVec3 {
    let point = 16.0 * (DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5);
    if style.on_grid { point.round() } else { point }
}

fn random_mesh(random: &mut Random, source: u32, style: Style) -> Mesh {
    let geometries = (0..1 + random.below(2) as u32)
        .map(|g| {
            let count = 1 + random.below(60) as u32;
            let positions = (0..count)
                .flat_map(|_| {
                    let [a, b, mut c] = [(); 3].map(|_| random_point(random, style));
                    if style.thin {
                        c = b + 1e-3 * (c - b);
                    }
                    [a, b, c].map(|p| (p * style.size).as_vec3())
                })
                .collect();
            (Some(g), positions, (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
        })
        .collect();
    mesh(source, geometries)
}

fn random_transform(random: &mut Random, style: Style) -> DAffine3 {
    let place = random_point(random, style) * style.size + DVec3::splat(style.offset * style.size);
    let mut linear = DMat3::IDENTITY;
    if style.wild {
        let scale = DVec3::from_array([(); 3].map(|_| 10f64.powf(2.0 * random.unit() - 1.0)));
        let turn = DMat3::from_axis_angle(random.direction(), random.unit() * 6.0);
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(random.unit(), 1.0, 0.0), DVec3::Z);
        let mirror = if random.below(2) == 0 { -1.0 } else { 1.0 };
        linear = turn * DMat3::from_diagonal(scale * DVec3::new(mirror, 1.0, 1.0)) * shear;
    }
    DAffine3 { matrix3: linear, translation: place }
}

/// Returns random rays around a random scene, some of them parallel to axes and through integer coordinates.
pub(super) fn random_rays(seed: u64, style: Style, count: usize) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let mut random = Random::at(seed, 51, i);
            let offset = DVec3::splat(style.offset * style.size);
            let origin = 2.0 * random_point(&mut random, style) * style.size + offset;
            let target = random_point(&mut random, style) * style.size + offset;
            let mut direction = target - origin;
            if i % 3 == 0 {
                let axis = random.below(3) as usize;
                direction = DVec3::ZERO;
                direction[axis] = if random.below(2) == 0 { -1.0 } else { 1.0 };
            } else if i % 3 == 1 {
                direction[random.below(3) as usize] = 0.0;
            }
            Ray::endless(origin, direction)
        })
        .collect()
}
