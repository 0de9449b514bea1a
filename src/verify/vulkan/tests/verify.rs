//! Complete verifications on a device: correct pairs pass, and its rays detect planted faults.

use std::sync::Arc;

use glam::DAffine3;

use super::*;
use crate::verify::cpu::{Reference, TwoLevel};
use crate::verify::test_scenes::room;
use crate::verify::tests::{baked, tilted};
use crate::verify::{Exact, Failure, Sides, Verification, VerifyOptions, seams, verify, verify_with};

fn options() -> VerifyOptions {
    VerifyOptions { rays_per_kind: 1024, repeats: 1, ..VerifyOptions::default() }
}

fn on(device: &Device, before: &Scene, after: &Scene, options: &VerifyOptions) -> Verification {
    let trees = TwoLevel::build(before);
    let pipelines = Pipelines::new(device).expect("made");
    let build = |scene| VulkanTracer::new(&pipelines, scene, options.build).expect("built");
    let tracers = [build(before), build(after)];
    verify_with(
        Sides { before, after },
        Exact::of_scenes(Sides { before, after }, options).as_ref(),
        &Reference::new(&trees),
        Sides { before: &tracers[0], after: &tracers[1] },
        options,
    )
    .expect("traced")
}

#[test]
fn a_bake_shows_the_same_on_a_device_as_on_the_cpu() {
    on_device(|device| {
        for after in [room(), baked(&room(), DAffine3::IDENTITY), baked(&room(), tilted())] {
            let found = on(device, &room(), &after, &options());
            assert!(found.passed(), "{found}");
            assert_eq!((found.mismatches, found.tracer_faults), (0, 0), "{found:?}");
            let on_cpu = verify(&room(), &after, &options());
            assert_eq!((found.rays, found.hits), (on_cpu.rays, on_cpu.hits));
            assert_eq!(found.device, device.info().name);
            // Software drivers intersect less accurately than the CPU tracer.
            assert!(found.max_relative_distance_error < 1e-3, "{}", found.max_relative_distance_error);
        }
    });
}

#[test]
fn cracks_between_groups_in_frames_of_their_own_are_found_on_a_device() {
    on_device(|device| {
        let torus = seams::tests::one(seams::tests::torus());
        let after = |frames| seams::tests::cut(&torus, frames, 12);
        let cracked = on(device, &torus, &after([tilted(), DAffine3::IDENTITY]), &options());
        assert!(matches!(cracked.failures[..], [Failure::Seams(_)]), "{cracked}");
        assert!(cracked.seams.across_groups.after_lost > 10, "{:?}", cracked.seams);
        let sound = on(device, &torus, &after([DAffine3::IDENTITY; 2]), &options());
        assert!(sound.passed(), "{sound}");
        assert_eq!((sound.seams.rays, sound.seams.opened, sound.seams.closed), (1024, 0, 0));
    });
}

#[test]
fn what_was_built_is_reported_for_both_files() {
    on_device(|device| {
        let found = on(device, &room(), &baked(&room(), DAffine3::IDENTITY), &options());
        let built = found.structures.expect("a device was used");
        assert_eq!((built.blases.before, built.blases.after), (2, 1));
        assert_eq!((built.tlas_instances.before, built.tlas_instances.after), (6, 1));
        assert!(built.blas_bytes.before > 0 && built.blas_bytes_compacted.is_some_and(|b| b.after > 0));
        let json = serde_json::to_value(&found).expect("serialises");
        for key in ["blas_bytes", "blas_bytes_compacted", "tlas_bytes", "blas_build_ms", "tlas_build_ms"] {
            assert!(json[key]["before"].as_f64() > Some(0.0) && json[key]["after"].as_f64() > Some(0.0), "{key}");
        }
        let on_cpu = serde_json::to_value(verify(&room(), &room(), &options())).expect("serialises");
        assert!(on_cpu.get("blas_bytes").is_none());
    });
}

#[test]
fn other_rays_are_timed_than_compared_where_asked_for() {
    on_device(|device| {
        let asked = VerifyOptions { timed_rays_per_kind: Some(5000), ..options() };
        let found = on(device, &room(), &room(), &asked);
        assert_eq!(found.rays, 4 * 1024);
        assert!(found.kinds.values().all(|k| k.before_mrays_per_s > 0.0 && k.after_mrays_per_s > 0.0));
    });
}

/// Returns named faults, each with the scene that has it.
fn planted() -> Vec<(&'static str, Scene)> {
    let change = |change: &dyn Fn(&mut Scene)| {
        let mut after = room();
        change(&mut after);
        after
    };
    vec![
        ("a moved vertex", change(&|s| Arc::make_mut(&mut s.meshes[1].geometries[0].positions)[4].x += 0.05)),
        ("a lost triangle", change(&|s| s.meshes[0].geometries[0].triangles[3] = [0; 3])),
        ("a wrong material", change(&|s| s.meshes[1].geometries[1].material = Some(3))),
        ("a flipped triangle", change(&|s| s.meshes[0].geometries[0].triangles[5].swap(0, 1))),
        ("a moved instance", change(&|s| s.instances[3].transform.translation.z += 0.1)),
        ("a missing triangle", change(&|s| s.meshes[0].geometries[0].triangles.truncate(11))),
        ("a missing instance", change(&|s| drop(s.instances.pop()))),
        (
            "a mirrored instance",
            change(&|s| s.instances[2].transform *= DAffine3::from_scale(glam::DVec3::new(1.0, 1.0, -1.0))),
        ),
    ]
}

#[test]
fn planted_faults_are_seen() {
    on_device(|device| {
        for (fault, after) in planted() {
            let found = on(device, &room(), &after, &options());
            assert!(!found.passed() && found.mismatches > 0, "{fault}: {found:?}");
        }
    });
}
