//! The Vulkan loader and, if requested, the validation layer.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

use ash::{ext, vk};

use super::Error;
use super::device::{Device, Wanted};
use super::info::{DeviceInfo, describe};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Options for loading Vulkan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Whether the validation layer, which must be installed, checks every call.
    pub validation: bool,
    /// Limit on the device memory in use at a time, in bytes; `None` for no limit.
    pub device_memory: Option<u64>,
}

impl Options {
    /// Enables validation if `RAYKILN_VULKAN_VALIDATION=1` is set, and limits device memory to
    /// `RAYKILN_DEVICE_MEMORY_BYTES` if that is an integer.
    pub fn from_env() -> Options {
        let memory = std::env::var("RAYKILN_DEVICE_MEMORY_BYTES").ok();
        Options {
            validation: std::env::var_os("RAYKILN_VULKAN_VALIDATION").is_some_and(|v| v == "1"),
            device_memory: memory.and_then(|bytes| bytes.parse().ok()),
        }
    }
}

/// A loaded Vulkan library and its instance.
#[derive(Clone)]
pub struct Vulkan {
    pub(super) loaded: Arc<Loaded>,
}

impl std::fmt::Debug for Vulkan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Vulkan").field("validation", &self.loaded.validation.is_some()).finish_non_exhaustive()
    }
}

/// The instance, and the loader library it depends on.
pub(super) struct Loaded {
    pub(super) instance: ash::Instance,
    /// See [`Options::device_memory`].
    pub(super) device_memory: Option<u64>,
    validation: Option<Validation>,
    _entry: ash::Entry,
}

/// The validation layer's messages.
struct Validation {
    debug_utils: ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    /// Shared with [`collect`], which gets a pointer to the mutex.
    messages: Arc<Mutex<Vec<String>>>,
}

impl Vulkan {
    /// Loads Vulkan.
    ///
    /// # Errors
    /// [`Error::Unavailable`] without a loader or a driver, or if validation is requested and the layer is missing.
    pub fn load(options: Options) -> Result<Vulkan, Error> {
        // SAFETY: the loaded library is the system's Vulkan loader, whose initialization has no preconditions.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::Unavailable(format!("no loader ({e})")))?;
        if options.validation {
            require_layer(&entry)?;
        }
        let instance = create(&entry, options)?;
        let device_memory = options.device_memory;
        let mut loaded = Loaded { instance, device_memory, validation: None, _entry: entry };
        if options.validation {
            loaded.validation = Some(Validation::new(&loaded)?);
        }
        Ok(Vulkan { loaded: Arc::new(loaded) })
    }

    /// Lists all devices, whether or not they can trace rays.
    ///
    /// # Errors
    /// Fails if the driver does.
    pub fn devices(&self) -> Result<Vec<DeviceInfo>, Error> {
        let instance = &self.loaded.instance;
        let devices = self.loaded.physical_devices()?;
        devices.into_iter().enumerate().map(|(index, device)| describe(instance, device, index)).collect()
    }

    /// Opens a device that can trace rays.
    ///
    /// # Errors
    /// Returns [`Error::NoSuchDevice`], [`Error::CannotTrace`], or the error of a failed driver call.
    pub fn open(&self, wanted: &Wanted) -> Result<Device, Error> {
        Device::open(self, wanted)
    }

    /// Takes the messages of the validation layer so far; always empty without validation.
    pub fn take_validation_messages(&self) -> Vec<String> {
        let Some(validation) = &self.loaded.validation else { return Vec::new() };
        std::mem::take(&mut validation.messages.lock().unwrap_or_else(|e| e.into_inner()))
    }
}

impl Loaded {
    pub(super) fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>, Error> {
        // SAFETY: the instance is alive.
        unsafe { self.instance.enumerate_physical_devices() }
            .map_err(|e| Error::call("listing the Vulkan devices", 0, e))
    }
}

fn require_layer(entry: &ash::Entry) -> Result<(), Error> {
    // SAFETY: the entry points are loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(|e| Error::call("listing the Vulkan layers", 0, e))?;
    if layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
        Ok(())
    } else {
        Err(Error::Unavailable("the validation layer is not installed".into()))
    }
}

fn create(entry: &ash::Entry, options: Options) -> Result<ash::Instance, Error> {
    let application = vk::ApplicationInfo::default().application_name(c"raykiln").api_version(vk::API_VERSION_1_2);
    let layers = if options.validation { vec![VALIDATION_LAYER.as_ptr()] } else { Vec::new() };
    let extensions = if options.validation { vec![ext::debug_utils::NAME.as_ptr()] } else { Vec::new() };
    let info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_layer_names(&layers)
        .enabled_extension_names(&extensions);
    // SAFETY: names and structures outlive the call; the layer was found, and it provides the extension.
    unsafe { entry.create_instance(&info, None) }.map_err(|e| match e {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::Unavailable("no driver".into()),
        e => Error::call("opening Vulkan", 0, e),
    })
}

impl Validation {
    fn new(loaded: &Loaded) -> Result<Validation, Error> {
        let debug_utils = ext::debug_utils::Instance::new(&loaded._entry, &loaded.instance);
        let messages = Arc::new(Mutex::new(Vec::new()));
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(
                vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
            )
            .pfn_user_callback(Some(collect))
            .user_data(Arc::as_ptr(&messages).cast_mut().cast());
        // SAFETY: the extension is enabled; the mutex outlives the messenger, see `Drop` of `Loaded`.
        let messenger = unsafe { debug_utils.create_debug_utils_messenger(&info, None) }
            .map_err(|e| Error::call("listening to the validation layer", 0, e))?;
        Ok(Validation { debug_utils, messenger, messages })
    }
}

/// Called by the validation layer, on any thread.
unsafe extern "system" fn collect(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data, and the user data is the mutex given at creation, which is only used by
    // shared reference.
    let (data, messages) = unsafe { (&*data, &*user_data.cast::<Mutex<Vec<String>>>().cast_const()) };
    // SAFETY: the message is a string that lives as long as the data.
    let message = unsafe { data.message_as_c_str() }.map(CStr::to_string_lossy).unwrap_or_default();
    messages.lock().unwrap_or_else(|e| e.into_inner()).push(message.into_owned());
    vk::FALSE
}

impl Drop for Loaded {
    fn drop(&mut self) {
        // SAFETY: devices hold an `Arc` of this, so none is left; the messenger is destroyed before its instance.
        unsafe {
            if let Some(v) = &self.validation {
                v.debug_utils.destroy_debug_utils_messenger(v.messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}
