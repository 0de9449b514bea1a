//! What the OBJ tests share: files written to a temporary folder, and the document read back checked against the
//! rules of glTF that hold for every document.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::path::Path;

use raykiln_formats::{Document, Error, ObjOptions};
use serde_json::Value;

/// Reads `scene.obj` of these files.
pub(crate) fn try_read(files: &[(&str, &[u8])]) -> Result<Document, Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    try_read_in(folder.path(), files)
}

/// As [`try_read`], in a folder that may hold other files.
pub(crate) fn try_read_in(folder: &Path, files: &[(&str, &[u8])]) -> Result<Document, Error> {
    write_and_read(folder, files, false)
}

/// As [`try_read_in`]; `strict` refuses damage.
pub(crate) fn write_and_read(folder: &Path, files: &[(&str, &[u8])], strict: bool) -> Result<Document, Error> {
    for (name, bytes) in files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder made");
        std::fs::write(path, bytes).expect("a file written");
    }
    raykiln_formats::read_with(&folder.join("scene.obj"), &ObjOptions::default().with_strict(strict))
}

/// Reads an OBJ text, which must be sound.
pub(crate) fn read(obj: &str) -> Document {
    read_bytes(obj.as_bytes())
}

/// As [`read`].
pub(crate) fn read_bytes(obj: &[u8]) -> Document {
    let from_memory = sound(raykiln_formats::read_bytes("scene.obj", obj.to_vec()));
    let doc = sound(try_read(&[("scene.obj", obj)]));
    assert_eq!((&from_memory.json, &from_memory.buffers), (&doc.json, &doc.buffers));
    assert_eq!(from_memory.warnings, doc.warnings);
    doc
}

/// Reads an OBJ text with `scene.mtl` beside it, which it need not name.
pub(crate) fn read_with_mtl(obj: &str, mtl: &str) -> Document {
    read_files(&[("scene.obj", format!("mtllib scene.mtl\n{obj}").as_bytes()), ("scene.mtl", mtl.as_bytes())])
}

/// Reads `scene.obj` of these files, which must be sound.
pub(crate) fn read_files(files: &[(&str, &[u8])]) -> Document {
    sound(try_read(files))
}

/// The message with which an OBJ text is refused if damage is not to be left out.
pub(crate) fn refusal(obj: &str) -> String {
    let options = ObjOptions::default().with_strict(true);
    let error = raykiln_formats::read_bytes_with("scene.obj", obj.as_bytes().to_vec(), &options);
    let error = error.expect_err("the text must be refused");
    assert!(error.file.ends_with("scene.obj"), "{error}");
    format!("{}: {}", error.place, error.cause)
}

/// A PNG file of one pixel.
pub(crate) const PIXEL: &[u8] = include_bytes!("pixel.png");

fn sound(document: Result<Document, Error>) -> Document {
    let document = document.expect("the file must be read");
    check(&document);
    document
}

/// The material of a textured triangle that uses material `m` of this MTL text.
pub(crate) fn material(mtl: &str) -> Value {
    material_of(&textured(mtl))
}

/// A textured triangle that uses material `m`.
pub(crate) const TEXTURED: &str =
    "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";

/// A document of one textured triangle that uses material `m` of this MTL text, with a file of one pixel for each word
/// that ends in `.png`.
pub(crate) fn textured(mtl: &str) -> Document {
    let mut files = vec![("scene.obj", TEXTURED.as_bytes()), ("scene.mtl", mtl.as_bytes())];
    files.extend(mtl.split_whitespace().filter(|word| word.ends_with(".png")).map(|word| (word, PIXEL)));
    read_files(&files)
}

/// The only material of a document.
pub(crate) fn material_of(document: &Document) -> Value {
    assert_eq!(list(&document.json, "materials").len(), 1);
    document.json["materials"][0].clone()
}

