//! Where the scenes of an experiment stand, and scenes made for it.

use std::fmt::Write;

use glam::DVec3;
use raykiln_formats::read_bytes;

use crate::scene::{LoadOptions, Scene, load};

/// How a scene is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Placement {
    /// As in its file.
    AsIs,
    /// Moved by [`FAR`] diagonals of its box: a scene of 12 m then stands 12 km away.
    Far,
    /// Stretched along its axes by [`STRETCH`].
    Stretched,
}

/// Distance of scenes that are moved, in diagonals of their boxes.
const FAR: f64 = 1000.0;

/// Direction in which scenes are moved; of length one and along no axis.
const DIRECTION: DVec3 = DVec3::new(0.8, 0.36, -0.48);

/// Factors along the axes: a million to one.
const STRETCH: DVec3 = DVec3::new(1e3, 1.0, 1e-3);

impl Placement {
    pub(super) const ALL: [Placement; 3] = [Placement::AsIs, Placement::Far, Placement::Stretched];

    /// Returns the name in configurations and tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Placement::AsIs => "as-is",
            Placement::Far => "far",
            Placement::Stretched => "stretched",
        }
    }

    /// Returns a scene placed so; it shares all meshes.
    pub(super) fn place(self, scene: &Scene) -> Scene {
        match self {
            Placement::AsIs => scene.clone(),
            Placement::Far => scene.translated(FAR * scene.bounds().diagonal() * DIRECTION),
            Placement::Stretched => scene.stretched(STRETCH),
        }
    }
}

/// A scene that is made instead of read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Generated {
    /// A closed torus in four sectors, each an object: a tube of radius 1 around a circle of radius 3, turned so that
    /// its edges lie along no axis.
    Torus,
}

/// Quadrilaterals around the circle of the torus and around its tube.
const TORUS: [u32; 2] = [96, 48];
const SECTORS: u32 = 4;

impl Generated {
    pub(super) const ALL: [Generated; 1] = [Generated::Torus];

    /// Returns the name in configurations and tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Generated::Torus => "torus",
        }
    }

    /// Returns the scene.
    pub(super) fn scene(self) -> Scene {
        let text = match self {
            Generated::Torus => torus(),
        };
        let document = read_bytes(format!("{}.obj", self.name()), text.into_bytes()).expect("a sound OBJ file");
        load(&document, &LoadOptions::default()).expect("a sound scene").0
    }
}

/// Returns the torus as an OBJ file. Coordinates are multiples of 2^-12, so that reading rounds nothing.
fn torus() -> String {
    let [around, across] = TORUS;
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let [x, y, z] = [DVec3::new(0.8, 0.36, 0.48), DVec3::new(-0.6, 0.48, 0.64), DVec3::new(0.0, -0.8, 0.6)];
    let mut text = String::new();
    for (i, j) in (0..around).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let ((sin, cos), (up, out)) = (turn(i, around).sin_cos(), turn(j, across).sin_cos());
        let p = (3.0 + out) * cos * x + up * y + (3.0 + out) * sin * z;
        let [x, y, z] = p.to_array().map(|x| (x * 4096.0).round() / 4096.0);
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    let at = |i: u32, j: u32| 1 + (i % around) * across + j % across;
    for i in 0..around {
        if i % (around / SECTORS) == 0 {
            let _ = writeln!(text, "o sector {}", i * SECTORS / around);
        }
        for j in 0..across {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)];
            let _ = writeln!(text, "f {a} {b} {c}\nf {c} {b} {d}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_torus_is_closed_and_of_several_objects() {
        let torus = Generated::Torus.scene();
        assert_eq!((torus.objects(), torus.triangles_placed()), (4, 2 * 96 * 48));
        let mut sides = std::collections::BTreeMap::<[[u64; 3]; 2], i32>::new();
        for instance in 0..torus.instances.len() as u32 {
            for triangle in 0..torus.meshes[torus.instances[instance as usize].mesh.0 as usize].triangle_count() as u32
            {
                let corners = torus.world_corners(crate::scene::TriangleRef { instance, triangle });
                let key = corners.map(|p| p.to_array().map(f64::to_bits));
                for [a, b] in [[key[0], key[1]], [key[1], key[2]], [key[2], key[0]]] {
                    let (side, way) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
                    *sides.entry(side).or_default() += way;
                }
            }
        }
        assert!(sides.len() == 3 * 96 * 48 && sides.values().all(|&ways| ways == 0));
    }

    #[test]
    fn placements_move_and_stretch() {
        let torus = Generated::Torus.scene();
        let [near, far, stretched] = Placement::ALL.map(|placement| placement.place(&torus).bounds());
        assert_eq!(near, torus.bounds());
        let moved = far.center().distance(near.center()) / near.diagonal();
        assert!((moved - FAR).abs() < 1e-6, "{moved}");
        let ratio = stretched.size() / near.size();
        assert!((ratio - STRETCH).abs().max_element() < 1e-9, "{ratio}");
    }
}
