//! Realistic scenes: a furnished room, and a town under a sky.

use crate::Request;
use crate::random::Random;
use crate::scenes::palette;
use crate::shapes::{Shape, cube, cuboid, sphere, sweep, tube};
use crate::writer::Writer;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use std::f64::consts::TAU;
use std::io;
use std::path::Path;

/// Width, height and depth of the room.
const ROOM: DVec3 = dvec3(24.0, 6.0, 16.0);

/// An axis-aligned room with furniture at arbitrary angles, cables and railings.
pub(crate) fn mixed(out: &Path, request: &Request) -> io::Result<()> {
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let materials = palette(&mut writer);
    let paint = |i: usize| Some(materials[i % materials.len()]);
    writer.object("shell", &shell(), paint(0))?;
    writer.object("tiles", &tiles(), paint(1))?;
    writer.object("panels", &panels(), paint(2))?;
    for i in 0..request.count.unwrap_or(90) {
        let piece = [chair, table, shelf][i % 3](&mut random);
        let tilt = if i % 8 == 7 { random.rotation() } else { DQuat::from_rotation_y(random.between(0.0, TAU)) };
        let lift = if i % 8 == 7 { 1.0 } else { 0.0 };
        let at = dvec3(random.between(-10.5, 10.5), lift, random.between(-6.5, 6.5));
        let piece = piece.placed(DAffine3::from_rotation_translation(tilt, at));
        writer.object(&format!("furniture {i}"), &piece, paint(3 + i % 3))?;
    }
    for i in 0..40 {
        writer.object(&format!("cable {i}"), &cable(&mut random), paint(6))?;
    }
    for i in 0..8 {
        let turn = DQuat::from_rotation_y(TAU * (i as f64 + 0.3) / 8.0);
        let place = DAffine3::from_rotation_translation(turn, turn * dvec3(0.0, 0.0, 5.0));
        writer.object(&format!("railing {i}"), &railing(4.0, 60).placed(place), paint(7))?;
    }
    writer.finish(None)
}

fn shell() -> Shape {
    cuboid(ROOM).at(0.0, 0.5 * ROOM.y, 0.0)
}

/// Floor tiles with gaps between them.
fn tiles() -> Shape {
    let (columns, rows) = (48, 32);
    let tile = cuboid(dvec3(0.48, 0.02, 0.48));
    let centre = |i: u32, n: u32| 0.5 * (f64::from(i) + 0.5 - 0.5 * f64::from(n));
    (0..columns * rows).fold(Shape::default(), |floor, i| {
        floor.and(&tile.clone().at(centre(i % columns, columns), 0.01, centre(i / columns, rows)))
    })
}

/// Panels along the long walls and beams under the ceiling.
fn panels() -> Shape {
    let (panel, beam) = (cuboid(dvec3(0.9, 2.4, 0.06)), cuboid(dvec3(0.2, 0.3, ROOM.z - 0.1)));
    (0..24).fold(Shape::default(), |walls, i| {
        let x = f64::from(i) + 0.5 - 0.5 * ROOM.x;
        let row = (0..2).fold(walls, |walls, storey| {
            let y = 1.4 + 2.6 * f64::from(storey);
            walls.and(&panel.clone().at(x, y, 0.48 * ROOM.z)).and(&panel.clone().at(x, y, -0.48 * ROOM.z))
        });
        row.and(&beam.clone().at(x, ROOM.y - 0.2, 0.0))
    })
}

fn leg(height: f64) -> Shape {
    tube(0.03, height, 12, 4).at(0.0, 0.5 * height, 0.0)
}

/// Adds a copy of `part` at each of four corners.
fn at_corners(shape: Shape, part: &Shape, x: f64, z: f64) -> Shape {
    [(x, z), (-x, z), (x, -z), (-x, -z)].iter().fold(shape, |s, &(x, z)| s.and(&part.clone().at(x, 0.0, z)))
}

/// Four legs, a seat, and a back of slats between two posts.
fn chair(random: &mut Random) -> Shape {
    let (w, h) = (random.between(0.2, 0.28), random.between(0.4, 0.5));
    let seat = cuboid(dvec3(2.0 * w, 0.04, 2.0 * w)).at(0.0, h, 0.0);
    let chair = at_corners(seat, &leg(h), 0.9 * w, 0.9 * w);
    let post = tube(0.02, 0.5, 12, 4).and(&sphere(0.03, 2).at(0.0, 0.25, 0.0)).at(0.0, h + 0.25, -0.9 * w);
    let chair = chair.and(&post.clone().at(0.9 * w, 0.0, 0.0)).and(&post.at(-0.9 * w, 0.0, 0.0));
    (0..8).fold(chair, |chair, i| {
        chair.and(&cuboid(dvec3(1.7 * w, 0.03, 0.01)).at(0.0, h + 0.08 + 0.05 * f64::from(i), -0.9 * w))
    })
}

/// Four legs, planks, and objects on top.
fn table(random: &mut Random) -> Shape {
    let (x, z, h) = (random.between(0.5, 0.9), random.between(0.35, 0.5), random.between(0.7, 0.8));
    let planks = (0..10).fold(Shape::default(), |top, i| {
        top.and(&cuboid(dvec3(2.0 * x, 0.03, 0.18 * z)).at(0.0, h, 0.2 * z * (f64::from(i) - 4.5)))
    });
    let table = at_corners(planks, &leg(h), 0.9 * x, 0.9 * z);
    (0..8).fold(table, |table, i| {
        let at = dvec3(random.between(-0.8, 0.8) * x, h + 0.06, random.between(-0.8, 0.8) * z);
        let thing = if i % 2 == 0 { sphere(0.05, 2) } else { cuboid(dvec3(0.2, 0.05, 0.15)) };
        let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_y(random.between(0.0, TAU)), at);
        table.and(&thing.placed(turned))
    })
}

