//! Damaged files are refused or read, and never make the reader panic.

use std::fs;

use raykiln_formats::{Document, ReadOptions, read};
use serde_json::{Value, json};

use crate::support::{Random, document, floats, folder, glb, shorts};

/// A document with something of everything, and its only buffer.
fn everything() -> (Value, Vec<u8>) {
    let mut data = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    data.extend(shorts(&[0, 1, 2, 2, 1, 3]));
    data.extend(floats(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    data.extend([3, 0, 0, 0, 0, 0, 2, 0]);
    let json = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["EXT_mesh_gpu_instancing", "KHR_animation_pointer"],
        "scene": 0,
        "extras": { "raykiln": { "record": { "schema": "raykiln.record/1", "input": "", "geometry": "", "origins": "eJw=" } } },
        "scenes": [{ "nodes": [0] }, { "nodes": [2] }],
        "nodes": [
            { "children": [1], "rotation": [0, 0, 0.6, 0.8], "skin": 0, "mesh": 0 },
            { "mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 3, 4, 1],
              "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "ROTATION": 2 } } } },
            { "camera": 0, "scale": [1, 2, 3] }
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "materials": [{ "alphaMode": "MASK", "alphaCutoff": 0.25 }],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] },
            { "primitives": [{ "attributes": { "POSITION": 3 }, "mode": 5, "targets": [{ "POSITION": 0 }] }] }
        ],
        "skins": [{ "joints": [0, 1] }],
        "animations": [{ "samplers": [{ "input": 1, "output": 0 }], "channels": [
            { "sampler": 0, "target": { "node": 1, "path": "translation" } },
            { "sampler": 0, "target": { "path": "pointer",
                "extensions": { "KHR_animation_pointer": { "pointer": "/nodes/0/scale" } } } }
        ] }],
        "images": [{ "uri": "data:image/png;base64,iVBORw0KGgo=" }, { "bufferView": 3, "mimeType": "image/png" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
            { "bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC4" },
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {
                "count": 1, "indices": { "bufferView": 3, "componentType": 5121 },
                "values": { "bufferView": 2, "byteOffset": 4 } } },
            { "bufferView": 3, "byteOffset": 4, "componentType": 5121, "count": 3, "type": "SCALAR" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
            { "buffer": 0, "byteOffset": 60, "byteLength": 32 },
            { "buffer": 0, "byteOffset": 92, "byteLength": 8 }
        ],
        "buffers": [{ "byteLength": 100 }]
    });
    (json, data)
}

/// Does all that can be done with a document; only the absence of a panic counts.
fn exercise(mut doc: Document) -> bool {
    let sound = doc.contents(ReadOptions::default()).is_ok();
    let _ = doc.contents(ReadOptions::default().with_strict(true));
    for mesh in 0..3 {
        doc.attributes(mesh, 0);
    }
    doc.scalars(1);
    doc.compact();
    sound
}

#[test]
fn the_undamaged_file_is_sound() {
    let (json, data) = everything();
    let doc = document(json, &[data]);
    assert!(doc.contents(ReadOptions::default()).unwrap().warnings.is_empty());
    assert!(exercise(doc));
}

#[test]
fn truncations_and_bit_flips_never_panic() {
    let (json, data) = everything();
    let file = glb(&json, &data);
    let folder = folder(&[]);
    let path = folder.path().join("a.glb");
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut sound = 0;
    for round in 0..1500 {
        let mut bytes = file.clone();
        if round < 500 {
            bytes.truncate(random.below(bytes.len()));
        }
        for _ in 0..1 + round % 4 {
            if !bytes.is_empty() {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
        }
        fs::write(&path, &bytes).unwrap();
        sound += usize::from(read(&path).is_ok_and(exercise));
    }
    // Flips in names and coordinates do no harm; so the mutations reach past the container and the JSON syntax.
    assert!((50..1500).contains(&sound), "{sound}");
}

#[test]
fn truncations_and_bit_flips_of_gltf_never_panic() {
    let (mut json, data) = everything();
    let hex: String = data.iter().map(|b| format!("%{b:02x}")).collect();
    json["buffers"][0]["uri"] = format!("data:,{hex}").into();
    let file = json.to_string().into_bytes();
    let folder = folder(&[]);
    let path = folder.path().join("a.gltf");
    let mut random = Random(0xD1B5_4A32_D192_ED03);
    for round in 0..1500 {
        let mut bytes = file.clone();
        let at = random.below(bytes.len());
        match round % 5 {
            0 => bytes.truncate(at),
            _ => bytes[at] ^= 1 << random.below(8),
        }
        fs::write(&path, &bytes).unwrap();
        let _ = read(&path).is_ok_and(exercise);
    }
}

/// Puts something odd in place of a random value of a JSON tree.
fn distort(json: &mut Value, random: &mut Random) {
    let odd = [
        json!(null),
        json!(-1),
        json!(0),
        json!(1),
        json!(2),
        json!(7),
        json!(255),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(1e300),
        json!(0.5),
        json!(""),
        json!("VEC3"),
        json!([]),
        json!({}),
        json!([0, 0, 0]),
        json!(true),
    ];
    let mut at = json;
    loop {
        let count = match &*at {
            Value::Array(list) => list.len(),
            Value::Object(map) => map.len(),
            _ => 0,
        };
        if count == 0 || random.below(8) == 0 {
            *at = odd[random.below(odd.len())].clone();
            return;
        }
        let child = random.below(count);
        at = match at {
            Value::Array(list) => &mut list[child],
            Value::Object(map) => map.values_mut().nth(child).unwrap(),
            _ => unreachable!("only lists and objects have children"),
        };
    }
}

#[test]
fn distorted_json_never_panics() {
    let (json, data) = everything();
    let folder = folder(&[]);
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    let mut sound = 0;
    for round in 0..8000 {
        let mut json = json.clone();
        for _ in 0..1 + round % 3 {
            distort(&mut json, &mut random);
        }
        let doc = document(json, std::slice::from_ref(&data));
        if round % 16 == 0 {
            let _ = doc.stage(&folder.path().join(if round % 32 == 0 { "a.glb" } else { "a.gltf" }));
        }
        sound += usize::from(exercise(doc));
    }
    assert!(sound > 100, "{sound}");
}
