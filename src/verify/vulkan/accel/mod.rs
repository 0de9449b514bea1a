//! The acceleration structures of a scene: one BLAS per mesh group, shared by its instances, and a TLAS.

mod blas;
mod deforming;
mod inputs;
mod moving;
mod plan;
mod scale;
mod structure;
mod tlas;

use ash::vk;

pub(super) use blas::Blases;
pub(super) use deforming::Deforming;
pub(super) use moving::{Matrices, MovingTlas};
pub(super) use plan::Plan;
pub(super) use tlas::Tlas;

pub use crate::layout::BlasPer;
pub use crate::verify::build::{BuildOptions, Prefer};

/// Sizes and build times of a scene's acceleration structures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildReport {
    /// Number of BLASes.
    pub blases: u64,
    /// Number of instances in the TLAS.
    pub tlas_instances: u64,
    /// Number of instances left out because no ray can enter them: their transform has no inverse, or their mesh has no
    /// triangles.
    pub skipped_instances: u64,
    /// Time the device took to build all BLASes, without compaction, in milliseconds.
    pub blas_build_ms: f64,
    /// Time the device took to build the TLAS, in milliseconds.
    pub tlas_build_ms: f64,
    /// Total size of the BLASes as built, in bytes.
    pub blas_bytes: u64,
    /// Total size of the BLASes after compaction, in bytes; `None` without compaction.
    pub blas_bytes_compacted: Option<u64>,
    /// Size of the TLAS, in bytes.
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
