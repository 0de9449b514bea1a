//! Rays of pictures, which a device traces in batches.

use super::rays::Ray;
use super::{DeviceError, Hit};

/// Traces batches of rays through one scene on a device.
pub trait BatchTracer {
    /// Returns the name of the device.
    fn device(&self) -> &str;

    /// Whether the device can tell the time that each ray takes.
    fn has_clock(&self) -> bool;

    /// Returns the first hit of each ray. Alpha is not tested.
    ///
    /// # Errors
    /// Fails if memory runs out or the device fails, as do all methods below.
    fn closest(&self, rays: &[Ray]) -> Result<Vec<Option<Hit>>, DeviceError>;

    /// Returns all hits of each ray, nearest first.
    ///
    /// # Errors
    /// As above.
    fn all(&self, rays: &[Ray]) -> Result<Vec<Vec<Hit>>, DeviceError>;

    /// Returns the time that each ray takes to its first hit.
    ///
    /// # Errors
    /// As above.
    ///
    /// # Panics
    /// If the device has no clock.
    fn ticks(&self, rays: &[Ray]) -> Result<Vec<Ticks>, DeviceError>;
}

/// The time of a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ticks {
    /// Ticks of the device's clock while the ray was traced. What a tick is depends on the device; often it is a cycle of
    /// the processor that traced it.
    pub ticks: u32,
    /// Whether it hit anything.
    pub is_hit: bool,
}
