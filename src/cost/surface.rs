//! Random points on the surface of a scene.

use glam::DVec3;
use rayon::prelude::*;

use super::two_level::{cofactor, face_scale};
use crate::scene::{Bounds, Instance, Mesh, Scene};

/// Returns points distributed uniformly by area over all placed triangles: the same for equal scenes, whatever their
/// layout. Returns fewer than `count`, usually none, if no triangle has an area distinguishable from 0 and from
/// infinity.
///
/// An instance, an axis, and a triangle are chosen by the triangles' areas projected along the axes of their mesh,
/// which can be summed over the mesh for any transform; a triangle is then accepted with a probability of its true area
/// over the sum of the three. No sums per instance are needed, and at most about half of all triangles are rejected
/// unless transforms shear.
pub fn points(scene: &Scene, count: usize) -> Vec<DVec3> {
    let meshes: Vec<Chunks> = scene.meshes.iter().map(Chunks::of).collect();
    let seen_area = |i: &Instance| face_scale(&i.transform.matrix3).dot(meshes[i.mesh.0 as usize].total());
    let areas = running_sums(scene.instances.iter().map(seen_area));
    let total = areas.last().copied().unwrap_or(0.0);
    if total <= 0.0 || !total.is_finite() {
        return Vec::new();
    }
    let mut random = SplitMix64(SEED);
    let mut pick = || {
        let at = place(&areas, |&sum| sum, total * random.unit());
        let instance = &scene.instances[at];
        let mesh = instance.mesh.0 as usize;
        point_on(instance, &scene.meshes[mesh], &meshes[mesh], &mut random)
    };
    (0..count.saturating_mul(TRIES)).filter_map(|_| pick()).take(count).collect()
}

const SEED: u64 = 0x7261_796b_696c_6e21;

/// Tries per point requested.
const TRIES: usize = 100;

/// Triangles per stored sum.
const CHUNK: usize = 64;

/// Areas of a mesh's triangles projected along each axis: running sums at the end of each chunk of triangles.
struct Chunks(Vec<DVec3>);

impl Chunks {
    fn of(mesh: &Mesh) -> Chunks {
        let triangles = mesh.triangle_count();
        let sum = |chunk| in_chunk(chunk, triangles).map(|t| area_vector(mesh, t).abs()).sum();
        let sums: Vec<DVec3> = (0..triangles.div_ceil(CHUNK)).into_par_iter().map(sum).collect();
        Chunks(running_sums(sums.into_iter()))
    }

    fn total(&self) -> DVec3 {
        self.0.last().copied().unwrap_or(DVec3::ZERO)
    }
}

fn in_chunk(chunk: usize, triangles: usize) -> std::ops::Range<u32> {
    (CHUNK * chunk) as u32..(CHUNK * (chunk + 1)).min(triangles) as u32
}

fn running_sums<T: Copy + Default + std::ops::Add<Output = T>>(values: impl Iterator<Item = T>) -> Vec<T> {
    let add = |sum: &mut T, value| {
        *sum = *sum + value;
        Some(*sum)
    };
    values.scan(T::default(), add).collect()
}

/// Returns the first position whose running sum exceeds `target`, or the last position.
fn place<T>(sums: &[T], key: impl Fn(&T) -> f64, target: f64) -> usize {
    sums.partition_point(|sum| key(sum) <= target).min(sums.len() - 1)
}

/// Returns a triangle's normal with its area as length, in mesh coordinates.
fn area_vector(mesh: &Mesh, triangle: u32) -> DVec3 {
    let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
    0.5 * (b - a).cross(c - a)
}

/// Returns a point on a triangle of an instance; `None` if the triangle is rejected.
fn point_on(instance: &Instance, mesh: &Mesh, chunks: &Chunks, random: &mut SplitMix64) -> Option<DVec3> {
    let m = &instance.transform.matrix3;
    let scale = face_scale(m);
    let seen = chunks.total();
    let by_axis = running_sums((scale * seen).to_array().into_iter());
    let axis = place(&by_axis, |&sum| sum, by_axis[2] * random.unit());
    let triangle = triangle_at(mesh, chunks, axis, seen[axis] * random.unit());
    let area = area_vector(mesh, triangle);
    if random.unit() * scale.dot(area.abs()) >= (cofactor(m) * area).length() {
        return None;
    }
    let corners = mesh.corners(triangle).map(|p| instance.transform.transform_point3(p.as_dvec3()));
    Some(random.point_in(corners))
}

/// Returns the triangle at which the running sum of the areas projected along an axis exceeds `target`.
fn triangle_at(mesh: &Mesh, chunks: &Chunks, axis: usize, target: f64) -> u32 {
    let chunk = place(&chunks.0, |sum| sum[axis], target);
    let mut sum = if chunk > 0 { chunks.0[chunk - 1][axis] } else { 0.0 };
    let range = in_chunk(chunk, mesh.triangle_count());
    let last = range.end - 1;
    let mut passed = |&t: &u32| {
        sum += area_vector(mesh, t)[axis].abs();
        sum > target
    };
    range.into_iter().find(&mut passed).unwrap_or(last)
}

