//! Triangle meshes of simple solids.

use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// A triangle mesh with one normal and one texture coordinate per position.
#[derive(Clone, Default)]
pub(crate) struct Shape {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
    pub(crate) texcoords: Vec<DVec2>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Shape {
    fn vertex(&mut self, position: DVec3, normal: DVec3, texcoord: DVec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.texcoords.push(texcoord);
        self.positions.len() as u32 - 1
    }

    /// Adds a flat quad; its corners are counter-clockwise seen from the front.
    fn quad(&mut self, [a, b, c, d]: [DVec3; 4]) {
        let normal = (b - a).cross(c - a).normalize();
        let first = self.vertex(a, normal, dvec2(0.0, 0.0));
        self.vertex(b, normal, dvec2(1.0, 0.0));
        self.vertex(c, normal, dvec2(1.0, 1.0));
        self.vertex(d, normal, dvec2(0.0, 1.0));
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// Appends another shape.
    pub(crate) fn and(mut self, other: &Shape) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.texcoords.extend(&other.texcoords);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        self
    }

    /// Transforms the shape; the transform must not mirror.
    pub(crate) fn placed(mut self, by: DAffine3) -> Self {
        let normals = by.matrix3.inverse().transpose();
        self.positions.iter_mut().for_each(|p| *p = by.transform_point3(*p));
        self.normals.iter_mut().for_each(|n| *n = (normals * *n).normalize());
        self
    }

    /// Translates the shape.
    pub(crate) fn at(self, x: f64, y: f64, z: f64) -> Self {
        self.placed(DAffine3::from_translation(dvec3(x, y, z)))
    }
}

/// A box around the origin with the given edge lengths: 12 triangles.
pub(crate) fn cuboid(edges: DVec3) -> Shape {
    let half = 0.5 * edges;
    let mut shape = Shape::default();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [-1.0, 1.0] {
            let corner = |along_u: f64, along_v: f64| {
                let mut p = DVec3::ZERO;
                (p[axis], p[u], p[v]) = (side * half[axis], side * along_u * half[u], along_v * half[v]);
                p
            };
            shape.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        }
    }
    shape
}

/// A cube around the origin: 12 triangles.
pub(crate) fn cube(edge: f64) -> Shape {
    cuboid(DVec3::splat(edge))
}

/// A quad in the xz plane around the origin, facing up.
pub(crate) fn floor(edge: f64) -> Shape {
    let h = 0.5 * edge;
    let mut shape = Shape::default();
    shape.quad([dvec3(-h, 0.0, h), dvec3(h, 0.0, h), dvec3(h, 0.0, -h), dvec3(-h, 0.0, -h)]);
    shape
}

/// Triangles from the origin along a direction, `width` wide at their ends, one for each of the given starts.
pub(crate) fn needles(along: DVec3, width: f64, starts: impl Iterator<Item = DVec3>) -> Shape {
    let aside = width * along.normalize().any_orthonormal_vector();
    let mut shape = Shape::default();
    for start in starts {
        let normal = along.cross(aside).normalize();
        let corners = [start, start + along, start + along + aside];
        let texcoords = [dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(1.0, 1.0)];
        let vertices = [0, 1, 2].map(|i| shape.vertex(corners[i], normal, texcoords[i]));
        shape.triangles.push(vertices);
    }
    shape
}

/// A regular octahedron around the origin: 8 triangles, smooth normals.
pub(crate) fn octahedron(radius: f64) -> Shape {
    let mut shape = Shape::default();
    for (axis, side) in (0..6).map(|i| (i / 2, if i % 2 == 0 { 1.0 } else { -1.0 })) {
        let mut direction = DVec3::ZERO;
        direction[axis] = side;
        shape.vertex(radius * direction, direction, longitude_latitude(direction));
    }
    for octant in 0..8u32 {
        let [x, y, z] = [octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2 & 1)];
        let mirrored = octant.count_ones() % 2 == 1;
        shape.triangles.push(if mirrored { [x, z, y] } else { [x, y, z] });
    }
    shape
}

/// An octahedron whose triangles are split into four `subdivisions` times: 8 * 4^subdivisions triangles.
pub(crate) fn sphere(radius: f64, subdivisions: u32) -> Shape {
    subdivided(octahedron(1.0), subdivisions, radius)
}

