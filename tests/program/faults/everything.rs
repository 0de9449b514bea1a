//! A document with one of everything that a bake must keep.

use raykiln_formats::{Document, read_bytes};
use serde_json::{Map, Value, json};

use crate::common::glb;

/// Quads along each side of a patch.
const SIDE: usize = 4;

#[derive(Default)]
struct Builder {
    views: Vec<Value>,
    accessors: Vec<Value>,
    bytes: Vec<u8>,
}

impl Builder {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    fn floats(&mut self, components: usize, values: &[f32]) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(components - 1).copied().unwrap_or("MAT4");
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let accessor = self.accessor(&bytes, 5126, kind, values.len() / components);
        if components == 3 {
            let of = |pick: fn(f32, f32) -> f32, axis| values.iter().skip(axis).step_by(3).copied().reduce(pick);
            let bounds = |pick| json!([of(pick, 0), of(pick, 1), of(pick, 2)]);
            self.accessors[accessor]["min"] = bounds(f32::min);
            self.accessors[accessor]["max"] = bounds(f32::max);
        }
        accessor
    }

    /// A bent patch of some attributes.
    fn patch(&mut self, attributes: &[&str], material: usize) -> Value {
        let mut named = Map::new();
        for name in ["POSITION"].iter().chain(attributes) {
            named.insert((*name).to_owned(), self.attribute(name).into());
        }
        let corner = |x: usize, y: usize| (x + y * (SIDE + 1)) as u16;
        let quad = |x, y| {
            [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y), corner(x + 1, y + 1), corner(x, y + 1)]
        };
        let indices: Vec<u8> =
            (0..SIDE * SIDE).flat_map(|i| quad(i % SIDE, i / SIDE)).flat_map(u16::to_le_bytes).collect();
        let indices = self.accessor(&indices, 5123, "SCALAR", 6 * SIDE * SIDE);
        json!({"attributes": named, "indices": indices, "material": material})
    }

    fn attribute(&mut self, name: &str) -> usize {
        let place = |i: usize| [(i % (SIDE + 1)) as f32 / SIDE as f32, (i / (SIDE + 1)) as f32 / SIDE as f32];
        let vertices: Vec<[f32; 2]> = (0..(SIDE + 1) * (SIDE + 1)).map(place).collect();
        let each =
            |of: &dyn Fn(f32, f32) -> Vec<f32>| -> Vec<f32> { vertices.iter().flat_map(|[x, y]| of(*x, *y)).collect() };
        let joints: Vec<u8> =
            vertices.iter().flat_map(|[x, _]| [u8::from(*x > 0.5), u8::from(*x <= 0.5), 0, 0]).collect();
        match name {
            "NORMAL" => self.floats(3, &each(&|x, _| vec![0.6 * x, 0.0, (1.0 - 0.36 * x * x).sqrt()])),
            "TANGENT" => self.floats(4, &each(&|x, _| vec![(1.0 - 0.36 * x * x).sqrt(), 0.0, -0.6 * x, 1.0])),
            "TEXCOORD_0" => self.floats(2, &each(&|x, y| vec![x, y])),
            "TEXCOORD_1" => self.floats(2, &each(&|x, y| vec![0.5 * y, 0.5 * x])),
            "COLOR_0" => self.floats(4, &each(&|x, y| vec![x, y, 0.5, 1.0])),
            "_HEAT" => self.floats(1, &each(&|x, y| vec![100.0 * x + y])),
            "JOINTS_0" => self.accessor(&joints, 5121, "VEC4", vertices.len()),
            "WEIGHTS_0" => self.floats(4, &each(&|x, _| vec![0.75 + 0.1 * x, 0.25 - 0.1 * x, 0.0, 0.0])),
            // Flatter, so that no two patches lie in one place.
            "FLAT" => self.floats(3, &each(&|x, y| vec![x, y, 0.1 * (x + 2.0 * y).sin() - 0.5])),
            _ => self.floats(3, &each(&|x, y| vec![x, y, 0.3 * (2.0 * x + y).sin()])),
        }
    }

    /// A small picture.
    fn picture(&mut self, gray: u8) -> Value {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_color(png::ColorType::Grayscale);
        let mut writer = encoder.write_header().expect("sound");
        writer.write_image_data(&[gray, 1, 2, 3]).expect("written");
        writer.finish().expect("written");
        json!({"bufferView": self.view(&bytes), "mimeType": "image/png"})
    }
}

/// Returns the document: textured, mirrored, morphed, skinned and animated objects, points and lines, cameras, lights,
/// variants and a second scene.
pub(super) fn everything() -> Document {
    let mut file = Builder::default();
    let meshes = meshes(&mut file);
    let animations = animations(&mut file);
    let matrices: Vec<f32> = (0..32).map(|i| if i % 16 % 5 == 0 { 1.0 } else { 0.0 }).collect();
    let mut matrices = matrices;
    matrices[12] = 0.5;
    let bind = file.floats(16, &matrices);
    let images = json!([file.picture(10), file.picture(200)]);
    let json = json!({
        "asset": {"version": "2.0", "copyright": "the town", "extras": {"edition": 2}},
        "extras": {"revision": 7},
        "scene": 0,
        "scenes": [{"name": "day", "nodes": [0, 16], "extras": {"hour": 12}}, {"name": "night", "nodes": [15, 16]}],
        "nodes": nodes(),
        "meshes": meshes,
        "skins": [{"name": "leg", "joints": [8, 9], "skeleton": 8, "inverseBindMatrices": bind}],
        "animations": animations,
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "materials": materials(),
        "textures": [{"source": 0, "sampler": 0}, {"source": 1, "sampler": 1}],
        "samplers": [{"wrapS": 33071, "magFilter": 9729}, {"minFilter": 9987}],
        "images": images,
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_variants", "KHR_materials_clearcoat", "KHR_materials_ior", "KHR_texture_transform"],
        "extensions": {
            "KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 40, "color": [1.0, 0.5, 0.25]}]},
            "KHR_materials_variants": {"variants": [{"name": "new"}, {"name": "old"}]},
        },
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{"byteLength": file.bytes.len().next_multiple_of(4)}],
    });
    read_bytes("everything.glb", glb(&json, &file.bytes)).expect("the document is sound")
}