/// The array of that name, empty if there is none.
pub(crate) fn list<'a>(json: &'a Value, key: &str) -> &'a [Value] {
    json[key].as_array().map_or(&[], Vec::as_slice)
}

/// Names of all nodes with a mesh, in order.
pub(crate) fn objects(document: &Document) -> Vec<String> {
    let nodes = list(&document.json, "nodes").iter().filter(|node| node["mesh"].is_u64());
    nodes.map(|node| node["name"].as_str().expect("a name").to_owned()).collect()
}

/// The node tree as text: `name(child child)`.
pub(crate) fn tree(document: &Document) -> String {
    fn show(json: &Value, node: &Value) -> String {
        let node = &json["nodes"][node.as_u64().expect("an index") as usize];
        let children: Vec<String> = list(node, "children").iter().map(|child| show(json, child)).collect();
        let name = node["name"].as_str().expect("a name");
        if children.is_empty() { name.to_owned() } else { format!("{name}({})", children.join(" ")) }
    }
    let roots = list(&document.json["scenes"][0], "nodes");
    roots.iter().map(|root| show(&document.json, root)).collect::<Vec<_>>().join(" ")
}

/// All warnings, one a line.
pub(crate) fn warnings(document: &Document) -> String {
    document.warnings.iter().map(|warning| format!("{warning}\n")).collect()
}

/// The primitive of a mesh.
pub(crate) fn primitive(document: &Document, mesh: usize, primitive: usize) -> &Value {
    &document.json["meshes"][mesh]["primitives"][primitive]
}

/// The numbers of an accessor, element by element.
pub(crate) fn numbers(document: &Document, accessor: &Value) -> Vec<Vec<f64>> {
    let accessor = &document.json["accessors"][index(accessor)];
    let view = &document.json["bufferViews"][index(&accessor["bufferView"])];
    let (size, components) = layout(accessor);
    let stride = view["byteStride"].as_u64().map_or(size * components, |stride| stride as usize);
    let start = size_of(&view["byteOffset"]) + size_of(&accessor["byteOffset"]);
    let component = |at: usize| {
        let bytes = &document.buffers[0][at..at + size];
        match accessor["componentType"].as_u64() {
            Some(5126) => f64::from(f32::from_le_bytes(bytes.try_into().expect("four bytes"))),
            Some(5125) => f64::from(u32::from_le_bytes(bytes.try_into().expect("four bytes"))),
            _ => f64::from(u16::from_le_bytes(bytes.try_into().expect("two bytes"))),
        }
    };
    let element = |i: usize| (0..components).map(|c| component(start + i * stride + c * size)).collect();
    (0..size_of(&accessor["count"])).map(element).collect()
}

/// The numbers of a vertex attribute.
pub(crate) fn attribute(document: &Document, mesh: usize, at: usize, name: &str) -> Vec<Vec<f64>> {
    numbers(document, &primitive(document, mesh, at)["attributes"][name])
}

/// Vertex indices of the triangles of a primitive.
pub(crate) fn triangles(document: &Document, mesh: usize, at: usize) -> Vec<[usize; 3]> {
    let indices = numbers(document, &primitive(document, mesh, at)["indices"]);
    indices.chunks_exact(3).map(|c| [c[0][0] as usize, c[1][0] as usize, c[2][0] as usize]).collect()
}

/// Number of triangles in the whole document.
pub(crate) fn triangle_count(document: &Document) -> usize {
    let primitives = |mesh: usize| 0..list(&document.json["meshes"][mesh], "primitives").len();
    let meshes = 0..list(&document.json, "meshes").len();
    meshes.map(|mesh| primitives(mesh).map(|p| triangles(document, mesh, p).len()).sum::<usize>()).sum()
}

fn index(value: &Value) -> usize {
    value.as_u64().expect("an index") as usize
}

fn size_of(value: &Value) -> usize {
    value.as_u64().unwrap_or(0) as usize
}

