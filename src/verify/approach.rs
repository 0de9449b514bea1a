//! How a ray passes a triangle, computed in double precision.

use glam::{DVec2, DVec3};

use super::cpu::TrueHit;
use super::rays::Ray;
use crate::scene::Scene;

const SIDES: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

/// The way in which the line of a ray passes a triangle. Lengths are in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Whether the line intersects the triangle, including its edges.
    pub through: bool,
    /// Distance of the line from the nearest edge, as seen along the line.
    pub to_edge: f64,
    /// Distance along the ray to the intersection, or to the nearest point of an edge.
    pub distance: f64,
    /// Length of the longest side of the triangle.
    pub size: f64,
    /// Height of the triangle over its longest side, as seen along the ray; 0 if edge-on.
    pub height: f64,
    /// Whether the ray comes from the side on which the corners run counter-clockwise.
    pub front: bool,
    /// The unit normal on that side; zero if the triangle has no area.
    pub normal: DVec3,
}

impl Approach {
    /// Computes the approach of a ray to a triangle with corners in world coordinates.
    pub fn new(ray: &Ray, corners: &[DVec3; 3]) -> Approach {
        let origin = ray.origin.as_dvec3();
        let ahead = ray.direction.as_dvec3().normalize_or(DVec3::Z);
        let (x, y) = ahead.any_orthonormal_pair();
        let relative = corners.map(|p| p - origin);
        let flat = relative.map(|p| DVec2::new(p.dot(x), p.dot(y)));
        let depth = relative.map(|p| p.dot(ahead));
        let opposite = [flat[1].perp_dot(flat[2]), flat[2].perp_dot(flat[0]), flat[0].perp_dot(flat[1])];
        let area = opposite[0] + opposite[1] + opposite[2];
        let (to_edge, edge_depth) = SIDES
            .map(|(a, b)| pass_edge([flat[a], flat[b]], [depth[a], depth[b]]))
            .into_iter()
            .fold((f64::INFINITY, depth[0]), |best, edge| if edge.0 < best.0 { edge } else { best });
        let longest = SIDES.map(|(a, b)| flat[a].distance(flat[b])).into_iter().fold(0.0, f64::max);
        let height = if longest > 0.0 { area.abs() / longest } else { 0.0 };
        let inside = opposite.iter().all(|&o| o >= 0.0) || opposite.iter().all(|&o| o <= 0.0);
        // Edge-on, the signs are rounding noise; a point inside is nearer to an edge than the height.
        let through = area != 0.0 && inside && to_edge <= height;
        let inner_depth = (opposite[0] * depth[0] + opposite[1] * depth[1] + opposite[2] * depth[2]) / area;
        let normal = (relative[1] - relative[0]).cross(relative[2] - relative[0]);
        let size = SIDES.map(|(a, b)| corners[a].distance(corners[b])).into_iter().fold(0.0, f64::max);
        Approach {
            through,
            to_edge,
            distance: if through { inner_depth } else { edge_depth },
            size,
            height,
            front: normal.dot(ahead) < 0.0,
            normal: normal.normalize_or_zero(),
        }
    }

    /// Whether the line touches the triangle if it may be off by `slack`.
    pub fn touches(&self, slack: f64) -> bool {
        self.through || self.to_edge <= slack
    }

    /// Whether the line passes an edge closely enough that `slack` decides whether it hits.
    pub fn grazes(&self, slack: f64) -> bool {
        self.to_edge <= slack
    }

    /// Returns the distances at which a hit may be found if line and corners may be off by `slack`. Moving a corner by
    /// `slack` moves the intersection by up to the share `slack / height` of the triangle's size, but not beyond it.
    pub fn window(&self, slack: f64) -> [f64; 2] {
        let share = if slack < self.height { slack / self.height } else { 1.0 };
        let reach = slack + share * self.size;
        [self.distance - reach, self.distance + reach]
    }

