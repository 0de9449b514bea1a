//! Assembles the glTF document of a scanned OBJ file.

use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::material::Materials;
use super::mesh::{self, Made, Primitive};
use super::notes::Notes;
use super::scan::{Kind, Part, Scan};
use super::shift;
use super::streams::{Sizes, Stream, Streams};
use super::texture::Textures;
use crate::document::Residuals;
use crate::extension_names::KHR_TEXTURE_TRANSFORM;

/// A glTF document made from an OBJ file.
pub(super) struct Assembled {
    /// The root object.
    pub(super) json: Value,
    /// Its buffer.
    pub(super) buffer: Vec<u8>,
    /// What rounding took from its positions.
    pub(super) residuals: Residuals,
}

/// Axes and unit of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Whether z points up instead of y.
    pub(super) z_up: bool,
    /// In metres.
    pub(super) unit: f64,
}

impl Frame {
    /// The matrix from coordinates of the file to those of glTF, by columns; `None` if they are the same.
    fn matrix(self) -> Option<Value> {
        let Frame { z_up, unit } = self;
        let matrix = match z_up {
            // x stays, z becomes y, y becomes -z.
            true => [[unit, 0.0, 0.0, 0.0], [0.0, 0.0, -unit, 0.0], [0.0, unit, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
            false => [[unit, 0.0, 0.0, 0.0], [0.0, unit, 0.0, 0.0], [0.0, 0.0, unit, 0.0], [0.0, 0.0, 0.0, 1.0]],
        };
        (z_up || unit != 1.0).then(|| matrix.concat().into())
    }
}

/// Assembles the document; `models` are the meshes of the scan's parts.
pub(super) fn assemble(
    scan: &Scan,
    models: Vec<tobj::Mesh>,
    frame: Frame,
    mut materials: Materials,
    notes: &mut Notes,
) -> Assembled {
    let shifts = shift::shifts(&models);
    let convert = |((model, part), &shift): ((tobj::Mesh, &Part), &DVec3)| match part.kind {
        Kind::Faces => mesh::primitives(&model, shift, scan.full_color),
        kind => mesh::strokes(kind, &model, shift, scan.full_color),
    };
    let mut made: Vec<Made> = models.into_par_iter().zip(&scan.parts).zip(&shifts).map(convert).collect();
    let materials_of = assign(scan, &mut made, &mut materials, notes);
    let mut residuals = Residuals::default();
    let mut streams = Streams::new(&sizes(&made));
    let mut meshes: Vec<Value> = Vec::with_capacity(made.len());
    for (made, materials) in made.into_iter().zip(materials_of) {
        let mut primitives = Vec::with_capacity(made.primitives.len());
        for (made, material) in made.primitives.into_iter().zip(materials) {
            let (json, positions) = primitive(&made, material, &mut streams);
            primitives.push(json);
            residuals.insert(positions, made.residuals);
        }
        meshes.push(json!({"primitives": primitives}));
    }
    let mut tree = Tree { scan, shifts: &shifts, nodes: Vec::new(), meshes: &mut meshes };
    let mut roots = tree.roots();
    let mut nodes = tree.nodes;
    if let Some(matrix) = frame.matrix().filter(|_| !roots.is_empty()) {
        nodes.push(json!({"name": "axes and unit", "matrix": matrix, "children": roots}));
        roots = vec![nodes.len() - 1];
    }
    let (accessors, mut views, mut buffer) = streams.finish();
    materials.note_lacks(notes);
    embed(&mut materials.textures, &mut views, &mut buffer);

    let mut root = Map::new();
    root.insert("asset".to_owned(), json!({"version": "2.0", "generator": "raykiln"}));
    insert(&mut root, "extensionsUsed", extensions(&materials));
    root.insert("scene".to_owned(), 0.into());
    root.insert("scenes".to_owned(), json!([if roots.is_empty() { json!({}) } else { json!({"nodes": roots}) }]));
    insert(&mut root, "nodes", nodes);
    insert(&mut root, "meshes", meshes);
    insert(&mut root, "materials", materials.list);
    insert(&mut root, "textures", materials.textures.textures.values);
    insert(&mut root, "samplers", materials.textures.samplers.values);
    insert(&mut root, "images", materials.textures.images.values);
    insert(&mut root, "accessors", accessors);
    insert(&mut root, "bufferViews", views);
    if !buffer.is_empty() {
        root.insert("buffers".to_owned(), json!([{"byteLength": buffer.len()}]));
    }
    Assembled { json: root.into(), buffer, residuals }
}

/// Appends the images that are no files to the buffer.
fn embed(textures: &mut Textures, views: &mut Vec<Value>, buffer: &mut Vec<u8>) {
    for image in &mut textures.images.values {
        let Some(index) = image["bufferView"].as_u64() else { continue };
        let bytes = std::mem::take(&mut textures.embedded[index as usize]);
        buffer.resize(buffer.len().next_multiple_of(4), 0);
        image["bufferView"] = views.len().into();
        views.push(json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": bytes.len()}));
        buffer.extend(bytes);
    }
}

/// Returns the material of each primitive of each part. Removes vertex colours where a texture gives the colour, which
/// glTF would multiply.
fn assign(scan: &Scan, made: &mut [Made], materials: &mut Materials, notes: &mut Notes) -> Vec<Vec<Option<usize>>> {
    let mut out = Vec::with_capacity(made.len());
    for (part, made) in scan.parts.iter().zip(made) {
        made.note(notes);
        let name = part.material.map(|material| scan.materials.get(material));
        let mut indices = Vec::with_capacity(made.primitives.len());
        for primitive in &mut made.primitives {
            let material = name.and_then(|name| materials.index(name, !primitive.texcoords.is_empty(), notes));
            let material = if part.kind == Kind::Faces { material.or_else(|| materials.bare()) } else { material };
            if !primitive.colors.is_empty() && material.is_some_and(|material| materials.has_color_texture(material)) {
                primitive.colors = Vec::new();
                notes.add(String::new, "vertex colours under a texture left out: glTF would multiply both");
            }
            indices.push(material);
        }
        out.push(indices);
    }
    out
}

fn extensions(materials: &Materials) -> Vec<Value> {
    let transform = materials.textures.transformed.then_some(KHR_TEXTURE_TRANSFORM);
    materials.extensions.iter().copied().chain(transform).map(Value::from).collect()
}

/// Inserts an array unless it is empty, because glTF forbids empty arrays.
fn insert(root: &mut Map<String, Value>, key: &str, values: Vec<Value>) {
    if !values.is_empty() {
        root.insert(key.to_owned(), values.into());
    }
}

/// Returns the sizes of the streams.
fn sizes(made: &[Made]) -> Sizes {
    let mut sizes = Sizes::default();
    for primitive in made.iter().flat_map(|made| &made.primitives) {
        sizes.add(Stream::Positions, primitive.positions.len());
        sizes.add(Stream::Normals, primitive.normals.len());
        sizes.add(Stream::Texcoords, primitive.texcoords.len());
        sizes.add(Stream::Colors, primitive.colors.len());
        sizes.add(index_stream(primitive), primitive.indices.len());
    }
    sizes
}

fn index_stream(primitive: &Primitive) -> Stream {
    if primitive.positions.len() <= usize::from(u16::MAX) { Stream::ShortIndices } else { Stream::Indices }
}

/// Returns a glTF primitive and the accessor of its positions.
fn primitive(primitive: &Primitive, material: Option<usize>, streams: &mut Streams) -> (Value, usize) {
    let mut attributes = Map::new();
    let positions = streams.push_positions(&primitive.positions);
    attributes.insert("POSITION".to_owned(), positions.into());
    let mut optional = |key: &str, stream: Stream, bytes: &[u8]| {
        if !bytes.is_empty() {
            attributes.insert(key.to_owned(), streams.push(stream, bytes).into());
        }
    };
    optional("NORMAL", Stream::Normals, bytemuck::cast_slice(&primitive.normals));
    optional("TEXCOORD_0", Stream::Texcoords, bytemuck::cast_slice(&primitive.texcoords));
    optional("COLOR_0", Stream::Colors, bytemuck::cast_slice(&primitive.colors));
    let indices = match index_stream(primitive) {
        Stream::ShortIndices => {
            let short: Vec<u16> = primitive.indices.iter().map(|&i| i as u16).collect();
            streams.push(Stream::ShortIndices, &short)
        }
        stream => streams.push(stream, &primitive.indices),
    };
    let mut out = json!({"attributes": attributes, "indices": indices});
    if let Some(material) = material {
        out["material"] = material.into();
    }
    match primitive.kind {
        Kind::Faces => {}
        Kind::Lines => out["mode"] = 1.into(),
        Kind::Points => out["mode"] = 0.into(),
    }
    (out, positions)
}

/// Nodes under construction. A part is a node with a mesh. A group of one part is that node, named after the group; a
/// group of several is a parent node of them, and they are named `group/material`. An object is a parent node of its
/// groups, unless it has a single group without its own name.
struct Tree<'a> {
    scan: &'a Scan,
    /// The translation of each part.
    shifts: &'a [DVec3],
    nodes: Vec<Value>,
    meshes: &'a mut [Value],
}

impl Tree<'_> {
    fn roots(&mut self) -> Vec<usize> {
        let parts: Vec<usize> = (0..self.scan.parts.len()).collect();
        let mut roots = Vec::new();
        for (object, parts) in grouped(parts, |&part| self.scan.parts[part].object) {
            let groups = grouped(parts, |&part| self.scan.parts[part].group);
            let name = object.map(|object| self.scan.objects[object].clone());
            match name {
                Some(name) if !self.is_one_group(&name, &groups) => roots.push(self.object(name, groups)),
                name => {
                    roots.extend(groups.into_iter().map(|(group, parts)| self.group(name.as_deref(), group, parts)))
                }
            }
        }
        roots
    }

    fn is_one_group(&self, object: &str, groups: &[(Option<usize>, Vec<usize>)]) -> bool {
        match groups {
            [(group, _)] => group.is_none_or(|group| self.scan.groups.get(group) == object),
            _ => false,
        }
    }

    fn object(&mut self, name: String, groups: Vec<(Option<usize>, Vec<usize>)>) -> usize {
        let node = self.push(json!({"name": name}));
        let children: Vec<usize> =
            groups.into_iter().map(|(group, parts)| self.group(Some(&name), group, parts)).collect();
        self.nodes[node]["children"] = children.into();
        node
    }

    /// Adds a group. A group without a name uses its object's name, or else OBJ's default name.
    fn group(&mut self, object: Option<&str>, group: Option<usize>, parts: Vec<usize>) -> usize {
        let name = group.map(|group| self.scan.groups.get(group)).or(object).unwrap_or("default").to_owned();
        if let [part] = parts[..] {
            return self.part(name, part);
        }
        let node = self.push(json!({"name": name}));
        let child = |part: usize| {
            let material = self.scan.parts[part].material.map(|material| self.scan.materials.get(material));
            format!("{name}/{}", material.filter(|name| !name.is_empty()).unwrap_or("(none)"))
        };
        let names: Vec<(String, usize)> = parts.into_iter().map(|part| (child(part), part)).collect();
        let children: Vec<usize> = names.into_iter().map(|(name, part)| self.part(name, part)).collect();
        self.nodes[node]["children"] = children.into();
        node
    }

    fn part(&mut self, name: String, part: usize) -> usize {
        self.meshes[part]["name"] = name.clone().into();
        let mut node = json!({"name": name, "mesh": part});
        if self.shifts[part] != DVec3::ZERO {
            node["translation"] = self.shifts[part].to_array().to_vec().into();
        }
        self.push(node)
    }

    fn push(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }
}

/// Groups items by key, with keys and items in order of first appearance.
fn grouped<K: Copy + Eq + std::hash::Hash>(items: Vec<usize>, key: impl Fn(&usize) -> K) -> Vec<(K, Vec<usize>)> {
    let mut out: Vec<(K, Vec<usize>)> = Vec::new();
    let mut index = std::collections::HashMap::new();
    for item in items {
        let key = key(&item);
        let at = *index.entry(key).or_insert(out.len());
        if at == out.len() {
            out.push((key, Vec::new()));
        }
        out[at].1.push(item);
    }
    out
}
