//! The table of flags.

use serde::Serialize;

use crate::verify::build::Prefer;
use crate::verify::{MachineKind, PerKind};

/// The names of the tables.
pub(in crate::lab) const NAMES: [&str; 2] = ["flags.csv", "flags.jsonl"];

/// A layout of a scene built with a set of flags. `docs/lab.md` describes the columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FlagsRow {
    /// The scene's path as the configuration has it.
    pub scene: String,
    /// The layout.
    pub layout: String,
    /// What built and traced.
    pub device: String,
    /// `gpu` or `software driver`.
    pub device_kind: MachineKind,
    /// `none`, `fast-trace` or `fast-build`.
    pub prefer: &'static str,
    /// Whether structures can be updated.
    pub allow_update: bool,
    /// Whether BLASes are compacted.
    pub compact: bool,
    /// BLASes.
    pub blases: u64,
    /// Instances in the TLAS.
    pub tlas_instances: u64,
    /// To build all BLASes.
    pub blas_build_ms: f64,
    /// To build the TLAS.
    pub tlas_build_ms: f64,
    /// Of the BLASes as built.
    pub blas_bytes: u64,
    /// Of the BLASes after compaction.
    pub blas_bytes_compacted: Option<u64>,
    /// Of the TLAS.
    pub tlas_bytes: u64,
    /// By kind of rays.
    pub kinds: PerKind<FlagsKind>,
}

/// Rays of a kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FlagsKind {
    /// Rays per second.
    pub mrays_per_s: f64,
}

impl FlagsKind {
    /// Of the nanoseconds per ray.
    pub(super) fn of(nanoseconds: f64) -> FlagsKind {
        FlagsKind { mrays_per_s: if nanoseconds > 0.0 { 1e3 / nanoseconds } else { 0.0 } }
    }
}

impl FlagsRow {
    /// Its fields as columns: names and values.
    pub(super) fn columns(&self) -> Vec<(String, String)> {
        let columns = [
            ("scene", self.scene.clone()),
            ("layout", self.layout.clone()),
            ("device", self.device.clone()),
            ("device_kind", self.device_kind.name().to_owned()),
            ("prefer", self.prefer.to_owned()),
            ("allow_update", self.allow_update.to_string()),
            ("compact", self.compact.to_string()),
            ("blases", self.blases.to_string()),
            ("tlas_instances", self.tlas_instances.to_string()),
            ("blas_build_ms", self.blas_build_ms.to_string()),
            ("tlas_build_ms", self.tlas_build_ms.to_string()),
            ("blas_bytes", self.blas_bytes.to_string()),
            ("blas_bytes_compacted", self.blas_bytes_compacted.map_or(String::new(), |bytes| bytes.to_string())),
            ("tlas_bytes", self.tlas_bytes.to_string()),
        ];
        let kinds =
            self.kinds.iter().map(|(kind, of)| (format!("{}_mrays_per_s", kind.name()), of.mrays_per_s.to_string()));
        columns.map(|(name, value)| (name.to_owned(), value)).into_iter().chain(kinds).collect()
    }
}

/// Returns the name of a preference, as `--build-flags` has it.
pub(super) fn prefer_name(prefer: Prefer) -> &'static str {
    match prefer {
        Prefer::FastTrace => "fast-trace",
        Prefer::FastBuild => "fast-build",
        Prefer::None => "none",
    }
}
