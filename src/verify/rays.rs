//! The rays of a verification: four kinds, from the input alone, the same for every tracer and number of threads.

#[cfg_attr(not(feature = "lab"), allow(dead_code, reason = "pictures use its light, the lab alone the rest"))]
pub(crate) mod shot;

use std::convert::Infallible;
use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::PerKind;
use super::cpu::{Reference, TrueHit};
use super::random::Random;
use super::rounding::SINGLE;
use super::view::{Stage, View};
use super::views::{self, DEFAULT_VIEWS, PlacedView, Role, Source};
use crate::scene::{Bounds, InstanceId, Scene, TriangleRef};

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
    /// The views, each with its share of the rays of every kind.
    pub views: Vec<RaysOfView>,
    /// Half the diagonal of the scene's box, in world units.
    pub radius: f64,
}

/// The rays of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct RaysOfView {
    /// Description of where the primary rays come from.
    pub name: String,
    /// Share of the picture that shows something, from 256 rays; 0 if rays come from all around.
    pub seen_ratio: f64,
    /// What the view is for.
    pub role: Role,
    /// Which rays of each kind are the view's.
    pub range: Range<usize>,
}

/// Which rays to generate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Number of rays of each kind, over all views.
    pub rays_per_kind: usize,
    /// Number of views, those of other roles included; at least [`FEWEST_VIEWS`](super::views::FEWEST_VIEWS).
    pub views: u32,
    /// Only the views of this role; `None`: all views.
    pub role: Option<Role>,
    /// Seed of views and rays.
    pub seed: u64,
}

impl Sampling {
    /// Rays from all of the default number of views.
    pub fn new(rays_per_kind: usize, seed: u64) -> Sampling {
        Sampling { rays_per_kind, views: DEFAULT_VIEWS, role: None, seed }
    }
}

/// Largest number of rays per kind: they are held in memory, 32 bytes each, with their hits.
pub const MOST_RAYS: u32 = 1 << 24;
/// Number of directions tried to find out whether a scene surrounds its centre.
const PROBES: usize = 256;
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

/// Finds the first hits of rays, by a device or otherwise.
pub type FirstHits<'a, E> = dyn Fn(&[Ray]) -> Result<Vec<Option<TrueHit>>, E> + 'a;

/// Generates rays; none for a scene without triangles.
///
/// - Primary: a regular grid over the picture of each view, jittered within its cells. The views are the file's cameras,
///   or the automatic one ([`View::automatic`]) if there are none, and then viewpoints inside the scene and around it.
///   A camera that sees less than a 64th of its picture is left out, and viewpoints are tried until one sees an eighth.
///   If none sees a 64th, rays go from points of the sphere around the scene to points of random triangles.
/// - Shadow: from the points the primary rays of the same view hit to random points of a square light
///   ([`Stage::light`]).
/// - Diffuse: from the same points, cosine-distributed about the normal on the side seen.
/// - Random: lines through the sphere around the scene's box under the measure that motions leave alone (L. Santaló,
///   "Integral Geometry and Geometric Probability", 1976): a uniform direction, and a uniform point of the disc
///   across it.
///
/// Rays from a surface start off it by 2e-5 radii of the scene, or by 64 roundings of their coordinates if that is
/// more. A scene is an interior if at least three quarters of 256 random directions from the middle of its box hit
/// something, more of them its front than its back.
pub fn generate(scene: &Scene, reference: &Reference, sampling: &Sampling) -> Rays {
    let Ok(rays) = generate_by(scene, &|rays| Ok::<_, Infallible>(reference.closest(rays)), sampling);
    rays
}

