//! Each arithmetic finds what brute force in the same arithmetic finds, and as exactly as it says.

use glam::{DAffine3, DMat3, DVec3};
use proptest::prelude::*;

use super::arithmetic::{Arithmetic, Double, Recentred, Single};
use super::boxes::Real;
use super::fast::PlainRay;
use super::two_level::{Entry, TwoLevel};
use super::watertight::{ShearedRay, TriangleTest};
use super::{ComputingTracer, CpuTracer, Precision, Reference, TrueHit};
use crate::scene::{Scene, TriangleRef};
use crate::verify::rays::{self, Ray, Sampling};
use crate::verify::seams::tests::torus;
use crate::verify::test_scenes::{Style, cases, random_rays, random_scene, room, scene};

/// Finds the distance of the first hit by testing every triangle, without boxes.
fn brute<A: Arithmetic>(accel: &TwoLevel, ray: &Ray) -> Option<f64> {
    let world = A::ray(ray.origin.as_dvec3() * accel.scale, ray.direction.as_dvec3());
    let [t_min, t_max] = [ray.t_min, ray.t_max].map(|t| A::Number::nearest(f64::from(t) * accel.scale));
    let of_entry = |entry: &Entry| {
        let mesh = &accel.bottom[entry.mesh as usize];
        let inside = A::enter(&A::way(entry, mesh)?, &world);
        let hits = mesh.corners.iter().filter_map(|corners| {
            let crossing = inside.triangles.cross(corners.map(|p| p.to_array().map(A::Number::from)))?;
            Some(inside.start + crossing.t)
        });
        hits.filter(|t| *t > t_min && *t < t_max).map(Real::exact).min_by(f64::total_cmp)
    };
    accel.entries.iter().filter_map(of_entry).min_by(f64::total_cmp).map(|t| t / accel.scale)
}

fn brute_by(precision: Precision, accel: &TwoLevel, ray: &Ray) -> Option<f64> {
    match precision {
        Precision::F32Fast => brute::<Single<PlainRay<f32>>>(accel, ray),
        Precision::F32Watertight => brute::<Single<ShearedRay<f32>>>(accel, ray),
        Precision::F32Recentred => brute::<Recentred>(accel, ray),
        Precision::F64 => brute::<Double>(accel, ray),
    }
}

fn style() -> impl Strategy<Value = Style> {
    let size = prop_oneof![Just(1.0), Just(1e-3), Just(1e30)];
    let offset = prop_oneof![Just(0.0), Just(100.0)];
    (size, offset, any::<[bool; 3]>()).prop_map(|(size, offset, [on_grid, thin, wild])| Style {
        size,
        offset,
        on_grid,
        thin,
        wild,
    })
}

proptest! {
    #![proptest_config(cases(24))]

    #[test]
    fn no_arithmetic_misses_a_hit_because_of_a_box(seed: u64, style in style()) {
        let scene = random_scene(seed, style);
        let accel = TwoLevel::build(&scene);
        let rays = random_rays(seed, style, 60);
        for precision in Precision::ALL {
            let tracer = ComputingTracer::new(&accel, precision);
            for ((ray, hit), occluded) in rays.iter().zip(tracer.closest(&rays)).zip(tracer.occluded(&rays)) {
                prop_assert_eq!(hit.map(|hit| hit.t), brute_by(precision, &accel, ray), "{:?} {:?}", precision, ray);
                prop_assert_eq!(hit.is_some(), occluded);
            }
        }
    }
}

/// The first hits of a ray of each kind and many more, and what they truly are.
fn traced(scene: &Scene, precision: Precision) -> Vec<(TrueHit, TrueHit)> {
    let accel = TwoLevel::build(scene);
    let reference = Reference::new(&accel);
    let rays: Vec<Ray> =
        rays::generate(scene, &reference, &Sampling::new(512, 1)).kinds.values().flatten().copied().collect();
    let hits = ComputingTracer::new(&accel, precision).closest(&rays);
    let both: Vec<_> = hits.into_iter().zip(reference.closest(&rays)).filter_map(|(a, b)| Some((a?, b?))).collect();
    assert!(both.len() > 256, "{} hits", both.len());
    both
}

/// Returns the largest error of the hits of the right triangle, relative to their distance.
fn largest_error(scene: &Scene, precision: Precision) -> f64 {
    let error = |(hit, truth): (TrueHit, TrueHit)| (hit.at == truth.at).then(|| (hit.t / truth.t - 1.0).abs());
    traced(scene, precision).into_iter().filter_map(error).fold(0.0, f64::max)
}

#[test]
fn the_watertight_arithmetic_is_that_of_the_tracer_under_test() {
    let room = room();
    let accel = TwoLevel::build(&room);
    let rays: Vec<Ray> = rays::generate(&room, &Reference::new(&accel), &Sampling::new(256, 1))
        .kinds
        .values()
        .flatten()
        .copied()
        .collect();
    let hits = ComputingTracer::new(&accel, Precision::F32Watertight).closest(&rays);
    let plain = CpuTracer::new(&accel).closest(&rays);
    assert_eq!(hits.iter().flatten().count(), plain.iter().flatten().count());
    for (hit, plain) in hits.into_iter().flatten().zip(plain.into_iter().flatten()) {
        let at = TriangleRef { instance: plain.instance, triangle: plain.triangle };
        assert_eq!((hit.t as f32, hit.at, hit.front), (plain.t, at, plain.front));
    }
}

#[test]
fn double_precision_agrees_with_the_truth() {
    assert!(traced(&room(), Precision::F64).iter().all(|(hit, truth)| (hit.at, hit.front) == (truth.at, truth.front)));
    let error = largest_error(&room(), Precision::F64);
    assert!(error < 1e-11, "{error}");
}

#[test]
fn far_from_the_origin_only_recentred_and_double_precision_keep_their_digits() {
    let turned = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let far = DAffine3 { matrix3: turned, translation: DVec3::new(9_600.0, 4_320.0, -5_760.0) };
    let far = scene(vec![torus()], &[(0, far)]);
    let [fast, watertight, recentred, double] = Precision::ALL.map(|precision| largest_error(&far, precision));
    assert!(fast > 1e-4 && watertight > 1e-4, "{fast} {watertight}");
    assert!(recentred < 1e-5 && double < 1e-9, "{recentred} {double}");
}
