//! RK003: equal meshes should be one mesh, also if equal up to a rigid motion or mirrored (NVIDIA, "Best Practices for
//! Using NVIDIA RTX Ray Tracing", updated 2022; Arm's Lumen guide, chapter 5).

use std::collections::BTreeSet;

use super::{Subject, mesh_name};
use crate::copies::{self, CopiedMesh, LEAST_SAVED_BYTES, LEAST_SAVED_RATIO, Materials};
use crate::cost::bytes;
use crate::report::{Broken, Finding, Objects};
use crate::verify::VerifyOptions;

/// Finds meshes that repeat others, and meshes that would but for their materials.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let same = find(subject, Materials::Same);
    let any = find(subject, Materials::Any);
    let known: BTreeSet<_> = same.iter().map(|copy| copy.mesh).collect();
    let other: Vec<CopiedMesh> = any.into_iter().filter(|copy| !known.contains(&copy.mesh)).collect();
    [finding(subject, &same, false), finding(subject, &other, true)].into_iter().flatten().collect()
}

/// The copies, if sharing them saves a share of memory that matters.
fn find(subject: &Subject, materials: Materials) -> Vec<CopiedMesh> {
    let options = copies::Options {
        materials,
        likeness: copies::Likeness::Rigid,
        max_position_error_ratio: VerifyOptions::default().max_position_error_ratio,
        least_saved_bytes: (LEAST_SAVED_RATIO * subject.as_bytes as f64).ceil() as u64,
    };
    copies::find(subject.doc, subject.scene, &options).list
}

fn finding(subject: &Subject, copies: &[CopiedMesh], other_material: bool) -> Option<Finding> {
    let mesh = |copy: &CopiedMesh| &subject.scene.meshes[copy.mesh.0 as usize];
    let bytes = |copy: &CopiedMesh| bytes::blas(mesh(copy).triangle_count() as u64);
    let saved_bytes = copies.iter().map(bytes).fold(0, u64::saturating_add);
    let models: BTreeSet<_> = copies.iter().map(|copy| copy.model).collect();
    let objects: Objects = copies.iter().map(|copy| mesh_name(mesh(copy))).collect();
    let shared_by_bake = saved_bytes >= LEAST_SAVED_BYTES;
    let broken = Broken::Repeated { models: models.len(), saved_bytes, other_material, shared_by_bake };
    let matters = saved_bytes as f64 >= LEAST_SAVED_RATIO * subject.as_bytes as f64;
    (!objects.is_empty() && matters).then(|| Finding::new(objects, &broken))
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::document;
    use super::*;
    use crate::commands::measure::measure_as_is;
    use crate::cost::mesh_trees::MeshTrees;
    use crate::layout::test_scenes::row;
    use crate::report::Severity;
    use crate::scene::LoadOptions;
    use glam::Vec3;

    /// The findings about rows with the given materials and numbers of triangles, side by side.
    fn findings(rows: &[(u32, usize)]) -> Vec<Finding> {
        let placed =
            |(i, &(material, count)): (usize, &(u32, usize))| (material, row(Vec3::Y * 10.0 * i as f32, count));
        let doc = document(&rows.iter().enumerate().map(placed).collect::<Vec<_>>());
        let (scene, _) = crate::scene::load(&doc, &LoadOptions::default()).expect("a scene");
        let trees = MeshTrees::build(&scene);
        check(&Subject::new(&doc, &scene, &trees, measure_as_is(&scene).as_bytes()))
    }

    #[test]
    fn moved_copies_are_one_finding() {
        let found = findings(&[(0, 20), (0, 20), (0, 20), (0, 7)]);
        let [finding] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!((finding.rule.id(), finding.count), ("RK003", 2));
        assert_eq!(finding.cost.bytes, Some(2 * bytes::blas(20)));
        assert!(finding.by_bake.contains("--copies rigid"), "{}", finding.by_bake);
    }

    #[test]
    fn copies_with_other_materials_are_a_note() {
        let found = findings(&[(0, 20), (1, 20), (2, 20), (0, 7)]);
        let [finding] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!((finding.severity, finding.count), (Severity::Note, 2));
        assert!(finding.message.contains("with other materials"), "{}", finding.message);
    }

    #[test]
    fn different_meshes_are_left_alone() {
        assert_eq!(findings(&[(0, 20), (0, 21), (1, 7)]), []);
    }
}
