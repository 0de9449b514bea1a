//! An independent glTF reader: which triangles a file shows and, from the recorded provenance, the input triangle that
//! each was made from. It shares only the reading of JSON and buffers with the program.

use base64::Engine;
use glam::{DAffine3, DMat4, DQuat, DVec2, DVec3};
use raykiln_formats::Document;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// The source of a triangle: node, copy, mesh, primitive, triangle.
type Origin = [u64; 5];

/// A corner in world coordinates.
#[derive(Clone, Copy)]
struct Corner {
    position: DVec3,
    normal: DVec3,
    texcoord: DVec2,
}

/// A placed triangle.
struct Placed {
    material: Option<u64>,
    corners: [Corner; 3],
}

/// The triangles that the default scene of a file shows, by origin.
pub(crate) struct Surface {
    triangles: BTreeMap<Origin, Placed>,
}

/// The JSON tree of a glTF or GLB file.
pub(crate) fn json_of(path: &Path) -> Value {
    raykiln_formats::read(path).unwrap_or_else(|e| panic!("{e}")).json
}

impl Surface {
    /// Reads a file that is not a bake's output: every triangle is its own origin.
    pub(crate) fn of_input(path: &Path) -> Surface {
        Surface::read(path, false)
    }

    /// Reads a bake's output; panics if a primitive does not record where its triangles come from, or if two triangles
    /// record the same origin.
    pub(crate) fn of_output(path: &Path) -> Surface {
        Surface::read(path, true)
    }

    fn read(path: &Path, baked: bool) -> Surface {
        let document = raykiln_formats::read(path).unwrap_or_else(|e| panic!("{e}"));
        let record = document
            .json
            .pointer("/extras/raykiln/record/origins")
            .or(document.sidecar.as_ref().map(|r| &r["origins"]));
        let origins = record.map(|text| origins(text.as_str().expect("a text"))).unwrap_or_default();
        let file = File { document: &document, origins };
        let mut triangles = BTreeMap::new();
        for (node, transform) in file.placed_nodes() {
            let Some(mesh) = file.json("nodes", node)["mesh"].as_u64() else { continue };
            for (copy, at) in file.copies(node, transform).into_iter().enumerate() {
                for primitive in 0..file.json("meshes", mesh)["primitives"].as_array().expect("an array").len() {
                    let part = Part { node, copy: copy as u64, mesh, primitive: primitive as u64 };
                    for (origin, placed) in file.placed(&part, at, baked) {
                        assert!(triangles.insert(origin, placed).is_none(), "{origin:?} is shown twice");
                    }
                }
            }
        }
        Surface { triangles }
    }

    /// Asserts that `after` shows the same triangles: each input triangle once, with its material, corners, winding,
    /// normals and texture coordinates.
    pub(crate) fn assert_shown_by(&self, after: &Surface) {
        assert!(self.triangles.keys().eq(after.triangles.keys()), "input triangles are missing, or others are added");
        let scale = self.triangles.values().flat_map(|t| &t.corners).map(|c| c.position.abs().max_element());
        let tolerance = 1e-6 * scale.fold(1e-30, f64::max);
        for (origin, before) in &self.triangles {
            let now = &after.triangles[origin];
            assert_eq!(before.material, now.material, "material of {origin:?}");
            let turned = |by: usize| (0..3).all(|i| before.corners[i].is_near(&now.corners[(i + by) % 3], tolerance));
            assert!((0..3).any(turned), "corners of {origin:?}");
        }
    }

    /// Returns the corners of all triangles in world coordinates, computed in double precision.
    pub(crate) fn corners(&self) -> Vec<[DVec3; 3]> {
        self.triangles.values().map(|t| t.corners.map(|c| c.position)).collect()
    }

    /// The total area of a material's triangles.
    pub(crate) fn area(&self, material: usize) -> f64 {
        let of = self.triangles.values().filter(|t| t.material == Some(material as u64));
        let doubled = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
        of.map(|t| 0.5 * doubled(t.corners.map(|c| c.position))).sum()
    }
}

impl Corner {
    fn is_near(&self, other: &Corner, tolerance: f64) -> bool {
        self.position.distance(other.position) <= tolerance
            && self.normal.distance(other.normal) < 1e-5
            && self.texcoord.distance(other.texcoord) < 1e-6
    }
}

#[derive(Debug)]
struct Part {
    node: u64,
    copy: u64,
    mesh: u64,
    primitive: u64,
}

/// Recorded origins by node, copy and primitive.
type Origins = BTreeMap<(u64, u64, u64), Vec<Origin>>;

struct File<'a> {
    document: &'a Document,
    origins: Origins,
}

