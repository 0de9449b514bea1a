//! Scales very large and very small scenes into the range of single precision.
//!
//! Devices multiply coordinates with each other, so a valid scene of 1e25 or 1e-25 units overflows or underflows. If
//! the largest coordinate of the world or of a mesh lies outside 1e-6 to 1e6, it is scaled by a power of two, which is
//! exact; all others are passed to the device unchanged.

use glam::{DAffine3, DMat3};

use crate::parallel;
use crate::scene::{Bounds, Scene};

/// Range of the largest coordinate for which no scaling is needed.
const TRUSTED: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Powers of two by which a scene is scaled on the device.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::verify::vulkan) struct Scales {
    /// Device units per world unit.
    pub(in crate::verify::vulkan) world: f64,
    /// Device units per mesh unit, for each mesh.
    pub(super) meshes: Vec<f64>,
}

impl Scales {
    /// Computes the scales of a scene.
    pub(super) fn of(scene: &Scene) -> Scales {
        let bounds: Vec<Bounds> = parallel::map(scene.meshes.len(), &|m| scene.meshes[m].bounds());
        let placed = scene.instances.iter().map(|i| bounds[i.mesh.0 as usize].transformed(&i.transform));
        Scales {
            world: scale(placed.map(|b| largest_coordinate(&b)).filter(|x| x.is_finite()).fold(0.0, f64::max)),
            meshes: bounds.iter().map(|b| scale(largest_coordinate(b))).collect(),
        }
    }

    /// Returns the world-from-mesh transform, both spaces scaled as on the device.
    pub(super) fn transform(&self, transform: &DAffine3, mesh: usize) -> DAffine3 {
        let m = transform.matrix3;
        let by = self.world / self.meshes[mesh];
        DAffine3 {
            matrix3: DMat3::from_cols(m.x_axis * by, m.y_axis * by, m.z_axis * by),
            translation: transform.translation * self.world,
        }
    }
}

fn largest_coordinate(bounds: &Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { bounds.min.abs().max(bounds.max.abs()).max_element() }
}

/// Returns the power of two, within the range of single precision, that brings a largest coordinate near 1, or 1 if no
/// scaling is needed.
fn scale(largest: f64) -> f64 {
    if largest == 0.0 || TRUSTED.contains(&largest) {
        return 1.0;
    }
    largest.log2().floor().clamp(-126.0, 126.0).exp2().recip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_sizes_stay_as_they_are() {
        assert_eq!([0.0, 1e-6, 0.02, 1.0, 8388.0, 1e6].map(scale), [1.0; 6]);
    }

    #[test]
    fn others_are_brought_near_one_by_a_power_of_two() {
        for largest in [1e-38, 1e-30, 9e-7, 1.1e6, 1e30, 3e38] {
            let s = scale(largest);
            assert!((0.5..4.0).contains(&(s * largest)), "{largest}");
            assert_eq!(s.to_bits() << 12, 0, "{s} is a power of two");
            assert!((s as f32).is_normal() && (1.0 / s as f32).is_normal());
        }
    }
}
