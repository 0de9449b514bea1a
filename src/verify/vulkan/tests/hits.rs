//! Hits of traced rays.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::brute_force::assert_closest;
use super::scenes::{geometry, mesh, mixed, rays, scene, soup};
use super::*;
use crate::scene::Opacity;

const PLAIN: BuildOptions =
    BuildOptions { prefer: Prefer::FastTrace, allow_update: false, compact: true, blas_per: BlasPer::Mesh };

/// A square of two triangles in the plane z = 0 that faces +z.
fn square() -> crate::scene::Geometry {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    geometry(&corners, &[[0, 1, 2], [0, 2, 3]])
}

fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray { origin: origin.into(), direction: direction.into(), t_min: 0.0, t_max: 100.0 }
}

#[test]
fn geometries_mirrored_sheared_and_flat_instances_are_hit_as_by_brute_force() {
    on_device(|device| {
        let (scene, rays) = (mixed(), rays(4000, 2.0));
        let hits = closest(device, &scene, &rays, PLAIN);
        let (hit, doubtful) = assert_closest(&scene, &rays, &hits);
        assert!(hit > 1000 && doubtful < 100, "{hit} hit, {doubtful} doubtful");
        let of = |i: u32| hits.iter().flatten().filter(|h| h.instance == i).count();
        assert_eq!((of(3), of(6)), (0, 0));
        assert!([0, 1, 2, 4, 5, 7].into_iter().all(|i| of(i) > 20));
    });
}

#[test]
fn every_build_option_gives_the_same_hits() {
    on_device(|device| {
        let (scene, rays) = (mixed(), rays(2000, 2.0));
        let expected = closest(device, &scene, &rays, PLAIN);
        for prefer in [Prefer::FastTrace, Prefer::FastBuild, Prefer::None] {
            for (allow_update, compact) in [(false, false), (false, true), (true, false), (true, true)] {
                for blas_per in [BlasPer::Mesh, BlasPer::Primitive] {
                    let options = BuildOptions { prefer, allow_update, compact, blas_per };
                    let hits = closest(device, &scene, &rays, options);
                    let same = |a: &Option<Hit>, b: &Option<Hit>| match (a, b) {
                        (Some(a), Some(b)) => (a.instance, a.triangle, a.front) == (b.instance, b.triangle, b.front),
                        (a, b) => a == b,
                    };
                    let differ = expected.iter().zip(&hits).filter(|(a, b)| !same(a, b)).count();
                    // A ray along an edge may fall to either side of it.
                    assert!(differ <= 1, "{differ} rays differ with {options:?}");
                }
            }
        }
    });
}

#[test]
fn front_and_back_turn_along_with_a_mirror() {
    let mirror = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
    let scene = scene(
        vec![mesh(vec![square()])],
        [(0, DAffine3::IDENTITY), (0, DAffine3::from_translation(DVec3::X * 2.0) * mirror)],
    );
    let down = [ray([0.7, 0.2, 1.0], [0.0, 0.0, -1.0]), ray([2.7, 0.2, 1.0], [0.0, 0.0, -1.0])];
    let up = down.map(|r| Ray { origin: r.origin * Vec3::new(1.0, 1.0, -1.0), direction: -r.direction, ..r });
    on_device(|device| {
        let hits = closest(device, &scene, &[down, up].concat(), PLAIN);
        let front: Vec<bool> = hits.iter().map(|h| h.expect("all hit").front).collect();
        assert_eq!(front, [true, false, false, true]);
    });
}

#[test]
fn distances_are_in_lengths_of_the_direction_and_bounded_by_the_interval() {
    let scene = scene(vec![mesh(vec![square()])], [(0, DAffine3::from_scale(DVec3::splat(3.0)))]);
    let from = ray([1.0, 0.5, 8.0], [0.0, 0.0, -2.0]);
    let intervals = [(0.0, 100.0), (0.0, 3.9), (4.1, 100.0), (3.9, 4.1)];
    let rays = intervals.map(|(t_min, t_max)| Ray { t_min, t_max, ..from });
    on_device(|device| {
        let t: Vec<_> = closest(device, &scene, &rays, PLAIN).into_iter().map(|h| h.map(|h| h.t)).collect();
        assert_eq!(t, [Some(4.0), None, None, Some(4.0)]);
    });
}

