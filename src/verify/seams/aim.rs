//! Aims rays at places where the surface is closed.

use glam::DVec3;
use rayon::prelude::*;

use super::places::Place;
use super::{Aimed, Class, scaled_normal};
use crate::scene::Scene;
use crate::verify::approach::Approach;
use crate::verify::compare::magnitudes;
use crate::verify::random::Random;
use crate::verify::rays::Ray;
use crate::verify::rounding::Magnitude;
use crate::verify::view::Stage;

/// Number of attempts to find a place and a direction for a ray.
const ATTEMPTS: usize = 16;
/// Distances from the target at which rays start, near and far, in diagonals of the scene's box.
const NEAR: [f64; 2] = [1e-3, 5e-3];
const FAR: [f64; 2] = [0.2, 0.4];
/// How far directions are turned from the mean normal: up to this distance on the unit sphere, before normalisation.
const TURN: f64 = 0.5;
/// The part of the bound of rounding that targets keep from the outline of the triangles around: devices make fewer errors
/// than the bound allows for, and the few rays beyond are lost in both files alike.
const ROUNDED_SHARE: f64 = 0.25;
/// Random number stream of the rays.
const STREAM: u64 = 111;

/// Aims rays at places of a scene.
pub(super) struct Aim<'a> {
    scene: &'a Scene,
    magnitudes: Vec<Magnitude>,
    displacement: f64,
    diagonal: f64,
    seed: u64,
}

/// The places of each class that has any.
type ByClass<'p> = Vec<(Class, Vec<&'p Place>)>;

impl<'a> Aim<'a> {
    /// Prepares to aim at places of a scene that has some.
    pub(super) fn new(scene: &'a Scene, displacement: f64, seed: u64) -> Self {
        let diagonal = 2.0 * Stage::new(scene.bounds()).radius;
        Aim { scene, magnitudes: magnitudes(scene), displacement, diagonal, seed }
    }

    /// Whether rays to the middle of a place, straight from the front, cannot pass the triangles around.
    pub(super) fn is_covered(&self, place: &Place) -> bool {
        let target = place.target(0.5);
        let slack = |rounding: f64| ROUNDED_SHARE * rounding + self.displacement;
        let covered = |normal: DVec3| clearance(target, -normal, &place.ring);
        mean_normal(target, &place.ring).is_some_and(|n| covered(n) > slack(self.rounding(place, target.abs())))
    }

    /// Returns up to `count` rays, an equal share for each class, half of them from near and half from far.
    pub(super) fn rays(&self, places: &[Place], classes: &[Class], count: usize) -> Aimed {
        let of = |class: Class| places.iter().zip(classes).filter(|at| *at.1 == class).map(|at| at.0).collect();
        let all: ByClass = Class::ALL.map(|class| (class, of(class))).into();
        let by_class: ByClass = all.into_iter().filter(|(_, of)| !of.is_empty()).collect();
        let count = if by_class.is_empty() { 0 } else { count };
        let (rays, classes) = (0..count).into_par_iter().filter_map(|i| self.ray(&by_class, i)).unzip();
        Aimed { rays, classes }
    }

    fn ray(&self, by_class: &ByClass, index: usize) -> Option<(Ray, Class)> {
        let mut random = Random::at(self.seed, STREAM, index);
        let (class, places) = &by_class[index % by_class.len()];
        let [least, most] = if (index / by_class.len()).is_multiple_of(2) { NEAR } else { FAR };
        let attempt = |_| {
            let place = places[random.below(places.len() as u64) as usize];
            let distance = self.diagonal * (least + (most - least) * random.unit());
            self.attempt(place, distance, &mut random)
        };
        (0..ATTEMPTS).find_map(attempt).map(|ray| (ray, *class))
    }

    /// Returns a ray to a random point of a place, unless rounding may take it past the triangles around.
    fn attempt(&self, place: &Place, distance: f64, random: &mut Random) -> Option<Ray> {
        let target = place.target(random.unit());
        let turn = TURN * random.unit() * random.direction();
        let direction = (turn - mean_normal(target, &place.ring)?).try_normalize()?;
        let rounding = self.rounding(place, target.abs().max((target - distance * direction).abs()));
        let is_covered = clearance(target, direction, &place.ring) > ROUNDED_SHARE * rounding + self.displacement;
        let start = Ray::endless(target - distance * direction, direction).origin;
        let ray = Ray::endless(start.as_dvec3(), target - start.as_dvec3());
        is_covered.then(|| Ray { t_max: self.end(place, &ray, rounding + self.displacement), ..ray })
    }

    /// Returns the bound of how far rounding moves a ray at a place, in world units, for coordinates up to `reach`.
    fn rounding(&self, place: &Place, reach: DVec3) -> f64 {
        place.triangles.iter().map(|at| self.magnitudes[at.instance as usize].slack(reach)).fold(0.0, f64::max)
    }

    /// Returns the largest distance at which a ray that is off by `slack` may hit the triangles of a place.
    fn end(&self, place: &Place, ray: &Ray, slack: f64) -> f32 {
        let end = |at| Approach::new(ray, &self.scene.world_corners(at)).window(slack)[1];
        let farthest = place.triangles.iter().map(|&at| end(at)).fold(0.0, f64::max);
        (farthest.min(f64::from(f32::MAX)) as f32).next_up().min(f32::MAX)
    }
}

/// Returns the mean of the normals of the triangles between a point and the ring around it.
fn mean_normal(target: DVec3, ring: &[DVec3]) -> Option<DVec3> {
    let normals = segments(ring).filter_map(|[p, q]| scaled_normal([target, p, q]).try_normalize());
    normals.sum::<DVec3>().try_normalize()
}

/// Returns the radius of a disc about the target across the direction whose every point is covered by the triangles
/// between the target and the ring around it, seen from the front of all of them. Not positive if the target is not
/// surrounded.
fn clearance(target: DVec3, direction: DVec3, ring: &[DVec3]) -> f64 {
    // Seen along the direction: twice the area of a triangle over the length of its outer side.
    let to_side = |[p, q]: [DVec3; 2]| {
        let distance = -direction.dot((p - target).cross(q - target)) / (q - p).cross(direction).length();
        if distance.is_nan() { 0.0 } else { distance }
    };
    segments(ring).map(to_side).fold(f64::INFINITY, f64::min)
}

fn segments(ring: &[DVec3]) -> impl Iterator<Item = [DVec3; 2]> + '_ {
    (0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()]])
}
