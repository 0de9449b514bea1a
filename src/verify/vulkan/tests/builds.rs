//! Build reports.

use glam::{DAffine3, DVec3};

use super::scenes::{mesh, mixed, rays, scene, soup};
use super::*;
use crate::scene::Opacity;

fn report(device: &Device, scene: &Scene, options: BuildOptions) -> BuildReport {
    let pipelines = Pipelines::new(device).expect("made");
    *VulkanTracer::new(&pipelines, scene, options).expect("built").report()
}

#[test]
fn reports_count_what_was_built() {
    on_device(|device| {
        let of_mesh = report(device, &mixed(), BuildOptions::default());
        assert_eq!((of_mesh.blases, of_mesh.tlas_instances, of_mesh.skipped_instances), (2, 6, 2));
        assert!(of_mesh.blas_build_ms > 0.0 && of_mesh.tlas_build_ms > 0.0);
        assert!(of_mesh.blas_bytes > 0 && of_mesh.tlas_bytes > 0);
        let per_primitive = BuildOptions { blas_per: BlasPer::Primitive, ..BuildOptions::default() };
        let of_primitive = report(device, &mixed(), per_primitive);
        assert_eq!((of_primitive.blases, of_primitive.tlas_instances, of_primitive.skipped_instances), (4, 12, 2));
        assert!(of_primitive.tlas_bytes > of_mesh.tlas_bytes);
    });
}

#[test]
fn compaction_never_takes_more() {
    on_device(|device| {
        let compacted = report(device, &mixed(), BuildOptions::default());
        let plain = report(device, &mixed(), BuildOptions { compact: false, ..BuildOptions::default() });
        assert!(compacted.blas_bytes_compacted.is_some_and(|b| b > 0 && b <= compacted.blas_bytes));
        assert_eq!(plain.blas_bytes_compacted, None);
    });
}

#[test]
fn of_10_000_blases_each_is_itself() {
    let at = |i: u32| DAffine3::from_translation(DVec3::new(f64::from(i % 100), f64::from(i / 100), 0.0) * 4.0);
    let meshes = (0..10_000).map(|i| mesh(vec![soup(1 + i % 3, Opacity::Opaque, i as u64)])).collect();
    let scene = scene(meshes, (0..10_000).map(|i| (i, at(i))));
    let aimed = |i: u32| {
        let corners = scene.world_corners(crate::scene::TriangleRef { instance: i, triangle: 0 });
        let center = (corners[0] + corners[1] + corners[2]) / 3.0;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let (origin, direction) = ((center + 1e-2 * normal).as_vec3(), (-normal).as_vec3());
        Ray { origin, direction, t_min: 0.0, t_max: 1.0 }
    };
    let rays: Vec<Ray> = (0..10_000).map(aimed).collect();
    on_unchecked_device(|device| {
        // Forces the storage into many buffers.
        device.limits_mut().max_allocation = 4 << 20;
        let hits = closest(device, &scene, &rays, BuildOptions::default());
        let hit = (0..).zip(&hits).filter(|(i, h)| h.is_some_and(|h| h.instance == *i && h.front)).count();
        assert!(hit > 9_990, "{hit} hit what they are aimed at");
    });
}

#[test]
fn a_scene_beyond_a_limit_is_refused_by_name() {
    on_device(|device| {
        device.limits_mut().primitives = 100;
        let pipelines = Pipelines::new(device).expect("made");
        let error = VulkanTracer::new(&pipelines, &mixed(), BuildOptions::default()).err().expect("it is too large");
        assert!(matches!(&error, Error::Limit { what, count: 131, limit: 100 } if what.contains("mesh 0")), "{error}");
    });
}

#[test]
fn time_is_measured_for_either_kind_of_ray() {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let tracer = VulkanTracer::new(&pipelines, &mixed(), BuildOptions::default()).expect("built");
        let rays = device.upload_rays(&rays(10_000, 2.0)).expect("uploaded");
        assert_eq!(rays.len(), 10_000);
        for any_hit in [false, true] {
            let ms = tracer.time(&rays, any_hit).expect("timed");
            assert!(ms > 0.0 && ms < 60_000.0, "{ms} ms");
        }
        let none = device.upload_rays(&[]).expect("nothing fits");
        assert!(none.is_empty() && tracer.time(&none, false).is_ok());
    });
}

#[test]
fn tracers_share_rays_and_go_in_any_order() {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let rays = device.upload_rays(&rays(100, 2.0)).expect("uploaded");
        let build = |options| VulkanTracer::new(&pipelines, &mixed(), options).expect("built");
        let first = build(BuildOptions::default());
        let second = build(BuildOptions { compact: false, ..BuildOptions::default() });
        let before = first.trace(&rays, false).expect("traced");
        drop(first);
        assert_eq!(second.trace(&rays, false).expect("traced"), before);
    });
}
