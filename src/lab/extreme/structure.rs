//! Scenes with nothing in them, with very much in them, and small files that claim very much.

use glam::{DVec3, dvec3};
use raykiln_formats::unchecked::{File, Shape, list, numbers};

use super::shapes::{boxes, cuboid, show_boxes};
use super::{Case, Outcome};
use crate::verify::random::Random;

pub(super) const CASES: &[Case] = &[
    Case::new(
        "empty-scene",
        "a scene without nodes",
        Outcome::Refused("the default scene holds no triangles"),
        |file, _| file.show([]),
    ),
    Case::new("empty-mesh", "a mesh without primitives, beside eight others", Outcome::Exact, |file, random| {
        let mut nodes = show_boxes(file, &boxes(random));
        let mesh = file.push("meshes", r#"{"primitives":[]}"#);
        nodes.push(file.node("nothing", mesh));
        file.show(nodes);
    }),
    Case::new("mesh-without-node", "a mesh that no node places", Outcome::Exact, |file, random| {
        file.mesh("left alone", &[&cuboid(DVec3::ZERO, DVec3::ONE)]);
        show_boxes(file, &boxes(random));
    }),
    Case::new("one-triangle-objects", "300 objects of one triangle each", Outcome::Bounded, |file, random| {
        one_triangle_objects(file, random, 300)
    }),
    Case::new(
        "a-million-one-triangle-objects",
        "1,000,000 objects of one triangle each",
        Outcome::Bounded,
        |file, random| one_triangle_objects(file, random, 1_000_000),
    )
    .large(),
    Case::new("many-materials", "200 materials, each used by one object", Outcome::Exact, |file, random| {
        many_materials(file, random, 200)
    }),
    Case::new("70000-materials", "70,000 materials, each used by one object", Outcome::Bounded, |file, random| {
        many_materials(file, random, 70_000)
    })
    .large(),
    Case::new("shared-vertices", "200 primitives that share one vertex buffer", Outcome::Exact, shared_vertices),
    Case::new(
        "instances-from-a-small-file",
        "4,096 nodes, each with the same 4,096 copies: 2^24 instances",
        Outcome::Refused("copies in all, because parts of the file are used many times"),
        instances,
    ),
    Case::new(
        "triangles-from-a-small-file",
        "1,000 primitives that share 90,000 indices",
        Outcome::Refused("triangles in all, because parts of the file are used many times"),
        shared_indices,
    ),
    Case::new(
        "positions-from-a-small-file",
        "5,000 overlapping accessors of 20,000 positions each",
        Outcome::Refused("vertices in all, because parts of the file are used many times"),
        overlapping_accessors,
    ),
    Case::new(
        "sparse-claim",
        "a sparse accessor that claims 4e9 elements",
        Outcome::Refused("more than the file has bytes"),
        sparse_claim,
    ),
];

fn one_triangle_objects(file: &mut File, random: &mut Random, count: usize) {
    let corners = (0..count).flat_map(|_| {
        let at = 50.0 * random.unit() * random.direction();
        [at, at + random.direction(), at + random.direction()]
    });
    let bytes: Vec<u8> = corners.flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    let view = file.view(&bytes);
    for i in 0..count {
        let accessor = file.accessor(view, 36 * i, (5126, "VEC3"), 3);
        let primitive = format!(r#"{{"attributes":{{"POSITION":{accessor}}}}}"#);
        let mesh = file.push("meshes", format!(r#"{{"primitives":[{primitive}]}}"#));
        file.push("nodes", format!(r#"{{"mesh":{mesh}}}"#));
    }
    file.show(0..count);
}

fn many_materials(file: &mut File, random: &mut Random, count: usize) {
    let side = (count as f64).sqrt().ceil() as usize;
    let mut nodes = Vec::new();
    for i in 0..count {
        let material = file.material(&format!("material {i}"), [i as f64 / count as f64, random.unit(), 0.5]);
        let at = dvec3((i % side) as f64, (i / side) as f64, random.unit());
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| at + p);
        let shape = Shape { positions: corners.to_vec(), material: Some(material), ..Shape::default() };
        nodes.push(file.object("tile", &shape));
    }
    file.show(nodes);
}

/// A grid of vertices whose rows of triangles are primitives of their own.
fn shared_vertices(file: &mut File, _: &mut Random) {
    let (rows, columns) = (200, 10);
    let at = |row: u32, column: u32| row * (columns + 1) + column;
    let vertex = |i: u32| [(i % (columns + 1)) as f32, (i / (columns + 1)) as f32, (i % 7) as f32 * 0.1];
    let positions = file.positions((0..(rows + 1) * (columns + 1)).map(vertex));
    let squares = (0..rows * columns).map(|i| (i / columns, i % columns));
    let triangles: Vec<[u32; 3]> = squares
        .flat_map(|(r, c)| [[at(r, c), at(r, c + 1), at(r + 1, c + 1)], [at(r, c), at(r + 1, c + 1), at(r + 1, c)]])
        .collect();
    let bytes: Vec<u8> = triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
    let view = file.view(&bytes);
    let mut nodes = Vec::new();
    for row in 0..rows as usize {
        let count = 6 * columns as usize;
        let indices = file.accessor(view, 4 * count * row, (5125, "SCALAR"), count);
        let primitive = format!(r#"{{"attributes":{{"POSITION":{positions}}},"indices":{indices}}}"#);
        let mesh = file.push("meshes", format!(r#"{{"primitives":[{primitive}]}}"#));
        nodes.push(file.node("row", mesh));
    }
    file.show(nodes);
}

fn instances(file: &mut File, random: &mut Random) {
    let mesh = file.mesh("box", &[&cuboid(DVec3::ZERO, DVec3::ONE)]);
    let places = (0..4096).flat_map(|_| (100.0 * random.direction()).as_vec3().to_array());
    let places: Vec<f32> = places.collect();
    let accessor = file.floats("VEC3", places);
    let copies = format!(r#"{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{accessor}}}}}}}"#);
    let nodes: Vec<usize> = (0..4096).map(|_| file.node("copies", mesh)).collect();
    for &node in &nodes {
        file.set("nodes", node, "translation", numbers((1000.0 * random.direction()).to_array()));
        file.set("nodes", node, "extensions", &copies);
    }
    file.set_root("extensionsUsed", list([r#""EXT_mesh_gpu_instancing""#]));
    file.show(nodes);
}

fn shared_indices(file: &mut File, random: &mut Random) {
    let shape = Shape { triangles: vec![[0, 1, 2]; 30_000], ..cuboid(random.direction(), DVec3::ONE) };
    let mesh = file.mesh("box", &[&shape]);
    let primitive = r#"{"attributes":{"POSITION":0},"indices":1}"#;
    let copies = file.push("meshes", format!(r#"{{"primitives":{}}}"#, list([primitive; 100_000 / 100])));
    let nodes = [mesh, copies].map(|mesh| file.node("box", mesh));
    file.show(nodes);
}

fn overlapping_accessors(file: &mut File, random: &mut Random) {
    let bytes: Vec<u8> =
        (0..25_000).flat_map(|_| random.direction().as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    let view = file.view(&bytes);
    let mut nodes = Vec::new();
    for i in 0..5_000 {
        let accessor = file.accessor(view, 12 * i, (5126, "VEC3"), 20_000);
        let primitive = format!(r#"{{"attributes":{{"POSITION":{accessor}}},"mode":4}}"#);
        let mesh = file.push("meshes", format!(r#"{{"primitives":[{primitive}]}}"#));
        nodes.push(file.node("part", mesh));
    }
    file.show(nodes);
}

fn sparse_claim(file: &mut File, random: &mut Random) {
    let mut nodes = show_boxes(file, &boxes(random));
    let indices = file.view(&0_u32.to_le_bytes());
    let values = file.view(&[0; 12]);
    let sparse = format!(
        r#"{{"count":1,"indices":{{"bufferView":{indices},"componentType":5125}},"values":{{"bufferView":{values}}}}}"#
    );
    let text = format!(r#"{{"componentType":5126,"count":4000000000,"type":"VEC3","sparse":{sparse}}}"#);
    let accessor = file.push("accessors", text);
    let mesh = file.push("meshes", format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{accessor}}}}}]}}"#));
    nodes.push(file.node("claim", mesh));
    file.show(nodes);
}
