//! How acceleration structures are built, and what came of it.

use serde::Serialize;

use super::Sides;
use crate::layout::BlasPer;

/// What to build, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// What the driver should favour.
    pub prefer: Prefer,
    /// Whether structures can be refitted later, which costs memory and speed.
    pub allow_update: bool,
    /// Whether BLASes are copied to where they take no more memory than they need.
    pub compact: bool,
    /// What goes into one BLAS.
    pub blas_per: BlasPer,
}

impl Default for BuildOptions {
    fn default() -> Self {
        BuildOptions { prefer: Prefer::FastTrace, allow_update: false, compact: true, blas_per: BlasPer::Mesh }
    }
}

/// What a driver favours when it builds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefer {
    /// Rays per second.
    #[default]
    FastTrace,
    /// Build time.
    FastBuild,
    /// Whatever the driver likes.
    None,
}

/// What was built of one file, and what its rays met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Built {
    /// BLASes.
    pub blases: u64,
    /// Instances in the TLAS.
    pub tlas_instances: u64,
    /// Bytes of all BLASes as built.
    pub blas_bytes: u64,
    /// The same after compaction; `None` without.
    pub blas_bytes_compacted: Option<u64>,
    /// Bytes of the TLAS.
    pub tlas_bytes: u64,
    /// Milliseconds the device took to build all BLASes, without compaction.
    pub blas_build_ms: f64,
    /// Milliseconds the device took to build the TLAS.
    pub tlas_build_ms: f64,
    /// How often the rays compared (not those timed) found triangles of alpha-tested and blended materials.
    pub any_hit_invocations: u64,
}

/// What was built of both files; as in [`Built`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Structures {
    /// BLASes.
    pub blases: Sides<u64>,
    /// Instances in the TLAS.
    pub tlas_instances: Sides<u64>,
    /// Bytes of all BLASes as built.
    pub blas_bytes: Sides<u64>,
    /// The same after compaction.
    pub blas_bytes_compacted: Option<Sides<u64>>,
    /// Bytes of the TLAS.
    pub tlas_bytes: Sides<u64>,
    /// Milliseconds to build all BLASes.
    pub blas_build_ms: Sides<f64>,
    /// Milliseconds to build the TLAS.
    pub tlas_build_ms: Sides<f64>,
    /// Triangles of alpha-tested and blended materials met.
    pub any_hit_invocations: Sides<u64>,
}

impl Structures {
    /// Of what was built of the input and of the output.
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
