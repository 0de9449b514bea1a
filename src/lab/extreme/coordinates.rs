//! Very large, very small and very distant coordinates.

use glam::{DVec3, dvec3};
use raykiln_formats::unchecked::{File, numbers};

use super::shapes::{boxes, cuboid, mapped, show_boxes};
use super::{Case, Outcome};
use crate::verify::random::Random;

pub(super) const CASES: &[Case] = &[
    Case::new("huge-coordinates", "coordinates around 1e30", Outcome::Exact, |file, random| scaled(file, random, 1e30)),
    Case::new("tiny-coordinates", "coordinates around 1e-30", Outcome::Exact, |file, random| {
        scaled(file, random, 1e-30)
    }),
    Case::new(
        "denormal-coordinates",
        "coordinates around 1e-40, which 32-bit floats hold with few digits",
        Outcome::Exact,
        |file, random| scaled(file, random, 1e-40),
    ),
    Case::new("tiny-beside-huge", "an object of 1e-6 beside one of 1e6", Outcome::CannotTell, tiny_beside_huge),
    Case::new(
        "vertices-at-8e6",
        "objects of one unit around 8e6, where 32-bit floats are 0.5 apart",
        Outcome::CannotTell,
        |file, random| at(file, random, 8e6),
    ),
    Case::new(
        "nodes-at-8e6",
        "objects of one unit, which their nodes place around 8e6",
        Outcome::CannotTell,
        |file, random| placed_at(file, random, 8e6),
    ),
    Case::new(
        "vertices-at-1e11",
        "objects of one unit around 1e11, where 32-bit floats are 8192 apart",
        Outcome::CannotTell,
        |file, random| at(file, random, 1e11),
    ),
    Case::new(
        "nodes-at-1e11",
        "objects of one unit, which their nodes place around 1e11",
        Outcome::CannotTell,
        |file, random| placed_at(file, random, 1e11),
    ),
    Case::new(
        "one-object-1e11-away",
        "eight objects of one unit, and one 1e11 away",
        Outcome::CannotTell,
        one_far_away,
    ),
];

fn scaled(file: &mut File, random: &mut Random, by: f64) {
    let shapes: Vec<_> = boxes(random).into_iter().map(|shape| mapped(shape, |p| p * by)).collect();
    show_boxes(file, &shapes);
}

fn tiny_beside_huge(file: &mut File, _: &mut Random) {
    let huge = cuboid(DVec3::ZERO, DVec3::splat(5e5));
    let tiny = cuboid(DVec3::ZERO, DVec3::splat(5e-7));
    let nodes = show_boxes(file, &[huge, tiny]);
    file.set("nodes", nodes[1], "translation", numbers([5e5 + 1.0, 0.0, 0.0]));
}

fn at(file: &mut File, random: &mut Random, offset: f64) {
    let shapes: Vec<_> = boxes(random).into_iter().map(|shape| mapped(shape, |p| p + offset)).collect();
    show_boxes(file, &shapes);
}

fn placed_at(file: &mut File, random: &mut Random, offset: f64) {
    for node in show_boxes(file, &boxes(random)) {
        file.set("nodes", node, "translation", numbers([offset; 3]));
    }
}

fn one_far_away(file: &mut File, random: &mut Random) {
    let mut shapes = boxes(random);
    shapes.push(cuboid(DVec3::ZERO, DVec3::ONE));
    let nodes = show_boxes(file, &shapes);
    file.set("nodes", nodes[8], "translation", numbers(dvec3(1e11, 0.0, 0.0).to_array()));
}
