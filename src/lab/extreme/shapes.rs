//! Simple solids, and scenes of some of them.

use glam::{DVec3, dvec3};
use raykiln_formats::unchecked::{File, Shape};

use crate::verify::random::Random;

/// The faces of a cube whose corner `i` has the binary digits of `i` as x, y and z; counter-clockwise from outside.
const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// A closed box; `half` are half the lengths of its edges.
pub(super) fn cuboid(center: DVec3, half: DVec3) -> Shape {
    let corner = |i: u32| center + half * (dvec3((i & 1).into(), (i >> 1 & 1).into(), (i >> 2).into()) * 2.0 - 1.0);
    let triangles = FACES.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Shape { positions: (0..8).map(corner).collect(), triangles, ..Shape::default() }
}

/// A sphere of `2 * n` by `n` patches around a point.
pub(super) fn ball(center: DVec3, radius: f64, n: u32) -> Shape {
    let turns = 2 * n;
    let ring = |row: u32| std::f64::consts::PI * f64::from(row) / f64::from(n);
    let vertex = |i: u32| {
        let (across, along) = ring(i / turns).sin_cos();
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i % turns) / f64::from(turns)).sin_cos();
        center + radius * dvec3(across * cos, along, across * sin)
    };
    let patch = |i: u32| {
        let (row, column) = (i / turns, i % turns);
        let at = |r: u32, c: u32| r * turns + c % turns;
        let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
        [[a, b, c], [a, c, d]]
    };
    // At the poles, one triangle of each patch has no area.
    let is_flat = |t: &[u32; 3]| t[0].max(t[1]) < turns || t[1].min(t[2]) >= n * turns;
    let positions = (0..(n + 1) * turns).map(vertex).collect();
    let triangles = (0..n * turns).flat_map(patch).filter(|t| !is_flat(t)).collect();
    Shape { positions, triangles, ..Shape::default() }
}

/// A shape moved and scaled.
pub(super) fn mapped(shape: Shape, map: impl Fn(DVec3) -> DVec3) -> Shape {
    Shape { positions: shape.positions.into_iter().map(map).collect(), ..shape }
}

/// Eight boxes of about one unit that overlap their neighbours, in a row that is three units away from the origin.
pub(super) fn boxes(random: &mut Random) -> Vec<Shape> {
    let edge = |random: &mut Random| 0.5 + 0.3 * random.unit();
    let one = |i: u32| {
        let half = dvec3(edge(random), edge(random), edge(random));
        cuboid(dvec3(f64::from(i) - 3.5, 3.0, 0.5 * random.unit()), half)
    };
    (0..8).map(one).collect()
}

/// Adds boxes, each an object of its own, and shows them.
pub(super) fn show_boxes(file: &mut File, shapes: &[Shape]) -> Vec<usize> {
    let nodes: Vec<usize> =
        shapes.iter().enumerate().map(|(i, shape)| file.object(&format!("box {i}"), shape)).collect();
    file.show(nodes.iter().copied());
    nodes
}
