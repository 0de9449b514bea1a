//! The true hits: rays against the exact triangles, in double precision.

use glam::{DMat3, Vec3};
use rayon::prelude::*;

use super::boxes::{BoxRay, Real};
use super::search::{Found, Inside, Interval, Stacks, search};
use super::two_level::{Entry, TwoLevel};
use super::watertight::{ShearedRay, TriangleTest};
use crate::scene::TriangleRef;
use crate::verify::Hit;
use crate::verify::rays::Ray;
use crate::verify::rounding::absolute;

/// The true first hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueHit {
    /// Distance, in units of the direction's length.
    pub t: f64,
    /// The triangle; if several are at exactly the same distance, the one with the lowest instance and number.
    pub at: TriangleRef,
    /// Whether the front is hit, by glTF's rule.
    pub front: bool,
}

impl From<Hit> for TrueHit {
    /// Believes what a tracer reports.
    fn from(hit: Hit) -> TrueHit {
        let at = TriangleRef { instance: hit.instance, triangle: hit.triangle };
        TrueHit { t: f64::from(hit.t), at, front: hit.front }
    }
}

/// Finds hits as if without rounding: triangles are tested in world coordinates in double precision, as returned by
/// [`crate::scene::Scene::world_corners`]; only boxes are tested in mesh coordinates.
pub struct Reference<'a> {
    accel: &'a TwoLevel,
    ways: Vec<Way>,
}

/// Determines how exactly a ray can be transformed into a mesh.
struct Way {
    /// |A^-1|, element by element.
    to_mesh: DMat3,
    /// Condition of the transform: the largest row sum of |A| |A^-1|.
    condition: f64,
}

impl<'a> Reference<'a> {
    /// Creates a reference that uses built trees.
    pub fn new(accel: &'a TwoLevel) -> Self {
        Reference { accel, ways: accel.entries.iter().map(Way::new).collect() }
    }

    /// Returns the first hits of many rays.
    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<TrueHit>> {
        rays.par_iter()
            .map_init(|| Stacks::new(self.accel), |stacks, ray| self.search(ray, false, stacks, |_| true))
            .collect()
    }

    /// Returns, for each ray, whether `is_meant` holds for any triangle that it intersects, however many lie in front;
    /// `is_meant` gets the index of the ray.
    pub fn meet(&self, rays: &[Ray], is_meant: impl Fn(usize, &TrueHit) -> bool + Sync) -> Vec<bool> {
        let meets =
            |stacks: &mut Stacks<f64>, (i, ray)| self.search(ray, true, stacks, |hit| is_meant(i, hit)).is_some();
        rays.par_iter().enumerate().map_init(|| Stacks::new(self.accel), meets).collect()
    }

    /// Returns the first hit that counts, or any.
    fn search(
        &self,
        ray: &Ray,
        any: bool,
        stacks: &mut Stacks<f64>,
        counts: impl Fn(&TrueHit) -> bool,
    ) -> Option<TrueHit> {
        let scale = self.accel.scale;
        let (origin, direction) = (ray.origin.as_dvec3() * scale, ray.direction.as_dvec3());
        let pad = f64::PAD * (origin.abs().max_element() + self.accel.reach);
        let boxes = BoxRay::new(origin.to_array(), direction.to_array(), pad);
        let within = Interval { t_min: f64::from(ray.t_min) * scale, t_max: f64::from(ray.t_max) * scale, any };
        let triangles = ShearedRay::new(origin.to_array(), direction.to_array());
        let enter = |at: usize, entry: &Entry| {
            let o = entry.to_mesh.transform_point3(origin);
            let d = entry.to_mesh.transform_vector3(direction);
            let largest = self.ways[at].to_mesh * (origin.abs() + entry.to_world.translation.abs());
            // Coordinates of a scaled mesh are at most 2.
            let pad = f64::PAD * self.ways[at].condition * (largest.max_element() + 2.0);
            let boxes = BoxRay::new(o.to_array(), d.to_array(), pad);
            Some(Inside { start: 0.0, boxes, triangles })
        };
        search(self.accel, &boxes, within, stacks, enter, world_corners, |found| counts(&self.hit(found)))
            .map(|found| self.hit(&found))
    }

    fn hit(&self, found: &Found<f64>) -> TrueHit {
        let instance = self.accel.entries[found.entry].instance;
        let at = TriangleRef { instance, triangle: found.triangle };
        TrueHit { t: found.t / self.accel.scale, at, front: found.front }
    }
}

impl Way {
    fn new(entry: &Entry) -> Way {
        let to_mesh = absolute(&entry.to_mesh.matrix3);
        let product = absolute(&entry.to_world.matrix3) * to_mesh;
        Way { to_mesh, condition: (product * glam::DVec3::ONE).max_element() }
    }
}

fn world_corners(entry: &Entry, corners: &[Vec3; 3]) -> [[f64; 3]; 3] {
    let [a, b, c] = corners.map(|p| entry.to_world.transform_point3(p.as_dvec3()).to_array());
    if entry.mirrored { [a, c, b] } else { [a, b, c] }
}
