//! Pictures whose rays a device traces: the same as those of the CPU within rounding.

use crate::common::{raykiln, samples};
use raykiln::render::{CameraChoice, RenderOptions, Renderer, Unit, View};
use raykiln::scene::{self, LoadOptions};
use raykiln::verify::batch::BatchTracer;
use raykiln::verify::vulkan::{BuildOptions, Options, Pipelines, Vulkan, VulkanTracer, Wanted};
use std::path::PathBuf;
use tempfile::TempDir;

/// Share of the pixels that may differ: those with a sample that grazes a silhouette.
const SILHOUETTES: f64 = 0.005;
/// Difference of a channel, of 255, that rounding does not explain.
const SEEN: u8 = 3;

fn sample(name: &str) -> PathBuf {
    samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene
}

/// Calls `check` with a renderer of a sample and the tracer of its scene; the validation layer must say nothing.
fn on_device(name: &str, check: impl FnOnce(&Renderer, &dyn BatchTracer)) {
    let vulkan =
        Vulkan::load(Options { validation: true, ..Options::default() }).expect("tests/install_vulkan.sh was run");
    let device = vulkan.open(&Wanted::Name("llvmpipe".into())).expect("tests/install_vulkan.sh installs it");
    let document = raykiln_formats::read(&sample(name)).expect("a sample is read");
    let (scene, _) = scene::load(&document, &LoadOptions::default()).expect("a sample has triangles");
    let renderer = Renderer::new(&document, &scene).expect("something to see");
    let pipelines = Pipelines::new(&device).expect("made");
    let tracer = VulkanTracer::new(&pipelines, &scene, BuildOptions::default()).expect("built");
    check(&renderer, &tracer);
    drop(tracer);
    drop(pipelines);
    drop(device);
    assert_eq!(vulkan.take_validation_messages(), Vec::<String>::new());
}

#[test]
fn every_view_is_the_same_on_a_device_but_for_silhouettes() {
    for name in ["textured", "transparent", "instanced"] {
        on_device(name, |renderer, device| {
            let camera = renderer.camera(&CameraChoice::Default).expect("there is one");
            let options = RenderOptions { size: [64, 36], samples: Some(4), ..RenderOptions::default() };
            for view in View::ALL.into_iter().filter(|view| *view != View::Heatmap) {
                let expected = renderer.picture(view, &camera, &options).expect("sound options");
                let found = renderer.picture_on(device, view, &camera, &options).expect("sound options");
                let pixels = expected.pixels.chunks(3).zip(found.pixels.chunks(3));
                let differ = pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > SEEN)).count();
                let share = differ as f64 / (64.0 * 36.0);
                assert!(share <= SILHOUETTES, "{name}, {}: {differ} pixels differ", view.name());
                assert!(found.statistics.seen_ratio > 0.01, "{name}, {} shows nothing", view.name());
            }
            let same = renderer.difference_on([device; 2], renderer, &camera, &options).expect("sound options");
            assert_eq!(same.statistics.differences.map(|d| (d.mean_absolute, d.surface_pixels)), Some((0.0, 0)));
        });
    }
}

#[test]
fn the_heat_map_shows_the_clock_of_the_device() {
    on_device("overlapping", |renderer, device| {
        assert!(device.has_clock(), "this driver has one");
        let camera = renderer.camera(&CameraChoice::Default).expect("there is one");
        let options = RenderOptions { size: [32, 18], scale: Some(1e6), ..RenderOptions::default() };
        let picture = renderer.picture_on(device, View::Heatmap, &camera, &options).expect("sound options");
        let values = picture.statistics.values.expect("it has values");
        assert_eq!((values.unit, values.scale), (Unit::Ticks, 1e6));
        assert!(values.mean > 1.0 && values.max >= values.mean && picture.statistics.steps.is_none(), "{values:?}");
        let counted = renderer.picture(View::Heatmap, &camera, &options).expect("sound options").statistics;
        assert!((counted.seen_ratio - picture.statistics.seen_ratio).abs() <= 0.01);
    });
}

#[test]
fn a_device_by_name_draws_the_picture_and_is_reported() {
    let folder = TempDir::new().expect("a temporary folder");
    let output = folder.path().join("out.png");
    let drawn = |more: &[&str]| {
        let fixed = ["--size", "16x9", "--samples", "1", "--json"];
        let (input, output) = (sample("clean"), output.to_str().expect("UTF-8"));
        let ran = raykiln(["render", input.to_str().expect("UTF-8"), "-o", output].iter().chain(&fixed).chain(more));
        assert!(ran.status == 0 && ran.json()["notes"] == serde_json::json!([]), "{}", ran.stderr);
        ran.json()
    };
    let name = drawn(&["--device", "llvmpipe"])["device"].as_str().expect("a name").to_owned();
    assert!(name.contains("llvmpipe"), "{name}");
    assert_eq!(drawn(&["--device", "cpu"])["device"], "CPU");
    let ticks = drawn(&["--device", "llvmpipe", "--view", "heatmap", "--scale", "5000"]);
    assert_eq!(ticks["statistics"]["values"]["unit"], "ticks");
}
