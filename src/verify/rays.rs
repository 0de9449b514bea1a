//! The rays of a verification: four kinds, from the input alone, the same for every tracer and number of threads.

use std::convert::Infallible;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::PerKind;
use super::cpu::{Reference, TrueHit};
use super::random::Random;
use super::rounding::SINGLE;
use super::view::{Stage, View};
use crate::scene::{InstanceId, Scene, TriangleRef};

/// A ray. Hits between `t_min` and `t_max`, in units of the direction's length and excluding both, count.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Origin; finite.
    pub origin: Vec3,
    /// Direction; finite and not zero. Generated rays have a direction of length one.
    pub direction: Vec3,
    /// Smallest distance that counts; at least 0.
    pub t_min: f32,
    /// Largest distance that counts.
    pub t_max: f32,
}

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RayKind {
    /// From the camera.
    Primary,
    /// From a point seen by the camera to a point of an area light.
    Shadow,
    /// From a point seen by the camera, cosine-distributed about the normal.
    Diffuse,
    /// Uniform random lines.
    Random,
}

impl RayKind {
    /// All kinds, in the order of their declaration.
    pub const ALL: [RayKind; 4] = [RayKind::Primary, RayKind::Shadow, RayKind::Diffuse, RayKind::Random];

    /// Returns the name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Primary => "primary",
            RayKind::Shadow => "shadow",
            RayKind::Diffuse => "diffuse",
            RayKind::Random => "random",
        }
    }
}

/// The rays of a verification.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    /// The rays of each kind.
    pub kinds: PerKind<Vec<Ray>>,
    /// Description of where the primary rays come from.
    pub view: String,
    /// Half the diagonal of the scene's box, in world units.
    pub radius: f64,
}

/// Largest number of rays per kind: they are held in memory, 32 bytes each, with their hits.
pub const MOST_RAYS: u32 = 1 << 24;
/// Number of directions tried to find out whether a scene surrounds its centre.
const PROBES: usize = 256;
/// A view is usable if at least one primary ray in this many hits something.
const RAYS_PER_HIT: usize = 64;
/// Offset of rays that start at a surface, in radii of the scene. Exceeds the position error allowed by default.
const OFFSET: f64 = 2e-5;

/// Streams of random numbers.
mod stream {
    pub(super) const PROBE: u64 = 0;
    pub(super) const PRIMARY: u64 = 1;
    pub(super) const SHADOW: u64 = 2;
    pub(super) const DIFFUSE: u64 = 3;
    pub(super) const RANDOM: u64 = 4;
    pub(super) const SURFACE: u64 = 5;
    pub(super) const SPHERE: u64 = 6;
}

/// Generates `count` rays of each kind; none for a scene without triangles.
///
/// - Primary: a regular grid over the picture, jittered within its cells, of the file's first camera. If there is
///   none, or fewer than one ray in 64 hits anything, of the automatic camera ([`View::automatic`]); if that
///   sees as little, from points of the sphere around the scene to points of random triangles.
/// - Shadow: from the points the primary rays hit to random points of a square light ([`Stage::light`]).
/// - Diffuse: from the same points, cosine-distributed about the normal on the side seen.
/// - Random: lines through the sphere around the scene's box under the measure that motions leave alone (L. Santaló,
///   "Integral Geometry and Geometric Probability", 1976): a uniform direction, and a uniform point of the disc
///   across it.
///
/// Rays from a surface start off it by 2e-5 radii of the scene, or by 64 roundings of their coordinates if that is
/// more. A scene is an interior if at least three quarters of 256 random directions from the middle of its box hit
/// something, more of them its front than its back.
pub fn generate(scene: &Scene, reference: &Reference, count: usize, seed: u64) -> Rays {
    let Ok(rays) = generate_by(scene, |rays| Ok::<_, Infallible>(reference.closest(rays)), count, seed);
    rays
}

