//! Scenes that move: the hits of refitted and rebuilt TLASes, and their memory.

use glam::{DAffine3, DVec3};

use super::*;
use crate::verify::PerKind;
use crate::verify::check_hits;
use crate::verify::cpu::{CpuTracer, Reference, TwoLevel};
use crate::verify::frames::{FramePlan, FrameTracer, Upkeep};
use crate::verify::random::Random;
use crate::verify::test_scenes::{cube, scene};

/// Boxes that fly through a cube of side 20, each along its own way.
fn flying(count: usize, time: f64) -> Scene {
    let place = |i: usize| {
        let mut random = Random::at(9, 400, i);
        let home = 20.0 * (DVec3::new(random.unit(), random.unit(), random.unit()) - 0.5);
        let (direction, axis) = (random.direction(), random.direction());
        let motion = DAffine3::from_axis_angle(axis, time * random.unit());
        (0, DAffine3::from_translation(home + time * direction) * motion * DAffine3::from_scale(DVec3::splat(0.4)))
    };
    scene(vec![cube(0, None)], &(0..count).map(place).collect::<Vec<_>>())
}

fn some_rays() -> Vec<Ray> {
    super::scenes::rays(1500, 10.0)
}

fn plan(refits: &[bool]) -> FramePlan {
    FramePlan { refits: refits.to_vec(), deforming: Vec::new(), build: BuildOptions::default() }
}

#[test]
fn after_64_frames_of_1000_instances_the_hits_are_those_of_the_cpu_and_memory_has_not_grown() {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let start = flying(1000, 0.0);
        let mut frames = VulkanFrames::new(&pipelines, &start, &plan(&[true, true, false])).expect("built");
        let rays = PerKind::of(|_| some_rays()[..64].to_vec());
        let every = [u32::MAX, 8, 1];
        let mut memory = Vec::new();
        for frame in 0..64 {
            let scene = flying(1000, 0.1 * f64::from(frame));
            frames.set_rays(&rays).expect("they fit");
            for (tlas, every) in every.into_iter().enumerate() {
                let upkeep = if frame % every == 0 { Upkeep::Rebuild } else { Upkeep::Refit };
                let times = frames.frame(tlas, &scene, upkeep, frame % 16 == 0).expect("traced");
                assert_eq!(times.upkeep, upkeep);
                assert!(
                    times.upload_ms >= 0.0 && times.upkeep_ms > 0.0 && times.trace_ms.is_some() == (frame % 16 == 0)
                );
            }
            memory.push(frames.bytes(0).device);
        }
        assert!(memory.iter().all(|bytes| *bytes == memory[0] && *bytes > Some(0)), "{memory:?}");

        let last = flying(1000, 6.3);
        let (trees, rays) = (TwoLevel::build(&last), some_rays());
        let on_cpu = CpuTracer::new(&trees).closest(&rays);
        let key = |hits: &[Option<Hit>]| hits.iter().map(|h| h.map(|h| (h.instance, h.triangle))).collect::<Vec<_>>();
        for tlas in 0..3 {
            let hits = frames.closest(tlas, &rays).expect("traced");
            let checked = check_hits::check(&last, &Reference::new(&trees).closest(&rays), &rays, &hits);
            assert!(checked.wrong == 0 && checked.hits > 700, "{checked:?}");
            let differ = key(&hits).iter().zip(key(&on_cpu)).filter(|(device, cpu)| **device != *cpu).count() as u64;
            assert!(
                differ <= checked.ties + checked.silhouettes + 2,
                "{differ} hits differ from the CPU's: {checked:?}"
            );
        }
    });
}

#[test]
fn instances_may_become_flat_and_come_back() {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let (whole, mut flat) = (flying(30, 0.0), flying(30, 0.0));
        for instance in flat.instances.iter_mut().step_by(2) {
            instance.transform.matrix3.y_axis = DVec3::ZERO;
        }
        flat.boxes = Default::default();
        let rays = some_rays();
        for (first, second) in [(&whole, &flat), (&flat, &whole)] {
            let mut frames = VulkanFrames::new(&pipelines, first, &plan(&[true])).expect("built");
            for (scene, upkeep) in [(first, Upkeep::Rebuild), (second, Upkeep::Refit), (first, Upkeep::Refit)] {
                frames.frame(0, scene, upkeep, false).expect("updated");
                let trees = TwoLevel::build(scene);
                let hits = frames.closest(0, &rays).expect("traced");
                let checked = check_hits::check(scene, &Reference::new(&trees).closest(&rays), &rays, &hits);
                assert!(checked.wrong == 0 && checked.hits > 10, "{checked:?}");
            }
        }
    });
}

#[test]
fn the_first_frame_is_built_whatever_is_asked_for_and_nothing_may_move() {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let nothing = Scene::default();
        let mut frames = VulkanFrames::new(&pipelines, &nothing, &plan(&[true])).expect("built");
        let times = frames.frame(0, &nothing, Upkeep::Refit, false).expect("built");
        assert_eq!(times.upkeep, Upkeep::Rebuild);
        assert_eq!(frames.closest(0, &some_rays()[..5]).expect("traced"), vec![None; 5]);
        let times = frames.frame(0, &nothing, Upkeep::Refit, false).expect("refitted");
        assert_eq!(times.upkeep, Upkeep::Refit);
    });
}

#[test]
fn meshes_that_deform_are_hit_where_they_are_whether_refitted_or_rebuilt() {
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        let bent = |by: f32| {
            let mut bent = super::scenes::mixed();
            for geometry in &mut bent.meshes[0].geometries {
                geometry.positions = geometry.positions.iter().map(|p| *p + by * p.y * p.y * glam::Vec3::X).collect();
            }
            bent.meshes[0].extent = Default::default();
            bent.boxes = Default::default();
            bent
        };
        let rays = super::scenes::rays(1500, 3.0);
        for per in [BlasPer::Mesh, BlasPer::Primitive] {
            let build = BuildOptions { blas_per: per, ..BuildOptions::default() };
            let plan = FramePlan { refits: vec![true], deforming: vec![0], build };
            let mut frames = VulkanFrames::new(&pipelines, &bent(0.0), &plan).expect("built");
            let mut memory = Vec::new();
            for (frame, upkeep) in [(1, Upkeep::Refit), (2, Upkeep::Rebuild), (3, Upkeep::Refit), (0, Upkeep::Refit)] {
                let scene = bent(0.7 * frame as f32);
                assert!(frames.deform(&scene, &[0], upkeep).expect("deformed") > 0.0);
                frames.frame(0, &scene, upkeep, false).expect("updated");
                let trees = TwoLevel::build(&scene);
                let hits = frames.closest(0, &rays).expect("traced");
                let checked = check_hits::check(&scene, &Reference::new(&trees).closest(&rays), &rays, &hits);
                assert!(checked.wrong == 0 && checked.hits > 50, "{checked:?}");
                memory.push(frames.bytes(0).device);
            }
            assert!(memory.iter().all(|bytes| *bytes == memory[0]), "{memory:?}");
        }
    });
}
