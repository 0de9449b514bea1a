//! Faults in triangles.

use fastrand::Rng;
use raykiln::verify::FaultKind::{self, Flipped, Missing, Moved, Repeated, Unknown};
use raykiln::verify::contents::DifferenceKind as Kind;
use raykiln_formats::Document;
use serde_json::{Value, json};

use super::planting::{Fault, change_indices, in_triangles, pick, primitive_with, vertex};

/// How something is found that lies elsewhere, near or far.
const ELSEWHERE: &[FaultKind] = &[Moved, Missing, Unknown];

/// Faults in triangles.
pub(super) const FAULTS: &[Fault] = &[
    in_triangles("corner moved", ELSEWHERE, |doc, rng| {
        vertex(doc, rng, "POSITION", |x| [x[0], x[1], x[2] + 0.05, 0.0])
    }),
    in_triangles("corner moved a little", ELSEWHERE, |doc, rng| {
        vertex(doc, rng, "POSITION", |x| [x[0], x[1] + 2e-4, x[2], 0.0])
    }),
    in_triangles("triangle dropped", &[Missing], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["indices"].is_u64())?;
        let indices = doc.json["meshes"][mesh]["primitives"][primitive]["indices"].as_u64()? as usize;
        let count = doc.json["accessors"][indices]["count"].as_u64()?;
        doc.json["accessors"][indices]["count"] = (count - 3).into();
        Some(format!("meshes[{mesh}].primitives[{primitive}]"))
    }),
    in_triangles("triangle without area", &[Missing], |doc, rng| {
        triangle(doc, rng, |corners, _| corners[1] = corners[0])
    }),
    in_triangles("triangle flipped", &[Flipped], |doc, rng| triangle(doc, rng, |corners, _| corners.swap(1, 2))),
    in_triangles("triangle in place of another", &[Missing, Repeated], |doc, rng| {
        triangle(doc, rng, |corners, other| corners.copy_from_slice(&other))
    }),
    in_triangles("corner of another triangle", ELSEWHERE, |doc, rng| {
        triangle(doc, rng, |corners, other| {
            corners[0] = *other.iter().find(|corner| !corners.contains(corner)).unwrap_or(&corners[0]);
        })
    }),
    in_triangles("primitive dropped", &[Missing], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, |_| true)?;
        let primitives = doc.json["meshes"][mesh]["primitives"].as_array_mut()?;
        (primitives.len() > 1).then(|| primitives.remove(primitive))?;
        Some(format!("meshes[{mesh}].primitives[{primitive}]"))
    }),
    in_triangles("primitive repeated", &[Repeated], |doc, rng| {
        let (mesh, primitive) = primitive_with(doc, rng, |_| true)?;
        let primitives = doc.json["meshes"][mesh]["primitives"].as_array_mut()?;
        primitives.push(primitives[primitive].clone());
        Some(format!("meshes[{mesh}].primitives[{primitive}]"))
    }),
    in_triangles("object dropped", &[Missing], |doc, rng| {
        let node = placing_node(doc, rng)?;
        doc.json["nodes"][node].as_object_mut()?.remove("mesh");
        Some(format!("nodes[{node}]"))
    }),
    in_triangles("object moved", ELSEWHERE, |doc, rng| {
        let (node, axis) = (placing_node(doc, rng)?, rng.usize(..3));
        move_by(&mut doc.json["nodes"][node], axis, 0.01 + rng.f64());
        Some(format!("nodes[{node}]"))
    }),
    in_triangles("object scaled", ELSEWHERE, |doc, rng| {
        let node = placing_node(doc, rng)?;
        let scaled = &mut doc.json["nodes"][node];
        match scaled.get("matrix").is_some() {
            true => scaled["matrix"][0] = json!(1.01 * scaled["matrix"][0].as_f64()? + 0.01),
            false => scaled["scale"] = json!([1.01, 1.02, 1.0]),
        }
        Some(format!("nodes[{node}]"))
    }),
    in_triangles("object repeated", &[Repeated], |doc, rng| {
        let node = placing_node(doc, rng)?;
        copy_of(doc, node).map(|_| format!("nodes[{node}]"))
    }),
    in_triangles("object added", &[Unknown], |doc, rng| {
        let node = placing_node(doc, rng)?;
        let copy = copy_of(doc, node)?;
        move_by(&mut doc.json["nodes"][copy], rng.usize(..3), 1e3);
        Some(format!("nodes[{node}]"))
    }),
    // Objects in one shape differ in what they carry.
    Fault {
        name: "objects exchanged",
        found_as: &[Kind::SceneTriangles, Kind::MaterialFactor, Kind::MorphTarget],
        triangles: ELSEWHERE,
        plant: exchange_objects,
    },
];

