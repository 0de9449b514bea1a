//! A mesh as triangles with all properties that must agree between copies.

use std::hash::Hasher;

use glam::{DMat3, DVec3};
use raykiln_formats::Document;
use raykiln_formats::document::Attribute;
use rustc_hash::FxHasher;

use super::{Materials, TURNED};
use crate::scene::{Geometry, Mesh, MeshId, Scene};

/// The triangles of a mesh, numbered through its geometries.
pub(super) struct Shape<'a> {
    mesh: &'a Mesh,
    materials: Materials,
    /// By geometry.
    parts: Vec<Part<'a>>,
    /// Corners in mesh coordinates.
    pub(super) corners: Vec<[DVec3; 3]>,
    /// For each corner, a hash of the properties that must agree bit by bit.
    pub(super) keys: Vec<[u64; 3]>,
    /// A hash of the mesh's own extras and extensions.
    pub(super) properties: u64,
    /// The mean of all corners.
    pub(super) center: DVec3,
    /// Root of the mean square of the corners' distances from `center`.
    pub(super) spread: f64,
}

/// The vertex attributes of a geometry except its positions.
struct Part<'a> {
    /// Rotated by a motion, like the tangent.
    normal: Option<Attribute<'a>>,
    tangent: Option<Attribute<'a>>,
    /// The others, by name.
    exact: Vec<Attribute<'a>>,
}

impl<'a> Part<'a> {
    fn new(doc: &'a Document, mesh: &Mesh, geometry: &Geometry) -> Part<'a> {
        let mut part = Part { normal: None, tangent: None, exact: Vec::new() };
        for attribute in doc.attributes(mesh.source as usize, geometry.primitive as usize) {
            match attribute.name.as_str() {
                "POSITION" => {}
                "NORMAL" => part.normal = Some(attribute),
                "TANGENT" => part.tangent = Some(attribute),
                _ => part.exact.push(attribute),
            }
        }
        part.exact.sort_by(|a, b| a.name.cmp(&b.name));
        part
    }
}

impl<'a> Shape<'a> {
    pub(super) fn new(doc: &'a Document, scene: &'a Scene, mesh: MeshId, materials: Materials) -> Shape<'a> {
        let mesh = &scene.meshes[mesh.0 as usize];
        let parts: Vec<Part> = mesh.geometries.iter().map(|g| Part::new(doc, mesh, g)).collect();
        let count = mesh.triangle_count();
        let (mut corners, mut keys) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (geometry, part) in mesh.geometries.iter().zip(&parts) {
            let kind = kind(geometry, materials);
            for (t, vertices) in geometry.triangles.iter().enumerate() {
                corners.push(geometry.corners(t).map(|p| p.as_dvec3()));
                keys.push(vertices.map(|v| corner_key(kind, part, v)));
            }
        }
        let center = mean(corners.as_flattened());
        let spread = mean_square(corners.as_flattened(), center).sqrt();
        let properties = properties(doc, mesh.source as usize);
        Shape { mesh, materials, parts, corners, keys, properties, center, spread }
    }

    /// Returns the unit of lengths: the spread, or 1 if it is 0.
    pub(super) fn unit(&self) -> f64 {
        if self.spread > 0.0 { self.spread } else { 1.0 }
    }

