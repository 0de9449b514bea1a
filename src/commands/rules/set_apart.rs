//! RK005: no sky dome or other enclosing shell in the TLAS with the scene (NVIDIA, "Best Practices for Using NVIDIA RTX Ray
//! Tracing", updated 2022; Epic's hardware ray tracing guide), and RK014: no object far outside the rest, which slows every
//! ray 3 to 5 times (OptiX developer forum, thread 285771).
//!
//! Both are the objects outside the core of the scene ([`crate::scene::Core`]).

use super::Subject;
use crate::report::{Broken, Finding, Objects};
use crate::scene::{Bounds, InstanceId, Object};

/// Finds shells around the scene.
pub(super) fn shells(subject: &Subject) -> Vec<Finding> {
    let shells = subject.scene.core().domes();
    let largest = shells.iter().map(|&shell| box_of(subject, shell).area()).fold(0.0, f64::max);
    // Each ray in the scene is inside of each shell.
    let broken = Broken::Shell { area_ratio: subject.share(largest), per_ray: shells.len() as f64 };
    finding(subject, shells, &broken)
}

/// Finds objects far outside the rest.
pub(super) fn outliers(subject: &Subject) -> Vec<Finding> {
    let outliers = subject.scene.core().outliers();
    let core = subject.scene.core().bounds();
    let with_outliers = outliers.iter().fold(core, |all, &outlier| all.union(&box_of(subject, outlier)));
    finding(subject, outliers, &Broken::Outlier { area_ratio: subject.share(with_outliers.area()) })
}

fn box_of(subject: &Subject, object: Object) -> Bounds {
    let instance = &subject.scene.instances[object.instance as usize];
    object.geometry(subject.scene).bounds().transformed(&instance.transform)
}

fn finding(subject: &Subject, objects: &[Object], broken: &Broken) -> Vec<Finding> {
    let objects: Objects = objects.iter().map(|object| subject.name(InstanceId(object.instance))).collect();
    if objects.is_empty() { Vec::new() } else { vec![Finding::new(objects, broken)] }
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::heaps;

    #[test]
    fn a_dome_is_a_shell_and_no_outlier() {
        let finding = found_in(&heaps(1), shells).expect("a finding");
        assert_eq!((finding.rule.id(), finding.objects.as_slice()), ("RK005", ["sky".to_owned()].as_slice()));
        assert_eq!(finding.cost.per_ray, Some(1.0));
        assert_eq!(found_in(&heaps(1), outliers), None);
    }

    #[test]
    fn a_far_object_is_an_outlier() {
        let finding = found_in(&heaps(2), outliers).expect("a finding");
        assert_eq!((finding.rule.id(), finding.objects.as_slice()), ("RK014", ["moon".to_owned()].as_slice()));
        assert!(finding.message.contains("far outside the rest"), "{}", finding.message);
    }

    #[test]
    fn a_scene_without_exceptions_has_neither() {
        assert_eq!(found_in(&heaps(0), shells), None);
        assert_eq!(found_in(&heaps(0), outliers), None);
    }
}
