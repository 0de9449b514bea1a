//! Numbers that are not finite, and negative zeros.

use glam::{DVec2, DVec3};
use raykiln_formats::unchecked::{File, list, numbers};

use super::shapes::{boxes, show_boxes};
use super::{Case, Outcome};
use crate::verify::random::Random;

const LEFT_OUT: Outcome = Outcome::Dropped("triangles with a corner that is not finite are left out");
const NOT_JSON: Outcome = Outcome::Refused("JSON: expected value");

pub(super) const CASES: &[Case] = &[
    Case::new("nan-positions", "a corner that is NaN", LEFT_OUT, |file, random| position(file, random, f64::NAN)),
    Case::new("infinite-positions", "a corner that is infinite", LEFT_OUT, |file, random| {
        position(file, random, f64::INFINITY)
    }),
    Case::new("negative-zero-positions", "coordinates that are -0", Outcome::Exact, |file, random| {
        position(file, random, -0.0)
    }),
    Case::new("nan-normals", "normals that are NaN", Outcome::Exact, |file, random| normals(file, random, f64::NAN)),
    Case::new("infinite-normals", "normals that are infinite", Outcome::Exact, |file, random| {
        normals(file, random, f64::INFINITY)
    }),
    Case::new("negative-zero-normals", "normals that are -0", Outcome::Exact, |file, random| {
        normals(file, random, -0.0)
    }),
    Case::new("nan-texcoords", "texture coordinates that are NaN", Outcome::Exact, |file, random| {
        texcoords(file, random, f64::NAN)
    }),
    Case::new("infinite-texcoords", "texture coordinates that are infinite", Outcome::Exact, |file, random| {
        texcoords(file, random, f64::INFINITY)
    }),
    Case::new("negative-zero-texcoords", "texture coordinates that are -0", Outcome::Exact, |file, random| {
        texcoords(file, random, -0.0)
    }),
    Case::new("nan-matrix", "a matrix with `NaN`, which is not JSON", NOT_JSON, |file, random| {
        matrix(file, random, "NaN")
    }),
    Case::new(
        "infinite-matrix",
        "a matrix with 1e999",
        Outcome::Refused("JSON: number out of range"),
        |file, random| matrix(file, random, "1e999"),
    ),
    Case::new(
        "overflowing-matrix",
        "a matrix with 1e300",
        Outcome::Refused("is beyond the range of 32-bit floats"),
        |file, random| matrix(file, random, "1e300"),
    ),
    Case::new("negative-zero-matrix", "a matrix with -0.0", Outcome::Exact, |file, random| {
        matrix(file, random, "-0.0")
    }),
    Case::new(
        "nan-copies",
        "a copy of `EXT_mesh_gpu_instancing` placed at NaN",
        Outcome::Refused("not finite"),
        copies,
    ),
];

fn position(file: &mut File, random: &mut Random, value: f64) {
    let mut shapes = boxes(random);
    shapes[0].positions[0].x = value;
    shapes[1].positions[7] = DVec3::splat(value);
    show_boxes(file, &shapes);
}

fn normals(file: &mut File, random: &mut Random, value: f64) {
    let mut shapes = boxes(random);
    shapes.iter_mut().for_each(|shape| shape.normals = vec![DVec3::splat(value); shape.positions.len()]);
    show_boxes(file, &shapes);
}

fn texcoords(file: &mut File, random: &mut Random, value: f64) {
    let mut shapes = boxes(random);
    shapes.iter_mut().for_each(|shape| shape.texcoords = vec![DVec2::splat(value); shape.positions.len()]);
    show_boxes(file, &shapes);
}

/// Boxes, of which the first has a matrix with this number in its first row.
fn matrix(file: &mut File, random: &mut Random, number: &str) {
    let nodes = show_boxes(file, &boxes(random));
    let [one, zero] = ["1", "0"];
    let columns =
        [[one, zero, zero, zero], [number, one, zero, zero], [zero, zero, one, zero], [zero, zero, zero, one]];
    file.set("nodes", nodes[0], "matrix", list(columns.as_flattened()));
}

fn copies(file: &mut File, random: &mut Random) {
    let nodes = show_boxes(file, &boxes(random));
    let accessor = file.floats("VEC3", [0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0]);
    let copies = format!(r#"{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{accessor}}}}}}}"#);
    file.set("nodes", nodes[0], "extensions", copies);
    file.set("nodes", nodes[0], "translation", numbers([0.0; 3]));
    file.set_root("extensionsUsed", list([r#""EXT_mesh_gpu_instancing""#]));
}
