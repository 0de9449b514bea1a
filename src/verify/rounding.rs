//! Bounds how far single precision may move a ray relative to a surface.

use glam::{DAffine3, DMat3, DVec3};

/// Half the distance from 1 to the next larger `f32`.
pub const SINGLE: f64 = f32::EPSILON as f64 / 2.0;

/// Half the distance from 0 to the next larger `f32`, the smallest possible rounding error.
pub const SMALLEST: f64 = 0.5 * f32::from_bits(1) as f64;

/// The largest numbers that occur when a ray is transformed into the coordinates of a mesh: every rounding moves the
/// ray by at most [`SINGLE`] times them.
#[derive(Clone, Copy, Debug)]
pub struct Magnitude {
    /// |A| |A^-1|, with absolute values element by element.
    spread: DMat3,
    /// Contribution of translation and vertices, in world units.
    fixed: DVec3,
}

impl Magnitude {
    /// Computes it for an instance from its transform, the inverse, and the largest coordinates of its mesh.
    pub fn new(to_world: &DAffine3, to_mesh: &DAffine3, mesh: DVec3) -> Magnitude {
        let (there, back) = (absolute(&to_world.matrix3), absolute(&to_mesh.matrix3));
        let spread = there * back;
        Magnitude { spread, fixed: spread * to_world.translation.abs() + there * mesh }
    }

    /// Returns it in world units, for a ray whose coordinates reach `ray` in world units.
    pub fn at(&self, ray: DVec3) -> f64 {
        (self.spread * ray + self.fixed).max_element()
    }
}

/// Returns the matrix of absolute values.
pub(super) fn absolute(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_the_identity_is_the_sum_of_ray_and_mesh() {
        let plain = Magnitude::new(&DAffine3::IDENTITY, &DAffine3::IDENTITY, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(plain.at(DVec3::new(10.0, 0.0, 0.0)), 11.0);
    }

    #[test]
    fn a_far_translation_counts() {
        let far = DAffine3::from_translation(DVec3::new(-1e6, 0.0, 0.0));
        assert_eq!(Magnitude::new(&far, &far.inverse(), DVec3::ONE).at(DVec3::ZERO), 1e6 + 1.0);
    }
}
