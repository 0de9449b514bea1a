//! An opened device: selection, creation, and the one queue on which everything runs.

use std::sync::{Arc, Mutex};

use ash::{khr, vk};

use super::Error;
use super::commands::Queue;
use super::info::{DeviceInfo, NEEDED, QueueFamily, queue_family};
use super::instance::{Loaded, Vulkan};
use super::memory::Ledger;

/// The device to open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Wanted {
    /// The first device that can trace rays; a software driver only if there is no other.
    #[default]
    Auto,
    /// The device at this position in the list of devices.
    Index(usize),
    /// A device whose name contains this text, ignoring case.
    Name(String),
}

impl From<&str> for Wanted {
    fn from(word: &str) -> Wanted {
        match (word, word.parse()) {
            ("auto", _) => Wanted::Auto,
            (_, Ok(index)) => Wanted::Index(index),
            (name, Err(_)) => Wanted::Name(name.to_owned()),
        }
    }
}

impl std::fmt::Display for Wanted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Wanted::Auto => f.write_str("that can trace rays"),
            Wanted::Index(index) => write!(f, "{index}"),
            Wanted::Name(name) => write!(f, "with `{name}` in its name"),
        }
    }
}

/// A device that can trace rays. Buffers, structures and tracers borrow it and free themselves.
pub struct Device {
    info: DeviceInfo,
    pub(super) handle: ash::Device,
    pub(super) structures: khr::acceleration_structure::Device,
    pub(super) pipelines: khr::ray_tracing_pipeline::Device,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) ledger: Ledger,
    /// Nanoseconds per timestamp tick.
    pub(super) timestamp_period: f64,
    pub(super) family: QueueFamily,
    pub(super) queue: Mutex<Queue>,
    /// Declared last, because the instance must outlive the device.
    loaded: Arc<Loaded>,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device").field("info", &self.info).finish_non_exhaustive()
    }
}

impl Device {
    pub(super) fn open(vulkan: &Vulkan, wanted: &Wanted) -> Result<Device, Error> {
        let info = choose(vulkan.devices()?, wanted)?;
        let loaded = vulkan.loaded.clone();
        let physical = loaded.physical_devices()?[info.index];
        let lacks_queue = || Error::CannotTrace { device: info.name.clone(), missing: "a compute queue".into() };
        let family = queue_family(&loaded.instance, physical).ok_or_else(lacks_queue)?;
        let handle = create(&loaded.instance, physical, family, &info)?;
        // SAFETY: the physical device belongs to the instance.
        let core = unsafe { loaded.instance.get_physical_device_properties(physical) };
        // SAFETY: as above.
        let memory = unsafe { loaded.instance.get_physical_device_memory_properties(physical) };
        let queue = Queue::new(&handle, family.index).inspect_err(|_| {
            // SAFETY: nothing else was created from the device.
            unsafe { handle.destroy_device(None) }
        })?;
        Ok(Device {
            info,
            structures: khr::acceleration_structure::Device::new(&loaded.instance, &handle),
            pipelines: khr::ray_tracing_pipeline::Device::new(&loaded.instance, &handle),
            memory,
            ledger: Ledger::new(loaded.device_memory),
            timestamp_period: f64::from(core.limits.timestamp_period),
            family,
            queue: Mutex::new(queue),
            handle,
            loaded,
        })
    }

    /// Returns the description of the device.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Returns the peak use of device memory, in bytes.
    #[cfg(test)]
    pub(in crate::verify) fn peak_memory(&self) -> u64 {
        self.ledger.peak()
    }

    /// Returns the device memory in use, in bytes.
    pub(super) fn used_memory(&self) -> u64 {
        self.ledger.used()
    }

    /// Lets tests lower limits, to cause splits that would otherwise need gigabytes.
    #[cfg(test)]
    pub(super) fn limits_mut(&mut self) -> &mut super::info::Limits {
        &mut self.info.limits
    }

    /// See [`Vulkan::take_validation_messages`].
    pub fn take_validation_messages(&self) -> Vec<String> {
        Vulkan { loaded: self.loaded.clone() }.take_validation_messages()
    }
}

