//! Every method's layout on a device: each ray has the same hit as in the CPU tracer.

use crate::common::samples;
use raykiln::emit;
use raykiln::methods::{self, Method};
use raykiln::scene::{self, LoadOptions, Scene};
use raykiln::verify::cpu::{CpuTracer, Reference, TwoLevel};
use raykiln::verify::rays::{self, Sampling};
use raykiln::verify::vulkan::{BuildOptions, Device, Options, Pipelines, Vulkan, VulkanTracer, Wanted};
use raykiln::verify::{Hit, Tracer};

/// Number of rays of each kind.
const RAYS: usize = 500;

fn open() -> (Vulkan, Device) {
    let vulkan =
        Vulkan::load(Options { validation: true, ..Options::default() }).expect("tests/install_vulkan.sh was run");
    let device = vulkan.open(&Wanted::Name("llvmpipe".into())).expect("tests/install_vulkan.sh installs it");
    (vulkan, device)
}

/// The scene of a file in the layout of a method.
fn laid_out(document: &raykiln_formats::Document, scene: &Scene, method: Method) -> Scene {
    let layout = methods::run(method, scene, &methods::Options::default());
    let emitted = emit::emit(document, scene, &layout, &emit::Options::default());
    scene::load(&emitted.document, &LoadOptions::default()).expect("what is emitted is sound").0
}

/// Whether two hits are at the same place on the same side; a ray through an edge may hit either triangle.
fn agree(a: &Option<Hit>, b: &Option<Hit>, far: f64) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => (f64::from(a.t) - f64::from(b.t)).abs() <= far && a.front == b.front,
        (a, b) => a.is_none() == b.is_none(),
    }
}

#[test]
fn every_method_is_hit_on_a_device_as_on_the_cpu() {
    let (vulkan, device) = open();
    let pipelines = Pipelines::new(&device).expect("made");
    let mut layouts = 0;
    for name in ["overlapping", "instanced", "copies", "hierarchy", "scattered", "transparent"] {
        let file = samples().into_iter().find(|s| s.name == name).expect("the sample is there").scene;
        let document = raykiln_formats::read(&file).expect("a sample is read");
        let (before, _) = scene::load(&document, &LoadOptions::default()).expect("a sample has triangles");
        let rays = rays::generate(&before, &Reference::new(&TwoLevel::build(&before)), &Sampling::new(RAYS, 1));
        let (far, all) = (1e-4 * rays.radius, rays.kinds.values().flatten().copied().collect::<Vec<_>>());
        for method in Method::ALL {
            let after = laid_out(&document, &before, method);
            let (trees, name) = (TwoLevel::build(&after), format!("{name} {method:?}"));
            let on_cpu = CpuTracer::new(&trees);
            let tracer = VulkanTracer::new(&pipelines, &after, BuildOptions::default()).expect("built");
            let expected = on_cpu.closest(&all);
            let found = tracer.closest(&device.upload_rays(&all).expect("uploaded")).expect("traced");
            let differ = expected.iter().zip(&found).filter(|(a, b)| !agree(a, b, far)).count();
            // A ray that grazes a silhouette may hit or miss.
            assert!(differ <= 2, "{name}: {differ} of {} rays differ", all.len());
            let same = |(a, b): (&Option<Hit>, &Option<Hit>)| {
                a.zip(*b).is_some_and(|(a, b)| (a.instance, a.triangle) == (b.instance, b.triangle))
            };
            let (same, hits) =
                (expected.iter().zip(&found).filter(|p| same(*p)).count(), expected.iter().flatten().count());
            assert!(hits > RAYS / 10 && 10 * same > 9 * hits, "{name}: {same} of {hits} hit the same triangle");
            layouts += 1;
        }
    }
    assert!(layouts >= 30, "{layouts} layouts");
    drop(pipelines);
    drop(device);
    assert_eq!(vulkan.take_validation_messages(), Vec::<String>::new());
}
