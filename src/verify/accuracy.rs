//! What tracing a layout in single precision costs in accuracy, against the truth about the input.

use serde::Serialize;

use super::VerifyOptions;
use super::compare::{FAR_RATIO, NEAR_RATIO};
use super::cpu::{CpuTracer, Reference, TrueHit, TwoLevel};
use super::errors::{percentile_999, root_mean_square};
use super::rays::{self, Ray};
use super::seams::Aimed;
use super::structure::allowed_error;
use crate::scene::Scene;

/// Rays of each kind whose distance is compared.
const RAYS_PER_KIND: usize = 1024;

/// Rays aimed at edges and vertices.
const AIMED: u32 = 4096;

/// Errors of hits over their true distance, and rays lost at seams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Accuracy {
    /// Largest distance error over the distance, or over a thousandth of half the scene's diagonal if that is more.
    pub max_relative_distance_error: f64,
    /// The error that 99.9 % of the hits do not exceed.
    pub p999_relative_distance_error: f64,
    /// Root mean square of these errors.
    pub rms_relative_distance_error: f64,
    /// Of a million rays aimed at edges and vertices where triangles of the input meet, how many hit nothing.
    pub lost_per_million: f64,
}

/// Rays, and what they truly hit in the input.
pub(crate) struct Probe {
    rays: Vec<Ray>,
    truths: Vec<Option<TrueHit>>,
    aimed: Aimed,
    /// Half the diagonal of the scene's box.
    radius: f64,
}

impl Probe {
    /// Generates 1,024 rays of each kind and up to 4,096 aimed ones, seeded; `reference` is that of the input.
    pub(crate) fn new(before: &Scene, reference: &Reference, options: &VerifyOptions) -> Probe {
        let generated = rays::generate(before, reference, &options.sampling(RAYS_PER_KIND, None));
        let rays: Vec<Ray> = generated.kinds.iter().flat_map(|(_, rays)| rays).copied().collect();
        let displacement = allowed_error(before, options.max_position_error_ratio);
        let options = VerifyOptions { rays_per_kind: AIMED, ..options.clone() };
        Probe {
            truths: reference.closest(&rays),
            rays,
            aimed: Aimed::new(before, None, displacement, &options),
            radius: generated.radius,
        }
    }

    /// Traces the rays through a layout. Hits beside the true one, as at silhouettes, count for no distance error.
    pub(crate) fn measure(&self, layout: &TwoLevel) -> Accuracy {
        let tracer = CpuTracer::new(layout);
        let mut errors: Vec<f64> = Vec::with_capacity(self.rays.len());
        for ((ray, truth), hit) in self.rays.iter().zip(&self.truths).zip(tracer.closest(&self.rays)) {
            let (Some(truth), Some(hit)) = (truth, hit) else { continue };
            let length = ray.direction.as_dvec3().length();
            let error = length * (f64::from(hit.t) - truth.t).abs();
            if error <= FAR_RATIO * self.radius {
                errors.push(error / (length * truth.t).max(NEAR_RATIO * self.radius));
            }
        }
        let lost = tracer.occluded(&self.aimed.rays).into_iter().filter(|hit| !hit).count();
        Accuracy {
            max_relative_distance_error: errors.iter().copied().fold(0.0, f64::max),
            rms_relative_distance_error: root_mean_square(&errors),
            lost_per_million: 1e6 * lost as f64 / self.aimed.rays.len().max(1) as f64,
            p999_relative_distance_error: percentile_999(errors),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::super::test_scenes::room;
    use super::super::tests::{baked, tilted};
    use super::*;

    fn measured(before: &Scene, after: &Scene) -> Accuracy {
        let trees = TwoLevel::build(before);
        Probe::new(before, &Reference::new(&trees), &VerifyOptions::default()).measure(&TwoLevel::build(after))
    }

    #[test]
    fn a_scene_has_the_errors_of_single_precision_and_a_far_frame_larger_ones() {
        let room = room();
        let near = measured(&room, &baked(&room, tilted()));
        let far = measured(&room, &baked(&room, DAffine3::from_translation(DVec3::splat(1e4))));
        assert!(near.rms_relative_distance_error > 1e-9 && near.rms_relative_distance_error < 1e-4, "{near:?}");
        assert!(far.rms_relative_distance_error > 10.0 * near.rms_relative_distance_error, "{far:?} {near:?}");
        for of in [near, far] {
            assert!(of.rms_relative_distance_error <= of.p999_relative_distance_error);
            assert!(of.p999_relative_distance_error <= of.max_relative_distance_error);
        }
    }

    #[test]
    fn rays_through_a_hole_are_lost() {
        let room = room();
        let mut open = room.clone();
        open.instances.truncate(0);
        assert_eq!(measured(&room, &room).lost_per_million, 0.0);
        assert_eq!(measured(&room, &open).lost_per_million, 1e6);
        assert_eq!(measured(&room, &open).max_relative_distance_error, 0.0);
    }
}
