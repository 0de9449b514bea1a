//! Seconds to find copies among very many small meshes: `cargo bench --bench copies -- [MESHES]`, by default 100,000.
//! The noisy cubes, none of which are copies, are the worst case: their lengths differ by little more than the error
//! bounds of a mesh far from the origin, so very many are compared.

use fastrand::Rng;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use raykiln::copies::{self, Likeness, Materials, Options};
use raykiln::scene::{self, LoadOptions};
use raykiln_formats::Document;
use raykiln_formats::document::Kind;
use serde_json::json;
use std::time::Instant;

/// How the cubes of a class are modified.
#[derive(Clone, Copy)]
struct Class {
    name: &'static str,
    turned: bool,
    shuffled: bool,
    noise: f64,
    /// Number of copies expected among this many meshes.
    copies: fn(usize) -> usize,
}

const CLASSES: [Class; 4] = [
    Class { name: "equal cubes", turned: false, shuffled: false, noise: 0.0, copies: |n| n - 1 },
    Class { name: "turned cubes", turned: true, shuffled: false, noise: 0.0, copies: |n| n - 1 },
    Class { name: "turned cubes, shuffled", turned: true, shuffled: true, noise: 0.0, copies: |n| n - 1 },
    Class { name: "noisy cubes", turned: true, shuffled: false, noise: 0.02, copies: |_| 0 },
];

fn main() {
    let count = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(100_000);
    for class in CLASSES {
        let doc = document(&class, count);
        let (scene, _) = scene::load(&doc, &LoadOptions::default()).expect("the document is sound");
        let options = Options {
            likeness: Likeness::Rigid,
            materials: Materials::Same,
            max_position_error_ratio: 1e-6,
            least_saved_bytes: 0,
        };
        let start = Instant::now();
        let found = copies::find(&doc, &scene, &options);
        println!("{count} {:<24} {:6.2} s, {} copies", class.name, start.elapsed().as_secs_f64(), found.list.len());
        assert_eq!(found.list.len(), (class.copies)(count));
    }
}

/// Positions and triangles of one cube.
fn cube(class: &Class, random: &mut Rng) -> ([[f32; 3]; 8], [[u16; 3]; 12]) {
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let mut triangles = [[0; 3]; 12];
    for (i, [a, b, c, d]) in faces.into_iter().enumerate() {
        (triangles[2 * i], triangles[2 * i + 1]) = ([a, b, c], [a, c, d]);
    }
    let by = if class.turned { motion(random) } else { DAffine3::IDENTITY };
    let mut order = [0, 1, 2, 3, 4, 5, 6, 7];
    if class.shuffled {
        random.shuffle(&mut order);
        random.shuffle(&mut triangles);
    }
    let mut positions = [[0.0; 3]; 8];
    for (i, place) in order.into_iter().enumerate() {
        let noise = dvec3(random.f64(), random.f64(), random.f64()) * class.noise;
        let corner = dvec3((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) + noise;
        positions[place] = by.transform_point3(corner).as_vec3().to_array();
    }
    (positions, triangles.map(|t| t.map(|v: u16| order[usize::from(v)] as u16)))
}

fn motion(random: &mut Rng) -> DAffine3 {
    let turn = DQuat::from_xyzw(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5, random.f64() + 0.1);
    let place = 100.0 * dvec3(random.f64(), random.f64(), random.f64());
    DAffine3::from_scale_rotation_translation(DVec3::splat(0.5 + random.f64()), turn.normalize(), place)
}

/// A document of `count` cubes, each with a node without a transform.
fn document(class: &Class, count: usize) -> Document {
    let mut random = Rng::with_seed(1);
    let (mut bytes, mut accessors, mut views, mut meshes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for i in 0..count {
        let (positions, triangles) = cube(class, &mut random);
        for (data, component, length, kind) in [
            (bytemuck::cast_slice::<_, u8>(&positions), 5126, 8, "VEC3"),
            (bytemuck::cast_slice(&triangles), 5123, 36, "SCALAR"),
        ] {
            views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len()}));
            accessors.push(
                json!({"bufferView": views.len() - 1, "componentType": component, "count": length, "type": kind}),
            );
            bytes.extend(data);
        }
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": 2 * i}, "indices": 2 * i + 1}]}));
    }
    let nodes: Vec<_> = (0..count).map(|mesh| json!({"mesh": mesh})).collect();
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": (0..count).collect::<Vec<_>>()}], "nodes": nodes,
        "meshes": meshes, "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bytes.len()}]
    });
    Document {
        json,
        buffers: vec![bytes.into()],
        path: "cubes.gltf".into(),
        kind: Kind::Gltf,
        warnings: Vec::new(),
        in_memory: None,
        residuals: Default::default(),
        sidecar: None,
    }
}