/// An icosahedron whose triangles are split into four `subdivisions` times: 20 * 4^subdivisions triangles.
pub(crate) fn icosphere(radius: f64, subdivisions: u32) -> Shape {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut shape = Shape::default();
    for (axis, one, long) in (0..12).map(|i| (i / 4, sign(i & 1), golden * sign(i >> 1 & 1))) {
        let mut p = DVec3::ZERO;
        (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (one, long);
        let direction = p.normalize();
        shape.vertex(direction, direction, longitude_latitude(direction));
    }
    shape.triangles = hull_of_icosahedron(&shape.positions);
    subdivided(shape, subdivisions, radius)
}

fn sign(bit: usize) -> f64 {
    if bit == 0 { 1.0 } else { -1.0 }
}

/// The 20 triples of neighbours among 12 unit vectors, counter-clockwise seen from outside.
fn hull_of_icosahedron(corners: &[DVec3]) -> Vec<[u32; 3]> {
    let near = |a: usize, b: usize| corners[a].dot(corners[b]) > 0.4;
    let mut triangles = Vec::with_capacity(20);
    for a in 0..12 {
        for b in (a + 1..12).filter(|&b| near(a, b)) {
            for c in (b + 1..12).filter(|&c| near(a, c) && near(b, c)) {
                let outward = corners[a].dot(corners[b].cross(corners[c])) > 0.0;
                triangles.push(if outward { [a, b, c] } else { [a, c, b] }.map(|v| v as u32));
            }
        }
    }
    triangles
}

fn subdivided(mut shape: Shape, subdivisions: u32, radius: f64) -> Shape {
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        for [a, b, c] in std::mem::take(&mut shape.triangles) {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|edge| middle(&mut shape, &mut middles, edge));
            shape.triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
    }
    shape.positions.iter_mut().zip(&shape.normals).for_each(|(p, n)| *p = radius * *n);
    shape
}

/// The vertex at the middle of an edge, on the unit sphere.
fn middle(shape: &mut Shape, middles: &mut HashMap<(u32, u32), u32>, (a, b): (u32, u32)) -> u32 {
    *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
        let direction = (shape.normals[a as usize] + shape.normals[b as usize]).normalize();
        shape.vertex(direction, direction, longitude_latitude(direction))
    })
}

fn longitude_latitude(direction: DVec3) -> DVec2 {
    dvec2(0.5 + direction.z.atan2(direction.x) / TAU, direction.y.clamp(-1.0, 1.0).acos() / PI)
}

/// An open tube along y around the origin: 2 * `sides` * `segments` triangles.
pub(crate) fn tube(radius: f64, length: f64, sides: u32, segments: u32) -> Shape {
    grid(segments, sides, |along, around| {
        let normal = dvec3((TAU * around).cos(), 0.0, -(TAU * around).sin());
        (radius * normal + dvec3(0.0, length * (along - 0.5), 0.0), normal)
    })
}

/// An open tube along a curve over 0..=1: 2 * `sides` * `segments` triangles. No tangent may be parallel to `aside`.
pub(crate) fn sweep(radius: f64, sides: u32, segments: u32, aside: DVec3, at: impl Fn(f64) -> DVec3) -> Shape {
    grid(segments, sides, |along, around| {
        let tangent = (at(along + 1e-4) - at(along - 1e-4)).normalize();
        let side = tangent.cross(aside).normalize();
        let normal = (TAU * around).cos() * side - (TAU * around).sin() * side.cross(tangent);
        (at(along) + radius * normal, normal)
    })
}

/// A tube along the (2, 3) torus knot, which fits a cube of about 6 units: 2 * `segments` * `sides` triangles.
pub(crate) fn knot(radius: f64, segments: u32, sides: u32) -> Shape {
    let center = |t: f64| {
        let (a, ring) = (TAU * t, 2.0 + (3.0 * TAU * t).cos());
        dvec3(ring * (2.0 * a).cos(), ring * (2.0 * a).sin(), (3.0 * a).sin())
    };
    sweep(radius, sides, segments, DVec3::Z, center)
}

/// A rectangular grid deformed by `at`, which returns position and normal for two coordinates in 0..=1.
fn grid(rows: u32, columns: u32, at: impl Fn(f64, f64) -> (DVec3, DVec3)) -> Shape {
    let mut shape = Shape::default();
    for (row, column) in (0..=rows).flat_map(|r| (0..=columns).map(move |c| (r, c))) {
        let (u, v) = (f64::from(row) / f64::from(rows), f64::from(column) / f64::from(columns));
        let (position, normal) = at(u, v);
        shape.vertex(position, normal, dvec2(v, u));
    }
    for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
        let here = row * (columns + 1) + column;
        let above = here + columns + 1;
        shape.triangles.extend([[here, here + 1, above + 1], [here, above + 1, above]]);
    }
    shape
}