    /// Returns the distance of a point from the middle, in that unit.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        point.distance(self.center) / self.unit()
    }

    /// Returns the distances of all corners from the middle, in ascending order.
    pub(super) fn distances(&self) -> Vec<f64> {
        let mut distances: Vec<f64> = self.corners.as_flattened().iter().map(|p| self.distance(*p)).collect();
        distances.sort_unstable_by(f64::total_cmp);
        distances
    }

    /// Whether two corners agree in everything except their position, after rotating the first (`None`: no rotation).
    pub(super) fn corner_agrees(
        &self,
        [triangle, corner]: [usize; 2],
        other: &Shape,
        at: [usize; 2],
        turn: Option<&DMat3>,
    ) -> bool {
        let (a, vertex_a) = self.vertex(triangle, corner);
        let (b, vertex_b) = other.vertex(at[0], at[1]);
        let exact = a.exact.len() == b.exact.len()
            && a.exact.iter().zip(&b.exact).all(|(x, y)| x.name == y.name && x.bytes(vertex_a) == y.bytes(vertex_b));
        exact
            && directions_agree([(&a.normal, vertex_a), (&b.normal, vertex_b)], turn)
            && directions_agree([(&a.tangent, vertex_a), (&b.tangent, vertex_b)], turn)
    }

    /// Whether two triangles have the same material and kind of primitive, if that matters.
    pub(super) fn kind_agrees(&self, triangle: usize, other: &Shape, at: usize) -> bool {
        if self.materials == Materials::Any {
            return true;
        }
        let key = |shape: &Shape, triangle: usize| {
            let geometry = &shape.mesh.geometries[shape.mesh.locate(triangle as u32).0];
            (geometry.material, geometry.merge_class)
        };
        key(self, triangle) == key(other, at)
    }

    fn vertex(&self, triangle: usize, corner: usize) -> (&Part<'a>, u32) {
        let (geometry, within) = self.mesh.locate(triangle as u32);
        (&self.parts[geometry], self.mesh.geometries[geometry].triangles[within][corner])
    }
}

/// Spreads the bits of a number over all its bits (G. L. Steele, D. Lea and C. H. Flood, "Fast splittable pseudorandom
/// number generators", 2014), so that sums of such numbers distinguish multisets.
pub(super) fn mixed(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Returns a hash of the properties shared by all triangles of a geometry; the same for all if materials do not matter.
pub(super) fn kind(geometry: &Geometry, materials: Materials) -> u64 {
    if materials == Materials::Any {
        return mixed(1);
    }
    let mut hasher = FxHasher::default();
    hasher.write_u32(geometry.material.map_or(u32::MAX, |m| m));
    hasher.write_u32(geometry.merge_class);
    mixed(hasher.finish())
}

fn corner_key(kind: u64, part: &Part, vertex: u32) -> u64 {
    let mut hasher = FxHasher::default();
    hasher.write_u64(kind);
    part.exact.iter().for_each(|attribute| hasher.write(attribute.bytes(vertex)));
    mixed(hasher.finish())
}

/// Returns a hash of a mesh's properties other than its name and primitives.
fn properties(doc: &Document, mesh: usize) -> u64 {
    let mut hasher = FxHasher::default();
    for (key, text) in doc.mesh_properties(mesh) {
        hasher.write(key.as_bytes());
        hasher.write(text.as_bytes());
    }
    hasher.finish()
}

fn mean(points: &[DVec3]) -> DVec3 {
    // Relative to the first point, so that no precision is lost far from the origin.
    let Some(&first) = points.first() else { return DVec3::ZERO };
    first + points.iter().map(|&p| p - first).sum::<DVec3>() / points.len() as f64
}

fn mean_square(points: &[DVec3], center: DVec3) -> f64 {
    points.iter().map(|p| p.distance_squared(center)).sum::<f64>() / points.len().max(1) as f64
}

/// Whether two normals or tangents agree after rotating the first; for tangents, also their handedness, which mirroring
/// reverses.
fn directions_agree([(a, vertex_a), (b, vertex_b)]: [(&Option<Attribute>, u32); 2], turn: Option<&DMat3>) -> bool {
    let (a, b) = match (a, b) {
        (Some(a), Some(b)) => (a, b),
        (a, b) => return a.is_none() && b.is_none(),
    };
    let ([x, y, z, side_a], [u, v, w, side_b]) = (a.numbers(vertex_a), b.numbers(vertex_b));
    let (from, to) = (DVec3::new(x, y, z), DVec3::new(u, v, w));
    let Some(turn) = turn else { return from == to && side_a == side_b };
    let side = if a.element.components == 4 && turn.determinant() < 0.0 { -side_a } else { side_a };
    let off = (*turn * from.normalize_or_zero() - to.normalize_or_zero()).abs().max_element();
    side == side_b && off <= TURNED + 2.0 * step(a).max(step(b))
}

/// Returns the step between stored components of unit vectors.
fn step(attribute: &Attribute) -> f64 {
    attribute.element.component.one().map_or(0.0, |one| 1.0 / one)
}
