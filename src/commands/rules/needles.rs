//! RK006: no long thin triangles, above all no diagonal ones, whose boxes are almost empty (NVIDIA, "Best Practices for
//! Using NVIDIA RTX Ray Tracing", updated 2022; AMD's Radeon Raytracing Analyzer shows area over box area per triangle).

use super::shapes::Areas;
use super::{Subject, area_scale, mesh_name};
use crate::report::{Broken, Finding, Objects};
use crate::scene::MeshId;

/// Needles are reported if they cost this many triangle tests per ray through the core.
const LEAST_TESTS: f64 = 0.1;

/// A mesh is named if its needles cause this share of the cost.
const NAMED: f64 = 0.01;

/// Finds needles; the mesh whose needles cost most is named first. Boxes are those in mesh coordinates, as a BLAS has them.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let mut tests = vec![0.0; subject.scene.meshes.len()];
    for i in subject.still() {
        let instance = &subject.scene.instances[i.0 as usize];
        let mesh = instance.mesh.0 as usize;
        let empty = Areas::sum(subject.shapes.of_mesh(mesh)).empty;
        tests[mesh] += subject.share(empty * area_scale(&instance.transform.matrix3));
    }
    let per_ray: f64 = tests.iter().sum();
    if per_ray < LEAST_TESTS {
        return Vec::new();
    }
    let mut worst: Vec<u32> = (0..tests.len() as u32).filter(|&m| tests[m as usize] >= NAMED * per_ray).collect();
    worst.sort_by(|&a, &b| tests[b as usize].total_cmp(&tests[a as usize]).then(a.cmp(&b)));
    let areas = worst.iter().flat_map(|&m| subject.shapes.of_mesh(m as usize));
    let sum = areas.fold(Areas::sum(&[]), |sum, one| sum.and(one));
    let name = |mesh: MeshId| mesh_name(&subject.scene.meshes[mesh.0 as usize]);
    let objects: Objects = worst.into_iter().map(|mesh| name(MeshId(mesh))).collect();
    let mean = sum.covered / sum.needles.max(1) as f64;
    let broken = Broken::Needles { triangles: sum.needles, worst: sum.least_covered, mean, per_ray };
    vec![Finding::new(objects, &broken)]
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Scene;
    use glam::Vec3;

    /// A floor, and 30 long thin triangles above it in a direction.
    fn cables(along: Vec3) -> Scene {
        let mut builder = SceneBuilder::default();
        builder.object("floor", 0, vec![[Vec3::ZERO, Vec3::X * 100.0, Vec3::Y * 100.0]]);
        let cable = |i: i32| {
            let start = Vec3::new(0.0, i as f32, 1.0);
            [start, start + 60.0 * along, start + 60.0 * along + 0.05 * Vec3::Y]
        };
        builder.object("cables", 0, (0..30).map(cable).collect());
        builder.scene()
    }

    #[test]
    fn diagonal_needles_are_found_with_the_tests_they_cost() {
        let finding = found_in(&cables(Vec3::ONE.normalize()), check).expect("a finding");
        assert_eq!((finding.rule.id(), finding.objects.as_slice()), ("RK006", ["cables".to_owned()].as_slice()));
        assert!(
            finding.message.starts_with("30 triangles of 1 mesh are long, thin and diagonal"),
            "{}",
            finding.message
        );
        assert!(finding.cost.per_ray.is_some_and(|tests| tests > 1.0 && tests < 30.0), "{:?}", finding.cost);
    }

    #[test]
    fn needles_along_an_axis_fill_their_boxes() {
        assert_eq!(found_in(&cables(Vec3::X), check), None);
    }
}
