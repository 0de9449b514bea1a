//! The tracer under test: single precision throughout, as on a device.

use std::convert::Infallible;
use std::time::Instant;

use glam::{Affine3A, DAffine3, Vec3, Vec3A};
use rayon::prelude::*;

use super::boxes::BoxRay;
use super::search::{Found, Inside, Interval, Stacks, Steps, search};
use super::two_level::{Entry, TwoLevel};
use super::watertight::ShearedRay;
use crate::verify::rays::{Ray, RayKind};
use crate::verify::{Hit, TimingHints, Tracer};

/// Number of rays per task: few enough to spread over threads, enough to amortise its stacks.
const BATCH: usize = 256;

/// Default number of rays timed per kind, which take milliseconds.
const TIMED: u32 = 2048;

/// Padding of boxes, in multiples of the largest coordinate in a slab test.
const PAD: f32 = 4.0 * f32::EPSILON;

/// Traces rays on the CPU as a device does: the ray is transformed into the mesh of an instance by a matrix of 32-bit
/// floats, and the direction keeps its length, so that distances need no conversion. The front is the side on which the
/// corners run counter-clockwise in the mesh: a mirroring instance flips that side, as glTF requires.
pub struct CpuTracer<'a> {
    accel: &'a TwoLevel,
    /// The mesh-from-world transform of each entry; `None` if it overflows.
    to_mesh: Vec<Option<Affine3A>>,
}

impl<'a> CpuTracer<'a> {
    /// Creates a tracer that uses built trees.
    pub fn new(accel: &'a TwoLevel) -> Self {
        CpuTracer { accel, to_mesh: accel.entries.iter().map(|e| single(&e.to_mesh)).collect() }
    }

    /// Returns the first hit of each ray.
    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        self.each(rays, |ray, stacks| self.trace(ray, false, stacks))
    }

    /// Returns, for each ray, whether it hits anything.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        self.each(rays, |ray, stacks| self.trace(ray, true, stacks).is_some())
    }

    /// Returns the steps of each ray to the first hit, or to any.
    pub fn steps(&self, rays: &[Ray], any: bool) -> Vec<Steps> {
        self.each(rays, |ray, stacks| {
            self.trace(ray, any, stacks);
            stacks.steps
        })
    }

    fn trace(&self, ray: &Ray, any: bool, stacks: &mut Stacks<f32>) -> Option<Hit> {
        let scale = |x: f32| (f64::from(x) * self.accel.scale) as f32;
        let origin = Vec3A::from_array(ray.origin.to_array().map(scale));
        let direction = Vec3A::from(ray.direction);
        let boxes = slab_ray(origin, direction, self.accel.reach as f32);
        let within = Interval { t_min: scale(ray.t_min), t_max: scale(ray.t_max), any };
        let enter = |at: usize| {
            let to_mesh = self.to_mesh[at]?;
            let (o, d) = (to_mesh.transform_point3a(origin), to_mesh.transform_vector3a(direction));
            Some(Inside { boxes: slab_ray(o, d, 2.0), triangles: ShearedRay::new(o.to_array(), d.to_array()) })
        };
        let corners = |_: &Entry, c: &[Vec3; 3]| c.map(|p| p.to_array());
        search(self.accel, &boxes, within, stacks, |at, _| enter(at), corners, |_| true).map(|found| self.hit(&found))
    }

    fn hit(&self, found: &Found<f32>) -> Hit {
        Hit {
            t: (f64::from(found.t) / self.accel.scale) as f32,
            instance: self.accel.entries[found.entry].instance,
            triangle: found.triangle,
            front: found.front,
        }
    }

    fn each<R: Send>(&self, rays: &[Ray], trace: impl Fn(&Ray, &mut Stacks<f32>) -> R + Sync) -> Vec<R> {
        rays.par_iter()
            .with_min_len(BATCH)
            .map_init(|| Stacks::new(self.accel), |stacks, ray| trace(ray, stacks))
            .collect()
    }
}

impl Tracer for CpuTracer<'_> {
    type Rays<'r> = &'r [Ray];
    type Error = Infallible;

    fn device(&self) -> String {
        match rayon::current_num_threads() {
            1 => "CPU, 1 thread".into(),
            n => format!("CPU, {n} threads"),
        }
    }

    fn pace(&self) -> TimingHints {
        TimingHints { most_rays: Some(TIMED), ..TimingHints::default() }
    }

    fn prepare<'r>(&self, rays: &'r [Ray]) -> Result<&'r [Ray], Infallible> {
        Ok(rays)
    }

    fn closest(&self, rays: &&[Ray]) -> Result<Vec<Option<Hit>>, Infallible> {
        Ok(CpuTracer::closest(self, rays))
    }

    fn occluded(&self, rays: &&[Ray]) -> Result<Vec<bool>, Infallible> {
        Ok(CpuTracer::occluded(self, rays))
    }

    fn seconds(&self, kind: RayKind, rays: &&[Ray]) -> Result<f64, Infallible> {
        let start = Instant::now();
        match kind {
            RayKind::Shadow => drop(std::hint::black_box(CpuTracer::occluded(self, rays))),
            _ => drop(std::hint::black_box(CpuTracer::closest(self, rays))),
        }
        Ok(start.elapsed().as_secs_f64())
    }
}

/// Returns a ray for slab tests against boxes whose coordinates are at most `reach`.
fn slab_ray(origin: Vec3A, direction: Vec3A, reach: f32) -> BoxRay<f32> {
    let pad = PAD * (origin.abs().max_element() + reach);
    BoxRay::new(origin.to_array(), direction.to_array(), pad)
}

/// Returns a transform in single precision, unless it overflows.
fn single(transform: &DAffine3) -> Option<Affine3A> {
    let single = Affine3A::from_cols_array(&transform.to_cols_array().map(|x| x as f32));
    single.is_finite().then_some(single)
}
