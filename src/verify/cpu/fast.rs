//! The ray/triangle test of T. Moeller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal of
//! Graphics Tools 2(1), 1997.
//!
//! Each triangle is tested in its own coordinates, so that a ray through an edge that two triangles share can be judged
//! to be beside both. Their test culls near-zero determinants; here only zero is rejected, because coordinates are
//! scaled.

use super::boxes::Real;
use super::watertight::{Crossing, TriangleTest};

/// A ray as it is.
#[derive(Clone, Copy)]
pub(super) struct PlainRay<T> {
    origin: [T; 3],
    direction: [T; 3],
}

impl<T: Real> TriangleTest<T> for PlainRay<T> {
    fn new(origin: [T; 3], direction: [T; 3]) -> Self {
        PlainRay { origin, direction }
    }

    fn cross(&self, [a, b, c]: [[T; 3]; 3]) -> Option<Crossing<T>> {
        let (zero, one) = (T::from(0.0), T::from(1.0));
        let (to_b, to_c) = (minus(b, a), minus(c, a));
        let across = cross(self.direction, to_c);
        let determinant = dot(to_b, across);
        if determinant == zero {
            return None;
        }
        let inverse = one / determinant;
        let from_a = minus(self.origin, a);
        let u = dot(from_a, across) * inverse;
        if u < zero || u > one {
            return None;
        }
        let along = cross(from_a, to_b);
        let v = dot(self.direction, along) * inverse;
        if v < zero || u + v > one {
            return None;
        }
        Some(Crossing { t: dot(to_c, along) * inverse, front: determinant > zero })
    }
}

fn minus<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn distance_and_side_are_those_of_the_triangle() {
        let down = PlainRay::new([0.25f32, 0.25, 2.0], [0.0, 0.0, -1.0]).cross(TRIANGLE).expect("crosses");
        assert!(down.front && down.t == 2.0);
        let up = PlainRay::new([0.25f32, 0.25, -2.0], [0.0, 0.0, 0.5]).cross(TRIANGLE).expect("crosses");
        assert!(!up.front && up.t == 4.0);
    }

    #[test]
    fn edges_are_hit_and_edge_on_and_beside_are_not() {
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.5, 0.0]] {
            assert!(PlainRay::new([x, y, 1.0f32], [0.0, 0.0, -1.0]).cross(TRIANGLE).is_some(), "{x} {y}");
        }
        for [x, y] in [[-0.1, 0.0], [1.1, 0.0], [0.6, 0.6], [0.5, -0.1]] {
            assert!(PlainRay::new([x, y, 1.0f32], [0.0, 0.0, -1.0]).cross(TRIANGLE).is_none(), "{x} {y}");
        }
        assert!(PlainRay::new([-1.0f32, 0.25, 0.0], [1.0, 0.0, 0.0]).cross(TRIANGLE).is_none());
    }
}
