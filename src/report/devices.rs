//! The devices of this machine.

use serde::Serialize;

/// The devices of this machine.
#[derive(Clone, Debug, Serialize)]
pub struct DevicesReport {
    /// [`DevicesReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// The devices in the order of the driver's list, which `--device` refers to.
    pub devices: Vec<Device>,
    /// Why there is no device, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// A Vulkan device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Device {
    /// Index for `--device`.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// The driver and its version.
    pub driver: String,
    /// Supported Vulkan version.
    pub vulkan_version: String,
    /// Whether the device is the CPU.
    pub is_software: bool,
    /// Whether it can trace rays.
    pub can_trace: bool,
    /// What it lacks for ray tracing.
    pub missing: Vec<String>,
    /// Supported extensions for ray tracing.
    pub extensions: Vec<String>,
    /// Whether shaders can read a clock: then `render --view heatmap` measures time.
    pub has_clock: bool,
    /// Its limits; `None` if it cannot trace rays.
    pub limits: Option<DeviceLimits>,
    /// Device memory.
    pub memory_bytes: u64,
}

/// Limits of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct DeviceLimits {
    /// Instances per TLAS.
    pub instances: u64,
    /// Geometries per BLAS.
    pub geometries: u64,
    /// Triangles per BLAS.
    pub primitives: u64,
    /// Alignment of scratch memory.
    pub scratch_alignment_bytes: u64,
    /// Largest allocation.
    pub max_allocation_bytes: u64,
    /// Rays per launch.
    pub rays_per_launch: u64,
}

impl DevicesReport {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.devices/1";

    /// Lists the devices of this machine.
    pub fn of_this_machine() -> DevicesReport {
        let (devices, note) = match Self::list() {
            Ok(devices) if devices.is_empty() => (devices, Some("there is no Vulkan device".into())),
            Ok(devices) => (devices, None),
            Err(why) => (Vec::new(), Some(why)),
        };
        DevicesReport { schema: Self::SCHEMA, raykiln_version: env!("CARGO_PKG_VERSION"), devices, note }
    }

    #[cfg(feature = "vulkan")]
    fn list() -> Result<Vec<Device>, String> {
        Ok(crate::verify::device::list()?.into_iter().map(Device::from).collect())
    }

    #[cfg(not(feature = "vulkan"))]
    fn list() -> Result<Vec<Device>, String> {
        Err("this program was built without Vulkan".into())
    }
}

#[cfg(feature = "vulkan")]
impl From<crate::verify::vulkan::DeviceInfo> for Device {
    fn from(info: crate::verify::vulkan::DeviceInfo) -> Device {
        let limits = info.can_trace().then_some(DeviceLimits {
            instances: info.limits.instances,
            geometries: info.limits.geometries,
            primitives: info.limits.primitives,
            scratch_alignment_bytes: info.limits.scratch_alignment,
            max_allocation_bytes: info.limits.max_allocation,
            rays_per_launch: info.limits.rays_per_launch,
        });
        Device {
            can_trace: info.can_trace(),
            memory_bytes: info.memory(),
            limits,
            index: info.index,
            name: info.name,
            driver: info.driver,
            vulkan_version: info.vulkan_version,
            is_software: info.is_software,
            missing: info.missing,
            extensions: info.extensions,
            has_clock: info.has_clock,
        }
    }
}
