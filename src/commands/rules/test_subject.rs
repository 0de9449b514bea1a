//! Runs checks on scenes of tests.

use glam::Vec3;
use raykiln_formats::Document;
use serde_json::json;

use super::{Subject, findings};
use crate::commands::measure::measure_as_is;
use crate::cost::mesh_trees::MeshTrees;
use crate::report::Finding;
use crate::scene::{LoadOptions, Scene};

/// A document that the scenes of tests are not made of: without nodes and materials.
pub(super) fn no_document() -> Document {
    raykiln_formats::read_bytes("empty.gltf", br#"{"asset": {"version": "2.0"}}"#.to_vec()).expect("valid glTF")
}

/// A document of meshes on nodes of their own, each of some triangles with one material, without other attributes.
pub(super) fn document(meshes: &[(u32, Vec<[Vec3; 3]>)]) -> Document {
    let bytes: Vec<u8> = meshes.iter().flat_map(|(_, t)| bytemuck::cast_slice::<_, u8>(t).to_vec()).collect();
    let data: String = bytes.iter().map(|byte| format!("%{byte:02X}")).collect();
    let materials = meshes.iter().map(|(material, _)| *material as usize + 1).max().unwrap_or(0);
    let (mut offset, mut views, mut accessors) = (0, Vec::new(), Vec::new());
    for (i, (_, triangles)) in meshes.iter().enumerate() {
        views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": 36 * triangles.len()}));
        offset += 36 * triangles.len();
        let ends = |pick: fn(Vec3, Vec3) -> Vec3| triangles.as_flattened().iter().copied().reduce(pick);
        let [min, max] = [ends(Vec3::min), ends(Vec3::max)].map(|end| end.expect("triangles").to_array());
        accessors.push(json!({"bufferView": i, "componentType": 5126, "count": 3 * triangles.len(), "type": "VEC3",
            "min": min, "max": max}));
    }
    let numbered = |i: usize| json!({"name": format!("mesh {i}"), "primitives": [{"attributes": {"POSITION": i}, "material": meshes[i].0}]});
    let json = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": (0..meshes.len()).collect::<Vec<_>>()}],
        "nodes": (0..meshes.len()).map(|i| json!({"mesh": i})).collect::<Vec<_>>(),
        "meshes": (0..meshes.len()).map(numbered).collect::<Vec<_>>(),
        "materials": vec![json!({}); materials], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:application/octet-stream,{data}")}]});
    raykiln_formats::read_bytes("meshes.gltf", json.to_string().into_bytes()).expect("valid glTF")
}

/// A document whose scene is the first node, and whose first accessor holds the corners of a triangle; `rest` are its
/// nodes, meshes and materials.
fn triangle_document(rest: &str) -> Document {
    let bytes: &[u8] = bytemuck::cast_slice(&[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let data: String = bytes.iter().map(|byte| format!("%{byte:02X}")).collect();
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], {rest},
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"byteLength": 36, "uri": "data:application/octet-stream,{data}"}}]}}"#
    );
    raykiln_formats::read_bytes("triangle.gltf", json.into_bytes()).expect("valid glTF")
}

/// Like [`found_in`], of a document with one triangle; `rest` are its nodes, meshes and materials.
pub(super) fn found_with_triangle(rest: &str, check: fn(&Subject) -> Vec<Finding>) -> Option<Finding> {
    let doc = triangle_document(rest);
    let (scene, _) = crate::scene::load(&doc, &LoadOptions::default()).expect("a scene");
    found_in_document(&doc, &scene, check)
}

/// The finding of one check; there must not be more than one.
pub(super) fn found_in(scene: &Scene, check: fn(&Subject) -> Vec<Finding>) -> Option<Finding> {
    found_in_document(&no_document(), scene, check)
}

/// Like [`found_in`], of the scene of a document.
pub(super) fn found_in_document(doc: &Document, scene: &Scene, check: fn(&Subject) -> Vec<Finding>) -> Option<Finding> {
    let trees = MeshTrees::build(scene);
    let mut findings = check(&Subject::new(doc, scene, &trees, measure_as_is(scene).as_bytes()));
    assert!(findings.len() < 2, "{findings:?}");
    findings.pop()
}

/// The ids of the rules that a scene breaks.
pub(super) fn found(scene: &Scene) -> Vec<&'static str> {
    let as_bytes = measure_as_is(scene).as_bytes();
    let findings = findings(&no_document(), scene, &MeshTrees::build(scene), as_bytes);
    findings.iter().map(|finding| finding.rule.id()).collect()
}
