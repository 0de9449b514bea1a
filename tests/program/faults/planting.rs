//! What a fault is, and how to change documents at random.

use fastrand::Rng;
use raykiln::verify::FaultKind;
use raykiln::verify::contents::DifferenceKind as Kind;
use raykiln_formats::Document;
use serde_json::{Value, json};

/// Changes a document at random and says what it changed, or does nothing if the document has nothing of the kind.
pub(super) type Plant = fn(&mut Document, &mut Rng) -> Option<String>;

/// A kind of fault: what it is, how it must be found, and how it is planted.
pub(super) struct Fault {
    pub(super) name: &'static str,
    /// One of these differences in contents, or
    pub(super) found_as: &'static [Kind],
    /// one of these faults in triangles is found.
    pub(super) triangles: &'static [FaultKind],
    pub(super) plant: Plant,
}

/// A fault in contents.
pub(super) const fn fault(name: &'static str, found_as: &'static [Kind], plant: Plant) -> Fault {
    Fault { name, found_as, triangles: &[], plant }
}

/// A fault in the triangles of the default scene, or of another one.
pub(super) const fn in_triangles(name: &'static str, triangles: &'static [FaultKind], plant: Plant) -> Fault {
    Fault { name, found_as: &[Kind::SceneTriangles], triangles, plant }
}

pub(super) fn pick<T>(rng: &mut Rng, from: impl IntoIterator<Item = T>) -> Option<T> {
    let mut all: Vec<T> = from.into_iter().collect();
    (!all.is_empty()).then(|| all.swap_remove(rng.usize(..all.len())))
}

pub(super) fn has(list: &Value, index: usize) -> bool {
    list.as_array().is_some_and(|list| list.contains(&json!(index)))
}

pub(super) fn has_variants(primitive: &Value) -> bool {
    primitive.pointer("/extensions/KHR_materials_variants/mappings/0/material").is_some()
}

/// Picks an element of a list.
pub(super) fn element_with(doc: &Document, rng: &mut Rng, list: &str, has: impl Fn(&Value) -> bool) -> Option<usize> {
    let all = doc.json[list].as_array()?.iter().enumerate();
    pick(rng, all.filter(|(_, element)| has(element)).map(|(i, _)| i))
}

/// Picks a node with a name, as those of the input have.
pub(super) fn input_node(doc: &Document, rng: &mut Rng, is: impl Fn(&Value) -> bool) -> Option<usize> {
    let is_new = |node: &Value| node.pointer("/extras/raykiln/id").is_some();
    element_with(doc, rng, "nodes", |node| node["name"].is_string() && !is_new(node) && is(node))
}

/// Picks a primitive of triangles.
pub(super) fn primitive_with(doc: &Document, rng: &mut Rng, is: impl Fn(&Value) -> bool) -> Option<(usize, usize)> {
    primitives(doc, rng, |primitive| primitive["mode"].as_u64().unwrap_or(4) == 4 && is(primitive))
}

pub(super) fn primitive_with_mode(doc: &Document, rng: &mut Rng, is: impl Fn(u64) -> bool) -> Option<(usize, usize)> {
    primitives(doc, rng, |primitive| is(primitive["mode"].as_u64().unwrap_or(4)))
}

pub(super) fn primitives(doc: &Document, rng: &mut Rng, is: impl Fn(&Value) -> bool) -> Option<(usize, usize)> {
    let mut found = Vec::new();
    let is_placed =
        |mesh: usize| doc.json["nodes"].as_array().is_some_and(|n| n.iter().any(|n| n["mesh"] == json!(mesh)));
    for (m, mesh) in doc.json["meshes"].as_array()?.iter().enumerate().filter(|(m, _)| is_placed(*m)) {
        let all = mesh["primitives"].as_array()?.iter().enumerate();
        found.extend(all.filter(|(_, primitive)| is(primitive)).map(|(p, _)| (m, p)));
    }
    pick(rng, found)
}

