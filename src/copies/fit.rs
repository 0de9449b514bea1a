//! Fits motions to pairs of points, with coefficients as stored in files.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Coefficients of a rotation nearer than this to 0 or ±1, and scales nearer than this to 1, are replaced by that
/// value.
const SNAP: f64 = 1e-6;

/// Number of sweeps of the cyclic Jacobi method; it converges quadratically.
const SWEEPS: usize = 32;

/// Returns the similarity that maps `from` to `to` with the least squared error (B. K. P. Horn, "Closed-form solution
/// of absolute orientation using unit quaternions", 1987; the scale is the symmetric one of its section 2.E), with or
/// without mirroring. `None` if all points coincide or there are none.
pub(super) fn similarity(pairs: impl Iterator<Item = (DVec3, DVec3)> + Clone, mirrored: bool) -> Option<DAffine3> {
    let (count, from, to) =
        pairs.clone().fold((0.0, DVec3::ZERO, DVec3::ZERO), |(n, a, b), (p, q)| (n + 1.0, a + p, b + q));
    let (from, to) = (from / count, to / count);
    // A mirroring motion is a rotation after a reflection at the centre.
    let side = if mirrored { -1.0 } else { 1.0 };
    let (mut cross, mut size_from, mut size_to) = (DMat3::ZERO, 0.0, 0.0);
    for (p, q) in pairs {
        let (p, q) = (side * (p - from), q - to);
        cross += DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        size_from += p.length_squared();
        size_to += q.length_squared();
    }
    let scale = (size_to / size_from).sqrt();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let linear = DMat3::from_quat(turn(&cross)) * (side * scale);
    Some(DAffine3::from_mat3_translation(linear, to - linear * from))
}

/// Returns the rotation that best fits a cross-covariance (one column per target coordinate).
fn turn(cross: &DMat3) -> DQuat {
    let s = |from: usize, to: usize| cross.col(to)[from];
    let [x, y, z] = [0, 1, 2];
    let matrix = [
        [s(x, x) + s(y, y) + s(z, z), s(y, z) - s(z, y), s(z, x) - s(x, z), s(x, y) - s(y, x)],
        [s(y, z) - s(z, y), s(x, x) - s(y, y) - s(z, z), s(x, y) + s(y, x), s(z, x) + s(x, z)],
        [s(z, x) - s(x, z), s(x, y) + s(y, x), s(y, y) - s(x, x) - s(z, z), s(y, z) + s(z, y)],
        [s(x, y) - s(y, x), s(z, x) + s(x, z), s(y, z) + s(z, y), s(z, z) - s(x, x) - s(y, y)],
    ];
    let (_, [w, x, y, z]) = largest_eigenpair(matrix);
    let q = DQuat::from_xyzw(x, y, z, w);
    if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
}

/// Returns the largest eigenvalue of a symmetric matrix and its eigenvector (C. G. J. Jacobi, 1846, in cyclic order).
pub(super) fn largest_eigenpair<const N: usize>(mut m: [[f64; N]; N]) -> (f64, [f64; N]) {
    let mut vectors = [[0.0; N]; N];
    (0..N).for_each(|i| vectors[i][i] = 1.0);
    for _ in 0..SWEEPS {
        for p in 0..N {
            for q in p + 1..N {
                rotate(&mut m, &mut vectors, p, q);
            }
        }
    }
    let largest = (0..N).fold(0, |best, i| if m[i][i] > m[best][best] { i } else { best });
    (m[largest][largest], std::array::from_fn(|row| vectors[row][largest]))
}

