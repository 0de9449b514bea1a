//! [`Limits`]: how far corners may lie from their place.

use crate::scene::{InstanceId, Scene};
use crate::verify::structure::reference_length;

/// Largest share of an object's own size by which a corner may be off, whatever is allowed for the scene.
const MOST_OF_OWN_SIZE: f64 = 0.1;
/// The share of an object's own size that is allowed for each unit of what is allowed of the scene's.
const OWN_OVER_SCENE: f64 = 1000.0;

/// How far corners of each object of the input may lie from their place, in world units.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Limits {
    of_instances: Vec<f64>,
    sizes: Vec<f64>,
    scene_size: f64,
}

impl Limits {
    /// Allows `max_position_error_ratio` of the scene's size, but no more than a thousand times that share of the
    /// object's own size, and a tenth of it at most: a small object keeps its shape in a large scene. What the input
    /// itself is off is allowed beyond that, and so is the rounding of places in double precision.
    pub(super) fn new(before: &Scene, max_position_error_ratio: f64) -> Limits {
        let scene_size = reference_length(before);
        let sizes: Vec<f64> = before.instance_boxes().iter().map(|b| b.diagonal()).collect();
        let limit = |(i, &size): (u32, &f64)| {
            let own = (OWN_OVER_SCENE * max_position_error_ratio).min(MOST_OF_OWN_SIZE) * size;
            // A point has no shape to keep.
            let allowed = (max_position_error_ratio * scene_size).min(if size > 0.0 { own } else { f64::INFINITY });
            let bounds = &before.instance_boxes()[i as usize];
            let far = bounds.min.abs().max(bounds.max.abs()).max_element();
            allowed + before.unavoidable_error(InstanceId(i)) + 4.0 * f64::EPSILON * far
        };
        let of_instances = (0..).zip(&sizes).map(limit).collect();
        Limits { of_instances, sizes, scene_size }
    }

    /// Returns the limit of an instance of the input.
    pub(super) fn of(&self, instance: u32) -> f64 {
        self.of_instances[instance as usize]
    }

    /// Returns the limit of an instance `factor` times as wide, up to half the size of the instance.
    pub(super) fn widened(&self, instance: u32, factor: f64) -> f64 {
        let limit = self.of(instance);
        limit.max((factor * limit).min(0.5 * self.sizes[instance as usize]))
    }

    /// Returns a distance over the size of an object; 0 for a point.
    pub(super) fn over_own_size(&self, instance: u32, distance: f64) -> f64 {
        let size = self.sizes[instance as usize];
        if size > 0.0 { (distance / size).min(f64::MAX) } else { 0.0 }
    }

    /// Returns the smallest `max_position_error_ratio` that allows a corner of an instance to be off by `error`; `None`
    /// if none does.
    pub(super) fn ratio_that_allows(&self, instance: u32, error: f64) -> Option<f64> {
        let size = self.sizes[instance as usize];
        let of_scene = error / self.scene_size;
        if size == 0.0 {
            return Some(of_scene);
        }
        (error <= MOST_OF_OWN_SIZE * size).then(|| of_scene.max(error / size / OWN_OVER_SCENE))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::verify::test_scenes::{cube, scene};

    /// A cube of one size and one of 1e-6 times that.
    fn two_sizes() -> Scene {
        let place = |scale: f64| (0, DAffine3::from_scale(DVec3::splat(scale)));
        scene(vec![cube(0, None)], &[place(1e3), place(1e-3)])
    }

    #[test]
    fn a_small_object_may_move_by_no_more_than_a_tenth_of_its_size() {
        let scene = two_sizes();
        let sizes: Vec<f64> = scene.instance_boxes().iter().map(|b| b.diagonal()).collect();
        for (ratio, shares) in [(1e-6, [1e-6, 1e-3]), (1e-3, [1e-3, 0.1])] {
            let limits = Limits::new(&scene, ratio);
            for (i, share) in (0..).zip(shares) {
                assert!((limits.of(i) / sizes[i as usize] / share - 1.0).abs() < 1e-6, "{ratio} {i}");
            }
        }
    }

    #[test]
    fn the_ratio_that_allows_an_error_does_and_a_smaller_one_does_not() {
        let scene = two_sizes();
        let limits = Limits::new(&scene, 0.0);
        let sizes: Vec<f64> = scene.instance_boxes().iter().map(|b| b.diagonal()).collect();
        for (i, error) in [(0, 0.3), (1, 1e-4 * sizes[1])] {
            let ratio = limits.ratio_that_allows(i, error).unwrap();
            assert!(
                Limits::new(&scene, 1.001 * ratio).of(i) >= error && Limits::new(&scene, 0.9 * ratio).of(i) < error
            );
        }
        assert_eq!(limits.ratio_that_allows(1, 0.2 * sizes[1]), None);
    }
}
