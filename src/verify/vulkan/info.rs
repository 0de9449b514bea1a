//! Properties and capabilities of a device.

use std::ffi::CStr;

use ash::{khr, vk};

use super::Error;

/// The required extensions besides Vulkan 1.2. No others are required, because data-centre GPUs lack ray queries and
/// position fetch.
pub(super) const NEEDED: [&CStr; 3] =
    [khr::acceleration_structure::NAME, khr::ray_tracing_pipeline::NAME, khr::deferred_host_operations::NAME];

/// Substrings that identify extensions related to ray tracing.
const RAY_TRACING_WORDS: [&str; 5] =
    ["acceleration_structure", "_ray_", "deferred_host_operations", "micromap", "shader_invocation_reorder"];

/// Description of a Vulkan device.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Position in the list of devices.
    pub index: usize,
    /// Name, such as `NVIDIA H200`.
    pub name: String,
    /// Driver name and version, such as `NVIDIA 580.159.03`.
    pub driver: String,
    /// Supported Vulkan version, such as `1.4.312`.
    pub vulkan_version: String,
    /// Whether the device is a software driver that runs on the CPU.
    pub is_software: bool,
    /// Extensions related to ray tracing, sorted.
    pub extensions: Vec<String>,
    /// Extensions and features it lacks for tracing rays; empty if it can trace.
    pub missing: Vec<String>,
    /// Whether shaders can read a clock (`VK_KHR_shader_clock`), by which the time of each ray is measured.
    pub has_clock: bool,
    /// Limits relevant to ray tracing.
    pub limits: Limits,
    /// Memory heaps.
    pub heaps: Vec<Heap>,
}

/// Limits of a device; all zero if it cannot trace rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Largest number of instances in a TLAS.
    pub instances: u64,
    /// Largest number of geometries in a BLAS.
    pub geometries: u64,
    /// Largest number of triangles in a BLAS.
    pub primitives: u64,
    /// Alignment of scratch memory, in bytes.
    pub scratch_alignment: u64,
    /// Largest size of one allocation, in bytes.
    pub max_allocation: u64,
    /// Largest number of rays of one launch in one dimension.
    pub rays_per_launch: u64,
    /// Size of a shader group handle, in bytes.
    pub(super) handle_size: u64,
    /// Alignment of each region of the shader binding table, in bytes.
    pub(super) table_alignment: u64,
}

/// A memory heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heap {
    /// Size in bytes.
    pub bytes: u64,
    /// Whether the heap is device-local.
    pub on_device: bool,
}

impl DeviceInfo {
    /// Whether the device can trace rays.
    pub fn can_trace(&self) -> bool {
        self.missing.is_empty()
    }

    /// Returns the size of the device-local memory, in bytes.
    pub fn memory(&self) -> u64 {
        self.heaps.iter().filter(|h| h.on_device).map(|h| h.bytes).sum()
    }
}

/// The queue family used to build, trace and copy, which supports timestamps.
#[derive(Clone, Copy, Debug)]
pub(super) struct QueueFamily {
    pub(super) index: u32,
    /// Number of valid bits in a timestamp.
    pub(super) timestamp_bits: u32,
}

/// Describes a device.
pub(super) fn describe(
    instance: &ash::Instance,
    device: vk::PhysicalDevice,
    index: usize,
) -> Result<DeviceInfo, Error> {
    // SAFETY: the device belongs to the instance, as in all calls in this file.
    let core = unsafe { instance.get_physical_device_properties(device) };
    let name = core.device_name_as_c_str().map(lossy).unwrap_or_default();
    // SAFETY: as above.
    let mut extensions: Vec<String> = unsafe { instance.enumerate_device_extension_properties(device) }
        .map_err(|e| Error::call(&format!("listing the extensions of `{name}`"), 0, e))?
        .iter()
        .filter_map(|e| e.extension_name_as_c_str().ok().map(lossy))
        .collect();
    extensions.sort_unstable();
    let mut info = DeviceInfo {
        index,
        name,
        driver: String::new(),
        vulkan_version: version(core.api_version),
        is_software: core.device_type == vk::PhysicalDeviceType::CPU,
        extensions,
        missing: Vec::new(),
        has_clock: false,
        limits: Limits::default(),
        heaps: heaps(instance, device),
    };
    if core.api_version >= vk::API_VERSION_1_2 {
        info.driver = driver(instance, device);
        info.missing = missing(instance, device, &info.extensions);
    } else {
        info.missing.push("Vulkan 1.2".into());
    }
    if info.can_trace() {
        info.has_clock = has_clock(instance, device, &info.extensions);
        info.limits = limits(instance, device, &core.limits);
    }
    info.extensions.retain(|e| RAY_TRACING_WORDS.iter().any(|w| e.contains(w)));
    Ok(info)
}

