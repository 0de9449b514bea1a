//! Areas of the triangles of each geometry, computed once for several rules.

use glam::DVec3;
use rayon::prelude::*;

use crate::parallel;
use crate::scene::{Geometry, Scene};

/// A triangle is a needle if it covers less of the surface area of its box, both sides counted. An axis-aligned right
/// triangle covers 0.5, an equilateral one 0.14 to 0.43; a diagonal one of ratio n:1 covers about 1 / (2n).
pub(super) const NEEDLE: f64 = 0.02;

/// Triangles per task.
const CHUNK: usize = 1 << 14;

/// Sums over the triangles of a geometry, in mesh coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Areas {
    /// Surface area of all triangles, one side.
    pub(super) area: f64,
    /// Triangles without an area.
    pub(super) flat: u64,
    /// Triangles that are needles.
    pub(super) needles: u64,
    /// Sum over the needles of the share of their box's surface area that they cover.
    pub(super) covered: f64,
    /// The least of these shares; infinite without needles.
    pub(super) least_covered: f64,
    /// Sum over the needles of the surface area of their boxes that they do not cover.
    pub(super) empty: f64,
}

/// The areas of all geometries, by mesh.
pub(super) struct Shapes(Vec<Vec<Areas>>);

impl Shapes {
    pub(super) fn of(scene: &Scene) -> Shapes {
        Shapes(parallel::map(scene.meshes.len(), &|m| scene.meshes[m].geometries.iter().map(Areas::of).collect()))
    }

    /// The areas of the geometries of a mesh.
    pub(super) fn of_mesh(&self, mesh: usize) -> &[Areas] {
        &self.0[mesh]
    }

    /// The areas of the geometries of each mesh.
    pub(super) fn meshes(&self) -> impl Iterator<Item = &[Areas]> {
        self.0.iter().map(Vec::as_slice)
    }
}

impl Areas {
    const NONE: Areas =
        Areas { area: 0.0, flat: 0, needles: 0, covered: 0.0, least_covered: f64::INFINITY, empty: 0.0 };

    fn of(geometry: &Geometry) -> Areas {
        let of_chunk = |(chunk, triangles): (usize, &[[u32; 3]])| {
            let corners = (chunk * CHUNK..).take(triangles.len()).map(|t| geometry.corners(t));
            corners.fold(Areas::NONE, |sum, corners| sum.and(&Areas::of_triangle(corners.map(|p| p.as_dvec3()))))
        };
        // Collected in order: sums round alike for any number of threads.
        let chunks: Vec<Areas> = geometry.triangles.par_chunks(CHUNK).enumerate().map(of_chunk).collect();
        chunks.iter().fold(Areas::NONE, |sum, chunk| sum.and(chunk))
    }

    fn of_triangle([a, b, c]: [DVec3; 3]) -> Areas {
        let normal = (b - a).cross(c - a);
        if normal == DVec3::ZERO {
            return Areas { flat: 1, ..Areas::NONE };
        }
        let both_sides = normal.length();
        let size = a.max(b).max(c) - a.min(b).min(c);
        let around = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let covered = both_sides / around;
        let one = Areas { area: 0.5 * both_sides, ..Areas::NONE };
        if covered >= NEEDLE {
            return one;
        }
        Areas { needles: 1, covered, least_covered: covered, empty: around - both_sides, ..one }
    }

    pub(super) fn and(&self, other: &Areas) -> Areas {
        Areas {
            area: self.area + other.area,
            flat: self.flat + other.flat,
            needles: self.needles + other.needles,
            covered: self.covered + other.covered,
            least_covered: self.least_covered.min(other.least_covered),
            empty: self.empty + other.empty,
        }
    }

    /// The sums over several geometries.
    pub(super) fn sum(areas: &[Areas]) -> Areas {
        areas.iter().fold(Areas::NONE, |sum, one| sum.and(one))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn only_diagonal_thin_triangles_are_needles() {
        let right = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert_eq!(Areas::of_triangle(right), Areas { area: 0.5, ..Areas::NONE });
        let along_an_axis = [DVec3::ZERO, dvec3(100.0, 0.0, 0.0), dvec3(100.0, 0.1, 0.0)];
        assert_eq!(Areas::of_triangle(along_an_axis).needles, 0);
        let diagonal = [DVec3::ZERO, dvec3(100.0, 100.0, 0.0), dvec3(100.0, 100.1, 0.0)];
        let areas = Areas::of_triangle(diagonal);
        assert_eq!(areas.needles, 1);
        assert!((areas.least_covered - 10.0 / 20_020.0).abs() < 1e-9, "{areas:?}");
        assert_eq!(Areas::of_triangle([DVec3::ZERO, DVec3::X, 2.0 * DVec3::X]).flat, 1);
    }
}