impl File<'_> {
    fn json(&self, array: &str, index: u64) -> &Value {
        &self.document.json[array][index as usize]
    }

    /// The nodes of the default scene with their transforms to world space.
    fn placed_nodes(&self) -> Vec<(u64, DAffine3)> {
        let roots = &self.json("scenes", self.document.json["scene"].as_u64().unwrap_or(0))["nodes"];
        let mut stack: Vec<(u64, DAffine3)> = numbers(roots).map(|n| (n as u64, DAffine3::IDENTITY)).collect();
        let mut placed = Vec::new();
        while let Some((node, parent)) = stack.pop() {
            let world = parent * local(self.json("nodes", node));
            stack.extend(numbers(&self.json("nodes", node)["children"]).map(|n| (n as u64, world)));
            placed.push((node, world));
        }
        placed
    }

    /// The transforms of the copies that a node places.
    fn copies(&self, node: u64, world: DAffine3) -> Vec<DAffine3> {
        let attributes = &self.json("nodes", node)["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        let Some(attributes) = attributes.as_object() else { return vec![world] };
        let read = |name: &str| attributes.get(name).map(|a| self.elements(a.as_u64().expect("an accessor")));
        let [moves, turns, scales] = ["TRANSLATION", "ROTATION", "SCALE"].map(read);
        let moves = moves.expect("translations");
        let of =
            |list: &Option<Vec<Vec<f64>>>, i: usize, or: &[f64]| list.as_ref().map_or(or.to_vec(), |l| l[i].clone());
        let place = |i: usize| {
            let turn = DQuat::from_slice(&of(&turns, i, &[0.0, 0.0, 0.0, 1.0])).normalize();
            let scale = DVec3::from_slice(&of(&scales, i, &[1.0; 3]));
            world * DAffine3::from_scale_rotation_translation(scale, turn, DVec3::from_slice(&moves[i]))
        };
        (0..moves.len()).map(place).collect()
    }

    /// The triangles of a primitive with their origins.
    fn placed(&self, part: &Part, at: DAffine3, baked: bool) -> Vec<(Origin, Placed)> {
        let primitive = &self.json("meshes", part.mesh)["primitives"][part.primitive as usize];
        let material = primitive["material"].as_u64();
        let triangles = self.triangles(primitive, at);
        let own = (0..).map(|triangle| [part.node, part.copy, part.mesh, part.primitive, triangle]);
        let origins: Vec<Origin> = match baked {
            false => own.take(triangles.len()).collect(),
            true => self.origins.get(&(part.node, part.copy, part.primitive)).cloned().unwrap_or_default(),
        };
        assert!(
            origins.len() >= triangles.len(),
            "{part:?}: {} origins of {} triangles",
            origins.len(),
            triangles.len()
        );
        origins.into_iter().zip(triangles).map(|(o, corners)| (o, Placed { material, corners })).collect()
    }

    fn triangles(&self, primitive: &Value, at: DAffine3) -> Vec<[Corner; 3]> {
        assert_eq!(primitive["mode"].as_u64().unwrap_or(4), 4, "only plain triangles are read");
        let read = |name: &str| Some(self.elements(primitive["attributes"][name].as_u64()?));
        let positions = read("POSITION").expect("positions");
        let (normals, texcoords) = (read("NORMAL"), read("TEXCOORD_0"));
        let to_normal = at.matrix3.inverse().transpose();
        let corner = |v: usize| Corner {
            position: at.transform_point3(DVec3::from_slice(&positions[v])),
            normal: normals.as_ref().map_or(DVec3::ZERO, |n| (to_normal * DVec3::from_slice(&n[v])).normalize()),
            texcoord: texcoords.as_ref().map_or(DVec2::ZERO, |t| DVec2::from_slice(&t[v])),
        };
        let indices: Vec<usize> = match primitive["indices"].as_u64() {
            Some(accessor) => self.elements(accessor).iter().map(|i| i[0] as usize).collect(),
            None => (0..positions.len()).collect(),
        };
        let mirrored = at.matrix3.determinant() < 0.0;
        let wound = |[a, b, c]: [usize; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        indices.as_chunks().0.iter().map(|&t| wound(t).map(corner)).collect()
    }

    /// The elements of an accessor of floats or unsigned integers.
    fn elements(&self, accessor: u64) -> Vec<Vec<f64>> {
        let accessor = self.json("accessors", accessor);
        let view = self.json("bufferViews", accessor["bufferView"].as_u64().expect("a buffer view"));
        let number = |value: &Value| value.as_u64().unwrap_or(0) as usize;
        let components = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            other => panic!("no accessor of type {other:?} is read"),
        };
        let kind = number(&accessor["componentType"]);
        let size = match kind {
            5121 => 1,
            5123 => 2,
            _ => 4,
        };
        let stride = view["byteStride"].as_u64().map_or(size * components, |s| s as usize);
        let bytes = &self.document.buffers[number(&view["buffer"])]
            [number(&view["byteOffset"]) + number(&accessor["byteOffset"])..];
        let component = |at: usize| component(kind, &bytes[at..at + size]);
        let element = |i: usize| (0..components).map(|c| component(i * stride + c * size)).collect();
        (0..number(&accessor["count"])).map(element).collect()
    }
}

