//! Compares both tracers with brute force.

use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec3A};
use proptest::prelude::*;

use super::two_level::{Entry, TwoLevel};
use super::watertight::{ShearedRay, TriangleTest};
use super::{CpuTracer, Reference, TrueHit};
use crate::scene::{InstanceId, Scene, TriangleRef};
use crate::verify::Hit;
use crate::verify::approach::Approach;
use crate::verify::rays::Ray;
use crate::verify::test_scenes::{Style, cases, cube, mesh, random_rays, random_scene, scene};

fn style() -> impl Strategy<Value = Style> {
    let size = prop_oneof![Just(1.0), Just(1e-3), Just(1e3), Just(1e-30), Just(1e30)];
    let offset = prop_oneof![Just(0.0), Just(100.0)];
    (size, offset, any::<[bool; 3]>()).prop_map(|(size, offset, [on_grid, thin, wild])| Style {
        size,
        offset,
        on_grid,
        thin,
        wild,
    })
}

fn all_triangles(scene: &Scene) -> Vec<TriangleRef> {
    let count = |i: u32| scene.mesh_of(InstanceId(i)).triangle_count() as u32;
    (0..scene.instances.len() as u32)
        .flat_map(|instance| (0..count(instance)).map(move |triangle| TriangleRef { instance, triangle }))
        .collect()
}

/// Finds the true hit by testing every triangle.
fn brute_truth(scene: &Scene, ray: &Ray) -> Option<TrueHit> {
    let sheared = ShearedRay::new(ray.origin.as_dvec3().to_array(), ray.direction.as_dvec3().to_array());
    let hits = all_triangles(scene).into_iter().filter_map(|at| {
        let crossing = sheared.cross(scene.world_corners(at).map(|p| p.to_array()))?;
        Some(TrueHit { t: crossing.t, at, front: crossing.front })
    });
    let within = hits.filter(|h| h.t > f64::from(ray.t_min) && h.t < f64::from(ray.t_max));
    within.min_by(|a, b| a.t.total_cmp(&b.t).then(a.at.cmp(&b.at)))
}

/// Finds the hit in single precision by testing every triangle, without boxes.
fn brute_single(accel: &TwoLevel, ray: &Ray) -> Option<Hit> {
    let scale = |x: f32| (f64::from(x) * accel.scale) as f32;
    let origin = Vec3A::from_array(ray.origin.to_array().map(scale));
    let of_entry = |entry: &Entry| {
        let to_mesh = Affine3A::from_cols_array(&entry.to_mesh.to_cols_array().map(|x| x as f32));
        let (o, d) = (to_mesh.transform_point3a(origin), to_mesh.transform_vector3a(ray.direction.into()));
        let sheared = ShearedRay::new(o.to_array(), d.to_array());
        let mesh = &accel.bottom[entry.mesh as usize];
        let hits = mesh.corners.iter().zip(&mesh.order).filter_map(|(corners, &triangle)| {
            let crossing = sheared.cross(corners.map(|p| p.to_array()))?;
            Some(Hit { t: crossing.t, instance: entry.instance, triangle, front: crossing.front })
        });
        hits.collect::<Vec<_>>()
    };
    let within = |h: &Hit| h.t > scale(ray.t_min) && h.t < scale(ray.t_max);
    let key = |h: &Hit| (h.instance, h.triangle);
    accel
        .entries
        .iter()
        .flat_map(of_entry)
        .filter(within)
        .min_by(|a, b| a.t.total_cmp(&b.t).then(key(a).cmp(&key(b))))
        .map(|h| Hit { t: (f64::from(h.t) / accel.scale) as f32, ..h })
}

proptest! {
    #![proptest_config(cases(96))]

    #[test]
    fn the_reference_equals_brute_force_to_the_last_bit(seed: u64, style in style()) {
        let scene = random_scene(seed, style);
        let accel = TwoLevel::build(&scene);
        let rays = random_rays(seed, style, 100);
        for (ray, hit) in rays.iter().zip(Reference::new(&accel).closest(&rays)) {
            prop_assert_eq!(hit, brute_truth(&scene, ray), "{:?}", ray);
        }
    }

    #[test]
    fn the_tracer_misses_no_hit_because_of_a_box(seed: u64, style in style()) {
        let scene = random_scene(seed, style);
        let accel = TwoLevel::build(&scene);
        let rays = random_rays(seed, style, 100);
        let tracer = CpuTracer::new(&accel);
        for ((ray, hit), occluded) in rays.iter().zip(tracer.closest(&rays)).zip(tracer.occluded(&rays)) {
            prop_assert_eq!(hit, brute_single(&accel, ray), "{:?}", ray);
            prop_assert_eq!(hit.is_some(), occluded);
        }
    }

    #[test]
    fn the_watertight_test_agrees_with_the_geometry(seed: u64, style in style()) {
        let scene = random_scene(seed, style);
        for ray in random_rays(seed, style, 20) {
            let sheared = ShearedRay::new(ray.origin.as_dvec3().to_array(), ray.direction.as_dvec3().to_array());
            for at in all_triangles(&scene) {
                let corners = scene.world_corners(at);
                let truly = Approach::new(&ray, &corners);
                let size = corners.iter().fold(ray.origin.as_dvec3().length(), |s, c| s.max(c.length()));
                let slack = 1e-12 * size;
                match sheared.cross(corners.map(|p| p.to_array())) {
                    Some(crossing) => {
                        let distance = crossing.t * ray.direction.as_dvec3().length();
                        prop_assert!(truly.explains(distance, slack), "{distance} {truly:?}");
                        prop_assert!(crossing.front == truly.front || truly.grazes(slack));
                    }
                    None => prop_assert!(!truly.through || truly.grazes(slack), "{truly:?}"),
                }
            }
        }
    }
}

