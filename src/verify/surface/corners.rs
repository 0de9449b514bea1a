//! How far the corners of two triangles are apart.

use glam::DVec3;

/// How two triangles fit best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// Distance of the farthest corner, in world units; infinite if a corner is no number.
    pub error: f64,
    /// As in [`Pair::turn`](super::pairs::Pair::turn), for the corners of a triangle that was turned over if it is not
    /// the same side.
    pub turn: u32,
    /// Whether the same side is in front.
    pub same_side: bool,
}

/// Returns how `placed` fits `original` best. If both sides fit about equally well, as in triangles no larger than the
/// error, the same side is in front.
pub(super) fn fit(placed: &[DVec3; 3], original: &[DVec3; 3]) -> Fit {
    let [a, b, c] = *placed;
    let same = best([[a, b, c], [c, a, b], [b, c, a]], original);
    if same.0 == 0.0 {
        return Fit { error: 0.0, turn: same.1, same_side: true };
    }
    let flipped = best([[a, c, b], [b, a, c], [c, b, a]], original);
    match flipped.0 < 0.25 * same.0 {
        true => Fit { error: flipped.0, turn: flipped.1, same_side: false },
        false => Fit { error: same.0, turn: same.1, same_side: true },
    }
}

/// Returns the distance of the farthest corner and the number of the best order; of equally good orders, the first.
fn best(orders: [[DVec3; 3]; 3], original: &[DVec3; 3]) -> (f64, u32) {
    let farthest = |order: [DVec3; 3]| order.iter().zip(original).map(|(p, q)| p.distance(*q)).fold(0.0, worse);
    let first = (farthest(orders[0]), 0);
    if first.0 == 0.0 {
        return first;
    }
    (1..).zip(orders[1..].iter()).fold(first, |best, (turn, &order)| {
        let error = farthest(order);
        if error < best.0 { (error, turn) } else { best }
    })
}

/// Returns the larger of two distances; NaN counts as infinitely far.
fn worse(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Whether a triangle has no area: its height is so small over its length that it is lost in the rounding of corners to
/// single precision.
pub(super) fn is_flat([a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let longest = ab.length().max(ac.length()).max(bc.length());
    if longest == 0.0 {
        return true;
    }
    // Divided first, as squares of lengths leave the range of numbers sooner.
    (ab / longest).cross(ac / longest).length() <= f64::from(f32::EPSILON)
}

/// Returns the area of a triangle.
pub(super) fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn corners_may_be_rotated_but_not_exchanged() {
        let [a, b, c] = TRIANGLE;
        let fits = |turn, same_side| Fit { error: 0.0, turn, same_side };
        assert_eq!(fit(&[a, b, c], &TRIANGLE), fits(0, true));
        assert_eq!(fit(&[b, c, a], &TRIANGLE), fits(1, true));
        assert_eq!(fit(&[c, a, b], &TRIANGLE), fits(2, true));
        assert!(!fit(&[b, a, c], &TRIANGLE).same_side);
    }

    #[test]
    fn a_turn_says_which_corner_is_which() {
        let [a, b, c] = TRIANGLE;
        for placed in [[a, b, c], [b, c, a], [c, a, b]] {
            let turn = fit(&placed, &TRIANGLE).turn as usize;
            (0..3).for_each(|k| assert_eq!(placed[k], TRIANGLE[(k + turn) % 3]));
        }
    }

    #[test]
    fn a_triangle_of_two_equal_corners_has_no_side_to_turn() {
        let [a, b, _] = TRIANGLE;
        for placed in [[a, b, a], [b, a, a]] {
            let found = fit(&placed, &[a, a, b]);
            assert_eq!((found.error, found.same_side), (0.0, true));
        }
    }

    #[test]
    fn what_is_no_number_is_infinitely_far() {
        assert_eq!(fit(&[DVec3::NAN, DVec3::X, DVec3::Y], &TRIANGLE).error, f64::INFINITY);
    }

    #[test]
    fn flat_is_what_rounding_may_have_flattened() {
        let with_height = |height: f64| [DVec3::ZERO, DVec3::X * 1e-20, DVec3::new(0.5e-20, height * 1e-20, 0.0)];
        assert!(is_flat(with_height(0.0)) && is_flat(with_height(1e-8)) && is_flat([DVec3::ONE; 3]));
        assert!(!is_flat(with_height(1e-6)) && !is_flat(TRIANGLE));
    }
}
