//! RK016: tiny meshes should be merged or dropped: largest extent below 1e-3 units (Omniverse asset validator).
//!
//! Departs from the source, which takes units for granted: the limit is relative to the scene's core. A scene 7 mm wide is
//! not tiny, and a pin in a hall of 100 units is as tiny as the source has it.

use super::Subject;
use crate::cost::bytes;
use crate::report::{Broken, Finding, Objects};

/// Largest extent over the diagonal of the core's box.
const SMALLEST_RATIO: f64 = 1e-5;

/// Finds tiny instances. Those without any extent are left to RK008.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let least = SMALLEST_RATIO * subject.scene.core().bounds().diagonal();
    let mut objects = Objects::default();
    let mut is_tiny = vec![false; subject.scene.meshes.len()];
    for i in subject.still() {
        let extent = subject.boxes[i.0 as usize].size().max_element();
        if extent > 0.0 && extent < least {
            objects.add(|| subject.name(i));
            is_tiny[subject.scene.instances[i.0 as usize].mesh.0 as usize] = true;
        }
    }
    if objects.is_empty() {
        return Vec::new();
    }
    let tiny = subject.scene.meshes.iter().zip(is_tiny).filter(|(_, tiny)| *tiny);
    let blas: u64 = tiny.map(|(mesh, _)| bytes::blas(mesh.triangle_count() as u64)).sum();
    let size = blas + objects.count() * bytes::TLAS_BYTES_PER_INSTANCE;
    vec![Finding::new(objects, &Broken::Tiny { ratio: SMALLEST_RATIO, bytes: size })]
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Scene;
    use glam::{DAffine3, DVec3, Vec3};

    /// A hall of 200 units and a pin of 0.5, at a scale, the pin at one of its own too.
    fn hall(scale: f64, of_pin: f64) -> Scene {
        let mut builder = SceneBuilder::default();
        for (name, count, scale) in [("hall", 200, scale), ("pin", 1, scale * of_pin)] {
            let mesh = builder.mesh(name, vec![(0, row(Vec3::ZERO, count))]);
            builder.place(mesh, name, DAffine3::from_scale(DVec3::splat(scale)));
        }
        builder.scene()
    }

    #[test]
    fn tiny_is_relative_to_the_scene() {
        for scale in [1e-6, 1.0, 1e6] {
            let finding = found_in(&hall(scale, 1e-3), check).expect("a finding");
            assert_eq!((finding.rule.id(), finding.objects.as_slice()), ("RK016", ["pin".to_owned()].as_slice()));
            assert_eq!(found_in(&hall(scale, 1.0), check), None);
        }
    }
}