#[test]
fn degenerate_triangles_are_never_hit_and_do_not_shift_the_others() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 0.0]];
    let triangles = [[0, 0, 0], [0, 1, 2], [0, 1, 4], [1, 1, 3], [0, 2, 3]];
    let scene = scene(vec![mesh(vec![geometry(&corners, &triangles)])], [(0, DAffine3::IDENTITY)]);
    let down = [[0.7, 0.2, 1.0], [0.2, 0.7, 1.0], [0.5, -0.1, 1.0]].map(|o| ray(o, [0.0, 0.0, -1.0]));
    on_device(|device| {
        let hits = closest(device, &scene, &down, PLAIN);
        assert_eq!(hits.iter().map(|h| h.map(|h| h.triangle)).collect::<Vec<_>>(), [Some(1), Some(4), None]);
    });
}

#[test]
fn nothing_but_degenerate_triangles_is_never_hit() {
    let point = geometry(&[[0.5, 0.5, 0.0]], &[[0, 0, 0]; 7]);
    let scene = scene(vec![mesh(vec![point])], [(0, DAffine3::IDENTITY)]);
    on_device(|device| {
        let down = [ray([0.5, 0.5, 1.0], [0.0, 0.0, -1.0])];
        assert_eq!(closest(device, &scene, &down, PLAIN), [None]);
    });
}

#[test]
fn of_20_000_instances_each_is_itself() {
    let at = |i: u32| DAffine3::from_translation(DVec3::new(f64::from(i % 200) * 2.0, f64::from(i / 200) * 2.0, 0.0));
    let scene = scene(vec![mesh(vec![square()])], (0..20_000).map(|i| (0, at(i))));
    let over = |i: u32| ray([(i % 200) as f32 * 2.0 + 0.7, (i / 200) as f32 * 2.0 + 0.2, 1.0], [0.0, 0.0, -1.0]);
    let rays: Vec<Ray> = (0..20_000).map(over).collect();
    on_device(|device| {
        let hits = closest(device, &scene, &rays, PLAIN);
        for (i, hit) in (0..).zip(hits) {
            assert_eq!(hit.map(|h| (h.instance, h.triangle, h.front)), Some((i, 0, true)));
        }
    });
}

/// Coordinates whose products overflow single precision, in the world, in meshes, or in both.
#[test]
fn very_large_and_very_small_scenes_are_hit_like_any_other() {
    let plain = scene(vec![mesh(vec![soup(60, Opacity::Opaque, 5)])], [(0, DAffine3::IDENTITY)]);
    let all = rays(500, 1.0);
    on_device(|device| {
        let expected = closest(device, &plain, &all, PLAIN);
        for (of_mesh, of_world) in [(1e30, 1e30), (1e-30, 1e-30), (1e30, 1.0), (1e-30, 1e25), (1.0, 1e-35)] {
            let mut scene = plain.clone();
            Arc::make_mut(&mut scene.meshes[0].geometries[0].positions).iter_mut().for_each(|p| *p *= of_mesh as f32);
            scene.instances[0].transform = DAffine3::from_scale(DVec3::splat(of_world / of_mesh));
            let scaled = |r: &Ray| Ray { origin: r.origin * of_world as f32, ..*r };
            let hits = closest(device, &scene, &all.iter().map(scaled).collect::<Vec<_>>(), PLAIN);
            let same = |(a, b): (&Option<Hit>, &Option<Hit>)| match (a, b) {
                (Some(a), Some(b)) => {
                    (a.triangle, a.front) == (b.triangle, b.front)
                        && (f64::from(b.t) / of_world / f64::from(a.t) - 1.0).abs() < 1e-4
                }
                (a, b) => a == b,
            };
            let differ = expected.iter().zip(&hits).filter(|pair| !same(*pair)).count();
            assert!(differ <= 1, "{differ} rays differ with {of_mesh:e} and {of_world:e}");
        }
    });
}