/// Selects the wanted device from the list.
fn choose(devices: Vec<DeviceInfo>, wanted: &Wanted) -> Result<DeviceInfo, Error> {
    let list = || devices.iter().map(|d| format!("{} ({})", d.index, d.name)).collect::<Vec<_>>().join(", ");
    let seen = if devices.is_empty() { "none".into() } else { list() };
    let chosen = match wanted {
        Wanted::Auto => devices.into_iter().filter(DeviceInfo::can_trace).min_by_key(|d| d.is_software),
        Wanted::Index(index) => devices.into_iter().nth(*index),
        Wanted::Name(part) => named(devices, &part.to_lowercase()),
    };
    match chosen {
        None => Err(Error::NoSuchDevice { wanted: wanted.to_string(), seen }),
        Some(d) if d.can_trace() => Ok(d),
        Some(d) => Err(Error::CannotTrace { device: d.name, missing: d.missing.join(", ") }),
    }
}

/// Returns the first device with `part` in its name, preferring devices that can trace rays.
fn named(devices: Vec<DeviceInfo>, part: &str) -> Option<DeviceInfo> {
    devices.into_iter().filter(|d| d.name.to_lowercase().contains(part)).min_by_key(|d| !d.can_trace())
}

fn create(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    family: QueueFamily,
    device: &DeviceInfo,
) -> Result<ash::Device, Error> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family.index).queue_priorities(&[1.0])];
    let clock_name = device.has_clock.then_some(khr::shader_clock::NAME);
    let extensions: Vec<_> = NEEDED.into_iter().chain(clock_name).map(|e| e.as_ptr()).collect();
    let mut clock = vk::PhysicalDeviceShaderClockFeaturesKHR::default().shader_subgroup_clock(true);
    let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut pipelines = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
    let mut addresses = vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true);
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut structures)
        .push_next(&mut pipelines)
        .push_next(&mut addresses);
    if device.has_clock {
        info = info.push_next(&mut clock);
    }
    // SAFETY: the device has these extensions, features and queues; all arguments outlive the call.
    unsafe { instance.create_device(physical, &info, None) }
        .map_err(|e| Error::call(&format!("opening the device `{}`", device.name), 0, e))
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: everything that borrows the device is gone, and every submission was waited for.
        unsafe {
            self.queue.get_mut().unwrap_or_else(|e| e.into_inner()).destroy(&self.handle);
            self.handle.destroy_device(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::info::Limits;
    use super::*;

    fn device(index: usize, name: &str, is_software: bool, missing: &[&str]) -> DeviceInfo {
        DeviceInfo {
            index,
            name: name.into(),
            driver: String::new(),
            vulkan_version: String::new(),
            is_software,
            extensions: Vec::new(),
            missing: missing.iter().map(|m| m.to_string()).collect(),
            has_clock: false,
            limits: Limits::default(),
            heaps: Vec::new(),
        }
    }

    fn devices() -> Vec<DeviceInfo> {
        vec![
            device(0, "llvmpipe", true, &[]),
            device(1, "Old Radeon", false, &["VK_KHR_acceleration_structure", "bufferDeviceAddress"]),
            device(2, "New Radeon", false, &[]),
        ]
    }

    fn chosen(word: &str) -> usize {
        choose(devices(), &word.into()).expect("there is one").index
    }

    #[test]
    fn auto_prefers_hardware_that_can_trace() {
        assert_eq!(chosen("auto"), 2);
    }

    #[test]
    fn devices_go_by_index_or_part_of_the_name() {
        assert_eq!(chosen("0"), 0);
        assert_eq!(chosen("LLVM"), 0);
        assert_eq!(chosen("radeon"), 2);
    }

    #[test]
    fn a_device_that_lacks_something_is_refused_with_the_reason() {
        let error = choose(devices(), &"1".into()).expect_err("it cannot trace").to_string();
        assert!(error.contains("Old Radeon") && error.contains("bufferDeviceAddress"), "{error}");
    }

    #[test]
    fn a_device_that_is_not_there_is_refused_with_the_list() {
        let error = choose(devices(), &"GeForce".into()).expect_err("there is none").to_string();
        assert!(error.contains("GeForce") && error.contains("2 (New Radeon)"), "{error}");
        let error = choose(Vec::new(), &Wanted::Auto).expect_err("there is none").to_string();
        assert!(error.ends_with("there is none"), "{error}");
    }
}
