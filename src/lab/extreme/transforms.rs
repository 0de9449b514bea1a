//! Transforms that lose volume, precision or their meaning.

use glam::{DMat3, DMat4, DVec3, dvec3};
use raykiln_formats::unchecked::{File, list, numbers};

use super::shapes::{boxes, cuboid, show_boxes};
use super::{Case, Outcome};
use crate::verify::random::Random;

pub(super) const CASES: &[Case] = &[
    Case::new(
        "singular",
        "a matrix that flattens an object, beside seven others",
        Outcome::CannotTell,
        |file, random| with_matrix(file, random, DMat3::from_diagonal(dvec3(1.0, 0.0, 1.0))),
    ),
    Case::new("all-singular", "all objects are flattened into one plane", Outcome::CannotTell, |file, random| {
        let nodes = show_boxes(file, &boxes(random));
        nodes.into_iter().for_each(|node| set_matrix(file, node, DMat3::from_diagonal(dvec3(1.0, 0.0, 1.0))));
    }),
    Case::new("zero-matrix", "a matrix that maps an object to one point", Outcome::Exact, |file, random| {
        with_matrix(file, random, DMat3::ZERO)
    }),
    Case::new("nearly-singular", "a matrix of condition 1e8", Outcome::Bounded, |file, random| {
        with_matrix(file, random, DMat3::from_diagonal(dvec3(1.0, 1e-8, 1.0)))
    }),
    Case::new("mirrored", "mirrored objects", Outcome::Exact, |file, random| {
        let nodes = show_boxes(file, &boxes(random));
        nodes.into_iter().step_by(2).for_each(|node| file.set("nodes", node, "scale", numbers([-1.0, 1.0, 1.0])));
    }),
    Case::new("sheared", "a matrix that shears a hundredfold", Outcome::Bounded, |file, random| {
        with_matrix(file, random, DMat3::from_cols(DVec3::X, dvec3(100.0, 1.0, 0.0), dvec3(0.0, 30.0, 1.0)))
    }),
    Case::new(
        "scaled-1e6-to-1",
        "a matrix that scales by 1e6 along x and not along y",
        Outcome::CannotTell,
        |file, random| with_matrix(file, random, DMat3::from_diagonal(dvec3(1e6, 1.0, 1.0))),
    ),
    Case::new("unnormalised-quaternion", "quaternions of length 1e-20 to 1e20", Outcome::Bounded, unnormalised),
    Case::new(
        "zero-quaternion",
        "a quaternion of length zero",
        Outcome::Dropped("the quaternion is zero"),
        |file, random| {
            let nodes = show_boxes(file, &boxes(random));
            file.set("nodes", nodes[0], "rotation", numbers([0.0; 4]));
        },
    ),
    Case::new(
        "deep-chain",
        "a chain of 100,000 nodes, each moved by 0.001 and turned by a quarter",
        Outcome::Bounded,
        deep_chain,
    ),
    Case::new(
        "animated-through-zero",
        "an animation that scales an object from 1 through 0 to -1",
        Outcome::Exact,
        animated,
    ),
];

/// Boxes, of which a matrix places the first.
fn with_matrix(file: &mut File, random: &mut Random, matrix: DMat3) {
    let nodes = show_boxes(file, &boxes(random));
    set_matrix(file, nodes[0], matrix);
}

fn set_matrix(file: &mut File, node: usize, matrix: DMat3) {
    file.set("nodes", node, "matrix", numbers(DMat4::from_mat3(matrix).to_cols_array()));
}

fn unnormalised(file: &mut File, random: &mut Random) {
    for (i, node) in (-4..).zip(show_boxes(file, &boxes(random))) {
        let axis = random.direction() * 0.6_f64.sqrt();
        let length = 10_f64.powi(5 * i);
        let turn = [axis.x, axis.y, axis.z, 0.4_f64.sqrt()].map(|x| x * length);
        file.set("nodes", node, "rotation", numbers(turn));
    }
}

/// Number of nodes of a chain; each fourth node ends where it would without the turns.
const DEEP: usize = 100_000;

fn deep_chain(file: &mut File, _: &mut Random) {
    let mesh = file.mesh("box", &[&cuboid(DVec3::ZERO, DVec3::ONE)]);
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    for i in 0..DEEP {
        let shown = if i % 10_000 == 9_999 { format!(r#","mesh":{mesh}"#) } else { String::new() };
        let child = if i + 1 < DEEP { format!(r#","children":[{}]"#, i + 1) } else { String::new() };
        let turn = numbers([0.0, 0.0, quarter, quarter]);
        file.push("nodes", format!(r#"{{"translation":[0,0,0.001],"rotation":{turn}{shown}{child}}}"#));
    }
    file.show([0]);
}

fn animated(file: &mut File, random: &mut Random) {
    let nodes = show_boxes(file, &boxes(random));
    let times = file.floats("SCALAR", [0.0, 1.0, 2.0]);
    file.set("accessors", times, "min", list([0]));
    file.set("accessors", times, "max", list([2]));
    let scales = file.floats("VEC3", [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, -1.0]);
    let target = format!(r#"{{"node":{},"path":"scale"}}"#, nodes[0]);
    let sampler = format!(r#"{{"input":{times},"output":{scales}}}"#);
    file.push("animations", format!(r#"{{"channels":[{{"sampler":0,"target":{target}}}],"samplers":[{sampler}]}}"#));
}
