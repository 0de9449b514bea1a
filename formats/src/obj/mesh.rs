//! Converts meshes of `tobj` to glTF primitives.

use glam::{DVec2, DVec3, Vec3};
use rustc_hash::FxHashMap;

use super::notes::Notes;
use super::polygon::{self, Outcome};

/// A primitive under construction: its vertices are the distinct (position, texture coordinate, normal) triples of the
/// file in order of first use.
#[derive(Debug, Default)]
pub(super) struct Primitive {
    /// Positions as parsed.
    pub(super) positions: Vec<[f32; 3]>,
    /// Unit normals, or empty.
    pub(super) normals: Vec<[f32; 3]>,
    /// Texture coordinates with v down from the top, or empty.
    pub(super) texcoords: Vec<[f32; 2]>,
    /// Colours in 0..1, or empty.
    pub(super) colors: Vec<[f32; 3]>,
    /// Three vertices per triangle.
    pub(super) indices: Vec<u32>,
}

/// Attributes of all corners of a face. A face lacks what any of its corners lacks, and faces that lack the same form
/// one primitive, so that no normals or texture coordinates of the file are dropped or invented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Has {
    texcoords: bool,
    normals: bool,
}

/// The values of a `tobj` mesh, ready for glTF.
struct Source<'a> {
    mesh: &'a tobj::Mesh,
    /// `None` for a normal without direction, which counts as missing.
    normals: Vec<Option<[f32; 3]>>,
    texcoords: Vec<Option<[f32; 2]>>,
    colors: Vec<Option<[f32; 3]>>,
}

/// The conversion result of a mesh.
#[derive(Debug, Default)]
pub(super) struct Made {
    /// The primitives, one per set of missing attributes, in order of first appearance.
    pub(super) primitives: Vec<Primitive>,
    /// Number of finite faces that could only be split from their first corner.
    fans: usize,
}

impl Made {
    /// Adds notes on how the mesh was converted.
    pub(super) fn note(&self, notes: &mut Notes) {
        let message = "faces whose outline crosses itself or lies in no plane, split from their first corner";
        notes.add_many(String::new, message, self.fans);
    }
}

/// Converts a mesh to primitives.
pub(super) fn primitives(mesh: &tobj::Mesh, full_color: f32) -> Made {
    let source = Source::of(mesh, full_color);
    let mut builders: Vec<(Has, Builder)> = Vec::new();
    let (mut start, mut points, mut triangles, mut fans) = (0, Vec::new(), Vec::new(), 0);
    for count in arities(mesh) {
        let corners = start..start + count;
        start += count;
        let has = source.has(corners.clone());
        let at = builders.iter().position(|(other, _)| *other == has).unwrap_or_else(|| {
            builders.push((has, Builder::default()));
            builders.len() - 1
        });
        points.clear();
        points.extend(corners.clone().map(|corner| source.position(corner)));
        triangles.clear();
        let outcome = polygon::triangulate(&points, &mut triangles);
        fans += usize::from(outcome == Outcome::Fan && points.iter().all(|point| point.is_finite()));
        for corner in triangles.iter().flatten() {
            builders[at].1.add(source.key(corners.start + corner, has));
        }
    }
    let primitives = builders.into_iter().map(|(has, builder)| source.primitive(has, builder)).collect();
    Made { primitives, fans }
}

fn arities(mesh: &tobj::Mesh) -> Box<dyn Iterator<Item = usize> + '_> {
    if mesh.face_arities.is_empty() {
        Box::new(std::iter::repeat_n(3, mesh.indices.len() / 3))
    } else {
        Box::new(mesh.face_arities.iter().map(|&count| count as usize))
    }
}

/// Position, texture coordinate and normal of a vertex, as indices into the `tobj` mesh; 0 if missing.
type Key = [u32; 3];

/// Numbers vertices in order of first use.
#[derive(Default)]
struct Builder {
    number: FxHashMap<Key, u32>,
    keys: Vec<Key>,
    indices: Vec<u32>,
}

impl Builder {
    fn add(&mut self, key: Key) {
        let next = self.keys.len() as u32;
        let vertex = *self.number.entry(key).or_insert(next);
        if vertex == next {
            self.keys.push(key);
        }
        self.indices.push(vertex);
    }
}

impl<'a> Source<'a> {
    fn of(mesh: &'a tobj::Mesh, full_color: f32) -> Self {
        let triples = |values: &'a [f32]| values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]);
        let texcoord =
            |c: &[f32]| Some([c[0], 1.0 - c[1]]).filter(|_| DVec2::new(c[0].into(), c[1].into()).is_finite());
        let color = |c: [f32; 3]| Vec3::from(c).is_finite().then(|| c.map(|x| (x / full_color).clamp(0.0, 1.0)));
        Source {
            mesh,
            normals: triples(&mesh.normals).map(unit).collect(),
            texcoords: mesh.texcoords.chunks_exact(2).map(texcoord).collect(),
            colors: triples(&mesh.vertex_color).map(color).collect(),
        }
    }

    fn has(&self, corners: std::ops::Range<usize>) -> Has {
        let all = |indices: &[u32], found: &dyn Fn(usize) -> bool| {
            indices.get(corners.clone()).is_some_and(|indices| indices.iter().all(|&i| found(i as usize)))
        };
        Has {
            texcoords: all(&self.mesh.texcoord_indices, &|i| self.texcoords[i].is_some()),
            normals: all(&self.mesh.normal_indices, &|i| self.normals[i].is_some()),
        }
    }

    fn key(&self, corner: usize, has: Has) -> Key {
        let texcoord = if has.texcoords { self.mesh.texcoord_indices[corner] } else { 0 };
        let normal = if has.normals { self.mesh.normal_indices[corner] } else { 0 };
        [self.mesh.indices[corner], texcoord, normal]
    }

    fn position(&self, corner: usize) -> DVec3 {
        Vec3::from(self.point(self.mesh.indices[corner])).as_dvec3()
    }

    fn point(&self, index: u32) -> [f32; 3] {
        let at = 3 * index as usize;
        [self.mesh.positions[at], self.mesh.positions[at + 1], self.mesh.positions[at + 2]]
    }

    /// Collects the vertices. If only some vertices lack colours, these get white, which changes nothing.
    fn primitive(&self, has: Has, builder: Builder) -> Primitive {
        let keys = &builder.keys;
        let colored = !self.colors.is_empty() && keys.iter().any(|key| self.colors[key[0] as usize].is_some());
        let color = |key: &Key| self.colors[key[0] as usize].unwrap_or([1.0; 3]);
        let texcoords = keys.iter().filter(|_| has.texcoords).filter_map(|key| self.texcoords[key[1] as usize]);
        let normals = keys.iter().filter(|_| has.normals).filter_map(|key| self.normals[key[2] as usize]);
        Primitive {
            positions: keys.iter().map(|key| self.point(key[0])).collect(),
            normals: normals.collect(),
            texcoords: texcoords.collect(),
            colors: if colored { keys.iter().map(color).collect() } else { Vec::new() },
            indices: builder.indices,
        }
    }
}

/// Returns the normal at unit length, if it has a direction.
fn unit(normal: [f32; 3]) -> Option<[f32; 3]> {
    let normal = Vec3::from(normal).as_dvec3();
    normal.is_finite().then(|| normal.try_normalize()).flatten().map(|unit| unit.as_vec3().to_array())
}
