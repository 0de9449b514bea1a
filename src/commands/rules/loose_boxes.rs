//! RK013: a non-uniform scale or a shear in an instance makes its box loose (AMD, RDNA performance guide).
//!
//! The factor is the ratio of the transform's largest to smallest singular value. A box is loose only if the axes do not
//! keep it tight, so the box that a driver sees, that of the transformed box of the mesh, is compared with the box of the
//! transformed triangles.

use glam::{DAffine3, DMat3, DVec3};

use super::Subject;
use crate::report::{Broken, Finding, Objects};
use crate::scene::{Bounds, InstanceId, Mesh};

/// Ratio of a transform's largest to smallest singular value above which its box may count as loose.
const FACTOR: f64 = 4.0;

/// Surface area of a loose box over that of the tight one.
const LOOSE: f64 = 1.25;

/// Triangles to transform, over those stored: keeps the time linear if one large mesh has many stretched instances.
const BUDGET: usize = 4;

/// Finds stretched instances whose boxes are loose, in file order until the budget is spent.
pub(super) fn check(subject: &Subject) -> Vec<Finding> {
    let mut budget = BUDGET * subject.scene.triangles_stored() as usize;
    let (mut objects, mut worst, mut empty) = (Objects::default(), 0.0_f64, 0.0);
    for i in subject.still() {
        let transform = subject.scene.instances[i.0 as usize].transform;
        let factor = stretch(&transform.matrix3);
        let mesh = subject.scene.mesh_of(i);
        if !(factor > FACTOR && factor.is_finite()) || mesh.triangle_count() > budget {
            continue;
        }
        budget -= mesh.triangle_count();
        let excess = excess(subject, i, mesh, &transform);
        if excess > 0.0 {
            objects.add(|| subject.name(i));
            worst = worst.max(factor);
            empty += excess;
        }
    }
    let broken = Broken::Loose { factor: worst, per_ray: subject.share(empty) };
    if objects.is_empty() { Vec::new() } else { vec![Finding::new(objects, &broken)] }
}

/// The surface area by which a loose box exceeds the tight one; 0 if it is not loose.
fn excess(subject: &Subject, instance: InstanceId, mesh: &Mesh, transform: &DAffine3) -> f64 {
    let corners = mesh.geometries.iter().flat_map(|g| g.triangles.iter().flatten().map(|&v| g.positions[v as usize]));
    let tight = Bounds::of(corners.map(|p| transform.transform_point3(p.as_dvec3()))).area();
    let loose = subject.boxes[instance.0 as usize].area();
    if loose > LOOSE * tight { loose - tight } else { 0.0 }
}

/// The ratio of the largest to the smallest singular value; infinite for singular matrices.
fn stretch(matrix: &DMat3) -> f64 {
    let (shortest, longest) = singular_range(matrix);
    longest / shortest
}

/// The smallest and largest singular value of a matrix: square roots of the eigenvalues of its Gram matrix, in closed
/// form (O. K. Smith, "Eigenvalues of a symmetric 3x3 matrix", 1961).
fn singular_range(m: &DMat3) -> (f64, f64) {
    let gram = m.transpose() * *m;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    let deviation = gram - DMat3::from_diagonal(DVec3::splat(mean));
    let squares = [deviation.x_axis, deviation.y_axis, deviation.z_axis].map(|c| c.length_squared());
    let p = (squares.iter().sum::<f64>() / 6.0).sqrt();
    if p == 0.0 {
        return (mean.sqrt(), mean.sqrt());
    }
    let angle = ((deviation * (1.0 / p)).determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * p * angle.cos();
    let smallest = mean + 2.0 * p * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    (smallest.max(0.0).sqrt(), largest.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::test_subject::found_in;
    use super::*;
    use crate::layout::test_scenes::*;
    use crate::scene::Scene;
    use glam::Vec3;

    /// A row of triangles along a diagonal, placed by a transform.
    fn placed(transform: DAffine3) -> Scene {
        let mut builder = SceneBuilder::default();
        let along = |i: u16| small_triangle(f32::from(i) * Vec3::new(1.0, -1.0, 1.0));
        let mesh = builder.mesh("rod", vec![(0, (0..20).map(along).collect())]);
        builder.place(mesh, "rod", transform);
        builder.scene()
    }

    #[test]
    fn a_turned_and_stretched_instance_has_a_loose_box() {
        let scale = DAffine3::from_scale(DVec3::new(9.0, 1.0, 1.0));
        let finding = found_in(&placed(DAffine3::from_rotation_z(2.0) * scale), check).expect("a finding");
        assert_eq!((finding.rule.id(), finding.objects.as_slice()), ("RK013", ["rod".to_owned()].as_slice()));
        assert!(finding.message.contains("up to 9.0:1"), "{}", finding.message);
    }

    #[test]
    fn boxes_that_stay_tight_are_left_alone() {
        assert_eq!(found_in(&placed(DAffine3::from_scale(DVec3::new(9.0, 1.0, 1.0))), check), None);
        assert_eq!(found_in(&placed(DAffine3::from_rotation_z(2.0)), check), None);
    }

    #[test]
    fn singular_values_of_a_turned_scale_are_its_factors() {
        let turned = DMat3::from_rotation_x(0.3) * DMat3::from_diagonal(DVec3::new(0.5, 2.0, 3.0));
        let (smallest, largest) = singular_range(&turned);
        assert!((smallest - 0.5).abs() < 1e-9 && (largest - 3.0).abs() < 1e-9, "{smallest} {largest}");
        assert_eq!(singular_range(&DMat3::IDENTITY), (1.0, 1.0));
    }
}
