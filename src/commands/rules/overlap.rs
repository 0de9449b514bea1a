//! RK001: BLASes whose boxes overlap heavily should be one BLAS (NVIDIA, "Best Practices for Using NVIDIA RTX Ray
//! Tracing", updated 2022).

use super::Subject;
use crate::cost::overlap::{self, Pair};
use crate::report::{Broken, Finding, Objects};
use crate::scene::InstanceId;

/// A pair overlaps heavily if the surface area of the intersection over that of the scene's core exceeds this (the skip
/// threshold of T. Bilák, "Scene optimization for RTX", 2024).
const OVERLAP_RATIO: f64 = 0.005;

/// Finds all objects that overlap another heavily; the worst pairs are named first.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let least = OVERLAP_RATIO * subject.core_area;
    let pairs = overlap::worst_pairs(&subject.boxes, Finding::MOST_NAMES);
    let Some(&worst) = pairs.first().filter(|worst| worst.area > least) else { return Vec::new() };
    let mut objects = Objects::default();
    for Pair { a, b, .. } in pairs.into_iter().filter(|pair| pair.area > least) {
        [a, b].into_iter().for_each(|i| objects.mention(|| subject.name(InstanceId(i))));
    }
    let count = overlap::overlapping(&subject.boxes, least).into_iter().filter(|&overlaps| overlaps).count();
    let broken = Broken::Overlap {
        worst: [worst.a, worst.b].map(|i| subject.name(InstanceId(i))),
        ratio: subject.share(worst.area),
        of_core: !subject.scene.core().is_whole(),
        per_ray: subject.share(overlap::shared_area(&subject.boxes)),
    };
    vec![Finding::new(objects.counted(count as u64), &broken)]
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::{found, found_in};
    use crate::layout::test_scenes::*;
    use crate::scene::Pinned;
    use glam::Vec3;

    /// Two rows of triangles in one place, `moving` or not, beside one apart.
    fn rows(moving: bool) -> SceneBuilder {
        let mut builder = SceneBuilder::default();
        for (name, start) in [("a", 0.0), ("b", 0.2), ("apart", 40.0)] {
            let mesh = builder.mesh(name, vec![(0, row(Vec3::new(0.0, start, 0.0), 20))]);
            builder.place(mesh, name, at(0.0, 0.0, 0.0)).pinned = moving.then_some(Pinned::Animated);
        }
        builder
    }

    #[test]
    fn objects_in_one_place_are_one_finding() {
        let finding = found_in(&rows(false).scene(), super::check).expect("a finding");
        assert_eq!((finding.rule.id(), finding.count), ("RK001", 2));
        assert_eq!(finding.objects, ["a", "b"]);
        assert!(finding.cost.per_ray.is_some_and(|per_ray| per_ray > 0.005 && per_ray < 1.0), "{:?}", finding.cost);
    }

    #[test]
    fn what_moves_by_design_may_overlap() {
        assert_eq!(found_in(&rows(true).scene(), super::check), None);
    }

    #[test]
    fn objects_apart_overlap_nothing() {
        let mut builder = SceneBuilder::default();
        (0..3).for_each(|i| builder.object("row", 0, row(Vec3::Y * (i * i) as f32 * 9.0, 20)));
        assert_eq!(found_in(&builder.scene(), super::check), None);
    }

    #[test]
    fn a_dome_and_a_far_object_hide_no_overlap() {
        let [plain, exceptional] = [heaps(0), heaps(2)].map(|scene| found_in(&scene, super::check).expect("a finding"));
        assert_eq!((plain.count, &plain.objects), (exceptional.count, &exceptional.objects));
        assert_eq!(plain.cost, exceptional.cost);
        assert_eq!(found(&heaps(0)), ["RK001"]);
        assert_eq!(found(&heaps(2)), ["RK001", "RK005", "RK014", "RK015"]);
    }
}
