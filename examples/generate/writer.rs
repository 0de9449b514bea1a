//! [`Writer`]: writes glTF incrementally, with vertices going straight to disk.

use crate::shapes::Shape;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// A glTF file under construction. The bytes of its one buffer go to the `.bin` file beside it, which is copied into a
/// `.glb` at the end.
pub(crate) struct Writer {
    path: PathBuf,
    bin_path: PathBuf,
    bin: BufWriter<File>,
    bin_length: u64,
    root: Map<String, Value>,
}

impl Writer {
    /// Starts a `.glb` or `.gltf` file.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        let bin_path = path.with_extension("bin");
        let bin = BufWriter::new(File::options().read(true).write(true).create(true).truncate(true).open(&bin_path)?);
        let root = Map::from_iter([("asset".to_owned(), json!({"version": "2.0", "generator": "raykiln generate"}))]);
        Ok(Writer { path: path.to_owned(), bin_path, bin, bin_length: 0, root })
    }

    /// Appends to one of the file's arrays; returns the index.
    pub(crate) fn push(&mut self, array: &str, value: Value) -> usize {
        let array = self.root.entry(array).or_insert_with(|| json!([])).as_array_mut().expect("an array");
        array.push(value);
        array.len() - 1
    }

    /// Sets a property of the root object.
    pub(crate) fn set(&mut self, property: &str, value: Value) {
        self.root.insert(property.to_owned(), value);
    }

    /// Adds a material with a base colour; returns its index.
    pub(crate) fn material(&mut self, name: &str, [r, g, b]: [f64; 3]) -> usize {
        let colour = json!({"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8});
        self.push("materials", json!({"name": name, "pbrMetallicRoughness": colour}))
    }

    /// Adds a mesh with one primitive per shape; returns its index.
    pub(crate) fn mesh(&mut self, name: &str, parts: &[(&Shape, Option<usize>)]) -> io::Result<usize> {
        let primitives = parts.iter().map(|(shape, material)| self.primitive(shape, *material));
        let primitives = primitives.collect::<io::Result<Vec<Value>>>()?;
        Ok(self.push("meshes", json!({"name": name, "primitives": primitives})))
    }

    /// Adds a mesh and a root node that places it without a transform; returns the node's index.
    pub(crate) fn object(&mut self, name: &str, shape: &Shape, material: Option<usize>) -> io::Result<usize> {
        let mesh = self.mesh(name, &[(shape, material)])?;
        Ok(self.push("nodes", json!({"name": name, "mesh": mesh})))
    }

    fn primitive(&mut self, shape: &Shape, material: Option<usize>) -> io::Result<Value> {
        let positions: Vec<[f32; 3]> = shape.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let normals = shape.normals.iter().flat_map(|n| n.as_vec3().to_array());
        let texcoords = shape.texcoords.iter().flat_map(|t| t.as_vec2().to_array());
        let (min, max) = extent(&positions);
        let position = self.floats(positions.concat(), 3, Some(VERTICES))?;
        self.root["accessors"][position]["min"] = json!(min);
        self.root["accessors"][position]["max"] = json!(max);
        let normal = self.floats(normals, 3, Some(VERTICES))?;
        let texcoord = self.floats(texcoords, 2, Some(VERTICES))?;
        let indices = self.indices(shape)?;
        let attributes = json!({"POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord});
        let mut primitive = json!({"attributes": attributes, "indices": indices});
        if let Some(material) = material {
            primitive["material"] = json!(material);
        }
        Ok(primitive)
    }

    /// Adds an accessor of floats with `components` per element; returns its index.
    pub(crate) fn floats(
        &mut self,
        values: impl IntoIterator<Item = f32>,
        components: usize,
        target: Option<u32>,
    ) -> io::Result<usize> {
        let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][components];
        self.accessor(&bytes, bytes.len() / (4 * components), (FLOAT, kind), target)
    }

    /// Sets the bounds of a SCALAR accessor; the input of an animation sampler needs them.
    pub(crate) fn bound(&mut self, accessor: usize, min: f64, max: f64) {
        self.root["accessors"][accessor]["min"] = json!([min]);
        self.root["accessors"][accessor]["max"] = json!([max]);
    }

    fn indices(&mut self, shape: &Shape) -> io::Result<usize> {
        let indices = shape.triangles.as_flattened();
        let short = shape.positions.len() < usize::from(u16::MAX);
        let bytes: Vec<u8> = match short {
            true => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
            false => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
        };
        let component = if short { UNSIGNED_SHORT } else { UNSIGNED_INT };
        self.accessor(&bytes, indices.len(), (component, "SCALAR"), Some(INDICES))
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        (component, kind): (u32, &str),
        target: Option<u32>,
    ) -> io::Result<usize> {
        let mut view = json!({"buffer": 0, "byteOffset": self.bin_length, "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        self.bin.write_all(bytes)?;
        self.bin.write_all(&[0; 3][..padding])?;
        self.bin_length += (bytes.len() + padding) as u64;
        let view = self.push("bufferViews", view);
        let accessor = json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
        Ok(self.push("accessors", accessor))
    }

    /// Completes the file. The default scene shows `roots`, by default all nodes.
    pub(crate) fn finish(mut self, roots: Option<Vec<usize>>) -> io::Result<()> {
        let nodes = self.root.get("nodes").and_then(Value::as_array).map_or(0, Vec::len);
        let roots = roots.unwrap_or_else(|| (0..nodes).collect());
        self.set("scenes", json!([{"nodes": roots}]));
        self.set("scene", json!(0));
        self.bin.flush()?;
        if self.path.extension().is_some_and(|e| e == "glb") { self.finish_glb() } else { self.finish_gltf() }
    }

    fn finish_gltf(mut self) -> io::Result<()> {
        let uri = self.bin_path.file_name().expect("a file").to_string_lossy().into_owned();
        self.set("buffers", json!([{"uri": uri, "byteLength": self.bin_length}]));
        let mut text = serde_json::to_string_pretty(&self.root)?;
        text.push('\n');
        std::fs::write(&self.path, text)
    }

    fn finish_glb(mut self) -> io::Result<()> {
        self.set("buffers", json!([{"byteLength": self.bin_length}]));
        let mut text = serde_json::to_vec(&self.root)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() as u64 + 8 + self.bin_length;
        let total = u32::try_from(total).map_err(|_| io::Error::other("over 4 GiB: write .gltf instead"))?;
        let mut out = BufWriter::new(File::create(&self.path)?);
        let words = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        out.write_all(&words(&[u32::from_le_bytes(*b"glTF"), 2, total]))?;
        out.write_all(&words(&[text.len() as u32, u32::from_le_bytes(*b"JSON")]))?;
        out.write_all(&text)?;
        out.write_all(&words(&[self.bin_length as u32, u32::from_le_bytes(*b"BIN\0")]))?;
        let mut bin = self.bin.into_inner()?;
        bin.rewind()?;
        io::copy(&mut bin, &mut out)?;
        out.flush()?;
        std::fs::remove_file(&self.bin_path)
    }
}

fn extent(positions: &[[f32; 3]]) -> ([f32; 3], [f32; 3]) {
    let fold = |start: f32, pick: fn(f32, f32) -> f32| {
        std::array::from_fn(|axis| positions.iter().fold(start, |so_far, p| pick(so_far, p[axis])))
    };
    (fold(f32::INFINITY, f32::min), fold(f32::NEG_INFINITY, f32::max))
}