/// Like [`generate`], where `closest` returns the first hits of rays, for example from a device for millions of them.
///
/// # Errors
/// Returns the errors of `closest`.
pub fn generate_by<E>(
    scene: &Scene,
    closest: impl Fn(&[Ray]) -> Result<Vec<Option<TrueHit>>, E>,
    count: usize,
    seed: u64,
) -> Result<Rays, E> {
    let bounds = scene.bounds();
    if bounds.is_empty() || scene.triangles_placed() == 0 {
        return Ok(Rays { kinds: Default::default(), view: "nothing to see".into(), radius: 0.0 });
    }
    let mut stage = Stage::new(bounds);
    stage.enclosed = is_enclosed(&closest(&probes(&stage, seed))?);
    let maker = Maker { scene, stage, count, seed };
    let (view, mut primary, seen) = maker.look(&closest)?;
    let kinds = PerKind::of(|kind| match kind {
        RayKind::Primary => std::mem::take(&mut primary),
        RayKind::Shadow => maker.rays(|i| maker.shadow(i, &seen)),
        RayKind::Diffuse => maker.rays(|i| maker.diffuse(i, &seen)),
        RayKind::Random => maker.rays(|i| maker.random(i)),
    });
    Ok(Rays { kinds, view, radius: stage.radius })
}

fn probes(stage: &Stage, seed: u64) -> Vec<Ray> {
    let probe = |i| Ray::endless(stage.center, Random::at(seed, stream::PROBE, i).direction());
    (0..PROBES).map(probe).collect()
}

fn is_enclosed(hits: &[Option<TrueHit>]) -> bool {
    let all = hits.iter().flatten().count();
    let front = hits.iter().flatten().filter(|h| h.front).count();
    4 * all >= 3 * PROBES && 2 * front > all
}

/// A point of a surface, with the normal of the side it is seen from.
struct Seen {
    point: DVec3,
    normal: DVec3,
}

struct Maker<'a> {
    scene: &'a Scene,
    stage: Stage,
    count: usize,
    seed: u64,
}

