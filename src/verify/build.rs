//! Options and results of building acceleration structures.

use serde::Serialize;

use super::Sides;
use crate::layout::BlasPer;

/// Options for building acceleration structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// What the driver should optimise for.
    pub prefer: Prefer,
    /// Whether structures can be refitted later, which costs memory and tracing speed.
    pub allow_update: bool,
    /// Whether BLASes are compacted.
    pub compact: bool,
    /// The contents of one BLAS.
    pub blas_per: BlasPer,
}

impl Default for BuildOptions {
    fn default() -> Self {
        BuildOptions { prefer: Prefer::FastTrace, allow_update: false, compact: true, blas_per: BlasPer::Mesh }
    }
}

/// The optimisation goal of a driver's build.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefer {
    /// Tracing speed.
    #[default]
    FastTrace,
    /// Build time.
    FastBuild,
    /// The default of the driver.
    None,
}

/// Structures built for one file, and the alpha-tested triangles that its rays found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Built {
    /// Number of BLASes.
    pub blases: u64,
    /// Number of instances in the TLAS.
    pub tlas_instances: u64,
    /// Total size of the BLASes as built, in bytes.
    pub blas_bytes: u64,
    /// Total size of the BLASes after compaction, in bytes; `None` without compaction.
    pub blas_bytes_compacted: Option<u64>,
    /// Size of the TLAS, in bytes.
    pub tlas_bytes: u64,
    /// Time the device took to build all BLASes, without compaction, in milliseconds.
    pub blas_build_ms: f64,
    /// Time the device took to build the TLAS, in milliseconds.
    pub tlas_build_ms: f64,
    /// How often the compared (not the timed) rays found triangles of alpha-tested and blended materials.
    pub any_hit_invocations: u64,
}

/// Structures built for both files; see [`Built`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Structures {
    /// Number of BLASes.
    pub blases: Sides<u64>,
    /// Number of instances in the TLAS.
    pub tlas_instances: Sides<u64>,
    /// Total size of the BLASes as built, in bytes.
    pub blas_bytes: Sides<u64>,
    /// Total size of the BLASes after compaction, in bytes.
    pub blas_bytes_compacted: Option<Sides<u64>>,
    /// Size of the TLAS, in bytes.
    pub tlas_bytes: Sides<u64>,
    /// Time to build all BLASes, in milliseconds.
    pub blas_build_ms: Sides<f64>,
    /// Time to build the TLAS, in milliseconds.
    pub tlas_build_ms: Sides<f64>,
    /// How often rays found triangles of alpha-tested and blended materials.
    pub any_hit_invocations: Sides<u64>,
}

impl Structures {
    /// Combines the structures of the input and of the output.
    pub fn of(built: &Sides<Built>) -> Structures {
        fn of<T>(built: &Sides<Built>, of: impl Fn(&Built) -> T) -> Sides<T> {
            built.as_ref().map(of)
        }
        let compacted = built.before.blas_bytes_compacted.zip(built.after.blas_bytes_compacted);
        Structures {
            blases: of(built, |b| b.blases),
            tlas_instances: of(built, |b| b.tlas_instances),
            blas_bytes: of(built, |b| b.blas_bytes),
            blas_bytes_compacted: compacted.map(|(before, after)| Sides { before, after }),
            tlas_bytes: of(built, |b| b.tlas_bytes),
            blas_build_ms: of(built, |b| b.blas_build_ms),
            tlas_build_ms: of(built, |b| b.tlas_build_ms),
            any_hit_invocations: of(built, |b| b.any_hit_invocations),
        }
    }
}
