//! Triangulates polygons.
//!
//! For every polygon, the area vectors of its triangles add up to its own (half the sum of `p[i] x p[i + 1]`: M. Newell
//! in I. Sutherland, R. Sproull, R. Schumacker, "A Characterization of Ten Hidden-Surface Algorithms", 1974), so no
//! part is lost, doubled or flipped:
//!
//! - A triangle stays as it is, degenerate or not.
//! - A quad has two diagonals. One that flips a triangle is rejected, which leaves a concave quad its inner one. Of
//!   two, a warped quad takes that from its first corner, as most readers do, and a flat one the Delaunay diagonal
//!   (C. Lawson, "Software for C1 Surface Interpolation", 1977: it has the larger smallest angle), see [`quad`].
//! - A polygon of more corners is triangulated in its own plane, see [`outline`]. Collinear corners, repeated corners,
//!   bridges to holes and outlines that touch themselves are supported.
//! - If that is impossible (the outline crosses itself, has no plane, or is not finite), a fan from the first corner,
//!   which keeps the area vector too, and [`Outcome::Fan`] says so.

use glam::DVec3;

mod outline;

/// How a polygon was triangulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Without overlap.
    Whole,
    /// As a fan, because the outline crosses itself or has no plane.
    Fan,
}

/// Height over diagonal above which a quad counts as warped: its two diagonals then differ in area by a millionth.
const WARPED: f64 = 1e-3;

/// Appends triangles (indices of corners) for the polygon with these corners; fewer than three corners give none.
pub(super) fn triangulate(corners: &[DVec3], out: &mut Vec<[usize; 3]>) -> Outcome {
    match corners.len() {
        0..=2 => Outcome::Whole,
        3 => {
            out.push([0, 1, 2]);
            Outcome::Whole
        }
        4 => quad([corners[0], corners[1], corners[2], corners[3]], out),
        count => match outline::triangulate(corners) {
            Some(triangles) => {
                out.extend(triangles);
                Outcome::Whole
            }
            None => {
                out.extend((2..count).map(|i| [0, i - 1, i]));
                Outcome::Fan
            }
        },
    }
}

/// Splits a quad along one of its diagonals.
fn quad(p: [DVec3; 4], out: &mut Vec<[usize; 3]>) -> Outcome {
    const FROM_FIRST: [[usize; 3]; 2] = [[0, 1, 2], [0, 2, 3]];
    const FROM_SECOND: [[usize; 3]; 2] = [[0, 1, 3], [1, 2, 3]];
    let area = area_vector(&p);
    let upright = |split: [[usize; 3]; 2]| {
        split.iter().all(|&[a, b, c]| (p[b] - p[a]).cross(p[c] - p[a]).dot(area) >= -1e-12 * area.length_squared())
    };
    let (first, second) = (upright(FROM_FIRST), upright(FROM_SECOND));
    let takes_second = second && (!first || (!is_warped(&p) && second_is_delaunay(&p)));
    out.extend(if takes_second { FROM_SECOND } else { FROM_FIRST });
    let has_plane = area.length_squared() > 0.0 || !area.is_finite() || is_point_or_line(&p);
    if has_plane && (first || second || !area.is_finite()) { Outcome::Whole } else { Outcome::Fan }
}

/// Returns half the sum of the cross products of neighbouring corners.
fn area_vector(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    let pairs = corners.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin));
    pairs.sum::<DVec3>() * 0.5
}

fn is_point_or_line(p: &[DVec3; 4]) -> bool {
    [[0, 1, 2], [0, 2, 3], [0, 1, 3]].iter().all(|&[a, b, c]| (p[b] - p[a]).cross(p[c] - p[a]) == DVec3::ZERO)
}

fn is_warped(p: &[DVec3; 4]) -> bool {
    let (d, e) = (p[2] - p[0], p[3] - p[1]);
    let normal = d.cross(e);
    // The distance between the diagonals, as lines, measures how far the quad is from planar.
    let height = normal.dot(p[1] - p[0]).abs();
    height > WARPED * normal.length() * d.length().max(e.length())
}

/// Whether the angles at the second and fourth corner, opposite the first diagonal, add up to more than half a turn
/// beyond rounding.
fn second_is_delaunay(p: &[DVec3; 4]) -> bool {
    let angle = |at: usize, a: usize, b: usize| {
        let (u, v) = (p[a] - p[at], p[b] - p[at]);
        (u.cross(v).length(), u.dot(v))
    };
    let ((sin_a, cos_a), (sin_b, cos_b)) = (angle(1, 0, 2), angle(3, 2, 0));
    let scale = sin_a.hypot(cos_a) * sin_b.hypot(cos_b);
    sin_a * cos_b + cos_a * sin_b < -1e-6 * scale
}