/// Like [`generate`], where `closest` returns the first hits of rays, for example from a device for millions of them.
///
/// # Errors
/// Returns the errors of `closest`.
pub fn generate_by<E>(scene: &Scene, closest: &FirstHits<E>, sampling: &Sampling) -> Result<Rays, E> {
    let bounds = scene.bounds();
    if bounds.is_empty() || scene.triangles_placed() == 0 {
        return Ok(Rays { kinds: Default::default(), views: Vec::new(), radius: 0.0 });
    }
    let Sampling { rays_per_kind: count, seed, role, .. } = *sampling;
    let stage = stage(bounds, closest, seed)?;
    let placed = views::place(scene, &stage, closest, sampling.views as usize, seed)?;
    let placed = placed.into_iter().enumerate().map(|(i, view)| (Role::of(i), view));
    let placed: Vec<(Role, PlacedView)> = placed.filter(|(of, _)| role.is_none_or(|role| role == *of)).collect();
    let maker = Maker { scene, stage, seed };
    let mut rays = Rays { kinds: Default::default(), views: Vec::new(), radius: stage.radius };
    for (i, (role, view)) in placed.iter().enumerate() {
        let range = i * count / placed.len()..(i + 1) * count / placed.len();
        let mut of_view = maker.of_view(view, range.clone(), closest)?;
        for (kind, of_kind) in rays.kinds.iter_mut() {
            of_kind.append(&mut of_view[kind]);
        }
        rays.views.push(RaysOfView { name: view.name.clone(), seen_ratio: view.seen_ratio, role: *role, range });
    }
    Ok(rays)
}

/// Generates as many rays of each kind from one view, as [`generate`] does; none for a scene without triangles. `stage`
/// places the light and the random lines, so that they stay where they are while things move.
///
/// # Errors
/// Returns the errors of `closest`.
pub(crate) fn generate_from<E>(
    scene: &Scene,
    stage: Stage,
    view: View,
    closest: &FirstHits<E>,
    sampling: (usize, u64),
) -> Result<PerKind<Vec<Ray>>, E> {
    let (count, seed) = sampling;
    if scene.instances.is_empty() {
        return Ok(PerKind::default());
    }
    let view = PlacedView { name: String::new(), source: Source::View(view), seen_ratio: 1.0 };
    Maker { scene, stage, seed }.of_view(&view, 0..count, closest)
}

impl Rays {
    /// Returns the rays of the views of a role.
    pub(super) fn of_role(&self, role: Role) -> Rays {
        let mut of_role = Rays { kinds: Default::default(), views: Vec::new(), radius: self.radius };
        for view in self.views.iter().filter(|view| view.role == role) {
            of_role.add(view, self.kinds.each_ref().map(|rays| rays[view.range.clone()].to_vec()));
        }
        of_role
    }

    /// Returns about `count` rays of each kind, at regular intervals in each view.
    pub(super) fn thinned(&self, count: usize) -> Rays {
        let views = if count == 0 { &[][..] } else { &self.views };
        let step = self.kinds.values().map(Vec::len).max().unwrap_or(0).div_ceil(count.max(1)).max(1);
        let mut thinned = Rays { kinds: Default::default(), views: Vec::new(), radius: self.radius };
        for view in views {
            let thin = |rays: &Vec<Ray>| rays[view.range.clone()].iter().step_by(step).copied().collect();
            thinned.add(view, self.kinds.each_ref().map(thin));
        }
        thinned
    }

    /// Adds the rays of a view, as many of each kind.
    fn add(&mut self, view: &RaysOfView, mut kinds: PerKind<Vec<Ray>>) {
        let start = self.kinds[RayKind::Primary].len();
        let range = start..start + kinds[RayKind::Primary].len();
        self.views.push(RaysOfView { range, ..view.clone() });
        for (kind, rays) in kinds.iter_mut() {
            self.kinds[kind].append(rays);
        }
    }
}

fn generated(range: Range<usize>, ray: &(dyn Fn(usize) -> Ray + Sync)) -> Vec<Ray> {
    range.into_par_iter().map(ray).collect()
}

/// Returns the stage of a box, which must not be empty: an interior if [`generate`] takes it for one.
pub(crate) fn stage<E>(bounds: Bounds, closest: &FirstHits<E>, seed: u64) -> Result<Stage, E> {
    let mut stage = Stage::new(bounds);
    stage.enclosed = is_enclosed(&closest(&probes(&stage, seed))?);
    Ok(stage)
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
    seed: u64,
}