#[test]
fn a_scene_of_nothing_is_never_hit() {
    let flat = scene(vec![mesh(vec![square()])], [(0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)))]);
    on_device(|device| {
        let rays = rays(5, 1.0);
        assert_eq!(closest(device, &Scene::default(), &rays, PLAIN), [None; 5]);
        assert_eq!(closest(device, &flat, &rays, PLAIN), [None; 5]);
    });
}

#[test]
fn any_number_of_rays_is_traced() {
    on_device(|device| {
        // Forces more than one launch, the last of them partial.
        device.limits_mut().rays_per_launch = 16;
        let (scene, all) = (mixed(), rays(100, 2.0));
        let expected = closest(device, &scene, &all, PLAIN);
        for count in [0, 1, 15, 16, 17, 31, 33, 100] {
            assert_eq!(closest(device, &scene, &all[..count], PLAIN), expected[..count]);
        }
    });
}

#[test]
fn rays_that_are_none_hit_nothing() {
    let scene = scene(vec![mesh(vec![square()])], [(0, DAffine3::IDENTITY)]);
    let good = ray([0.7, 0.2, 1.0], [0.0, 0.0, -1.0]);
    let rays = [
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::new(0.0, f32::NAN, -1.0), ..good },
        Ray { origin: Vec3::INFINITY, ..good },
        Ray { t_min: 5.0, t_max: 0.5, ..good },
        Ray { t_min: -1.0, ..good },
        Ray { t_max: f32::NAN, ..good },
        good,
    ];
    on_device(|device| {
        let hit: Vec<bool> = closest(device, &scene, &rays, PLAIN).iter().map(Option::is_some).collect();
        assert_eq!(hit, [false, false, false, false, false, false, true]);
    });
}

#[test]
fn any_hit_finds_what_closest_hit_finds() {
    on_device(|device| {
        let (scene, rays) = (mixed(), rays(3000, 2.0));
        let pipelines = Pipelines::new(device).expect("made");
        let tracer = VulkanTracer::new(&pipelines, &scene, PLAIN).expect("built");
        let rays = device.upload_rays(&rays).expect("uploaded");
        let first = tracer.trace(&rays, false).expect("traced").hits;
        let any = tracer.trace(&rays, true).expect("traced").hits;
        assert!(first.iter().zip(&any).all(|(f, a)| f.is_some() == a.is_some()));
        assert!(first.iter().zip(&any).any(|(f, a)| f != a), "some ray hits several triangles");
    });
}

#[test]
fn any_hit_invocations_are_those_of_geometries_that_are_not_opaque() {
    let mask = Opacity::Mask { cutoff: 0.5 };
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let rays = rays(1000, 1.0);
        let invocations = |opacities: [Opacity; 2]| {
            let [a, b] = opacities;
            let scene = scene(vec![mesh(vec![soup(40, a, 1), soup(40, b, 2)])], [(0, DAffine3::IDENTITY)]);
            let tracer = VulkanTracer::new(&pipelines, &scene, PLAIN).expect("built");
            let rays = pipelines.device().upload_rays(&rays).expect("uploaded");
            let traced = tracer.trace(&rays, false).expect("traced");
            assert_closest(&scene, &self::rays(1000, 1.0), &traced.hits);
            (traced.any_hit_invocations, traced.hits.iter().flatten().count() as u64)
        };
        let (none, hits) = invocations([Opacity::Opaque; 2]);
        assert_eq!(none, 0);
        let (one, _) = invocations([Opacity::Opaque, mask]);
        let (both, _) = invocations([Opacity::Blend, mask]);
        assert!(one > 0 && both > one && both >= hits, "{one} and {both} invocations, {hits} hits");
    });
}
