//! Predicted sizes of acceleration structures.

/// Predicted bytes of a compacted BLAS of so many triangles.
pub fn blas(_triangles: u64) -> u64 {
    todo!()
}

/// Predicted bytes of a TLAS of so many instances.
pub fn tlas(_instances: u64) -> u64 {
    todo!()
}
