//! Converts meshes of `tobj` to glTF primitives.

use glam::{DVec3, Vec2, Vec3};
use rustc_hash::FxHashMap;

use super::notes::Notes;
use super::polygon::{self, Outcome};
use super::scan::Kind;
use super::shift;

/// A primitive under construction: its vertices are the distinct (position, texture coordinate, normal) triples of the
/// file in order of first use.
#[derive(Debug, Default)]
pub(super) struct Primitive {
    /// Positions relative to the part's shift, rounded.
    pub(super) positions: Vec<[f32; 3]>,
    /// For each position what rounding took from it, see [`Residuals`](crate::document::Residuals); empty if nothing.
    pub(super) residuals: Vec<Vec3>,
    /// Unit normals, or empty.
    pub(super) normals: Vec<[f32; 3]>,
    /// Texture coordinates with v down from the top, or empty.
    pub(super) texcoords: Vec<[f32; 2]>,
    /// Linear colours in 0..1, or empty.
    pub(super) colors: Vec<[f32; 3]>,
    /// Three vertices per triangle, two per line, one per point.
    pub(super) indices: Vec<u32>,
    /// What the vertices form.
    pub(super) kind: Kind,
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
    /// Positions as they are stored.
    positions: Vec<Vec3>,
    /// What rounding took from them.
    residuals: Vec<Vec3>,
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
    /// Number of finite positions beyond the range of 32-bit floats.
    beyond: usize,
}

impl Made {
    /// Adds notes on how the mesh was converted.
    pub(super) fn note(&self, notes: &mut Notes) {
        let message = "faces whose outline crosses itself or lies in no plane, split from their first corner";
        notes.add_many(String::new, message, self.fans);
        let message = "positions beyond 3.4e38, the largest 32-bit float: their triangles are left out";
        notes.add_many(String::new, message, self.beyond);
    }
}

/// Converts lines or points to a primitive, with positions relative to `shift`.
pub(super) fn strokes(kind: Kind, mesh: &tobj::Mesh, shift: DVec3, full_color: f32) -> Made {
    let source = Source::of(mesh, shift, full_color);
    let mut builder = Builder::default();
    mesh.indices.iter().for_each(|&corner| builder.add([corner, 0, 0]));
    let none = Has { texcoords: false, normals: false };
    Made { primitives: vec![Primitive { kind, ..source.primitive(none, builder) }], ..Made::default() }
}

/// Converts a mesh to primitives, with positions relative to `shift`.
pub(super) fn primitives(mesh: &tobj::Mesh, shift: DVec3, full_color: f32) -> Made {
    let source = Source::of(mesh, shift, full_color);
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
    let beyond = shift::positions(mesh).filter(|p| p.is_finite() && !shift::is_storable(*p)).count();
    Made { primitives, fans, beyond }
}

pub(super) fn arities(mesh: &tobj::Mesh) -> Box<dyn Iterator<Item = usize> + '_> {
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
    fn of(mesh: &'a tobj::Mesh, shift: DVec3, full_color: f32) -> Self {
        let triples = |values: &'a [f64]| values.chunks_exact(3).map(|c| DVec3::from_slice(c).as_vec3());
        let texcoord = |c: &[f64]| Some([c[0] as f32, 1.0 - c[1] as f32]).filter(|c| Vec2::from(*c).is_finite());
        let color = |c: Vec3| c.is_finite().then(|| c.to_array().map(|x| linear((x / full_color).clamp(0.0, 1.0))));
        let (positions, residuals) = shift::positions(mesh).map(|position| rounded(position, shift)).unzip();
        Source {
            mesh,
            positions,
            residuals,
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

    /// Returns a corner as it is stored, so that polygons are split as they will be seen.
    fn position(&self, corner: usize) -> DVec3 {
        self.positions[self.mesh.indices[corner] as usize].as_dvec3()
    }

    /// Collects the vertices. If only some vertices lack colours, these get white, which changes nothing.
    fn primitive(&self, has: Has, builder: Builder) -> Primitive {
        let keys = &builder.keys;
        let colored = !self.colors.is_empty() && keys.iter().any(|key| self.colors[key[0] as usize].is_some());
        let color = |key: &Key| self.colors[key[0] as usize].unwrap_or([1.0; 3]);
        let texcoords = keys.iter().filter(|_| has.texcoords).filter_map(|key| self.texcoords[key[1] as usize]);
        let normals = keys.iter().filter(|_| has.normals).filter_map(|key| self.normals[key[2] as usize]);
        let mut residuals: Vec<Vec3> = keys.iter().map(|key| self.residuals[key[0] as usize]).collect();
        if residuals.iter().all(|residual| *residual == Vec3::ZERO) {
            residuals = Vec::new();
        }
        Primitive {
            positions: keys.iter().map(|key| self.positions[key[0] as usize].to_array()).collect(),
            residuals,
            normals: normals.collect(),
            texcoords: texcoords.collect(),
            colors: if colored { keys.iter().map(color).collect() } else { Vec::new() },
            indices: builder.indices,
            kind: Kind::Faces,
        }
    }
}

/// Converts a component of a colour from sRGB, in which OBJ files have them, to linear (IEC 61966-2-1, 1999).
fn linear(srgb: f32) -> f32 {
    match f64::from(srgb) {
        dark if dark <= 0.04045 => (dark / 12.92) as f32,
        light => ((light + 0.055) / 1.055).powf(2.4) as f32,
    }
}

/// Returns a position relative to `shift`, rounded, and what rounding took from it. Positions beyond the range of 32-bit
/// floats become infinite.
fn rounded(position: DVec3, shift: DVec3) -> (Vec3, Vec3) {
    if !shift::is_storable(position) {
        return (position.as_vec3(), Vec3::ZERO);
    }
    let own = position - shift;
    let stored = own.as_vec3();
    let rest = (own - stored.as_dvec3()).to_array().map(toward_zero);
    (stored, rest.into())
}

/// Rounds toward zero: a residual that is not larger than the exact one rounds away when it is added to what is stored.
fn toward_zero(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest).abs() > x.abs() { f32::from_bits(nearest.to_bits() - 1) } else { nearest }
}

/// Returns the normal at unit length, if it has a direction.
fn unit(normal: Vec3) -> Option<[f32; 3]> {
    let normal = normal.as_dvec3();
    normal.is_finite().then(|| normal.try_normalize()).flatten().map(|unit| unit.as_vec3().to_array())
}
