//! Frames: the rotations in which a group's triangles have the tightest boxes.
//!
//! Boxes are tight only around triangles aligned with the axes. If a building is rotated, or a pipe runs diagonally,
//! the triangles are stored in the frame of their dominant normals and longest edges, and the instance rotates them
//! back: rays then meet tight boxes. For a single box, the idea is that of bounding boxes aligned with features (S.
//! Gottschalk, M. Lin, D. Manocha, "OBBTree", SIGGRAPH 1996); one frame per group makes it work on hardware, whose
//! boxes are axis-aligned within a BLAS. Candidates are derived from the triangles and judged by refitting one tree in
//! each.

use std::borrow::Cow;

use glam::{DMat3, DVec3};

/// Number of heaviest votes that are tried as the seed of a cluster.
const SEEDS: usize = 8;

/// Directions are considered equal if the cosine of their angle exceeds this: about three degrees.
const SAME_DIRECTION: f64 = 0.9986;

/// Edges are considered perpendicular to a normal if the sine of the deviation is below this.
const ACROSS: f64 = 0.05;

/// How thoroughly to search for directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Number of dominant normals, and of dominant edges, that frames are made of.
    pub(super) directions: usize,
    /// Maximum number of triangles that vote on them.
    pub(super) voters: usize,
}

impl Search {
    /// For a whole scene.
    pub(super) const SCENE: Search = Search { directions: 3, voters: 512 };
    /// For one of very many groups.
    pub(super) const GROUP: Search = Search { directions: 1, voters: 40 };
}

/// Returns rotations worth trying for some triangles, world from group: at most three per direction searched, none
/// nearly equal to another or to the identity. Coefficients are single-precision numbers. Empty if no triangle has an
/// area.
pub(super) fn rotations<T>(
    triangles: impl ExactSizeIterator<Item = T>,
    corners: impl Fn(T) -> [DVec3; 3],
    search: Search,
) -> Vec<DMat3> {
    let votes = Votes::of(triangles, corners, search.voters);
    let normals = dominant(&votes.normals, search.directions);
    let edges = dominant(&votes.edges, search.directions);
    let mut found = Vec::new();
    for &normal in &normals {
        let across = dominant(&across(&votes.edges, normal), 1);
        let other = dominant(&across_loosely(&votes.normals, normal), 1);
        across.iter().chain(&other).for_each(|&x| push(&mut found, rotation(x, normal)));
    }
    for &edge in &edges {
        let normal = dominant(&across_loosely(&votes.normals, edge), 1);
        normal.iter().for_each(|&z| push(&mut found, rotation(edge, z)));
    }
    found
}

/// Weighted directions; signs are ignored.
type Directions = Vec<(DVec3, f64)>;

/// The votes of triangles.
struct Votes {
    /// Unit normals, weighted by area.
    normals: Directions,
    /// Unit directions of edges, weighted by length times the square root of the area: what a misaligned edge wastes.
    edges: Directions,
}

impl Votes {
    /// Collects the votes of an even sample of the triangles, skipping those without area.
    fn of<T>(triangles: impl ExactSizeIterator<Item = T>, corners: impl Fn(T) -> [DVec3; 3], voters: usize) -> Votes {
        let step = triangles.len().div_ceil(voters).max(1);
        let mut votes = Votes { normals: Vec::new(), edges: Vec::new() };
        for [a, b, c] in triangles.step_by(step).map(corners) {
            let normal = (b - a).cross(c - a);
            let area = normal.length();
            if !(area > 0.0 && area.is_finite()) {
                continue;
            }
            votes.normals.push((normal / area, area));
            for edge in [b - a, c - b, a - c] {
                let length = edge.length();
                votes.edges.push((edge / length, length * area.sqrt()));
            }
        }
        votes
    }
}

/// Returns the heaviest clusters of directions, heaviest first, each as the mean of its members. Clusters start from
/// the heaviest single votes, so that few seeds need to be tried.
fn dominant(votes: &Directions, count: usize) -> Vec<DVec3> {
    let mut left = Cow::Borrowed(votes);
    let mut found = Vec::new();
    while let Some(seed) = best_seed(&left) {
        let mut mean = seed;
        for _ in 0..2 {
            let members = left.iter().filter(|(d, _)| same(*d, mean));
            mean = members.map(|&(d, w)| d * w * d.dot(mean).signum()).sum::<DVec3>().normalize_or(mean);
        }
        found.push(mean);
        if found.len() == count {
            break;
        }
        left.to_mut().retain(|(d, _)| !same(*d, mean) && !same(*d, seed));
    }
    found
}

