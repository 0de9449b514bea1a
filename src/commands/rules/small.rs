//! RK009: static BLASes should be compacted, and tiny ones waste memory: each takes a multiple of 256 bytes, and separate
//! allocations below 64 KiB waste the rest (NVIDIA, "Best Practices for Using NVIDIA RTX Ray Tracing", updated 2022; DXR
//! specification; NVIDIA, RTXMU).

use super::{Subject, mesh_name};
use crate::cost::bytes::{self, COMPACTED_BLAS_BYTES_PER_TRIANGLE};
use crate::report::{Broken, Finding, Objects};
use crate::scene::Mesh;

/// Bytes that an allocation of its own takes at least.
const ALLOCATION: u64 = 64 << 10;

/// What fewer BLASes than this can lose is not worth a word.
const FEWEST: u64 = 64;

/// Finds tiny BLASes that waste more than all structures take, if each is allocated alone.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let (mut objects, mut lost, mut aligned) = (Objects::default(), 0, 0);
    let size = |mesh: &Mesh| bytes::blas(mesh.triangle_count() as u64);
    for mesh in subject.scene.meshes.iter().filter(|mesh| size(mesh) < ALLOCATION) {
        objects.add(|| mesh_name(mesh));
        lost += ALLOCATION - size(mesh);
        aligned += size(mesh) - COMPACTED_BLAS_BYTES_PER_TRIANGLE * mesh.triangle_count() as u64;
    }
    let matters = lost > subject.as_bytes && lost >= FEWEST * ALLOCATION;
    if matters { vec![Finding::new(objects, &Broken::Small { lost, aligned })] } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::*;
    use glam::Vec3;

    fn rows(count: usize) -> SceneBuilder {
        let mut builder = SceneBuilder::default();
        (0..count).for_each(|i| builder.object("row", 0, row(Vec3::Y * i as f32, 3)));
        builder
    }

    #[test]
    fn many_tiny_structures_waste_memory() {
        let finding = found_in(&rows(100).scene(), check).expect("a finding");
        assert_eq!((finding.rule.id(), finding.count), ("RK009", 100));
        assert_eq!(finding.cost.bytes, Some(100 * (ALLOCATION - 256)));
        assert!(finding.cost.text.contains("1.9 KiB by alignment alone"), "{}", finding.cost.text);
    }

    #[test]
    fn a_few_do_not() {
        assert_eq!(found_in(&rows(20).scene(), check), None);
    }

    #[test]
    fn large_structures_beside_them_make_the_waste_small() {
        let mut builder = rows(40);
        builder.object("statue", 0, row(Vec3::ZERO, 100_000));
        assert_eq!(found_in(&builder.scene(), check), None);
    }
}