fn component(kind: usize, bytes: &[u8]) -> f64 {
    match (kind, bytes) {
        (5121, &[a]) => f64::from(a),
        (5123, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (5125, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        (5126, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => panic!("no component of type {kind} is read"),
    }
}

fn numbers(value: &Value) -> impl Iterator<Item = f64> {
    value.as_array().into_iter().flatten().map(|n| n.as_f64().expect("a number"))
}

fn local(node: &Value) -> DAffine3 {
    if node["matrix"].is_array() {
        let m: Vec<f64> = numbers(&node["matrix"]).collect();
        return DAffine3::from_mat4(DMat4::from_cols_slice(&m));
    }
    let or = |property: &str, default: &[f64]| -> Vec<f64> {
        if node[property].is_array() { numbers(&node[property]).collect() } else { default.to_vec() }
    };
    DAffine3::from_scale_rotation_translation(
        DVec3::from_slice(&or("scale", &[1.0; 3])),
        DQuat::from_slice(&or("rotation", &[0.0, 0.0, 0.0, 1.0])),
        DVec3::from_slice(&or("translation", &[0.0; 3])),
    )
}

/// Reads a record as `docs/provenance.md` specifies it.
fn origins(text: &str) -> Origins {
    let compressed = base64::engine::general_purpose::STANDARD.decode(text).expect("base64");
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(&compressed[..]).read_to_end(&mut bytes).expect("zlib");
    let mut numbers = Numbers(&bytes);
    let _nodes: Vec<u64> = numbers.list(Numbers::next);
    let lists: Vec<Vec<Vec<[Option<u64>; 5]>>> = numbers.list(|numbers| numbers.list(Numbers::origins));
    let (mut node, mut list) = (0, 0);
    let mut all = Origins::new();
    for _ in 0..numbers.next() {
        node += numbers.next();
        let copy = numbers.next();
        list += numbers.signed();
        let input = (numbers.next() >= 2).then(|| [(node as i64 + numbers.signed()) as u64, numbers.next()]);
        for (primitive, origins) in (0..).zip(&lists[list as usize]) {
            let filled = |[of, of_copy, mesh, primitive, triangle]: &[Option<u64>; 5]| {
                let [node, copy] = of.map_or_else(|| input.expect("a node"), |of| [of, of_copy.unwrap()]);
                [node, copy, mesh.unwrap(), primitive.unwrap(), triangle.unwrap()]
            };
            all.insert((node, copy, primitive), origins.iter().map(filled).collect());
        }
    }
    assert!(numbers.0.is_empty(), "nothing follows");
    all
}

/// Numbers of variable length.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn next(&mut self) -> u64 {
        let length = 1 + self.0.iter().position(|byte| *byte < 128).expect("a last byte");
        let (number, rest) = self.0.split_at(length);
        self.0 = rest;
        number.iter().rev().fold(0, |sum, byte| sum << 7 | u64::from(byte & 127))
    }

    fn signed(&mut self) -> i64 {
        let number = self.next() as i64;
        if number % 2 == 0 { number / 2 } else { -(number + 1) / 2 }
    }

    fn list<T>(&mut self, mut element: impl FnMut(&mut Self) -> T) -> Vec<T> {
        (0..self.next()).map(|_| element(self)).collect()
    }

    fn source(&mut self, last: &mut [i64; 2]) -> [Option<u64>; 4] {
        let node = match self.next() {
            0 => {
                last[0] = 0;
                None
            }
            number => {
                let number = number as i64 - 1;
                last[0] += if number % 2 == 0 { number / 2 } else { -(number + 1) / 2 };
                Some(last[0] as u64)
            }
        };
        let copy = self.next();
        last[1] += self.signed();
        [node, Some(copy), Some(last[1] as u64), Some(self.next())]
    }

    /// The origins of the triangles of a primitive; of one that is a primitive of the input, up to a limit.
    fn origins(&mut self) -> Vec<[Option<u64>; 5]> {
        let mut last = [0, 0];
        let at =
            |[node, copy, mesh, primitive]: [Option<u64>; 4], triangle| [node, copy, mesh, primitive, Some(triangle)];
        match self.next() {
            0 => Vec::new(),
            1 => {
                let source = self.source(&mut last);
                (0..MOST_TRIANGLES).map(|triangle| at(source, triangle)).collect()
            }
            _ => {
                let sources = self.list(|numbers| numbers.source(&mut last));
                let spans: Vec<i64> = sources.iter().map(|_| self.next() as i64).collect();
                let mut next = 0;
                self.list(|numbers| {
                    let number = next + numbers.signed();
                    next = number + 1;
                    let (mut source, mut within) = (0, number);
                    while within >= spans[source] {
                        within -= spans[source];
                        source += 1;
                    }
                    at(sources[source], within as u64)
                })
            }
        }
    }
}

/// Triangles of the largest primitive in the tests.
const MOST_TRIANGLES: u64 = 20_000;
