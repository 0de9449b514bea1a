//! Bounds how far single precision may move a ray relative to a surface. `docs/accuracy.md` derives the bound.

use glam::{DAffine3, DMat3, DVec3};

/// Half the distance from 1 to the next larger `f32`: the largest relative error of one rounding.
pub const SINGLE: f64 = f32::EPSILON as f64 / 2.0;

/// Half the distance from 0 to the next larger `f32`, the smallest possible rounding error.
pub const SMALLEST: f64 = 0.5 * f32::from_bits(1) as f64;

/// Roundings that move a ray beside an edge, as multiples of [`SINGLE`] times the largest numbers that meet: six of the
/// origin, seven of the way, seven of the corners.
const BESIDE_AN_EDGE: f64 = 8.0;

/// Roundings of the origin of a ray on its way into a mesh: one of each element of the matrix, four of the sum of
/// products, one of the difference from a corner.
const OF_ORIGIN: f64 = 6.0;

/// Roundings of the way to the hit: four of the direction, three of the shear, eight of the distance.
const OF_WAY: f64 = 15.0;

/// Roundings of the corners: one of the difference, twice three of the shear, twice three of the weights.
const OF_CORNERS: f64 = 13.0;

/// Roundings of the products in the weights, as multiples of the longest side squared over the height.
const OF_WEIGHTS: f64 = 12.0;

/// Returns how far a hit found in single precision may lie off the plane of its triangle, in world units: `normal` is
/// that of the triangle, `triangle` its corners in coordinates of the mesh, `reach` the largest coordinates of the mesh; the
/// ray goes from `origin` by `way`. Infinite if the transform has no inverse or the triangle no area.
pub fn displacement(
    to_world: &DAffine3,
    reach: DVec3,
    triangle: [DVec3; 3],
    normal: DVec3,
    [origin, way]: [DVec3; 2],
) -> f64 {
    let to_mesh = to_world.inverse();
    let into = absolute(&to_mesh.matrix3);
    let start = into * origin.abs() + to_mesh.translation.abs();
    let rounded = OF_ORIGIN * start + OF_WAY * (into * way.abs()) + OF_CORNERS * reach;
    let error = SINGLE * rounded + SMALLEST * (OF_ORIGIN + OF_WAY + OF_CORNERS);
    let across = to_world.matrix3.transpose() * normal;
    let along = across.abs().dot(error) + across.length() * SINGLE * OF_WEIGHTS * slenderness(triangle);
    if along.is_nan() { f64::INFINITY } else { along }
}