/// Picks a material that triangles show.
pub(super) fn shown_material(doc: &Document, rng: &mut Rng, is: impl Fn(&Value) -> bool) -> Option<usize> {
    let shown =
        |primitive: &Value| primitive["material"].as_u64().is_some_and(|m| is(&doc.json["materials"][m as usize]));
    let (mesh, primitive) = primitive_with(doc, rng, shown)?;
    Some(doc.json["meshes"][mesh]["primitives"][primitive]["material"].as_u64()? as usize)
}

/// Changes the first of some numbers that a material has.
pub(super) fn number_in_material(doc: &mut Document, rng: &mut Rng, path: &str, others: &[&str]) -> Option<String> {
    let path = pick(rng, [path].iter().chain(others).copied())?;
    let material = shown_material(doc, rng, |material| material.pointer(path).is_some())?;
    let number = doc.json["materials"][material].pointer_mut(path)?;
    let changed = number.as_f64()? + 0.05 + 0.1 * rng.f64();
    *number = changed.into();
    Some(format!("materials[{material}]{path}"))
}

/// Picks a texture of a material that triangles show, by the pointer to it.
pub(super) fn texture(doc: &Document, rng: &mut Rng) -> Option<(usize, &'static str)> {
    const PLACES: [&str; 3] = ["/pbrMetallicRoughness/baseColorTexture", "/normalTexture", "/occlusionTexture"];
    let place = pick(rng, PLACES)?;
    let material = shown_material(doc, rng, |material| material.pointer(place).is_some())?;
    Some((material, place))
}

/// Changes an attribute of a vertex that a triangle has.
pub(super) fn vertex(
    doc: &mut Document,
    rng: &mut Rng,
    name: &str,
    change: fn([f64; 4]) -> [f64; 4],
) -> Option<String> {
    let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["attributes"][name].is_u64())?;
    let accessor = doc.json["meshes"][mesh]["primitives"][primitive]["attributes"][name].as_u64()? as usize;
    change_vertex(doc, rng, [mesh, primitive, accessor], change)?;
    Some(format!("meshes[{mesh}].primitives[{primitive}]"))
}

pub(super) fn morph(doc: &mut Document, rng: &mut Rng, name: &str) -> Option<String> {
    let (mesh, primitive) = primitive_with(doc, rng, |primitive| primitive["targets"][0][name].is_u64())?;
    let accessor = doc.json["meshes"][mesh]["primitives"][primitive]["targets"][0][name].as_u64()? as usize;
    change_vertex(doc, rng, [mesh, primitive, accessor], |x| [x[0] + 0.05, x[1], x[2], x[3]])?;
    Some(format!("meshes[{mesh}].primitives[{primitive}]"))
}

/// Changes the element of an accessor that a random corner of a primitive refers to; the accessor becomes the
/// primitive's own only in so far as it already was.
pub(super) fn change_vertex(
    doc: &mut Document,
    rng: &mut Rng,
    at: [usize; 3],
    change: fn([f64; 4]) -> [f64; 4],
) -> Option<()> {
    let [mesh, primitive, accessor] = at;
    let indices = doc.json["meshes"][mesh]["primitives"][primitive]["indices"].as_u64()? as usize;
    let corners = doc.scalars(indices)?;
    let vertex = corners[rng.usize(..corners.len())] as usize;
    let (buffer, offset, stride) = place(doc, accessor)?;
    let components = match doc.json["accessors"][accessor]["type"].as_str()? {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        _ => 4,
    };
    let is_byte = doc.json["accessors"][accessor]["componentType"] == 5121;
    let mut bytes = doc.buffers[buffer].to_vec();
    let start = offset + vertex * stride;
    let mut values = [0.0, 0.0, 0.0, 1.0];
    for (i, value) in values.iter_mut().enumerate().take(components) {
        *value = if is_byte { bytes[start + i].into() } else { float(&bytes, start + 4 * i).into() };
    }
    for (i, value) in change(values).iter().enumerate().take(components) {
        match is_byte {
            true => bytes[start + i] = *value as u8,
            false => bytes[start + 4 * i..][..4].copy_from_slice(&(*value as f32).to_le_bytes()),
        }
    }
    doc.buffers[buffer] = bytes.into();
    Some(())
}

