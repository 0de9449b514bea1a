//! The tracer under test: single precision throughout, as on a device. And, for experiments, the same traversal in other
//! arithmetic.

use std::convert::Infallible;
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::arithmetic::{Arithmetic, Double, Recentred, Single};
use super::boxes::Real;
use super::fast::PlainRay;
use super::reference::TrueHit;
use super::search::{Found, Interval, Stacks, Steps, search};
use super::two_level::{Entry, TwoLevel};
use super::watertight::ShearedRay;
use crate::scene::TriangleRef;
use crate::verify::rays::{Ray, RayKind};
use crate::verify::work::Work;
use crate::verify::{Hit, TimingHints, Tracer};

/// Number of rays per task: few enough to spread over threads, enough to amortise its stacks.
const BATCH: usize = 256;

/// Default number of rays timed per kind, which take milliseconds. Steps decide on the CPU, times are shown beside them.
const TIMED: u32 = 1024;

/// Traces rays in some arithmetic.
struct Computing<'a, A: Arithmetic> {
    accel: &'a TwoLevel,
    /// How rays enter each entry; `None` if its transform overflows.
    ways: Vec<Option<A::Way>>,
}

impl<'a, A: Arithmetic> Computing<'a, A> {
    fn new(accel: &'a TwoLevel) -> Self {
        let way = |entry: &Entry| A::way(entry, &accel.bottom[entry.mesh as usize]);
        Computing { accel, ways: accel.entries.iter().map(way).collect() }
    }

    fn trace(&self, ray: &Ray, any: bool, stacks: &mut Stacks<A::Number>) -> Option<Found<A::Number>> {
        self.trace_counting(ray, any, stacks, |_| true)
    }

    /// Like [`Computing::trace`], for the hits that `counts` accepts.
    fn trace_counting(
        &self,
        ray: &Ray,
        any: bool,
        stacks: &mut Stacks<A::Number>,
        counts: impl FnMut(&Found<A::Number>) -> bool,
    ) -> Option<Found<A::Number>> {
        let scale = self.accel.scale;
        let scaled = |x: f32| A::Number::nearest(f64::from(x) * scale);
        let world = A::ray(ray.origin.as_dvec3() * scale, ray.direction.as_dvec3());
        let boxes = A::slab(&world, self.accel.reach);
        let within = Interval { t_min: scaled(ray.t_min), t_max: scaled(ray.t_max), any };
        let enter = |at: usize, _: &Entry| self.ways[at].as_ref().map(|way| A::enter(way, &world));
        let corners = |_: &Entry, c: &[Vec3; 3]| c.map(|p| p.to_array().map(A::Number::from));
        search(self.accel, &boxes, within, stacks, enter, corners, counts)
    }

    fn each<R: Send>(&self, rays: &[Ray], trace: &(dyn Fn(&Ray, &mut Stacks<A::Number>) -> R + Sync)) -> Vec<R> {
        rays.par_iter()
            .with_min_len(BATCH)
            .map_init(|| Stacks::new(self.accel), |stacks, ray| trace(ray, stacks))
            .collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        self.each(rays, &|ray, stacks| self.trace(ray, true, stacks).is_some())
    }

    /// Returns the first hits, with distances as exact as they were computed.
    fn closest(&self, rays: &[Ray]) -> Vec<Option<TrueHit>> {
        let hit = |found: Found<A::Number>| TrueHit {
            t: found.t.exact() / self.accel.scale,
            at: TriangleRef { instance: self.accel.entries[found.entry].instance, triangle: found.triangle },
            front: found.front,
        };
        self.each(rays, &|ray, stacks| self.trace(ray, false, stacks).map(hit))
    }
}

/// Traces rays on the CPU as a device does: the ray is transformed into the mesh of an instance by a matrix of 32-bit
/// floats, and the direction keeps its length, so that distances need no conversion. The front is the side on which the
/// corners run counter-clockwise in the mesh: a mirroring instance flips that side, as glTF requires.
pub struct CpuTracer<'a>(Computing<'a, Single<ShearedRay<f32>>>);

impl<'a> CpuTracer<'a> {
    /// Creates a tracer that uses built trees.
    pub fn new(accel: &'a TwoLevel) -> Self {
        CpuTracer(Computing::new(accel))
    }