fn first_hits(scene: &Scene, ray: Ray) -> (Option<Hit>, Option<TrueHit>) {
    let accel = TwoLevel::build(scene);
    (CpuTracer::new(&accel).closest(&[ray])[0], Reference::new(&accel).closest(&[ray])[0])
}

/// Repeats all triangles, so that each geometry has duplicates.
fn doubled(scene: &Scene) -> Scene {
    let mut doubled = scene.clone();
    for mesh in doubled.meshes.iter_mut() {
        let mut first_triangle = 0;
        for geometry in &mut mesh.geometries {
            geometry.triangles.extend_from_within(..);
            geometry.first_triangle = first_triangle;
            first_triangle += geometry.triangles.len() as u32;
        }
    }
    doubled
}

#[test]
fn of_equal_triangles_the_first_is_hit_as_by_brute_force() {
    let style = Style { size: 1.0, offset: 0.0, on_grid: true, thin: false, wild: true };
    for seed in 0..8 {
        let scene = doubled(&random_scene(seed, style));
        let accel = TwoLevel::build(&scene);
        let rays = random_rays(seed, style, 200);
        let (hits, truths) = (CpuTracer::new(&accel).closest(&rays), Reference::new(&accel).closest(&rays));
        assert!(truths.iter().flatten().count() > 0);
        for ((ray, hit), truth) in rays.iter().zip(hits).zip(truths) {
            assert_eq!((hit, truth), (brute_single(&accel, ray), brute_truth(&scene, ray)), "{ray:?}");
        }
    }
}

#[test]
fn nothing_is_hit_in_an_empty_scene() {
    assert_eq!(first_hits(&Scene::default(), Ray::endless(DVec3::ZERO, DVec3::X)), (None, None));
}

#[test]
fn an_instance_without_volume_is_not_entered() {
    let flat = scene(vec![cube(0, None)], &[(0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)))]);
    assert_eq!(first_hits(&flat, Ray::endless(DVec3::new(0.1, 3.0, 0.2), DVec3::NEG_Y)), (None, None));
}

#[test]
fn mirroring_turns_no_surface_inside_out() {
    for mirror in [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::splat(-1.0)] {
        let cube = scene(vec![cube(0, None)], &[(0, DAffine3::from_scale(mirror))]);
        let (hit, truth) = first_hits(&cube, Ray::endless(DVec3::new(3.0, 0.1, 0.2), DVec3::NEG_X));
        assert!(hit.expect("hits").front && truth.expect("hits").front);
        let (hit, truth) = first_hits(&cube, Ray::endless(DVec3::new(0.0, 0.1, 0.2), DVec3::NEG_X));
        assert!(!hit.expect("hits").front && !truth.expect("hits").front);
    }
}

#[test]
fn the_ends_of_a_ray_do_not_count() {
    let wall = scene(vec![cube(0, None)], &[(0, DAffine3::IDENTITY)]);
    let ray = Ray::endless(DVec3::new(3.0, 0.1, 0.2), DVec3::NEG_X);
    assert_eq!(first_hits(&wall, Ray { t_max: 2.0, ..ray }), (None, None));
    let (hit, truth) = first_hits(&wall, Ray { t_min: 2.0, ..ray });
    assert_eq!((hit.expect("hits").t, truth.expect("hits").t), (4.0, 4.0));
}

#[test]
fn rays_along_the_sides_of_boxes_hit_what_lies_there() {
    // The floor lies in the lowest plane of every box around it.
    let cells = 20;
    let corner = |x: u32, z: u32| Vec3::new(x as f32, 0.0, z as f32);
    let positions: Vec<Vec3> = (0..=cells).flat_map(|z| (0..=cells).map(move |x| corner(x, z))).collect();
    let at = |x: u32, z: u32| z * (cells + 1) + x;
    let triangles = (0..cells * cells)
        .flat_map(|i| {
            let (x, z) = (i % cells, i / cells);
            [[at(x, z), at(x, z + 1), at(x + 1, z)], [at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)]]
        })
        .collect();
    let floor = scene(vec![mesh(0, vec![(None, positions, triangles)])], &[(0, DAffine3::IDENTITY)]);
    for x in 0..=cells {
        for z in 0..=cells {
            // Downwards through the corners of the grid, in the planes between its boxes.
            let ray = Ray::endless(DVec3::new(f64::from(x), 1.0, f64::from(z)), DVec3::NEG_Y);
            let (hit, truth) = first_hits(&floor, ray);
            assert!(hit.is_some_and(|h| h.t == 1.0 && h.front) && truth.is_some_and(|h| h.t == 1.0), "{x} {z}");
        }
    }
}

#[test]
fn overflowing_coordinates_do_not_panic() {
    let far = DAffine3::from_scale_rotation_translation(
        DVec3::new(1e30, 1e-30, 1e20),
        glam::DQuat::from_rotation_x(1.0),
        DVec3::splat(1e300),
    );
    let odd = scene(vec![cube(0, None)], &[(0, far), (0, DAffine3::IDENTITY)]);
    let (hit, _) = first_hits(&odd, Ray::endless(DVec3::new(3.0, 0.1, 0.2), DVec3::NEG_X));
    assert!(hit.is_none_or(|h| !h.t.is_nan()));
}
