//! Batches of rays for pictures.

use super::scenes::{geometry, mesh, rays, scene, soup};
use super::*;
use crate::scene::Opacity;
use crate::verify::batch::BatchTracer;
use crate::verify::cpu::{CpuTracer, TwoLevel};

fn with_tracer(scene: &Scene, test: impl FnOnce(&dyn BatchTracer)) {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("pipelines are made");
        let tracer = VulkanTracer::new(&pipelines, scene, BuildOptions::default()).expect("the structures are built");
        test(&tracer);
    });
}

#[test]
fn all_hits_are_found_in_order_however_many_there_are() {
    let layers = 100;
    let corners: Vec<[f32; 3]> =
        (0..layers).flat_map(|i| [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]].map(|[x, y]| [x, y, -(i as f32)])).collect();
    let triangles: Vec<[u32; 3]> = (0..layers).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let scene = scene(vec![mesh(vec![geometry(&corners, &triangles)])], [(0, glam::DAffine3::IDENTITY)]);
    let down = |x: f32, t_max: f32| Ray {
        origin: [x, 0.3, 1.0].into(),
        direction: [0.0, 0.0, -1.0].into(),
        t_min: 0.0,
        t_max,
    };
    with_tracer(&scene, |tracer| {
        let found = tracer.all(&[down(0.5, f32::MAX), down(5.0, f32::MAX), down(0.5, 10.5)]).expect("traced");
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [100, 0, 10]);
        for (i, hit) in found[0].iter().enumerate() {
            assert!(hit.triangle == i as u32 && (hit.t - (i + 1) as f32).abs() < 1e-4 && hit.front, "{hit:?}");
        }
        assert_eq!(found[2], found[0][..10]);
        assert!(tracer.all(&[]).expect("nothing to trace").is_empty());
    });
}

#[test]
fn all_hits_are_those_of_the_cpu_but_for_edges() {
    let geometries = vec![soup(400, Opacity::Opaque, 1), soup(200, Opacity::Blend, 2)];
    let scene = scene(vec![mesh(geometries)], [(0, glam::DAffine3::IDENTITY)]);
    let (trees, rays) = (TwoLevel::build(&scene), rays(1000, 1.0));
    let on_cpu = CpuTracer::new(&trees);
    let mut probe = on_cpu.probe();
    with_tracer(&scene, |tracer| {
        let found = tracer.all(&rays).expect("traced");
        let (mut same, mut hits) = (0, 0);
        for (ray, found) in rays.iter().zip(&found) {
            let mut expected = Vec::new();
            probe.closest(ray, |hit| {
                expected.push(hit.triangle);
                false
            });
            let mut triangles: Vec<u32> = found.iter().map(|hit| hit.triangle).collect();
            assert!(found.is_sorted_by(|a, b| a.t <= b.t));
            expected.sort_unstable();
            triangles.sort_unstable();
            same += usize::from(expected == triangles);
            hits += expected.len();
        }
        assert!(same >= 990 && hits > 2000, "{same} rays have the same hits, {hits} in all");
    });
}

#[test]
fn the_clock_of_the_device_runs_while_rays_are_traced() {
    let scene = scene(vec![mesh(vec![soup(1000, Opacity::Opaque, 1)])], [(0, glam::DAffine3::IDENTITY)]);
    let rays = rays(500, 1.0);
    with_tracer(&scene, |tracer| {
        assert!(tracer.has_clock(), "this driver has one");
        let ticks = tracer.ticks(&rays).expect("traced");
        let hits = tracer.closest(&rays).expect("traced");
        assert!(ticks.iter().zip(&hits).all(|(ray, hit)| ray.is_hit == hit.is_some()));
        assert!(ticks.iter().filter(|ray| ray.ticks > 0).count() > 400);
    });
}