    /// Returns the first hit of each ray.
    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        self.0.each(rays, &|ray, stacks| self.0.trace(ray, false, stacks).map(|found| self.hit(&found)))
    }

    /// Returns, for each ray, whether it hits anything.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        self.0.occluded(rays)
    }

    /// Returns the steps of each ray to the first hit, or to any.
    pub fn steps(&self, rays: &[Ray], any: bool) -> Vec<Steps> {
        self.0.each(rays, &|ray, stacks| {
            self.0.trace(ray, any, stacks);
            stacks.steps
        })
    }

    /// Returns what traces single rays on this thread.
    pub fn probe(&self) -> Probe<'_> {
        Probe { tracer: self, stacks: Stacks::new(self.0.accel) }
    }

    fn hit(&self, found: &Found<f32>) -> Hit {
        Hit {
            t: (f64::from(found.t) / self.0.accel.scale) as f32,
            instance: self.0.accel.entries[found.entry].instance,
            triangle: found.triangle,
            front: found.front,
        }
    }
}

/// Traces one ray after another on one thread; allocates nothing per ray.
pub struct Probe<'a> {
    tracer: &'a CpuTracer<'a>,
    stacks: Stacks<f32>,
}

impl Probe<'_> {
    /// Returns the first hit of a ray that `counts` accepts. `counts` is asked about hits in no particular order, and only
    /// about those nearer than the nearest one accepted so far: if it accepts none, about all of them.
    pub fn closest(&mut self, ray: &Ray, counts: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.trace(ray, false, counts)
    }

    /// Returns a hit of a ray that `counts` accepts, not necessarily the first.
    pub fn any(&mut self, ray: &Ray, counts: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.trace(ray, true, counts)
    }

    /// Returns the steps of the last ray.
    pub fn steps(&self) -> Steps {
        self.stacks.steps
    }

    fn trace(&mut self, ray: &Ray, any: bool, mut counts: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let tracer = self.tracer;
        let found = tracer.0.trace_counting(ray, any, &mut self.stacks, |found| counts(&tracer.hit(found)));
        found.map(|found| tracer.hit(&found))
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

    fn work(&self, kind: RayKind, rays: &[Ray]) -> Option<Work> {
        Some(self.steps(rays, kind == RayKind::Shadow).iter().collect())
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

/// The arithmetic of a [`ComputingTracer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Single precision, with the test of Moeller and Trumbore.
    F32Fast,
    /// Single precision, with the watertight test: as [`CpuTracer`].
    F32Watertight,
    /// Single precision relative to each mesh, with the watertight test and a transform in double precision.
    F32Recentred,
    /// Double precision, with the watertight test.
    F64,
}

impl Precision {
    /// All of them, fastest first.
    pub const ALL: [Precision; 4] =
        [Precision::F32Fast, Precision::F32Watertight, Precision::F32Recentred, Precision::F64];

    /// Returns the name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Precision::F32Fast => "f32-fast",
            Precision::F32Watertight => "f32-watertight",
            Precision::F32Recentred => "f32-recentred",
            Precision::F64 => "f64",
        }
    }
}

/// Traces rays on the CPU in a chosen arithmetic, for experiments; verifications use [`CpuTracer`].
pub struct ComputingTracer<'a>(In<'a>);

enum In<'a> {
    Fast(Computing<'a, Single<PlainRay<f32>>>),
    Watertight(Computing<'a, Single<ShearedRay<f32>>>),
    Recentred(Computing<'a, Recentred>),
    Double(Computing<'a, Double>),
}

impl<'a> ComputingTracer<'a> {
    /// Creates a tracer that uses built trees.
    pub fn new(accel: &'a TwoLevel, precision: Precision) -> Self {
        ComputingTracer(match precision {
            Precision::F32Fast => In::Fast(Computing::new(accel)),
            Precision::F32Watertight => In::Watertight(Computing::new(accel)),
            Precision::F32Recentred => In::Recentred(Computing::new(accel)),
            Precision::F64 => In::Double(Computing::new(accel)),
        })
    }

    /// Returns the first hit of each ray, with its distance as it was computed.
    pub fn closest(&self, rays: &[Ray]) -> Vec<Option<TrueHit>> {
        match &self.0 {
            In::Fast(tracer) => tracer.closest(rays),
            In::Watertight(tracer) => tracer.closest(rays),
            In::Recentred(tracer) => tracer.closest(rays),
            In::Double(tracer) => tracer.closest(rays),
        }
    }

    /// Returns, for each ray, whether it hits anything.
    pub fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        match &self.0 {
            In::Fast(tracer) => tracer.occluded(rays),
            In::Watertight(tracer) => tracer.occluded(rays),
            In::Recentred(tracer) => tracer.occluded(rays),
            In::Double(tracer) => tracer.occluded(rays),
        }
    }
}