/// Gives a node the mesh of another one.
fn exchange_objects(doc: &mut Document, rng: &mut Rng) -> Option<String> {
    let [node, other] = [placing_node(doc, rng)?, placing_node(doc, rng)?];
    let [mesh, of_other] = [node, other].map(|node| doc.json["nodes"][node]["mesh"].clone());
    if mesh == of_other {
        return None;
    }
    doc.json["nodes"][node]["mesh"] = of_other;
    Some(format!("nodes[{node}]"))
}

/// Changes the corners of a triangle, given those of another one.
fn triangle(doc: &mut Document, rng: &mut Rng, change: fn(&mut [u32], [u32; 3])) -> Option<String> {
    let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["indices"].is_u64())?;
    let indices = doc.json["meshes"][mesh]["primitives"][primitive]["indices"].as_u64()? as usize;
    let mut corners = doc.scalars(indices)?;
    let [at, other] = [(); 2].map(|()| 3 * rng.usize(..corners.len() / 3));
    let of_other = [corners[other], corners[other + 1], corners[other + 2]];
    let before = corners.clone();
    change(&mut corners[at..at + 3], of_other);
    if corners == before {
        return None;
    }
    change_indices(doc, indices, &corners)?;
    Some(format!("triangle {} of meshes[{mesh}].primitives[{primitive}]", at / 3))
}

/// Picks a node that places triangles and that no animation or skin moves.
fn placing_node(doc: &Document, rng: &mut Rng) -> Option<usize> {
    let has_triangles = |mesh: usize| {
        let primitives = doc.json["meshes"][mesh]["primitives"].as_array();
        primitives.is_some_and(|all| all.iter().all(|primitive| primitive["mode"].as_u64().unwrap_or(4) == 4))
    };
    let is = |node: &Value| {
        let mesh = node["mesh"].as_u64();
        mesh.is_some_and(|mesh| has_triangles(mesh as usize)) && node.get("skin").is_none()
    };
    let all = doc.json["nodes"].as_array()?.iter().enumerate();
    pick(rng, all.filter(|(_, node)| is(node)).map(|(i, _)| i))
}

/// Moves a node along an axis of its parent.
fn move_by(node: &mut Value, axis: usize, distance: f64) {
    let place = match node.get("matrix").is_some() {
        true => &mut node["matrix"][12 + axis],
        false => {
            let translation = &mut node["translation"];
            if translation.is_null() {
                *translation = json!([0, 0, 0]);
            }
            &mut translation[axis]
        }
    };
    *place = json!(place.as_f64().unwrap_or(0.0) + distance);
}

/// Adds a copy of a node, without its children, beside it; returns its index.
fn copy_of(doc: &mut Document, node: usize) -> Option<usize> {
    let nodes = doc.json["nodes"].as_array_mut()?;
    let mut copy = nodes[node].clone();
    let object = copy.as_object_mut()?;
    ["children", "name", "extras"].iter().for_each(|key| drop(object.remove(*key)));
    nodes.push(copy);
    let copy = nodes.len() - 1;
    let is_parent = |list: &Value| list.as_array().is_some_and(|list| list.contains(&json!(node)));
    for (owners, list) in [("nodes", "children"), ("scenes", "nodes")] {
        for owner in doc.json[owners].as_array_mut()?.iter_mut().filter(|owner| is_parent(&owner[list])) {
            owner[list].as_array_mut()?.push(copy.into());
        }
    }
    Some(copy)
}