pub(super) fn float(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Returns the buffer of an accessor, the byte of its first element, and the bytes from one element to the next.
pub(super) fn place(doc: &Document, accessor: usize) -> Option<(usize, usize, usize)> {
    let accessor = &doc.json["accessors"][accessor];
    let view = &doc.json["bufferViews"][accessor["bufferView"].as_u64()? as usize];
    let number = |value: &Value| value.as_u64().unwrap_or(0) as usize;
    let size = if accessor["componentType"] == 5121 { 1 } else { 4 };
    let components = match accessor["type"].as_str()? {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "MAT4" => 16,
        _ => 4,
    };
    let stride = view["byteStride"].as_u64().map_or(size * components, |stride| stride as usize);
    Some((number(&view["buffer"]), number(&view["byteOffset"]) + number(&accessor["byteOffset"]), stride))
}

/// Changes a number of a tightly packed accessor.
pub(super) fn change_float(
    doc: &mut Document,
    accessor: usize,
    index: usize,
    change: fn(f32) -> f32,
) -> Option<String> {
    let (buffer, offset, _) = place(doc, accessor)?;
    let mut bytes = doc.buffers[buffer].to_vec();
    let at = offset + 4 * index;
    let changed = change(float(&bytes, at));
    bytes[at..at + 4].copy_from_slice(&changed.to_le_bytes());
    doc.buffers[buffer] = bytes.into();
    Some(format!("number {index} of accessors[{accessor}]"))
}

pub(super) fn drop_attribute(doc: &mut Document, rng: &mut Rng, name: &str) -> Option<String> {
    let is_textured = |material: u64| {
        let material = &doc.json["materials"][material as usize];
        material.pointer("/pbrMetallicRoughness/baseColorTexture").is_some()
    };
    let samples = |primitive: &Value| name != "TEXCOORD_0" || primitive["material"].as_u64().is_some_and(is_textured);
    let (mesh, primitive) = primitive_with(doc, rng, |p| p["attributes"][name].is_u64() && samples(p))?;
    doc.json["meshes"][mesh]["primitives"][primitive]["attributes"].as_object_mut()?.remove(name);
    Some(format!("meshes[{mesh}].primitives[{primitive}]"))
}

/// Changes a number of the keys of an animation.
pub(super) fn key(doc: &mut Document, rng: &mut Rng, property: &str) -> Option<String> {
    let count = doc.json.pointer("/animations/0/samplers")?.as_array()?.len();
    let sampler = &doc.json["animations"][0]["samplers"][rng.usize(..count)];
    let accessor = sampler[property].as_u64()? as usize;
    let components = if property == "input" { 1 } else { 3 };
    let keys = doc.json["accessors"][accessor]["count"].as_u64()? as usize;
    change_float(doc, accessor, rng.usize(..keys * components), |x| x + 0.05)
}

/// Appends bytes in a buffer of their own; returns the buffer view.
pub(super) fn push_view(doc: &mut Document, bytes: &[u8]) -> usize {
    doc.buffers.push(bytes.to_vec().into());
    let buffers = doc.json["buffers"].as_array_mut().expect("an array");
    buffers.push(json!({"byteLength": bytes.len()}));
    let buffer = buffers.len() - 1;
    let views = doc.json["bufferViews"].as_array_mut().expect("an array");
    views.push(json!({"buffer": buffer, "byteLength": bytes.len()}));
    views.len() - 1
}

/// Replaces the numbers of a tightly packed accessor of indices.
pub(super) fn change_indices(doc: &mut Document, accessor: usize, numbers: &[u32]) -> Option<()> {
    let (buffer, offset, _) = place(doc, accessor)?;
    let size = match doc.json["accessors"][accessor]["componentType"].as_u64()? {
        5121 => 1,
        5123 => 2,
        _ => 4,
    };
    let mut bytes = doc.buffers[buffer].to_vec();
    for (i, number) in numbers.iter().enumerate() {
        bytes[offset + size * i..][..size].copy_from_slice(&number.to_le_bytes()[..size]);
    }
    doc.buffers[buffer] = bytes.into();
    Some(())
}
