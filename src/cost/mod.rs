//! Trees over triangles and instances, and what they cost.

pub mod bytes;
pub mod overlap;
pub mod tree;

use crate::layout::Layout;
use crate::scene::Scene;

/// What a layout costs.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Metrics {
    /// Mesh groups (BLASes).
    pub mesh_groups: u64,
    /// Geometries in them.
    pub geometries: u64,
    /// Instances (TLAS entries).
    pub instances: u64,
    /// Triangles stored: each group counted once.
    pub triangles_stored: u64,
    /// Triangles placed: each instance counted.
    pub triangles_placed: u64,
    /// Overlap ratio.
    pub overlap_ratio: f64,
    /// SAH cost of the two-level tree taken as one tree.
    pub sah_cost: f64,
    /// Two-level cost.
    pub two_level_cost: f64,
    /// Instance boxes around a random surface point.
    pub boxes_per_point_mean: f64,
    /// 95th percentile.
    pub boxes_per_point_p95: f64,
    /// Maximum.
    pub boxes_per_point_max: f64,
    /// Predicted size of all BLASes in bytes, compacted.
    pub blas_bytes: u64,
    /// Predicted size of the TLAS in bytes.
    pub tlas_bytes: u64,
}

/// Measures a layout of a scene.
pub fn measure(_scene: &Scene, _layout: &Layout) -> Metrics {
    todo!()
}