impl Maker<'_> {
    fn rays(&self, ray: impl Fn(usize) -> Ray + Sync + Send) -> Vec<Ray> {
        (0..self.count).into_par_iter().map(ray).collect()
    }

    /// Returns the primary rays of the first usable view, and what they hit.
    fn look<E>(
        &self,
        closest: &impl Fn(&[Ray]) -> Result<Vec<Option<TrueHit>>, E>,
    ) -> Result<(String, Vec<Ray>, Vec<Seen>), E> {
        let views = self.scene.cameras.iter().take(1).filter_map(View::of);
        for view in views.chain([View::automatic(&self.stage)]) {
            let rays = self.primary(&view);
            let seen = self.seen(&rays, &closest(&rays)?);
            if seen.len() * RAYS_PER_HIT >= self.count && !seen.is_empty() {
                return Ok((view.name, rays, seen));
            }
        }
        let targets: Vec<Seen> = (0..self.count).into_par_iter().map(|i| self.surface_point(i)).collect();
        let rays = self.rays(|i| {
            let from = self.stage.center + 1.5 * self.stage.radius * self.random_at(stream::SPHERE, i).direction();
            Ray::endless(from, targets[i].point - from)
        });
        let seen = self.seen(&rays, &closest(&rays)?);
        Ok(("random points around the scene".into(), rays, if seen.is_empty() { targets } else { seen }))
    }

    fn primary(&self, view: &View) -> Vec<Ray> {
        let columns = (self.count as f64 * view.aspect_ratio()).sqrt().round().clamp(1.0, self.count.max(1) as f64);
        let rows = self.count.div_ceil(columns as usize).max(1);
        self.rays(|i| {
            let mut random = self.random_at(stream::PRIMARY, i);
            let (column, row) = (i % columns as usize, i / columns as usize);
            let x = (column as f64 + random.unit()) / columns;
            let y = (row as f64 + random.unit()) / rows as f64;
            let (origin, direction) = view.ray([2.0 * x - 1.0, 1.0 - 2.0 * y]);
            Ray::endless(origin, direction)
        })
    }

    fn seen(&self, rays: &[Ray], hits: &[Option<TrueHit>]) -> Vec<Seen> {
        let seen = |(ray, hit): (&Ray, &Option<TrueHit>)| hit.as_ref().map(|hit| self.seen_at(ray, hit));
        rays.par_iter().zip(hits).filter_map(seen).collect()
    }

    fn seen_at(&self, ray: &Ray, hit: &TrueHit) -> Seen {
        let direction = ray.direction.as_dvec3();
        let front = normal(&self.scene.world_corners(hit.at));
        let normal = front.map_or(-direction.normalize_or(DVec3::Z), |n| if hit.front { n } else { -n });
        Seen { point: ray.origin.as_dvec3() + hit.t * direction, normal }
    }

    /// Returns a point of a random triangle; each placed triangle is equally likely.
    fn surface_point(&self, index: usize) -> Seen {
        let mut random = self.random_at(stream::SURFACE, index);
        let [a, b, c] = self.scene.world_corners(self.random_triangle(&mut random));
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Seen { point: a + u * (b - a) + v * (c - a), normal: normal(&[a, b, c]).unwrap_or(DVec3::Y) }
    }

    fn random_triangle(&self, random: &mut Random) -> TriangleRef {
        let instance = random.below(self.scene.instances.len() as u64) as u32;
        let count = self.scene.mesh_of(InstanceId(instance)).triangle_count() as u64;
        TriangleRef { instance, triangle: random.below(count.max(1)) as u32 }
    }

    fn shadow(&self, index: usize, seen: &[Seen]) -> Ray {
        let mut random = self.random_at(stream::SHADOW, index);
        let light = self.stage.light([random.unit(), random.unit()]);
        let Seen { point, normal } = seen[index % seen.len()];
        // A surface whose visible side faces away from the light is lit from behind.
        let side = if normal.dot(light - point) < 0.0 { -normal } else { normal };
        let origin = self.off(point, side);
        let way = light - origin;
        Ray { t_max: single(way.length()), ..Ray::endless(origin, way) }
    }

    fn diffuse(&self, index: usize, seen: &[Seen]) -> Ray {
        let mut random = self.random_at(stream::DIFFUSE, index);
        let Seen { point, normal } = seen[index % seen.len()];
        // A uniform direction added to the normal is cosine-distributed about it.
        let direction = (normal + random.direction()).try_normalize().unwrap_or(normal);
        Ray::endless(self.off(point, normal), direction)
    }

    fn random(&self, index: usize) -> Ray {
        let mut random = self.random_at(stream::RANDOM, index);
        let direction = random.direction();
        let (x, y) = direction.any_orthonormal_pair();
        let across = random.in_disc();
        let origin = self.stage.center + self.stage.radius * (across.x * x + across.y * y - direction);
        Ray::endless(origin, direction)
    }

    /// Returns a point slightly off a surface, as a ray stores it.
    fn off(&self, point: DVec3, normal: DVec3) -> DVec3 {
        let rounding = 64.0 * SINGLE * point.abs().max_element();
        storable(point + normal * rounding.max(OFFSET * self.stage.radius)).as_dvec3()
    }

    fn random_at(&self, stream: u64, index: usize) -> Random {
        Random::at(self.seed, stream, index)
    }
}

impl Ray {
    /// Returns a ray without an end. Numbers beyond single precision are clamped to it; a zero direction becomes z.
    pub(super) fn endless(origin: DVec3, direction: DVec3) -> Ray {
        let largest = direction.abs().max_element();
        let direction = (direction / largest).normalize_or(DVec3::Z);
        Ray { origin: storable(origin), direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX }
    }
}

fn storable(point: DVec3) -> Vec3 {
    Vec3::from_array(point.to_array().map(single))
}

/// Returns the nearest finite `f32`; zero for NaN.
fn single(x: f64) -> f32 {
    let most = f64::from(f32::MAX);
    if x.is_nan() { 0.0 } else { x.clamp(-most, most) as f32 }
}

/// Returns the normal on the side on which corners run counter-clockwise; `None` for a triangle without area.
fn normal(corners: &[DVec3; 3]) -> Option<DVec3> {
    let [a, b, c] = *corners;
    let (ab, ac) = (b - a, c - a);
    let size = ab.abs().max(ac.abs()).max_element();
    (ab / size).cross(ac / size).try_normalize()
}
