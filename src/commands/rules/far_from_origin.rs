//! RK015: coordinates far from the origin lose precision: no coordinate beyond 8e6 units (Omniverse asset validator); a mesh
//! 84 km from the origin loses a centimetre (OptiX developer forum).

use super::Subject;
use crate::report::{Broken, Finding, Objects};

/// Largest coordinate that is advised, in units of the file.
const LARGEST: f64 = 8e6;

/// Step between single-precision numbers at an object's farthest coordinate, over the object's size: about where the
/// 84 km are for an object of 10 m.
const COARSE: f64 = 1e-3;

/// Finds instances far from the origin, for their own size or beyond [`LARGEST`].
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let (mut objects, mut farthest, mut of_size) = (Objects::default(), 0.0_f64, 0.0_f64);
    for (instance, bounds) in subject.scene.instances.iter().zip(subject.scene.instance_boxes()) {
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
        let share = if bounds.diagonal() > 0.0 { step_at(reach) / bounds.diagonal() } else { 0.0 };
        if reach.is_finite() && (reach > LARGEST || share > COARSE) {
            objects.add(|| instance.display_name());
            farthest = farthest.max(reach);
            of_size = of_size.max(share);
        }
    }
    let broken = Broken::Far { farthest, step: step_at(farthest), of_size };
    if objects.is_empty() { Vec::new() } else { vec![Finding::new(objects, &broken)] }
}

/// The distance between neighbouring single-precision numbers, at most.
fn step_at(number: f64) -> f64 {
    number * f64::from(f32::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Scene;
    use glam::{DAffine3, DVec3, Vec3};

    /// A row of 30 units, scaled and then moved.
    fn row_at(x: f64, scale: f64) -> Scene {
        let mut builder = SceneBuilder::default();
        let mesh = builder.mesh("row", vec![(0, row(Vec3::ZERO, 30))]);
        builder.place(
            mesh,
            "row",
            DAffine3::from_scale_rotation_translation(DVec3::splat(scale), Default::default(), DVec3::X * x),
        );
        builder.scene()
    }

    #[test]
    fn far_coordinates_are_found_by_number_or_by_the_size_of_the_object() {
        for scene in [row_at(9e6, 100.0), row_at(1e6, 1.0), row_at(1.0, 1e-6)] {
            let finding = found_in(&scene, check).expect("a finding");
            assert_eq!((finding.rule.id(), finding.object.as_str(), finding.count), ("RK015", "row", 1));
        }
    }

    #[test]
    fn coordinates_fine_enough_for_the_object_are_left_alone() {
        for scene in [row_at(0.0, 1.0), row_at(1e4, 1.0), row_at(0.0, 1e-4), row_at(1e6, 1000.0)] {
            assert_eq!(found_in(&scene, check), None);
        }
    }
}
