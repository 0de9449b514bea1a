//! The reading error: the distance between corners as stored and as the file gives them.

use glam::{DAffine3, DMat3};

use super::{Instance, InstanceId, Scene};

/// How far rounding to single precision moved corners when the file was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingError {
    /// The largest distance of a corner from where the file has it, in world units.
    pub max: f64,
    /// The largest such distance over the diagonal of the corner's instance; instances without a size are left out.
    pub ratio_of_object: f64,
    /// The instance with the largest ratio.
    pub object: InstanceId,
}

impl Scene {
    /// Returns the reading error; `None` if every corner is stored exactly.
    pub fn reading_error(&self) -> Option<ReadingError> {
        let mut found: Option<ReadingError> = None;
        for (object, bounds) in (0..).map(InstanceId).zip(self.instance_boxes()) {
            let error = self.reading_error_of(&self.instances[object.0 as usize]);
            if error == 0.0 {
                continue;
            }
            let size = bounds.diagonal();
            let ratio_of_object = if size > 0.0 { error / size } else { 0.0 };
            let worst = found.get_or_insert(ReadingError { max: error, ratio_of_object, object });
            worst.max = worst.max.max(error);
            if ratio_of_object > worst.ratio_of_object {
                (worst.ratio_of_object, worst.object) = (ratio_of_object, object);
            }
        }
        found
    }

    /// Returns how far a corner of an instance may be from where the file has it in any layout, in world units: the
    /// reading error of the instance, and the rounding of comparing places in double precision. 0 if every corner is
    /// stored exactly.
    pub fn unavoidable_error(&self, instance: InstanceId) -> f64 {
        match self.reading_error_of(&self.instances[instance.0 as usize]) {
            0.0 => 0.0,
            error => {
                let bounds = &self.instance_boxes()[instance.0 as usize];
                error + 2.0 * f64::EPSILON * bounds.min.abs().max(bounds.max.abs()).max_element()
            }
        }
    }

    /// Returns the largest [`Scene::unavoidable_error`] of all instances.
    pub fn largest_unavoidable_error(&self) -> f64 {
        (0..self.instances.len() as u32).map(|i| self.unavoidable_error(InstanceId(i))).fold(0.0, f64::max)
    }

    fn reading_error_of(&self, instance: &Instance) -> f64 {
        match self.meshes[instance.mesh.0 as usize].reading_error() {
            0.0 => 0.0,
            residual => residual * most_stretch(&instance.transform),
        }
    }
}

/// Returns an upper bound on the factor by which a transform lengthens a vector. It is the smaller of two bounds on the
/// spectral norm: the Frobenius norm, and the square root of the product of the largest absolute row sum and the largest
/// absolute column sum. 1 for a translation.
pub(crate) fn most_stretch(transform: &DAffine3) -> f64 {
    let sums = |m: &DMat3| m.to_cols_array_2d().iter().map(|c| c.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max);
    let m = transform.matrix3;
    let of_sums = (sums(&m) * sums(&m.transpose())).sqrt();
    let frobenius = (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt();
    of_sums.min(frobenius)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::TriangleRef;
    use crate::verify::test_scenes::{cube, scene};

    /// Two cubes, of which the second, 20 units long, is read with an error along x and moved aside.
    fn cubes() -> Scene {
        let mut large = cube(1, None);
        let count = large.geometries[0].positions.len();
        Arc::make_mut(&mut large.geometries[0].positions).iter_mut().for_each(|p| *p *= 10.0);
        large.geometries[0].residuals = Some(vec![Vec3::X * 1e-7; count].into());
        scene(vec![cube(0, None), large], &[(0, DAffine3::IDENTITY), (1, DAffine3::from_translation(DVec3::Y * 5e6))])
    }

    #[test]
    fn the_error_is_that_of_the_residuals() {
        let scene = cubes();
        let size = scene.instance_boxes()[1].diagonal();
        let error = f64::from(1e-7f32);
        let found = ReadingError { max: error, ratio_of_object: error / size, object: InstanceId(1) };
        assert_eq!(scene.reading_error(), Some(found));
        assert_eq!(scene.unavoidable_error(InstanceId(0)), 0.0);
        let unavoidable = scene.largest_unavoidable_error();
        assert!(unavoidable > error && unavoidable < error + 1e-8);
    }

    #[test]
    fn corners_in_the_world_are_those_of_the_file() {
        let scene = cubes();
        let stored = scene.meshes[1].corners(3);
        let placed = scene.world_corners(TriangleRef { instance: 1, triangle: 3 });
        for (placed, stored) in placed.into_iter().zip(stored) {
            assert_eq!(placed.x, f64::from(stored.x) + f64::from(1e-7f32));
            assert_eq!(scene.meshes[1].geometries[0].exact(0).as_vec3(), scene.meshes[1].geometries[0].positions[0]);
        }
    }

    #[test]
    fn a_changed_mesh_forgets_its_error() {
        let mut scene = cubes();
        assert!(scene.reading_error().is_some());
        scene.meshes[1].geometries[0].residuals = Some(Arc::from([Vec3::ZERO; 24]));
        assert_eq!(scene.reading_error(), None);
    }

    #[test]
    fn translations_and_quarter_turns_stretch_nothing() {
        let quarter = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
        assert_eq!(most_stretch(&DAffine3::from_translation(DVec3::splat(3.0))), 1.0);
        assert_eq!(most_stretch(&DAffine3::from_mat3(quarter)), 1.0);
        assert_eq!(most_stretch(&DAffine3::from_scale(DVec3::new(1.0, -4.0, 2.0))), 4.0);
        let turned = most_stretch(&DAffine3::from_rotation_z(0.7));
        assert!((1.0..1.5).contains(&turned));
    }
}