    /// Whether a hit at the given distance can be a hit of this triangle, within `slack`.
    pub fn explains(&self, distance: f64, slack: f64) -> bool {
        let [near, far] = self.window(slack);
        self.touches(slack) && distance >= near && distance <= far
    }
}

/// Returns the distance of the origin from an edge, and the depth of the edge's nearest point.
fn pass_edge([a, b]: [DVec2; 2], [depth_a, depth_b]: [f64; 2]) -> (f64, f64) {
    let edge = b - a;
    let along = -a.dot(edge) / edge.length_squared();
    let along = if along.is_nan() { 0.0 } else { along.clamp(0.0, 1.0) };
    ((a + along * edge).length(), depth_a + along * (depth_b - depth_a))
}

/// Returns the distance of a true hit, computed anew from its triangle, in lengths of the ray's direction; that of the
/// hit if rounding takes the ray past it.
pub(crate) fn exact_distance(scene: &Scene, ray: &Ray, hit: &TrueHit) -> f64 {
    let approach = Approach::new(ray, &scene.world_corners(hit.at));
    if approach.through { approach.distance / ray.direction.as_dvec3().length() } else { hit.t }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::super::random::Random;
    use super::*;

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn down(x: f64, y: f64) -> Approach {
        Approach::new(&Ray::endless(DVec3::new(x, y, 2.0), DVec3::NEG_Z), &TRIANGLE)
    }

    #[test]
    fn a_ray_through_the_middle_tells_distance_and_side() {
        let inside = down(0.25, 0.25);
        assert!(inside.through && inside.front);
        assert_eq!([inside.distance, inside.to_edge], [2.0, 0.25]);
        assert!(inside.explains(2.0, 0.0) && !inside.explains(2.1, 0.01) && !inside.grazes(0.2));
    }

    #[test]
    fn a_ray_beside_an_edge_tells_how_far() {
        let beside = down(-0.125, 0.5);
        assert!(!beside.through && beside.touches(0.125) && !beside.touches(0.1));
        assert_eq!([beside.distance, beside.to_edge], [2.0, 0.125]);
    }

    #[test]
    fn an_edge_on_ray_may_hit_anywhere_within_the_triangle() {
        let ray = Ray::endless(DVec3::new(-1.0, 0.25, 0.0), DVec3::X);
        let flat = Approach::new(&ray, &TRIANGLE);
        assert_eq!((flat.through, flat.to_edge, flat.height), (false, 0.0, 0.0));
        assert!(flat.explains(1.0, 0.0) && flat.explains(1.9, 0.0) && !flat.explains(3.5, 0.1));
    }

    #[test]
    fn an_edge_on_ray_beside_the_triangle_never_passes_through() {
        for i in 0..1000 {
            let mut random = Random::at(1, 0, i);
            let turn = DMat3::from_axis_angle(random.direction(), 6.0 * random.unit());
            let ray = Ray::endless(turn * DVec3::new(-2.0, 3.0, 0.0), turn * DVec3::X);
            // Uses the ray as stored, so that it lies in the plane as exactly as double precision allows.
            let (origin, ahead) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let across = turn * DVec3::NEG_Y;
            let corners = [(1.0, 1.0), (3.0, 1.0), (2.0, 2.0)].map(|(x, y)| origin + x * ahead + y * across);
            let beside = Approach::new(&ray, &corners);
            assert!(!beside.through && !beside.touches(0.5), "turn {i}: {beside:?}");
        }
    }

    #[test]
    fn degenerate_triangles_are_edges_or_points() {
        let ray = Ray::endless(DVec3::new(0.5, 0.0, 1.0), DVec3::NEG_Z);
        let edge = Approach::new(&ray, &[DVec3::ZERO, DVec3::X, DVec3::X]);
        assert_eq!((edge.through, edge.to_edge, edge.distance), (false, 0.0, 1.0));
        let point = Approach::new(&ray, &[DVec3::ZERO; 3]);
        assert_eq!((point.through, point.to_edge), (false, 0.5));
    }
}
