//! Where and what a ray hits.

use glam::{DVec3, Vec3};

use crate::scene::{Geometry, InstanceId, Scene};
use crate::verify::Hit;
use crate::verify::rays::Ray;

/// A point of a surface.
pub(super) struct Spot<'a> {
    pub(super) instance: u32,
    pub(super) mesh: u32,
    /// Index of the geometry in its mesh.
    pub(super) index: usize,
    pub(super) geometry: &'a Geometry,
    /// Vertices of the triangle.
    pub(super) vertices: [u32; 3],
    /// Weights of the vertices; their sum is 1.
    pub(super) weights: [f64; 3],
    /// The point, in world units.
    pub(super) point: DVec3,
    /// Unit normal on the side that the ray comes from.
    pub(super) normal: DVec3,
    /// Distance in units of the ray's direction.
    pub(super) distance: f64,
    /// Whether the front is hit, by glTF's rule.
    pub(super) front: bool,
}

impl<'a> Spot<'a> {
    /// Returns the point of a hit.
    pub(super) fn of(scene: &'a Scene, ray: &Ray, hit: &Hit) -> Spot<'a> {
        let instance = &scene.instances[hit.instance as usize];
        let mesh = scene.mesh_of(InstanceId(hit.instance));
        let (index, triangle) = mesh.locate(hit.triangle);
        let geometry = &mesh.geometries[index];
        let corners = geometry.corners(triangle).map(|p| instance.transform.transform_point3(p.as_dvec3()));
        let direction = ray.direction.as_dvec3();
        let near = ray.origin.as_dvec3() + f64::from(hit.t) * direction;
        let (normal, weights) = plane(&corners, near);
        Spot {
            instance: hit.instance,
            mesh: instance.mesh.0,
            index,
            geometry,
            vertices: geometry.triangles[triangle],
            weights,
            point: corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2],
            normal: if normal.dot(direction) > 0.0 { -normal } else { normal },
            distance: f64::from(hit.t),
            front: hit.front,
        }
    }

    /// Returns the mean of three values by the weights of the vertices.
    pub(super) fn mean(&self, of_vertex: impl Fn(u32) -> Vec3) -> Vec3 {
        let [a, b, c] = self.vertices.map(of_vertex);
        a * self.weights[0] as f32 + b * self.weights[1] as f32 + c * self.weights[2] as f32
    }
}

/// Returns a unit normal of a triangle, and the weights of its corners at the point of it next to one that nearly lies
/// on it.
fn plane([a, b, c]: &[DVec3; 3], near: DVec3) -> (DVec3, [f64; 3]) {
    let across = (b - a).cross(c - a);
    let area = across.length_squared();
    if !(area > 0.0 && area.is_finite()) {
        return (across.normalize_or(DVec3::Y), [1.0, 0.0, 0.0]);
    }
    let share = |p: &DVec3, q: &DVec3| ((p - near).cross(q - near).dot(across) / area).clamp(0.0, 1.0);
    let weights = [share(b, c), share(c, a), share(a, b)];
    let sum: f64 = weights.iter().sum();
    (across / area.sqrt(), weights.map(|weight| weight / sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_the_point_and_never_leave_the_triangle() {
        let corners = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 2.0];
        let (normal, weights) = plane(&corners, DVec3::new(1.0, 0.5, 1e-7));
        assert_eq!(normal, DVec3::Z);
        assert!(weights.iter().zip([0.5, 0.25, 0.25]).all(|(w, e)| (w - e).abs() < 1e-6), "{weights:?}");
        let (_, outside) = plane(&corners, DVec3::new(-1.0, 0.5, 0.0));
        assert!(outside.iter().all(|w| (0.0..=1.0).contains(w)) && (outside.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(plane(&[DVec3::ONE; 3], DVec3::ONE).1, [1.0, 0.0, 0.0]);
    }
}