fn meshes(file: &mut Builder) -> Value {
    let rich = ["NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "_HEAT"];
    let mut plain = file.patch(&["NORMAL"], 2);
    plain["extras"] = json!({"part": "wall"});
    plain["extensions"] = json!({"KHR_materials_variants": {"mappings": [{"material": 3, "variants": [1]}]}});
    let mut morphed = file.patch(&["NORMAL"], 2);
    let target = json!({"POSITION": file.attribute("FLAT"), "NORMAL": file.attribute("NORMAL")});
    morphed["targets"] = json!([target]);
    let skinned = file.patch(&["NORMAL", "JOINTS_0", "WEIGHTS_0"], 2);
    let strokes = file.floats(3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.5]);
    let mut flat = file.patch(&["TEXCOORD_0"], 1);
    flat["attributes"]["POSITION"] = file.attribute("FLAT").into();
    json!([
        {"name": "patch", "extras": {"kind": "rich"}, "primitives": [file.patch(&rich, 0), flat]},
        {"name": "plain", "primitives": [plain]},
        {"name": "morphed", "weights": [0.5], "primitives": [morphed]},
        {"name": "skinned", "primitives": [skinned]},
        {"name": "strokes", "primitives": [
            {"mode": 0, "attributes": {"POSITION": strokes}, "material": 2},
            {"mode": 3, "attributes": {"POSITION": strokes}, "material": 2},
        ]},
    ])
}

fn nodes() -> Value {
    json!([
        {"name": "town", "extras": {"mayor": "nobody"}, "children": [1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13]},
        {"name": "patch a", "mesh": 0},
        {"name": "patch b", "mesh": 0, "translation": [3.0, 0.0, 0.0], "rotation": [0.0, 0.6, 0.0, 0.8]},
        {"name": "mirrored patch", "mesh": 0, "translation": [6.0, 0.0, 0.0], "scale": [-1.0, 1.0, 2.0]},
        {"name": "plain a", "mesh": 1, "translation": [0.0, 3.0, 0.0], "extras": {"number": 1}},
        {"name": "plain b", "mesh": 1, "translation": [3.0, 3.0, 0.0], "rotation": [0.0, 0.0, 0.6, 0.8]},
        {"name": "morphed", "mesh": 2, "translation": [6.0, 3.0, 0.0]},
        {"name": "skinned", "mesh": 3, "skin": 0, "translation": [0.0, 6.0, 0.0]},
        {"name": "hip", "translation": [0.0, 6.0, 1.0], "children": [9]},
        {"name": "knee", "translation": [0.5, 0.0, 0.0]},
        {"name": "strokes", "mesh": 4, "translation": [3.0, 6.0, 0.0]},
        {"name": "viewpoint", "camera": 0, "translation": [3.0, 3.0, 15.0]},
        {"name": "lamp", "translation": [3.0, 3.0, 5.0], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"name": "carousel", "translation": [9.0, 3.0, 0.0], "children": [14]},
        {"name": "horse", "mesh": 1, "translation": [1.0, 0.0, 0.0]},
        {"name": "moon", "mesh": 1, "translation": [0.0, 0.0, 9.0]},
        {"name": "empty place", "translation": [0.0, 9.0, 0.0]},
    ])
}

fn materials() -> Value {
    json!([
        {
            "name": "brick", "extras": {"cost": 3}, "emissiveFactor": [0.1, 0.0, 0.0],
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.9, 0.8, 0.7, 1.0], "metallicFactor": 0.25, "roughnessFactor": 0.5,
                "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 3.0]}}},
            },
            "normalTexture": {"index": 1, "scale": 0.75}, "occlusionTexture": {"index": 1, "texCoord": 1, "strength": 0.5},
            "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}, "KHR_materials_ior": {"ior": 1.4}},
        },
        {
            "name": "leaf", "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": true,
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        },
        {"name": "wall", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0}},
        {"name": "old wall", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.3, 0.1, 1.0]}},
    ])
}

fn animations(file: &mut Builder) -> Value {
    let times = file.floats(1, &[0.0, 1.0, 2.0]);
    let turns = file.floats(4, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8, 0.0, 0.0, 0.0, 1.0]);
    let steps = file.floats(3, &[0.5, 0.0, 0.0, 0.5, 0.1, 0.0, 0.5, 0.0, 0.0]);
    json!([{
        "name": "turn",
        "samplers": [{"input": times, "output": turns}, {"input": times, "output": steps, "interpolation": "STEP"}],
        "channels": [
            {"sampler": 0, "target": {"node": 13, "path": "rotation"}},
            {"sampler": 1, "target": {"node": 9, "path": "translation"}},
        ],
    }])
}
