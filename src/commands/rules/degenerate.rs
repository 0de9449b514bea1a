//! RK008: no degenerate triangles and no vertices that are not finite (NVIDIA, "Best Practices for Using NVIDIA RTX Ray
//! Tracing", updated 2022; DXR specification).

use super::shapes::Areas;
use super::{Subject, mesh_name};
use crate::report::{Broken, Finding, Objects};

/// Counts triangles without an area, and meshes of which the reader dropped triangles.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let (mut objects, mut triangles, mut not_finite) = (Objects::default(), 0, 0);
    for (mesh, areas) in subject.scene.meshes.iter().zip(subject.shapes.meshes()) {
        let flat = Areas::sum(areas).flat;
        triangles += flat;
        not_finite += usize::from(mesh.dropped);
        if flat > 0 || mesh.dropped {
            objects.add(|| mesh_name(mesh));
        }
    }
    let broken = Broken::Degenerate { triangles, not_finite };
    if objects.is_empty() { Vec::new() } else { vec![Finding::new(objects, &broken)] }
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::report::Severity;
    use glam::Vec3;

    #[test]
    fn triangles_without_an_area_are_counted_over_all_meshes() {
        let mut builder = SceneBuilder::default();
        let flat = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
        (0..3).for_each(|_| builder.object("Sphere", 0, [row(Vec3::ZERO, 2), vec![flat; 2]].concat()));
        let finding = found_in(&builder.scene(), check).expect("a finding");
        assert_eq!((finding.rule.id(), finding.severity, finding.count), ("RK008", Severity::Note, 3));
        assert!(finding.message.starts_with("6 triangles of 3 meshes have no area"), "{}", finding.message);
        assert_eq!(finding.cost.bytes, Some(6 * 79));
    }

    #[test]
    fn dropped_triangles_are_a_warning() {
        let mut builder = SceneBuilder::default();
        builder.object("broken", 0, row(Vec3::ZERO, 2));
        let mut scene = builder.scene();
        scene.meshes[0].dropped = true;
        let finding = found_in(&scene, check).expect("a finding");
        assert_eq!(
            (finding.severity, finding.message.as_str()),
            (Severity::Warning, "1 mesh had corners that are not finite")
        );
    }

    #[test]
    fn triangles_with_an_area_are_left_alone() {
        let mut builder = SceneBuilder::default();
        builder.object("row", 0, row(Vec3::ZERO, 20));
        assert_eq!(found_in(&builder.scene(), check), None);
    }
}
