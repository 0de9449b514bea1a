//! On a device, with the validation layer listening: without a device, or with a message, the tests fail.

mod alpha;
mod brute_force;
mod budget;
mod builds;
mod hits;
mod memory;
mod scenes;
mod truth;
mod verify;

use std::sync::Mutex;

use super::*;
use crate::scene::Scene;
use crate::verify::Hit;
use crate::verify::rays::Ray;

/// Drivers are not asked to serve several devices at once.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Runs a test on a device of its own, and has every call checked.
fn on_device(test: impl FnOnce(&mut Device)) {
    on_device_with(Options { validation: true, ..Options::default() }, test);
}

/// Runs a test that would keep the validation layer busy for minutes, or that does what the layer is against.
fn on_unchecked_device(test: impl FnOnce(&mut Device)) {
    on_device_with(Options::default(), test);
}

fn on_device_with(options: Options, test: impl FnOnce(&mut Device)) {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(|e| e.into_inner());
    let vulkan = Vulkan::load(options).expect("tests/install_vulkan.sh was run");
    let mut device = vulkan.open(&Wanted::Auto).expect("tests/install_vulkan.sh installs a driver");
    test(&mut device);
    // What was not freed is told when the device goes.
    drop(device);
    assert_eq!(vulkan.take_validation_messages(), Vec::<String>::new());
}

/// What rays hit first in a scene.
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
    // A pool of no queries is against the rules.
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
