//! Errors of the Vulkan code.

use ash::vk;

/// The reason why something failed on a Vulkan device.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Error {
    /// This machine has no Vulkan loader, driver or device; holds a description.
    #[error("Vulkan is not available: {0}")]
    Unavailable(String),
    /// No device has this name or index.
    #[error("there is no Vulkan device {wanted}; there is {seen}")]
    NoSuchDevice {
        /// The requested name or index.
        wanted: String,
        /// The available devices.
        seen: String,
    },
    /// The device lacks required extensions or features.
    #[error("Vulkan device `{device}` cannot trace rays: it lacks {missing}")]
    CannotTrace {
        /// Name of the device.
        device: String,
        /// The missing extensions or features.
        missing: String,
    },
    /// Memory ran out, which is normal with large scenes.
    #[error("out of {} memory for {what} ({})", if *.on_device { "device" } else { "host" }, Bytes(*.bytes))]
    OutOfMemory {
        /// The object that needed the memory.
        what: String,
        /// Its size, in bytes.
        bytes: u64,
        /// Whether device memory ran out, rather than host memory.
        on_device: bool,
    },
    /// The scene exceeds a limit of the device.
    #[error("{what}: {count}, and the device takes at most {limit}")]
    Limit {
        /// The limited objects.
        what: String,
        /// Their number in the scene.
        count: u64,
        /// The largest allowed number.
        limit: u64,
    },
    /// Any other failed call.
    #[error("{what}: {result}")]
    Call {
        /// The attempted operation.
        what: String,
        /// The result code of the driver.
        result: vk::Result,
    },
}

impl Error {
    /// Returns the error of a failed call; `bytes` is the size of the object to be created, if it has one.
    pub(super) fn call(what: &str, bytes: u64, result: vk::Result) -> Error {
        let what = what.to_owned();
        match result {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Error::OutOfMemory { what, bytes, on_device: true },
            vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::OutOfMemory { what, bytes, on_device: false },
            result => Error::Call { what, result },
        }
    }

    /// Fails if `count` exceeds `limit`.
    pub(super) fn check_limit(what: impl FnOnce() -> String, count: u64, limit: u64) -> Result<(), Error> {
        if count <= limit { Ok(()) } else { Err(Error::Limit { what: what(), count, limit }) }
    }
}

/// A number of bytes, displayed in readable units.
struct Bytes(u64);

impl std::fmt::Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            0 => write!(f, "of unknown size"),
            b if b < 1 << 20 => write!(f, "{b} bytes"),
            b if b < 1 << 30 => write!(f, "{:.1} MiB", b as f64 / f64::from(1 << 20)),
            b => write!(f, "{:.2} GiB", b as f64 / f64::from(1 << 30)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_memory_names_the_object_and_its_size() {
        let error = Error::call("storage of 3 BLASes", 3 << 29, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
        assert_eq!(error.to_string(), "out of device memory for storage of 3 BLASes (1.50 GiB)");
        let error = Error::call("instances", 640, vk::Result::ERROR_OUT_OF_HOST_MEMORY);
        assert_eq!(error.to_string(), "out of host memory for instances (640 bytes)");
    }

    #[test]
    fn limits_include_their_end() {
        assert!(Error::check_limit(|| "triangles".into(), 8, 8).is_ok());
        let error = Error::check_limit(|| "triangles".into(), 9, 8).expect_err("9 are too many");
        assert_eq!(error.to_string(), "triangles: 9, and the device takes at most 8");
    }
}
