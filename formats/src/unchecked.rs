//! Writes glTF without checking it, for tests and generators of odd, extreme and damaged files.
//!
//! A [`File`] holds the text of each element of each list, so that even what JSON cannot say (`NaN`) can be written, and
//! a million elements take little memory. Nothing here is used to write the output of a bake.

use std::collections::BTreeMap;
use std::fmt::{Display, Write as _};
use std::io::{self, Write};

use glam::{DVec2, DVec3};

use crate::gltf::binary::{BIN, CHUNK_HEADER, HEADER, JSON, MAGIC};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Triangles with the attributes of their vertices, rounded to 32-bit floats where they are written.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// Positions; vertices of a shape with positions alone may be shared by any number of triangles.
    pub positions: Vec<DVec3>,
    /// Normals: none, or as many as positions.
    pub normals: Vec<DVec3>,
    /// Texture coordinates: none, or as many as positions.
    pub texcoords: Vec<DVec2>,
    /// Three vertices per triangle. If there are none, each three positions are a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The material.
    pub material: Option<usize>,
}

/// A GLB file under construction. Lists are those of glTF, such as `nodes`; texts are JSON, or not, as one likes.
#[derive(Clone, Debug, Default)]
pub struct File {
    lists: BTreeMap<&'static str, Vec<String>>,
    properties: BTreeMap<&'static str, String>,
    bytes: Vec<u8>,
}

impl File {
    /// Appends an element to a list; returns its index.
    pub fn push(&mut self, list: &'static str, text: impl Into<String>) -> usize {
        let list = self.lists.entry(list).or_default();
        list.push(text.into());
        list.len() - 1
    }

    /// Adds a property to an object in a list. A property that is there already is then there twice.
    ///
    /// # Panics
    /// If there is no such element, or it is not an object.
    pub fn set(&mut self, list: &'static str, index: usize, property: &str, value: impl Display) {
        let text = &mut self.lists.get_mut(list).expect("the list is there")[index];
        assert_eq!(text.pop(), Some('}'), "an object");
        let comma = if text.ends_with('{') { "" } else { "," };
        let _ = write!(text, "{comma}\"{property}\":{value}}}");
    }

    /// Adds a property to the root object, such as `scene` or `extensionsUsed`.
    pub fn set_root(&mut self, property: &'static str, value: impl Display) {
        self.properties.insert(property, value.to_string());
    }

