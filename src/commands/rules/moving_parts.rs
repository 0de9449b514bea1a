//! RK004: independently moving parts belong in their own BLAS (NVIDIA, "Best Practices for Using NVIDIA RTX Ray Tracing",
//! updated 2022).
//!
//! A skinned mesh is rebuilt or refitted in each frame. If nearly each of its triangles follows a single joint, its parts
//! only move as a whole, and each could be a mesh on a node of its own.

use std::collections::BTreeSet;

use raykiln_formats::document::Attribute;

use super::{Subject, mesh_name};
use crate::cost::bytes;
use crate::report::{Broken, Finding, Objects};
use crate::scene::{Geometry, Mesh, Pinned};

/// Share of the triangles that must each follow a single joint.
const RIGID: f64 = 0.9;

/// A corner follows a joint alone if this is at least the joint's share of its weights.
const ALONE: f64 = 0.999;

/// Finds skinned meshes whose parts move as a whole.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let instances = subject.scene.instances.iter().filter(|i| i.pinned == Some(Pinned::Skinned));
    let skinned: BTreeSet<u32> = instances.map(|i| i.mesh.0).collect();
    let (mut objects, mut triangles, mut joints, mut size) = (Objects::default(), 0, 0, 0);
    for mesh in skinned.into_iter().map(|i| &subject.scene.meshes[i as usize]) {
        let followed: Vec<u32> = mesh.geometries.iter().flat_map(|g| joints_of(subject, mesh, g)).collect();
        let of_mesh = followed.iter().collect::<BTreeSet<_>>().len();
        if of_mesh > 1 && followed.len() as f64 >= RIGID * mesh.triangle_count() as f64 {
            objects.add(|| mesh_name(mesh));
            triangles += followed.len() as u64;
            joints += of_mesh;
            size += bytes::blas(mesh.triangle_count() as u64);
        }
    }
    let broken = Broken::MovingParts { triangles, joints, bytes: size };
    if objects.is_empty() { Vec::new() } else { vec![Finding::new(objects, &broken)] }
}

/// The joint of each triangle that follows a single one.
fn joints_of(subject: &Subject, mesh: &Mesh, geometry: &Geometry) -> Vec<u32> {
    let attributes = subject.doc.attributes(mesh.source as usize, geometry.primitive as usize);
    let named = |name: &str| attributes.iter().find(|attribute| attribute.name == name);
    let (Some(joints), Some(weights), None) = (named("JOINTS_0"), named("WEIGHTS_0"), named("JOINTS_1")) else {
        return Vec::new();
    };
    let of_triangle = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| joint_of(joints, weights, corner));
        a.filter(|_| a == b && b == c)
    };
    geometry.triangles.iter().filter_map(of_triangle).collect()
}

/// The joint that a vertex follows alone.
fn joint_of(joints: &Attribute, weights: &Attribute, vertex: u32) -> Option<u32> {
    let (joints, weights) = (joints.numbers(vertex), weights.numbers(vertex));
    let total: f64 = weights.iter().sum();
    let alone = (0..4).find(|&i| weights[i] >= ALONE * total && total > 0.0)?;
    Some(joints[alone] as u32)
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in_document;
    use super::*;
    use crate::scene::LoadOptions;
    use raykiln_formats::Document;

    /// Two triangles with a skin of two joints; `weight` is that of the first joint at the first triangle.
    fn skinned(weight: f32) -> Document {
        let positions =
            [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]];
        let first = [weight, 1.0 - weight, 0.0, 0.0];
        let weights = [first, first, first, [0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
        let joints = [[0u8, 1, 0, 0]; 6];
        let parts: [&[u8]; 3] =
            [bytemuck::cast_slice(&positions), bytemuck::cast_slice(&weights), bytemuck::cast_slice(&joints)];
        let bytes = parts.concat();
        let data: String = bytes.iter().map(|byte| format!("%{byte:02X}")).collect();
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1, 2]}}],
            "nodes": [{{"mesh": 0, "skin": 0}}, {{}}, {{}}], "skins": [{{"joints": [1, 2]}}],
            "meshes": [{{"name": "robot", "primitives": [{{"attributes": {{"POSITION": 0, "WEIGHTS_0": 1, "JOINTS_0": 2}}}}]}}],
            "accessors": [
                {{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3", "min": [0, 0, 0], "max": [6, 1, 0]}},
                {{"bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC4"}},
                {{"bufferView": 2, "componentType": 5121, "count": 6, "type": "VEC4"}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 72}}, {{"buffer": 0, "byteOffset": 72, "byteLength": 96}},
                {{"buffer": 0, "byteOffset": 168, "byteLength": 24}}],
            "buffers": [{{"byteLength": 192, "uri": "data:application/octet-stream,{data}"}}]}}"#
        );
        raykiln_formats::read_bytes("skinned.gltf", json.into_bytes()).expect("valid glTF")
    }

    fn found(weight: f32) -> Option<Finding> {
        let doc = skinned(weight);
        let (scene, _) = crate::scene::load(&doc, &LoadOptions::default()).expect("a scene");
        found_in_document(&doc, &scene, check)
    }

    #[test]
    fn parts_that_follow_one_joint_each_should_be_meshes() {
        let finding = found(1.0).expect("a finding");
        assert_eq!((finding.rule.id(), finding.object.as_str()), ("RK004", "robot"));
        assert!(finding.message.starts_with("2 triangles of 1 skinned mesh each follow only one of 2 joints"));
    }

    #[test]
    fn skin_that_bends_is_left_alone() {
        assert_eq!(found(0.5), None);
    }
}
