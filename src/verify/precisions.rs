//! What precision costs in one scene: the error of the CPU's tracers against their time.

use std::time::Instant;

use super::approach::exact_distance;
use super::compare::{FAR_RATIO, NEAR_RATIO};
use super::cpu::{ComputingTracer, Precision, Reference, TrueHit, TwoLevel};
use super::errors::{percentile_999, root_mean_square};
use super::rays::{self, Ray, Sampling};
use crate::scene::{Scene, TriangleRef};

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
    /// How far its hits are from the true ones.
    pub errors: DistanceErrors,
}

/// Errors of the distances of hits, relative to the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DistanceErrors {
    /// The largest.
    pub largest: f64,
    /// What one in a thousand exceeds.
    pub p999: f64,
    /// Their root mean square.
    pub rms: f64,
    /// Rays that hit something far from the true hit, or in only one of the two, per million.
    pub far_per_million: f64,
}

impl DistanceErrors {
    /// Compares the hits of rays with the triangles and distances of the true ones, ray by ray. A distance that is far off
    /// is no error but a far hit, unless `is_same` of the triangles hit. `radius` is half the diagonal of the scene's box.
    pub(crate) fn of(
        hits: &[Option<TrueHit>],
        truths: &[Option<(TriangleRef, f64)>],
        radius: f64,
        is_same: impl Fn(TriangleRef, TriangleRef) -> bool,
    ) -> DistanceErrors {
        let (mut errors, mut far) = (Vec::with_capacity(hits.len()), 0u64);
        for (hit, truth) in hits.iter().zip(truths) {
            match (hit, truth) {
                (None, None) => {}
                (Some(hit), Some((at, t))) => match (hit.t - t).abs() {
                    off if off <= FAR_RATIO * radius || is_same(hit.at, *at) => {
                        errors.push(off / t.max(NEAR_RATIO * radius));
                    }
                    _ => far += 1,
                },
                _ => far += 1,
            }
        }
        DistanceErrors {
            largest: errors.iter().copied().fold(0.0, f64::max),
            rms: root_mean_square(&errors),
            p999: percentile_999(errors),
            far_per_million: per_million(far, hits.len()),
        }
    }
}

/// Returns how many of a million a number of rays is; 0 of none.
pub(crate) fn per_million(count: u64, of: usize) -> f64 {
    if of == 0 { 0.0 } else { 1e6 * count as f64 / of as f64 }
}

/// Traces some rays of each kind in each arithmetic through built trees; none if the scene shows nothing. True hits are
/// found in double precision over the positions of the scene as given.
pub fn compare(scene: &Scene, trees: &TwoLevel, seed: u64) -> Vec<OfPrecision> {
    let reference = Reference::new(trees);
    let rays = rays::generate(scene, &reference, &Sampling::new(RAYS, seed));
    let radius = rays.radius;
    let rays: Vec<Ray> = rays.kinds.values().flatten().copied().collect();
    let exact = |(hit, ray): (Option<TrueHit>, &Ray)| hit.map(|hit| (hit.at, exact_distance(scene, ray, &hit)));
    let truths: Vec<Option<(TriangleRef, f64)>> = reference.closest(&rays).into_iter().zip(&rays).map(exact).collect();
    if truths.iter().all(Option::is_none) {
        return Vec::new();
    }
    let of = |precision| {
        let tracer = ComputingTracer::new(trees, precision);
        let (seconds, hits) = timed(&tracer, &rays);
        OfPrecision {
            precision,
            nanoseconds_per_ray: 1e9 * seconds / rays.len() as f64,
            // What is far off is not excused by the triangle: users see a wrong distance.
            errors: DistanceErrors::of(&hits, &truths, radius, |_, _| false),
        }
    };
    Precision::ALL.map(of).into()
}

/// Returns the least time to trace the rays, in seconds, and their hits. The first time does not count.
fn timed(tracer: &ComputingTracer, rays: &[Ray]) -> (f64, Vec<Option<TrueHit>>) {
    let hits = tracer.closest(rays);
    let seconds = |_| {
        let start = Instant::now();
        drop(std::hint::black_box(tracer.closest(rays)));
        start.elapsed().as_secs_f64()
    };
    ((0..REPEATS).map(seconds).fold(f64::INFINITY, f64::min), hits)
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
        assert!(double.errors.largest < 1e-9 && double.errors.far_per_million == 0.0, "{double:?}");
        assert!(fast.errors.largest > 100.0 * double.errors.largest, "{found:?}");
        assert!(found.iter().all(|of| of.nanoseconds_per_ray > 0.0));
    }

    #[test]
    fn nothing_to_see_is_nothing_to_compare() {
        let empty = Scene::default();
        assert_eq!(compare(&empty, &TwoLevel::build(&empty), 1), []);
    }
}
