//! Meshes and their primitives.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use super::NewAccessor;
use crate::Document;
use crate::gltf::accessor::Accessor;
use crate::gltf::edit::{push, remove_key};
use crate::gltf::json::unsigned;
use crate::gltf::references::table::compresses;

/// A primitive of triangles to be written, see [`Document::add_mesh`].
#[derive(Clone, Debug)]
pub struct NewPrimitive {
    /// Vertex attributes by their semantic, such as `NORMAL` or `TEXCOORD_0`, in the order in which they are written.
    pub attributes: Vec<(String, NewAccessor)>,
    /// Three vertices per triangle.
    pub indices: NewAccessor,
    /// Material of the document.
    pub material: Option<u32>,
    /// Mesh and primitive of the document whose further properties (extras, extensions) this primitive inherits.
    pub like: (usize, usize),
}

impl Document {
    /// Adds a mesh; an empty name is left out. Returns its index.
    pub fn add_mesh(&mut self, name: &str, primitives: Vec<NewPrimitive>) -> usize {
        let primitives: Vec<Value> = primitives.into_iter().map(|new| primitive(self, new)).collect();
        let mut mesh = Map::new();
        if !name.is_empty() {
            mesh.insert("name".into(), name.into());
        }
        mesh.insert("primitives".into(), primitives.into());
        push(&mut self.json, "meshes", mesh.into())
    }

    /// Adds a mesh of the points and lines of another, which keeps them; returns its index, `None` if there are none.
    pub fn add_points_and_lines_of(&mut self, mesh: usize) -> Option<usize> {
        let mut rest = self.json["meshes"][mesh].clone();
        let is_surface = |p: &Value| matches!(p["mode"].as_u64(), None | Some(4..=6));
        let primitives = rest["primitives"].as_array_mut()?;
        primitives.retain(|p| !is_surface(p));
        (!primitives.is_empty()).then(|| push(&mut self.json, "meshes", rest))
    }

    /// The name of a mesh; empty if it has none.
    pub fn mesh_name(&self, mesh: usize) -> &str {
        self.json["meshes"][mesh]["name"].as_str().unwrap_or_default()
    }

    /// What a mesh says besides its name and primitives, such as extras and weights: keys and JSON texts, in file order.
    pub fn mesh_properties(&self, mesh: usize) -> impl Iterator<Item = (&str, String)> {
        let all = self.json["meshes"][mesh].as_object().into_iter().flatten();
        let others = all.filter(|(key, _)| *key != "name" && *key != "primitives");
        others.map(|(key, value)| (key.as_str(), value.to_string()))
    }

    /// The number of primitives of a mesh, points and lines included.
    pub fn primitive_count(&self, mesh: usize) -> usize {
        primitives(&self.json["meshes"][mesh]).len()
    }

    /// Whether a primitive of a mesh has morph targets.
    pub fn is_morphed(&self, mesh: usize) -> bool {
        let has_targets = |p: &Value| p["targets"].as_array().is_some_and(|targets| !targets.is_empty());
        primitives(&self.json["meshes"][mesh]).iter().any(has_targets)
    }

    /// Bytes of the vertex attributes and indices, tightly packed, that these meshes use and no other mesh does.
    pub fn bytes_used_only_by(&self, meshes: &BTreeSet<usize>) -> u64 {
        let (mut theirs, mut others) = (BTreeSet::new(), BTreeSet::new());
        for (number, mesh) in self.json["meshes"].as_array().into_iter().flatten().enumerate() {
            let used = if meshes.contains(&number) { &mut theirs } else { &mut others };
            used.extend(primitives(mesh).iter().flat_map(vertex_accessors));
        }
        let bytes = |&accessor: &usize| Accessor::read(self, accessor).map_or(0, |a| a.tight_bytes() as u64);
        theirs.difference(&others).map(bytes).sum()
    }
}

fn primitives(mesh: &Value) -> &[Value] {
    mesh["primitives"].as_array().map_or(&[], Vec::as_slice)
}

/// The accessors of the vertex attributes and indices of a primitive.
fn vertex_accessors(primitive: &Value) -> impl Iterator<Item = usize> {
    let attributes = primitive["attributes"].as_object().into_iter().flat_map(|all| all.values());
    attributes.chain(primitive.get("indices")).filter_map(unsigned)
}

/// The JSON of a new primitive; adds its accessors.
fn primitive(document: &mut Document, new: NewPrimitive) -> Value {
    let inherited = inherited(&document.json["meshes"][new.like.0]["primitives"][new.like.1]);
    let mut primitive = Map::new();
    let attributes: Map<String, Value> =
        new.attributes.into_iter().map(|(name, data)| (name, document.add_accessor(data).into())).collect();
    primitive.insert("attributes".into(), attributes.into());
    primitive.insert("indices".into(), document.add_accessor(new.indices).into());
    if let Some(material) = new.material {
        primitive.insert("material".into(), material.into());
    }
    primitive.extend(inherited);
    primitive.into()
}

/// What a rewritten primitive takes over from the primitives it is made of, which agree in it.
fn inherited(primitive: &Value) -> Map<String, Value> {
    let mut properties = primitive.as_object().cloned().unwrap_or_default();
    for own in ["attributes", "indices", "material", "mode", "targets"] {
        properties.shift_remove(own);
    }
    remove_key(&mut properties, "extras", "raykiln");
    let compressed: Vec<String> = names(&properties).filter(|name| compresses(name)).cloned().collect();
    for name in compressed {
        remove_key(&mut properties, "extensions", &name);
    }
    properties
}

/// The names of an object's extensions.
fn names(object: &Map<String, Value>) -> impl Iterator<Item = &String> {
    object.get("extensions").and_then(Value::as_object).into_iter().flat_map(|all| all.keys())
}
