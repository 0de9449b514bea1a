//! Predicted sizes of acceleration structures.
//!
//! Measured on an NVIDIA H200 (driver 580.159, `PREFER_FAST_TRACE`): a BLAS takes about 92 bytes per triangle, 77 to 80
//! after compaction, a TLAS 161 bytes per instance. Other devices differ; ratios between two layouts differ less. The
//! number of geometries makes no difference. The fixed size of each structure beyond its alignment is not modelled.

use crate::layout::Layout;
use crate::scene::Scene;

/// Bytes of a compacted BLAS per triangle.
pub const COMPACTED_BLAS_BYTES_PER_TRIANGLE: u64 = 79;

/// Bytes of a TLAS per instance.
pub const TLAS_BYTES_PER_INSTANCE: u64 = 161;

/// Alignment of the address of an acceleration structure (Vulkan specification,
/// `VkAccelerationStructureCreateInfoKHR::offset`); the bytes up to the next multiple are lost.
pub const ALIGNMENT: u64 = 256;

/// Predicts the bytes of a compacted BLAS with this many triangles, including alignment; 0 for none. Saturates at the
/// largest 64-bit value.
pub fn blas(triangles: u64) -> u64 {
    aligned(triangles.saturating_mul(COMPACTED_BLAS_BYTES_PER_TRIANGLE))
}

/// Predicts the bytes of a TLAS with this many instances; 0 for none. Saturates at the largest 64-bit value.
pub fn tlas(instances: u64) -> u64 {
    aligned(instances.saturating_mul(TLAS_BYTES_PER_INSTANCE))
}

fn aligned(bytes: u64) -> u64 {
    bytes.checked_next_multiple_of(ALIGNMENT).unwrap_or(u64::MAX)
}

impl Layout {
    /// Predicts the bytes of all BLASes and the TLAS.
    pub fn as_bytes(&self, scene: &Scene) -> u64 {
        let blas = self.groups.iter().map(|g| blas(g.content.triangle_count(scene) as u64));
        blas.fold(tlas(self.placements.len() as u64), u64::saturating_add)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_takes_no_bytes() {
        assert_eq!(blas(0), 0);
        assert_eq!(tlas(0), 0);
    }

    #[test]
    fn small_structures_fill_their_alignment() {
        assert_eq!(blas(1), 256);
        assert_eq!(blas(3), 256);
        assert_eq!(blas(4), 512);
        assert_eq!(tlas(1), 256);
    }

    #[test]
    fn a_thousand_opened_instances_take_what_was_measured() {
        let measured = 2.5 * 1024.0 * 1024.0;
        assert!((tlas(16_000) as f64 / measured - 1.0).abs() < 0.05);
    }

    #[test]
    fn huge_counts_saturate() {
        assert_eq!(blas(u64::MAX), u64::MAX);
        assert_eq!(tlas(u64::MAX / 161), u64::MAX);
    }
}
