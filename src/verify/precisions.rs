//! What precision costs in one scene: the error of the CPU's tracers against their time.

use std::time::Instant;

use super::approach::exact_distance;
use super::compare::{FAR_RATIO, NEAR_RATIO};
use super::cpu::{ComputingTracer, Precision, Reference, TrueHit, TwoLevel};
use super::errors::{percentile_999, root_mean_square};
use super::rays::{self, Ray, Sampling};
use crate::scene::Scene;

/// Rays of each kind.
const RAYS: usize = 2048;
/// Times that each tracer is timed; the least counts.
const REPEATS: usize = 3;

/// What a tracer of the CPU does with a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct OfPrecision {
    /// Its arithmetic.
    pub precision: Precision,
    /// Nanoseconds per ray, over all kinds, on all threads of this process.
    pub nanoseconds_per_ray: f64,
    /// Largest error of a distance, relative to the true one.
    pub largest_error: f64,
    /// What one error in a thousand exceeds.
    pub p999_error: f64,
    /// Root mean square of the errors.
    pub rms_error: f64,
    /// Rays that hit something far from the true hit, or in only one of the two, per million.
    pub far_hits_per_million: f64,
}

/// Traces some rays of each kind in each arithmetic through built trees; none if the scene shows nothing. True hits are
/// found in double precision over the positions of the scene as given.
pub fn compare(scene: &Scene, trees: &TwoLevel, seed: u64) -> Vec<OfPrecision> {
    let reference = Reference::new(trees);
    let rays = rays::generate(scene, &reference, &Sampling::new(RAYS, seed));
    let radius = rays.radius;
    let rays: Vec<Ray> = rays.kinds.values().flatten().copied().collect();
    let truths: Vec<Option<f64>> = reference
        .closest(&rays)
        .iter()
        .zip(&rays)
        .map(|(hit, ray)| Some(exact_distance(scene, ray, hit.as_ref()?)))
        .collect();
    if truths.iter().all(Option::is_none) {
        return Vec::new();
    }
    let of = |precision| {
        let tracer = ComputingTracer::new(trees, precision);
        let (seconds, hits) = timed(&tracer, &rays);
        let (errors, far) = errors(&hits, &truths, radius);
        OfPrecision {
            precision,
            nanoseconds_per_ray: 1e9 * seconds / rays.len() as f64,
            largest_error: errors.iter().copied().fold(0.0, f64::max),
            rms_error: root_mean_square(&errors),
            p999_error: percentile_999(errors),
            far_hits_per_million: 1e6 * far as f64 / rays.len() as f64,
        }
    };
    Precision::ALL.map(of).into()
}

fn timed(tracer: &ComputingTracer, rays: &[Ray]) -> (f64, Vec<Option<TrueHit>>) {
    let mut hits = tracer.closest(rays);
    let mut least = f64::INFINITY;
    for _ in 0..REPEATS {
        let start = Instant::now();
        hits = tracer.closest(rays);
        least = least.min(start.elapsed().as_secs_f64());
    }
    (least, hits)
}

/// Returns the relative errors of the hits near the true ones, and the number of others.
fn errors(hits: &[Option<TrueHit>], truths: &[Option<f64>], radius: f64) -> (Vec<f64>, usize) {
    let mut errors = Vec::with_capacity(hits.len());
    let mut far = 0;
    for (hit, truth) in hits.iter().zip(truths) {
        match (hit, truth) {
            (None, None) => {}
            (Some(hit), Some(truth)) if (hit.t - truth).abs() <= FAR_RATIO * radius => {
                errors.push((hit.t - truth).abs() / truth.max(NEAR_RATIO * radius));
            }
            _ => far += 1,
        }
    }
    (errors, far)
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::{cube, scene};
    use super::*;
    use glam::{DAffine3, DVec3};

    #[test]
    fn double_precision_is_exact_and_single_is_not_far_from_the_origin() {
        let far = DAffine3::from_translation(DVec3::splat(3e4));
        let scene = scene(vec![cube(0, None)], &[(0, far)]);
        let found = compare(&scene, &TwoLevel::build(&scene), 1);
        assert_eq!(found.iter().map(|of| of.precision).collect::<Vec<_>>(), Precision::ALL);
        let [fast, .., double] = found.as_slice() else { panic!("{found:?}") };
        assert!(double.largest_error < 1e-9 && double.far_hits_per_million == 0.0, "{double:?}");
        assert!(fast.largest_error > 100.0 * double.largest_error, "{found:?}");
        assert!(found.iter().all(|of| of.nanoseconds_per_ray > 0.0));
    }

    #[test]
    fn nothing_to_see_is_nothing_to_compare() {
        let empty = Scene::default();
        assert_eq!(compare(&empty, &TwoLevel::build(&empty), 1), []);
    }
}
