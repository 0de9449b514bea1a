//! Axis-aligned boxes in double precision.

use glam::{DAffine3, DVec3};

/// An axis-aligned box; empty if a minimum exceeds its maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Bounds::EMPTY
    }
}

impl Bounds {
    /// The empty box; the identity of [`Bounds::union`].
    pub const EMPTY: Bounds = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Returns the smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Bounds::EMPTY, |b, p| Bounds { min: b.min.min(p), max: b.max.max(p) })
    }

    /// Whether the box contains no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Returns the smallest box around both.
    pub fn union(&self, other: &Bounds) -> Bounds {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns the intersection; may be empty.
    pub fn intersection(&self, other: &Bounds) -> Bounds {
        Bounds { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether the boxes share a point; touching counts.
    pub fn overlaps(&self, other: &Bounds) -> bool {
        !self.intersection(other).is_empty()
    }

    /// Whether the box contains all of `inner`, which must not be empty.
    pub fn contains(&self, inner: &Bounds) -> bool {
        self.min.cmple(inner.min).all() && inner.max.cmple(self.max).all()
    }

    /// Returns the edge lengths; zero for an empty box.
    pub fn size(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max - self.min }
    }

    /// Returns the surface area, in squared units; zero for an empty box.
    pub fn area(&self) -> f64 {
        let s = self.size();
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    }

    /// Returns the length of the diagonal; zero for an empty box.
    pub fn diagonal(&self) -> f64 {
        self.size().length()
    }

    /// Returns the midpoint; the origin for an empty box.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + 0.5 * (self.max - self.min) }
    }

    /// Returns the midpoint, rounded to single precision as stored in files; the origin if that overflows.
    pub fn stored_center(&self) -> DVec3 {
        let middle = self.center().as_vec3().as_dvec3();
        if middle.is_finite() { middle } else { DVec3::ZERO }
    }

    /// Returns the box of this box's eight transformed corners, as a driver computes an instance's box (J. Arvo,
    /// "Transforming Axis-Aligned Bounding Boxes", Graphics Gems, 1990). Exact for the identity; faces that touch still
    /// touch after a common translation and axis-aligned scale.
    pub fn transformed(&self, by: &DAffine3) -> Bounds {
        if self.is_empty() {
            return *self;
        }
        let mut to = Bounds { min: by.translation, max: by.translation };
        let m = by.matrix3;
        for (axis, low, high) in
            [(m.x_axis, self.min.x, self.max.x), (m.y_axis, self.min.y, self.max.y), (m.z_axis, self.min.z, self.max.z)]
        {
            let (a, b) = (axis * low, axis * high);
            to.min += a.min(b);
            to.max += a.max(b);
        }
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn boxes_that_touch_still_touch_when_moved_and_scaled_together() {
        let (a, b, c) = (dvec3(0.1, 0.2, 0.3), dvec3(0.7, 1.1, 1.3), dvec3(1.9, 2.3, 2.9));
        let (low, high) = (Bounds { min: a, max: b }, Bounds { min: b, max: c });
        assert_eq!(low.transformed(&DAffine3::IDENTITY), low);
        let by = DAffine3::from_translation(dvec3(0.1, 1e3, -1e-3)) * DAffine3::from_scale(dvec3(0.3, -7.0, 1e-3));
        assert!(low.transformed(&by).overlaps(&high.transformed(&by)));
    }

    #[test]
    fn a_turned_box_has_the_corners_inside_and_at_its_faces() {
        let unit = Bounds { min: DVec3::ZERO, max: DVec3::ONE };
        let turned = unit.transformed(&DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_4));
        let half = 0.5f64.sqrt();
        assert!((turned.min - dvec3(-half, 0.0, 0.0)).length() < 1e-15);
        assert!((turned.max - dvec3(half, 2.0 * half, 1.0)).length() < 1e-15);
        assert!(Bounds::EMPTY.transformed(&DAffine3::IDENTITY).is_empty());
    }
}