/// Zeroes the element at `p`, `q`.
fn rotate<const N: usize>(m: &mut [[f64; N]; N], vectors: &mut [[f64; N]; N], p: usize, q: usize) {
    if m[p][q] == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    let s = t * c;
    for row in m.iter_mut().chain(vectors.iter_mut()) {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    let (old_p, old_q) = (m[p], m[q]);
    m[p] = std::array::from_fn(|k| c * old_p[k] - s * old_q[k]);
    m[q] = std::array::from_fn(|k| s * old_p[k] + c * old_q[k]);
}

/// Returns the largest factor by which a linear map stretches.
pub(super) fn stretch(m: &DMat3) -> f64 {
    // Scaled, so that squares neither overflow nor underflow.
    let largest = m.to_cols_array().into_iter().fold(0.0, |all: f64, c| all.max(c.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    let unit = *m * (1.0 / largest);
    let (square, _) = largest_eigenpair((unit.transpose() * unit).to_cols_array_2d());
    largest * square.max(0.0).sqrt()
}

/// Rounds the coefficients of a motion to single precision; `None` if one overflows.
pub(super) fn rounded(motion: &DAffine3) -> Option<DAffine3> {
    let coefficients = motion.to_cols_array().map(|c| f64::from(c as f32) + 0.0);
    coefficients.iter().all(|c| c.is_finite()).then(|| DAffine3::from_cols_array(&coefficients))
}

/// Replaces the rotation of a motion by a nearby one that permutes axes, if there is one, and the scale by 1 if it is
/// nearly 1; the image of `from` stays the same.
pub(super) fn snapped(motion: &DAffine3, from: DVec3) -> DAffine3 {
    let m = motion.matrix3;
    let scale = m.determinant().abs().cbrt();
    let exact_scale = if (scale - 1.0).abs() < SNAP { 1.0 } else { scale };
    let turn = (m * (1.0 / scale)).to_cols_array();
    let snap = |c: f64| [0.0, 1.0, -1.0].into_iter().find(|nice| (c - nice).abs() < SNAP);
    let nice = turn.map(snap);
    let turn = if nice.iter().all(Option::is_some) { nice.map(Option::unwrap_or_default) } else { turn };
    let linear = DMat3::from_cols_array(&turn) * exact_scale;
    DAffine3::from_mat3_translation(linear, motion.transform_point3(from) - linear * from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn points() -> Vec<DVec3> {
        (0..20).map(|i| dvec3(f64::from(i * 7 % 11), f64::from(i * 3 % 13), f64::from(i * i % 17))).collect()
    }

    #[test]
    fn a_similarity_is_found_from_pairs_of_points() {
        let turn = DAffine3::from_axis_angle(dvec3(1.0, 2.0, 3.0).normalize(), 2.5);
        for (mirrored, side) in [(false, 1.0), (true, -1.0)] {
            let motion = DAffine3::from_translation(dvec3(5.0, -6.0, 7.0))
                * turn
                * DAffine3::from_scale(dvec3(side * 3.0, 3.0, 3.0));
            let points = points();
            let pairs = points.iter().map(|&p| (p, motion.transform_point3(p)));
            let found = similarity(pairs, mirrored).expect("the points spread");
            assert!(found.abs_diff_eq(motion, 1e-12), "{found} {motion}");
        }
    }

    #[test]
    fn points_in_a_plane_on_a_line_and_in_one_place_are_no_trouble() {
        let motion = DAffine3::from_rotation_x(1.0);
        let flat: Vec<DVec3> = points().into_iter().map(|p| p * dvec3(1.0, 1.0, 0.0)).collect();
        for mirrored in [false, true] {
            let found =
                similarity(flat.iter().map(|&p| (p, motion.transform_point3(p))), mirrored).expect("it spreads");
            assert!(flat.iter().all(|&p| found.transform_point3(p).distance(motion.transform_point3(p)) < 1e-12));
            assert_eq!(found.matrix3.determinant() < 0.0, mirrored);
        }
        let line =
            similarity((0..5).map(|i| (DVec3::X * f64::from(i), DVec3::Z * f64::from(i))), false).expect("a line");
        assert!(line.transform_vector3(DVec3::X).distance(DVec3::Z) < 1e-12);
        assert!(similarity([(DVec3::ONE, DVec3::ZERO)].into_iter(), false).is_none());
        assert!(similarity(std::iter::empty(), false).is_none());
    }

    #[test]
    fn the_stretch_is_that_of_the_longest_direction() {
        let m = DMat3::from_rotation_y(0.3) * DMat3::from_diagonal(dvec3(1.0, -4.0, 2.0)) * DMat3::from_rotation_x(1.0);
        assert!((stretch(&m) - 4.0).abs() < 1e-12);
        assert_eq!(stretch(&DMat3::ZERO), 0.0);
        assert!((stretch(&(m * 1e300)) / 4e300 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn nearly_square_turns_become_square() {
        let motion =
            DAffine3::from_translation(DVec3::ONE) * DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2 + 1e-9);
        let nice = snapped(&motion, DVec3::ZERO);
        assert_eq!(nice.matrix3, DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z));
        let turned = DAffine3::from_rotation_z(0.5);
        assert!(snapped(&turned, DVec3::ZERO).abs_diff_eq(turned, 1e-15));
    }
}