/// G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
pub(super) struct SplitMix64(pub(super) u64);

impl SplitMix64 {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a point in a triangle, clamped so that rounding never moves it out of the triangle's box (G. Turk,
    /// "Generating Random Points in Triangles", Graphics Gems, 1990).
    fn point_in(&mut self, [a, b, c]: [DVec3; 3]) -> DVec3 {
        let (root, share) = (self.unit().sqrt(), self.unit());
        let point = a + root * (b - a) + root * share * (c - b);
        let bounds = Bounds::of([a, b, c]);
        point.clamp(bounds.min, bounds.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::tests::{instance, mesh, scene};
    use glam::{DAffine3, DMat3, Vec3, dvec3};

    /// A triangle at height `z` with legs along x and y.
    fn corner(z: f32, width: f32, depth: f32) -> [Vec3; 3] {
        [Vec3::new(0.0, 0.0, z), Vec3::new(width, 0.0, z), Vec3::new(0.0, depth, z)]
    }

    fn share_where(points: &[DVec3], inside: impl Fn(&DVec3) -> bool) -> f64 {
        points.iter().filter(|p| inside(p)).count() as f64 / points.len() as f64
    }

    #[test]
    fn triangles_get_points_by_their_area() {
        let mut triangles = vec![corner(0.0, 1.0, 1.0); 130];
        triangles.push(corner(1.0, 13.0, 10.0));
        let points = points(&scene(vec![mesh(&triangles)], vec![instance(0, DAffine3::IDENTITY)]), 10_000);
        assert_eq!(points.len(), 10_000);
        assert!((share_where(&points, |p| p.z == 1.0) - 0.5).abs() < 0.02);
        assert!(points.iter().all(|p| p.x >= 0.0 && p.y >= 0.0));
    }

    #[test]
    fn points_are_even_within_a_triangle() {
        let scene = scene(vec![mesh(&[corner(0.0, 1.0, 1.0)])], vec![instance(0, DAffine3::IDENTITY)]);
        let points = points(&scene, 20_000);
        assert!(points.iter().all(|p| p.x + p.y <= 1.0 + 1e-15));
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        assert!((mean - dvec3(1.0 / 3.0, 1.0 / 3.0, 0.0)).length() < 0.01);
        assert!((share_where(&points, |p| p.x > 0.5) - 0.25).abs() < 0.02);
    }

    #[test]
    fn instances_get_points_by_their_area_under_any_transform() {
        let wall = [Vec3::ZERO, Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
        let mesh = mesh(&[corner(0.0, 1.0, 1.0), wall]);
        let sheared = DMat3::from_cols(dvec3(2.0, 0.0, 0.0), dvec3(1.0, 3.0, 0.0), dvec3(-1.0, 0.5, -0.5));
        let at = |z: f64, m: DMat3| instance(0, DAffine3 { matrix3: m, translation: dvec3(0.0, 0.0, z) });
        let matrices = [DMat3::IDENTITY, DMat3::from_diagonal(dvec3(1.0, 1.0, 4.0)), sheared, DMat3::ZERO];
        let instances = matrices.iter().enumerate().map(|(i, m)| at(100.0 * i as f64, *m)).collect();
        let points = points(&scene(vec![mesh], instances), 20_000);
        let areas = matrices.map(|m| 0.5 * (m.x_axis.cross(m.y_axis).length() + m.y_axis.cross(m.z_axis).length()));
        for (i, area) in areas.iter().enumerate() {
            let share = share_where(&points, |p| (p.z - 100.0 * i as f64).abs() < 50.0);
            assert!((share - area / areas.iter().sum::<f64>()).abs() < 0.015, "{i}: {share}");
        }
    }

    #[test]
    fn nothing_with_an_area_gives_no_points() {
        let flat = mesh(&[[Vec3::ZERO, Vec3::X, Vec3::X]]);
        assert_eq!(points(&scene(vec![], vec![]), 10), []);
        assert_eq!(points(&scene(vec![flat], vec![instance(0, DAffine3::IDENTITY)]), 10), []);
        let whole = mesh(&[corner(0.0, 1.0, 1.0)]);
        assert_eq!(points(&scene(vec![whole], vec![instance(0, DAffine3::from_scale(DVec3::ZERO))]), 10), []);
    }

    #[test]
    fn extreme_scales_give_points() {
        for scale in [1e-30, 1e30] {
            let whole = mesh(&[corner(0.0, 1.0, 1.0)]);
            let scene = scene(vec![whole], vec![instance(0, DAffine3::from_scale(DVec3::splat(scale)))]);
            let points = points(&scene, 1000);
            assert_eq!(points.len(), 1000);
            assert!(points.iter().all(|p| p.is_finite() && p.x <= scale));
        }
    }
}
