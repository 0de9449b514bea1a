//! Devices with memory for only one layout at a time, or for none.

use std::sync::Arc;

use glam::DAffine3;

use super::*;
use crate::verify::test_scenes::room;
use crate::verify::tests::{baked, tilted};
use crate::verify::{Machine, Note, Verification, VerifyOptions};

fn options() -> VerifyOptions {
    VerifyOptions { rays_per_kind: 1024, repeats: 2, ..VerifyOptions::default() }
}

/// Returns the verification with a limit on device memory, and the peak use.
fn found(device_memory: Option<u64>, named: bool, after: &Scene, options: &VerifyOptions) -> (Verification, u64) {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(|e| e.into_inner());
    let vulkan = Vulkan::load(Options { validation: true, device_memory }).expect("tests/install_vulkan.sh was run");
    let device = vulkan.open(&Wanted::Auto).expect("tests/install_vulkan.sh installs a driver");
    let machine = Machine::of(device, named);
    let found = machine.verify(&room(), after, options).expect("one way or another");
    let peak = machine.device_peak();
    drop(machine);
    assert_eq!(vulkan.take_validation_messages(), Vec::<String>::new());
    (found, peak)
}

/// Returns the results that do not depend on the clock.
fn seen(found: &Verification) -> impl PartialEq + std::fmt::Debug + use<> {
    let built = found.structures.expect("a device was used");
    let errors = [found.max_relative_distance_error, found.before_max_relative_distance_error];
    let counts = [found.rays, found.hits, found.mismatches, found.silhouettes, found.ties, found.far_hits];
    (counts, found.tracer_faults, errors, built.blas_bytes_compacted, built.any_hit_invocations, found.failures.clone())
}

#[test]
fn layouts_that_do_not_fit_together_are_traced_one_after_the_other_and_seen_alike() {
    let wrong = {
        let mut after = room();
        Arc::make_mut(&mut after.meshes[1].geometries[0].positions)[4].x += 0.05;
        after
    };
    let more = VerifyOptions { timed_rays_per_kind: Some(3000), ..options() };
    for (after, options) in [(baked(&room(), DAffine3::IDENTITY), options()), (room(), more), (wrong, options())] {
        let (together, most) = found(None, true, &after, &options);
        assert_eq!(together.notes, []);
        for named in [true, false] {
            let (apart, used) = found(Some(most - 1), named, &after, &options);
            assert!(used < most, "{used} bytes of {most}");
            assert_eq!(seen(&apart), seen(&together));
            assert_eq!(apart.device, together.device);
            let [Note::NotInTurns(why)] = &apart.notes[..] else { panic!("{:?}", apart.notes) };
            assert!(why.contains("out of device memory for"), "{why}");
            let timed = |k: &crate::verify::speed::KindSpeed| k.before_mrays_per_s > 0.0 && k.after_mrays_per_s > 0.0;
            assert!(apart.kinds.values().all(timed), "{:?}", apart.kinds);
        }
    }
}

#[test]
fn a_layout_that_does_not_fit_alone_is_traced_on_the_cpu() {
    for after in [room(), baked(&room(), tilted())] {
        let on_cpu = crate::verify::verify(&room(), &after, &options());
        for (memory, named) in [(0, true), (0, false), (40_000, true), (40_000, false)] {
            let (found, used) = found(Some(memory), named, &after, &options());
            assert!(used <= memory && found.passed(), "{found}");
            assert_eq!((&found.device, found.rays, found.hits), (&on_cpu.device, on_cpu.rays, on_cpu.hits));
            assert!(found.structures.is_none());
            let [note] = &found.notes[..] else { panic!("{:?}", found.notes) };
            let note = note.to_string();
            assert!(note.starts_with("rays are traced on the CPU: out of device memory for"), "{note}");
        }
    }
}

#[test]
fn a_budget_that_is_kept_changes_nothing() {
    let (free, most) = found(None, true, &room(), &options());
    let (exact, used) = found(Some(most), true, &room(), &options());
    assert_eq!((seen(&exact), used, exact.notes), (seen(&free), most, Vec::new()));
}
