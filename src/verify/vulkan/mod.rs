//! Builds and traces acceleration structures on a Vulkan device.
//!
//! [`Vulkan`] loads the system's Vulkan at run time and lists and opens devices; everything else borrows a [`Device`].
//! [`VulkanTracer`] builds the BLASes and the TLAS of a [`Scene`](crate::scene::Scene) and traces rays through them
//! with the pipelines of [`Pipelines`]; [`RayBuffer`] keeps rays on the device for several tracers.
//!
//! The only requirements are the extensions `VK_KHR_acceleration_structure` and `VK_KHR_ray_tracing_pipeline` and
//! buffer addresses. All unsafe code of the program is in this folder. Files, in order of dependency: `error`,
//! `instance`, `info`, `device`, `commands`, `memory`, `transfer`, `accel`, `interface`, `alpha`, `pipeline`, `trace`,
//! `tracer`, `frames`, `batch`.

#![allow(unsafe_code)]

mod accel;
mod alpha;
mod batch;
mod commands;
mod device;
mod error;
mod frames;
mod info;
mod instance;
mod interface;
mod memory;
mod pipeline;
mod trace;
mod tracer;
mod transfer;

#[cfg(test)]
mod tests;

pub use accel::{BlasPer, BuildOptions, BuildReport, Prefer};
pub use device::{Device, Wanted};
pub use error::Error;
pub(in crate::verify) use frames::VulkanFrames;
pub use info::{DeviceInfo, Heap, Limits};
pub use instance::{Options, Vulkan};
pub use trace::{Pipelines, RayBuffer, Traced, VulkanTracer};