fn layout(accessor: &Value) -> (usize, usize) {
    let size = if accessor["componentType"] == 5123 { 2 } else { 4 };
    let components = match accessor["type"].as_str() {
        Some("SCALAR") => 1,
        Some("VEC2") => 2,
        _ => 3,
    };
    (size, components)
}

/// Checks what holds for every document: references, ranges, alignment, bounds, no empty arrays, one parent a node.
pub(crate) fn check(document: &Document) {
    let json = &document.json;
    no_empty_arrays(json);
    assert_eq!(json["asset"]["version"], "2.0");
    let length = document.buffers.first().map_or(0, |buffer| buffer.len());
    assert_eq!(size_of(&json["buffers"][0]["byteLength"]), length);
    for view in list(json, "bufferViews") {
        assert!(size_of(&view["byteOffset"]) + size_of(&view["byteLength"]) <= length);
        assert_eq!(size_of(&view["byteOffset"]) % 4, 0);
    }
    for accessor in list(json, "accessors") {
        let view = &json["bufferViews"][index(&accessor["bufferView"])];
        let (size, components) = layout(accessor);
        let end = size_of(&accessor["byteOffset"]) + size_of(&accessor["count"]) * size * components;
        assert!(end <= size_of(&view["byteLength"]) && size_of(&accessor["byteOffset"]).is_multiple_of(size));
        assert!(size_of(&accessor["count"]) > 0);
    }
    for (mesh, value) in list(json, "meshes").iter().enumerate() {
        (0..list(value, "primitives").len()).for_each(|at| check_primitive(document, mesh, at));
    }
    check_nodes(json);
}

fn check_primitive(document: &Document, mesh: usize, at: usize) {
    let value = primitive(document, mesh, at);
    let positions = attribute(document, mesh, at, "POSITION");
    for (name, accessor) in value["attributes"].as_object().expect("attributes") {
        assert_eq!(numbers(document, accessor).len(), positions.len(), "{name}");
    }
    let indices = numbers(document, &value["indices"]);
    let used: std::collections::BTreeSet<usize> = indices.iter().map(|index| index[0] as usize).collect();
    assert!(used.into_iter().eq(0..positions.len()), "every vertex is used, none is out of range");
    let bounds = &document.json["accessors"][index(&value["attributes"]["POSITION"])];
    for axis in 0..3 {
        let finite = positions.iter().map(|p| p[axis]).filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let stored = |key: &str| bounds[key][axis].as_f64().expect("a bound");
        assert!(low > high || (stored("min") == low && stored("max") == high));
    }
    if value["attributes"]["NORMAL"].is_u64() {
        let unit = |n: &Vec<f64>| (n.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.0).abs() < 1e-6;
        assert!(attribute(document, mesh, at, "NORMAL").iter().all(unit));
    }
    let material = value["material"].as_u64();
    assert!(material.is_none_or(|material| (material as usize) < list(&document.json, "materials").len()));
}

fn check_nodes(json: &Value) {
    let count = list(json, "nodes").len();
    let mut parents = vec![0; count];
    let children = list(json, "nodes").iter().flat_map(|node| list(node, "children"));
    children.chain(list(&json["scenes"][0], "nodes")).for_each(|child| parents[index(child)] += 1);
    assert!(parents.iter().all(|&parents| parents == 1), "each node has one place");
    let mut meshes: Vec<usize> =
        list(json, "nodes").iter().filter(|node| node["mesh"].is_u64()).map(|node| index(&node["mesh"])).collect();
    meshes.sort_unstable();
    assert!(meshes.into_iter().eq(0..list(json, "meshes").len()), "each mesh has one node");
}

fn no_empty_arrays(value: &Value) {
    match value {
        Value::Array(values) => {
            assert!(!values.is_empty(), "an empty array");
            values.iter().for_each(no_empty_arrays);
        }
        Value::Object(values) => values.values().for_each(no_empty_arrays),
        _ => {}
    }
}
