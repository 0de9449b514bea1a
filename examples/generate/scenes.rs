//! Large scenes for measurements.

use crate::Request;
use crate::random::Random;
use crate::shapes::{Shape, cube, icosphere, knot, sweep, tube};
use crate::writer::Writer;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use serde_json::json;
use std::io;
use std::path::Path;

/// Half the edge of the cube that the scenes fill.
const HALF: f64 = 50.0;

/// Several materials, so that merging meshes has geometries to keep separate.
pub(crate) fn palette(writer: &mut Writer) -> Vec<usize> {
    let shade = |i: usize| [0.2 + 0.1 * i as f64, 0.5, 0.9 - 0.1 * i as f64];
    (0..8).map(|i| writer.material(&format!("paint {i}"), shade(i))).collect()
}

/// Nodes, each with its own mesh: an icosphere of 1,280 triangles, scaled, rotated and placed at random.
pub(crate) fn nodes(out: &Path, request: &Request) -> io::Result<()> {
    let size = request.size_ratio.unwrap_or(0.02) * HALF;
    scattered(out, request, request.count.unwrap_or(10_000), icosphere(1.0, 3), |random| {
        size * dvec3(random.between(0.5, 1.5), random.between(0.5, 1.5), random.between(0.5, 1.5))
    })
}

/// Cubes of various sizes, each a node with its own mesh.
pub(crate) fn cubes(out: &Path, request: &Request) -> io::Result<()> {
    let size = request.size_ratio.unwrap_or(0.05) * HALF;
    scattered(out, request, request.count.unwrap_or(1_000), cube(2.0), |random| {
        DVec3::splat(size * random.between(0.5, 1.5))
    })
}

/// Scaled copies of a shape as separate meshes, under rotated and translated nodes.
fn scattered(
    out: &Path,
    request: &Request,
    count: usize,
    shape: Shape,
    scale: impl Fn(&mut Random) -> DVec3,
) -> io::Result<()> {
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let materials = palette(&mut writer);
    for i in 0..count {
        let name = format!("object {i}");
        let scaled = shape.clone().placed(DAffine3::from_scale(scale(&mut random)));
        let mesh = writer.mesh(&name, &[(&scaled, Some(materials[i % materials.len()]))])?;
        let rotation = random.rotation().as_quat().normalize().to_array();
        let translation = random.in_cube(HALF).as_vec3().to_array();
        writer.push("nodes", json!({"name": name, "mesh": mesh, "rotation": rotation, "translation": translation}));
    }
    writer.finish(None)
}

/// Tubes in random directions, in world coordinates, each a node with its own mesh.
pub(crate) fn pipes(out: &Path, request: &Request) -> io::Result<()> {
    let length = 2.0 * HALF * request.size_ratio.unwrap_or(0.3);
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let materials = palette(&mut writer);
    for i in 0..request.count.unwrap_or(4_000) {
        let turn: DQuat = random.rotation();
        let place = DAffine3::from_rotation_translation(turn, random.in_cube(HALF));
        let pipe = tube(random.between(0.002, 0.006) * length, length, 12, 4).placed(place);
        writer.object(&format!("pipe {i}"), &pipe, Some(materials[i % materials.len()]))?;
    }
    writer.finish(None)
}

/// Instances of one knot, each about `size_ratio` of the scene in size.
pub(crate) fn instances(out: &Path, request: &Request) -> io::Result<()> {
    let scale = 2.0 * HALF * request.size_ratio.unwrap_or(0.3) / 6.0;
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let material = writer.material("brass", [0.8, 0.6, 0.2]);
    let mesh = writer.mesh("knot", &[(&knot(0.4, 220, 25), Some(material))])?;
    for i in 0..request.count.unwrap_or(1_000) {
        let rotation = random.rotation().as_quat().normalize().to_array();
        let translation = random.in_cube(HALF).as_vec3().to_array();
        let node = json!({"name": format!("knot {i}"), "mesh": mesh, "rotation": rotation,
            "translation": translation, "scale": [scale, scale, scale]});
        writer.push("nodes", node);
    }
    writer.finish(None)
}

/// Strands of hair on a ball, each perpendicular to the surface at its root and drooping, with 3 sides and 2 segments;
/// grouped into locks of one mesh each.
pub(crate) fn hair(out: &Path, request: &Request) -> io::Result<()> {
    const LOCKS: usize = 8;
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let materials = palette(&mut writer);
    let count = request.count.unwrap_or(30_000);
    for (lock, &material) in materials.iter().enumerate().take(LOCKS) {
        let strands = (count + LOCKS - 1 - lock) / LOCKS;
        let hair = (0..strands).fold(Shape::default(), |so_far, _| so_far.and(&strand(&mut random)));
        writer.object(&format!("lock {lock}"), &hair, Some(material))?;
    }
    writer.finish(None)
}

fn strand(random: &mut Random) -> Shape {
    let out = random.rotation() * DVec3::Y;
    let (root, length) = (0.4 * HALF * out, random.between(0.3, 0.5) * HALF);
    let drop = random.between(0.2, 0.6) * length;
    let aside = out.any_orthonormal_vector().cross(DVec3::Y + 0.1 * out).normalize();
    sweep(random.between(0.0005, 0.001) * HALF, 3, 2, aside, |t| root + length * t * out - drop * t * t * DVec3::Y)
}

/// Instances of one knot on a cubic lattice, with a spacing that keeps even the boxes of rotated boxes disjoint.
pub(crate) fn lattice(out: &Path, request: &Request) -> io::Result<()> {
    let count = request.count.unwrap_or(1_000);
    let edge = (1..).find(|n: &usize| n.pow(3) >= count).expect("a cube is large enough");
    let pitch = 2.0 * HALF / edge as f64;
    // Half the diagonal of the knot's box is less than 5.1 units.
    let scale = pitch / (2.0 * 5.1);
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let material = writer.material("brass", [0.8, 0.6, 0.2]);
    let mesh = writer.mesh("knot", &[(&knot(0.4, 220, 25), Some(material))])?;
    for i in 0..count {
        let rotation = random.rotation().as_quat().normalize().to_array();
        let place = [i % edge, i / edge % edge, i / (edge * edge)].map(|n| (n as f64 + 0.5) * pitch - HALF);
        let node = json!({"name": format!("knot {i}"), "mesh": mesh, "rotation": rotation,
            "translation": place, "scale": [scale, scale, scale]});
        writer.push("nodes", node);
    }
    writer.finish(None)
}