/// Two sides, boards, and books on them.
fn shelf(random: &mut Random) -> Shape {
    let sides = cuboid(dvec3(0.03, 1.8, 0.3));
    let frame = sides.clone().at(0.5, 0.9, 0.0).and(&sides.at(-0.5, 0.9, 0.0));
    (0..6).fold(frame, |shelf, board| {
        let y = 0.05 + 0.34 * f64::from(board);
        let shelf = shelf.and(&cuboid(dvec3(1.0, 0.02, 0.3)).at(0.0, y, 0.0));
        (0..16).fold(shelf, |shelf, book| {
            let tall = random.between(0.18, 0.3);
            let x = -0.45 + 0.06 * f64::from(book);
            shelf.and(&cuboid(dvec3(random.between(0.02, 0.055), tall, 0.22)).at(x, y + 0.5 * tall, 0.0))
        })
    })
}

/// A sagging and swaying cable from wall to wall.
fn cable(random: &mut Random) -> Shape {
    let end = |random: &mut Random, side: f64| {
        dvec3(side * 0.48 * ROOM.x, random.between(3.5, 5.5), random.between(-0.45, 0.45) * ROOM.z)
    };
    let (a, b) = (end(random, -1.0), end(random, 1.0));
    let (sag, sway, turns) = (random.between(0.5, 2.5), random.between(0.1, 0.5), random.between(1.0, 4.0));
    let at = |t: f64| {
        let hang = dvec3(0.0, -4.0 * sag * t * (1.0 - t), sway * (TAU * turns * t).sin());
        a + t * (b - a) + hang
    };
    sweep(0.015, 6, 120, DVec3::Y, at)
}

/// Balusters and two rails along x.
fn railing(length: f64, balusters: u32) -> Shape {
    let rail = cuboid(dvec3(length, 0.05, 0.08));
    let rails = rail.clone().at(0.0, 1.0, 0.0).and(&rail.at(0.0, 0.1, 0.0));
    (0..balusters).fold(rails, |railing, i| {
        let x = length * ((f64::from(i) + 0.5) / f64::from(balusters) - 0.5);
        railing.and(&tube(0.012, 0.9, 10, 3).at(x, 0.55, 0.0))
    })
}

/// Half the width of the town.
const TOWN: f64 = 100.0;

/// A town of houses and trees inside a sky dome, and one object at a distance of a hundred times the town's width.
pub(crate) fn enclosed(out: &Path, request: &Request) -> io::Result<()> {
    let mut random = Random::new(request.seed);
    let mut writer = Writer::create(out)?;
    let materials = palette(&mut writer);
    let paint = |i: usize| Some(materials[i % materials.len()]);
    writer.object("sky dome", &sphere(3.0 * TOWN, 2), paint(0))?;
    writer.object("ground", &cuboid(dvec3(2.0 * TOWN, 0.5, 2.0 * TOWN)).at(0.0, -0.25, 0.0), paint(1))?;
    for i in 0..request.count.unwrap_or(2_000) {
        let (name, thing) = if i % 2 == 0 { ("house", house(&mut random)) } else { ("tree", tree(&mut random)) };
        let at = dvec3(random.between(-0.95, 0.95) * TOWN, 0.0, random.between(-0.95, 0.95) * TOWN);
        let turn = DQuat::from_rotation_y(random.between(0.0, TAU));
        let thing = thing.placed(DAffine3::from_rotation_translation(turn, at));
        writer.object(&format!("{name} {i}"), &thing, paint(2 + i % 6))?;
    }
    writer.object("far cube", &cube(TOWN).at(200.0 * TOWN, 20.0 * TOWN, 0.0), paint(0))?;
    writer.finish(None)
}

/// Walls, a roof of two slopes, windows and a chimney.
fn house(random: &mut Random) -> Shape {
    let (w, h, d) = (random.between(3.0, 6.0), random.between(2.5, 6.0), random.between(3.0, 5.0));
    let slope = |side: f64| {
        let turn = DQuat::from_rotation_x(side * 0.6);
        let at = dvec3(0.0, h + 0.25 * d, side * 0.28 * d);
        cuboid(dvec3(1.1 * w, 0.1, 0.75 * d)).placed(DAffine3::from_rotation_translation(turn, at))
    };
    let walls = cuboid(dvec3(w, h, d)).at(0.0, 0.5 * h, 0.0).and(&slope(1.0)).and(&slope(-1.0));
    let walls = walls.and(&cuboid(dvec3(0.5, 1.5, 0.5)).at(0.3 * w, h + 0.4 * d, 0.2 * d));
    let window = cuboid(dvec3(0.12 * w, 0.2 * h, 0.1));
    (0..8).fold(walls, |walls, i| {
        let x = w * (0.22 * f64::from(i % 4) - 0.33);
        walls.and(&window.clone().at(x, 0.6 * h, if i < 4 { 0.5 * d } else { -0.5 * d }))
    })
}

/// A trunk and a ball of leaves.
fn tree(random: &mut Random) -> Shape {
    let (h, r) = (random.between(2.0, 4.0), random.between(1.0, 2.0));
    tube(0.2, h, 8, 2).at(0.0, 0.5 * h, 0.0).and(&sphere(r, 2).at(0.0, h + 0.7 * r, 0.0))
}