/// Among the heaviest votes, no two of them in the same direction, returns the one with most weight in its direction.
fn best_seed(votes: &Directions) -> Option<DVec3> {
    let mut is_tried = vec![false; votes.len()];
    let mut best = None;
    for _ in 0..SEEDS {
        let untried = votes.iter().zip(&is_tried).filter(|(_, tried)| !**tried).map(|(vote, _)| vote);
        let Some(&(seed, _)) = untried.reduce(|a, b| if b.1.total_cmp(&a.1).is_gt() { b } else { a }) else { break };
        let mut weight = 0.0;
        for ((direction, of_vote), tried) in votes.iter().zip(&mut is_tried) {
            if same(*direction, seed) {
                weight += of_vote;
                *tried = true;
            }
        }
        if best.is_none_or(|(most, _)| weight > most) {
            best = Some((weight, seed));
        }
    }
    best.map(|(_, seed)| seed)
}

fn same(a: DVec3, b: DVec3) -> bool {
    a.dot(b).abs() > SAME_DIRECTION
}

/// Returns the votes almost perpendicular to an axis, made exactly perpendicular.
fn across(votes: &Directions, axis: DVec3) -> Directions {
    projected(votes, axis, ACROSS)
}

/// Like [`across`], for all votes that are not nearly along the axis, projected onto the plane perpendicular to it.
fn across_loosely(votes: &Directions, axis: DVec3) -> Directions {
    projected(votes, axis, 0.7)
}

fn projected(votes: &Directions, axis: DVec3, most_along: f64) -> Directions {
    let lies_across = |(d, _): &&(DVec3, f64)| d.dot(axis).abs() < most_along;
    votes.iter().filter(lies_across).map(|&(d, w)| ((d - axis * d.dot(axis)).normalize_or(d), w)).collect()
}

/// Returns the rotation that maps x and z to two directions; the second is kept exactly.
fn rotation(x: DVec3, z: DVec3) -> DMat3 {
    let x = (x - z * x.dot(z)).normalize_or(z.any_orthonormal_vector());
    let m = DMat3::from_cols(x, z.cross(x), z);
    DMat3::from_cols_array(&m.to_cols_array().map(|c| f64::from(c as f32)))
}

/// Adds a rotation unless its boxes would equal those of the identity or of a rotation already present.
fn push(found: &mut Vec<DMat3>, rotation: DMat3) {
    if rotation.is_finite() && !is_alike(&DMat3::IDENTITY, &rotation) && !found.iter().any(|f| is_alike(f, &rotation)) {
        found.push(rotation);
    }
}

/// Whether two rotations have the same axes, up to order and signs.
fn is_alike(a: &DMat3, b: &DMat3) -> bool {
    let between = a.transpose() * *b;
    between.to_cols_array_2d().iter().all(|column| column.iter().any(|c| c.abs() > 0.999_999))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The twelve triangles of a box.
    fn box_triangles(size: DVec3, turned: DMat3) -> Vec<[DVec3; 3]> {
        let mut triangles = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [0.0, 1.0] {
                let corner = |a: f64, b: f64| {
                    let mut p = DVec3::ZERO;
                    (p[axis], p[u], p[v]) = (side * size[axis], a * size[u], b * size[v]);
                    turned * p
                };
                triangles.push([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)]);
                triangles.push([corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
            }
        }
        triangles
    }

    fn any_rotation() -> impl Strategy<Value = DMat3> {
        [-3.2..3.2, -3.2..3.2, -3.2..3.2].prop_map(|[x, y, z]| DMat3::from_euler(glam::EulerRot::XYZ, x, y, z))
    }

    #[test]
    fn nothing_and_degenerate_triangles_have_no_frame() {
        assert!(rotations([].into_iter(), |t| t, Search::SCENE).is_empty());
        let flat = [[DVec3::ZERO; 3], [DVec3::ZERO, DVec3::X, DVec3::X * 2.0]];
        assert!(rotations(flat.into_iter(), |t| t, Search::SCENE).is_empty());
    }

    #[test]
    fn a_box_along_the_axes_needs_no_rotation() {
        assert!(
            rotations(box_triangles(DVec3::new(1.0, 2.0, 3.0), DMat3::IDENTITY).into_iter(), |t| t, Search::GROUP)
                .is_empty()
        );
    }

    proptest! {
        #[test]
        fn a_turned_box_is_turned_back(turned in any_rotation(), size in [0.1..9.0, 0.1..9.0, 0.1..9.0]) {
            let triangles = box_triangles(DVec3::from(size), turned);
            let found = rotations(triangles.into_iter(), |t| t, Search::GROUP);
            let fits = |r: &DMat3| is_alike(r, &turned);
            prop_assert!(found.iter().any(fits) || is_alike(&DMat3::IDENTITY, &turned), "{found:?}");
        }

        #[test]
        fn rotations_are_orthonormal(corners in prop::collection::vec([-9.0..9.0, -9.0..9.0, -9.0..9.0], 3..60)) {
            let triangles: Vec<[DVec3; 3]> =
                corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(DVec3::from)).collect();
            for r in rotations(triangles.into_iter(), |t| t, Search::SCENE) {
                let off = (r.transpose() * r - DMat3::IDENTITY).to_cols_array().map(f64::abs);
                prop_assert!(off.iter().all(|x| *x < 1e-6) && r.determinant() > 0.0);
            }
        }
    }
}