fn lossy(s: &CStr) -> String {
    s.to_string_lossy().into_owned()
}

fn version(v: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v))
}

fn heaps(instance: &ash::Instance, device: vk::PhysicalDevice) -> Vec<Heap> {
    // SAFETY: see `describe`.
    let memory = unsafe { instance.get_physical_device_memory_properties(device) };
    let heap =
        |h: &vk::MemoryHeap| Heap { bytes: h.size, on_device: h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL) };
    memory.memory_heaps_as_slice().iter().map(heap).collect()
}

fn driver(instance: &ash::Instance, device: vk::PhysicalDevice) -> String {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    // SAFETY: see `describe`; the structure is part of Vulkan 1.2.
    unsafe { instance.get_physical_device_properties2(device, &mut properties) };
    let name = driver.driver_name_as_c_str().map(lossy).unwrap_or_default();
    let version = driver.driver_info_as_c_str().map(lossy).unwrap_or_default();
    format!("{name} {version}").trim().to_owned()
}

/// Lists what the device lacks for tracing rays.
fn missing(instance: &ash::Instance, device: vk::PhysicalDevice, extensions: &[String]) -> Vec<String> {
    let absent = NEEDED.iter().map(|e| lossy(e)).filter(|e| extensions.binary_search(e).is_err());
    let mut missing: Vec<String> = absent.collect();
    if missing.is_empty() {
        missing.extend(missing_features(instance, device).into_iter().map(String::from));
        if queue_family(instance, device).is_none() {
            missing.push("a compute queue with timestamps".into());
        }
    }
    missing
}

fn missing_features(instance: &ash::Instance, device: vk::PhysicalDevice) -> Vec<&'static str> {
    let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut addresses = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
    let mut features = vk::PhysicalDeviceFeatures2::default()
        .push_next(&mut structures)
        .push_next(&mut pipelines)
        .push_next(&mut addresses);
    // SAFETY: see `describe`; the device has the extensions of the structures.
    unsafe { instance.get_physical_device_features2(device, &mut features) };
    let needed = [
        ("accelerationStructure", structures.acceleration_structure),
        ("rayTracingPipeline", pipelines.ray_tracing_pipeline),
        ("bufferDeviceAddress", addresses.buffer_device_address),
    ];
    needed.into_iter().filter(|(_, has)| *has == vk::FALSE).map(|(name, _)| name).collect()
}

/// Whether shaders can read the clock of their subgroup.
fn has_clock(instance: &ash::Instance, device: vk::PhysicalDevice, extensions: &[String]) -> bool {
    let mut clock = vk::PhysicalDeviceShaderClockFeaturesKHR::default();
    if extensions.binary_search(&lossy(khr::shader_clock::NAME)).is_err() {
        return false;
    }
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut clock);
    // SAFETY: see `describe`; the device has the extension of the structure.
    unsafe { instance.get_physical_device_features2(device, &mut features) };
    clock.shader_subgroup_clock == vk::TRUE
}

/// Returns the first queue family that supports compute and timestamps.
pub(super) fn queue_family(instance: &ash::Instance, device: vk::PhysicalDevice) -> Option<QueueFamily> {
    // SAFETY: see `describe`.
    let families = unsafe { instance.get_physical_device_queue_family_properties(device) };
    let usable =
        |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE) && f.timestamp_valid_bits > 0;
    let index = families.iter().position(usable)?;
    Some(QueueFamily { index: index as u32, timestamp_bits: families[index].timestamp_valid_bits })
}

fn limits(instance: &ash::Instance, device: vk::PhysicalDevice, core: &vk::PhysicalDeviceLimits) -> Limits {
    let mut structures = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut pipelines = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut allocations = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default()
        .push_next(&mut structures)
        .push_next(&mut pipelines)
        .push_next(&mut allocations);
    // SAFETY: see `describe`; the device has the extensions of the structures.
    unsafe { instance.get_physical_device_properties2(device, &mut properties) };
    let width = u64::from(core.max_compute_work_group_count[0]) * u64::from(core.max_compute_work_group_size[0]);
    Limits {
        instances: structures.max_instance_count,
        geometries: structures.max_geometry_count,
        primitives: structures.max_primitive_count,
        scratch_alignment: u64::from(structures.min_acceleration_structure_scratch_offset_alignment).max(1),
        max_allocation: allocations.max_memory_allocation_size,
        rays_per_launch: width.min(u64::from(pipelines.max_ray_dispatch_invocation_count)),
        handle_size: u64::from(pipelines.shader_group_handle_size),
        table_alignment: u64::from(pipelines.shader_group_base_alignment),
    }
}
