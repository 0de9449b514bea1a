//! Tests on a device with the validation layer: they fail without a device or if the layer reports anything.

mod alpha;
mod batch;
mod brute_force;
mod budget;
mod builds;
mod hits;
mod memory;
mod moving;
mod scenes;
mod truth;
mod verify;

use std::sync::Mutex;

use super::*;
use crate::scene::Scene;
use crate::verify::Hit;
use crate::verify::rays::Ray;

/// Drivers are not required to support several devices at once.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Runs a test on its own device, with every call checked.
fn on_device(test: impl FnOnce(&mut Device)) {
    on_device_with(Options { validation: true, ..Options::default() }, test);
}

/// Runs a test that would take minutes with the validation layer, or that deliberately breaks its rules.
fn on_unchecked_device(test: impl FnOnce(&mut Device)) {
    on_device_with(Options::default(), test);
}

fn on_device_with(options: Options, test: impl FnOnce(&mut Device)) {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(|e| e.into_inner());
    let vulkan = Vulkan::load(options).expect("tests/install_vulkan.sh was run");
    let mut device = vulkan.open(&Wanted::Auto).expect("tests/install_vulkan.sh installs a driver");
    test(&mut device);
    // The layer reports leaked objects when the device is destroyed.
    drop(device);
    assert_eq!(vulkan.take_validation_messages(), Vec::<String>::new());
}

/// Returns the closest hits of rays in a scene.
fn closest(device: &Device, scene: &Scene, rays: &[Ray], options: BuildOptions) -> Vec<Option<Hit>> {
    scene.check().expect("a sound scene");
    let pipelines = Pipelines::new(device).expect("pipelines are made");
    let tracer = VulkanTracer::new(&pipelines, scene, options).expect("the structures are built");
    let rays = device.upload_rays(rays).expect("rays fit");
    tracer.trace(&rays, false).expect("rays are traced").hits
}

#[test]
fn the_validation_layer_is_heard() {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(|e| e.into_inner());
    let vulkan =
        Vulkan::load(Options { validation: true, ..Options::default() }).expect("tests/install_vulkan.sh was run");
    let device = vulkan.open(&Wanted::Auto).expect("tests/install_vulkan.sh installs a driver");
    // A query pool without queries is invalid.
    drop(super::commands::Queries::new(&device, ash::vk::QueryType::TIMESTAMP, 0));
    drop(device);
    assert!(!vulkan.take_validation_messages().is_empty());
}

#[test]
fn devices_are_listed_with_what_they_can_do() {
    let vulkan = Vulkan::load(Options::default()).expect("tests/install_vulkan.sh was run");
    let devices = vulkan.devices().expect("devices are listed");
    let able = devices.iter().find(|d| d.can_trace()).expect("a device that can trace rays");
    assert!(!able.name.is_empty() && !able.driver.is_empty() && able.vulkan_version.starts_with("1."));
    assert!(able.extensions.iter().any(|e| e == "VK_KHR_ray_tracing_pipeline"));
    assert!(able.limits.instances >= 1 << 20 && able.limits.max_allocation >= 1 << 30);
    assert!(able.memory() > 0);
    for (i, device) in devices.iter().enumerate() {
        assert_eq!(device.index, i);
    }
}