    /// Appends bytes to the buffer, aligned to four; returns the index of a view of them.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.push("bufferViews", format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{}}}"#, bytes.len()))
    }

    /// Adds an accessor of floats with a view of its own; returns its index. `kind` is a type such as `VEC3`.
    pub fn floats(&mut self, kind: &str, values: impl IntoIterator<Item = f32>) -> usize {
        let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
        let components = if kind == "SCALAR" { 1 } else { usize::from(kind.as_bytes()[3] - b'0') };
        let count = bytes.len() / 4 / components;
        let view = self.view(&bytes);
        self.accessor(view, 0, (FLOAT, kind), count)
    }

    /// Adds an accessor; returns its index. `element` is its component type and its type.
    pub fn accessor(&mut self, view: usize, offset: usize, element: (u32, &str), count: usize) -> usize {
        let (component, kind) = element;
        let text = format!(
            r#"{{"bufferView":{view},"byteOffset":{offset},"componentType":{component},"count":{count},"type":"{kind}"}}"#
        );
        self.push("accessors", text)
    }

    /// Adds an accessor of positions with their bounds, as glTF demands; numbers that are not finite have none.
    pub fn positions(&mut self, positions: impl Iterator<Item = [f32; 3]> + Clone) -> usize {
        let accessor = self.floats("VEC3", positions.clone().flatten());
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for position in positions {
            for axis in 0..3 {
                (min[axis], max[axis]) = (min[axis].min(position[axis]), max[axis].max(position[axis]));
            }
        }
        let view = self.lists["bufferViews"].len() - 1;
        self.set("bufferViews", view, "target", VERTICES);
        for (property, bound) in [("min", min), ("max", max)] {
            if bound.iter().all(|x| x.is_finite()) {
                self.set("accessors", accessor, property, numbers(bound.map(f64::from)));
            }
        }
        accessor
    }

    /// Adds an accessor of 32-bit indices; returns its index.
    pub fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes: Vec<u8> = triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.set("bufferViews", view, "target", INDICES);
        self.accessor(view, 0, (UNSIGNED_INT, "SCALAR"), 3 * triangles.len())
    }

    /// Adds a mesh with one primitive per shape; returns its index.
    pub fn mesh(&mut self, name: &str, shapes: &[&Shape]) -> usize {
        let primitives: Vec<String> = shapes.iter().map(|shape| self.primitive(shape)).collect();
        self.push("meshes", format!(r#"{{"name":"{name}","primitives":[{}]}}"#, primitives.join(",")))
    }

    fn primitive(&mut self, shape: &Shape) -> String {
        let position = self.positions(shape.positions.iter().map(|p| p.as_vec3().to_array()));
        let mut attributes = format!(r#""POSITION":{position}"#);
        if !shape.normals.is_empty() {
            let normal = self.floats("VEC3", shape.normals.iter().flat_map(|n| n.as_vec3().to_array()));
            let _ = write!(attributes, r#","NORMAL":{normal}"#);
        }
        if !shape.texcoords.is_empty() {
            let texcoord = self.floats("VEC2", shape.texcoords.iter().flat_map(|t| t.as_vec2().to_array()));
            let _ = write!(attributes, r#","TEXCOORD_0":{texcoord}"#);
        }
        let mut text = format!(r#"{{"attributes":{{{attributes}}}"#);
        if !shape.triangles.is_empty() {
            let _ = write!(text, r#","indices":{}"#, self.indices(&shape.triangles));
        }
        if let Some(material) = shape.material {
            let _ = write!(text, r#","material":{material}"#);
        }
        text + "}"
    }

    /// Adds a node that places a mesh; returns its index.
    pub fn node(&mut self, name: &str, mesh: usize) -> usize {
        self.push("nodes", format!(r#"{{"name":"{name}","mesh":{mesh}}}"#))
    }

    /// Adds a mesh of one shape and a node that places it; returns the node's index.
    pub fn object(&mut self, name: &str, shape: &Shape) -> usize {
        let mesh = self.mesh(name, &[shape]);
        self.node(name, mesh)
    }

    /// Adds a material with a base colour; returns its index.
    pub fn material(&mut self, name: &str, color: [f64; 3]) -> usize {
        let [r, g, b] = color;
        let look = format!(r#"{{"baseColorFactor":[{r},{g},{b},1],"metallicFactor":0}}"#);
        self.push("materials", format!(r#"{{"name":"{name}","pbrMetallicRoughness":{look}}}"#))
    }

    /// Adds a scene that shows some nodes, and makes it the default.
    pub fn show(&mut self, roots: impl IntoIterator<Item = usize>) {
        let scene = self.push("scenes", format!(r#"{{"nodes":{}}}"#, list(roots)));
        self.set_root("scene", scene);
    }

    /// Writes the file as GLB.
    ///
    /// # Errors
    /// Fails if it exceeds 4 GiB, or cannot be written.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let text = self.json();
        let bin = if self.bytes.is_empty() { 0 } else { CHUNK_HEADER + self.bytes.len() };
        let total = HEADER + CHUNK_HEADER + text.len() + bin;
        let too_long = |_| io::Error::other(format!("{total} bytes are more than a GLB file can hold"));
        let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(too_long);
        out.write_all(MAGIC)?;
        out.write_all(&2_u32.to_le_bytes())?;
        out.write_all(&word(total)?)?;
        out.write_all(&word(text.len())?)?;
        out.write_all(JSON)?;
        out.write_all(text.as_bytes())?;
        if bin > 0 {
            out.write_all(&word(self.bytes.len())?)?;
            out.write_all(BIN)?;
            out.write_all(&self.bytes)?;
        }
        Ok(())
    }

    /// The JSON chunk, padded.
    fn json(&self) -> String {
        let mut text = String::from(r#"{"asset":{"version":"2.0","generator":"raykiln lab generate"}"#);
        for (property, value) in &self.properties {
            let _ = write!(text, ",\"{property}\":{value}");
        }
        for (name, elements) in &self.lists {
            let _ = write!(text, ",\"{name}\":[");
            for (i, element) in elements.iter().enumerate() {
                text.push_str(if i == 0 { "" } else { "," });
                text.push_str(element);
            }
            text.push(']');
        }
        if !self.bytes.is_empty() {
            let _ = write!(text, r#","buffers":[{{"byteLength":{}}}]"#, self.bytes.len());
        }
        text.push('}');
        text.extend(std::iter::repeat_n(' ', text.len().next_multiple_of(4) - text.len()));
        text
    }
}

/// The JSON of numbers; what is not finite becomes text that no reader of JSON takes.
pub fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    list(values.into_iter().map(|x| format!("{x:?}")))
}

/// The JSON of a list of elements.
pub fn list(elements: impl IntoIterator<Item = impl Display>) -> String {
    let elements: Vec<String> = elements.into_iter().map(|element| element.to_string()).collect();
    format!("[{}]", elements.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, read_bytes};

    fn written(file: &File) -> Vec<u8> {
        let mut bytes = Vec::new();
        file.write(&mut bytes).expect("memory can be written to");
        bytes
    }

    fn triangle() -> (File, usize) {
        let mut file = File::default();
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let shape =
            Shape { normals: vec![DVec3::Z; 3], triangles: vec![[0, 1, 2]], positions: corners, ..Shape::default() };
        let node = file.object("only", &shape);
        file.show([node]);
        (file, node)
    }

    #[test]
    fn what_is_sound_is_read_back() {
        let (mut file, node) = triangle();
        file.set("nodes", node, "translation", numbers([0.5, -0.0, 1e-7]));
        let document = read_bytes("a.glb", written(&file)).expect("sound");
        let contents = document.contents(ReadOptions::default()).expect("sound");
        let triangles = contents.meshes[0].primitives[0].triangles.as_ref().expect("triangles");
        assert_eq!(*triangles.positions, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(contents.nodes[0].local.translation, DVec3::new(0.5, -0.0, 1e-7));
    }

    #[test]
    fn what_json_cannot_say_is_written_all_the_same() {
        let (mut file, node) = triangle();
        file.set("nodes", node, "scale", numbers([f64::NAN; 3]));
        let error = read_bytes("a.glb", written(&file)).expect_err("NaN is not JSON");
        assert!(error.to_string().contains("JSON: expected value"), "{error}");
    }
}
