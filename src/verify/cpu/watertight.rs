//! The watertight ray/triangle test of S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT
//! 2(1), 2013: a ray through an edge that two triangles share hits at least one of them.

use super::boxes::Real;

/// A test of a ray against triangles.
pub(super) trait TriangleTest<T> {
    /// Prepares a ray. A ray with a zero direction hits nothing.
    fn new(origin: [T; 3], direction: [T; 3]) -> Self;

    /// Returns the crossing of the ray's line with a triangle, at any `t`. Edges belong to the triangle; a triangle
    /// seen exactly edge-on is not crossed. On overflow there is no crossing, or `t` is NaN.
    fn cross(&self, corners: [[T; 3]; 3]) -> Option<Crossing<T>>;
}

/// A ray, sheared so that it runs along the last axis.
#[derive(Clone, Copy)]
pub(super) struct ShearedRay<T> {
    origin: [T; 3],
    /// The order in which the axes are used; the last is the longest of the direction.
    axes: [usize; 3],
    shear: [T; 3],
}

/// The point where a ray intersects a triangle.
pub(super) struct Crossing<T> {
    /// Distance, in units of the direction's length.
    pub(super) t: T,
    /// Whether the corners run counter-clockwise as seen from the ray's origin.
    pub(super) front: bool,
}

impl<T: Real> ShearedRay<T> {
    /// Returns a corner in the sheared space, its last coordinate not yet scaled.
    fn sheared(&self, corner: [T; 3]) -> [T; 3] {
        let [x, y, z] = self.axes.map(|i| corner[i] - self.origin[i]);
        [x - self.shear[0] * z, y - self.shear[1] * z, z]
    }
}

impl<T: Real> TriangleTest<T> for ShearedRay<T> {
    fn new(origin: [T; 3], direction: [T; 3]) -> Self {
        let length = |i: usize| if direction[i].is_negative() { -direction[i] } else { direction[i] };
        let z = if length(0) >= length(1) && length(0) >= length(2) {
            0
        } else if length(1) >= length(2) {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        // Swapping two axes preserves the winding of the corners if the ray runs backward.
        let axes = if direction[z].is_negative() { [y, x, z] } else { [x, y, z] };
        let along = direction[z];
        let shear = [direction[axes[0]] / along, direction[axes[1]] / along, T::from(1.0) / along];
        ShearedRay { origin, axes, shear }
    }

    fn cross(&self, corners: [[T; 3]; 3]) -> Option<Crossing<T>> {
        let [a, b, c] = corners.map(|p| self.sheared(p));
        let u = T::difference_of_products(c[0], b[1], c[1], b[0]);
        let v = T::difference_of_products(a[0], c[1], a[1], c[0]);
        let w = T::difference_of_products(b[0], a[1], b[1], a[0]);
        let zero = T::from(0.0);
        if (u < zero || v < zero || w < zero) && (u > zero || v > zero || w > zero) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == zero {
            return None;
        }
        let t = (u * a[2] + v * b[2] + w * c[2]) * self.shear[2] / determinant;
        Some(Crossing { t, front: determinant > zero })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn front_is_where_corners_run_counter_clockwise() {
        let from_above = ShearedRay::new([0.25, 0.25, 2.0], [0.0, 0.0, -1.0]).cross(TRIANGLE).expect("crosses");
        assert!(from_above.front);
        assert_eq!(from_above.t, 2.0);
        let from_below = ShearedRay::new([0.25, 0.25, -2.0], [0.0, 0.0, 0.5]).cross(TRIANGLE).expect("crosses");
        assert!(!from_below.front);
        assert_eq!(from_below.t, 4.0);
    }

    #[test]
    fn the_sense_of_turn_does_not_depend_on_the_axis() {
        for turn in 0..3 {
            let turned = |p: [f32; 3]| [p[turn % 3], p[(turn + 1) % 3], p[(turn + 2) % 3]];
            let ray = ShearedRay::new(turned([0.2, 0.3, 5.0]), turned([0.0, 0.0, -2.0]));
            let hit = ray.cross(TRIANGLE.map(turned)).expect("crosses");
            assert!(hit.front && hit.t == 2.5);
        }
    }

    #[test]
    fn edges_and_corners_are_hit_and_edge_on_is_not() {
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.5, 0.0]] {
            assert!(ShearedRay::new([x, y, 1.0], [0.0, 0.0, -1.0]).cross(TRIANGLE).is_some());
        }
        assert!(ShearedRay::new([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0]).cross(TRIANGLE).is_none());
    }

    #[test]
    fn nonsense_hits_nothing() {
        for bad in [[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3]] {
            let hit = ShearedRay::new([0.2, 0.2, 1.0], bad).cross(TRIANGLE);
            assert!(hit.is_none_or(|h| !h.t.is_finite()));
        }
    }
}
