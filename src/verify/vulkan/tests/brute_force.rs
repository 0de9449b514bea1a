//! Finds hits by testing every triangle in double precision.

use glam::DVec3;

use super::*;
use crate::scene::TriangleRef;

/// Distance from an edge (barycentric) or between hits below which single precision is ambiguous.
const DOUBTFUL: f64 = 1e-4;

struct Crossing {
    t: f64,
    at: TriangleRef,
    front: bool,
    /// Smallest barycentric coordinate.
    inside: f64,
}

/// Compares hits with the truth; returns how many rays hit something and how many were ambiguous.
pub(super) fn assert_closest(scene: &Scene, rays: &[Ray], hits: &[Option<Hit>]) -> (usize, usize) {
    assert_eq!(rays.len(), hits.len());
    let triangles: Vec<(TriangleRef, [DVec3; 3])> = placed(scene);
    let (mut hit_count, mut doubtful) = (0, 0);
    for (i, (ray, hit)) in rays.iter().zip(hits).enumerate() {
        let mut crossings: Vec<Crossing> =
            triangles.iter().filter_map(|(at, corners)| cross(ray, *at, corners)).collect();
        crossings.sort_by(|a, b| a.t.total_cmp(&b.t));
        let first = crossings.iter().position(|c| c.inside > DOUBTFUL);
        let before = &crossings[..first.unwrap_or(crossings.len())];
        let close = |f: usize| crossings.get(f + 1).is_some_and(|c| c.t - crossings[f].t < DOUBTFUL);
        if !before.is_empty() || first.is_some_and(close) {
            doubtful += 1;
            continue;
        }
        let Some(truth) = first.map(|f| &crossings[f]) else {
            assert_eq!(*hit, None, "ray {i} hits nothing");
            continue;
        };
        hit_count += 1;
        let hit = hit.unwrap_or_else(|| panic!("ray {i} hits {:?}", truth.at));
        assert_eq!((hit.instance, hit.triangle), (truth.at.instance, truth.at.triangle), "ray {i}");
        assert_eq!(hit.front, truth.front, "ray {i}, side of {:?}", truth.at);
        assert!((f64::from(hit.t) - truth.t).abs() <= 1e-4 * truth.t.max(1.0), "ray {i}: {} for {}", hit.t, truth.t);
    }
    (hit_count, doubtful)
}

/// Returns the triangles, in world space, of all instances that are not flat.
fn placed(scene: &Scene) -> Vec<(TriangleRef, [DVec3; 3])> {
    let mut all = Vec::new();
    for (instance, placed) in (0..).zip(&scene.instances) {
        if placed.transform.matrix3.determinant() != 0.0 {
            let count = scene.meshes[placed.mesh.0 as usize].triangle_count() as u32;
            let of = (0..count).map(|triangle| TriangleRef { instance, triangle });
            all.extend(of.map(|at| (at, scene.world_corners(at))));
        }
    }
    all
}

/// Intersects a ray with a triangle (T. Möller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997),
/// without culling and with a small tolerance at the edges.
fn cross(ray: &Ray, at: TriangleRef, [a, b, c]: &[DVec3; 3]) -> Option<Crossing> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = (origin - a) / determinant;
    let q = s.cross(e1);
    let (u, v, t) = (s.dot(p), q.dot(direction), q.dot(e2));
    let inside = u.min(v).min(1.0 - u - v);
    let within = t > f64::from(ray.t_min) && t < f64::from(ray.t_max);
    (inside > -DOUBTFUL && within).then_some(Crossing { t, at, front: determinant > 0.0, inside })
}
