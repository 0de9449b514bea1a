//! Checks the rays of a verification of the samples against the truth in double precision.

use std::path::{Path, PathBuf};

use super::*;
use crate::scene::{LoadOptions, load};
use crate::verify::cpu::{Reference, TwoLevel};
use crate::verify::rays::{self, Sampling};

/// Distances that differ by more than this, in radii of the scene, belong to different surfaces.
const FAR: f64 = 1e-4;

fn samples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    let folders = std::fs::read_dir(folder).expect("there are samples").map(|e| e.expect("readable").path());
    let files = folders.filter(|f| f.is_dir()).flat_map(|f| std::fs::read_dir(f).expect("readable"));
    let mut scenes: Vec<PathBuf> = files
        .map(|e| e.expect("readable").path())
        .filter(|f| f.extension().is_some_and(|e| e == "obj" || e == "glb" || e == "gltf"))
        .collect();
    scenes.sort_unstable();
    scenes
}

#[test]
fn samples_are_seen_as_they_are() {
    let samples = samples();
    assert!(samples.len() >= 8, "{} samples", samples.len());
    on_device(|device| {
        let pipelines = Pipelines::new(device).expect("made");
        for file in samples {
            let document = raykiln_formats::read(&file).expect("a sample is read");
            let (scene, _) = load(&document, &LoadOptions::default()).expect("a sample has triangles");
            assert_truth(&pipelines, &scene, &file.display().to_string());
        }
    });
}

fn assert_truth(pipelines: &Pipelines<'_>, scene: &Scene, name: &str) {
    let trees = TwoLevel::build(scene);
    let reference = Reference::new(&trees);
    let rays = rays::generate(scene, &reference, &Sampling::new(256, 1));
    let all = rays.kinds.values().flatten().copied().collect::<Vec<_>>();
    let tracer = VulkanTracer::new(pipelines, scene, BuildOptions::default()).expect("built");
    let buffer = pipelines.device().upload_rays(&all).expect("uploaded");
    let hits = tracer.trace(&buffer, false).expect("traced").hits;
    let truth = reference.closest(&all);
    let agrees = |pair: (&Option<Hit>, &Option<crate::verify::cpu::TrueHit>)| match pair {
        (Some(hit), Some(truth)) => (f64::from(hit.t) - truth.t).abs() <= FAR * rays.radius,
        (hit, truth) => hit.is_none() == truth.is_none(),
    };
    let differ = hits.iter().zip(&truth).filter(|pair| !agrees(*pair)).count();
    // A ray that grazes a silhouette may hit or miss.
    assert!(differ <= 2, "{name}: {differ} of {} rays differ", all.len());
    let same = |(hit, truth): (&Option<Hit>, &Option<crate::verify::cpu::TrueHit>)| match (hit, truth) {
        (Some(h), Some(t)) if (h.instance, h.triangle) == (t.at.instance, t.at.triangle) => Some(h.front == t.front),
        _ => None,
    };
    let sides: Vec<bool> = hits.iter().zip(&truth).filter_map(same).collect();
    assert!(sides.iter().all(|&same| same), "{name}: sides differ");
    assert!(2 * sides.len() > hits.iter().flatten().count(), "{name}: the same triangles are hit");
}
