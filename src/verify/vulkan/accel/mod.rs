//! The acceleration structures of a scene: one BLAS a mesh group, shared by its instances, and a TLAS.

mod blas;
mod inputs;
mod plan;
mod scale;
mod structure;
mod tlas;

use ash::vk;

pub(super) use blas::Blases;
pub(super) use plan::Plan;
pub(super) use tlas::Tlas;

pub use crate::layout::BlasPer;
pub use crate::verify::build::{BuildOptions, Prefer};

/// What was built.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildReport {
    /// BLASes built.
    pub blases: u64,
    /// Instances in the TLAS.
    pub tlas_instances: u64,
    /// Instances of the scene left out as no ray can enter them: their transform has no inverse, or their mesh no
    /// triangle.
    pub skipped_instances: u64,
    /// Milliseconds the device took to build all BLASes, without compaction.
    pub blas_build_ms: f64,
    /// Milliseconds the device took to build the TLAS.
    pub tlas_build_ms: f64,
    /// Bytes of all BLASes as built.
    pub blas_bytes: u64,
    /// Bytes of all BLASes after compaction; `None` without.
    pub blas_bytes_compacted: Option<u64>,
    /// Bytes of the TLAS.
    pub tlas_bytes: u64,
}

impl BuildOptions {
    fn flags(&self) -> vk::BuildAccelerationStructureFlagsKHR {
        use vk::BuildAccelerationStructureFlagsKHR as Flags;
        let prefer = match self.prefer {
            Prefer::FastTrace => Flags::PREFER_FAST_TRACE,
            Prefer::FastBuild => Flags::PREFER_FAST_BUILD,
            Prefer::None => Flags::empty(),
        };
        prefer | if self.allow_update { Flags::ALLOW_UPDATE } else { Flags::empty() }
    }
}
