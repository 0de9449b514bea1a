//! Triangles without area, in large numbers, or in unfortunate places.

use glam::{DVec3, dvec3};
use raykiln_formats::unchecked::{File, Shape};

use super::shapes::{ball, boxes, cuboid, show_boxes};
use super::{Case, Outcome};
use crate::verify::random::Random;

pub(super) const CASES: &[Case] = &[
    Case::new("slivers", "triangles 1e7 times as long as wide", Outcome::Exact, slivers),
    Case::new("zero-area", "triangles with two corners in one place", Outcome::Exact, |file, random| {
        with_flat(file, random, |p, u, _| [p, p + u, p + u])
    }),
    Case::new("collinear", "triangles with all corners on one line", Outcome::Exact, |file, random| {
        with_flat(file, random, |p, u, _| [p, p + u, p + 0.5 * u])
    }),
    Case::new("repeated-index", "triangles that use a vertex twice", Outcome::Exact, repeated_index),
    Case::new("one-plane", "all triangles in one plane", Outcome::Exact, one_plane),
    Case::new("copies-of-one-triangle", "100,000 times the same triangle", Outcome::Exact, |file, _| {
        copies(file, 100_000)
    }),
    Case::new("a-million-copies-of-one-triangle", "1,000,000 times the same triangle", Outcome::Exact, |file, _| {
        copies(file, 1_000_000)
    })
    .large(),
    Case::new("through-one-point", "300 triangles through one point", Outcome::Bounded, |file, random| {
        through_one_point(file, random, 300)
    }),
    Case::new(
        "a-million-through-one-point",
        "1,000,000 triangles through one point",
        Outcome::Bounded,
        |file, random| through_one_point(file, random, 1_000_000),
    )
    .large(),
    Case::new("nested-shells", "12 spheres, one within the other", Outcome::Exact, nested_shells),
    Case::new("as-large-as-the-scene", "one triangle as large as the scene", Outcome::Bounded, large_triangle),
    Case::new("one-large-object", "one object of 20 million triangles", Outcome::Bounded, one_large_object).large(),
];

fn slivers(file: &mut File, random: &mut Random) {
    let mut shape = Shape::default();
    for _ in 0..300 {
        let (middle, along) = (random.direction(), random.direction());
        let across = along.any_orthonormal_vector() * 1e-7;
        shape.positions.extend([middle, middle + along, middle + 0.5 * along + across]);
    }
    let mut shapes = boxes(random);
    shapes.push(shape);
    show_boxes(file, &shapes);
}

/// Boxes, and between them triangles that `make` makes of a corner and two edges.
fn with_flat(file: &mut File, random: &mut Random, make: fn(DVec3, DVec3, DVec3) -> [DVec3; 3]) {
    let mut flat = Shape::default();
    for _ in 0..100 {
        let corners = make(4.0 * random.direction(), random.direction(), random.direction());
        flat.positions.extend(corners);
    }
    let mut shapes = boxes(random);
    shapes.push(flat);
    show_boxes(file, &shapes);
}

fn repeated_index(file: &mut File, random: &mut Random) {
    let mut shapes = boxes(random);
    for shape in &mut shapes {
        shape.triangles.extend([[0, 0, 1], [2, 3, 3], [5, 5, 5]]);
    }
    show_boxes(file, &shapes);
}

fn one_plane(file: &mut File, random: &mut Random) {
    let mut plates = Vec::new();
    for _ in 0..40 {
        let mut plate = Shape::default();
        let corner = dvec3(10.0 * random.unit(), 10.0 * random.unit(), 0.0);
        plate.positions.extend([DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y].map(|p| corner + p));
        plate.triangles = vec![[0, 1, 2], [0, 2, 3]];
        plates.push(plate);
    }
    show_boxes(file, &plates);
}

fn copies(file: &mut File, count: usize) {
    let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    show_boxes(file, &[Shape { positions, triangles: vec![[0, 1, 2]; count], ..Shape::default() }]);
}

fn through_one_point(file: &mut File, random: &mut Random, count: u32) {
    let mut shape = Shape { positions: vec![DVec3::ONE], ..Shape::default() };
    for i in 0..count {
        shape.positions.extend([random.direction(), random.direction()].map(|p| DVec3::ONE + p));
        shape.triangles.push([0, 2 * i + 1, 2 * i + 2]);
    }
    show_boxes(file, &[shape]);
}

fn nested_shells(file: &mut File, _: &mut Random) {
    let shells: Vec<Shape> = (1..=12).map(|i| ball(DVec3::ZERO, f64::from(i), 6)).collect();
    show_boxes(file, &shells);
}

fn large_triangle(file: &mut File, random: &mut Random) {
    let mut shapes = boxes(random);
    let corners = [dvec3(-100.0, -100.0, -80.0), dvec3(100.0, -90.0, 0.0), dvec3(0.0, 100.0, 90.0)];
    shapes.push(Shape { positions: corners.to_vec(), ..Shape::default() });
    shapes.push(cuboid(dvec3(60.0, -60.0, 0.0), DVec3::ONE));
    show_boxes(file, &shapes);
}

fn one_large_object(file: &mut File, _: &mut Random) {
    show_boxes(file, &[ball(DVec3::ZERO, 100.0, 2237)]);
}