impl Maker<'_> {
    /// Returns the rays of each kind of a view.
    fn of_view<E>(
        &self,
        view: &PlacedView,
        range: Range<usize>,
        closest: &FirstHits<E>,
    ) -> Result<PerKind<Vec<Ray>>, E> {
        let (mut primary, seen) = self.look(view, range.clone(), closest)?;
        Ok(PerKind::of(|kind| match kind {
            RayKind::Primary => std::mem::take(&mut primary),
            RayKind::Shadow => generated(range.clone(), &|i| self.shadow(i, &seen)),
            RayKind::Diffuse => generated(range.clone(), &|i| self.diffuse(i, &seen)),
            RayKind::Random => generated(range.clone(), &|i| self.random(i)),
        }))
    }

    /// Returns the primary rays of a view, and what they hit; if they hit nothing, points of random triangles instead.
    fn look<E>(
        &self,
        view: &PlacedView,
        range: Range<usize>,
        closest: &FirstHits<E>,
    ) -> Result<(Vec<Ray>, Vec<Seen>), E> {
        let rays = match &view.source {
            Source::View(view) => self.primary(view, range.clone()),
            Source::Around => generated(range.clone(), &|i| self.toward_surface(i)),
        };
        let seen = self.seen(&rays, &closest(&rays)?);
        Ok((rays, if seen.is_empty() { self.surface_points(range) } else { seen }))
    }

    fn surface_points(&self, range: Range<usize>) -> Vec<Seen> {
        range.into_par_iter().map(|i| self.surface_point(i)).collect()
    }

    fn primary(&self, view: &View, range: Range<usize>) -> Vec<Ray> {
        let count = range.len();
        let columns = (count as f64 * view.aspect_ratio()).sqrt().round().clamp(1.0, count.max(1) as f64);
        let rows = count.div_ceil(columns as usize).max(1);
        let first = range.start;
        generated(range, &|i| {
            let mut random = self.random_at(stream::PRIMARY, i);
            let (column, row) = ((i - first) % columns as usize, (i - first) / columns as usize);
            let x = (column as f64 + random.unit()) / columns;
            let y = (row as f64 + random.unit()) / rows as f64;
            let (origin, direction) = view.ray([2.0 * x - 1.0, 1.0 - 2.0 * y]);
            Ray::endless(origin, direction)
        })
    }

    /// Returns a ray from the sphere around the scene to a point of a random triangle.
    fn toward_surface(&self, index: usize) -> Ray {
        let from = self.stage.center + 1.5 * self.stage.radius * self.random_at(stream::SPHERE, index).direction();
        Ray::endless(from, self.surface_point(index).point - from)
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
        self.toward(light, &seen[index % seen.len()])
    }

    /// Returns a ray from a point of a surface to a point of a light.
    fn toward(&self, light: DVec3, seen: &Seen) -> Ray {
        let Seen { point, normal } = *seen;
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

    fn off(&self, point: DVec3, normal: DVec3) -> DVec3 {
        off_surface(point, normal, self.stage.radius)
    }

    fn random_at(&self, stream: u64, index: usize) -> Random {
        Random::at(self.seed, stream, index)
    }
}

impl Ray {
    /// Returns a ray without an end. Numbers beyond single precision are clamped to it; a zero direction becomes z.
    pub(crate) fn endless(origin: DVec3, direction: DVec3) -> Ray {
        let largest = direction.abs().max_element();
        let direction = (direction / largest).normalize_or(DVec3::Z);
        Ray { origin: storable(origin), direction: direction.as_vec3(), t_min: 0.0, t_max: f32::MAX }
    }
}

/// Returns a point slightly off a surface of a scene with a radius, as a ray stores it.
pub(crate) fn off_surface(point: DVec3, normal: DVec3, radius: f64) -> DVec3 {
    let rounding = 64.0 * SINGLE * point.abs().max_element();
    storable(point + normal * rounding.max(OFFSET * radius)).as_dvec3()
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
