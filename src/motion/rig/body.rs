//! An instance whose mesh deforms: by morph targets first, then by its skin.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use raykiln_formats::Document;
use raykiln_formats::document::Attribute;
use raykiln_formats::properties::Skin;
use rayon::prelude::*;

use super::Pose;
use crate::parallel::CHEAP_ELEMENTS;
use crate::scene::{Geometry, InstanceId, Mesh, Scene};

/// An instance that deforms.
#[derive(Clone, Debug)]
pub(super) struct Body {
    /// Index into the document's scene.
    pub(super) instance: u32,
    /// The node that places it.
    node: usize,
    skin: Option<usize>,
    /// Weights of the morph targets at rest.
    weights: Vec<f64>,
    /// By geometry of the mesh.
    parts: Vec<Part>,
}

/// The vertices of a geometry.
#[derive(Clone, Debug)]
struct Part {
    /// Positions at rest.
    positions: Arc<[Vec3]>,
    /// For each morph target, how far it moves each vertex; empty if it moves none.
    targets: Vec<Vec<DVec3>>,
    /// For each set of four, the joint and the weight of each vertex.
    influences: Vec<Vec<[(u32, f64); 4]>>,
}

impl Body {
    /// Reads what deforms an instance.
    pub(super) fn read(doc: &Document, scene: &Scene, instance: u32, skin: Option<usize>) -> Body {
        let mesh = scene.mesh_of(InstanceId(instance));
        let node = scene.instances[instance as usize].node as usize;
        Body {
            instance,
            node,
            skin,
            weights: doc.node_content(node).weights.unwrap_or_default(),
            parts: mesh.geometries.iter().map(|geometry| Part::read(doc, mesh, geometry, skin.is_some())).collect(),
        }
    }

    /// Whether its vertices are in world coordinates once it is deformed: a skin ignores the node that places it.
    pub(super) fn is_in_world(&self) -> bool {
        self.skin.is_some()
    }

    /// Deforms the mesh, which must be the one that was read.
    pub(super) fn deform(&self, pose: &Pose, skins: &[Skin], mesh: &mut Mesh) {
        let weights = pose.weights[self.node].as_ref().unwrap_or(&self.weights);
        let joints = self.skin.and_then(|skin| skins.get(skin)).map(|skin| joints(skin, pose));
        for (geometry, part) in mesh.geometries.iter_mut().zip(&self.parts) {
            let position = |vertex: usize| {
                let moved = part.position(vertex, weights, joints.as_deref()).as_vec3();
                // What a malformed animation moves to nowhere stays.
                if moved.is_finite() { moved } else { part.positions[vertex] }
            };
            let all: Vec<Vec3> =
                (0..part.positions.len()).into_par_iter().with_min_len(CHEAP_ELEMENTS).map(position).collect();
            geometry.positions = all.into();
            geometry.residuals = None;
        }
        mesh.extent = Default::default();
        mesh.residual = Default::default();
    }
}

/// Returns what moves a vertex from the mesh at rest into the world, by joint.
fn joints(skin: &Skin, pose: &Pose) -> Vec<DAffine3> {
    let inverse = |joint: usize| match skin.inverse_bind_matrices.get(16 * joint..16 * (joint + 1)) {
        Some(m) => DAffine3 {
            matrix3: DMat3::from_cols_array(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]),
            translation: DVec3::new(m[12], m[13], m[14]),
        },
        None => DAffine3::IDENTITY,
    };
    let joint = |(i, node): (usize, &usize)| pose.worlds.get(*node).map_or(DAffine3::IDENTITY, |w| *w * inverse(i));
    skin.joints.iter().enumerate().map(joint).collect()
}

impl Part {
    fn read(doc: &Document, mesh: &Mesh, geometry: &Geometry, is_skinned: bool) -> Part {
        let (source, primitive) = (mesh.source as usize, geometry.primitive as usize);
        let count = geometry.positions.len() as u32;
        let delta = |target: Vec<Attribute<'_>>| match target.iter().find(|a| a.name == "POSITION") {
            Some(moved) if moved.count >= count as usize => (0..count).map(|v| vector(moved, v)).collect(),
            _ => Vec::new(),
        };
        Part {
            positions: geometry.positions.clone(),
            targets: doc.morph_targets(source, primitive).into_iter().map(delta).collect(),
            influences: if is_skinned { influences(doc, source, primitive, count) } else { Vec::new() },
        }
    }

    /// Returns the position of a vertex.
    fn position(&self, vertex: usize, weights: &[f64], joints: Option<&[DAffine3]>) -> DVec3 {
        let mut position = self.positions[vertex].as_dvec3();
        for (target, weight) in self.targets.iter().zip(weights) {
            position += target.get(vertex).map_or(DVec3::ZERO, |delta| *weight * *delta);
        }
        let Some(joints) = joints else { return position };
        let (mut moved, mut total) = (DVec3::ZERO, 0.0);
        for (joint, weight) in self.influences.iter().flat_map(|set| set[vertex]).filter(|(_, weight)| *weight > 0.0) {
            if let Some(joint) = joints.get(joint as usize) {
                moved += weight * joint.transform_point3(position);
                total += weight;
            }
        }
        // Weights that were quantised do not add up to one.
        if total > 0.0 { moved / total } else { position }
    }
}

fn influences(doc: &Document, mesh: usize, primitive: usize, count: u32) -> Vec<Vec<[(u32, f64); 4]>> {
    let attributes = doc.attributes(mesh, primitive);
    let named = |name: String| attributes.iter().find(|a| a.name == name && a.count >= count as usize);
    let set = |n: usize| Some((named(format!("JOINTS_{n}"))?, named(format!("WEIGHTS_{n}"))?));
    let of_set = |(joints, weights): (&Attribute<'_>, &Attribute<'_>)| {
        let of_vertex = |vertex| {
            let (joints, weights) = (joints.numbers(vertex), weights.numbers(vertex));
            std::array::from_fn(|i| (joints[i] as u32, weights[i]))
        };
        (0..count).map(of_vertex).collect()
    };
    (0..).map_while(set).map(of_set).collect()
}

fn vector(attribute: &Attribute<'_>, vertex: u32) -> DVec3 {
    let [x, y, z, _] = attribute.numbers(vertex);
    DVec3::new(x, y, z)
}
