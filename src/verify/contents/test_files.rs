//! Files for the tests of this folder.

use std::path::PathBuf;

use raykiln_formats::Document;
use raykiln_formats::document::{Kind, Residuals};
use serde_json::{Value, json};

use super::super::Sides;
use super::super::surface::pairs::{Pair, Pairs};
use super::{ContentsReport, DifferenceKind, Inputs, Tolerance, compare};
use crate::scene::{LoadOptions, Scene, TriangleRef, load};

/// Reads a sample.
pub(super) fn sample(name: &str) -> Document {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("samples").join(name);
    let files = ["scene.gltf", "scene.glb", "scene.obj"].map(|file| folder.join(file));
    let file = files.iter().find(|file| file.exists()).expect("the sample is there");
    raykiln_formats::read(file).expect("the sample is sound")
}

/// A document with a change to its JSON.
pub(super) fn changed(doc: &Document, change: impl FnOnce(&mut Value)) -> Document {
    let mut doc = doc.clone();
    change(&mut doc.json);
    doc
}

/// Pairs triangles that lie in the same place, by trying all.
pub(super) fn paired(scenes: Sides<&Scene>) -> Pairs {
    let all = |scene: &Scene| -> Vec<TriangleRef> {
        let count = |i: u32| scene.meshes[scene.instances[i as usize].mesh.0 as usize].triangle_count() as u32;
        let of = |instance| (0..count(instance)).map(move |triangle| TriangleRef { instance, triangle });
        (0..scene.instances.len() as u32).flat_map(of).collect()
    };
    let (mut pairs, mut free) = (Pairs::none(scenes.after), all(scenes.before));
    for after in all(scenes.after) {
        let corners = scenes.after.world_corners(after);
        let turn_of = |at: TriangleRef| {
            let others = scenes.before.world_corners(at);
            (0..3).find(|turn| (0..3).all(|k| (corners[k] - others[(k + turn) % 3]).length() < 1e-3))
        };
        if let Some((i, turn)) = free.iter().enumerate().find_map(|(i, at)| Some((i, turn_of(*at)?))) {
            pairs.set(after, Pair { at: free.remove(i), turn: turn as u32 });
        }
    }
    pairs
}

/// Compares two documents; their triangles are paired by place.
pub(super) fn report(before: &Document, after: &Document) -> ContentsReport {
    let documents = Sides { before, after };
    let scenes = documents.map(|doc| load(doc, &LoadOptions::default()).expect("the document is sound").0);
    let pairs = paired(scenes.as_ref());
    let found =
        compare(Inputs { documents, scenes: scenes.as_ref(), pairs: &pairs, staged: None }, &Tolerance::default());
    found.expect("the documents are sound")
}

/// The kinds of differences of a report.
pub(super) fn kinds(report: &ContentsReport) -> Vec<DifferenceKind> {
    report.differences.iter().map(|difference| difference.kind).collect()
}

/// A square of two triangles with attributes of 32-bit floats: semantic, components and values for four vertices.
pub(super) fn square(attributes: &[(&str, usize, &[f32])]) -> Document {
    let positions: &[f32] = &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    let all: Vec<_> = [("POSITION", 3, positions)].iter().chain(attributes).copied().collect();
    let mut bytes: Vec<u8> = [0_u32, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    let mut views = vec![json!({"buffer": 0, "byteLength": bytes.len()})];
    let mut accessors = vec![json!({"bufferView": 0, "componentType": 5125, "count": 6, "type": "SCALAR"})];
    let mut named = serde_json::Map::new();
    for (name, components, values) in all {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][components - 1];
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * values.len()}));
        bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
        named.insert(name.to_owned(), accessors.len().into());
        let count = values.len() / components;
        accessors.push(json!({"bufferView": views.len() - 1, "componentType": 5126, "count": count, "type": kind}));
    }
    let primitive = json!({"attributes": named, "indices": 0, "material": 0});
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "square", "mesh": 0}], "meshes": [{"primitives": [primitive]}], "materials": [{}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bytes.len()}],
    });
    Document {
        json,
        buffers: vec![bytes.into()],
        path: "square.gltf".into(),
        kind: Kind::Gltf,
        warnings: Vec::new(),
        in_memory: None,
        residuals: Residuals::default(),
        sidecar: None,
    }
}