/// Returns the square of the longest side of a triangle over its height.
fn slenderness([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    // Scaled, so that products do not leave the range of numbers.
    let double_area = ((b - a) / longest).cross((c - a) / longest).length();
    longest / double_area
}

/// The largest numbers that occur when a ray is transformed into the coordinates of a mesh: every rounding moves the
/// ray by at most [`SINGLE`] times them.
#[derive(Clone, Copy, Debug)]
pub struct Magnitude {
    /// |A| |A^-1|, with absolute values element by element.
    spread: DMat3,
    /// Contribution of translation and vertices, in world units.
    fixed: DVec3,
    /// What one unit in each coordinate of the mesh is at most in the world: the sums of the rows of |A|.
    unit: DVec3,
}

impl Magnitude {
    /// Computes it for an instance from its transform, the inverse, and the largest coordinates of its mesh.
    pub fn new(to_world: &DAffine3, to_mesh: &DAffine3, mesh: DVec3) -> Magnitude {
        let (there, back) = (absolute(&to_world.matrix3), absolute(&to_mesh.matrix3));
        let spread = there * back;
        Magnitude { spread, fixed: spread * to_world.translation.abs() + there * mesh, unit: there * DVec3::ONE }
    }

    /// Returns it in world units, for a ray whose coordinates reach `ray` in world units.
    pub fn at(&self, ray: DVec3) -> f64 {
        (self.spread * ray + self.fixed).max_element()
    }

    /// Returns how far, in world units, a device that traces in single precision may find a ray from where it is, at a
    /// point where the absolute values of origin and way add up to `ray`. Infinite if the transform has no inverse.
    pub fn slack(&self, ray: DVec3) -> f64 {
        let slack =
            BESIDE_AN_EDGE * (SINGLE * (self.spread * ray + self.fixed).length() + SMALLEST * self.unit.length());
        if slack.is_nan() { f64::INFINITY } else { slack }
    }
}

/// Returns the matrix of absolute values.
pub(super) fn absolute(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

#[cfg(test)]
mod tests {
    use super::super::approach::Approach;
    use super::super::cpu::{CpuTracer, TwoLevel};
    use super::super::random::Random;
    use super::super::rays::Ray;
    use super::super::test_scenes::{cube, scene};
    use super::*;
    use crate::scene::TriangleRef;
    use crate::verify::Hit;

    /// Transforms of each condition.
    const TRANSFORMS: usize = 8;
    /// Rays for each of them.
    const RAYS: usize = 512;

    #[test]
    fn of_the_identity_is_the_sum_of_ray_and_mesh() {
        let plain = Magnitude::new(&DAffine3::IDENTITY, &DAffine3::IDENTITY, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(plain.at(DVec3::new(10.0, 0.0, 0.0)), 11.0);
    }

    #[test]
    fn a_far_translation_counts() {
        let far = DAffine3::from_translation(DVec3::new(-1e6, 0.0, 0.0));
        assert_eq!(Magnitude::new(&far, &far.inverse(), DVec3::ONE).at(DVec3::ZERO), 1e6 + 1.0);
    }

    #[test]
    fn a_transform_without_inverse_has_no_bound() {
        let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        assert_eq!(Magnitude::new(&flat, &flat.inverse(), DVec3::ONE).slack(DVec3::ONE), f64::INFINITY);
    }

    /// Returns a transform whose largest stretch is `condition` times its smallest.
    fn transform(random: &mut Random, condition: f64) -> DAffine3 {
        let mut turn = || DMat3::from_axis_angle(random.direction(), 6.3 * random.unit());
        let (first, last) = (turn(), turn());
        let (middle, shift) = (random.unit(), 10f64.powf(4.0 * random.unit() - 1.0));
        let stretches = DVec3::new(1.0, condition.powf(-middle), 1.0 / condition);
        DAffine3 { matrix3: first * DMat3::from_diagonal(stretches) * last, translation: shift * random.direction() }
    }

    /// Returns a ray to a point of a triangle.
    fn ray_to([a, b, c]: [DVec3; 3], random: &mut Random) -> Ray {
        let (u, v) = (random.unit(), random.unit());
        let (u, v) = if u + v < 1.0 { (u, v) } else { (1.0 - u, 1.0 - v) };
        let away = 10f64.powf(5.0 * random.unit() - 2.0) * random.direction();
        Ray::endless(a + u * (b - a) + v * (c - a) + away, -away)
    }

    /// Returns the share of the bound by which each traced hit of a cube is off the plane of its triangle.
    fn shares(transform: DAffine3, mut random: Random) -> Vec<f64> {
        let scene = scene(vec![cube(0, None)], &[(0, transform)]);
        let corners = |triangle| scene.world_corners(TriangleRef { instance: 0, triangle });
        let rays: Vec<Ray> = (0..RAYS).map(|_| ray_to(corners(random.below(12) as u32), &mut random)).collect();
        let trees = TwoLevel::build(&scene);
        let share = |(ray, hit): (&Ray, Option<Hit>)| {
            let hit = hit?;
            let truly = Approach::new(ray, &corners(hit.triangle));
            let way = f64::from(hit.t) * ray.direction.as_dvec3();
            let triangle = scene.meshes[0].corners(hit.triangle).map(|p| p.as_dvec3());
            let bound = displacement(&transform, DVec3::ONE, triangle, truly.normal, [ray.origin.as_dvec3(), way]);
            let ahead = ray.direction.as_dvec3().normalize();
            truly.through.then(|| (way.length() - truly.distance).abs() * truly.normal.dot(ahead).abs() / bound)
        };
        rays.iter().zip(CpuTracer::new(&trees).closest(&rays)).filter_map(share).collect()
    }

    #[test]
    fn no_hit_is_off_by_more_than_the_bound_and_some_are_off_by_an_eighth() {
        for exponent in 0..=8 {
            let of_one = |i| {
                let mut random = Random::at(7, exponent, i);
                shares(transform(&mut random, 10f64.powi(exponent as i32)), random)
            };
            let shares: Vec<f64> = (0..TRANSFORMS).flat_map(of_one).collect();
            let largest = shares.iter().copied().fold(0.0, f64::max);
            // Needles and sheets of condition 1e8 are hardly ever hit.
            assert!(shares.len() > 100, "{} hits", shares.len());
            assert!((0.125..=1.0).contains(&largest), "condition 1e{exponent}: {largest} of the bound");
        }
    }
}
