//! Axis-aligned boxes in double precision.

use glam::{DAffine3, DVec3};

/// An axis-aligned box; empty when a minimum exceeds its maximum.
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
    /// The box of nothing; neutral to [`Bounds::union`].
    pub const EMPTY: Bounds = Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Bounds::EMPTY, |b, p| Bounds { min: b.min.min(p), max: b.max.max(p) })
    }

    /// Whether no point lies inside.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around both.
    pub fn union(&self, other: &Bounds) -> Bounds {
        Bounds { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both have in common; may be empty.
    pub fn intersection(&self, other: &Bounds) -> Bounds {
        Bounds { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether the boxes share a point; touching counts.
    pub fn overlaps(&self, other: &Bounds) -> bool {
        !self.intersection(other).is_empty()
    }

    /// Edge lengths; zero for an empty box.
    pub fn size(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max - self.min }
    }

    /// Surface area, in squared units; zero for an empty box.
    pub fn area(&self) -> f64 {
        let s = self.size();
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    }

    /// Length of the diagonal; zero for an empty box.
    pub fn diagonal(&self) -> f64 {
        self.size().length()
    }

    /// The midpoint; the origin for an empty box.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.min + 0.5 * (self.max - self.min) }
    }

    /// The box of this box's eight transformed corners, as a driver computes an instance's box
    /// (J. Arvo, "Transforming Axis-Aligned Bounding Boxes", Graphics Gems, 1990).
    pub fn transformed(&self, by: &DAffine3) -> Bounds {
        if self.is_empty() {
            return *self;
        }
        let center = by.transform_point3(self.center());
        let half = 0.5 * self.size();
        let m = by.matrix3;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        Bounds { min: center - reach, max: center + reach }
    }
}
